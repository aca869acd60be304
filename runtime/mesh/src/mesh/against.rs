//! Facets of the boundary that lie on one another from two sides: where cells meet without a common facet.
//!
//! Promises: tolerances are relative to the facets; of two facets that differ in size the small one lies on the large one,
//! on its curve where that is bent. The search looks at facets of the boundary alone, sorted by size and place, so that it
//! stays cheap in graded meshes. Does not judge: bodies in contact, flanks of a crack and torn meshes all have such facets.

use super::{
    CellKind, Mesh, Topology,
    index::{FacetRef, NodeId},
    pair::outward,
};
use crate::{
    polygon::{self, Polygon},
    vector::{cross, difference, distance, dot, norm},
};

/// A vertex lies on a facet within this part of its size: as for vertices that coincide.
const ON_IT: f64 = 1e-6;
/// ... and within this part of how far the facet is bent: two interpolations of one curve differ by less.
const OF_BEND: f64 = 0.1;
/// ... and within this part of its coordinates: far from the origin numbers are no finer.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Outward normals of facets that face each other have a product below this one: 25 degrees for pieces of a curve.
const OPPOSITE: f64 = -0.9;
/// Facets overlap if they have more than this part of the smaller one in common: less is rounding at their borders.
const IN_COMMON: f64 = 1e-3;

/// Two facets of the boundary that lie on one another, their cells on two sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Against {
    /// The larger one.
    pub large: FacetRef,
    /// The smaller one.
    pub small: FacetRef,
    /// They have all vertices at the same places.
    pub matches: bool,
}

/// A facet of the boundary with what the search needs.
struct Outer {
    facet: FacetRef,
    vertices: Vec<NodeId>,
    centre: [f64; 3],
    /// Largest distance of a vertex from the centre; for a point the size of its cell.
    radius: f64,
    /// Outward, of unit length.
    normal: [f64; 3],
    /// The length within which a point lies on the facet.
    tolerance: f64,
    /// Some node lies outside of the plane of the vertices by more than that.
    is_bent: bool,
}

impl Outer {
    fn new(mesh: &Mesh, facet: FacetRef) -> Outer {
        let of_facet = mesh.facet_vertices(facet);
        let vertices = of_facet.vertices().to_vec();
        let x: Vec<[f64; 3]> = vertices.iter().map(|v| mesh.node(*v)).collect();
        let centre = std::array::from_fn(|i| x.iter().map(|x| x[i]).sum::<f64>() / x.len() as f64);
        let radius = match x.len() {
            1 => mesh.cell_diameter(facet.cell),
            _ => x.iter().map(|x| distance(*x, centre)).fold(0.0, f64::max),
        };
        let normal = outward(mesh, facet, centre);
        let far = x.iter().flatten().fold(0.0, |m: f64, c| m.max(c.abs()));
        let closure = mesh.geometry_element(mesh.kind(facet.cell)).facet_closure(facet.local as usize);
        let nodes = mesh.cell_nodes(facet.cell);
        let off = |dof: &usize| dot(normal, difference(mesh.node(nodes[*dof]), x[0])).abs();
        let bend = closure.iter().map(off).fold(0.0, f64::max);
        let straight = ON_IT * radius + ROUNDING * far;
        let tolerance = straight + OF_BEND * bend;
        Outer { facet, vertices, centre, radius, normal, tolerance, is_bent: bend > straight }
    }

    /// Directions in the plane of the facet.
    fn plane(&self, mesh: &Mesh) -> [[f64; 3]; 2] {
        let edge = difference(mesh.node(self.vertices[1]), mesh.node(self.vertices[0]));
        let along = edge.map(|c| c / norm(edge));
        [along, cross(self.normal, along)]
    }

    /// How far a point is from the facet along its normal.
    fn offset(&self, mesh: &Mesh, x: [f64; 3]) -> f64 {
        let corner = mesh.node(self.vertices[0]);
        if !self.is_bent {
            return dot(self.normal, difference(x, corner)).abs();
        }
        let kind = mesh.facet_kind(self.facet);
        let axes: Vec<[f64; 3]> =
            kind.axes().iter().map(|axis| difference(mesh.node(self.vertices[*axis]), corner)).collect();
        let from = difference(x, corner);
        let (a, b) = (axes[0], axes.get(1).copied().unwrap_or_default());
        let (aa, ab, bb) = (dot(a, a), dot(a, b), dot(b, b));
        let (of_a, of_b) = (dot(a, from), dot(b, from));
        let parameters = match kind.dim() {
            1 => [of_a / aa, 0.0, 0.0],
            _ => {
                let determinant = aa * bb - ab * ab;
                [(bb * of_a - ab * of_b) / determinant, (aa * of_b - ab * of_a) / determinant, 0.0]
            }
        };
        let table = mesh.geometry_element(kind).tabulate(&[parameters], 0);
        dot(self.normal, difference(x, mesh.facet_point_at(self.facet, &table, 0))).abs()
    }

