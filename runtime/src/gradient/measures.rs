//! Results: measures as weighted sums over points, whose weights are those of the reduction, or over the equations of
//! prescribed values.
//!
//! An integral has the weights of its rule, a mean those over the size of its region. The largest value is that of one
//! point, and so is its derivative; two points that share it are told.

use wfl::{Code, Diagnostic, ResolvedScript, ast::Reduction};
use wfl_compiler::{
    compile_value_gradient,
    types::{FieldId, InputSlot},
};

use super::{
    Request,
    extended::Extended,
    laws::{Of, Placed, acts},
    near::{NEAR, NearKink},
    refused::{flat, no_result, not_in_weights, of_balance, of_followed},
};
use crate::{
    Measure,
    assemble::FieldValues,
    scene::Solving,
    value::{Sampled, Value},
};

/// What a result is a weighted sum of.
pub(super) enum Summed {
    /// Values at points: by part of the points the field of their weights.
    Points(Vec<usize>),
    /// Equations of prescribed values: minus their sum, with weights by dof in local frames.
    Rows(Vec<(usize, f64)>),
}

/// A measure as a weighted sum.
pub(super) struct Weighed {
    /// The sum that it is added to.
    pub(super) into: usize,
    /// Position of the measure in the scene.
    pub(super) measure: usize,
    /// Of what.
    pub(super) summed: Summed,
    /// By step of the trajectory that ends a step of the scene its weight in the result.
    pub(super) steps: Vec<f64>,
}

/// Each result of a request: its measure, its points and the weights of steps that end at `times`; and the laws of their
/// derivatives.
pub(super) fn weighed(
    extended: &mut Extended<'_>,
    script: &ResolvedScript,
    request: &Request,
    times: &[f64],
) -> Result<(Vec<Weighed>, Vec<Placed>), Box<Diagnostic>> {
    let scene = extended.scene;
    let (mut results, mut laws) = (Vec::new(), Vec::new());
    for (number, wanted) in request.results.iter().enumerate() {
        let into = if request.together { 0 } else { number };
        let measure = scene.measures.iter().position(|m| m.name == wanted.measure);
        let declared = script.measures.iter().find(|m| m.name.name == wanted.measure);
        let (Some(measure), Some(declared)) = (measure, declared) else {
            let names: Vec<&str> = script.measures.iter().map(|m| m.name.name.as_str()).collect();
            return Err(no_result(script, &wanted.measure, &names));
        };
        let steps = wanted.weights(times).map_err(|why| {
            Box::new(Diagnostic::new(Code::E470, format!("`{}`: {why}", wanted.name)).at(declared.span, "this measure"))
        })?;
        if let Some(rows) = scene.measures[measure].rows() {
            if scene.system.numbering.has_ties() {
                return Err(of_followed(&wanted.measure, declared.expr.span));
            }
            let names: Vec<&str> = extended.live.iter().map(|live| live.name.as_str()).collect();
            not_in_weights(&declared.expr, &names)?;
            results.push(Weighed { into, measure, summed: Summed::Rows(rows.to_vec()), steps });
            continue;
        }
        let Some((_, points)) = scene.measures[measure].at_points() else {
            return Err(of_balance(&wanted.measure, declared.expr.span));
        };
        let (mut fields, mut any) = (Vec::new(), false);
        for (part, (value, sampled)) in points.iter().enumerate() {
            let weights = extended.add_weights(&sampled.domain);
            let place = extended.place(&sampled.domain, value.law.mapping.is_some());
            let of = (FieldId::new(weights), extended.companions());
            let made = compile_value_gradient(&extended.env(), &place, &wanted.measure, &declared.expr, of);
            let law = acts(made, &wanted.measure, &sampled.domain, Of::Measure(number, part))?;
            any |= law.is_some() || !follows_unknowns(scene, value);
            laws.extend(law);
            fields.push(weights);
        }
        if !any {
            return Err(flat(&wanted.measure, declared.expr.span));
        }
        results.push(Weighed { into, measure, summed: Summed::Points(fields), steps });
    }
    Ok((results, laws))
}

/// Whether an expression reads what the run finds.
fn follows_unknowns(scene: &crate::Scene, value: &Value) -> bool {
    value.law.inputs.iter().any(|slot| match slot {
        InputSlot::Field(b) | InputSlot::Previous(b) | InputSlot::History(_, b) => {
            let field = b.field.index();
            scene.sigs[field].is_unknown() || scene.states.iter().any(|s| s.field == field)
        }
        _ => false,
    })
}

impl Weighed {
    /// By part of the points the number of each, such that the sum over the points with the weights of the rule is the
    /// measure to first order; and what there is to tell of points that share the largest value.
    pub(super) fn at_points(
        &self,
        solving: &Solving<'_>,
        values: FieldValues<'_>,
        step: (f64, f64),
    ) -> (Vec<Vec<f64>>, Option<NearKink>) {
        let measure: &Measure = &solving.measures[self.measure];
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
                    time: step.0,
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
    step: (f64, f64),
    counts: impl Fn(f64) -> bool,
) -> usize {
    let mesh = &solving.system.mesh;
    let (low, high) = mesh.bounds();
    let extent = (0..3).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
    let mut found: Vec<[f64; 3]> = Vec::new();
    for (value, sampled) in parts {
        value.at_step(values.step(step.0, step.1)).for_each_point(mesh, sampled, values, |g, entity, q, _, v| {
            let here = &sampled.domain.groups[g].here;
            let x = mesh.point_at(here.cells[entity], &here.geometry, q);
            let is_known = |y: &[f64; 3]| (0..3).all(|d| (x[d] - y[d]).abs() <= NEAR * extent);
            if counts(v[0]) && found.len() < MOST_PLACES && !found.iter().any(is_known) {
                found.push(x);
            }
        });
    }
    found.len()
}

/// Weight and value at each point.
fn taken(solving: &Solving<'_>, part: (&Value, &Sampled), values: FieldValues<'_>, step: (f64, f64)) -> Vec<[f64; 2]> {
    let (value, sampled) = part;
    let mut out = Vec::new();
    let value = value.at_step(values.step(step.0, step.1));
    value.for_each_point(&solving.system.mesh, sampled, values, |_, _, _, weight, v| out.push([weight, v[0]]));
    out
}
