//! Multipliers at the ends of an interface: what cannot jump goes, what slides keeps its friction.
//!
//! Two blocks in a uniform state of stress: pressed and sheared across x = 0, with the displacement across the
//! interface prescribed on both sides at its ends, where they can slide only. Traction and slip are uniform (closed
//! form).

use wfl_tests::{Attempt, attempt, doubts, examples, refused, solved};

const STATE: &str = "\
param tau = 0.3
param s = 0
param gamma = 100
def E = 100
def nu = 0.25
def fric = 0.5
mesh box [-1,0] to [1,1] cells [4,3] quad
region left = cells where x < 0
region right = cells where x > 0
region fault = interface from left to right
region west = faces where x == -1
region east = faces where x == 1
region ends = faces where y == 0 or y == 1
unknown uL : vector on left
unknown uR : vector on right
MULTIPLIERS
def jump(a,b) = a - Interpolate(b, neighbor_element)
def tang(w) = w - (w.Normal)*Normal
def sigma(v) = E*nu/((1+nu)*(1-2*nu))*Div_v*Id(2) + E/(1+nu)*Sym(Grad_v)
LAW
term elastic on left : sigma(uL):Grad_Test_uL
term elastic2 on right : sigma(uR):Grad_Test_uR
def sxy = min(tau, fric)
def exact = [-(1-nu^2)/E*x, nu*(1+nu)/E*y + 2*(1+nu)/E*sxy*x]
fix uL = exact on west
fix uR = exact + [0,s] on east
fix uL(1), uR(1) = -(1-nu^2)/E*x on ends
load uL, uR = [0, sxy; sxy, 0]*Normal on ends
measure slip = mean(-(jump(uL,uR))(2)) on fault
measure uneven = max(abs((jump(uL,uR))(2) + s)) on fault
measure normal = max(abs(TRACTION.Normal + 1)) on fault
measure shear = max(abs((TRACTION)(2) - sxy)) on fault
";

const VECTOR: [&str; 3] = [
    "multiplier l : vector on fault",
    "def Pn = gamma*(jump(uL,uR).Normal) - l.Normal\ndef Pt = gamma*tang(jump(uL,uR)) - tang(l)\n\
     def force = pos_part(Pn)*Normal + Ball_projection(Pt, fric*pos_part(Pn))\n\
     term contact on fault : force.jump(Test_uL,Test_uR)\nterm law on fault : -1/gamma*(l + force).Test_l",
    "l",
];

const SCALARS: [&str; 3] = [
    "multiplier ln : scalar on fault\nmultiplier lt : scalar on fault",
    "def tau1 = [-Normal(2), Normal(1)]\ndef Pn = gamma*(jump(uL,uR).Normal) - ln\n\
     def Pt = gamma*(jump(uL,uR).tau1) - lt\n\
     def force = pos_part(Pn)*Normal + Ball_projection(Pt, fric*pos_part(Pn))*tau1\n\
     term contact on fault : force.jump(Test_uL,Test_uR)\nterm lawn on fault : -1/gamma*(ln + force.Normal)*Test_ln\n\
     term lawt on fault : -1/gamma*(lt + force.tau1)*Test_lt",
    "(ln*Normal + lt*tau1)",
];

