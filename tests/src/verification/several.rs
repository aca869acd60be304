//! X55: Coulomb friction so large that a state at rest, one that slides and an open one all solve the same scene.
//!
//! A triangle with one free node on the ground (Klarbring 1990, with the stiffness of the element in place of springs):
//! `K u = f + r` with K = A (lambda + 3 mu) on the diagonal and -A (lambda + mu) beside it. Sliding lifts or presses
//! the node; where the coefficient of friction is above the ratio of both entries, loads between that ratio and the
//! coefficient allow all three. Nothing tells which one is meant: the result must be one of them, and say which.

use super::{
    Benchmark, Case, Tolerance,
    common::{or_failed, scene},
};
use crate::doubts;

/// The benchmarks of this file.
pub(super) const BENCHMARKS: &[Benchmark] = &[Benchmark {
    id: "X55",
    title: "friction so large that the scene has three solutions: one of them is found, with a warning",
    origin: "closed form of two unknowns",
    slow: false,
    open: None,
    run: three_states,
}];

const TRIANGLE: &str = "wfl 1
param fx = 2.4
param fric = 3
param gamma = 2
param sx = 0
param sy = 0
mesh box [0,0] to [1,1] cells [1,1] tri
region ground = faces where y == 0
region held   = nodes where x == 0 or y == 1
region east   = faces where x == 1
unknown u : vector
def lambda_ = 0.3/(1.3*0.4)
def mu      = 1/2.6
term elastic on all : lambda_*Div_u*Div_Test_u + 2*mu*Sym(Grad_u):Sym(Grad_Test_u)
fix u  = [0,0] on held
load u = 2*[fx,-1] on east
start u = [sx*x*(1-y), sy*x*(1-y)]
multiplier m : vector on ground
quadrature on ground vertex
def tang(w) = w - (w.Normal)*Normal
def Pn    = gamma*(u.Normal) - m.Normal
def Pt    = gamma*tang(u) - tang(m)
def force = pos_part(Pn)*Normal + Ball_projection(Pt, fric*pos_part(Pn))
term contact on ground : force.Test_u
term law on ground     : -1/gamma*(m + force).Test_m
";

/// Entries of K with nu = 0.3, E = 1 and the area 1/2, and the coefficient of friction.
const DIAGONAL: f64 = 0.5 * (1.5 + 3.0) / 2.6;
const BESIDE: f64 = 0.5 * (1.5 + 1.0) / 2.6;
const FRICTION: f64 = 3.0;

/// Displacement of the free node, and the points that are open, slip and stick (the node that is fixed sticks).
struct Expected {
    what: &'static str,
    u: [f64; 2],
    counts: [usize; 3],
}

/// The states under the load (fx, -1) that satisfy every condition.
fn states(fx: f64) -> Vec<Expected> {
    let mut list = Vec::new();
    if fx <= FRICTION {
        list.push(Expected { what: "stick", u: [0.0, 0.0], counts: [0, 0, 2] });
    }
    let slip = (fx - FRICTION) / (DIAGONAL - FRICTION * BESIDE);
    if slip > 0.0 && 1.0 - BESIDE * slip >= 0.0 {
        list.push(Expected { what: "slip", u: [slip, 0.0], counts: [0, 1, 1] });
    }
    let det = DIAGONAL * DIAGONAL - BESIDE * BESIDE;
    let lifted = [(DIAGONAL * fx - BESIDE) / det, (BESIDE * fx - DIAGONAL) / det];
    if lifted[1] > 0.0 {
        list.push(Expected { what: "open", u: lifted, counts: [1, 0, 1] });
    }
    list
}

fn three_states() -> Vec<Case> {
    let mut cases = Vec::new();
    // below the ratio of the entries, between it and the friction, above: one state, three, one
    for (fx, n) in [(1.5, 1), (2.4, 3), (3.5, 1)] {
        let expected = states(fx);
        let mut reached = Vec::new();
        for start in [[0.0, 0.0], [1.2, 0.0], [3.0, 0.5], [-3.0, 0.0], [100.0, 50.0]] {
            for gamma in [0.02, 2.0, 200.0] {
                let what = format!("load {fx}, start {start:?}, gamma = {gamma}");
                let given = [("fx", fx), ("sx", start[0]), ("sy", start[1]), ("gamma", gamma)];
                cases.push(or_failed(
                    &what,
                    scene(TRIANGLE, &given).map(|s| one_of(&what, &s, &expected, &mut reached)),
                ));
            }
        }
        reached.sort_unstable();
        reached.dedup();
        let what = format!("load {fx}: number of states");
        let all = Case::new(&what).require(expected.len() == n, format!("{} states by hand", expected.len()));
        cases.push(all.require(reached.len() == n, format!("only {reached:?} are found")));
    }
    cases
}

/// Compares with the state nearest to what was found, and its points with those that are told.
fn one_of(what: &str, solved: &crate::Solved, expected: &[Expected], reached: &mut Vec<&'static str>) -> Case {
    let step = &solved.outcome.steps[0];
    let u = solved.scene.system.fields.iter().position(|f| f.name == "u").and_then(|k| solved.scene.system.range(k));
    // node 1 is the corner (1, 0)
    let found = u.map_or([f64::NAN; 2], |range| [step.state[range.start + 2], step.state[range.start + 3]]);
    let gap = |e: &&Expected| (e.u[0] - found[0]).hypot(e.u[1] - found[1]);
    let Some(nearest) = expected.iter().min_by(|a, b| gap(a).total_cmp(&gap(b))) else {
        return Case::failed(what, "no state by hand");
    };
    reached.push(nearest.what);
    let told = step.history.iterations.last().and_then(|i| i.contact);
    // the determinant of the state that slides has the other sign where there are three, and only there
    let warned = doubts(&solved.outcome).iter().any(|(code, text)| *code == "W609" && text.contains("is not unique"));
    Case::new(what)
        .require(warned == (nearest.what == "slip" && expected.len() == 3), format!("W609 is told: {warned}"))
        .compare(format!("distance from {}", nearest.what), gap(&nearest), 1e-11, Tolerance::AtMost)
        .require(told == Some(nearest.counts), format!("{} is told as {told:?}", nearest.what))
}
