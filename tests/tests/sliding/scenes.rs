//! Scenes of `examples/sliding` against closed forms: two half rings, a capstan, a disc that rolls or slides, gears, a hook.

use wfl_tests::{Solved, doubts, examples, solve};

use super::measure;

/// A scene of the examples with some texts replaced.
fn example(name: &str, edits: &[(&str, &str)]) -> Solved {
    let folder = examples().join("sliding");
    let text = std::fs::read_to_string(folder.join(name)).expect("an example");
    for (from, _) in edits {
        assert!(text.contains(from), "{name} has `{from}`");
    }
    let text = edits.iter().fold(text, |text, (from, to)| text.replace(from, to));
    let found = solve(&folder, text, &[], &[]).unwrap_or_else(|e| panic!("{e}"));
    assert!(found.outcome.converged(), "{name}: {:?}", doubts(&found.outcome));
    found
}

/// By symmetry the force along the way is odd, that across it and the energies are even; without contact there is none.
#[test]
fn half_rings_have_odd_and_even_forces() {
    let found = example("half_rings.wfl", &[]);
    assert!(found.outcome.warnings.is_empty(), "{:?}", doubts(&found.outcome));
    for (name, sign) in [("drive", -1.0), ("lift", 1.0), ("inside", 1.0), ("layer", 1.0)] {
        let values = measure(&found, name);
        let size = values.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let last = values.len() - 1;
        assert!(last == 8 && size > 1e-6, "{name}: {values:?}");
        for k in 0..=last {
            let (here, there) = (values[k], sign * values[last - k]);
            assert!((here - there).abs() < 1e-9 * size, "{name} at step {k}: {here}, {there} of {size}");
        }
    }
}

/// What the hands do on a part of the way, by Simpson's rule, is the change of what is stored, but for the points that come into
/// contact between two steps.
#[test]
fn half_rings_store_the_work_of_the_hands() {
    let found = example("half_rings.wfl", &[("s = -8 to 8 by 2", "s = -3 to -1 by 0.125"), ("\nexpect", "\n# expect")]);
    let from = |name: &str| measure(&found, name);
    let (drive, inside, layer) = (from("drive"), from("inside"), from("layer"));
    let last = drive.len() - 1;
    let weight = |k: usize| match (k == 0 || k == last, k % 2) {
        (true, _) => 1.0,
        (_, 1) => 4.0,
        _ => 2.0,
    };
    let work: f64 = drive.iter().enumerate().map(|(k, force)| -force * weight(k) * 0.15 * 0.125 / 3.0).sum();
    let change = inside[last] + layer[last] - inside[0] - layer[0];
    assert!(last == 16 && change > 1e-4 && (work - change).abs() < 1.5e-3 * change, "{work} {change}");
}

/// The ratio of the forces at the ends of a belt is that of Euler and Eytelwein, whatever the increments.
#[test]
fn a_capstan_has_the_ratio_of_euler_and_eytelwein() {
    let found = example("capstan.wfl", &[]);
    assert!(found.outcome.warnings.is_empty(), "{:?}", doubts(&found.outcome));
    let ratio = *measure(&found, "ratio").last().expect("steps");
    let exact = (0.3 * std::f64::consts::FRAC_PI_2 / 1.01).exp();
    assert!((ratio / exact - 1.0).abs() < 1e-3, "{ratio} in place of {exact}");
    let coarse = example("capstan.wfl", &[("s = 0 to 1 by 0.25", "s = 0 to 1 by 0.5")]);
    let other = *measure(&coarse, "ratio").last().expect("steps");
    assert!((ratio - other).abs() < 1e-9, "{ratio} {other}");
}

/// A disc on an incline rolls, or slides where that is steep: acceleration and angular acceleration are those of a rigid one.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_disc_rolls_or_slides_down_an_incline() {
    let (g, fric, end) = (1.0, 0.2, 2.4);
    let mild = std::f64::consts::PI / 9.0;
    let steep = std::f64::consts::FRAC_PI_4;
    let rolls = 2.0 / 3.0 * g * mild.sin();
    let slides = [g * (steep.sin() - fric * steep.cos()), 2.0 * fric * g * steep.cos()];
    let unchecked = ("\nexpect", "\n# expect");
    let cases = [
        (example("rolling.wfl", &[]), [rolls, rolls], 1e-2),
        (example("rolling.wfl", &[("incline = pi/9", "incline = pi/4"), unchecked]), slides, 2e-2),
    ];
    for (found, [speed, spin], turned) in cases {
        let last = |name: &str| *measure(&found, name).last().expect("steps");
        assert!((last("speed") / (speed * end) - 1.0).abs() < 5e-3, "{} in place of {}", last("speed"), speed * end);
        // the lever of friction is shorter than the radius by the overlap of the penalty, 0.02 of it
        assert!((last("spin") / (spin * end) - 1.0).abs() < turned, "{} in place of {}", last("spin"), spin * end);
        assert!((last("cy") - 0.98).abs() < 0.01, "{}", last("cy"));
    }
}

