//! What comes back from a stiff contact in steps that the run chooses has the energy that it came with.

use super::run;

/// The largest of a measure over all steps.
fn most(ran: &super::Ran, name: &str) -> f64 {
    (0..ran.steps()).map(|step| ran.measure(step, name)).fold(f64::NEG_INFINITY, f64::max)
}

/// A ball falls on a stiff floor, once and again: whatever the scheme, the floor and the demanded error, and whether weight and floor are
/// one term or two, it has its energy for ever. The alpha methods gave it 10,000 times that; BDF2 and Newmark's rule took all.
#[test]
fn a_ball_keeps_its_energy_on_a_stiff_floor() {
    let together = "term all on global : (Dot2_q + 10 - k*pos_part(-q))*Test_q";
    let apart = "term inertia on global : Dot2_q*Test_q\nterm weight on global : 10*Test_q\n\
                 term floor on global : -k*pos_part(-q)*Test_q";
    let schemes = ["bdf2", "newmark", "generalised_alpha rho_inf=0.5", "generalised_alpha rho_inf=1", "hht alpha=-0.3"];
    for scheme in schemes {
        for (k, error, lost) in
            [("1e3", "1e-4", 0.03), ("1e5", "1e-4", 0.03), ("1e9", "1e-3", 0.1), ("1e5", "1e-6", 1e-3)]
        {
            let terms = if k == "1e5" { together } else { apart };
            let scene = format!(
                "param k = {k}\nmesh box [0] to [1] cells [1]\nunknown q : scalar global\nstart q = 1\n{terms}\nscheme {scheme}\n\
                 steps t = 0 to 5 by auto with error={error}\n\
                 measure total = value(Dot_q^2/2 + 10*q + k/2*pos_part(-q)^2) at [0]\n"
            );
            let ran = run(&format!("bounce-{}-{k}-{error}", scheme.replace([' ', '='], "-")), &scene, &[]);
            ran.assert_silent();
            let (end, largest) = (ran.last("total"), most(&ran, "total"));
            // what is demanded is an error of each step, and a contact has a few that are as long as they may be
            let gained = 5.0 * error.parse::<f64>().unwrap().max(4e-4);
            assert!((end / 10.0 - 1.0).abs() < lost, "{scheme} {k} {error}: {end}");
            assert!(largest < 10.0 * (1.0 + gained), "{scheme} {k} {error}: {largest}");
            assert!(ran.steps() < 3000, "{scheme} {k} {error}: {} steps", ran.steps());
        }
    }
}

/// An elastic bar that rebounds from a penalty: 500 before, during and behind the contact; the alpha method made 894 of it. The fronts of its
/// waves need no more steps than without the contact's own.
#[test]
fn a_bar_keeps_its_energy_against_a_stiff_wall() {
    for (scheme, error) in
        [("generalised_alpha rho_inf=0.8", "1e-3"), ("generalised_alpha rho_inf=0.8", "1e-4"), ("newmark", "1e-4")]
    {
        let scene = format!(
            "mesh box [0] to [10] cells [20]\nregion wall = faces where x == 0\nunknown u : scalar\nstart Dot_u = -10\nstart u = 1\n\
             term inertia on all : Dot2_u*Test_u\nterm stress on all : 900*Grad_u.Grad_Test_u\n\
             def p = 1e4*pos_part(-u)\nterm contact on wall : -p*Test_u\nscheme {scheme}\n\
             steps t = 0 to 1.5 by auto with error={error}, first=1e-3\n\
             measure total = integral(0.5*Dot_u*Dot_u + 450*Norm_sqr(Grad_u)) on all\nmeasure gap = mean(u) on wall\n"
        );
        let ran = run(&format!("rebound-{}-{error}", scheme.replace([' ', '='], "-")), &scene, &[]);
        ran.assert_silent();
        assert!((ran.last("total") / 500.0 - 1.0).abs() < 0.01, "{scheme} {error}: {}", ran.last("total"));
        assert!(most(&ran, "total") < 501.0 && ran.last("gap") > 1.0, "{scheme} {error}: {}", most(&ran, "total"));
        assert!(ran.steps() < 1500, "{scheme} {error}: {} steps", ran.steps());
    }
}

