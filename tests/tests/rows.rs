//! Equations whose coefficients lie up to sixty orders of magnitude apart, each measured by what cancels in it.

use wfl_newton::Stop;
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
         start a = 1\nstart b = 1\nstart c = 1\nsteps t = 1 to 1 by 1\n\
         measure a = max(a) on global\nmeasure b = max(b) on global\nmeasure c = max(c) on global\n"
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
        for (name, exact) in [("a", 2.0), ("b", 3.0), ("c", 4.0)] {
            assert_close(&format!("{name} of {factors:?}"), last(&solved, name), exact, 1e-12);
        }
    }
}

#[test]
fn unknowns_sixty_orders_of_magnitude_apart_have_all_their_digits() {
    // x y = 1, so z^3 = 8
    let solved = run("unknown x : scalar global\nunknown y : scalar global\nunknown z : scalar global\n\
         term small on global : (x - 1e-30*exp(-z))*Test_x\n\
         term large on global : (y - 1e30*exp(z))*Test_y\n\
         term third on global : (x*y + z^3 - 9)*Test_z\n\
         start x = 1e-30\nstart y = 1e30\nstart z = 1\nsteps t = 1 to 1 by 1\n\
         measure x = max(x) on global\nmeasure y = max(y) on global\nmeasure z = max(z) on global\n");
    assert_solved(&solved);
    for (name, exact) in [("x", 1e-30 * (-2f64).exp()), ("y", 1e30 * 2f64.exp()), ("z", 2.0)] {
        assert_close(name, last(&solved, name), exact, 1e-12);
    }
}

#[test]
fn a_small_equation_is_open_although_large_ones_are_solved() {
    // were the residual relative to the largest equation, the start would pass
    let solved = run("unknown x : scalar global\nunknown y : scalar global\n\
         term large on global : 1e20*(x^3 + x - 2)*Test_x\n\
         term small on global : 1e-20*(y^3 + y - 10*x)*Test_y\n\
         start x = 1\nstart y = 1\nsteps t = 1 to 1 by 1\nmeasure y = max(y) on global\n");
    assert!(assert_solved(&solved) > 0);
    assert_close("y", last(&solved, "y"), 2.0, 1e-12);
}

#[test]
fn an_equation_of_one_summand_is_measured_by_its_factors_or_its_function() {
    // the fixed point of the cosine (Dottie number)
    for (equation, exact) in [
        ("cos(x) - x", 0.739_085_133_215_160_6),
        ("1e-25*(cos(x) - x)*exp(x)", 0.739_085_133_215_160_6),
        ("log(x/1e-12)", 1e-12),
        ("(x - 3e-9)*(x + 1)", 3e-9),
        ("exp(1e3*x) - 2", 2f64.ln() / 1e3),
    ] {
        let start = if equation.contains("1e-12") { "1e-14" } else { "1e-3" };
        let solved = run(&format!(
            "unknown x : scalar global\nterm one on global : ({equation})*Test_x\nstart x = {start}\n\
             steps t = 1 to 1 by 1\nmeasure x = max(x) on global\n"
        ));
        assert_solved(&solved);
        assert_close(equation, last(&solved, "x"), exact, 1e-9);
    }
}

#[test]
fn affine_equations_without_a_constant_are_relative_to_what_cancels() {
    let solved = run("unknown x : scalar global\nunknown y : scalar global\n\
         term first  on global : (1e30*x - 3e-30*y)*Test_x\n\
         term second on global : (y - 1e30)*Test_y\nsteps t = 1 to 1 by 1\n\
         measure x = max(x) on global\n");
    assert_solved(&solved);
    assert_close("x", last(&solved, "x"), 3e-30, 1e-14);
}

#[test]
fn each_node_of_a_scalar_on_a_mesh_has_the_scale_of_its_own_equation() {
    // y = exp(-40 x) at the nodes, from 1 to 4e-18
    let text = "mesh box [0] to [1] cells [8] segment\nunknown y : scalar\n\
         term law on all : (log(y) + 40*X(1))*Test_y\nstart y = 1e-3\nsteps t = 1 to 1 by 1\n\
         measure top = max(y) on all\n";
    let solved = solve(&examples(), text.to_owned(), &[], &[]).unwrap_or_else(|messages| panic!("{messages}"));
    let history = &solved.outcome.steps.last().expect("a step").history;
    assert_eq!(history.stop, Some(Stop::Tolerance));
}
