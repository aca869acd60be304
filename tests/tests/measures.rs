//! Numbers that measures make: `measure k = F/d`, with reductions of their own, read by `expect`, events and each other.

use wfl_tests::{Solved, examples, solve};

/// A bar of length 2 and cross section 1 that is pulled: stiffness E/L.
const BAR: &str = "\
mesh box [0,0] to [2,1] cells [4,2] quad
param E = 100
region west = faces where x == 0
region east = faces where x == 2
unknown u : scalar
term bar on all : E*Grad_u.Grad_Test_u
fix u = 0 on west
fix u = 0.3*t on east
steps t = 0.5 to 1 by 0.5
measure F = reaction(u) on west
measure d = max(u) on east
";

fn run(more: &str) -> Solved {
    solve(&examples(), format!("{BAR}{more}"), &[], &[]).unwrap_or_else(|e| panic!("{e}"))
}

fn refused(more: &str) -> String {
    solve(&examples(), format!("{BAR}{more}"), &[], &[]).err().unwrap_or_else(|| panic!("{more} is taken"))
}

fn close(found: f64, expected: f64) {
    assert!((found / expected - 1.0).abs() < 1e-12, "{found}, expected {expected}");
}

#[test]
fn a_number_of_measures_is_that_of_the_closed_form_at_each_step() {
    let solved = run(
        "measure k = F/d\nmeasure twice = 2*k + t\nexpect abs(k - 50) < 1e-9\nexpect abs(twice - 2*k - t) < 1e-9 and t > 0.4\n",
    );
    for step in 0..2 {
        close(solved.measure(step, "k").abs(), 50.0);
        let twice = 2.0 * solved.measure(step, "k") + 0.5 * (step + 1) as f64;
        close(solved.measure(step, "twice"), twice);
    }
    let names: Vec<&str> = solved.outcome.steps[0].measures.iter().map(|m| m.0.as_str()).collect();
    assert_eq!(names, ["F", "d", "k", "twice"]);
    assert_eq!(solved.outcome.expectations.len(), 2);
    assert!(solved.outcome.expectations.iter().all(|(_, holds)| *holds == Some(true)));
}

#[test]
fn reductions_may_stand_in_it() {
    // the centre of what is linear on [0, 2]: 4/3
    let solved = run("measure centre = integral(u*x)/integral(u) on all\n");
    close(solved.measure(1, "centre"), 4.0 / 3.0);
    let solved = run("measure stretch = (max(u) - min(u))/2 on all\nmeasure s = integral(1) on all\n");
    close(solved.measure(1, "s"), 2.0);
    assert!(solved.measure(1, "stretch") > 0.1);
}

/// A quarter of a circle of radius 2 by edges of second order: its length is that of the arcs, whatever stands there.
#[test]
fn the_length_of_a_curve_does_not_depend_on_the_terms_there() {
    let ring = "mesh box [0,0] to [1,1] cells [1,4] quad map [(1 + x)*cos(1.5707963267948966*y), \
                (1 + x)*sin(1.5707963267948966*y)]\nregion outer = faces where x^2 + y^2 > 3.9\nunknown u : scalar Q2\n\
                term f on all : u*Test_u - Test_u\nmeasure length = integral(1) on outer\n";
    let length = |more: &str| {
        let solved = solve(&examples(), format!("{ring}{more}"), &[], &[]).unwrap_or_else(|e| panic!("{e}"));
        solved.measure(0, "length")
    };
    let alone = length("");
    assert!((alone / std::f64::consts::PI - 1.0).abs() < 1e-4, "{alone}");
    assert_eq!(alone, length("load u = 1 on outer\n"));
}

#[test]
fn events_and_numbers_below_may_read_it() {
    let solved = run("measure k = F/d\nevent large = abs(k)*d + integral(0*u) > 10 on all\nexpect large_count == 1\n");
    assert!(solved.outcome.expectations.iter().all(|(_, holds)| *holds == Some(true)));
}

#[test]
fn what_cannot_be_meant_is_told_with_its_place() {
    for (more, code, words) in [
        ("measure k = max(u)", "E113", "is taken on a region"),
        ("measure k = F/q", "E201", "q"),
        ("measure k = F/d on west", "E113", "found no reduction"),
        ("measure k = [F, d]", "E108", "a measure is a scalar"),
        ("measure k = 2*l\nmeasure l = 2*k", "E", "l"),
        ("measure k = F/u", "E201", "`u`"),
        ("measure F = 2*d", "E", "F"),
    ] {
        let told = refused(more);
        assert!(told.contains(code) && told.contains(words), "{more}: {told}");
    }
}

/// Parts of a displacement and of a stress that has all entries, at a place where the direction away is [0.8, 0.6] and the one
/// around is [-0.6, 0.8]: each sign counts.
#[test]
fn polar_parts_are_products_with_their_directions() {
    let text = "wfl 1
use \"polar\"
mesh box [0.5,0.2] to [2,2] cells [2,2] quad
unknown u : vector
term body on all : Sym(Grad_u):Grad_Test_u
fix u = [x + 2*y, 3*x] on boundary
def c = [0.5, 0]
def s = [1, 2; 2, 5]
measure outward = value(radial(u, c)) at [1.3, 0.6]
measure around  = value(hoop(u, c)) at [1.3, 0.6]
measure radial_ = value(radial_stress(s, c)) at [1.3, 0.6]
measure hoop_   = value(hoop_stress(s, c)) at [1.3, 0.6]
measure shear_  = value(shear_stress(s, c)) at [1.3, 0.6]
";
    let found = solve(&examples(), text.to_owned(), &[], &[]).unwrap_or_else(|e| panic!("{e}"));
    // u = [2.5, 3.9]
    close(found.measure(0, "outward"), 0.8 * 2.5 + 0.6 * 3.9);
    close(found.measure(0, "around"), 0.8 * 3.9 - 0.6 * 2.5);
    close(found.measure(0, "radial_"), 0.64 + 0.96 * 2.0 + 0.36 * 5.0);
    close(found.measure(0, "hoop_"), 0.36 - 0.96 * 2.0 + 0.64 * 5.0);
    close(found.measure(0, "shear_"), 0.48 * (5.0 - 1.0) + 0.28 * 2.0);
}
