//! The rules of the schemes: rates over a step from the change of a field and the rates at its start.
//!
//! With x_n and x the values of a field at the start of a step and those that are solved for, and r_n, s_n its first and
//! second rate at the start, every rate is one [`Row`]: `change (x - x_n) + first r_n + second s_n`. A scheme is rows: two
//! that the equations are written with, and one for each number that is kept at the end of the step. That are the rates
//! there; BDF2 keeps the quotients of the changes of x and r over the step, too. Knows no fields and stores nothing.
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
    /// The rate of a value is that of the parabola through the last two and the new one, for second rates twice; in the
    /// first step, differences.
    Bdf2,
    /// Central differences on a lumped mass: rates are those that are kept, whatever is solved for.
    Explicit,
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

/// Numbers by dof that a step leaves to the next one: the first and the second rate at its end, the quotient of the change
/// of the value over the step, and that of the first rate.
pub const KEPT: usize = 4;

/// `change (x - x_n)` and a sum over what is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// Times the change over the step.
    pub change: f64,
    /// Times what is kept from the step before.
    pub kept: [f64; KEPT],
}

impl Row {
    /// A row that reads no quotients.
    fn of_rates(change: f64, [first, second]: [f64; 2]) -> Self {
        Self { change, kept: [first, second, 0.0, 0.0] }
    }

    /// The derivative of this row by the rule with the scalar `c`: c (r - r_n) + history of the quotients of r.
    fn derivative(self, c: f64, quotient: f64) -> Self {
        let mut kept = self.kept.map(|k| c * k);
        kept[0] -= c;
        kept[3] = quotient;
        Self { change: c * self.change, kept }
    }

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

    /// Which of the numbers are kept for a field with these rates.
    #[must_use]
    pub fn keeps(&self, form: RateForm) -> [bool; KEPT] {
        let (second, quotients) = (form == RateForm::Second, *self == Scheme::Bdf2);
        [true, second, quotients, quotients && second]
    }

    /// What a step of this length misses of a smooth solution: the factors of its second and of its third derivative.
    ///
    /// Of the second one for methods of first order, of the third one for those of second order. For the schemes with one
    /// step it is what is added in each step to x = t^2/2 or t^3/6 once the rates have settled; for second rates under
    /// Newmark's rule also the error of the frequency, (beta - 1/12)/2 (h w)^2, if that is larger.
    #[must_use]
    pub fn misses(&self, form: RateForm, lengths: Lengths) -> [f64; 2] {
        let h = lengths.now;
        let second = form == RateForm::Second;
        match *self {
            Scheme::BackwardEuler | Scheme::Explicit => [0.5 * h * h, 0.0],
            Scheme::Bdf2 => match lengths.before {
                None => [0.5 * h * h, 0.0],
                Some(g) => [0.0, (h * (h + g)).powi(2) / (6.0 * (2.0 * h + g))],
            },
            Scheme::Newmark { beta, gamma } => {
                let (of_first, of_second) = if second {
                    (0.5 * (gamma - 0.5), (beta - 1.0 / 6.0).abs().max(0.5 * (beta - 1.0 / 12.0).abs()))
                } else {
                    (gamma - 0.5, 1.0 / 12.0)
                };
                [of_first * h * h, of_second * h.powi(3)]
            }
            Scheme::Alpha(a) => {
                let of_second = if second {
                    let shift = a.alpha_f - a.alpha_m;
                    (1.0 + 3.0 * shift * shift) / 12.0
                } else {
                    let shift = a.rate - a.alpha_f;
                    1.0 / 12.0 + shift * (a.rate - 0.5 - shift)
                };
                [0.0, of_second.abs() * h.powi(3)]
            }
        }
    }

    /// The rates that the equations of a step of this length are written with; `form` is no [`RateForm::Difference`].
    #[must_use]
    pub fn in_equations(&self, form: RateForm, lengths: Lengths) -> Rows {
        let [first, second, ..] = self.at_end(form, lengths);
        let Scheme::Alpha(a) = self else { return Rows([first, second]) };
        let first = match form {
            RateForm::Second => first.mixed(a.alpha_f, 0),
            _ => first.mixed(a.rate, 0),
        };
        Rows([first.of_part(a.alpha_f), second.mixed(a.alpha_m, 1).of_part(a.alpha_f)])
    }