fn uniform(multipliers: [&str; 3], slides: bool, edits: &[(&str, &str)]) -> Attempt {
    let [declared, law, traction] = multipliers;
    let mut text = STATE.replace("MULTIPLIERS", declared).replace("LAW", law).replace("TRACTION", traction);
    for (from, to) in edits {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    let params: &[(&str, f64)] = if slides { &[("tau", 0.8), ("s", 0.2)] } else { &[] };
    attempt(&examples(), text, &[], params)
}

/// A block that sticks and one that slides, with a multiplier of each kind: the closed form to rounding, and the
/// message.
#[test]
fn friction_is_kept_where_the_normal_jump_is_prescribed() {
    for (multipliers, name) in [(VECTOR, "l"), (SCALARS, "ln")] {
        for slides in [false, true] {
            let tried = uniform(multipliers, slides, &[]);
            let told = format!("at 2 nodes of `{name}` friction depends on a component without a jump");
            assert!(tried.messages.contains("W404") && tried.messages.contains(&told), "{}", tried.messages);
            assert_eq!(tried.messages.matches("W404").count(), 1, "{}", tried.messages);
            let solved = tried.solved.expect("a solution");
            for (measure, most) in [("uneven", 1e-12), ("normal", 1e-9), ("shear", 1e-9)] {
                let found = solved.measure(0, measure);
                assert!(found < most, "{name} {slides} {measure}: {found}");
            }
            let slip = if slides { 0.2 } else { 0.0 };
            assert!((solved.measure(0, "slip") - slip).abs() < 1e-12);
            assert_eq!(doubts(&solved.outcome), []);
        }
    }
}

/// Prescribed on one side only, the normal jump is not: nothing is said, and nothing is dropped.
#[test]
fn what_can_jump_is_not_dropped() {
    for multipliers in [VECTOR, SCALARS] {
        let one_side = [("fix uL(1), uR(1) = -(1-nu^2)/E*x on ends", "fix uL(1) = -(1-nu^2)/E*x on ends")];
        let tried = uniform(multipliers, false, &one_side);
        assert!(!tried.messages.contains("W404"), "{}", tried.messages);
        assert!(tried.solved.expect("a solution").measure(0, "normal") < 1e-9);
    }
}

/// Rollers along the interface leave a tangential component without a jump; nothing reads it, so it is dropped alone. A
/// scalar normal multiplier keeps its nodes: its component is not the first of the displacement.
#[test]
fn only_the_component_that_cannot_jump_goes() {
    for (multipliers, name) in [(VECTOR, "l"), (SCALARS, "lt")] {
        let rollers = [("fix uL(1), uR(1) = -(1-nu^2)/E*x on ends", "fix uL(2), uR(2) = nu*(1+nu)/E*y on ends")];
        let straight = [("param tau = 0.3", "param tau = 0")];
        let edits: Vec<_> = rollers.into_iter().chain(straight).collect();
        let tried = uniform(multipliers, false, &edits);
        let dropped =
            if name == "l" { "at 2 nodes of `l` a component has no jump" } else { "2 nodes of `lt` have no jump" };
        assert!(tried.messages.contains(dropped), "{}", tried.messages);
        assert!(!tried.messages.contains("of `ln`"), "{}", tried.messages);
        let solved = tried.solved.expect("a solution");
        assert!(solved.measure(0, "normal") < 1e-9 && solved.measure(0, "uneven") < 1e-12);
    }
}

/// The same in axes that are turned by 30 degrees, the normal prescribed on a part of the interface: frames of their
/// own.
#[test]
fn directions_that_are_no_axes_are_found() {
    let turned = |slides: bool| {
        let edits = [
            ("quad\n", "quad map [c*x - w*y, w*x + c*y]\n"),
            ("mesh box", "def c = sqrt(3)/2\ndef w = 0.5\ndef a = c*x + w*y\ndef b = -w*x + c*y\nmesh box"),
            ("cells where x < 0", "cells where a < 0"),
            ("cells where x > 0", "cells where a > 0"),
            ("faces where x == -1", "faces where abs(a + 1) < 1e-6"),
            ("faces where x == 1", "faces where abs(a - 1) < 1e-6"),
            ("faces where y == 0 or y == 1", "faces where abs(b) < 1e-6 or abs(b - 1) < 1e-6"),
            ("fix uL(1), uR(1) = -(1-nu^2)/E*x on ends", "fix uL.Normal, uR.Normal = 0 on part"),
            ("region west", "region part = fault & faces of left where b < 0.34\nregion west"),
            ("-(1-nu^2)/E*x, nu*(1+nu)/E*y + 2*(1+nu)/E*sxy*x]", "c*p1 - w*p2, w*p1 + c*p2]"),
            ("def exact", "def p1 = -(1-nu^2)/E*a\ndef p2 = nu*(1+nu)/E*b + 2*(1+nu)/E*sxy*a\ndef exact"),
            ("exact + [0,s]", "exact + s*[-w,c]"),
            ("[0, sxy; sxy, 0]*Normal on ends", "[c,-w;w,c]*[0, sxy; sxy, 0]*[c,w;-w,c]*Normal on ends"),
            ("(jump(uL,uR))(2)", "(jump(uL,uR).[-w,c])"),
            ("(l)(2)", "(l.[-w,c])"),
        ];
        uniform(VECTOR, slides, &edits)
    };
    let tried = turned(false);
    assert!(tried.messages.contains("at 2 nodes of `l` friction depends"), "{}", tried.messages);
    let solved = tried.solved.expect("a solution");
    for (measure, most) in [("uneven", 1e-12), ("normal", 1e-9), ("shear", 1e-9)] {
        assert!(solved.measure(0, measure) < most, "{measure}: {}", solved.measure(0, measure));
    }
    let solved = turned(true).solved.expect("a solution");
    assert!(solved.measure(0, "normal") < 1e-9 && (solved.measure(0, "slip") - 0.2).abs() < 1e-9);
}

/// A constant pressure through a closed crack inside a body, in the pairs of spaces of `docs/flow_in_faults.md`: at its tips both
/// sides are one node, and a multiplier has the value of the next one there. One value a face needs displacements of degree
/// two.
#[test]
fn a_pressure_passes_through_a_closed_crack() {
    let scene = |element: &str, multiplier: &str, cells: &str| {
        let space = if cells.ends_with("hex") || cells.ends_with("tet") { 3 } else { 2 };
        let (low, high, exact, inside) = if space == 3 {
            ("[-1.5,-1.5,-1]", "[1.5,1.5,1]", "[nu/E*x, nu/E*y, -1/E*z]", "z == 0 and abs(x) < 0.6 and abs(y) < 0.6")
        } else {
            ("[-1.5,-1]", "[1.5,1]", "[nu*(1 + nu)/E*x, -(1 - nu^2)/E*y]", "y == 0 and abs(x) < 0.5001")
        };
        let up = if space == 3 { "z" } else { "y" };
        format!(
            "use \"elasticity\"\nparam E = 1000\nparam nu = 0.25\nmesh box {low} to {high} cells {cells}\n\
             region below = cells where {up} < 0\nregion above = cells where {up} > 0\n\
             region crack = interface from below to above & faces of below where {inside}\nunknown u : vector {element}\n\
             split u across crack\nmultiplier l : scalar {multiplier} on crack\n\
             def jump(a) = a - Interpolate(a, neighbor_element)\ndef exact = {exact}\n\
             term elastic on all : work(u, Test_u, E, nu)\n\
             term couple on crack : l*(jump(Test_u).Normal) + (jump(u).Normal)*Test_l\nfix u = exact on boundary\n\
             measure worst = max(abs(l - 1)) at nodes of crack\nmeasure square = integral(sqr(l - 1)) on crack\n"
        )
    };
    for (element, multiplier, cells) in [
        ("P2", "DP0", "[12,12] tri"),
        ("Q2", "DP0", "[12,12] quad"),
        ("Q2", "DP0", "[6,6,4] hex"),
        ("P1", "P1", "[12,12] tri"),
        ("Q1", "Q1", "[12,12] quad"),
        ("P2", "P1", "[12,12] tri"),
        ("P2", "P2", "[12,12] tri"),
    ] {
        let found = solved(scene(element, multiplier, cells));
        let (worst, square) = (found.measure(0, "worst"), found.measure(0, "square"));
        assert!(worst < 1e-11 && square < 1e-22, "{element} {multiplier} {cells}: {worst:e} {square:e}");
    }
    let told = refused(&scene("P1", "DP0", "[12,12] tri"));
    assert!(told.contains("is not unique"), "{told}");
}

/// A multiplier of lower degree than the displacements, on a surface that ends at prescribed values: the jumps between its
/// nodes determine it there. Dropped, it would leave jumps that nothing ties. A linear solution is exact, and so is the
/// traction of the multiplier.
#[test]
fn coarse_multipliers_stay_at_prescribed_ends() {
    let scene = |element: &str, multiplier: &str, cells: &str| {
        let space = cells.ends_with("hex") || cells.ends_with("tet");
        let (high, up, strain) = if space {
            ("[0,0,0] to [1,1,1]", "z", "[2*x + y, -x - 3*y + z, 2*z + y]")
        } else {
            ("[0,0] to [1,1]", "y", "[x + 2*y, 3*x - y]")
        };
        format!(
            "use \"elasticity\"\nmesh box {high} cells {cells}\nregion below = cells where {up} < 0.5\n\
             region above = cells where {up} > 0.5\nregion s = interface from below to above\n\
             unknown u : vector {element}\nsplit u across s\nmultiplier l : vector {multiplier} on s\n\
             def jump(a) = a - Interpolate(a, neighbor_element)\ndef exact = {strain}\n\
             term elastic on all : work(u, Test_u, 1000, 0.25)\n\
             term tie on s : l.jump(Test_u) + jump(u).Test_l\nfix u = exact on boundary\n\
             measure off = max(Norm(u - exact)) on all\ndef t = traction(u, 1000, 0.25)\n\
             measure force = max(min(Norm(l - t), Norm(l + t))) on s\nmeasure size = max(Norm(t)) on s\n"
        )
    };
    for (element, multiplier, cells, told) in [
        ("Q2", "Q1", "[4,4] quad", false),
        ("Q2", "Q1", "[2,2] quad", false),
        ("P2", "P1", "[4,4] tri", false),
        ("P3", "P1", "[4,4] tri", false),
        ("P3", "P2", "[2,4] tri", false),
        ("Q2", "Q1", "[3,2,2] hex", false),
        ("P2", "P1", "[4,4,2] tet", false),
        // fewer jumps than values: some follow the nearest
        ("Q2", "Q1", "[1,2] quad", true),
        ("Q2", "Q1", "[1,2,2] hex", true),
        ("P2", "P1", "[2,1,2] tet", true),
        ("P2", "P1", "[1,3,2] tet", true),
        // one row of faces: the ends are determined from far away
        ("P2", "P1", "[40,1,2] tet", true),
        ("Q2", "Q1", "[40,1,2] hex", true),
    ] {
        let tried = attempt(&examples(), scene(element, multiplier, cells), &[], &[]);
        assert_eq!(tried.messages.contains("W404"), told, "{element} {cells}: {}", tried.messages);
        let found = tried.solved.unwrap_or_else(|| panic!("{element} {cells}: {}", tried.messages));
        let [off, force, size] = ["off", "force", "size"].map(|name| found.measure(0, name));
        // displacements of four; cells twenty times as long as wide leave more rounding, of which rows that are determined by a
        // hundredth of their size make a hundred times as much
        let [rounding, part] = if cells.starts_with("[40") { [2e-12, 1e-6] } else { [1e-13, 1e-9] };
        assert!(off < rounding, "{element} {multiplier} {cells}: {off:e}");
        assert!(!tried.messages.contains("is dropped"), "{element} {multiplier} {cells}: {}", tried.messages);
        assert!(force < part * size, "{element} {multiplier} {cells}: {force:e} of {size:e}");
    }
}

/// The same where two surfaces meet at a corner of a block, inside a body and at prescribed values, in both orders, and on a
/// line in space.
#[test]
fn coarse_multipliers_stay_where_they_meet() {
    for (element, multiplier, cells) in [
        ("Q2", "Q1", "[0,0] to [2,2] cells [4,4] quad"),
        ("P2", "P1", "[0,0] to [2,2] cells [4,4] tri"),
        ("P3", "P2", "[0,0] to [2,2] cells [4,4] tri"),
        ("Q2", "Q1", "[0,0,0] to [2,2,1] cells [4,4,2] hex"),
    ] {
        let [exact, low, side] = [
            if cells.contains("hex") { "[2*x + y, -x - 3*y + z, 2*z + y]" } else { "[x + 2*y, 3*x - y]" }.to_owned(),
            format!("multiplier l : vector {multiplier} on low\n"),
            format!("multiplier m : vector {multiplier} on side\n"),
        ];
        for multipliers in [format!("{low}{side}"), format!("{side}{low}")] {
            let tried = attempt(
                &examples(),
                format!(
                    "use \"elasticity\"\nmesh box {cells}\nregion block = cells where x > 1 and y > 1\n\
                     region right = cells where x > 1 and y < 1\nregion left = cells where x < 1\n\
                     region low = interface from block to right\nregion side = interface from block to left\n\
                     unknown u : vector {element}\nsplit u across low, side\n{multipliers}\
                     def jump(a) = a - Interpolate(a, neighbor_element)\ndef exact = {exact}\n\
                     term elastic on all : work(u, Test_u, 1000, 0.25)\n\
                     term under on low : l.jump(Test_u) + jump(u).Test_l\n\
                     term beside on side : m.jump(Test_u) + jump(u).Test_m\nfix u = exact on boundary\n\
                     measure off = max(Norm(u - exact)) on all\n"
                ),
                &[],
                &[],
            );
            assert!(!tried.messages.contains("W404"), "{element} {cells}: {}", tried.messages);
            let off = tried.solved.unwrap_or_else(|| panic!("{element} {cells}: {}", tried.messages)).measure(0, "off");
            assert!(off < 1e-13, "{element} {multiplier} {cells}: {off:e}");
        }
    }
}

/// Two interfaces between bodies with fields of their own: each multiplier has all its nodes but those that are prescribed,
/// and carries the load. As ties, and with friction.
#[test]
fn multipliers_between_bodies_of_their_own_fields_are_kept() {
    for friction in [false, true] {
        let law = |k: usize, a: &str, b: &str| {
            if friction {
                format!("term c{k} on face{k} : augmented({a}, {b}, l{k}, gamma, 0.3)\n")
            } else {
                format!("term c{k} on face{k} : l{k}.J(Test_{a}, Test_{b}) + Test_l{k}.J({a}, {b})\n")
            }
        };
        let found = solved(format!(
            "use \"elasticity\"\nuse \"contact\"\nparam gamma = 1e4\nmesh box [0,0] to [2,4] cells [2,4] quad\n\
             region low = cells where y < 1\nregion middle = cells where y > 1 and y < 3\nregion high = cells where y > 3\n\
             region face1 = interface from low to middle\nregion face2 = interface from middle to high\n\
             region floor = faces where y == 0\nregion top = faces where y == 4\nunknown uA : vector on low\n\
             unknown uB : vector on middle\nunknown uC : vector on high\nmultiplier l1 : vector on face1\n\
             multiplier l2 : vector on face2\ndef J(a, b) = a - Interpolate(b, neighbor_element)\n\
             term a on low : work(uA, Test_uA, 1000, 0)\nterm b on middle : work(uB, Test_uB, 1000, 0)\n\
             term c on high : work(uC, Test_uC, 1000, 0)\n{}{}fix uA = [0,0] on floor\nload uC = [0,-1] on top\n\
             measure one = integral(l1(2)) on face1\nmeasure two = integral(l2(2)) on face2\n\
             measure sink = mean(uC(2)) on top\n",
            law(1, "uA", "uB"),
            law(2, "uB", "uC")
        ));
        for force in ["one", "two"] {
            assert!((found.measure(0, force).abs() - 2.0).abs() < 1e-9, "{friction}: {}", found.measure(0, force));
        }
        assert!((found.measure(0, "sink") + 4e-3).abs() < 1e-12, "{friction}: {}", found.measure(0, "sink"));
    }
}

/// Friction at an edge where two rollers meet: tangential directions without a jump follow the nearest nodes along the axes
/// of their own frames, whichever way the scene is turned.
#[test]
fn friction_where_rollers_meet_does_not_depend_on_the_axes() {
    for angle in [0.0, 1e-3, 0.65] {
        let found = solved(format!(
            "use \"elasticity\"\nuse \"contact\"\nparam gamma = 1e4\nparam a = {angle}\n\
             mesh box [-1,0,0] to [1,1,1] cells [2,1,1] hex map [x*cos(a) - y*sin(a), x*sin(a) + y*cos(a), z]\n\
             def back = [x*cos(a) + y*sin(a), y*cos(a) - x*sin(a), z]\ndef turn = [cos(a),-sin(a),0; sin(a),cos(a),0; 0,0,1]\n\
             def G = [-3e-3,-2e-3,1e-3; 1.5e-3,-1e-3,7e-4; 3e-4,-4e-4,2e-3]\ndef exact = turn*(G*back)\n\
             def grad = turn*G*turn'\ndef S = 400*Trace(grad)*Id(3) + 800*Sym(grad)\n\
             def side = S*Normal - ((S*Normal).Normal)*Normal\nregion left = cells where back(1) < 0\n\
             region right = cells where back(1) > 0\nregion fault = interface from left to right\n\
             region west = faces where back(1) < -1 + 1e-9\nregion east = faces where back(1) > 1 - 1e-9\n\
             region south = faces where back(2) < 1e-9\nregion bottom = faces where back(3) < 1e-9\n\
             region open = faces where back(2) > 1 - 1e-9 or back(3) > 1 - 1e-9\n\
             region southL = south & faces of left\nregion southR = south & faces of right\n\
             region bottomL = bottom & faces of left\nregion bottomR = bottom & faces of right\n\
             region openL = open & faces of left\nregion openR = open & faces of right\n\
             unknown uL : vector on left\nunknown uR : vector on right\nmultiplier l : vector on fault\n\
             quadrature on fault vertex\nterm eL on left : work(uL, Test_uL, 1000, 0.25)\n\
             term eR on right : work(uR, Test_uR, 1000, 0.25)\nterm contact on fault : augmented(uL, uR, l, gamma, 0.7)\n\
             fix uL = exact on west\nfix uR = exact on east\nfix uL.Normal = exact.(turn*[0,-1,0]) on southL\n\
             fix uR.Normal = exact.(turn*[0,-1,0]) on southR\nfix uL.Normal = exact.[0,0,-1] on bottomL\n\
             fix uR.Normal = exact.[0,0,-1] on bottomR\nload uL = side on southL\nload uR = side on southR\n\
             load uL = side on bottomL\nload uR = side on bottomR\nload uL = S*Normal on openL\nload uR = S*Normal on openR\n\
             measure off = max(Norm(uL - exact)) on left\n"
        ));
        assert!(found.measure(0, "off") < 1e-13, "{angle}: {:e}", found.measure(0, "off"));
    }
}

/// Four bodies that meet in a cross, tied again by three multipliers: of four jumps at the crossing three are independent, and
/// the surface that runs through holds one combination of two. Exact for every order of the declarations.
#[test]
fn bodies_that_meet_in_a_cross_are_tied_in_every_order() {
    let names =
        ["multiplier m : scalar on through\n", "multiplier l : scalar on low\n", "multiplier n : scalar on high\n"];
    for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        let multipliers: String = order.iter().map(|k| names[*k]).collect();
        let found = solved(format!(
            "mesh box [0,0] to [2,2] cells [4,4] quad\nregion a = cells where x < 1 and y < 1\n\
             region b = cells where x > 1 and y < 1\nregion c = cells where x < 1 and y > 1\n\
             region d = cells where x > 1 and y > 1\nregion under = a + b\nregion over = c + d\n\
             region low = interface from a to b\nregion high = interface from c to d\n\
             region through = interface from under to over\nregion held = faces where x == 0 and y <= 0.5\n\
             region rest = boundary - held\nunknown u : scalar\nsplit u across low, high, through\n{multipliers}\
             def exact = 1 + 2*x - y\ndef jump(v) = v - Interpolate(v, neighbor_element)\n\
             term body on all : Grad_u.Grad_Test_u\nterm one on through : m*jump(Test_u) + Test_m*jump(u)\n\
             term two on low : l*jump(Test_u) + Test_l*jump(u)\nterm three on high : n*jump(Test_u) + Test_n*jump(u)\n\
             fix u = exact on held\nload u = [2,-1].Normal on rest\nmeasure off = max(abs(u - exact)) on all\n\
             measure open = max(abs(jump(u))) at nodes of through\n"
        ));
        assert!(found.measure(0, "off") < 1e-12 && found.measure(0, "open") < 1e-12, "{order:?}");
    }
}

