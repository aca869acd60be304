//! `wfl run` on several ranks: the first one prepares the scene and tells its messages, and sends each rank its part.

use std::{process::ExitCode, sync::Arc, time::Instant};

use wfl_compiler::backend::KernelBackend;
use wfl_gradient::Gradients;
use wfl_host::team::Team;
use wfl_mesh::mesh::Part;
use wfl_problem::Scene;
use wfl_run::finished;
use wfl_tasks::{Loaded, folder::error_line};

use crate::{
    accuracy,
    args::RunArgs,
    ended::{ended_before, explain, go},
    load::{out, say},
    prepared::{EXIT_ERROR, prepare_scene, sign_of_life},
    progress::Loudness,
    ready::{Ready, Times, checked, ready, shaped},
    solvers::Running,
    together::{may_pick, says_more_of_no_accuracy},
};

/// What the first rank says to the others: the first byte of what it sends.
const ENDED: u8 = 0;
const WHOLE: u8 = 1;
const PART: u8 = 2;

/// When the run began, and the seconds that reading took.
#[derive(Clone, Copy)]
pub(crate) struct Begun {
    pub(crate) parse_seconds: f64,
    pub(crate) started: Instant,
}

/// Runs a scene on several ranks. An error of one of them ends all.
pub(crate) fn run(
    args: &RunArgs,
    running: &Running,
    team: &Arc<dyn Team>,
    loaded: Loaded,
    backend: &dyn KernelBackend,
    begun: Begun,
) -> ExitCode {
    let shared = Shared { args, running, team, backend, begun };
    let ended = if team.rank() == 0 { shared.first(loaded) } else { shared.other(loaded) };
    ended.unwrap_or_else(|why| {
        if !why.is_empty() {
            say(&error_line(&why));
        }
        ExitCode::from(EXIT_ERROR)
    })
}

/// A run on several ranks.
struct Shared<'a> {
    args: &'a RunArgs,
    running: &'a Running,
    team: &'a Arc<dyn Team>,
    backend: &'a dyn KernelBackend,
    begun: Begun,
}

impl Shared<'_> {
    /// The rank that prepares the scene, tells and writes files; nothing is left to say of an empty error.
    fn first(&self, mut loaded: Loaded) -> Result<ExitCode, String> {
        let told = || String::new();
        let preparing = (!self.args.quiet).then(sign_of_life);
        let scene = prepare_scene(&mut loaded, self.backend, &self.args.no_prune).ok_or_else(told)?;
        if accuracy::demand(self.args, &scene).is_some() {
            may_pick(self.args, &loaded, &scene);
            return Err(told());
        }
        if says_more_of_no_accuracy(self.args) {
            return Err(told());
        }
        let scene = shaped(self.args, scene);
        let checks = checked(self.args, &mut loaded, &scene)?;
        let ready = self.ready(&loaded, checks)?;
        drop(preparing);
        match finished(&scene, &ready.options) {
            Ok(Some(report)) => {
                self.send(&mut |_| vec![ENDED]);
                return Ok(ended_before(&ready, &report));
            }
            Ok(None) => {}
            Err(error) => {
                explain(&loaded, &scene, &error);
                return Err(told());
            }
        }
        ready.announce(&loaded, &scene);
        let why = if self.args.whole_mesh { Some("--whole-mesh") } else { scene.needs_whole_mesh() };
        let scene = match why {
            Some(why) => {
                self.tell(&format!("{} ranks, each with the whole mesh: {why}\n", self.team.size()));
                self.send(&mut |_| vec![WHOLE]);
                self.whole(scene)
            }
            None => self.parted(&loaded, scene)?,
        };
        Ok(go(&loaded, scene, ready, &mut |_, _, _| Some(Gradients::default())))
    }

    /// A rank that is sent its part, and says nothing.
    fn other(&self, mut loaded: Loaded) -> Result<ExitCode, String> {
        let sent = self.send(&mut |_| Vec::new());
        let scene = match sent.split_first() {
            Some((&PART, bytes)) => self.part(&loaded, bytes)?,
            Some((&WHOLE, _)) => {
                let scene = prepare_scene(&mut loaded, self.backend, &self.args.no_prune);
                self.whole(scene.ok_or_else(|| "the scene of the first rank has no errors, this one has".to_owned())?)
            }
            _ => return Ok(ExitCode::SUCCESS),
        };
        let ready = self.ready(&loaded, 0.0)?;
        Ok(go(&loaded, scene, ready, &mut |_, _, _| Some(Gradients::default())))
    }

    /// What the first rank makes for this one.
    fn send(&self, make: &mut dyn FnMut(usize) -> Vec<u8>) -> Vec<u8> {
        self.team.hand_out(make)
    }

    /// Prints a line, if anything is printed.
    fn tell(&self, text: &str) {
        if !self.args.quiet {
            out(text);
        }
    }

    /// Of several ranks, one writes files and tells; each has one thread unless it is asked for more.
    fn ready(&self, loaded: &Loaded, checks: f64) -> Result<Ready, String> {
        let Begun { parse_seconds, started } = self.begun;
        let mut ready = ready(self.args, loaded, Times { parse: parse_seconds, checks, started })?;
        if self.args.threads.is_none() {
            ready.options.threads = 1;
        }
        if self.team.rank() > 0 {
            (ready.options.out, ready.loudness) = (None, Loudness::Quiet);
        }
        Ok(ready)
    }

    /// The scene of a rank that has the whole mesh.
    fn whole(&self, scene: Scene) -> Scene {
        let mut scene = shaped(self.args, scene);
        scene.share_rows(Arc::clone(self.team));
        scene
    }

    /// Sends each rank its part of the scene; the first one keeps its own alone.
    fn parted(&self, loaded: &Loaded, scene: Scene) -> Result<Scene, String> {
        let part = Part::of_whole(Arc::clone(self.team), &scene.system.mesh);
        let all = scene.system.mesh.n_cells();
        let sent = self.send(&mut |rank| {
            let mut bytes = vec![PART];
            bytes.extend(scene.part_of(&part, rank));
            bytes
        });
        let whole = scene.from_whole();
        drop(part);
        self.running.trim_memory();
        let mut scene = self.part(loaded, &sent[1..])?;
        scene.take_over(whole);
        self.tell(&format!(
            "{} ranks, each with a part of the mesh: {} of {all} cells on the first one\n",
            self.team.size(),
            scene.system.mesh.n_cells()
        ));
        Ok(scene)
    }

    fn part(&self, loaded: &Loaded, bytes: &[u8]) -> Result<Scene, String> {
        let made = loaded.prepare_part(self.backend, &self.args.no_prune, bytes, Arc::clone(self.team));
        let scene = shaped(self.args, made?);
        // what preparing took is not what solving takes
        self.running.trim_memory();
        Ok(scene)
    }
}
