//! X rows of runs that must not give up, and not claim too much: warnings with their number, steps in parts, runs that
//! were stopped.
//!
//! A run that is killed is in the tests of the command; here the process goes on after a panic in the middle of a run,
//! which leaves the same files.

use std::path::PathBuf;

use wfl_contact::coercivity;
use wfl_jit::JitBackend;
use wfl_output::Hash;
use wfl_run::{Outcome, Progress, Quiet, RunOptions, StepResult, run};

use super::{
    Benchmark, Case, Tolerance,
    common::{converged, or_failed},
    two_block::{NITSCHE, SIZE, STICK, YOUNG, scene},
};
use crate::{Attempt, attempt, doubts, examples, prepared};

const fn row(id: &'static str, title: &'static str, origin: &'static str, run: fn() -> Vec<Case>) -> Benchmark {
    Benchmark { id, title, origin, slow: false, open: None, run }
}

const OUTCOME: &str = "an error that says why, no result";

/// The benchmarks of this file.
pub(super) const BENCHMARKS: &[Benchmark] = &[
    row("X1", "gamma = 1e-8 E/h gives a warning", "a message with the number", tiny_gamma),
    row(
        "X4",
        "gamma = 1e14 E/h and more: correct digits are estimated, fewer than 3 give a warning",
        "a message with the number",
        few_digits,
    ),
    row(
        "X6",
        "the smallest safe gamma of Nitsche's method for theta = 1",
        "eigenvalues of one element, independent dense program",
        constants,
    ),
    row("X49", "one load step instead of many", "the result of many steps", one_step),
    row("X50", "the limit of iterations is reached", OUTCOME, too_few_iterations),
    row("X52", "a results folder that cannot be created", OUTCOME, no_folder),
    row("X53", "interrupted, then resumed", "the uninterrupted run", resumed),
    row("X54", "a checkpoint that is truncated, or of another scene or mesh", OUTCOME, wrong_checkpoint),
];

fn gamma(gamma0: f64) -> f64 {
    gamma0 * YOUNG / SIZE
}

/// Codes of the warnings of a run.
fn codes(attempt: &Attempt) -> Vec<&'static str> {
    attempt.solved.iter().flat_map(|s| doubts(&s.outcome)).map(|w| w.0).collect()
}

fn tiny_gamma() -> Vec<Case> {
    let of = |theta: f64, gamma0: f64| {
        let text = scene(NITSCHE);
        let params = STICK.params(NITSCHE, gamma(gamma0), theta);
        let backend = JitBackend::new().map_err(|e| e.to_string())?;
        let scene = prepared(&examples(), text, &[], &params, &backend)?;
        let first = scene.at_first_step().map_err(|e| e.to_string())?;
        let found = coercivity(&first.system, &first.contact);
        found.into_iter().next().ok_or_else(|| "no Nitsche term is found".to_owned())
    };
    let mut cases = Vec::new();
    for (theta, gamma0, safe, usual) in [
        (0.0, 1e-8, false, false),
        (-1.0, 1e-8, true, false),
        (1.0, 1e-8, false, false),
        (0.0, 1e-2, false, true),
        (-1.0, 1e-2, true, true),
        (0.0, 2.0, true, true),
        (1.0, 2.0, true, true),
        (1.0, 1e9, true, false),
    ] {
        let what = format!("theta = {theta}, gamma = {gamma0:e} E/h");
        let made = of(theta, gamma0).map(|c| {
            Case::new(&what)
                .require(c.is_safe() == safe, format!("safe: {}", c.is_safe()))
                .require(c.is_usual() == usual, format!("usual: {}", c.is_usual()))
        });
        cases.push(or_failed(&what, made));
    }
    cases
}

