//! Expressions without test functions, evaluated: at positions, or at the points of a domain.

use std::sync::Arc;

use wfl_compiler::{
    ValueLaw,
    backend::{BackendError, KernelBackend, PointKernel},
    ir::LANES,
    run_prologue,
    types::{InputSlot, UniformSlot},
};

use crate::{
    assemble::{Binding, Bound, Domain, FieldValues, LawSlots, Workspace},
    field::{Field, FieldError},
    mesh::Mesh,
};

/// A compiled expression, callable.
pub struct Value {
    /// The law.
    pub law: ValueLaw,
    kernel: Box<dyn PointKernel>,
    uniforms: Vec<f64>,
}

/// The uniforms of a prologue at a step.
#[must_use]
pub fn uniforms_at(prologue: &wfl_compiler::Prologue, time: f64, increment: f64) -> Vec<f64> {
    let slot = |slot: &UniformSlot| match slot {
        UniformSlot::Time => time,
        UniformSlot::TimeStep => increment,
    };
    let values: Vec<f64> = prologue.slots.iter().map(slot).collect();
    run_prologue(prologue, &values)
}

impl Value {
    /// Makes an expression callable.
    ///
    /// # Errors
    /// [`BackendError`].
    pub fn new(law: ValueLaw, backend: &dyn KernelBackend) -> Result<Self, BackendError> {
        let kernel = backend.compile(&[&law.kernel])?.swap_remove(0);
        let uniforms = uniforms_at(&law.prologue, 0.0, 0.0);
        Ok(Self { law, kernel, uniforms })
    }

    /// Numbers of the law that are the same at all points, at the present step.
    #[must_use]
    pub fn uniforms(&self) -> &[f64] {
        &self.uniforms
    }

    /// Sets the step variable and its increment.
    pub fn set_step(&mut self, time: f64, increment: f64) {
        self.uniforms = uniforms_at(&self.law.prologue, time, increment);
    }

    /// Entries of the value.
    #[must_use]
    pub fn n_components(&self) -> usize {
        self.law.shape.len()
    }

    /// True if positions are all it reads.
    #[must_use]
    pub fn reads_positions_only(&self) -> bool {
        self.law.inputs.iter().all(|s| matches!(s, InputSlot::X(_)))
    }

    /// True if it reads the end of the previous step.
    #[must_use]
    pub fn reads_past(&self) -> bool {
        self.law.inputs.iter().any(|s| matches!(s, InputSlot::Previous(_)))
    }

    /// Values at positions: `out[position * n_components + component]`. The expression must read positions only.
    #[must_use]
    pub fn at_positions(&self, positions: &[[f64; 3]]) -> Vec<f64> {
        let (n_in, n_out) = (self.law.inputs.len(), self.n_components());
        let blocks = positions.len().div_ceil(LANES);
        let mut inputs = vec![0.0; blocks * n_in * LANES];
        let mut outputs = vec![0.0; blocks * n_out * LANES];
        for b in 0..blocks {
            for l in 0..LANES {
                let x = positions[(b * LANES + l).min(positions.len() - 1)];
                for (s, slot) in self.law.inputs.iter().enumerate() {
                    if let InputSlot::X(k) = slot {
                        inputs[(b * n_in + s) * LANES + l] = x[usize::from(*k)];
                    }
                }
            }
        }
        self.kernel.run(&self.uniforms, &inputs, &mut outputs, blocks);
        let place = |p: usize, c: usize| outputs[((p / LANES) * n_out + c) * LANES + p % LANES];
        (0..positions.len()).flat_map(|p| (0..n_out).map(move |c| (p, c))).map(|(p, c)| place(p, c)).collect()
    }

    /// Binds the expression to a domain.
    ///
    /// # Errors
    /// [`FieldError`] where a field it reads has no dofs.
    pub fn bind(&self, mesh: &Mesh, domain: Arc<Domain>, fields: &[Field]) -> Result<Sampled, FieldError> {
        let slots = LawSlots { inputs: &self.law.inputs, tests: &[], trials: &[] };
        let binding = Binding::new(mesh, &domain, fields, slots)?;
        Ok(Sampled { domain, binding })
    }

    /// Calls `f(group, entity of the group, point, weight, value)` at each point of a domain, in order.
    pub fn for_each_point(
        &self,
        mesh: &Mesh,
        sampled: &Sampled,
        values: FieldValues<'_>,
        mut f: impl FnMut(usize, usize, usize, f64, &[f64]),
    ) {
        let n_out = self.n_components();
        let bound = Bound { mesh, domain: &sampled.domain, binding: &sampled.binding };
        let mut workspace = Workspace::default();
        let mut value = vec![0.0; n_out];
        for (g, group) in sampled.domain.groups.iter().enumerate() {
            for batch in 0..group.n_batches() {
                workspace.prepare(bound, g, batch, values);
                workspace.outputs.resize(group.n_points() * n_out * LANES, 0.0);
                self.kernel.run(&self.uniforms, &workspace.inputs, &mut workspace.outputs, group.n_points());
                for l in 0..LANES.min(group.entities.len() - batch * LANES) {
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
pub struct Sampled {
    /// Where.
    pub domain: Arc<Domain>,
    /// Slots and tables.
    pub binding: Binding,
}
