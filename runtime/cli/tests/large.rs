//! Scenes that are large in one direction: no abort, no panic, and times that grow with the size.
//!
//! Sizes are small enough for every build; what is quadratic takes many times the limit already there.

use std::{
    path::PathBuf,
    process::{Command, Output},
    sync::atomic::{AtomicUsize, Ordering},
    time::{Duration, Instant},
};

/// Longest time that one scene may take: a hundred times what it needs, so that a busy machine does not matter.
const LIMIT: Duration = Duration::from_secs(30);

const BASE: &str = "\
mesh box [0,0] to [1,1] cells [2,2]
region west = faces where x == 0
region east = faces where x == 1
unknown u : scalar on all
term k on all : Grad_u.Grad_Test_u
fix u = 0 on west
";

fn list(n: usize, sign: &str, part: impl Fn(usize) -> String) -> String {
    (0..n).map(part).collect::<Vec<_>>().join(sign)
}

/// A kind of scene: its name, how many parts, its lines, and a code that the messages must have (none: exit 0).
type Kind = (&'static str, usize, fn(usize) -> String, &'static str);

const SUMS: &[Kind] = &[
    ("fix", 12_000, |n| format!("fix u = {} on east\n", list(n, "+", |i| format!("sin({i}.5*x)"))), ""),
    ("load", 12_000, |n| format!("load u = {} on east\n", list(n, " - ", |i| format!("sin({i}.5*x)"))), ""),
    ("start", 12_000, |n| format!("start u = {}\nfix u = 1 on east\n", list(n, "+", |i| format!("sin({i}.5*x)"))), ""),
    (
        "data",
        12_000,
        |n| format!("data k : scalar on all = {}\nload u = k on east\n", list(n, "+", |i| format!("sin({i}.5*x)"))),
        "",
    ),
    ("measure", 12_000, |n| format!("measure m = mean({}) on all\n", list(n, "+", |i| format!("sin({i}.5*x)"))), ""),
    ("output", 12_000, |n| format!("output vtk \"o\" : {} as q\n", list(n, "+", |i| format!("sin({i}.5*x)"))), ""),
    (
        "term",
        6_000,
        |n| format!("term t on all : 1e-9*({})*Test_u\nfix u = 1 on east\n", list(n, "+", |i| format!("sin({i}.5*u)"))),
        "",
    ),
    (
        "energy",
        6_000,
        |n| format!("energy t on all : 1e-9*({})\nfix u = 1 on east\n", list(n, "+", |i| format!("sin({i}.5*u)"))),
        "",
    ),
    (
        "condition",
        12_000,
        |n| format!("region r = faces where {}\nfix u = 1 on r\n", list(n, " or ", |i| format!("x == 1 + {i}*y*0"))),
        "",
    ),
    ("product", 30_000, |n| format!("fix u = {} on east\n", list(n, "*", |i| format!("(1 + x*1e-6/{})", i + 1))), ""),
    ("deep", 12_000, |n| format!("fix u = ([1,2].*{}).[1,0] on east\n", list(n, ".*", |i| format!("[x,{i}]"))), "E441"),
    (
        "chain",
        300,
        |n| format!("def a0 = x\n{}fix u = a{n} on east\n", list(n, "", |i| format!("def a{} = a{i}+1\n", i + 1))),
        "E119",
    ),
];

