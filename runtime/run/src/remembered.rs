//! What steps that the run chooses remember of earlier ones: solutions, increments and how far fields have gone; and the error
//! of a step that follows from them. Does not solve anything.
//!
//! Errors are relative to the largest change of a field since the start of the run, not to its values: a temperature of 20 degrees is one of
//! 293 kelvins, a pressure stands on a hydrostatic one, and neither says how exact what happens has to be.

use std::ops::Range;

use wfl_compiler::types::RateForm;
use wfl_discrete::{
    rates::{MOST_ORDER, Rates, Scheme},
    system::System,
};
use wfl_host::team::Team;
use wfl_newton::{DEFAULT_TOLERANCE, StepHistory};
use wfl_problem::{Auto, Scene, Solving};

use super::{
    control::{Chosen, Control, Errors},
    gained::Gained,
    past::{Past, distance},
};

/// A difference of a solution from an extrapolation of others is up to so many times the rounding of each: the line through two takes
/// the newer one twice, and one sample of signs may miss some of it.
const ROUNDED: f64 = 16.0;
/// The same of what has inertia: velocities are differences of rounded values, and a scheme that damps nothing keeps and adds up what rounding
/// makes of them. A body at rest on a floor was seen to be moved by 200 roundings in 2 s, a mass that is let go by 50 in its first steps.
const ROUNDED_MOTION: f64 = 256.0;
/// The part of its change, at least, that each step misses of a field which is nothing but rounding: no line leads through that.
const NOISE: f64 = 0.1;
/// A tolerance above that of Newton's method where a scene names none is a demand of that scene: what it leaves is an error.
const NO_MORE: f64 = DEFAULT_TOLERANCE;

/// The largest error of a step, as a part of what happens beside a uniform flight, that is not told: results of one step of it have two digits.
const SEEN: f64 = 1e-2;

/// What happens beside a drift is at most this part of the change of a field that nearly all is drift: beside more of it, an error that is
/// demanded of the change is one of both.
const DRIFTS: f64 = 0.1;

/// An error, in units of the demanded one, that holds the next increment below twice this one: 0.9/sqrt(0.2) is 2.
const HOLDS: f64 = 0.2;
/// After so many steps in a row whose errors hold the increments it is asked whether these are errors: that takes about as long as
/// an iteration, a tangent and its factor, which one step in so many does not feel.
const PATIENCE: usize = 16;

/// When it is asked how much of the errors is no error of the steps, but what rounding and the tolerance of Newton's method leave.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Uncertainty {
    /// By field what it was the last time.
    pub(super) sizes: Vec<f64>,
    /// Steps in a row whose errors held the next increment.
    pub(super) held: usize,
    /// The last time it was, at least in part.
    pub(super) explains: bool,
    /// By field the largest that was taken for no error in any step.
    pub(super) excused: Vec<f64>,
    /// By field the largest error of any step (of its values).
    pub(super) missed: Vec<f64>,
}

/// The errors of a step, by field that counts what would be one, if rounding and the tolerance of Newton's method could not have
/// made it, and what is one (of its values).
pub(super) struct Estimate {
    pub(super) errors: Errors,
    pub(super) excused: Vec<f64>,
    pub(super) missed: Vec<f64>,
}

/// What the unknowns of a step are behind its states.
pub(super) struct Lag {
    /// By dof.
    pub(super) unknowns: Vec<f64>,
    /// The increment of the step, and how far it is from its end to that of the run.
    pub(super) increment: f64,
    pub(super) left: f64,
}

/// A field whose steps cannot be as exact as demanded.
pub(super) struct Unresolved {
    pub(super) field: usize,
    /// What rounding may be of its change.
    pub(super) part: f64,
}

impl Uncertainty {
    /// Of a step with this error, in units of the demanded one.
    pub(super) fn is_asked(&self, error: f64) -> bool {
        error > 1.0 || error > HOLDS && (self.explains || self.held >= PATIENCE)
    }

