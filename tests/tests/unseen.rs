//! Scenes as a stranger writes them from the pages, for cases that no example has: dipping faults, slip rates written
//! directly over whole earthquake cycles, contact near the limit of explicit steps, floors with a normal of their own.

use wfl_checks::consistency::Verdict;
use wfl_tests::{Solved, doubts, examples, solve};

fn run(text: &str) -> Solved {
    solve(&examples(), text.to_owned(), &[], &[]).unwrap_or_else(|messages| panic!("{messages}"))
}

fn last(solved: &Solved, name: &str) -> f64 {
    solved.measure(solved.outcome.steps.len() - 1, name)
}

fn warning(solved: &Solved, code: &str) -> Option<String> {
    doubts(&solved.outcome).iter().find(|w| w.0 == code).map(|w| w.1.clone())
}

/// A bar falls on a penalty of E/h (bouncing bar of Doyen, Ern and Piperno 2011). The limit falls by 9 % where contact
/// closes: steps of 0.9 of the limit of the start are stable in each state, and gain energy where the states change.
#[test]
fn explicit_steps_near_the_limit_of_closed_contact_are_told() {
    let scene = |fraction: &str| {
        format!(
            "mesh box [0] to [10] cells [100] segment\nregion wall = faces where x == 0\nunknown u : scalar\nstart u = 5\n\
             term inertia on all : Dot2_u*Test_u\nterm stress on all : 900*Grad_u.Grad_Test_u\nload u = -10 on all\n\
             term contact on wall : -pos_part(-9000*u)*Test_u\nscheme explicit fraction={fraction} energy\n\
             steps t = 0 to 12 by auto\nmeasure gap = mean(u) on wall\nevent touch = 0 > gap\n"
        )
    };
    let near = run(&scene("0.9"));
    let text = warning(&near, "W621").expect("a warning");
    assert!(text.contains("0.989 of the stability limit") && text.contains("gains energy"), "{text}");
    // the penalty has given more than the fall
    let fall = last(&near, "energy_loads");
    assert!(last(&near, "energy_contact") < -fall, "{} {fall}", last(&near, "energy_contact"));
    assert!(last(&near, "energy_lost").abs() < 1e-9 * fall, "and the balance does not show it");
    let safe = run(&scene("0.8"));
    assert_eq!(warning(&safe, "W621"), None);
    // impacts at t = 1, 3.667, 6.333, 9 and 11.667
    assert_eq!(safe.outcome.events[0].1.len(), 5);
    for (episode, exact) in safe.outcome.events[0].1.iter().zip([1.0, 11.0 / 3.0, 19.0 / 3.0, 9.0, 35.0 / 3.0]) {
        assert!((episode.begin - exact).abs() < 0.03, "{} {exact}", episode.begin);
    }
}

/// A dipping fault: the displacement is split above, slip rate and state live on it, a multiplier keeps it closed, and the
/// pressure of the body is in the friction. At the end of the split the multiplier has no equation, and follows the next node.
const DIPPING: &str = "
param dip = 60
param c = cos(dip*pi/180)
param s = sin(dip*pi/180)
mesh box [-8,-8] to [8,0] cells [16,8] tri map [x - y*c, y*s]
region left = cells where x*s + y*c < 0
region right = cells where x*s + y*c > 0
region plane = interface from left to right
region fault = faces of plane where y > -4.5
region sides = faces where y < -0.01
unknown u : vector
split u across fault
unknown w : scalar on fault
unknown psi : scalar on fault
multiplier p : scalar on fault
def jump(a) = a - Interpolate(a, neighbor_element)
def d = [-c, s]
def friction = (50 + p)*0.01*asinh(0.5*exp(w + (0.6 + 0.015*psi)/0.01))
def tau0 = 50*0.01*asinh(0.5*exp(0.6/0.01))
quadrature on fault vertex
term elastic on all : 30*Div_u*Div_Test_u + 60*Sym(Grad_u):Grad_Test_u
term balance on fault : -(friction - tau0 - 0.1*t)*(jump(Test_u).d)
term closed on fault : p*(jump(Test_u).Normal) + (jump(u).Normal)*Test_p
term rate on fault : (-(jump(Dot_u).d) + 1 - exp(w))*Test_w
term memory on fault : (Dot_psi - exp(-psi) + exp(w))*Test_psi
fix u = [0,0] on sides
steps t = 0 to 1 by auto with first=1e-3, error=1e-4
measure open = max(abs(jump(u).Normal)) on fault
measure slip = max(abs(jump(u).d)) on fault
measure change = max(abs(p)) on fault
";

