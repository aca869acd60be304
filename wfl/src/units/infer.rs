//! The open units of a scene: that of coordinates, of time, and of a cell where the dimension is not known.
//!
//! Every relation that holds an open unit alone is a vote for what it is; most votes win, the earlier one at a tie.
//! One wrong formula then does not spoil the rest of the scene.

use crate::{codes::Code, diag::Diagnostic, source::Span};

use super::{
    eval::{Equation, Pass, Solved, Strength},
    scene::Scene,
    table::NamedUnit,
    unit::{Ratio, Symbol, Unit},
};

/// The walk over the scene with everything known that can be known.
pub(super) fn checked<'s>(scene: &'s Scene<'s>) -> Pass<'s> {
    let mut solved = Solved { time: scene.step_unit.clone(), ..Solved::default() };
    // each round finds one of the three; a found one may leave another alone in a relation
    for _ in 0..3 {
        let mut pass = Pass::new(scene, solved.clone());
        pass.statements();
        if !improve(scene, &mut solved, &pass.equations) {
            return pass;
        }
    }
    let mut pass = Pass::new(scene, solved);
    pass.statements();
    pass
}

fn improve(scene: &Scene<'_>, solved: &mut Solved, equations: &[Equation]) -> bool {
    let Solved { length, length_from, time, time_from, volume } = solved;
    for (symbol, slot) in [(Symbol::Length, length), (Symbol::Time, time), (Symbol::Volume, volume)] {
        if slot.is_none()
            && let Some(found) = vote(scene, symbol, equations)
        {
            match symbol {
                Symbol::Length => *length_from = Some((found.at, found.strength)),
                Symbol::Time => *time_from = Some((found.at, found.strength)),
                _ => {}
            }
            *slot = Some(found.unit);
            return true;
        }
    }
    false
}

/// What an open unit is, and the first relation that says so.
struct Found {
    unit: Unit,
    at: Span,
    strength: Strength,
    votes: usize,
}

fn vote(scene: &Scene<'_>, symbol: Symbol, equations: &[Equation]) -> Option<Found> {
    [Strength::Strong, Strength::Weak].into_iter().find_map(|strength| {
        let mut votes: Vec<Found> = Vec::new();
        for equation in equations.iter().filter(|q| q.strength == strength) {
            let Some(unit) = solution(&equation.ratio, symbol).and_then(|u| allowed(scene, symbol, u)) else {
                continue;
            };
            match votes.iter_mut().find(|known| known.unit.same(&unit)) {
                Some(known) => known.votes += 1,
                None => votes.push(Found { unit, at: equation.at, strength, votes: 1 }),
            }
        }
        let most = votes.iter().map(|v| v.votes).max()?;
        votes.into_iter().find(|v| v.votes == most)
    })
}

/// The unit that makes the product 1, if `symbol` is the only open one in it.
pub(super) fn solution(ratio: &Unit, symbol: Symbol) -> Option<Unit> {
    let power = ratio.power_of(symbol);
    let rest = ratio.without(symbol);
    if power.is_zero() || rest.is_open() {
        return None;
    }
    rest.to_power(power.times(Ratio::whole(-1))?.inverse()?)
}

/// Coordinates have a length that has a name; in a scene without lengths they have any unit.
fn allowed(scene: &Scene<'_>, symbol: Symbol, unit: Unit) -> Option<Unit> {
    if symbol != Symbol::Length || !scene.lengths {
        return Some(unit);
    }
    NamedUnit::all().filter(|u| u.is_length()).map(|u| Unit::of(Symbol::Named(u))).find(|u| u.same(&unit))
}

/// W422 where terms fit only in a length of coordinates, or a time, that the scene names nowhere: prefixes that differ look
/// the same. Of time seconds need no name.
pub(super) fn unnamed(scene: &Scene<'_>, solved: &Solved) -> Vec<Diagnostic> {
    let seconds = NamedUnit::find("s").map(Symbol::Named);
    let times: Vec<Symbol> = scene.named_times().into_iter().chain(seconds).collect();
    let length = outside(&scene.named_lengths(), solved.length.as_ref(), solved.length_from);
    let time = outside(&times, solved.time.as_ref(), solved.time_from);
    let told = |what: &str, (unit, at): (&Unit, Span), known: &[Symbol], how: &str| {
        let text = format!("the terms of this scene have one unit only if {what} {}", unit.show());
        let names: Vec<String> = known.iter().map(|s| Unit::of(*s).show()).collect();
        let d = Diagnostic::new(Code::W422, text).at(at, "does not fit the first term otherwise");
        let d = d.note(format!("the scene names {}; numbers are not converted", names.join(", ")));
        d.help(format!("a param is in another unit than the others; or, if that is meant: {how}"))
    };
    let length = length.map(|found| {
        let unit = found.0.show();
        let how = format!("param l = 1 [{unit}] in the mesh or in the condition of a region");
        told("coordinates are in", found, &scene.named_lengths(), &how)
    });
    let time = time.map(|found| {
        let unit = found.0.show();
        told("time is in", found, &times, &format!("[{unit}] behind the step of `steps`"))
    });
    length.into_iter().chain(time).collect()
}

/// A unit that weak relations alone ask for, and that is none of those that are known.
fn outside<'u>(known: &[Symbol], found: Option<&'u Unit>, from: Option<(Span, Strength)>) -> Option<(&'u Unit, Span)> {
    let (unit, (at, strength)) = found.zip(from)?;
    let is_known = known.is_empty() || known.iter().any(|k| Unit::of(*k).same(unit));
    (strength == Strength::Weak && !is_known).then_some((unit, at))
}
