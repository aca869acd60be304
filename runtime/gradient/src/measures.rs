//! Results: measures as weighted sums over points, whose weights are those of the reduction, or over the equations of
//! prescribed values.
//!
//! An integral has the weights of its rule, a mean those over the size of its region. The largest value is that of one
//! point, and so is its derivative; two points that share it are told.

use std::collections::BTreeMap;

use wfl::{
    Code, Diagnostic, ResolvedScript,
    ast::{MeasureAt, Reduction},
};
use wfl_compiler::{
    Companions, Extent, compile_value_gradient,
    types::{FieldId, InputSlot},
};
use wfl_discrete::{
    assemble::{Domain, FieldValues},
    value::{Sampled, Value},
    window::Window,
};
use wfl_problem::{Measured, Solving};
use wfl_run::Passed;

use super::{
    Differentiated, Request, WantedResult,
    computed::{Arithmetic, Followed},
    extended::Extended,
    formulas::Formula,
    laws::{Of, Placed, acts},
    near::{NEAR, NearKink},
    refused::{flat, no_result, not_in_weights, of_balance, of_mapped_measure, within},
    standing::{Ends, Standing},
};

/// What a result is a weighted sum of.
#[derive(Clone)]
pub(super) enum Summed {
    /// Values at points.
    Points(Points),
    /// Equations of prescribed values: minus their sum, with weights by dof in local frames.
    Rows(Vec<(usize, f64)>),
}

/// The points of a measure.
#[derive(Clone, Default)]
pub(super) struct Points {
    /// By part of the points the field of their weights.
    pub(super) weights: Vec<usize>,
    /// By part the field of the weights of what the region grows by; empty where that does not count.
    pub(super) growing: Vec<usize>,
    /// Whether the size of the region counts, and moves.
    pub(super) grows: bool,
    /// Of a point that is given by its place: by entry of the parameters and direction what that moves by.
    pub(super) place: Option<Vec<f64>>,
}

impl Points {
    /// What stands for what in the law of the measure.
    pub(super) fn companions(&self, extended: &Extended<'_>, domain: &Domain) -> Companions {
        match (&self.place, self.grows) {
            (Some(_), _) => extended.companions_over(Extent::Place),
            (None, true) => extended.companions_on(domain),
            (None, false) => extended.companions(),
        }
    }
}

/// A measure as a weighted sum.
pub(super) struct Weighed {
    /// The result that it is added to.
    pub(super) into: usize,
    /// Position of the measure among those of [`Extended::measures`].
    pub(super) measure: usize,
    /// Of what.
    pub(super) summed: Summed,
    /// By step of the trajectory that ends a step of the scene its weight in the result.
    pub(super) steps: Vec<f64>,
}

/// What a result follows of the parameters in its own arithmetic: by entry of those that change, at a step of the scene.
pub(super) struct Direct {
    /// The result.
    pub(super) into: usize,
    /// The number of the step.
    pub(super) end: usize,
    /// What it follows there.
    pub(super) live: Vec<f64>,
}

/// The results of a request.
#[derive(Default)]
pub(super) struct Asked {
    /// What each is a weighted sum of; several measures add to one result.
    pub(super) weighed: Vec<Weighed>,
    /// What parameters do beside them.
    pub(super) direct: Vec<Direct>,
    /// By result its value.
    pub(super) values: Vec<f64>,
    /// Numbers made of measures between two branches.
    pub(super) near: Vec<NearKink>,
    /// The laws of the derivatives of measures.
    pub(super) laws: Vec<Placed>,
    /// By measure what it is a sum of.
    sums: BTreeMap<usize, Summed>,
    /// By number made of measures what it follows at each step; nothing where no result counts.
    followed: BTreeMap<String, Vec<Option<Followed>>>,
}

