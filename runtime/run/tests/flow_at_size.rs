//! A flow with a pressure by GMRES with multigrid of the motion against factors: the same flow, and a number of iterations that does not
//! grow with the number of cells.

use std::{path::Path, time::Instant};

use wfl::{NoFiles, SourceMap, resolve};
use wfl_jit::JitBackend;
use wfl_linear::LinearSolver;
use wfl_problem::{Scene, prepare};
use wfl_run::{Outcome, Quiet, RunOptions, run};
use wfl_sparse::solve::{LinearMethod, SolverOptions};

/// Through a channel, with a viscosity that varies by 100 and a force that whirls.
fn channel(cells: usize, momentum: &str, linear: &str) -> String {
    format!(
        r#"wfl 1
mesh box [0,0,0] to [2,1,1] cells [{}, {cells}, {cells}] tet
region outlet = faces where x == 2
region walls  = boundary - outlet
unknown v : vector P2
unknown p : scalar P1
def mu = 0.1*100^(0.5*x)
term momentum on all : mu*Grad_v:Grad_Test_v - p*Div_Test_v - 10*[z, x*y, -x].Test_v {momentum}
term continuity on all : -Div_v*Test_p
fix v = [16*y*(1-y)*z*(1-z), 0, 0] on walls
measure flow = mean(v(1)) on outlet
measure pressure = mean(p) on all
measure power = integral(mu*Grad_v:Grad_v) on all
solver linear with {linear}
"#,
        2 * cells
    )
}

fn prepared(text: &str) -> (Option<Scene>, Vec<wfl::Diagnostic>) {
    let mut sources = SourceMap::new();
    let main = sources.add("scene.wfl", text.to_owned());
    let script = resolve(&mut sources, main, &mut NoFiles, &[]);
    let backend = JitBackend::new().expect("machine code");
    let made = prepare(&script.value.expect("a script"), Path::new("."), &backend);
    (made.scene, made.diagnostics)
}

fn outcome(text: &str, threads: usize) -> Outcome {
    let scene = prepared(text).0.expect("a scene");
    let outcome = run(&scene, &RunOptions::without_files(threads, Instant::now()), &mut Quiet).expect("a run");
    assert!(outcome.converged());
    outcome
}

fn solver(outcome: &Outcome) -> String {
    outcome.report.solver.clone().unwrap_or_default()
}

fn measures(outcome: &Outcome) -> Vec<f64> {
    outcome.steps.iter().flat_map(|step| step.measures.iter().map(|(_, value)| *value)).collect()
}

fn iterations(outcome: &Outcome) -> usize {
    outcome.steps.iter().flat_map(|step| &step.history.solves).map(|solve| solve.krylov_iterations).sum()
}

#[test]
fn a_flow_is_that_of_a_factor() {
    let [direct, iteration] = ["direct", "gmres, amg"].map(|linear| outcome(&channel(4, "", linear), 2));
    assert!(solver(&direct).contains("LDLT"), "{}", solver(&direct));
    let told = solver(&iteration);
    assert!(
        told.starts_with("one linear system, of a motion with a field beside it: GMRES with multigrid of the motion"),
        "{told}"
    );
    assert!(!told.contains("in place of"), "{told}");
    for (a, b) in measures(&direct).iter().zip(measures(&iteration)) {
        assert!((a - b).abs() <= 1e-9 * a.abs(), "{a:e} and {b:e}");
    }
}

/// A field with fluxes of its own, which drives the motion and is not driven by it: the matrix is not symmetric.
#[test]
fn the_temperature_of_a_body_is_that_of_a_factor() {
    let of = |linear: &str| {
        let text = format!(
            "wfl 1\nmesh box [0,0,0] to [1,1,1] cells [6,6,6] hex\nregion low = faces where z == 0\n\
             region top = faces where z == 1\nunknown u : vector\nunknown T : scalar\n\
             term heat on all : (1 + x)*Grad_T.Grad_Test_T - 4*y*Test_T\n\
             term body on all : (100*Sym(Grad_u) + (50*Div_u - 3*T)*Id(3)):Grad_Test_u\nfix u = [0,0,0] on low\n\
             fix T = 0 on low\nfix T = 1 on top\nmeasure up = mean(u(3)) on top\nmeasure warm = mean(T) on all\n\
             solver linear with {linear}\n"
        );
        outcome(&text, 2)
    };
    let (direct, iteration) = (of("direct"), of("gmres, amg"));
    assert!(solver(&iteration).contains("GMRES with multigrid of the motion (unknowns"), "{}", solver(&iteration));
    for (a, b) in measures(&direct).iter().zip(measures(&iteration)) {
        assert!(*a > 1e-3 && (a - b).abs() <= 1e-9 * a, "{a:e} and {b:e}");
    }
}

#[test]
fn it_is_told_before() {
    let scene = prepared(&channel(3, "", "gmres, amg")).0.expect("a scene");
    let plan = |method| {
        let options = SolverOptions { method, ..SolverOptions::default() };
        LinearSolver::plan(&scene.system, &options).to_string()
    };
    let told = plan(LinearMethod::Iterative);
    assert!(
        told.starts_with("one linear system, of a motion with a field beside it: GMRES with multigrid of the motion"),
        "{told}"
    );
    // it is small
    assert!(plan(LinearMethod::Auto).contains("LDLT"), "{}", plan(LinearMethod::Auto));
}

