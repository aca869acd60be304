//! `scheme explicit` and `scheme ... energy`: stability limits, orders, energies and rates against closed forms of the discrete
//! problems; refusals.

use std::f64::consts::PI;

use wfl_host::team::in_threads;
use wfl_jit::JitBackend;
use wfl_run::{RunOptions, Session};
use wfl_tests::{Solved, doubts, examples, prepared, reference, solve};

fn run(text: String) -> Solved {
    solve(&examples(), text, &[], &[]).unwrap_or_else(|messages| panic!("{messages}"))
}

fn refused(text: String) -> String {
    solve(&examples(), text, &[], &[]).err().expect("an error")
}

fn last(solved: &Solved, name: &str) -> f64 {
    solved.measure(solved.outcome.steps.len() - 1, name)
}

fn order(coarse: f64, fine: f64) -> f64 {
    (coarse / fine).abs().log2()
}

/// A bar of linear elements with E = rho = L = 1.
fn bar(n: u32, rest: &str) -> String {
    format!(
        "mesh box [0] to [1] cells [{n}] segment\nregion left = faces where x == 0\nregion right = faces where x == 1\n\
         unknown u : scalar\nterm inertia on all : Dot2_u*Test_u\nterm stress on all : Grad_u.Grad_Test_u\n{rest}"
    )
}

/// The frequency at which linear elements on a lumped mass move in the shape sin(k x).
fn lumped_frequency(k: f64, n: u32) -> f64 {
    2.0 * f64::from(n) * (0.5 * k / f64::from(n)).sin()
}

#[test]
fn the_limit_of_a_free_bar_is_the_time_a_wave_takes_through_a_cell() {
    let backend = JitBackend::new().expect("machine code on this processor");
    for (n, scale) in [(1u32, 1.0), (7, 1.0), (60, 3.0)] {
        let text =
            bar(n, "start u = x\nscheme explicit fraction=0.5\nsteps t = 0 to 1 by auto\nmeasure m = max(u) on all\n")
                .replace("Grad_u.Grad_Test_u", &format!("{}*Grad_u.Grad_Test_u", scale * scale));
        let scene = prepared(&examples(), text, &[], &[], &backend).unwrap_or_else(|messages| panic!("{messages}"));
        let limit = scene.explicit.as_ref().expect("explicit steps").limit.step;
        let exact = 1.0 / (f64::from(n) * scale);
        // what is found is no more than the limit
        assert!(limit <= exact * (1.0 + 1e-9) && limit > exact * (1.0 - 1e-4), "{n}: {limit} {exact}");
        let h = scene.steps.values[1] - scene.steps.values[0];
        assert!(h <= 0.5 * limit * (1.0 + 1e-9) && h > 0.45 * limit.min(1.0), "{n}: {h} {limit}");
        assert_eq!(scene.steps.last().to_bits(), 1.0f64.to_bits());
    }
}

#[test]
fn damping_beside_the_diagonal_shortens_the_limit_as_the_closed_form_says() {
    // stiffness-proportional damping a K lags by half a step: h w = sqrt(4 + (a w)^2) - a w
    let backend = JitBackend::new().expect("machine code on this processor");
    let (n, a) = (10u32, 0.02);
    let text = bar(n, "start u = x\nscheme explicit\nsteps t = 0 to 1 by auto\nmeasure m = max(u) on all\n")
        .replace("Grad_u.Grad_Test_u", &format!("(Grad_u + {a}*Grad_Dot_u).Grad_Test_u"));
    let scene = prepared(&examples(), text, &[], &[], &backend).unwrap_or_else(|messages| panic!("{messages}"));
    let limit = scene.explicit.as_ref().expect("explicit steps").limit.step;
    let w = 2.0 * f64::from(n);
    let exact = ((4.0 + a * a * w * w).sqrt() - a * w) / w;
    assert!((limit / exact - 1.0).abs() < 2e-4, "{limit} {exact}");
}

