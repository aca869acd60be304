//! Rays onto faces of a deformed body: the nearest hit, and how it shifts; and what closest points share with them.
//!
//! A face is `y(p) = X(p) + u(X(p))` over its parameters `p`. A ray is `x + g n` with `g` of either sign; hits are solved with
//! Newton's method for `(p, g)`. Of the faces that the ray meets from the front (`n . n_y < 0`) within `reach` the nearest
//! one counts, of equally near ones the first: the hit is a function of ray and displacement alone. Edges between faces are
//! closed by a tolerance, free borders are extended by a small part of a face, so that points of borders that coincide do
//! not fall beside. Promises: no memory of earlier hits. Does not know where rays come from.

use std::{collections::BTreeMap, sync::Arc};

use nalgebra::{Matrix2, Matrix3, Vector3};

use super::{
    boxes::{Bounds, BoxTree, Boxes},
    faces::{FaceNode, FacePoint, Faces},
};
use crate::space::Space;
use wfl_compiler::types::ImageBy;
use wfl_mesh::mesh::{CellId, CellKind, FacetRef, Image, Mesh};

/// Edges between faces are closed by this part of a face.
pub(super) const CLOSED: f64 = 1e-9;
/// Free borders are extended by this part of a face.
const EXTENDED: f64 = 1e-3;
/// Boxes of faces are grown by this part of their diagonal: between its nodes a face of degree 2 or 3 bulges by less.
const BULGE: f64 = 0.5;
/// The same for faces between their nodes, which are extended by less.
const PLAIN: f64 = 1e-2;
/// A ray with a smaller component goes along that axis by nothing.
const FLAT: f64 = 1e-300;
/// Iterations of a hit; Newton's method takes 2 to 6.
pub(super) const ITERATIONS: usize = 30;
/// A hit is found when its parameters move by less.
pub(super) const SETTLED: f64 = 1e-14;
/// One whose last step was longer is none.
pub(super) const FOUND: f64 = 1e-9;
/// Parameters further away than this belong to another face.
pub(super) const FAR: f64 = 10.0;
/// A face that is nearer to a point than this part of its size touches it.
const TOUCHING: f64 = 1e-6;
/// Two hits are equally near within this part of their distance from the origin and each other.
pub(super) const ALIKE: f64 = 1e-12;

/// A ray from a point of the cell `cell`, along a unit vector.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    pub(super) x: Vector3<f64>,
    pub(super) n: Vector3<f64>,
    pub(super) cell: CellId,
    /// One over the components of the direction.
    over: Vector3<f64>,
    /// How far it goes against its direction, into the body of its point.
    pub(super) back: f64,
}

impl Ray {
    pub(super) fn new(x: Vector3<f64>, n: Vector3<f64>, cell: CellId, back: f64) -> Self {
        Self { x, n, cell, over: n.map(|n| 1.0 / n), back }
    }
}

/// Where a ray meets a face.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    pub(super) image: Image,
    /// `C` of the shift of the image: row i and column j >= i at `j (j + 1)/2 + i`.
    pub(super) shift: [f64; 6],
    /// Derivative of the outward normal along the face, both in the reference placement: row i, column j at `i + dim j`.
    pub(super) slope: [f64; 9],
    /// How far along the ray, negative behind its beginning; of a closest point how far the point is outside of its face.
    pub(super) gap: f64,
    /// Dimension of what the image lies on: a face, an edge or a corner.
    pub(super) rank: usize,
}

/// Where a ray meets a face, from the front or not: its parameters, and how far along the ray.
struct Crossing {
    p: [f64; 3],
    g: f64,
    is_front: bool,
}

/// A face that rays may meet.
#[derive(Clone, Debug)]
pub(super) struct Target {
    pub(super) facet: FacetRef,
    /// By side of the reference facet: how far outside of it a hit may lie.
    pub(super) margins: [f64; 4],
}

/// How the images of points are looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageSearch {
    /// Along a ray, or the closest point.
    pub by: ImageBy,
    /// The longest distance to an image.
    pub reach: f64,
    /// Faces are cut by those that images lie on, and each piece has a rule of this degree.
    pub pieces: Option<usize>,
}

