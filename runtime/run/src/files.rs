//! The files of a scene: one VTU and one CSV a step, as its `output` statements say.
//!
//! Promises: a step is written whole or not at all, steps in their order, and with a checkpoint the index names all
//! that it knows of; what an earlier run left is removed only after the new one has succeeded. What goes into the files
//! is collected first ([`collect`]), so that they can be written and synced while the next step is solved. Does not
//! write the report.

use std::{
    borrow::Cow,
    io,
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
        mpsc::Receiver,
    },
    time::{Duration, Instant},
};

use wfl_discrete::{assemble::AssembledTerm, finite::BadOutput};
use wfl_output::{MEASURES_FILE, OutputDir, OutputError, Piece, Plan, REPORT_FILE, Series, write_csv};
use wfl_problem::{CsvOutput, Scene, Solving, StepPlace};

use super::{CHECKPOINT_FILE, CheckpointError, RunError, StepResult, checkpoint, others};

/// Where the steps of a run go; nowhere without a folder.
pub(super) struct Files<'d> {
    pub(super) dir: Option<&'d OutputDir>,
    series: Vec<Series<'d>>,
    /// Tables over the steps.
    over_time: Vec<Table>,
    /// Files written so far.
    pub(super) written: Vec<PathBuf>,
    /// What the last checkpoint took.
    pub(super) cost: CheckpointCost,
}

/// What the last checkpoint took, known to the thread that solves and to the one that writes.
#[derive(Clone, Debug, Default)]
pub(super) struct CheckpointCost(Arc<AtomicU64>);

impl CheckpointCost {
    fn set(&self, cost: Duration) {
        self.0.store(u64::try_from(cost.as_nanos()).unwrap_or(u64::MAX), Ordering::Relaxed);
    }

    /// The time, zero before the first one.
    pub(super) fn get(&self) -> Duration {
        Duration::from_nanos(self.0.load(Ordering::Relaxed))
    }
}

impl<'d> Files<'d> {
    pub(super) fn new(scene: &Scene, dir: Option<&'d OutputDir>) -> Self {
        let series = |dir| scene.vtk.iter().map(|v| Series::new(dir, v.file.clone())).collect();
        Self {
            dir,
            series: dir.map(series).unwrap_or_default(),
            over_time: tables_over_time(scene),
            written: Vec::new(),
            cost: CheckpointCost::default(),
        }
    }

    /// Takes over the files of steps that were done before, by whatever number of ranks: each step is taken whole or in
    /// parts, as it was written.
    pub(super) fn go_on_from(&mut self, scene: &Scene, steps: &[StepResult], dir: &OutputDir) -> Result<(), RunError> {
        let several = scene.steps.several();
        let Self { series, written, .. } = self;
        let mut adopt = |name: String| match dir.verify(&name)? {
            Some(file) => {
                written.push(file);
                Ok(())
            }
            None => Err(RunError::from(CheckpointError::Gone { path: dir.path().to_path_buf(), name })),
        };
        let lasting: Vec<Vec<bool>> = steps.iter().map(StepResult::lasting).collect();
        let place = |k: usize| StepPlace {
            number: k,
            time: steps[k].window.end,
            before: steps[k.saturating_sub(1)].window.end,
            events: &lasting[k],
        };
        for number in 0..steps.len() {
            let of_step = series.iter_mut().zip(&scene.vtk).filter(|(_, o)| o.every.has(place(number), &scene.steps));
            for (series, _) in of_step {
                series.go_on_from(number, steps[number].window.end, &mut adopt)?;
            }
            for output in scene.csv.iter().filter(|o| o.every.has(place(number), &scene.steps)) {
                adopt(csv_name(output, several.then_some(number)))?;
            }
        }
        for step in steps {
            self.add_rows(&step.series);
        }
        Ok(())
    }

