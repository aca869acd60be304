//! The folder of a run: its report, and the files of each step.

use std::path::{Path, PathBuf};

use wfl_host::input::{InputError, InputKind, read_input};
use wfl_output::{
    Kind, MANIFEST_FILE, MEASURES_FILE, OutputDir, OutputError, REPORT_FILE, Report, State, part_of, record::MESH_FILE,
    sources,
};

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// No such folder.
    #[error("there is no folder `{}`", .0.display())]
    NoFolder(PathBuf),
    /// A folder without a report: no run, or one that was killed.
    #[error("`{}` has no {REPORT_FILE}: no run has ended in this folder", .0.display())]
    NoReport(PathBuf),
    /// A report, and nothing that says which files belong to it.
    #[error("`{}` has no {MANIFEST_FILE}: it is not known which of its files belong to the run", .0.display())]
    NoManifest(PathBuf),
    /// A run was killed here, and what the folder has of reports is of an earlier one.
    #[error("the last run in `{}` has not ended: it was stopped before its {REPORT_FILE} was written", .0.display())]
    NotEnded(PathBuf),
    /// The folder cannot be used, or a file in it is not what the run wrote.
    #[error(transparent)]
    Folder(#[from] OutputError),
    /// A file cannot be read.
    #[error("cannot read `{}`: {source}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// Why.
        source: InputError,
    },
    /// The report is cut off, or no report.
    #[error("`{}` is damaged: {source}", file.display())]
    Json {
        /// The file.
        file: PathBuf,
        /// Where and why.
        source: serde_json::Error,
    },
    /// A result file is cut off or of another kind.
    #[error("`{}` is damaged: {what}", file.display())]
    Damaged {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        what: String,
    },
}

/// Files of one name, one a step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Series {
    /// The name without number and ending.
    pub(crate) name: String,
    /// Number of the step and file, in the order of the steps.
    pub(crate) steps: Vec<(usize, PathBuf)>,
}

/// What a run left, in a folder that nobody else writes to as long as this lives.
#[derive(Debug)]
pub struct RunFolder {
    dir: OutputDir,
    pub(crate) report: Report,
    pub(crate) grids: Vec<Series>,
    pub(crate) tables: Vec<Series>,
    /// The mesh of a run with a demanded accuracy.
    pub(crate) mesh: Option<PathBuf>,
    /// Another run, whose numbers are taken off those of this one in pictures of fields.
    pub(crate) minus: Option<Box<RunFolder>>,
}

impl RunFolder {
    /// Reads the report of a run and finds its files: those that report and manifest of the folder name.
    ///
    /// # Errors
    /// [`ReportError`] when there is no whole report of the run that the folder holds.
    pub fn read(folder: &Path) -> Result<Self, ReportError> {
        if !folder.is_dir() {
            return Err(ReportError::NoFolder(folder.to_owned()));
        }
        let dir = OutputDir::open(folder)?;
        let state = match dir.holds() {
            Some((Kind::Run, state, _)) => state,
            Some((other, ..)) => {
                return Err(OutputError::OtherKind { path: folder.to_owned(), holds: other.words() }.into());
            }
            None if folder.join(REPORT_FILE).exists() => return Err(ReportError::NoManifest(folder.to_owned())),
            None => return Err(ReportError::NoReport(folder.to_owned())),
        };
        if state == State::Running || dir.verify(REPORT_FILE)?.is_none() {
            return Err(ReportError::NotEnded(folder.to_owned()));
        }
        let file = folder.join(REPORT_FILE);
        let text = bytes(&file)?;
        let report: Report =
            serde_json::from_slice(&text).map_err(|source| ReportError::Json { file: file.clone(), source })?;
        if !report.is_in(&dir) {
            return Err(damaged(&file, "its content is not what was written"));
        }
        let own = dir.own_files();
        for name in &report.files {
            if !own.contains(name) || dir.verify(name)?.is_none() {
                return Err(damaged(&folder.join(name), "it is missing"));
            }
        }
        for list in report.files.iter().filter(|name| name.ends_with(".pvtu")) {
            let file = folder.join(list);
            let known = |name: &String| report.files.contains(name);
            let found = parts(&file)?.into_iter().find(|name| !known(name));
            if let Some(name) = found {
                return Err(damaged(&file, format!("`{name}` is no file of the run")));
            }
        }
        let mut grids = series(folder, &report.files, &[".vtu", ".pvtu"]);
        grids.retain(|s| s.steps.iter().all(|(_, file)| !file.ends_with(MESH_FILE)));
        let mesh = report.files.iter().any(|f| f == MESH_FILE).then(|| folder.join(MESH_FILE));
        let mut tables = series(folder, &report.files, &[".csv"]);
        // the charts over the steps have the measures; tables are lines through the body
        tables.retain(|s| s.steps.iter().all(|(_, file)| !file.ends_with(MEASURES_FILE)));
        Ok(RunFolder { dir, report, grids, tables, mesh, minus: None })
    }

