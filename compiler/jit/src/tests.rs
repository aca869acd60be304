//! Machine code against the interpreter, bit by bit, on random kernels over all instructions.

use wfl_compiler::{
    InterpreterBackend, MathFn1, MathFn2, MatrixFn,
    backend::{KernelBackend, PointKernel},
    ir::{Compare, Inst, Kernel, LANES, Val, VerifiedKernel},
    verify,
};

use crate::{
    JitBackend,
    emit::Width,
    target::{Target, host_isa},
};

/// A small deterministic generator (splitmix64).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// Between -2 and 2.
    fn ordinary(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 51) as f64 - 2.0
    }

    fn extreme(&mut self) -> f64 {
        const LIST: [f64; 16] = [
            0.0,
            -0.0,
            5e-324,
            -2.5e-310,
            f64::MIN_POSITIVE,
            1e-160,
            -1e160,
            1e308,
            -1e308,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
            1.0,
            -1.0,
            0.5,
            700.0,
        ];
        if self.below(4) == 0 { self.ordinary() } else { LIST[self.below(LIST.len())] }
    }
}

/// Which instructions a random kernel has.
#[derive(Clone, Copy)]
pub(crate) struct Mix {
    /// Of a hundred instructions, how many are calls of one- and two-argument functions.
    pub(crate) calls: usize,
    /// Of a hundred, matrix functions.
    pub(crate) matrices: usize,
    /// Operands are among this many latest numbers.
    pub(crate) window: usize,
}

/// A verified kernel of about `n` instructions with `n_inputs` inputs and 3 uniforms.
pub(crate) fn random_kernel(
    random: &mut Random,
    n: usize,
    n_inputs: usize,
    n_outputs: usize,
    mix: Mix,
) -> VerifiedKernel {
    let mut insts: Vec<Inst> = (0..n_inputs as u32).map(Inst::Input).collect();
    insts.extend((0..3).map(Inst::Uniform));
    insts.extend([0.0, -1.5, 1e-3].map(Inst::Const));
    let numbers: Vec<Val> = (0..insts.len()).map(Val::new).collect();
    let mut code = RandomCode { random, mix, insts, numbers, masks: Vec::new() };
    while code.insts.len() < n {
        if let Some(inst) = code.instruction() {
            code.number(inst, n_inputs);
        }
    }
    let RandomCode { random, insts, numbers, .. } = code;
    let tail = numbers.len().saturating_sub(n / 2).min(numbers.len() - 1);
    let outputs = (0..n_outputs).map(|_| numbers[tail + random.below(numbers.len() - tail)]).collect();
    let kernel =
        Kernel { name: "random".into(), n_inputs, n_uniforms: 3, origins: vec![None; insts.len()], insts, outputs };
    verify(kernel).unwrap()
}

/// A kernel that is being drawn.
struct RandomCode<'r> {
    random: &'r mut Random,
    mix: Mix,
    insts: Vec<Inst>,
    /// Results that are numbers, and those that are masks.
    numbers: Vec<Val>,
    masks: Vec<Val>,
}