/// A drag that is written as a difference over the increment: the mass is found with the increment of the first step.
#[test]
fn a_term_may_divide_by_the_increment() {
    let (h, c) = (0.05, 0.8);
    let rest = format!(
        "term drag on all : {c}*(u - Previous_u)/timestep*Test_u\nfix u = 0 on left\nstart u = x\nscheme explicit\n\
         steps t = 0 to 1 by {h}\nmeasure end = value(u) at [1]\n"
    );
    let found = run(bar(1, &rest));
    // one node with half the mass of the bar, and a third of it under the drag
    let (mass, stiffness, drag) = (0.5, 1.0, c / 3.0);
    let (mut before, mut now) = (1.0, 1.0 - 0.5 * h * h * stiffness / mass);
    for step in 1..=20 {
        assert!((found.measure(step, "end") - now).abs() < 1e-12, "{step}: {} {now}", found.measure(step, "end"));
        let force = -stiffness * now - drag * (now - before) / h;
        (before, now) = (now, 2.0 * now - before + h * h * force / mass);
    }
}

#[test]
fn a_vibrating_bar_shows_the_second_order_and_the_frequency_of_the_lumped_mass() {
    let w = lumped_frequency(0.5 * PI, 4);
    for (start, exact) in [
        ("start Dot_u = sin(pi*x/2)", (w * 1.3).sin() / w),
        ("start u = sin(pi*x/2)", (w * 1.3).cos()),
        ("start u = sin(pi*x/2)\nstart Dot_u = -2*sin(pi*x/2)", (w * 1.3).cos() - 2.0 * (w * 1.3).sin() / w),
    ] {
        let at = |h: f64| {
            let rest = format!(
                "fix u = 0 on left\n{start}\nscheme explicit\nsteps t = 0 to 1.3 by {h}\n\
                 measure tip = mean(u) on right\nmeasure v = mean(Dot_u) on right\n"
            );
            run(bar(4, &rest))
        };
        let (coarse, fine) = (at(0.02), at(0.01));
        let found = order(last(&coarse, "tip") - exact, last(&fine, "tip") - exact);
        assert!((found - 2.0).abs() < 0.05, "{start}: {found}");
    }
}

#[test]
fn at_the_limit_a_wave_runs_without_error() {
    // with h = dx/c central differences give d'Alembert's solution at the nodes; steps of 0.999 of it nearly so
    let rest = "start u = exp(-200*(x - 0.4)^2)\nscheme explicit\nsteps t = 0 to 0.25 by 0.25/51\n\
                fix u = 0 on left, right\nmeasure here = value(u) at [0.65]\nmeasure there = value(u) at [0.15]\n";
    let solved = run(bar(200, rest));
    for name in ["here", "there"] {
        assert!((last(&solved, name) - 0.5).abs() < 2e-3, "{name}: {}", last(&solved, name));
    }
}

#[test]
fn damping_on_the_diagonal_keeps_the_second_order() {
    // with the nodal rule mass and damping are diagonal, and the mode decays: q'' + a q' + w^2 q = 0
    let (w, a) = (lumped_frequency(0.5 * PI, 4), 0.8f64);
    let turned = (w * w - 0.25 * a * a).sqrt();
    let exact = (-0.5 * a * 1.3).exp() * (turned * 1.3).sin() / turned;
    let error = |h: f64| {
        let rest = format!(
            "fix u = 0 on left\nstart Dot_u = sin(pi*x/2)\nterm damper on all : {a}*Dot_u*Test_u\nscheme explicit\n\
             steps t = 0 to 1.3 by {h}\nquadrature on all vertex\nmeasure tip = mean(u) on right\n"
        );
        last(&run(bar(4, &rest)), "tip") - exact
    };
    let found = order(error(0.02), error(0.01));
    assert!((found - 2.0).abs() < 0.05, "{found}");
}

#[test]
fn prescribed_motions_are_met_and_bring_their_rates() {
    // u = sin(t + 0.3) cos(1 - x)/cos(1) solves the equation; the discrete one is compared with itself
    let at = |h: f64| {
        let rest = format!(
            "start u = sin(0.3)*cos(1 - x)/cos(1)\nstart Dot_u = cos(0.3)*cos(1 - x)/cos(1)\n\
             fix u = sin(t + 0.3) on left\nscheme explicit\nsteps t = 0 to 1 by {h}\nmeasure tip = mean(u) on right\n\
             measure v = mean(Dot_u) on left\nmeasure a = mean(Dot2_u) on left\nmeasure held = mean(u) on left\n"
        );
        run(bar(8, &rest))
    };
    let runs = [0.05, 0.025, 0.0125].map(at);
    let tip: Vec<f64> = runs.iter().map(|r| last(r, "tip")).collect();
    let found = order(tip[0] - tip[1], tip[1] - tip[2]);
    assert!((found - 2.0).abs() < 0.2, "{found}");
    let solved = &runs[2];
    assert!((last(solved, "held") - 1.3f64.sin()).abs() < 1e-13);
    assert!((solved.measure(0, "v") - 0.3f64.cos()).abs() < 1e-8);
    assert!((last(solved, "v") - 1.3f64.cos()).abs() < 1e-3, "{}", last(solved, "v"));
    assert!((last(solved, "a") + 1.3f64.sin()).abs() < 2e-2, "{}", last(solved, "a"));
}

