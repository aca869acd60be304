use super::*;
use crate::mesh::{BoxShape, RawMesh, RegionSet, generate_box, map_nodes};

const SHAPES: [(usize, BoxShape); 4] =
    [(2, BoxShape::Triangle), (2, BoxShape::Quadrilateral), (3, BoxShape::Tetrahedron), (3, BoxShape::Hexahedron)];

/// Faces between cells whose vertices all meet the condition.
fn inner_faces(mesh: &Mesh, topology: &Topology, on: impl Fn([f64; 3]) -> bool) -> Vec<FacetRef> {
    let all = topology.facets().iter().filter(|f| f.there.is_some()).map(|f| f.here);
    all.filter(|f| mesh.facet_vertices(*f).vertices().iter().all(|v| on(mesh.node(*v)))).collect()
}

fn sheets(mesh: &Mesh, topology: &Topology, facets: &[FacetRef]) -> Vec<Sheet> {
    oriented_sheets(mesh, &both_sides(mesh, topology, facets).unwrap(), None).unwrap()
}

fn close(a: [f64; 3], b: [f64; 3]) -> bool {
    norm(difference(a, b)) < 1e-12
}

#[test]
fn a_plane_sheet_has_one_normal_whichever_way_its_faces_are_given() {
    for (dim, shape) in SHAPES {
        let mesh = generate_box([0.0; 3], [4.0, 4.0, 4.0], [4, 4, 4], dim, shape).unwrap();
        let topology = Topology::new(&mesh).unwrap();
        let depth = |x: [f64; 3]| dim == 2 || x[2] >= 1.0;
        let mut facets = inner_faces(&mesh, &topology, |x| x[1] == 2.0 && x[0] <= 3.0 && depth(x));
        let found = sheets(&mesh, &topology, &facets);
        assert_eq!(found.len(), 1, "{shape:?}");
        assert!((found[0].area - [3.0, 9.0][dim - 2]).abs() < 1e-12, "{shape:?}");
        assert!(close(found[0].mean_normal, [0.0, 1.0, 0.0]), "{shape:?}");
        for pair in &found[0].facets {
            assert!(mesh.centroid(pair.here.cell)[1] < 2.0 && mesh.centroid(pair.there.cell)[1] > 2.0);
        }
        // seen from the other side, in another order, and twice
        facets.reverse();
        facets.extend(facets.clone().iter().filter_map(|f| topology.opposite(*f)));
        assert_eq!(sheets(&mesh, &topology, &facets), found, "{shape:?}");
        let pairs = both_sides(&mesh, &topology, &facets).unwrap();
        let down = oriented_sheets(&mesh, &pairs, Some(&|_| [0.5, -1.0, 0.0])).unwrap();
        assert!(close(down[0].mean_normal, [0.0, -1.0, 0.0]), "{shape:?}");
        let along = oriented_sheets(&mesh, &pairs, Some(&|_| [1.0, 0.0, 0.0])).unwrap_err();
        assert!(matches!(along, SheetError::Along { .. }), "{along}");
        assert_eq!(sheets_of(&mesh, &down[0].facets), down, "{shape:?}");
    }
}

/// The front is where the sheet ends inside; at the outer boundary it opens.
#[test]
fn nodes_of_the_front_are_those_inside_the_body() {
    for (shape, n) in [(BoxShape::Hexahedron, 7), (BoxShape::Tetrahedron, 7)] {
        let mesh = generate_box([0.0; 3], [4.0, 4.0, 4.0], [4, 4, 4], 3, shape).unwrap();
        let topology = Topology::new(&mesh).unwrap();
        // 0 <= x <= 3 and 1 <= z <= 4: open at x = 0 and z = 4, fronts at x = 3 and z = 1
        let facets = inner_faces(&mesh, &topology, |x| x[1] == 2.0 && x[0] <= 3.0 && x[2] >= 1.0);
        let found = sheets(&mesh, &topology, &facets);
        let cut: BTreeSet<FacetId> = facets.iter().map(|f| topology.facet_id(*f)).collect();
        let front = front_nodes(&mesh, &topology, &found[0].facets, &cut);
        assert!(front.iter().all(|v| mesh.node(*v)[0] == 3.0 || mesh.node(*v)[2] == 1.0), "{shape:?}");
        assert_eq!(front.len(), n, "{shape:?}");
    }
}

