//! Whether a scene with contact is solved by factors or by GMRES with multigrid of the bodies and a filter on the contact.
//!
//! Decided before memory is taken, from the numbers of unknowns and steps. Promises: a reason in words wherever the
//! iteration cannot be used. Does not assemble and does not solve.

use wfl_compiler::Class;
use wfl_discrete::{assemble::Over, pruning::Pruning, system::System};
use wfl_sparse::solve::LinearMethod;

use super::condensation::condenses;
use super::cost::{Factors, Iteration, Ways, Work};
use super::library::traits;
use super::plan::LinearPlan;

/// Factors of the bodies with what is condensed, and the iteration; solutions are those of a step with its iterations of Newton.
/// Factors were measured on the fault, 4 and 20 steps of 107,000 and of 205,000 unknowns (docs/scale.md). The iteration took 1.1 of
/// the time of factors for 107,000 in four steps and 0.75 for 205,000, in turn (docs/solvers.md). Fewer than 100,000 unknowns are
/// factored where the factor fits into the memory: ten seconds and 2 GB at most.
const WAYS: Ways = Ways {
    factors: Factors { bytes: 20e3, seconds: 6.8, power: 2.1, solution: 0.5 },
    iteration: Iteration { bytes: 5.5e3, levels: 1.0, solution: 2.1 },
    small: 100_000,
};
/// Number of unknowns below which a factor is never too large: at most half a gigabyte.
const LEAST: usize = 30_000;
/// Number of unknowns of contact above which the iteration is not used: a factor on them in every iteration of Newton takes
/// longer than the cycles.
const MOST_ON_CONTACT: usize = 100_000;

/// Why a scene cannot be solved in this way; `None` if it can.
#[must_use]
pub fn obstacle_of_filter(system: &System) -> Option<String> {
    if system.is_linear() {
        return Some("the scene is linear".to_owned());
    }
    if !system.team().is_alone() {
        return Some("there are several ranks".to_owned());
    }
    if system.has_moving_images() {
        return Some("images follow the bodies".to_owned());
    }
    if let Some(term) = system.terms.iter().find(|t| t.law.class == Class::Linear && !t.law.symmetric) {
        return Some(format!("the term `{}` is not symmetric", term.law.name));
    }
    let mut nonlinear = system.terms.iter().filter(|t| t.law.class >= Class::Nonlinear);
    if let Some(term) = nonlinear.find(|t| t.integrator.domain.over != Over::Facets) {
        return Some(format!("the term `{}` is not linear and no contact", term.law.name));
    }
    if let Some(field) = (0..system.fields.len()).find(|field| system.has_single_equations(*field)) {
        return Some(format!("the equations of `{}` are laws at points", system.fields[field].name));
    }
    if !system.uses(Pruning::Condense) || !condenses(system) {
        return Some("contact touches most unknowns".to_owned());
    }
    let traits = traits(system);
    if traits.on_contact > MOST_ON_CONTACT {
        return Some(format!("{} of {} unknowns are on contact", traits.on_contact, traits.unknowns));
    }
    traits.obstacle
}

#[expect(clippy::cast_precision_loss, reason = "a count of steps")]
fn work(steps: usize) -> Work {
    Work { made: 1.0, solutions: steps as f64 }
}

/// Whether the iteration is to be used; `steps` are those that are expected.
#[must_use]
pub(super) fn is_chosen(system: &System, method: LinearMethod, steps: usize) -> bool {
    let n = system.n_unknowns();
    let is_wanted = match method {
        LinearMethod::Direct => false,
        LinearMethod::Iterative => true,
        LinearMethod::Auto => system.mesh.dim() == 3 && n >= LEAST && WAYS.prefer_iteration(n, [work(steps); 2]),
    };
    is_wanted && obstacle_of_filter(system).is_none()
}

/// The iteration with what it is foreseen to take; `None` for a factor.
pub(super) fn plan(system: &System, method: LinearMethod, steps: usize) -> Option<LinearPlan> {
    if !is_chosen(system, method, steps) {
        return None;
    }
    let n = system.n_unknowns();
    let work = work(steps);
    let (bytes, in_place) = (WAYS.by_iteration(n, work).size(), WAYS.by_factors(n, work).size());
    Some(LinearPlan::Filtered { on_contact: traits(system).on_contact, bytes, in_place })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_block::{Block, LAPLACE};

    #[test]
    fn what_stands_against_it_is_said() {
        let of = |block: Block| obstacle_of_filter(&block.system).expect("an obstacle");
        assert_eq!(of(Block::new(2, &[LAPLACE], &[])), "the scene is linear");
        // three nodes are free, all of them on the floor
        assert_eq!(of(Block::with_friction(2)), "contact touches most unknowns");
    }

    #[test]
    fn a_small_scene_is_factored_whatever_the_models_say() {
        let system = Block::with_friction(2).system;
        assert!(!is_chosen(&system, LinearMethod::Auto, 1) && !is_chosen(&system, LinearMethod::Direct, 1));
        assert_eq!(plan(&system, LinearMethod::Auto, 1), None);
    }

    #[test]
    fn many_steps_pay_for_a_factor_and_many_unknowns_do_not() {
        let pays = |n, steps| WAYS.by_iteration(n, work(steps)).seconds < WAYS.by_factors(n, work(steps)).seconds;
        assert!(pays(1_000_000, 20) && pays(205_000, 4) && !pays(60_000, 4) && !pays(107_000, 20));
    }
}
