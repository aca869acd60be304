//! Point location: the cell of a point, the closest point on facets, the intersection of a ray with facets.
//!
//! Promises: among equally good cells or facets the first in the given order is taken, so results depend on the mesh
//! only. Searches are exact on plane facets; on curved ones an iteration finds the closest point. Does not know fields.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::{
    Mesh,
    index::{CellId, FacetRef},
};
use crate::{cell::CellKind, element::Table};

/// How far outside the reference cell a point may lie and still count as inside.
const INSIDE: f64 = 1e-9;
/// The same for a point on a facet, in reference coordinates: it was computed in another mesh.
const ON_FACE: f64 = 1e-6;
/// Iterations of an inverse map or a foot point.
const ITERATIONS: usize = 50;
/// An iteration ends when the reference point moves by less: Newton squares it once more.
const SETTLED: f64 = 1e-8;
/// An iteration of a foot point ends when it moves by less.
const FOOT_SETTLED: f64 = 1e-14;
/// Nodes of an affine cell lie where its map puts them within this part of its size.
const AFFINE: f64 = 1e-13;
/// A box is searched when the point is within this part of its size: curved sides bulge out of the box of their nodes,
/// straight ones do not.
const MARGIN: f64 = 0.1;
const MARGIN_STRAIGHT: f64 = 1e-5;

/// A point of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Image {
    /// Its cell.
    pub cell: CellId,
    /// Its reference coordinates there.
    pub reference: [f64; 3],
    /// The facet it was found on, if facets were searched.
    pub facet: Option<FacetRef>,
}

/// Bounding boxes of cells or facets in order.
#[derive(Clone, Debug, Default)]
struct Boxes {
    list: Vec<([f64; 3], [f64; 3])>,
}

impl Boxes {
    fn push(&mut self, mesh: &Mesh, cell: CellId, nodes: impl Iterator<Item = usize>) {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        let all = mesh.cell_nodes(cell);
        for k in nodes {
            let p = mesh.node(all[k]);
            for d in 0..3 {
                low[d] = low[d].min(p[d]);
                high[d] = high[d].max(p[d]);
            }
        }
        let part = if mesh.order() == 1 { MARGIN_STRAIGHT } else { MARGIN };
        let margin = part * (0..3).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
        self.list.push((low.map(|x| x - margin), high.map(|x| x + margin)));
    }

    /// Distance of a point to a box; 0 inside.
    fn distance(&self, k: usize, x: [f64; 3]) -> f64 {
        let (low, high) = &self.list[k];
        let out = [0, 1, 2].map(|d| (low[d] - x[d]).max(x[d] - high[d]).max(0.0));
        out[0].hypot(out[1]).hypot(out[2])
    }
}

/// Finds the cells of points.
#[derive(Clone, Debug)]
pub struct CellFinder {
    cells: Vec<CellId>,
    boxes: Boxes,
    /// Cells by bin of a uniform grid over all boxes, in order.
    bins: Vec<Vec<u32>>,
    grid: Grid,
    centres: Centres,
}

/// Geometry tables at the centres of the reference cells, where inverse maps start, by kind.
#[derive(Clone, Debug, Default)]
struct Centres(Vec<Option<Table>>);

impl Centres {
    fn new(mesh: &Mesh, cells: impl Iterator<Item = CellId>) -> Self {
        let mut list: Vec<Option<Table>> = Vec::new();
        for kind in cells.map(|c| mesh.kind(c)) {
            if list.len() <= kind.index() {
                list.resize(kind.index() + 1, None);
            }
            let start = || mesh.geometry_element(kind).tabulate(&[kind.reference_centre()], 1);
            list[kind.index()].get_or_insert_with(start);
        }
        Self(list)
    }

    fn of(&self, kind: CellKind) -> Option<&Table> {
        self.0.get(kind.index())?.as_ref()
    }
}

/// A uniform grid over a box.
#[derive(Clone, Copy, Debug)]
struct Grid {
    low: [f64; 3],
    step: [f64; 3],
    count: [usize; 3],
}

impl Grid {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the grid")]
    fn place(&self, x: [f64; 3]) -> [usize; 3] {
        [0, 1, 2].map(|d| {
            let at = (x[d] - self.low[d]) / self.step[d];
            (at.max(0.0) as usize).min(self.count[d] - 1)
        })
    }