    /// A step with this error was taken, of which by field so much was none, and so much missed.
    pub(super) fn taken(&mut self, error: f64, excused: &[f64], missed: &[f64]) {
        for (all, now) in [(&mut self.excused, excused), (&mut self.missed, missed)] {
            all.resize(now.len().max(all.len()), 0.0);
            all.iter_mut().zip(now).for_each(|(most, now)| *most = most.max(*now));
        }
        self.held = match error > HOLDS && self.held < PATIENCE {
            true => self.held + 1,
            false => 0,
        };
    }
}

/// What steps that the run chooses remember.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Adaptive {
    pub(super) control: Control,
    /// Unknowns, and states behind them.
    pub(super) past: Past,
    /// The solution with which the run started, as those in `past`, and the first that was solved; empty before there is one.
    pub(super) start: Vec<f64>,
    pub(super) solved: Vec<f64>,
    /// By dof the velocity of the uniform motion with which the run started: of what has inertia the first one, of other unknowns that
    /// of the first step; zero for states.
    pub(super) course: Vec<f64>,
    /// By field of the scene its largest change since the start, at any value of the step variable; the same beside the uniform motion; and
    /// that since the first step.
    pub(super) changes: [Vec<f64>; 3],
    /// The relative residuals that Newton's method has left of the solutions in `past`, in their order.
    pub(super) left: Vec<f64>,
    pub(super) uncertainty: Uncertainty,
    /// Of a scene in which displacements alone say too little of the error of a step.
    pub(super) gained: Option<Gained>,
}

impl Adaptive {
    pub(super) fn new(rules: &Auto) -> Self {
        Self {
            control: Control::new(rules),
            past: Past::default(),
            start: Vec::new(),
            solved: Vec::new(),
            course: Vec::new(),
            changes: [Vec::new(), Vec::new(), Vec::new()],
            left: Vec::new(),
            uncertainty: Uncertainty::default(),
            gained: None,
        }
    }

    /// Behind a corner of a load earlier solutions say nothing of the next one: the first increment follows, as at the
    /// start.
    pub(super) fn turn(&mut self, rules: &Auto) {
        self.control.turn(rules);
        self.past = Past::default();
        self.left.clear();
        let Uncertainty { excused, missed, .. } = std::mem::take(&mut self.uncertainty);
        self.uncertainty = Uncertainty { excused, missed, ..Uncertainty::default() };
    }

    /// Takes a solution at the end of an increment.
    pub(super) fn add(&mut self, scene: &Solving<'_>, increment: f64, u: &[f64]) {
        let solution = joined(u, scene.states.iter().map(|s| scene.system.data()[s.field].as_slice()));
        if self.start.is_empty() {
            self.start.clone_from(&solution);
            self.course = course(scene);
            // where time starts nothing is solved
            if scene.steps.from_start {
                self.changes = self.changes_until(scene, &solution);
                return self.past.add(increment, solution, most_order(scene) + 1);
            }
        }
        if self.solved.is_empty() {
            self.solved.clone_from(&solution);
        }
        let elapsed = scene.system.step().end - scene.steps.first();
        if elapsed > 0.0 && self.changes[0].iter().all(|change| *change == 0.0) {
            self.drift(scene, elapsed, &solution);
        }
        self.changes = self.changes_until(scene, &solution);
        self.past.add(increment, solution, most_order(scene) + 1);
    }

    /// Takes what the first step changes of the unknowns without inertia, in the middle of those of their field and component, for the beginning
    /// of a drift.
    fn drift(&mut self, scene: &Solving<'_>, elapsed: f64, solution: &[f64]) {
        let system = &scene.system;
        let fields: Vec<usize> = (0..system.fields.len()).filter(|k| !has_inertia(scene, *k)).collect();
        for (field, range) in fields.into_iter().filter_map(|k| Some((k, system.range(k)?))) {
            let rates = range.map(|dof| (dof, (solution[dof] - self.start[dof]) / elapsed));
            for (dof, rate) in in_the_middle(system, field, rates.collect()) {
                self.course[dof] = rate;
            }
        }
    }

    /// The same with the rows of all ranks, made by all together.
    pub(super) fn of_all(&self, team: &dyn Team) -> Self {
        let mut all = self.clone();
        all.gained.iter_mut().for_each(|gained| gained.balance = gained.balance.of_all(team));
        all
    }

