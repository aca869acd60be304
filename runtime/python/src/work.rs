//! A prepared scene and what is done with it, without Python: read, judged, run, stepped.

use std::{collections::BTreeSet, path::PathBuf, time::Instant};

use wfl::Diagnostic;
use wfl_contact::{ContactPoints, contact_points};
use wfl_discrete::field::FieldSpace;
use wfl_gradient::{Differentiated, ahead, settle, stated};
use wfl_jit::JitBackend;
use wfl_problem::{Cadence, Equations, Scene};
use wfl_run::{Outcome, RunError, RunOptions, Session};
use wfl_tasks::{
    Loaded, VERSION, advice, available_threads,
    ending::{self, Ending, Said},
    scene_file::{read_scene_text_with_knobs, read_scene_with_knobs},
};

use crate::{
    desk::Teller,
    told::{self, Told},
};

/// Bytes of outputs that are kept of a run without files, so that its maps show every step; of more only the first, the
/// middle and the last step are kept. A hundredth of the memory of a small machine.
const KEPT_BYTES: usize = 80_000_000;

/// A scene and where it stands.
pub(crate) struct Work {
    pub(crate) loaded: Loaded,
    pub(crate) scene: Scene,
    pub(crate) session: Option<Session>,
    /// What is said before a run is among the messages.
    judged: bool,
    /// What the caller gave: such a run does not follow from the texts alone.
    pub(crate) given: BTreeSet<String>,
    /// How often data, first values or steps were changed: what a run was of is known by it.
    pub(crate) changes: usize,
    parse_seconds: f64,
}

/// What is read.
pub(crate) struct Asked {
    pub(crate) path: PathBuf,
    /// The text of the scene, if it is not that of the file.
    pub(crate) text: Option<String>,
    /// Parameters and knobs, NAME=VALUE.
    pub(crate) words: Vec<String>,
    /// Data fields and parameters whose values the caller gives.
    pub(crate) left: Vec<String>,
}

/// How a run is made.
pub(crate) struct RunAsked {
    pub(crate) out: Option<PathBuf>,
    pub(crate) threads: Option<usize>,
    pub(crate) keep_states: bool,
    pub(crate) keep_outputs: bool,
    /// All that derivatives need of the steps is kept.
    pub(crate) keep_trajectory: bool,
}

/// A run that has ended.
pub(crate) struct Finished {
    pub(crate) outcome: Outcome,
    pub(crate) options: RunOptions,
    pub(crate) ending: Ending,
    pub(crate) told: Vec<Told>,
    pub(crate) summary: String,
    pub(crate) contact: Vec<(String, ContactPoints)>,
    /// Data and states at the end, by field.
    pub(crate) known: Vec<Vec<f64>>,
    /// [`Work::changes`] of its scene.
    changes: usize,
}

impl Work {
    /// Reads and prepares a scene.
    pub(crate) fn new(asked: &Asked) -> Result<Self, Vec<Told>> {
        let begin = Instant::now();
        let refused = |why: String| vec![Told::text(&wfl_tasks::folder::error_line(&why))];
        let read = match &asked.text {
            Some(text) => read_scene_text_with_knobs(&asked.path, text, &asked.words, "run"),
            None => read_scene_with_knobs(&asked.path, &asked.words, "run"),
        };
        let mut loaded = read.map_err(refused)?;
        // a text with errors may lack the very names: its errors are told first
        if !loaded.messages.iter().any(Diagnostic::is_error) {
            loaded.leave_to_caller(&asked.left).map_err(refused)?;
        }
        let parse_seconds = begin.elapsed().as_secs_f64();
        let backend = JitBackend::new().map_err(|e| refused(e.to_string()))?;
        match loaded.prepare(&backend, &[]) {
            Some(scene) => {
                let given = asked.left.iter().cloned().collect();
                Ok(Self { loaded, scene, session: None, judged: false, given, changes: 0, parse_seconds })
            }
            None => Err(told::all(&loaded.messages, &loaded.sources)),
        }
    }

    /// Every message about the scene.
    pub(crate) fn check(&mut self) -> Vec<Told> {
        if !self.judged {
            self.judged = true;
            let found = advice::before_run(&self.loaded, &self.scene);
            self.loaded.messages.extend(found);
        }
        told::all(&self.loaded.messages, &self.loaded.sources)
    }

