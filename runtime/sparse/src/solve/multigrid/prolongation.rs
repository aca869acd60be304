//! How a coarser level moves a finer one.
//!
//! Between degrees of elements: interpolation given from outside. Between groups of nodes: smoothed aggregation, that is
//! the near null space cut to groups and made orthonormal there, then smoothed by a step of Jacobi with the factor
//! `4/3 / rho(D⁻¹ A)` (Vanek, Mandel and Brezina 1996, sections 2 and 4).
//!
//! Promises: what the near null space spans on the finer level, where no value is prescribed, the coarser one spans too.

use super::aggregate::Aggregates;
use wfl_host::memory::TooMuchMemory;

use super::blocks::{Blocks, RowBuffer, Rows, Transfer};
use super::nodes::{Interpolation, NodeLayout};
use crate::index::NONE;

/// Of the largest eigenvalue: the factor of Jacobi that takes most from the upper part of the spectrum.
const DAMPING: f64 = 4.0 / 3.0;
/// A motion of a group that is this much of what other motions do there already is no motion of its own. Rounding leaves
/// 1e-16 times the ratio of the size of a body to that of a group; a true rotation has the inverse of this ratio.
const DEPENDENT: f64 = 1e-9;

/// A prolongation with the near null space of the coarser level: by coarse node a matrix of its unknowns by modes.
pub(super) struct Coarsened {
    pub(super) transfer: Transfer<f64>,
    pub(super) modes: Vec<f64>,
}

/// Smoothed aggregation. `modes` by node (unknowns by modes), `inverse` the inverted diagonal blocks, `largest` the
/// largest eigenvalue of `D⁻¹ A`.
pub(super) fn smoothed(
    a: &dyn Rows,
    groups: &Aggregates,
    modes: &[f64],
    n_modes: usize,
    inverse: &[f64],
    largest: f64,
) -> Result<Coarsened, TooMuchMemory> {
    let (tentative, coarse) = orthonormal(groups, modes, a.size(), n_modes);
    let smoother = Smoother { a, groups, tentative: &tentative, inverse, n_modes, factor: DAMPING / largest };
    let count = |buffers: &mut Buffers, node: usize| smoother.near(node, buffers);
    let fill = |buffers: &mut Buffers, node: usize, columns: &mut [u32], blocks: &mut [f64]| {
        smoother.row(node, buffers, columns, blocks);
    };
    let down = Blocks::by_rows(a.n_nodes(), [a.size(), n_modes], groups.count, count, fill)?;
    Ok(Coarsened { transfer: Transfer::new(down), modes: coarse })
}

/// What one thread needs to make rows.
#[derive(Default)]
struct Buffers {
    row: RowBuffer,
    /// The groups that the nodes beside one belong to, rising.
    near: Vec<u32>,
    /// Of `A T`, a block for each of them.
    sums: Vec<f64>,
}

/// Makes rows of `(1 - factor D⁻¹ A) T`.
struct Smoother<'a> {
    a: &'a dyn Rows,
    groups: &'a Aggregates,
    tentative: &'a [f64],
    inverse: &'a [f64],
    n_modes: usize,
    factor: f64,
}

impl Smoother<'_> {
    /// Finds the groups that a row has blocks for; their number.
    fn near(&self, node: usize, Buffers { row, near, .. }: &mut Buffers) -> usize {
        let columns = self.a.row(node, row).0;
        near.clear();
        near.extend(columns.iter().map(|j| self.groups.of[*j as usize]).filter(|g| *g != NONE));
        near.sort_unstable();
        near.dedup();
        near.len()
    }

    /// Fills the columns and the blocks of a row.
    fn row(&self, node: usize, buffers: &mut Buffers, out_columns: &mut [u32], out: &mut [f64]) {
        let (b, k) = (self.a.size(), self.n_modes);
        self.near(node, buffers);
        let Buffers { row, near, sums } = buffers;
        let (columns, blocks) = self.a.row(node, row);
        sums.clear();
        sums.resize(near.len() * b * k, 0.0);
        for (j, block) in columns.iter().zip(blocks.chunks_exact(b * b)) {
            let group = self.groups.of[*j as usize];
            let Ok(slot) = near.binary_search(&group) else { continue };
            let other = &self.tentative[*j as usize * b * k..][..b * k];
            let sum = &mut sums[slot * b * k..][..b * k];
            for (sum, entries) in sum.chunks_exact_mut(k).zip(block.chunks_exact(b)) {
                for (entry, other) in entries.iter().zip(other.chunks_exact(k)) {
                    sum.iter_mut().zip(other).for_each(|(sum, t)| *sum += entry * t);
                }
            }
        }
        let inverse = &self.inverse[node * b * b..][..b * b];
        out_columns.copy_from_slice(near);
        for ((group, sum), out) in near.iter().zip(sums.chunks_exact(b * k)).zip(out.chunks_exact_mut(b * k)) {
            let is_own = *group == self.groups.of[node];
            for (c, (row, out)) in inverse.chunks_exact(b).zip(out.chunks_exact_mut(k)).enumerate() {
                for (m, out) in out.iter_mut().enumerate() {
                    let along: f64 = (0..b).map(|i| row[i] * sum[i * k + m]).sum();
                    let own = if is_own { self.tentative[(node * b + c) * k + m] } else { 0.0 };
                    *out = own - self.factor * along;
                }
            }
        }
    }
}

