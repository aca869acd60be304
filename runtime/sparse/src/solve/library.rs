//! Solvers of a library that is linked in place of our own, wrapped as every solver is: with the true residual.
//!
//! A [`Library`] makes an [`Engine`] for the equations of one scene; [`CheckedLibrary`] puts the checks around it.
//! Promises: what comes back as a solution has a backward error below the limit, measured with the matrix itself; a
//! matrix that is singular is told apart from one that an iteration does not get to its end with, where it is small enough
//! for a factor of our own. Knows no library: that is a crate of its own.

use std::sync::Arc;

use super::backward_error::{BackwardErrorCheck, inverse_norm_estimate};
use super::checked::explain_singular;
use super::multigrid::NodeLayout;
use super::on_pattern::OnPattern;
use super::row_owners::RowOwners;
use super::singularity::Found;
use super::symmetry::{Symmetry, check_own_symmetry, check_symmetry};
use super::triangular_solve::Transpose;
use super::{Kept, LinearSolver, SolveError, SolveReport, SolverOptions};
use crate::csr::{Csr, Pattern};

/// 2-norm of what a correction by refinement may leave of its right-hand side: a few iterations of it are worth more than
/// many.
const ROUGH: f64 = 1e-3;
/// Part of the tolerance that the engine is given: it measures unscaled equations, the check scaled ones.
const OF_THE_TOLERANCE: f64 = 0.3;
/// Tightest and loosest 2-norm of the residual, relative to the right-hand side, that an iteration is asked for: rounding
/// of the recursion shows below the one, and nothing is saved above the other.
const TIGHTEST: f64 = 1e-12;
const LOOSEST: f64 = 1e-3;
/// Unknowns up to which a factor of our own explains a failure; it takes a few seconds there.
const EXPLAINED: usize = 50_000;

/// What the choice of a method depends on.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Traits {
    /// Number of unknowns, of all ranks.
    pub unknowns: usize,
    /// Dimensions of space.
    pub dimension: usize,
    /// There is one matrix.
    pub is_linear: bool,
    /// Every matrix is symmetric.
    pub is_symmetric: bool,
    /// Unknowns that nonlinear terms on faces and multipliers touch, of all ranks.
    pub on_contact: usize,
    /// Unknowns that are multipliers, of all ranks.
    pub multipliers: usize,
    /// Why the unknowns cannot be told node by node; `None` if they can.
    pub obstacle: Option<String>,
}

/// The equations of a scene as a library is told of them.
#[derive(Debug, Clone)]
pub struct Equations {
    /// What is known of them.
    pub traits: Traits,
    /// The part that all matrices have in common.
    pub constant: Arc<Csr>,
    /// Where the other part has its entries: few in scenes with contact.
    pub changing: Arc<Pattern>,
    /// The unknowns by nodes, multipliers included; `None` where [`Traits::obstacle`] says why.
    pub layout: Option<NodeLayout>,
    /// Rows of multipliers, increasing: without a stiffness of their own.
    pub multipliers: Vec<u32>,
    /// Rows that nonlinear terms on faces and multipliers touch, those of multipliers included, increasing.
    pub on_contact: Vec<u32>,
    /// Where several ranks solve: which rows each of them has. Matrices have the rows of their rank, patterns too; solutions
    /// have copies of the unknowns of other ranks.
    pub owners: Option<RowOwners>,
}

/// A library of solvers.
pub trait Library: Sync {
    /// Its name, as it is written in commands and messages.
    fn name(&self) -> &'static str;

    /// The method that equations get, in words.
    fn plan(&self, traits: &Traits) -> String;

    /// Makes a solver.
    ///
    /// # Errors
    /// [`SolveError`] of what the library refuses.
    fn engine(&self, equations: &Arc<Equations>, symmetry: Symmetry) -> Result<Box<dyn Engine + Send>, SolveError>;
}

impl Equations {
    /// Number of rows.
    #[must_use]
    pub fn n_rows(&self) -> usize {
        self.constant.n_rows()
    }
}

