//! Progress on a terminal: a bar for the steps, a line a step, with `-v` a line an iteration, and a line every few
//! seconds while nothing else is said.

use std::io::IsTerminal;

use indicatif::{ProgressBar, ProgressStyle};
use wfl_compiler::ir::Origin;
use wfl_newton::Iteration;
use wfl_run::{Attempt, AttemptEnd, Path, Progress, StepResult};
use wfl_tasks::words::number;

use crate::heartbeat::Heartbeat;

/// How much is said.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Loudness {
    Quiet,
    Normal,
    Verbose,
}

/// Shows a run on standard error.
pub(crate) struct Terminal {
    loudness: Loudness,
    bar: Option<ProgressBar>,
    /// None where nothing is to be said.
    heartbeat: Option<Heartbeat>,
}

impl Terminal {
    pub(crate) fn new(loudness: Loudness) -> Self {
        let heartbeat = (loudness != Loudness::Quiet).then(|| Heartbeat::new(|t| crate::load::say(&format!("{t}\n"))));
        Self { loudness, bar: None, heartbeat }
    }

    fn line(&self, text: &str) {
        if let Some(heartbeat) = &self.heartbeat {
            heartbeat.spoke();
        }
        match &self.bar {
            Some(bar) => bar.println(text),
            None => crate::load::say(&format!("{text}\n")),
        }
    }
}

impl Progress for Terminal {
    fn solver(&mut self, description: &str) {
        if self.loudness == Loudness::Verbose {
            self.line(&format!("solver: {description}"));
        }
    }

    fn resumed(&mut self, last: Option<&StepResult>) {
        if self.loudness != Loudness::Quiet {
            self.line(&match last {
                Some(step) => format!("continues after t = {}", step.window.end),
                None => "no checkpoint of an earlier run: starts from the beginning".to_owned(),
            });
        }
    }

    fn step(&mut self, number: usize, count: Option<usize>, time: f64) {
        let of = count.map_or_else(String::new, |n| format!(" of {n}"));
        // a step that the run chooses has no end yet
        let at = if count.is_some() { "" } else { "from " };
        let terminal = std::io::stderr().is_terminal();
        if let Some(count) = count.filter(|n| *n > 1)
            && self.bar.is_none()
            && self.loudness != Loudness::Quiet
            && terminal
        {
            let bar = ProgressBar::new(count as u64).with_position(number as u64);
            if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len} steps, {elapsed} ({eta} left) {msg}")
            {
                bar.set_style(style);
            }
            // lines of the heartbeat go above the bar
            let above = bar.clone();
            self.heartbeat = Some(Heartbeat::new(move |t| above.println(t)));
            self.bar = Some(bar);
        }
        if let Some(heartbeat) = &self.heartbeat {
            heartbeat.step(format!("step {}{of}, {at}t = {time}", number + 1));
        }
        if let Some(bar) = &self.bar {
            bar.set_message(format!("t = {time}"));
        }
        if self.loudness == Loudness::Verbose {
            self.line(&format!("step {}{of}, {at}t = {time}", number + 1));
        }
    }

    fn iteration(&mut self, i: &Iteration) {
        if let Some(heartbeat) = &self.heartbeat {
            heartbeat.iteration(i);
        }
        if self.loudness != Loudness::Verbose {
            return;
        }
        let contact = i.contact.map_or_else(String::new, |c| format!("  open {} slip {} stick {}", c[0], c[1], c[2]));
        let step = if i.step < 1.0 { format!("  step {}", i.step) } else { String::new() };
        let changed = if i.changed > 0 { format!("  changed {}", i.changed) } else { String::new() };
        let method = i.method.name();
        self.line(&format!(
            "  {:>3}  {method:<12} residual {:.3e}  merit {:.3e}{contact}{changed}{step}",
            i.number, i.residual, i.merit
        ));
    }

    fn printed(&mut self, term: &str, _origin: Option<Origin>, x: [f64; 3], value: &[f64]) {
        let list = |v: &[f64]| v.iter().map(|x| number(*x)).collect::<Vec<_>>().join(", ");
        crate::load::out(&format!("print {term} at [{}]: [{}]\n", list(&x), list(value)));
    }

    fn step_done(&mut self, step: &StepResult) {
        if let Some(bar) = &self.bar {
            bar.inc(1);
        }
        if self.loudness != Loudness::Quiet
            && let Some(line) = parts(step)
        {
            self.line(&line);
        }
        // of steps that the run chooses there are many
        let listed = step.attempts.first().is_none_or(|a| a.path != Path::Chosen);
        let terminal = listed && std::io::stderr().is_terminal();
        let show = self.loudness == Loudness::Verbose
            || (self.loudness == Loudness::Normal && (terminal || !step.history.converged()));
        if show {
            let last = step.history.iterations.last();
            let contact = last
                .and_then(|i| i.contact)
                .map_or_else(String::new, |c| format!("  open {} slip {} stick {}", c[0], c[1], c[2]));
            let word = match step.history.stop {
                Some(stop) if step.history.converged() => stop.word(),
                _ => "NOT CONVERGED",
            };
            let residual = last.map_or(f64::NAN, |i| i.residual);
            self.line(&format!(
                "t = {:<8} {:>2} iterations  residual {residual:.1e} ({word}){contact}",
                step.window.end,
                step.iterations()
            ));
        }
    }
}

/// A line about a step that one attempt did not solve.
fn parts(step: &StepResult) -> Option<String> {
    let solved: Vec<&Attempt> = step.parts().iter().filter(|a| a.end == AttemptEnd::Converged).collect();
    let failed = step.parts().len() - solved.len();
    let path = step.parts().first().map(|a| a.path).filter(|p| *p != Path::Chosen)?;
    let smallest = step.parts().iter().map(|a| a.part.1 - a.part.0).fold(1.0, f64::min);
    let what = match path {
        Path::Steps | Path::Chosen => "the increment",
        Path::Load => "the load of the first step",
    };
    let done = if step.history.converged() { "solved" } else { "NOT solved" };
    Some(format!(
        "t = {}: {done} in smaller increments: {failed} attempts failed, {} increments converged, the smallest was 1/{} of {what}",
        step.window.end,
        solved.len(),
        (1.0 / smallest).round()
    ))
}

impl Drop for Terminal {
    fn drop(&mut self) {
        // its line would come after the bar has gone
        self.heartbeat = None;
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
