//! A demanded accuracy: the runs of the search, and the selected setting.
//!
//! Runs on the way are those of a sweep; the last one is a whole run with its files, which the caller makes
//! ([`WholeRun`]). What is picked, and why, is decided by the runtime.

use std::{path::Path, time::Instant};

use wfl::ast::MeshSource;
use wfl_adapt::{
    accuracy::{
        Cost, DEFAULT_BUDGET, Demand, Extent, Found, Guide, Indicator, OfData, Out, Pair, Probed, Short, Trials, Ways,
        curvature, mesh_piece, probe, seek,
    },
    compare::{Compared, MEASURE, NORM_DEGREE, Solved, differences, measures, sampled, sampled_if},
    knobs::{self, Setting},
};
use wfl_checks::locked_bodies as locked;
use wfl_compiler::{Class, InterpreterBackend, backend::KernelBackend};
use wfl_discrete::pruning::Pruning;
use wfl_mesh::{
    mesh::{CellId, Mesh, RegionSet},
    refine::Mark,
};
use wfl_output::{
    OutputDir, OutputError, Piece, Real, Report,
    record::{AccuracyRecord, MESH_FILE, Rounds},
    write_report, write_vtu,
};
use wfl_problem::{Bodies, NO_SAMPLING, SampleAt, Samples, Sampling, Scene, demand::DEFAULT_QUANTITY};
use wfl_run::{Outcome, Quiet};

use crate::{
    Listener, Loaded,
    bench::{Bench, Known, Status, known_of, prepared, remembers},
    exact,
    scene_file::read_scene,
    setting_text,
};

/// The region of a term may differ from that of the scene's own mesh by this part of the demanded error.
const SLACK: f64 = 0.1;
/// What more points change of the nodal forces of a term counts from this part of the demanded error on.
const SMALL_PART: f64 = 0.02;
/// Degree to which norms are exact that are told as `about`.
const ROUGH_DEGREE: usize = 2;
/// Up to so many cells, the interpreter is done before machine code is made.
const FEW_CELLS: f64 = 300.0;
/// Rounds of refinement that leave few cells few.
const FEW_ROUNDS: usize = 1;

/// What is asked for: `given` goes before what the scene says, and defaults before nothing.
#[must_use]
pub fn demand(scene: &Scene, given: Given) -> Option<Demand> {
    let (error, of) = match (given.error, &scene.accuracy) {
        (Some(error), of) => (error, of.as_ref().map(|g| g.1.clone())),
        (None, Some((error, of))) => (*error, Some(of.clone())),
        (None, None) => return None,
    };
    let quantity = given.quantity.or(of).unwrap_or_else(|| DEFAULT_QUANTITY.to_owned());
    Some(Demand { error, quantity, budget: given.budget.unwrap_or(DEFAULT_BUDGET), from_coarsest: given.from_coarsest })
}

/// What is given beside the scene.
#[derive(Clone, Debug, Default)]
pub struct Given {
    /// The relative error.
    pub error: Option<f64>,
    /// Its quantity.
    pub quantity: Option<String>,
    /// Seconds that one run may take.
    pub budget: Option<f64>,
    /// Begin with the coarsest mesh that has the regions of the scene.
    pub from_coarsest: bool,
}

/// Makes a run with everything a scene asks for.
pub trait WholeRun {
    /// The scene with the settings of the run.
    fn shaped(&self, scene: Scene) -> Scene;

    /// Runs a scene that was read and prepared in `parse_seconds` and more since `begun`.
    ///
    /// # Errors
    /// In words.
    fn run(
        &mut self,
        loaded: &mut Loaded,
        scene: &Scene,
        parse_seconds: f64,
        begun: Instant,
    ) -> Result<Outcome, String>;
}

/// The quantity of a demanded accuracy.
pub struct Job<'a> {
    /// The scene.
    pub file: &'a Path,
    /// Values of its parameters.
    pub overrides: &'a [String],
    /// What whole runs do although the scene does not need it.
    pub keep: &'a [Pruning],
    /// What is demanded.
    pub demand: &'a Demand,
    /// Runs terms.
    pub backend: &'a dyn KernelBackend,
    /// Threads of each run.
    pub threads: usize,
    /// Hears of each run.
    pub listener: &'a dyn Listener,
    /// When the work began; the time in the report counts from here.
    pub started: Instant,
}

/// The run that was picked.
pub struct Picked {
    /// It, with its report.
    pub solved: Solved,
    /// Its scene, as read for it.
    pub loaded: Loaded,
    /// What was found and why.
    pub record: AccuracyRecord,
    /// Why the demand is not met, where it is not.
    pub short: Option<Short>,
    /// Its mesh, with where the error came from.
    pub mesh: Piece,
}

