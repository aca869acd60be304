//! What a run says of what happens within its steps: the energy that friction takes from bodies with closed forms, in few
//! and in many steps, and formulas that no listed step sees.

use super::{Ran, run};

/// The stiffness of the block and of the penalty in series, and the coefficient of friction.
const STIFFNESS: f64 = 1.0 / (1.0 / 1e3 + 1.0 / 1e6);
const FRICTION: f64 = 0.3;

/// A bundle of springs on a floor whose top is pressed down by `press` and drawn along by `drag`.
fn block(press: &str, drag: &str, steps: &str) -> String {
    format!(
        "mesh box [0,0] to [1,1] cells [1,1] quad\nregion floor = faces where y == 0\nregion top = faces where y == 1\n\
         unknown u : vector\ndef tang(w) = w - (w.Normal)*Normal\nterm block on all : 1e3*Grad_u:Grad_Test_u\n\
         def press = 1e6*pos_part(u.Normal)\ndef trial = 1e6*(tang(u) - Previous_slid)\n\
         def q = Ball_projection(trial, {FRICTION}*press)\nstate slid : vector on floor := tang(u) - q/1e6\n\
         term contact on floor : (press*Normal + q).Test_u\nsteps {steps}\nfix u = [{drag}, -({press})] on top\n\
         measure F = reaction(u(1)) on top\nmeasure N = reaction(u(2)) on top\nmeasure a = mean(u(1)) on top\n\
         measure d = mean(u(2)) on top\n"
    )
}

fn drawn(name: &str, press: &str, drag: &str, n: u32) -> Ran {
    let ran = run(name, &block(press, drag, &format!("t = 0 to 1 by 1/{n}")), &[]);
    assert_eq!(ran.code, 0, "{}", ran.text);
    ran
}

/// What friction takes from the same block by the closed form of one spring, summed over many small steps.
fn exact(press: impl Fn(f64) -> f64, drag: impl Fn(f64) -> f64) -> f64 {
    let n = 200_000;
    let (mut held, mut taken) = (0.0f64, 0.0);
    for k in 1..=n {
        let [from, to] = [k - 1, k].map(|k| f64::from(k) / f64::from(n));
        let [before, bound] = [from, to].map(|t| FRICTION * STIFFNESS * press(t).max(0.0));
        let trial = held + STIFFNESS * (drag(to) - drag(from));
        held = trial.clamp(-bound, bound);
        taken += 0.5 * (before + bound) * (trial - held).abs() / STIFFNESS;
    }
    taken
}

#[test]
fn loads_in_proportion_dissipate_the_same_in_any_number_of_steps() {
    // the bound is f k D t and the slip (A - f D) t
    let [press, drag] = [5e-3, 2e-2];
    let closed = FRICTION * STIFFNESS * press * (drag - FRICTION * press) / 2.0;
    for n in [1, 2, 7, 64] {
        let work = drawn("in-proportion", "5e-3*t", "2e-2*t", n).friction_work();
        assert!((work / closed - 1.0).abs() < 1e-9, "{n} steps: {work} for {closed}");
    }
    // pressed at first and drawn behind: it sticks up to f D
    let closed = FRICTION * STIFFNESS * press * (drag - FRICTION * press);
    for n in [1, 3, 20] {
        let work = drawn("in-proportion", "5e-3", "2e-2*t", n).friction_work();
        assert!((work / closed - 1.0).abs() < 1e-9, "{n} steps: {work} for {closed}");
    }
}

#[test]
fn one_solve_dissipates_what_a_load_in_proportion_does() {
    let [press, drag] = [5e-3, 2e-2];
    let closed = FRICTION * STIFFNESS * press * (drag - FRICTION * press) / 2.0;
    for steps in ["t = 1 to 2 by 1", "t = 1 to 2 by 0.25"] {
        let ran = run("one-solve", &block("5e-3*min(t,1)", "2e-2*min(t,1)", steps), &[]);
        let work = ran.friction_work();
        assert!((work / closed - 1.0).abs() < 1e-9, "{steps}: {work} for {closed}");
    }
}

#[test]
fn dissipation_is_of_second_order_in_the_step() {
    let wave = exact(|t| 5e-3 * (1.0 + 0.5 * (5.0 * t).sin()), |t| 0.05 * t);
    let closes = exact(|t| 5e-3 * t - 1.3e-3, |t| 0.02 * t);
    let opens = exact(|t| 5e-3 - 7e-3 * t, |t| 0.02 * t);
    let turns = exact(|t| 5e-3 * (1.0 + 0.5 * t), |t| 4e-3 * (4.0 * std::f64::consts::PI * t).sin());
    for (press, drag, right) in [
        ("5e-3*(1 + 0.5*sin(5*t))", "0.05*t", wave),
        ("5e-3*t - 1.3e-3", "0.02*t", closes),
        ("5e-3 - 7e-3*t", "0.02*t", opens),
        ("5e-3*(1 + 0.5*t)", "4e-3*sin(4*pi*t)", turns),
    ] {
        let missed = [16, 64].map(|n| (drawn("second-order", press, drag, n).friction_work() / right - 1.0).abs());
        // where it begins to slide, closes or opens within a step an error of the square of one step more is left
        assert!(missed[0] < 1e-2 && missed[1] < 1e-3, "{press}, {drag}: {missed:?}");
    }
}

