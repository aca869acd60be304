use std::collections::BTreeSet;

use super::*;
use crate::{
    mesh::{
        BoxShape, Group, GroupEntities, RegionSet, Topology, boundary_of, cell_volumes, facet_measures, generate_box,
        interface, outer_boundary, pick_cells,
    },
    vector::{difference, distance, dot, norm},
};

const SHAPES: [BoxShape; 5] =
    [BoxShape::Segment, BoxShape::Triangle, BoxShape::Quadrilateral, BoxShape::Tetrahedron, BoxShape::Hexahedron];

fn unit_box(shape: BoxShape, cells: [usize; 3]) -> Mesh {
    generate_box([0.0; 3], [1.0; 3], cells, shape.kind().dim(), shape).unwrap()
}

fn refiner(mesh: &Mesh) -> Refiner {
    Refiner::new(mesh.clone(), mesh).unwrap()
}

/// Marks of the cells with a vertex nearer to `x` than `radius`.
fn near(mesh: &Mesh, x: [f64; 3], radius: f64) -> Vec<Mark> {
    let is_near = |cell: &CellId| mesh.cell_vertices(*cell).iter().any(|n| distance(mesh.node(*n), x) <= radius);
    mesh.cells().filter(is_near).map(Mark::all).collect()
}

/// The sum with a correction for what each addition rounds away (Neumaier).
fn sum(parts: &[f64]) -> f64 {
    let (mut total, mut rest) = (0.0f64, 0.0);
    for part in parts {
        let next = total + part;
        rest += if total.abs() >= part.abs() { (total - next) + part } else { (part - next) + total };
        total = next;
    }
    total + rest
}

fn volume(mesh: &Mesh) -> f64 {
    let all: Vec<CellId> = mesh.cells().collect();
    sum(&cell_volumes(mesh, &all))
}

/// Area of the outer boundary: a node in the middle of an edge of a neighbour would leave inner faces without a partner.
fn surface(mesh: &Mesh) -> f64 {
    sum(&facet_measures(mesh, &outer_boundary(&Topology::new(mesh).unwrap())))
}

fn close(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance * a.abs().max(b.abs())
}

#[test]
fn a_refined_mesh_is_conforming_and_has_the_same_volume_and_boundary() {
    for shape in SHAPES {
        let mesh = unit_box(shape, [3, 2, 2]);
        let (v, s) = (volume(&mesh), surface(&mesh));
        let mut refiner = refiner(&mesh);
        for round in 0..4 {
            let marks = near(refiner.mesh(), [0.3, 0.4, 0.5], 0.2);
            let before = refiner.mesh().n_cells();
            let descent = refiner.refine(&marks).unwrap();
            let mesh = refiner.mesh();
            assert!(marks.is_empty() || mesh.n_cells() > before, "{shape:?} {round}");
            assert_eq!(descent.n_cells(), mesh.n_cells());
            assert!(close(volume(mesh), v, 1e-14), "{shape:?} {round}: {} {v}", volume(mesh));
            assert!(close(surface(mesh), s, 1e-14), "{shape:?} {round}: {} {s}", surface(mesh));
        }
    }
}

#[test]
fn a_marked_cell_is_halved_in_every_direction() {
    for shape in SHAPES {
        let mesh = unit_box(shape, [2, 2, 2]);
        let dim = mesh.dim();
        let marks: Vec<Mark> = mesh.cells().map(Mark::all).collect();
        let mut refiner = refiner(&mesh);
        let descent = refiner.refine(&marks).unwrap();
        assert_eq!(refiner.mesh().n_cells(), mesh.n_cells() << dim, "{shape:?}");
        let counts: BTreeSet<usize> =
            mesh.cells().map(|p| refiner.mesh().cells().filter(|c| descent.parent(*c) == p).count()).collect();
        assert_eq!(counts, BTreeSet::from([1 << dim]), "{shape:?}");
        let sizes = |mesh: &Mesh| mesh.cells().map(|c| mesh.cell_diameter(c)).fold(0.0, f64::max);
        assert!(close(sizes(refiner.mesh()), 0.5 * sizes(&mesh), 1e-14), "{shape:?}");
    }
}

#[test]
fn no_marks_leave_the_mesh_as_it_is() {
    for shape in SHAPES {
        let mesh = unit_box(shape, [2, 3, 2]);
        let mut refiner = refiner(&mesh);
        let descent = refiner.refine(&[]).unwrap();
        assert_eq!(refiner.mesh().nodes(), mesh.nodes());
        assert!(mesh.cells().all(|c| refiner.mesh().cell_nodes(c) == mesh.cell_nodes(c)));
        assert!(mesh.cells().all(|c| descent.is_whole(c) && descent.parent(c) == c));
    }
}

