//! Derivatives of arguments against differences in double-double arithmetic, and the parameters that scale them.

use std::collections::BTreeMap;

use wfl::{SourceMap, ast::Expansions, parse_expr};

use super::{FrozenLaw, ProjectionKind, ScaledPart, compile_frozen, scaling_parameters};
use crate::{
    build::{Constant, Env},
    dd::Dd,
    interp::interpret,
    law::{TermLaw, ValueLaw},
    real::Real,
    symmetry::unit_normals,
    term::{TermSource, compile_term},
    test_law::{self, field},
    types::{FieldId, FieldKind, FieldOp, FieldSig, InputSlot, PlaceKind, PlaceSig, Shape},
};

const JUMP: &str = "(u - Interpolate(w, neighbor_element))";
/// Penalty with Coulomb friction between `u` here and `w` there.
const PENALTY: &str = "(pos_part(k*(J.Normal - g))*Normal
    + Ball_projection(k*(J - (J.Normal)*Normal), mu*pos_part(k*(J.Normal - g)))).Test_u";
/// Nitsche's method, stress of `u` alone.
const NITSCHE: &str = "1/k*(pos_part(k*(J.Normal - g) - S.Normal)*Normal
    + Ball_projection(k*(J - (J.Normal)*Normal) - (S - (S.Normal)*Normal), mu*pos_part(k*(J.Normal - g) - S.Normal)))
    .(k*Test_u - theta*2*E*Sym(Grad_Test_u)*Normal)";
/// A multiplier `l`.
const AUGMENTED: &str = "(pos_part(k*(J.Normal - g) - l.Normal)*Normal).Test_u - 1/k*l.Test_l";
/// An argument that is not linear in the displacement.
const CURVED: &str = "pos_part(k*Norm_sqr(u + [1,2]) - exp(0.1*E*Det(Id(2) + Grad_u)))*Test_u(1)";

/// Expressions as they stand in the tests: J is the jump, S the traction of `u`.
fn written(text: &str) -> String {
    text.replace('J', JUMP).replace('S', "(2*E*Sym(Grad_u)*Normal)").replace("(2*E*Sym(Grad_u)*Normal)ym", "Sym")
}

fn fields() -> Vec<FieldSig> {
    vec![
        field("u", Shape::vector(2), FieldKind::Unknown),
        field("w", Shape::vector(2), FieldKind::Unknown),
        field("l", Shape::vector(2), FieldKind::Multiplier),
        field("g", Shape::SCALAR, FieldKind::Data),
    ]
}

fn place() -> PlaceSig {
    PlaceSig {
        here: vec![true, false, true, true],
        there: vec![false, true, false, false],
        ..test_law::place(PlaceKind::Interface, 4)
    }
}

/// Compiles the frozen form of a term and hands it over with all that it was made of.
fn with_frozen<R>(text: &str, numbers: &[(&str, f64)], f: impl FnOnce(&Env<'_>, TermSource<'_>, &FrozenLaw) -> R) -> R {
    maybe_frozen(text, numbers, |env, source, frozen| f(env, source, &frozen.unwrap()))
}

/// The same of a term that may have no such form.
fn maybe_frozen<R>(
    text: &str,
    numbers: &[(&str, f64)],
    f: impl FnOnce(&Env<'_>, TermSource<'_>, Option<FrozenLaw>) -> R,
) -> R {
    let constant = |x: f64| Constant { shape: Shape::SCALAR, values: vec![x], declared: None };
    let params: BTreeMap<String, Constant> = numbers.iter().map(|(n, x)| ((*n).to_owned(), constant(*x))).collect();
    let (fields, expansions) = (fields(), Expansions::default());
    let env = Env {
        dim: 2,
        fields: &fields,
        mappings: &[],
        params: &params,
        expansions: &expansions,
        step_variable: Some("t"),
        rates: &[],
        tables: &[],
        equal_within: 0.0,
    };
    let mut sources = SourceMap::new();
    let text = written(text);
    let id = sources.add("law", text.as_str());
    let expr = parse_expr(&sources, id).value.unwrap();
    let source = TermSource::Residual(&expr);
    let law = compile_term(&env, &place(), "law", source);
    let law = law.value.unwrap_or_else(|| panic!("{:?}", law.diagnostics));
    let frozen = compile_frozen(&env, &place(), "law", &law.listing, FieldId::new(fields.len()));
    f(&env, source, frozen)
}

