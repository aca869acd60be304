//! Patch tests: constant stress on distorted cells of every kind with the rules that WFL chooses.
//!
//! A linear displacement is a solution of the continuous problem under the tractions of its constant stress, and it is
//! in every space here. The discrete solution is the same if the integrals of both sides are exact: the internal force
//! has the cofactors of the map in it, the load the normal and the measure of faces that are not plane. The reference
//! is the closed form.

use std::path::Path;

use wfl_jit::JitBackend;
use wfl_mesh::{
    element::{Element, Family},
    mesh::{BoxShape, CellKind, Mesh, generate_box},
};
use wfl_problem::RuleChoice;
use wfl_tests::{MeshFolder, Solved, prepared, solve};

/// Displacements and stresses are met to this part of the largest.
const EXACT: f64 = 1e-12;

/// The gradient of the displacement, and the same in the plane.
const SLOPES: &str = "[-0.05,0.012,0.02;-0.008,0.015,0.01;0.013,-0.011,0.02]";
const PLANE_SLOPES: &str = "[-0.05,0.012;-0.008,0.015]";

/// Moves the points of a unit cube such that no edge, face or cell stays affine; the plane x = 0 stays.
const BENT: &str = "[x*(1 + 0.15*sin(3*y + 4*z)), y + 0.1*sin(4*x + 2*z), z + 0.1*sin(3*x - 4*y)]";
const PLANE_BENT: &str = "[x*(1 + 0.15*sin(3*y)), y + 0.1*sin(4*x)]";

fn bent(p: [f64; 3], dim: usize) -> [f64; 3] {
    let [x, y, z] = p;
    let [a, b] = [x * (1.0 + 0.15 * (3.0 * y + 4.0 * z).sin()), y + 0.1 * (4.0 * x + 2.0 * z).sin()];
    [a, b, if dim == 3 { z + 0.1 * (3.0 * x - 4.0 * y).sin() } else { 0.0 }]
}

/// Gmsh's number of an element of second order and, for each of its nodes, the place in our Lagrange element.
fn second_order(kind: CellKind) -> (usize, &'static [usize]) {
    match kind {
        CellKind::Triangle => (9, &[0, 1, 2, 3, 4, 5]),
        CellKind::Quadrilateral => (10, &[0, 2, 8, 6, 1, 5, 7, 3, 4]),
        CellKind::Tetrahedron => (11, &[0, 1, 2, 3, 4, 5, 6, 7, 9, 8]),
        CellKind::Hexahedron => {
            (12, &[0, 2, 8, 6, 18, 20, 26, 24, 1, 3, 9, 5, 11, 7, 17, 15, 19, 21, 23, 25, 4, 10, 12, 14, 16, 22, 13])
        }
        _ => panic!("no cell of two or three dimensions"),
    }
}

/// A mesh file of second order: the nodes of a box at the middles of edges, faces and cells, all moved by [`bent`].
fn curved(shape: BoxShape, n: usize) -> String {
    let dim = shape.kind().dim();
    let mesh: Mesh = generate_box([0.0; 3], [1.0; 3], [n; 3], dim, shape).expect("a box");
    let element = Element::lagrange(shape.kind(), 2, Family::Continuous).expect("a quadratic element");
    let (code, order) = second_order(shape.kind());
    let mut nodes: Vec<[f64; 3]> = Vec::new();
    let mut cells = String::new();
    for (k, cell) in mesh.cells().enumerate() {
        let corners: Vec<[f64; 3]> = mesh.cell_vertices(cell).iter().map(|v| mesh.node(*v)).collect();
        let place = |r: [f64; 3]| -> [f64; 3] {
            let hats = shape.kind().hat_values(r);
            std::array::from_fn(|i| corners.iter().zip(hats).map(|(x, h)| h * x[i]).sum())
        };
        let mut number = |x: [f64; 3]| {
            let same = |y: &[f64; 3]| (0..3).all(|i| (x[i] - y[i]).abs() < 1e-9);
            nodes.iter().position(same).unwrap_or_else(|| {
                nodes.push(x);
                nodes.len() - 1
            })
        };
        let own: Vec<usize> = element.points().iter().map(|r| number(place(*r))).collect();
        let list: Vec<String> = order.iter().map(|o| (own[*o] + 1).to_string()).collect();
        cells += &format!("{} {code} 2 1 1 {}\n", k + 1, list.join(" "));
    }
    let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", nodes.len());
    for (k, x) in nodes.iter().enumerate() {
        let [a, b, c] = bent(*x, dim);
        text += &format!("{} {a:?} {b:?} {c:?}\n", k + 1);
    }
    text + &format!("$EndNodes\n$Elements\n{}\n{cells}$EndElements\n", mesh.n_cells())
}

