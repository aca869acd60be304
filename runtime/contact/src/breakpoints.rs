//! Breakpoints of a piecewise linear path: the first change of branch on a ray, and what follows there.
//!
//! With linear bodies the arguments and radii of all projections are linear along a ray, so that a breakpoint is a root
//! of a linear or a quadratic equation. Promises: pure functions of projection states; a breakpoint that is left behind
//! is not found again. Does not decide which way the path goes on: `newton/path_following.rs` does.

use wfl_compiler::{Projection, ProjectionKind, SlipMut};
use wfl_discrete::system::TermBranches;
use wfl_host::team::Team;

use super::{ContactTerm, ProjectionState};

/// On a ray with a slip direction that turns, the part of the length of the argument by which it may move sideways: on
/// an arc of half a radian a chord is right to a tenth.
const TURN: f64 = 0.5;

/// Where a branch changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// The integration point.
    pub point: usize,
    /// The projection there.
    pub projection: usize,
    /// The entry of a half line.
    pub entry: usize,
}

/// A change of branch on a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Breakpoint {
    /// How far: 0 at the start of the line, 1 at its end, or beyond.
    at: f64,
    place: Place,
}

/// A ray through two states of the projections of a term, in the direction of `sign`.
#[derive(Clone, Copy)]
pub struct Ray<'a> {
    /// Its start.
    pub from: &'a ProjectionState,
    /// A length away.
    pub to: &'a ProjectionState,
    /// Forwards (1) or backwards (-1).
    pub sign: f64,
}

/// Breakpoints that are passed together, with the term they belong to: those of terms with the same projections. They
/// are equal if all ranks call them the same.
#[derive(Clone, Debug, Default)]
pub struct Breakpoints {
    /// What all ranks call the first of them, and the terms; empty for none.
    name: Vec<u64>,
    /// Those whose point this rank has.
    here: Vec<(usize, Place)>,
}

impl Breakpoints {
    /// True for none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.name.is_empty()
    }

    /// Those whose point this rank has.
    pub(super) fn here(&self) -> &[(usize, Place)] {
        &self.here
    }
}

