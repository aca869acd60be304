//! Right tangents pass, and every wrong sign, entry or bit is seen.

use super::*;
use crate::{
    backend::PointKernel,
    build::Env,
    interp::InterpreterBackend,
    ir::{Inst, Kernel, Val},
    term::{TermSource, compile_term},
    test_law::{field, place},
    types::{FieldKind, PlaceKind, Shape},
    verify::verify,
};
use wfl::{SourceMap, ast::Expansions, parse_expr};

const COULOMB: &str = "(pos_part(9*(u.Normal - g))*Normal + Ball_projection(9*(u - (u.Normal)*Normal), 0.3*pos_part(9*(u.Normal - g)))).Test_u";
const NEO_HOOKE: &str =
    "0.5*3*(Norm_sqr(Id(2) + Grad_u) - 2) - 3*log(Det(Id(2) + Grad_u)) + 4*sqr(log(Det(Id(2) + Grad_u)))";

/// A law on the faces or cells of a plane body with an unknown `u` and a given gap `g`.
pub(super) fn law(text: &str, energy: bool) -> TermLaw {
    let fields = [field("u", Shape::vector(2), FieldKind::Unknown), field("g", Shape::SCALAR, FieldKind::Data)];
    let place = place(if energy { PlaceKind::Cells } else { PlaceKind::Facets }, fields.len());
    let env = Env {
        dim: 2,
        fields: &fields,
        mappings: &[],
        params: &BTreeMap::new(),
        expansions: &Expansions::default(),
        step_variable: None,
        rates: &[],
        tables: &[],
        equal_within: 0.0,
    };
    let mut sources = SourceMap::new();
    let id = sources.add("law", text);
    let expr = parse_expr(&sources, id).value.unwrap();
    let source = if energy { TermSource::Energy(&expr) } else { TermSource::Residual(&expr) };
    let compiled = compile_term(&env, &place, "law", source);
    assert!(compiled.diagnostics.is_empty(), "{:?}", compiled.diagnostics);
    compiled.value.unwrap()
}

pub(super) fn check(law: &TermLaw, samples: usize) -> TangentCheck {
    let sampling = TangentSampling { samples, ..TangentSampling::default() };
    check_tangent(law, &sampling, &InterpreterBackend).unwrap().unwrap()
}

#[test]
fn coulomb_contact_passes_in_every_branch() {
    let found = check(&law(COULOMB, false), 64);
    assert!(found.passes(1e-13), "{found:?}");
    assert!(found.near_kinks > 60, "{}", found.near_kinks);
    let visited: usize = found.kinks.iter().flatten().filter(|n| **n > 0).count();
    // open and closed of each selection; open, slip and stick of the ball
    assert_eq!(visited, 2 * (found.kinks.len() - 1) + 3, "{:?}", found.kinks);
}

#[test]
fn a_smooth_energy_passes() {
    let found = check(&law(NEO_HOOKE, true), 128);
    assert!(found.passes(1e-12), "{} {found:?}", found.error());
    // half of the large states turn the body inside out: log of a negative number
    assert!(found.not_finite > 0 && found.near_kinks == 0);
}

/// One instruction replaced.
fn mutated(kernel: &VerifiedKernel, at: usize, inst: Inst) -> VerifiedKernel {
    let mut raw: Kernel = kernel.kernel().clone();
    raw.insts[at] = inst;
    verify(raw).unwrap()
}

#[test]
fn every_flipped_sign_is_seen() {
    for (text, energy) in [(COULOMB, false), (NEO_HOOKE, true)] {
        let right = law(text, energy);
        let mut tried = 0;
        for (at, inst) in right.tangent.kernel().insts.iter().enumerate() {
            let wrong = match inst {
                Inst::Add(a, b) => Inst::Sub(*a, *b),
                Inst::Sub(a, b) => Inst::Add(*a, *b),
                Inst::Neg(a) => Inst::Abs(*a),
                _ => continue,
            };
            tried += 1;
            let wrong = TermLaw { tangent: mutated(&right.tangent, at, wrong), ..right.clone() };
            let found = check(&wrong, 32);
            assert!(!found.passes(1e-7), "instruction {at} of {text}: {}", found.error());
        }
        assert!(tried > 5, "{tried}");
    }
}

