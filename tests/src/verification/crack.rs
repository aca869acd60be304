//! B7, B8: cracks in a plate, closed with friction and opened by a pressure.

use super::{
    Benchmark, Case, Tolerance,
    common::{example, or_failed},
};
use crate::reference;

/// The benchmarks of this file.
pub(super) const BENCHMARKS: &[Benchmark] = &[
    Benchmark {
        id: "B7",
        title: "closed crack under compression with friction",
        origin: "closed form (Phan et al. 2003), factors of the finite plate by an independent program (`physics_closed_forms.json`)",
        slow: true,
        open: None,
        run: closed,
    },
    Benchmark {
        id: "B8",
        title: "pressurised crack",
        origin: "closed form (Sneddon), factors of the finite plate by an independent program (`physics_closed_forms.json`)",
        slow: true,
        open: None,
        run: opened,
    },
];

/// Half width of the plate over that of the crack, and the factor on the closed form.
fn plates(key: &str) -> Vec<(f64, f64)> {
    let data = reference("physics_closed_forms.json");
    let list = |v: &serde_json::Value| -> Vec<f64> {
        v.as_array().map(|l| l.iter().filter_map(serde_json::Value::as_f64).collect()).unwrap_or_default()
    };
    let finite = &data[key]["finite_box"];
    list(&finite["W_over_b"]).into_iter().zip(list(&finite["ratio"])).collect()
}

fn number(key: &str, name: &str) -> f64 {
    reference("physics_closed_forms.json")[key]["expected"][name].as_f64().unwrap_or(f64::NAN)
}

/// The scene's grading across the crack for another plate: the thinnest of its 30 cells stays what it is.
fn grading(exponent: f64, scene_width: f64, width: f64) -> String {
    let exponent = exponent + (width / scene_width).ln() / 30f64.ln();
    format!("sign(s)*W*abs(s/3)^{exponent}")
}

fn closed() -> Vec<Case> {
    let cases = plates("frictional_crack").into_iter().map(|(width, factor)| {
        let what = format!("W/b = {width}");
        let made =
            example("crack/compression.wfl", &[("sign(s)*W*sqr(s/3)", grading(2.0, 5.0, width))], &[("W", width)]).map(
                |solved| {
                    let slip = number("frictional_crack", "centre_slip") * factor;
                    // the reference is in Pa, the scene in MPa
                    let traction = number("frictional_crack", "normal_traction") * 1e-6;
                    Case::new(&what)
                        .compare("slip at the centre", solved.measure(0, "slip"), slip, Tolerance::Relative(1e-3))
                        .compare("normal traction", solved.measure(0, "traction"), traction, Tolerance::Relative(1e-2))
                },
            );
        or_failed(&what, made)
    });
    cases.collect()
}

fn opened() -> Vec<Case> {
    let cases = plates("sneddon").into_iter().map(|(width, factor)| {
        let what = format!("W/b = {width}");
        let made =
            example("crack/pressure.wfl", &[("sign(s)*W*abs(s/3)^2.5", grading(2.5, 10.0, width))], &[("W", width)])
                .map(|solved| {
                    let centre = number("sneddon", "centre") * factor;
                    Case::new(&what).compare(
                        "opening at the centre",
                        solved.measure(0, "opening"),
                        centre,
                        Tolerance::Relative(1e-3),
                    )
                });
        or_failed(&what, made)
    });
    cases.collect()
}
