use super::{scales::roundoff, *};
use crate::{Silent, test_block::LAPLACE, tests::Solving};

fn norm() -> Norm {
    Norm::new(vec![1.0], false)
}

fn measured(relative: f64, settled: bool, no_force: bool) -> Measured {
    Measured {
        residual: Vec::new(),
        written: Residual::default(),
        summands: Vec::new(),
        relative,
        floor: 0.0,
        left: Vec::new(),
        excess: relative,
        is_open: false,
        is_small: false,
        settled,
        bounded: settled,
        no_force,
        norm: relative,
        rounding: 0.0,
    }
}

#[test]
fn an_iteration_stops_at_the_tolerance_or_where_all_is_rounding_and_says_which() {
    let options = NewtonOptions::default();
    let stop = |relative: f64, settled: bool, no_force: bool| measured(relative, settled, no_force).stop(options);
    assert_eq!(stop(1e-10, true, false), Some(Stop::Tolerance));
    assert_eq!(stop(1e-10, false, false), None, "much of what the step began with is left");
    assert_eq!(stop(1.1e-10, false, false), None);
    assert_eq!(stop(1e-3, true, false), Some(Stop::Floor));
    assert_eq!(stop(1e-11, false, true), Some(Stop::Floor), "against rounding it is no tolerance");
    assert_eq!(stop(f64::NAN, false, false), None);
}

#[test]
fn tiny_unknowns_have_fewer_digits() {
    assert_eq!([roundoff(0.0), roundoff(1.0), roundoff(1e300)], [f64::EPSILON; 3]);
    assert!(roundoff(1e-320) > 1e-4, "{}", roundoff(1e-320));
}

#[test]
fn what_rounding_takes_from_a_state_is_known_exactly() {
    let mut rounding = Rounding::default();
    let (start, change) = ([1.0, 2.0], [1e-17, 0.5]);
    let state = [start[0] + change[0], start[1] + change[1]];
    rounding.note(&start, &change, &state);
    assert_eq!(rounding.clone().of(&state), [1e-17, 0.0]);
    assert_eq!(rounding.of(&[1.0, 2.0]), [0.0; 2], "nothing is known of another state");
}

#[test]
fn a_residual_is_relative_to_the_largest_force_and_small_where_forces_balance() {
    let mut solving = Solving::new(&[LAPLACE, "[0,2].Test_u"], &[]);
    let solution = solving.block.moved([0.0, -1.0], [0.0; 2]);
    let half = solving.block.moved([0.0, -0.5], [0.0; 2]);
    solving.with(&mut Silent, |step, u| {
        let at = |u: &[f64]| step.measure(u, &norm()).unwrap();
        let (rest, half, found) = (at(u), at(&half), at(&solution));
        assert!((half.relative / rest.relative - 0.5).abs() < 1e-14);
        assert!(found.relative < 1e-15 && found.stop(step.options).is_some() && rest.stop(step.options).is_none());
    });
}

#[test]
fn a_norm_counts_free_dofs_alone_and_neither_overflows_nor_vanishes() {
    let mut solving = Solving::new(&[LAPLACE], &[]);
    solving.with(&mut Silent, |step, u| {
        let free = &step.system.numbering.free;
        let with = |size: f64| -> Vec<f64> { free.iter().map(|f| if *f == FIXED { 1e9 } else { size }).collect() };
        assert_eq!(u.len(), 8);
        for size in [1e-200, 1.0, 1e200] {
            assert!((step.weighted_norm(&with(size), &norm()) / (2.0 * size) - 1.0).abs() < 1e-14, "{size}");
        }
        assert_eq!(step.weighted_norm(&with(0.0), &norm()), 0.0);
    });
}

#[test]
fn a_state_that_is_not_finite_has_no_measure() {
    let mut solving = Solving::new(&[LAPLACE], &[]);
    solving.with(&mut Silent, |step, u| {
        u[0] = f64::NAN;
        assert!(step.measure(u, &norm()).is_err());
    });
}

#[test]
fn lines_of_a_history_go_on_counting_by_the_corrections_they_took() {
    let mut solving = Solving::new(&[LAPLACE], &[]);
    solving.with(&mut Silent, |step, u| {
        let (here, mut history) = (step.measure(u, &norm()).unwrap(), StepHistory::default());
        for corrections in [0, 3, 1] {
            step.record(&mut history, &here, Done { method: Method::Start, step: 1.0, changed: 0, corrections });
        }
        assert_eq!(history.iterations.iter().map(|i| i.number).collect::<Vec<_>>(), [0, 3, 4]);
        assert_eq!(step.spent.iterations, 4);
    });
}