    /// Takes what Newton's method has left of the solution that [`Self::add`] takes next.
    pub(super) fn leave(&mut self, scene: &Solving<'_>, history: &StepHistory) {
        self.left.insert(0, history.iterations.last().map_or(0.0, |last| last.residual));
        self.left.truncate(most_order(scene) + 1);
    }

    /// The relative residual that counts as uncertainty: the largest of those that were left, and never more than [`NO_MORE`].
    pub(super) fn left_over(&self) -> f64 {
        self.left.iter().fold(0.0f64, |most, left| most.max(*left)).min(NO_MORE)
    }

    /// What is expected behind another increment; `None` where nothing is known of the past.
    pub(super) fn expected(&self, scene: &Solving<'_>, increment: f64) -> Option<Vec<f64>> {
        let most = most_order(scene).min(self.control.order as usize);
        (1..=most).rev().find_map(|order| self.past.extrapolated(increment, order))
    }

    /// By field that counts what rounding and a residual may change of it, which is by dof `own` now; or what they might have changed
    /// when this was asked last: a point that has stuck for a step, since that is within the tolerance, would seem to be certain.
    pub(super) fn uncertain(&mut self, scene: &Solving<'_>, rules: &Auto, own: &[f64]) -> Vec<f64> {
        let of = |field: &usize| largest(own.get(range(scene, *field)).unwrap_or_default());
        let mut now: Vec<f64> = rules.fields.iter().map(of).collect();
        scene.system.team().max(&mut now);
        let before = std::mem::replace(&mut self.uncertainty.sizes, now.clone());
        now.iter_mut().zip(before).for_each(|(now, before)| *now = now.max(before));
        now
    }

    /// The estimated errors of a solution, relative to the demanded one; `None` where nothing is known of the past.
    ///
    /// What the scheme does not integrate, states among it, counts as a solution of backward Euler; so does everything in
    /// the second step, behind which no parabola is known yet: its error is smaller than that.
    ///
    /// `rounding` is by field that counts what rounding may change of it, or empty: where all that a field has missed is that, it
    /// has no error.
    pub(super) fn errors(
        &self,
        scene: &Solving<'_>,
        rules: &Auto,
        increment: f64,
        solution: &[f64],
        rounding: &[f64],
    ) -> Option<Estimate> {
        let most = most_order(scene);
        let expected: Vec<Vec<f64>> = (1..=most).map_while(|order| self.past.extrapolated(increment, order)).collect();
        if expected.is_empty() {
            return None;
        }
        let rates = scene.system.rates();
        let all_changes = self.changes_of_alike(scene, solution);
        let sizes = self.sizes(scene, rules, solution);
        let [mut excused, mut all_missed] = [(); 2].map(|()| vec![0.0f64; rules.fields.len()]);
        let mut errors = Errors::default();
        for (k, field) in rules.fields.iter().enumerate() {
            let (range, change) = (range(scene, *field), all_changes[*field]);
            // values are rounded wherever they came from, and the extrapolation is made of them
            let of_values = roundings(scene, *field) * f64::EPSILON * sizes[k];
            let rounded = of_values.max(roundings(scene, *field) * rounding.get(k).copied().unwrap_or(0.0));
            let missed = |order: usize, method: f64| {
                let missed = scene.system.team().largest(distance(solution, &expected[order - 1], range.clone()));
                (self.past.share(increment, order, method), missed)
            };
            let error = |order: usize, method: f64| match missed(order, method) {
                (_, missed) if missed <= rounded => 0.0,
                (share, missed) => share * missed / change / rules.error,
            };
            let mut excuse = |order: usize, method: f64| {
                let (share, missed) = missed(order, method);
                // a field that has not left its rounding yet has no error that could be seen
                let is_excused = missed <= rounded && change > of_values;
                excused[k] = if is_excused { excused[k].max(share * missed) } else { excused[k] };
                all_missed[k] = if missed > rounded { all_missed[k].max(share * missed) } else { all_missed[k] };
            };
            let order = rates.and_then(|rates| rates.order(*field)).filter(|order| *order <= expected.len());
            if let (Some(order), Some(rates)) = (order, rates) {
                let chosen = errors.chosen.get_or_insert(Chosen { order: self.control.order, around: [None; 3] });
                for (around, order) in chosen.around.iter_mut().zip(order - 1..=expected.len()) {
                    if let Some(method) = rates.misses_with(*field, order) {
                        *around = Some(larger(around.unwrap_or(0.0), error(order, method)));
                    }
                }
                rates.misses_with(*field, order).into_iter().for_each(|method| excuse(order, method));
                continue;
            }
            let misses = rates.and_then(|rates| rates.misses(*field));
            for (order, method) in fixed(misses, increment, expected.len()) {
                let largest = &mut errors.by_order[order - 1];
                *largest = larger(*largest, error(order, method));
                excuse(order, method);
            }
        }
        Some(Estimate { errors, excused, missed: all_missed })
    }

