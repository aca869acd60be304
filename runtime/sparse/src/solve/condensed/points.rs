//! Unknowns at points: equations of a few unknowns each, such as the slip rate and the state of a friction law at a node
//! of a fault, eliminated where they stand.
//!
//! With P the unknowns at points and G the other changing dofs, `C_PP` is a block for each point, and
//! `S = C_GG - C_GP C_PP⁻¹ C_PG` has entries between dofs of one point alone: what is left to be factored has as many
//! unknowns as the bodies have at these points. Rows and columns of a block are scaled before it is inverted, because
//! equations at points have unlike units.
//!
//! Promises: sums in one fixed order. Does not know the bulk and checks no residual.

use std::sync::Arc;

use super::super::SolveError;
use super::super::triangular_solve::Transpose;
use crate::csr::{Csr, Pattern, PatternBuilder};
use crate::index::NONE;

/// Unknowns that are eliminated together: as many as laws at a point have, not as many as a body has.
const LARGEST_BLOCK: usize = 8;
/// Smallest pivot of a scaled block: below it the elimination would lose half of the digits.
const SMALLEST_PIVOT: f64 = 1e-8;

/// An entry of the changing part with its place in the lists of a block.
#[derive(Debug, Clone, Copy)]
struct Entry {
    row: usize,
    column: usize,
    /// Place among the values of the changing part.
    place: usize,
}

/// The unknowns of one point.
#[derive(Debug, Default)]
struct Block {
    /// Eliminated dofs, increasing.
    dofs: Vec<u32>,
    /// Others whose equations hold them, and others in their equations, by number among those that are left.
    rows: Vec<u32>,
    columns: Vec<u32>,
    /// Entries between the eliminated ones, of `rows` in their columns, and of `columns` in their rows.
    own: Vec<Entry>,
    in_rows: Vec<Entry>,
    in_columns: Vec<Entry>,
    /// Place in what is left of each pair of `rows` and `columns`, by rows.
    targets: Vec<usize>,
    /// The inverse of the block, by rows.
    inverse: Vec<f64>,
}

/// The elimination.
#[derive(Debug)]
pub(super) struct Points {
    /// By dof its number among those that are left, or `NONE`.
    left: Vec<u32>,
    /// Dofs that are left, increasing.
    dofs: Vec<u32>,
    blocks: Vec<Block>,
    /// Entries between dofs that are left: place among the values of the changing part, and in what is left of it.
    kept: Vec<(usize, usize)>,
    /// What is left of the changing part.
    reduced: Csr,
    is_negative: bool,
}

impl Points {
    /// The elimination of those of `candidates` that the bulk does not know and that stand in small blocks; `None`
    /// where there are none.
    pub(super) fn new(bulk: &Csr, changing: &Pattern, candidates: &[u32]) -> Result<Option<Self>, SolveError> {
        let n = changing.n_rows();
        let mut is_point = vec![false; n];
        for &dof in candidates {
            is_point[dof as usize] = bulk.row(dof as usize).0.is_empty() && !changing.row(dof as usize).is_empty();
        }
        let mut groups = components(changing, &is_point);
        groups.retain(|group| group.len() <= LARGEST_BLOCK);
        if groups.is_empty() {
            return Ok(None);
        }
        let (mut left, mut dofs) = (vec![0; n], Vec::new());
        groups.iter().flatten().for_each(|&dof| left[dof as usize] = NONE);
        for dof in 0..n as u32 {
            if left[dof as usize] != NONE {
                left[dof as usize] = dofs.len() as u32;
                dofs.push(dof);
            }
        }
        let (mut blocks, kept) = sort_entries(changing, groups, &left);
        let mut pattern = PatternBuilder::new(dofs.len(), dofs.len());
        kept.iter().for_each(|(_, [row, column])| pattern.add_coupling(&[*row], &[*column]));
        blocks.iter().for_each(|block| pattern.add_coupling(&block.rows, &block.columns));
        let reduced = Csr::zeros(pattern.build_shared()?);
        let place = |row: u32, column: u32| {
            reduced.pattern().position(row as usize, column as usize).expect("the pattern was made of these")
        };
        for block in &mut blocks {
            let pairs = block.rows.iter().flat_map(|&row| block.columns.iter().map(move |&column| (row, column)));
            block.targets = pairs.map(|(row, column)| place(row, column)).collect();
        }
        let kept = kept.into_iter().map(|(from, [row, column])| (from, place(row, column))).collect();
        Ok(Some(Self { left, dofs, blocks, kept, reduced, is_negative: false }))
    }

    /// Number of unknowns that are eliminated.
    pub(super) fn count(&self) -> usize {
        self.left.len() - self.dofs.len()
    }

    /// Dofs that are left, increasing.
    pub(super) fn dofs(&self) -> &[u32] {
        &self.dofs
    }