/// A body at rest on a floor has no energy, and a press that is slow beside its vibrations has little beside what it stores:
/// neither takes more steps for that. Nor does a body that a multiplier stops, which loses the motion of its nodes in any step.
#[test]
fn little_motion_takes_few_steps() {
    let body = |floor: &str, rest: &str| {
        format!(
            "mesh box [0] to [1] cells [10]\nregion foot = faces where x == 0\nregion top = faces where x == 1\n\
             unknown u : scalar\nterm inertia on all : Dot2_u*Test_u\nterm stress on all : 1e4*Grad_u.Grad_Test_u\n\
             {floor}\n{rest}\n"
        )
    };
    let penalty = "term floor on foot : -1e6*pos_part(-u)*Test_u";
    let weight = "term weight on all : 10*Test_u\nstart u = -10/1e6 - 10*(x - x^2/2)/1e4\n";
    let press = "fix u = -1e-3*t^2/(1 + t) on top\n";
    let rigid = "multiplier lam : scalar on foot\ndef p = pos_part(1e4*(-u) - lam)\nterm floor on foot : -p*Test_u\n\
                 term law on foot : -1e-4*(lam + p)*Test_lam";
    let thrown = "start u = 0.01\nstart Dot_u = -1\n";
    let cases = [("rest", penalty, weight, 100), ("press", penalty, press, 1000), ("thrown", rigid, thrown, 20_000)];
    for (name, floor, rest, steps) in cases {
        for scheme in ["bdf2", "newmark massless=foot", "generalised_alpha rho_inf=0.8"] {
            let end = if name == "thrown" { 0.1 } else { 2.0 };
            let motion = format!("{rest}scheme {scheme}\nsteps t = 0 to {end} by auto with error=1e-4");
            let words = scheme.replace([' ', '='], "-");
            let ran = run(&format!("little-{name}-{words}"), &body(floor, &motion), &[]);
            assert!(ran.code == 0 && !ran.tells("W618"), "{name} {scheme}: {}", ran.text);
            assert!(ran.steps() < steps, "{name} {scheme}: {} steps", ran.steps());
        }
    }
}

/// A bar that flies against a penalty of 5 E/h in explicit steps: contact sets the limit from the start on, and steps of 0.9 of it, which
/// are stable in each state, give it 7 times its energy. That is told; with a smaller fraction the bar leaves as it came.
#[test]
fn explicit_steps_of_a_limit_that_contact_sets_are_told() {
    for (words, told) in [("", true), (" fraction=0.7", false)] {
        let scene = format!(
            "param E = 2e11\nparam rho = 7800\nmesh box [0] to [1] cells [100]\nregion foot = faces where x == 0\nunknown u : scalar\n\
             start Dot_u = -10\nterm inertia on all : rho*Dot2_u*Test_u\nterm stress on all : E*Grad_u.Grad_Test_u\n\
             term contact on foot : -1e14*pos_part(-u)*Test_u\nscheme explicit{words}\nsteps t = 0 to 6e-4 by auto\n\
             measure total = integral(rho/2*Dot_u^2 + E/2*Norm_sqr(Grad_u)) on all\n"
        );
        let ran = run(&format!("explicit-bounce-{told}"), &scene, &[]);
        assert!(ran.code == 0 && ran.tells("W621") == told, "{}", ran.text);
        let gained = ran.last("total") / 3.9e5;
        assert!(if told { gained > 2.0 } else { (gained - 1.0).abs() < 0.03 }, "{gained}");
    }
}

/// A mass that is let go far from the floor which it never meets: when it has hardly begun to move, its velocity is rounding of its
/// position, and no error of a step. The steps went down to the smallest, and the mass up.
#[test]
fn a_mass_that_hardly_moves_yet_takes_no_small_steps() {
    for (scheme, start, pull) in
        [("newmark", 1.0, 1e-2), ("bdf2", 1.0, 1e-4), ("generalised_alpha rho_inf=0.5", 1e3, 1e-2)]
    {
        let scene = format!(
            "mesh box [0] to [1] cells [1] segment with idle_cells=allowed\nunknown r : scalar global\nstart r = {start}\n\
             term a on global : Dot2_r*Test_r\nterm b on global : ({pull} - 1e4*pos_part(-r))*Test_r\nscheme {scheme}\n\
             steps t = 0 to 1 by auto\nmeasure R = value(r) at [0]\n"
        );
        let ran = run(&format!("let-go-{start}-{pull}"), &scene, &[]);
        ran.assert_silent();
        assert!((ran.last("R") - start + 0.5 * pull).abs() < 1e-4 * start, "{scheme}: {}", ran.last("R"));
        assert!(ran.steps() < 100, "{scheme}: {} steps", ran.steps());
    }
}
