//! What a run begins with: motions that start with an acceleration, contact that is closed where time starts in axes of any direction,
//! sudden loads on fields with first rates alone, loads that come out of nothing.

use wfl_tests::{Solved, examples, solve};

fn run(text: &str) -> Solved {
    solve(&examples(), text.to_owned(), &[], &[]).unwrap_or_else(|messages| panic!("{messages}"))
}

fn all(solved: &Solved, name: &str) -> Vec<f64> {
    (0..solved.outcome.steps.len()).map(|k| solved.measure(k, name)).collect()
}

/// A bar whose end is shaken by 0.05 t^2 has the acceleration 0.1 there from the start, and the reaction of the mass of that end,
/// however unequal the steps are that the run chooses. The wave has not come far.
#[test]
fn a_support_that_is_shaken_has_its_acceleration_from_the_first_step_on() {
    let text = "mesh box [0] to [1] cells [6] segment\nregion l = faces where x == 0\nunknown u : scalar\n\
                term e on all : 100*Grad_u.Grad_Test_u\nterm m on all : 2*Dot2_u*Test_u\nfix u = 0.05*t^2 on l\n\
                measure F = reaction(u) on l\nmeasure a = value(Dot2_u) at [0]\n";
    for (scheme, steps) in [
        ("", "by auto with first=1e-4, error=1e-6"),
        ("scheme bdf2\n", "by 1e-5"),
        ("scheme bdf3\n", "by auto with first=1e-4, error=1e-6"),
        ("scheme newmark\n", "by auto with first=1e-4, error=1e-6"),
    ] {
        let solved = run(&format!("{text}{scheme}steps t = 0 to 2e-4 {steps}\n"));
        for (force, a) in all(&solved, "F").iter().zip(all(&solved, "a")).skip(1) {
            // the end of a long chain of consistent masses m moves as one mass of m sqrt(3)/6
            let exact = -0.1 * 2.0 / 6.0 * 3f64.sqrt() / 6.0;
            assert!((force - exact).abs() < 2e-5 && (a - 0.1).abs() < 1e-4, "{scheme}{steps}: {force} {a}");
        }
    }
}

/// A bar with inertia in its left half: of what has none the rate is that of the quasi-static motion, under every rule.
#[test]
fn nodes_without_inertia_have_the_rates_of_their_motion() {
    for scheme in ["newmark", "newmark beta=0.3025 gamma=0.6", "generalised_alpha", "bdf2"] {
        for (to, by) in [("1", "auto with first=1e-4, error=1e-5"), ("1", "0.01"), ("2e-5", "1e-6")] {
            let solved = run(&format!(
                "mesh box [0] to [2] cells [8] segment\nregion heavy = cells where x < 1\n\
                 region l = faces where x == 0\nregion r = faces where x == 2\nunknown u : scalar\n\
                 term e on all : 100*Grad_u.Grad_Test_u\nterm m on heavy : 2*Dot2_u*Test_u\n\
                 load u = sin(3*t) on r\nfix u = 0 on l\nscheme {scheme}\nsteps t = 0 to {to} by {by}\n\
                 measure far = value(Dot_u) at [2]\nmeasure near = value(Dot_u) at [1]\n\
                 measure now = value(u) at [2]\n"
            ));
            let (far, near) = (all(&solved, "far"), all(&solved, "near"));
            for (k, (far, near)) in far.iter().zip(&near).enumerate().skip(1) {
                let t = solved.outcome.steps[k].window.end;
                // the light half is a spring of stiffness 100 behind the heavy one
                let exact = near + 0.03 * (3.0 * t).cos();
                assert!((far - exact).abs() < 2e-3, "{scheme} {to} {by} t = {t}: {far} {exact}");
            }
        }
    }
}