fn few_digits() -> Vec<Case> {
    let mut cases = Vec::new();
    for gamma0 in [2.0, 1e8, 1e12, 1e13, 1e14, 1e16, 1e18] {
        let what = format!("Nitsche, gamma = {gamma0:e} E/h");
        let tried = STICK.attempt(NITSCHE, gamma(gamma0), 0.0, &[]);
        let warned = codes(&tried).contains(&"W605");
        let Some(solved) = tried.solved.filter(|s| s.outcome.converged()) else {
            cases.push(Case::new(what).require(gamma0 > 1e12, "is not solved"));
            continue;
        };
        let error = STICK.displacement_error(&solved).max(f64::EPSILON);
        let estimate = solved.outcome.steps[0].accuracy.as_ref().map_or(f64::NAN, |a| a.digits());
        let digits = (-error.log10()).max(0.0);
        cases.push(
            Case::new(what)
                .require(error < 1e-3 || warned, format!("no warning, but the error is {error:.1e}"))
                .require(error > 1e-5 || !warned, format!("a warning, but the error is {error:.1e}"))
                // an estimate: a sample of what rounding may do
                .compare("estimated digits", estimate, digits, Tolerance::Absolute(2.5)),
        );
    }
    cases
}

/// A block on another that presses; cells of size 1 across the interface, `tall` along it. The rule is exact, as that of the
/// program whose constants are known.
fn pair(element: &str, nu: f64, dim: usize, size: [f64; 2]) -> String {
    let [across, along] = size;
    let (mesh, cells, zero) = match dim {
        2 => (format!("[-1,0] to [1,{}]", 2.0 * along / across), "[2,2] quad", "[0,0]"),
        _ => (format!("[-1,0,0] to [1,{0},{0}]", 2.0 * along / across), "[2,2,2] hex", "[0,0,0]"),
    };
    let push = zero.replacen('0', "-1e-3", 1);
    format!(
        "param E = 1\nparam nu = {nu}\nparam gamma = 1\nmesh box {mesh} cells {cells}\n\
         region left = cells where x < 0\nregion right = cells where x > 0\n\
         region fault = interface from left to right\nregion west = faces where x == -1\n\
         region east = faces where x == 1\nunknown uL : vector {element} on left\n\
         unknown uR : vector {element} on right\ndef lambda_ = E*nu/((1+nu)*(1-2*nu))\ndef mu = E/(2*(1+nu))\n\
         def sigma(v) = lambda_*Div_v*Id({dim}) + 2*mu*Sym(Grad_v)\ndef trac(v) = sigma(v)*Normal\n\
         def jump(a,b) = a - Interpolate(b, neighbor_element)\ndef tang(w) = w - (w.Normal)*Normal\n\
         def Pn = gamma*(jump(uL,uR).Normal) - trac(uL).Normal\ndef Pt = gamma*tang(jump(uL,uR)) - tang(trac(uL))\n\
         def force = pos_part(Pn)*Normal + Ball_projection(Pt, 0.4*pos_part(Pn))\n\
         term left on left : sigma(uL):Grad_Test_uL\nterm right on right : sigma(uR):Grad_Test_uR\n\
         term stress on fault : -1/gamma*trac(uL).trac(Test_uL)\n\
         term contact on fault : 1/gamma*force.(gamma*jump(Test_uL,Test_uR) - trac(Test_uL))\n\
         quadrature on fault degree 6\nfix uL = {zero} on west\nfix uR = {push} on east\n"
    )
}

