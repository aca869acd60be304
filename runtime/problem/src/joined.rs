//! One unknown on both sides of faces that lie on one another without being one face: E409 where a face is divided on
//! the other side, W405 where nothing joins what may have been meant as one body.
//!
//! Two bodies that touch, a fault with doubled nodes and the flanks of a crack have such faces, too, and are right. So it
//! is an error only where all vertices of a face are those of faces on it and no interface or mapping uses them: around
//! the face the cells are one body, and a continuous field jumps at the node that hangs there. All else is a warning, and
//! none where a statement names the faces or each side has an unknown of its own. Promises: changes nothing.

use std::collections::BTreeSet;

use wfl::{Code, Diagnostic, Span, ast::MappingKind};
use wfl_compiler::types::FieldKind;
use wfl_discrete::{
    field::{Field, FieldSpace},
    space::Support,
};
use wfl_mesh::mesh::{Against, Divided, FacetRef, RegionSet, divided_facets, facets_against};

use super::{Builder, Parts, coverage, terms::PlacedLaw};

/// Faces that statements name.
#[derive(Default)]
struct Named {
    /// By interfaces and mappings, which join or part what is on both sides.
    joined: BTreeSet<FacetRef>,
    /// By terms and prescribed values, but for those on the whole boundary.
    held: BTreeSet<FacetRef>,
}

impl Builder<'_> {
    /// What only the whole mesh shows: cells without a term, and faces that are not joined.
    pub(super) fn gaps(&mut self, laws: &[PlacedLaw]) {
        coverage::check(self.script, &self.mesh, laws, self.diagnostics);
        let Some(span) = self.script.mesh.as_ref().map(|statement| statement.span) else { return };
        let (parts, diagnostics) = self.parts();
        let pairs = facets_against(parts.mesh, parts.topology);
        if pairs.is_empty() {
            return;
        }
        let named = named(parts, laws);
        let divided = divided(parts, &pairs, &named);
        diagnostics.extend(hanging(parts, &divided, span));
        diagnostics.extend(torn(parts, &pairs, &divided, &named, span));
    }
}

/// The faces that statements name.
fn named(parts: Parts<'_>, laws: &[PlacedLaw]) -> Named {
    let mut named = Named::default();
    for region in parts.regions.values() {
        if let RegionSet::Interface(pairs) = &region.set {
            named.joined.extend(pairs.iter().flat_map(|pair| [pair.here, pair.there]));
        }
    }
    let facets = |name: &str| match parts.regions.get(name).map(|region| &region.set) {
        Some(RegionSet::Facets(facets)) => facets.as_slice(),
        _ => &[],
    };
    for mapping in &parts.script.mappings {
        if let MappingKind::Search { from, onto, .. } = &mapping.kind {
            named.joined.extend(facets(&from.name).iter().chain(facets(&onto.name)));
        }
    }
    for law in laws {
        let Some(RegionSet::Facets(facets)) = &law.set else { continue };
        if law.law.listing.graph.mapping.is_some() {
            named.joined.extend(facets);
        } else if law.place != "boundary" {
            named.held.extend(facets);
        }
    }
    let places = parts.script.fixes.iter().flat_map(|fix| &fix.places);
    for place in places.filter(|place| place.name != "boundary") {
        named.held.extend(facets(&place.name));
    }
    named
}

/// The first unknown that lives in the cells behind all these faces.
fn common<'a>(parts: Parts<'a>, facets: &[FacetRef]) -> Option<&'a Field> {
    let on_cells = |f: &Field| match &f.space {
        FieldSpace::Nodal(space) => matches!(space.support(), Support::Cells(_)),
        _ => false,
    };
    let unknowns = parts.fields.iter().filter(|f| f.kind == FieldKind::Unknown && on_cells(f));
    unknowns.into_iter().find(|f| facets.iter().all(|facet| f.lives_in_cell(facet.cell)))
}

