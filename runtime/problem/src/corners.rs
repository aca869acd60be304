//! Multipliers of one component along the normal of a surface with corners: at a corner one value holds one combination of
//! the displacements along several normals.
//!
//! Promises: says so (W424) of laws that are linear, which hold what they say wherever they stand; a law of contact may be
//! open on all faces of a corner but one.

use std::collections::BTreeSet;

use wfl::{Code, Diagnostic};
use wfl_compiler::{
    Class,
    types::{FieldKind, InputSlot, Side},
};
use wfl_discrete::{field::FieldSpace, space::Support};
use wfl_mesh::element::Family;

use super::{
    constraints::{SAME_PLACE, extent},
    meeting::Multipliers,
    normals::node_normals,
};

/// W424 for each multiplier with one value for displacements along several normals, of which none is prescribed.
pub(super) fn several_normals(on: &Multipliers<'_>) -> Vec<Diagnostic> {
    (0..on.fields.len()).filter_map(|k| told(on, k, &corners(on, k)?)).collect()
}

/// The nodes of multiplier `k` at corners; `None` where it has one jump whatever its surface is.
fn corners(on: &Multipliers<'_>, k: usize) -> Option<BTreeSet<u32>> {
    let field = &on.fields[k];
    let (FieldKind::Multiplier, FieldSpace::Nodal(space), 1) = (field.kind, &field.space, field.n_components) else {
        return None;
    };
    let Support::Facets(facets) = space.support() else { return None };
    let own: Vec<_> = on.laws.iter().filter(|placed| placed.law.tests.iter().any(|t| t.field.index() == k)).collect();
    let along_normals = own.iter().any(|p| p.law.inputs.iter().any(|i| matches!(i, InputSlot::Normal(Side::Here, _))));
    let linear = own.iter().all(|placed| placed.law.class <= Class::Linear);
    if space.family() != Family::Continuous || !along_normals || !linear {
        return None;
    }
    let trials: BTreeSet<usize> = own.iter().flat_map(|p| &p.law.trials).map(|s| s.field.index()).collect();
    let mut beside = facets.clone();
    beside.sort_unstable();
    let near = SAME_PLACE * extent(on.mesh);
    let node_at = |x: [f64; 3]| {
        let is_there = |y: &[f64; 3]| (0..3).all(|d| (x[d] - y[d]).abs() <= near);
        (0u32..).zip(space.node_coordinates()).find(|(_, y)| is_there(y)).map(|(node, _)| node)
    };
    let mut found = BTreeSet::new();
    for v in trials.into_iter().filter(|v| on.fields[*v].n_components > 1) {
        let FieldSpace::Nodal(displacements) = &on.fields[v].space else { continue };
        let normals = node_normals(on.mesh, on.topology, displacements, facets, &beside);
        let ends = normals.into_iter().filter(|(node, list)| list.len() > 1 && !is_bound(on, v, *node));
        found.extend(ends.filter_map(|(node, _)| node_at(displacements.node_coordinates()[node as usize])));
    }
    Some(found)
}

/// Whether something is prescribed at a node of field `v`.
fn is_bound(on: &Multipliers<'_>, v: usize, node: u32) -> bool {
    let Some(start) = on.numbering.starts[v] else { return true };
    let n = on.fields[v].n_components;
    let first = start + node as usize * n;
    (first..first + n).any(|dof| on.fixed.contains(&dof) || on.numbering.frames.of(dof).is_some())
}

fn told(on: &Multipliers<'_>, k: usize, nodes: &BTreeSet<u32>) -> Option<Diagnostic> {
    let first = on.fields[k].node_position(*nodes.first()? as usize);
    let many = if nodes.len() == 1 { "1 node".to_owned() } else { format!("{} nodes", nodes.len()) };
    let text = format!("`{}` has one value for displacements along several normals at {many}", on.fields[k].name);
    let at = format!("its surface has a corner there, the first at {:?}", &first[..on.mesh.dim()]);
    let d = Diagnostic::new(Code::W424, text).at(on.script.fields[k].name.span, at);
    Some(
        d.note("it holds one combination of them: the corner moves, with an error of the size of the faces beside it")
            .help(
                "a multiplier for each smooth part of the surface, or one value a face (`DP0`) beside displacements of \
                 degree two",
            ),
    )
}
