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
use super::gmres::{FlexibleGmres, Outcome};
use super::preconditioner::{Goal, Sum, cycle_and_filter, solve};
use crate::csr::Csr;
use crate::index::NONE;

/// Most iterations of a solution; a factor costs less than more of them wherever it fits into the memory.
pub(super) const MOST: usize = 300;
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
        let room = Csr::zeros(Arc::clone(&equations.changing));
        let filter = if equations.on_contact.is_empty() {
            None
        } else {
            let point = |row: &u32| layout.points[all[*row as usize] as usize / layout.components];
            let points: Vec<[f64; 3]> = equations.on_contact.iter().map(point).collect();
            Some(Filter::new(&equations.constant, &room, &equations.on_contact, &points)?)
        };
        let cycle = Cycle::with_room(&[&equations.constant], &room, &layout).map_err(|error| match error {
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
        })
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
        let parts = [&*self.equations.constant, changing];
        let (places, cycle, filter) = (&self.layout.places, &mut self.cycle, &mut self.filter);
        let mut precondition =
            |r: &[f64], z: &mut [f64]| cycle_and_filter(cycle, places, filter.as_mut(), &parts, r, z);
        let sum = Sum { parts: &parts, scale: &self.scale };
        let goal = Goal { left: tolerance, most: MOST };
        let Outcome { iterations, converged } = solve(&mut self.gmres, sum, &mut precondition, rhs, x, goal);
        if converged {
            return Ok(iterations);
        }
        Err(SolveError::Library { text: format!("no solution to {tolerance:.1e} in {iterations} iterations of GMRES") })
    }

    fn restart(&mut self) {}

    fn describe(&self) -> String {
        let mut text = super::in_words(&self.equations.traits);
        let sizes: Vec<String> = self.cycle.sizes().iter().map(ToString::to_string).collect();
        text.push_str(&format!(" (unknowns by level: {})", sizes.join(", ")));
        text
    }
}