    /// The error of a solution whose unknowns lag behind its states by `lag`, by dof, relative to the demanded one: that of every
    /// unknown, since a lag needs no past of its own.
    ///
    /// It is there at the end of every step and does not add up, as the errors of steps do: those of a method of first order, each
    /// of the demanded size, add up to about the root of it. So much unknowns may lag: of what they have changed since the first step
    /// (a load that is there at once makes a jump of that), and would change until the end if what they lag by in each increment went
    /// on. In the first steps a lag is all that has changed.
    pub(super) fn of_lag(&self, scene: &Solving<'_>, rules: &Auto, solution: &[f64], lag: &Lag) -> f64 {
        let system = &scene.system;
        let [_, _, since] = self.changes_until(scene, solution);
        let all_changes = among_alike(scene, &since);
        let fields: Vec<usize> = (0..system.fields.len()).filter(|field| system.range(*field).is_some()).collect();
        let most = |field: &usize| largest(&lag.unknowns[range(scene, *field)]);
        let mut lags: Vec<f64> = fields.iter().map(most).collect();
        system.team().max(&mut lags);
        let steps_left = lag.left / lag.increment;
        let part = |(field, lag): (&usize, &f64)| {
            let all = all_changes[*field] + lag * steps_left;
            if *lag == 0.0 { 0.0 } else { lag / all }
        };
        fields.iter().zip(&lags).map(part).fold(0.0, f64::max).powi(2) / rules.error
    }

    /// By field its largest changes, those of this solution included, as [`Self::changes`].
    fn changes_until(&self, scene: &Solving<'_>, solution: &[f64]) -> [Vec<f64>; 3] {
        let from = |origin: &[f64]| -> Vec<f64> {
            (0..scene.system.fields.len()).map(|k| distance(solution, origin, range(scene, k))).collect()
        };
        let all = from(&self.start);
        let elapsed = scene.system.step().end - scene.steps.first();
        let flown: Vec<f64> = self.course.iter().zip(&self.start).map(|(rate, from)| from + rate * elapsed).collect();
        let beside = if flown.is_empty() { all.clone() } else { from(&flown) };
        let since = if self.solved.is_empty() { vec![0.0; all.len()] } else { from(&self.solved) };
        let mut changes = [all, beside, since];
        for (changes, before) in changes.iter_mut().zip(&self.changes) {
            scene.system.team().max(changes);
            changes.iter_mut().zip(before).for_each(|(change, before)| *change = change.max(*before));
        }
        changes
    }

    /// By field its largest change since the start, or that of one of the same unit and size: a body at rest that another
    /// one meets has its first displacement, which is small beside that of the other, as one body of one field would have.
    fn changes_of_alike(&self, scene: &Solving<'_>, solution: &[f64]) -> Vec<f64> {
        among_alike(scene, &counted(scene, &self.changes_until(scene, solution)))
    }

