//! Rims of surfaces: integrals along edges in space and at points in the plane, `Conormal`, loads per length, and what is
//! told of a rim without a condition. References: closed forms, and the divergence theorem on surfaces.

use std::path::Path;

use wfl_run::Outcome;
use wfl_tests::{
    MeshFolder,
    ranks::{self, Holding, Shared},
    refused, solve, solved,
};

/// What is polynomial comes out to this.
const EXACT: f64 = 1e-12;

/// A sheet across a box that no axis keeps, in the plane a line, with cells of each kind and degree.
const BOXES: [(&str, &str); 8] = [
    ("box [-1,0] to [1,1] cells [4,4] tri map [x + 0.3*y, y - 0.2*x]", "P1"),
    ("box [-1,0] to [1,1] cells [4,4] tri map [x + 0.3*y, y - 0.2*x]", "P2"),
    ("box [-1,0] to [1,1] cells [4,4] quad map [x + 0.3*y, y - 0.2*x]", "Q1"),
    ("box [-1,0] to [1,1] cells [4,4] quad map [x + 0.3*y, y - 0.2*x]", "Q2"),
    ("box [-1,0,0] to [1,1,1] cells [4,3,3] tet map [x + 0.3*y - 0.1*z, y - 0.2*x + 0.1*z, z + 0.2*x - 0.3*y]", "P1"),
    ("box [-1,0,0] to [1,1,1] cells [4,3,3] tet map [x + 0.3*y - 0.1*z, y - 0.2*x + 0.1*z, z + 0.2*x - 0.3*y]", "P2"),
    ("box [-1,0,0] to [1,1,1] cells [4,3,3] hex map [x + 0.3*y - 0.1*z, y - 0.2*x + 0.1*z, z + 0.2*x - 0.3*y]", "Q1"),
    ("box [-1,0,0] to [1,1,1] cells [4,3,3] hex map [x + 0.3*y - 0.1*z, y - 0.2*x + 0.1*z, z + 0.2*x - 0.3*y]", "Q2"),
];

/// Zero on the sheet, that was x = 0 before the map.
fn across(mesh: &str) -> &'static str {
    if mesh.contains(",0,0]") { "(1.03*x - 0.27*y + 0.13*z)" } else { "(x - 0.3*y)" }
}

/// A matrix, and a linear function of the position.
fn linear(mesh: &str) -> [&'static str; 2] {
    if mesh.contains(",0,0]") {
        ["[0.7,-1.3,0.4;0.2,0.5,-0.6;1.1,0.3,0.9]", "[x,y,z]"]
    } else {
        ["[0.7,-1.3;0.2,0.5]", "[x,y]"]
    }
}

/// The integral over a plane sheet of the divergence along it is that of the flux out of its rim, the conormal is a unit
/// vector across the rim in the sheet, and the four sides of the rim add up to all of it.
#[test]
fn the_divergence_along_a_sheet_flows_out_of_its_rim() {
    for (mesh, element) in BOXES {
        let ([matrix, position], s) = (linear(mesh), across(mesh));
        for faces in [
            "interface from left to right",
            "interface from right to left",
            "faces of left where abs(S) < 1e-9",
            "faces of right where abs(S) < 1e-9",
        ] {
            let found = solved(format!(
                "mesh {mesh}\nregion left = cells where {s} < 0\nregion right = all - left\n\
                 region sheet = {}\nregion edge = rim of sheet\nregion low = rim of sheet where y < 0.3\n\
                 region high = edge - low\nunknown p : scalar {element} on sheet\nterm flow on sheet : p*Test_p\n\
                 def A = {matrix}\ndef v = A*{position}\n\
                 measure inside = integral(Trace(A) - (A*Normal).Normal) on sheet\n\
                 measure out = integral((v - (v.Normal)*Normal).Conormal) on edge\n\
                 measure low = integral(v.Conormal) on low\nmeasure high = integral(v.Conormal) on high\n\
                 measure unit = max(abs(Norm(Conormal) - 1) + abs(Conormal.Normal)) on edge\n\
                 measure size = integral(1) on sheet\nmeasure of_rim = integral({position}.Conormal) on edge\n",
                faces.replace('S', s)
            ));
            let of = |name: &str| found.measure(0, name);
            let dim = if mesh.contains(",0,0]") { 2.0 } else { 1.0 };
            for (name, error) in [
                ("out", of("out") - of("inside")),
                ("parts", of("low") + of("high") - of("out")),
                ("unit", of("unit")),
                ("of_rim", of("of_rim") - dim * of("size")),
            ] {
                assert!(error.abs() < EXACT, "{mesh} {element}, {faces}: {name} {error:e}");
            }
        }
    }
}

