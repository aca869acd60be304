//! The closest point of faces of a deformed body: on a face, an edge or a corner.
//!
//! Over each part of a face (itself, its edges, its corners) the distance is made stationary with Newton's method; the nearest
//! stationary point that lies on its part and is a minimum there is the closest point of the face. Of the faces that oppose
//! the normal of the point there, within 60 degrees, the nearest within `reach` counts, of equally near ones the first. The image
//! shifts with the matrix `C = B A^-1 B'`, where `B` are the tangents of the part in the reference placement: of rank 2, 1
//! (an edge) or 0 (a corner) in space. Promises: no memory of earlier images.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::{
    boxes::Bounds,
    faces::{FaceNode, FacePoint},
    rays::{ALIKE, CLOSED, Current, FAR, FOUND, Hit, ITERATIONS, Ray, SETTLED, Targets, inside, samples},
};
use wfl_mesh::mesh::{CellKind, Mesh};

/// A face opposes the normal of a point where theirs has a smaller product with it. Sides that meet at a right angle do not: their
/// closest point would be the corner, at no distance along the normal, for a little less than that angle, and none for more.
const OPPOSED: f64 = -0.5;
/// A step is halved while it leads further away.
const HALVINGS: usize = 20;

/// A part of a face: its parameters are `origin + along q`, with `dim` numbers `q`.
#[derive(Clone, Copy, Debug)]
struct Part {
    dim: usize,
    origin: [f64; 3],
    along: [[f64; 2]; 2],
}

/// The closest point of a part.
#[derive(Clone, Copy, Debug)]
struct Foot {
    part: Part,
    p: [f64; 3],
    distance: f64,
}

/// A face at a place with what the distance from a point is made of there.
struct Near {
    at: FacePoint,
    /// Current tangents along the part.
    tangents: [Vector3<f64>; 2],
    /// From the face to the point.
    from: Vector3<f64>,
    /// Half the second derivatives of the squared distance.
    hessian: Matrix2<f64>,
}

impl Part {
    fn face() -> Self {
        Self { dim: 2, origin: [0.0; 3], along: [[1.0, 0.0], [0.0, 1.0]] }
    }

    fn edge(a: [f64; 3], b: [f64; 3]) -> Self {
        Self { dim: 1, origin: a, along: [[b[0] - a[0], b[1] - a[1]], [0.0; 2]] }
    }

    fn corner(a: [f64; 3]) -> Self {
        Self { dim: 0, origin: a, along: [[0.0; 2]; 2] }
    }

    fn at(&self, q: Vector2<f64>) -> [f64; 3] {
        let [o1, o2, _] = self.origin;
        let [a, b] = self.along;
        [o1 + q[0] * a[0] + q[1] * b[0], o2 + q[0] * a[1] + q[1] * b[1], 0.0]
    }

    /// Sums over two parameters of a face along the two of the part.
    fn combine(&self, of: [Vector3<f64>; 2]) -> [Vector3<f64>; 2] {
        self.along.map(|a| of[0] * a[0] + of[1] * a[1])
    }
}

/// The face itself, its edges and its corners.
fn parts(kind: CellKind) -> [Vec<Part>; 3] {
    let vertices = kind.vertices();
    let corners = vertices.iter().map(|v| Part::corner(*v)).collect();
    if kind == CellKind::Segment {
        let [a, b] = [vertices[0], vertices[1]];
        return [vec![Part::edge(a, b)], Vec::new(), corners];
    }
    let on_side = |side: usize| vertices.iter().copied().filter(move |v| inside(kind, *v)[side] == 0.0);
    let edges = (0..4).filter_map(|side| {
        let mut ends = on_side(side);
        Some(Part::edge(ends.next()?, ends.next()?))
    });
    [vec![Part::face()], edges.collect(), corners]
}

/// How far a point is from a box.
fn distance(x: &Vector3<f64>, bounds: &Bounds) -> f64 {
    (bounds[0] - x).sup(&(x - bounds[1])).sup(&Vector3::zeros()).norm()
}

/// The inverse of the first `dim` rows and columns, zero beside them; `None` unless positive definite.
fn definite_inverse(m: &Matrix2<f64>, dim: usize) -> Option<Matrix2<f64>> {
    match dim {
        0 => Some(Matrix2::zeros()),
        1 => (m[(0, 0)] > 0.0).then(|| Matrix2::new(1.0 / m[(0, 0)], 0.0, 0.0, 0.0)),
        _ if m[(0, 0)] > 0.0 && m.determinant() > 0.0 => m.try_inverse(),
        _ => None,
    }
}

