//! From a resolved script to a problem ready to run: mesh, regions, fields, compiled terms, fixed values, outputs.
//!
//! Every stage reports all its problems; a later stage runs only where the earlier ones left what it needs. Nothing
//! is made that the scene does not use: a field in no term has no dofs, an expression in no output no kernel.

mod auto;
mod batch;
mod constants;
mod constraints;
mod context;
mod coverage;
mod data;
mod effects;
mod expects;
mod fields;
mod groups;
mod held;
mod idle;
mod inputs;
mod low_rules;
mod mappings;
mod meeting;
mod mesh;
mod method;
mod normals;
mod options;
mod outputs;
mod point_loads;
mod quantities;
mod regions;
mod rest;
mod samples;
mod states;
mod terms;

use std::{
    cell::Cell,
    collections::{BTreeSet, HashSet},
    path::Path,
    sync::Arc,
    time::Instant,
};

use wfl::{Diagnostic, Lost, ResolvedScript, ast::Reduction};
use wfl_compiler::{
    Class, Constant, Env,
    backend::KernelBackend,
    compile_condition,
    ir::VerifiedKernel,
    types::{FieldKind, FieldSig, InputSlot, MappingSig, UniformSlot},
};

use crate::{
    assemble::{AssembledTerm, Binding, Domain, Integrator, LawSlots, tangent_kernel},
    contact::{Contact, ContactTerm},
    csr::CsrError,
    field::Field,
    mesh::{Mesh, RegionSet, Topology},
    newton::NewtonOptions,
    pruning::Pruning,
    results::SampledPiece,
    system::{FrozenTerm, Known, Numbering, Past, System},
    value::{Sampled, Value},
};

use batch::Batch;
pub use constraints::Prescribed;
pub use data::{coercivity, contact_forms, negative_bodies};
pub(crate) use data::{node_positions, set_data};
pub use held::Printed;
pub use inputs::InputFile;
pub use mesh::SceneBox;
pub use options::Steps;
pub(crate) use outputs::is_written;
pub use outputs::{CsvOutput, VtkOutput, n_files};
pub use quantities::Given;
pub use regions::{NamedRegion, Regions};
pub use samples::{SampleAt, Samples};
pub use states::StateUpdate;
pub use terms::RuleChoice;

/// A quantity printed and reported at each step.
pub struct Measure {
    /// Its name.
    pub name: String,
    /// What is done with the values at the points.
    pub reduction: Reduction,
    parts: Vec<(Value, Sampled)>,
    span: wfl::Span,
}

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
    /// The laws of contact, and the state they are in.
    pub contact: Contact,
    /// Facets and edges of the mesh.
    pub topology: Topology,
    /// Regions by name.
    pub regions: Regions,
    /// The load or time steps.
    pub steps: Steps,
    /// Prescribed values.
    pub prescribed: Prescribed,
    /// First guesses: field and value.
    pub starts: Vec<(usize, Given)>,
    /// Known fields: field and values.
    pub data: Vec<(usize, Given)>,
    /// Fields that are renewed after each step.
    pub states: Vec<StateUpdate>,
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
    /// The demanded relative error, and its quantity.
    pub accuracy: Option<(f64, String)>,
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
    /// The files that were read for it.
    pub inputs: Vec<InputFile>,
    /// Multipliers that have nodes without a jump by the mesh alone, and why.
    pub(crate) idle: Vec<(String, String)>,
    /// Words in expressions of terms.
    pub(crate) in_terms: BTreeSet<String>,
    env: OwnedEnv,
}

/// What is needed to compile more expressions after preparation (`expect`).
struct OwnedEnv {
    params: std::collections::BTreeMap<String, Constant>,
    mappings: Vec<MappingSig>,
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
    prepare_keeping(script, folder, backend, &[])
}

/// [`prepare`], and what is listed is done although the scene does not need it.
#[must_use]
pub fn prepare_keeping(
    script: &ResolvedScript,
    folder: &Path,
    backend: &dyn KernelBackend,
    keep: &[Pruning],
) -> Prepared {
    let with = With { folder, backend, keep };
    if script.params.iter().any(auto::is_auto) {
        return auto::prepare(script, with);
    }
    prepare_as_written(script, with)
}

