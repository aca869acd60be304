//! A run that does not give up: steps in parts, and what is said of them.

use wfl_checks::Others;
use wfl_newton::Method;
use wfl_run::{AttemptEnd, Path};
use wfl_tests::{Solved, attempt, doubts, examples, solve};

/// exp(d) - 1 = load: a Newton step from 0 goes to d = load, and only about 1 back in each iteration, so that large
/// increments need more iterations than `most`.
fn exponential(steps: &str, load: &str, most: usize) -> Solved {
    let text = format!(
        "mesh box [0] to [1] cells [1] segment\nunknown d : scalar global\n{steps}\n\
         term law on global : (exp(d) - 1 - {load})*Test_d\nsolver newton with max_iter={most}, search=none\n\
         measure reached = mean(d) on all\n"
    );
    solve(&examples(), text, &[], &[]).expect("the scene is right")
}

#[test]
fn a_step_too_large_is_solved_in_parts_and_ends_where_it_was_asked_to() {
    let solved = exponential("steps t = 0 to 3 by 1", "100*t", 9);
    assert!(solved.outcome.converged());
    for (k, t) in [0.0, 1.0, 2.0, 3.0f64].into_iter().enumerate() {
        let step = &solved.outcome.steps[k];
        assert_eq!(step.window.end.to_bits(), t.to_bits());
        let exact = (100.0 * t).ln_1p();
        assert!((solved.measure(k, "reached") - exact).abs() < 1e-9, "t = {t}: {}", solved.measure(k, "reached"));
    }
    let attempts = &solved.outcome.steps[1].attempts;
    assert!(attempts.iter().all(|a| a.path == Path::Steps));
    assert_eq!(attempts[0].part, (0.0, 1.0));
    assert_eq!(attempts[0].end, AttemptEnd::NotConverged);
    // each converged part starts where the one before ended; the last ends the step; some are larger than the first
    let parts: Vec<(f64, f64)> = attempts.iter().filter(|a| a.end == AttemptEnd::Converged).map(|a| a.part).collect();
    assert!(parts.windows(2).all(|w| w[0].1 == w[1].0), "{parts:?}");
    assert_eq!((parts[0].0, parts[parts.len() - 1].1), (0.0, 1.0));
    let size = |p: &(f64, f64)| p.1 - p.0;
    assert!(parts.iter().any(|p| size(p) > size(&parts[0])), "the increment grows back: {parts:?}");
}

#[test]
fn without_halving_the_same_step_fails_and_says_so() {
    let solved = exponential("steps t = 0 to 3 by 1 with halve=0", "100*t", 9);
    assert!(!solved.outcome.converged());
    assert_eq!(solved.outcome.steps.len(), 2, "the run stops at the step that failed");
    assert!(solved.outcome.steps[1].parts().is_empty());
}

#[test]
fn the_load_of_a_first_step_grows_in_parts() {
    let solved = exponential("", "100", 9);
    assert!(solved.outcome.converged());
    assert!((solved.measure(0, "reached") - 100f64.ln_1p()).abs() < 1e-9);
    assert!(solved.outcome.steps[0].attempts.iter().all(|a| a.path == Path::Load));
    assert!(!solved.outcome.steps[0].parts().is_empty());
}

/// A spring with exp(d) - 1 and a damper: each part is an implicit Euler step with its own increment, so the end of
/// a step in n equal parts is that of n steps.
#[test]
fn rates_see_the_increments_of_the_parts() {
    let text = |steps: &str, most: usize| {
        format!(
            "mesh box [0] to [1] cells [1] segment\nunknown d : scalar global\nsteps t = 0 to 1 by {steps}\n\
             term law on global : (Dot_d + exp(d) - 1 - 100*t)*Test_d\n\
             solver newton with max_iter={most}, search=none\nmeasure reached = mean(d) on all\n"
        )
    };
    let run = |steps, most| solve(&examples(), text(steps, most), &[], &[]).expect("the scene is right");
    let cut = run("1", 9);
    assert!(cut.outcome.converged());
    let attempts = &cut.outcome.steps[1].attempts;
    let mut d = 0.0f64;
    let mut at = 0.0;
    for part in attempts.iter().filter(|a| a.end == AttemptEnd::Converged).map(|a| a.part) {
        let (dt, t) = (part.1 - part.0, part.1);
        assert_eq!(part.0, at);
        at = part.1;
        // backward Euler by bisection: increasing in the new value
        let old = d;
        let (mut low, mut high) = (old - 1.0, old + 200.0);
        for _ in 0..200 {
            let x: f64 = 0.5 * (low + high);
            if (x - old) / dt + x.exp() - 1.0 - 100.0 * t > 0.0 { high = x } else { low = x }
        }
        d = 0.5 * (low + high);
    }
    assert!(attempts.len() > 2);
    assert!((cut.measure(1, "reached") - d).abs() < 1e-9, "{} against {d}", cut.measure(1, "reached"));
}

