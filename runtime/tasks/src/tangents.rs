//! The tangents of a scene against differences of its residuals: at which states they are tried, and what is said of a
//! tangent that is wrong. The comparison itself is `wfl_compiler::check_tangent`.

use wfl_compiler::{
    TangentCheck, TangentSampling, TermLaw,
    types::{BasisSlot, FieldOp, FieldSig, Side},
};
use wfl_problem::Scene;

/// Largest error of a block that passes.
pub const TOLERANCE: f64 = 1e-7;

/// States and times at which the terms of a scene are tried.
#[must_use]
pub fn sampling(scene: &Scene, samples: usize, seed: u64) -> TangentSampling {
    let (low, high) = scene.system.mesh.bounds();
    let values = &scene.steps.values;
    // the first step has the increment of the second, as in a run
    let increment = |k: usize| match k {
        0 => values.get(1).map_or(0.0, |b| b - values[0]),
        _ => values[k] - values[k - 1],
    };
    let times = (0..values.len()).map(|k| (values[k], increment(k))).collect();
    TangentSampling { samples, seed, low, high, times }
}

/// A field or a derivative of it in words: `Grad_u there`.
#[must_use]
pub fn group_text(side: Side, op: FieldOp, name: &str) -> String {
    let prefix = match op {
        FieldOp::Value => "",
        FieldOp::Grad => "Grad_",
        FieldOp::Hess => "Hess_",
    };
    let there = if side == Side::There { " there" } else { "" };
    format!("{prefix}{name}{there}")
}

/// A slot in words: `Grad_u(1,2) there`.
#[must_use]
pub fn basis_text(slot: BasisSlot, sigs: &[FieldSig]) -> String {
    let sig = &sigs[slot.field.index()];
    let name = group_text(Side::Here, slot.op, &sig.name);
    let there = if slot.side == Side::There { " there" } else { "" };
    // entries count the indices of the shape first, then the directions, which are as many as the rest needs
    let mut rest = usize::from(slot.entry);
    let mut indices: Vec<String> = Vec::new();
    for k in 0..sig.shape.rank() {
        indices.push((rest % sig.shape.size(k) + 1).to_string());
        rest /= sig.shape.size(k);
    }
    match slot.op {
        FieldOp::Value => {}
        FieldOp::Grad => indices.push((rest + 1).to_string()),
        FieldOp::Hess => indices.push(format!("direction {}", rest + 1)),
    }
    if indices.is_empty() { format!("{name}{there}") } else { format!("{name}({}){there}", indices.join(",")) }
}

/// What is wrong with a term, in words.
#[must_use]
pub fn failure(law: &TermLaw, found: &TangentCheck, sigs: &[FieldSig]) -> Option<String> {
    if found.passes(TOLERANCE) {
        return None;
    }
    if found.states == 0 {
        return Some(format!(
            "term {}: its residual is no finite number at all {} states drawn",
            law.name, found.not_finite
        ));
    }
    let mut text = format!("term {}:", law.name);
    let worst = found
        .blocks
        .iter()
        .max_by(|a, b| a.error.total_cmp(&b.error))
        .filter(|b| b.error > TOLERANCE || b.error.is_nan());
    if let Some(place) = worst.and_then(|b| b.worst.as_ref()) {
        text += &format!(
            " the derivative of the flux of {} by {} is {:e}, the tangent has {:e}{}",
            basis_text(place.test, sigs),
            basis_text(place.trial, sigs),
            place.difference,
            place.tangent,
            if place.near_kink { " (beside a kink)" } else { "" }
        );
    }
    if found.flux_differences > 0 {
        text += &format!(" {} fluxes differ between the kernels of residual and tangent", found.flux_differences);
    }
    if found.machine_differences > 0 {
        text += &format!(" {} outputs of the machine code differ from the interpreter", found.machine_differences);
    }
    Some(text)
}