/// Two blocks that touch are pressed together: the pressure is that of the same scene without a turn, from the first step on.
#[test]
fn closed_contact_of_multipliers_is_the_same_in_all_directions() {
    let turned = |angle: f64, law: &str, friction: f64| {
        let slid = if law == "augmented_sliding" { ", slid" } else { "" };
        let state = if slid.is_empty() {
            String::new()
        } else {
            format!("state slid : vector on f := augmented_slip(a, b, l, slid, 2000, {friction})\n")
        };
        let solved = run(&format!(
            "use \"contact\"\nparam al = {angle}\n\
             mesh box [0,-1] to [1,1] cells [3,6] quad map [cos(al)*x-sin(al)*y, sin(al)*x+cos(al)*y]\n\
             def e1 = [cos(al),sin(al)]\ndef e2 = [-sin(al),cos(al)]\n\
             region lo = cells where X.e2 < 0\nregion up = cells where X.e2 > 0\nregion f = interface from lo to up\n\
             unknown a : vector on lo\nunknown b : vector on up\nmultiplier l : vector on f\n{state}\
             def sigma(v) = 30*Div_v*Id(2)+80*Sym(Grad_v)\n\
             term ia on lo : Dot2_a.Test_a\nterm ib on up : 2*Dot2_b.Test_b\n\
             term sa on lo : sigma(a):Grad_Test_a\nterm sb on up : sigma(b):Grad_Test_b\n\
             term con on f : {law}(a, b, l{slid}, 2000, {friction})\n\
             load b = -3*e2 + 0.2*e1 on up\nscheme newmark\nsteps t = 0 to 0.02 by 0.004\n\
             measure p = mean(l.Normal) on f\nmeasure s = mean(l.e1) on f\n"
        ));
        [all(&solved, "p"), all(&solved, "s")].concat()
    };
    for (law, friction) in [("augmented", 0.0), ("augmented_sliding", 0.0), ("augmented_sliding", 0.3)] {
        let straight = turned(0.0, law, friction);
        let largest = straight.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        assert!(largest > 0.1);
        for angle in [0.1, 0.61, 1.2, 2.0, 3.3] {
            for (x, exact) in turned(angle, law, friction).iter().zip(&straight) {
                assert!((x - exact).abs() < 1e-6 * largest, "{law} {friction} {angle}: {x} {exact}");
            }
        }
    }
}

/// Terzaghi's column with a little inertia: what a sudden load makes of the pressure fades, without a `scheme` statement, too. The
/// pressure at the bottom over the load at the time factor 0.3 is 4/pi sum (-1)^k/(2k+1) exp(-((2k+1) pi/2)^2 0.3).
#[test]
fn a_pressure_beside_inertia_does_not_ring() {
    let solved = run("use \"poro\"\nuse \"elasticity\"\nmesh box [0,0] to [0.05,1] cells [1,20] quad\n\
                      region top = faces where y == 1\nregion bottom = faces where y == 0\n\
                      region sides = faces where x == 0 or x == 0.05\nunknown u : vector Q2\nunknown p : scalar Q1\n\
                      term inertia on all : 2e-3*Dot2_u.Test_u\nterm momentum on all : sigma(u, 1000, 0.25):Grad_Test_u\n\
                      term coupling on all : biot(u, p, 1)\nterm flow on all : darcy(p, 1e-3)\n\
                      load u = [0,-10] on top\nfix u(1) = 0 on sides\nfix u(2) = 0 on bottom\nfix p = 0 on top\n\
                      steps t = 0 to 0.25 by 0.0025\nmeasure pb = value(p/10) at [0,0]\n");
    let exact: f64 = (0..20)
        .map(|k| {
            let m = f64::from(2 * k + 1);
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            4.0 / std::f64::consts::PI * sign / m * (-(m * std::f64::consts::FRAC_PI_2).powi(2) * 0.3).exp()
        })
        .sum();
    let found = *all(&solved, "pb").last().expect("steps");
    assert!((found - exact).abs() < 5e-3, "{found} {exact}");
}

/// A pulse comes out of numbers that have no digits.
#[test]
fn a_pulse_may_come_out_of_nothing() {
    for (width, rates) in
        [(0.04, "Dot2_u*Test_u"), (0.06, "Dot2_u*Test_u"), (0.04, "Dot_u*Test_u"), (0.05, "0*u*Test_u")]
    {
        let solved = run(&format!(
            "mesh box [0] to [1] cells [10] segment\nregion l = faces where x == 0\nregion r = faces where x == 1\n\
             unknown u : scalar\nterm i on all : {rates}\nterm b on all : Grad_u.Grad_Test_u\nfix u = 0 on l\n\
             load u = exp(-((t-2.1)/{width})^2) on r\nsteps t = 0 to 2.1 by 0.01\nmeasure m = mean(u) on r\n"
        ));
        let last = *all(&solved, "m").last().expect("steps");
        assert!(last > 1e-2, "{width} {rates}: {last}");
    }
}
