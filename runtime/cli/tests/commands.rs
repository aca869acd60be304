//! The program as it is called: what it prints, where, and its exit codes.

use std::{
    path::Path,
    process::{Command, Output, Stdio},
};

use crate::common::Folder;
use serde_json::Value;

/// A body pulled at one end, with closed forms: u = 2x/100 at x = 1 is 0.02.
const ROD: &str = "\
wfl 1
mesh box [0] to [1] cells [4] segment
param k = 100 in 1..1e6 \"stiffness\"
param load_factor = 1
unknown u : scalar
region west = faces where x == 0
region east = faces where x == 1
term stretch on all : k*Grad_u.Grad_Test_u
fix u = 0 on west
load u = 2*load_factor on east
measure tip = max(u) on east
expect 0.0199999 < tip < 0.0200001
";

/// The same rod pressed against a wall.
const CONTACT: &str = "\
wfl 1
mesh box [0] to [1] cells [4] segment
param k = 100
param gamma = 1000
unknown u : scalar
region west = faces where x == 0
region east = faces where x == 1
term stretch on all : k*Grad_u.Grad_Test_u
term wall on east : gamma*pos_part(u - 0.01)*Test_u
fix u = 0 on west
load u = 2 on east
";

struct Ran {
    code: i32,
    out: String,
    err: String,
}

fn wfl(folder: &Path, words: &[&str]) -> Ran {
    let Output { status, stdout, stderr } =
        Command::new(env!("CARGO_BIN_EXE_wfl")).current_dir(folder).args(words).output().expect("the program starts");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8 output");
    Ran { code: status.code().expect("an exit code"), out: text(stdout), err: text(stderr) }
}

#[test]
fn run_prints_a_summary_and_is_quiet_otherwise() {
    let folder = Folder::new("run");
    folder.write("rod.wfl", ROD);
    let ran = wfl(&folder.0, &["run", "rod.wfl"]);
    assert_eq!((ran.code, ran.err.as_str()), (0, ""), "{}", ran.out);
    for part in ["4 unknowns, 1 of 1 steps converged", "tip = 0.02\n", "text to kernels", "results in out/rod"] {
        assert!(ran.out.contains(part), "{part}: {}", ran.out);
    }
    assert!(folder.0.join("out/rod/report.json").is_file());
    let quiet = wfl(&folder.0, &["run", "rod.wfl", "-q", "--out", "there"]);
    assert_eq!((quiet.code, quiet.out + &quiet.err), (0, String::new()));
    assert!(folder.0.join("there/report.json").is_file());
    // what says that a result may be wrong is told also then, advice on the text is not
    let jumps = "mesh box [0] to [1] cells [1] segment\nunknown u : scalar\nparam idle = 1\n\
                 term relay on all : (u - Heaviside(u - 2))*Test_u\n";
    folder.write("jumps.wfl", jumps);
    for (words, advice) in [(&["run", "jumps.wfl", "-q"][..], false), (&["run", "jumps.wfl"], true)] {
        let ran = wfl(&folder.0, words);
        assert_eq!((ran.code, ran.err.contains("W501"), ran.err.contains("W702")), (0, true, advice), "{}", ran.err);
    }
    // what was asked for and cannot be is told
    let single = wfl(&folder.0, &["run", "rod.wfl", "--precision", "f32+f64", "--out", "single"]);
    let report = std::fs::read_to_string(folder.0.join("single/report.json")).expect("a report");
    assert!(report.contains("no matrix of contact forces is factored in single precision"), "{}{report}", single.err);
    let verbose = wfl(&folder.0, &["run", "rod.wfl", "-v", "--threads", "1"]);
    assert!(verbose.err.contains("solver: one linear system") && verbose.err.contains("residual"), "{}", verbose.err);
}