/// One multiplier on a surface that branches has one value for two jumps: it is told.
#[test]
fn one_multiplier_on_a_surface_that_branches_is_told() {
    // in space the line where three bodies meet has two nodes
    for (mesh, pull, nodes) in [
        ("[0,0] to [2,2] cells [4,4] quad", "[2,-1]", "at 1 node"),
        ("[0,0,0] to [2,2,1] cells [4,4,1] hex", "[2,-1,0]", "at 2 nodes"),
    ] {
        branching(mesh, pull, nodes);
    }
}

fn branching(mesh: &str, pull: &str, nodes: &str) {
    let scene = |multipliers: &str| {
        format!(
            "mesh box {mesh}\nregion a = cells where y > 1\nregion b = cells where x < 1 and y < 1\n\
             region c = cells where x > 1 and y < 1\nregion under = b + c\nregion up = interface from under to a\n\
             region low = interface from b to c\nregion tee = low + up\nregion s = interface along tee\n\
             region held = faces where x == 0 and y <= 0.5\nregion rest = boundary - held\nunknown u : scalar\nsplit u across s\n\
             {multipliers}def exact = 1 + 2*x - y\ndef jump(v) = v - Interpolate(v, neighbor_element)\n\
             term body on all : Grad_u.Grad_Test_u\nfix u = exact on held\nload u = {pull}.Normal on rest\n\
             measure off = max(abs(u - exact)) on all\n"
        )
    };
    let one = scene("multiplier m : scalar on s\nterm tie on s : m*jump(Test_u) + Test_m*jump(u)\n");
    let tried = attempt(&examples(), one, &[], &[]);
    assert!(tried.messages.contains("W424") && tried.messages.contains(nodes), "{}", tried.messages);
    let two = scene(
        "multiplier m : scalar on up\nmultiplier l : scalar on low\nterm tie on up : m*jump(Test_u) + Test_m*jump(u)\n\
         term seam on low : l*jump(Test_u) + Test_l*jump(u)\n",
    );
    let tried = attempt(&examples(), two, &[], &[]);
    assert!(!tried.messages.contains("W424"), "{}", tried.messages);
    assert!(tried.solved.expect("a solution").measure(0, "off") < 1e-12);
}

