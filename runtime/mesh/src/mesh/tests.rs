use super::*;
use crate::quadrature::{facet_points, rule};

const SHAPES: [(usize, BoxShape); 5] = [
    (1, BoxShape::Segment),
    (2, BoxShape::Triangle),
    (2, BoxShape::Quadrilateral),
    (3, BoxShape::Tetrahedron),
    (3, BoxShape::Hexahedron),
];

fn boxed(dim: usize, shape: BoxShape, cells: [usize; 3]) -> Mesh {
    generate_box([-1.0, 0.0, 2.0], [1.0, 4.0, 2.5], cells, dim, shape).unwrap()
}

fn single(kind: CellKind, nodes: &[[f64; 3]]) -> RawMesh {
    RawMesh {
        dim: kind.dim(),
        order: 1,
        nodes: nodes.to_vec(),
        kinds: vec![kind],
        connectivity: (0..nodes.len() as u32).collect(),
        ..RawMesh::default()
    }
}

/// One reference cell of each kind, moved by `map`.
fn cells_of(map: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<RawMesh> {
    let kinds = CellKind::ALL.into_iter().skip(1);
    kinds
        .map(|kind| {
            let nodes: Vec<[f64; 3]> = kind.vertices().iter().map(|v| map(*v)).collect();
            single(kind, &nodes)
        })
        .collect()
}

fn cell_set(mesh: &Mesh, condition: impl Fn([f64; 3]) -> bool) -> Vec<CellId> {
    match pick_cells(mesh, None, |x| Ok::<_, ()>(condition(x))) {
        Ok(RegionSet::Cells(cells)) => cells,
        other => panic!("{other:?}"),
    }
}

fn faces(region: RegionSet) -> Vec<InterfaceFacet> {
    match region {
        RegionSet::Interface(facets) => facets,
        other => panic!("{other:?}"),
    }
}

#[test]
fn boxes_have_the_right_volume_and_euler_characteristic() {
    for (dim, shape) in SHAPES {
        let mesh = boxed(dim, shape, [3, 2, 4]);
        let topology = Topology::new(&mesh).unwrap();
        let cells: Vec<CellId> = mesh.cells().collect();
        let volume: f64 = cell_volumes(&mesh, &cells).iter().sum();
        assert!((volume - [2.0, 8.0, 4.0][dim - 1]).abs() < 1e-12, "{shape:?}");
        let (v, f, c) = (mesh.n_nodes(), topology.n_facets(), mesh.n_cells());
        let e = topology.edges(&mesh).edges().len();
        let euler = match dim {
            1 => v as i64 - c as i64,
            2 => (v + c) as i64 - f as i64,
            _ => (v + f) as i64 - (e + c) as i64,
        };
        assert_eq!(euler, 1, "{shape:?}");
        let area: f64 = facet_measures(&mesh, &outer_boundary(&topology)).iter().sum();
        let expected = [2.0, 12.0, 2.0 * (2.0 * 4.0 + 2.0 * 0.5 + 4.0 * 0.5)][dim - 1];
        assert!((area - expected).abs() < 1e-12, "{shape:?} {area}");
        assert_eq!(mesh.warnings(), &MeshWarnings::default());
    }
}

#[test]
fn nodes_of_a_box_are_lexicographic_and_meet_whole_numbers() {
    let mesh = boxed(3, BoxShape::Hexahedron, [2, 4, 1]);
    assert_eq!(mesh.nodes()[..3], [[-1.0, 0.0, 2.0], [0.0, 0.0, 2.0], [1.0, 0.0, 2.0]]);
    assert_eq!(mesh.nodes()[3], [-1.0, 1.0, 2.0]);
    assert_eq!(mesh.nodes()[29], [1.0, 4.0, 2.5]);
    assert_eq!(cells_for_size([-1.0, 0.0, 0.0], [1.0, 4.0, 1.0], 0.25, 3), Ok([8, 16, 4]));
    assert_eq!(cells_for_size([0.0; 3], [1.0; 3], 0.3, 2), Ok([4, 4, 1]));
}

#[test]
fn impossible_boxes_are_errors() {
    let make = |to: f64, n: usize, shape| generate_box([0.0; 3], [to; 3], [n; 3], 2, shape);
    let bad = |result: Result<Mesh, MeshError>| matches!(result, Err(MeshError::BadBox { .. }));
    assert!(bad(make(0.0, 1, BoxShape::Triangle)));
    assert!(bad(make(f64::NAN, 1, BoxShape::Triangle)));
    assert!(bad(make(1.0, 0, BoxShape::Triangle)));
    assert!(bad(make(1.0, 1, BoxShape::Hexahedron)));
    let huge = make(1.0, 100_000, BoxShape::Quadrilateral);
    assert_eq!(huge.unwrap_err(), MeshError::TooLarge { nodes: 100_001 * 100_001 });
    assert!(cells_for_size([0.0; 3], [1.0; 3], 0.0, 1).is_err());
    assert!(cells_for_size([0.0; 3], [1.0; 3], f64::NAN, 1).is_err());
}

#[test]
fn a_node_map_moves_nodes_and_is_checked() {
    let mesh = boxed(2, BoxShape::Quadrilateral, [2, 2, 1]);
    let sheared = map_nodes(mesh.clone(), |x| Ok::<_, ()>([x[0] + 0.1 * x[1], x[1], 0.0])).unwrap();
    let cells: Vec<CellId> = sheared.cells().collect();
    assert!((cell_volumes(&sheared, &cells).iter().sum::<f64>() - 8.0).abs() < 1e-12);
    let mirrored = map_nodes(mesh.clone(), |x| Ok::<_, ()>([-x[0], x[1], 0.0]));
    assert!(matches!(mirrored, Err(MapError::Mesh(MeshError::Inverted { .. }))));
    assert_eq!(map_nodes(mesh, |_| Err(7)).unwrap_err(), MapError::Map(7));
}

#[test]
fn defects_of_structure_are_named() {
    let good = single(CellKind::Triangle, &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert!(Mesh::from_raw(good.clone()).is_ok());
    let broken = |change: &dyn Fn(&mut RawMesh)| {
        let mut raw = good.clone();
        change(&mut raw);
        Mesh::from_raw(raw).unwrap_err().to_string()
    };
    let messages = [
        broken(&|raw| raw.nodes[2][1] = f64::NAN),
        broken(&|raw| raw.connectivity[1] = 9),
        broken(&|raw| raw.connectivity[1] = 0),
        broken(&|raw| raw.kinds[0] = CellKind::Segment),
        broken(&|raw| raw.connectivity.push(1)),
        broken(&|raw| raw.kinds.clear()),
        broken(&|raw| raw.order = 3),
        broken(&|raw| {
            raw.groups.push(Group { name: "top".into(), dim: 2, entities: GroupEntities::Cells(vec![CellId::new(1)]) });
        }),
    ];
    assert_eq!(
        messages,
        [
            "coordinate y of node 2 is NaN",
            "cell 0 uses node 9, but there are only 3 nodes",
            "cell 0 lists node 0 twice",
            "cell 0 is a segment in a mesh of dimension 2",
            "the cells need 3 node numbers, 4 are given",
            "the mesh has no cells",
            "a mesh of dimension 2 and order 3 is not supported (1 to 3, 1 or 2)",
            "group `top` names a cell that the mesh does not have",
        ]
    );
}

/// The verdict on a cell depends on its shape, not on its size, place or unit.
#[test]
fn cells_are_judged_alike_at_every_scale() {
    for scale in [1e-30, 1.0, 1e30] {
        for raw in cells_of(|x| x.map(|c| c * scale)) {
            assert!(Mesh::from_raw(raw).is_ok(), "{scale}");
        }
        for raw in cells_of(|x| [-x[0] * scale, x[1] * scale, x[2] * scale]) {
            let error = Mesh::from_raw(raw).unwrap_err();
            assert!(matches!(error, MeshError::Inverted { .. }), "{scale} {error}");
        }
        for raw in cells_of(|x| [scale * 1e-14 * x[0], scale * x[1], scale * (x[2] + 3.0 * x[0])]) {
            if raw.dim == 2 {
                continue;
            }
            let verdict = Mesh::from_raw(raw.clone());
            let flat = matches!(verdict, Err(MeshError::ZeroVolume { .. }));
            assert!(flat || raw.dim == 1, "{scale} {verdict:?}");
        }
    }
    // Long and thin is not flat, and a far away mesh is not noise.
    for raw in cells_of(|x| [1e-6 * x[0], x[1], 1e6 * x[2]]) {
        assert!(Mesh::from_raw(raw).is_ok());
    }
    for raw in cells_of(|x| x.map(|c| c + 1e6)) {
        assert!(Mesh::from_raw(raw).is_ok());
    }
    // Nodes that differ only by rounding make no cell.
    for raw in cells_of(|x| [1.0 + 4e-16 * x[0], 1.0 + x[1], x[2]]) {
        assert!(matches!(Mesh::from_raw(raw), Err(MeshError::ZeroVolume { .. })));
    }
}

#[test]
fn a_folded_cell_reports_the_worst_point_and_its_region() {
    let mut nodes: Vec<[f64; 3]> = CellKind::Quadrilateral.vertices().to_vec();
    nodes[3] = [0.2, 0.2, 0.0];
    let mut raw = single(CellKind::Quadrilateral, &nodes);
    raw.groups.push(Group { name: "rock".into(), dim: 2, entities: GroupEntities::Cells(vec![CellId::new(0)]) });
    match Mesh::from_raw(raw).unwrap_err() {
        MeshError::Folded { group, determinant, point, .. } => {
            assert_eq!(group.as_deref(), Some("rock"));
            assert_eq!(point, nodes[3]);
            // Edges at the inner corner: (0.2, -0.8) and (-0.8, 0.2).
            assert!((determinant + 0.6).abs() < 1e-14);
        }
        other => panic!("{other}"),
    }
}

#[test]
fn duplicate_nodes_of_one_body_and_loose_nodes_are_listed() {
    // Two triangles of a strip, whose shared edge has one node twice.
    let nodes = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1e-9, 0.0], [7.0, 7.0, 0.0]];
    let raw = RawMesh {
        dim: 2,
        order: 1,
        nodes,
        kinds: vec![CellKind::Triangle; 2],
        connectivity: vec![0, 1, 2, 4, 3, 2],
        ..RawMesh::default()
    };
    let mesh = Mesh::from_raw(raw).unwrap();
    let warnings = mesh.warnings();
    assert_eq!(warnings.duplicate_nodes, [(NodeId::new(1), NodeId::new(4))]);
    assert_eq!(warnings.unused_nodes, [NodeId::new(5)]);
    // Two bodies that touch are no duplicates.
    assert_eq!(two_boxes([2, 2, 2], [2, 2, 2], BoxShape::Hexahedron, 0.0).warnings(), &MeshWarnings::default());
}

