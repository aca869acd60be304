//! Whole tangents of bodies that are not linear, with contact: GMRES with multigrid of the bodies and a filter on the contact.
//!
//! What [`super::engine`] does with bodies that stay as they are. Levels are made of a tangent without the part of the terms on
//! faces, and serve later ones for as long as new levels would cost more than is lost with them; the part of the terms on faces is
//! that of the tangent at hand on all levels, and so is the factor of the filter.
//!
//! Promises: what comes back as a solution has a backward error below the limit, measured with the matrix itself; the same bits
//! for any number of threads. Where there are no levels, or no solution, who asks turns to a factor.

use std::sync::Arc;

use super::super::backward_error::BackwardErrorCheck;
use super::super::multigrid::{Cycle, NodeLayout, Wear};
use super::super::{SolveError, SolveReport, SolverOptions};
use super::engine::MOST;
use super::filter::Filter;
use super::gmres::FlexibleGmres;
use super::preconditioner::{Goal, cycle_and_filter, solve_checked};
use crate::csr::{Csr, Pattern};
use crate::index::NONE;

/// Most iterations with the levels of an earlier matrix: new ones, which cost some ten iterations, do better then.
const MOST_OF_KEPT: usize = 80;
/// What is told of the unknowns.
#[derive(Debug, Clone)]
pub struct OnContact {
    /// The unknowns by nodes, multipliers included.
    pub layout: NodeLayout,
    /// Rows of multipliers, increasing: without a stiffness of their own.
    pub multipliers: Vec<u32>,
    /// Rows that terms on faces and multipliers touch, those of multipliers included, increasing.
    pub rows: Vec<u32>,
    /// Those of them that are touched at some states alone, where the part of the terms on faces has entries in them.
    pub at_times: Vec<u32>,
}

/// Solver for whole tangents whose bodies are symmetric and positive definite, and whose contact need not be.
pub struct CheckedContact {
    layout: NodeLayout,
    rows: Vec<OnFace>,
    check: BackwardErrorCheck,
    loaded: Option<Loaded>,
    gmres: FlexibleGmres,
    wear: Wear,
}

/// A row that terms on faces may touch.
struct OnFace {
    row: u32,
    point: [f64; 3],
    /// Where the part of the terms on faces has entries in it alone.
    at_times: bool,
}

/// A matrix with its levels and the factor of its filter.
struct Loaded {
    matrix: Arc<Csr>,
    cycle: Cycle,
    filter: Option<Filter>,
    /// Where the part of terms on faces has entries, which levels have room for.
    room: Arc<Pattern>,
    /// The levels are those of an earlier matrix.
    is_kept: bool,
}

impl CheckedContact {
    /// Prepares for tangents; the levels are made with the first one.
    #[must_use]
    pub fn new(of: OnContact, options: SolverOptions) -> Self {
        let OnContact { mut layout, multipliers, rows, at_times } = of;
        let of = |row: u32| OnFace {
            row,
            point: layout.points[layout.places[row as usize] as usize / layout.components],
            at_times: at_times.binary_search(&row).is_ok(),
        };
        let rows = rows.into_iter().map(of).collect();
        multipliers.iter().for_each(|row| layout.places[*row as usize] = NONE);
        let check = BackwardErrorCheck::new(layout.places.len(), options);
        Self { layout, rows, check, loaded: None, gmres: FlexibleGmres::default(), wear: Wear::default() }
    }

    /// Number of unknowns by level, the finest first; empty without a matrix.
    #[must_use]
    pub fn level_sizes(&self) -> &[usize] {
        self.loaded.as_ref().map_or(&[], |loaded| loaded.cycle.sizes())
    }

    /// Number of unknowns in the direct solution; those that may be in it without a matrix.
    #[must_use]
    pub fn n_on_contact(&self) -> usize {
        self.loaded.as_ref().map_or(self.rows.len(), |loaded| loaded.filter.as_ref().map_or(0, Filter::n_rows))
    }

