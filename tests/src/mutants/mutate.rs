//! Seeds, and what is done to them: the examples on small meshes with few steps, and one to three changes of their tokens,
//! numbers and statements.

use std::path::{Path, PathBuf};

use wfl_compiler::InterpreterBackend;

use super::{ready, stated};
use crate::{fuzz::Random, scene_files};

/// Cells in each direction of a seed, at most: so few that the cracks and faults of the examples are still there.
const CELLS: usize = 6;
/// The same in three dimensions.
const CELLS_OF_A_SOLID: usize = 2;

/// An example in a small form.
#[derive(Clone, Debug)]
pub struct Seed {
    /// Its file, for messages.
    pub name: String,
    /// Where its mesh and data files are.
    pub folder: PathBuf,
    /// Its statements, those of the files it uses among them.
    pub statements: Vec<String>,
}

impl Seed {
    /// As a mutant without changes.
    #[must_use]
    pub fn as_mutant(&self) -> Mutant {
        let Self { name, folder, statements } = self.clone();
        Mutant { seed: name, folder, statements, changes: Vec::new() }
    }
}

/// A changed seed.
#[derive(Clone, Debug)]
pub struct Mutant {
    /// The seed's name.
    pub seed: String,
    /// Where its mesh and data files are.
    pub folder: PathBuf,
    /// Its statements.
    pub statements: Vec<String>,
    /// What was changed.
    pub changes: Vec<String>,
}

impl Mutant {
    /// The text of the scene.
    #[must_use]
    pub fn text(&self) -> String {
        self.statements.join("\n") + "\n"
    }
}

/// The examples, each in its small form, in the order of their paths.
///
/// # Panics
/// If they cannot be read.
#[must_use]
pub fn seeds() -> Vec<Seed> {
    let made = scene_files().into_iter().filter_map(|path| {
        let folder = path.parent().expect("examples are in folders").to_path_buf();
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let text = std::fs::read_to_string(&path).expect("examples can be read");
        // the oracle integrates in time by backward Euler over the steps that the scene lists, and over whole faces
        if ["Dot2_", "\nscheme ", " by auto", " segments of "].iter().any(|words| text.contains(words)) {
            return None;
        }
        let kept = statements(&text, &folder).into_iter().filter(|s| !matches!(word(s), "expect" | "wfl"));
        Some(needed(Seed { name, folder, statements: kept.map(|s| small(&s)).collect() }))
    });
    // few cells may have no plane where the example has its crack: it is left out
    made.filter(|seed| ready(&seed.as_mutant(), &InterpreterBackend, &[]).scene.is_some()).collect()
}

/// A seed without the declarations that served what is left out.
fn needed(mut seed: Seed) -> Seed {
    loop {
        let mutant = seed.as_mutant();
        let told = ready(&mutant, &InterpreterBackend, &[]).diagnostics;
        let idle: Vec<&str> = told.iter().filter(|d| d.code == "W702").map(|d| stated(&mutant, d)).collect();
        seed.statements.retain(|s| !idle.contains(&s.as_str()));
        if seed.statements.len() == mutant.statements.len() {
            return seed;
        }
    }
}

/// The statements of a text, each with the lines that continue it and without comments; `use` of a file beside it gives
/// its statements.
fn statements(text: &str, folder: &Path) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for line in text.lines() {
        let line = line.split('#').next().unwrap_or("").trim_end();
        if line.is_empty() {
            continue;
        }
        match out.last_mut().filter(|_| line.starts_with([' ', '\t'])) {
            Some(last) => {
                last.push('\n');
                last.push_str(line);
            }
            None => out.push(line.to_owned()),
        }
    }
    let used = |s: String| match s.strip_prefix("use \"").and_then(|s| s.strip_suffix('"')) {
        Some(file) => match std::fs::read_to_string(folder.join(file)) {
            Ok(text) => statements(&text, folder),
            Err(_) => vec![s],
        },
        None => vec![s],
    };
    out.into_iter().flat_map(used).collect()
}

/// The word a statement begins with.
#[must_use]
pub fn word(statement: &str) -> &str {
    statement.split_whitespace().next().unwrap_or("")
}

