//! How the mesh of a file moves with the parameters that say where it is put.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use wfl::{
    Diagnostic, ResolvedScript,
    ast::{Expr, MeshFile, Placing},
};
use wfl_compiler::Constant;
use wfl_problem::numbers_of;

use super::{ByNode, component, moved_by};
use crate::{extended::Extended, formulas::Formula, refused::not_made};

/// A placement `x -> linear x + shift`, and what it moves by.
#[derive(Clone)]
struct Affine {
    linear: Matrix3<f64>,
    shift: Vector3<f64>,
    d_linear: Matrix3<f64>,
    d_shift: Vector3<f64>,
}

/// By entry the velocities of the nodes of a mesh of files: with A x + c where a node is put, dA A^-1 (y - c) + dc at y. Of
/// several files none is moved by parameters, which is refused before.
pub(super) fn of_files(
    extended: &Extended<'_>,
    script: &ResolvedScript,
    files: &[MeshFile],
    nodes: &[[f64; 3]],
) -> Result<Vec<ByNode>, Box<Diagnostic>> {
    let (still, [file]) = (vec![[0.0; 3]; nodes.len()], files) else {
        return Ok(vec![vec![[0.0; 3]; nodes.len()]; extended.n_live()]);
    };
    let of_entry = |entry: usize| {
        let mut place = Affine {
            linear: Matrix3::identity(),
            shift: Vector3::zeros(),
            d_linear: Matrix3::zeros(),
            d_shift: Vector3::zeros(),
        };
        for step in &file.placed {
            place.follow(extended, script, step, entry)?;
        }
        let Some(inverse) = place.linear.try_inverse() else { return Ok(still.clone()) };
        let rate = place.d_linear * inverse;
        let of_node = |y: &[f64; 3]| (rate * (Vector3::from(*y) - place.shift) + place.d_shift).into();
        Ok(nodes.iter().map(of_node).collect())
    };
    (0..extended.n_live()).map(of_entry).collect()
}

impl Affine {
    /// This one, then a step of placing.
    fn follow(
        &mut self,
        extended: &Extended<'_>,
        script: &ResolvedScript,
        step: &Placing,
        entry: usize,
    ) -> Result<(), Box<Diagnostic>> {
        let params: BTreeMap<String, Constant> = extended.scene.params.iter().cloned().collect();
        let dim = extended.scene.system.mesh.dim();
        let value = |e: &Expr| -> Result<Vec<f64>, Box<Diagnostic>> {
            numbers_of(script, &params, dim, e).ok_or_else(|| not_made("the place of a mesh file is no number"))
        };
        let moved = |e: &Expr| -> Result<Vec<f64>, Box<Diagnostic>> {
            let formula = Formula::new(extended, "the place of a mesh file", e)?;
            moved_by(extended, &formula, &[[0.0; 3]], entry)
        };
        match step {
            Placing::Moved(by) => {
                let (by, d) = (value(by)?, moved(by)?);
                self.shift += Vector3::from_fn(|i, _| component(&by, dim, 0, i));
                self.d_shift += Vector3::from_fn(|i, _| component(&d, dim, 0, i));
            }
            Placing::Scaled(by) => {
                let (factor, d) = (value(by)?[0], moved(by)?.first().copied().unwrap_or(0.0));
                self.d_linear = self.d_linear * factor + self.linear * d;
                self.d_shift = self.d_shift * factor + self.shift * d;
                self.linear *= factor;
                self.shift *= factor;
            }
            Placing::Turned(by, axis) => {
                let axis = axis.as_ref().map(value).transpose()?.unwrap_or_else(|| vec![0.0, 0.0, 1.0]);
                let axis = nalgebra::Unit::new_normalize(Vector3::from_fn(|i, _| component(&axis, 3, 0, i)));
                let turn = *nalgebra::Rotation3::from_axis_angle(&axis, value(by)?[0].to_radians()).matrix();
                let rate = moved(by)?.first().copied().unwrap_or(0.0).to_radians();
                let d_turn = axis.cross_matrix() * turn * rate;
                self.d_linear = turn * self.d_linear + d_turn * self.linear;
                self.d_shift = turn * self.d_shift + d_turn * self.shift;
                self.linear = turn * self.linear;
                self.shift = turn * self.shift;
            }
        }
        Ok(())
    }
}
