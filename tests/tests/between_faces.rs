//! `interior of` a surface: edges and points between two of its faces, with the values of both. References: the divergence
//! theorem for fields that jump from face to face, closed forms, scikit-fem.

use std::path::Path;

use wfl_run::Outcome;
use wfl_tests::{
    ranks::{self, Holding, Shared},
    reference, refused, solved,
};

/// What is polynomial comes out to this.
const EXACT: f64 = 1e-12;

/// A sheet of plane faces that no axis keeps, some of them folded; and where it was before the map.
const SHEETS: [(&str, &str, &str); 6] = [
    ("box [-1,0] to [1,1] cells [4,5] tri map [x + 0.3*y, y - 0.2*x]", "DP1", "x - 0.3*y"),
    ("box [-1,0] to [1,1] cells [4,5] quad map [x + 0.3*y, y - 0.2*x]", "DQ1", "x - 0.3*y"),
    ("box [-1,0] to [1,1] cells [4,5] tri map [x + 0.5*abs(y - 0.4), y]", "DP2", "x - 0.5*abs(y - 0.4)"),
    (
        "box [-1,0,0] to [1,1,1] cells [4,3,2] tet map [x + 0.3*y - 0.1*z, y - 0.2*x + 0.1*z, z + 0.2*x - 0.3*y]",
        "DP1",
        "1.03*x - 0.27*y + 0.13*z",
    ),
    (
        "box [-1,0,0] to [1,1,1] cells [4,3,2] hex map [x + 0.3*y - 0.1*z, y - 0.2*x + 0.1*z, z + 0.2*x - 0.3*y]",
        "DQ1",
        "1.03*x - 0.27*y + 0.13*z",
    ),
    (
        "box [-1,0,0] to [1,1,1] cells [4,3,2] tet map [x + 0.4*abs(y - 1/3) + 0.3*z, y, z]",
        "DP2",
        "x - 0.4*abs(y - 1/3) - 0.3*z",
    ),
];

/// The sheet between two bodies, its rim and what lies between its faces.
fn sheet(mesh: &str, across: &str) -> String {
    format!(
        "mesh {mesh}\nregion left = cells where {across} < 0\nregion right = all - left\n\
         region fault = interface from left to right\nregion edge = rim of fault\nregion inner = interior of fault\n"
    )
}

/// Over the faces of a sheet the gradient of what jumps from face to face adds up to what leaves through the rim and
/// through both sides of the edges between.
#[test]
fn what_jumps_between_faces_keeps_the_divergence_theorem() {
    for (mesh, element, across) in SHEETS {
        let dim = if mesh.contains(",0,0]") { 3 } else { 2 };
        let c = if dim == 3 { "[0.7,-1.3,0.4]" } else { "[0.7,-1.3]" };
        let found = solved(format!(
            "{}unknown p : scalar {element} on fault\nterm value on fault : (p - exp(2*x + y*y - sin(5*y)))*Test_p\n\
             def other(v) = Interpolate(v, neighbor_element)\n\
             measure inside = integral(Grad_p.{c}) on fault\n\
             measure rim = integral(p*({c}.Conormal)) on edge\n\
             measure between = integral(p*({c}.Conormal) + other(p)*({c}.other(Conormal))) on inner\n\
             measure jumps = integral(sqr(p - other(p))) on inner\n\
             measure fold = max(Norm(other(Normal) - Normal)) on inner\n\
             measure unit = max(abs(Norm(other(Conormal)) - 1) + abs(other(Conormal).other(Normal))) on inner\n",
            sheet(mesh, across)
        ));
        let of = |name: &str| found.measure(0, name);
        let error = of("rim") + of("between") - of("inside");
        assert!(of("inside").abs() > 0.01 && of("jumps") > 1e-4, "{mesh}: {} {}", of("inside"), of("jumps"));
        assert!(error.abs() < EXACT && of("unit") < EXACT, "{mesh} {element}: {error:e}, {:e}", of("unit"));
        let folded = mesh.contains("abs(y");
        assert_eq!(of("fold") > 0.1, folded, "{mesh}: a fold turns the normal");
    }
}

