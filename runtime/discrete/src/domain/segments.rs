//! Faces cut where they lie opposite of edges of other faces, and the points of the pieces.
//!
//! What is integrated over a face of contact reads the other side, whose functions have kinks at its edges: a rule on the
//! whole face does not see them, a rule on each piece between them is exact for polynomials. In the plane the vertices of the
//! other side are projected on the chord of a face, in space the other faces on the plane through its centre with its mean
//! normal, where they are cut with it as a window. Each piece has the points of a rule: of a segment, or of the triangles from
//! the mean of its corners. Points are carried to the parameters of the face; a curved face is cut as the parts of one level
//! of subdivision. Where several sheets lie opposite the nearest counts. Promises: a function of the places of both sides
//! alone, without a branch for faces that are plane. Does not know where images are: the points are placed here, no more.

use std::sync::Arc;

use nalgebra::{Matrix2, Vector2, Vector3};

use super::{
    boxes::{Bounds, BoxTree, Boxes},
    rays::{CLOSED, Targets, samples},
};
use crate::space::Space;
use wfl_mesh::{
    element::Table,
    mesh::{CellId, CellKind, FacetRef, Mesh},
    polygon::{Polygon, area, inside, middle, outside},
    quadrature::{QuadratureError, Rule, rule},
};

/// A corner that is further outside by less than this part of the size of a face counts as inside.
const BESIDE: f64 = 1e-10;
/// A piece with less than this part of a face is none.
const SLIVER: f64 = 1e-10;
/// Pieces that share more than this part of a face lie on two sheets.
const TWICE: f64 = 1e-9;
/// Iterations of the parameters of a point; Newton's method takes 1 to 6.
const ITERATIONS: usize = 30;
/// They are found when they move by less.
const SETTLED: f64 = 1e-15;

/// A point of a piece.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CutPoint {
    /// In the parameters of the face.
    pub(super) parameter: [f64; 3],
    /// Of integrals over the reference face.
    pub(super) weight: f64,
}

/// Faces, each as the parts that it is cut as.
#[derive(Clone, Debug)]
pub(super) struct CutFaces {
    facets: Vec<FacetRef>,
    /// The displacement that moves them, if one does.
    space: Option<Arc<Space>>,
    /// They are curved, so that each is cut as several parts.
    is_curved: bool,
    /// By face and side of its reference facet: by how much of the face it is extended there.
    margins: Vec<[f64; 4]>,
}

/// A face, or a part of a curved one, as the segment, triangle or bilinear face of its corners.
#[derive(Clone, Debug)]
pub(super) struct Part {
    cell: CellId,
    /// Counter-clockwise, seen from outside.
    corners: Vec<Vector3<f64>>,
    /// The first corner in the parameters of the face, and the ways from there to the second and to the last one.
    origin: [f64; 2],
    ways: [[f64; 2]; 2],
    centre: Vector3<f64>,
    /// Outward, of length 1.
    normal: Vector3<f64>,
    /// No corner is further from the centre.
    radius: f64,
}

/// The corners of the parts of a reference face, and the sides of the face that their sides 0 to 3 lie on, as `inside` of the
/// rays counts them.
fn outlines(kind: CellKind, is_curved: bool) -> Vec<Vec<[f64; 2]>> {
    let whole: Vec<[f64; 2]> = match kind {
        CellKind::Segment => vec![[0.0, 0.0], [1.0, 0.0]],
        CellKind::Triangle => vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        _ => vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
    };
    if !is_curved {
        return vec![whole];
    }
    let half = |from: [f64; 2], sign: f64| -> Vec<[f64; 2]> {
        whole.iter().map(|p| [from[0] + 0.5 * sign * p[0], from[1] + 0.5 * sign * p[1]]).collect()
    };
    match kind {
        CellKind::Segment => vec![half([0.0, 0.0], 1.0), half([0.5, 0.0], 1.0)],
        CellKind::Triangle => {
            vec![half([0.0, 0.0], 1.0), half([0.5, 0.0], 1.0), half([0.0, 0.5], 1.0), half([0.5, 0.5], -1.0)]
        }
        _ => [[0.0, 0.0], [0.5, 0.0], [0.0, 0.5], [0.5, 0.5]].map(|from| half(from, 1.0)).to_vec(),
    }
}