    /// This run with another one, whose numbers are taken off in pictures of fields; lines show both.
    #[must_use]
    pub fn minus(self, other: RunFolder) -> Self {
        Self { minus: Some(Box::new(other)), ..self }
    }

    /// The name of the folder.
    pub(crate) fn folder_name(&self) -> String {
        let path = self.dir.path();
        path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
    }

    /// The folder, to put a page into.
    #[must_use]
    pub fn dir(&self) -> &OutputDir {
        &self.dir
    }

    /// The report of the run.
    #[must_use]
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// The value of the step variable at a step; NaN if the report lacks it.
    pub(crate) fn time(&self, step: usize) -> f64 {
        self.report.steps.get(step).map_or(f64::NAN, |s| s.t.0)
    }

    /// The scene maps faces of one body onto another: they need not touch where nothing is deformed.
    pub(crate) fn is_mapped(&self) -> bool {
        let texts = self.report.about.texts.first();
        let mapped = texts.is_some_and(|t| t.text.lines().any(|line| line.starts_with("mapping ")));
        mapped && self.report.steps.iter().any(|s| s.contact.is_some())
    }

    /// The name of the step variable.
    pub(crate) fn variable(&self) -> &str {
        self.report.about.step_variable.as_deref().unwrap_or("t")
    }

    /// A name with its unit in brackets, where the scene has one.
    pub(crate) fn with_unit(&self, name: &str, unit_of: &str) -> String {
        match self.report.about.units.get(unit_of).map(String::as_str) {
            None | Some("not known") => name.to_owned(),
            Some("pure number" | "1") => format!("{name} [-]"),
            Some(unit) => format!("{name} [{unit}]"),
        }
    }
}

/// The files with one of these endings. Of a step in parts that is the list of them: they are read through it.
fn series(folder: &Path, files: &[String], endings: &[&str]) -> Vec<Series> {
    let mut found: Vec<Series> = Vec::new();
    for file in files.iter().filter(|file| part_of(file).is_none()) {
        let Some(stem) = endings.iter().find_map(|ending| file.strip_suffix(ending)) else { continue };
        let (name, step) = numbered(stem).unwrap_or((stem, 0));
        let entry = (step, folder.join(file));
        match found.iter_mut().find(|s| s.name == name) {
            Some(known) => known.steps.push(entry),
            None => found.push(Series { name: name.to_owned(), steps: vec![entry] }),
        }
    }
    for one in &mut found {
        one.steps.sort();
        one.steps.dedup();
    }
    found
}

/// `name_0012` as name and number.
fn numbered(stem: &str) -> Option<(&str, usize)> {
    let (name, digits) = stem.rsplit_once('_')?;
    (digits.len() >= 4 && digits.bytes().all(|b| b.is_ascii_digit())).then(|| Some((name, digits.parse().ok()?)))?
}

/// The bytes of a result file.
pub(crate) fn bytes(file: &Path) -> Result<Vec<u8>, ReportError> {
    read_input(file, InputKind::Results).map_err(|source| ReportError::Read { file: file.to_owned(), source })
}

/// The names of the files that a list of parts has.
pub(crate) fn parts(list: &Path) -> Result<Vec<String>, ReportError> {
    let text = String::from_utf8(bytes(list)?).ok();
    text.as_deref().and_then(sources).ok_or_else(|| damaged(list, "it is no list of parts"))
}

pub(crate) fn damaged(file: &Path, what: impl Into<String>) -> ReportError {
    ReportError::Damaged { file: file.to_owned(), what: what.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_gathered_by_name_and_step() {
        let files = ["a_b_0001.vtu", "a_b_0000.vtu", "line.csv", "x_12.csv"].map(str::to_owned);
        let grids = series(Path::new("o"), &files, &[".vtu"]);
        assert_eq!(grids.len(), 1);
        assert_eq!(grids[0].name, "a_b");
        let steps: Vec<usize> = grids[0].steps.iter().map(|s| s.0).collect();
        assert_eq!(steps, [0, 1]);
        let tables = series(Path::new("o"), &files, &[".csv"]);
        assert_eq!(
            tables.iter().map(|t| (t.name.as_str(), t.steps[0].0)).collect::<Vec<_>>(),
            [("line", 0), ("x_12", 0)]
        );
    }

    #[test]
    fn a_step_in_parts_is_its_list() {
        let files = ["a_0000.vtu", "a_0001.p0000.vtu", "a_0001.p0001.vtu", "a_0001.pvtu"].map(str::to_owned);
        let grids = series(Path::new("o"), &files, &[".vtu", ".pvtu"]);
        let steps = [(0, Path::new("o/a_0000.vtu").to_owned()), (1, Path::new("o/a_0001.pvtu").to_owned())];
        assert_eq!(grids, [Series { name: "a".to_owned(), steps: steps.to_vec() }]);
    }
}
