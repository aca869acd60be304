//! Equations that are one term: what it gives at nodes is the residual itself, and no measure of it.

use super::run;

/// Fluid on a fault that leaks into the blocks, as one term and as two: the kink of its storage is never reached, so that the
/// equations are linear, and one iteration solves a step.
#[test]
fn leak_off_as_one_term_is_that_as_two() {
    let scene = |flow: &str| {
        format!(
            "mesh box [0,0] to [1,1] cells [4,4] quad\nregion lower = cells where y < 0.5\nregion upper = cells where y > 0.5\n\
             region f = interface from lower to upper\nunknown T : scalar\nunknown pf : scalar on f\nstart T = x\nstart pf = 0.3\n\
             term a on all : Dot_T*Test_T + 0.3*Grad_T.Grad_Test_T\n{flow}\nsteps t = 0 to 1 by 0.1\n\
             measure p = max(pf) on f\nmeasure m = integral(T) on all\n"
        )
    };
    let storage = "Rate(pf + max(pf, 0.1))*Test_pf";
    let rest = "0.1*Grad_pf.Grad_Test_pf + (pf - T)*Test_pf + (T - pf)*Test_T";
    let one = run("leak-one", &scene(&format!("term b on f : {storage} + {rest}")), &[]);
    let two = run("leak-two", &scene(&format!("term b on f : {storage}\nterm c on f : {rest}")), &[]);
    for ran in [&one, &two] {
        ran.assert_silent();
        assert!(ran.text.contains(" 10 iterations"), "{}", ran.text);
    }
    for measure in ["p", "m"] {
        assert!((one.last(measure) / two.last(measure) - 1.0).abs() < 1e-12, "{measure}");
    }
}

/// A block that falls with inertia, stress and a soft floor in one term.
#[test]
fn a_block_of_one_term_falls_as_one_of_three() {
    let scene = |terms: &str| {
        format!(
            "mesh box [0,0] to [1,1] cells [4,4] quad\nunknown u : vector\n{terms}\nstart Dot_u = [0,-1]\nsteps t = 0 to 0.2 by 0.01\n\
             measure M = mean(u(2)) on all\n"
        )
    };
    let parts = ["Dot2_u.Test_u", "100*Sym(Grad_u):Sym(Grad_Test_u)", "-50*pos_part(-u(2) - 0.01)*Test_u(2)"];
    let one = run("fall-one", &scene(&format!("term a on all : {}", parts.join(" + "))), &[]);
    let terms: Vec<String> = parts.iter().enumerate().map(|(k, part)| format!("term a{k} on all : {part}")).collect();
    let three = run("fall-three", &scene(&terms.join("\n")), &[]);
    one.assert_silent();
    assert!(one.text.contains(" 21 iterations"), "{}", one.text);
    assert!((one.last("M") / three.last("M") - 1.0).abs() < 1e-10);
}

/// A wall at 293 with a conductivity that follows the temperature, at rest until heat flows in; and a block that has been moved as it is.
/// What is left of the law at rest is rounding, of which no part hides another.
#[test]
fn a_law_at_rest_far_from_zero_is_solved_and_silent() {
    let wall = "mesh box [0,0] to [1,1] cells [5,5] quad\nregion left = faces where x == 0\nregion right = faces where x == 1\nunknown T : scalar\n\
                start T = 293.15\nterm law on all : (1 + 0.01*T)*Grad_T.Grad_Test_T\nterm inflow on left : -100*t*Test_T\n\
                fix T = 293.15 on right\nsteps t = 0 to 1 by 0.25\nmeasure M = max(T) on all\n";
    let block = "mesh box [0,0] to [1,1] cells [5,5] quad\nregion floor = faces where y == 0\nunknown u : vector\nstart u = [1e-3,1e-3]\n\
                 term law on all : 100*(1 + Norm_sqr(Sym(Grad_u)))*Sym(Grad_u):Grad_Test_u + 50*pos_part(-u(2))*Test_u(2)*(-1)\n\
                 fix u = [1e-3 + 1e-6*t,1e-3] on floor\nsteps t = 0 to 1 by 0.5\nmeasure M = max(u(2)) on all\n";
    for (name, scene) in [("rest-wall", wall), ("rest-block", block)] {
        let ran = run(name, scene, &[]);
        ran.assert_silent();
        let taken = ran.text.split(" iterations").next().and_then(|t| t.rsplit(' ').next()?.parse::<usize>().ok());
        assert!(taken.is_some_and(|taken| taken < 20), "{}", ran.text);
    }
}

/// Flow behind a grid (Kovasznay 1948), the pressure held at one node: what holds it takes the rounding of all cells, and is no
/// force that a residual is relative to. Newton's method takes 7 iterations.
#[test]
fn a_pressure_that_is_held_at_one_node_keeps_no_step_open() {
    let scene = "param Re = 40\nparam lam = Re/2 - sqrt(Re^2/4 + 4*pi^2)\nmesh box [-0.5,-0.5] to [1,1.5] cells [12,12] tri\n\
                 unknown u : vector P2\nunknown p : scalar P1\ndef exact = [1 - exp(lam*x)*cos(2*pi*y), lam/(2*pi)*exp(lam*x)*sin(2*pi*y)]\n\
                 term momentum on all : 1/Re*Grad_u:Grad_Test_u + (Grad_u*u).Test_u - p*Div_Test_u\n\
                 term mass on all : -Div_u*Test_p\nregion corner = nodes where x == -0.5 and y == -0.5\nfix u = exact on boundary\n\
                 fix p = 0.5*(1 - exp(2*lam*x)) on corner\nmeasure error = sqrt(integral(Norm_sqr(u - exact))) on all\n";
    let ran = run("kovasznay", scene, &[]);
    assert_eq!(ran.code, 0, "{}", ran.text);
    assert!(ran.text.contains(" 7 iterations") && ran.last("error") < 0.008, "{}", ran.text);
}

/// A step without a solution between steps that have one: no tangent on the way is the scene's own, and the run goes on.
#[test]
fn a_step_without_a_solution_is_left_behind() {
    let scene = "mesh box [0] to [1] cells [1] segment with idle_cells=allowed\nunknown r : scalar global\nstart r = 1\n\
                 term b on global : (r*r - 1 + 2*(if t > 0.45 and t < 0.75 then 1 else 0))*Test_r\n\
                 steps t = 0 to 1 by 0.1 with on_fail=go_on, halve=2\nmeasure R = value(r) at [0]\n";
    let ran = run("no-solution", scene, &[]);
    assert_eq!(ran.code, 2, "{}", ran.text);
    assert!(ran.text.contains("8 of 11 steps converged") && !ran.tells("E602"), "{}", ran.text);
    assert!((ran.last("R") - 1.0).abs() < 1e-12);
}
