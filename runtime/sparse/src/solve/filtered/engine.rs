//! GMRES on the whole matrix, with a cycle of multigrid for the bodies and a direct solution on the unknowns of contact.
//!
//! The levels are made once, of the first matrix: of the constant part, and of the symmetric part of what contact adds to
//! it, so weak that it is no stiffer than the bodies wherever the sum is positive definite. Levels of the bodies alone know
//! no smooth motion that contact holds; how stiff contact is, and where it slides or opens later, is left to the filter.
//! Where an iteration is slow, or does not end, levels are made of the matrix at hand.
//!
//! Promises: the same bits for any number of threads, and for a run that goes on from what [`Engine::remembered`] says.
//! Does not check solutions and has no factor of the whole: who asks turns to one where no solution is found.

use std::sync::Arc;

use super::super::SolveError;
use super::super::library::{Engine, Equations};
use super::super::multigrid::{Cycle, NodeLayout};
use super::super::scaling::symmetric_scale;
use super::filter::Filter;
use super::gmres::{FlexibleGmres, Operators, norm_2};
use crate::csr::Csr;
use crate::index::NONE;

/// Most iterations of a solution; a factor costs less than more of them wherever it fits into the memory.
const MOST: usize = 300;
/// Iterations for a digit that new levels are worth.
const SLOW: f64 = 15.0;
/// A solution to fewer digits says little about the levels.
const TELLING: f64 = 1e-3;
/// Why there are no levels.
const INDEFINITE: &str = "no levels of multigrid: the bodies are not positive definite";

/// See the module documentation.
pub(super) struct FilteredEngine {
    equations: Arc<Equations>,
    /// The unknowns by nodes, without multipliers, which have no stiffness.
    layout: NodeLayout,
    levels: Option<Levels>,
    filter: Option<Filter>,
    gmres: FlexibleGmres,
    /// Diagonal of the constant part.
    diagonal: Vec<f64>,
    /// Of the equations of the matrix taken last: its norms are those of the checks.
    scale: Vec<f64>,
    /// New levels are due.
    is_slow: bool,
    counts: Counts,
}

/// The levels in use.
struct Levels {
    cycle: Cycle,
    /// Values of the changing part that they were made of.
    values: Vec<f64>,
    /// They are of the matrix that was taken last.
    are_new: bool,
}

/// What was done so far.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    iterations: usize,
    solutions: usize,
    levels: usize,
}

impl FilteredEngine {
    /// # Errors
    /// [`SolveError::Library`] where the unknowns cannot be told by nodes.
    pub(super) fn new(equations: &Arc<Equations>) -> Result<Self, SolveError> {
        let Some(layout) = &equations.layout else {
            let why = equations.traits.obstacle.clone().unwrap_or_default();
            return Err(SolveError::Library { text: format!("no multigrid: {why}") });
        };
        let (mut layout, all) = (layout.clone(), &layout.places);
        equations.multipliers.iter().for_each(|row| layout.places[*row as usize] = NONE);
        layout.check(&equations.constant)?;
        let filter = if equations.on_contact.is_empty() {
            None
        } else {
            let point = |row: &u32| layout.points[all[*row as usize] as usize / layout.components];
            let points: Vec<[f64; 3]> = equations.on_contact.iter().map(point).collect();
            Some(Filter::new(&equations.constant, &equations.changing, &equations.on_contact, &points)?)
        };
        Ok(Self {
            equations: Arc::clone(equations),
            layout,
            levels: None,
            filter,
            gmres: FlexibleGmres::default(),
            diagonal: (0..equations.n_rows()).map(|row| equations.constant.get(row, row)).collect(),
            scale: Vec::new(),
            is_slow: false,
            counts: Counts::default(),
        })
    }

    /// Makes the levels of a matrix.
    fn make_levels(&mut self, changing: &Csr) -> Result<(), SolveError> {
        // what was made before goes first
        self.levels = None;
        self.is_slow = false;
        let constant = &*self.equations.constant;
        let (mut contact, stiffness) = symmetric_part(constant, changing)?;
        let made = |parts: &[&Csr]| {
            let mut cycle = Cycle::new(parts, &self.layout)?;
            cycle.trust()?;
            Ok(cycle)
        };
        // so weak that it is no stiffer than the bodies; as it is, where it makes up for what a linear term on the faces
        // takes away (Nitsche's method); and none, where friction is far from symmetric
        contact.values_mut().iter_mut().for_each(|value| *value /= stiffness);
        let mut cycle = made(&[constant, &contact]);
        if is_indefinite(&cycle) && stiffness > 1.0 {
            contact.values_mut().iter_mut().for_each(|value| *value *= stiffness);
            cycle = made(&[constant, &contact]);
        }
        if is_indefinite(&cycle) {
            cycle = made(&[constant]);
        }
        let cycle = cycle.map_err(|error| match error {
            SolveError::NotPositiveDefinite { .. } => SolveError::Library { text: INDEFINITE.to_owned() },
            other => other,
        })?;
        self.levels = Some(Levels { cycle, values: changing.values().to_vec(), are_new: true });
        self.counts.levels += 1;
        Ok(())
    }

