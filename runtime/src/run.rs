//! Running a scene: steps, Newton, measures, files, report.

use std::{path::PathBuf, time::Instant};

use thiserror::Error;
use wfl_compiler::ir::Origin;

use crate::{
    assemble::{AssembledTerm, FieldValues},
    newton::{Iteration, NewtonError, StepHistory, Stop, Watch, solve_step},
    output::{
        self, Check, ContactCounts, MeshReport, OrderedMap, OutputDir, OutputError, ParameterValue, Real, Report,
        Series, StepReport, Timings, peak_memory_bytes, write_csv, write_report,
    },
    scene::Scene,
    strategy::Strategy,
    system::System,
};

/// How a scene is run.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// The scene's name: its file without folder and ending.
    pub name: String,
    /// Where results go; `None` writes nothing.
    pub out: Option<PathBuf>,
    /// Threads of assembly and solver.
    pub threads: usize,
    /// Version of the program.
    pub version: String,
    /// Seconds spent on parsing before.
    pub parse_seconds: f64,
    /// Start of the process.
    pub started: Instant,
    /// Warnings to keep in the report.
    pub warnings: Vec<String>,
}

/// What to tell while a run goes on.
pub trait Progress {
    /// The solver has been chosen.
    fn solver(&mut self, _description: &str) {}
    /// A step begins: its number from 0, how many there are, the step variable.
    fn step(&mut self, _number: usize, _count: usize, _time: f64) {}
    /// After each iteration.
    fn iteration(&mut self, _iteration: &Iteration) {}
    /// A `Print` of a term: its name, where it is written, and its value at one of the points.
    fn printed(&mut self, _term: &str, _origin: Option<Origin>, _position: [f64; 3], _value: &[f64]) {}
    /// A step has ended.
    fn step_done(&mut self, _step: &StepResult) {}
}

/// Tells nothing.
pub struct Quiet;

impl Progress for Quiet {}

/// One step of a run.
#[derive(Clone, Debug)]
pub struct StepResult {
    /// The step variable.
    pub time: f64,
    /// What Newton did.
    pub history: StepHistory,
    /// Measures by name.
    pub measures: Vec<(String, f64)>,
    /// All unknowns at its end.
    pub state: Vec<f64>,
}

/// What a run ends with.
#[derive(Debug)]
pub struct Outcome {
    /// The steps that were tried.
    pub steps: Vec<StepResult>,
    /// The report, also written to `report.json`.
    pub report: Report,
    /// Files written.
    pub files: Vec<PathBuf>,
    /// Expectations of the scene: place and whether they hold.
    pub expectations: Vec<(wfl::Expect, Option<bool>)>,
    /// Messages of the expectations.
    pub diagnostics: Vec<wfl::Diagnostic>,
}

impl Outcome {
    /// True if every step converged.
    #[must_use]
    pub fn converged(&self) -> bool {
        self.steps.iter().all(|s| s.history.converged())
    }
}

/// Why a run stopped.
#[derive(Debug, Error)]
pub enum RunError {
    /// A step could not be solved.
    #[error("step {step} (t = {time}): {error}")]
    Newton {
        /// Number of the step from 0.
        step: usize,
        /// The step variable.
        time: f64,
        /// Why.
        error: NewtonError,
    },
    /// A file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

struct Forward<'p>(&'p mut dyn Progress);

impl Watch for Forward<'_> {
    fn iteration(&mut self, iteration: &Iteration) {
        self.0.iteration(iteration);
    }
}

/// Runs a scene.
///
/// # Errors
/// [`RunError`]; a step that does not converge is no error: it is marked, and the run stops there unless the scene
/// says `on_fail=go_on`.
pub fn run(scene: &mut Scene, options: &RunOptions, progress: &mut dyn Progress) -> Result<Outcome, RunError> {
    let dir = match &options.out {
        Some(path) => Some(OutputDir::create(path)?),
        None => None,
    };
    let mut files = Vec::new();
    let mut series: Vec<Series<'_>> = match &dir {
        Some(dir) => scene.vtk.iter().map(|v| Series::new(dir, v.file.clone())).collect(),
        None => Vec::new(),
    };
    let mut clock = Clock::default();
    let (steps, description) =
        all_steps(scene, options, progress, &mut clock, |scene, step, number, increment, clock| {
            let begin = Instant::now();
            write_step(scene, step, number, increment, &mut series, dir.as_ref(), &mut files)?;
            clock.write += begin.elapsed().as_secs_f64();
            Ok(())
        })?;
    let begin = Instant::now();
    let done = steps.len() == scene.steps.values.len() && steps.iter().all(|s| s.history.converged());
    if done && let Some(dir) = &dir {
        for series in series {
            series.finish()?;
        }
        for csv in &scene.csv {
            if scene.steps.values.len() > 1 {
                dir.remove_stale_steps(&csv.file, "csv")?;
            }
        }
    }
    let last: Vec<(String, f64)> = steps.last().map(|s| s.measures.clone()).unwrap_or_default();
    let (expectations, diagnostics) = if done { scene.expectations(&last) } else { (Vec::new(), Vec::new()) };
    clock.write += begin.elapsed().as_secs_f64();
    let report = report(scene, options, &steps, &description, &clock, &expectations);
    if let Some(dir) = &dir {
        files.push(write_report(dir, &report)?);
    }
    Ok(Outcome { steps, report, files, expectations, diagnostics })
}

