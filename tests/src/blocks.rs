//! Two blocks that meet at a fault, with each way in which contact can be written: what must not depend on how a mesh is
//! numbered or how many axes it has.

use crate::Solved;

/// Two blocks that meet at x = 1, of which the right one is pressed against the left one and drawn along it.
const BLOCKS: &str = "wfl 1
use \"sliding\"
mesh file \"blocks.msh\"
region left  = cells where x < 1
region right = cells where x > 1
region fault = interface from left to right
region other = interface from right to left
region west  = faces where x < 0.2
region east  = faces where x > 1.8
unknown a : vector ELEMENT on left
unknown b : vector ELEMENT on right
def stress(v) = 2*Sym(Grad_v) + 1.5*Div_v*Id(meshdim)
term left  on left  : stress(a):Grad_Test_a
term right on right : stress(b):Grad_Test_b
fix a = 0*X on west
fix b = PULL on east
steps t = 0 to 2 by 1
def jump   = a - Interpolate(b, neighbor_element)
def tested = Test_a - Interpolate(Test_b, neighbor_element)
def tang(w) = w - (w.Normal)*Normal
measure left_  = integral(a.a) on left
measure right_ = integral(b.b) on right
measure strain = integral(Grad_a:Grad_a) on left
measure drawn  = integral(Norm(stress(b)*Normal)) on other
";

/// Name, and what a scene of the blocks has beside.
pub const LAWS: [(&str, &str); 8] = [
    (
        "penalty with a state",
        "def pressure = 30*pos_part(jump.Normal)
def before = Previous_a - Interpolate(Previous_b, neighbor_element)
state shear : vector on fault := Ball_projection(Previous_shear + 30*tang(jump - before), 0.3*pressure)
term contact on fault : (pressure*Normal + Ball_projection(Previous_shear + 30*tang(jump - before), 0.3*pressure)).tested
measure sheared = integral(shear.shear) on fault
",
    ),
    (
        "Nitsche's method",
        "def trial = 60*jump - stress(a)*Normal
def pressure = pos_part(trial.Normal)
term contact on fault : (pressure*Normal + Ball_projection(tang(trial), 0.3*pressure)).tested
measure pressed = integral(pressure^2) on fault
",
    ),
    (
        "multipliers at nodes",
        "multiplier m : vector on fault
quadrature on fault vertex
def trial = 30*jump - m
def force = pos_part(trial.Normal)*Normal + Ball_projection(tang(trial), 0.3*pos_part(trial.Normal))
term contact on fault : force.tested
term law on fault : -1/30*(m + force).Test_m
measure pulled = integral(m.m) on fault
",
    ),
    (
        "a mapping",
        "mapping m = raytrace from fault onto other within 0.3
def over = a - Interpolate(b, m)
term contact on fault : 30*pos_part(over.Normal)*(Normal.(Test_a - Interpolate(Test_b, m)))
measure pressed = integral(pos_part(over.Normal)^2) on fault
",
    ),
    (
        "rays that follow",
        "mapping m = raytrace from fault onto other moving with a, b within 0.3
state elastic : vector on fault := sliding_elastic(a, b, m, elastic, 30, 0.3)
term contact on fault : sliding_friction(a, b, m, elastic, 30, 0.3)
measure slid = integral(elastic.elastic) on fault
",
    ),
    (
        "closest points that follow",
        "mapping m = project from fault onto other moving with a, b within 0.3
state elastic : vector on fault := closest_elastic(a, b, m, elastic, 30, 0.3)
term contact on fault : closest_friction(a, b, m, elastic, 30, 0.3)
measure slid = integral(elastic.elastic) on fault
",
    ),
    (
        "a local frame",
        "region top = faces of left where y > 0.9
fix a.Normal = 0.01*t on top
term contact on fault : 30*pos_part(jump.Normal)*(Normal.tested)
measure frame = reaction(a(2)) on top
",
    ),
    (
        "a field of the fault",
        "unknown q : scalar FACES on fault
region foot = rim of fault where y < 0.1
fix q = 1 on foot
term flow on fault : Grad_q.Grad_Test_q + (q - x - y^2)*Test_q
term contact on fault : 30*pos_part(jump.Normal + 0.01*q)*(Normal.tested)
measure held = integral(q*q) on fault
measure flux = reaction(q) on foot
",
    ),
];

/// The text of a scene with this law, on the mesh `blocks.msh`: the element of the displacements, the family of a
/// field of degree 1 on the fault, and what is prescribed on the east side.
#[must_use]
pub fn scene(law: &str, element: &str, of_faces: char, pull: &str) -> String {
    let text = (BLOCKS.to_owned() + law).replace("PULL", pull);
    text.replace("ELEMENT", element).replace("FACES", &format!("{of_faces}1"))
}

/// Names and values of the measures at the end.
///
/// # Panics
/// If there is no step.
#[must_use]
pub fn measures(solved: &Solved) -> Vec<(String, f64)> {
    let last = solved.outcome.steps.last().expect("steps");
    solved.scene.measures.iter().zip(&last.measures).map(|(m, (_, value))| (m.name.clone(), *value)).collect()
}
