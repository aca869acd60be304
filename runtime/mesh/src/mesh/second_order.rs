//! A mesh of first order as one of second order: the same cells with nodes in the middle of edges, faces and cells.
//!
//! Promises: old nodes keep their numbers, cells and groups are the same; where nothing bends an edge the cells keep their
//! shape. Who bends it (a map of all nodes, or [`along_curves`]) makes cells with curved edges. Does not know scenes.

use std::collections::BTreeMap;

use super::{CellId, FacetRef, Mesh, MeshError, NodeId, RawMesh, Topology, raw::node_bytes};
use crate::{
    cell::CellKind,
    element::{DofEntity, Element, Family},
    vector::distance,
};
use wfl_host::memory::claim;

/// Nodes of a mesh of second order for one of first order with as many.
const MORE_NODES: u64 = 8;

/// The mesh with cells of second order, all edges straight; a mesh of second order as it is.
///
/// # Errors
/// [`MeshError::TooMuchMemory`], [`MeshError::TooLarge`], and what [`Mesh::from_raw`] finds.
pub fn second_order(mesh: Mesh) -> Result<Mesh, MeshError> {
    bent(mesh, &BTreeMap::new())
}

/// The mesh with cells of second order; `moved` has by the two vertices of an edge (ascending) how far its middle is moved.
fn bent(mesh: Mesh, moved: &BTreeMap<[NodeId; 2], [f64; 3]>) -> Result<Mesh, MeshError> {
    if mesh.order() > 1 {
        return Ok(mesh);
    }
    let nodes = MORE_NODES * mesh.n_nodes() as u64;
    if nodes > u64::from(u32::MAX) {
        return Err(MeshError::TooLarge { nodes: nodes.into() });
    }
    claim(node_bytes(nodes) + 32 * mesh.n_cells() as u64, "the mesh of second order")?;
    let mut made = Made { nodes: mesh.nodes().to_vec(), shared: BTreeMap::new(), connectivity: Vec::new() };
    let elements: Vec<Option<Element>> =
        CellKind::ALL.iter().map(|kind| Element::lagrange(*kind, 2, Family::Continuous).ok()).collect();
    for cell in mesh.cells() {
        if let Some(element) = &elements[mesh.kind(cell).index()] {
            made.cell(&mesh, cell, element, moved);
        }
    }
    let raw = mesh.into_raw();
    let mut numbers = raw.numbers;
    if !numbers.nodes.is_empty() {
        let highest = numbers.nodes.iter().copied().max().unwrap_or(0);
        numbers.nodes.extend((1..=(made.nodes.len() - numbers.nodes.len()) as u64).map(|k| highest + k));
    }
    Mesh::from_raw(RawMesh { order: 2, nodes: made.nodes, connectivity: made.connectivity, numbers, ..raw })
}

struct Made {
    nodes: Vec<[f64; 3]>,
    /// Nodes of edges and faces by their vertices.
    shared: BTreeMap<[u32; 4], u32>,
    connectivity: Vec<u32>,
}

impl Made {
    fn cell(&mut self, mesh: &Mesh, cell: CellId, element: &Element, moved: &BTreeMap<[NodeId; 2], [f64; 3]>) {
        let (kind, vertices) = (mesh.kind(cell), mesh.cell_vertices(cell));
        let of_edge = |edge: usize| {
            let mut ends = kind.edges()[edge].map(|v| vertices[v]);
            ends.sort_unstable();
            moved.get(&ends).copied().unwrap_or([0.0; 3])
        };
        for (k, entity) in element.entities().iter().enumerate() {
            let mut key = [u32::MAX; 4];
            let (list, bend): (&[usize], [f64; 3]) = match entity {
                DofEntity::Vertex(v) => {
                    self.connectivity.push(vertices[*v].index() as u32);
                    continue;
                }
                DofEntity::Edge { edge, .. } => (&kind.edges()[*edge], of_edge(*edge)),
                DofEntity::Facet { facet, .. } => (kind.facets()[*facet].vertices, [0.0; 3]),
                DofEntity::Interior(_) => {
                    // as far as its edges are moved: half of what two opposite ones are
                    let all = (0..kind.edges().len()).map(of_edge);
                    (&[], all.fold([0.0; 3], |sum, x| std::array::from_fn(|d| sum[d] + 0.5 * x[d])))
                }
            };
            key.iter_mut().zip(list).for_each(|(slot, v)| *slot = vertices[*v].index() as u32);
            key.sort_unstable();
            let known = self.shared.get(&key).copied().filter(|_| !list.is_empty());
            let node = known.unwrap_or_else(|| {
                let hats = kind.hat_values(element.points()[k]);
                let mut x = bend;
                for (hat, vertex) in hats.iter().zip(vertices) {
                    (0..3).for_each(|d| x[d] += hat * mesh.node(*vertex)[d]);
                }
                self.nodes.push(x);
                let node = (self.nodes.len() - 1) as u32;
                if !list.is_empty() {
                    self.shared.insert(key, node);
                }
                node
            });
            self.connectivity.push(node);
        }
    }
}

