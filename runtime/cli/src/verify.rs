//! `wfl verify`: tangents against differences of residuals, contact terms against bodies of constant stress.

use std::process::ExitCode;

use serde_json::Value;
use wfl_compiler::{
    KinkKind, TangentCheck, TangentSampling, TermLaw, check_tangent,
    types::{BasisSlot, FieldOp, FieldSig, Side},
};
use wfl_runtime::{Scene, consistency::consistency};

use crate::{
    args::VerifyArgs,
    contact,
    load::{load, out, print_all, say},
    prepared::{EXIT_ERROR, backend, prepare_scene},
    table::Table,
};

/// Largest error of a block that passes.
const TOLERANCE: f64 = 1e-7;

pub(crate) fn verify(args: &VerifyArgs) -> ExitCode {
    let Some(mut loaded) = load(&args.scene.scene, &args.scene.overrides, "verify") else {
        return ExitCode::from(EXIT_ERROR);
    };
    let Some(backend) = backend(false) else { return ExitCode::from(EXIT_ERROR) };
    let Some(mut scene) = prepare_scene(&mut loaded, &*backend, &[]) else { return ExitCode::from(EXIT_ERROR) };
    let forms = consistency(&mut scene);
    let inconsistent = contact::warnings(&loaded, &forms);
    loaded.messages.extend(inconsistent.iter().cloned());
    print_all(&loaded.messages, &loaded.sources);
    let sampling = sampling(&scene, args);
    let columns = ["term", "test", "trial", "entries", "tangent - difference", "rounding", ""];
    let mut blocks = Table::new("tangents (largest deviation over the largest entry of the block)", &columns);
    let mut states = Table::new("states", &["term", "tested", "beside kinks", "not finite", "kinks by branch"]);
    let mut failures = Vec::new();
    for term in &scene.system.terms {
        let law = &term.law;
        match check_tangent(law, &sampling, &*backend) {
            Ok(Some(found)) => {
                block_rows(law, &found, &scene.sigs, &mut blocks);
                states.push(vec![
                    law.name.clone().into(),
                    found.states.into(),
                    found.near_kinks.into(),
                    found.not_finite.into(),
                    branches(law, &found).into(),
                ]);
                failures.extend(failure(law, &found, &scene.sigs));
            }
            Ok(None) => failures.push(format!("term {}: a tangent without residual cannot be compared", law.name)),
            Err(e) => failures.push(format!("term {}: {e}", law.name)),
        }
    }
    out(&[blocks.text(), states.text()].join("\n"));
    for table in contact::states(&loaded, &scene, &forms).iter().filter(|t| !t.rows.is_empty()) {
        out(&format!("\n{}", table.text()));
    }
    if failures.is_empty() {
        out(&format!("\nall tangents agree within {TOLERANCE:e}; machine code and interpreter agree bit by bit\n"));
    }
    failures.extend(inconsistent.iter().map(|d| format!("{}: {}", d.code, d.message)));
    if failures.is_empty() {
        return ExitCode::SUCCESS;
    }
    for failure in failures {
        say(&format!("error: {failure}\n"));
    }
    ExitCode::from(EXIT_ERROR)
}

fn sampling(scene: &Scene, args: &VerifyArgs) -> TangentSampling {
    let (low, high) = scene.system.mesh.bounds();
    let values = &scene.steps.values;
    // the first step has the increment of the second, as in a run
    let increment = |k: usize| match k {
        0 => values.get(1).map_or(0.0, |b| b - values[0]),
        _ => values[k] - values[k - 1],
    };
    let times = (0..values.len()).map(|k| (values[k], increment(k))).collect();
    TangentSampling { samples: args.samples.get(), seed: args.seed, low, high, times }
}

fn block_rows(law: &TermLaw, found: &TangentCheck, sigs: &[FieldSig], table: &mut Table) {
    for block in &found.blocks {
        let group = |g: wfl_compiler::SlotGroup| group_text(g.side, g.op, &sigs[g.field.index()].name);
        let good = block.error <= TOLERANCE;
        table.push(vec![
            law.name.clone().into(),
            group(block.test).into(),
            group(block.trial).into(),
            block.n_entries.into(),
            deviation(block.error).into(),
            deviation(block.rounding).into(),
            Value::from(if good { "" } else { "WRONG" }),
        ]);
    }
}

fn deviation(x: f64) -> String {
    if x == 0.0 { "0".to_owned() } else { format!("{x:.1e}") }
}

fn group_text(side: Side, op: FieldOp, name: &str) -> String {
    let prefix = match op {
        FieldOp::Value => "",
        FieldOp::Grad => "Grad_",
        FieldOp::Hess => "Hess_",
    };
    let there = if side == Side::There { " there" } else { "" };
    format!("{prefix}{name}{there}")
}

/// A slot in words: `Grad_u(1,2) there`.
pub(crate) fn basis_text(slot: BasisSlot, sigs: &[FieldSig]) -> String {
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

/// How often each branch was tested, by kink.
fn branches(law: &TermLaw, found: &TangentCheck) -> String {
    let one = |(kink, count): (&wfl_compiler::Kink, &[usize; 3])| match kink.kind {
        KinkKind::Select => format!("false {} true {}", count[0], count[1]),
        KinkKind::Ball => format!("open {} slip {} stick {}", count[0], count[1], count[2]),
    };
    let list: Vec<String> = law.kinks.iter().zip(&found.kinks).map(one).collect();
    if list.is_empty() { "-".to_owned() } else { list.join("; ") }
}

/// What is wrong with a term, in words.
fn failure(law: &TermLaw, found: &TangentCheck, sigs: &[FieldSig]) -> Option<String> {
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
