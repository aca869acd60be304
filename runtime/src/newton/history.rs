//! What Newton did: every number that led to a decision.

use crate::{newton::Measured, newton::Watch, solve::SolveReport, system::System};

/// Why an iteration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The relative residual is below the tolerance.
    Tolerance,
    /// The residual is rounding error: no smaller one can be had.
    Floor,
    /// The most iterations allowed were not enough.
    MaxIterations,
    /// Nothing was solved: the state that a run with rates starts from.
    Given,
}

impl Stop {
    /// The word in reports.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Stop::Tolerance => "tolerance",
            Stop::Floor => "floor",
            Stop::MaxIterations => "maxit",
            Stop::Given => "given",
        }
    }
}

/// One iteration.
#[derive(Clone, Debug, PartialEq)]
pub struct Iteration {
    /// Its number; 0 is the start.
    pub number: usize,
    /// Relative residual after it.
    pub residual: f64,
    /// The rounding floor there.
    pub floor: f64,
    /// Part of the Newton step taken.
    pub step: f64,
    /// Points open, slipping, sticking; `None` without contact.
    pub contact: Option<[usize; 3]>,
    /// A number that changes when a point changes its branch.
    pub fingerprint: u64,
}

/// One load step.
#[derive(Clone, Debug, Default)]
pub struct StepHistory {
    /// The start and each iteration.
    pub iterations: Vec<Iteration>,
    /// Reports of the linear solver.
    pub solves: Vec<SolveReport>,
    /// Why it ended.
    pub stop: Option<Stop>,
    /// Where the time went.
    pub seconds: Seconds,
    /// The equations are singular where all unknowns are zero, so the step began from a state displaced a little.
    pub displaced: bool,
    /// How often the path that led to the state turned round ([`super`]): between kinks the load went down, so that there
    /// are several states for loads on the way.
    pub turns: usize,
    /// How many of the iterations went on from a residual that is rounding, and the size of the smallest correction of
    /// those, relative to the unknowns.
    pub refined: usize,
    /// See [`Self::refined`].
    pub correction: Option<f64>,
}

/// Seconds spent in the parts of an iteration.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seconds {
    /// Residuals and tangents.
    pub assemble: f64,
    /// Factorisations.
    pub factor: f64,
    /// Solutions.
    pub solve: f64,
}

impl StepHistory {
    /// The history of a state that is given.
    #[must_use]
    pub fn given() -> Self {
        Self { stop: Some(Stop::Given), ..Self::default() }
    }

    pub(super) fn push(&mut self, watch: &mut dyn Watch, number: usize, m: &Measured, step: f64, system: &System) {
        let (contact, fingerprint) = branches(system);
        let iteration = Iteration { number, residual: m.relative, floor: m.floor, step, contact, fingerprint };
        watch.iteration(&iteration);
        self.iterations.push(iteration);
    }

    /// True if the step is a solution.
    #[must_use]
    pub fn converged(&self) -> bool {
        matches!(self.stop, Some(Stop::Tolerance | Stop::Floor | Stop::Given))
    }

    /// Newton steps taken.
    #[must_use]
    pub fn n_iterations(&self) -> usize {
        self.iterations.len().saturating_sub(1)
    }

    /// Iterations after which the branches were those of two iterations before, with no smaller residual: a cycle.
    #[must_use]
    pub fn cycles(&self) -> usize {
        let cycle = |w: &[Iteration]| {
            w[0].fingerprint == w[2].fingerprint
                && w[1].fingerprint != w[2].fingerprint
                && w[2].residual > 0.5 * w[0].residual
        };
        self.iterations.windows(3).filter(|w| cycle(w)).count()
    }
}

/// Contact counts of the terms with kinks (the first of each region) and the fingerprint of all branches.
fn branches(system: &System) -> (Option<[usize; 3]>, u64) {
    let mut total: Option<[usize; 3]> = None;
    let mut fingerprint = 0;
    let mut seen: Vec<*const crate::assemble::Domain> = Vec::new();
    for term in &system.terms {
        fingerprint ^= term.branches().fingerprint.rotate_left(u32::try_from(seen.len() % 64).expect("below 64"));
        let domain = std::sync::Arc::as_ptr(&term.integrator.domain);
        if let Some(counts) = term.contact_counts()
            && !seen.contains(&domain)
        {
            seen.push(domain);
            let sum = total.get_or_insert([0; 3]);
            for (s, c) in sum.iter_mut().zip(counts) {
                *s += c;
            }
        }
    }
    (total, fingerprint)
}
