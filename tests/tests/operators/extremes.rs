//! Extreme magnitudes: powers of two must go through homogeneous operators without a rounding error, and functions of
//! one number have the values and slopes of their asymptotes.

use wfl_compiler::{InterpreterBackend, TermLaw, backend::KernelBackend, types::InputSlot};
use wfl_jit::JitBackend;

use super::point::{As, State, compile, run, scalar};

/// Expressions with f(s x) = s^degree f(x) in all fields together, and the largest power of two for s that they allow.
const HOMOGENEOUS: &[(&str, i32, i32)] = &[
    ("pos_part(p)+neg_part(q)+abs(p-q)", 1, 1000),
    ("max(p, q)+min(p, q)+max(u, w).Normalized(w)", 1, 1000),
    ("Norm(u)", 1, 1000),
    ("Norm(Grad_u)+Norm(u-w)", 1, 1000),
    ("Ball_projection(u, p).[1;2;3]", 1, 1000),
    ("Ball_projection(u, 0.4*pos_part(q)).[1;2;3]", 1, 1000),
    ("Ball_projection(Grad_u, abs(p)):B", 1, 1000),
    ("Von_Mises_projection(Grad_u, abs(p)):B", 1, 1000),
    ("Coulomb_friction_coupled_projection(u, Normal, w, p, [0.4], 1.5).[1;2;3]", 1, 1000),
    ("Coulomb_friction_coupled_projection(u, Normal, w, p-abs(q), [0.4;0.2*1e9], 1.5).[1;2;3]*0+p", 1, 1000),
    ("reg_pos_part(p, abs(q))", 1, 498),
    ("Normalized_reg(u, p).[1;2;3]", 0, 1000),
    ("Normalized(u).[1;2;3]", 0, 1000),
    ("Normalized(Grad_u):B", 0, 1000),
    ("Heaviside(p)*sign(q)+p/q", 0, 498),
    ("sqr(p)+Norm_sqr(u)+u.w+p*q", 2, 498),
    ("half_sqr_pos_part(p)+sqr_neg_part(q)+half_sqr_neg_part(p-q)", 2, 498),
    ("Det(Grad_u)", 3, 300),
    ("Matrix_i2(Grad_u)+Trace(Grad_u*Grad_u)", 2, 498),
    ("Inv(Grad_u):B", -1, 300),
    ("Cross_product(u, w).[1;2;3]", 2, 498),
];

/// Numbers between -1 and 1 with 20 bits, so that sums of them do not round differently.
fn random(state: &mut u64) -> f64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    (*state >> 44) as f64 / f64::from(1u32 << 19) - 1.0
}

/// All outputs of fluxes, then of entries.
fn outputs(law: &TermLaw, inputs: &[f64], backend: &dyn KernelBackend) -> (Vec<f64>, Vec<f64>) {
    let mut all = run(law, &law.tangent, inputs, backend);
    let n = law.tests.len();
    all.truncate(n + law.entries.len());
    let entries = all.split_off(n);
    (all, entries)
}

fn scaled(values: &[f64], power: i32) -> Vec<f64> {
    // in two steps, as 2^power may be no number
    let half = 2f64.powi(power / 2);
    let rest = 2f64.powi(power - power / 2);
    values.iter().map(|v| v * half * rest).collect()
}

#[test]
fn powers_of_two_go_through_without_rounding() {
    let jit = JitBackend::new().expect("machine code");
    let backends: [&dyn KernelBackend; 2] = [&InterpreterBackend, &jit];
    let mut seed = 0x1234_5678_9abc_def1;
    for (text, degree, most) in HOMOGENEOUS {
        let law = compile(&format!("({text})*Test_q"), 3, As::Term).unwrap_or_else(|d| panic!("{text}: {d:?}"));
        for backend in backends {
            for _ in 0..8 {
                let mut inputs = State::default().inputs(&law);
                let fields: Vec<bool> = law.inputs.iter().map(|s| matches!(s, InputSlot::Field(_))).collect();
                for (x, is_field) in inputs.iter_mut().zip(&fields) {
                    if *is_field {
                        *x = random(&mut seed);
                    }
                }
                let (fluxes, entries) = outputs(&law, &inputs, backend);
                assert!(fluxes.iter().chain(&entries).all(|x| x.is_finite()));
                for power in [-most, *most] {
                    let moved: Vec<f64> = inputs
                        .iter()
                        .zip(&fields)
                        .map(|(x, is_field)| if *is_field { scaled(&[*x], power)[0] } else { *x })
                        .collect();
                    let (f, e) = outputs(&law, &moved, backend);
                    assert_eq!(f, scaled(&fluxes, degree * power), "{text} at 2^{power} ({})", backend.name());
                    assert_eq!(
                        e,
                        scaled(&entries, (degree - 1) * power),
                        "slope of {text} at 2^{power} ({})",
                        backend.name()
                    );
                }
            }
        }
    }
}

