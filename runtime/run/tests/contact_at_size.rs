//! GMRES with multigrid and a filter on the contact against factors: the same iterations of Newton and the same measures on
//! the fault.

use std::{path::Path, time::Instant};

use wfl::{NoFiles, SourceMap, resolve};
use wfl_jit::JitBackend;
use wfl_problem::{Scene, prepare};
use wfl_run::{Outcome, Quiet, RunOptions, run};

const FAULT: &str = include_str!("../../../examples/fault/fault.wfl");
const PENALTY: &str = include_str!("../../../examples/fault/penalty.wfl");
const NITSCHE: &str = include_str!("../../../examples/fault/nitsche.wfl");
const AUGMENTED: &str = include_str!("../../../examples/fault/augmented_lagrangian.wfl");
const SLIDING: &str = include_str!("../../../benches/compare/scenes/sliding.wfl");

/// The fault in one text with four steps, a method of contact with what is replaced in it, and a linear solver; without files.
fn fault(cells: usize, method: &str, edits: &[(&str, &str)], linear: &str) -> String {
    let body = method.replace("use \"fault.wfl\"\n", "").replace("wfl 1\n", "");
    let whole =
        FAULT.replace("to 9.5 by 0.5", "to 9 by 3").replace("[8, 8, 8]", &format!("[{cells}, {cells}, {cells}]"));
    let text = edits.iter().fold(format!("{whole}{body}"), |text, (old, new)| {
        assert!(text.contains(old), "{old}");
        text.replace(old, new)
    });
    let kept: Vec<&str> = text.lines().filter(|line| !line.starts_with("output")).collect();
    format!("{}\nsolver linear with {linear}\n", kept.join("\n"))
}

fn prepared(text: &str) -> Scene {
    let mut sources = SourceMap::new();
    let main = sources.add("scene.wfl", text.to_owned());
    let script = resolve(&mut sources, main, &mut NoFiles, &[]);
    let backend = JitBackend::new().expect("machine code");
    let made = prepare(&script.value.expect("a script"), Path::new("."), &backend);
    made.scene.unwrap_or_else(|| panic!("{:?}", made.diagnostics))
}

fn outcome(text: &str, threads: usize) -> Outcome {
    let outcome = run(&prepared(text), &RunOptions::without_files(threads, Instant::now()), &mut Quiet).expect("a run");
    assert!(outcome.converged());
    outcome
}

/// The solver in words, and Newton's iterations and measures by step.
fn told(outcome: &Outcome) -> (String, Vec<usize>, Vec<Vec<f64>>) {
    let iterations = |step: &wfl_run::StepResult| step.history.iterations.last().map_or(0, |last| last.number);
    let values = |step: &wfl_run::StepResult| step.measures.iter().map(|(_, value)| *value).collect();
    (
        outcome.report.solver.clone().unwrap_or_default(),
        outcome.steps.iter().map(iterations).collect(),
        outcome.steps.iter().map(values).collect(),
    )
}

/// The fault with the iteration has the iterations of Newton and the measures that it has with factors.
fn agrees(cells: usize, method: &str, edits: &[(&str, &str)]) {
    let with = |linear: &str| told(&outcome(&fault(cells, method, edits, linear), 2));
    let (factor, iteration) = (with("direct"), with("gmres, amg"));
    assert!(!factor.0.contains("GMRES") && iteration.0.contains("GMRES"), "{} / {}", factor.0, iteration.0);
    assert!(!iteration.0.contains("in place of"), "{}", iteration.0);
    assert_eq!(factor.1, iteration.1, "{edits:?}: {}", iteration.0);
    for measure in 0..factor.2[0].len() {
        let largest = factor.2.iter().fold(0.0f64, |largest, step| largest.max(step[measure].abs()));
        let forces = factor.2.iter().fold(0.0f64, |largest, step| largest.max(step[0].abs()));
        // a sum that is zero but for what cancels in it is compared with the force
        let size = if largest < 1e-9 * forces { forces } else { largest };
        for (a, b) in factor.2.iter().zip(&iteration.2) {
            let missed = (a[measure] - b[measure]).abs();
            assert!(missed <= 1e-9 * size, "{edits:?}, measure {measure}: {:e} and {:e}", a[measure], b[measure]);
        }
    }
}

