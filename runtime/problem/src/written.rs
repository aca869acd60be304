//! The names of all files that a run writes, and which of them two results would share.
//!
//! Promises: no result of a run replaces another one of it. Names of steps count for every number of steps, so that a
//! scene with more of them is not refused for it, and names that differ only in the case of letters are one. Writes
//! nothing; what lies in a folder already is the business of `wfl_output`.

use wfl::{Code, Diagnostic, ResolvedScript, Span};
use wfl_output::{MEASURES_FILE, Names};

/// A result of a run with the names of its files.
#[derive(Clone, Debug, PartialEq)]
struct Written {
    names: Names,
    /// What writes them: "the table of the measures".
    what: String,
    /// The statement that asks for it.
    place: Option<Span>,
}

/// Whether the results of a scene have a table of measures: its own, those made of others, and energies.
pub(crate) fn has_measures(script: &ResolvedScript) -> bool {
    let ResolvedScript { measures, balances, computed, .. } = script;
    !(measures.is_empty() && balances.is_empty() && computed.is_empty() && script.energies().is_empty())
}

/// What a scene writes, the run's own files first. `several`: the run has more than one step.
fn written(script: &ResolvedScript, several: bool) -> Vec<Written> {
    let mut all = Vec::new();
    if has_measures(script) {
        let names = Names::One(MEASURES_FILE.to_owned());
        all.push(Written { names, what: "the table of the measures of the run".to_owned(), place: None });
    }
    for output in &script.outputs {
        let (base, place) = (&output.file, Some(output.span));
        let one = |end: &str| Names::One(format!("{base}.{end}"));
        let steps = |extension| Names::Steps { base: base.clone(), extension };
        let (names, what) = match output.format.name.as_str() {
            "vtk" => (vec![one("pvd"), steps("vtu")], "the grids of"),
            "csv" if !output.at.is_empty() => (vec![one("csv")], "the series of"),
            "csv" if several => (vec![steps("csv")], "the tables of the steps of"),
            "csv" => (vec![one("csv")], "the table of"),
            _ => continue,
        };
        let what = format!("{what} `output {} \"{base}\"`", output.format.name);
        all.extend(names.into_iter().map(|names| Written { names, what: what.clone(), place }));
    }
    all
}

/// E433 for each result of a scene that has a file of one before it.
pub(crate) fn shared(script: &ResolvedScript, several: bool) -> Vec<Diagnostic> {
    refused(&written(script, several), 0)
}

/// E433 for each file beside those of a scene, with what is written into it, that has the name of another one.
/// `several`: the run has more than one step.
#[must_use]
pub fn shared_beside(script: &ResolvedScript, several: bool, more: &[(String, String)]) -> Vec<Diagnostic> {
    let mut all = written(script, several);
    let own = all.len();
    for (name, what) in more {
        let one = Written { names: Names::One(name.clone()), what: what.clone(), place: None };
        // what is asked for twice is one result
        if !all[own..].contains(&one) {
            all.push(one);
        }
    }
    refused(&all, own)
}

/// The messages about those from number `from` on, one for each statement.
fn refused(all: &[Written], from: usize) -> Vec<Diagnostic> {
    let mut told: Vec<Diagnostic> = Vec::new();
    for (k, one) in all.iter().enumerate().skip(from) {
        let met = all[..k].iter().find_map(|first| Some((first, one.names.shared_with(&first.names)?)));
        let Some((first, (name, by_case))) = met else { continue };
        let mut places = [one.place, first.place].into_iter().flatten();
        let place = places.next();
        if place.is_some() && told.iter().any(|d| d.labels.first().map(|label| label.span) == place) {
            continue;
        }
        let mut d = Diagnostic::new(Code::E433, format!("`{name}` would be {} and {}", first.what, one.what));
        let why = if by_case { "some systems take both names for one" } else { "" };
        if let Some(place) = place {
            d = d.at(place, why).help("give one of them another name");
        }
        if let Some(place) = places.next() {
            d = d.at(place, "the first one");
        }
        told.push(d);
    }
    told
}