    /// What is kept at the end of a step of this length, from the values there.
    #[must_use]
    pub fn at_end(&self, form: RateForm, lengths: Lengths) -> [Row; KEPT] {
        let h = lengths.now;
        let none = Row::default();
        let (beta, gamma) = match self {
            Scheme::BackwardEuler => {
                let first = Row::of_rates(1.0 / h, [0.0; 2]);
                return [first, Row::of_rates(1.0 / (h * h), [-1.0 / h, 0.0]), none, none];
            }
            Scheme::Bdf2 => return bdf2(lengths),
            Scheme::Newmark { beta, gamma } => (*beta, *gamma),
            Scheme::Explicit => return [Row::of_rates(0.0, [1.0, 0.0]), Row::of_rates(0.0, [0.0, 1.0]), none, none],
            Scheme::Alpha(a) => match form {
                RateForm::Second => a.newmark(),
                // of second order where gamma = 1/2 + alpha_m - alpha_f in the notation of Jansen, Whiting and Hulbert
                _ => (0.0, 0.5 + a.alpha_f - a.rate),
            },
        };
        if form != RateForm::Second {
            return [Row::of_rates(1.0 / (gamma * h), [(gamma - 1.0) / gamma, 0.0]), none, none, none];
        }
        let ratio = gamma / beta;
        let first = Row::of_rates(ratio / h, [1.0 - ratio, h * (1.0 - 0.5 * ratio)]);
        let second = Row::of_rates(1.0 / (beta * h * h), [-1.0 / (beta * h), 1.0 - 0.5 / beta]);
        [first, second, none, none]
    }
}