    /// Whether a smaller facet lies on this one from the other side.
    fn carries(&self, mesh: &Mesh, small: &Outer) -> bool {
        if distance(self.centre, small.centre) > self.radius + small.radius
            || dot(self.normal, small.normal) > OPPOSITE
            || self.facet.cell == small.facet.cell
        {
            return false;
        }
        if self.vertices.len() == 1 {
            return distance(self.centre, small.centre) <= self.tolerance;
        }
        let on_it = |v: &NodeId| self.offset(mesh, mesh.node(*v)) <= self.tolerance;
        self.overlaps(mesh, small) && small.vertices.iter().all(on_it)
    }

    /// Whether two facets have more than their borders in common, seen along the normal of this one.
    fn overlaps(&self, mesh: &Mesh, small: &Outer) -> bool {
        let axes = self.plane(mesh);
        let flat = |of: &Outer| -> Polygon {
            let loop_order: &[usize] = if of.vertices.len() == 4 { &[0, 1, 3, 2] } else { &[0, 1, 2] };
            let corners = loop_order.iter().take(of.vertices.len()).map(|k| of.vertices[*k]);
            corners.map(|v| axes.map(|axis| dot(axis, difference(mesh.node(v), self.centre)))).collect()
        };
        let (ours, mut theirs) = (flat(self), flat(small));
        if ours.len() == 2 {
            let ends = |p: &Polygon| [p[0][0].min(p[1][0]), p[0][0].max(p[1][0])];
            let ([a, b], [c, d]) = (ends(&ours), ends(&theirs));
            return b.min(d) - a.max(c) > IN_COMMON * (d - c);
        }
        let mut window = ours;
        for polygon in [&mut window, &mut theirs] {
            if polygon::area(polygon) < 0.0 {
                polygon.reverse();
            }
        }
        let common = polygon::inside(&theirs, &window, self.tolerance);
        polygon::area(&common) > IN_COMMON * polygon::area(&theirs)
    }

    /// Whether all vertices of a facet of as many have one of this facet at their place.
    fn matches(&self, mesh: &Mesh, small: &Outer) -> bool {
        let here = |v: &NodeId| {
            let x = mesh.node(*v);
            self.vertices.iter().any(|other| distance(mesh.node(*other), x) <= self.tolerance)
        };
        self.vertices.len() == small.vertices.len() && small.vertices.iter().all(here)
    }
}

/// Facets in boxes that are as large as they are, so that few are in one.
struct Boxes {
    low: [f64; 3],
    /// Sizes that occur, as powers of 2, ascending.
    levels: Vec<i32>,
    entries: Vec<(i32, [i64; 3], u32)>,
}

impl Boxes {
    fn new(outer: &[Outer], low: [f64; 3]) -> Boxes {
        let mut boxes = Boxes { low, levels: Vec::new(), entries: Vec::with_capacity(outer.len()) };
        for (k, facet) in outer.iter().enumerate() {
            let level = level(facet.radius);
            boxes.entries.push((level, boxes.place(level, facet.centre), k as u32));
        }
        boxes.entries.sort_unstable();
        boxes.levels.extend(boxes.entries.iter().map(|entry| entry.0));
        boxes.levels.dedup();
        boxes
    }

    /// A box of a level is as wide as the facets of it and as large ones reach together.
    fn place(&self, level: i32, x: [f64; 3]) -> [i64; 3] {
        let width = 2.0 * f64::from(level).exp2();
        std::array::from_fn(|i| ((x[i] - self.low[i]) / width).floor() as i64)
    }

    /// Calls `visit` for the facets of a level near a place.
    fn near(&self, level: i32, x: [f64; 3], mut visit: impl FnMut(usize)) {
        let [i, j, k] = self.place(level, x);
        for i in i - 1..=i + 1 {
            for j in j - 1..=j + 1 {
                let from = self.entries.partition_point(|(l, at, _)| (*l, *at) < (level, [i, j, k - 1]));
                let near = self.entries[from..].iter().take_while(|(l, at, _)| (*l, *at) <= (level, [i, j, k + 1]));
                near.for_each(|entry| visit(entry.2 as usize));
            }
        }
    }
}

