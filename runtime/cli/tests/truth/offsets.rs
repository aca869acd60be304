//! What a constant that is added does not change: positions far from the origin, absolute pressures and temperatures, uniform flight. A load that
//! is small beside what cancels is balanced all the same.

use super::run;

/// A spring of 1e4 between two masses at 1000 and 1001, one of 1 to the wall, and a pull of 1e-3: both move by F/k.
#[test]
fn masses_at_their_positions_are_pulled() {
    let scene = "mesh box [0] to [1] cells [1] segment with idle_cells=allowed\nunknown a : scalar global\nunknown b : scalar global\n\
                 start a = 1000\nstart b = 1001\nterm pair on global : 1e4*(b - a - 1)*(Test_b - Test_a)\n\
                 term wall on global : (a - 1000)*Test_a\nterm pull on global : -1e-3*Test_b\n\
                 measure da = max(a - 1000) on global\nmeasure db = max(b - 1001) on global\n";
    let ran = run("offset-masses", scene, &[]);
    assert_eq!(ran.code, 0, "{}", ran.text);
    assert!((ran.last("da") - 1e-3).abs() < 1e-8, "{}", ran.text);
    assert!((ran.last("db") - 1e-3 - 1e-7).abs() < 1e-8, "{}", ran.text);
}

/// A rigid plate whose height above the origin is the unknown, on an elastic block of 1000 that is not divided across: the
/// block carries F = 10, and shortens by F L/E.
#[test]
fn a_plate_with_its_height_as_unknown_rests_on_a_block() {
    for (gamma, height) in [("1e3", 1.0), ("1e5", 1.0), ("1e5", 100.0), ("1e7", 1.0)] {
        let scene = format!(
            "param L = {height}\nmesh box [0,0] to [1,L] cells [1,4] quad\nregion top = faces where y == L\n\
             region floor = faces where y == 0\nregion sides = faces where x == 0 or x == 1\n\
             unknown u : vector\nunknown h : scalar global\nstart h = L\ndef p = {gamma}*pos_part(y + u(2) - h)\n\
             term body on all : 1000*Sym(Grad_u):Grad_Test_u\nterm contact on top : p*(Test_u(2) - Test_h)\n\
             term weight on global : 10*Test_h\nfix u(2) = 0 on floor\nfix u(1) = 0 on sides\n\
             measure N = integral(p) on top\nmeasure R = reaction(u(2)) on floor\nmeasure short = -mean(u(2)) on top\n"
        );
        let ran = run(&format!("offset-plate-{gamma}-{height}"), &scene, &[]);
        assert_eq!(ran.code, 0, "{}", ran.text);
        for (name, right) in [("N", 10.0), ("R", -10.0), ("short", 10.0 * height / 1000.0)] {
            assert!((ran.last(name) / right - 1.0).abs() < 1e-4, "{gamma} {height} {name}: {}", ran.text);
        }
    }
}

/// A well at an absolute pressure of 5e7 behind a skin that is conducting: the rise beside it is that of the bar of rock alone, and
/// what is injected is stored or leaves. Against the same scene with pressures that begin at zero.
#[test]
fn a_well_at_an_absolute_pressure_injects() {
    for (kind, place) in [("global", "global"), ("on face", "face")] {
        for index in ["1e-6", "1e-5", "1e-3"] {
            let ran = |p0: &str| {
                let scene = format!(
                    "param p0 = {p0}\nmesh box [0] to [100] cells [20] segment\nregion face = faces where x == 0\n\
                     region far = faces where x == 100\nunknown p : scalar\nunknown P : scalar {kind}\nstart p = p0\nstart P = p0\n\
                     term stored on all : 1e-9*Dot_p*Test_p\nterm flow on all : 1e-11*Grad_p.Grad_Test_p\n\
                     term well on face : {index}*(p - P)*(Test_p - Test_P)\nterm injected on {place} : -1e-6*Test_P\n\
                     fix p = p0 on far\nsteps t = 0 to 1e6 by 2e5\nmeasure rise = max(p - p0) on face\n\
                     measure out = reaction(p) on far\n"
                );
                run(&format!("offset-well-{kind}-{index}-{p0}"), &scene, &[])
            };
            let (deep, shallow) = (ran("5e7"), ran("0"));
            assert!(deep.code == 0 && shallow.code == 0, "{}", deep.text);
            let [rise, right] = [deep.last("rise"), shallow.last("rise")];
            assert!((rise / right - 1.0).abs() < 1e-5, "{kind} {index}: {rise} for {right}");
        }
    }
}

