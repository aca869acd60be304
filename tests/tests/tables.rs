//! `table("file.csv", t)`: values and slopes, the bits of both backends, corners that steps meet, values outside.

use std::{path::PathBuf, sync::Arc, time::Instant};

use wfl::{Curve, SourceId, Span, Table};
use wfl_compiler::{
    Dd, InterpreterBackend, Real,
    backend::KernelBackend,
    lookup::{Reading, read},
};
use wfl_jit::JitBackend;
use wfl_problem::Scene;
use wfl_run::{Outcome, Quiet, RunOptions, run};
use wfl_tests::{Sequence, attempt, prepared};

/// A folder with one file, which goes with the test.
struct Folder(PathBuf);

impl Folder {
    fn with(name: &str, csv: &str) -> Self {
        let path = std::env::temp_dir().join(format!("wfl-tables-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).expect("a temporary folder");
        std::fs::write(path.join("k.csv"), csv).expect("a temporary file");
        Self(path)
    }

    fn scene(&self, text: &str, backend: &dyn KernelBackend) -> Scene {
        prepared(&self.0, text.to_owned(), &[], &[], backend).unwrap_or_else(|e| panic!("{e}"))
    }

    fn outcome(&self, text: &str) -> Outcome {
        self.outcome_of(text, &JitBackend::new().expect("machine code on this processor"))
    }

    fn outcome_of(&self, text: &str, backend: &dyn KernelBackend) -> Outcome {
        let options = RunOptions { keep_states: true, ..RunOptions::without_files(1, Instant::now()) };
        let outcome = run(&self.scene(text, backend), &options, &mut Quiet).expect("a run");
        assert!(outcome.converged());
        outcome
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// One unknown number `u`, and what stands behind it.
fn one_number(rest: &str) -> String {
    format!("wfl 1\nmesh box [0] to [1] cells [1] segment\nunknown u : scalar\nmeasure m = max(u) on all\n{rest}")
}

fn times(outcome: &Outcome) -> Vec<f64> {
    outcome.steps.iter().map(|s| s.window.end).collect()
}

fn values(outcome: &Outcome, measure: &str) -> Vec<f64> {
    let of = |list: &[(String, f64)]| list.iter().find(|m| m.0 == measure).expect("a measure").1;
    outcome.steps.iter().map(|s| of(&s.measures)).collect()
}

#[test]
fn slopes_agree_with_differences_in_extended_precision() {
    let mut random = Sequence(7);
    let mut at = -3.0;
    let mut text = String::new();
    for _ in 0..40 {
        at += 1.1 + random.number();
        text += &format!("{at:?},{:?}\n", random.number());
    }
    let span = Span { source: SourceId::new(0), start: 0, end: 0 };
    let table = Table::parse("k.csv", text.into(), span).expect("a table");
    let curve: &Arc<Curve> = table.curve(None).expect("one column");
    let h = Dd::from_f64(2f64.powi(-40));
    for pair in curve.arguments.windows(2) {
        let x = Dd::from_f64(pair[0] + (0.5 + 0.49 * random.number()) * (pair[1] - pair[0]));
        let of = |x: Dd| read(curve, Reading::Value, x);
        let difference = Real::div(Real::sub(of(Real::add(x, h)), of(Real::sub(x, h))), Real::add(h, h)).to_f64();
        let slope = read(curve, Reading::Slope, x.to_f64());
        assert!((difference - slope).abs() <= 1e-15 * slope.abs().max(1.0), "{difference} {slope}");
    }
}

/// A load, a prescribed value and data over the step variable; the argument may be any expression of it.
#[test]
fn values_over_the_steps_are_those_of_the_rows() {
    let folder = Folder::with("values", "t,q,r\n0,0,5\n1,2,4\n3,1,4\n4,-3,0\n");
    let text = one_number(
        "data d : scalar = table(\"k.csv\", t, \"r\")\ndef q = table(\"k.csv\", t, \"q\")\n\
         term balance on all : u*Test_u\nload u = q on all\nmeasure dm = max(d) on all\n\
         measure back = integral(table(\"k.csv\", 4 - t, \"r\")) on all\nsteps t = 0 to 4 by 0.5\n",
    );
    let outcome = folder.outcome(&text);
    let rows = [0.0, 1.0, 2.0, 1.75, 1.5, 1.25, 1.0, -1.0, -3.0];
    let others = [5.0, 4.5, 4.0, 4.0, 4.0, 4.0, 4.0, 2.0, 0.0];
    for (k, (q, r)) in rows.iter().zip(&others).enumerate() {
        let close = |name: &str, x: f64| (values(&outcome, name)[k] - x).abs() < 1e-14;
        assert!(close("m", *q) && close("dm", *r) && close("back", others[8 - k]), "step {k}");
    }
}

/// A law of a material: Newton's method finds the argument whose value is given, across corners.
#[test]
fn a_curve_of_an_unknown_is_solved_with_its_slope() {
    let folder = Folder::with("curve", "strain,stress\n-1,-1\n0,0\n0.1,1\n0.5,1.4\n2,1.7\n");
    let text = one_number(
        "term balance on all : (table(\"k.csv\", u) - t)*Test_u\n\
         measure slope = max(Diff(table(\"k.csv\", u), u, 1)) on all\nsteps t = 0.25 to 1.65 by 0.1\n",
    );
    let outcome = folder.outcome(&text);
    for (step, (u, slope)) in outcome.steps.iter().zip(values(&outcome, "m").iter().zip(values(&outcome, "slope"))) {
        let (expected, k) = match step.window.end {
            t if t < 1.0 => (0.1 * t, 10.0),
            t if t < 1.4 => (0.1 + (t - 1.0), 1.0),
            t => (0.5 + 5.0 * (t - 1.4), 0.2),
        };
        assert!((u - expected).abs() < 1e-12, "{u} at {}", step.window.end);
        assert!((slope - k).abs() < 1e-12, "{slope} at {}", step.window.end);
        assert!(step.history.iterations.len() <= 6, "{} iterations", step.history.iterations.len());
    }
}

/// At a row the slope is that of the piece that begins there, at the last one that of the last piece.
#[test]
fn slopes_at_the_rows_follow_the_convention() {
    let folder = Folder::with("corners", "0,0\n1,2\n2,3\n4,0\n");
    let text = one_number(
        "term balance on all : (u - t)*Test_u\nmeasure slope = max(Diff(table(\"k.csv\", u), u, 1)) on all\n\
         fix u = t on all\nsteps t = 0 to 4 by 0.5\n",
    );
    let outcome = folder.outcome(&text);
    let expected = [2.0, 2.0, 1.0, 1.0, -1.5, -1.5, -1.5, -1.5, -1.5];
    for (found, expected) in values(&outcome, "slope").iter().zip(expected) {
        assert!((found - expected).abs() < 1e-14, "{found} {expected}");
    }
}

#[test]
fn interpreter_and_machine_code_have_the_same_bits() {
    let folder = Folder::with("bits", "s,f,g\n-0.3,0.7,0\n0.1,0.11,1\n0.7,-1.3,3\n1.3,0.017,-2\n");
    let text = "wfl 1\nmesh box [0,0] to [1,1] cells [3,3] tri\nunknown u : vector\nregion west = faces where x == 0\n\
        def k(v) = 2 + 0.1*table(\"k.csv\", Norm_sqr(v) + 0.1*x, \"f\")\n\
        energy e on all : k(u)*Norm_sqr(Grad_u)\n\
        load u = [table(\"k.csv\", t, \"g\"),table(\"k.csv\", x*y, \"f\")] on all\nfix u = [0,0] on west\n\
        measure a = integral(u(1)) on all\nmeasure b = integral(table(\"k.csv\", u(2) + 0.2, \"g\")) on all\n\
        steps t = 0 to 1.3 by 0.13\n";
    let machine = folder.outcome(text);
    let other = folder.outcome_of(text, &InterpreterBackend);
    assert_eq!(machine.steps.len(), other.steps.len());
    for (a, b) in machine.steps.iter().zip(&other.steps) {
        let bits = |s: &[f64]| s.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&a.state), bits(&b.state), "t = {}", a.window.end);
        assert!(a.state.iter().any(|x| *x != 0.0));
        let measured = |list: &[(String, f64)]| list.iter().map(|m| m.1.to_bits()).collect::<Vec<_>>();
        assert_eq!(measured(&a.measures), measured(&b.measures));
    }
}

const CORNERS: &str = "t,q\n0,0\n0.3,0.3\n1.1,1.1\n1.7,-2\n2.9,-2\n4,1\n";

/// u' = q(t): the integral of the rows.
fn integrated(steps: &str) -> String {
    one_number(&format!("term balance on all : (Dot_u - table(\"k.csv\", t))*Test_u\n{steps}\n"))
}

/// The integral of `CORNERS`, exact.
fn integral(t: f64) -> f64 {
    let rows = [(0.0, 0.0), (1.1, 1.1), (1.7, -2.0), (2.9, -2.0), (4.0, 1.0)];
    let piece = |w: &[(f64, f64)]| {
        let (a, b) = (w[0], w[1]);
        let end = t.clamp(a.0, b.0);
        let q = a.1 + (b.1 - a.1) * (end - a.0) / (b.0 - a.0);
        0.5 * (a.1 + q) * (end - a.0)
    };
    rows.windows(2).map(piece).sum()
}

#[test]
fn steps_that_the_run_chooses_end_at_the_corners_and_keep_their_error() {
    let folder = Folder::with("auto", CORNERS);
    let (mut found, mut of_bdf3) = (Vec::new(), Vec::new());
    let schemes = [("scheme backward_euler", &["1e-3", "1e-4", "1e-5"][..]), ("", &["1e-3", "1e-5"][..])];
    for (scheme, error) in schemes.into_iter().flat_map(|(s, errors)| errors.iter().map(move |e| (s, e))) {
        let steps = format!("steps t = 0 to 4 by auto with first=1e-3, error={error}\n{scheme}");
        let outcome = folder.outcome(&integrated(&steps));
        let times = times(&outcome);
        // the row at 0.3 lies on the line between its neighbours
        for corner in [1.1, 1.7, 2.9, 4.0] {
            assert!(times.contains(&corner), "{corner} is not met: {times:?}");
        }
        let missed = times.iter().zip(values(&outcome, "m")).map(|(t, u)| (u - integral(*t)).abs());
        let list = if scheme.is_empty() { &mut of_bdf3 } else { &mut found };
        list.push((missed.fold(0.0, f64::max), times.len()));
    }
    // BDF2 and BDF3 integrate a line exactly; the first steps behind the start and the corners are of backward Euler, each with an
    // error of half the slope times the square of `first`
    let slopes = 1.0 + 3.1 / 0.6 + 3.0 / 1.1;
    assert!(of_bdf3.iter().all(|(missed, _)| *missed < 2.0 * 0.5 * slopes * 1e-6), "{of_bdf3:?}");
    for (e, pair) in [1e-3f64, 1e-4].iter().zip(found.windows(2)) {
        assert!(pair[1].0 < 0.5 * pair[0].0 && pair[0].0 < 3.0 * e.sqrt(), "{found:?}");
    }
}

/// Corners of an argument that is no more than an expression of the step variable.
#[test]
fn corners_of_other_arguments_are_met_to_rounding() {
    let folder = Folder::with("argument", CORNERS);
    let text = |argument: &str| {
        integrated("steps t = 0 to 2 by auto with first=1e-3, error=1e-2")
            .replace("\"k.csv\", t", &format!("\"k.csv\", {argument}"))
    };
    let expected: [(&str, &[f64]); 3] = [
        ("2*t", &[0.55, 0.85, 1.45]),
        ("4 - 2*t", &[0.55, 1.15, 1.45]),
        ("t*t", &[1.048_808_848_170_151_6, 1.303_840_481_040_529_8, 1.702_938_636_592_640_2]),
    ];
    for (argument, corners) in expected {
        let times = times(&folder.outcome(&text(argument)));
        for corner in corners {
            assert!(times.iter().any(|t| (t - corner).abs() < 1e-15 * 4.0), "{argument}: {corner} in {times:?}");
        }
    }
    // listed steps are those of the scene
    let listed = times(&folder.outcome(&integrated("steps t = 0 to 4 by 1")));
    assert_eq!(listed, [0.0, 1.0, 2.0, 3.0, 4.0]);
}

#[test]
fn values_outside_are_told_before_the_run_or_by_the_step_that_meets_them() {
    let folder = Folder::with("outside", "0,0\n1,2\n");
    let told = |text: &str| attempt(&folder.0, one_number(text), &[], &[]).messages;
    let load = |argument: &str, steps: &str| {
        format!("term balance on all : u*Test_u\nload u = table(\"k.csv\", {argument}) on all\n{steps}\n")
    };
    let before = told(&load("t", "steps t = 0 to 2 by 0.25"));
    assert!(before.contains("error[E447]: the table \"k.csv\" has no row at t = 1.25"), "{before}");
    assert!(before.contains("this is 1.25; the rows go from 0 to 1") && before.contains("min(t, 1)"), "{before}");
    let early = told(&load("2*t - 1", "steps t = 0 to 1 by auto"));
    assert!(early.contains("error[E447]") && early.contains("this is -1; the rows go from 0 to 1"), "{early}");
    let constant = told(&load("3", ""));
    assert!(constant.contains("error[E447]: 3 is outside the rows of \"k.csv\""), "{constant}");
    for held in ["min(t, 1)", "t/2", "max(0, 1 - t)"] {
        let text = told(&load(held, "steps t = 0 to 2 by 0.25"));
        assert!(!text.contains("E447"), "{held}: {text}");
    }
    // a branch that is not taken has no value
    let guarded =
        "term balance on all : (u - (if t <= 1 then table(\"k.csv\", t) else 2))*Test_u\nsteps t = 0 to 2 by 0.5\n";
    assert_eq!(told(guarded), "");
}
