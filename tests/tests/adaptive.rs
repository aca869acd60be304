//! Steps that a run chooses: the error is what was demanded, steps end where they must, what was rejected leaves no trace.

use std::time::Instant;

use wfl_jit::JitBackend;
use wfl_problem::Scene;
use wfl_run::{AttemptEnd, Outcome, Quiet, RunOptions, Session, run};
use wfl_tests::{doubts, prepared};

fn scene(text: &str) -> Scene {
    let backend = JitBackend::new().expect("machine code on this processor");
    prepared(std::path::Path::new("."), text.to_owned(), &[], &[], &backend).unwrap_or_else(|e| panic!("{e}"))
}

fn options() -> RunOptions {
    RunOptions { keep_states: true, ..RunOptions::without_files(1, Instant::now()) }
}

fn outcome(text: &str) -> Outcome {
    let outcome = run(&scene(text), &options(), &mut Quiet).expect("a run");
    assert!(outcome.converged());
    outcome
}

/// u' = -k (u - cos t) with u(0) = 1.
fn forced(k: f64, steps: &str) -> String {
    forced_from(1.0, k, steps)
}

/// The same from another value.
fn forced_from(start: f64, k: f64, steps: &str) -> String {
    format!(
        "wfl 1\nparam k = {k}\nmesh box [0] to [1] cells [1] segment\nunknown u : scalar\n\
         term balance on all : (Dot_u + k*(u - cos(t)))*Test_u\nstart u = {start}\n{steps}\nmeasure m = max(u) on all\n"
    )
}

/// The solution of that equation with u(0) = 0, by variation of constants: it changes at once, so that few steps are those of its start.
fn exact(k: f64, t: f64) -> f64 {
    let c = k / (k * k + 1.0);
    c * (k * t.cos() + t.sin()) - c * k * (-k * t).exp()
}

/// The slope of the logarithm of a number over that of another one.
fn power(of: [f64; 2], over: [f64; 2]) -> f64 {
    (of[1] / of[0]).ln() / (over[1] / over[0]).ln()
}

#[expect(clippy::cast_precision_loss, reason = "thousands")]
fn count(outcome: &Outcome) -> f64 {
    outcome.steps.len() as f64
}

fn largest_error(outcome: &Outcome, k: f64) -> f64 {
    outcome.steps.iter().map(|s| (s.measures[0].1 - exact(k, s.window.end)).abs()).fold(0.0, f64::max)
}

/// Steps of a method of order p have the error h^(p+1): their number grows as the demand to the power -1/(p+1), and the error
/// of all of them falls as the demand to the power p/(p+1).
#[test]
fn bdf_takes_as_many_steps_as_a_method_of_its_order() {
    let demands: [f64; 5] = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7];
    for (scheme, order, k) in [("bdf2", 2.0, 1.0), ("bdf2", 2.0, 100.0), ("bdf3", 3.0, 1.0), ("bdf3", 3.0, 100.0)] {
        let run = |demand: &f64| {
            let steps =
                format!("scheme {scheme}\nsteps t = 0 to 10 by auto with first=1e-8, least=1e-10, error={demand}");
            let outcome = outcome(&forced_from(0.0, k, &steps));
            (largest_error(&outcome, k), count(&outcome))
        };
        let found: Vec<(f64, f64)> = demands.iter().map(run).collect();
        for (pair, demand) in found.windows(2).zip(demands.windows(2)) {
            let demand = [demand[0], demand[1]];
            assert!(pair[1].0 < 0.5 * pair[0].0, "{scheme} {k}: {found:?}");
            // the steps of the start, which double from the first one, are as many for every demand
            let steps = power([pair[0].1, pair[1].1], demand);
            assert!((-1.0 / (order + 1.0) - 0.03..-0.1).contains(&steps), "{scheme} {k}: {steps} {found:?}");
        }
        let [.., before, last] = found[..] else { unreachable!("as many as there are demands") };
        // those of the start are left out: they double until the demand limits them
        let start = (count(&outcome(&forced_from(0.0, k, "steps t = 0 to 1e-3 by auto with first=1e-8, least=1e-10")))
            - 1.0)
            .max(0.0);
        let steps = power([before.1 - start, last.1 - start], [1e-6, 1e-7]);
        assert!((steps + 1.0 / (order + 1.0)).abs() < 0.05, "{scheme} {k}: {steps} {found:?}");
        let error = power([before.0, last.0], [1e-6, 1e-7]);
        assert!((error - order / (order + 1.0)).abs() < 0.15, "{scheme} {k}: {error} {found:?}");
    }
}

