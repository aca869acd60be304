//! Flow, deformation and slip of faults against closed forms and numbers of other programs, in scenes of their own: to the
//! digits that the sources support on meshes that take seconds.
//!
//! References: `biot.json`, `fracture_flow.json`, `crack_flow.json`, `injection_slip.json`, `displaced_reservoir.json`. The
//! scenes of `examples/poro` are run by the suite of scenes; what they conserve is asked here.

use serde_json::Value;
use wfl_tests::{Solved, doubts, examples, files, reference, solve};

fn number(value: &Value) -> f64 {
    value.as_f64().or_else(|| value["value"].as_f64()).unwrap_or_else(|| panic!("no number: {value}"))
}

/// The row of a table with this value of a column; the last one, which is that of the finest mesh.
fn row(table: &Value, column: &str, at: f64) -> Value {
    let rows = table.as_array().expect("a table").iter();
    rows.rev().find(|row| number(&row[column]) == at).unwrap_or_else(|| panic!("no row {column} = {at}")).clone()
}

fn last(found: &Solved, name: &str) -> f64 {
    found.measure(found.outcome.steps.len() - 1, name)
}

fn assert_near(what: &str, is: f64, should: f64, within: f64) {
    assert!((is / should - 1.0).abs() < within, "{what}: {is}, {should}: {:e}", is / should - 1.0);
}

/// A scene that gives no cause to doubt its numbers, but for the codes that are named.
fn sound(text: &str, params: &[(&str, f64)], known: &[&str]) -> Solved {
    let found = solve(&examples(), text.to_owned(), &[], params).unwrap_or_else(|e| panic!("{e}"));
    let told = doubts(&found.outcome);
    assert!(told.iter().all(|d| known.contains(&d.0)), "{told:?}");
    found
}

/// Where the parabola through three points is the highest, and its value there.
fn top([a, b, c]: [[f64; 2]; 3]) -> (f64, f64) {
    let (left, right) = ((b[1] - a[1]) / (b[0] - a[0]), (c[1] - b[1]) / (c[0] - b[0]));
    let curve = (right - left) / (c[0] - a[0]);
    let x = 0.5 * (a[0] + b[0]) - 0.5 * left / curve;
    (x, a[1] + (x - a[0]) * (left + curve * (x - b[0])))
}

/// A column that is loaded on its drained top at once. The first steps are shorter than the cells can follow (W649).
const COLUMN: &str = "use \"poro\"\nuse \"elasticity\"\nparam last = 0.1\nmesh box [0,0] to [0.02,1] cells [1,24] quad \
    map [x, 1 - (exp(1.5*(1 - y)) - 1)/(exp(1.5) - 1)]\nregion top = faces where y == 1\nregion floor = faces where y == 0\n\
    region sides = faces where x == 0 or x == 0.02\nunknown u : vector Q3\nunknown p : scalar Q2\n\
    term momentum on all : sigma(u, 1000, 0.25):Grad_Test_u\nterm rock on all : biot(u, p, 1) + darcy(p, 1e-3)\n\
    load u = [0,-10] on top\nfix u(1) = 0 on sides\nfix u(2) = 0 on floor\nfix p = 0 on top\n\
    steps t = 0 to last/1.2 by auto with first=1e-6, error=1e-7\nbalance water of p\n\
    measure pressure = value(p/10) at [0,0]\nmeasure settled = value(-120*u(2)) at [0,1]\n";

#[test]
fn a_column_consolidates_as_the_series_of_terzaghi() {
    let series = reference("biot.json");
    for (time, within) in [(0.1, 1e-6), (1.0, 5e-5)] {
        let found = sound(COLUMN, &[("last", time)], &["W649"]);
        let should = row(&series["terzaghi"]["table"], "T", time);
        assert_near("pressure", last(&found, "pressure"), number(&should["p_bottom_over_q"]), within);
        assert_near("degree", last(&found, "settled"), number(&should["degree"]), 1e-5);
    }
}