/// The faces that images may lie on, with the space of the displacement behind them.
#[derive(Clone, Debug)]
pub(super) struct Targets {
    pub(super) list: Vec<Target>,
    pub(super) space: Arc<Space>,
    pub(super) faces: Faces,
    by: ImageBy,
    pub(super) reach: f64,
    pub(super) tree: BoxTree,
}

/// The faces in the placement of a state.
#[derive(Clone, Debug)]
pub(super) struct Current {
    pub(super) boxes: Boxes,
    pub(super) nodes: Vec<FaceNode>,
}

/// A body at an image.
pub(super) struct Body {
    /// In the current placement.
    pub(super) y: Vector3<f64>,
    /// `F = I + Grad u`
    pub(super) deformation: Matrix3<f64>,
    /// Out of the current face, of any length.
    pub(super) outward: Vector3<f64>,
}

/// How far inside the sides of a reference facet parameters are, the unused ones far.
pub(super) fn inside(kind: CellKind, p: [f64; 3]) -> [f64; 4] {
    let [a, b, _] = p;
    match kind {
        CellKind::Segment => [a, 1.0 - a, 1.0, 1.0],
        CellKind::Triangle => [a, b, 1.0 - a - b, 1.0],
        _ => [a, b, 1.0 - a, 1.0 - b],
    }
}

/// The nodes of the vertices on each side of a facet, sorted.
fn sides(mesh: &Mesh, facet: FacetRef) -> [Vec<usize>; 4] {
    let local = mesh.kind(facet.cell).facets()[usize::from(facet.local)];
    let nodes = mesh.cell_vertices(facet.cell);
    std::array::from_fn(|side| {
        let on_side = |k: &usize| inside(local.kind, local.kind.vertices()[*k])[side] == 0.0;
        let mut found: Vec<usize> =
            (0..local.vertices.len()).filter(on_side).map(|k| nodes[local.vertices[k]].index()).collect();
        found.sort_unstable();
        found
    })
}

impl Targets {
    /// Images on `facets`; `None` where the displacement does not live behind one of them.
    pub(super) fn new(mesh: &Mesh, facets: &[FacetRef], space: Arc<Space>, search: ImageSearch) -> Option<Self> {
        let mut faces_at: BTreeMap<Vec<usize>, usize> = BTreeMap::new();
        for side in facets.iter().flat_map(|facet| sides(mesh, *facet)) {
            *faces_at.entry(side).or_default() += 1;
        }
        let target = |facet: &FacetRef| {
            let margins = sides(mesh, *facet).map(|side| if faces_at[&side] > 1 { CLOSED } else { EXTENDED });
            Target { facet: *facet, margins }
        };
        let list = facets.iter().map(target).collect();
        let ImageSearch { by, reach, pieces: _ } = search;
        let faces = Faces::new(mesh, facets, &space)?;
        let mut made = Self { list, space, faces, by, reach, tree: BoxTree::default() };
        let nodes = made.faces.nodes(mesh, &made.space, &[]);
        made.tree = BoxTree::new(&made.bounds(&nodes));
        Some(made)
    }

