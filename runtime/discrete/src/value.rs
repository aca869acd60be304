//! Evaluation of expressions without test functions: at positions, or at the points of a domain.

use std::sync::Arc;

use wfl_compiler::{
    NonFinite, ValueLaw,
    backend::{BackendError, KernelBackend, PointKernel},
    compares_nan, first_non_finite,
    ir::{Inst, LANES},
    run_prologue,
    types::{InputSlot, UniformSlot},
};

pub use crate::prologue::uniforms_at;
use crate::{
    assemble::{Binding, Bound, Domain, FieldValues, Integrator, LawSlots, Workspace},
    field::{Field, FieldError},
    finite::NotFinite,
    prologue::step_slots,
    window::Window,
};
use wfl_mesh::mesh::Mesh;

/// A compiled expression, callable at one step; a copy shares its law and its code.
#[derive(Clone)]
pub struct Value {
    /// The law.
    pub law: Arc<ValueLaw>,
    kernel: Arc<dyn PointKernel>,
    uniforms: Vec<f64>,
    /// The step variable and its increment, as the prologue of the law takes them.
    step: Vec<f64>,
}

impl Value {
    /// Makes an expression callable.
    ///
    /// # Errors
    /// [`BackendError`].
    pub fn new(law: ValueLaw, backend: &dyn KernelBackend) -> Result<Self, BackendError> {
        let kernel = backend.compile(&[&law.kernel])?.swap_remove(0).into();
        let step = step_slots(&law.prologue, Window::default());
        let uniforms = run_prologue(&law.prologue, &step);
        Ok(Self { law: Arc::new(law), kernel, uniforms, step })
    }

    /// Numbers of the law that are the same at all points, at the present step.
    #[must_use]
    pub fn uniforms(&self) -> &[f64] {
        &self.uniforms
    }

    /// The same expression at a step.
    #[must_use]
    pub fn at_step(&self, window: Window) -> Self {
        let step = step_slots(&self.law.prologue, window);
        let uniforms = run_prologue(&self.law.prologue, &step);
        Self { law: Arc::clone(&self.law), kernel: Arc::clone(&self.kernel), uniforms, step }
    }

    /// Entries of the value.
    #[must_use]
    pub fn n_components(&self) -> usize {
        self.law.shape.len()
    }

    /// True if positions are all it reads, and nothing is filtered by a mapping: positions have no images.
    #[must_use]
    pub fn reads_positions_only(&self) -> bool {
        self.law.mapping.is_none() && self.law.inputs.iter().all(|s| matches!(s, InputSlot::X(_)))
    }

    /// True if it reads the step variable or its increment.
    #[must_use]
    pub fn reads_step(&self) -> bool {
        self.law.prologue.slots.iter().any(|slot| matches!(slot, UniformSlot::Time | UniformSlot::TimeStep))
    }

    /// True if it reads the end of the previous step.
    #[must_use]
    pub fn reads_past(&self) -> bool {
        self.law.inputs.iter().any(|s| matches!(s, InputSlot::Previous(_) | InputSlot::History(..)))
    }

    /// Values at positions: `out[position * n_components + component]`. The expression must read positions only.
    ///
    /// # Errors
    /// [`NotFinite`] for the first value that is not finite.
    pub fn at_positions(&self, positions: &[[f64; 3]]) -> Result<Vec<f64>, NotFinite> {
        self.at_positions_with(positions, &|_| 0.0)
    }

    /// As [`Self::at_positions`] for an expression that also reads what is the same everywhere, which `known` gives by slot.
    ///
    /// # Errors
    /// [`NotFinite`] for the first value that is not finite.
    pub fn at_positions_with(
        &self,
        positions: &[[f64; 3]],
        known: &dyn Fn(&InputSlot) -> f64,
    ) -> Result<Vec<f64>, NotFinite> {
        let (n_in, n_out) = (self.law.inputs.len(), self.n_components());
        let blocks = positions.len().div_ceil(LANES);
        let mut inputs = vec![0.0; blocks * n_in * LANES];
        let mut outputs = vec![0.0; blocks * n_out * LANES];
        for b in 0..blocks {
            for l in 0..LANES {
                let x = positions[(b * LANES + l).min(positions.len() - 1)];
                for (s, slot) in self.law.inputs.iter().enumerate() {
                    let number = if let InputSlot::X(k) = slot { x[usize::from(*k)] } else { known(slot) };
                    inputs[(b * n_in + s) * LANES + l] = number;
                }
            }
        }
        self.kernel.run(&self.uniforms, &inputs, &mut outputs, blocks);
        let place = |p: usize, c: usize| outputs[((p / LANES) * n_out + c) * LANES + p % LANES];
        let all = (0..positions.len()).flat_map(|p| (0..n_out).map(move |c| (p, c)));
        let values: Vec<f64> = all.map(|(p, c)| place(p, c)).collect();
        match values.iter().position(|v| !v.is_finite()) {
            None => Ok(values),
            Some(bad) => {
                let p = bad / n_out;
                let point: Vec<f64> = (0..n_in).map(|s| inputs[((p / LANES) * n_in + s) * LANES + p % LANES]).collect();
                Err(NotFinite { value: values[bad], cause: self.cause(&point).map(Box::new), position: positions[p] })
            }
        }
    }

    /// True if a condition compares what is not a number at a position: it then decides nothing.
    #[must_use]
    pub fn compares_nan_at(&self, x: [f64; 3]) -> bool {
        let slot = |slot: &InputSlot| if let InputSlot::X(k) = slot { x[usize::from(*k)] } else { 0.0 };
        let inputs: Vec<f64> = self.law.inputs.iter().map(slot).collect();
        compares_nan(&self.law.kernel, &self.uniforms, &inputs)
    }

