//! Which declaration a wrong unit comes from: the one that, with another unit, makes the message go away.
//!
//! Each param and field is tried with its unit times an unknown factor. A relation that fixes the factor proposes a
//! unit; the scene is checked again with it. A proposal that adds messages is none.

use crate::diag::Diagnostic;

use super::{
    eval::{Pass, Solved},
    infer::{checked, solution},
    scene::Scene,
    unit::{Symbol, Unit},
};

/// Parts of expressions that are looked at, at most, to find the declaration.
const WORK: usize = 3_000_000;

/// Another unit for one name, and what is left to say with it.
struct Proposal<'s> {
    name: &'s str,
    param: bool,
    unit: Unit,
    left: Vec<Diagnostic>,
}

/// The messages with the declaration that explains them, where a single one does.
pub(super) fn explained<'s>(scene: &'s Scene<'s>, solved: &Solved, found: Vec<Diagnostic>) -> Vec<Diagnostic> {
    // a scene with more mistakes than that has no single cause
    if found.is_empty() || found.len() > 50 {
        return found;
    }
    let found = shown_in_one_length(scene, solved, found);
    let proposals = proposals(scene, solved, found.len());
    let explain = |d: Diagnostic| match best(&proposals, &d) {
        Some(p) => explain(scene, d, p),
        None => d,
    };
    found.into_iter().map(explain).collect()
}

/// The same messages in the only length that the scene names, where nothing says what coordinates are: what is wrong
/// is wrong in every length, and `mm` is easier to read than an open unit.
fn shown_in_one_length<'s>(scene: &'s Scene<'s>, solved: &Solved, found: Vec<Diagnostic>) -> Vec<Diagnostic> {
    let Some(length) = only_length(scene).filter(|_| solved.length.is_none()) else { return found };
    let mut pass = Pass::new(scene, Solved { length: Some(length), ..solved.clone() });
    pass.statements();
    found.into_iter().map(|d| pass.diagnostics.iter().find(|x| same(x, &d)).cloned().unwrap_or(d)).collect()
}

fn explain(scene: &Scene<'_>, mut d: Diagnostic, proposal: &Proposal<'_>) -> Diagnostic {
    let span = scene.declared[proposal.name].span;
    if d.labels.iter().all(|l| l.span != span) {
        d = d.at(span, "declared here");
    }
    let quantity = proposal.unit.quantity().map_or_else(String::new, |q| format!(" ({q})"));
    match proposal.unit.show().as_str() {
        "pure number" => d.help(format!("{} is a pure number", proposal.name)),
        unit => d.help(format!("{} has the unit {unit}{quantity}", proposal.name)),
    }
}

/// The only proposal that leaves least to say, params before fields.
fn best<'p, 's>(proposals: &'p [Proposal<'s>], d: &Diagnostic) -> Option<&'p Proposal<'s>> {
    let fits: Vec<_> = proposals.iter().filter(|p| !p.left.iter().any(|x| same(x, d))).collect();
    let least = fits.iter().map(|p| p.left.len()).min()?;
    [true, false]
        .into_iter()
        .find_map(|param| {
            let mut of_kind = fits.iter().filter(|p| p.left.len() == least && p.param == param);
            Some((of_kind.next()?, of_kind.next().is_none()))
        })
        .and_then(|(first, alone)| alone.then_some(*first))
}

fn same(a: &Diagnostic, b: &Diagnostic) -> bool {
    a.message == b.message && a.labels.first().map(|l| l.span) == b.labels.first().map(|l| l.span)
}

fn proposals<'s>(scene: &Scene<'s>, solved: &Solved, found: usize) -> Vec<Proposal<'s>> {
    let weight = scene.weight();
    let mut walks = WORK / weight;
    let mut proposals = Vec::new();
    let params = scene.script.params.iter().map(|p| (p.name.name.as_str(), true));
    let fields = scene.script.fields.iter().map(|f| (f.name.name.as_str(), false));
    for (name, param) in params.chain(fields) {
        let Some(declared) = scene.declared.get(name).and_then(|d| d.unit.clone()) else { continue };
        let Some(left) = walks.checked_sub(1) else { return proposals };
        walks = left;
        let mut best: Option<Proposal<'s>> = None;
        for unit in candidates(scene, solved, name, &declared) {
            // a check walks at most four times
            let Some(left) = walks.checked_sub(4) else { return proposals };
            walks = left;
            let changed = scene.with_unit(name, unit.clone());
            let left = checked(&changed).diagnostics;
            if left.len() < best.as_ref().map_or(found, |b| b.left.len()) {
                best = Some(Proposal { name, param, unit, left });
            }
        }
        proposals.extend(best);
    }
    proposals
}

/// Units that some relation of the scene asks for the name.
fn candidates(scene: &Scene<'_>, solved: &Solved, name: &str, declared: &Unit) -> Vec<Unit> {
    let Some(open) = declared.times(&Unit::of(Symbol::Sought)) else { return Vec::new() };
    let changed = scene.with_unit(name, open);
    let mut solved = solved.clone();
    solved.length = solved.length.or_else(|| only_length(scene));
    let mut pass = Pass::new(&changed, solved);
    pass.statements();
    let mut units: Vec<Unit> = Vec::new();
    for equation in &pass.equations {
        let unit = solution(&equation.ratio, Symbol::Sought).and_then(|factor| declared.times(&factor));
        if let Some(unit) = unit.filter(|u| !u.same(declared))
            && !units.iter().any(|known| known.same(&unit))
        {
            units.push(unit);
        }
    }
    units.truncate(6);
    units
}

/// The length that the units of the scene are made of, if it is only one: good enough for a proposal.
fn only_length(scene: &Scene<'_>) -> Option<Unit> {
    match scene.named_lengths().as_slice() {
        [only] => Some(Unit::of(*only)),
        _ => None,
    }
}
