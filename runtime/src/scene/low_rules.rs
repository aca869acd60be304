//! Quadrature rules of the scene with fewer points than an element has nodes (hourglass modes).

use wfl::{
    Diagnostic, ResolvedScript,
    ast::{Ident, QuadratureRule},
};

use super::terms::PlacedLaw;
use crate::{
    assemble::{Domain, Group},
    field::Field,
};

/// W506 if a term on faces that depends on unknowns is integrated with fewer points than their faces have nodes, by a
/// rule that the scene asks for. Without such a statement the rule follows from the degrees.
pub(super) fn check(
    script: &ResolvedScript,
    placed: &PlacedLaw,
    domain: &Domain,
    fields: &[Field],
    diagnostics: &mut Vec<Diagnostic>,
) {
    let here = |places: &[Ident]| places.iter().any(|p| p.name == placed.place);
    let Some(statement) = script.quadratures.iter().rev().find(|q| here(&q.places)) else { return };
    if statement.rule == QuadratureRule::Vertex {
        return;
    }
    let degree = placed.law.trials.iter().filter_map(|t| fields.get(t.field.index())).map(Field::degree).max();
    let Some(degree) = degree.filter(|k| *k > 0) else { return };
    let short = |g: &&Group| g.tangents.is_some() && g.n_points() < face_nodes(domain.dim, g, degree);
    let Some(group) = domain.groups.iter().find(short) else { return };
    let (points, nodes) = (group.n_points(), face_nodes(domain.dim, group, degree));
    let message = format!(
        "the rule on `{}` has {points} points a face for the {nodes} nodes of degree {degree}: displacements that \
         vanish at the points cause no force",
        placed.place
    );
    let d = Diagnostic::new("W506", message).at(statement.span, "");
    if !diagnostics.contains(&d) {
        diagnostics.push(d);
    }
}

/// Nodes of a Lagrange element of this degree on a face.
fn face_nodes(dim: usize, group: &Group, degree: usize) -> usize {
    match (dim, group.here.kind.is_simplex()) {
        (0 | 1, _) => 1,
        (2, _) => degree + 1,
        (_, true) => (degree + 1) * (degree + 2) / 2,
        (_, false) => (degree + 1).pow(2),
    }
}