impl RandomCode<'_> {
    fn operand(&mut self) -> Val {
        let n = self.numbers.len();
        let from = if self.random.below(8) == 0 { 0 } else { n.saturating_sub(self.mix.window) };
        self.numbers[from + self.random.below(n - from)]
    }

    /// The next instruction that gives a number; `None` if others were added.
    fn instruction(&mut self) -> Option<Inst> {
        let (a, b) = (self.operand(), self.operand());
        let dice = self.random.below(100);
        if dice < self.mix.calls {
            return Some(if self.random.below(6) == 0 {
                Inst::Call2(MathFn2::ALL[self.random.below(MathFn2::ALL.len())], a, b)
            } else {
                Inst::Call1(MathFn1::ALL[self.random.below(MathFn1::ALL.len())], a)
            });
        }
        if dice < self.mix.calls + self.mix.matrices {
            self.matrix();
            return None;
        }
        Some(match self.random.below(16) {
            0..=2 => Inst::Add(a, b),
            3..=4 => Inst::Sub(a, b),
            5..=8 => Inst::Mul(a, b),
            9 => Inst::Div(a, b),
            10 => Inst::Neg(a),
            11 => Inst::Abs(a),
            12 => Inst::Sqrt(a),
            13 => {
                self.comparison(a, b);
                return None;
            }
            14 if !self.masks.is_empty() => {
                let (m, k) = (self.mask(), self.mask());
                self.masks.push(Val::new(self.insts.len()));
                self.insts.push([Inst::And(m, k), Inst::Or(m, k), Inst::Not(m)][self.random.below(3)].clone());
                return None;
            }
            _ if !self.masks.is_empty() => {
                let n = self.masks.len();
                Inst::Select(self.masks[n - 1 - self.random.below(n.min(5))], a, b)
            }
            _ => Inst::Const(self.random.ordinary()),
        })
    }

    fn mask(&mut self) -> Val {
        self.masks[self.random.below(self.masks.len())]
    }

    /// A matrix function and one of its results.
    fn matrix(&mut self) {
        let at = Val::new(self.insts.len());
        let (function, n) = (MatrixFn::ALL[self.random.below(4)], 1 + self.random.below(3));
        let entries = (0..n * n).map(|_| self.operand()).collect();
        self.insts.push(Inst::Matrix { function, n: n as u8, entries });
        let part = self.random.below(function.n_results(n)) as u32;
        self.numbers.push(Val::new(self.insts.len()));
        self.insts.push(Inst::Part(at, part));
    }

    /// A mask, or a minimum or maximum: these have instructions of their own, so they are made often.
    fn comparison(&mut self, a: Val, b: Val) {
        let at = Val::new(self.insts.len());
        let op = [Compare::Less, Compare::LessEqual, Compare::Equal, Compare::NotEqual][self.random.below(4)];
        self.insts.push(Inst::Compare(op, a, b));
        if op == Compare::Less && self.random.below(2) == 0 {
            self.numbers.push(Val::new(self.insts.len()));
            let smaller = self.random.below(2) == 0;
            self.insts.push(if smaller { Inst::Select(at, a, b) } else { Inst::Select(at, b, a) });
        } else {
            self.masks.push(at);
        }
    }

    /// Adds an instruction that gives a number.
    fn number(&mut self, inst: Inst, n_inputs: usize) {
        let at = Val::new(self.insts.len());
        let last = self.numbers.len();
        self.numbers.push(at);
        self.insts.push(inst);
        if self.random.below(3) == 0 {
            // Keep to numbers of ordinary size, else all outputs of a long kernel are NaN.
            let next = |k: usize| Val::new(at.index() + k);
            self.numbers[last] = next(4);
            self.insts.extend([Inst::Abs(at), Inst::Const(3.0), Inst::Compare(Compare::Less, next(1), next(2))]);
            self.insts.push(Inst::Select(next(3), at, Val::new(self.random.below(n_inputs))));
        }
    }
}

fn backend(width: Width, settings: &[(&str, &str)]) -> JitBackend {
    let isa = host_isa(settings).unwrap();
    JitBackend { target: Target { isa: isa.clone(), isa_large: isa, width } }
}

fn bits(x: f64) -> u64 {
    if x.is_nan() { f64::NAN.to_bits() } else { x.to_bits() }
}

