//! `wfl run --watch`: a page about the run that is written again while it goes on.
//!
//! Promises: the page is whole whenever it is read, and a page that cannot be written is told once and does not end the run.

use std::{
    io::Read as _,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use wfl_compiler::ir::Origin;
use wfl_newton::Iteration;
use wfl_report::{Watched, WatchedStep};
use wfl_run::{Progress, StepResult};

use crate::{load::say, plot::replace, progress::Terminal};

/// Time between two pages.
const BETWEEN: Duration = Duration::from_millis(700);
/// What a page of ours has at its beginning.
const OURS: &[u8] = b"<meta name=\"generator\" content=\"WFL\">";

/// Why a page may not take the place of a file; nothing where it may.
pub(crate) fn may_replace(file: &Path) -> Result<(), String> {
    if std::fs::symlink_metadata(file).is_err() {
        return Ok(());
    }
    let mut start = Vec::new();
    let regular = std::fs::symlink_metadata(file).is_ok_and(|m| m.is_file());
    let read = regular && std::fs::File::open(file).and_then(|f| f.take(1000).read_to_end(&mut start)).is_ok();
    if read && start.windows(OURS.len()).any(|w| w == OURS) {
        return Ok(());
    }
    let name = file.display();
    Err(format!(
        "{name} is there already and is no page of this program: it stays as it is\n  = help: --watch=other.html"
    ))
}

/// Shows a run on the terminal and in a page.
pub(crate) struct Watching {
    terminal: Terminal,
    file: PathBuf,
    watched: Watched,
    started: Instant,
    written: Option<Instant>,
    /// It cannot be written.
    failed: bool,
}

impl Watching {
    pub(crate) fn new(terminal: Terminal, file: PathBuf, scene: &str, variable: &str) -> Self {
        let watched = Watched { scene: scene.to_owned(), variable: variable.to_owned(), ..Watched::default() };
        let watching = Self { terminal, file, watched, started: Instant::now(), written: None, failed: false };
        say(&format!("watch the run in {}\n", watching.file.display()));
        watching
    }

    /// The last page: it loads itself no more.
    pub(crate) fn end(mut self) {
        self.watched.has_ended = true;
        self.write();
    }

    fn shown(&mut self) {
        if self.written.is_none_or(|at| at.elapsed() >= BETWEEN) {
            self.write();
        }
    }

    fn write(&mut self) {
        if self.failed {
            return;
        }
        self.watched.seconds = self.started.elapsed().as_secs_f64();
        if let Err(why) = replace(&self.file, self.watched.html().as_bytes()) {
            say(&why);
            self.failed = true;
        }
        self.written = Some(Instant::now());
    }
}

impl Progress for Watching {
    fn solver(&mut self, description: &str) {
        self.terminal.solver(description);
    }

    fn resumed(&mut self, last: Option<&StepResult>) {
        self.terminal.resumed(last);
    }

    fn step(&mut self, number: usize, count: Option<usize>, time: f64) {
        self.watched.count = count;
        if self.watched.steps.is_empty() {
            self.watched.before = number;
        }
        self.terminal.step(number, count, time);
        self.shown();
    }

    fn iteration(&mut self, iteration: &Iteration) {
        self.watched.iteration(iteration.residual, iteration.contact);
        self.terminal.iteration(iteration);
        self.shown();
    }

    fn printed(&mut self, term: &str, origin: Option<Origin>, position: [f64; 3], value: &[f64]) {
        self.terminal.printed(term, origin, position, value);
    }

    fn step_done(&mut self, step: &StepResult) {
        let contact = step.history.iterations.last().and_then(|i| i.contact);
        self.watched.steps.push(WatchedStep { time: step.window.end, measures: step.measures.clone(), contact });
        self.terminal.step_done(step);
        self.shown();
    }

    fn stops(&mut self) -> bool {
        self.terminal.stops()
    }
}
