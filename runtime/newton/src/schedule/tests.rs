//! Which methods a step goes through, and when each is left.

use super::*;

fn methods(traits: &[Trait]) -> Vec<Method> {
    selected(traits).map(|s| s.method).collect()
}

#[test]
fn the_plan_of_a_scene_names_what_is_known_when_a_step_begins_only() {
    let smooth: Vec<Method> = planned(&[]).into_iter().map(|s| s.method).collect();
    assert_eq!(smooth, [Method::Residual, Method::Natural]);
    let friction = planned(&[Trait::Contact, Trait::Friction, Trait::Affine]);
    let compliance = friction.iter().find(|s| s.method == Method::Compliance).expect("it may come to that");
    assert_eq!((compliance.when.as_str(), compliance.iterations), ("stiff contact", 8));
    assert!(planned(&[Trait::Contact]).iter().all(|s| !s.method.is_path() && s.method != Method::LessFriction));
}

#[test]
fn a_scene_without_contact_is_damped_by_the_residual_first() {
    assert_eq!(methods(&[]), [Method::Residual, Method::Natural]);
}

#[test]
fn a_scene_with_an_energy_goes_downhill_before_what_follows_the_residual() {
    use Method as M;
    use Trait as T;
    assert_eq!(methods(&[T::Energy]), [M::Residual, M::Downhill, M::Natural]);
    assert_eq!(methods(&[T::NearEnergy]), [M::Residual, M::Natural, M::Downhill], "of friction it is a guess");
    for energy in [T::Energy, T::NearEnergy] {
        let all = methods(&[T::Contact, T::Affine, energy]);
        let first = all.iter().position(|m| *m != M::ActiveSet);
        assert_eq!(first.map(|k| all[k]), Some(M::Downhill), "{all:?}");
        assert_eq!(all.iter().filter(|m| **m == M::Downhill).count(), 1);
    }
    assert!(!methods(&[T::Contact, T::Affine]).contains(&M::Downhill));
}

#[test]
fn contact_of_linear_bodies_gets_stiffer_from_below_behind_what_comes_first() {
    use Method as M;
    use Trait as T;
    let energy = methods(&[T::Contact, T::Affine, T::Energy]);
    assert_eq!(energy[..4], [M::ActiveSet, M::Downhill, M::Stiffening, M::Path], "an energy leads further than a path");
    let friction = methods(&[T::Contact, T::Affine, T::Friction]);
    assert_eq!(friction[..4], [M::ActiveSet, M::Path, M::Stiffening, M::LessFriction]);
    for without in [[T::Contact, T::Friction], [T::Affine, T::Energy], [T::OverConstrained, T::Affine]] {
        assert!(!methods(&without).contains(&M::Stiffening), "{without:?}");
    }
}

#[test]
fn bodies_that_are_not_linear_go_downhill_beside_friction_once_less_of_it_helps_nothing() {
    use Method as M;
    use Trait as T;
    let rubs = [T::Contact, T::Friction, T::Rubs];
    assert_eq!(methods(&rubs)[..4], [M::ActiveSet, M::LessFriction, M::Downhill, M::Natural]);
    assert!(!methods(&[T::Contact, T::Friction]).contains(&M::Downhill));
    let at_less_friction = |traits: &[Trait]| {
        let mut of = schedule(traits);
        of.position = 1;
        assert_eq!(of.method(), M::LessFriction);
        of
    };
    assert_eq!(stage_after(&mut at_less_friction(&rubs), |_| iteration(0.1, 1.0, 0)), (PATIENCE + 1, M::Downhill));
    let all = FRICTION_PARTS * FRICTION_BUDGET + 10;
    assert_eq!(stage_after(&mut at_less_friction(&rubs), |_| iteration(1.0, 1.0, 0)).0, all, "full steps go on");
    let of_others = stage_after(&mut at_less_friction(&rubs[..2]), |_| iteration(0.1, 1.0, 0));
    assert_eq!(of_others.0, all, "and so do short ones of other scenes");
}

#[test]
fn contact_gets_stiffer_once_it_is_solved_as_it_is() {
    let mut of = schedule(&[Trait::Contact, Trait::Affine, Trait::Energy]);
    assert_eq!(of.softness(), 1.0, "other methods have contact as it is written");
    of.position = 2;
    of.soften(0.1);
    let after = |of: &mut Schedule, step: f64, changed: f64| {
        of.hear(step, changed, 1.0);
        of.softness()
    };
    assert_eq!(after(&mut of, 1.0, 0.01), 0.1, "points changed");
    assert_eq!(after(&mut of, 0.5, 0.0), 0.1, "a part of a step");
    assert!((after(&mut of, 1.0, 0.0) - 0.4).abs() < 1e-15);
    assert_eq!(after(&mut of, 1.0, 0.0), 1.0, "not beyond what is written");
    of.go_on();
    assert_eq!(of.softness(), 1.0);
}

