//! What results follow of explicit steps: the step of `run/src/explicit.rs`, transposed.
//!
//! With D the lumped mass and damping, `a = -R/D` at free dofs: the weights of the laws are the derivative in a over -D. What D
//! follows of parameters is the same in all steps, so that it is asked for once, with the sums over the steps.

use wfl::Diagnostic;
use wfl_compiler::types::RateOrder;
use wfl_discrete::{rates::Kept, system::FIXED};
use wfl_problem::Explicit;
use wfl_run::PassedStep;

use super::{Backwards, Cotangent, Of, Read, Sums, add};

/// What a result follows of mass and damping on the diagonal, by dof.
#[derive(Clone)]
pub(super) struct OfLumped {
    mass: Vec<f64>,
    damping: Vec<f64>,
}

impl OfLumped {
    pub(super) fn new(n_dofs: usize) -> Self {
        Self { mass: vec![0.0; n_dofs], damping: vec![0.0; n_dofs] }
    }
}

/// First and second rates by dof from what is kept of the fields.
struct Rated {
    first: Vec<f64>,
    second: Vec<f64>,
}

impl Backwards<'_, '_> {
    fn by_dof(&self, kept: &Kept) -> Rated {
        let n = self.standing.solving.system.numbering.n_dofs;
        let mut made = Rated { first: vec![0.0; n], second: vec![0.0; n] };
        let fields = self.standing.rates().into_iter().flat_map(wfl_discrete::rates::Rates::fields);
        for (of, kept) in fields.zip(kept) {
            made.first[of.dofs.clone()].copy_from_slice(&kept[0]);
            made.second[of.dofs.clone()].copy_from_slice(&kept[1]);
        }
        made
    }

    fn add_kept(&self, by_dof: &Rated, kept: &mut Kept) {
        let fields = self.standing.rates().into_iter().flat_map(wfl_discrete::rates::Rates::fields);
        for (of, kept) in fields.zip(kept) {
            add(&mut kept[0], &by_dof.first[of.dofs.clone()]);
            add(&mut kept[1], &by_dof.second[of.dofs.clone()]);
        }
    }

    /// One explicit step: equations and laws stand in it, with the rates half a step before its end.
    pub(super) fn of_explicit(
        &mut self,
        of: (&PassedStep, &Explicit),
        end: &mut Cotangent,
        start: &mut Cotangent,
        sum: &mut Sums,
    ) -> Result<(), Box<Diagnostic>> {
        let (step, explicit) = of;
        let h = step.window.increment;
        let Rated { first: of_velocity, second: of_acceleration } = self.by_dof(&end.kept);
        let accelerated: Vec<f64> = of_acceleration.iter().zip(&of_velocity).map(|(s, r)| s + 0.5 * h * r).collect();
        let acceleration =
            self.by_dof(&step.rates.as_ref().map_or_else(Kept::new, |r| r.kept_at(&step.u, &step.u))).second;
        let fixed: Vec<bool> = self.standing.solving.system.numbering.free.iter().map(|f| *f == FIXED).collect();
        let mut read = self.nothing();
        self.of_states(step, end, &mut read, sum)?;
        let weight = |(d, a): (usize, &f64)| if fixed[d] { 0.0 } else { -a / explicit.lumped.divisor(d, h) };
        let weights: Vec<f64> = accelerated.iter().enumerate().map(weight).collect();
        if weights.iter().any(|w| *w != 0.0) {
            let by_field = self.by_test_field(&weights);
            self.evaluate(|of| matches!(of, Of::Term(_)), &step.u, &by_field)?;
            self.spread(1.0, Read::ByEquations, end, &mut read, &mut sum.live);
        }
        for (d, w) in weights.iter().enumerate() {
            sum.lumped.mass[d] += w * acceleration[d];
            sum.lumped.damping[d] += 0.5 * h * w * acceleration[d];
        }
        add(&mut start.u, &read.u);
        start.known.iter_mut().zip(&read.known).for_each(|(to, from)| add(to, from));
        // the second rate is zero while the equations are looked at
        let mut half = of_velocity;
        add(&mut half, &self.by_dof(&read.kept).first);
        let mut before = Rated { first: vec![0.0; half.len()], second: vec![0.0; half.len()] };
        for d in 0..half.len() {
            if fixed[d] {
                // a = (moved - r + h/2 s)/h, and what moved is the change of the prescribed value over h
                let of_old = -accelerated[d] / h;
                let of_moved = accelerated[d] / h + half[d];
                end.u[d] += of_moved / h;
                start.u[d] -= of_moved / h;
                before.first[d] += of_old;
                before.second[d] -= 0.5 * h * of_old;
            } else {
                start.u[d] += end.u[d];
                before.first[d] += half[d] + h * end.u[d];
                before.second[d] += 0.5 * h * (half[d] + h * end.u[d]);
            }
        }
        self.add_kept(&before, &mut start.kept);
        self.of_prescribed(step.window, &end.u, sum)
    }