/// The power of 2 that a size does not exceed.
fn level(radius: f64) -> i32 {
    radius.log2().ceil().clamp(-1000.0, 1000.0) as i32
}

/// All pairs of facets of the boundary that lie on one another from two sides, by the numbers of their cells.
#[must_use]
pub fn facets_against(mesh: &Mesh, topology: &Topology) -> Vec<Against> {
    let alone = topology.facets().iter().filter(|facet| facet.there.is_none());
    let outer: Vec<Outer> = alone.map(|facet| Outer::new(mesh, facet.here)).collect();
    let boxes = Boxes::new(&outer, mesh.bounds().0);
    let mut found = Vec::new();
    for (k, small) in outer.iter().enumerate() {
        let own = level(small.radius);
        for larger in boxes.levels.iter().filter(|level| **level >= own) {
            boxes.near(*larger, small.centre, |other| {
                let large = &outer[other];
                // of two of one size the one of lower number is the large one
                let is_larger = (large.radius, k) > (small.radius, other);
                if is_larger && large.carries(mesh, small) {
                    let matches = large.matches(mesh, small);
                    found.push(Against { large: large.facet, small: small.facet, matches });
                }
            });
        }
    }
    found.sort_unstable_by_key(|pair| (pair.large, pair.small));
    found
}

/// A facet that others divide: they lie on it, and all its vertices are theirs, too.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Divided {
    /// The facet.
    pub whole: FacetRef,
    /// Those on it that have a vertex of it.
    pub parts: Vec<FacetRef>,
    /// A vertex of these that lies on the facet, nearer to its middle than its own vertices.
    pub hanging: Option<NodeId>,
}

