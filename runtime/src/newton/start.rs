//! A start that the equations can leave: some are singular where all unknowns are zero and nowhere else, such as
//! |grad u|^(p-2) grad u.
//!
//! Promises: moves nothing but free dofs of fields on cells that are all zero, by a linear field of small slope, the
//! same in every run. Does not decide whether a step needs it: `newton/mod.rs` does, and says so in the history.

use crate::{
    field::FieldSpace,
    system::{FIXED, System},
};
use wfl_compiler::{Class, types::FieldKind};

/// Slope of the displaced start, in units of the field over the extent of the mesh.
const SLOPE: f64 = 1e-2;
/// What sets the components and directions of the slope apart: the golden section, far from every ratio of small
/// numbers.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// True if `u` is the state of rest and a term on cells is smooth and not linear in it.
pub(super) fn may_be_degenerate(system: &System, u: &[f64]) -> bool {
    let at_rest = system.numbering.free_dofs.iter().all(|d| u[*d as usize] == 0.0);
    at_rest && system.terms.iter().any(|t| t.on_cells() && t.law.class == Class::Nonlinear)
}

/// Displaces the free dofs of the fields on cells. True if there are any.
pub(super) fn displace(system: &System, u: &mut [f64]) -> bool {
    let (low, high) = system.mesh.bounds();
    let largest = u.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    let size = if largest > 0.0 { largest } else { 1.0 };
    let mut moved = false;
    for (k, field) in system.fields.iter().enumerate() {
        let Some(range) = system.range(k) else { continue };
        if field.kind != FieldKind::Unknown || !matches!(field.space, FieldSpace::Nodal(_)) {
            continue;
        }
        for d in range.clone().filter(|d| system.numbering.free[*d] != FIXED) {
            let (node, component) = ((d - range.start) / field.n_components, (d - range.start) % field.n_components);
            let at = field.node_position(node);
            let along = (0..3).filter(|c| high[*c] > low[*c]).map(|c| {
                #[expect(clippy::cast_precision_loss, reason = "small numbers")]
                let part = ((component + 1) as f64 * GOLDEN + c as f64 * GOLDEN * GOLDEN).fract();
                (0.5 + part) * (at[c] - low[c]) / (high[c] - low[c])
            });
            u[d] = SLOPE * size * along.sum::<f64>();
            moved = true;
        }
    }
    moved
}