impl Asked {
    /// Each result of a request, with the weights of steps that end where those of the run do.
    pub(super) fn new(
        extended: &mut Extended<'_>,
        of: Differentiated<'_>,
        request: &Request,
        standing: &mut Standing<'_, '_>,
        ends: &Ends,
    ) -> Result<Self, Box<Diagnostic>> {
        let times: Vec<f64> = ends.keys().map(|n| standing.trajectory.steps[*n].window.end).collect();
        let mut made = Self::default();
        for (number, wanted) in request.results.iter().enumerate() {
            let into = if request.together { 0 } else { number };
            let name = &wanted.measure;
            let steps = wanted.weights(&times).map_err(|why| refused_at(of.script, wanted, &why))?;
            made.values.resize(into + 1, 0.0);
            made.values[into] += value_of(of, name, &steps);
            if let Some(measure) = extended.scene.measures.iter().find(|m| m.name == *name) {
                let Some(measure) = extended.measure(&measure.name) else { return Err(no_result(of.script, name)) };
                made.add(extended, (into, measure), steps)?;
                continue;
            }
            if !made.followed.contains_key(name) {
                let Some(arithmetic) = Arithmetic::new(extended, of.script, name)? else {
                    return Err(no_result(of.script, name));
                };
                let counts = |end: usize| {
                    let same = request.results.iter().filter(|r| r.measure == *name);
                    same.filter_map(|r| r.weights(&times).ok()).any(|weights| weights[end] != 0.0)
                };
                let counted: Vec<bool> = (0..times.len()).map(counts).collect();
                made.follow(extended, of, &arithmetic, (name, &counted), standing, ends)?;
            }
            made.add_number(extended, (into, name), &steps)?;
        }
        Ok(made)
    }

    /// What is refused of a request without a run; gives the laws of the derivatives of its measures.
    pub(super) fn ahead(
        extended: &mut Extended<'_>,
        script: &ResolvedScript,
        request: &Request,
    ) -> Result<Vec<Placed>, Box<Diagnostic>> {
        let mut made = Self::default();
        let steps = &extended.scene.steps;
        let times = steps.are_listed().then(|| steps.values.clone());
        for wanted in &request.results {
            if let Some(Err(why)) = times.as_ref().map(|times| wanted.weights(times)) {
                return Err(refused_at(script, wanted, &why));
            }
            let name = &wanted.measure;
            let own = extended.scene.measures.iter().any(|m| m.name == *name);
            match extended.measure(name).filter(|_| own) {
                Some(measure) if made.sums.contains_key(&measure) => {}
                Some(measure) => {
                    let summed = made.summed(extended, measure)?;
                    made.sums.insert(measure, summed);
                }
                None if Arithmetic::new(extended, script, name)?.is_some() => {}
                None => return Err(no_result(script, name)),
            }
        }
        Ok(made.laws)
    }

    /// Adds a measure to a result.
    fn add(&mut self, extended: &mut Extended<'_>, of: (usize, usize), steps: Vec<f64>) -> Result<(), Box<Diagnostic>> {
        let (into, measure) = of;
        if !self.sums.contains_key(&measure) {
            let summed = self.summed(extended, measure)?;
            self.sums.insert(measure, summed);
        }
        let summed = self.sums[&measure].clone();
        self.weighed.push(Weighed { into, measure, summed, steps });
        Ok(())
    }

    /// What a measure is a sum of; its laws are kept.
    fn summed(&mut self, extended: &mut Extended<'_>, number: usize) -> Result<Summed, Box<Diagnostic>> {
        let (measure, declared) = extended.measures[number];
        let (name, scene) = (&declared.name.name, extended.scene);
        if let Some(rows) = measure.rows() {
            if scene.explicit.is_some() || scene.system.rates().is_some_and(|r| r.scheme().offset() != 0.0) {
                return Err(within(name, declared.expr.span));
            }
            let mut names: Vec<&str> = extended.live.iter().map(|live| live.name.as_str()).collect();
            if extended.has_motion() {
                // the nodes move, and with them a lever
                names.extend(["x", "y", "z", "X"]);
            }
            not_in_weights(&declared.expr, &names)?;
            return Ok(Summed::Rows(rows.to_vec()));
        }
        let Some((reduction, points)) = measure.at_points() else { return Err(of_balance(name, declared.expr.span)) };
        let counts = matches!(reduction, Reduction::Integral | Reduction::Mean);
        let (mut made_of, mut any) = (Points { grows: counts && extended.has_motion(), ..Points::default() }, false);
        if let (MeasureAt::Point(x), true) = (&declared.at, extended.has_motion()) {
            made_of.place = Some(moved_place(extended, x)?);
        }
        for (part, (value, sampled)) in points.iter().enumerate() {
            let weights = extended.add_weights(&sampled.domain);
            let growing = made_of.grows.then(|| extended.add_weights(&sampled.domain));
            if extended.has_motion() && value.law.mapping.is_some() {
                return Err(of_mapped_measure(name, declared.expr.span));
            }
            let place = extended.place(&sampled.domain, value.law.mapping);
            let companions = made_of.companions(extended, &sampled.domain);
            let of = (FieldId::new(weights), growing.map(FieldId::new), companions);
            let made = compile_value_gradient(&extended.env(), &place, name, &declared.expr, of);
            let law = acts(made, name, &sampled.domain, Of::Measure(number, part))?;
            any |= law.is_some() || !follows_unknowns(scene, value);
            self.laws.extend(law);
            made_of.weights.push(weights);
            made_of.growing.extend(growing);
        }
        if any { Ok(Summed::Points(made_of)) } else { Err(flat(name, declared.expr.span)) }
    }