#[test]
fn a_wave_leaves_through_an_absorbing_end_at_nine_tenths_of_the_limit() {
    let rest = "start u = exp(-200*(x - 0.5)^2)\nterm absorbing on left, right : Dot_u*Test_u\nscheme explicit energy\n\
                steps t = 0 to 2 by auto\n";
    let solved = run(bar(200, rest));
    // integral of (400 x)^2 exp(-400 x^2)/2
    let first = 0.25 * 400.0f64.powi(2) * PI.sqrt() / 400.0f64.powf(1.5);
    // the elastic energy of the pulse, integral of u_x^2/2, has left through the two ends
    let left = last(&solved, "energy_absorbing");
    assert!((left / first - 1.0).abs() < 5e-3, "{left} {first}");
    assert!(last(&solved, "energy_kinetic").abs() < 1e-10 * first, "{}", last(&solved, "energy_kinetic"));
    let lost = (0..solved.outcome.steps.len()).map(|k| solved.measure(k, "energy_lost").abs()).fold(0.0, f64::max);
    assert!(lost < 1e-11 * first, "{lost:e}");
}

#[test]
fn the_balance_of_energy_closes_to_rounding_under_the_trapezoidal_rule() {
    // loads, a prescribed motion and a linear damper: all forces are linear in time and displacement
    let rest = "start u = 0.1*x\nstart Dot_u = sin(pi*x/2)\nfix u = 0.2*t on left\nload u = 0.3 on all\n\
                term damper on right : 0.3*Dot_u*Test_u\nscheme newmark energy=1e-9\nsteps t = 0 to 3 by 0.05\n\
                measure kinetic = integral(0.5*Dot_u*Dot_u) on all\nmeasure elastic = integral(0.5*Grad_u.Grad_u) on all\n\
                measure tip = mean(u) on right\nquadrature on all degree 2\n";
    let solved = run(bar(10, rest));
    let n = solved.outcome.steps.len() - 1;
    let (first, end) = (|name: &str| solved.measure(0, name), |name: &str| solved.measure(n, name));
    assert!((end("energy_kinetic") - end("kinetic")).abs() < 1e-13);
    assert!((end("energy_stress") - (end("elastic") - first("elastic"))).abs() < 1e-12);
    // a constant load gives what its displacement is
    let mean = |k: usize| -> f64 {
        let nodes: Vec<f64> = (0..=10).map(|i| solved.at(k, "u", [f64::from(i) / 10.0, 0.0, 0.0])[0]).collect();
        nodes.windows(2).map(|w| 0.05 * (w[0] + w[1])).sum()
    };
    if !solved.outcome.steps[0].state.is_empty() {
        assert!((end("energy_loads") - 0.3 * (mean(n) - mean(0))).abs() < 1e-12);
    }
    assert!(end("energy_damper") > 0.01, "{}", end("energy_damper"));
    assert!(end("energy_prescribed").abs() > 0.01, "{}", end("energy_prescribed"));
    let lost = (0..=n).map(|k| solved.measure(k, "energy_lost").abs()).fold(0.0, f64::max);
    assert!(lost < 1e-12, "{lost:e}");
    assert!(doubts(&solved.outcome).iter().all(|w| w.0 != "W620"));
}

