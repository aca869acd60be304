//! Fields that live on faces: their gradient along the face against closed forms and numbers of another program.
//!
//! References: tests/reference/fracture_flow.json (scikit-fem, and closed forms) and the eigenfunctions of the
//! Laplace-Beltrami operator on circle, cylinder and sphere.

use wfl_discrete::assemble::FieldValues;
use wfl_output::Array;
use wfl_tests::{MeshFolder, Solved, examples, reference, refused, solve, solved};

/// What is polynomial comes out to this.
const EXACT: f64 = 1e-12;

/// Cells of each kind, the box, elements of the first and second degree, and a plane x = 0 that no axis of the map keeps.
const SHAPES: [(&str, &str, &str); 8] = [
    ("box [-1,0] to [1,1] cells [4,4] tri", "P1", "2"),
    ("box [-1,0] to [1,1] cells [4,4] tri", "P2", "2"),
    ("box [-1,0] to [1,1] cells [4,4] quad", "Q1", "2"),
    ("box [-1,0] to [1,1] cells [4,4] quad", "Q2", "2"),
    ("box [-1,0,0] to [1,1,1] cells [4,3,3] tet", "P1", "3"),
    ("box [-1,0,0] to [1,1,1] cells [4,3,3] hex", "Q1", "3"),
    ("box [-1,0,0] to [1,1,1] cells [4,3,3] tet", "P2", "3"),
    ("box [-1,0,0] to [1,1,1] cells [4,3,3] hex", "Q2", "3"),
];

/// A sheared and turned box: faces lie along no axis.
fn turned(dim: &str) -> &'static str {
    if dim == "2" { "[x + 0.3*y, y - 0.2*x]" } else { "[x + 0.3*y - 0.1*z, y - 0.2*x + 0.1*z, z + 0.2*x - 0.3*y]" }
}

/// A linear field on a plane has its gradient in the plane, whatever is solved for: unknown, data, from both sides, from a
/// region of faces of either body, and on the outer boundary.
#[test]
fn a_linear_field_has_the_gradient_of_its_plane() {
    for (mesh, element, dim) in SHAPES {
        let slope = if dim == "2" { "[0.7,-1.3]" } else { "[0.7,-1.3,0.4]" };
        let position = if dim == "2" { "[x,y]" } else { "[x,y,z]" };
        for faces in [
            "interface from left to right",
            "interface from right to left",
            "faces of left where s(x,y) == 0",
            "faces of right where s(x,y) == 0",
        ] {
            // in the coordinates of the box before its map the faces are x = 0
            let left = format!("{} < 0", split(dim));
            let text = format!(
                "mesh {mesh} map {}\n\
                 region left = cells where {left}\nregion right = all - left\n\
                 region fault = {}\nregion own = interface from left to right\n\
                 unknown p : scalar {element} on own\ndata q : scalar {element} on own = {slope}.{position}\n\
                 def tang(v) = v - (v.Normal)*Normal\ndef exact = tang({slope})\n\
                 term flow on fault : (p - {slope}.{position})*Test_p + (Grad_p - exact).Grad_Test_p\n\
                 measure value = max(abs(p - {slope}.{position})) on fault\n\
                 measure gradient = max(Norm(Grad_p - exact)) on fault\n\
                 measure of_data = max(Norm(Grad_q - exact)) on fault\n\
                 measure across = max(abs(Grad_p.Normal)) on fault\n\
                 measure product = max(Norm(Grad(p*q) - 2*q*exact)) on fault\n\
                 measure mixed = max(Norm(Grad(x*p) - tang(p*[1,{zeros}] + x*{slope}))) on fault\n",
                turned(dim),
                faces.replace("s(x,y)", split(dim)),
                zeros = if dim == "2" { "0" } else { "0,0" },
            );
            let found = solved(&text);
            for name in ["value", "gradient", "of_data", "across", "product", "mixed"] {
                let error = found.measure(0, name);
                assert!(error < EXACT, "{mesh} {element}, {faces}: {name} {error:e}");
            }
        }
    }
}

/// Zero on the faces that were x = 0 before [`turned`].
fn split(dim: &str) -> &'static str {
    // the normal of the image of the plane is the first column of the inverse transposed map
    if dim == "2" { "(x - 0.3*y)" } else { "((1.03*x - 0.27*y + 0.13*z))" }
}

/// A number of the reference file.
fn given(case: &str, name: &str) -> f64 {
    let all = reference("fracture_flow.json");
    let found = &all[case][name];
    found.as_f64().or_else(|| found["value"].as_f64()).unwrap_or_else(|| panic!("{case}: {name}"))
}