/// Without a statement first rates are those of BDF3, and second ones those of BDF2.
#[test]
fn bdf3_is_the_scheme_of_steps_that_the_run_chooses_where_there_are_first_rates_alone() {
    let states = |scheme: &str, rate: &str| {
        let text = format!(
            "wfl 1\nmesh box [0] to [1] cells [1] segment\nunknown u : scalar\n\
             term balance on all : ({rate} + 2*(u - cos(t)))*Test_u\nstart u = 1\n{scheme}\n\
             steps t = 0 to 2 by auto with first=1e-3, error=1e-5\n"
        );
        outcome(&text).steps.iter().map(|s| (s.window.end, s.state.clone())).collect::<Vec<_>>()
    };
    let (first, second) = ("Dot_u", "Dot2_u + Dot_u");
    assert!(states("", first) == states("scheme bdf3", first) && states("", first) != states("scheme bdf2", first));
    assert!(states("", second) == states("scheme bdf2", second) && states("", second) == states("scheme bdf3", second));
}

/// A state is renewed by its text, here of first order: its steps are those of a method of first order.
#[test]
fn a_state_counts_by_the_order_of_its_text() {
    let text = |steps: &str| {
        forced_from(
            0.0,
            1.0,
            &format!("state s : scalar on all := Previous_s + timestep*u\nterm reader on all : 0*s*Test_u\n{steps}"),
        ) + "measure i = mean(s) on all\n"
    };
    let exact = |t: f64| 0.5 * (t.sin() - t.cos() + (-t).exp());
    let run = |demand: f64| {
        let steps = format!("steps t = 0 to 3 by auto with first=1e-7, least=1e-9, error={demand}");
        let outcome = outcome(&text(&steps));
        (
            outcome.steps.iter().map(|s| (s.measures[1].1 - exact(s.window.end)).abs()).fold(0.0, f64::max),
            count(&outcome),
        )
    };
    let (coarse, fine) = (run(1e-4), run(1e-6));
    let (steps, error) = (power([coarse.1, fine.1], [1e-4, 1e-6]), power([coarse.0, fine.0], [1e-4, 1e-6]));
    assert!((steps + 0.5).abs() < 0.05, "{steps} {coarse:?} {fine:?}");
    assert!((error - 0.5).abs() < 0.05, "{error} {coarse:?} {fine:?}");
}

/// Rates of unknowns beside equations without any: the unknown v is what u and t make it.
#[test]
fn an_unknown_without_a_rate_has_the_order_of_the_others() {
    let run = |error: &str| {
        let outcome = outcome(&format!(
            "wfl 1\nmesh box [0] to [1] cells [1] segment\nunknown u : scalar\nunknown v : scalar\n\
             term rate on all : (Dot_u - v)*Test_u\nterm law on all : (exp(v) - 2 - u - sin(t))*Test_v\n\
             start u = 0\nsteps t = 0 to 5 by auto with first=1e-7, least=1e-9, error={error}\n\
             measure m = max(v) on all\n"
        ));
        outcome.steps.last().expect("steps").measures[0].1
    };
    let [coarse, middle, fine] = ["1e-4", "1e-5", "1e-6"].map(run);
    // each is 10^(-2/3) of the one before
    let ratio = (middle - fine) / (coarse - middle);
    assert!((0.1..0.4).contains(&ratio.abs()), "{coarse} {middle} {fine}");
}