/// A quarter of a block between rigid plates, drained at its sides.
const BLOCK: &str = "use \"poro\"\nuse \"elasticity\"\nparam alpha = 1\nparam s = 0\nparam last = 0.09\n\
    mesh box [0,0] to [1,0.5] cells [20,2] quad map [1 - (1 - x)^1.5, y]\nregion plate = faces where y == 0.5\n\
    region floor = faces where y == 0\nregion middle = faces where x == 0\nregion side = faces where x == 1\n\
    unknown u : vector Q3\nunknown p : scalar Q2\nunknown d : scalar global\nmultiplier l : scalar Q3 on plate\n\
    term momentum on all : sigma(u, 1000, 0.2):Grad_Test_u\n\
    term rock on all : biot(u, p, alpha) + darcy(p, 1e-3) + storage(p, s)\n\
    term contact on plate : l*(Test_u(2) + Test_d) + (u(2) + d)*Test_l\nterm force on global : -10*Test_d\n\
    fix u(1) = 0 on middle\nfix u(2) = 0 on floor\nfix p = 0 on side\nbalance water of p\n\
    steps t = 0 to last by auto with first=1e-6, error=1e-7\nmeasure pressure = value(p) at [0,0]\n\
    measure half = value(p) at [0.5,0]\nmeasure sinks = value(u(2)) at [0,0.5]\nmeasure spreads = value(u(1)) at [1,0]\n";

/// Both sets of parameters at `c t/a^2 = 0.1`, and the peak of the pressure before.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_block_between_plates_has_the_pressures_of_mandel() {
    let series = reference("biot.json");
    for (case, storage) in [("mandel", 0.0), ("mandel_compressible", 1e-3)] {
        let should = row(&series[case]["table"], "T", 0.1);
        let params = [("alpha", number(&series[case]["alpha"])), ("s", storage), ("last", number(&should["t"]))];
        let found = sound(BLOCK, &params, &["W649"]);
        for (name, key) in [("pressure", "p_centre"), ("half", "p_half"), ("sinks", "uy_plate"), ("spreads", "ux_side")]
        {
            assert_near(name, last(&found, name), number(&should[key]), 3e-6);
        }
        let of = |step: usize| found.measure(step, "pressure");
        let most = (1..found.outcome.steps.len()).max_by(|a, b| of(*a).total_cmp(&of(*b))).expect("steps");
        let (time, most) = top([most - 1, most, most + 1].map(|k| [found.outcome.steps[k].window.end, of(k)]));
        let peak = &series[case]["peak_centre"];
        assert_near("peak", most, number(&peak["p"]), 3e-6);
        assert_near("its time", time, number(&peak["T"]) * number(&should["t"]) / 0.1, 0.01);
    }
}

/// A square with a fracture along |x| < 1, cells crowded at its tips, at its middle and beside it.
fn square(n: usize) -> String {
    format!(
        "use \"poro\"\nparam C = 1\nparam below_k = 5\nparam above_k = 5\n\
         def half(s) = if s < 1 then 0.5*s^3 else (if s < 2 then 1 - 0.5*(2 - s)^3 else 1 + (s - 2)^3)\n\
         mesh box [-3,-1] to [3,1] cells [{},{}] tri map [sign(x)*half(abs(x)), 2*sign(y)*abs(y)^3]\n\
         region below = cells where y < 0\nregion above = cells where y > 0\n\
         region crack = interface from below to above & faces of below where y == 0 and abs(x) < 1.0001\n\
         region well = nodes of crack where abs(x) < 1e-9\nunknown p : scalar P2\nterm rock on all : darcy(p, 1)\n\
         fix p = 0 on boundary\nmeasure outflow = reaction(p) on boundary\n",
        6 * n,
        2 * n
    )
}

/// The rock has one pressure, which the fracture conducts along itself.
#[test]
fn a_fracture_with_the_pressure_of_the_rock_feeds_it() {
    let text = square(16)
        + "term flow on crack : C*(Grad_p - (Grad_p.Normal)*Normal).Grad_Test_p\nload p = 1 on well\n\
           measure p0 = value(p) at [0,0]\nmeasure p_half = value(p) at [0.5,0]\nmeasure p_tip = value(p) at [1,0]\n";
    for conductivity in [1.0, 10.0, 100.0] {
        let found = sound(&text, &[("C", conductivity)], &[]);
        let should = &reference("fracture_flow.json")[format!("continuous_C{conductivity}")];
        for name in ["p0", "p_half", "p_tip"] {
            assert_near(name, found.measure(0, name), number(&should[name]), 2e-4);
        }
        assert_near("outflow", found.measure(0, "outflow"), 1.0, 1e-9);
    }
}

