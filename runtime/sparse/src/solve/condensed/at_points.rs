//! A condensed system with unknowns at points: those are eliminated first, by themselves, and the others are condensed.
//!
//! Where the elimination loses digits, or a system turns out to be hard in any way, the whole changing part is condensed
//! as if nothing were known of points, for good; so every error is that of the whole system.
//! Promises: as [`CheckedCondensed`], with the residual of the whole system.

use std::sync::Arc;

use super::points::{Points, restricted};
use super::{CheckedCondensed, Elimination, touched};
use crate::csr::{Csr, Pattern};
use crate::solve::backward_error::{BackwardErrorCheck, inverse_norm_estimate};
use crate::solve::on_pattern::OnPattern;
use crate::solve::triangular_solve::Transpose;
use crate::solve::{LinearSolver, SolveError, SolveReport, SolverMemory, SolverOptions};

/// Up to this many dofs that are left their matrix is dense. Laws at points change it as a whole in each iteration, so
/// nothing is gained by forces that stay (Woodbury).
const DENSE_LEFT: usize = 600;

/// What the solution of the reduced system may leave of its right-hand side (2-norms of scaled equations): the whole is
/// refined with residuals of double-double, twice for all digits.
const LEFT_TO_REFINE: f64 = 1e-8;

/// Whole systems as the caller gives them.
struct Given {
    bulk: Csr,
    pattern: Arc<Pattern>,
    coordinates: Option<Vec<[f64; 3]>>,
    pairs: Vec<(u32, u32)>,
    options: SolverOptions,
}

/// What is left behind the elimination, and how the whole is checked.
struct Reduced {
    points: Points,
    inner: CheckedCondensed,
    check: BackwardErrorCheck,
    /// A matrix has been taken, and its unknowns at points are eliminated.
    is_updated: bool,
}

/// Solver for a constant symmetric bulk and a part that changes, some of whose unknowns may stand at points.
pub struct CheckedAtPoints {
    given: Given,
    changing: OnPattern,
    reduced: Option<Box<Reduced>>,
    /// What stands in where there are no points, or no more.
    whole: Option<Box<CheckedCondensed>>,
    factorisations: usize,
}

impl CheckedAtPoints {
    /// As [`CheckedCondensed::new`]; `candidates` are dofs whose equations are laws at points: those that the bulk does
    /// not know and that few others stand with are eliminated.
    ///
    /// # Errors
    /// As [`CheckedCondensed::new`].
    pub fn new(
        bulk: &Csr,
        changing: &Arc<Pattern>,
        coordinates: Option<&[[f64; 3]]>,
        candidates: &[u32],
        pairs: &[(u32, u32)],
        options: SolverOptions,
    ) -> Result<Self, SolveError> {
        let given = Given {
            bulk: bulk.clone(),
            pattern: Arc::clone(changing),
            coordinates: coordinates.map(<[_]>::to_vec),
            pairs: pairs.to_vec(),
            options,
        };
        let reduced = match Points::new(bulk, changing, candidates)? {
            Some(points) => Some(Box::new(given.reduced(points)?)),
            None => None,
        };
        let whole = if reduced.is_none() { Some(Box::new(given.whole()?)) } else { None };
        Ok(Self { changing: OnPattern::new(changing), given, reduced, whole, factorisations: 1 })
    }

    /// How the changing part is solved.
    pub fn elimination(&self) -> Elimination {
        self.solver().elimination()
    }

    /// Number of unknowns that are eliminated at their points.
    pub fn n_at_points(&self) -> usize {
        self.reduced.as_ref().map_or(0, |reduced| reduced.points.count())
    }

    fn solver(&self) -> &CheckedCondensed {
        match (&self.reduced, &self.whole) {
            (Some(reduced), _) => &reduced.inner,
            (None, Some(whole)) => whole,
            (None, None) => unreachable!("one of them is made with the solver"),
        }
    }

    fn solver_mut(&mut self) -> &mut CheckedCondensed {
        match (&mut self.reduced, &mut self.whole) {
            (Some(reduced), _) => &mut reduced.inner,
            (None, Some(whole)) => whole,
            (None, None) => unreachable!("one of them is made with the solver"),
        }
    }

