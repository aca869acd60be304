//! Conjugate gradients with multigrid, and factors with pivots of both signs, against other factors: the same measures, in
//! scenes of every kind that they serve.

use std::{path::Path, time::Instant};

use wfl::{NoFiles, SourceMap, resolve};
use wfl_discrete::pruning::Pruning;
use wfl_jit::JitBackend;
use wfl_problem::prepare_keeping;
use wfl_run::{Quiet, RunOptions, run};

/// Measures by name, and the solver in words.
fn measured(scene: &str, method: &str) -> (Vec<(String, f64)>, String) {
    found(format!("{scene}solver linear with {method}\n"), &[])
}

/// The same; `keep` is done although the scene does not need it.
fn found(text: String, keep: &[Pruning]) -> (Vec<(String, f64)>, String) {
    let mut sources = SourceMap::new();
    let main = sources.add("scene.wfl", text);
    let script = resolve(&mut sources, main, &mut NoFiles, &[]);
    assert!(script.diagnostics.is_empty(), "{:?}", script.diagnostics);
    let backend = JitBackend::new().expect("machine code");
    let made = prepare_keeping(&script.value.expect("a script"), Path::new("."), &backend, keep);
    let scene = made.scene.unwrap_or_else(|| panic!("{:?}", made.diagnostics));
    let outcome = run(&scene, &RunOptions::without_files(2, Instant::now()), &mut Quiet).expect("a run");
    assert!(outcome.converged());
    let solver = outcome.report.solver.clone().unwrap_or_default();
    (outcome.steps.last().expect("a step").measures.clone(), solver)
}

/// The measures of the iteration agree with those of a factor to `within` of their size. The solver in words.
fn agree(scene: &str, within: f64) -> String {
    let (direct, with_factor) = measured(scene, "direct");
    let (iterative, solver) = measured(scene, "cg, amg");
    assert!(!with_factor.contains("multigrid") && solver.contains("multigrid"), "{with_factor} / {solver}");
    assert!(!solver.contains("in place of"), "{solver}");
    assert!(solver.contains(", "), "more than one level: {solver}");
    for ((name, a), (_, b)) in direct.iter().zip(&iterative) {
        assert!((a - b).abs() <= within * a.abs(), "{name}: {a:e} with a factor, {b:e} by iteration ({solver})");
    }
    solver
}

/// A bar that is pulled and bent, of tetrahedra or hexahedra; `young` is its modulus.
fn bar(cells: &str, space: &str, young: &str, nu: &str) -> String {
    format!(
        "wfl 1\nparam nu = {nu} in 0..0.49999\ndef E = {young}\nmesh box [0,0,0] to [2,1,1] cells {cells}\n\
         region left = faces where x == 0\nregion right = faces where x == 2\nunknown u : vector {space}\n\
         def lambda = E*nu/((1+nu)*(1-2*nu))\ndef mu = E/(2*(1+nu))\n\
         term elastic on all : (lambda*Div_u*Id(3) + 2*mu*Sym(Grad_u)):Grad_Test_u\n\
         fix u = [0,0,0] on left\nload u = [1,0.5,0.2] on right\n\
         measure far = max(Norm(u)) on all\nmeasure mean = mean(u.u) on right\n\
         measure stretch = integral(Sym(Grad_u):Sym(Grad_u)) on all\n"
    )
}

#[test]
fn quadratic_and_linear_elements_on_all_cells() {
    for (cells, space) in [("[8,4,4] tet", "P2"), ("[16,8,8] tet", "P1"), ("[16,8,8] hex", "Q1"), ("[6,4,4] hex", "Q2")]
    {
        let solver = agree(&bar(cells, space, "1000", "0.3"), 1e-9);
        assert_eq!(solver.contains("without a matrix"), space.ends_with('2'), "{space}: {solver}");
    }
}

#[test]
fn stiffness_that_jumps_by_a_million() {
    agree(&bar("[8,4,4] tet", "P2", "1000*(1 + 999999*pos_part(sign((x-1)*(y-0.5))))", "0.3"), 1e-9);
}

#[test]
fn a_nearly_incompressible_body() {
    agree(&bar("[6,4,4] tet", "P2", "1000", "0.4999"), 1e-8);
}

#[test]
fn rollers_on_faces_that_are_not_along_axes() {
    let scene = "wfl 1\nparam a = 0.4\n\
        mesh box [0,0,0] to [2,1,1] cells [8,4,4] tet map [x*cos(a) - y*sin(a), x*sin(a) + y*cos(a), z]\n\
        region foot = faces where x*cos(a) + y*sin(a) == 0\nregion side = faces where y*cos(a) - x*sin(a) == 0\n\
        region floor = faces where z == 0\nregion head = faces where x*cos(a) + y*sin(a) == 2\n\
        unknown u : vector P2\nterm elastic on all : (300*Div_u*Id(3) + 800*Sym(Grad_u)):Grad_Test_u\n\
        fix u.Normal = 0 on foot, side, floor\nload u = [1,0.3,0] on head\n\
        measure far = max(Norm(u)) on all\nmeasure mean = mean(u.u) on head\n";
    agree(scene, 1e-9);
}

