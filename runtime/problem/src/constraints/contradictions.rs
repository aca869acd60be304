//! Two `fix` statements with different values of one displacement.
//!
//! The later statement holds, and [`Prescribed`] lists what it replaces. The values are compared at steps of the run:
//! equal values are no contradiction, and neither is a value that one statement prescribes with the step variable.

use std::collections::{BTreeMap, BTreeSet};

use wfl::Span;
use wfl_discrete::window::Window;

use super::{Along, Number, Prescribed};

/// A number that does not hold because a later statement says another thing of the same displacement.
pub(super) struct Overruled {
    pub(super) first: usize,
    pub(super) n_components: usize,
    pub(super) along: Along,
    pub(super) number: Number,
    /// The `fix` that holds.
    pub(super) by: usize,
}

/// Two statements that prescribe different values of one displacement.
pub(crate) struct Contradiction {
    pub(crate) field: String,
    /// `None` for a normal component.
    pub(crate) component: Option<usize>,
    /// The statement that does not hold, and the one that does.
    pub(crate) earlier: Span,
    pub(crate) later: Span,
    /// Nodes where they differ, and one of them.
    pub(crate) n_nodes: usize,
    pub(crate) position: [f64; 3],
    pub(crate) time: f64,
    /// The value there, and the one it should have by the earlier statement.
    pub(crate) holds: f64,
    pub(crate) instead: f64,
    /// The earlier statement holds at no node.
    pub(crate) lost: bool,
}

/// Two prescribed values are equal within this part of the largest number of both statements: what rounding leaves of a
/// formula written in two ways.
const SAME_VALUE: f64 = 1e-9;

impl Prescribed {
    /// What earlier statements say and later ones change, at the steps given.
    pub(crate) fn contradictions(&mut self, steps: &[Window], n_dofs: usize) -> Vec<Contradiction> {
        if self.overruled.is_empty() {
            return Vec::new();
        }
        let mut found: BTreeMap<(usize, usize, usize), Contradiction> = BTreeMap::new();
        let mut differ: BTreeMap<(usize, usize, usize), BTreeSet<usize>> = BTreeMap::new();
        let mut u = vec![0.0; n_dofs];
        for step in steps {
            // a value that is not finite is reported where it is used
            let Ok(values) = self.numbers(*step) else { continue };
            self.write(&values, &mut u);
            let largest: Vec<f64> = values.iter().map(|v| v.iter().fold(0.0, |m: f64, x| m.max(x.abs()))).collect();
            for o in &self.overruled {
                let own = &u[o.first..][..o.n_components];
                let holds = match o.along {
                    Along::Component(c) => own[c],
                    Along::Direction(d) => own.iter().zip(d).map(|(x, a)| x * a).sum(),
                };
                // a component of a normal has its sign
                let instead = o.number.factor * values[o.number.fix][o.number.place];
                let size = largest[o.number.fix].max(largest[o.by]);
                if (holds - instead).abs() <= SAME_VALUE * size {
                    continue;
                }
                let key = (o.number.fix, o.by, part_of(o.along, o.n_components));
                differ.entry(key).or_default().insert(o.first);
                found.entry(key).or_insert_with(|| self.contradiction(o, step.stage, holds, instead));
            }
        }
        for (key, nodes) in differ {
            if let Some(one) = found.get_mut(&key) {
                one.n_nodes = nodes.len();
            }
        }
        found.into_values().collect()
    }

    fn contradiction(&self, o: &Overruled, time: f64, holds: f64, instead: f64) -> Contradiction {
        let part = part_of(o.along, o.n_components);
        let (earlier, later) = (&self.fixes[o.number.fix], &self.fixes[o.by]);
        // a list of regions is one statement
        let is_same =
            |fix: usize| self.fixes[fix].statement == earlier.statement && self.fixes[fix].field == earlier.field;
        let same = |other: &&Overruled| is_same(other.number.fix) && part_of(other.along, other.n_components) == part;
        let stated = self.stated.iter().filter(|((fix, of), _)| is_same(*fix) && *of == part).map(|(_, n)| n);
        let entries = earlier.value.n_components();
        Contradiction {
            field: earlier.field.clone(),
            component: if let Along::Component(c) = o.along { Some(c) } else { None },
            earlier: earlier.statement,
            later: later.statement,
            n_nodes: 1,
            position: earlier.positions[o.number.place / entries],
            time,
            holds,
            instead,
            lost: self.overruled.iter().filter(same).count() == stated.sum::<usize>(),
        }
    }
}

/// The component, or the number of components for a direction.
pub(super) fn part_of(along: Along, n_components: usize) -> usize {
    match along {
        Along::Component(c) => c,
        Along::Direction(_) => n_components,
    }
}