    /// What a number made of measures follows at the steps that count.
    fn follow(
        &mut self,
        extended: &Extended<'_>,
        of: Differentiated<'_>,
        arithmetic: &Arithmetic,
        named: (&str, &[bool]),
        standing: &mut Standing<'_, '_>,
        ends: &Ends,
    ) -> Result<(), Box<Diagnostic>> {
        let (name, counted) = named;
        let own = arithmetic.own_measures(extended);
        let mut all = Vec::with_capacity(counted.len());
        for ((n, end), counts) in ends.iter().zip(counted) {
            if !counts {
                all.push(None);
                continue;
            }
            let step = &*standing.steps.step(*n)?;
            let mut values = of.outcome.steps[*end].measures.clone();
            if !own.is_empty() {
                standing.at_end_of(*n)?;
                let at = Measured::new(standing.solving.system, step.window, step.at_end());
                let at = if step.kind == Passed::Given { at.where_time_starts() } else { at };
                let own = own.iter().map(|k| extended.measures[*k].0);
                values.extend(own.map(|m| (m.name.clone(), m.evaluate(&at))));
            }
            let (followed, near) = arithmetic.followed(extended, &values, step.window)?;
            // later steps come first, as the adjoint finds them
            near.into_iter().for_each(|kink| self.near.insert(0, kink));
            all.push(Some(followed));
        }
        self.followed.insert(name.to_owned(), all);
        Ok(())
    }

    /// Adds a number made of measures to a result: its measures, each with what the number follows of it.
    fn add_number(
        &mut self,
        extended: &mut Extended<'_>,
        of: (usize, &str),
        steps: &[f64],
    ) -> Result<(), Box<Diagnostic>> {
        let (into, name) = of;
        let followed = self.followed[name].clone();
        let mut by_measure: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
        for (end, (followed, weight)) in followed.iter().zip(steps).enumerate().filter(|(_, (_, w))| **w != 0.0) {
            let Some(followed) = followed else { continue };
            for (measure, slope) in &followed.measures {
                by_measure.entry(*measure).or_insert_with(|| vec![0.0; steps.len()])[end] += weight * slope;
            }
            let live: Vec<f64> = followed.live.iter().map(|x| weight * x).collect();
            if live.iter().any(|x| *x != 0.0) {
                self.direct.push(Direct { into, end, live });
            }
        }
        by_measure.into_iter().try_for_each(|(measure, steps)| self.add(extended, (into, measure), steps))
    }
}

/// A result that is taken at no step, or has no measure, with its place where there is one.
fn refused_at(script: &ResolvedScript, wanted: &WantedResult, why: &str) -> Box<Diagnostic> {
    let d = Diagnostic::new(Code::E470, format!("`{}`: {why}", wanted.name));
    let measures = script.measures.iter().map(|m| (&m.name, m.span));
    let place =
        measures.chain(script.computed.iter().map(|c| (&c.name, c.span))).find(|(n, _)| n.name == wanted.measure);
    Box::new(match place {
        Some((_, span)) => d.at(span, "this measure"),
        None => d,
    })
}

/// By entry of the parameters and direction of space what the place of a point moves by.
fn moved_place(extended: &Extended<'_>, x: &wfl::ast::Expr) -> Result<Vec<f64>, Box<Diagnostic>> {
    let formula = Formula::new(extended, "the point of a measure", x)?;
    let (n, dim) = (extended.n_live(), extended.scene.system.mesh.dim());
    let mut out = vec![0.0; n * dim];
    for (entry, to) in out.chunks_exact_mut(dim).enumerate() {
        let unit: Vec<f64> = (0..n).map(|k| f64::from(u8::from(k == entry))).collect();
        let moved = formula.moved_in_place(extended, (&[[0.0; 3]], Window::default()), &unit)?;
        to.iter_mut().zip(&moved).for_each(|(t, m)| *t = *m);
    }
    Ok(out)
}

