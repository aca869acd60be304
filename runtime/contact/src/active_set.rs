//! The active set: which branch each projection is on at each integration point.
//!
//! What branches are and how a point stores them says `compiler/src/branch.rs`. Promises: pure functions of what the
//! projections give and of the branches before.

use wfl_compiler::{BranchRegularisation, Projection, ProjectionKind, SlipMut};

use super::{Complementarity, ContactTerm, ProjectionState, Regularisation};
use wfl_discrete::assemble::FieldValues;
use wfl_discrete::system::{System, TermBranches};

/// Part of the argument across the direction of slip that a point keeps which slides at twice its bound: the factor of
/// a ball at an argument of twice its radius.
const ACROSS: f64 = 0.5;

/// Which points may close at a start at which all are open.
#[derive(Clone, Copy)]
pub(super) struct Near {
    /// How far the sides can come near each other (length).
    pub(super) moved: f64,
    /// All close where none is that near.
    pub(super) or_all: bool,
}

impl ContactTerm {
    /// The branches of the term as it is written at this state: a start without a past.
    ///
    /// Inner projections enter the radius of outer ones, so the law is read as often as they can be nested.
    pub(super) fn as_written(&self, system: &System, values: FieldValues<'_>, friction: f64) -> TermBranches {
        let names = self.names_at(&system.mesh, values);
        let open = if self.is_cut() { self.open_on(&names) } else { self.open() };
        self.written_from(open, system, values, friction)
    }

    /// The same looked for from the branches in `values`: those of a state that is solved are read once.
    pub(super) fn as_written_near(&self, system: &System, values: FieldValues<'_>, friction: f64) -> TermBranches {
        self.written_from(TermBranches::from_values(self.field, values.current), system, values, friction)
    }

    fn written_from(
        &self,
        mut data: TermBranches,
        system: &System,
        values: FieldValues<'_>,
        friction: f64,
    ) -> TermBranches {
        for _ in 0..self.projections.len() {
            let mut current: Vec<&[f64]> = values.current.to_vec();
            data.stand_in(self.field, &mut current);
            let state = self.read(&system.mesh, FieldValues { current: &current, ..values });
            let next = self.written_branches(&state, &data, friction);
            if next == data {
                break;
            }
            data = next;
        }
        data
    }

    /// Closes points (sticking) if the term as written is open everywhere and no point is further away than
    /// the mesh is large; the start of a scene in which contact closes. `near.moved` is how far the sides can come near each
    /// other by what is prescribed: points further apart stay open, unless all are and `near` says that they close then.
    ///
    /// A closed zone that is too wide opens by about one ring of entities an iteration, so that it is worth to be near.
    pub(super) fn close_if_open(&self, system: &System, values: FieldValues<'_>, data: &mut TermBranches, near: Near) {
        let (low, high) = system.mesh.bounds();
        let reach = (0..3).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
        let half_lines = || {
            self.projections
                .iter()
                .zip(&self.scaling.slopes)
                .filter(|(p, _)| p.acts && p.kind == ProjectionKind::HalfLine)
        };
        let mut open = half_lines().next().is_some();
        let mut is_near = Vec::new();
        self.law.for_each_point(&system.mesh, &self.sampled, values, |_, _, _, _, out| {
            let within = |limit: f64| {
                let close =
                    |p: &Projection, slope: f64| out[p.output..][..p.n].iter().all(|x| *x < 0.0 && -x <= limit * slope);
                half_lines().all(|(p, slope)| close(p, *slope))
            };
            open &= within(reach);
            is_near.push(within(near.moved));
        });
        let team = system.team();
        if team.all(open) {
            let every = near.or_all && !team.any(is_near.contains(&true));
            for (point, _) in
                data.points.chunks_exact_mut(self.sizes.point).zip(&is_near).filter(|(_, near)| every || **near)
            {
                self.stick_point(point);
            }
        }
    }

    /// Every point closed and sticking, wherever it is.
    pub fn stick_all(&self, data: &mut TermBranches) {
        data.points.chunks_exact_mut(self.sizes.point).for_each(|point| self.stick_point(point));
    }

