//! Nodes of contact without mass: what the body keeps, what the pressure no longer does, what is refused.

use wfl_tests::{Solved, examples, solve};

fn run(text: &str) -> Solved {
    solve(&examples(), text.to_owned(), &[], &[]).unwrap_or_else(|messages| panic!("{messages}"))
}

fn refused(text: &str) -> String {
    solve(&examples(), text.to_owned(), &[], &[]).err().expect("an error")
}

/// The bar of `examples/dynamics/bar.wfl` with the trapezoidal rule.
fn bar(n: u32, scheme: &str) -> String {
    format!(
        "param E = 900\nparam n = {n}\nmesh box [0] to [10] cells [n] segment\nregion wall = faces where x == 0\n\
         unknown u : scalar\nstart Dot_u = -10\nterm inertia on all : Dot2_u*Test_u\n\
         term stress on all : E*Grad_u.Grad_Test_u\nparam gamma = E*n\n\
         def p = pos_part(E*Grad_u.Normal - gamma*u)\nterm contact on wall : -p*Test_u\n\
         scheme newmark {scheme}\nparam contact = 20/30\nsteps t = 0 to 1.5*contact by contact/(2*n)\n\
         measure pressure = mean(p) on wall\nmeasure speed = mean(Dot_u) on all\n"
    )
}

/// The largest distance of the pressure from that of the wave, v0 sqrt(E rho) = 300, as a part of it, once the sharp front
/// has gone and until it comes back after 2/3.
fn oscillation(solved: &Solved) -> f64 {
    let during = |(k, step): (usize, &wfl_run::StepResult)| {
        (0.2..0.6).contains(&step.window.end).then(|| (solved.measure(k, "pressure") / 300.0 - 1.0).abs())
    };
    solved.outcome.steps.iter().enumerate().filter_map(during).fold(0.0, f64::max)
}

#[test]
fn the_pressure_of_an_impact_does_not_oscillate_and_the_energy_is_kept() {
    let with = run(&bar(100, "massless=wall energy"));
    let without = run(&bar(100, ""));
    assert!(oscillation(&without) > 1.0);
    assert!(oscillation(&with) < 0.03, "{}", oscillation(&with));
    let lost = (0..with.outcome.steps.len()).map(|k| with.measure(k, "energy_lost").abs()).fold(0.0, f64::max);
    assert!(lost < 1e-12 * 500.0, "{lost}");
    // the bar leaves the wall nearly as fast as it came: a part of its energy is in vibrations
    let speed = with.measure(with.outcome.steps.len() - 1, "speed");
    assert!((speed / 10.0 - 1.0).abs() < 0.02, "{speed}");
}

/// Rigid motions and uniform strains have the energy that they had, in every kind of cell and with nodes between vertices:
/// total mass, centre of mass and moments of inertia.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn affine_motions_keep_their_energy() {
    for (mesh, dim, family) in [
        ("mesh box [0,0] to [3,2] cells [5,4] tri", 2, "P"),
        ("mesh box [0,0] to [3,2] cells [5,4] quad", 2, "Q"),
        ("mesh box [0,0,0] to [2,2,2] cells [3,3,4] tet", 3, "P"),
        ("mesh box [0,0,0] to [2,2,2] cells [3,3,4] hex", 3, "Q"),
    ] {
        for degree in [1, 2] {
            let motions: &[&str] = match dim {
                2 => &["[1,0]", "[0.3,-1]", "[-y,x]", "[x,0]", "[y+1,2*x-y]"],
                _ => &["[1,0,0.5]", "[-y,x,0]", "[0,-z,y]", "[x,z,2*y-z]"],
            };
            for motion in motions {
                let text = |scheme: &str| {
                    format!(
                        "{mesh}\nregion wall = faces where y == 0\nunknown u : vector {family}{degree}\nstart Dot_u = {motion}\n\
                         term inertia on all : (1 + x*x)*Dot2_u.Test_u\nterm stress on all : Grad_u:Grad_Test_u\n\
                         scheme newmark {scheme} energy\nsteps t = 0 to 0.001 by 0.001\n"
                    )
                };
                let [old, new] = ["", "massless=wall"].map(|s| run(&text(s)).measure(0, "energy_kinetic"));
                assert!((new / old - 1.0).abs() < 1e-12, "{mesh} {degree} {motion}: {new} {old}");
            }
        }
    }
}

