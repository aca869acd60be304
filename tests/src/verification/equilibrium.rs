//! B4, B5: a block that hangs on friction alone, and the inclined patch.

use super::{
    Benchmark, Case, Tolerance,
    common::{converged, or_failed},
    two_block::merged,
};
use crate::{Solved, examples, solve};

/// The benchmarks of this file.
pub(super) const BENCHMARKS: &[Benchmark] = &[
    Benchmark {
        id: "B4",
        title: "the fault with only the left block fixed: equilibrium of the right one up to the friction limit",
        origin: "equilibrium: Fn = -48, Fty = 0, Ftz = -4 t for t <= 4.8, none above",
        slow: false,
        open: None,
        run: hanging_block,
    },
    Benchmark {
        id: "B5",
        title: "inclined interface under a uniform stress (10, 20, 30 degrees)",
        origin: "closed form: sigma n . n and the tangential part of sigma n",
        slow: false,
        open: None,
        run: inclined_patch,
    },
];

/// The fault with only the left bottom fixed, one step at `t`.
fn hanging(method: &str, t: f64) -> Result<Solved, String> {
    let folder = examples().join("fault");
    let text = std::fs::read_to_string(folder.join(method)).map_err(|e| e.to_string())?;
    let edits = [
        ("fix  uL, uR = [0,0,0]  on bottom", "fix  uL = [0,0,0]  on bottom".to_owned()),
        ("steps t = 0 to 9.5 by 0.5", format!("steps t = {t} to {t} by 1")),
    ];
    solve(&folder, text, &edits, &[])
}

const METHODS: [&str; 3] = ["nitsche.wfl", "penalty.wfl", "augmented_lagrangian.wfl"];

fn hanging_block() -> Vec<Case> {
    held().into_iter().chain(sliding()).collect()
}

/// Below the friction limit: equilibrium, whatever the method.
pub(super) fn held() -> Vec<Case> {
    METHODS
        .map(|method| {
            let cases = [0.0, 2.0, 4.0, 4.79].map(|t| {
                let what = format!("t = {t}");
                let made = hanging(method, t).and_then(converged).map(|solved| {
                    let forces = [("Fn", -48.0), ("Fty", 0.0), ("Ftz", -4.0 * t)];
                    forces.into_iter().fold(Case::new(&what), |case, (name, e)| {
                        case.compare(name, solved.measure(0, name), e, Tolerance::Absolute(1e-9 * 48.0))
                    })
                });
                or_failed(&what, made)
            });
            merged(&format!("{method}, held by friction"), cases.to_vec())
        })
        .to_vec()
}

/// Beyond it: an error or a step marked as not converged, but no solution.
pub(super) fn sliding() -> Vec<Case> {
    METHODS
        .map(|method| {
            let cases = [4.81, 5.0].map(|t| {
                let claimed = hanging(method, t).is_ok_and(|s| s.outcome.converged());
                Case::new(format!("t = {t}")).require(!claimed, "claims a solution where there is none")
            });
            merged(&format!("{method}, beyond the limit: no solution is reported"), cases.to_vec())
        })
        .to_vec()
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
region boundary_left = faces of left
region boundary_right = faces of right
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

fn inclined_patch() -> Vec<Case> {
    let expected = [
        (10.0f64, 10.130_944_316_1, 0.257_377_880_9),
        (20.0, 9.823_943_160_6, 1.483_712_190_8),
        (30.0, 9.116_025_403_8, 2.531_088_913_2),
    ];
    let mut cases = Vec::new();
    for (angle, pressure, shear) in expected {
        for theta in [-1.0, 0.0, 1.0] {
            let what = format!("{angle} degrees, Nitsche theta = {theta}");
            let params = [("slope", angle.to_radians().tan()), ("theta", theta)];
            let made = solve(&examples(), PATCH.to_owned(), &[], &params).and_then(converged).map(|solved| {
                let numbers = [("pressure", pressure), ("shear", shear), ("highest", shear)];
                numbers.into_iter().fold(Case::new(&what), |case, (name, e)| {
                    case.compare(name, solved.measure(0, name), e, Tolerance::Absolute(1e-9))
                })
            });
            cases.push(or_failed(&what, made));
        }
    }
    cases
}
