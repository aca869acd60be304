//! A session of an editor with the server over its pipes: what it is told, and what it gets when it asks.

use crate::common::{Editor, example};
use serde_json::{Value, json};

/// An editor in which a scene and the file that it uses are open.
fn with_fault(name: &str) -> Editor {
    let mut editor = Editor::new(name);
    for file in ["fault.wfl", "nitsche.wfl", "penalty.wfl"] {
        editor.write(file, &example(&format!("fault/{file}")));
    }
    editor.open("nitsche.wfl", &example("fault/nitsche.wfl"));
    editor.open("fault.wfl", &example("fault/fault.wfl"));
    editor
}

fn hover(editor: &mut Editor, file: &str, needle: &str, by: u64) -> String {
    editor.ask_at("textDocument/hover", file, needle, by)["contents"]["value"].as_str().unwrap_or("").to_owned()
}

/// `file:line` of places, lines from 0.
fn places(list: &Value) -> Vec<String> {
    let list = list.as_array().cloned().unwrap_or_default();
    let place = |l: &Value| {
        let file = l["uri"].as_str().unwrap_or("").rsplit('/').next().unwrap_or("").to_owned();
        format!("{file}:{}", l["range"]["start"]["line"])
    };
    list.iter().map(place).collect()
}

fn labels(list: &Value) -> Vec<String> {
    let list = list.as_array().cloned().unwrap_or_default();
    list.iter().map(|i| i["label"].as_str().unwrap_or("").to_owned()).collect()
}

#[test]
fn what_is_under_the_cursor_is_explained() {
    let mut e = with_fault("hover");
    for (file, needle, by, expected) in [
        ("fault.wfl", "param E", 6, &["param E     = 25000", "value 25000", "Young modulus"][..]),
        ("nitsche.wfl", "gamma*(jump", 1, &["value 100000", "above 1.7 E/h"]),
        ("fault.wfl", "unknown uL", 8, &["unknown uL : vector on left", "unknown vector(3)"]),
        (
            "nitsche.wfl",
            "trac(uL).Normal",
            1,
            &["def trac(v)", "vector(3)", "linear in the unknowns", "Declared in fault.wfl"],
        ),
        ("fault.wfl", "sigma(v)*Normal", 10, &["`Normal`: outward unit normal", "vector(3)"]),
        ("fault.wfl", "Grad_v", 1, &["`Grad_`: gradient", "`v` is a parameter"]),
        ("fault.wfl", "term elastic on left", 1, &["term [name] on r : expr", "residual"]),
        ("nitsche.wfl", "Ball_projection", 3, &["Ball_projection(v, r)", "projection on the ball", "with kinks"]),
        (
            "nitsche.wfl",
            "pos_part(Pn)*Normal",
            12,
            &["`pos_part(Pn)*Normal`: vector(3), nonlinear in the unknowns, with kinks"],
        ),
        ("fault.wfl", "Sym(Grad_v)", 0, &["Sym(M)", "matrix(3,3)"]),
        ("fault.wfl", "steps t", 0, &["steps t = a to b by c", "Default: one solve."]),
        ("fault.wfl", "region fault", 8, &["interface from left to right"]),
        ("fault.wfl", "sigma(uL):Grad_Test_uL", 9, &["scalar, linear in the unknowns, linear in a test function"]),
    ] {
        let told = hover(&mut e, file, needle, by);
        for part in expected {
            assert!(told.contains(part), "{needle}: {part} is not in\n{told}");
        }
    }
    assert_eq!(hover(&mut e, "fault.wfl", "# The slipping", 4), "");
    e.close();
}

#[test]
fn macros_of_the_library_come_with_their_comment() {
    let mut e = Editor::new("library");
    e.open("fault.wfl", wfl::TEMPLATES.iter().find(|t| t.kind == "fault").expect("a template").text);
    let told = hover(&mut e, "fault.wfl", "nitsche(uL", 2);
    for part in ["def nitsche(a, b, gamma, theta, friction)", "trial pressure P^n", "Of the library", "with kinks"] {
        assert!(told.contains(part), "{part} is not in\n{told}");
    }
    let found = e.ask_at("textDocument/definition", "fault.wfl", "nitsche(uL", 2);
    assert_eq!(found[0]["uri"], "wfl-library:/contact.wfl");
    let position = e.at("fault.wfl", "nitsche(uL", 2);
    let named = json!({"textDocument": {"uri": e.uri("fault.wfl")}, "position": position, "newName": "method"});
    assert!(e.refused("textDocument/rename", named).contains("of the library"));
    e.close();
}

