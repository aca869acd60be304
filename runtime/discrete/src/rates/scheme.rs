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
//! Equations I, III.5 for backward differentiation with variable steps.

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
    /// Backward differentiation: the rate of a value is that of the polynomial through the new one and the last ones, at
    /// most this many of them; second rates are made of first ones in the same way, of two of each at most. The first steps
    /// have fewer: the very first one is a difference.
    Bdf {
        /// The largest order, 2 to [`MOST_ORDER`].
        most: usize,
    },
    /// Central differences on a lumped mass: rates are those that are kept, whatever is solved for.
    Explicit,
}

/// The largest order of a scheme.
pub const MOST_ORDER: usize = 3;

/// The length of a step, and of those before it that its rates read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lengths {
    /// Of the step.
    pub now: f64,
    /// Of those before, the newest first: `order - 1` of them count.
    before: [f64; MOST_ORDER - 1],
    /// The order of backward differentiation in this step.
    order: usize,
}

impl Lengths {
    /// A step behind others, of which the newest stands first: of the order that so many allow.
    #[must_use]
    pub fn new(now: f64, before: &[f64]) -> Self {
        let known = before.len().min(MOST_ORDER - 1);
        let mut lengths = [0.0; MOST_ORDER - 1];
        lengths[..known].copy_from_slice(&before[..known]);
        Self { now, before: lengths, order: known + 1 }
    }

    /// The same step with at most this order.
    #[must_use]
    pub fn at_most(self, order: usize) -> Self {
        Self { order: self.order.min(order), ..self }
    }

    /// The order of backward differentiation in this step.
    #[must_use]
    pub fn order(&self) -> usize {
        self.order
    }

    /// How long before the end of the step the values lie that it reads, the one at its end first.
    fn ages(&self) -> [f64; MOST_ORDER + 1] {
        let mut ages = [0.0; MOST_ORDER + 1];
        ages[1] = self.now;
        for k in 1..self.order {
            ages[k + 1] = ages[k] + self.before[k - 1];
        }
        ages
    }

    /// The rate at the end of the step by the polynomial through `order + 1` values, as what the quotients of their changes
    /// over the steps are multiplied by, that of this step first.
    fn weights(&self) -> [f64; MOST_ORDER] {
        let (ages, order) = (self.ages(), self.order);
        let mut weights = [0.0; MOST_ORDER];
        for (k, weight) in weights.iter_mut().enumerate().take(order) {
            // divided differences, of a quotient that is one where all others are zero
            let mut divided = [0.0; MOST_ORDER];
            divided[k] = 1.0;
            let mut product = 1.0;
            *weight = divided[0];
            for level in 2..=order {
                for i in 0..=order - level {
                    divided[i] = (divided[i] - divided[i + 1]) / (ages[i + level] - ages[i]);
                }
                product *= ages[level - 1];
                *weight += product * divided[0];
            }
        }
        weights
    }