    /// The faces.
    pub(super) fn facets(&self) -> impl Iterator<Item = FacetRef> + '_ {
        self.list.iter().map(|target| target.facet)
    }

    /// All faces in the current placement.
    pub(super) fn current(&self, mesh: &Mesh, u: &[f64]) -> Current {
        let nodes = self.faces.nodes(mesh, &self.space, u);
        Current { boxes: self.tree.fit(self.bounds(&nodes)), nodes }
    }

    /// The box around each face.
    fn bounds(&self, nodes: &[FaceNode]) -> Vec<Bounds> {
        let of = |face: usize| {
            let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
            for y in self.faces.positions(nodes, face) {
                (low, high) = (low.inf(y), high.sup(y));
            }
            let part = if self.faces.is_between_nodes(face) { PLAIN } else { BULGE };
            let margin = Vector3::repeat(part * (high - low).norm());
            [low - margin, high + margin]
        };
        (0..self.list.len()).map(of).collect()
    }

    /// The image of the point that a ray begins at.
    pub(super) fn image(&self, mesh: &Mesh, current: &Current, ray: &Ray) -> Option<Hit> {
        match self.by {
            ImageBy::Ray => self.hit(mesh, current, ray),
            ImageBy::Closest => self.closest(mesh, current, ray),
        }
    }

    /// How images are found.
    pub(super) fn by(&self) -> ImageBy {
        self.by
    }

    /// The nearest face that a ray meets.
    fn hit(&self, mesh: &Mesh, current: &Current, ray: &Ray) -> Option<Hit> {
        let (dim, boxes) = (mesh.dim(), &current.boxes);
        let mut best: Option<(f64, usize, [f64; 3])> = None;
        let (mut near, back) = (Vec::new(), self.reach.min(ray.back));
        self.tree.met(boxes, |bounds| meets(ray, bounds, [back, self.reach]), &mut near);
        for k in near.into_iter().map(|k| k as usize) {
            let least = best.map_or(self.reach, |b| b.0.abs());
            if self.list[k].facet.cell == ray.cell || !meets(ray, &boxes.faces[k], [least.min(back), least]) {
                continue;
            }
            let Some(Crossing { p, g, is_front: true }) = self.crossing(dim, k, &current.nodes, ray) else { continue };
            let scale = ALIKE * (ray.x.amax() + g.abs());
            let is_within = g <= self.reach && -g <= back;
            if is_within && best.is_none_or(|b| g.abs() < b.0.abs() - scale) {
                best = Some((g, k, p));
            }
        }
        let (gap, k, p) = best?;
        let (at, rest) = (self.faces.at(&current.nodes, k, p, 1), self.faces.at_rest(k, p));
        let shift = pseudo_inverse(&at.tangents, dim)?;
        let c = across(&rest.tangents, &shift, &rest.tangents);
        Some(Hit { gap, ..self.hit_at(mesh, k, &rest, p, &c)? })
    }

    /// How thick the body is behind the point of a ray, in the reference placement: the distance to the first of its `own`
    /// faces that the ray meets backwards, infinite where it meets none. Faces that touch the point are none of these.
    pub(super) fn thickness(&self, dim: usize, at_rest: &Current, ray: &Ray, is_own: impl Fn(FacetRef) -> bool) -> f64 {
        let (mut least, boxes) = (f64::INFINITY, &at_rest.boxes);
        let mut near = Vec::new();
        self.tree.met(boxes, |bounds| meets(ray, bounds, [least, 0.0]), &mut near);
        for k in near.into_iter().map(|k| k as usize) {
            let (target, bounds) = (&self.list[k], &boxes.faces[k]);
            if target.facet.cell == ray.cell || !is_own(target.facet) || !meets(ray, bounds, [least, 0.0]) {
                continue;
            }
            let touching = TOUCHING * (bounds[1] - bounds[0]).norm();
            if let Some(Crossing { g, is_front: true, .. }) = self.crossing(dim, k, &at_rest.nodes, ray)
                && -g > touching
            {
                least = least.min(-g);
            }
        }
        least
    }

    /// The body at an image.
    pub(super) fn body(&self, mesh: &Mesh, u: &[f64], image: &Image) -> Option<Body> {
        let kind = mesh.kind(image.cell);
        let position = self.space.position_of_cell(image.cell)?;
        let r = [image.reference];
        let geometry = mesh.geometry_element(kind).tabulate(&r, 1);
        let field = self.space.element_at(position).tabulate(&r, 1);
        let (dim, rows) = (mesh.dim(), mesh.jacobian_at(image.cell, &geometry, 0));
        let mut y = Vector3::from(mesh.point_at(image.cell, &geometry, 0));
        let reference =
            Matrix3::from_fn(|i, j| if i < dim && j < dim { rows[i][j] } else { f64::from(u8::from(i == j)) });
        let mut current = reference;
        for (k, node) in self.space.entity_nodes(position).iter().enumerate() {
            let Some(own) = u.get(*node as usize * dim..(*node as usize + 1) * dim) else { continue };
            for (i, value) in own.iter().enumerate() {
                y[i] += value * field.values[k];
                for j in 0..dim {
                    current[(i, j)] += value * field.gradients[k * dim + j];
                }
            }
        }
        let normal = Vector3::from(kind.facet_normal(usize::from(image.facet?.local)));
        let outward = current.try_inverse()?.transpose() * normal;
        Some(Body { y, deformation: current * reference.try_inverse()?, outward })
    }

    /// Whether a ray begins inside a body of the faces, further than it may go back for an image: the nearest face behind is
    /// one that it meets from the front.
    pub(super) fn hold(&self, dim: usize, current: &Current, ray: &Ray) -> bool {
        let (mut near, mut nearest) = (Vec::new(), None);
        self.tree.met(&current.boxes, |bounds| meets(ray, bounds, [ray.back, 0.0]), &mut near);
        for k in near.into_iter().map(|k| k as usize).filter(|k| self.list[*k].facet.cell != ray.cell) {
            if let Some(Crossing { g, is_front, .. }) = self.crossing(dim, k, &current.nodes, ray)
                && g < 0.0
                && -g <= ray.back
                && nearest.is_none_or(|(least, _)| -g < least)
            {
                nearest = Some((-g, is_front));
            }
        }
        nearest.is_some_and(|(_, is_front)| is_front)
    }

    /// Where a ray meets a face, from the front if it does anywhere; `None` beside it. A face that shows the ray both of its
    /// sides may be met twice: then what is found from the centre is not all.
    fn crossing(&self, dim: usize, face: usize, nodes: &[FaceNode], ray: &Ray) -> Option<Crossing> {
        let first = self.crossing_from(dim, face, nodes, ray, self.faces.kind(face).reference_centre());
        let is_front = first.as_ref().is_some_and(|found| found.is_front);
        if is_front || self.faces.is_between_nodes(face) {
            return first;
        }
        let lattice = self.faces.lattice(face);
        let looks = |p: &[f64; 3]| self.faces.at(nodes, face, *p, 1).outward(dim).map_or(0.0, |n| n.dot(&ray.n));
        let (towards, away) = lattice.iter().map(looks).fold((false, false), |(t, a), x| (t || x < 0.0, a || x > 0.0));
        if !(towards && away) {
            return first;
        }
        let others = lattice.iter().filter_map(|p| self.crossing_from(dim, face, nodes, ray, *p));
        let nearest = others.filter(|found| found.is_front).min_by(|a, b| a.g.abs().total_cmp(&b.g.abs()));
        nearest.or(first)
    }

    /// Where Newton's method ends that starts at parameters of a face.
    fn crossing_from(
        &self,
        dim: usize,
        face: usize,
        nodes: &[FaceNode],
        ray: &Ray,
        start: [f64; 3],
    ) -> Option<Crossing> {
        let (kind, mut p) = (self.faces.kind(face), start);
        let (mut g, mut last) = (0.0, f64::INFINITY);
        for _ in 0..ITERATIONS {
            let at = self.faces.at(nodes, face, p, 1);
            let step = to_ray(dim, &at.tangents, &ray.n, ray.x + ray.n * g - at.y)?;
            (0..dim - 1).for_each(|k| p[k] += step[k]);
            g += step[2];
            let size = step[0].abs().max(step[1].abs());
            // below this the steps are rounding and no longer become shorter
            let is_rounding = size < FOUND && size >= last;
            last = size;
            if size < SETTLED || is_rounding || p.iter().any(|x| x.abs() > FAR) {
                break;
            }
        }
        let is_inside = inside(kind, p).iter().zip(self.list[face].margins).all(|(inside, margin)| *inside >= -margin);
        // what is not a number is no hit either
        if !(last < FOUND && is_inside && g.is_finite()) {
            return None;
        }
        let outward = self.faces.at(nodes, face, p, 1).outward(dim)?;
        Some(Crossing { p, g, is_front: outward.dot(&ray.n) < 0.0 })
    }

    /// What is told of an image at parameters of a face, `at` which that is in the reference placement, with the matrix of
    /// its shift.
    pub(super) fn hit_at(
        &self,
        mesh: &Mesh,
        face: usize,
        at: &FacePoint,
        p: [f64; 3],
        c: &Matrix3<f64>,
    ) -> Option<Hit> {
        let (dim, facet) = (mesh.dim(), self.list[face].facet);
        let mut hit = Hit {
            image: Image {
                cell: facet.cell,
                reference: mesh.kind(facet.cell).facet_map(usize::from(facet.local)).apply(p),
                facet: Some(facet),
            },
            shift: [0.0; 6],
            slope: [0.0; 9],
            gap: 0.0,
            rank: dim - 1,
        };
        for j in 0..dim {
            for i in 0..=j {
                hit.shift[j * (j + 1) / 2 + i] = c[(i, j)];
            }
        }
        let turns = at.normal_derivatives(dim)?;
        let slope = across(&turns, &pseudo_inverse(&at.tangents, dim)?, &at.tangents);
        for j in 0..dim {
            for i in 0..dim {
                hit.slope[i + dim * j] = slope[(i, j)];
            }
        }
        Some(hit)
    }
}