/// Corner `k` of an outline moved out where the sides beside it are those of the face with a margin.
fn extended(kind: CellKind, p: [f64; 2], margins: &[f64; 4]) -> [f64; 2] {
    let at = |distance: f64, side: usize| if distance == 0.0 { margins[side] } else { 0.0 };
    let [a, b] = p;
    match kind {
        CellKind::Segment => [a - at(a, 0) + at(1.0 - a, 1), 0.0],
        CellKind::Triangle => {
            // the corner at an end of the slanted side stays on it
            let (left, below, slanted) = (at(a, 0), at(b, 1), at(1.0 - a - b, 2));
            match (a == 0.0, b == 0.0, 1.0 - a - b == 0.0) {
                (false, true, true) => [a + slanted + below, -below],
                (true, false, true) => [-left, b + slanted + left],
                _ => [a - left + 0.5 * slanted, b - below + 0.5 * slanted],
            }
        }
        _ => [a - at(a, 0) + at(1.0 - a, 2), b - at(b, 1) + at(1.0 - b, 3)],
    }
}

/// The first two entries of parameters.
fn first_two(p: &[f64; 3]) -> [f64; 2] {
    [p[0], p[1]]
}

impl CutFaces {
    /// The faces where they are in the mesh, or moved by a displacement; by face how far they are extended at their sides.
    pub(super) fn new(mesh: &Mesh, facets: Vec<FacetRef>, space: Option<Arc<Space>>, margins: Vec<[f64; 4]>) -> Self {
        let degree = space.as_ref().map_or(1, |space| space.degree()).max(mesh.order());
        Self { facets, space, is_curved: degree > 1, margins }
    }

    /// By face its parts, at a displacement.
    pub(super) fn parts(&self, mesh: &Mesh, u: &[f64]) -> Vec<Vec<Part>> {
        let mut tables: Vec<((usize, u8), Tabulated)> = Vec::new();
        let mut of = |k: usize| {
            let facet = self.facets[k];
            let key = (mesh.kind(facet.cell).index(), facet.local);
            let known = tables.iter().position(|(known, _)| *known == key).unwrap_or_else(|| {
                tables.push((key, self.tabulated(mesh, facet)));
                tables.len() - 1
            });
            self.parts_of(mesh, k, u, &tables[known].1)
        };
        (0..self.facets.len()).map(&mut of).collect()
    }

    /// What the parts of all faces of one kind have in common.
    fn tabulated(&self, mesh: &Mesh, facet: FacetRef) -> Tabulated {
        let (kind, local) = (mesh.kind(facet.cell), usize::from(facet.local));
        let lattice = samples(mesh.facet_kind(facet));
        let map = kind.facet_map(local);
        let points: Vec<[f64; 3]> = lattice.iter().map(|p| kind.facet_point(local, map.apply(*p))).collect();
        let element = self.space.as_ref().and_then(|space| Some(space.element_at(space.position_of_cell(facet.cell)?)));
        let [s, t] = map.tangents.map(Vector3::from);
        let normal = Vector3::from(kind.facet_normal(local));
        let around = if mesh.dim() == 2 { Vector3::new(s[1], -s[0], 0.0) } else { s.cross(&t) };
        Tabulated {
            geometry: mesh.geometry_element(kind).tabulate(&points, 0),
            field: element.map(|element| element.tabulate(&points, 0)),
            lattice: lattice.iter().map(first_two).collect(),
            is_turned: around.dot(&normal) < 0.0,
        }
    }

    fn parts_of(&self, mesh: &Mesh, k: usize, u: &[f64], tabulated: &Tabulated) -> Vec<Part> {
        let (facet, dim) = (self.facets[k], mesh.dim());
        let kind = mesh.facet_kind(facet);
        let nodes = self.space.as_ref().and_then(|space| Some(space.entity_nodes(space.position_of_cell(facet.cell)?)));
        let place = |q: usize| {
            let mut x = Vector3::from(mesh.point_at(facet.cell, &tabulated.geometry, q));
            if let (Some(nodes), Some(table)) = (nodes, &tabulated.field) {
                for (node, value) in nodes.iter().zip(&table.values[q * table.n_dofs..]) {
                    let own = u.get(*node as usize * dim..(*node as usize + 1) * dim).unwrap_or_default();
                    own.iter().enumerate().for_each(|(i, u)| x[i] += u * value);
                }
            }
            x
        };
        let at = |p: &[f64; 2]| tabulated.lattice.iter().position(|q| q == p).map_or_else(Vector3::zeros, place);
        let margins = &self.margins[k];
        let part = |outline: Vec<[f64; 2]>| {
            let mut corners: Vec<Vector3<f64>> = outline.iter().map(at).collect();
            let origin = outline[0];
            let last = outline[outline.len() - 1];
            let ways = [outline[1], last].map(|p| [p[0] - origin[0], p[1] - origin[1]]);
            if margins.iter().any(|m| *m > 0.0) {
                let own: Vec<[f64; 2]> =
                    outline.iter().map(|p| in_part(extended(kind, *p, margins), origin, ways)).collect();
                corners = own.iter().map(|s| combined(&corners, *s)).collect();
            }
            Part::new(dim, facet.cell, corners, (origin, ways), tabulated.is_turned)
        };
        outlines(kind, self.is_curved).into_iter().map(part).collect()
    }
}

