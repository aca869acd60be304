//! Schemes of time integration: their orders, energies, initial rates and prescribed motions, against closed forms of the
//! discrete problems.

use std::f64::consts::PI;

use wfl_run::StepResult;
use wfl_tests::{Solved, examples, solve};

/// Schemes with their orders.
const SCHEMES: [(&str, f64); 8] = [
    ("backward_euler", 1.0),
    ("bdf2", 2.0),
    ("bdf3", 3.0),
    ("newmark", 2.0),
    ("newmark beta=0.3025 gamma=0.6", 1.0),
    ("hht alpha=-0.1", 2.0),
    ("generalised_alpha rho_inf=0.8", 2.0),
    ("generalised_alpha rho_inf=0", 2.0),
];

/// Backward differentiation of order three integrates second rates as that of order two.
fn of_second_rates(order: f64) -> f64 {
    order.min(2.0)
}

fn run(text: String) -> Solved {
    solve(&examples(), text, &[], &[]).unwrap_or_else(|messages| panic!("{messages}"))
}

/// A bar of linear elements with E = rho = L = 1, held at x = 0.
fn bar(n: u32, rest: &str) -> String {
    format!(
        "mesh box [0] to [1] cells [{n}] segment\nregion left = faces where x == 0\nunknown u : scalar\n\
         term inertia on all : Dot2_u*Test_u\nterm stress on all : Grad_u.Grad_Test_u\n{rest}"
    )
}

/// The square of the frequency at which linear elements move in the shape sin(k x).
fn discrete(k: f64, n: u32) -> f64 {
    let h = 1.0 / f64::from(n);
    let c = (k * h).cos();
    6.0 / (h * h) * (1.0 - c) / (2.0 + c)
}

fn last(solved: &Solved, name: &str) -> f64 {
    solved.measure(solved.outcome.steps.len() - 1, name)
}

fn order(coarse: f64, fine: f64) -> f64 {
    (coarse / fine).abs().log2()
}

#[test]
fn a_vibrating_bar_shows_the_order_of_each_scheme_with_initial_velocity_and_acceleration() {
    let w = discrete(0.5 * PI, 4).sqrt();
    for (scheme, wanted) in SCHEMES {
        for (start, exact) in [
            ("start Dot_u = sin(pi*x/2)", (w * 1.3).sin() / w),
            ("start u = sin(pi*x/2)", (w * 1.3).cos()),
            ("start u = sin(pi*x/2)\nstart Dot_u = -2*sin(pi*x/2)", (w * 1.3).cos() - 2.0 * (w * 1.3).sin() / w),
        ] {
            let error = |h: f64| {
                let rest = format!(
                    "fix u = 0 on left\n{start}\nscheme {scheme}\nsteps t = 0 to 1.3 by {h}\n\
                     region tip = faces where x == 1\nmeasure tip = mean(u) on tip\n"
                );
                last(&run(bar(4, &rest)), "tip") - exact
            };
            let found = order(error(0.005), error(0.0025));
            assert!((found - of_second_rates(wanted)).abs() < 0.1, "{scheme}, {start}: {found}");
        }
    }
}

#[test]
fn heat_shows_the_order_of_each_scheme_with_first_rates() {
    let l = discrete(PI, 8);
    for (scheme, wanted) in SCHEMES {
        // Newmark's beta and gamma apply to first rates by gamma alone
        let error = |h: f64| {
            let solved = run(format!(
                "mesh box [0] to [1] cells [8] segment\nunknown u : scalar\nstart u = sin(pi*x)\n\
                 term storage on all : Dot_u*Test_u\nterm flux on all : Grad_u.Grad_Test_u\nfix u = 0 on boundary\n\
                 scheme {scheme}\nsteps t = 0 to 0.2 by {h}\nmeasure top = max(u) on all\n\
                 measure rate = min(Dot_u) on all\nquadrature on all degree 3\n"
            ));
            let first = solved.measure(0, "top");
            // the rate at the start is that of the equations where the scheme reads it
            if !["backward_euler", "bdf2"].contains(&scheme) {
                let rate = solved.measure(0, "rate") / first;
                assert!((rate + l).abs() < 1e-9 * l, "{scheme}: {rate} {l}");
            }
            last(&solved, "top") / first - (-0.2 * l).exp()
        };
        let found = order(error(0.0025), error(0.00125));
        assert!((found - wanted).abs() < 0.1, "{scheme}: {found}");
    }
}