#[test]
fn three_cells_at_a_facet_and_twin_cells_are_errors() {
    let raw = |connectivity: Vec<u32>| RawMesh {
        dim: 1,
        order: 1,
        nodes: (0..4).map(|i| [f64::from(i), 0.0, 0.0]).collect(),
        kinds: vec![CellKind::Segment; connectivity.len() / 2],
        connectivity,
        ..RawMesh::default()
    };
    let topology = |raw| Topology::new(&Mesh::from_raw(raw).unwrap()).map(|_| ());
    let cells = [0, 1, 2].map(|c| CellName::Cell(CellId::new(c))).to_vec();
    assert_eq!(topology(raw(vec![0, 1, 1, 2, 1, 3])), Err(MeshError::NonManifold { cells }));
    let [first, second] = [0, 1].map(|c| CellName::Cell(CellId::new(c)));
    assert_eq!(topology(raw(vec![0, 1, 0, 1])), Err(MeshError::DuplicateCell { first, second }));
}

/// Every kind of cell: a second one, half as high on the same facet, has a positive volume and is refused.
#[test]
fn cells_on_one_side_of_their_common_facet_are_errors() {
    for kind in CellKind::ALL.into_iter().skip(1) {
        let axis = kind.dim() - 1;
        let mut raw = single(kind, kind.vertices());
        for (vertex, x) in kind.vertices().iter().enumerate() {
            let on_it = x[axis] == 0.0;
            raw.connectivity.push(if on_it { vertex as u32 } else { raw.nodes.len() as u32 });
            if !on_it {
                let mut lower = *x;
                lower[axis] = 0.5;
                raw.nodes.push(lower);
            }
        }
        raw.kinds.push(kind);
        let found = Topology::new(&Mesh::from_raw(raw).unwrap());
        assert!(matches!(found, Err(MeshError::FoldedOver { .. })), "{kind}: {:?}", found.err());
    }
}

