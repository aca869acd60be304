//! Decks as programs write them, with areas, volumes and groups that are known.

use wfl_host::{input::InputError, reading::ReadingError};

use super::recognises;
use crate::mesh::{
    GroupEntities, Mesh, RawMesh,
    read::{ReadError, nothing_beside},
};

fn parse(bytes: &[u8]) -> Result<RawMesh, ReadError> {
    super::parse(bytes, &mut nothing_beside)
}

/// With these files beside the deck.
fn parse_with(files: &[(&str, &str)], deck: &str) -> Result<RawMesh, ReadError> {
    let mut beside = |name: &str| {
        let found = files.iter().find(|file| file.0 == name);
        found.map(|file| file.1.as_bytes().to_vec()).ok_or(ReadingError::Input(InputError::NotFound))
    };
    super::parse(deck.as_bytes(), &mut beside)
}

/// Two cubes side by side in parts of different kinds, with sets and surfaces.
const FLAT: &str = "\
*HEADING
 two cubes
** a comment
*NODE, NSET=Nall
1, 0., 0., 0.
2, 1., 0., 0.
3, 1., 1., 0.
4, 0., 1., 0.
5, 0., 0., 1.
6, 1., 0., 1.
7, 1., 1., 1.
8, 0., 1., 1.
9, 2., 0., 0.
10, 2., 1., 0.
11, 2., 0., 1.
12, 2., 1., 1.D0
*ELEMENT, TYPE=C3D8R, ELSET=left
1, 1, 2, 3, 4, 5, 6, 7,
8
*Element, type=C3D6, elset=right
20, 2, 9, 10, 6, 11, 12
21, 2, 10, 3, 6, 12, 7
*ELSET, ELSET=both bodies, GENERATE
1, 21, 1
*NSET, NSET=corner
1, 4
*SURFACE, NAME=west, TYPE=ELEMENT
left, S6
*SURFACE, NAME=skin
both bodies,
*MATERIAL, NAME=steel
*ELASTIC
210000., 0.3
*STEP
*NODE FILE
U
";

fn group<'m>(mesh: &'m RawMesh, name: &str) -> Vec<&'m GroupEntities> {
    mesh.groups.iter().filter(|g| g.name == name).map(|g| &g.entities).collect()
}

fn count(entities: &GroupEntities) -> usize {
    match entities {
        GroupEntities::Cells(cells) => cells.len(),
        GroupEntities::Facets(facets) => facets.len(),
        GroupEntities::Nodes { nodes, .. } => nodes.len(),
    }
}

#[test]
fn a_flat_deck_has_its_cells_sets_and_surfaces() {
    assert!(recognises(FLAT.as_bytes()) && !recognises(b"$MeshFormat\n"));
    let raw = parse(FLAT.as_bytes()).unwrap();
    assert_eq!((raw.dim, raw.order, raw.kinds.len(), raw.nodes.len()), (3, 1, 3, 12));
    for (name, n) in
        [("left", 1), ("right", 2), ("both bodies", 3), ("corner", 2), ("Nall", 12), ("west", 1), ("skin", 12)]
    {
        let found = group(&raw, name);
        assert!(found.len() == 1 && count(found[0]) == n, "{name}: {found:?}");
    }
    let mesh = Mesh::from_file(raw).unwrap();
    assert_eq!(mesh.warnings().turned_cells.len(), 0);
}

/// A tetrahedron of second order with a curved edge: the order of its middles is that of the file.
#[test]
fn middles_of_edges_stand_where_the_element_has_them() {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let edges = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];
    let middle = |[a, b]: [usize; 2]| [0, 1, 2].map(|d| 0.5 * (corners[a][d] + corners[b][d]));
    let points: Vec<[f64; 3]> = corners.into_iter().chain(edges.map(middle)).collect();
    let lines: String = points.iter().enumerate().map(|(k, [x, y, z])| format!("{}, {x}, {y}, {z}\n", k + 1)).collect();
    let text = format!("*NODE\n{lines}*ELEMENT, TYPE=C3D10\n1, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10\n");
    // positions of second-order nodes that do not fit their edges would turn the cell inside out
    let mesh = Mesh::from_file(parse(text.as_bytes()).unwrap()).unwrap();
    assert_eq!((mesh.n_cells(), mesh.order()), (1, 2));
}