    fn index(&self, p: [usize; 3]) -> usize {
        (p[2] * self.count[1] + p[1]) * self.count[0] + p[0]
    }
}

impl CellFinder {
    /// A finder among `cells`; of cells that share a point the first is found.
    #[must_use]
    pub fn new(mesh: &Mesh, cells: &[CellId]) -> Self {
        let mut boxes = Boxes::default();
        for cell in cells {
            boxes.push(mesh, *cell, 0..mesh.cell_nodes(*cell).len());
        }
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for (a, b) in &boxes.list {
            for d in 0..3 {
                low[d] = low[d].min(a[d]);
                high[d] = high[d].max(b[d]);
            }
        }
        let dim = mesh.dim();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "a root of the number of cells"
        )]
        let along = ((cells.len() as f64).powf(1.0 / dim as f64).ceil() as usize).max(1);
        let count = [0, 1, 2].map(|d| if d < dim { along } else { 1 });
        #[expect(clippy::cast_precision_loss, reason = "few bins")]
        let step = [0, 1, 2].map(|d| {
            let size = (high[d] - low[d]) / count[d] as f64;
            if size > 0.0 && size.is_finite() { size } else { 1.0 }
        });
        let grid = Grid { low, step, count };
        let mut bins = vec![Vec::new(); count.iter().product()];
        for (k, (a, b)) in boxes.list.iter().enumerate() {
            let (first, last) = (grid.place(*a), grid.place(*b));
            for z in first[2]..=last[2] {
                for y in first[1]..=last[1] {
                    for x in first[0]..=last[0] {
                        bins[grid.index([x, y, z])].push(u32::try_from(k).expect("fewer than 2^32 cells"));
                    }
                }
            }
        }
        let centres = Centres::new(mesh, cells.iter().copied());
        Self { cells: cells.to_vec(), boxes, bins, grid, centres }
    }

    /// The first cell that holds the point; `None` outside of all.
    #[must_use]
    pub fn find(&self, mesh: &Mesh, x: [f64; 3]) -> Option<Image> {
        let bin = self.bins.get(self.grid.index(self.grid.place(x)))?;
        bin.iter().map(|k| *k as usize).filter(|k| self.boxes.distance(*k, x) == 0.0).find_map(|k| {
            let reference = inverse_map(mesh, self.cells[k], x, &self.centres)?;
            if !mesh.kind(self.cells[k]).contains(&reference[..mesh.dim()], INSIDE) {
                return None;
            }
            Some(Image { cell: self.cells[k], reference, facet: None })
        })
    }
}

/// Newton on the geometric map, one step of it where the map is affine; `None` where it has no inverse. The result may
/// lie outside of the reference cell.
fn inverse_map(mesh: &Mesh, cell: CellId, x: [f64; 3], centres: &Centres) -> Option<[f64; 3]> {
    let (dim, kind) = (mesh.dim(), mesh.kind(cell));
    let centre = kind.reference_centre();
    let mut r = centre;
    let mut fresh;
    for iteration in 0..ITERATIONS {
        let table = match centres.of(kind).filter(|_| iteration == 0) {
            Some(table) => table,
            None => {
                fresh = mesh.geometry_element(kind).tabulate(&[r], 1);
                &fresh
            }
        };
        let at = mesh.point_at(cell, table, 0);
        let jacobian = mesh.jacobian_at(cell, table, 0);
        let m = Matrix3::from_fn(|i, j| if i < dim && j < dim { jacobian[i][j] } else { f64::from(u8::from(i == j)) });
        let gap = Vector3::from_fn(|i, _| if i < dim { x[i] - at[i] } else { 0.0 });
        let step = m.lu().solve(&gap)?;
        for d in 0..dim {
            r[d] += step[d];
        }
        if step.norm() < SETTLED || (iteration == 0 && is_affine(mesh, cell, centre, at, &m)) {
            break;
        }
    }
    Some(r)
}

/// Whether the nodes of a cell lie where the map that is linear about its centre puts them.
fn is_affine(mesh: &Mesh, cell: CellId, centre: [f64; 3], at: [f64; 3], jacobian: &Matrix3<f64>) -> bool {
    let element = mesh.geometry_element(mesh.kind(cell));
    let dim = mesh.dim();
    let size = jacobian.abs().sum();
    mesh.cell_nodes(cell).iter().zip(element.points()).all(|(node, r)| {
        let x = mesh.node(*node);
        let mapped = jacobian * Vector3::from_fn(|i, _| r[i] - centre[i]);
        (0..dim).all(|d| (x[d] - at[d] - mapped[d]).abs() <= AFFINE * size.max(x[d].abs()))
    })
}

