//! Is the tangent of a term symmetric? Decided once when it is compiled; the solver takes its factorisation from it.
//!
//! Promises: says yes only when mirrored entries are the same scalar or agree at sampled states to rounding. Does not
//! judge definiteness.

use std::collections::BTreeMap;

use crate::{
    interp::interpret,
    ir::Val,
    law::TermLaw,
    random::Random,
    types::{BasisSlot, InputSlot},
};

/// Symmetric: equal scalars in mirrored entries, or equal values at sampled states (identity testing).
pub(crate) fn is_symmetric(law: &TermLaw, pairs: &BTreeMap<(u16, u16), Val>) -> bool {
    if law.entries.is_empty() {
        return true;
    }
    let position = |slot: BasisSlot, list: &[BasisSlot]| list.iter().position(|s| *s == slot);
    let mut mirror = BTreeMap::new();
    for (k, (t, s)) in law.entries.iter().enumerate() {
        let Some(row) = position(law.trials[usize::from(*s)], &law.tests) else { return false };
        let Some(column) = position(law.tests[usize::from(*t)], &law.trials) else { return false };
        let key = (u16::try_from(row).expect("few slots"), u16::try_from(column).expect("few slots"));
        let Ok(other) = law.entries.binary_search(&key) else { return false };
        mirror.insert(k, other);
    }
    let values: Vec<Val> = pairs.values().copied().collect();
    if mirror.iter().all(|(k, other)| values[*k] == values[*other]) {
        return true;
    }
    sampled_symmetric(law, &mirror)
}

/// Entries are compared at so many sampled inputs near one.
const SYMMETRY_SAMPLES: usize = 24;
/// What mirrored entries may differ by, relative to the larger one: rounding of a long formula.
const SYMMETRY_TOLERANCE: f64 = 1e-11;
/// The same relative to the largest entries of both slots: rounding of what cancels to nothing. No more, because of slots in
/// other units, such as a pressure beside a displacement, the largest entries say little.
const CANCELLED: f64 = 64.0 * f64::EPSILON;
/// ... and at so many where each input has a size of its own, between these powers of ten: a branch that begins at a pressure
/// of 1e5 is one of the law, too.
const WIDE_SAMPLES: usize = 40;
const SMALLEST_POWER: f64 = -9.0;
const LARGEST_POWER: f64 = 12.0;
/// What they may differ by there, where more cancels.
const WIDE_TOLERANCE: f64 = 1e-4;

fn sampled_symmetric(law: &TermLaw, mirror: &BTreeMap<usize, usize>) -> bool {
    let mut generator = Random::new(0);
    let mut random = move || generator.next();
    let kernel = law.tangent.kernel();
    let mut values = Vec::new();
    let mut outputs = vec![0.0; kernel.outputs.len()];
    let mut seen = vec![false; law.entries.len()];
    for sample in 0..SYMMETRY_SAMPLES + WIDE_SAMPLES {
        let is_wide = sample >= SYMMETRY_SAMPLES;
        let scale = 10f64.powi(i32::try_from(sample % 6).expect("small") - 4);
        let mut sized = |near: f64| {
            let middle = 0.5 * (SMALLEST_POWER + LARGEST_POWER);
            let power = |unit: f64| 10f64.powf(middle + 0.5 * unit * (LARGEST_POWER - SMALLEST_POWER));
            random() * if is_wide { power(random()) } else { near }
        };
        let uniforms: Vec<f64> = (0..kernel.n_uniforms).map(|_| sized(1.0)).collect();
        let near = |slot: &InputSlot| if matches!(slot, InputSlot::Field(_)) { scale } else { 1.0 };
        let mut inputs: Vec<f64> = law.inputs.iter().map(|slot| sized(near(slot))).collect();
        unit_normals(&law.inputs, &mut inputs);
        interpret(&law.tangent, &uniforms, &inputs, &mut values, &mut outputs);
        let entries = &outputs[law.tests.len()..law.tests.len() + law.entries.len()];
        let sizes = slot_sizes(law, entries);
        let tolerance = if is_wide { WIDE_TOLERANCE } else { SYMMETRY_TOLERANCE };
        for (k, other) in mirror {
            let (a, b) = (entries[*k], entries[*other]);
            let rounding = CANCELLED * (sizes[*k] * sizes[*other]).sqrt();
            if (a - b).abs() > tolerance * a.abs().max(b.abs()) + rounding {
                return false;
            }
            // a sample may lie where the law has no value
            seen[*k] |= a.is_finite() && b.is_finite();
        }
    }
    mirror.keys().all(|k| seen[*k])
}

/// By entry the largest magnitude among those with its test slot.
fn slot_sizes(law: &TermLaw, entries: &[f64]) -> Vec<f64> {
    let mut by_test = vec![0.0f64; law.tests.len()];
    for ((test, _), value) in law.entries.iter().zip(entries) {
        let own = &mut by_test[usize::from(*test)];
        *own = own.max(value.abs());
    }
    law.entries.iter().map(|(test, _)| by_test[usize::from(*test)]).collect()
}

/// Makes sampled normals unit vectors (opposite on the two sides) and sizes positive.
pub fn unit_normals(slots: &[InputSlot], inputs: &mut [f64]) {
    let mut length = 0.0f64;
    let mut here = [0.0; 3];
    for (slot, x) in slots.iter().zip(inputs.iter()) {
        if let InputSlot::Normal(crate::types::Side::Here, k) = slot {
            here[usize::from(*k)] = *x;
            length = length.hypot(*x);
        }
    }
    for (slot, x) in slots.iter().zip(inputs.iter_mut()) {
        match slot {
            InputSlot::Normal(side, k) => {
                let sign = if *side == crate::types::Side::Here { 1.0 } else { -1.0 };
                if length > 0.0 {
                    *x = sign * here[usize::from(*k)] / length;
                }
            }
            InputSlot::ElementSize(_) => *x = 0.5 + x.abs(),
            _ => {}
        }
    }
}
