//! Pressures that are functions of a gap: powers, roots, logarithms of its positive part. Each is the same law written with `if`,
//! of which nothing is frozen: the same forces on scenes whose points close, open and slide, and no word about a value that
//! does not exist where a point is open.

use super::run;

/// Laws of `P`, the positive part of the gap.
const LAWS: [&str; 13] = [
    "1e5*P^1.5",
    "2e3*pow(P/0.001, 1.7)",
    "3e2*P^0.5",
    "3e2*sqrt(P/0.01)*P",
    "5*log(1 + P/0.001)",
    "5*log1p(P/0.001)",
    "1e5*exp(1.5*log(P))",
    "1e4*P/(1 + P/0.003)",
    "5*(exp(P/0.001) - 1)",
    "5*(1 - exp(-P/0.001))",
    "1e7*P^2",
    "1e7*P^3",
    "1e4*P*(1 + 10*P^0.5)",
];

/// A block of three cells that comes down, slides and is lifted, over a floor whose gap varies.
fn block(name: &str, press: &str, friction: &str) -> super::Ran {
    let scene = format!(
        "wfl 1\nmesh box [0,0] to [1,1] cells [3,1] quad\nregion floor = faces where y == 0\n\
         region top = faces where y == 1\nunknown u : vector\ndef g = u.Normal - (0.003 + 0.002*x)\n\
         def press = {press}\nterm block on all : 1000*(Sym(Grad_u):Grad_Test_u)\n\
         term contact on floor : press*(Test_u.Normal){friction}\n\
         fix u = [0.002*t, -0.01*sin(3*t)] on top\nsteps t = 0 to 3 by 0.25\n\
         measure F = reaction(u(2)) on top\nmeasure T = reaction(u(1)) on top\n"
    );
    run(name, &scene, &[])
}

/// Both forms of a law, with friction or without.
fn assert_same(name: &str, law: &str, half_line: &str, friction: &str) {
    let by_half_line = block(name, &law.replace('P', half_line), friction);
    let by_choice = block(name, &format!("if g > 0 then {} else 0", law.replace('P', "g")), friction);
    assert!(by_half_line.code == 0 && by_choice.code == 0, "{law}: {}\n{}", by_half_line.text, by_choice.text);
    assert_eq!(by_half_line.steps(), 13);
    for force in ["F", "T"] {
        for step in 0..by_choice.steps() {
            let (a, b) = (by_half_line.measure(step, force), by_choice.measure(step, force));
            assert!((a - b).abs() <= 1e-9, "{law}: {force} {a} and {b} at step {step}");
        }
    }
}

#[test]
fn functions_of_a_positive_part_are_the_laws_with_a_choice() {
    for (k, law) in LAWS.iter().enumerate() {
        assert_same(&format!("power-{k}"), law, "pos_part(g)", "");
    }
}

#[test]
fn they_are_so_as_bounds_of_friction() {
    let friction = " + Ball_projection(1e4*(u - (u.Normal)*Normal), 0.4*press).Test_u";
    for (k, law) in LAWS.iter().enumerate() {
        assert_same(&format!("power-friction-{k}"), law, "max(0, g)", friction);
    }
}

/// 1000 (0.007 - w) = 1e5 w^1.5, nothing touches in the first steps.
#[test]
fn a_power_of_an_overlap_is_found_in_a_few_iterations() {
    let scene = "wfl 1\nmesh box [0,0] to [1,1] cells [1,1] quad\nregion floor = faces where y == 0\n\
         region top = faces where y == 1\nunknown u : vector\nterm block on all : 1000*(Sym(Grad_u):Grad_Test_u)\n\
         term contact on floor : 1e5*pos_part(u.Normal - 0.003)^1.5*(Test_u.Normal)\nfix u = [0,-0.01*t] on top\n\
         steps t = 0 to 1 by 0.1\nmeasure F = reaction(u(2)) on top\n";
    let ran = run("power-gap", scene, &["-v"]);
    ran.assert_silent();
    assert!((ran.last("F") - 5.545_746_809).abs() < 1e-8, "{}", ran.last("F"));
    let iterations = ran.text.lines().filter_map(|line| line.split_once(" iterations  residual")?.0.rsplit(' ').next());
    let most = iterations.map(|n| n.parse::<usize>().expect("a count")).max();
    assert!(most.is_some_and(|most| most <= 6), "{}", ran.text);
}