/// The parameters of a point of a facet; `None` when it is not on it.
fn on_face(mesh: &Mesh, facet: FacetRef, x: [f64; 3], centres: &Centres) -> Option<[f64; 3]> {
    let r = inverse_map(mesh, facet.cell, x, centres)?;
    let kind = mesh.facet_kind(facet);
    let map = mesh.kind(facet.cell).facet_map(usize::from(facet.local));
    // the tangents of a reference facet are independent: least squares by the normal equations
    let t = map.tangents;
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let d: [f64; 3] = std::array::from_fn(|i| r[i] - map.origin[i]);
    let mut s = [0.0; 3];
    match kind.dim() {
        0 => {}
        1 => s[0] = dot(t[0], d) / dot(t[0], t[0]),
        _ => {
            let (a, b, c) = (dot(t[0], t[0]), dot(t[0], t[1]), dot(t[1], t[1]));
            let (f, g) = (dot(t[0], d), dot(t[1], d));
            s[0] = (f * c - g * b) / (a * c - b * b);
            s[1] = (g * a - f * b) / (a * c - b * b);
        }
    }
    let back = map.apply(s);
    let near = (0..mesh.dim()).all(|i| (back[i] - r[i]).abs() <= ON_FACE);
    (near && kind.contains(&s[..kind.dim()], ON_FACE)).then_some(s)
}

/// Facets onto which points are projected or rays are sent.
#[derive(Clone, Debug)]
pub struct FacetFinder {
    facets: Vec<FacetRef>,
    boxes: Boxes,
    centres: Centres,
}

impl FacetFinder {
    /// A finder among `facets`, each in the cell it names.
    #[must_use]
    pub fn new(mesh: &Mesh, facets: &[FacetRef]) -> Self {
        let mut boxes = Boxes::default();
        for facet in facets {
            let element = mesh.geometry_element(mesh.kind(facet.cell));
            boxes.push(mesh, facet.cell, element.facet_closure(usize::from(facet.local)).iter().copied());
        }
        let centres = Centres::new(mesh, facets.iter().map(|f| f.cell));
        Self { facets: facets.to_vec(), boxes, centres }
    }

    /// The facets, in order.
    #[must_use]
    pub fn facets(&self) -> &[FacetRef] {
        &self.facets
    }

    /// The first facet that holds the point: its position in the list and the point's parameters on it.
    #[must_use]
    pub fn holding(&self, mesh: &Mesh, x: [f64; 3]) -> Option<(usize, [f64; 3])> {
        let near = |k: &usize| self.boxes.distance(*k, x) == 0.0;
        (0..self.facets.len())
            .filter(near)
            .find_map(|k| on_face(mesh, self.facets[k], x, &self.centres).map(|p| (k, p)))
    }

    /// The point of the facets nearest to `x`, if it is within `reach`.
    #[must_use]
    pub fn nearest(&self, mesh: &Mesh, x: [f64; 3], reach: f64) -> Option<Image> {
        self.first_nearest(mesh, x, reach, |side| Some(side.foot(x)))
    }

    /// The point nearest to `x` where the line through `x` along the unit vector `n` meets a facet that looks the other
    /// way (its outward normal against `n`), if it is within `reach`.
    #[must_use]
    pub fn hit(&self, mesh: &Mesh, x: [f64; 3], n: [f64; 3], reach: f64) -> Option<Image> {
        self.first_nearest(mesh, x, reach, |side| side.crossing(x, n))
    }

    /// Of what `candidate` finds on each facet (reference coordinates and distance from `x`), the nearest within
    /// `reach`.
    fn first_nearest(
        &self,
        mesh: &Mesh,
        x: [f64; 3],
        reach: f64,
        candidate: impl Fn(&Side<'_>) -> Option<([f64; 3], f64)>,
    ) -> Option<Image> {
        let mut best: Option<(f64, Image)> = None;
        for (k, facet) in self.facets.iter().enumerate() {
            let least = best.as_ref().map_or(reach, |b| b.0);
            if self.boxes.distance(k, x) > least {
                continue;
            }
            let side = Side::new(mesh, *facet);
            let Some((reference, distance)) = candidate(&side) else { continue };
            if distance <= reach && best.as_ref().is_none_or(|b| distance < b.0) {
                best = Some((distance, side.image(reference)));
            }
        }
        best.map(|b| b.1)
    }
}

/// A facet as a surface in space over its parameters.
struct Side<'a> {
    mesh: &'a Mesh,
    facet: FacetRef,
    kind: CellKind,
    origin: Vector3<f64>,
    tangents: [Vector3<f64>; 2],
}

