//! The matrix of a coarser level: `Pᵀ A P`.
//!
//! Row by row of the result: what its column of P takes from the rows of A is gathered first, then multiplied by the
//! rows of P. Of a symmetric matrix only columns at or above the diagonal are computed, the rest is mirrored. Sums are of
//! double precision: the softest motions of thin bodies are far below the rounding of single precision.
//!
//! Promises: of a symmetric matrix the result is exactly symmetric; the same bits for any number of threads.

use rayon::prelude::*;

use super::blocks::{Blocks, Real, RowBuffer, Rows, Transfer};
use crate::index::NONE;

/// Rows of the result in one task of a thread.
const ROWS: usize = 32;

/// What one thread needs.
struct Workspace {
    buffer: RowBuffer,
    /// By fine node its place in `fine`, by coarse node in `coarse`.
    slot_of_fine: Vec<u32>,
    slot_of_coarse: Vec<u32>,
    fine: Vec<u32>,
    coarse: Vec<u32>,
    /// Of `Pᵀ A`, a block for each of `fine`.
    gathered: Vec<f64>,
    /// Of the result, a block for each of `coarse`.
    row: Vec<f64>,
}

/// What of a matrix is made: of symmetric ones one half tells the other.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Triangle {
    Upper,
    Full,
}

/// A part of the rows of the result: the number of blocks of each, their columns and values.
type Part = (Vec<usize>, Vec<u32>, Vec<f64>);

/// `Pᵀ A P` of a symmetric matrix. A coarse unknown that no fine one follows keeps an equation `x = 0`.
pub(super) fn galerkin<T: Real>(a: &dyn Rows, p: &Transfer<T>) -> Blocks<f64> {
    mirrored(parts(a, p, Triangle::Upper), p.down.n_cols, p.down.shape[1])
}

/// The same, and the rounded prolongation: the one of double precision goes before the result takes its room.
pub(super) fn galerkin_then_rounded(a: &dyn Rows, p: Transfer<f64>) -> (Blocks<f64>, Transfer<f32>) {
    let parts = parts(a, &p, Triangle::Upper);
    let p = p.rounded();
    (mirrored(parts, p.down.n_cols, p.down.shape[1]), p)
}

