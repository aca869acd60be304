//! For every code of a message one scene where it must appear and one near it where it must not, both through the real
//! command. A code without an entry in the tables is tried with the lines of its page under `wfl check`; a code that
//! needs a run, a file or words on the command line has an entry.

mod runs;
mod scenes;
mod strip;

use std::{
    path::PathBuf,
    process::{Command, Output},
    sync::atomic::{AtomicUsize, Ordering},
};

/// What to do where a code has no pair.
const HOW: &str = "\nEach code of wfl/src/codes/*.rs needs a scene where it appears and one near it where it does not.\n\
    Either the lines `wrong` and `fixed` of its page do that under `wfl check`, put into SCENE of\n\
    runtime/cli/tests/pairs/mod.rs (lines of SCENE that declare the same give way to those of the page), or add an entry:\n\
    \x20   Pair::new(\"E601\", TEXT_WHERE_IT_APPEARS).near(\"log(u)\", \"log(1 + u)\")\n\
    to runtime/cli/tests/pairs/scenes.rs (codes 1 to 5) or runs.rs (codes 6 to 8). `.near` replaces one part, which must\n\
    be there, of the scene or of the words of the command; `.command` gives other words than `run scene.wfl`; `.file`\n\
    adds a file beside the scene. The near scene must be free of the code and must run without an error.";

/// A code with the scene that shows it and the one that does not.
pub(crate) struct Pair {
    code: &'static str,
    wrong: String,
    right: String,
    command: [String; 2],
    /// Words of a command that is run before both.
    before: Option<&'static str>,
    files: Vec<(&'static str, String)>,
}

impl Pair {
    /// `wfl run` of this scene gives the code.
    pub(crate) fn new(code: &'static str, scene: impl Into<String>) -> Self {
        let scene = scene.into();
        let command = ["run scene.wfl"; 2].map(str::to_owned);
        Self { code, wrong: scene.clone(), right: scene, command, before: None, files: Vec::new() }
    }

    /// Other words behind `wfl`, with spaces between.
    pub(crate) fn command(mut self, words: &str) -> Self {
        self.command = [words, words].map(str::to_owned);
        self
    }

    /// Words behind `wfl` of a command that is run before.
    pub(crate) fn before(mut self, words: &'static str) -> Self {
        self.before = Some(words);
        self
    }

    /// A file beside the scene.
    pub(crate) fn file(mut self, name: &'static str, text: impl Into<String>) -> Self {
        self.files.push((name, text.into()));
        self
    }

    /// What is different where the code does not appear: a part of the scene or, if it is not there, of the command.
    pub(crate) fn near(mut self, from: &str, to: &str) -> Self {
        let place = if self.wrong.contains(from) { &mut self.right } else { &mut self.command[1] };
        assert!(place.contains(from), "{}: `{from}` is not there", self.code);
        *place = place.replacen(from, to, 1);
        self
    }
}

/// Codes that no scene can show, each with the reason.
const OUT_OF_REACH: &[(&str, &str)] = &[
    ("E412", "more unknowns than 32-bit numbers can count: no machine of the tests has the memory (E606 comes first)"),
    ("E711", "another process must hold the lock of the folder: runtime/cli/tests/folder.rs has both sides"),
    ("E609", "a fault of the program itself: every law that passes the checks can be compiled"),
];

/// A scene that is right; a line gives way to lines of a page that declare the same.
const SCENE: &[&str] = &[
    "mesh box [0,0,0] to [1,1,1] cells [2,2,2] hex",
    "region left = cells where x < 0.5",
    "region right = cells where x > 0.5",
    "region fault = interface from left to right",
    "region west = faces where x == 0",
    "unknown u : vector",
    "unknown uL : vector on left",
    "unknown uR : vector on right",
    "param gamma = 1e5",
    "param fric = 0.4",
    "param theta = 1 in {-1,0,1}",
    "def sigma(v) = Sym(Grad_v)",
    "def jump(a,b) = a - Interpolate(b, neighbor_element)",
    "def Pn = gamma*(jump(uL,uR).Normal)",
    "term base on all : sigma(u):Grad_Test_u",
    "term lefts on left : sigma(uL):Grad_Test_uL",
    "term rights on right : sigma(uR):Grad_Test_uR",
    "fix u = [0,0,0] on west",
];

/// The lines of a page and those of the scene that they do not replace.
fn with_scene(lines: &str) -> String {
    let declares = |line: &str| -> Vec<String> {
        line.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').take(2).map(str::to_owned).collect()
    };
    let own: Vec<Vec<String>> = lines.lines().map(declares).collect();
    let replaced = |line: &&&str| {
        let words = declares(line);
        own.iter().any(|o| *o == words || words[0] == "mesh" && o[0] == "mesh")
    };
    let kept: Vec<&str> = SCENE.iter().filter(|l| !replaced(l)).copied().collect();
    format!("{lines}\n{}\n", kept.join("\n"))
}

/// Runs the command in a folder of its own.
fn run(pair: &Pair, which: usize) -> Output {
    let name = format!("pair-{}-{}", pair.code, ["wrong", "right"][which]);
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder for the test");
    for (name, text) in &pair.files {
        let file = folder.join(name);
        std::fs::create_dir_all(file.parent().unwrap_or(&folder)).expect("a folder beside the scene");
        std::fs::write(file, text).expect("a file beside the scene");
    }
    let text = [&pair.wrong, &pair.right][which];
    std::fs::write(folder.join("scene.wfl"), text).expect("the scene is written");
    let wfl = |words: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_wfl"));
        command.current_dir(&folder).args(words.split(' ')).env("NO_COLOR", "1").output().expect("wfl runs")
    };
    if let Some(words) = pair.before {
        assert!(wfl(words).status.success(), "{}: wfl {words}", pair.code);
    }
    let output = wfl(&pair.command[which]);
    let _ = std::fs::remove_dir_all(&folder);
    output
}

