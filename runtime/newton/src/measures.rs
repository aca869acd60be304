//! The residual of each body relative to its scale, and whether what is left is rounding.
//!
//! A body is what of a field hangs together (`discrete/src/system/bodies.rs`). Bodies whose forces meet share one measure,
//! that of the largest force. Single equations (a rate, a state variable, a
//! global unknown) are each measured by what cancels in them. Promises: knows no system; decides nothing but whether
//! rounding is all that is left.

use wfl_host::team::Team;

/// This part of the forces out of balance is much: the largest tolerance that can be asked for.
const MUCH: f64 = crate::LARGEST_TOLERANCE;
/// Forces below this are nothing, in units of any system: numbers below `f64::MIN_POSITIVE` have fewer digits, and none of their products with the part that a
/// tolerance leaves. A pulse that comes or goes as `exp(-t^2)` passes through them.
const NOTHING: f64 = f64::MIN_POSITIVE / f64::EPSILON;

/// Measures of a body, or of the first of those that share one.
#[derive(Clone, Copy, Default)]
struct BodyMeasure {
    /// The largest residual over its scale.
    relative: f64,
    /// What rounding leaves of it.
    floor: f64,
    /// The largest residual of forces.
    left: f64,
    /// That over what may be left of it.
    excess: f64,
    /// A force, or an equation of one with single equations, is neither within the tolerance nor rounding.
    open: bool,
    /// It has single equations.
    single: bool,
    /// Much of its forces is open, and more than terms of constant stiffness leave by rounding.
    steep: bool,
}

/// What may be left of what an equation, or the forces of a body, began with, in units of the tolerance: six digits of ten. What a step does to an
/// equation is small beside what cancels in it, and one correction in four would be made for digits that no result shows.
const OF_BEGINNING: f64 = 1e4;

/// What is known of a single equation.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Equation {
    /// What is left of it.
    pub(crate) residual: f64,
    /// What cancels in it: the sum of the magnitudes of its summands.
    pub(crate) scale: f64,
    /// What was left of it when the step began; `f64::INFINITY` where that is not known.
    pub(crate) began: f64,
    /// What rounding leaves.
    pub(crate) rounding: f64,
}

/// What is known of the forces of a body.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Forces {
    /// The largest of what is out of balance.
    pub(crate) residual: f64,
    /// The largest force.
    pub(crate) scale: f64,
    /// The largest of what was out of balance in the step so far; `f64::INFINITY` where that is not known.
    pub(crate) began: f64,
    /// What rounding leaves of all terms, and of those whose rounding is a reason to stop with much of the forces open.
    pub(crate) rounding: [f64; 2],
}

/// Measures of all bodies.
pub(crate) struct BodyMeasures {
    bodies: Vec<BodyMeasure>,
}

impl BodyMeasures {
    pub(crate) fn new(n_bodies: usize) -> Self {
        Self { bodies: vec![BodyMeasure::default(); n_bodies] }
    }

    /// Adds forces: the largest residual, the largest force, and what rounding leaves: of all terms, and of those whose
    /// rounding is a reason to stop with much of the forces open: none where loads act, those whose stiffness does not
    /// change where a law on faces may be steep. A law that is steep where it has hardly begun (friction at a slip rate of zero) has a
    /// stiffness against which every force is rounding: that is no reason to stop with much of the forces open.
    ///
    /// What may be left is the tolerance of the largest force, and [`OF_BEGINNING`] tolerances of what was out of balance in the step so
    /// far: what a body stores or flies with is part of its forces, and says nothing of what a step does to it.
    pub(crate) fn add_forces(&mut self, body: usize, forces: Forces, tolerance: f64) {
        let Forces { residual, scale, began, rounding } = forces;
        if residual > 0.0 {
            let scale = scale.max(NOTHING);
            let f = &mut self.bodies[body];
            let may_be_left = tolerance * (OF_BEGINNING * began).clamp(NOTHING, scale);
            f.left = f.left.max(residual);
            if residual > rounding[0] {
                f.excess = f.excess.max(residual / may_be_left);
                f.open |= residual > may_be_left;
            }
            f.relative = f.relative.max(residual / scale);
            f.floor = f.floor.max(rounding[0] / scale);
            f.steep |= residual > MUCH * scale && residual > rounding[1];
        }
    }