impl<'a> Side<'a> {
    fn new(mesh: &'a Mesh, facet: FacetRef) -> Self {
        let map = mesh.kind(facet.cell).facet_map(usize::from(facet.local));
        let tangents = map.tangents.map(Vector3::from);
        Self { mesh, facet, kind: mesh.facet_kind(facet), origin: map.origin.into(), tangents }
    }

    fn image(&self, reference: [f64; 3]) -> Image {
        Image { cell: self.facet.cell, reference, facet: Some(self.facet) }
    }

    /// Position and Jacobian of the cell at reference coordinates.
    fn at(&self, r: &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        let table = self.mesh.geometry_element(self.mesh.kind(self.facet.cell)).tabulate(&[(*r).into()], 1);
        let jacobian = self.mesh.jacobian_at(self.facet.cell, &table, 0);
        let m = Matrix3::from_fn(|i, j| jacobian[i][j]);
        (self.mesh.point_at(self.facet.cell, &table, 0).into(), m)
    }

    /// The nearest point to `x`: reference coordinates and distance.
    fn foot(&self, x: [f64; 3]) -> ([f64; 3], f64) {
        let x = Vector3::from(x);
        let [s, t] = self.tangents;
        let candidates = match self.kind {
            CellKind::Segment => vec![self.on_edge(&x, self.origin, s)],
            CellKind::Triangle | CellKind::Quadrilateral => match self.on_face(&x) {
                Some(r) => vec![r],
                None if self.kind == CellKind::Triangle => vec![
                    self.on_edge(&x, self.origin, s),
                    self.on_edge(&x, self.origin, t),
                    self.on_edge(&x, self.origin + s, t - s),
                ],
                None => vec![
                    self.on_edge(&x, self.origin, s),
                    self.on_edge(&x, self.origin, t),
                    self.on_edge(&x, self.origin + s, t),
                    self.on_edge(&x, self.origin + t, s),
                ],
            },
            _ => vec![self.origin],
        };
        let mut best = (self.origin, f64::INFINITY);
        for r in candidates {
            let distance = (self.at(&r).0 - x).norm();
            if distance < best.1 {
                best = (r, distance);
            }
        }
        (best.0.into(), best.1)
    }

    /// The nearest point on the line of reference points `from + c * along`, c in [0, 1].
    fn on_edge(&self, x: &Vector3<f64>, from: Vector3<f64>, along: Vector3<f64>) -> Vector3<f64> {
        let mut c = 0.5f64;
        for _ in 0..ITERATIONS {
            let (at, jacobian) = self.at(&(from + along * c));
            let g = jacobian * along;
            let next = (c + (x - at).dot(&g) / g.dot(&g)).clamp(0.0, 1.0);
            let moved = (next - c).abs();
            c = next;
            if moved < FOOT_SETTLED {
                break;
            }
        }
        from + along * c
    }

    /// The foot point on the surface of the facet, if it lies inside.
    fn on_face(&self, x: &Vector3<f64>) -> Option<Vector3<f64>> {
        let mut p = if self.kind == CellKind::Triangle { Vector2::repeat(1.0 / 3.0) } else { Vector2::repeat(0.5) };
        for _ in 0..ITERATIONS {
            let (at, jacobian) = self.at(&self.point(&p));
            let (a, b) = (jacobian * self.tangents[0], jacobian * self.tangents[1]);
            let gap = x - at;
            let normal = Matrix2::new(a.dot(&a), a.dot(&b), a.dot(&b), b.dot(&b));
            let step = normal.lu().solve(&Vector2::new(gap.dot(&a), gap.dot(&b)))?;
            p += step;
            if step.norm() < FOOT_SETTLED {
                break;
            }
            // far outside: an edge is nearer
            if p.norm() > 10.0 {
                return None;
            }
        }
        self.kind.contains(p.as_slice(), INSIDE).then(|| self.point(&p))
    }