/// It has one of its own, and the rock one on each side.
#[test]
fn a_fracture_with_a_pressure_of_its_own_leaks_through_each_side() {
    let text = square(24)
        + "unknown pf : scalar P2 on crack\nsplit p across crack\ndef beyond(v) = Interpolate(v, neighbor_element)\n\
           term flow on crack : along_fault(pf, C)\nterm lower on crack : leakoff_here(pf, p, below_k)\n\
           term upper on crack : above_k*(pf - beyond(p))*(Test_pf - beyond(Test_p))\nload pf = 1 on well\n\
           measure pf0 = value(pf) at [0,0]\nmeasure pf_half = value(pf) at [0.5,0]\n\
           measure pf_tip = value(pf) at [1,0]\nmeasure leak_below = integral(below_k*(pf - p)) on crack\n\
           measure leak_above = integral(above_k*(pf - beyond(p))) on crack\nbalance water of p, pf\n";
    for (case, numbers) in [
        ("exchange_C10_k5_5", [10.0, 5.0, 5.0]),
        ("exchange_C10_k5_0.5", [10.0, 5.0, 0.5]),
        ("exchange_C1_k100_0.001", [1.0, 100.0, 1e-3]),
    ] {
        let names = ["C", "below_k", "above_k"];
        let params: Vec<(&str, f64)> = names.into_iter().zip(numbers).collect();
        let found = sound(&text, &params, &[]);
        let should = &reference("fracture_flow.json")[case];
        for name in ["pf0", "pf_half", "pf_tip", "leak_below", "leak_above"] {
            assert_near(&format!("{case} {name}"), found.measure(0, name), number(&should[name]), 3e-4);
        }
        assert_near("outflow", found.measure(0, "outflow"), 1.0, 1e-9);
    }
}

/// A disc in space that leaks, fed in r < 0.5: a thin sector of it in a plane that no axis is in.
const DISC: &str = "use \"poro\"\nparam e = 1e-3\nparam a = 0.01\ndef r(s) = if s < 1 then e + (0.5 - e)*s else 0.5*s\n\
    mesh box [0,-1,0] to [2,1,1] cells [32,1,1] hex \
    map [r(x)*cos(a*y), 0.8*r(x)*sin(a*y) - 0.06*z, 0.6*r(x)*sin(a*y) + 0.08*z]\n\
    region disc = faces where abs(0.8*z - 0.6*y) < 1e-9\n\
    region middle = faces where abs(0.8*z - 0.6*y) < 1e-9 and x < 0.5\nunknown p : scalar Q2 on disc\n\
    term flow on disc : along_fault(p, 2) + 3*p*Test_p\nload p = 4/pi on middle\n\
    measure p_centre = value(p) at [e*cos(a),0.8*e*sin(a),0.6*e*sin(a)]\n\
    measure p_r0 = value(p) at [0.5*cos(a),0.4*sin(a),0.3*sin(a)]\n\
    measure p_075 = value(p) at [0.75*cos(a),0.6*sin(a),0.45*sin(a)]\n\
    measure p_rim = value(p) at [cos(a),0.8*sin(a),0.6*sin(a)]\n";

#[test]
fn a_disc_that_leaks_has_the_pressures_of_bessel() {
    let found = sound(DISC, &[], &[]);
    let should = &reference("fracture_flow.json")["disc_leak_off_wide_source"];
    for name in ["p_centre", "p_r0", "p_075", "p_rim"] {
        assert_near(name, found.measure(0, name), number(&should[name]), 2e-5);
    }
}