    /// The operation behind a value that is not finite, from the inputs at its point.
    fn cause(&self, inputs: &[f64]) -> Option<NonFinite> {
        let found = first_non_finite(&self.law.kernel, &self.uniforms, inputs)?;
        // what is the same at all points is computed before them: such a number went wrong there
        match self.law.kernel.kernel().insts[found.inst] {
            Inst::Uniform(_) => first_non_finite(&self.law.prologue.kernel, &self.step, &[]).or(Some(found)),
            _ => Some(found),
        }
    }

    /// The first point of a domain where the value is not finite: of several ranks, which look together, that of the first
    /// one that has such a point.
    #[must_use]
    pub fn first_not_finite(&self, mesh: &Mesh, sampled: &Sampled, values: FieldValues<'_>) -> Option<NotFinite> {
        let sampled = &sampled.at(mesh, values.current);
        let team = mesh.team();
        let own = self.own_not_finite(mesh, sampled, values);
        let found = team.numbers_of(team.first(own.is_some())?, &own.unwrap_or_default());
        let [value, x, y, z, inputs @ ..] = found.as_slice() else { return None };
        Some(NotFinite { value: *value, cause: self.cause(inputs).map(Box::new), position: [*x, *y, *z] })
    }

    /// The first point of this rank where the value is not finite: the value, where, and what was read there.
    fn own_not_finite(&self, mesh: &Mesh, sampled: &Sampled, values: FieldValues<'_>) -> Option<Vec<f64>> {
        let mut first = None;
        self.for_each_point(mesh, sampled, values, |g, entity, q, _, value| {
            if first.is_none()
                && let Some(bad) = value.iter().find(|v| !v.is_finite())
            {
                first = Some((g, entity, q, *bad));
            }
        });
        let (g, entity, q, value) = first?;
        let [x, y, z] = sampled.domain.groups[g].position(mesh, entity, q);
        let bound = Bound { mesh, domain: &sampled.domain, binding: &sampled.binding };
        let (mut workspace, n_in) = (Workspace::default(), self.law.inputs.len());
        workspace.prepare(bound, g, entity / LANES, values);
        let inputs = (0..n_in).map(|s| workspace.inputs[(q * n_in + s) * LANES + entity % LANES]);
        Some([value, x, y, z].into_iter().chain(inputs).collect())
    }

    /// Binds the expression to a domain.
    ///
    /// # Errors
    /// [`FieldError`] where a field it reads has no dofs.
    pub fn bind(&self, mesh: &Mesh, domain: Arc<Domain>, fields: &[Field]) -> Result<Sampled, FieldError> {
        let slots = LawSlots { inputs: &self.law.inputs, tests: &[], trials: &[] };
        let binding = Binding::new(mesh, &domain, fields, slots)?;
        Ok(Integrator { domain, binding: Arc::new(binding) })
    }

    /// Calls `f(group, entity of the group, point, weight, value)` at each point of a domain, in order.
    pub fn for_each_point(
        &self,
        mesh: &Mesh,
        sampled: &Sampled,
        values: FieldValues<'_>,
        f: impl FnMut(usize, usize, usize, f64, &[f64]),
    ) {
        self.at_points(mesh, sampled, values, |_, _| true, f);
    }

    /// Calls `f(weight, value)` at each point of a domain that this rank counts, in order; where images follow the bodies,
    /// at those that have one.
    pub fn for_each_counted_point(
        &self,
        mesh: &Mesh,
        sampled: &Sampled,
        values: FieldValues<'_>,
        mut f: impl FnMut(f64, &[f64]),
    ) {
        let sampled = &sampled.at(mesh, values.current);
        let counts = |g: usize, k: usize| {
            let group = &sampled.domain.groups[g];
            group.is_counted(mesh, k) && !group.has_lost_its_image(k)
        };
        self.at_points(mesh, sampled, values, counts, |_, _, _, weight, value| f(weight, value));
    }

    /// Calls `f` at the points of the entities that are wanted.
    fn at_points(
        &self,
        mesh: &Mesh,
        sampled: &Sampled,
        values: FieldValues<'_>,
        wanted: impl Fn(usize, usize) -> bool,
        mut f: impl FnMut(usize, usize, usize, f64, &[f64]),
    ) {
        let n_out = self.n_components();
        let sampled = &sampled.at(mesh, values.current);
        let bound = Bound { mesh, domain: &sampled.domain, binding: &sampled.binding };
        let mut workspace = Workspace::default();
        let mut value = vec![0.0; n_out];
        for (g, group) in sampled.domain.groups.iter().enumerate() {
            for batch in 0..group.n_batches() {
                let entities = group.entities.len() - batch * LANES;
                let is_wanted: [bool; LANES] = std::array::from_fn(|l| l < entities && wanted(g, batch * LANES + l));
                if !is_wanted.contains(&true) {
                    continue;
                }
                workspace.prepare(bound, g, batch, values);
                workspace.outputs.resize(group.n_points() * n_out * LANES, 0.0);
                self.kernel.run(&self.uniforms, &workspace.inputs, &mut workspace.outputs, group.n_points());
                for l in (0..LANES).filter(|l| is_wanted[*l]) {
                    for q in 0..group.n_points() {
                        for (c, v) in value.iter_mut().enumerate() {
                            *v = workspace.output(n_out, q, c)[l];
                        }
                        f(g, batch * LANES + l, q, workspace.weight(q)[l], &value);
                    }
                }
            }
        }
    }
}

/// An expression on a domain.
pub type Sampled = Integrator;
