use super::*;
use crate::mesh::{
    CellId, CellKind, FacetRef, GroupEntities, RegionSet, Topology, cell_volumes, facet_measures, interface,
};

/// Files of [`data/README.md`](data/README.md) in two formats each.
const FILES: [(&str, [&[u8]; 2]); 8] = [
    ("disc", [include_bytes!("data/disc_22b.msh"), include_bytes!("data/disc_41a.msh")]),
    ("hex", [include_bytes!("data/hex_22a.msh"), include_bytes!("data/hex_41b.msh")]),
    ("tet", [include_bytes!("data/tet_22b.msh"), include_bytes!("data/tet_41a.msh")]),
    ("mixed", [include_bytes!("data/mixed_22a.msh"), include_bytes!("data/mixed_41b.msh")]),
    ("line", [include_bytes!("data/line_22b.msh"), include_bytes!("data/line_41a.msh")]),
    ("wedges", [include_bytes!("data/wedges_22a.msh"), include_bytes!("data/wedges_41a.msh")]),
    ("solids", [include_bytes!("data/solids_22b.msh"), include_bytes!("data/solids_41a.msh")]),
    ("solids2", [include_bytes!("data/solids2_22a.msh"), include_bytes!("data/solids2_41b.msh")]),
];

fn files(name: &str) -> [Mesh; 2] {
    let (_, contents) = FILES.into_iter().find(|(n, _)| *n == name).unwrap();
    contents.map(|bytes| Mesh::from_raw(parse_mesh(bytes).unwrap()).unwrap())
}

/// Measure of a named group: volume, area, or number of nodes.
fn measure(mesh: &Mesh, topology: &Topology, name: &str) -> f64 {
    let group = mesh.groups().iter().find(|g| g.name == name).unwrap();
    match RegionSet::from_group(mesh, topology, group).unwrap() {
        RegionSet::Cells(cells) => cell_volumes(mesh, &cells).iter().sum(),
        RegionSet::Facets(facets) => facet_measures(mesh, &facets).iter().sum(),
        RegionSet::Nodes(nodes) => nodes.len() as f64,
        RegionSet::Interface(_) | RegionSet::Edges(_) => unreachable!(),
    }
}

