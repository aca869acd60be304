//! Newton stays in the basin of the equilibrium that the loads lead to; instability is told, and the branch that buckles is
//! found where it is asked for.

use super::{Ran, run};

/// A neo-Hookean block, 15 wide and 10 high, into which a rigid circle of radius 5 is pressed by `depth` at t = 1; the right
/// energy is that of one step, the limit of steps however small, and that of Newton's method with backtracking alone.
fn indented(name: &str, steps: &str, law: &str) -> Ran {
    let scene = format!(
        "{steps}\nparam depth = 0.2\nmesh box [0,-10] to [15,0] cells [9,6] quad\nregion top = faces where y == 0\n\
         region base = faces where y == -10\nregion axis = faces where x == 0\nunknown u : vector Q2\n\
         def F = Id(2) + Grad_u\ndef J = Det(F)\ndef W = {law}\n\
         def overlap = pos_part(5 - Norm(X + u - [0, 5 - depth*t]))\n\
         energy stored on all : W\nenergy contact on top : 500*sqr(overlap)\n\
         fix u = [0,0] on base\nfix u(1) = 0 on axis\nmeasure stored = integral(W) on all\nmeasure least = min(J) on all\n"
    );
    run(name, &scene, &[])
}

const LOGARITHMIC: &str = "0.5*(Trace(F'*F) - 2 - 2*log(J)) + 2*sqr(log(J))";
const QUADRATIC: &str = "0.5*(Trace(F'*F) - 2 - 2*log(J)) + 2*sqr(J - 1)";

#[test]
fn an_indentation_has_one_energy_however_the_steps_are_chosen() {
    for (law, name) in [(LOGARITHMIC, "log"), (QUADRATIC, "quad")] {
        let right = indented(&format!("indent-{name}-one"), "param t = 1", law).last("stored");
        for (k, steps) in ["0 to 1 by 1", "0 to 1 by 0.25", "0.5 to 1 by 0.5", "0 to 1 by 0.1"].iter().enumerate() {
            let ran = indented(&format!("indent-{name}-{k}"), &format!("steps t = {steps}"), law);
            assert_eq!(ran.code, 0, "{}", ran.text);
            let stored = ran.last("stored");
            assert!((stored / right - 1.0).abs() < 1e-6, "{name}, {steps}: {stored} for {right}\n{}", ran.text);
            assert!(ran.last("least") > 0.9, "{name}, {steps}");
            assert!(!ran.tells("W640") && !ran.tells("W641"), "{}", ran.text);
        }
    }
}

/// A column of length 1 and width 1/20, clamped below, under `times` Euler's load of a free upper end.
fn column(name: &str, times: f64, more: &str, words: &[&str]) -> Ran {
    let scene = format!(
        "param times = {times}\nparam h = 0.05\nmesh box [0,0] to [h,1] cells [2,20] quad\nregion low = faces where y == 0\n\
         region top = faces where y == 1\nunknown u : vector Q2\ndef la = 300/0.52\ndef mu = 500/1.3\n\
         def P = pi^2*(1000/0.91)*h^3/48\ndef F = Id(2) + Grad_u\n\
         term body on all : (F*Saint_Venant_Kirchhoff_PK2(Grad_u,[la;mu])):Grad_Test_u\nfix u = [0,0] on low\n\
         load u = [0, -times*t*P/h] on top\nsteps t = 0.25 to 1 by 0.25\nmeasure side = mean(u(1)) on top\n\
         measure down = mean(-u(2)) on top\n{more}\n"
    );
    run(name, &scene, words)
}

/// Euler: P = pi^2 E' I/(4 L^2) (Timoshenko and Gere, Theory of Elastic Stability, 2.2). The mesh is stiffer by 1e-3, and
/// the shortening and shear of so thick a column make up for less than 1e-2.
#[test]
fn eulers_load_is_the_first_that_is_told() {
    column("euler-below", 0.95, "", &[]).assert_silent();
    let ran = column("euler-above", 1.05, "", &[]);
    assert_eq!((ran.code, ran.codes()), (0, vec!["W640"]), "{}", ran.text);
    assert!(ran.text.contains("at t = 1 the equilibrium") && ran.text.contains("in 1 direction"), "{}", ran.text);
    // 9 is the second critical load: (3 pi/2)^2 for (pi/2)^2
    let ran = column("euler-two", 10.0, "", &[]);
    assert!(ran.text.contains("at t = 0.25 the equilibrium") && ran.tells("W640"), "{}", ran.text);
}