impl Targets {
    /// The closest point of all faces that oppose the normal of a point.
    pub(super) fn closest(&self, mesh: &Mesh, current: &Current, ray: &Ray) -> Option<Hit> {
        let (dim, nodes) = (mesh.dim(), current.nodes.as_slice());
        let mut best: Option<(Foot, usize)> = None;
        let alike = |distance: f64| ALIKE * (ray.x.amax() + distance);
        self.tree.nearest(&current.boxes, |bounds| distance(&ray.x, bounds), &mut |face| {
            let k = face as usize;
            if self.list[k].facet.cell != ray.cell
                && let Some(foot) = self.foot(k, nodes, ray)
                && foot.distance <= self.reach
                && self.opposes(dim, k, nodes, &foot, ray)
            {
                let is_nearer = best.is_none_or(|(least, first)| {
                    let margin = alike(least.distance);
                    let is_alike = (foot.distance - least.distance).abs() <= margin;
                    foot.distance < least.distance - margin || (is_alike && k < first)
                });
                if is_nearer {
                    best = Some((foot, k));
                }
            }
            let bound = best.map_or(self.reach, |(foot, _)| foot.distance);
            bound + alike(bound)
        });
        let (foot, k) = best?;
        let near = self.near(k, nodes, &foot.part, foot.p, ray.x);
        let rest = self.faces.at_rest(k, foot.p);
        let reference = foot.part.combine(rest.tangents);
        let inverse = definite_inverse(&near.hessian, foot.part.dim)?;
        let mut c = Matrix3::zeros();
        for (a, b) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            c += reference[a] * reference[b].transpose() * inverse[(a, b)];
        }
        let outward = near.at.outward(dim)?;
        let hit = self.hit_at(mesh, k, &rest, foot.p, &c)?;
        Some(Hit { gap: near.from.dot(&outward), rank: foot.part.dim, ..hit })
    }

    /// Whether a face opposes the normal of a point at its closest point, and lies no further behind the point than it may.
    fn opposes(&self, dim: usize, face: usize, nodes: &[FaceNode], foot: &Foot, ray: &Ray) -> bool {
        let at = self.faces.at(nodes, face, foot.p, 1);
        at.outward(dim).is_some_and(|outward| outward.dot(&ray.n) < OPPOSED) && (ray.x - at.y).dot(&ray.n) <= ray.back
    }

    /// The closest point of a face. Its edges are looked at where the face itself has none, or one further away than some
    /// other of its points.
    fn foot(&self, face: usize, nodes: &[FaceNode], ray: &Ray) -> Option<Foot> {
        let kind = self.faces.kind(face);
        let mut sampled = f64::INFINITY;
        let mut nearest = kind.reference_centre();
        for p in samples(kind) {
            let y = self.faces.at(nodes, face, p, 1).y;
            if (ray.x - y).norm() < sampled {
                (sampled, nearest) = ((ray.x - y).norm(), p);
            }
        }
        let mut best: Option<Foot> = None;
        for parts in parts(kind) {
            for part in parts {
                let found = self.foot_on(face, nodes, &part, ray.x, nearest);
                best = match (best, found) {
                    (Some(a), Some(b)) if b.distance < a.distance - ALIKE * (ray.x.amax() + a.distance) => Some(b),
                    (None, found) => found,
                    (best, _) => best,
                };
            }
            if best.is_some_and(|foot| foot.distance <= sampled * (1.0 + CLOSED)) {
                break;
            }
        }
        best
    }

    /// The closest point of a part of a face; `None` where there is none between its ends.
    fn foot_on(&self, face: usize, nodes: &[FaceNode], part: &Part, x: Vector3<f64>, from: [f64; 3]) -> Option<Foot> {
        let kind = self.faces.kind(face);
        let mut q = start(part, from);
        let (mut step, mut last, mut halvings) = (Vector2::zeros(), f64::INFINITY, 0);
        let mut least = f64::INFINITY;
        for _ in 0..ITERATIONS {
            let near = self.near(face, nodes, part, part.at(q), x);
            let distance = near.from.norm();
            if distance > least * (1.0 + CLOSED) + ALIKE * x.amax() && halvings < HALVINGS {
                halvings += 1;
                step *= 0.5;
                q -= step;
                continue;
            }
            (least, halvings) = (distance, 0);
            let slope = Vector2::new(near.from.dot(&near.tangents[0]), near.from.dot(&near.tangents[1]));
            // uphill curvature is left out: then this is a step of Gauss and Newton
            let metric = Matrix2::from_fn(|a, b| near.tangents[a].dot(&near.tangents[b]));
            let inverse = definite_inverse(&near.hessian, part.dim).or_else(|| definite_inverse(&metric, part.dim))?;
            step = inverse * slope;
            q += step;
            let size = step.amax();
            let is_rounding = size < FOUND && size >= last;
            last = size;
            if size < SETTLED || is_rounding || q.iter().any(|x| x.abs() > FAR) {
                break;
            }
        }
        let p = part.at(q);
        // the edges that a part ends at are parts of their own; of a flat pair of faces one has the point between them
        if !(last < FOUND && inside(kind, p).iter().all(|inside| *inside >= -CLOSED)) {
            return None;
        }
        let near = self.near(face, nodes, part, p, x);
        definite_inverse(&near.hessian, part.dim)?;
        Some(Foot { part: *part, p, distance: near.from.norm() })
    }

    /// A face at some of its parameters, seen from `x`.
    fn near(&self, face: usize, nodes: &[FaceNode], part: &Part, p: [f64; 3], x: Vector3<f64>) -> Near {
        let at = self.faces.at(nodes, face, p, 2);
        let tangents = part.combine(at.tangents);
        let bend = at.bend;
        #[cfg(test)]
        let bend = mutants::of(bend, self.faces.at_rest(face, p).bend);
        let [y11, y12, y22] = bend;
        let from = x - at.y;
        let hessian = Matrix2::from_fn(|a, b| {
            let (s, t) = (part.along[a], part.along[b]);
            let bend = y11 * (s[0] * t[0]) + y12 * (s[0] * t[1] + s[1] * t[0]) + y22 * (s[1] * t[1]);
            tangents[a].dot(&tangents[b]) - from.dot(&bend)
        });
        Near { at, tangents, from, hessian }
    }
}

