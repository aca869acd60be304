//! Unknowns where faces cross: networks of faults with one value a face, coupled by a pressure where they meet. References:
//! closed forms.

use std::path::Path;

use wfl_discrete::assemble::FieldValues;
use wfl_output::{Piece, VtkCell};
use wfl_run::Outcome;
use wfl_tests::{
    ranks::{self, Holding, Shared},
    reference, refused, solved,
};

/// What is polynomial comes out to this.
const EXACT: f64 = 1e-12;

/// Three legs that meet in a point of the plane, or in a line of space: lengths 1.5, 1 and 2. The size of a square is `root`
/// times its side.
fn star(n: usize, dim: usize) -> String {
    let mesh = if dim == 2 {
        format!("box [-1.5,-2] to [1,1] cells [{},{}] quad", 5 * n, 6 * n)
    } else {
        format!("box [-1.5,-2,0] to [1,1,2] cells [{},{},2] hex", 5 * n, 6 * n)
    };
    format!(
        "mesh {mesh}\nregion below = cells where y < 0\nregion left = cells where x < 0 and y < 0\n\
         region first = faces of below where y == 0 and x < 1e-9\nregion second = faces of below where y == 0 and x > -1e-9\n\
         region third = faces of left where x == 0\nregion star = first + second + third\n\
         region joints = crossings of star\nregion in1 = interior of first\nregion in2 = interior of second\n\
         region in3 = interior of third\nregion end1 = rim of first where x == 0\nregion end2 = rim of second where x == 0\n\
         region end3 = rim of third where y == 0\ndef other(v) = Interpolate(v, neighbor_element)\n\
         param root = {}\n\
         def between(C) = 2*root*C/(element_size + other(element_size))*(pf - other(pf))*(Test_pf - other(Test_pf))\n\
         def out(C) = 2*root*C/element_size*(pc - pf)\n\
         unknown pf : scalar DP0 on star\nunknown pc : scalar on joints\n",
        if dim == 2 { "1" } else { "sqrt(2)" }
    )
}

/// The conductivities 2, 1, 4 and the leak-off 3, 1, 0.5 of the legs, fed where they meet.
const LEAKS: &str = "term leak1 on first : 3*pf*Test_pf\nterm leak2 on second : pf*Test_pf\nterm leak3 on third : 0.5*pf*Test_pf\n\
    term flow1 on in1 : between(2)\nterm flow2 on in2 : between(1)\nterm flow3 on in3 : between(4)\n\
    term meet1 on end1 : out(2)*(Test_pc - Test_pf)\nterm meet2 on end2 : out(1)*(Test_pc - Test_pf)\n\
    term meet3 on end3 : out(4)*(Test_pc - Test_pf)\nbalance water of pc, pf\n\
    measure p_junction = max(pc) on joints\nmeasure leg1 = integral(out(2)) on end1\n\
    measure leg2 = integral(out(1)) on end2\nmeasure leg3 = integral(out(4)) on end3\n";

/// Case 5 of the design: a star with leak-off, one value a face and one where the legs meet; order two in the size of the
/// faces, in the plane and in space.
#[test]
fn a_network_with_one_value_a_face_meets_at_its_crossing() {
    let all = reference("fracture_flow.json");
    let star_of = &all["star_of_three"];
    let exact: Vec<f64> = std::iter::once(&star_of["p_junction"])
        .chain(star_of["flux_into_legs"].as_array().expect("three fluxes"))
        .map(|x| x.as_f64().expect("a number"))
        .collect();
    for (dim, feed) in [(2, "load pc = 1 on joints\n"), (3, "term feed on end1 : -Test_pc\n")] {
        let length = if dim == 2 { 1.0 } else { 2.0 };
        let errors = [4, 8].map(|n| {
            let found = solved(format!("{}{LEAKS}{feed}", star(n, dim)));
            let is = |name: &str| found.measure(0, name);
            assert!(is("water_lost").abs() < EXACT, "{dim}: {:e}", is("water_lost"));
            let fluxes = is("leg1") + is("leg2") + is("leg3");
            assert!((fluxes - length).abs() < 10.0 * EXACT, "{dim}: {fluxes}");
            let names = ["p_junction", "leg1", "leg2", "leg3"];
            let value = |name: &str| if name == "p_junction" { is(name) } else { is(name) / length };
            names.iter().zip(&exact).map(|(name, should)| (value(name) / should - 1.0).abs()).fold(0.0, f64::max)
        });
        let order = (errors[0] / errors[1]).log2();
        assert!(errors[1] < 2e-3 && (order - 2.0).abs() < 0.2, "{dim}: {errors:?}, order {order}");
    }
}