const NUMBERS: [(&str, f64); 4] = [("k", 3.7), ("mu", 0.4), ("theta", -1.0), ("E", 2.3)];

fn outputs(law: &ValueLaw, inputs: &[Dd]) -> Vec<Dd> {
    let step = vec![Dd::from_f64(1.0); law.prologue.slots.len()];
    let mut uniforms = vec![Dd::from_f64(0.0); law.prologue.kernel.kernel().outputs.len()];
    interpret(&law.prologue.kernel, &step, &[], &mut Vec::new(), &mut uniforms);
    let mut out = vec![Dd::from_f64(0.0); law.kernel.kernel().outputs.len()];
    interpret(&law.kernel, &uniforms, inputs, &mut Vec::new(), &mut out);
    out
}

/// Inputs of a law at the n-th of some states, normals of length 1.
fn state(law: &ValueLaw, n: usize) -> Vec<Dd> {
    let wave = |k: usize| (1.7 * k as f64 + 0.9 * n as f64 + 0.3).sin();
    let mut inputs: Vec<f64> = (0..law.inputs.len()).map(wave).collect();
    unit_normals(&law.inputs, &mut inputs);
    inputs.into_iter().map(Dd::from_f64).collect()
}

#[test]
fn slopes_are_the_derivatives_of_the_arguments_with_respect_to_all_that_moves() {
    let step = Dd::from_f64(1e-10);
    for text in [PENALTY, NITSCHE, AUGMENTED, CURVED] {
        with_frozen(text, &NUMBERS, |_, _, frozen| {
            let slopes = frozen.slopes().unwrap();
            assert_eq!(slopes.law.inputs, frozen.watch.inputs);
            assert!(slopes.slopes.is_sorted());
            for n in 0..6 {
                let base = state(&frozen.watch, n);
                let given = outputs(&slopes.law, &base);
                for (at, slot) in frozen.watch.inputs.iter().enumerate() {
                    let InputSlot::Field(slot) = slot else { continue };
                    if !fields().get(slot.field.index()).is_some_and(FieldSig::is_unknown) {
                        continue;
                    }
                    let moved = |by: Dd| {
                        let mut inputs = base.clone();
                        inputs[at] = inputs[at].add(by);
                        outputs(&frozen.watch, &inputs)
                    };
                    let (ahead, behind) = (moved(step), moved(step.neg()));
                    for (k, p) in frozen.projections.iter().enumerate() {
                        for entry in 0..p.n {
                            let o = p.output + entry;
                            let difference = ahead[o].sub(behind[o]).div(step.add(step));
                            let listed = slopes.of_projection(k).find(|(_, s)| s.entry == entry && s.slot == *slot);
                            let slope = listed.map_or(Dd::from_f64(0.0), |(at, _)| given[at]);
                            let error = slope.sub(difference).to_f64().abs();
                            assert!(error < 1e-18 * slope.to_f64().abs().max(1.0), "{text}: {slot:?} {error}");
                        }
                    }
                }
            }
        });
    }
}

#[test]
fn slopes_of_nitsche_are_gaps_and_stresses() {
    with_frozen(NITSCHE, &NUMBERS, |_, _, frozen| {
        let half = frozen.projections.iter().position(|p| p.kind == ProjectionKind::HalfLine).unwrap();
        let slopes = frozen.slopes().unwrap();
        let slots: Vec<(usize, FieldOp)> =
            slopes.of_projection(half).map(|(_, s)| (s.slot.field.index(), s.slot.op)).collect();
        let (value, gradient) = (FieldOp::Value, FieldOp::Grad);
        assert_eq!(slots, [vec![(0, value); 2], vec![(0, gradient); 4], vec![(1, value); 2]].concat());
    });
}

/// Parameters that scale the arguments of half-lines and balls.
fn scaled(text: &str, numbers: &[(&str, f64)]) -> Vec<(String, ProjectionKind, ScaledPart)> {
    with_frozen(text, numbers, |env, source, frozen| {
        let found = scaling_parameters(env, &place(), source, frozen);
        found.into_iter().map(|s| (s.parameter, frozen.projections[s.projection].kind, s.part)).collect()
    })
}

