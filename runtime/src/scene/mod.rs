//! From a resolved script to a problem ready to run: mesh, regions, fields, compiled terms, fixed values, outputs.
//!
//! Every stage reports all its problems; a later stage runs only where the earlier ones left what it needs. Nothing
//! is made that the scene does not use: a field in no term has no dofs, an expression in no output no kernel.

mod auto;
mod batch;
mod constants;
mod constraints;
mod context;
mod fields;
mod held;
mod mesh;
mod outputs;
mod quantities;
mod regions;
mod rest;
mod samples;
mod terms;

use std::{cell::Cell, collections::BTreeSet, path::Path, sync::Arc, time::Instant};

use wfl::{
    Diagnostic, Lost, ResolvedScript,
    ast::{OptionItem, OptionValue, Reduction},
};
use wfl_compiler::{
    Class, Constant, Env,
    backend::KernelBackend,
    compile_condition,
    ir::VerifiedKernel,
    types::{FieldKind, FieldSig, InputSlot},
};

use crate::{
    assemble::{AssembledTerm, Binding, Domain, Integrator, LawSlots, tangent_kernel},
    field::Field,
    mesh::{Mesh, Topology},
    newton::{NewtonOptions, TermPieces},
    system::{Known, Numbering, System},
    value::{Sampled, Value},
};

use batch::Batch;
pub use constraints::Prescribed;
pub use held::Printed;
pub use outputs::{CsvOutput, VtkOutput};
pub use regions::{NamedRegion, Regions};
pub use samples::{SampleAt, Samples};
pub use terms::RuleChoice;

/// A quantity printed and reported at each step.
pub struct Measure {
    /// Its name.
    pub name: String,
    /// What is done with the values at the points.
    pub reduction: Reduction,
    parts: Vec<(Value, Sampled)>,
}

/// Load or time steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Steps {
    /// The name of the variable; `None` for a single solve.
    pub variable: Option<String>,
    /// Its values.
    pub values: Vec<f64>,
    /// Go on after a step that did not converge.
    pub go_on: bool,
    /// How often the increment of a step that does not converge may be halved.
    pub halve: u32,
}

/// Halvings where the scene does not say how many: the smallest part is then 1/32 of an increment.
const DEFAULT_HALVE: u32 = 5;
/// Most halvings that can be asked for.
const MAX_HALVE: f64 = 30.0;

/// Seconds spent while preparing.
#[derive(Clone, Copy, Debug, Default)]
pub struct PrepareTimes {
    /// Graphs, tangents, kernels; machine code of terms, fixed values, measures and outputs.
    pub compile: f64,
    /// Mesh, regions, spaces, domains, and where outputs are sampled.
    pub mesh: f64,
}

/// One line of `wfl check` about a term.
#[derive(Clone, Debug)]
pub struct TermSummary {
    /// Its name.
    pub name: String,
    /// Its region.
    pub place: String,
    /// How it depends on the unknowns.
    pub class: Class,
    /// Symmetric tangent.
    pub symmetric: bool,
    /// The rule of its region.
    pub rule: RuleChoice,
    /// Points of that rule in the largest group.
    pub n_points: usize,
    /// Instructions of its residual and tangent kernels.
    pub instructions: (usize, usize),
}

/// A problem ready to run.
pub struct Scene {
    /// The discrete problem.
    pub system: System,
    /// Facets and edges of the mesh.
    pub topology: Topology,
    /// Regions by name.
    pub regions: Regions,
    /// The load or time steps.
    pub steps: Steps,
    /// Prescribed values.
    pub prescribed: Vec<Prescribed>,
    /// First guesses: field and value.
    pub starts: Vec<(usize, Value)>,
    /// Known fields given by expressions: field and value.
    pub data: Vec<(usize, Value)>,
    /// Quantities to report.
    pub measures: Vec<Measure>,
    /// What terms print.
    pub prints: Vec<Printed>,
    /// VTU series.
    pub vtk: Vec<VtkOutput>,
    /// Line samples.
    pub csv: Vec<CsvOutput>,
    /// Newton options.
    pub newton: NewtonOptions,
    /// Parameters in order of declaration.
    pub params: Vec<(String, Constant)>,
    /// One entry a term.
    pub terms: Vec<TermSummary>,
    /// What the compiler knows of the fields.
    pub sigs: Vec<FieldSig>,
    /// Where the time went.
    pub times: PrepareTimes,
    /// Fields that no term uses.
    pub unused_fields: Vec<String>,
    env: OwnedEnv,
}