/// The meshes: what they are, their dimension, and the lines or the file they come from.
fn meshes() -> Vec<(&'static str, usize, Result<String, BoxShape>)> {
    let boxed = |cells: &str, dim: usize| {
        let (corner, counts, map) =
            if dim == 3 { ("[1,1,1]", "[2,2,2]", BENT) } else { ("[1,1]", "[3,3]", PLANE_BENT) };
        let from = corner.replace('1', "0");
        Ok(format!("mesh box {from} to {corner} cells {counts} {cells} map {map}\n"))
    };
    vec![
        ("triangles", 2, boxed("tri", 2)),
        ("quadrilaterals", 2, boxed("quad", 2)),
        ("tetrahedra", 3, boxed("tet", 3)),
        ("hexahedra", 3, boxed("hex", 3)),
        ("triangles of second order", 2, Err(BoxShape::Triangle)),
        ("quadrilaterals of second order", 2, Err(BoxShape::Quadrilateral)),
        ("tetrahedra of second order", 3, Err(BoxShape::Tetrahedron)),
        ("hexahedra of second order", 3, Err(BoxShape::Hexahedron)),
    ]
}

/// Solves `scene` on every mesh with every element whose space has the linear functions, and shows each to `judge`.
fn on_every_mesh(name: &str, scene: impl Fn(usize, &str) -> String, judge: impl Fn(&str, &Solved)) {
    for (what, dim, made) in meshes() {
        let family = if what.contains("tri") || what.contains("tet") { "P" } else { "Q" };
        // on a curved cell the map must be in the space
        let degrees = if made.is_ok() { 1..=2 } else { 2..=2 };
        let (mesh, folder) = match made {
            Ok(line) => (line, None),
            Err(shape) => {
                let folder = MeshFolder::new(&format!("patch-{name}-{}", what.replace(' ', "-")), &curved(shape, 2));
                ("mesh file \"body.msh\"\n".to_owned(), Some(folder))
            }
        };
        let place = folder.as_ref().map_or(Path::new("."), MeshFolder::path);
        for degree in degrees {
            let element = format!("{family}{degree}");
            let text = mesh.clone() + &scene(dim, &element);
            let solved = solve(place, text, &[], &[]).unwrap_or_else(|e| panic!("{what}, {element}: {e}"));
            assert!(solved.outcome.converged(), "{what}, {element}");
            judge(&format!("{what}, {element}"), &solved);
        }
    }
}

/// The displacement with its gradient as a text.
fn exact(dim: usize) -> String {
    let (x, slopes) = if dim == 3 { ("[x,y,z]", SLOPES) } else { ("[x,y]", PLANE_SLOPES) };
    format!("def A = {slopes}\ndef exact = A*{x}\n")
}

fn is_exact(what: &str, solved: &Solved) {
    for (name, scale) in [("displacement", 0.05), ("stress", 15.0)] {
        let error = solved.measure(0, name) / scale;
        assert!(error < EXACT, "{what}: {name} wrong by {error:e}");
    }
}

#[test]
fn a_constant_stress_passes_on_every_distorted_cell() {
    let scene = |dim: usize, element: &str| {
        format!(
            "{}def law(e) = 120*Trace(e)*Id({dim}) + 160*Sym(e)\nunknown u : vector {element}\n\
             region clamp = faces where x == 0\nregion rest = boundary - clamp\n\
             term body on all : law(Grad_u):Grad_Test_u\nload u = law(A)*Normal on rest\nfix u = exact on clamp\n\
             measure displacement = max(Norm(u - exact)) on all\nmeasure stress = max(Norm(law(Grad_u) - law(A))) on all\n",
            exact(dim)
        )
    };
    on_every_mesh("linear", scene, is_exact);
}

#[test]
fn a_constant_stress_of_large_strains_passes_as_a_law_and_as_an_energy() {
    let scene = |density: bool| {
        move |dim: usize, element: &str| {
            let body = if density {
                format!("energy body on all : 40*(Trace(F'*F) - {dim} - 2*log(Det(F))) + 60*sqr(log(Det(F)))\n")
            } else {
                "term body on all : P(F):Grad_Test_u\n".to_owned()
            };
            format!(
                "{}unknown u : vector {element}\nregion clamp = faces where x == 0\nregion rest = boundary - clamp\n\
                 def P(f) = 80*(f - Inv(f)') + 120*log(Det(f))*Inv(f)'\ndef F = Id({dim}) + Grad_u\n\
                 def G = Id({dim}) + A\n{body}load u = P(G)*Normal on rest\nfix u = exact on clamp\n\
                 solver newton with tol=1e-15\nmeasure displacement = max(Norm(u - exact)) on all\n\
                 measure stress = max(Norm(P(F) - P(G))) on all\n",
                exact(dim)
            )
        }
    };
    on_every_mesh("law", scene(false), is_exact);
    on_every_mesh("energy", scene(true), is_exact);
}

