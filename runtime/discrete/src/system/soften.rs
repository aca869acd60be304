//! A tangent of changing terms that is so steep that the bodies are rounding beside it.
//!
//! Friction that grows with the logarithm of the slip rate has a slope of 1e30 and more at a rate of zero. Added to the
//! stiffness of the bodies it leaves no digit of that, and the sum cannot be solved with: what moves both sides alike
//! meets no resistance. No solution is found there: one step along a flatter slope, still far steeper than the bodies,
//! leads to rates at which the slope itself is moderate.

use super::{System, Tangent};
use wfl_compiler::Class;

/// The steepest that is left, in units of the stiffness of the bodies at a dof: the square root of one over roundoff, so
/// that half of the digits of both are kept.
const STEEPEST: f64 = 6.7e7;

impl System {
    /// True if a term on cells is not linear.
    #[must_use]
    pub fn has_nonlinear_bodies(&self) -> bool {
        self.terms.iter().any(|t| t.on_cells() && t.law.class >= Class::Nonlinear)
    }

    /// Makes a tangent flatter in the equations in which the linear terms are lost beside it: rows and columns of the
    /// changing terms are multiplied by one factor for each place, so that opposite forces stay opposite. False where no
    /// equation is like that, with the tangent as it was. Of several ranks none does so.
    #[must_use]
    pub fn soften(&self, tangent: &mut Tangent) -> bool {
        if self.share.is_some() {
            return false;
        }
        let n = self.numbering.n_free();
        let kept = |row: usize| self.bulk.get(row, row).abs();
        let steepness = |row: usize| {
            let steep = tangent.changing.get(row, row).abs();
            if kept(row) > 0.0 { steep / (STEEPEST * kept(row)) } else { 0.0 }
        };
        let mut factor: Vec<f64> = (0..n).map(|row| steepness(row).max(1.0).sqrt().recip()).collect();
        if factor.iter().all(|f| *f == 1.0) {
            return false;
        }
        // one component at one place, such as on the two sides of a fault, has the smallest factor of all
        let place = |free: usize| {
            let dof = self.numbering.free_dofs[free] as usize;
            let (field, node, component) = self.numbering.describe(&self.fields, dof);
            // adding zero takes the sign off a zero
            let position = self.fields[field].node_position(node).map(|x| (x + 0.0).to_bits());
            (position, self.alike(field), component)
        };
        let with_bodies = (0..n).filter(|free| kept(*free) > 0.0);
        let mut order: Vec<_> = with_bodies.map(|free| (place(free), free)).collect();
        order.sort_unstable();
        for group in order.chunk_by(|a, b| a.0 == b.0) {
            let least = group.iter().fold(1.0f64, |m, (_, free)| m.min(factor[*free]));
            group.iter().for_each(|(_, free)| factor[*free] = least);
        }
        let pattern = tangent.changing.pattern().clone();
        let values = tangent.changing.values_mut();
        for row in 0..n {
            for at in pattern.row_starts()[row]..pattern.row_starts()[row + 1] {
                values[at] *= factor[row] * factor[pattern.columns()[at] as usize];
            }
        }
        true
    }
}
