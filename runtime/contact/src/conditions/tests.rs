use super::*;

fn point<'a>(x: &'a [f64], gap: &'a [f64]) -> Point<'a> {
    Point { x, gap, slope: 10.0, weight: 2.0, turns: false, left: 0.0, pulls: false }
}

#[test]
fn a_face_presses_as_a_whole_where_all_its_points_do() {
    let mut faces = FaceCount::new([2, 2, 3].into_iter());
    [true, true, true, false, false, false, false].into_iter().for_each(|presses| faces.add_point(presses));
    assert_eq!(faces.pressed, PressedFaces { some: 2, whole: 1, of: 3 });
    assert!(!faces.pressed.are_too_large());
}

#[test]
fn faces_are_too_large_for_a_zone_of_contact_that_covers_none() {
    assert!(PressedFaces { some: 2, whole: 0, of: 9 }.are_too_large());
    assert!(!PressedFaces { some: 0, whole: 0, of: 9 }.are_too_large(), "there is no zone");
}

#[test]
fn an_overlap_is_the_argument_over_its_slope_and_a_gap_is_none() {
    let mut found = Violations::default();
    found.add_normal(&point(&[3.0], &[0.5]));
    found.add_normal(&Point { pulls: true, ..point(&[-3.0], &[-70.0]) });
    assert_eq!(found.penetration, 0.05);
    assert_eq!(found.pulled.value(), Some(0.0));
}

#[test]
fn the_area_that_pulls_is_a_part_of_the_area_that_presses() {
    let mut found = Violations::default();
    found.add_normal(&Point { pulls: true, ..point(&[1.0], &[0.0]) });
    found.add_normal(&Point { weight: 6.0, ..point(&[1.0], &[0.0]) });
    assert_eq!(found.pulled.value(), Some(0.25));
}

#[test]
fn a_normal_that_turns_has_no_overlap() {
    let mut found = Violations::default();
    found.add_normal(&Point { turns: true, ..point(&[3.0], &[0.5]) });
    assert_eq!(found.penetration, 0.0);
}

#[test]
fn a_point_within_its_bound_drifts_by_its_elastic_slip() {
    let mut found = Violations { moved: 1.0, ..Violations::default() };
    found.add_tangential(&point(&[0.3, 0.4], &[0.3, 0.4]), 1.0, |_| Some(false));
    assert_eq!(found.drift, 0.05);
    // beyond the bound it slips, which is no drift
    found.add_tangential(&point(&[30.0, 40.0], &[30.0, 40.0]), 1.0, |_| Some(false));
    assert_eq!(found.drift, 0.05);
}

#[test]
fn a_point_that_slides_is_judged_by_its_slip_and_one_that_sticks_by_its_traction() {
    let asked = |x: &[f64], gap: &[f64], radius: f64| {
        let (mut found, mut direction) = (Violations { moved: 1.0, ..Violations::default() }, Vec::new());
        found.add_tangential(&point(x, gap), radius, |along| {
            direction = along.to_vec();
            Some(false)
        });
        direction
    };
    assert_eq!(asked(&[5.0, 0.0], &[4.0, 0.5], 1.0), [4.0, 0.5]);
    assert_eq!(asked(&[0.5, 0.0], &[0.1, 0.2], 1.0), [0.5, 0.0]);
    // most of its slip is elastic
    assert_eq!(asked(&[1.1, 0.0], &[1.0, 0.5], 1.0), [1.1, 0.0]);
}

#[test]
fn a_traction_outside_the_cone_counts_beyond_what_the_mesh_leaves() {
    let cone = |left: f64| {
        let mut found = Violations { moved: 1.0, ..Violations::default() };
        // the traction is x - gap = (3, 0), the bound 2
        found.add_tangential(&Point { left, ..point(&[4.0, 0.0], &[1.0, 0.0]) }, 2.0, |_| Some(false));
        found.cone.value().unwrap()
    };
    assert!((cone(0.0) - 1.0 / 3.0).abs() < 1e-15);
    assert_eq!(cone(1.5), 0.0);
}

#[test]
fn friction_without_a_bound_is_not_looked_at() {
    let mut found = Violations { moved: 1.0, ..Violations::default() };
    found.add_tangential(&point(&[4.0, 0.0], &[1.0, 0.0]), 0.0, |_| unreachable!("the point is open"));
    assert_eq!((found.driven.value(), found.cone.value()), (None, None));
}

#[test]
fn lengths_at_an_elastic_joint_are_strains() {
    let mut found = Violations::default();
    found.add_lengths(&[[0.1, 0.2], [0.7, 0.9], [0.3, 0.0]], &[false, true, false]);
    assert_eq!((found.penetration, found.drift, found.strained), (0.3, 0.2, [0.7, 0.9]));
}

#[test]
fn a_force_that_drives_an_argument_works_and_one_that_resists_does_not() {
    let motions = [Motion { test: 0, slopes: vec![(0, 0)] }, Motion { test: 1, slopes: vec![(1, 1)] }];
    let works = |flux: [f64; 2]| works_along(&flux, &motions, &[1.0, 1.0], &[2.0, 3.0], &[]).unwrap();
    assert!(!works([1.0, 1.0]) && works([-1.0, 0.5]) && !works([0.0, 0.0]));
    assert!(!works([-3.0, 2.0 + 1e-9]), "what cancels has no sign");
}
