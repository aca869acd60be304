//! One case: its text compiled, assembled and judged.

use std::sync::Arc;

use wfl::{Diagnostic, Expander, SourceMap, ast::Expr, ast::MacroDef, parse_gwfl};
use wfl_compiler::{Env, TermLaw, TermSource, backend::KernelBackend, compile_term, ir::LANES};
use wfl_discrete::{
    assemble::{AssembledTerm, Binding, Bound, FieldValues, Integrator, LawSlots, Workspace, tangent_kernel},
    system::Numbering,
    value::uniforms_at,
    window::Window,
};
use wfl_sparse::csr::{Csr, PatternBuilder};

use super::{
    Verdict,
    compare::{Numbers, compare},
    format::{Case, Corpus},
    setup::{Setup, setup},
    ties::like_getfem,
};

/// Whose derivatives count at a tie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ties {
    Language,
    GetFem,
}

/// Runs a case; `Err` says why it could not be judged.
pub(super) fn run(corpus: &Corpus, case: &Case, backend: &dyn KernelBackend) -> Result<Verdict, String> {
    let setup = setup(corpus, case)?;
    if case.reject {
        return Ok(match compile(&setup, case, Ties::Language) {
            Err(message) => Verdict::Refused { message },
            Ok(_) => Verdict::Fails { why: "must be refused, but compiles".to_owned() },
        });
    }
    let ours = compare(&setup, case, &assembled(&setup, case, Ties::Language, backend)?)?;
    if !case.kink || ours.agrees() || !ours.values_agree() {
        return Ok(ours.verdict());
    }
    // only the tangent differs: with GetFEM's choice at ties it must not
    let theirs = compare(&setup, case, &assembled(&setup, case, Ties::GetFem, backend)?)?;
    Ok(if theirs.agrees() { Verdict::TieDiffers { worst: theirs.worst() } } else { theirs.verdict() })
}

fn assembled(setup: &Setup, case: &Case, ties: Ties, backend: &dyn KernelBackend) -> Result<Numbers, String> {
    let law = compile(setup, case, ties)?;
    if let Some(order) = case.order {
        let found = match (&law.energy, &law.listing.residual) {
            (Some(_), _) => 0,
            (None, Some(_)) => 1,
            (None, None) => 2,
        };
        // what folds to 0 has lost its test functions and fits any order
        let root = law.listing.energy.or(law.listing.residual).unwrap_or(law.listing.tangent);
        if found != order && !law.listing.graph.is_zero(root) {
            return Err(format!("an expression of order {found}, GetFEM says {order}"));
        }
    }
    assemble(setup, law, backend)
}

/// The law of the expression, or the first error.
fn compile(setup: &Setup, case: &Case, ties: Ties) -> Result<TermLaw, String> {
    let mut sources = SourceMap::new();
    let mut macros: Vec<MacroDef> = Vec::new();
    for (head, body) in &case.macros {
        // a macro of the model is a definition without an expression
        let id = sources.add(format!("{} (macro {head})", case.id), format!("Def {head}:={body}; 0"));
        macros.extend(checked(parse_gwfl(&sources, id))?.0);
    }
    let id = sources.add(case.id.as_str(), case.expression.as_str());
    let (locals, expr) = checked(parse_gwfl(&sources, id))?;
    let mut expander = Expander::new(&sources, &macros);
    let expanded = expander.expr_with(&expr, &locals);
    first_error(&expander.diagnostics)?;
    let expr: Expr = expanded.ok_or_else(|| "no expression".to_owned())?;
    let env = Env {
        dim: setup.mesh.dim(),
        fields: &setup.sigs,
        mappings: &[],
        params: &setup.params,
        expansions: &expander.expansions,
        step_variable: None,
        rates: &[],
        tables: &[],
        equal_within: 0.0,
    };
    let expr = if ties == Ties::GetFem { like_getfem(&expr, &setup.unknowns()) } else { expr };
    checked(compile_term(&env, &setup.place, &case.id, TermSource::Any(&expr)))
}