/// A solver of a library. Its solutions are not checked yet. A matrix is told by the part that it adds to the constant one.
pub trait Engine {
    /// Takes the next matrix.
    ///
    /// # Errors
    /// [`SolveError`] of a factor that cannot be made.
    fn take(&mut self, changing: &Csr) -> Result<(), SolveError>;

    /// Solves `A x = rhs`, `A` the matrix taken last, until the 2-norm of the residual is `tolerance` of that of `rhs`; a
    /// factor may do better. The number of iterations is returned.
    ///
    /// # Errors
    /// [`SolveError`] where no method of the library gets there.
    fn solve(&mut self, changing: &Csr, rhs: &[f64], x: &mut [f64], tolerance: f64) -> Result<usize, SolveError>;

    /// Forgets what was learned of earlier matrices, so that what follows depends on later ones alone.
    fn restart(&mut self);

    /// The method in words.
    fn describe(&self) -> String;
}

/// A library as an option of a run; two are equal if they have one name.
#[derive(Clone, Copy)]
pub struct Linked(pub &'static dyn Library);

impl std::fmt::Debug for Linked {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.0.name())
    }
}

impl PartialEq for Linked {
    fn eq(&self, other: &Self) -> bool {
        self.0.name() == other.0.name()
    }
}

/// A solver of a library with its solutions checked. It is given the part of a matrix that changes; the constant part is
/// shared, not copied.
pub struct CheckedLibrary {
    engine: Box<dyn Engine + Send>,
    check: BackwardErrorCheck,
    constant: Arc<Csr>,
    changing: OnPattern,
    points: Vec<[f64; 3]>,
    is_symmetric: bool,
    is_loaded: bool,
}

impl CheckedLibrary {
    /// Prepares for the matrices of a scene; `points` is one for each unknown.
    ///
    /// # Errors
    /// As [`Library::engine`].
    pub fn new(
        library: Linked,
        equations: &Arc<Equations>,
        symmetry: Symmetry,
        points: &[[f64; 3]],
        options: SolverOptions,
    ) -> Result<Self, SolveError> {
        let mut check = BackwardErrorCheck::new(equations.n_rows(), options).on(equations.owners.clone());
        check.set_constant_part(&equations.constant);
        Ok(Self {
            engine: library.0.engine(equations, symmetry)?,
            check,
            constant: Arc::clone(&equations.constant),
            changing: OnPattern::new(&equations.changing),
            points: points.to_vec(),
            is_symmetric: symmetry == Symmetry::Symmetric,
            is_loaded: false,
        })
    }

    /// The class of a failure.
    fn explained(&mut self, error: SolveError) -> SolveError {
        let may_be_singular = matches!(
            error,
            SolveError::VanishingPivot { .. } | SolveError::ResidualTooLarge { .. } | SolveError::Library { .. }
        );
        let is_known = self.check.owners().is_none_or(RowOwners::are_whole);
        if !may_be_singular || !is_known || self.constant.n_rows() > EXPLAINED {
            return error;
        }
        let Ok(matrix) = self.constant.plus(&self.changing.matrix) else { return error };
        let matrix = self.check.whole(&matrix).unwrap_or(matrix);
        explain_singular(&mut self.check, &matrix, Some(&self.points), error)
    }