/// The middle of a common edge is one place; two nodes there are no gap.
#[test]
fn other_middle_nodes_of_a_common_facet_are_an_error_where_they_are_elsewhere() {
    let second_of = |x: f64| {
        let mesh =
            second_order(generate_box([0.0; 3], [1.0; 3], [2, 1, 1], 2, BoxShape::Quadrilateral).unwrap()).unwrap();
        let mut raw = mesh.into_raw();
        let shared = raw.nodes.iter().position(|x| distance(*x, [0.5, 0.5, 0.0]) < 1e-12).unwrap() as u32;
        let doubled = raw.nodes.len() as u32;
        let half = raw.connectivity.len() / 2;
        raw.connectivity[half..].iter_mut().filter(|n| **n == shared).for_each(|n| *n = doubled);
        raw.nodes.push([x, 0.5, 0.0]);
        Topology::new(&Mesh::from_raw(raw).unwrap()).map(|_| ())
    };
    assert_eq!(second_of(0.5), Ok(()));
    let error = second_of(0.53).unwrap_err();
    assert!(matches!(error, MeshError::MiddleNodes { .. }), "{error}");
}

#[test]
fn the_topology_knows_both_sides() {
    for (dim, shape) in SHAPES {
        let mesh = boxed(dim, shape, [3, 3, 2]);
        let topology = Topology::new(&mesh).unwrap();
        for (id, facet) in topology.facets().iter().enumerate() {
            let id = FacetId::new(id);
            assert_eq!(topology.facet_id(facet.here), id);
            let vertices = mesh.facet_vertices(facet.here);
            assert_eq!(topology.find_facet(&mesh, vertices.vertices()), Some(id));
            let Some(there) = facet.there else { continue };
            assert!(facet.here.cell < there.cell);
            assert_eq!(topology.facet_id(there), id);
            assert_eq!(topology.opposite(there), Some(facet.here));
            let mut ours = vertices.vertices().to_vec();
            let mut theirs = mesh.facet_vertices(there).vertices().to_vec();
            ours.sort();
            theirs.sort();
            assert_eq!(ours, theirs);
        }
        assert_eq!(topology.find_facet(&mesh, &[NodeId::new(mesh.n_nodes() - 1), NodeId::new(0)]), None);
        for cell in mesh.cells() {
            for (local, edge) in topology.edges(&mesh).cell_edges(cell).iter().enumerate() {
                let mut ends = mesh.kind(cell).edges()[local].map(|v| mesh.cell_vertices(cell)[v]);
                ends.sort();
                assert_eq!(topology.edges(&mesh).edges()[edge.index()], ends);
            }
        }
    }
}

