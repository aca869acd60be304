//! Whether explicit steps stay stable: the limit of the start is computed again where the scene has become another one.
//!
//! A contact that closes, or a body that stiffens, lowers the limit. Linear scenes keep that of their start, where nothing in them
//! changes in time. All others are
//! looked at when the branches of their terms change, or have none, and not more often than costs a tenth of the steps: in
//! evaluations of the residual, so that it is decided alike on all ranks. Promises: changes nothing of a run.

use wfl::{Code, Diagnostic};
use wfl_compiler::Class;
use wfl_discrete::{assemble::BranchCounts, window::Window};
use wfl_newton::NewtonError;
use wfl_problem::{Explicit, MOST_FRACTION, Solving};

/// Steps for each evaluation that a limit takes: what is spent on limits is a tenth of the steps.
const STEPS_FOR_EACH: usize = 10;

/// Contact sets the limit where it is lower by this part with contact closed than with contact open: a penalty of more than twice E/h on
/// elements of length h.
const LOWERED: f64 = 0.2;
/// The part of a limit that contact sets above which steps gain energy where it opens and closes: a bar of 100 elements that rebounds
/// from a penalty of 2.5 to 50 times E/h leaves with 3.4 to 7.4 times its energy at 0.9, with 1.0 to 1.9 at 0.8, with 1.03 at most at 0.7.
const BOUNCES: f64 = 0.8;

/// What is known of the limit.
#[derive(Clone, Debug, Default)]
pub(super) struct Stability {
    /// The branches of all terms where it was computed last.
    seen: Option<Vec<BranchCounts>>,
    /// How often it was computed.
    looks: usize,
    /// Steps until it may be computed again.
    wait: usize,
    /// The largest limit so far.
    largest: f64,
    /// Where the steps were first too near to it, or above it.
    found: Option<Fallen>,
}

/// A limit that has fallen to the steps.
#[derive(Clone, Copy, Debug)]
struct Fallen {
    time: f64,
    limit: f64,
    /// The increment there, in parts of the limit.
    share: f64,
    why: Why,
}

/// Why steps are too near to a limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Why {
    /// It has fallen since the start.
    Fell,
    /// Contact that opens and closes sets it.
    Bounces,
}

impl Fallen {
    fn is_above(self) -> bool {
        self.share > 1.0
    }
}

impl Stability {
    /// Looks at the end `u` of a step, whose terms are on these branches.
    pub(super) fn look(
        &mut self,
        scene: &mut Solving<'_>,
        explicit: &Explicit,
        u: &[f64],
        window: Window,
        branches: &[BranchCounts],
    ) -> Result<(), NewtonError> {
        if self.found.is_some_and(Fallen::is_above) || scene.system.is_linear() && scene.system.linear_terms_stay() {
            return Ok(());
        }
        self.wait = self.wait.saturating_sub(1);
        let changed = self.seen.as_deref() != Some(branches);
        let is_nonlinear = scene.system.terms.iter().any(|t| t.law.class == Class::Nonlinear);
        let is_smooth = is_nonlinear || !scene.system.linear_terms_stay();
        // the end of the first step, and the first change behind it, are looked at at once: the limit of the start says
        // nothing of a contact that closes
        let is_due = if changed { self.wait == 0 || self.looks < 2 } else { self.wait == 0 && is_smooth };
        if !is_due {
            return Ok(());
        }
        let at_end = Window::new(window.stage, window.increment);
        let limit = scene.system.with_other_rates(window, |system| explicit.lumped.longest_step(system, u, at_end))?;
        (self.seen, self.looks) = (Some(branches.to_vec()), self.looks + 1);
        self.wait = STEPS_FOR_EACH * limit.evaluations;
        let found =
            Fallen { time: window.end, limit: limit.step, share: window.increment.abs() / limit.step, why: Why::Fell };
        // steps that the scene itself asks for are near the limit of the start, and nothing has fallen
        let is_near = found.share > MOST_FRACTION && limit.step < explicit.limit.step && self.found.is_none();
        // contact may be closed at the start and open now, or the other way round
        let [least, largest] =
            [limit.step.min(explicit.limit.step), self.largest.max(limit.step).max(explicit.limit.step)];
        self.largest = largest;
        let bounces = Fallen { limit: least, share: window.increment.abs() / least, why: Why::Bounces, ..found };
        let is_set = least < (1.0 - LOWERED) * largest && !is_smooth;
        if found.is_above() || is_near {
            self.found = Some(found);
        } else if is_set && bounces.share > BOUNCES && self.found.is_none() {
            self.found = Some(bounces);
        }
        Ok(())
    }

    /// W621 for steps of this length that have become too long.
    pub(super) fn told(&self, increment: impl FnOnce() -> f64) -> Option<Diagnostic> {
        let found = self.found?;
        let Fallen { time, limit, share, why } = found;
        let increment = increment();
        let fallen = match why {
            Why::Fell => format!("the stability limit, which had fallen to {limit:.3e} at t = {time:.6e}"),
            Why::Bounces => format!("the stability limit with contact closed, {limit:.3e}"),
        };
        let (text, so) = if found.is_above() {
            (
                format!("explicit steps of {increment:.3e} are above {fallen}"),
                "the results behind that are not to be used",
            )
        } else {
            (
                format!("explicit steps of {increment:.3e} are {share:.3} of {fallen}"),
                "contact that opens and closes so near the limit gains energy in each step that it does",
            )
        };
        Some(
            Diagnostic::new(Code::W621, text)
                .note("a contact has closed, or a body stiffened, since the start")
                .note(so)
                .help("a smaller `fraction`, or shorter steps"),
        )
    }
}
