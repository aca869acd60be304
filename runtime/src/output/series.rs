//! The steps of a run as one animation: step files and their index, `base.pvd`.
//!
//! Promises: the index names whole step files of one run only, so that an interrupted run can be opened;
//! step files left by an earlier run of the same name stay until [`Series::finish`], and are untouched
//! if the new run fails before.
//! Does not keep an earlier result: step files of the same number are replaced. Does not decide when
//! the index is brought up to date.

use std::io::{self, Write};
use std::path::PathBuf;

use super::vtu::{XML_DECLARATION, escape, stage_vtu};
use super::{OutputDir, OutputError, Piece, step_name};

/// Step files `base_0000.vtu`, `base_0001.vtu`, ... with the index `base.pvd`.
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

    /// Goes on behind steps that are in the folder already, written by a run that was stopped: their numbers and times.
    pub fn go_on_from(&mut self, steps: impl Iterator<Item = (usize, f64)>) {
        self.steps = steps.map(|(number, time)| (time, step_name(&self.base, number, "vtu"))).collect();
        self.indexed = 0;
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
        if self.steps.is_empty() && self.dir.path().join(self.index_name()).exists() {
            // From the next line on an index of an earlier run would name files of two runs.
            self.write_index()?;
        }
        let file = staged.commit_unsynced()?;
        self.steps.push((time, name));
        Ok(file)
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
        self.dir.remove_stale_steps(&self.base, "vtu")
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
mod tests {
    use super::super::scratch::Scratch;
    use super::super::{Array, VtkCell};
    use super::*;

    fn grid(value: f64) -> Vec<Piece> {
        vec![Piece {
            points: vec![[value, 0.0, 0.0]],
            cells: [(VtkCell::Vertex, vec![0])].into_iter().collect(),
            point_data: vec![Array::scalar("u", vec![value])],
            cell_data: Vec::new(),
        }]
    }

    /// Runs a series over `times` and leaves it unfinished.
    fn run<'d>(dir: &'d OutputDir, times: &[f64]) -> Series<'d> {
        let mut series = Series::new(dir, "hertz");
        for (number, &time) in times.iter().enumerate() {
            series.write_step(number, time, &grid(time)).unwrap();
            series.update_index().unwrap();
        }
        series
    }

    /// Times and files of the index, in order.
    fn index(scratch: &Scratch) -> Vec<(f64, String)> {
        let text = scratch.read("hertz.pvd");
        let value = |line: &str, key: &str| {
            let rest = line.split_once(&format!("{key}=\"")).unwrap().1;
            rest.split_once('"').unwrap().0.to_owned()
        };
        text.lines()
            .filter(|line| line.starts_with("<DataSet"))
            .map(|line| (value(line, "timestep").parse().unwrap(), value(line, "file")))
            .collect()
    }

    #[test]
    fn the_index_names_the_steps_up_to_its_last_update() {
        let scratch = Scratch::new();
        let dir = OutputDir::create(scratch.path()).unwrap();
        let mut series = Series::new(&dir, "hertz");
        for (step, time) in [0.1, 1.0 / 3.0, 1e-300].into_iter().enumerate() {
            let file = series.write_step(step, time, &grid(time)).unwrap();
            assert_eq!(file, scratch.path().join(format!("hertz_000{step}.vtu")));
            if step == 1 {
                assert_eq!(index(&scratch).len(), 1);
                continue;
            }
            series.update_index().unwrap();
            let steps = index(&scratch);
            assert_eq!(steps.len(), step + 1);
            assert_eq!(steps[step], (time, format!("hertz_000{step}.vtu")));
        }
    }

    #[test]
    fn a_shorter_second_run_cleans_up_only_when_it_has_finished() {
        let scratch = Scratch::new();
        drop(OutputDir::create(scratch.path()).map(|dir| drop(run(&dir, &[0.0, 1.0, 2.0]))));
        let dir = OutputDir::create(scratch.path()).unwrap();
        let series = run(&dir, &[7.0]);
        assert_eq!(index(&scratch), [(7.0, "hertz_0000.vtu".to_owned())]);
        let with_leftovers = scratch.names();
        let removed = series.finish().unwrap();
        assert_eq!(removed, ["hertz_0001.vtu", "hertz_0002.vtu"]);
        // with the manifest and the lock
        assert_eq!(with_leftovers.len(), 4 + 2);
        drop(dir);
        assert_eq!(scratch.names(), ["hertz.pvd", "hertz_0000.vtu", "manifest.json"]);
    }

    #[test]
    fn a_run_that_fails_at_its_first_step_touches_nothing() {
        let scratch = Scratch::new();
        drop(OutputDir::create(scratch.path()).map(|dir| drop(run(&dir, &[0.0, 1.0]))));
        let dir = OutputDir::create(scratch.path()).unwrap();
        let before = (scratch.names(), scratch.read("hertz.pvd"));
        let mut series = Series::new(&dir, "hertz");
        assert!(matches!(series.write_step(0, f64::NAN, &grid(0.0)), Err(OutputError::Time { .. })));
        assert!(matches!(series.write_step(0, 0.0, &[]), Err(OutputError::Vtu { .. })));
        assert_eq!(series.finish().unwrap(), [""; 0]);
        assert_eq!((scratch.names(), scratch.read("hertz.pvd")), before);
    }

    #[test]
    fn an_index_of_two_runs_never_exists() {
        let scratch = Scratch::new();
        drop(OutputDir::create(scratch.path()).map(|dir| drop(run(&dir, &[0.0, 1.0]))));
        // The step file cannot be renamed into place: the run stops between index and step.
        std::fs::remove_file(scratch.path().join("hertz_0000.vtu")).unwrap();
        std::fs::create_dir(scratch.path().join("hertz_0000.vtu")).unwrap();
        let dir = OutputDir::create(scratch.path()).unwrap();
        let mut series = Series::new(&dir, "hertz");
        assert!(series.write_step(0, 5.0, &grid(5.0)).is_err());
        assert_eq!(index(&scratch), []);
    }

    #[test]
    fn the_same_run_gives_the_same_bytes() {
        let [first, second] = [Scratch::new(), Scratch::new()];
        for scratch in [&first, &second] {
            let dir = OutputDir::create(scratch.path()).unwrap();
            run(&dir, &[0.0, 0.5]).finish().unwrap();
        }
        assert_eq!(first.names(), second.names());
        for name in first.names() {
            let read = |scratch: &Scratch| std::fs::read(scratch.path().join(&name)).unwrap();
            assert_eq!(read(&first), read(&second), "{name}");
        }
    }
}
