//! Who may change a scene, and who may put back what a run has changed: counted, so that it does not grow again.

use super::{code, sources};

/// Lines of code of the runtime that hold some words, tests left out.
fn lines_with(words: &[&str]) -> Vec<String> {
    let mut found = Vec::new();
    for (path, text) in sources() {
        if !path.starts_with("runtime/") || path.contains("/tests") || path.contains("/benches/") {
            continue;
        }
        // unit tests stand at the end of a file; a line at its head may name one of them
        let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        let lines = code(text).filter(|(_, line)| words.iter().any(|word| line.contains(word)));
        found.extend(lines.map(|(number, line)| format!("{path}:{number}: {}", line.trim())));
    }
    found
}

#[test]
fn a_scene_does_not_change_once_it_is_made() {
    // where it is made, a scheme adds what it needs of the mass
    let made = |line: &String| line.starts_with("runtime/src/scene/");
    let found: Vec<String> = lines_with(&["&mut Scene"]).into_iter().filter(|line| !made(line)).collect();
    assert!(found.is_empty(), "solve with `Scene::equations`, which are a copy:\n{}", found.join("\n"));
}

#[test]
fn what_an_attempt_has_changed_is_put_back_in_one_place() {
    // what is put back was copied before: what attempts change, rates that others take the place of, and what somebody who
    // solves the equations of his own starts from
    let owners = [
        "runtime/src/run/standing.rs",
        "runtime/discrete/src/system",
        "runtime/src/accuracy/data.rs",
        // derivatives go through the steps of a run that has ended
        "runtime/src/gradient/standing.rs",
    ];
    let mut copies = lines_with(&["known.clone()", "set_known(", "rates.clone()", "set_rates("]);
    copies.retain(|line| !line.contains("let mut in_steps = known.clone()"));
    for owner in owners {
        assert!(copies.iter().any(|line| line.starts_with(owner)), "the words do not stand in {owner}: {copies:#?}");
    }
    let found: Vec<&String> = copies.iter().filter(|line| owners.iter().all(|o| !line.starts_with(o))).collect();
    assert!(found.is_empty(), "a snapshot of the stepper, or `System::with_other_rates`, does it:\n{found:#?}");
}