/// What is needed to compile more expressions after preparation (`expect`).
struct OwnedEnv {
    params: std::collections::BTreeMap<String, Constant>,
    expansions: wfl::ast::Expansions,
    expects: Vec<wfl::Expect>,
    dim: usize,
}

/// A scene and every message; no scene after an error.
pub struct Prepared {
    /// The scene.
    pub scene: Option<Scene>,
    /// Errors and warnings.
    pub diagnostics: Vec<Diagnostic>,
}

/// Prepares a scene. `folder` is where its mesh and data files are. A script with errors of its own gives no scene, but
/// the messages of everything that can still be checked.
#[must_use]
pub fn prepare(script: &ResolvedScript, folder: &Path, backend: &dyn KernelBackend) -> Prepared {
    if script.params.iter().any(auto::is_auto) {
        return auto::prepare(script, folder, backend);
    }
    prepare_as_written(script, folder, backend)
}

fn prepare_as_written(script: &ResolvedScript, folder: &Path, backend: &dyn KernelBackend) -> Prepared {
    let mut diagnostics = Vec::new();
    let (mut lost, mut dim) = (script.lost.clone(), None);
    let scene = prepare_all(script, folder, backend, (&mut diagnostics, &mut lost, &mut dim));
    if scene.is_none() || !lost.is_empty() {
        rest::rest(script, dim, &mut lost, &mut diagnostics);
        diagnostics.retain(|d| !lost.explains(d));
    }
    context::add(script, &mut diagnostics);
    once_per_place(&mut diagnostics);
    let failed = diagnostics.iter().any(Diagnostic::is_error) || !lost.is_empty();
    Prepared { scene: if failed { None } else { scene }, diagnostics }
}

/// A mistake in a macro is told once, at its first use, however often the macro is used.
fn once_per_place(diagnostics: &mut Vec<Diagnostic>) {
    let mut seen: Vec<(&'static str, String, Vec<wfl::Span>)> = Vec::new();
    diagnostics.retain(|d| {
        let spans: Vec<wfl::Span> = d.labels.iter().map(|l| l.span).collect();
        let in_macro = d.labels.first().is_some_and(|l| l.text.starts_with("in this use of"));
        let key = (d.code, d.message.clone(), spans[usize::from(in_macro && spans.len() > 1)..].to_vec());
        let new = !seen.contains(&key);
        if new {
            seen.push(key);
        }
        new
    });
}

fn prepare_all(
    script: &ResolvedScript,
    folder: &Path,
    backend: &dyn KernelBackend,
    (diagnostics, lost, dim): (&mut Vec<Diagnostic>, &mut Lost, &mut Option<usize>),
) -> Option<Scene> {
    let begin = Instant::now();
    let read = mesh::read(script, folder, diagnostics);
    let params = constants::parameters(script, mesh::dimension(script, read.as_ref()), diagnostics);
    for param in script.params.iter().filter(|p| !params.contains_key(&p.name.name)) {
        lost.add(&param.name.name);
    }
    let mesh = mesh::mesh(script, read, &params, backend, diagnostics)?;
    *dim = Some(mesh.dim());
    let topology = match Topology::new(&mesh) {
        Ok(t) => t,
        Err(e) => {
            let span = script.mesh.as_ref()?.span;
            diagnostics.push(mesh::mesh_error(&e, span));
            return None;
        }
    };
    let regions = regions::RegionMaker {
        script,
        mesh: &mesh,
        topology: &topology,
        params: &params,
        backend,
        diagnostics: &mut *diagnostics,
        regions: Regions::new(),
    }
    .make();
    for region in script.regions.iter().filter(|r| !regions.contains_key(&r.name.name)) {
        lost.add(&region.name.name);
    }
    let bare = Env { dim: mesh.dim(), ..constants::bare_env(script, mesh.dim(), &params) };
    let fields::Fields { fields, sigs } = fields::fields(script, &bare, &mesh, &topology, &regions, diagnostics)?;
    let mesh_time = begin.elapsed().as_secs_f64();
    let variable = script.steps.as_ref().map(|s| s.variable.name.clone());
    let env = Env { fields: &sigs, step_variable: variable.as_deref(), ..bare };
    let batch = Batch::new(backend);
    Builder {
        script,
        env: &env,
        mesh,
        topology,
        regions,
        fields,
        sigs: &sigs,
        batch: &batch,
        diagnostics,
        params: &params,
        mesh_time,
        prints: Vec::new(),
    }
    .build()
}

struct Builder<'a> {
    script: &'a ResolvedScript,
    env: &'a Env<'a>,
    mesh: Mesh,
    topology: Topology,
    regions: Regions,
    fields: Vec<Field>,
    sigs: &'a [FieldSig],
    batch: &'a Batch<'a>,
    diagnostics: &'a mut Vec<Diagnostic>,
    params: &'a std::collections::BTreeMap<String, Constant>,
    mesh_time: f64,
    prints: Vec<Printed>,
}