#[test]
fn every_stage_but_the_first_begins_with_another_method() {
    use Method as M;
    use Trait as T;
    assert_eq!(methods(&[T::Contact]), [M::ActiveSet, M::Natural, M::Residual]);
    assert_eq!(
        methods(&[T::Contact, T::Stiff, T::Friction, T::Affine, T::Warm]),
        [
            M::ActiveSet,
            M::Compliance,
            M::ActiveSet,
            M::Path,
            M::Stiffening,
            M::PathFromStart,
            M::LessFriction,
            M::Path,
            M::Residual,
            M::Natural,
            M::MoreFriction
        ]
    );
    assert_eq!(
        methods(&[T::Contact, T::OverConstrained, T::Friction, T::Affine, T::Warm]),
        [
            M::ActiveSet,
            M::Path,
            M::Overstress,
            M::ActiveSet,
            M::Path,
            M::PathFromStart,
            M::Natural,
            M::Residual,
            M::LessFriction,
            M::Path,
            M::MoreFriction
        ]
    );
    assert_eq!(methods(&[T::Contact, T::OverConstrained, T::Stiff])[..2], [M::Overstress, M::ActiveSet]);
}

#[test]
fn a_step_with_contact_begins_with_one_active_set_stage_whatever_it_is_like() {
    use Trait as T;
    for bits in 0..32u32 {
        let all = [T::Warm, T::Stiff, T::OverConstrained, T::Friction, T::Affine];
        let mut traits = vec![T::Contact];
        traits.extend(all.iter().enumerate().filter(|(k, _)| bits >> k & 1 == 1).map(|(_, t)| *t));
        let found = methods(&traits);
        let first = found.iter().position(|m| *m == Method::ActiveSet).expect("there is one");
        assert!(first <= 1, "{traits:?}");
        assert!(found.windows(2).all(|pair| pair[0] != pair[1]), "{traits:?}: {found:?}");
    }
}

/// A schedule of a step with these traits.
fn schedule(traits: &[Trait]) -> Schedule {
    let homotopy = Homotopy::new(1e4);
    let stages = selected(traits).collect();
    Schedule { stages, position: 0, iterations: 0, singular: 0, settled: false, homotopy }
}

/// A line of a history: step, residual and branches.
fn iteration(step: f64, residual: f64, fingerprint: u64) -> Iteration {
    let (method, merit) = (Method::ActiveSet, residual);
    let (number, floor, changed, contact) = (0, 0.0, 0, None);
    Iteration { number, residual, floor, step, method, merit, changed, contact, fingerprint }
}

/// Iterations until another stage begins, and its method, where each of them looks like this.
fn stage_after(of: &mut Schedule, line: impl Fn(usize) -> Iteration) -> (usize, Method) {
    let mut history = StepHistory::default();
    for k in 1..1000 {
        if of.next(&history) && k > 1 {
            return (k - 1, of.method());
        }
        history.iterations.push(line(k));
    }
    (usize::MAX, of.method())
}

#[test]
fn a_stage_that_makes_no_progress_ends_with_its_budget() {
    let mut of = schedule(&[Trait::Contact]);
    assert_eq!(stage_after(&mut of, |k| iteration(1.0, 1.0, k as u64)), (25, Method::Natural));
}

#[test]
fn a_stage_goes_on_beyond_its_budget_while_the_residual_falls() {
    let mut of = schedule(&[Trait::Contact]);
    let (iterations, _) = stage_after(&mut of, |k| iteration(1.0, 0.9f64.powi(k.min(60) as i32), k as u64));
    // it falls for 60 iterations by a tenth each; four later it has not halved in ten
    assert_eq!(iterations, 64);
}

#[test]
fn a_stage_that_circles_ends_where_a_path_follows() {
    let circle = |k: usize| iteration(1.0, [0.5, 0.4][k % 2], [7, 8][k % 2]);
    let mut of = schedule(&[Trait::Contact, Trait::Affine]);
    assert_eq!(stage_after(&mut of, circle), (STUCK + 1, Method::Path));
    let mut of = schedule(&[Trait::Contact]);
    assert_eq!(stage_after(&mut of, circle).0, 25, "without a path it tries on");
}

