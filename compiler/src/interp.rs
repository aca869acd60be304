//! The reference interpreter: what a kernel means, over any [`Real`].
//!
//! Promises: over f64 the same bits as the machine code; instruction by instruction in the order of the kernel, so
//! that a non-finite value can be traced to the instruction that made it and from there to the scene.
//! It checks nothing that `verify.rs` has checked, and it does not skip the untaken operand of a `select`.

use crate::{
    backend::{BackendError, KernelBackend, PointKernel},
    ir::{Inst, Kernel, LANES, Origin, Val, VerifiedKernel},
    lookup::{CurveRef, read},
    math::MatrixFn,
    matrix_fn::MAX_RESULTS,
    real::Real,
};

/// Runs a kernel at one point.
///
/// Shapes: `uniforms` and `inputs` hold at least the kernel's numbers of slots, `outputs` at least its outputs.
/// `values` is scratch space, reused from call to call.
///
/// # Panics
/// If a slice is shorter than that.
pub fn interpret<T: Real>(
    kernel: &VerifiedKernel,
    uniforms: &[T],
    inputs: &[T],
    values: &mut Vec<[T; 1]>,
    outputs: &mut [T],
) {
    interpret_lanes(kernel, uniforms, inputs.as_chunks().0, values, outputs.as_chunks_mut().0);
}

/// Runs a kernel at N points at once: what one point costs is mostly not arithmetic.
///
/// Shapes as in [`interpret`], a lane a point; uniforms are the same for all.
///
/// # Panics
/// If a slice is shorter than that.
pub fn interpret_lanes<T: Real, const N: usize>(
    kernel: &VerifiedKernel,
    uniforms: &[T],
    inputs: &[[T; N]],
    values: &mut Vec<[T; N]>,
    outputs: &mut [[T; N]],
) {
    let kernel = kernel.kernel();
    run_instructions(kernel, uniforms, inputs, values);
    for (out, v) in outputs[..kernel.outputs.len()].iter_mut().zip(&kernel.outputs) {
        *out = values[v.index()];
    }
}

/// Fills the first entries of `values` with the results of the instructions: numbers as they are, masks as 1 or 0, a
/// bundle as the place in `values` where its results begin.
fn run_instructions<T: Real, const N: usize>(
    kernel: &Kernel,
    uniforms: &[T],
    inputs: &[[T; N]],
    values: &mut Vec<[T; N]>,
) {
    let n = kernel.insts.len();
    let zero = T::from_f64(0.0);
    values.clear();
    // Bundles are appended behind the results of the instructions.
    values.resize(n, [zero; N]);
    let mask = |holds: bool| T::from_f64(f64::from(u8::from(holds)));
    let holds = |m: T| m.to_f64() != 0.0;
    for (at, inst) in kernel.insts.iter().enumerate() {
        let get = |v: &Val| &values[v.index()];
        let result: [T; N] = match inst {
            Inst::Const(c) => [T::from_f64(*c); N],
            Inst::Input(slot) => inputs[*slot as usize],
            Inst::Uniform(slot) => [uniforms[*slot as usize]; N],
            Inst::Add(a, b) => both(get(a), get(b), T::add),
            Inst::Sub(a, b) => both(get(a), get(b), T::sub),
            Inst::Mul(a, b) => both(get(a), get(b), T::mul),
            Inst::Div(a, b) => both(get(a), get(b), T::div),
            Inst::Neg(a) => get(a).map(T::neg),
            Inst::Abs(a) => get(a).map(T::abs),
            Inst::Sqrt(a) => get(a).map(T::sqrt),
            Inst::Compare(op, a, b) => both(get(a), get(b), |a, b| mask(a.compare(*op, b))),
            Inst::And(a, b) => both(get(a), get(b), |a, b| mask(holds(a) && holds(b))),
            Inst::Or(a, b) => both(get(a), get(b), |a, b| mask(holds(a) || holds(b))),
            Inst::Not(a) => get(a).map(|m| mask(!holds(m))),
            Inst::Select(m, a, b) => {
                let (m, a, b) = (get(m), get(a), get(b));
                std::array::from_fn(|lane| if holds(m[lane]) { a[lane] } else { b[lane] })
            }
            Inst::Call1(f, a) => get(a).map(|x| x.call1(*f)),
            Inst::Lookup(curve, reading, a) => get(a).map(|x| read(curve, *reading, x)),
            Inst::Call2(f, a, b) => both(get(a), get(b), |a, b| a.call2(*f, b)),
            Inst::Part(a, part) => values[bundle_start(get(a)[0]) + *part as usize],
            Inst::Matrix { function, n, entries } => {
                let (start, n) = (values.len(), usize::from(*n));
                let n_results = function.n_results(n);
                values.resize(start + n_results, [zero; N]);
                for lane in 0..N {
                    let (mut matrix, mut results) = ([zero; 9], [zero; MAX_RESULTS]);
                    for (x, v) in matrix.iter_mut().zip(entries) {
                        *x = values[v.index()][lane];
                    }
                    function.eval(n, &matrix[..n * n], &mut results[..n_results]);
                    values[start..].iter_mut().zip(results).for_each(|(value, x)| value[lane] = x);
                }
                [T::from_f64(start as f64); N]
            }
        };
        values[at] = result;
    }
}