#[test]
fn measures_and_loads_of_polynomials_are_exact_on_every_distorted_cell() {
    // the divergence theorem: both sides are polynomials in the reference cell
    let scene = |dim: usize, element: &str| {
        let x = if dim == 3 { "[x*y,y*z,z*x]" } else { "[x*y,y*x]" };
        let inside = if dim == 3 { "x + y + z" } else { "x + y" };
        format!(
            "unknown u : vector {element}\nterm body on all : u.Test_u\nload u = [{}] on all\n\
             measure volume = integral(1) on all\nmeasure outside = integral(1/{dim}*({}).Normal) on boundary\n\
             measure inner = integral({inside}) on all\nmeasure outer = integral({x}.Normal) on boundary\n\
             measure mean_u = integral(u(1)) on all\nmeasure mean_x = integral(x) on all\n",
            if dim == 3 { "x,y,z" } else { "x,y" },
            if dim == 3 { "[x,y,z]" } else { "[x,y]" },
        )
    };
    on_every_mesh("measures", scene, |what, solved| {
        for (a, b) in [("volume", "outside"), ("inner", "outer"), ("mean_u", "mean_x")] {
            let [p, q] = [a, b].map(|m| solved.measure(0, m));
            assert!((p - q).abs() < EXACT, "{what}: {a} {p}, {b} {q}");
        }
    });
}

/// Two blocks: the left one held at x = -1, the right one held by the interface alone.
fn blocks(dim: usize, cells: &str, map: &str, left: &str, contact: &str, behind: &str) -> String {
    let (from, to, counts) = if dim == 3 { ("[-1,0,0]", "[1,1,1]", "[4,2,2]") } else { ("[-1,0]", "[1,1]", "[4,3]") };
    format!(
        "mesh box {from} to {to} cells {counts} {cells} map {map}\n{}param gamma = 1000\n\
         region left = cells where {left}\nregion right = all - left\n\
         region fault = interface from left to right\nregion clamp = faces where x == -1\nregion rest = boundary - clamp\n\
         unknown uL : vector on left\nunknown uR : vector on right\n\
         def law(e) = 120*Trace(e)*Id({dim}) + 160*Sym(e)\ndef jump(a,b) = a - Interpolate(b, neighbor_element)\n\
         def tang(v) = v - (v.Normal)*Normal\ndef trac(v) = law(Grad_v)*Normal\n\
         term bodyL on left : law(Grad_uL):Grad_Test_uL\nterm bodyR on right : law(Grad_uR):Grad_Test_uR\n\
         {contact}load uL, uR = law(A)*Normal on rest\nfix uL = exact on clamp\nsolver newton with tol=1e-15\n\
         measure displacement = max(Norm(uL - exact)) on left\n\
         measure there = max(Norm(uR - (exact + {behind}))) on right\n\
         measure stress = max(Norm(law(Grad_uR) - law(A))) on right\n",
        exact(dim)
    )
}

const NITSCHE: &str = "def Pn = gamma*(jump(uL,uR).Normal) - trac(uL).Normal\n\
    def Pt = gamma*tang(jump(uL,uR)) - tang(trac(uL))\n\
    def Pv = gamma*jump(Test_uL,Test_uR) - theta*trac(Test_uL)\n\
    def force = pos_part(Pn)*Normal + Ball_projection(Pt, 5*pos_part(Pn))\n\
    term stress on fault : -theta/gamma*trac(uL).trac(Test_uL)\nterm contact on fault : 1/gamma*force.Pv\n";
const PENALTY: &str = "def Pn = gamma*(jump(uL,uR).Normal)\ndef Pt = gamma*tang(jump(uL,uR))\n\
    def force = pos_part(Pn)*Normal + Ball_projection(Pt, 5*pos_part(Pn))\n\
    term contact on fault : force.jump(Test_uL,Test_uR)\n";
const AUGMENTED: &str = "multiplier l : vector on fault\ndef Pn = gamma*(jump(uL,uR).Normal) - l.Normal\n\
    def Pt = gamma*tang(jump(uL,uR)) - tang(l)\n\
    def force = pos_part(Pn)*Normal + Ball_projection(Pt, 5*pos_part(Pn))\n\
    term law on fault : -1/gamma*(l + force).Test_l\nterm contact on fault : force.jump(Test_uL,Test_uR)\n";

