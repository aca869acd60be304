//! Flow with a pressure, and what is written like it: GMRES with multigrid of the motion and a diagonal in place of the Schur
//! complement of the pressure.
//!
//! The matrix has the parts `[A B'; B C]`, of motion and of pressure. One application solves for the pressure with the diagonal of
//! `C - B D⁻¹ B'`, `D` that of `A`, and then for the motion by a cycle (block upper triangular: Murphy, Golub and Wathen 2000; Elman, Silvester and
//! Wathen 2014, chapter 4). That diagonal grows from node to node as the mass of the pressure over the viscosity does, which is spectrally
//! equivalent to the Schur complement where pressure and motion are a stable pair; its factor is measured once.
//!
//! Where the part of the motion is not symmetric (a flow with convection), its symmetric part makes the levels.
//!
//! Promises: what comes back as a solution has a backward error below the limit, measured with the matrix itself; the same bits
//! for any number of threads. Where there are no levels, or no solution, who asks turns to a factor.

use std::sync::Arc;

use super::super::backward_error::BackwardErrorCheck;
use super::super::multigrid::{Cycle, NodeLayout};
use super::super::{SolveError, SolveReport, SolverOptions};
use super::engine::MOST;
use super::gmres::FlexibleGmres;
use super::preconditioner::{Goal, solve_checked};
use crate::csr::{Csr, Pattern};
use crate::index::NONE;

/// What may be left of the difference to the transpose in a symmetric matrix, in parts of the largest entry: rounding of
/// laws whose stresses cancel.
const ASYMMETRY: f64 = 1e-9;
/// Of so many rows one is looked at: all of them take as long as ten iterations.
const EVERY: usize = 16;

/// Why there are no levels.
const INDEFINITE: &str = "no levels of multigrid: the part of the motion is not positive definite";

/// Solver for matrices of a motion, whose part has a positive definite symmetric part, and a pressure.
pub struct CheckedSaddle {
    /// Rows of the pressure have no place.
    layout: NodeLayout,
    check: BackwardErrorCheck,
    loaded: Option<Loaded>,
    gmres: FlexibleGmres,
}

struct Loaded {
    matrix: Arc<Csr>,
    cycle: Cycle,
    /// Rows of the pressure, increasing, and what their residuals are multiplied by.
    pressure: Vec<(u32, f64)>,
    /// The columns of the pressure in the rows of the motion.
    forces: Csr,
}

impl CheckedSaddle {
    /// Prepares for matrices with this layout; the levels are made with the matrix.
    #[must_use]
    pub fn new(layout: NodeLayout, options: SolverOptions) -> Self {
        let check = BackwardErrorCheck::new(layout.places.len(), options);
        Self { layout, check, loaded: None, gmres: FlexibleGmres::default() }
    }

    /// Number of unknowns by level, the finest first; empty without a matrix.
    #[must_use]
    pub fn level_sizes(&self) -> &[usize] {
        self.loaded.as_ref().map_or(&[], |loaded| loaded.cycle.sizes())
    }

    /// Takes a matrix and makes its levels.
    ///
    /// # Errors
    /// [`SolveError::Library`] where the part of the motion is not positive definite, [`SolveError::NotPositiveDefinite`] where a
    /// pressure acts on nothing,
    /// [`SolveError::TooMuchMemory`].
    pub fn take(&mut self, matrix: &Arc<Csr>) -> Result<(), SolveError> {
        self.loaded = None;
        self.layout.check(matrix)?;
        self.check.set_matrix(&[matrix])?;
        let mut cycle = match self.is_symmetric(matrix) {
            true => Cycle::new(&[matrix], &self.layout),
            false => Cycle::new(&[&matrix.symmetric_part()?], &self.layout),
        }
        .map_err(|error| match error {
            // the number of its pivot is one of a level
            SolveError::NotPositiveDefinite { .. } => SolveError::Library { text: INDEFINITE.to_owned() },
            other => other,
        })?;
        let pressure = self.schur(matrix, &mut cycle)?;
        let forces = self.forces(matrix)?;
        self.loaded = Some(Loaded { matrix: Arc::clone(matrix), cycle, pressure, forces });
        Ok(())
    }

