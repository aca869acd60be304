//! From a name to its declaration and to its uses, in all files of a scene and in all scenes of a file.

use lsp_types::{DocumentHighlight, DocumentHighlightKind, Location, Position, ReferenceContext};

use crate::{features::diagnostics::location, places, symbols::Key, view::View};

/// The name under the cursor.
pub(crate) fn key_at(view: &View<'_>, position: Position) -> Option<Key> {
    view.analysis.names().at(view.id, view.offset(position)).map(|o| o.key.clone())
}

/// Where the name under the cursor is declared, or the file that a `use` names.
pub(crate) fn definition(view: &View<'_>, position: Position) -> Option<Vec<Location>> {
    if let Some(file) = used_file(view, view.offset(position)) {
        return Some(vec![file]);
    }
    let key = key_at(view, position)?;
    let declared = view.analysis.names().declarations(&key);
    let found: Vec<Location> = declared.iter().filter_map(|o| location(view.analysis, o.span)).collect();
    (!found.is_empty()).then_some(found)
}

/// The start of the file that the statement `use` around a place names.
fn used_file(view: &View<'_>, offset: usize) -> Option<Location> {
    let start = view.text[..offset].rfind('\n').map_or(0, |k| k + 1);
    let line = view.text[start..].lines().next()?;
    let name = line.strip_prefix("use")?.trim_start().strip_prefix('"')?.split('"').next()?;
    let whole = if name.ends_with(".wfl") { name.to_owned() } else { format!("{name}.wfl") };
    let beside = wfl_tasks::scene_file::plain_path(&view.path.parent()?.join(&whole));
    let known = view.analysis.sources.iter().map(|s| s.1.name.as_str());
    let library = format!("{}{whole}", places::LIBRARY);
    let uri = match view.analysis.source(&beside) {
        Some(_) => places::address(&beside)?,
        None => places::address_of(known.into_iter().find(|n| *n == library)?)?,
    };
    Some(Location { uri, range: lsp_types::Range::default() })
}

/// Every place of the name under the cursor, in order of files and lines.
pub(crate) fn references(view: &View<'_>, position: Position, context: &ReferenceContext) -> Option<Vec<Location>> {
    let key = key_at(view, position)?;
    let mut found: Vec<Location> = Vec::new();
    let mut add = |analysis: &crate::analysis::Analysis, key: &Key| {
        for o in analysis.names().places(key).filter(|o| context.include_declaration || o.declares.is_none()) {
            found.extend(location(analysis, o.span));
        }
    };
    match &key {
        // what is known inside one macro only is in this file
        Key::Local(..) => add(view.analysis, &key),
        _ => view.state.each_scene_with(&view.root, &key, &mut |analysis| add(analysis, &key)),
    }
    found.sort_by_key(|l| (l.uri.as_str().to_owned(), l.range.start.line, l.range.start.character));
    found.dedup();
    Some(found)
}

/// The places of the name under the cursor in this text.
pub(crate) fn highlights(view: &View<'_>, position: Position) -> Option<Vec<DocumentHighlight>> {
    let key = key_at(view, position)?;
    let here = view.analysis.names().of(view.id).iter().filter(|o| o.key == key);
    let mark = |o: &crate::symbols::Occurrence| DocumentHighlight {
        range: view.range(o.span),
        kind: Some(if o.declares.is_some() { DocumentHighlightKind::WRITE } else { DocumentHighlightKind::READ }),
    };
    Some(here.map(mark).collect())
}
