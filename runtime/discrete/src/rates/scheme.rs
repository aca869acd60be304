//! The rules of the schemes: rates over a step from the change of a field and the rates at its start.
//!
//! With x_n and x the values of a field at the start of a step and those that are solved for, and r_n, s_n its first and
//! second rate at the start, every rate is one [`Row`]: `change (x - x_n) + first r_n + second s_n`. A scheme is four
//! rows: two that the equations are written with, two for what is kept at the end of the step. That are the rates there,
//! but for BDF2, which keeps the quotient of the change over the step. Knows no fields and stores nothing.
//!
//! Sources: N. M. Newmark, A method of computation for structural dynamics, J. Eng. Mech. Div. ASCE 85 (1959) 67-94;
//! H. M. Hilber, T. J. R. Hughes, R. L. Taylor, Earthquake Eng. Struct. Dyn. 5 (1977) 283-292; J. Chung, G. M. Hulbert,
//! J. Appl. Mech. 60 (1993) 371-375; K. E. Jansen, C. H. Whiting, G. M. Hulbert, Comput. Methods Appl. Mech. Eng. 190
//! (2000) 305-319 for fields with a first rate only; E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential
//! Equations I, III.5 for BDF2 with variable steps.

use wfl_compiler::types::RateForm;

/// A scheme of time integration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scheme {
    /// Rates are differences over the step: of first order.
    BackwardEuler,
    /// x = x_n + h r_n + h^2 ((1/2 - beta) s_n + beta s), r = r_n + h ((1 - gamma) s_n + gamma s).
    Newmark {
        /// 1/4: the trapezoidal rule.
        beta: f64,
        /// 1/2: of second order, else of first.
        gamma: f64,
    },
    /// Newmark's rule, with the equations at a state between start and end of the step.
    Alpha(Alpha),
    /// First rates are those of the parabola through the last two values and the new one; in the first step, differences.
    Bdf2,
}

/// The length of a step, and of the one before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lengths {
    /// Of the step.
    pub now: f64,
    /// Of the one before; `None` for the first step.
    pub before: Option<f64>,
}

/// A generalised alpha method, in the notation of Chung and Hulbert.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alpha {
    /// Second rates in the equations: (1 - alpha_m) s + alpha_m s_n.
    pub alpha_m: f64,
    /// Values and first rates in the equations: (1 - alpha_f) x + alpha_f x_n.
    pub alpha_f: f64,
    /// First rates of fields without a second one: (1 - rate) r + rate r_n.
    pub rate: f64,
}

impl Alpha {
    /// The method of Hilber, Hughes and Taylor for alpha between -1/3 (most dissipation) and 0 (none).
    #[must_use]
    pub fn hht(alpha: f64) -> Self {
        Self { alpha_m: 0.0, alpha_f: -alpha, rate: -alpha }
    }

    /// The method of Chung and Hulbert that damps the highest frequencies by `rho` (0 to 1) in each step.
    #[must_use]
    pub fn generalised(rho: f64) -> Self {
        let alpha_m = (2.0 * rho - 1.0) / (rho + 1.0);
        Self { alpha_m, alpha_f: rho / (rho + 1.0), rate: 1.0 - 0.5 * (3.0 - rho) / (1.0 + rho) }
    }

    /// beta and gamma of Newmark's rule, such that the method is of second order.
    fn newmark(self) -> (f64, f64) {
        let shift = self.alpha_f - self.alpha_m;
        (0.25 * (1.0 + shift) * (1.0 + shift), 0.5 + shift)
    }
}

/// `change (x - x_n) + kept[0] r_n + kept[1] s_n`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// Times the change over the step.
    pub change: f64,
    /// Times what is kept from the steps before: the first and the second rate at the start of the step, under BDF2 the
    /// quotient of the last change.
    pub kept: [f64; 2],
}

