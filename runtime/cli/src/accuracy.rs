//! `wfl run --accuracy`: the runs that a climb asks for, and what it found in words.
//!
//! Runs on the way are those of a sweep; the last one is an ordinary run with its files. What is picked, and why, is
//! decided by the runtime.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    time::Instant,
};

use wfl_compiler::{InterpreterBackend, backend::KernelBackend};
use wfl_runtime::{
    Quiet, SampleAt, Samples, Scene,
    accuracy::{
        AccuracyRecord, Cost, DEFAULT_BUDGET, DEFAULT_QUANTITY, Demand, Found, Notice, Out, Trials, Ways, seek,
    },
    compare::{MEASURE, NORM_DEGREE, Solved, differences, measures, sampled, sampled_if},
    knobs::{self, Setting},
    output::{OutputDir, OutputError, Real, Report, write_report},
};

use crate::{
    args::RunArgs,
    ended::finish,
    folder::{error_line, told as told_of_folder},
    load::{Loaded, out, read_scene, say},
    prepared::EXIT_ERROR,
    ready::{self, Ready},
    sweep::{
        one::{Bench, Known, Status, known_of, prepared, remembers},
        words,
    },
    table::{Table, number},
};

/// The accuracy wanted was not reached.
const EXIT_ACCURACY: u8 = 4;
/// The region of a term may differ from that of the scene's own mesh by this part of the error wanted.
const SLACK: f64 = 0.1;
/// Degree to which norms are exact that are told as `about`.
const ROUGH_DEGREE: usize = 2;
/// Up to so many cells, the interpreter is done before machine code is made.
const FEW_CELLS: f64 = 300.0;

/// What is asked for, on the command line or in the scene.
pub(crate) fn demand(args: &RunArgs, scene: &Scene) -> Option<Demand> {
    let (error, quantity) = match (args.accuracy, &scene.accuracy) {
        (Some(error), given) => (error, given.as_ref().map(|g| g.1.clone())),
        (None, Some((error, of))) => (*error, Some(of.clone())),
        (None, None) => return None,
    };
    let quantity = args.of.clone().or(quantity).unwrap_or_else(|| DEFAULT_QUANTITY.to_owned());
    Some(Demand { error, quantity, budget: args.budget.unwrap_or(DEFAULT_BUDGET) })
}

/// Finds the setting and runs it; the scene is given as it stands.
pub(crate) fn run(
    args: &RunArgs,
    demand: &Demand,
    (loaded, scene): (Loaded, Scene),
    backend: &dyn KernelBackend,
    started: Instant,
) -> ExitCode {
    let known = known_of(loaded, scene, &args.scene.overrides);
    match found(args, demand, known, backend, started) {
        Ok(code) => code,
        Err(Out::Failed(why)) => {
            say(&error_line(why.trim_start_matches("error: ")));
            ExitCode::from(EXIT_ERROR)
        }
        Err(out) => {
            say(&format!("error[E605]: {out}\n"));
            ExitCode::from(EXIT_ACCURACY)
        }
    }
}

fn found(
    args: &RunArgs,
    demand: &Demand,
    known: Known,
    backend: &dyn KernelBackend,
    started: Instant,
) -> Result<ExitCode, Out> {
    quantity(&known, &demand.quantity).map_err(Out::Failed)?;
    let ways = Ways::of(&known.loaded.script, &known.scene);
    let threads = ready::threads(args);
    let bench = Bench { backend, threads, only: Some(demand.quantity.clone()), last: true };
    let mut lab = Lab { args, demand, known: &known, ways: &ways, bench, started, written: None };
    let Found { run, record, notice } = seek(&mut lab, &ways, demand).inspect_err(|why| lab.disown(why))?;
    let Trial { solved, full, .. } = run;
    let Some((loaded, ready)) = full else { return Err(Out::Failed("the last run has no results".to_owned())) };
    Ok(lab.ended(solved, &loaded, &ready, record, notice))
}

/// Whether a scene has the quantity.
fn quantity(known: &Known, name: &str) -> Result<(), String> {
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
        "the scene has no quantity `{name}` whose error could be told\n  = help: L2 and H1 are those of all unknowns, \
         others are the outputs on contact faces and the measures of the scene: {}",
        list.join(", ")
    ))
}