    /// Adds equations. Each is solved for once the tolerance is left of what cancels in it, and [`OF_BEGINNING`] tolerances of
    /// what was left of it when the step began: positions far from the origin and absolute pressures cancel whatever moves, and
    /// a load that is small beside them is to be balanced all the same.
    pub(crate) fn add_equations(&mut self, body: usize, equations: &[Equation], tolerance: f64) {
        let f = &mut self.bodies[body];
        f.single = true;
        for e in equations.iter().filter(|e| e.residual > 0.0) {
            let scale = e.scale.max(NOTHING);
            f.relative = f.relative.max(e.residual / scale);
            f.floor = f.floor.max(e.rounding / scale);
            let asked = (OF_BEGINNING * e.began).min(scale);
            f.open |= e.residual > tolerance * asked && !(e.rounding.is_finite() && e.residual <= e.rounding);
        }
    }

    /// From the rows of this rank to those of all.
    pub(crate) fn of_all(&mut self, team: &dyn Team) {
        let flag = |holds: bool| f64::from(u8::from(holds));
        let mut sizes: Vec<f64> = self
            .bodies
            .iter()
            .flat_map(|f| [f.relative, f.floor, f.left, f.excess, flag(f.open), flag(f.steep)])
            .collect();
        team.max(&mut sizes);
        for (f, [relative, floor, left, excess, open, steep]) in self.bodies.iter_mut().zip(sizes.as_chunks().0) {
            (f.relative, f.floor, f.left, f.excess) = (*relative, *floor, *left, *excess);
            (f.open, f.steep) = (*open > 0.5, *steep > 0.5);
        }
    }

    /// The largest relative residual.
    pub(crate) fn relative(&self) -> f64 {
        self.bodies.iter().fold(0.0, |m, f| m.max(f.relative))
    }

    /// By body the largest of the forces that are out of balance.
    pub(crate) fn left(&self) -> Vec<f64> {
        self.bodies.iter().map(|f| f.left).collect()
    }

    /// The largest of forces out of balance over what may be left of them; of those that are rounding nothing.
    pub(crate) fn excess(&self) -> f64 {
        self.bodies.iter().fold(0.0, |m, f| m.max(f.excess))
    }

    /// True if some single equation is open.
    pub(crate) fn has_open_equation(&self) -> bool {
        self.bodies.iter().any(|f| f.single && f.open)
    }

    /// The largest floor.
    pub(crate) fn floor(&self) -> f64 {
        self.bodies.iter().fold(0.0, |m, f| m.max(f.floor))
    }

    /// True if each kind of unknown is for itself within the tolerance or what rounding leaves: rounding of one says
    /// nothing of another. The equation of a multiplier has what rounding leaves of the displacements in it, which its own
    /// numbers do not tell. Not finite, a floor says that nothing is known, not that nothing is left to do.
    pub(crate) fn are_settled(&self, is_multiplier: impl Fn(usize) -> bool, tolerance: f64) -> bool {
        (0..self.bodies.len()).all(|k| self.is_settled(k, &is_multiplier, tolerance))
    }

    /// The same where forces and single equations may have left of what they began with whatever the tolerance allows of what cancels in them.
    pub(crate) fn are_settled_beside_summands(&self, is_multiplier: impl Fn(usize) -> bool, tolerance: f64) -> bool {
        (0..self.bodies.len())
            .all(|k| self.bodies[k].relative <= tolerance || self.is_settled(k, &is_multiplier, tolerance))
    }

    /// True if multipliers alone keep all open.
    pub(crate) fn is_open_by(&self, is_multiplier: impl Fn(usize) -> bool, tolerance: f64) -> bool {
        let mut open = (0..self.bodies.len()).filter(|k| !self.is_settled(*k, &is_multiplier, tolerance)).peekable();
        open.peek().is_some() && open.all(&is_multiplier)
    }

