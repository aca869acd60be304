//! Quadrature rules of the scene with fewer points than an element has nodes (hourglass modes).

use wfl::{
    Code, Diagnostic, ResolvedScript,
    ast::{Ident, QuadratureRule},
};
use wfl_compiler::types::Side;
use wfl_discrete::{
    assemble::{Domain, Group},
    field::Field,
};
use wfl_mesh::mesh::Polynomials;

use super::{RuleChoice, terms::PlacedLaw};

/// The rule of a term and the points that it makes.
#[derive(Clone, Copy)]
pub(super) struct Made<'a> {
    pub(super) domain: &'a Domain,
    pub(super) rule: RuleChoice,
}

/// W506 if a term on faces that depends on unknowns is integrated with fewer points than their faces have nodes, by a
/// rule that the scene asks for, or with points that do not share a force rightly among the nodes of the other side.
/// Without such a statement the rule follows from the degrees.
pub(super) fn check(
    script: &ResolvedScript,
    placed: &PlacedLaw,
    made: Made<'_>,
    fields: &[Field],
    diagnostics: &mut Vec<Diagnostic>,
) {
    let Made { domain, rule } = made;
    let here = |places: &[Ident]| places.iter().any(|p| p.name == placed.place);
    let Some(statement) = script.quadratures.iter().rev().find(|q| here(&q.places)) else { return };
    // of the mapped side the faces are others
    let mapped = placed.law.listing.graph.mapping.is_some();
    let highest = |there: bool| {
        let trials = placed.law.trials.iter().filter(|t| (mapped && t.side == Side::There) == there);
        trials.filter_map(|t| fields.get(t.field.index())).map(Field::degree).max().unwrap_or(0)
    };
    let (degree, opposite) = (highest(false), highest(true));
    let low = |degree: usize| {
        let faces = if degree > 0 { of_faces(domain, degree) } else { Vec::new() };
        faces.into_iter().find(|(points, nodes)| points < nodes)
    };
    let is_nodal = statement.rule == QuadratureRule::Vertex;
    let place = &placed.place;
    let message = match (rule, low(if is_nodal { opposite } else { degree })) {
        (_, Some((points, nodes))) if is_nodal => format!(
            "the nodal rule on `{place}` has {points} points a face, and a face of the other side, of degree {opposite}, \
             {nodes} nodes: these have wrong shares of the force, and no constant stress passes"
        ),
        (_, None) if is_nodal => return,
        (RuleChoice::Segments { degree: exact, .. }, _) if exact < degree.max(opposite) => format!(
            "the rule on `{place}` is exact to degree {exact} on each segment for unknowns of degree {}: their nodes have wrong \
             shares of the force, and no constant stress passes",
            degree.max(opposite)
        ),
        (_, Some((points, nodes))) => format!(
            "the rule on `{place}` has {points} points a face for the {nodes} nodes of degree {degree}: displacements that \
             vanish at the points cause no force"
        ),
        _ => return,
    };
    let d = Diagnostic::new(Code::W506, message).at(statement.span, "");
    if !diagnostics.contains(&d) {
        diagnostics.push(d);
    }
}

/// Points of the rule and nodes of an element of this degree, for each kind of faces. Through a mapping the points of a face
/// stand in a group for each image face, and those without an image in none: the rule has as many as the face with the most.
fn of_faces(domain: &Domain, degree: usize) -> Vec<(usize, usize)> {
    let mut points = vec![(0, 0); domain.n_entities];
    let on_faces = domain.entities().filter(|(group, _)| group.tangents.is_some());
    for (group, k) in on_faces.filter(|(group, k)| !group.has_lost_its_image(*k)) {
        let entity = group.entities[k];
        points[entity].0 += group.n_points();
        points[entity].1 = face_nodes(domain.dim, group, degree);
    }
    let mut kinds: Vec<(usize, usize)> = Vec::new();
    for (points, nodes) in points.into_iter().filter(|(points, _)| *points > 0) {
        match kinds.iter_mut().find(|kind| kind.1 == nodes) {
            Some(kind) => kind.0 = kind.0.max(points),
            None => kinds.push((points, nodes)),
        }
    }
    kinds
}

/// Nodes of a Lagrange element of this degree on a face.
fn face_nodes(dim: usize, group: &Group, degree: usize) -> usize {
    let local = group.here.facets.first().map_or(0, |facet| usize::from(facet.local));
    let Some(face) = group.here.kind.facets().get(local) else { return 1 };
    // one node stands for each place of the lattice of a face
    match (dim, face.kind.polynomials()) {
        (0 | 1, _) => 1,
        (2, _) => degree + 1,
        (_, Polynomials::Total) => (degree + 1) * (degree + 2) / 2,
        (_, Polynomials::Each | Polynomials::Both) => (degree + 1).pow(2),
    }
}