/// The modes of each group made orthonormal (Gram-Schmidt, twice), by node; and what they were made from: by group the
/// triangular matrix that gives the modes back. A mode that depends on those before it is left out.
fn orthonormal(groups: &Aggregates, modes: &[f64], b: usize, k: usize) -> (Vec<f64>, Vec<f64>) {
    let mut starts = vec![0usize; groups.count + 1];
    groups.of.iter().filter(|g| **g != NONE).for_each(|g| starts[*g as usize + 1] += 1);
    (0..groups.count).for_each(|g| starts[g + 1] += starts[g]);
    let mut members = vec![0u32; starts[groups.count]];
    let mut next = starts.clone();
    for (node, group) in groups.of.iter().enumerate().filter(|(_, g)| **g != NONE) {
        members[next[*group as usize]] = node as u32;
        next[*group as usize] += 1;
    }
    let mut tentative = vec![0.0; modes.len()];
    let mut coarse = vec![0.0; groups.count * k * k];
    let mut columns: Vec<Vec<f64>> = vec![Vec::new(); k];
    for (group, triangle) in coarse.chunks_exact_mut(k * k).enumerate() {
        let own = &members[starts[group]..starts[group + 1]];
        for (m, column) in columns.iter_mut().enumerate() {
            column.clear();
            for node in own {
                column.extend((0..b).map(|c| modes[(*node as usize * b + c) * k + m]));
            }
        }
        for m in 0..k {
            let (done, rest) = columns.split_at_mut(m);
            make_orthonormal(done, &mut rest[0], &mut |l, part| triangle[l * k + m] += part);
        }
        for (at, node) in own.iter().enumerate() {
            for c in 0..b {
                for m in 0..k {
                    tentative[(*node as usize * b + c) * k + m] = columns[m][at * b + c];
                }
            }
        }
    }
    (tentative, coarse)
}

/// Makes a vector orthogonal to others and of length 1, or zero where nothing is left of it; `part(l, x)` is told what
/// of it was along vector l, and along itself.
fn make_orthonormal(done: &[Vec<f64>], vector: &mut [f64], part: &mut dyn FnMut(usize, f64)) {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let before = dot(vector, vector).sqrt();
    for _ in 0..2 {
        for (l, other) in done.iter().enumerate() {
            let along = dot(other, vector);
            part(l, along);
            vector.iter_mut().zip(other).for_each(|(x, o)| *x -= along * o);
        }
    }
    let length = dot(vector, vector).sqrt();
    if length > DEPENDENT * before {
        part(done.len(), length);
        vector.iter_mut().for_each(|x| *x /= length);
    } else {
        vector.fill(0.0);
    }
}

/// The prolongation that an interpolation between nodes means, each with axes of its own where it has some.
pub(super) fn interpolated(layout: &NodeLayout, given: &Interpolation, modes: &[f64], n_modes: usize) -> Coarsened {
    let (n, b) = (layout.points.len(), layout.components);
    let solved = layout.solved();
    let list = |node: usize| &given.weights[given.starts[node]..given.starts[node + 1]];
    let mut number = vec![NONE; n];
    let mut coarse_modes = Vec::new();
    let mut count = 0u32;
    for node in 0..n {
        if matches!(list(node), [(own, _)] if *own as usize == node) {
            number[node] = count;
            count += 1;
            coarse_modes.extend_from_slice(&modes[node * b * n_modes..][..b * n_modes]);
        }
    }
    let axes = |node: usize| {
        let at = layout.frames.binary_search_by_key(&(node as u32), |frame| frame.0).ok()?;
        Some(&layout.frames[at].1)
    };
    let (mut starts, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
    for node in 0..n {
        let mut own: Vec<(u32, f64)> = list(node).iter().copied().filter(|w| number[w.0 as usize] != NONE).collect();
        own.sort_by_key(|w| w.0);
        for (other, weight) in own {
            let other = other as usize;
            columns.push(number[other]);
            for c in 0..b {
                for d in 0..b {
                    let turn = turned(axes(node), axes(other), c, d);
                    let moves = solved[node * b + c] && solved[other * b + d];
                    values.push(if moves { weight * turn } else { 0.0 });
                }
            }
        }
        starts.push(columns.len());
    }
    let down = Blocks { shape: [b, b], n_cols: count as usize, starts, columns, values };
    Coarsened { transfer: Transfer::new(down), modes: coarse_modes }
}

/// Component c of a node, along its axes, of the unit vector d of another node, along those of that.
fn turned(here: Option<&Vec<Vec<f64>>>, there: Option<&Vec<Vec<f64>>>, c: usize, d: usize) -> f64 {
    match (here, there) {
        (None, None) => f64::from(u8::from(c == d)),
        (Some(here), None) => here[c][d],
        (None, Some(there)) => there[d][c],
        (Some(here), Some(there)) => here[c].iter().zip(&there[d]).map(|(a, b)| a * b).sum(),
    }
}
