//! A term made ready to be applied without a matrix: a linear one, or the tangent of one at a state.

use std::sync::Arc;

use super::{AssembledTerm, TermError};
use crate::assemble::{
    applied::{AppliedTerm, Factors, Group, Keeping, Number, PRODUCTS_OF_A_LINE, Reads, Skeleton},
    evaluate::{FieldValues, Workspace},
    simd::{Lanes, ZERO},
};
use crate::domain::Over;
use crate::field::Field;
use wfl_compiler::{
    Class,
    types::{FieldOp, Side},
};
use wfl_mesh::mesh::Mesh;

/// What a product with a term takes, counted before anything is made.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Counts {
    /// Products with sums, without a matrix.
    pub operations: f64,
    /// The same on the levels of multigrid, where entries of smooth laws are means over cells.
    pub operations_on_levels: f64,
    /// Numbers that are written between these products, where sums are taken direction by direction.
    pub written: f64,
    /// The same on the levels.
    pub written_on_levels: f64,
    /// Numbers that are read from and added to nodes, cell by cell.
    pub gathered: f64,
    /// Entries of laws that are stored, and those on the levels.
    pub stored: f64,
    /// On the levels.
    pub stored_on_levels: f64,
    /// Entries of the matrices of all cells.
    pub entries: f64,
}

impl Counts {
    /// Products with sums that take as long as the products and what is written between them: of the term, and on the levels.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "a small count")]
    pub fn effort(&self) -> [f64; 2] {
        let of_line = PRODUCTS_OF_A_LINE as f64;
        [self.operations + of_line * self.written, self.operations_on_levels + of_line * self.written_on_levels]
    }

    /// The sum.
    pub(crate) fn plus(self, own: Self) -> Self {
        Self {
            operations: self.operations + own.operations,
            operations_on_levels: self.operations_on_levels + own.operations_on_levels,
            written: self.written + own.written,
            written_on_levels: self.written_on_levels + own.written_on_levels,
            gathered: self.gathered + own.gathered,
            stored: self.stored + own.stored,
            stored_on_levels: self.stored_on_levels + own.stored_on_levels,
            entries: self.entries + own.entries,
        }
    }
}

impl AssembledTerm {
    /// What a product with the term takes, if it is one on cells.
    #[expect(clippy::cast_precision_loss, reason = "counts")]
    pub(crate) fn counts_of_product(&self, mesh: &Mesh, fields: &[Field]) -> Counts {
        let (binding, dim) = (&self.assembled.binding, self.assembled.domain.dim);
        let slots = || binding.tests.iter().chain(&binding.trials);
        let mut counts = Counts::default();
        let has_means = self.has_means_on_levels();
        for (g, (group, bound)) in self.assembled.domain.groups.iter().zip(&binding.groups).enumerate() {
            let reads = |b: usize, op: FieldOp| slots().any(|slot| slot.basis == b && slot.op == op);
            let (n, n_points) = (group.entities.len(), group.n_points());
            let on_levels = if has_means { self.n_points_of_means(mesh, fields, g) } else { n_points };
            let (mut by_point, mut local, mut sums) = (self.entries.list.len(), 0, [[0; 2]; 2]);
            for (b, basis) in bound.bases.iter().enumerate() {
                let (n, nodes) = (basis.n_components, basis.n_nodes);
                let reads = Reads { values: reads(b, FieldOp::Value), gradients: reads(b, FieldOp::Grad) };
                if !reads.any() {
                    continue;
                }
                local += n * nodes;
                by_point += if reads.gradients { n * dim * (2 * dim + 1) } else { 0 };
                by_point += if reads.values { n } else { 0 };
                // to the points and back
                let factors = Factors::of(&basis.table, &group.here.points);
                for (sums, n_points) in sums.iter_mut().zip([n_points, on_levels]) {
                    let work = reads.work(factors.as_ref(), [n_points, nodes], dim);
                    sums.iter_mut().zip(work).for_each(|(sum, work)| *sum += 2 * n * work);
                }
            }
            let [own, of_levels] = sums;
            counts.operations += (n * (n_points * by_point + own[0])) as f64;
            counts.operations_on_levels += (n * (on_levels * by_point + of_levels[0])) as f64;
            counts.written += (n * own[1]) as f64;
            counts.written_on_levels += (n * of_levels[1]) as f64;
            counts.gathered += (2 * n * local) as f64;
            counts.stored += (n * n_points * self.entries.n_outputs) as f64;
            counts.stored_on_levels += (n * if has_means { 1 } else { n_points } * self.entries.n_outputs) as f64;
            counts.entries += (n * local * local) as f64;
        }
        counts
    }

