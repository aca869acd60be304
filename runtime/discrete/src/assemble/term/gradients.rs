//! What a term on cells says of gradients: its fluxes at a gradient that is asked for, and the determinants of Id + Grad_u
//! at its points. For checks of states.

use rayon::prelude::*;

use super::AssembledTerm;
use crate::assemble::{
    binding::Needs,
    evaluate::{FieldValues, Workspace},
};
use crate::domain::Group;
use wfl_compiler::{
    interpret, interpret_lanes,
    ir::LANES,
    types::{BasisSlot, FieldOp, InputSlot, Side},
};
use wfl_mesh::mesh::{CellId, Mesh};

/// The gradient of a vector field of the space, or a flux against that of its test function: row by row, `[i][j]` the
/// derivative of component i in direction j; the third row and column are 0 in the plane.
pub type Gradient = [[f64; 3]; 3];

/// Gradients of a field at which fluxes are asked for.
#[derive(Clone, Copy)]
pub struct AskedGradients<'a> {
    /// The field, a vector of the space.
    pub field: usize,
    /// Its gradients, one flux each.
    pub gradients: &'a [Gradient],
    /// The other fields whose values are replaced; all else is as it is.
    pub is_other: &'a dyn Fn(usize) -> bool,
    /// Their value, of each component.
    pub other: f64,
}

/// Cells in which the determinant of Id + Grad_u is not positive at a point of a rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NegativeVolumes {
    /// How many.
    pub n_cells: usize,
    /// The cells of the term that this rank has.
    pub of: usize,
    /// The smallest determinant.
    pub smallest: f64,
    /// Where.
    pub position: [f64; 3],
}

/// What a term is at a point of a cell.
#[derive(Clone, Copy, Debug)]
pub struct StressAt {
    /// The cell.
    pub cell: CellId,
    /// The flux against the gradient of the test function.
    pub stress: Gradient,
    /// The gradient of the field; `None` unless the law reads all of it.
    pub gradient: Option<Gradient>,
    /// The volume that the point stands for.
    pub weight: f64,
    /// Where the first point of a cell is.
    pub position: Option<[f64; 3]>,
}

/// Where the smallest determinant of some entities is.
#[derive(Clone, Copy)]
struct Found {
    determinant: f64,
    n_cells: usize,
    group: usize,
    entity: usize,
    q: usize,
}

impl AssembledTerm {
    /// The positions of the gradient of a vector field of the space among the inputs, `[i][j]`; `None` unless the law reads
    /// all of it.
    fn gradient_inputs(&self, dim: usize, field: usize) -> Option<[[usize; 3]; 3]> {
        let mut places = [[0; 3]; 3];
        for i in 0..dim {
            for j in 0..dim {
                let is_it = |slot: &InputSlot| match slot {
                    InputSlot::Field(b) => {
                        b.field.index() == field
                            && b.op == FieldOp::Grad
                            && b.side == Side::Here
                            && usize::from(b.entry) == i + dim * j
                    }
                    _ => false,
                };
                places[i][j] = self.law.inputs.iter().position(is_it)?;
            }
        }
        Some(places)
    }

    /// The flux against the gradient of the test function of a vector field, at the first point of a cell, if the gradient of
    /// the field were `gradient` there and all else as it is. `None` where the term does not act, or does not read all of
    /// the gradient.
    #[must_use]
    pub fn flux_at_gradient(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        cell: CellId,
        field: usize,
        gradients: &[Gradient],
    ) -> Option<Vec<Gradient>> {
        let dim = self.integrator.domain.dim;
        let places = self.gradient_inputs(dim, field)?;
        let place = |(g, group): (usize, &Group)| group.here.cells.iter().position(|c| *c == cell).map(|e| (g, e));
        let (g, entity) = self.integrator.domain.groups.iter().enumerate().find_map(place)?;
        let (mut workspace, n_in) = (Workspace::default(), self.integrator.binding.inputs.len());
        workspace.prepare(self.bound_in_order(mesh), g, entity / LANES, values);
        let mut inputs: Vec<f64> = (0..n_in).map(|s| workspace.inputs[s * LANES + entity % LANES]).collect();
        let mut out = vec![0.0; self.law.residual.kernel().outputs.len()];
        let mut fluxes = Vec::with_capacity(gradients.len());
        for gradient in gradients {
            for (row, places) in gradient.iter().zip(&places).take(dim) {
                row.iter().zip(places).take(dim).for_each(|(value, place)| inputs[*place] = *value);
            }
            interpret(&self.law.residual, &self.uniforms, &inputs, &mut Vec::new(), &mut out);
            let mut flux = [[0.0; 3]; 3];
            for (slot, value) in self.law.tests.iter().zip(&out) {
                if slot.field.index() == field && slot.op == FieldOp::Grad && slot.side == Side::Here {
                    flux[usize::from(slot.entry) % dim][usize::from(slot.entry) / dim] = *value;
                }
            }
            fluxes.push(flux);
        }
        Some(fluxes)
    }

