//! A linear term made ready to be applied without a matrix.

use super::AssembledTerm;
use crate::assemble::{
    applied::{AppliedTerm, Batch, Group},
    evaluate::{FieldValues, Workspace},
    simd::{Lanes, ZERO},
};
use crate::domain::Over;
use wfl_compiler::types::{FieldOp, Side};
use wfl_mesh::mesh::Mesh;

/// What a product with a term takes, counted before anything is made.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Counts {
    /// Products with sums, without a matrix.
    pub operations: f64,
    /// Numbers that are read from and added to nodes, cell by cell.
    pub gathered: f64,
    /// Entries of the matrices of all cells.
    pub entries: f64,
}

impl AssembledTerm {
    /// What a product with the term takes, if it is one on cells.
    #[expect(clippy::cast_precision_loss, reason = "counts")]
    pub(crate) fn counts_of_product(&self) -> Counts {
        let (binding, dim) = (&self.assembled.binding, self.assembled.domain.dim);
        let slots = || binding.tests.iter().chain(&binding.trials);
        let mut counts = Counts::default();
        for (group, bound) in self.assembled.domain.groups.iter().zip(&binding.groups) {
            let reads = |b: usize, op: FieldOp| slots().any(|slot| slot.basis == b && slot.op == op);
            let (mut by_point, mut local) = (self.entries.list.len(), 0);
            for (b, basis) in bound.bases.iter().enumerate() {
                let (n, nodes) = (basis.n_components, basis.n_nodes);
                let (values, slopes) = (reads(b, FieldOp::Value), reads(b, FieldOp::Grad));
                by_point += if slopes { n * dim * (2 * nodes + 2 * dim + 1) } else { 0 };
                by_point += if values { n * (2 * nodes + 1) } else { 0 };
                local += if values || slopes { n * nodes } else { 0 };
            }
            let n = group.entities.len();
            counts.operations += (n * group.n_points() * by_point) as f64;
            counts.gathered += (2 * n * local) as f64;
            counts.entries += (n * local * local) as f64;
        }
        counts
    }

    /// Whether the term can be applied cell by cell: on cells, with values and first derivatives of fields of three components at
    /// most.
    pub(crate) fn can_be_applied(&self) -> bool {
        let binding = &self.assembled.binding;
        let slots = || binding.tests.iter().chain(&binding.trials);
        let is_simple = |g: usize| {
            let group = &self.assembled.domain.groups[g];
            let bases = &binding.groups[g].bases;
            let fits = |basis: usize| {
                let basis = &bases[basis];
                basis.side == Side::Here
                    && basis.n_components <= 3
                    && basis.tangents.is_none()
                    && basis.counts.is_empty()
            };
            group.own.is_none() && group.there.is_none() && !group.is_global && slots().all(|slot| fits(slot.basis))
        };
        self.assembled.domain.over == Over::Cells
            && self.moving.is_none()
            && self.entries.symmetric
            && !self.entries.list.is_empty()
            && slots().all(|slot| matches!(slot.op, FieldOp::Value | FieldOp::Grad))
            && (0..binding.groups.len()).all(is_simple)
    }

    /// The term ready to be applied to vectors of so many dofs, at the present step; what its entries read is at these values.
    /// In single precision it is multiplied by `scale`. `starts` are the first dofs of the fields.
    pub(crate) fn applied(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        of: (&[Option<usize>], usize),
        scale: f64,
    ) -> AppliedTerm {
        let ((starts, n_dofs), domain, binding) = (of, &self.assembled.domain, &self.assembled.binding);
        let groups: Vec<Group<'_>> = domain
            .groups
            .iter()
            .zip(&binding.groups)
            .filter(|(group, _)| !group.entities.is_empty())
            .map(|(group, bound)| Group {
                dim: domain.dim,
                n_cells: group.entities.len(),
                weights: &group.weights,
                is_affine: group.here.cells.iter().all(|cell| mesh.map_order(*cell) <= 1),
                binding: bound,
                starts,
                tests: &binding.tests,
                trials: &binding.trials,
                entries: &self.entries,
                uniforms: &self.uniforms,
            })
            .collect();
        let mut workspace = Workspace::default();
        let first = domain.groups.iter().position(|group| !group.entities.is_empty());
        let volume = first.map_or(1.0, |g| {
            workspace.prepare_some(self.bound(mesh), g, 0, values, &self.tangent_needs);
            workspace.map_at(&domain.groups[g], domain.dim, 0).1[0]
        });
        #[expect(clippy::cast_precision_loss, reason = "three at most")]
        let length = volume.powf(1.0 / domain.dim.max(1) as f64);
        let mut made = AppliedTerm::new(&groups, n_dofs, length, scale);
        let (mut maps, mut at) = (Vec::new(), 0);
        for (g, group) in domain.groups.iter().enumerate().filter(|(_, group)| !group.entities.is_empty()) {
            let n_points = if groups[at].is_affine { 1 } else { group.n_points() };
            for number in 0..group.n_batches() {
                workspace.prepare_some(self.bound(mesh), g, number, values, &self.tangent_needs);
                workspace.outputs.clear();
                if let Some(kernel) = &self.tangent {
                    self.call(&**kernel, &mut workspace, g, self.entries.n_outputs);
                }
                maps.clear();
                for q in 0..n_points {
                    add_map(&mut workspace, (group, domain.dim), q, &mut maps);
                }
                made.take(at, &Batch { number, maps: &maps, outputs: &workspace.outputs });
            }
            at += 1;
        }
        made
    }
}

/// Appends the map at a point: derivatives of the reference coordinates, and the measure.
fn add_map(workspace: &mut Workspace, of: (&crate::domain::Group, usize), q: usize, maps: &mut Vec<Lanes>) {
    let (group, dim) = of;
    let (inverse, measure) = workspace.map_at(group, dim, q);
    for row in inverse.iter().take(dim) {
        maps.extend(row.iter().take(dim));
    }
    maps.push(if dim == 0 { ZERO } else { measure });
}
