//! Geometry of a batch: Jacobians, measures, normals and physical gradients of [`LANES`] entities at one point.
//!
//! Every array holds one number a lane; loops over lanes are the innermost, so they become vector instructions.

use pulp::Simd;
use wfl_compiler::ir::LANES;

use crate::{
    areas::{NodeAreas, cross},
    assemble::simd::{Lanes, ZERO, load, parts, plus_product, store},
    domain::{Edge, Group, GroupSide},
};
use wfl_mesh::{element::Table, mesh::Mesh};

/// A number of a table, the same in all lanes or one for each.
pub(super) trait Entry: Copy {
    /// In one lane.
    fn at(&self, lane: usize) -> f64;
    /// Part `p` of a vector.
    fn part<S: Simd>(&self, simd: S, p: usize) -> S::f64s;
}

impl Entry for f64 {
    #[inline(always)]
    fn at(&self, _: usize) -> f64 {
        *self
    }

    #[inline(always)]
    fn part<S: Simd>(&self, simd: S, _: usize) -> S::f64s {
        simd.splat_f64s(*self)
    }
}

impl Entry for Lanes {
    #[inline(always)]
    fn at(&self, lane: usize) -> f64 {
        self[lane]
    }

    #[inline(always)]
    fn part<S: Simd>(&self, _: S, p: usize) -> S::f64s {
        load::<S>(self, p)
    }
}

/// Functions at a point of each lane, as a [`Table`] has them at one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row<'a, N> {
    /// By function.
    pub(super) values: &'a [N],
    /// `[function][direction]`
    pub(super) gradients: &'a [N],
    /// `[function][direction][direction]`
    pub(super) hessians: &'a [N],
}

impl<'a> Row<'a, f64> {
    /// A row of a table, the same in all lanes.
    #[inline(always)]
    pub(super) fn of(table: &'a Table, q: usize) -> Self {
        fn part(all: &[f64], q: usize, n: usize) -> &[f64] {
            all.get(q * n..(q + 1) * n).unwrap_or_default()
        }
        let (n, dim) = (table.n_dofs, table.dim);
        Self {
            values: part(&table.values, q, n),
            gradients: part(&table.gradients, q, n * dim),
            hessians: part(&table.hessians, q, n * dim * dim),
        }
    }
}

/// Rows of a table, one for each lane, side by side.
#[derive(Clone, Debug, Default)]
pub(super) struct OwnRows {
    values: Vec<Lanes>,
    gradients: Vec<Lanes>,
    hessians: Vec<Lanes>,
}

impl OwnRows {
    /// Gathers rows with derivatives up to `order`.
    pub(super) fn gather(&mut self, table: &Table, rows: [usize; LANES], order: usize) {
        let (n, dim) = (table.n_dofs, table.dim);
        let sizes = [n, n * dim, n * dim * dim];
        let lists = [(&mut self.values, &table.values), (&mut self.gradients, &table.gradients)];
        for (k, (out, all)) in lists.into_iter().chain([(&mut self.hessians, &table.hessians)]).enumerate() {
            out.clear();
            if k > order || all.is_empty() {
                continue;
            }
            let of_lanes: [&[f64]; LANES] = rows.map(|row| &all[row * sizes[k]..][..sizes[k]]);
            out.extend((0..sizes[k]).map(|at| Lanes(of_lanes.map(|own| own[at]))));
        }
    }

    pub(super) fn row(&self) -> Row<'_, Lanes> {
        Row { values: &self.values, gradients: &self.gradients, hessians: &self.hessians }
    }
}

/// `out += s * a`, lane by lane.
#[inline(always)]
fn add_scaled(out: &mut Lanes, s: impl Entry, a: &Lanes) {
    for l in 0..LANES {
        out[l] += s.at(l) * a[l];
    }
}

/// The vector product in one lane.
#[inline(always)]
fn cross_of(a: &[Lanes; 3], b: &[Lanes; 3], l: usize) -> [f64; 3] {
    cross([[a[0][l], a[1][l], a[2][l]], [b[0][l], b[1][l], b[2][l]]])
}

/// Gives vectors the length 1.
pub(super) fn make_unit(dim: usize, vectors: &mut [Lanes; 3]) {
    for l in 0..LANES {
        let size = length([vectors[0][l], vectors[1][l], vectors[2][l]]);
        for component in vectors.iter_mut().take(dim) {
            component[l] /= size;
        }
    }
}