    /// Lets every point slide, closed as it is: along the argument there, where that has a direction.
    pub(super) fn slide_all(&self, state: &ProjectionState, data: &mut TermBranches) {
        self.projections.iter().for_each(|p| p.branch.set_friction(&mut data.regularisation, 1.0));
        *data = self.carried(data, &state.names).into_owned();
        for (data, out) in data.points.chunks_exact_mut(self.sizes.point).zip(state.points()) {
            for p in self.projections.iter().filter(|p| p.kind == ProjectionKind::Ball) {
                let x = &out[p.output..][..p.n];
                let length = x.iter().fold(0.0f64, |m, x| m.hypot(*x));
                p.branch.slip(data);
                let slip = p.branch.slip_mut(data);
                *slip.across = ACROSS;
                for (slot, x) in slip.along.iter_mut().zip(x) {
                    *slot = if length > 0.0 && length.is_finite() { x / length } else { 0.0 };
                }
            }
        }
    }

    /// Balls without a radius slip, by nothing.
    pub(super) fn let_go(&self, system: &System, values: FieldValues<'_>, data: &mut TermBranches) {
        let mut current: Vec<&[f64]> = values.current.to_vec();
        let known = data.clone();
        known.stand_in(self.field, &mut current);
        let state = self.read(&system.mesh, FieldValues { current: &current, ..values });
        *data = self.carried(data, &state.names).into_owned();
        for (data, out) in data.points.chunks_exact_mut(self.sizes.point).zip(state.points()) {
            let balls = self.projections.iter().filter(|p| p.kind == ProjectionKind::Ball);
            for p in balls.filter(|p| out[p.output + p.n] <= 0.0) {
                p.branch.slip(data);
                let slip = p.branch.slip_mut(data);
                *slip.across = 0.0;
                slip.along.fill(0.0);
            }
        }
    }

    /// Closed and sticking.
    fn stick_point(&self, point: &mut [f64]) {
        self.projections.iter().for_each(|p| p.branch.stick(point));
    }

    /// Writes compliance and overstress, branches as they are.
    pub(super) fn write_regularisation(&self, regularisation: &Regularisation, data: &mut TermBranches) {
        for (k, p) in self.projections.iter().enumerate() {
            p.branch.set_regularisation(&mut data.regularisation, self.regularised(k, regularisation));
        }
    }

    /// How a projection differs from what is written: the same at all points.
    fn regularised(&self, projection: usize, regularisation: &Regularisation) -> BranchRegularisation {
        BranchRegularisation {
            compliance: self.scaling.taken(projection, regularisation),
            overstress: self.scaling.overstress(projection, regularisation.overstress),
        }
    }

    /// Points that this rank counts whose branches differ: open or closed, stick or slip, slip against itself.
    pub(super) fn n_differing(&self, a: &TermBranches, b: &TermBranches) -> usize {
        let a = self.carried_to(a, b);
        let points = a.points.chunks_exact(self.sizes.point).zip(b.points.chunks_exact(self.sizes.point));
        let counted = points.enumerate().filter(|(point, _)| self.counts(*point));
        counted.filter(|(_, (a, b))| self.projections.iter().any(|p| p.branch.differs(a, b))).count()
    }

    /// The branches before any is chosen: open.
    #[must_use]
    pub fn open(&self) -> TermBranches {
        // where faces are cut, at rest: the branches at other states follow by the nearest points
        if self.is_cut() { self.open_on(&self.sampled.domain.point_names()) } else { self.open_at(self.n_points()) }
    }

    /// The branches that follow from those of `data`.
    pub(super) fn next_branches(
        &self,
        law: &Complementarity,
        state: &ProjectionState,
        data: &TermBranches,
    ) -> TermBranches {
        let choice = |k: usize| Choice {
            ratio: Some(self.scaling.ratio(k, law)),
            regularisation: self.regularised(k, &law.regularisation),
            friction: law.regularisation.friction,
        };
        self.chosen_by((0..self.projections.len()).map(choice).collect(), state, data)
    }