/// The value of a result.
fn value_of(of: Differentiated<'_>, name: &str, steps: &[f64]) -> f64 {
    let at = |step: &wfl_run::StepResult| step.measures.iter().find(|m| m.0 == *name).map_or(f64::NAN, |m| m.1);
    let counted = of.outcome.steps.iter().zip(steps).filter(|(_, weight)| **weight != 0.0);
    counted.map(|(step, weight)| weight * at(step)).sum()
}

/// Whether an expression reads what the run finds.
fn follows_unknowns(scene: &wfl_problem::Scene, value: &Value) -> bool {
    value.law.inputs.iter().any(|slot| match slot {
        InputSlot::Field(b) | InputSlot::Previous(b) | InputSlot::History(_, b) => {
            let field = b.field.index();
            scene.sigs[field].is_unknown() || scene.states.iter().any(|s| s.field == field)
        }
        _ => false,
    })
}

/// What of the values at its points a measure is made of.
pub(super) struct Counted {
    /// By part and point the factor of what the point changes by in what the measure changes by: of a largest or smallest
    /// value one for each point that has it, and minus one for a smallest one.
    pub(super) counts: Vec<Vec<f64>>,
    /// It is the largest or smallest value of several points.
    pub(super) shared: bool,
    reduction: Reduction,
}

impl Counted {
    /// What the measure changes by, of what its points change by: the largest of those that share the largest value.
    pub(super) fn along(&self, moved: &[Vec<f64>]) -> f64 {
        let each = || self.counts.iter().flatten().zip(moved.iter().flatten()).filter(|(c, _)| **c != 0.0);
        match self.reduction {
            Reduction::Max | Reduction::Min => {
                let sign = if self.reduction == Reduction::Min { -1.0 } else { 1.0 };
                sign * each().map(|(count, x)| count * x).fold(f64::NEG_INFINITY, f64::max)
            }
            _ => each().map(|(count, x)| count * x).sum(),
        }
    }
}

impl Weighed {
    /// By part of the points what the growth of the region counts by at each: the value in an integral, in a mean how far it is
    /// above that, over the size of the region.
    pub(super) fn growing(
        &self,
        of: (&Extended<'_>, &Solving<'_>),
        values: FieldValues<'_>,
        step: Window,
    ) -> Vec<Vec<f64>> {
        let (extended, solving) = of;
        let Some((reduction, parts)) = extended.measures[self.measure].0.at_points() else { return Vec::new() };
        let points: Vec<Vec<[f64; 2]>> =
            parts.iter().map(|(value, sampled)| taken(solving, (value, sampled), values, step)).collect();
        let all = || points.iter().flatten();
        let (mean, size) = match reduction {
            Reduction::Mean => {
                let size: f64 = all().map(|p| p[0]).sum();
                (all().map(|[w, v]| w * v).sum::<f64>() / size, size)
            }
            _ => (0.0, 1.0),
        };
        points.iter().map(|list| list.iter().map(|[_, v]| (v - mean) / size).collect()).collect()
    }

    /// What of the values at its points the measure is made of.
    pub(super) fn taken_at(&self, of: (&Extended<'_>, &Solving<'_>), values: FieldValues<'_>, step: Window) -> Counted {
        let (extended, solving) = of;
        let (reduction, parts) = extended.measures[self.measure].0.at_points().expect("others are refused");
        let points: Vec<Vec<[f64; 2]>> =
            parts.iter().map(|(value, sampled)| taken(solving, (value, sampled), values, step)).collect();
        let all = || points.iter().flatten();
        let with = |f: &dyn Fn(&[f64; 2]) -> f64| points.iter().map(|list| list.iter().map(f).collect()).collect();
        let (counts, shared) = match reduction {
            Reduction::Integral => (with(&|p| p[0]), false),
            Reduction::Mean => {
                let size = all().map(|p| p[0]).sum::<f64>();
                (with(&|p| p[0] / size), false)
            }
            _ => {
                let sign = if reduction == Reduction::Min { -1.0 } else { 1.0 };
                let best = all().map(|p| sign * p[1]).fold(f64::NEG_INFINITY, f64::max);
                let is_best = |p: &[f64; 2]| best - sign * p[1] <= NEAR * best.abs();
                let shared = reduction != Reduction::Value && all().filter(|p| is_best(p)).count() > 1;
                (with(&|p| if is_best(p) { sign } else { 0.0 }), shared)
            }
        };
        Counted { counts, shared, reduction }
    }