#[test]
fn a_branch_divides_a_surface_into_sheets_and_its_nodes_into_sectors() {
    for (dim, shape) in SHAPES {
        let mesh = generate_box([-2.0; 3], [2.0; 3], [4, 4, 4], dim, shape).unwrap();
        let topology = Topology::new(&mesh).unwrap();
        let main = inner_faces(&mesh, &topology, |x| x[1] == 0.0 && x[0].abs() <= 1.0);
        let branch = inner_faces(&mesh, &topology, |x| x[0] == 0.0 && (-1.0..=0.0).contains(&x[1]));
        let both: Vec<FacetRef> = main.iter().chain(&branch).copied().collect();
        let found = sheets(&mesh, &topology, &both);
        let normals: Vec<[f64; 3]> = found.iter().map(|s| s.mean_normal).collect();
        assert_eq!(normals.iter().filter(|n| close(**n, [0.0, 1.0, 0.0])).count(), 2, "{shape:?} {normals:?}");
        assert_eq!(normals.iter().filter(|n| close(**n, [1.0, 0.0, 0.0])).count(), 1, "{shape:?} {normals:?}");
        assert_eq!(sheets(&mesh, &topology, &main).len(), 1, "{shape:?}: without the branch it is one sheet");
        let cut: BTreeSet<FacetId> = both.iter().map(|f| topology.facet_id(*f)).collect();
        let around = |x: [f64; 3]| -> Vec<CellId> {
            let holds = |c: &CellId| mesh.cell_vertices(*c).iter().any(|v| close(mesh.node(*v), x));
            mesh.cells().filter(holds).collect()
        };
        let sectors = |x| n_sectors(&topology, &around(x), &cut);
        let at = |x, y| [x, y, 0.0];
        assert_eq!(sectors(at(0.0, 0.0)), 3, "{shape:?}: the junction");
        assert_eq!(sectors(at(1.0, 0.0)), 1, "{shape:?}: the front of the main sheets");
        assert_eq!(sectors(at(0.0, -1.0)), 1, "{shape:?}: the front of the branch");
    }
}

#[test]
fn normals_of_a_closed_sheet_point_outwards() {
    for (dim, shape) in SHAPES {
        let mesh = generate_box([-2.0; 3], [2.0; 3], [4, 4, 4], dim, shape).unwrap();
        let topology = Topology::new(&mesh).unwrap();
        let far = |x: [f64; 3]| x[..dim].iter().fold(0.0, |m: f64, c| m.max(c.abs()));
        let on_box = |f: &FacetRef| (far(mesh.facet_centroid(*f)) - 1.0).abs() < 1e-12;
        let facets: Vec<FacetRef> =
            inner_faces(&mesh, &topology, |x| far(x) == 1.0).into_iter().filter(on_box).collect();
        let found = sheets(&mesh, &topology, &facets);
        assert_eq!(found.len(), 1, "{shape:?}");
        assert!(close(found[0].mean_normal, [0.0; 3]), "{shape:?}");
        assert!(found[0].facets.iter().all(|f| far(mesh.centroid(f.here.cell)) < 1.0), "{shape:?}");
        // a direction that depends on the position turns them
        let pairs = both_sides(&mesh, &topology, &facets).unwrap();
        let inwards = oriented_sheets(&mesh, &pairs, Some(&|x| x.map(|c| -c))).unwrap();
        assert!(inwards[0].facets.iter().all(|f| far(mesh.centroid(f.here.cell)) > 1.0), "{shape:?}");
    }
}

#[test]
fn a_curved_sheet_has_one_side_and_the_mean_of_its_normals() {
    let mesh = generate_box([0.0; 3], [1.0, 1.0, 1.0], [8, 2, 4], 3, BoxShape::Tetrahedron).unwrap();
    // the plane z = 1/2 becomes half a cylinder
    let bent = |x: [f64; 3]| {
        let (angle, radius) = (std::f64::consts::PI * x[0], 1.0 + x[2]);
        Ok::<_, ()>([-radius * angle.cos(), x[1], radius * angle.sin()])
    };
    let facets = |mesh: &Mesh, topology: &Topology| inner_faces(mesh, topology, |x| x[2] == 0.5);
    let flat = Topology::new(&mesh).unwrap();
    let chosen = facets(&mesh, &flat);
    let mesh = map_nodes(mesh, bent).unwrap();
    let topology = Topology::new(&mesh).unwrap();
    let found = sheets(&mesh, &topology, &chosen);
    assert_eq!(found.len(), 1);
    // eight chords of a half circle: the sum of their vectors is its diameter
    let length = 16.0 * 1.5 * (std::f64::consts::PI / 16.0).sin();
    assert!((found[0].area - length).abs() < 1e-12);
    assert!(close(found[0].mean_normal, [0.0, 0.0, 3.0 / length]));
    for pair in &found[0].facets {
        let radius = |cell| mesh.centroid(cell)[0].hypot(mesh.centroid(cell)[2]);
        assert!(radius(pair.here.cell) < radius(pair.there.cell));
    }
}