/// Three times Euler's load: the elastica of a thin column has its end at 0.7074 to the side and 1.2041 down; for width 1/20
/// in quadratic elements a force to the side of 1e-4 of the load leads to 0.7019 and 1.2196.
#[test]
fn the_branch_that_buckles_is_found() {
    for (name, more, words) in
        [("euler-word", "", &["perturb=1e-6"] as &[&str]), ("euler-statement", "solver newton with perturb=1e-3", &[])]
    {
        let ran = column(name, 3.0, more, words);
        assert_eq!((ran.code, ran.codes()), (0, Vec::new()), "{}", ran.text);
        let (side, down) = (ran.last("side").abs(), ran.last("down"));
        assert!((side - 0.7019).abs() < 5e-3 && (down - 1.2196).abs() < 1e-2, "{side} {down}");
    }
    assert!(column("euler-stays", 3.0, "", &[]).last("side").abs() < 1e-9);
}

/// The column on a floor with friction, held by a vector multiplier, and of two halves tied by one: a multiplier adds as many
/// roots of the other sign as it has unknowns, whichever way its equations are written.
#[test]
fn eulers_load_is_told_beside_multipliers_and_friction() {
    let scene = |times: f64, more: &str| {
        format!(
            "param h = 0.05\nmesh box [0,0] to [h,1] cells [2,20] quad\nregion low = faces where y == 0\n\
             region top = faces where y == 1\nunknown u : vector Q2\nmultiplier lam : vector Q2 on low\n\
             quadrature on low vertex\ndef la = 300/0.52\ndef mu = 500/1.3\ndef F = Id(2) + Grad_u\n\
             def P = pi^2*(1000/0.91)*h^3/48\n\
             term body on all : (F*Saint_Venant_Kirchhoff_PK2(Grad_u,[la;mu])):Grad_Test_u\n\
             load u = [0, -{times}*t*P/h] on top\nsteps t = 0.25 to 1 by 0.25\nmeasure down = mean(-u(2)) on top\n{more}"
        )
    };
    let floor = "param gamma = 1e4\ndef tang(w) = w - (w.Normal)*Normal\n\
                 def p = pos_part(gamma*(u.Normal) - lam.Normal)\ndef q = Ball_projection(gamma*tang(u) - tang(lam), 0.5*p)\n\
                 term contact on low : (p*Normal + q).Test_u\n\
                 term law on low : -1/gamma*(lam + p*Normal + q).Test_lam\n";
    // the signs of the two terms of a tie are free: with opposite ones its matrix is not symmetric
    let tie = "term force on low : -lam.Test_u\nterm tie on low : u.Test_lam\n";
    for (name, more) in [("floor", floor), ("tie", tie)] {
        let below = run(&format!("euler-{name}-below"), &scene(0.9, more), &[]);
        assert!(below.code == 0 && !below.tells("W640"), "{name}: {}", below.text);
        let above = run(&format!("euler-{name}-above"), &scene(1.1, more), &[]);
        assert!(above.tells("W640") && above.text.contains("at t = 1 the equilibrium"), "{name}: {}", above.text);
        assert!(above.text.contains("to the side of 1e-4"), "{name}: {}", above.text);
    }
}

/// A square column in space buckles in two directions at once: the determinant of its tangent does not change its sign.
#[test]
fn two_directions_at_once_are_told() {
    let scene = |times: f64| {
        format!(
            "param times = {times}\nmesh box [0,0,0] to [0.1,0.1,1] cells [1,1,8] hex\nregion low = faces where z == 0\n\
             region top = faces where z == 1\nunknown u : vector Q2\ndef F = Id(3) + Grad_u\n\
             term body on all : (F*(500*(F'*F - Id(3)))):Grad_Test_u\nfix u = [0,0,0] on low\n\
             load u = [0, 0, -times*pi^2*1000*0.1^2/48] on top\nparam dummy = 1\n"
        )
        .replace("param dummy = 1\n", "")
    };
    let ran = run("square-above", &scene(1.1), &[]);
    assert!(ran.tells("W640") && ran.text.contains("in 2 directions"), "{}", ran.text);
    let ran = run("square-below", &scene(0.9), &[]);
    assert!(!ran.tells("W640"), "{}", ran.text);
}

/// A block of finite strain that its lid moves as a rigid body has no stress. Where the prescribed values alone would turn
/// cells inside out, no check may say that the run has failed.
#[test]
fn a_rigid_motion_of_more_than_a_cell_is_solved() {
    let scene = "mesh box [0,0] to [1,0.5] cells [10,5] quad\nregion lid = faces where y == 0.5\nunknown u : vector\n\
                 def F = Id(2) + Grad_u\nterm body on all : (F - Inv(F)' + log(Det(F))*Inv(F)'):Grad_Test_u\n\
                 fix u = [0, -0.3*s] on lid\nsteps s = 0.25 to 1 by 0.25\nmeasure moved = min(u(2)) on all\n\
                 measure strain = max(Norm(Grad_u)) on all\n";
    let ran = run("rigid-lid", scene, &[]);
    assert_eq!(ran.code, 0, "{}", ran.text);
    assert!((ran.last("moved") + 0.3).abs() < 1e-12 && ran.last("strain") < 1e-10);
}