#[test]
fn names_lead_to_their_declarations_and_uses_across_files() {
    let mut e = with_fault("navigate");
    let found = e.ask_at("textDocument/definition", "nitsche.wfl", "trac(uL).Normal", 2);
    assert_eq!(places(&found), ["fault.wfl:28"]);
    let found = e.ask_at("textDocument/definition", "nitsche.wfl", "term stress  on fault", 18);
    assert_eq!(places(&found), ["fault.wfl:16"]);
    let found = e.ask_at("textDocument/definition", "nitsche.wfl", "use \"fault.wfl\"", 8);
    assert_eq!(places(&found), ["fault.wfl:0"]);
    let found = e.ask_at("textDocument/definition", "fault.wfl", "Grad_v", 5);
    assert_eq!(places(&found), ["fault.wfl:27"]);
    let found = e.ask_at("textDocument/definition", "nitsche.wfl", "Ball_projection", 2);
    assert_eq!(found, Value::Null);
    // `theta` is known in one scene only, `fric` in all that use the file
    let found = e.ask_at("textDocument/references", "nitsche.wfl", "param theta", 7);
    assert_eq!(places(&found), ["nitsche.wfl:5", "nitsche.wfl:10", "nitsche.wfl:13"]);
    let found = places(&e.ask_at("textDocument/references", "fault.wfl", "param fric", 7));
    assert!(found.contains(&"fault.wfl:8".to_owned()) && found.contains(&"nitsche.wfl:11".to_owned()), "{found:?}");
    assert!(found.iter().any(|f| f.starts_with("penalty.wfl")), "{found:?}");
    let found = e.ask_at("textDocument/documentHighlight", "fault.wfl", "def tang(w)", 9);
    assert_eq!(found.as_array().map(Vec::len), Some(3));
    e.close();
}

#[test]
fn a_name_is_changed_everywhere_or_not_at_all() {
    let mut e = with_fault("rename");
    let range = e.ask_at("textDocument/prepareRename", "nitsche.wfl", "# Slipping", 4);
    assert_eq!(range, Value::Null);
    let range = e.ask_at("textDocument/prepareRename", "nitsche.wfl", "Test_uL", 6);
    assert_eq!(range["placeholder"], "uL");
    let uri = e.uri("nitsche.wfl");
    let position = e.at("nitsche.wfl", "Test_uL", 6);
    let named = |new: &str| json!({"textDocument": {"uri": uri}, "position": position, "newName": new});
    let changes = e.ask("textDocument/rename", named("left_u"))["changes"].clone();
    let files: Vec<String> = changes.as_object().expect("changes").keys().cloned().collect();
    assert_eq!(files.len(), 3, "{files:?}");
    for file in ["nitsche.wfl", "fault.wfl"] {
        let text = e.changed(file, &changes[e.uri(file)]);
        assert!(!text.contains("uL") && text.contains("left_u"), "{text}");
        e.change(file, &text);
    }
    // the scene is as right as before
    e.messages_when("nitsche.wfl", <[Value]>::is_empty);
    e.messages_when("fault.wfl", <[Value]>::is_empty);
    assert!(e.text("nitsche.wfl").contains("Test_left_u"));
    // `Pn` is declared in two scenes, and used in the file between them
    let position = e.at("nitsche.wfl", "def Pn", 5);
    let named = json!({"textDocument": {"uri": uri}, "position": position, "newName": "pressure"});
    let changes = e.ask("textDocument/rename", named)["changes"].clone();
    assert_eq!(changes.as_object().map(serde_json::Map::len), Some(3), "{changes}");
    let position = e.at("nitsche.wfl", "Test_left_u", 7);
    for (new, why) in
        [("uR", "declared already"), ("on", "a word of the language"), ("2u", "no name"), ("sin", "built-in")]
    {
        let named = json!({"textDocument": {"uri": uri}, "position": position, "newName": new});
        let told = e.refused("textDocument/rename", named);
        assert!(told.contains(why), "{new}: {told}");
    }
    let position = e.at("nitsche.wfl", "Ball_projection", 2);
    let told = e
        .refused("textDocument/rename", json!({"textDocument": {"uri": uri}, "position": position, "newName": "ball"}));
    assert!(told.contains("word of the language"), "{told}");
    e.close();
}

