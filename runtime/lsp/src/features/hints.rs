//! Shapes of macros behind their heads, and values of params that are computed.

use lsp_types::{InlayHint, InlayHintKind, InlayHintLabel, InlayHintTooltip, Range};
use wfl::{Span, ast::ExprKind};

use crate::{features::docs, view::View};

pub(crate) fn hints(view: &View<'_>, range: Range) -> Vec<InlayHint> {
    let from = view.offset(range.start);
    let to = view.offset(range.end);
    let shown = |span: &Span| span.source == view.id && from <= span.end as usize && span.end as usize <= to;
    let mut list: Vec<InlayHint> = Vec::new();
    for (head, about) in view.analysis.macros_of(view.id).into_iter().filter(|m| shown(&m.0)) {
        let hint = hint(view, head.end, format!(" : {}", about.shape));
        list.push(InlayHint { tooltip: Some(InlayHintTooltip::String(docs::about(&about))), ..hint });
    }
    if let Some(sketch) = view.analysis.sketch() {
        let params = view.analysis.script.params.iter();
        for param in params.filter(|p| shown(&p.value.span) && !is_written(&p.value.kind)) {
            let values = sketch.param(&param.name.name).map_or(&[][..], |c| c.values.as_slice());
            if let [value] = values {
                list.push(hint(view, param.value.span.end, format!(" = {}", docs::number(*value))));
            }
        }
    }
    list.sort_by_key(|h| (h.position.line, h.position.character));
    list
}

fn hint(view: &View<'_>, at: u32, label: String) -> InlayHint {
    InlayHint {
        position: view.lines.position(view.text, at as usize),
        label: InlayHintLabel::String(label),
        kind: Some(InlayHintKind::TYPE),
        text_edits: None,
        tooltip: None,
        padding_left: None,
        padding_right: None,
        data: None,
    }
}

/// A number that is there to be read; `auto` stands for one that the mesh gives.
fn is_written(value: &ExprKind) -> bool {
    match value {
        ExprKind::Number(_) | ExprKind::Tensor(_) => true,
        ExprKind::Negate(inner) => matches!(inner.kind, ExprKind::Number(_)),
        _ => false,
    }
}
