//! Whichever linear solver a scene asks for, it is the same scene: its unknowns and measures are those of a factor of double
//! precision. Meshes, laws, coefficients, constraints and rules at random; `WFL_SOLVER_SCENES` is another number of scenes,
//! `WFL_SOLVER_FIRST` the seed of the first, and `WFL_SOLVER_TELL` prints what becomes of each.

mod meshes;
mod scenes;

use std::{path::Path, time::Instant};

use wfl_discrete::pruning::Pruning;
use wfl_jit::JitBackend;
use wfl_problem::prepare_keeping;
use wfl_run::{Quiet, RunOptions, run};
use wfl_sparse::solve::Precision;
use wfl_tests::{MeshFolder, Sequence, script_and_messages};

/// Scenes of a run of the tests.
const SCENES: u64 = if cfg!(debug_assertions) { 12 } else { 60 };
/// Part of the largest value of a field, or of the largest measure of a kind, by which solvers may differ.
const SAME: f64 = 1e-9;

/// What is drawn.
struct Draw(Sequence);

impl Draw {
    fn new(seed: u64) -> Self {
        let mut random = Sequence(0x9e37_79b9_7f4a_7c15 ^ (7919 * (seed + 1)));
        (0..16).for_each(|_| {
            random.number();
        });
        Self(random)
    }

    /// A number below `n`.
    fn below(&mut self, n: usize) -> usize {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
        let k = (0.5 * (1.0 + self.0.number()) * n as f64) as usize;
        k.min(n - 1)
    }

    /// True in this part of all draws.
    fn chance(&mut self, part: f64) -> bool {
        0.5 * (1.0 + self.0.number()) < part
    }

    fn of<'a>(&mut self, list: &[&'a str]) -> &'a str {
        list[self.below(list.len())]
    }
}

/// How a scene is solved.
#[derive(Clone, Copy)]
struct Way {
    linear: &'static str,
    threads: usize,
    precision: Precision,
    keep: &'static [Pruning],
}

/// What came out.
struct Found {
    /// By field its name and the values at the last step.
    fields: Vec<(String, Vec<f64>)>,
    measures: Vec<(String, f64)>,
    solver: String,
}

impl Way {
    fn name(self) -> String {
        format!("{} {:?} {:?}", self.linear, self.precision, self.keep)
    }

    /// Linear terms are integrated by the rules of their regions, not by their own.
    fn has_other_rules(self) -> bool {
        self.keep.contains(&Pruning::Quadrature)
    }
}

const FACTOR: Way = Way { linear: "direct", threads: 2, precision: Precision::Double, keep: &[] };

fn found(folder: &Path, scene: &str, way: Way) -> Result<Found, String> {
    let text = format!("{scene}solver newton with tol=1e-12, {}\n", way.linear);
    let (script, sources, messages) = script_and_messages(folder, text, &[], &[]);
    let script = script.ok_or(messages)?;
    let backend = JitBackend::new().expect("machine code");
    let made = prepare_keeping(&script, folder, &backend, way.keep);
    let told = || made.diagnostics.iter().map(|d| wfl::render(d, &sources)).collect::<Vec<_>>().join("\n");
    let Some(scene) = &made.scene else { return Err(told()) };
    let options = RunOptions { precision: way.precision, ..RunOptions::without_files(way.threads, Instant::now()) };
    let outcome = run(scene, &options, &mut Quiet).map_err(|e| e.to_string())?;
    if !outcome.converged() {
        return Err("a step did not converge".to_owned());
    }
    let (last, system) = (outcome.steps.last().expect("a step"), &scene.system);
    let fields = (0..system.fields.len())
        .filter_map(|k| Some((system.fields[k].name.clone(), last.state[system.range(k)?].to_vec())));
    let solver = outcome.report.solver.clone().unwrap_or_default();
    Ok(Found { fields: fields.collect(), measures: last.measures.clone(), solver })
}

/// The largest difference, in parts of the largest value of the field, or of the measures whose names begin alike.
fn differs(a: &Found, b: &Found) -> (f64, String) {
    let largest = |values: &[f64]| values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let mut worst = (0.0, String::new());
    let mut take = |difference: f64, size: f64, name: &str| {
        let part = if difference == 0.0 { 0.0 } else { difference / size };
        if part > worst.0 || part.is_nan() {
            worst = (part, name.to_owned());
        }
    };
    for ((name, a), (_, b)) in a.fields.iter().zip(&b.fields) {
        let difference: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
        take(largest(&difference), largest(a), name);
    }
    let kind = |name: &str| name.split('_').next().unwrap_or_default().to_owned();
    for ((name, of_a), (_, of_b)) in a.measures.iter().zip(&b.measures) {
        let alike: Vec<f64> = a.measures.iter().filter(|m| kind(&m.0) == kind(name)).map(|m| m.1).collect();
        take((of_a - of_b).abs(), largest(&alike), name);
    }
    worst
}