/// The formulas once more, by hand: backward Euler once, then BDF2.
#[test]
fn the_steps_are_those_of_bdf2_with_variable_increments() {
    let outcome = outcome(&forced(3.0, "scheme bdf2\nsteps t = 0 to 2 by auto with first=1e-3, error=1e-3"));
    let (mut u, mut quotient) = (1.0, None);
    let (mut widest, mut before): (f64, f64) = (0.0, f64::INFINITY);
    for step in &outcome.steps[1..] {
        let (t, h) = (step.window.end, step.window.increment);
        let (c, history) = match quotient {
            None => (1.0 / h, 0.0),
            Some(q) => ((2.0 * h + before) / (h * (h + before)), -h / (h + before) * q),
        };
        // c (u - u_n) + history + 3 (u - cos t) = 0
        let next: f64 = (c * u - history + 3.0 * t.cos()) / (c + 3.0);
        (quotient, u, widest, before) = (Some((next - u) / h), next, widest.max(h / before), h);
        assert!((step.measures[0].1 - u).abs() < 1e-9, "{} {u} at {t}", step.measures[0].1);
    }
    assert!(widest > 1.2 && widest < 1.0 + 2.0f64.sqrt(), "{widest}");
}

/// The same of the orders that the run chooses: each step is that of BDF2 or of BDF3 from the values before it, most of them
/// of BDF3, and behind steps of BDF3 increments grow by half at most.
#[test]
fn the_steps_are_those_of_bdf2_or_bdf3_with_variable_increments() {
    let outcome = outcome(&forced(3.0, "steps t = 0 to 6 by auto with first=1e-3, error=1e-5"));
    let points: Vec<(f64, f64)> = outcome.steps.iter().map(|s| (s.window.end, s.measures[0].1)).collect();
    // the derivative at the first of some points of the polynomial through them
    let rate = |points: &[(f64, f64)]| -> f64 {
        let t = points[0].0;
        let of = |i: usize| -> f64 {
            let others = || (0..points.len()).filter(move |k| *k != i);
            let basis = |m: usize| {
                let rest = others().filter(|k| *k != m);
                rest.map(|k| (t - points[k].0) / (points[i].0 - points[k].0)).product::<f64>()
                    / (points[i].0 - points[m].0)
            };
            others().map(basis).sum::<f64>() * points[i].1
        };
        (0..points.len()).map(of).sum()
    };
    let mut cubic = vec![false; points.len()];
    for k in 3..points.len() {
        let newest: Vec<(f64, f64)> = points[k - 3..=k].iter().rev().copied().collect();
        // a residual of u' + 3 (u - cos t) relative to the rates of two steps
        let left = |n: usize| (rate(&newest[..n]) + 3.0 * (points[k].1 - points[k].0.cos())).abs();
        let size = 1e-9 / (points[k].0 - points[k - 1].0);
        assert!(left(3) < size || left(4) < size, "{k}: {} {} {size}", left(3), left(4));
        cubic[k] = left(4) < left(3);
        let growth = (points[k].0 - points[k - 1].0) / (points[k - 1].0 - points[k - 2].0);
        assert!(growth < if cubic[k] { 1.5 } else { 2.0 } + 1e-9, "{k}: {growth}");
    }
    let cubics = cubic.iter().filter(|c| **c).count();
    assert!(cubics > points.len() / 2 && !cubic[3], "{cubics} of {}", points.len());
}

