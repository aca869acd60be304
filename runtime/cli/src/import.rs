//! `wfl import`: an assembly string of a GetFEM script as statements of a scene.
//!
//! The string says which fields it tests and which words it uses, not what they are: declarations are guessed and say
//! so. A bilinear form (`Test2_u`) becomes the residual whose tangent it is, since scenes are written by residuals.

use std::{collections::BTreeSet, fmt::Write as _, process::ExitCode};

use wfl::{CONSTANTS, SourceMap, is_function, parse_gwfl, split_prefixes};

use crate::{
    args::ImportArgs,
    load::{out, print_all, say},
    prepared::EXIT_ERROR,
};

pub(crate) fn import(args: &ImportArgs) -> ExitCode {
    if args.text.trim().is_empty() {
        say("error: the assembly string is empty\n  = help: wfl import \"Grad_u.Grad_Test_u\"\n");
        return ExitCode::from(EXIT_ERROR);
    }
    let mut sources = SourceMap::new();
    let id = sources.add("(assembly string)", args.text.as_str());
    let parsed = parse_gwfl(&sources, id);
    print_all(&parsed.diagnostics, &sources);
    let Some((defs, expr)) = parsed.value else { return ExitCode::from(EXIT_ERROR) };
    let one_line = |span| sources.snippet(span).split_whitespace().collect::<Vec<_>>().join(" ");
    let macros: Vec<Macro> = defs
        .iter()
        .map(|d| Macro {
            name: d.name.name.clone(),
            formals: d.formals.iter().map(|f| f.name.clone()).collect(),
            head: one_line(d.head),
            body: one_line(d.body.span),
        })
        .collect();
    out(&statements(&macros, &one_line(expr.span), &args.on));
    ExitCode::SUCCESS
}

struct Macro {
    name: String,
    formals: Vec<String>,
    head: String,
    body: String,
}

/// The words of an expression.
fn words(text: &str) -> impl Iterator<Item = &str> {
    let word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    text.split(move |c| !word(c)).filter(|w| w.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_'))
}

/// The text with every `Test2_u` as `u`.
fn without_trials(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = rest.find("Test2_") {
        let before = rest[..at].chars().next_back();
        let (kept, skipped) = rest.split_at(at);
        out.push_str(kept);
        // only a prefix of a word: at its start or behind another prefix
        if before.is_some_and(|c| c.is_ascii_alphanumeric()) {
            out.push_str("Test2_");
        }
        rest = &skipped["Test2_".len()..];
    }
    out + rest
}

fn statements(macros: &[Macro], expr: &str, on: &str) -> String {
    let everything = macros.iter().map(|m| m.body.as_str()).chain([expr]).collect::<Vec<_>>().join(" ");
    let bilinear = words(&everything).any(|w| split_prefixes(w).0.contains("Test2_"));
    let has_test = words(&everything).any(|w| split_prefixes(w).0.contains("Test_"));
    let (fields, known, others) = sort_words(macros, expr);
    let mut text = String::from(
        "wfl 1\n# From an assembly string. What is marked `guessed` is not in it: look at each of them.\n",
    );
    for name in &fields {
        let shape = if is_vector(name, &everything) { "vector" } else { "scalar" };
        let _ = writeln!(text, "unknown {name} : {shape}    # guessed: shape, element and region");
    }
    for name in &known {
        let shape = if is_vector(name, &everything) { "vector" } else { "scalar" };
        let _ = writeln!(text, "data {name} : {shape} = {}    # guessed: given, since it is not tested", zero(shape));
    }
    for name in &others {
        let _ = writeln!(text, "param {name} = 1    # guessed: a number; its value is not in the string");
    }
    for m in macros {
        let _ = writeln!(text, "def {} = {}", m.head, without_trials(&m.body));
    }
    if bilinear {
        text += "# a bilinear form: its trial functions are the unknowns of the residual below\n";
    }
    if everything.contains("neighbor_element") || everything.contains("neighbour_elt") {
        text +=
            "# reads the other side: the region must be an interface (region fault = interface from left to right)\n";
    }
    let statement = if has_test { "term" } else { "energy" };
    let _ = writeln!(text, "{statement} on {on} : {}", without_trials(expr));
    text
}

fn zero(shape: &str) -> &'static str {
    if shape == "vector" { "[0,0,0]" } else { "0" }
}