#[test]
fn instances_stand_at_their_places_with_numbers_and_names_of_their_own() {
    let text = "\
*Part, name=Block
*Node
1, 0., 0.
2, 1., 0.
3, 1., 1.
4, 0., 1.
*Element, type=CPS4
1, 1, 2, 3, 4
*Elset, elset=body
1
*Surface, name=top
1, S3
*End Part
*Assembly, name=Assembly
*Instance, name=lower, part=block
*End Instance
*Instance, name=upper, part=BLOCK
0., 2.
0., 2., 0., 0., 2., 1., 90.
*End Instance
*Nset, nset=hold, instance=upper
1, 2
*Elset, elset=all of it
lower.body, upper.body
*End Assembly
";
    let raw = parse(text.as_bytes()).unwrap();
    assert_eq!((raw.kinds.len(), raw.nodes.len(), raw.dim), (2, 8, 2));
    // (1, 0) of the part, two up and then a quarter turn about (0, 2)
    let [x, y, _] = raw.nodes[5];
    assert!(x.abs() < 1e-15 && (y - 3.0).abs() < 1e-15, "{x}, {y}");
    for (name, n) in [("lower_body", 1), ("upper_body", 1), ("lower_top", 1), ("hold", 2), ("all of it", 2)] {
        let found = group(&raw, name);
        assert!(found.len() == 1 && count(found[0]) == n, "{name}: {found:?}");
    }
}

#[test]
fn what_cannot_be_read_is_told_with_its_line() {
    let node = "*NODE\n1, 0., 0.\n2, 1., 0.\n3, 0., 1.\n";
    for (text, words) in [
        (
            "*INCLUDE, INPUT=mesh.inp\n",
            "line 1: `mesh.inp`, which is included there, cannot be read: there is no such file",
        ),
        ("*INCLUDE\n", "line 1: *INCLUDE has no INPUT="),
        ("*NGEN\n", "line 1: *NGEN is not followed"),
        ("*NODE\n1, 0., zero\n", "line 2: found `zero`"),
        ("*NODE, SYSTEM=C\n1, 0., 0.\n", "SYSTEM="),
        ("*NODE\n1, 0., 0.\n*ELEMENT, TYPE=US3\n1, 1\n", "line 4: element 1 is a US3"),
        ("*NODE\n1, 0., 0.\n*ELEMENT, TYPE=SPRINGA\n1, 1\n", "there is no *ELEMENT with data"),
        ("*NODE\n1, 0., 0.\n*ELEMENT\n1, 1\n", "line 3: *ELEMENT has no TYPE="),
        (&format!("{node}*ELEMENT, TYPE=CPS3\n1, 1, 2\n"), "element 1 has 2 nodes, CPS3 has 3"),
        (&format!("{node}*ELEMENT, TYPE=CPS3\n1, 1, 2, 3, 3\n"), "element 1 has 4 nodes, CPS3 has 3"),
        (&format!("{node}*ELEMENT, TYPE=CPS3\n1, 1, 2, 9\n"), "element 1 uses node 9"),
        (&format!("{node}*ELEMENT, TYPE=CPS3\n1, 1, 2, 3\n*SURFACE, NAME=s\n1, S4\n"), "element 1 has no face S4"),
        (&format!("{node}*ELEMENT, TYPE=CPS3\n1, 1, 2, 3\n*SURFACE, NAME=s\n1, top\n"), "found `top`"),
        (&format!("{node}*ELEMENT, TYPE=CPS3\n1, 1, 2, 3\n*ELSET, ELSET=a\nb\n"), "no set `b` of elements"),
        ("*INSTANCE, NAME=a, PART=b\n", "there is no part `b`"),
        ("*HEADING\n", "there is no *ELEMENT"),
    ] {
        let told = parse(text.as_bytes()).unwrap_err().to_string();
        assert!(told.contains(words), "{text}: {told}");
    }
}

