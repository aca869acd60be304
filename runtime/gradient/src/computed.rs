//! Numbers that measures make: by the chain rule they follow their measures, and the parameters in their arithmetic.
//!
//! To the compiler each name in the arithmetic is a field of one number, so that it gives the slope in each of them; where a
//! step ends slopes are taken at the numbers of that step. A reduction in the arithmetic is a measure that only it reads.

use std::collections::{BTreeMap, BTreeSet};

use wfl::{Diagnostic, ResolvedScript, Span, ast::Expr, each_word};
use wfl_compiler::{
    InterpreterBackend, compile_slopes, compile_value_kink_sides,
    types::{FieldId, FieldKind, FieldSig, InputSlot, Shape},
};
use wfl_discrete::{value::Value, window::Window};

use super::{
    extended::Extended,
    near::{NEAR, NearKink},
    refused::{first, flat, no_derivative, not_made, of_balance},
};

/// What a number follows at the end of a step.
#[derive(Clone, Debug, Default)]
pub(super) struct Followed {
    /// By measure, as [`Extended::measures`] counts them.
    pub(super) measures: BTreeMap<usize, f64>,
    /// By entry of the parameters that change.
    pub(super) live: Vec<f64>,
}

/// A number that measures make, with those that stand in it.
pub(super) struct Arithmetic {
    /// Each behind those that it reads; the number itself is the last one.
    numbers: Vec<Number>,
}

/// The slopes of one number.
struct Number {
    name: String,
    span: Span,
    /// The names that it reads.
    inputs: Vec<String>,
    /// The field of the first of them.
    first: usize,
    /// By name, then by entry of the parameters that change; `None` where it follows nothing of them.
    slopes: Vec<Option<Value>>,
    /// Both sides of each comparison.
    sides: Option<Value>,
}

impl Arithmetic {
    /// Of a number by its name; `None` for what is no such number.
    pub(super) fn new(
        extended: &Extended<'_>,
        script: &ResolvedScript,
        name: &str,
    ) -> Result<Option<Self>, Box<Diagnostic>> {
        let Some(last) = script.computed.iter().position(|c| c.name.name == name) else { return Ok(None) };
        let mut wanted = BTreeSet::from([name]);
        let mut numbers = Vec::new();
        // a number reads those before it
        for of in script.computed[..=last].iter().rev() {
            if wanted.contains(of.name.name.as_str()) {
                each_word(&of.expr, &mut |_, word| wanted.extend([word]));
                numbers.push(Number::new(extended, script, (&of.name.name, &of.expr, of.span))?);
            }
        }
        numbers.reverse();
        let made = Self { numbers };
        let follows = |n: &Number| n.slopes[..n.inputs.len()].iter().any(Option::is_some);
        if !made.numbers.last().is_some_and(follows) {
            return Err(flat(name, script.computed[last].expr.span));
        }
        Ok(Some(made))
    }

    /// The measures that nothing but the numbers reads, as [`Extended::measures`] counts them.
    pub(super) fn own_measures(&self, extended: &Extended<'_>) -> Vec<usize> {
        let is_own = |k: &usize| {
            let name = &extended.measures[*k].0.name;
            extended.scene.measures.iter().all(|m| m.name != *name)
        };
        let names = self.numbers.iter().flat_map(|number| &number.inputs);
        let mut own: Vec<usize> = names.filter_map(|name| extended.measure(name)).filter(is_own).collect();
        own.sort_unstable();
        own.dedup();
        own
    }

    /// What the number follows where a step ends with these values by name; and numbers between two branches.
    pub(super) fn followed(
        &self,
        extended: &Extended<'_>,
        values: &[(String, f64)],
        step: Window,
    ) -> Result<(Followed, Vec<NearKink>), Box<Diagnostic>> {
        let (mut near, mut known): (_, BTreeMap<&str, Followed>) = (Vec::new(), BTreeMap::new());
        let mut last = Followed::default();
        for number in &self.numbers {
            near.extend(number.near(extended, values, step));
            let slopes = number.at(extended, values, step)?;
            let (of_names, of_live) = slopes.split_at(number.inputs.len());
            let mut made = Followed { measures: BTreeMap::new(), live: of_live.to_vec() };
            for (name, slope) in number.inputs.iter().zip(of_names).filter(|(_, slope)| **slope != 0.0) {
                match (known.get(name.as_str()), extended.measure(name)) {
                    (Some(behind), _) => {
                        behind.measures.iter().for_each(|(k, s)| *made.measures.entry(*k).or_default() += slope * s);
                        made.live.iter_mut().zip(&behind.live).for_each(|(x, s)| *x += slope * s);
                    }
                    (None, Some(k)) => *made.measures.entry(k).or_default() += slope,
                    (None, None) => {}
                }
            }
            known.insert(&number.name, made.clone());
            last = made;
        }
        Ok((last, near))
    }
}

