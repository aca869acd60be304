//! The mean of a friction bound over what slides in a step.
//!
//! Between the ends of a step, of which the part passed is called s, the argument x of the ball and its bound are taken as
//! linear in s, as loads of a step are; a bound that is zero at one end is so up to where the gap closes, or from where it
//! opens, as the step before foretells. A point slides where |x| is beyond the bound. The force against what slides is
//! proportional to the bound, and what slides to s, so that its work is the slip times the mean of the force over the part of
//! the step that slides: exact for loads that grow in proportion, from open contact, too, and of second order in the step for
//! others.
//!
//! Knows numbers of one point. Does not know laws and fields.

/// A bound is met within rounding of squares up to this part of its square: a point that has slid begins on its bound.
const ON_THE_BOUND: f64 = 1e-9;

/// A point at one end of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct End<'a> {
    /// The argument of the ball.
    pub(super) argument: &'a [f64],
    /// Its radius.
    pub(super) radius: f64,
    /// The force that resists a slip; zero where it is not known.
    pub(super) resists: f64,
}

/// A step at one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Slipping<'a> {
    pub(super) start: End<'a>,
    pub(super) end: End<'a>,
    /// The part of the step behind which the sides meet or part; `None` where that is not known. Gaps go on as in the step
    /// before: that of the end is none of free sides, or a pressure that bodies resist.
    pub(super) meets: Option<f64>,
}

impl Slipping<'_> {
    /// The mean of the force over what slides.
    pub(super) fn mean_force(&self) -> f64 {
        let touches = self.touches();
        let [from, to] = self.slides(touches);
        let forces = self.forces();
        // over the part of the step where there is contact the force is linear
        let force_at = |s: f64| {
            let part = ((s - touches[0]) / (touches[1] - touches[0])).clamp(0.0, 1.0);
            forces[0] + part * (forces[1] - forces[0])
        };
        let [a, b] = [from.max(touches[0]), to.min(touches[1])];
        if to <= from {
            return forces[1];
        }
        0.5 * (force_at(a) + force_at(b)) * (b - a) / (to - from)
    }

    /// The force at both ends: of one that is not known what its bound says.
    fn forces(&self) -> [f64; 2] {
        let Self { start, end, .. } = self;
        let known = |a: f64, other: &End<'_>, own: f64| {
            if a > 0.0 || own <= 0.0 || other.radius <= 0.0 { a } else { other.resists * own / other.radius }
        };
        [known(start.resists, end, start.radius), known(end.resists, start, end.radius)]
    }

    /// The part of the step in contact.
    fn touches(&self) -> [f64; 2] {
        let at = self.meets.filter(|s| *s > 0.0 && *s < 1.0);
        match (self.start.radius > 0.0, self.end.radius > 0.0) {
            (false, true) => [at.unwrap_or(0.0), 1.0],
            (true, false) => [0.0, at.unwrap_or(1.0)],
            _ => [0.0, 1.0],
        }
    }

    /// The part of the step in which |x| is beyond the bound.
    fn slides(&self, touches: [f64; 2]) -> [f64; 2] {
        let Self { start, end, .. } = self;
        if start.radius <= 0.0 {
            return [0.0, 1.0];
        }
        // |x|^2 - R^2 = a s^2 + 2 b s + c, with the slope of the bound where there is contact
        let bound = (end.radius.max(0.0) - start.radius) / touches[1];
        let change = || start.argument.iter().zip(end.argument).map(|(x, y)| (x, y - x));
        let a = change().map(|(_, d)| d * d).sum::<f64>() - bound * bound;
        let b = change().map(|(x, d)| x * d).sum::<f64>() - start.radius * bound;
        let over = start.argument.iter().map(|x| x * x).sum::<f64>() - start.radius * start.radius;
        let c = if over.abs() <= ON_THE_BOUND * start.radius * start.radius { 0.0 } else { over };
        let [first, last] = roots(a, b, c);
        let [leaves, holds] = if a < 0.0 { [first, last] } else { [last, first] };
        if c > 0.0 {
            // it has slid, and goes back at most to where it holds
            let stops = holds.filter(|s| *s > 0.0 && *s < 1.0 && a + 2.0 * b + c < 0.0);
            return [0.0, stops.unwrap_or(1.0)];
        }
        [leaves.map_or(0.0, |s| s.clamp(0.0, touches[1])), 1.0]
    }
}