/// A quarter of a large plate with a crack of fixed length that a viscous fluid opens.
const CRACK: &str = "use \"poro\"\nuse \"elasticity\"\nparam n = 16\nparam m = 30\nparam tip = 1 - sin(pi/2*(n - 1)/n)\n\
    def right(s) = if s <= n then sin(pi/2*s/n) else 1 + tip*(exp(0.3*(s - n)) - 1)/0.3\n\
    def up(s) = tip*(exp(0.3*s) - 1)/0.3\nmesh box [0,0] to [n + m,m] cells [n + m,m] quad map [right(x), up(y)]\n\
    region crack = faces where y == 0 and x < 1.00001\nregion ahead = faces where y == 0 and x > 0.99999\n\
    region middle = faces where x == 0\nregion far = boundary - crack - ahead - middle\nunknown u : vector Q2\n\
    unknown pf : scalar Q1 on crack\ndef w = 1e-4 + 2*u(2)\nterm elastic on all : work(u, Test_u, 25000, 0.25)\n\
    term fluid on crack : -pf*Test_u(2)\nterm volume on crack : STORED\n\
    term flow on crack : along_fault(pf, cubic(w, 1e-7/12))\nload pf = 15*1e-6/16*(1 - x^2)^2 on crack\n\
    fix u(1) = 0 on middle\nfix u(2) = 0 on ahead\nfix u = [0,0] on far\nbalance water of pf\n\
    measure p_mid = value(pf) at [0,0]\nmeasure p_half = value(pf) at [0.5,0]\nmeasure p_tip = value(pf) at [1,0]\n\
    measure volume = integral(4*u(2)) on crack\n";

/// Its equations are no derivative of an energy: nothing is said of its stability.
#[test]
fn a_crack_that_is_filled_has_the_pressures_of_chebyshev() {
    let should = reference("crack_flow.json");
    let filled = CRACK.replace("STORED", "filling(w, pf)") + "steps t = 0 to 20 by 1\n";
    let leaks = CRACK.replace("STORED", "1e-5*pf*Test_pf");
    let at_20 = row(&should["transient"], "t", 20.0);
    for (text, should, within) in [(filled, &at_20, 2e-3), (leaks, &should["steady_leak_off"], 2e-4)] {
        let found = sound(&text, &[], &[]);
        for name in ["p_mid", "p_half", "p_tip"] {
            assert_near(name, last(&found, name), number(&should[name]), within);
        }
        if within > 1e-3 {
            assert_near("volume", last(&found, "volume"), 2e-5, 1e-11);
        }
    }
}

/// Distances on a fault that slips for |x| < 1: crowded at the well, equal up to 1, growing beyond.
const CROWDED: &str = "use \"poro\"\nparam h = 1/250\nparam x1 = h*(exp(3.6) - 1)\nparam hu = (1 - x1)/29\n\
    def beyond1(s) = 1 + hu*(exp(0.22*(s - 47)) - 1)/0.22\ndef up(s) = h*(exp(0.22*s) - 1)\n\
    def out(s) = if s <= 18 then h*(exp(0.2*s) - 1) else (if s <= 47 then x1 + (s - 18)*hu else beyond1(s))\n";

/// Shear traction with a friction bound that fluid lowers; the front is at 0.6 at the end.
const SLIPS: &str = "unknown u : scalar Q1\nunknown p : scalar Q1 on path\nmultiplier tau : scalar Q1 on fault\n\
    term elastic on all : Grad_u.Grad_Test_u\nterm storage on path : Rate(p)*Test_p\n\
    term flow on path : along_fault(p, 1)\nterm shear on fault : (tau - f_sigma + T)*Test_u\n\
    term law on fault : \
    -1/20*(tau - Ball_projection(tau + 20*(u - Previous_u), pos_part(f_sigma - p)))*Test_tau\n\
    quadrature on fault vertex\nfix u = 0 on beyond, far\nstart tau = f_sigma - T\nparam end = (0.6/lambda)^2/4\n\
    steps t = 0 to end by end/m\nbalance water of p\n";