/// The force between involute teeth goes along the common tangent of the base circles: torques are as numbers of teeth are,
/// in each state nearly (edges of tips touch, too), and over a pitch better.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn gears_have_torques_as_their_numbers_of_teeth() {
    let found = example("gears.wfl", &[]);
    assert!(found.outcome.warnings.is_empty(), "{:?}", doubts(&found.outcome));
    let (driving, driven) = (measure(&found, "driving"), measure(&found, "driven"));
    for (step, (one, other)) in driving.iter().zip(&driven).enumerate().skip(1) {
        assert!(*one > 1e3 && (other / one - 1.5).abs() < 0.04, "step {step}: {one} {other}");
    }
    let ratio = driven.iter().sum::<f64>() / driving.iter().sum::<f64>();
    assert!((ratio - 1.5).abs() < 7e-3, "{ratio}");
}

/// Where the tip is highest the normals of nose and ledge are upright: the hand carries friction alone, and the force across is
/// that of a cantilever under it. Where nothing touches there is no force, in few iterations, and nothing is doubted.
#[test]
fn a_hook_snaps_with_the_force_of_a_beam() {
    let found = example("snap_fit.wfl", &[]);
    assert!(found.outcome.warnings.is_empty(), "{:?}", doubts(&found.outcome));
    let (ahead, across, tip) = (measure(&found, "ahead"), measure(&found, "across"), measure(&found, "tip"));
    let top = (1..tip.len() - 1).max_by(|a, b| tip[*a].total_cmp(&tip[*b])).expect("steps");
    // the parabola through three states has its vertex there
    let [a, b, c] = [tip[top - 1], tip[top], tip[top + 1]];
    let at = 0.5 * (a - c) / (a - 2.0 * b + c);
    let there = |of: &[f64]| {
        of[top] + 0.5 * at * (of[top + 1] - of[top - 1]) + 0.5 * at * at * (of[top + 1] - 2.0 * of[top] + of[top - 1])
    };
    let ratio = there(&ahead) / there(&across);
    assert!((ratio / -0.2 - 1.0).abs() < 0.1, "{ratio}");
    // E' = E/(1 - nu^2) with nu = 1/4, I = h^3/12; a force at 9 of a length of 10
    let stiffness = 1e3 / (1.0 - 0.25f64.powi(2)) * 0.6f64.powi(3) / 12.0;
    let beam = there(&across) * (9f64.powi(3) / 3.0 + 9f64.powi(2) / 2.0) / stiffness;
    assert!((there(&tip) / beam - 1.0).abs() < 0.03, "{} {beam}", there(&tip));
    let is_free = |k: &usize| across[*k].abs() < 1e-9;
    let free: Vec<usize> = (1..tip.len()).filter(is_free).collect();
    assert!(free.len() > 20 && free.iter().all(|k| ahead[*k].abs() < 1e-9), "{free:?}");
    let of_points = |k: usize| found.outcome.steps[k].history.iterations.last().and_then(|i| i.contact);
    // also at the start, where nothing has moved and no point has a force
    assert!(free.iter().chain(&[0]).all(|k| of_points(*k).is_some_and(|[_, slip, stick]| slip + stick == 0)));
    let iterations: Vec<usize> = free.iter().map(|k| found.outcome.steps[*k].history.n_iterations()).collect();
    // the first step, and the one that lets go
    assert!(iterations.iter().filter(|n| **n > 3).count() <= 2, "{iterations:?}");
}

/// A stiff layer: between bodies that are not linear no step is held for long (407 iterations where it is, 202 where it is not).
#[test]
fn a_hook_with_a_stiff_layer_is_not_held() {
    let found = example("snap_fit.wfl", &[("gamma = 100", "gamma = 2e3")]);
    let iterations: usize = found.outcome.steps.iter().map(|s| s.history.n_iterations()).sum();
    assert!(iterations < 300, "{iterations}");
}
