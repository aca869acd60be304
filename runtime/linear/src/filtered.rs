//! Whether a scene with contact is solved by factors or by GMRES with multigrid of the bodies and a filter on the contact.
//!
//! Decided before memory is taken, from the numbers of unknowns and steps. Promises: a reason in words wherever the
//! iteration cannot be used. Does not assemble and does not solve.

use wfl_compiler::Class;
use wfl_discrete::{assemble::AssembledTerm, pruning::Pruning, system::System};
use wfl_sparse::solve::LinearMethod;

use super::condensation::condenses;
use super::cost::{Factors, Iteration, Ways, Work};
use super::library::{is_on_faces, traits};
use super::plan::{Extent, LinearPlan};
use super::saddle;

/// Factors of the bodies with what is condensed, and the iteration; solutions are those of a step with its iterations of Newton.
/// Factors were measured on the fault, 4 and 20 steps of 107,000 and of 205,000 unknowns (docs/scale.md). The iteration took 1.1 of
/// the time of factors for 107,000 in four steps and 0.75 for 205,000, in turn (docs/solvers.md). Fewer than 100,000 unknowns are
/// factored where the factor fits into the memory: ten seconds and 2 GB at most.
const WAYS: Ways = Ways {
    factors: Factors { bytes: 20e3, seconds: 6.8, power: 2.1, solution: 0.5 },
    iteration: Iteration { bytes: 5.5e3, levels: 1.0, solution: 2.1 },
    small: 100_000,
};
/// Factors of whole tangents that are not symmetric, and the iteration on them. Measured on one step of a hyperelastic block on a
/// floor with Nitsche's method, of 71,000 and of 346,000 unknowns (docs/solvers.md); of what was measured 1.5 and 7 seconds of the
/// processor are not for solutions.
const TANGENTS: Ways = Ways {
    factors: Factors { bytes: 22e3, seconds: 6.0, power: 2.0, solution: 0.2 },
    iteration: Iteration { bytes: 5e3, levels: 0.7, solution: 0.22 },
    small: 30_000,
};
/// Of a step of Newton's method with them: the first tangent is factored, or its levels are made, and there are six solutions.
const OF_A_STEP: Work = Work { made: 1.0, solutions: 6.0 };
/// Number of unknowns of contact above which the iteration is not used: a factor on them in every iteration of Newton takes
/// longer than the cycles.
const MOST_ON_CONTACT: usize = 100_000;

/// Why a scene cannot be solved by GMRES; `None` if it can.
#[must_use]
pub fn obstacle_of_filter(system: &System) -> Option<String> {
    let of_flow = saddle::layout(system).err();
    if system.is_linear() || of_flow.is_none() {
        return of_flow.map(|why| format!("the scene is linear, and {why}"));
    }
    if has_whole_tangents(system) { obstacle_of_tangents(system) } else { obstacle_of_linear_bodies(system) }
}

/// Whether contact on linear bodies, which stay as they are, can be solved in this way.
#[must_use]
pub(super) fn serves_linear_bodies(system: &System) -> bool {
    !system.is_linear() && !has_whole_tangents(system) && obstacle_of_linear_bodies(system).is_none()
}