#[test]
fn a_stage_whose_steps_come_to_nothing_ends_where_a_path_follows() {
    let mut of = schedule(&[Trait::Contact, Trait::Affine]);
    assert_eq!(stage_after(&mut of, |k| iteration(0.01, 1.0, k as u64)), (STUCK + 1, Method::Path));
    let mut of = schedule(&[Trait::Contact, Trait::Affine]);
    assert_eq!(stage_after(&mut of, |k| iteration(0.5, 1.0, k as u64)).0, 25, "half a step is one");
}

#[test]
fn compliance_ends_after_a_full_step_that_changes_few_points() {
    let at_compliance = || {
        let mut of = schedule(&[Trait::Contact, Trait::Stiff]);
        of.position = 1;
        assert_eq!(of.method(), Method::Compliance);
        assert!(!of.next(&StepHistory::default()));
        of
    };
    let goes_on = |step: f64, changed: f64| {
        let mut of = at_compliance();
        of.hear(step, changed, 1.0);
        !of.next(&StepHistory::default())
    };
    assert!(!goes_on(1.0, 0.05) && goes_on(1.0, 0.2) && goes_on(0.5, 0.0));
}

#[test]
fn the_search_on_the_residual_ends_where_most_steps_are_short() {
    let mut of = schedule(&[]);
    assert_eq!(stage_after(&mut of, |_| iteration(0.1, 1.0, 0)), (PATIENCE, Method::Natural));
    let mut of = schedule(&[]);
    assert_eq!(stage_after(&mut of, |_| iteration(1.0, 1.0, 0)).0, usize::MAX, "full steps may go on");
    let mut of = schedule(&[]);
    let falls = |k: usize| iteration(0.1, 0.8f64.powi(k as i32), 0);
    assert_eq!(stage_after(&mut of, falls).0, usize::MAX, "and so may short ones that help");
}

#[test]
fn after_the_last_stage_the_first_begins_again() {
    let mut of = schedule(&[Trait::Contact]);
    let n = of.stages.len();
    for k in 1..=n {
        of.give_up();
        assert!(of.next(&StepHistory { iterations: vec![iteration(0.1, 1.0, 0)], ..StepHistory::default() }));
        assert_eq!(of.position, k % n);
    }
    assert_eq!((of.method(), of.iterations()), (Method::ActiveSet, 1));
}

#[test]
fn a_step_without_another_stage_stays_in_its_own() {
    let mut of = schedule(&[]);
    of.stages.truncate(1);
    of.give_up();
    assert!(!of.next(&StepHistory::default()));
}

#[test]
fn each_stage_may_be_left_once_for_a_singular_tangent() {
    let mut of = schedule(&[Trait::Contact]);
    assert!(of.leave_singular() && of.leave_singular());
    assert_eq!(of.method(), Method::Residual);
    assert!(!of.leave_singular(), "each of the three has met one");
}

#[test]
fn a_stage_goes_on_with_the_active_set_of_a_frozen_one_before() {
    let mut of = schedule(&[Trait::Contact, Trait::Stiff, Trait::Affine]);
    let continues: Vec<(Method, bool)> = (0..4)
        .map(|position| {
            of.position = position;
            (of.method(), of.continues())
        })
        .collect();
    use Method as M;
    assert_eq!(continues, [(M::ActiveSet, false), (M::Compliance, true), (M::ActiveSet, true), (M::Path, false)]);
}

#[test]
fn the_first_active_sets_of_stiff_contact_are_taken_undamped() {
    let mut of = schedule(&[Trait::Contact, Trait::Stiff]);
    let undamped: Vec<bool> = (0..4)
        .map(|_| {
            of.next(&StepHistory::default());
            of.is_undamped()
        })
        .collect();
    assert_eq!(undamped, [true, true, false, false]);
    assert!(schedule(&[Trait::Contact, Trait::OverConstrained]).is_undamped(), "overstress always is");
}

#[test]
fn overstress_is_that_of_its_own_stage_alone() {
    let mut of = schedule(&[Trait::Contact, Trait::OverConstrained]);
    assert_eq!(of.method(), Method::Overstress);
    assert!(of.overstress() > 0.0 && of.friction() == 1.0);
    of.go_on();
    assert_eq!(of.overstress(), 0.0);
}