    /// The options of a run; messages are those of [`Self::check`].
    fn options(&self, asked: &RunAsked, started: Instant, check_seconds: f64) -> RunOptions {
        let mut settings = self.loaded.settings(&[]);
        if !self.given.is_empty() {
            let names: Vec<&str> = self.given.iter().map(String::as_str).collect();
            settings.insert("given", names.join(" "));
        }
        RunOptions {
            name: self.loaded.name.clone(),
            out: asked.out.clone(),
            texts: self.loaded.texts(),
            settings,
            version: VERSION.to_owned(),
            parse_seconds: self.parse_seconds,
            check_seconds,
            warnings: self.loaded.messages.iter().map(|d| format!("{}: {}", d.code, d.message)).collect(),
            about: self.loaded.about(),
            keep_states: asked.keep_states,
            keep_trajectory: asked.keep_trajectory || !self.loaded.script.gradients.is_empty(),
            keep_outputs: if asked.keep_outputs && asked.out.is_none() { self.shown() } else { Vec::new() },
            ..RunOptions::without_files(asked.threads.unwrap_or_else(available_threads), started)
        }
    }

    /// The steps whose outputs are kept for pictures.
    fn shown(&self) -> Vec<usize> {
        let steps = &self.scene.steps;
        // of steps that the run chooses the last one stays, see `RunOptions::keep_outputs`
        let Some(n) = steps.listed() else { return vec![0] };
        let files = |every: &Cadence| every.n_files(steps).unwrap_or(n);
        let vtk = self.scene.vtk.iter().map(|v| files(&v.every) * v.bytes());
        let csv = self.scene.csv.iter().map(|c| files(&c.every) * c.bytes());
        if vtk.chain(csv).sum::<usize>() <= KEPT_BYTES { (0..n).collect() } else { vec![0, (n - 1) / 2, n - 1] }
    }

    /// Runs all steps.
    pub(crate) fn run(&mut self, asked: &RunAsked, teller: &mut Teller<'_>) -> Result<Finished, Vec<Told>> {
        self.session = None;
        let started = Instant::now();
        self.refuse_accuracy()?;
        self.check();
        self.refuse_derivatives()?;
        let options = self.options(asked, started, started.elapsed().as_secs_f64());
        match wfl_run::run(&self.scene, &options, teller) {
            Ok(mut outcome) => {
                self.settle(&mut outcome, options.threads)?;
                Ok(self.finished(outcome, options))
            }
            Err(error) => Err(self.stopped(&error)),
        }
    }

    /// Refuses derivatives that the scene states and that do not exist, before a run is spent on them.
    fn refuse_derivatives(&self) -> Result<(), Vec<Told>> {
        let script = &self.loaded.script;
        let requests = stated(&self.scene, script);
        let refused = requests.and_then(|all| all.iter().try_for_each(|request| ahead(&self.scene, script, request)));
        refused.map_err(|d| vec![Told::diagnostic(&d, &self.loaded.sources)])
    }

    /// Finds the derivatives that the scene states, for its expectations.
    fn settle(&self, outcome: &mut Outcome, threads: usize) -> Result<(), Vec<Told>> {
        if self.loaded.script.gradients.is_empty() || !outcome.converged() {
            return Ok(());
        }
        let refused = |text: &str| vec![Told::text(&format!("error: {text}\n"))];
        let backend = JitBackend::new().map_err(|e| refused(&e.to_string()))?;
        let of = (&self.scene, &self.loaded.script);
        let found = settle(of, (&backend, threads), None, outcome);
        let found = found.map_err(|d| vec![Told::diagnostic(&d, &self.loaded.sources)])?;
        wfl_tasks::gradient::report(&found, &mut outcome.report);
        Ok(())
    }