#[test]
fn exit_codes_tell_what_happened() {
    let folder = Folder::new("codes");
    folder.write("rod.wfl", ROD);
    folder.write("contact.wfl", CONTACT);
    let missed = wfl(&folder.0, &["run", "rod.wfl", "load_factor=2"]);
    assert_eq!(missed.code, 3, "{}", missed.err);
    assert!(missed.err.contains("E604"));
    let cubic = ROD.lines().filter(|l| !l.starts_with("expect")).collect::<Vec<_>>().join("\n");
    folder.write("cubic.wfl", format!("{cubic}\nterm cubic on all : 1e9*u*u*u*Test_u\n"));
    let short = wfl(&folder.0, &["run", "cubic.wfl", "--max-iter", "1"]);
    assert_eq!(short.code, 2, "{}{}", short.out, short.err);
    assert!(short.err.contains("E603"), "{}", short.err);
    assert_eq!(wfl(&folder.0, &["run", "contact.wfl"]).code, 0);
    for words in [
        &["run", "rod.wfl", "--threads", "0"][..],
        &["run", "rod.wfl", "--precision", "f16"],
        &["run"],
        &["march", "rod.wfl"],
        &["run", "rod.wfl", "-q", "-v"],
    ] {
        let wrong = wfl(&folder.0, words);
        assert_eq!(wrong.code, 1, "{words:?}");
        assert!(wrong.err.starts_with("error"), "{}", wrong.err);
    }
    let help = wfl(&folder.0, &["--help"]);
    assert!(help.code == 0 && help.out.contains("Exit codes"));
}

#[test]
fn every_command_has_help_with_an_example() {
    for command in ["run", "check", "show", "verify", "explain", "fmt", "import"] {
        let help = wfl(Path::new("."), &[command, "--help"]);
        assert_eq!(help.code, 0);
        assert!(help.out.contains("Example") && help.out.contains(&format!("wfl {command}")), "{}", help.out);
    }
}

#[test]
fn what_is_no_scene_says_so() {
    let folder = Folder::new("files");
    folder.write("empty.wfl", "  \n");
    folder.write("image.wfl", [0x89, b'P', b'N', b'G', 0, 1, 2]);
    folder.write("latin.wfl", b"mesh box # caf\xe9\n");
    let cases = [
        (".", "it is a directory"),
        ("empty.wfl", "is empty"),
        ("image.wfl", "binary file (byte 4"),
        ("latin.wfl", "not UTF-8 text (byte 14"),
        ("nowhere.wfl", "there is no such file"),
    ];
    for (file, words) in cases {
        let ran = wfl(&folder.0, &["run", file]);
        assert_eq!(ran.code, 1, "{file}");
        assert!(ran.err.starts_with("error: ") && ran.err.contains(words), "{file}: {}", ran.err);
        assert_eq!(ran.err.matches("error").count(), 1, "{}", ran.err);
        assert!(!folder.0.join("out").exists());
    }
}

#[test]
fn overrides_are_shown_in_the_command_line() {
    let folder = Folder::new("overrides");
    folder.write("rod.wfl", ROD);
    // word, code, column of the mark, its length
    let cases = [
        ("k=", "E703", 17, 2),
        ("=3", "E703", 17, 2),
        ("k", "E703", 17, 1),
        ("kk=3", "E703", 17, 4),
        ("k=0.5", "E701", 17, 5),
        ("k=1/0", "E109", 21, 1),
        ("k=2*", "E113", 20, 1),
    ];
    for (word, code, column, length) in cases {
        let ran = wfl(&folder.0, &["run", "rod.wfl", word]);
        assert_eq!(ran.code, 1, "{word}: {}", ran.out);
        assert!(ran.err.contains(&format!("error[{code}]")), "{word}: {}", ran.err);
        assert!(ran.err.contains(&format!("(command line):1:{column}")), "{word}: {}", ran.err);
        assert!(ran.err.contains(&format!("1 | wfl run rod.wfl {word}")), "{word}: {}", ran.err);
        let marks = ran.err.lines().find(|l| l.contains('^')).unwrap();
        assert_eq!(marks.matches('^').count(), length, "{word}: {}", ran.err);
    }
    let twice = wfl(&folder.0, &["run", "rod.wfl", "k=3", "k=4"]);
    assert!(twice.err.contains("E209") && twice.err.contains("first given here"), "{}", twice.err);
}

