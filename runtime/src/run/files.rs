//! The files of a scene: one VTU and one CSV a step, as its `output` statements say.
//!
//! Promises: a step is written whole or not at all, steps in their order, and with a checkpoint the index names all that
//! it knows of; what an earlier run left is removed only after
//! the new one has succeeded. What goes into the files is collected first ([`collect`]), so that they can be written and
//! synced while the next step is solved. Does not write the report.

use std::path::PathBuf;

use super::{CHECKPOINT_FILE, CheckpointError, RunError, StepResult, checkpoint};
use crate::{
    assemble::{AssembledTerm, FieldValues},
    output::{self, OutputDir, Piece, Series, write_csv},
    scene::{CsvOutput, Scene},
};

/// Where the steps of a run go; nowhere without a folder.
pub(super) struct Files<'d> {
    pub(super) dir: Option<&'d OutputDir>,
    series: Vec<Series<'d>>,
    /// Files written so far.
    pub(super) written: Vec<PathBuf>,
}

impl<'d> Files<'d> {
    pub(super) fn new(scene: &Scene, dir: Option<&'d OutputDir>) -> Self {
        let series = |dir| scene.vtk.iter().map(|v| Series::new(dir, v.file.clone())).collect();
        Self { dir, series: dir.map(series).unwrap_or_default(), written: Vec::new() }
    }

    /// Takes over the files of steps that were done before.
    pub(super) fn go_on_from(&mut self, scene: &Scene, steps: &[StepResult], dir: &OutputDir) -> Result<(), RunError> {
        let several = scene.steps.values.len() > 1;
        let path = dir.path().join(CHECKPOINT_FILE);
        let gone = |name: &str| CheckpointError::Other {
            path: path.clone(),
            what: format!("results that are gone (`{name}`)"),
        };
        let mut adopt = |name: String| match dir.adopt(&name) {
            Some(file) => {
                self.written.push(file);
                Ok(())
            }
            None => Err(gone(&name)),
        };
        for number in 0..steps.len() {
            for output in &scene.vtk {
                adopt(output::step_name(&output.file, number, "vtu"))?;
            }
            for output in &scene.csv {
                adopt(csv_name(output, number, several))?;
            }
        }
        let times: Vec<f64> = steps.iter().map(|s| s.time).collect();
        self.series.iter_mut().for_each(|s| s.go_on_from(&times));
        Ok(())
    }

    /// Writes a step.
    pub(super) fn write(&mut self, step: &StepFiles) -> Result<(), RunError> {
        let Some(dir) = self.dir else { return Ok(()) };
        for (pieces, series) in step.grids.iter().zip(&mut self.series) {
            self.written.push(series.write_step(step.time, pieces)?);
        }
        for table in &step.tables {
            self.written.push(write_csv(dir, &table.name, &table.columns, &table.rows)?);
        }
        if let Some(content) = &step.checkpoint {
            self.update_index()?;
            checkpoint::write(content, dir)?;
        }
        Ok(())
    }

    /// Names all steps that were written.
    pub(super) fn update_index(&mut self) -> Result<(), RunError> {
        Ok(self.series.iter_mut().try_for_each(Series::update_index)?)
    }

    /// Removes the steps that an earlier, longer run left, and the checkpoint that is of no use any more.
    pub(super) fn finish(&mut self, scene: &Scene) -> Result<(), RunError> {
        for series in self.series.drain(..) {
            series.finish()?;
        }
        let Some(dir) = self.dir.filter(|_| scene.steps.values.len() > 1) else { return Ok(()) };
        for csv in &scene.csv {
            dir.remove_stale_steps(&csv.file, "csv")?;
        }
        dir.remove(CHECKPOINT_FILE)?;
        dir.remove(checkpoint::LOG_FILE)?;
        Ok(())
    }
}

fn csv_name(output: &CsvOutput, number: usize, several: bool) -> String {
    if several { output::step_name(&output.file, number, "csv") } else { format!("{}.csv", output.file) }
}

/// Everything that the files of a step hold.
pub(super) struct StepFiles {
    time: f64,
    /// One list of pieces for each VTU output of the scene.
    grids: Vec<Vec<Piece>>,
    tables: Vec<Table>,
    /// Where the run stands, in runs of several steps where the last checkpoint is old.
    pub(super) checkpoint: Option<checkpoint::Content>,
}

struct Table {
    name: String,
    columns: Vec<String>,
    rows: Vec<Vec<f64>>,
}

/// What the scene wants in the files of a step; the checkpoint is left to the caller.
pub(super) fn collect(scene: &mut Scene, step: &StepResult, number: usize) -> StepFiles {
    let several = scene.steps.values.len() > 1;
    let (time, increment) = (step.time, step.increment);
    let Scene { system, vtk, csv, .. } = scene;
    let current = system.slices(&step.state);
    let previous = system.previous_slices();
    let values = FieldValues { current: &current, previous: &previous };
    let mut grids = Vec::with_capacity(vtk.len());
    for output in vtk {
        let mut pieces = Vec::with_capacity(output.pieces.len());
        for sampled in &mut output.pieces {
            let mut piece = sampled.sample(&system.mesh, time, increment, values);
            let entities = piece.cells.len();
            // the terms hold the branches of the converged state: the last residual was taken there
            let here = |t: &&AssembledTerm| t.place.as_ref() == Some(sampled.support());
            let states = system.terms.iter().filter(here).find_map(AssembledTerm::contact_states);
            if let Some(states) = states.filter(|s| s.len() == entities) {
                piece.cell_data.push(output::Array::scalar("contact_state", states));
            }
            pieces.push(piece);
        }
        grids.push(pieces);
    }
    let tables = csv
        .iter_mut()
        .map(|output| Table {
            name: csv_name(output, number, several),
            columns: output.line.columns(),
            rows: output.line.rows(&system.mesh, time, increment, values),
        })
        .collect();
    StepFiles { time, grids, tables, checkpoint: None }
}
