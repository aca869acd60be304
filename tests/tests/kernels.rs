//! Every term of every example: machine code against the interpreter, tangent against differences of the residual in
//! double-double arithmetic.

use wfl_compiler::{
    Dd, InterpreterBackend, KinkKind, Real, TermLaw,
    backend::KernelBackend,
    interpret,
    ir::{LANES, VerifiedKernel},
    run_prologue,
    types::InputSlot,
    unit_normals,
};
use wfl_jit::JitBackend;
use wfl_tests::{Sequence, prepared, scene_files};

/// The laws of every example that is a problem by itself.
fn laws() -> Vec<(String, TermLaw)> {
    let mut laws = Vec::new();
    for path in scene_files() {
        let text = std::fs::read_to_string(&path).expect("examples can be read");
        // a theta that keeps every term, on few cells
        let params: &[(&str, f64)] = if text.contains("param theta") { &[("theta", 1.0)] } else { &[] };
        let Ok(scene) = prepared(path.parent().expect("a folder"), text, &[], params, &InterpreterBackend) else {
            continue;
        };
        let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
        laws.extend(scene.system.terms.into_iter().map(|t| (format!("{name}: {}", t.law.name), (*t.law).clone())));
    }
    assert!(laws.len() > 40, "only {} terms found", laws.len());
    laws
}

/// Whether a law reads what it tests at images that follow the bodies: an entry is no difference with one number alone moved,
/// and is compared along the chain by `wfl verify` and the tests of the compiler.
fn follows_images(law: &TermLaw) -> bool {
    law.inputs.iter().any(|slot| matches!(slot, InputSlot::ImageShift(_)))
}

/// A state of a point: fields of a size, unit normals, positive sizes.
fn state(law: &TermLaw, sequence: &mut Sequence, size: f64) -> Vec<f64> {
    let mut inputs: Vec<f64> = law
        .inputs
        .iter()
        .map(|s| sequence.number() * if matches!(s, InputSlot::Field(_) | InputSlot::Previous(_)) { size } else { 1.0 })
        .collect();
    unit_normals(&law.inputs, &mut inputs);
    inputs
}

/// What the prologue makes of some time and some increment: its results depend on each other.
fn uniforms(law: &TermLaw, sequence: &mut Sequence) -> Vec<f64> {
    let slots: Vec<f64> = law.prologue.slots.iter().map(|_| sequence.number()).collect();
    run_prologue(&law.prologue, &slots)
}