/// Whatever the numbers are, work follows the size of the file.
#[test]
fn large_numbers_and_ranges_end_soon() {
    let mesh = "*NODE\n1, 0., 0.\n2, 1., 0.\n99999999999999, 0., 1.\n*ELEMENT, TYPE=CPS3\n7, 1, 2, 99999999999999\n";
    let text = format!(
        "{mesh}*NSET, NSET=odd, GENERATE\n1, 99999999999999, 2\n*ELSET, ELSET=all of it, GENERATE\n1, 99999999999998\n"
    );
    let raw = parse(text.as_bytes()).unwrap();
    assert_eq!([count(group(&raw, "odd")[0]), count(group(&raw, "all of it")[0])], [2, 1]);
    let told = parse(b"*NODE\n100000000000000, 0., 0.\n").unwrap_err().to_string();
    assert!(told.contains("line 2: found `100000000000000`"), "{told}");
    let told = parse(b"*NODE\n18446744073709551615, 0., 0.\n").unwrap_err().to_string();
    assert!(told.contains("line 2"), "{told}");
}

/// Files stand where they are named, between the data of another keyword too; what steps include is not read.
#[test]
fn included_files_stand_where_they_are_named() {
    let deck = "\
*INCLUDE, INPUT=mesh/nodes.inp
3, 0., 1.
*ELEMENT, TYPE=CPS3, ELSET=body, INPUT=cells.txt
*INCLUDE,
 input=\"sets.inp\"
*STEP
*INCLUDE, INPUT=loads.inp
";
    let files = [
        ("mesh/nodes.inp", "** nodes\n*NODE, NSET=all\n1, 0., 0.\n2, 1., 0.\n"),
        ("cells.txt", "7, 1, 2, 3\n"),
        ("sets.inp", "*INCLUDE, INPUT=inner.inp\n*SURFACE, NAME=low\nbody, S1\n"),
        ("inner.inp", "*NSET, NSET=hold\n1, 3\n*ELEMENT, TYPE=SPRINGA, ELSET=springs\n9, 1, 2\n"),
    ];
    let raw = parse_with(&files, deck).unwrap();
    for (name, n) in [("all", 3), ("body", 1), ("low", 1), ("hold", 2)] {
        let found = group(&raw, name);
        assert!(found.len() == 1 && count(found[0]) == n, "{name}: {found:?}");
    }
    let told = |files: &[(&str, &str)], deck: &str| parse_with(files, deck).unwrap_err().to_string();
    // the line is that of the file that it is in, also behind another file
    let wrong =
        [files[0], files[1], ("sets.inp", "*INCLUDE, INPUT=inner.inp\n*SURFACE, NAME=low\nbody, S9\n"), files[3]];
    assert!(told(&wrong, deck).starts_with("in the included `sets.inp`, line 3: found `S9`"), "{}", told(&wrong, deck));
    let text = told(&files[..3], deck);
    assert!(text.starts_with("in the included `sets.inp`, line 1: `inner.inp`"), "{text}");
    let text = told(&files, &format!("{}*SURFACE, NAME=x\nbody, S4\n", deck.split("*STEP").next().unwrap()));
    assert!(text.starts_with("line 6: element 7 has no face S4"), "{text}");
    let round = [("a.inp", "*INCLUDE, INPUT=b.inp\n"), ("b.inp", "*HEADING\n*INCLUDE, INPUT=a.inp\n")];
    let text = told(&round, "*INCLUDE, INPUT=a.inp\n");
    assert!(
        text.contains("`b.inp`, line 2: `a.inp` includes itself: `a.inp`, which includes `b.inp`, which"),
        "{text}"
    );
    // many times the same file is told before it fills the memory
    let many = "*INCLUDE, INPUT=b.inp\n".repeat(1200);
    let text = told(&[("b.inp", "** nothing\n")], &many);
    assert!(text.starts_with("line 1001: more than"), "{text}");
}

/// A face of shells on a solid: the side that `SPOS` names is the element.
#[test]
fn sides_of_shells_are_faces() {
    let text = FLAT.replace(
        "*MATERIAL",
        "*ELEMENT, TYPE=S4, ELSET=skin of it\n50, 5, 6, 7, 8\n*SURFACE, NAME=top\n50, SPOS\n*MATERIAL",
    );
    let raw = parse(text.as_bytes()).unwrap();
    assert!(matches!(group(&raw, "top")[..], [GroupEntities::Facets(list)] if list.len() == 1));
}