/// A motion of the nodes without mass alone has no energy.
#[test]
fn the_nodes_have_no_mass() {
    let text = "mesh box [0,0] to [3,2] cells [5,4] quad\nregion wall = faces where y == 0\nunknown u : scalar\n\
                start Dot_u = max(0, 0.1 - y)\nterm inertia on all : Dot2_u*Test_u\n\
                term stress on all : Grad_u.Grad_Test_u\nscheme newmark massless=wall energy\n\
                steps t = 0 to 0.001 by 0.001\n";
    let energy = run(text).measure(0, "energy_kinetic");
    assert!(energy.abs() < 1e-16, "{energy:e}");
}

/// A body that slides on an inclined face behaves as one on a level face: the local frames of its nodes turn the mass, too.
#[test]
fn a_turned_body_moves_as_the_one_that_is_not() {
    let scene = |angle: f64| {
        let (c, s) = (angle.cos(), angle.sin());
        // the body is turned by the angle about the origin
        format!(
            "param c = {c}\nparam s = {s}\n\
             mesh box [0,0] to [3,2] cells [4,3] quad map [c*x - s*y, s*x + c*y]\n\
             region floor = faces where abs(c*y - s*x) < 1e-6\nunknown u : vector\n\
             start Dot_u = (1 + (c*y - s*x)^2)*[c,s]\n\
             term inertia on all : 2*Dot2_u.Test_u\nterm stress on all : (Grad_u + Grad_u'):Grad_Test_u + Div_u*Div_Test_u\n\
             fix u.Normal = 0 on floor\nscheme newmark massless=floor\nsteps t = 0 to 2 by 0.05\n\
             measure drift = mean(c*u(1) + s*u(2)) on all\nmeasure most = max(u.u) on floor\n"
        )
    };
    let (level, turned) = (run(&scene(0.0)), run(&scene(0.4)));
    for k in [1, 10, 40] {
        for name in ["drift", "most"] {
            let (a, b) = (level.measure(k, name), turned.measure(k, name));
            assert!((a - b).abs() < 1e-9 * a.abs(), "{name} at {k}: {a} {b}");
        }
    }
}

/// Two equal bars collide: the pressure is half of rho c v0 until the waves come back, at t = 2. Bodies on both sides give
/// their mass away, each to its own nodes; with equal steps, and with those that the run chooses.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn two_bodies_collide() {
    let text = |scheme: &str, steps: &str| {
        format!(
            "mesh box [0,-1] to [0.1,1] cells [1,240] quad\nregion low = cells where y < 0\n\
             region high = cells where y > 0\nregion touch = interface from low to high\n\
             unknown v : scalar on low\nunknown w : scalar on high\nstart Dot_w = -1\n\
             term of_low on low : Dot2_v*Test_v + Grad_v.Grad_Test_v\n\
             term of_high on high : Dot2_w*Test_w + Grad_w.Grad_Test_w\n\
             def p = 1200*neg_part(Interpolate(w, neighbor_element) - v)\n\
             term contact on touch : p*(Test_v - Interpolate(Test_w, neighbor_element))\n\
             scheme newmark {scheme}\nsteps t = 0 to 1.5 {steps}\nmeasure pressure = mean(p) on touch\n\
             measure low_speed = mean(Dot_v) on low\nmeasure high_speed = mean(Dot_w) on high\n"
        )
    };
    let worst = |solved: &Solved| {
        let during = |(k, step): (usize, &wfl_run::StepResult)| {
            (0.6..1.4).contains(&step.window.end).then(|| (2.0 * solved.measure(k, "pressure") - 1.0).abs())
        };
        solved.outcome.steps.iter().enumerate().filter_map(during).fold(0.0, f64::max)
    };
    for steps in ["by 0.002", "by auto with first=1e-4, error=1e-4"] {
        let [without, with] = ["", "massless=touch"].map(|scheme| run(&text(scheme, steps)));
        assert!(worst(&with) < 0.05 && worst(&without) > 0.3, "{steps}: {} {}", worst(&with), worst(&without));
        let last = with.outcome.steps.len() - 1;
        let momentum = with.measure(last, "low_speed") + with.measure(last, "high_speed");
        assert!((momentum + 1.0).abs() < 1e-9, "{momentum}");
    }
}