/// What a scene is prepared with beside its script.
#[derive(Clone, Copy)]
struct With<'a> {
    folder: &'a Path,
    backend: &'a dyn KernelBackend,
    keep: &'a [Pruning],
}

fn prepare_as_written(script: &ResolvedScript, with: With<'_>) -> Prepared {
    let mut diagnostics = Vec::new();
    let (mut lost, mut dim) = (script.lost.clone(), None);
    let scene = prepare_all(script, with, (&mut diagnostics, &mut lost, &mut dim));
    if scene.is_none() || !lost.is_empty() {
        rest::rest(script, dim, &mut lost, &mut diagnostics);
        diagnostics.retain(|d| !lost.explains(d));
    }
    context::add(script, &mut diagnostics);
    once_per_place(&mut diagnostics);
    let failed = diagnostics.iter().any(Diagnostic::is_error) || !lost.is_empty();
    Prepared { scene: if failed { None } else { scene }, diagnostics }
}

/// A mistake in a macro gives one message, at its first use.
fn once_per_place(diagnostics: &mut Vec<Diagnostic>) {
    let mut seen: HashSet<(&'static str, String, Vec<wfl::Span>)> = HashSet::new();
    diagnostics.retain(|d| {
        let spans: Vec<wfl::Span> = d.labels.iter().map(|l| l.span).collect();
        let in_macro = d.labels.first().is_some_and(|l| l.text.starts_with("in this use of"));
        let key = (d.code, d.message.clone(), spans[usize::from(in_macro && spans.len() > 1)..].to_vec());
        seen.insert(key)
    });
}

fn prepare_all(
    script: &ResolvedScript,
    with: With<'_>,
    (diagnostics, lost, dim): (&mut Vec<Diagnostic>, &mut Lost, &mut Option<usize>),
) -> Option<Scene> {
    let begin = Instant::now();
    let With { folder, backend, keep } = with;
    let mut inputs = Vec::new();
    let read = mesh::read(script, folder, &mut inputs, diagnostics);
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
    let named = script.regions.iter().map(|r| &r.name).chain(&script.groups);
    for name in named.filter(|n| !regions.contains_key(&n.name)) {
        lost.add(&name.name);
    }
    let bare = Env { dim: mesh.dim(), ..constants::bare_env(script, mesh.dim(), &params) };
    let fields::Fields { fields, sigs } = fields::fields(script, &bare, &mesh, &topology, &regions, diagnostics)?;
    let made = mappings::MappingMaker {
        script,
        env: &Env { fields: &sigs, ..bare },
        mesh: &mesh,
        regions: &regions,
        fields: &fields,
        backend,
        diagnostics: &mut *diagnostics,
    }
    .make();
    for mapping in script.mappings.iter().filter(|m| made.sigs.iter().all(|s| s.name != m.name.name)) {
        lost.add(&mapping.name.name);
    }
    let mesh_time = begin.elapsed().as_secs_f64();
    let variable = script.steps.as_ref().map(|s| s.variable.name.clone());
    let env = Env { fields: &sigs, mappings: &made.sigs, step_variable: variable.as_deref(), ..bare };
    let batch = Batch::new(backend);
    Builder {
        script,
        folder,
        env: &env,
        mesh,
        topology,
        regions,
        fields,
        mappings: &made,
        sigs: &sigs,
        batch: &batch,
        diagnostics,
        params: &params,
        mesh_time,
        prints: Vec::new(),
        inputs,
        keep,
    }
    .build()
}

/// A matrix that cannot be made.
fn structure_error(script: &ResolvedScript, error: CsrError) -> Diagnostic {
    match (error, &script.mesh) {
        (CsrError::TooMuchMemory(need), Some(statement)) => mesh::too_much_memory(&need, statement.span),
        (error, _) => Diagnostic::new("E412", error.to_string()),
    }
}

/// Words in the expressions of terms.
fn names_in_terms(script: &ResolvedScript) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for term in &script.terms {
        wfl::each_name(&term.expr, &mut |n| {
            names.insert(n.to_owned());
        });
    }
    names
}