/// The rock has a pressure that jumps across the fracture, the fracture one of its own; a source at its middle node. What
/// flows out of the square is what comes in, and as much leaves the fracture through its sides.
#[test]
fn a_fracture_with_a_pressure_of_its_own_feeds_the_rock_on_both_sides() {
    for (case, below, above) in [("exchange_C10_k5_5", 5.0, 5.0), ("exchange_C10_k5_0.5", 5.0, 0.5)] {
        let text = format!(
            "mesh box [-2,-2] to [2,2] cells [64,64] tri map [x, sign(y)*2*abs(y/2)^1.5]\n\
             region below = cells where y < 0\nregion above = cells where y > 0\n\
             region fracture = interface from below to above & faces of below where y == 0 and abs(x) < 1.0001\n\
             region middle = nodes where x == 0 and y == 0\n\
             unknown p : scalar P2\nunknown pf : scalar P2 on fracture\nsplit p across fracture\n\
             def other(v) = Interpolate(v, neighbor_element)\n\
             term rock on all : Grad_p.Grad_Test_p\nterm flow on fracture : 10*Grad_pf.Grad_Test_pf\n\
             term exchange on fracture : {below}*(pf - p)*(Test_pf - Test_p) \
             + {above}*(pf - other(p))*(Test_pf - other(Test_p))\n\
             fix p = 0 on boundary\nload pf = 1 on middle\n\
             measure pf0 = value(pf) at [0,0]\nmeasure pf_half = value(pf) at [0.5,0]\nmeasure pf_tip = value(pf) at [1,0]\n\
             measure leak_below = integral({below}*(pf - p)) on fracture\n\
             measure leak_above = integral({above}*(pf - other(p))) on fracture\n\
             measure outflow = reaction(p) on boundary\n"
        );
        let found = solved(&text);
        for name in ["pf0", "pf_half", "pf_tip", "leak_below", "leak_above"] {
            let (is, should) = (found.measure(0, name), given(case, name));
            assert!((is / should - 1.0).abs() < 1e-2, "{case}: {name} {is}, {should}");
        }
        let sum = found.measure(0, "leak_below") + found.measure(0, "leak_above");
        assert!((sum - 1.0).abs() < 1e-11 && (found.measure(0, "outflow") - 1.0).abs() < 1e-11, "{case}: {sum}");
    }
}

/// Lines in impermeable rock that leak: closed forms on one line and where three meet, P2.
#[test]
fn lines_that_leak_off_meet_their_closed_forms() {
    let line = solved(
        "mesh box [-1.5,0] to [1.5,1] cells [48,1] tri\nregion line = faces where y == 0\n\
         region well = nodes where x == 0 and y == 0\nunknown p : scalar P2 on line\n\
         term flow on line : 2*Grad_p.Grad_Test_p + 3*p*Test_p\nload p = 1 on well\n\
         measure p0 = value(p) at [0,0]\nmeasure p_half = value(p) at [0.75,0]\nmeasure p_end = value(p) at [1.5,0]\n\
         measure leak = integral(3*p) on line\n"
            .to_owned(),
    );
    for name in ["p0", "p_half", "p_end"] {
        let (is, should) = (line.measure(0, name), given("leak_off_line", name));
        assert!((is / should - 1.0).abs() < 1e-6, "{name} {is}, {should}");
    }
    assert!((line.measure(0, "leak") - 1.0).abs() < EXACT);
    // the legs of the star are those of a T: its sheets have one node where they meet
    let star = solved(
        "mesh box [-1.5,-0.5] to [1,2] cells [20,20] tri\nregion below = cells where y < 0\n\
         region left = cells where x < 0 and y > 0\nregion right = cells where x > 0 and y > 0\n\
         region first = faces of below where y == 0 and x <= 0\nregion second = faces of below where y == 0 and x >= 0\n\
         region third = faces of left where x == 0\nregion star = first + second + third\n\
         region well = nodes where x == 0 and y == 0\nunknown p : scalar P2 on first, second, third\n\
         term a on first : 2*Grad_p.Grad_Test_p + 3*p*Test_p\nterm b on second : Grad_p.Grad_Test_p + p*Test_p\n\
         term c on third : 4*Grad_p.Grad_Test_p + 0.5*p*Test_p\nload p = 1 on well\n\
         measure junction = value(p) at [0,0]\nmeasure a = integral(3*p) on first\nmeasure b = integral(p) on second\n\
         measure c = integral(0.5*p) on third\n"
            .to_owned(),
    );
    let all = reference("fracture_flow.json");
    let star_of = &all["star_of_three"];
    let should = ["junction", "a", "b", "c"].into_iter().zip(
        std::iter::once(&star_of["p_junction"]).chain(star_of["flux_into_legs"].as_array().expect("three fluxes")),
    );
    for (name, should) in should {
        let (is, should) = (star.measure(0, name), should.as_f64().expect("a number"));
        assert!((is / should - 1.0).abs() < 1e-5, "{name} {is}, {should}");
    }
}

