//! The laws of a scene as a whole: how they start, choose, extrapolate and remember.

use super::test_block::{Block, LAPLACE, PENALTY, PENALTY_WITH_FRICTION};
use super::*;

/// A square whose floor is pressed by `overlap` and slid by `slip`, after one reading of the projections there.
fn read(overlap: f64, slip: f64) -> Block {
    let mut block = Block::with_friction(1);
    let u = block.moved([slip, -overlap], [0.0; 2]);
    block.contact.search(&block.system, &u);
    block
}

#[test]
fn laws_without_a_state_are_open() {
    let contact = Block::with_friction(1).contact;
    assert_eq!(contact.active_set(), &contact.opened());
    assert!(contact.active_set().terms[0].points.iter().all(|x| *x == 0.0));
    assert!(!contact.is_warm() && contact.is_as_written() && !contact.is_empty());
}

#[test]
fn a_choice_counts_the_points_that_change_their_branch() {
    let mut block = read(0.1, 0.0);
    assert_eq!(block.contact.update(1), Changes { changed: 2, points: 2 });
    assert_eq!(block.contact.update(2), Changes { changed: 0, points: 2 }, "nothing has moved");
}

#[test]
fn a_share_of_no_points_is_none() {
    assert_eq!(Changes::default().share(), 0.0);
    assert_eq!(Changes { changed: 3, points: 12 }.share(), 0.25);
}

#[test]
fn the_first_step_is_taken_as_a_whole_and_so_is_one_that_is_not_searched() {
    let mut block = Block::with_friction(1);
    let pressed = block.moved([0.0, -0.1], [0.0; 2]);
    assert_eq!(block.contact.search(&block.system, &pressed), 1.0);
    // all are open, where the values are to be those of contact: no state on the way is nearer
    let lifted = block.moved([0.0, 0.1], [0.0; 2]);
    block.contact.take_full_step(&block.system, &lifted);
    assert_eq!(block.contact.states, block.contact.read(&block.system, &lifted));
}

#[test]
fn a_set_that_sticks_everywhere_keeps_its_regularisation() {
    let mut block = read(0.1, 0.0);
    block.contact.terms[0].scaling.slopes = vec![10.0, 10.0];
    block.contact.terms[0].scaling.stiffness = 10.0;
    block.contact.set_overstress(1.0);
    block.contact.stick_everywhere();
    let term = &block.contact.terms[0];
    let own = &block.contact.active.terms[0];
    for p in &term.projections {
        assert!(own.points.chunks_exact(term.sizes.point).all(|point| p.branch.sticks(point, 0)));
        assert_eq!(p.branch.regularisation(&own.regularisation).overstress, 0.5);
    }
    assert!(!block.contact.is_as_written());
}

#[test]
fn the_law_as_written_comes_back_with_its_regularisation() {
    let mut contact = Block::with_friction(1).contact;
    let before = contact.active_set().clone();
    contact.terms[0].scaling.slopes = vec![10.0, 10.0];
    contact.set_compliant(true);
    assert!(!contact.is_as_written() && contact.active_set() != &before);
    contact.set_compliant(false);
    contact.set_friction(2.0);
    assert!(!contact.is_as_written());
    contact.set_friction(1.0);
    assert!(contact.is_as_written() && contact.active_set() == &before);
    contact.set_softness(0.5);
    assert!(!contact.is_as_written() && contact.active_set() != &before);
    contact.set_softness(1.0);
    assert!(contact.is_as_written() && contact.active_set() == &before);
}

#[test]
fn only_laws_with_a_ball_have_friction() {
    assert!(Block::with_friction(1).contact.has_sliding());
    let without = Block::new(1, &[LAPLACE], &[PENALTY]).contact;
    assert!(!without.has_friction() && !without.has_sliding());
    assert!(without.presses(0), "it presses all the same");
}

/// A square whose floor was pressed by some overlaps at the times 1, 2, ... and has converged there.
fn converged(overlaps: &[f64]) -> Block {
    let mut block = Block::with_friction(1);
    for (k, overlap) in overlaps.iter().enumerate() {
        #[expect(clippy::cast_precision_loss, reason = "few steps")]
        block.contact.begin_step(Window::new(1.0 + k as f64, 1.0));
        let u = block.moved([0.0, -overlap], [0.0; 2]);
        block.contact.freeze_as_written(&block.system, &u);
        block.contact.set_warm(true);
        block.contact.accept(&block.system, &u);
    }
    block
}

fn n_closed(contact: &Contact) -> usize {
    let term = &contact.terms[0];
    let points = contact.active.terms[0].points.chunks_exact(term.sizes.point);
    points.filter(|point| term.projections[0].branch.sticks(point, 0)).count()
}

