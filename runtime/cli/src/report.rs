//! `wfl report`.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use wfl_output::{Kind, OutputDir, OutputError, Plan, State};
use wfl_report::{Pages, Picture, ReportError, RunFolder};
use wfl_tasks::folder::told_of_showing;

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
    let page = page(&run, &pages).map_err(|e| told_of_showing(&e))?;
    let mut said = format!("page in {}\n", page.display());
    if args.plots {
        let folder = args.folder.join(PLOTS);
        plots(&folder, &run, &pages).map_err(|e| told_of_showing(&e))?;
        said += &format!("{} charts in {}\n", pages.pictures.len(), folder.display());
    }
    let steps = &run.report().steps;
    let failed = steps.iter().filter(|s| !s.converged).count();
    if run.report().error.is_some() || failed > 0 {
        said += "the run failed: the page begins with the reason\n";
    }
    Ok(said)
}

/// Puts the page among the results of its run.
fn page(run: &RunFolder, pages: &Pages) -> Result<PathBuf, OutputError> {
    let page = run.dir().write_atomic(PAGE_FILE, |out| out.write_all(pages.page.html().as_bytes()))?;
    run.dir().settle()?;
    Ok(page)
}

/// Writes each chart into a folder of their own; those of an earlier page go.
fn plots(folder: &Path, run: &RunFolder, pages: &Pages) -> Result<(), OutputError> {
    if std::fs::symlink_metadata(folder).is_ok_and(|found| found.is_symlink()) {
        return Err(OutputError::Foreign { file: folder.to_owned(), what: "is a link to another place" });
    }
    let dir = OutputDir::open(folder)?;
    let names = pages.pictures.iter().map(|Picture { name, .. }| format!("{name}.svg"));
    let plan = Plan { files: names.collect(), ..Plan::default() };
    let identity = run.dir().holds().map(|(_, _, identity)| identity).unwrap_or_default();
    dir.begin(Kind::Charts, &identity, &plan)?;
    for (Picture { chart, .. }, name) in pages.pictures.iter().zip(&plan.files) {
        dir.write_atomic(name, |out| out.write_all(chart.svg().as_bytes()))?;
    }
    dir.remove_former(|_| true)?;
    dir.finish(State::Finished)
}

/// The message of an error, with what to do about it.
pub(crate) fn explained(error: &ReportError) -> String {
    let help = match error {
        ReportError::Folder(OutputError::Damaged { file, what }) => {
            return explained(&ReportError::Damaged { file: file.clone(), what: what.clone() });
        }
        ReportError::Folder(error) => return told_of_showing(error),
        ReportError::NoManifest(_) => "copy it along with the folder, or run the scene again into another one",
        ReportError::NotEnded(_) => "wfl run SCENE --resume ends it",
        ReportError::NoFolder(_) => "wfl run SCENE writes its results to out/<scene>; give that folder",
        ReportError::NoReport(_) => "wfl run SCENE --out DIR; a run that was killed goes on with --resume",
        ReportError::Json { .. } | ReportError::Damaged { .. } => "run the scene again",
        ReportError::Read { .. } => "",
    };
    if help.is_empty() { format!("error: {error}\n") } else { format!("error: {error}\n  = help: {help}\n") }
}
