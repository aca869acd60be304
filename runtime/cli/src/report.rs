//! `wfl report`.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use wfl_report::{Pages, Picture, ReportError, RunFolder};
use wfl_runtime::output::{OutputDir, OutputError};

use crate::{
    args::ReportArgs,
    load::{out, say},
    prepared::EXIT_ERROR,
};

/// The page in the folder of the run.
const PAGE_FILE: &str = "report.html";
/// The folder of the charts in it.
const PLOTS: &str = "plots";

pub(crate) fn report(args: &ReportArgs) -> ExitCode {
    match made(args) {
        Ok(said) => {
            out(&said);
            ExitCode::SUCCESS
        }
        Err(message) => {
            say(&message);
            ExitCode::from(EXIT_ERROR)
        }
    }
}

/// Writes the page and says where, or why not.
fn made(args: &ReportArgs) -> Result<String, String> {
    let run = RunFolder::read(&args.folder).map_err(|e| explained(&e))?;
    let pages = Pages::new(&run, &args.at).map_err(|e| explained(&e))?;
    let wrong = |e: OutputError| format!("error: {e}\n");
    let page = write(&args.folder, PAGE_FILE, &pages.page.html()).map_err(wrong)?;
    let mut said = format!("page in {}\n", page.display());
    if args.plots {
        let folder = args.folder.join(PLOTS);
        for Picture { name, chart } in &pages.pictures {
            write(&folder, &format!("{name}.svg"), &chart.svg()).map_err(wrong)?;
        }
        said += &format!("{} charts in {}\n", pages.pictures.len(), folder.display());
    }
    let steps = &run.report().steps;
    let failed = steps.iter().filter(|s| !s.converged).count();
    if run.report().error.is_some() || failed > 0 {
        said += "the run failed: the page begins with why\n";
    }
    Ok(said)
}

fn write(folder: &Path, name: &str, text: &str) -> Result<PathBuf, OutputError> {
    OutputDir::create(folder)?.write_atomic(name, |out| out.write_all(text.as_bytes()))
}

/// The message of an error, with what to do about it.
fn explained(error: &ReportError) -> String {
    let help = match error {
        ReportError::NoFolder(_) => "wfl run SCENE writes its results to out/<scene>; give that folder",
        ReportError::NoReport(_) => "wfl run SCENE --out DIR; a run that was killed goes on with --resume",
        ReportError::Json { .. } | ReportError::Damaged { .. } => {
            "run the scene again, with --resume to keep the steps that are whole"
        }
        ReportError::Read { .. } => "",
    };
    if help.is_empty() { format!("error: {error}\n") } else { format!("error: {error}\n  = help: {help}\n") }
}