#[test]
fn friction_dissipates_the_kinetic_energy_of_a_sliding_block() {
    // a block of mass 1 slides with v0 = 1 against the friction 0.5: it stops after 2 with the path 1, and 1/2 is dissipated.
    // Per step the friction stays the same, so central differences and the trapezoidal rule have no error.
    for scheme in ["explicit energy", "newmark energy"] {
        let text = format!(
            "mesh box [0] to [1] cells [1] segment\nunknown u : scalar\nstart Dot_u = 1\nterm inertia on all : Dot2_u*Test_u\n\
             term stress on all : 1e-3*Grad_u.Grad_Test_u\nterm friction on all : 0.5*Test_u*(1 + 0*u)\n\
             scheme {scheme}\nsteps t = 0 to 1.5 by 0.05\nmeasure v = mean(Dot_u) on all\n"
        );
        let solved = run(text);
        let moved = 1.5 - 0.25 * 1.5 * 1.5;
        assert!((last(&solved, "v") - 0.25).abs() < 1e-12, "{scheme}");
        assert!((last(&solved, "energy_friction") - 0.5 * moved).abs() < 1e-12, "{scheme}");
        // explicit steps count the velocities half a step before and behind, 0.25 + 0.0125 and 0.25 - 0.0125
        let product = if scheme.starts_with("explicit") { 0.2625 * 0.2375 } else { 0.25 * 0.25 };
        assert!((last(&solved, "energy_kinetic") - 0.5 * product).abs() < 1e-12, "{scheme}");
        assert!(last(&solved, "energy_lost").abs() < 1e-12, "{scheme}: {}", last(&solved, "energy_lost"));
    }
}

#[test]
fn damping_of_the_scheme_is_the_energy_that_is_lost() {
    let rest = "fix u = 0 on left\nstart Dot_u = sin(pi*x/2)\nscheme generalised_alpha rho_inf=0.5 energy\n\
                steps t = 0 to 20 by 0.1\nmeasure elastic = integral(0.5*Grad_u.Grad_u) on all\nquadrature on all degree 2\n";
    let solved = run(bar(20, rest));
    let lost = last(&solved, "energy_lost");
    let gone = solved.measure(0, "energy_kinetic") - last(&solved, "energy_kinetic") - last(&solved, "elastic");
    assert!(lost > 1e-5 && (lost - gone).abs() < 1e-12, "{lost} {gone}");
    // backward Euler loses more than a thousandth, and says so
    let rest = rest.replace("generalised_alpha rho_inf=0.5", "backward_euler");
    let solved = run(bar(20, &rest));
    assert!(doubts(&solved.outcome).iter().any(|w| w.0 == "W620"), "{:?}", doubts(&solved.outcome));
}

#[test]
fn what_explicit_steps_cannot_do_is_refused() {
    let steps = "start u = x\nscheme explicit\nsteps t = 0 to 1 by 0.11\n";
    let told = refused(bar(10, steps));
    assert!(told.contains("E456") && told.contains("0.099") | told.contains("0.1"), "{told}");
    let told = refused(bar(4, "start u = x\nscheme explicit\nsteps t = 0 to 1 by 0.01\n").replace(
        "term inertia on all : Dot2_u*Test_u",
        "unknown p : scalar\nterm inertia on all : Dot2_u*Test_u\nterm flow on all : Grad_p.Grad_Test_p",
    ));
    assert!(told.contains("E457") && told.contains("`p`"), "{told}");
    let told = refused(
        bar(4, "start u = x\nscheme explicit\nsteps t = 0 to 1 by 0.01\n")
            .replace("Dot2_u*Test_u", "(1 + u)*Dot2_u*Test_u"),
    );
    assert!(told.contains("E455"), "{told}");
    let told = refused(bar(4, "start u = x\nscheme explicit fraction=1\nsteps t = 0 to 1 by auto\n"));
    assert!(told.contains("E452"), "{told}");
    let triangles = "mesh box [0,0] to [1,1] cells [2,2] tri\nunknown u : scalar P2\nstart u = x\n\
                     term inertia on all : Dot2_u*Test_u\nterm stress on all : Grad_u.Grad_Test_u\nscheme explicit\n\
                     steps t = 0 to 1 by auto\n";
    let told = refused(triangles.to_owned());
    assert!(told.contains("E455"), "{told}");
}

#[test]
fn a_scene_without_energy_or_explicit_steps_has_neither() {
    let backend = JitBackend::new().expect("machine code on this processor");
    let text = bar(4, "fix u = 0 on left\nstart Dot_u = x\nsteps t = 0 to 1 by 0.5\n");
    let scene = prepared(&examples(), text, &[], &[], &backend).unwrap_or_else(|messages| panic!("{messages}"));
    assert!(scene.explicit.is_none() && scene.energy.is_none());
}

