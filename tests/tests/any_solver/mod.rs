//! Whichever linear solver a scene asks for, it is the same scene: its unknowns and measures are those of a factor of double
//! precision. Meshes, laws, coefficients, constraints and rules at random; `WFL_SOLVER_SCENES` is another number of scenes,
//! `WFL_SOLVER_FIRST` the seed of the first, and `WFL_SOLVER_TELL` prints what becomes of each.

mod meshes;
mod mixed;
mod multipliers;
mod places;
mod ranks;
mod scenes;
mod sliding;
mod times;

use std::{any::Any, ops::Range, panic::AssertUnwindSafe, path::Path, time::Instant};

use wfl_discrete::pruning::Pruning;
use wfl_jit::JitBackend;
use wfl_problem::prepare_keeping;
use wfl_run::{Outcome, Quiet, RunOptions, run};
use wfl_sparse::solve::Precision;
use wfl_tests::{MeshFolder, Sequence, doubts, ranks::Holding, script_and_messages};

/// Scenes of a run of the tests.
const SCENES: u64 = if cfg!(debug_assertions) { 12 } else { 60 };
/// Part of the largest value of a field, or of the largest measure of a kind, by which solvers may differ.
const SAME: f64 = 1e-9;
/// A field, or measures of a kind, that no load moves has rounding alone: at most this part of the largest value of all. Only
/// then it is compared with that value, and not with its own.
const ZERO: f64 = 1e-14;

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
    /// What the run gives cause to doubt.
    codes: Vec<&'static str>,
    told: Vec<String>,
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

/// A panic as text.
fn panicked(what: &(dyn Any + Send)) -> String {
    let text = what.downcast_ref::<String>().map(String::as_str).or_else(|| what.downcast_ref::<&str>().copied());
    format!("a panic: {}", text.unwrap_or("of no text"))
}

fn found(folder: &Path, scene: &str, way: Way) -> Result<Found, String> {
    std::panic::catch_unwind(AssertUnwindSafe(|| tried(folder, scene, way))).unwrap_or_else(|e| Err(panicked(&*e)))
}

fn tried(folder: &Path, scene: &str, way: Way) -> Result<Found, String> {
    let text = format!("{scene}solver newton with tol=1e-12, {}\n", way.linear);
    let (script, sources, messages) = script_and_messages(folder, text, &[], &[]);
    let script = script.ok_or(messages)?;
    let backend = JitBackend::new().expect("machine code");
    let made = prepare_keeping(&script, folder, &backend, way.keep);
    let told = || made.diagnostics.iter().map(|d| wfl::render(d, &sources)).collect::<Vec<_>>().join("\n");
    let Some(scene) = &made.scene else {
        return Err(told());
    };
    let options = RunOptions { precision: way.precision, ..RunOptions::without_files(way.threads, Instant::now()) };
    let system = &scene.system;
    let fields: Vec<(String, Range<usize>)> =
        (0..system.fields.len()).filter_map(|k| Some((system.fields[k].name.clone(), system.range(k)?))).collect();
    brought(&fields, run(scene, &options, &mut Quiet).map_err(|e| e.to_string())?)
}

/// What a run has at its last step, of some fields.
fn brought(fields: &[(String, Range<usize>)], outcome: Outcome) -> Result<Found, String> {
    if !outcome.converged() {
        return Err("a step did not converge".to_owned());
    }
    let last = outcome.steps.last().expect("a step");
    let (codes, told) = doubts(&outcome).into_iter().unzip();
    let solver = outcome.report.solver.clone().unwrap_or_default();
    let fields = fields.iter().map(|(name, range)| (name.clone(), last.state[range.clone()].to_vec())).collect();
    Ok(Found { fields, measures: last.measures.clone(), solver, codes, told })
}