/// The facets whose vertices are all vertices of facets against them: the cells are joined around the facet, and not on it. A
/// flank of a crack has vertices of its own but at the front, bodies that touch have none in common.
#[must_use]
pub fn divided_facets(mesh: &Mesh, pairs: &[Against]) -> Vec<Divided> {
    let mut sides: Vec<(FacetRef, FacetRef)> = pairs.iter().map(|p| (p.large, p.small)).collect();
    sides.extend(pairs.iter().map(|p| (p.small, p.large)));
    sides.sort_unstable();
    let mut found = Vec::new();
    for of_one in sides.chunk_by(|a, b| a.0 == b.0) {
        let whole = of_one[0].0;
        let vertices = |facet: FacetRef| mesh.facet_vertices(facet).vertices().to_vec();
        let corners = vertices(whole);
        if mesh.facet_kind(whole) == CellKind::Point {
            continue;
        }
        let touching = |other: &FacetRef| vertices(*other).iter().any(|v| corners.contains(v));
        let parts: Vec<FacetRef> = of_one.iter().map(|side| side.1).filter(touching).collect();
        let theirs: Vec<NodeId> = parts.iter().flat_map(|part| vertices(*part)).collect();
        if corners.iter().all(|corner| theirs.contains(corner)) {
            // of faces that overlap in part vertices lie beside each other
            let centre = mesh.facet_centroid(whole);
            let from = |v: &NodeId| distance(mesh.node(*v), centre);
            let within = corners.iter().map(from).fold(f64::INFINITY, f64::min);
            let others = theirs.iter().copied().filter(|v| !corners.contains(v) && from(v) < within);
            let hanging = others.min_by(|a, b| from(a).total_cmp(&from(b)));
            found.push(Divided { whole, parts, hanging });
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{BoxShape, RawMesh, generate_box, second_order};

    /// The cells of one mesh beside those of another; nodes at one place are one where `joined` says so.
    fn beside(first: Mesh, second: Mesh, joined: impl Fn([f64; 3]) -> bool) -> Mesh {
        let (mut raw, other) = (first.into_raw(), second.into_raw());
        let mut new = Vec::new();
        for x in &other.nodes {
            let there = raw.nodes.iter().position(|y| joined(*x) && distance(*x, *y) < 1e-9);
            new.push(there.unwrap_or(raw.nodes.len()) as u32);
            if there.is_none() {
                raw.nodes.push(*x);
            }
        }
        raw.kinds.extend(other.kinds);
        raw.connectivity.extend(other.connectivity.iter().map(|node| new[*node as usize]));
        Mesh::from_raw(raw).unwrap()
    }

    fn boxed(x: f64, cells: [usize; 3], dim: usize, shape: BoxShape) -> Mesh {
        generate_box([x, 0.0, 0.0], [x + 1.0, 1.0, 1.0], cells, dim, shape).unwrap()
    }

    fn found(mesh: &Mesh) -> (Vec<Against>, Vec<Divided>) {
        let pairs = facets_against(mesh, &Topology::new(mesh).unwrap());
        let divided = divided_facets(mesh, &pairs);
        (pairs, divided)
    }

    const FLAT: [(usize, BoxShape); 4] =
        [(2, BoxShape::Triangle), (2, BoxShape::Quadrilateral), (3, BoxShape::Tetrahedron), (3, BoxShape::Hexahedron)];

    #[test]
    fn faces_that_the_other_side_divides_are_found_with_the_node_that_hangs() {
        for (dim, shape) in FLAT {
            for order in [1, 2] {
                let of = |mesh: Mesh| if order == 2 { second_order(mesh).unwrap() } else { mesh };
                let (coarse, fine) = (boxed(0.0, [1; 3], dim, shape), boxed(1.0, [1, 2, 2], dim, shape));
                let mesh = beside(of(coarse), of(fine), |_| true);
                let (_, divided) = found(&mesh);
                let expected = if shape == BoxShape::Tetrahedron { 2 } else { 1 };
                assert_eq!(divided.iter().filter(|d| d.hanging.is_some()).count(), expected, "{shape:?} {order}");
                assert!(divided.iter().all(|d| (mesh.facet_centroid(d.whole)[0] - 1.0).abs() < 1e-12));
            }
        }
    }

    /// Other diagonals of a square: no node hangs, and no face is shared.
    #[test]
    fn triangles_that_overlap_in_part_are_found() {
        let nodes =
            vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.5, -1.0], [0.5, 0.5, 1.0]];
        let connectivity = vec![0, 2, 1, 4, 0, 3, 2, 4, 0, 1, 3, 5, 1, 2, 3, 5];
        let kinds = vec![CellKind::Tetrahedron; 4];
        let raw = RawMesh { dim: 3, order: 1, nodes, kinds, connectivity, ..RawMesh::default() };
        let (pairs, divided) = found(&Mesh::from_raw(raw).unwrap());
        assert_eq!((pairs.len(), divided.len()), (4, 4));
        assert!(divided.iter().all(|d| d.hanging.is_none()) && pairs.iter().all(|p| !p.matches));
    }

    /// Bodies that touch have pairs of faces, and none that is divided: at the same nodes, at others, joined at the end of a
    /// crack, or at both of its ends.
    #[test]
    fn bodies_that_touch_and_flanks_of_cracks_have_no_divided_faces() {
        for (dim, shape) in FLAT {
            let of = |n: usize, at: fn([f64; 3]) -> bool| {
                found(&beside(boxed(0.0, [1, 3, 3], dim, shape), boxed(1.0, [1, n, n], dim, shape), at))
            };
            for n in [3, 4] {
                let (pairs, divided) = of(n, |_| false);
                assert!(!pairs.is_empty() && divided.is_empty(), "{shape:?} {n}");
                assert_eq!(pairs.iter().all(|p| p.matches), n == 3, "{shape:?} {n}");
            }
            let (pairs, divided) = of(4, |x| x[1] == 0.0);
            assert!(!pairs.is_empty() && divided.is_empty(), "{shape:?}");
            let (pairs, divided) = of(3, |_| true);
            assert!(pairs.is_empty() && divided.is_empty(), "{shape:?}");
        }
        let apart = found(&beside(boxed(0.0, [1; 3], 2, FLAT[0].1), boxed(1.001, [1; 3], 2, FLAT[0].1), |_| false));
        assert!(apart.0.is_empty());
        let line =
            found(&beside(boxed(0.0, [2; 3], 1, BoxShape::Segment), boxed(1.0, [2; 3], 1, BoxShape::Segment), |_| {
                false
            }));
        assert_eq!((line.0.len(), line.1.len()), (1, 0));
    }

    /// One edge of second order opposite two, all on a circle: neither lies on the chord of the other.
    #[test]
    fn a_curved_face_that_is_divided_is_found() {
        let ring = |from: f64, cells: usize| {
            let mesh =
                generate_box([from, 0.0, 0.0], [from + 1.0, 1.0, 1.0], [1, cells, 1], 2, BoxShape::Quadrilateral);
            let mesh = second_order(mesh.unwrap()).unwrap();
            let bend = |x: [f64; 3]| Ok::<_, ()>([x[0] * (0.5 * x[1]).cos(), x[0] * (0.5 * x[1]).sin(), 0.0]);
            crate::mesh::map_nodes(mesh, bend).unwrap()
        };
        let (_, divided) = found(&beside(ring(1.0, 1), ring(2.0, 2), |_| true));
        assert_eq!(divided.len(), 1);
    }
}