/// Outputs at one point by the interpreter in any arithmetic.
fn outputs<T: Real>(kernel: &VerifiedKernel, uniforms: &[f64], inputs: &[T]) -> Vec<T> {
    let uniforms: Vec<T> = uniforms.iter().map(|u| T::from_f64(*u)).collect();
    let mut out = vec![T::from_f64(0.0); kernel.kernel().outputs.len()];
    interpret(kernel, &uniforms, inputs, &mut Vec::new(), &mut out);
    out
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn machine_code_gives_the_bits_of_the_interpreter() {
    let jit = JitBackend::new().expect("machine code on this processor");
    let mut sequence = Sequence(0x1234_5678_9abc_def1);
    for (name, law) in laws() {
        let kernels = [&law.residual, &law.tangent];
        let compiled = jit.compile(&kernels).expect("machine code");
        for (kernel, code) in kernels.iter().zip(&compiled) {
            let (n_in, n_out) = (law.inputs.len(), kernel.kernel().outputs.len());
            let given = uniforms(&law, &mut sequence);
            let states: Vec<Vec<f64>> =
                (0..2 * LANES).map(|k| state(&law, &mut sequence, 10f64.powi(k as i32 % 5 - 4))).collect();
            let mut blocked = vec![0.0; 2 * n_in * LANES];
            for (k, s) in states.iter().enumerate() {
                for (slot, x) in s.iter().enumerate() {
                    blocked[((k / LANES) * n_in + slot) * LANES + k % LANES] = *x;
                }
            }
            let mut found = vec![0.0; 2 * n_out * LANES];
            code.run(&given, &blocked, &mut found, 2);
            for (k, s) in states.iter().enumerate() {
                for (o, expected) in outputs::<f64>(kernel, &given, s).iter().enumerate() {
                    let value = found[((k / LANES) * n_out + o) * LANES + k % LANES];
                    let same = value.to_bits() == expected.to_bits() || (value.is_nan() && expected.is_nan());
                    assert!(same, "{name}: output {o} is {value:e}, interpreted {expected:e}");
                }
            }
        }
    }
}

/// Branch codes of the residual at a state.
fn codes(law: &TermLaw, given: &[f64], inputs: &[f64]) -> Vec<f64> {
    outputs::<f64>(&law.residual, given, inputs)[law.tests.len()..].to_vec()
}

/// Largest difference of the entries from central differences of the fluxes, relative to the largest entry.
fn tangent_error(law: &TermLaw, given: &[f64], inputs: &[f64], step: f64) -> f64 {
    let entries = &outputs::<f64>(&law.tangent, given, inputs)[law.tests.len()..][..law.entries.len()];
    let largest = entries.iter().fold(0.0f64, |m, e| m.max(e.abs()));
    let mut worst = 0.0f64;
    for (s, trial) in law.trials.iter().enumerate() {
        // a trial slot that no law reads has no entry but those of terms linear in it
        let slot = law.inputs.iter().position(|i| *i == InputSlot::Field(*trial)).expect("trial slots are inputs");
        let shifted = |sign: f64| {
            let mut x: Vec<Dd> = inputs.iter().map(|v| Dd::from_f64(*v)).collect();
            x[slot] = x[slot] + Dd::from_f64(sign * step);
            outputs::<Dd>(&law.residual, given, &x)
        };
        let (above, below) = (shifted(1.0), shifted(-1.0));
        for t in 0..law.tests.len() {
            let difference = ((above[t] - below[t]) / Dd::from_f64(2.0 * step)).to_f64();
            let key = (u16::try_from(t).expect("few slots"), u16::try_from(s).expect("few slots"));
            let entry = law.entries.binary_search(&key).map_or(0.0, |e| entries[e]);
            worst = worst.max((difference - entry).abs());
        }
    }
    if largest == 0.0 { worst } else { worst / largest }
}

#[test]
fn tangents_agree_with_differences_of_the_residual_on_every_branch() {
    let mut sequence = Sequence(0x0dd0_beef_cafe_f00d);
    for (name, law) in laws() {
        if law.entries.is_empty() || follows_images(&law) {
            continue;
        }
        let mut seen: Vec<Vec<f64>> = Vec::new();
        for k in 0..60 {
            let size = 10f64.powi(k % 6 - 5);
            let given = uniforms(&law, &mut sequence);
            let inputs = state(&law, &mut sequence, size);
            let here = codes(&law, &given, &inputs);
            let step = 1e-9 * size;
            // away from kinks: the branch is the same all around
            let near: Vec<f64> = inputs.iter().map(|x| x * (1.0 + 1e-6)).collect();
            if codes(&law, &given, &near) != here {
                continue;
            }
            if !outputs::<f64>(&law.tangent, &given, &inputs).iter().all(|x| x.is_finite()) {
                // the logarithm of a negative determinant: no state of a body
                continue;
            }
            let error = tangent_error(&law, &given, &inputs, step);
            assert!(error < 1e-9, "{name}: off by {error:e} at branch {here:?}");
            if !seen.contains(&here) {
                seen.push(here);
            }
        }
        // friction was met open, slipping or sticking: more than one branch at least
        let frictional = law.kinks.iter().any(|k| k.kind == KinkKind::Ball);
        assert!(!frictional || seen.len() > 1, "{name}: only one branch was met");
    }
}

/// Weighted mean of two states; normals become unit vectors again.
fn between(law: &TermLaw, a: &[f64], b: &[f64], part: f64) -> Vec<f64> {
    let mut x: Vec<f64> = a.iter().zip(b).map(|(a, b)| a + part * (b - a)).collect();
    unit_normals(&law.inputs, &mut x);
    x
}

/// The parts of the way from `a` to `b` just before and behind a change of a branch code.
fn bisect(law: &TermLaw, given: &[f64], a: &[f64], b: &[f64], kink: usize) -> (f64, f64) {
    let start = codes(law, given, a)[kink];
    let (mut low, mut high) = (0.0, 1.0);
    while high - low > 1e-6 {
        let middle = 0.5 * (low + high);
        if codes(law, given, &between(law, a, b, middle))[kink] == start {
            low = middle;
        } else {
            high = middle;
        }
    }
    (low, high)
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn tangents_agree_next_to_every_kink_on_both_of_its_sides() {
    let mut sequence = Sequence(0x5eed_0f1e_55c0_ffee);
    let (mut n_kinks, mut n_states) = (0, 0);
    for (name, law) in laws().iter().filter(|(_, law)| !law.entries.is_empty() && !follows_images(law)) {
        for kink in 0..law.kinks.len() {
            n_kinks += 1;
            let mut tested = 0;
            for k in 0..400 {
                let size = 10f64.powi(k % 7 - 5);
                let given = uniforms(law, &mut sequence);
                let (a, b) = (state(law, &mut sequence, size), state(law, &mut sequence, size));
                if codes(law, &given, &a)[kink] == codes(law, &given, &b)[kink] || tested >= 12 {
                    continue;
                }
                let (low, high) = bisect(law, &given, &a, &b, kink);
                // one gap further away from the kink than the bisection came, so that differences stay on one side
                let gap = 2.0 * (high - low);
                for part in [low - gap, high + gap] {
                    let x = between(law, &a, &b, part);
                    let step = 1e-3 * gap * size;
                    let entries = outputs::<f64>(&law.tangent, &given, &x);
                    let same = |p: f64| codes(law, &given, &between(law, &a, &b, p)) == codes(law, &given, &x);
                    if !(same(part - 0.5 * gap) && same(part + 0.5 * gap) && entries.iter().all(|e| e.is_finite())) {
                        continue;
                    }
                    let error = tangent_error(law, &given, &x, step);
                    assert!(error < 1e-9, "{name}: off by {error:e} beside kink {kink}");
                    tested += 1;
                }
            }
            n_states += tested;
            assert!(tested >= 2, "{name}: kink {kink} was not met");
        }
    }
    assert!(n_kinks >= 16 && n_states >= 10 * n_kinks, "{n_states} states beside {n_kinks} kinks");
}
