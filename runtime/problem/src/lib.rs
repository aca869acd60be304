//! From a resolved script to a problem ready to run: mesh, regions, fields, compiled terms, fixed values, outputs.
//!
//! Every stage reports all its problems; a later stage runs only where the earlier ones left what it needs. Nothing
//! is made that the scene does not use: a field in no term has no dofs, an expression in no output no kernel. Promises: a
//! scene does not change behind [`prepare`]; who solves it has equations of its own ([`Equations`]). Works with any
//! kernel backend that it is handed, also with the interpreter alone. Does not solve, and writes no files.
#![forbid(unsafe_code)]

mod assemble;
mod auto;
mod balances;
mod batch;
mod between;
mod build;
mod cadence;
mod caller;
mod conditions;
mod constants;
mod constraints;
mod context;
mod corners;
mod coverage;
mod covered;
mod cut;
pub mod demand;
mod differenced;
mod edges;
mod effects;
mod equations;
mod expects;
mod explicit;
mod face_rules;
mod fields;
mod forcing;
mod given;
mod gradients;
mod groups;
mod held;
mod idle;
mod inputs;
mod joined;
mod jumps;
mod left_out;
mod low_rules;
mod mappings;
mod massless;
mod measures;
mod meeting;
mod mesh;
mod mesh_files;
mod method;
mod normals;
mod options;
mod outputs;
mod overlooked;
mod part;
mod past;
mod place;
mod point_loads;
mod quantities;
mod rates;
mod reactions;
mod refined;
mod regions;
mod rest;
mod rims;
mod rule_choice;
mod samples;
mod sampling;
mod series;
mod states;
mod surfaces;
mod tables;
mod terms;
mod twice;
mod weights;
mod written;
mod zero_loads;

use std::{
    collections::{BTreeMap, BTreeSet, HashSet},
    path::Path,
    sync::Arc,
};

use wfl::{
    Diagnostic, ResolvedScript, Span,
    ast::{Expr, Reduction},
};
use wfl_compiler::{
    Class, Constant, Env,
    backend::KernelBackend,
    types::{FieldSig, MappingSig, RateForm},
};
use wfl_contact::Contact;
use wfl_discrete::{
    field::Field,
    pruning::Pruning,
    system::System,
    value::{Sampled, Value},
};
use wfl_host::team::Team;
use wfl_mesh::{
    mesh::{Mesh, Topology},
    refine::Mark,
};
use wfl_newton::NewtonOptions;

pub use balances::{Ended, Turnover, unbalanced};
use batch::Batch;
pub use between::Between;
pub use cadence::{Cadence, Every, StepPlace};
pub use caller::GiveError;
pub use constants::numbers_of;
pub use constraints::Prescribed;
pub use equations::node_positions;
pub use equations::{Equations, Solving};
pub use explicit::{Energy, Explicit};
pub use fields::ON_ANY_CELLS;
pub use forcing::Forcing;
pub use given::{CallerValues, Given, Source};
pub use gradients::Over;
pub use groups::region_name;
pub use held::Printed;
pub use inputs::InputFile;
pub use left_out::LeftOut;
pub use mappings::place_of_moving;
pub use mesh::SceneBox;
pub use mesh::{bodies_of, corners_of};
pub use options::{Auto, DEFAULT_STEP_ERROR, Steps};
pub use outputs::{CsvOutput, VtkOutput};
use part::PartOfUnknowns;
pub use part::{FromWhole, ScenePart};
use place::Findings;
pub use place::displaced_regions;
pub use rates::MOST_FRACTION;
pub use reactions::Measured;
pub use refined::Refined;
pub use regions::{NamedRegion, Regions};
pub use rest::{Sketch, without_auto};
pub use rims::{OpenRim, RimOfField};
pub use samples::{SampleAt, Samples, StateAt};
pub use sampling::{Bodies, NO_SAMPLING, Sampling, parts};
pub use states::StateUpdate;
pub use tables::TablesOf;
pub use terms::Origin;
pub use terms::RuleChoice;
pub use written::shared_beside;