#[test]
fn a_session_makes_explicit_steps_with_the_bits_of_a_run_and_no_equations_to_solve() {
    let backend = JitBackend::new().expect("machine code on this processor");
    let text = bar(
        20,
        "fix u = 0 on left\nstart Dot_u = x\nscheme explicit\nsteps t = 0 to 1 by auto\nmeasure tip = mean(u) on right\n",
    );
    let whole = run(text.clone());
    let scene = prepared(&examples(), text, &[], &[], &backend).unwrap_or_else(|messages| panic!("{messages}"));
    let options = RunOptions::without_files(1, std::time::Instant::now());
    let mut session = Session::new(&scene, options).expect("a session");
    assert!(session.begin(&scene, 0.0).is_err());
    while session.step(&scene, &mut wfl_run::Quiet).expect("a step").is_some() {}
    let bits = |steps: &[wfl_run::StepResult]| steps.iter().map(|s| s.measures[0].1.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(session.steps()), bits(&whole.outcome.steps));
}

#[test]
fn ranks_make_the_steps_of_one() {
    let text = "mesh box [0,0] to [1,1] cells [8,8] quad\nregion floor = faces where y == 0\nregion out = faces where y == 1\n\
                unknown u : vector\nstart u = [0.1*sin(3*x*y),0.2*x]\nterm inertia on all : 1.3*Dot2_u.Test_u\n\
                term stress on all : Sym(Grad_u):Grad_Test_u + 0.5*Div_u*Div_Test_u\nterm absorbing on out : Dot_u.Test_u\n\
                term held on floor : 3*pos_part(u(2))*Test_u(2)\nfix u(1) = 0.01*t on floor\nscheme explicit energy\n\
                steps t = 0 to 0.5 by auto\nmeasure m = integral(u.u + x*Dot_u(1)) on all\n";
    let whole = run(text.to_owned());
    // unknowns have the bits of one rank, sums over all ranks are rounded otherwise
    let found = |steps: &[wfl_run::StepResult]| -> (Vec<u64>, Vec<f64>) {
        let last = steps.last().expect("steps");
        let measures = steps.iter().flat_map(|s| s.measures.iter().map(|m| m.1));
        (last.state.iter().map(|x| x.to_bits()).collect(), measures.collect())
    };
    let (state, measures) = found(&whole.outcome.steps);
    let largest = measures.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    let of_ranks = |ranks: usize| -> Vec<(Vec<u64>, Vec<f64>)> {
        std::thread::scope(|scope| {
            let each = in_threads(ranks).into_iter().map(|team| {
                scope.spawn(move || {
                    let backend = JitBackend::new().expect("machine code on this processor");
                    let mut scene = prepared(&examples(), text.to_owned(), &[], &[], &backend).expect("a scene");
                    scene.share_rows(team);
                    let options = RunOptions::without_files(1, std::time::Instant::now());
                    wfl_run::run(&scene, &options, &mut wfl_run::Quiet).expect("a run").steps
                })
            });
            let each: Vec<_> = each.collect();
            each.into_iter().map(|rank| found(&rank.join().expect("a rank"))).collect()
        })
    };
    for (own_state, own) in of_ranks(3) {
        assert!(own_state == state && own.len() == measures.len());
        assert!(own.iter().zip(&measures).all(|(a, b)| (a - b).abs() < 1e-13 * largest));
    }
}

/// The times that the scene of the rupture expects are those of the reference.
#[test]
fn the_rupture_is_compared_with_the_published_times() {
    let scene = std::fs::read_to_string(examples().join("dynamics/tpv205.wfl")).expect("an example");
    let published = reference("dynamics_tpv205.json");
    let times = published["first_slip_s"].as_object().expect("times by place");
    assert_eq!(times.len(), 6);
    for (place, time) in times {
        let x: f64 = place.parse().expect("a place in km");
        let side = if x > 0.0 { "east" } else { "west" };
        let name = format!(
            "{side}{}",
            if x.abs() == 12.0 { "12".to_owned() } else { format!("{}", (10.0 * x.abs()).round()) }
        );
        let expected = format!("expect abs({name}_first - {:.2}) < tolerance", time.as_f64().expect("a time"));
        assert!(scene.contains(&expected), "{expected}");
    }
}

