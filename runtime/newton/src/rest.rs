//! The state of rest, which a load that goes back to nothing leads to.
//!
//! Where loads are exactly zero and nothing is prescribed, the solution often is zero. A correction leaves of the state before
//! what rounding is beside that, and no iteration on such numbers ends: all branches of contact are ties there, relative
//! residuals compare rounding with rounding, and each iteration makes both smaller. Promises: nothing that acts, however small
//! it is, is taken for nothing. Decides nothing: whether rest solves the equations its residual says.

use wfl_discrete::system::{FIXED, System};

use crate::load_step::LoadStep;

/// Part of the unknowns that an attempt began with, below which they may be nothing: what one correction leaves of them where
/// they have all but vanished, the root of roundoff. A state that is meant is not lost by it, since rest must solve the
/// equations exactly.
const VANISHED: f64 = 1.5e-8;

/// The state at rest of all fields that no loads act on and that have vanished beside `before`, their largest unknowns by field
/// when the attempt began; `None` where there are none.
pub(super) fn of(step: &LoadStep<'_>, u: &[f64], before: &[f64]) -> Option<Vec<f64>> {
    let system = step.system;
    let vanished = vanished(system, u, before);
    if !step.offset.is_empty() || !vanished.contains(&true) {
        return None;
    }
    let numbering = &system.numbering;
    let mut rest = u.to_vec();
    numbering.frames.turn(&mut rest);
    for_each_free(system, &vanished, |dof| rest[dof] = 0.0);
    numbering.frames.turn_back(&mut rest);
    numbering.follow(&mut rest);
    Some(rest)
}

/// Whether a residual by dof is exactly zero in the equations of all fields that have vanished, on all ranks.
pub(super) fn solves(system: &System, u: &[f64], before: &[f64], residual: &[f64]) -> bool {
    let mut open = false;
    for_each_free(system, &vanished(system, u, before), |dof| open |= residual[dof] != 0.0);
    !system.team().any(open)
}

/// By field whether no loads act on it and it has vanished.
fn vanished(system: &System, u: &[f64], before: &[f64]) -> Vec<bool> {
    let now = system.largest_of_groups(u);
    let is =
        |k: usize| system.range(k).is_some() && !system.is_loaded(k) && 0.0 < now[k] && now[k] <= VANISHED * before[k];
    (0..system.fields.len()).map(is).collect()
}

fn for_each_free(system: &System, fields: &[bool], mut then: impl FnMut(usize)) {
    for range in (0..fields.len()).filter(|k| fields[*k]).filter_map(|k| system.range(k)) {
        range.filter(|dof| system.numbering.free[*dof] != FIXED).for_each(&mut then);
    }
}