#[test]
fn backward_euler_takes_as_many_steps_as_a_method_of_first_order() {
    let mut found = Vec::new();
    for error in ["1e-3", "1e-4", "1e-5", "1e-6"] {
        let steps = format!("scheme backward_euler\nsteps t = 0 to 10 by auto with error={error}");
        let outcome = outcome(&forced_from(0.0, 1.0, &steps));
        found.push((largest_error(&outcome, 1.0), outcome.steps.len()));
    }
    // the error of all steps of a method of order p is that of one step to the power p/(p+1), and so is 1/steps
    for (e, pair) in [1e-3f64, 1e-4, 1e-5].iter().zip(found.windows(2)) {
        assert!(pair[1].0 < 0.5 * pair[0].0 && pair[1].1 > pair[0].1, "{found:?}");
        assert!(pair[0].0 < 3.0 * e.sqrt(), "{found:?}");
    }
}

#[test]
fn steps_end_where_they_must_and_bounds_hold() {
    let outcome = outcome(&forced(1.0, "steps t = 0 to 3.3 by auto with first=1e-3, error=1e-3, most=0.07"));
    let times: Vec<f64> = outcome.steps.iter().map(|s| s.window.end).collect();
    assert_eq!((times[0], times[1], *times.last().unwrap()), (0.0, 1e-3, 3.3));
    assert!(times.windows(2).all(|w| w[1] > w[0] && w[1] - w[0] <= 0.07 * (1.0 + 1e-12)), "{times:?}");
    for (step, pair) in outcome.steps[1..].iter().zip(times.windows(2)) {
        assert_eq!(step.window.increment, pair[1] - pair[0]);
    }
}

#[test]
fn a_limit_is_taken_from_the_state_at_the_beginning_of_a_step() {
    let steps = "steps t = 0 to 2 by auto with first=1e-3, error=0.1, limit=0.05*most/max(u) on all";
    let text = forced(1.0, &format!("param most = 0.8\n{steps}"));
    let outcome = outcome(&text);
    for pair in outcome.steps.windows(2) {
        let limit = 0.05 * 0.8 / pair[0].measures[0].1;
        assert!(
            pair[1].window.increment <= limit * (1.0 + 1e-12),
            "{} at {}",
            pair[1].window.increment,
            pair[0].window.end
        );
        assert_eq!(pair[0].limit, limit);
    }
}

/// A sudden change is found that no formula of the step variable shows: the load jumps where an unknown, which is t, is 1.
#[test]
fn a_sudden_load_is_met_by_shorter_steps_and_rejected_attempts_are_listed() {
    let text = "wfl 1\nmesh box [0] to [1] cells [1] segment\nunknown u : scalar\nstate s : scalar on all := Previous_s + timestep*u\n\
                unknown v : scalar\nterm clock on all : (Dot_v - 1)*Test_v\n\
                term on all : (Dot_u + u - (if v > 1 then 1 else 0))*Test_u\n\
                steps t = 0 to 2 by auto with error=1e-4\nmeasure m = mean(u) on all\nmeasure i = mean(s) on all\n";
    let outcome = outcome(text);
    let rejected = |s: &&wfl_run::StepResult| s.attempts.iter().any(|a| matches!(a.end, AttemptEnd::Rejected(_)));
    let first = outcome.steps.iter().find(rejected).expect("a rejected attempt");
    assert!(first.window.end <= 1.01, "{}", first.window.end);
    let last = outcome.steps.last().unwrap();
    let exact = 1.0 - (-1.0f64).exp();
    assert!((last.measures[0].1 - exact).abs() < 0.01, "{:?}", last.measures);
    // the state is the sum over accepted steps alone
    let sum: f64 = outcome.steps.iter().skip(1).map(|s| s.window.increment * s.measures[0].1).sum();
    assert!((last.measures[1].1 - sum).abs() < 1e-12 * sum, "{sum} {:?}", last.measures);
}