    /// What `make` finds of a run of this scene.
    pub(crate) fn differentiated<T>(
        &self,
        of: &Finished,
        make: impl FnOnce(Differentiated<'_>) -> Result<T, Box<Diagnostic>>,
    ) -> Result<T, Vec<Told>> {
        let refused = |text: &str| vec![Told::text(&format!("error: {text}\n"))];
        if of.changes != self.changes {
            return Err(refused("data, first values or steps of the scene were changed after the run: run it again"));
        }
        if of.outcome.trajectory.is_none() {
            return Err(refused("the run kept no steps for derivatives\n  = help: scene.run(gradients=True)"));
        }
        let backend = JitBackend::new().map_err(|e| refused(&e.to_string()))?;
        let (script, outcome, threads) = (&self.loaded.script, &of.outcome, of.options.threads);
        let of = Differentiated { scene: &self.scene, script, outcome, backend: &backend, threads };
        make(of).map_err(|d| vec![Told::diagnostic(&d, &self.loaded.sources)])
    }

    /// A demanded accuracy is a search over meshes, of which the command writes a record.
    fn refuse_accuracy(&self) -> Result<(), Vec<Told>> {
        match &self.scene.accuracy {
            None => Ok(()),
            Some((demand, _)) => Err(vec![Told::text(&format!(
                "error: the scene demands the accuracy {demand:e}, for which meshes are searched\n  = help: the command \
                 does it: wfl run SCENE --out DIR; Scene(\"...\", marks=\"DIR/report.json\") then has its mesh\n"
            ))]),
        }
    }

    fn finished(&self, outcome: Outcome, options: RunOptions) -> Finished {
        let ended = ending::judged(&self.loaded, &self.scene, &outcome, None);
        let mut list = told::all(&ended.messages, &self.loaded.sources);
        list.extend(ended.said.iter().map(|said| Told::said(said, &self.loaded.sources)));
        let summary = ending::summary(options.out.as_deref(), &outcome);
        let end = &outcome.equations;
        let contact = outcome.steps.last().map_or_else(Vec::new, |step| self.contact(end, &step.state));
        let known = end.system.data().to_vec();
        Finished { outcome, options, ending: ended.ending, told: list, summary, contact, known, changes: self.changes }
    }

    /// Why a run ended without a result.
    pub(crate) fn stopped(&self, error: &RunError) -> Vec<Told> {
        let said: Said = ending::stopped(&self.loaded, &self.scene, error);
        vec![Told::said(&said, &self.loaded.sources)]
    }

    /// Regions on faces with a law of contact, and the law at their points.
    fn contact(&self, end: &Equations, u: &[f64]) -> Vec<(String, ContactPoints)> {
        let (Equations { system, contact }, terms) = (end, &self.scene.terms);
        let mut regions: Vec<&str> = Vec::new();
        for law in contact.terms().iter().filter(|t| !t.on_cells()) {
            let place = terms[law.term].place.as_str();
            if !regions.contains(&place) {
                regions.push(place);
            }
        }
        let of = |region: &str| {
            let own: Vec<usize> = (0..terms.len()).filter(|k| terms[*k].place == region).collect();
            Some((region.to_owned(), contact_points(system, contact, u, &own)?))
        };
        regions.into_iter().filter_map(of).collect()
    }

    /// The run between two steps; begun where there is none.
    pub(crate) fn session(&mut self) -> Result<(&mut Session, &Scene), Vec<Told>> {
        if self.session.is_none() {
            let started = Instant::now();
            self.refuse_accuracy()?;
            self.check();
            let asked =
                RunAsked { out: None, threads: None, keep_states: false, keep_outputs: true, keep_trajectory: false };
            let options = self.options(&asked, started, started.elapsed().as_secs_f64());
            match Session::new(&self.scene, options) {
                Ok(session) => self.session = Some(session),
                Err(error) => return Err(self.stopped(&error)),
            }
        }
        let session = self.session.as_mut().expect("made above");
        Ok((session, &self.scene))
    }

    /// The same at a step: one that was begun, or the last one that was solved.
    pub(crate) fn begun(&mut self) -> Result<(&mut Session, &Scene), Vec<Told>> {
        match &self.session {
            Some(session) if session.stands() => self.session(),
            _ => Err(Self::not_begun()),
        }
    }

    /// Why there are no equations.
    pub(crate) fn not_begun() -> Vec<Told> {
        vec![Told::text("error: no step was begun\n  = help: u = scene.begin(t) begins one\n")]
    }

    /// Ends the run between two steps.
    pub(crate) fn end_session(&mut self) -> Option<Finished> {
        let session = self.session.take()?;
        let asked =
            RunAsked { out: None, threads: None, keep_states: false, keep_outputs: false, keep_trajectory: false };
        let options = self.options(&asked, Instant::now(), 0.0);
        let mut outcome = session.outcome(&self.scene);
        let settled = self.settle(&mut outcome, options.threads);
        let mut finished = self.finished(outcome, options);
        finished.told.extend(settled.err().into_iter().flatten());
        Some(finished)
    }

    /// Where a name is declared, for messages about what the caller gives for it.
    pub(crate) fn span_of(&self, name: &str) -> Option<wfl::Span> {
        self.loaded.script.fields.iter().find(|f| f.name.name == name).map(|f| f.span)
    }

    /// The position of a field among those of the scene.
    pub(crate) fn field(&self, name: &str) -> Option<usize> {
        self.scene.system.fields.iter().position(|f| f.name == name)
    }

    /// A word for where a field lives.
    pub(crate) fn place_word(&self, field: usize) -> &'static str {
        match &self.scene.system.fields[field].space {
            FieldSpace::Nodal(_) => "nodes",
            FieldSpace::Global => "global",
            FieldSpace::Points(_) => "points",
        }
    }
}