/// A linear pressure with the flux that belongs to it: by a Robin term, by a load per length, by values at the nodes of all
/// orders; quadratic pressures where the element has them.
#[test]
fn conditions_on_rims_keep_what_the_elements_have() {
    for (mesh, element) in BOXES {
        let ([_, position], s) = (linear(mesh), across(mesh));
        let slope = if mesh.contains(",0,0]") { "[0.7,-1.3,0.4]" } else { "[0.7,-1.3]" };
        let linear = format!("{slope}.{position}");
        let quadratic = format!("sqr({slope}.{position})");
        let gradient = format!("2*({slope}.{position})*{slope}");
        let mut cases = vec![
            format!("term out on edge : 3*(p - {linear})*Test_p\nload p = {slope}.Conormal on edge"),
            format!("term out on edge : (3*(p - {linear}) - {slope}.Conormal)*Test_p"),
            format!("fix p = {linear} on edge"),
        ];
        if element.ends_with('2') {
            let source = format!("load p = -2*(sqr(Norm({slope})) - sqr({slope}.Normal)) on sheet\n");
            cases.push(format!("{source}term out on edge : (3*(p - {quadratic}) - ({gradient}).Conormal)*Test_p"));
            cases.push(format!("{source}fix p = {quadratic} on edge"));
        }
        for (k, case) in cases.iter().enumerate() {
            let exact = if k < 3 { &linear } else { &quadratic };
            let found = solved(format!(
                "mesh {mesh}\nregion left = cells where {s} < 0\nregion right = all - left\n\
                 region sheet = interface from left to right\nregion edge = rim of sheet\n\
                 unknown p : scalar {element} on sheet\nterm flow on sheet : Grad_p.Grad_Test_p\n{case}\n\
                 measure error = max(abs(p - {exact})) on sheet\n"
            ));
            let error = found.measure(0, "error");
            assert!(error < 10.0 * EXACT, "{mesh} {element}, {case}: {error:e}");
        }
    }
}

/// A mesh of hexahedra, wedges, pyramids and tetrahedra, and one of curved cells of second order.
const SOLIDS: &str = include_str!("../../runtime/mesh/src/mesh/read/data/solids_41a.msh");
const CURVED: &str = include_str!("../../runtime/mesh/src/mesh/read/data/solids2_22a.msh");

/// On faces of every kind of cell the rim is closed, and the divergence theorem holds, along bent edges, too.
#[test]
fn rims_of_every_kind_of_cell_are_whole() {
    for (element, name, mesh) in [("P1", "p1", SOLIDS), ("P2", "p2", SOLIDS), ("P2", "curved", CURVED)] {
        let folder = MeshFolder::new(&format!("rims-{name}"), mesh);
        let text = format!(
            "mesh file \"body.msh\"\nregion side = faces where x == 0\nregion edge = rim of side\n\
             unknown p : scalar {element} on side\nterm flow on side : Grad_p.Grad_Test_p\n\
             term out on edge : (2*(p - y + 3*z) - [0,1,-3].Conormal)*Test_p\n\
             measure error = max(abs(p - y + 3*z)) on side\nmeasure area = integral(1) on side\n\
             measure out = integral([x,y,z].Conormal) on edge\nmeasure closed = integral(Conormal(2) + 2*Conormal(3)) on edge\n"
        );
        let found = solve(folder.path(), text, &[], &[]).unwrap_or_else(|e| panic!("{e}"));
        let of = |name: &str| found.measure(0, name);
        assert!(of("error") < EXACT && of("closed").abs() < EXACT, "{name}: {} {}", of("error"), of("closed"));
        assert!((of("out") - 2.0 * of("area")).abs() < EXACT, "{name}: {} {}", of("out"), of("area"));
    }
}

