//! Sweeps: scenes over lists of settings, their errors and costs in one table.
//!
//! Every run is made in this process with a fresh state, one at a time: times are those of a machine that does nothing
//! else. Several at once ([`Job::jobs`]) are not timed. A setting that fails stays in the table with its message and
//! time. A table that is there already is gone on with: its rows are not run again as long as everything that their
//! scene reads, its reference and the version of the program are the same; others are taken out, and that is told.
//!
//! `lists` reads the words, knobs of the runtime change scenes, `bench` runs a setting, `problem` says which settings
//! need a reference of their own, `reference` gives errors, `plan` orders the runs, `kept` says which rows
//! of an earlier table stay, `rows` makes a row of each, `table` keeps the rows; `front` and `page` read nothing but
//! these.

mod clock;
mod convergence;
mod examples;
mod front;
mod kept;
mod lists;
mod machine;
mod page;
mod plan;
mod problem;
mod reference;
mod references;
mod rows;
mod table;
mod verdict;

use std::{
    num::NonZeroUsize,
    path::{Path, PathBuf},
};

use wfl_adapt::knobs;
use wfl_compiler::backend::KernelBackend;
use wfl_output::{Kind, OutputDir, OutputError, Plan, State};
use wfl_problem::NO_SAMPLING;

use self::{lists::Knob, reference::Reference, references::reference_file, table::Row};
use crate::{
    Listener, available_threads,
    bench::{self, Bench, Known},
    ending::Ending,
    folder::told_later,
    limited_threads,
};

pub use examples::study;

/// What is swept.
#[derive(Clone)]
pub struct Job<'a> {
    /// Scenes, .wfl files, and knobs with their values: `gamma=1e4,1e6`.
    pub words: Vec<String>,
    /// What errors are taken against: `auto`, `exact`, `none`, or a file that another sweep left.
    pub reference: String,
    /// Knobs of the finer run, `KNOB=VALUE`, in place of what `auto` takes.
    pub reference_knob: Vec<String>,
    /// Times each setting is run.
    pub repeat: NonZeroUsize,
    /// Runs made at once.
    pub jobs: Option<NonZeroUsize>,
    /// Folder of table, page and plots.
    pub out: PathBuf,
    /// Threads of assembly and solver; all where nothing is said.
    pub threads: Option<NonZeroUsize>,
    /// Runs terms.
    pub backend: &'a dyn KernelBackend,
    /// Hears of each run.
    pub listener: &'a dyn Listener,
    /// The program, for runs of the study that are a process of their own.
    pub program: &'a Path,
}

/// A scene of a sweep.
struct Method {
    path: PathBuf,
    known: Known,
    /// What its errors are taken against, for each setting of the knobs that change the problem.
    references: Vec<Against>,
    /// Statements put behind its text.
    more: String,
}

/// What the errors of the runs of one problem are taken against.
#[derive(Clone)]
struct Against {
    /// The knobs that make it another problem.
    problem: Vec<(String, String)>,
    /// Which reference, or why there is none.
    found: Result<usize, String>,
}

/// Makes the runs that are not in the table yet, and table, page and plots. Gives how its runs ended:
/// [`Ending::NotConverged`] where one of them has no solution.
///
/// # Errors
/// In words; what was made is kept.
pub fn sweep(job: &Job<'_>) -> Result<Ending, String> {
    let (scenes, lists): (Vec<String>, Vec<String>) = job.words.iter().cloned().partition(|w| !w.contains('='));
    if scenes.is_empty() {
        return Err("no scene is given\n  = help: wfl sweep SCENE.wfl gamma=1e4,1e6".to_owned());
    }
    let knobs = lists::knobs(&lists).map_err(|e| e.to_string())?;
    let default = || if job.jobs.is_some_and(|n| n.get() > 1) { 1 } else { available_threads() };
    let threads = job.threads.map_or_else(default, |n| limited_threads(n.get(), job.listener));
    let mut methods = methods(&scenes, &knobs, job.backend)?;
    let dir = OutputDir::open(&job.out).map_err(|e| told_later(&e))?;
    let problems = problem::settings(&methods, &knobs);
    dir.go_on(Kind::Sweep, &plan(&methods, problems.len())).map_err(|e| told_later(&e))?;
    let _tidied = job.listener.writing(&job.out, "finished rows are kept: the same command continues");
    let mut sweep = Sweep {
        job,
        knobs: &knobs,
        bench: Bench {
            backend: job.backend,
            listener: job.listener,
            threads,
            only: None,
            last: false,
            rounds: &[],
            sampling: &NO_SAMPLING,
        },
        references: Vec::new(),
        problem_knobs: problems[0].iter().map(|k| k.0.clone()).collect(),
        rows: kept_rows(&dir)?,
        dir: &dir,
        machine: machine::describe(),
    };
    sweep.references(&mut methods, &problems)?;
    let ending = sweep.all(&methods)?;
    dir.finish(State::Finished).map_err(|e| told_later(&e))?;
    Ok(ending)
}