#[test]
fn the_work_of_supports_is_stored_or_dissipated() {
    for (press, drag) in [("5e-3*(1 + 0.5*sin(5*t))", "0.05*t"), ("5e-3*(1 + 0.5*t)", "4e-3*sin(4*pi*t)")] {
        let missed = [64, 256].map(|n| {
            let ran = drawn("work-of-supports", press, drag, n);
            let of = |step: u32, name: &str| ran.measure(step as usize, name);
            let work: f64 = (1..=n)
                .flat_map(|k| [("F", "a"), ("N", "d")].map(|(f, u)| (k, f, u)))
                .map(|(k, f, u)| 0.5 * (of(k, f) + of(k - 1, f)) * (of(k, u) - of(k - 1, u)))
                .sum();
            let stored = |k: u32| (of(k, "F").powi(2) + of(k, "N").powi(2)) / (2.0 * STIFFNESS);
            ((work.abs() - (stored(n) - stored(0))) / ran.friction_work() - 1.0).abs()
        });
        assert!(missed[0] < 5e-3 && missed[1] < 5e-4, "{press}: {missed:?}");
    }
}

/// A block with inertia that is pressed and drawn: contact has taken what its springs store and friction dissipates.
#[test]
fn contact_takes_up_what_it_stores_and_dissipates() {
    for n in [4, 32] {
        let still = block("5e-3*t^2", "2e-2*t^2", &format!("t = 0 to 1 by 1/{n}"));
        let scene =
            still.replace("term block", "term mass on all : 0.1*Dot2_u.Test_u\nscheme newmark energy=0.9\nterm block");
        let ran =
            run("contact-takes", &format!("{scene}measure stored = integral((sqr(press) + q.q)/2e6) on floor\n"), &[]);
        assert_eq!(ran.code, 0, "{}", ran.text);
        let (taken, work) = (ran.last("energy_contact") - ran.last("stored"), ran.friction_work());
        assert!((taken / work - 1.0).abs() < 1e-3, "{n} steps: {taken} for {work}");
    }
}

/// A bar that is warmed by what `source` says, with these steps.
fn warmed(source: &str, steps: &str, storage: &str) -> String {
    format!(
        "mesh box [0] to [1] cells [4] segment\nunknown T : scalar\nterm storage on all : {storage}*Test_T\n\
         term flow on all : Grad_T.Grad_Test_T\nload T = {source} on all\nsteps {steps}\n"
    )
}

#[test]
fn what_no_listed_step_sees_is_told() {
    let rate = "Dot_T";
    for (source, steps) in [
        ("(if abs(t - 0.5503) < 5e-3 then 1 else 0)", "t = 0 to 1 by 0.1"),
        ("exp(-sqr((t - 0.35)/1e-3))", "t = 0 to 1 by 0.1"),
        ("sin(20*pi*t)", "t = 0 to 1 by 0.1"),
        ("sin(20*pi*t)", "t = 0 to 1 by 0.05"),
        ("exp(-sqr((x - t)/0.02))", "t = 0 to 1 by 1/3"),
        ("(1 + x)*(if t > 0.31 then if t < 0.311 then 1 else 0 else 0)", "t = 0 to 1 by 0.25"),
    ] {
        let ran = run("overlooked", &warmed(source, steps, rate), &[]);
        assert!(ran.code == 0 && ran.tells("W425"), "{source}, {steps}: {}", ran.text);
        assert!(ran.marked("W425").contains("load T"), "{}", ran.text);
    }
    for (source, steps) in [
        ("(if abs(t - 0.5503) < 5e-3 then 1 else 0)", "t = 0 to 1 by 1/400"),
        ("(if t > 0.55 then 1 else 0)", "t = 0 to 1 by 0.1"),
        ("exp(-sqr((t - 0.35)/0.1))", "t = 0 to 1 by 0.05"),
        ("sin(20*pi*t)", "t = 0 to 1 by 0.02"),
        ("exp(-30*t)", "t = 0 to 1 by 0.1"),
        ("abs(t - 0.5)", "t = 0 to 1 by 0.1"),
        ("1e6 + 1e-9*sin(20*pi*t)", "t = 0 to 1 by 0.1"),
        ("sin(20*pi*t)", "t = 0 to 1 by auto with error=1e-2"),
    ] {
        let ran = run("seen", &warmed(source, steps, rate), &[]);
        assert!(ran.code == 0 && !ran.tells("W425"), "{source}, {steps}: {}", ran.text);
    }
    // without a memory the state at a step is that of the values there
    let ran = run("no-memory", &warmed("sin(20*pi*t)", "t = 0 to 1 by 0.1", "T"), &[]);
    assert!(ran.code == 0 && !ran.tells("W425"), "{}", ran.text);
}
