//! Scenes far from the origin. A translation of the mesh changes no force: what is left of it is rounding of positions, and
//! that is neither a reason not to converge nor one to warn. Bodies that just touch are the hardest: their gaps are nothing
//! but that rounding.

use std::path::Path;

use wfl_tests::{doubts, solve};

/// A scene: a block on a wider one, or on a rigid floor.
#[derive(Clone, Copy, Debug)]
struct Case {
    dim: usize,
    shape: &'static str,
    element: &'static str,
    contact: Contact,
}

/// How the gap is found.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Contact {
    /// A formula of positions: a rigid floor.
    Formula,
    /// Images that stay.
    Raytrace,
    Project,
    /// Images that follow the bodies, with friction: along rays, and as closest points.
    Moving,
    Closest,
}

impl Case {
    /// The scene with its lowest corner at `offset` along each axis and blocks of edge `h`.
    fn text(self, offset: f64, h: f64) -> String {
        let Self { dim, shape, element, contact } = self;
        let list = |first: &str, last: &str| {
            let mut entries = vec!["0".to_owned(); dim];
            (entries[0], entries[dim - 1]) = (first.to_owned(), last.to_owned());
            format!("[{}]", entries.join(", "))
        };
        let up = ["x", "y", "z"][dim - 1];
        let corner = format!("[{}]", vec![format!("{offset:?}"); dim].join(", "));
        let size = |k: usize| if k == 0 { 3.0 * h } else { 2.0 * h };
        let end: Vec<String> = (0..dim).map(|k| format!("{:?}", offset + size(k))).collect();
        let cells = if dim == 2 { "[6, 4]" } else { "[6, 2, 2]" };
        let (middle, top, side) = (offset + h, offset + 2.0 * h, offset + 1.5 * h);
        let law = self.law(h, middle);
        let body = if contact == Contact::Formula { "" } else { "term lower on lower : P(Grad_b):Grad_Test_b\n" };
        let below = if contact == Contact::Formula {
            String::new()
        } else {
            format!("unknown b : vector {element} on lower\nfix b = {} on base\n", list("0", "0"))
        };
        format!(
            "wfl 1
use \"sliding\"
mesh box {corner} to [{}] cells {cells} {shape} with idle_cells=allowed
region lower = cells where {up} < {middle:?}
region upper = cells where {up} > {middle:?} and x < {side:?}
region sole  = faces of upper where {up} == {middle:?}
region floor = faces of lower where {up} == {middle:?}
region lid   = faces of upper where {up} == {top:?}
region base  = faces of lower where {up} == {offset:?}
unknown a : vector {element} on upper
{below}param gamma = {:?}
param fric = 0.3
def P(g) = 0.4*((Id({dim}) + g) - Inv(Id({dim}) + g)') + 0.5*log(Det(Id({dim}) + g))*Inv(Id({dim}) + g)'
term upper on upper : P(Grad_a):Grad_Test_a
{body}{law}steps k = 0 to 2 by 1
fix a = {} on lid
measure push = reaction(a({dim})) on lid
measure drag = reaction(a(1)) on lid
",
            end.join(", "),
            40.0 / h,
            list(&format!("{:?}*max(0, k - 1)", 0.02 * h), &format!("-{:?}*min(k, 1)", 0.01 * h)),
        )
    }

    /// The terms of contact between blocks of edge `h` that meet at `middle`.
    fn law(self, h: f64, middle: f64) -> String {
        let (dim, contact) = (self.dim, self.contact);
        let up = ["x", "y", "z"][dim - 1];
        let within = 0.3 * h;
        match contact {
            Contact::Formula => {
                format!("term contact on sole : -gamma*pos_part({middle:?} - {up} - a({dim}))*Test_a({dim})\n")
            }
            Contact::Raytrace | Contact::Project => {
                let word = if contact == Contact::Project { "project" } else { "raytrace" };
                format!(
                    "mapping m = {word} from sole onto floor within {within:?}\n\
                     def gap = (Interpolate(X, m) + Interpolate(b, m) - X - a).Normal\n\
                     term contact on sole : gamma*pos_part(-gap)*(Normal.(Test_a - Interpolate(Test_b, m)))\n"
                )
            }
            Contact::Moving | Contact::Closest => {
                let (word, macros) =
                    if contact == Contact::Moving { ("raytrace", "sliding") } else { ("project", "closest") };
                format!(
                    "mapping m = {word} from sole onto floor moving with a, b within {within:?}\n\
                     state elastic : vector on sole := {macros}_elastic(a, b, m, elastic, gamma, fric)\n\
                     term contact on sole : {macros}_friction(a, b, m, elastic, gamma, fric)\n"
                )
            }
        }
    }
}

/// Forces of the lid by step, in parts of what they are made of: the modulus times the area of the sole.
fn forces(case: Case, offset: f64, h: f64) -> Vec<[f64; 2]> {
    let text = case.text(offset, h);
    let found = solve(Path::new("."), text.clone(), &[], &[]).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let doubts = doubts(&found.outcome);
    assert!(found.outcome.converged() && doubts.is_empty(), "{case:?} at {offset}: {doubts:?}");
    let area = h.powi(i32::try_from(case.dim).expect("2 or 3") - 1);
    let n = found.outcome.steps.len();
    (0..n).map(|step| ["push", "drag"].map(|name| found.measure(step, name) / area)).collect()
}

/// Bodies that touch and are at rest, then pressed by a hundredth of their edge, then moved along by two: near the origin, a
/// thousand edges away, and where maps of a country have their coordinates.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_translation_of_the_mesh_changes_no_force_and_is_no_reason_to_doubt() {
    let shapes = [(2, "quad", "Q2"), (2, "tri", "P1"), (3, "hex", "Q1"), (3, "tet", "P1")];
    for (dim, shape, element) in shapes {
        for contact in [Contact::Formula, Contact::Raytrace, Contact::Project, Contact::Moving, Contact::Closest] {
            let case = Case { dim, shape, element, contact };
            let near = forces(case, 0.0, 1.0);
            assert!(near[1][0].abs() > 1e-3, "{case:?}: {near:?}");
            for (offset, h) in [(0.1, 0.3), (1000.1, 0.7), (5e5, 1000.0)] {
                // a gap is one of four positions, each rounded; forces are 40 of it
                let rounding = 1e-9 + 40.0 * 64.0 * f64::EPSILON * offset / h;
                for (step, (a, b)) in near.iter().zip(forces(case, offset, h)).enumerate() {
                    let apart = a.iter().zip(b).fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
                    assert!(
                        apart <= rounding,
                        "{case:?} at {offset}, step {step}: {a:?}, {b:?}, rounding {rounding:e}"
                    );
                }
            }
        }
    }
}
