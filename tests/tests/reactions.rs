//! `reaction(u(1)) on r`: what prescribed values carry is what loads bring, in every kind of step.

use wfl_tests::{Solved, refused, solved};

/// Forces balance to this part of the load.
const EXACT: f64 = 1e-12;

fn are(found: &Solved, step: usize, list: &[(&str, f64)], scale: f64) {
    for (name, should) in list {
        let is = found.measure(step, name);
        assert!((is - should).abs() < EXACT * scale, "{name}: {is}, {should}");
    }
}

const BLOCK: &str = "mesh box [0,0] to [2,1] cells [8,4] quad\nregion west = faces where x == 0\n\
    region east = faces where x == 2\nunknown u : vector Q2\n\
    term elastic on all : 70*Trace(Grad_u)*Div_Test_u + 120*Sym(Grad_u):Grad_Test_u\nfix u = [0,0] on west\n";

#[test]
fn a_support_carries_the_load_and_its_moment() {
    let found = solved(format!(
        "{BLOCK}load u = [3,-2] on east\nparam d = [0.6,0.8]\n\
         measure pull = reaction(u(1)) on west\nmeasure down = reaction(u.[0,1]) on west\n\
         measure slanted = reaction(u.d) on west\nmeasure less = reaction(-2*u(1)) on west\n\
         measure moment = reaction(x*u(2) - y*u(1)) on west\n"
    ));
    // the load acts at x = 2 and on average at y = 1/2
    let list = [("pull", 3.0), ("down", -2.0), ("slanted", 0.2), ("less", -6.0), ("moment", -5.5)];
    are(&found, 0, &list, 10.0);
}

/// Supports that no axis fits: the equations of their nodes are turned.
#[test]
fn inclined_supports_carry_what_acts_along_their_normals() {
    let map = "[0.8*x - 0.6*y, 0.6*x + 0.8*y]";
    let found = solved(format!(
        "mesh box [0,0] to [2,1] cells [8,4] quad map {map}\nregion floor = faces where 0.8*y - 0.6*x == 0\n\
         region wall = faces where 0.8*x + 0.6*y == 0\nregion ceiling = faces where 0.8*y - 0.6*x == 1\n\
         unknown u : vector Q2\nterm elastic on all : 70*Trace(Grad_u)*Div_Test_u + 120*Sym(Grad_u):Grad_Test_u\n\
         fix u.Normal = 0 on floor, wall\nload u = [-3,-1] on ceiling\n\
         measure pull = reaction(u(1)) on floor, wall\nmeasure up = reaction(u(2)) on floor, wall\n\
         measure of_floor = reaction(u.[-0.6,0.8]) on floor\n"
    ));
    // the load of the ceiling across the floor: (-3, -1).(-0.6, 0.8) on a length of 2
    are(&found, 0, &[("pull", -6.0), ("up", -2.0), ("of_floor", 2.0)], 10.0);
}

/// What is pressed into a rough floor is carried by the grip; the curve of force over displacement has its corner where
/// all slides.
#[test]
fn a_grip_carries_friction_in_every_step() {
    let found = solved(
        "mesh box [0,0] to [2,1] cells [8,4] quad\nregion floor = faces where y == 0\nregion top = faces where y == 1\n\
         unknown u : vector\nparam gamma = 1e4\n\
         def force = pos_part(-gamma*u(2))*[0,-1] + Ball_projection(gamma*[u(1),0], 0.3*pos_part(-gamma*u(2)))\n\
         term elastic on all : 700*Trace(Grad_u)*Div_Test_u + 1200*Sym(Grad_u):Grad_Test_u\n\
         term contact on floor : force.Test_u\nfix u(2) = -0.01 on top\nfix u(1) = t on top\n\
         steps t = 0 to 0.02 by 0.005\nmeasure down = reaction(u(2)) on top\nmeasure pull = reaction(u(1)) on top\n\
         measure pressed = integral(force(2)) on floor\nmeasure held = integral(force(1)) on floor\n\
         event slides = abs(reaction(u(1))) on top > 0.29*5\n",
    );
    for step in 0..found.outcome.steps.len() {
        let [down, pressed] = ["down", "pressed"].map(|m| found.measure(step, m));
        let [along, held] = ["pull", "held"].map(|m| found.measure(step, m));
        // Newton leaves 1e-10 of the forces in the free equations
        assert!((down + pressed).abs() < 1e-8 * pressed.abs(), "{step}: {down} {pressed}");
        assert!((along + held).abs() < 1e-8 * pressed.abs(), "{step}: {along} {held}");
    }
    let last = found.outcome.steps.len() - 1;
    let [down, along] = ["down", "pull"].map(|m| found.measure(last, m));
    assert!((along.abs() / down.abs() - 0.3).abs() < 1e-9, "{along} {down}");
}