/// One run with what is needed to compare it.
struct Trial {
    solved: Solved,
    cost: Cost,
    samples: Option<Vec<Samples>>,
    /// Of a run with its files: what is needed to end it.
    full: Option<(Loaded, Ready)>,
}

struct Lab<'a> {
    args: &'a RunArgs,
    demand: &'a Demand,
    known: &'a Known,
    ways: &'a Ways,
    bench: Bench<'a>,
    started: Instant,
    /// The report of the last run with its files, and their folder.
    written: Option<(PathBuf, Report)>,
}

impl Lab<'_> {
    /// A run on the way: nothing is written.
    fn pilot(&self, setting: &Setting, fineness: usize) -> Result<Trial, String> {
        let ratio = fineness as f64 / self.ways.own as f64;
        let cells = self.known.scene.system.mesh.n_cells() as f64 * ratio.powf(self.ways.dim as f64);
        let backend = if cells <= FEW_CELLS { &InterpreterBackend } else { self.bench.backend };
        let bench = Bench { backend, only: self.bench.only.clone(), ..self.bench };
        let run = bench.run(&self.args.scene.scene, self.known, setting, "");
        match (run.status, run.solved) {
            (Status::Ok, Some(solved)) => Ok(trial(solved, run.seconds, self.known.scene.steps.values.len())),
            (Status::NotConverged(why) | Status::Failed(why), _) => Err(why),
            (Status::Ok, None) => Err("the run left nothing".to_owned()),
        }
    }

    /// A run with everything the scene asks for.
    fn whole(&mut self, setting: &Setting, fineness: usize) -> Result<Trial, String> {
        let begin = Instant::now();
        let mut loaded = read_scene(&self.args.scene.scene, &self.known.words(setting), "run", "")?;
        self.known.apply(&mut loaded.script, setting)?;
        let parse_seconds = begin.elapsed().as_secs_f64();
        let (scene, mut loaded) = prepared(loaded, self.bench.backend, &self.args.no_prune)?;
        self.fits(&scene, fineness)?;
        let mut scene = ready::shaped(self.args, scene);
        loaded.knobs = setting.iter().map(|(name, value)| format!("{name}={value}")).collect();
        let mut ready = ready::ready(self.args, &mut loaded, &mut scene, parse_seconds, begin)?;
        ready.resumable = false;
        let outcome = ready.go(&mut scene).map_err(|e| e.to_string())?;
        if let Some(step) = outcome.steps.iter().find(|s| !s.history.converged()) {
            return Err(format!("step t = {} did not converge", step.time));
        }
        self.written = ready.options.out.clone().map(|folder| (folder, outcome.report.clone()));
        let script = loaded.script.clone();
        let outputs = script.outputs.clone();
        let steps = scene.steps.values.len();
        let mut trial = trial(Solved { script, outputs, scene, outcome }, begin.elapsed().as_secs_f64(), steps);
        trial.full = Some((loaded, ready));
        Ok(trial)
    }

    /// Says in the report of a run that was written on the way that it is not what was asked for.
    fn disown(&self, why: &Out) {
        let Some((folder, mut report)) = self.written.clone() else { return };
        let none = Real(f64::NAN);
        report.accuracy = Some(AccuracyRecord {
            asked: self.demand.error,
            quantity: self.demand.quantity.clone(),
            why: why.to_string().lines().map(str::to_owned).collect(),
            mesh: none,
            order: none,
            tolerance: none,
            method: none,
            estimate: none,
            ..AccuracyRecord::default()
        });
        let written = rewrite(&folder, &report);
        say(&match written {
            Ok(()) => format!("{} holds a run on the way, which is not accurate enough\n", folder.display()),
            Err(error) => told_of_folder(&error),
        });
    }

    fn fits(&self, scene: &Scene, fineness: usize) -> Result<(), String> {
        if self.ways.fits(&self.known.scene, scene, fineness, SLACK * self.demand.error) {
            return Ok(());
        }
        Err("a region with terms is not the same part of the body as on the mesh of the scene".to_owned())
    }

    /// What a run is sampled with: expressions are short, and are evaluated before machine code would be made of them.
    const SAMPLER: &'static dyn KernelBackend = &InterpreterBackend;

    /// The quantity asked about at a run's own points.
    fn samples(&self, solved: &Solved) -> Result<Vec<Samples>, String> {
        let wanted = |name: &str| name == self.demand.quantity;
        sampled_if(solved, Self::SAMPLER, SampleAt::Own(NORM_DEGREE), &wanted)
    }

    /// The distance in the quantity asked about.
    fn of_quantity(&self, list: &[(String, f64)]) -> Result<f64, String> {
        let quantity = self.demand.quantity.as_str();
        match list.iter().find(|d| d.0 == quantity) {
            Some((_, d)) if d.is_finite() => Ok(*d),
            Some(_) => Err(format!("the solutions on two meshes cannot be compared in `{quantity}`")),
            None => Err(format!(
                "`{quantity}` has no relative error: it is zero, or an output that lives in the bodies\n  = help: \
                 --of L2 or --of H1 is that of all unknowns"
            )),
        }
    }

    /// Writes what was found into the report, and tells it.
    fn ended(
        &self,
        mut solved: Solved,
        loaded: &Loaded,
        ready: &Ready,
        mut record: AccuracyRecord,
        notice: Option<Notice>,
    ) -> ExitCode {
        ready.announce(loaded, &solved.scene);
        record.why.extend(free(&solved.outcome.report));
        if !self.args.quiet {
            out(&told(&record));
        }
        let (reached, picked) = (record.reached, words(&record.picked));
        solved.outcome.report.accuracy = Some(record);
        solved.outcome.report.timings.total = self.started.elapsed().as_secs_f64();
        if let Some(folder) = &ready.options.out
            && let Err(error) = rewrite(folder, &solved.outcome.report)
        {
            say(&told_of_folder(&error));
            return ExitCode::from(EXIT_ERROR);
        }
        let loudness = (ready.loudness, Some(picked.as_str()));
        let code = finish(loaded, &solved.scene, &ready.options, &solved.outcome, loudness);
        if notice == Some(Notice::MeshOfFile) {
            say(
                "warning[W608]: the mesh comes from a file: its error is not known, and is not part of the accuracy\n  \
                 = note: tolerance and penalty are balanced for it\n  \
                 = help: a `mesh box` can be refined; or compare with a finer file by wfl sweep\n",
            );
        }
        if reached || code != ExitCode::SUCCESS { code } else { ExitCode::from(EXIT_ACCURACY) }
    }
}