/// The largest difference, in parts of the largest value of the field, or of the measures whose names begin alike.
fn differs(a: &Found, b: &Found) -> (f64, String) {
    let largest = |values: &[f64]| values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let beside = |own: f64, of_all: f64| if own <= ZERO * of_all { ZERO / SAME * of_all } else { own };
    let mut worst = (0.0, String::new());
    let mut take = |difference: f64, size: f64, name: &str| {
        let part = if difference == 0.0 { 0.0 } else { difference / size };
        if part > worst.0 || part.is_nan() {
            worst = (part, name.to_owned());
        }
    };
    let of_all = a.fields.iter().fold(0.0f64, |m, (_, values)| m.max(largest(values)));
    for ((name, a), (_, b)) in a.fields.iter().zip(&b.fields) {
        let difference: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
        take(largest(&difference), beside(largest(a), of_all), name);
    }
    let of_all = a.measures.iter().fold(0.0f64, |m, (_, value)| m.max(value.abs()));
    let kind = |name: &str| name.split('_').next().unwrap_or_default().to_owned();
    for ((name, of_a), (_, of_b)) in a.measures.iter().zip(&b.measures) {
        let alike: Vec<f64> = a.measures.iter().filter(|m| kind(&m.0) == kind(name)).map(|m| m.1).collect();
        take((of_a - of_b).abs(), beside(largest(&alike), of_all), name);
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
    /// Several ranks solved it.
    shared: bool,
}

fn examine(seed: u64, tells: bool) -> Examined {
    let mut draw = Draw::new(seed);
    let law = scenes::law(seed);
    let mut body = if law == "sliding" { sliding::blocks(&mut draw) } else { meshes::body(&mut draw) };
    while law == "periodic" && !body.has_equal_ends {
        body = meshes::body(&mut draw);
    }
    let scene = scenes::scene(&mut draw, &body, law);
    let folder = MeshFolder::new(&format!("any-solver-{seed}"), body.file.as_deref().unwrap_or_default());
    if tells {
        eprintln!("{scene}");
    }
    let line = format!("{seed}, {law}:");
    let mut became = Examined { wrong: Vec::new(), line, iterated: false, applied: false, shared: false };
    let known = match found(folder.path(), &scene, FACTOR) {
        Ok(known) => known,
        Err(told) => {
            became.wrong.push(format!("scene {seed} ({law}) is not solved by a factor: {told}\n{scene}"));
            return became;
        }
    };
    became.line += &known.told.join(" / ");
    let case = Case { folder: folder.path(), scene: &scene, known: &known };
    for way in ways(&mut draw) {
        if !way.has_other_rules() || body.is_affine && scenes::is_polynomial(&scene) {
            let wrong = compare(&case, way, &mut became);
            became.wrong.extend(wrong.map(|wrong| format!("scene {seed}, {}: {wrong}\n{scene}", way.name())));
        }
    }
    let (number, has_parts) = (2 + draw.below(2), draw.chance(0.7));
    // the points of faces that are cut anew in each state are counted by one rank alone so far
    if scene.contains(" segments of ") {
        return became;
    }
    let wrong = compare_ranks(&case, number, has_parts, &mut became);
    became.wrong.extend(wrong.map(|wrong| format!("scene {seed}, {number} ranks: {wrong}\n{scene}")));
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
            let Some(refusal) = told.lines().find(|line| line.contains("E442")) else {
                return Some(told);
            };
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
    let codes = if own.codes == known.codes { String::new() } else { format!(" {:?}", own.codes) };
    became.line += &format!(" | {}: {part:.1e} of {of} [{solver}]{codes}", way.name());
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

/// What is wrong with what several ranks find.
fn compare_ranks(case: &Case<'_>, number: usize, has_parts: bool, became: &mut Examined) -> Option<String> {
    let Case { folder, scene, known } = *case;
    let holding = if has_parts && ranks::may_have_parts(folder, scene) { Holding::Parts } else { Holding::Whole };
    let mut own = match ranks::found(folder, scene, number, holding) {
        Ok(own) => own,
        Err(told) => return Some(format!("{holding:?}: {told}")),
    };
    // nodes of a part have numbers of their own: measures are compared
    if holding == Holding::Parts {
        own.fields.clone_from(&known.fields);
    }
    let (part, of) = differs(known, &own);
    let codes = if own.codes == known.codes { String::new() } else { format!(" {:?}", own.codes) };
    became.line += &format!(" | {number} ranks, {holding:?}: {part:.1e} of {of}{codes}");
    became.shared = true;
    (!part.is_finite() || part > SAME).then(|| format!("{holding:?}: {of} differs by {part:e}"))
}

#[test]
fn random_scenes_are_the_same_whichever_solver_is_asked_for() {
    let number = |name: &str, other: u64| std::env::var(name).ok().and_then(|n| n.parse().ok()).unwrap_or(other);
    let (first, n) = (number("WFL_SOLVER_FIRST", 0), number("WFL_SOLVER_SCENES", SCENES));
    let tells = std::env::var("WFL_SOLVER_TELL").is_ok();
    let (mut wrong, mut iterated, mut applied, mut shared) = (Vec::new(), 0, 0, 0);
    for seed in first..first + n {
        let own = examine(seed, tells);
        if tells {
            eprintln!("{}\n{}", own.line, own.wrong.join("\n"));
        }
        wrong.extend(own.wrong);
        iterated += u64::from(own.iterated);
        applied += u64::from(own.applied);
        shared += u64::from(own.shared);
    }
    assert!(wrong.is_empty(), "{} of {n}:\n{}", wrong.len(), wrong.join("\n"));
    // otherwise nothing is compared
    assert!(
        3 * iterated >= n && applied >= n / 8 && 2 * shared >= n,
        "of {n} scenes {iterated} were iterated, {applied} without a matrix, {shared} on ranks"
    );
}