    fn point(&self, p: &Vector2<f64>) -> Vector3<f64> {
        self.origin + self.tangents[0] * p[0] + self.tangents[1] * p[1]
    }

    /// Where the line `x + a n` crosses the facet, with |a|; `None` beside it or where it looks along `n`.
    fn crossing(&self, x: [f64; 3], n: [f64; 3]) -> Option<([f64; 3], f64)> {
        let (x, n, dim) = (Vector3::from(x), Vector3::from(n), self.mesh.dim());
        let mut p = match self.kind {
            CellKind::Point => Vector2::zeros(),
            CellKind::Segment => Vector2::new(0.5, 0.0),
            CellKind::Triangle => Vector2::repeat(1.0 / 3.0),
            _ => Vector2::repeat(0.5),
        };
        let mut distance = 0.0f64;
        for _ in 0..ITERATIONS {
            let (at, jacobian) = self.at(&self.point(&p));
            // unknowns: the parameters of the facet, then the way along n
            let mut m = Matrix3::identity();
            for k in 0..dim - 1 {
                m.set_column(k, &(jacobian * self.tangents[k]));
            }
            m.set_column(dim - 1, &-n);
            let step = m.lu().solve(&(x + n * distance - at))?;
            for k in 0..dim - 1 {
                p[k] += step[k];
            }
            distance += step[dim - 1];
            if step.rows(0, dim - 1).norm() < FOOT_SETTLED || p.norm() > 10.0 {
                break;
            }
        }
        let r = self.point(&p);
        let reference = Vector3::from(self.mesh.kind(self.facet.cell).facet_normal(usize::from(self.facet.local)));
        let mut jacobian = self.at(&r).1;
        for k in dim..3 {
            jacobian[(k, k)] = 1.0;
        }
        let outward = jacobian.try_inverse()?.transpose() * reference;
        let facing = outward.dot(&n) < 0.0;
        (facing && self.kind.contains(&p.as_slice()[..dim - 1], INSIDE)).then(|| (r.into(), distance.abs()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{BoxShape, Topology, generate_box, outer_boundary};

    /// Reference points of the images, mapped back, against positions computed by hand.
    #[test]
    fn feet_rays_and_cells_of_a_cube() {
        let shapes = [BoxShape::Hexahedron, BoxShape::Tetrahedron];
        for shape in shapes {
            let mesh = generate_box([0.0; 3], [1.0; 3], [2; 3], 3, shape).expect("a box");
            let topology = Topology::new(&mesh).expect("a manifold");
            let finder = FacetFinder::new(&mesh, &outer_boundary(&topology));
            let place = |image: Image| {
                let element = mesh.geometry_element(mesh.kind(image.cell));
                mesh.point_at(image.cell, &element.tabulate(&[image.reference], 0), 0)
            };
            let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|d| (a[d] - b[d]).abs() < 1e-13);
            // over a face, over an edge, over a corner
            for (x, foot) in [
                ([0.3, 0.6, 1.25], [0.3, 0.6, 1.0]),
                ([1.5, 0.2, -0.5], [1.0, 0.2, 0.0]),
                ([-1.0, -2.0, 3.0], [0.0, 0.0, 1.0]),
            ] {
                let found = finder.nearest(&mesh, x, f64::INFINITY).expect("there is a nearest point");
                assert!(near(place(found), foot), "{shape:?} {x:?}: {:?}", place(found));
                assert_eq!(finder.nearest(&mesh, x, 0.2), None);
            }
            // a ray from above meets the top; the bottom looks along it
            let hit = finder.hit(&mesh, [0.3, 0.7, 1.5], [0.0, 0.0, -1.0], f64::INFINITY).expect("a hit");
            assert!(near(place(hit), [0.3, 0.7, 1.0]));
            assert_eq!(finder.hit(&mesh, [1.3, 0.7, 1.5], [0.0, 0.0, -1.0], f64::INFINITY), None);
            let cells: Vec<CellId> = mesh.cells().collect();
            let inside = CellFinder::new(&mesh, &cells);
            for x in [[0.1, 0.2, 0.3], [1.0, 0.5, 0.0], [0.77, 0.51, 0.99]] {
                assert!(near(place(inside.find(&mesh, x).expect("inside")), x));
            }
            assert_eq!(inside.find(&mesh, [1.01, 0.5, 0.5]), None);
        }
    }
}
