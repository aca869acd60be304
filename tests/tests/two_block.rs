//! Closed forms: two blocks in homogeneous compression and shear (B1, B2, B18), the fault held on one side (B4), the
//! inclined patch (B5).

use serde_json::Value;
use wfl_tests::{Solved, examples, reference, solve};

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

const NITSCHE: &str = r"
def Pn     = gamma*(jump(uL,uR).Normal - gap) - trac(uL).Normal
def Pt     = gamma*tang(jump(uL,uR)) - tang(trac(uL))
def Ptheta = gamma*jump(Test_uL,Test_uR) - theta*trac(Test_uL)
term stress  on fault : -theta/gamma*trac(uL).trac(Test_uL)
term contact on fault : 1/gamma*force.Ptheta
";
const PENALTY: &str = r"
def Pn = gamma*(jump(uL,uR).Normal - gap)
def Pt = gamma*tang(jump(uL,uR))
term contact on fault : force.jump(Test_uL,Test_uR)
";
const AUGMENTED: &str = r"
multiplier m : vector on fault
quadrature on fault vertex
def Pn = gamma*(jump(uL,uR).Normal - gap) - m.Normal
def Pt = gamma*tang(jump(uL,uR)) - tang(m)
term contact on fault : force.jump(Test_uL,Test_uR)
term law     on fault : -1/gamma*(m + force).Test_m
";

const YOUNG: f64 = 25_000.0;
const MU: f64 = 10_000.0;
const M: f64 = 30_000.0;
const LENGTH: f64 = 3.0;

/// A case of the closed form.
#[derive(Clone, Copy, Debug)]
struct Case {
    dn: f64,
    dt: [f64; 2],
    friction: f64,
    /// 1/gamma for penalty, else 0.
    compliance: f64,
    gap: f64,
}

impl Case {
    /// Pressure, shear stress, normal jump and tangential jump.
    fn exact(&self) -> [f64; 4] {
        let d = self.dt[0].hypot(self.dt[1]);
        let p = (self.dn - self.gap) / (LENGTH / M + self.compliance);
        let tau = (d / (LENGTH / MU + self.compliance)).min(self.friction * p);
        [p, tau, self.gap + p * self.compliance, d - tau * LENGTH / MU]
    }

    /// Direction of the shear.
    fn along(&self) -> [f64; 2] {
        let d = self.dt[0].hypot(self.dt[1]);
        if d > 0.0 { [self.dt[0] / d, self.dt[1] / d] } else { [0.0; 2] }
    }

    fn solve(&self, law: &str, gamma: f64, theta: f64, edits: &[(&str, String)]) -> Result<Solved, String> {
        let [p, tau, jn, _] = self.exact();
        let along = self.along();
        let params = [
            ("gamma", gamma),
            ("theta", theta),
            ("dn", self.dn),
            ("dy", self.dt[0]),
            ("dz", self.dt[1]),
            ("fric", self.friction),
            ("p", p),
            ("jn", jn),
            ("ty", tau * along[0]),
            ("tz", tau * along[1]),
            ("gap", self.gap),
        ];
        let params: Vec<(&str, f64)> = params.into_iter().filter(|(n, _)| law == NITSCHE || *n != "theta").collect();
        let text = if law == NITSCHE {
            format!("{BLOCKS}{law}")
        } else {
            format!("{BLOCKS}{law}").replace("param theta = 0\n", "")
        };
        solve(&examples(), text, edits, &params)
    }

    /// Every nodal displacement within `tolerance` of the largest, pressure and shear likewise.
    fn check(&self, what: &str, solved: &Solved, tolerance: f64) {
        let [p, tau, jn, _] = self.exact();
        assert!(solved.outcome.converged(), "{what} {self:?}: not converged");
        let d = self.dt[0].hypot(self.dt[1]);
        let along = self.along();
        let scale = self.dn.abs().max(d);
        let system = &solved.scene.system;
        for (k, field) in system.fields.iter().enumerate().filter(|(_, f)| f.name != "m") {
            let start = system.range(k).expect("an unknown").start;
            for n in 0..field.n_nodes() {
                let x = field.node_position(n)[0];
                let shear = |c: usize| {
                    if field.name == "uL" {
                        tau * along[c] / MU * (x + 1.0)
                    } else {
                        self.dt[c] - tau * along[c] / MU * (2.0 - x)
                    }
                };
                let jump = if field.name == "uL" { 0.0 } else { jn };
                let exact = [-(p / M) * (x + 1.0) - jump, shear(0), shear(1)];
                for (c, e) in exact.iter().take(field.n_components).enumerate() {
                    let found = solved.outcome.steps[0].state[start + field.n_components * n + c];
                    let gap = (found - e).abs() / scale;
                    assert!(gap < tolerance, "{what} {self:?}: {}({}) at x = {x} is off by {gap:e}", field.name, c + 1);
                }
            }
        }
        let found = solved.measure(0, "tau_y").hypot(solved.measure(0, "tau_z"));
        assert!((found - tau).abs() <= 1e2 * tolerance * p, "{what} {self:?}: tau {found} in place of {tau}");
        assert!((solved.measure(0, "pressure") - p).abs() <= 1e2 * tolerance * p, "{what} {self:?}: pressure");
    }
}