/// A flux between the middles of neighbouring faces has a linear pressure to rounding on uniform faces.
#[test]
fn a_flux_between_two_points_keeps_linear_pressures() {
    for (mesh, across, slope, h) in [
        ("box [-1,0] to [1,1] cells [4,5] quad map [x + 0.3*y, y]", "x - 0.3*y", "[0.6,2]", "element_size"),
        ("box [-1,0,0] to [1,1,1] cells [2,4,4] hex map [x + 0.3*y, y, z]", "x - 0.3*y", "[0.6,2,-1]", "h"),
    ] {
        let dim = if mesh.contains(",0,0]") { 3 } else { 2 };
        let position = if dim == 3 { "[x,y,z]" } else { "[x,y]" };
        // in space the faces are rectangles; along the sheet one side is sqrt(1.09) of the other
        let h = if h == "h" {
            "(0.25*Norm([0.3*Conormal(2),Conormal(2),Conormal(3)])*(if abs(Conormal(3)) > 0.5 then 1 else sqrt(1.09)/Norm([0.3*Conormal(2),Conormal(2)])))"
        } else {
            h
        };
        let found = solved(format!(
            "{}def exact = 1 + {slope}.{position}\ndef other(v) = Interpolate(v, neighbor_element)\n\
             unknown p : scalar DP0 on fault\nunknown mean : scalar DP0 on fault\n\
             term mean on fault : (mean - exact)*Test_mean\n\
             term flow on inner : 3/{h}*(p - other(p))*(Test_p - other(Test_p))\n\
             term ends on edge : 6/{h}*(p - exact)*Test_p\n\
             measure error = max(abs(p - mean)) on fault\nmeasure size = max({h}) on inner\n",
            sheet(mesh, across)
        ));
        assert!(found.measure(0, "error") < 10.0 * EXACT, "{mesh}: {:e}", found.measure(0, "error"));
    }
}

/// Continuous and constant parts together: each face has its own balance, also where the conductivity jumps.
#[test]
fn enriched_pressures_conserve_on_every_face() {
    let found = solved(
        "mesh box [-1,0] to [1,1] cells [2,8] quad\nregion left = cells where x < 0\nregion right = all - left\n\
         region fault = interface from left to right\nregion inner = interior of fault\n\
         region bottom = rim of fault where y == 0\nregion top = rim of fault where y == 1\n\
         unknown pc : scalar Q1 on fault\nunknown pd : scalar DP0 on fault\n\
         def C = if y < 0.5 then 1 else 1000\ndef other(v) = Interpolate(v, neighbor_element)\n\
         unknown k : scalar DP0 on fault\nterm k on fault : (k - C)*Test_k\nstart k = C\n\
         # the flux from face to face: a harmonic mean of the conductivities weighs the sides\n\
         def mine = other(k)/(k + other(k))\n\
         def flux = -mine*k*(Grad_pc.Conormal) - (1 - mine)*other(k)*(other(Grad_pc).Conormal) \
                    + 4*(2*k*other(k)/(k + other(k)))/element_size*(pd - other(pd))\n\
         term flow on fault : C*Grad_pc.Grad_Test_pc\n\
         term between on inner : flux*(Test_pd - other(Test_pd)) \
                    - (mine*k*(Grad_Test_pc.Conormal) + (1 - mine)*other(k)*(other(Grad_Test_pc).Conormal))*(pd - other(pd))\n\
         fix pc = 2 on bottom\nfix pc = 1 on top\n\
         term below on bottom : (-C*(Grad_pc.Conormal) + 4*C/element_size*pd)*Test_pd - C*(Grad_Test_pc.Conormal)*pd\n\
         term above on top : (-C*(Grad_pc.Conormal) + 4*C/element_size*pd)*Test_pd - C*(Grad_Test_pc.Conormal)*pd\n\
         measure error = max(abs(pc + pd - (if y < 0.5 then 2 - y/0.5005 else 1 + (1 - y)/500.5))) on fault\n\
         measure most = max(abs(flux)) on inner\nmeasure least = min(abs(flux)) on inner\n",
    );
    let of = |name: &str| found.measure(0, name);
    let flux = 1.0 / 0.5005;
    assert!(of("error") < EXACT, "{:e}", of("error"));
    assert!((of("most") / flux - 1.0).abs() < 1e-11 && (of("least") / flux - 1.0).abs() < 1e-11);
}