#[test]
fn what_has_no_mass_to_give_is_refused() {
    let base = bar(10, "massless=wall");
    let told = refused(&base.replace("massless=wall", "massless=wal"));
    assert!(told.contains("E452") && told.contains("did you mean `wall`"), "{told}");
    let told = refused(&base.replace("massless=wall", "massless=0.5"));
    assert!(told.contains("E452") && told.contains("name of a region"), "{told}");
    let told = refused(&base.replace("massless=wall", "massless=all"));
    assert!(told.contains("E452") && told.contains("nowhere to go"), "{told}");
    let told = refused(&base.replace("Dot2_u*Test_u", "(1 + u)*Dot2_u*Test_u"));
    assert!(told.contains("E452") && told.contains("term of its own"), "{told}");
    let told = refused(&base.replace("Dot2_u*Test_u", "Dot_u*Test_u").replace("start Dot_u = -10\n", ""));
    assert!(told.contains("E452") && told.contains("there is no mass"), "{told}");
    let explicit = base.replace("scheme newmark massless", "scheme explicit massless");
    let told = refused(&explicit.replace("by contact/(2*n)", "by auto"));
    assert!(told.contains("E452") && told.contains("explicit"), "{told}");
    let state = base.clone() + "state felt : scalar on wall := Dot2_u\nmeasure most = max(felt) on wall\n";
    let told = refused(&state);
    assert!(told.contains("E452") && told.contains("the state `felt` reads accelerations"), "{told}");
    let other = base.replace(
        "unknown u : scalar",
        "region far = faces where x == 10\nunknown q : scalar on far\nunknown u : scalar",
    ) + "term of_q on far : (q - u)*Test_q\n";
    assert!(run(&other).outcome.converged());
}

/// The equation of a node without mass is a static one: E du/dx is the load in each step, however short the steps are. The
/// inertia beside it is 1e18 times as large in the shortest.
#[test]
fn equations_without_mass_hold_in_steps_of_any_length() {
    for scheme in ["bdf2", "newmark", "newmark beta=0.3025 gamma=0.6"] {
        for h in ["1e-4", "1e-7", "1e-9"] {
            let text = format!(
                "param h = {h}\nmesh box [0] to [1] cells 3 segment\nregion end = faces where x == 0\n\
                 region first = cells where x < 0.34\nunknown u : scalar\nstart u = 1\nstart Dot_u = 1\n\
                 term inertia on all : Dot2_u*Test_u\nterm stress on all : 1e5*Grad_u.Grad_Test_u\n\
                 load u = -sin(t/h/10) on end\nscheme {scheme} massless=end\nsteps t = 0 to 30*h by h\n\
                 measure stress = mean(1e5*Grad_u(1)) on first\n"
            );
            let solved = run(&text);
            for k in [1, 10, 30] {
                let (found, exact) = (solved.measure(k, "stress"), f64::from(u32::try_from(k).expect("few")));
                // of u the last digit, 2e-16, is 7e-11 of stress
                assert!((found - (0.1 * exact).sin()).abs() < 1e-9, "{scheme} {h} {k}: {found}");
            }
        }
    }
}

/// A bar that is pushed at its massless end: momentum says that it has the velocity S t. The node moves to its place within one
/// step; the trapezoidal rule would keep twice that over h as its velocity, with changing sign.
#[test]
fn velocities_of_nodes_without_mass_are_those_of_their_motion() {
    let text = |h: f64| {
        format!(
            "mesh box [0] to [1] cells 10 segment\nregion end = faces where x == 0\nunknown u : scalar\n\
             term inertia on all : Dot2_u*Test_u\nterm stress on all : 1e4*Grad_u.Grad_Test_u\nload u = 1 on end\n\
             scheme newmark massless=end\nsteps t = 0 to 0.1 by {h}\nmeasure v = mean(Dot_u) on all\n\
             measure d = mean(u) on all\n"
        )
    };
    for h in [1e-3, 1e-4] {
        let solved = run(&text(h));
        let last = solved.outcome.steps.len() - 1;
        let (v, d) = (solved.measure(last, "v"), solved.measure(last, "d"));
        // the load of the start acts from the first step on
        assert!((v / 0.1 - 1.0).abs() < 10.0 * h && (d / 0.005 - 1.0).abs() < 15.0 * h, "{h}: {v} {d}");
        let before = solved.measure(last - 1, "v");
        assert!((v - before - h).abs() < 0.1 * h + 1e-4, "{h}: {before} {v}");
    }
}

/// A bar with velocity 1 is braked by dry friction of strength 1 at its massless end: v = 1 - t. The run chooses its steps, which are
/// short while the node finds its place.
#[test]
fn friction_brakes_at_nodes_without_mass() {
    for scheme in ["newmark massless=end", "newmark beta=0.3025 gamma=0.6 massless=end", "bdf2 massless=end"] {
        let text = format!(
            "mesh box [0] to [1] cells 3 segment\nregion end = faces where x == 0\nunknown u : scalar\nstart Dot_u = 1\n\
             term inertia on all : Dot2_u*Test_u\nterm stress on all : 1e5*Grad_u.Grad_Test_u\nparam gamma = 1e6\n\
             def Pt = gamma*(u - Previous_held)\ndef q = Ball_projection(Pt, 1)\n\
             state held : scalar on end := Previous_held + (Pt - q)/gamma\nterm friction on end : q*Test_u\n\
             scheme {scheme}\nsteps t = 0 to 0.1 by auto\nmeasure d = mean(u) on all\nmeasure v = mean(Dot_u) on all\n"
        );
        let solved = run(&text);
        let last = solved.outcome.steps.len() - 1;
        let (d, v) = (solved.measure(last, "d"), solved.measure(last, "v"));
        assert!((d / 0.095 - 1.0).abs() < 1e-4 && (v / 0.9 - 1.0).abs() < 1e-3, "{scheme}: {d} {v}");
        assert!(last < 200, "{scheme}: {last} steps");
    }
}

