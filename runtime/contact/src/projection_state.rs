//! What the projections give between two choices of the active set, and how far a step may go.
//!
//! A step with a frozen active set solves a problem of its own; its end (u, t) need not be nearer to the solution, and full
//! steps can circle. With linear bodies every state between two ends is in equilibrium too, and argument, radius and
//! value of each projection are linear along the step, so only the law of contact has to be looked at: the defect of
//! t = P(t + c (x - t)) in the sum of squares. With c the stiffness of the bodies it measures an error in traction at
//! equal weight for every gamma. Newton directions of it descend (Qi and Sun 1993), and a trial costs no assembly.
//! Promises: pure functions of projection states. Does not decide what follows where nothing descends.

use std::borrow::Cow;

use wfl_compiler::{Projection, ProjectionKind};

use super::{Complementarity, Contact, ContactTerm};
use wfl_discrete::{
    assemble::FieldValues,
    domain::{NAME, PointName},
};
use wfl_mesh::mesh::Mesh;

/// A step is taken that reduces the defect by this part of its length: any descent counts that is more than rounding, as in the
/// search on the residual.
const SUFFICIENT: f64 = 1e-4;
/// Longest way ahead in units of the last: two increments further a path that bends is another one.
const FURTHEST: f64 = 2.0;
/// Halvings before the best of those tried is taken: the shortest is a ten thousandth. The projections are at hand, so that one
/// costs no residual.
const MAX_HALVINGS: i32 = 13;

/// Arguments, radii and values of the projections of a term at its points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProjectionState {
    /// Point by point, as the law of the projections lists them.
    pub(super) values: Vec<f64>,
    /// By point: its weight in integrals.
    pub(super) weights: Vec<f64>,
    /// By point its name, where faces are cut anew in each state.
    pub(super) names: Vec<PointName>,
}

impl ProjectionState {
    /// What the law gives, point by point.
    pub(crate) fn points(&self) -> impl Iterator<Item = &[f64]> {
        let n = self.values.len().checked_div(self.weights.len()).unwrap_or(0).max(1);
        self.values.chunks_exact(n)
    }

    /// A state with these outputs at points of weight 1.
    #[cfg(test)]
    pub(crate) fn of(points: &[&[f64]]) -> Self {
        Self { values: points.concat(), weights: vec![1.0; points.len()], names: Vec::new() }
    }

    /// What the projections would be if things went on as they did since `before`, for `part` of the time between.
    fn extrapolated(&self, before: &Self, part: f64) -> Self {
        let (mut found, before) = (self.clone(), before.carried_to(self));
        found.values.iter_mut().zip(&before.values).for_each(|(v, b)| *v += part * (*v - b));
        found
    }

    /// Goes part of the way to `target`.
    fn approach(&mut self, target: &Self, part: f64) {
        self.values.iter_mut().zip(&target.values).for_each(|(v, t)| *v += part * (t - *v));
    }
}

impl ContactTerm {
    /// The mean of a state over each entity, at every point of it.
    pub(super) fn averaged(&self, state: &ProjectionState) -> ProjectionState {
        let mut found = state.clone();
        if self.is_cut() {
            // each point is an entity of its own
            return found;
        }
        let n = self.n_outputs();
        let (mut values, mut weights) = (found.values.as_mut_slice(), state.weights.as_slice());
        for group in &self.sampled.domain.groups {
            for _ in 0..group.entities.len() {
                let (own, others) = std::mem::take(&mut values).split_at_mut(group.n_points() * n);
                let (parts, rest) = weights.split_at(group.n_points());
                (values, weights) = (others, rest);
                let total: f64 = parts.iter().sum();
                if total <= 0.0 {
                    continue;
                }
                for k in 0..n {
                    let sum: f64 = parts.iter().zip(own.chunks_exact(n)).map(|(w, point)| w * point[k]).sum();
                    own.chunks_exact_mut(n).for_each(|point| point[k] = sum / total);
                }
            }
        }
        found
    }

    /// Reads arguments, radii and values at a state on the branches of `values`.
    pub(super) fn read(&self, mesh: &Mesh, values: FieldValues<'_>) -> ProjectionState {
        let mut found = ProjectionState { names: self.names_at(mesh, values), ..ProjectionState::default() };
        self.law.for_each_point(mesh, &self.sampled, values, |_, _, _, weight, out| {
            found.values.extend_from_slice(out);
            found.weights.push(weight);
        });
        found
    }