/// A body in a corner, held along the normals of both walls: one multiplier has one value there for two directions, and is
/// told; one for each wall is exact, as is one value a face. Nothing is told of a wall that bends a little, and of one where
/// the corner is prescribed.
#[test]
fn one_multiplier_on_the_walls_of_a_corner_is_told() {
    let scene = |element: &str, multipliers: &str, more: &str| {
        format!(
            "use \"elasticity\"\nmesh box [0,0] to [1,1] cells [4,4] quad\nregion west = faces where x == 0\n\
             region south = faces where y == 0\nregion walls = west + south\nregion right = faces where x == 1\n\
             region top = faces where y == 1\nregion tip = nodes where x == 0 and y == 0\nunknown u : vector {element}\n\
             {multipliers}def exact = [-x, -4*y]\nterm elastic on all : work(u, Test_u, 1000, 0)\n\
             load u = [-1000,0] on right\nload u = [0,-4000] on top\n{more}\
             measure off = max(Norm(u - exact)) on all\n"
        )
    };
    let one = "multiplier p : scalar on walls\nterm hold on walls : p*(Test_u.Normal) + Test_p*(u.Normal)\n";
    let tried = attempt(&examples(), scene("Q1", one, ""), &[], &[]);
    assert!(tried.messages.contains("W424") && tried.messages.contains("at 1 node"), "{}", tried.messages);
    assert!(tried.solved.expect("a solution").measure(0, "off") > 0.05);
    let each = "multiplier p : scalar on west\nmultiplier q : scalar on south\n\
                term hold on west : p*(Test_u.Normal) + Test_p*(u.Normal)\n\
                term keep on south : q*(Test_u.Normal) + Test_q*(u.Normal)\n";
    let faces = one.replace("scalar", "scalar DP0");
    for (element, multipliers, more) in [("Q1", each, ""), ("Q2", &faces, ""), ("Q1", one, "fix u = [0,0] on tip\n")] {
        let tried = attempt(&examples(), scene(element, multipliers, more), &[], &[]);
        assert!(!tried.messages.contains("W424"), "{}", tried.messages);
        let off = tried.solved.expect("a solution").measure(0, "off");
        assert!(off < 1e-12, "{element}: {off:e}");
    }
    let cube = "mesh box [0,0,0] to [1,1,1] cells [2,2,2] hex\nregion walls = faces where x == 0 or y == 0 or z == 0\n\
                unknown u : vector\nmultiplier p : scalar on walls\nterm body on all : Sym(Grad_u):Grad_Test_u\n\
                term hold on walls : p*(Test_u.Normal) + Test_p*(u.Normal)\nload u = [1,2,3] on all\n";
    let tried = attempt(&examples(), cube.to_owned(), &[], &[]);
    assert!(tried.messages.contains("W424") && tried.messages.contains("at 7 nodes"), "{}", tried.messages);
    // the normals of its four faces differ by a few degrees
    let bent = scene("Q1", &one.replace("walls", "south"), "fix u(1) = 0 on west\n")
        .replace("cells [4,4] quad", "cells [4,4] quad map [x, y - 0.2*x*(1 - x)*(1 - y)]")
        .replace("faces where y == 0", "faces where y < 0.01");
    let tried = attempt(&examples(), bent, &[], &[]);
    assert!(tried.solved.is_some() && !tried.messages.contains("W424"), "{}", tried.messages);
}

