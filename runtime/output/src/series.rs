//! The steps of a run as one animation: step files and their index, `base.pvd`.
//!
//! Promises: the index names whole step files of one run only, so that an interrupted run can be opened; a step in parts
//! is there with all of them or not at all; step files left by an earlier run of the same name stay until
//! [`Series::finish`], and are untouched if the new run fails before.
//! Does not keep an earlier result: step files of the same number are replaced. Does not decide when
//! the index is brought up to date.

use std::io::{self, Write};
use std::path::PathBuf;

use super::names::{grid_step_of, part_name, step_beginning};
use super::parts::{files_of_step, same_outline, write_pvtu};
use super::vtu::{Outline, XML_DECLARATION, escape, stage_outlined, stage_vtu};
use super::{OutputDir, OutputError, Piece, VtuError, step_name};

/// Step files `base_0000.vtu`, `base_0001.vtu`, ... with the index `base.pvd`. A step whose grid ranks hold in parts has
/// `base_0000.p0000.vtu`, `base_0000.p0001.vtu`, ... and `base_0000.pvtu`, which names them.
#[derive(Debug)]
pub struct Series<'d> {
    dir: &'d OutputDir,
    base: String,
    /// Time and file name of every step written.
    steps: Vec<(f64, String)>,
    /// Of these, those the index names.
    indexed: usize,
}

impl<'d> Series<'d> {
    /// A series without steps; nothing is written or removed yet.
    #[must_use]
    pub fn new(dir: &'d OutputDir, base: impl Into<String>) -> Self {
        Series { dir, base: base.into(), steps: Vec::new(), indexed: 0 }
    }

    /// Goes on behind a step that is in the folder already, written by a run that was stopped: whole or in any number of
    /// parts, as it was written. `adopt` takes over each of its files by its name; the last one is that which the index
    /// names.
    ///
    /// # Errors
    /// Those of `adopt`; [`OutputError::Damaged`] for a list of parts that cannot be read. The step does not count then.
    pub fn go_on_from<E: From<OutputError>>(
        &mut self,
        number: usize,
        time: f64,
        adopt: &mut impl FnMut(String) -> Result<(), E>,
    ) -> Result<(), E> {
        let files = files_of_step(self.dir, &self.base, number)?;
        files.iter().cloned().try_for_each(adopt)?;
        self.remove_others(number, &files)?;
        let index = files.into_iter().next_back();
        self.steps.extend(index.map(|name| (time, name)));
        self.indexed = 0;
        Ok(())
    }

    /// Writes the next step and returns the path of its file; the index does not name it yet. Both are on the disc
    /// after [`OutputDir::sync`]. `number` counts the steps of the scene from 0, `time` is its step variable.
    ///
    /// # Errors
    /// [`OutputError::Vtu`], [`OutputError::Time`], [`OutputError::BadName`],
    /// [`OutputError::Write`].
    pub fn write_step(&mut self, number: usize, time: f64, pieces: &[Piece]) -> Result<PathBuf, OutputError> {
        let name = step_name(&self.base, number, "vtu");
        let staged = stage_vtu(self.dir, &name, Some(time), pieces)?;
        self.disown_index()?;
        let file = staged.commit_unsynced()?;
        self.remove_others(number, std::slice::from_ref(&name))?;
        self.steps.push((time, name));
        Ok(file)
    }