    /// The branches of the projections as they are written, whose inner ones are on those of `data`.
    fn written_branches(&self, state: &ProjectionState, data: &TermBranches, friction: f64) -> TermBranches {
        self.chosen_by(self.projections.iter().map(|_| Choice::as_written(friction)).collect(), state, data)
    }

    /// The branches after a choice for each projection, and its regularisation.
    fn chosen_by(&self, choices: Vec<Choice>, state: &ProjectionState, data: &TermBranches) -> TermBranches {
        let (mut next, mut x) = (self.carried(data, &state.names).into_owned(), Vec::new());
        for (choice, p) in choices.iter().zip(&self.projections) {
            p.branch.set_regularisation(&mut next.regularisation, choice.regularisation);
            p.branch.set_friction(&mut next.regularisation, choice.friction);
        }
        for (point, out) in next.points.chunks_exact_mut(self.sizes.point).zip(state.points()) {
            choices.iter().zip(&self.projections).for_each(|(choice, p)| choice.apply(p, out, &mut x, point));
        }
        next
    }
}

/// How the branch of a projection is chosen.
struct Choice {
    /// The branch is that of `t + c (x - t)`, or that of the argument as it is written.
    ratio: Option<f64>,
    /// How the law differs from what is written.
    regularisation: BranchRegularisation,
    /// Factor on the radius of a ball.
    friction: f64,
}

impl Choice {
    fn as_written(friction: f64) -> Self {
        Self { ratio: None, regularisation: BranchRegularisation::default(), friction }
    }

    /// Writes the branch of a projection at a point where its law gives `out`; `x` has room for its argument.
    fn apply(&self, p: &Projection, out: &[f64], x: &mut Vec<f64>, point: &mut [f64]) {
        x.clear();
        x.extend(out[p.output..][..p.n].iter().map(|x| (1.0 - self.regularisation.compliance) * x));
        match p.kind {
            ProjectionKind::HalfLine => {
                let t = &out[p.output + p.n..][..p.n];
                for k in 0..p.n {
                    let y = self.ratio.map_or(x[k], |c| t[k] + c * (x[k] - t[k]));
                    p.branch.close_by(point, k, y);
                }
            }
            ProjectionKind::Ball => {
                let radius = self.friction * out[p.output + p.n];
                let t = if self.ratio.is_some() { &out[p.output + p.n + 1..][..p.n] } else { &x[..] };
                if ball(x, t, radius, self.ratio.unwrap_or(1.0), p.branch.slip_mut(point)) {
                    p.branch.stick(point);
                } else {
                    p.branch.slip(point);
                }
            }
        }
    }
}

