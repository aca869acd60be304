//! Where a way through the pieces meets their kinks: the first change of branch on a line, and what follows there.
//!
//! With linear bodies the arguments and radii of all projections are linear along a line, so that a kink is a root of a
//! linear or a quadratic equation. Promises: pure functions of what was watched; a kink that is left behind is not
//! found again. Does not decide which way the path goes on: `newton/path.rs` does.

use wfl_compiler::{BALL_NUMBERS, Projection, ProjectionKind};

use super::{TermPieces, Watched};

/// On a way with a slip direction that turns, the part of the length of the argument by which it may move sideways.
const TURN: f64 = 0.5;

/// A change of branch on a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Kink {
    /// Where: 0 at the start of the line, 1 at its end, or beyond.
    pub(crate) at: f64,
    /// The integration point, the projection there, and the entry of a half line.
    pub(crate) place: (usize, usize, usize),
}

/// A line through what is watched, in the direction of `sign`.
#[derive(Clone, Copy)]
pub(crate) struct Way<'a> {
    pub(crate) from: &'a Watched,
    pub(crate) to: &'a Watched,
    pub(crate) sign: f64,
}

/// Kinks that are passed together, by piece: those of terms that hold the same projections.
pub(crate) type Kinks = Vec<(usize, (usize, usize, usize))>;

/// Kinks of one point in several terms are passed together if they are nearer than this, relative or in parts of the
/// line.
const TOGETHER: (f64, f64) = (1e-6, 1e-12);

/// How far a way goes, at most to `end`, and the kinks it meets there; a way by piece.
pub(crate) fn next_kinks<'a>(
    pieces: impl Iterator<Item = (&'a TermPieces, Way<'a>, &'a [f64])>,
    end: f64,
) -> (f64, Kinks) {
    let (mut all, mut at) = (Vec::new(), end);
    for (k, (piece, way, guides)) in pieces.enumerate() {
        let (found, room) = piece.kinks(way, guides);
        at = at.min(room);
        all.extend(found.into_iter().map(|kink| (k, kink)));
    }
    let Some((_, first)) = all.iter().min_by(|a, b| a.1.at.total_cmp(&b.1.at)).filter(|(_, kink)| kink.at < at) else {
        return (at, Vec::new());
    };
    let near = first.at + TOGETHER.0 * first.at + TOGETHER.1;
    let same = all.iter().filter(|(_, kink)| kink.place == first.place && kink.at <= near);
    (first.at, same.map(|(k, kink)| (*k, kink.place)).collect())
}

impl TermPieces {
    /// Each change of branch ahead, and how far the directions of slip let the way go.
    pub(crate) fn kinks(&self, way: Way<'_>, guides: &[f64]) -> (Vec<Kink>, f64) {
        let (mut found, mut room) = (Vec::new(), f64::INFINITY);
        let points = guides.chunks_exact(self.n_guides).zip(way.from.points().zip(way.to.points()));
        for (point, (guides, (a, b))) in points.enumerate() {
            for (k, p) in self.projections.iter().enumerate() {
                match p.kind {
                    ProjectionKind::HalfLine => {
                        for entry in 0..p.n {
                            let (x, slope) = line(a, b, p.output + entry, way.sign);
                            let closed = guides[p.guide + entry] > 0.5;
                            if let Some(at) = half_line(x, slope, closed) {
                                found.push(Kink { at, place: (point, k, entry) });
                            }
                        }
                    }
                    ProjectionKind::Ball => {
                        let ball = Ball::new(p, a, b, way.sign, self.friction);
                        let sticks = guides[p.guide] > 0.5;
                        if let Some(at) = ball.kink(sticks) {
                            found.push(Kink { at, place: (point, k, 0) });
                        }
                        if !sticks && ball.radius > 0.0 && ball.aside > 0.0 {
                            room = room.min(TURN * ball.xx.sqrt() / ball.aside);
                        }
                    }
                }
            }
        }
        (found, room)
    }

