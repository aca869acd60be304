use super::*;
use wfl_mesh::mesh::{
    BoxShape, RawMesh, RegionSet, boundary_of, generate_box, interface, outer_boundary, pick_cells, pick_facets,
};

const SHAPES: [(usize, BoxShape, usize); 5] = [
    (1, BoxShape::Segment, 4),
    (2, BoxShape::Triangle, 4),
    (2, BoxShape::Quadrilateral, 4),
    (3, BoxShape::Tetrahedron, 4),
    (3, BoxShape::Hexahedron, 4),
];

fn unit(dim: usize, shape: BoxShape, n: usize) -> (Mesh, Topology) {
    let mesh = generate_box([0.0; 3], [1.0; 3], [n; 3], dim, shape).unwrap();
    let topology = Topology::new(&mesh).unwrap();
    (mesh, topology)
}

/// The mesh with its nodes renumbered by a fixed shuffle, so that global order says nothing about
/// local order.
fn shuffled(mesh: Mesh) -> Mesh {
    let n = mesh.n_nodes();
    let mut order: Vec<usize> = (0..n).collect();
    let mut state = 12345u64;
    for i in (1..n).rev() {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        order.swap(i, (state >> 33) as usize % (i + 1));
    }
    let raw = mesh.into_raw();
    let mut nodes = vec![[0.0; 3]; n];
    for (old, new) in order.iter().enumerate() {
        nodes[*new] = raw.nodes[old];
    }
    let connectivity = raw.connectivity.iter().map(|n| order[*n as usize] as u32).collect();
    Mesh::from_raw(RawMesh { nodes, connectivity, ..raw }).unwrap()
}

fn everywhere(mesh: &Mesh) -> Vec<CellId> {
    mesh.cells().collect()
}

#[test]
fn node_counts_are_those_of_the_lattice() {
    for (dim, shape, highest) in SHAPES {
        let (mesh, topology) = unit(dim, shape, 3);
        for degree in 1..=highest {
            let cells = everywhere(&mesh);
            let space = Space::on_cells(&mesh, &topology, &cells, degree, Family::Continuous).unwrap();
            assert_eq!(space.n_nodes(), (3 * degree + 1).pow(dim as u32), "{shape:?} {degree}");
            let apart = Space::on_cells(&mesh, &topology, &cells, degree, Family::Discontinuous).unwrap();
            assert_eq!(apart.n_nodes(), cells.len() * apart.element_at(0).n_dofs());
        }
        let flat = Space::on_cells(&mesh, &topology, &everywhere(&mesh), 0, Family::Continuous).unwrap();
        assert_eq!(flat.n_nodes(), mesh.n_cells());
    }
}

/// Every local dof sits where its global node sits: the numbering is consistent for every pairing
/// and orientation of neighbours that a shuffled mesh has.
#[test]
fn shared_nodes_have_one_place_for_all_cells() {
    let boxes = SHAPES.map(|(dim, shape, highest)| (format!("{shape:?}"), highest, unit(dim, shape, 3).0));
    // wedges alone, and all kinds of solid cells
    let files: [(&[u8], usize); 2] = [
        (include_bytes!("../../../mesh/src/mesh/read/data/wedges_22a.msh"), 4),
        (include_bytes!("../../../mesh/src/mesh/read/data/solids_41a.msh"), 2),
    ];
    let files = files.map(|(bytes, highest)| {
        let mesh = Mesh::from_raw(wfl_mesh::mesh::read::parse_mesh(bytes).unwrap()).unwrap();
        (format!("file of {}", mesh.n_cells()), highest, mesh)
    });
    for (shape, highest, mesh) in boxes.into_iter().chain(files) {
        let mesh = shuffled(mesh);
        let topology = Topology::new(&mesh).unwrap();
        for degree in 1..=highest {
            let space = Space::on_cells(&mesh, &topology, &everywhere(&mesh), degree, Family::Continuous).unwrap();
            let mut seen = vec![false; space.n_nodes()];
            for cell in mesh.cells() {
                let position = space.position_of_cell(cell).unwrap();
                let element = space.element_at(position);
                let table = mesh.geometry_element(element.kind()).tabulate(element.points(), 0);
                for (dof, node) in space.entity_nodes(position).iter().enumerate() {
                    let (x, y) = (mesh.point_at(cell, &table, dof), space.node_coordinates()[*node as usize]);
                    assert!((0..3).all(|i| (x[i] - y[i]).abs() < 1e-13), "{shape} {degree}");
                    seen[*node as usize] = true;
                }
            }
            assert!(seen.iter().all(|s| *s));
        }
    }
}

#[test]
fn numbers_follow_first_appearance() {
    let (mesh, topology) = unit(3, BoxShape::Hexahedron, 2);
    let space = Space::on_cells(&mesh, &topology, &everywhere(&mesh), 2, Family::Continuous).unwrap();
    let mut highest = None;
    for position in 0..space.n_positions() {
        for node in space.entity_nodes(position) {
            assert!(*node <= highest.map_or(0, |h: u32| h + 1));
            highest = Some(highest.map_or(*node, |h| h.max(*node)));
        }
    }
}

