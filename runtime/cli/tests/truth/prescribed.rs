//! Motions that are prescribed over the step variable: their accelerations, rates and the forces that carry them.

use super::run;

/// A rigid body of mass 1 that is shaken as a whole: its support carries minus mass times acceleration.
fn shaken(from: &str, motion: &str, steps: &str) -> String {
    format!(
        "param T0 = {from}\nmesh box [0,0] to [1,1] cells [1,1] quad\nunknown u : vector\nstart u = [0,0]\nstart Dot_u = [1,0]\n\
         term m on all : Dot2_u.Test_u\nfix u = [{motion},0] on boundary\nsteps t = T0 to T0+1 by {steps}\n\
         measure R = reaction(u(1)) on boundary\n"
    )
}

/// A shift of the variable rounds it: of a formula that is differenced twice that may be all there is, and is told.
#[test]
fn accelerations_of_a_time_far_from_zero_are_told_where_they_are_rounding() {
    let sine = "sin(t - T0)";
    for (k, (from, motion, steps)) in [
        ("1.7e9", sine, "1e-3"),
        ("-1.7e9", sine, "1e-3"),
        ("1.7e9", sine, "5e-3"),
        ("1.7e9", sine, "1e-3\nscheme bdf2"),
        ("1.7e9", sine, "1e-3\nscheme explicit"),
        ("1.7e9", sine, "auto with first=1e-3"),
        ("1.7e9", "(if t > T0 + 0.5 then t - T0 else 0.5) + 0*x", "1e-3"),
        ("1.7e9", "(t - T0)*(1 + 0.1*x)", "1e-3"),
        ("1e7", sine, "1e-3"),
        ("1e5", "sin(0.01*(t - T0))", "1e-3"),
    ]
    .into_iter()
    .enumerate()
    {
        let ran = run(&format!("shaken-{k}"), &shaken(from, motion, steps), &[]);
        assert!(
            ran.tells("W421") && ran.text.contains("accelerations of `u`"),
            "{from} {motion} {steps}: {}",
            ran.text
        );
    }
    for (k, (from, motion, steps)) in [
        ("0", sine, "1e-3"),
        ("1e5", sine, "1e-3"),
        ("1e5", "1000 + 2*(t - T0)", "1e-3"),
        ("1.7e9", sine, "0.1"),
        ("1.7e9", "0", "1e-3"),
        ("0", "t", "1e-3"),
        ("0", "if t > 0.5 then 1 else 0", "1e-3"),
        ("0", "min(t, 0.5)", "2e-5"),
        ("0", sine, "auto"),
    ]
    .into_iter()
    .enumerate()
    {
        let ran = run(&format!("shaken-right-{k}"), &shaken(from, motion, steps), &[]);
        assert!(ran.code == 0 && !ran.tells("W421"), "{from} {motion} {steps}: {}", ran.text);
        if motion == sine && steps == "1e-3" {
            assert!((ran.last("R") - 1f64.sin()).abs() < 1e-4, "{from}: {}", ran.last("R"));
        }
    }
    // rates are differenced once
    let heat = |from: &str| {
        format!(
            "param T0 = {from}\nmesh box [0] to [1] cells [4] segment\nregion left = faces where x == 0\nunknown T : scalar\n\
             term heat on all : Dot_T*Test_T + Grad_T.Grad_Test_T\nfix T = sin(t - T0) on left\n\
             steps t = T0 to T0+1 by 1e-3\nmeasure F = reaction(T) on left\n"
        )
    };
    let [near, far] = ["0", "1.7e9"].map(|from| run(&format!("heated-{from}"), &heat(from), &[]));
    assert!((near.last("F") / far.last("F") - 1.0).abs() < 1e-3, "{} {}", near.last("F"), far.last("F"));
    assert!(!far.tells("W421"), "{}", far.text);
}

/// An oscillator, q = cos 2t, that needs smaller increments near t = 1 on account of another unknown.
fn oscillator(scheme: &str, measure: &str) -> String {
    format!(
        "mesh box [0] to [1] cells [1]\nunknown q : scalar global\nunknown r : scalar global\nstart q = 1\nstart r = 1\n\
         term m on global : Dot2_q*Test_q\nterm s on global : 4*q*Test_q\n\
         term b on global : (r - 1 + (if timestep > 0.02 and abs(t-1) < 0.06 then 2*sign(r) else 0))*Test_r\n\
         scheme {scheme}\nsteps t = 0 to 2 by 0.05\nmeasure m = value({measure}) at [0]\n"
    )
}