/// Node coordinates of a batch: `nodes[node][direction]`. Lanes past the last entity repeat it; nodes past the last one of a
/// cell too.
pub(super) fn gather_nodes(mesh: &Mesh, side: &GroupSide, batch: usize, nodes: &mut Vec<[Lanes; 3]>) {
    let first = batch * LANES;
    let last = side.cells.len() - 1;
    let n = side.geometry.n_dofs;
    nodes.resize(n, [ZERO; 3]);
    let cells: [_; LANES] = std::array::from_fn(|l| mesh.cell_nodes(side.cells[(first + l).min(last)]));
    for (k, slot) in nodes.iter_mut().enumerate() {
        let points = cells.map(|cell| mesh.node(cell[k.min(cell.len() - 1)]));
        *slot = std::array::from_fn(|d| Lanes(points.map(|x| x[d])));
    }
}

/// The geometric map of a batch at one point.
#[derive(Clone, Debug)]
pub(super) struct PointGeometry {
    /// Position.
    pub(super) x: [Lanes; 3],
    /// `jacobian[i][j]`: derivative of coordinate i in reference direction j.
    pub(super) jacobian: [[Lanes; 3]; 3],
    /// `inverse[j][i]`: derivative of reference coordinate j in direction i.
    pub(super) inverse: [[Lanes; 3]; 3],
    /// Determinant of the Jacobian.
    pub(super) determinant: Lanes,
}

impl Default for PointGeometry {
    fn default() -> Self {
        Self { x: [ZERO; 3], jacobian: [[ZERO; 3]; 3], inverse: [[ZERO; 3]; 3], determinant: ZERO }
    }
}

impl PointGeometry {
    /// Evaluates the derivatives of the map at a point.
    #[inline(always)]
    pub(super) fn evaluate<S: Simd, const D: usize, N: Entry>(
        &mut self,
        simd: S,
        at: Row<'_, N>,
        nodes: &[[Lanes; 3]],
    ) {
        for p in 0..parts::<S>() {
            let mut jacobian = [[simd.splat_f64s(0.0); D]; D];
            for (node, gradient) in nodes.iter().zip(at.gradients.chunks_exact(D)) {
                for i in 0..D {
                    let x = load::<S>(&node[i], p);
                    for j in 0..D {
                        jacobian[i][j] = plus_product(simd, jacobian[i][j], gradient[j].part(simd, p), x);
                    }
                }
            }
            for i in 0..D {
                for j in 0..D {
                    store::<S>(&mut self.jacobian[i][j], p, jacobian[i][j]);
                }
            }
            self.invert::<S, D>(simd, &jacobian, p);
        }
    }

    /// Position of a point.
    #[inline(always)]
    pub(super) fn locate<S: Simd, const D: usize, N: Entry>(&mut self, simd: S, at: Row<'_, N>, nodes: &[[Lanes; 3]]) {
        for p in 0..parts::<S>() {
            for i in 0..D {
                let mut sum = simd.splat_f64s(0.0);
                for (node, value) in nodes.iter().zip(at.values) {
                    sum = plus_product(simd, sum, value.part(simd, p), load::<S>(&node[i], p));
                }
                store::<S>(&mut self.x[i], p, sum);
            }
        }
    }

