//! Mesh files as users damage them: each gives one message that names the cause, or is solved with a warning.

use wfl_tests::plate::{Edits, tried};

/// The scene is refused with one error, and its message has these words.
fn refused(name: &str, mesh: Edits<'_>, scene: Edits<'_>, words: &[&str]) {
    let found = tried(name, mesh, scene);
    assert!(found.solved.is_none(), "{name}: a solution");
    assert_eq!(found.messages.matches("error[").count(), 1, "{name}:\n{}", found.messages);
    for word in words {
        assert!(found.messages.contains(word), "{name}: no {word:?} in\n{}", found.messages);
    }
}

/// The scene is solved, with these words among the warnings; the displacement of the east side is returned.
fn solved(name: &str, mesh: Edits<'_>, scene: Edits<'_>, words: &[&str]) -> f64 {
    let found = tried(name, mesh, scene);
    for word in words {
        assert!(found.messages.contains(word), "{name}: no {word:?} in\n{}", found.messages);
    }
    assert!(!words.is_empty() || found.messages.is_empty(), "{name}:\n{}", found.messages);
    let solved = found.solved.unwrap_or_else(|| panic!("{name}: {}", found.messages));
    assert!(solved.outcome.converged(), "{name}");
    solved.at(0, "u", [2.0, 0.0, 0.0])[0]
}

const LINE: &str = "scene.wfl:2:11";

#[test]
fn the_plate_itself_is_solved() {
    assert!(solved("plate", &[], &[], &[]) > 0.0);
}

#[test]
fn a_file_that_is_not_there_is_named_with_the_nearest_one() {
    let words = ["E410", "`plat.msh`: there is no such file", "did you mean `plate.msh`?", LINE];
    refused("missing", &[], &[("plate.msh", "plat.msh")], &words);
}

/// X29: the element of the file, its group and the determinant.
#[test]
fn cells_without_a_positive_volume_are_named() {
    let over = [("3 2 0 0", "3 0.2 0 0"), ("6 2 1 0", "6 0.2 1 0")];
    let words = ["E410", "element 11 of `right` is inside out: its jacobian determinant is -8e-1 everywhere", LINE];
    refused("over its neighbour", &over, &[], &words);
    let folded = [("5 1 1 0", "5 1.9 0.1 0")];
    refused("folded", &folded, &[], &["element 11 of `right` is folded", "at (1.9, 0.1, 0)", LINE]);
    let flat = [("3 2 0 0", "3 1 0.25 0"), ("6 2 1 0", "6 1 0.75 0")];
    refused("flat", &flat, &[], &["element 11 of `right` has no volume (jacobian determinant", LINE]);
    // the east side has no length
    let pointed = [("6 2 1 0", "6 2 0 0")];
    refused("pointed", &pointed, &[], &["element 11 of `right` is folded: its jacobian determinant is 0e0", LINE]);
    let twice = [("11 3 2 6 2 2 3 6 5", "11 3 2 6 2 2 3 6 6")];
    refused("twice", &twice, &[], &["element 11 lists node 6 twice", LINE]);
}

/// Both cells have a positive determinant, and lie on one side of their common edge.
#[test]
fn a_cell_that_is_folded_over_its_neighbour_is_named() {
    let over = [("3 2 0 0", "3 0.5 0 0"), ("6 2 1 0", "6 0.5 1 0"), ("2 3 6 5", "2 5 6 3")];
    let words = ["E410", "element 10 and element 11 lie on the same side of the face that they share", "scene.wfl:2:1"];
    refused("folded over", &over, &[], &words);
}

/// X28: a cell whose nodes run clockwise lies where it lies.
#[test]
fn a_cell_that_runs_clockwise_is_turned() {
    let turned = [("11 3 2 6 2 2 3 6 5", "11 3 2 6 2 2 5 6 3")];
    let words = ["W423", "1 cell runs clockwise", "the first is element 11", LINE];
    let (found, right) = (solved("turned", &turned, &[], &words), solved("plate", &[], &[], &[]));
    assert!((found - right).abs() < 1e-13 * right, "{found} {right}");
}

/// X33, X34.
#[test]
fn nodes_that_are_no_places_are_named() {
    for number in ["nan", "inf", "1e999"] {
        let edit = format!("3 {number} 0 0");
        refused("not a number", &[("3 2 0 0", &edit)], &[], &["line 17: a coordinate of node 3 is", LINE]);
    }
    let missing = [("11 3 2 6 2 2 3 6 5", "11 3 2 6 2 2 3 12 5")];
    refused("missing node", &missing, &[], &["element 11 uses node 12, which is not in the file", LINE]);
    refused("node twice", &[("3 2 0 0", "2 2 0 0")], &[], &["node 2 is given twice", LINE]);
}

