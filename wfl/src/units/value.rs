//! The unit of an expression: one for each test function it is linear in.
//!
//! Test functions carry no unit, so `p*Div_Test_u + Div_u*Test_p` adds nothing of different kind: summands with
//! different test functions are kept apart, and only those with the same one are compared.

use super::unit::{Ratio, Unit};

/// The unit of the summands with one test function.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Part {
    /// The field of the test function; empty for none.
    pub(super) test: String,
    /// `None` fits every unit: zero, and what is lost.
    pub(super) unit: Option<Unit>,
}

/// The unit of an expression.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Value {
    /// At least one, with different test functions.
    pub(super) parts: Vec<Part>,
    /// False for what is made of plain numbers alone.
    pub(super) named: bool,
    /// Made with coordinates or the step variable in a statement in which plain numbers take the unit that is needed:
    /// whether such a number stands in it cannot be known, so that only a factor between equal quantities is wrong.
    pub(super) soft: bool,
    /// Not known, or already reported: every sum with it is lost, too, so that one mistake gives one message.
    pub(super) lost: bool,
}

impl Value {
    /// A value without test function.
    pub(super) fn of(unit: Option<Unit>) -> Value {
        Value { parts: vec![Part { test: String::new(), unit }], named: true, soft: false, lost: false }
    }

    /// A coordinate or the step variable in a statement in which plain numbers take the unit that is needed.
    pub(super) fn soft(unit: Unit) -> Value {
        Value { soft: true, ..Value::of(Some(unit)) }
    }

    /// A plain number.
    pub(super) fn number() -> Value {
        Value { named: false, ..Value::of(Some(Unit::pure())) }
    }

    /// A zero, or a number of a statement that takes the unit that is needed.
    pub(super) fn zero() -> Value {
        Value { named: false, ..Value::of(None) }
    }

    /// A value of which nothing is known.
    pub(super) fn lost() -> Value {
        Value { lost: true, ..Value::of(None) }
    }

    /// A pure number that has a test function.
    pub(super) fn test(field: &str) -> Value {
        let parts = vec![Part { test: field.to_owned(), unit: Some(Unit::pure()) }];
        Value { parts, named: true, soft: false, lost: false }
    }

    /// The unit, if there is one alone and known.
    pub(super) fn unit(&self) -> Option<&Unit> {
        match self.parts.as_slice() {
            [part] => part.unit.as_ref(),
            _ => None,
        }
    }

    /// The value with each unit changed.
    pub(super) fn map(mut self, change: impl Fn(&Unit) -> Option<Unit>) -> Value {
        for part in &mut self.parts {
            part.unit = part.unit.as_ref().and_then(&change);
        }
        self
    }

    pub(super) fn raised(self, power: Ratio) -> Value {
        self.map(|u| u.to_power(power))
    }

    /// The product; a test function on both sides is an error of another kind, and the first one counts.
    pub(super) fn times(&self, other: &Value) -> Value {
        let mut product: Vec<Part> = Vec::new();
        for a in &self.parts {
            for b in &other.parts {
                let test = if a.test.is_empty() { &b.test } else { &a.test };
                let unit = a.unit.as_ref().zip(b.unit.as_ref()).and_then(|(a, b)| a.times(b));
                match product.iter_mut().find(|p| p.test == *test) {
                    Some(known) if known.unit == unit => {}
                    Some(known) => known.unit = None,
                    None => product.push(Part { test: test.clone(), unit }),
                }
            }
        }
        let (named, soft) = (self.named || other.named, self.soft || other.soft);
        Value { parts: product, named, soft, lost: self.lost || other.lost }
    }

    pub(super) fn over(&self, other: &Value) -> Value {
        self.times(&other.clone().raised(Ratio::whole(-1)))
    }

    pub(super) fn scaled(self, by: &Unit, power: i64) -> Value {
        self.map(|u| u.times(&by.to_power(Ratio::whole(power))?))
    }
}
