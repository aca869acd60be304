//! Tests of what no text may do: overflow, hang, panic.

use super::*;
use crate::{
    render::render,
    source::SourceMap,
    testing::{Random, SCENES, codes, tree},
};

fn parse_text(text: &str) -> Vec<Diagnostic> {
    let mut sources = SourceMap::new();
    let id = sources.add("text", text);
    parse(&sources, id).diagnostics
}

#[test]
fn nesting_is_bounded_and_never_overflows() {
    for (open, middle, close) in [
        ("(", "1", ")"),
        ("[", "1", "]"),
        ("f(", "1", ")"),
        ("if a<b then 1 else ", "1", ""),
        ("if (", "a<b", ") then 1 else 1"),
        ("2^", "1", ""),
        ("-(", "1", ")"),
        ("Sym ", "a", ""),
        ("", "a", "'"),
        ("", "a", "(1)"),
        ("(if not (", "a<b", ") then 1 else 2)"),
    ] {
        let text = |n: usize| format!("{}{middle}{}", open.repeat(n), close.repeat(n));
        let small = tree(&text(20));
        assert!(small.len() > 4 || small == "1" || open.contains("if ") && open.ends_with('('), "{open}: {small}");
        for n in [1_000, 100_000] {
            let code = tree(&text(n));
            assert!(code == "E119" || code == "E122", "{open} {n}: {code}");
        }
    }
    assert_eq!(tree(&"(".repeat(100_000)), "E119");
    assert_eq!(tree(&format!("{}1", "-+".repeat(50_001))), "(-1)");
    assert_eq!(tree(&format!("if {}a<b then 1 else 2", "not ".repeat(100_001))), "(if {not {a<b}} then 1 else 2)");
    let at_limit = format!("{}1{}", "(".repeat(NESTING_LIMIT), ")".repeat(NESTING_LIMIT));
    assert_eq!(tree(&at_limit), "1");
}

#[test]
fn a_long_sum_is_flat_and_fast() {
    let text = (0..200_000).map(|i| format!("a{}*b.c", i % 10)).collect::<Vec<_>>().join(" + ");
    let mut sources = SourceMap::new();
    let id = sources.add("long", text);
    let start = std::time::Instant::now();
    let e = parse_expr(&sources, id).value.unwrap();
    let crate::ast::ExprKind::Sum(parts) = e.kind else { panic!("a sum") };
    assert_eq!(parts.len(), 200_000);
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}

#[test]
fn a_text_that_is_too_long_is_refused() {
    assert_eq!(codes(&parse_text(&" ".repeat(TEXT_LIMIT + 1))), "E125");
}

/// Random edits of the scenes and soups of their tokens: no panic, no hang, every message can be shown.
#[test]
fn no_text_panics() {
    let tokens: Vec<&str> = SCENES
        .iter()
        .flat_map(|(_, t)| t.split_inclusive(|c: char| !c.is_ascii_alphanumeric()))
        .chain(["**", "\u{2212}", "é", "\0", "\t", "\r", "\n", "\n ", "..", "if ", "then ", "not ", "'", "\"", "Sym "])
        .collect();
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let lines: Vec<&str> = SCENES.iter().flat_map(|(_, t)| t.lines()).collect();
    for round in 0..200_000_usize {
        let text = if round % 4 == 0 {
            (0..1 + random.below(12)).map(|_| tokens[random.below(tokens.len())]).collect::<String>()
        } else {
            mutated(lines[random.below(lines.len())], &mut random)
        };
        let mut sources = SourceMap::new();
        let id = sources.add("fuzz", text.as_str());
        let parsed = parse(&sources, id);
        for d in &parsed.diagnostics {
            let span = d.labels[0].span;
            assert!(text.get(span.start as usize..span.end as usize).is_some(), "{text:?}: {d:?}");
        }
        if round % 50 == 0 {
            parsed.diagnostics.iter().for_each(|d| assert!(render(d, &sources).contains(d.code.as_str())));
        }
    }
}

/// A line with one to three bytes replaced, removed or doubled.
fn mutated(line: &str, random: &mut Random) -> String {
    let mut bytes = line.as_bytes().to_vec();
    for _ in 0..1 + random.below(3) {
        let at = random.below(bytes.len() + 1);
        match random.below(4) {
            0 => bytes.insert(at, random.below(256) as u8),
            1 if at < bytes.len() => bytes[at] = b"()[]{}:;,.+-*/^'=<>\"# \n0aZ_"[random.below(27)],
            2 if at < bytes.len() => drop(bytes.remove(at)),
            _ if at < bytes.len() => bytes.insert(at, bytes[at]),
            _ => bytes.push(b'('),
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}
