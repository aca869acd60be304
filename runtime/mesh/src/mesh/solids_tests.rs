//! Meshes of hexahedra, wedges, pyramids and tetrahedra: what their faces and cells have in common.

use super::*;
use crate::{
    cell::Basis,
    quadrature::{facet_points, rule, vertex},
    refine::{Mark, Refiner},
    vector::cross,
};

/// The files of `read/data/README.md` with all four kinds of solid cells, of first and second order.
fn solids() -> [Mesh; 2] {
    let files: [&[u8]; 2] = [include_bytes!("read/data/solids_41a.msh"), include_bytes!("read/data/solids2_22a.msh")];
    files.map(|bytes| Mesh::from_file(read::parse_mesh(bytes).unwrap()).unwrap())
}

fn near(a: [f64; 3], b: [f64; 3], within: f64) -> bool {
    (0..3).all(|d| (a[d] - b[d]).abs() < within)
}

/// One cell with these nodes.
fn one(kind: CellKind, nodes: &[[f64; 3]]) -> Mesh {
    let connectivity = (0..u32::try_from(nodes.len()).unwrap()).collect();
    let raw =
        RawMesh { dim: 3, order: 1, nodes: nodes.to_vec(), kinds: vec![kind], connectivity, ..RawMesh::default() };
    Mesh::from_raw(raw).unwrap()
}

#[test]
fn faces_cover_the_surface_of_every_cell_and_point_outwards() {
    for mesh in solids() {
        let cells: Vec<CellId> = mesh.cells().collect();
        let volumes = cell_volumes(&mesh, &cells);
        for (cell, volume) in cells.iter().zip(&volumes) {
            let kind = mesh.kind(*cell);
            let (mut closed, mut flux) = ([0.0; 3], 0.0);
            for local in 0..kind.facets().len() {
                let facet = FacetRef::new(*cell, local);
                let rule = rule(mesh.facet_kind(facet), 6).unwrap();
                let table = mesh.geometry_element(kind).tabulate(&facet_points(kind, local, &rule), 1);
                let tangents = kind.facet_map(local).tangents;
                let sense = if quality::turns_left(&mesh, facet) { 1.0 } else { -1.0 };
                for (q, weight) in rule.weights.iter().enumerate() {
                    let jacobian = mesh.jacobian_at(*cell, &table, q);
                    let image = |t: [f64; 3]| jacobian.map(|row| (0..3).map(|j| row[j] * t[j]).sum::<f64>());
                    let area = cross(image(tangents[0]), image(tangents[1])).map(|a| sense * weight * a);
                    let x = mesh.point_at(*cell, &table, q);
                    flux += (0..3).map(|d| x[d] * area[d]).sum::<f64>();
                    closed = std::array::from_fn(|d| closed[d] + area[d]);
                }
            }
            assert!(near(closed, [0.0; 3], 1e-14), "{kind} {closed:?}");
            assert!((flux - 3.0 * volume).abs() < 1e-13, "{kind}: {flux} {volume}");
        }
    }
}