#[test]
fn a_missing_entry_is_seen_where_the_tangent_says_zero() {
    let right = law(COULOMB, false);
    let mut raw = right.tangent.kernel().clone();
    raw.outputs.remove(right.tests.len() + 1);
    let mut entries = right.entries.clone();
    let (t, s) = entries.remove(1);
    let wrong = TermLaw { tangent: verify(raw).unwrap(), entries, ..right.clone() };
    let found = check(&wrong, 16);
    assert!(!found.passes(1e-7));
    let worst = found.blocks[0].worst.as_ref().unwrap();
    assert_eq!((worst.test, worst.trial), (right.tests[usize::from(t)], right.trials[usize::from(s)]));
    assert_eq!(worst.tangent, 0.0);
}

#[test]
fn fluxes_of_the_two_kernels_must_be_the_same() {
    let right = law(COULOMB, false);
    let mut raw = right.tangent.kernel().clone();
    raw.outputs.swap(0, 1);
    let wrong = TermLaw { tangent: verify(raw).unwrap(), ..right };
    let found = check(&wrong, 8);
    assert!(found.flux_differences > 0 && !found.passes(1e-7));
}

/// A backend whose code is wrong in the last bit of one output.
struct Wrong;

impl KernelBackend for Wrong {
    fn name(&self) -> &'static str {
        "wrong"
    }

    fn compile(&self, kernels: &[&VerifiedKernel]) -> Result<Vec<Box<dyn PointKernel>>, BackendError> {
        let wrong = |k: &&VerifiedKernel| {
            let mut raw = k.kernel().clone();
            let (factor, product) = (Val::new(raw.insts.len()), Val::new(raw.insts.len() + 1));
            raw.insts.extend([Inst::Const(1.0 + f64::EPSILON), Inst::Mul(raw.outputs[0], factor)]);
            raw.origins.extend([None, None]);
            raw.outputs[0] = product;
            verify(raw).unwrap()
        };
        let kernels: Vec<VerifiedKernel> = kernels.iter().map(wrong).collect();
        InterpreterBackend.compile(&kernels.iter().collect::<Vec<_>>())
    }

    fn listing(&self, _: &VerifiedKernel) -> Option<String> {
        None
    }
}

#[test]
fn a_wrong_bit_of_the_machine_is_seen() {
    let law = law(COULOMB, false);
    let sampling = TangentSampling { samples: 8, ..TangentSampling::default() };
    let found = check_tangent(&law, &sampling, &Wrong).unwrap().unwrap();
    assert!(found.machine_differences > 0 && !found.passes(1e-7));
    assert!(found.error() < 1e-12);
}

/// The field drops out of the law up to rounding: its derivative is 0, and the difference is not, by its own noise.
#[test]
fn rounding_of_the_difference_is_no_error() {
    let law = law("((u + g*[1,0]*1e6 - g*1e6*[1,0]*(1 + 1e-16) - u + 1e-3*Norm_sqr(u)*[0,1])).Test_u", false);
    let found = check(&law, 32);
    assert!(found.passes(1e-7), "{found:?}");
}

#[test]
fn the_same_seed_gives_the_same_states() {
    let law = law(COULOMB, false);
    let run = |seed| {
        check_tangent(&law, &TangentSampling { seed, samples: 8, ..TangentSampling::default() }, &InterpreterBackend)
    };
    let (a, b, c) = (run(3).unwrap().unwrap(), run(3).unwrap().unwrap(), run(4).unwrap().unwrap());
    assert_eq!(format!("{a:?}"), format!("{b:?}"));
    assert_ne!(format!("{a:?}"), format!("{c:?}"));
}