/// X31: the body is torn at node 5, which is told; the other end moves more than in the whole plate.
#[test]
fn two_nodes_of_a_body_at_one_place_are_told_and_not_joined() {
    let torn = [("$Nodes\n6", "$Nodes\n7"), ("6 2 1 0", "6 2 1 0\n7 1 1 0"), ("2 3 6 5", "2 3 6 7")];
    let words = ["W405", "1 pairs of nodes of one body", "node 5 at [1.0, 1.0] and node 7 at [1.0, 1.0]", LINE];
    let rolling = [("load", "fix u(2) = 0 on bottom\nload")];
    let gap = solved("torn", &torn, &rolling, &words);
    let whole = solved("whole", &[], &rolling, &[]);
    assert!((gap - whole).abs() > 1e-2 * whole, "{gap} {whole}");
}

/// The square on the right is two, with a node in the middle of an edge of the one on the left.
const DIVIDED: [(&str, &str); 5] = [
    ("$Nodes\n6", "$Nodes\n8"),
    ("6 2 1 0", "6 2 1 0\n7 1 0.5 0\n8 2 0.5 0"),
    ("$Elements\n7", "$Elements\n8"),
    ("2 3 6 5", "2 3 8 7\n12 3 2 6 2 7 8 6 5"),
    ("4 1 2 3 3 3 6", "4 1 2 3 3 3 8"),
];

/// The field would jump at the node, unless each side has an unknown of its own.
#[test]
fn a_node_that_hangs_on_a_face_is_an_error_where_one_unknown_is_on_both_sides() {
    let words =
        ["E409", "node 7 at [1.0, 0.5] lies on a face of element 10, which has no node there, but element 11 and"];
    refused("hanging", &DIVIDED, &[], &words);
    let apart = [
        ("unknown u : vector", "unknown u : vector on left\nunknown v : vector on right"),
        ("on all : Div_u", "on left : Div_u"),
        ("fix u", "term b on right : Grad_v:Grad_Test_v\nfix v = [0,0] on east\nfix u"),
        ("load u = [1,0] on east\n", ""),
    ];
    let found = tried("apart", &DIVIDED, &apart);
    assert!(!found.messages.contains("E409"), "{}", found.messages);
}

/// Both squares have nodes of their own at the seam: nothing moves on the left, and nothing holds the right one.
#[test]
fn squares_that_touch_with_one_unknown_are_told_unless_something_joins_them() {
    let torn = [
        ("$Nodes\n6", "$Nodes\n8"),
        ("6 2 1 0", "6 2 1 0\n7 1 1 0\n8 1 0 0"),
        ("2 3 6 5", "8 3 6 7"),
        ("2 1 2 1 1 2 3", "2 1 2 1 1 8 3"),
    ];
    let held = ("load u = [1,0] on east", "fix u = [1,0] on east");
    let words =
        ["W405", "1 pair of faces of the mesh lies on each other", "element 10 and element 11 around [1.0, 0.5]"];
    solved("through", &torn, &[held], &words);
    let joined = (
        "load u = [1,0] on east",
        "fix u = [1,0] on east\nregion fault = interface from left to right\n\
        term tie on fault : 10*(u - Interpolate(u, neighbor_element)).(Test_u - Interpolate(Test_u, neighbor_element))",
    );
    solved("joined", &torn, &[joined], &[]);
}

/// X32: no dofs there, the same solution.
#[test]
fn a_node_of_no_cell_changes_nothing() {
    let more = [("$Nodes\n6", "$Nodes\n7"), ("6 2 1 0", "6 2 1 0\n99 7 7 0")];
    assert_eq!(solved("unused", &more, &[], &[]), solved("used", &[], &[], &[]));
}

/// X40: a cell in no term, and one on both sides of an interface.
#[test]
fn cells_in_no_body_or_in_two_are_counted() {
    let hole = [("vector\n", "vector on left\n"), ("on all", "on left"), ("on east", "on seam")];
    let words = ["E425", "1 cell of the mesh is in no term", "the first is element 11 of group `right`", LINE];
    let words: Vec<&str> = words.iter().map(|w| if *w == LINE { "scene.wfl:2:1" } else { *w }).collect();
    refused("hole", &[], &hole, &words);
    let meant = [hole[0], hole[1], hole[2], ("\"plate.msh\"", "\"plate.msh\" with idle_cells=allowed")];
    let found = tried("meant", &[], &meant);
    assert!(found.solved.is_some_and(|s| s.outcome.converged()), "{}", found.messages);
    let both = [("unknown u", "region fault = interface from all to right\nunknown u")];
    refused("both", &[], &both, &["the two sides of the interface share 1 cells"]);
    let option = [("\"plate.msh\"", "\"plate.msh\" with idle_cells=maybe"), hole[0], hole[1], hole[2]];
    let found = tried("option", &[], &option);
    assert!(found.messages.contains("idle_cells=refused, idle_cells=allowed"), "{}", found.messages);
}