/// A function of two numbers, lane by lane.
fn both<T: Real, const N: usize>(a: &[T; N], b: &[T; N], f: impl Fn(T, T) -> T) -> [T; N] {
    std::array::from_fn(|lane| f(a[lane], b[lane]))
}

/// Where the results of a bundle begin: places are far below 2^24 (kernels of f32) and 2^53.
fn bundle_start<T: Real>(bundle: T) -> usize {
    bundle.to_f64() as usize
}

/// The interpreter as a backend over f64: slow, everywhere available, the reference for all others.
#[derive(Clone, Copy, Debug, Default)]
pub struct InterpreterBackend;

struct Interpreted(VerifiedKernel);

impl KernelBackend for InterpreterBackend {
    fn name(&self) -> &'static str {
        "interpreter"
    }

    fn compile(&self, kernels: &[&VerifiedKernel]) -> Result<Vec<Box<dyn PointKernel>>, BackendError> {
        Ok(kernels.iter().map(|k| Box::new(Interpreted((*k).clone())) as Box<dyn PointKernel>).collect())
    }

    fn listing(&self, _: &VerifiedKernel) -> Option<String> {
        None
    }
}

impl PointKernel for Interpreted {
    fn run(&self, uniforms: &[f64], inputs: &[f64], outputs: &mut [f64], n_blocks: usize) {
        let kernel = self.0.kernel();
        let (n_inputs, n_outputs) = (kernel.n_inputs, kernel.outputs.len());
        assert!(uniforms.len() >= kernel.n_uniforms, "too few uniforms for kernel {}", kernel.name);
        let inputs = &inputs[..n_blocks * n_inputs * LANES];
        let outputs = &mut outputs[..n_blocks * n_outputs * LANES];
        let mut values: Vec<[f64; LANES]> = Vec::with_capacity(kernel.insts.len() + MAX_RESULTS);
        for block in 0..n_blocks {
            let inputs = &inputs[block * n_inputs * LANES..];
            let outputs = &mut outputs[block * n_outputs * LANES..];
            run_instructions(kernel, uniforms, inputs.as_chunks::<LANES>().0, &mut values);
            for (out, v) in outputs.as_chunks_mut::<LANES>().0.iter_mut().zip(&kernel.outputs) {
                *out = values[v.index()];
            }
        }
    }
}

/// Where an infinity or NaN began.
#[derive(Clone, Debug, PartialEq)]
pub struct NonFinite {
    /// Position of the instruction in the kernel.
    pub inst: usize,
    /// Where it comes from in the scene; of an instruction made by a rewrite, where the next user on the way to the
    /// output comes from.
    pub origin: Option<Origin>,
    /// What it does, in words: `"division"`, `"log"`, `"point input 3"`.
    pub operation: String,
    /// What it was given; empty for constants and slots.
    pub operands: Vec<f64>,
    /// The infinity or NaN it made; of a matrix function the first such entry.
    pub result: f64,
    /// The table that has no row there.
    pub outside: Option<CurveRef>,
}