/// A half disc bent onto a cylinder of radius 2: the length of its rim, and a flux along the axis. Order four in the size of
/// cells of first order would be luck: straight edges have the lengths of chords, order two.
#[test]
fn the_rim_of_a_cylinder_has_its_length() {
    let errors = [8, 16].map(|n| {
        let found = solved(format!(
            "mesh box [0,0,0] to [pi,0.5,1] cells [{n},1,2] hex map [(2 + y)*sin(x), (2 + y)*cos(x), z]\n\
             region shell = faces where x^2 + y^2 < 4.001\nregion edge = rim of shell\n\
             region top = rim of shell where z == 1\nunknown p : scalar on shell\nterm flow on shell : p*Test_p\n\
             measure length = integral(1) on edge\nmeasure up = integral(Conormal(3)) on top\n"
        ));
        let (length, up) = (found.measure(0, "length"), found.measure(0, "up"));
        let side = length / 2.0 - 1.0;
        assert!((up - side).abs() < EXACT, "the conormal of the upper edge points up: {up}, {side}");
        2.0 * std::f64::consts::PI - side
    });
    let order = (errors[0] / errors[1]).log2();
    assert!(errors[0] > 0.0 && (order - 2.0).abs() < 0.02, "{errors:?}, order {order}");
}

/// Along an edge of a quadrilateral the gradient across it has the full degree of the face: it is integrated with that.
#[test]
fn gradients_across_an_edge_have_the_degree_of_the_face() {
    let found = solved(
        "mesh box [-1,0,0] to [1,1,1] cells [2,1,1] hex\nregion left = cells where x < 0\n\
         region sheet = faces of left where x == 0\nregion top = rim of sheet where z == 1\nunknown p : scalar Q2 on sheet\n\
         term value on sheet : (p - sqr(y)*sqr(z))*Test_p\nmeasure out = integral(Grad_p.Conormal) on top\n",
    );
    assert!((found.measure(0, "out") - 2.0 / 3.0).abs() < EXACT, "{}", found.measure(0, "out"));
}

/// Fluid is injected into a sheet and leaves through its rim against an entry pressure, where the pressure is higher than
/// that: the balance knows the outflow, whatever the number of ranks.
#[test]
fn what_flows_out_of_a_rim_is_in_the_balance_of_all_ranks() {
    let text = "use \"poro\"\nmesh box [-1,-1,-1] to [1,1,1] cells [6,6,4] hex\nregion below = cells where z < 0\n\
        region above = cells where z > 0\nregion fault = interface from below to above\n\
        region well = nodes of fault where abs(x) < 1e-9 and abs(y) < 1e-9\n\
        region east = rim of fault where x == 1\nregion west = rim of fault where x == -1\nunknown p : scalar Q1\n\
        unknown pf : scalar Q1 on fault\nsplit p across fault\nterm rock on all : darcy(p, 0.3)\n\
        term flow on fault : along_fault(pf, 2)\nterm leak on fault : leakoff(pf, p, 5)\n\
        term seep on east : 4*pos_part(pf - 0.05)*Test_pf\nload pf = -0.1 on west\nload pf = 1 on well\n\
        region floor = faces where z == -1\nfix p = 0 on floor\nbalance water of p, pf\n\
        measure seeps = integral(4*pos_part(pf - 0.05)) on east\nmeasure floor = reaction(p) on floor\n";
    let scene = Shared::text(Path::new("."), text.to_owned(), &[]);
    let measures = |outcome: &Outcome| outcome.steps[0].measures.clone();
    let alone = measures(&ranks::solved(scene.whole()));
    let of = |name: &str| alone.iter().find(|m| m.0 == name).expect("a measure").1;
    assert!(of("seeps") > 0.05, "{}", of("seeps"));
    assert!((of("water_seep") - of("seeps")).abs() < EXACT && (of("seeps") + of("floor") - 0.8).abs() < 1e-10);
    // the load takes 0.1 per length over the length 2 of the western rim
    assert!((of("water_in") - 1.0).abs() < EXACT && (of("water_out") - of("floor") - 0.2).abs() < 1e-10);
    assert!(of("water_lost").abs() < 1e-10, "{}", of("water_lost"));
    for holding in [Holding::Whole, Holding::Parts] {
        for of_rank in scene.on_ranks(3, holding, |part| measures(&ranks::solved(part))) {
            for ((name, is), (_, should)) in of_rank.iter().zip(&alone) {
                assert!((is - should).abs() < 1e-10, "{holding:?} {name}: {is}, {should}");
            }
        }
    }
}

