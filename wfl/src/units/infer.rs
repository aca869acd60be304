//! The open units of a scene: that of coordinates, of time, and of a cell where the dimension is not known.
//!
//! Every relation that holds an open unit alone is a vote for what it is; most votes win, the earlier one at a tie.
//! One wrong formula then does not spoil the rest of the scene.

use super::{
    eval::{Equation, Pass, Solved},
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
    let Solved { length, time, volume } = solved;
    for (symbol, slot) in [(Symbol::Length, length), (Symbol::Time, time), (Symbol::Volume, volume)] {
        if slot.is_none() {
            *slot = vote(scene, symbol, equations);
            if slot.is_some() {
                return true;
            }
        }
    }
    false
}

fn vote(scene: &Scene<'_>, symbol: Symbol, equations: &[Equation]) -> Option<Unit> {
    let kinds = [false, true];
    kinds.into_iter().find_map(|weak| {
        let mut votes: Vec<(Unit, usize)> = Vec::new();
        for equation in equations.iter().filter(|q| q.weak == weak) {
            let Some(unit) = solution(&equation.ratio, symbol).and_then(|u| allowed(scene, symbol, u)) else {
                continue;
            };
            match votes.iter_mut().find(|(known, _)| known.same(&unit)) {
                Some((_, count)) => *count += 1,
                None => votes.push((unit, 1)),
            }
        }
        let most = votes.iter().map(|v| v.1).max()?;
        votes.into_iter().find(|v| v.1 == most).map(|v| v.0)
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