/// The first instruction whose result is not finite although its operands are, among those that carried a
/// non-finite value to an output; `None` when all outputs are finite.
///
/// Untaken operands of a `select` carry nothing, and neither do comparisons: an infinity that only decides a branch
/// is no failure. Shapes as in [`interpret`].
///
/// # Panics
/// If a slice is shorter than the kernel asks for.
#[must_use]
pub fn first_non_finite(kernel: &VerifiedKernel, uniforms: &[f64], inputs: &[f64]) -> Option<NonFinite> {
    let kernel = kernel.kernel();
    let mut values = Vec::new();
    run_instructions(kernel, uniforms, inputs.as_chunks::<1>().0, &mut values);
    let values: Vec<f64> = values.into_iter().flatten().collect();
    let bad = |v: Val| non_finite_result(kernel, &values, v).is_some();
    // Backwards from the outputs along non-finite values; `origin` is inherited from the user.
    let mut reached: Vec<Option<Option<Origin>>> = vec![None; kernel.insts.len()];
    for v in &kernel.outputs {
        if bad(*v) {
            reached[v.index()] = Some(None);
        }
    }
    let mut first = None;
    for at in (0..kernel.insts.len()).rev() {
        let Some(inherited) = reached[at] else { continue };
        let origin = kernel.origins[at].or(inherited);
        let mut is_root = true;
        for_each_carrier(&kernel.insts[at], &values, |v| {
            if bad(v) {
                is_root = false;
                reached[v.index()].get_or_insert(origin);
            }
        });
        if is_root {
            first = Some((at, origin));
        }
    }
    let (inst, origin) = first?;
    let mut operands = Vec::new();
    kernel.insts[inst].for_each_operand(|v| operands.push(values[v.index()]));
    let result = non_finite_result(kernel, &values, Val::new(inst))?;
    let outside = match &kernel.insts[inst] {
        Inst::Lookup(curve, ..) => Some(curve.clone()),
        _ => None,
    };
    Some(NonFinite { inst, origin, operation: operation(&kernel.insts[inst]), operands, result, outside })
}

/// True if a comparison of the kernel is given what is not a number: then it decides nothing, whatever it says.
///
/// # Panics
/// If a slice is shorter than the kernel asks for.
#[must_use]
pub fn compares_nan(kernel: &VerifiedKernel, uniforms: &[f64], inputs: &[f64]) -> bool {
    let kernel = kernel.kernel();
    let undefined =
        |i: &Inst| matches!(i, Inst::Div(..) | Inst::Sqrt(_) | Inst::Call1(..) | Inst::Call2(..) | Inst::Lookup(..));
    // sums and products of finite positions are numbers: nothing to run
    if !kernel.insts.iter().any(|i| undefined(i) || matches!(i, Inst::Matrix { .. })) {
        return false;
    }
    let mut values: Vec<[f64; 1]> = Vec::new();
    run_instructions(kernel, uniforms, inputs.as_chunks::<1>().0, &mut values);
    let is_nan = |v: &Val| values[v.index()][0].is_nan();
    kernel.insts.iter().any(|i| matches!(i, Inst::Compare(_, a, b) if is_nan(a) || is_nan(b)))
}

/// The result of an instruction if it is not finite; of a bundle the first such entry.
fn non_finite_result(kernel: &Kernel, values: &[f64], v: Val) -> Option<f64> {
    let value = values[v.index()];
    match &kernel.insts[v.index()] {
        Inst::Matrix { function, n, .. } => {
            let start = bundle_start(value);
            let results = &values[start..start + function.n_results(usize::from(*n))];
            results.iter().copied().find(|x| !x.is_finite())
        }
        _ => (!value.is_finite()).then_some(value),
    }
}

/// Operands whose value can enter the result: of a `select` the taken one.
fn for_each_carrier(inst: &Inst, values: &[f64], mut f: impl FnMut(Val)) {
    match inst {
        Inst::Select(m, a, b) => f(if values[m.index()] != 0.0 { *a } else { *b }),
        _ => inst.for_each_operand(f),
    }
}

