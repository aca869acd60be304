//! `wfl mesh` and `mesh file` with several files, as a user meets them.

use std::process::Output;

use crate::common::Folder;

/// Two blocks of side 1, one on the other, with a contact pair.
const DECK: &str = "*NODE, NSET=all nodes
1, 0., 0.\n2, 1., 0.\n3, 1., 1.\n4, 0., 1.
5, 0., 1.\n6, 1., 1.\n7, 1., 2.\n8, 0., 2.
*ELEMENT, TYPE=CPE4, ELSET=lower
10, 1, 2, 3, 4
*ELEMENT, TYPE=CPE4, ELSET=upper
20, 5, 6, 7, 8
*SURFACE, NAME=base
10, S1
*SURFACE, NAME=low_top
10, S3
*SURFACE, NAME=up_bottom
20, S1
*SURFACE, NAME=lid
20, S3
*SURFACE INTERACTION, NAME=rough
*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR
1e5
*FRICTION
0.3, 1e4
*CONTACT PAIR, INTERACTION=rough, TYPE=SURFACE TO SURFACE
up_bottom, low_top
*STEP
*STATIC
*END STEP
";

/// A unit square, its cells, its lower and upper side.
const SQUARE: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n1 1 \"south\"\n1 2 \"north side\"\n2 3 \"body\"\n\
    $EndPhysicalNames\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n$EndNodes\n$Elements\n3\n1 1 2 1 1 1 2\n2 1 2 2 2 3 4\n\
    3 3 2 3 3 1 2 3 4\n$EndElements\n";

fn said(done: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&done.stdout), String::from_utf8_lossy(&done.stderr))
}

#[test]
fn a_deck_is_told_with_its_regions_and_the_lines_of_its_contact_pair() {
    let folder = Folder::new("mesh_deck");
    folder.write("deck.inp", DECK);
    let done = folder.wfl(&["mesh", "deck.inp"]);
    let text = said(&done);
    assert!(done.status.success(), "{text}");
    for words in ["quadrilateral", "all_nodes", "up_bottom", "area", "jacobian ratio", "element 10"] {
        assert!(text.contains(words), "{words} is not in {text}");
    }
    let done = folder.wfl(&["mesh", "deck.inp", "--json"]);
    let json: serde_json::Value = serde_json::from_slice(&done.stdout).expect("JSON");
    assert_eq!(json["total"][0]["size"], 2.0);
    assert_eq!(json["total"][0]["bodies"], 2);
    let regions: Vec<&str> =
        json["regions"].as_array().unwrap().iter().map(|r| r["region"].as_str().unwrap()).collect();
    assert_eq!(regions, ["lower", "upper", "base", "low_top", "up_bottom", "lid", "all_nodes"]);
    // the lines are statements: they stand in a scene that runs
    let lines: Vec<&str> = json["scene_lines"].as_array().unwrap().iter().map(|l| l.as_str().unwrap()).collect();
    let scene = format!(
        "wfl 1\nmesh file \"deck.inp\"\nunknown u : vector\nterm bulk on all : 1000*Sym(Grad_u):Grad_Test_u\n\
         fix u = [0,0] on base\nfix u(1) = 0 on lid\nload u = [0,-t] on lid\nsteps t = 0.5 to 1 by 0.5\n\
         measure settled = mean(-u(2)) on lid\n{}\n",
        lines.join("\n")
    );
    folder.write("scene.wfl", &scene);
    let done = folder.wfl(&["run", "scene.wfl"]);
    let text = said(&done);
    assert!(done.status.success() && text.contains("2 of 2 steps converged"), "{scene}\n{text}");
    // two columns of stiffness 1000 and a penalty of 1e5, under a stress of 1
    let settled = text.lines().find_map(|l| l.trim().strip_prefix("settled = ")).expect("the measure");
    let settled: f64 = settled.split_whitespace().next().unwrap().parse().unwrap();
    assert!((settled / (2e-3 + 1e-5) - 1.0).abs() < 2e-2, "{settled}");
}

#[test]
fn a_mesh_is_drawn() {
    let folder = Folder::new("mesh_drawn");
    folder.write("square.msh", SQUARE);
    let done = folder.wfl(&["mesh", "square.msh", "--png", "square.png", "--svg", "square.svg", "--colours", "angle"]);
    assert!(done.status.success(), "{}", said(&done));
    assert!(std::fs::read(folder.0.join("square.png")).unwrap().starts_with(b"\x89PNG"));
    let svg = std::fs::read_to_string(folder.0.join("square.svg")).unwrap();
    assert!(svg.contains("smallest angle 90") && svg.contains("1 cells, 4 nodes"), "{svg}");
}

