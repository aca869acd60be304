//! Rays onto faces of a deformed body: the nearest hit, and how it shifts; and what closest points share with them.
//!
//! A face is `y(p) = X(p) + u(X(p))` over its parameters `p`. A ray is `x + g n` with `g` of either sign; hits are solved with
//! Newton's method for `(p, g)`. Of the faces that the ray meets from the front (`n . n_y < 0`) within `reach` the nearest
//! one counts, of equally near ones the first: the hit is a function of ray and displacement alone. Edges between faces are
//! closed by a tolerance, free borders are extended by a small part of a face, so that points of borders that coincide do
//! not fall beside. Promises: no memory of earlier hits. Does not know where rays come from.

use std::collections::BTreeMap;

use nalgebra::{Matrix2, Matrix3, Vector3};

use super::boxes::{Bounds, BoxTree, Boxes};
use crate::space::Space;
use wfl_compiler::types::ImageBy;
use wfl_mesh::{
    element::Table,
    mesh::{CellId, CellKind, FacetRef, Image, Mesh},
};

/// Edges between faces are closed by this part of a face.
pub(super) const CLOSED: f64 = 1e-9;
/// Free borders are extended by this part of a face.
const EXTENDED: f64 = 1e-3;
/// Boxes of faces are grown by this part of their diagonal: between its nodes a face of degree 2 or 3 bulges by less.
const BULGE: f64 = 0.5;
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
    /// How far it goes against its direction, into the body of its point.
    pub(super) back: f64,
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
    /// Of its cell in the space of the displacement.
    position: usize,
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
    pub(super) space: Space,
    by: ImageBy,
    pub(super) reach: f64,
    pub(super) tree: BoxTree,
}

/// Tables of the geometry and of the displacement.
pub(super) type Tables = [Table; 2];

/// A face at some of its parameters.
pub(super) struct Place {
    /// In the current placement.
    pub(super) y: Vector3<f64>,
    /// Its derivatives in the parameters.
    pub(super) current: [Vector3<f64>; 2],
    /// Those of the position in the reference placement.
    pub(super) reference: [Vector3<f64>; 2],
    /// Outward, of any length; `None` where the cell has no volume.
    pub(super) outward: Option<Vector3<f64>>,
    /// Derivatives of the reference and of the current position in the cell.
    jacobians: [Matrix3<f64>; 2],
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
    pub(super) fn new(mesh: &Mesh, facets: &[FacetRef], space: Space, search: ImageSearch) -> Option<Self> {
        let mut faces_at: BTreeMap<Vec<usize>, usize> = BTreeMap::new();
        for side in facets.iter().flat_map(|facet| sides(mesh, *facet)) {
            *faces_at.entry(side).or_default() += 1;
        }
        let target = |facet: &FacetRef| {
            let margins = sides(mesh, *facet).map(|side| if faces_at[&side] > 1 { CLOSED } else { EXTENDED });
            Some(Target { facet: *facet, position: space.position_of_cell(facet.cell)?, margins })
        };
        let list = facets.iter().map(target).collect::<Option<Vec<_>>>()?;
        let ImageSearch { by, reach, pieces: _ } = search;
        let mut made = Self { list, space, by, reach, tree: BoxTree::default() };
        made.tree = BoxTree::new(&made.faces(mesh, &[]));
        Some(made)
    }

