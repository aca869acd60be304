//! A map that keeps the order of insertion, for the tables of the report.
//!
//! Promises: a name stands once, at the place of its first insertion; JSON objects are written
//! and read in that order. Lookup goes by a tree of the names.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Names with values, in the order of insertion. Equal maps have equal order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OrderedMap<V> {
    entries: Vec<(String, V)>,
    /// By name its place in `entries`.
    places: BTreeMap<String, usize>,
}

impl<V> OrderedMap<V> {
    /// No entries.
    #[must_use]
    pub const fn new() -> Self {
        OrderedMap { entries: Vec::new(), places: BTreeMap::new() }
    }

    /// Sets the value of `name`; a former value is returned and its place kept.
    pub fn insert(&mut self, name: impl Into<String>, value: impl Into<V>) -> Option<V> {
        let (name, value) = (name.into(), value.into());
        if let Some(known) = self.places.get(&name) {
            return Some(std::mem::replace(&mut self.entries[*known].1, value));
        }
        self.places.insert(name.clone(), self.entries.len());
        self.entries.push((name, value));
        None
    }

    /// The value of `name`.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&V> {
        self.places.get(name).map(|place| &self.entries[*place].1)
    }

    /// Names with their values, in order.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &V)> {
        self.entries.iter().map(|(name, value)| (name.as_str(), value))
    }

    /// Number of entries.
    #[must_use]
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// True if there are no entries.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }
}

impl<V> Default for OrderedMap<V> {
    fn default() -> Self {
        OrderedMap::new()
    }
}

impl<N: Into<String>, V> FromIterator<(N, V)> for OrderedMap<V> {
    fn from_iter<I: IntoIterator<Item = (N, V)>>(entries: I) -> Self {
        let mut map = OrderedMap::new();
        for (name, value) in entries {
            map.insert(name, value);
        }
        map
    }
}

impl<V: Serialize> Serialize for OrderedMap<V> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.iter())
    }
}

impl<'de, V: Deserialize<'de>> Deserialize<'de> for OrderedMap<V> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(InOrder(PhantomData))
    }
}

struct InOrder<V>(PhantomData<V>);

impl<'de, V: Deserialize<'de>> Visitor<'de> for InOrder<V> {
    type Value = OrderedMap<V>;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut access: A) -> Result<Self::Value, A::Error> {
        let mut map = OrderedMap::new();
        while let Some((name, value)) = access.next_entry::<String, V>()? {
            map.insert(name, value);
        }
        Ok(map)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_is_that_of_first_insertion() {
        let mut map: OrderedMap<f64> = OrderedMap::new();
        for name in ["young", "alpha", "mu"] {
            assert_eq!(map.insert(name, 1.0), None);
        }
        assert_eq!(map.insert("alpha", 2.0), Some(1.0));
        let names: Vec<&str> = map.iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["young", "alpha", "mu"]);
        assert_eq!((map.get("alpha"), map.get("beta")), (Some(&2.0), None));
        let json = serde_json::to_string(&map).unwrap();
        assert_eq!(json, r#"{"young":1.0,"alpha":2.0,"mu":1.0}"#);
        assert_eq!(serde_json::from_str::<OrderedMap<f64>>(&json).unwrap(), map);
    }
}
