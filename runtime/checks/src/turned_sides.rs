//! Forces on two sides of which one is the other turned: the ends of a sector that repeats around an axis.
//!
//! A tie of such ends is one of turned displacements, f.(R' u - u_image): the force on one side is that on the other turned,
//! and their sum is not zero. The rotation is read off the places of the points and of their images, not off the law.
//! Promises: says nothing where images are not the points moved as a rigid body, or where these lie on a line in space.

use nalgebra::{Matrix3, Vector3};
use wfl_compiler::types::{FieldOp, Side};
use wfl_discrete::{assemble::AssembledTerm, system::System};

use crate::common_motion::finite_turn;

/// Images farther from the points moved as a rigid body than this part of the extent of the mesh are no such images: files of meshes
/// have ten digits or more, and curved faces are met to eight.
const RIGID: f64 = 1e-6;
/// Points nearer to a line than this part of their extent, squared, are on it: positions are known to ten digits.
const ON_A_LINE: f64 = 1e-12;

/// The sum of the forces of a term on one side and of those on the other turned as its points are, the largest component; `moves` says of which
/// fields. `None` where the sides are not turned.
pub(crate) fn turned_sum(system: &System, term: usize, u: &[f64], moves: impl Fn(usize) -> bool) -> Option<f64> {
    let term = &system.terms[term];
    // of a part of the mesh a rank has some of the points only
    let turn = system.mesh.check_whole(|| turn(system, term))?;
    let [mut here, mut there] = [Vector3::zeros(); 2];
    let values = system.values(u);
    term.for_each_flux(&system.mesh, values.view(), |flux, weight| {
        for (slot, flux) in term.law.tests.iter().zip(flux) {
            if slot.op == FieldOp::Value && moves(slot.field.index()) {
                let side = if slot.side == Side::Here { &mut here } else { &mut there };
                side[usize::from(slot.entry)] += weight * flux;
            }
        }
    });
    Some((turn * here + there).amax())
}

/// The rotation from the points of a term to their images, where that is one.
fn turn(system: &System, term: &AssembledTerm) -> Option<Matrix3<f64>> {
    if term.integrator.moves() {
        return None;
    }
    let mut pairs: Vec<[Vector3<f64>; 2]> = Vec::new();
    for group in &term.integrator.domain.groups {
        let there = group.there.as_ref()?;
        for k in 0..group.entities.len() {
            let places = |q: usize| [group.position(&system.mesh, k, q), there.position(&system.mesh, k, q)];
            pairs.extend((0..group.n_points()).map(|q| places(q).map(Vector3::from)));
        }
    }
    #[expect(clippy::cast_precision_loss, reason = "a mean")]
    let mean = |side: usize| pairs.iter().map(|pair| pair[side]).sum::<Vector3<f64>>() / pairs.len() as f64;
    let means = [mean(0), mean(1)];
    pairs.iter_mut().flatten().zip(means.iter().cycle()).for_each(|(place, mean)| *place -= mean);
    let [mut moved, mut squares] = [Matrix3::zeros(); 2];
    for [x, y] in &pairs {
        moved += (y - x) * x.transpose();
        squares += x * x.transpose();
    }
    let dim = system.mesh.dim();
    // about a line any rotation is as good as another one
    let sizes = squares.symmetric_eigenvalues();
    if dim == 3 && sizes.iter().filter(|size| **size > ON_A_LINE * squares.trace()).count() < 2 {
        return None;
    }
    let turn = finite_turn(&moved, &squares, dim)? + Matrix3::identity();
    let apart = pairs.iter().fold(0.0f64, |most, [x, y]| most.max((turn * x - y).amax()));
    let turns = (turn - Matrix3::identity()).amax() > RIGID;
    (turns && apart <= RIGID * system.extent()).then_some(turn)
}
