//! The second thread: when a text has stayed as it is for a moment, the whole problem is made of it, as `wfl check` does.

use std::{
    any::Any,
    collections::BTreeMap,
    panic::{AssertUnwindSafe, catch_unwind},
    path::PathBuf,
    sync::Arc,
    time::Duration,
};

use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, unbounded};
use wfl::{Diagnostic, Span};
use wfl_compiler::{Class, InterpreterBackend};
use wfl_mesh::mesh::RegionSet;
use wfl_problem::Scene;
use wfl_tasks::{
    STACK,
    advice::before_run,
    scene_file::{OpenTexts, read_open_scene},
};

/// A scene that is to be checked, with the texts that are open.
pub(crate) struct Job {
    pub(crate) root: PathBuf,
    pub(crate) open: OpenTexts,
    /// Someone asked for it: the outcome is shown.
    pub(crate) asked: bool,
}

/// What a check found.
pub(crate) struct Found {
    pub(crate) root: PathBuf,
    pub(crate) asked: bool,
    /// Names and texts that were checked: places in them mean nothing in others.
    pub(crate) texts: Vec<(String, Arc<str>)>,
    pub(crate) messages: Vec<Diagnostic>,
    /// The problem, if there is one.
    pub(crate) problem: Option<Problem>,
}

/// What a problem is, in numbers.
#[derive(Clone, Debug)]
pub(crate) struct Problem {
    pub(crate) dim: usize,
    pub(crate) cells: usize,
    pub(crate) free: usize,
    /// Regions with what they are: `64 cells`.
    pub(crate) regions: BTreeMap<String, String>,
    /// Terms by their statements.
    pub(crate) terms: Vec<TermFacts>,
}

/// What `wfl check` tells of a term.
#[derive(Clone, Debug)]
pub(crate) struct TermFacts {
    pub(crate) span: Span,
    pub(crate) place: String,
    pub(crate) class: Class,
    pub(crate) symmetric: bool,
    pub(crate) rule: String,
    pub(crate) why: String,
    pub(crate) points: usize,
}

/// A check that broke down: a mistake of this program, not of the scene.
#[derive(Debug)]
pub(crate) struct Broken {
    pub(crate) root: PathBuf,
    pub(crate) asked: bool,
    /// What the program said.
    pub(crate) why: String,
}

/// How a check ended.
pub(crate) type Checked = Result<Found, Broken>;

/// Starts the thread. It ends when nobody can send it a job any more.
pub(crate) fn start(pause: Duration) -> std::io::Result<(Sender<Job>, Receiver<Checked>)> {
    let (jobs, waiting) = unbounded::<Job>();
    let (send, found) = unbounded();
    std::thread::Builder::new().stack_size(STACK).spawn(move || work(&waiting, &send, pause, &check))?;
    Ok((jobs, found))
}

/// Takes jobs; of one scene only the last counts. A check that breaks down ends neither this thread nor the server.
fn work(jobs: &Receiver<Job>, found: &Sender<Checked>, pause: Duration, check: &dyn Fn(Job) -> Option<Found>) {
    let mut waiting: BTreeMap<PathBuf, Job> = BTreeMap::new();
    while let Ok(job) = jobs.recv() {
        waiting.insert(job.root.clone(), job);
        loop {
            match jobs.recv_timeout(pause) {
                Ok(job) => {
                    let asked = waiting.get(&job.root).is_some_and(|w| w.asked);
                    waiting.insert(job.root.clone(), Job { asked: job.asked || asked, ..job });
                }
                Err(RecvTimeoutError::Timeout) => break,
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
        for job in std::mem::take(&mut waiting).into_values() {
            let (root, asked) = (job.root.clone(), job.asked);
            // nothing that the check was making is looked at after it has broken down
            let done = catch_unwind(AssertUnwindSafe(|| check(job)));
            let done = done.map_err(|panic| Broken { root, asked, why: said(&*panic) });
            if let Some(done) = done.transpose()
                && found.send(done).is_err()
            {
                return;
            }
        }
    }
}

/// The words of a panic.
fn said(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no reason is known").to_owned()
}

/// Makes the problem of a scene; `None` if there is no text of it.
fn check(job: Job) -> Option<Found> {
    let mut loaded = read_open_scene(&job.root, &job.open).ok()?;
    let scene = loaded.prepare(&InterpreterBackend, &[]);
    let problem = scene.map(|scene| {
        let advice = before_run(&loaded, &scene);
        loaded.messages.extend(advice);
        problem(&scene)
    });
    let texts = loaded.sources.iter().map(|(_, s)| (s.name.clone(), s.text.clone())).collect();
    Some(Found { root: job.root, asked: job.asked, texts, messages: loaded.messages, problem })
}

fn problem(scene: &Scene) -> Problem {
    let members = |set: &RegionSet| {
        let word = match set {
            RegionSet::Cells(_) => "cells",
            RegionSet::Facets(_) => "faces",
            RegionSet::Interface(_) => "faces with two sides",
            RegionSet::Edges(_) => "edges",
            RegionSet::Nodes(_) => "nodes",
        };
        format!("{} {word}", set.len())
    };
    let facts = |t: &wfl_problem::TermSummary| TermFacts {
        span: t.span,
        place: t.place.clone(),
        class: t.class,
        symmetric: t.symmetric,
        rule: t.rule.words(),
        why: t.why.clone(),
        points: t.n_points,
    };
    Problem {
        dim: scene.system.mesh.dim(),
        cells: scene.system.mesh.kinds().len(),
        free: scene.system.numbering.n_free(),
        regions: scene.regions.iter().map(|(name, r)| (name.clone(), members(&r.set))).collect(),
        terms: scene.terms.iter().map(facts).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_check_that_breaks_down_is_told_and_the_next_one_is_made() {
        let (jobs, waiting) = unbounded();
        let (send, found) = unbounded();
        let job =
            |name: &str| Job { root: PathBuf::from(name), open: OpenTexts::default(), asked: name == "asked.wfl" };
        for name in ["asked.wfl", "broken.wfl", "whole.wfl"] {
            jobs.send(job(name)).expect("the thread listens");
        }
        let check = |job: Job| {
            assert!(job.root.ends_with("whole.wfl"), "index {} is out of range", 7);
            Some(Found { root: job.root, asked: job.asked, texts: Vec::new(), messages: Vec::new(), problem: None })
        };
        let thread = std::thread::spawn(move || work(&waiting, &send, Duration::from_millis(1), &check));
        let mut ended: Vec<String> = Vec::new();
        for _ in 0..3 {
            ended.push(match found.recv().expect("the thread goes on") {
                Ok(found) => format!("{} is checked", found.root.display()),
                Err(broken) => format!("{} {}: {}", broken.root.display(), broken.asked, broken.why),
            });
        }
        let why = "index 7 is out of range";
        ended.sort();
        assert_eq!(
            ended,
            [format!("asked.wfl true: {why}"), format!("broken.wfl false: {why}"), "whole.wfl is checked".to_owned()]
        );
        drop(jobs);
        thread.join().expect("it has ended in peace");
    }
}