    /// How fast a kink is passed along a way, `at` this part of it: positive from the branch with the smaller argument.
    pub(crate) fn passage(&self, way: Way<'_>, at: f64, (point, k, entry): (usize, usize, usize)) -> f64 {
        let p = &self.projections[k];
        let (Some(a), Some(b)) = (way.from.points().nth(point), way.to.points().nth(point)) else { return 0.0 };
        match p.kind {
            ProjectionKind::HalfLine => line(a, b, p.output + entry, way.sign).1,
            ProjectionKind::Ball => Ball::new(p, a, b, way.sign, self.friction).passage(at),
        }
    }

    /// Changes the branch at a kink.
    pub(crate) fn cross(&self, (point, k, entry): (usize, usize, usize), guides: &mut [f64]) {
        let p = &self.projections[k];
        let at = point * self.n_guides + p.guide + entry;
        guides[at] = 1.0 - guides[at];
    }

    /// Turns the directions of slip to the present arguments, as the term is written.
    pub(crate) fn turn(&self, watched: &Watched, guides: &mut [f64]) {
        for (guides, out) in guides.chunks_exact_mut(self.n_guides).zip(watched.points()) {
            for p in self.projections.iter().filter(|p| p.kind == ProjectionKind::Ball) {
                let (numbers, along) = guides[p.guide..][..BALL_NUMBERS + p.n].split_at_mut(BALL_NUMBERS);
                let (x, radius) = (&out[p.output..][..p.n], (self.friction * out[p.output + p.n]).max(0.0));
                let length = x.iter().fold(0.0f64, |m, x| m.hypot(*x));
                if length > 0.0 {
                    along.iter_mut().zip(x).for_each(|(e, x)| *e = x / length);
                    numbers[1] = (radius / length).min(1.0);
                }
            }
        }
    }
}

/// A number and its slope along a way.
fn line(a: &[f64], b: &[f64], k: usize, sign: f64) -> (f64, f64) {
    (a[k], sign * (b[k] - a[k]))
}

/// Where an argument leaves its half line: a point that is beyond already leaves at once if it goes further.
fn half_line(x: f64, slope: f64, closed: bool) -> Option<f64> {
    let leaves = if closed { slope < 0.0 } else { slope > 0.0 };
    leaves.then(|| (-x / slope).max(0.0))
}

/// The argument of a ball along a way: q(s) = |x|² - r² = a s² + b s + c.
struct Ball {
    radius: f64,
    growth: f64,
    /// |x|², x.dx, |dx|², and the length of dx across x.
    xx: f64,
    xd: f64,
    dd: f64,
    aside: f64,
}

impl Ball {
    fn new(p: &Projection, a: &[f64], b: &[f64], sign: f64, friction: f64) -> Self {
        let (mut xx, mut xd, mut dd) = (0.0, 0.0, 0.0);
        for k in p.output..p.output + p.n {
            let (x, d) = line(a, b, k, sign);
            xx += x * x;
            xd += x * d;
            dd += d * d;
        }
        let (radius, growth) = line(a, b, p.output + p.n, sign);
        let aside = if xx > 0.0 { (dd - xd * xd / xx).max(0.0).sqrt() } else { 0.0 };
        Self { radius: friction * radius, growth: friction * growth, xx, xd, dd, aside }
    }

    /// The slope of |x| - r at a part of the way.
    fn passage(&self, at: f64) -> f64 {
        let squared = self.xx + at * (2.0 * self.xd + at * self.dd);
        let along = if squared > 0.0 { (self.xd + at * self.dd) / squared.sqrt() } else { self.dd.sqrt() };
        along - self.growth
    }

