//! `wfl run SCENE degree=2 refine=1/2`: the knobs of a sweep on the command line of a run.
//!
//! What a sweep or a wanted accuracy picked can be run again as it is written there. A word whose name is a parameter of
//! the scene is that parameter.

use std::path::Path;

use wfl_runtime::knobs::{self, OF_STATEMENTS};

use crate::load::{Loaded, load, say};

/// A scene read with parameters and knobs. Prints why where there is none.
pub(crate) fn load_with(scene: &Path, words: &[String], command: &str) -> Option<Loaded> {
    let name = |word: &str| word.split_once('=').map(|(name, _)| name.trim().to_owned());
    let is_knob = |word: &String| name(word).is_some_and(|n| OF_STATEMENTS.contains(&n.as_str()));
    let (mut knobs, mut params): (Vec<String>, Vec<String>) = words.iter().cloned().partition(is_knob);
    let mut loaded = load(scene, &params, command)?;
    let named =
        |loaded: &Loaded, word: &str| loaded.script.params.iter().any(|p| name(word).is_some_and(|n| n == p.name.name));
    if knobs.iter().any(|word| named(&loaded, word)) {
        (params, knobs) = words.iter().cloned().partition(|word| !is_knob(word) || named(&loaded, word));
        loaded = load(scene, &params, command)?;
    }
    let setting: Vec<(String, String)> = knobs
        .iter()
        .filter_map(|word| word.split_once('=').map(|(n, v)| (n.trim().to_owned(), v.trim().to_owned())))
        .collect();
    match knobs::apply(&mut loaded.script, &setting, &[], &[]) {
        Ok(()) => Some(Loaded { knobs, ..loaded }),
        Err(why) => {
            say(&format!("error: {why}\n"));
            None
        }
    }
}