/// Rates, the past and states are those of the step.
#[test]
fn rates_and_states_of_the_step_are_in_its_reactions() {
    let found = solved(
        "mesh box [0] to [1] cells [10] segment\nregion left = faces where x == 0\nregion right = faces where x == 1\n\
         unknown p : scalar\nstate s : scalar on all := Previous_s + timestep*p\n\
         term storage on all : (2*Dot_p + Previous_s)*Test_p + 3*Grad_p.Grad_Test_p\nfix p = 0 on left\n\
         load p = 5 on right\nsteps t = 0 to 1 by 0.1\n\
         measure out = reaction(p) on left\nmeasure stored = integral(2*(p - Previous_p)/0.1 + Previous_s) on all\n",
    );
    for step in 1..found.outcome.steps.len() {
        let [out, stored] = ["out", "stored"].map(|m| found.measure(step, m));
        assert!((out + stored - 5.0).abs() < 1e-11, "{step}: {out} {stored}");
    }
}

#[test]
fn what_carries_nothing_is_refused() {
    for (line, says) in [
        ("measure f = reaction(u(1)) on east", "no value of `u` is prescribed on `east`"),
        ("measure f = reaction(Norm(u)) on west", "this is not linear in `u`"),
        ("measure f = reaction(u(1) + 1) on west", "this is not linear in `u`"),
        ("measure f = reaction(x) on west", "a reaction is that of one unknown"),
        ("measure f = reaction(u) on west", "one component of the reaction: reaction(u(1))"),
        ("measure f = reaction(u(1)) at [0,0]", "E113"),
        ("measure f = reaction(Grad(u(1)).[1,0]) on west", "not of `Grad` of them"),
        ("measure f = reaction(u(1) + Div(u)) on west", "not of `Div` of them"),
        ("measure f = reaction(Diff(u.u, u, [1,0])) on west", "not of `Diff` of them"),
    ] {
        let told = refused(&format!("{BLOCK}load u = [3,-2] on east\n{line}\n"));
        assert!(told.contains(says), "{line}: {told}");
    }
    let told = refused(
        "mesh box [0] to [1] cells [4] segment\nregion left = faces where x == 0\nunknown u : scalar\n\
         term inertia on all : Dot2_u*Test_u\nterm bar on all : Grad_u.Grad_Test_u\nfix u = 0 on left\nstart u = x\n\
         scheme explicit\nsteps t = 0 to 1 by auto\nmeasure f = reaction(u) on left\n",
    );
    assert!(told.contains("E460") && told.contains("explicit"), "{told}");
}

/// What multiplies a reaction is found once, before the run: it may not change from step to step.
#[test]
fn a_reaction_that_turns_in_time_is_refused() {
    let scene = |reaction: &str| {
        format!("{BLOCK}load u = [t,0] on east\nsteps t = 1 to 3 by 1\nmeasure pull = reaction({reaction}) on west\n")
    };
    for reaction in ["t*u(1)", "(if t > 1.5 then 2 else 1)*u(1)", "cos(t)*u(1) + sin(t)*u(2)"] {
        let told = refused(&scene(reaction));
        assert!(told.contains("error[E460]") && told.contains("a number, or one of the position"), "{told}");
    }
    for reaction in ["abs(u(1))", "(if u(1) > 0.3 then 1 else 0)*u(1)"] {
        let told = refused(&scene(reaction));
        assert!(told.contains("error[E460]") && told.contains("not linear"), "{told}");
    }
}

/// A bar of mass 1 that is shaken at both ends as a whole, u = 0.1 sin 3t: mass times acceleration is the force of the supports,
/// with an error of second order, in single steps and not on average.
#[test]
fn a_shaken_support_carries_mass_times_acceleration() {
    let error = |scheme: &str, start: &str, n: u32| {
        let found = solved(format!(
            "mesh box [0] to [1] cells [1] segment\nregion ends = faces where x*(1 - x) == 0\nunknown u : scalar\n\
             term bar on all : Grad_u.Grad_Test_u\nterm mass on all : Dot2_u*Test_u\n\
             fix u = 0.1*sin(3*t) on ends\nstart Dot_u = {start}\n{scheme}\nsteps t = 0 to 1 by 1/{n}\n\
             measure F = reaction(u) on ends\nmeasure a = value(Dot2_u) at [0]\n"
        ));
        let of = |step: usize| {
            let exact = -0.9 * (3.0 * found.outcome.steps[step].window.end).sin();
            let [force, acceleration] = ["F", "a"].map(|name| found.measure(step, name));
            (force + exact).abs().max((acceleration - exact).abs())
        };
        // the first three steps know no earlier ones
        (4..found.outcome.steps.len()).map(of).fold(0.0, f64::max)
    };
    for (scheme, start) in [("", "0.3"), ("scheme newmark beta=0.3025 gamma=0.6", "0.3"), ("scheme bdf2", "0.3")] {
        let (coarse, fine) = (error(scheme, start, 50), error(scheme, start, 100));
        assert!(fine < 2e-3 && fine < 0.3 * coarse, "{scheme}: {coarse} {fine}");
    }
}

