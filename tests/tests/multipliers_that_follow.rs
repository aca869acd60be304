//! Multipliers `with crosspoints=follow`: a uniform traction is exact up to the ends of a surface, against its closed form.

use wfl_tests::{attempt, examples};

/// With `crosspoints=follow` a multiplier has the traction of the nearest node where no jump determines it, at prescribed ends:
/// a uniform traction is exact up to there, and nothing is told.
#[test]
fn what_follows_has_the_traction_up_to_the_ends() {
    let scene = |law: &str, wanted: &str| {
        format!(
            "use \"elasticity\"\nuse \"contact\"\nmesh box [0,0] to [1,2] cells [4,8] quad\nregion below = cells where y < 1\n\
             region above = cells where y > 1\nregion s = interface from below to above\nregion ob = faces of below & boundary\n\
             region oa = faces of above & boundary\nunknown a : vector on below\nunknown b : vector on above\n\
             multiplier l : vector on s{wanted}\ndef jump(v, w) = v - Interpolate(w, neighbor_element)\n\
             def exact = [1e-3*x, -3e-3*y]\nquadrature on s vertex\nterm below on below : work(a, Test_a, 1000, 0.25)\n\
             term above on above : work(b, Test_b, 1000, 0.25)\nterm law on s : {law}\nfix a = exact on ob\nfix b = exact on oa\n\
             measure off = max(Norm(a - exact)) on below\ndef t = traction(a, 1000, 0.25)\n\
             measure force = max(min(Norm(l - t), Norm(l + t))) on s\nmeasure total = integral(l(2)) on s\n\
             measure whole = integral(t(2)) on s\n"
        )
    };
    for law in ["l.jump(Test_a, Test_b) + jump(a, b).Test_l", "augmented(a, b, l, 1e4, 0.3)"] {
        let tried = attempt(&examples(), scene(law, " with crosspoints=follow"), &[], &[]);
        assert!(!tried.messages.contains("W404"), "{}", tried.messages);
        let found = tried.solved.unwrap_or_else(|| panic!("{}", tried.messages));
        let [off, force, total, whole] = ["off", "force", "total", "whole"].map(|name| found.measure(0, name));
        assert!(off < 1e-15 && force < 1e-11, "{law}: {off:e} {force:e}");
        assert!((total.abs() / whole.abs() - 1.0).abs() < 1e-11, "{law}: {total} {whole}");
        let dropped = attempt(&examples(), scene(law, ""), &[], &[]);
        assert!(dropped.messages.contains("crosspoints=follow"), "{}", dropped.messages);
        let found = dropped.solved.unwrap_or_else(|| panic!("{}", dropped.messages));
        assert!(found.measure(0, "total").abs() < 0.9 * whole.abs(), "zero at the ends");
    }
}

/// The same of four ties that meet in a cross, where one of them follows from the others.
#[test]
fn what_follows_has_the_traction_up_to_a_crossing() {
    let mut text = "use \"elasticity\"\nmesh box [0,0] to [2,2] cells [4,4] quad\ndef exact = [1e-3*x + 2e-3*y, -3e-3*y + 1e-3*x]\n\
                    def other(w) = Interpolate(w, neighbor_element)\n"
        .to_owned();
    for (k, condition) in
        ["x < 1 and y < 1", "x > 1 and y < 1", "x < 1 and y > 1", "x > 1 and y > 1"].iter().enumerate()
    {
        text += &format!(
            "region r{k} = cells where {condition}\nregion o{k} = faces of r{k} & boundary\nunknown u{k} : vector on r{k}\n\
             term e{k} on r{k} : work(u{k}, Test_u{k}, 1000, 0.25)\nfix u{k} = exact on o{k}\n"
        );
    }
    for (k, (a, b)) in [(0, 1), (2, 3), (0, 2), (1, 3)].into_iter().enumerate() {
        text += &format!(
            "region s{k} = interface from r{a} to r{b}\nmultiplier l{k} : vector on s{k} with crosspoints=follow\n\
             term t{k} on s{k} : l{k}.(Test_u{a} - other(Test_u{b})) + (u{a} - other(u{b})).Test_l{k}\n\
             measure low{k} = min(Norm(l{k})) at nodes of s{k}\nmeasure high{k} = max(Norm(l{k})) at nodes of s{k}\n"
        );
    }
    let tried = attempt(&examples(), text, &[], &[]);
    assert!(!tried.messages.contains("W404"), "{}", tried.messages);
    let found = tried.solved.unwrap_or_else(|| panic!("{}", tried.messages));
    // lambda = mu = 400: no stress along x, -3.2 along y, 1.2 in shear
    for (k, exact) in [1.2, 1.2, 3.2f64.hypot(1.2), 3.2f64.hypot(1.2)].into_iter().enumerate() {
        for name in ["low", "high"] {
            let traction = found.measure(0, &format!("{name}{k}"));
            assert!((traction - exact).abs() < 1e-11, "{name}{k}: {traction} {exact}");
        }
    }
}

/// What a multiplier meets through images that move is not known beforehand: that it cannot follow is told.
#[test]
fn a_multiplier_through_images_that_move_follows_nowhere() {
    let scene = "mesh box [0,0] to [1,2] cells [2,4] quad\nregion low = cells where y < 1\nregion up = cells where y > 1\n\
                 region lo = faces of low where y == 1\nregion hi = faces of up where y == 1\n\
                 region foot = faces where y == 0\nregion lid = faces where y == 2\nunknown a : vector on low\n\
                 unknown b : vector on up\nmapping m = raytrace from hi onto lo moving with b, a within 0.3\n\
                 multiplier l : scalar on hi with crosspoints=follow\n\
                 def gap = (X + b - Interpolate(X, m) - Interpolate(a, m))(2)\nterm low on low : 100*Grad_a:Grad_Test_a\n\
                 term up on up : 100*Grad_b:Grad_Test_b\nterm force on hi : l*(Test_b - Interpolate(Test_a, m))(2)\n\
                 term law on hi : -1e-3*(l + pos_part(-l - 1e3*gap))*Test_l\nfix a = [0,0] on foot\nfix b = [0,-0.01] on lid\n";
    let told = attempt(&examples(), scene.to_owned(), &[], &[]).messages;
    assert!(told.contains("W404") && told.contains("follows nowhere"), "{told}");
    let silent = attempt(&examples(), scene.replace(" with crosspoints=follow", ""), &[], &[]).messages;
    assert!(!silent.contains("W404"), "{silent}");
}
