//! How long a keystroke takes: from the change of the text to its messages, and what an editor asks for behind it.

mod common;

use std::time::{Duration, Instant};

use common::{Editor, example};
use serde_json::json;

/// The examples with the longest texts, the longest forms and the most macros.
const LARGEST: &[&str] = &[
    "crack/compression.wfl",
    "friction/weakening.wfl",
    "signorini/signorini.wfl",
    "hyperelastic/contact.wfl",
    "hertz/blocks.wfl",
    "fault_gmsh/fault_30deg_augmented_lagrangian.wfl",
];

/// Keystrokes of which the median is taken.
const STROKES: usize = 21;

/// A keystroke is answered within this in a release build, on a machine with a free core; others have ten times as long.
const LIMIT: Duration = Duration::from_millis(10);

/// The median of the times from a keystroke to its messages, and to the colours, hints and offers that follow.
fn stroke(e: &mut Editor, name: &str, text: &str) -> (Duration, Duration) {
    e.open(name, text);
    e.next_messages(name);
    // the check that knows the mesh
    e.ask("workspace/executeCommand", json!({"command": "wfl.check", "arguments": [e.uri(name)]}));
    let shown = e.shown.len();
    while e.shown.len() == shown {
        e.receive();
    }
    let (mut told, mut asked) = (Vec::new(), Vec::new());
    for k in 0..STROKES {
        let typed = format!("{text}def typed = 1{}\n", "0".repeat(k));
        let begin = Instant::now();
        e.change(name, &typed);
        e.next_messages(name);
        told.push(begin.elapsed());
        let begin = Instant::now();
        e.ask_of("textDocument/semanticTokens/full", name);
        e.ask_of("textDocument/inlayHint", name);
        e.ask_at("textDocument/completion", name, "def typed = 1", 13);
        asked.push(begin.elapsed());
    }
    told.sort();
    asked.sort();
    (told[STROKES / 2], asked[STROKES / 2])
}

#[test]
fn a_keystroke_in_the_largest_examples_takes_less_than_ten_milliseconds() {
    let mut e = Editor::new("speed");
    let limit = if cfg!(debug_assertions) { LIMIT * 10 } else { LIMIT };
    for beside in ["fault_gmsh/common.wfl", "fault_gmsh/fault_30deg.msh"] {
        e.copy(beside);
    }
    for path in LARGEST {
        let name = path.rsplit('/').next().unwrap_or(path);
        let (told, asked) = stroke(&mut e, name, &example(path));
        eprintln!("{path}: messages {told:.1?}, colours, hints and offers {asked:.1?}");
        assert!(told < limit && asked < limit, "{path}: {told:?}, {asked:?}");
        e.tell("textDocument/didClose", json!({"textDocument": {"uri": e.uri(name)}}));
    }
    e.close();
}