/// Two lines that cross in impermeable rock share a node there; what flows in at one end is what its prescribed value
/// carries.
#[test]
fn lines_that_cross_share_their_flow() {
    let found = solved(
        "mesh box [-1,-1] to [1,1] cells [4,4] quad\nregion below = cells where y < 0\nregion left = cells where x < 0\n\
         region first = faces of below where y == 0\nregion second = faces of left where x == 0\n\
         region west = nodes where x == -1 and y == 0\nregion east = nodes where x == 1 and y == 0\n\
         region south = nodes where x == 0 and y == -1\nregion north = nodes where x == 0 and y == 1\n\
         unknown p : scalar on first, second\n\
         term a on first : Grad_p.Grad_Test_p\nterm b on second : 3*Grad_p.Grad_Test_p\n\
         fix p = 1 on west\nfix p = 0 on east, south, north\nmeasure crossing = value(p) at [0,0]\n\
         measure west = reaction(p) on west\nmeasure east = reaction(p) on east\nmeasure south = reaction(p) on south\n\
         measure rest = reaction(p) on east, south, north\n"
            .to_owned(),
    );
    for (name, should) in [("crossing", 0.125), ("west", -0.875), ("east", 0.125), ("south", 0.375), ("rest", 0.875)] {
        let is = found.measure(0, name);
        assert!((is - should).abs() < EXACT, "{name} {is}, {should}");
    }
}

/// The order of an error between a mesh and one twice as fine.
fn order(errors: [f64; 2]) -> f64 {
    (errors[0] / errors[1]).log2()
}

/// cos(theta) on half a circle of radius R and on half a cylinder: -Lap p + p = (1 + 1/R^2) p, no flux at the ends.
#[test]
fn eigenfunctions_of_a_circle_and_a_cylinder_converge_with_order_two() {
    let circle = |n: usize| {
        format!(
            "mesh box [0,0] to [pi,0.5] cells [{n},1] quad map [(2 + y)*sin(x), (2 + y)*cos(x)]\n\
             region circle = faces where x^2 + y^2 < 4.001"
        )
    };
    let cylinder = |n: usize| {
        format!(
            "mesh box [0,0,0] to [pi,0.5,1] cells [{n},1,2] hex map [(2 + y)*sin(x), (2 + y)*cos(x), z]\n\
             region circle = faces where x^2 + y^2 < 4.001"
        )
    };
    for mesh in [&circle as &dyn Fn(usize) -> String, &cylinder] {
        let errors = [8, 16].map(|n| {
            let text = format!(
                "{}\nunknown p : scalar on circle\ndef exact = y/sqrt(x^2 + y^2)\n\
                 term flow on circle : Grad_p.Grad_Test_p + (p - 1.25*exact)*Test_p\n\
                 measure error = integral(sqr(p - exact)) on circle\n",
                mesh(n)
            );
            solved(&text).measure(0, "error").sqrt()
        });
        assert!(order(errors) > 1.9, "{errors:?}");
    }
}

/// x on a part of a sphere of radius 1, given at its rim: -Lap x = 2 x. Tetrahedra of first and second order.
#[test]
fn an_eigenfunction_of_a_sphere_converges_with_the_order_of_its_elements_and_one_more() {
    for (degree, least) in [(1, 1.85), (2, 2.85)] {
        let errors = [4, 8].map(|n| {
            let folder = MeshFolder::new(&format!("sphere-{degree}-{n}"), &sphere(n, degree));
            let text = format!(
                "mesh file \"body.msh\"\nregion ball = faces where abs(x^2 + y^2 + z^2 - 1) < 0.1\n\
                 region sides = boundary - ball - outside\nregion outside = faces where x^2 + y^2 + z^2 > 1.6\n\
                 unknown p : scalar P{degree} on ball\ndef exact = x/sqrt(x^2 + y^2 + z^2)\n\
                 term flow on ball : Grad_p.Grad_Test_p - 2*exact*Test_p\nfix p = x on sides\n\
                 measure error = integral(sqr(p - exact)) on ball\n\
                 measure slope = integral(Grad_p.Grad_p - 1 + exact^2) on ball\n"
            );
            let found = solve(folder.path(), text, &[], &[]).unwrap_or_else(|e| panic!("{e}"));
            let slope = found.measure(0, "slope").abs();
            assert!(slope < 0.05, "|grad x|^2 = 1 - x^2 on the sphere, missed by {slope}");
            found.measure(0, "error").sqrt()
        });
        assert!(order(errors) > least, "P{degree}: {errors:?}");
    }
}