    /// By dof its number among those that are left, or `NONE`.
    pub(super) fn numbers(&self) -> &[u32] {
        &self.left
    }

    /// What is left of the changing part that was reduced last.
    pub(super) fn reduced(&self) -> &Csr {
        &self.reduced
    }

    /// Whether the determinant of the eliminated blocks is negative.
    pub(super) fn is_negative(&self) -> bool {
        self.is_negative
    }

    /// Eliminates the unknowns at points from a changing part.
    ///
    /// # Errors
    /// [`SolveError::VanishingPivot`] where a block can hardly be inverted.
    pub(super) fn reduce(&mut self, changing: &Csr) -> Result<(), SolveError> {
        let values = changing.values();
        let reduced = self.reduced.values_mut();
        reduced.fill(0.0);
        self.kept.iter().for_each(|&(from, to)| reduced[to] += values[from]);
        self.is_negative = false;
        for block in &mut self.blocks {
            self.is_negative ^= block.invert(values)?;
            let m = block.dofs.len();
            for one in &block.in_rows {
                for other in &block.in_columns {
                    let through = block.inverse[one.column * m + other.row];
                    let target = block.targets[one.row * block.columns.len() + other.column];
                    reduced[target] -= values[one.place] * through * values[other.place];
                }
            }
        }
        Ok(())
    }

    /// Solves with the changing part that was reduced last, or its transpose, in place; `inner` solves what is left.
    pub(super) fn solve(&self, transpose: Transpose, changing: &Csr, x: &mut [f64], mut inner: impl FnMut(&mut [f64])) {
        let values = changing.values();
        let mut rest: Vec<f64> = self.dofs.iter().map(|&dof| x[dof as usize]).collect();
        for block in &self.blocks {
            let own = block.times_inverse(transpose, x);
            block.dofs.iter().zip(&own).for_each(|(&dof, value)| x[dof as usize] = *value);
            match transpose {
                Transpose::No => block.in_rows.iter().for_each(|one| {
                    rest[block.rows[one.row] as usize] -= values[one.place] * own[one.column];
                }),
                Transpose::Yes => block.in_columns.iter().for_each(|one| {
                    rest[block.columns[one.column] as usize] -= values[one.place] * own[one.row];
                }),
            }
        }
        inner(&mut rest);
        for block in &self.blocks {
            let mut moved = [0.0; LARGEST_BLOCK];
            match transpose {
                Transpose::No => block.in_columns.iter().for_each(|one| {
                    moved[one.row] += values[one.place] * rest[block.columns[one.column] as usize];
                }),
                Transpose::Yes => block.in_rows.iter().for_each(|one| {
                    moved[one.column] += values[one.place] * rest[block.rows[one.row] as usize];
                }),
            }
            let m = block.dofs.len();
            for (i, &dof) in block.dofs.iter().enumerate() {
                let back: f64 = (0..m).map(|j| block.through(transpose, i, j) * moved[j]).sum();
                x[dof as usize] -= back;
            }
        }
        self.dofs.iter().zip(rest).for_each(|(&dof, value)| x[dof as usize] = value);
    }
}

impl Block {
    fn through(&self, transpose: Transpose, row: usize, column: usize) -> f64 {
        let m = self.dofs.len();
        match transpose {
            Transpose::No => self.inverse[row * m + column],
            Transpose::Yes => self.inverse[column * m + row],
        }
    }

    /// The inverse of the block, or of its transpose, times the entries of `x` at its dofs.
    fn times_inverse(&self, transpose: Transpose, x: &[f64]) -> [f64; LARGEST_BLOCK] {
        let mut out = [0.0; LARGEST_BLOCK];
        for (i, out) in out.iter_mut().enumerate().take(self.dofs.len()) {
            *out = self.dofs.iter().enumerate().map(|(j, &dof)| self.through(transpose, i, j) * x[dof as usize]).sum();
        }
        out
    }

