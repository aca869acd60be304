//! The stages between a script and its problem: mesh, regions, fields and mappings; laws; numbering and prescribed values;
//! steps, options and values; outputs; the system.
//!
//! Every stage tells all its problems. The order of the stages is the order of their messages.

use std::{
    cell::Cell,
    collections::{BTreeMap, BTreeSet},
    time::Instant,
};

use wfl::{Code, Diagnostic, ResolvedScript};
use wfl_compiler::{
    Constant, Env,
    types::{FieldKind, InputSlot, UniformSlot},
};
use wfl_contact::{Contact, ContactTerm};
use wfl_discrete::{
    field::Field,
    pruning::Pruning,
    rates::Scheme,
    system::{FrozenTerm, Known, Numbering, Past, PastForm, System},
    window::Window,
};
use wfl_newton::NewtonOptions;
use wfl_output::SampledPiece;
use wfl_sparse::csr::CsrError;

use super::{
    Builder, Computed, CsvOutput, DeclaredField, EventRule, Given, Measure, OwnedEnv, Parts, PrepareTimes, Prescribed,
    Scene, StateUpdate, Steps, TablesOf, VtkOutput, With,
    assemble::Assembled,
    batch::Batch,
    constants, constraints, corners,
    effects::Reads,
    explicit, fields, idle, mappings, massless, measures, meeting, mesh, options, outputs,
    place::{Findings, OnTeam, Place, part_of_mesh, whole},
    rates::{self, Integration},
    reactions, rest, states, terms,
};

/// Makes the problem of a script; `part` on one of several ranks that has a part of the mesh.
pub(super) fn build(
    script: &ResolvedScript,
    with: With<'_>,
    part: Option<OnTeam>,
    found: &mut Findings,
) -> Option<Scene> {
    let begin = Instant::now();
    let (place, mut told) = match part {
        None => (whole(script, with, found)?, None),
        Some(part) => part_of_mesh(script, part, found).map(|(place, told)| (place, Some(told)))?,
    };
    let Place { mesh, refined, unmapped, topology, regions, inputs, params } = place;
    let With { folder, backend, keep, sampling, .. } = with;
    let bare = Env { dim: mesh.dim(), ..constants::bare_env(script, mesh.dim(), &params) };
    let diagnostics = &mut found.diagnostics;
    let spaces = told.as_mut().map(|told| std::mem::take(&mut told.spaces));
    let maker =
        fields::FieldMaker { script, env: &bare, mesh: &mesh, topology: &topology, regions: &regions, diagnostics };
    let fields::Fields { fields, sigs } = maker.make(spaces)?;
    let known = Env { fields: &sigs, ..bare };
    let made = mappings::MappingMaker {
        parts: Parts { script, env: &known, mesh: &mesh, topology: &topology, regions: &regions, fields: &fields },
        backend,
        diagnostics: &mut *diagnostics,
    }
    .make();
    for mapping in script.mappings.iter().filter(|m| made.sigs.iter().all(|s| s.name != m.name.name)) {
        found.lost.add(&mapping.name.name);
    }
    let mesh_time = begin.elapsed().as_secs_f64();
    let variable = script.steps.as_ref().map(|s| s.variable.name.clone());
    let forms = rates::forms(script, &sigs, &params);
    let env = Env { fields: &sigs, mappings: &made.sigs, step_variable: variable.as_deref(), rates: &forms, ..bare };
    let batch = Batch::new(backend);
    let (mut scene, integration) = Builder {
        script,
        folder,
        env: &env,
        mesh,
        refined,
        unmapped,
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
        sampling,
        unknowns: told.map(|told| told.unknowns),
    }
    .build()?;
    with_its_mass(&mut scene, script, &integration).map_err(|told| found.diagnostics.push(*told)).ok()?;
    Some(scene)
}