    #[inline(always)]
    fn invert<S: Simd, const D: usize>(&mut self, simd: S, jacobian: &[[S::f64s; D]; D], p: usize) {
        let a = |r: usize, c: usize| jacobian[r][c];
        let minor = |a, b, c, d| simd.sub_f64s(simd.mul_f64s(a, b), simd.mul_f64s(c, d));
        let one = simd.splat_f64s(1.0);
        let inverse = &mut self.inverse;
        let mut set = |i: usize, j: usize, value: S::f64s| store::<S>(&mut inverse[i][j], p, value);
        let determinant = if D == 1 {
            set(0, 0, simd.div_f64s(one, a(0, 0)));
            a(0, 0)
        } else if D == 2 {
            let det = minor(a(0, 0), a(1, 1), a(0, 1), a(1, 0));
            let over = simd.div_f64s(one, det);
            set(0, 0, simd.mul_f64s(a(1, 1), over));
            set(0, 1, simd.mul_f64s(simd.neg_f64s(a(0, 1)), over));
            set(1, 0, simd.mul_f64s(simd.neg_f64s(a(1, 0)), over));
            set(1, 1, simd.mul_f64s(a(0, 0), over));
            det
        } else {
            let c00 = minor(a(1, 1), a(2, 2), a(1, 2), a(2, 1));
            let c01 = minor(a(1, 2), a(2, 0), a(1, 0), a(2, 2));
            let c02 = minor(a(1, 0), a(2, 1), a(1, 1), a(2, 0));
            let det = simd.mul_f64s(a(0, 0), c00);
            let det = plus_product(simd, det, a(0, 1), c01);
            let det = plus_product(simd, det, a(0, 2), c02);
            let over = simd.div_f64s(one, det);
            let mut scaled = |i: usize, j: usize, value: S::f64s| set(i, j, simd.mul_f64s(value, over));
            scaled(0, 0, c00);
            scaled(1, 0, c01);
            scaled(2, 0, c02);
            scaled(0, 1, minor(a(0, 2), a(2, 1), a(0, 1), a(2, 2)));
            scaled(1, 1, minor(a(0, 0), a(2, 2), a(0, 2), a(2, 0)));
            scaled(2, 1, minor(a(0, 1), a(2, 0), a(0, 0), a(2, 1)));
            scaled(0, 2, minor(a(0, 1), a(1, 2), a(0, 2), a(1, 1)));
            scaled(1, 2, minor(a(0, 2), a(1, 0), a(0, 0), a(1, 2)));
            scaled(2, 2, minor(a(0, 0), a(1, 1), a(0, 1), a(1, 0)));
            det
        };
        store::<S>(&mut self.determinant, p, determinant);
    }

    /// Length, area or volume that a unit of the reference entity covers.
    pub(super) fn measure(&self, dim: usize, group: &Group, out: &mut Lanes) {
        if group.is_global {
            *out = Lanes([1.0; LANES]);
            return;
        }
        let Some(tangents) = group.tangents else {
            *out = Lanes(self.determinant.map(f64::abs));
            return;
        };
        let [a, b] = &self.images(dim, &tangents);
        if let Some(Edge { along: [s, r], .. }) = group.edge {
            for l in 0..LANES {
                let speed = || length([0, 1, 2].map(|i| s * a[i][l] + r * b[i][l]));
                out[l] = if dim < 3 { 1.0 } else { speed() };
            }
            return;
        }
        for l in 0..LANES {
            out[l] = match dim {
                1 => 1.0,
                2 => a[0][l].hypot(a[1][l]),
                _ => length(cross_of(a, b, l)),
            };
        }
    }

    /// The derivatives of the position in the parameters of a face.
    fn images<N: Entry>(&self, dim: usize, tangents: &[[N; 3]; 2]) -> [[Lanes; 3]; 2] {
        let mut images = [[ZERO; 3]; 2];
        for (image, tangent) in images.iter_mut().zip(tangents) {
            for i in 0..dim {
                for j in 0..dim {
                    add_scaled(&mut image[i], tangent[j], &self.jacobian[i][j]);
                }
            }
        }
        images
    }

    /// The area vectors of the points of a nodal rule on a face in space.
    #[inline(always)]
    pub(super) fn areas<S: Simd>(
        &mut self,
        simd: S,
        of: &NodeAreas,
        tangents: &[[f64; 3]; 2],
        nodes: &[[Lanes; 3]],
        out: &mut [[Lanes; 3]],
    ) {
        out.fill([ZERO; 3]);
        for g in 0..of.geometry.n_points {
            self.evaluate::<S, 3, f64>(simd, Row::of(&of.geometry, g), nodes);
            let [a, b] = &self.images(3, tangents);
            for (q, area) in out.iter_mut().enumerate() {
                let share = of.of_point(q)[g];
                for l in 0..LANES {
                    for (sum, part) in area.iter_mut().zip(cross_of(a, b, l)) {
                        sum[l] += share * part;
                    }
                }
            }
        }
    }

    /// The outward unit normal: the reference normal times the inverse Jacobian, normalised.
    pub(super) fn normal<N: Entry>(&self, dim: usize, reference: [N; 3], out: &mut [Lanes; 3]) {
        *out = [ZERO; 3];
        for i in 0..dim {
            for j in 0..dim {
                add_scaled(&mut out[i], reference[j], &self.inverse[j][i]);
            }
        }
        make_unit(dim, out);
    }

    /// The unit vector along a face that points out of it at an edge: T (T'T)^-1 of its outward normal in the parameters of
    /// the face, normalised. It is at right angles to the edge and to the normal of the face.
    pub(super) fn conormal(&self, dim: usize, tangents: &[[f64; 3]; 2], edge: &Edge, out: &mut [Lanes; 3]) {
        *out = [ZERO; 3];
        for (part, direction) in edge.outward.iter().zip(&self.duals(dim, tangents)) {
            for i in 0..dim {
                add_scaled(&mut out[i], *part, &direction[i]);
            }
        }
        make_unit(dim, out);
    }