const LN10: f64 = std::f64::consts::LN_10;
const LN2: f64 = std::f64::consts::LN_2;
const ROOT: f64 = std::f64::consts::FRAC_2_SQRT_PI;

#[test]
fn functions_of_one_number_at_extreme_arguments() {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
    // text, p, value, slope
    let table: &[(&str, f64, f64, f64)] = &[
        ("sqr(p)", 1e150, 1e300, 2e150),
        ("sqr(p)", 1e-150, 1e-300, 2e-150),
        ("sqrt(p)", 1e150, 1e75, 5e-76),
        ("sqrt(p)", 1e-150, 1e-75, 5e74),
        ("exp(-p)", 1e150, 0.0, 0.0),
        ("exp(p)", 1e-150, 1.0, 1.0),
        ("log(p)", 1e150, 150.0 * LN10, 1e-150),
        ("log(p)", 1e-150, -150.0 * LN10, 1e150),
        ("log10(p)", 1e150, 150.0, 1e-150 / LN10),
        ("sin(p)", 1e-150, 1e-150, 1.0),
        ("cos(p)", 1e-150, 1.0, -1e-150),
        ("tan(p)", 1e-150, 1e-150, 1.0),
        ("asin(p)", 1e-150, 1e-150, 1.0),
        ("acos(p)", 1e-150, FRAC_PI_2, -1.0),
        ("atan(p)", 1e-150, 1e-150, 1.0),
        ("atan(p)", 1e150, FRAC_PI_2, 1e-300),
        ("atan(p)", -1e200, -FRAC_PI_2, 0.0),
        ("sinh(p)", 1e-150, 1e-150, 1.0),
        ("cosh(p)", 1e-150, 1.0, 1e-150),
        ("tanh(p)", 1e-150, 1e-150, 1.0),
        ("tanh(p)", 1e150, 1.0, 0.0),
        ("tanh(p)", -1e150, -1.0, 0.0),
        ("asinh(p)", 1e-150, 1e-150, 1.0),
        ("asinh(p)", 1e150, LN2 + 150.0 * LN10, 1e-150),
        ("acosh(p)", 1e150, LN2 + 150.0 * LN10, 1e-150),
        ("atanh(p)", 1e-150, 1e-150, 1.0),
        ("erf(p)", 1e-150, ROOT * 1e-150, ROOT),
        ("erf(p)", 1e150, 1.0, 0.0),
        ("erfc(p)", 1e150, 0.0, 0.0),
        ("erfc(p)", -1e150, 2.0, 0.0),
        ("sinc(p)", 1e-150, 1.0, -1e-150 / 3.0),
        ("pow(p, -1)", 1e150, 1e-150, -1e-300),
        ("pow(p, 1.5)", 1e150, 1e225, 1.5e75),
        ("pow(p, 1.5)", 1e-150, 1e-225, 1.5e-75),
        ("p^2", 1e-150, 1e-300, 2e-150),
        ("atan2(p, 1e150)", 1e150, FRAC_PI_4, 5e-151),
        ("atan2(p, 1e-150)", 1e-150, FRAC_PI_4, 5e149),
        ("reg_pos_part(p, 1)", 1e150, 1e150, 1.0),
        ("reg_pos_part(p, 1)", 1e-150, 0.5e-300, 1e-150),
    ];
    let jit = JitBackend::new().expect("machine code");
    let close = |found: f64, right: f64| (found - right).abs() <= 8.0 * f64::EPSILON * right.abs();
    for (text, p, value, slope) in table {
        for backend in [&InterpreterBackend as &dyn KernelBackend, &jit] {
            let found = scalar(text, "p", &State::default().value("p", &[*p]), backend);
            assert!(
                close(found.0, *value) && close(found.1, *slope),
                "{text} at {p:e}: {found:?}, not ({value:e}, {slope:e})"
            );
        }
    }
}

/// sin(t)/t far out: below 1/t, its slope too.
#[test]
fn sinc_far_out_is_bounded() {
    for p in [1e8, 1e150, 1e300] {
        let (value, slope) = scalar("sinc(p)", "p", &State::default().value("p", &[p]), &InterpreterBackend);
        assert!(value.abs() <= 1.0001 / p && slope.abs() <= 1.0001 / p, "sinc({p:e}) = {value:e}, slope {slope:e}");
    }
}
