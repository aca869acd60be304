//! Nothing depends on the directions of the axes: scenes that are turned as a whole.

use super::{Ran, run};

/// The number in a line of what is printed, behind some words.
fn number(ran: &Ran, behind: &str) -> f64 {
    let found =
        ran.text.split(behind).nth(1).and_then(|text| text.split([' ', ';', '\n']).find(|word| !word.is_empty()));
    found.and_then(|word| word.trim_end_matches('.').parse().ok()).unwrap_or_else(|| panic!("{behind}: {}", ran.text))
}

/// A block pressed on a penalty along a direction in the plane, and in space along the diagonal of it and the third axis.
fn pressed(dim: usize, angle: f64, tilt: f64, more: &str) -> String {
    let head = format!("param a = {angle}\nparam b = {tilt}\n");
    let (mesh, up) = if dim == 2 {
        (
            "mesh box [0,0] to [1,1] cells [2,2] quad map [cos(a)*x-sin(a)*y, sin(a)*x+cos(a)*y]",
            "def up = [-sin(a),cos(a)]\ndef side = [cos(a),sin(a)]",
        )
    } else {
        (
            "mesh box [0,0,0] to [1,1,1] cells [2,2,2] hex map [cos(b)*(cos(a)*x-sin(a)*y)+sin(b)*z, sin(a)*x+cos(a)*y, \
             -sin(b)*(cos(a)*x-sin(a)*y)+cos(b)*z]",
            "def up = [-cos(b)*sin(a),cos(a),sin(b)*sin(a)]\ndef side = [cos(b)*cos(a),sin(a),-sin(b)*cos(a)]",
        )
    };
    format!(
        "{head}{mesh}\n{up}\nregion floor = faces where abs(X.up) < 1e-9\nregion top = faces where abs(X.up-1) < 1e-9\n\
         unknown u : vector\nterm block on all : 100*Sym(Grad_u):Grad_Test_u\n{more}"
    )
}

#[test]
fn an_overlap_is_a_length_along_any_axis() {
    let law = "param gamma = 300\ndef p = gamma*pos_part(u.Normal)\nterm contact on floor : p*Normal.Test_u\n\
               fix u = -0.01*up on top\nmeasure P = integral(p) on floor\n";
    for dim in [2, 3] {
        for (angle, tilt) in [(0.0, 0.0), (0.5, 0.0), (0.8, 0.0), (0.8, 0.6155)] {
            let ran = run(&format!("pressed-{dim}-{angle}-{tilt}"), &pressed(dim, angle, tilt, law), &[]);
            assert!(ran.code == 0 && ran.tells("W606"), "{dim} {angle} {tilt}: {}", ran.text);
            let overlap = ran.last("P") / 300.0;
            let told = [number(&ran, "the sides overlap by "), number(&ran, "the largest displacement is ")];
            assert!((told[0] / overlap - 1.0).abs() < 1e-3, "{dim} {angle} {tilt}: {overlap} {told:?}");
            assert!((told[1] - 0.01).abs() < 1e-5, "{dim} {angle} {tilt}: {told:?}");
        }
    }
}

/// A block that sticks to a floor by a penalty along it and is pulled there.
#[test]
fn a_slip_is_a_length_along_any_axis() {
    let law = "param gamma = 300\ndef Pn = 1e6*(u.Normal)\ndef Pt = gamma*(u - (u.Normal)*Normal)\n\
               term contact on floor : (pos_part(Pn)*Normal + Ball_projection(Pt, 10*pos_part(Pn))).Test_u\n\
               fix u = -0.01*up + 0.008*side on top\nmeasure T = integral(Norm(Pt)) on floor\n";
    for dim in [2, 3] {
        let mut slips = Vec::new();
        for (angle, tilt) in [(0.0, 0.0), (0.5, 0.0), (0.8, 0.0), (0.8, 0.6155)] {
            let ran = run(&format!("sheared-{dim}-{angle}-{tilt}"), &pressed(dim, angle, tilt, law), &[]);
            assert!(ran.code == 0, "{dim} {angle} {tilt}: {}", ran.text);
            slips.push(number(&ran, "slip of sticking points at `contact`: "));
        }
        assert!(slips.iter().all(|slip| (slip / slips[0] - 1.0).abs() < 0.02), "{dim}: {slips:?}");
    }
}