/// What `wfl check` lists: how much of a rim has no condition, and where.
#[test]
fn a_rim_without_a_condition_is_known() {
    let scene = |lines: &str| {
        let found = solved(format!(
            "mesh box [0,0,0] to [1,1,1] cells [4,4,2] hex\nregion sheet = faces where z == 0\n\
             region west = rim of sheet where x == 0\nregion east = rim of sheet where x == 1\n\
             region corner = nodes of sheet where x == 0 and y == 0\nunknown p : scalar on sheet\n\
             unknown q : scalar Q2 on sheet\nterm flow on sheet : Grad_p.Grad_Test_p + p*Test_p + q*Test_q\n{lines}\n"
        ));
        let rims = found.scene.rims_of_fields();
        assert_eq!(rims.len(), 1, "an unknown without a flux has nothing to tell");
        assert_eq!((rims[0].field.as_str(), rims[0].edges), ("p", 16));
        let place = |x: [f64; 3]| [x[0], x[1]];
        rims[0].open.iter().map(|open| (open.edges, place(open.low), place(open.high))).collect::<Vec<_>>()
    };
    assert_eq!(scene("load p = 1 on corner"), [(16, [0.0, 0.0], [1.0, 1.0])]);
    assert_eq!(
        scene("fix p = 1 on west\nterm out on east : p*Test_p"),
        [(4, [0.0, 0.0], [1.0, 0.0]), (4, [0.0, 1.0], [1.0, 1.0])]
    );
    assert_eq!(scene("region edge = rim of sheet\nfix p = 1 on edge"), []);
}

/// What has no meaning on a rim, or elsewhere, is refused, and what a condition cuts is told.
#[test]
fn what_has_no_place_on_a_rim_is_told() {
    let scene = |lines: &str| {
        format!(
            "mesh box [0,0,-1] to [1,1,1] cells [4,4,2] hex\nregion below = cells where z < 0\n\
             region sheet = faces of below where z == 0\nregion edge = rim of sheet\nunknown p : scalar on sheet\n\
             term flow on sheet : Grad_p.Grad_Test_p + p*Test_p\n{lines}\n"
        )
    };
    for (lines, code, says) in [
        ("term out on sheet : Conormal(1)*Test_p", "E204", "where faces end"),
        ("term out on below : Conormal(1)*Test_p", "E204", "where faces end"),
        ("term out on edge : Interpolate(p, neighbor_element)*Test_p", "E203", "16 edges of faces"),
        ("unknown r : scalar Q2 on edge\nterm out on edge : r*Test_r", "E406", "one value a node"),
        ("unknown r : scalar on edge\nterm out on sheet : r*Test_r", "E202", "does not live on"),
        (
            "region all_nodes = nodes of sheet\nunknown r : scalar on all_nodes\nterm out on sheet : p*Test_p",
            "E405",
            "cells or faces",
        ),
        ("region dot = rim of sheet where x == 0 and y == 0\nterm out on dot : p*Test_p", "E490", "1 single nodes"),
        ("region dot = rim of sheet where x == 0 and y == 0\nload p = 1 on dot", "E490", "single nodes"),
        ("region dot = rim of sheet where x == 0 and y == 0\nmeasure d = integral(1) on dot", "E490", "single nodes"),
        (
            "region all_nodes = nodes of sheet\nregion inner = edge & all_nodes\nterm out on inner : p*Test_p",
            "E405",
            "the rim of faces are needed",
        ),
        ("unknown u : scalar Q2\nterm b on all : u*Test_u\nfix u = 1 on edge", "E405", "inside the edges"),
    ] {
        let told = refused(&scene(lines));
        assert!(told.contains(code) && told.contains(says), "{lines}: {told}");
    }
    let attempt = |lines: &str| wfl_tests::attempt(Path::new("."), scene(lines), &[], &[]);
    let told = attempt("region half = rim of sheet where y == 0 and x < 0.4\nload p = 1 on half");
    assert!(told.solved.is_some() && told.messages.contains("W419"), "{}", told.messages);
    assert!(told.messages.contains("37 % of the length"), "{}", told.messages);
    let told = attempt("region half = rim of sheet where y == 0 and x < 0.6\nload p = 1 on half\nfix p = 0 on half");
    assert!(told.messages.contains("W419"), "{}", told.messages);
    let told = attempt("region half = rim of sheet where x < 0.6\nfix p = 0 on half");
    assert!(told.messages.contains("W419"), "{}", told.messages);
    let told = attempt("region half = rim of sheet where x > 0.9\nload p = 1 on half");
    assert!(!told.messages.contains("W419"), "{}", told.messages);
}