    fn is_settled(&self, k: usize, is_multiplier: &impl Fn(usize) -> bool, tolerance: f64) -> bool {
        let f = &self.bodies[k];
        let of_forces = || self.bodies.iter().filter(|f| !f.single).fold(0.0f64, |m, f| m.max(f.floor));
        let least = if is_multiplier(k) { of_forces() } else { f.floor };
        let rounded = if f.single { !f.open } else { !f.steep && least.is_finite() && f.relative <= least };
        !f.single && !f.open && f.relative <= tolerance || rounded
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An equation of which nobody knows what was left of it when the step began.
    fn of(residual: f64, scale: f64, rounding: f64) -> Equation {
        Equation { residual, scale, rounding, began: f64::INFINITY }
    }

    /// Forces of which nobody knows what was out of balance in the step so far.
    fn forces(residual: f64, scale: f64, rounding: [f64; 2]) -> Forces {
        Forces { residual, scale, rounding, began: f64::INFINITY }
    }

    #[test]
    fn forces_are_open_while_much_is_left_of_what_a_step_began_with() {
        // what is stored is 1e9 times what flows in a step
        let settled = |residual: f64, rounding: f64| {
            let mut all = BodyMeasures::new(1);
            let forces = Forces { residual, scale: 1e9, began: 1.0, rounding: [rounding, f64::INFINITY] };
            all.add_forces(0, forces, 1e-10);
            assert!(all.relative() <= 1e-10 && all.are_settled_beside_summands(|_| false, 1e-10));
            assert!(!all.has_open_equation() && all.left() == [residual]);
            all.are_settled(|_| false, 1e-10)
        };
        assert!(!settled(1e-2, 1e-7) && !settled(1.1e-6, 1e-7));
        assert!(settled(0.9e-6, 1e-7) && settled(1e-6, 2e-6), "six digits of what flows, or rounding");
        let mut all = BodyMeasures::new(1);
        all.add_forces(0, Forces { residual: 1e-9, scale: 10.0, began: 1e-2, rounding: [0.0; 2] }, 1e-10);
        assert!(
            all.are_settled(|_| false, 1e-10) && all.excess() == 1.0,
            "a step that does more has the largest force alone"
        );
    }

    #[test]
    fn an_equation_is_open_while_a_load_is_left_that_is_small_beside_what_cancels() {
        // a spring of 1e4 between masses at 1000 and 1001 that are pulled by 1e-3
        let settled = |residual: f64, rounding: f64| {
            let mut all = BodyMeasures::new(1);
            all.add_equations(0, &[Equation { residual, scale: 1e7, began: 1e-3, rounding }], 1e-10);
            assert_eq!(all.has_open_equation(), !all.are_settled(|_| false, 1e-10));
            assert!(all.are_settled_beside_summands(|_| false, 1e-10));
            all.are_settled(|_| false, 1e-10)
        };
        assert!(!settled(1e-3, 1e-8) && !settled(2e-8, 1e-8));
        assert!(settled(1e-9, 1e-8), "that is rounding");
        assert!(settled(0.9e-9, 1e-20) && !settled(1.1e-9, 1e-20), "six digits of the load");
    }

    #[test]
    fn each_equation_is_open_until_it_is_small_beside_what_cancels_in_it() {
        let mut all = BodyMeasures::new(2);
        all.add_forces(0, forces(1e-12, 1.0, [1e-15, f64::INFINITY]), 1e-10);
        all.add_equations(1, &[of(1e-20, 1e-9, 1e-24), of(1e-12, 30.0, 1e-14)], 1e-10);
        assert!(all.are_settled(|_| false, 1e-10) && all.relative() == 1e-20 / 1e-9);
        all.add_equations(1, &[of(1e-18, 1e-9, 1e-24)], 1e-10);
        assert!(!all.are_settled(|_| false, 1e-10), "one part in 1e9 of what cancels is left");
        let mut all = BodyMeasures::new(1);
        all.add_equations(0, &[of(1e-18, 1e-9, 1e-17), of(0.0, 0.0, 0.0)], 1e-10);
        assert!(all.are_settled(|_| false, 1e-10), "that is rounding");
    }

    #[test]
    fn forces_without_digits_are_nothing() {
        let mut all = BodyMeasures::new(2);
        all.add_forces(0, forces(1e-320, 1e-320, [0.0, f64::INFINITY]), 1e-10);
        all.add_equations(1, &[of(1e-323, 1e-323, 0.0)], 1e-10);
        assert!(all.are_settled(|_| false, 1e-10));
        all.add_forces(0, forces(1e-280, 1e-280, [0.0, f64::INFINITY]), 1e-10);
        assert!(!all.are_settled(|_| false, 1e-10));
    }

    #[test]
    fn a_multiplier_has_the_rounding_of_the_forces() {
        let mut all = BodyMeasures::new(2);
        all.add_forces(0, forces(1e-13, 1.0, [1e-8, f64::INFINITY]), 1e-10);
        all.add_forces(1, forces(1e-9, 1.0, [1e-12, f64::INFINITY]), 1e-10);
        assert!(all.are_settled(|k| k == 1, 1e-10) && !all.are_settled(|_| false, 1e-10));
    }

    #[test]
    fn multipliers_alone_are_open_where_the_forces_are_in_balance() {
        let mut all = BodyMeasures::new(2);
        all.add_forces(0, forces(1e-13, 1.0, [1e-15, f64::INFINITY]), 1e-10);
        all.add_forces(1, forces(1e-30, 1e-30, [1e-46, f64::INFINITY]), 1e-10);
        assert!(all.is_open_by(|k| k == 1, 1e-10) && !all.is_open_by(|k| k == 0, 1e-10));
        all.add_forces(0, forces(1e-3, 1.0, [1e-15, f64::INFINITY]), 1e-10);
        assert!(!all.is_open_by(|k| k == 1, 1e-10));
    }

    #[test]
    fn a_stiffness_that_swallows_all_forces_is_no_reason_to_stop() {
        let settled = |kept: f64| {
            let mut all = BodyMeasures::new(1);
            all.add_forces(0, forces(30.0, 30.0, [1e11, kept]), 1e-10);
            all.are_settled(|_| false, 1e-10)
        };
        assert!(!settled(1e-12) && settled(31.0) && settled(f64::INFINITY));
    }

    #[test]
    fn one_body_that_is_open_keeps_all_open() {
        let mut all = BodyMeasures::new(2);
        all.add_forces(0, forces(1e-14, 1.0, [0.0, f64::INFINITY]), 1e-10);
        all.add_forces(1, forces(1e-9, 1.0, [1e-15, f64::INFINITY]), 1e-10);
        assert!(!all.are_settled(|_| false, 1e-10));
        assert_eq!(all.relative(), 1e-9);
    }

    #[test]
    fn a_floor_that_is_not_finite_says_that_nothing_is_known() {
        let mut all = BodyMeasures::new(1);
        all.add_forces(0, forces(1e-3, 1.0, [f64::INFINITY, f64::INFINITY]), 1e-10);
        assert!(!all.are_settled(|_| false, 1e-10));
    }

    #[test]
    fn bodies_that_share_a_measure_have_the_larger_of_both() {
        let mut all = BodyMeasures::new(2);
        all.add_forces(0, forces(2e-3, 1.0, [1e-15, f64::INFINITY]), 1e-10);
        all.add_forces(0, forces(1e-3, 0.25, [2e-15, f64::INFINITY]), 1e-10);
        assert_eq!((all.relative(), all.floor()), (4e-3, 8e-15));
    }

    #[test]
    fn a_residual_of_zero_needs_no_scale() {
        let mut all = BodyMeasures::new(1);
        all.add_forces(0, forces(0.0, 0.0, [0.0, 0.0]), 1e-10);
        all.add_equations(0, &[of(0.0, 0.0, 0.0)], 1e-10);
        assert!(all.are_settled(|_| false, 1e-10) && all.relative() == 0.0);
    }
}
