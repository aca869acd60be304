//! The value of a [`Curve`], linear between its rows, and its slope, over any [`Real`].
//!
//! Promises: a row is met exactly; at a row the slope is that of the piece that begins there, at the last row that of the
//! last piece; outside the rows nothing is a number. One formula serves interpreter, extended precision and machine code,
//! so that all take the same piece and f64 has the same bits everywhere.

use std::{
    hash::{Hash, Hasher},
    ops::Deref,
    sync::Arc,
};

pub use wfl::Curve;

use crate::{compare::Compare, real::Real};

/// An argument may lie outside the rows by the rounding of an expression such as `t/yr`: so many times the rounding of
/// the larger end. It then counts as the end.
const ROUNDING: f64 = 16.0;

/// A curve in the nodes of a graph and in instructions: two are equal if they are the same one.
#[derive(Clone, Debug)]
pub struct CurveRef(Arc<Curve>);

impl CurveRef {
    /// Where it stands as long as a reference to it lives.
    #[must_use]
    pub fn address(&self) -> *const Curve {
        Arc::as_ptr(&self.0)
    }
}

impl From<&Arc<Curve>> for CurveRef {
    fn from(curve: &Arc<Curve>) -> Self {
        Self(Arc::clone(curve))
    }
}

impl Deref for CurveRef {
    type Target = Curve;

    fn deref(&self) -> &Curve {
        &self.0
    }
}

impl PartialEq for CurveRef {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Eq for CurveRef {}

impl Hash for CurveRef {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.address().hash(state);
    }
}

/// What is read off a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Reading {
    /// Its value.
    Value,
    /// Its slope.
    Slope,
}

impl Reading {
    /// Both, in order of declaration.
    pub const ALL: [Reading; 2] = [Reading::Value, Reading::Slope];

    /// The name in listings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Reading::Value => "table",
            Reading::Slope => "table_slope",
        }
    }
}

/// A reading at `x`; not a number outside the rows.
pub fn read<T: Real>(curve: &Curve, reading: Reading, x: T) -> T {
    let Some((k, at_end)) = piece(curve, x) else { return T::from_f64(f64::NAN) };
    let [x0, x1] = [k, k + 1].map(|k| T::from_f64(curve.arguments[k]));
    let [y0, y1] = [k, k + 1].map(|k| T::from_f64(curve.values[k]));
    let rise = y1.sub(y0);
    match reading {
        Reading::Slope => rise.div(x1.sub(x0)),
        // the part of the piece up to its end may round to something next to 1
        Reading::Value if at_end => y1.add(rise.div(x1.sub(x0)).mul(x.sub(x1))),
        Reading::Value => y0.add(rise.mul(x.sub(x0).div(x1.sub(x0)))),
    }
}

/// The number of the piece that begins at `x` or before, and whether `x` is the end of the last one.
fn piece<T: Real>(curve: &Curve, x: T) -> Option<(usize, bool)> {
    let rows = &curve.arguments;
    let (first, last) = curve.range();
    let slack = ROUNDING * f64::EPSILON * first.abs().max(last.abs());
    let at_least = |row: f64| T::from_f64(row).compare(Compare::LessEqual, x);
    let at_most = |row: f64| x.compare(Compare::LessEqual, T::from_f64(row));
    if !at_least(first - slack) || !at_most(last + slack) {
        return None;
    }
    if at_least(last) {
        return Some((rows.len() - 2, true));
    }
    // rows at or before x; none only where x is before the first by rounding
    let before = rows.partition_point(|row| at_least(*row));
    Some((before.saturating_sub(1).min(rows.len() - 2), false))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{dd::Dd, dual::Dual};

    fn curve(rows: &[(f64, f64)]) -> Curve {
        Curve {
            name: "\"h.csv\"".to_owned(),
            arguments: rows.iter().map(|r| r.0).collect(),
            values: rows.iter().map(|r| r.1).collect(),
        }
    }

    #[test]
    fn rows_are_met_and_between_them_it_is_linear() {
        let c = curve(&[(-0.3, 0.7), (0.1, 0.1), (0.7, -1.3), (1.1, 1e-3)]);
        for (x, y) in c.arguments.iter().zip(&c.values) {
            assert_eq!(read(&c, Reading::Value, *x), *y);
        }
        assert!((read(&c, Reading::Value, 0.4) + 0.6).abs() < 1e-15);
        for x in [-0.3 - 1e-9, 1.1 + 1e-9, f64::NAN, f64::INFINITY] {
            assert!(read(&c, Reading::Value, x).is_nan() && read(&c, Reading::Slope, x).is_nan(), "{x}");
        }
        // an end that an expression has rounded is the end
        assert!((read(&c, Reading::Value, 1.1f64.next_up()) - 1e-3).abs() < 1e-15);
        assert!((read(&c, Reading::Value, (-0.3f64).next_down()) - 0.7).abs() < 1e-15);
    }

    #[test]
    fn slopes_belong_to_the_piece_that_begins_and_to_the_last_one() {
        let c = curve(&[(0.0, 0.0), (1.0, 2.0), (3.0, 1.0)]);
        let slopes = [(0.0, 2.0), (0.5, 2.0), (1.0, -0.5), (2.9, -0.5), (3.0, -0.5)];
        for (x, slope) in slopes {
            assert_eq!(read(&c, Reading::Slope, x), slope);
            // a dual number knows the rule from the formula of the value
            assert_eq!(read(&c, Reading::Value, Dual::new(x, 1.0)).slope, slope, "{x}");
        }
    }

    #[test]
    fn extended_precision_takes_the_same_piece() {
        let c = curve(&[(0.1, 0.3), (0.2, 0.7), (0.3, -0.1)]);
        for x in [0.1, 0.15, 0.2, 0.25, 0.3] {
            let (one, wide) = (read(&c, Reading::Value, x), read(&c, Reading::Value, Dd::from_f64(x)).to_f64());
            assert!((one - wide).abs() <= 1e-16, "{x}: {one} {wide}");
        }
    }
}