/// -div(|grad u|^2 grad u) = 1 has no tangent at u = 0. On a segment of length 1 fixed at both ends the flux is 1/2 - x,
/// so linear elements have the slope (1/2 - x)^(1/3) of their middles; the largest point is that of the 32nd element.
#[test]
fn a_scene_that_is_singular_at_rest_starts_elsewhere_and_says_so() {
    let text = "mesh box [0] to [1] cells [64] segment\nunknown u : scalar P1\n\
                term law on all : Norm_sqr(Grad_u)*(Grad_u.Grad_Test_u) - Test_u\nfix u = 0 on boundary\n\
                measure middle = max(u) on all\n";
    let solved = solve(&examples(), text.to_owned(), &[], &[]).expect("the scene is right");
    assert!(solved.outcome.converged());
    let rise = |e: u32| (0.5 - (f64::from(e) + 0.5) / 64.0).cbrt() / 64.0;
    let exact = (0..31).map(rise).sum::<f64>() + 0.5 * rise(31);
    assert!((solved.measure(0, "middle") / exact - 1.0).abs() < 1e-9, "{} {exact}", solved.measure(0, "middle"));
    assert!(doubts(&solved.outcome).iter().any(|(code, _)| *code == "W607"), "{:?}", doubts(&solved.outcome));
}

/// A failed attempt to assemble a tangent (an infinite slope at rest) must not be taken for a measure of rounding.
#[test]
fn an_infinite_slope_at_rest_is_not_taken_for_convergence() {
    let text = "mesh box [0,0] to [1,1] cells [2,2] tri\nunknown u : scalar P1\n\
                term law on all : (sqrt(u) + u - 0.5)*Test_u + 0.1*Grad_u.Grad_Test_u\n\
                measure largest = max(u) on all\n";
    let solved = solve(&examples(), text.to_owned(), &[], &[]).expect("the scene is right");
    assert!(solved.outcome.converged());
    // sqrt(u) + u = 1/2
    let exact = ((3f64.sqrt() - 1.0) / 2.0).powi(2);
    assert!((solved.measure(0, "largest") - exact).abs() < 1e-12, "{}", solved.measure(0, "largest"));
}

/// A block on rigid ground that only friction holds, pushed to 11/12 of the limit of sliding: nearly all of the ground
/// slips, and iterates in which all of it does have no tangent. Forces by equilibrium.
#[test]
fn a_body_that_friction_alone_holds_converges_close_to_sliding() {
    let text = "param gamma = 3.2e5\nparam fric = 0.4\nmesh box [0,0] to [2,1] cells [32,16] tri\n\
         region ground = faces where y == 0\nregion top = faces where y == 1\nregion back = faces where x == 0\n\
         unknown u : vector P1\ndef sigma(v) = 1153.8*Div_v*Id(2) + 1538.5*Sym(Grad_v)\n\
         def tang(w) = w - (w.Normal)*Normal\ndef trac(v) = sigma(v)*Normal\n\
         def Pn = gamma*(u.Normal) - trac(u).Normal\ndef Pt = gamma*tang(u) - tang(trac(u))\n\
         def force = pos_part(Pn)*Normal + Ball_projection(Pt, fric*pos_part(Pn))\n\
         term elastic on all : sigma(u):Grad_Test_u\nterm contact on ground : force.Test_u\n\
         load u = [8,-30] on top\nload u = [6,0] on back\n\
         measure Fn = integral(pos_part(Pn)) on ground\nmeasure Ft = integral(tang(force).[1,0]) on ground\n";
    for (fric, gamma) in [(0.4, 3.2e5), (0.4, 3.2e8), (1.5, 3.2e8)] {
        let params = [("gamma", gamma), ("fric", fric)];
        let solved = solve(&examples(), text.to_owned(), &[], &params).expect("the scene is right");
        assert!(solved.outcome.converged(), "{params:?}");
        assert!((solved.measure(0, "Fn") / 60.0 - 1.0).abs() < 1e-8, "{params:?}");
        assert!((solved.measure(0, "Ft") / 22.0 - 1.0).abs() < 1e-8, "{params:?}");
        let iterations = solved.outcome.steps[0].history.n_iterations();
        assert!(iterations <= 20, "{params:?}: {iterations}");
    }
}

