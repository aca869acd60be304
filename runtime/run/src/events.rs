//! What begins and ends during the steps: from the two sides of its comparison at the ends of steps to times.
//!
//! Between two steps a side is taken as linear in the step variable; where both sides are positive at both ends, their
//! logarithms are, since what grows in an instability grows exponentially. The time is then known to the error of that
//! interpolation, which falls with the square of the increment: `limit` makes the steps short where it matters.

/// One time that an event lasted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Episode {
    /// When it began; of one that lasted at the first step, the time of that.
    pub begin: f64,
    /// When it ended; `None` if it lasted at the last step.
    pub end: Option<f64>,
}

/// The larger side of an event and the smaller one, at the end of a step.
pub(super) type Sides = [f64; 2];

/// True while an event lasts.
pub(super) fn lasts(sides: Sides) -> bool {
    sides[0] > sides[1]
}

/// The episodes of an event from its sides at the ends of steps: step variable and sides.
pub(super) fn episodes(steps: &[(f64, Sides)]) -> Vec<Episode> {
    let mut found: Vec<Episode> = Vec::new();
    let mut open = false;
    for (k, &(time, sides)) in steps.iter().enumerate() {
        if lasts(sides) == open {
            continue;
        }
        let at = k.checked_sub(1).map_or(time, |before| crossing(steps[before], (time, sides)));
        open = !open;
        match found.last_mut().filter(|_| !open) {
            Some(last) => last.end = Some(at),
            None => found.push(Episode { begin: at, end: None }),
        }
    }
    found
}

/// Where the two sides are equal.
fn crossing(a: (f64, Sides), b: (f64, Sides)) -> f64 {
    let positive = a.1.iter().chain(&b.1).all(|x| *x > 0.0 && x.is_finite());
    let difference = |s: Sides| if positive { s[0].ln() - s[1].ln() } else { s[0] - s[1] };
    let (from, to) = (difference(a.1), difference(b.1));
    let part = from / (from - to);
    // sides that are not finite say no more than that it was in this step
    if from.is_finite() && to.is_finite() { a.0 + part.clamp(0.0, 1.0) * (b.0 - a.0) } else { b.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beginnings_and_ends_are_interpolated() {
        let side = |t: f64| (t, [(std::f64::consts::TAU * t).sin(), 0.5]);
        let steps: Vec<(f64, Sides)> = (0..=2000).map(|k| side(f64::from(k) * 1e-3)).collect();
        let found = episodes(&steps);
        let expected = [(1.0 / 12.0, 5.0 / 12.0), (13.0 / 12.0, 17.0 / 12.0)];
        assert_eq!(found.len(), 2);
        // |g''| h²/(8 |g'|) for g = ln sin(2 pi t), where g is ln 1/2: 158/8/10.9 h²
        let bound = 1.9e-6;
        for (episode, (begin, end)) in found.iter().zip(expected) {
            let (b, e) = (episode.begin - begin, episode.end.unwrap() - end);
            assert!(b.abs() < bound && e.abs() < bound, "{episode:?}");
        }
    }

    #[test]
    fn exponential_growth_is_met_exactly_by_long_steps() {
        let steps: Vec<(f64, Sides)> = (0..5).map(|k| f64::from(k) * 3.0).map(|t| (t, [t.exp(), 1e3])).collect();
        let found = episodes(&steps);
        assert!((found[0].begin - 1e3f64.ln()).abs() < 1e-12 && found[0].end.is_none(), "{found:?}");
    }

    #[test]
    fn an_event_that_lasts_from_the_start_begins_there_and_infinite_sides_are_met_at_the_end_of_the_step() {
        assert_eq!(episodes(&[(2.0, [1.0, 0.0]), (3.0, [1.0, 0.0])]), [Episode { begin: 2.0, end: None }]);
        let jump = [(0.0, [0.0, 1.0]), (1.0, [f64::INFINITY, 1.0])];
        assert_eq!(episodes(&jump), [Episode { begin: 1.0, end: None }]);
    }
}