#[test]
fn files_of_other_programs_are_told_with_the_command_that_converts_them() {
    let folder = Folder::new("mesh_others");
    let med = [b"\x89HDF\r\n\x1a\n".as_slice(), &[0; 64], b"INFOS_GENERALES\0"].concat();
    for (name, bytes, words) in [
        (
            "part.med",
            med.as_slice(),
            "a MED file of Salome or Code_Aster, which is not read; convert it: `gmsh part.med",
        ),
        ("part.exo", b"CDF\x01xx", "an Exodus file"),
        ("part.vtk", b"# vtk DataFile Version 3.0\nx\n", "a legacy file of VTK"),
        ("part.unv", b"    -1\n  2411\n", "a universal file"),
        ("part.txt", b"nothing\n", "not a mesh file of a known format"),
    ] {
        folder.write(name, bytes);
        let done = folder.wfl(&["mesh", name]);
        let text = said(&done);
        assert!(done.status.code() == Some(1) && text.contains("E410") && text.contains(words), "{name}: {text}");
    }
    let done = folder.wfl(&["mesh", "missing.msh"]);
    assert!(done.status.code() == Some(1) && said(&done).contains("there is no such file"));
}

/// Two squares with a gap of 0.1 between them, pressed together by 0.1 and a little more.
#[test]
fn one_file_at_several_places_makes_bodies_with_a_gap() {
    let folder = Folder::new("mesh_places");
    folder.write("square.msh", SQUARE);
    let scene = "wfl 1
param gap = 0.1
mesh file \"square.msh\", \"square.msh\" moved by [0, 1 + gap]
region lower = cells of body where y < 1
region upper = cells of body where y > 1
region face  = faces of upper where y == 1 + gap
region floor = faces of lower where y == 1
region lid   = faces of upper where y == 2 + gap
region base  = faces of lower where y == 0
unknown u : vector
mapping m = project from face onto floor within 0.5
term bulk on all : 1000*Sym(Grad_u):Grad_Test_u
term contact on face : 1e5*pos_part((u - Interpolate(u, m)).Normal - gap)*((Test_u - Interpolate(Test_u, m)).Normal)
fix u = [0,0] on base
fix u = [0,-gap - 0.001] on lid
measure area  = integral(1) on all
measure force = integral(1e5*pos_part((u - Interpolate(u, m)).Normal - gap)) on face
expect abs(area - 2) < 1e-14
# two columns and the penalty in a row: 0.001 = force*(1/1000 + 1/1000 + 1/1e5)
expect abs(force*(2e-3 + 1e-5)/0.001 - 1) < 1e-9
";
    folder.write("scene.wfl", scene);
    let done = folder.wfl(&["run", "scene.wfl"]);
    let text = said(&done);
    assert!(done.status.success(), "{text}");
    assert!(text.contains("W703") && text.contains("`body`") && text.contains("`south`"), "{text}");
}

#[test]
fn meshes_are_scaled_turned_and_moved_in_the_order_written() {
    let folder = Folder::new("mesh_turned");
    folder.write("square.msh", SQUARE);
    let rest = "unknown p : scalar\nterm t on all : Grad_p.Grad_Test_p + p*Test_p - Test_p\n\
                measure right = max(x) on all\nmeasure left = max(-x) on all\nmeasure area = integral(1) on all\n";
    let with = |place: &str, expect: &str| {
        let scene = format!("wfl 1\nmesh file \"square.msh\" {place}\n{rest}{expect}\n");
        folder.write("scene.wfl", &scene);
        folder.wfl(&["run", "scene.wfl"])
    };
    for (place, expect) in [
        ("scaled by 1e-3", "expect abs(area - 1e-6) < 1e-18"),
        // a quarter of a turn takes the square to negative x; integration points lie inside
        ("turned by 90 moved by [5,0]", "expect right < 5\nexpect left < -4\nexpect abs(area - 1) < 1e-14"),
        ("moved by [5,0] turned by 90", "expect right < 0\nexpect left > 0"),
    ] {
        let done = with(place, expect);
        assert!(done.status.success(), "{place}: {}", said(&done));
    }
    for (place, words) in [
        ("moved by [0,1,2]", "a motion has 2 components here, found 3"),
        ("scaled by -1", "a factor is above 0, found -1"),
        ("turned by 30 about [0,0,1]", "without an axis"),
    ] {
        let text = said(&with(place, ""));
        assert!(text.contains("E718") && text.contains(words), "{place}: {text}");
    }
}