/// Contact of linear pressures on quadratic tetrahedra, whose rule has its points between the nodes: a corner of prescribed
/// walls has no equation of its own there and follows the nearest node.
#[test]
fn contact_of_tetrahedra_has_a_pressure_at_corners() {
    let found = solved(
        "use \"elasticity\"\nparam gamma = 1e4\nmesh box [-1,0,0] to [1,1,1] cells [2,2,2] tet\n\
         region left = cells where x < 0\nregion right = cells where x > 0\nregion fault = interface from left to right\n\
         region oL = faces of left & boundary\nregion oR = faces of right & boundary\nunknown uL : vector P2 on left\n\
         unknown uR : vector P2 on right\nmultiplier l : scalar P1 on fault\n\
         def J(a, b) = a - Interpolate(b, neighbor_element)\ndef pn = gamma*(J(uL, uR).Normal) - l\n\
         term eL on left : work(uL, Test_uL, 1000, 0)\nterm eR on right : work(uR, Test_uR, 1000, 0)\n\
         term push on fault : pos_part(pn)*(J(Test_uL, Test_uR).Normal)\n\
         term law on fault : -1/gamma*(l + pos_part(pn))*Test_l\nfix uL = [-1e-3*x,0,0] on oL\n\
         fix uR = [-1e-3*x,0,0] on oR\nmeasure off = max(abs(l + 1)) on fault\n",
    );
    assert!(found.measure(0, "off") < 1e-11, "{:e}", found.measure(0, "off"));
}