/// A block falls askew on a floor and slides: the trapezoidal rule with a multiplier makes it bounce faster than it came, which the
/// balance of the steps does not show, with friction as without. Where the nodes of the floor have no mass it comes to rest, and
/// contact has taken what friction dissipates.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn contact_with_friction_that_gives_energy_is_told() {
    let scene = |scheme: &str, friction: f64| {
        format!(
            "mesh box [0,0] to [1,0.25] cells [1,3] quad\nregion floor = faces where y == 0\nunknown u : vector\n\
             multiplier lam : vector on floor\nquadrature on floor vertex\nstart Dot_u = [1,-0.2]\n\
             term inertia on all : Dot2_u.Test_u\nterm stress on all : 1e5*Sym(Grad_u):Grad_Test_u\n\
             load u = [0,-10] on all\nparam gamma = 1e5\ndef tang(w) = w - (w.Normal)*Normal\n\
             def p = pos_part(gamma*(u.Normal) - lam.Normal)\ndef Pt = gamma*(tang(u) - Previous_held) - tang(lam)\n\
             def q = Ball_projection(Pt, {friction}*p)\n\
             state held : vector on floor := Previous_held + (Pt - q)/gamma\n\
             term contact on floor : (p*Normal + q).Test_u\nterm law on floor : -1/gamma*(lam + p*Normal + q).Test_lam\n\
             scheme newmark {scheme} energy=0.01\nsteps t = 0 to 0.3 by 1e-4\n"
        )
    };
    for friction in [1e-9, 0.5] {
        let ran = run(&format!("gives-{friction}"), &scene("", friction), &[]);
        assert!(ran.tells("W620") && ran.text.contains("has no force it gave the energy"), "{}", ran.text);
    }
    let ran = run("gives-nothing", &scene("massless=floor", 0.5), &[]);
    assert!(!ran.tells("W620"), "{}", ran.text);
    let (taken, friction) = (ran.last("energy_contact"), ran.friction_work());
    assert!(taken > 0.999 * friction && taken < 1.05 * friction && ran.last("energy_kinetic") < 0.01, "{}", ran.text);
}

/// A column whose end a rigid platen presses, tied to it by a multiplier: clamped and guided, with P = pi^2 E I/L^2. The way of the
/// platen has no stiffness of its own, and is no force for that.
#[test]
fn a_platen_that_a_multiplier_ties_is_no_force() {
    let column = |factor: f64| {
        let scene = format!(
            "mesh box [0,0] to [20,1] cells [20,2] quad\nregion l = faces where x == 0\nregion r = faces where x == 20\n\
             unknown u : vector Q2\nunknown d : scalar global\nmultiplier m : scalar Q2 on r\n\
             def Eg = Green_Lagrangian(Id(2) + Grad_u)\nenergy b on all : 500*Eg:Eg\nparam P = pi^2*1000/12/400\n\
             term tie on r : m*(Test_u(1) - Test_d) + (u(1) - d)*Test_m\nterm force on global : {factor:?}*P*t*Test_d\n\
             fix u = [0,0] on l\nsteps t = 0.5 to 1 by 0.5\nmeasure end = max(d) on global\n"
        );
        run(&format!("platen-{factor}"), &scene, &[])
    };
    assert!(!column(0.9).tells("W640"));
    let above = column(1.3);
    assert!(above.tells("W640") && above.text.contains("in 1 direction"), "{}", above.text);
    // the critical loads are n^2 times the first
    let far = column(10.0);
    assert!(far.tells("W640") && far.text.contains("in 2 directions"), "{}", far.text);
}

/// Levels of the bodies are positive definite as long as these do not buckle; then a factor tells the sign of the determinant.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_column_that_buckles_on_friction_is_told_with_gmres_too() {
    let of = |linear: &str| {
        let scene = format!(
            "mesh box [0,0,0] to [1,1.5,12] cells [3,3,24] hex\nregion floor = faces where z == 0\n\
             region lid = faces where z == 12\nunknown u : vector Q1\nsteps t = 0.04 to 0.4 by 0.04\n\
             def F = Id(3) + Grad_u\ndef P = 80*(F - Inv(F)') + 120*log(Det(F))*Inv(F)'\n\
             def tang(w) = w - (w.Normal)*Normal\ndef Pn = 2e3*(u.Normal) - (P*Normal).Normal\n\
             def Pt = 2e3*tang(u) - tang(P*Normal)\nterm elastic on all : P:Grad_Test_u\n\
             term contact on floor : (pos_part(Pn)*Normal + Ball_projection(Pt, 0.6*pos_part(Pn))).Test_u\n\
             fix u = [0, 0, -t] on lid\nmeasure force = integral((P*[0,0,1])(3)) on lid\nsolver linear with {linear}\n"
        );
        run(&format!("on-friction-{}", linear.len()), &scene, &[])
    };
    for ran in [of("direct"), of("gmres, amg")] {
        assert!(ran.code == 0 && ran.tells("W640"), "{}", ran.text);
    }
}
