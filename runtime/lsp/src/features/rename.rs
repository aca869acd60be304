//! A name gets another one in all files of all scenes that know it, if they mean the same with it.

use std::{collections::BTreeMap, path::PathBuf};

use lsp_types::{Position, PrepareRenameResponse, TextEdit, WorkspaceEdit};
use wfl::{REGIONS, is_keyword, reserved};

use crate::{
    analysis::Analysis,
    features::navigate::key_at,
    lines::Lines,
    places,
    renamed::Renaming,
    symbols::Key,
    view::{Refused, View},
};

/// Words with a value of their own wherever there are positions.
const COORDINATES: [&str; 3] = ["x", "y", "z"];

/// The range of the name under the cursor, without prefixes, if it can get another name.
pub(crate) fn prepare(view: &View<'_>, position: Position) -> Result<Option<PrepareRenameResponse>, Refused> {
    let names = view.analysis.names();
    let Some(name) = names.at(view.id, view.offset(position)) else { return Ok(None) };
    allowed(view, &name.key)?;
    let placeholder = name.key.name().to_owned();
    Ok(Some(PrepareRenameResponse::RangeWithPlaceholder { range: view.range(name.span), placeholder }))
}

/// The changes that give the name under the cursor another one.
pub(crate) fn rename(view: &View<'_>, position: Position, new: &str) -> Result<Option<WorkspaceEdit>, Refused> {
    let Some(key) = key_at(view, position) else { return Ok(None) };
    allowed(view, &key)?;
    is_name(&key, new)?;
    let mut texts: BTreeMap<PathBuf, Found> = BTreeMap::new();
    let mut clash = None;
    let mut collect = |analysis: &Analysis| {
        let taken = other(&key, new);
        if analysis.names().declaration(&taken).is_some() {
            clash = Some(format!("`{new}` is declared already"));
        }
        for (id, path) in analysis.own_files() {
            let text = &analysis.sources.get(id).text;
            let entry = texts.entry(path).or_insert_with(|| Found::new(text));
            let places = analysis.names().of(id).iter().filter(|o| o.key == key);
            entry.places.extend(places.map(|o| (o.span.start as usize, o.span.end as usize)));
        }
    };
    match &key {
        Key::Local(..) => collect(view.analysis),
        _ => view.state.each_scene_with(&view.root, &key, &mut collect),
    }
    if let Some(clash) = clash {
        return Err(Refused::new(clash));
    }
    for found in texts.values_mut() {
        found.places.sort_unstable();
        found.places.dedup();
    }
    means_the_same(view, &key, new, &texts)?;
    // addresses compare by their text; the map is the one of the protocol
    #[expect(clippy::mutable_key_type, reason = "the protocol keys changes by address")]
    let mut changes = std::collections::HashMap::new();
    for (path, Found { lines, text, places }) in texts {
        let edit =
            |(start, end): (usize, usize)| TextEdit { range: lines.range(&text, start, end), new_text: new.to_owned() };
        if !places.is_empty()
            && let Some(uri) = places::address(&path)
        {
            changes.insert(uri, places.into_iter().map(edit).collect());
        }
    }
    Ok(Some(WorkspaceEdit { changes: Some(changes), ..WorkspaceEdit::default() }))
}

/// Refuses a name with which a word of some scene would mean something else.
fn means_the_same(view: &View<'_>, key: &Key, new: &str, texts: &BTreeMap<PathBuf, Found>) -> Result<(), Refused> {
    let places = texts.iter().map(|(path, found)| (path.clone(), found.places.clone())).collect();
    let renaming = Renaming { key, new, places: &places };
    let mut changed = None;
    let mut look = |analysis: &Analysis| {
        if changed.is_none() {
            changed = renaming.changes(analysis, &view.state.files.open);
        }
    };
    match key {
        Key::Local(..) => look(view.analysis),
        _ => view.state.each_scene_with(&view.root, key, &mut look),
    }
    match changed {
        Some(why) => Err(Refused::new(format!("with `{new}` the scene would mean something else: {why}"))),
        None => Ok(()),
    }
}

/// A text with the places of a name.
struct Found {
    lines: Lines,
    text: String,
    places: Vec<(usize, usize)>,
}

impl Found {
    fn new(text: &str) -> Self {
        Self { lines: Lines::new(text), text: text.to_owned(), places: Vec::new() }
    }
}

/// Refuses what is declared in the library, or nowhere.
fn allowed(view: &View<'_>, key: &Key) -> Result<(), Refused> {
    let Some(declared) = view.analysis.names().declaration(key) else {
        return Err(Refused::new(format!("`{}` is a word of the language, or not declared", key.name())));
    };
    if view.analysis.is_library(declared.span.source) {
        return Err(Refused::new(format!("`{}` is a macro of the library", key.name())));
    }
    Ok(())
}

fn is_name(key: &Key, new: &str) -> Result<(), Refused> {
    let word = new.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && new.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    if !word {
        return Err(Refused::new(format!("`{new}` is no name: letters, digits and `_`, a letter first")));
    }
    let taken = match key {
        Key::Region(_) => REGIONS.contains(&new).then(|| "built in".to_owned()),
        Key::Term(_) => None,
        _ => reserved(new).or_else(|| COORDINATES.contains(&new).then(|| "a coordinate".to_owned())),
    };
    let taken = taken.or_else(|| is_keyword(new).then(|| "a word of the language".to_owned()));
    match taken {
        Some(what) => Err(Refused::new(format!("`{new}` is {what}"))),
        None => Ok(()),
    }
}

/// The name `new` in the world of a name.
fn other(key: &Key, new: &str) -> Key {
    let new = new.to_owned();
    match key {
        Key::Value(_) => Key::Value(new),
        Key::Region(_) => Key::Region(new),
        // several terms may share a name
        Key::Term(_) => Key::Local(usize::MAX, 0, new),
        Key::Local(source, start, _) => Key::Local(*source, *start, new),
    }
}