/// Fields with test functions, other fields (they have a derivative), and the rest.
fn sort_words(macros: &[Macro], expr: &str) -> (BTreeSet<String>, BTreeSet<String>, BTreeSet<String>) {
    const LANGUAGE: [&str; 7] = ["x", "y", "z", "t", "if", "then", "else"];
    let (mut tested, mut differentiated, mut plain) = (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
    // inside a macro its parameters are no fields
    let bodies = macros.iter().map(|m| (m.body.as_str(), m.formals.as_slice()));
    for (text, formals) in bodies.chain([(expr, &[][..])]) {
        for word in words(text) {
            let (prefix, name) = split_prefixes(word);
            let known = formals.iter().any(|f| f == name) || macros.iter().any(|m| m.name == name);
            if known || is_function(name) || CONSTANTS.contains(&name) || LANGUAGE.contains(&name) {
                continue;
            }
            let list = match prefix {
                p if p.contains("Test") => &mut tested,
                "" => &mut plain,
                _ => &mut differentiated,
            };
            list.insert(name.to_owned());
        }
    }
    // a potential tests nothing: what is differentiated in it is what it is minimised over
    if tested.is_empty() {
        tested = std::mem::take(&mut differentiated);
    }
    if tested.is_empty() && plain.contains("u") {
        tested.insert("u".to_owned());
    }
    differentiated.retain(|n| !tested.contains(n));
    plain.retain(|n| !tested.contains(n) && !differentiated.contains(n));
    (tested, differentiated, plain)
}

/// Signs of a vector: a divergence, a symmetric or traced gradient, a double contraction, a scalar product with it.
fn is_vector(name: &str, everything: &str) -> bool {
    let text: String = everything.chars().filter(|c| !c.is_whitespace()).collect();
    let signs = [
        "Div_{}",
        "Sym(Grad_{}",
        "Trace(Grad_{}",
        "Skew(Grad_{}",
        ":Grad_{}",
        "Det(Id(3)+Grad_{}",
        ".{}",
        "{}.Normal",
        "{}(1)",
        "{}'",
    ];
    let forms = ["", "Test_", "Test2_"];
    let bounded = |pattern: &str| {
        text.match_indices(pattern).any(|(at, _)| {
            let word = |c: char| c.is_ascii_alphanumeric() || c == '_';
            let before = pattern.starts_with(word) && text[..at].ends_with(word);
            let after = pattern.ends_with(word) && text[at + pattern.len()..].starts_with(word);
            !before && !after
        })
    };
    forms.iter().any(|f| signs.iter().any(|s| bounded(&s.replace("{}", &format!("{f}{name}")))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(expr: &str) -> String {
        statements(&[], expr, "all")
            .lines()
            .skip(2)
            .map(|l| l.split("    #").next().unwrap_or(l))
            .collect::<Vec<_>>()
            .join("\n")
    }

    #[test]
    fn laplace_is_scalar_elasticity_a_vector() {
        assert_eq!(of("Grad_u.Grad_Test_u"), "unknown u : scalar\nterm on all : Grad_u.Grad_Test_u");
        assert_eq!(
            of("(2*mu*Sym(Grad_u)+lambda*Trace(Grad_u)*Id(3)):Grad_Test_u"),
            "unknown u : vector\nparam lambda = 1\nparam mu = 1\nterm on all : (2*mu*Sym(Grad_u)+lambda*Trace(Grad_u)*Id(3)):Grad_Test_u"
        );
    }

    #[test]
    fn trial_functions_become_the_unknown() {
        assert_eq!(
            of("k*Grad_Test2_u.Grad_Test_u + Test2_u*Test_u").lines().last(),
            Some("term on all : k*Grad_u.Grad_Test_u + u*Test_u")
        );
        assert_eq!(without_trials("MyTest2_u"), "MyTest2_u");
    }

    #[test]
    fn a_potential_is_an_energy_and_macros_are_kept() {
        let m =
            Macro { name: "W".into(), formals: vec!["F".into()], head: "W(F)".into(), body: "c*Norm_sqr(F)".into() };
        let text = statements(&[m], "W(Grad_u)", "body");
        assert!(
            text.contains("unknown u : scalar") && text.contains("param c = 1") && !text.contains("param F"),
            "{text}"
        );
        // a parameter of a macro may have the name of a field
        let m = Macro { name: "F".into(), formals: vec!["u".into()], head: "F(u)".into(), body: "Id(2)+Grad_u".into() };
        assert!(statements(&[m], "F(u):Grad_Test_u", "all").contains("unknown u : vector"));
        assert!(text.ends_with("def W(F) = c*Norm_sqr(F)\nenergy on body : W(Grad_u)\n"), "{text}");
    }
}