/// A plane fault inclined by `slope` = tan(angle) in a plate 2 `w` wide, loaded obliquely; penalty at the nodes.
fn inclined(slope: f64, w: f64, cells: [u32; 2], load: &str, steps: &str, force: &str) -> String {
    let [nx, ny] = cells;
    format!(
        "param gamma = 1e9\nparam fric = 0.4\n\
         mesh box [-{w},0] to [{w},4] cells [{nx},{ny}] quad map [x + (y-2)*{slope}*(1-abs(x)/{w}), y]\n\
         region left = cells where x < (y-2)*{slope}\nregion right = cells where x > (y-2)*{slope}\n\
         region fault = interface from left to right\nregion bottom = faces where y == 0\n\
         region west = faces where x == -{w}\nregion east = faces where x == {w}\n\
         region top = faces of right where y == 4\n\
         unknown uL : vector on left\nunknown uR : vector on right\n\
         def sigma(v) = 10000*Div_v*Id(2) + 20000*Sym(Grad_v)\ndef trac(v) = sigma(v)*Normal\n\
         def jump(a,b) = a - Interpolate(b, neighbor_element)\ndef tang(v) = v - (v.Normal)*Normal\n\
         term a on left : sigma(uL):Grad_Test_uL\nterm b on right : sigma(uR):Grad_Test_uR\n\
         fix uL, uR = [0,0] on bottom\nfix uL(1) = 0 on west\nload uR = [-3,0] on east\n\
         load uR = {load} on top\n{steps}\nquadrature on fault vertex\n{force}\
         def force = pos_part(Pn)*Normal + Ball_projection(Pt, fric*pos_part(Pn))\n\
         measure Fn = integral(force.Normal) on fault\nmeasure Ft = integral(Norm(tang(force))) on fault\n\
         measure slip = max(Norm(tang(jump(uL,uR)))) on fault\n"
    )
}

const PENALTY: &str = "def Pn = gamma*(jump(uL,uR).Normal)\ndef Pt = gamma*tang(jump(uL,uR))\n\
    term contact on fault : force.jump(Test_uL,Test_uR)\n";
const AUGMENTED: &str = "multiplier lam : vector on fault\n\
    def Pn = gamma*(jump(uL,uR).Normal) - lam.Normal\ndef Pt = gamma*tang(jump(uL,uR)) - tang(lam)\n\
    term contact on fault : force.jump(Test_uL,Test_uR)\nterm law on fault : -1/gamma*(lam + force).Test_lam\n";
const NITSCHE: &str = "def Pn = gamma*(jump(uL,uR).Normal) - trac(uL).Normal\n\
    def Pt = gamma*tang(jump(uL,uR)) - tang(trac(uL))\nterm contact on fault : force.jump(Test_uL,Test_uR)\n";

/// Faults that open at one end and slip at the other. Reference: own program in Python (same elements and nodal rule,
/// dense elimination, every combination of open, slip and stick checked at each node), written apart from this one.
#[test]
fn inclined_faults_with_stiff_contact_agree_with_an_independent_program() {
    for (slope, w, cells, load, steps, gamma, step, expected) in [
        (
            0.36397,
            2.0,
            [12, 16],
            "[0.7*t,-t]",
            "steps t = 0 to 9.5 by 0.5",
            7.5e8,
            10,
            [2.12297780541, 0.805224028302, 0.000398148011542],
        ),
        (
            0.176327,
            1.0,
            [8, 16],
            "[-0.5*t,-t]",
            "steps t = 0 to 6 by 1",
            1e9,
            6,
            [11.6467326467, 3.64637404484, 0.0002199714918],
        ),
    ] {
        for (method, tolerance) in [(PENALTY, 1e-8), (AUGMENTED, 1e-4), (NITSCHE, 2e-2)] {
            let text = inclined(slope, w, cells, load, steps, method);
            let solved = solve(&examples(), text, &[], &[("gamma", gamma)]).expect("the scene is right");
            assert!(solved.outcome.converged(), "{slope} {method}");
            for (name, value) in ["Fn", "Ft", "slip"].into_iter().zip(expected) {
                let found = solved.measure(step, name);
                assert!((found / value - 1.0).abs() < tolerance, "{slope} {method}: {name} {found} against {value}");
            }
            let counts: Vec<usize> = solved.outcome.steps.iter().map(|s| s.history.n_iterations()).collect();
            assert!(solved.outcome.steps.iter().all(|s| s.parts().is_empty()), "{counts:?}");
            // friction of 0.4 leaves one state
            assert!(solved.outcome.steps.iter().all(|s| s.others == Others::Unknown), "{method}");
            assert!(counts[0] <= 10 && counts[1..].iter().sum::<usize>() <= 12 * (counts.len() - 1), "{counts:?}");
        }
    }
}