#[test]
fn penalty_has_the_iterations_and_measures_of_factors() {
    agrees(8, PENALTY, &[]);
}

#[test]
fn the_incomplete_and_the_skew_symmetric_variant_of_nitsche_have_them() {
    for theta in ["0 ", "-1"] {
        agrees(8, NITSCHE, &[("theta = 0 ", &format!("theta = {theta}"))]);
    }
}

/// Its stress term takes so much from the bodies that they, and the levels with contact, are not positive definite.
#[test]
fn the_symmetric_variant_gets_a_factor_and_is_told_so() {
    let (solver, ..) = told(&outcome(&fault(8, NITSCHE, &[("theta = 0 ", "theta = 1 ")], "gmres, amg"), 2));
    assert!(solver.contains("a factor in place of GMRES with multigrid: no levels of multigrid"), "{solver}");
}

#[test]
fn augmented_lagrangians_have_them() {
    agrees(8, AUGMENTED, &[]);
}

#[cfg(not(debug_assertions))]
#[test]
fn finer_faults_have_them() {
    agrees(16, PENALTY, &[]);
    agrees(16, AUGMENTED, &[]);
    for (theta, gamma) in [("0 ", "1e5"), ("-1", "1e5"), ("0 ", "5e6")] {
        agrees(
            16,
            NITSCHE,
            &[("theta = 0 ", &format!("theta = {theta}")), ("gamma = 1e5", &format!("gamma = {gamma}"))],
        );
    }
}

/// Iterations of GMRES for a solution.
#[cfg(not(debug_assertions))]
fn iterations_a_solution(cells: usize, method: &str, edits: &[(&str, &str)]) -> f64 {
    let (solver, ..) = told(&outcome(&fault(cells, method, edits, "gmres, amg"), 2));
    let counted: Vec<f64> = solver
        .rsplit("; ")
        .next()
        .map_or(Vec::new(), |counts| counts.split(' ').filter_map(|word| word.parse().ok()).collect());
    let [iterations, solutions] = counted[..] else { panic!("{solver}") };
    iterations / solutions
}

/// Levels know the augmentation and not the multipliers, so augmented Lagrangians grow most.
#[cfg(not(debug_assertions))]
#[test]
fn the_number_of_iterations_hardly_grows_on_finer_faults() {
    let (incomplete, skew) = ([("theta = 0 ", "theta = 0 ")], [("theta = 0 ", "theta = -1")]);
    let methods: [(&str, &[(&str, &str)], f64); 4] =
        [(NITSCHE, &incomplete, 1.3), (NITSCHE, &skew, 1.3), (PENALTY, &[], 1.3), (AUGMENTED, &[], 1.35)];
    for (method, edits, growth) in methods {
        let [coarse, fine] = [12, 24].map(|cells| iterations_a_solution(cells, method, edits));
        assert!(fine <= growth * coarse && fine <= 12.5, "{edits:?}: {coarse:.1} and {fine:.1}");
    }
}

