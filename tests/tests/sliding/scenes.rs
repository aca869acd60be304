//! Scenes of `examples/sliding` against closed forms: two half rings, a capstan, a disc that rolls or slides.

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