#[test]
fn the_parameter_of_a_method_is_found_whatever_its_name() {
    use ProjectionKind::{Ball, HalfLine};
    use ScaledPart::{Argument, Displacement};
    let both = |part| vec![("k".to_owned(), HalfLine, part), ("k".to_owned(), Ball, part)];
    assert_eq!(scaled(PENALTY, &NUMBERS), both(Displacement));
    assert_eq!(scaled(NITSCHE, &NUMBERS), both(Displacement));
    assert_eq!(scaled(AUGMENTED, &NUMBERS), both(Displacement)[..1]);
    assert_eq!(scaled(CURVED, &NUMBERS), both(Displacement)[..1]);
    let scaled_stress = "pos_part(E*k*J.Normal - E*S.Normal/E)*Test_u(1)";
    let expected = [("E", HalfLine, Argument), ("k", HalfLine, Displacement)];
    assert_eq!(scaled(scaled_stress, &NUMBERS), expected.map(|(n, k, p)| (n.to_owned(), k, p)));
}

#[test]
fn a_parameter_that_is_not_a_factor_scales_nothing() {
    for argument in ["u(1)/k", "k^2*u(1)", "(1 + k)*u(1)", "k*u(1) + w1", "u(1) + k", "abs(k - 1)*u(1)"] {
        let argument = argument.replace("w1", "Interpolate(w, neighbor_element)(1)");
        assert_eq!(scaled(&format!("pos_part({argument})*Test_u(1)"), &NUMBERS), [], "{argument}");
    }
    for argument in ["k*u(1) + k*Interpolate(w, neighbor_element)(1)", "sqrt(k)*u(1)*sqrt(k)", "k*(1 + u(1)^2)*u(1)"] {
        assert_eq!(scaled(&format!("pos_part({argument})*Test_u(1)"), &NUMBERS).len(), 1, "{argument}");
    }
}

#[test]
fn a_parameter_of_value_zero_or_one_is_seen_all_the_same() {
    assert_eq!(scaled("pos_part(k*u(1) - S.Normal)*Test_u(1)", &[("k", 1.0), ("E", 1.0)]).len(), 1);
    // the term as compiled has no displacement in its argument
    assert_eq!(scaled("pos_part(k*u(1) - S.Normal)*Test_u(1)", &[("k", 0.0), ("E", 1.0)]).len(), 1);
}

#[test]
fn a_positive_part_is_one_in_all_words() {
    for law in [
        "max(0, k*u(1))",
        "max(k*u(1), 0)",
        "(if u(1) > 0 then k*u(1) else 0)",
        "(if 0 <= u(1) then u(1)*k else 0)",
        "(if u(1) <= 0 then 0 else k*u(1))",
        "-min(0, -k*u(1))",
        "-min(-k*u(1), 0)",
        "(if u(1) < 0 then -k*u(1) else 0)",
        "min(0, k*u(1))",
        "(if u(1) > 0 then -k*u(1)/E else 0)",
    ] {
        with_frozen(&format!("{law}*Test_u(1)"), &NUMBERS, |env, source, frozen| {
            let kinds: Vec<ProjectionKind> = frozen.projections.iter().map(|p| p.kind).collect();
            assert_eq!(kinds, [ProjectionKind::HalfLine], "{law}");
            let written = compile_term(env, &place(), "law", source).value.expect("a law");
            let branches = env.fields.len();
            for u in [-0.7, 0.4] {
                let on = |mask: f64| {
                    residual(&frozen.law, &|slot| match slot {
                        InputSlot::Field(b) if b.field.index() == branches => mask,
                        // no regularisation
                        InputSlot::Field(b) if b.field.index() > branches => 0.0,
                        _ => u,
                    })
                };
                let [is, open, closed] = [residual(&written, &|_| u), on(0.0), on(1.0)];
                assert_eq!(open, 0.0, "{law}");
                assert!(closed != 0.0 && (is == closed || is == open), "{law} at {u}: {is}, {closed}");
            }
            assert!([-0.7, 0.4].iter().any(|u| residual(&written, &|_| *u) != 0.0), "{law}");
        });
    }
}