/// The front of slip and the slip in the middle in the plane, with a pressure that is solved for: ahead of the fluid and
/// behind it.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn slip_runs_ahead_of_the_fluid_or_behind_it_in_the_plane() {
    let text = format!(
        "{CROWDED}param T = 0.5\nparam lambda = 1\nparam f_sigma = 1.5\nparam m = 160\n\
         mesh box [0,0] to [69,40] cells [69,40] quad map [out(x), up(y)]\nregion path = faces where y == 0\n\
         region fault = faces where y == 0 and x < 1.001\nregion beyond = faces where y == 0 and x > 1 + 0.9*hu\n\
         region well = nodes of path where x == 0\nregion middle = faces where x == 0\n\
         region far = boundary - path - middle\n{SLIPS}fix p = 1 on well\nmeasure slip = value(2*u) at [0,0]\n\
         measure front = integral(Heaviside(u - 1e-6)) on fault\n\
         measure missed = max(abs(p - erfc(x/sqrt(4*max(t, 1e-12))))) at nodes of fault\n"
    );
    let table = &reference("injection_slip.json")["two_d"];
    for (stress, missed) in [(0.01, 4e-3), (0.1, 2e-3), (0.5, 1e-3), (0.9, 1e-3)] {
        let should = row(table, "T", stress);
        let found = sound(&text, &[("T", stress), ("lambda", number(&should["lam"]))], &[]);
        let what = |name: &str| format!("T = {stress}: {name}");
        assert_near(&what("slip"), last(&found, "slip"), 0.6 * number(&should["slip_centre"]), 6e-3);
        // a face has a length of 0.03
        assert!((last(&found, "front") - 0.6).abs() < 0.03, "{}", what("front"));
        assert!(last(&found, "missed") < missed, "{} {}", what("pressure"), last(&found, "missed"));
    }
}

/// The same in space without transverse strain, where slip is round and the fluid comes at a constant rate through a well:
/// a thin sector, fed along its inner rim.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn slip_around_a_well_has_the_front_of_its_closed_form() {
    let text = format!(
        "{CROWDED}param T = 0.1\nparam lambda = 1\nparam f_sigma = 20\nparam m = 50\nparam r0 = 1e-3\nparam a = 0.02\n\
         def r = sqrt(x^2 + y^2)\ndef radius(s) = r0 + out(s)\n\
         mesh box [0,-1,0] to [63,1,34] cells [63,1,34] hex map [radius(x)*cos(a*y), radius(x)*sin(a*y), up(z)]\n\
         region path = faces where z == 0\nregion fault = faces where z == 0 and r < 1.002\n\
         region beyond = faces where z == 0 and r > 1 + 0.9*hu\nregion well = rim of path where r < 1.001*r0\n\
         region far = faces where r > 5 or z > 5\n{SLIPS}load p = 4*a/(2*r0*sin(a)) on well\n\
         measure slip = value(2*u) at [r0*cos(a),r0*sin(a),0]\n\
         measure area = integral(Heaviside(u - 1e-6)/(sin(a)*cos(a))) on fault\n"
    );
    let table = &reference("injection_slip.json")["three_d"];
    for stress in [0.1, 1.0] {
        let should = row(table, "T", stress);
        let found = sound(&text, &[("T", stress), ("lambda", number(&should["lam"]))], &[]);
        assert_near("slip", last(&found, "slip"), 0.6 * number(&should["slip_centre"]), 0.012);
        assert_near("front", last(&found, "area").sqrt(), 0.6, 0.03);
    }
}

/// The depleted reservoir of the examples under other bounds of the shear traction: free to slip, and locked where the
/// bound is high. Faces have a length of 18.75.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_depleted_reservoir_slips_as_its_dislocations() {
    let text = std::fs::read_to_string(examples().join("poro/reservoir.wfl")).expect("the example");
    let own: String = text.lines().filter(|line| !line.starts_with("expect")).flat_map(|line| [line, "\n"]).collect();
    let own = own
        + "param least = 5e-4 [m]\nmeasure locked = value(tau) at [0,0]\n\
           measure forth = integral(Heaviside(-jump(u)(2) - least)/2) on fault\n";
    let should = reference("displaced_reservoir.json");
    for bound in [2.0, 4.0, 6.0] {
        let should = row(&should["friction"], "B", bound);
        let found = sound(&own, &[("B", bound)], &[]);
        assert_near("slip", found.measure(0, "slip"), number(&should["slip_max"]), 0.04);
        let [first, end] = [&should["patch_at_a"][0], &should["patch_at_a"][1]].map(number);
        // of a patch that begins in the middle the file says where its first cell ends
        let length = if first < 1.0 { end } else { end - first };
        let forth = found.measure(0, "forth");
        assert!((forth - length).abs() < 1.1 * 18.75, "{bound}: {forth}, {length}");
    }
    // but for half a centimetre of slip at the corners of the layers, where the traction has no bound
    let found = sound(&own, &[("B", 1e3)], &[]);
    let locked = row(&should["traction"], "z", 0.0);
    assert_near("locked", -found.measure(0, "locked"), number(&locked["value"]), 5e-3);
    let found = sound(&own, &[("B", 0.0)], &[]);
    assert_near("frictionless", found.measure(0, "slip"), number(&should["slip_max_frictionless"]), 3e-3);
}