fn first_error(diagnostics: &[Diagnostic]) -> Result<(), String> {
    match diagnostics.iter().find(|d| d.is_error()) {
        Some(d) => Err(format!("{} {}", d.code, d.message)),
        None => Ok(()),
    }
}

fn checked<T>(checked: wfl::Checked<T>) -> Result<T, String> {
    first_error(&checked.diagnostics)?;
    checked.value.ok_or_else(|| "nothing came out, and no message".to_owned())
}

fn assemble(setup: &Setup, law: TermLaw, backend: &dyn KernelBackend) -> Result<Numbers, String> {
    let slots = LawSlots { inputs: &law.inputs, tests: &law.tests, trials: &law.trials };
    let binding = Binding::new(&setup.mesh, &setup.domain, &setup.fields, slots).map_err(|e| e.to_string())?;
    let tangent_law = tangent_kernel(&law);
    let all: Vec<&_> = [&law.residual].into_iter().chain(&tangent_law).chain(law.energy.as_ref()).collect();
    let mut kernels = backend.compile(&all).map_err(|e| e.to_string())?.into_iter();
    let mut next = || kernels.next().ok_or_else(|| "the backend lost a kernel".to_owned());
    let residual_kernel = next()?;
    let tangent_kernel = if tangent_law.is_some() { Some(next()?) } else { None };
    let energy_kernel = if law.energy.is_some() { Some(next()?) } else { None };
    let numbering = Numbering::new(&setup.fields, |f| {
        matches!(f.kind, wfl_compiler::types::FieldKind::Unknown | wfl_compiler::types::FieldKind::Multiplier)
    });
    let current: Vec<&[f64]> = setup.values.iter().map(Vec::as_slice).collect();
    let values = FieldValues { current: &current, previous: &[], rates: None };
    let uniforms = uniforms_at(&law.prologue, Window::default());
    let integrator = Integrator { domain: Arc::clone(&setup.domain), binding: Arc::new(binding) };
    let scalar = energy_kernel.map(|kernel| integral(setup, &integrator, &*kernel, &uniforms, values));
    let mut term = AssembledTerm::new(law, integrator, None, residual_kernel, tangent_kernel, &numbering.starts);
    term.set_step(Window::default());
    let mut residual = vec![0.0; numbering.n_dofs];
    term.add_residual(&setup.mesh, values, &mut residual).map_err(|e| e.to_string())?;
    let mut pattern = PatternBuilder::new(numbering.n_dofs, numbering.n_dofs);
    term.for_each_entity(|rows, columns| pattern.add_coupling(rows, columns));
    let mut tangent = Csr::zeros(pattern.build_shared().map_err(|e| e.to_string())?);
    term.locate(tangent.pattern(), &numbering.free);
    term.add_tangent(&setup.mesh, values, tangent.values_mut()).map_err(|e| e.to_string())?;
    Ok(Numbers { scalar, residual, tangent, starts: numbering.starts })
}

/// The integral of the density of an energy.
fn integral(
    setup: &Setup,
    integrator: &Integrator,
    kernel: &dyn wfl_compiler::backend::PointKernel,
    uniforms: &[f64],
    values: FieldValues<'_>,
) -> f64 {
    let bound = Bound { mesh: &setup.mesh, domain: &integrator.domain, binding: &integrator.binding };
    let mut workspace = Workspace::default();
    let mut sum = 0.0;
    for (g, group) in integrator.domain.groups.iter().enumerate() {
        for batch in 0..group.n_batches() {
            workspace.prepare(bound, g, batch, values);
            workspace.outputs.resize(group.n_points() * LANES, 0.0);
            kernel.run(uniforms, &workspace.inputs, &mut workspace.outputs, group.n_points());
            for lane in 0..LANES.min(group.entities.len() - batch * LANES) {
                for q in 0..group.n_points() {
                    sum += workspace.weight(q)[lane] * workspace.output(1, q, 0)[lane];
                }
            }
        }
    }
    sum
}
