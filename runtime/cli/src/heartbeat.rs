//! A sign of life: where a run stands, said after a few seconds in which nothing else was.
//!
//! A thread of its own, so that it speaks also while one factorisation or one assembly takes long. Promises: nothing is
//! said of a run that is quick or that speaks by itself, and nothing after the run has ended.

use std::{
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread::JoinHandle,
    time::{Duration, Instant},
};

use wfl_newton::Iteration;

/// Silence after which a line is due.
const SILENCE: Duration = Duration::from_secs(5);

/// What the run has said of itself so far.
#[derive(Debug)]
struct Standing {
    /// When it began, and when anything was said last.
    began: Instant,
    spoke: Instant,
    /// The step, in words.
    step: String,
    /// Attempts at parts of this step that have begun.
    attempts: usize,
    /// The last iteration of the present one, and the residual after it.
    iteration: Option<(usize, f64)>,
    ended: bool,
}

impl Standing {
    fn text(&self) -> String {
        let seconds = self.began.elapsed().as_secs_f64();
        if self.step.is_empty() {
            return format!("still preparing after {seconds:.0} s: mesh, terms, matrices");
        }
        let mut text = format!("still running after {seconds:.0} s: {}", self.step);
        if self.attempts > 1 {
            text += &format!(", attempt {} at a part of it", self.attempts);
        }
        match self.iteration {
            Some((number, residual)) => text + &format!(", iteration {number}, residual {residual:.1e}"),
            None => text + ", no iteration yet",
        }
    }
}

/// Speaks while a run is silent, until it is dropped.
pub(crate) struct Heartbeat {
    shared: Arc<(Mutex<Standing>, Condvar)>,
    thread: Option<JoinHandle<()>>,
}

impl Heartbeat {
    /// Begins to listen; `say` writes a line.
    pub(crate) fn new(say: impl Fn(&str) + Send + 'static) -> Self {
        Self::after(SILENCE, say)
    }

    fn after(silence: Duration, say: impl Fn(&str) + Send + 'static) -> Self {
        let now = Instant::now();
        let standing =
            Standing { began: now, spoke: now, step: String::new(), attempts: 0, iteration: None, ended: false };
        let shared = Arc::new((Mutex::new(standing), Condvar::new()));
        let heard = Arc::clone(&shared);
        // without a thread the run is silent, and no worse otherwise
        let thread =
            std::thread::Builder::new().name("heartbeat".to_owned()).spawn(move || listen(&heard, silence, &say)).ok();
        Self { shared, thread }
    }

    fn standing(&self) -> MutexGuard<'_, Standing> {
        self.shared.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A step begins.
    pub(crate) fn step(&self, text: String) {
        let mut standing = self.standing();
        (standing.step, standing.attempts, standing.iteration) = (text, 0, None);
    }

    /// An iteration has ended; number 0 is the start of an attempt.
    pub(crate) fn iteration(&self, i: &Iteration) {
        let mut standing = self.standing();
        standing.attempts += usize::from(i.number == 0);
        standing.iteration = Some((i.number, i.residual));
    }

    /// Something else was said.
    pub(crate) fn spoke(&self) {
        self.standing().spoke = Instant::now();
    }
}

fn listen(shared: &(Mutex<Standing>, Condvar), patience: Duration, say: &impl Fn(&str)) {
    let mut standing = shared.0.lock().unwrap_or_else(PoisonError::into_inner);
    while !standing.ended {
        let silent = standing.spoke.elapsed();
        if silent >= patience {
            say(&standing.text());
            standing.spoke = Instant::now();
            continue;
        }
        standing = shared.1.wait_timeout(standing, patience - silent).unwrap_or_else(PoisonError::into_inner).0;
    }
}

impl Drop for Heartbeat {
    fn drop(&mut self) {
        self.standing().ended = true;
        self.shared.1.notify_all();
        if let Some(thread) = self.thread.take() {
            // a line that panicked is no reason to lose a run
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(silence: u64, run: impl Fn(&Heartbeat)) -> Vec<String> {
        let heard = Arc::new(Mutex::new(Vec::new()));
        let all = Arc::clone(&heard);
        let heartbeat = Heartbeat::after(Duration::from_millis(silence), move |line| {
            all.lock().unwrap_or_else(PoisonError::into_inner).push(line.to_owned());
        });
        run(&heartbeat);
        drop(heartbeat);
        let heard = heard.lock().unwrap_or_else(PoisonError::into_inner);
        heard.clone()
    }

    fn iteration(number: usize) -> Iteration {
        Iteration {
            number,
            residual: 0.25,
            floor: 0.0,
            step: 1.0,
            method: wfl_newton::Method::Residual,
            merit: 1.0,
            changed: 0,
            contact: None,
            fingerprint: 0,
        }
    }

    #[test]
    fn a_silent_run_is_spoken_for_and_a_quick_one_is_not() {
        let silent = lines(5, |heartbeat| {
            heartbeat.step("step 3 of 4, t = 2".to_owned());
            [0, 1, 0, 7].into_iter().for_each(|n| heartbeat.iteration(&iteration(n)));
            std::thread::sleep(Duration::from_millis(60));
        });
        let last = silent.last().expect("a line");
        assert!(last.contains("step 3 of 4, t = 2, attempt 2 at a part of it, iteration 7, residual 2.5e-1"), "{last}");
        assert!(lines(60_000, |_| ()).is_empty());
    }
}