    /// Takes a matrix, of which `on_faces` is the part of terms on faces, and makes levels of its own for it.
    ///
    /// # Errors
    /// [`SolveError::NotPositiveDefinite`] where the bodies are not, [`SolveError::TooMuchMemory`], or what stands against a factor of
    /// the filter.
    pub fn take(&mut self, matrix: &Arc<Csr>, on_faces: &Csr) -> Result<(), SolveError> {
        (self.loaded, self.wear) = (None, Wear::default());
        self.layout.check(matrix)?;
        self.check.set_matrix(&[matrix])?;
        let mut taken = on_faces.clone();
        taken.values_mut().iter_mut().for_each(|value| *value = -*value);
        let mut cycle = Cycle::with_room(&[matrix, &taken], on_faces, &self.layout)?;
        cycle.take(on_faces, &self.layout)?;
        let nothing = Csr::zeros(Arc::new(Pattern::empty(matrix.n_rows(), matrix.n_cols())));
        let is_touched = |of: &&OnFace| !of.at_times || !on_faces.row(of.row as usize).0.is_empty();
        let (rows, points): (Vec<_>, Vec<_>) = self.rows.iter().filter(is_touched).map(|of| (of.row, of.point)).unzip();
        let filter = match rows.is_empty() {
            true => None,
            false => {
                let mut made = Filter::new(&nothing, matrix, &rows, &points)?;
                made.take(matrix)?;
                Some(made)
            }
        };
        let room = Arc::clone(on_faces.pattern());
        self.loaded = Some(Loaded { matrix: Arc::clone(matrix), cycle, filter, room, is_kept: false });
        Ok(())
    }

    /// Takes a matrix and keeps the groups and the bodies of the levels of an earlier one, as long as new ones would cost more than is
    /// lost with these; false where it needs levels of its own.
    ///
    /// # Errors
    /// As [`Self::take`].
    pub fn keep_levels(&mut self, matrix: &Arc<Csr>, on_faces: &Csr) -> Result<bool, SolveError> {
        if self.wear.is_over() {
            return Ok(false);
        }
        let has_room = |loaded: &&mut Loaded| {
            Arc::ptr_eq(&loaded.room, on_faces.pattern()) || *loaded.room == **on_faces.pattern()
        };
        let Some(loaded) = self.loaded.as_mut().filter(has_room) else { return Ok(false) };
        self.check.set_matrix(&[matrix])?;
        loaded.cycle.take(on_faces, &self.layout)?;
        if let Some(filter) = &mut loaded.filter {
            filter.take(matrix)?;
        }
        (loaded.matrix, loaded.is_kept) = (Arc::clone(matrix), true);
        Ok(true)
    }

    /// The next matrix gets levels of its own.
    pub fn expire(&mut self) {
        self.wear.expire();
    }

    /// Whether the levels in use are those of an earlier matrix.
    #[must_use]
    pub fn has_kept_levels(&self) -> bool {
        self.loaded.as_ref().is_some_and(|loaded| loaded.is_kept)
    }

    /// Solves `A x = rhs` with the matrix taken last until `left` of the right-hand side is left (2-norms of scaled equations).
    ///
    /// # Errors
    /// [`SolveError::TooManyIterations`] or [`SolveError::ResidualTooLarge`] where a factor is needed, also where the solution is so
    /// large that the matrix may be singular; those about the right-hand side.
    pub fn solve_until(&mut self, rhs: &[f64], x: &mut [f64], left: f64) -> Result<SolveReport, SolveError> {
        let Some(loaded) = &mut self.loaded else { return Err(SolveError::NotFactored) };
        let Loaded { matrix, cycle, filter, is_kept, .. } = loaded;
        let (most, parts, places) = (if *is_kept { MOST_OF_KEPT } else { MOST }, [&**matrix], &self.layout.places);
        let mut precondition =
            |r: &[f64], z: &mut [f64]| cycle_and_filter(cycle, places, filter.as_mut(), &parts, r, z);
        let (gmres, check) = (&mut self.gmres, &mut self.check);
        let solved = solve_checked(gmres, check, matrix, &mut precondition, rhs, x, Goal { left, most })?;
        let (iterations, wanted) = solved.first;
        self.wear.hear(iterations, wanted);
        Ok(solved.report)
    }
}
