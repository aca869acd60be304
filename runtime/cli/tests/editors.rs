//! `wfl lsp`, `wfl completions` and `wfl man`: there with the feature `lsp`, and a line how to get them without it.

use std::{
    io::{Read as _, Write as _},
    process::{Output, Stdio},
};

use crate::common::Folder;

fn told(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_build_without_the_feature_says_in_one_line_how_to_get_it() {
    if cfg!(feature = "lsp") {
        eprintln!("skipped: this is a build with the feature");
        return;
    }
    let folder = Folder::new("no-lsp");
    for words in [&["lsp"][..], &["lsp", "--stdio"], &["completions", "fish"], &["man"]] {
        let output = folder.wfl(words);
        assert_eq!(output.status.code(), Some(1));
        let told = told(&output);
        assert_eq!(told.lines().count(), 1, "{told}");
        assert!(told.contains("cargo install --path runtime/cli"), "{told}");
        assert!(output.stdout.is_empty());
    }
}

#[test]
fn the_command_serves_an_editor_over_its_pipes() {
    if cfg!(not(feature = "lsp")) {
        eprintln!("skipped: this is a build without the feature `lsp`");
        return;
    }
    let folder = Folder::new("lsp");
    let mut server =
        folder.command(&["lsp"]).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("the server starts");
    let mut input = server.stdin.take().expect("a pipe");
    for message in [
        r#"{"jsonrpc":"2.0","id":1,"method":"initialize","params":{"capabilities":{}}}"#,
        r#"{"jsonrpc":"2.0","method":"initialized","params":{}}"#,
        r#"{"jsonrpc":"2.0","id":2,"method":"shutdown"}"#,
        r#"{"jsonrpc":"2.0","method":"exit"}"#,
    ] {
        write!(input, "Content-Length: {}\r\n\r\n{message}", message.len()).expect("the server listens");
    }
    drop(input);
    let mut text = String::new();
    server.stdout.take().expect("a pipe").read_to_string(&mut text).expect("UTF-8");
    assert!(text.contains("hoverProvider") && text.contains("\"id\":2"), "{text}");
    assert!(server.wait().expect("the server ends").success());
}

#[test]
fn completions_and_a_man_page_know_all_commands() {
    if cfg!(not(feature = "lsp")) {
        eprintln!("skipped: this is a build without the feature `lsp`");
        return;
    }
    let folder = Folder::new("shell");
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let text = String::from_utf8(folder.wfl(&["completions", shell]).stdout).expect("UTF-8");
        for word in ["extremes", "explain", "accuracy"] {
            assert!(text.contains(word), "{shell} does not know {word}");
        }
    }
    let page = String::from_utf8(folder.wfl(&["man"]).stdout).expect("UTF-8");
    assert!(page.contains(".TH wfl 1") && page.contains("Exit codes"), "{page}");
}