#[test]
fn nodes_on_facets_are_the_nodes_on_that_plane() {
    for (dim, shape, highest) in SHAPES {
        let mesh = shuffled(unit(dim, shape, 2).0);
        let topology = Topology::new(&mesh).unwrap();
        let picked = pick_facets(&mesh, &outer_boundary(&topology), |x| Ok::<_, ()>(x[0] == 1.0));
        let Ok(RegionSet::Facets(facets)) = picked else { panic!() };
        for degree in 1..=highest {
            let space = Space::on_cells(&mesh, &topology, &everywhere(&mesh), degree, Family::Continuous).unwrap();
            let on_plane = |node: &u32| (space.node_coordinates()[*node as usize][0] - 1.0).abs() < 1e-12;
            let expected: Vec<u32> = (0..space.n_nodes() as u32).filter(on_plane).collect();
            assert_eq!(space.nodes_on_facets(&mesh, &topology, &facets), expected);
            let apart = Space::on_cells(&mesh, &topology, &everywhere(&mesh), degree, Family::Discontinuous).unwrap();
            let found = apart.nodes_on_facets(&mesh, &topology, &facets);
            let per_facet = apart.element_at(0).facet_closure(0).len();
            assert_eq!(found.len(), facets.len() * per_facet);
            assert!(found.iter().all(|n| (apart.node_coordinates()[*n as usize][0] - 1.0).abs() < 1e-12));
        }
    }
}

/// Two fields that live on the two halves meet the facets between them from either side, and the
/// trace space has the nodes of both.
#[test]
fn an_interface_is_met_from_both_sides() {
    for (dim, shape, highest) in SHAPES {
        let mesh = shuffled(unit(dim, shape, 4).0);
        let topology = Topology::new(&mesh).unwrap();
        let half = |low: bool| match pick_cells(&mesh, None, |x| Ok::<_, ()>((x[0] < 0.5) == low)) {
            Ok(RegionSet::Cells(cells)) => cells,
            _ => panic!(),
        };
        let (near, far) = (half(true), half(false));
        let Ok(RegionSet::Interface(fault)) = interface(&mesh, &topology, &near, &far) else { panic!() };
        let here: Vec<FacetRef> = fault.iter().map(|f| f.here).collect();
        let there: Vec<FacetRef> = fault.iter().map(|f| f.there).collect();
        for degree in 1..=highest {
            let count = (4 * degree + 1).pow(dim as u32 - 1);
            for cells in [&near, &far] {
                let space = Space::on_cells(&mesh, &topology, cells, degree, Family::Continuous).unwrap();
                assert_eq!(space.n_nodes(), count * (2 * degree + 1));
                let nodes = space.nodes_on_facets(&mesh, &topology, &here);
                assert_eq!(nodes.len(), count);
                assert_eq!(nodes, space.nodes_on_facets(&mesh, &topology, &there));
            }
            let trace = Space::on_facets(&mesh, &topology, &here, degree, Family::Continuous).unwrap();
            assert_eq!(trace.n_nodes(), count);
            let all: Vec<u32> = (0..count as u32).collect();
            assert_eq!(trace.nodes_on_facets(&mesh, &topology, &there), all);
            for (position, facet) in here.iter().enumerate() {
                assert_eq!(trace.position_of_facet(*facet), Some(position));
                check_trace(&mesh, &trace, position, *facet);
            }
            let apart = Space::on_facets(&mesh, &topology, &here, degree, Family::Discontinuous).unwrap();
            let nodes = apart.nodes_on_facets(&mesh, &topology, &there[..1]);
            assert_eq!(nodes, apart.entity_nodes(0).to_vec());
            let flat = Space::on_facets(&mesh, &topology, &there, 0, Family::Discontinuous).unwrap();
            assert_eq!(flat.n_nodes(), fault.len());
        }
    }
}

/// Local order of a trace space: the facet's element in the facet's parameters.
fn check_trace(mesh: &Mesh, trace: &Space, position: usize, facet: FacetRef) {
    let element = trace.element_at(position);
    let table = mesh.geometry_element(element.kind()).tabulate(element.points(), 0);
    for (dof, node) in trace.entity_nodes(position).iter().enumerate() {
        let x = mesh.facet_point_at(facet, &table, dof);
        let y = trace.node_coordinates()[*node as usize];
        assert!((0..3).all(|i| (x[i] - y[i]).abs() < 1e-13));
    }
}

#[test]
fn corners_of_a_part_are_found_by_mesh_node() {
    let (mesh, topology) = unit(2, BoxShape::Quadrilateral, 2);
    let cells = [CellId::new(1)];
    let space = Space::on_cells(&mesh, &topology, &cells, 2, Family::Continuous).unwrap();
    let nodes: Vec<NodeId> = [0, 1, 5].map(NodeId::new).to_vec();
    let found = space.nodes_at_mesh_nodes(&mesh, &nodes);
    let places: Vec<[f64; 3]> = found.iter().map(|n| space.node_coordinates()[*n as usize]).collect();
    assert_eq!(places, [[0.5, 0.0, 0.0], [1.0, 0.5, 0.0]]);
    let edge = boundary_of(&mesh, &topology, &cells);
    assert_eq!(space.nodes_on_facets(&mesh, &topology, &edge).len(), 8);
    assert_eq!(space.position_of_cell(CellId::new(0)), None);
}