/// A fault whose slope is its friction coefficient, with one component prescribed at its end: in one direction of sliding the
/// force there does not depend on the component without a jump, in the other it does. It follows, and a linear solution is exact.
#[test]
fn friction_as_large_as_the_slope_follows_at_the_end() {
    for friction in [0.69, 0.7] {
        let found = solved(format!(
            "use \"elasticity\"\nuse \"contact\"\nmesh box [-1,0] to [1,1] cells [2,2] quad map [x - 0.7*y, y]\n\
             def G = [-3e-3,-2e-3; 1.5e-3,-1e-3]\ndef exact = G*[x, y]\ndef S = 400*Trace(G)*Id(2) + 800*Sym(G)\n\
             region left = cells where x + 0.7*y < 0\nregion right = cells where x + 0.7*y > 0\n\
             region fault = interface from left to right\nregion west = faces where x + 0.7*y < -1 + 1e-9\n\
             region east = faces where x + 0.7*y > 1 - 1e-9\nregion southL = faces of left where y == 0\n\
             region southR = faces of right where y == 0\nregion northL = faces of left where y == 1\n\
             region northR = faces of right where y == 1\nunknown uL : vector on left\nunknown uR : vector on right\n\
             multiplier l : vector on fault\nquadrature on fault vertex\n\
             term eL on left : work(uL, Test_uL, 1000, 0.25)\nterm eR on right : work(uR, Test_uR, 1000, 0.25)\n\
             term contact on fault : augmented(uL, uR, l, 1e4, {friction})\nfix uL = exact on west\nfix uR = exact on east\n\
             fix uL(1) = exact(1) on southL\nfix uR(1) = exact(1) on southR\nload uL(2) = (S*Normal)(2) on southL\n\
             load uR(2) = (S*Normal)(2) on southR\nload uL = S*Normal on northL\nload uR = S*Normal on northR\n\
             measure off = max(Norm(uL - exact)) on left\n"
        ));
        assert!(found.measure(0, "off") < 1e-13, "{friction}: {:e}", found.measure(0, "off"));
    }
}

