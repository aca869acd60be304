//! The second thread: when a text has stayed as it is for a moment, the whole problem is made of it, as `wfl check` does.

use std::{collections::BTreeMap, path::PathBuf, sync::Arc, time::Duration};

use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, unbounded};
use wfl::{Diagnostic, Span};
use wfl_compiler::{Class, InterpreterBackend};
use wfl_runtime::{RuleChoice, Scene, mesh::RegionSet};
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

/// Starts the thread. It ends when nobody can send it a job any more.
pub(crate) fn start(pause: Duration) -> std::io::Result<(Sender<Job>, Receiver<Found>)> {
    let (jobs, waiting) = unbounded::<Job>();
    let (send, found) = unbounded();
    std::thread::Builder::new().stack_size(STACK).spawn(move || work(&waiting, &send, pause))?;
    Ok((jobs, found))
}

/// Takes jobs; of one scene only the last counts.
fn work(jobs: &Receiver<Job>, found: &Sender<Found>, pause: Duration) {
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
            if let Some(done) = check(job)
                && found.send(done).is_err()
            {
                return;
            }
        }
    }
}

/// Makes the problem of a scene; `None` if there is no text of it.
fn check(job: Job) -> Option<Found> {
    let mut loaded = read_open_scene(&job.root, &job.open).ok()?;
    let scene = loaded.prepare(&InterpreterBackend, &[]);
    let problem = scene.map(|mut scene| {
        let advice = before_run(&loaded, &mut scene);
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
            RegionSet::Nodes(_) => "nodes",
        };
        format!("{} {word}", set.len())
    };
    let facts = |t: &wfl_runtime::TermSummary| TermFacts {
        span: t.span,
        place: t.place.clone(),
        class: t.class,
        symmetric: t.symmetric,
        rule: match t.rule {
            RuleChoice::Degree(d) => format!("degree {d}"),
            RuleChoice::Vertex => "vertex".to_owned(),
        },
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
