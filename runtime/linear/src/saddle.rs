//! Whether a flow with a pressure is solved by a factor or by GMRES with multigrid of the motion.
//!
//! Decided before memory is taken, from the number of unknowns. Promises: a reason in words wherever the iteration cannot
//! be used. Does not assemble and does not solve.

use wfl_discrete::system::System;
use wfl_sparse::solve::{LinearMethod, NodeLayout};

use super::cost::{Factors, Iteration, Ways, Work};
use super::plan::{Extent, LinearPlan, Systems};

/// Factors of a flow (LDLT), and the iteration. Measured on a flow through a cube with Taylor-Hood elements, of 46,000 and 194,000
/// unknowns (docs/solvers.md).
const WAYS: Ways = Ways {
    factors: Factors { bytes: 13e3, seconds: 4.2, power: 1.97, solution: 0.2 },
    iteration: Iteration { bytes: 3.2e3, levels: 0.5, solution: 2.2 },
    small: 30_000,
};

/// The same of tangents, measured on the flow with inertia of 129,000 and of 194,000 unknowns: the symmetric part of a tangent stands beside
/// it while levels are made, and so do the factor of an earlier one and the next matrix.
const TANGENTS: Ways = Ways {
    factors: Factors { bytes: 16.5e3, ..WAYS.factors },
    iteration: Iteration { bytes: 6.5e3, ..WAYS.iteration },
    ..WAYS
};
/// Of a step of Newton's method with factors: hardly more than one is made, and there are five solutions.
const FACTORS_OF_A_STEP: Work = Work { made: 1.2, solutions: 5.0 };
/// The same with levels, which each tangent has of its own. Corrections but the last are solved to a few digits.
const LEVELS_OF_A_STEP: Work = Work { made: 5.0, solutions: 2.0 };

/// The unknowns by nodes, or why the iteration cannot be used.
pub(super) fn layout(system: &System) -> Result<NodeLayout, String> {
    if !system.team().is_alone() {
        return Err("there are several ranks".to_owned());
    }
    if system.has_moving_images() {
        return Err("images follow the bodies".to_owned());
    }
    if let Some(frozen) = system.frozen().first() {
        return Err(format!("the term `{}` is one of contact", system.terms[frozen.term].law.name));
    }
    system.node_layout_of_motion()
}

/// Whether the iteration is to be used; `steps` are those that are expected.
#[must_use]
pub(super) fn is_chosen(system: &System, method: LinearMethod, steps: usize) -> bool {
    ways(system).are_left(method, system, work(system, steps)) && layout(system).is_ok()
}

/// The iteration with what it is foreseen to take; `None` for a factor.
pub(super) fn plan(system: &System, method: LinearMethod, steps: usize) -> Option<LinearPlan> {
    if !is_chosen(system, method, steps) {
        return None;
    }
    let (n, ways, [of_factors, of_levels]) = (system.n_unknowns(), ways(system), work(system, steps));
    let (bytes, in_place) = (ways.by_iteration(n, of_levels).size(), ways.by_factors(n, of_factors).size());
    let systems = if system.is_linear() { Systems::One } else { Systems::Tangents };
    Some(LinearPlan::Saddle(systems, Extent::Foreseen((bytes, Some(in_place)))))
}

/// What levels take before they are made.
pub(super) fn bytes(n: usize) -> u64 {
    WAYS.by_iteration(n, LEVELS_OF_A_STEP).size()
}

/// The ways to solve the systems of a scene.
fn ways(system: &System) -> Ways {
    if system.is_linear() { WAYS } else { TANGENTS }
}

/// What factors and levels have to do in so many steps.
#[expect(clippy::cast_precision_loss, reason = "a count of steps")]
fn work(system: &System, steps: usize) -> [Work; 2] {
    let steps = steps as f64;
    if system.is_linear() {
        return [Work { made: 1.0, solutions: steps }; 2];
    }
    [FACTORS_OF_A_STEP, LEVELS_OF_A_STEP].map(|of| Work { made: steps * of.made, solutions: steps * of.solutions })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flows_are_foreseen_as_they_were_measured() {
        let near = |found: f64, measured: f64| (found / measured - 1.0).abs() < 0.35;
        let one = Work { made: 1.0, solutions: 1.0 };
        let (factor, levels) = (WAYS.by_factors(194_049, one), WAYS.by_iteration(194_049, one));
        assert!(near(factor.seconds, 13.7) && near(factor.bytes, 3.07e9), "{factor:?}");
        assert!(near(levels.seconds, 5.5) && near(levels.bytes, 0.61e9), "{levels:?}");
        let factor = TANGENTS.by_factors(194_049, FACTORS_OF_A_STEP);
        let levels = TANGENTS.by_iteration(194_049, LEVELS_OF_A_STEP);
        assert!(near(factor.seconds, 20.0) && near(factor.bytes, 3.96e9), "{factor:?}");
        assert!(near(levels.seconds, 13.0) && near(levels.bytes, 1.27e9), "{levels:?}");
    }
}