/// A quantity printed and reported at each step.
pub struct Measure {
    /// Its name.
    pub name: String,
    taken: Taken,
    /// Of an integral that is linear in the unknowns, in a scene of many steps.
    weights: Option<weights::Weights>,
    /// Its text names the end of the previous step, or the increment: it may be an amount of the step.
    names_change: bool,
    /// Where it stands.
    pub span: wfl::Span,
}

/// A number that measures make, reported with them.
pub struct Computed {
    /// Its name.
    pub name: String,
    /// Arithmetic of measures, parameters and the step variable.
    pub expr: wfl::ast::Expr,
    /// The reductions that stand in it.
    pub reductions: Vec<Measure>,
    /// Where it stands.
    pub span: wfl::Span,
}

/// What a measure is made of.
enum Taken {
    /// Values at points, and what is done with them.
    Points(Reduction, Vec<(Value, Sampled)>),
    /// Equations of prescribed values.
    Reaction(reactions::Reaction),
    /// All equations of some unknowns.
    Balance(balances::Balanced),
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
    /// Which statement it comes from.
    pub origin: Origin,
    /// Its statement.
    pub span: Span,
    /// Its region.
    pub place: String,
    /// How it depends on the unknowns.
    pub class: Class,
    /// Symmetric tangent.
    pub symmetric: bool,
    /// The rule of its region.
    pub rule: RuleChoice,
    /// Why it is that rule.
    pub why: String,
    /// Points of that rule in the largest group.
    pub n_points: usize,
    /// Instructions of its residual and tangent kernels.
    pub instructions: (usize, usize),
}

/// The declaration of a field.
#[derive(Clone, Copy, Debug)]
pub struct DeclaredField {
    /// Its name there.
    pub(crate) span: Span,
    /// Whether its unit is a length; `None` where it has none.
    pub is_length: Option<bool>,
}

impl DeclaredField {
    fn of(field: &wfl::Field) -> Self {
        Self { span: field.name.span, is_length: field.space.unit.as_ref().map(wfl::is_length) }
    }
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
    /// First rates: field and value.
    pub start_rates: Vec<(usize, Given)>,
    /// Explicit steps: mass, and the longest stable increment.
    pub explicit: Option<Arc<Explicit>>,
    /// The balance of energy that the scene asks for.
    pub energy: Option<Energy>,
    /// Known fields: field and values.
    pub data: Vec<(usize, Given)>,
    /// Fields that are renewed after each step.
    pub states: Vec<StateUpdate>,
    /// Quantities to report.
    pub measures: Vec<Measure>,
    /// The names of balances, whose numbers are among the measures.
    pub balances: Vec<String>,
    /// Numbers that measures make.
    pub computed: Vec<Computed>,
    /// Quantities that events, and the limit of an increment, are made of.
    pub watched: Vec<Measure>,
    /// What begins and ends during the steps.
    pub events: Vec<EventRule>,
    /// What terms print.
    pub prints: Vec<Printed>,
    /// VTU series.
    pub vtk: Vec<VtkOutput>,
    /// Line samples.
    pub csv: Vec<CsvOutput>,
    /// Series over the steps, at points.
    pub series: Vec<CsvOutput>,
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
    /// How its mesh was refined; `None` if it was not.
    pub refined: Option<Refined>,
    /// Where its nodes were before the map of the mesh; nothing without one that parameters change.
    pub unmapped: Option<Vec<[f64; 3]>>,
    /// The files that were read for it.
    pub inputs: Vec<InputFile>,
    /// What a run has to know of its tables, and of what else drives it.
    pub tables: TablesOf,
    /// Multipliers that have nodes without a jump by the mesh alone, and why.
    pub(crate) idle: Vec<(String, String)>,
    /// What the declaration of each field says.
    pub(crate) declared: Vec<DeclaredField>,
    /// Words in expressions of terms.
    pub(crate) in_terms: BTreeSet<String>,
    env: OwnedEnv,
}

