//! An assembly string of a GetFEM script as statements of a scene.
//!
//! The string says which fields it tests and which words it uses, not what they are: declarations are guessed and say
//! so. What does not follow from the string (transformations, multipliers) or is no GetFEM is refused, and what is written
//! has been read and compiled before. A bilinear form (`Test2_u`) becomes the residual whose tangent it is, since scenes
//! are written by residuals.

use std::{collections::BTreeSet, fmt::Write as _, path::Path};

use wfl::{
    CONSTANTS, Diagnostic, NoFiles, REGIONS, SourceMap, Span, is_function, is_keyword, parse_gwfl, resolve,
    split_prefixes,
};
use wfl_compiler::InterpreterBackend;

/// What became of an assembly string.
pub struct Import {
    /// What was found while it was parsed.
    pub diagnostics: Vec<Diagnostic>,
    /// The text that `diagnostics` are about.
    pub sources: SourceMap,
    /// The statements, or why there are none; `None` where the string cannot be parsed.
    pub statements: Option<Result<String, Refused>>,
}

/// Turns an assembly string into statements; `on` is the region of the term, guessed where none is given.
#[must_use]
pub fn import(text: &str, on: Option<&str>) -> Import {
    let mut sources = SourceMap::new();
    let id = sources.add("(assembly string)", text);
    let parsed = parse_gwfl(&sources, id);
    let one_line = |span: Span| {
        let lines = sources.snippet(span).lines().map(|l| l.split('#').next().unwrap_or(l));
        lines.flat_map(str::split_whitespace).collect::<Vec<_>>().join(" ")
    };
    let statements = parsed.value.map(|(defs, expr)| {
        let macros: Vec<Macro> = defs
            .iter()
            .map(|d| Macro {
                name: d.name.name.clone(),
                formals: d.formals.iter().map(|f| f.name.clone()).collect(),
                head: one_line(d.head),
                body: one_line(d.body.span),
            })
            .collect();
        scene_of(&macros, &one_line(expr.span), on)
    });
    Import { diagnostics: parsed.diagnostics, sources, statements }
}

/// Why there are no statements.
pub struct Refused {
    /// In words.
    pub why: String,
    /// What to do.
    pub help: Option<String>,
    /// What the compiler says of the statements that would have followed, and their text.
    pub messages: Option<(Vec<Diagnostic>, SourceMap)>,
}

fn refused(why: impl Into<String>, help: &str) -> Refused {
    Refused { why: why.into(), help: (!help.is_empty()).then(|| help.to_owned()), messages: None }
}

/// The statements, if they are read and compiled in a scene around them, in two or three dimensions.
fn scene_of(macros: &[Macro], expr: &str, on: Option<&str>) -> Result<String, Refused> {
    let everything = macros.iter().map(|m| m.body.as_str()).chain([expr]).collect::<Vec<_>>().join(" ");
    let neighbor = everything.contains("neighbor_element") || everything.contains("neighbour_elt");
    let place = match neighbor {
        true => Place::InnerFaces,
        false if words(&everything).any(|w| w == "Normal") => Place::Boundary,
        false => Place::Bodies,
    };
    let on = on.unwrap_or(place.region());
    known_here(macros, expr, on)?;
    let mut first = None;
    // on a line every shape is a scalar, so that nothing would be checked
    for dim in [3, 2] {
        let text = statements(macros, expr, on, dim);
        let (scene, own) = (around(on, dim, place, &text), text.matches('\n').count());
        let Some(found) = problems(&scene, own) else { return Ok(text) };
        first.get_or_insert(found);
    }
    let messages = first;
    Err(Refused { why: "what it would give does not compile".to_owned(), help: None, messages })
}

