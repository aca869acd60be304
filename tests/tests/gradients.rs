//! Derivatives of results against closed forms, an independent program, and differences of whole runs.

use std::{collections::BTreeMap, path::Path};

use wfl_gradient::Gradients;
use wfl_tests::{
    differentiated,
    driven::{DRIVEN_BLOCKS, write_path},
    examples, reference,
};

/// Nitsche's method with the whole drive at once.
const NITSCHE: &str = "
param gamma = 2e5
param theta = 1 in {-1, 0, 1}
def overlap = 0
def drive = d
def pressed = gamma*(apart.Normal) - traction(uL).Normal
def sheared = gamma*tangential(apart) - tangential(traction(uL))
def force = pos_part(pressed)*Normal + Ball_projection(sheared, fric*pos_part(pressed))
def tested = gamma*test_apart - theta*(lame*Div_Test_uL*Id(2) + 2*mu*Sym(Grad_Test_uL))*Normal
term stress on joint : -theta/gamma*traction(uL).((lame*Div_Test_uL*Id(2) + 2*mu*Sym(Grad_Test_uL))*Normal)
term contact on joint : 1/gamma*force.tested
measure pressure = mean(pos_part(pressed)) on joint
";

/// Friction by increments, forward by d and back to d/4.
const INCREMENTS: &str = "
param gamma = 2e5
def overlap = 0
def drive = d*(1 - abs(1 - t))
def past = tangential(Previous_uL - Interpolate(Previous_uR, neighbor_element))
def pressed = gamma*(apart.Normal) - traction(uL).Normal
def sheared = gamma*(tangential(apart) - past) - tangential(traction(uL))
term contact on joint : (pos_part(pressed)*Normal + Ball_projection(sheared, fric*pos_part(pressed))).test_apart
steps t = 0 to 1.75 by 0.25
";

/// A penalty with the slip as a state, forward and back.
const PENALTY: &str = "
param gamma = 1e6
def overlap = p/gamma
def drive = d*(1 - abs(1 - t))
def pressed = gamma*(apart.Normal)
def sheared = gamma*(tangential(apart) - Previous_slipped)
def resisting = Ball_projection(sheared, fric*pos_part(pressed))
state slipped : vector on joint := tangential(apart) - resisting/gamma
term contact on joint : (pos_part(pressed)*Normal + resisting).test_apart
steps t = 0 to 1.75 by 0.25
";

fn of(text: String, params: &[(&str, f64)], results: &str, with: &str) -> Gradients {
    let found = differentiated((Path::new("."), text), &[], params, results, with);
    found.unwrap_or_else(|told| panic!("{told}")).1
}

/// The largest deviation from the closed derivatives, over their size.
fn deviation(of: &Gradients, list: &str) -> f64 {
    let expected = reference("physics_gradients.json")["two_blocks"][list].clone();
    let mut largest = 0.0f64;
    for row in expected.as_array().expect("a list") {
        let [measure, parameter] = ["measure", "parameter"].map(|key| row[key].as_str().expect("a name"));
        let closed = row["closed"].as_f64().expect("a number");
        let found = of.number(measure, parameter).unwrap_or_else(|| panic!("{measure} {parameter}"));
        // a derivative that is zero, against the value over the parameter
        let size = if closed == 0.0 { 1e-3 } else { closed.abs() };
        largest = largest.max((found - closed).abs() / size);
    }
    largest
}

#[test]
fn closed_derivatives_of_two_blocks() {
    let found = of(format!("{DRIVEN_BLOCKS}{NITSCHE}"), &[], "slip, shear, pressure", "E, nu, fric, d, p, gamma");
    assert!(deviation(&found, "nitsche") < 1e-9);
    let found = of(format!("{DRIVEN_BLOCKS}{INCREMENTS}"), &[], "shear, slip", "E, nu, fric, d, p");
    assert!(deviation(&found, "incremental") < 1e-9);
    let found = of(format!("{DRIVEN_BLOCKS}{PENALTY}"), &[], "shear", "E, nu, fric, d, p, gamma");
    assert!(deviation(&found, "penalty_state") < 1e-9);
}