    /// Condenses the whole changing part from now on.
    fn give_up(&mut self) -> Result<&mut CheckedCondensed, SolveError> {
        if self.reduced.is_some() {
            let whole = self.given.whole()?;
            self.factorisations += self.solver_mut().take_factorisations() + 1;
            (self.whole, self.reduced) = (Some(Box::new(whole)), None);
        }
        Ok(self.solver_mut())
    }

    /// As [`CheckedCondensed::update`].
    ///
    /// # Errors
    /// As [`CheckedCondensed::update`].
    pub fn update(&mut self, changing: &Csr) -> Result<(), SolveError> {
        let Some(reduced) = &mut self.reduced else { return self.solver_mut().update(changing) };
        self.changing.take(changing)?;
        if reduced.update(&self.given.bulk, &self.changing.matrix).is_ok() {
            return Ok(());
        }
        self.give_up()?.update(changing)
    }

    /// As [`CheckedCondensed::solve_to`].
    ///
    /// # Errors
    /// As [`CheckedCondensed::solve_to`].
    pub fn solve_to(&mut self, rhs: &[f64], x: &mut [f64], tolerance: f64) -> Result<SolveReport, SolveError> {
        let Some(reduced) = &mut self.reduced else { return self.solver_mut().solve_to(rhs, x, tolerance) };
        if !reduced.is_updated {
            return Err(SolveError::NotFactored);
        }
        if let Ok(report) = reduced.solve(&self.given.bulk, &self.changing.matrix, rhs, x, tolerance) {
            return Ok(report);
        }
        let changing = self.changing.matrix.clone();
        let whole = self.give_up()?;
        whole.update(&changing)?;
        whole.solve_to(rhs, x, tolerance)
    }

    /// As [`CheckedCondensed::take_factorisations`], with those of the bulk.
    pub fn take_factorisations(&mut self) -> usize {
        std::mem::take(&mut self.factorisations) + self.solver_mut().take_factorisations()
    }

    /// As [`CheckedCondensed::memory`].
    pub fn memory(&self) -> SolverMemory {
        self.solver().memory()
    }

    /// As [`CheckedCondensed::recall`].
    ///
    /// # Errors
    /// As [`CheckedCondensed::recall`].
    pub fn recall(&mut self, memory: &SolverMemory) -> Result<bool, SolveError> {
        if let Some(reduced) = &mut self.reduced {
            let pattern = Arc::clone(reduced.points.reduced().pattern());
            if pattern.n_entries() == memory.factored.len() {
                return reduced.inner.recall(&pattern, memory);
            }
            // it had been given up there
            self.give_up()?;
        }
        let pattern = Arc::clone(&self.given.pattern);
        self.solver_mut().recall(&pattern, memory)
    }

    /// As [`CheckedCondensed::sign_with`].
    ///
    /// # Errors
    /// As [`CheckedCondensed::update`].
    pub fn sign_with(&mut self, changing: &Csr) -> Result<Option<bool>, SolveError> {
        self.update(changing)?;
        let Some(reduced) = &mut self.reduced else { return self.solver_mut().sign_with(changing) };
        if reduced.inner.sign_with(reduced.points.reduced()).is_err() {
            return self.give_up()?.sign_with(changing);
        }
        Ok(self.is_negative())
    }

    /// Whether the determinant of the matrix factored last is negative; `None` before there is one.
    pub fn is_negative(&self) -> Option<bool> {
        let of_points = self.reduced.as_ref().is_some_and(|reduced| reduced.points.is_negative());
        self.solver().is_negative().map(|negative| negative != of_points)
    }

    /// Whether the matrix factored last is positive definite, as far as the factor tells. What is eliminated at points is
    /// not symmetric, and its factor says nothing.
    pub fn is_definite(&self) -> Option<bool> {
        if self.reduced.is_some() { None } else { self.solver().is_definite() }
    }

    /// As that of [`CheckedCondensed`].
    ///
    /// # Errors
    /// As that of [`CheckedCondensed`].
    pub fn condition_estimate(&mut self) -> Result<f64, SolveError> {
        let Some(reduced) = &mut self.reduced else { return self.solver_mut().condition_estimate() };
        reduced.inner.make_fresh()?;
        let Reduced { points, inner, .. } = &mut **reduced;
        let changing = &self.changing.matrix;
        let mut solve = |transpose: Transpose, x: &mut [f64]| {
            points.solve(transpose, changing, x, |rest| inner.engine.solve(transpose, rest));
        };
        let inverse = inverse_norm_estimate(changing.n_rows(), &mut solve);
        Ok(inverse * self.given.bulk.plus(changing)?.norm_1())
    }
}

