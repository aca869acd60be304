//! Derivatives in rates against differences in double-double arithmetic, and what they leave out.

use std::collections::BTreeMap;

use wfl::{SourceMap, ast::Expansions, parse_expr};

use super::*;
use crate::{
    build::Env,
    dd::Dd,
    interp::interpret,
    ir::VerifiedKernel,
    law::{Class, Prologue, run_prologue},
    real::Real,
    term::{TermSource, compile_term},
    test_law::{field, place},
    types::{BasisSlot, FieldKind, InputSlot, PlaceKind, RateForm, Shape, UniformSlot},
};

/// Terms with rates of the vectors `u` and `w`, on faces between two bodies.
const TERMS: [&str; 8] = [
    "3*Dot2_u.Test_u",
    "3*Dot2_u.Test_u + 1e12*u.Test_u + 7*Dot_u.Test_u",
    "(2 + u.u)*Dot2_u.Test_w + exp(w.u)*Dot2_w.Test_u + 0.1*Grad_u:Grad_Test_u",
    "0.3*Norm(Dot_u)*(Dot_u.Test_u) + 5*(Grad_Dot_u:Grad_Test_u) + (Dot_u.Dot2_w)*(Dot2_w.Test_w)",
    "(Ball_projection(9*Dot_u, 0.3*pos_part(u.Normal))).Test_u",
    "pos_part(4*(u.Normal) + 2*(Dot_u.Normal) - 0.1*(Dot2_u.Normal))*(Test_u.Normal)",
    "2*(Dot2_u - Dot2_w).(Test_u - Test_w)",
    "g*(Dot2_u.Test_u) + g*(Previous_u.Dot_u)*(Dot_u.Test_u)",
];

/// The law of a term.
fn law(text: &str) -> TermLaw {
    let (plane, unknown) = (Shape::vector(2), FieldKind::Unknown);
    let fields = [field("u", plane, unknown), field("w", plane, unknown), field("g", Shape::SCALAR, FieldKind::Data)];
    let place = place(PlaceKind::Facets, fields.len());
    let env = Env {
        dim: 2,
        fields: &fields,
        mappings: &[],
        params: &BTreeMap::new(),
        expansions: &Expansions::default(),
        step_variable: Some("s"),
        rates: &[RateForm::Second, RateForm::Second, RateForm::Difference],
        tables: &[],
        equal_within: 0.0,
    };
    let mut sources = SourceMap::new();
    let id = sources.add("law", text);
    let expr = parse_expr(&sources, id).value.unwrap();
    let compiled = compile_term(&env, &place, "law", TermSource::Residual(&expr));
    compiled.value.unwrap_or_else(|| panic!("{text}: {:?}", compiled.diagnostics))
}

fn uniforms(prologue: &Prologue) -> Vec<f64> {
    let value = |slot: &UniformSlot| if matches!(slot, UniformSlot::Rate(_)) { 3e7 } else { 0.25 };
    run_prologue(prologue, &prologue.slots.iter().map(value).collect::<Vec<_>>())
}

fn outputs<T: Real>(kernel: &VerifiedKernel, prologue: &Prologue, inputs: &[T]) -> Vec<T> {
    let uniforms: Vec<T> = uniforms(prologue).iter().map(|u| T::from_f64(*u)).collect();
    let mut out = vec![T::from_f64(0.0); kernel.kernel().outputs.len()];
    interpret(kernel, &uniforms, inputs, &mut Vec::new(), &mut out);
    out
}

/// A number for what is read: none alike. The change over the step is so small that its rates are no larger than others.
fn value(slot: &InputSlot) -> f64 {
    let number = |b: &BasisSlot| 0.4 + 0.37 * f64::from(b.entry) + 0.21 * f64::from(u8::from(b.field.index() == 1));
    match slot {
        InputSlot::Field(b) => number(b) + 1e-8 * (1.0 + f64::from(b.entry)),
        InputSlot::Previous(b) => number(b),
        InputSlot::History(order, b) => number(b) - if *order == RateOrder::First { 0.9 } else { 1.7 },
        InputSlot::Normal(_, k) => [0.6, 0.8][usize::from(*k)],
        _ => 0.5,
    }
}