#[test]
fn a_dipping_fault_with_a_multiplier_beside_rate_and_state_is_solved() {
    let solved = run(DIPPING);
    assert!(solved.outcome.converged());
    assert_eq!(doubts(&solved.outcome), []);
    let slip = last(&solved, "slip");
    assert!(slip > 1e-3 && last(&solved, "open") < 1e-9 * slip, "{slip}");
    // slip under a free surface changes the pressure of a dipping fault
    assert!(last(&solved, "change") > 1e-3);
    let free = |name: &str| *solved.outcome.report.fields.get(name).expect("a field");
    assert_eq!(free("p") + 1, free("w"), "both sides are one at the end of the split");
}

/// `faces of` an interface is a part of it, with its sides.
#[test]
fn a_part_of_an_interface_has_two_sides() {
    let picked = run(DIPPING);
    let other = run(&DIPPING.replace(
        "region fault = faces of plane where y > -4.5",
        "region a = cells of left where y > -4.5\nregion b = cells of right where y > -4.5\nregion fault = interface from a to b",
    ));
    assert_eq!(last(&picked, "slip").to_bits(), last(&other, "slip").to_bits());
    let faces = "mesh box [0,0] to [2,1] cells [4,2] quad\nregion left = faces where x == 0\n\
                 region low = faces of left where y <= 0.5\nunknown u : scalar\nterm a on all : Grad_u.Grad_Test_u\n\
                 fix u = 0 on low\nmeasure length = integral(1) on low\n";
    assert!((last(&run(faces), "length") - 0.5).abs() < 1e-14);
}

/// A spring slider through earthquakes: the slip rate from 1e-12 to 1 m/s, written directly with a limit of the step, and
/// with logarithms.
#[test]
fn cycles_of_a_slider_are_those_of_its_logarithms() {
    let scene = |fields: &str, laws: &str, steps: &str| {
        format!(
            "param Dc = 0.008\nparam k = 0.3*50*0.005/Dc\n\
             mesh box [0] to [1] cells [1] segment with idle_cells=allowed\nunknown u : scalar global\n{fields}\n\
             def steady = 0.5*asinh(0.5e-3*exp((0.6 + 0.015*log(1e3))/0.01)) + 4.6244e-9\n\
             term balance on global : (0.5*friction + 4.6244*V - steady - k*(1e-9*t - u))*Test_u\n{laws}\n\
             steps t = 0 to 2.2e9 by auto with first=1e3, least=1e-5, error=1e-4{steps}\n\
             measure rate = max(V) on global\nevent quake = rate > 1e-3\n"
        )
    };
    let direct = scene(
        "unknown V : scalar global\nunknown theta : scalar global\n\
         def friction = asinh(V/2e-6*exp((0.6 + 0.015*log(1e-6*theta/Dc))/0.01))",
        "term rate on global : (Dot_u - V)*Test_V\nterm memory on global : (Dot_theta - 1 + V*theta/Dc)*Test_theta\n\
         start V = 1e-9\nstart theta = 1.2*Dc/1e-9",
        ", limit=0.2*Dc/max(V) on global",
    );
    let logarithms = scene(
        "unknown w : scalar global\nunknown psi : scalar global\ndef V = 1e-6*exp(w)\n\
         def friction = asinh(0.5*exp(w + (0.6 + 0.015*psi)/0.01))",
        "term rate on global : (Dot_u - V)*Test_w\nterm memory on global : (Dot_psi - (exp(-psi) - exp(w))*1e-6/Dc)*Test_psi\n\
         start w = log(1e-3)\nstart psi = log(1.2e3)",
        "",
    );
    let times = |text: &str| -> Vec<f64> {
        let solved = run(text);
        assert!(solved.outcome.converged());
        solved.outcome.events[0].1.iter().map(|e| e.begin).collect()
    };
    let (a, b) = (times(&direct), times(&logarithms));
    assert_eq!((a.len(), b.len()), (3, 3), "{a:?} {b:?}");
    a.iter().zip(&b).for_each(|(a, b)| assert!((a / b - 1.0).abs() < 0.01, "{a} {b}"));
}

