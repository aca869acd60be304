//! What comes in, goes out, is stored and lost: `balance`, `Rate(e)`, and the regions where faces end and meet.

use std::path::Path;

use wfl_run::Outcome;
use wfl_tests::{
    doubts,
    ranks::{self, Holding, Shared},
    refused, solved,
};

/// A column that rests on a stiff floor and is lifted by the fluid below it: the aperture has its kink where it lifts off,
/// in the middle of a step.
const LIFTED: &str = "use \"poro\"\nmesh box [0,0] to [1,1] cells [2,4] quad\nregion floor = faces where y == 0\n\
    region top = faces where y == 1\nunknown u : vector\nunknown pf : scalar on floor\nparam w0 = 1e-3\n\
    def w = w0 + pos_part(u(2))\nterm elastic on all : 100*Sym(Grad_u):Grad_Test_u\n\
    term fluid on floor : -pf*Test_u(2)\nterm base on floor : -1e5*pos_part(-u(2))*Test_u(2)\n\
    term volume on floor : RATE*Test_pf\nterm leak on floor : 0.01*pf*Test_pf\nload u = [0,-1] on top\n\
    region side = faces where x == 0\nfix u(1) = 0 on side\nload pf = if t > 1.5 then 0.7 else 0 on floor\nsteps t = 0 to 3 by 1\n\
    term spring on top : 50*u(2)*Test_u(2)\nbalance water of pf\nmeasure volume = integral(w) on floor\n\
    measure past = integral(w0 + pos_part(Previous_u(2))) on floor\n";

#[test]
fn the_volume_of_an_aperture_with_a_kink_is_conserved() {
    let found = solved(LIFTED.replace("RATE", "Rate(w)"));
    for step in 1..found.outcome.steps.len() {
        let [volume, past, of_volume] = ["volume", "past", "water_volume"].map(|m| found.measure(step, m));
        assert!((volume - past - of_volume).abs() < 1e-13, "{step}: {volume} {past} {of_volume}");
        let [comes, goes, leaks, lost] =
            ["water_in", "water_out", "water_leak", "water_lost"].map(|m| found.measure(step, m));
        let source = if step == 1 { 0.0 } else { 0.7 };
        assert!((comes - source).abs() < 1e-14 && goes.abs() < 1e-14, "{step}: {comes} {goes}");
        assert!((comes - goes - of_volume - leaks - lost).abs() < 1e-15 && lost.abs() < 1e-10, "{step}: {lost}");
    }
    // the rate by the chain rule is another volume in the step that lifts the column
    let found = solved(LIFTED.replace("RATE", "(if u(2) > 0 then Dot_u(2) else 0)"));
    let missed = (1..found.outcome.steps.len()).map(|step| {
        let [volume, past, of_volume] = ["volume", "past", "water_volume"].map(|m| found.measure(step, m));
        (volume - past - of_volume).abs()
    });
    assert!(missed.fold(0.0f64, f64::max) > 1e-6);
}

#[test]
fn a_rate_over_one_step_needs_a_scheme_of_one_step() {
    let text = LIFTED.replace("RATE", "Rate(w)");
    for (scheme, says) in [("scheme bdf2", "bdf2"), ("scheme newmark", "newmark")] {
        let told = refused(&format!("{text}{scheme}\n"));
        assert!(told.contains("E461") && told.contains(says), "{told}");
    }
    let told = refused(&text.replace("by 1\n", "by auto\n"));
    assert!(told.contains("E461") && told.contains("scheme backward_euler"), "{told}");
    for inner in ["Dot_pf", "Previous_pf", "timestep*pf", "Rate(pf)"] {
        let told = refused(&LIFTED.replace("RATE", &format!("Rate({inner})")));
        assert!(told.contains("E461") && told.contains("one step earlier"), "{inner}: {told}");
    }
    // data and the step variable have a past
    let found = solved(
        "mesh box [0] to [1] cells [4] segment\nregion left = faces where x == 0\nunknown p : scalar\n\
         term storage on all : Rate((1 + t)*p)*Test_p\nterm flow on all : Grad_p.Grad_Test_p\nload p = 1 on all\n\
         fix p = 0 on left\nsteps t = 0 to 1 by 0.25\nbalance water of p\nmeasure now = integral((1 + t)*p) on all\n\
         measure past = integral((0.75 + t)*Previous_p) on all\n",
    );
    for step in 1..found.outcome.steps.len() {
        let [now, past, stored] = ["now", "past", "water_storage"].map(|m| found.measure(step, m));
        assert!(((now - past) / 0.25 - stored).abs() < 1e-12, "{step}");
    }
}

