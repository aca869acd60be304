//! The same law in other words takes the same path: what a positive part is written with decides nothing.

use wfl_tests::{doubts, solved};

/// A block on a rough floor under a lid that goes round; `pressure` is the law of what presses, of the overlap `over`.
fn block(pressure: &str, cells: &str) -> String {
    let (corner, top, far, hold) = match cells {
        "hex" => ("[2,1,1] cells [3,2,2] hex", "z", "-u(3) - 0.008*x", "[0.03*sin(2*t), 0.02*(1 - cos(3*t)), lift]"),
        _ => ("[2,1] cells [4,2] quad", "y", "-u(2) - 0.008*x", "[0.03*sin(2*t), lift]"),
    };
    let (down, along) = if cells == "hex" { ("3", "[u(1), u(2), 0]") } else { ("2", "[u(1), 0]") };
    let zero = if cells == "hex" { "[0,0,0]" } else { "[0,0]" };
    format!(
        "use \"elasticity\"\nmesh box {zero} to {corner}\nregion floor = faces where {top} == 0\nregion lid = faces where {top} == 1\n\
         unknown u : vector Q1\nparam k = 2e4\nterm body on all : work(u, Test_u, 100, 0.3)\ndef over = {far}\n\
         def pressure = {pressure}\ndef trial = k*({along} - Previous_slid)\ndef drag = Ball_projection(trial, 0.4*pressure)\n\
         state slid : vector on floor := {along} - drag/k\n\
         term rough on floor : -pressure*Test_u({down}) + drag.Test_u\ndef lift = -0.04 + 0.01*cos(4*t) + 0.02*x*t\n\
         fix u = {hold} on lid\nsteps t = 0 to 2 by 0.25\nmeasure pressed = integral(pressure) on floor\n\
         measure dragged = integral(drag(1)) on floor\n"
    )
}

#[test]
fn a_pressure_takes_its_path_in_any_words() {
    for cells in ["quad", "hex"] {
        let run = |pressure: &str| {
            let found = solved(block(pressure, cells));
            assert_eq!(doubts(&found.outcome), [], "{cells} {pressure}");
            let iterations: usize = found.outcome.steps.iter().map(|step| step.history.n_iterations()).sum();
            (iterations, ["pressed", "dragged"].map(|name| found.measure(8, name)))
        };
        let (iterations, results) = run("pos_part(k*over)");
        for pressure in [
            "max(0, k*over)",
            "max(over, 0)*k",
            "(if over > 0 then k*over else 0)",
            "(if over < 0 then 0 else k*over)",
            "-min(0, -k*over)",
        ] {
            let (own, is) = run(pressure);
            assert!(own <= iterations + 3, "{cells} {pressure}: {own} {iterations}");
            for (is, should) in is.iter().zip(results) {
                assert!((is - should).abs() < 1e-8 * should.abs(), "{cells} {pressure}: {is} {should}");
            }
        }
    }
}