/// The same rock beside a fault whose leak-off grows with the pressure, at an absolute pressure: no step may take its start for
/// its end because rounding hides the difference. Against the same law with pressures that begin at zero.
#[test]
fn a_leak_off_at_an_absolute_pressure_is_not_left_out() {
    let rise = |p0: &str, leak: &str| {
        let scene = format!(
            "param p0 = {p0}\nmesh box [0,-10] to [20,10] cells [4,4] quad\nregion below = cells where y < 0\n\
             region above = cells where y > 0\nregion fault = interface from below to above\n\
             region well = nodes of fault where x == 0\nregion far = faces where y == -10 or y == 10\nunknown p : scalar\n\
             unknown pf : scalar on fault\nsplit p across fault\nstart p = p0\nstart pf = p0\n\
             def q(v) = {leak}*(1 + 1e-16*(pf - p0)^2)*(pf - v)\nterm stored on all : 1e-9*Dot_p*Test_p\n\
             term rock on all : 1e-11*Grad_p.Grad_Test_p\nterm flow on fault : 1e-9*Grad_pf.Grad_Test_pf\n\
             term leak on fault : q(p)*(Test_pf - Test_p) + q(Interpolate(p, neighbor_element))*(Test_pf - Interpolate(Test_p, neighbor_element))\n\
             load pf = 1e-7 on well\nfix p = p0 on far\nsteps t = 0 to 1e4 by 1e3\nmeasure rise = max(pf - p0) on fault\n"
        );
        let ran = run(&format!("offset-leak-{p0}-{leak}"), &scene, &[]);
        assert_eq!(ran.code, 0, "{}", ran.text);
        ran.last("rise")
    };
    for leak in ["1e-4", "1e-2"] {
        let (deep, shallow) = (rise("5e7", leak), rise("0", leak));
        assert!((deep / shallow - 1.0).abs() < 1e-3, "{leak}: {deep} for {shallow}");
    }
}

/// A mass of 1 at a height of 1000 falls g t^2/2 by the trapezoidal rule, in steps so short that its inertia hides its weight.
#[test]
fn a_mass_falls_from_far_above() {
    let scene = "mesh box [0] to [1] cells [1] segment with idle_cells=allowed\nunknown h : scalar global\nstart h = 1000\n\
                 term motion on global : (Dot2_h + 9.81)*Test_h\nscheme newmark\nsteps t = 0 to 1e-2 by 1e-4\n\
                 measure fall = max(h - 1000) on global\n";
    let ran = run("offset-fall", scene, &[]);
    assert_eq!(ran.code, 0, "{}", ran.text);
    assert!((ran.last("fall") + 4.905e-4).abs() < 1e-8, "{}", ran.text);
}

/// Heat crosses to a block that does not move yet: its displacement is zero but for rounding that the solution of both leaves.
#[test]
fn a_body_at_rest_beside_heat_is_at_rest() {
    for cells in [2, 4, 8] {
        let scene = format!(
            "mesh box [0,0] to [1,1] cells [{cells},{cells}] quad\nregion floor = faces where y == 0\nregion top = faces where y == 1\n\
             unknown u : vector\nunknown T : scalar\ndef gap = 0.0047 - u.Normal\n\
             term body on all : 1000*Sym(Grad_u):Grad_Test_u\nterm heat on all : Grad_T.Grad_Test_T\n\
             term contact on floor : 1e5*pos_part(-gap)*(Test_u.Normal)\n\
             term cross on floor : 1/(pos_part(gap) + 1e-3)*T*Test_T\nfix u = [0,-0.01*t] on top\nfix T = 1 on top\n\
             steps t = 0 to 1 by 0.5\nmeasure warm = mean(T) on floor\nmeasure pressed = integral(1e5*pos_part(-gap)) on floor\n"
        );
        let ran = run(&format!("offset-rest-{cells}"), &scene, &[]);
        assert_eq!(ran.code, 0, "{}", ran.text);
        // open, h = 1/(0.0047 + 1e-3) = 175.44 and a column of height 1: T = 1/(1 + h)
        assert!((ran.measure(0, "warm") - 1.0 / (1.0 + 1.0 / 0.0057)).abs() < 1e-9, "{}", ran.text);
        for code in ["W605", "W606", "W641"] {
            assert!(!ran.tells(code), "{cells}: {}", ran.text);
        }
        assert!(ran.last("pressed") > 1.0, "{}", ran.text);
    }
}