    /// By how much the arguments of the half-lines grow from one state to another, integrated over the points that this
    /// rank counts: above 0 the sides close.
    #[must_use]
    pub fn closing(&self, from: &ProjectionState, to: &ProjectionState) -> f64 {
        let (mut total, from) = (0.0, from.carried_to(to));
        let points = from.points().zip(to.points()).zip(&from.weights).enumerate();
        for (_, ((a, b), weight)) in points.filter(|(point, _)| self.counts(*point)) {
            for p in self.projections.iter().filter(|p| p.kind == ProjectionKind::HalfLine && p.acts) {
                let entries = p.output..p.output + p.n;
                total += weight.abs() * entries.map(|k| b[k] - a[k]).sum::<f64>();
            }
        }
        total
    }

    /// The squared defect of the projections on the way from `from` to `to`, as an energy: traction squared over
    /// stiffness, integrated over the points that this rank counts.
    fn defect(&self, law: &Complementarity, from: &ProjectionState, to: &ProjectionState, part: f64) -> f64 {
        let mut total = 0.0;
        let mut out = Vec::new();
        let points = from.points().zip(to.points()).zip(&from.weights).enumerate();
        for (_, ((a, b), weight)) in points.filter(|(point, _)| self.counts(*point)) {
            out.clear();
            out.extend(a.iter().zip(b).map(|(a, b)| a + part * (b - a)));
            for (k, p) in self.projections.iter().enumerate() {
                total += weight.abs() * self.scaling.flexibility(k) * self.squared_defect(k, p, law, &out);
            }
        }
        total
    }

    fn squared_defect(&self, k: usize, p: &Projection, law: &Complementarity, out: &[f64]) -> f64 {
        let ratio = self.scaling.ratio(k, law);
        let left = 1.0 - self.scaling.taken(k, &law.regularisation);
        let x = &out[p.output..][..p.n];
        match p.kind {
            ProjectionKind::HalfLine => {
                let t = &out[p.output + p.n..][..p.n];
                t.iter().zip(x).map(|(t, x)| (t - (t + ratio * (left * x - t)).max(0.0)).powi(2)).sum()
            }
            ProjectionKind::Ball => {
                let radius = (law.regularisation.friction * out[p.output + p.n]).max(0.0);
                let t = &out[p.output + p.n + 1..][..p.n];
                let along = |k: usize| t[k] + ratio * (left * x[k] - t[k]);
                let length = (0..p.n).fold(0.0f64, |m, k| m.hypot(along(k)));
                let scale = if length <= radius { 1.0 } else { radius / length };
                (0..p.n).map(|k| (t[k] - scale * along(k)).powi(2)).sum()
            }
        }
    }
}

/// A converged state: the step variable, and what the projections were, by term.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ConvergedState {
    pub(super) time: f64,
    /// It was as the two states before it extrapolate to: loads go on.
    pub(super) on_trend: bool,
    pub(super) states: Vec<ProjectionState>,
}

impl ConvergedState {
    /// What to expect at `time` after this state and the one `before`. `None` where that is no later time, or so much
    /// later that nothing can be said.
    pub(super) fn extrapolated(&self, before: &Self, time: f64) -> Option<Vec<ProjectionState>> {
        let part = (time - self.time) / (self.time - before.time);
        let fits = part > 0.0 && part <= FURTHEST && self.states.len() == before.states.len();
        fits.then(|| self.states.iter().zip(&before.states).map(|(a, b)| a.extrapolated(b, part)).collect())
    }

    /// All numbers: the time and whether it was on the trend, then values and weights by term, where faces are cut with the
    /// names of the points behind the weights.
    #[must_use]
    pub fn numbers(&self) -> Vec<Vec<f64>> {
        let all = self.states.iter().flat_map(|w| [w.values.clone(), [&w.weights, w.names.as_flattened()].concat()]);
        std::iter::once(vec![self.time, f64::from(u8::from(self.on_trend))]).chain(all).collect()
    }