/// Whether a ball sticks, and the numbers that it slips by, from the argument `x`, the value `t`, the radius and `c`.
///
/// Of `t + dt = P(y) + P'(y) (dy)`, y = t + c (x - t), solved for t + dt: the part of t across y drops out, because y
/// has none. A point whose y is on the other side of the ball sticks first: after a load that turns back a whole face would
/// slip the other way else, further than it has come, and the search along that step ends nowhere.
fn ball(x: &[f64], t: &[f64], radius: f64, ratio: f64, slip: SlipMut<'_>) -> bool {
    let SlipMut { along, across } = slip;
    for (k, y) in along.iter_mut().enumerate() {
        *y = t[k] + ratio * (x[k] - t[k]);
    }
    let largest = along.iter().fold(0.0f64, |m, y| m.max(y.abs()));
    let reduced = if largest > 0.0 { along.iter().map(|y| (y / largest).powi(2)).sum::<f64>().sqrt() } else { 0.0 };
    let is_inside = radius >= 0.0 && (largest == 0.0 || reduced <= radius / largest);
    let turns_back = radius > 0.0 && along.iter().zip(t).map(|(y, t)| y * t).sum::<f64>() < 0.0;
    let stick = is_inside || turns_back;
    *across = 0.0;
    if largest > 0.0 {
        along.iter_mut().for_each(|y| *y = *y / largest / reduced);
    }
    if stick || radius <= 0.0 {
        return stick;
    }
    let k0 = radius / largest / reduced;
    *across = ratio * k0 / (1.0 - k0 + ratio * k0);
    stick
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ball on a branch.
    #[derive(Debug)]
    struct OnBranch {
        sticks: bool,
        along: Vec<f64>,
        across: f64,
    }

    fn value(x: &[f64], radius: f64, branch: &OnBranch) -> Vec<f64> {
        let e = &branch.along;
        if branch.sticks {
            return x.to_vec();
        }
        let along: f64 = x.iter().zip(e).map(|(x, e)| x * e).sum();
        (0..x.len()).map(|k| radius * e[k] + branch.across * (x[k] - along * e[k])).collect()
    }

    fn projection(x: &[f64], radius: f64) -> Vec<f64> {
        let norm = x.iter().map(|x| x * x).sum::<f64>().sqrt();
        let factor = if norm <= radius { 1.0 } else { radius / norm };
        x.iter().map(|x| factor * x).collect()
    }

    fn chosen(x: &[f64], t: &[f64], radius: f64, ratio: f64) -> OnBranch {
        let (mut along, mut across) = (vec![0.0; x.len()], 0.0);
        let sticks = ball(x, t, radius, ratio, SlipMut { along: &mut along, across: &mut across });
        OnBranch { sticks, along, across }
    }

    fn gap(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    const STATES: [([f64; 3], f64); 4] =
        [([3.0, -4.0, 1.0], 2.0), ([0.3, 0.1, -0.2], 2.0), ([0.0, 2.0, 0.1], 0.5), ([-7.0, 0.0, 0.0], 6.9)];

    #[test]
    fn a_settled_projection_keeps_its_value_for_every_ratio() {
        for (x, radius) in STATES {
            let t = projection(&x, radius);
            for ratio in [1e-8, 1e-3, 1.0, 20.0, 1e6] {
                let branch = chosen(&x, &t, radius, ratio);
                assert!(gap(&value(&x, radius, &branch), &t) < 1e-14, "{x:?} {ratio}");
            }
        }
    }

    #[test]
    fn a_settled_branch_is_the_tangent_of_the_projection() {
        for (x, radius) in STATES {
            let t = projection(&x, radius);
            for ratio in [1e-3, 1.0, 50.0] {
                let branch = chosen(&x, &t, radius, ratio);
                let moved = |s: f64| [x[0] + 2.0 * s, x[1] - s, x[2] + 3.0 * s];
                let error = |s: f64| gap(&value(&moved(s), radius, &branch), &projection(&moved(s), radius));
                assert!(error(1e-4) < 1e-6 && error(1e-5) < 1e-8, "{x:?} {ratio}: second order");
            }
        }
    }

    #[test]
    fn a_point_sticks_before_it_slips_the_other_way() {
        let (t, radius) = ([2.0, 0.0], 2.0);
        // however far behind the argument has come, and for each ratio
        for (back, ratio) in [(-1.0, 1.0), (-100.0, 1.0), (-100.0, 0.1), (-1e6, 1e-3)] {
            assert!(chosen(&[back, 0.3], &t, radius, ratio).sticks, "{back} {ratio}");
        }
        // slip that turns by less than a right angle goes on, and without a bound nothing sticks
        assert!(!chosen(&[3.0, 40.0], &t, radius, 1.0).sticks);
        assert!(!chosen(&[-100.0, 0.0], &t, 0.0, 1.0).sticks);
    }

    #[test]
    fn a_branch_solves_the_linearised_equation() {
        // t = P(t + c (x - t)) about a state that is not settled: the exact derivative of P makes the residual of the
        // linear equation vanish
        let (x, t, radius, ratio) = ([3.0, 1.0], [0.4, -0.9], 1.0, 0.3);
        let branch = chosen(&x, &t, radius, ratio);
        let y: Vec<f64> = (0..2).map(|k| t[k] + ratio * (x[k] - t[k])).collect();
        let found = value(&x, radius, &branch);
        let step: Vec<f64> = (0..2).map(|k| found[k] - t[k]).collect();
        let along = |s: f64| -> Vec<f64> { (0..2).map(|k| y[k] + s * (1.0 - ratio) * step[k]).collect() };
        let (a, b) = (projection(&along(1e-6), radius), projection(&along(-1e-6), radius));
        let base = projection(&y, radius);
        for k in 0..2 {
            let linear = base[k] + (a[k] - b[k]) / 2e-6;
            assert!((found[k] - linear).abs() < 1e-8, "entry {k}: {} against {linear}", found[k]);
        }
    }

    #[test]
    fn an_open_or_resting_point_has_a_branch() {
        let open = chosen(&[1.0, 0.0], &[0.0, 0.0], 0.0, 0.1);
        assert_eq!(value(&[1.0, 0.0], 0.0, &open), [0.0, 0.0]);
        let rest = chosen(&[0.0, 0.0], &[0.0, 0.0], 0.0, 0.1);
        assert!(rest.sticks, "the tie sticks");
        assert_eq!(value(&[0.0, 0.0], -1.0, &chosen(&[0.0, 0.0], &[0.0, 0.0], -1.0, 1.0)), [0.0, 0.0]);
        let tiny = chosen(&[3e-320, 0.0], &[0.0, 0.0], 1e-321, 1.0);
        assert!(tiny.along.iter().chain([&tiny.across]).all(|x| x.is_finite()));
    }

    use crate::{ActiveSet, Contact, test_block::Block};
    use wfl_compiler::{Branch, BranchLayout, BranchSizes};

    fn half_line(n: usize) -> Projection {
        let branch = BranchLayout::new(ProjectionKind::HalfLine, n, BranchSizes::default());
        Projection { kind: ProjectionKind::HalfLine, n, branch, output: 0, acts: true }
    }

    fn disc() -> Projection {
        let branch = BranchLayout::new(ProjectionKind::Ball, 2, BranchSizes::default());
        Projection { kind: ProjectionKind::Ball, n: 2, branch, output: 0, acts: true }
    }

    fn by_ratio(ratio: f64) -> Choice {
        Choice { ratio: Some(ratio), ..Choice::as_written(1.0) }
    }

    /// The branch that a choice makes of the one before.
    fn point(choice: &Choice, p: &Projection, outputs: &[f64], before: Option<Vec<f64>>) -> Vec<f64> {
        let mut data = before.unwrap_or_else(|| vec![0.0; p.branch.end().point]);
        choice.apply(p, outputs, &mut Vec::new(), &mut data);
        data
    }

    fn is_closed(choice: &Choice, x: f64, t: f64) -> bool {
        half_line(1).branch.sticks(&point(choice, &half_line(1), &[x, t], None), 0)
    }

    #[test]
    fn a_point_is_closed_where_its_argument_presses_and_the_tie_is_contact() {
        let written = Choice::as_written(1.0);
        assert!(is_closed(&written, 1e-300, 0.0) && is_closed(&written, 0.0, 0.0));
        assert!(!is_closed(&written, -1e-300, 9.0), "whatever the value was");
    }

    #[test]
    fn a_pressed_point_opens_once_its_gap_outweighs_its_traction_in_the_stiffness_of_the_bodies() {
        // y = 1 + c (-0.5 - 1)
        assert!(is_closed(&by_ratio(0.1), -0.5, 1.0) && !is_closed(&by_ratio(1.0), -0.5, 1.0));
        assert!(is_closed(&by_ratio(0.5), -1.0, 1.0), "the tie is contact");
    }

    #[test]
    fn an_open_point_closes_for_every_ratio_as_soon_as_the_sides_overlap() {
        for ratio in [1e-12, 1.0, 1e12] {
            assert!(is_closed(&by_ratio(ratio), 1e-6, 0.0) && !is_closed(&by_ratio(ratio), -1e-6, 0.0), "{ratio}");
        }
    }

    #[test]
    fn entries_of_a_half_line_open_one_by_one() {
        let p = half_line(3);
        let data = point(&Choice::as_written(1.0), &p, &[1.0, -1.0, 0.0, 0.0, 0.0, 0.0], None);
        assert_eq!([0, 1, 2].map(|k| p.branch.branch(&data, k)), [Branch::Stick, Branch::Open, Branch::Stick]);
    }

    #[test]
    fn a_layer_takes_its_part_of_the_argument_before_the_choice() {
        let mut choice = by_ratio(1.0);
        choice.regularisation = BranchRegularisation { compliance: 0.75, overstress: 0.125 };
        let data = point(&choice, &disc(), &[4.0, 0.0, 1.0, 0.0, 0.0], None);
        assert!(disc().branch.sticks(&data, 0), "a quarter of 4 is on the ball");
    }

    #[test]
    fn a_point_that_slips_keeps_its_direction() {
        // argument and value have one direction: for every ratio the next slip has it, too
        for ratio in [1e-3, 1.0, 1e3] {
            let data = point(&by_ratio(ratio), &disc(), &[3.0, -4.0, 1.0, 0.6, -0.8], None);
            let Branch::Slip { along, across } = disc().branch.branch(&data, 0) else { panic!("it slips: {ratio}") };
            assert!((along[0] - 0.6).abs() < 1e-15 && (along[1] + 0.8).abs() < 1e-15, "{ratio}");
            assert!(across > 0.0 && across < 1.0, "{ratio}: {across}");
        }
    }

    #[test]
    fn a_point_that_turns_back_is_tried_as_sticking_before_it_slips_the_other_way() {
        // it slips to the right, with a traction of 1, and its argument points to the left
        let turned = [-5.0, 0.0, 1.0, 1.0, 0.0];
        assert!(disc().branch.sticks(&point(&by_ratio(0.3), &disc(), &turned, None), 0));
        let data = point(&Choice::as_written(1.0), &disc(), &turned, None);
        assert_eq!(disc().branch.branch(&data, 0), Branch::Slip { along: &[-1.0, 0.0], across: 0.2 });
    }

    #[test]
    fn more_friction_holds_what_slips() {
        let slides = [3.0, 0.0, 1.0, 3.0, 0.0];
        let sticks =
            |friction: f64| disc().branch.sticks(&point(&Choice::as_written(friction), &disc(), &slides, None), 0);
        assert!(!sticks(1.0) && sticks(3.0) && sticks(8.0), "the tie sticks");
        assert!(!sticks(0.0), "without friction nothing sticks");
    }

    /// A square on two points of the floor, each with `x, t` of the pressure and `x, r, t` of the friction.
    fn pressed(points: [[f64; 7]; 2]) -> (Contact, ProjectionState) {
        (Block::with_friction(1).contact, ProjectionState::of(&[&points[0], &points[1]]))
    }

    fn branches<'a>(contact: &Contact, data: &'a TermBranches, point: usize) -> [Branch<'a>; 2] {
        let term = &contact.terms()[0];
        let own = &data.points[point * term.sizes.point..][..term.sizes.point];
        [0, 1].map(|k| term.projections[k].branch.branch(own, 0))
    }

    #[test]
    fn each_point_chooses_for_itself() {
        let stuck = [2.0, 2.0, 0.5, 0.0, 1.0, 0.5, 0.0];
        let open = [-2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let (contact, state) = pressed([stuck, open]);
        let term = &contact.terms()[0];
        let next = term.next_branches(&contact.complementarity, &state, &term.open());
        assert_eq!(branches(&contact, &next, 0), [Branch::Stick, Branch::Stick]);
        assert_eq!(branches(&contact, &next, 1)[0], Branch::Open);
    }

    #[test]
    fn a_point_counts_once_however_many_of_its_branches_differ() {
        let contact = Block::with_friction(1).contact;
        let term = &contact.terms()[0];
        let (open, mut stuck) = (term.open(), term.open());
        term.stick_all(&mut stuck);
        assert_eq!(term.n_differing(&open, &stuck), 2);
        stuck.points[..term.sizes.point].fill(0.0);
        assert_eq!(term.n_differing(&open, &stuck), 1);
        assert_eq!(term.n_differing(&open, &open), 0);
    }

    #[test]
    fn points_that_are_let_slide_go_along_their_argument_if_it_has_a_direction() {
        let (contact, state) = pressed([[2.0, 2.0, 0.0, -3.0, 1.0, 0.0, 0.0], [2.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0]]);
        let mut data = contact.terms()[0].open();
        contact.terms()[0].stick_all(&mut data);
        contact.terms()[0].slide_all(&state, &mut data);
        assert_eq!(branches(&contact, &data, 0)[1], Branch::Slip { along: &[0.0, -1.0], across: ACROSS });
        assert_eq!(branches(&contact, &data, 1)[1], Branch::Slip { along: &[0.0, 0.0], across: ACROSS });
        assert_eq!(branches(&contact, &data, 1)[0], Branch::Stick, "closed as it was");
    }

    #[test]
    fn regularisation_is_written_without_a_change_of_branch() {
        let mut contact = Block::with_friction(1).contact;
        let scaling = &mut contact.terms[0].scaling;
        (scaling.ratios, scaling.slopes, scaling.stiffness) = (vec![0.5, 0.5], vec![8.0, 8.0], 4.0);
        let term = &contact.terms()[0];
        let mut data = term.open();
        term.stick_all(&mut data);
        let stuck = data.clone();
        term.write_regularisation(
            &Regularisation { layer: 2.0, overstress: 6.0, ..Regularisation::default() },
            &mut data,
        );
        assert_eq!(term.n_differing(&stuck, &data), 0);
        for p in &term.projections {
            let expected = BranchRegularisation { compliance: 0.5, overstress: 0.75 };
            assert_eq!(p.branch.regularisation(&data.regularisation), expected);
        }
    }

    #[test]
    fn a_start_without_a_past_has_the_branches_of_the_law_as_written() {
        let mut block = Block::with_friction(1);
        let at = |block: &mut Block, floor: [f64; 2]| -> ActiveSet {
            let u = block.moved(floor, [0.0; 2]);
            block.contact.freeze_as_written(&block.system, &u);
            block.contact.active_set().clone()
        };
        let chosen = at(&mut block, [0.2, 0.1]);
        assert_eq!(branches(&block.contact, &chosen.terms[0], 0)[0], Branch::Open, "lifted from the floor");
        // the bound is half of the pressure, and the radius that of the point that is closed
        let chosen = at(&mut block, [0.04, -0.1]);
        assert_eq!(branches(&block.contact, &chosen.terms[0], 1), [Branch::Stick, Branch::Stick]);
        let chosen = at(&mut block, [0.2, -0.1]);
        let [pressure, friction] = branches(&block.contact, &chosen.terms[0], 0);
        assert_eq!(pressure, Branch::Stick);
        assert!(
            matches!(friction, Branch::Slip { along: [x, y], across } if (x - 1.0).abs() < 1e-15 && y.abs() < 1e-15
            && (across - 0.25).abs() < 1e-14),
            "{friction:?}"
        );
    }

    #[test]
    fn an_open_start_closes_where_what_is_prescribed_can_bring_the_sides_together() {
        let closed = |moved: f64, or_all: bool| {
            let mut block = Block::with_friction(1);
            block.contact.terms[0].scaling.slopes = vec![10.0, 10.0];
            let u = block.moved([0.0, 0.1], [0.0; 2]);
            let values = block.system.values_with(&u, block.contact.active_set());
            let term = &block.contact.terms()[0];
            let mut data = term.open();
            term.close_if_open(&block.system, values.view(), &mut data, Near { moved, or_all });
            term.n_differing(&term.open(), &data)
        };
        assert_eq!((closed(0.05, false), closed(0.05, true)), (0, 2));
        assert_eq!((closed(0.2, false), closed(0.2, true)), (2, 2));
    }
}