impl Given {
    fn whole(&self) -> Result<CheckedCondensed, SolveError> {
        let coordinates = self.coordinates.as_deref();
        CheckedCondensed::new(&self.bulk, &self.pattern, coordinates, &self.pairs, self.options)
    }

    fn reduced(&self, points: Points) -> Result<Reduced, SolveError> {
        let left = points.dofs().iter();
        let coordinates = self.coordinates.as_ref().map(|all| left.map(|&dof| all[dof as usize]).collect::<Vec<_>>());
        let bulk = restricted(&self.bulk, &points)?;
        let pattern = points.reduced().pattern();
        let n_changing = touched(pattern).len();
        let choice = if n_changing <= DENSE_LEFT {
            Elimination::Dense { n_changing }
        } else {
            Elimination::Fronts { n_changing }
        };
        let coordinates = coordinates.as_deref();
        let inner = CheckedCondensed::with_choice(&bulk, pattern, coordinates, &[], self.options, |_, _| choice)?;
        let mut check = BackwardErrorCheck::new(self.bulk.n_rows(), self.options);
        check.set_constant_part(&self.bulk);
        Ok(Reduced { points, inner, check, is_updated: false })
    }
}

impl Reduced {
    fn update(&mut self, bulk: &Csr, changing: &Csr) -> Result<(), SolveError> {
        self.check.set_matrix(&[bulk, changing])?;
        self.points.reduce(changing)?;
        self.inner.update(self.points.reduced())?;
        self.is_updated = true;
        Ok(())
    }