#[test]
fn a_part_lies_where_the_descent_says() {
    for shape in SHAPES {
        let mesh = unit_box(shape, [2, 2, 2]);
        let mut refiner = refiner(&mesh);
        refiner.refine(&near(&mesh, [0.5; 3], 0.1)).unwrap();
        let before = refiner.mesh().clone();
        let descent = refiner.refine(&near(&before, [0.4, 0.5, 0.6], 0.3)).unwrap();
        let mesh = refiner.mesh();
        for cell in mesh.cells() {
            let kind = mesh.kind(cell);
            for (vertex, place) in mesh.cell_vertices(cell).iter().zip(kind.vertices()) {
                let x = descent.place(cell, kind, *place);
                let parent = descent.parent(cell);
                let hats = kind.hat_values(x);
                let nodes = before.cell_vertices(parent);
                let at = std::array::from_fn(|i| nodes.iter().zip(hats).map(|(n, h)| h * before.node(*n)[i]).sum());
                assert!(distance(at, mesh.node(*vertex)) < 1e-15, "{shape:?} {cell:?}");
            }
        }
    }
}

/// Smallest ratio of inscribed to circumscribed size, in the sense of volume over longest edge to the power.
fn worst_shape(mesh: &Mesh) -> f64 {
    let all: Vec<CellId> = mesh.cells().collect();
    let volumes = cell_volumes(mesh, &all);
    let ratio = |(cell, v): (&CellId, &f64)| v / mesh.cell_diameter(*cell).powi(mesh.dim() as i32);
    all.iter().zip(&volumes).map(ratio).fold(f64::INFINITY, f64::min)
}

/// Classes of similar simplices: edge lengths in order, relative to the longest.
fn classes(mesh: &Mesh) -> usize {
    let mut seen = BTreeSet::new();
    for cell in mesh.cells() {
        let nodes = mesh.cell_vertices(cell);
        let mut lengths: Vec<f64> = Vec::new();
        for [a, b] in mesh.kind(cell).edges() {
            lengths.push(distance(mesh.node(nodes[*a]), mesh.node(nodes[*b])));
        }
        lengths.sort_by(f64::total_cmp);
        let longest = lengths[lengths.len() - 1];
        let key: Vec<i64> = lengths.iter().map(|l| (l / longest * 1e6).round() as i64).collect();
        seen.insert(key);
    }
    seen.len()
}

#[test]
fn twenty_rounds_to_a_corner_keep_the_shapes_of_a_regular_mesh() {
    for (shape, most, allowed) in [(BoxShape::Triangle, 1, 0.99), (BoxShape::Tetrahedron, 3, 0.3)] {
        let mesh = unit_box(shape, [2, 2, 2]);
        let worst = worst_shape(&mesh);
        let mut refiner = refiner(&mesh);
        for _ in 0..20 {
            refiner.refine(&near(refiner.mesh(), [0.0; 3], 0.0)).unwrap();
        }
        let mesh = refiner.mesh();
        assert!(classes(mesh) <= most, "{shape:?}: {} classes", classes(mesh));
        assert!(worst_shape(mesh) >= allowed * worst, "{shape:?}: {} of {worst}", worst_shape(mesh));
        assert!(mesh.n_cells() < 8000, "{shape:?}: {}", mesh.n_cells());
    }
}

/// One simplex of no symmetry at all.
fn crooked(kind: CellKind) -> Mesh {
    let nodes = [[0.0, 0.0, 0.0], [1.3, 0.1, 0.05], [0.2, 0.9, -0.1], [0.35, 0.25, 0.7]];
    let n = kind.n_vertices();
    Mesh::from_raw(RawMesh {
        dim: kind.dim(),
        order: 1,
        nodes: nodes[..n].to_vec(),
        kinds: vec![kind],
        connectivity: (0..n as u32).collect(),
        ..RawMesh::default()
    })
    .unwrap()
}

#[test]
fn the_parts_of_any_simplex_have_few_shapes() {
    // four of a triangle (Mitchell 1989), 72 of a tetrahedron (Arnold, Mukherjee and Pouly 2000, theorem 4.5)
    for (kind, rounds, most) in [(CellKind::Triangle, 6, 4), (CellKind::Tetrahedron, 5, 72)] {
        let mut refiner = refiner(&crooked(kind));
        for _ in 0..rounds {
            let marks: Vec<Mark> = refiner.mesh().cells().map(Mark::all).collect();
            refiner.refine(&marks).unwrap();
        }
        let found = classes(refiner.mesh());
        assert!(found <= most, "{kind}: {found}");
    }
}

