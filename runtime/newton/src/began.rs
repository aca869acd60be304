//! What was left when a step began: what it does is measured by that, and not by what the bodies store.
//!
//! Forces of inertia and of stored heat cancel with those of the past, loads with springs at far positions: beside them what a step does may be
//! less than a tolerance. Promises: nothing is asked beyond the tolerance of a step that does much. Decides nothing.

/// What was left when a step began.
#[derive(Clone, Default)]
pub(super) struct Began {
    /// Of single equations, by dof.
    equations: Equations,
    /// By body the largest of the forces that were out of balance in the attempt so far; empty where nobody knows.
    forces: Vec<f64>,
    /// The state that is measured is the first one.
    is_first: bool,
}

/// What was left of single equations.
#[derive(Clone, Default)]
enum Equations {
    /// Nobody knows, or there are none.
    #[default]
    Unknown,
    /// What the state that is measured leaves: it is the first one.
    Here,
    /// This residual by dof.
    With(Vec<f64>),
}

impl Began {
    /// Of the first state, which is measured now; whether there are single equations, and whether what forces began with counts.
    pub(super) fn here(has_single_equations: bool, forces_count: bool) -> Self {
        let equations = if has_single_equations { Equations::Here } else { Equations::Unknown };
        Self { equations, forces: Vec::new(), is_first: forces_count }
    }

    /// Behind the first state, of which the residual by dof is given where single equations have one, and what was left by body.
    pub(super) fn with(residual: Option<Vec<f64>>, left: Vec<f64>) -> Self {
        let equations = residual.map_or(Equations::Unknown, Equations::With);
        Self { equations, forces: left, is_first: false }
    }

    /// Another state of the attempt leaves so much by body: what couples bodies brings forces out of balance on the way.
    pub(super) fn meets(&mut self, left: &[f64]) {
        self.forces.iter_mut().zip(left).for_each(|(most, now)| *most = most.max(*now));
    }

    /// By dof of single equations, where `here` is the residual of the state that is measured; empty where nobody knows.
    pub(super) fn residual<'r>(&'r self, here: &'r [f64]) -> &'r [f64] {
        match &self.equations {
            Equations::Unknown => &[],
            Equations::Here => here,
            Equations::With(residual) => residual,
        }
    }

    /// The largest of the forces of a body that were out of balance, where `here` is what the state that is measured leaves.
    pub(super) fn forces(&self, body: usize, here: f64) -> f64 {
        let unknown = if self.is_first { here } else { f64::INFINITY };
        self.forces.get(body).map_or(unknown, |most| most.max(here))
    }
}
