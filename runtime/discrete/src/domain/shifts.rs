//! How images shift, by their formula against images that are found again.
//!
//! The other half of `wfl verify`, which tests laws for given shifts: in a state with small displacements drawn at random all
//! images are found again with the displacements moved a little, and their differences are compared with
//! `C F2' (I - n n_y'/(n.n_y)) (d1 - d2 + g dn)`, of closest points with `C (F2' (d1 - d2) + (Grad d2)' (x - y))`. Points whose
//! image leaves its face, edge or corner on the way are not compared.

use nalgebra::{Matrix3, Vector3};

use super::moving::{Point, displacement};
use super::{MovingPoints, rays::Hit};
use wfl_compiler::types::ImageBy;
use wfl_mesh::mesh::Mesh;

/// Random displacements and their changes over the size of a cell.
const AMPLITUDE: f64 = 0.02;
/// The step of the differences over the changes.
const STEP: f64 = 1e-2;

/// What was compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShiftCheck {
    /// Points with an image that were compared.
    pub points: usize,
    /// How many of them have their image on corners, on edges (in the plane on faces), on faces.
    pub ranks: [usize; 3],
    /// All points.
    pub all: usize,
    /// Largest deviation over the largest shift.
    pub error: f64,
}

/// Numbers between -1 and 1.
fn numbers(n: usize, seed: u64) -> Vec<f64> {
    let mut state = seed;
    let next = |_| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        #[expect(clippy::cast_precision_loss, reason = "31 random bits")]
        let x = (state >> 33) as f64 / f64::from(1u32 << 30) - 1.0;
        x
    };
    (0..n).map(next).collect()
}

impl MovingPoints {
    /// The shifts of all images in a state drawn at random.
    #[must_use]
    pub fn check_shifts(&self, mesh: &Mesh) -> ShiftCheck {
        let size = AMPLITUDE * mesh.cell_diameter(self.spare.cell);
        let [here, there] = [&self.here, &self.there];
        // one field on both sides has one value
        let draw = |seed: u64| {
            [here, there].map(|f| {
                let all = numbers(f.space.n_nodes() * mesh.dim(), seed + f.field as u64);
                all.into_iter().map(|x| size * x).collect::<Vec<f64>>()
            })
        };
        let (state, change) = (draw(1), draw(1000));
        let at = |steps: f64| {
            let moved =
                |k: usize| -> Vec<f64> { state[k].iter().zip(&change[k]).map(|(u, d)| u + steps * STEP * d).collect() };
            let [here, there] = [moved(0), moved(1)];
            let current = self.targets.current(mesh, &there);
            let hit = |point: &Point| self.targets.image(mesh, &current, &point.ray(mesh.dim(), &here)?);
            self.points.list.iter().map(hit).collect::<Vec<Option<Hit>>>()
        };
        let found = [0.0, 1.0, -1.0, 2.0, -2.0].map(at);
        let (mut points, mut ranks, mut error, mut largest) = (0, [0; 3], 0.0f64, 0.0f64);
        for (k, point) in self.points.list.iter().enumerate() {
            let hits = [0, 1, 2, 3, 4].map(|j| found[j][k]);
            let [Some(hit), Some(a), Some(b), Some(c), Some(d)] = hits else { continue };
            let lies_on = |hit: &Hit| (hit.image.facet, hit.rank);
            if [a, b, c, d].iter().any(|other| lies_on(other) != lies_on(&hit)) {
                continue;
            }
            let place = |hit: Hit| -> Vector3<f64> {
                let table = mesh.geometry_element(mesh.kind(hit.image.cell)).tabulate(&[hit.image.reference], 0);
                mesh.point_at(hit.image.cell, &table, 0).into()
            };
            let [a, b, c, d] = [a, b, c, d].map(place);
            let difference = ((a - b) * 8.0 - (c - d)) / (12.0 * STEP);
            let Some(shift) = self.shift(mesh, point, &hit, [&state, &change]) else { continue };
            points += 1;
            ranks[hit.rank] += 1;
            largest = largest.max(shift.amax()).max(difference.amax());
            error = error.max((shift - difference).amax());
        }
        let error = if largest > 0.0 { error / largest } else { 0.0 };
        ShiftCheck { points, ranks, all: self.points.list.len(), error }
    }

    /// The shift of an image by the formula, for displacements and their changes here and there.
    fn shift(
        &self,
        mesh: &Mesh,
        point: &Point,
        hit: &Hit,
        [state, change]: [&[Vec<f64>; 2]; 2],
    ) -> Option<Vector3<f64>> {
        let dim = mesh.dim();
        let ray = point.ray(dim, &state[0])?;
        let body = self.targets.body(mesh, &state[1], &hit.image)?;
        let d1 = displacement(dim, &point.table, &point.nodes, &change[0]);
        let space = &self.there.space;
        let position = space.position_of_cell(hit.image.cell)?;
        let table = space.element_at(position).tabulate(&[hit.image.reference], 0);
        let d2 = displacement(dim, &table, space.entity_nodes(position), &change[1]);
        let f2 = body.deformation.transpose();
        let back = match self.by() {
            ImageBy::Ray => {
                let n = ray.n;
                let f1 = Matrix3::identity() + point.gradient(dim, &state[0]);
                let carried = f1.try_inverse()?.transpose() * (point.gradient(dim, &change[0]).transpose() * n);
                let dn = n * n.dot(&carried) - carried;
                let w = d1 - d2 + dn * (body.y - ray.x).dot(&n);
                f2 * (w - n * (body.outward.dot(&w) / body.outward.dot(&n)))
            }
            ImageBy::Closest => {
                let turned = self.targets.body(mesh, &change[1], &hit.image)?.deformation - Matrix3::identity();
                f2 * (d1 - d2) + turned.transpose() * (ray.x - body.y)
            }
        };
        let symmetric = |i: usize, j: usize| {
            let (low, high) = (i.min(j), i.max(j));
            if high < dim { hit.shift[high * (high + 1) / 2 + low] } else { 0.0 }
        };
        Some(Matrix3::from_fn(symmetric) * back)
    }
}
