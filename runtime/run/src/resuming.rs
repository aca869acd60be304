//! A run begins in its folder, or goes on from the checkpoint there. Decides nothing about the folder: `folder` does.

use std::path::Path as FilePath;

use wfl_newton::NewtonError;
use wfl_output::{Identity, OutputDir};
use wfl_problem::Solving;

use super::{CHECKPOINT_FILE, CheckpointError, Progress, Run, RunError, RunOptions, checkpoint, files::Files, folder};

impl Run {
    /// Begins in a folder, or goes on there where that is asked for. Of several ranks the first one has the folder, and the
    /// others go on from what it has read.
    pub(super) fn take_up(
        &mut self,
        scene: &mut Solving<'_>,
        options: &RunOptions,
        identity: &Identity,
        files: &mut Files<'_>,
        progress: &mut dyn Progress,
    ) -> Result<(), RunError> {
        let dir = files.dir;
        let read = if options.resume { dir.map(|dir| folder::found(identity, dir)).transpose()? } else { None };
        let path = dir.map_or(FilePath::new(""), OutputDir::path);
        let read =
            if options.resume { read.unwrap_or_default().of_first(scene, path)? } else { checkpoint::Files::default() };
        if !read.is_empty() {
            let found = checkpoint::found(scene, identity.hash(), path, &read)?;
            self.go_on_from(found, scene, path, progress)?;
        }
        if let Some(dir) = dir {
            if read.is_empty() {
                folder::begin(scene, identity, dir)?;
            } else {
                files.go_on_from(scene, &self.steps, dir)?;
                folder::go_on(scene, dir)?;
            }
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
        scene: &mut Solving<'_>,
        folder: &FilePath,
        progress: &mut dyn Progress,
    ) -> Result<(), RunError> {
        let misfit =
            || CheckpointError::Damaged { path: folder.join(CHECKPOINT_FILE), what: "it does not fit the scene" };
        let Some(last) = found.steps.last() else { return Ok(()) };
        if scene.steps.listed().is_some_and(|n| found.steps.len() > n) {
            return Err(misfit().into());
        }
        let wrap = |error: NewtonError| RunError::Newton { step: found.steps.len() - 1, time: last.window.end, error };
        self.clock = found.clock;
        if !self.set_state(scene, found.state, last.window, progress).map_err(wrap)? {
            return Err(misfit().into());
        }
        (self.steps, self.log) = (found.steps, found.log);
        Ok(())
    }
}