/// The divided faces at which an unknown jumps, and that nothing joins.
fn divided(parts: Parts<'_>, pairs: &[Against], named: &Named) -> Vec<(Divided, String)> {
    let jumps = |divided: Divided| {
        let mut all = divided.parts.clone();
        all.push(divided.whole);
        if all.iter().any(|facet| named.joined.contains(facet)) {
            return None;
        }
        let field = common(parts, &all)?.name.clone();
        Some((divided, field))
    };
    divided_facets(parts.mesh, pairs).into_iter().filter_map(jumps).collect()
}

/// E409 for the faces that are divided on the other side.
fn hanging(parts: Parts<'_>, divided: &[(Divided, String)], span: Span) -> Option<Diagnostic> {
    // a face with a node on it is the whole one; of faces that overlap in part each is that of the other
    let (first, field) = divided.iter().find(|(d, _)| d.hanging.is_some()).or(divided.first())?;
    let mesh = parts.mesh;
    let name = |facet: &FacetRef| mesh.numbers().cell(facet.cell).to_string();
    let cells = first.parts.iter().map(name).collect::<Vec<_>>().join(" and ");
    let many = match divided.len() {
        1 => "a face of the mesh lies".to_owned(),
        n => format!("{n} faces of the mesh lie"),
    };
    let d = Diagnostic::new(
        Code::E409,
        format!("{many} against parts of others: neighbours share whole faces, and `{field}` would jump there"),
    );
    let whole = name(&first.whole);
    let x = mesh.facet_centroid(first.whole);
    let place = match first.hanging {
        Some(node) => {
            let at = &mesh.node(node)[..mesh.dim()];
            format!(
                "{} at {at:?} lies on a face of {whole}, which has no node there, but {cells}",
                mesh.numbers().node(node)
            )
        }
        None => format!("a face of {whole} around {:?} overlaps faces of {cells}", &x[..mesh.dim()]),
    };
    let d = d.at(span, format!("the first: {place}"));
    Some(d.help(
        "divide both sides alike where the mesh is made (in Gmsh: BooleanFragments before meshing); bodies that only touch \
         have an unknown each, or a mapping between their faces",
    ))
}

/// W405 for faces that lie on one another, with one unknown on both sides and nothing that joins them. Nodes of one body
/// at one place are told where the file is read.
fn torn(
    parts: Parts<'_>,
    pairs: &[Against],
    divided: &[(Divided, String)],
    named: &Named,
    span: Span,
) -> Option<Diagnostic> {
    let mesh = parts.mesh;
    let bodies = mesh.bodies();
    let body = |facet: FacetRef| bodies[mesh.cell_nodes(facet.cell)[0].index()];
    let told: BTreeSet<FacetRef> = divided.iter().flat_map(|(d, _)| d.parts.iter().copied().chain([d.whole])).collect();
    let mut apart = Vec::new();
    for pair in pairs {
        let sides = [pair.large, pair.small];
        let is_named = |f: &FacetRef| named.joined.contains(f) || named.held.contains(f) || told.contains(f);
        let told_before = pair.matches && body(pair.large) == body(pair.small);
        if told_before || sides.iter().any(is_named) {
            continue;
        }
        if let Some(field) = common(parts, &sides) {
            apart.push((sides, &field.name));
        }
    }
    let ([here, there], field) = apart.first()?;
    let (many, lie) = match apart.len() {
        1 => ("1 pair of faces".to_owned(), "lies"),
        n => (format!("{n} pairs of faces"), "lie"),
    };
    let what =
        format!("{many} of the mesh {lie} on each other without being joined, and `{field}` lives on both sides");
    let x = mesh.facet_centroid(*there);
    let name = |facet: &FacetRef| mesh.numbers().cell(facet.cell);
    let place = format!("the first: {} and {} around {:?}", name(here), name(there), &x[..mesh.dim()]);
    let d = Diagnostic::new(Code::W405, what).at(span, place);
    Some(d.help(
        "if this is one body, merge the nodes in the mesh generator; bodies that touch have a mapping or an interface \
         between them, or an unknown each",
    ))
}