impl Number {
    fn new(extended: &Extended<'_>, script: &ResolvedScript, of: (&str, &Expr, Span)) -> Result<Self, Box<Diagnostic>> {
        let (name, e, span) = of;
        let is_computed = |word: &str| script.computed.iter().any(|c| c.name.name == word);
        let energies = script.energies();
        let mut inputs: Vec<String> = Vec::new();
        let mut refused = None;
        each_word(e, &mut |at, word| {
            if (extended.measure(word).is_some() || is_computed(word)) && !inputs.iter().any(|known| known == word) {
                inputs.push(word.to_owned());
            }
            if energies.iter().any(|energy| energy == word) {
                refused.get_or_insert((word.to_owned(), at.span));
            }
        });
        if let Some((word, at)) = refused {
            return Err(of_balance(&word, at));
        }
        let (mut sigs, mut place) = (extended.sigs.clone(), extended.positions());
        let first_field = sigs.len();
        for input in &inputs {
            // what is found by the solver has kinks to tell of
            let (name, kind) = (input.clone(), FieldKind::Unknown);
            sigs.push(FieldSig { name, shape: Shape::SCALAR, degree: 0, kind, global: true, on_faces: false });
            place.here.push(true);
            place.there.push(false);
        }
        let env = extended.env_of(&sigs);
        let names = (0..inputs.len()).map(|k| (FieldId::new(first_field + k), 0));
        let directions: Vec<(FieldId, usize)> = names.chain(extended.directions()).collect();
        let made = compile_slopes(&env, &place, name, e, &directions);
        let Some(laws) = made.value else { return Err(no_derivative(name, first(made.diagnostics))) };
        let callable = |law| Value::new(law, &InterpreterBackend).map_err(|e| not_made(&e.to_string()));
        let slopes = laws.into_iter().map(|law| law.map(callable).transpose()).collect::<Result<_, _>>()?;
        let sides =
            compile_value_kink_sides(&env, &place, name, e, None).map(|sides| callable(sides.law)).transpose()?;
        Ok(Self { name: name.to_owned(), span, inputs, first: first_field, slopes, sides })
    }

    /// What a law reads, with these values by name.
    fn read(&self, extended: &Extended<'_>, values: &[(String, f64)], slot: &InputSlot) -> f64 {
        let InputSlot::Field(of) = slot else { return 0.0 };
        match of.field.index().checked_sub(self.first).and_then(|k| self.inputs.get(k)) {
            Some(name) => values.iter().find(|(known, _)| known == name).map_or(f64::NAN, |(_, value)| *value),
            None => extended.value_of(slot),
        }
    }

    /// The slopes, zero where there are none.
    fn at(&self, extended: &Extended<'_>, values: &[(String, f64)], step: Window) -> Result<Vec<f64>, Box<Diagnostic>> {
        let known = |slot: &InputSlot| self.read(extended, values, slot);
        let of = |slope: &Option<Value>| {
            let Some(slope) = slope else { return Ok(0.0) };
            let found = slope.at_step(step).at_positions_with(&[[0.0; 3]], &known);
            let bad = |value| not_made(&format!("a slope of `{}` is {value} at t = {}", self.name, step.stage));
            found.map_err(|e| bad(e.value)).map(|v| v[0])
        };
        self.slopes.iter().map(of).collect()
    }

    /// The number, if it is between two branches.
    fn near(&self, extended: &Extended<'_>, values: &[(String, f64)], step: Window) -> Option<NearKink> {
        let known = |slot: &InputSlot| self.read(extended, values, slot);
        let sides = self.sides.as_ref()?.at_step(step).at_positions_with(&[[0.0; 3]], &known).ok()?;
        let is_near = |kink: &[f64]| (kink[0] - kink[1]).abs() <= NEAR * kink[2];
        sides.chunks_exact(3).any(is_near).then(|| NearKink {
            place: self.name.clone(),
            span: Some(self.span),
            kind: "is between two branches",
            time: step.stage,
            points: 0,
            of: 0,
            more: 0,
        })
    }
}