    /// The fluxes against the gradient of the test function of a vector field, at the first point of a cell, at what is
    /// asked for. What the law does not read does not enter. `None` where the term does not act.
    #[must_use]
    pub fn flux_with(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        cell: CellId,
        asked: &AskedGradients<'_>,
    ) -> Option<Vec<Gradient>> {
        let AskedGradients { field, gradients, is_other, other } = *asked;
        let dim = self.integrator.domain.dim;
        let place = |(g, group): (usize, &Group)| group.here.cells.iter().position(|c| *c == cell).map(|e| (g, e));
        let (g, entity) = self.integrator.domain.groups.iter().enumerate().find_map(place)?;
        let (mut workspace, n_in) = (Workspace::default(), self.integrator.binding.inputs.len());
        workspace.prepare(self.bound_in_order(mesh), g, entity / LANES, values);
        let mut inputs: Vec<f64> = (0..n_in).map(|s| workspace.inputs[s * LANES + entity % LANES]).collect();
        let entry = |e: u16| (usize::from(e) % dim, usize::from(e) / dim);
        let mut places = Vec::new();
        for (place, slot) in self.law.inputs.iter().enumerate() {
            let InputSlot::Field(b) = slot else { continue };
            match b.op {
                FieldOp::Grad if b.field.index() == field => places.push((place, entry(b.entry))),
                FieldOp::Value if is_other(b.field.index()) => inputs[place] = other,
                _ => {}
            }
        }
        let mut out = vec![0.0; self.law.residual.kernel().outputs.len()];
        let mut flux_at = |gradient: &Gradient| {
            places.iter().for_each(|(place, (i, j))| inputs[*place] = gradient[*i][*j]);
            interpret(&self.law.residual, &self.uniforms, &inputs, &mut Vec::new(), &mut out);
            let mut flux = [[0.0; 3]; 3];
            for (slot, value) in self.law.tests.iter().zip(&out) {
                if slot.field.index() == field && slot.op == FieldOp::Grad && slot.side == Side::Here {
                    let (i, j) = entry(slot.entry);
                    flux[i][j] = *value;
                }
            }
            flux
        };
        Some(gradients.iter().map(&mut flux_at).collect())
    }

    /// Calls `f` with the flux against the gradient of the test function of a vector field at every point of the cells that
    /// this rank counts.
    pub fn for_each_stress(&self, mesh: &Mesh, values: FieldValues<'_>, field: usize, mut f: impl FnMut(&StressAt)) {
        let (dim, domain) = (self.integrator.domain.dim, &self.integrator.domain);
        let is_own = |slot: &BasisSlot| slot.field.index() == field && slot.op == FieldOp::Grad;
        let own: Vec<(usize, usize)> = (self.law.tests.iter().enumerate())
            .filter(|(_, slot)| is_own(slot) && slot.side == Side::Here)
            .map(|(k, slot)| (k, usize::from(slot.entry)))
            .collect();
        if own.is_empty() {
            return;
        }
        let places = self.gradient_inputs(dim, field);
        let (n_in, n_out) = (self.integrator.binding.inputs.len(), self.law.residual.kernel().outputs.len());
        let (mut workspace, mut scratch, mut out) = (Workspace::default(), Vec::new(), vec![[0.0; LANES]; n_out]);
        for (g, group) in domain.groups.iter().enumerate() {
            for batch in 0..group.n_batches() {
                workspace.prepare(self.bound_in_order(mesh), g, batch, values);
                let inputs = workspace.inputs.as_chunks::<LANES>().0;
                for q in 0..group.n_points() {
                    let at = &inputs[q * n_in..];
                    interpret_lanes(&self.law.residual, &self.uniforms, at, &mut scratch, &mut out);
                    let lanes = 0..LANES.min(group.entities.len() - batch * LANES);
                    for lane in lanes.filter(|lane| group.is_counted(mesh, batch * LANES + lane)) {
                        let mut stress = [[0.0; 3]; 3];
                        own.iter().for_each(|(k, entry)| stress[entry % dim][entry / dim] = out[*k][lane]);
                        let gradient = places.map(|places| {
                            let entry = |i: usize, j: usize| at[places[i][j]][lane];
                            let is_there = |i: usize, j: usize| i < dim && j < dim;
                            let of = |i, j| if is_there(i, j) { entry(i, j) } else { 0.0 };
                            std::array::from_fn(|i| std::array::from_fn(|j| of(i, j)))
                        });
                        let cell = group.here.cells[batch * LANES + lane];
                        let position = (q == 0).then(|| group.position(mesh, batch * LANES + lane, 0));
                        f(&StressAt { cell, stress, gradient, weight: workspace.weight(q)[lane], position });
                    }
                }
            }
        }
    }

