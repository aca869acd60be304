//! The state of rest, which a load that goes back to nothing leads to.
//!
//! Where loads are exactly zero and nothing is prescribed, the solution often is zero. A correction leaves of the state before
//! what rounding is beside that, and no iteration on such numbers ends: all branches of contact are ties there, relative
//! residuals compare rounding with rounding, and each iteration makes both smaller. Promises: nothing that acts, however small
//! it is, is taken for nothing; scenes all of whose fields are loaded pay nothing. Decides nothing: whether rest solves the
//! equations its residual says.

use wfl_compiler::types::FieldKind;
use wfl_discrete::system::{FIXED, System};

use crate::load_step::LoadStep;

/// Part of the unknowns that an attempt began with, below which they may be nothing: what one correction leaves of them where
/// they have all but vanished, the root of roundoff. A state that is meant is not lost by it, since rest must solve the
/// equations exactly.
const VANISHED: f64 = 1.5e-8;

/// A state with some of its fields at rest.
pub(super) struct Rest {
    pub(super) state: Vec<f64>,
    /// By field whether it is one of them.
    fields: Vec<bool>,
}

impl Rest {
    /// Of the fields that no loads act on and that have vanished beside `before`, their largest unknowns by field when the
    /// attempt began; `None` where there are none, or multipliers alone: these vanish where contact opens.
    pub(super) fn of(step: &LoadStep<'_>, u: &[f64], before: &[f64]) -> Option<Self> {
        let system = step.system;
        let is_force = |k: &usize| system.fields[*k].kind == FieldKind::Unknown && system.range(*k).is_some();
        let forces = || (0..system.fields.len()).filter(is_force);
        if !step.offset.is_empty() || forces().all(|k| system.is_loaded(k)) {
            return None;
        }
        let now = system.largest_of_groups(u);
        let has_vanished = |k: usize| {
            system.range(k).is_some() && !system.is_loaded(k) && 0.0 < now[k] && now[k] <= VANISHED * before[k]
        };
        let fields: Vec<bool> = (0..system.fields.len()).map(has_vanished).collect();
        if !forces().any(|k| fields[k]) {
            return None;
        }
        let numbering = &system.numbering;
        let mut state = u.to_vec();
        numbering.frames.turn(&mut state);
        for_each_free(system, &fields, |dof| state[dof] = 0.0);
        numbering.frames.turn_back(&mut state);
        numbering.follow(&mut state);
        Some(Self { state, fields })
    }

    /// Whether a residual by dof is exactly zero in the equations of these fields, on all ranks.
    pub(super) fn solves(&self, system: &System, residual: &[f64]) -> bool {
        let mut open = false;
        for_each_free(system, &self.fields, |dof| open |= residual[dof] != 0.0);
        !system.team().any(open)
    }
}

fn for_each_free(system: &System, fields: &[bool], mut then: impl FnMut(usize)) {
    for range in (0..fields.len()).filter(|k| fields[*k]).filter_map(|k| system.range(k)) {
        range.filter(|dof| system.numbering.free[*dof] != FIXED).for_each(&mut then);
    }
}