#[derive(Clone, Copy, Debug, Default)]
struct Clock {
    assemble: f64,
    factor: f64,
    solve: f64,
    write: f64,
}

fn all_steps(
    scene: &mut Scene,
    options: &RunOptions,
    progress: &mut dyn Progress,
    clock: &mut Clock,
    mut after: impl FnMut(&mut Scene, &StepResult, usize, f64, &mut Clock) -> Result<(), RunError>,
) -> Result<(Vec<StepResult>, String), RunError> {
    let values = scene.steps.values.clone();
    let mut u = vec![0.0; scene.system.numbering.n_dofs];
    start(scene, &mut u);
    let mut strategy: Option<Strategy> = None;
    let mut steps: Vec<StepResult> = Vec::new();
    for (number, time) in values.iter().enumerate() {
        let increment = if number == 0 { values.get(1).map_or(0.0, |b| b - time) } else { time - values[number - 1] };
        progress.step(number, values.len(), *time);
        let wrap = |error: NewtonError| RunError::Newton { step: number, time: *time, error };
        if let Some(previous) = &mut scene.system.known.previous {
            previous.copy_from_slice(&u);
        }
        for (field, value) in &mut scene.data {
            value.set_step(*time, increment);
            let positions = node_positions(&scene.system, *field);
            scene.system.known.data[*field] = value.at_positions(&positions);
        }
        let begin = Instant::now();
        let changed = scene.system.set_step(*time, increment).map_err(|e| wrap(e.into()))?;
        clock.assemble += begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        let solver = match strategy.take() {
            None => {
                let mut made = Strategy::new(&scene.system, options.threads).map_err(|e| wrap(e.into()))?;
                if scene.system.is_linear() {
                    made.bulk_changed(&scene.system).map_err(|e| wrap(e.into()))?;
                }
                progress.solver(&made.describe());
                strategy.insert(made)
            }
            Some(mut old) => {
                if changed {
                    old.bulk_changed(&scene.system).map_err(|e| wrap(e.into()))?;
                }
                strategy.insert(old)
            }
        };
        clock.factor += begin.elapsed().as_secs_f64();
        for p in &mut scene.prescribed {
            p.apply(*time, increment, &mut u);
        }
        let history =
            solve_step(&mut scene.system, solver, &mut u, scene.newton, &mut Forward(progress)).map_err(wrap)?;
        clock.assemble += history.seconds.assemble;
        clock.factor += history.seconds.factor;
        clock.solve += history.seconds.solve;
        let measures = scene
            .measures
            .iter_mut()
            .map(|m| (m.name.clone(), m.evaluate(&scene.system, *time, increment, &u)))
            .collect();
        let Scene { prints, system, .. } = &mut *scene;
        for print in prints {
            let (term, origin) = (print.term.clone(), print.origin);
            print.for_each(system, *time, increment, &u, |x, value| progress.printed(&term, origin, x, value));
        }
        let step = StepResult { time: *time, history, measures, state: u.clone() };
        progress.step_done(&step);
        let converged = step.history.converged();
        if converged || scene.steps.go_on {
            after(scene, &step, number, increment, clock)?;
        }
        steps.push(step);
        if !converged && !scene.steps.go_on {
            break;
        }
    }
    Ok((steps, strategy.map_or_else(String::new, |s| s.describe())))
}

fn node_positions(system: &System, field: usize) -> Vec<[f64; 3]> {
    let f = &system.fields[field];
    (0..f.n_nodes()).map(|n| f.node_position(n)).collect()
}

/// First guesses of the scene.
fn start(scene: &mut Scene, u: &mut [f64]) {
    let time = scene.steps.values.first().copied().unwrap_or(0.0);
    for (field, value) in &mut scene.starts {
        let Some(first) = scene.system.numbering.starts[*field] else { continue };
        value.set_step(time, 0.0);
        let positions = node_positions(&scene.system, *field);
        let values = value.at_positions(&positions);
        u[first..first + values.len()].copy_from_slice(&values);
    }
}