#[test]
fn neighbours_share_whole_faces_with_the_same_points() {
    for mesh in solids() {
        let topology = Topology::new(&mesh).unwrap();
        let outer = topology.facets().iter().filter(|f| f.there.is_none());
        let area: f64 = facet_measures(&mesh, &outer.map(|f| f.here).collect::<Vec<_>>()).iter().sum();
        assert!(mesh.order() > 1 || (area - 24.0).abs() < 1e-13, "{area}");
        let mut kinds = std::collections::BTreeSet::new();
        for facet in topology.facets() {
            let Some(there) = facet.there else { continue };
            let rule = rule(mesh.facet_kind(facet.here), 3).unwrap();
            let (_, points) = neighbour_points(&mesh, facet.here, there, &rule).unwrap();
            let [here, there] = [facet.here, there].map(|f| mesh.kind(f.cell));
            kinds.insert((here.min(there), here.max(there)));
            let ours = facet_points(here, usize::from(facet.here.local), &rule);
            let table = |kind: CellKind, points: &[[f64; 3]]| mesh.geometry_element(kind).tabulate(points, 0);
            let (a, b) = (table(here, &ours), table(there, &points));
            for q in 0..rule.n_points() {
                let x = mesh.point_at(facet.here.cell, &a, q);
                let y = mesh.point_at(facet.there.unwrap().cell, &b, q);
                assert!(near(x, y, 1e-14), "{here} {there}: {x:?} {y:?}");
            }
        }
        let pairs = [
            (CellKind::Tetrahedron, CellKind::Wedge),
            (CellKind::Tetrahedron, CellKind::Pyramid),
            (CellKind::Hexahedron, CellKind::Wedge),
            (CellKind::Hexahedron, CellKind::Pyramid),
            (CellKind::Wedge, CellKind::Pyramid),
        ];
        assert!(pairs.iter().all(|pair| kinds.contains(pair)), "{kinds:?}");
    }
}

#[test]
fn points_are_found_in_the_cell_that_they_were_taken_from() {
    for mesh in solids() {
        let cells: Vec<CellId> = mesh.cells().collect();
        let finder = CellFinder::new(&mesh, &cells);
        for cell in &cells {
            let kind = mesh.kind(*cell);
            let mut places = rule(kind, 3).unwrap().points;
            places.extend_from_slice(kind.vertices());
            let table = mesh.geometry_element(kind).tabulate(&places, 0);
            for (q, place) in places.iter().enumerate() {
                let x = mesh.point_at(*cell, &table, q);
                let found = finder.find(&mesh, x).unwrap_or_else(|| panic!("{kind} {place:?}"));
                let other = mesh.geometry_element(mesh.kind(found.cell)).tabulate(&[found.reference], 0);
                assert!(near(mesh.point_at(found.cell, &other, 0), x, 1e-10), "{kind} {place:?}");
            }
        }
        assert_eq!(finder.find(&mesh, [2.5, 1.0, 1.0]), None);
    }
}

#[test]
fn heights_and_nodal_weights_are_those_of_the_shape() {
    let stretch = |x: &[f64; 3]| [2.0 * x[0] + 0.5 * x[2], 3.0 * x[1], 4.0 * x[2]];
    for kind in [CellKind::Wedge, CellKind::Pyramid] {
        let nodes: Vec<[f64; 3]> = kind.vertices().iter().map(stretch).collect();
        let mesh = one(kind, &nodes);
        assert_eq!(mesh.map_order(CellId::new(0)), 0);
        for local in 0..kind.facets().len() {
            let facet = FacetRef::new(CellId::new(0), local);
            let at = kind.facets()[local].vertices;
            let (a, b, c) = (nodes[at[0]], nodes[at[1]], nodes[at[2]]);
            let along = |p: [f64; 3]| -> [f64; 3] { std::array::from_fn(|d| p[d] - a[d]) };
            let normal = cross(along(b), along(c));
            let size = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
            let far = |p: &[f64; 3]| along(*p).iter().zip(normal).map(|(x, n)| x * n).sum::<f64>().abs() / size;
            let height = nodes.iter().map(far).fold(0.0, f64::max);
            let found = facet_heights(&mesh, &[facet])[0];
            assert!((found - height).abs() < 1e-14 * height, "{kind} {local}: {found} {height}");
        }
        let (fine, nodal) = (rule(kind, 4).unwrap(), vertex(kind));
        for (k, weight) in nodal.weights.iter().enumerate() {
            let all = fine.points.iter().zip(&fine.weights);
            let exact: f64 = all.map(|(x, w)| w * kind.hat_values(*x)[k]).sum();
            assert!((weight - exact).abs() < 1e-15);
        }
    }
}

