//! GMRES on the whole matrix, with a cycle of multigrid and a direct solution on the unknowns of contact.
//!
//! Groups of unknowns, and how coarser levels move them, are made once, of the bodies alone: no group joins bodies that contact
//! holds together now and lets slide or open later. Each tangent of contact, as it is, is carried down to all levels, so that
//! they know the smooth motions that contact holds, lets slide with friction, and lets go; levels of an earlier tangent, or of
//! its symmetric part, take three times as many iterations where contact slides. What is stiff from node to node
//! is left to the filter.
//!
//! Promises: the same bits for any number of threads; solutions depend on no earlier matrix. Does not check solutions and has no
//! factor of the whole: who asks turns to one where no solution is found.

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
/// Why there are no levels.
const INDEFINITE: &str = "no levels of multigrid: the bodies are not positive definite";

/// See the module documentation.
pub(super) struct FilteredEngine {
    equations: Arc<Equations>,
    /// The unknowns by nodes, without multipliers, which have no stiffness.
    layout: NodeLayout,
    cycle: Cycle,
    filter: Option<Filter>,
    gmres: FlexibleGmres,
    /// Diagonal of the constant part.
    diagonal: Vec<f64>,
    /// Of the equations of the matrix taken last: its norms are those of the checks.
    scale: Vec<f64>,
    counts: Counts,
}

/// What was done so far.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    iterations: usize,
    solutions: usize,
}

impl FilteredEngine {
    /// # Errors
    /// [`SolveError::Library`] where the unknowns cannot be told by nodes, or the bodies are not positive definite.
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
        let room = Csr::zeros(Arc::clone(&equations.changing));
        let cycle = Cycle::with_room(&equations.constant, &room, &layout).map_err(|error| match error {
            SolveError::NotPositiveDefinite { .. } => SolveError::Library { text: INDEFINITE.to_owned() },
            other => other,
        })?;
        Ok(Self {
            equations: Arc::clone(equations),
            layout,
            cycle,
            filter,
            gmres: FlexibleGmres::default(),
            diagonal: (0..equations.n_rows()).map(|row| equations.constant.get(row, row)).collect(),
            scale: Vec::new(),
            counts: Counts::default(),
        })
    }

    /// One solution: iterations, and whether it ended.
    fn attempt(&mut self, changing: &Csr, rhs: &[f64], x: &mut [f64], tolerance: f64) -> bool {
        let b: Vec<f64> = rhs.iter().zip(&self.scale).map(|(b, scale)| b * scale).collect();
        let target = tolerance * norm_2(&b).sqrt();
        let mut operators = Preconditioned {
            parts: [&self.equations.constant, changing],
            scale: &self.scale,
            places: &self.layout.places,
            cycle: &mut self.cycle,
            filter: self.filter.as_mut(),
            unscaled: vec![0.0; b.len()],
        };
        let outcome = self.gmres.solve(&mut operators, &b, x, target, MOST);
        self.counts.iterations += outcome.iterations;
        outcome.converged
    }
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
        self.cycle.take(changing, &self.layout)
    }

    fn solve(&mut self, changing: &Csr, rhs: &[f64], x: &mut [f64], tolerance: f64) -> Result<usize, SolveError> {
        let before = self.counts.iterations;
        self.counts.solutions += 1;
        let is_solved = self.attempt(changing, rhs, x, tolerance);
        let iterations = self.counts.iterations - before;
        if is_solved {
            return Ok(iterations);
        }
        Err(SolveError::Library { text: format!("no solution to {tolerance:.1e} in {iterations} iterations of GMRES") })
    }

    fn restart(&mut self) {}

    fn describe(&self) -> String {
        let mut text = super::in_words(&self.equations.traits);
        let Counts { iterations, solutions } = self.counts;
        let sizes: Vec<String> = self.cycle.sizes().iter().map(ToString::to_string).collect();
        text.push_str(&format!(" (unknowns by level: {})", sizes.join(", ")));
        if solutions > 0 {
            text.push_str(&format!("; {iterations} iterations in {solutions} solutions"));
        }
        text
    }
}
