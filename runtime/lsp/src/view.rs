//! A text that is asked about, in the scene that it is part of.

use std::path::PathBuf;

use lsp_server::ErrorCode;
use lsp_types::{Position, Uri};
use wfl::{SourceId, Span};

use crate::{analysis::Analysis, lines::Lines, places, state::State};

/// Why a request has no answer.
pub(crate) struct Refused {
    pub(crate) code: i32,
    pub(crate) why: String,
}

impl Refused {
    pub(crate) fn new(why: impl Into<String>) -> Self {
        Self { code: ErrorCode::RequestFailed as i32, why: why.into() }
    }
}

/// A text that is asked about.
pub(crate) struct View<'s> {
    pub(crate) state: &'s State,
    /// The scene of the text.
    pub(crate) root: PathBuf,
    pub(crate) analysis: &'s Analysis,
    pub(crate) path: PathBuf,
    pub(crate) uri: Uri,
    pub(crate) id: SourceId,
    pub(crate) text: &'s str,
    pub(crate) lines: Lines,
}

impl View<'_> {
    pub(crate) fn offset(&self, position: Position) -> usize {
        self.lines.offset(self.text, position)
    }

    pub(crate) fn range(&self, span: Span) -> lsp_types::Range {
        self.lines.range(self.text, span.start as usize, span.end as usize)
    }
}

/// The text at an address; none if it is not known.
pub(crate) fn view<'s>(state: &'s State, uri: &Uri) -> Option<View<'s>> {
    let path = places::file(uri)?;
    let (root, analysis) = state.analysis(&path)?;
    let id = analysis.source(&path)?;
    let text: &str = &analysis.sources.get(id).text;
    Some(View { state, root, analysis, path, uri: uri.clone(), id, text, lines: Lines::new(text) })
}