/// Finds the setting and runs it; the scene is given as it stands.
///
/// # Errors
/// Where not even the first mesh has a solution: why.
pub fn pick(job: &Job<'_>, loaded: Loaded, scene: Scene, whole: &mut dyn WholeRun) -> Result<Picked, Out> {
    let failed = |why: String| Out::Failed(why);
    if scene.system.has_moving_images() {
        let why =
            "no accuracy is estimated where a mapping moves (E802)\n  = help: compare runs on two meshes: wfl sweep";
        return Err(failed(why.to_owned()));
    }
    let known = known_of(loaded, scene, job.overrides);
    has_quantity(&known, &job.demand.quantity).map_err(failed)?;
    let ways = Ways::of(&known.loaded.script, &known.scene);
    let only = Some(job.demand.quantity.clone());
    let bench = Bench {
        backend: job.backend,
        listener: job.listener,
        threads: job.threads,
        only,
        last: true,
        rounds: &[],
        sampling: &NO_SAMPLING,
    };
    let mut lab = Lab { job, known: &known, ways: &ways, bench, whole };
    let Found { run, mut record, short, parts } = seek(&mut lab, &ways, job.demand)?;
    let Trial { mut solved, full, .. } = run;
    let Some(loaded) = full else { return Err(failed("the last run has no results".to_owned())) };
    record.truth = lab.truth(&mut solved, &record.picked).map(Real);
    let mut short = short;
    if let Some(Real(truth)) = record.truth.filter(|t| record.reached && t.0 > record.asked) {
        record.reached = false;
        short = Some(Short::Truth(truth));
    }
    record.why.extend(free(&solved.outcome.report));
    let mesh = mesh_piece(&solved.scene, record.rounds as usize, parts.as_ref());
    let report = &mut solved.outcome.report;
    report.accuracy = Some(record.clone());
    report.timings.total = job.started.elapsed().as_secs_f64();
    Ok(Picked { solved, loaded, record, short, mesh })
}

/// Whether a scene has the quantity.
fn has_quantity(known: &Known, name: &str) -> Result<(), String> {
    let script = &known.loaded.script;
    let items = script.outputs.iter().filter(|o| o.format.name == "vtk").flat_map(|o| &o.items).map(|i| &i.name);
    let mut list: Vec<&str> = vec!["L2", "H1"];
    list.extend(items.map(String::as_str));
    let measures = || script.measures.iter().map(|m| m.name.name.as_str());
    let apart = name.strip_prefix(MEASURE).is_some_and(|n| list.contains(&n) && measures().any(|m| m == n));
    list.extend(measures());
    if apart || list.contains(&name) {
        return Ok(());
    }
    Err(format!(
        "the scene has no quantity `{name}` whose error can be estimated\n  = help: L2 and H1 are norms of all \
         unknowns; other quantities are the outputs on contact faces and the measures of the scene: {}",
        list.join(", ")
    ))
}

/// One run with what is needed to compare it.
struct Trial {
    solved: Solved,
    cost: Cost,
    samples: Option<Vec<Samples>>,
    /// Of a richer run: what it does not resolve.
    data: OfData,
    /// Of a run with its files: what is needed to end it.
    full: Option<Loaded>,
}

struct Lab<'a> {
    job: &'a Job<'a>,
    known: &'a Known,
    ways: &'a Ways,
    bench: Bench<'a>,
    whole: &'a mut dyn WholeRun,
}

