//! A term on one entity or at one point, for checks of single elements. Not for assembly: slow.

use std::ops::ControlFlow;

use super::{AssembledTerm, NonFinitePlace, contract};
use crate::assemble::evaluate::{FieldValues, Workspace};
use crate::domain::{Group, GroupSide};
use wfl_compiler::{
    first_non_finite, interpret, interpret_lanes,
    ir::{LANES, VerifiedKernel},
    types::{BasisSlot, InputSlot},
};
use wfl_host::team::Team;
use wfl_mesh::mesh::{CellId, Mesh};
use wfl_sparse::index::NONE;

/// A quadrature point of one entity.
struct Point<'a> {
    group: &'a Group,
    /// Position of the entity in the group.
    entity: usize,
    q: usize,
}

/// A point at which a law gives a number that is not finite.
#[derive(Clone, Debug, Default)]
pub(super) struct BadPoint {
    inputs: Vec<f64>,
    entity: usize,
    q: usize,
    position: [f64; 3],
}

impl BadPoint {
    /// The point that one rank has found, on every rank.
    #[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts")]
    pub(super) fn told(self, team: &dyn Team, rank: usize) -> Self {
        let Self { inputs, entity, q, position: [x, y, z] } = self;
        let own = [&[entity as f64, q as f64, x, y, z], inputs.as_slice()].concat();
        match team.numbers_of(rank, &own).as_slice() {
            [entity, q, x, y, z, inputs @ ..] => {
                Self { inputs: inputs.to_vec(), entity: *entity as usize, q: *q as usize, position: [*x, *y, *z] }
            }
            _ => Self::default(),
        }
    }
}

/// What a term adds to the tangent at one point.
pub struct PointTangent {
    /// Entries by test and trial slot.
    pub entries: Vec<(BasisSlot, BasisSlot, f64)>,
    /// Where the point is.
    pub position: [f64; 3],
}

impl AssembledTerm {
    /// The tangent on the first entity, for its owning side: its global dofs and the matrix, row by row. Dofs
    /// of known fields are left out. `None` if there is no such entity.
    #[must_use]
    pub fn local_tangent(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        wanted: impl Fn(&GroupSide, usize) -> bool,
    ) -> Option<(Vec<u32>, Vec<f64>)> {
        if self.entries.list.is_empty() {
            return None;
        }
        if let Some(moved) = self.moved_with_plans(mesh, values) {
            return moved.local_tangent(mesh, values, wanted);
        }
        let place =
            |(g, group): (usize, &Group)| (0..group.entities.len()).find(|e| wanted(&group.here, *e)).map(|e| (g, e));
        let (g, entity) = self.assembled.domain.groups.iter().enumerate().find_map(place)?;
        let mut workspace = Workspace::default();
        workspace.prepare_some(self.bound(mesh), g, entity / LANES, values, &self.tangent_needs);
        if let Some(kernel) = &self.tangent {
            self.call(&**kernel, &mut workspace, g, self.entries.n_outputs);
        }
        let (group, binding) = (&self.assembled.domain.groups[g], &self.assembled.binding.groups[g]);
        contract::tangent(&mut workspace, &self.plans[g], &self.entries, group, binding, &self.uniforms);
        let n = self.assembled.binding.groups[g].n_dofs();
        let dofs = &self.dofs[g][entity * n..][..n];
        let known: Vec<usize> = (0..n).filter(|k| dofs[*k] != NONE).collect();
        let sources = &self.plans[g].sources;
        let value = |(i, j): (usize, usize)| {
            workspace.local.get(sources[i * n + j] as usize).map_or(0.0, |v| v[entity % LANES])
        };
        let matrix = known.iter().flat_map(|i| known.iter().map(|j| (*i, *j))).map(value).collect();
        Some((known.iter().map(|k| dofs[*k]).collect(), matrix))
    }

    /// The tangent at the first point of a cell. `None` if the term does not act there.
    #[must_use]
    pub fn point_tangent(&self, mesh: &Mesh, values: FieldValues<'_>, cell: CellId) -> Option<PointTangent> {
        if let Some(moved) = self.moved_with_plans(mesh, values) {
            return moved.point_tangent(mesh, values, cell);
        }
        let place = |(g, group): (usize, &Group)| group.here.cells.iter().position(|c| *c == cell).map(|e| (g, e));
        let (g, entity) = self.integrator.domain.groups.iter().enumerate().find_map(place)?;
        let (mut workspace, n_in) = (Workspace::default(), self.integrator.binding.inputs.len());
        workspace.prepare(self.bound_in_order(mesh), g, entity / LANES, values);
        let inputs: Vec<f64> = (0..n_in).map(|s| workspace.inputs[s * LANES + entity % LANES]).collect();
        let law = &self.law;
        let mut out = vec![0.0; law.tangent.kernel().outputs.len()];
        interpret(&law.tangent, &self.uniforms, &inputs, &mut Vec::new(), &mut out);
        let slots = |(t, s): &(u16, u16)| (law.tests[usize::from(*t)], law.trials[usize::from(*s)]);
        let values = law.entries.iter().map(slots).zip(&out[law.tests.len()..]);
        let entries = values.map(|((test, trial), value)| (test, trial, *value)).collect();
        let position = self.integrator.domain.groups[g].position(mesh, entity, 0);
        Some(PointTangent { entries, position })
    }