/// A shell over a part of the unit sphere: `n` by `n` by 1 cubes of six tetrahedra each, of order 1 or 2.
fn sphere(n: usize, order: usize) -> String {
    let place = |p: [usize; 3]| -> [f64; 3] {
        let steps = (2 * n) as f64;
        let (x, y) = (1.2 * p[0] as f64 / steps - 0.6, 1.2 * p[1] as f64 / steps - 0.6);
        let r = (1.0 + 0.15 * p[2] as f64) / (1.0 + x * x + y * y).sqrt();
        [r * x, r * y, r]
    };
    // nodes of the grid of half steps; those that no tetrahedron has are left out
    let mut numbers = std::collections::BTreeMap::new();
    let mut cells = String::new();
    let mut count = 0;
    for cube in (0..n * n).map(|k| [2 * (k % n), 2 * (k / n), 0]) {
        for axes in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            let mut corner = cube;
            let mut corners = vec![corner];
            for axis in axes {
                corner[axis] += 2;
                corners.push(corner);
            }
            let even = matches!(axes, [0, 1, 2] | [1, 2, 0] | [2, 0, 1]);
            if !even {
                corners.swap(0, 1);
            }
            let middle = |a: usize, b: usize| std::array::from_fn(|d| (corners[a][d] + corners[b][d]) / 2);
            let pairs = [(0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3)];
            let mut nodes: Vec<[usize; 3]> = corners.clone();
            if order == 2 {
                nodes.extend(pairs.map(|(a, b)| middle(a, b)));
            }
            let mut text = String::new();
            for node in nodes {
                let next = numbers.len() + 1;
                let number = *numbers.entry(node).or_insert(next);
                text += &format!(" {number}");
            }
            count += 1;
            cells += &format!("{count} {} 2 1 1{text}\n", if order == 2 { 11 } else { 4 });
        }
    }
    let nodes: String = numbers
        .iter()
        .map(|(p, number)| {
            let [x, y, z] = place(*p);
            format!("{number} {x:?} {y:?} {z:?}\n")
        })
        .collect();
    format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n{nodes}$EndNodes\n$Elements\n{count}\n{cells}$EndElements\n",
        numbers.len()
    )
}

/// A field with one value a face is written as such, beside what is continuous.
#[test]
fn one_value_a_face_is_cell_data() {
    let found = solved(
        "mesh box [0,0] to [1,1] cells [4,4] quad\nregion floor = faces where y == 0\nunknown p : scalar DP0 on floor\n\
         unknown q : scalar Q2 on floor\nterm a on floor : (p - x)*Test_p + (q - x)*Test_q\n\
         output vtk \"floor\" : p, q, p + q as both\n"
            .to_owned(),
    );
    let (system, state) = (&found.scene.system, &found.outcome.steps[0].state);
    let (current, previous) = (system.slices(state), system.previous_slices());
    let values = FieldValues { current: &current, previous: &previous, rates: None };
    let piece = found.scene.vtk[0].pieces[0].sample(&system.mesh, wfl_discrete::window::Window::default(), values);
    let names = |arrays: &[Array]| arrays.iter().map(|a| a.name.clone()).collect::<Vec<_>>();
    assert_eq!(
        (names(&piece.point_data), names(&piece.cell_data)),
        (vec!["q".to_owned()], vec!["p".to_owned(), "both".to_owned()])
    );
    for (face, middle) in [0.125, 0.375, 0.625, 0.875].into_iter().enumerate() {
        assert!((piece.cell_data[0].values[face] - middle).abs() < EXACT);
        assert!((piece.cell_data[1].values[face] - 2.0 * middle).abs() < EXACT);
    }
}

/// What a face cannot give is refused with what to write.
#[test]
fn second_gradients_on_faces_are_refused_with_a_cure() {
    let scene = |text: &str| {
        refused(&format!(
            "mesh box [0,0] to [1,1] cells [2,2] quad\nregion floor = faces where y == 0\n\
             unknown p : scalar Q2 on floor\nterm t on floor : {text}\nterm s on floor : p*Test_p\n"
        ))
    };
    for text in ["Trace(Hess_p)*Test_p", "Trace(Grad(Grad_p))*Test_p", "Div(p*Grad_p)*Test_p"] {
        let told = scene(text);
        assert!(told.contains("E208") && told.contains("unknown q : vector"), "{text}: {told}");
    }
    // the cure
    let found = solved(
        "mesh box [0,0] to [1,1] cells [4,4] quad\nregion floor = faces where y == 0\n\
         unknown q : vector Q2 on floor\ndata p : scalar Q2 on floor = x^2\nterm t on floor : (q - Grad_p).Test_q\n\
         measure second = max(abs(Div_q - 2)) on floor\n"
            .to_owned(),
    );
    assert!(found.measure(0, "second") < 1e-11);
}