    /// The cells in which Id + Grad_u of a vector field of the space has no positive determinant at a point of the rule, of
    /// those that this rank counts. `None` if there is no such cell, or if the law does not read all of the gradient.
    #[must_use]
    pub fn negative_volumes(&self, mesh: &Mesh, values: FieldValues<'_>, field: usize) -> Option<NegativeVolumes> {
        let (domain, binding) = (&self.integrator.domain, &self.integrator.binding);
        let places = self.gradient_inputs(domain.dim, field)?;
        let wanted: Vec<usize> = places[..domain.dim].iter().flat_map(|row| &row[..domain.dim]).copied().collect();
        let n_bases = binding.n_bases();
        let needs = binding.needs_of(n_bases, |k| wanted.contains(&k), false, false);
        let mut found: Vec<Found> = Vec::new();
        for (g, group) in domain.groups.iter().enumerate() {
            let batches = (0..group.n_batches()).into_par_iter();
            let of_batch = |workspace: &mut Workspace, batch| {
                self.negative_in_batch(mesh, values, workspace, &Batch { g, batch, places: &places, needs: &needs })
            };
            found.par_extend(batches.map_init(Workspace::default, of_batch).flatten());
        }
        let worst = found.iter().copied().reduce(|a, b| if b.determinant < a.determinant { b } else { a })?;
        Some(NegativeVolumes {
            n_cells: found.iter().map(|f| f.n_cells).sum(),
            of: domain.n_entities,
            smallest: worst.determinant,
            position: domain.groups[worst.group].position(mesh, worst.entity, worst.q),
        })
    }

