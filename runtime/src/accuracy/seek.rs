//! The search through the mesh sequence: which runs are made, in which order, and when it ends.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    Cost, Demand, Found, Notice, Out, Role, TrialRun, Trials, Ways,
    estimate::{Known, Norm, Step, believed, fineness_for, order_of_errors},
    ways::{words, work},
};
use crate::{knobs::Setting, output::Real};

/// Estimated errors are taken this much larger before they are compared with a demand.
const SAFETY: f64 = 1.25;
/// The same where a fourth level confirms the order, and by how much the two orders may differ for that.
const SAFETY_OF_FOUR: f64 = 1.1;
const SAME_ORDER: f64 = 0.25;
/// The same where two levels alone tell the error, with an order that is not their own.
const SAFETY_OF_TWO: f64 = 1.5;
/// What a run is planned for, in parts of what is allowed.
const AIM: f64 = 0.9;
/// Parts of the demand that tolerance and method may have.
const PART_OF_TOLERANCE: f64 = 0.05;
const PART_OF_METHOD: f64 = 0.2;
/// The tolerance that is tried first, in parts of the demand, and the range it may have.
const FIRST_TOLERANCE: f64 = 1e-1;
pub(super) const TOLERANCES: std::ops::RangeInclusive<f64> = 1e-10..=1e-3;
/// Levels that are closer than this say nothing about each other.
const APART: f64 = 1.4;
/// How much finer than the finest level the last run may be, with the order known from three levels and from two.
const REACH: f64 = 2.5;
const REACH_OF_TWO: f64 = 1.5;
/// Where it would be finer, a level on the way is this part of it, and no finer than that.
const HALFWAY: f64 = 0.5;
/// Demands below this begin with cells of half the size: the coarsest ones would tell nothing of them.
const COARSE_DEMAND: f64 = 0.03;
/// The second level of a degree may cost this much more than what would be run otherwise.
const EXPLORES: f64 = 2.0;
/// Most rounds after the first levels.
const MOST_ROUNDS: usize = 16;
/// A penalty is raised by at most this factor.
const MOST_STIFFER: f64 = 1e6;

/// One run of a mesh sequence.
pub(super) struct Level<R> {
    pub(super) fineness: usize,
    pub(super) setting: Vec<(String, String)>,
    pub(super) run: R,
}

/// What is run of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum How {
    /// What the solution needs.
    Lean,
    /// Everything the scene asks for.
    Whole,
}

/// The levels of one degree, from coarse to fine.
pub(super) struct MeshSequence<R> {
    pub(super) degree: usize,
    pub(super) levels: Vec<Level<R>>,
}

/// What a mesh sequence shows.
#[derive(Clone, Debug)]
pub(super) struct View {
    pub(super) order: f64,
    pub(super) safety: f64,
    /// How much finer the next run may be.
    reach: f64,
    /// Estimated errors of its levels.
    pub(super) errors: Vec<f64>,
}

/// The next run.
struct Choice {
    sequence: usize,
    fineness: usize,
    /// It is a level already.
    level: Option<usize>,
    work: f64,
    seconds: f64,
}

/// Finds a cheap setting of a scene that meets a demand, and runs it.
///
/// # Errors
/// [`Out`]; nothing has then been run with everything the scene asks for, or what was run does not meet the demand.
pub fn seek<T: Trials>(trials: &mut T, ways: &Ways, demand: &Demand) -> Result<Found<T::Run>, Out> {
    let mut search = Search {
        trials,
        ways,
        demand,
        tolerance: (FIRST_TOLERANCE * demand.error).clamp(*TOLERANCES.start(), *TOLERANCES.end()),
        stiffer: 1.0,
        tolerance_error: 0.0,
        method_error: 0.0,
        sequences: ways.degrees.iter().map(|degree| MeshSequence { degree: *degree, levels: Vec::new() }).collect(),
        trial_runs: Vec::new(),
        bad: BTreeSet::new(),
        bad_last: BTreeSet::new(),
        written: None,
        distances: BTreeMap::new(),
    };
    if !ways.refines() {
        return search.on_a_fixed_mesh();
    }
    search.first_levels()?;
    search.refine_to_demand()
}