impl Builder<'_> {
    fn build(mut self) -> Option<Scene> {
        let begin = Instant::now();
        let mut maker = terms::TermMaker {
            script: self.script,
            env: self.env,
            mesh: &self.mesh,
            regions: &self.regions,
            fields: &self.fields,
            diagnostics: &mut *self.diagnostics,
        };
        let laws = maker.make();
        let rules = maker.rules(&laws);
        let compile_terms = begin.elapsed().as_secs_f64();

        let begin = Instant::now();
        let used: BTreeSet<usize> = laws.iter().flat_map(|l| used_fields(&l.law)).collect();
        let known_kind = |f: &Field| matches!(f.kind, FieldKind::Unknown | FieldKind::Multiplier);
        let position = |f: &Field, all: &[Field]| all.iter().position(|g| g.name == f.name).unwrap_or(usize::MAX);
        let mut numbering =
            Numbering::new(&self.fields, |f| known_kind(f) && used.contains(&position(f, &self.fields)));
        let prescribed = self.constraints(&mut numbering);
        let broken = !self.script.lost.is_empty() || self.diagnostics.iter().any(Diagnostic::is_error);
        let assembled = if broken { None } else { self.assemble_terms(laws, &rules, &numbering) };
        let mesh_time = self.mesh_time + begin.elapsed().as_secs_f64();

        let begin = Instant::now();
        let steps = self.steps();
        let newton = self.newton_options();
        let starts = self.starts();
        let data = self.data();
        let measures = self.measures(&rules);
        rest::expects(self.script, self.params, self.env.dim, self.diagnostics);
        if assembled.is_none() || self.diagnostics.iter().any(Diagnostic::is_error) {
            self.outputs();
            return None;
        }
        let (terms, summaries, pieces) = assembled?;
        let compile_values = begin.elapsed().as_secs_f64();

        let begin = Instant::now();
        let (vtk, csv, compile_outputs) = self.outputs();
        let mesh_time = mesh_time + begin.elapsed().as_secs_f64() - compile_outputs;

        let begin = Instant::now();
        if let Err(e) = self.batch.finish() {
            self.diagnostics.push(Diagnostic::new("E609", e.to_string()));
        }
        let compile = compile_terms + compile_values + compile_outputs + begin.elapsed().as_secs_f64();
        if self.diagnostics.iter().any(Diagnostic::is_error) {
            return None;
        }
        let past = terms.iter().any(|t| t.law.inputs.iter().any(|s| matches!(s, InputSlot::Previous(_))));
        let known = Known {
            data: self.fields.iter().map(|f| if known_kind(f) { Vec::new() } else { vec![0.0; f.n_dofs()] }).collect(),
            previous: past.then(|| vec![0.0; numbering.n_dofs]),
        };
        let unused_fields =
            (0..self.fields.len()).filter(|k| !used.contains(k)).map(|k| self.fields[k].name.clone()).collect();
        let mut system = match System::new(self.mesh, self.fields, numbering, terms, known) {
            Ok(s) => s,
            Err(e) => {
                self.diagnostics.push(Diagnostic::new("E412", e.to_string()));
                return None;
            }
        };
        if let Err(e) = system.hold(pieces) {
            self.diagnostics.push(Diagnostic::new("E412", e.to_string()));
            return None;
        }
        let params = self.script.params.iter();
        let params =
            params.filter_map(|p| Some((p.name.name.clone(), self.params.get(&p.name.name)?.clone()))).collect();
        Some(Scene {
            system,
            topology: self.topology,
            regions: self.regions,
            steps: steps?,
            prescribed,
            starts,
            data,
            measures,
            prints: self.prints,
            vtk,
            csv,
            newton,
            params,
            terms: summaries,
            sigs: self.sigs.to_vec(),
            times: PrepareTimes { compile, mesh: mesh_time },
            unused_fields,
            env: OwnedEnv {
                params: self.params.clone(),
                expansions: self.script.expansions.clone(),
                expects: self.script.expects.clone(),
                dim: self.env.dim,
            },
        })
    }

    /// Files and line samples, with the seconds spent on their laws.
    fn outputs(&mut self) -> (Vec<VtkOutput>, Vec<CsvOutput>, f64) {
        let mut maker = outputs::OutputMaker {
            script: self.script,
            env: self.env,
            mesh: &self.mesh,
            topology: &self.topology,
            regions: &self.regions,
            fields: &self.fields,
            backend: self.batch,
            diagnostics: &mut *self.diagnostics,
            law_seconds: Cell::new(0.0),
        };
        let (vtk, csv) = outputs::outputs(&mut maker);
        (vtk, csv, maker.law_seconds.get())
    }

    fn constraints(&mut self, numbering: &mut Numbering) -> Vec<Prescribed> {
        let prescribed = constraints::ConstraintMaker {
            script: self.script,
            env: self.env,
            mesh: &self.mesh,
            topology: &self.topology,
            regions: &self.regions,
            fields: &self.fields,
            numbering: &*numbering,
            backend: self.batch,
            diagnostics: &mut *self.diagnostics,
        }
        .make();
        let fixed: BTreeSet<usize> = prescribed.iter().flat_map(|p| p.dofs.iter().copied()).collect();
        let idle = constraints::idle_multipliers(
            self.script,
            &self.mesh,
            &self.topology,
            &self.fields,
            numbering,
            &fixed,
            self.diagnostics,
        );
        numbering.fix(fixed.into_iter().chain(idle));
        prescribed
    }

    fn assemble_terms(
        &mut self,
        laws: Vec<terms::PlacedLaw>,
        rules: &terms::Rules,
        numbering: &Numbering,
    ) -> Option<(Vec<AssembledTerm>, Vec<TermSummary>, Vec<TermPieces>)> {
        let tangents: Vec<[Option<VerifiedKernel>; 2]> = laws
            .iter()
            .map(|l| [tangent_kernel(&l.law), l.pieces.as_ref().and_then(|p| tangent_kernel(&p.law))])
            .collect();
        let kernels: Vec<&VerifiedKernel> = laws
            .iter()
            .zip(&tangents)
            .flat_map(|(l, [tangent, held])| {
                let residual = l.pieces.as_ref().map(|p| &p.law.residual);
                std::iter::once(&l.law.residual).chain(tangent).chain(residual).chain(held)
            })
            .collect();
        let compiled = match self.batch.compile(&kernels) {
            Ok(k) => k,
            Err(e) => {
                self.diagnostics.push(Diagnostic::new("E609", e.to_string()));
                return None;
            }
        };
        let mut compiled = compiled.into_iter();
        let mut domains: Vec<(String, Option<crate::mesh::RegionSet>, Arc<Domain>)> = Vec::new();
        let (mut terms, mut summaries, mut complete) = (Vec::new(), Vec::new(), true);
        let mut pieces: Vec<TermPieces> = Vec::new();
        for (placed, [tangent, held_tangent]) in laws.into_iter().zip(&tangents) {
            let residual = compiled.next()?;
            let tangent = tangent.as_ref().and_then(|_| compiled.next());
            let held = match placed.pieces {
                Some(_) => Some((compiled.next()?, held_tangent.as_ref().and_then(|_| compiled.next()))),
                None => None,
            };
            let choice = rules.get(&placed.place).copied().unwrap_or(RuleChoice::Degree(1));
            let shared = domains.iter().find(|(p, s, _)| *p == placed.place && *s == placed.set).map(|d| d.2.clone());
            let domain = shared.or_else(|| {
                let made = terms::domain(
                    &self.mesh,
                    &self.fields,
                    placed.set.as_ref(),
                    choice,
                    placed.span,
                    self.diagnostics,
                )?;
                domains.push((placed.place.clone(), placed.set.clone(), made.clone()));
                Some(made)
            });
            let Some(domain) = domain else {
                complete = false;
                continue;
            };
            let slots = LawSlots { inputs: &placed.law.inputs, tests: &placed.law.tests, trials: &placed.law.trials };
            match Binding::new(&self.mesh, &domain, &self.fields, slots) {
                Ok(binding) => {
                    summaries.push(TermSummary {
                        name: placed.law.name.clone(),
                        place: placed.place.clone(),
                        class: placed.law.class,
                        symmetric: placed.law.symmetric,
                        rule: choice,
                        n_points: domain.groups.iter().map(|g| g.weights.len()).max().unwrap_or(0),
                        instructions: (
                            placed.law.residual.kernel().insts.len(),
                            placed.law.tangent.kernel().insts.len(),
                        ),
                    });
                    let integrator = Integrator { domain, binding };
                    let place = placed.set.as_ref().and_then(outputs::facet_support);
                    for print in placed.prints {
                        match self.print(print, &placed.law.name, &integrator.domain) {
                            Ok(made) => self.prints.push(made),
                            Err(e) => self.diagnostics.push(Diagnostic::new("E609", e)),
                        }
                    }
                    if let (Some(law), Some(kernels)) = (placed.pieces, held) {
                        match self.hold(law, kernels, &integrator.domain, terms.len(), numbering) {
                            Ok(made) => pieces.push(made),
                            Err(e) => self.diagnostics.push(Diagnostic::new("E609", e)),
                        }
                    }
                    terms.push(AssembledTerm::new(placed.law, integrator, place, residual, tangent, &numbering.starts));
                }
                Err(e) => {
                    self.diagnostics.push(Diagnostic::new("E202", e.to_string()).at(placed.span, ""));
                    complete = false;
                }
            }
        }
        complete.then_some((terms, summaries, pieces))
    }

    fn steps(&mut self) -> Option<Steps> {
        let Some(steps) = &self.script.steps else {
            return Some(Steps { variable: None, values: vec![0.0], go_on: false, halve: DEFAULT_HALVE });
        };
        let [a, b, c] = [(&steps.from, "the first value"), (&steps.to, "the last value"), (&steps.by, "the step")]
            .map(|(e, what)| constants::number(self.env, what, e, self.diagnostics));
        let (from, to, by) = (a?, b?, c?);
        let count = ((to - from) / by).round();
        if by == 0.0 || !count.is_finite() || !(0.0..=1e7).contains(&count) {
            let d = Diagnostic::new("E413", format!("steps from {from} to {to} by {by} never arrive"));
            self.diagnostics.push(d.at(steps.by.span, ""));
            return None;
        }
        let (mut go_on, mut halve) = (false, DEFAULT_HALVE);
        for option in &steps.options {
            match (option.name.name.as_str(), self.option_number(option), word(option)) {
                ("on_fail", _, Some("go_on")) => go_on = true,
                ("on_fail", _, Some("stop")) => go_on = false,
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked in the guard")]
                ("halve", Some(n), _) if n.fract() == 0.0 && (0.0..=MAX_HALVE).contains(&n) => halve = n as u32,
                (name, _, _) => self.bad_option(option, name, "halve=0 to halve=30, on_fail=stop, on_fail=go_on"),
            }
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "bounded above"
        )]
        let values = (0..=count as usize)
            .map(|k| if k as f64 == count { from + count * by } else { from + k as f64 * by })
            .collect();
        Some(Steps { variable: Some(steps.variable.name.clone()), values, go_on, halve })
    }

    fn bad_option(&mut self, option: &OptionItem, name: &str, known: &str) {
        let d = Diagnostic::new("E414", format!("option `{name}` is not understood here"));
        self.diagnostics.push(d.at(option.name.span, format!("known: {known}")));
    }

    /// The number given to an option, if it is one.
    fn option_number(&mut self, option: &OptionItem) -> Option<f64> {
        match &option.value {
            Some(OptionValue::Expr(e)) if word(option).is_none() => {
                constants::number(self.env, "an option", e, self.diagnostics)
            }
            _ => None,
        }
    }

    fn newton_options(&mut self) -> NewtonOptions {
        let mut options = NewtonOptions::default();
        let Some(solver) = &self.script.solver else { return options };
        for option in &solver.options {
            match (option.name.name.as_str(), self.option_number(option), word(option)) {
                ("tol", Some(t), _) if t >= 0.0 => options.tolerance = t,
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked in the guard")]
                ("max_iter", Some(n), _) if n >= 1.0 && n.fract() == 0.0 && n < 1e6 => {
                    options.max_iterations = n as usize;
                }
                ("search", _, Some("auto")) => options.search = true,
                ("search", _, Some("none")) => options.search = false,
                (name, _, _) => self.bad_option(option, name, "tol=1e-10, max_iter=50, search=auto, search=none"),
            }
        }
        options
    }
}