/// What is in the string and not in this language, or not in the string and needed here.
fn known_here(macros: &[Macro], expr: &str, on: &str) -> Result<(), Refused> {
    let is_name = |w: &str| {
        w.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
            && w.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
            && !is_keyword(w)
    };
    if !is_name(on) {
        return Err(refused(format!("`{on}` cannot be the name of a region"), "--on wall"));
    }
    let everything = macros.iter().map(|m| m.body.as_str()).chain([expr]).collect::<Vec<_>>().join(" ");
    let fields = sort_words(macros, expr);
    let own = |w: &str| macros.iter().any(|m| m.name == w || m.formals.iter().any(|f| f == w));
    if let Some(mapping) = mapping_of(&everything) {
        let help = format!(
            "declare it (mapping {mapping} = project from FACES onto OTHER_FACES, or = point [...]) and write the term with it"
        );
        return Err(refused(
            format!("`{mapping}` is a transformation of the model, which the string does not hold"),
            &help,
        ));
    }
    let elsewhere = fields.others.iter().filter(|w| !own(w)).find_map(|w| Some((w, wfl::ufl(w)?)));
    if let Some((word, here)) = elsewhere {
        return Err(refused(format!("`{word}` is no word of GetFEM's language but of UFL or another one"), here));
    }
    if let Some(word) = words(&everything).find(|w| ["x", "y", "z", "t"].contains(w) && !own(w)) {
        let what = if word == "t" { "the variable of `steps`" } else { "a coordinate" };
        let help = "coordinates are X(1), X(2), X(3) in GetFEM; give a number of the model another name";
        return Err(refused(format!("`{word}` is a name of the model there and {what} here"), help));
    }
    if fields.tested.is_empty() {
        return Err(refused("it tests nothing and differentiates nothing: nothing says what is solved for", ""));
    }
    let differentiated =
        |f: &str| words(&everything).any(|w| split_prefixes(w).1 == f && is_derivative(split_prefixes(w).0));
    if let Some(field) = fields.tested.iter().find(|f| fields.tested.len() > 1 && !differentiated(f)) {
        let help = format!(
            "write the statements by hand: multiplier {field} : ... on FACES, or unknown {field} : ... with its element"
        );
        let why = format!(
            "`{field}` has a test function and no derivative: a multiplier or another space, which it does not say"
        );
        return Err(refused(why, &help));
    }
    Ok(())
}

fn is_derivative(prefix: &str) -> bool {
    ["Grad_", "Hess_", "Div_"].iter().any(|d| prefix.contains(d))
}

/// The transformation that some `Interpolate` names, other than the neighbour.
fn mapping_of(everything: &str) -> Option<String> {
    let text: String = everything.chars().filter(|c| !c.is_whitespace()).collect();
    for call in text.split("Interpolate(").skip(1).chain(text.split("Interpolate_filter(").skip(1)) {
        let arguments: Vec<&str> = call.split(')').next().unwrap_or("").split(',').collect();
        let is_word = |w: &&&str| w.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') && !w.is_empty();
        let known = |w: &str| ["neighbor_element", "neighbour_elt"].contains(&w);
        if arguments.iter().any(|w| known(w)) {
            continue;
        }
        if let Some(last) = arguments.iter().skip(1).find(is_word) {
            return Some((*last).to_owned());
        }
    }
    None
}

/// Where an expression has a value, as its words say.
#[derive(Clone, Copy)]
enum Place {
    Bodies,
    Boundary,
    InnerFaces,
}

impl Place {
    /// The region of this kind that every scene has.
    fn region(self) -> &'static str {
        match self {
            Place::Bodies => "all",
            Place::Boundary => "boundary",
            Place::InnerFaces => "interior",
        }
    }
}

/// The statements in a small scene.
fn around(on: &str, dim: usize, place: Place, text: &str) -> String {
    let (corner, shape) = [("[1]", "segment"), ("[1,1]", "quad"), ("[1,1,1]", "hex")][dim - 1];
    let (low, cells) = (corner.replace('1', "0"), corner.replace('1', "2"));
    let region = match place {
        _ if REGIONS.contains(&on) => String::new(),
        Place::InnerFaces => format!(
            "region wfl_one = cells where x < 0.5\nregion wfl_two = cells where x > 0.5\n\
             region {on} = interface from wfl_one to wfl_two\n"
        ),
        Place::Boundary | Place::Bodies => format!("region {on} = {}\n", place.region()),
    };
    let covered: String = text
        .lines()
        .filter_map(|l| l.strip_prefix("unknown ")?.split_once(" : "))
        .map(|(name, rest)| match rest.starts_with("vector") {
            true => format!("term on all : {name}.Test_{name}\n"),
            false => format!("term on all : {name}*Test_{name}\n"),
        })
        .collect();
    let steps = if ["Dot_", "timestep"].iter().any(|w| text.contains(w)) { "steps t = 0 to 1 by 0.5\n" } else { "" };
    format!("{text}mesh box {low} to {corner} cells {cells} {shape}\n{region}{covered}{steps}")
}