pub(super) struct Search<'a, T: Trials> {
    pub(super) trials: &'a mut T,
    pub(super) ways: &'a Ways,
    pub(super) demand: &'a Demand,
    pub(super) tolerance: f64,
    pub(super) stiffer: f64,
    pub(super) tolerance_error: f64,
    pub(super) method_error: f64,
    pub(super) sequences: Vec<MeshSequence<T::Run>>,
    pub(super) trial_runs: Vec<TrialRun>,
    /// Finenesses without a solution that can be compared, and those whose whole scene has none.
    bad: BTreeSet<usize>,
    bad_last: BTreeSet<usize>,
    /// The run whose results were written last: mesh sequence and fineness.
    written: Option<(usize, usize)>,
    /// Distances that have been measured: mesh sequence and fineness of both.
    distances: BTreeMap<[usize; 4], f64>,
}

impl<T: Trials> Search<'_, T> {
    /// What tolerance and method add.
    pub(super) fn other(&self) -> f64 {
        self.tolerance_error + self.method_error
    }

    fn one(&mut self, setting: &Setting, fineness: usize, last: bool) -> Result<T::Run, String> {
        let run = self.trials.run(setting, fineness, last)?;
        let Cost { dofs, seconds, .. } = self.trials.cost(&run);
        self.trial_runs.push(TrialRun { setting: setting.to_vec(), dofs, seconds, error: Real(f64::NAN) });
        Ok(run)
    }

    /// Two levels of the lowest degree; tolerance and penalty are set on the first.
    fn first_levels(&mut self) -> Result<(), Out> {
        let finer = if self.demand.error < COARSE_DEMAND { 2 } else { 1 };
        let first = self.refine(0, (finer * self.ways.least).min(self.ways.own.max(self.ways.least)), How::Lean)?;
        self.set_tolerance()?;
        self.set_penalty()?;
        self.refine(0, 2 * first, How::Lean)?;
        Ok(())
    }

    /// Runs the next of the first levels of a degree that has not got them, if it is cheaper than what would be run
    /// otherwise: it may show that this degree is the better one. True if there was one.
    fn explored(&mut self, dearer_than: f64) -> Result<bool, Out> {
        let known = &self.sequences[0];
        let (Some(first), Some(finest)) = (known.levels.first().map(|l| l.fineness), known.levels.last()) else {
            return Ok(false);
        };
        // unknowns of one node an edge: coarse meshes have more for their cells
        let dofs = self.trials.cost(&finest.run).dofs as f64;
        let base = dofs / ((known.degree * finest.fineness) as f64).powf(self.ways.dim as f64);
        for sequence in 1..self.sequences.len() {
            // a third level gives the order, if it costs no more than the planned run
            let (finer, dearer_than) = match self.sequences[sequence].levels.as_slice() {
                [] => (1, EXPLORES * dearer_than),
                [one] if one.fineness < 2 * first => (2, EXPLORES * dearer_than),
                [_, two] if two.fineness < 4 * first => (4, dearer_than),
                _ => continue,
            };
            let sides = (finer * first * self.sequences[sequence].degree) as f64;
            if self.work(sequence, base * sides.powf(self.ways.dim as f64)) < dearer_than {
                self.refine(sequence, finer * first, How::Lean)?;
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Runs the first fineness from `wanted` on that has a solution, at most the next multiple of the scene's own mesh.
    fn refine(&mut self, sequence: usize, wanted: usize, how: How) -> Result<usize, Out> {
        let own = self.ways.own;
        for fineness in wanted..=wanted.next_multiple_of(own) {
            if self.bad.contains(&fineness) || (how == How::Whole && self.bad_last.contains(&fineness)) {
                continue;
            }
            let setting = self.ways.setting(self.sequences[sequence].degree, fineness, self.tolerance, self.stiffer);
            let last = how == How::Whole;
            match self.one(&setting, fineness, last) {
                Ok(run) => {
                    self.keep(sequence, Level { fineness, setting, run }, last);
                    return Ok(fineness);
                }
                // all faces of the scene's own mesh are there: what fails now is the scene
                Err(why) if fineness.is_multiple_of(own) => return Err(Out::Failed(why)),
                Err(_) if last => drop(self.bad_last.insert(fineness)),
                Err(_) => drop(self.bad.insert(fineness)),
            }
        }
        Err(Out::Failed(format!(
            "no mesh up to {} times as fine as that of the scene has a solution",
            wanted.div_ceil(own)
        )))
    }

    fn keep(&mut self, sequence: usize, level: Level<T::Run>, last: bool) {
        if last {
            self.written = Some((sequence, level.fineness));
        }
        let fineness = level.fineness;
        let levels = &mut self.sequences[sequence].levels;
        levels.retain(|l| l.fineness != fineness);
        let at = levels.partition_point(|l| l.fineness < fineness);
        levels.insert(at, level);
        self.distances.retain(|key, _| ![[key[0], key[1]], [key[2], key[3]]].contains(&[sequence, fineness]));
    }

    /// Measures what the tolerance adds on the first level, and tightens it where that is too much.
    fn set_tolerance(&mut self) -> Result<(), Out> {
        let MeshSequence { degree, levels } = &mut self.sequences[0];
        let Some(level) = levels.last_mut() else { return Ok(()) };
        let tight = self.ways.setting(*degree, level.fineness, *TOLERANCES.start(), self.stiffer);
        let found = self.trials.tighter(&mut level.run, &tight, level.fineness).map_err(Out::Failed)?;
        self.tolerance_error = found;
        let allowed = PART_OF_TOLERANCE * self.demand.error;
        if found > allowed {
            let wanted = (self.tolerance * 0.5 * allowed / found).max(*TOLERANCES.start());
            // a power of ten is as good as another number, and is read more easily
            self.tolerance = 10f64.powf(wanted.log10().floor()).max(*TOLERANCES.start());
            self.tolerance_error = 0.5 * allowed;
        }
        Ok(())
    }

    /// Measures what a penalty adds on the first level, and raises it until that is little.
    fn set_penalty(&mut self) -> Result<(), Out> {
        if self.ways.role != Role::Penalty {
            return Ok(());
        }
        let Some((degree, fineness)) = self.sequences[0].levels.last().map(|l| (self.sequences[0].degree, l.fineness))
        else {
            return Ok(());
        };
        loop {
            // the error of a penalty falls like 1/gamma: ten times stiffer leaves a tenth of it
            let setting = self.ways.setting(degree, fineness, self.tolerance, 10.0 * self.stiffer);
            let run = self.one(&setting, fineness, false).map_err(Out::Failed)?;
            self.method_error = self.apart_from_last(&run)? / 0.9;
            let allowed = PART_OF_METHOD * self.demand.error;
            if self.method_error <= allowed || self.stiffer >= MOST_STIFFER {
                return Ok(());
            }
            let factor = 10f64.powf((self.method_error / allowed).log10().ceil().max(1.0));
            let factor = factor.min(MOST_STIFFER / self.stiffer);
            self.stiffer *= factor;
            if factor == 10.0 {
                self.keep(0, Level { fineness, setting, run }, false);
            } else {
                self.refine(0, fineness, How::Lean)?;
            }
        }
    }

    fn apart_from_last(&mut self, other: &T::Run) -> Result<f64, Out> {
        match self.sequences[0].levels.last() {
            Some(level) => self.trials.distance(&level.run, other).map_err(Out::Failed),
            None => Ok(0.0),
        }
    }

    fn refine_to_demand(mut self) -> Result<Found<T::Run>, Out> {
        for _ in 0..MOST_ROUNDS {
            let views = self.views()?;
            if let Some((sequence, level)) = self.written_and_good(&views) {
                return self.found(sequence, level, &views);
            }
            let choice = self.choose(&views);
            let planned = choice.as_ref().filter(|c| c.level.is_none());
            if planned.is_some_and(|c| self.coarser(c.sequence)) {
                continue;
            }
            if choice.as_ref().is_none_or(|c| c.level.is_none())
                && self.explored(choice.as_ref().map_or(f64::INFINITY, |c| c.work))?
            {
                continue;
            }
            let Some(choice) = choice else { break };
            let next = self.halfway(&choice, &views[choice.sequence]);
            // an order that was not measured on this sequence refuses nothing: another level gives more information
            let guess = next.is_some() && views[choice.sequence].safety == SAFETY_OF_TWO;
            let seen = next.filter(|_| guess).unwrap_or(choice.fineness);
            let seconds = choice.seconds * (seen as f64 / choice.fineness as f64).powf(self.growth());
            if seconds > self.demand.budget {
                return Err(self.out_of_reach(&choice, &views));
            }
            match next {
                Some(next) => self.refine(choice.sequence, next, How::Lean)?,
                None => self.refine(choice.sequence, choice.fineness, How::Whole)?,
            };
        }
        let views = self.views()?;
        let (best, error) = self.best(&views);
        let (asked, quantity) = (self.demand.error, self.demand.quantity.clone());
        Err(Out::Lost { asked, quantity, runs: self.trial_runs.len(), best, error })
    }

    /// The run whose results are written, if it meets the demand: a cheaper one would cost another run.
    fn written_and_good(&self, views: &[View]) -> Option<(usize, usize)> {
        let (sequence, fineness) = self.written?;
        let level = self.sequences[sequence].levels.iter().position(|l| l.fineness == fineness)?;
        let view = &views[sequence];
        (view.safety * view.errors[level] <= self.demand.error - self.other()).then_some((sequence, level))
    }

    /// Runs a level below the first two of a sequence, which costs little and gives the order. True if there was one.
    fn coarser(&mut self, sequence: usize) -> bool {
        let (degree, levels) = (self.sequences[sequence].degree, &self.sequences[sequence].levels);
        let [first, _] = levels.as_slice() else { return false };
        let fineness = first.fineness / 2;
        if fineness < self.ways.least || !first.fineness.is_multiple_of(2) || self.bad.contains(&fineness) {
            return false;
        }
        let setting = self.ways.setting(degree, fineness, self.tolerance, self.stiffer);
        match self.one(&setting, fineness, false) {
            Ok(run) => self.keep(sequence, Level { fineness, setting, run }, false),
            Err(_) => drop(self.bad.insert(fineness)),
        }
        true
    }

    /// An intermediate level towards a choice that is too far beyond the finest level to be estimated from it.
    fn halfway(&self, choice: &Choice, view: &View) -> Option<usize> {
        let finest = self.sequences[choice.sequence].levels.last().map_or(1, |l| l.fineness) as f64;
        if choice.fineness as f64 <= view.reach * finest {
            return None;
        }
        let part = (HALFWAY * choice.fineness as f64).min(REACH * finest).max(REACH_OF_TWO * finest);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 1 and 1e9")]
        Some((part.ceil() as usize).max(finest as usize + 1))
    }

    /// The distance of a level from a finer one, possibly of another degree.
    fn distance(&mut self, a: (usize, usize), b: (usize, usize)) -> Result<f64, Out> {
        let (one, other) = (&self.sequences[a.0].levels[a.1], &self.sequences[b.0].levels[b.1]);
        let key = [a.0, one.fineness, b.0, other.fineness];
        if let Some(known) = self.distances.get(&key) {
            return Ok(*known);
        }
        let found = self.trials.distance(&one.run, &other.run).map_err(Out::Failed)?;
        self.distances.insert(key, found);
        Ok(found)
    }

    fn views(&mut self) -> Result<Vec<View>, Out> {
        (0..self.sequences.len()).map(|k| self.view(k)).collect()
    }

    /// The largest level that is far enough below another one.
    pub(super) fn below(&self, sequence: usize, level: usize) -> Option<usize> {
        let levels = &self.sequences[sequence].levels;
        (0..level).rev().find(|k| levels[*k].fineness as f64 * APART <= levels[level].fineness as f64)
    }

    /// The smallest level that another one is far enough below.
    fn above(&self, sequence: usize, level: usize) -> usize {
        let levels = &self.sequences[sequence].levels;
        let far = |k: &usize| levels[*k].fineness as f64 >= APART * levels[level].fineness as f64;
        (level + 1..levels.len()).find(far).unwrap_or(levels.len() - 1)
    }

    fn step(&mut self, sequence: usize, from: usize, to: usize) -> Result<Step, Out> {
        let distance = self.distance((sequence, from), (sequence, to))?;
        let at = |k: usize| self.sequences[sequence].levels[k].fineness as f64;
        Ok(Step { from: at(from), to: at(to), distance })
    }

    fn view(&mut self, sequence: usize) -> Result<View, Out> {
        let n = self.sequences[sequence].levels.len();
        let Some((finest, middle)) = n.checked_sub(1).and_then(|f| Some((f, self.below(sequence, f)?))) else {
            return Ok(View { order: f64::NAN, safety: SAFETY_OF_TWO, reach: 1.0, errors: vec![f64::NAN; n] });
        };
        let last = self.step(sequence, middle, finest)?;
        let most = self.most_order(sequence);
        let (order, safety, reach) = match self.below(sequence, middle) {
            Some(coarse) => {
                let first = self.step(sequence, coarse, middle)?;
                let order = believed(self.norm().order(first, last), most);
                let earlier = match self.below(sequence, coarse) {
                    Some(coarsest) => {
                        let before = self.step(sequence, coarsest, coarse)?;
                        Some(believed(self.norm().order(before, first), most))
                    }
                    None => None,
                };
                match earlier.filter(|p| (p - order).abs() <= SAME_ORDER * order) {
                    Some(p) => (order.min(p), SAFETY_OF_FOUR, REACH),
                    None => (order, SAFETY, REACH),
                }
            }
            None => (self.order_of_others(sequence)?.map_or(1.0, |p| believed(p, most)), SAFETY_OF_TWO, REACH_OF_TWO),
        };
        let behind = self.norm().error_behind(last, order);
        // from level to level: each is compared once with the next finer one that has a useful distance
        let mut errors = vec![behind; n];
        for k in (0..finest).rev() {
            let better = if k < middle { self.above(sequence, k) } else { finest };
            let apart = self.distance((sequence, k), (sequence, better))?;
            errors[k] = self.norm().total(apart, errors[better]);
        }
        Ok(View { order, safety, reach, errors })
    }

    /// Gradients of finite elements are nearly orthogonal to their errors, as energies of Galerkin's method are.
    fn norm(&self) -> Norm {
        if self.demand.quantity == "H1" { Norm::Squares } else { Norm::Lengths }
    }

    /// What elements of a degree give at best.
    fn most_order(&self, sequence: usize) -> f64 {
        let degree = self.sequences[sequence].degree as f64;
        if self.demand.quantity == "H1" { degree } else { degree + 1.0 }
    }

    /// The order of the lowest degree: a lower bound for the others where the solution is smooth, and the same where it
    /// is not. Without three levels its errors are estimated from the finest level of the highest degree. That level
    /// has an unknown error: half of the smaller distance is assumed.
    fn order_of_others(&mut self, sequence: usize) -> Result<Option<f64>, Out> {
        if sequence > 0
            && let Some(finest) = self.sequences[0].levels.len().checked_sub(1)
            && let Some(middle) = self.below(0, finest)
            && let Some(coarse) = self.below(0, middle)
        {
            let steps = (self.step(0, coarse, middle)?, self.step(0, middle, finest)?);
            return Ok(Some(self.norm().order(steps.0, steps.1)));
        }
        let top = self.sequences.len() - 1;
        let (Some(best), n) = (self.sequences[top].levels.len().checked_sub(1), self.sequences[0].levels.len()) else {
            return Ok(None);
        };
        if top == 0 || n < 2 {
            return Ok(None);
        }
        let Some(coarse) = self.below(0, n - 1) else { return Ok(None) };
        // a level with about as many nodes has about the same error, and their distance says nothing
        let nodes =
            |sequence: &MeshSequence<T::Run>, level: usize| (sequence.degree * sequence.levels[level].fineness) as f64;
        if nodes(&self.sequences[top], best) < APART * nodes(&self.sequences[0], n - 1) {
            return Ok(None);
        }
        let (far, near) = (self.distance((0, coarse), (top, best))?, self.distance((0, n - 1), (top, best))?);
        let errors = [far, near].map(|d| self.norm().total(d, 0.5 * near));
        let at = |k: usize, error: f64| Known { fineness: self.sequences[0].levels[k].fineness as f64, error };
        Ok(Some(order_of_errors(at(coarse, errors[0]), at(n - 1, errors[1]))))
    }

    fn work(&self, sequence: usize, dofs: f64) -> f64 {
        work(self.ways.dim, self.sequences[sequence].degree, dofs)
    }

    /// The power of the fineness that work grows with.
    fn growth(&self) -> f64 {
        let dim = self.ways.dim as f64;
        work(self.ways.dim, 1, 2f64.powf(dim)).log2() - work(self.ways.dim, 1, 1.0).log2()
    }

    /// The cheapest of the levels that meet the demand and the finer ones that should.
    fn choose(&self, views: &[View]) -> Option<Choice> {
        let allowed = self.demand.error - self.other();
        let mut list: Vec<Choice> = Vec::new();
        for (k, (sequence, view)) in self.sequences.iter().zip(views).enumerate() {
            let Some(finest) = sequence.levels.last().filter(|_| view.order.is_finite()) else { continue };
            let Cost { dofs, whole, .. } = self.trials.cost(&finest.run);
            let work_of_finest = self.work(k, dofs as f64);
            let choice = |fineness: usize, level: Option<usize>| {
                let ratio = fineness as f64 / finest.fineness as f64;
                let work = self.work(k, dofs as f64 * ratio.powf(self.ways.dim as f64));
                Choice { sequence: k, fineness, level, work, seconds: whole * work / work_of_finest }
            };
            let good = |l: &usize| {
                !self.bad_last.contains(&sequence.levels[*l].fineness) && view.safety * view.errors[*l] <= allowed
            };
            if let Some(level) = (0..sequence.levels.len()).find(good) {
                list.push(choice(sequence.levels[level].fineness, Some(level)));
                continue;
            }
            let known = Known { fineness: finest.fineness as f64, error: *view.errors.last()? };
            let wanted = fineness_for(AIM * allowed / view.safety, known, view.order).ceil();
            if wanted.is_finite() {
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and 1e9")]
                list.push(choice((wanted.min(1e9) as usize).max(finest.fineness + 1), None));
            }
        }
        list.into_iter().filter(|c| c.work.is_finite()).min_by(|a, b| a.work.total_cmp(&b.work))
    }

    /// The most accurate level: its setting and its error.
    fn best(&self, views: &[View]) -> (String, f64) {
        let all = self.sequences.iter().zip(views).flat_map(|(sequence, view)| {
            let error = |e: &f64| view.safety * e + self.other();
            sequence.levels.iter().zip(&view.errors).map(move |(l, e)| (words(&l.setting), error(e)))
        });
        all.filter(|b| b.1.is_finite()).min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default()
    }

    fn out_of_reach(&self, choice: &Choice, views: &[View]) -> Out {
        let (best, error) = self.best(views);
        let sequence = &self.sequences[choice.sequence];
        let setting = self.ways.setting(sequence.degree, choice.fineness, self.tolerance, self.stiffer);
        let view = &views[choice.sequence];
        // seconds grow like fineness^(dim power): the inverse says how fine a run of the budget is
        let slower = choice.seconds / self.demand.budget;
        let within = AIM * self.demand.error * slower.powf(view.order / self.growth());
        Out::OutOfReach {
            asked: self.demand.error,
            quantity: self.demand.quantity.clone(),
            needed: words(&setting),
            seconds: choice.seconds,
            budget: self.demand.budget,
            runs: self.trial_runs.len(),
            best,
            error,
            within: within.max(self.demand.error).min(error),
        }
    }

    /// Tolerance and penalty alone.
    fn on_a_fixed_mesh(mut self) -> Result<Found<T::Run>, Out> {
        let own = self.ways.own;
        self.refine(0, own, How::Lean)?;
        self.set_tolerance()?;
        self.set_penalty()?;
        self.refine(0, own, How::Whole)?;
        let mut why =
            vec!["mesh: it comes from a file and cannot be refined; its discretisation error is unknown".to_owned()];
        why.extend(self.why_of_parameters());
        let Some(level) = self.sequences[0].levels.pop() else { return Err(Out::Failed("no run".to_owned())) };
        let record = self.record(level.setting, why);
        Ok(Found { run: level.run, record, notice: Some(Notice::MeshOfFile) })
    }
}
