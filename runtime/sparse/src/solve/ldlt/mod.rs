//! Sparse factorisation `S A S = Pᵀ L D Lᵀ P` of a symmetric matrix that need not be definite, S a diagonal of powers of two
//! and D of blocks of one and two.
//!
//! Half of the multiplications and of the memory of LU, also where a matrix is symmetric only once the equations of each
//! field are multiplied by one number (`symmetry`). Promises: pivots bound the entries of L, wherever in the tree they
//! are found (`front`, `tree`); a matrix that is not symmetric is factored by LU, and so is one without a pivot that is not
//! singular, or whose residual refinement does not repair. Which one is used depends on the matrix alone. Does not check solutions: `checked` does.

mod front;
mod structure;
mod symmetry;
#[cfg(test)]
mod tests;
mod tree;

use std::sync::Arc;

use super::SolveError;
use super::factorization::{Factorization, Pivot};
use super::inertia::Inertia;
use super::lu::SparseLu;
use super::scaling::evened;
use super::symbolic::Symbolic;
use super::triangular_solve::{Transpose, TriangularSolve};
use crate::csr::{Csr, Pattern};
use front::Pivots;
pub use symmetry::symmetrising;
use tree::{FrontalLdlt, Scaled};

/// A reusable factorisation of matrices that may be symmetric.
pub(super) struct Ldlt {
    pattern: Arc<Pattern>,
    coordinates: Option<Vec<[f64; 3]>>,
    /// By dof the group whose equations may be multiplied by one number.
    groups: Option<Vec<u32>>,
    threads: usize,
    symmetric: Option<Symmetric>,
    /// Where a matrix is not symmetric, or pivots do not serve.
    general: Option<Box<SparseLu>>,
    uses_general: bool,
}

/// The factorisation of those that are.
struct Symmetric {
    symbolic: Symbolic,
    fronts: FrontalLdlt,
    triangular: TriangularSolve,
    /// The substitutions are those of a structure in which columns have waited.
    is_moved: bool,
    /// By dof, of the columns.
    scale: Vec<f64>,
    /// By dof, what makes the rows symmetric; empty where they are.
    row_factors: Vec<f64>,
    pivots: Pivots,
}

impl Ldlt {
    /// Takes a square pattern. `coordinates` (one point a dof) choose nested dissection; `groups` have the group of each dof
    /// whose equations may be multiplied by one number to make a matrix symmetric, without them it has to be.
    pub(super) fn analyze(
        pattern: &Arc<Pattern>,
        coordinates: Option<&[[f64; 3]]>,
        groups: Option<&[u32]>,
        threads: usize,
    ) -> Result<Self, SolveError> {
        let (rows, columns) = (pattern.n_rows(), pattern.n_cols());
        let sizes = [
            ("columns of a square matrix", columns),
            ("coordinates, one a dof", coordinates.map_or(rows, <[_]>::len)),
            ("groups, one a dof", groups.map_or(rows, <[_]>::len)),
        ];
        for (what, found) in sizes {
            if found != rows {
                return Err(SolveError::Shape { what, expected: rows, found });
            }
        }
        Ok(Self {
            pattern: if pattern.is_symmetric() { Arc::clone(pattern) } else { Arc::new(pattern.mirrored()?) },
            coordinates: coordinates.map(<[_]>::to_vec),
            groups: groups.map(<[_]>::to_vec),
            threads,
            symmetric: None,
            general: None,
            uses_general: false,
        })
    }

    /// The signs of the eigenvalues of the matrix factored last; `None` where it was not symmetric as it is, or LU took over.
    pub(super) fn inertia(&self) -> Option<Inertia> {
        let symmetric = self.symmetric.as_ref().filter(|s| !self.uses_general && s.row_factors.is_empty())?;
        Some(symmetric.pivots.inertia)
    }

    fn factor_general(&mut self, matrix: &Csr) -> Result<Pivot, SolveError> {
        // the memory of the one goes before that of the other comes
        self.symmetric = None;
        self.uses_general = true;
        if self.general.is_none() {
            let coordinates = self.coordinates.as_deref();
            self.general = Some(Box::new(SparseLu::analyze(&self.pattern, coordinates, self.threads)?));
        }
        self.general.as_mut().expect("it has just been made").factor(matrix)
    }
}

impl Symmetric {
    fn analyze(pattern: &Pattern, coordinates: Option<&[[f64; 3]]>, threads: usize) -> Result<Self, SolveError> {
        let symbolic = Symbolic::new(pattern, coordinates, &[])?;
        Ok(Self {
            fronts: FrontalLdlt::new(&symbolic, threads)?,
            triangular: Self::substitutions(&symbolic, threads),
            is_moved: false,
            scale: Vec::new(),
            row_factors: Vec::new(),
            pivots: Pivots::default(),
            symbolic,
        })
    }

