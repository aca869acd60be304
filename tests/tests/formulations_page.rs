//! Every formulation on the page is a scene that solves, without a word, to its closed form.

use std::{fs, path::Path};

use wfl_tests::{Attempt, attempt, doubts};

fn page() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/formulations.md");
    fs::read_to_string(path).expect("the page is in the repository")
}

/// A scene on the page.
struct Block {
    name: String,
    /// The code of the warning that the page announces.
    warning: Option<String>,
    text: String,
}

/// The blocks of scene text on the page; behind "```wfl" stand the name and the warning that is to be given.
fn blocks(page: &str) -> Vec<Block> {
    let mut found = Vec::new();
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        if let Some(head) = line.strip_prefix("```wfl ") {
            let text = lines.by_ref().take_while(|l| *l != "```").flat_map(|l| [l, "\n"]).collect();
            let mut words = head.split(' ').map(str::to_owned);
            found.push(Block { name: words.next().unwrap_or_default(), warning: words.next(), text });
        }
    }
    found
}

#[test]
fn every_formulation_gives_its_closed_form() {
    let folder = std::env::temp_dir().join(format!("wfl-formulations-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a temporary folder");
    let blocks = blocks(&page());
    let (base, methods) = blocks.split_first().expect("the page has scenes");
    assert_eq!(base.name, "base");
    assert!(methods.len() >= 10, "only {} formulations", methods.len());
    fs::write(folder.join("column.wfl"), &base.text).expect("a temporary file");
    let mut failures = Vec::new();
    for Block { name, warning, text } in methods {
        let thetas: &[(&str, f64)] = &[("theta", -1.0), ("theta", 0.0), ("theta", 1.0)];
        let runs = if text.contains("param theta") { thetas } else { &[] };
        let runs = if runs.is_empty() { vec![&[][..]] } else { runs.chunks(1).collect() };
        for params in runs {
            let Attempt { solved, messages } = attempt(&folder, text.clone(), &[], params);
            let announced = |told: &str| warning.as_ref().is_some_and(|w| told.contains(w.as_str()));
            if !messages.is_empty() && !announced(&messages) {
                failures.push(format!("{name} {params:?}: {messages}"));
            }
            let Some(solved) = solved else { continue };
            let outcome = solved.outcome;
            assert!(!outcome.expectations.is_empty(), "{name} expects nothing");
            let wrong = outcome.expectations.iter().filter(|(_, holds)| *holds != Some(true));
            failures.extend(wrong.map(|(e, _)| format!("{name} {params:?}: does not hold: {}", e.text)));
            let doubts = doubts(&outcome);
            let unannounced = doubts.iter().filter(|(code, _)| !announced(code));
            failures.extend(unannounced.map(|(code, w)| format!("{name} {params:?}: {code}: {w}")));
            if warning.is_some() && !doubts.iter().any(|(code, _)| announced(code)) && !announced(&messages) {
                failures.push(format!("{name} {params:?}: {warning:?} is not given"));
            }
            if !outcome.converged() {
                failures.push(format!("{name} {params:?}: not converged"));
            }
        }
    }
    fs::remove_dir_all(&folder).expect("our own folder");
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn every_macro_of_the_standard_library_is_on_the_page() {
    let page = page();
    for file in ["contact", "elasticity", "polar", "poro", "sliding"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../wfl/std/{file}.wfl"));
        let text = fs::read_to_string(path).expect("the library is in the repository");
        for line in text.lines() {
            let Some(head) = line.strip_prefix("def ") else { continue };
            let head = head.split('=').next().unwrap_or_default().trim();
            assert!(page.contains(&format!("| `{head}` |")), "docs/formulations.md lacks `{head}` of {file}.wfl");
        }
    }
}