#[test]
fn forty_rounds_into_a_corner_end_with_cells_of_its_size() {
    for shape in SHAPES {
        let mesh = unit_box(shape, [1, 1, 1]);
        let mut refiner = refiner(&mesh);
        for _ in 0..40 {
            let marks: Vec<Mark> = near(refiner.mesh(), [0.0; 3], 0.0);
            // layers of cells meet in the corner: one direction keeps their number small
            let marks = marks.into_iter().map(|m| match shape {
                BoxShape::Hexahedron => Mark { axes: Axes::of(&[2]), ..m },
                _ => m,
            });
            refiner.refine(&marks.collect::<Vec<_>>()).unwrap();
        }
        let mesh = refiner.mesh();
        let smallest = near(mesh, [0.0; 3], 0.0).into_iter().map(|m| mesh.cell_vertices(m.cell).to_vec());
        let height = smallest.map(|nodes| {
            let axis = mesh.dim() - 1;
            nodes.iter().map(|n| mesh.node(*n)[axis]).fold(0.0, f64::max)
        });
        assert_eq!(height.fold(f64::INFINITY, f64::min), 0.5f64.powi(40), "{shape:?}");
        assert!(close(volume(mesh), 1.0, 1e-13), "{shape:?}");
    }
}

#[test]
fn cells_below_the_rounding_of_their_coordinates_are_an_error() {
    let mut refiner = refiner(&unit_box(BoxShape::Segment, [1, 1, 1]));
    let error = (0..80).find_map(|_| {
        let marks = near(refiner.mesh(), [1.0, 0.0, 0.0], 0.0);
        refiner.refine(&marks).err()
    });
    assert!(matches!(error, Some(MeshError::ZeroVolume { .. })), "{error:?}");
}

#[test]
fn one_axis_of_a_box_is_halved_in_whole_layers() {
    let mesh = unit_box(BoxShape::Hexahedron, [2, 3, 4]);
    let mut refiner = refiner(&mesh);
    refiner.refine(&[Mark { cell: CellId::new(0), axes: Axes::of(&[1]) }]).unwrap();
    assert_eq!(refiner.mesh().n_cells(), 2 * 4 * 4);
    let mesh = refiner.mesh().clone();
    refiner.refine(&[Mark { cell: CellId::new(0), axes: Axes::of(&[0, 2]) }]).unwrap();
    assert_eq!(refiner.mesh().n_cells(), 3 * 4 * 5);
    assert!(close(volume(&mesh), 1.0, 1e-14) && close(surface(refiner.mesh()), 6.0, 1e-14));
}

#[test]
fn triangles_and_quadrilaterals_of_one_mesh_stay_conforming() {
    // a strip: two squares with two triangles between them
    let nodes = [[0., 0.], [1., 0.], [2., 0.], [3., 0.], [0., 1.], [1., 1.], [2., 1.], [3., 1.]];
    let raw = RawMesh {
        dim: 2,
        order: 1,
        nodes: nodes.map(|[x, y]| [x, y, 0.0]).to_vec(),
        kinds: vec![CellKind::Quadrilateral, CellKind::Triangle, CellKind::Triangle, CellKind::Quadrilateral],
        connectivity: vec![0, 1, 4, 5, 1, 2, 6, 1, 6, 5, 2, 3, 6, 7],
        ..RawMesh::default()
    };
    let mesh = Mesh::from_raw(raw).unwrap();
    let mut refiner = refiner(&mesh);
    for _ in 0..4 {
        refiner.refine(&near(refiner.mesh(), [1.0, 1.0, 0.0], 0.3)).unwrap();
        assert!(close(volume(refiner.mesh()), 3.0, 1e-14) && close(surface(refiner.mesh()), 8.0, 1e-14));
    }
}

/// The two boxes `x < 1` and `x > 1` with nodes of their own.
fn two_bodies(shape: BoxShape) -> Mesh {
    let dim = shape.kind().dim();
    let half = |from: f64| {
        let ([a, b], n) = ([from, from + 1.0], [1, 2, 2]);
        generate_box([a, 0.0, 0.0], [b, 1.0, 1.0], n, dim, shape).unwrap().into_raw()
    };
    let (mut raw, right) = (half(0.0), half(1.0));
    let shift = raw.nodes.len() as u32;
    // rounding of another program: far below the tolerance of matching faces
    raw.nodes.extend(right.nodes.iter().map(|x| x.map(|c| c * (1.0 + 1e-12))));
    raw.kinds.extend(right.kinds);
    raw.connectivity.extend(right.connectivity.iter().map(|n| n + shift));
    Mesh::from_raw(raw).unwrap()
}