/// Exchange between two pressures cancels in the balance of both and not in that of one.
#[test]
fn exchange_cancels_in_the_balance_of_both() {
    let found = solved(
        "mesh box [0,0] to [1,1] cells [4,4] tri\nregion floor = faces where y == 0\nregion top = faces where y == 1\n\
         region west = faces where x == 0\nunknown p : scalar P2\nunknown pf : scalar P2 on floor\n\
         term rock on all : Grad_p.Grad_Test_p\nterm flow on floor : 5*Grad_pf.Grad_Test_pf\n\
         term exchange on floor : 3*(pf - p)*(Test_pf - Test_p)\nload pf = 1 + x on floor\nload p = -0.25 on west\n\
         fix p = 0 on top\nbalance water of p, pf\nbalance fluid of pf\nmeasure leak = integral(3*(pf - p)) on floor\n\
         measure top = reaction(p) on top\n",
    );
    let of = |name: &str| found.measure(0, name);
    for (name, should) in [
        ("water_in", 1.5),
        ("water_out", 1.5),
        ("water_exchange", 0.0),
        ("water_rock", 0.0),
        ("fluid_exchange", 1.5),
        ("leak", 1.5),
        ("top", 1.25),
        ("fluid_lost", 0.0),
    ] {
        assert!((of(name) - should).abs() < 1e-12, "{name}: {}, {should}", of(name));
    }
}

/// Why `Rate` is refused with schemes whose rates reach back over several steps: what such rates add up to over a run is not
/// the change of the volume. The parts are those of `docs/flow_in_faults.md`.
#[test]
fn rates_of_several_steps_do_not_add_up_to_the_volume() {
    let more = |scheme: &str, rate: &str, step: f64| {
        let text = LIFTED.replace("RATE", rate).replace("by 1\n", &format!("by {step}\nscheme {scheme}\n"));
        let found = solved(text);
        let last = found.outcome.steps.len() - 1;
        let taken: f64 = (1..=last).map(|k| step * found.measure(k, "water_volume")).sum();
        taken / (found.measure(last, "volume") - found.measure(0, "volume")) - 1.0
    };
    let by_hand = "Heaviside(u(2))*Dot_u(2)";
    for (scheme, parts) in [("bdf2", [0.26, 0.075, 0.017]), ("bdf3", [0.16, 0.070, 0.016])] {
        for (step, part) in [1.0, 0.25, 0.0625].into_iter().zip(parts) {
            let found = more(scheme, by_hand, step);
            assert!((found / part - 1.0).abs() < 0.05, "{scheme} {step}: {found}, {part}");
        }
    }
    let found = [by_hand, "Rate(w)"].map(|rate| more("backward_euler", rate, 0.25));
    assert!((found[0] - 8e-6).abs() < 1e-6 && found[1].abs() < 1e-14, "{found:?}");
}

/// Steps that the run chooses end at a jump of a load with one that is so short that its storage is known to few digits:
/// what is lost there is rounding, and no message says that water is lost.
#[test]
fn a_step_that_ends_at_a_jump_loses_nothing() {
    let text = "mesh box [0,0] to [1,1] cells [8,2] quad\nregion floor = faces where y == 0\nregion out = rim of floor where x == 1\n\
        unknown p : scalar on floor\nterm storage on floor : Dot_p*Test_p\nterm flow on floor : Grad_p.Grad_Test_p\n\
        load p = (if t < 0.333 then 1 else 2) on floor\nfix p = 0 on out\nsteps t = 0 to 1 by auto\nbalance water of p\n";
    let found = solved(text);
    let short = found.outcome.steps.windows(2).map(|pair| pair[1].window.end - pair[0].window.end).fold(1.0, f64::min);
    assert!(short < 1e-9, "a step ends at the jump: {short}");
    assert!(doubts(&found.outcome).iter().all(|told| told.0 != "W650"), "{:?}", doubts(&found.outcome));
}

