//! Two bodies in one field that nothing connects are solved as if each had a field of its own: beside a load of 1e7 on one, the
//! other is in balance with its own load, and its digits are its own.

use wfl_gradient::Gradients;
use wfl_tests::{
    Solved, differentiated, examples,
    ranks::{self, Holding, Shared},
    solved,
};

/// Two bars that end in one place: a linear one under `heavy`, and one that stiffens with the cube of its strain under
/// `light`. `joined` are terms on the place where they end.
fn bars(light: f64, steps: &str, joined: &str) -> String {
    format!(
        "param light = {light:e}\nmesh box [0] to [2] cells [6] segment\nregion first = cells where x < 1\n\
         region second = cells where x > 1\nregion cut = interface from first to second\nregion ends = faces where x*(2 - x) == 0\n\
         unknown u : scalar P1\nsplit u across cut\ndef there(v) = Interpolate(v, neighbor_element)\n\
         term stiff on first : Grad_u(1)*Grad_Test_u(1)\n\
         term stiffening on second : (Grad_u(1) + Grad_u(1)^3/light^2)*Grad_Test_u(1)\nfix u = 0 on ends\n{steps}\
         term pull on cut : -1e7*Test_u - light*there(Test_u)\n{joined}measure left = integral(u) on first\n\
         measure right = integral(u) on second\n"
    )
}

/// Of g + g^3 = 1, and half of it: the integral over a bar.
const ROOT: f64 = 0.682_327_803_828_019_3;

fn digits(found: &Solved) -> f64 {
    found.outcome.steps.last().and_then(|step| step.accuracy.as_ref()).map_or(16.0, |accuracy| accuracy.digits())
}

#[test]
fn a_light_load_is_balanced_beside_a_heavy_one() {
    for light in [1e-3, 1e-4, 1e-6, 1e-8, 1e-12, 1e-30] {
        let found = solved(bars(light, "", ""));
        let right = found.measure(0, "right");
        assert!((right / light - 0.5 * ROOT).abs() < 1e-10, "{light:e}: {right:e}");
        assert!((found.measure(0, "left") - 5e6).abs() < 1e-3, "{light:e}");
        assert!(digits(&found) > 8.0, "{light:e}");
    }
}

#[test]
fn each_step_balances_it() {
    let found = solved(bars(1e-7, "steps t = 1 to 3 by 1\n", "term more on cut : -t*t*1e-7*there(Test_u)\n"));
    for (step, load) in [(0, 2.0f64), (1, 5.0), (2, 10.0)] {
        // s + s^3 = load
        let mut s = load.cbrt();
        (0..60).for_each(|_| s -= (s + s * s * s - load) / (1.0 + 3.0 * s * s));
        let right = found.measure(step, "right") / 1e-7;
        assert!((right - 0.5 * s).abs() < 1e-9 * s, "{step}: {right} {s}");
    }
}

#[test]
fn ranks_judge_the_bodies_that_one_does() {
    let shared = Shared::text(&examples(), bars(1e-8, "", ""), &[]);
    let whole = ranks::solved(shared.whole());
    for holding in [Holding::Whole, Holding::Parts] {
        for of in shared.on_ranks(2, holding, ranks::solved) {
            let (is, should) = (&of.steps[0].measures, &whole.steps[0].measures);
            for (is, should) in is.iter().zip(should) {
                assert!((is.1 - should.1).abs() <= 1e-12 * should.1.abs(), "{holding:?}: {is:?} {should:?}");
            }
            assert!((is[1].1 / 1e-8 - 0.5 * ROOT).abs() < 1e-10, "{holding:?}");
            assert_eq!(of.steps[0].history.n_iterations(), whole.steps[0].history.n_iterations(), "{holding:?}");
        }
    }
}

/// A derivative of what the light load does: d right / d light, at fixed slope of the law.
#[test]
fn derivatives_of_the_light_body_are_right() {
    let text = bars(1e-6, "", "param more = 0\nterm extra on cut : -more*there(Test_u)\n");
    let found = differentiated((&*examples(), text), &[], &[], "right", "more");
    let (_, derivatives): (Solved, Gradients) = found.unwrap_or_else(|e| panic!("{e}"));
    let is = derivatives.number("right", "more").expect("a number");
    let should = 0.5 / (1.0 + 3.0 * ROOT * ROOT);
    assert!((is - should).abs() < 1e-9, "{is} {should}");
}

/// Bodies that a term connects share a measure: a spring between them brings the forces of one to the other.
#[test]
fn bodies_that_a_spring_connects_are_judged_together() {
    let found = solved(bars(1e-4, "", "term spring on cut : 1e-30*(u - there(u))*(Test_u - there(Test_u))\n"));
    assert_eq!(found.scene.system.n_bodies(), found.scene.system.fields.len());
    let found = solved(bars(1e-4, "", ""));
    assert_eq!(found.scene.system.n_bodies(), found.scene.system.fields.len() + 1);
}

/// Cells of a discontinuous field that no term connects are one body where the mesh is one: a projection has as many as it has
/// fields.
#[test]
fn a_projection_on_cells_is_one_body() {
    let found = solved(
        "mesh box [0,0] to [2,1] cells [20,10] quad\nunknown q : scalar DQ0\nterm same on all : (q - x)*Test_q\n\
         measure m = integral(q) on all\n",
    );
    assert_eq!(found.scene.system.n_bodies(), 1);
    assert!((found.measure(0, "m") - 2.0).abs() < 1e-13);
}