#[test]
fn bodies_that_touch_without_common_nodes_are_refined_together() {
    for shape in SHAPES {
        let mesh = two_bodies(shape);
        let mut refiner = refiner(&mesh);
        for _ in 0..4 {
            // the left body alone is marked
            let marks = near(refiner.mesh(), [0.99, 0.3, 0.3], 0.5);
            let left: Vec<Mark> = marks.into_iter().filter(|m| refiner.mesh().centroid(m.cell)[0] < 1.0).collect();
            refiner.refine(&left).unwrap();
        }
        let mesh = refiner.mesh();
        let topology = Topology::new(mesh).unwrap();
        let side = |left: bool| {
            let cells = pick_cells(mesh, None, |x| Ok::<_, MeshError>((x[0] < 1.0) == left)).unwrap();
            let RegionSet::Cells(cells) = cells else { panic!("cells are picked") };
            cells
        };
        let (left, right) = (side(true), side(false));
        let pairs = interface(mesh, &topology, &left, &right).unwrap();
        let RegionSet::Interface(pairs) = pairs else { panic!("an interface is made") };
        let here: Vec<_> = pairs.iter().map(|p| p.here).collect();
        assert!(close(sum(&facet_measures(mesh, &here)), 1.0, 1e-9), "{shape:?}");
        assert!(pairs.len() > 2 || mesh.dim() == 1, "{shape:?}");
        // all of the boundary of the left body at x = 1 is in a pair
        let open = boundary_of(mesh, &topology, &left).into_iter();
        let at_the_plane = open.filter(|f| (mesh.facet_centroid(*f)[0] - 1.0).abs() < 1e-9).count();
        assert_eq!(at_the_plane, pairs.len(), "{shape:?}");
    }
}

#[test]
fn groups_of_cells_faces_and_edges_have_the_parts_of_their_members() {
    let mesh = unit_box(BoxShape::Tetrahedron, [2, 2, 2]);
    let topology = Topology::new(&mesh).unwrap();
    let at = |n: &NodeId| mesh.node(*n);
    let top = outer_boundary(&topology).into_iter().map(|f| mesh.facet_vertices(f));
    let top: Vec<GroupFacet> = top.filter(|f| f.vertices().iter().all(|n| at(n)[2] == 1.0)).collect();
    let middle = topology.facets().iter().map(|f| mesh.facet_vertices(f.here));
    let middle: Vec<GroupFacet> = middle.filter(|f| f.vertices().iter().all(|n| at(n)[0] == 0.5)).collect();
    let on_axis = |n: &NodeId| at(n)[0] == 0.0 && at(n)[1] == 0.0;
    let edges: Vec<[NodeId; 2]> =
        topology.edges(&mesh).edges().iter().copied().filter(|e| e.iter().all(on_axis)).collect();
    let nodes: Vec<NodeId> = (0..mesh.n_nodes()).map(NodeId::new).filter(on_axis).collect();
    let cells: Vec<CellId> = mesh.cells().filter(|c| mesh.centroid(*c)[0] < 0.5).collect();
    let mut raw = mesh.clone().into_raw();
    let group = |name: &str, dim, entities| Group { name: name.to_owned(), dim, entities };
    raw.groups = vec![
        group("half", 3, GroupEntities::Cells(cells)),
        group("top", 2, GroupEntities::Facets(top)),
        group("middle", 2, GroupEntities::Facets(middle)),
        group("axis", 1, GroupEntities::Nodes { nodes, edges }),
    ];
    let mesh = Mesh::from_raw(raw).unwrap();
    let mut refiner = refiner(&mesh);
    for _ in 0..3 {
        refiner.refine(&near(refiner.mesh(), [0.2, 0.2, 0.8], 0.4)).unwrap();
    }
    let mesh = refiner.mesh();
    let topology = Topology::new(mesh).unwrap();
    for group in mesh.groups() {
        match RegionSet::from_group(mesh, &topology, group).unwrap() {
            RegionSet::Cells(cells) => {
                assert!(cells.iter().all(|c| mesh.centroid(*c)[0] < 0.5));
                assert!(close(sum(&cell_volumes(mesh, &cells)), 0.5, 1e-14));
            }
            RegionSet::Facets(facets) => {
                let (axis, at) = if group.name == "top" { (2, 1.0) } else { (0, 0.5) };
                assert!(facets.iter().all(|f| mesh.facet_centroid(*f)[axis] == at), "{}", group.name);
                assert!(close(sum(&facet_measures(mesh, &facets)), 1.0, 1e-14), "{}", group.name);
            }
            RegionSet::Nodes(nodes) => {
                let all = mesh.nodes().iter().filter(|x| x[0] == 0.0 && x[1] == 0.0).count();
                assert!(nodes.len() > 3 && nodes.len() == all, "{} of {all}", nodes.len());
            }
            RegionSet::Interface(_) | RegionSet::Edges(_) => panic!("a group is no interface"),
        }
    }
}

