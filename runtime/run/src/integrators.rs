//! Which way a step is made, and what the ways remember from step to step. Makes none.

use wfl_problem::{Scene, Solving};

use super::{
    beginning::Beginning, explicit::CentralDifferences, parts::Listed, remembered::Adaptive, requests::StepRequest,
    stepping::Integrator,
};

/// The ways that a run of a scene makes steps.
pub(super) struct Integrators {
    beginning: Beginning,
    /// Of a scene with explicit steps.
    pub(super) explicit: Option<CentralDifferences>,
    /// Of a scene whose steps the run chooses.
    pub(super) adaptive: Option<Adaptive>,
    pub(super) listed: Listed,
}

impl Integrators {
    /// Before the first step.
    pub(super) fn new(scene: &Scene) -> Self {
        Self {
            beginning: Beginning,
            explicit: scene.explicit.as_ref().map(|_| CentralDifferences::default()),
            adaptive: scene.steps.auto.as_ref().map(Adaptive::new),
            listed: Listed::default(),
        }
    }

    /// The one that makes a step.
    pub(super) fn of(&mut self, scene: &Scene, request: &StepRequest) -> &mut dyn Integrator {
        let is_start = request.number == 0 && scene.steps.from_start;
        match self {
            Self { beginning, .. } if is_start => beginning,
            Self { explicit: Some(explicit), .. } => explicit,
            // the first step is listed: no increment leads to it
            Self { adaptive: Some(adaptive), .. } if request.is_chosen() => adaptive,
            Self { listed, .. } => listed,
        }
    }

    /// Takes the end of a step, with its states, as what later ones are expected from.
    pub(super) fn remember(&mut self, scene: &Solving<'_>, increment: f64, u: &[f64]) {
        // explicit steps follow a limit of the mesh, and their error is not judged
        if let Some(adaptive) = self.adaptive.as_mut().filter(|_| self.explicit.is_none()) {
            adaptive.add(scene, increment, u);
        }
    }
}
