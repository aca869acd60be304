//! The directions of a multiplier at one node: which of them act on a displacement, and which of the others a law
//! depends on.
//!
//! Promises: directions are orthonormal; they are axes of the multiplier where possible, so that no node is rotated
//! needlessly.

use wfl_discrete::system::{FIXED, System};
use wfl_sparse::csr::Csr;

use super::{
    super::constraints::{SAME_PLACE, extent},
    Candidate, entry,
    vectors::{NONE, dot, null_space, unit},
};

/// One node with what its multiplier acts on.
pub(super) struct Node {
    pub(super) first: usize,
    pub(super) n: usize,
    place: Vec<usize>,
    position: [f64; 3],
    /// Both sides are one: whatever the laws read, the traction goes on there.
    joined: bool,
    /// The multiplier is of lower degree than what it acts on.
    pub(super) coarse: bool,
    /// It is to follow where it is idle.
    follows: bool,
    /// Orthonormal directions that act on nothing.
    pub(super) idle: Vec<Vec<f64>>,
}

impl Node {
    /// Looks at the tangents of sticking contact. Of a coarse multiplier the directions may be determined by what is around
    /// the node.
    pub(super) fn new(system: &System, numbers: &[u32], stick: &[Csr], candidate: &Candidate) -> Self {
        let field = &system.fields[candidate.field];
        let (first, n) = (candidate.first, field.n_components);
        let mut columns: Vec<Vec<f64>> = Vec::new();
        let mut acts = candidate.joined || candidate.coarse;
        for matrix in stick {
            for reads in [true, false] {
                let coupling = |c: usize, dof: usize| match reads {
                    true => entry(matrix, numbers, first + c, dof),
                    false => entry(matrix, numbers, dof, first + c),
                };
                let mut own: Vec<Vec<f64>> =
                    candidate.place.iter().map(|d| (0..n).map(|c| coupling(c, *d)).collect()).collect();
                let largest = own.iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
                if largest <= 0.0 {
                    continue;
                }
                acts = true;
                own.iter_mut().flatten().for_each(|x| *x /= largest);
                columns.extend(free_columns(system, &candidate.place, own));
            }
        }
        // a multiplier that no term couples with displacements is another matter
        let mut idle = if acts { null_space(n, &columns) } else { Vec::new() };
        let beside: Vec<Vec<f64>> = candidate.shared.iter().map(|k| unit(n, *k)).collect();
        idle.retain(|direction| beside.iter().all(|v| dot(v, direction).abs() <= 0.0));
        idle.extend(beside);
        let position = field.node_position(candidate.node as usize);
        Self {
            first,
            n,
            place: candidate.place.clone(),
            position,
            joined: candidate.joined,
            coarse: candidate.coarse,
            follows: candidate.follows,
            idle,
        }
    }
}

/// The columns of free dofs, rotated to the local frames of their nodes.
fn free_columns(system: &System, place: &[usize], own: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let is_free = |d: usize| system.numbering.free[d] != FIXED;
    let turned = |dof: usize| -> Vec<f64> {
        let at = |d: usize| place.iter().position(|p| *p == d).map(|k| own[k].as_slice());
        let Some(frame) = system.numbering.frames.of(dof) else { return at(dof).unwrap_or_default().to_vec() };
        let axis = &frame.axes[dof - frame.first];
        let mut sum = vec![0.0; own.first().map_or(0, Vec::len)];
        for (k, part) in axis.iter().enumerate() {
            let column = at(frame.first + k).unwrap_or_default();
            sum.iter_mut().zip(column).for_each(|(s, x)| *s += part * x);
        }
        sum
    };
    place.iter().filter(|d| is_free(**d)).map(|d| turned(*d)).collect()
}

/// The idle directions of a node by what becomes of them.
pub(super) struct Split {
    n: usize,
    /// That nothing reads.
    pub(super) dropped: Vec<Vec<f64>>,
    /// That a law reads where the sides can move another way, and all where both sides are one, the multiplier is coarse, or
    /// it is wanted: its values beside are right with the nearest one.
    pub(super) tied: Vec<Vec<f64>>,
}

impl Split {
    /// Looks at the tangents of sliding contact.
    pub(super) fn new(system: &System, numbers: &[u32], slip: &[Csr], nodes: &[Node], which: usize) -> Self {
        let node = &nodes[which];
        let near = SAME_PLACE * extent(&system.mesh);
        let at_place = |other: &&Node| (0..3).all(|d| (other.position[d] - node.position[d]).abs() <= near);
        let beside: Vec<&Node> = nodes.iter().filter(at_place).collect();
        let (mut dropped, mut tied) = (Vec::new(), Vec::new());
        for direction in &node.idle {
            let read = || slip.iter().any(|matrix| is_read(system, numbers, matrix, node, &beside, direction));
            if node.joined || node.coarse || node.follows || read() {
                tied.push(direction.clone())
            } else {
                dropped.push(direction.clone())
            }
        }
        Self { n: node.n, dropped, tied }
    }

    fn idle(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.dropped.iter().chain(&self.tied)
    }

    /// True unless a direction acts on something here.
    pub(super) fn is_idle(&self, direction: &[f64]) -> bool {
        let part: f64 = self.idle().map(|v| dot(v, direction).powi(2)).sum();
        part > NONE
    }

    /// The axes of the frame that the node needs: `None` where its idle directions are components.
    pub(super) fn frame(&self) -> Option<Vec<Vec<f64>>> {
        let is_axis = |v: &Vec<f64>| v.iter().filter(|x| x.abs() > 0.0).count() == 1;
        if self.idle().all(is_axis) {
            return None;
        }
        let idle: Vec<Vec<f64>> = self.idle().cloned().collect();
        let others = null_space(self.n, &idle);
        Some(idle.into_iter().chain(others).collect())
    }
}

/// True if a force on a free displacement of the place, or the law of a multiplier there that acts, follows an idle
/// direction.
fn is_read(system: &System, numbers: &[u32], matrix: &Csr, node: &Node, beside: &[&Node], direction: &[f64]) -> bool {
    let along =
        |row: usize| -> f64 { (0..node.n).map(|c| direction[c] * entry(matrix, numbers, row, node.first + c)).sum() };
    let forces: Vec<Vec<f64>> = node.place.iter().map(|d| vec![along(*d)]).collect();
    let largest = |rows: &mut dyn Iterator<Item = usize>| {
        rows.flat_map(|row| (0..node.n).map(move |c| (row, c)))
            .fold(0.0f64, |m, (row, c)| m.max(entry(matrix, numbers, row, node.first + c).abs()))
    };
    let scale = largest(&mut node.place.iter().copied());
    let free = free_columns(system, &node.place, forces);
    if scale > 0.0 && free.iter().flatten().any(|f| f.abs() > NONE * scale) {
        return true;
    }
    beside.iter().any(|other| {
        let scale = largest(&mut (other.first..other.first + other.n));
        let law: Vec<f64> = (0..other.n).map(|c| along(other.first + c)).collect();
        let acting = null_space(other.n, &other.idle);
        scale > 0.0 && acting.iter().any(|v| dot(v, &law).abs() > NONE * scale)
    })
}
