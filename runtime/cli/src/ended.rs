//! What is printed of a run that has ended, and its exit code.

use std::{path::Path, process::ExitCode};

use wfl::SourceMap;
use wfl_gradient::Gradients;
use wfl_host::memory::TooMuchMemory;
use wfl_output::Report;
use wfl_problem::Scene;
use wfl_run::{Outcome, RunError};
use wfl_tasks::{
    Loaded,
    ending::{self, Ending, Said},
};

use crate::{
    gradient,
    load::{out, print_all, say},
    prepared::EXIT_ERROR,
    progress::Loudness,
    ready::Ready,
};

/// A step did not converge.
const EXIT_NOT_CONVERGED: u8 = 2;
/// An expectation of the scene does not hold.
const EXIT_EXPECTATION: u8 = 3;

pub(crate) fn code(ending: Ending) -> ExitCode {
    match ending {
        Ending::Done => ExitCode::SUCCESS,
        Ending::NotFinite => ExitCode::from(EXIT_ERROR),
        Ending::NotConverged => ExitCode::from(EXIT_NOT_CONVERGED),
        Ending::NotAsExpected => ExitCode::from(EXIT_EXPECTATION),
    }
}

fn print(loaded: &Loaded, said: &Said) {
    match said {
        Said::Message(d) => print_all(std::slice::from_ref(d), &loaded.sources),
        Said::Text(text) => say(text),
    }
}

/// What is found of a run that has ended and converged; nothing after a message.
pub(crate) type Afterwards<'a> = dyn FnMut(&Scene, &Ready, &mut Outcome) -> Option<Gradients> + 'a;

/// Runs what is ready, finds what is left to find, and says how it ended.
pub(crate) fn go(loaded: &Loaded, scene: Scene, mut ready: Ready, more: &mut Afterwards<'_>) -> ExitCode {
    match ready.go(&scene) {
        Ok(mut outcome) => {
            let found =
                if outcome.converged() { more(&scene, &ready, &mut outcome) } else { Some(Gradients::default()) };
            let code = finish(loaded, &scene, &ready, &outcome, None);
            match found {
                Some(found) => {
                    gradient::tell(loaded, &ready, &found);
                    code
                }
                None => ExitCode::from(EXIT_ERROR),
            }
        }
        Err(error) => {
            explain(loaded, &scene, &error);
            ExitCode::from(EXIT_ERROR)
        }
    }
}

/// Ends a run: messages, summary, expectations. `picked` is the setting that was picked for an accuracy.
pub(crate) fn finish(
    loaded: &Loaded,
    scene: &Scene,
    ready: &Ready,
    outcome: &Outcome,
    picked: Option<&str>,
) -> ExitCode {
    let ended = ending::judged(loaded, scene, outcome, picked);
    print_all(&ended.messages, &loaded.sources);
    if ready.loudness != Loudness::Quiet {
        out(&ending::summary(ready.options.out.as_deref(), outcome));
    }
    ended.said.iter().for_each(|said| print(loaded, said));
    code(ended.ending)
}

/// Says of a run that is to go on that nothing of it is left to do.
pub(crate) fn ended_before(ready: &Ready, report: &Report) -> ExitCode {
    if ready.loudness != Loudness::Quiet {
        let folder = ready.options.out.as_deref().unwrap_or(Path::new(""));
        out(&ending::nothing_left(folder, report));
    }
    let (ending, lines) = ending::finished_before(report);
    lines.iter().for_each(|line| say(line));
    code(ending)
}

/// Prints why a run stopped, at the place in the scene where there is one.
pub(crate) fn explain(loaded: &Loaded, scene: &Scene, error: &RunError) {
    print(loaded, &ending::stopped(loaded, scene, error));
}

/// E606 where there is no place in the scene.
pub(crate) fn too_much_memory(need: &TooMuchMemory) {
    print_all(&[ending::too_much_memory(need)], &SourceMap::default());
}