/// `(dp, dg)` with `[B | -n] (dp, dg) = r` for the tangents of a face and a direction; the second parameter is zero in the plane.
#[inline(always)]
fn to_ray(dim: usize, [a, b]: &[Vector3<f64>; 2], n: &Vector3<f64>, r: Vector3<f64>) -> Option<[f64; 3]> {
    if dim == 2 {
        let product = |u: &Vector3<f64>, v: &Vector3<f64>| u[0] * v[1] - u[1] * v[0];
        let determinant = product(n, a);
        return (determinant != 0.0).then(|| [product(n, &r) / determinant, 0.0, product(a, &r) / determinant]);
    }
    let across = b.cross(n);
    let determinant = a.dot(&across);
    let sides = [r.dot(&across), a.dot(&r.cross(n)), -a.dot(&b.cross(&r))];
    (determinant != 0.0).then(|| sides.map(|side| side / determinant))
}

/// `(B' B)^-1` of the tangents of a face.
fn pseudo_inverse(tangents: &[Vector3<f64>; 2], dim: usize) -> Option<Matrix2<f64>> {
    let [a, b] = tangents;
    let metric = if dim == 2 {
        Matrix2::new(a.dot(a), 0.0, 0.0, 1.0)
    } else {
        Matrix2::new(a.dot(a), a.dot(b), a.dot(b), b.dot(b))
    };
    let mut inverse = metric.try_inverse()?;
    if dim == 2 {
        inverse[(1, 1)] = 0.0;
    }
    Some(inverse)
}