/// The constants C of gamma > C E/h.
fn constants() -> Vec<Case> {
    let known: [(&str, usize, f64, f64, f64); 10] = [
        ("Q1", 3, 0.25, 1.704, 5e-4),
        ("Q1", 3, 0.3, 2.237, 5e-4),
        ("Q1", 3, 0.49, 65.0, 1e-3),
        ("Q1", 3, 0.4999, 6.66e3, 1e-3),
        ("Q2", 3, 0.25, 5.563, 5e-4),
        ("Q2", 3, 0.3, 6.732, 5e-4),
        ("Q2", 3, 0.49, 147.6, 5e-4),
        ("Q2", 3, 0.4999, 1.50e4, 1e-3),
        ("Q1", 2, 0.25, 1.521, 5e-4),
        ("Q2", 2, 0.25, 5.275, 5e-4),
    ];
    let bound = |text: String| {
        let backend = JitBackend::new().map_err(|e| e.to_string())?;
        let scene = prepared(&examples(), text, &[], &[], &backend)?;
        let first = scene.at_first_step().map_err(|e| e.to_string())?;
        let found = coercivity(&first.system, &first.contact);
        Ok(found.first().map_or(f64::NAN, wfl_contact::Coercivity::smallest))
    };
    known
        .into_iter()
        .map(|(element, dim, nu, expected, digits)| {
            let what = format!("{element}, {dim} dimensions, nu = {nu}");
            let made = bound(pair(element, nu, dim, [1.0, 1.0]))
                .map(|c| Case::new(&what).compare("C", c, expected, Tolerance::Relative(digits)));
            or_failed(&what, made)
        })
        .collect()
}

