//! Orders of convergence and error estimates from the differences between the levels of a mesh sequence. Formulas only.

/// No order below this is believed: a singular solution converges, however slowly.
const LEAST_ORDER: f64 = 0.5;
/// Largest order of convergence that is assumed: faster convergence gives an estimate that is too large, never too
/// small.
const MOST_ORDER: f64 = 2.0;

/// Two levels of a mesh sequence: their fineness (cells along an edge, any unit) and the distance of the solutions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Step {
    pub(super) from: f64,
    pub(super) to: f64,
    pub(super) distance: f64,
}

/// How the errors of two levels and their distance go together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Norm {
    /// All errors point the same way: `d = e1 - e2`. The careful choice for any quantity.
    Lengths,
    /// The distance is orthogonal to the finer error, as Galerkin's method has it in its energy: `d^2 = e1^2 - e2^2`.
    Squares,
}

impl Norm {
    fn power(self) -> f64 {
        if self == Norm::Squares { 2.0 } else { 1.0 }
    }

    /// The error of a level from its distance to a better one and the error of that.
    pub(super) fn total(self, apart: f64, behind: f64) -> f64 {
        if self == Norm::Squares { apart.hypot(behind) } else { apart + behind }
    }

    /// The order that two steps in a row show: `d1/d2 = (k1^-p - k2^-p)/(k2^-p - k3^-p)`, which grows with p (with
    /// squares: of squares, and 2p). Not a number where a distance is not.
    pub(super) fn order(self, first: Step, second: Step) -> f64 {
        let wanted = (first.distance / second.distance).powf(self.power());
        if !wanted.is_finite() {
            return if first.distance > 0.0 && second.distance == 0.0 { MOST_ORDER } else { f64::NAN };
        }
        let ratio = |p: f64| {
            let at = |k: f64| (k / second.to).powf(-p * self.power());
            (at(first.from) - at(first.to)) / (at(second.from) - at(second.to))
        };
        let (mut low, mut high) = (1e-3, 8.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if ratio(middle) < wanted { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }

    /// The error behind a step if the solutions converge with an order.
    pub(super) fn error_behind(self, step: Step, order: f64) -> f64 {
        let power = self.power();
        step.distance / ((step.to / step.from).powf(order * power) - 1.0).powf(1.0 / power)
    }
}

/// The error that is known of a fineness.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known {
    pub(super) fineness: f64,
    pub(super) error: f64,
}

/// The order by which an error falls from one fineness to another.
pub(super) fn order_of_errors(coarse: Known, fine: Known) -> f64 {
    (coarse.error / fine.error).ln() / (fine.fineness / coarse.fineness).ln()
}

/// An order that is believed; `most` is what the elements can give at best.
pub(super) fn believed(order: f64, most: f64) -> f64 {
    if order.is_nan() { LEAST_ORDER } else { order.clamp(LEAST_ORDER, most.min(MOST_ORDER)) }
}

/// The smallest fineness with a demanded error, from a known one.
pub(super) fn fineness_for(wanted: f64, known: Known, order: f64) -> f64 {
    known.fineness * (known.error / wanted).powf(1.0 / order)
}