    /// One solution: iterations, and whether it ended.
    fn attempt(&mut self, changing: &Csr, rhs: &[f64], x: &mut [f64], tolerance: f64) -> Result<bool, SolveError> {
        let Some(levels) = &mut self.levels else { return Err(SolveError::NotFactored) };
        let b: Vec<f64> = rhs.iter().zip(&self.scale).map(|(b, scale)| b * scale).collect();
        let target = tolerance * norm_2(&b).sqrt();
        let mut operators = Preconditioned {
            parts: [&self.equations.constant, changing],
            scale: &self.scale,
            places: &self.layout.places,
            cycle: &mut levels.cycle,
            filter: self.filter.as_mut(),
            unscaled: vec![0.0; b.len()],
        };
        let outcome = self.gmres.solve(&mut operators, &b, x, target, MOST);
        self.counts.iterations += outcome.iterations;
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let for_a_digit = outcome.iterations as f64 / -tolerance.log10();
        self.is_slow |= tolerance <= TELLING && for_a_digit > SLOW;
        Ok(outcome.converged)
    }
}

fn is_indefinite(cycle: &Result<Cycle, SolveError>) -> bool {
    matches!(cycle, Err(SolveError::NotPositiveDefinite { .. }))
}

/// The symmetric part of what changes, and by how much its diagonal is larger than that of the constant part, at least 1.
fn symmetric_part(constant: &Csr, changing: &Csr) -> Result<(Csr, f64), SolveError> {
    let mut part = changing.plus(&changing.transpose())?;
    part.values_mut().iter_mut().for_each(|value| *value *= 0.5);
    let ratio = |row: usize| {
        let (own, added) = (constant.get(row, row), part.get(row, row));
        if own > 0.0 { added / own } else { 0.0 }
    };
    let stiffness = (0..part.n_rows()).map(ratio).fold(1.0, f64::max);
    Ok((part, stiffness))
}

/// The scaled matrix and its preconditioner.
struct Preconditioned<'a> {
    parts: [&'a Csr; 2],
    scale: &'a [f64],
    places: &'a [u32],
    cycle: &'a mut Cycle,
    filter: Option<&'a mut Filter>,
    unscaled: Vec<f64>,
}

impl Operators for Preconditioned<'_> {
    fn multiply(&mut self, x: &[f64], y: &mut [f64]) {
        let [constant, changing] = self.parts;
        let threads = rayon::current_num_threads();
        constant.multiply(x, y, threads);
        changing.multiply_add(x, y, threads);
        y.iter_mut().zip(self.scale).for_each(|(y, scale)| *y *= scale);
    }

    fn precondition(&mut self, r: &[f64], z: &mut [f64]) {
        self.unscaled.iter_mut().zip(r).zip(self.scale).for_each(|((out, r), scale)| *out = r / scale);
        self.cycle.apply(self.places, &self.unscaled, z);
        if let Some(filter) = &mut self.filter {
            filter.apply(self.parts, &self.unscaled, z);
        }
    }
}

impl Engine for FilteredEngine {
    fn take(&mut self, changing: &Csr) -> Result<(), SolveError> {
        let constant = &*self.equations.constant;
        let diagonal: Vec<f64> =
            self.diagonal.iter().enumerate().map(|(row, own)| own + changing.get(row, row)).collect();
        self.scale = symmetric_scale(&[constant, changing], &diagonal, None);
        if let Some(filter) = &mut self.filter {
            filter.take(changing)?;
        }
        if let Some(levels) = &mut self.levels {
            levels.are_new = false;
        }
        if self.levels.is_none() || self.is_slow { self.make_levels(changing) } else { Ok(()) }
    }

    fn solve(&mut self, changing: &Csr, rhs: &[f64], x: &mut [f64], tolerance: f64) -> Result<usize, SolveError> {
        let before = self.counts.iterations;
        self.counts.solutions += 1;
        if self.attempt(changing, rhs, x, tolerance)? {
            return Ok(self.counts.iterations - before);
        }
        if self.levels.as_ref().is_some_and(|levels| !levels.are_new) {
            self.make_levels(changing)?;
            if self.attempt(changing, rhs, x, tolerance)? {
                return Ok(self.counts.iterations - before);
            }
        }
        let iterations = self.counts.iterations - before;
        Err(SolveError::Library { text: format!("no solution to {tolerance:.1e} in {iterations} iterations of GMRES") })
    }

    fn restart(&mut self) {
        self.is_slow = false;
    }

    fn remembered(&self) -> &[f64] {
        self.levels.as_ref().map_or(&[], |levels| &levels.values)
    }

    fn recall(&mut self, changing: &Csr) -> Result<(), SolveError> {
        if self.remembered() == changing.values() {
            return Ok(());
        }
        self.make_levels(changing)?;
        if let Some(levels) = &mut self.levels {
            levels.are_new = false;
        }
        self.counts.levels -= 1;
        Ok(())
    }

    fn describe(&self) -> String {
        let mut text = super::in_words(&self.equations.traits);
        let Counts { iterations, solutions, levels } = self.counts;
        if let Some(made) = &self.levels {
            let sizes: Vec<String> = made.cycle.sizes().iter().map(ToString::to_string).collect();
            text.push_str(&format!(" (unknowns by level: {})", sizes.join(", ")));
        }
        if solutions > 0 {
            let times = if levels == 1 { "once".to_owned() } else { format!("{levels} times") };
            text.push_str(&format!("; {iterations} iterations in {solutions} solutions, levels made {times}"));
        }
        text
    }
}