/// A jump that a formula of the step variable shows is met: a step ends there, and none is rejected.
#[test]
fn a_load_that_jumps_over_time_is_met_exactly() {
    let text = "wfl 1\nmesh box [0] to [1] cells [1] segment\nunknown u : scalar\n\
                term on all : (Dot_u + u - (if t > 1 then 1 else 0))*Test_u\n\
                steps t = 0 to 2 by auto with error=1e-4\nmeasure m = max(u) on all\n";
    let outcome = outcome(text);
    assert!(outcome.steps.iter().any(|s| s.window.end == 1.0 && s.measures[0].1 == 0.0));
    let rejected = |a: &wfl_run::Attempt| matches!(a.end, AttemptEnd::Rejected(_));
    assert!(!outcome.steps.iter().flat_map(|s| &s.attempts).any(rejected));
    let last = outcome.steps.last().unwrap().measures[0].1;
    assert!((last - (1.0 - (-1.0f64).exp())).abs() < 0.002, "{last}");
}

/// A load that jumps, one that jumps there and back, and a block that friction holds, lets go and stops again: the higher
/// order costs no steps where the past says nothing, and the error is what one unsmooth step leaves.
#[test]
fn the_higher_order_is_no_worse_where_rates_jump_or_have_a_kink() {
    let loads = ["(if t > 1 then 1 else 0) - u", "(if t > 1 and t < 1.5 then 1 else 0) - u", "max(2*sin(3*t) - 1, 0)"];
    for load in loads {
        let run = |scheme: &str, error: &str| {
            let text = format!(
                "wfl 1\nmesh box [0] to [1] cells [1] segment\nunknown u : scalar\n\
                 term all on all : (Dot_u - ({load}))*Test_u\nscheme {scheme}\n\
                 steps t = 0 to 3 by auto with first=1e-3, most=0.1, error={error}\nmeasure m = max(u) on all\n"
            );
            let outcome = outcome(&text);
            (outcome.steps.last().expect("steps").measures[0].1, count(&outcome))
        };
        let (exact, _) = run("bdf2", "1e-9");
        for error in ["1e-4", "1e-6"] {
            let [second, third] = ["bdf2", "bdf3"].map(|scheme| run(scheme, error));
            let demand: f64 = error.parse().expect("a number");
            assert!((third.0 / exact - 1.0).abs() < 100.0 * demand, "{load} {error}: {third:?} {exact}");
            assert!(third.1 < 1.2 * second.1, "{load} {error}: {third:?} {second:?}");
        }
    }
}

#[test]
fn steps_one_by_one_have_the_bits_of_a_run() {
    let text = forced(30.0, "steps t = 0 to 2 by auto with error=1e-4");
    let known = outcome(&text);
    let scene = scene(&text);
    let mut session = Session::new(&scene, options()).expect("a session");
    let mut n = 0;
    while let Some(step) = session.step(&scene, &mut Quiet).expect("a step") {
        assert_eq!((step.window.end, &step.state), (known.steps[n].window.end, &known.steps[n].state));
        n += 1;
    }
    assert_eq!(n, known.steps.len());
}

/// A bar at rest that another one meets: its first displacement is small beside that of the other, whether the two are one
/// unknown or have their own.
#[test]
fn a_body_at_rest_that_is_met_needs_no_other_steps_as_an_unknown_of_its_own() {
    let scene = |both: &str, [a, b]: [&str; 2], start: &str| {
        outcome(&format!(
            "wfl 1\nmesh box [0,0] to [2.1,0.1] cells [42,1] quad with idle_cells=allowed\n\
             region left = cells where x < 1\nregion right = cells where x > 1.1\n\
             region both = cells where x < 1 or x > 1.1\nregion fl = faces of left where x == 1\n\
             region fr = faces of right where x == 1.1\nmapping m = raytrace from fl onto fr within 0.2\n{both}\n\
             term left on left : 1000*Sym(Grad_{a}):Grad_Test_{a} + 2*Dot2_{a}.Test_{a}\n\
             term right on right : 1000*Sym(Grad_{b}):Grad_Test_{b} + 2*Dot2_{b}.Test_{b}\n\
             def gap = (Interpolate(X, m) + Interpolate({b}, m) - X - {a}).Normal\n\
             term contact on fl : 1e5*pos_part(-gap)*((Test_{a} - Interpolate(Test_{b}, m)).Normal)\n\
             start Dot_{a} = [{start}, 0]\nscheme newmark\nsteps t = 0 to 0.2 by auto with error=1e-3\n\
             measure p = integral(Dot_{b}(1)) on right\n"
        ))
    };
    let one = scene("unknown u : vector on both", ["u", "u"], "if x < 1.05 then 1 else 0");
    let two = scene("unknown a : vector on left\nunknown b : vector on right", ["a", "b"], "1");
    assert_eq!(one.steps.len(), two.steps.len());
    let last = |outcome: &Outcome| outcome.steps.last().expect("a step").measures[0].1;
    assert!(last(&one) > 0.09 && (last(&one) - last(&two)).abs() < 1e-9, "{} {}", last(&one), last(&two));
}

