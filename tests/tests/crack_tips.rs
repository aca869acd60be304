//! Multipliers at the tips of cracks: both sides are one node there, and the traction is that of the nearest node with a jump.
//!
//! References: uniform stress and pure bending, which a crack that holds does not disturb (closed forms); sliding of a plane
//! crack leaves the pressure on it as it is by symmetry; conditions of contact, node by node.

use std::path::Path;

use wfl_run::Outcome;
use wfl_tests::{
    attempt, differentiated, doubts, examples,
    ranks::{self, Holding, Shared},
    solve, solved,
};

/// A body with a crack in its middle plane, on `space` dimensions.
fn body(space: usize, cells: &str) -> String {
    let (low, high, up, inside) = if space == 3 {
        ("[-1.5,-1.5,-1]", "[1.5,1.5,1]", "z", "z == 0 and abs(x) < 0.6 and abs(y) < 0.6")
    } else {
        ("[-1.5,-1]", "[1.5,1]", "y", "y == 0 and abs(x) < 0.5001")
    };
    format!(
        "use \"elasticity\"\nparam E = 1000\nparam nu = 0.25\nmesh box {low} to {high} cells {cells}\n\
         region below = cells where {up} < 0\nregion above = cells where {up} > 0\n\
         region crack = interface from below to above & faces of below where {inside}\n\
         def jump(a) = a - Interpolate(a, neighbor_element)\n\
         def tang(w) = w - (w.Normal)*Normal\n"
    )
}

/// A displacement of a uniform pressure 1 across the crack and a shear `tau` along it.
fn uniform(space: usize) -> &'static str {
    if space == 3 {
        "[nu/E*x + 2*(1 + nu)/E*tau*z, nu/E*y, -1/E*z]"
    } else {
        "[nu*(1 + nu)/E*x + 2*(1 + nu)/E*tau*y, -(1 - nu^2)/E*y]"
    }
}

/// A crack that holds in both directions.
fn glued(element: &str, multiplier: &str, cells: &str) -> String {
    let space = if cells.ends_with("hex") || cells.ends_with("tet") { 3 } else { 2 };
    let shear = if space == 3 { "[0.3, 0, 0]" } else { "[0.3, 0]" };
    format!(
        "{}unknown u : vector {element}\nsplit u across crack\nmultiplier l : vector {multiplier} on crack\ndef tau = 0.3\n\
         def exact = {}\nterm elastic on all : work(u, Test_u, E, nu)\n\
         term couple on crack : l.jump(Test_u) + jump(u).Test_l\nfix u = exact on boundary\n\
         measure worst = max(Norm(l - Normal + {shear})) at nodes of crack\nmeasure open = max(Norm(jump(u))) on crack\n",
        body(space, cells),
        uniform(space)
    )
}

/// A uniform stress passes through a crack that holds, up to its tips, in every pair of spaces.
#[test]
fn a_uniform_stress_passes_through_a_crack_that_holds() {
    for (element, multiplier, cells) in [
        ("P1", "P1", "[12,12] tri"),
        ("Q1", "Q1", "[12,12] quad"),
        ("P2", "P1", "[12,12] tri"),
        ("P2", "P2", "[12,12] tri"),
        ("Q2", "Q1", "[12,12] quad"),
        ("Q2", "Q2", "[12,12] quad"),
        ("Q1", "Q1", "[9,9,4] hex"),
        ("P1", "P1", "[9,9,4] tet"),
        ("Q2", "Q2", "[6,6,4] hex"),
        ("P2", "P2", "[6,6,4] tet"),
        ("P2", "P1", "[6,6,4] tet"),
    ] {
        let found = solved(glued(element, multiplier, cells));
        let worst = found.measure(0, "worst");
        assert!(worst < 1e-10, "{element} {multiplier} {cells}: {worst:e}");
        assert!(
            found.measure(0, "open") < 1e-12 && doubts(&found.outcome).is_empty(),
            "{element} {multiplier} {cells}"
        );
    }
}

/// Pure bending, which displacements of degree two have exactly: what is wrong is the traction at the tips, by its change to
/// the next node, so that the mean square root of the error falls with the power 1.5 of the size of the faces. With zeros at the tips it
/// fell with 0.5.
#[test]
fn a_traction_that_varies_is_wrong_at_the_tips_by_what_it_varies() {
    for (element, multiplier, kind) in
        [("Q2", "Q1", "quad"), ("Q2", "Q2", "quad"), ("P2", "P1", "tri"), ("P2", "P2", "tri")]
    {
        let [coarse, fine] = [12, 24].map(|n| {
            let text = glued(element, multiplier, &format!("[{n},{n}] {kind}"))
                .replace("def tau = 0.3", "def a = 0.5")
                .replace(
                    uniform(2),
                    "[nu*(1 + nu)/E*(x + a/2*x^2) + (1 - nu^2)/(2*E)*a*y^2, -(1 - nu^2)/E*(1 + a*x)*y]",
                );
            let text = text + "measure off = integral(sqr(Norm(l - (1 + a*x)*Normal))) on crack\n";
            let found = solved(text);
            found.measure(0, "off").sqrt()
        });
        let order = (coarse / fine).log2();
        assert!(fine < 0.02 && order > 1.3, "{element} {multiplier}: {coarse} {fine}, order {order}");
    }
}