/// What the parts of all faces of one kind and local number have in common.
struct Tabulated {
    geometry: Table,
    field: Option<Table>,
    /// The parameters of the rows of both.
    lattice: Vec<[f64; 2]>,
    /// Counter-clockwise in the parameters is clockwise, seen from outside.
    is_turned: bool,
}

/// Parameters of a face in those of a part of it.
fn in_part(p: [f64; 2], origin: [f64; 2], ways: [[f64; 2]; 2]) -> [f64; 2] {
    let d = [p[0] - origin[0], p[1] - origin[1]];
    let [s, t] = ways;
    let determinant = s[0] * t[1] - s[1] * t[0];
    if determinant == 0.0 {
        // a segment has one parameter
        return [d[0] / s[0], 0.0];
    }
    [(d[0] * t[1] - d[1] * t[0]) / determinant, (s[0] * d[1] - s[1] * d[0]) / determinant]
}

/// The functions of the corners of a segment, a triangle or a quadrilateral and their derivatives, the corners in order
/// around.
fn functions(n: usize, [a, b]: [f64; 2]) -> ([f64; 4], [[f64; 2]; 4]) {
    match n {
        2 => ([1.0 - a, a, 0.0, 0.0], [[-1.0, 0.0], [1.0, 0.0], [0.0; 2], [0.0; 2]]),
        3 => ([1.0 - a - b, a, b, 0.0], [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0], [0.0; 2]]),
        _ => (
            [(1.0 - a) * (1.0 - b), a * (1.0 - b), a * b, (1.0 - a) * b],
            [[b - 1.0, a - 1.0], [1.0 - b, -a], [b, a], [-b, 1.0 - a]],
        ),
    }
}

/// The place of parameters of a part with these corners.
fn combined(corners: &[Vector3<f64>], s: [f64; 2]) -> Vector3<f64> {
    let values = functions(corners.len(), s).0;
    corners.iter().zip(values).map(|(x, value)| x * value).sum()
}

impl Part {
    fn new(
        dim: usize,
        cell: CellId,
        mut corners: Vec<Vector3<f64>>,
        parameters: ([f64; 2], [[f64; 2]; 2]),
        is_turned: bool,
    ) -> Self {
        let (mut origin, mut ways) = parameters;
        if is_turned && dim > 2 {
            // the first corner stays the first
            corners[1..].reverse();
            ways.reverse();
        } else if is_turned {
            corners.reverse();
            origin = [origin[0] + ways[0][0], origin[1] + ways[0][1]];
            ways = ways.map(|way| way.map(|x| -x));
        }
        #[expect(clippy::cast_precision_loss, reason = "few corners")]
        let centre = corners.iter().sum::<Vector3<f64>>() / corners.len() as f64;
        let n = corners.len();
        let around = if dim == 2 {
            let way = corners[1] - corners[0];
            Vector3::new(way[1], -way[0], 0.0)
        } else {
            (0..n).map(|k| (corners[k] - centre).cross(&(corners[(k + 1) % n] - centre))).sum()
        };
        let radius = corners.iter().fold(0.0f64, |m, x| m.max((x - centre).norm()));
        let normal = around.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
        Self { cell, corners, origin, ways, centre, normal, radius }
    }

    /// A point and a weight in the parameters of the face, from those of the part.
    fn in_face(&self, s: [f64; 2], weight: f64) -> CutPoint {
        let [a, b] = self.ways;
        let size = if self.corners.len() == 2 { a[0].abs() } else { (a[0] * b[1] - a[1] * b[0]).abs() };
        let b = if self.corners.len() == 2 { [0.0; 2] } else { b };
        let at = |d: usize| self.origin[d] + s[0] * a[d] + s[1] * b[d];
        CutPoint { parameter: [at(0), at(1), 0.0], weight: weight * size }
    }