/// The closed crack of scikit-fem with one traction a face beside linear displacements: with the jumps between faces in the
/// equations it has one solution, without the pattern of tractions that alternate.
const CRACK: &str = "mesh box [-4,-4] to [4,4] cells [32,32] tri\nparam nu = 0.25\nregion below = cells where y < 0\n\
    region above = cells where y > 0\n\
    region crack = interface from below to above & faces of below where y == 0 and abs(x) < 1.0001\n\
    region inner = interior of crack\nregion floor = faces where y == -4\nregion top = faces where y == 4\n\
    unknown u : vector P1\nsplit u across crack\nmultiplier l : scalar DP0 on crack\n\
    def sigma(v, E) = E/(1+nu)*(Sym(Grad_v) + nu/(1-2*nu)*Div_v*Id(2))\n\
    def other(v) = Interpolate(v, neighbor_element)\n\
    term lower on below : sigma(u, 1):Grad_Test_u\nterm upper on above : sigma(u, 5):Grad_Test_u\n\
    term couple on crack : l*((Test_u - other(Test_u)).Normal) + ((u - other(u)).Normal)*Test_l\n\
    load u = [1, -1 - 0.5*x] on top\nfix u = [0,0] on floor\n";

#[test]
fn jumps_of_tractions_take_out_the_checkerboard() {
    let all = reference("traction_jump.json");
    let row = &all["rows"]["P1/P0+jump 4"];
    let found = solved(format!(
        "{CRACK}term smooth on inner : -sqr(element_size)*(l - other(l))*(Test_l - other(Test_l))\n\
         measure traction = integral(l) on crack\n"
    ));
    let numbers = |name: &str| -> Vec<f64> {
        row[name].as_array().expect("numbers").iter().map(|x| x.as_f64().expect("a number")).collect()
    };
    for (k, should) in numbers("l").into_iter().enumerate() {
        let x = -1.0 + 0.25 * (k as f64 + 0.5);
        let is = found.at(0, "l", [x, 0.0, 0.0])[0];
        assert!((is - should).abs() < 1e-9, "l at {x}: {is}, {should}");
    }
    // the slip at the nodes of the crack, once from each side
    let mean: f64 = numbers("l").iter().sum::<f64>() * 0.25;
    assert!((found.measure(0, "traction") - mean).abs() < 1e-9);
    let told = refused_run(&format!("{CRACK}term smooth on inner : 0*(l - other(l))*Test_l\n"));
    assert!(told.contains("`l` is not unique"), "{told}");
}

/// What a run that fails says.
fn refused_run(text: &str) -> String {
    match wfl_tests::solve(Path::new("."), text.to_owned(), &[], &[]) {
        Ok(_) => "it was solved".to_owned(),
        Err(told) => told,
    }
}

/// A sheet with a two-point flux on ranks, whole meshes and parts: the numbers are those of one.
#[test]
fn ranks_have_the_same_numbers() {
    let text = "use \"poro\"\nmesh box [-1,-1,-1] to [1,1,1] cells [5,5,2] hex\nregion below = cells where z < 0\n\
        region above = cells where z > 0\nregion fault = interface from below to above\n\
        region inner = interior of fault\nregion east = rim of fault where x == 1\nunknown p : scalar Q1\n\
        unknown pf : scalar DP0 on fault\nsplit p across fault\ndef other(v) = Interpolate(v, neighbor_element)\n\
        term rock on all : darcy(p, 0.3)\nterm leak on fault : leakoff(pf, p, 5)\n\
        term flow on inner : 5*(1 + sqr(pf + other(pf)))*(pf - other(pf))*(Test_pf - other(Test_pf))\n\
        term feed on fault : -exp(x + y)*Test_pf\nterm drain on east : 4*pf*Test_pf\n\
        region floor = faces where z == -1\nfix p = 0 on floor\nbalance water of p, pf\n\
        measure jumps = integral(sqr(pf - other(pf))) on inner\nmeasure length = integral(1) on inner\n\
        measure floor = reaction(p) on floor\nmeasure size = max(element_size) on inner\n";
    let scene = Shared::text(Path::new("."), text.to_owned(), &[]);
    let measures = |outcome: &Outcome| outcome.steps[0].measures.clone();
    let alone = measures(&ranks::solved(scene.whole()));
    let of = |name: &str| alone.iter().find(|m| m.0 == name).expect("a measure").1;
    assert!(of("jumps") > 1e-3 && (of("length") - 16.0).abs() < EXACT, "{} {}", of("jumps"), of("length"));
    assert!((of("size") - 0.4 * f64::sqrt(2.0)).abs() < EXACT, "the size of the faces: {}", of("size"));
    assert!(of("water_lost").abs() < 1e-10 && of("floor") > 0.1, "{} {}", of("water_lost"), of("floor"));
    for holding in [Holding::Whole, Holding::Parts] {
        for of_rank in scene.on_ranks(3, holding, |part| measures(&ranks::solved(part))) {
            for ((name, is), (_, should)) in of_rank.iter().zip(&alone) {
                assert!((is - should).abs() < 1e-10, "{holding:?} {name}: {is}, {should}");
            }
        }
    }
}