/// X43: two bodies with separate nodes, one of them 0.1 off.
#[test]
fn faces_that_do_not_match_are_an_error_with_the_distance() {
    let apart = |y: &str| {
        let nodes = format!("6 2 1 0\n7 1 0 0\n8 1 {y} 0");
        [
            ("$Nodes\n6", "$Nodes\n8".to_owned()),
            ("6 2 1 0", nodes),
            ("2 3 6 5", "7 3 6 8".to_owned()),
            ("2 1 2 1 1 2 3", "2 1 2 1 1 7 3".to_owned()),
        ]
    };
    let fault = [("unknown u", "region fault = interface from left to right\nunknown u")];
    let edits = apart("1.125");
    let edits: Vec<(&str, &str)> = edits.iter().map(|(a, b)| (*a, b.as_str())).collect();
    let words = ["E405", "1 facets lie against each other without matching", "1.25e-1", "scene.wfl:3:16"];
    refused("apart", &edits, &fault, &words);
    // within a millionth of the face they are the same
    let edits = apart("1.0000000001");
    let edits: Vec<(&str, &str)> = edits.iter().map(|(a, b)| (*a, b.as_str())).collect();
    let found = tried("near", &edits, &fault);
    assert!(!found.messages.contains("E40"), "{}", found.messages);
}

/// X38, X39: a name that no group has is never a term, load or fixed value less.
#[test]
fn names_that_no_group_has_are_errors_wherever_they_stand() {
    let groups = "the mesh file has the groups bottom, east, left, right, seam, west";
    for (from, to) in [("on west", "on wets"), ("on east", "on wets"), ("on all", "on wets")] {
        refused("name", &[], &[(from, to)], &["E201", "unknown region `wets`", groups]);
    }
    let more = |line: &'static str| [("load", line)];
    refused("field", &[], &[("vector\n", "vector on lefd\n")], &["unknown region `lefd`", "did you mean `left`?"]);
    refused("measure", &[], &more("measure m = mean(u(1)) on bottum\nload"), &["did you mean `bottom`?"]);
    refused("interface", &[], &more("region f = interface from left to rigth\nload"), &["did you mean `right`?"]);
    refused("cells of", &[], &more("region f = faces of rigth\nload"), &["did you mean `right`?"]);
    refused("rule", &[], &more("quadrature on bottum degree 2\nload"), &["did you mean `bottom`?"]);
    refused(
        "none",
        &[("$PhysicalNames", "$Ignored"), ("$EndPhysicalNames", "$EndIgnored")],
        &[("load u = [1,0] on east\n", "")],
        &[
            "unknown region `west`",
            "the mesh file has the groups curve_1, curve_2, curve_3, curve_4, surface_5, surface_6",
        ],
    );
}

#[test]
fn an_empty_region_names_the_nearest_faces() {
    let scene = [("load", "region end = faces where x == 2.01\nload"), ("on east", "on end")];
    refused("empty", &[], &scene, &["E402", "region `end` is empty", "no face; the nearest faces have x = 2"]);
}

#[test]
fn names_of_groups_that_clash_are_told() {
    let words = ["W407", "two groups of the mesh file are called `left`: here the curve is called `left_curve`", LINE];
    let words: Vec<&str> = words.iter().map(|w| if *w == LINE { "scene.wfl:2:1" } else { *w }).collect();
    solved("same", &[("\"bottom\"", "\"left\"")], &[("on east", "on east\nfix u(2) = 0 on left_curve")], &words);
    let built_in = ["W407", "`boundary` is built in", "called `boundary_curve`"];
    solved("built in", &[("\"bottom\"", "\"boundary\"")], &[], &built_in);
    let hidden = ["W407", "the region `seam` hides the group of that name"];
    solved("hidden", &[], &[("load", "region seam = faces where x == 0\nload"), ("on west", "on seam")], &hidden);
    // a space is no letter of a name; every group can be written
    let free =
        solved("space", &[("\"bottom\"", "\"the bottom\"")], &[("load", "fix u(2) = 0 on the_bottom\nload")], &[]);
    let held = solved("no space", &[], &[("load", "fix u(2) = 0 on bottom\nload")], &[]);
    assert_eq!(free, held);
}

#[test]
fn a_damaged_file_is_told_with_its_line() {
    refused("cut", &[("$EndElements\n", "")], &[], &["line 31: the file ends where $EndElements is needed", LINE]);
    refused("letters", &[("3 2 0 0", "3 2,0 0 0")], &[], &["line 17: found `2,0`, needed a coordinate", LINE]);
    refused(
        "prism",
        &[("11 3 2", "11 90 2")],
        &[],
        &[
            "element 11 is a wedge or pyramid of higher order (Gmsh type 90), which is not supported; write the mesh",
            LINE,
        ],
    );
    refused("version", &[("2.2 0 8", "4 0 8")], &[], &["save the mesh as 2.2 or 4.1", LINE]);
    refused("no mesh", &[("$MeshFormat\n2.2", "solid\n2.2")], &[], &["not a mesh file of a known format", LINE]);
}

/// The scene has the dimension of its file: three numbers are too many for a plate.
#[test]
fn a_plate_is_no_body() {
    let words = ["[1,0,0]", "scene.wfl:6:10"];
    refused("three", &[], &[("[1,0]", "[1,0,0]")], &words);
    let words = ["the cells have dimension 2 but node 5 lies outside the plane of x and y", LINE];
    refused("surface", &[("5 1 1 0", "5 1 1 0.5")], &[], &words);
}