/// Without leak-off pressures are linear along the legs, and one value a face has them in the middle of faces to rounding.
#[test]
fn a_network_without_leak_off_is_exact() {
    let found = solved(format!(
        "{}term flow1 on in1 : between(2)\nterm flow2 on in2 : between(1)\nterm flow3 on in3 : between(4)\n\
         term meet1 on end1 : out(2)*(Test_pc - Test_pf)\nterm meet2 on end2 : out(1)*(Test_pc - Test_pf)\n\
         term meet3 on end3 : out(4)*(Test_pc - Test_pf)\nregion far1 = rim of first where x < -1\n\
         region far2 = rim of second where x > 0.5\nregion far3 = rim of third where y < -1\n\
         unknown r : scalar on far1\nterm given on far1 : (r - 3)*Test_r\n\
         term west on far1 : 4/element_size*(pf - r)*Test_pf\nterm east on far2 : 2/element_size*pf*Test_pf\n\
         term south on far3 : 8/element_size*pf*Test_pf\nmeasure p = max(pc) on joints\n\
         measure leg1 = integral(out(2)) on end1\n",
        star(2, 2)
    ));
    // conductances 2/1.5, 1/1 and 4/2 from 3, 0 and 0
    let (g1, all) = (2.0 / 1.5, 2.0 / 1.5 + 1.0 + 2.0);
    let p = 3.0 * g1 / all;
    assert!((found.measure(0, "p") - p).abs() < 10.0 * EXACT, "{}", found.measure(0, "p"));
    assert!((found.measure(0, "leg1") + g1 * (3.0 - p)).abs() < 10.0 * EXACT, "{}", found.measure(0, "leg1"));
}

/// Along a crossing in space a field is linear between its nodes, has a gradient along the line, and can be fixed and
/// loaded at its ends; along a rim as well.
#[test]
fn fields_on_lines_have_gradients_along_them() {
    let found = solved(format!(
        "{}term pf on star : (pf - 1)*Test_pf\nterm line on end1 : 3*Grad_pc.Grad_Test_pc + 0*pc*Test_pc\n\
         region low = nodes of star where z == 0\nregion high = nodes of star where z == 2 and abs(x) + abs(y) < 1e-9\n\
         fix pc = 5 on low\nload pc = 6 on high\nregion edge = rim of star\nunknown r : scalar on edge\n\
         term r on edge : (r - x - 2*y + z)*Test_r\nmeasure slope = max(abs(Grad_pc(3) - 2)) on end1\n\
         measure across = max(abs(Grad_pc(1)) + abs(Grad_pc(2))) on end1\nmeasure middle = mean(pc) on joints\n\
         measure error = max(abs(r - x - 2*y + z)) on edge\nmeasure n = integral(1) on joints\n",
        star(1, 3)
    ));
    for (name, should) in [("slope", 0.0), ("across", 0.0), ("middle", 7.0), ("error", 0.0), ("n", 6.0)] {
        let is = found.measure(0, name);
        assert!((is - should).abs() < 10.0 * EXACT, "{name}: {is}, {should}");
    }
}

