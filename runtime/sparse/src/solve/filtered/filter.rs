//! A direct solution on few unknowns of what a cycle has left (AMGF, arXiv 2505.18576).
//!
//! Contact is stiff, changes its branches and is not symmetric where there is friction; it touches few unknowns. With a
//! factor of their part of the matrix, multipliers included, the levels of multigrid need not know it.
//!
//! Promises: the same bits for any number of threads. Does not find out which unknowns these are: the caller says so.

use std::sync::Arc;

use rayon::prelude::*;

use super::super::SolveError;
use super::super::factorization::Factorization;
use super::super::lu::SparseLu;
use super::super::triangular_solve::Transpose;
use crate::csr::{Csr, Pattern};
use crate::index::NONE;

/// Rows in one task of a thread.
const ROWS_PER_TASK: usize = 256;

/// The part of the matrices on some unknowns, with its factor.
pub(super) struct Filter {
    /// Rows of the whole, increasing.
    rows: Vec<u32>,
    /// By row of the whole its number here, or [`NONE`].
    inside: Vec<u32>,
    /// What all matrices have in common.
    constant: Csr,
    factor: SparseLu,
    residual: Vec<f64>,
}

impl Filter {
    /// For the sum of a constant matrix and others with the entries of `changing`; `points` are one for each of `rows`.
    ///
    /// # Errors
    /// [`SolveError::TooMuchMemory`].
    pub(super) fn new(constant: &Csr, changing: &Csr, rows: &[u32], points: &[[f64; 3]]) -> Result<Self, SolveError> {
        let mut inside = vec![NONE; changing.n_rows()];
        rows.iter().zip(0..).for_each(|(row, number)| inside[*row as usize] = number);
        let rows = rows.to_vec();
        let constant = part(constant, &rows, &inside)?;
        let other = part(changing, &rows, &inside)?;
        let pattern = Arc::clone(constant.plus(&other)?.pattern());
        let factor = SparseLu::analyze(&pattern, Some(points), rayon::current_num_threads())?;
        let residual = vec![0.0; rows.len()];
        Ok(Self { rows, inside, constant, factor, residual })
    }

    /// Number of unknowns.
    pub(super) fn n_rows(&self) -> usize {
        self.rows.len()
    }

    /// Factors the part of the matrix with this changing part.
    ///
    /// # Errors
    /// [`SolveError`] where there is no factor.
    pub(super) fn take(&mut self, changing: &Csr) -> Result<(), SolveError> {
        let own = self.constant.plus(&part(changing, &self.rows, &self.inside)?)?;
        self.factor.factor(&own).map(|_| ())
    }

    /// `z` and the solution on these unknowns of what `z` leaves of `r` there, for the sum of these parts.
    pub(super) fn apply(&mut self, parts: &[&Csr], r: &[f64], z: &mut [f64]) {
        let rows = &self.rows;
        self.residual.par_chunks_mut(ROWS_PER_TASK).enumerate().for_each(|(chunk, out)| {
            for (out, row) in out.iter_mut().zip(&rows[chunk * ROWS_PER_TASK..]) {
                let mut left = r[*row as usize];
                for part in parts {
                    let (columns, values) = part.row(*row as usize);
                    columns.iter().zip(values).for_each(|(column, value)| left -= value * z[*column as usize]);
                }
                *out = left;
            }
        });
        self.factor.solve(Transpose::No, &mut self.residual);
        self.rows.iter().zip(&self.residual).for_each(|(row, correction)| z[*row as usize] += correction);
    }
}

/// The rows and columns of a matrix that are inside.
fn part(matrix: &Csr, rows: &[u32], inside: &[u32]) -> Result<Csr, SolveError> {
    let (mut starts, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
    for row in rows {
        let (of_row, entries) = matrix.row(*row as usize);
        let own = of_row.iter().zip(entries).filter(|(column, _)| inside[**column as usize] != NONE);
        for (column, value) in own {
            columns.push(inside[*column as usize]);
            values.push(*value);
        }
        starts.push(columns.len());
    }
    Ok(Csr::new(Arc::new(Pattern::new(rows.len(), rows.len(), starts, columns)?), values)?)
}
