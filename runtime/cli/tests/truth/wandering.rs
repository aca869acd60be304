//! Contact whose points are far stiffer than the bodies, or rub on bodies that are not linear: a step whose active sets circle is
//! brought to its solution, and the solution is that of other ways to it.

use super::{Ran, run};

/// The most linear systems that a step took.
fn most(ran: &Ran) -> u64 {
    let steps = ran.report["steps"].as_array().expect("steps");
    steps.iter().map(|step| step["iterations"].as_u64().expect("a count")).max().expect("a step")
}

/// A membrane under a load over an obstacle, by a penalty that is `stiffness` times as stiff as the membrane, at the points of a rule.
fn membrane(cells: &str, element: &str, stiffness: f64, rule: &str) -> String {
    format!(
        "mesh box [0,0] to [1,1] cells {cells}\nregion rim = boundary\nunknown u : scalar {element}\n\
         def above = 0.3 - 2*((x - 0.5)^2 + (y - 0.4)^2) - u\nterm membrane on all : Grad_u.Grad_Test_u + 2*Test_u\n\
         term obstacle on all : -{stiffness:e}*pos_part(above)*Test_u\nfix u = 0 on rim\nquadrature on all {rule}\n\
         steps t = 1 to 1 by 1\nmeasure mean = integral(u) on all\nmeasure force = integral({stiffness:e}*pos_part(above)) on all\n\
         measure into = integral(pos_part(above)) on all\n"
    )
}

/// Rules with many points in a cell ended in E603 after 3000 iterations. What holds the membrane does not depend on the rule but for the
/// mesh, and it goes into the obstacle by a part of the stiffness.
#[test]
fn an_obstacle_by_a_stiff_penalty_with_many_points_in_a_cell_is_solved() {
    for (cells, element, degree) in
        [("[16,16] quad", "Q2", 5), ("[16,16] tri", "P2", 3), ("[24,24] tri", "P1", 3), ("[24,24] quad", "Q1", 7)]
    {
        let what = format!("{cells} {element} {degree}");
        let at = |stiffness: f64| {
            let rule = format!("degree {degree}");
            let ran = run(&format!("obstacle-{what}-{stiffness}"), &membrane(cells, element, stiffness, &rule), &[]);
            assert_eq!(ran.code, 0, "{what}: {}", ran.text);
            assert!(most(&ran) <= 150, "{what}: {}", ran.text);
            ran
        };
        let (soft, stiff) = (at(1e6), at(1e9));
        for of in ["mean", "force"] {
            let (soft, stiff) = (soft.last(of), stiff.last(of));
            assert!((stiff / soft - 1.0).abs() < 1e-2, "{what}: {of} {soft} {stiff}");
        }
        assert!(stiff.last("into") < 1e-2 * soft.last("into"), "{what}: {}", stiff.text);
    }
}

/// A nearly incompressible block of finite strain (lambda/mu = 500) is pressed by a fifth on a floor with friction and sheared: in one
/// step that was 500 to 3600 iterations and up to eight attempts, each of which circled. It is one attempt now, with the forces of
/// twenty steps where points stick.
#[test]
fn a_block_that_is_nearly_incompressible_is_pressed_on_friction_in_one_step() {
    let scene = |friction: f64, stiffness: f64, step: f64| {
        format!(
            "mesh box [0,0] to [4,1] cells [16,4] quad\nregion floor = faces where y == 0\nregion top = faces where y == 1\n\
             unknown u : vector Q2\ndef F = Id(2) + Grad_u\ndef press = {stiffness:e}*pos_part(-u(2))\n\
             def pull = Ball_projection([Previous_held + {stiffness:e}*(u(1) - Previous_u(1))], {friction}*press)(1)\n\
             state held : scalar on floor := pull\n\
             term block on all : ((F - Inv(F)') + 500*log(Det(F))*Inv(F)'):Grad_Test_u\n\
             term contact on floor : -press*Test_u(2) + pull*Test_u(1)\n\
             fix u = [0.4*max(0, t - 0.5), -0.2*min(1, 2*t)] on top\nsteps t = 0 to 1 by {step}\n\
             measure pressed = reaction(u(2)) on top\n"
        )
    };
    for (friction, stiffness) in [(0.3, 1e2), (0.9, 1e2), (0.9, 1e3)] {
        let what = format!("rubber-{friction}-{stiffness}");
        let at = |step: f64| {
            let ran = run(&format!("{what}-{step}"), &scene(friction, stiffness, step), &[]);
            assert_eq!(ran.code, 0, "{what} {step}: {}", ran.text);
            ran
        };
        let one = at(1.0);
        assert!(most(&one) <= 450, "{what}: {}", one.text);
        assert!(one.report["steps"][1]["attempts"].is_null(), "{what}: {}", one.text);
        let (one, many) = (one.last("pressed"), at(0.1).last("pressed"));
        assert!((one / many - 1.0).abs() < 0.05, "{what}: {one} {many}");
    }
}

/// A slipping fault by Nitsche's method with theta = 0 between cells that are graded towards it, gamma near E/h: the third of three large
/// steps took 901 iterations, most of them from one change of the active set to the next.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_fault_between_graded_cells_slips_in_large_steps() {
    let scene = "param gamma = 5e6\nmesh box [-1,0,0] to [1,4,4] cells [14,14,14] hex map [sign(x)*(0.05*abs(x) + 0.95*abs(x)^5), y, z]\n\
        region left = cells where x < 0\nregion right = cells where x > 0\nregion fault = interface from left to right\n\
        region bottom = faces where z == 0\nregion west = faces where x == -1\nregion east = faces where x == 1\n\
        region top = faces of right where z == 4\nunknown uL : vector on left\nunknown uR : vector on right\n\
        def sigma(v) = 10000*Div_v*Id(3) + 20000*Sym(Grad_v)\ndef trac(v) = sigma(v)*Normal\n\
        def jump(a,b) = a - Interpolate(b, neighbor_element)\ndef tang(w) = w - (w.Normal)*Normal\n\
        term elastic_left on left : sigma(uL):Grad_Test_uL\nterm elastic_right on right : sigma(uR):Grad_Test_uR\n\
        def Pn = gamma*(jump(uL,uR).Normal) - trac(uL).Normal\ndef Pt = gamma*tang(jump(uL,uR)) - tang(trac(uL))\n\
        def force = pos_part(Pn)*Normal + Ball_projection(Pt, 0.4*pos_part(Pn))\n\
        term contact on fault : force.jump(Test_uL,Test_uR)\nfix uL, uR = [0,0,0] on bottom\nfix uL(1) = 0 on west\n\
        load uR = [-3,0,0] on east\nload uR = [0,0,-t] on top\nsteps t = 0 to 9 by 3\n";
    let ran = run("graded-fault", scene, &["--quiet"]);
    assert_eq!(ran.code, 0, "{}", ran.text);
    assert!(most(&ran) < 400, "{}", ran.text);
}