    /// The state with the numbers given by [`Self::numbers`]; `None` if they are not those of `terms`.
    #[must_use]
    pub fn from_numbers(numbers: &[Vec<f64>], terms: &[ContactTerm]) -> Option<Self> {
        let (head, rest) = numbers.split_first()?;
        let [time, on_trend] = head[..] else { return None };
        let fits = |(pair, term): (&[Vec<f64>], &ContactTerm)| {
            let (values, own) = (&pair[0], &pair[1]);
            let n = if term.is_cut() { own.len() / (1 + NAME) } else { term.n_points() };
            let (weights, names) = own.split_at_checked(n)?;
            let names = names.as_chunks().0.to_vec();
            let fits = values.len() == n * term.n_outputs() && own.len() == n + NAME * names.len();
            let state = ProjectionState { values: values.clone(), weights: weights.to_vec(), names };
            (fits && state.names.len() == if term.is_cut() { n } else { 0 }).then_some(state)
        };
        if rest.len() != 2 * terms.len() {
            return None;
        }
        let states: Option<Vec<ProjectionState>> = rest.chunks_exact(2).zip(terms).map(fits).collect();
        Some(Self { time, on_trend: on_trend > 0.5, states: states? })
    }
}

/// The part of a step that reduces the defect of all terms, and whether one does: else it is that of the best trial; `from`
/// becomes the projections there. `from` and `to` by term.
pub(super) fn search(contact: &Contact, from: &mut [ProjectionState], to: &[ProjectionState]) -> (f64, bool) {
    let law = &contact.complementarity;
    for (from, to) in from.iter_mut().zip(to) {
        if let Cow::Owned(carried) = from.carried_to(to) {
            *from = carried;
        }
    }
    let defect = |part: f64| {
        let each = contact.terms.iter().zip(from.iter().zip(to));
        contact.team().total(each.map(|(t, (a, b))| t.defect(law, a, b, part)).sum()).sqrt()
    };
    let start = defect(0.0);
    let (mut best, mut descends) = ((f64::INFINITY, 1.0), false);
    for halvings in 0..=MAX_HALVINGS {
        let part = 0.5f64.powi(halvings);
        let found = defect(part);
        if found <= (1.0 - SUFFICIENT * part) * start {
            (best, descends) = ((found, part), true);
            break;
        }
        if found < best.0 {
            best = (found, part);
        }
    }
    from.iter_mut().zip(to).for_each(|(a, b)| a.approach(b, best.1));
    (best.1, descends)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn converged(time: f64, value: f64) -> ConvergedState {
        ConvergedState {
            time,
            on_trend: true,
            states: vec![ProjectionState { values: vec![value, -value], weights: vec![0.5], names: Vec::new() }],
        }
    }

    #[test]
    fn a_front_that_moves_is_expected_to_move_on() {
        let (last, before) = (converged(3.0, 5.0), converged(1.0, 4.0));
        let ahead = last.extrapolated(&before, 4.0).expect("half as far again");
        assert_eq!(ahead[0].values, [5.5, -5.5]);
        assert_eq!(last.extrapolated(&before, 7.0).map(|a| a[0].values[0]), Some(7.0));
    }

    #[test]
    fn nothing_is_expected_backwards_at_once_or_far_away() {
        let (last, before) = (converged(3.0, 5.0), converged(1.0, 4.0));
        assert_eq!(last.extrapolated(&before, 2.0), None);
        assert_eq!(last.extrapolated(&before, 7.1), None);
        assert_eq!(last.extrapolated(&converged(3.0, 4.0), 4.0), None, "parts of a load are at one time");
        assert_eq!(last.extrapolated(&ConvergedState { time: 1.0, on_trend: true, states: Vec::new() }, 4.0), None);
    }

    use crate::test_block::{Block, LAPLACE, PENALTY};

    /// A square on two points of a floor without friction: argument and value at each.
    fn frictionless() -> Contact {
        Block::new(1, &[LAPLACE], &[PENALTY]).contact
    }

    #[test]
    fn a_state_that_meets_the_law_has_no_defect() {
        let contact = frictionless();
        let settled = ProjectionState::of(&[&[3.0, 3.0], &[-2.0, 0.0]]);
        assert_eq!(contact.terms[0].defect(&contact.complementarity, &settled, &settled, 0.5), 0.0);
        let tension = ProjectionState::of(&[&[-3.0, -3.0], &[-2.0, 0.0]]);
        assert_eq!(contact.terms[0].defect(&contact.complementarity, &tension, &tension, 0.0), 9.0);
    }

    #[test]
    fn a_defect_does_not_depend_on_gamma() {
        // bodies of stiffness 4, a gap of -1/2 on a branch that is open, and a traction of 2 on one that is closed: the
        // argument gamma g + t follows gamma, the error in traction is that of the bodies
        let defect = |gamma: f64| {
            let mut contact = frictionless();
            let scaling = &mut contact.terms[0].scaling;
            (scaling.ratios, scaling.slopes, scaling.stiffness) = (vec![4.0 / gamma], vec![gamma], 4.0);
            let state = ProjectionState::of(&[&[0.5 * gamma, 0.0], &[2.0 - 0.25 * gamma, 2.0]]);
            contact.terms[0].defect(&contact.complementarity, &state, &state, 1.0)
        };
        let found = [1e-3, 1.0, 1e3, 1e6].map(defect);
        assert!((found[1] - (4.0 + 1.0) / 4.0).abs() < 1e-15, "{found:?}");
        assert!(found.iter().all(|f| (f / found[1] - 1.0).abs() < 1e-9), "{found:?}");
    }

    #[test]
    fn a_step_whose_end_meets_the_law_is_taken_as_a_whole() {
        let contact = frictionless();
        let (mut from, to) = ([ProjectionState::of(&[&[1.0, -1.0]])], [ProjectionState::of(&[&[2.0, 2.0]])]);
        assert_eq!(search(&contact, &mut from, &to), (1.0, true));
        assert_eq!(from, to);
    }

    #[test]
    fn a_step_that_ends_in_a_larger_defect_is_halved_until_it_is_smaller() {
        // the point is open, where its value is to be 0; on the way it is 0.1 - s
        let contact = frictionless();
        let start = ProjectionState::of(&[&[-9.0, 0.1]]);
        let (mut from, to) = ([start.clone()], [ProjectionState::of(&[&[-9.0, -0.9]])]);
        let found = search(&contact, &mut from, &to);
        assert_eq!(found, (0.125, true), "at a quarter the defect is 0.15");
        assert!((from[0].values[1] + 0.025).abs() < 1e-15, "the next choice starts from there: {:?}", from[0]);
    }

    #[test]
    fn where_nothing_descends_the_best_trial_is_taken() {
        let contact = frictionless();
        let (mut from, to) = ([ProjectionState::of(&[&[-9.0, 0.0]])], [ProjectionState::of(&[&[-9.0, 1.0]])]);
        assert_eq!(search(&contact, &mut from, &to), (0.5f64.powi(MAX_HALVINGS), false));
    }

    #[test]
    fn sides_close_by_what_their_arguments_grow_over_the_area() {
        let contact = frictionless();
        let mut from = ProjectionState::of(&[&[1.0, 0.0], &[-2.0, 0.0]]);
        from.weights = vec![0.5, 2.0];
        let to = ProjectionState::of(&[&[2.0, 7.0], &[-1.5, 7.0]]);
        assert_eq!(contact.terms[0].closing(&from, &to), 0.5 + 2.0 * 0.5);
    }

    #[test]
    fn the_mean_over_an_entity_is_weighted_and_stays_in_it() {
        let contact = Block::new(2, &[LAPLACE], &[PENALTY]).contact;
        let mut state = ProjectionState::of(&[&[1.0, 0.0], &[5.0, 8.0], &[-7.0, 0.0], &[-7.0, 0.0]]);
        state.weights = vec![0.75, 0.25, 0.5, 0.5];
        let mean = contact.terms[0].averaged(&state);
        assert_eq!(mean.values, [2.0, 2.0, 2.0, 2.0, -7.0, 0.0, -7.0, 0.0]);
    }

    #[test]
    fn a_converged_state_comes_back_from_its_numbers_and_from_those_of_no_other_law() {
        let contact = frictionless();
        let state = ConvergedState {
            time: 2.5,
            on_trend: false,
            states: vec![ProjectionState::of(&[&[1.0, 1.0], &[-2.0, 0.0]])],
        };
        let numbers = state.numbers();
        assert_eq!(ConvergedState::from_numbers(&numbers, &contact.terms), Some(state));
        assert_eq!(ConvergedState::from_numbers(&numbers[..2], &contact.terms), None, "values without weights");
        assert_eq!(ConvergedState::from_numbers(&numbers, &[]), None);
        let with_friction = Block::with_friction(1).contact;
        assert_eq!(ConvergedState::from_numbers(&numbers, &with_friction.terms), None);
    }
}