/// Angles between neighbouring faces of a boundary, in degrees, that seem to be those of a curve: below they are rounding
/// of a plane, above a corner.
const ANGLES: [f64; 2] = [0.05, 50.0];
/// On a curve neighbouring angles are alike within this factor.
const ALIKE: f64 = 4.0;

/// What seems to be a curve of a boundary in the plane, and is a polygon in a mesh of first order.
#[derive(Clone, Debug, Default)]
pub struct Curves {
    /// By the vertices of a face (ascending) the angles, in radians, to its neighbours; positive where the body is convex.
    faces: BTreeMap<[NodeId; 2], [f64; 2]>,
    /// The largest part by which the area of a circle is larger than that of its polygon with these angles.
    pub largest: f64,
}

/// The faces that `facets`, those of one body each with its cell inside, have where they seem to be polygons of curves:
/// each face meets both neighbours, or one at its end, at small angles that are alike. Of meshes in the plane of first
/// order; none of others.
#[must_use]
pub fn curves(mesh: &Mesh, bodies: &[Vec<FacetRef>]) -> Curves {
    let mut out = Curves::default();
    if mesh.dim() != 2 || mesh.order() != 1 {
        return out;
    }
    for facets in bodies {
        let mut around: BTreeMap<NodeId, Vec<usize>> = BTreeMap::new();
        let ends: Vec<[NodeId; 2]> = facets.iter().map(|f| directed(mesh, *f)).collect();
        for (k, [a, b]) in ends.iter().enumerate() {
            around.entry(*a).or_default().push(k);
            around.entry(*b).or_default().push(k);
        }
        // the angle at each node where one face ends and another begins
        let mut angles: BTreeMap<NodeId, f64> = BTreeMap::new();
        for (node, list) in &around {
            let [first, second] = list[..] else { continue };
            let (before, behind) = if ends[first][1] == *node { (first, second) } else { (second, first) };
            if ends[before][1] == *node && ends[behind][0] == *node {
                angles.insert(*node, turn(mesh, ends[before], ends[behind]));
            }
        }
        let limits = ANGLES.map(f64::to_radians);
        let small = |node: &NodeId| angles.get(node).copied().filter(|a| (limits[0]..limits[1]).contains(&a.abs()));
        for [a, b] in &ends {
            let (Some(x), Some(y)) = (small(a), small(b)) else { continue };
            if x * y <= 0.0 || x.abs() > ALIKE * y.abs() || y.abs() > ALIKE * x.abs() {
                continue;
            }
            let mut key = [*a, *b];
            key.sort_unstable();
            let mean = 0.5 * (x + y);
            // the area of a circle over that of its polygon: 1 + angle^2/6
            out.largest = out.largest.max(mean * mean / 6.0);
            out.faces.entry(key).or_insert([mean, mean]);
        }
    }
    out
}

/// Angles between neighbouring planes of a boundary in space, in degrees, that seem to be those of a curved surface:
/// chamfers have larger ones.
const ANGLES_IN_SPACE: [f64; 2] = [0.5, 40.0];

/// By how much the area inside a circle is larger than that of a polygon with the angles of a boundary in space, the
/// largest: of neighbouring planes of one body of which each has two such neighbours or more, in one sense. 0 where no
/// boundary seems to be curved, and for meshes of second order.
#[must_use]
pub fn curved_in_space(mesh: &Mesh, bodies: &[Vec<FacetRef>]) -> f64 {
    if mesh.dim() != 3 || mesh.order() != 1 {
        return 0.0;
    }
    bodies.iter().map(|facets| largest_in_space(mesh, facets)).fold(0.0, f64::max)
}