/// What an instruction does, in words for a message.
fn operation(inst: &Inst) -> String {
    let word = match inst {
        Inst::Const(_) => "constant",
        Inst::Input(slot) => return format!("point input {slot}"),
        Inst::Uniform(slot) => return format!("uniform {slot}"),
        Inst::Add(..) => "addition",
        Inst::Sub(..) => "subtraction",
        Inst::Mul(..) => "multiplication",
        Inst::Div(..) => "division",
        Inst::Neg(_) => "negation",
        Inst::Abs(_) => "abs",
        Inst::Sqrt(_) => "sqrt",
        Inst::Compare(..) => "comparison",
        Inst::And(..) | Inst::Or(..) | Inst::Not(_) => "logic",
        Inst::Select(..) => "selection",
        Inst::Call1(f, _) => f.name(),
        Inst::Lookup(_, reading, _) => reading.name(),
        Inst::Call2(f, ..) => f.name(),
        Inst::Matrix { function: MatrixFn::Expm, .. } => "Expm",
        Inst::Matrix { function: MatrixFn::ExpmDerivative, .. } => "derivative of Expm",
        Inst::Matrix { function: MatrixFn::Logm, .. } => "Logm",
        Inst::Matrix { function: MatrixFn::LogmDerivative, .. } => "derivative of Logm",
        Inst::Part(..) => "entry of a matrix function",
    };
    word.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dd::Dd,
        dual::Dual,
        ir::Compare,
        math::{MathFn1, MathFn2},
        verify::verify,
    };
    use wfl::{SourceId, Span};

    fn v(i: usize) -> Val {
        Val::new(i)
    }

    fn kernel(n_inputs: usize, insts: Vec<Inst>, outputs: &[usize]) -> VerifiedKernel {
        verify(Kernel {
            name: "t".into(),
            n_inputs,
            n_uniforms: 1,
            origins: vec![None; insts.len()],
            insts,
            outputs: outputs.iter().map(|i| v(*i)).collect(),
        })
        .unwrap()
    }

    fn one<T: Real>(k: &VerifiedKernel, uniform: f64, inputs: &[T]) -> Vec<T> {
        let mut out = vec![T::from_f64(0.0); k.kernel().outputs.len()];
        interpret(k, &[T::from_f64(uniform)], inputs, &mut Vec::new(), &mut out);
        out
    }

    /// `max(x, u)`, `exp(x)/y`, `-|x - y|`, parts of `Expm([x 0; y x])`.
    fn example() -> VerifiedKernel {
        kernel(
            2,
            vec![
                Inst::Input(0),
                Inst::Input(1),
                Inst::Uniform(0),
                Inst::Compare(Compare::Less, v(0), v(2)),
                Inst::Select(v(3), v(2), v(0)),
                Inst::Call1(MathFn1::Exp, v(0)),
                Inst::Div(v(5), v(1)),
                Inst::Sub(v(0), v(1)),
                Inst::Abs(v(7)),
                Inst::Neg(v(8)),
                Inst::Const(0.0),
                Inst::Matrix { function: MatrixFn::Expm, n: 2, entries: [v(0), v(1), v(10), v(0)].into() },
                Inst::Part(v(11), 1),
                Inst::Call2(MathFn2::Pow, v(1), v(0)),
            ],
            &[4, 6, 9, 12, 13],
        )
    }

    #[test]
    fn a_point_of_every_precision() {
        let k = example();
        let (x, y) = (1.5, 3.0);
        let e = libm::exp(x);
        // Expm([x 0; y x]) = exp(x) [1 0; y 1]
        let expected = [2.0, e / y, -1.5, e * y, libm::pow(y, x)];
        for (value, expected) in one::<f64>(&k, 2.0, &[x, y]).iter().zip(expected) {
            assert!((value - expected).abs() <= 4e-16 * 14.0, "{value} {expected}");
        }
        for (value, expected) in one::<f32>(&k, 2.0, &[1.5, 3.0]).iter().zip(expected) {
            assert!((f64::from(*value) - expected).abs() <= 1e-6 * expected.abs());
        }
        let wide = one::<Dd>(&k, 2.0, &[Dd::from_f64(x), Dd::from_f64(y)]);
        assert!((wide[3] - Dd::from_f64(x).exp() * Dd::from_f64(y)).abs().hi() < 1e-28);
        let dual = one::<Dual>(&k, 2.0, &[Dual::new(x, 1.0), Dual::new(y, 0.0)]);
        let slopes = [0.0, e / y, 1.0, e * y, libm::pow(y, x) * libm::log(y)];
        for (value, slope) in dual.iter().zip(slopes) {
            assert!((value.slope - slope).abs() < 1e-14 * 14.0, "{value:?} {slope}");
        }
    }

    #[test]
    fn blocks_hold_lanes_slot_by_slot() {
        let k = kernel(2, vec![Inst::Input(0), Inst::Input(1), Inst::Uniform(0), Inst::Sub(v(0), v(1))], &[3, 2, 0]);
        let inputs: Vec<f64> = (0..2 * 2 * LANES).map(|i| (i * i) as f64).collect();
        let mut outputs = vec![f64::NAN; 2 * 3 * LANES];
        let compiled = InterpreterBackend.compile(&[&k]).unwrap();
        compiled[0].run(&[7.0], &inputs, &mut outputs, 2);
        for block in 0..2 {
            for lane in 0..LANES {
                let input = |slot: usize| inputs[(block * 2 + slot) * LANES + lane];
                let output = |slot: usize| outputs[(block * 3 + slot) * LANES + lane];
                assert_eq!((output(0), output(1), output(2)), (input(0) - input(1), 7.0, input(0)));
            }
        }
    }

    #[test]
    fn the_first_cause_of_a_non_finite_output_is_found() {
        let span = |start| Origin { span: Span { source: SourceId::new(0), start, end: start + 1 }, expansion: None };
        // out = select(x < 1, log(x)*2, x) + exp(y)
        let mut raw = kernel(
            2,
            vec![
                Inst::Input(0),
                Inst::Input(1),
                Inst::Const(1.0),
                Inst::Compare(Compare::Less, v(0), v(2)),
                Inst::Call1(MathFn1::Log, v(0)),
                Inst::Add(v(4), v(4)),
                Inst::Select(v(3), v(5), v(0)),
                Inst::Call1(MathFn1::Exp, v(1)),
                Inst::Add(v(6), v(7)),
            ],
            &[8],
        );
        raw.0.origins[5] = Some(span(5));
        raw.0.origins[8] = Some(span(8));
        let find = |x, y| first_non_finite(&raw, &[0.0], &[x, y]);
        assert_eq!(find(0.5, 0.0), None);
        let zero = find(0.0, 1000.0).unwrap();
        assert_eq!((zero.inst, zero.operation.as_str(), zero.result), (4, "log", f64::NEG_INFINITY));
        assert_eq!((zero.operands, zero.origin), (vec![0.0], Some(span(5))));
        let large = find(2.0, 1000.0).unwrap();
        assert_eq!((large.inst, large.operands, large.origin), (7, vec![1000.0], Some(span(8))));
        let input = find(2.0, f64::INFINITY).unwrap();
        assert_eq!((input.inst, input.operation.as_str()), (1, "point input 1"));
        // NaN is not below 1: the other branch carries it.
        assert_eq!(find(f64::NAN, 0.0).unwrap().inst, 0);
    }

    #[test]
    fn a_comparison_with_what_is_no_number_is_found() {
        // log(x) < 1
        let insts = vec![
            Inst::Input(0),
            Inst::Call1(MathFn1::Log, v(0)),
            Inst::Const(1.0),
            Inst::Compare(Compare::Less, v(1), v(2)),
            Inst::Select(v(3), v(2), v(0)),
        ];
        let k = kernel(1, insts, &[4]);
        assert!(compares_nan(&k, &[0.0], &[-1.0]));
        assert!(!compares_nan(&k, &[0.0], &[0.0]) && !compares_nan(&k, &[0.0], &[2.0]));
    }

    #[test]
    fn branches_and_divisors_that_absorb_an_infinity_are_no_failure() {
        // m = 1/x; out = select(m <= 1, m, 1), second output 1/m
        let k = kernel(
            1,
            vec![
                Inst::Input(0),
                Inst::Const(1.0),
                Inst::Div(v(1), v(0)),
                Inst::Compare(Compare::LessEqual, v(2), v(1)),
                Inst::Select(v(3), v(2), v(1)),
                Inst::Div(v(1), v(2)),
                Inst::Matrix { function: MatrixFn::Logm, n: 1, entries: [v(0)].into() },
                Inst::Part(v(6), 0),
                Inst::Select(v(3), v(7), v(1)),
            ],
            &[4, 5, 8],
        );
        assert_eq!(first_non_finite(&k, &[0.0], &[0.0]), None);
        let negative = first_non_finite(&k, &[0.0], &[-2.0]).unwrap();
        assert_eq!((negative.inst, negative.operation.as_str()), (6, "Logm"));
        assert_eq!(negative.operands, vec![-2.0]);
    }
}
