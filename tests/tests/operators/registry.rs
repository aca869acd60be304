//! Every sample of every operator: tangent against differences of the residual in double-double arithmetic, as a term
//! and (where the operator has second derivatives) as an energy, in two and three dimensions, machine code included.

use wfl_compiler::{OpDef, TangentSampling, TermLaw, check_tangent, functions};
use wfl_jit::JitBackend;

use super::point::{As, compile};

/// More expressions, beside the samples of the registry.
const MORE: &[&str] = &[
    "Cross_product(u,w).u",
    "Interpolate(u,neighbor_element).w",
    "sqr(Interpolate(Grad_u,neighbor_element):B)",
    "Interpolate_filter(neighbor_element, sqr(p), 1)",
    "Normalized(Grad_u):B",
    "Norm(u-Interpolate(u,neighbor_element))*p",
    "Ball_projection(u, 0.1+sqr(q)).w",
    "Von_Mises_projection(Grad_u, 0.1+sqr(q)):B",
    "Coulomb_friction_coupled_projection(u, Normal, w, p, [q], 1.5).w",
    "Coulomb_friction_coupled_projection(u, Normal, w, p-3, [0.3], 2+q).w",
    "Coulomb_friction_coupled_projection(u, Normal, w, p-3, [0.3;0.2;q], 2+q).w",
    "Transformed_unit_vector(0.1*Grad_u, Normal).w",
    "Derivative_sin(p)*q",
    "Derivative_erf(p)",
    "Derivative_sinc(p)",
    "Derivative_tan(p/3)",
    "Derivative_1_pow(4+p, q)",
    "Derivative_2_pow(4+p, q)",
    "Derivative_2_pow(2, p)",
    "Derivative_1_atan2(p, 4+q)",
    "Derivative_2_atan2(p, 4+q)",
    "Derivative_sqr_pos_part(p)",
    "Derivative_half_sqr_neg_part(p)",
    "Derivative_1_reg_pos_part(p, 2+q)",
    "Derivative_2_reg_pos_part(p, 2+q)",
    "if p > q then sqr(p) else p*q",
    "p^3",
    "(4+p)^2.5",
    "(2+sqr(p))^q",
    "p^-2*q",
    "((u@w@u):(Grad_u@w).u).w",
    "(Reshape([1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16],2,2,2,2):Grad_u):(Grad_u*Grad_u)",
    "Diff(Norm_sqr(Grad_u)*p, u, w)",
    "Diff(Norm_sqr(Grad_u)*p, u, p*w)",
    "Saint_Venant_Kirchhoff_potential(0.1*Grad_u, [2+p;3+q])",
    "Ciarlet_Geymonat_PK2(0.1*Grad_u, [2+p;3+q;0.3]):B",
    "Plane_Strain_Generalized_Blatz_Ko_potential(0.1*Grad_u, [0.9;0.7;1.1;0.4;2+p])",
    "Compressible_Neo_Hookean_Bonet_sigma(0.1*Grad_u, [2+p;3+q]):B",
];

/// What has no second derivative, by the words of E111: the only reason why a sample may fail as an energy.
const ONCE_ONLY: &[&str] = &["Expm", "Logm", "third derivatives"];

/// Largest deviation of an entry over the largest entry of its block.
const TOLERANCE: f64 = 1e-10;

fn sampling() -> TangentSampling {
    TangentSampling { samples: 12, ..TangentSampling::default() }
}

/// The sample as a scalar: stresses come bare in the registry.
fn scalars(sample: &str) -> [String; 2] {
    [sample.to_owned(), format!("({sample}):B")]
}

/// The laws of one sample in both dimensions; none compiling is a failure.
fn laws(sample: &str, what: As) -> Vec<(usize, Result<TermLaw, String>)> {
    let mut out = Vec::new();
    for dim in [2, 3] {
        let tries = scalars(sample).map(|text| {
            let whole = if what == As::Term { format!("({text})*Test_p") } else { text };
            compile(&whole, dim, what).map_err(|d| {
                d.first().map_or_else(String::new, |d| {
                    format!("{} {} {:?}", d.code, d.message, d.labels.iter().map(|l| &l.text).collect::<Vec<_>>())
                })
            })
        });
        let [first, second] = tries;
        out.push((
            dim,
            if first.is_ok() {
                first
            } else if second.is_ok() {
                second
            } else {
                first
            },
        ));
    }
    out
}

