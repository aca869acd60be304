//! A run begins in its folder, or goes on from the checkpoint there. Decides nothing about the folder: `folder` does.

use super::{
    CHECKPOINT_FILE, CheckpointError, Progress, Run, RunError, RunOptions, checkpoint, files::Files, folder,
    stepping::StepTime,
};
use crate::{
    newton::NewtonError,
    output::{Identity, OutputDir},
    scene::Scene,
};

impl Run {
    /// Begins in a folder, or goes on there where that is asked for.
    pub(super) fn take_up(
        &mut self,
        scene: &mut Scene,
        options: &RunOptions,
        identity: &Identity,
        files: &mut Files<'_>,
        dir: &OutputDir,
        progress: &mut dyn Progress,
    ) -> Result<(), RunError> {
        let found = if options.resume { folder::found(scene, identity, dir)? } else { None };
        match found {
            Some(found) => {
                self.go_on_from(found, scene, dir, progress)?;
                files.go_on_from(scene, &self.steps, dir)?;
                folder::go_on(scene, dir)?;
            }
            None => folder::begin(scene, identity, dir)?,
        }
        if options.resume {
            progress.resumed(self.steps.last());
        }
        Ok(())
    }

    /// Takes over what a checkpoint kept: the next step then finds everything as it was.
    fn go_on_from(
        &mut self,
        found: checkpoint::Found,
        scene: &mut Scene,
        dir: &OutputDir,
        progress: &mut dyn Progress,
    ) -> Result<(), RunError> {
        let misfit =
            || CheckpointError::Damaged { path: dir.path().join(CHECKPOINT_FILE), what: "it does not fit the scene" };
        let Some(last) = found.steps.last() else { return Ok(()) };
        if found.u.len() != self.u.len() || found.steps.len() > scene.steps.values.len() {
            return Err(misfit().into());
        }
        let wrap = |error: NewtonError| RunError::Newton { step: found.steps.len() - 1, time: last.time, error };
        self.clock = found.clock;
        let at = StepTime { time: last.time, increment: last.increment };
        self.stepper.prepare(scene, at, &mut self.clock, progress).map_err(wrap)?;
        let solver = self.stepper.solver.as_mut().expect("prepared above");
        let fits = solver.recall(&found.solver, &scene.system).map_err(|e| wrap(e.into()))?;
        solver.starts_elsewhere();
        if !(fits && self.stepper.recall(scene, &found.memory)) {
            return Err(misfit().into());
        }
        (self.stepper.level, self.stepper.easy) = (found.level, found.easy);
        (self.u, self.steps, self.log) = (found.u, found.steps, found.log);
        Ok(())
    }
}