/// Contact with friction, by an augmented Lagrangian.
fn contact([element, multiplier, cells]: [&str; 3], tau: f64) -> String {
    let space = if cells.ends_with("hex") { 3 } else { 2 };
    format!(
        "{}param gamma = 2e4\nparam fric = 0.3\nunknown u : vector {element}\nsplit u across crack\n\
         multiplier l : vector {multiplier} on crack\ndef tau = {tau}\ndef exact = {}\n\
         def Pn = gamma*(jump(u).Normal) - l.Normal\ndef Pt = gamma*tang(jump(u)) - tang(l)\n\
         def force = pos_part(Pn)*Normal + Ball_projection(Pt, fric*pos_part(Pn))\n\
         term elastic on all : work(u, Test_u, E, nu)\nterm contact on crack : force.jump(Test_u)\n\
         term law on crack : -1/gamma*(l + force).Test_l\nfix u = exact on boundary\n\
         measure pressure = max(abs(l.Normal + 1)) at nodes of crack\n\
         measure bound = max(Norm(tang(l)) - fric*abs(l.Normal)) at nodes of crack\n\
         measure least = min(Norm(tang(l))) at nodes of crack\nmeasure slip = max(Norm(tang(jump(u)))) on crack\n\
         measure tension = max(l.Normal) at nodes of crack\nmeasure most = min(l.Normal) at nodes of crack\n\
         measure into = max(jump(u).Normal) on crack\nmeasure gap = min(jump(u).Normal) on crack\n\
         region left = rim of crack where x < 0\nregion right = rim of crack where x > 0\n",
        body(space, cells),
        uniform(space)
    )
}

/// A crack that slides everywhere: the pressure on it stays that of the body without a crack, and the shear is the bound, up
/// to the tips.
#[test]
fn the_pressure_on_a_sliding_crack_is_uniform() {
    for spaces in [
        ["Q1", "Q1", "[12,12] quad"],
        ["Q2", "Q1", "[12,12] quad"],
        ["Q2", "Q2", "[12,12] quad"],
        ["Q1", "Q1", "[9,9,4] hex"],
    ] {
        for (tau, slides) in [(0.1, false), (0.9, true)] {
            let found = solved(contact(spaces, tau));
            let is = |name: &str| found.measure(0, name);
            let name = format!("{spaces:?} {tau}");
            assert!(is("pressure") < 1e-9 && is("bound") < 1e-9, "{name}: {:e} {:e}", is("pressure"), is("bound"));
            let shear = if slides { 0.3 } else { tau };
            // in space the slip turns from point to point, and the sum over points is below the bound
            let turns = if slides && name.contains("hex") { 0.01 } else { 1e-9 };
            assert!((is("least") - shear).abs() < turns, "{name}: {}", is("least"));
            assert_eq!(is("slip") > 1e-5, slides, "{name}: {:e}", is("slip"));
            assert_eq!(doubts(&found.outcome), [], "{name}");
        }
    }
}

/// A crack that bending opens at one end and closes at the other. Where it is open, up to the tip, there is no traction; nowhere
/// is there tension; at the closed tip the pressure is that of the next node. At vertices the conditions of contact hold node by
/// node.
#[test]
fn a_tip_that_is_open_has_no_traction() {
    for (spaces, rule) in [
        (["Q1", "Q1", "[24,24] quad"], "quadrature on crack vertex\n"),
        (["Q1", "Q1", "[24,24] quad"], ""),
        (["Q2", "Q2", "[12,12] quad"], ""),
    ] {
        let text = contact(spaces, 0.0)
            .replace(uniform(2), "[nu*(1 + nu)/E*(x + 2*x^2) + 2*(1 - nu^2)/E*y^2, -(1 - nu^2)/E*(1 + 4*x)*y]");
        let text = format!(
            "{text}{rule}measure at_left = max(Norm(l)) on left\nmeasure at_right = max(l.Normal) on right\n\
             measure open_traction = max(if jump(u).Normal < -1e-6 then abs(l.Normal) else 0) at nodes of crack\n"
        );
        let found = solved(text);
        let is = |name: &str| found.measure(0, name);
        let name = format!("{spaces:?} {rule}");
        assert!(is("gap") < -1e-4, "{name} {:e}", is("gap"));
        assert!(is("at_left") < 1e-9, "{name}: {:e}", is("at_left"));
        // without the crack it is 3; what the open part gives up goes to the closed one
        assert!(is("at_right") < -2.0, "{name}: {}", is("at_right"));
        if !rule.is_empty() {
            assert!(is("tension") < 1e-9 && is("into") < 1e-12, "{name}: {:e} {:e}", is("tension"), is("into"));
            assert!(is("open_traction") < 1e-9, "{name}: {:e}", is("open_traction"));
        }
        assert_eq!(doubts(&found.outcome), [], "{name}");
    }
}