/// The roots of a s^2 + 2 b s + c, the smaller first; none where there are none.
fn roots(a: f64, b: f64, c: f64) -> [Option<f64>; 2] {
    let square = b * b - a * c;
    if square < 0.0 {
        return [None, None];
    }
    // without differences of nearly equal numbers
    let q = -(b + square.sqrt().copysign(b));
    let finite = |x: f64| Some(x).filter(|x| x.is_finite());
    let [x, y] = [finite(q / a), finite(c / q)];
    match (x, y) {
        (Some(x), Some(y)) => [Some(x.min(y)), Some(x.max(y))],
        (x, y) => [x.or(y), x.or(y)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn end(argument: &[f64], radius: f64) -> End<'_> {
        End { argument, radius, resists: 2.0 * radius }
    }

    fn mean(start: End<'_>, end: End<'_>) -> f64 {
        Slipping { start, end, meets: None }.mean_force()
    }

    fn mean_that_meets(start: End<'_>, end: End<'_>, at: f64) -> f64 {
        Slipping { start, end, meets: Some(at) }.mean_force()
    }

    #[test]
    fn a_bound_that_grows_while_a_point_slides_counts_with_its_mean() {
        // on the bound 1 at first, beyond the bound 3 at the end: the force is twice the bound
        assert_eq!(mean(end(&[1.0], 1.0), end(&[9.0], 3.0)), 4.0);
        assert_eq!(mean(end(&[1.0], 1.0), end(&[9.0], 1.0)), 2.0, "a bound that stays");
    }

    #[test]
    fn a_point_that_sticks_at_first_counts_from_where_it_slides() {
        // x = 6 s meets 1 + 2 s at 1/4, where the bound is 1.5: the mean up to 3 is 2.25
        let sticks = mean(end(&[0.0], 1.0), end(&[6.0], 3.0));
        assert!((sticks - 4.5).abs() < 1e-14, "{sticks}");
    }

    #[test]
    fn a_point_that_turns_back_slides_again_at_the_other_side_of_the_ball() {
        // from 1 to -7 x is -1 at 1/4; the bound goes from 1 to 1
        let turned = mean(end(&[1.0], 1.0), end(&[-7.0], 1.0));
        assert_eq!(turned, 2.0);
        // x = 1 - 8 s meets -(1 + s) at 2/7, where the bound is 9/7
        let turned = mean(end(&[1.0], 1.0), end(&[-7.0], 2.0));
        assert!((turned - (9.0 / 7.0 + 2.0)).abs() < 1e-14, "{turned}");
    }

    #[test]
    fn contact_that_closes_takes_from_where_it_closes() {
        assert_eq!(mean(end(&[0.0], 0.0), end(&[9.0], 3.0)), 3.0, "loads in proportion");
        // open up to 1/4: the mean of 0 to 6 over three quarters of the slip
        let closes = mean_that_meets(end(&[0.0], 0.0), end(&[9.0], 3.0), 0.25);
        assert!((closes - 0.75 * 3.0).abs() < 1e-14, "{closes}");
    }

    #[test]
    fn contact_that_opens_takes_up_to_where_it_opens() {
        // it slides at once: 6 to 0 over three quarters of the slip
        let opens = mean_that_meets(end(&[3.0], 3.0), end(&[30.0], 0.0), 0.75);
        assert!((opens - 0.75 * 3.0).abs() < 1e-14, "{opens}");
        // x = 4 s meets 2 (1 - s) at 1/3: of the two thirds that slide the mean is half of 2 * 4/3
        let later = mean(end(&[0.0], 2.0), end(&[4.0], 0.0));
        assert!((later - 4.0 / 3.0).abs() < 1e-14, "{later}");
    }

    #[test]
    fn a_law_on_the_total_slip_gives_back_up_to_where_it_holds() {
        // x = 5 - 8 s is at the bound 1 at 1/2
        assert_eq!(mean(end(&[5.0], 1.0), end(&[-1.0 + 1e-3], 1.0)), 2.0);
        let back = mean(end(&[5.0], 1.0), end(&[1.0], 3.0));
        // 5 - 4 s = 1 + 2 s at 2/3, where the bound is 7/3
        assert!((back - (1.0 + 7.0 / 3.0)).abs() < 1e-14, "{back}");
    }

    #[test]
    fn a_force_that_is_not_known_is_what_its_bound_says() {
        let unknown = End { resists: 0.0, ..end(&[0.0], 1.0) };
        assert!((mean(unknown, end(&[6.0], 3.0)) - 4.5).abs() < 1e-14);
    }

    #[test]
    fn directions_turn() {
        // from (1, 0) on the ball to (1, 4): it is beyond it at once
        assert_eq!(mean(end(&[1.0, 0.0], 1.0), end(&[1.0, 4.0], 1.0)), 2.0);
    }
}
