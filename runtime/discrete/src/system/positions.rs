//! What rounding of positions leaves of forces: a law that adds unknowns to positions, such as the gap `(X + u).n`, knows
//! them no better than the positions, however small they are. Far from the origin that is much more than their own digits
//! say.

use wfl_compiler::Class;

use super::{System, Tangent};
use crate::{assemble::AssembledTerm, field::Field, finite::largest};

/// Displacements below this many units of roundoff of a position are zero beside it: positions are sums of those of nodes, and
/// a gap is one of four numbers.
const UNITS: f64 = 16.0;

/// The unknowns that laws add to positions.
#[derive(Clone, Default)]
pub(super) struct Placed {
    /// By field; empty where there are none.
    fields: Vec<bool>,
    /// The largest coordinate of the mesh (length).
    farthest: f64,
}

impl Placed {
    pub(super) fn new(fields: &[Field], terms: &[AssembledTerm], bounds: [[f64; 3]; 2]) -> Self {
        let mut placed = vec![false; fields.len()];
        for law in terms.iter().map(|t| &t.law).filter(|law| law.class >= Class::Nonlinear) {
            law.listing.added_to_positions(&law.inputs).iter().for_each(|field| placed[field.index()] = true);
        }
        if !placed.contains(&true) {
            return Self::default();
        }
        Self { fields: placed, farthest: largest(bounds.into_iter().flatten()) }
    }
}

impl System {
    /// By dof, in the rows of this rank: |K| |x| of the changing terms for the unknowns that a law adds to positions, with the
    /// largest coordinate of the mesh for |x|. Beside |K| |u| ([`Self::sizes`]) rounding errors of a residual are relative to
    /// it. Empty where no law does.
    #[must_use]
    pub fn sizes_of_positions(&self, tangent: &Tangent) -> Vec<f64> {
        let Placed { fields, farthest } = &self.placed;
        if fields.is_empty() {
            return Vec::new();
        }
        let is_placed = |dof: u32| fields[self.field_of(dof as usize)];
        self.row_sums(tangent, |dof| if is_placed(dof) { *farthest } else { 0.0 })
    }

    /// By body: the largest row sum of |K| of the changing terms among the bodies that it meets, on any rank: the stiffness
    /// against a motion of all neighbours one against the other.
    #[must_use]
    pub fn stiffness(&self, tangent: &Tangent) -> Vec<f64> {
        self.largest_of_alike(&self.row_sums(tangent, |_| 1.0))
    }

    /// By dof, in the rows of this rank: the sum of |K| of the changing terms over columns times a weight by dof; where they are
    /// applied, the sum over all times the largest weight.
    pub(super) fn row_sums(&self, tangent: &Tangent, weight: impl Fn(u32) -> f64) -> Vec<f64> {
        let mut out = vec![0.0; self.numbering.n_dofs];
        if let Some(applied) = &tangent.applied {
            let mut sums = applied.row_sums();
            self.numbering.turn_sizes(&mut sums);
            let most = self.team().largest(largest((0..out.len() as u32).map(&weight)));
            self.numbering.free_dofs.iter().for_each(|dof| out[*dof as usize] = most * sums[*dof as usize]);
            return out;
        }
        for row in 0..self.numbering.n_free() {
            let (columns, values) = tangent.changing.row(row);
            let of = |(c, v): (&u32, &f64)| v.abs() * weight(self.numbering.free_dofs[*c as usize]);
            out[self.numbering.free_dofs[row] as usize] = columns.iter().zip(values).map(of).sum();
        }
        out
    }

    /// Whether the values of some dofs of a field at `u` are rounding of the positions that a law adds them to.
    pub(super) fn are_rounding_of_positions(&self, u: &[f64], field: usize, dofs: impl Iterator<Item = usize>) -> bool {
        let Placed { fields, farthest } = &self.placed;
        if fields.get(field) != Some(&true) {
            return false;
        }
        self.team().largest(largest(dofs.map(|dof| u[dof]))) <= UNITS * f64::EPSILON * farthest
    }

    /// Whether the values of a field at `u` are rounding of the positions that a law adds them to.
    #[must_use]
    pub fn is_rounding_of_positions(&self, u: &[f64], field: usize) -> bool {
        self.are_rounding_of_positions(u, field, self.range(field).unwrap_or_default())
    }
}