    /// What backward differentiation misses, times the derivative behind its order.
    fn missed(&self) -> f64 {
        let ages = self.ages();
        let product: f64 = (2u32..).zip(&ages[1..=self.order]).map(|(k, age)| age / f64::from(k)).product();
        product * self.now / self.weights()[0]
    }
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
/// of the value over the step, that of the first rate, and the quotient of the value over the step before.
pub const KEPT: usize = 5;

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
        let mut kept = [0.0; KEPT];
        (kept[0], kept[1]) = (first, second);
        Self { change, kept }
    }

    /// The derivative of this row by the rule with the scalar `c`: c (r - r_n) + history of the quotients of r.
    fn derivative(self, c: f64, quotient: f64) -> Self {
        let mut kept = self.kept.map(|k| c * k);
        kept[0] -= c;
        kept[3] = quotient;
        Self { change: c * self.change, kept }
    }

    /// The difference of two rows.
    pub(super) fn minus(self, other: Self) -> Self {
        let kept = std::array::from_fn(|k| self.kept[k] - other.kept[k]);
        Self { change: self.change - other.change, kept }
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
    /// Newmark's rule with 1/4 and 1/2, which keeps the energy of linear bodies.
    pub const TRAPEZOIDAL: Scheme = Scheme::Newmark { beta: 0.25, gamma: 0.5 };

    /// How far before the end of a step its equations stand, as a part of the step: alpha_f, 0 for all other schemes.
    #[must_use]
    pub fn offset(&self) -> f64 {
        match self {
            Scheme::Alpha(a) => a.alpha_f,
            _ => 0.0,
        }
    }

    /// The largest order with which backward differentiation integrates a field with these rates: more than two leave the
    /// vibrations of second rates undamped or make them grow. 1 for all other schemes, which have one order.
    #[must_use]
    pub fn most_order(&self, form: RateForm) -> usize {
        match (self, form) {
            (Scheme::Bdf { most }, RateForm::First) => *most,
            (Scheme::Bdf { .. }, _) => 2,
            _ => 1,
        }
    }

    /// True if what rounding takes from the values of such a field is carried from step to step: its rates are of changes
    /// times 1/h and 1/h^2, and of the rounding of values nearly all would be left. Explicit steps make values of changes.
    #[must_use]
    pub fn carries_rounding(&self, form: RateForm) -> bool {
        form == RateForm::Second && self.offset() == 0.0 && *self != Scheme::Explicit
    }

    /// Which of the numbers are kept for a field with these rates.
    #[must_use]
    pub fn keeps(&self, form: RateForm) -> [bool; KEPT] {
        let (second, most) = (form == RateForm::Second, self.most_order(form));
        let mut keeps = [false; KEPT];
        (keeps[0], keeps[1]) = (true, second);
        if let Scheme::Bdf { .. } = self {
            (keeps[2], keeps[3], keeps[4]) = (true, second, most > 2);
        }
        keeps
    }

    /// What a step of this length misses of a smooth solution: the factors of its second derivative and of those behind it.
    ///
    /// Of the second one for methods of first order, of the third one for those of second order, and so on. For the schemes with one
    /// step it is what is added in each step to x = t^2/2 or t^3/6 once the rates have settled; for second rates under
    /// Newmark's rule also the error of the frequency, (beta - 1/12)/2 (h w)^2, if that is larger.
    #[must_use]
    pub fn misses(&self, form: RateForm, lengths: Lengths) -> [f64; MOST_ORDER] {
        let h = lengths.now;
        let second = form == RateForm::Second;
        let mut misses = [0.0; MOST_ORDER];
        let [of_first, of_second] = match *self {
            Scheme::BackwardEuler | Scheme::Explicit => [0.5 * h * h, 0.0],
            Scheme::Bdf { .. } => {
                let lengths = lengths.at_most(self.most_order(form));
                misses[lengths.order - 1] = lengths.missed();
                return misses;
            }
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
        };
        (misses[0], misses[1]) = (of_first, of_second);
        misses
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

    /// The same of given values, whose rates at the ends of steps are those there: the highest rates of unknowns are those of a
    /// part of a step earlier or later under the alpha methods, which mix them otherwise.
    pub(super) fn of_given_in_equations(&self, lengths: Lengths) -> Rows {
        let [first, second, ..] = Self::of_given(lengths);
        let offset = self.offset();
        Rows([first.mixed(offset, 0).of_part(offset), second.mixed(offset, 1).of_part(offset)])
    }

    /// True if an error of the rates of given values stays: they follow from the change and the rates at the start.
    #[must_use]
    pub fn keeps_errors_of_given(&self) -> bool {
        matches!(self, Scheme::Newmark { .. } | Scheme::Alpha(_))
    }

    /// True if steps begin with the rates of given values where time starts.
    #[must_use]
    pub(super) fn begins_with_given(&self) -> bool {
        self.keeps_errors_of_given() || matches!(self, Scheme::Bdf { .. })
    }

    /// What is kept of given values under such a scheme: by backward differentiation of second order.
    pub(super) fn of_given(lengths: Lengths) -> [Row; KEPT] {
        bdf(lengths.at_most(2))
    }

    /// What is kept at the end of a step of this length, from the values there.
    #[must_use]
    pub fn at_end(&self, form: RateForm, lengths: Lengths) -> [Row; KEPT] {
        let h = lengths.now;
        let rates = |first: Row, second: Row| {
            let mut rows = [Row::default(); KEPT];
            (rows[0], rows[1]) = (first, second);
            rows
        };
        let (beta, gamma) = match self {
            Scheme::BackwardEuler => {
                let first = Row::of_rates(1.0 / h, [0.0; 2]);
                return rates(first, Row::of_rates(1.0 / (h * h), [-1.0 / h, 0.0]));
            }
            Scheme::Bdf { .. } => return bdf(lengths.at_most(self.most_order(form))),
            Scheme::Newmark { beta, gamma } => (*beta, *gamma),
            Scheme::Explicit => return rates(Row::of_rates(0.0, [1.0, 0.0]), Row::of_rates(0.0, [0.0, 1.0])),
            Scheme::Alpha(a) => match form {
                RateForm::Second => a.newmark(),
                // of second order where gamma = 1/2 + alpha_m - alpha_f in the notation of Jansen, Whiting and Hulbert
                _ => (0.0, 0.5 + a.alpha_f - a.rate),
            },
        };
        if form != RateForm::Second {
            return rates(Row::of_rates(1.0 / (gamma * h), [(gamma - 1.0) / gamma, 0.0]), Row::default());
        }
        let ratio = gamma / beta;
        // 1/(beta h^2) and 1/(beta h) of the same number: a difference by rounding would damp, in each step with one sign
        let factor = if *self == Scheme::TRAPEZOIDAL { with_square(ratio / h) } else { ratio / h };
        let first = Row::of_rates(factor, [1.0 - ratio, h * (1.0 - 0.5 * ratio)]);
        let second = Row::of_rates(factor * factor * (beta / (gamma * gamma)), [-factor / gamma, 1.0 - 0.5 / beta]);
        rates(first, second)
    }
}

/// Of the numbers beside x one whose square is nearly a double: rounding takes up to 1.1e-16 of the square of any number, of
/// the best of 17 in a row a hundredth of that. Rates change by less than 2e-15 of them.
fn with_square(x: f64) -> f64 {
    let rounded = |y: f64| (y.mul_add(y, -(y * y)) / (y * y)).abs();
    let beside = (-8i32..=8).map(|k| x * (1.0 + f64::from(k) * f64::EPSILON));
    beside.fold(x, |best, y| if rounded(y) < rounded(best) { y } else { best })
}

/// The rates at the end of a step of backward differentiation, the quotients over it, and that over the step before.
fn bdf(lengths: Lengths) -> [Row; KEPT] {
    let [now, older @ ..] = lengths.weights();
    let mut first = Row { change: now / lengths.now, kept: [0.0; KEPT] };
    (first.kept[2], first.kept[4]) = (older[0], older[1]);
    let mut rows = [Row::default(); KEPT];
    rows[0] = first;
    // of a field with second rates nothing older is kept
    rows[1] = first.derivative(first.change, older[0]);
    rows[2].change = 1.0 / lengths.now;
    rows[3] = first.derivative(1.0 / lengths.now, 0.0);
    // the quotient that was the newest one
    rows[4].kept[2] = 1.0;
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    const BDF2: Scheme = Scheme::Bdf { most: 2 };
    const BDF3: Scheme = Scheme::Bdf { most: 3 };

    /// What is kept where time starts: the rates, as quotients over a step of no length, too.
    fn started([first, second]: [f64; 2]) -> [f64; KEPT] {
        [first, second, first, second, 0.0]
    }

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

    /// A step of length h behind others, the newest first; BDF3 begins with the rates where time starts.
    fn behind(scheme: Scheme, h: f64, before: &[f64]) -> Lengths {
        let start: &[f64] = if scheme == BDF3 { &[0.0] } else { &[] };
        Lengths::new(h, &[before, start].concat())
    }

    /// The error at t = 1 of x' = -x, x(0) = 1 (or x'' = -x with x'(0) = 0), of n steps, each second one shorter by a part
    /// and the others longer.
    fn error(scheme: Scheme, form: RateForm, n: u32, part: f64) -> f64 {
        let (mut before, mut sign) = (Vec::new(), 1.0);
        let second = form == RateForm::Second;
        let (mut x, mut kept) = (1.0, started(if second { [0.0, -1.0] } else { [-1.0, 0.0] }));
        for _ in 0..n {
            let h = (1.0 + sign * part) / f64::from(n);
            (x, kept) = step(scheme, form, behind(scheme, h, &before), x, kept);
            before.insert(0, h);
            sign = -sign;
        }
        x - if second { 1.0f64.cos() } else { (-1.0f64).exp() }
    }

    #[test]
    fn every_scheme_has_its_order_for_first_and_second_rates() {
        let trapezoidal = Scheme::Newmark { beta: 0.25, gamma: 0.5 };
        let mut all = vec![(Scheme::BackwardEuler, 1.0), (trapezoidal, 2.0)];
        all.extend([(Scheme::Newmark { beta: 1.0 / 6.0, gamma: 0.5 }, 2.0), (BDF2, 2.0), (BDF3, 3.0)]);
        all.push((Scheme::Newmark { beta: 0.3025, gamma: 0.6 }, 1.0));
        all.extend([0.0, -0.1, -1.0 / 3.0].map(|a| (Scheme::Alpha(Alpha::hht(a)), 2.0)));
        all.extend([0.0, 0.5, 0.8, 1.0].map(|rho| (Scheme::Alpha(Alpha::generalised(rho)), 2.0)));
        for (scheme, order) in all {
            for form in [RateForm::First, RateForm::Second] {
                let order = if form == RateForm::Second { f64::min(order, 2.0) } else { order };
                for part in [0.0, 0.2] {
                    let found = (error(scheme, form, 200, part) / error(scheme, form, 400, part)).log2();
                    // Newmark's rule with other numbers than 1/4 and 1/2 has an error of first order where steps change
                    let is_trapezoidal = scheme == trapezoidal || matches!(scheme, Scheme::Bdf { .. });
                    let holds = (found - order).abs() < 0.05;
                    assert!(holds || part > 0.0 && !is_trapezoidal, "{scheme:?} {form:?} {part}: {found}");
                }
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

    /// What the steps miss adds up to the error over many periods, with first rates and with second ones. BDF2 and BDF3 are
    /// told what one step misses of exact values; they hand their errors on with the factor 3/2 and 11/6.
    #[test]
    fn what_a_step_misses_adds_up_to_the_error() {
        let trapezoidal = |beta| Scheme::Newmark { beta, gamma: 0.5 };
        let mut all = vec![(Scheme::BackwardEuler, 1.0), (BDF2, 1.5), (BDF3, 11.0 / 6.0), (trapezoidal(0.25), 1.0)];
        all.push((Scheme::Newmark { beta: 0.3025, gamma: 0.6 }, 1.0));
        all.extend([-0.1, -0.3].map(|a| (Scheme::Alpha(Alpha::hht(a)), 1.0)));
        all.extend([0.0, 0.5, 1.0].map(|rho| (Scheme::Alpha(Alpha::generalised(rho)), 1.0)));
        let (h, n) = (1.0 / 400.0, 20_000);
        for (scheme, handed_on) in all {
            let (mut x, mut kept) = (1.0, started([0.0, -1.0]));
            let (mut at, mut both) = ([1.0, 0.0], [started([0.0, 0.0]), started([1.0, 0.0])]);
            let mut largest = [0.0f64; 2];
            for k in 0..n {
                let lengths = behind(scheme, h, &[h; 2][..usize::try_from(k).unwrap().min(2)]);
                (x, kept) = step(scheme, RateForm::Second, lengths, x, kept);
                (at, both) = turn(scheme, lengths, at, both);
                // the last period of t = 50
                if k > 17_500 {
                    let exact = (f64::from(k + 1) * h).cos();
                    largest = [largest[0].max((at[0] - exact).abs()), largest[1].max((x - exact).abs())];
                }
            }
            for (form, largest) in [RateForm::First, RateForm::Second].into_iter().zip(largest) {
                let misses: f64 = scheme.misses(form, Lengths::new(h, &[h; 2])).iter().sum();
                let handed_on = if form == RateForm::Second { f64::min(handed_on, 1.5) } else { handed_on };
                let ratio = largest / (handed_on * misses * f64::from(n));
                assert!((0.7..1.4).contains(&ratio), "{scheme:?} {form:?}: {ratio}");
            }
        }
    }

    /// A parabola has exact first rates; a cubic whose kept rates are exact, and so its second ones.
    #[test]
    fn bdf2_differentiates_parabolas_exactly_over_unequal_steps() {
        let (g, h) = (0.3, 0.7);
        let lengths = Lengths::new(h, &[g]);
        let f = |t: f64| 2.0 - t + 3.0 * t * t;
        let [first, second, value, rate, _] = BDF2.at_end(RateForm::Second, lengths);
        let kept = [6.0 * g - 1.0, 6.0, (f(g) - f(0.0)) / g, 6.0, 0.0];
        let change = f(g + h) - f(g);
        let found = [first, second, value, rate].map(|row| dot(&row, change, kept));
        for (found, exact) in found.iter().zip([6.0 * (g + h) - 1.0, 6.0, change / h, 6.0]) {
            assert!((found - exact).abs() < 1e-12, "{found} {exact}");
        }
        let Rows(rows) = BDF2.in_equations(RateForm::Second, lengths);
        assert_eq!(rows, [first, second]);
    }

    #[test]
    fn bdf3_differentiates_cubics_exactly_and_misses_a_part_of_the_fourth_power() {
        let (k, g, h) = (0.4, 0.3, 0.7);
        let lengths = Lengths::new(h, &[g, k]);
        let ends = [k, k + g, k + g + h];
        let rate = |f: &dyn Fn(f64) -> f64| {
            let quotients = [(f(ends[1]) - f(ends[0])) / g, (f(ends[0]) - f(0.0)) / k];
            let kept = [0.0, 0.0, quotients[0], 0.0, quotients[1]];
            let rows = BDF3.at_end(RateForm::First, lengths);
            let change = f(ends[2]) - f(ends[1]);
            let left = [2, 4].map(|slot| dot(&rows[slot], change, kept));
            assert!((left[0] - change / h).abs() < 1e-13 && left[1] == quotients[0], "{left:?}");
            dot(&rows[0], change, kept)
        };
        let found = rate(&|t| 2.0 - t + 3.0 * t * t - t.powi(3));
        let exact = -1.0 + 6.0 * ends[2] - 3.0 * ends[2] * ends[2];
        assert!((found - exact).abs() < 1e-12, "{found} {exact}");
        // what the rate of t^4/24 lacks, over the scalar of the change, is what a step misses
        let lacks = ends[2].powi(3) / 6.0 - rate(&|t: f64| t.powi(4) / 24.0);
        let misses = BDF3.misses(RateForm::First, lengths);
        let scalar = BDF3.in_equations(RateForm::First, lengths).0[0].change;
        assert!((lacks / scalar - misses[2]).abs() < 1e-13, "{} {misses:?}", lacks / scalar);
        assert_eq!(misses[..2], [0.0, 0.0]);
        // fields with second rates have two orders
        assert_eq!(BDF3.in_equations(RateForm::Second, lengths), BDF2.in_equations(RateForm::Second, lengths));
    }

    /// Increments that grow and shrink by the factors that steps of the run's own choice may have leave errors bounded.
    #[test]
    fn bdf3_is_stable_where_increments_grow_by_half_and_shrink() {
        // x' = 0 behind values that do not agree: the rate of the polynomial through the past goes to zero
        let mut random = 1u64;
        let (mut before, mut kept, mut largest) = (vec![1.0, 1.0], [0.0, 0.0, 1.0, 0.0, -1.0], 0.0f64);
        let mut x = 0.0;
        for _ in 0..2000 {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let factor = if (random >> 40) & 1 == 1 { 1.5 } else { 1.0 / 1.5 };
            let lengths = Lengths::new(before[0] * factor, &before);
            let rows = BDF3.at_end(RateForm::First, lengths);
            let change = -dot(&rows[0], 0.0, kept) / rows[0].change;
            kept = rows.map(|row| dot(&row, change, kept));
            x += change;
            largest = largest.max(x.abs());
            before = vec![lengths.now, before[0]];
        }
        assert!(largest < 10.0, "{largest}");
    }

    #[test]
    fn the_highest_frequencies_are_damped_by_the_spectral_radius_that_is_asked_for() {
        // x'' = -x with steps so long that only the rows matter: |x| falls by rho^2 in two steps of either sign
        for rho in [0.5f64, 0.8, 1.0] {
            let scheme = Scheme::Alpha(Alpha::generalised(rho));
            let h = 1e6;
            let lengths = Lengths::new(h, &[h]);
            let (mut x, mut kept) = (1.0, started([0.0, -1.0]));
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