    /// Inverts the block; whether its determinant is negative. Gauss and Jordan's elimination with pivots from the column,
    /// of the block with rows and then columns scaled to largest entries of 1.
    fn invert(&mut self, values: &[f64]) -> Result<bool, SolveError> {
        let m = self.dofs.len();
        let mut a = [[0.0f64; 2 * LARGEST_BLOCK]; LARGEST_BLOCK];
        self.own.iter().for_each(|one| a[one.row][one.column] = values[one.place]);
        let over = |largest: f64| if largest > 0.0 { 1.0 / largest } else { 1.0 };
        let (mut of_rows, mut of_columns) = ([1.0; LARGEST_BLOCK], [1.0; LARGEST_BLOCK]);
        for i in 0..m {
            of_rows[i] = over(a[i][..m].iter().fold(0.0, |most, x| x.abs().max(most)));
            a[i].iter_mut().for_each(|x| *x *= of_rows[i]);
        }
        for j in 0..m {
            of_columns[j] = over((0..m).fold(0.0, |most, i| a[i][j].abs().max(most)));
            a.iter_mut().for_each(|row| row[j] *= of_columns[j]);
        }
        (0..m).for_each(|i| a[i][m + i] = 1.0);
        let mut is_negative = false;
        for k in 0..m {
            let best = (k..m).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs())).expect("there is a row");
            let pivot = a[best][k];
            // also where it is no number
            if !(pivot.abs() >= SMALLEST_PIVOT && pivot.is_finite()) {
                return Err(SolveError::VanishingPivot { dof: self.dofs[k] as usize, ratio: 0.0 });
            }
            is_negative ^= (pivot < 0.0) != (best != k);
            a.swap(k, best);
            a[k].iter_mut().for_each(|x| *x /= pivot);
            let with = a[k];
            for (_, row) in a.iter_mut().enumerate().take(m).filter(|(i, _)| *i != k) {
                let factor = row[k];
                row.iter_mut().zip(with).for_each(|(x, y)| *x -= factor * y);
            }
        }
        self.inverse.clear();
        for i in 0..m {
            self.inverse.extend((0..m).map(|j| of_columns[i] * a[i][m + j] * of_rows[j]));
        }
        Ok(is_negative)
    }
}

/// The connected groups of the marked dofs, each increasing, in the order of their first dofs.
fn components(pattern: &Pattern, marked: &[bool]) -> Vec<Vec<u32>> {
    let (across, _) = pattern.transpose();
    let mut is_seen = vec![false; marked.len()];
    let mut groups = Vec::new();
    for first in (0..marked.len()).filter(|&dof| marked[dof]) {
        if std::mem::replace(&mut is_seen[first], true) {
            continue;
        }
        let (mut group, mut next) = (vec![first as u32], 0);
        while let Some(&dof) = group.get(next) {
            next += 1;
            for &other in pattern.row(dof as usize).iter().chain(across.row(dof as usize)) {
                if marked[other as usize] && !std::mem::replace(&mut is_seen[other as usize], true) {
                    group.push(other);
                }
            }
        }
        group.sort_unstable();
        groups.push(group);
    }
    groups
}

/// The blocks with their entries, and the entries between dofs that are left, each with its row and column there.
fn sort_entries(pattern: &Pattern, groups: Vec<Vec<u32>>, left: &[u32]) -> (Vec<Block>, Vec<(usize, [u32; 2])>) {
    let mut of_dof = vec![(NONE, 0); left.len()];
    for (block, group) in groups.iter().enumerate() {
        group.iter().enumerate().for_each(|(at, &dof)| of_dof[dof as usize] = (block as u32, at));
    }
    let mut blocks: Vec<Block> = groups.into_iter().map(|dofs| Block { dofs, ..Block::default() }).collect();
    let mut kept = Vec::new();
    let number = |list: &mut Vec<u32>, dof: u32| {
        list.iter().position(|&known| known == dof).unwrap_or_else(|| {
            list.push(dof);
            list.len() - 1
        })
    };
    for row in 0..pattern.n_rows() {
        for (place, &column) in (pattern.row_starts()[row]..).zip(pattern.row(row)) {
            let (of_row, of_column) = (of_dof[row], of_dof[column as usize]);
            match (of_row.0, of_column.0) {
                (NONE, NONE) => kept.push((place, [left[row], left[column as usize]])),
                (NONE, block) => {
                    let block = &mut blocks[block as usize];
                    let row = number(&mut block.rows, left[row]);
                    block.in_rows.push(Entry { row, column: of_column.1, place });
                }
                (block, NONE) => {
                    let block = &mut blocks[block as usize];
                    let column = number(&mut block.columns, left[column as usize]);
                    block.in_columns.push(Entry { row: of_row.1, column, place });
                }
                (block, _) => blocks[block as usize].own.push(Entry { row: of_row.1, column: of_column.1, place }),
            }
        }
    }
    (blocks, kept)
}

/// The part of a matrix between dofs that are left, as it is.
pub(super) fn restricted(matrix: &Csr, points: &Points) -> Result<Csr, SolveError> {
    let (mut row_starts, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
    for &dof in points.dofs() {
        let (old, entries) = matrix.row(dof as usize);
        for (&column, value) in old.iter().zip(entries) {
            let new = points.numbers()[column as usize];
            if new != NONE {
                columns.push(new);
                values.push(*value);
            }
        }
        row_starts.push(columns.len());
    }
    let n = points.dofs().len();
    Ok(Csr::new(Arc::new(Pattern::new(n, n, row_starts, columns)?), values)?)
}