    fn solve(
        &mut self,
        bulk: &Csr,
        changing: &Csr,
        rhs: &[f64],
        x: &mut [f64],
        tolerance: f64,
    ) -> Result<SolveReport, SolveError> {
        let Self { points, inner, check, .. } = self;
        check.check_rhs(rhs, x)?;
        let (mut krylov_iterations, mut refactored) = (0, false);
        let mut solver = |x: &mut [f64]| {
            points.solve(Transpose::No, changing, x, |rest| {
                let rhs = rest.to_vec();
                match inner.solve_to(&rhs, rest, tolerance.max(LEFT_TO_REFINE)) {
                    Ok(report) => {
                        krylov_iterations += report.krylov_iterations;
                        refactored |= report.refactored;
                    }
                    Err(_) => rest.fill(f64::NAN),
                }
            });
        };
        let report = check.solve(&[bulk, changing], &mut solver, rhs, x, tolerance)?;
        if check.has_grown(rhs, x) {
            // whether the matrix is singular is found out with the whole of it
            return Err(SolveError::ResidualTooLarge { relative: f64::INFINITY, limit: 0.0 });
        }
        Ok(SolveReport { krylov_iterations, refactored, ..report })
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::CheckedLu;
    use super::super::super::problems::{BoxOptions, ElasticBox};
    use super::*;

    /// A body with two unknowns at each of some points: a rate and a state, in units far apart.
    struct Fault {
        bulk: Csr,
        n_body: u32,
        n_points: u32,
    }

    impl Fault {
        fn new() -> Self {
            let body =
                ElasticBox::new(&BoxOptions { cells: [3, 3, 3], cut: None, fix_low: true, fix_high: false }).matrix;
            let (n_body, n_points) = (body.n_rows() as u32, 10);
            let mut entries = Vec::new();
            for row in 0..n_body {
                let (columns, values) = body.row(row as usize);
                entries.extend(columns.iter().zip(values).map(|(column, value)| (row, *column, *value)));
            }
            let n = (n_body + 2 * n_points) as usize;
            Self { bulk: Csr::from_triplets(n, n, &entries).unwrap(), n_body, n_points }
        }

        fn points(&self) -> Vec<u32> {
            (self.n_body..self.n_body + 2 * self.n_points).collect()
        }

        /// Laws at the points; `rate` is an entry between a rate and itself.
        fn laws(&self, rate: impl Fn(u32) -> f64) -> Csr {
            let mut entries = Vec::new();
            for point in 0..self.n_points {
                let (u, w, psi) = (3 * point, self.n_body + 2 * point, self.n_body + 2 * point + 1);
                entries.extend([(u, u, 0.5), (u, w, 3.0), (u, psi, -2.0), (w, u, 1e9), (w, w, rate(point))]);
                entries.extend([(psi, w, 1e-5), (psi, psi, 2e-5)]);
            }
            let n = self.bulk.n_rows();
            Csr::from_triplets(n, n, &entries).unwrap()
        }

        fn solver(&self, laws: &Csr) -> CheckedAtPoints {
            let options = SolverOptions::default();
            CheckedAtPoints::new(&self.bulk, laws.pattern(), None, &self.points(), &[], options).unwrap()
        }

        fn load(&self) -> Vec<f64> {
            (0..self.bulk.n_rows()).map(|i| ((i * 5) % 11) as f64 - 4.5).collect()
        }

        fn check(&self, solver: &mut CheckedAtPoints, laws: &Csr) {
            let (b, sum) = (self.load(), self.bulk.plus(laws).unwrap());
            let (mut x, mut wanted) = (vec![0.0; b.len()], vec![0.0; b.len()]);
            solver.update(laws).unwrap();
            solver.solve_to(&b, &mut x, 0.0).unwrap();
            let mut direct = CheckedLu::new(sum.pattern(), None, SolverOptions::default()).unwrap();
            direct.factor(&sum).unwrap();
            direct.solve(&b, &mut wanted).unwrap();
            for (x, wanted) in x.iter().zip(&wanted) {
                assert!((x - wanted).abs() <= 1e-9 * wanted.abs().max(1e-9), "{x} instead of {wanted}");
            }
            let mut whole = self.solver(laws).given.whole().unwrap();
            assert_eq!(solver.is_negative(), whole.sign_with(laws).unwrap());
        }
    }

    #[test]
    fn laws_at_points_leave_the_dofs_of_the_body_alone() {
        let fault = Fault::new();
        let laws = |step: u32| fault.laws(move |point| -1e7 * f64::from(1 + point) * (1.0 + 0.3 * f64::from(step)));
        let mut solver = fault.solver(&laws(0));
        for step in 0..4 {
            fault.check(&mut solver, &laws(step));
        }
        assert_eq!(solver.n_at_points(), 20);
        assert_eq!(solver.elimination(), Elimination::Dense { n_changing: 10 });
        let fresh = &mut fault.solver(&laws(3));
        fresh.update(&laws(3)).unwrap();
        let mut whole = fresh.given.whole().unwrap();
        whole.update(&laws(3)).unwrap();
        let (estimate, wanted) = (solver.condition_estimate().unwrap(), whole.condition_estimate().unwrap());
        assert!((estimate / wanted - 1.0).abs() < 1e-3, "{estimate} {wanted}");
    }

    #[test]
    fn nothing_is_solved_before_a_matrix_was_taken() {
        let fault = Fault::new();
        let mut solver = fault.solver(&fault.laws(|_| 1e7));
        let mut x = fault.load();
        assert_eq!(solver.solve_to(&fault.load(), &mut x, 0.0), Err(SolveError::NotFactored));
    }

    #[test]
    fn a_block_without_an_inverse_is_condensed_with_the_rest() {
        let fault = Fault::new();
        let laws = |k: u32| fault.laws(move |point| if point == k { 0.0 } else { 1e7 });
        let mut solver = fault.solver(&laws(fault.n_points));
        fault.check(&mut solver, &laws(fault.n_points));
        assert_eq!(solver.n_at_points(), 20);
        // that equation alone says where the body is
        fault.check(&mut solver, &laws(4));
        assert_eq!(solver.n_at_points(), 0);
        fault.check(&mut solver, &laws(fault.n_points));
    }

    #[test]
    fn a_memory_brings_back_the_same_bits() {
        let fault = Fault::new();
        let laws = |step: u32| fault.laws(move |point| -1e7 * f64::from(1 + point + step));
        let mut solver = fault.solver(&laws(0));
        fault.check(&mut solver, &laws(0));
        fault.check(&mut solver, &laws(1));
        let mut other = fault.solver(&laws(0));
        assert!(other.recall(&solver.memory()).unwrap());
        let (b, [mut x, mut y]) = (fault.load(), [(); 2].map(|()| vec![0.0; fault.bulk.n_rows()]));
        for (solver, x) in [(&mut solver, &mut x), (&mut other, &mut y)] {
            solver.update(&laws(2)).unwrap();
            solver.solve_to(&b, x, 0.0).unwrap();
        }
        assert_eq!(x, y);
    }
}