/// What the other ways of a scene are.
fn ways(draw: &mut Draw) -> [Way; 5] {
    let kept: &[&'static [Pruning]] = &[
        &[],
        &[Pruning::Constant],
        &[Pruning::Linear],
        &[Pruning::Condense],
        &[Pruning::Forces],
        &[Pruning::Symmetric],
        &[Pruning::Past],
    ];
    let (keep, other) = (kept[draw.below(kept.len())], kept[draw.below(kept.len())]);
    let on_two = |linear| Way { linear, ..FACTOR };
    [
        on_two("cg, amg"),
        on_two("gmres, amg"),
        Way { precision: Precision::Mixed, keep, threads: 1, ..FACTOR },
        Way { keep: other, ..on_two(draw.of(&["cg, amg", "gmres, amg"])) },
        Way { keep: &[Pruning::Quadrature], ..on_two("direct") },
    ]
}

/// What became of a scene.
struct Examined {
    wrong: Vec<String>,
    /// A line for who wants to see it.
    line: String,
    /// An iteration solved it, and this without a matrix.
    iterated: bool,
    applied: bool,
}

fn examine(seed: u64, tells: bool) -> Examined {
    let mut draw = Draw::new(seed);
    let body = meshes::body(&mut draw);
    let scene = scenes::scene(&mut draw, &body);
    let folder = MeshFolder::new(&format!("any-solver-{seed}"), body.file.as_deref().unwrap_or_default());
    if tells {
        eprintln!("{scene}");
    }
    let mut became = Examined { wrong: Vec::new(), line: format!("{seed}:"), iterated: false, applied: false };
    let known = match found(folder.path(), &scene, FACTOR) {
        Ok(known) => known,
        Err(told) => {
            became.wrong.push(format!("scene {seed} is not solved by a factor: {told}\n{scene}"));
            return became;
        }
    };
    let case = Case { folder: folder.path(), scene: &scene, known: &known };
    for way in ways(&mut draw) {
        if !way.has_other_rules() || body.is_affine && scenes::is_polynomial(&scene) {
            let wrong = compare(&case, way, &mut became);
            became.wrong.extend(wrong.map(|wrong| format!("scene {seed}, {}: {wrong}\n{scene}", way.name())));
        }
    }
    became
}

/// A scene of a folder, and what a factor makes of it.
struct Case<'a> {
    folder: &'a Path,
    scene: &'a str,
    known: &'a Found,
}

/// What is wrong with one way to solve a scene.
fn compare(case: &Case<'_>, way: Way, became: &mut Examined) -> Option<String> {
    let Case { folder, scene, known } = *case;
    let mut own = match found(folder, scene, way) {
        Ok(own) => own,
        Err(told) => {
            let Some(refusal) = told.lines().find(|line| line.contains("E442")) else { return Some(told) };
            became.line += &format!(" | {}: {refusal}", way.name());
            return None;
        }
    };
    if way.has_other_rules() {
        // measures have the rules of their regions
        own.measures.clone_from(&known.measures);
    }
    let (part, of) = differs(known, &own);
    let solver = own.solver.as_str();
    became.line += &format!(" | {}: {part:.1e} of {of} [{solver}]", way.name());
    became.iterated |= solver.contains("multigrid") && !solver.contains("in place of");
    became.applied |= solver.contains("without a matrix");
    // a number that is none is no part either
    if !part.is_finite() || part > SAME {
        return Some(format!("{of} differs by {part:e} ({solver})"));
    }
    if !way.linear.contains("amg") || !way.keep.is_empty() {
        return None;
    }
    let again = found(folder, scene, Way { threads: 3 - way.threads, ..way });
    let same = again.is_ok_and(|again| again.fields == own.fields && again.measures == own.measures);
    (!same).then(|| "other bits on another number of threads".to_owned())
}

#[test]
fn random_scenes_are_the_same_whichever_solver_is_asked_for() {
    let number = |name: &str, other: u64| std::env::var(name).ok().and_then(|n| n.parse().ok()).unwrap_or(other);
    let (first, n) = (number("WFL_SOLVER_FIRST", 0), number("WFL_SOLVER_SCENES", SCENES));
    let tells = std::env::var("WFL_SOLVER_TELL").is_ok();
    let (mut wrong, mut iterated, mut applied) = (Vec::new(), 0, 0);
    for seed in first..first + n {
        let own = examine(seed, tells);
        if tells {
            eprintln!("{}\n{}", own.line, own.wrong.join("\n"));
        }
        wrong.extend(own.wrong);
        iterated += u64::from(own.iterated);
        applied += u64::from(own.applied);
    }
    assert!(wrong.is_empty(), "{} of {n}:\n{}", wrong.len(), wrong.join("\n"));
    // otherwise nothing is compared
    assert!(
        2 * iterated >= n && 5 * applied >= n,
        "of {n} scenes {iterated} were iterated, {applied} without a matrix"
    );
}