/// By measure the largest difference of two runs over all steps, in parts of the largest value of the second one.
fn apart(ran: &super::Ran, right: &super::Ran, name: &str) -> f64 {
    let column = |ran: &super::Ran| -> Vec<f64> {
        let steps = ran.report["steps"].as_array().map_or(0, Vec::len);
        (0..steps).map(|step| ran.measure(step, name)).collect()
    };
    let (values, right) = (column(ran), column(right));
    assert_eq!(values.len(), right.len(), "{name}: {}", ran.text);
    let most = right.iter().fold(0.0f64, |most, x| most.max(x.abs()));
    values.iter().zip(&right).fold(0.0f64, |far, (a, b)| far.max((a - b).abs())) / most
}

/// Heat that is lost by a law of the difference from what is around, at temperatures far from zero: what is stored is 1e6 times what
/// flows, and the tolerance is one of what flows. It was wrong by 3e-4.
#[test]
fn heat_is_lost_by_differences() {
    let ran = |constant: &str| {
        let scene = format!(
            "mesh box [0,0] to [1,1] cells [6,6] quad\nunknown T : scalar\nparam T0 = {constant}\nstart T = T0 + x\n\
             term stored on all : Dot_T*Test_T\nterm flow on all : 0.3*Grad_T.Grad_Test_T\n\
             term lost on all : 2*(T - T0)*abs(T - T0)*Test_T\nsteps t = 0 to 1 by 0.1\n\
             measure m = integral(T - T0) on all\nmeasure q = max(T - T0) on all\n"
        );
        run(&format!("offset-heat-{constant}"), &scene, &[])
    };
    let right = ran("0");
    for constant in ["1e4", "1e6"] {
        let ran = ran(constant);
        assert!(ran.code == 0 && apart(&ran, &right, "m") < 1e-6 && apart(&ran, &right, "q") < 1e-6, "{}", ran.text);
    }
}

/// A conductivity that grows with the square of a difference: of `(T - T0)^2` rounds the difference, not the squares of both. At 1e8 that
/// was taken for larger than every flow, and nothing was solved for.
#[test]
fn heat_flows_by_the_square_of_a_difference() {
    let ran = |constant: &str| {
        let scene = format!(
            "mesh box [0,0] to [1,1] cells [4,4] quad\nregion top = faces where y == 1\nregion low = faces where y == 0\n\
             unknown T : scalar\nparam T0 = {constant}\nstart T = T0\nterm stored on all : Dot_T*Test_T\n\
             term flow on all : (1 + 0.5*(T - T0)^2)*Grad_T.Grad_Test_T\nterm heated on top : 3*(T - T0 - sin(5*t))*Test_T\n\
             fix T = T0 on low\nsteps t = 0 to 1 by 0.1\nmeasure m = integral(T - T0) on all\n"
        );
        run(&format!("offset-square-{constant}"), &scene, &[])
    };
    let (ran, right) = (ran("1e8"), ran("0"));
    assert!(ran.code == 0 && apart(&ran, &right, "m") < 2e-6, "{}", ran.text);
}

/// A body on springs whose place is far from the origin: the load is 1e-7 of the forces of the springs, which cancel.
#[test]
fn a_body_far_away_is_pressed() {
    let ran = |place: &str| {
        let scene = format!(
            "mesh box [0,0] to [1,1] cells [6,6] quad\nregion top = faces where y == 1\nregion low = faces where y == 0\n\
             unknown u : vector\nparam D = {place}\nstart u = [D,D]\nterm body on all : 100*Sym(Grad_u):Sym(Grad_Test_u)\n\
             term springs on all : 50*(u(2) - D)*Test_u(2)\nterm hard on all : 50*(u(2) - D)^3*Test_u(2)\n\
             load u = [0,-t] on top\nfix u(1) = D on low\nsteps t = 0 to 1 by 0.5\nmeasure m = mean(u(2) - D) on all\n"
        );
        run(&format!("offset-springs-{place}"), &scene, &[])
    };
    let (ran, right) = (ran("1e6"), ran("0"));
    assert!(ran.code == 0 && apart(&ran, &right, "m") < 2e-6, "{}", ran.text);
}

