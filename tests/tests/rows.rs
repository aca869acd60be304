//! Equations whose coefficients lie up to sixty orders of magnitude apart, each measured by what cancels in it.

use wfl_tests::{Solved, examples, solve};

fn run(text: &str) -> Solved {
    let head = "mesh box [0] to [1] cells [1] segment with idle_cells=allowed\n";
    solve(&examples(), format!("{head}{text}"), &[], &[]).unwrap_or_else(|messages| panic!("{messages}"))
}

/// The last step is within the tolerance, and its residual is told as it is. How many iterations it took.
fn assert_solved(solved: &Solved) -> usize {
    let history = &solved.outcome.steps.last().expect("a step").history;
    let last = history.iterations.last().expect("it was measured");
    assert!(history.converged(), "{:?}: residual {:e}", history.stop, last.residual);
    assert!(last.residual <= 1e-10, "{:?}: residual {:e}, floor {:e}", history.stop, last.residual, last.floor);
    history.n_iterations()
}

fn last(solved: &Solved, name: &str) -> f64 {
    solved.measure(solved.outcome.steps.len() - 1, name)
}

fn assert_close(what: &str, found: f64, exact: f64, tolerance: f64) {
    assert!((found / exact - 1.0).abs() <= tolerance, "{what}: {found:e}, exact {exact:e}");
}

/// a = 2, b = 3, c = 4, whatever the equations are multiplied by.
fn three(factors: [&str; 3]) -> Solved {
    let [p, q, r] = factors;
    run(&format!(
        "unknown a : scalar global\nunknown b : scalar global\nunknown c : scalar global\n\
         term first  on global : {p}*(a*b - 6)*Test_a\n\
         term second on global : {q}*(b^2*c - 36)*Test_b\n\
         term third  on global : {r}*(c - 2*a + a*c - 8)*Test_c\n\
         start a = 1.5\nstart b = 2.5\nstart c = 3.5\nsteps t = 1 to 1 by 1\n\
         measure of_a = max(a) on global\nmeasure of_b = max(b) on global\nmeasure of_c = max(c) on global\n"
    ))
}

#[test]
fn factors_of_equations_change_neither_the_answer_nor_the_iterations() {
    let expected = assert_solved(&three(["1", "1", "1"]));
    assert!(expected < 20, "{expected} iterations");
    for factors in [["1e30", "1e-30", "1"], ["1e-30", "1", "1e30"], ["1e30", "1e30", "1e-30"], ["-1e-30", "1", "1e15"]]
    {
        let solved = three(factors);
        assert_eq!(assert_solved(&solved), expected, "{factors:?}");
        for (name, exact) in [("of_a", 2.0), ("of_b", 3.0), ("of_c", 4.0)] {
            assert_close(&format!("{name} of {factors:?}"), last(&solved, name), exact, 1e-9);
        }
    }
}

#[test]
fn unknowns_sixty_orders_of_magnitude_apart_have_all_their_digits() {
    // r s = 1, so w^3 = 8
    let solved = run("unknown r : scalar global\nunknown s : scalar global\nunknown w : scalar global\n\
         term small on global : (r - 1e-30*exp(-w))*Test_r\n\
         term large on global : (s - 1e30*exp(w))*Test_s\n\
         term third on global : (r*s + w^3 - 9)*Test_w\n\
         start r = 1e-30\nstart s = 1e30\nstart w = 1\nsteps t = 1 to 1 by 1\n\
         measure of_r = max(r) on global\nmeasure of_s = max(s) on global\nmeasure of_w = max(w) on global\n");
    assert_solved(&solved);
    for (name, exact) in [("of_r", 1e-30 * (-2f64).exp()), ("of_s", 1e30 * 2f64.exp()), ("of_w", 2.0)] {
        assert_close(name, last(&solved, name), exact, 1e-9);
    }
}

#[test]
fn a_small_equation_is_open_although_large_ones_are_solved() {
    // were the residual relative to the largest equation, the start would pass
    let solved = run("unknown r : scalar global\nunknown s : scalar global\n\
         term large on global : 1e20*(r^3 + r - 2)*Test_r\n\
         term small on global : 1e-20*(s^3 + s - 10*r)*Test_s\n\
         start r = 1\nstart s = 1\nsteps t = 1 to 1 by 1\nmeasure of_s = max(s) on global\n");
    assert!(assert_solved(&solved) > 0);
    assert_close("of_s", last(&solved, "of_s"), 2.0, 1e-9);
}

#[test]
fn an_equation_of_one_summand_is_measured_by_its_factors_or_its_function() {
    // the fixed point of the cosine (Dottie number)
    for (equation, exact) in [
        ("cos(r) - r", 0.739_085_133_215_160_6),
        ("1e-25*(cos(r) - r)*exp(r)", 0.739_085_133_215_160_6),
        ("log(r/1e-12)", 1e-12),
        ("(r - 3e-9)*(r + 1)", 3e-9),
        ("exp(1e3*r) - 2", 2f64.ln() / 1e3),
    ] {
        let start = if equation.contains("1e-12") { "1e-14" } else { "1e-3" };
        let solved = run(&format!(
            "unknown r : scalar global\nterm one on global : ({equation})*Test_r\nstart r = {start}\n\
             steps t = 1 to 1 by 1\nmeasure of_r = max(r) on global\n"
        ));
        assert_solved(&solved);
        assert_close(equation, last(&solved, "of_r"), exact, 1e-9);
    }
}

#[test]
fn affine_equations_without_a_constant_are_relative_to_what_cancels() {
    let solved = run("unknown r : scalar global\nunknown s : scalar global\n\
         term first  on global : (1e30*r - 3e-30*s)*Test_r\n\
         term second on global : (s - 1e30)*Test_s\nsteps t = 1 to 1 by 1\n\
         measure of_r = max(r) on global\n");
    assert_solved(&solved);
    assert_close("of_r", last(&solved, "of_r"), 3e-30, 1e-14);
}

#[test]
fn each_node_of_a_scalar_on_a_mesh_has_the_scale_of_its_own_equation() {
    // s = exp(-40 x) at the nodes, from 1 to 4e-18
    let text = "mesh box [0] to [1] cells [8] segment\nunknown s : scalar\n\
         term law on all : (log(s) + 40*X(1))*Test_s\nstart s = 1e-3\nsteps t = 1 to 1 by 1\n\
         measure top = max(s) on all\n";
    let solved = solve(&examples(), text.to_owned(), &[], &[]).unwrap_or_else(|messages| panic!("{messages}"));
    assert_solved(&solved);
}