/// Where three faces meet is no edge between two; a face that a region has from both of its cells is one face; and what
/// has no meaning between faces is told.
#[test]
fn edges_between_faces_are_told_from_others() {
    let cross = "mesh box [-1,-1] to [1,1] cells [8,8] quad\nregion ne = cells where x > 0 and y > 0\n\
        region nw = cells where x < 0 and y > 0\nregion south = cells where y < 0\n\
        region a = interface from south to nw\nregion b = interface from south to ne\n\
        region c = interface from nw to ne\nregion faults = a + b + c\n";
    let found = solved(format!(
        "{cross}region inner = interior of faults\nregion joints = crossings of faults\nregion both = faces of ne where y == 0\n\
         region double = both + faces of south where y == 0 and x > -0.01\nregion ends = interior of double\n\
         unknown p : scalar on faults\nterm p on faults : (p - 1)*Test_p\nmeasure n = integral(1) on inner\n\
         measure m = integral(1) on ends\n"
    ));
    assert!((found.measure(0, "n") - 9.0).abs() < EXACT, "{}", found.measure(0, "n"));
    assert!((found.measure(0, "m") - 3.0).abs() < EXACT, "{}", found.measure(0, "m"));
    let scene = |lines: &str| {
        format!(
            "mesh box [0,0,-1] to [1,1,1] cells [4,4,2] hex\nregion below = cells where z < 0\n\
             region sheet = faces of below where z == 0\nregion inner = interior of sheet\n\
             unknown p : scalar on sheet\nunknown d : scalar DP0 on sheet\n\
             term flow on sheet : Grad_p.Grad_Test_p + p*Test_p + d*Test_d\n{lines}\n"
        )
    };
    for (lines, code, says) in [
        ("load p = 1 on inner", "E405", "a load has one side"),
        (
            "region corner = faces of sheet where x < 0.3 and y < 0.3\nregion none = interior of corner",
            "E402",
            "between two faces",
        ),
        ("term t on sheet : Conormal(1)*Test_p", "E204", "interior of"),
        (
            "region rim = rim of sheet\nterm t on rim : Interpolate(d, neighbor_element)*Test_d",
            "E203",
            "interior of fault",
        ),
        ("unknown r : scalar on inner\nterm t on inner : r*Test_r", "E405", "cells or faces"),
        ("region middle = interior of below", "E405", "faces are needed"),
    ] {
        let told = refused(&scene(lines));
        assert!(told.contains(code) && told.contains(says), "{lines}: {told}");
    }
    let jump = |f: &str| format!("term t on inner : ({f} - Interpolate({f}, neighbor_element))*Test_{f}");
    let attempt = |lines: &str| wfl_tests::attempt(Path::new("."), scene(lines), &[], &[]);
    let told = attempt(&jump("p"));
    assert!(told.messages.contains("W417") && told.messages.contains("DP0"), "{}", told.messages);
    let told = attempt(&jump("d"));
    assert!(told.solved.is_some() && !told.messages.contains("W417"), "{}", told.messages);
}