#[test]
fn a_prescribed_motion_brings_its_rates() {
    // u = sin(t + 0.3) cos(1 - x)/cos(1) solves the equation; the discrete one is compared with itself
    for scheme in ["newmark", "hht alpha=-0.2", "generalised_alpha rho_inf=0.5", "bdf2"] {
        let at = |h: f64| {
            let rest = format!(
                "start u = sin(0.3)*cos(1 - x)/cos(1)\nstart Dot_u = cos(0.3)*cos(1 - x)/cos(1)\n\
                 fix u = sin(t + 0.3) on left\nscheme {scheme}\nsteps t = 0 to 1 by {h}\n\
                 region tip = faces where x == 1\nmeasure tip = mean(u) on tip\nmeasure v = mean(Dot_u) on left\n\
                 measure a = mean(Dot2_u) on left\nmeasure held = mean(u) on left\n"
            );
            run(bar(8, &rest))
        };
        // the first step, whose second rate is of first order, counts less in finer ones
        let runs = [0.0125, 0.00625, 0.003125].map(at);
        let tip: Vec<f64> = runs.iter().map(|r| last(r, "tip")).collect();
        let found = order(tip[0] - tip[1], tip[1] - tip[2]);
        assert!((found - 2.0).abs() < 0.15, "{scheme}: {found}");
        let exact = 1.3f64.sin() / 1.0f64.cos();
        assert!((tip[2] - exact).abs() < 3e-3, "{scheme}: {} {exact}", tip[2]);
        let solved = &runs[2];
        assert!((last(solved, "held") - 1.3f64.sin()).abs() < 1e-13, "{scheme}: prescribed values are met at the end");
        assert!((solved.measure(0, "v") - 0.3f64.cos()).abs() < 1e-8, "{scheme}: {}", solved.measure(0, "v"));
        assert!((solved.measure(0, "a") + 0.3f64.sin()).abs() < 1e-6, "{scheme}: {}", solved.measure(0, "a"));
        assert!((last(solved, "v") - 1.3f64.cos()).abs() < 1e-3, "{scheme}: {}", last(solved, "v"));
    }
}

/// Rounding leaves no drift, whatever the length of the steps: it would be of one sign in each step.
#[test]
fn the_trapezoidal_rule_keeps_the_energy_of_a_linear_body_over_ten_thousand_steps() {
    for h in [0.1, 0.37, 0.013, 1e-3] {
        let rest = format!(
            "fix u = 0 on left\nstart Dot_u = sin(pi*x/2)\nsteps t = 0 to {} by {h}\n\
             measure all_energy = integral(0.5*Dot_u*Dot_u + 0.5*Grad_u.Grad_u) on all\nquadrature on all degree 2\n",
            h * 1e4
        );
        let solved = run(bar(4, &rest));
        assert_eq!(solved.outcome.steps.len(), 10_001);
        assert_eq!(solved.outcome.report.factorisations, 1);
        let first = solved.measure(0, "all_energy");
        let drift = (0..=10_000).map(|k| (solved.measure(k, "all_energy") / first - 1.0).abs()).fold(0.0, f64::max);
        assert!(drift < 1e-12, "{h}: {drift:e}");
    }
}

#[test]
fn a_state_that_sums_the_velocity_by_the_trapezoidal_rule_is_the_displacement() {
    let rest = "fix u = 0 on left\nstart Dot_u = sin(pi*x/2)\nstate v : scalar on all := Dot_u\n\
                state s : scalar on all := s + 0.5*timestep*(v + Dot_u)\nstart v = sin(pi*x/2)\n\
                term coupled on all : 0*s*Test_u\nsteps t = 0 to 3 by 0.05\n\
                measure gap = max((s - u)*(s - u)) on all\nmeasure size = max(u*u) on all\n";
    let text = bar(4, rest);
    let solved = solve(&examples(), text, &[], &[]);
    let solved = solved.unwrap_or_else(|messages| panic!("{messages}"));
    let gap = last(&solved, "gap").sqrt();
    // the state starts with the velocity itself at its points, the field with the interpolated one
    assert!(gap < 2e-3, "{gap:e}");
}

