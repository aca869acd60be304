//! The identity of a run: everything that determines its numbers.
//!
//! Promises: two runs of one identity give the same numbers. Threads, folders and the clock are not part of it.
//! Differences between two identities are reported by name.

use serde::{Deserialize, Serialize};

use super::{Hash, OrderedMap};

/// The files a run reads, the values of its parameters, its settings and the version of the program.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// Version of the program.
    pub version: String,
    /// Each file that is read, by its name seen from the scene: the scene, files it uses, meshes, data.
    pub inputs: OrderedMap<Hash>,
    /// Each parameter with its value.
    pub parameters: OrderedMap<String>,
    /// What else changes numbers: knobs, precision, prunings that are put back.
    pub settings: OrderedMap<String>,
}

impl Identity {
    /// One number for it.
    #[must_use]
    pub fn hash(&self) -> Hash {
        Hash::of(format!("{self:?}").as_bytes())
    }

    /// What is not as it was in `former`, in the order of causes; `None` if nothing is.
    #[must_use]
    pub fn difference(&self, former: &Identity) -> Option<String> {
        if self.version != former.version {
            return Some(format!("another version of wfl ({}, this is {})", former.version, self.version));
        }
        self.inputs_difference(former)
            .or_else(|| values_difference("the parameter", &self.parameters, &former.parameters))
            .or_else(|| values_difference("the setting", &self.settings, &former.settings))
    }

    fn inputs_difference(&self, former: &Identity) -> Option<String> {
        let changed = self.inputs.iter().find(|(name, hash)| former.inputs.get(name) != Some(hash));
        if let Some((name, _)) = changed {
            return Some(match former.inputs.get(name) {
                Some(_) => format!("another content of `{name}`"),
                None => format!("a scene that did not read `{name}`"),
            });
        }
        let gone = former.inputs.iter().find(|(name, _)| self.inputs.get(name).is_none());
        gone.map(|(name, _)| format!("a scene that read `{name}`, too"))
    }
}

/// Which value is another one.
fn values_difference(what: &str, now: &OrderedMap<String>, former: &OrderedMap<String>) -> Option<String> {
    for (name, value) in now.iter() {
        match former.get(name) {
            Some(before) if before == value => {}
            Some(before) => return Some(format!("another value of {what} `{name}` ({before}, here {value})")),
            None => return Some(format!("no value of {what} `{name}` (here {value})")),
        }
    }
    let gone = former.iter().find(|(name, _)| now.get(name).is_none());
    gone.map(|(name, before)| format!("a value of {what} `{name}` ({before}, here none)"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_differs_is_named() {
        let one = Identity {
            version: "1".into(),
            inputs: [("s.wfl", Hash::of(b"s")), ("k.csv", Hash::of(b"k"))].into_iter().collect(),
            parameters: [("gamma", "1.0".to_owned())].into_iter().collect(),
            settings: [("precision", "auto".to_owned())].into_iter().collect(),
        };
        assert_eq!(one.difference(&one), None);
        let told = |change: &dyn Fn(&mut Identity)| {
            let mut other = one.clone();
            change(&mut other);
            assert_ne!(one.hash(), other.hash());
            one.difference(&other).unwrap()
        };
        assert!(told(&|i| i.version = "2".into()).contains("another version of wfl (2"));
        assert!(
            told(&|i| {
                i.inputs.insert("k.csv", Hash::of(b"x"));
            })
            .contains("another content of `k.csv`")
        );
        assert!(
            told(&|i| {
                i.inputs.insert("m.msh", Hash::of(b"x"));
            })
            .contains("a scene that read `m.msh`, too")
        );
        assert!(
            told(&|i| {
                i.parameters.insert("gamma", "2.0");
            })
            .contains("`gamma` (2.0, here 1.0)")
        );
        assert!(
            told(&|i| {
                i.settings.insert("precision", "f64");
            })
            .contains("`precision` (f64, here auto)")
        );
        assert!(told(&|i| i.settings = OrderedMap::new()).contains("no value of the setting `precision`"));
        assert!(told(&|i| i.inputs = OrderedMap::new()).contains("did not read `s.wfl`"));
    }
}