/// A bar rests under its weight, rho g L = 10, on a wall that a multiplier keeps it from: the pressure is there from the start.
/// With a velocity towards the wall it is pressed on, with one away from it it is free.
#[test]
fn a_multiplier_at_nodes_without_mass_is_what_their_equations_say() {
    let text = |scheme: &str, start: &str| {
        format!(
            "mesh box [0] to [1] cells 4 segment\nregion wall = faces where x == 0\nunknown u : scalar\n\
             multiplier lam : scalar on wall\nquadrature on wall vertex\nparam gamma = 1e4\n\
             term inertia on all : Dot2_u*Test_u\nterm stress on all : 1e4*Grad_u.Grad_Test_u\nload u = -10 on all\n\
             {start}def p = pos_part(lam - gamma*u)\nterm contact on wall : -p*Test_u\n\
             term law on wall : -1/gamma*(lam - p)*Test_lam\nscheme {scheme} massless=wall\n\
             steps t = 0 to 0.05 by 1e-3\nmeasure pressure = mean(p) on wall\nmeasure v = mean(Dot_u) on all\n"
        )
    };
    let rest = "start u = -1e-3*(x - x^2/2)\n";
    for scheme in ["newmark", "bdf2"] {
        let solved = run(&text(scheme, rest));
        assert!((1..=50).all(|k| (solved.measure(k, "pressure") - 10.0).abs() < 1e-9), "{scheme}");
        let solved = run(&text(scheme, &format!("{rest}start Dot_u = 1\n")));
        let (p, v) = (solved.measure(50, "pressure"), solved.measure(50, "v"));
        assert!(p == 0.0 && (v - 0.5).abs() < 0.02, "{scheme}: {p} {v}");
    }
}

/// A mass of the faces themselves would be moved by a layer of cells: 10 % of the motion of a bar with a heavy tip and 20 cells.
#[test]
fn a_mass_of_the_faces_stays_where_it_is() {
    let text = "mesh box [0] to [1] cells [20] segment\nregion r = faces where x == 1\nunknown u : scalar\n\
                term i on all : Dot2_u*Test_u\nterm tip on r : 5*Dot2_u*Test_u\nterm s on all : Grad_u.Grad_Test_u\n\
                scheme newmark massless=r\nsteps t = 0 to 1 by 0.1\n";
    let told = refused(text);
    assert!(told.contains("E452") && told.contains("term tip"), "{told}");
}

/// The force of Coriolis does no work, but between rates of two kinds it would: the energy grew 48 times in 200 steps.
#[test]
fn forces_that_turn_with_the_velocity_stay_off_nodes_without_mass() {
    let block = |scheme: &str, on: &str| {
        format!(
            "mesh box [0,0] to [1,0.5] cells [4,2] quad\nregion left = faces where x == 0\nregion right = faces where x == 1\n\
             region back = cells where x > 0.5\nunknown u : vector\nterm inertia on all : Dot2_u.Test_u\n\
             term stress on all : 100*Sym(Grad_u):Grad_Test_u\nterm hold on left : 50*u.Test_u\n\
             term drag on left : 3*Dot_u.Test_u\nterm coriolis on {on} : 30*(Dot_u(1)*Test_u(2) - Dot_u(2)*Test_u(1))\n\
             load u = [1 - cos(6*t),0] on right\nscheme {scheme} massless=left\nsteps t = 0 to 0.3 by 1.5e-3\n\
             measure k = integral(Norm_sqr(Dot_u)) on all\n"
        )
    };
    for scheme in ["newmark", "hht alpha=-0.1", "generalised_alpha rho_inf=0.8"] {
        let told = refused(&block(scheme, "all"));
        assert!(told.contains("E452") && told.contains("not symmetric") && told.contains("term coriolis"), "{told}");
    }
    let k = |scheme: &str| run(&block(scheme, "back")).measure(199, "k");
    let (newmark, bdf) = (k("newmark"), k("bdf2"));
    assert!((newmark / bdf - 1.0).abs() < 2e-3, "{newmark} {bdf}");
    run(&block("bdf2", "all"));
}