/// The parameters of a part that are nearest to those of its face.
fn start(part: &Part, from: [f64; 3]) -> Vector2<f64> {
    let d = Vector2::new(from[0] - part.origin[0], from[1] - part.origin[1]);
    let q = part.along.map(|a| {
        let size = a[0] * a[0] + a[1] * a[1];
        if size > 0.0 { (d[0] * a[0] + d[1] * a[1]) / size } else { 0.0 }
    });
    Vector2::from(q)
}

/// Parts of the curvature left out on purpose, for the test that each of them is missed.
#[cfg(test)]
mod mutants {
    use std::cell::Cell;

    use nalgebra::Vector3;

    /// What is left out.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub(super) enum Part {
        /// Curvature of the reference face.
        Reference,
        /// What the displacement bends.
        Displacement,
    }

    thread_local! {
        pub(super) static LEFT_OUT: Cell<Option<Part>> = const { Cell::new(None) };
    }

    pub(super) fn of(all: [Vector3<f64>; 3], reference: [Vector3<f64>; 3]) -> [Vector3<f64>; 3] {
        match LEFT_OUT.get() {
            None => all,
            Some(Part::Displacement) => reference,
            Some(Part::Reference) => [0, 1, 2].map(|k| all[k] - reference[k]),
        }
    }
}

#[cfg(test)]
mod tests {
    use wfl_compiler::types::ImageBy;
    use wfl_mesh::{
        element::Family,
        mesh::{BoxShape, CellId, Mesh, RawMesh, RegionSet, Topology, generate_box, interface},
        quadrature::gauss,
    };

    use super::mutants::{LEFT_OUT, Part};
    use crate::{
        domain::{Domain, Follows, ImageSearch, MovingPoints, ShiftCheck},
        space::Space,
    };

    /// Shifts of images on the twisted faces between two layers of hexahedra.
    fn shifts() -> ShiftCheck {
        let raw = generate_box([0.0; 3], [2.0; 3], [2; 3], 3, BoxShape::Hexahedron).unwrap().into_raw();
        let twisted = raw.nodes.iter().map(|[x, y, z]| [*x, *y, z + 0.1 * x * y - 0.05 * x * x * y]).collect();
        let mesh = Mesh::from_raw(RawMesh { nodes: twisted, ..raw }).unwrap();
        let topology = Topology::new(&mesh).unwrap();
        let is_above = |cell: &CellId| mesh.centroid(*cell)[2] > 1.05;
        let (above, below): (Vec<CellId>, Vec<CellId>) = mesh.cells().partition(is_above);
        let RegionSet::Interface(pairs) = interface(&mesh, &topology, &above, &below).unwrap() else { panic!() };
        let sole = RegionSet::Facets(pairs.iter().map(|pair| pair.here).collect());
        let floor: Vec<_> = pairs.iter().map(|pair| pair.there).collect();
        let base = Domain::new(&mesh, &sole, &|kind| gauss(kind, 3).unwrap()).unwrap();
        let follows = |field: usize, cells: &[CellId]| Follows {
            field,
            space: Space::on_cells(&mesh, &topology, cells, 2, Family::Continuous).unwrap().into(),
        };
        let search = ImageSearch { by: ImageBy::Closest, reach: 0.5, pieces: None };
        let points = MovingPoints::new(&mesh, &base, &floor, [follows(0, &above), follows(1, &below)], search);
        points.unwrap().check_shifts(&mesh)
    }

    #[test]
    fn no_part_of_the_curvature_can_be_left_out() {
        let whole = shifts();
        assert!(whole.points > whole.all / 2 && whole.error < 1e-7, "{whole:?}");
        for part in [Part::Reference, Part::Displacement] {
            LEFT_OUT.set(Some(part));
            let found = shifts();
            LEFT_OUT.set(None);
            assert!(found.points > found.all / 2 && found.error > 1e-4, "without {part:?}: {found:?}");
        }
    }
}