#[test]
fn included_files_are_looked_for_beside_the_file_that_uses_them() {
    let folder = Folder::new("nested");
    std::fs::create_dir_all(folder.0.join("scenes/laws")).unwrap();
    folder.write("scenes/rod.wfl", ROD.replace("param k", "use \"laws/first.wfl\"\nuse \"last.wfl\"\nparam k"));
    folder.write("scenes/laws/first.wfl", "use \"second.wfl\"\ndef one(a) = two(a)\n");
    folder.write("scenes/laws/second.wfl", "def two(a) = 2*a\n");
    folder.write("scenes/last.wfl", "def three(a) = 3*a\n");
    let ran = wfl(&folder.0, &["run", "scenes/rod.wfl"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
}

#[test]
fn check_counts_what_closed_forms_count() {
    let folder = Folder::new("check");
    folder.write("contact.wfl", CONTACT);
    let text = wfl(&folder.0, &["check", "contact.wfl"]);
    assert_eq!((text.code, text.err.as_str()), (0, ""));
    assert!(text.out.contains("nonlinear with kinks"), "{}", text.out);
    let json = wfl(&folder.0, &["check", "contact.wfl", "gamma=7", "--json"]);
    let all: Value = serde_json::from_str(&json.out).unwrap();
    assert_eq!((&all["mesh"][0]["cells"], &all["mesh"][0]["nodes"]), (&4.into(), &5.into()));
    let field = &all["fields"][0];
    assert_eq!((&field["element"], &field["dofs"], &field["free_dofs"]), (&"P1".into(), &5.into(), &4.into()));
    let classes: Vec<&str> = all["terms"].as_array().unwrap().iter().map(|t| t["class"].as_str().unwrap()).collect();
    assert_eq!(classes, ["linear", "nonlinear with kinks", "constant"]);
    assert!(all["terms"].as_array().unwrap().iter().all(|t| t["symmetric"] == true));
    assert_eq!(all["parameters"][1]["value"], 7.0);
    assert_eq!(all["parameters"][1]["given_by"], "command line");
    assert_eq!((&all["system"][0]["free"], &all["system"][0]["fixed"]), (&4.into(), &1.into()));
    // check solves nothing and writes nothing
    assert!(!folder.0.join("out").exists());
}

#[test]
fn show_has_every_view() {
    let folder = Folder::new("show");
    folder.write("contact.wfl", CONTACT);
    let cases = [
        ("ast", "pos_part"),
        ("graph", "pos_part"),
        ("tangent", "tangent\n"),
        ("ir", "output 0"),
        ("clif", "function %wall.tangent"),
        ("terms", "nonlinear with kinks"),
        ("kinks", "contact.wfl:9:27"),
    ];
    for (view, part) in cases {
        let ran = wfl(&folder.0, &["show", "contact.wfl", view]);
        assert_eq!(ran.code, 0, "{view}: {}", ran.err);
        assert!(ran.out.contains(part), "{view}: {}", ran.out);
    }
    let one = wfl(&folder.0, &["show", "contact.wfl", "tangent", "--term", "wall"]);
    assert!(one.out.contains("if 0 <= ") && !one.out.contains("Grad_u"), "{}", one.out);
    let none = wfl(&folder.0, &["show", "contact.wfl", "ir", "--term", "wal"]);
    assert!(none.code == 1 && none.err.contains("did you mean `wall`?"), "{}", none.err);
}

#[test]
fn verify_visits_both_branches_and_passes() {
    let folder = Folder::new("verify");
    folder.write("contact.wfl", CONTACT);
    let ran = wfl(&folder.0, &["verify", "contact.wfl", "--samples", "20"]);
    assert_eq!(ran.code, 0, "{}{}", ran.out, ran.err);
    assert!(ran.out.contains("all tangents agree within 1e-7"));
    let wall = ran.out.lines().find(|l| l.trim_start().starts_with("wall") && l.contains("false")).unwrap();
    assert!(!wall.contains("false 0 ") && !wall.ends_with("true 0"), "{wall}");
}

#[test]
fn explain_prints_pages_and_refuses_other_words() {
    let folder = Folder::new("explain");
    let page = wfl(&folder.0, &["explain", "e402"]);
    assert!(page.code == 0 && page.out.starts_with("E402: ") && page.out.contains("Right:"), "{}", page.out);
    assert!(wfl(&folder.0, &["explain", "--list"]).out.lines().count() > 50);
    let page = wfl(&folder.0, &["explain", "nitsche_force"]).out;
    assert!(page.starts_with("`nitsche_force` is a macro of the library: use \"contact\"\n"), "{page}");
    assert!(page.contains("trial pressure") && page.contains("contact_force(gamma*"), "{page}");
    assert!(!page.contains("def nitsche_with_gap"), "{page}");
    assert_eq!(wfl(&folder.0, &["explain", "E999"]).code, 1);
}

#[test]
fn fmt_changes_files_once() {
    let folder = Folder::new("fmt");
    let file = folder.write("rod.wfl", ROD.replace("k*Grad_u.Grad_Test_u", "k * Grad_u   .Grad_Test_u # kept"));
    let check = wfl(&folder.0, &["fmt", "--check", "rod.wfl"]);
    assert_eq!((check.code, check.out.as_str()), (1, "rod.wfl would change\n"));
    assert_eq!(wfl(&folder.0, &["fmt", "rod.wfl"]).code, 0);
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(text.contains("# kept") && !text.contains("   ."), "{text}");
    assert_eq!(wfl(&folder.0, &["fmt", "--check", "rod.wfl"]).code, 0);
    let bad = folder.write("bad.wfl", "mesh box [0 to\n");
    assert_eq!(wfl(&folder.0, &["fmt", "bad.wfl"]).code, 1);
    assert_eq!(std::fs::read_to_string(bad).unwrap(), "mesh box [0 to\n");
    // nothing else is left in the folder
    assert_eq!(std::fs::read_dir(&folder.0).unwrap().count(), 2);
}

#[test]
fn an_imported_form_checks() {
    let folder = Folder::new("import");
    let form = "(2*mu*Sym(Grad_Test2_u) + lambda*Trace(Grad_Test2_u)*Id(2)):Grad_Test_u";
    let text = wfl(&folder.0, &["import", form]);
    assert_eq!(text.code, 0, "{}", text.err);
    let scene = format!("{}mesh box [0,0] to [1,1] cells [2,2] quad\n", text.out);
    folder.write("elastic.wfl", scene);
    let checked = wfl(&folder.0, &["check", "elastic.wfl", "--json"]);
    assert_eq!(checked.code, 0, "{}{}", text.out, checked.err);
    let all: Value = serde_json::from_str(&checked.out).unwrap();
    assert_eq!((&all["fields"][0]["dofs"], &all["terms"][0]["class"]), (&18.into(), &"linear".into()));
    let bad = wfl(&folder.0, &["import", "Grad_u.(Grad_Test_u"]);
    assert!(bad.code == 1 && bad.err.contains("(assembly string):1:"), "{}", bad.err);
}

#[test]
fn a_closed_pipe_is_no_panic() {
    let folder = Folder::new("pipe");
    folder.write("contact.wfl", CONTACT);
    let mut child = Command::new(env!("CARGO_BIN_EXE_wfl"))
        .current_dir(&folder.0)
        .args(["show", "contact.wfl", "clif"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // closed before anything is written
    drop(child.stdout.take());
    let ended = child.wait_with_output().unwrap();
    assert!(ended.status.code().is_some(), "{ended:?}");
    assert!(ended.stderr.is_empty(), "{}", String::from_utf8_lossy(&ended.stderr));
}

/// Knobs do the same in any order, and none takes away what another one says without a word.
#[test]
fn knobs_go_together_or_are_refused() {
    let folder = crate::common::Folder::new("knobs");
    let scene = "param n = 4\nparam m = 2*n\nmesh box [0] to [1] cells [m]\nunknown u : scalar\n\
        term f on all : u*Test_u - x*Test_u\nmeasure s = integral(u) on all\n";
    folder.write("s.wfl", scene);
    let cells = |words: &[&str]| -> u64 {
        let told = folder.wfl(&[&["check", "s.wfl", "--json"], words].concat());
        let told: serde_json::Value = serde_json::from_slice(&told.stdout).expect("JSON");
        told["mesh"][0]["cells"].as_u64().expect("a number")
    };
    assert_eq!([cells(&["refine=2", "h=0.25"]), cells(&["h=0.25", "refine=2"])], [8, 8]);
    assert_eq!([cells(&["refine=2", "cells=3"]), cells(&["n=3", "refine=2"])], [6, 12]);
    for command in ["run", "check", "sweep"] {
        for (words, why) in [
            (["h=0.5", "cells=4"], "both say how the mesh is divided"),
            (["n=4", "cells=4"], "the division of the mesh, which reads `n`"),
            (["cells=4", "m=4"], "the division of the mesh, which reads `m`"),
            (["degree=2", "degree=1"], "knob `degree` is given twice"),
        ] {
            let out = folder.wfl(&[&[command, "s.wfl"], &words[..]].concat());
            let told = String::from_utf8_lossy(&out.stderr).into_owned();
            assert!(out.status.code() == Some(1) && told.contains(why), "{command} {words:?}: {told}");
        }
    }
}

/// Messages name what is there, and nothing that follows from another error alone.
#[test]
fn messages_name_what_is_there() {
    let folder = crate::common::Folder::new("named");
    let told = |text: &str, words: &[&str]| {
        folder.write("s.wfl", text);
        let out = folder.wfl(words);
        String::from_utf8_lossy(&out.stderr).into_owned()
    };
    let head = "mesh box [0] to [1] cells [2]\nunknown u : scalar\nsteps t = 0 to 1 by 0.5\n";
    // a broken term is told once, not as one that is not there
    let waves = format!(
        "{head}term in on all : Dot2_u*Test_u\nterm s on all : Grad_u.Grad_Test_u\nstart Dot_u = x\nscheme explicit\n"
    );
    let broken = told(&waves, &["check", "s.wfl"]);
    assert!(broken.contains("E207") && !broken.contains("E454") && !broken.contains("E457"), "{broken}");
    let measure =
        format!("{head}term f on all : u*Test_u - t*Test_u\nmeasure s = mean(u) on all\nmeasure r = s - Previous_s\n");
    let of_measure = told(&measure, &["check", "s.wfl"]);
    assert!(of_measure.contains("E106") && of_measure.contains("`s` is a number of the run"), "{of_measure}");
    let line = told("", &["plot", "nowhere", "--line", "0,0:0,0"]);
    assert!(line.contains("both ends are one point"), "{line}");
}

/// A bar and a spring that is pulled: its parameters far from their values, within their ranges and outside.
const EXTREMES: &str = "mesh box [0] to [1] cells [2] segment\nparam k = 10 in 1..1e9\nregion east = faces where x == 1\n\
    region west = faces where x == 0\nunknown u : scalar\nterm bar on all : Grad_u.Grad_Test_u + 0.1*u^3*Test_u\n\
    term spring on east : k*u*Test_u\nfix u = 0 on west\nload u = 1 on east\nmeasure end = max(u) on east\n\
    expect end > 1e-3\n";

#[test]
fn extremes_gives_a_verdict_a_row_and_keeps_to_its_time() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("extremes");
    std::fs::create_dir_all(&folder).expect("a folder");
    std::fs::write(folder.join("bar.wfl"), EXTREMES).expect("a scene");
    let run = |words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_wfl"));
        let output = command.current_dir(&folder).args(["extremes", "bar.wfl"]).args(words).output().expect("wfl runs");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (text(&output.stdout), text(&output.stderr), output.status.code())
    };
    let (table, progress, code) = run(&[]);
    assert_eq!(code, Some(0), "{table}");
    // below 1 the range forbids, 1e4 and 1e7 are allowed, and the end moves less than expected
    assert!(table.contains("2 outside its range, 1 solved, 2 solved, not as expected\nno failure"), "{table}");
    assert!(table.contains("does not hold: end > 1e-3; end = 9.99"), "{table}");
    assert!(progress.contains("5 of 5: k=1e7: solved, not as expected ("), "{progress}");
    let (table, _, code) = run(&["--limit", "1e-9"]);
    assert_eq!(code, Some(2), "{table}");
    assert!(table.contains("first failure: as written: out of time: more than 0 s; --limit allows more"), "{table}");
}