/// Four quadrilaterals around the origin, split along the part x < 0 of the line y = 0, then also along x = 0.
#[test]
fn a_torn_space_has_one_node_a_side() {
    let mesh = generate_box([-1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [2, 2, 1], 2, BoxShape::Quadrilateral).expect("a box");
    let topology = Topology::new(&mesh).expect("a manifold");
    let cells: Vec<CellId> = mesh.cells().collect();
    let on = |pick: &dyn Fn([f64; 3]) -> bool| -> Vec<FacetRef> {
        topology
            .facets()
            .iter()
            .filter(|f| f.there.is_some())
            .map(|f| f.here)
            .filter(|f| pick(mesh.facet_centroid(*f)))
            .collect()
    };
    let space = |degree: usize, facets: &[FacetRef]| {
        let mut s = Space::on_cells(&mesh, &topology, &cells, degree, Family::Continuous).expect("an element");
        s.split(&topology, facets);
        s
    };
    let half = on(&|x| x[1].abs() < 1e-12 && x[0] < 0.0);
    let cross = on(&|_| true);
    assert_eq!((half.len(), cross.len()), (1, 4));
    // the end at the origin stays continuous, the end on the outer boundary opens
    assert_eq!(space(1, &half).n_nodes(), 9 + 1);
    assert_eq!(space(2, &half).n_nodes(), 25 + 2);
    // four nodes at the crossing, two at each end
    assert_eq!(space(1, &cross).n_nodes(), 16);
    // one split ends on another: three nodes at the origin, two at each of the three ends
    let tee = on(&|x| x[1].abs() < 1e-12 || x[1] > 0.0);
    assert_eq!((tee.len(), space(1, &tee).n_nodes()), (3, 9 + 2 + 3));
    assert_eq!(space(2, &cross).n_nodes(), 36);
    // a facet has the nodes of its own side
    let torn = space(1, &half);
    let there = topology.opposite(half[0]).expect("an inner face");
    let (a, b) = (torn.nodes_on_facets(&mesh, &topology, &half), torn.nodes_on_facets(&mesh, &topology, &[there]));
    assert_eq!((a.len(), b.len()), (2, 2));
    assert_eq!(a.iter().filter(|n| b.contains(n)).count(), 1, "only the end is shared");
}

/// Two squares side by side: the field of the left one has no nodes on the lower face of the right one, though they
/// touch.
#[test]
fn a_face_that_touches_at_an_edge_has_no_nodes() {
    let mesh = generate_box([0.0; 3], [2.0, 1.0, 0.0], [2, 1, 1], 2, BoxShape::Quadrilateral).expect("a box");
    let topology = Topology::new(&mesh).expect("a manifold");
    let cells: Vec<CellId> = mesh.cells().collect();
    let left = Space::on_cells(&mesh, &topology, &cells[..1], 1, Family::Continuous).expect("an element");
    let low = |cell: CellId| -> Vec<FacetRef> {
        let facets = topology.facets().iter().map(|f| f.here);
        facets.filter(|f| f.cell == cell && mesh.facet_centroid(*f)[1] < 1e-12).collect()
    };
    assert_eq!(left.nodes_on_facets(&mesh, &topology, &low(cells[0])).len(), 2);
    assert_eq!(left.nodes_on_facets(&mesh, &topology, &low(cells[1])).len(), 0);
}

#[test]
fn nodes_of_cells_are_shared_where_they_follow_each_other() {
    for (dim, shape, _) in SHAPES {
        let (mesh, topology) = unit(dim, shape, 3);
        let mut cells = everywhere(&mesh);
        let outside = cells.remove(0);
        let space = Space::on_cells(&mesh, &topology, &cells, 2, Family::Continuous).unwrap();
        let separately = |some: &[CellId]| -> Vec<u32> {
            let nodes = |cell: &CellId| space.entity_nodes(space.position_of_cell(*cell).unwrap()).to_vec();
            some.iter().flat_map(nodes).collect()
        };
        let is_shared = |nodes: &NodeList| {
            let (own, all) = (nodes.as_ptr_range(), space.nodes.as_ptr_range());
            all.start <= own.start && own.end <= all.end
        };
        let inner = space.nodes_of_cells(&cells[1..]).unwrap();
        assert!(*inner == *separately(&cells[1..]) && is_shared(&inner));
        let turned: Vec<CellId> = cells.iter().rev().copied().collect();
        let copied = space.nodes_of_cells(&turned).unwrap();
        assert!(*copied == *separately(&turned) && !is_shared(&copied));
        assert!(space.nodes_of_cells(&[cells[0], outside]).is_none() && space.nodes_of_cells(&[outside]).is_none());
    }
}