/// Nitsche's method between two halves of a cube of curved cells, over an interface that is not plane.
#[test]
fn a_constant_pressure_passes_through_contact_of_cells_of_second_order() {
    for (shape, element, name) in [
        (BoxShape::Triangle, "P2", "triangles"),
        (BoxShape::Quadrilateral, "Q2", "quadrilaterals"),
        (BoxShape::Tetrahedron, "P2", "tetrahedra"),
        (BoxShape::Hexahedron, "Q2", "hexahedra"),
    ] {
        let dim = shape.kind().dim();
        let folder = MeshFolder::new(&format!("patch-contact-{name}"), &curved(shape, 2));
        let none = if dim == 3 { "[0,0,0]" } else { "[0,0]" };
        let text = blocks(dim, "tri", "x", "x < 0.5", &NITSCHE.replace("theta", "0"), none);
        let (_, rest) = text.split_once('\n').expect("the line of the mesh");
        let text = format!("mesh file \"body.msh\"\n{rest}")
            .replace("x == -1", "x == 0")
            .replace("vector on", &format!("vector {element} on"));
        let solved = solve(folder.path(), text, &[], &[]).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(solved.outcome.converged(), "{name}");
        is_exact(name, &solved);
    }
}

/// A plane interface divided into faces that are no parallelograms, and an interface that is not plane.
const FLAT: &str = "[x*(1 + 0.1*sin(3*y + 4*z)*(1 - abs(x))), y + 0.1*sin(4*y + 5*z), z + 0.1*sin(3*y - 4*z)]";
const FLAT_2D: &str = "[x*(1 + 0.1*sin(3*y)*(1 - abs(x))), y + 0.1*sin(4*x)]";
const SKEW: &str = "[x + 0.1*(1 - x^2)*sin(4*y + 5*z), y + 0.1*sin(4*y + 5*z), z + 0.1*sin(3*y - 4*z)]";
const SKEW_2D: &str = "[x + 0.1*(1 - x^2)*sin(5*y), y + 0.1*sin(4*x)]";

#[test]
fn a_constant_pressure_passes_through_contact_of_distorted_cells() {
    let nitsche = |theta: &str| NITSCHE.replace("theta", theta);
    // the sides of a penalty are apart by its flexibility, the same everywhere on a plane
    let (apart, apart_2d) = ("1/gamma*(law(A)*[1,0,0])", "1/gamma*(law(A)*[1,0])");
    let mut all = Vec::new();
    for (dim, cells, none, apart, flat, skew, left) in [
        (3, "hex", "[0,0,0]", apart, FLAT, SKEW, "x < 0.1*sin(4*y + 5*z)"),
        (3, "tet", "[0,0,0]", apart, FLAT, SKEW, "x < 0.1*sin(4*y + 5*z)"),
        (2, "quad", "[0,0]", apart_2d, FLAT_2D, SKEW_2D, "x < 0.1*sin(5*y)"),
    ] {
        for theta in ["(-1)", "0", "1"] {
            all.push((dim, cells, format!("Nitsche {theta}"), nitsche(theta), none, skew, left));
        }
        all.push((dim, cells, "penalty".to_owned(), PENALTY.to_owned(), apart, flat, "x < 0"));
        all.push((dim, cells, "augmented Lagrangian".to_owned(), AUGMENTED.to_owned(), none, flat, "x < 0"));
    }
    for (dim, cells, name, contact, behind, map, left) in all {
        let what = format!("{name} on {cells}");
        let text = blocks(dim, cells, map, left, &contact, behind);
        let solved = solve(Path::new("."), text, &[], &[]).unwrap_or_else(|e| panic!("{what}: {e}"));
        assert!(solved.outcome.converged(), "{what}");
        is_exact(&what, &solved);
        let there = solved.measure(0, "there") / 0.05;
        assert!(there < EXACT, "{what}: the right block is wrong by {there:e}");
    }
}