/// The fault on a small mesh.
fn small(steps: &str) -> [(&'static str, String); 2] {
    [("cells [8, 8, 8]", "cells [4, 4, 4]".to_owned()), ("steps t = 0 to 9.5 by 0.5", steps.to_owned())]
}

fn one_step() -> Vec<Case> {
    let last = |steps: &str| {
        let edits = small(steps);
        let folder = examples().join("fault");
        let text = std::fs::read_to_string(folder.join("penalty.wfl")).map_err(|e| e.to_string())?;
        let tried = attempt(&folder, text, &edits, &[]);
        let solved = tried.solved.ok_or(tried.messages).and_then(converged)?;
        solved.outcome.steps.last().map(|s| s.state.clone()).ok_or_else(|| "no step".to_owned())
    };
    let made = last("steps t = 0 to 8 by 0.5").and_then(|many| {
        let one = last("steps t = 8 to 8 by 1")?;
        let size = many.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let gap = many.iter().zip(&one).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / size;
        Ok(Case::new("fault, t = 8 at once and in 17 steps").compare("difference", gap, 1e-8, Tolerance::AtMost))
    });
    vec![or_failed("fault, t = 8 at once and in 17 steps", made)]
}

fn too_few_iterations() -> Vec<Case> {
    let folder = examples().join("fault");
    let text = std::fs::read_to_string(folder.join("nitsche.wfl")).unwrap_or_default();
    let edits = small("steps t = 0 to 9.5 by 0.5 with halve=0");
    let tried = attempt(&folder, text + "solver newton with max_iter=1\n", &edits, &[]);
    let Some(solved) = tried.solved else { return vec![Case::failed("fault", tried.messages)] };
    let outcome = &solved.outcome;
    let failed = outcome.steps.iter().position(|s| !s.history.converged());
    vec![
        Case::new("fault, one iteration")
            .require(!outcome.converged(), "claims a solution")
            .require(failed == Some(outcome.steps.len() - 1), "goes on after a step that failed")
            .require(outcome.steps.last().is_some_and(|s| s.checks.is_empty()), "judges a state that is none"),
    ]
}

/// A folder of its own that goes at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("wfl-rows-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Runs the fault on a small mesh with results in a folder.
fn run_in(out: PathBuf, resume: bool, cells: &str, of: u64, progress: &mut dyn Progress) -> Result<Outcome, String> {
    let folder = examples().join("fault");
    let text = std::fs::read_to_string(folder.join("nitsche.wfl")).map_err(|e| e.to_string())?;
    let edits =
        [("cells [8, 8, 8]", format!("cells {cells}")), ("t = 0 to 9.5 by 0.5", "t = 0 to 3 by 0.5".to_owned())];
    let backend = JitBackend::new().map_err(|e| e.to_string())?;
    let scene = prepared(&folder, text, &edits, &[], &backend)?;
    let options = RunOptions {
        name: "row".to_owned(),
        out: Some(out),
        resume,
        texts: [("row.wfl", Hash::of(format!("{cells} {of}").as_bytes()))].into_iter().collect(),
        version: "1".to_owned(),
        ..RunOptions::without_files(2, std::time::Instant::now())
    };
    run(&scene, &options, progress).map_err(|e| e.to_string())
}

fn no_folder() -> Vec<Case> {
    let file = Folder::new("file");
    let made = std::fs::write(&file.0, "a file").is_ok();
    let result = run_in(file.0.join("results"), false, "[4,4,4]", 1, &mut Quiet);
    let message = result.as_ref().err().cloned().unwrap_or_default();
    let kept = std::fs::read(&file.0).is_ok_and(|bytes| bytes == b"a file");
    let _ = std::fs::remove_file(&file.0);
    vec![
        Case::new("a file stands where the folder should")
            .require(made && result.is_err(), "claims results")
            .require(message.contains(&file.0.display().to_string()), format!("does not name the folder: {message}"))
            .require(kept, "changes the file"),
    ]
}

/// Panics when a step has begun.
struct Stop(usize);

impl Progress for Stop {
    fn step(&mut self, number: usize, _count: Option<usize>, _time: f64) {
        assert!(number != self.0, "stopped on purpose");
    }
}

fn resumed() -> Vec<Case> {
    let mut cases = Vec::new();
    let whole = Folder::new("whole");
    let expected = run_in(whole.0.clone(), false, "[4,4,4]", 1, &mut Quiet);
    for at in [1, 4] {
        let what = format!("stopped in step {at}");
        let part = Folder::new(&format!("part{at}"));
        let stop = std::panic::catch_unwind(|| run_in(part.0.clone(), false, "[4,4,4]", 1, &mut Stop(at)));
        let again = run_in(part.0.clone(), true, "[4,4,4]", 1, &mut Quiet);
        let made = expected.as_ref().map_err(Clone::clone).and_then(|e| again.map(|a| (e, a)));
        cases.push(or_failed(
            &what,
            made.map(|(e, a)| {
                let last = |o: &Outcome| o.steps.last().map(|s: &StepResult| s.state.clone());
                Case::new(&what)
                    .require(stop.is_err(), "was not stopped")
                    .require(a.steps.len() == e.steps.len(), "has other steps")
                    .require(last(e) == last(&a), "ends with other numbers")
            }),
        ));
    }
    cases
}

fn wrong_checkpoint() -> Vec<Case> {
    let folder = Folder::new("checkpoint");
    let start = || {
        let _ = std::fs::remove_dir_all(&folder.0);
        std::panic::catch_unwind(|| run_in(folder.0.clone(), false, "[4,4,4]", 1, &mut Stop(2))).is_err()
    };
    let file = folder.0.join(wfl_run::CHECKPOINT_FILE);
    let refused = |what: &str, words: &str, ready: bool, result: Result<Outcome, String>| {
        let message = result.as_ref().err().cloned().unwrap_or_default();
        Case::new(what)
            .require(ready, "could not be made")
            .require(result.is_err(), "is taken")
            .require(message.contains(words), format!("does not say `{words}`: {message}"))
    };
    let ready = start() && std::fs::read(&file).is_ok_and(|b| std::fs::write(&file, &b[..b.len() / 2]).is_ok());
    let truncated = run_in(folder.0.clone(), true, "[4,4,4]", 1, &mut Quiet);
    let mut cases = vec![refused("truncated", "not a complete checkpoint", ready, truncated)];
    let ready = start();
    cases.push(refused(
        "of another text",
        "another content of `row.wfl`",
        ready,
        run_in(folder.0.clone(), true, "[4,4,4]", 2, &mut Quiet),
    ));
    let ready = start();
    cases.push(refused(
        "of another mesh",
        "another content of `row.wfl`",
        ready,
        run_in(folder.0.clone(), true, "[4,4,2]", 1, &mut Quiet),
    ));
    cases
}