/// Of each balance of a run the most that a step loses, as a part of all that has moved by its end. Steps count by their
/// increments: of one that ends at a jump of a load, a ten-billionth of a second, the rates are known to few digits.
fn lost(found: &Solved) -> Vec<(String, f64)> {
    let names = |step: usize| found.outcome.steps[step].measures.iter().map(|m| m.0.clone());
    let balances = names(0).filter_map(|name| name.strip_suffix("_lost").map(str::to_owned));
    let of = |balance: String| {
        let (mut most, mut moved) = (0.0f64, 0.0f64);
        let steps = &found.outcome.steps;
        for step in 0..steps.len() {
            let increment =
                if steps.len() == 1 { 1.0 } else { steps[step].window.end - steps[step.max(1) - 1].window.end };
            let own = names(step).filter(|name| name.strip_prefix(&balance).is_some_and(|end| end.starts_with('_')));
            let others = own.filter(|name| !name.ends_with("_lost"));
            moved += increment * others.map(|name| found.measure(step, &name).abs()).fold(0.0, f64::max);
            let left = increment * found.measure(step, &format!("{balance}_lost")).abs();
            most = most.max(if left == 0.0 { 0.0 } else { left / moved });
        }
        (balance, most)
    };
    balances.map(of).collect()
}

/// What fluid flows in or out of the scenes of the examples, or is stored there, is lost nowhere: less than 1e-12 of it.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn the_examples_lose_nothing() {
    let mut count = 0;
    for path in files("examples/poro", "wfl") {
        let text = std::fs::read_to_string(&path).expect("examples can be read");
        if !text.contains("\nbalance ") {
            continue;
        }
        let folder = path.parent().expect("a folder");
        let found = solve(folder, text, &[], &[]).unwrap_or_else(|e| panic!("{e}"));
        for (balance, part) in lost(&found) {
            assert!(part < 1e-12, "{}: {balance} loses {part:e}", path.display());
            count += 1;
        }
    }
    assert!(count >= 7, "{count} balances");
}

/// The example of an examples folder, solved as it stands, without a doubt.
fn example(path: &str) -> Solved {
    let text = std::fs::read_to_string(examples().join(path)).expect("the example");
    sound(&text, &[], &[])
}

/// Of a run the step that ends at a time.
fn step_at(found: &Solved, time: f64) -> usize {
    let ends = |s: &wfl_run::StepResult| (s.window.end / time - 1.0).abs() < 1e-9;
    found.outcome.steps.iter().position(ends).unwrap_or_else(|| panic!("no step ends at {time}"))
}

/// Two blocks with a layer of gouge between them: temperatures of the transform of Laplace, and in every step the heat that
/// comes in is the traction times the rate of slip.
#[test]
fn friction_heats_a_fault_as_its_transform() {
    let found = example("heat/friction.wfl");
    for should in reference("friction_heat.json")["rows"].as_array().expect("rows") {
        let step = step_at(&found, number(&should["t"]));
        // the scene has thousands of kelvin
        for (name, key, unit) in
            [("gouge", "Tf", 1e3), ("below", "Ta", 1e3), ("above", "Tb", 1e3), ("resists", "traction", 1.0)]
        {
            let is = unit * found.measure(step, name);
            assert_near(&format!("{name} {}", should["t"]), is, number(&should[key]), 2e-3);
        }
    }
    for step in 1..found.outcome.steps.len() {
        let [made, resists, rate] = ["heat_rubbing", "resists", "rate"].map(|name| found.measure(step, name));
        assert!((made + resists * rate).abs() < 1e-12 * made.abs(), "{step}: {made} {}", resists * rate);
    }
}

