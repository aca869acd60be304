//! B12: manufactured solutions on every element: error tables of an independent program, exactness, and orders of
//! convergence in two and three dimensions.

use super::{
    Benchmark, Case, Tolerance,
    common::{PLANE, example, or_failed, order, rows, scene},
};
use crate::reference;

/// The benchmarks of this file.
pub(super) const BENCHMARKS: &[Benchmark] = &[
    Benchmark {
        id: "B12",
        title: "manufactured solutions: Poisson, plane-strain elasticity, interface law with a jump, neo-Hookean shear",
        origin: "scikit-fem and an independent program, `physics_mms.json`; orders: theory",
        slow: false,
        open: None,
        run: tables,
    },
    Benchmark {
        id: "B12-3D",
        title: "orders of convergence on tetrahedra and hexahedra, linear elasticity",
        origin: "theory: degree k gives k in H1 and k + 1 in L2",
        slow: true,
        open: None,
        run: solid,
    },
];

fn tables() -> Vec<Case> {
    let data = reference("physics_mms.json");
    let mut cases = Vec::new();
    for (element, shape, degree) in PLANE {
        for (name, path, table, fem) in [
            ("Poisson", "poisson/poisson.wfl", &data["poisson"], "scalar P1"),
            ("elasticity", "elasticity/plane_strain.wfl", &data["elasticity_plane_strain"], "vector Q2"),
        ] {
            let what = format!("{name}, {element}");
            let kind = fem.split(' ').next().unwrap_or_default();
            let old_shape = if path.starts_with("poisson") { "[n,n] tri" } else { "[n,n] quad" };
            let edits = [(old_shape, format!("[n,n] {shape}")), (fem, format!("{kind} {element}"))];
            let rows = rows(&table["table_n_L2_H1semi"][element]);
            cases.push(or_failed(&what, table_case(&what, path, &edits, &rows, Some(degree))));
        }
    }
    for (element, shape, _) in PLANE {
        cases.push(shear(element, shape, 1.5, &data["neo_hookean_shear"]["results"]));
        cases.push(shear(element, shape, 1e4, &data["neo_hookean_shear"]["results"]));
    }
    for element in ["Q1", "Q2"] {
        cases.push(or_failed(
            "interface",
            interface(element, &rows(&data["interface_jump"]["table_n_L2_H1semi"][element])),
        ));
    }
    cases
}

/// Errors against a table of n, L2, H1; the order of the last two meshes where the degree is given.
fn table_case(
    what: &str,
    path: &str,
    edits: &[(&str, String)],
    rows: &[Vec<f64>],
    degree: Option<f64>,
) -> Result<Case, String> {
    let mut case = Case::new(what);
    let mut found = Vec::new();
    for row in rows {
        let solved = example(path, edits, &[("n", row[0])])?;
        let errors = [solved.measure(0, "l2").sqrt(), solved.measure(0, "h1").sqrt()];
        for (k, name) in ["L2", "H1"].into_iter().enumerate() {
            let label = format!("n = {}, {name} error", row[0]);
            case = case.compare(label, errors[k], row[k + 1], Tolerance::Relative(1e-5));
        }
        found.push((row[0], errors));
    }
    if let (Some(degree), [.., (n, coarse), (m, fine)]) = (degree, found.as_slice()) {
        case = case
            .compare("order in L2", order(*n, coarse[0], *m, fine[0]), degree + 1.0, Tolerance::Absolute(0.1))
            .compare("order in H1", order(*n, coarse[1], *m, fine[1]), degree, Tolerance::Absolute(0.1));
    }
    Ok(case)
}

/// Neo-Hookean shear: a table for linear elements, exact for quadratic ones up to rounding times lambda/mu.
fn shear(element: &str, shape: &str, lambda: f64, results: &serde_json::Value) -> Case {
    let what = format!("neo-Hookean shear, {element}, lambda/mu = {lambda}");
    let rows = rows(&results[format!("neo_lam{lambda}_{element}")]);
    let made = || {
        let edits = [
            ("[n,n] tri", format!("[n,n] {shape}")),
            ("vector P2", format!("vector {element}")),
            ("measure error = max(Norm(u - exact)) on all", MEASURES.to_owned()),
            ("expect error < 1e-12", String::new()),
        ];
        let mut case = Case::new(&what);
        for row in &rows {
            let solved = example("hyperelastic/shear.wfl", &edits, &[("n", row[0]), ("lambda", lambda)])?;
            for (k, name) in ["l2", "h1"].into_iter().enumerate() {
                let label = format!("n = {}, {} error", row[0], name.to_uppercase());
                let got = solved.measure(0, name).sqrt();
                case = if element.ends_with('1') {
                    case.compare(label, got, row[k + 1], Tolerance::Relative(1e-5))
                } else {
                    case.compare(label, got, 1e-13 * row[0] * lambda, Tolerance::AtMost)
                };
            }
        }
        Ok(case)
    };
    or_failed(&what, made())
}