/// The rates at the end of a step of BDF2, and the quotients over it; the first step is one of backward Euler.
fn bdf2(lengths: Lengths) -> [Row; KEPT] {
    let h = lengths.now;
    let (c, quotient) = match lengths.before {
        None => (1.0 / h, 0.0),
        Some(g) => ((2.0 * h + g) / (h * (h + g)), -h / (h + g)),
    };
    let first = Row { change: c, kept: [0.0, 0.0, quotient, 0.0] };
    let of_value = Row { change: 1.0 / h, kept: [0.0; KEPT] };
    [first, first.derivative(c, quotient), of_value, first.derivative(1.0 / h, 0.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dot(row: &Row, change: f64, kept: [f64; KEPT]) -> f64 {
        row.change * change + row.kept.iter().zip(kept).map(|(a, b)| a * b).sum::<f64>()
    }

    /// A step of x' = -x or x'' = -x.
    fn step(scheme: Scheme, form: RateForm, lengths: Lengths, x: f64, kept: [f64; KEPT]) -> (f64, [f64; KEPT]) {
        let rows = scheme.in_equations(form, lengths).0;
        let row = if form == RateForm::Second { rows[1] } else { rows[0] };
        // row.change d + past + x + d = 0 for the change d up to where the equations stand
        let change = -(x + dot(&row, 0.0, kept)) / (row.change + 1.0) / (1.0 - scheme.offset());
        (x + change, scheme.at_end(form, lengths).map(|row| dot(&row, change, kept)))
    }

    /// The error at t = 1 of x' = -x, x(0) = 1 (or x'' = -x with x'(0) = 0), of n steps.
    fn error(scheme: Scheme, form: RateForm, n: u32) -> f64 {
        let h = 1.0 / f64::from(n);
        let second = form == RateForm::Second;
        let (mut x, mut kept) = (1.0, if second { [0.0, -1.0, 0.0, 0.0] } else { [-1.0, 0.0, 0.0, 0.0] });
        for k in 0..n {
            (x, kept) = step(scheme, form, Lengths { now: h, before: (k > 0).then_some(h) }, x, kept);
        }
        x - if second { 1.0f64.cos() } else { (-1.0f64).exp() }
    }

    #[test]
    fn every_scheme_has_its_order_for_first_and_second_rates() {
        let trapezoidal = Scheme::Newmark { beta: 0.25, gamma: 0.5 };
        let mut all = vec![(Scheme::BackwardEuler, 1.0), (trapezoidal, 2.0)];
        all.extend([(Scheme::Newmark { beta: 1.0 / 6.0, gamma: 0.5 }, 2.0), (Scheme::Bdf2, 2.0)]);
        all.push((Scheme::Newmark { beta: 0.3025, gamma: 0.6 }, 1.0));
        all.extend([0.0, -0.1, -1.0 / 3.0].map(|a| (Scheme::Alpha(Alpha::hht(a)), 2.0)));
        all.extend([0.0, 0.5, 0.8, 1.0].map(|rho| (Scheme::Alpha(Alpha::generalised(rho)), 2.0)));
        for (scheme, order) in all {
            for form in [RateForm::First, RateForm::Second] {
                let found = (error(scheme, form, 200) / error(scheme, form, 400)).log2();
                assert!((found - order).abs() < 0.05, "{scheme:?} {form:?}: {found}");
            }
        }
    }

    /// A step of x' = -y, y' = x: a point on a circle.
    fn turn(scheme: Scheme, lengths: Lengths, at: [f64; 2], kept: [[f64; KEPT]; 2]) -> ([f64; 2], [[f64; KEPT]; 2]) {
        let row = scheme.in_equations(RateForm::First, lengths).0[0];
        let (c, known) = (row.change, [dot(&row, 0.0, kept[0]) + at[1], dot(&row, 0.0, kept[1]) - at[0]]);
        // c dx + dy = -known[0], c dy - dx = -known[1]
        let determinant = (c * c + 1.0) * (1.0 - scheme.offset());
        let change = [(known[1] - c * known[0]) / determinant, -(known[0] + c * known[1]) / determinant];
        let end = scheme.at_end(RateForm::First, lengths);
        ([0, 1].map(|k| at[k] + change[k]), [0, 1].map(|k| end.map(|row| dot(&row, change[k], kept[k]))))
    }

    /// What the steps miss adds up to the error over many periods, with first rates and with second ones. BDF2 is told what
    /// one step misses of exact values; it hands its errors on with the factor 1/(1 - 1/3).
    #[test]
    fn what_a_step_misses_adds_up_to_the_error() {
        let trapezoidal = |beta| Scheme::Newmark { beta, gamma: 0.5 };
        let mut all = vec![(Scheme::BackwardEuler, 1.0), (Scheme::Bdf2, 1.5), (trapezoidal(0.25), 1.0)];
        all.push((Scheme::Newmark { beta: 0.3025, gamma: 0.6 }, 1.0));
        all.extend([-0.1, -0.3].map(|a| (Scheme::Alpha(Alpha::hht(a)), 1.0)));
        all.extend([0.0, 0.5, 1.0].map(|rho| (Scheme::Alpha(Alpha::generalised(rho)), 1.0)));
        let (h, n) = (1.0 / 400.0, 20_000);
        for (scheme, handed_on) in all {
            let (mut x, mut kept) = (1.0, [0.0, -1.0, 0.0, 0.0]);
            let (mut at, mut both) = ([1.0, 0.0], [[0.0; KEPT], [1.0, 0.0, 0.0, 0.0]]);
            let mut largest = [0.0f64; 2];
            for k in 0..n {
                let lengths = Lengths { now: h, before: (k > 0).then_some(h) };
                (x, kept) = step(scheme, RateForm::Second, lengths, x, kept);
                (at, both) = turn(scheme, lengths, at, both);
                // the last period of t = 50
                if k > 17_500 {
                    let exact = (f64::from(k + 1) * h).cos();
                    largest = [largest[0].max((at[0] - exact).abs()), largest[1].max((x - exact).abs())];
                }
            }
            for (form, largest) in [RateForm::First, RateForm::Second].into_iter().zip(largest) {
                let [first, second] = scheme.misses(form, Lengths { now: h, before: Some(h) });
                let ratio = largest / (handed_on * (first + second) * f64::from(n));
                assert!((0.7..1.4).contains(&ratio), "{scheme:?} {form:?}: {ratio}");
            }
        }
    }

    /// A parabola has exact first rates; a cubic whose kept rates are exact, and so its second ones.
    #[test]
    fn bdf2_differentiates_parabolas_exactly_over_unequal_steps() {
        let (g, h) = (0.3, 0.7);
        let lengths = Lengths { now: h, before: Some(g) };
        let f = |t: f64| 2.0 - t + 3.0 * t * t;
        let [first, second, value, rate] = Scheme::Bdf2.at_end(RateForm::Second, lengths);
        let kept = [6.0 * g - 1.0, 6.0, (f(g) - f(0.0)) / g, 6.0];
        let change = f(g + h) - f(g);
        let found = [first, second, value, rate].map(|row| dot(&row, change, kept));
        for (found, exact) in found.iter().zip([6.0 * (g + h) - 1.0, 6.0, change / h, 6.0]) {
            assert!((found - exact).abs() < 1e-12, "{found} {exact}");
        }
        let Rows(rows) = Scheme::Bdf2.in_equations(RateForm::Second, lengths);
        assert_eq!(rows, [first, second]);
    }

    #[test]
    fn the_highest_frequencies_are_damped_by_the_spectral_radius_that_is_asked_for() {
        // x'' = -x with steps so long that only the rows matter: |x| falls by rho^2 in two steps of either sign
        for rho in [0.5f64, 0.8, 1.0] {
            let scheme = Scheme::Alpha(Alpha::generalised(rho));
            let h = 1e6;
            let lengths = Lengths { now: h, before: Some(h) };
            let (mut x, mut kept) = (1.0, [0.0, -1.0, 0.0, 0.0]);
            let mut sizes = Vec::new();
            for _ in 0..60 {
                (x, kept) = step(scheme, RateForm::Second, lengths, x, kept);
                sizes.push((x * x + h * h * kept[0] * kept[0] + (h * h * kept[1]).powi(2)).sqrt());
            }
            let rate = (sizes[59] / sizes[19]).powf(1.0 / 40.0);
            assert!((rate - rho).abs() < 0.06, "{rho}: {rate}");
        }
    }
}
