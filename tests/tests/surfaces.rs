//! Interfaces along surfaces inside one body: exact solutions with three values at the junction of a T, and the same
//! crack declared by its faces and by its bodies.

use std::path::Path;

use wfl_tests::{Solved, solve};

fn solved(text: String) -> Solved {
    let found = solve(Path::new("."), text, &[], &[]).unwrap_or_else(|e| panic!("{e}"));
    assert!(found.outcome.converged());
    found
}

/// Cells of each kind, their box, and the element of degree two.
const SHAPES: [(&str, &str, &str); 4] = [
    ("[-1,-1] to [1,1] cells [4,4] tri", "P2", "[1,2]"),
    ("[-1,-1] to [1,1] cells [4,4] quad", "Q2", "[1,2]"),
    ("[-1,-1,0] to [1,1,1] cells [4,4,2] tet", "P2", "[1,2,3]"),
    ("[-1,-1,0] to [1,1,1] cells [4,4,2] hex", "Q2", "[1,2,3]"),
];

/// A T cuts the box into three blocks, and springs between them are at rest when the blocks have moved as `moved` says:
/// each block moves as a whole, which needs three values at every node of the junction.
#[test]
fn three_blocks_around_a_junction_move_on_their_own() {
    for (mesh, element, vector) in SHAPES {
        for (towards, sign) in [("", 1.0), (" towards -1*[1,1,1]", -1.0)] {
            let dim = vector.matches(',').count() + 1;
            let towards = towards.replace("-1*[1,1,1]", if dim == 2 { "[-1,-1]" } else { "[-1,-1,-1]" });
            let text = format!(
                "mesh box {mesh}\n\
                 region below = cells where y < 0\nregion above = cells where y > 0\n\
                 region left = cells where x < 0 and y < 0\nregion right = cells where x > 0 and y < 0\n\
                 region surface = faces of below where y == 0 + faces of left where x == 0\n\
                 region crack = interface along surface{towards}\n\
                 region main = crack & faces of below where y == 0\nregion branch = crack - main\n\
                 unknown u : vector {element}\nsplit u across crack\n\
                 def moved = if y > 0 then 0*{vector} else (if x < 0 then {vector} else -2*{vector})\n\
                 def jump(v) = v - Interpolate(v, neighbor_element)\n\
                 def step = {sign}*(if x < 0 then {vector} else -2*{vector})\n\
                 term elastic on all : 100*Sym(Grad_u):Grad_Test_u\n\
                 term hinge on main : 10*(jump(u) - step).jump(Test_u)\n\
                 term spring on branch : 10*(jump(u) - {sign}*3*{vector}).jump(Test_u)\n\
                 region ceiling = faces where y == 1\nfix u = 0*{vector} on ceiling\n\
                 measure error = max(Norm(u - moved)) on all\n\
                 measure sides = mean(Normal(2)) on main\nmeasure side = mean(Normal(1)) on branch\n"
            );
            let found = solved(text);
            assert!(found.measure(0, "error") < 1e-12, "{mesh}: {}", found.measure(0, "error"));
            for name in ["sides", "side"] {
                assert!((found.measure(0, name) - sign).abs() < 1e-14, "{mesh}: {name}");
            }
        }
    }
}

/// The faces of a crack and the two regions of cells at it declare one interface.
#[test]
fn an_interface_along_faces_is_the_one_between_their_cells() {
    let scene = |crack: &str| {
        format!(
            "mesh box [-2,-2,-1] to [2,2,1] cells [4,4,2] tet\nregion below = cells where z < 0\n\
             region above = cells where z > 0\nregion disc = faces of below where z == 0 and abs(x) <= 1 and abs(y) <= 1\n\
             {crack}\nunknown u : vector P2\nsplit u across crack\n\
             def jump(v) = v - Interpolate(v, neighbor_element)\nterm elastic on all : 100*Sym(Grad_u):Grad_Test_u\n\
             term pressure on crack : Normal.jump(Test_u)\nregion floor = faces where z == -1\nfix u = [0,0,0] on floor\n\
             measure opening = integral(-jump(u).Normal) on crack\n"
        )
    };
    let between = solved(scene("region crack = interface from below to above & disc"));
    let along = solved(scene("region crack = interface along disc"));
    assert!(between.measure(0, "opening") > 1e-3);
    assert_eq!(along.measure(0, "opening").to_bits(), between.measure(0, "opening").to_bits());
}
