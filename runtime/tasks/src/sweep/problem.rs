//! Which knobs of a sweep change the problem, and which only how it is solved.
//!
//! Runs of one problem share a reference; every setting of the knobs that change it has its own. Knobs of statements
//! (mesh, degree, rule, tolerance, solver) change numerics. So does a parameter that divides the mesh, is the step of
//! `steps` or an option of the solver, unless the shape of the bodies, what acts on them or the range of the steps
//! follows from it too; and the parameter of the contact method, with what is there for it alone. Every other parameter
//! changes the problem. Where that is wrong, a reference too many is made: the errors are right all the same.

use std::collections::BTreeSet;

use wfl::{
    ResolvedScript,
    ast::{BoxDivision, Expr, MeshSource, OptionItem, OptionValue},
};
use wfl_adapt::accuracy::method_word;
use wfl_problem::Scene;

use super::{
    Method,
    lists::{self, Knob},
};
use crate::bench::Known;

/// Every setting of the knobs that change the problem; one empty setting where none does. What one of the scenes calls
/// numerics is numerics in all: they are compared with each other.
pub(super) fn settings(methods: &[Method], knobs: &[Knob]) -> Vec<Vec<(String, String)>> {
    let numbers: Vec<Numerics> = methods.iter().map(|m| Numerics::of(&m.known)).collect();
    let changing = |k: &&Knob| numbers.iter().all(|n| n.changes_problem(&k.name));
    lists::combinations(&knobs.iter().filter(changing).cloned().collect::<Vec<_>>())
}

/// The values of the parameters that change the problem, in a scene that was prepared.
pub(super) fn values(known: &Known, scene: &Scene) -> Vec<(String, Vec<f64>)> {
    let numerics = Numerics::of(known);
    let counts = |name: &str| numerics.changes_problem(name);
    scene.params.iter().filter(|(name, _)| counts(name)).map(|(name, c)| (name.clone(), c.values.clone())).collect()
}

/// Whether a parameter changes the problem in all of these scenes.
pub(super) fn is_of_all(methods: &[Method], name: &str) -> bool {
    methods.iter().all(|m| Numerics::of(&m.known).changes_problem(name))
}

/// The parameters of a scene that change how it is solved.
struct Numerics {
    params: Vec<String>,
    numerical: BTreeSet<String>,
}

impl Numerics {
    fn of(known: &Known) -> Self {
        let script = &known.loaded.script;
        let problem = closure(script, given(script), "");
        let mut numerical: BTreeSet<String> = resolution(known).difference(&problem).cloned().collect();
        if let Some(name) = method_word(script, &known.scene) {
            let terms = script.terms.iter().map(|t| &t.expr);
            let physical = closure(script, terms.chain(given(script)), &name);
            let method = closure_of(script, [name].into(), "");
            numerical.extend(method.difference(&physical).cloned());
        }
        Self { params: known.params.clone(), numerical }
    }

    fn changes_problem(&self, knob: &str) -> bool {
        self.params.iter().any(|p| p == knob) && !self.numerical.contains(knob)
    }
}

/// The words that cells, steps and the iteration are computed from, also by way of other parameters.
pub(super) fn resolution(known: &Known) -> BTreeSet<String> {
    let script = &known.loaded.script;
    let division = script.mesh.as_ref().and_then(|m| match &m.source {
        MeshSource::Box { division: BoxDivision::Cells(e) | BoxDivision::Size(e), .. } => Some(e),
        MeshSource::Files(_) => None,
    });
    let steps = script.steps.as_ref().map(|s| &s.by);
    let options = script.solver.iter().flat_map(|s| &s.options).filter_map(|o: &OptionItem| match &o.value {
        Some(OptionValue::Expr(e)) => Some(e),
        _ => None,
    });
    closure(script, division.into_iter().chain(steps).chain(options), "")
}

/// The shape of the bodies, what acts on them, and the range of the steps.
fn given(script: &ResolvedScript) -> impl Iterator<Item = &Expr> {
    let corners = script.mesh.iter().flat_map(|m| match &m.source {
        MeshSource::Box { from, to, .. } => vec![from, to],
        MeshSource::Files(_) => m.source.placing().collect(),
    });
    let map = script.mesh.iter().filter_map(|m| m.map.as_ref());
    let acting = script.fixes.iter().chain(&script.loads).map(|c| &c.value);
    let range = script.steps.iter().flat_map(|s| [&s.from, &s.to]);
    corners.chain(map).chain(acting).chain(range)
}

/// The words of expressions and of the parameters that they name, without those that only `except` needs.
fn closure<'e>(script: &ResolvedScript, of: impl Iterator<Item = &'e Expr>, except: &str) -> BTreeSet<String> {
    let mut words = BTreeSet::new();
    of.for_each(|e| wfl::each_name(e, &mut |n| words.extend([n.to_owned()])));
    closure_of(script, words, except)
}

fn closure_of(script: &ResolvedScript, mut words: BTreeSet<String>, except: &str) -> BTreeSet<String> {
    words.remove(except);
    let mut rest: Vec<String> = words.iter().cloned().collect();
    while let Some(word) = rest.pop() {
        let Some(param) = script.params.iter().find(|p| p.name.name == word) else { continue };
        wfl::each_name(&param.value, &mut |n| {
            if n != except && words.insert(n.to_owned()) {
                rest.push(n.to_owned());
            }
        });
    }
    words
}