/// The faces of a pyramid meet in its apex, each with the derivatives of its own side.
#[test]
fn each_face_of_a_pyramid_has_its_own_area_at_the_apex() {
    let base = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.1], [0.1, 1.2, 0.0], [0.8, 0.9, -0.2]];
    let mesh = one(CellKind::Pyramid, &[base.as_slice(), &[[0.4, 0.5, 1.0]]].concat());
    for local in 0..4 {
        let rule = vertex(CellKind::Triangle);
        let table =
            mesh.geometry_element(CellKind::Pyramid).tabulate(&facet_points(CellKind::Pyramid, local, &rule), 1);
        let tangents = CellKind::Pyramid.facet_map(local).tangents;
        let area = |q: usize| {
            let jacobian = mesh.jacobian_at(CellId::new(0), &table, q);
            let image = |t: [f64; 3]| jacobian.map(|row| (0..3).map(|j| row[j] * t[j]).sum::<f64>());
            cross(image(tangents[0]), image(tangents[1]))
        };
        assert!((1..3).all(|q| near(area(q), area(0), 1e-15)), "{local}");
        assert!(near(mesh.point_at(CellId::new(0), &table, 2), [0.4, 0.5, 1.0], 1e-15));
    }
}

#[test]
fn cells_of_second_order_keep_their_volume() {
    let [mesh, _] = solids();
    let cells: Vec<CellId> = mesh.cells().collect();
    let before = cell_volumes(&mesh, &cells);
    let mesh = second_order(mesh).unwrap();
    assert_eq!(mesh.geometry_element(CellKind::Pyramid).n_dofs(), 14);
    for ((a, b), cell) in before.iter().zip(cell_volumes(&mesh, &cells)).zip(&cells) {
        assert!((a - b).abs() < 1e-14, "{}", mesh.kind(*cell));
        let straight = mesh.kind(*cell).basis() == Basis::Simplex;
        assert!(mesh.map_order(*cell) <= usize::from(!straight), "{}", mesh.kind(*cell));
    }
}

#[test]
fn cells_that_share_half_a_face_or_are_turned_are_errors() {
    let mut nodes: Vec<[f64; 3]> = CellKind::Hexahedron.vertices().to_vec();
    nodes.extend([[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0], [1.0, 1.0, 2.0]]);
    let kinds = vec![CellKind::Hexahedron, CellKind::Wedge, CellKind::Wedge];
    let connectivity: Vec<u32> = (0..8).chain([4, 5, 7, 8, 9, 11]).chain([4, 7, 6, 8, 11, 10]).collect();
    let raw = RawMesh { dim: 3, order: 1, nodes, kinds, connectivity, ..RawMesh::default() };
    let mesh = Mesh::from_raw(raw.clone()).unwrap();
    let error = Topology::new(&mesh).unwrap_err();
    assert!(matches!(error, MeshError::HalfFace { .. }), "{error}");
    assert!(
        error.to_string().starts_with("a triangular face of cell 1 lies on a quadrilateral one of cell 0"),
        "{error}"
    );
    for kind in [CellKind::Wedge, CellKind::Pyramid] {
        let mirrored: Vec<[f64; 3]> = kind.vertices().iter().map(|x| [x[1], x[0], x[2]]).collect();
        let connectivity = (0..u32::try_from(kind.n_vertices()).unwrap()).collect();
        let raw = RawMesh { dim: 3, order: 1, nodes: mirrored, kinds: vec![kind], connectivity, ..RawMesh::default() };
        assert!(matches!(Mesh::from_raw(raw), Err(MeshError::Inverted { .. })), "{kind}");
    }
}

#[test]
fn a_refinement_that_reaches_a_wedge_is_an_error() {
    for kind in [CellKind::Wedge, CellKind::Hexahedron] {
        let [mesh, _] = solids();
        let cell = mesh.cells().find(|cell| mesh.kind(*cell) == kind).unwrap();
        let mut refiner = Refiner::new(mesh.clone(), &mesh).unwrap();
        let error = refiner.refine(&[Mark::all(cell)]).unwrap_err();
        assert!(error.to_string().contains("s are not divided: make the mesh finer where it is made"), "{error}");
    }
}