    /// The vectors along a face whose products with the derivatives of the position in its parameters are one and zero.
    fn duals<N: Entry>(&self, dim: usize, tangents: &[[N; 3]; 2]) -> [[Lanes; 3]; 2] {
        let images = self.images(dim, tangents);
        if dim == 3 { dual_of_two(&images) } else { [dual_of_one(&images[0]), [ZERO; 3]] }
    }

    /// Physical gradients of basis functions: derivative `i` of function `k` is written to `out[i * stride + k]`.
    #[inline(always)]
    pub(super) fn gradients<S: Simd, const D: usize, N: Entry>(
        &self,
        simd: S,
        at: Row<'_, N>,
        out: &mut [Lanes],
        stride: usize,
    ) {
        for p in 0..parts::<S>() {
            let mut inverse = [[simd.splat_f64s(0.0); D]; D];
            for (row, from) in inverse.iter_mut().zip(&self.inverse) {
                for (entry, from) in row.iter_mut().zip(from) {
                    *entry = load::<S>(from, p);
                }
            }
            for (k, gradient) in at.gradients.chunks_exact(D).enumerate() {
                for i in 0..D {
                    let mut sum = simd.splat_f64s(0.0);
                    for j in 0..D {
                        sum = plus_product(simd, sum, gradient[j].part(simd, p), inverse[j][i]);
                    }
                    store::<S>(&mut out[i * stride + k], p, sum);
                }
            }
        }
    }

    /// Gradients along a facet of basis functions in its parameters s: grad p = T (T'T)^-1 dp/ds with T = dx/ds, which is
    /// exact on curved facets, too. Derivative `i` of function `k` of `n` is written to `out[i * stride + k]`.
    pub(super) fn surface_gradients<N: Entry>(
        &self,
        dim: usize,
        tangents: &[[N; 3]; 2],
        slopes: &[N],
        n: usize,
        out: &mut [Lanes],
        stride: usize,
    ) {
        let dual = self.duals(dim, tangents);
        let along = slopes.len() / n.max(1);
        for k in 0..n {
            for i in 0..dim {
                let mut sum = ZERO;
                for (slope, direction) in slopes[k * along..][..along].iter().zip(&dual) {
                    add_scaled(&mut sum, *slope, &direction[i]);
                }
                out[i * stride + k] = sum;
            }
        }
    }

    /// Physical second derivatives: of function `k` in directions `i, j` to `out[(i + dim * j) * stride + k]`. With G the
    /// physical gradients (`gradients[i * stride + k]`) and x the map, H = inverse' (H_ref - sum_k G_k d2 x_k) inverse;
    /// `reference` are the functions, `geometry` those of the map.
    #[expect(clippy::too_many_arguments, reason = "two tables at one point")]
    pub(super) fn hessians<N: Entry>(
        &self,
        dim: usize,
        reference: Row<'_, N>,
        geometry: Row<'_, N>,
        nodes: &[[Lanes; 3]],
        gradients: &[Lanes],
        out: &mut [Lanes],
        stride: usize,
    ) {
        let mut curvature = [[[ZERO; 3]; 3]; 3];
        for (node, h) in nodes.iter().zip(geometry.hessians.chunks_exact(dim * dim)) {
            for i in 0..dim {
                for a in 0..dim {
                    for b in 0..dim {
                        add_scaled(&mut curvature[i][a][b], h[a * dim + b], &node[i]);
                    }
                }
            }
        }
        for (k, h) in reference.hessians.chunks_exact(dim * dim).enumerate() {
            let mut inner = [[ZERO; 3]; 3];
            for a in 0..dim {
                for b in 0..dim {
                    inner[a][b] = Lanes(std::array::from_fn(|l| h[a * dim + b].at(l)));
                    for i in 0..dim {
                        for l in 0..LANES {
                            inner[a][b][l] -= gradients[i * stride + k][l] * curvature[i][a][b][l];
                        }
                    }
                }
            }
            for i in 0..dim {
                for j in 0..dim {
                    let mut sum = ZERO;
                    for a in 0..dim {
                        for b in 0..dim {
                            for l in 0..LANES {
                                sum[l] += self.inverse[a][i][l] * inner[a][b][l] * self.inverse[b][j][l];
                            }
                        }
                    }
                    out[(i + dim * j) * stride + k] = sum;
                }
            }
        }
    }
}