#[test]
fn a_limit_that_is_no_positive_number_is_told_and_limits_nothing() {
    let limited = |limit: &str| outcome(&forced(1.0, &format!("steps t = 0 to 2 by auto with limit={limit}")));
    let free = outcome(&forced(1.0, "steps t = 0 to 2 by auto"));
    for (limit, told) in [("0/(max(u) - max(u)) on all", "not a number"), ("-max(u) on all", "-1e0")] {
        let found = limited(limit);
        assert_eq!(found.steps.len(), free.steps.len());
        let (code, text) = &doubts(&found)[0];
        let behind = format!("behind {} states", found.steps.len() - 1);
        assert!(*code == "W619" && text.contains(told) && text.contains(&behind), "{text}");
    }
    assert_eq!(doubts(&limited("1/max(0*u) on all")), []);
}

#[test]
fn events_are_found_in_time_and_known_to_expect() {
    let text = "wfl 1\nmesh box [0] to [1] cells [1] segment\nunknown u : scalar\n\
                term on all : (Dot_u - 2*pi*cos(2*pi*t))*Test_u\n\
                steps t = 0 to 3 by auto with error=1e-5, most=0.01\nmeasure m = max(u) on all\n\
                event high = max(u) on all > 0.5\nevent low = m < -0.5\n\
                expect high_count == 3\nexpect abs(high_interval - 1) < 0.01\nexpect abs(low_first - 7/12) < 0.01\n";
    let outcome = outcome(text);
    assert!(outcome.expectations.iter().all(|(_, holds)| *holds == Some(true)), "{:?}", outcome.events);
    let (name, high) = &outcome.events[0];
    assert_eq!((name.as_str(), high.len()), ("high", 3));
    for (k, episode) in (0u8..).zip(high) {
        let (begin, end) = (f64::from(k) + 1.0 / 12.0, f64::from(k) + 5.0 / 12.0);
        assert!((episode.begin - begin).abs() < 0.01 && (episode.end.unwrap() - end).abs() < 0.01, "{episode:?}");
    }
    assert_eq!(outcome.report.events.get("high").map(Vec::len), Some(3));
}

/// The example of a fault that weakens with slip, without its scheme: implicit steps of BDF2 with inertia. The closed form
/// has the slip dc/10, dc/2 and dc at 0.18283, 0.33171 and 0.40006 s; the times of the run come near them with the demand.
#[test]
fn a_fault_with_inertia_is_run_by_auto() {
    let path = wfl_tests::examples().join("dynamics/slip_weakening.wfl");
    let text = std::fs::read_to_string(path).expect("the example");
    let exact = [0.182_83, 0.331_71, 0.400_06];
    let run = |demand: f64| {
        let steps = format!("steps t = 0 to 0.6 by auto with first=1e-5, error={demand}");
        let made = text.replace("scheme explicit energy\nsteps t = 0 to 0.6 by auto", &steps);
        assert!(made.contains(&steps));
        let outcome = outcome(&made);
        assert!(outcome.expectations.iter().all(|(_, holds)| *holds == Some(true)), "{:?}", outcome.events);
        let begins = |(_, episodes): &(String, Vec<wfl_run::Episode>)| episodes[0].begin;
        let errors = outcome.events.iter().map(begins).zip(exact).map(|(t, e): (f64, f64)| (t / e - 1.0).abs());
        (errors.fold(0.0, f64::max), outcome.steps.len())
    };
    let (coarse, fine) = (run(1e-3), run(1e-4));
    assert!(coarse.0 < 1e-3 && fine.0 < 2e-4, "{coarse:?} {fine:?}");
    assert!(coarse.1 < 500 && fine.1 < 1500, "{coarse:?} {fine:?}");
}