/// The names of the files of a sweep of so many problems.
fn plan(methods: &[Method], problems: usize) -> Plan {
    let mut files = vec![table::TABLE_FILE.to_owned(), page::PAGE_FILE.to_owned()];
    files.extend((1..=methods.len() * problems).map(reference_file));
    let outputs = methods.iter().flat_map(|m| &m.known.loaded.script.outputs).flat_map(|o| &o.items);
    let quantities = ["L2", "H1"].into_iter().chain(outputs.map(|i| i.name.as_str()));
    files.extend(quantities.flat_map(|q| [page::plot_name(q), convergence::file(q)]).map(|name| format!("{name}.svg")));
    Plan { files, ..Plan::default() }
}

/// The rows of earlier sweeps, if the table is what they wrote.
fn kept_rows(dir: &OutputDir) -> Result<Vec<Row>, String> {
    let changed = |e: OutputError| {
        let help = "its rows cannot be continued: move it away, or write elsewhere: --out DIR; wfl sweep --plot makes its page";
        format!("[E715]: {e}\n  = help: {help}")
    };
    match dir.verify(table::TABLE_FILE).map_err(changed)? {
        Some(_) => table::read(dir.path()).map_err(|e| e.to_string()),
        None => Ok(Vec::new()),
    }
}

/// Makes page and plots anew from the tables of sweeps.
///
/// # Errors
/// In words.
pub fn plot(folders: &[PathBuf], listener: &dyn Listener) -> Result<(), String> {
    for folder in folders {
        let rows = table::read(folder).map_err(|e| e.to_string())?;
        if rows.is_empty() {
            let help = "give the folder of a sweep: wfl sweep --plot DIR";
            return Err(format!("there is no {} in {}\n  = help: {help}", table::TABLE_FILE, folder.display()));
        }
        replot(folder, &rows).map_err(|e| told_later(&e))?;
        listener.result(&format!("{}\n", folder.join(page::PAGE_FILE).display()));
    }
    Ok(())
}

fn replot(folder: &Path, rows: &[Row]) -> Result<(), OutputError> {
    let dir = OutputDir::open(folder)?;
    let charts = page::charts(rows).into_iter().chain(convergence::charts(rows)).map(|(name, _)| format!("{name}.svg"));
    let files = charts.chain([page::PAGE_FILE.to_owned()]).collect();
    dir.go_on(Kind::Sweep, &Plan { files, ..Plan::default() })?;
    page::write(&dir, rows)?;
    dir.finish(State::Finished)
}

/// Reads the scenes and checks that every knob means something in each of them.
fn methods(scenes: &[String], knobs: &[Knob], backend: &dyn KernelBackend) -> Result<Vec<Method>, String> {
    let mut out = Vec::new();
    for scene in scenes {
        let path = PathBuf::from(scene);
        let known = bench::known(&path, &[], backend)?;
        let one = |knob: &Knob| Some((knob.name.clone(), knob.values.first()?.clone()));
        let setting: Vec<(String, String)> = knobs.iter().filter_map(one).collect();
        knobs::together(&known.loaded.script, &setting, &known.params).map_err(|e| format!("{scene}: {e}"))?;
        for knob in knobs {
            for value in &knob.values {
                let setting = [(knob.name.clone(), value.clone())];
                let mut script = known.loaded.script.clone();
                knobs::apply(&mut script, &setting, &known.params, &known.kinked)
                    .map_err(|e| format!("{scene}: {e}"))?;
            }
        }
        out.push(Method { path, known, references: Vec::new(), more: String::new() });
    }
    Ok(out)
}

struct Sweep<'a> {
    job: &'a Job<'a>,
    knobs: &'a [Knob],
    bench: Bench<'a>,
    references: Vec<Reference>,
    /// The knobs that change the problem.
    problem_knobs: Vec<String>,
    rows: Vec<Row>,
    dir: &'a OutputDir,
    machine: machine::Machine,
}