    /// Writes a step.
    pub(super) fn write(&mut self, step: &StepFiles) -> Result<(), RunError> {
        let Some(dir) = self.dir else { return Ok(()) };
        self.add_rows(&step.rows);
        for (pieces, series) in step.grids.iter().zip(&mut self.series) {
            let Some(pieces) = pieces else { continue };
            let Some(others) = &step.others else {
                self.written.push(series.write_step(step.number, step.time, pieces)?);
                continue;
            };
            let gone = |_| OutputError::Write {
                file: dir.path().to_path_buf(),
                source: io::Error::other("the run has ended"),
            };
            let received = (1..others.ranks).map(|_| others.pieces.recv().map(Cow::Owned).map_err(gone));
            let parts = std::iter::once(Ok(Cow::Borrowed(pieces.as_slice()))).chain(received);
            self.written.extend(series.write_parts(step.number, step.time, parts)?);
        }
        for table in &step.tables {
            self.written.push(write_csv(dir, &table.name, &table.columns, &table.rows)?);
        }
        if let Some(content) = &step.checkpoint {
            let begin = Instant::now();
            self.update_index()?;
            self.write_over_time()?;
            checkpoint::write(content, dir)?;
            self.cost.set(begin.elapsed());
        }
        Ok(())
    }

    /// Adds the rows of a step to the tables over the steps.
    fn add_rows(&mut self, rows: &[Vec<Vec<f64>>]) {
        for (table, rows) in self.over_time.iter_mut().zip(rows) {
            table.rows.extend_from_slice(rows);
        }
    }

    /// Writes the tables over the steps as far as they go.
    fn write_over_time(&mut self) -> Result<(), RunError> {
        let Some(dir) = self.dir else { return Ok(()) };
        for table in &self.over_time {
            let path = write_csv(dir, &table.name, &table.columns, &table.rows)?;
            if !self.written.contains(&path) {
                self.written.push(path);
            }
        }
        Ok(())
    }

    /// Names all steps that were written.
    pub(super) fn update_index(&mut self) -> Result<(), RunError> {
        Ok(self.series.iter_mut().try_for_each(Series::update_index)?)
    }

    /// Brings everything up to date that goes over the steps.
    pub(super) fn catch_up(&mut self) -> Result<(), RunError> {
        self.update_index()?;
        self.write_over_time()
    }

    /// Removes the steps that an earlier, longer run left, and the checkpoint that is of no use any more.
    pub(super) fn finish(&mut self, scene: &Scene) -> Result<(), RunError> {
        for series in self.series.drain(..) {
            series.finish()?;
        }
        let Some(dir) = self.dir else { return Ok(()) };
        // before the checkpoint goes: a power cut leaves one or the other
        dir.sync()?;
        for csv in &scene.csv {
            dir.remove_stale_steps(&csv.file, "csv")?;
        }
        dir.remove(CHECKPOINT_FILE)?;
        dir.remove(checkpoint::LOG_FILE)?;
        Ok(())
    }
}

/// The names that a run of a scene uses.
pub(super) fn plan(scene: &Scene) -> Plan {
    let n = scene.steps.listed().unwrap_or(usize::MAX);
    let mesh = &scene.system.mesh;
    let (grids, parts) = mesh.part_of_whole().map_or(("vtu", 0), |part| ("pvtu", part.team().size()));
    let mut plan = Plan { files: vec![REPORT_FILE.to_owned()], series: Vec::new(), parts };
    if scene.has_measures() {
        plan.files.push(MEASURES_FILE.to_owned());
    }
    plan.files.extend(tables_over_time(scene).into_iter().map(|table| table.name));
    for output in &scene.vtk {
        plan.files.push(format!("{}.pvd", output.file));
        plan.series.push((output.file.clone(), grids, n));
    }
    if n > 1 {
        plan.files.extend([CHECKPOINT_FILE, checkpoint::LOG_FILE].map(str::to_owned));
        plan.series.extend(scene.csv.iter().map(|csv| (csv.file.clone(), "csv", n)));
    } else {
        plan.files.extend(scene.csv.iter().map(|csv| csv_name(csv, None)));
    }
    plan
}