/// Runs both on the same random numbers and compares every output.
fn compare(kernels: &[VerifiedKernel], jit: &JitBackend, random: &mut Random, number: fn(&mut Random) -> f64) {
    let (mut n_outputs, mut n_numbers) = (0, 0);
    let list: Vec<&VerifiedKernel> = kernels.iter().collect();
    let compiled = jit.compile(&list).unwrap();
    let reference = InterpreterBackend.compile(&list).unwrap();
    for (kernel, (code, reference)) in kernels.iter().zip(compiled.iter().zip(&reference)) {
        let k = kernel.kernel();
        let mut draw = |n: usize| -> Vec<f64> { (0..n).map(|_| number(random)).collect() };
        let n_blocks = 2;
        let (uniforms, inputs) = (draw(3), draw(n_blocks * k.n_inputs * LANES));
        let mut outputs =
            [vec![9.0; n_blocks * k.outputs.len() * LANES + 1], vec![9.0; n_blocks * k.outputs.len() * LANES + 1]];
        code.run(&uniforms, &inputs, &mut outputs[0], n_blocks);
        reference.run(&uniforms, &inputs, &mut outputs[1], n_blocks);
        n_outputs += outputs[1].len();
        n_numbers += outputs[1].iter().filter(|x| !x.is_nan()).count();
        for (at, (a, b)) in outputs[0].iter().zip(&outputs[1]).enumerate() {
            assert_eq!(bits(*a), bits(*b), "output {at}: {a:?} instead of {b:?}\n{}", k.text());
        }
        assert_eq!(outputs[0].last(), Some(&9.0), "written past the end");
    }
    // NaN equals NaN: too many of them would prove nothing.
    assert!(4 * n_numbers > n_outputs, "{n_numbers} numbers of {n_outputs}");
}

const MIXED: Mix = Mix { calls: 15, matrices: 3, window: 40 };

fn random_kernels(random: &mut Random, count: usize) -> Vec<VerifiedKernel> {
    (0..count)
        .map(|i| {
            let n = 20 + random.below(150);
            let mix = if i % 3 == 0 { Mix { calls: 0, matrices: 0, ..MIXED } } else { MIXED };
            let (n_inputs, n_outputs) = (1 + random.below(8), 1 + random.below(12));
            random_kernel(random, n, n_inputs, n_outputs, mix)
        })
        .collect()
}

#[test]
fn machine_code_gives_the_bits_of_the_interpreter() {
    let mut random = Random(7);
    for width in [Width::Pair, Width::One] {
        let kernels = random_kernels(&mut random, 60);
        for _ in 0..4 {
            compare(&kernels, &backend(width, &[]), &mut random, Random::ordinary);
            compare(&kernels, &backend(width, &[]), &mut random, Random::extreme);
        }
    }
}

#[test]
fn optimised_code_gives_the_same_bits() {
    let mut random = Random(8);
    let kernels = random_kernels(&mut random, 40);
    for settings in [("opt_level", "speed"), ("regalloc_algorithm", "single_pass")] {
        compare(&kernels, &backend(Width::Pair, &[settings]), &mut random, Random::extreme);
    }
}

#[test]
fn every_function_and_comparison_on_every_pair_of_extreme_values() {
    let v = Val::new;
    let mut insts = vec![Inst::Input(0), Inst::Input(1)];
    let mut outputs = Vec::new();
    insts.extend(MathFn1::ALL.map(|f| Inst::Call1(f, v(0))));
    insts.extend(MathFn2::ALL.map(|f| Inst::Call2(f, v(0), v(1))));
    insts.extend([Inst::Add(v(0), v(1)), Inst::Sub(v(0), v(1)), Inst::Mul(v(0), v(1)), Inst::Div(v(0), v(1))]);
    insts.extend([Inst::Neg(v(0)), Inst::Abs(v(0)), Inst::Sqrt(v(0))]);
    outputs.extend((2..insts.len()).map(v));
    for op in [Compare::Less, Compare::LessEqual, Compare::Equal, Compare::NotEqual] {
        let at = insts.len();
        insts.extend([Inst::Compare(op, v(0), v(1)), Inst::Select(v(at), v(0), v(1)), Inst::Select(v(at), v(1), v(0))]);
        outputs.extend([v(at + 1), v(at + 2)]);
    }
    let kernel =
        Kernel { name: "all".into(), n_inputs: 2, n_uniforms: 0, origins: vec![None; insts.len()], insts, outputs };
    let kernel = [verify(kernel).unwrap()];
    let mut random = Random(3);
    for _ in 0..60 {
        for width in [Width::Pair, Width::One] {
            compare(&kernel, &backend(width, &[]), &mut random, Random::extreme);
        }
    }
}