/// Puts another report in place of that of a run that has ended.
fn rewrite(folder: &Path, report: &Report) -> Result<(), OutputError> {
    let dir = OutputDir::open(folder)?;
    write_report(&dir, report)?;
    dir.settle()
}

fn trial(solved: Solved, seconds: f64, steps: usize) -> Trial {
    let report = &solved.outcome.report;
    let more = steps.saturating_sub(solved.outcome.steps.len()) as f64;
    let whole = seconds + more * (report.timings.assemble + report.timings.solve);
    Trial { cost: Cost { dofs: report.dofs, seconds, whole }, samples: None, full: None, solved }
}

impl Trials for Lab<'_> {
    type Run = Trial;

    fn run(&mut self, setting: &Setting, fineness: usize, last: bool) -> Result<Trial, String> {
        let made = if last {
            self.whole(setting, fineness)
        } else {
            self.pilot(setting, fineness).and_then(|t| self.fits(&t.solved.scene, fineness).map(|()| t))
        };
        if !self.args.quiet {
            let what = match &made {
                Ok(t) => format!("{} unknowns, {:.2} s", t.cost.dofs, t.cost.seconds),
                Err(why) => why.lines().next().unwrap_or_default().trim_start_matches("error").to_owned(),
            };
            say(&format!("accuracy: {}: {what}\n", words(setting)));
        }
        let mut made = made?;
        made.samples = Some(self.samples(&made.solved)?);
        Ok(made)
    }

    fn cost(&self, run: &Trial) -> Cost {
        run.cost
    }

    fn distance(&mut self, run: &Trial, from: &Trial) -> Result<f64, String> {
        let quantity = self.demand.quantity.as_str();
        let own = from.samples.as_deref().unwrap_or_default();
        let there = sampled_if(&run.solved, Self::SAMPLER, SampleAt::Points(own), &|name| name == quantity)?;
        self.of_quantity(&differences((&there, &measures(&run.solved)), (own, &measures(&from.solved))))
    }

    fn tighter(&mut self, run: &mut Trial, setting: &Setting, fineness: usize) -> Result<f64, String> {
        if remembers(&run.solved.scene) {
            let tight = Trials::run(self, setting, fineness, false)?;
            return self.distance(run, &tight);
        }
        // the same problem goes on from where it stopped
        let starts = run.solved.starts();
        let scene = &mut run.solved.scene;
        let tight = knobs::tolerance(setting).unwrap_or(scene.newton.tolerance);
        let tolerance = std::mem::replace(&mut scene.newton.tolerance, tight);
        let starts = std::mem::replace(&mut run.solved.scene.starts, starts);
        let ended = wfl_runtime::run(&mut run.solved.scene, &self.bench.options(), &mut Quiet);
        run.solved.scene.newton.tolerance = tolerance;
        run.solved.scene.starts = starts;
        let outcome = std::mem::replace(&mut run.solved.outcome, ended.map_err(|e| e.to_string())?);
        let tight = self.samples(&run.solved).map(|s| (s, measures(&run.solved)));
        run.solved.outcome = outcome;
        let (tight, tight_measures) = tight?;
        let own = run.samples.as_deref().unwrap_or_default();
        self.of_quantity(&differences((own, &measures(&run.solved)), (&tight, &tight_measures)))
    }

    fn distances(&mut self, run: &Trial, from: &Trial) -> Vec<(String, f64)> {
        // at the points of the coarser run, which are fewer: these errors are told as `about`
        let list = sampled(&run.solved, Self::SAMPLER, SampleAt::Own(ROUGH_DEGREE)).and_then(|own| {
            let there = sampled(&from.solved, Self::SAMPLER, SampleAt::Points(&own))?;
            Ok(differences((&there, &measures(&from.solved)), (&own, &measures(&run.solved))))
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
            "quadrature: that of the terms; a coarser one could save a part of the {part:.0} % that assembling takes"
        )
    });
    solver.chain(rule).collect()
}