/// A bar of finite strain hits a wall that flies with it at 1e6: its inertia at the start of a step is 1e7 times the force of the impact. The force was
/// wrong by 0.7 %, the acceleration by 2 %.
#[test]
fn an_impact_in_uniform_flight() {
    let ran = |speed: &str| {
        let scene = format!(
            "param V = {speed}\nmesh box [0,0] to [1,0.5] cells [10,5] quad\nregion wall = faces where x == 0\nunknown u : vector\n\
             start Dot_u = [-0.2 + V,0.01*x]\ndef F = Id(2) + Grad_u\ndef C = Sym(Grad_u) + 1/2*Grad_u'*Grad_u\n\
             term inertia on all : Dot2_u.Test_u\nterm stress on all : 4*(F*(C + 0.5*Trace(C)*Id(2))):Grad_Test_u\n\
             def p = 300*pos_part(-(u(1) - V*t + 0.03))\nterm contact on wall : -p*Test_u(1)\nscheme newmark\n\
             steps t = 0 to 0.6 by 0.01\nmeasure P = integral(p) on wall\nmeasure v = mean(Dot_u(1) - V) on all\n"
        );
        run(&format!("offset-flight-{speed}"), &scene, &[])
    };
    let (right, slow, fast) = (ran("0"), ran("1e3"), ran("1e6"));
    for (ran, most) in [(slow, 1e-6), (fast, 1e-4)] {
        assert!(ran.code == 0 && apart(&ran, &right, "P") < most && apart(&ran, &right, "v") < most, "{}", ran.text);
    }
}

/// A temperature that the trapezoidal rule makes alternate from step to step is told beside any constant: it was not beside 1e4.
#[test]
fn values_that_alternate_are_told_beside_any_constant() {
    let ran = |c: &str, load: &str| {
        let scene = format!(
            "param c = {c}\nmesh box [0] to [1] cells [20] segment\nregion left = faces where x == 0\nunknown T : scalar\n\
             term heat on all : Dot_T*Test_T + 10*Grad_T.Grad_Test_T\nstart T = c\nload T = {load} on all\n\
             fix T = c + {load} on left\nscheme newmark\nsteps t = 0 to 1 by 0.1\nmeasure m = value(T - c) at [0.5]\n"
        );
        run(&format!("offset-rings-{c}-{load}"), &scene, &[])
    };
    for c in ["0", "293", "1e4", "1e6"] {
        assert!(ran(c, "1").tells("W652"), "{c}");
        assert!(!ran(c, "0*t").tells("W652"), "{c}");
    }
}

/// Two blocks of 1000 under a penalty of 100 that is softer than they are, both carried away: they overlap by
/// 0.01/(1 + 100/500) as at rest. A large way hid that; of a stiff penalty nothing is told.
#[test]
fn an_overlap_is_told_of_bodies_that_are_carried_along() {
    let text = |far: &str, turn: &str, gamma: &str| {
        format!(
            "param D = {far}\nparam w = {turn}\nmesh box [0,-1] to [1,1] cells [4,8] quad\nregion low = cells where y < 0\n\
             region up = cells where y > 0\nregion fault = interface from low to up\nregion foot = faces where y == -1\n\
             region top = faces where y == 1\nunknown u : vector\nsplit u across fault\n\
             def gap = (u - Interpolate(u, neighbor_element)).Normal\ndef p = {gamma}*pos_part(gap)\n\
             term body on all : 1000*Sym(Grad_u):Sym(Grad_Test_u)\n\
             term contact on fault : p*(Test_u - Interpolate(Test_u, neighbor_element)).Normal\n\
             fix u = [D - w*y, D + w*x] on foot\nfix u = [D - w*y, D + w*x - 0.01] on top\nmeasure overlap = max(gap) on fault\n"
        )
    };
    for (far, turn) in [("0", "0"), ("1e3", "0"), ("-1e6", "0"), ("0", "1"), ("1e3", "30")] {
        let ran = run(&format!("offset-overlap-{far}-{turn}"), &text(far, turn, "100"), &[]);
        assert!(
            ran.code == 0 && ran.tells("W606") && (ran.last("overlap") * 120.0 - 1.0).abs() < 1e-6,
            "{far} {turn}: {}",
            ran.text
        );
        let ran = run(&format!("offset-pressed-{far}-{turn}"), &text(far, turn, "1e6"), &[]);
        ran.assert_silent();
    }
}