/// A fluid in the crack, whose pressure has a value at the tips: the law of the traction reads it there, and yet the traction
/// has no equation.
#[test]
fn a_pressure_of_the_fluid_leaves_the_tips_without_a_jump() {
    for (spaces, fluid) in [(["Q1", "Q1", "[12,12] quad"], "Q1"), (["Q2", "Q2", "[12,12] quad"], "Q1")] {
        let text = contact(spaces, 0.05)
            .replace("jump(u).Normal) - l.Normal\n", "jump(u).Normal) - l.Normal - pf\n")
            .replace("force.jump(Test_u)", "(force + pf*Normal).jump(Test_u)")
            .replace("(l + force).Test_l", "(l + force + pf*Normal).Test_l")
            .replace("def Pn", &format!("unknown pf : scalar {fluid} on crack\nterm fluid on crack : Grad_pf.Grad_Test_pf + (pf - 0.4)*Test_pf\ndef Pn"));
        let text = text + "measure fluid = max(abs(pf - 0.4)) on crack\n";
        let found = solved(text);
        let is = |name: &str| found.measure(0, name);
        assert!(is("pressure") < 1e-9 && is("fluid") < 1e-12, "{spaces:?}: {:e} {:e}", is("pressure"), is("fluid"));
        assert!((is("least") - 0.05).abs() < 1e-9, "{spaces:?}: {}", is("least"));
    }
}

/// Derivatives go through nodes that follow others: of a reaction, of the tractions, in a parameter that moves the mesh, too.
/// Against differences of runs.
#[test]
fn derivatives_go_through_the_tips() {
    let text = contact(["Q1", "Q1", "[12,12] quad"], 0.9)
        .replace("[12,12] quad\n", "[12,12] quad map [S*x, y]\nparam S = 1\nregion top = faces where y == 1\n")
        + "measure pull = reaction(u(1)) on top\nmeasure square = integral(sqr(l.Normal) + sqr(Norm(tang(l)))) on crack\n\
           measure slid = integral(Norm(tang(jump(u)))) on crack\n";
    let results = "pull, square, slid";
    let (_, found) = differentiated((Path::new("."), text.clone()), &[], &[], results, "S, fric, E")
        .unwrap_or_else(|told| panic!("{told}"));
    for (parameter, at) in [("S", 1.0), ("fric", 0.3), ("E", 1000.0)] {
        let h = 1e-5 * at;
        let [less, more] = [at - h, at + h].map(|value| {
            solve(Path::new("."), text.clone(), &[], &[(parameter, value)]).unwrap_or_else(|told| panic!("{told}"))
        });
        for result in ["pull", "square", "slid"] {
            let difference = (more.measure(0, result) - less.measure(0, result)) / (2.0 * h);
            let exact = found.number(result, parameter).expect("a derivative");
            let size = more.measure(0, result).abs() / at;
            assert!((exact - difference).abs() < 1e-6 * size, "{result} {parameter}: {exact}, {difference}");
        }
    }
}

/// Solvers of other libraries are told of the nodes with a row of their own.
#[test]
fn nodes_that_follow_are_in_no_layout() {
    let found = solved(contact(["Q1", "Q1", "[12,12] quad"], 0.1));
    let system = &found.scene.system;
    let (_, rows) = system.node_layout_with_multipliers().expect("a layout");
    // five nodes on the crack, two of them at its tips
    assert_eq!((rows.len(), system.numbering.ties().len()), (6, 4));
}

/// The same numbers on ranks that have all of the mesh and on those that have parts.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn ranks_have_the_tips_of_one() {
    for text in [
        contact(["Q1", "Q1", "[12,12] quad"], 0.9),
        contact(["Q1", "Q1", "[9,9,4] hex"], 0.1).replace("-1/E*z]", "-1/E*z*(1 + x + y)]"),
        glued("P2", "P2", "[6,6,4] tet"),
    ] {
        let scene = Shared::text(Path::new("."), text, &[]);
        let measures = |outcome: &Outcome| outcome.steps[0].measures.clone();
        let alone = measures(&ranks::solved(scene.whole()));
        for holding in [Holding::Whole, Holding::Parts] {
            for of_rank in scene.on_ranks(3, holding, |part| measures(&ranks::solved(part))) {
                for ((name, is), (_, should)) in of_rank.iter().zip(&alone) {
                    assert!((is - should).abs() < 1e-10, "{holding:?} {name}: {is}, {should}");
                }
            }
        }
    }
}

/// A crack of one face has no node with a jump beside its tips: nothing can be taken over, and that is told.
#[test]
fn a_crack_of_one_face_is_told() {
    let one = |element: &str, multiplier: &str| {
        glued(element, multiplier, "[12,12] quad").replace("abs(x) < 0.5001", "x > -0.01 and x < 0.2501")
    };
    let tried = attempt(&examples(), one("Q2", "Q1"), &[], &[]);
    assert!(tried.messages.contains("W680") && tried.messages.contains("at 2 nodes"), "{}", tried.messages);
    for (element, multiplier) in [("Q2", "Q2"), ("Q2", "DP0")] {
        let tried = attempt(&examples(), one(element, multiplier), &[], &[]);
        assert!(!tried.messages.contains("W680"), "{}", tried.messages);
    }
}
