//! Conditions of mechanics: what violates them on purpose is noticed. That right scenes are silent is tested with the
//! examples.

use wfl_tests::{Solved, doubts, examples, solve};

/// A scene of the examples on a small mesh with changes, each of which must be possible.
fn changed(path: &str, edits: &[(&str, &str)], params: &[(&str, f64)]) -> Solved {
    let folder = examples().join("fault");
    let text = std::fs::read_to_string(folder.join(path)).expect("examples can be read");
    let mut all = vec![
        ("cells [8, 8, 8]", "cells [4, 4, 4]".to_owned()),
        ("steps t = 0 to 9.5 by 0.5", "steps t = 8 to 8 by 1".to_owned()),
    ];
    for (from, to) in edits {
        assert!(text.contains(from), "{from}");
        all.push((from, (*to).to_owned()));
    }
    let solved = solve(&folder, text, &all, params).expect("the scene can be solved");
    assert!(solved.outcome.converged());
    solved
}

/// Codes and texts of the warnings about the numbers.
fn warnings(solved: &Solved) -> Vec<(&'static str, String)> {
    doubts(&solved.outcome)
}

fn warned(solved: &Solved, start: &str) -> bool {
    warnings(solved).iter().any(|(code, text)| *code == "W606" && text.starts_with(start))
}

#[test]
fn the_scene_as_it_is_gives_no_warning() {
    for path in ["penalty.wfl", "nitsche.wfl", "augmented_lagrangian.wfl"] {
        assert_eq!(warnings(&changed(path, &[], &[])), [], "{path}");
    }
}

#[test]
fn friction_that_drives_is_noticed() {
    let edit = [("Ball_projection(Pt, fric*pos_part(Pn))", "(-Ball_projection(Pt, fric*pos_part(Pn)))")];
    let solved = changed("penalty.wfl", &edit, &[]);
    assert!(warned(&solved, "friction along the slip at `contact`"), "{:?}", warnings(&solved));
}

#[test]
fn a_force_on_one_side_only_is_noticed() {
    let edit = [("force.jump(Test_uL,Test_uR)", "force.Test_uL")];
    let solved = changed("penalty.wfl", &edit, &[]);
    assert!(warned(&solved, "action and reaction of `contact`"), "{:?}", warnings(&solved));
}

#[test]
fn a_penalty_too_soft_to_hold_is_noticed() {
    let solved = changed("penalty.wfl", &[], &[("gamma", 1e3)]);
    assert!(warned(&solved, "penetration at `contact`"), "{:?}", warnings(&solved));
}

/// A friction bound with a part of its own (here one that grows with the gap) is no contact law: what enters nothing
/// but the bound is no overlap.
#[test]
fn a_second_positive_part_in_the_friction_bound_is_no_overlap() {
    let bound = "fric*(pos_part(Pn) + pos_part(gamma*(0.01 + 0.5*jump(uL,uR).Normal)))";
    let edit = [("Ball_projection(Pt, fric*pos_part(Pn))", format!("Ball_projection(Pt, {bound})"))];
    let edit = edit.each_ref().map(|(from, to)| (*from, to.as_str()));
    for path in ["penalty.wfl", "nitsche.wfl", "augmented_lagrangian.wfl"] {
        assert_eq!(warnings(&changed(path, &edit, &[])), [], "{path}");
    }
    // the overlap of a soft contact is still seen beside it
    let solved = changed("penalty.wfl", &edit, &[("gamma", 1e3)]);
    assert!(warned(&solved, "penetration at `contact`"), "{:?}", warnings(&solved));
}

/// The reactions of a column under a load are the load.
#[test]
fn reactions_are_told_and_balance_the_loads() {
    let text = "mesh box [0,0] to [1,4] cells [2,8] quad\nunknown u : vector\nregion foot = faces where y == 0\n\
                region head = faces where y == 4\nterm bulk on all : Grad_u:Grad_Test_u\nload u = [0.25,-3] on head\n\
                fix u = [0,0] on foot\nmeasure sink = mean(u(2)) on head\n";
    let solved = solve(&examples(), text.to_owned(), &[], &[]).expect("the scene is right");
    let checks = &solved.outcome.steps[0].checks;
    let balance = checks.iter().find(|c| c.name == "equilibrium of u").expect("a check");
    assert!(balance.holds() && balance.value < 1e-12, "{}", balance.value);
    let forces = balance.detail.split(", moments").next().unwrap_or_default();
    let numbers: Vec<f64> = forces
        .split(|c: char| !"0123456789.e-".contains(c))
        .filter(|w| w.contains(|c: char| c.is_ascii_digit()))
        .map(|w| w.parse().expect("a number"))
        .collect();
    let expected = [0.25, -3.0, -0.25, 3.0];
    assert_eq!(numbers.len(), 4, "{}", balance.detail);
    assert!(numbers.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{numbers:?}");
}

#[test]
fn a_scene_without_contact_and_displacements_is_not_looked_at() {
    let text = "mesh box [0] to [1] cells [8] segment\nunknown c : scalar\nterm flow on all : Grad_c.Grad_Test_c\n\
                load c = 1 on all\nfix c = 0 on boundary\n";
    let solved = solve(&examples(), text.to_owned(), &[], &[]).expect("the scene is right");
    assert!(solved.outcome.steps[0].checks.is_empty());
}

/// The value found is twice the bound that the message of a small parameter names, and the scene is solved with it.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn an_automatic_parameter_is_safe() {
    let folder = examples().join("fault");
    let text = std::fs::read_to_string(folder.join("nitsche.wfl")).expect("examples can be read");
    let text = text.replace("param gamma = 1e5 ", "param gamma = auto ");
    let edits = [
        ("steps t = 0 to 9.5 by 0.5", "steps t = 8 to 8 by 1".to_owned()),
        ("cells [8, 8, 8]", "cells [4, 8, 8]".to_owned()),
    ];
    let solved = solve(&folder, text.clone(), &edits, &[("theta", 1.0)]).expect("the scene can be solved");
    assert!(solved.outcome.converged());
    let gamma = solved.scene.params.iter().find(|p| p.0 == "gamma").expect("a param").1.values[0];
    // the constant of cubes, here of size 1/2, is 1.704 E/h (independent dense program)
    assert!((gamma / (2.0 * 1.704 * 25_000.0 / 0.5) - 1.0).abs() < 1e-3, "{gamma}");
    let penalty = std::fs::read_to_string(folder.join("penalty.wfl")).expect("examples can be read");
    let refused = solve(&folder, penalty.replace("= 1e5 ", "= auto "), &edits, &[]).err().expect("no value");
    assert!(refused.contains("E417") && refused.contains("no term has the stress"), "{refused}");
}