/// A neo-Hookean block that is pressed on a floor and pulled along it in three steps.
fn hyperelastic(cells: usize, contact: &str, linear: &str) -> String {
    format!(
        r#"wfl 1
param gamma = 2e4
param fric  = 0.3
mesh box [0,0,0] to [1,1,1] cells [{cells},{cells},{cells}] hex
region floor = faces where z == 0
region lid   = faces where z == 1
unknown u : vector
steps t = 1 to 3 by 1
def F  = Id(3) + Grad_u
def P  = 80*(F - Inv(F)') + 120*log(Det(F))*Inv(F)'
def tang(w) = w - (w.Normal)*Normal
term elastic on all : P:Grad_Test_u
{contact}
fix u = [0.02*(t - 1), 0, -0.05*t] on lid
measure force = integral((P*[0,0,1]).[0,0,1]) on lid
measure drag  = integral((P*[0,0,1]).[1,0,0]) on lid
measure slid  = mean(u(1)) on floor
solver linear with {linear}
"#
    )
}

const OF_NITSCHE: &str = "def Pn = gamma*(u.Normal) - (P*Normal).Normal\n\
    def Pt = gamma*tang(u) - tang(P*Normal)\n\
    term contact on floor : (pos_part(Pn)*Normal + Ball_projection(Pt, fric*pos_part(Pn))).Test_u";
const OF_PENALTY: &str = "def Pn = gamma*(u.Normal)\n\
    term contact on floor : (pos_part(Pn)*Normal + Ball_projection(gamma*tang(u), fric*pos_part(Pn))).Test_u";
const OF_MULTIPLIERS: &str = "multiplier l : vector on floor\n\
    def Pn = l.Normal + 1e3*u.Normal\n\
    def Pt = tang(l) + 1e3*tang(u)\n\
    def force = pos_part(Pn)*Normal + Ball_projection(Pt, fric*pos_part(Pn))\n\
    term contact on floor : force.Test_u + (force - l).Test_l/1e3";

/// Bodies that are not linear, with contact that is not symmetric: of the tangents at hand, with levels of their bodies.
#[test]
fn hyperelastic_bodies_with_friction_have_the_iterations_and_measures_of_factors() {
    for contact in [OF_NITSCHE, OF_PENALTY, OF_MULTIPLIERS] {
        let with = |linear: &str| told(&outcome(&hyperelastic(5, contact, linear), 2));
        let (factor, iteration) = (with("direct"), with("gmres, amg"));
        assert!(!factor.0.contains("GMRES with multigrid"), "{}", factor.0);
        assert!(iteration.0.starts_with("Newton; whole tangent: GMRES with multigrid"), "{}", iteration.0);
        assert!(!iteration.0.contains("in place of"), "{}", iteration.0);
        assert_eq!(factor.1, iteration.1, "{contact}: {}", iteration.0);
        for (a, b) in factor.2.iter().flatten().zip(iteration.2.iter().flatten()) {
            assert!((a - b).abs() <= 1e-9 * a.abs().max(1.0), "{contact}: {a:e} and {b:e}");
        }
    }
}

/// Bodies that slide over each other, of finite and of small strain: in each step images come to other faces.
fn sliding(is_linear: bool, linear: &str) -> String {
    let law = SLIDING.lines().find(|line| line.starts_with("def P(g)")).expect("a law");
    let text = SLIDING.replace("param n = 8", "param n = 4");
    let text = if is_linear { text.replace(law, "def P(g) = 0.8*Sym(g) + 0.5*Trace(g)*Id(3)") } else { text };
    format!("{text}solver linear with {linear}\n")
}

#[test]
fn bodies_that_slide_have_the_iterations_and_measures_of_factors() {
    for is_linear in [false, true] {
        let with = |linear: &str| told(&outcome(&sliding(is_linear, linear), 2));
        let (factor, iteration) = (with("direct"), with("gmres, amg"));
        assert!(!factor.0.contains("GMRES with multigrid"), "{}", factor.0);
        assert!(iteration.0.starts_with("Newton; whole tangent: GMRES with multigrid"), "{}", iteration.0);
        assert!(!iteration.0.contains("in place of"), "{}", iteration.0);
        assert_eq!(factor.1, iteration.1, "{}", iteration.0);
        for (a, b) in factor.2.iter().flatten().zip(iteration.2.iter().flatten()) {
            assert!((a - b).abs() <= 1e-9 * a.abs().max(1e-2), "{a:e} and {b:e}");
        }
    }
}

/// Their direct solution is on the dofs that images touch, not on all that they may touch.
#[test]
fn of_bodies_that_slide_few_unknowns_are_solved_for_directly() {
    let on_contact = |text: &str| -> usize {
        let (_, behind) = text.split_once("a direct solution on the ").expect("GMRES");
        behind.split(' ').next().and_then(|n| n.parse().ok()).expect("a number")
    };
    let text = sliding(false, "gmres, amg");
    let method = wfl_sparse::solve::LinearMethod::Iterative;
    let options = wfl_sparse::solve::SolverOptions { method, ..wfl_sparse::solve::SolverOptions::default() };
    let foreseen = on_contact(&wfl_linear::LinearSolver::plan(&prepared(&text).system, &options).to_string());
    let solver = told(&outcome(&text, 2)).0;
    assert!(on_contact(&solver) < foreseen, "{foreseen}: {solver}");
    let bits = |threads: usize| {
        let outcome = outcome(&text, threads);
        outcome.steps.iter().flat_map(|step| step.measures.iter().map(|(_, v)| v.to_bits())).collect::<Vec<_>>()
    };
    assert!(bits(1) == bits(3), "the same bits for any number of threads");
}

#[test]
fn gmres_on_tangents_is_told_before() {
    let scene = prepared(&hyperelastic(4, OF_NITSCHE, "gmres, amg"));
    let of = |method| wfl_sparse::solve::SolverOptions { method, ..wfl_sparse::solve::SolverOptions::default() };
    let plan = |method| wfl_linear::LinearSolver::plan(&scene.system, &of(method)).to_string();
    let told = plan(wfl_sparse::solve::LinearMethod::Iterative);
    assert!(told.starts_with("Newton; whole tangent: GMRES with multigrid, then a direct solution on the"), "{told}");
    let told = plan(wfl_sparse::solve::LinearMethod::Auto);
    assert!(told.contains("LU"), "it is small: {told}");
}

#[test]
fn so_have_they_the_same_bits_for_any_number_of_threads() {
    let of = |threads: usize| {
        let outcome = outcome(&hyperelastic(5, OF_NITSCHE, "gmres, amg"), threads);
        outcome.steps.iter().flat_map(|step| step.measures.iter().map(|(_, v)| v.to_bits())).collect::<Vec<_>>()
    };
    let one = of(1);
    assert!([2, 3].iter().all(|threads| of(*threads) == one));
}

#[test]
fn results_have_the_same_bits_for_any_number_of_threads() {
    let text = fault(8, NITSCHE, &[("to 9 by 3", "to 6 by 3")], "gmres, amg");
    let of = |threads: usize| {
        let outcome = outcome(&text, threads);
        outcome.steps.iter().flat_map(|step| step.measures.iter().map(|(_, v)| v.to_bits())).collect::<Vec<_>>()
    };
    let one = of(1);
    assert!([2, 3].iter().all(|threads| of(*threads) == one));
}

#[test]
fn a_small_scene_never_meets_it() {
    let text = fault(8, NITSCHE, &[], "gmres, amg").replace("solver linear with gmres, amg\n", "");
    let scene = prepared(&text);
    let options = wfl_sparse::solve::SolverOptions::default();
    let plan = wfl_linear::LinearSolver::plan(&scene.system, &options).to_string();
    assert!(plan.contains("factored once (LLT)"), "{plan}");
}

/// Forces of a body that are those of no energy.
#[test]
fn where_it_cannot_be_used_the_message_says_why() {
    let forces = "sigma(uL):Grad_Test_uL + uL(1)*uL(2)*Test_uL(3)";
    let text = fault(4, NITSCHE, &[("sigma(uL):Grad_Test_uL", forces)], "gmres, amg");
    let mut sources = SourceMap::new();
    let main = sources.add("scene.wfl", text);
    let script = resolve(&mut sources, main, &mut NoFiles, &[]).value.expect("a script");
    let made = prepare(&script, Path::new("."), &JitBackend::new().expect("machine code"));
    let told = made.diagnostics.iter().find(|d| d.code == wfl::Code::E442).expect("E442");
    let wanted = "`gmres` cannot be used here: the term `elastic on left` is not symmetric";
    assert!(told.message.contains(wanted), "{}", told.message);
}