/// Heat flows into a wall whose temperature rises and then stays: a rate that is given is that of the formula, and is forgotten.
#[test]
fn a_temperature_that_stays_has_no_rate() {
    let found = solved(
        "mesh box [0] to [1] cells [8] segment\nregion west = faces where x == 0\nunknown T : scalar\n\
         term heat on all : Dot_T*Test_T + Grad_T.Grad_Test_T\nfix T = min(10*t, 1) on west\n\
         scheme newmark\nsteps t = 0 to 0.5 by 0.01\nmeasure flux = reaction(T) on west\n\
         measure stored = integral(Dot_T) on all\nmeasure rate = value(Dot_T) at [0]\n",
    );
    let last = found.outcome.steps.len() - 1;
    let [flux, stored, rate] = ["flux", "stored", "rate"].map(|name| found.measure(last, name));
    assert!(rate.abs() < 1e-12 && (flux + stored).abs() < 1e-12, "{rate} {flux} {stored}");
}

/// A load is minus a term: both are followed in whatever they read.
#[test]
fn a_load_that_reads_unknowns_is_the_term() {
    let pairs = [
        ("unknown g : scalar global\nterm hold on global : (g - 3)*Test_g\n", "g"),
        ("", "1 - u"),
        ("", "1/(1 + u^2)"),
        ("", "pos_part(1 - u)"),
        ("", "1 - 0.3*Previous_u - Grad_u(1)"),
    ];
    for (more, load) in pairs {
        let value = |statement: &str| {
            let text = format!(
                "mesh box [0] to [1] cells [4] segment\nregion west = faces where x == 0\nregion east = faces where x == 1\n\
                 unknown u : scalar\n{more}term bar on all : Grad_u.Grad_Test_u\nfix u = 0 on west\n{statement}\n\
                 steps t = 1 to 3 by 1\nmeasure end = value(u) at [1]\n"
            );
            solved(text).measure(2, "end")
        };
        let (of_load, of_term) =
            (value(&format!("load u = {load} on east")), value(&format!("term pull on east : -({load})*Test_u")));
        assert!((of_load - of_term).abs() < EXACT && of_load.abs() > 0.1, "{load}: {of_load} {of_term}");
    }
}

/// A free bar that is moved at one end: the support carries the inertia of all of it, and the far end is that of other schemes, for
/// a motion that begins smoothly and for one that jumps in the first step.
#[test]
fn a_support_that_moves_carries_the_inertia_of_the_bar() {
    let bar = |motion: &str, start: &str, scheme: &str, n: u32| {
        let reaction = if scheme.starts_with("newmark") || scheme.starts_with("bdf") {
            "measure r = reaction(u) on right\n"
        } else {
            "measure r = 0\n"
        };
        let found = solved(format!(
            "mesh box [0] to [1] cells [4] segment\nregion right = faces where x == 1\nunknown u : scalar\n\
             term bar on all : Grad_u.Grad_Test_u + Dot2_u*Test_u\nfix u = {motion} on right\nstart Dot_u = {start}\n\
             scheme {scheme}\nsteps t = 0 to 1 by 1/{n}\n{reaction}measure a = integral(Dot2_u) on all\n\
             measure end = value(u) at [0]\n"
        ));
        let last = found.outcome.steps.len() - 1;
        ["r", "a", "end"].map(|name| found.measure(last, name))
    };
    for (motion, start, size) in [("0.1*sin(3*t)", "0.3", 1e-2), ("0.1 + 1e-9*t", "0", 0.1), ("0.1", "0", 0.1)] {
        let [.., exact] = bar(motion, start, "bdf2", 4000);
        for scheme in ["newmark", "newmark beta=0.3025 gamma=0.6", "hht alpha=-0.1", "generalised_alpha rho_inf=0.5"] {
            let [r, a, end] = bar(motion, start, scheme, 1000);
            assert!(scheme.contains("alpha") || (r + a).abs() < 1e-9 * a.abs().max(1.0), "{motion} {scheme}: {r} {a}");
            assert!((end - exact).abs() < 2e-2 * size, "{motion} {scheme}: {end}, {exact}");
        }
    }
}