/// Two faults that cross in rock that leaks: what each leg brings to the crossing adds up to nothing.
#[test]
fn faults_that_cross_in_rock_share_their_flow() {
    let found = example("poro/crossing.wfl");
    let should = reference("crossing_flow.json");
    for name in
        ["crossing", "middle_west", "middle_east", "middle_south", "end_west", "end_east", "end_south", "out_rock"]
    {
        assert_near(name, found.measure(0, name), number(&should[name]), 2e-5);
    }
    let mut total = 0.0;
    for leg in ["west", "east", "south", "north"] {
        let [end, leak] = ["end", "leak"].map(|what| found.measure(0, &format!("{what}_{leg}")));
        assert_near(leg, leak, number(&should[&format!("leak_{leg}")]), 2e-4);
        assert_near(leg, leak - end, number(&should[&format!("cross_{leg}")]), 2e-5);
        total += leak - end;
    }
    assert!(total.abs() < 1e-10, "{total}");
}

/// Slow slip by injection, rate-and-state friction with steps by `auto`: slip, rate and pressure of dislocations, when the
/// well is shut and at the end, within the errors of cells of 100 m and of steps of 1e-3.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn slow_slip_by_injection_is_that_of_dislocations() {
    let found = example("poro/slow_slip.wfl");
    let should = reference("injection_rate_state.json");
    for day in [100.0, 150.0] {
        let row = row(&should["rows"], "day", day);
        let step = step_at(&found, day * 86400.0);
        for (name, key, within) in [
            ("slip", "slip", 6e-3),
            ("slip_1km", "slip_1km", 6e-3),
            ("potency", "potency", 8e-3),
            ("pressure", "p", 2e-3),
            ("pressure_1km", "p_1km", 2e-3),
        ] {
            assert_near(&format!("{day}: {name}"), found.measure(step, name), number(&row[key]), within);
        }
        assert!((found.measure(step, "rate") - number(&row["log10_rate"])).abs() < 0.02, "{day}");
    }
}

/// Loads of nothing and of any size: what is linear is so many times as large, nothing is told of a load that is small, and a
/// traction that the law makes zero is no reason to go on for ever. Strains far beyond one are told as that.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn loads_of_any_size_have_results_of_that_size() {
    let scenes: [(&str, &[&str], &[&str]); 4] = [
        ("reservoir", &["dp", "B"], &["slip", "back", "centre", "most"]),
        ("terzaghi", &["q"], &["settlement", "carried", "water_out", "water_coupling"]),
        ("mandel", &["F"], &["spreads", "sinks", "carried", "water_out"]),
        ("fracture", &["Q"], &["middle", "tip", "outflow", "water_in", "fluid_leak_below"]),
    ];
    for (name, loads, measures) in scenes {
        let text = std::fs::read_to_string(examples().join(format!("poro/{name}.wfl"))).expect("an example");
        let is_kept = |line: &&str| {
            !line.starts_with("expect")
                && !line.starts_with("output")
                && !line.contains("/q)")
                && !line.contains("*q*H")
        };
        let text: String = text.lines().filter(is_kept).flat_map(|line| [line, "\n"]).collect();
        // shorter runs; numbers over the load are those of the load itself
        let text = text.replace("by T/400", "by T/20").replace("by 0.0005*", "by 0.01*").replace("p*a/F", "p");
        let value = |load: &str| {
            let line = text.lines().find(|line| line.starts_with(&format!("param {load} ="))).expect("the load");
            line.split_whitespace().nth(3).and_then(|word| word.parse::<f64>().ok()).expect("a number")
        };
        let run = |scale: f64, zero: Option<&str>| {
            let of = |load: &&str| if Some(*load) == zero { 0.0 } else { scale * value(load) };
            let params: Vec<(&str, f64)> = loads.iter().map(|load| (*load, of(load))).collect();
            let known: &[&str] = if scale > 1.0 { &["W631", "W645"] } else { &[] };
            sound(&text, &params, known)
        };
        let base = run(1.0, None);
        for scale in [0.0, 1e-12, 1e-6, 1e6, 1e12] {
            let found = run(scale, None);
            for measure in measures {
                let (is, should) = (last(&found, measure), scale * last(&base, measure));
                assert!((is - should).abs() <= 1e-8 * should.abs(), "{name}, {scale:e}, {measure}: {is:e}, {should:e}");
            }
        }
        if name == "reservoir" {
            // without friction: closed form
            let free = last(&run(1.0, Some("B")), "slip");
            assert_near("slip without friction", free, 0.1817308, 5e-3);
            for scale in [1e-12, 1e-6, 1e6, 1e12] {
                let found = run(scale, Some("B"));
                assert_near("slip without friction", last(&found, "slip"), scale * free, 1e-9);
                assert!(last(&found, "most") <= 1e-12 * scale * 25.0, "{scale:e}: {:e}", last(&found, "most"));
            }
        }
    }
}