/// `Pᵀ A P` of any matrix; rows without entries are empty.
pub(super) fn galerkin_of_any<T: Real>(a: &dyn Rows, p: &Transfer<T>) -> Blocks<f64> {
    let (n, size) = (p.down.n_cols, p.down.shape[1]);
    let (mut starts, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
    for (counts, of_part, blocks) in parts(a, p, Triangle::Full) {
        for count in counts {
            starts.push(starts[starts.len() - 1] + count);
        }
        columns.extend(of_part);
        values.extend(blocks);
    }
    Blocks { shape: [size, size], n_cols: n, starts, columns, values }
}

/// The rows of `Pᵀ A P`, the upper part of each or all of it.
fn parts<T: Real>(a: &dyn Rows, p: &Transfer<T>, triangle: Triangle) -> Vec<Part> {
    let (n_fine, n_coarse) = (a.n_nodes(), p.down.n_cols);
    let size = p.down.shape[1];
    let workspace = || Workspace {
        buffer: RowBuffer::default(),
        slot_of_fine: vec![NONE; n_fine],
        slot_of_coarse: vec![NONE; n_coarse],
        fine: Vec::new(),
        coarse: Vec::new(),
        gathered: Vec::new(),
        row: Vec::new(),
    };
    let part = |workspace: &mut Workspace, chunk: usize| -> Part {
        let mut part = (Vec::new(), Vec::new(), Vec::new());
        for row in chunk * ROWS..((chunk + 1) * ROWS).min(n_coarse) {
            match p.down.shape {
                [1, 1] => coarse_row::<1, 1, T>(a, p, row, workspace, triangle),
                [2, 2] => coarse_row::<2, 2, T>(a, p, row, workspace, triangle),
                [2, 3] => coarse_row::<2, 3, T>(a, p, row, workspace, triangle),
                [3, 3] => coarse_row::<3, 3, T>(a, p, row, workspace, triangle),
                [3, 6] => coarse_row::<3, 6, T>(a, p, row, workspace, triangle),
                [6, 6] => coarse_row::<6, 6, T>(a, p, row, workspace, triangle),
                _ => unreachable!("blocks have one, two, three or six rows"),
            }
            let mut order: Vec<usize> = (0..workspace.coarse.len()).collect();
            order.sort_unstable_by_key(|k| workspace.coarse[*k]);
            part.0.push(order.len());
            for k in order {
                part.1.push(workspace.coarse[k]);
                part.2.extend_from_slice(&workspace.row[k * size * size..][..size * size]);
            }
        }
        part
    };
    (0..n_coarse.div_ceil(ROWS)).into_par_iter().map_init(workspace, part).collect()
}

/// Fills `row` of the workspace, at and above the diagonal or all of it.
fn coarse_row<const B: usize, const K: usize, T: Real>(
    a: &dyn Rows,
    p: &Transfer<T>,
    row: usize,
    workspace: &mut Workspace,
    triangle: Triangle,
) {
    let Workspace { buffer, slot_of_fine, slot_of_coarse, fine, coarse, gathered, row: result } = workspace;
    fine.clear();
    coarse.clear();
    gathered.clear();
    result.clear();
    for [i, place] in p.column(row) {
        let block = p.down.block(*place as usize).as_chunks::<K>().0;
        let (columns, values) = a.row(*i as usize, buffer);
        for (j, entries) in columns.iter().zip(values.as_chunks::<B>().0.chunks_exact(B)) {
            let slot = &mut slot_of_fine[*j as usize];
            if *slot == NONE {
                *slot = fine.len() as u32;
                fine.push(*j);
                gathered.resize(gathered.len() + B * K, 0.0);
            }
            // blocks by rows of A's columns, so that the inner loop runs over the modes
            let sum = &mut gathered[*slot as usize * B * K..][..B * K];
            for (entries, p) in entries.iter().zip(block) {
                for (sum, entry) in sum.as_chunks_mut::<K>().0.iter_mut().zip(entries) {
                    for (sum, p) in sum.iter_mut().zip(p) {
                        *sum += entry * p.wide();
                    }
                }
            }
        }
    }
    for (j, gathered) in fine.iter().zip(gathered.as_chunks::<K>().0.chunks_exact(B)) {
        slot_of_fine[*j as usize] = NONE;
        let (columns, values) = p.down.row_of(*j as usize);
        for (other, block) in columns.iter().zip(values.as_chunks::<K>().0.chunks_exact(B)) {
            if triangle == Triangle::Upper && (*other as usize) < row {
                continue;
            }
            let slot = &mut slot_of_coarse[*other as usize];
            if *slot == NONE {
                *slot = coarse.len() as u32;
                coarse.push(*other);
                result.resize(result.len() + K * K, 0.0);
            }
            let sum = result[*slot as usize * K * K..][..K * K].as_chunks_mut::<K>().0;
            for (gathered, p) in gathered.iter().zip(block) {
                for (sum, factor) in sum.iter_mut().zip(gathered) {
                    for (sum, p) in sum.iter_mut().zip(p) {
                        *sum += factor * p.wide();
                    }
                }
            }
        }
    }
    coarse.iter().for_each(|other| slot_of_coarse[*other as usize] = NONE);
}

/// The whole matrix from its part at and above the diagonal.
fn mirrored(parts: Vec<Part>, n: usize, size: usize) -> Blocks<f64> {
    let area = size * size;
    let mut starts = vec![0usize; n + 1];
    let mut first = 0;
    for part in &parts {
        for_each_upper(part, &mut first, area, |row, column, _| {
            starts[row + 1] += 1;
            if column != row {
                starts[column + 1] += 1;
            }
        });
    }
    for row in 0..n {
        starts[row + 1] += starts[row];
    }
    let mut next = starts.clone();
    let mut columns = vec![0u32; starts[n]];
    let mut values = vec![0.0; starts[n] * area];
    // rows come in order, so the mirrored entries of a row come before its own, both with increasing columns
    let mut put = |row: usize, column: usize, block: &[f64]| {
        let place = next[row];
        next[row] += 1;
        columns[place] = column as u32;
        let own = &mut values[place * area..][..area];
        if column != row {
            own.copy_from_slice(block);
            let place = next[column];
            next[column] += 1;
            columns[place] = row as u32;
            let other = &mut values[place * area..][..area];
            (0..area).for_each(|k| other[k % size * size + k / size] = block[k]);
            return;
        }
        for i in 0..size {
            for j in 0..size {
                own[i * size + j] = 0.5 * (block[i * size + j] + block[j * size + i]);
            }
            if own[i * size + i] == 0.0 {
                own[i * size + i] = 1.0;
            }
        }
    };
    let mut first = 0;
    // each part goes once it is copied
    parts.into_iter().for_each(|part| for_each_upper(&part, &mut first, area, &mut put));
    Blocks { shape: [size, size], n_cols: n, starts, columns, values }
}

/// Calls with row, column and block of a part; `row` is its first one, and that of the next part afterwards.
fn for_each_upper(part: &Part, row: &mut usize, area: usize, mut f: impl FnMut(usize, usize, &[f64])) {
    let (counts, columns, values) = part;
    let mut at = 0;
    for count in counts {
        for k in at..at + count {
            f(*row, columns[k] as usize, &values[k * area..][..area]);
        }
        at += count;
        *row += 1;
    }
}