/// What was picked and why, in lines.
fn told(record: &AccuracyRecord) -> String {
    let error = |e: f64| if e.is_finite() { format!("{e:.1e}") } else { "not known".to_owned() };
    let mut table = Table::new("runs", &["setting", "unknowns", "time [s]", "error of the mesh"]);
    for rung in &record.rungs {
        let time = (1e4 * rung.seconds).round() / 1e4;
        table.push(vec![
            words(&rung.setting).into(),
            rung.dofs.into(),
            number(time).into(),
            if rung.error.0.is_finite() { error(rung.error.0).into() } else { "".into() },
        ]);
    }
    let mut text =
        format!("{}\naccuracy {:e} of {}: {}\n", table.text(), record.asked, record.quantity, words(&record.picked));
    text += &format!(
        "  estimated error {}: mesh {}, tolerance {}, method {}\n",
        error(record.estimate.0),
        error(record.mesh.0),
        error(record.tolerance.0),
        error(record.method.0)
    );
    for why in &record.why {
        text += &format!("  {why}\n");
    }
    if !record.others.is_empty() {
        let one = |o: &wfl_runtime::accuracy::Other| format!("{} {}", o.quantity, error(o.error.0));
        let list: Vec<String> = record.others.iter().map(one).collect();
        text += &format!("  other quantities, about: {}\n", list.join(", "));
    }
    text + "\n"
}

/// The lines of `wfl check` about an accuracy.
pub(crate) fn table(loaded: &Loaded, scene: &Scene) -> Table {
    let mut table = Table::new("accuracy", &["wanted", "of", "degrees", "mesh", "gamma"]);
    let Some((error, of)) = scene.accuracy.clone() else { return table };
    let ways = Ways::of(&loaded.script, scene);
    let degrees: Vec<String> = ways.degrees.iter().map(ToString::to_string).collect();
    let mesh = if ways.refines() { "is picked" } else { "of a file: its error will not be known" };
    let gamma = match ways.role {
        wfl_runtime::accuracy::Role::None => "as it is",
        wfl_runtime::accuracy::Role::Consistent => "grows with the mesh",
        wfl_runtime::accuracy::Role::Penalty => "a penalty: raised until its error is small",
    };
    table.push(vec![number(error).into(), of.into(), degrees.join(", ").into(), mesh.into(), gamma.into()]);
    table
}