/// With a friction coefficient of 5, tangents on two sides of a kink differ in the sign of their determinant, and a
/// search for a smaller defect may end between them. Reference: the program above.
#[test]
fn large_friction_on_a_fault_that_opens_is_solved_in_whole_steps() {
    let expected = [
        (3, [1.62774670789, 1.27997209471, 9.68093794003e-5]),
        (4, [0.856060362101, 0.751137605612, 0.000282928869469]),
        (5, [0.365951450784, 0.674181824099, 0.000520798388846]),
    ];
    for (method, tolerance) in [(PENALTY, 1e-8), (AUGMENTED, 1e-3)] {
        let text = inclined(0.57735, 3.0, [12, 10], "[0.7*t,-t]", "steps t = 0 to 7 by 1", method);
        let params = [("gamma", 1e8), ("fric", 5.0)];
        let solved = solve(&examples(), text, &[], &params).expect("the scene is right");
        let counts: Vec<usize> = solved.outcome.steps.iter().map(|s| s.history.n_iterations()).collect();
        assert!(solved.outcome.converged() && counts.iter().all(|n| *n <= 60), "{method}: {counts:?}");
        assert!(solved.outcome.steps.iter().all(|s| s.parts().is_empty()), "{method}");
        assert!(doubts(&solved.outcome).iter().any(|(code, _)| *code == "W609"), "{:?}", doubts(&solved.outcome));
        let most = solved.outcome.steps.iter().map(|s| s.others).max();
        assert!(most >= Some(Others::Possible), "no tangent on the way had the other sign");
        for (step, values) in expected {
            for (name, value) in ["Fn", "Ft", "slip"].into_iter().zip(values) {
                let found = solved.measure(step, name);
                assert!((found / value - 1.0).abs() < tolerance, "{method}: {name} {found} against {value}");
            }
        }
    }
}

/// With more friction a path is needed, and turns round on its way: that is told.
#[test]
fn a_path_that_turns_round_is_told() {
    let text = inclined(0.57735, 3.0, [12, 10], "[0.7*t,-t]", "steps t = 0 to 7 by 1", PENALTY);
    let solved = solve(&examples(), text, &[], &[("gamma", 1e8), ("fric", 9.0)]).expect("the scene is right");
    assert!(solved.outcome.converged());
    assert!(solved.outcome.steps.iter().any(|s| s.history.turns > 0), "no path turned round");
    assert!(doubts(&solved.outcome).iter().any(|(code, _)| *code == "W609"), "{:?}", doubts(&solved.outcome));
}

