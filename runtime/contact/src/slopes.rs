//! The derivatives of the arguments of projections at single points, exact as the compiler wrote them.
//!
//! They read what the law of the projections reads, in the same order: a workspace that was prepared for the one serves
//! the other. Promises: no differences, so that no step and no rounding of one enters. Says nothing of radii.

use std::sync::Arc;

use wfl_compiler::{
    ArgumentSlope, SlopesLaw, interpret_lanes,
    ir::Inst,
    types::{BasisSlot, FieldKind, FieldOp, InputSlot},
};
use wfl_discrete::{field::Field, value::uniforms_at, window::Window};

/// The derivatives of the arguments of the projections of a term.
#[derive(Clone)]
pub(super) struct ArgumentSlopes {
    /// `None` if every argument is the same at all states.
    law: Option<Arc<SlopesLaw>>,
    uniforms: Vec<f64>,
}

impl ArgumentSlopes {
    /// Derivatives at step 0.
    pub(super) fn new(law: Option<SlopesLaw>) -> Self {
        let mut this = Self { law: law.map(Arc::new), uniforms: Vec::new() };
        this.set_step(Window::default());
        this
    }

    /// Sets the step.
    pub(super) fn set_step(&mut self, window: Window) {
        self.uniforms = self.law.as_ref().map_or_else(Vec::new, |law| uniforms_at(&law.law.prologue, window));
    }

    /// The inputs that the derivatives read.
    pub(super) fn inputs(&self) -> impl Iterator<Item = usize> + '_ {
        let insts = self.law.iter().flat_map(|law| &law.law.kernel.kernel().insts);
        insts.filter_map(|inst| match inst {
            Inst::Input(k) => Some(*k as usize),
            _ => None,
        })
    }

    /// What each derivative is, sorted by projection, entry and slot; what is not listed is zero.
    pub(super) fn list(&self) -> &[ArgumentSlope] {
        self.law.as_ref().map_or(&[], |law| &law.slopes)
    }

    /// The derivatives of the argument of one projection with the position of their values.
    pub(super) fn of_projection(&self, projection: usize) -> impl Iterator<Item = (usize, &ArgumentSlope)> {
        self.list().iter().enumerate().filter(move |(_, s)| s.projection == projection)
    }

    /// The derivatives at N points; `inputs` as the law of the projections takes them, a lane a point.
    pub(super) fn at<const N: usize>(&self, inputs: &[[f64; N]]) -> Vec<[f64; N]> {
        let mut out = vec![[0.0; N]; self.list().len()];
        if let Some(law) = &self.law {
            interpret_lanes(&law.law.kernel, &self.uniforms, inputs, &mut Vec::new(), &mut out);
        }
        out
    }

    /// The derivatives at one point.
    pub(super) fn at_point(&self, inputs: &[f64]) -> Vec<f64> {
        self.at(inputs.as_chunks::<1>().0).as_flattened().to_vec()
    }
}

/// True for a component of a displacement.
pub(super) fn is_displacement(fields: &[Field], slot: &BasisSlot) -> bool {
    // branches are numbered behind the fields
    slot.op == FieldOp::Value && fields.get(slot.field.index()).is_some_and(|f| f.kind == FieldKind::Unknown)
}

/// True for what is no displacement: a gradient or a multiplier of the scene.
pub(super) fn is_traction(fields: &[Field], slot: &InputSlot) -> bool {
    match slot {
        InputSlot::Field(b) if b.field.index() < fields.len() => {
            b.op != FieldOp::Value || fields[b.field.index()].kind == FieldKind::Multiplier
        }
        _ => false,
    }
}