/// What lives on edges alone is written as lines, in the plane as points, each once; and has a value at a point of them.
#[test]
fn fields_on_edges_are_written_and_have_values_at_points() {
    for (dim, at, other, kinds, n) in
        [(2, "[0,0]", "[0.1,0]", VtkCell::Vertex, 1), (3, "[0,0,0.5]", "[0,0.1,0.5]", VtkCell::Line, 2)]
    {
        let height = if dim == 2 { "0" } else { "z" };
        let scene = |at: &str| {
            format!(
                "{}term pf on star : (pf - 1)*Test_pf\nterm line on joints : (pc - 2 - {height})*Test_pc\n\
                 measure here = value(pc) at {at}\nmeasure face = value(pf) at {at}\noutput vtk \"net\" : pf, pc, 2*pc as twice\n",
                star(1, dim)
            )
        };
        let found = solved(scene(at));
        let should = if dim == 2 { 2.0 } else { 2.5 };
        assert!((found.measure(0, "here") - should).abs() < EXACT, "{dim}: {}", found.measure(0, "here"));
        assert!((found.measure(0, "face") - 1.0).abs() < EXACT);
        let (system, state) = (&found.scene.system, &found.outcome.steps[0].state);
        let (current, previous) = (system.slices(state), system.previous_slices());
        let values = FieldValues { current: &current, previous: &previous, rates: None };
        let pieces: Vec<Piece> = found.scene.vtk[0]
            .pieces
            .iter()
            .map(|piece| piece.written(piece.sample(&system.mesh, wfl_discrete::window::Window::default(), values)))
            .collect();
        let lines =
            pieces.iter().find(|piece| piece.point_data.iter().any(|array| array.name == "pc")).expect("a piece");
        assert_eq!(lines.cells.iter().map(|(kind, _)| kind).collect::<Vec<_>>(), vec![kinds; n], "{dim}");
        for (x, values) in lines.points.iter().zip(&lines.point_data[0].values) {
            let should = if dim == 2 { 2.0 } else { 2.0 + x[2] };
            assert!(x[0].abs() + x[1].abs() < EXACT && (values - should).abs() < EXACT, "{dim} {x:?} {values}");
        }
        assert!(lines.point_data.iter().any(|array| array.name == "twice"), "{dim}");
        assert!(pieces.iter().any(|piece| piece.cell_data.iter().any(|array| array.name == "pf")), "{dim}");
        let told = refused(&scene(other));
        assert!(told.contains("E435") && told.contains("the point is in no body that has this expression"), "{told}");
    }
}

/// The same numbers on ranks that have all of the mesh and on those that have parts.
#[test]
fn ranks_have_the_network_of_one() {
    for (dim, feed) in [(2, "load pc = 1 on joints\n"), (3, "term feed on end1 : -exp(z)*Test_pc\n")] {
        let text = format!("{}{LEAKS}{feed}", star(2, dim));
        let scene = Shared::text(Path::new("."), text, &[]);
        let measures = |outcome: &Outcome| outcome.steps[0].measures.clone();
        let alone = measures(&ranks::solved(scene.whole()));
        for holding in [Holding::Whole, Holding::Parts] {
            for of_rank in scene.on_ranks(3, holding, |part| measures(&ranks::solved(part))) {
                for ((name, is), (_, should)) in of_rank.iter().zip(&alone) {
                    assert!((is - should).abs() < 1e-11, "{dim} {holding:?} {name}: {is}, {should}");
                }
            }
        }
    }
}

/// What has no meaning is told.
#[test]
fn what_has_no_value_at_a_crossing_is_told() {
    let scene = |lines: &str| format!("{}term all on star : pf*Test_pf\n{lines}\n", star(1, 2));
    for (lines, code, says) in [
        ("term t on star : pc*Test_pf", "E202", "does not live on"),
        ("term t on in1 : pc*Test_pf", "E202", "does not live on"),
        ("unknown q : scalar DP0 on joints\nterm t on joints : q*Test_q", "E406", "one value a node"),
        ("term t on end1 : Hess_pc(1,1)*Test_pc", "E208", "second derivatives"),
    ] {
        let told = refused(&scene(lines));
        assert!(told.contains(code) && told.contains(says), "{lines}: {told}");
    }
}
