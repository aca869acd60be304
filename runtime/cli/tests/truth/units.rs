//! Units are nobody's business: a scene in millimetres and gigapascals says and gives what the same scene in metres and
//! pascals does. Parameters carry all of their numbers, with units; each is multiplied by what its unit is multiplied by.
//!
//! Checks that compare a number of the scene with one of their own, or a length with a stress, are found here.

use super::run;

/// What the units of length, stress and time are divided by.
#[derive(Clone, Copy, Debug)]
struct Change([f64; 3]);

/// Each unit alone by a million and a billion, and all of them.
const CHANGES: [Change; 8] = [
    Change([1e-6, 1.0, 1.0]),
    Change([1e6, 1.0, 1.0]),
    Change([1.0, 1e-9, 1.0]),
    Change([1.0, 1e9, 1.0]),
    Change([1.0, 1.0, 1e-9]),
    Change([1.0, 1.0, 1e9]),
    Change([1e-3, 1e6, 1e6]),
    Change([1e3, 1e-6, 1e-6]),
];

impl Change {
    /// What numbers with this unit are multiplied by: `kg/m^3`, `Pa*s`.
    fn of(self, unit: &str) -> f64 {
        let Self([length, stress, time]) = self;
        let (mut factor, mut sign, mut rest) = (1.0, 1, unit);
        while !rest.is_empty() {
            let end = rest.find(['*', '/']).unwrap_or(rest.len());
            let (name, power) = rest[..end].split_once('^').unwrap_or((&rest[..end], "1"));
            let one = match name {
                "m" => length,
                "Pa" => stress,
                "s" => time,
                "kg" => stress * length * time * time,
                "1" => 1.0,
                other => panic!("the unit `{other}` is not known here"),
            };
            factor *= f64::powi(one, sign * power.parse::<i32>().expect("a power"));
            sign = if rest[end..].starts_with('/') { -1 } else { 1 };
            rest = rest.get(end + 1..).unwrap_or_default();
        }
        factor
    }

    /// The parameters of a scene that change, as words of the command.
    fn words(self, scene: &str) -> Vec<String> {
        let word = |line: &str| {
            let (name, rest) = line.strip_prefix("param ")?.split_once(" = ")?;
            let (value, unit) = rest.split_once(" [")?;
            let unit = unit.split(']').next()?;
            Some(format!("{name}={:e}", value.parse::<f64>().ok()? * self.of(unit)))
        };
        scene.lines().filter_map(word).collect()
    }
}

/// Two blocks that are pressed together and slide to and fro: declarations, the next slip and the contact of a method.
fn fault(multiplier: &str, slip: &str, contact: &str) -> String {
    format!(
        "wfl 1\nuse \"elasticity\"\nuse \"contact\"\nparam L = 1 [m]\nparam E = 100 [Pa]\nparam nu = 0.3\nparam gamma = 1000 [Pa/m]\n\
         param press = 0.01 [m]\nparam slide = 0.02 [m]\nparam bound = 0.3\nmesh box [-L,0] to [L,2*L] cells [4,4] quad\n\
         region left = cells where x < 0\nregion right = cells where x > 0\nregion fault = interface from left to right\n\
         region west = faces where x == -L\nregion east = faces where x == L\nunknown uL : vector on left [m]\n\
         unknown uR : vector on right [m]\n{multiplier}def sigma(v) = stress(v, lame_lambda(E, nu), lame_mu(E, nu))\n\
         term left on left : sigma(uL):Grad_Test_uL\nterm right on right : sigma(uR):Grad_Test_uR\n\
         state slid : vector on fault [m] := {slip}\nterm contact on fault : {contact}\nfix uL = [0,0] on west\n\
         fix uR = [-press, slide*t*(2-t)] on east\nsteps t = 0 to 2 by 0.25\nmeasure force = reaction(uR(2)) on east\n\
         measure normal = reaction(uR(1)) on east\nmeasure slip = max(Norm(slid)) on fault\n"
    )
}

const FAULT: &[(&str, &str)] = &[("force", "Pa*m"), ("normal", "Pa*m"), ("slip", "m")];

/// A bar that meets a wall; the law of the wall and the scheme with its steps.
fn bar(wall: &str, scheme: &str) -> String {
    format!(
        "wfl 1\nparam L = 1 [m]\nparam E = 1e4 [Pa]\nparam rho = 1 [kg/m^3]\nparam v0 = 1 [m/s]\nparam gamma = 1e6 [Pa/m]\n\
         param c = sqrt(E/rho)\nmesh box [0] to [L] cells [20] segment\nregion wall = faces where x == 0\nunknown u : scalar [m]\n\
         start u = 0\nstart Dot_u = -v0\nterm inertia on all : rho*Dot2_u*Test_u\nterm stress on all : E*Grad_u.Grad_Test_u\n\
         term contact on wall : {wall}\n{scheme}\nmeasure back = mean(Dot_u) on all\n"
    )
}