#[test]
fn large_kernels_are_compiled_and_right() {
    let mut random = Random(11);
    let kernel = random_kernel(&mut random, 3000, 40, 200, Mix { calls: 2, matrices: 1, window: 200 });
    // Beyond LARGE_KERNEL registers are given out in one pass.
    let larger = random_kernel(&mut random, 10_500, 40, 200, Mix { calls: 1, matrices: 0, window: 100 });
    compare(&[kernel, larger], &JitBackend::new().unwrap(), &mut random, Random::ordinary);
}

#[test]
fn kernels_outlive_the_backend_and_each_other_and_run_in_parallel() {
    let mut random = Random(5);
    let kernels = random_kernels(&mut random, 3);
    let list: Vec<&VerifiedKernel> = kernels.iter().collect();
    let mut compiled = JitBackend::new().unwrap().compile(&list).unwrap();
    let last: Box<dyn PointKernel> = compiled.pop().unwrap();
    drop(compiled);
    let k = kernels[2].kernel();
    let inputs: Vec<f64> = (0..k.n_inputs * LANES).map(|_| random.ordinary()).collect();
    let run = |kernel: &dyn PointKernel| {
        let mut outputs = vec![0.0; k.outputs.len() * LANES];
        kernel.run(&[1.0, 2.0, 3.0], &inputs, &mut outputs, 1);
        outputs.into_iter().map(bits).collect::<Vec<_>>()
    };
    let expected = run(&*InterpreterBackend.compile(&[&kernels[2]]).unwrap()[0]);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| assert_eq!(run(&*last), expected));
        }
    });
}

#[test]
fn no_blocks_no_inputs_no_outputs() {
    let insts = vec![Inst::Const(2.5)];
    let kernel = Kernel {
        name: "constant".into(),
        n_inputs: 0,
        n_uniforms: 0,
        origins: vec![None],
        insts,
        outputs: vec![Val::new(0)],
    };
    let silent = verify(Kernel { outputs: vec![], ..kernel.clone() }).unwrap();
    let kernel = verify(kernel).unwrap();
    let compiled = JitBackend::new().unwrap().compile(&[&kernel, &silent]).unwrap();
    let mut outputs = [0.0; 2 * LANES];
    compiled[0].run(&[], &[], &mut outputs, 2);
    assert_eq!(outputs, [2.5; 2 * LANES]);
    compiled[0].run(&[], &[], &mut [], 0);
    compiled[1].run(&[], &[], &mut [], 3);
    assert!(JitBackend::new().unwrap().compile(&[]).unwrap().is_empty());
}

#[test]
#[should_panic(expected = "inputs are too short")]
fn short_inputs_are_refused() {
    let mut random = Random(1);
    let kernel = random_kernel(&mut random, 20, 2, 1, MIXED);
    let compiled = JitBackend::new().unwrap().compile(&[&kernel]).unwrap();
    compiled[0].run(&[0.0; 3], &[0.0; 2 * LANES], &mut [0.0; 2 * LANES], 2);
}

#[test]
#[should_panic(expected = "outputs are too short")]
fn more_blocks_than_memory_could_hold_are_refused() {
    let kernel = verify(Kernel {
        name: "t".into(),
        n_inputs: 0,
        n_uniforms: 0,
        insts: vec![Inst::Const(1.0)],
        origins: vec![None],
        outputs: vec![Val::new(0)],
    });
    let compiled = JitBackend::new().unwrap().compile(&[&kernel.unwrap()]).unwrap();
    compiled[0].run(&[], &[], &mut [0.0; LANES], usize::MAX / 4);
}

#[test]
fn the_listing_names_what_is_called() {
    let mut random = Random(2);
    let insts = vec![Inst::Input(0), Inst::Call1(MathFn1::Erf, Val::new(0))];
    let kernel = Kernel {
        name: "law".into(),
        n_inputs: 1,
        n_uniforms: 0,
        origins: vec![None; 2],
        insts,
        outputs: vec![Val::new(1)],
    };
    let jit = JitBackend::new().unwrap();
    let text = jit.listing(&verify(kernel).unwrap()).unwrap();
    assert!(text.starts_with("function %law(") && text.contains("%erf") && text.contains("call fn0("), "{text}");
    assert!(jit.listing(&random_kernel(&mut random, 200, 3, 30, MIXED)).is_some());
}
