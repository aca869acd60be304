//! Bodies of hexahedra, wedges, pyramids and tetrahedra: what passes on every kind of cell passes where they meet.
//!
//! The references are closed forms: a linear displacement under the tractions of its constant stress, through the bodies
//! and through contact between faces of both kinds.

use std::path::Path;

use wfl_mesh::mesh::CellKind;
use wfl_tests::{MeshFolder, Solved, solve};

/// Displacements and stresses are met to this part of the largest.
const EXACT: f64 = 1e-12;

/// A cube of side 2 of all four kinds of cells with inner nodes moved, and the same of second order with bent edges.
const SOLIDS: &str = include_str!("../../runtime/mesh/src/mesh/read/data/solids_41a.msh");
const CURVED: &str = include_str!("../../runtime/mesh/src/mesh/read/data/solids2_22a.msh");

const LAW: &str = "def A = [-0.05,0.012,0.02;-0.008,0.015,0.01;0.013,-0.011,0.02]\ndef exact = A*[x,y,z]\n\
    def law(e) = 120*Trace(e)*Id(3) + 160*Sym(e)\n";

fn solved(name: &str, mesh: &str, scene: &str) -> Solved {
    let folder = MeshFolder::new(&format!("solids-{name}"), mesh);
    let text = format!("mesh file \"body.msh\"\n{scene}");
    let solved = solve(folder.path(), text, &[], &[]).unwrap_or_else(|e| panic!("{name}: {e}"));
    assert!(solved.outcome.converged(), "{name}");
    solved
}

fn is_exact(what: &str, solved: &Solved, measures: &[(&str, f64)]) {
    for (name, scale) in measures {
        let error = solved.measure(0, name) / scale;
        assert!(error < EXACT, "{what}: {name} wrong by {error:e}");
    }
}

fn meshes() -> [(&'static str, &'static str, &'static str); 4] {
    // of second order the map must be in the space; both letters mean the same where faces are of two kinds
    [("P1", "p1", SOLIDS), ("Q1", "q1", SOLIDS), ("P2", "p2", SOLIDS), ("Q2", "curved", CURVED)]
}

#[test]
fn a_constant_stress_passes_where_all_kinds_of_cells_meet() {
    for (element, name, mesh) in meshes() {
        let scene = format!(
            "{LAW}unknown u : vector {element}\nregion clamp = faces where x == 0\nregion rest = boundary - clamp\n\
             term body on all : law(Grad_u):Grad_Test_u\nload u = law(A)*Normal on rest\nfix u = exact on clamp\n\
             measure displacement = max(Norm(u - exact)) on all\nmeasure stress = max(Norm(law(Grad_u) - law(A))) on all\n"
        );
        is_exact(
            element,
            &solved(&format!("stress-{name}"), mesh, &scene),
            &[("displacement", 0.05), ("stress", 15.0)],
        );
    }
}

#[test]
fn integrals_of_polynomials_agree_over_cells_and_faces_of_every_kind() {
    for (element, name, mesh) in meshes() {
        let scene = format!(
            "unknown u : vector {element}\nterm body on all : u.Test_u\nload u = [x,y,z] on all\n\
             measure volume = integral(1) on all\nmeasure outside = integral(1/3*([x,y,z].Normal)) on boundary\n\
             measure inner = integral(x + y + z) on all\nmeasure outer = integral([x*y,y*z,z*x].Normal) on boundary\n\
             measure mean_u = integral(u(1)) on all\nmeasure mean_x = integral(x) on all\n"
        );
        let solved = solved(&format!("measures-{name}"), mesh, &scene);
        for (a, b) in [("volume", "outside"), ("inner", "outer"), ("mean_u", "mean_x")] {
            let [p, q] = [a, b].map(|m| solved.measure(0, m));
            assert!((p - q).abs() < EXACT * q, "{element}: {a} {p}, {b} {q}");
        }
    }
}

/// Two blocks of wedges beside the plane x = 0, moved by `place`. Along x the faces there are triangles, along z
/// quadrilaterals.
fn wedges(along: usize, place: impl Fn([f64; 3]) -> [f64; 3]) -> String {
    let n = [4, 2, 2];
    let number = |p: [usize; 3]| 1 + p[0] + (n[0] + 1) * (p[1] + (n[1] + 1) * p[2]);
    let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", (n[0] + 1) * (n[1] + 1) * (n[2] + 1));
    for (z, y, x) in (0..=n[2]).flat_map(|z| (0..=n[1]).flat_map(move |y| (0..=n[0]).map(move |x| (z, y, x)))) {
        let [a, b, c] = place([-1.0 + 0.5 * x as f64, 0.5 * y as f64, 0.5 * z as f64]);
        text += &format!("{} {a:?} {b:?} {c:?}\n", number([x, y, z]));
    }
    text += &format!("$EndNodes\n$Elements\n{}\n", 2 * n[0] * n[1] * n[2]);
    let (u, v) = ((along + 1) % 3, (along + 2) % 3);
    let mut count = 0;
    for cube in 0..n[0] * n[1] * n[2] {
        let corner = [cube % n[0], cube / n[0] % n[1], cube / (n[0] * n[1])];
        for triangle in [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]] {
            count += 1;
            text += &format!("{count} 6 2 1 1");
            for end in [0, 1] {
                for at in triangle {
                    let mut p = corner;
                    p[along] += end;
                    p[u] += at[0];
                    p[v] += at[1];
                    text += &format!(" {}", number(p));
                }
            }
            text += "\n";
        }
    }
    text + "$EndElements\n"
}