/// What is wrong with a pair, as lines; `strict` asks that the near scene has no error at all.
fn faults(pair: &Pair) -> Vec<String> {
    let is_error = pair.code.starts_with('E');
    let label = format!("{}[{}]", if is_error { "error" } else { "warning" }, pair.code);
    let [bad, good] = [run(pair, 0), run(pair, 1)];
    let said = |o: &Output| String::from_utf8_lossy(&o.stderr).into_owned();
    let mut found = Vec::new();
    if !said(&bad).contains(&label) {
        found.push(format!("{}: the scene where it must appear says\n{}", pair.code, said(&bad)));
    }
    if is_error && bad.status.success() {
        found.push(format!("{}: an error with exit code 0", pair.code));
    }
    if said(&good).contains(&label) {
        found.push(format!("{}: the near scene has it, too:\n{}", pair.code, said(&good)));
    }
    if said(&good).contains("error[") || !good.status.success() {
        found.push(format!("{}: the near scene is not right ({}):\n{}", pair.code, good.status, said(&good)));
    }
    found
}

/// The pair of a code without an entry: the lines of its page, checked.
fn of_the_page(page: &wfl::CodePage) -> Pair {
    let (wrong, right) = (with_scene(page.wrong), with_scene(page.fixed));
    let command = ["check scene.wfl"; 2].map(str::to_owned);
    Pair { code: page.code.as_str(), wrong, right, command, before: None, files: Vec::new() }
}

/// Every pair is tried, two at a time.
#[test]
fn every_code_appears_where_it_must_and_is_silent_beside() {
    let alone = [strip::one_sided(), scenes::clockwise()];
    let tables: Vec<Pair> = scenes::pairs().into_iter().chain(runs::pairs()).chain(alone).collect();
    let has_entry = |code: &str| tables.iter().any(|p| p.code == code);
    for (code, _) in OUT_OF_REACH {
        assert!(wfl::explain(code).is_some() && !has_entry(code), "{code} is out of reach, or it is not");
    }
    for pair in &tables {
        assert!(wfl::explain(pair.code).is_some(), "{} has no page", pair.code);
        assert!(pair.wrong != pair.right || pair.command[0] != pair.command[1], "{} has no near scene", pair.code);
    }
    let out_of_reach = |code: &str| OUT_OF_REACH.iter().any(|(c, _)| *c == code);
    let pages = wfl::codes().filter(|p| !has_entry(p.code.as_str()) && !out_of_reach(p.code.as_str())).map(of_the_page);
    let pages: Vec<Pair> = pages.collect();
    let all: Vec<Pair> = pages.into_iter().chain(tables).collect();
    let next = AtomicUsize::new(0);
    let work = || -> Vec<String> {
        let mut wrong = Vec::new();
        while let Some(pair) = all.get(next.fetch_add(1, Ordering::Relaxed)) {
            wrong.extend(faults(pair));
        }
        wrong
    };
    let mut wrong = std::thread::scope(|scope| {
        let other = scope.spawn(work);
        let mut wrong = work();
        wrong.extend(other.join().expect("no panic"));
        wrong
    });
    wrong.sort();
    assert!(wrong.is_empty(), "{}\n{HOW}", wrong.join("\n"));
}
