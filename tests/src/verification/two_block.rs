//! B1, B2, B18: two blocks in homogeneous compression and shear with a closed form for stick and slip.
//!
//! The scenes of the extreme values of gamma, friction and units use the same blocks.

use serde_json::Value;

use super::{
    Benchmark, Case, Tolerance,
    common::{converged, or_failed},
};
use crate::{Attempt, Solved, attempt, examples, reference};

/// The benchmarks of this file.
pub(super) const BENCHMARKS: &[Benchmark] = &[
    Benchmark {
        id: "B1",
        title: "two blocks in homogeneous compression and shear, stick and slip, three methods, every element",
        origin: "closed form (`physics_two_block.json`)",
        slow: false,
        open: None,
        run: homogeneous,
    },
    Benchmark {
        id: "B2",
        title: "the theta term of Nitsche's method is consistent with friction",
        origin: "closed form; the number of a form without its tangential part (`physics_two_block.json`)",
        slow: false,
        open: None,
        run: theta_consistency,
    },
    Benchmark {
        id: "X42",
        title: "a negative gap: as B18",
        origin: "closed form p = M (dn + delta)/L",
        slow: false,
        open: None,
        run: press_fit,
    },
    Benchmark {
        id: "B18",
        title: "press fit: a negative gap",
        origin: "closed form p = M (dn + delta)/L",
        slow: false,
        open: None,
        run: press_fit,
    },
];

/// Two blocks [-1,0] and [0,2] with the homogeneous state of the closed form; p and jn are what the state needs.
const BLOCKS: &str = r#"wfl 1
param E = 25000
param nu = 0.25
param fric = 0.4
param gamma = 1e5
param theta = 0
param dn = 1e-3
param dy = 0
param dz = 2e-4
param p = 10       "pressure of the closed form"
param jn = 0       "normal jump of the closed form"
param ty = 0       "shear stress of the closed form"
param tz = 0
param gap = 0
mesh box [-1,0,0] to [2,1,1] cells [6,2,2] hex
region left  = cells where x < 0
region right = cells where x > 0
region fault = interface from left to right
region west  = faces where x == -1
region east  = faces where x == 2
region lateral_left  = faces of left  where y == 0 or y == 1 or z == 0 or z == 1
region lateral_right = faces of right where y == 0 or y == 1 or z == 0 or z == 1
region guided = nodes of right where x > 0 and (y == 0 or y == 1 or z == 0 or z == 1)
unknown uL : vector Q1 on left
unknown uR : vector Q1 on right
def lambda_   = E*nu/((1+nu)*(1-2*nu))
def mu        = E/(2*(1+nu))
def M         = lambda_ + 2*mu
def sigma(v)  = lambda_*Div_v*Id(3) + 2*mu*Sym(Grad_v)
def trac(v)   = sigma(v)*Normal
def jump(a,b) = a - Interpolate(b, neighbor_element)
def tang(w)   = w - (w.Normal)*Normal
def force     = pos_part(Pn)*Normal + Ball_projection(Pt, fric*pos_part(Pn))
term elastic on left  : sigma(uL):Grad_Test_uL
term elastic on right : sigma(uR):Grad_Test_uR
term lateral on lateral_left  : (lambda_/M)*p*(Normal.Test_uL)
term lateral on lateral_right : (lambda_/M)*p*(Normal.Test_uR) - ([0,ty,tz].Normal)*Test_uR(1)
fix uL = [0,0,0]         on west
fix uR = [-dn, dy, dz]   on east
fix uL(1) = -(p/M)*(x+1) on lateral_left
fix uR(1) = -(p/M)*(x+1) - jn on guided
solver newton with tol=1e-13
measure pressure = mean(pos_part(Pn)) on fault
measure tau_y = mean(-tang(force).[0,1,0]) on fault
measure tau_z = mean(-tang(force).[0,0,1]) on fault
"#;