const STATEMENTS: &[Kind] = &[
    ("params", 20_000, |n| list(n, "", |i| format!("param p{i} = {i}\n")), "W702"),
    ("defs", 20_000, |n| list(n, "", |i| format!("def d{i} = {i}\n")), "W702"),
    ("regions", 4_000, |n| list(n, "", |i| format!("region r{i} = faces where x > {}\n", i + 2)), "E402"),
    ("unknown names", 4_000, |n| list(n, "", |i| format!("measure m{i} = mean(q{i}) on all\n")), "E201"),
    ("syntax errors", 10_000, |n| list(n, "", |i| format!("param = ={i}\n")), "E1"),
    ("states", 3_000, |n| list(n, "", |i| format!("state s{i} : scalar on all := u\n")), "W702"),
    ("data", 4_000, |n| list(n, "", |i| format!("data v{i} : scalar on all = x\n")), "W702"),
    ("unknowns", 4_000, |n| list(n, "", |i| format!("unknown v{i} : scalar on all\n")), "W702"),
    ("fixes", 4_000, |n| list(n, "", |_| "fix u = 1 on east\n".to_owned()), ""),
    ("measures", 2_000, |n| list(n, "", |i| format!("measure m{i} = mean(u) on all\n")), ""),
    ("options", 2_000, |n| format!("solver newton with {}\n", list(n, ", ", |_| "tol=1e-9".to_owned())), "E209"),
    ("long name", 50_000, |n| format!("param {0} = 1\nfix u = {0}b on east\n", "a".repeat(n)), "E201"),
    ("minus", 100_000, |n| format!("fix u = {}1 on east\n", "-".repeat(n)), ""),
    ("brackets", 10_000, |n| format!("fix u = {}1{} on east\n", "(".repeat(n), ")".repeat(n)), "E119"),
];

fn wfl(name: &str, words: &[&str], text: &str) -> (Output, Duration) {
    // two lists have a kind of the same name, and tests run side by side
    static CALLS: AtomicUsize = AtomicUsize::new(0);
    let call = CALLS.fetch_add(1, Ordering::Relaxed);
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("large_{}_{call}", name.replace(' ', "_")));
    std::fs::create_dir_all(&dir).expect("a folder");
    std::fs::write(dir.join("scene.wfl"), format!("{BASE}{text}")).expect("a scene");
    let begin = Instant::now();
    let mut command = Command::new(env!("CARGO_BIN_EXE_wfl"));
    let output = command.current_dir(&dir).args(words).output().expect("the command runs");
    let _ = std::fs::remove_dir_all(&dir);
    (output, begin.elapsed())
}

fn holds(kinds: &[Kind], words: &[&str], part: usize) {
    let whole = part == 1;
    for (name, n, lines, code) in kinds {
        // a build without optimisation has a part of each, and the whole of what overflows the stack of a first thread
        let part = if cfg!(debug_assertions) && !["fix", "deep"].contains(name) { 8 * part } else { part };
        let (output, time) = wfl(&format!("{} {name}", words[0]), words, &lines((n / part).max(300)));
        let said = String::from_utf8_lossy(&output.stderr);
        let shown: String = said.chars().take(600).collect();
        let case = format!("{} {name}: {:?} after {time:?}: {shown}", words[0], output.status.code());
        assert!(time < LIMIT, "{case}");
        // an abort has no exit code, a panic has 101
        assert!(output.status.code().is_some_and(|c| c < 3), "{case}");
        if whole {
            assert!(said.contains(code) && (output.status.success() || !code.is_empty()), "{case}");
        }
    }
}

#[test]
fn long_expressions_are_checked() {
    holds(SUMS, &["check", "scene.wfl"], 1);
}

#[test]
fn long_expressions_are_shown() {
    holds(&SUMS[6..8], &["show", "scene.wfl", "tangent"], 1);
    holds(SUMS, &["fmt", "--check", "scene.wfl"], 4);
}

#[test]
fn many_statements_are_checked() {
    holds(STATEMENTS, &["check", "scene.wfl"], 1);
}

/// The whole way to the results: minutes in a build without optimisation.
#[cfg(not(debug_assertions))]
#[test]
fn long_expressions_are_run() {
    holds(SUMS, &["run", "scene.wfl", "--out", "out"], 1);
    holds(STATEMENTS, &["run", "scene.wfl", "--out", "out"], 1);
}

#[test]
fn of_one_code_a_hundred_messages_are_shown() {
    let param = |i: usize| if i == 0 { "fix u = 1 on east\n".to_owned() } else { format!("param p{i} = {i}\n") };
    let (output, _) = wfl("hundred", &["check", "scene.wfl"], &list(250, "", param));
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(said.matches("warning[W702]").count(), 100, "{said}");
    assert!(said.ends_with("149 more messages with the code W702\n"), "{said}");
    let (output, _) = wfl("ninety", &["check", "scene.wfl"], &list(90, "", param));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.matches("warning[W702]").count() == 89 && !said.contains("more messages"), "{said}");
}