/// Two bodies, of which the second is held by contact alone; `behind` is how far it lies behind the closed form.
fn pressed(clamp: &str, left: &str, contact: &str, behind: &str) -> String {
    format!(
        "{LAW}param gamma = 1000\nregion left = cells where {left}\nregion right = all - left\n\
         region fault = interface from left to right\nregion clamp = faces where {clamp}\nregion rest = boundary - clamp\n\
         unknown uL : vector on left\nunknown uR : vector on right\n\
         def jump(a,b) = a - Interpolate(b, neighbor_element)\ndef tang(v) = v - (v.Normal)*Normal\n\
         def trac(v) = law(Grad_v)*Normal\n\
         term bodyL on left : law(Grad_uL):Grad_Test_uL\nterm bodyR on right : law(Grad_uR):Grad_Test_uR\n\
         {contact}load uL, uR = law(A)*Normal on rest\nfix uL = exact on clamp\nsolver newton with tol=1e-15\n\
         measure displacement = max(Norm(uL - exact)) on left\n\
         measure there = max(Norm(uR - (exact + {behind}))) on right\n\
         measure stress = max(Norm(law(Grad_uR) - law(A))) on right\n"
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

const OF_CONTACT: [(&str, f64); 3] = [("displacement", 0.05), ("there", 0.05), ("stress", 15.0)];

#[test]
fn a_constant_pressure_passes_through_triangles_and_quadrilaterals_of_wedges() {
    // the plane of contact stays, its faces are no parallelograms
    let flat = |[x, y, z]: [f64; 3]| {
        let bend = (3.0 * y + 4.0 * z).sin() * (1.0 - x.abs());
        [x * (1.0 + 0.1 * bend), y + 0.1 * (4.0 * y + 5.0 * z).sin(), z + 0.1 * (3.0 * y - 4.0 * z).sin()]
    };
    for (along, faces) in [(0, "triangles"), (2, "quadrilaterals")] {
        for (name, contact, behind) in [
            ("penalty", PENALTY.to_owned(), "1/gamma*(law(A)*[1,0,0])"),
            ("Nitsche", NITSCHE.replace("theta", "(-1)"), "[0,0,0]"),
        ] {
            let what = format!("{name}-{faces}");
            let found = solved(&what, &wedges(along, flat), &pressed("x == -1", "x < 0", &contact, behind));
            is_exact(&what, &found, &OF_CONTACT);
        }
    }
}

/// The faces are those of pyramids and tetrahedra around the centres of cubes: a nodal rule has points at their apexes.
#[test]
fn a_constant_pressure_passes_through_the_triangles_of_pyramids() {
    for theta in ["(-1)", "0", "1"] {
        let contact = NITSCHE.replace("theta", theta);
        // the faces are oblique: so strong a pressure that none of them slides or opens
        let scene = pressed("x == 0", "x < 1.3", &contact, "[0,0,0]")
            .replace("[-0.05,", "[-0.3,")
            .replace("gamma = 1000", "gamma = 1e4");
        let found = solved(&format!("pyramids{theta}"), SOLIDS, &scene);
        let mesh = &found.scene.system.mesh;
        let on_fault = |t: &wfl_discrete::assemble::AssembledTerm| t.law.name == "contact";
        let terms = found.scene.system.terms.iter().filter(|t| on_fault(t));
        let facets = terms.flat_map(|t| &t.integrator.domain.groups).flat_map(|g| &g.here.facets);
        let pyramids = facets.filter(|f| mesh.kind(f.cell) == CellKind::Pyramid).count();
        assert!(pyramids > 0, "no face of a pyramid");
        is_exact(theta, &found, &OF_CONTACT.map(|(name, scale)| (name, 6.0 * scale)));
    }
}

#[test]
fn what_cannot_be_done_with_these_cells_is_told() {
    let refused = |mesh: &str, scene: &str, words: &[&str]| {
        let folder = MeshFolder::new("solids-refused", mesh);
        let text = format!("mesh file \"body.msh\"\n{scene}");
        let told = match solve(folder.path(), text, &[], &[]) {
            Ok(_) => panic!("it was solved: {scene}"),
            Err(told) => told.to_string(),
        };
        for word in words {
            assert!(told.contains(word), "{word} is not in {told}");
        }
    };
    let rest = "unknown u : scalar\nterm flow on all : Grad_u.Grad_Test_u + u*Test_u\nload u = 1 on all\n";
    let words = ["E409", "is a wedge, and wedges are not divided", "Mesh.MeshSizeFactor", "refine on part"];
    refused(&wedges(0, |x| x), &format!("region part = cells where x < 0\nrefine on part\n{rest}"), &words);
    let cubic = rest.replace("scalar", "scalar P3");
    refused(SOLIDS, &cubic, &["E406", "no Lagrange element of degree 3 on a pyramid, the highest is 2"]);
    let third = SOLIDS.replace("3 1 7 15\n", "3 1 118 15\n");
    refused(&third, rest, &["pyramid of higher order (Gmsh type 118)", "`Mesh.ElementOrder = 2`"]);
}

/// A polynomial of degree 4 solves Poisson's equation exactly in the spaces of degree 4, on every kind of cell that has them,
/// with tractions on a face, and from degree 3 it is approached as h^4.
#[test]
fn degree_four_has_its_polynomials() {
    let of = |mesh: &str, space: &str, dim: usize| {
        // Laplacian of x^4 - 3 x^2 y^2 + y^3 z - x z^3 in space, and without z
        let (exact, load) = match dim {
            2 => ("x^4 - 3*x^2*y^2 + 2*y^3", "-(12*x^2 - 6*y^2 - 6*x^2 + 12*y)"),
            _ => ("x^4 - 3*x^2*y^2 + y^3*z - x*z^3", "-(12*x^2 - 6*y^2 - 6*x^2 + 6*y*z - 6*x*z)"),
        };
        format!(
            "{mesh}\nregion free = faces where x == 1\nregion held = boundary - free\ndef exact = {exact}\n\
             unknown u : scalar {space}\nterm flow on all : Grad_u.Grad_Test_u\n\
             load u = {load} on all\nload u = 4*x^3 - 6*x*y^2{} on free\nfix u = exact on held\n\
             measure apart = max(abs(u - exact)) on all\n",
            if dim == 2 { "" } else { " - z^3" }
        )
    };
    for (mesh, space, dim) in [
        ("mesh box [0,0] to [1,1] cells [3,2] tri", "P4", 2),
        ("mesh box [0,0] to [1,1] cells [3,2] quad", "Q4", 2),
        ("mesh box [0,0,0] to [1,1,1] cells [2,2,2] tet", "P4", 3),
        ("mesh box [0,0,0] to [1,1,1] cells [2,1,2] hex", "Q4", 3),
    ] {
        let run = |space: &str| {
            let solved =
                solve(Path::new("."), of(mesh, space, dim), &[], &[]).unwrap_or_else(|e| panic!("{mesh}: {e}"));
            solved.measure(0, "apart")
        };
        let (four, three) = (run(space), run(&space.replace('4', "3")));
        assert!(four < EXACT, "{mesh}: {four:e}");
        assert!(three > 1e-4, "{mesh}: {three:e}");
    }
}

/// Laws of finite strain, whose stresses cancel beside 1 where strains are small: F - F^-T, F'F - Id.
const CANCEL: [&str; 2] = [
    "(mu*(F - Inv(F)') + la*log(Det(F))*Inv(F)'):Grad_Test_u",
    "(F*(0.5*la*Trace(F'*F - Id(2))*Id(2) + mu*(F'*F - Id(2)))):Grad_Test_u",
];

/// Loads far below the moduli, where the strain has fewer digits than the tolerance asks for: a run ends at what rounding
/// leaves, with the displacement of linear elasticity to the digits that it tells.
#[test]
fn small_strains_of_laws_of_finite_strain_have_the_digits_that_are_told() {
    let solved = |law: &str, load: f64, stiff: f64| {
        let text = format!(
            "mesh box [0,0] to [2,1] cells [8,4] quad\nregion left = faces where x == 0\nregion right = faces where x == 2\n\
             param mu = 0.4\nparam la = 0.6\nunknown u : vector Q2\ndef F = Id(2) + Grad_u\ndef k = if x < 1 then {stiff:?} else 1\n\
             def e(v) = Sym(Grad_v)\ndef linear = (la*Trace(e(u))*Id(2) + 2*mu*e(u)):Grad_Test_u\n\
             term body on all : k*({law})\nfix u = [0,0] on left\nload u = [{load:?}, {:?}] on right\n\
             measure sag = mean(u(2)) on right\n",
            0.3 * load
        );
        solve(Path::new("."), text, &[], &[]).unwrap_or_else(|e| panic!("{law} {load} {stiff}: {e}"))
    };
    for law in CANCEL {
        for stiff in [1.0, 1e3, 1e6] {
            // rounding of the stiffest part leaves 1e-16 of it
            for load in [1e-4, 1e-6, 1e-8, 1e-10].into_iter().filter(|load| 1e-16 * stiff < 1e-3 * load) {
                let found = solved(law, load, stiff);
                assert!(found.outcome.converged(), "{law} {load} {stiff}");
                let step = &found.outcome.steps[0];
                assert!(step.iterations() < 20, "{law} {load} {stiff}: {} iterations", step.iterations());
                let exact = solved("linear", load, stiff).measure(0, "sag");
                let apart = (found.measure(0, "sag") - exact).abs() / exact.abs();
                // beside the digits the law differs from linear elasticity by about the strain
                let digits = step.accuracy.as_ref().map_or(0.0, wfl_checks::Accuracy::digits);
                let bound = 10f64.powf(-digits) * 10.0 + 100.0 * load;
                assert!(apart <= bound, "{law} {load} {stiff}: {apart:e} apart, {digits} digits told");
            }
        }
    }
}
