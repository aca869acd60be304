//! Expressions along a line: points are found in the cells, values taken there.
//!
//! A point on a face between two bodies belongs to each of them: an expression is taken in the first cell, in the
//! order of the mesh, that holds the point and where the expression lives.

use std::sync::Arc;

use crate::{
    assemble::{Domain, FieldValues, Group, GroupSide},
    field::{Field, FieldError},
    mesh::{CellId, Mesh},
    value::{Sampled, Value},
};

/// How far outside the reference cell a point may lie and still count as inside.
const INSIDE: f64 = 1e-9;
/// Iterations of the inverse map.
const INVERSE_ITERATIONS: usize = 25;

struct LineItem {
    name: String,
    value: Value,
    sampled: Sampled,
    /// The sample of each group of its domain.
    samples: Vec<usize>,
}

/// Samples on a line from one point to another.
pub struct LineSample {
    points: Vec<[f64; 3]>,
    length: f64,
    dim: usize,
    items: Vec<LineItem>,
}

impl LineSample {
    /// `n` equally spaced points with both ends.
    #[must_use]
    pub fn new(mesh: &Mesh, from: [f64; 3], to: [f64; 3], n: usize) -> Self {
        #[expect(clippy::cast_precision_loss, reason = "few points")]
        let at = |k: usize| if n < 2 { 0.0 } else { k as f64 / (n - 1) as f64 };
        let point = |k: usize| [0, 1, 2].map(|d| from[d] + at(k) * (to[d] - from[d]));
        let length = [0, 1, 2].map(|d| to[d] - from[d]).iter().map(|x| x * x).sum::<f64>().sqrt();
        Self { points: (0..n).map(point).collect(), length, dim: mesh.dim(), items: Vec::new() }
    }

    /// Adds an expression that lives on `cells` (sorted).
    ///
    /// # Errors
    /// [`FieldError`] where a field it reads has no dofs.
    pub fn add(
        &mut self,
        mesh: &Mesh,
        fields: &[Field],
        name: String,
        value: Value,
        cells: &[CellId],
    ) -> Result<(), FieldError> {
        let (mut groups, mut samples) = (Vec::new(), Vec::new());
        for (k, x) in self.points.iter().enumerate() {
            if let Some((cell, reference)) = find(mesh, cells, *x) {
                groups.push(point_group(mesh, cell, reference));
                samples.push(k);
            }
        }
        let domain = Arc::new(Domain { dim: mesh.dim(), n_entities: groups.len(), groups });
        let sampled = value.bind(mesh, domain, fields)?;
        self.items.push(LineItem { name, value, sampled, samples });
        Ok(())
    }

    /// Names of the columns: arc length, coordinates, entries of each expression.
    #[must_use]
    pub fn columns(&self) -> Vec<String> {
        let mut names: Vec<String> = ["s", "x", "y", "z"][..=self.dim].iter().map(|s| (*s).to_owned()).collect();
        for item in &self.items {
            let shape = item.value.law.shape;
            for e in 0..shape.len() {
                let index: Vec<String> = shape.indices(e).iter().map(|i| (i + 1).to_string()).collect();
                names.push(if index.is_empty() {
                    item.name.clone()
                } else {
                    format!("{}_{}", item.name, index.join(""))
                });
            }
        }
        names
    }

    /// One row a point; not a number where an expression does not live.
    pub fn rows(&mut self, mesh: &Mesh, time: f64, increment: f64, values: FieldValues<'_>) -> Vec<Vec<f64>> {
        let n = self.points.len();
        #[expect(clippy::cast_precision_loss, reason = "few points")]
        let arc = |k: usize| if n < 2 { 0.0 } else { self.length * k as f64 / (n - 1) as f64 };
        let mut rows: Vec<Vec<f64>> = (0..n)
            .map(|k| {
                let mut row = vec![arc(k)];
                row.extend_from_slice(&self.points[k][..self.dim]);
                row
            })
            .collect();
        for item in &mut self.items {
            item.value.set_step(time, increment);
            let nc = item.value.n_components();
            let start = rows.first().map_or(0, Vec::len);
            rows.iter_mut().for_each(|r| r.resize(start + nc, f64::NAN));
            let samples = &item.samples;
            item.value.for_each_point(mesh, &item.sampled, values, |g, _, _, _, value| {
                rows[samples[g]][start..].copy_from_slice(value);
            });
        }
        rows
    }
}

/// The first cell that holds a point, with its reference coordinates.
fn find(mesh: &Mesh, cells: &[CellId], x: [f64; 3]) -> Option<(CellId, [f64; 3])> {
    let dim = mesh.dim();
    cells.iter().find_map(|cell| {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for node in mesh.cell_nodes(*cell) {
            let p = mesh.node(*node);
            for d in 0..dim {
                low[d] = low[d].min(p[d]);
                high[d] = high[d].max(p[d]);
            }
        }
        let size = (0..dim).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
        if (0..dim).any(|d| x[d] < low[d] - 0.1 * size || x[d] > high[d] + 0.1 * size) {
            return None;
        }
        inverse_map(mesh, *cell, x).map(|r| (*cell, r))
    })
}

/// Newton on the geometric map; `None` when the point is outside.
fn inverse_map(mesh: &Mesh, cell: CellId, x: [f64; 3]) -> Option<[f64; 3]> {
    let (dim, kind) = (mesh.dim(), mesh.kind(cell));
    let element = mesh.geometry_element(kind);
    let mut r = kind.reference_centre();
    for _ in 0..INVERSE_ITERATIONS {
        let table = element.tabulate(&[r], 1);
        let at = mesh.point_at(cell, &table, 0);
        let jacobian = mesh.jacobian_at(cell, &table, 0);
        let m =
            nalgebra::Matrix3::from_fn(
                |i, j| if i < dim && j < dim { jacobian[i][j] } else { f64::from(u8::from(i == j)) },
            );
        let gap = nalgebra::Vector3::from_fn(|i, _| if i < dim { x[i] - at[i] } else { 0.0 });
        let step = m.lu().solve(&gap)?;
        for d in 0..dim {
            r[d] += step[d];
        }
        if step.norm() < 1e-14 {
            break;
        }
    }
    let inside = if kind.is_simplex() {
        r[..dim].iter().all(|c| *c >= -INSIDE) && r[..dim].iter().sum::<f64>() <= 1.0 + INSIDE
    } else {
        r[..dim].iter().all(|c| (-INSIDE..=1.0 + INSIDE).contains(c))
    };
    inside.then_some(r)
}

fn point_group(mesh: &Mesh, cell: CellId, reference: [f64; 3]) -> Group {
    let kind = mesh.kind(cell);
    let points = vec![reference];
    let parameters = points.clone();
    let here = GroupSide { cells: vec![cell], ..GroupSide::new(mesh, kind, points) };
    Group {
        entities: vec![0],
        weights: vec![1.0],
        parameters,
        tangents: None,
        reference_normal: [0.0; 3],
        is_global: false,
        here,
        there: None,
    }
}
