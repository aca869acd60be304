//! The parameters that a derivative goes through: those that are asked for, and those whose values are made of them.

use std::collections::BTreeSet;

use wfl::{
    Code, DataValue, Diagnostic, FieldKind, Measure, Param, ResolvedScript, StartKind,
    ast::{Cond, Expr, ExprKind},
    children, cond_children, each_name, is_auto, split_prefixes,
};
use wfl_compiler::{
    Constant, compile_slopes,
    types::{FieldId, InputSlot},
};
use wfl_discrete::window::Window;
use wfl_problem::Scene;

use super::{
    Request,
    extended::{Extended, Live},
    formulas::evaluated,
    refused::{first, no_derivative},
    request::known,
    velocities::each_moving_place,
};

/// The parameters that change, in the order of their declarations.
pub(super) fn live(script: &ResolvedScript, scene: &Scene, request: &Request) -> Result<Vec<Live>, Box<Diagnostic>> {
    let names: Vec<&str> = script.params.iter().map(|p| p.name.name.as_str()).collect();
    for name in &request.parameters {
        if !names.contains(&name.as_str()) {
            let is_data = script.fields.iter().any(|f| f.name.name == *name);
            let help =
                if is_data { format!("a data field is written `field {name}`") } else { known(name, &names, "param") };
            return Err(Box::new(Diagnostic::new(Code::E470, format!("`{name}` is no param of the scene")).help(help)));
        }
    }
    let mut found: Vec<Live> = Vec::new();
    for (declared, param) in script.params.iter().enumerate() {
        let name = &param.name.name;
        let mut depends = request.parameters.contains(name);
        let mut made_of = None;
        each_name(&param.value, &mut |word| {
            let of = found.iter().find(|l| l.name == word);
            depends |= of.is_some();
            made_of = made_of.take().or(of.map(|l| l.made_of.clone().unwrap_or(l.name.clone())));
        });
        let made_of = made_of.filter(|_| !request.parameters.contains(name));
        if let Some((_, Constant { shape, values, .. })) = scene.params.iter().find(|p| depends && p.0 == *name) {
            found.push(Live { name: name.clone(), shape: *shape, values: values.clone(), declared, made_of });
        }
    }
    Ok(found)
}

/// Moves the derivatives in parameters whose values are made of others to those; by entry of the live parameters.
pub(super) fn to_declared(
    script: &ResolvedScript,
    extended: &Extended<'_>,
    gradient: &mut [f64],
) -> Result<(), Box<Diagnostic>> {
    for k in (0..extended.live.len()).rev() {
        let own = extended.entries_of(k);
        for (to, slopes) in slopes(script, extended, k)? {
            let moved: f64 = slopes.iter().zip(&gradient[own.clone()]).map(|(s, g)| s * g).sum();
            gradient[to] += moved;
        }
    }
    Ok(())
}

/// Adds to what parameters move by what those move that their values are made of; by entry of the live parameters.
pub(super) fn from_declared(
    script: &ResolvedScript,
    extended: &Extended<'_>,
    moved: &mut [f64],
) -> Result<(), Box<Diagnostic>> {
    for k in 0..extended.live.len() {
        let own = extended.entries_of(k);
        for (from, slopes) in slopes(script, extended, k)? {
            let by = moved[from];
            moved[own.clone()].iter_mut().zip(slopes).for_each(|(x, slope)| *x += by * slope);
        }
    }
    Ok(())
}

/// By entry of the parameters before it that the value of a parameter is made of: the derivatives of its entries.
fn slopes(
    script: &ResolvedScript,
    extended: &Extended<'_>,
    k: usize,
) -> Result<Vec<(usize, Vec<f64>)>, Box<Diagnostic>> {
    let param: &Param = &script.params[extended.live[k].declared];
    let directions: Vec<(FieldId, usize)> = (0..k).flat_map(|j| extended.directions_of(j)).collect();
    if directions.is_empty() {
        return Ok(Vec::new());
    }
    let (env, place) = (extended.env(), extended.positions());
    let slopes = compile_slopes(&env, &place, "a param", &param.value, &directions);
    let Some(slopes) = slopes.value else { return Err(no_derivative(&param.name.name, first(slopes.diagnostics))) };
    let mut out = Vec::new();
    for (entry, law) in slopes.into_iter().enumerate().filter_map(|(k, law)| Some((k, law?))) {
        let known = |slot: &InputSlot| extended.value_of(slot);
        out.push((entry, evaluated(law, known, &[[0.0; 3]], Window::default())?));
    }
    Ok(out)
}

