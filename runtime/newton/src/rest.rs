//! The state of rest, which a load that goes back to nothing leads to.
//!
//! Where loads are exactly zero and nothing is prescribed, the solution often is zero. A correction leaves of the state before
//! what rounding is beside that, and no iteration on such numbers ends: all branches of contact are ties there, relative
//! residuals compare rounding with rounding, and each iteration makes both smaller. Promises: nothing that acts, however small
//! it is, is taken for nothing; scenes all of whose bodies are loaded pay nothing. Decides nothing: whether rest solves the
//! equations its residual says.

use wfl_discrete::system::{FIXED, System};

use crate::load_step::LoadStep;

/// Part of the unknowns that an attempt began with, below which they may be nothing: what one correction leaves of them where
/// they have all but vanished, the root of roundoff. A state that is meant is not lost by it, since rest must solve the
/// equations exactly.
const VANISHED: f64 = 1.5e-8;

/// A state with some of its bodies at rest.
pub(super) struct Rest {
    pub(super) state: Vec<f64>,
    /// By body whether it is one of them.
    bodies: Vec<bool>,
}

impl Rest {
    /// Of the bodies that no loads act on and that have vanished beside `largest`, their largest unknowns by body when the
    /// attempt began, or infinity for any that may be at rest; `None` where there are none, or multipliers alone: these vanish where contact opens.
    pub(super) fn of(step: &LoadStep<'_>, u: &[f64], largest: &[f64]) -> Option<Self> {
        let system = step.system;
        let loaded = system.loaded();
        let is_solved = |body: usize| system.range(system.field_of_body(body)).is_some();
        if !step.offset.is_empty() || system.unknown_bodies().all(|body| loaded[body]) {
            return None;
        }
        let now = system.largest_of_alike(u);
        let has_vanished =
            |body: usize| is_solved(body) && !loaded[body] && 0.0 < now[body] && now[body] <= VANISHED * largest[body];
        let bodies: Vec<bool> = (0..loaded.len()).map(has_vanished).collect();
        if !system.unknown_bodies().any(|body| bodies[body]) {
            return None;
        }
        let numbering = &system.numbering;
        let mut state = u.to_vec();
        numbering.frames.turn(&mut state);
        for_each_free(system, &bodies, |dof| state[dof] = 0.0);
        numbering.frames.turn_back(&mut state);
        numbering.follow(&mut state);
        Some(Self { state, bodies })
    }

    /// Whether a residual by dof is exactly zero in the equations of these bodies, on all ranks.
    pub(super) fn solves(&self, system: &System, residual: &[f64]) -> bool {
        let mut open = false;
        for_each_free(system, &self.bodies, |dof| open |= residual[dof] != 0.0);
        !system.team().any(open)
    }
}

fn for_each_free(system: &System, bodies: &[bool], mut then: impl FnMut(usize)) {
    for body in (0..bodies.len()).filter(|body| bodies[*body]) {
        system.dofs_of_body(body).filter(|dof| system.numbering.free[*dof] != FIXED).for_each(&mut then);
    }
}