/// An aperture that grows with the pressure: the cube of it conducts, so that its fourth power is linear along the line.
#[test]
fn an_aperture_that_grows_with_the_pressure_has_the_flux_of_its_closed_form() {
    let all = reference("crack_flow.json");
    let column = &all["column_law"];
    let number = |name: &str| column[name].as_f64().expect("a number");
    let found = solved(format!(
        "mesh box [0,0] to [2,1] cells [32,1] quad\nregion line = faces where y == 0\nregion ends = rim of line\n\
         region well = rim of line where x == 0\nunknown p : scalar Q2 on line\nparam w0 = {}\nparam c = {}\n\
         def w = w0 + c*p\nstate slope : vector on line := Grad_p\n\
         term flow on line : w^3/{}*Grad_p.Grad_Test_p\nfix p = 1 - x/2 on ends\nstart p = 1 - x/2\n\
         measure flux = reaction(-p) on well\nmeasure middle = value(w) at [1,0]\nmeasure end = value(w) at [1.5,0]\n\
         measure kept = max(Norm(slope - Grad_p)) on line\n",
        number("w0"),
        number("c"),
        number("mu12")
    ));
    let apertures = column["w_h"].as_array().expect("five apertures");
    for (name, should) in [
        ("flux", number("flux")),
        ("middle", apertures[2].as_f64().expect("a number")),
        ("end", apertures[3].as_f64().expect("a number")),
    ] {
        let is = found.measure(0, name);
        assert!((is / should - 1.0).abs() < 1e-4, "{name} {is}, {should}");
    }
    assert!(found.measure(0, "kept") < 1e-15);
}

/// The scenes of the examples against the numbers of the series, not only against those that stand in them.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn consolidation_and_slip_under_injection_are_those_of_the_references() {
    let run = |name: &str| {
        let path = examples().join(format!("poro/{name}.wfl"));
        solved(std::fs::read_to_string(path).expect("examples can be read"))
    };
    let number = |value: &serde_json::Value| value.as_f64().expect("a number");
    let row = |table: &serde_json::Value, t: f64| {
        let rows = table.as_array().expect("a table").clone();
        rows.into_iter().find(|r| number(&r["T"]) == t).expect("a row of that time")
    };
    let (biot, slip) = (reference("biot.json"), reference("injection_slip.json"));
    let terzaghi = row(&biot["terzaghi"]["table"], 1.0);
    let mandel = row(&biot["mandel"]["table"], 0.1);
    let injected = row(&slip["two_d"], 0.5);
    let (column, block, fault) = (run("terzaghi"), run("mandel"), run("injection"));
    let rows = reference("displaced_reservoir.json")["friction"].as_array().expect("a table").clone();
    let of_bound = |r: &serde_json::Value| number(&r["B"]) == 4.0;
    let depleted = rows.into_iter().rfind(of_bound).expect("the finest row of that bound");
    let reservoir = run("reservoir");
    let last = |found: &Solved, name: &str| found.measure(found.outcome.steps.len() - 1, name);
    let length = (f64::exp(75.0 / 48.0) - 1.0) / (f64::exp(5.0) - 1.0) * 40.0;
    for (is, should, within) in [
        (last(&column, "bottom_pressure"), number(&terzaghi["p_bottom_over_q"]), 1e-3),
        (last(&column, "settlement"), number(&terzaghi["settlement"]), 1e-4),
        // a force of 10 on a block of 1 by 0.5
        (10.0 * last(&block, "pressure"), number(&mandel["p_centre"]), 1e-3),
        (-0.5 * last(&block, "sinks"), number(&mandel["uy_plate"]), 1e-3),
        (last(&block, "spreads"), number(&mandel["ux_side"]), 1e-3),
        (last(&fault, "slip"), 0.6 * length * number(&injected["slip_centre"]), 5e-3),
        (last(&reservoir, "slip"), number(&depleted["slip_max"]), 0.02),
        (last(&reservoir, "centre"), number(&depleted["slip_centre"]), 0.01),
        (-last(&reservoir, "back"), number(&depleted["slip_min"]), 0.05),
    ] {
        assert!((is / should - 1.0).abs() < within, "{is}, {should}");
    }
}