    /// How far the way from one state to another may be followed, up to `most` times its length, before the determinant of
    /// Id + Grad_u at a point of the rule leaves the interval from `kept` to `1/kept` times what it is at the beginning;
    /// halved from `most`, so that a little less may be told. Points at which it is not positive at the beginning are not
    /// looked at. `most` where the law does not read all of the gradient.
    #[must_use]
    pub fn way_of_volumes(&self, mesh: &Mesh, ends: [FieldValues<'_>; 2], field: usize, limit: VolumeLimit) -> f64 {
        let (domain, binding) = (&self.integrator.domain, &self.integrator.binding);
        let Some(places) = self.gradient_inputs(domain.dim, field) else { return limit.most };
        let wanted: Vec<usize> = places[..domain.dim].iter().flat_map(|row| &row[..domain.dim]).copied().collect();
        let needs = binding.needs_of(binding.n_bases(), |k| wanted.contains(&k), false, false);
        let mut longest = limit.most;
        for (g, group) in domain.groups.iter().enumerate() {
            let of_batch = |workspaces: &mut [Workspace; 2], batch| {
                let at = Batch { g, batch, places: &places, needs: &needs };
                self.way_in_batch(mesh, ends, workspaces, &at, limit)
            };
            let batches = (0..group.n_batches()).into_par_iter();
            let least = batches.map_init(<[Workspace; 2]>::default, of_batch).reduce(|| limit.most, f64::min);
            longest = longest.min(least);
        }
        longest
    }

    fn way_in_batch(
        &self,
        mesh: &Mesh,
        ends: [FieldValues<'_>; 2],
        workspaces: &mut [Workspace; 2],
        at: &Batch<'_>,
        limit: VolumeLimit,
    ) -> f64 {
        let group = &self.integrator.domain.groups[at.g];
        let (dim, n_in) = (self.integrator.domain.dim, self.integrator.binding.inputs.len());
        for (workspace, values) in workspaces.iter_mut().zip(ends) {
            workspace.prepare_some(self.bound_in_order(mesh), at.g, at.batch, values, at.needs);
        }
        let [from, to] = workspaces.each_ref().map(|w| w.inputs.as_chunks::<LANES>().0.chunks_exact(n_in));
        let own = LANES.min(group.entities.len() - at.batch * LANES);
        let mut longest = limit.most;
        for (from, to) in from.zip(to).take(group.n_points()) {
            for lane in 0..own {
                longest = limit.way(longest, |part| determinant_on_way(dim, [from, to], at.places, lane, part));
            }
        }
        longest
    }

    fn negative_in_batch(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        workspace: &mut Workspace,
        at: &Batch<'_>,
    ) -> Option<Found> {
        let group = &self.integrator.domain.groups[at.g];
        let (dim, n_in) = (self.integrator.domain.dim, self.integrator.binding.inputs.len());
        workspace.prepare_some(self.bound_in_order(mesh), at.g, at.batch, values, at.needs);
        let mut smallest: [(f64, usize); LANES] = [(f64::INFINITY, 0); LANES];
        for (q, inputs) in workspace.inputs.as_chunks::<LANES>().0.chunks_exact(n_in).take(group.n_points()).enumerate()
        {
            for (lane, determinant) in determinants(dim, inputs, at.places).iter().enumerate() {
                if *determinant < smallest[lane].0 {
                    smallest[lane] = (*determinant, q);
                }
            }
        }
        let own = LANES.min(group.entities.len() - at.batch * LANES);
        let negative = smallest[..own].iter().enumerate().filter(|(_, (d, _))| *d <= 0.0);
        let counted = negative.filter(|(lane, _)| group.is_counted(mesh, at.batch * LANES + lane));
        let found = counted.map(|(lane, (determinant, q))| Found {
            determinant: *determinant,
            n_cells: 1,
            group: at.g,
            entity: at.batch * LANES + lane,
            q: *q,
        });
        found.reduce(|a, b| Found { n_cells: a.n_cells + 1, ..if b.determinant < a.determinant { b } else { a } })
    }
}

/// How much volumes may change on a way, and how far it may be followed at most, in units of its length.
#[derive(Clone, Copy, Debug)]
pub struct VolumeLimit {
    /// The part that is kept, and one over the factor that is gained, at least.
    pub kept: f64,
    /// The longest way.
    pub most: f64,
}

/// A way shorter than this part of one is none.
const SHORTEST_WAY: f64 = 1e-12;
/// Places at which a way is looked at: a determinant may be positive at its end and negative on it.
const LOOKS: [f64; 4] = [0.25, 0.5, 0.75, 1.0];

impl VolumeLimit {
    /// The first of `longest` and its halves at which a determinant, a function of the way, is within the limit.
    fn way(self, longest: f64, determinant: impl Fn(f64) -> f64) -> f64 {
        let start = determinant(0.0);
        if start.is_nan() || start <= 0.0 {
            return longest;
        }
        let within = self.kept * start..=start / self.kept;
        let mut way = longest;
        while way > SHORTEST_WAY && !LOOKS.iter().all(|look| within.contains(&determinant(look * way))) {
            way *= 0.5;
        }
        way
    }
}

/// det(Id + G) of a lane, on the way from one gradient to another.
fn determinant_on_way(dim: usize, ends: [&[[f64; LANES]]; 2], places: &[[usize; 3]; 3], lane: usize, part: f64) -> f64 {
    let [from, to] = ends;
    let entry = |i: usize, j: usize| {
        let (a, b) = (from[places[i][j]][lane], to[places[i][j]][lane]);
        a + part * (b - a) + if i == j { 1.0 } else { 0.0 }
    };
    determinant(dim, entry)
}

/// Some entities of a group, and what is read of them.
struct Batch<'a> {
    g: usize,
    batch: usize,
    places: &'a [[usize; 3]; 3],
    needs: &'a Needs,
}

/// det(Id + G) of all lanes.
fn determinants(dim: usize, inputs: &[[f64; LANES]], places: &[[usize; 3]; 3]) -> [f64; LANES] {
    std::array::from_fn(|lane| determinant(dim, |i, j| inputs[places[i][j]][lane] + if i == j { 1.0 } else { 0.0 }))
}

/// The determinant of a matrix of `dim` rows.
fn determinant(dim: usize, f: impl Fn(usize, usize) -> f64) -> f64 {
    match dim {
        1 => f(0, 0),
        2 => f(0, 0) * f(1, 1) - f(0, 1) * f(1, 0),
        _ => {
            f(0, 0) * (f(1, 1) * f(2, 2) - f(1, 2) * f(2, 1)) - f(0, 1) * (f(1, 0) * f(2, 2) - f(1, 2) * f(2, 0))
                + f(0, 2) * (f(1, 0) * f(2, 1) - f(1, 1) * f(2, 0))
        }
    }
}