/// What there is to know of the parameters: those that nothing reads, and those in conditions that follow nothing that is
/// solved for, where a branch may end elsewhere for another value.
pub(super) fn notes(script: &ResolvedScript, scene: &Scene, request: &Request, live: &[Live]) -> Vec<String> {
    let (mut read, mut decides) = (BTreeSet::new(), BTreeSet::new());
    let is_field = |word: &str| script.fields.iter().any(|f| f.name.name == split_prefixes(word).1);
    let mut look = |e: &Expr| {
        each_name(e, &mut |word| read.extend([word.to_owned()]));
        each_condition(e, &mut |condition| {
            let mut words = BTreeSet::new();
            cond_children(condition, &mut |side| each_name(side, &mut |word| words.extend([word.to_owned()])));
            if !words.iter().any(|word| is_field(word)) {
                decides.extend(words);
            }
        });
        read.clone()
    };
    let mut known = BTreeSet::new();
    for_each_formula(script, request, &mut |e| known = look(e));
    // a parameter that others are made of is read where one of them is
    for param in script.params.iter().rev().filter(|p| !is_auto(&p.value)) {
        if known.contains(&param.name.name) {
            known = look(&param.value);
        }
    }
    let note = |l: &Live| match (read.contains(&l.name), decides.contains(&l.name)) {
        (false, _) => {
            Some(format!("`{}` stands in no term, load, state, prescribed or first value, and in no result", l.name))
        }
        (true, true) => Some(format!(
            "`{}` decides on a branch: its derivative is that of the branches as they are, and does not know of points that \
             change theirs",
            l.name
        )),
        (true, false) => None,
    };
    let kept = |p: &Param| {
        let value = scene.params.iter().find(|(name, _)| *name == p.name.name).and_then(|p| p.1.values.first());
        let shown = value.map_or_else(String::new, |v| format!(" {v}"));
        format!("`{}` keeps the value{shown} that this run has found: what changes it is not followed", p.name.name)
    };
    let found = script.params.iter().filter(|p| is_auto(&p.value)).map(kept);
    live.iter().filter(|l| l.made_of.is_none()).filter_map(note).chain(found).collect()
}

/// Calls `f` for every expression that a solution or a result is made of.
fn for_each_formula<'s>(script: &'s ResolvedScript, request: &'s Request, f: &mut dyn FnMut(&'s Expr)) {
    each_moving_place(script, f);
    script.terms.iter().for_each(|t| f(&t.expr));
    script.loads.iter().chain(&script.fixes).for_each(|c| f(&c.value));
    let mut asked: BTreeSet<&str> = request.results.iter().map(|r| r.measure.as_str()).collect();
    for number in script.computed.iter().rev() {
        if asked.contains(number.name.name.as_str()) {
            f(&number.expr);
            each_name(&number.expr, &mut |word| asked.extend([word]));
            number.watched.iter().for_each(|m| f(&m.expr));
        }
    }
    let is_asked = |m: &&Measure| asked.contains(m.name.name.as_str());
    script.measures.iter().filter(is_asked).for_each(|m| f(&m.expr));
    for start in &script.starts {
        if let StartKind::Field { value, .. } | StartKind::Rate { value, .. } = &start.kind {
            f(value);
        }
    }
    for field in &script.fields {
        match &field.kind {
            FieldKind::State { update } => f(update),
            FieldKind::Data { value: DataValue::Formula(e) } => f(e),
            _ => {}
        }
    }
}

/// Calls `f` for every condition in an expression.
fn each_condition<'e>(e: &'e Expr, f: &mut dyn FnMut(&'e Cond)) {
    if let ExprKind::If(condition, ..) = &e.kind {
        f(condition);
    }
    children(e, &mut |part| each_condition(part, f));
}