const MEASURES: &str = "measure l2 = integral(Norm_sqr(u - exact)) on all
measure h1 = integral(Norm_sqr(Grad_u - Grad(exact))) on all
quadrature on all degree 6
quadrature on sides degree 6";

fn interface(element: &str, rows: &[Vec<f64>]) -> Result<Case, String> {
    let mut case = Case::new(format!("interface law with a jump, {element}"));
    let edits = [
        ("vector Q2", format!("vector {element}")),
        ("measure errorL = max(Norm(uL - exactL)) on left", MEASURES_SIDES.to_owned()),
        ("measure errorR = max(Norm(uR - exactR)) on right", String::new()),
        ("expect errorL < 1e-12 and errorR < 1e-12", String::new()),
    ];
    for row in rows {
        let solved = example("interface/spring.wfl", &edits, &[("n", row[0])])?;
        for (k, name) in ["l2", "h1"].into_iter().enumerate() {
            let label = format!("n = {}, {} error", row[0], name.to_uppercase());
            let got = (solved.measure(0, &format!("{name}L")) + solved.measure(0, &format!("{name}R"))).sqrt();
            case = if element == "Q1" {
                case.compare(label, got, row[k + 1], Tolerance::Relative(1e-5))
            } else {
                case.compare(label, got, 1e-12, Tolerance::AtMost)
            };
        }
    }
    Ok(case)
}

const MEASURES_SIDES: &str = "measure l2L = integral(Norm_sqr(uL - exactL)) on left
measure h1L = integral(Norm_sqr(Grad_uL - Grad(exactL))) on left
measure l2R = integral(Norm_sqr(uR - exactR)) on right
measure h1R = integral(Norm_sqr(Grad_uR - Grad(exactR))) on right
quadrature on left degree 6
quadrature on right degree 6
quadrature on joint degree 6";

/// A smooth displacement of a cube; the force is -div sigma of it, written out by hand.
const SOLID: &str = "wfl 1
param E = 1
param nu = 0.3
param n = 4
mesh box [0,0,0] to [1,1,1] cells [n,n,n] SHAPE
unknown u : vector ELEMENT
def lambda   = E*nu/((1+nu)*(1-2*nu))
def mu       = E/(2*(1+nu))
def sigma(v) = lambda*Div_v*Id(3) + 2*mu*Sym(Grad_v)
# harmonic in the plane of each component: the Laplacian of u is 0, its divergence -> grad div below
def exact = [exp(x)*sin(y), exp(y)*sin(z), exp(z)*sin(x)]
def slope = [exp(x)*sin(y), exp(x)*cos(y), 0; 0, exp(y)*sin(z), exp(y)*cos(z); exp(z)*cos(x), 0, exp(z)*sin(x)]
# div u = exp(x) sin(y) + exp(y) sin(z) + exp(z) sin(x)
def gd = [exp(x)*sin(y) + exp(z)*cos(x), exp(x)*cos(y) + exp(y)*sin(z), exp(y)*cos(z) + exp(z)*sin(x)]
term elastic on all : sigma(u):Grad_Test_u
load u = -(lambda + mu)*gd on all
fix u = exact on boundary
quadrature on all degree 7
measure l2 = integral(Norm_sqr(u - exact)) on all
measure h1 = integral(Norm_sqr(Grad_u - slope)) on all
";

fn solid() -> Vec<Case> {
    let runs = [
        ("P1", "tet", [6.0, 12.0], 1.0),
        ("P2", "tet", [4.0, 8.0], 2.0),
        ("Q1", "hex", [6.0, 12.0], 1.0),
        ("Q2", "hex", [4.0, 8.0], 2.0),
    ];
    let mut cases = Vec::new();
    for (element, shape, [n, m], degree) in runs {
        let what = format!("{element} on {shape}, n = {n} and {m}");
        let text = SOLID.replace("SHAPE", shape).replace("ELEMENT", element);
        let made = || {
            let (coarse, fine) = (scene(&text, &[("n", n)])?, scene(&text, &[("n", m)])?);
            let of = |name| order(n, coarse.measure(0, name).sqrt(), m, fine.measure(0, name).sqrt());
            Ok(Case::new(&what).compare("order in L2", of("l2"), degree + 1.0, Tolerance::Absolute(0.1)).compare(
                "order in H1",
                of("h1"),
                degree,
                Tolerance::Absolute(0.1),
            ))
        };
        cases.push(or_failed(&what, made()));
    }
    cases
}