/// Steps that the run chooses, across the kink of an aperture, while a crack opens and when its well is shut: the volume
/// that is lost in all steps together is below 1e-12 of what has moved, and no message says otherwise.
#[test]
fn adaptive_steps_conserve_the_volume_of_cracks_that_open() {
    let lifted = LIFTED.replace("RATE", "Rate(w)").replace("by 1\n", "by auto\nscheme backward_euler\n");
    let opening = "use \"poro\"\nuse \"elasticity\"\nmesh box [-2,-1] to [2,1] cells [12,6] quad\n\
        region below = cells where y < 0\nregion above = cells where y > 0\n\
        region fault = interface from below to above\nregion well = nodes of fault where x == 0\n\
        region floor = faces where y == -1\nregion top = faces where y == 1\nunknown a : vector Q2 on below\n\
        unknown b : vector Q2 on above\nunknown pf : scalar on fault\n\
        def jump(v, w) = v - Interpolate(w, neighbor_element)\ndef w = aperture(1e-3, a, b)\n\
        term ea on below : work(a, Test_a, 1000, 0.2)\nterm eb on above : work(b, Test_b, 1000, 0.2)\n\
        term contact on fault : pos_part(1e5*(jump(a, b).Normal))*(Normal.jump(Test_a, Test_b))\n\
        term fluid on fault : fluid_pressure(pf, a, b)\nterm volume on fault : filling(w, pf)\n\
        term flow on fault : along_fault(pf, cubic(w, 1e-9))\nterm leak on fault : 1e-4*pf*Test_pf\n\
        fix a = [0,0] on floor\nfix b(1) = 0 on top\nload b = [0,-1] on top\n\
        load pf = (if t < 10 then 4e-3 else 0) on well\n\
        steps t = 0 to 20 by auto with first=1e-3, error=1e-3\nscheme backward_euler\nbalance water of pf\n\
        measure open = integral(Heaviside(w - 1.0000001e-3)) on fault\n";
    for text in [lifted, opening.to_owned()] {
        let found = solved(text);
        let steps = &found.outcome.steps;
        assert!(steps.len() > 20, "{}", steps.len());
        let (mut moved, mut lost) = (0.0, 0.0);
        for (k, step) in steps.iter().enumerate().skip(1) {
            let increment = step.window.end - steps[k - 1].window.end;
            let of = |name: &str| found.measure(k, name).abs() * increment;
            moved += ["water_in", "water_out", "water_volume", "water_leak"].map(of).into_iter().fold(0.0, f64::max);
            lost += of("water_lost");
        }
        assert!(lost < 1e-12 * moved, "{lost:e} of {moved:e}");
        assert!(doubts(&found.outcome).iter().all(|told| told.0 != "W650"), "{:?}", doubts(&found.outcome));
    }
}

/// Fluid that only spreads in a closed body: nothing comes in, and nothing is told to be lost.
#[test]
fn what_spreads_in_a_closed_body_is_not_lost() {
    for steps in ["by 0.1", "by auto"] {
        let found = solved(format!(
            "mesh box [0,0] to [1,1] cells [8,2] quad\nregion floor = faces where y == 0\nunknown p : scalar on floor\n\
             term storage on floor : Dot_p*Test_p\nterm flow on floor : Grad_p.Grad_Test_p\nstart p = sin(7*x)\n\
             steps t = 0 to 1 {steps}\nbalance water of p\n"
        ));
        assert!(doubts(&found.outcome).iter().all(|told| told.0 != "W650"), "{:?}", doubts(&found.outcome));
    }
}