/// A contact that closes behind the start makes the steps too long; it keeps the numbers finite, and the run tells it. With
/// steps below the length that is told, the bar leaves the wall as it came.
#[test]
fn a_contact_that_makes_the_steps_too_long_is_told() {
    let rest = |fraction: &str| {
        format!(
            "start u = 0.1\nstart Dot_u = -1\nterm contact on left : -1000*neg_part(u)*Test_u\n\
             scheme explicit fraction={fraction}\nsteps t = 0 to 2.5 by auto\nmeasure v = mean(Dot_u) on all\n"
        )
    };
    let told = |solved: &Solved| doubts(&solved.outcome).iter().find(|w| w.0 == "W621").map(|w| w.1.clone());
    let unstable = run(bar(20, &rest("0.9")));
    let text = told(&unstable).expect("a warning");
    assert!(text.contains("fallen to 9.9"), "{text}");
    // 2/w with w^2 = (1000 + 20)/(1/40) of the node at the wall
    let stable = run(bar(20, &rest("0.15")));
    assert_eq!(told(&stable), None);
    let v = last(&stable, "v");
    assert!((v - 1.0).abs() < 0.05, "{v}");
}

/// Inertia that acts on other components, fields or places is no mass of each dof: lumped it would be another motion, or none.
#[test]
fn inertia_that_couples_is_refused() {
    let interval = "mesh box [-1] to [1] cells [4] segment\nregion le = cells where x < 0\nregion ri = cells where x > 0\n\
                    region mid = interface from le to ri\nregion end = faces where x == -1\n";
    let square = "mesh box [0,0] to [1,1] cells [2,2] quad\nregion r = faces where x == 1\n";
    let rest = "scheme explicit\nsteps t = 0 to 0.1 by auto\n";
    for (mesh, terms, told) in [
        (square, "unknown u : vector\nterm i on all : ([2,1;1,2]*Dot2_u).Test_u\n", "one component of `u`"),
        (
            square,
            "unknown u : vector\nunknown w : vector\nterm i on all : Dot2_u.Test_u + Dot2_w.Test_w\n\
                  term c on all : 0.3*(Dot2_u.Test_w + Dot2_w.Test_u)\n",
            "the inertia of `u` acts on `w`",
        ),
        (
            interval,
            "unknown u : scalar\nterm i on all : Dot2_u*Test_u\nterm r on all : 0.01*Grad_Dot2_u.Grad_Test_u\n",
            "from one place on another",
        ),
        (
            interval,
            "unknown a : scalar on le\nunknown b : scalar on ri\nterm ia on le : Dot2_a*Test_a\n\
                    term ib on ri : Dot2_b*Test_b\n\
                    def there(w) = Interpolate(w, neighbor_element)\n\
             term c on mid : 3*(Dot2_a - there(Dot2_b))*(Test_a - there(Test_b))\n",
            "acts",
        ),
        (
            interval,
            "unknown q : scalar global\nunknown u : scalar\n\
                    term i on all : (Dot2_u + Dot2_q)*(Test_u + Test_q)\n",
            "acts on",
        ),
    ] {
        let text = refused(format!("{mesh}{terms}{rest}"));
        assert!(text.contains("E455") && text.contains(told), "{terms}{text}");
    }
    // masses of components that differ, on an oblique support
    let text = |second: f64| {
        format!(
            "mesh box [0,0] to [1,1] cells [2,2] quad map [0.8*x - 0.6*y, 0.6*x + 0.8*y]\n\
             region r = faces where 0.8*x + 0.6*y == 1\nunknown u : vector\n\
             term i on all : Dot2_u(1)*Test_u(1) + {second}*Dot2_u(2)*Test_u(2)\nterm s on all : Grad_u:Grad_Test_u\n\
             fix u.Normal = 0 on r\n{rest}"
        )
    };
    run(text(1.0));
    let told = refused(text(3.0));
    assert!(told.contains("E455") && told.contains("one component of `u`"), "{told}");
}