fn cases() -> Vec<(Option<f64>, Case, Value)> {
    let data = reference("physics_two_block.json");
    let number = |v: &Value| v.as_f64().expect("a number");
    let list = data["cases"].as_array().expect("cases").clone();
    list.into_iter()
        .map(|c| {
            let gamma = c["gamma"].as_f64();
            let case = Case {
                dn: number(&c["dn"]),
                dt: [number(&c["dt"][0]), number(&c["dt"][1])],
                friction: number(&c["F"]),
                compliance: gamma.map_or(0.0, |g| 1.0 / g),
                gap: 0.0,
            };
            (gamma, case, c["expected"].clone())
        })
        .collect()
}

/// gamma h/E from 1e-3 to 1e3 with h = 0.5.
fn gammas() -> impl Iterator<Item = f64> {
    [1e-3, 1e-1, 2.0, 2e1, 1e3].into_iter().map(|g| g * YOUNG / 0.5)
}

#[test]
fn the_closed_form_here_is_that_of_the_reference() {
    for (_, case, expected) in cases() {
        let found = case.exact();
        for (key, value) in ["pressure", "tau", "normal_jump", "tangential_jump"].iter().zip(found) {
            let e = expected[*key].as_f64().expect("a number");
            assert!((value - e).abs() <= 1e-12 * e.abs().max(1e-6), "{key}: {value} against {e}");
        }
    }
}

#[test]
fn nitsche_and_augmented_lagrangian_are_exact_for_every_gamma() {
    for (_, case, _) in cases().iter().filter(|c| c.0.is_none()) {
        for gamma in gammas() {
            let gamma0 = gamma * 0.5 / YOUNG;
            for (theta, bound) in [(-1.0, 0.0), (0.0, 1.704 / 4.0), (1.0, 1.704)] {
                if gamma0 > bound {
                    let solved = case.solve(NITSCHE, gamma, theta, &[]).unwrap_or_else(|e| panic!("{e}"));
                    case.check(&format!("Nitsche {theta} gamma0 {gamma0}"), &solved, 1e-11);
                }
            }
            let solved = case.solve(AUGMENTED, gamma, 0.0, &[]).unwrap_or_else(|e| panic!("{e}"));
            case.check(&format!("augmented Lagrangian gamma0 {gamma0}"), &solved, 1e-11);
        }
    }
}

#[test]
fn penalty_has_the_error_of_its_formula() {
    for (gamma, case, _) in cases().iter().filter(|c| c.0.is_some()) {
        let solved = case.solve(PENALTY, gamma.expect("filtered"), 0.0, &[]).unwrap_or_else(|e| panic!("{e}"));
        case.check("penalty", &solved, 1e-11);
    }
}

/// The same states on other cells, each with stick and slip.
#[test]
fn other_elements_are_exact_too() {
    let (stick, slip) = stick_and_slip([2e-4, 1e-4], [1e-3, 2e-3]);
    for (shape, element) in [("hex", "Q2"), ("tet", "P1"), ("tet", "P2")] {
        let mut edits =
            vec![("cells [6,2,2] hex", format!("cells [6,2,2] {shape}")), ("vector Q1", format!("vector {element}"))];
        if (shape, element) == ("tet", "P2") {
            // the nodal rule of a quadratic triangle has no weight at its corners
            edits.push(("quadrature on fault vertex", "quadrature on fault degree 4".to_owned()));
        }
        for case in [stick, slip] {
            every_law(case, &format!("{shape} {element}"), &edits);
        }
    }
}

/// Plane strain has the same moduli: the closed form without its third direction.
#[test]
fn plane_elements_are_exact_too() {
    let (stick, slip) = stick_and_slip([2e-4, 0.0], [3e-3, 0.0]);
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
        for case in [stick, slip] {
            every_law(case, &format!("{shape} {element}"), &edits);
        }
    }
}