/// A value of zero that a multiplier prescribes: its equation is rounding of unknowns that are large elsewhere.
#[test]
fn a_value_of_zero_is_held_by_a_multiplier() {
    for (cells, element) in [("[2,2] quad", "Q1"), ("[3,5] tri", "P2"), ("[2,2] quad", "Q2")] {
        for size in [1e-12, 1.0, 1e12] {
            let found = solved(format!(
                "mesh box [0,0] to [1,1] cells {cells}\nregion west = faces where x == 0\nregion east = faces where x == 1\n\
                 unknown u : scalar {element}\nmultiplier l : scalar on west\nterm bar on all : Grad_u.Grad_Test_u\n\
                 term held on west : l*Test_u + Test_l*u\nload u = {size:e} on east\nmeasure pull = integral(l) on west\n\
                 measure off = max(abs(u - {size:e}*x)) on all\n"
            ));
            let [off, pull] = ["off", "pull"].map(|name| found.measure(0, name) / size);
            assert!(off < 1e-13 && (pull - 1.0).abs() < 1e-12, "{cells} {size:e}: {off:e} {pull}");
        }
    }
    let roller = solved(
        "use \"elasticity\"\nmesh box [0,0] to [1,1] cells [3,3] quad\nregion floor = faces where y == 0\n\
         region lid = faces where y == 1\nregion pin = nodes where x == 0 and y == 0\nunknown u : vector\n\
         multiplier l : scalar on floor\nterm body on all : work(u, Test_u, 1000, 0.3)\n\
         term roller on floor : l*(Test_u.Normal) + Test_l*(u.Normal)\nload u = [0,-2] on lid\nfix u(1) = 0 on pin\n\
         measure pull = integral(l) on floor\n",
    );
    assert!((roller.measure(0, "pull") + 2.0).abs() < 1e-9 || (roller.measure(0, "pull") - 2.0).abs() < 1e-9);
}
