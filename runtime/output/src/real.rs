//! A number of a JSON file, which has neither NaN nor infinity. Does not judge numbers.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A number that may be NaN or infinite: then `null` in JSON, which is read as NaN.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Real(pub f64);

impl From<f64> for Real {
    fn from(number: f64) -> Self {
        Real(number)
    }
}

impl Serialize for Real {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Real(number) = *self;
        number.is_finite().then_some(number).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Real {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let number = Option::<f64>::deserialize(deserializer)?;
        Ok(Real(number.unwrap_or(f64::NAN)))
    }
}