/// A rate is a value at the end of a step; an amount of the step is made of the increment or of the value before.
#[test]
fn a_rate_behind_a_step_in_parts_is_no_amount_of_it() {
    for scheme in ["newmark", "bdf2"] {
        for (k, rate) in ["Dot_q", "Dot_q^2/2", "Dot2_q", "q*Dot_q"].into_iter().enumerate() {
            let ran = run(&format!("rate-{scheme}-{k}"), &oscillator(scheme, rate), &[]);
            assert!(ran.code == 0 && ran.text.contains("solved in smaller increments"), "{}", ran.text);
            assert!(!ran.tells("W651"), "{scheme} {rate}: {}", ran.text);
        }
        for (k, (amount, at_most)) in [("q - Previous_q", 0.1), ("abs(Dot_q)*timestep", 0.1)].into_iter().enumerate() {
            let ran = run(&format!("amount-{scheme}-{k}"), &oscillator(scheme, amount), &[]);
            assert!(ran.tells("W651"), "{scheme} {amount}: {}", ran.text);
            // q changes by 2 in a unit of t at most
            let told = ran.text.split("over the step it is ").nth(1).and_then(|s| s.split_whitespace().next());
            let whole: f64 = told.and_then(|word| word.parse().ok()).unwrap_or(f64::NAN);
            assert!(whole.abs() <= 1.05 * at_most, "{scheme} {amount}: {whole} {}", ran.text);
        }
    }
    let flow = "mesh box [0] to [1] cells [1] segment\nunknown d : scalar global\nsteps t = 0 to 2 by 1\n\
                term law on global : (exp(d) - 1 - 100*t + 0.001*Dot_d)*Test_d\nsolver newton with max_iter=5\n\
                measure speed = mean(Dot_d) on all\n";
    let ran = run("rate-difference", flow, &[]);
    assert!(ran.text.contains("solved in smaller increments") && !ran.tells("W651"), "{}", ran.text);
}

/// A block whose base is turned by 90 degrees, with a dead load on its top. A moment with the arms of the current place is not
/// linear in the unknown, though its products cancel.
#[test]
fn a_moment_of_reactions_about_the_current_place_is_that_or_refused() {
    let scene = |moment: &str| {
        format!(
            "mesh box [0,0] to [1,2] cells [4,8] quad\nregion base = faces where y == 0\nregion top = faces where y == 2\n\
             unknown u : vector Q2\ndef F = Id(2)+Grad_u\ndef C = Sym(Grad_u)+1/2*Grad_u'*Grad_u\n\
             term s on all : 1000*(F*(C+0.5*Trace(C)*Id(2))):Grad_Test_u\nsteps t = 0 to 1 by 0.1\ndef th = pi/2*t\n\
             fix u = [cos(th),-sin(th);sin(th),cos(th)]*X - X on base\nload u = [0,-10] on top\nmeasure M = {moment} on base\n\
             measure L = integral(-10*(x+u(1))) on top\n"
        )
    };
    for (k, moment) in [
        "(x+u(1))*u(2) - (y+u(2))*u(1)",
        "(x+2*u(1))*u(2)",
        "x*u(2) - y*u(1) + u(1)^2 - u(1)*u(1)",
        "(X+u).[u(2),-u(1)]",
        "Det([x+u(1),y+u(2);u(1),u(2)])",
    ]
    .into_iter()
    .enumerate()
    {
        let ran = run(&format!("moment-{k}"), &scene(&format!("reaction({moment})")), &[]);
        assert!(ran.tells("E460") && ran.text.contains("not linear"), "{moment}: {}", ran.text);
    }
    let turned = "cos(th)*reaction(x*u(2) - y*u(1)) - sin(th)*reaction(x*u(1) + y*u(2))";
    let ran = run("moment-turned", &scene(turned), &[]);
    assert!(ran.code == 0 && (ran.last("M") / ran.last("L") - 1.0).abs() < 1e-9, "{}", ran.text);
    let ran =
        run("moment-twice", &scene("reaction(x*u(2) - y*u(1) + 2*u(2) - (if x > 0.5 then u(2) else 2*u(2)))"), &[]);
    assert_eq!(ran.code, 0, "{}", ran.text);
    let ran = run("moment-parameter", &scene("reaction((x + 0*u(1))*u(2) - y*u(1))"), &[]);
    assert!(ran.code == 0, "{}", ran.text);
}