/// A round body over a flat floor: gap, force and friction along the floor's own normal are consistent at inclined faces,
/// and a wrong sign is told there.
#[test]
fn a_floor_with_a_normal_of_its_own_is_judged_along_it() {
    let scene = |traction: &str| {
        format!(
            "mesh box [-1,-1] to [1,1] cells [8,8] quad map [max(abs(x), abs(y))/sqrt(x^2 + y^2 + 1e-30)*x, \
             max(abs(x), abs(y))/sqrt(x^2 + y^2 + 1e-30)*y]\nregion skin = faces where y < -0.3\nunknown u : vector\n\
             def sigma(v) = 6*Div_v*Id(2) + 8*Sym(Grad_v)\nterm inertia on all : Dot2_u.Test_u\n\
             term stress on all : sigma(u):Grad_Test_u\nstart Dot_u = [1,-1]\nparam gamma = 1e3\n\
             def s = sigma(u)*Normal\ndef p = pos_part({traction} - gamma*(u(2) + y + 1.05))\n\
             def q = Ball_projection(gamma*(u(1) - Previous_u(1)) - s(1), 0.2*p)\n\
             term contact on skin : -p*Test_u(2) + q*Test_u(1)\nsteps t = 0 to 0.02 by 0.01\n"
        )
    };
    let verdict = |text: &str| run(text).scene.contact_forms()[0].verdict.clone();
    let right = verdict(&scene("s(2)"));
    assert!(matches!(right, Verdict::Consistent), "{right:?}");
    let wrong = verdict(&scene("0.5*s(2)"));
    assert!(matches!(wrong, Verdict::Wrong(_)), "{wrong:?}");
}

/// A run whose steps are too few for an estimate says so.
#[test]
fn steps_without_an_estimate_are_told() {
    let scene = |first: &str| {
        format!(
            "mesh box [0] to [1] cells [10] segment\nregion left = faces where x == 0\nregion right = faces where x == 1\n\
             unknown u : scalar\nterm i on all : Dot2_u*Test_u\nterm s on all : Grad_u.Grad_Test_u\nfix u = 0 on left\n\
             load u = 1 on right\nsteps t = 0 to 1 by auto with first={first}, error=1e-4\n"
        )
    };
    let text = warning(&run(&scene("1")), "W618").expect("a warning");
    assert!(text.contains("1 step") && text.contains("smaller `first`"), "{text}");
    assert_eq!(warning(&run(&scene("1e-3")), "W618"), None);
}

/// A mass falls on a spring. Steps of the duration of the impact throw it up to twice its height, while the balance of each
/// step closes; the contact has not given back what it took. Steps that the run chooses give the closed form.
#[test]
fn a_contact_that_gives_more_than_it_took_is_told() {
    let scene = |steps: &str| {
        format!(
            "param m = 2\nparam g = 9.81\nparam k = 1e4\nmesh box [0] to [1] cells [1] segment with idle_cells=allowed\n\
             unknown u : scalar global\nstart u = 1\nterm mass on global : m*(Dot2_u + g)*Test_u\n\
             term stop on global : -k*pos_part(-u)*Test_u\nscheme newmark energy\nsteps t = 0 to 1.2 by {steps}\n\
             measure height = max(u) on global\nevent touch = 0 > height\n"
        )
    };
    let long = run(&scene("0.05"));
    assert!(last(&long, "height") > 1.2, "{}", last(&long, "height"));
    assert!(last(&long, "energy_lost").abs() < 1e-9);
    let text = warning(&long, "W620").expect("a warning");
    assert!(text.contains("`stop` has no force") && text.contains("5.351e1"), "{text}");
    let chosen = run(&scene("auto with first=1e-4, error=1e-8"));
    assert_eq!(warning(&chosen, "W620"), None);
    let (fall, w) = ((2.0f64 / 9.81).sqrt(), 5000.0f64.sqrt());
    let lasts = 2.0 / w * (std::f64::consts::PI - ((2.0f64 * 9.81).sqrt() * w / 9.81).atan());
    let touch = chosen.outcome.events[0].1[0];
    assert!((touch.begin / fall - 1.0).abs() < 1e-4, "{} {fall}", touch.begin);
    let found = touch.end.expect("an end") - touch.begin;
    assert!((found / lasts - 1.0).abs() < 1e-2, "{found} {lasts}");
}

/// A state that no term reads, such as the impulse of a contact, is all error in the step in which it begins: it does not
/// shorten steps, and one that a term reads by way of a definition and of another state does.
#[test]
fn states_that_nothing_reads_leave_the_steps_as_they_are() {
    let scene = |states: &str, law: &str| {
        format!(
            "mesh box [0] to [1] cells [1] segment with idle_cells=allowed\nunknown u : scalar global\nstart u = 1\n\
             {states}term mass on global : 2*(Dot2_u + 9.81)*Test_u\nterm stop on global : -1e4*pos_part(-u)*Test_u{law}\n\
             scheme newmark\nsteps t = 0 to 1.2 by auto with first=1e-4, error=1e-6, least=1e-8\n"
        )
    };
    let impulse = "state J : scalar global := J + timestep*1e4*pos_part(-u)\n";
    let count = |states: &str, law: &str| run(&scene(states, law)).outcome.steps.len();
    let alone = count("", "");
    assert_eq!(count(impulse, ""), alone);
    let read = format!("{impulse}state K : scalar global := K + timestep*J\ndef worn = 0*K\n");
    assert!(count(&read, " + worn*Test_u") > alone + 10);
}