pub(super) const NITSCHE: &str = r"
def Pn     = gamma*(jump(uL,uR).Normal - gap) - trac(uL).Normal
def Pt     = gamma*tang(jump(uL,uR)) - tang(trac(uL))
def Ptheta = gamma*jump(Test_uL,Test_uR) - theta*trac(Test_uL)
term stress  on fault : -theta/gamma*trac(uL).trac(Test_uL)
term contact on fault : 1/gamma*force.Ptheta
";
pub(super) const PENALTY: &str = r"
def Pn = gamma*(jump(uL,uR).Normal - gap)
def Pt = gamma*tang(jump(uL,uR))
term contact on fault : force.jump(Test_uL,Test_uR)
";
pub(super) const AUGMENTED: &str = r"
multiplier m : vector on fault
quadrature on fault vertex
def Pn = gamma*(jump(uL,uR).Normal - gap) - m.Normal
def Pt = gamma*tang(jump(uL,uR)) - tang(m)
term contact on fault : force.jump(Test_uL,Test_uR)
term law     on fault : -1/gamma*(m + force).Test_m
";

/// Young's modulus of the scene.
pub(super) const YOUNG: f64 = 25_000.0;
/// Size of its cells normal to the interface.
pub(super) const SIZE: f64 = 0.5;
const LENGTH: f64 = 3.0;
/// sup of |sigma n|^2 on a face over the energy of its cell, times h/E: Q1 cubes, nu = 0.25 (coercivity of theta = 1).
pub(super) const TRACE: f64 = 1.704;

/// Digits are estimated from a sample of what rounding may do: by so many a result may be called better than it is.
const OPTIMISM: f64 = 1.0;

/// What is prescribed, and with it the closed form.
#[derive(Clone, Copy, Debug)]
pub(super) struct State {
    /// Compression.
    pub(super) dn: f64,
    /// Shear displacement.
    pub(super) dt: [f64; 2],
    /// Coefficient of friction.
    pub(super) friction: f64,
    /// 1/gamma for penalty, else 0.
    pub(super) compliance: f64,
    /// Initial gap.
    pub(super) gap: f64,
    /// Poisson's ratio.
    pub(super) nu: f64,
}

/// A state that sticks.
pub(super) const STICK: State =
    State { dn: 1e-3, dt: [2e-4, 1e-4], friction: 0.4, compliance: 0.0, gap: 0.0, nu: 0.25 };
/// A state that slides.
pub(super) const SLIP: State = State { dt: [1e-3, 2e-3], ..STICK };

impl State {
    /// Modulus of the column and shear modulus.
    fn moduli(&self) -> [f64; 2] {
        let shear = YOUNG / (2.0 * (1.0 + self.nu));
        [2.0 * shear * (1.0 - self.nu) / (1.0 - 2.0 * self.nu), shear]
    }

    /// Pressure, shear stress, normal jump and tangential jump.
    pub(super) fn exact(&self) -> [f64; 4] {
        let d = self.dt[0].hypot(self.dt[1]);
        let [column, mu] = self.moduli();
        let p = (self.dn - self.gap) / (LENGTH / column + self.compliance);
        let tau = (d / (LENGTH / mu + self.compliance)).min(self.friction * p);
        [p, tau, self.gap + p * self.compliance, d - tau * LENGTH / mu]
    }

    /// Direction of the shear.
    fn along(&self) -> [f64; 2] {
        let d = self.dt[0].hypot(self.dt[1]);
        if d > 0.0 { [self.dt[0] / d, self.dt[1] / d] } else { [0.0; 2] }
    }

    /// Solves it; converged or not.
    pub(super) fn solve(&self, law: &str, gamma: f64, theta: f64, edits: &[(&str, String)]) -> Result<Solved, String> {
        let Attempt { solved, messages } = self.attempt(law, gamma, theta, edits);
        solved.ok_or(messages)
    }

    /// Tries to solve it, with every message.
    pub(super) fn attempt(&self, law: &str, gamma: f64, theta: f64, edits: &[(&str, String)]) -> Attempt {
        attempt(&examples(), scene(law), edits, &self.params(law, gamma, theta))
    }