/// Order 2, with the nodes of the first-order mesh and those between moved by a quadratic map.
fn curved(shape: BoxShape) -> Mesh {
    let (mesh, kind) = (unit_box(shape, [2, 2, 2]), shape.kind());
    let element = crate::element::Element::lagrange(kind, 2, crate::element::Family::Continuous).unwrap();
    let bend = |x: [f64; 3]| [x[0] + 0.1 * x[1] * x[1], x[1] - 0.1 * x[0] * x[0], x[2]];
    let mut raw = RawMesh { dim: mesh.dim(), order: 2, kinds: mesh.kinds().to_vec(), ..RawMesh::default() };
    let mut known = std::collections::BTreeMap::new();
    for cell in mesh.cells() {
        let corners: Vec<[f64; 3]> = mesh.cell_vertices(cell).iter().map(|n| mesh.node(*n)).collect();
        for point in element.points() {
            let x = descent::within(kind, &corners, *point);
            let next = raw.nodes.len() as u32;
            let node = *known.entry(x.map(f64::to_bits)).or_insert(next);
            if node == next {
                raw.nodes.push(if mesh.dim() > 1 { bend(x) } else { x });
            }
            raw.connectivity.push(node);
        }
    }
    Mesh::from_raw(raw).unwrap()
}

#[test]
fn curved_cells_of_second_order_keep_their_geometry() {
    for shape in SHAPES {
        let mesh = curved(shape);
        let (v, s) = (volume(&mesh), surface(&mesh));
        let mut refiner = refiner(&mesh);
        for _ in 0..3 {
            let before = refiner.mesh().clone();
            let descent = refiner.refine(&near(&before, [0.5, 0.5, 0.4], 0.3)).unwrap();
            let mesh = refiner.mesh();
            // every geometry node lies where the map of the parent has it
            for cell in mesh.cells() {
                let (kind, parent) = (mesh.kind(cell), descent.parent(cell));
                let element = mesh.geometry_element(kind);
                let places: Vec<[f64; 3]> = element.points().iter().map(|x| descent.place(cell, kind, *x)).collect();
                let table = element.tabulate(&places, 0);
                for (k, node) in mesh.cell_nodes(cell).iter().enumerate() {
                    assert!(distance(before.point_at(parent, &table, k), mesh.node(*node)) < 1e-14, "{shape:?}");
                }
            }
            assert!(close(volume(mesh), v, 1e-14), "{shape:?}: {} {v}", volume(mesh));
            // the square root in the area of a curved face is integrated by a Gauss rule
            assert!(close(surface(mesh), s, 1e-3), "{shape:?}: {} {s}", surface(mesh));
        }
        let used: BTreeSet<NodeId> =
            refiner.mesh().cells().flat_map(|c| refiner.mesh().cell_nodes(c).to_vec()).collect();
        assert_eq!(used.len(), refiner.mesh().n_nodes(), "{shape:?}: a node is of no cell");
    }
}

#[test]
fn the_longest_edge_of_the_moved_mesh_is_halved_first() {
    let mesh = unit_box(BoxShape::Triangle, [1, 1, 1]);
    let moved = crate::mesh::map_nodes(mesh.clone(), |x| Ok::<_, MeshError>([x[0], 3.0 * x[1] - 2.5 * x[0], 0.0]));
    let moved = moved.unwrap();
    let mut refiner = Refiner::new(mesh, &moved).unwrap();
    let first = refiner.labels[0].refinement.map(|v| moved.cell_vertices(CellId::new(0))[v as usize]);
    let along = difference(moved.node(first[1]), moved.node(first[0]));
    assert!(close(norm(along), moved.cell_diameter(CellId::new(0)), 1e-14) && dot(along, along) > 0.0);
    assert_eq!(refiner.refine(&[Mark::all(CellId::new(0))]).unwrap().parent(CellId::new(0)), CellId::new(0));
}