#[test]
fn faces_end_at_their_rim_and_meet_at_their_crossings() {
    let scene = |mesh: &str, regions: &str, faces: &str, lines: &str| {
        format!("mesh {mesh}\n{regions}\nunknown p : scalar on {faces}\n{lines}\n")
    };
    let cross = "region below = cells where y < 0\nregion left = cells where x < 0\n\
        region first = faces of below where y == 0\nregion second = faces of left where x == 0 and y < 0.6\n\
        region both = first + second";
    let of_cross = |lines: &str| scene("box [-1,-1] to [1,1] cells [4,4] quad", cross, "both", lines);
    // a harmonic pressure on a cross: given at its four ends, the mean of them where it crosses
    let found = solved(of_cross(
        "region ends = rim of both\nregion joint = crossings of both\nterm flow on both : Grad_p.Grad_Test_p\n\
         fix p = 1 + x + 2*y on ends\nmeasure joint = value(p) at [0,0]\nmeasure out = reaction(p) on ends\n\
         measure east = reaction(p) on rim_east\nregion rim_east = rim of both where x > 0.9",
    ));
    // legs of length 1, 1, 1 and 0.5, with 2, 0, -1 and 2 at their ends
    let joint = (2.0 + 0.0 - 1.0 + 2.0 * 2.0) / 5.0;
    assert!((found.measure(0, "joint") - joint).abs() < 1e-12, "{}", found.measure(0, "joint"));
    assert!(found.measure(0, "out").abs() < 1e-12 && (found.measure(0, "east") - (joint - 2.0)).abs() < 1e-12);
    let found = solved(of_cross(
        "region joint = crossings of both\nterm flow on both : Grad_p.Grad_Test_p + p*Test_p\nfix p = 3 on joint\n\
         measure joint = value(p) at [0,0]\nregion inner = nodes of first where abs(x) < 0.6\nload p = 1 on inner",
    ));
    assert!((found.measure(0, "joint") - 3.0).abs() < 1e-14);
    // a square sheet in space: its rim is all of its boundary
    let sheet = "region below = cells where z < 0\nregion sheet = faces of below where z == 0";
    let found = solved(scene(
        "box [0,0,-1] to [1,1,1] cells [4,4,2] hex",
        sheet,
        "sheet",
        "region edge = rim of sheet\nterm flow on sheet : Grad_p.Grad_Test_p\nfix p = x + 2*y on edge\n\
         measure error = max(abs(p - x - 2*y)) on sheet",
    ));
    assert!(found.measure(0, "error") < 1e-13);
    let mesh = "box [0,0,-1] to [1,1,1] cells [4,4,2] hex";
    for (lines, says) in [
        (
            "region edge = crossings of sheet\nterm flow on sheet : p*Test_p\nfix p = 1 on edge",
            "no edge with three faces",
        ),
        ("region edge = rim of below\nterm flow on sheet : p*Test_p\nfix p = 1 on edge", "faces are needed"),
    ] {
        let told = refused(&scene(mesh, sheet, "sheet", lines));
        assert!(told.contains(says), "{lines}: {told}");
    }
}

/// A fracture with leak-off whose nodes, wells and rims lie on several ranks: the numbers of one rank.
#[test]
fn ranks_have_the_reactions_and_balances_of_one() {
    let text = "mesh box [-2,-2] to [2,2] cells [12,12] tri\nregion below = cells where y < 0\n\
        region above = cells where y > 0\nregion crack = interface from below to above & faces of below where y == 0 and abs(x) < 1.1\n\
        region well = nodes of crack where x == 0\nregion tips = rim of crack where x > 0\nunknown p : scalar P2\n\
        unknown pf : scalar P2 on crack\nsplit p across crack\nterm rock on all : Grad_p.Grad_Test_p\n\
        term flow on crack : 10*Grad_pf.Grad_Test_pf\nterm here on crack : 5*(pf - p)*(Test_pf - Test_p)\n\
        def other(v) = Interpolate(v, neighbor_element)\n\
        term there on crack : 0.5*(pf - other(p))*(Test_pf - other(Test_p))\nfix p = 0 on boundary\nfix pf = 0.1 on tips\n\
        load pf = 1 on well\nbalance water of p, pf\nmeasure out = reaction(p) on boundary\n\
        measure tip = reaction(pf) on tips\nmeasure slope = integral(Norm(Grad_pf)) on crack\n";
    let scene = Shared::text(Path::new("."), text.to_owned(), &[]);
    let measures = |outcome: &Outcome| outcome.steps[0].measures.clone();
    let alone = measures(&ranks::solved(scene.whole()));
    for holding in [Holding::Whole, Holding::Parts] {
        for of_rank in scene.on_ranks(3, holding, |part| measures(&ranks::solved(part))) {
            for ((name, is), (_, should)) in of_rank.iter().zip(&alone) {
                assert!((is - should).abs() < 1e-11, "{holding:?} {name}: {is}, {should}");
            }
        }
    }
}