    /// The parameters of the scene for this state.
    pub(super) fn params(&self, law: &str, gamma: f64, theta: f64) -> Vec<(&'static str, f64)> {
        let [p, tau, jn, _] = self.exact();
        let along = self.along();
        let mut params = vec![
            ("gamma", gamma),
            ("dn", self.dn),
            ("dy", self.dt[0]),
            ("dz", self.dt[1]),
            ("fric", self.friction),
            ("p", p),
            ("jn", jn),
            ("ty", tau * along[0]),
            ("tz", tau * along[1]),
            ("gap", self.gap),
            ("nu", self.nu),
        ];
        if law.contains("theta") {
            params.push(("theta", theta));
        }
        params
    }

    /// The largest error of a nodal displacement in parts of the largest prescribed one.
    pub(super) fn displacement_error(&self, solved: &Solved) -> f64 {
        let [p, tau, jn, _] = self.exact();
        let [column, mu] = self.moduli();
        let along = self.along();
        let scale = self.dn.abs().max(self.dt[0].hypot(self.dt[1]));
        let system = &solved.scene.system;
        let mut worst = 0.0f64;
        for (k, field) in system.fields.iter().enumerate().filter(|(_, f)| f.name != "m") {
            let Some(range) = system.range(k) else { continue };
            for n in 0..field.n_nodes() {
                let x = field.node_position(n)[0];
                let left = field.name == "uL";
                let shear = |c: usize| match left {
                    true => tau * along[c] / mu * (x + 1.0),
                    false => self.dt[c] - tau * along[c] / mu * (2.0 - x),
                };
                let jump = if left { 0.0 } else { jn };
                let exact = [-(p / column) * (x + 1.0) - jump, shear(0), shear(1)];
                for (c, e) in exact.iter().take(field.n_components).enumerate() {
                    let found = solved.outcome.steps[0].state[range.start + field.n_components * n + c];
                    // NaN is kept: max would drop it
                    let gap = (found - e).abs() / scale;
                    worst = if gap > worst || gap.is_nan() { gap } else { worst };
                }
            }
        }
        worst
    }

    /// Displacements within `tolerance` of the largest; pressure and shear within 100 times that of the pressure.
    pub(super) fn compare(&self, what: &str, solved: Result<Solved, String>, tolerance: f64) -> Case {
        let made = solved.and_then(converged).map(|solved| {
            let [p, tau, ..] = self.exact();
            let shear = solved.measure(0, "tau_y").hypot(solved.measure(0, "tau_z"));
            let error = self.displacement_error(&solved);
            let told = solved.outcome.steps[0].accuracy.as_ref().map_or(f64::INFINITY, |a| a.digits());
            let right = -error.max(1e-16).log10();
            Case::new(what)
                .compare("estimated digits minus correct digits", told - right, OPTIMISM, Tolerance::AtMost)
                .compare("error of the displacement", error, tolerance, Tolerance::AtMost)
                .compare("pressure", solved.measure(0, "pressure"), p, Tolerance::Absolute(1e2 * tolerance * p))
                .compare("shear stress", shear, tau, Tolerance::Absolute(1e2 * tolerance * p))
        });
        or_failed(what, made)
    }
}

/// The scene with a contact law.
pub(super) fn scene(law: &str) -> String {
    let text = format!("{BLOCKS}{law}");
    if law.contains("theta") { text } else { text.replace("param theta = 0\n", "") }
}

/// States of the reference: gamma of penalty, state, its numbers.
fn states() -> Vec<(Option<f64>, State, Value)> {
    let data = reference("physics_two_block.json");
    let number = |v: &Value| v.as_f64().unwrap_or(f64::NAN);
    data["cases"]
        .as_array()
        .cloned()
        .unwrap_or_default()
        .into_iter()
        .map(|c| {
            let gamma = c["gamma"].as_f64();
            let state = State {
                dn: number(&c["dn"]),
                dt: [number(&c["dt"][0]), number(&c["dt"][1])],
                friction: number(&c["F"]),
                compliance: gamma.map_or(0.0, |g| 1.0 / g),
                ..STICK
            };
            (gamma, state, c["expected"].clone())
        })
        .collect()
}