/// Dashpots between bodies, components and directions: they leave alone what both of their ends do, whatever their size, and turn
/// without work what a gyroscope turns. Energy is not asked for.
#[test]
fn dashpots_between_dofs_act_at_one_time() {
    let pair = |c: f64, steps: &str| {
        format!(
            "mesh box [-1] to [1] cells [8] segment\nregion le = cells where x < 0\nregion ri = cells where x > 0\n\
             region mid = interface from le to ri\nunknown a : scalar on le\nunknown b : scalar on ri\n\
             term ia on le : Dot2_a*Test_a\nterm ib on ri : Dot2_b*Test_b\nterm sa on le : Grad_a.Grad_Test_a\n\
             term sb on ri : Grad_b.Grad_Test_b\ndef there(w) = Interpolate(w, neighbor_element)\n\
             term c on mid : {c}*(Dot_a - there(Dot_b))*(Test_a - there(Test_b))\n\
             load a = 1 on le\nload b = 1 on ri\nscheme explicit\nsteps t = 0 to 1 by {steps}\n\
             measure v = mean(Dot_a) on le\nmeasure w = mean(Dot_b) on ri\n"
        )
    };
    for (c, steps) in [(1.0, "auto"), (100.0, "0.001"), (1e4, "auto")] {
        let solved = run(pair(c, steps));
        assert!((last(&solved, "v") - 1.0).abs() < 1e-9 && (last(&solved, "w") - 1.0).abs() < 1e-9, "{c}");
    }
    // behind a driven body: v' = c (t - v), v = t - (1 - exp(-c t))/c, of second order
    let behind = |n: u32| {
        let solved = run(format!(
            "mesh box [0] to [1] cells [2] segment\nregion le = faces where x == 0\nunknown a : scalar\nunknown b : scalar\n\
             term ia on all : Dot2_a*Test_a + Grad_a.Grad_Test_a\nterm ib on all : Dot2_b*Test_b + 1e-3*Grad_b.Grad_Test_b\n\
             term c on all : 3*(Dot_a - Dot_b)*(Test_a - Test_b)\nfix a = t^2/2 on all\n\
             scheme explicit\nsteps t = 0 to 1 by 1/{n}\nmeasure v = mean(Dot_b) on all\n"
        ));
        (last(&solved, "v") - (1.0 - (1.0 - (-3f64).exp()) / 3.0)).abs()
    };
    assert!((order(behind(50), behind(100)) - 2.0).abs() < 0.1, "{} {}", behind(50), behind(100));
    // a load along the direction that an oblique dashpot leaves free
    let solved = run("mesh box [0,0] to [1,1] cells [2,2] quad\nunknown u : vector\nterm i on all : Dot2_u.Test_u\n\
                      term d on all : 40*(Dot_u.[0.6,0.8])*(Test_u.[0.6,0.8])\nload u = [-0.8,0.6] on all\n\
                      scheme explicit\nsteps t = 0 to 1 by 0.01\nmeasure v = mean(Dot_u.[-0.8,0.6]) on all\n"
        .to_owned());
    assert!((last(&solved, "v") - 1.0).abs() < 1e-9, "{}", last(&solved, "v"));
    // a body under Coriolis forces runs in circles at its speed
    let solved = run("mesh box [0,0] to [1,1] cells [2,2] quad\nunknown u : vector\nterm i on all : Dot2_u.Test_u\n\
                      term c on all : 2*(Dot_u(1)*Test_u(2) - Dot_u(2)*Test_u(1))\nterm s on all : 100*Sym(Grad_u):Grad_Test_u\n\
                      start Dot_u = [1,0]\nscheme explicit\nsteps t = 0 to 5 by auto\nmeasure v = mean(Norm(Dot_u)) on all\n\
                      measure east = mean(Dot_u(1)) on all\n"
        .to_owned());
    assert!((last(&solved, "v") - 1.0).abs() < 1e-6, "{}", last(&solved, "v"));
    assert!((last(&solved, "east") - 10f64.cos()).abs() < 5e-3, "{}", last(&solved, "east"));
}

/// A stiffness or a damping that grows in time: steps by `auto` are those of the shortest limit of the run, others are refused.
#[test]
fn coefficients_that_grow_in_time_shorten_the_limit() {
    let text = |terms: &str, by: &str| {
        bar(
            10,
            &format!(
                "start u = 0.01*x*(2 - x)\n{terms}fix u = 0 on left\nscheme explicit\nsteps t = 0 to 3 by {by}\n\
                          measure m = max(abs(u)) on all\n"
            ),
        )
    };
    for terms in ["term k on all : 3*t*Grad_u.Grad_Test_u\n", "term d on all : 0.5*t*Grad_Dot_u.Grad_Test_u\n"] {
        let solved = run(text(terms, "auto"));
        let most = (0..solved.outcome.steps.len()).map(|k| solved.measure(k, "m").abs()).fold(0.0, f64::max);
        assert!(most < 0.0101, "{terms}: {most}");
        let told = refused(text(terms, "0.09"));
        assert!(told.contains("E456"), "{told}");
    }
}