impl Lab<'_> {
    /// A run on the way: nothing is written.
    fn pilot(&self, setting: &Setting, fineness: usize, rounds: &Rounds, sampling: &Sampling) -> Result<Trial, String> {
        let ratio = fineness as f64 / self.ways.own as f64;
        let cells = self.known.scene.system.mesh.n_cells() as f64 * ratio.powf(self.ways.dim as f64);
        let few = cells <= FEW_CELLS && rounds.len() <= FEW_ROUNDS && sampling.terms.is_empty();
        let backend = if few { &InterpreterBackend } else { self.bench.backend };
        let bench = Bench { backend, only: self.bench.only.clone(), rounds, sampling, ..self.bench };
        let run = bench.run(self.job.file, self.known, setting, "");
        match (run.status, run.solved) {
            (Status::Ok, Some(solved)) => Ok(trial(solved, run.seconds, self.known.scene.steps.values.len())),
            (Status::NotConverged(why) | Status::Failed(why), _) => Err(why),
            (Status::Ok, None) => Err("the run left nothing".to_owned()),
        }
    }

    /// A run with everything the scene asks for.
    fn run_whole(&mut self, setting: &Setting, rounds: &Rounds) -> Result<Trial, String> {
        let begin = Instant::now();
        let mut loaded = read_scene(self.job.file, &self.known.words(setting), "run", "")?;
        self.known.apply(&mut loaded.script, setting)?;
        let parse_seconds = begin.elapsed().as_secs_f64();
        loaded.rounds = [&loaded.rounds, rounds.as_slice()].concat();
        let (scene, mut loaded) = prepared(loaded, self.bench.backend, self.job.keep, &[])?;
        let scene = self.whole.shaped(scene);
        loaded.knobs = setting.iter().map(|(name, value)| format!("{name}={value}")).collect();
        let outcome = self.whole.run(&mut loaded, &scene, parse_seconds, begin)?;
        if let Some(step) = outcome.steps.iter().find(|s| !s.history.converged()) {
            return Err(format!("step t = {} did not converge", step.window.end));
        }
        let script = loaded.script.clone();
        let outputs = script.outputs.clone();
        let steps = scene.steps.values.len();
        let mut trial = trial(Solved { script, outputs, scene, outcome }, begin.elapsed().as_secs_f64(), steps);
        trial.full = Some(loaded);
        Ok(trial)
    }

    /// The relative error of a run against the exact solution, where the scene has one of the quantity asked about; of
    /// an exact solution that is zero there is none.
    fn truth(&self, solved: &mut Solved, setting: &Setting) -> Option<f64> {
        let mut exact =
            read_scene(self.job.file, &self.known.words(setting), "run", &exact::statements(self.known)?).ok()?;
        self.known.apply(&mut exact.script, setting).ok()?;
        let outputs = exact.script.outputs.clone();
        let own =
            (std::mem::replace(&mut solved.script, exact.script), std::mem::replace(&mut solved.outputs, outputs));
        let errors = exact::errors(solved, Self::SAMPLER);
        (solved.script, solved.outputs) = own;
        errors.ok()?.into_iter().find(|(q, _)| *q == self.job.demand.quantity).map(|(_, e)| e).filter(|e| e.is_finite())
    }

    /// Tells of a run, and samples it.
    fn told(&self, setting: &Setting, made: Result<Trial, String>) -> Result<Trial, String> {
        let what = match &made {
            Ok(t) => format!(
                "{} cells, {} unknowns, {:.2} s",
                t.solved.scene.system.mesh.n_cells(),
                t.cost.dofs,
                t.cost.seconds
            ),
            Err(why) => why.lines().next().unwrap_or_default().trim_start_matches("error").to_owned(),
        };
        self.job.listener.progress(&format!("accuracy: {}: {what}", setting_text(setting)));
        let mut made = made?;
        made.samples = Some(self.samples(&made.solved)?);
        Ok(made)
    }

    fn fits(&self, scene: &Scene, fineness: usize) -> Result<(), String> {
        if self.ways.fits(&self.known.scene, scene, fineness, SLACK * self.job.demand.error) {
            return Ok(());
        }
        Err("a region with terms is not the same part of the body as on the mesh of the scene".to_owned())
    }

    /// What a run is sampled with: expressions are short, and are evaluated before machine code would be made of them.
    const SAMPLER: &'static dyn KernelBackend = &InterpreterBackend;

    /// The quantity asked about at a run's own points.
    fn samples(&self, solved: &Solved) -> Result<Vec<Samples>, String> {
        let wanted = |name: &str| name == self.job.demand.quantity;
        sampled_if(solved, Self::SAMPLER, SampleAt::Own(NORM_DEGREE), &wanted)
    }

    /// The distance in the quantity asked about.
    fn of_quantity(&self, list: &[(String, f64)]) -> Result<f64, String> {
        let quantity = self.job.demand.quantity.as_str();
        match list.iter().find(|d| d.0 == quantity) {
            Some((_, d)) if d.is_finite() => Ok(*d),
            Some(_) => Err(format!("the solutions on two meshes cannot be compared in `{quantity}`")),
            None if ["L2", "H1"].contains(&quantity) => Err(format!(
                "`{quantity}` has no relative error: the solution is zero\n  = help: --of a measure that is not"
            )),
            None => Err(format!(
                "`{quantity}` has no relative error: it is zero, or an output that lives in the bodies\n  = help: \
                 --of L2 or --of H1 is that of all unknowns"
            )),
        }
    }
}