#[test]
fn set_operations_are_those_of_sets() {
    let set = |members: &[usize]| RegionSet::Nodes(members.iter().map(|m| NodeId::new(*m)).collect());
    let (a, b) = (set(&[1, 2, 5, 9]), set(&[0, 2, 9, 11]));
    assert_eq!(a.union(&b).unwrap(), set(&[0, 1, 2, 5, 9, 11]));
    assert_eq!(a.difference(&b).unwrap(), set(&[1, 5]));
    assert_eq!(a.intersection(&b).unwrap(), set(&[2, 9]));
    assert_eq!(a.difference(&set(&[])).unwrap(), a);
    assert!(a.intersection(&set(&[])).unwrap().is_empty());
    let error = a.union(&RegionSet::Cells(vec![])).unwrap_err();
    assert_eq!(error.to_string(), "a region of nodes cannot be combined with a region of cells");
}

#[test]
fn boundaries_and_interfaces_have_the_right_side() {
    for (dim, shape) in SHAPES {
        let mesh = boxed(dim, shape, [4, 4, 4]);
        let topology = Topology::new(&mesh).unwrap();
        let (near, far) = (cell_set(&mesh, |x| x[0] < 0.0), cell_set(&mesh, |x| x[0] > 0.0));
        let fault = faces(interface(&mesh, &topology, &far, &near).unwrap());
        let flat = |side: fn(&InterfaceFacet) -> FacetRef| -> Vec<FacetRef> { fault.iter().map(side).collect() };
        let area: f64 = facet_measures(&mesh, &flat(|f| f.here)).iter().sum();
        assert!((area - [1.0, 4.0, 2.0][dim - 1]).abs() < 1e-12);
        for facet in &fault {
            assert!(mesh.centroid(facet.here.cell)[0] > 0.0);
            assert!(mesh.centroid(facet.there.cell)[0] < 0.0);
            assert_eq!(topology.opposite(facet.here), Some(facet.there));
        }
        let border = boundary_of(&mesh, &topology, &near);
        assert!(border.iter().all(|f| near.contains(&f.cell)));
        let Ok(RegionSet::Facets(inner)) = pick_facets(&mesh, &border, |x| Ok::<_, ()>(x[0].abs() < 1e-12)) else {
            panic!()
        };
        let mut theirs = flat(|f| f.there);
        theirs.sort();
        assert_eq!(inner, theirs);
        let error = interface(&mesh, &topology, &near, &near[..1]).unwrap_err();
        assert_eq!(error, RegionError::Overlap { cells: 1 });
    }
}

