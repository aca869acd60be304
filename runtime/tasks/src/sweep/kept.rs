//! Which rows of an earlier table still say something: those of the same scene with the same inputs and the same version of
//! the program, each setting once. Runs nothing.

use std::{collections::BTreeMap, path::Path};

use wfl_compiler::InterpreterBackend;
use wfl_output::Hash;

use super::{Method, Sweep, plan::Planned, table::Row};
use crate::bench;

/// What stands in a key before the setting: a scene, and what it reads.
pub(super) fn problem_of_key(scene: &str, identity: &Hash) -> String {
    format!("{scene} {identity} | ")
}

impl Sweep<'_> {
    /// Takes out of the table what is not of the present problems: rows of a scene that is another one by now, and rows of
    /// settings that are made again against another reference. Gives how many there were.
    pub(super) fn drop_others(&mut self, methods: &[Method], plan: &[Planned<'_>]) -> usize {
        let mut begin: BTreeMap<String, Option<String>> = BTreeMap::new();
        for method in methods {
            let scene = method.path.display().to_string();
            let known = problem_of_key(&scene, &method.known.identity.hash());
            begin.insert(scene, Some(known));
        }
        let before = self.rows.len();
        self.rows.retain(|row| {
            let scene = row.text("scene");
            let known = begin.entry(scene.to_owned()).or_insert_with(|| present(scene));
            known.as_ref().is_some_and(|known| row.text("key").starts_with(known.as_str()))
        });
        self.rows.retain(|row| plan.iter().all(|p| p.key == row.text("key") || !is_of(row, p)));
        before - self.rows.len()
    }
}

/// How the keys of a scene begin that this command does not name; nothing where it cannot be read any more.
fn present(scene: &str) -> Option<String> {
    let known = bench::known(Path::new(scene), &[], &InterpreterBackend).ok()?;
    Some(problem_of_key(scene, &known.identity.hash()))
}

/// Whether a row is of the scene and the setting of a run.
fn is_of(row: &Row, planned: &Planned<'_>) -> bool {
    let knobs = row.columns().filter_map(|c| Some((c.strip_prefix("knob ")?, row.text(c)))).filter(|k| !k.1.is_empty());
    let here: BTreeMap<&str, &str> = knobs.collect();
    let there: BTreeMap<&str, &str> = planned.setting.iter().map(|(n, v)| (n.as_str(), v.as_str())).collect();
    planned.method.path.display().to_string() == row.text("scene") && here == there
}
