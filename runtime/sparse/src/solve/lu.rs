//! General sparse LU: multifrontal with pivots from within the fronts, and faer's LU where that is not enough.
//!
//! Promises: the fast method is tried first for every new matrix; a vanishing pivot, or a residual that refinement
//! does not repair, leads to the robust one. Which one is used depends on the matrix alone.
//! Does not check solutions: `checked` does, and asks for the other method.

use std::sync::Arc;

use super::SolveError;
use super::factorization::{Factorization, Pivot};
use super::faer_lu::FaerLu;
use super::frontal_lu::{EntryMap, FrontalLu, Part};
use super::symbolic::Symbolic;
use super::triangular_solve::{Transpose, TriangularSolve};
use crate::csr::{Csr, Pattern};

/// A pivot smaller than this part of its column makes the result of the fast method worthless.
const SMALLEST_PIVOT: f64 = 1e-11;

/// A reusable general sparse factorisation.
pub(super) struct SparseLu {
    pattern: Arc<Pattern>,
    symbolic: Symbolic,
    map: EntryMap,
    fronts: FrontalLu,
    triangular: TriangularSolve,
    robust: Option<Box<FaerLu>>,
    uses_robust: bool,
}

impl SparseLu {
    /// Orders and analyses a square pattern. `coordinates` (one point a dof) choose nested dissection.
    pub(super) fn analyze(
        pattern: &Arc<Pattern>,
        coordinates: Option<&[[f64; 3]]>,
        threads: usize,
    ) -> Result<Self, SolveError> {
        // a pattern that is not square is refused by the analysis, with its own words
        let whole = if pattern.n_rows() == pattern.n_cols() { pattern.mirrored()? } else { (**pattern).clone() };
        let symbolic = Symbolic::new(&whole, coordinates, &[])?;
        let members = vec![true; symbolic.n_fronts()];
        let map = EntryMap::new(&symbolic, &members, pattern, true).expect("the structure was made for this pattern");
        let fronts = FrontalLu::new(&symbolic, members, threads)?;
        let triangular = TriangularSolve::new(&symbolic, vec![true; symbolic.n_fronts()], threads);
        let pattern = Arc::clone(pattern);
        Ok(Self { pattern, symbolic, map, fronts, triangular, robust: None, uses_robust: false })
    }

    fn factor_robust(&mut self, matrix: &Csr) -> Result<(), SolveError> {
        if self.robust.is_none() {
            self.robust = Some(Box::new(FaerLu::analyze(&self.pattern)?));
        }
        self.uses_robust = true;
        self.robust.as_mut().expect("it has just been made").factor(matrix)
    }
}

impl Factorization for SparseLu {
    const NEEDS_SYMMETRY: bool = false;

    fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    fn factor(&mut self, matrix: &Csr) -> Result<Pivot, SolveError> {
        self.uses_robust = false;
        let parts = [Part { map: &self.map, values: matrix.values() }];
        match self.fronts.factor(&self.symbolic, &parts, None) {
            Ok((ratio, _)) if ratio > SMALLEST_PIVOT => Ok(Pivot::of(ratio)),
            Ok(_) | Err(SolveError::VanishingPivot { .. }) => {
                // The robust method says nothing about its pivots, so the matrix stays under suspicion.
                self.factor_robust(matrix).map(|()| Pivot::UNKNOWN)
            }
            Err(error) => Err(error),
        }
    }

    fn solve(&mut self, transpose: Transpose, x: &mut [f64]) {
        match &mut self.robust {
            Some(robust) if self.uses_robust => robust.solve(transpose, x),
            _ => {
                let (fronts, symbolic) = (&self.fronts, &self.symbolic);
                self.triangular.solve(symbolic, |front| fronts.front(symbolic, front), transpose, |_| {}, x);
            }
        }
    }

    fn worthwhile_iterations(&self) -> usize {
        if self.uses_robust { 0 } else { self.symbolic.worthwhile_iterations(true) }
    }

    fn is_negative(&self) -> Option<bool> {
        (!self.uses_robust).then(|| self.fronts.is_negative(&self.symbolic))
    }

    fn retry(&mut self, matrix: &Csr) -> Result<bool, SolveError> {
        if self.uses_robust {
            return Ok(false);
        }
        self.factor_robust(matrix).map(|()| true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flow on a grid of `2 m + 1` nodes an edge: two velocities a node with a Laplacian each, a pressure at every second
    /// node, divergences by central differences, so that a pressure does not meet the velocities of its own node.
    fn flow(m: usize) -> (Csr, Vec<[f64; 3]>) {
        let n = 2 * m + 1;
        let velocity = |component: usize, i: usize, j: usize| (component * n * n + i * n + j) as u32;
        let (mut triplets, mut points) = (Vec::new(), Vec::new());
        for component in 0..2 {
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let own = velocity(component, i, j);
                triplets.push((own, own, 4.0));
                let right = (i + 1 < n).then(|| velocity(component, i + 1, j));
                let above = (j + 1 < n).then(|| velocity(component, i, j + 1));
                for other in right.into_iter().chain(above) {
                    triplets.extend([(own, other, -1.0), (other, own, -1.0)]);
                }
                points.push([i as f64, j as f64, 0.0]);
            }
        }
        for (i, j) in (0..m).flat_map(|i| (0..m).map(move |j| (2 * i + 1, 2 * j + 1))) {
            let pressure = points.len() as u32;
            points.push([i as f64, j as f64, 0.0]);
            let differences = [
                (velocity(0, i + 1, j), 1.0),
                (velocity(0, i - 1, j), -1.0),
                (velocity(1, i, j + 1), 1.0),
                (velocity(1, i, j - 1), -1.0),
            ];
            for (dof, value) in differences {
                triplets.extend([(pressure, dof, value), (dof, pressure, value)]);
            }
        }
        (Csr::from_triplets(points.len(), points.len(), &triplets).unwrap(), points)
    }

    /// Few enough nodes for one leaf of the ordering, in which pressures stand behind all velocities.
    #[test]
    fn pressures_of_a_leaf_have_pivots_within_the_fronts() {
        let (matrix, points) = flow(2);
        let mut solver = SparseLu::analyze(matrix.pattern(), Some(&points), 1).unwrap();
        assert!(!solver.factor(&matrix).unwrap().is_suspicious() && !solver.uses_robust);
        let wanted: Vec<f64> = (0..points.len()).map(|dof| 1.0 + (dof % 7) as f64).collect();
        let mut x = vec![0.0; points.len()];
        matrix.multiply(&wanted, &mut x, 1);
        solver.solve(Transpose::No, &mut x);
        let error = x.iter().zip(&wanted).fold(0.0f64, |largest, (x, wanted)| largest.max((x - wanted).abs()));
        assert!(error < 1e-9, "{error:e}");
    }
}