/// Contact at the nodes of quadratic elements on hexahedra of first order: the faces between are neither plane nor
/// parallelograms, those outside are plane.
#[test]
fn a_constant_pressure_passes_at_the_nodes_of_quadratic_hexahedra() {
    let map = "[x + 0.1*(1 - x^2)*sin(4*y + 5*z), y + 0.1*sin(pi*y)*sin(4*z), z + 0.1*sin(pi*z)*sin(3*y)]";
    for theta in ["(-1)", "0", "1"] {
        // above the smallest safe value
        let text = blocks(3, "hex", map, "x < 0.1*sin(4*y + 5*z)", &NITSCHE.replace("theta", theta), "[0,0,0]")
            .replace("vector on", "vector Q2 on")
            .replace("gamma = 1000", "gamma = 1e5");
        // laws that read a traction keep Gauss points on quadrilaterals where nothing is said
        let text = text + "quadrature on fault vertex\n";
        let rule = degrees(&text).into_iter().find(|term| term.0 == "contact").map(|term| term.1);
        assert_eq!(rule, Some(RuleChoice::Vertex), "{theta}");
        let solved = solve(Path::new("."), text, &[], &[]).unwrap_or_else(|e| panic!("{theta}: {e}"));
        assert!(solved.outcome.converged(), "{theta}");
        is_exact(theta, &solved);
    }
}

/// The degrees of the rules of a scene by term.
fn degrees(text: &str) -> Vec<(String, RuleChoice)> {
    let backend = JitBackend::new().expect("machine code on this processor");
    let scene = prepared(Path::new("."), text.to_owned(), &[], &[], &backend).unwrap_or_else(|e| panic!("{e}"));
    scene.terms.iter().map(|t| (t.name.clone(), t.rule)).collect()
}

const ELASTIC: &str = "unknown u : vector\nterm body on all : Sym(Grad_u):Grad_Test_u\n\
    load u = Normal on boundary\nterm weight on all : u.Test_u\n";

#[test]
fn parallelepipeds_have_the_rules_of_boxes_and_skew_hexahedra_those_of_their_map() {
    let scene = |map: &str| format!("mesh box [0,0,0] to [1,1,1] cells [2,2,2] hex{map}\n{ELASTIC}");
    let of = |map: &str| degrees(&scene(map));
    let boxes = of("");
    assert_eq!(boxes[0].1, RuleChoice::Degree(2), "{boxes:?}");
    assert_eq!(boxes[2].1, RuleChoice::Degree(1), "{boxes:?}");
    for map in ["[2*x + 0.3*y, y/3 + 0.1*z + 7, z - x/9]", "[sin(0.7)*x + cos(0.7)*y, sin(0.7)*y - cos(0.7)*x, z^3]"] {
        assert_eq!(of(&format!(" map {map}")), boxes, "{map}");
    }
    let skew = of(" map [x + 0.1*y*z, y, z]");
    // u.Test_u has degree 2, the determinant 2; Normal.Test_u has degree 1, the normal with the measure 1
    assert_eq!(skew[0].1, RuleChoice::Degree(4), "{skew:?}");
    assert_eq!(skew[2].1, RuleChoice::Degree(2), "{skew:?}");
}

#[test]
fn a_law_that_is_no_polynomial_gets_2p_plus_1_and_3p_on_simplices() {
    let scene = |cells: &str, element: &str| {
        format!(
            "mesh box [0,0,0] to [1,1,1] cells [2,2,2] {cells}\nregion floor = faces where z == 0\n\
             unknown u : vector {element}\ndef F = Id(3) + Grad_u\n\
             def P = 80*(F - Inv(F)') + 120*log(Det(F))*Inv(F)'\nterm body on all : P:Grad_Test_u\n\
             term contact on floor : pos_part(1e4*(u.Normal) - (P*Normal).Normal)*(Normal.Test_u)\n"
        )
    };
    for (cells, element, body, contact) in
        [("hex", "Q1", 3, 4), ("hex", "Q2", 5, 6), ("tet", "P1", 0, 1), ("tet", "P2", 3, 2), ("tet", "P3", 6, 3)]
    {
        let found: Vec<RuleChoice> = degrees(&scene(cells, element)).into_iter().map(|d| d.1).collect();
        // faces with contact have a point a node; quadrilaterals the points of the degree, as the law reads a traction
        let nodes = RuleChoice::Nodes { degree: contact, axis: None };
        let rule = if cells == "hex" { RuleChoice::Degree(contact) } else { nodes };
        assert_eq!(found, [RuleChoice::Degree(body), rule], "{element}");
    }
}

#[test]
fn integrals_of_polynomials_do_not_depend_on_the_rule_of_the_terms_beside_them() {
    // the term has one point a cell
    let text = "mesh box [0,0] to [1,1] cells [3,3] tri\nunknown u : scalar\nregion west = faces where x == 0\n\
        term flow on all : Grad_u.Grad_Test_u\nfix u = 1 on west\nmeasure moment = integral(x^4) on all\n";
    let solved = solve(Path::new("."), text.to_owned(), &[], &[]).unwrap_or_else(|e| panic!("{e}"));
    assert!((solved.measure(0, "moment") - 0.2).abs() < 1e-14);
}