    /// [`Series::write_step`] for a grid that comes in parts, one a rank, and returns the paths of all its files, that
    /// which names the others last. `parts` is asked for one part after the other, and each is written and dropped before
    /// the next one is asked for. All parts have the same pieces (bodies, faces) in the same order with the same arrays;
    /// a piece of which a rank has nothing has no points and no cells, and its arrays no entries.
    ///
    /// # Errors
    /// Those of [`Series::write_step`], [`OutputError::Vtu`] also for parts that do not fit together, and those that
    /// `parts` gives. Until all parts are written under temporary names, the folder is as it was.
    pub fn write_parts<E: From<OutputError>>(
        &mut self,
        number: usize,
        time: f64,
        parts: impl IntoIterator<Item = Result<impl AsRef<[Piece]>, E>>,
    ) -> Result<Vec<PathBuf>, E> {
        let index = step_name(&self.base, number, "pvtu");
        let (mut staged, mut names) = (Vec::new(), Vec::new());
        let mut first: Option<Outline> = None;
        for (part, pieces) in parts.into_iter().enumerate() {
            let name = part_name(&self.base, number, part);
            let (file, own) = stage_outlined(self.dir, &name, Some(time), pieces?.as_ref())?;
            let wrong = |source| OutputError::Vtu { file: self.dir.path().join(&name), source };
            same_outline(part, first.get_or_insert_with(|| own.clone()), &own).map_err(wrong)?;
            staged.push(file);
            names.push(name);
        }
        let empty = || OutputError::Vtu { file: self.dir.path().join(&index), source: VtuError::NoPiece };
        let outline = first.ok_or_else(empty)?;
        let list = self.dir.stage(&index, |out| write_pvtu(out, time, &outline, &names))?;
        self.disown_index()?;
        // a kill from here on must not leave a list that names parts of two runs
        self.dir.remove(&index)?;
        staged.push(list);
        let files = staged.into_iter().map(|file| file.commit_unsynced()).collect::<Result<Vec<_>, _>>()?;
        names.push(index.clone());
        self.remove_others(number, &names)?;
        self.steps.push((time, index));
        Ok(files)
    }

    /// From the first step on an index of an earlier run would name files of two runs.
    fn disown_index(&self) -> Result<(), OutputError> {
        if self.steps.is_empty() && self.dir.path().join(self.index_name()).exists() {
            self.write_index()?;
        }
        Ok(())
    }

    /// Removes what this run wrote of a step before it was stopped, whole or in another number of parts.
    fn remove_others(&self, number: usize, keep: &[String]) -> Result<(), OutputError> {
        let own = self.dir.own_files_of(&step_beginning(&self.base, number));
        let other = |name: &&String| grid_step_of(name, &self.base) == Some(number) && !keep.contains(name);
        own.iter().filter(other).try_for_each(|name| self.dir.remove(name))
    }

    /// Brings the index up to date: it names all steps written so far.
    ///
    /// # Errors
    /// [`OutputError::Write`]. The index then names the steps that it named before.
    pub fn update_index(&mut self) -> Result<(), OutputError> {
        if self.indexed < self.steps.len() {
            self.write_index()?;
            self.indexed = self.steps.len();
        }
        Ok(())
    }

    /// Ends a successful run: step files of an earlier run that this one has not replaced are
    /// removed; returns their names. Not to be called after a failure. A series without steps
    /// removes nothing.
    ///
    /// # Errors
    /// [`OutputError::Remove`].
    pub fn finish(self) -> Result<Vec<String>, OutputError> {
        if self.steps.is_empty() {
            return Ok(Vec::new());
        }
        // lists before the parts that they name
        let mut removed = self.dir.remove_stale_steps(&self.base, "pvtu")?;
        removed.extend(self.dir.remove_former(|name| grid_step_of(name, &self.base).is_some())?);
        removed.sort();
        Ok(removed)
    }

    fn index_name(&self) -> String {
        format!("{}.pvd", self.base)
    }

    fn write_index(&self) -> Result<(), OutputError> {
        self.dir.write_unsynced(&self.index_name(), |out| write_pvd(out, &self.steps)).map(drop)
    }
}

/// A VTK collection: one data set a step.
fn write_pvd(out: &mut dyn Write, steps: &[(f64, String)]) -> io::Result<()> {
    out.write_all(XML_DECLARATION.as_bytes())?;
    writeln!(out, "<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">")?;
    writeln!(out, "<Collection>")?;
    for (time, file) in steps {
        let file = escape(file);
        writeln!(out, "<DataSet timestep=\"{time:?}\" group=\"\" part=\"0\" file=\"{file}\"/>")?;
    }
    writeln!(out, "</Collection>\n</VTKFile>")
}

#[cfg(test)]
#[path = "series_tests.rs"]
mod tests;