/// Cases of one method and many states as one line: its numbers with the state in front.
pub(super) fn merged(what: &str, cases: Vec<Case>) -> Case {
    let mut all = Case::new(what);
    for case in cases {
        if let (None, Some(why)) = (&all.failure, &case.failure) {
            all.failure = Some(format!("{}: {why}", case.what));
        }
        all.numbers.extend(case.numbers.into_iter().map(|mut n| {
            n.label = format!("{}: {}", case.what, n.label);
            n
        }));
    }
    all
}

fn homogeneous() -> Vec<Case> {
    let states = states();
    let mut cases = vec![closed_form(&states)];
    let exact: Vec<State> = states.iter().filter(|s| s.0.is_none()).map(|s| s.1).collect();
    for gamma0 in [1e-3, 1e-1, 2.0, 2e1, 1e3] {
        let gamma = gamma0 * YOUNG / SIZE;
        let runs = [
            (NITSCHE, -1.0, 0.0, "Nitsche theta = -1"),
            (NITSCHE, 0.0, TRACE / 4.0, "Nitsche theta = 0"),
            (NITSCHE, 1.0, TRACE, "Nitsche theta = 1"),
            (AUGMENTED, 0.0, 0.0, "augmented Lagrangian"),
        ];
        for (law, theta, _, name) in runs.into_iter().filter(|r| gamma0 > r.2) {
            let found = exact.iter().map(|s| s.compare(&told(s), s.solve(law, gamma, theta, &[]), 1e-11)).collect();
            cases.push(merged(&format!("{name}, gamma = {gamma0} E/h"), found));
        }
    }
    let penalty = states.iter().filter_map(|(gamma, s, _)| gamma.map(|g| (g, s)));
    let found = penalty.map(|(g, s)| s.compare(&told(s), s.solve(PENALTY, g, 0.0, &[]), 1e-11)).collect();
    cases.push(merged("penalty: the error of its formula", found));
    cases.extend(elements());
    cases
}

fn told(state: &State) -> String {
    format!("F = {}, shear by ({}, {})", state.friction, state.dt[0], state.dt[1])
}

/// The closed form of this file is that of the reference.
fn closed_form(states: &[(Option<f64>, State, Value)]) -> Case {
    let mut case = Case::new("the closed form itself");
    for (_, state, expected) in states {
        for (key, value) in ["pressure", "tau", "normal_jump", "tangential_jump"].iter().zip(state.exact()) {
            let e = expected[*key].as_f64().unwrap_or(f64::NAN);
            let tolerance = Tolerance::Absolute(1e-12 * e.abs().max(1e-6));
            case = case.compare(format!("{}: {key}", told(state)), value, e, tolerance);
        }
    }
    case
}

/// Stick and slip on every other element, in space and in plane strain (which has the same moduli).
fn elements() -> Vec<Case> {
    let mut cases = Vec::new();
    for (shape, element) in [("hex", "Q2"), ("tet", "P1"), ("tet", "P2")] {
        let mut edits =
            vec![("cells [6,2,2] hex", format!("cells [6,2,2] {shape}")), ("vector Q1", format!("vector {element}"))];
        if (shape, element) == ("tet", "P2") {
            // the nodal rule of a quadratic triangle has no weight at its corners
            edits.push(("quadrature on fault vertex", "quadrature on fault degree 4".to_owned()));
        }
        cases.push(every_law(&format!("{element} on {shape}"), [STICK, SLIP], &edits));
    }
    for (shape, element) in [("quad", "Q1"), ("quad", "Q2"), ("tri", "P1"), ("tri", "P2")] {
        let edits = [
            ("box [-1,0,0] to [2,1,1] cells [6,2,2] hex", format!("box [-1,0] to [2,1] cells [6,2] {shape}")),
            (" or z == 0 or z == 1", String::new()),
            ("Id(3)", "Id(2)".to_owned()),
            ("[0,ty,tz]", "[0,ty]".to_owned()),
            ("[0,0,0]", "[0,0]".to_owned()),
            ("[-dn, dy, dz]", "[-dn, dy]".to_owned()),
            ("[0,1,0]", "[0,1]".to_owned()),
            ("[0,0,1]", "[0,0]".to_owned()),
            ("vector Q1", format!("vector {element}")),
        ];
        let plane = [State { dt: [2e-4, 0.0], ..STICK }, State { dt: [3e-3, 0.0], ..STICK }];
        cases.push(every_law(&format!("{element} on {shape}"), plane, &edits));
    }
    cases
}