/// Two unit boxes side by side along x with separate nodes, the second shifted by `gap`.
fn two_boxes(n: [usize; 3], m: [usize; 3], shape: BoxShape, gap: f64) -> Mesh {
    let dim = shape.kind().dim();
    let first = generate_box([0.0; 3], [1.0; 3], n, dim, shape).unwrap().into_raw();
    let second = generate_box([1.0 + gap, 0.0, 0.0], [2.0 + gap, 1.0, 1.0], m, dim, shape);
    let second = second.unwrap().into_raw();
    let mut raw = first;
    let shift = raw.nodes.len() as u32;
    raw.nodes.extend(second.nodes);
    raw.kinds.extend(second.kinds);
    raw.connectivity.extend(second.connectivity.iter().map(|n| n + shift));
    Mesh::from_raw(raw).unwrap()
}

#[test]
fn two_bodies_with_separate_nodes_meet_by_geometry() {
    for (dim, shape) in SHAPES {
        let mesh = two_boxes([3, 3, 3], [2, 3, 3], shape, 0.0);
        let topology = Topology::new(&mesh).unwrap();
        let (near, far) = (cell_set(&mesh, |x| x[0] < 1.0), cell_set(&mesh, |x| x[0] > 1.0));
        let fault = faces(interface(&mesh, &topology, &near, &far).unwrap());
        let per_square = if shape == BoxShape::Tetrahedron { 2 } else { 1 };
        assert_eq!(fault.len(), per_square * 3usize.pow(dim as u32 - 1), "{shape:?}");
        for facet in &fault {
            assert!(distance(mesh.facet_centroid(facet.here), mesh.facet_centroid(facet.there)) < 1e-12);
            assert_eq!(topology.opposite(facet.here), None);
            assert!(orientation(&mesh, facet.here, facet.there).is_ok());
        }
    }
}