    /// What pressures do to the motion.
    fn forces(&self, matrix: &Csr) -> Result<Csr, SolveError> {
        let places = &self.layout.places;
        let (mut starts, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
        for (row, place) in places.iter().enumerate() {
            let (of_row, entries) = matrix.row(row);
            let pressures = of_row.iter().zip(entries).filter(|(column, _)| places[**column as usize] == NONE);
            for (column, value) in pressures.filter(|_| *place != NONE) {
                columns.push(*column);
                values.push(*value);
            }
            starts.push(columns.len());
        }
        let n = matrix.n_rows();
        Ok(Csr::new(Arc::new(Pattern::new(n, n, starts, columns)?), values)?)
    }

    /// Whether the part of the motion is symmetric, by some of its rows: a term that is not has entries in many of them, and what these
    /// do not show costs iterations and no digit.
    fn is_symmetric(&self, matrix: &Csr) -> bool {
        let (places, limit) = (&self.layout.places, ASYMMETRY * matrix.max_abs());
        let of_motion = |row: &usize| places[*row] != NONE;
        (0..matrix.n_rows()).step_by(EVERY).filter(of_motion).all(|row| {
            let (columns, values) = matrix.row(row);
            let mut entries = columns.iter().zip(values).filter(|(column, _)| of_motion(&(**column as usize)));
            entries.all(|(column, value)| (value - matrix.get(*column as usize, row)).abs() <= limit)
        })
    }

    /// One over a diagonal that stands for the Schur complement, by row of the pressure.
    fn schur(&self, matrix: &Csr, cycle: &mut Cycle) -> Result<Vec<(u32, f64)>, SolveError> {
        let places = &self.layout.places;
        let rows = (0..).zip(places).filter(|(_, place)| **place == NONE).map(|(row, _)| row);
        let of_row = |row: u32| {
            let (columns, values) = matrix.row(row as usize);
            let coupled = columns.iter().zip(values).filter(|(column, _)| places[**column as usize] != NONE);
            let own = |(column, value): (&u32, &f64)| {
                value * matrix.get(*column as usize, row as usize) / matrix.get(*column as usize, *column as usize)
            };
            matrix.get(row as usize, row as usize) - coupled.map(own).sum::<f64>()
        };
        let diagonal: Vec<(u32, f64)> = rows.map(|row| (row, of_row(row))).collect();
        if let Some((row, value)) = diagonal.iter().find(|(_, value)| *value == 0.0 || !value.is_finite()) {
            return Err(SolveError::NotPositiveDefinite { dof: *row as usize, pivot: *value });
        }
        let factor = self.factor_of(matrix, cycle, &diagonal);
        Ok(diagonal.into_iter().map(|(row, value)| (row, 1.0 / (factor * value))).collect())
    }

    /// The Schur complement over its diagonal, in the direction of a pressure that is orthogonal to none in particular.
    fn factor_of(&self, matrix: &Csr, cycle: &mut Cycle, diagonal: &[(u32, f64)]) -> f64 {
        let (n, threads) = (matrix.n_rows(), rayon::current_num_threads());
        let (mut p, mut force, mut motion) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        for (k, (row, _)) in (1u32..).zip(diagonal) {
            p[*row as usize] = (f64::from(k) * 0.618_033_988_749_894_9).fract() - 0.5;
        }
        matrix.multiply(&p, &mut force, threads);
        cycle.apply(&self.layout.places, &force, &mut motion);
        let own: f64 = diagonal.iter().map(|(row, _)| p[*row as usize] * force[*row as usize]).sum();
        let all: f64 = diagonal.iter().map(|(row, value)| p[*row as usize] * p[*row as usize] * value).sum();
        matrix.multiply(&motion, &mut force, threads);
        let schur = own - diagonal.iter().map(|(row, _)| p[*row as usize] * force[*row as usize]).sum::<f64>();
        let factor = schur / all;
        if factor > 0.0 && factor.is_finite() { factor } else { 1.0 }
    }

    /// Solves `A x = rhs` with the matrix taken last until `left` of the right-hand side is left (2-norms of scaled equations).
    ///
    /// # Errors
    /// [`SolveError::TooManyIterations`] or [`SolveError::ResidualTooLarge`] where a factor is needed; those about the right-hand
    /// side.
    pub fn solve_until(&mut self, rhs: &[f64], x: &mut [f64], left: f64) -> Result<SolveReport, SolveError> {
        let Some(Loaded { matrix, cycle, pressure, forces }) = &mut self.loaded else {
            return Err(SolveError::NotFactored);
        };
        let (places, threads) = (&self.layout.places, rayon::current_num_threads());
        let (mut alone, mut left_of) = (vec![0.0; rhs.len()], vec![0.0; rhs.len()]);
        let mut precondition = |r: &[f64], z: &mut [f64]| {
            alone.fill(0.0);
            pressure.iter().for_each(|(row, factor)| alone[*row as usize] = factor * r[*row as usize]);
            forces.multiply(&alone, &mut left_of, threads);
            left_of.iter_mut().zip(r).for_each(|(left, r)| *left = r - *left);
            cycle.apply(places, &left_of, z);
            pressure.iter().for_each(|(row, _)| z[*row as usize] = alone[*row as usize]);
        };
        let (gmres, check) = (&mut self.gmres, &mut self.check);
        solve_checked(gmres, check, matrix, &mut precondition, rhs, x, Goal { left, most: MOST })
            .map(|solved| solved.report)
    }
}