    /// The faces.
    pub(super) fn facets(&self) -> impl Iterator<Item = FacetRef> + '_ {
        self.list.iter().map(|target| target.facet)
    }

    /// The boxes around all faces in the current placement.
    pub(super) fn boxes(&self, mesh: &Mesh, u: &[f64]) -> Boxes {
        self.tree.fit(self.faces(mesh, u))
    }

    /// The box around each face.
    fn faces(&self, mesh: &Mesh, u: &[f64]) -> Vec<Bounds> {
        let mut known: BTreeMap<(usize, u8), Vec<Tables>> = BTreeMap::new();
        let mut all = Vec::with_capacity(self.list.len());
        for target in &self.list {
            let key = (mesh.kind(target.facet.cell).index(), target.facet.local);
            let tables = known.entry(key).or_insert_with(|| {
                samples(mesh.facet_kind(target.facet)).iter().map(|p| self.tables(mesh, target, *p, 1)).collect()
            });
            let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
            for tables in tables {
                let y = self.position(mesh, target, u, tables);
                (low, high) = (low.inf(&y), high.sup(&y));
            }
            let margin = Vector3::repeat(BULGE * (high - low).norm());
            all.push([low - margin, high + margin]);
        }
        all
    }

    /// The image of the point that a ray begins at.
    pub(super) fn image(&self, mesh: &Mesh, u: &[f64], boxes: &Boxes, ray: &Ray) -> Option<Hit> {
        match self.by {
            ImageBy::Ray => self.hit(mesh, u, boxes, ray),
            ImageBy::Closest => self.closest(mesh, u, boxes, ray),
        }
    }

    /// How images are found.
    pub(super) fn by(&self) -> ImageBy {
        self.by
    }

    /// The nearest face that a ray meets.
    fn hit(&self, mesh: &Mesh, u: &[f64], boxes: &Boxes, ray: &Ray) -> Option<Hit> {
        let mut best: Option<(f64, usize, [f64; 3])> = None;
        let (mut near, back) = (Vec::new(), self.reach.min(ray.back));
        self.tree.met(boxes, |bounds| meets(ray, bounds, [back, self.reach]), &mut near);
        for k in near.into_iter().map(|k| k as usize) {
            let target = &self.list[k];
            let least = best.map_or(self.reach, |b| b.0.abs());
            if target.facet.cell == ray.cell || !meets(ray, &boxes.faces[k], [least.min(back), least]) {
                continue;
            }
            let Some(Crossing { p, g, is_front: true }) = self.crossing(mesh, target, u, ray) else { continue };
            let scale = ALIKE * (ray.x.amax() + g.abs());
            let is_within = g <= self.reach && -g <= back;
            if is_within && best.is_none_or(|b| g.abs() < b.0.abs() - scale) {
                best = Some((g, k, p));
            }
        }
        let (gap, k, p) = best?;
        let target = &self.list[k];
        let tables = self.tables(mesh, target, p, 2);
        let at = self.place(mesh, target, u, &tables);
        let shift = pseudo_inverse(&at.current, mesh.dim())?;
        let c = across(&at.reference, &shift, &at.reference);
        Some(Hit { gap, ..self.hit_at(mesh, target, &tables, &at, p, &c)? })
    }

    /// How thick the body is behind the point of a ray, in the reference placement: the distance to the first of its `own`
    /// faces that the ray meets backwards, infinite where it meets none. Faces that touch the point are none of these.
    pub(super) fn thickness(&self, mesh: &Mesh, boxes: &Boxes, ray: &Ray, is_own: impl Fn(FacetRef) -> bool) -> f64 {
        let mut least = f64::INFINITY;
        let mut near = Vec::new();
        self.tree.met(boxes, |bounds| meets(ray, bounds, [least, 0.0]), &mut near);
        for k in near.into_iter().map(|k| k as usize) {
            let (target, bounds) = (&self.list[k], &boxes.faces[k]);
            if target.facet.cell == ray.cell || !is_own(target.facet) || !meets(ray, bounds, [least, 0.0]) {
                continue;
            }
            let touching = TOUCHING * (bounds[1] - bounds[0]).norm();
            if let Some(Crossing { g, is_front: true, .. }) = self.crossing(mesh, target, &[], ray)
                && -g > touching
            {
                least = least.min(-g);
            }
        }
        least
    }

    /// With derivatives up to `order`.
    pub(super) fn tables(&self, mesh: &Mesh, target: &Target, p: [f64; 3], order: usize) -> Tables {
        let kind = mesh.kind(target.facet.cell);
        let local = usize::from(target.facet.local);
        let r = [kind.facet_point(local, kind.facet_map(local).apply(p))];
        [mesh.geometry_element(kind).tabulate(&r, order), self.space.element_at(target.position).tabulate(&r, order)]
    }

    /// Where a point of the face is.
    pub(super) fn position(&self, mesh: &Mesh, target: &Target, u: &[f64], [geometry, field]: &Tables) -> Vector3<f64> {
        let dim = mesh.dim();
        let mut y = Vector3::from(mesh.point_at(target.facet.cell, geometry, 0));
        for (k, node) in self.space.entity_nodes(target.position).iter().enumerate() {
            let own = u.get(*node as usize * dim..(*node as usize + 1) * dim).unwrap_or_default();
            own.iter().enumerate().for_each(|(i, value)| y[i] += value * field.values[k]);
        }
        y
    }

    /// The face where it was tabulated.
    pub(super) fn place(&self, mesh: &Mesh, target: &Target, u: &[f64], tables: &Tables) -> Place {
        let (dim, cell) = (mesh.dim(), target.facet.cell);
        let [geometry, field] = tables;
        let mut y = Vector3::from(mesh.point_at(cell, geometry, 0));
        let rows = mesh.jacobian_at(cell, geometry, 0);
        let reference = Matrix3::from_fn(|i, j| if i < dim && j < dim { rows[i][j] } else { 0.0 });
        let mut current = reference;
        for (k, node) in self.space.entity_nodes(target.position).iter().enumerate() {
            let Some(own) = u.get(*node as usize * dim..(*node as usize + 1) * dim) else { continue };
            for (i, value) in own.iter().enumerate() {
                y[i] += value * field.values[k];
                for j in 0..dim {
                    current[(i, j)] += value * field.gradients[k * dim + j];
                }
            }
        }
        let kind = mesh.kind(cell);
        let tangents = kind.facet_map(usize::from(target.facet.local)).tangents.map(Vector3::from);
        let normal = Vector3::from(kind.facet_normal(usize::from(target.facet.local)));
        let jacobians = [reference, current].map(|mut padded| {
            (dim..3).for_each(|k| padded[(k, k)] = 1.0);
            padded
        });
        Place {
            y,
            current: tangents.map(|t| current * t),
            reference: tangents.map(|t| reference * t),
            outward: jacobians[1].try_inverse().map(|inverse| inverse.transpose() * normal),
            jacobians,
        }
    }

    /// The body at an image.
    pub(super) fn body(&self, mesh: &Mesh, u: &[f64], image: &Image) -> Option<Body> {
        let target = self.list.iter().find(|target| Some(target.facet) == image.facet)?;
        let kind = mesh.kind(target.facet.cell);
        let r = [image.reference];
        let tables =
            [mesh.geometry_element(kind).tabulate(&r, 1), self.space.element_at(target.position).tabulate(&r, 1)];
        let at = self.place(mesh, target, u, &tables);
        let deformation = at.jacobians[1] * at.jacobians[0].try_inverse()?;
        Some(Body { y: at.y, deformation, outward: at.outward? })
    }

    /// Whether a ray begins inside a body of the faces, further than it may go back for an image: the nearest face behind is
    /// one that it meets from the front.
    pub(super) fn hold(&self, mesh: &Mesh, u: &[f64], boxes: &Boxes, ray: &Ray) -> bool {
        let (mut near, mut nearest) = (Vec::new(), None);
        self.tree.met(boxes, |bounds| meets(ray, bounds, [ray.back, 0.0]), &mut near);
        for target in near.into_iter().map(|k| &self.list[k as usize]).filter(|t| t.facet.cell != ray.cell) {
            if let Some(Crossing { g, is_front, .. }) = self.crossing(mesh, target, u, ray)
                && g < 0.0
                && -g <= ray.back
                && nearest.is_none_or(|(least, _)| -g < least)
            {
                nearest = Some((-g, is_front));
            }
        }
        nearest.is_some_and(|(_, is_front)| is_front)
    }

    /// Where a ray meets a face; `None` beside it.
    fn crossing(&self, mesh: &Mesh, target: &Target, u: &[f64], ray: &Ray) -> Option<Crossing> {
        let (dim, kind) = (mesh.dim(), mesh.facet_kind(target.facet));
        let mut p = kind.reference_centre();
        let (mut g, mut last) = (0.0, f64::INFINITY);
        for _ in 0..ITERATIONS {
            let at = self.place(mesh, target, u, &self.tables(mesh, target, p, 1));
            let mut m = Matrix3::identity();
            (0..dim - 1).for_each(|k| m.set_column(k, &at.current[k]));
            m.set_column(dim - 1, &-ray.n);
            let step = m.lu().solve(&(ray.x + ray.n * g - at.y))?;
            (0..dim - 1).for_each(|k| p[k] += step[k]);
            g += step[dim - 1];
            let size = step.rows(0, dim - 1).amax();
            // below this the steps are rounding and no longer become shorter
            let is_rounding = size < FOUND && size >= last;
            last = size;
            if size < SETTLED || is_rounding || p.iter().any(|x| x.abs() > FAR) {
                break;
            }
        }
        let is_inside = inside(kind, p).iter().zip(target.margins).all(|(inside, margin)| *inside >= -margin);
        // what is not a number is no hit either
        if !(last < FOUND && is_inside && g.is_finite()) {
            return None;
        }
        let at = self.place(mesh, target, u, &self.tables(mesh, target, p, 1));
        Some(Crossing { p, g, is_front: at.outward?.dot(&ray.n) < 0.0 })
    }

    /// What is told of an image at parameters of a face, with the matrix of its shift.
    pub(super) fn hit_at(
        &self,
        mesh: &Mesh,
        target: &Target,
        tables: &Tables,
        at: &Place,
        p: [f64; 3],
        c: &Matrix3<f64>,
    ) -> Option<Hit> {
        let dim = mesh.dim();
        let mut hit = Hit {
            image: Image {
                cell: target.facet.cell,
                reference: mesh.kind(target.facet.cell).facet_map(usize::from(target.facet.local)).apply(p),
                facet: Some(target.facet),
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
        let turns = self.normal_derivatives(mesh, target, tables, at)?;
        let slope = across(&turns, &pseudo_inverse(&at.reference, dim)?, &at.reference);
        for j in 0..dim {
            for i in 0..dim {
                hit.slope[i + dim * j] = slope[(i, j)];
            }
        }
        Some(hit)
    }

    /// The second derivatives of the position of a face in its parameters: 11, 12, 22.
    pub(super) fn bend(&self, mesh: &Mesh, target: &Target, u: &[f64], tables: &Tables) -> [Vector3<f64>; 3] {
        let (dim, cell) = (mesh.dim(), target.facet.cell);
        let tangents = mesh.kind(cell).facet_map(usize::from(target.facet.local)).tangents;
        let along = |table: &Table, k: usize, [a, b]: [usize; 2]| -> f64 {
            let hessian = &table.hessians[k * dim * dim..][..dim * dim];
            (0..dim * dim).map(|e| tangents[a][e / dim] * hessian[e] * tangents[b][e % dim]).sum()
        };
        let [geometry, field] = tables;
        [[0, 0], [0, 1], [1, 1]].map(|pair| {
            let mut sum = Vector3::zeros();
            for (k, node) in mesh.cell_nodes(cell)[..geometry.n_dofs].iter().enumerate() {
                sum += Vector3::from(mesh.node(*node)) * along(geometry, k, pair);
            }
            for (k, node) in self.space.entity_nodes(target.position).iter().enumerate() {
                let own = u.get(*node as usize * dim..(*node as usize + 1) * dim).unwrap_or_default();
                own.iter().enumerate().for_each(|(i, value)| sum[i] += value * along(field, k, pair));
            }
            sum
        })
    }

    /// The derivatives of the outward unit normal of the reference placement in the parameters.
    fn normal_derivatives(
        &self,
        mesh: &Mesh,
        target: &Target,
        tables: &Tables,
        at: &Place,
    ) -> Option<[Vector3<f64>; 2]> {
        let [x11, x12, x22] = self.bend(mesh, target, &[], tables);
        let [b1, b2] = at.reference;
        let quarter = |v: Vector3<f64>| Vector3::new(v[1], -v[0], 0.0);
        let (normal, turned) = if mesh.dim() == 2 {
            (quarter(b1), [quarter(x11), Vector3::zeros()])
        } else {
            (b1.cross(&b2), [x11.cross(&b2) + b1.cross(&x12), x12.cross(&b2) + b1.cross(&x22)])
        };
        let size = normal.norm();
        if size == 0.0 {
            return None;
        }
        let unit = normal / size;
        let sign = unit.dot(&reference_outward(mesh, target, &tables[0])?).signum();
        Some(turned.map(|t| (t - unit * unit.dot(&t)) * (sign / size)))
    }
}

/// The outward direction of a face in the reference placement.
fn reference_outward(mesh: &Mesh, target: &Target, geometry: &Table) -> Option<Vector3<f64>> {
    let (dim, kind) = (mesh.dim(), mesh.kind(target.facet.cell));
    let rows = mesh.jacobian_at(target.facet.cell, geometry, 0);
    let padded = |i: usize, j: usize| if i < dim && j < dim { rows[i][j] } else { f64::from(u8::from(i == j)) };
    let normal = Vector3::from(kind.facet_normal(usize::from(target.facet.local)));
    Some(Matrix3::from_fn(padded).try_inverse()?.transpose() * normal)
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
        if ray.n[d] == 0.0 {
            if low > 0.0 || high < 0.0 {
                return false;
            }
            continue;
        }
        let (a, b) = (low / ray.n[d], high / ray.n[d]);
        from = from.max(a.min(b));
        to = to.min(a.max(b));
    }
    from <= to
}