/// The terms of a scene, made.
struct Assembled {
    terms: Vec<AssembledTerm>,
    summaries: Vec<TermSummary>,
    contact: Vec<(FrozenTerm, ContactTerm)>,
}

/// Where a law is integrated: the name, the entities, and the mapping it reads through with the fields it reads there.
type Place = (String, Option<RegionSet>, Option<(usize, Vec<usize>)>);

struct Builder<'a> {
    script: &'a ResolvedScript,
    folder: &'a Path,
    env: &'a Env<'a>,
    mesh: Mesh,
    topology: Topology,
    regions: Regions,
    fields: Vec<Field>,
    mappings: &'a mappings::Mappings,
    sigs: &'a [FieldSig],
    batch: &'a Batch<'a>,
    diagnostics: &'a mut Vec<Diagnostic>,
    params: &'a std::collections::BTreeMap<String, Constant>,
    mesh_time: f64,
    prints: Vec<Printed>,
    inputs: Vec<InputFile>,
    keep: &'a [Pruning],
}

impl Builder<'_> {
    fn build(mut self) -> Option<Scene> {
        let begin = Instant::now();
        let (laws, renewed, rules) = self.laws();
        coverage::check(self.script.mesh.as_ref(), &self.mesh, &laws, self.diagnostics);
        let compile_terms = begin.elapsed().as_secs_f64();

        let begin = Instant::now();
        let used: BTreeSet<usize> = laws.iter().flat_map(|l| used_fields(&l.law)).collect();
        let (rates, past_in_laws) = histories(&laws, &renewed);
        let states = self.state_updates(renewed, &rules);
        let mut numbering = self.numbering(&used);
        let mut prescribed = self.constraints(&mut numbering, &laws, &used);
        let broken = !self.script.lost.is_empty() || self.diagnostics.iter().any(Diagnostic::is_error);
        if !broken {
            self.effects(&laws, &prescribed, &numbering);
            self.read_but_in_no_term(&numbering);
        }
        let assembled = if broken { None } else { self.assemble_terms(laws, &rules, &numbering) };
        let mesh_time = self.mesh_time + begin.elapsed().as_secs_f64();

        let begin = Instant::now();
        let steps = self.steps(rates);
        let (newton, accuracy) = self.solver_options();
        let starts = self.starts();
        let given = self.data();
        let measures = self.measures(&rules);
        rest::expects(self.script, self.params, self.env.dim, self.diagnostics);
        if assembled.is_none() || self.diagnostics.iter().any(Diagnostic::is_error) {
            self.outputs(&rules);
            return None;
        }
        let Assembled { terms, summaries, contact } = assembled?;
        let compile_values = begin.elapsed().as_secs_f64();

        let begin = Instant::now();
        let (vtk, csv, compile_outputs) = self.outputs(&rules);
        let mesh_time = mesh_time + begin.elapsed().as_secs_f64() - compile_outputs;

        let begin = Instant::now();
        if let Err(e) = self.batch.finish() {
            self.diagnostics.push(Diagnostic::new("E609", e.to_string()));
        }
        let compile = compile_terms + compile_values + compile_outputs + begin.elapsed().as_secs_f64();
        if self.diagnostics.iter().any(Diagnostic::is_error) {
            return None;
        }
        let reads_past = past_in_laws
            || measures.iter().any(Measure::reads_past)
            || vtk.iter().flat_map(|v| &v.pieces).any(SampledPiece::reads_past)
            || csv.iter().any(|c| c.line.reads_past());
        let steps = steps?;
        self.statements_without_effect(&numbering, &mut prescribed, &steps, reads_past || rates)?;
        let known = nothing_known(&self.fields, &numbering, reads_past);
        let left_out =
            |k: &usize| !used.contains(k) && numbering.starts[*k].is_none() && self.fields[*k].kind != FieldKind::State;
        let unused_fields = (0..self.fields.len()).filter(left_out).map(|k| self.fields[k].name.clone()).collect();
        let env = self.owned_env();
        let made = System::new(self.mesh, self.fields, numbering, terms, known).and_then(|mut system| {
            self.keep.iter().for_each(|pruning| system.keep(*pruning));
            let (frozen, contact): (Vec<FrozenTerm>, Vec<ContactTerm>) = contact.into_iter().unzip();
            system.add_frozen(frozen)?;
            let mut contact = Contact::new(contact);
            // the step that multipliers are looked at in
            system.set_laws(within(&steps), 1.0);
            contact.begin_step(within(&steps), 1.0);
            let idle = idle::leave_out(self.script, &self.topology, &mut system, &contact, self.diagnostics)?;
            Ok((system, contact, idle))
        });
        let (system, contact, idle) = match made {
            Ok(made) => made,
            Err(e) => {
                self.diagnostics.push(structure_error(self.script, e));
                return None;
            }
        };
        let params = self.script.params.iter();
        let params =
            params.filter_map(|p| Some((p.name.name.clone(), self.params.get(&p.name.name)?.clone()))).collect();
        Some(Scene {
            system,
            contact,
            topology: self.topology,
            regions: self.regions,
            steps,
            prescribed,
            starts,
            data: given,
            states,
            measures,
            prints: self.prints,
            vtk,
            csv,
            newton,
            accuracy,
            params,
            terms: summaries,
            sigs: self.sigs.to_vec(),
            times: PrepareTimes { compile, mesh: mesh_time },
            unused_fields,
            inputs: self.inputs,
            idle: idle.notes,
            in_terms: names_in_terms(self.script),
            env,
        })
    }

    /// What conditions need when a run has ended.
    fn owned_env(&self) -> OwnedEnv {
        OwnedEnv {
            params: self.params.clone(),
            mappings: self.env.mappings.to_vec(),
            expansions: self.script.expansions.clone(),
            expects: self.script.expects.clone(),
            dim: self.env.dim,
        }
    }

    /// Dofs of the unknowns that a term uses; a field that is prescribed has its values although its terms are gone.
    fn numbering(&self, used: &BTreeSet<usize>) -> Numbering {
        let known_kind = |f: &Field| matches!(f.kind, FieldKind::Unknown | FieldKind::Multiplier);
        let position = |f: &Field| self.fields.iter().position(|g| g.name == f.name).unwrap_or(usize::MAX);
        let stated = |f: &Field| self.script.fixes.iter().flat_map(|c| &c.targets).any(|t| t.field.name == f.name);
        Numbering::new(&self.fields, |f| known_kind(f) && (used.contains(&position(f)) || stated(f)))
    }

    /// Tells of first values, steps and prescribed values that change nothing; `None` if one of them is an error.
    fn statements_without_effect(
        &mut self,
        numbering: &Numbering,
        prescribed: &mut Prescribed,
        steps: &Steps,
        has_past: bool,
    ) -> Option<()> {
        self.idle_starts(numbering, prescribed, has_past);
        self.idle_steps(steps, has_past);
        self.contradictions(prescribed, steps, numbering.n_dofs);
        self.nothing_to_solve(numbering, prescribed);
        (!self.diagnostics.iter().any(Diagnostic::is_error)).then_some(())
    }

    fn term_maker(&mut self) -> terms::TermMaker<'_> {
        terms::TermMaker {
            script: self.script,
            env: self.env,
            mesh: &self.mesh,
            regions: &self.regions,
            fields: &self.fields,
            diagnostics: &mut *self.diagnostics,
        }
    }

    /// What terms and updates of states are compiled to, and the rules of their places.
    fn laws(&mut self) -> (Vec<terms::PlacedLaw>, Vec<states::StateLaw>, terms::Rules) {
        let mut maker = self.term_maker();
        let laws = maker.make();
        let mut rules = maker.rules(&laws);
        let renewed = self.state_laws();
        self.share_rules(&laws, &renewed, &mut rules);
        (laws, renewed, rules)
    }

    /// Files and line samples, with the seconds spent on their laws.
    fn outputs(&mut self, rules: &terms::Rules) -> (Vec<VtkOutput>, Vec<CsvOutput>, f64) {
        let mut maker = outputs::OutputMaker {
            script: self.script,
            env: self.env,
            mesh: &self.mesh,
            topology: &self.topology,
            regions: &self.regions,
            fields: &self.fields,
            rules,
            backend: self.batch,
            diagnostics: &mut *self.diagnostics,
            law_seconds: Cell::new(0.0),
        };
        let (vtk, csv) = outputs::outputs(&mut maker);
        (vtk, csv, maker.law_seconds.get())
    }

    fn constraints(
        &mut self,
        numbering: &mut Numbering,
        laws: &[terms::PlacedLaw],
        used: &BTreeSet<usize>,
    ) -> Prescribed {
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
        let (fixed, components) = (prescribed.dofs(), prescribed.components());
        numbering.set_frames(prescribed.frames());
        let shared = meeting::shared_multipliers(
            self.script,
            (&self.mesh, &self.topology),
            (&self.fields, numbering),
            &components,
            laws,
            self.diagnostics,
        );
        let undetermined = self.undetermined(used, numbering, &fixed);
        numbering.fix(fixed.into_iter().chain(shared).chain(undetermined));
        prescribed
    }

    fn assemble_terms(
        &mut self,
        laws: Vec<terms::PlacedLaw>,
        rules: &terms::Rules,
        numbering: &Numbering,
    ) -> Option<Assembled> {
        let highest = laws.iter().map(|l| l.law.degree.rule()).max().unwrap_or(0);
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
        // an exact rule gives the same with more points; states have values at the points of their region's rule
        let raised = self.keep.contains(&Pruning::Quadrature) && self.fields.iter().all(|f| f.kind != FieldKind::State);
        let least = |law: &wfl_compiler::TermLaw| if raised && law.class <= Class::Linear { highest } else { 0 };
        let mut domains: Vec<((Place, RuleChoice), Arc<Domain>)> = Vec::new();
        let (mut terms, mut summaries, mut complete) = (Vec::new(), Vec::new(), true);
        let mut contact: Vec<(FrozenTerm, ContactTerm)> = Vec::new();
        for (placed, [tangent, held_tangent]) in laws.into_iter().zip(&tangents) {
            let residual = compiled.next()?;
            let tangent = tangent.as_ref().and_then(|_| compiled.next());
            let held = match placed.pieces {
                Some(_) => Some((compiled.next()?, held_tangent.as_ref().and_then(|_| compiled.next()))),
                None => None,
            };
            let choice = match rules.get(&placed.place).copied().unwrap_or(RuleChoice::Degree(1)) {
                RuleChoice::Degree(degree) => RuleChoice::Degree(degree.max(least(&placed.law))),
                nodes @ RuleChoice::Vertex => nodes,
            };
            let choice = if placed.at_nodes.is_some() { RuleChoice::Vertex } else { choice };
            let slots = LawSlots { inputs: &placed.law.inputs, tests: &placed.law.tests, trials: &placed.law.trials };
            let there = mappings::fields_there(slots.inputs, slots.tests.iter().chain(slots.trials));
            let mapping = placed.law.listing.graph.mapping.map(|m| (m, there));
            let place = ((placed.place.clone(), placed.set.clone(), mapping), choice);
            let shared = domains.iter().find(|d| d.0 == place).map(|d| d.1.clone());
            let domain = placed.at_nodes.clone().or(shared).or_else(|| {
                let made = self.domain(&place.0, choice, placed.span)?;
                domains.push((place, made.clone()));
                Some(made)
            });
            let Some(domain) = domain else {
                complete = false;
                continue;
            };
            low_rules::check(self.script, &placed, &domain, &self.fields, self.diagnostics);
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
                        let frozen = held::Frozen { term: terms.len(), position: contact.len() };
                        match self.freeze(law, kernels, &integrator.domain, frozen, numbering) {
                            Ok(made) => contact.push(made),
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
        complete.then_some(Assembled { terms, summaries, contact })
    }

    /// The points of a place, with images where a mapping is read through; `None` after a message.
    fn domain(&mut self, place: &Place, choice: RuleChoice, span: wfl::Span) -> Option<Arc<Domain>> {
        let (_, set, mapping) = place;
        let base = terms::domain(&self.mesh, &self.fields, set.as_ref(), choice, span, self.diagnostics)?;
        match mapping {
            None => Some(base),
            Some(at) => self.mappings.domain(at, &self.mesh, &self.fields, &base, span, self.diagnostics),
        }
    }
}

/// A value of the step variable between the first and the last, where little vanishes that does at an end.
fn within(steps: &Steps) -> f64 {
    let (first, last) = (steps.values.first().copied().unwrap_or(0.0), steps.values.last().copied().unwrap_or(0.0));
    first + 0.618 * (last - first)
}

fn used_fields(law: &wfl_compiler::TermLaw) -> Vec<usize> {
    let inputs = law.inputs.iter().filter_map(|s| match s {
        InputSlot::Field(b) | InputSlot::Previous(b) => Some(b.field.index()),
        _ => None,
    });
    law.tests.iter().chain(&law.trials).map(|s| s.field.index()).chain(inputs).collect()
}

/// Whether terms or updates of states read the increment, and whether they read the end of the previous step.
fn histories(laws: &[terms::PlacedLaw], renewed: &[states::StateLaw]) -> (bool, bool) {
    let timed = |slots: &[UniformSlot]| slots.contains(&UniformSlot::TimeStep);
    let past = |inputs: &[InputSlot]| inputs.iter().any(|s| matches!(s, InputSlot::Previous(_)));
    let rates =
        laws.iter().any(|l| timed(&l.law.prologue.slots)) || renewed.iter().any(|r| timed(&r.law.prologue.slots));
    (rates, laws.iter().any(|l| past(&l.law.inputs)) || renewed.iter().any(|r| past(&r.law.inputs)))
}

/// Zero in all fields that are not solved for, now and in the past where something reads it.
fn nothing_known(fields: &[Field], numbering: &Numbering, reads_past: bool) -> Known {
    let solved = |k: usize| numbering.starts[k].is_some();
    let values = |(k, f): (usize, &Field)| if solved(k) { Vec::new() } else { vec![0.0; f.n_dofs()] };
    let data: Vec<Vec<f64>> = fields.iter().enumerate().map(values).collect();
    let previous = reads_past.then(|| Past { unknowns: vec![0.0; numbering.n_dofs], data: data.clone() });
    Known { data, previous }
}

impl Scene {
    /// The `expect` conditions with measures at their last values: the condition and whether it holds; `None` for
    /// one that cannot be evaluated.
    #[must_use]
    pub fn expectations(&self, measures: &[(String, f64)]) -> (Vec<(wfl::Expect, Option<bool>)>, Vec<Diagnostic>) {
        let params = self.with_measures(measures);
        let env = self.bare(&params);
        let place = fields::global_place(0);
        let mut diagnostics = Vec::new();
        let mut out = Vec::new();
        for expect in &self.env.expects {
            let law = compile_condition(&env, &place, "expect", &expect.condition);
            diagnostics.extend(law.diagnostics);
            let known = self.operands_are_finite(&env, &expect.condition);
            let holds = law.value.filter(|l| l.inputs.is_empty() && known).map(|law| {
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

    /// True if everything a condition compares is finite: with a number that is none, `not (m > 5)` would hold.
    fn operands_are_finite(&self, env: &Env<'_>, condition: &wfl::ast::Cond) -> bool {
        use wfl::ast::CondKind;
        let finite = |e: &wfl::ast::Expr| {
            let found = wfl_compiler::constant(env, "expect", e).value;
            found.is_none_or(|c| c.values.iter().all(|v| v.is_finite()))
        };
        match &condition.kind {
            CondKind::Compare(first, rest) => finite(first) && rest.iter().all(|(_, e)| finite(e)),
            CondKind::And(parts) | CondKind::Or(parts) => parts.iter().all(|c| self.operands_are_finite(env, c)),
            CondKind::Not(inner) => self.operands_are_finite(env, inner),
        }
    }
}
