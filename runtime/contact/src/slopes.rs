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

/// How much longer the argument of each of `n` projections becomes by a displacement of length one, the most among the sides
/// and fields that it depends on. Of derivatives by components, which follow the axes, this is the largest singular value.
pub(super) fn lengthening(list: &[ArgumentSlope], fields: &[Field], slopes: &[f64], n: usize) -> Vec<f64> {
    let mut out = vec![0.0f64; n];
    let of_motion = |s: &ArgumentSlope| (s.projection, s.slot.field, s.slot.side);
    let moving: Vec<(usize, &ArgumentSlope)> =
        list.iter().enumerate().filter(|(_, s)| is_displacement(fields, &s.slot)).collect();
    let mut seen = Vec::new();
    for (_, first) in &moving {
        let motion = of_motion(first);
        if seen.contains(&motion) {
            continue;
        }
        seen.push(motion);
        let own = moving.iter().filter(|(_, s)| of_motion(s) == motion);
        let entries: Vec<([usize; 2], f64)> =
            own.map(|(at, s)| ([s.entry, usize::from(s.slot.entry)], slopes[*at])).collect();
        out[motion.0] = out[motion.0].max(singular_value(&entries));
    }
    out
}

/// Products with a matrix of three rows and columns that its largest singular value is sought with: after so many, values that
/// differ by a tenth are told apart to a thousandth, and closer ones do not matter.
const PRODUCTS: usize = 30;

/// The largest singular value of a matrix, given by row, column and number; what is not listed is zero.
fn singular_value(entries: &[([usize; 2], f64)]) -> f64 {
    let n = entries.iter().flat_map(|(at, _)| at).max().map_or(0, |most| most + 1);
    let product = |v: &[f64], [row, column]: [usize; 2]| {
        let mut out = vec![0.0; n];
        entries.iter().for_each(|(at, value)| out[at[row]] += value * v[at[column]]);
        out
    };
    let length = |v: &[f64]| v.iter().fold(0.0f64, |m, x| m.hypot(*x));
    let from_axis = |axis: usize| {
        let mut v: Vec<f64> = (0..n).map(|k| f64::from(u8::from(k == axis))).collect();
        for _ in 0..PRODUCTS {
            let next = product(&product(&v, [0, 1]), [1, 0]);
            let size = length(&next);
            if size == 0.0 || !size.is_finite() {
                break;
            }
            v = next.iter().map(|x| x / size).collect();
        }
        length(&product(&v, [0, 1]))
    };
    // no singular vector is at right angles to all axes
    (0..n).map(from_axis).fold(0.0, f64::max)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_singular_value_does_not_depend_on_the_axes() {
        for angle in [0.0f64, 0.3, 0.5 * std::f64::consts::FRAC_PI_2, 1.5] {
            let (s, c) = angle.sin_cos();
            // a gap along a normal, and the projection along a face
            let normal = singular_value(&[([0, 0], 3.0 * c), ([0, 1], 3.0 * s)]);
            let along = singular_value(&[([0, 0], s * s), ([0, 1], -s * c), ([1, 0], -s * c), ([1, 1], c * c)]);
            assert!((normal - 3.0).abs() < 1e-12 && (along - 1.0).abs() < 1e-12, "{angle}: {normal} {along}");
        }
        assert!((singular_value(&[([0, 0], 1.0), ([1, 1], 0.9), ([2, 1], 0.9)]) - 0.9 * 2f64.sqrt()).abs() < 1e-9);
        assert_eq!(singular_value(&[]), 0.0);
    }
}
