//! How long files and functions are, and what their parameters look like. The limits are those that CONTRIBUTING.md names.

use super::{read, sources};

const FILE_LIMIT: usize = 600;
const FUNCTION_LIMIT: usize = 60;

/// Files of more than [`FILE_LIMIT`] lines, with the reason.
const LONG_FILES: &[(&str, &str)] = &[("wfl/src/codes/warnings.rs", "a table of messages")];

/// Functions of more than [`FUNCTION_LIMIT`] lines, with the reason.
const LONG_FUNCTIONS: &[(&str, &str, &str)] = &[
    ("wfl/src/parse/tests.rs", "usual_slips_have_messages_of_their_own", "a table of slips and messages"),
    ("runtime/cli/tests/pairs/runs.rs", "warnings", "a table of scenes"),
    ("runtime/run/src/checkpoint/steps.rs", "step", "a line for each field"),
    ("runtime/problem/src/options.rs", "auto_steps", "one match over all options of a statement"),
];

/// Files that are too long and are still to be split. The list only shrinks.
const FILES_LEFT: &[&str] = &[];

/// What is still to be mended in a file: functions that are too long, and functions that take a tuple without a name. The
/// list only shrinks.
const FUNCTIONS_LEFT: &[(&str, usize, usize)] = &[];

#[test]
fn files_are_short() {
    let long = |(path, text): &(String, String)| (text.lines().count() > FILE_LIMIT).then(|| path.clone());
    let long: Vec<String> = sources().iter().filter_map(long).collect();
    let listed = |path: &str| LONG_FILES.iter().any(|l| l.0 == path) || FILES_LEFT.contains(&path);
    let new: Vec<&String> = long.iter().filter(|path| !listed(path)).collect();
    assert!(new.is_empty(), "more than {FILE_LIMIT} lines, split them: {new:#?}");
    let short: Vec<&str> = LONG_FILES.iter().map(|l| l.0).chain(FILES_LEFT.iter().copied()).collect();
    let short: Vec<_> = short.into_iter().filter(|listed| long.iter().all(|path| path != listed)).collect();
    assert!(short.is_empty(), "no longer too long, take them off the list: {short:#?}");
}

/// A function as it stands in a file.
#[derive(Debug, PartialEq)]
pub(super) struct Function {
    pub(super) name: String,
    /// Of its first line, from 1.
    pub(super) line: usize,
    lines: usize,
    /// From its name to the end of its head.
    pub(super) signature: String,
}

/// The functions of a file. Formatted code closes a function at its own indentation.
pub(super) fn functions(text: &str) -> Vec<Function> {
    let lines: Vec<&str> = text.lines().collect();
    let mut found = Vec::new();
    for (start, line) in lines.iter().enumerate() {
        let indent = &line[..line.len() - line.trim_start().len()];
        let mut words = line.trim_start().split(' ');
        let mut name = None;
        while let Some(word) = words.next() {
            match word {
                "fn" => name = words.next(),
                "pub" | "pub(crate)" | "pub(super)" | "const" | "async" | "unsafe" | "extern" | "\"C\"" => continue,
                _ => {}
            }
            break;
        }
        let Some(name) = name else { continue };
        let name = name.split(['(', '<']).next().unwrap_or(name).to_owned();
        // the signature ends with its body, or without one in a trait
        let ends = |l: &&str| l.ends_with(['{', ';', '}']);
        let Some(head) = lines[start..].iter().position(ends) else { continue };
        let signature = lines[start..=start + head].iter().map(|l| l.trim()).collect::<Vec<_>>().join(" ");
        let close = format!("{indent}}}");
        let body = if lines[start + head].ends_with('{') {
            lines[start..].iter().position(|l| **l == close).expect("formatted code closes what it opens")
        } else {
            head
        };
        let signature = signature.split_once("fn ").map_or_else(String::new, |s| s.1.to_owned());
        found.push(Function { name, line: start + 1, lines: body + 1, signature });
    }
    found
}