/// States are homogeneous: the force on the grip of the right block is the shear times the height 1, up to its sign, and so
/// are the derivatives; also in `d`, which is what the grip prescribes.
#[test]
fn reactions_have_the_derivatives_of_the_traction_that_they_balance() {
    let numbers = BTreeMap::from([("E", 25e3), ("nu", 0.25), ("fric", 0.4), ("d", 3e-3), ("p", 10.0), ("gamma", 2e5)]);
    for (form, with) in
        [(NITSCHE, "E, nu, fric, d, p, gamma"), (INCREMENTS, "E, nu, fric, d, p"), (PENALTY, "E, d, gamma")]
    {
        let text = format!("{DRIVEN_BLOCKS}{form}measure grip = reaction(uR(2)) on east\n");
        let found = of(text, &[], "grip, shear, sum(grip), sum(shear)", with);
        let value = |name: &str| found.results.iter().find(|r| r.name == name).expect("a result").value;
        for (reaction, traction) in [("grip", "shear"), ("sum(grip)", "sum(shear)")] {
            let sign = value(reaction).signum() * value(traction).signum();
            assert!((value(reaction) - sign * value(traction)).abs() < 1e-9 * value(traction).abs());
            for parameter in with.split(", ") {
                let [a, b] = [reaction, traction].map(|of| found.number(of, parameter).expect("a derivative"));
                // one that is zero, against the value over the parameter
                let natural = value(traction).abs() / numbers[parameter];
                let size = if b.abs() < 1e-9 * natural { 1e-3 * natural } else { b.abs() };
                assert!((a - sign * b).abs() < 1e-8 * size, "{reaction} in {parameter}: {a}, {b}");
            }
        }
    }
}

/// Flow along faces with an aperture that has a kink, a source at a node, exchange, and reactions as results.
const FLOW: &str = "wfl 1
use \"poro\"
param Q = 0.3
param c = 10
param k = 5
param pw = 1
mesh box [0,0] to [1,1] cells [6,6] quad
region fault = faces where y == 0
region west = faces where x == 0
region ends = nodes of fault where x == 1
region mid = nodes of fault where x == 0.5
unknown p : scalar
unknown pf : scalar on fault
steps t = 0 to 1 by 0.25
scheme backward_euler
term rock on all : darcy(p, 1) + Dot_p*Test_p
term flow on fault : along_fault(pf, c*(1 + pf^2))
term volume on fault : filling(0.1 + pos_part(pf - 0.05), pf)
term leak on fault : k*(pf - p)*(Test_pf - Test_p)
fix p = pw*t on west
fix pf = 0 on ends
load pf = Q on mid
measure q = reaction(pf) on ends
measure m = mean(pf) on fault
";

#[test]
fn flow_along_faces_and_what_supports_carry_of_it() {
    for result in ["q", "sum(q)", "m"] {
        let found = of(FLOW.to_owned(), &[], result, "Q, c, k, pw");
        differences(FLOW, result, &["Q", "c", "k", "pw"], &found);
    }
}

/// A factor of a reaction is none of its equations: its derivative is told to be missing, and not zero.
#[test]
fn a_parameter_in_the_weights_of_a_reaction_is_refused() {
    let text = format!("{DRIVEN_BLOCKS}{NITSCHE}param lever = 2\nmeasure turn = reaction(lever*uR(2)) on east\n");
    let told = |with: &str| differentiated((Path::new("."), text.clone()), &[], &[], "turn", with);
    let refused = told("lever").err().expect("it is refused");
    assert!(refused.contains("E470") && refused.contains("`lever` multiplies"), "{refused}");
    assert!(told("E").is_ok());
}