/// Case 15 of the list: what a pressurised reservoir does to a fault that displaces it, where the fault lets the pressure
/// through and where it does not. The table has ends of the reservoir far away, which add the same traction everywhere: of
/// the horizontal stress the differences between places are compared. Cells of half the size change it by 0.007 MPa of 16.
#[test]
fn a_pressurised_reservoir_loads_its_fault_as_the_closed_form_says() {
    let should = reference("pressurised_fault.json");
    let windows = should["windows"].as_array().expect("places");
    let mut text = String::from(
        "use \"elasticity\"\nparam E = 14950\nparam nu = 0.15\nparam dp = 20\nparam a = 100\nparam b = 200\n\
         param W = 1e5\nparam m = 8\nparam both = 1\ndef alpha = 1 - E/(3*(1 - 2*nu))/71200\n\
         def far(s) = 3*a + (W - 3*a)*(exp(8*(s - 3)/3) - 1)/(exp(8) - 1)\n\
         def grow(s) = if abs(s) <= 3 then s*a else sign(s)*far(abs(s))\n\
         mesh box [-6,-6] to [6,6] cells [12*m,12*m] quad map [grow(x) + grow(y)/sqrt(3), grow(y)]\n\
         region left = cells where x < y/sqrt(3)\nregion right = cells where x > y/sqrt(3)\n\
         region lower = cells of left where y > -b and y < a\nregion upper = cells of right where y > -a and y < b\n\
         region floor = faces where y == -W\nregion top = faces where y == W\nregion sides = boundary - floor - top\n\
         unknown u : vector Q2\nterm elastic on all : work(u, Test_u, E, nu)\n\
         term lower on lower : -alpha*dp*Div_Test_u\nterm upper on upper : -both*alpha*dp*Div_Test_u\n\
         fix u(1) = 0 on sides\nfix u(2) = 0 on floor\ndef p = if y > -a and y < b then both*dp else 0*dp\n\
         def total = sigma(u, E, nu) - alpha*p*Id(2)\n",
    );
    for (k, window) in windows.iter().enumerate() {
        let y = number(&window["y"]);
        text += &format!(
            "region w{k} = faces of right where abs(x - y/sqrt(3)) < 1e-6 and abs(y - ({y})) < 12.6\n\
             measure xx{k} = mean(total(1,1)) on w{k}\nmeasure xy{k} = mean(total(1,2)) on w{k}\n"
        );
    }
    for (both, name) in [(1.0, "permeable"), (0.0, "impermeable")] {
        let found = sound(&text, &[("both", both)], &[]);
        let first = found.measure(0, "xx0") - number(&windows[0][&format!("xx_{name}")]);
        for (k, window) in windows.iter().enumerate() {
            let of = |part: &str| found.measure(0, &format!("{part}{k}")) - number(&window[&format!("{part}_{name}")]);
            assert!(of("xy").abs() < 6e-3, "{name}, place {k}: shear is off by {} MPa", of("xy"));
            assert!((of("xx") - first).abs() < 0.02, "{name}, place {k}: off by {} MPa", of("xx") - first);
        }
        assert!(first.abs() < 0.1, "{name}: {first}");
    }
}
