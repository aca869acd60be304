//! W417: jumps of fields that have the same unknowns on both sides of the faces.
//!
//! The compiler finds the differences of values on both sides; here the spaces tell whether the nodes of the faces are
//! the same from both sides. Faces of a region of which a part only is split give no message: the jump is zero there by
//! intention, as it is at the front of a crack.

use wfl::{Code, Diagnostic, Span};
use wfl_compiler::{
    ValueJump,
    ir::Origin,
    locate,
    types::{FieldId, FieldKind},
};
use wfl_discrete::{
    field::{Field, FieldSpace},
    space::Support,
};
use wfl_mesh::{
    element::Family,
    mesh::{FaceEdge, InterfaceFacet, RegionSet},
};

use super::Parts;

/// W417 for the jumps of an expression on a place that are zero on all its faces. All places of one field and one region
/// are in one message.
pub(super) fn check(
    parts: Parts<'_>,
    place: &str,
    set: &RegionSet,
    jumps: &[ValueJump],
    diagnostics: &mut Vec<Diagnostic>,
) {
    parts.mesh.check_whole(|| check_all(parts, place, set, jumps, diagnostics));
}

fn check_all(parts: Parts<'_>, place: &str, set: &RegionSet, jumps: &[ValueJump], diagnostics: &mut Vec<Diagnostic>) {
    if let RegionSet::Edges(edges) = set {
        along(parts, place, edges, jumps, diagnostics);
    }
    let RegionSet::Interface(faces) = set else { return };
    for jump in jumps {
        let Some(origin) = jump.origin else { continue };
        if faces.is_empty() || !jump.fields.iter().all(|f| is_one_valued(parts, *f, faces)) {
            continue;
        }
        let unknown = |f: &&FieldId| parts.fields[f.index()].kind == FieldKind::Unknown;
        let Some(field) = jump.fields.iter().find(unknown).or(jump.fields.first()) else { continue };
        let field = &parts.fields[field.index()];
        let message = format!("the jump of `{}` over `{place}` is zero", field.name);
        match diagnostics.iter_mut().find(|d| d.code == Code::W417 && d.message == message) {
            Some(told) => add_place(parts, told, origin),
            None => {
                let d = cured(Diagnostic::new(Code::W417, message), parts, field, place, faces);
                let text = format!("`{}` has one value on both sides of all {} faces", field.name, faces.len());
                diagnostics.push(locate(d, origin, parts.env.expansions, text));
            }
        }
    }
}

/// The same from face to face of a surface: continuous fields on faces have one value on an edge.
fn along(parts: Parts<'_>, place: &str, edges: &[FaceEdge], jumps: &[ValueJump], diagnostics: &mut Vec<Diagnostic>) {
    let is_one_valued = |f: &FieldId| match &parts.fields[f.index()].space {
        FieldSpace::Nodal(space) => {
            space.family() == Family::Continuous && matches!(space.support(), Support::Facets(_)) && !space.is_split()
        }
        _ => false,
    };
    for jump in jumps {
        let (Some(origin), Some(first)) = (jump.origin, jump.fields.first()) else { continue };
        if !jump.fields.iter().all(is_one_valued) {
            continue;
        }
        let name = &parts.fields[first.index()].name;
        let message = format!("the jump of `{name}` over `{place}` is zero");
        if let Some(told) = diagnostics.iter_mut().find(|d| d.code == Code::W417 && d.message == message) {
            add_place(parts, told, origin);
            continue;
        }
        let d = Diagnostic::new(Code::W417, message);
        let d = d.help(format!("a discontinuous element of `{name}`, such as DP0"));
        let text = format!("`{name}` has one value on both sides of all {} edges between faces", edges.len());
        diagnostics.push(locate(d, origin, parts.env.expansions, text));
    }
}

/// The message with what makes a field jump there.
fn cured(d: Diagnostic, parts: Parts<'_>, field: &Field, place: &str, faces: &[InterfaceFacet]) -> Diagnostic {
    match field.kind {
        _ if is_torn_along_all(parts, field, faces) => {
            d.help("all nodes of these faces are ends of the crack; more faces, or an element of degree 2, have others")
        }
        FieldKind::Unknown if place == "interior" => d.help(format!(
            "a discontinuous element of `{}`, such as DP1, or: split {} across a crack",
            field.name, field.name
        )),
        FieldKind::Unknown => d.missing(format!("split {} across {place}", field.name)),
        _ => d.help("only unknowns can be split; a field for each side has two values"),
    }
}

/// A further place of the same jump.
fn add_place(parts: Parts<'_>, told: &mut Diagnostic, origin: Origin) {
    let span = outermost(parts, origin);
    if told.labels.iter().all(|l| l.span != span) {
        *told = told.clone().at(span, "here, too");
    }
}

/// The place of an expression, or of the use of the macro that it stands in.
fn outermost(parts: Parts<'_>, origin: Origin) -> Span {
    let (mut span, mut next) = (origin.span, origin.expansion);
    while let Some(id) = next {
        let used = &parts.env.expansions.list[id.index()];
        (span, next) = (used.call, used.parent);
    }
    span
}

/// True if `split` names all these faces.
fn is_torn_along_all(parts: Parts<'_>, field: &Field, faces: &[InterfaceFacet]) -> bool {
    let FieldSpace::Nodal(space) = &field.space else { return false };
    faces.iter().all(|f| space.is_torn_along(parts.topology.facet_id(f.here)))
}

/// True if a field has the same unknowns, seen from both sides, on all these faces. W411 tells of fields that are split
/// without effect.
fn is_one_valued(parts: Parts<'_>, field: FieldId, faces: &[InterfaceFacet]) -> bool {
    let field = &parts.fields[field.index()];
    let FieldSpace::Nodal(space) = &field.space else { return false };
    // an element of degree 0 has no nodes on faces at all
    let continuous = space.family() == Family::Continuous && matches!(space.support(), Support::Cells(_));
    let nodes = |facet| space.nodes_on_facets(parts.mesh, parts.topology, &[facet]);
    let shared = |f: &InterfaceFacet| {
        let both = field.lives_in_cell(f.here.cell) && field.lives_in_cell(f.there.cell);
        both && nodes(f.here) == nodes(f.there)
    };
    let told = !space.is_split() && is_torn_along_all(parts, field, faces);
    continuous && faces.iter().all(shared) && !told
}