/// Steps of a method of order p have the error h^(p+1): their number grows as the demand to the power -1/(p+1).
#[test]
fn steps_of_the_runs_own_choice_keep_the_order_of_each_scheme_with_second_rates() {
    let w = discrete(0.5 * PI, 4).sqrt();
    for (scheme, order) in SCHEMES.map(|(scheme, order)| (scheme, of_second_rates(order))) {
        let steps = |error: f64| {
            let rest = format!(
                "fix u = 0 on left\nstart u = sin(pi*x/2)\nscheme {scheme}\n\
                 steps t = 0 to 5 by auto with first=1e-4, least=1e-8, error={error}\n\
                 region tip = faces where x == 1\nmeasure tip = mean(u) on tip\n"
            );
            let solved = run(bar(4, &rest));
            let worst = |(k, s): (usize, &StepResult)| (solved.measure(k, "tip") - (w * s.window.end).cos()).abs();
            let error = solved.outcome.steps.iter().enumerate().map(worst).fold(0.0, f64::max);
            (f64::from(u32::try_from(solved.outcome.steps.len()).unwrap()), error)
        };
        let [coarse, fine] = if order > 1.5 { [1e-6, 1e-7] } else { [1e-4, 1e-5] }.map(steps);
        let found = (fine.0 / coarse.0).log10() * (order + 1.0);
        assert!((found - 1.0).abs() < 0.12, "{scheme}: {coarse:?} {fine:?}");
        // the errors of all steps add up: the demand to the power p/(p+1), the time of the run times a constant
        let power = (coarse.1 / fine.1).log10() * (order + 1.0) / order;
        assert!((power - 1.0).abs() < 0.2, "{scheme}: {coarse:?} {fine:?}");
        // BDF2 hands an error on with the factor 1.5; where the third derivative is small steps are longer. Errors are relative to the
        // largest change since the start, which is 2
        let sum = coarse.0 * if order > 1.5 { 1e-6 } else { 1e-4 };
        assert!(coarse.1 < 3.0 * 2.0 * sum, "{scheme}: {coarse:?} {sum}");
    }
}

/// An inertia that is switched off leaves no second rate, no velocity at the start and no scheme.
#[test]
fn a_factor_of_zero_leaves_a_scene_without_inertia() {
    let rest = |inertia: &str| {
        format!(
            "param inertia = 0\nmesh box [0] to [1] cells [4] segment\nregion left = faces where x == 0\n\
             unknown u : scalar\n{inertia}term stress on all : Grad_u.Grad_Test_u\nterm damper on all : Dot_u*Test_u\n\
             fix u = 0 on left\nload u = 1 on all\nsteps t = 0 to 1 by 0.1\n\
             measure most = max(u) on all\n"
        )
    };
    let without = run(rest(""));
    for inertia in [
        "term inertia on all : inertia*3*Dot2_u*Test_u\nstart Dot_u = 1 + x\n",
        "term inertia on all : (1 - 1)*Dot2_u*Test_u\n",
        "term inertia on all : 2*(Dot2_u*Test_u*(3*inertia))\n",
    ] {
        let with = run(rest(inertia));
        assert_eq!(last(&with, "most"), last(&without, "most"), "{inertia}");
    }
    let text = rest("term inertia on all : inertia*Dot2_u*Test_u\nmeasure a = max(Dot2_u) on all\n");
    let refused = solve(&examples(), text, &[], &[]).err().expect("an error");
    assert!(refused.contains("E451"), "{refused}");
}

/// A block of mass 1 and velocity 1 that friction on the rate of its slip stops: half a unit of energy is dissipated, as each
/// scheme differentiates the slip.
#[test]
fn friction_on_the_rate_of_slip_takes_the_kinetic_energy_under_every_scheme() {
    for scheme in ["backward_euler", "bdf2", "bdf3", "newmark", "hht alpha=-0.3", "generalised_alpha rho_inf=0.2"] {
        let found = run(format!(
            "mesh box [0] to [1] cells [1] segment\nregion wall = faces where x == 0\nregion block = faces where x == 1\n\
             unknown u : scalar\nterm soft on all : 1e-9*Grad_u.Grad_Test_u\nterm mass on block : Dot2_u*Test_u\n\
             term rough on block : Ball_projection(1e3*Dot_u, 0.5)*Test_u\nfix u = 0 on wall\nstart Dot_u = x\n\
             scheme {scheme}\nsteps t = 0 to 3 by 3/200\nmeasure way = value(u) at [1]\n"
        ));
        let taken: f64 = found.outcome.steps.iter().filter_map(|step| step.friction).map(|work| work.taken).sum();
        let way = found.measure(200, "way");
        assert!((way - 1.0).abs() < 0.02 && (taken - 0.5).abs() < 0.02, "{scheme}: {way} {taken}");
    }
}