/// The same of finite strains, turned by 70 degrees as a whole.
#[test]
fn an_overlap_is_told_of_bodies_that_turn() {
    let text = |gamma: &str| {
        format!(
            "param w = 1.2\ndef n = [-sin(w*t),cos(w*t)]\ndef turned = [(cos(w*t)-1)*x - sin(w*t)*y, sin(w*t)*x + (cos(w*t)-1)*y]\n\
             mesh box [0,-1] to [1,1] cells [4,8] quad\nregion low = cells where y < 0\nregion up = cells where y > 0\n\
             region fault = interface from low to up\nregion foot = faces where y == -1\nregion top = faces where y == 1\n\
             unknown u : vector\nsplit u across fault\ndef gap = (u - Interpolate(u, neighbor_element)).n\n\
             def p = {gamma}*pos_part(gap)\n\
             term body on all : 1000*((Id(2) + Grad_u)*(Sym(Grad_u) + 0.5*Grad_u'*Grad_u)):Grad_Test_u\n\
             term contact on fault : p*(Test_u - Interpolate(Test_u, neighbor_element)).n\n\
             fix u = turned on foot\nfix u = turned - 0.01*t*n on top\nsteps t = 0 to 1 by 0.25\n"
        )
    };
    for (gamma, told) in [("100", true), ("1e6", false)] {
        let ran = run(&format!("offset-turned-{gamma}"), &text(gamma), &[]);
        assert!(ran.code == 0 && ran.tells("W606") == told, "{gamma}: {}", ran.text);
    }
}

/// Rings that are pressed apart by what is inside move outwards alike, which strains them: that is no way that they only have in common.
#[test]
fn rings_that_widen_are_compared_with_their_widening() {
    let scene = "mesh box [10,0] to [10.2,0.1] cells [8,2] quad\nregion inner = cells where x < 10.1\nregion outer = cells where x > 10.1\n\
                 region joint = interface from inner to outer\nregion bore = faces where x == 10\nregion ends = faces where y == 0\n\
                 unknown u : vector\nsplit u across joint\ndef gap = (u - Interpolate(u, neighbor_element)).Normal\n\
                 term body on all : 1e5*(2*pi*x)*(Sym(Grad_u):Sym(Grad_Test_u) + u(1)*Test_u(1)/x^2)\n\
                 term contact on joint : 2*pi*x*1e5*pos_part(gap)*(Test_u - Interpolate(Test_u, neighbor_element)).Normal\n\
                 load u = [2*pi*x*1,0] on bore\nfix u(2) = 0 on ends\nmeasure overlap = max(gap) on joint\n\
                 measure widened = mean(u(1)) on bore\n";
    let ran = run("offset-rings", scene, &[]);
    // thin rings: E u/r = p r/thickness, and half of the pressure crosses the joint
    assert!(ran.code == 0 && (ran.last("widened") / 5.1e-3 - 1.0).abs() < 0.05, "{}", ran.text);
    assert!((ran.last("overlap") / 5e-6 - 1.0).abs() < 0.1 && !ran.tells("W606"), "{}", ran.text);
}

/// A temperature that a wrong sign makes grow from nothing beside a constant: it was told of a constant of zero alone.
#[test]
fn growth_without_end_is_told_beside_any_constant() {
    let ran = |c: &str, sign: &str| {
        let scene = format!(
            "param c = {c}\nmesh box [0] to [1] cells [10] segment\nregion left = faces where x == 0\nunknown T : scalar\n\
             start T = c + 1e-9*x\nterm stored on all : Dot_T*Test_T\n\
             term flow on all : 0.3*Grad_T.Grad_Test_T {sign} 4*(T - c)*Test_T\nfix T = c on left\nsteps t = 0 to 5 by 0.02\n"
        );
        run(&format!("offset-growth-{c}-{}", sign.len()), &scene, &[])
    };
    for c in ["0", "293", "-1e3"] {
        assert!(ran(c, "-").tells("W647"), "{c}");
        ran(c, "+ 0*t +").assert_silent();
    }
}

/// A bar far stiffer than its support moves by F/k = 1. Of so few equations the residual may be zero by accident, whatever the state: it
/// moved by 0.998 at a stiffness of 1e12, with no word of its digits.
#[test]
fn a_residual_that_is_zero_by_accident_is_no_solution() {
    for stiff in ["1e6", "1e9", "1e11", "0.9e12", "1e12", "1.1e12", "1e13"] {
        let scene = format!(
            "mesh box [0] to [1] cells [10] segment\nregion left = faces where x == 0\nregion right = faces where x == 1\n\
             unknown T : scalar\nstart T = 0\nterm bar on all : {stiff}*Grad_T.Grad_Test_T\nterm support on left : T*Test_T\n\
             load T = 1 on right\nmeasure d = mean(T) on left\n"
        );
        let ran = run(&format!("offset-zero-{stiff}"), &scene, &[]);
        assert!(ran.code == 0 && (ran.last("d") - 1.0).abs() < 1e-6, "{stiff}: {}", ran.text);
    }
}