/// A statement of the small form: few cells, few steps.
fn small(statement: &str) -> String {
    match word(statement) {
        "mesh" => {
            let Some((before, rest)) = statement.split_once("cells [") else {
                return statement.replace("size h", "cells [4]");
            };
            let Some((list, after)) = rest.split_once(']') else { return statement.to_owned() };
            let parts: Vec<&str> = list.split(',').collect();
            let most = if parts.len() == 3 { CELLS_OF_A_SOLID } else { CELLS };
            let counts: Vec<String> = parts
                .iter()
                .map(|p| p.trim().parse::<usize>().map_or(most, |n| n.clamp(2, most)).to_string())
                .collect();
            // an uneven number keeps no plane in the middle where the example has one, and the other way round
            let uneven = parts.iter().all(|p| p.trim().parse::<usize>().is_ok_and(|n| n % 2 == 1 && n > 1));
            let counts = if uneven { parts.iter().map(|_| "3".to_owned()).collect() } else { counts };
            format!("{before}cells [{}]{after}", counts.join(", "))
        }
        "steps" => {
            let bounds = statement.split_once('=').and_then(|(head, rest)| {
                let (from, rest) = rest.split_once(" to ")?;
                let (to, by) = rest.split_once(" by ")?;
                let tail = by.split_once(" with ").map(|(_, w)| format!(" with {w}")).unwrap_or_default();
                Some((head.trim(), from.trim(), to.trim(), tail))
            });
            let Some((head, from, to, tail)) = bounds.filter(|b| b.1 != b.2) else { return statement.to_owned() };
            format!("{head} = {from} to {to} by ({to} - ({from}))/2{tail}")
        }
        _ => statement.to_owned(),
    }
}

/// One to three changes of a seed.
pub fn mutate(seeds: &[Seed], random: &mut Random) -> Mutant {
    let seed = &seeds[random.below(seeds.len())];
    let mut mutant = seed.as_mutant();
    for _ in 0..1 + random.below(3) {
        if let Some(change) = change(&mut mutant.statements, random) {
            mutant.changes.push(change);
        }
    }
    mutant
}

/// One change; `None` where what was picked cannot be changed so.
fn change(list: &mut Vec<String>, random: &mut Random) -> Option<String> {
    let at = random.below(list.len());
    // more cells or steps are a longer run and not another one
    let fixed = matches!(word(&list[at]), "mesh" | "steps");
    match random.below(16) {
        0 if !fixed => Some(format!("drop: {}", list.remove(at))),
        1 if !matches!(word(&list[at]), "param" | "def" | "unknown" | "region" | "multiplier" | "mesh") => {
            let to = random.below(list.len() + 1);
            list.insert(to, list[at].clone());
            Some(format!("double: {}", list[to]))
        }
        2 => {
            let other = random.below(list.len());
            list.swap(at, other);
            Some(format!("swap: {} | {}", list[at], list[other]))
        }
        3..=6 if !fixed => number(&mut list[at], random),
        7 | 8 => exchange(list, at, random),
        9 | 10 if !fixed => token(list, at, random),
        11 => added(list, random, "fix"),
        12 => added(list, random, "load"),
        13 => lowered(list, random),
        14 => option(list, random),
        _ => options_of_outputs(list, random),
    }
}

/// The tokens of a statement: words, numbers, signs.
fn tokens(text: &str) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '.';
    for c in text.chars() {
        let joins = is_word(c) && out.last().is_some_and(|t| t.chars().all(is_word));
        match out.last_mut().filter(|_| joins) {
            Some(last) => last.push(c),
            None => out.push(c.to_string()),
        }
    }
    out
}

fn is_number(token: &str) -> bool {
    token.starts_with(|c: char| c.is_ascii_digit())
}

/// A number takes another sign or size, or stops to be one.
fn number(statement: &mut String, random: &mut Random) -> Option<String> {
    let mut list = tokens(statement);
    let places: Vec<usize> = (0..list.len()).filter(|k| is_number(&list[*k])).collect();
    let at = *places.get(random.below(places.len()))?;
    let old = list[at].clone();
    let scale = [-12, -6, -3, -1, 1, 3, 6, 12][random.below(8)];
    list[at] = match random.below(12) {
        0 => format!("(-{old})"),
        1 => "0".to_owned(),
        2 => "1e308".to_owned(),
        3 => "1e-308".to_owned(),
        4 => "(0/(x - x))".to_owned(),
        5 => "(1/x)".to_owned(),
        6 => "log(x - 0.7)".to_owned(),
        7 => "2".to_owned(),
        _ => format!("({old}*1e{scale})"),
    };
    let change = format!("number: {old} -> {} in {}", list[at], word(statement));
    *statement = list.concat();
    Some(change)
}

/// Names that statements of these words declare.
fn declared(list: &[String], words: &[&str]) -> Vec<String> {
    let name = |s: &String| tokens(s).into_iter().filter(|t| !t.trim().is_empty()).nth(1);
    list.iter().filter(|s| words.contains(&word(s))).filter_map(name).collect()
}

fn regions(list: &[String]) -> Vec<String> {
    let built_in = ["all", "boundary"].map(str::to_owned);
    declared(list, &["region"]).into_iter().chain(built_in).collect()
}