    /// By field that counts the largest value of a solution and of the one before.
    fn sizes(&self, scene: &Solving<'_>, rules: &Auto, solution: &[f64]) -> Vec<f64> {
        let of = |field: &usize| {
            let all = std::iter::once(solution).chain(self.past.solutions.first().map(Vec::as_slice));
            all.fold(0.0f64, |most, values| most.max(largest(&values[range(scene, *field)])))
        };
        let mut sizes: Vec<f64> = rules.fields.iter().map(of).collect();
        scene.system.team().max(&mut sizes);
        sizes
    }

    /// The first field that counts of which more than the demanded part of its change was no error of steps but rounding; fields of
    /// which all is that, as the slip of what sticks, are none.
    pub(super) fn unresolved(&self, scene: &Solving<'_>, rules: &Auto) -> Option<Unresolved> {
        let changes = counted(scene, &self.changes);
        let of = |(k, field, excused): (usize, &usize, &f64)| {
            let change = *changes.get(*field)?;
            let (part, own) = (excused / change, self.uncertainty.sizes.get(k).copied().unwrap_or(0.0));
            // what an unknown has changed by counts once that is more than the rounding of its values; a state may be a difference
            let is_state = scene.states.iter().any(|state| state.field == *field);
            let noise = if is_state { ROUNDED * own } else { own };
            let is_noise = part >= 1.0 || part > NOISE && change <= noise;
            (part > rules.error && !is_noise).then_some(Unresolved { field: *field, part })
        };
        let fields = rules.fields.iter().zip(&self.uncertainty.excused).enumerate();
        fields.map(|(k, (field, excused))| (k, field, excused)).find_map(of)
    }

    /// The first field that counts whose change is so much flight that the demanded part of it is more than [`SEEN`] of what is beside the
    /// flight, and that part.
    pub(super) fn in_flight(&self, scene: &Solving<'_>, rules: &Auto) -> Option<Unresolved> {
        let [all, beside, _] = &self.changes;
        let counts = counted(scene, &self.changes);
        let of = |field: &usize| {
            let (change, beside) = (counts.get(*field)?, *beside.get(*field)?);
            let part = rules.error * change / beside;
            let is_noise = beside <= ROUNDED_MOTION * f64::EPSILON * all[*field];
            (part > SEEN && !is_noise).then_some(Unresolved { field: *field, part })
        };
        rules.fields.iter().filter(|field| has_inertia(scene, **field)).find_map(of)
    }

    /// The first field without inertia that counts, nearly all of whose change is the drift with which it started, and of which a step has
    /// missed more than [`SEEN`] of what is beside the drift, and that part.
    pub(super) fn in_drift(&self, scene: &Solving<'_>, rules: &Auto) -> Option<Unresolved> {
        let [_, beside, _] = &self.changes;
        let (changes, beside) = (counted(scene, &self.changes), among_alike(scene, beside));
        let of = |(field, missed): (&usize, &f64)| {
            let (change, beside) = (*changes.get(*field)?, *beside.get(*field)?);
            let is_noise = beside <= ROUNDED * (self.left_over() + f64::EPSILON) * change;
            let part = missed / beside;
            let is_drift = beside <= DRIFTS * change;
            (is_drift && part > SEEN && !is_noise).then_some(Unresolved { field: *field, part })
        };
        let fields = rules.fields.iter().zip(&self.uncertainty.missed);
        fields.filter(|(field, _)| !has_inertia(scene, **field)).find_map(of)
    }
}

/// By order what a field misses whose order is not chosen, with so many known extrapolations.
fn fixed(misses: Option<[f64; MOST_ORDER]>, increment: f64, known: usize) -> impl Iterator<Item = (usize, f64)> {
    let of_euler = 0.5 * increment * increment;
    let [first, second, ..] = misses.unwrap_or([of_euler, 0.0, 0.0]);
    let by_order = match known {
        1 => [(1, if second > 0.0 { of_euler } else { first }), (2, 0.0)],
        _ => [(1, first), (2, second)],
    };
    by_order.into_iter().filter(|(_, method)| *method > 0.0)
}