    /// The accelerations where time starts are forces over the mass alone; what they are at prescribed dofs is left.
    pub(super) fn of_explicit_start(
        &mut self,
        explicit: &Explicit,
        start: &mut Cotangent,
        sum: &mut Sums,
    ) -> Result<(), Box<Diagnostic>> {
        let step = &*self.standing.steps.step(0)?;
        let followed = self.by_dof(&start.kept).second;
        let acceleration =
            self.by_dof(&step.rates.as_ref().map_or_else(Kept::new, |r| r.kept_at(&step.u, &step.u))).second;
        let free: Vec<bool> = self.standing.solving.system.numbering.free.iter().map(|f| *f != FIXED).collect();
        let weight = |(d, a): (usize, &f64)| if free[d] { -a / explicit.lumped.mass[d] } else { 0.0 };
        let weights: Vec<f64> = followed.iter().enumerate().map(weight).collect();
        weights.iter().enumerate().for_each(|(d, w)| sum.lumped.mass[d] += w * acceleration[d]);
        self.standing.hold_accelerations_zero()?;
        self.laws.set_step(self.standing.step_of(step.window));
        let by_field = self.by_test_field(&weights);
        self.evaluate(|of| matches!(of, Of::Term(_)), &step.u, &by_field)?;
        let (mut now, mut past) = (self.nothing(), self.nothing());
        self.spread(1.0, Read::ByEquations, &mut now, &mut past, &mut sum.live);
        for moved in [&now, &past] {
            add(&mut start.u, &moved.u);
            start.known.iter_mut().zip(&moved.known).for_each(|(to, from)| add(to, from));
        }
        let mut rates = self.by_dof(&past.kept);
        rates.second.fill(0.0);
        // at free dofs they were not what is kept
        (0..free.len()).filter(|d| free[*d]).for_each(|d| rates.second[d] = -followed[d]);
        self.add_kept(&rates, &mut start.kept);
        self.of_lumped(explicit, start, sum)
    }

    /// What mass and damping follow of the parameters: with the rate one in a component of a field, the sums of rows.
    fn of_lumped(&mut self, explicit: &Explicit, start: &mut Cotangent, sum: &mut Sums) -> Result<(), Box<Diagnostic>> {
        let step = &*self.standing.steps.step(0)?;
        for probe in self.standing.probes(explicit)? {
            let weights = if probe.order == RateOrder::First { &sum.lumped.damping } else { &sum.lumped.mass };
            let weights: Vec<f64> = weights.iter().zip(&probe.signs).map(|(w, sign)| w * sign).collect();
            if weights.iter().all(|w| *w == 0.0) {
                continue;
            }
            let by_field = self.by_test_field(&weights);
            for (factor, is_there) in [(1.0, true), (-1.0, false)] {
                if is_there {
                    self.standing.take_probe(&probe);
                } else {
                    self.standing.take_rest(&probe);
                }
                self.laws.set_step(self.standing.step_of(step.window));
                self.evaluate(|of| matches!(of, Of::Term(k) if probe.terms.contains(&k)), &step.u, &by_field)?;
                let (mut now, mut past) = (self.nothing(), self.nothing());
                self.spread(factor, Read::ByEquations, &mut now, &mut past, &mut sum.live);
                start.known.iter_mut().zip(&now.known).for_each(|(to, from)| add(to, from));
            }
        }
        Ok(())
    }
}
