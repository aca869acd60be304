//! Messages while typing: all of a file, at their places, with cures.

use std::collections::BTreeSet;

use crate::common::{Editor, example};
use serde_json::{Value, json};

/// A scene with a mistake in each line that ends in a `#`.
const MISTAKES: &str = "\
wfl 1
mesh box [0,0] to [1,1] cells [8,8] quad
param E = 1000
param nu = 0.3 in 0..0.49
param big = 2 in 0..1 #
param number = 1d5 #
parm other = 2 #
region left = faces where x == 0
region right = faces where x = 1 #
region top = cels where y == 1 #
unknown u : vector
unknown p : scaler #
def sigma(v) = E*Div_v*Id(2) + E*Sym(Grad_v)
def twice = E**2 #
def open = (E + 1 #
term elastic on all : sigma(u):Grad_Test_u
term t1 on lefft : u.Test_u #
term t2 on left : u*Test_u #
term t3 on left : gama*u.Test_u #
term t4 on all : sigma(u).Grad_Test_u #
term t5 on all : (u.Normal)*Test_u(1) #
fix u == [0,0] on left #
fix w = 0 on left #
load u = 1 on left #
steps s = 0 to 1 by 0.1 wit halve=2 #
solver newton with toll=1e-8 #
measure m1 = mean(u(3)) on left #
measure m2 = avg(u(1)) on left #
output vtk \"x\" : u, sin(u(1), 1) as q #
expect nowhere < 1 #
";

fn lines_of(messages: &[Value]) -> BTreeSet<u64> {
    messages.iter().filter_map(|m| m["range"]["start"]["line"].as_u64()).collect()
}

#[test]
fn a_file_with_twenty_mistakes_shows_twenty_places() {
    let mut e = Editor::new("twenty");
    e.open("scene.wfl", MISTAKES);
    let wrong: BTreeSet<u64> = (0u64..).zip(MISTAKES.lines()).filter(|l| l.1.ends_with('#')).map(|l| l.0).collect();
    assert!(wrong.len() >= 20);
    let messages = e.next_messages("scene.wfl");
    assert_eq!(lines_of(&messages), wrong, "{messages:#?}");
    for m in &messages {
        assert_eq!(m["source"], "wfl");
        assert_eq!(m["severity"], 1);
        assert!(m["code"].as_str().is_some_and(|c| c.starts_with('E')));
        assert_ne!(m["range"]["start"], m["range"]["end"], "{m}");
    }
    // the problem cannot be made either; the second round of messages knows no less
    let messages = e.messages_when("scene.wfl", |m| lines_of(m) == wrong);
    assert!(messages.len() >= 20);
    e.close();
}

#[test]
fn a_cure_is_offered_and_takes_its_message_away() {
    let mut e = Editor::new("cures");
    e.open("scene.wfl", MISTAKES);
    let mut cured = 0;
    loop {
        let before = e.next_messages("scene.wfl");
        let actions = e.ask_of("textDocument/codeAction", "scene.wfl");
        let actions = actions.as_array().cloned().unwrap_or_default();
        let Some(action) = actions.first() else { break };
        assert_eq!(action["kind"], "quickfix");
        let text = e.changed("scene.wfl", &action["edit"]["changes"][e.uri("scene.wfl")]);
        e.change("scene.wfl", &text);
        cured += 1;
        assert!(cured < 50, "{before:#?}\n{text}");
    }
    for right in ["param number = 1e5", "param other", ": scalar", "E^2", "on left : u.Test_u", "fix u = ", "tol=1e-8"]
    {
        assert!(e.text("scene.wfl").contains(right), "{right}: {}", e.text("scene.wfl"));
    }
    assert!(cured >= 8, "{cured} cures");
    e.close();
}

#[test]
fn messages_follow_every_change_and_end_with_the_text() {
    const RIGHT: &str = "\
mesh box [0,0] to [1,1] cells [4,4] quad
region left = faces where x == 0
unknown u : vector
term elastic on all : Grad_u:Grad_Test_u
fix u = [0,0] on left
load u = [0,-1] on all
";
    let mut e = Editor::new("follow");
    e.open("scene.wfl", RIGHT);
    assert_eq!(e.next_messages("scene.wfl"), Vec::<Value>::new());
    e.change("scene.wfl", &RIGHT.replace(":Grad_Test_u", ".Grad_Test_u"));
    let wrong = e.messages_when("scene.wfl", |m| m.len() == 1);
    assert_eq!(
        (&wrong[0]["code"], &wrong[0]["range"]["start"]),
        (&json!("E103"), &json!({"line": 3, "character": 22}))
    );
    // what needs the mesh comes when the text has stayed as it is: nothing holds the body
    e.change("scene.wfl", &RIGHT.replace("x == 0", "x == 2"));
    let late =
        e.messages_when("scene.wfl", |m| m.iter().any(|m| m["code"] == "E410" || m["range"]["start"]["line"] == 1));
    assert!(!late.is_empty());
    e.change("scene.wfl", RIGHT);
    e.messages_when("scene.wfl", <[Value]>::is_empty);
    e.tell("textDocument/didClose", json!({"textDocument": {"uri": e.uri("scene.wfl")}}));
    e.messages_when("scene.wfl", <[Value]>::is_empty);
    e.close();
}

#[test]
fn an_unused_name_is_shown_as_such_and_can_be_deleted() {
    let mut e = Editor::new("unused");
    let text = "mesh box [0] to [1] cells [4] segment\nparam spare = 1\nunknown u : scalar\nterm a on all : u*Test_u - Test_u\n";
    e.open("scene.wfl", text);
    let told = e.messages_when("scene.wfl", |m| m.len() == 1);
    assert_eq!((&told[0]["code"], &told[0]["severity"], &told[0]["tags"]), (&json!("W702"), &json!(2), &json!([1])));
    let actions = e.ask_of("textDocument/codeAction", "scene.wfl");
    assert_eq!(actions[0]["title"], "Delete the statement");
    assert!(!e.changed("scene.wfl", &actions[0]["edit"]["changes"][e.uri("scene.wfl")]).contains("spare"));
    e.close();
}

#[test]
fn texts_of_any_kind_are_answered() {
    let mut e = Editor::new("any");
    let texts = [
        "",
        "\n",
        "term",
        "  x",
        "use \"",
        "use \"none.wfl\"\n",
        "param größe = 1\nterm on all : \u{1d6fe}\n",
        "((((",
        "def f(",
        "\u{feff}wfl 1\r\nmesh",
    ];
    for (k, text) in texts.iter().enumerate() {
        let name = format!("text{k}.wfl");
        e.open(&name, text);
        e.next_messages(&name);
        for method in ["documentSymbol", "semanticTokens/full", "inlayHint", "codeLens", "foldingRange", "codeAction"] {
            e.ask_of(&format!("textDocument/{method}"), &name);
        }
        let uri = e.uri(&name);
        for character in 0..6 {
            let position = json!({"line": 0, "character": character});
            for method in ["hover", "completion", "definition", "signatureHelp", "prepareRename"] {
                let params = json!({"textDocument": {"uri": uri}, "position": position});
                // a refusal is an answer, too
                e.tell_and_wait(&format!("textDocument/{method}"), params);
            }
        }
    }
    e.close();
}

#[test]
fn a_mistake_in_a_file_that_a_scene_uses_is_shown_in_that_file() {
    let mut e = Editor::new("used");
    let fault = example("fault/fault.wfl");
    let wrong = fault.replace("def trac(v)   = sigma(v)*Normal", "def trac(v)   = sigma(v)*");
    e.write("fault.wfl", &wrong);
    e.open("nitsche.wfl", &example("fault/nitsche.wfl"));
    // the file is not open, and what it would have declared is not called unknown
    let told = e.messages_when("fault.wfl", |m| m.len() == 1);
    assert_eq!(told[0]["range"]["start"]["line"], 28);
    e.messages_when("nitsche.wfl", <[Value]>::is_empty);
    e.open("fault.wfl", &fault);
    e.messages_when("fault.wfl", <[Value]>::is_empty);
    e.change("fault.wfl", &fault.replace("def tang(w)", "def along(w)"));
    let told = e.messages_when("nitsche.wfl", |m| !m.is_empty());
    assert!(told.iter().any(|m| m["message"].as_str().is_some_and(|t| t.contains("tang"))), "{told:#?}");
    e.change("fault.wfl", &fault);
    e.messages_when("nitsche.wfl", <[Value]>::is_empty);
    // without the open text the one on disc counts again
    e.tell("textDocument/didClose", json!({"textDocument": {"uri": e.uri("fault.wfl")}}));
    e.messages_when("fault.wfl", |m| m.len() == 1);
    e.close();
}

/// Mistakes of newcomers, `CODE LINE | a part of the message` and the lines that are added to a scene that is right, or a
/// whole scene.
const TABLE: &str = include_str!("../../../tests/tests/mistakes/table.txt");

const SCENE: &str = include_str!("../../../tests/tests/mistakes/scene.wfl");

#[test]
fn a_sixth_of_the_mistakes_of_newcomers_is_mended_by_the_first_fix() {
    let errors = |list: &[Value]| list.iter().filter(|m| m["severity"] == 1).count();
    let mut e = Editor::new("newcomers");
    e.open("scene.wfl", SCENE);
    assert_eq!(e.next_messages("scene.wfl"), Vec::<Value>::new());
    let (mut mended, mut all) = (0, 0);
    for entry in TABLE.split("\n\n").map(str::trim_end).filter(|t| !t.is_empty()) {
        let (head, text) = entry.split_once('\n').expect("a head and a text");
        let whole = head.split(" | ").next().is_some_and(|place| place.ends_with(" whole"));
        let scene = if whole { format!("{text}\n") } else { format!("{SCENE}{text}\n") };
        all += 1;
        e.change("scene.wfl", &scene);
        let before = errors(&e.next_messages("scene.wfl"));
        let actions = e.ask_of("textDocument/codeAction", "scene.wfl");
        // positions of texts that are not ASCII are those of the session; here only the others are changed
        if !scene.is_ascii() || actions[0].is_null() {
            continue;
        }
        let mended_text = e.changed("scene.wfl", &actions[0]["edit"]["changes"][e.uri("scene.wfl")]);
        e.change("scene.wfl", &mended_text);
        mended += usize::from(errors(&e.next_messages("scene.wfl")) < before);
    }
    assert!(all > 290 && mended >= all / 6, "{mended} of {all}");
    eprintln!("{mended} of {all} mistakes are mended by their first fix");
    e.close();
}