fn stick_and_slip(small: [f64; 2], large: [f64; 2]) -> (Case, Case) {
    let stick = Case { dn: 1e-3, dt: small, friction: 0.4, compliance: 0.0, gap: 0.0 };
    let slip = Case { dt: large, ..stick };
    assert!(stick.exact()[3].abs() < 1e-15 && slip.exact()[3] > 1e-4, "one sticks, one slips");
    (stick, slip)
}

/// All variants of Nitsche's method where they are coercive for every element here, the augmented Lagrangian, and
/// penalty with the error of its formula.
fn every_law(case: Case, what: &str, edits: &[(&str, String)]) {
    // gamma h/E = 8: above the largest constant of a quadratic element
    let gamma = 8.0 * YOUNG / 0.5;
    let penalty = Case { compliance: 1.0 / gamma, ..case };
    let runs = [
        (case, NITSCHE, 0.0, "Nitsche 0"),
        (case, NITSCHE, 1.0, "Nitsche 1"),
        (case, NITSCHE, -1.0, "Nitsche -1"),
        (case, AUGMENTED, 0.0, "augmented Lagrangian"),
        (penalty, PENALTY, 0.0, "penalty"),
    ];
    for (case, law, theta, name) in runs {
        let solved = case.solve(law, gamma, theta, edits).unwrap_or_else(|e| panic!("{name} on {what}: {e}"));
        case.check(&format!("{name} on {what}"), &solved, 1e-11);
    }
}

/// A consistency term without its tangential part would give other shear stresses (error F7 of the report).
#[test]
fn the_theta_term_is_consistent_with_friction() {
    let data = reference("physics_two_block.json");
    let (_, case, _) = cases().into_iter().find(|c| c.0.is_none()).expect("an exact case");
    for row in data["theta_consistency"]["rows"].as_array().expect("rows") {
        let (gamma, theta) = (row["gamma"].as_f64().expect("gamma"), row["theta"].as_f64().expect("theta"));
        if theta > 0.0 && gamma * 0.5 / YOUNG < 1.704 {
            continue;
        }
        let solved = case.solve(NITSCHE, gamma, theta, &[]).unwrap_or_else(|e| panic!("{e}"));
        let tau = solved.measure(0, "tau_z").abs();
        let correct = row["tau_correct"].as_f64().expect("tau");
        assert!((tau / correct - 1.0).abs() < 1e-10, "gamma {gamma} theta {theta}: {tau}");
    }
}

/// The test above can fail: with the normal part alone the shear stress is off as the reference says it is.
#[test]
fn a_theta_term_without_its_tangential_part_is_noticed() {
    let data = reference("physics_two_block.json");
    let (_, case, _) = cases().into_iter().find(|c| c.0.is_none()).expect("an exact case");
    let normal_only = NITSCHE.replace("trac(uL).trac(Test_uL)", "(trac(uL).Normal)*(trac(Test_uL).Normal)");
    let wrong = [(NITSCHE.lines().nth(4).expect("the theta term"), normal_only.lines().nth(4).expect("it").to_owned())];
    let rows = data["theta_consistency"]["rows"].as_array().expect("rows");
    let row = rows.iter().find(|r| r["gamma"] == 5e4 && r["theta"] == -1).expect("a row");
    let solved = case.solve(NITSCHE, 5e4, -1.0, &wrong).unwrap_or_else(|e| panic!("{e}"));
    let tau = solved.measure(0, "tau_z").abs();
    let expected = row["tau_if_the_tangential_consistency_term_is_missing"].as_f64().expect("tau");
    assert!((tau / expected - 1.0).abs() < 0.01, "{tau}, not {expected}");
}

#[test]
fn a_press_fit_is_a_negative_gap() {
    for gap in [-2e-4, -1e-3] {
        let case = Case { dn: 1e-3, dt: [0.0, 2e-4], friction: 0.4, compliance: 0.0, gap };
        for (law, theta) in [(NITSCHE, 0.0), (NITSCHE, -1.0), (AUGMENTED, 0.0)] {
            let solved = case.solve(law, 2e5, theta, &[]).unwrap_or_else(|e| panic!("{e}"));
            case.check("press fit", &solved, 1e-11);
        }
    }
}

/// With only the left bottom fixed the right block hangs on contact and friction: equilibrium is exact.
fn hanging(method: &str, t: f64) -> Result<Solved, String> {
    let folder = examples().join("fault");
    let text = std::fs::read_to_string(folder.join(method)).expect("an example");
    let edits = [
        ("fix  uL, uR = [0,0,0]  on bottom", "fix  uL = [0,0,0]  on bottom".to_owned()),
        ("steps t = 0 to 9.5 by 0.5", format!("steps t = {t} to {t} by 1")),
    ];
    solve(&folder, text, &edits, &[])
}

