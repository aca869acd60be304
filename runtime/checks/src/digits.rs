//! How many digits the unknowns of a step have.
//!
//! The equations are known to rounding only: of row i about `eps sum_j |K_ij| |u_j|`, what is left of the residual on
//! top. What such an uncertainty does to the unknowns is not bounded by a condition number, which for contact is too
//! large by many orders (a stiff penalty is ill-conditioned without being inaccurate); it is sampled: the tangent is
//! solved for uncertainties of that size in every row with signs that look random (statistical condition estimation,
//! Kenney and Laub 1994, with the componentwise uncertainty of Oettli and Prager). One or two solutions with a factor
//! that is there already. A state that was refined (`newton/refinement.rs`) is as right as its last correction was small, but
//! for what rounds in the terms that are not linear. The estimate is of the error from finite precision; that of the mesh
//! is another matter.

use super::Solved;
use wfl_linear::LinearSolver;

/// Sets of signs that are tried: the second one may see what signs of the first one cancel; the larger error counts.
const SAMPLES: u64 = 2;
/// With a relative error this small after the first one that is all: a set of signs tells k digits too many with a chance of
/// about 10^-k, and this is a thousandth of what is warned of.
pub(super) const CLEAR: f64 = 1e-6;
/// Part of a right-hand side that its solution may leave: an estimate needs few digits, and an older factor serves.
pub(super) const LEFT: f64 = 1e-3;

/// What finite precision leaves of the unknowns of a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Accuracy {
    /// Estimated error of the least accurate unknown, relative to the largest value of its kind.
    pub error: f64,
    /// The field it belongs to.
    pub field: String,
}

impl Accuracy {
    /// Correct decimal digits, 0 to 16.
    #[must_use]
    pub fn digits(&self) -> f64 {
        if self.error.is_nan() { 0.0 } else { (-self.error.log10()).clamp(0.0, 16.0) }
    }
}

/// Estimates the error of a solution; `correction` is the size of its last correction where it was refined: an error of
/// no less. `None` where no tangent was needed.
#[must_use]
pub fn digits(state: Solved<'_>, solver: &mut LinearSolver, correction: Option<f64>) -> Option<Accuracy> {
    let Solved { system, u, .. } = state;
    let uncertainty = system.rounding(u, state.residual, state.tangent);
    let mut worst: Option<Accuracy> = None;
    for sample in 1..=SAMPLES {
        if worst.as_ref().is_some_and(|w| w.error < CLEAR) {
            break;
        }
        let Some(error) = disturbed(state, solver, &uncertainty, sample)? else { continue };
        for (body, error) in system.relative_sizes(u, &error) {
            // of zero there are no digits
            if error > CLEAR && system.is_zero_but_for_rounding(u, state.residual, state.tangent, body) {
                continue;
            }
            let error = correction.map_or(error, |c| if error > c || error.is_nan() { error } else { c });
            if worst.as_ref().is_none_or(|w| error.is_nan() || error > w.error) {
                let field = &system.fields[system.field_of_body(body)];
                worst = Some(Accuracy { error, field: field.name.clone() });
            }
        }
    }
    worst
}

/// What rounding and a residual of the part `left` of the forces may change of the unknowns, by dof, as one set of signs says. Single
/// equations have no more left than rounding and what stands in the residual: they are solved for beside what they began with,
/// not beside what cancels in them. `None` where that cannot be found.
#[must_use]
pub fn uncertainty_of_unknowns(state: Solved<'_>, solver: &mut LinearSolver, left: f64) -> Option<Vec<f64>> {
    let Solved { system, u, residual, tangent, .. } = state;
    let mut uncertainty = system.rounding(u, residual, tangent);
    if left > 0.0 {
        let sizes = system.sizes(u, residual, tangent);
        let scales = system.scales(residual, &sizes);
        let forces = |body: &usize| !system.has_single_equations(system.field_of_body(*body));
        for body in system.unknown_bodies().filter(forces) {
            for d in system.dofs_of_body(body) {
                uncertainty[d] += left * scales[body];
            }
        }
    }
    Some(disturbed(state, solver, &uncertainty, 1)?.unwrap_or_else(|| vec![0.0; u.len()]))
}

/// The change of the unknowns that an uncertainty of the equations makes, by dof; `Some(None)` without one.
#[expect(clippy::option_option, reason = "a solution that fails is another matter than nothing to solve")]
fn disturbed(
    state: Solved<'_>,
    solver: &mut LinearSolver,
    uncertainty: &[f64],
    sample: u64,
) -> Option<Option<Vec<f64>>> {
    let Solved { system, u, residual, .. } = state;
    let (mut rhs, mut x) = (Vec::new(), Vec::new());
    let disturbed: Vec<f64> =
        (0..u.len()).map(|d| residual.values[d] + sign(sample, system.dof_number(d)) * uncertainty[d]).collect();
    system.numbering.gather(&disturbed, &mut rhs);
    if system.team().all(rhs.iter().all(|r| *r == 0.0)) {
        return Some(None);
    }
    solver.solve(&rhs, &mut x, LEFT).ok()?;
    let mut error = vec![0.0; u.len()];
    for (d, e) in system.numbering.free_dofs.iter().zip(&x) {
        error[*d as usize] = *e;
    }
    Some(Some(error))
}

/// 1 or -1, evenly (the finaliser of splitmix64, Steele, Lea and Flood 2014).
pub(super) fn sign(sample: u64, dof: u64) -> f64 {
    let mut z = (dof + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ sample.wrapping_mul(0xd1b5_4a32_d192_ed03);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    if (z ^ (z >> 31)) & 1 == 0 { 1.0 } else { -1.0 }
}