impl Scene {
    /// The declaration of the field of this name.
    #[must_use]
    pub fn declared_field(&self, name: &str) -> Option<DeclaredField> {
        let number = self.system.fields.iter().position(|field| field.name == name)?;
        self.declared.get(number).copied()
    }

    /// Where the field of this name is declared.
    #[must_use]
    pub fn place_of_field(&self, name: &str) -> Option<Span> {
        self.declared_field(name).map(|field| field.span)
    }

    /// The statement of the term of this name.
    #[must_use]
    pub fn place_of_term(&self, name: &str) -> Option<Span> {
        self.terms.iter().find(|term| term.name == name).map(|term| term.span)
    }

    /// Whether a run of it has a table of measures: its own, those made of others, energies.
    #[must_use]
    pub fn has_measures(&self) -> bool {
        !(self.measures.is_empty() && self.computed.is_empty() && self.energy.is_none())
    }

    /// How often files of its outputs are written, in the order of grids, tables of steps and series.
    pub fn cadences(&self) -> impl Iterator<Item = &Cadence> {
        let tables = self.csv.iter().chain(&self.series).map(|output| &output.every);
        self.vtk.iter().map(|output| &output.every).chain(tables)
    }

    /// Asks callers who give values anew: a run depends on no other one.
    pub fn forget_given(&self) {
        self.data.iter().chain(&self.starts).chain(&self.start_rates).for_each(|(_, given)| given.forget());
    }

    /// Shares the rows of the equations out over ranks that have prepared the same scene; before the first step.
    pub fn share_rows(&mut self, team: Arc<dyn Team>) {
        self.system.share_rows(team);
        self.contact.share(&self.system);
    }
}

/// What begins and ends during the steps.
#[derive(Clone, Debug, PartialEq)]
pub struct EventRule {
    /// Its name.
    pub name: String,
    /// The side that is larger while it lasts, and the other one.
    pub sides: [Expr; 2],
}

impl EventRule {
    fn new(event: &wfl::Event) -> Self {
        Self { name: event.name.name.clone(), sides: [event.larger.clone(), event.smaller.clone()] }
    }
}

/// What is needed to compile more expressions after preparation (`expect`).
struct OwnedEnv {
    params: BTreeMap<String, Constant>,
    mappings: Vec<MappingSig>,
    rates: Vec<RateForm>,
    expansions: wfl::ast::Expansions,
    tables: Vec<std::sync::Arc<wfl::Table>>,
    expects: Vec<wfl::Expect>,
    /// The derivatives that `gradient` statements name, as long as nobody has found them.
    derivatives: Vec<(String, Constant)>,
    dim: usize,
}

/// The parts of a scene that its statements are read with.
#[derive(Clone, Copy)]
struct Parts<'a> {
    script: &'a ResolvedScript,
    env: &'a Env<'a>,
    mesh: &'a Mesh,
    topology: &'a Topology,
    regions: &'a Regions,
    fields: &'a [Field],
}

/// A scene that is being made: what its stages share. Each stage is in a file of its own.
struct Builder<'a> {
    script: &'a ResolvedScript,
    folder: &'a Path,
    env: &'a Env<'a>,
    mesh: Mesh,
    refined: Option<Refined>,
    unmapped: Option<Vec<[f64; 3]>>,
    topology: Topology,
    regions: Regions,
    fields: Vec<Field>,
    mappings: &'a mappings::Mappings,
    sigs: &'a [FieldSig],
    batch: &'a Batch<'a>,
    diagnostics: &'a mut Vec<Diagnostic>,
    params: &'a BTreeMap<String, Constant>,
    mesh_time: f64,
    prints: Vec<Printed>,
    inputs: Vec<InputFile>,
    keep: &'a [Pruning],
    sampling: &'a Sampling,
    /// Where this rank has a part of the mesh alone: what the first one says of the unknowns.
    unknowns: Option<PartOfUnknowns>,
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
    prepare_refined(script, folder, backend, keep, &[])
}

