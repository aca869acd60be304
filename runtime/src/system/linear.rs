//! The part of the residual that is linear in the unknowns: by the matrix of the linear terms, or at their points.
//!
//! The matrix is the quicker way. Its entries are rounded, and where cells are long and thin the sum of a row leaves
//! `eps |K| |u|` of a motion that strains nothing, which may be more than the forces of the motion that is wanted: a
//! needle of length h and width w bends with mu w^2/h while its entries are E h. At the points the strain is found
//! first; what rounding leaves of it acts on the nodes of a cell with opposite forces, which move the needle by nothing.
//!
//! Promises: both ways give the same residual but for rounding. Does not decide which is used: `newton/refine.rs` does.

use wfl_compiler::Class;

use super::{Parts, System};
use crate::{assemble::TermError, csr::residual_and_size};

impl System {
    /// From now on evaluates the linear terms at their points, or by their matrix again.
    pub fn set_pointwise(&mut self, pointwise: bool) {
        self.pointwise = pointwise;
    }

    /// By dof: |K| |u| of the linear terms and the size of the constant ones, in the last residual.
    #[must_use]
    pub fn linear_magnitudes(&self) -> &[f64] {
        &self.magnitude
    }

    /// Adds the linear terms at `u` to `out`, which holds the constant ones (by dof, in the axes of the scene).
    pub(super) fn add_linear(&mut self, u: &[f64], out: &mut [f64]) -> Result<(), TermError> {
        let Some(linear) = &self.linear else { return Ok(()) };
        let mut part = vec![0.0; out.len()];
        let mut sizes = vec![0.0; out.len()];
        let nothing = vec![0.0; out.len()];
        residual_and_size(&[linear], &nothing, u, &mut part, &mut sizes, rayon::current_num_threads());
        part.iter_mut().for_each(|r| *r = -*r);
        self.magnitude.iter_mut().zip(&sizes).for_each(|(sum, size)| *sum += size);
        self.grow_force(&part);
        if !self.pointwise {
            out.iter_mut().zip(&part).for_each(|(slot, p)| *slot += p);
            return Ok(());
        }
        // the terms bring their constants with them
        out.fill(0.0);
        out.iter_mut().zip(&self.shift).for_each(|(slot, s)| *slot = *s);
        self.with_values(u, |Parts { mesh, terms, .. }, values| {
            for term in terms.iter_mut().filter(|t| t.law.class <= Class::Linear) {
                term.add_residual(mesh, values, out)?;
            }
            Ok(())
        })
    }
}