/// The same of a scene with linear bodies.
fn obstacle_of_linear_bodies(system: &System) -> Option<String> {
    if !system.team().is_alone() {
        return Some("there are several ranks".to_owned());
    }
    if let Some(term) = system.terms.iter().find(|t| t.law.class == Class::Linear && !t.law.symmetric) {
        return Some(format!("the term `{}` is not symmetric", term.law.name));
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

/// Why a scene whose bodies are not linear cannot be solved by GMRES on whole tangents; `None` if it can.
#[must_use]
pub(super) fn obstacle_of_tangents(system: &System) -> Option<String> {
    if !system.team().is_alone() {
        return Some("there are several ranks, and the bodies are not linear".to_owned());
    }
    if system.has_moving_images() && !system.follows_images() {
        return Some("images follow the bodies, with local frames or unknowns that follow others".to_owned());
    }
    let of_bodies = |term: &&AssembledTerm| term.law.class >= Class::Nonlinear && !is_on_faces(term);
    let written = system.terms.iter().filter(|term| term.law.class == Class::Linear || of_bodies(term));
    let frozen = system.frozen().iter().map(|frozen| &frozen.form).filter(|form| !is_on_faces(form));
    let mut bodies = written.chain(frozen);
    if let Some(term) = bodies.find(|term| !term.law.symmetric) {
        return Some(format!("the term `{}` is not symmetric", term.law.name));
    }
    if let Some(field) = (0..system.fields.len()).find(|field| system.has_single_equations(*field)) {
        return Some(format!("the equations of `{}` are laws at points", system.fields[field].name));
    }
    if super::iterative::obstacle(system).is_none() {
        return Some("its tangents are symmetric".to_owned());
    }
    let traits = traits(system);
    if traits.on_contact == 0 {
        return Some("there is no contact".to_owned());
    }
    if traits.on_contact > MOST_ON_CONTACT {
        return Some(format!("{} of {} unknowns are on contact", traits.on_contact, traits.unknowns));
    }
    traits.obstacle
}

/// Whether the systems of Newton's method are whole tangents: a term of a body is not linear, or images follow the bodies.
fn has_whole_tangents(system: &System) -> bool {
    let is_of_body = |term: &AssembledTerm| term.law.class >= Class::Nonlinear && !is_on_faces(term);
    system.has_moving_images() || system.terms.iter().any(is_of_body)
}

/// Whether GMRES on whole tangents is to be used; `steps` are those that are expected.
#[must_use]
pub(super) fn is_chosen_for_tangents(system: &System, method: LinearMethod, steps: usize) -> bool {
    TANGENTS.are_left(method, system, [work_of_tangents(steps); 2])
        && has_whole_tangents(system)
        && obstacle_of_tangents(system).is_none()
}

/// The iteration on whole tangents with what it is foreseen to take; `None` for another way.
pub(super) fn plan_of_tangents(system: &System, method: LinearMethod, steps: usize) -> Option<LinearPlan> {
    if !is_chosen_for_tangents(system, method, steps) {
        return None;
    }
    let (n, work) = (system.n_unknowns(), work_of_tangents(steps));
    let (bytes, in_place) = (TANGENTS.by_iteration(n, work).size(), TANGENTS.by_factors(n, work).size());
    Some(LinearPlan::WithContact(traits(system).on_contact, Extent::Foreseen((bytes, Some(in_place)))))
}

#[expect(clippy::cast_precision_loss, reason = "a count of steps")]
fn work_of_tangents(steps: usize) -> Work {
    let steps = steps as f64;
    Work { made: steps * OF_A_STEP.made, solutions: steps * OF_A_STEP.solutions }
}

#[expect(clippy::cast_precision_loss, reason = "a count of steps")]
fn work(steps: usize) -> Work {
    Work { made: 1.0, solutions: steps as f64 }
}

/// Whether the iteration is to be used; `steps` are those that are expected.
#[must_use]
pub(super) fn is_chosen(system: &System, method: LinearMethod, steps: usize) -> bool {
    WAYS.are_left(method, system, [work(steps); 2]) && serves_linear_bodies(system)
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
        assert_eq!(
            of(Block::new(2, &[LAPLACE], &[])),
            "the scene is linear, and there is no motion with a scalar field beside it"
        );
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
    fn tangents_with_contact_are_foreseen_as_they_were_measured() {
        let near = |found: f64, measured: f64| (found / measured - 1.0).abs() < 0.25;
        let work = work_of_tangents(1);
        for (n, factor, iteration) in [(71_000, (3.9, 1.4e9), (1.4, 0.36e9)), (346_000, (82.0, 11.5e9), (8.0, 1.63e9))]
        {
            let (by_factor, by_iteration) = (TANGENTS.by_factors(n, work), TANGENTS.by_iteration(n, work));
            assert!(near(by_factor.seconds, factor.0) && near(by_factor.bytes, factor.1), "{by_factor:?}");
            assert!(
                near(by_iteration.seconds, iteration.0) && near(by_iteration.bytes, iteration.1),
                "{by_iteration:?}"
            );
        }
    }

    #[test]
    fn many_steps_pay_for_a_factor_and_many_unknowns_do_not() {
        let pays = |n, steps| WAYS.by_iteration(n, work(steps)).seconds < WAYS.by_factors(n, work(steps)).seconds;
        assert!(pays(1_000_000, 20) && pays(205_000, 4) && !pays(60_000, 4) && !pays(107_000, 20));
    }
}