/// Whether a parameter is a tuple without a name: `(a, b): (A, B)`, `&(a, b): &(A, B)`.
fn has_tuple(signature: &str) -> bool {
    let (mut depth, mut angles) = (0usize, 0usize);
    let mut starts = false;
    let mut before = ' ';
    for c in signature.chars() {
        match c {
            // the angles of generics before the parameters hold bounds such as Fn(A)
            '<' if depth == 0 => angles += 1,
            '>' if depth == 0 && before != '-' => angles = angles.saturating_sub(1),
            '(' | '[' if angles == 0 => {
                if c == '(' && depth == 1 && starts {
                    return true;
                }
                depth += 1;
                starts = depth == 1;
            }
            ')' | ']' if angles == 0 => {
                depth = depth.saturating_sub(1);
                if depth == 0 {
                    return false;
                }
                starts = false;
            }
            ',' if depth == 1 => starts = true,
            ' ' | '&' => {}
            _ => starts = false,
        }
        before = c;
    }
    false
}

#[test]
fn functions_are_short_and_their_parameters_have_names() {
    let (mut count, mut wrong, mut mended) = (0, Vec::new(), Vec::new());
    let mut excepted = Vec::new();
    for (path, text) in sources() {
        let (mut long, mut tuples) = (Vec::new(), Vec::new());
        for Function { name, line, lines, signature } in functions(&text) {
            count += 1;
            match LONG_FUNCTIONS.iter().find(|l| l.0 == path && l.1 == name) {
                _ if lines <= FUNCTION_LIMIT => {}
                Some(listed) => excepted.push(listed),
                None => long.push(format!("{path}:{line}: `{name}` has {lines} lines")),
            }
            if has_tuple(&signature) {
                tuples.push(format!("{path}:{line}: `{name}` takes a tuple without a name"));
            }
        }
        let left = FUNCTIONS_LEFT.iter().find(|l| l.0 == path).map_or((0, 0), |l| (l.1, l.2));
        if (long.len(), tuples.len()) < left && long.len() <= left.0 && tuples.len() <= left.1 {
            mended.push(format!("(\"{path}\", {}, {}),", long.len(), tuples.len()));
        }
        wrong.extend(long.into_iter().skip(left.0).chain(tuples.into_iter().skip(left.1)));
    }
    assert!(count > 1000, "only {count} functions seen");
    assert!(wrong.is_empty(), "split functions, and name what a tuple holds: {wrong:#?}");
    let gone: Vec<_> = FUNCTIONS_LEFT.iter().filter(|l| sources().iter().all(|(path, _)| path != l.0)).collect();
    assert!(mended.is_empty() && gone.is_empty(), "mended, shorten the list: {mended:#?} {gone:?}");
    let short: Vec<_> = LONG_FUNCTIONS.iter().filter(|l| !excepted.contains(l)).collect();
    assert!(short.is_empty(), "no longer too long, take them off the list: {short:#?}");
}

#[test]
fn the_limits_are_those_of_the_page() {
    let page = read("CONTRIBUTING.md");
    for limit in [format!("files of at most {FILE_LIMIT} lines"), format!("functions of at most {FUNCTION_LIMIT}")] {
        assert!(page.contains(&limit), "CONTRIBUTING.md does not name the limit: {limit}");
    }
}

#[test]
fn the_length_of_a_function_is_seen() {
    let text = "impl A {\n    pub(crate) fn long<T>(\n        a: u8,\n    ) -> u8 {\n        {\n        }\n        a\n    }\n}\nfn one() {}\n";
    let found: Vec<_> = functions(text).into_iter().map(|f| (f.name, f.line, f.lines)).collect();
    assert_eq!(found, [("long".to_owned(), 2, 7), ("one".to_owned(), 10, 1)]);
}

#[test]
fn a_tuple_without_a_name_is_seen() {
    let seen =
        ["f(&self, (a, b): (A, B))", "f((a, b): (A, B), c: C) -> (D, E) {", "f(&(a, b): &(A, B))", "f( (a, b): P, ) {"];
    assert!(seen.iter().all(|s| has_tuple(s)));
    let named =
        ["f(a: (A, B))", "f<F: Fn((A, B))>(f: F)", "f(a: impl Fn((A, B)), b: B)", "f() -> (A, B)", "f([a, b]: [A; 2])"];
    assert!(named.iter().all(|s| !has_tuple(s)));
}