/// The errors in the first lines of a scene, which are the statements; `None` if there are none.
fn problems(scene: &str, lines: usize) -> Option<(Vec<Diagnostic>, SourceMap)> {
    let mut sources = SourceMap::new();
    let main = sources.add("(statements)", scene);
    let mut resolved = resolve(&mut sources, main, &mut NoFiles, &[]);
    let mut found = std::mem::take(&mut resolved.diagnostics);
    if let Some(script) = &resolved.value {
        found.extend(wfl_problem::prepare(script, Path::new(""), &InterpreterBackend).diagnostics);
    }
    found.retain(Diagnostic::is_error);
    if found.is_empty() {
        return None;
    }
    let own = |d: &Diagnostic| d.labels.first().is_none_or(|l| sources.line_column(l.span).0 <= lines);
    let (own, other): (Vec<_>, Vec<_>) = found.into_iter().partition(own);
    Some((if own.is_empty() { other } else { own }, sources))
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

fn statements(macros: &[Macro], expr: &str, on: &str, dim: usize) -> String {
    let everything = macros.iter().map(|m| m.body.as_str()).chain([expr]).collect::<Vec<_>>().join(" ");
    let bilinear = words(&everything).any(|w| split_prefixes(w).0.contains("Test2_"));
    let has_test = words(&everything).any(|w| split_prefixes(w).0.contains("Test_"));
    let Words { tested, known, others } = sort_words(macros, expr);
    let is_vector = |name: &str| dim > 1 && is_vector(name, &everything);
    let mut text = String::from(
        "wfl 1\n# From an assembly string. What is marked `guessed` is not in it: look at each of them.\n",
    );
    for name in &tested {
        let shape = if is_vector(name) { "vector" } else { "scalar" };
        let _ = writeln!(text, "unknown {name} : {shape}    # guessed: shape, element and region");
    }
    let zeros = format!("[{}]", vec!["0"; dim].join(","));
    for name in &known {
        let (shape, zero) = if is_vector(name) { ("vector", zeros.as_str()) } else { ("scalar", "0") };
        let _ = writeln!(text, "data {name} : {shape} = {zero}    # guessed: given, since it is not tested");
    }
    for name in &others {
        let value = if is_vector(name) { zeros.replace('0', "1") } else { "1".to_owned() };
        let _ = writeln!(text, "param {name} = {value}    # guessed: a number; its value is not in the string");
    }
    for m in macros {
        let _ = writeln!(text, "def {} = {}", m.head, without_trials(&m.body));
    }
    if bilinear {
        text += "# a bilinear form: its trial functions are the unknowns of the residual below\n";
    }
    if everything.contains("neighbor_element") || everything.contains("neighbour_elt") {
        text += "# reads the other side: the region is an interface (region fault = interface from left to right)\n";
    }
    let statement = if has_test { "term" } else { "energy" };
    let _ = writeln!(text, "{statement} on {on} : {}", without_trials(expr));
    text
}

/// Names of an assembly string.
struct Words {
    /// Fields with test functions, or what a potential is minimised over.
    tested: BTreeSet<String>,
    /// Other fields: they have a derivative.
    known: BTreeSet<String>,
    others: BTreeSet<String>,
}

/// Fields with test functions, other fields (they have a derivative), and the rest.
fn sort_words(macros: &[Macro], expr: &str) -> Words {
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
    differentiated.retain(|n| !tested.contains(n));
    plain.retain(|n| !tested.contains(n) && !differentiated.contains(n));
    Words { tested, known: differentiated, others: plain }
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
        statements(&[], expr, "all", 3)
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
        let text = statements(&[m], "W(Grad_u)", "body", 3);
        assert!(
            text.contains("unknown u : scalar") && text.contains("param c = 1") && !text.contains("param F"),
            "{text}"
        );
        // a parameter of a macro may have the name of a field
        let m = Macro { name: "F".into(), formals: vec!["u".into()], head: "F(u)".into(), body: "Id(2)+Grad_u".into() };
        assert!(statements(&[m], "F(u):Grad_Test_u", "all", 3).contains("unknown u : vector"));
        assert!(text.ends_with("def W(F) = c*Norm_sqr(F)\nenergy on body : W(Grad_u)\n"), "{text}");
    }
}