impl Row {
    /// (1 - part) of this row and `part` of the rate at the start.
    fn mixed(self, part: f64, rate: usize) -> Self {
        let mut kept = self.kept.map(|k| (1.0 - part) * k);
        kept[rate] += part;
        Self { change: (1.0 - part) * self.change, kept }
    }

    /// The same of values between start and end: x - x_n there is (1 - alpha_f) of the change.
    fn of_part(self, alpha_f: f64) -> Self {
        Self { change: self.change / (1.0 - alpha_f), ..self }
    }
}

/// The rates of a field in a step: the first one, and the second one where it has one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rows(pub [Row; 2]);

impl Scheme {
    /// How far before the end of a step its equations stand, as a part of the step: alpha_f, 0 for all other schemes.
    #[must_use]
    pub fn offset(&self) -> f64 {
        match self {
            Scheme::Alpha(a) => a.alpha_f,
            _ => 0.0,
        }
    }

    /// The rates that the equations of a step of this length are written with; `form` is no [`RateForm::Difference`].
    #[must_use]
    pub fn in_equations(&self, form: RateForm, lengths: Lengths) -> Rows {
        let end = self.at_end(form, lengths.now);
        let a = match (self, lengths.before) {
            (Scheme::Alpha(a), _) => a,
            (Scheme::Bdf2, Some(g)) => {
                let h = lengths.now;
                let first = Row { change: (2.0 * h + g) / (h * (h + g)), kept: [-h / (h + g), 0.0] };
                return Rows([first, Row::default()]);
            }
            _ => return end,
        };
        let Rows([first, second]) = end;
        let first = match form {
            RateForm::Second => first.mixed(a.alpha_f, 0),
            _ => first.mixed(a.rate, 0),
        };
        Rows([first.of_part(a.alpha_f), second.mixed(a.alpha_m, 1).of_part(a.alpha_f)])
    }

    /// What is kept at the end of a step of this length, from the values there.
    #[must_use]
    pub fn at_end(&self, form: RateForm, increment: f64) -> Rows {
        let h = increment;
        let (beta, gamma) = match self {
            Scheme::BackwardEuler => {
                let first = Row { change: 1.0 / h, kept: [0.0; 2] };
                return Rows([first, Row { change: 1.0 / (h * h), kept: [-1.0 / h, 0.0] }]);
            }
            Scheme::Bdf2 => return Rows([Row { change: 1.0 / h, kept: [0.0; 2] }, Row::default()]),
            Scheme::Newmark { beta, gamma } => (*beta, *gamma),
            Scheme::Alpha(a) => match form {
                RateForm::Second => a.newmark(),
                // of second order where gamma = 1/2 + alpha_m - alpha_f in the notation of Jansen, Whiting and Hulbert
                _ => (0.0, 0.5 + a.alpha_f - a.rate),
            },
        };
        if form != RateForm::Second {
            let first = Row { change: 1.0 / (gamma * h), kept: [(gamma - 1.0) / gamma, 0.0] };
            return Rows([first, Row::default()]);
        }
        let ratio = gamma / beta;
        let first = Row { change: ratio / h, kept: [1.0 - ratio, h * (1.0 - 0.5 * ratio)] };
        let second = Row { change: 1.0 / (beta * h * h), kept: [-1.0 / (beta * h), 1.0 - 0.5 / beta] };
        Rows([first, second])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The error at t = 1 of x' = -x, x(0) = 1 (or x'' = -x with x'(0) = 0), of n steps.
    fn error(scheme: Scheme, form: RateForm, n: u32) -> f64 {
        let h = 1.0 / f64::from(n);
        let (end, part) = (scheme.at_end(form, h).0, 1.0 - scheme.offset());
        let second = form == RateForm::Second;
        let (mut x, mut kept) = (1.0, if second { [0.0, -1.0] } else { [-1.0, 0.0] });
        for k in 0..n {
            let rows = scheme.in_equations(form, Lengths { now: h, before: (k > 0).then_some(h) }).0;
            let row = if second { rows[1] } else { rows[0] };
            // row.change d + past + x + d = 0 for the change d up to where the equations stand
            let past = row.kept[0] * kept[0] + row.kept[1] * kept[1];
            let change = -(x + past) / (row.change + 1.0) / part;
            kept = end.map(|r| r.change * change + r.kept[0] * kept[0] + r.kept[1] * kept[1]);
            x += change;
        }
        x - if second { 1.0f64.cos() } else { (-1.0f64).exp() }
    }

