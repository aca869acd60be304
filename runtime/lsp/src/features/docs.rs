//! What there is to say of a name: its declaration, what stands in comments above it, what it is.

use wfl::{Span, phrases, statement_rows, word_meaning};
use wfl_compiler::{About, Class, functions, types::FieldSig};

use crate::{
    analysis::Analysis,
    check::Problem,
    symbols::{Key, Kind, Occurrence},
};

/// A block of code in Markdown.
pub(crate) fn code(text: &str) -> String {
    format!("```wfl\n{}\n```", text.trim_end())
}

/// What a function of the language is.
pub(crate) fn function(name: &str) -> Option<String> {
    let op = functions().find(|op| op.name == name)?;
    Some(format!("{}\n\n{}", code(op.usage), op.doc))
}

/// What a statement is: its forms, and what holds without it.
pub(crate) fn statement(word: &str) -> Option<String> {
    let mut text = String::new();
    for row in statement_rows().iter().filter(|r| r.word == word) {
        text.push_str(&format!("{}\n\n{}.", row.usage, row.meaning));
        if !row.default.is_empty() {
            text.push_str(&format!(" Default: {}.", row.default));
        }
        text.push_str("\n\n");
    }
    (!text.is_empty()).then(|| text.trim_end().to_owned())
}

/// What a word inside statements is: a built-in value, an option, a phrase.
pub(crate) fn word(word: &str) -> Option<String> {
    let phrase = phrases().iter().find(|p| p.word == word).map(|p| format!("{}\n\n{}", code(p.usage), p.text));
    phrase.or_else(|| word_meaning(word).map(|m| format!("`{word}`: {m}.")))
}

/// An expression in words: `matrix(3,3), linear in the unknowns`.
pub(crate) fn about(about: &About) -> String {
    let class = match about.class {
        Class::Constant if about.tests => "without unknowns",
        Class::Constant if about.point => "changes with the point",
        Class::Constant if about.step => "changes with the step",
        Class::Constant => "constant",
        Class::Linear => "linear in the unknowns",
        Class::Nonlinear => "nonlinear in the unknowns",
        Class::Kinked => "nonlinear in the unknowns, with kinks",
    };
    let tests = if about.tests { ", linear in a test function" } else { "" };
    format!("{}, {class}{tests}", about.shape)
}

/// The comment of a statement: the lines right above it, or above the statements that it follows without a blank line,
/// without their signs. What stands at the head of a file is about the file.
fn comments_above(text: &str, start: usize) -> String {
    let line = text[..start].rfind('\n').map_or(0, |k| k + 1);
    let above = text[..line].lines().rev().take_while(|l| !l.trim().is_empty());
    let mut block: Vec<&str> = above
        .skip_while(|l| !l.starts_with('#'))
        .take_while(|l| l.starts_with('#'))
        .map(|l| l.trim_start_matches('#').trim())
        .collect();
    block.reverse();
    let at_head = block.first().is_some_and(|first| {
        let head = text.find(first).map_or("", |k| &text[..k]);
        head.lines().all(|l| l.starts_with('#') || l.trim().is_empty() || l.starts_with("wfl "))
    });
    if at_head { String::new() } else { block.join("\n") }
}

/// The statement of a declaration without what follows it.
fn declaration_text(analysis: &Analysis, statement: Span) -> String {
    let text = analysis.sources.snippet(statement).trim_end();
    text.lines().take_while(|l| !l.starts_with('#')).collect::<Vec<_>>().join("\n")
}

/// A declared name.
pub(crate) fn declared(analysis: &Analysis, checked: Option<&Problem>, name: &Occurrence) -> String {
    let source = analysis.sources.get(name.span.source);
    let mut text = code(&declaration_text(analysis, name.statement));
    let comments = comments_above(&source.text, name.span.start as usize);
    if !comments.is_empty() {
        text.push_str(&format!("\n\n{comments}"));
    }
    if let Some(fact) = fact(analysis, checked, name) {
        text.push_str(&format!("\n\n{fact}"));
    }
    if analysis.is_library(name.span.source) {
        text.push_str("\n\nOf the library.");
    } else if name.span.source != analysis.script.main {
        let file = std::path::Path::new(&source.name).file_name().map(|n| n.to_string_lossy().into_owned());
        text.push_str(&format!("\n\nDeclared in {}.", file.unwrap_or_default()));
    }
    text
}