/// Volumes and areas of every group are those that Gmsh itself integrates. A wrong order of the
/// nodes of any element would fold it or change them.
#[test]
fn groups_have_the_measures_that_gmsh_finds() {
    type Expected = (&'static str, f64, f64);
    let expected: [(&str, usize, &[Expected]); 8] = [
        (
            "disc",
            7,
            &[
                ("body", 0.7852761804100826, 1e-12),
                ("twice", 0.7852761804100826, 1e-12),
                // The length of a curved edge is no polynomial: our Gauss rule differs from theirs.
                ("curve_77", 3.5706759362101486, 1e-5),
                ("corner", 1.0, 0.0),
            ],
        ),
        (
            "hex",
            2,
            &[
                ("near", 0.9213106741667367, 1e-13),
                ("far", 1.0, 1e-13),
                ("fault", 1.0, 1e-13),
                ("bottom", 1.9213106741667363, 1e-13),
                ("trace", 3.0, 0.0),
            ],
        ),
        (
            "tet",
            12,
            &[
                ("near", 0.9213106741641778, 1e-10),
                ("far", 0.9999999999971093, 1e-10),
                ("fault", 1.0, 1e-10),
                ("bottom", 1.921310674166747, 1e-10),
                ("trace", 3.0, 0.0),
            ],
        ),
        ("mixed", 12, &[("squares", 1.0, 1e-13), ("triangles", 1.0, 1e-13), ("seam", 1.0, 1e-13)]),
        ("line", 3, &[("bar", 3.0, 1e-13), ("end", 1.0, 1e-13)]),
        ("wedges", 2, &[("body", 1.0, 1e-14), ("bottom", 1.0, 1e-14)]),
        // Gmsh's rule on tetrahedra has eleven digits
        ("solids", 60, &[("body", 7.9999999999902, 2e-11), ("bottom", 4.0, 1e-13)]),
        ("solids2", 60, &[("body", 8.174999999989588, 2e-11), ("bottom", 4.007434153696927, 1e-5)]),
    ];
    for (name, n_cells, groups) in expected {
        for mesh in files(name) {
            let topology = Topology::new(&mesh).unwrap();
            assert_eq!(mesh.n_cells(), n_cells, "{name}");
            assert_eq!(mesh.groups().len(), groups.len(), "{name}");
            for (group, value, tolerance) in groups {
                let found = measure(&mesh, &topology, group);
                assert!((found - value).abs() <= *tolerance, "{name} {group}: {found} {value}");
            }
            assert_eq!(mesh.warnings().duplicate_nodes, []);
        }
    }
}

#[test]
fn both_formats_give_the_same_mesh() {
    for (name, _) in FILES {
        let [first, second] = files(name);
        let topology = Topology::new(&first).unwrap();
        assert_eq!(first.order(), second.order());
        assert_eq!(topology.n_facets(), Topology::new(&second).unwrap().n_facets());
        assert_eq!(first.nodes().len(), second.nodes().len(), "{name}");
        // The order of the cells differs (by shape in 2.2, by surface in 4.1), not the cells.
        for x in first.cells().map(|cell| first.centroid(cell)) {
            let near = |y: [f64; 3]| (0..3).all(|i| (x[i] - y[i]).abs() < 1e-12);
            assert!(second.cells().any(|cell| near(second.centroid(cell))), "{name}");
        }
    }
}

#[test]
fn the_interface_between_volumes_is_the_surface_group() {
    for name in ["hex", "tet"] {
        let [mesh, _] = files(name);
        let topology = Topology::new(&mesh).unwrap();
        let cells = |name: &str| -> Vec<CellId> {
            let group = mesh.groups().iter().find(|g| g.name == name).unwrap();
            match &group.entities {
                GroupEntities::Cells(cells) => cells.clone(),
                _ => panic!(),
            }
        };
        let (near, far) = (cells("near"), cells("far"));
        let Ok(RegionSet::Interface(fault)) = interface(&mesh, &topology, &near, &far) else { panic!() };
        let here: Vec<FacetRef> = fault.iter().map(|f| f.here).collect();
        let area: f64 = facet_measures(&mesh, &here).iter().sum();
        assert!((area - measure(&mesh, &topology, "fault")).abs() < 1e-12);
    }
}

#[test]
fn kinds_may_be_mixed() {
    let [mesh, _] = files("mixed");
    let count = |kind| mesh.kinds().iter().filter(|k| **k == kind).count();
    assert_eq!((count(CellKind::Quadrilateral), count(CellKind::Triangle)), (4, 8));
}

const HEAD: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n";
const NODES: &str = "$Nodes\n3\n1 0 0 0\n2 1 0 0\n9 0 1 0\n$EndNodes\n";
const ELEMENTS: &str = "$Elements\n1\n5 2 2 0 1 1 2 9\n$EndElements\n";

fn message(text: &str) -> String {
    match parse_mesh(text.as_bytes()).map(Mesh::from_raw) {
        Err(error) => error.to_string(),
        Ok(Err(error)) => error.to_string(),
        Ok(Ok(_)) => "fine".into(),
    }
}

#[test]
fn a_small_file_is_read_with_any_line_ends_and_unknown_sections() {
    let text = format!("{HEAD}$Periodic\n$$ 1 2\n$EndPeriodic\n{NODES}{ELEMENTS}");
    assert_eq!(message(&text), "fine");
    assert_eq!(message(&text.replace('\n', "\r\n")), "fine");
    assert_eq!(message(&text.replace("9", "900000000000")), "fine");
}

/// Two triangles, each a partition of surface 1, and an edge of curve 2: the groups stand at the entities of the partitions.
#[test]
fn the_groups_of_a_partitioned_file_are_those_of_its_partitions() {
    let entities = "$Entities\n0 1 1 0\n2 1 0 0 1 1 0 1 3 0\n1 0 0 0 1 1 0 1 7 0\n$EndEntities\n";
    let parts = "$PartitionedEntities\n2\n1\n9 1\n0 2 2 0\n3 1 2 1 1 1 0 0 1 1 0 1 3 0\n\
                 4 2 1 2 1 2 0 0 0 1 1 0 0 0\n2 2 1 1 1 0 0 0 1 1 0 1 7 1 3\n3 2 1 1 2 0 0 0 1 1 0 1 7 0\n$EndPartitionedEntities\n";
    let nodes = "$Nodes\n1 4 1 4\n2 2 0 4\n1\n2\n3\n4\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n$EndNodes\n";
    let elements =
        "$Elements\n4 4 1 4\n1 3 1 1\n1 2 3\n1 4 1 1\n2 1 3\n2 2 2 1\n3 1 2 3\n2 3 2 1\n4 1 3 4\n$EndElements\n";
    let names = "$PhysicalNames\n2\n1 3 \"right\"\n2 7 \"plate\"\n$EndPhysicalNames\n";
    let head = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n";
    let mesh =
        Mesh::from_raw(parse_mesh(format!("{head}{names}{entities}{parts}{nodes}{elements}").as_bytes()).unwrap())
            .unwrap();
    let topology = Topology::new(&mesh).unwrap();
    assert_eq!(mesh.groups().len(), 2);
    assert_eq!((measure(&mesh, &topology, "plate"), measure(&mesh, &topology, "right")), (1.0, 1.0));
}

#[test]
fn errors_name_the_place() {
    let file = |nodes: &str, elements: &str| message(&format!("{HEAD}{nodes}{elements}"));
    let n = |from, to| file(&NODES.replace(from, to), ELEMENTS);
    let e = |from, to| file(NODES, &ELEMENTS.replace(from, to));
    assert_eq!(n("9 0 1", "8 0 1"), "element 5 uses node 9, which is not in the file");
    assert_eq!(n("9 0 1", "2 0 1"), "node 2 is given twice");
    assert_eq!(n("9 0 1", "9 0 nan"), "line 8: a coordinate of node 9 is NaN");
    assert_eq!(n("9 0 1", "9 0 1e999"), "line 8: a coordinate of node 9 is inf");
    assert_eq!(n("9 0 1", "9 0 x1"), "line 8: found `x1`, needed a coordinate");
    assert_eq!(n("$Nodes\n3", "$Nodes\n4"), "line 9: found `$EndNodes`, needed the number of a node");
    assert_eq!(n("$Nodes\n3", "$Nodes\n2"), "line 8: found `9`, needed $EndNodes");
    assert_eq!(n("$Nodes\n3", "$Nodes\n-3"), "line 5: found `-3`, needed the number of nodes");
    assert_eq!(
        e("5 2 2", "5 21 2"),
        "line 12: element 5 is a line or triangle of higher order (Gmsh type 21), which is not supported; write the mesh \
         with `Mesh.ElementOrder = 2`: `gmsh part.geo -3 -order 2 -o part.msh`"
    );
    assert_eq!(e("1 1 2 9", "1 1 2"), "line 13: found `$EndElements`, needed a node of an element");
    assert_eq!(e("1 2 9", "2 1 9"), "element 5 is inside out: its jacobian determinant is -1e0 everywhere checked");
    assert_eq!(e("\n1\n5", "\n0\n"), "line 12: found `2`, needed $EndElements");
    assert_eq!(file(NODES, ""), "the file has no $Elements section");
    assert_eq!(
        n("9 0 1 0", "9 0 1 1"),
        "the cells have dimension 2 but node 9 lies outside the plane of x and y: a body in space needs cells of its \
         volume, a mesh of dimension 2 must be flat"
    );
    assert_eq!(
        message("cube"),
        "not a mesh file of a known format (Gmsh 2.2 and 4.1, input files of Abaqus and CalculiX, and .vtu are read)"
    );
    assert_eq!(
        message("$MeshFormat\n4 0 8\n"),
        "Gmsh file format 4 is not read, save the mesh as 2.2 or 4.1: `gmsh part.msh -save -format msh41 -o new.msh`"
    );
    assert_eq!(message(&format!("{HEAD}$Nodes\n")), "line 5: the file ends where the number of nodes is needed");
}

#[test]
fn copies_of_an_element_for_several_groups_are_one_cell() {
    let elements = "$Elements\n2\n1 2 2 7 1 1 2 9\n2 2 2 8 1 1 2 9\n$EndElements\n";
    let raw = parse_mesh(format!("{HEAD}{NODES}{elements}").as_bytes()).unwrap();
    assert_eq!(raw.kinds.len(), 1);
    let cells = |i: usize| raw.groups[i].entities.clone();
    assert_eq!(cells(0), GroupEntities::Cells(vec![CellId::new(0)]));
    assert_eq!(cells(0), cells(1));
}

/// Any cut and any changed byte gives a mesh or an error, and never a panic or a runaway
/// allocation; a cut before the end of the elements is always an error.
#[test]
fn damaged_files_are_errors() {
    for (name, contents) in FILES {
        for bytes in contents {
            let last = bytes.windows(12).rposition(|w| w == b"$EndElements").unwrap();
            for cut in (0..last).step_by(1 + last / 200) {
                assert!(parse_mesh(&bytes[..cut]).is_err(), "{name} cut at {cut}");
            }
            let mut state = 99u64;
            for _ in 0..300 {
                let mut damaged = bytes.to_vec();
                for _ in 0..2 {
                    state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                    let at = (state >> 33) as usize % damaged.len();
                    damaged[at] = (state >> 20) as u8;
                }
                if let Ok(raw) = parse_mesh(&damaged) {
                    let _ = Mesh::from_raw(raw).map(|mesh| Topology::new(&mesh).is_ok());
                }
            }
        }
    }
}