/// All methods where they are coercive for every element here, and penalty with the error of its formula.
fn every_law(what: &str, states: [State; 2], edits: &[(&str, String)]) -> Case {
    // above the largest constant of a quadratic element
    let gamma = 8.0 * YOUNG / SIZE;
    let mut found = Vec::new();
    for state in states {
        let penalty = State { compliance: 1.0 / gamma, ..state };
        for (state, law, theta, name) in [
            (state, NITSCHE, 0.0, "Nitsche 0"),
            (state, NITSCHE, 1.0, "Nitsche 1"),
            (state, NITSCHE, -1.0, "Nitsche -1"),
            (state, AUGMENTED, 0.0, "augmented Lagrangian"),
            (penalty, PENALTY, 0.0, "penalty"),
        ] {
            let label = format!("{name}, {}", if state.exact()[3] > 1e-4 { "slip" } else { "stick" });
            found.push(state.compare(&label, state.solve(law, gamma, theta, edits), 1e-11));
        }
    }
    merged(what, found)
}

fn theta_consistency() -> Vec<Case> {
    let data = reference("physics_two_block.json");
    let number = |v: &Value| v.as_f64().unwrap_or(f64::NAN);
    let Some((_, state, _)) = states().into_iter().find(|c| c.0.is_none()) else { return Vec::new() };
    let rows = data["theta_consistency"]["rows"].as_array().cloned().unwrap_or_default();
    let mut cases = Vec::new();
    for row in &rows {
        let (gamma, theta) = (number(&row["gamma"]), number(&row["theta"]));
        if theta > 0.0 && gamma * SIZE / YOUNG < TRACE {
            continue;
        }
        let what = format!("theta = {theta}, gamma = {gamma}");
        let solved = state.solve(NITSCHE, gamma, theta, &[]).and_then(converged);
        let expected = number(&row["tau_correct"]);
        let made = solved.map(|s| {
            Case::new(&what).compare("shear stress", s.measure(0, "tau_z").abs(), expected, Tolerance::Relative(1e-10))
        });
        cases.push(or_failed(&what, made));
    }
    // the case above can fail: with the normal part alone the shear stress is off as the reference says
    let wrong = NITSCHE.replace("trac(uL).trac(Test_uL)", "(trac(uL).Normal)*(trac(Test_uL).Normal)");
    let what = "a theta term with its normal part alone is noticed (theta = -1, gamma = 5e4)";
    let made = state.solve(&wrong, 5e4, -1.0, &[]).and_then(converged).and_then(|s| {
        let row = rows.iter().find(|r| r["gamma"] == 5e4 && r["theta"] == -1).ok_or("no row")?;
        let expected = number(&row["tau_if_the_tangential_consistency_term_is_missing"]);
        Ok(Case::new(what).compare(
            "wrong shear stress",
            s.measure(0, "tau_z").abs(),
            expected,
            Tolerance::Relative(1e-2),
        ))
    });
    cases.push(or_failed(what, made));
    cases
}

fn press_fit() -> Vec<Case> {
    let mut cases = Vec::new();
    for gap in [-2e-4, -1e-3] {
        let state = State { dt: [0.0, 2e-4], gap, ..STICK };
        for (law, theta, name) in
            [(NITSCHE, 0.0, "Nitsche 0"), (NITSCHE, -1.0, "Nitsche -1"), (AUGMENTED, 0.0, "augmented Lagrangian")]
        {
            let what = format!("{name}, gap {gap}");
            cases.push(state.compare(&what, state.solve(law, 2e5, theta, &[]), 1e-11));
        }
    }
    cases
}