/// Friction that remembers where it was, up, down and up again: antiplane, a multiplier and a vertex rule.
const PATH: &str = "wfl 1
param f0 = 0.1
param f1 = -0.15
param f2 = 0.08
param mu = 1
param gamma = 8
mesh box [0,-2] to [4,0] cells [16,16] quad
region fault = faces where x == 0 and y >= -1
region below = faces where x == 0 and y <= -1
region far = faces where x == 4
unknown u : scalar Q1
multiplier tau : scalar Q1 on fault
def bound = f0 + f1*y + f2*y^2
term elastic on all : mu*Grad_u.Grad_Test_u
term shear on fault : tau*Test_u
term law on fault : -1/gamma*(tau - Ball_projection(tau + gamma*(u - Previous_u), bound))*Test_tau
quadrature on fault vertex
fix u = 0 on below
fix u = table(\"drive.csv\", t) on far
steps t = 1 to 12 by 1
measure J1 = value(u) at [0,0]
measure J2 = value(u) at [1.5,0]
measure misfit = value((u - table(\"seen.csv\", t))^2) at [0.5,0]
";

#[test]
fn friction_with_a_memory_as_an_independent_program_has_it() {
    let known = reference("physics_gradients.json")["path"].clone();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("gradients");
    std::fs::create_dir_all(&folder).expect("a folder for the test");
    write_path(&folder, &known);
    let scene = (folder.as_path(), PATH.to_owned());
    let found = differentiated(scene, &[], &[], "J1, J2, sum(misfit)", "f0, f1, f2, mu, gamma");
    let found = found.unwrap_or_else(|told| panic!("{told}")).1;
    for (k, result) in found.results.iter().enumerate() {
        let value = known["J"][k].as_f64().expect("a number");
        assert!((result.value - value).abs() < 1e-10 * value.abs().max(1e-3), "{} {value}", result.value);
        for (j, name) in ["f0", "f1", "f2", "mu"].iter().enumerate() {
            let expected = known["gradient_adjoint"][k][j].as_f64().expect("a number");
            let derivative = found.number(&result.name, name).expect("a derivative");
            assert!((derivative - expected).abs() < 1e-9 * expected.abs(), "{} {name}", result.name);
        }
        // the solution does not depend on the parameter of augmentation
        let gamma = found.number(&result.name, "gamma").expect("a derivative");
        assert!(gamma.abs() < 1e-12, "{gamma}");
    }
}

/// The fault of the examples, which slides down and is pulled back: nonsymmetric contact and friction in space.
fn fault(cells: &str) -> Gradients {
    let folder = examples().join("fault");
    let text = std::fs::read_to_string(folder.join("nitsche.wfl")).expect("an example");
    let edits = [("cells [8, 8, 8]", format!("cells {cells}"))];
    let results = "Fn, Ftz, max_slip, energy_left, Fn at t=4.5, Ftz at t=4.5, max_slip at t=4.5, energy_left at t=4.5";
    let found = differentiated((&folder, text), &edits, &[], results, "E, nu, fric, gamma");
    found.unwrap_or_else(|told| panic!("{told}")).1
}

/// With given loads a stiffness of bodies and contact that is twice as large halves displacements and leaves forces.
fn scale_with_stiffness(found: &Gradients) {
    for (k, result) in found.results.iter().enumerate() {
        let [e, gamma] = ["E", "gamma"].map(|p| found.number(&result.name, p).expect("a derivative"));
        let scaled = 25e3 * e + 1e5 * gamma;
        // the loads are given: forces do not follow the stiffness, slips do inversely
        let expected = if k % 4 == 2 { -result.value } else { 0.0 };
        let size = (25e3 * e).abs() + (1e5 * gamma).abs() + expected.abs();
        if k % 4 != 3 {
            assert!((scaled - expected).abs() < 1e-9 * size, "{}: {scaled:e} {expected:e}", result.name);
        }
    }
}

#[test]
fn derivatives_of_the_fault_scale_with_its_stiffness() {
    scale_with_stiffness(&fault("[2, 2, 2]"));
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn differences_of_runs_of_the_fault() {
    let found = fault("[8, 8, 8]");
    scale_with_stiffness(&found);
    let known = reference("physics_gradients.json")["fault"].clone();
    for (time, list) in known.as_object().expect("two times") {
        for row in list.as_array().expect("a list") {
            let [measure, parameter] = ["measure", "parameter"].map(|key| row[key].as_str().expect("a name"));
            let [central, spread] = ["central", "spread"].map(|key| row[key].as_f64().expect("a number"));
            let result = if time == "9.5" { measure.to_owned() } else { format!("{measure} at t={time}") };
            let derivative = found.number(&result, parameter).expect("a derivative");
            let apart = (derivative - central).abs();
            assert!(
                apart < (5.0 * spread).max(1e-6 * central.abs()),
                "{result} {parameter}: {derivative:e} {central:e}"
            );
        }
    }
}

/// A body on a wall that is not along an axis, with a stiffness that varies in space.
const TILTED: &str = "wfl 1
param k0 = 2
param shift = 0.1
param push = 0.3
mesh box [0,0] to [2,1] cells [6,3] quad map [x - 0.3*y, y + 0.2*x]
region low = faces where y == 0.2*x
region left = faces where x == -0.3*y
region right = faces where x == 2 - 0.3*(y - 0.4)
unknown u : vector
data k : scalar = k0*(1 + x)
term bulk on all : k*(Sym(Grad_u):Sym(Grad_Test_u) + 0.5*Div_u*Div_Test_u)*(1 + 0.1*Norm_sqr(u))
fix u.Normal = shift*t on low
fix u(1) = 0 on left
fix u(1) = push*shift*t on right
start u = [0.01*push, 0]
steps t = 1 to 2 by 1
measure force = integral(k*Grad_u(1,1)) on all
measure moved = mean(Norm_sqr(u) + shift*Norm_sqr(Previous_u)) on right
";

#[test]
fn a_field_has_the_derivative_of_the_parameter_it_is_made_of() {
    let found = of(TILTED.to_owned(), &[], "force, moved, sum(moved)", "k0, shift, push, field k");
    for result in &found.results {
        let by_node = &result.fields[0].1;
        assert!(by_node.len() == 28, "{}", by_node.len());
        differences(TILTED, &result.name, &["k0", "shift", "push"], &found);
    }
}

/// Compares with central differences of runs, whose own error is that of their change squared.
fn differences(text: &str, result: &str, parameters: &[&str], found: &Gradients) {
    for name in parameters {
        let line = text.lines().find(|l| l.starts_with(&format!("param {name} = "))).expect("a param");
        let value: f64 = line.rsplit(' ').next().and_then(|v| v.parse().ok()).expect("a number");
        let change = 1e-5 * value.abs();
        let at = |value: f64| {
            let text = text.replace(line, &format!("param {name} = {value:?}"));
            let tight = format!("{text}solver newton with tol=1e-13\n");
            of(tight, &[], result, name).results[0].value
        };
        let central = (at(value + change) - at(value - change)) / (2.0 * change);
        let derivative = found.number(result, name).expect("a derivative");
        let size = derivative.abs().max(central.abs()).max(1e-3 * found.results[0].value.abs());
        assert!((derivative - central).abs() < 1e-6 * size, "{result} {name}: {derivative:e} {central:e}");
    }
}

/// A creeping bar in backward Euler: a state, a first rate, steps that begin where time does.
const CREEPING: &str = "wfl 1
param E = 3
param eta = 2
param rate = 0.5
mesh box [0] to [1] cells [4]
region left = faces where x == 0
region right = faces where x == 1
unknown u : scalar
state creep : scalar := creep + timestep*(E/eta)*(Grad_u(1) - creep)
term stress on all : E*(Grad_u(1) - creep)*Grad_Test_u(1) + 0.1*eta*Dot_u*Test_u
fix u = 0 on left
fix u = rate*t^2 on right
start u = 0.1*rate*x
scheme backward_euler
steps t = 0 to 1 by 0.25
measure stress = mean(E*(Grad_u(1) - creep)) on all
measure end = value(u) at [0.5]
";

#[test]
fn states_and_first_rates_in_time() {
    let results = "stress, end, mean(stress)";
    let found = of(CREEPING.to_owned(), &[], results, "E, eta, rate");
    for result in results.split(", ") {
        differences(CREEPING, result, &["E", "eta", "rate"], &found);
    }
}

/// Rates by the last three values: what is kept between steps is followed, also into a result that is a rate.
#[test]
fn first_rates_by_backward_differentiation() {
    let text = CREEPING.replace("scheme backward_euler", "scheme bdf2").replace("by 0.25", "by 0.125")
        + "measure speed = value(Dot_u) at [0.5]\n";
    let results = "stress, end, mean(stress), speed, sum(speed)";
    let found = of(text.clone(), &[], results, "E, eta, rate");
    for result in results.split(", ") {
        differences(&text, result, &["E", "eta", "rate"], &found);
    }
}

/// A bar with inertia that is struck, drawn and damped: first and second rates, given and prescribed ones where time starts, a
/// state, and rates as results.
const STRUCK: &str = "wfl 1
param E = 3
param rho = 2
param eta = 0.5
param rate = 0.7
param v0 = 0.3
mesh box [0] to [1] cells [4]
region left = faces where x == 0
region right = faces where x == 1
unknown u : scalar
data weight : scalar = rho*(1 + x)
state creep : scalar := creep + timestep*0.3*(Grad_u(1) - creep)
term inertia on all : weight*Dot2_u*Test_u
term stress on all : E*(Grad_u(1) + Grad_u(1)^3 - creep)*Grad_Test_u(1) + eta*Dot_u*Test_u + 0.1*t*rho*Test_u
fix u = 0.1*v0*sin(t) on left
fix u = 0.1*rate + v0*t + rate*t^2 on right
start u = 0.1*rate*x
start Dot_u = v0*x^2*rho
scheme newmark beta=1/4 gamma=1/2
steps t = 0 to 1 by 0.125
measure stress = mean(E*(Grad_u(1) - creep)) on all
measure end = value(u) at [0.5]
measure speed = integral(Dot_u^2 + 0.01*rho*Dot2_u*x) on all
";

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn second_rates_in_every_scheme() {
    let schemes = "newmark beta=1/4 gamma=1/2; newmark beta=0.3025 gamma=0.6; bdf2; bdf3; generalised_alpha rho_inf=0.5; \
                   hht alpha=-0.1";
    for scheme in schemes.split("; ") {
        let mut text = STRUCK.replace("newmark beta=1/4 gamma=1/2", scheme);
        if scheme.contains("alpha") {
            // where equations stand within a step no state is renewed
            let state = text.lines().find(|l| l.starts_with("state ")).expect("a state").to_owned();
            text = text.replace(&format!("{state}\n"), "").replace(" - creep", "");
        }
        let results = "stress, end, sum(speed), speed at t=0, mean(end)";
        let found = of(text.clone(), &[], results, "E, rho, eta, rate, v0, field weight");
        for result in results.split(", ") {
            differences(&text, result, &["E", "rho", "eta", "rate", "v0"], &found);
        }
    }
    // explicit steps, with mass and damping on the diagonal
    let text = STRUCK.replace("newmark beta=1/4 gamma=1/2", "explicit").replace("by 0.125", "by 0.05");
    let text = format!("{text}term damp on all : 0.2*eta*Dot_u*Test_u\n");
    let results = "stress, end, sum(speed), speed at t=0, mean(end)";
    let found = of(text.clone(), &[], results, "E, rho, eta, rate, v0, field weight");
    for result in results.split(", ") {
        differences(&text, result, &["E", "rho", "eta", "rate", "v0"], &found);
    }
    // first rates by Newmark's rule follow from the equations, too
    let text = CREEPING.replace("scheme backward_euler", "scheme newmark beta=1/4 gamma=1/2");
    let results = "stress, end, mean(stress)";
    let found = of(text.clone(), &[], results, "E, eta, rate");
    results.split(", ").for_each(|result| differences(&text, result, &["E", "eta", "rate"], &found));
    let inclined = "wfl 1\nparam E = 3\nparam v = 0.4\nparam rho = 2\nmesh box [0,0] to [1,1] cells [3,3] quad map [x + 0.4*y, y]\n\
                    region side = faces where x == 0.4*y\nregion top = faces where y == 1\nunknown u : vector\n\
                    term inertia on all : rho*Dot2_u.Test_u\nterm body on all : E*Sym(Grad_u):Sym(Grad_Test_u)\n\
                    fix u.Normal = 0.1*v*(t + t^2) on side\nstart Dot_u = [v*x, rho*y]\nload u = [0,v*rho*t] on top\n\
                    scheme generalised_alpha rho_inf=0.6\nsteps t = 0 to 0.5 by 0.125\n\
                    measure top = mean(u(1) + 2*u(2)) on top\nmeasure speed = integral(Dot_u.Dot_u) on all\n";
    let found = of(inclined.to_owned(), &[], "top, speed, sum(speed)", "E, v, rho");
    ["top", "speed", "sum(speed)"].iter().for_each(|r| differences(inclined, r, &["E", "v", "rho"], &found));
}

/// A parameter within a rate is also in what the rate reads of the step before.
#[test]
fn parameters_within_rates() {
    let text = CREEPING.replace("0.1*eta*Dot_u*Test_u", "0.1*eta*Rate(sqr(1 + rate + u))*Test_u");
    assert!(text.contains("Rate(sqr("));
    let found = of(text.clone(), &[], "stress, end, mean(stress)", "E, eta, rate");
    for result in ["stress", "end", "mean(stress)"] {
        differences(&text, result, &["E", "eta", "rate"], &found);
    }
}

#[test]
fn what_has_no_derivative_is_told_with_its_place() {
    let refused = |text: &str, results: &str, with: &str| {
        let found = differentiated((Path::new("."), text.to_owned()), &[], &[], results, with);
        found.map(|(_, found)| format!("{found:?}")).expect_err("no derivative")
    };
    let onset = format!("{DRIVEN_BLOCKS}{NITSCHE}measure share = mean(if slipping > 0 then 1 else 0) on joint\n");
    let onset = onset.replace("measure share", "def slipping = Norm(sheared) - fric*pos_part(pressed)\nmeasure share");
    assert!(refused(&onset, "share", "fric").contains("jumps and does not slide"));
    assert!(refused(&onset, "slap", "fric").contains("did you mean `slip`"));
    assert!(refused(&onset, "slip", "frick").contains("did you mean `fric`"));
    assert!(refused(&onset, "slip at t=3", "fric").contains("nearest one ends at"));
    let shape = DRIVEN_BLOCKS.replace("cells [6,2]", "cells [6,rows]").replace("param d ", "param rows = 2\nparam d ");
    let told = refused(&format!("{shape}{NITSCHE}"), "slip", "rows");
    assert!(told.contains("E470") && told.contains("division of the mesh") && told.contains("scene.wfl:"), "{told}");
    let steps = format!("{DRIVEN_BLOCKS}{INCREMENTS}")
        .replace("to 1.75 by", "to last by")
        .replace("param d ", "param last = 1.75\nparam d ");
    assert!(refused(&steps, "slip", "last").contains("stands in `steps`"));
    let held = CREEPING.replace("scheme backward_euler", "scheme newmark beta=1/4 gamma=1/2");
    let held = held.replace(
        "unknown u : scalar\n",
        "unknown u : scalar\nunknown p : scalar\nterm other on all : (p - u)*Test_p\n",
    );
    let told = refused(&held, "end", "E");
    assert!(told.contains("`p` has no rate") && told.contains("scene.wfl:9:"), "{told}");
}

/// A safe parameter of Nitsche's method is found by the run: others have the derivatives that they have beside its number.
#[test]
fn a_value_that_the_run_finds_is_kept() {
    let auto = format!("{DRIVEN_BLOCKS}{NITSCHE}").replace("param gamma = 2e5", "param gamma = auto");
    let made = differentiated((Path::new("."), auto.clone()), &[], &[], "slip, pressure", "E, fric");
    let (solved, found) = made.unwrap_or_else(|told| panic!("{told}"));
    assert!(found.notes.iter().any(|note| note.contains("`gamma` keeps the value")), "{:?}", found.notes);
    let gamma = solved.scene.params.iter().find(|p| p.0 == "gamma").expect("a param").1.values[0];
    let same = of(format!("{DRIVEN_BLOCKS}{NITSCHE}"), &[("gamma", gamma)], "slip, pressure", "E, fric");
    assert_eq!(found.results, same.results);
    let told = differentiated((Path::new("."), auto), &[], &[], "slip", "gamma").err().expect("refused");
    assert!(told.contains("`gamma` is found by the run") && told.contains("this run found"), "{told}");
}

#[test]
fn a_mapping_that_moves_is_told_with_its_line() {
    let folder = examples().join("sliding");
    let text = std::fs::read_to_string(folder.join("slot.wfl")).expect("an example");
    let line = 1 + text.lines().position(|l| l.starts_with("mapping")).expect("a mapping");
    let told = differentiated((&folder, text), &[], &[], "none", "none").err().expect("refused");
    assert!(told.contains("images that follow the bodies") && told.contains(&format!("scene.wfl:{line}:")), "{told}");
}

#[test]
fn points_between_stick_and_slip_are_told() {
    // the drive at which friction is reached everywhere
    let onset = format!("{DRIVEN_BLOCKS}{NITSCHE}");
    let found = of(onset.clone(), &[("d", 1.2e-3)], "slip", "fric");
    let derivative = found.number("slip", "fric").expect("a derivative");
    assert!(derivative.abs() < 1e-12 || (derivative + 3e-3).abs() < 1e-9, "{derivative}");
    assert!(found.near.iter().any(|n| n.kind.contains("stick and slip") && n.points > 0), "{:?}", found.near);
    assert!(of(onset, &[], "slip", "fric").near.is_empty());
}

/// A square under a load of two components, with a modulus that is made of another one.
const LOADED: &str = "wfl 1
param base = 2
param shear = 1.5*base
param pull = [0.3, 0.2]
mesh box [0,0] to [1,1] cells [3,3] tri
region left = faces where x == 0
region right = faces where x == 1
unknown u : vector
energy body on all : 0.5*shear*Norm_sqr(Sym(Grad_u)) + 0.1*base*(exp(Div_u) - Div_u)
fix u = [0, 0] on left
load u = pull on right
measure end = mean(u.pull) on right
measure most = max(Norm(u)) at nodes of right
";

#[test]
fn parameters_of_several_numbers_and_parameters_made_of_others() {
    let found = of(LOADED.to_owned(), &[], "end, most", "base, shear, pull");
    differences(LOADED, "end", &["base"], &found);
    differences(LOADED, "most", &["base"], &found);
    for (k, change) in [("[0.3, 0.2]", "[0.30001, 0.2]"), ("[0.3, 0.2]", "[0.3, 0.20001]")].into_iter().enumerate() {
        let at = |to: &str| of(LOADED.replacen(change.0, to, 1), &[], "end", "base").results[0].value;
        let lower = ["[0.29999, 0.2]", "[0.3, 0.19999]"][k];
        let central = (at(change.1) - at(lower)) / 2e-5;
        let (name, entries) = &found.results[0].parameters[2];
        assert_eq!((name.as_str(), entries.len()), ("pull", 2));
        assert!((entries[k] - central).abs() < 1e-6 * central.abs(), "{entries:?} {central}");
    }
}

/// Numbers made of measures follow the measures and the parameters in their arithmetic, through each other.
#[test]
fn numbers_made_of_measures_follow_their_arithmetic() {
    let text = format!(
        "{DRIVEN_BLOCKS}{INCREMENTS}measure ratio = fric*shear/(slip + d)\n\
         measure more = (ratio*slip^2 + t*integral(uR(2)^2))/E + max(ratio, 0) on right\n"
    );
    let found = of(text.clone(), &[], "ratio, more, sum(more), slip, shear, ratio at t=1", "E, fric, d");
    let value = |name: &str| found.results.iter().find(|r| r.name == name).expect("a result").value;
    let (fric, d) = (0.4, 3e-3);
    let (slip, shear) = (value("slip"), value("shear"));
    for (parameter, own) in [("E", 0.0), ("fric", shear / (slip + d)), ("d", -fric * shear / ((slip + d) * (slip + d)))]
    {
        let [of_slip, of_shear] = ["slip", "shear"].map(|name| found.number(name, parameter).expect("a derivative"));
        let closed = own + fric * (of_shear / (slip + d) - shear * of_slip / ((slip + d) * (slip + d)));
        let made = found.number("ratio", parameter).expect("a derivative");
        assert!((made - closed).abs() < 1e-12 * closed.abs().max(made.abs()), "{parameter}: {made} {closed}");
    }
    for result in ["more", "sum(more)", "ratio at t=1"] {
        differences(&text, result, &["E", "fric", "d"], &found);
    }
    // a number that only counts has no derivative
    let jumps = format!("{DRIVEN_BLOCKS}{NITSCHE}measure late = if slip > 0.001 then 1 else 0\n");
    let told = differentiated((Path::new("."), jumps), &[], &[], "late", "fric").err().expect("refused");
    assert!(told.contains("jumps and does not slide") && told.contains("scene.wfl:"), "{told}");
    let kink = format!("{DRIVEN_BLOCKS}{NITSCHE}measure bound = max(slip, d - (d - slip))\n");
    let found = of(kink, &[], "bound", "fric");
    assert!(found.near.iter().any(|near| near.finding().line().contains("`bound` is between two branches")));
}

/// Derivatives that a scene states are known to its expectations, each of the shape of its parameter.
#[test]
fn a_scene_states_derivatives_and_expects_them() {
    let stated = "param both = [0, 0]\nmeasure k = slip/d + both(1)*slip\ngradient slip, sum(shear), slip at t = 0.5 + 0.5 with fric, d\n\
                  gradient k with both\nexpect slip_by_fric < 0 and slip_by_d > 0\n\
                  expect abs(k_by_both(1)/slip - 1) < 1e-12 and k_by_both(2) == 0\n";
    let text = format!("{DRIVEN_BLOCKS}{INCREMENTS}{stated}");
    let solved = wfl_tests::solved(text.clone());
    assert!(!solved.outcome.expectations.is_empty());
    assert!(solved.outcome.expectations.iter().all(|e| e.1 == Some(true)), "{:?}", solved.outcome.expectations);
    let wrong = wfl_tests::solved(text.replace("slip_by_d > 0", "slip_by_d < 0"));
    assert!(wrong.outcome.expectations.iter().any(|e| e.1 == Some(false)));
    let refused = |from: &str, to: &str| wfl_tests::refused(&text.replace(from, to));
    assert!(refused("gradient slip,", "gradient slap,").contains("E471"));
    assert!(refused("with fric, d", "with frick, d").contains("did you mean `fric`"));
    assert!(refused("slip at t =", "slip at s =").contains("E471"));
    assert!(refused("= 0.5 + 0.5 with", "= 0.6 with").contains("nearest one ends at"));
    assert!(refused("slip_by_d > 0", "slip_by_nu > 0").contains("slip_by_nu"));
}
