//! Geometry of a batch: Jacobians, measures, normals and physical gradients of [`LANES`] entities at one point.
//!
//! Every array holds one number a lane; loops over lanes are the innermost, so they become vector instructions.

use wfl_compiler::ir::LANES;

use crate::{
    assemble::domain::{Group, GroupSide},
    element::Table,
    mesh::Mesh,
};

/// One number per entity of a batch.
pub type Lanes = [f64; LANES];

/// Zero in every lane.
pub(super) const ZERO: Lanes = [0.0; LANES];

/// `out += a * b`, lane by lane.
#[inline(always)]
pub(super) fn add_product(out: &mut Lanes, a: &Lanes, b: &Lanes) {
    for l in 0..LANES {
        out[l] += a[l] * b[l];
    }
}

/// `out += s * a`, lane by lane.
#[inline(always)]
pub(super) fn add_scaled(out: &mut Lanes, s: f64, a: &Lanes) {
    for l in 0..LANES {
        out[l] += s * a[l];
    }
}

/// Node coordinates of a batch: `nodes[node][direction]`. Lanes past the last entity repeat it.
pub(super) fn gather_nodes(mesh: &Mesh, side: &GroupSide, batch: usize, nodes: &mut Vec<[Lanes; 3]>) {
    let first = batch * LANES;
    let last = side.cells.len() - 1;
    let n = side.geometry.n_dofs;
    nodes.clear();
    nodes.resize(n, [ZERO; 3]);
    for l in 0..LANES {
        let cell = side.cells[(first + l).min(last)];
        for (node, slot) in mesh.cell_nodes(cell).iter().zip(nodes.iter_mut()) {
            let x = mesh.node(*node);
            for d in 0..3 {
                slot[d][l] = x[d];
            }
        }
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
    /// Evaluates the map at point `q` of the geometry table.
    pub(super) fn evaluate(&mut self, dim: usize, table: &Table, q: usize, nodes: &[[Lanes; 3]]) {
        self.x = [ZERO; 3];
        self.jacobian = [[ZERO; 3]; 3];
        let n = table.n_dofs;
        for (k, node) in nodes.iter().enumerate() {
            let value = table.values[q * n + k];
            let gradient = &table.gradients[(q * n + k) * dim..][..dim];
            for i in 0..dim {
                add_scaled(&mut self.x[i], value, &node[i]);
                for (j, g) in gradient.iter().enumerate() {
                    add_scaled(&mut self.jacobian[i][j], *g, &node[i]);
                }
            }
        }
        self.invert(dim);
    }

    fn invert(&mut self, dim: usize) {
        let j = &self.jacobian;
        for l in 0..LANES {
            let a = |r: usize, c: usize| j[r][c][l];
            match dim {
                1 => {
                    self.determinant[l] = a(0, 0);
                    self.inverse[0][0][l] = 1.0 / a(0, 0);
                }
                2 => {
                    let det = a(0, 0) * a(1, 1) - a(0, 1) * a(1, 0);
                    let over = 1.0 / det;
                    self.determinant[l] = det;
                    self.inverse[0][0][l] = a(1, 1) * over;
                    self.inverse[0][1][l] = -a(0, 1) * over;
                    self.inverse[1][0][l] = -a(1, 0) * over;
                    self.inverse[1][1][l] = a(0, 0) * over;
                }
                _ => {
                    let c00 = a(1, 1) * a(2, 2) - a(1, 2) * a(2, 1);
                    let c01 = a(1, 2) * a(2, 0) - a(1, 0) * a(2, 2);
                    let c02 = a(1, 0) * a(2, 1) - a(1, 1) * a(2, 0);
                    let det = a(0, 0) * c00 + a(0, 1) * c01 + a(0, 2) * c02;
                    let over = 1.0 / det;
                    self.determinant[l] = det;
                    self.inverse[0][0][l] = c00 * over;
                    self.inverse[1][0][l] = c01 * over;
                    self.inverse[2][0][l] = c02 * over;
                    self.inverse[0][1][l] = (a(0, 2) * a(2, 1) - a(0, 1) * a(2, 2)) * over;
                    self.inverse[1][1][l] = (a(0, 0) * a(2, 2) - a(0, 2) * a(2, 0)) * over;
                    self.inverse[2][1][l] = (a(0, 1) * a(2, 0) - a(0, 0) * a(2, 1)) * over;
                    self.inverse[0][2][l] = (a(0, 1) * a(1, 2) - a(0, 2) * a(1, 1)) * over;
                    self.inverse[1][2][l] = (a(0, 2) * a(1, 0) - a(0, 0) * a(1, 2)) * over;
                    self.inverse[2][2][l] = (a(0, 0) * a(1, 1) - a(0, 1) * a(1, 0)) * over;
                }
            }
        }
    }

    /// Length, area or volume that a unit of the reference entity covers.
    pub(super) fn measure(&self, dim: usize, group: &Group, out: &mut Lanes) {
        if group.is_global {
            *out = [1.0; LANES];
            return;
        }
        let Some(tangents) = group.tangents else {
            *out = self.determinant.map(f64::abs);
            return;
        };
        let mut images = [[ZERO; 3]; 2];
        for (image, tangent) in images.iter_mut().zip(&tangents) {
            for i in 0..dim {
                for j in 0..dim {
                    add_scaled(&mut image[i], tangent[j], &self.jacobian[i][j]);
                }
            }
        }
        let [a, b] = &images;
        for l in 0..LANES {
            out[l] = match dim {
                1 => 1.0,
                2 => a[0][l].hypot(a[1][l]),
                _ => {
                    let c = [
                        a[1][l] * b[2][l] - a[2][l] * b[1][l],
                        a[2][l] * b[0][l] - a[0][l] * b[2][l],
                        a[0][l] * b[1][l] - a[1][l] * b[0][l],
                    ];
                    length(c)
                }
            };
        }
    }

    /// The outward unit normal: the reference normal times the inverse Jacobian, normalised.
    pub(super) fn normal(&self, dim: usize, reference: [f64; 3], out: &mut [Lanes; 3]) {
        *out = [ZERO; 3];
        for i in 0..dim {
            for j in 0..dim {
                add_scaled(&mut out[i], reference[j], &self.inverse[j][i]);
            }
        }
        for l in 0..LANES {
            let size = length([out[0][l], out[1][l], out[2][l]]);
            for component in out.iter_mut().take(dim) {
                component[l] /= size;
            }
        }
    }

    /// Physical gradients of the basis functions at point `q` of a table: `out[node][direction]`.
    pub(super) fn gradients(&self, dim: usize, table: &Table, q: usize, out: &mut [[Lanes; 3]]) {
        let n = table.n_dofs;
        for (k, slot) in out.iter_mut().enumerate().take(n) {
            let reference = &table.gradients[(q * n + k) * dim..][..dim];
            for (i, component) in slot.iter_mut().enumerate().take(dim) {
                let mut sum = ZERO;
                for (j, g) in reference.iter().enumerate() {
                    add_scaled(&mut sum, *g, &self.inverse[j][i]);
                }
                *component = sum;
            }
        }
    }

    /// Physical second derivatives: `out[node][i + dim * j]`. With G the physical gradients and x the map,
    /// H = inverse' (H_ref - sum_k G_k d2 x_k) inverse.
    #[expect(clippy::too_many_arguments, reason = "two tables at one point")]
    pub(super) fn hessians(
        &self,
        dim: usize,
        table: &Table,
        geometry: &Table,
        nodes: &[[Lanes; 3]],
        q: usize,
        gradients: &[[Lanes; 3]],
        out: &mut [[Lanes; 9]],
    ) {
        let mut curvature = [[[ZERO; 3]; 3]; 3];
        for (k, node) in nodes.iter().enumerate() {
            let h = &geometry.hessians[(q * geometry.n_dofs + k) * dim * dim..][..dim * dim];
            for i in 0..dim {
                for a in 0..dim {
                    for b in 0..dim {
                        add_scaled(&mut curvature[i][a][b], h[a * dim + b], &node[i]);
                    }
                }
            }
        }
        for (k, slot) in out.iter_mut().enumerate().take(table.n_dofs) {
            let h = &table.hessians[(q * table.n_dofs + k) * dim * dim..][..dim * dim];
            let mut inner = [[ZERO; 3]; 3];
            for a in 0..dim {
                for b in 0..dim {
                    inner[a][b] = [h[a * dim + b]; LANES];
                    for i in 0..dim {
                        for l in 0..LANES {
                            inner[a][b][l] -= gradients[k][i][l] * curvature[i][a][b][l];
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
                    slot[i + dim * j] = sum;
                }
            }
        }
    }
}

/// Length of a short vector, safe for very large and very small meshes.
fn length(v: [f64; 3]) -> f64 {
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
/// one); it is the edge of a square or cube times that root.
pub(super) fn element_size(dim: usize, corners: &Table, nodes: &[[Lanes; 3]], out: &mut Lanes) {
    #[expect(clippy::cast_precision_loss, reason = "the dimension is 1 to 3")]
    let root = (dim as f64).sqrt();
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
            largest = largest.max(smallest_singular_value(&jacobian, dim));
        }
        *size = root * largest;
    }
}

/// Of the leading `dim` by `dim` block.
fn smallest_singular_value(m: &nalgebra::Matrix3<f64>, dim: usize) -> f64 {
    match dim {
        1 => m[(0, 0)].abs(),
        2 => m.fixed_view::<2, 2>(0, 0).into_owned().singular_values().min(),
        _ => m.singular_values().min(),
    }
}