    /// Whether a box may be met by lines along the normal, from so far behind to so far ahead.
    fn is_near(&self, bounds: &Bounds, [back, reach]: [f64; 2]) -> bool {
        let from = (bounds[0] + bounds[1]) * 0.5 - self.centre;
        let size = 0.5 * (bounds[1] - bounds[0]).norm() + self.radius;
        let along = from.dot(&self.normal);
        let beside = from - self.normal * along;
        beside.norm() <= size && along >= -back - size && along <= reach + size
    }
}

/// What faces are cut by, at a state.
pub(super) struct Opposite<'a> {
    /// By face its parts.
    pub(super) parts: &'a [Vec<Part>],
    /// Where they are.
    pub(super) tree: &'a BoxTree,
    /// Their boxes.
    pub(super) boxes: &'a Boxes,
    /// How far ahead they may be.
    pub(super) reach: f64,
    /// They look the other way.
    pub(super) is_facing: bool,
    /// The rule of a piece.
    pub(super) rule: &'a Rule,
}

/// The rule of a piece of a face in a space of this dimension.
///
/// # Errors
/// [`QuadratureError`] where there is none of that degree.
pub(super) fn rule_of_pieces(dim: usize, degree: usize) -> Result<Rule, QuadratureError> {
    rule(if dim == 2 { CellKind::Segment } else { CellKind::Triangle }, degree)
}

impl Opposite<'_> {
    /// The points of the pieces of a face that is made of `parts`; what lies further behind it than `back` does not count.
    pub(super) fn cut(&self, parts: &[Part], back: f64) -> Vec<CutPoint> {
        let mut found = Vec::new();
        for part in parts {
            let mut near = Vec::new();
            self.tree.met(self.boxes, |bounds| part.is_near(bounds, [back, self.reach]), &mut near);
            let others = near.iter().flat_map(|k| &self.parts[*k as usize]);
            let is_opposite = |other: &&Part| {
                let faces = !self.is_facing || other.normal.dot(&part.normal) < 0.0;
                faces && other.cell != part.cell
            };
            let others: Vec<&Part> = others.filter(is_opposite).collect();
            if part.corners.len() == 2 {
                self.segments(part, &others, back, &mut found);
            } else {
                self.triangles(part, &others, back, &mut found);
            }
        }
        found
    }

    /// Whether some of these distances ahead is not too far.
    fn is_within(&self, ahead: impl Iterator<Item = f64>, back: f64) -> bool {
        let (low, high) = ahead.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), g| (low.min(g), high.max(g)));
        high >= -back && low <= self.reach
    }

    /// The pieces of a segment.
    fn segments(&self, part: &Part, others: &[&Part], back: f64, found: &mut Vec<CutPoint>) {
        let (start, way) = (part.corners[0], part.corners[1] - part.corners[0]);
        let size = way.norm_squared();
        let (mut cuts, mut covered) = (vec![0.0, 1.0], Vec::new());
        for other in others {
            let mut ends = [0, 1].map(|k| (other.corners[k] - start).dot(&way) / size);
            if !self.is_within(other.corners.iter().map(|x| (x - start).dot(&part.normal)), back) {
                continue;
            }
            ends.sort_by(f64::total_cmp);
            cuts.extend(ends.iter().filter(|s| **s > BESIDE && **s < 1.0 - BESIDE));
            covered.push(ends);
        }
        cuts.sort_by(f64::total_cmp);
        for (a, b) in cuts.windows(2).map(|pair| (pair[0], pair[1])) {
            let middle = f64::midpoint(a, b);
            if b - a > SLIVER && covered.iter().any(|[low, high]| *low < middle && middle < *high) {
                let at = |(p, w): (&[f64; 3], &f64)| part.in_face([a + (b - a) * p[0], 0.0], (b - a) * w);
                found.extend(self.rule.points.iter().zip(&self.rule.weights).map(at));
            }
        }
    }

    /// The pieces of a triangle or a quadrilateral.
    fn triangles(&self, part: &Part, others: &[&Part], back: f64, found: &mut Vec<CutPoint>) {
        let plane = Plane::of(part);
        let window = plane.polygon(&part.corners);
        let (size, tolerance) = (area(&window), BESIDE * area(&window).abs().sqrt());
        let mut pieces: Vec<(f64, Polygon)> = Vec::new();
        for other in others {
            let mut polygon = plane.polygon(&other.corners);
            if area(&polygon) < 0.0 {
                polygon.reverse();
            }
            let polygon = inside(&polygon, &window, tolerance);
            if area(&polygon) <= SLIVER * size {
                continue;
            }
            let ahead = |p: &[f64; 2]| plane.ahead(other, *p);
            if self.is_within(polygon.iter().map(ahead), back) {
                pieces.push((ahead(&middle(&polygon)).abs(), polygon));
            }
        }
        // what a nearer sheet covers does not count again
        pieces.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut apart: Vec<Polygon> = Vec::new();
        for (_, polygon) in pieces {
            let mut rest = vec![polygon];
            for before in &apart {
                let left = |piece: Polygon| {
                    let common = area(&inside(&piece, before, tolerance));
                    if common > TWICE * size { outside(&piece, before, tolerance) } else { vec![piece] }
                };
                rest = rest.into_iter().flat_map(left).collect();
            }
            apart.extend(rest.into_iter().filter(|piece| area(piece) > SLIVER * size));
        }
        for piece in apart {
            self.fan(part, &window, &piece, found);
        }
    }

    /// The points of the triangles between the sides of a piece and the mean of its corners.
    fn fan(&self, part: &Part, window: &[[f64; 2]], piece: &[[f64; 2]], found: &mut Vec<CutPoint>) {
        let centre = middle(piece);
        for k in 0..piece.len() {
            let ways = [piece[k], piece[(k + 1) % piece.len()]].map(|p| [p[0] - centre[0], p[1] - centre[1]]);
            let twice = ways[0][0] * ways[1][1] - ways[0][1] * ways[1][0];
            for (p, w) in self.rule.points.iter().zip(&self.rule.weights) {
                let at = [0, 1].map(|d| centre[d] + p[0] * ways[0][d] + p[1] * ways[1][d]);
                let (s, jacobian) = parameters(window, at);
                found.push(part.in_face(s, w * (twice / jacobian).abs()));
            }
        }
    }
}