/// Puts another report in place of that of a run that has ended, and the mesh of the search beside it.
///
/// # Errors
/// Of the folder.
pub fn rewrite(folder: &Path, report: &mut Report, mesh: &Piece) -> Result<(), OutputError> {
    let dir = OutputDir::open(folder)?;
    write_vtu(&dir, MESH_FILE, None, std::slice::from_ref(mesh))?;
    dir.sync()?;
    if !report.files.iter().any(|f| f == MESH_FILE) {
        report.files.push(MESH_FILE.to_owned());
    }
    write_report(&dir, report)?;
    dir.settle()
}

fn trial(solved: Solved, seconds: f64, steps: usize) -> Trial {
    let report = &solved.outcome.report;
    let more = steps.saturating_sub(solved.outcome.steps.len()) as f64;
    let whole = seconds + more * (report.timings.assemble + report.timings.solve);
    Trial {
        cost: Cost { dofs: report.dofs, seconds, whole },
        samples: None,
        data: OfData::default(),
        full: None,
        solved,
    }
}

impl Trials for Lab<'_> {
    type Run = Trial;

    fn run(&mut self, setting: &Setting, fineness: usize, rounds: &Rounds, extent: Extent) -> Result<Trial, String> {
        let made = if extent == Extent::WholeScene {
            self.run_whole(setting, rounds)
        } else {
            let fits =
                |t: Trial| if rounds.is_empty() { self.fits(&t.solved.scene, fineness).map(|()| t) } else { Ok(t) };
            self.pilot(setting, fineness, rounds, &NO_SAMPLING).and_then(fits)
        };
        self.told(setting, made)
    }

    fn rich(&mut self, run: &mut Trial, setting: &Setting, fineness: usize, rounds: &Rounds) -> Result<Trial, String> {
        let small = SMALL_PART * self.job.demand.error;
        let state = run.solved.outcome.steps.last().map(|s| s.state.clone()).ok_or("there is no step")?;
        let Probed { mut sampling, mut other, apart, coefficients, parts } =
            probe(&run.solved.scene, &run.solved.outcome.equations, &state, small).map_err(|e| e.to_string())?;
        let measure = Some(self.job.demand.quantity.as_str());
        let measure = measure.filter(|q| self.ways.measures.iter().any(|m| m == q));
        let measure = measure.map(|q| q.strip_prefix(MEASURE).unwrap_or(q).to_owned());
        (sampling.measure, other.measure) = (measure.clone(), measure);
        let bodies = if run.solved.scene.system.mesh.order() > 1 { Bodies::Second } else { Bodies::First };
        (sampling.bodies, other.bodies) = (bodies, bodies);
        let made = self.pilot(setting, fineness, rounds, &sampling);
        let mut rich = self.told(setting, made)?;
        if apart > small {
            // what a difference of nodal forces does to the quantity is measured, not guessed
            let shifted = self.pilot(setting, fineness, rounds, &other).and_then(|mut t| {
                t.samples = Some(self.samples(&t.solved)?);
                self.distance(&t, &rich)
            });
            rich.data.error = shifted.unwrap_or(apart);
        }
        rich.data = OfData { error: rich.data.error + coefficients, parts };
        let remembers = remembers(&run.solved.scene);
        let end = run.solved.outcome.equations.system.step();
        let between = run.solved.scene.between_nodes(end, 1, remembers);
        if between.lost > small {
            rich.data.error += between.lost;
            rich.data.parts.resize(between.parts.len(), 0.0);
            rich.data.parts.iter_mut().zip(&between.parts).for_each(|(a, b)| *a += b);
        }
        Ok(rich)
    }

    fn data(&self, rich: &Trial) -> OfData {
        rich.data.clone()
    }

    fn geometry(&mut self, run: &Trial, setting: &Setting, fineness: usize) -> f64 {
        if !matches!(self.known.loaded.script.mesh.as_ref().map(|m| &m.source), Some(MeshSource::Files(_))) {
            return 0.0;
        }
        let mesh = &run.solved.scene.system.mesh;
        let seen = curvature(mesh);
        if seen == 0.0 || mesh.dim() != 2 {
            return seen;
        }
        // what a polygon does to the quantity is measured where arcs can take its place
        let sampling = Sampling { bodies: Bodies::Arcs, ..Sampling::default() };
        let arcs = self.pilot(setting, fineness, &Rounds::new(), &sampling);
        arcs.and_then(|arcs| self.distance(&arcs, run)).unwrap_or(seen)
    }

    fn locks(&self, run: &Trial) -> bool {
        !locked(&run.solved.scene.system).is_empty()
    }

    fn cost(&self, run: &Trial) -> Cost {
        run.cost
    }
    fn mesh<'r>(&self, run: &'r Trial) -> &'r Mesh {
        &run.solved.scene.system.mesh
    }

    fn at_contact(&self, run: &Trial, marks: &[Mark]) -> bool {
        let scene = &run.solved.scene;
        let mut cells: Vec<CellId> = Vec::new();
        for term in scene.terms.iter().filter(|t| t.class == Class::Kinked) {
            match scene.regions.get(&term.place).map(|r| &r.set) {
                Some(RegionSet::Facets(facets)) => cells.extend(facets.iter().map(|f| f.cell)),
                Some(RegionSet::Interface(pairs)) => {
                    cells.extend(pairs.iter().flat_map(|p| [p.here.cell, p.there.cell]))
                }
                _ => {}
            }
        }
        cells.sort_unstable();
        marks.iter().any(|m| cells.binary_search(&m.cell).is_ok())
    }

    fn indicator(&mut self, run: &Trial, rich: &Trial, guide: Guide) -> Result<Indicator, String> {
        let pair = Pair { coarse: &run.solved, rich: &rich.solved };
        let quantity = &self.job.demand.quantity;
        if guide == Guide::Gradients {
            return pair.of_gradients(self.bench.backend);
        }
        let mut found = pair.indicator(quantity, self.bench.backend, self.job.threads)?;
        let name = quantity.strip_prefix(MEASURE).unwrap_or(quantity);
        let value = measures(&rich.solved).into_iter().find(|m| m.0 == name).map_or(0.0, |m| m.1.abs());
        found.size = found.size.map(|size| size / value).filter(|size| size.is_finite());
        Ok(found)
    }

    fn elapsed(&self) -> f64 {
        self.job.started.elapsed().as_secs_f64()
    }

    fn distance(&mut self, run: &Trial, from: &Trial) -> Result<f64, String> {
        let quantity = self.job.demand.quantity.as_str();
        let own = from.samples.as_deref().unwrap_or_default();
        let there = sampled_if(&run.solved, Self::SAMPLER, SampleAt::Points(own), &|name| name == quantity)?;
        let found = Compared { samples: &there, measures: &measures(&run.solved) };
        self.of_quantity(&differences(found, Compared { samples: own, measures: &measures(&from.solved) }))
    }

    fn tighter(&mut self, run: &mut Trial, setting: &Setting, fineness: usize) -> Result<f64, String> {
        if remembers(&run.solved.scene) {
            let tight = Trials::run(self, setting, fineness, &Rounds::new(), Extent::Solution)?;
            return self.distance(run, &tight);
        }
        // the same problem continues from where it stopped
        let starts = run.solved.starts();
        let scene = &mut run.solved.scene;
        let tight = knobs::tolerance(setting).unwrap_or(scene.newton.tolerance);
        let tolerance = std::mem::replace(&mut scene.newton.tolerance, tight);
        let starts = std::mem::replace(&mut run.solved.scene.starts, starts);
        let ended = wfl_run::run(&run.solved.scene, &self.bench.options(), &mut Quiet);
        run.solved.scene.newton.tolerance = tolerance;
        run.solved.scene.starts = starts;
        let outcome = std::mem::replace(&mut run.solved.outcome, ended.map_err(|e| e.to_string())?);
        let tight = self.samples(&run.solved).map(|s| (s, measures(&run.solved)));
        run.solved.outcome = outcome;
        let (tight, tight_measures) = tight?;
        let own = run.samples.as_deref().unwrap_or_default();
        let found = Compared { samples: own, measures: &measures(&run.solved) };
        self.of_quantity(&differences(found, Compared { samples: &tight, measures: &tight_measures }))
    }

    fn distances(&mut self, run: &Trial, from: &Trial) -> Vec<(String, f64)> {
        // at the points of the coarser run, which are fewer: these errors are told as `about`
        let list = sampled(&run.solved, Self::SAMPLER, SampleAt::Own(ROUGH_DEGREE)).and_then(|own| {
            let there = sampled(&from.solved, Self::SAMPLER, SampleAt::Points(&own))?;
            let found = Compared { samples: &there, measures: &measures(&from.solved) };
            Ok(differences(found, Compared { samples: &own, measures: &measures(&run.solved) }))
        });
        list.unwrap_or_default()
    }
}

/// What the last run was free to do with less work, and what is left of that.
fn free(report: &Report) -> Vec<String> {
    let t = report.timings;
    let solver = report.solver.iter().map(|s| format!("solver: {s}"));
    let part = 100.0 * t.assemble / (t.compile + t.mesh + t.assemble + t.factor + t.solve + t.write);
    let rule = part.is_finite().then(|| {
        format!(
            "quadrature: that of the terms; a coarser one could save a part of the {part:.0} % of the time for assembly"
        )
    });
    solver.chain(rule).collect()
}