/// The vector b along a tangent a with a.b = 1; zero for the facet of a line, which is a point.
fn dual_of_one(a: &[Lanes; 3]) -> [Lanes; 3] {
    let mut out = [ZERO; 3];
    for l in 0..LANES {
        let square: f64 = a.iter().map(|c| c[l] * c[l]).sum();
        if square > 0.0 {
            (0..3).for_each(|i| out[i][l] = a[i][l] / square);
        }
    }
    out
}

/// The vectors of the plane of two tangents whose products with them are one and zero; along an edge there is one tangent,
/// and the second is zero.
fn dual_of_two([a, b]: &[[Lanes; 3]; 2]) -> [[Lanes; 3]; 2] {
    if b.iter().all(|component| component.iter().all(|x| *x == 0.0)) {
        return [dual_of_one(a), [ZERO; 3]];
    }
    let mut out = [[ZERO; 3]; 2];
    for l in 0..LANES {
        let dot = |u: &[Lanes; 3], v: &[Lanes; 3]| -> f64 { (0..3).map(|i| u[i][l] * v[i][l]).sum() };
        let (aa, ab, bb) = (dot(a, a), dot(a, b), dot(b, b));
        let determinant = aa * bb - ab * ab;
        for i in 0..3 {
            out[0][i][l] = (bb * a[i][l] - ab * b[i][l]) / determinant;
            out[1][i][l] = (aa * b[i][l] - ab * a[i][l]) / determinant;
        }
    }
    out
}

/// Length of a short vector, safe for very large and very small meshes.
pub(super) fn length(v: [f64; 3]) -> f64 {
    let m = v[0].abs().max(v[1].abs()).max(v[2].abs());
    if m == 0.0 || !m.is_finite() {
        return m;
    }
    let s: f64 = v.iter().map(|x| (x / m) * (x / m)).sum();
    m * s.sqrt()
}

/// The size of each cell of a batch: with the smallest singular value of the gradient of the geometric map, the
/// largest such value over the nodes of the geometry, times the root of the space dimension. This is the estimate that
/// GetFEM calls `element_size` (twice its `convex_radius_estimate`, src/getfem_mesh.cc, whose `emax` is the smallest
/// one); it is the edge of a square or cube times that root. With the tangents of a facet it is that of the facet, a cell of
/// one dimension less: the length of a segment.
pub(super) fn element_size(
    dim: usize,
    corners: &Table,
    face: Option<[[f64; 3]; 2]>,
    nodes: &[[Lanes; 3]],
    out: &mut Lanes,
) {
    let directions = dim - usize::from(face.is_some());
    #[expect(clippy::cast_precision_loss, reason = "the dimension is 0 to 3")]
    let root = (directions as f64).sqrt();
    for (l, size) in out.iter_mut().enumerate() {
        let mut largest = 0.0f64;
        for q in 0..corners.n_points {
            let mut jacobian = nalgebra::Matrix3::<f64>::zeros();
            for (k, node) in nodes.iter().enumerate() {
                let gradient = &corners.gradients[(q * corners.n_dofs + k) * dim..][..dim];
                for i in 0..dim {
                    for (j, g) in gradient.iter().enumerate() {
                        jacobian[(i, j)] += g * node[i][l];
                    }
                }
            }
            let value = match &face {
                Some(tangents) => smallest_along(&jacobian, tangents, directions),
                None => smallest_singular_value(&jacobian, dim),
            };
            largest = largest.max(value);
        }
        *size = root * largest;
    }
}

/// Of the map of a facet from its parameters, the first `directions` of them.
fn smallest_along(m: &nalgebra::Matrix3<f64>, tangents: &[[f64; 3]; 2], directions: usize) -> f64 {
    let [a, b] = tangents.map(|t| m * nalgebra::Vector3::from(t));
    if directions < 2 { a.norm() } else { nalgebra::Matrix3x2::from_columns(&[a, b]).singular_values().min() }
}

/// Of the leading `dim` by `dim` block.
fn smallest_singular_value(m: &nalgebra::Matrix3<f64>, dim: usize) -> f64 {
    match dim {
        1 => m[(0, 0)].abs(),
        2 => m.fixed_view::<2, 2>(0, 0).into_owned().singular_values().min(),
        _ => m.singular_values().min(),
    }
}