#[test]
fn a_scalar_field_and_a_plane_body() {
    let heat = "wfl 1\nmesh box [0,0,0] to [1,1,1] cells [14,14,14] hex\nregion cold = faces where x == 0\n\
        unknown T : scalar\nterm flow on all : (1 + 100*y)*Grad_T.Grad_Test_T\nfix T = 0 on cold\nload T = 1 on all\n\
        measure hottest = max(T) on all\nmeasure mean = mean(T) on all\n";
    agree(heat, 1e-9);
    let plane = "wfl 1\nmesh box [0,0] to [2,1] cells [60,30] quad\nregion left = faces where x == 0\n\
        region right = faces where x == 2\nunknown u : vector\n\
        term elastic on all : (300*Div_u*Id(2) + 800*Sym(Grad_u)):Grad_Test_u\nfix u = [0,0] on left\n\
        load u = [0,1] on right\nmeasure far = max(Norm(u)) on all\nmeasure mean = mean(u.u) on right\n";
    agree(plane, 1e-9);
}

#[test]
fn two_bodies_that_are_glued() {
    let scene = "wfl 1\nmesh box [0,0,0] to [2,1,1] cells [12,6,6] hex\nregion near = cells where x < 1\n\
        region far = cells where x > 1\nregion glue = interface from near to far\nregion left = faces where x == 0\n\
        region right = faces where x == 2\nunknown u : vector on near\nunknown v : vector on far\n\
        def sigma(w) = 300*Div_w*Id(3) + 800*Sym(Grad_w)\nterm here on near : sigma(u):Grad_Test_u\n\
        term there on far : sigma(v):Grad_Test_v\n\
        term tie on glue : 1e5*(u - Interpolate(v, neighbor_element)).(Test_u - Interpolate(Test_v, neighbor_element))\n\
        fix u = [0,0,0] on left\nload v = [1,1,0] on right\n\
        measure end = max(Norm(v)) on far\nmeasure mean = mean(u.u) on near\n";
    agree(scene, 1e-9);
}

/// The measures of LDLT agree with those of LU; `solver` is what the report says of it.
fn agrees_with_lu(scene: &str, solver: &str) {
    let (general, by_lu) = found(scene.to_owned(), &[Pruning::Symmetric]);
    let (symmetric, by_ldlt) = found(scene.to_owned(), &[]);
    assert!(by_lu.contains("(LU)") && by_ldlt.contains(solver), "{by_lu} / {by_ldlt}");
    for ((name, a), (_, b)) in general.iter().zip(&symmetric) {
        assert!((a - b).abs() <= 1e-10 * a.abs(), "{name}: {a:e} with LU, {b:e} with LDLT");
    }
}

const INDEFINITE: &str = "symmetric, not positive definite (LDLT)";
const SCALED: &str = "symmetric in scaled equations (LDLT)";

/// One symmetric term, or two of which none is; the sign of the balance of volume is a matter of taste.
#[test]
fn stokes_flow_by_pivots_of_both_signs() {
    let momentum = "2*Grad_v:Grad_Test_v - p*Div_Test_v";
    for (balance, solver) in [
        (" - Div_v*Test_p", INDEFINITE),
        ("\nterm continuity on all : -Div_v*Test_p", SCALED),
        ("\nterm continuity on all : Div_v*Test_p", SCALED),
    ] {
        let scene = format!(
            "wfl 1\nmesh box [0,0] to [2,1] cells [12,6] tri\nregion outlet = faces where x == 2\n\
             region walls = boundary - outlet\nunknown v : vector P2\nunknown p : scalar P1\n\
             term flow on all : {momentum}{balance}\nfix v = [sin(pi*y), 0] on walls\n\
             measure square = integral(v(1)^2) on all\nmeasure pressure = integral(p^2) on all\n"
        );
        agrees_with_lu(&scene, solver);
    }
}

/// Rock of Biot: the balance of fluid is divided by the time step.
#[test]
fn consolidation_by_pivots_of_both_signs() {
    let scene = "wfl 1\nuse \"poro\"\nuse \"elasticity\"\nmesh box [0,0] to [1,1] cells [6,6] quad\n\
        region top = faces where y == 1\nregion floor = faces where y == 0\nunknown u : vector Q2\nunknown p : scalar Q1\n\
        term momentum on all : sigma(u, 1000, 0.25):Grad_Test_u\n\
        term rock on all : biot(u, p, 1) + darcy(p, 1e-3) + storage(p, 1e-5)\nload u = [1,-10*x] on top\n\
        fix u = [0,0] on floor\nfix p = 0 on top\nscheme bdf2\nsteps t = 0 to 0.4 by 0.1\n\
        measure pressure = integral(p^2) on all\nmeasure sinks = integral(u.u) on top\n";
    agrees_with_lu(scene, SCALED);
}

/// A multiplier that ties two bodies, without friction and contact.
#[test]
fn multipliers_by_pivots_of_both_signs() {
    let scene = "wfl 1\nuse \"elasticity\"\nmesh box [0,0] to [2,1] cells [8,4] quad\nregion left = cells where x < 1\n\
        region right = cells where x > 1\nregion middle = interface from left to right\n\
        region foot = faces where x == 0\nregion head = faces where x == 2\nunknown a : vector Q1 on left\n\
        unknown b : vector Q1 on right\nmultiplier l : vector Q1 on middle\n\
        term left on left : sigma(a, 1000, 0.3):Grad_Test_a\nterm right on right : sigma(b, 500, 0.3):Grad_Test_b\n\
        term tie on middle : l.(Test_a - Interpolate(Test_b, neighbor_element)) + \
        (a - Interpolate(b, neighbor_element)).Test_l\nfix a = [0,0] on foot\nload b = [1,0.5] on head\n\
        measure far = integral(b.b) on head\nmeasure carried = integral(l.l) on middle\n";
    agrees_with_lu(scene, INDEFINITE);
}