impl PartialEq for Breakpoints {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

/// Breakpoints of one point in several terms are passed together if they are nearer than this, relative or in parts of the
/// line.
const TOGETHER: (f64, f64) = (1e-6, 1e-12);

/// How far rays go, at most to `end`, and the breakpoints they meet there; a term with its ray and branches each.
pub(super) fn next<'a>(
    terms: impl Iterator<Item = ((&'a ContactTerm, Ray<'a>), &'a TermBranches)>,
    friction: f64,
    end: f64,
    team: &dyn Team,
) -> (f64, Breakpoints) {
    let (mut all, mut at) = (Vec::new(), end);
    for (k, ((term, ray), data)) in terms.enumerate() {
        let (found, room) = term.breakpoints(ray, data, friction);
        at = at.min(room);
        all.extend(found.into_iter().map(|breakpoint| (k, term, breakpoint)));
    }
    let [at, _] = team.range(at, at);
    let name = |k: usize, term: &ContactTerm, place: &Place| {
        let [first, second] = term.name(place.point);
        [k as u64, first, second, place.projection as u64, place.entry as u64]
    };
    let counted = all.iter().filter(|(_, term, b)| term.counts(b.place.point));
    let own = counted.min_by(|a, b| a.2.at.total_cmp(&b.2.at)).filter(|(_, _, b)| b.at < at);
    let own: Vec<u8> = own.map_or_else(Vec::new, |(k, term, b)| {
        // adding zero takes the sign off a zero
        let words = std::iter::once((b.at + 0.0).to_bits()).chain(name(*k, term, &b.place));
        words.flat_map(u64::to_le_bytes).collect()
    });
    let words = |bytes: Vec<u8>| bytes.as_chunks().0.iter().map(|word| u64::from_le_bytes(*word)).collect();
    let mut firsts: Vec<(usize, Vec<u64>)> = team.gather(&own).into_iter().map(words).enumerate().collect();
    firsts.retain(|(_, words)| !words.is_empty());
    // of those that are met at once, the first as one rank alone has them; places are not negative, so their bits have
    // their order
    let Some((rank, first)) = firsts.into_iter().min_by(|a, b| a.1.cmp(&b.1)) else {
        return (at, Breakpoints::default());
    };
    let at = f64::from_bits(first[0]);
    let near = at + TOGETHER.0 * at + TOGETHER.1;
    let same = all.iter().filter(|(k, term, b)| name(*k, term, &b.place)[1..] == first[2..] && b.at <= near);
    let here: Vec<(usize, Place)> = same.map(|(k, _, b)| (*k, b.place)).collect();
    // the rank that counts the point knows all terms that are on it
    let terms: Vec<u8> = here.iter().flat_map(|(k, _)| (*k as u64).to_le_bytes()).collect();
    let terms: Vec<u64> = words(team.of_rank(rank, &terms));
    (at, Breakpoints { name: [&first[1..], &terms].concat(), here })
}

impl ContactTerm {
    /// Each change of branch ahead at the points of this rank, and how far the directions of slip let the ray go.
    fn breakpoints(&self, ray: Ray<'_>, data: &TermBranches, friction: f64) -> (Vec<Breakpoint>, f64) {
        let (mut found, mut room) = (Vec::new(), f64::INFINITY);
        let points = data.points.chunks_exact(self.sizes.point).zip(ray.from.points().zip(ray.to.points()));
        for (point, (data, (a, b))) in points.enumerate() {
            for (k, p) in self.projections.iter().enumerate() {
                match p.kind {
                    ProjectionKind::HalfLine => {
                        for entry in 0..p.n {
                            let (x, slope) = line(a, b, p.output + entry, ray.sign);
                            let is_closed = p.branch.sticks(data, entry);
                            let at = if is_closed { opens_at(x, slope) } else { closes_at(x, slope) };
                            if let Some(at) = at {
                                found.push(Breakpoint { at, place: Place { point, projection: k, entry } });
                            }
                        }
                    }
                    ProjectionKind::Ball => {
                        let ball = Ball::new(p, a, b, ray.sign, friction);
                        let sticks = p.branch.sticks(data, 0);
                        if let Some(at) = ball.breakpoint(sticks) {
                            found.push(Breakpoint { at, place: Place { point, projection: k, entry: 0 } });
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

    /// How fast a breakpoint is passed along a ray, `at` this part of it: positive from the branch with the smaller
    /// argument.
    pub(super) fn passage(&self, ray: Ray<'_>, at: f64, place: Place, friction: f64) -> f64 {
        let p = &self.projections[place.projection];
        let (Some(a), Some(b)) = (ray.from.points().nth(place.point), ray.to.points().nth(place.point)) else {
            return 0.0;
        };
        match p.kind {
            ProjectionKind::HalfLine => line(a, b, p.output + place.entry, ray.sign).1,
            ProjectionKind::Ball => Ball::new(p, a, b, ray.sign, friction).passage(at),
        }
    }

    /// Changes the branch at a breakpoint.
    pub(super) fn cross(&self, place: Place, data: &mut TermBranches) {
        let p = &self.projections[place.projection];
        let n = self.sizes.point;
        p.branch.cross(&mut data.points[place.point * n..][..n], place.entry);
    }

    /// Turns the directions of slip to the present arguments, as the term is written.
    pub(super) fn turn_slip(&self, state: &ProjectionState, data: &mut TermBranches, friction: f64) {
        *data = self.carried(data, &state.names).into_owned();
        for (data, out) in data.points.chunks_exact_mut(self.sizes.point).zip(state.points()) {
            for p in self.projections.iter().filter(|p| p.kind == ProjectionKind::Ball) {
                let SlipMut { along, across } = p.branch.slip_mut(data);
                let (x, radius) = (&out[p.output..][..p.n], (friction * out[p.output + p.n]).max(0.0));
                let length = x.iter().fold(0.0f64, |m, x| m.hypot(*x));
                if length > 0.0 {
                    along.iter_mut().zip(x).for_each(|(e, x)| *e = x / length);
                    *across = (radius / length).min(1.0);
                }
            }
        }
    }
}

/// A number and its slope along a ray.
fn line(a: &[f64], b: &[f64], k: usize, sign: f64) -> (f64, f64) {
    (a[k], sign * (b[k] - a[k]))
}

/// Where the argument of a closed entry becomes negative: one that is already opens at once if it goes further.
fn opens_at(x: f64, slope: f64) -> Option<f64> {
    (slope < 0.0).then(|| (-x / slope).max(0.0))
}

/// Where the argument of an open entry becomes positive, likewise.
fn closes_at(x: f64, slope: f64) -> Option<f64> {
    (slope > 0.0).then(|| (-x / slope).max(0.0))
}

/// The argument of a ball along a ray: q(s) = |x|² - r² = a s² + b s + c.
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

    /// The slope of |x| - r at a part of the ray.
    fn passage(&self, at: f64) -> f64 {
        let squared = self.xx + at * (2.0 * self.xd + at * self.dd);
        let along = if squared > 0.0 { (self.xd + at * self.dd) / squared.sqrt() } else { self.dd.sqrt() };
        along - self.growth
    }

    fn breakpoint(&self, sticks: bool) -> Option<f64> {
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
    use wfl_compiler::{BranchLayout, BranchSizes};

    const FRICTION: f64 = 0.5;

    /// A ball with an argument of two entries, behind them the bound before friction.
    fn ball(from: [f64; 3], to: [f64; 3], sign: f64) -> Ball {
        let branch = BranchLayout::new(ProjectionKind::Ball, 2, BranchSizes::default());
        let p = Projection { kind: ProjectionKind::Ball, n: 2, branch, output: 0, acts: true };
        Ball::new(&p, &from, &to, sign, FRICTION)
    }

    #[test]
    fn a_point_slips_where_its_argument_meets_the_bound() {
        // (3 s, 4 s) has the length 5 s, the bound is 1 + s / 2
        let grows = ball([0.0, 0.0, 2.0], [3.0, 4.0, 3.0], 1.0);
        assert!((grows.breakpoint(true).unwrap() - 1.0 / 4.5).abs() < 1e-15);
        // the bound grows faster than the argument
        assert_eq!(ball([0.0, 0.0, 2.0], [0.3, 0.4, 4.0], 1.0).breakpoint(true), None);
        // backwards the bound closes on it: 5 s = 1 - s / 2
        let back = ball([0.0, 0.0, 2.0], [3.0, 4.0, 3.0], -1.0);
        assert!((back.breakpoint(true).unwrap() - 1.0 / 5.5).abs() < 1e-15);
    }

    #[test]
    fn a_point_sticks_where_the_bound_meets_its_argument() {
        // (3, 0) turns back through the ball of radius 1
        let back = ball([3.0, 0.0, 2.0], [-1.0, 0.0, 2.0], 1.0);
        assert!((back.breakpoint(false).unwrap() - 0.5).abs() < 1e-15);
        // it passes beside the ball
        assert_eq!(ball([3.0, 2.0, 2.0], [-1.0, 2.0, 2.0], 1.0).breakpoint(false), None);
        // open points have no ball to meet
        assert_eq!(ball([3.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 1.0).breakpoint(false), None);
    }

    #[test]
    fn a_point_that_crosses_its_ball_leaves_it() {
        // from (-0.9, 0) to (2.1, 0), towards the middle at first; the ball of radius 1 is left with a slope of 3
        let across = ball([-0.9, 0.0, 2.0], [2.1, 0.0, 2.0], 1.0);
        let at = across.breakpoint(true).unwrap();
        assert!((at - 1.9 / 3.0).abs() < 1e-15);
        assert!((across.passage(0.0) + 3.0).abs() < 1e-15 && (across.passage(at) - 3.0).abs() < 1e-14);
    }

    #[test]
    fn a_breakpoint_that_is_left_behind_is_not_found_again() {
        let there = [1.0, 0.0, 2.0];
        assert_eq!(ball(there, [2.0, 0.0, 2.0], 1.0).breakpoint(false), None);
        assert_eq!(ball(there, [2.0, 0.0, 2.0], 1.0).breakpoint(true), Some(0.0), "it leaves the ball at once");
        assert_eq!(ball(there, [2.0, 0.0, 2.0], -1.0).breakpoint(false), Some(0.0));
        let across = ball(there, [2.0, 0.0, 2.0], -1.0).breakpoint(true).unwrap();
        assert!((across - 2.0).abs() < 1e-15, "on the other side of the ball: {across}");
        assert_eq!(opens_at(0.0, 1.0), None);
        assert_eq!(opens_at(-1e-17, -1.0), Some(0.0));
        assert_eq!(closes_at(-3.0, 2.0), Some(1.5));
    }

    use crate::{
        Contact,
        test_block::{Block, LAPLACE, PENALTY},
    };
    use wfl_compiler::Branch;

    /// Where points of a law without friction are on a ray: argument and value of each.
    type Line<'a> = (&'a [[f64; 2]], &'a [[f64; 2]]);

    fn line_of(line: Line<'_>, terms: usize) -> [Vec<ProjectionState>; 2] {
        let state =
            |points: &[[f64; 2]]| ProjectionState::of(&points.iter().map(<[f64; 2]>::as_slice).collect::<Vec<_>>());
        [vec![state(line.0); terms], vec![state(line.1); terms]]
    }

    fn frictionless(terms: usize) -> Contact {
        Block::new(1, &[LAPLACE], &vec![PENALTY; terms]).contact
    }

    #[test]
    fn the_first_point_that_closes_is_found_at_its_exact_part_of_the_way() {
        let contact = frictionless(1);
        let line = line_of((&[[-3.0, 0.0], [-1.0, 0.0]], &[[1.0, 0.0], [2.0, 0.0]]), 1);
        let (at, found) = contact.next_breakpoints(&line, 1.0, 1.0);
        assert_eq!(at, 1.0 / 3.0);
        assert_eq!(found.here(), [(0, Place { point: 1, projection: 0, entry: 0 })]);
        assert_eq!(contact.passage(&line, at, &found), 3.0, "it is passed as fast as its argument grows");
    }

    #[test]
    fn a_ray_that_no_point_meets_goes_to_its_end() {
        let contact = frictionless(1);
        let line = line_of((&[[-3.0, 0.0], [-1.0, 0.0]], &[[-4.0, 0.0], [-0.5, 0.0]]), 1);
        let (at, found) = contact.next_breakpoints(&line, 1.0, 1.0);
        assert!(at == 1.0 && found.is_empty());
        assert_eq!(contact.passage(&line, at, &found), 0.0);
        assert_eq!(contact.next_breakpoints(&line, 1.0, f64::INFINITY).0, 2.0, "beyond its end it meets one");
    }

    #[test]
    fn backwards_a_ray_meets_what_lies_behind() {
        let contact = frictionless(1);
        let line = line_of((&[[-3.0, 0.0], [-1.0, 0.0]], &[[-4.0, 0.0], [-0.5, 0.0]]), 1);
        let (at, found) = contact.next_breakpoints(&line, -1.0, f64::INFINITY);
        assert_eq!((at, found.here()[0].1.point), (3.0, 0));
    }

    #[test]
    fn points_that_are_met_at_once_are_passed_one_by_one_in_their_order() {
        let contact = frictionless(1);
        let line = line_of((&[[-1.0, 0.0], [-1.0, 0.0]], &[[1.0, 0.0], [1.0, 0.0]]), 1);
        let (at, found) = contact.next_breakpoints(&line, 1.0, 1.0);
        assert_eq!((at, found.here().len(), found.here()[0].1.point), (0.5, 1, 0));
    }

    #[test]
    fn laws_of_one_point_are_passed_together() {
        let contact = frictionless(2);
        let line = line_of((&[[-3.0, 0.0], [-1.0, 0.0]], &[[1.0, 0.0], [2.0, 0.0]]), 2);
        let (_, found) = contact.next_breakpoints(&line, 1.0, 1.0);
        let place = Place { point: 1, projection: 0, entry: 0 };
        assert_eq!(found.here(), [(0, place), (1, place)]);
    }

    #[test]
    fn breakpoints_are_told_apart_by_their_place_and_not_by_the_ray() {
        let contact = frictionless(1);
        let first = |a: f64, b: f64| {
            let line = line_of((&[[-a, 0.0], [-b, 0.0]], &[[1.0, 0.0], [1.0, 0.0]]), 1);
            contact.next_breakpoints(&line, 1.0, 1.0).1
        };
        assert_eq!(first(1.0, 2.0), first(3.0, 4.0));
        assert_ne!(first(1.0, 2.0), first(2.0, 1.0));
        assert_ne!(first(1.0, 2.0), Breakpoints::default());
    }

    #[test]
    fn a_crossing_changes_one_branch_and_a_second_one_changes_it_back() {
        let contact = Block::with_friction(1).contact;
        let term = &contact.terms()[0];
        let open = term.open();
        for projection in 0..2 {
            let mut data = open.clone();
            let place = Place { point: 1, projection, entry: 0 };
            term.cross(place, &mut data);
            assert_eq!(data.points.iter().zip(&open.points).filter(|(a, b)| a != b).count(), 1);
            assert!(term.projections[projection].branch.sticks(&data.points[term.sizes.point..], 0));
            term.cross(place, &mut data);
            assert_eq!(data, open);
        }
    }

    #[test]
    fn slip_turns_to_its_argument_and_keeps_no_more_across_than_the_bound() {
        let contact = Block::with_friction(1).contact;
        let term = &contact.terms()[0];
        let state = ProjectionState::of(&[&[2.0, 2.0, 3.0, 4.0, 1.0, 0.0, 0.0], &[2.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0]]);
        let turned = |friction: f64| {
            let mut data = term.open();
            term.turn_slip(&state, &mut data, friction);
            data
        };
        let ball = term.projections[1].branch;
        assert_eq!(ball.branch(&turned(1.0).points, 0), Branch::Slip { along: &[0.6, 0.8], across: 0.2 });
        assert_eq!(ball.branch(&turned(9.0).points, 0), Branch::Slip { along: &[0.6, 0.8], across: 1.0 });
        let still = Branch::Slip { along: &[0.0, 0.0], across: 0.0 };
        assert_eq!(ball.branch(&turned(1.0).points[term.sizes.point..], 0), still, "nothing has no direction");
    }

    #[test]
    fn a_slip_that_turns_lets_a_ray_go_half_its_length_sideways() {
        let contact = Block::with_friction(1).contact;
        let mut data = contact.terms()[0].open();
        let at = |x: [f64; 2]| {
            let point = [9.0, 9.0, x[0], x[1], 1.0, 0.0, 0.0];
            ProjectionState::of(&[&point, &point])
        };
        contact.terms()[0].projections.iter().for_each(|p| p.branch.slip(&mut data.points));
        let room = |to: [f64; 2]| {
            let (from, to) = (at([4.0, 0.0]), at(to));
            contact.terms()[0].breakpoints(Ray { from: &from, to: &to, sign: 1.0 }, &data, 1.0).1
        };
        assert_eq!(room([4.0, 8.0]), 0.25);
        assert_eq!(room([5.0, 0.0]), f64::INFINITY, "straight on");
    }
}
