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

/// Entries compared at sampled inputs: relative difference below rounding growth.
const SYMMETRY_SAMPLES: usize = 24;
const SYMMETRY_TOLERANCE: f64 = 1e-11;

fn sampled_symmetric(law: &TermLaw, mirror: &BTreeMap<usize, usize>) -> bool {
    let mut generator = Random::new(0);
    let mut random = move || generator.next();
    let kernel = law.tangent.kernel();
    let mut values = Vec::new();
    let mut outputs = vec![0.0; kernel.outputs.len()];
    for sample in 0..SYMMETRY_SAMPLES {
        let scale = 10f64.powi(i32::try_from(sample % 6).expect("small") - 4);
        let uniforms: Vec<f64> = (0..kernel.n_uniforms).map(|_| random()).collect();
        let mut inputs: Vec<f64> =
            law.inputs.iter().map(|s| random() * if matches!(s, InputSlot::Field(_)) { scale } else { 1.0 }).collect();
        unit_normals(&law.inputs, &mut inputs);
        interpret(&law.tangent, &uniforms, &inputs, &mut values, &mut outputs);
        let entries = &outputs[law.tests.len()..law.tests.len() + law.entries.len()];
        let size = entries.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        if mirror.iter().any(|(k, other)| (entries[*k] - entries[*other]).abs() > SYMMETRY_TOLERANCE * size) {
            return false;
        }
    }
    true
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
