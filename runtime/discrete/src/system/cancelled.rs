//! What cancels in the equations of a field where neither loads nor reactions say how large its forces are.
//!
//! The largest nodal force of a field is what its residuals are relative to ([`System::scales`]): loads, reactions, linear
//! and nonlinear terms as wholes. Bodies that swell, are shrunk onto each other or move rigidly have neither loads nor
//! reactions, and each whole is zero. Then the parts are asked: what each group of fields does by the linear terms, what
//! each changing term does. Where these are rounding, too, no force acts at all: what is left is relative to the stiffness
//! times the motion, |K| |u|, and to what cancels inside laws.

use wfl_compiler::Class;

use super::{Residual, System};
use crate::assemble::TermError;

impl System {
    /// By dof, in the rows of this rank: the sum of the magnitudes of the forces of which the residual at `u` is made, those
    /// of constant terms, of the linear terms by each group of fields that meet, and of each changing term.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub fn contributions(&self, u: &[f64]) -> Result<Vec<f64>, TermError> {
        let n = u.len();
        let mut out = vec![0.0; n];
        let mut add = |mut part: Vec<f64>| {
            self.numbering.turn(&mut part);
            out.iter_mut().zip(&part).for_each(|(sum, x)| *sum += x.abs());
        };
        add(self.constant.clone());
        let change: Vec<f64> = match self.base.as_slice() {
            [] => u.to_vec(),
            base => u.iter().zip(base).map(|(u, base)| u - base).collect(),
        };
        let solved = || (0..self.fields.len()).filter(|k| self.range(*k).is_some());
        for group in solved().filter(|k| self.meets[*k] == *k) {
            let mut own = vec![0.0; n];
            for range in solved().filter(|k| self.meets[*k] == group).filter_map(|k| self.range(k)) {
                own[range.clone()].copy_from_slice(&change[range]);
            }
            let (mut part, mut sizes) = (vec![0.0; n], vec![0.0; n]);
            if self.multiply_linear(&own, None, [&mut part, &mut sizes, &mut []]) {
                add(part);
            }
        }
        let values = self.values(u);
        for term in self.terms.iter().filter(|t| t.law.class >= Class::Nonlinear) {
            let mut part = vec![0.0; n];
            self.add_own(term, values.view(), &mut part)?;
            add(part);
        }
        Ok(out)
    }

    /// The same with what cancels inside each changing term: the magnitudes of all that its points sum.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub fn summed(&self, u: &[f64]) -> Result<Vec<f64>, TermError> {
        let mut inside = vec![0.0; u.len()];
        let values = self.values(u);
        for term in self.terms.iter().filter(|t| t.law.class >= Class::Nonlinear) {
            term.add_own_summands(&self.mesh, values.view(), &mut inside, self.share.as_deref());
        }
        self.numbering.turn_sizes(&mut inside);
        let all = self.contributions(u)?;
        Ok(all.into_iter().zip(inside).map(|(sum, own)| sum.max(own)).collect())
    }

    /// By dof, in the rows of this rank: what rounding of the forces in the residual `here` at `u` is relative to, |K| |u| of
    /// the linear terms and what cancels inside the smooth laws of the others.
    #[must_use]
    pub fn cancelled(&self, u: &[f64], here: &Residual) -> Vec<f64> {
        let mut out = vec![0.0; u.len()];
        let values = self.values(u);
        for term in self.terms.iter().filter(|t| t.law.class == Class::Nonlinear) {
            term.add_own_summands(&self.mesh, values.view(), &mut out, self.share.as_deref());
        }
        self.numbering.turn_sizes(&mut out);
        out.iter_mut().zip(&here.linear_sizes).for_each(|(sum, size)| *sum += size);
        out
    }

    /// The extent of the mesh along the axis where it is the largest (length).
    #[must_use]
    pub fn extent(&self) -> f64 {
        self.extent
    }
}