#[test]
fn bodies_that_do_not_match_are_an_error_with_the_distance() {
    let check = |mesh: &Mesh| {
        let topology = Topology::new(mesh).unwrap();
        let (near, far) = (cell_set(mesh, |x| x[0] < 1.0), cell_set(mesh, |x| x[0] > 1.0));
        interface(mesh, &topology, &near, &far)
    };
    let mismatch = |result: Result<RegionSet, RegionError>| match result {
        Err(RegionError::Mesh(MeshError::NotMatching { largest_distance, .. })) => largest_distance,
        other => panic!("{other:?}"),
    };
    // 2 against 3 cells over the unit height: vertex 1/2 is 1/6 away from 1/3 and 2/3.
    for shape in [BoxShape::Quadrilateral, BoxShape::Triangle] {
        let found = mismatch(check(&two_boxes([2, 2, 1], [2, 3, 1], shape, 0.0)));
        assert!((found - 1.0 / 6.0).abs() < 1e-12, "{found}");
    }
    let found = mismatch(check(&two_boxes([2, 2, 2], [2, 2, 2], BoxShape::Hexahedron, 1e-3)));
    assert!((found - 1e-3).abs() < 1e-12);
    let apart = check(&two_boxes([2, 2, 2], [2, 2, 2], BoxShape::Hexahedron, 0.7)).unwrap();
    assert!(apart.is_empty());
}

#[test]
fn heights_and_sizes_have_their_meaning() {
    let mesh = boxed(3, BoxShape::Hexahedron, [2, 8, 4]);
    let topology = Topology::new(&mesh).unwrap();
    let boundary = outer_boundary(&topology);
    for (facet, height) in boundary.iter().zip(facet_heights(&mesh, &boundary)) {
        let axis = facet.local as usize / 2;
        assert!((height - [1.0, 0.5, 0.125][axis]).abs() < 1e-12);
    }
    let summary = summary(&mesh);
    assert!((summary.max_size - (1.0f64 + 0.25 + 0.015_625).sqrt()).abs() < 1e-12);
    assert!((summary.max_aspect - 8.0).abs() < 1e-12);
    for kind in [CellKind::Triangle, CellKind::Tetrahedron] {
        let mesh = Mesh::from_raw(single(kind, kind.vertices())).unwrap();
        let facets: Vec<FacetRef> = (0..kind.facets().len()).map(|i| FacetRef::new(CellId::new(0), i)).collect();
        for (local, height) in facet_heights(&mesh, &facets).into_iter().enumerate() {
            let normal = kind.facet_normal(local);
            let oblique = normal[0] > 0.0;
            let expected = if oblique { 1.0 / (kind.dim() as f64).sqrt() } else { 1.0 };
            assert!((height - expected).abs() < 1e-12, "{kind} {local} {height}");
        }
        let sizes = element_sizes(&mesh, &[CellId::new(0)]);
        assert!((sizes[0] - 2f64.sqrt()).abs() < 1e-15);
    }
}

/// A second-order triangle whose three edges bulge: its area is that of the chords plus two thirds
/// of chord times sagitta for each edge (area under a parabola).
#[test]
fn curved_cells_have_curved_volume() {
    let sagitta = 0.05;
    let root = 0.5f64.sqrt();
    let raw = RawMesh {
        dim: 2,
        order: 2,
        nodes: vec![
            [0.0; 3],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.5, -sagitta, 0.0],
            [0.5 + sagitta * root, 0.5 + sagitta * root, 0.0],
            [-sagitta, 0.5, 0.0],
        ],
        kinds: vec![CellKind::Triangle],
        connectivity: (0..6).collect(),
        ..RawMesh::default()
    };
    let mesh = Mesh::from_raw(raw).unwrap();
    let volume = cell_volumes(&mesh, &[CellId::new(0)])[0];
    let expected = 0.5 + 2.0 / 3.0 * sagitta * (2.0 + 2f64.sqrt());
    assert!((volume - expected).abs() < 1e-14, "{volume} {expected}");
    assert_eq!(mesh.cell_vertices(CellId::new(0)).len(), 3);
    assert_eq!(mesh.facet_centroid(FacetRef::new(CellId::new(0), 0)), [0.5, -sagitta, 0.0]);
}