/// Writes the measures of all steps in one table: a column for the step variable, one for each measure, a row a step. No
/// file for a scene without measures.
///
/// # Errors
/// As [`write_csv`].
pub(super) fn write_measures(
    dir: &OutputDir,
    variable: Option<&str>,
    steps: &[StepResult],
) -> Result<Option<PathBuf>, OutputError> {
    let Some(last) = steps.last().filter(|s| !s.measures.is_empty()) else { return Ok(None) };
    let names = last.measures.iter().map(|(name, _)| name.as_str());
    let columns: Vec<&str> = std::iter::once(variable.unwrap_or("t")).chain(names).collect();
    let row =
        |s: &StepResult| std::iter::once(s.window.end).chain(s.measures.iter().map(|m| m.1)).collect::<Vec<f64>>();
    let rows: Vec<Vec<f64>> = steps.iter().map(row).collect();
    write_csv(dir, MEASURES_FILE, &columns, &rows).map(Some)
}

/// The series of the scene, without rows.
fn tables_over_time(scene: &Scene) -> Vec<Table> {
    let variable = scene.steps.variable.clone().unwrap_or_else(|| "t".to_owned());
    let series = |output: &CsvOutput| Table {
        name: format!("{}.csv", output.file),
        columns: std::iter::once(variable.clone()).chain(output.line.columns().into_iter().skip(1)).collect(),
        rows: Vec::new(),
    };
    scene.series.iter().map(series).collect()
}

/// The table of a step with this number, or of the only one.
fn csv_name(output: &CsvOutput, number: Option<usize>) -> String {
    number.map_or_else(|| format!("{}.csv", output.file), |number| wfl_output::step_name(&output.file, number, "csv"))
}

/// Everything that the files of a step hold.
pub(super) struct StepFiles {
    pub(super) number: usize,
    pub(super) time: f64,
    /// The pieces that this rank has of each VTU output of the scene, if it has this step.
    pub(super) grids: Vec<Option<Vec<Piece>>>,
    /// Where each rank has a part of the mesh: what brings the pieces of the others, grid after grid.
    pub(super) others: Option<OfOthers>,
    pub(super) tables: Vec<Table>,
    /// What it adds to the tables over the steps.
    pub(super) rows: Vec<Vec<Vec<f64>>>,
    /// The checkpoint, in runs of several steps if the last one is old.
    pub(super) checkpoint: Option<checkpoint::Content>,
}

/// The pieces of other ranks.
pub(super) struct OfOthers {
    /// How many ranks there are.
    pub(super) ranks: usize,
    /// Brings the pieces of one after the other.
    pub(super) pieces: Receiver<Vec<Piece>>,
}

impl StepFiles {
    /// True if no file has anything of this step.
    pub(super) fn is_empty(&self) -> bool {
        self.grids.iter().all(Option::is_none)
            && self.tables.is_empty()
            && self.rows.is_empty()
            && self.checkpoint.is_none()
    }
}

/// The number of a face that slips in `contact_state`.
const SLIPS: f64 = 1.0;

/// The states of contact of faces from those of two terms on them, in whatever order they stand: one that slips does so under the
/// pressure of the other one, and what touches one stop is in contact.
fn joined(mut one: Vec<f64>, other: Vec<f64>) -> Vec<f64> {
    let slips = |a: f64, b: f64| a == SLIPS || b == SLIPS;
    one.iter_mut().zip(other).for_each(|(a, b)| *a = if slips(*a, b) { SLIPS } else { a.max(b) });
    one
}

/// A table under the name of its file.
pub(super) struct Table {
    pub(super) name: String,
    pub(super) columns: Vec<String>,
    pub(super) rows: Vec<Vec<f64>>,
}

