//! What bodies that meet do beside a motion that all of them have in common: what a length of contact is compared with.
//!
//! Bodies that are carried along together, by a translation or a rotation, small or finite, overlap as they would at rest, and
//! a large way hides no overlap. Taken out are translations that strain no cell, by their mean over the nodes, and the
//! rotation that fits best (finite: Kabsch 1976) where it is nearly all that bodies do; what is left is the diagonal of
//! the box of the displacements that remain. It is never more than the largest displacement: bodies of which one is held
//! are compared with that. Promises: the same for any number of ranks but for the rounding of sums. Does not know motions
//! that the two sides of a law on one body have in common with an obstacle.

use nalgebra::{DMatrix, Matrix3, Vector3};
use wfl_contact::is_between;
use wfl_discrete::{finite::largest, system::System};

use crate::Solved;

/// A rotation counts as one that bodies have in common where at most this part of their displacements is left beside it: a body that
/// is pressed against another one turns a little on average, and what is left is far more than half.
const TURNED: f64 = 0.1;
/// What is left beside a common motion is at least this part of it: solutions keep ten digits at least, and less is rounding.
const LEFT: f64 = 1e-9;

/// A node of a body: where it is and how far it has moved.
struct Node {
    position: Vector3<f64>,
    displacement: Vector3<f64>,
    /// This rank has its equations.
    is_own: bool,
}

/// By body the size (length) of what it and those that it meets do beside a motion that all have in common, at most
/// `by_body`; that itself in a scene without contact of two bodies. By direction `rigid` says whether a translation strains no cell.
pub(crate) fn beside_common(state: Solved<'_>, by_body: &[f64], rigid: [bool; 3]) -> Vec<f64> {
    let Solved { system, contact, u, .. } = state;
    let is_vector = |field: usize| system.fields[field].n_components == system.mesh.dim();
    if !contact.terms().iter().any(|term| is_between(system, term.term, is_vector)) {
        return by_body.to_vec();
    }
    let mut found = by_body.to_vec();
    for first in (0..by_body.len()).filter(|b| system.first_alike(*b) == *b) {
        let is_of_group = |b: &usize| system.first_alike(*b) == first && by_body[*b] > 0.0;
        let group: Vec<usize> = (first..by_body.len()).filter(is_of_group).collect();
        let most = largest(group.iter().map(|b| by_body[*b]));
        if most == 0.0 {
            continue;
        }
        let beside = size_beside(system, &nodes(system, u, &group), rigid).max(LEFT * most);
        group.into_iter().for_each(|b| found[b] = by_body[b].min(beside));
    }
    found
}

/// The nodes of displacements of some bodies.
fn nodes(system: &System, u: &[f64], bodies: &[usize]) -> Vec<Node> {
    let dim = system.mesh.dim();
    let mut found = Vec::new();
    for body in bodies {
        let field = system.field_of_body(*body);
        let Some(start) = system.range(field).map(|range| range.start) else { continue };
        for dof in system.dofs_of_body(*body).filter(|d| (d - start).is_multiple_of(dim)) {
            let mut displacement = Vector3::zeros();
            (0..dim).for_each(|c| displacement[c] = u[dof + c]);
            let position = Vector3::from(system.fields[field].node_position((dof - start) / dim));
            found.push(Node { position, displacement, is_own: system.owns(dof) });
        }
    }
    found
}

/// The diagonal of the box of displacements beside the motion that the nodes have in common.
fn size_beside(system: &System, nodes: &[Node], rigid: [bool; 3]) -> f64 {
    let dim = system.mesh.dim();
    let own = || nodes.iter().filter(|n| n.is_own);
    let mut sums = [0.0; 7];
    for Node { position, displacement, .. } in own() {
        sums[0] += 1.0;
        (0..3).for_each(|c| (sums[1 + c], sums[4 + c]) = (sums[1 + c] + position[c], sums[4 + c] + displacement[c]));
    }
    system.team().sum(&mut sums);
    let mean = |first: usize| Vector3::new(sums[first], sums[first + 1], sums[first + 2]) / sums[0].max(1.0);
    let (centre, mut carried) = (mean(1), mean(4));
    (0..3).filter(|c| !rigid[*c]).for_each(|c| carried[c] = 0.0);
    let box_of = |left: &dyn Fn(&Node) -> Vector3<f64>| {
        let mut ends = [0.0f64; 6];
        for left in nodes.iter().map(left) {
            (0..3).for_each(|c| {
                (ends[c], ends[3 + c]) = (ends[c].max(left[c]), ends[3 + c].max(-left[c]));
            });
        }
        system.team().max(&mut ends);
        // across a direction in which a translation strains, the size is that of the displacement itself
        (0..3)
            .fold(0.0f64, |size, c| size.hypot(if rigid[c] { ends[c] + ends[3 + c] } else { ends[c].max(ends[3 + c]) }))
    };
    let beside_translation = box_of(&|n: &Node| n.displacement - carried);
    if rigid != [true; 3] {
        return beside_translation;
    }
    let [mut moments, mut squares] = [Matrix3::zeros(); 2];
    for Node { position, displacement, .. } in own() {
        let (x, v) = (position - centre, displacement - carried);
        moments += v * x.transpose();
        squares += x * x.transpose();
    }
    for sums in [&mut moments, &mut squares] {
        system.team().sum(sums.as_mut_slice());
    }
    let turns = [small_turn(&moments, &squares, dim), finite_turn(&moments, &squares, dim)];
    turns.into_iter().flatten().fold(beside_translation, |least, turn| {
        let beside = box_of(&|n: &Node| n.displacement - carried - turn * (n.position - centre));
        if beside <= TURNED * beside_translation { least.min(beside) } else { least }
    })
}

/// The skew matrix W that makes |v - W x| least over all nodes, of the sums of v x' and of x x'.
fn small_turn(moments: &Matrix3<f64>, squares: &Matrix3<f64>, dim: usize) -> Option<Matrix3<f64>> {
    // I w = sum of x cross v
    let torque = Vector3::new(
        moments[(2, 1)] - moments[(1, 2)],
        moments[(0, 2)] - moments[(2, 0)],
        moments[(1, 0)] - moments[(0, 1)],
    );
    let inertia = Matrix3::identity() * squares.trace() - squares;
    let turn =
        if dim == 2 { Vector3::new(0.0, 0.0, torque[2] / inertia[(2, 2)]) } else { inertia.try_inverse()? * torque };
    turn.iter().all(|w| w.is_finite()).then(|| turn.cross_matrix())
}

/// R - Id of the rotation R that makes |x + v - R x| least over all nodes (Kabsch 1976), of the same sums.
pub(crate) fn finite_turn(moments: &Matrix3<f64>, squares: &Matrix3<f64>, dim: usize) -> Option<Matrix3<f64>> {
    let covariance = moments + squares;
    let of_space = DMatrix::from_fn(dim, dim, |i, j| covariance[(i, j)]);
    let (left, right) =
        of_space.iter().all(|x| x.is_finite()).then(|| of_space.svd(true, true)).and_then(|svd| svd.u.zip(svd.v_t))?;
    let mut signs = DMatrix::identity(dim, dim);
    signs[(dim - 1, dim - 1)] = (&left * &right).determinant().signum();
    let turn = left * signs * right;
    let mut found = Matrix3::zeros();
    (0..dim).for_each(|i| (0..dim).for_each(|j| found[(i, j)] = turn[(i, j)] - f64::from(u8::from(i == j))));
    Some(found)
}