/// An elastoplastic bar with linear hardening that is pulled, goes back beyond yield, and is pulled again: the plastic strain that
/// is left follows from how far it has gone, E (u - e) - H e = -sy at the turn, which no step passes over: neither the corner of
/// a formula nor the turn of a smooth one.
#[test]
fn no_step_passes_over_the_turn_of_a_load() {
    let turns = [
        "3e-3 - 2.3e-3*(if t > 1 then 1 - abs(t - 2) else 0) - 3e-3*pos_part(1 - t)",
        "3e-3*min(t, 1) - 2.3e-3*min(pos_part(t - 1), pos_part(3 - t))",
        "if t < 1 then 3e-3*t else 1.85e-3 - 1.15e-3*cos(pi*t)",
    ];
    for load in turns {
        for error in ["1e-3", "1e-5"] {
            let found = outcome(&format!(
                "wfl 1\nparam E = 1000\nparam H = 100\nparam sy = 1\nmesh box [0] to [1] cells [2] segment\n\
                 region l = faces where x == 0\nregion r = faces where x == 1\nunknown u : scalar\n\
                 def trial = E*(Grad_u(1) - Previous_ep) - H*Previous_ep\n\
                 def dep = (trial - Ball_projection([trial], sy)(1))/(E + H)\n\
                 state ep : scalar on all := Previous_ep + dep\nstart ep = 1e-3\n\
                 term bar on all : E*(Grad_u(1) - Previous_ep - dep)*Grad_Test_u(1)\nfix u = 0 on l\nfix u = {load} on r\n\
                 steps t = 0 to 2.6 by auto with first=1e-2, error={error}\nmeasure e = mean(ep) on all\n"
            ));
            let left = found.steps.last().expect("steps").measures[0].1;
            let exact = (1000.0 * 0.7e-3 + 1.0) / 1100.0;
            assert!((left / exact - 1.0).abs() < 2e-4, "{load} with {error}: {left}, {exact}");
        }
    }
}

/// While all points stick, the slip that a state keeps is nothing but rounding: it has no error, and the response is linear.
#[test]
fn a_state_that_is_rounding_asks_for_no_steps() {
    let found = outcome(
        "wfl 1\nparam gamma = 1e6\nparam fric = 0.3\nmesh box [0,0] to [1,1] cells [6,6] quad\n\
         region floor = faces where y == 0\nregion top = faces where y == 1\nunknown u : vector\n\
         def tang(w) = w - (w.Normal)*Normal\nterm block on all : 1000*Sym(Grad_u):Grad_Test_u\n\
         def press = gamma*pos_part(u.Normal)\ndef trial = gamma*(tang(u) - Previous_slid)\n\
         def q = Ball_projection(trial, fric*press)\nstate slid : vector on floor := tang(u) - q/gamma\n\
         term contact on floor : (press*Normal + q).Test_u\nsteps t = 0 to 0.1 by auto with first=1e-2, error=1e-4\n\
         fix u = [1e-3*t, -5e-3] on top\nmeasure slip = max(Norm(slid)) on floor\n",
    );
    assert!(found.steps.len() < 40, "{} steps", found.steps.len());
    assert!(found.steps.iter().all(|s| s.measures[0].1 < 1e-15));
    assert!(doubts(&found).iter().all(|(code, _)| *code != "W618"));
}