/// What the scene wants in the files of a step, and what of it is not finite; the checkpoint is left to the caller.
pub(super) fn collect(scene: &Solving<'_>, step: &StepResult, place: StepPlace<'_>) -> (StepFiles, Vec<BadOutput>) {
    let (window, number) = (step.window, place.number);
    let time = window.end;
    let rows = step.series.clone();
    let Solving { system, contact, scene: Scene { vtk, csv, steps, .. } } = scene;
    let state = system.values(&step.state);
    let values = state.view();
    let mut grids = Vec::with_capacity(vtk.len());
    let mut bad = Vec::new();
    for output in vtk {
        if !output.every.has(place, steps) {
            grids.push(None);
            continue;
        }
        let mut pieces = Vec::with_capacity(output.pieces.len());
        for sampled in &output.pieces {
            let mut piece = sampled.sample(&system.mesh, window, values);
            let entities = piece.cells.len();
            let here = |t: &AssembledTerm| t.place.as_deref() == Some(sampled.support());
            let terms = system.terms.iter().zip(&step.branches).enumerate();
            let of_terms = terms.filter(|(k, (t, _))| here(t) && contact.pushes(system, *k));
            let states = of_terms.filter_map(|(_, (t, branches))| t.contact_states(branches));
            let states = states.filter(|s| s.len() == entities).reduce(joined);
            // a rank without faces takes other terms without any for those of the piece
            let is_there = system.mesh.holders().all(states.is_some());
            if let Some(states) = states.filter(|_| is_there) {
                piece.cell_data.push(wfl_output::Array::scalar("contact_state", states));
            }
            pieces.push(sampled.written(piece));
        }
        pieces.iter().for_each(|piece| bad.extend(not_finite(piece, &output.file, time)));
        grids.push(Some(pieces));
    }
    let tables = csv
        .iter()
        .filter(|output| output.every.has(place, steps))
        .map(|output| Table {
            name: csv_name(output, steps.several().then_some(number)),
            columns: output.line.columns(),
            rows: output.line.rows(&system.mesh, window, values, |name, value, position| {
                let what = format!("`{name}` in `{}.csv`", output.file);
                bad.push(BadOutput { what, time, value, position });
            }),
        })
        .collect();
    let bad = others::bad_of_all(bad, &system.mesh);
    (StepFiles { number, time, grids, others: None, tables, rows, checkpoint: None }, bad)
}

/// The quantities of a piece that are not finite, each with the first such value.
fn not_finite<'a>(piece: &'a Piece, file: &'a str, time: f64) -> impl Iterator<Item = BadOutput> + 'a {
    let point = |k: usize| piece.points[k];
    let corner = |k: usize| piece.cells.first_node(k).map_or([0.0; 3], |n| piece.points[n as usize]);
    let of = move |array: &wfl_output::Array, place: &dyn Fn(usize) -> [f64; 3]| {
        let bad = array.values.iter().position(|v| !v.is_finite())?;
        let what = format!("`{}` in `{file}.vtu`", array.name);
        Some(BadOutput { what, time, value: array.values[bad], position: place(bad / array.components.max(1)) })
    };
    let points = piece.point_data.iter().filter_map(move |a| of(a, &point));
    points.chain(piece.cell_data.iter().filter_map(move |a| of(a, &corner)))
}

/// Puts names of files into the order of the outputs of a scene, and of their steps: a run that was interrupted lists the
/// same as one that was not.
pub(super) fn in_order(scene: &Scene, names: &mut [String]) {
    let bases = scene.vtk.iter().map(|o| &o.file).chain(scene.csv.iter().chain(&scene.series).map(|o| &o.file));
    let bases: Vec<&String> = bases.collect();
    let is_of = |name: &str, base: &str| {
        let rest = name.strip_prefix(base).unwrap_or_default();
        rest.starts_with('.') || rest.strip_prefix('_').is_some_and(|r| r.starts_with(|c: char| c.is_ascii_digit()))
    };
    let rank = |name: &str| bases.iter().position(|base| is_of(name, base)).unwrap_or(bases.len());
    // numbers of steps have at least four digits
    names.sort_by_cached_key(|name| (rank(name), name.len(), name.clone()));
}