#[test]
fn a_step_begins_with_the_contact_that_the_last_two_lead_to() {
    // 0.3 above the floor, then 0.1: at the same pace it is pressed by 0.1
    let mut block = converged(&[-0.3, -0.1]);
    assert_eq!(n_closed(&block.contact), 0);
    block.contact.begin_step(Window::new(3.0, 1.0));
    let u = block.moved([0.0, 0.1], [0.0; 2]);
    block.contact.initialise(&block.system, &u, None);
    assert_eq!(n_closed(&block.contact), 2);
}

#[test]
fn after_one_step_nothing_is_extrapolated() {
    let mut block = converged(&[-0.1]);
    block.contact.begin_step(Window::new(2.0, 1.0));
    let u = block.moved([0.0, 0.1], [0.0; 2]);
    block.contact.initialise(&block.system, &u, None);
    assert_eq!(n_closed(&block.contact), 0);
}

#[test]
fn loads_that_turn_are_not_extrapolated() {
    // it came down, and went up again: the state before is nearer than the one that was expected
    let mut block = converged(&[-0.3, -0.1, -0.2]);
    assert!(!block.contact.converged[0].on_trend);
    block.contact.begin_step(Window::new(4.0, 1.0));
    let before = block.contact.active_set().clone();
    let u = block.moved([0.0, 0.2], [0.0; 2]);
    block.contact.initialise(&block.system, &u, None);
    assert_eq!(block.contact.active_set(), &before);
}

#[test]
fn a_cold_start_forgets_the_states_before() {
    let mut block = converged(&[-0.3, -0.1]);
    block.contact.set_warm(false);
    assert!(block.contact.converged.is_empty() && !block.contact.is_warm());
}

#[test]
fn a_memory_brings_laws_back_to_where_they_were() {
    let mut block = converged(&[0.1, 0.2]);
    block.contact.terms[0].scaling.ratios = vec![0.25, 0.5];
    let (memory, set) = (block.contact.memory(), block.contact.active_set().clone());
    block.contact.forget();
    block.contact.set_warm(false);
    block.contact.terms[0].scaling.ratios = vec![1.0, 1.0];
    assert!(block.contact.recall(&memory));
    assert_eq!(block.contact.memory(), memory);
    assert_eq!(block.contact.active_set(), &set);
    assert!(block.contact.is_warm());
}

#[test]
fn the_memory_of_other_laws_changes_nothing() {
    let mut block = converged(&[0.1, 0.2]);
    let before = block.contact.memory();
    for others in [Block::new(1, &[LAPLACE], &[PENALTY]), Block::with_friction(2)] {
        assert!(!block.contact.recall(&others.contact.memory()));
    }
    assert!(!block.contact.recall(&Block::new(1, &[LAPLACE], &[PENALTY_WITH_FRICTION; 2]).contact.memory()));
    assert_eq!(block.contact.memory(), before);
}

#[test]
fn a_run_that_begins_again_has_nothing_of_the_one_before() {
    let mut block = Block::with_friction(1);
    let at_first = block.contact.memory();
    let u = block.moved([0.0, -0.1], [0.0; 2]);
    block.contact.initialise(&block.system, &u, None);
    block.contact.set_friction(3.0);
    block.contact.update(7);
    block.contact.restart(&at_first);
    assert_eq!(block.contact.memory(), at_first);
    assert!(block.contact.is_as_written());
}

#[test]
fn the_stiffness_of_the_bodies_is_fitted_by_length_and_to_the_slope_of_the_argument() {
    // the tangent of a square is 2/3 at each free dof; both points of the face act on both of its nodes, over a length of 1
    let block = |gamma: f64| {
        let law = PENALTY_WITH_FRICTION.replace("10*", &format!("{gamma}*"));
        let mut block = Block::new(1, &[LAPLACE], &[&law]);
        let u = vec![0.0; block.system.numbering.n_dofs];
        block.contact.initialise(&block.system, &u, None);
        block.contact
    };
    let soft = block(0.1);
    assert!((soft.terms[0].scaling.stiffness - 2.0 / 3.0).abs() < 1e-14, "{:?}", soft.terms[0].scaling);
    assert_eq!(
        soft.terms[0].scaling.ratios,
        [1.0, 1.0],
        "an argument without a multiplier is as stiff as its traction"
    );
    let stiff = block(100.0);
    assert!((stiff.terms[0].scaling.ratios[0] - 2.0 / 300.0).abs() < 1e-14 && stiff.is_stiff() && !soft.is_stiff());
    assert!((stiff.stiffness_ratio() - 2.0 / 300.0).abs() < 1e-14);
}

#[test]
fn points_of_stiff_contact_choose_by_entity_at_first() {
    let chosen = |time: usize| {
        let mut block = Block::with_friction(1);
        block.contact.terms[0].scaling.ratios = vec![0.01, 0.01];
        block.contact.states =
            vec![ProjectionState::of(&[&[4.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], &[-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]])];
        block.contact.update(time);
        n_closed(&block.contact)
    };
    assert_eq!(chosen(1), 2, "the mean presses");
    assert_eq!(chosen(CHOICES_BY_ENTITY + 1), 1);
}