/// A name is not changed where a word would then mean something else: a parameter of a macro would take it, or be taken.
#[test]
fn a_name_that_would_change_the_meaning_is_refused() {
    let mut e = Editor::new("capture");
    let scene = "wfl 1\nparam E = 10\nmesh box [0] to [1] cells [4]\nregion left = faces where x == 0\n\
        unknown u : scalar\ndef sig(w, a) = a*E*Grad_w\nterm el on all : sig(u, 2).Grad_Test_u\nfix u = 0 on left\n\
        load u = 1 on all\nmeasure m = integral(u) on all\nevent e = m > 0.01\nexpect e_count == 1\n";
    e.open("s.wfl", scene);
    let uri = e.uri("s.wfl");
    for (needle, by, new, why) in [
        ("param E", 6, "a", "`E` on line 6 of s.wfl would be another one: parameter of a def"),
        ("param E", 6, "w", "parameter of a def"),
        ("w, a)", 3, "E", "would be another one"),
        ("w, a)", 3, "w", "declared already"),
        ("param E", 6, "y", "a coordinate"),
        ("unknown u", 8, "x", "a coordinate"),
        ("param E", 6, "timestep", "built in"),
        ("param E", 6, "e_count", "would be another one"),
        ("event e", 6, "begin", "e_count"),
    ] {
        let position = e.at("s.wfl", needle, by);
        let named = json!({"textDocument": {"uri": uri}, "position": position, "newName": new});
        let told = e.refused("textDocument/rename", named);
        assert!(told.contains(why), "{needle} {new}: {told}");
    }
    for (needle, by, new) in [("param E", 6, "y2"), ("w, a)", 0, "u"), ("def sig", 4, "sigma_of"), ("term el", 5, "m")]
    {
        let position = e.at("s.wfl", needle, by);
        let named = json!({"textDocument": {"uri": uri}, "position": position, "newName": new});
        let changes = e.ask("textDocument/rename", named)["changes"].clone();
        assert!(e.changed("s.wfl", &changes[uri.as_str()]).contains(new), "{new}");
    }
    e.close();
}

#[test]
fn what_can_stand_at_the_cursor_is_offered() {
    let mut e = with_fault("complete");
    let text = format!("{}te\nterm more on fa : pos\nfix uL = 0 on we\nuse \"\n", example("fault/nitsche.wfl"));
    e.change("nitsche.wfl", &text);
    let offered = labels(&e.ask_at("textDocument/completion", "nitsche.wfl", "te\nterm more", 2));
    assert!(["term", "measure", "steps"].iter().all(|w| offered.contains(&(*w).to_owned())), "{offered:?}");
    let offered = labels(&e.ask_at("textDocument/completion", "nitsche.wfl", "on fa : pos", 5));
    assert_eq!(
        offered,
        ["all", "bottom", "boundary", "east", "fault", "global", "interior", "left", "right", "top", "west"]
    );
    let list = e.ask_at("textDocument/completion", "nitsche.wfl", "on fa : pos", 11);
    let offered = labels(&list);
    for name in ["pos_part", "trac", "uL", "Grad_Test_uR", "gamma", "Normal", "Ball_projection", "t"] {
        assert!(offered.contains(&name.to_owned()), "{name}: {offered:?}");
    }
    // parameters of other macros are not known here
    assert!(!offered.contains(&"Grad_v".to_owned()));
    let jump = list.as_array().and_then(|l| l.iter().find(|i| i["label"] == "jump")).cloned().unwrap_or_default();
    assert_eq!(jump["labelDetails"]["detail"], "(a, b)");
    assert_eq!(jump["insertText"], "jump(${1:a}, ${2:b})");
    assert!(jump["documentation"]["value"].as_str().is_some_and(|d| d.contains("Interpolate(b, neighbor_element)")));
    let offered = labels(&e.ask_at("textDocument/completion", "nitsche.wfl", "use \"\n", 5));
    assert!(offered.contains(&"penalty.wfl".to_owned()) && offered.contains(&"contact".to_owned()), "{offered:?}");
    let help = e.ask_at("textDocument/signatureHelp", "nitsche.wfl", "jump(Test_uL,Test_uR)", 14);
    assert_eq!(help["signatures"][0]["label"], "jump(a,b)");
    assert_eq!(help["activeParameter"], 1);
    e.close();
}