/// [`prepare_keeping`], and the mesh is refined before anything is made on it: `rounds[k]` names cells of the mesh that
/// the scene's own `refine` statements and the rounds before leave. Regions, interfaces, splits and the map of the mesh
/// are those of the refined mesh; [`Scene::refined`] leads from its cells back.
///
/// # Panics
/// If a mark is of no cell of the mesh of its round.
#[must_use]
pub fn prepare_refined(
    script: &ResolvedScript,
    folder: &Path,
    backend: &dyn KernelBackend,
    keep: &[Pruning],
    rounds: &[Vec<Mark>],
) -> Prepared {
    prepare_sampled(script, folder, backend, keep, (rounds, &NO_SAMPLING))
}

/// [`prepare_refined`], and some integrals are taken with more points.
///
/// # Panics
/// If a mark is of no cell of the mesh of its round.
#[must_use]
pub fn prepare_sampled(
    script: &ResolvedScript,
    folder: &Path,
    backend: &dyn KernelBackend,
    keep: &[Pruning],
    mesh: (&[Vec<Mark>], &Sampling),
) -> Prepared {
    let with = With { folder, backend, keep, rounds: mesh.0, sampling: mesh.1 };
    if script.params.iter().any(auto::is_auto) {
        return auto::prepare(script, with);
    }
    prepare_as_written(script, with, None)
}

/// Prepares the scene of one of several ranks with the part of the mesh that it was sent; made by all of them together.
/// The first rank has told every message of the scene: there are none left to tell.
#[must_use]
pub fn prepare_part(
    script: &ResolvedScript,
    folder: &Path,
    backend: &dyn KernelBackend,
    keep: &[Pruning],
    part: ScenePart,
    team: Arc<dyn Team>,
) -> Prepared {
    let script = part.with_params(script);
    let with = With { folder, backend, keep, rounds: &[], sampling: &NO_SAMPLING };
    prepare_as_written(&script, with, Some((part, team)))
}

/// The errors of a script that need no mesh: shapes, names and test functions of all statements. Takes milliseconds, so an
/// editor can ask at every keystroke. `dim` is the dimension of the mesh, 1 to 3, if it is known; without it nothing is
/// said of a scene whose mesh is a file.
#[must_use]
pub fn messages_without_mesh(script: &ResolvedScript, dim: Option<usize>) -> Vec<Diagnostic> {
    let mut diagnostics = rest::text_messages(script, dim);
    context::add(script, &mut diagnostics);
    once_per_place(&mut diagnostics);
    diagnostics
}

/// What a scene is prepared with beside its script.
#[derive(Clone, Copy)]
struct With<'a> {
    folder: &'a Path,
    backend: &'a dyn KernelBackend,
    keep: &'a [Pruning],
    rounds: &'a [Vec<Mark>],
    sampling: &'a Sampling,
}

fn prepare_as_written(script: &ResolvedScript, with: With<'_>, part: Option<place::OnTeam>) -> Prepared {
    let mut found = Findings { diagnostics: Vec::new(), lost: script.lost.clone(), dim: None };
    let scene = build::build(script, with, part, &mut found);
    let Findings { mut diagnostics, mut lost, dim } = found;
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
    let mut seen: HashSet<(wfl::Code, String, Vec<wfl::Span>)> = HashSet::new();
    diagnostics.retain(|d| {
        let spans: Vec<wfl::Span> = d.labels.iter().map(|l| l.span).collect();
        let in_macro = d.labels.first().is_some_and(|l| l.text.starts_with("in this use of"));
        let key = (d.code, d.message.clone(), spans[usize::from(in_macro && spans.len() > 1)..].to_vec());
        seen.insert(key)
    });
}