/// The derivative of the fluxes of a law in what the past gives of a rate, by a difference of fourth order.
fn difference(law: &TermLaw, order: RateOrder, trial: BasisSlot) -> Vec<(BasisSlot, f64)> {
    const STEP: f64 = 1e-4;
    let at = |steps: f64| {
        let moved = |slot: &InputSlot| *slot == InputSlot::History(order, trial);
        let input = |slot: &InputSlot| {
            let step = if moved(slot) { steps * STEP } else { 0.0 };
            Dd::from_f64(value(slot)) + Dd::from_f64(step)
        };
        outputs::<Dd>(&law.residual, &law.prologue, &law.inputs.iter().map(input).collect::<Vec<_>>())
    };
    let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(at);
    let slope = |k: usize| {
        let (near, far) = (c[k] - b[k], d[k] - a[k]);
        (Dd::from_f64(8.0) * near - far) / Dd::from_f64(12.0 * STEP)
    };
    law.tests.iter().enumerate().map(|(k, test)| (*test, slope(k).to_f64())).collect()
}

#[test]
fn derivatives_in_rates_are_those_of_the_residual() {
    let mut found = 0;
    for (text, order) in TERMS.iter().flat_map(|text| [(text, RateOrder::First), (text, RateOrder::Second)]) {
        let law = law(text);
        let made = compile_rates(&law, order);
        let entry = |test: BasisSlot, trial: BasisSlot| {
            let of = &made.as_ref()?.law;
            let inputs: Vec<f64> = of.inputs.iter().map(value).collect();
            let out = outputs::<f64>(&of.tangent, &of.prologue, &inputs);
            let place = |list: &[BasisSlot], slot| list.iter().position(|s| *s == slot);
            let pair = (place(&of.tests, test)?, place(&of.trials, trial)?);
            let same = |e: &(u16, u16)| (usize::from(e.0), usize::from(e.1)) == pair;
            Some(out[of.tests.len() + of.entries.iter().position(same)?])
        };
        let trials = law.inputs.iter().filter_map(|slot| match slot {
            InputSlot::History(o, b) if *o == order => Some(*b),
            _ => None,
        });
        let all: Vec<(BasisSlot, BasisSlot, f64)> = trials
            .flat_map(|trial| difference(&law, order, trial).into_iter().map(move |(test, x)| (test, trial, x)))
            .collect();
        let largest = all.iter().fold(0.0f64, |m, (.., x)| m.max(x.abs()));
        assert_eq!(made.is_some(), largest > 0.0, "{text} {order:?}");
        for (test, trial, exact) in all {
            let made = entry(test, trial).unwrap_or(0.0);
            assert!((made - exact).abs() <= 1e-13 * largest, "{text} {order:?} {test:?} {trial:?}: {made} {exact}");
            found += usize::from(exact != 0.0);
        }
    }
    assert!(found > 40, "{found} entries");
}

#[test]
fn products_are_those_of_the_derivative_with_rates_of_their_own() {
    for (text, order) in TERMS.iter().flat_map(|text| [(text, RateOrder::First), (text, RateOrder::Second)]) {
        let Some(RateLaw { law, n_fields }) = compile_rates(&law(text), order) else { continue };
        let inputs: Vec<f64> = law.inputs.iter().map(value).collect();
        let product = outputs::<f64>(&law.residual, &law.prologue, &inputs);
        let tangent = outputs::<f64>(&law.tangent, &law.prologue, &inputs);
        let rate = |trial: BasisSlot| {
            let own = BasisSlot { field: FieldId::new(trial.field.index() + n_fields), ..trial };
            law.inputs.iter().position(|s| *s == InputSlot::Field(own)).map_or(0.0, |k| inputs[k])
        };
        let mut sums = vec![0.0; law.tests.len()];
        for (k, (test, trial)) in law.entries.iter().enumerate() {
            sums[usize::from(*test)] += tangent[law.tests.len() + k] * rate(law.trials[usize::from(*trial)]);
        }
        for (sum, product) in sums.iter().zip(&product) {
            assert!((sum - product).abs() <= 1e-13 * sum.abs(), "{text} {order:?}: {sum} {product}");
        }
    }
}

#[test]
fn nothing_of_the_stiffness_and_of_the_scheme_is_in_a_mass() {
    let of = |text: &str| compile_rates(&law(text), RateOrder::Second).expect("a mass").law;
    let mass = of("3*Dot2_u.Test_u + 1e20*u.Test_u + 7*Dot_u.Test_u");
    assert_eq!(
        (mass.class, mass.symmetric, mass.tangent_has_uniforms, mass.kinks.len()),
        (Class::Linear, true, false, 0)
    );
    assert_eq!(mass.tangent.kernel().insts.len(), of("3*Dot2_u.Test_u").tangent.kernel().insts.len());
    assert!(compile_rates(&law("u.Test_u"), RateOrder::Second).is_none());
}