#[test]
fn a_text_is_outlined_coloured_and_annotated() {
    let mut e = with_fault("outline");
    let symbols = e.ask_of("textDocument/documentSymbol", "nitsche.wfl");
    let names: Vec<&str> = symbols.as_array().expect("symbols").iter().filter_map(|s| s["name"].as_str()).collect();
    assert_eq!(names[..6], ["wfl 1", "use \"fault.wfl\"", "theta", "gamma", "Pn", "Pt"]);
    let folds = e.ask_of("textDocument/foldingRange", "nitsche.wfl");
    assert_eq!(folds[0]["endLine"], 2, "{folds}");
    let lenses = e.ask_of("textDocument/codeLens", "nitsche.wfl");
    assert_eq!(lenses[0]["command"]["command"], "wfl.run");
    assert_eq!(lenses[1]["command"]["arguments"][0], e.uri("nitsche.wfl"));
    assert_eq!(e.ask_of("textDocument/codeLens", "fault.wfl"), json!([]), "a file that others use is no scene");
    let hints = e.ask_of("textDocument/inlayHint", "fault.wfl");
    let hints: Vec<String> = hints
        .as_array()
        .expect("hints")
        .iter()
        .map(|h| format!("{}{}", h["position"]["line"], h["label"].as_str().unwrap_or("")))
        .collect();
    assert_eq!(
        hints,
        [
            "12 : scalar",
            "25 : scalar",
            "26 : scalar",
            "27 : matrix(3,3)",
            "28 : vector(3)",
            "29 : vector(3)",
            "30 : vector(3)"
        ]
    );
    let tokens = e.ask_of("textDocument/semanticTokens/full", "nitsche.wfl");
    let data: Vec<u64> = tokens["data"].as_array().expect("numbers").iter().filter_map(Value::as_u64).collect();
    // `wfl` is a keyword, so is `use`; `theta` is a constant that is declared here
    assert_eq!(data[..5], [0, 0, 3, 0, 0]);
    assert_eq!(data[5..10], [3, 0, 3, 0, 0]);
    assert_eq!(data[15..20], [0, 6, 5, 2, 5]);
    assert_eq!(data.len() % 5, 0);
    assert_eq!(e.capabilities["capabilities"]["semanticTokensProvider"]["legend"]["tokenTypes"][0], "keyword");
    e.close();
}

#[test]
fn a_check_and_a_run_are_asked_for_by_command() {
    let mut e = with_fault("command");
    let arguments = json!([e.uri("fault.wfl")]);
    e.ask("workspace/executeCommand", json!({"command": "wfl.check", "arguments": arguments}));
    while e.shown.is_empty() {
        e.receive();
    }
    assert_eq!(e.shown, ["nitsche.wfl: 0 errors, 0 warnings; 512 cells, 2088 unknowns"]);
    // what the check found is told with the region and the term
    let told = hover(&mut e, "fault.wfl", "region fault", 8);
    assert!(told.contains("64 faces with two sides"), "{told}");
    let told = hover(&mut e, "nitsche.wfl", "term contact", 1);
    assert!(told.contains("nonlinear with kinks on `fault`"), "{told}");
    let run = json!({"command": "wfl.run", "arguments": arguments});
    assert!(e.refused("workspace/executeCommand", run).contains("no program"));
    let other = json!({"command": "wfl.other", "arguments": arguments});
    assert!(e.refused("workspace/executeCommand", other).contains("there is no command"));
    assert!(e.refused("textDocument/unknown", json!({})).contains("does not answer"));
    let library = json!({"uri": "wfl-library:/contact.wfl"});
    assert!(e.ask("wfl/library", library).as_str().is_some_and(|t| t.contains("def nitsche_force")));
    e.close();
}

#[cfg(unix)]
#[test]
fn a_run_tells_how_it_ended() {
    use std::os::unix::fs::PermissionsExt as _;
    // what stands for the program says how it was called
    let program = std::env::temp_dir().join(format!("wfl-lsp-program-{}.sh", std::process::id()));
    let script =
        "#!/bin/sh\ncase \"$2\" in *good.wfl) echo first; echo \"$1 is done\";; *) echo it failed >&2; exit 2;; esac\n";
    std::fs::write(&program, script).expect("a temporary file");
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).expect("a temporary file");
    let mut e = Editor::with_words("run", &[&program]);
    for (name, shown) in [("good.wfl", "run is done"), ("bad.wfl", "it failed")] {
        e.open(name, "wfl 1\n");
        let before = e.shown.len();
        let arguments = json!([e.uri(name)]);
        e.ask("workspace/executeCommand", json!({"command": "wfl.run", "arguments": arguments}));
        while e.shown.len() == before {
            e.receive();
        }
        assert_eq!(e.shown.last().map(String::as_str), Some(shown));
    }
    e.close();
    std::fs::remove_file(program).expect("a temporary file");
}
