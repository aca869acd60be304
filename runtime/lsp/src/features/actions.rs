//! Quick fixes: the changes that messages in a range offer.

use lsp_types::{CodeAction, CodeActionKind, CodeActionOrCommand, Range, TextEdit, WorkspaceEdit};
use wfl::{Edit, edits};

use crate::{
    analysis::Analysis,
    features::diagnostics::{self, location},
    view::View,
};

pub(crate) fn actions(view: &View<'_>, range: Range) -> Vec<CodeActionOrCommand> {
    let checked = view.state.check_of(&view.root).map(|found| &found.messages);
    let messages = checked.unwrap_or(&view.analysis.messages);
    let (from, to) = (view.offset(range.start), view.offset(range.end));
    let mut list: Vec<CodeAction> = Vec::new();
    for message in messages {
        let home = diagnostics::home(view.analysis, message);
        let touches = match home {
            Some(span) => span.source == view.id && span.start as usize <= to && from <= span.end as usize,
            None => view.id == view.analysis.script.main && from == 0,
        };
        if !touches {
            continue;
        }
        for edit in edits(message, &view.analysis.sources) {
            let action = action(view.analysis, edit);
            list.extend(action.filter(|a| list.iter().all(|known| known.title != a.title || known.edit != a.edit)));
        }
    }
    list.into_iter().map(CodeActionOrCommand::CodeAction).collect()
}

/// An edit as a change; none in the library.
fn action(analysis: &Analysis, offered: Edit) -> Option<CodeAction> {
    if analysis.is_library(offered.span.source) {
        return None;
    }
    let place = location(analysis, offered.span)?;
    let edit = TextEdit { range: place.range, new_text: offered.text };
    #[expect(clippy::mutable_key_type, reason = "the protocol keys changes by address")]
    let changes = std::collections::HashMap::from([(place.uri, vec![edit])]);
    Some(CodeAction {
        title: offered.title,
        kind: Some(CodeActionKind::QUICKFIX),
        edit: Some(WorkspaceEdit { changes: Some(changes), ..WorkspaceEdit::default() }),
        is_preferred: Some(true),
        ..CodeAction::default()
    })
}