/// The first residual of a law, every input of which `value` gives.
fn residual(law: &TermLaw, value: &dyn Fn(&InputSlot) -> f64) -> f64 {
    let step = vec![1.0; law.prologue.slots.len()];
    let mut uniforms = vec![0.0; law.prologue.kernel.kernel().outputs.len()];
    interpret(&law.prologue.kernel, &step, &[], &mut Vec::new(), &mut uniforms);
    let inputs: Vec<f64> = law.inputs.iter().map(value).collect();
    let mut out = vec![0.0; law.residual.kernel().outputs.len()];
    interpret(&law.residual, &uniforms, &inputs, &mut Vec::new(), &mut out);
    out[0]
}

/// Equal entries across the diagonal, but for a branch that begins at a large value.
#[test]
fn a_branch_far_away_is_one_of_the_tangent() {
    let is_symmetric = |text: &str| {
        with_frozen(text, &NUMBERS, |env, source, _| {
            compile_term(env, &place(), "law", source).value.expect("a law").symmetric
        })
    };
    let coupled = "k*(u(1)*Test_l(1) + l(1)*Test_u(1)) + pos_part(l(1) - 1e6)";
    assert!(is_symmetric(&format!("{coupled}*Test_l(1)")));
    assert!(!is_symmetric(&format!("{coupled}*Test_u(1)")));
}

#[test]
fn a_projection_inside_a_function_that_is_not_defined_beside_it_stays_as_written() {
    let numbers = [("k", 3.0), ("mu", 0.4)];
    for law in ["P^1.5", "sqrt(P)", "log(1 + P)", "P/(1 + P)", "exp(-P)", "P^2", "P*P^0.5", "tanh(P)"] {
        let text = format!("k*({})*Test_u(1)", law.replace('P', "pos_part(J.Normal - g)"));
        assert!(kinds(&text, &numbers).is_empty(), "{text}");
        // as a bound of friction it leaves the ball, and where it stands alone elsewhere the half-line
        let text = format!("Ball_projection(k*J, mu*({})).Test_u", law.replace('P', "pos_part(J.Normal - g)"));
        assert_eq!(kinds(&text, &numbers), [ProjectionKind::Ball], "{text}");
        let text = format!("{text} + pos_part(J.Normal - g)*Test_u(1)");
        assert_eq!(kinds(&text, &numbers), [ProjectionKind::HalfLine, ProjectionKind::Ball], "{text}");
    }
    // a ball that is scaled by its bound is no power of it
    let text = "(P*Ball_projection(k*J/(P + 1e-9), 1)).Test_u".replace('P', "pos_part(J.Normal - g)");
    assert_eq!(kinds(&text, &numbers), [ProjectionKind::HalfLine, ProjectionKind::Ball], "{text}");
}

/// The projections of the frozen form of a term; none where it has no such form.
fn kinds(text: &str, numbers: &[(&str, f64)]) -> Vec<ProjectionKind> {
    maybe_frozen(text, numbers, |_, _, frozen| {
        frozen.map_or_else(Vec::new, |f| f.projections.iter().map(|p| p.kind).collect())
    })
}

/// An aperture in the equations of a field that it does not read acts in none of its words, beside a half line that presses.
#[test]
fn an_aperture_beside_a_pressure_does_not_act() {
    let press = "pos_part(k*(u.Normal - g))*(Test_u.Normal)";
    let flow =
        "(1 + pos_part(g - u.Normal))*Interpolate(w, neighbor_element)(1)*Interpolate(Test_w, neighbor_element)(1)";
    let bond = "pos_part(g - u.Normal)*(Test_u.Normal)";
    let acts =
        |text: &str| with_frozen(text, &NUMBERS, |_, _, frozen| frozen.projections.iter().filter(|p| p.acts).count());
    assert_eq!(acts(&format!("{press} + {flow}")), 1);
    assert_eq!(acts(&format!("{flow} + {press}")), 1);
    assert_eq!(acts(&format!("{press} - {bond}")), 2);
    // alone it is all that there is
    assert_eq!(acts(flow), 1);
}