/// Where the points are the nodes of a plane interface the law of a multiplier holds at each of them, and no parameter of
/// the augmentation is seen in the result; the faces of a bent interface share nodes with other normals: there it holds on
/// the average, what slides depends on the parameter, and that is told.
#[test]
fn a_result_that_depends_on_the_augmentation_is_warned_of() {
    let run = |bend: f64, gamma: f64| {
        let text = inclined(0.2, 1.0, [8, 8], "[0,-t]", "steps t = 1 to 1 by 1", AUGMENTED);
        let text = text.replace("(y-2)*0.2", &format!("{bend:?}*sin(pi*y/4)"));
        solve(&examples(), text, &[], &[("gamma", gamma)]).expect("the scene is right")
    };
    let told = |solved: &wfl_tests::Solved| {
        let of_the_law = |w: &&(&'static str, String)| w.0 == "W606" && w.1.starts_with("law of `lam` at the points");
        doubts(&solved.outcome).iter().filter(of_the_law).count()
    };
    for (bend, bent) in [(0.0, false), (0.2, true)] {
        let (soft, stiff) = (run(bend, 1e4), run(bend, 1e7));
        assert!(soft.outcome.converged() && stiff.outcome.converged());
        let change = (soft.measure(0, "slip") / stiff.measure(0, "slip") - 1.0).abs();
        assert!(if bent { change > 0.02 } else { change < 1e-8 }, "bend {bend}: slip changes by {change:e}");
        assert_eq!([told(&soft), told(&stiff)], [usize::from(bent); 2], "{:?}", doubts(&soft.outcome));
    }
}

/// Volumes that hardly change make the nodal stiffness thousands of times what a body gives way with to a traction: the
/// choice of pieces must not take one for the other. A penalty and an augmented Lagrangian with the rule of the nodes
/// hold the same conditions, and 1/gamma of compliance is what is between them.
#[test]
fn nearly_incompressible_faults_need_no_more_iterations_than_others() {
    // nu = 0.4999, E = 25000
    let locked = |force: &str, element: &str| {
        let text = inclined(0.36397, 2.0, [8, 12], "[0.5*t,-t]", "steps t = 0 to 9 by 1", force);
        let text = text.replace("10000*Div", "41661110*Div").replace("20000*Sym", "16667.8*Sym");
        text.replace("vector on", &format!("vector {element} on"))
    };
    for element in ["Q1", "Q2"] {
        let run = |force: &str, gamma: f64| {
            let solved =
                solve(&examples(), locked(force, element), &[], &[("gamma", gamma)]).expect("the scene is right");
            assert!(solved.outcome.converged(), "{element} {force}");
            let counts: Vec<usize> = solved.outcome.steps.iter().map(|s| s.history.n_iterations()).collect();
            assert!(solved.outcome.steps.iter().all(|s| s.parts().is_empty()), "{counts:?}");
            (solved, counts)
        };
        let (stiff, _) = run(PENALTY, 1e10);
        for gamma in [5e2, 5e4] {
            let (solved, counts) = run(AUGMENTED, gamma);
            assert!(counts[0] <= 16 && counts[1..].iter().sum::<usize>() <= 9 * 12, "{element} {gamma}: {counts:?}");
            for (step, name) in (0..10).flat_map(|k| ["Fn", "Ft", "slip"].map(|n| (k, n))) {
                let (a, b) = (solved.measure(step, name), stiff.measure(step, name));
                assert!(
                    (a - b).abs() <= 2e-3 * stiff.measure(9, name).abs(),
                    "{element} {gamma}, {name}: {a} against {b}"
                );
            }
        }
    }
}

/// Laws |grad u|^(p-2) grad u: the flux on a segment is 1/2 - x as above, the slope its power 1/(p - 1). A full Newton
/// step goes 1/(p - 1) of the way: for large p many are needed, for p near 1 they must be shortened.
#[test]
fn p_laplacians_converge_from_rest() {
    for (p, most) in [(1.2, 30), (1.5, 20), (3.0, 20), (8.0, 20)] {
        let text = format!(
            "param p = {p:?}\nmesh box [0] to [1] cells [64] segment\nunknown u : scalar P1\n\
             term law on all : pow(Norm_sqr(Grad_u), (p-2)/2)*(Grad_u.Grad_Test_u) - Test_u\nfix u = 0 on boundary\n\
             measure middle = max(u) on all\n"
        );
        let solved = solve(&examples(), text, &[], &[]).expect("the scene is right");
        assert!(solved.outcome.converged(), "p = {p}");
        let rise = |e: u32| (0.5 - (f64::from(e) + 0.5) / 64.0).powf(1.0 / (p - 1.0)) / 64.0;
        let exact = (0..31).map(rise).sum::<f64>() + 0.5 * rise(31);
        let found = solved.measure(0, "middle");
        assert!((found / exact - 1.0).abs() < 1e-8, "p = {p}: {found} against {exact}");
        let iterations = solved.outcome.steps[0].history.n_iterations();
        assert!(iterations <= most, "p = {p}: {iterations}");
    }
}

/// A strip whose lid is moved: u, and with it the gradient, is proportional to the motion of the lid, the flux to its
/// power p - 1. The start of a step has heard of the motion, so that nothing is left to do but the first time.
#[test]
fn bodies_follow_what_is_prescribed() {
    for p in [1.5, 4.0, 8.0f64] {
        let text = format!(
            "param p = {p:?}\nmesh box [0,0] to [2,1] cells [8,4] quad map [x, y*(1 + 0.2*x)]\nregion floor = faces where y == 0\n\
             region lid = boundary - floor - (faces where x == 0 or x == 2)\nunknown u : scalar\nsteps t = 0.25 to 1 by 0.25\n\
             term law on all : pow(Norm_sqr(Grad_u), (p-2)/2)*(Grad_u.Grad_Test_u)\n\
             fix u = 0 on floor\nfix u = t on lid\nmeasure flux = integral(pow(Norm_sqr(Grad_u), p/2)) on all\n"
        );
        let solved = solve(&examples(), text, &[], &[]).expect("the scene is right");
        assert!(solved.outcome.converged(), "p = {p}");
        for (k, t) in [0.25, 0.5, 0.75f64].into_iter().enumerate() {
            let (part, exact) = (solved.measure(k, "flux") / solved.measure(3, "flux"), t.powf(p));
            assert!((part / exact - 1.0).abs() < 1e-8, "p = {p}, t = {t}: {part} against {exact}");
        }
        let counts: Vec<usize> = solved.outcome.steps.iter().map(|s| s.history.n_iterations()).collect();
        assert!(counts[1..].iter().all(|n| *n <= 3), "p = {p}: {counts:?}");
    }
}

/// A wedge pushed into a corner between floor and wall, on both of which it may stick.
fn corner(multiplier: bool) -> String {
    let law = |tag: &str, place: &str| {
        let traction = if multiplier { format!(" - m_{tag}") } else { String::new() };
        let own = if multiplier {
            format!(
                "multiplier m_{tag} : vector on {place}\nquadrature on {place} vertex\n\
                 term law_{tag} on {place} : -1/gamma*(m_{tag} + force_{tag}).Test_m_{tag}\n"
            )
        } else {
            String::new()
        };
        format!(
            "def pull_{tag} = gamma*u{traction}\n\
             def force_{tag} = pos_part(pull_{tag}.Normal)*Normal + Ball_projection(pull_{tag} - (pull_{tag}.Normal)*Normal, \
             fric*pos_part(pull_{tag}.Normal))\n{own}term contact_{tag} on {place} : force_{tag}.Test_u\n\
             measure x_{tag} = integral(force_{tag}.[1,0]) on {place}\nmeasure y_{tag} = integral(force_{tag}.[0,1]) on {place}\n"
        )
    };
    format!(
        "param E = 2000\nparam nu = 0.3\nparam fric = 1.2\nparam gamma = 3e4\n\
         mesh box [0,0] to [1,1] cells [8,8] tri map [x, y*(1.05-x)]\nregion ground = faces where y == 0\n\
         region wall = faces where x == 0\nregion slope = boundary - ground - wall\nunknown u : vector P1\n\
         def lambda = E*nu/((1+nu)*(1-2*nu))\ndef mu = E/(2*(1+nu))\n\
         term elastic on all : (lambda*Div_u*Id(2) + 2*mu*Sym(Grad_u)):Grad_Test_u\n\
         load u = [-3-2*t,-10-20*t] on slope\nsteps t = 0 to 1 by 0.25\n{}{}",
        law("g", "ground"),
        law("w", "wall")
    )
}

/// Two multipliers hold the node in the corner; the second is left out there. The forces are those of the loads on the
/// slope, and those of a stiff penalty.
#[test]
fn multipliers_that_meet_in_a_corner_are_no_singular_system() {
    // the slope from (0, 1.05) to (1, 0.05) and the right end from there down to the ground
    let length = 2f64.sqrt() + 0.05;
    let tried = attempt(&examples(), corner(true), &[], &[]);
    assert!(tried.messages.contains("W404") && tried.messages.contains("1 node of `m_w`"), "{}", tried.messages);
    let stiff = solve(&examples(), corner(false), &[], &[("gamma", 1e10)]).expect("the scene is right");
    let solved = tried.solved.expect("the scene is right");
    for solved in [&solved, &stiff] {
        assert!(solved.outcome.converged());
        for (k, t) in [0.0, 0.25, 0.5, 0.75, 1.0].into_iter().enumerate() {
            let sum = |a: &str, b: &str| solved.measure(k, a) + solved.measure(k, b);
            let (x, y) = (sum("x_g", "x_w"), sum("y_g", "y_w"));
            let (loads_x, loads_y) = ((-3.0 - 2.0 * t) * length, (-10.0 - 20.0 * t) * length);
            assert!((x - loads_x).abs() < 1e-7 * loads_y.abs(), "{x} against {loads_x}");
            assert!((y - loads_y).abs() < 1e-7 * loads_y.abs(), "{y} against {loads_y}");
        }
    }
    for (step, name) in (0..5).flat_map(|k| ["x_g", "y_g", "x_w", "y_w"].map(|n| (k, n))) {
        let (a, b) = (solved.measure(step, name), stiff.measure(step, name));
        assert!((a - b).abs() <= 0.03 * stiff.measure(step, "y_g").abs(), "{name}: {a} against {b}");
    }
}

/// A body with flux (|grad u|^2 + 1e-6)^((p-2)/2) grad u under a load 4 t, held at 0.2 on its lid, above a floor that it
/// may not enter: in every column of cells the same.
fn power_law_on_a_floor(p: f64, gamma: f64, solver: &str) -> String {
    format!(
        "param p = {p}\nparam gamma = {gamma}\nmesh box [0,0] to [1,1] cells [2,16] quad\nunknown u : scalar\n\
         region floor = faces where y == 0\nregion lid = faces where y == 1\n{solver}\n\
         def flux(v) = pow(Norm_sqr(Grad_v) + 1e-6, (p-2)/2)*Grad_v\n\
         term body on all : flux(u).Grad_Test_u + 4*t*Test_u\nmultiplier l : scalar on floor\n\
         quadrature on floor vertex\nterm contact on floor : -pos_part(-gamma*u - l)*Test_u\n\
         term law on floor : -1/gamma*(l + pos_part(-gamma*u - l))*Test_l\nfix u = 0.2 on lid\n\
         steps t = 0.1 to 1 by 0.3\nmeasure force = integral(l) on floor"
    )
}

/// The force of the floor on that body: the flux is 4 t y - force at the middle of each of the 16 cells of a column, and
/// the slopes there add up to the 0.2 of the lid.
fn force_of_the_floor(p: f64, t: f64) -> f64 {
    let bisect = |mut low: f64, mut high: f64, is_low: &dyn Fn(f64) -> bool| {
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if is_low(middle) { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    };
    let flux = |slope: f64| (slope * slope + 1e-6).powf((p - 2.0) / 2.0) * slope;
    let slope = |q: f64| bisect(-50.0, 50.0, &|s| flux(s) < q);
    let lid = |force: f64| (0..16).map(|j| slope(4.0 * t * (f64::from(j) + 0.5) / 16.0 - force) / 16.0).sum::<f64>();
    if lid(0.0) <= 0.2 { 0.0 } else { bisect(0.0, 4.0 * t, &|force| lid(force) > 0.2) }
}

#[test]
fn a_power_law_with_a_multiplier_is_solved_for_every_parameter_of_the_augmentation() {
    for (p, gamma) in [(1.5, 10.0), (4.0, 1e-2), (4.0, 1e5), (10.0, 1e-2), (10.0, 10.0), (10.0, 1e5)] {
        let solved = solve(&examples(), power_law_on_a_floor(p, gamma, ""), &[], &[]).expect("the scene is right");
        assert!(solved.outcome.converged(), "p = {p}, gamma = {gamma}");
        for (k, step) in solved.outcome.steps.iter().enumerate() {
            assert!(step.parts().is_empty(), "p = {p}, gamma = {gamma}: {:?}", step.attempts);
            let (found, exact) = (-solved.measure(k, "force"), force_of_the_floor(p, step.window.end));
            assert!(
                (found - exact).abs() < 1e-6,
                "p = {p}, gamma = {gamma}, t = {}: {found}, {exact}",
                step.window.end
            );
        }
        let later: Vec<usize> = solved.outcome.steps[1..].iter().map(|s| s.history.n_iterations()).collect();
        assert!(later.iter().all(|n| *n <= 12), "p = {p}, gamma = {gamma}: {later:?}");
    }
}

/// Plain Newton steps reach states so far away that the rounding there is larger than every residual elsewhere: what is
/// called a solution afterwards has to be one.
#[test]
fn rounding_of_a_state_far_away_makes_no_solution() {
    let mut lost = 0;
    for p in [6.0, 8.0, 10.0] {
        let text = power_law_on_a_floor(p, 10.0, "solver newton with search=none");
        let solved = solve(&examples(), text, &[], &[]).expect("the scene is right");
        lost += usize::from(!solved.outcome.converged());
        for (k, step) in solved.outcome.steps.iter().enumerate().filter(|(_, s)| s.history.converged()) {
            let (found, exact) = (-solved.measure(k, "force"), force_of_the_floor(p, step.window.end));
            assert!((found - exact).abs() < 1e-6, "p = {p}, t = {}: {found}, {exact}", step.window.end);
        }
    }
    assert!(lost > 0, "without a search some of these are out of reach");
}

/// Nitsche with theta = -1 and gamma a thousand and ten thousand times below E/h: the points of a face outnumber the
/// directions of its stresses and hold each other. Forces of a program of our own in Python (numpy, dense, its own
/// elements), which does not share a line with this one.
#[test]
fn contact_that_binds_stresses_settles_from_rest() {
    let folder = examples().join("fault");
    let scene = std::fs::read_to_string(folder.join("nitsche.wfl")).expect("an example");
    let runs = [
        ((1e2, 0.4, 0.0), [-40.7863609044, -0.917262096479], 10),
        ((1e1, 0.4, 0.0), [-40.8376544451, -0.849011149968], 12),
        ((1e2, 0.2, 2.5), [-41.6728731497, -5.32362114839], 12),
    ];
    for ((gamma, friction, time), forces, most) in runs {
        let steps = ("steps t = 0 to 9.5 by 0.5", format!("steps t = {time} to {time} by 1"));
        let params = [("theta", -1.0), ("gamma", gamma), ("fric", friction)];
        let solved = solve(&folder, scene.clone(), &[steps], &params).expect("the scene is right");
        let iterations = solved.outcome.steps[0].history.n_iterations();
        assert!(solved.outcome.converged() && iterations <= most, "{params:?}: {iterations}");
        for (name, force) in ["Fn", "Ftz"].into_iter().zip(forces) {
            let found = solved.measure(0, name);
            assert!((found / force - 1.0).abs() < 1e-8, "{params:?}: {name} {found} against {force}");
        }
    }
}

/// A neo-Hookean block of unit size between clamped ends that come nearer by `t`.
fn clamped(cells: &str, element: &str, steps: &str) -> String {
    format!(
        "param E = 10\nparam nu = 0.3\ndef mu = E/(2*(1 + nu))\ndef lambda = E*nu/((1 + nu)*(1 - 2*nu))\n\
         mesh box [0,0,0] to [1,1,1] cells {cells} tet\nregion bottom = faces where z == 0\n\
         region top = faces where z == 1\nunknown u : vector {element}\n{steps}\ndef F = Id(3) + Grad_u\n\
         def P = mu*(F - Inv(F)') + lambda*log(Det(F))*Inv(F)'\nterm elastic on all : P:Grad_Test_u\n\
         quadrature on all degree 4\nfix u = [0,0,0] on bottom\nfix u = [0,0,-t] on top\n\
         measure work = integral(mu/2*(F:F - 3 - 2*log(Det(F))) + lambda/2*log(Det(F))^2) on all\n\
         measure pressure = mean(-P(3,3)) on all\n"
    )
}

/// Prescribed displacements larger than a cell turn cells inside out where they are written into the state; as part of
/// the first correction they do not.
#[test]
fn prescribed_increments_beyond_the_size_of_a_cell_need_no_smaller_parts() {
    let solved = solve(&examples(), clamped("[3,3,12]", "P2", "steps t = 0.1 to 0.2 by 0.1"), &[], &[]).unwrap();
    assert!(solved.outcome.converged());
    for step in &solved.outcome.steps {
        assert!(step.parts().is_empty(), "{:?}", step.attempts);
        assert!(step.iterations() <= 5, "{}", step.iterations());
    }
    // the energy is a function of the state alone: its growth is the work of the ends, which Simpson's rule gives
    let fine = solve(&examples(), clamped("[3,3,12]", "P2", "steps t = 0.1 to 0.2 by 0.05"), &[], &[]).unwrap();
    let forces: Vec<f64> = (0..3).map(|k| fine.measure(k, "pressure")).collect();
    let work = 0.1 / 6.0 * (forces[0] + 4.0 * forces[1] + forces[2]);
    let gained = solved.measure(1, "work") - solved.measure(0, "work");
    assert!((gained / work - 1.0).abs() < 1e-4, "{gained} {work}");
}

/// An increment whose first correction turns cells inside out, too: parts of it are taken, and all of them are counted.
#[test]
fn a_correction_that_cannot_be_evaluated_is_shortened() {
    let solve = |steps: &str| solve(&examples(), clamped("[2,2,6]", "P1", steps), &[], &[]).unwrap();
    let whole = solve("steps t = 0.95 to 0.95 by 1");
    let step = &whole.outcome.steps[0];
    assert!(whole.outcome.converged() && step.parts().is_empty());
    let first = &step.history.iterations[0];
    assert!(
        first.method == Method::Predictor && first.number > 1,
        "the first correction has been taken whole: {first:?}"
    );
    assert_eq!(step.history.n_iterations(), step.iterations());
    let parts = solve("steps t = 0.15 to 0.95 by 0.1");
    let (one, other) = (whole.measure(0, "work"), parts.measure(8, "work"));
    assert!((one / other - 1.0).abs() < 1e-9, "{one} {other}");
}

/// Values such as 0.1 + 0.1 + 0.1 are off by rounding; their increments are taken as equal, so that the matrix of a scene
/// with rates is assembled and factored once.
#[test]
fn equal_steps_of_a_linear_scene_with_rates_share_one_factor() {
    let text = |steps: &str| {
        format!(
            "mesh box [0] to [1] cells [8] segment\nunknown u : scalar\nstart u = sin(pi*x)\n\
             term storage on all : Dot_u*Test_u\nterm flux on all : Grad_u.Grad_Test_u\nfix u = 0 on boundary\n\
             steps t = {steps}\nmeasure heat = integral(u) on all\n"
        )
    };
    let factors = |steps: &str| {
        let solved = solve(&examples(), text(steps), &[], &[]).unwrap();
        (solved.outcome.report.factorisations, solved.measure(solved.outcome.steps.len() - 1, "heat"))
    };
    let (once, heat) = factors("0 to 1 by 0.1");
    assert_eq!(once, 1);
    // the linear elements divide the sine by 1 + L dt in each step
    let h = 1.0f64 / 8.0;
    let c = (std::f64::consts::PI * h).cos();
    let l = 6.0 / (h * h) * (1.0 - c) / (2.0 + c);
    let wanted = h / (std::f64::consts::PI * h / 2.0).tan() * (1.0 + 0.1 * l).powi(-10);
    assert!((heat / wanted - 1.0).abs() < 1e-12, "{heat} {wanted}");
    assert_eq!(factors("0 to 1 by 0.3").0, 2, "the last increment is shorter");
}

/// Two layers of one cell each that stick: what is prescribed opens three of four points at first, and one alone holds nothing.
/// The exact solution is affine.
#[test]
fn a_first_guess_that_holds_nothing_is_closed_before_a_body_is_called_loose() {
    for (friction, gamma) in [(0.5, 1e5), (5.0, 1e4)] {
        let solved = wfl_tests::solved(format!(
            "use \"contact\"\nmesh box [0,0] to [1,1] cells [2,2] quad map [x, y + 0.2*x]\ndef height = y - 0.2*x\n\
             region below = cells where height < 0.5\nregion above = cells where height > 0.5\n\
             region fault = interface from below to above\nregion floor = faces where height == 0\n\
             region rest = boundary - floor\nunknown a : vector Q1 on below\nunknown b : vector Q1 on above\n\
             def sigma(v) = 2000*Sym(Grad_v) + 500*Div_v*Id(2)\ndef G = [0.3,-1;0.2,-2]*1e-3\n\
             def S = 2000*Sym(G) + 500*Trace(G)*Id(2)\nterm lower on below : sigma(a):Grad_Test_a\n\
             term upper on above : sigma(b):Grad_Test_b\nterm contact on fault : nitsche(a, b, {gamma:e}, 0, {friction})\n\
             fix a = G*[x,y] on floor\nload a = S*Normal on rest\nload b = S*Normal on rest\n\
             measure off = max(Norm(a - G*[x,y])) on below\nmeasure bent = max(Norm(Grad_b - G)) on above\n"
        ));
        assert!(solved.measure(0, "off") < 1e-12 && solved.measure(0, "bent") < 1e-10, "{friction} {gamma:e}");
    }
}