const HYPERELASTIC: &str = "wfl 1
param L = 1 [m]
param mu = 80 [Pa]
param lam = 120 [Pa]
param gamma = 2e4 [Pa/m]
param fric = 0.3
param down = 0.1 [m]
mesh box [0,0] to [L,L] cells [4,4] quad
region floor = faces where y == 0
region lid = faces where y == L
unknown u : vector Q2 [m]
def F = Id(2) + Grad_u
def P = mu*(F - Inv(F)') + lam*log(Det(F))*Inv(F)'
def tang(w) = w - (w.Normal)*Normal
def Pn = gamma*(u.Normal) - (P*Normal).Normal
def Pt = gamma*tang(u) - tang(P*Normal)
term elastic on all : P:Grad_Test_u
term contact on floor : (pos_part(Pn)*Normal + Ball_projection(Pt, fric*pos_part(Pn))).Test_u
fix u = [0, -down*t] on lid
steps t = 0 to 1 by 0.5
measure force = reaction(u(2)) on lid
measure wide = max(u(1)) on all
";

const VISCOPLASTIC: &str = "wfl 1
param L = 1 [m]
param E = 200000 [Pa]
param nu = 0.3
param sy = 250 [Pa]
param eta = 1000 [Pa*s]
param rate = 1e-3 [1/s]
param dt = 0.5 [s]
mesh box [0,0,0] to [2*L,L,L] cells [2,1,1] hex
region west = faces where x == 0
region east = faces where x == 2*L
unknown u : vector [m]
def mu = E/(2*(1+nu))
def bulk = E/(3*(1-2*nu))
def trial(v) = 2*mu*(Deviator(Sym(Grad_v)) - Previous_ep)
def misses(v) = sqrt(1.5)*Norm(trial(v))
def gain(v) = timestep/(eta + 3*mu*timestep)*pos_part(misses(v) - sy)
def flow(v) = sqrt(1.5)*gain(v)*Normalized(trial(v))
def stress(v) = bulk*Div_v*Id(3) + trial(v) - 2*mu*flow(v)
state ep : matrix on all := Previous_ep + flow(u)
term equilibrium on all : stress(u):Grad_Test_u
fix u = [0,0,0] on west
fix u(1) = rate*t*L on east
steps t = 0 to 8*dt by dt [s]
measure pull = reaction(u(1)) on east
measure plastic = max(Norm(ep)) on all
";

const CONSOLIDATION: &str = "wfl 1
use \"poro\"
use \"elasticity\"
param L = 1 [m]
param E = 1000 [Pa]
param nu = 0.25
param k = 1e-3 [m^2/Pa/s]
param q = 10 [Pa]
param T = L*L/(k*E)
mesh box [0,0] to [L,L] cells [4,4] quad
region top = faces where y == L
region bottom = faces where y == 0
region sides = faces where x == 0 or x == L
unknown u : vector Q2 [m]
unknown p : scalar Q1 [Pa]
term momentum on all : sigma(u, E, nu):Grad_Test_u
term coupling on all : biot(u, p, 1)
term flow on all : darcy(p, k)
load u = [0,-q*x/L] on top
fix u(1) = 0 on sides
fix u(2) = 0 on bottom
fix p = 0 on top
steps t = 0 to T by T/20 [s]
measure bottom_pressure = value(p) at [0,0]
measure settlement = value(-u(2)) at [L,L]
balance water of p
";

const COHESIVE: &str = "wfl 1
param L = 1 [m]
param M = 100 [Pa]
param k = 40 [Pa/m]
param wc = 0.5 [m]
param w0 = 0.3 [m]
mesh box [-L,0] to [L,L] cells [8,4] quad
region left = cells where x < 0
region right = cells where x > 0
region joint = interface from left to right
region west = faces where x == -L
region east = faces where x == L
unknown uL : vector on left [m]
unknown uR : vector on right [m]
def sigma(v) = M*Sym(Grad_v)
def opening = Interpolate(uR, neighbor_element) - uL
def pull(w) = k*w*exp(-Norm(w)/wc)
def pulled = w0 + k*w0*exp(-w0/wc)*2*L/M
term elastic on left : sigma(uL):Grad_Test_uL
term elastic on right : sigma(uR):Grad_Test_uR
term cohesion on joint : pull(opening).(Interpolate(Test_uR, neighbor_element) - Test_uL)
fix uL = [0, 0] on west
fix uR = [pulled*t, 0] on east
steps t = 0 to 1 by 0.25
measure w = mean(opening(1)) on joint
measure traction = mean(pull(opening)(1)) on joint
";

/// Runs a scene in all units; the exit code, the codes of messages and the measures may not depend on them.
fn assert_same(name: &str, scene: &str, measures: &[(&str, &str)]) {
    let plain = run(&format!("units-{name}"), scene, &[]);
    assert!(plain.code == 0, "{name}: {}", plain.text);
    for (number, change) in CHANGES.into_iter().enumerate() {
        let words = change.words(scene);
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let ran = run(&format!("units-{name}-{number}"), scene, &words);
        assert!((ran.code, ran.codes()) == (0, plain.codes()), "{name}, {change:?}: {}", ran.text);
        for (measure, unit) in measures {
            let (value, expected) = (ran.last(measure), plain.last(measure) * change.of(unit));
            let apart = (value / expected - 1.0).abs();
            assert!(apart < 1e-7, "{name}, {change:?}: {measure} is {value:e}, not {expected:e}");
        }
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn faults_that_slide_are_the_same_in_all_units() {
    let nitsche = |theta: &str| {
        let contact = format!("nitsche_sliding(uL, uR, slid, gamma, {theta}, bound)");
        fault("", "nitsche_slip(uL, uR, slid, gamma, bound)", &contact)
    };
    for theta in ["0", "1", "-1"] {
        assert_same(&format!("nitsche{theta}"), &nitsche(theta), FAULT);
    }
    let penalty = fault("", "penalty_slip(uL, uR, slid, gamma, bound)", "penalty_sliding(uL, uR, slid, gamma, bound)");
    assert_same("penalty", &penalty, FAULT);
    // what is projected are lengths, and the stiffness stands before them
    let lengths = "gamma*(pos_part(jump(uL, uR).Normal)*Normal + Ball_projection(tang(jump(uL, uR)) - Previous_slid, \
                   bound*pos_part(jump(uL, uR).Normal))).jump(Test_uL, Test_uR)";
    assert_same("lengths", &fault("", "penalty_slip(uL, uR, slid, gamma, bound)", lengths), FAULT);
    let slip = "augmented_slip(uL, uR, lambda, slid, gamma, bound)";
    let contact = "augmented_sliding(uL, uR, lambda, slid, gamma, bound)";
    let augmented = fault("multiplier lambda : vector on fault [Pa]\n", slip, contact);
    assert_same("augmented", &augmented, FAULT);
    // a multiplier by another name is told, and the numbers are those of a multiplier
    let unknown = run("units-unknown", &augmented.replace("multiplier lambda", "unknown lambda"), &[]);
    let multiplier = run("units-multiplier", &augmented, &[]);
    assert!((unknown.code, unknown.codes()) == (0, vec!["W518"]), "{}", unknown.text);
    assert!((unknown.last("force") / multiplier.last("force") - 1.0).abs() < 1e-9, "{}", unknown.text);
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn bodies_in_time_are_the_same_in_all_units() {
    let (newmark, explicit) =
        ("scheme newmark\nsteps t = 0 to 3*L/c by L/c/100 [s]", "scheme explicit\nsteps t = 0 to 3*L/c by auto [s]");
    for (name, scheme) in [("newmark", newmark), ("explicit", explicit)] {
        // of no force to one, and of a stiffness that stands before a length
        for (form, wall) in [("stress", "-pos_part(-gamma*u)*Test_u"), ("length", "-gamma*pos_part(-u)*Test_u")] {
            assert_same(&format!("{name}-{form}"), &bar(wall, scheme), &[("back", "m/s")]);
        }
    }
    assert_same("viscoplastic", VISCOPLASTIC, &[("pull", "Pa*m^2"), ("plastic", "1")]);
    assert_same("consolidation", CONSOLIDATION, &[("bottom_pressure", "Pa"), ("settlement", "m")]);
}

#[test]
fn finite_strain_and_cohesion_are_the_same_in_all_units() {
    assert_same("hyperelastic", HYPERELASTIC, &[("force", "Pa*m"), ("wide", "m")]);
    assert_same("cohesive", COHESIVE, &[("w", "m"), ("traction", "Pa")]);
}

#[test]
fn a_pressure_that_passes_through_zero_leaves_nothing_to_judge() {
    // at t = 0.25, 0.75, .. bodies are displaced without a load: what is left of contact there is rounding
    let slip = "augmented_slip(uL, uR, lambda, slid, gamma, bound)";
    let contact = "augmented_sliding(uL, uR, lambda, slid, gamma, bound)";
    let scene = fault("multiplier lambda : vector on fault [Pa]\n", slip, contact);
    let scene = scene.replace("[-press, slide*t*(2-t)]", "[-press*cos(2*pi*t), slide*t]");
    for gamma in ["1e3", "1e5", "1e7"] {
        run("units-zero", &scene, &[&format!("gamma={gamma}")]).assert_silent();
    }
}

#[test]
fn a_rigid_body_is_no_traction() {
    // a plate that moves as a whole presses a block of modulus 1000 with P = 1: down by P/1000 and the overlap P/gamma
    let plate = "wfl 1
param gamma = 1e5
param P = 1
mesh box [0,0] to [1,1] cells [4,4] quad
region top = faces where y == 1
region bottom = faces where y == 0
unknown u : vector
unknown d : vector global
term body on all : 1000*Sym(Grad_u):Grad_Test_u
term plate on top : gamma*pos_part((u - d).Normal)*((Test_u - Test_d).Normal)
term guide on global : 10*d(1)*Test_d(1)
term push on global : P*Test_d(2)
fix u = [0,0] on bottom
start d = [0,-1e-4]
measure down = mean(d(2)) on all
";
    let ran = run("rigid-plate", plate, &[]);
    ran.assert_silent();
    assert!((ran.last("down") + 1.0 / 1000.0 + 1.0 / 1e5).abs() < 1e-9, "{}", ran.text);
}