/// What a scheme does with the mass of a scene.
fn with_its_mass(scene: &mut Scene, script: &ResolvedScript, integration: &Integration) -> Result<(), Box<Diagnostic>> {
    match &integration.massless {
        Some(region) => massless::finish(scene, script, region),
        None if integration.scheme == Scheme::Explicit => explicit::finish(scene, script, integration.fraction),
        None => {
            scene.system.find_nodes_without_mass();
            Ok(())
        }
    }
}

/// A matrix that cannot be made.
fn structure_error(script: &ResolvedScript, error: CsrError) -> Diagnostic {
    match (error, &script.mesh) {
        (CsrError::TooMuchMemory(need), Some(statement)) => mesh::too_much_memory(&need, statement.span),
        (error, _) => Diagnostic::new(Code::E412, error.to_string()),
    }
}

/// `None`, and the message, for a system that the statement `solver linear` does not fit.
fn fits_its_solver(script: &ResolvedScript, system: &System, diagnostics: &mut Vec<Diagnostic>) -> Option<()> {
    let unfit = options::unfit_iteration(script, system);
    let fits = unfit.is_none();
    diagnostics.extend(unfit);
    fits.then_some(())
}

/// The parameters in the order of declaration.
fn in_order(script: &ResolvedScript, params: &BTreeMap<String, Constant>) -> Vec<(String, Constant)> {
    let declared = script.params.iter().map(|p| &p.name.name);
    declared.filter_map(|name| Some((name.clone(), params.get(name)?.clone()))).collect()
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

/// The unknowns: which dofs there are, which of them are prescribed, and the terms on them.
struct Numbered {
    numbering: Numbering,
    prescribed: Prescribed,
    states: Vec<StateUpdate>,
    /// Fields that terms use.
    used: BTreeSet<usize>,
    /// Whether laws read the increment of the step variable.
    rates: bool,
    /// The fields of which laws read the end of the previous step.
    past: BTreeSet<usize>,
    /// Multipliers that may follow from others.
    shared: BTreeSet<usize>,
    /// None after an error.
    assembled: Option<Assembled>,
}

/// What a run is given beside the system.
struct Values {
    steps: Option<Steps>,
    newton: NewtonOptions,
    accuracy: Option<(f64, String)>,
    starts: Vec<(usize, Given)>,
    start_rates: Vec<(usize, Given)>,
    integration: Integration,
    data: Vec<(usize, Given)>,
    /// The derivatives of terms in the past.
    past: Vec<PastForm>,
    measures: Vec<Measure>,
    watched: Vec<Measure>,
    computed: Vec<Computed>,
    tables: TablesOf,
}

/// What is written.
struct Outputs {
    vtk: Vec<VtkOutput>,
    csv: Vec<CsvOutput>,
    series: Vec<CsvOutput>,
    /// Seconds spent on their laws.
    law_seconds: f64,
}

impl Values {
    /// Whether some number reads the end of the previous step.
    fn read_past(&self) -> bool {
        let in_computed = self.computed.iter().flat_map(|c| &c.reductions);
        self.measures.iter().chain(&self.watched).chain(in_computed).any(Measure::reads_past)
    }
}

impl Builder<'_> {
    fn build(mut self) -> Option<(Scene, Integration)> {
        let begin = Instant::now();
        let (laws, renewed, rules) = self.laws();
        self.check_whole(|scene| scene.gaps(&laws));
        let compile_terms = begin.elapsed().as_secs_f64();

        let begin = Instant::now();
        let numbered = self.numbered(laws, renewed, &rules);
        let mesh_time = self.mesh_time + begin.elapsed().as_secs_f64();

        let begin = Instant::now();
        let values = self.values(&numbered, &rules);
        if let Some(made) = &numbered.assembled {
            self.check_whole(|scene| scene.zero_loads(made, values.steps.as_ref()));
        }
        if numbered.assembled.is_none() || self.diagnostics.iter().any(Diagnostic::is_error) {
            self.outputs(&rules, values.steps.as_ref());
            return None;
        }
        let compile_values = begin.elapsed().as_secs_f64();

        let begin = Instant::now();
        let outputs = self.outputs(&rules, values.steps.as_ref());
        let mesh = mesh_time + begin.elapsed().as_secs_f64() - outputs.law_seconds;

        let begin = Instant::now();
        if let Err(e) = self.batch.finish() {
            self.diagnostics.push(Diagnostic::new(Code::E609, e.to_string()));
        }
        let compile = compile_terms + compile_values + outputs.law_seconds + begin.elapsed().as_secs_f64();
        if self.diagnostics.iter().any(Diagnostic::is_error) {
            return None;
        }
        let integration = values.integration.clone();
        Some((self.scene(numbered, values, outputs, PrepareTimes { compile, mesh })?, integration))
    }

    fn numbered(
        &mut self,
        laws: Vec<terms::PlacedLaw>,
        renewed: Vec<states::StateLaw>,
        rules: &terms::Rules,
    ) -> Numbered {
        let used: BTreeSet<usize> = laws.iter().flat_map(|l| used_fields(&l.law)).collect();
        let (rates, past) = histories(&laws, &renewed);
        let states = self.state_updates(renewed, rules);
        let mut numbering = self.numbering(&used);
        let (prescribed, shared) = self.constraints(&mut numbering, &laws, &used);
        let broken = !self.script.lost.is_empty() || self.diagnostics.iter().any(Diagnostic::is_error);
        if !broken {
            self.check_whole(|scene| {
                scene.effects(&laws, &prescribed, &numbering);
                scene.read_but_in_no_term(&numbering);
            });
        }
        let assembled = if broken { None } else { self.assemble_terms(laws, rules, &numbering) };
        Numbered { numbering, prescribed, states, used, rates, past, shared, assembled }
    }

    fn values(&mut self, numbered: &Numbered, rules: &terms::Rules) -> Values {
        let mut steps = self.steps(numbered.rates);
        if let Some(auto) = steps.as_mut().and_then(|s| s.auto.as_mut()) {
            auto.fields = self.fields_in_time(numbered);
        }
        let (newton, accuracy) = self.solver_options();
        let integration = self.scheme();
        self.rates_of_expressions(integration.scheme);
        self.rates_of_states();
        let starts = self.starts();
        let start_rates = self.start_rates();
        let data = self.data();
        let from = measures::From {
            rules,
            held: reactions::Held {
                numbering: &numbered.numbering,
                prescribed: &numbered.prescribed,
                integration: &integration,
            },
            often: !self.keep.contains(&Pruning::Past) && steps.as_ref().is_some_and(Steps::are_many),
        };
        let measures = self.measures(&self.script.measures, from);
        // names of measures are told apart by what they belong to
        let lists = self.script.steps.iter().map(|s| ("", &s.watched));
        let lists = lists.chain(self.script.events.iter().map(|e| (e.name.name.as_str(), &e.watched)));
        let mut watched = Vec::new();
        for (owner, list) in lists {
            let made = self.measures(list, from);
            watched.extend(made.into_iter().map(|m| Measure { name: format!("{owner}{}", m.name), ..m }));
        }
        let computed = self.script.computed.iter().map(|c| Computed {
            name: c.name.name.clone(),
            expr: c.expr.clone(),
            reductions: self.measures(&c.watched, from),
            span: c.span,
        });
        let computed = computed.collect();
        rest::expects(self.script, self.params, self.env.dim, self.diagnostics);
        self.table_inputs();
        let tables = steps.as_ref().map_or_else(Default::default, |s| self.tables(s));
        let past = match &numbered.assembled {
            Some(made) => self.past_forms(made, &numbered.numbering, steps.as_ref(), &integration),
            None => Vec::new(),
        };
        Values {
            steps,
            newton,
            accuracy,
            starts,
            start_rates,
            integration,
            data,
            past,
            measures,
            watched,
            computed,
            tables,
        }
    }

    /// The fields whose values in time have an error: those with a past. Beside unknowns that have one, a state that no term
    /// reads, not even by way of other states, changes nothing of the solution and does not count: the impulse of a contact
    /// is all error in the step in which it begins, however short that is.
    fn fields_in_time(&self, numbered: &Numbered) -> Vec<usize> {
        let of = |wanted: &dyn Fn(usize, &Field) -> bool| -> Vec<usize> {
            self.fields.iter().enumerate().filter(|(k, f)| wanted(*k, f)).map(|(k, _)| k).collect()
        };
        let names = names_in_terms(self.script);
        let read = states::read_by(&numbered.states, of(&|_, f| names.contains(&f.name)));
        let moves = of(&|k, f| f.kind == FieldKind::Unknown && numbered.past.contains(&k));
        let counts = |k: &usize| moves.is_empty() || read.contains(k);
        let with_past = of(&|k, f| if f.kind == FieldKind::State { counts(&k) } else { numbered.past.contains(&k) });
        if with_past.is_empty() { of(&|_, f| f.kind == FieldKind::Unknown) } else { with_past }
    }

    /// The problem, of parts without errors.
    fn scene(mut self, numbered: Numbered, values: Values, outputs: Outputs, times: PrepareTimes) -> Option<Scene> {
        let Numbered { numbering, mut prescribed, states, used, rates, past: in_past, shared, assembled } = numbered;
        let reads_past = !in_past.is_empty() || values.read_past();
        let Values { steps, newton, accuracy, starts, start_rates, integration, data, past, measures, .. } = values;
        let (watched, computed, tables) = (values.watched, values.computed, values.tables);
        let Outputs { vtk, csv, series, .. } = outputs;
        let Assembled { terms, summaries, contact } = assembled?;
        let reads_past = reads_past || outputs_read_past(&vtk, csv.iter().chain(&series));
        let reads = if reads_past { Reads::Past } else { Reads::Present };
        let (steps, of_steps) = (steps?, if rates { Reads::Past } else { reads });
        self.statements_without_effect(&numbering, &mut prescribed, &steps, of_steps)?;
        let rates = rates::of(integration.scheme, self.env.rates, &self.fields, &numbering);
        let known = nothing_known(&self.fields, &numbering, reads);
        let known = Known { rates: rates::driven(rates, &numbering, &prescribed, &starts), ..known };
        let unused_fields = self.unused_fields(&used, &numbering);
        let env = self.owned_env();
        let system = System::new(self.mesh, self.fields, numbering, terms, known);
        let (system, contact) = with_contact(system, contact, self.keep, within(&steps));
        let at = idle::Sides { topology: &self.topology, mappings: self.mappings, shared: &shared };
        let (mut system, contact, idle) = without_idle(system, contact, self.script, at, self.diagnostics)?;
        system.plan_past(past);
        Some(Scene {
            explicit: None,
            energy: integration.energy,
            declared: self.script.fields.iter().map(DeclaredField::of).collect(),
            system,
            contact,
            topology: self.topology,
            regions: self.regions,
            steps,
            prescribed,
            starts,
            start_rates,
            data,
            states,
            measures,
            balances: self.script.balances.iter().map(|b| b.name.name.clone()).collect(),
            computed,
            watched,
            prints: self.prints,
            vtk,
            csv,
            series,
            events: self.script.events.iter().map(EventRule::new).collect(),
            newton,
            accuracy,
            params: in_order(self.script, self.params),
            terms: summaries,
            sigs: self.sigs.to_vec(),
            times,
            unused_fields,
            refined: self.refined,
            unmapped: self.unmapped,
            inputs: self.inputs,
            tables,
            idle,
            in_terms: names_in_terms(self.script),
            env,
        })
    }

    /// What conditions need when a run has ended.
    fn owned_env(&self) -> OwnedEnv {
        OwnedEnv {
            params: self.params.clone(),
            mappings: self.env.mappings.to_vec(),
            rates: self.env.rates.to_vec(),
            tables: self.env.tables.to_vec(),
            expansions: self.script.expansions.clone(),
            expects: self.script.expects.clone(),
            derivatives: rest::derivatives(self.script, self.params),
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

    /// Fields that nothing uses: no term, no prescribed value.
    fn unused_fields(&self, used: &BTreeSet<usize>, numbering: &Numbering) -> Vec<String> {
        let left_out =
            |k: &usize| !used.contains(k) && numbering.starts[*k].is_none() && self.fields[*k].kind != FieldKind::State;
        (0..self.fields.len()).filter(left_out).map(|k| self.fields[k].name.clone()).collect()
    }

    /// Makes a check that looks at the whole scene, as [`Mesh::check_whole`] says.
    fn check_whole(&mut self, check: impl FnOnce(&mut Self)) {
        if self.mesh.is_whole() {
            check(self);
        }
    }

    /// Tells of first values, steps and prescribed values that change nothing; `None` if one of them is an error.
    fn statements_without_effect(
        &mut self,
        numbering: &Numbering,
        prescribed: &mut Prescribed,
        steps: &Steps,
        reads: Reads,
    ) -> Option<()> {
        self.check_whole(|scene| {
            scene.idle_starts(numbering, prescribed, reads);
            scene.idle_steps(steps, reads);
            scene.contradictions(prescribed, steps, numbering.n_dofs);
            scene.nothing_to_solve(numbering, prescribed);
        });
        (!self.diagnostics.iter().any(Diagnostic::is_error)).then_some(())
    }

    /// What statements are read with, and where their messages go.
    pub(super) fn parts(&mut self) -> (Parts<'_>, &mut Vec<Diagnostic>) {
        let parts = Parts {
            script: self.script,
            env: self.env,
            mesh: &self.mesh,
            topology: &self.topology,
            regions: &self.regions,
            fields: &self.fields,
        };
        (parts, &mut *self.diagnostics)
    }

    pub(super) fn term_maker(&mut self) -> terms::TermMaker<'_> {
        let (parts, diagnostics) = self.parts();
        terms::TermMaker { parts, diagnostics }
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

    /// Files and line samples.
    fn outputs(&mut self, rules: &terms::Rules, steps: Option<&Steps>) -> Outputs {
        let (backend, mappings) = (self.batch, self.mappings);
        let (parts, diagnostics) = self.parts();
        let law_seconds = Cell::new(0.0);
        let mappings = Some(mappings);
        let mut maker = outputs::OutputMaker { parts, rules, mappings, backend, steps, diagnostics, law_seconds };
        let (vtk, csv, series) = outputs::outputs(&mut maker);
        Outputs { vtk, csv, series, law_seconds: maker.law_seconds.get() }
    }

    /// What is prescribed, and the multipliers that may follow from others.
    fn constraints(
        &mut self,
        numbering: &mut Numbering,
        laws: &[terms::PlacedLaw],
        used: &BTreeSet<usize>,
    ) -> (Prescribed, BTreeSet<usize>) {
        let backend = self.batch;
        let (parts, diagnostics) = self.parts();
        let prescribed = constraints::ConstraintMaker { parts, numbering: &*numbering, backend, diagnostics }.make();
        if let Some(told) = self.unknowns.take() {
            numbering.set_frames(told.frames.clone());
            numbering.fix(told.fixed());
            numbering.tie(told.ties);
            numbering.free_of_whole = Some(told.free);
            return (prescribed, BTreeSet::new());
        }
        let (fixed, components) = (prescribed.dofs(), prescribed.components());
        numbering.set_frames(prescribed.frames());
        let multipliers = meeting::Multipliers {
            script: self.script,
            mesh: &self.mesh,
            topology: &self.topology,
            mappings: self.mappings,
            fields: &self.fields,
            numbering,
            fixed: &components,
            laws,
        };
        let shared = meeting::shared_multipliers(&multipliers, self.diagnostics);
        self.diagnostics.extend(corners::several_normals(&multipliers));
        let undetermined = self.undetermined(used, numbering, &fixed);
        numbering.fix(fixed.into_iter().chain(shared.dropped).chain(undetermined));
        (prescribed, shared.in_question)
    }
}

/// Contact on a system; `at` is the step in which multipliers are looked at.
fn with_contact(
    mut system: System,
    contact: Vec<(FrozenTerm, ContactTerm)>,
    keep: &[Pruning],
    at: f64,
) -> (System, Contact) {
    keep.iter().for_each(|pruning| system.keep(*pruning));
    let (frozen, contact): (Vec<FrozenTerm>, Vec<ContactTerm>) = contact.into_iter().unzip();
    system.add_frozen(frozen);
    let mut contact = Contact::new(contact);
    system.set_laws(Window::new(at, 1.0));
    contact.begin_step(system.step());
    (system, contact)
}

/// A system and its contact without idle multipliers, and what is said of those; `None` after a message. On a part of the
/// mesh they are left out as on the whole one.
fn without_idle(
    mut system: System,
    mut contact: Contact,
    script: &ResolvedScript,
    sides: idle::Sides<'_>,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<(System, Contact, idle::Notes)> {
    if !system.mesh.is_whole() {
        contact.share(&system);
        return Some((system, contact, idle::Notes::new()));
    }
    let idle = idle::leave_out(script, sides, &mut system, &contact, diagnostics);
    let idle = idle.map_err(|e| diagnostics.push(structure_error(script, e))).ok()?;
    fits_its_solver(script, &system, diagnostics)?;
    Some((system, contact, idle))
}

/// A value of the step variable between the first and the last, where little vanishes that does at an end.
fn within(steps: &Steps) -> f64 {
    steps.first() + 0.618 * (steps.last() - steps.first())
}

fn used_fields(law: &wfl_compiler::TermLaw) -> Vec<usize> {
    let inputs = law.inputs.iter().filter_map(|s| match s {
        InputSlot::Field(b) | InputSlot::Previous(b) | InputSlot::History(_, b) => Some(b.field.index()),
        _ => None,
    });
    law.tests.iter().chain(&law.trials).map(|s| s.field.index()).chain(inputs).collect()
}

/// Whether terms or updates of states read the increment, and the fields of which they read the end of the previous step.
fn histories(laws: &[terms::PlacedLaw], renewed: &[states::StateLaw]) -> (bool, BTreeSet<usize>) {
    let timed = |slots: &[UniformSlot]| slots.iter().any(|s| matches!(s, UniformSlot::TimeStep | UniformSlot::Rate(_)));
    let inputs = laws.iter().map(|l| &l.law.inputs).chain(renewed.iter().map(|r| &r.law.inputs));
    let past = inputs.flatten().filter_map(|s| match s {
        InputSlot::Previous(b) | InputSlot::History(_, b) => Some(b.field.index()),
        _ => None,
    });
    let past = past.collect();
    let rates =
        laws.iter().any(|l| timed(&l.law.prologue.slots)) || renewed.iter().any(|r| timed(&r.law.prologue.slots));
    (rates, past)
}

/// Whether something that is written reads the end of the previous step.
fn outputs_read_past<'a>(vtk: &[VtkOutput], mut csv: impl Iterator<Item = &'a CsvOutput>) -> bool {
    vtk.iter().flat_map(|v| &v.pieces).any(SampledPiece::reads_past) || csv.any(|c| c.line.reads_past())
}

/// Zero in all fields that are not solved for, now and in the past where something reads it.
fn nothing_known(fields: &[Field], numbering: &Numbering, reads: Reads) -> Known {
    let solved = |k: usize| numbering.starts[k].is_some();
    let values = |(k, f): (usize, &Field)| if solved(k) { Vec::new() } else { vec![0.0; f.n_dofs()] };
    let data: Vec<Vec<f64>> = fields.iter().enumerate().map(values).collect();
    let previous = (reads == Reads::Past).then(|| Past { unknowns: vec![0.0; numbering.n_dofs], data: data.clone() });
    Known { data, previous, rates: None }
}