    /// Whether entries of the law are means over each cell on the levels of multigrid: those of a smooth law, which change little in
    /// a cell. Levels need no more, and have a tenth of the numbers then.
    pub(crate) fn has_means_on_levels(&self) -> bool {
        self.law.class == Class::Nonlinear
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

    /// Cells, functions and maps to apply the term to vectors of so many dofs; `starts` are the first dofs of the fields.
    pub(crate) fn skeleton<T: Number>(&self, mesh: &Mesh, starts: &[Option<usize>], n_dofs: usize) -> Skeleton<T> {
        let (domain, binding) = (&self.assembled.domain, &self.assembled.binding);
        let filled = self.filled();
        let groups: Vec<Group<'_>> = filled
            .iter()
            .map(|g| (&domain.groups[*g], &binding.groups[*g]))
            .map(|(group, bound)| Group {
                dim: domain.dim,
                n_cells: group.entities.len(),
                weights: &group.weights,
                points: &group.here.points,
                is_affine: group.here.cells.iter().all(|cell| mesh.map_order(*cell) == 0),
                binding: bound,
                starts,
                tests: &binding.tests,
                trials: &binding.trials,
                entries: &self.entries,
            })
            .collect();
        let nothing = binding.needs_of(binding.n_bases(), |_| false, false, false);
        let none = FieldValues { current: &[], previous: &[], rates: None };
        let mut workspace = Workspace::default();
        let volume = filled.first().map_or(1.0, |g| {
            workspace.prepare_some(self.bound(mesh), *g, 0, none, &nothing);
            workspace.map_at(&domain.groups[*g], domain.dim, 0).1[0]
        });
        #[expect(clippy::cast_precision_loss, reason = "three at most")]
        let length = volume.powf(1.0 / domain.dim.max(1) as f64);
        let mut made = Skeleton::new(&groups, n_dofs, length);
        let mut maps = Vec::new();
        for (at, g) in filled.iter().enumerate() {
            let group = &domain.groups[*g];
            let n_points = if made.is_affine(at) { 1 } else { group.n_points() };
            for number in 0..group.n_batches() {
                workspace.prepare_some(self.bound(mesh), *g, number, none, &nothing);
                maps.clear();
                for q in 0..n_points {
                    add_map(&mut workspace, (group, domain.dim), q, &mut maps);
                }
                made.take_maps(at, number, &maps);
            }
        }
        made
    }

    /// The term ready to be applied, at the present step; its entries are those at these values, times `factor`, or means over each
    /// cell where the entries of this term are.
    ///
    /// # Errors
    /// [`TermError::NonFinite`] with the place.
    pub(crate) fn applied<T: Number>(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        skeleton: &Arc<Skeleton<T>>,
        factor: f64,
    ) -> Result<AppliedTerm<T>, TermError> {
        let are_means = self.given.as_ref().is_some_and(|given| given.are_means);
        let keeping = Keeping { entries: &self.entries, uniforms: &self.uniforms, factor, are_means };
        let filled = self.filled();
        let outputs = |workspace: &mut Workspace, at: usize, number: usize, out: &mut Vec<f64>| {
            self.evaluate_entries(mesh, values, workspace, [filled[at], number]);
            std::mem::swap(&mut workspace.outputs, out);
        };
        match skeleton.with_law(keeping, outputs) {
            Some(made) => Ok(made),
            None => {
                Err(self.result(false, mesh, values, (&self.law.tangent, None)).expect_err("a number is not finite"))
            }
        }
    }

    /// The same functions and points with the law of `other` at its step.
    pub(crate) fn at_step_of(&self, other: &Self) -> Self {
        Self { step: other.step.clone(), uniforms: other.uniforms.clone(), ..self.clone() }
    }

    /// The groups that have cells.
    fn filled(&self) -> Vec<usize> {
        let groups = self.assembled.domain.groups.iter().enumerate();
        groups.filter(|(_, group)| !group.entities.is_empty()).map(|(g, _)| g).collect()
    }

    /// The term with entries that were evaluated before: its own, and those of terms with other functions or points that are made
    /// of it.
    pub(crate) fn with_entries(&self, term: &Arc<AppliedTerm<f64>>) -> Self {
        self.with_given(Given { term: Arc::clone(term), places: self.places(), are_means: false })
    }

    /// The same with the means of these entries over each cell.
    pub(crate) fn with_means(&self, term: &Arc<AppliedTerm<f64>>) -> Self {
        self.with_given(Given { term: Arc::clone(term), places: self.places(), are_means: true })
    }

    fn with_given(&self, given: Given) -> Self {
        let binding = &self.assembled.binding;
        let tangent_needs = binding.needs_of(binding.n_bases(), |_| false, true, true);
        Self { given: Some(given), tangent_needs, ..self.clone() }
    }

    /// By group its place among those that have cells.
    fn places(&self) -> Vec<usize> {
        let mut places = vec![0; self.assembled.domain.groups.len()];
        self.filled().iter().enumerate().for_each(|(at, g)| places[*g] = at);
        places
    }

    /// Prepares batch `number` of group `g`, and evaluates what entries of the law change from point to point.
    pub(super) fn evaluate_entries(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        workspace: &mut Workspace,
        at: [usize; 2],
    ) {
        let [g, number] = at;
        workspace.prepare_some(self.bound(mesh), g, number, values, &self.tangent_needs);
        match (&self.given, &self.tangent) {
            (Some(given), _) => {
                given.give([g, number], self.assembled.domain.groups[g].n_points(), &mut workspace.outputs);
            }
            (None, Some(kernel)) => self.call(&**kernel, workspace, g, self.entries.n_outputs),
            (None, None) => {}
        }
    }
}

/// Entries of a law that were evaluated before, in place of its kernel.
#[derive(Clone)]
pub(super) struct Given {
    term: Arc<AppliedTerm<f64>>,
    /// By group of the domain its place among those with cells.
    places: Vec<usize>,
    are_means: bool,
}

impl Given {
    /// The outputs of the kernel in a batch of a group.
    fn give(&self, at: [usize; 2], n_points: usize, outputs: &mut Vec<f64>) {
        let [g, number] = at;
        if self.are_means {
            self.term.give_means(self.places[g], number, n_points, outputs);
        } else {
            self.term.give_outputs(self.places[g], number, outputs);
        }
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