/// What is found out about a declared name: value, shape, class, members.
fn fact(analysis: &Analysis, checked: Option<&Problem>, name: &Occurrence) -> Option<String> {
    let word = name.key.name();
    match name.declares? {
        Kind::Param => {
            let sketch = analysis.sketch()?;
            let values = &sketch.param(word)?.values;
            let list: Vec<String> = values.iter().map(|v| number(*v)).collect();
            let value = if list.len() == 1 { list[0].clone() } else { format!("[{}]", list.join(", ")) };
            let param = analysis.script.params.iter().find(|p| p.name.name == word)?;
            let unit = param.unit.as_ref().map_or("", |u| analysis.sources.snippet(u.span));
            let given = param.text.as_ref().map_or_else(String::new, |t| format!(": {t}"));
            Some(format!("value {value} {unit}").trim_end().to_owned() + &given)
        }
        kind if kind.is_field() => {
            let sketch = analysis.sketch()?;
            let env = sketch.env();
            let sig = env.fields.iter().find(|f| f.name == word)?;
            Some(format!("{} {}{}", kind.word(), sig.shape, unit_of(analysis, sig)))
        }
        Kind::Def => {
            let found = analysis.macros_of(name.span.source);
            let (_, what) = found.iter().find(|m| m.0.start == name.span.start)?;
            Some(format!("where it is used first: {}", about(what)))
        }
        Kind::Region => checked?.regions.get(word).cloned(),
        Kind::Term => {
            let inside = |t: &&crate::check::TermFacts| t.span == name.statement;
            checked?.terms.iter().find(inside).map(term)
        }
        _ => None,
    }
}

/// What a check found of a term.
pub(crate) fn term(facts: &crate::check::TermFacts) -> String {
    let symmetric = if facts.symmetric { "symmetric" } else { "not symmetric" };
    format!(
        "{} on `{}`, tangent {symmetric}; quadrature {} ({} points): {}",
        facts.class.word(),
        facts.place,
        facts.rule,
        facts.points,
        facts.why
    )
}

/// The unit of a field, if the scene has units.
fn unit_of(analysis: &Analysis, sig: &FieldSig) -> String {
    let known = wfl::unit_report(&analysis.script, &analysis.sources);
    let unit = known.into_iter().find(|u| u.name == sig.name);
    unit.map_or_else(String::new, |u| format!(" in {}", u.unit))
}

/// A number as a person would write it: 0.25, 1e24.
pub(crate) fn number(v: f64) -> String {
    if v == 0.0 || (1e-4..1e7).contains(&v.abs()) { v.to_string() } else { format!("{v:e}") }
}

/// How a declared name is called, for completions and signatures: `nitsche(a, b, gamma, theta, friction)`.
pub(crate) fn head(analysis: &Analysis, name: &Occurrence) -> String {
    if name.declares != Some(Kind::Def) {
        return name.key.name().to_owned();
    }
    let of_macro = analysis.script.macros.iter().find(|m| m.name.span == name.span);
    let text = of_macro.map_or("", |m| analysis.sources.snippet(m.head));
    if text.is_empty() { name.key.name().to_owned() } else { text.to_owned() }
}

/// The parameters of the first call in a text, as they are written.
pub(crate) fn formals(head: &str) -> Vec<String> {
    let Some((_, inside)) = head.split_once('(') else { return Vec::new() };
    let mut list = vec![String::new()];
    let mut depth = 0usize;
    for c in inside.chars() {
        match c {
            ')' | ']' if depth == 0 => break,
            ',' if depth == 0 => {
                list.push(String::new());
                continue;
            }
            '(' | '[' => depth += 1,
            ')' | ']' => depth -= 1,
            _ => {}
        }
        if let Some(last) = list.last_mut() {
            last.push(c);
        }
    }
    list.into_iter().map(|f| f.trim().to_owned()).filter(|f| !f.is_empty()).collect()
}

/// What a parameter of a macro belongs to.
pub(crate) fn formal(analysis: &Analysis, key: &Key) -> Option<String> {
    let declared = analysis.names().declaration(key)?;
    let text = declaration_text(analysis, declared.statement);
    Some(format!("{}\n\n`{}` is a parameter.", code(&text), key.name()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_comment_of_a_statement_is_that_of_its_paragraph() {
        let text = "wfl 1\n# The scene\nparam a = 1\n\n# one\n# two\ndef f = 1\ndef g = 2\n\ndef h = 3\n";
        let above = |needle: &str| comments_above(text, text.find(needle).expect("it is there"));
        assert_eq!(above("def f"), "one\ntwo");
        assert_eq!(above("def g"), "one\ntwo");
        assert_eq!(above("def h"), "");
        assert_eq!(above("param a"), "");
    }

    #[test]
    fn parameters_are_read_off_a_head() {
        assert_eq!(formals("nitsche(a, b,gamma)"), ["a", "b", "gamma"]);
        assert_eq!(formals("Saint_Venant_Kirchhoff_PK2(Grad_u, [lambda; mu])"), ["Grad_u", "[lambda; mu]"]);
        assert_eq!(formals("Contract(A, i, j), Contract(A, i, B, j)"), ["A", "i", "j"]);
        assert_eq!(formals("f([a, b], g(c, d))"), ["[a, b]", "g(c, d)"]);
        assert!(formals("pi").is_empty());
    }
}
