//! What steps that the run chooses remember of earlier ones: solutions, increments and the sizes of fields; and the error
//! of a step that follows from them. Does not solve anything.

use std::ops::Range;

use wfl_discrete::rates::{MOST_ORDER, Scheme};
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
/// A tolerance above that of Newton's method where a scene names none is a demand of that scene: what it leaves is an error.
const NO_MORE: f64 = DEFAULT_TOLERANCE;

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
}

impl Uncertainty {
    /// Of a step with this error, in units of the demanded one.
    pub(super) fn is_asked(&self, error: f64) -> bool {
        error > 1.0 || error > HOLDS && (self.explains || self.held >= PATIENCE)
    }

    /// A step with this error was taken.
    pub(super) fn taken(&mut self, error: f64) {
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
    /// By field that counts the largest value it has had.
    pub(super) scales: Vec<f64>,
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
            scales: vec![0.0; rules.fields.len()],
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
        self.uncertainty = Uncertainty::default();
    }

    /// Takes a solution at the end of an increment.
    pub(super) fn add(&mut self, scene: &Solving<'_>, rules: &Auto, increment: f64, u: &[f64]) {
        let solution = joined(u, scene.states.iter().map(|s| scene.system.data()[s.field].as_slice()));
        for (scale, range) in self.scales.iter_mut().zip(ranges(scene, rules)) {
            *scale = solution[range].iter().fold(*scale, |m, v| m.max(v.abs()));
        }
        scene.system.team().max(&mut self.scales);
        self.past.add(increment, solution, most_order(scene) + 1);
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
        let of = |range: Range<usize>| own.get(range).unwrap_or_default().iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let mut now: Vec<f64> = ranges(scene, rules).map(of).collect();
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
    /// `rounding` is by field what rounding may change of it, or empty: where all that a field has missed is that, it has no
    /// error.
    pub(super) fn errors(
        &self,
        scene: &Solving<'_>,
        rules: &Auto,
        increment: f64,
        solution: &[f64],
        rounding: &[f64],
    ) -> Option<Errors> {
        let most = most_order(scene);
        let expected: Vec<Vec<f64>> = (1..=most).map_while(|order| self.past.extrapolated(increment, order)).collect();
        if expected.is_empty() {
            return None;
        }
        let team = scene.system.team();
        let rates = scene.system.rates();
        let scales = self.scales_of_alike(scene, rules, solution);
        let (mut errors, mut own) = (Errors::default(), rounding.iter().copied());
        for (field, (range, scale)) in rules.fields.iter().zip(ranges(scene, rules).zip(scales)) {
            let rounded = ROUNDED * own.next().unwrap_or(0.0);
            let error = |order: usize, method: f64| {
                let missed = team.largest(distance(solution, &expected[order - 1], range.clone(), scale));
                let missed = if missed * scale <= rounded { 0.0 } else { missed };
                self.past.share(increment, order, method) * missed / rules.error
            };
            let order = rates.and_then(|rates| rates.order(*field)).filter(|order| *order <= expected.len());
            if let (Some(order), Some(rates)) = (order, rates) {
                let chosen = errors.chosen.get_or_insert(Chosen { order: self.control.order, around: [None; 3] });
                for (around, order) in chosen.around.iter_mut().zip(order - 1..=expected.len()) {
                    if let Some(method) = rates.misses_with(*field, order) {
                        *around = Some(larger(around.unwrap_or(0.0), error(order, method)));
                    }
                }
                continue;
            }
            let misses = rates.and_then(|rates| rates.misses(*field));
            for (order, method) in fixed(misses, increment, expected.len()) {
                let largest = &mut errors.by_order[order - 1];
                *largest = larger(*largest, error(order, method));
            }
        }
        Some(errors)
    }

    /// The error of unknowns `u` that lag behind the states by `lag`, both by dof, relative to the demanded one: that of every
    /// unknown, since a lag needs no past of its own.
    ///
    /// It is there at the end of every step and does not add up, as the errors of steps do: those of a method of first order, each
    /// of the demanded size, add up to about the root of it. So much unknowns may lag.
    pub(super) fn of_lag(&self, scene: &Solving<'_>, rules: &Auto, u: &[f64], lag: &[f64]) -> f64 {
        let system = &scene.system;
        let states = || std::iter::once(u).chain(self.past.solutions.iter().map(Vec::as_slice));
        let most = |of: &[f64]| of.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        let fields: Vec<usize> = (0..system.fields.len()).filter(|field| system.range(*field).is_some()).collect();
        let range = |field: usize| system.range(field).unwrap_or_default();
        let mut sizes: Vec<f64> =
            fields.iter().map(|field| states().fold(0.0f64, |size, u| size.max(most(&u[range(*field)])))).collect();
        let mut lags: Vec<f64> = fields.iter().map(|field| most(&lag[range(*field)])).collect();
        [&mut sizes, &mut lags].into_iter().for_each(|numbers| system.team().max(numbers));
        let part = |(field, lag): (&usize, &f64)| {
            let alike = fields.iter().zip(&sizes).filter(|(other, _)| system.alike(**other) == system.alike(*field));
            let size = alike.fold(0.0f64, |most, (_, size)| most.max(*size));
            if *lag == 0.0 { 0.0 } else { lag / size }
        };
        fields.iter().zip(&lags).map(part).fold(0.0, f64::max).powi(2) / rules.error
    }

    /// By field that counts the largest value that it has had, or one of the same unit and size: a body at rest that another
    /// one meets has its first displacement, which is small beside that of the other, as one body of one field would have.
    fn scales_of_alike(&self, scene: &Solving<'_>, rules: &Auto, solution: &[f64]) -> Vec<f64> {
        let size = |range: Range<usize>| solution[range].iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let mut own: Vec<f64> = ranges(scene, rules).map(size).collect();
        scene.system.team().max(&mut own);
        own.iter_mut().zip(&self.scales).for_each(|(own, before)| *own = own.max(*before));
        let among = |field: usize| {
            let others = rules.fields.iter().zip(&own);
            let alike = others.filter(|(other, _)| scene.system.alike(**other) == scene.system.alike(field));
            alike.fold(0.0f64, |m, (_, size)| m.max(*size))
        };
        rules.fields.iter().map(|field| among(*field)).collect()
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

/// Where the fields that count lie in a solution.
fn ranges<'s>(scene: &'s Scene, rules: &'s Auto) -> impl Iterator<Item = Range<usize>> + 's {
    rules.fields.iter().map(|field| {
        if let Some(range) = scene.system.range(*field) {
            return range;
        }
        let mut start = scene.system.numbering.n_dofs;
        for state in &scene.states {
            let n = scene.system.data()[state.field].len();
            if state.field == *field {
                return start..start + n;
            }
            start += n;
        }
        0..0
    })
}

pub(super) fn joined<'s>(u: &[f64], states: impl Iterator<Item = &'s [f64]>) -> Vec<f64> {
    let mut all = u.to_vec();
    states.for_each(|s| all.extend_from_slice(s));
    all
}
