//! What does not follow a mesh that moves: mappings, supports whose normals turn, and nodal rules on faces that bend.

use wfl::{Diagnostic, ResolvedScript, ast::TargetPart};
use wfl_compiler::types::InputSlot;
use wfl_discrete::{assemble::Domain, domain::Over, field::FieldSpace, space::Support};
use wfl_mesh::mesh::{FacetRef, Mesh, RegionSet};

use super::ByNode;
use crate::{extended::Extended, refused};

/// A face is still, or a parallelogram, within this part of the largest velocity or coordinate: rounding of positions and of a
/// few products with them.
const ROUNDING: f64 = 1e-12;

/// Refuses what does not follow the velocities of the nodes of the mesh, by entry of the parameters.
pub(super) fn check(
    extended: &Extended<'_>,
    script: &ResolvedScript,
    by_entry: &[ByNode],
) -> Result<(), Box<Diagnostic>> {
    let scene = extended.scene;
    let moving = by_entry.iter().enumerate().filter(|(_, v)| v.iter().flatten().any(|x| *x != 0.0));
    let moving: Vec<(&str, &ByNode)> = moving.map(|(entry, v)| (extended.asked_of(entry), v)).collect();
    let Some((name, _)) = moving.first() else { return Ok(()) };
    let mappings = scene.system.terms.iter().map(|term| term.law.listing.graph.mapping);
    let of_states = scene.states.iter().filter_map(|s| s.at_points()).map(|(value, _)| value.law.mapping);
    if let Some(mapping) = mappings.chain(of_states).flatten().next() {
        return Err(refused::of_mapping(name, script.mappings.get(mapping).map(|m| m.span)));
    }
    // which node follows which is no matter of where they stand, but the axes of a frame are
    let numbering = &scene.system.numbering;
    if numbering.ties().iter().any(|tie| numbering.frames.of(tie.follower).is_some()) {
        return Err(refused::of_ties(name));
    }
    let lives_on_edges = |field: &wfl_discrete::field::Field| match &field.space {
        FieldSpace::Nodal(space) => matches!(space.support(), Support::Edges(_)),
        _ => false,
    };
    if let Some(field) = scene.system.fields.iter().find(|field| lives_on_edges(field)) {
        return Err(refused::of_edges(name, &format!("`{}` lives on edges", field.name), None));
    }
    let mesh = &scene.system.mesh;
    for fix in &script.fixes {
        if !fix.targets.iter().any(|target| matches!(target.part, TargetPart::Normal)) {
            continue;
        }
        let regions = fix.places.iter().filter_map(|p| scene.regions.get(&p.name));
        let faces: Vec<FacetRef> = regions.flat_map(faces).collect();
        if let Some((name, _)) = moving.iter().find(|(_, v)| faces.iter().any(|f| turns(mesh, *f, v))) {
            return Err(refused::of_turning_support(name, fix.span));
        }
    }
    let of_terms = scene.system.terms.iter().zip(&scene.terms);
    let of_terms = of_terms.map(|(term, told)| {
        let law = &term.law.inputs;
        (&*term.integrator.domain, &law[..], told.name.as_str(), told.span)
    });
    let of_measures = extended.measures.iter().flat_map(|(measure, declared)| {
        let parts = measure.at_points().into_iter().flat_map(|(_, parts)| parts);
        parts.map(|(value, sampled)| (&*sampled.domain, &value.law.inputs[..], measure.name.as_str(), declared.span))
    });
    for (domain, inputs, of, span) in of_terms.chain(of_measures) {
        let reads_size = inputs.iter().any(|slot| matches!(slot, InputSlot::ElementSize(_)));
        if domain.over == Over::Edges && reads_size {
            return Err(refused::of_edges(name, "it reads the size of a face", Some((of, span))));
        }
        if let Some((name, _)) = moving.iter().find(|(_, v)| bends(mesh, domain, v)) {
            return Err(refused::of_nodal_faces(name, (of, span)));
        }
    }
    Ok(())
}

fn faces(region: &wfl_problem::NamedRegion) -> Vec<FacetRef> {
    match &region.set {
        RegionSet::Facets(facets) => facets.clone(),
        RegionSet::Interface(pairs) => pairs.iter().map(|p| p.here).collect(),
        _ => Vec::new(),
    }
}

/// Whether the normal of a face turns at one of the nodes of the geometry of its cell on it.
fn turns(mesh: &Mesh, facet: FacetRef, velocity: &[[f64; 3]]) -> bool {
    let (kind, dim) = (mesh.kind(facet.cell), mesh.dim());
    let (element, nodes, local) = (mesh.geometry_element(kind), mesh.cell_nodes(facet.cell), usize::from(facet.local));
    let on_face: Vec<[f64; 3]> = element.facet_closure(local).iter().map(|k| element.points()[*k]).collect();
    let table = element.tabulate(&on_face, 1);
    (0..table.n_points).any(|q| {
        let gradient = |values: &dyn Fn(usize) -> [f64; 3]| {
            nalgebra::Matrix3::from_fn(|i, j| {
                if i >= dim || j >= dim {
                    return f64::from(u8::from(i == j));
                }
                let slope = |k: usize| table.gradients[(q * table.n_dofs + k) * dim + j];
                (0..table.n_dofs).map(|k| slope(k) * values(k)[i]).sum()
            })
        };
        let Some(inverse) = gradient(&|k| mesh.node(nodes[k])).try_inverse() else { return true };
        let mut moved = gradient(&|k| velocity[nodes[k].index()]);
        (dim..3).for_each(|d| moved[(d, d)] = 0.0);
        let d = moved * inverse;
        let n = (inverse.transpose() * nalgebra::Vector3::from(kind.facet_normal(local))).normalize();
        let turned = d.transpose() * n;
        (turned - n * n.dot(&turned)).norm() > ROUNDING * d.norm()
    })
}

/// Whether a nodal rule on quadrilateral faces in space has faces that are no parallelograms, or that do not stay ones: area
/// vectors of its points are those of the functions of the nodes then.
fn bends(mesh: &Mesh, domain: &Domain, velocity: &[[f64; 3]]) -> bool {
    domain.groups.iter().filter(|group| group.areas.is_some()).any(|group| {
        let bent = |facet: &FacetRef| {
            let corners = mesh.facet_vertices(*facet);
            let places = mesh.facet_kind(*facet).vertices();
            let sum = |of: &dyn Fn(usize) -> [f64; 3]| {
                let (mut sum, mut size) = ([0.0f64; 3], 0.0f64);
                for (k, at) in places.iter().enumerate() {
                    let sign = (2.0 * at[0] - 1.0) * (2.0 * at[1] - 1.0);
                    (0..3).for_each(|d| {
                        sum[d] += sign * of(k)[d];
                        size = size.max(of(k)[d].abs());
                    });
                }
                sum.iter().any(|x| x.abs() > ROUNDING * size)
            };
            let node = |k: usize| corners.vertices()[k];
            sum(&|k| mesh.node(node(k))) || sum(&|k| velocity[node(k).index()])
        };
        mesh.order() > 1 || group.here.facets.iter().any(bent)
    })
}