    /// Calls `f(fluxes by test slot, weight)` at every point, in the order of groups, entities and points.
    pub fn for_each_flux(&self, mesh: &Mesh, values: FieldValues<'_>, mut f: impl FnMut(&[f64], f64)) {
        if let Some(moved) = self.moved(mesh, values) {
            return moved.for_each_flux(mesh, values, f);
        }
        let (n_in, n_out) = (self.integrator.binding.inputs.len(), self.law.residual.kernel().outputs.len());
        let mut workspace = Workspace::default();
        let (mut scratch, mut flux) = (Vec::new(), vec![0.0; self.law.tests.len()]);
        for (g, group) in self.integrator.domain.groups.iter().enumerate() {
            let mut out = vec![[0.0; LANES]; group.n_points() * n_out];
            for batch in 0..group.n_batches() {
                workspace.prepare(self.bound_in_order(mesh), g, batch, values);
                let inputs = workspace.inputs.as_chunks().0;
                for (q, out) in out.chunks_exact_mut(n_out.max(1)).enumerate() {
                    interpret_lanes(&self.law.residual, &self.uniforms, &inputs[q * n_in..], &mut scratch, out);
                }
                for lane in 0..LANES.min(group.entities.len() - batch * LANES) {
                    for (q, out) in out.chunks_exact(n_out.max(1)).enumerate() {
                        flux.iter_mut().zip(out).for_each(|(flux, out)| *flux = out[lane]);
                        f(&flux, workspace.weight(q)[lane]);
                    }
                }
            }
        }
    }

    /// The fluxes by test slot at the points that `is_wanted`, in their order, where the law reads `replace(point, slot,
    /// value)` in place of the value of a slot. Points are numbered as [`Self::for_each_flux`] calls them.
    pub fn fluxes_with(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        is_wanted: impl Fn(usize) -> bool,
        replace: impl Fn(usize, &InputSlot, f64) -> f64,
    ) -> Vec<Vec<f64>> {
        if let Some(moved) = self.moved(mesh, values) {
            return moved.fluxes_with(mesh, values, is_wanted, replace);
        }
        let n_tests = self.law.tests.len();
        let mut out = vec![0.0; self.law.residual.kernel().outputs.len()];
        let (mut scratch, mut found, mut next) = (Vec::new(), Vec::new(), 0);
        let all = self.points::<()>(mesh, values, |inputs, _| {
            let point = next;
            next += 1;
            if is_wanted(point) {
                let slots = self.law.inputs.iter().zip(inputs);
                let inputs: Vec<f64> = slots.map(|(slot, value)| replace(point, slot, *value)).collect();
                interpret(&self.law.residual, &self.uniforms, &inputs, &mut scratch, &mut out);
                found.push(out[..n_tests].to_vec());
            }
            ControlFlow::Continue(())
        });
        debug_assert!(all.is_continue(), "no point ends it");
        found
    }

    /// Finds the first entity and point at which an instruction gives something that is not finite.
    pub(super) fn find_non_finite(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        kernel: &VerifiedKernel,
    ) -> Option<BadPoint> {
        self.points(mesh, values, |inputs, point| {
            let cause = first_non_finite(kernel, &self.uniforms, inputs);
            if cause.is_none() && inputs.iter().all(|x| x.is_finite()) {
                return ControlFlow::Continue(());
            }
            let (group, k) = (point.group, point.entity);
            let position = group.position(mesh, k, point.q);
            ControlFlow::Break(BadPoint { inputs: inputs.to_vec(), entity: group.entities[k], q: point.q, position })
        })
        .break_value()
    }

    /// What is said of a point.
    pub(super) fn non_finite_at(&self, at: BadPoint, kernel: &VerifiedKernel) -> NonFinitePlace {
        let is_known = at.inputs.len() == self.integrator.binding.inputs.len();
        let found = is_known.then(|| first_non_finite(kernel, &self.uniforms, &at.inputs)).flatten();
        NonFinitePlace {
            cause: found.map(|found| self.origin(kernel, found)),
            term: self.law.name.clone(),
            entity: at.entity,
            point: at.q,
            position: at.position,
        }
    }

    /// Calls `f` with the inputs of the law at every point, in the order of groups, entities and points.
    fn points<B>(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        mut f: impl FnMut(&[f64], Point<'_>) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let n_in = self.integrator.binding.inputs.len();
        let mut workspace = Workspace::default();
        for (g, group) in self.integrator.domain.groups.iter().enumerate() {
            for batch in 0..group.n_batches() {
                workspace.prepare(self.bound_in_order(mesh), g, batch, values);
                for lane in 0..LANES.min(group.entities.len() - batch * LANES) {
                    for q in 0..group.n_points() {
                        let inputs: Vec<f64> =
                            (0..n_in).map(|s| workspace.inputs[(q * n_in + s) * LANES + lane]).collect();
                        f(&inputs, Point { group, entity: batch * LANES + lane, q })?;
                    }
                }
            }
        }
        ControlFlow::Continue(())
    }
}