fn largest_in_space(mesh: &Mesh, facets: &[FacetRef]) -> f64 {
    let mut around: BTreeMap<[NodeId; 2], Vec<usize>> = BTreeMap::new();
    for (k, facet) in facets.iter().enumerate() {
        let of = mesh.facet_vertices(*facet);
        let list = of.vertices();
        // opposite corners of a quadrilateral are 0 and 3
        let ring: &[usize] = if list.len() == 4 { &[0, 1, 3, 2] } else { &[0, 1, 2] };
        for (i, at) in ring.iter().enumerate() {
            let mut key = [list[*at], list[ring[(i + 1) % ring.len()]]];
            key.sort_unstable();
            around.entry(key).or_default().push(k);
        }
    }
    let normals: Vec<[f64; 3]> = facets.iter().map(|f| outward(mesh, *f)).collect();
    let limits = ANGLES_IN_SPACE.map(f64::to_radians);
    // planes: faces that no edge with an angle separates
    let mut plane: Vec<usize> = (0..facets.len()).collect();
    let mut bends: Vec<(usize, usize, f64)> = Vec::new();
    for list in around.values() {
        let [a, b] = list[..] else { continue };
        let cosine: f64 = (0..3).map(|d| normals[a][d] * normals[b][d]).sum();
        let angle = cosine.clamp(-1.0, 1.0).acos();
        if angle < limits[0] {
            let (a, b) = (root(&plane, a), root(&plane, b));
            plane[a.max(b)] = a.min(b);
        } else if angle < limits[1] {
            let (from, to) = (mesh.facet_centroid(facets[a]), mesh.facet_centroid(facets[b]));
            let along: f64 = (0..3).map(|d| (to[d] - from[d]) * normals[a][d]).sum();
            bends.push((a, b, if along < 0.0 { angle } else { -angle }));
        }
    }
    let mut angles: BTreeMap<usize, BTreeMap<usize, f64>> = BTreeMap::new();
    for (a, b, angle) in bends {
        let (a, b) = (root(&plane, a), root(&plane, b));
        angles.entry(a).or_default().insert(b, angle);
        angles.entry(b).or_default().insert(a, angle);
    }
    let alike = |list: &BTreeMap<usize, f64>, angle: f64| {
        let near = |x: &&f64| **x * angle > 0.0 && x.abs() < ALIKE * angle.abs() && angle.abs() < ALIKE * x.abs();
        list.values().filter(near).count() > 1
    };
    let both = angles.iter().flat_map(|(a, list)| list.iter().map(move |(b, angle)| (*a, *b, *angle)));
    let curved = both.filter(|(a, b, angle)| alike(&angles[a], *angle) && alike(&angles[b], *angle));
    curved.map(|(_, _, angle)| angle * angle / 6.0).fold(0.0, f64::max)
}

fn root(plane: &[usize], mut k: usize) -> usize {
    while plane[k] != k {
        k = plane[k];
    }
    k
}

/// The outward unit normal of a face in space.
fn outward(mesh: &Mesh, facet: FacetRef) -> [f64; 3] {
    let of = mesh.facet_vertices(facet);
    let list: Vec<[f64; 3]> = of.vertices().iter().map(|n| mesh.node(*n)).collect();
    let minus = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] { std::array::from_fn(|d| a[d] - b[d]) };
    let (u, v) = (minus(list[1], list[0]), minus(list[2], list[0]));
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let out = minus(mesh.facet_centroid(facet), mesh.centroid(facet.cell));
    let side: f64 = (0..3).map(|d| n[d] * out[d]).sum();
    let size = (0..3).map(|d| n[d] * n[d]).sum::<f64>().sqrt() * side.signum();
    n.map(|x| x / size)
}

/// The mesh of second order whose faces along curves are arcs: the middle of a face of length `l` between neighbours at the
/// angle `a` is moved out by `l/2 tan(a/4)`, as that of a circle with this polygon.
///
/// # Errors
/// What [`second_order`] gives, and a cell that an arc turns inside out.
pub fn along_curves(mesh: Mesh, bodies: &[Vec<FacetRef>]) -> Result<Mesh, MeshError> {
    let found = curves(&mesh, bodies);
    let mut moved = BTreeMap::new();
    for facet in bodies.iter().flatten() {
        let ends = directed(&mesh, *facet);
        let mut key = ends;
        key.sort_unstable();
        let Some([angle, _]) = found.faces.get(&key) else { continue };
        let [a, b] = ends.map(|n| mesh.node(n));
        let (length, bend) = (distance(a, b), 0.5 * (angle / 4.0).tan());
        // to the right of the direction in which the body is on the left
        let normal = [(b[1] - a[1]) / length, (a[0] - b[0]) / length];
        moved.entry(key).or_insert([bend * length * normal[0], bend * length * normal[1], 0.0]);
    }
    bent(mesh, &moved)
}

/// The ends of a face in the order in which its cell lies on the left.
fn directed(mesh: &Mesh, facet: FacetRef) -> [NodeId; 2] {
    let vertices = mesh.facet_vertices(facet).vertices;
    let [a, b] = [vertices[0], vertices[1]];
    let ([p, q], c) = ([a, b].map(|n| mesh.node(n)), mesh.centroid(facet.cell));
    let left = (q[0] - p[0]) * (c[1] - p[1]) - (q[1] - p[1]) * (c[0] - p[0]) > 0.0;
    if left { [a, b] } else { [b, a] }
}

/// The angle by which the direction turns to the left from one face to the next, in radians.
fn turn(mesh: &Mesh, before: [NodeId; 2], behind: [NodeId; 2]) -> f64 {
    let along = |ends: [NodeId; 2]| {
        let [p, q] = ends.map(|n| mesh.node(n));
        [q[0] - p[0], q[1] - p[1]]
    };
    let (a, b) = (along(before), along(behind));
    (a[0] * b[1] - a[1] * b[0]).atan2(a[0] * b[0] + a[1] * b[1])
}