/// A region or field gives its place in a statement to another one.
fn exchange(list: &mut [String], at: usize, random: &mut Random) -> Option<String> {
    let names = if random.below(2) == 0 { regions(list) } else { declared(list, &["unknown", "multiplier"]) };
    let mut own = tokens(&list[at]);
    let prefixes = ["", "Test_", "Grad_", "Grad_Test_"];
    let places: Vec<(usize, &str)> = (2..own.len())
        .flat_map(|k| prefixes.map(|p| (k, p)))
        .filter(|(k, p)| own[*k].strip_prefix(p).is_some_and(|t| names.iter().any(|n| n == t)))
        .collect();
    let (place, prefix) = *places.get(random.below(places.len()))?;
    let new = &names[random.below(names.len())];
    let old = std::mem::replace(&mut own[place], format!("{prefix}{new}"));
    let change = format!("exchange: {old} -> {prefix}{new} in {}", list[at]);
    list[at] = own.concat();
    (old != own[place]).then_some(change)
}

/// A token is dropped, doubled, or gives way to one of another statement.
fn token(list: &mut [String], at: usize, random: &mut Random) -> Option<String> {
    let mut own = tokens(&list[at]);
    let place = 1 + random.below(own.len().saturating_sub(1));
    let old = own.get(place)?.clone();
    let other = tokens(&list[random.below(list.len())]);
    let signs = ["+", "-", "*", "/", ".", ":"];
    let new = match random.below(5) {
        0 => String::new(),
        1 => format!("{old}{old}"),
        2 if signs.contains(&old.as_str()) => signs[random.below(4)].to_owned(),
        _ => other[random.below(other.len())].clone(),
    };
    own[place].clone_from(&new);
    let change = format!("token: {old:?} -> {new:?} in {}", list[at]);
    list[at] = own.concat();
    Some(change)
}

/// A value of the shape that a field has.
fn value(list: &[String], field: &str, component: &str, random: &mut Random) -> String {
    let vector = |s: &String| s.contains(&format!(" {field} ")) && s.contains("vector") && word(s) != "def";
    if !component.is_empty() || !list.iter().any(vector) {
        return ["0", "1", "7", "0.1*x", "-1e3", "1/x", "log(x - 0.7)", "1e-3*(1 + x)"][random.below(8)].to_owned();
    }
    let first = |s: &String| s.split_once('[')?.1.split_once(']').map(|(list, _)| list.split(',').count());
    let n = list.iter().find(|s| word(s) == "mesh").and_then(first).unwrap_or(2);
    let values = ["0", "0", "-1", "1e-3", "0.1*x", "1/x"];
    let parts: Vec<&str> = (0..n).map(|_| values[random.below(values.len())]).collect();
    format!("[{}]", parts.join(","))
}

/// One more prescribed value or load.
fn added(list: &mut Vec<String>, random: &mut Random, what: &str) -> Option<String> {
    let fields = declared(list, &["unknown", "multiplier"]);
    let (field, places) = (fields.get(random.below(fields.len()))?.clone(), regions(list));
    let place = &places[random.below(places.len())];
    let component = ["", "", "(1)"][random.below(3)];
    let value = value(list, &field, component, random);
    let new = format!("{what} {field}{component} = {value} on {place}");
    list.push(new.clone());
    Some(format!("add: {new}"))
}

/// A rule of low degree.
fn lowered(list: &mut Vec<String>, random: &mut Random) -> Option<String> {
    let places = regions(list);
    let rule = ["degree 0", "degree 1", "degree 2", "vertex"][random.below(4)];
    let new = format!("quadrature on {} {rule}", places[random.below(places.len())]);
    list.retain(|s| word(s) != "quadrature");
    list.push(new.clone());
    Some(format!("add: {new}"))
}

/// Another option of the solver, or a first guess.
fn option(list: &mut Vec<String>, random: &mut Random) -> Option<String> {
    if random.below(2) == 0 {
        let fields = declared(list, &["unknown", "multiplier"]);
        let field = fields.get(random.below(fields.len()))?;
        let value = value(list, field, "", random);
        let new = format!("start {field} = {value}");
        list.push(new.clone());
        return Some(format!("add: {new}"));
    }
    let option = ["tol=1e-3", "tol=0.5", "tol=1e-14", "max_iter=2", "search=none"][random.below(5)];
    list.retain(|s| word(s) != "solver");
    list.push(format!("solver newton with {option}"));
    Some(format!("add: solver newton with {option}"))
}

/// One more output or measure.
fn options_of_outputs(list: &mut Vec<String>, random: &mut Random) -> Option<String> {
    let fields = declared(list, &["unknown", "multiplier"]);
    let (field, places) = (fields.get(random.below(fields.len()))?.clone(), regions(list));
    let place = &places[random.below(places.len())];
    let new = match random.below(4) {
        0 => format!("output vtk \"base\" : {field}"),
        1 => format!("output csv \"cut\" : {field} along [0,0] to [1,1]"),
        2 => format!("measure added = max(Norm({field})) on {place}"),
        _ => format!("measure added = integral({field}) on {place}"),
    };
    list.push(new.clone());
    Some(format!("add: {new}"))
}