fn write_step(
    scene: &mut Scene,
    step: &StepResult,
    number: usize,
    increment: f64,
    series: &mut [Series<'_>],
    dir: Option<&OutputDir>,
    files: &mut Vec<PathBuf>,
) -> Result<(), RunError> {
    let Some(dir) = dir else { return Ok(()) };
    let Scene { system, vtk, csv, steps, .. } = scene;
    let current = system.slices(&step.state);
    let previous = system.previous_slices();
    let values = FieldValues { current: &current, previous: &previous };
    for (output, series) in vtk.iter_mut().zip(series) {
        let mut pieces = Vec::with_capacity(output.pieces.len());
        for sampled in &mut output.pieces {
            let mut piece = sampled.sample(&system.mesh, step.time, increment, values);
            let entities = piece.cells.len();
            // the terms hold the branches of the converged state: the last residual was taken there
            let here = |t: &&AssembledTerm| t.place.as_ref() == Some(sampled.support());
            let states = system.terms.iter().filter(here).find_map(AssembledTerm::contact_states);
            if let Some(states) = states.filter(|s| s.len() == entities) {
                piece.cell_data.push(output::Array::scalar("contact_state", states));
            }
            pieces.push(piece);
        }
        files.push(series.write_step(step.time, &pieces)?);
    }
    for output in csv {
        let rows = output.line.rows(&system.mesh, step.time, increment, values);
        let name = if steps.values.len() > 1 {
            output::step_name(&output.file, number, "csv")
        } else {
            format!("{}.csv", output.file)
        };
        files.push(write_csv(dir, &name, &output.line.columns(), &rows)?);
    }
    Ok(())
}

fn report(
    scene: &Scene,
    options: &RunOptions,
    steps: &[StepResult],
    solver: &str,
    clock: &Clock,
    expectations: &[(wfl::Expect, Option<bool>)],
) -> Report {
    let mut report = Report {
        scene: options.name.clone(),
        version: options.version.clone(),
        dofs: scene.system.numbering.n_free() as u64,
        threads: options.threads as u64,
        peak_memory_bytes: peak_memory_bytes(),
        solver: Some(solver.to_owned()),
        warnings: options.warnings.clone(),
        ..Report::default()
    };
    for (name, value) in &scene.params {
        let shown = match (value.shape.rank(), value.values.as_slice()) {
            (0, [x]) => ParameterValue::from(*x),
            _ => ParameterValue::from(value.values.as_slice()),
        };
        report.parameters.insert(name.clone(), shown);
    }
    let mesh = &scene.system.mesh;
    let mut kinds: OrderedMap<u64> = OrderedMap::default();
    for kind in mesh.kinds() {
        let name = kind.to_string();
        let count = kinds.get(&name).copied().unwrap_or(0);
        kinds.insert(name, count + 1);
    }
    report.mesh = MeshReport {
        dim: mesh.dim() as u64,
        cells: mesh.n_cells() as u64,
        nodes: mesh.n_nodes() as u64,
        kinds,
        ..MeshReport::default()
    };
    for (k, field) in scene.system.fields.iter().enumerate() {
        if let Some(range) = scene.system.range(k) {
            let free = range.filter(|d| scene.system.numbering.free[*d] != crate::system::FIXED).count();
            report.fields.insert(field.name.clone(), free as u64);
        }
    }
    for name in &scene.unused_fields {
        report.left_out.push(format!("field {name}: no term uses it"));
    }
    report.steps = steps.iter().map(step_report).collect();
    for (expect, holds) in expectations {
        let value = f64::from(u8::from(*holds != Some(true)));
        report.checks.insert(format!("expect {}", expect.text), Check::at_most(0.0, value));
    }
    report.timings = Timings {
        parse: options.parse_seconds,
        compile: scene.times.compile,
        mesh: scene.times.mesh,
        assemble: clock.assemble,
        factor: clock.factor,
        solve: clock.solve,
        write: clock.write,
        total: options.started.elapsed().as_secs_f64(),
    };
    report
}

fn step_report(step: &StepResult) -> StepReport {
    let history = &step.history;
    let mut measures: OrderedMap<Real> = OrderedMap::default();
    for (name, value) in &step.measures {
        measures.insert(name.clone(), Real(*value));
    }
    StepReport {
        t: Real(step.time),
        converged: history.converged(),
        stop: match history.stop {
            Some(Stop::Tolerance) => output::Stop::Tolerance,
            Some(Stop::Floor) => output::Stop::Floor,
            _ => output::Stop::Maxit,
        },
        iterations: history.n_iterations() as u64,
        residual: history.iterations.iter().map(|i| Real(i.residual)).collect(),
        contact: history.iterations.last().and_then(|i| i.contact).map(|c| ContactCounts {
            open: c[0] as u64,
            slip: c[1] as u64,
            stick: c[2] as u64,
        }),
        measures,
    }
}