/// By body (a set of cells) its faces: those with no cell of it on the other side.
#[must_use]
pub fn faces_of(mesh: &Mesh, topology: &Topology, cells: &[CellId]) -> Vec<FacetRef> {
    let mut is_in = vec![false; mesh.n_cells()];
    cells.iter().for_each(|cell| is_in[cell.index()] = true);
    let mut out = Vec::new();
    for cell in cells {
        for local in 0..mesh.kind(*cell).facets().len() {
            let facet = FacetRef { cell: *cell, local: local as u8 };
            if topology.opposite(facet).is_none_or(|other| !is_in[other.cell.index()]) {
                out.push(facet);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{BoxShape, generate_box, map_nodes};

    fn ring(n: usize, shape: BoxShape) -> Mesh {
        let mesh = generate_box([1.0, 0.0, 0.0], [2.0, 1.5, 0.0], [2, n, 1], 2, shape).expect("a mesh");
        let place = |x: [f64; 3]| Ok::<_, ()>([x[0] * x[1].cos(), x[0] * x[1].sin(), 0.0]);
        map_nodes(mesh, place).expect("a mesh")
    }

    fn all_faces(mesh: &Mesh) -> Vec<Vec<FacetRef>> {
        let topology = Topology::new(mesh).expect("a topology");
        vec![faces_of(mesh, &topology, &mesh.cells().collect::<Vec<_>>())]
    }

    #[test]
    fn cells_of_second_order_have_the_places_of_the_first() {
        for (shape, dim) in [
            (BoxShape::Segment, 1),
            (BoxShape::Triangle, 2),
            (BoxShape::Quadrilateral, 2),
            (BoxShape::Tetrahedron, 3),
            (BoxShape::Hexahedron, 3),
        ] {
            let mesh = generate_box([0.0; 3], [1.0, 2.0, 3.0], [2, 2, 2], dim, shape).expect("a mesh");
            let centres: Vec<[f64; 3]> = mesh.cells().map(|c| mesh.centroid(c)).collect();
            let old = mesh.n_nodes();
            let made = second_order(mesh).expect("a mesh");
            assert_eq!((made.order(), made.nodes()[..old].len()), (2, old));
            for (cell, centre) in made.cells().zip(&centres) {
                assert!(made.map_order(cell) == 0 && distance(made.centroid(cell), *centre) < 1e-14);
            }
            // 2 cells a side have 5 nodes a side, each once
            assert_eq!(made.n_nodes(), 5usize.pow(dim as u32), "{shape:?}");
        }
    }

    #[test]
    fn a_polygon_of_a_circle_becomes_one_of_arcs_and_corners_stay() {
        for shape in [BoxShape::Triangle, BoxShape::Quadrilateral] {
            let mesh = ring(6, shape);
            let bodies = all_faces(&mesh);
            let found = curves(&mesh, &bodies);
            // five angles of a quarter radian on each of the two circles; faces at the ends have one neighbour alone
            assert_eq!(found.faces.len(), 2 * 4);
            assert!((found.largest - 0.25f64.powi(2) / 6.0).abs() < 1e-12);
            let old = mesh.n_nodes();
            let made = along_curves(mesh, &bodies).expect("a mesh");
            let radius = |x: &[f64; 3]| x[0].hypot(x[1]);
            let on = made.nodes()[old..].iter().filter(|x| (radius(x) - 2.0).abs() < 1e-12).count();
            assert_eq!(on, 4, "middles of faces on the outer circle");
        }
        let square = generate_box([0.0; 3], [1.0; 3], [4, 4, 1], 2, BoxShape::Triangle).expect("a mesh");
        let bodies = all_faces(&square);
        assert!(curves(&square, &bodies).faces.is_empty());
    }
    #[test]
    fn curved_surfaces_in_space_are_seen_and_boxes_are_not() {
        for shape in [BoxShape::Tetrahedron, BoxShape::Hexahedron] {
            let mesh = generate_box([1.0, 0.0, 0.0], [2.0, 1.5, 1.0], [2, 6, 2], 3, shape).expect("a mesh");
            assert_eq!(curved_in_space(&mesh, &all_faces(&mesh)), 0.0);
            let place = |x: [f64; 3]| Ok::<_, ()>([x[0] * x[1].cos(), x[0] * x[1].sin(), x[2]]);
            let mesh = map_nodes(mesh, place).expect("a mesh");
            let found = curved_in_space(&mesh, &all_faces(&mesh));
            assert!((found - 0.25f64.powi(2) / 6.0).abs() < 1e-10, "{shape:?}: {found}");
        }
    }
}