#[test]
fn a_block_held_by_friction_alone_is_in_equilibrium() {
    for method in ["nitsche.wfl", "penalty.wfl", "augmented_lagrangian.wfl"] {
        for t in [0.0, 2.0, 4.0, 4.79] {
            let solved = hanging(method, t).unwrap_or_else(|e| panic!("{method}: {e}"));
            assert!(solved.outcome.converged(), "{method} at t = {t}");
            for (name, expected) in [("Fn", -48.0), ("Fty", 0.0), ("Ftz", -4.0 * t)] {
                let found = solved.measure(0, name);
                assert!((found - expected).abs() < 1e-9 * 48.0, "{method} at t = {t}: {name} = {found}");
            }
        }
    }
}

#[test]
fn beyond_the_friction_limit_there_are_no_numbers() {
    for method in ["nitsche.wfl", "penalty.wfl", "augmented_lagrangian.wfl"] {
        for t in [4.81, 5.0] {
            if let Ok(solved) = hanging(method, t) {
                assert!(!solved.outcome.converged(), "{method} at t = {t} claims a solution");
            }
        }
    }
}

const PATCH: &str = r"wfl 1
param E = 25000
param nu = 0.25
param fric = 0.8
param gamma = 2e5
param theta = 0
param slope = 0
mesh box [-1,-1] to [1,1] cells [4,4] quad map [x + slope*y*(1-abs(x)), y]
region left  = cells where x < slope*y
region right = cells where x > slope*y
region fault = interface from left to right
region west  = faces where x == -1
region outer_left  = (boundary & boundary_left) - west
region outer_right = boundary & boundary_right
unknown uL : vector Q1 on left
unknown uR : vector Q1 on right
def lambda_   = E*nu/((1+nu)*(1-2*nu))
def mu        = E/(2*(1+nu))
def sigma(v)  = lambda_*Div_v*Id(2) + 2*mu*Sym(Grad_v)
def trac(v)   = sigma(v)*Normal
def jump(a,b) = a - Interpolate(b, neighbor_element)
def tang(w)   = w - (w.Normal)*Normal
def stress    = [-10, 1; 1, -3]
def strain    = (stress - lambda_/(2*lambda_ + 2*mu)*Trace(stress)*Id(2))/(2*mu)
def Pn        = gamma*(jump(uL,uR).Normal) - trac(uL).Normal
def Pt        = gamma*tang(jump(uL,uR)) - tang(trac(uL))
def Ptheta    = gamma*jump(Test_uL,Test_uR) - theta*trac(Test_uL)
def force     = pos_part(Pn)*Normal + Ball_projection(Pt, fric*pos_part(Pn))
term elastic on left  : sigma(uL):Grad_Test_uL
term elastic on right : sigma(uR):Grad_Test_uR
term theta_  on fault : -theta/gamma*trac(uL).trac(Test_uL)
term contact on fault : 1/gamma*force.Ptheta
term pulled  on outer_left  : -(stress*Normal).Test_uL
term pulled  on outer_right : -(stress*Normal).Test_uR
fix uL = strain*X on west
solver newton with tol=1e-13
measure pressure = mean(pos_part(Pn)) on fault
measure shear    = mean(Norm(tang(force))) on fault
measure highest  = max(Norm(tang(force))) on fault
";

#[test]
fn an_inclined_interface_passes_the_patch_test() {
    let expected = [
        (10.0f64, 10.130_944_316_1, 0.257_377_880_9),
        (20.0, 9.823_943_160_6, 1.483_712_190_8),
        (30.0, 9.116_025_403_8, 2.531_088_913_2),
    ];
    let text = PATCH
        .replace("region outer_left  = (boundary & boundary_left) - west\n", "region boundary_left = faces of left\nregion boundary_right = faces of right\nregion outer_left  = (boundary & boundary_left) - west\n");
    for (angle, pressure, shear) in expected {
        for theta in [-1.0, 0.0, 1.0] {
            let slope = angle.to_radians().tan();
            let params = [("slope", slope), ("theta", theta)];
            let solved = solve(&examples(), text.clone(), &[], &params).unwrap_or_else(|e| panic!("{e}"));
            assert!(solved.outcome.converged());
            for (name, e) in [("pressure", pressure), ("shear", shear), ("highest", shear)] {
                let found = solved.measure(0, name);
                assert!((found - e).abs() < 1e-9, "{angle} degrees, theta {theta}: {name} = {found}, not {e}");
            }
        }
    }
}