/// A ring of hexahedra with a square of 2 x 2 cells as its section, which turns by `turns` half turns on the way round.
fn ring(turns: u32) -> Mesh {
    const N: u32 = 16;
    let point = |a: f64, b: f64, k: u32| {
        let way = std::f64::consts::TAU * f64::from(k) / f64::from(N);
        let turn = std::f64::consts::PI * f64::from(turns * k) / f64::from(N);
        let (z, r) = (a * turn.cos() - b * turn.sin(), 5.0 + a * turn.sin() + b * turn.cos());
        [r * way.cos(), r * way.sin(), z]
    };
    let mut raw = RawMesh { dim: 3, order: 1, ..RawMesh::default() };
    for k in 0..N {
        for b in 0..3u32 {
            raw.nodes.extend((0..3u32).map(|a| point(f64::from(a) - 1.0, f64::from(b) - 1.0, k)));
        }
    }
    let node = |a: u32, b: u32, k: u32| match (k == N, turns % 2) {
        (true, 1) => 3 * (2 - b) + (2 - a),
        (true, _) => 3 * b + a,
        _ => 9 * k + 3 * b + a,
    };
    for k in 0..N {
        for (a, b) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            raw.kinds.push(crate::cell::CellKind::Hexahedron);
            let corners = (0..8u32).map(|c| node(a + (c & 1), b + (c >> 1 & 1), k + (c >> 2)));
            raw.connectivity.extend(corners);
        }
    }
    Mesh::from_raw(raw).unwrap()
}

/// The middle plane of the sections of a ring: faces between cells of one section that are neighbours in `b`.
fn strip(mesh: &Mesh, topology: &Topology) -> Vec<FacetRef> {
    let middle = |f: &FacetRef| mesh.facet_vertices(*f).vertices().iter().all(|v| v.index() % 9 / 3 == 1);
    inner_faces(mesh, topology, |_| true).into_iter().filter(middle).collect()
}

#[test]
fn a_moebius_strip_has_no_side_and_a_full_turn_has() {
    for (turns, one_sided) in [(0, false), (1, true), (2, false)] {
        let mesh = ring(turns);
        let topology = Topology::new(&mesh).unwrap();
        let facets = strip(&mesh, &topology);
        assert_eq!(facets.len(), 32, "two faces a section, 16 sections");
        let made = oriented_sheets(&mesh, &both_sides(&mesh, &topology, &facets).unwrap(), None);
        match (one_sided, made) {
            (true, Err(SheetError::OneSide { at })) => {
                let radius = at[0].hypot(at[1]);
                assert!((4.0..=6.0).contains(&radius) && at[2].abs() <= 1.0, "{at:?} lies in the ring");
            }
            (false, Ok(found)) => assert_eq!(found.len(), 1),
            (_, other) => panic!("{turns} half turns: {other:?}"),
        }
    }
}

#[test]
fn faces_of_the_outer_boundary_have_no_other_side() {
    let mesh = generate_box([0.0; 3], [2.0; 3], [2, 2, 2], 3, BoxShape::Hexahedron).unwrap();
    let topology = Topology::new(&mesh).unwrap();
    let mut facets = inner_faces(&mesh, &topology, |x| x[2] == 1.0);
    facets.extend(crate::mesh::outer_boundary(&topology));
    let error = both_sides(&mesh, &topology, &facets).unwrap_err();
    let text = "24 of 28 faces have a cell on one side only, the first at (0, 0.5, 0.5)";
    assert_eq!(error.to_string(), text);
    let RegionSet::Interface(none) = RegionSet::Interface(both_sides(&mesh, &topology, &[]).unwrap()) else { panic!() };
    assert!(oriented_sheets(&mesh, &none, None).unwrap().is_empty());
}