/// A bar at rest with a sudden load at its end. In steps far longer than its periods the trapezoidal rule goes from zero to twice the
/// static displacement and back, whatever stiffness, density and increment are: its first acceleration is load over mass.
#[test]
fn a_step_far_longer_than_all_periods_begins_with_load_over_mass() {
    for (stiffness, density, h) in [(1e20, 1e-20, 1.0), (1e12, 1e-12, 1.0), (1.0, 1.0, 1e12), (1e10, 1e-10, 1.0)] {
        for hold in ["fix u = 0 on left", "multiplier l : scalar on left\nterm hold on left : l*Test_u + u*Test_l"] {
            let found = run(format!(
                "param E = {stiffness:e}\nparam rho = {density:e}\nmesh box [0] to [1] cells [4] segment\n\
                 region left = faces where x == 0\nregion tip = faces where x == 1\nunknown u : scalar\n\
                 term inertia on all : rho*Dot2_u*Test_u\nterm stress on all : E*Grad_u.Grad_Test_u\n\
                 load u = 1 on tip\n{hold}\nscheme newmark\nsteps t = 0 to {} by {h:e}\nmeasure moved = E*mean(u) on tip\n",
                2.0 * h
            ));
            let moved = [1, 2].map(|k| found.measure(k, "moved"));
            let of = format!("E = {stiffness:e}, rho = {density:e}, steps of {h:e}, {hold}: {moved:?}");
            assert!((moved[0] - 2.0).abs() < 1e-8 && moved[1].abs() < 1e-8, "{of}");
        }
    }
}

/// A light stiff bar that is stretched and moves, with inertia and stress in one term: of a difference of two forces its mass would be
/// rounding of the stress.
#[test]
fn a_mass_beside_a_stiffness_in_one_term_is_the_mass() {
    let bar = |rest: &str| {
        format!(
            "param E = 1e12\nparam rho = 1e-8\nmesh box [0] to [1] cells [4] segment\nregion left = faces where x == 0\n\
             region tip = faces where x == 1\nunknown u : scalar\nstart u = 1e-5*x\nstart Dot_u = x\n\
             term body on all : rho*Dot2_u*Test_u + E*Grad_u.Grad_Test_u\nload u = 1e-5*E on tip\nfix u = 0 on left\n\
             quadrature on all degree 2\nmeasure kinetic = integral(rho/2*Dot_u*Dot_u) on all\n{rest}"
        )
    };
    let found = run(bar("scheme newmark energy=1\nsteps t = 0 to 2e-10 by 1e-10\n"));
    for k in 0..3 {
        let [exact, told] = ["kinetic", "energy_kinetic"].map(|name| found.measure(k, name));
        // a velocity is a change of displacements, which are 1e5 times as large, over the increment
        assert!((told / exact - 1.0).abs() < 1e-9, "step {k}: {told} {exact}");
    }
    // of linear elements on the lumped mass: a quarter of the mass at each node, half of it at the ends
    let found = run(bar("scheme explicit energy=1\nsteps t = 0 to 2e-14 by 1e-14\n"));
    let lumped = 0.5 * 1e-8 * 0.25 * (0.25f64.powi(2) + 0.5f64.powi(2) + 0.75f64.powi(2) + 0.5);
    assert!(
        (found.measure(0, "energy_kinetic") / lumped - 1.0).abs() < 1e-12,
        "{}",
        found.measure(0, "energy_kinetic")
    );
}

/// A block that creeps on a floor which it touches without a force: friction, whose bound is a part of the pressure, has none yet.
#[test]
fn friction_without_a_pressure_does_not_brake_where_time_starts() {
    let speed = |friction: &str| {
        let found = run(format!(
            "mesh box [0,0] to [2,1] cells [4,2] quad\nregion floor = faces where y == 0\n\
             region top = faces where y == 1\nunknown u : vector\n\
             term stress on all : (Grad_u + Grad_u'):Grad_Test_u + Div_u*Div_Test_u\n\
             term creep on all : 0.7*(Grad_Dot_u + Grad_Dot_u'):Grad_Test_u + 0.2*Dot_u.Test_u\n\
             def p = pos_part(-100*u(2))\nterm contact on floor : -p*Test_u(2){friction}\n\
             load u = [0.5,-1] on top\nscheme newmark\nsteps t = 0 to 0.1 by 0.05\nmeasure speed = mean(Dot_u(1)) on top\n"
        ));
        found.measure(0, "speed")
    };
    let (with, without) = (speed(" + Ball_projection(20*Dot_u(1), 0.3*p)*Test_u(1)"), speed(""));
    assert!((with / without - 1.0).abs() < 1e-9 && without > 4.0, "{with} {without}");
}
