//! `wfl verify`: tangents against differences of residuals, contact terms against bodies of constant stress.

use std::process::ExitCode;

use serde_json::Value;
use wfl_compiler::{KinkKind, TangentCheck, TermLaw, check_tangent, types::FieldSig};
use wfl_discrete::system::System;
use wfl_tasks::{
    advice::contact::warnings,
    tangents::{TOLERANCE, failure, group_text, sampling},
};

use crate::{
    args::VerifyArgs,
    contact, gradient,
    load::{load_with_knobs, out, print_all, say},
    prepared::{EXIT_ERROR, backend, prepare_scene, sign_of_life},
    table::Table,
};

/// Differences of images that are found again are good to this part of the largest shift.
const SHIFT_TOLERANCE: f64 = 1e-6;

pub(crate) fn verify(args: &VerifyArgs) -> ExitCode {
    match args.gradient.request() {
        Ok(None) => laws(args),
        Ok(Some(request)) => gradient::compare(args, &request),
        Err(why) => {
            say(&format!("error: {why}\n"));
            ExitCode::from(EXIT_ERROR)
        }
    }
}

/// Compares the tangents of all laws with differences.
fn laws(args: &VerifyArgs) -> ExitCode {
    let Some(mut loaded) = load_with_knobs(&args.scene.scene, &args.scene.overrides, "verify") else {
        return ExitCode::from(EXIT_ERROR);
    };
    let preparing = sign_of_life();
    let Some(backend) = backend(false) else { return ExitCode::from(EXIT_ERROR) };
    let Some(scene) = prepare_scene(&mut loaded, &*backend, &[]) else { return ExitCode::from(EXIT_ERROR) };
    let forms = scene.contact_forms();
    let inconsistent = warnings(&loaded, &forms);
    loaded.messages.extend(inconsistent.iter().cloned());
    drop(preparing);
    print_all(&loaded.messages, &loaded.sources);
    let sampling = sampling(&scene, args.samples.get(), args.seed);
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
    let images = images(&scene.system, &mut failures);
    if !images.rows.is_empty() {
        out(&format!("\n{}", images.text()));
    }
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

/// The shifts of images that move against images that are found again.
fn images(system: &System, failures: &mut Vec<String>) -> Table {
    let columns = ["term", "points compared", "points", "shift - difference", ""];
    let mut table = Table::new("images (largest deviation over the largest shift)", &columns);
    for term in &system.terms {
        let Some(points) = &term.integrator.domain.moving else { continue };
        let found = points.check_shifts(&system.mesh);
        let good = found.error <= SHIFT_TOLERANCE;
        if !good {
            failures.push(format!("term {}: its images shift otherwise than their formula says", term.law.name));
        }
        table.push(vec![
            term.law.name.clone().into(),
            found.points.into(),
            found.all.into(),
            deviation(found.error).into(),
            Value::from(match (found.points, good) {
                (0, _) => "no image near the start: not compared",
                (_, true) => "",
                (_, false) => "WRONG",
            }),
        ]);
    }
    table
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

/// How often each branch was tested, by kink.
fn branches(law: &TermLaw, found: &TangentCheck) -> String {
    let one = |(kink, count): (&wfl_compiler::Kink, &[usize; 3])| match kink.kind {
        KinkKind::Select => format!("false {} true {}", count[0], count[1]),
        KinkKind::Ball => format!("open {} slip {} stick {}", count[0], count[1], count[2]),
    };
    let list: Vec<String> = law.kinks.iter().zip(&found.kinks).map(one).collect();
    if list.is_empty() { "-".to_owned() } else { list.join("; ") }
}