    fn substitutions(structure: &Symbolic, threads: usize) -> TriangularSolve {
        TriangularSolve::new(structure, vec![true; structure.n_fronts()], threads)
    }

    fn factor(&mut self, matrix: &Csr, row_factors: Vec<f64>, threads: usize) -> Result<(), SolveError> {
        self.scale = evened(matrix, &row_factors);
        let forward = self.symbolic.ordering.forward();
        let scale: Vec<f64> = forward.iter().map(|dof| self.scale[*dof as usize]).collect();
        let of_row = |dof: &u32| row_factors[*dof as usize] * self.scale[*dof as usize];
        let row_scale: Vec<f64> = forward.iter().map(of_row).collect();
        let scaled = Scaled { values: matrix.values(), scale: &scale, row_scale: &row_scale };
        self.pivots = self.fronts.factor(&self.symbolic, scaled)?;
        let is_moved = self.fronts.has_moved();
        if is_moved || self.is_moved {
            self.triangular = Self::substitutions(self.fronts.structure(&self.symbolic), threads);
        }
        self.is_moved = is_moved;
        self.row_factors = if row_factors.iter().all(|factor| *factor == 1.0) { Vec::new() } else { row_factors };
        Ok(())
    }

    fn solve(&mut self, transpose: Transpose, x: &mut [f64]) {
        let times = |x: &mut [f64], by: &[f64]| x.iter_mut().zip(by).for_each(|(value, by)| *value *= by);
        let fronts = &self.fronts;
        let structure = fronts.structure(&self.symbolic);
        // T A x = T b, and with the transposed A = (T A) T⁻¹
        if transpose == Transpose::No {
            times(x, &self.row_factors);
        }
        times(x, &self.scale);
        self.triangular.solve(structure, |front| fronts.front(structure, front), transpose, |_| {}, x);
        times(x, &self.scale);
        if transpose == Transpose::Yes {
            times(x, &self.row_factors);
        }
    }

    /// Whether the determinant of the matrix, not of that with multiplied rows, is negative.
    fn is_negative(&self) -> bool {
        let turned = self.row_factors.iter().filter(|factor| **factor < 0.0).count();
        (self.pivots.inertia.negative + turned) % 2 == 1
    }
}

impl Factorization for Ldlt {
    const NEEDS_SYMMETRY: bool = false;

    fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    fn factor(&mut self, matrix: &Csr) -> Result<Pivot, SolveError> {
        let Some(row_factors) = symmetrising(matrix, self.groups.as_deref()) else {
            return self.factor_general(matrix);
        };
        if self.uses_general {
            (self.general, self.uses_general) = (None, false);
        }
        if self.symmetric.is_none() {
            self.symmetric = Some(Symmetric::analyze(&self.pattern, self.coordinates.as_deref(), self.threads)?);
        }
        let symmetric = self.symmetric.as_mut().expect("it has just been made");
        symmetric.factor(matrix, row_factors, self.threads)?;
        Ok(Pivot::of(symmetric.pivots.smallest.0))
    }

    fn solve(&mut self, transpose: Transpose, x: &mut [f64]) {
        match (&mut self.general, &mut self.symmetric) {
            (Some(general), _) if self.uses_general => general.solve(transpose, x),
            (_, Some(symmetric)) => symmetric.solve(transpose, x),
            _ => unreachable!("solutions come after a factor"),
        }
    }

    fn worthwhile_iterations(&self) -> usize {
        match (&self.general, &self.symmetric) {
            (Some(general), _) if self.uses_general => general.worthwhile_iterations(),
            (_, Some(symmetric)) => symmetric.symbolic.worthwhile_iterations(false),
            _ => 0,
        }
    }

    fn is_negative(&self) -> Option<bool> {
        match (&self.general, &self.symmetric) {
            (Some(general), _) if self.uses_general => general.is_negative(),
            (_, Some(symmetric)) => Some(symmetric.is_negative()),
            _ => None,
        }
    }

    fn is_definite(&self) -> Option<bool> {
        match self.inertia() {
            Some(inertia) => Some(inertia.negative == 0),
            None => self.is_negative().filter(|negative| *negative).map(|_| false),
        }
    }

    fn is_symmetric(&self) -> bool {
        !self.uses_general
    }

    fn retry(&mut self, matrix: &Csr) -> Result<bool, SolveError> {
        if self.uses_general {
            return self.general.as_mut().map_or(Ok(false), |general| general.retry(matrix));
        }
        self.factor_general(matrix).map(|_| true)
    }
}
