//! Who may change a scene, and who may put back what a run has changed: counted, so that it does not grow again.

use super::{
    code,
    lengths::{Function, functions},
    sources,
};

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
    let made = |line: &String| line.starts_with("runtime/problem/src/");
    let found: Vec<String> = lines_with(&["&mut Scene"]).into_iter().filter(|line| !made(line)).collect();
    assert!(found.is_empty(), "solve with `Scene::equations`, which are a copy:\n{}", found.join("\n"));
}

#[test]
fn what_an_attempt_has_changed_is_put_back_in_one_place() {
    // what is put back was copied before: what attempts change, rates that others take the place of, and what somebody who
    // solves the equations of his own starts from
    let owners = [
        "runtime/run/src/standing.rs",
        "runtime/discrete/src/system",
        "runtime/adapt/src/accuracy/data.rs",
        // derivatives go through the steps of a run that has ended
        "runtime/gradient/src/standing.rs",
    ];
    let mut copies = lines_with(&["known.clone()", "set_known(", "rates.clone()", "set_rates("]);
    copies.retain(|line| !line.contains("let mut in_steps = known.clone()"));
    for owner in owners {
        assert!(copies.iter().any(|line| line.starts_with(owner)), "the words do not stand in {owner}: {copies:#?}");
    }
    let found: Vec<&String> = copies.iter().filter(|line| owners.iter().all(|o| !line.starts_with(o))).collect();
    assert!(found.is_empty(), "a snapshot of the stepper, or `System::with_other_rates`, does it:\n{found:#?}");
}

#[test]
fn whether_a_mesh_is_whole_is_asked_in_few_places() {
    let found = lines_with(&[".is_whole()"]);
    let help =
        "`Mesh::holders` agree on what is true of a mesh, `lacks` says what is nowhere, `check_whole` is for checks";
    assert!(found.len() < 8, "{help}:\n{}", found.join("\n"));
}

/// What stands between a bracket and the one that closes it, and what is behind; `None` if the text does not begin with it.
fn within(text: &str, [open, close]: [char; 2]) -> Option<[&str; 2]> {
    let mut depth = 0;
    for (at, c) in text.char_indices() {
        match c {
            c if c == open => depth += 1,
            // the arrow of a function closes nothing
            c if c == close && !text[..at].ends_with('-') => depth -= 1,
            _ => {}
        }
        match depth {
            0 if at == 0 => return None,
            0 => return Some([&text[open.len_utf8()..at], &text[at + close.len_utf8()..]]),
            _ => {}
        }
    }
    None
}

/// The arguments of a function whose name is followed by this text, the receiver among them.
fn arguments(behind_name: &str) -> Option<Vec<&str>> {
    let [_, behind] = within(behind_name, ['<', '>']).unwrap_or(["", behind_name]);
    let [list, _] = within(behind, ['(', ')'])?;
    let (mut depth, mut start, mut found) = (0, 0, Vec::new());
    for (at, c) in list.char_indices() {
        match c {
            '(' | '[' | '{' | '<' => depth += 1,
            ')' | ']' | '}' => depth -= 1,
            '>' if !list[..at].ends_with('-') => depth -= 1,
            ',' if depth == 0 => {
                found.push(list[start..at].trim());
                start = at + 1;
            }
            _ => {}
        }
    }
    found.push(list[start..].trim());
    found.retain(|argument| !argument.is_empty());
    Some(found)
}

/// Functions with a `bool` among three or more arguments, tests left out.
fn functions_with_flags() -> Vec<String> {
    let is_flag = |argument: &str| {
        let kind = argument.rsplit_once(':').map(|(_, kind)| kind.trim());
        kind.is_some_and(|kind| kind.trim_start_matches(['&', ' ']).trim_start_matches("mut ") == "bool")
    };
    let mut found = Vec::new();
    for (path, text) in sources() {
        if path.starts_with("tests/") || path.contains("/tests") || path.contains("/benches/") {
            continue;
        }
        let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        for Function { name, line, signature, .. } in functions(text) {
            let list = arguments(&signature[name.len()..]).unwrap_or_default();
            if list.len() > 2 && list.iter().any(|argument| is_flag(argument)) {
                found.push(format!("{path}:{line}: {name}({})", list.join(", ")));
            }
        }
    }
    found
}

#[test]
fn arguments_are_told_apart() {
    let of = |text| arguments(text).expect("a list");
    assert_eq!(
        of("(&self, f: impl Fn(u8, bool) -> bool, b: bool,) -> u8 {"),
        ["&self", "f: impl Fn(u8, bool) -> bool", "b: bool"]
    );
    assert_eq!(of("<'a, F: Fn(&'a u8) -> Vec<u8>>(x: [u8; 2], y: Map<u8, bool>)"), ["x: [u8; 2]", "y: Map<u8, bool>"]);
    assert!(of("()").is_empty() && arguments(" pointer").is_none());
}

#[test]
fn few_functions_take_a_flag_among_other_arguments() {
    let found = functions_with_flags();
    let help = "a call says more with an enum, a struct of its arguments, or two functions";
    assert!(found.len() < 30, "{}: {help}:\n{}", found.len(), found.join("\n"));
}