    #[test]
    fn every_scheme_has_its_order_for_first_and_second_rates() {
        let trapezoidal = Scheme::Newmark { beta: 0.25, gamma: 0.5 };
        let mut all = vec![(Scheme::BackwardEuler, 1.0), (trapezoidal, 2.0)];
        all.push((Scheme::Newmark { beta: 1.0 / 6.0, gamma: 0.5 }, 2.0));
        all.push((Scheme::Newmark { beta: 0.3025, gamma: 0.6 }, 1.0));
        all.extend([0.0, -0.1, -1.0 / 3.0].map(|a| (Scheme::Alpha(Alpha::hht(a)), 2.0)));
        all.extend([0.0, 0.5, 0.8, 1.0].map(|rho| (Scheme::Alpha(Alpha::generalised(rho)), 2.0)));
        for (scheme, order) in all {
            for form in [RateForm::First, RateForm::Second] {
                let found = (error(scheme, form, 200) / error(scheme, form, 400)).log2();
                assert!((found - order).abs() < 0.05, "{scheme:?} {form:?}: {found}");
            }
        }
        let found = (error(Scheme::Bdf2, RateForm::First, 200) / error(Scheme::Bdf2, RateForm::First, 400)).log2();
        assert!((found - 2.0).abs() < 0.05, "{found}");
    }

    #[test]
    fn bdf2_differentiates_parabolas_exactly_over_unequal_steps() {
        let (g, h) = (0.3, 0.7);
        let f = |t: f64| 2.0 - t + 3.0 * t * t;
        let Rows([row, _]) = Scheme::Bdf2.in_equations(RateForm::First, Lengths { now: h, before: Some(g) });
        let Rows([end, _]) = Scheme::Bdf2.at_end(RateForm::First, g);
        let kept = end.change * (f(g) - f(0.0));
        let rate = row.change * (f(g + h) - f(g)) + row.kept[0] * kept;
        assert!((rate - (6.0 * (g + h) - 1.0)).abs() < 1e-13, "{rate}");
    }

    #[test]
    fn the_highest_frequencies_are_damped_by_the_spectral_radius_that_is_asked_for() {
        // x'' = -x with steps so long that only the rows matter: |x| falls by rho^2 in two steps of either sign
        for rho in [0.5f64, 0.8, 1.0] {
            let scheme = Scheme::Alpha(Alpha::generalised(rho));
            let h = 1e6;
            let lengths = Lengths { now: h, before: Some(h) };
            let (row, end) =
                (scheme.in_equations(RateForm::Second, lengths).0[1], scheme.at_end(RateForm::Second, h).0);
            let (mut x, mut kept) = (1.0, [0.0, -1.0]);
            let mut sizes = Vec::new();
            for _ in 0..60 {
                let past = row.kept[0] * kept[0] + row.kept[1] * kept[1];
                let change = -(x + past) / (row.change + 1.0) / (1.0 - scheme.offset());
                kept = end.map(|r| r.change * change + r.kept[0] * kept[0] + r.kept[1] * kept[1]);
                x += change;
                sizes.push((x * x + h * h * kept[0] * kept[0] + (h * h * kept[1]).powi(2)).sqrt());
            }
            let rate = (sizes[59] / sizes[19]).powf(1.0 / 40.0);
            assert!((rate - rho).abs() < 0.06, "{rho}: {rate}");
        }
    }
}