    fn kink(&self, sticks: bool) -> Option<f64> {
        // an open point has no radius, and no branch that matters
        if !sticks && self.radius <= 0.0 && self.growth <= 0.0 {
            return None;
        }
        let (a, b) = (self.dd - self.growth * self.growth, 2.0 * (self.xd - self.radius * self.growth));
        let c = self.xx - self.radius * self.radius;
        let (out, leaving) =
            if sticks { (c >= 0.0, self.passage(0.0) > 0.0) } else { (c <= 0.0, self.passage(0.0) < 0.0) };
        if out && leaving {
            return Some(0.0);
        }
        let root = b * b - 4.0 * a * c;
        let root = if root >= 0.0 { root.sqrt() } else { return None };
        // upwards where it sticks, downwards where it slips; of the two forms the one that does not cancel
        let at = match sticks {
            true if b > 0.0 => -2.0 * c / (b + root),
            true => (root - b) / (2.0 * a),
            false if b < 0.0 => 2.0 * c / (root - b),
            false => -(b + root) / (2.0 * a),
        };
        let inside = self.radius + at * self.growth > 0.0;
        (at > 0.0 && at.is_finite() && (inside || sticks)).then_some(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRICTION: f64 = 0.5;

    /// A ball with an argument of two entries, behind them the bound before friction.
    fn ball(from: [f64; 3], to: [f64; 3], sign: f64) -> Ball {
        let p = Projection { kind: ProjectionKind::Ball, n: 2, guide: 0, output: 0, acts: true };
        Ball::new(&p, &from, &to, sign, FRICTION)
    }

    #[test]
    fn a_point_slips_where_its_argument_meets_the_bound() {
        // (3 s, 4 s) has the length 5 s, the bound is 1 + s / 2
        let grows = ball([0.0, 0.0, 2.0], [3.0, 4.0, 3.0], 1.0);
        assert!((grows.kink(true).unwrap() - 1.0 / 4.5).abs() < 1e-15);
        // the bound grows faster than the argument
        assert_eq!(ball([0.0, 0.0, 2.0], [0.3, 0.4, 4.0], 1.0).kink(true), None);
        // backwards the bound closes on it: 5 s = 1 - s / 2
        let back = ball([0.0, 0.0, 2.0], [3.0, 4.0, 3.0], -1.0);
        assert!((back.kink(true).unwrap() - 1.0 / 5.5).abs() < 1e-15);
    }

    #[test]
    fn a_point_sticks_where_the_bound_meets_its_argument() {
        // (3, 0) turns back through the ball of radius 1
        let back = ball([3.0, 0.0, 2.0], [-1.0, 0.0, 2.0], 1.0);
        assert!((back.kink(false).unwrap() - 0.5).abs() < 1e-15);
        // it passes beside the ball
        assert_eq!(ball([3.0, 2.0, 2.0], [-1.0, 2.0, 2.0], 1.0).kink(false), None);
        // open points have no ball to meet
        assert_eq!(ball([3.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 1.0).kink(false), None);
    }

    #[test]
    fn a_point_that_crosses_its_ball_leaves_it() {
        // from (-0.9, 0) to (2.1, 0), towards the middle at first; the ball of radius 1 is left with a slope of 3
        let across = ball([-0.9, 0.0, 2.0], [2.1, 0.0, 2.0], 1.0);
        let at = across.kink(true).unwrap();
        assert!((at - 1.9 / 3.0).abs() < 1e-15);
        assert!((across.passage(0.0) + 3.0).abs() < 1e-15 && (across.passage(at) - 3.0).abs() < 1e-14);
    }

    #[test]
    fn a_kink_that_is_left_behind_is_not_found_again() {
        let there = [1.0, 0.0, 2.0];
        assert_eq!(ball(there, [2.0, 0.0, 2.0], 1.0).kink(false), None);
        assert_eq!(ball(there, [2.0, 0.0, 2.0], 1.0).kink(true), Some(0.0), "it leaves the ball at once");
        assert_eq!(ball(there, [2.0, 0.0, 2.0], -1.0).kink(false), Some(0.0));
        let across = ball(there, [2.0, 0.0, 2.0], -1.0).kink(true).unwrap();
        assert!((across - 2.0).abs() < 1e-15, "on the other side of the ball: {across}");
        assert_eq!(half_line(0.0, 1.0, true), None);
        assert_eq!(half_line(-1e-17, -1.0, true), Some(0.0));
        assert_eq!(half_line(-3.0, 2.0, false), Some(1.5));
    }
}
