//! Sparse Cholesky factorisation of a symmetric positive definite matrix.
//!
//! Promises: one analysis, any number of factorisations without new memory; a matrix that is not positive definite is
//! refused with the dof and the pivot at which this was seen.
//! Reads the lower half of the reordered matrix only. Does not check residuals: `checked` does.

use std::sync::Arc;

use super::SolveError;
use super::factorization::{Factorization, Pivot};
use super::multifrontal::Multifrontal;
use super::symbolic::Symbolic;
use super::triangular_solve::{FrontFactor, Transpose, TriangularSolve};
use crate::csr::{Csr, Pattern};

/// A reusable sparse Cholesky factorisation.
pub(super) struct Llt {
    pattern: Arc<Pattern>,
    symbolic: Symbolic,
    numeric: Multifrontal,
    triangular: TriangularSolve,
}

impl Llt {
    /// Orders and analyses a symmetric pattern. `coordinates` (one point a dof) choose nested dissection.
    pub(super) fn analyze(
        pattern: &Arc<Pattern>,
        coordinates: Option<&[[f64; 3]]>,
        threads: usize,
    ) -> Result<Self, SolveError> {
        let symbolic = Symbolic::new(pattern, coordinates, &[])?;
        let numeric = Multifrontal::new(&symbolic, vec![true; symbolic.n_fronts()], threads)?;
        let triangular = TriangularSolve::new(&symbolic, vec![true; symbolic.n_fronts()], threads);
        Ok(Self { pattern: Arc::clone(pattern), symbolic, numeric, triangular })
    }

    /// The pivot at a dof, given that everything before it is positive definite: the rest of the matrix is replaced by
    /// a diagonal, and `a_dd + a_dᵀ v` with `A v = -a_d` is formed. The vector (v, 1) comes along: where the pivot is
    /// zero and the matrix semi-definite, it is a null vector.
    pub(super) fn pivot_at(&mut self, matrix: &Csr, dof: usize) -> Option<(f64, Vec<f64>)> {
        let inverse = self.symbolic.ordering.inverse();
        let limit = inverse[dof];
        let mut leading = matrix.clone();
        let mut coupling = vec![0.0; matrix.n_rows()];
        for row in 0..matrix.n_rows() {
            let starts = matrix.pattern().row_starts();
            for place in starts[row]..starts[row + 1] {
                let column = matrix.pattern().columns()[place] as usize;
                if row == dof && inverse[column] < limit {
                    coupling[column] = matrix.values()[place];
                }
                if inverse[row] >= limit || inverse[column] >= limit {
                    leading.values_mut()[place] = if row == column { 1.0 } else { 0.0 };
                }
            }
        }
        self.numeric.factor(&self.symbolic, leading.values(), &mut []).ok()?;
        let mut vector: Vec<f64> = coupling.iter().map(|value| -value).collect();
        Factorization::solve(self, Transpose::No, &mut vector);
        let pivot = matrix.get(dof, dof) + coupling.iter().zip(&vector).map(|(a, v)| a * v).sum::<f64>();
        vector[dof] = 1.0;
        vector.iter().all(|value| value.is_finite()).then_some((pivot, vector))
    }
}

impl Factorization for Llt {
    const NEEDS_SYMMETRY: bool = true;

    fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    fn factor(&mut self, matrix: &Csr) -> Result<Pivot, SolveError> {
        self.numeric.factor(&self.symbolic, matrix.values(), &mut [])?;
        let diagonal: Vec<f64> = (0..matrix.n_rows()).map(|dof| matrix.get(dof, dof)).collect();
        let smallest = self.numeric.smallest_pivot_ratio(&self.symbolic, &diagonal);
        Ok(smallest.map_or(Pivot::HEALTHY, |(ratio, _)| Pivot::of(ratio)))
    }

    fn solve(&mut self, transpose: Transpose, x: &mut [f64]) {
        let numeric = &self.numeric;
        let factor = |front| FrontFactor::Cholesky { panel: numeric.panel(front) };
        self.triangular.solve(&self.symbolic, factor, transpose, |_| {}, x);
    }

    fn worthwhile_iterations(&self) -> usize {
        self.symbolic.worthwhile_iterations(false)
    }

    fn is_negative(&self) -> Option<bool> {
        Some(false)
    }

    fn is_definite(&self) -> Option<bool> {
        Some(true)
    }

    fn null_vector_at(&mut self, matrix: &Csr, error: &SolveError) -> (SolveError, Option<Vec<f64>>) {
        match *error {
            SolveError::NotPositiveDefinite { dof, .. } => match self.pivot_at(matrix, dof) {
                Some((pivot, vector)) => (SolveError::NotPositiveDefinite { dof, pivot }, Some(vector)),
                None => (error.clone(), None),
            },
            _ => (error.clone(), None),
        }
    }
}