/// The plane through the centre of a part across its normal.
struct Plane {
    centre: Vector3<f64>,
    normal: Vector3<f64>,
    axes: [Vector3<f64>; 2],
}

impl Plane {
    fn of(part: &Part) -> Self {
        let normal = part.normal;
        let mut along = Vector3::zeros();
        along[normal.iamin()] = 1.0;
        let first = normal.cross(&along).normalize();
        Self { centre: part.centre, normal, axes: [first, normal.cross(&first)] }
    }

    /// Corners projected on it.
    fn polygon(&self, corners: &[Vector3<f64>]) -> Polygon {
        corners.iter().map(|x| self.axes.map(|axis| axis.dot(&(x - self.centre)))).collect()
    }

    /// How far ahead of one of its points another part is, as if that were plane.
    fn ahead(&self, other: &Part, p: [f64; 2]) -> f64 {
        let x = self.centre + self.axes[0] * p[0] + self.axes[1] * p[1];
        (other.centre - x).dot(&other.normal) / self.normal.dot(&other.normal)
    }
}

/// The parameters of a point in the plane of a triangle or a quadrilateral, and the determinant of their map there.
fn parameters(corners: &[[f64; 2]], p: [f64; 2]) -> ([f64; 2], f64) {
    let mut s = if corners.len() == 3 { [1.0 / 3.0; 2] } else { [0.5; 2] };
    let mut jacobian = Matrix2::identity();
    for _ in 0..ITERATIONS {
        let (values, slopes) = functions(corners.len(), s);
        let sum = |weights: &dyn Fn(usize) -> f64| -> Vector2<f64> {
            corners.iter().enumerate().map(|(k, x)| Vector2::from(*x) * weights(k)).sum()
        };
        let at = sum(&|k| values[k]);
        jacobian = Matrix2::from_columns(&[sum(&|k| slopes[k][0]), sum(&|k| slopes[k][1])]);
        let Some(inverse) = jacobian.try_inverse() else { break };
        let step = inverse * (Vector2::from(p) - at);
        s = [s[0] + step[0], s[1] + step[1]];
        if step.amax() < SETTLED || corners.len() == 3 {
            break;
        }
    }
    (s, jacobian.determinant())
}

/// The box around the parts of a face.
pub(super) fn around(parts: &[Part]) -> Bounds {
    let corners = parts.iter().flat_map(|part| &part.corners);
    let empty = [Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)];
    corners.fold(empty, |[low, high], x| [low.inf(x), high.sup(x)])
}

impl Targets {
    /// The faces as they cut others: extended at free borders, where images are found beyond them.
    pub(super) fn cutting(&self, mesh: &Mesh) -> CutFaces {
        let free = |margin: f64| if margin > CLOSED { margin } else { 0.0 };
        let margins = self.list.iter().map(|target| target.margins.map(free)).collect();
        CutFaces::new(mesh, self.facets().collect(), Some(Arc::clone(&self.space)), margins)
    }
}