#[test]
fn the_number_of_iterations_does_not_grow_with_the_number_of_cells() {
    let [coarse, fine] = [3, 6].map(|cells| iterations(&outcome(&channel(cells, "", "gmres, amg"), 2)));
    // three solutions of some 80 iterations, to twelve digits each
    assert!(10 * fine <= 13 * coarse && fine <= 280, "{coarse} and {fine}");
}

#[test]
fn a_flow_has_the_same_bits_for_any_number_of_threads() {
    let of = |threads| {
        let outcome = outcome(&channel(3, "", "gmres, amg"), threads);
        measures(&outcome).iter().map(|value| value.to_bits()).collect::<Vec<_>>()
    };
    let one = of(1);
    assert!([2, 3].iter().all(|threads| of(*threads) == one));
}

/// A reaction that drives the flow takes its positive energy: there are no levels.
#[test]
fn a_motion_without_levels_gets_a_factor_and_is_told_so() {
    let told = solver(&outcome(&channel(3, "- 500*v.Test_v", "gmres, amg"), 2));
    let why = "a factor in place of GMRES with multigrid: no levels of multigrid: the part of the motion is not positive definite";
    assert!(told.contains(why), "{told}");
}

/// Winds, inertia of the flow and a viscosity that follows from its slope: levels are those of the symmetric part.
#[test]
fn convection_and_viscosities_that_change_are_those_of_a_factor() {
    let terms = [
        ("+ 5*(Grad_v*[1,0.5,0]).Test_v", "one linear system"),
        ("+ 5*(Grad_v*v).Test_v", "Newton; whole tangent"),
        ("+ 0.01*(Grad_v:Grad_v)*(Grad_v:Grad_Test_v)", "Newton; whole tangent"),
    ];
    for (term, systems) in terms {
        let [direct, iteration] = ["direct", "gmres, amg"].map(|linear| outcome(&channel(4, term, linear), 2));
        let told = solver(&iteration);
        assert!(
            told.starts_with(&format!("{systems}, of a motion with a field beside it: GMRES with multigrid")),
            "{told}"
        );
        assert!(!told.contains("in place of"), "{term}: {told}");
        for (a, b) in measures(&direct).iter().zip(measures(&iteration)) {
            assert!((a - b).abs() <= 1e-9 * a.abs(), "{term}: {a:e} and {b:e}");
        }
        let count = |of: &Outcome| of.steps.iter().map(|step| step.history.iterations.len()).sum::<usize>();
        assert!(count(&iteration) <= count(&direct) + 1, "{term}: {} and {}", count(&iteration), count(&direct));
    }
}

#[test]
fn iterations_of_a_flow_with_inertia_do_not_grow_with_the_number_of_cells() {
    let flow = |cells| outcome(&channel(cells, "+ 5*(Grad_v*v).Test_v", "gmres, amg"), 2);
    let [coarse, fine] = [3, 6].map(|cells| iterations(&flow(cells)));
    assert!(10 * fine <= 13 * coarse && fine <= 500, "{coarse} and {fine}");
}

/// A body whose pores let more through the further they are open, in three steps.
#[test]
fn a_body_with_pores_that_open_is_that_of_a_factor() {
    let of = |linear: &str| {
        let text = format!(
            "wfl 1\nmesh box [0,0,0] to [1,1,1] cells [4,4,4] tet\nregion low = faces where z == 0\n\
             region top = faces where z == 1\nunknown u : vector P2\nunknown p : scalar P1\n\
             steps t = 0.1 to 0.3 by 0.1\ndef open = 1 + 0.5*p + 2*Div_u\n\
             term body on all : (2*Sym(Grad_u) + (Div_u - p)*Id(3)):Grad_Test_u\n\
             term storage on all : -(Rate(Div_u) + 0.1*Rate(p))*Test_p - open*Grad_p.Grad_Test_p\n\
             load u = [0,0,-0.2] on top\nfix u = [0,0,0] on low\nfix p = 0 on top\n\
             measure down = mean(u(3)) on top\nmeasure pressure = mean(p) on low\nsolver linear with {linear}\n"
        );
        outcome(&text, 2)
    };
    let (direct, iteration) = (of("direct"), of("gmres, amg"));
    let told = solver(&iteration);
    assert!(told.starts_with("Newton; whole tangent, of a motion with a field beside it: GMRES"), "{told}");
    assert!(!told.contains("in place of"), "{told}");
    // behind the start, where nothing has moved
    for (a, b) in measures(&direct).iter().zip(measures(&iteration)).skip(2) {
        assert!(a.abs() > 1e-4 && (a - b).abs() <= 1e-9 * a.abs(), "{a:e} and {b:e}");
    }
}

#[test]
fn what_stands_against_it_is_told() {
    let text = channel(3, "", "gmres, amg");
    let (momentum, end) = (text.find("term momentum").expect("a term"), text.find("fix v").expect("a condition"));
    let without = format!("{}term momentum on all : Grad_v:Grad_Test_v\n{}", &text[..momentum], &text[end..]);
    let without = without.replace("unknown p : scalar P1\n", "").replace("measure pressure = mean(p) on all\n", "");
    let (_, diagnostics) = prepared(&without.replace("mu*Grad_v:Grad_v", "Grad_v:Grad_v"));
    let told = diagnostics.iter().find(|d| d.code == wfl::Code::E442).expect("E442");
    let wanted =
        "`gmres` cannot be used here: the scene is linear, and there is no motion with a scalar field beside it";
    assert!(told.message.contains(wanted), "{}", told.message);
}