fn check(sample: &str, law: &TermLaw, backend: &JitBackend, problems: &mut Vec<String>) {
    let checked = check_tangent(law, &sampling(), backend).expect("kernels compile").expect("a residual");
    if law.entries.is_empty() {
        problems.push(format!("{sample}: nothing depends on an unknown"));
    }
    if !checked.passes(TOLERANCE) {
        let worst = checked.blocks.iter().max_by(|a, b| a.error.total_cmp(&b.error)).and_then(|b| b.worst.clone());
        problems.push(format!(
            "{sample}: error {:e} at {} states, {} fluxes and {} bits differ: {worst:?}",
            checked.error(),
            checked.states,
            checked.flux_differences,
            checked.machine_differences
        ));
    }
}

fn samples() -> Vec<String> {
    functions().flat_map(|op: &OpDef| op.samples.iter()).chain(MORE).map(|s| (*s).to_owned()).collect()
}

#[test]
fn every_operator_has_samples_or_a_reason() {
    for op in functions() {
        assert!(op.samples.is_empty() != op.untested.is_empty(), "`{}` has no sample and no reason", op.name);
    }
    assert!(functions().count() > 110, "{} operators", functions().count());
}

#[test]
fn tangents_of_all_samples_are_the_differences_of_their_residuals() {
    let backend = JitBackend::new().expect("machine code");
    let mut problems = Vec::new();
    for sample in samples() {
        let mut tested = 0;
        let mut why = String::new();
        for (_, law) in laws(&sample, As::Term) {
            match law {
                Ok(law) => {
                    check(&sample, &law, &backend, &mut problems);
                    tested += 1;
                }
                Err(e) => why = e,
            }
        }
        if tested == 0 {
            problems.push(format!("{sample}: compiles in no dimension: {why}"));
        }
    }
    assert!(problems.is_empty(), "{} problems\n{}", problems.len(), problems.join("\n"));
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn energies_of_all_samples_have_right_second_derivatives() {
    let backend = JitBackend::new().expect("machine code");
    let mut problems = Vec::new();
    let mut tested = 0;
    for sample in samples() {
        for (dim, law) in laws(&sample, As::Energy) {
            match law {
                Ok(law) if law.entries.is_empty() => {
                    // linear on each side of its kinks: the square has a second derivative
                    let squared = laws(&format!("sqr({sample})"), As::Energy).into_iter().find(|(d, _)| *d == dim);
                    match squared.and_then(|(_, law)| law.ok()) {
                        Some(law) => check(&format!("energy sqr({sample}) in {dim}-D"), &law, &backend, &mut problems),
                        None => problems.push(format!("energy sqr({sample}) in {dim}-D does not compile")),
                    }
                }
                Ok(law) => {
                    check(&format!("energy {sample} in {dim}-D"), &law, &backend, &mut problems);
                    assert!(law.symmetric, "{sample}: the tangent of an energy is symmetric");
                    tested += 1;
                }
                Err(e) if e.starts_with("E111") && ONCE_ONLY.iter().any(|w| e.contains(w)) => {}
                // samples of one dimension only
                Err(e) if e.starts_with("E108") || e.starts_with("E104") || e.starts_with("E102") => {}
                Err(e) => problems.push(format!("energy {sample} in {dim}-D: {e}")),
            }
        }
    }
    assert!(tested > 150, "{tested} energies");
    assert!(problems.is_empty(), "{} problems\n{}", problems.len(), problems.join("\n"));
}

/// A sign that is wrong in one instruction must be seen, or the tests above prove nothing.
#[test]
fn a_wrong_tangent_is_seen() {
    let mut law = compile("sin(p)*q*Test_p", 2, As::Term).expect("compiles");
    let right = law.tangent.kernel().clone();
    let mut seen = 0;
    for k in 0..right.insts.len() {
        let mut kernel = right.clone();
        let wfl_compiler::ir::Inst::Mul(a, b) = kernel.insts[k] else { continue };
        kernel.insts[k] = wfl_compiler::ir::Inst::Add(a, b);
        law.tangent = wfl_compiler::verify(kernel).expect("still a kernel");
        let backend = wfl_compiler::InterpreterBackend;
        let checked = check_tangent(&law, &sampling(), &backend).expect("compiles").expect("a residual");
        assert!(!checked.passes(TOLERANCE), "instruction {k} may be anything");
        seen += 1;
    }
    assert!(seen >= 2);
}