fn word(option: &OptionItem) -> Option<&str> {
    match &option.value {
        Some(OptionValue::Expr(e)) => match &e.kind {
            wfl::ast::ExprKind::Name(n) => Some(n),
            _ => None,
        },
        Some(OptionValue::Text(t, _)) => Some(t),
        None => None,
    }
}

fn used_fields(law: &wfl_compiler::TermLaw) -> Vec<usize> {
    let inputs = law.inputs.iter().filter_map(|s| match s {
        InputSlot::Field(b) | InputSlot::Previous(b) => Some(b.field.index()),
        _ => None,
    });
    law.tests.iter().chain(&law.trials).map(|s| s.field.index()).chain(inputs).collect()
}

impl Scene {
    /// The `expect` conditions with measures at their last values: the condition and whether it holds; `None` for
    /// one that cannot be evaluated.
    #[must_use]
    pub fn expectations(&self, measures: &[(String, f64)]) -> (Vec<(wfl::Expect, Option<bool>)>, Vec<Diagnostic>) {
        let mut params = self.env.params.clone();
        for (name, value) in measures {
            let constant = Constant { shape: wfl_compiler::types::Shape::SCALAR, values: vec![*value], declared: None };
            params.insert(name.clone(), constant);
        }
        let env = Env {
            dim: self.env.dim,
            fields: &[],
            params: &params,
            expansions: &self.env.expansions,
            step_variable: None,
            equal_within: 0.0,
        };
        let place = fields::global_place(0);
        let mut diagnostics = Vec::new();
        let mut out = Vec::new();
        for expect in &self.env.expects {
            let law = compile_condition(&env, &place, "expect", &expect.condition);
            diagnostics.extend(law.diagnostics);
            let holds = law.value.filter(|l| l.inputs.is_empty()).map(|law| {
                let mut value = [0.0];
                wfl_compiler::interpret(
                    &law.kernel,
                    &wfl_compiler::run_prologue(&law.prologue, &[]),
                    &[],
                    &mut Vec::new(),
                    &mut value,
                );
                value[0] == 1.0
            });
            out.push((expect.clone(), holds));
        }
        (out, diagnostics)
    }
}