/// The larger one, or no number where one is none.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// The largest order with which the scheme integrates a field.
fn most_order(scene: &Solving<'_>) -> usize {
    scene.system.rates().map_or(1, |rates| match rates.scheme() {
        Scheme::BackwardEuler => 1,
        scheme => rates.fields().iter().map(|of| scheme.most_order(of.form)).fold(2, usize::max),
    })
}

/// By dof the velocity of what has inertia, that in the middle of those of its field and component, with which the run starts; zero for
/// all else.
fn course(scene: &Solving<'_>) -> Vec<f64> {
    let system = &scene.system;
    let of_states: usize = scene.states.iter().map(|s| system.data()[s.field].len()).sum();
    let mut course = vec![0.0; system.numbering.n_dofs + of_states];
    let rates = system.rates().into_iter().flat_map(Rates::fields);
    for of in rates.filter(|of| of.form == RateForm::Second) {
        let rates = of.dofs.clone().zip(of.kept[0].iter().copied()).collect();
        for (dof, rate) in in_the_middle(system, of.field, rates) {
            course[dof] = rate;
        }
    }
    course
}

/// By dof of a field the rate in the middle of those of its component, on any rank.
fn in_the_middle(system: &System, field: usize, rates: Vec<(usize, f64)>) -> Vec<(usize, f64)> {
    let component = |dof: usize| system.numbering.describe(&system.fields, dof).2;
    let mut ends = vec![[f64::INFINITY, f64::NEG_INFINITY]; system.fields[field].n_components];
    for (dof, rate) in &rates {
        let [low, high] = &mut ends[component(*dof)];
        (*low, *high) = (low.min(*rate), high.max(*rate));
    }
    for ends in &mut ends {
        *ends = system.team().range(ends[0], ends[1]);
    }
    let middle = |dof: usize| 0.5 * (ends[component(dof)][0] + ends[component(dof)][1]);
    rates.into_iter().map(|(dof, _)| (dof, middle(dof))).collect()
}

/// True for an unknown with a second rate.
fn has_inertia(scene: &Scene, field: usize) -> bool {
    let mut rates = scene.system.rates().into_iter().flat_map(Rates::fields);
    rates.any(|of| of.field == field && of.form == RateForm::Second)
}

/// By field the largest of those of its unit and size.
fn among_alike(scene: &Solving<'_>, own: &[f64]) -> Vec<f64> {
    let system = &scene.system;
    let among = |field: usize| {
        let alike = own.iter().enumerate().filter(|(other, _)| system.alike(*other) == system.alike(field));
        alike.fold(0.0f64, |most, (_, change)| most.max(*change))
    };
    (0..own.len()).map(among).collect()
}

/// By field the change that errors are relative to. A vibration in uniform flight is as exact as one at rest; where a law is not linear, as
/// one of contact, the flight itself is what happens, and what is beside it begins from zero with the contact.
fn counted(scene: &Solving<'_>, [all, beside, _]: &[Vec<f64>; 3]) -> Vec<f64> {
    match scene.system.is_linear() {
        true => {
            let of =
                |(k, (all, beside)): (usize, (&f64, &f64))| if has_inertia(scene, k) { all.min(*beside) } else { *all };
            all.iter().zip(beside).enumerate().map(of).collect()
        }
        false => all.clone(),
    }
}

/// Where a field lies in a solution; nowhere, if it is neither an unknown nor a state.
fn range(scene: &Scene, field: usize) -> Range<usize> {
    if let Some(range) = scene.system.range(field) {
        return range;
    }
    let mut start = scene.system.numbering.n_dofs;
    for state in &scene.states {
        let n = scene.system.data()[state.field].len();
        if state.field == field {
            return start..start + n;
        }
        start += n;
    }
    0..0
}

/// The roundings of a value that a difference from an extrapolation of others may be.
fn roundings(scene: &Scene, field: usize) -> f64 {
    if has_inertia(scene, field) { ROUNDED_MOTION } else { ROUNDED }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0f64, |most, value| most.max(value.abs()))
}

pub(super) fn joined<'s>(u: &[f64], states: impl Iterator<Item = &'s [f64]>) -> Vec<f64> {
    let mut all = u.to_vec();
    states.for_each(|s| all.extend_from_slice(s));
    all
}