    /// Solves and refines; the number of iterations stands in the report.
    fn solve_to(&mut self, rhs: &[f64], x: &mut [f64], tolerance: f64) -> Result<SolveReport, SolveError> {
        if !self.is_loaded {
            return Err(SolveError::NotFactored);
        }
        self.check.check_rhs(rhs, x)?;
        let (engine, changing) = (&mut self.engine, &self.changing.matrix);
        let (mut iterations, mut failure) = (0, None);
        let mut wanted = (OF_THE_TOLERANCE * tolerance).clamp(TIGHTEST, LOOSEST);
        let mut solver = |x: &mut [f64]| {
            let b = x.to_vec();
            match engine.solve(changing, &b, x, wanted) {
                Ok(n) => iterations += n,
                Err(error) => {
                    // not a number: the check refuses it
                    x.fill(f64::NAN);
                    failure = Some(error);
                }
            }
            // what follows is a correction
            wanted = ROUGH;
        };
        let outcome = self.check.solve(&[&self.constant, changing], &mut solver, rhs, x, tolerance);
        match outcome {
            Ok(report) => {
                if self.check.has_grown(rhs, x) {
                    self.look_for_null_vector()?;
                }
                Ok(SolveReport { krylov_iterations: iterations, ..report })
            }
            Err(error) => Err(self.explained(failure.unwrap_or(error))),
        }
    }

    /// The error for a matrix that is singular although it was solved with.
    fn look_for_null_vector(&mut self) -> Result<(), SolveError> {
        let (engine, changing) = (&mut self.engine, &self.changing.matrix);
        let is_symmetric = self.is_symmetric;
        let mut solver = |transpose, x: &mut [f64]| {
            let b = x.to_vec();
            let is_known = is_symmetric || transpose == Transpose::No;
            if !is_known || engine.solve(changing, &b, x, ROUGH).is_err() {
                x.fill(f64::NAN);
            }
        };
        match self.check.find_null_vector(&[&self.constant, changing], &mut solver) {
            Found::Singular(error) => Err(error),
            _ => Ok(()),
        }
    }
}

impl LinearSolver for CheckedLibrary {
    fn factor(&mut self, matrix: &Csr) -> Result<(), SolveError> {
        self.is_loaded = false;
        self.changing.take(matrix)?;
        self.check.set_matrix(&[&self.constant, &self.changing.matrix])?;
        if self.is_symmetric {
            // the sum is what its terms promise to be symmetric, and each of them is
            for part in [&*self.constant, &self.changing.matrix] {
                match self.check.owners() {
                    Some(owners) => check_own_symmetry(part, owners)?,
                    None => check_symmetry(part)?,
                }
            }
        }
        // a rank may have no rows of a matrix
        let nothing = matrix.n_rows() == 0;
        let nothing = self.check.owners().map_or(nothing, |owners| owners.team.all(nothing));
        let taken = if nothing { Ok(()) } else { self.engine.take(&self.changing.matrix) };
        match taken {
            Ok(()) => {
                self.is_loaded = true;
                Ok(())
            }
            Err(error) => Err(self.explained(error)),
        }
    }

    fn solve(&mut self, rhs: &[f64], x: &mut [f64]) -> Result<SolveReport, SolveError> {
        self.solve_to(rhs, x, 0.0)
    }

    fn expire(&mut self) {
        self.engine.restart();
    }

    fn solve_with_kept(&mut self, rhs: &[f64], x: &mut [f64], tolerance: f64) -> Result<Kept<'_>, SolveError> {
        self.solve_to(rhs, x, tolerance).map(Kept::Solved)
    }

    fn condition_estimate(&mut self) -> Result<f64, SolveError> {
        if !self.is_loaded {
            return Err(SolveError::NotFactored);
        }
        if !self.is_symmetric || self.check.owners().is_some() {
            let text = "no solutions with the transposed of a matrix, nor columns of those of several ranks".to_owned();
            return Err(SolveError::Library { text });
        }
        let (engine, changing) = (&mut self.engine, &self.changing.matrix);
        let mut failure = None;
        let mut solver = |_, x: &mut [f64]| {
            let b = x.to_vec();
            failure = engine.solve(changing, &b, x, ROUGH).err().or_else(|| failure.take());
        };
        let inverse = inverse_norm_estimate(self.constant.n_rows(), &mut solver);
        // the largest sum of a column is that of a row: the matrix is symmetric
        failure.map_or(Ok(inverse * self.check.norm()), Err)
    }

    fn is_negative(&self) -> Option<bool> {
        None
    }

    fn describe(&self) -> Option<String> {
        Some(self.engine.describe())
    }
}