/// `A M B'`
fn across(a: &[Vector3<f64>; 2], m: &Matrix2<f64>, b: &[Vector3<f64>; 2]) -> Matrix3<f64> {
    let mut sum = Matrix3::zeros();
    for i in 0..2 {
        for j in 0..2 {
            sum += a[i] * b[j].transpose() * m[(i, j)];
        }
    }
    sum
}

/// Parameters of a facet whose positions say where it is.
pub(super) fn samples(kind: CellKind) -> Vec<[f64; 3]> {
    let ends: &[f64] = &[0.0, 0.5, 1.0];
    match kind {
        CellKind::Segment => ends.iter().map(|a| [*a, 0.0, 0.0]).collect(),
        CellKind::Triangle => {
            let all = ends.iter().flat_map(|a| ends.iter().map(move |b| [*a, *b, 0.0]));
            all.filter(|p| p[0] + p[1] <= 1.0).collect()
        }
        _ => ends.iter().flat_map(|a| ends.iter().map(move |b| [*a, *b, 0.0])).collect(),
    }
}

/// Whether a ray comes into a box not further behind its beginning and ahead of it than `reach`.
fn meets(ray: &Ray, bounds: &Bounds, reach: [f64; 2]) -> bool {
    let (mut from, mut to) = (-reach[0], reach[1]);
    for d in 0..3 {
        let (low, high) = (bounds[0][d] - ray.x[d], bounds[1][d] - ray.x[d]);
        if ray.n[d].abs() < FLAT {
            if low > 0.0 || high < 0.0 {
                return false;
            }
            continue;
        }
        // a part of a box is its margin, far more than these are rounded by
        let (a, b) = (low * ray.over[d], high * ray.over[d]);
        from = from.max(a.min(b));
        to = to.min(a.max(b));
    }
    from <= to
}