#[test]
fn picking_needs_all_vertices_and_the_centre_and_passes_errors_on() {
    let mesh = boxed(2, BoxShape::Quadrilateral, [4, 4, 1]);
    let topology = Topology::new(&mesh).unwrap();
    let boundary = outer_boundary(&topology);
    let count = |limit: f64| {
        let picked = pick_facets(&mesh, &boundary, |x| Ok::<_, ()>(x[1] == 4.0 && x[0] <= limit));
        picked.unwrap().len()
    };
    assert_eq!((count(1.0), count(0.6), count(0.4)), (4, 3, 2));
    let nodes = pick_nodes(&mesh, Some(&[CellId::new(0)]), |x| Ok::<_, ()>(x[1] == 0.0)).unwrap();
    assert_eq!(nodes, RegionSet::Nodes(vec![NodeId::new(0), NodeId::new(1)]));
    assert_eq!(pick_cells(&mesh, None, |_| Err("stop")).unwrap_err(), "stop");
}

#[test]
fn groups_become_regions() {
    let mut raw = boxed(2, BoxShape::Triangle, [1, 1, 1]).into_raw();
    let facet = |a, b| GroupFacet { kind: CellKind::Segment, vertices: [b, a, a, a].map(NodeId::new) };
    raw.groups.push(Group { name: "low".into(), dim: 1, entities: GroupEntities::Facets(vec![facet(0, 1)]) });
    raw.groups.push(Group { name: "loose".into(), dim: 1, entities: GroupEntities::Facets(vec![facet(1, 2)]) });
    let mesh = Mesh::from_raw(raw).unwrap();
    let topology = Topology::new(&mesh).unwrap();
    let region = RegionSet::from_group(&mesh, &topology, &mesh.groups()[0]).unwrap();
    assert_eq!(region, RegionSet::Facets(vec![FacetRef::new(CellId::new(0), 0)]));
    let error = RegionSet::from_group(&mesh, &topology, &mesh.groups()[1]).unwrap_err();
    assert_eq!(error.to_string(), "group `loose` has 1 faces that belong to no cell");
}

#[test]
fn both_sides_of_every_inner_facet_see_the_same_points() {
    for (dim, shape) in [
        (1, BoxShape::Segment),
        (2, BoxShape::Triangle),
        (2, BoxShape::Quadrilateral),
        (3, BoxShape::Tetrahedron),
        (3, BoxShape::Hexahedron),
    ] {
        let mesh = generate_box([0.0; 3], [1.0, 2.0, 3.0], [2, 2, 2], dim, shape).unwrap();
        let topology = Topology::new(&mesh).unwrap();
        let physical = |facet: FacetRef, x: &[[f64; 3]]| -> Vec<[f64; 3]> {
            let table = mesh.geometry_element(mesh.kind(facet.cell)).tabulate(x, 0);
            (0..x.len()).map(|p| mesh.point_at(facet.cell, &table, p)).collect()
        };
        for facet in topology.facets() {
            let Some(there) = facet.there else { continue };
            let rule = rule(mesh.facet_kind(facet.here), 3).unwrap();
            let ours = facet_points(mesh.kind(facet.here.cell), facet.here.local as usize, &rule);
            let (_, theirs) = neighbour_points(&mesh, facet.here, there, &rule).unwrap();
            for (p, q) in physical(facet.here, &ours).iter().zip(physical(there, &theirs)) {
                assert!((0..3).all(|i| (p[i] - q[i]).abs() < 1e-13), "{shape:?} {p:?} {q:?}");
            }
        }
    }
}