    /// By part of the points the number of each, such that the sum over the points with the weights of the rule is the
    /// measure to first order; and what there is to tell of points that share the largest value.
    pub(super) fn at_points(
        &self,
        of: (&Extended<'_>, &Solving<'_>),
        values: FieldValues<'_>,
        step: Window,
    ) -> (Vec<Vec<f64>>, Option<NearKink>) {
        let (extended, solving) = of;
        let measure = extended.measures[self.measure].0;
        let (reduction, parts) = measure.at_points().expect("others are refused");
        let points: Vec<Vec<[f64; 2]>> =
            parts.iter().map(|(value, sampled)| taken(solving, (value, sampled), values, step)).collect();
        let all = || points.iter().flatten();
        let one = |chosen: (usize, usize)| -> Vec<Vec<f64>> {
            let number = |part: usize, k: usize, w: f64| if (part, k) == chosen { 1.0 / w } else { 0.0 };
            let of = |(part, list): (usize, &Vec<[f64; 2]>)| {
                list.iter().enumerate().map(|(k, [w, _])| number(part, k, *w)).collect()
            };
            points.iter().enumerate().map(of).collect()
        };
        let same = |x: f64| points.iter().map(|list| vec![x; list.len()]).collect();
        match reduction {
            Reduction::Integral => (same(1.0), None),
            Reduction::Mean => (same(1.0 / all().map(|p| p[0]).sum::<f64>()), None),
            _ => {
                let sign = if reduction == Reduction::Min { -1.0 } else { 1.0 };
                let mut best = ((0, 0), f64::NEG_INFINITY);
                for (part, list) in points.iter().enumerate() {
                    for (k, [_, v]) in list.iter().enumerate() {
                        if sign * v > best.1 {
                            best = ((part, k), sign * v);
                        }
                    }
                }
                let is_near = |v: f64| best.1 - sign * v <= NEAR * best.1.abs();
                let sharing = if all().filter(|p| is_near(p[1])).count() > 1 {
                    places(solving, parts, values, step, is_near)
                } else {
                    1
                };
                let told = (reduction != Reduction::Value && sharing > 1).then(|| NearKink {
                    place: measure.name.clone(),
                    span: Some(measure.span),
                    kind: "share the largest or smallest value",
                    time: step.stage,
                    points: sharing,
                    of: all().count(),
                    more: 0,
                });
                (one(best.0), told)
            }
        }
    }
}

/// Places that share a value are counted up to so many.
const MOST_PLACES: usize = 1000;

/// At how many places a value is taken that counts: neighbouring faces and cells have points at one place.
fn places(
    solving: &Solving<'_>,
    parts: &[(Value, Sampled)],
    values: FieldValues<'_>,
    step: Window,
    counts: impl Fn(f64) -> bool,
) -> usize {
    let mesh = &solving.system.mesh;
    let (low, high) = mesh.bounds();
    let extent = (0..3).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
    let mut found: Vec<[f64; 3]> = Vec::new();
    for (value, sampled) in parts {
        value.at_step(values.with_present_rates(step)).for_each_point(mesh, sampled, values, |g, entity, q, _, v| {
            let x = sampled.domain.groups[g].position(mesh, entity, q);
            let is_known = |y: &[f64; 3]| (0..3).all(|d| (x[d] - y[d]).abs() <= NEAR * extent);
            if counts(v[0]) && found.len() < MOST_PLACES && !found.iter().any(is_known) {
                found.push(x);
            }
        });
    }
    found.len()
}

/// Weight and value at each point.
fn taken(solving: &Solving<'_>, part: (&Value, &Sampled), values: FieldValues<'_>, step: Window) -> Vec<[f64; 2]> {
    let (value, sampled) = part;
    let mut out = Vec::new();
    let value = value.at_step(values.with_present_rates(step));
    value.for_each_point(&solving.system.mesh, sampled, values, |_, _, _, weight, v| out.push([weight, v[0]]));
    out
}
