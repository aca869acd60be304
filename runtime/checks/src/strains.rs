//! Strains and motions beyond what a law of small strains knows.
//!
//! A law that depends on Sym(Grad_u) alone, elastic or plastic, is that of a body whose geometry does not change: its errors
//! are of the size of the strain. Where the body has been stretched by a third, or has moved beyond its own size, its numbers
//! are those of no body: a load beyond the limit load, a unit or a power of ten. Strains are those of the lines between the
//! vertices of a cell, so that degree and rule do not matter and a rotation is none.

use wfl_compiler::{
    Class,
    types::{FieldKind, FieldOp, InputSlot},
};
use wfl_discrete::{assemble::AssembledTerm, field::FieldSpace, finite::largest, space::Space, system::System};

use wfl_mesh::mesh::CellKind;

use crate::objectivity::{Strains, strains_of};
use crate::worst::Finding;

/// A strain from which a law of small strains is wrong by more than a quarter: the strain of Green is e + e^2/2, the true
/// one log(1 + e), and at 0.3 they differ by 0.083.
const LARGE: f64 = 0.3;

/// A body whose law is one of small strains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SmallStrainBody {
    /// Its displacement.
    pub field: usize,
    /// The law reads states.
    pub has_memory: bool,
}

/// A body deformed beyond its law.
#[derive(Clone, Debug, PartialEq)]
pub struct LargeStrain {
    /// The displacement.
    pub field: String,
    /// The largest strain of a line between vertices of a cell.
    pub strain: f64,
    /// The largest displacement less the mean one, in parts of the extent of the mesh.
    pub moved: f64,
    /// The centre of the cell with the largest strain.
    pub position: [f64; 3],
    /// Its law has a memory: then its size matters, also where a scene has no units.
    pub has_memory: bool,
}

/// The displacements with laws of small strains, by number; whether their size matters in a scene without units.
#[must_use]
pub fn small_strain_bodies(system: &System) -> Vec<SmallStrainBody> {
    let dim = system.mesh.dim();
    let vector = |k: &usize| {
        let f = &system.fields[*k];
        let nodal = matches!(f.space, FieldSpace::Nodal(_));
        f.kind == FieldKind::Unknown && f.n_components == dim && f.degree() > 0 && nodal && system.range(*k).is_some()
    };
    let small = |k: &usize| strains_of(system, *k) == Some(Strains::Small);
    let all = (0..system.fields.len()).filter(|k| dim > 1 && vector(k) && small(k));
    all.map(|field| SmallStrainBody { field, has_memory: has_memory(system, field) }).collect()
}

/// True for a body with a law that reads states, as they are or, as return mappings do, as they were.
fn has_memory(system: &System, field: usize) -> bool {
    let reads_state = |slot: &InputSlot| match slot {
        InputSlot::Field(b) | InputSlot::Previous(b) | InputSlot::History(_, b) => {
            system.fields.get(b.field.index()).is_some_and(|f| f.kind == FieldKind::State)
        }
        _ => false,
    };
    let stress = |t: &AssembledTerm| t.law.tests.iter().any(|s| s.field.index() == field && s.op == FieldOp::Grad);
    let moves = |t: &&AssembledTerm| t.on_cells() && t.law.class > Class::Constant && stress(t);
    system.terms.iter().filter(moves).any(|t| t.law.inputs.iter().any(reads_state))
}

/// The bodies among these that are deformed beyond their laws at `u`.
#[must_use]
pub fn large_strains(system: &System, u: &[f64], bodies: &[SmallStrainBody]) -> Vec<LargeStrain> {
    bodies.iter().filter_map(|body| large_strain(system, u, *body)).collect()
}

fn large_strain(system: &System, u: &[f64], body: SmallStrainBody) -> Option<LargeStrain> {
    let SmallStrainBody { field, has_memory } = body;
    let (f, range) = (&system.fields[field], system.range(field)?);
    let FieldSpace::Nodal(space) = &f.space else { return None };
    let (values, team) = (&u[range], system.team());
    let extent = {
        let (low, high) = system.mesh.bounds();
        (0..3).fold(0.0, |m: f64, d| m.max(high[d] - low[d]))
    };
    let moved = moved(system, field, values) / extent;
    let mut worst = (0.0f64, [0.0; 3]);
    let size = largest(values.iter().copied());
    if team.any(size > 0.0) {
        let mut vertices: Vec<(CellKind, Vec<usize>)> = Vec::new();
        for cell in system.mesh.cells() {
            let Some(position) = space.position_of_cell(cell) else { continue };
            let element = space.element_at(position);
            if vertices.last().is_none_or(|(kind, _)| *kind != element.kind()) {
                vertices.push((element.kind(), element.vertex_dofs().unwrap_or_default()));
            }
            let local = vertices.last().map_or(&[][..], |(_, local)| local);
            let nodes = space.entity_nodes(position);
            let strain = strain_of_cell(space, local.iter().map(|k| nodes[*k] as usize), values, f.n_components);
            if strain > worst.0 {
                worst = (strain, system.mesh.centroid(cell));
            }
        }
    }
    let own = (worst.0 > 0.0).then(|| Finding { size: worst.0, numbers: worst.1.to_vec(), names: Vec::new() });
    let Finding { size, numbers, .. } = Finding::worst(own, team)?;
    let position = numbers.try_into().ok()?;
    (size > LARGE || moved > 1.0).then(|| LargeStrain {
        field: f.name.clone(),
        strain: size,
        moved,
        position,
        has_memory,
    })
}

/// The largest displacement less the mean one, of the nodes of all ranks.
fn moved(system: &System, field: usize, values: &[f64]) -> f64 {
    let n = system.fields[field].n_components;
    let Some(range) = system.range(field) else { return 0.0 };
    let nodes = || values.chunks_exact(n).enumerate().filter(|(k, _)| system.owns(range.start + k * n));
    // what is summed, and behind it over how many nodes
    let mut sums = vec![0.0; n + 1];
    for (_, node) in nodes() {
        sums.iter_mut().zip(node.iter().chain(&[1.0])).for_each(|(sum, x)| *sum += x);
    }
    system.team().sum(&mut sums);
    let mean: Vec<f64> = sums[..n].iter().map(|sum| sum / sums[n].max(1.0)).collect();
    let of_node = |node: &[f64]| node.iter().zip(&mean).fold(0.0f64, |m, (x, mean)| m.hypot(x - mean));
    system.team().largest(nodes().map(|(_, node)| of_node(node)).fold(0.0, f64::max))
}

/// The largest strain of a line between some nodes.
fn strain_of_cell(space: &Space, nodes: impl Iterator<Item = usize> + Clone, values: &[f64], dim: usize) -> f64 {
    let mut largest = 0.0f64;
    for (k, a) in nodes.clone().enumerate() {
        for b in nodes.clone().take(k) {
            let (x, y) = (space.node_coordinates()[a], space.node_coordinates()[b]);
            let (mut along, mut length) = (0.0, 0.0);
            for d in 0..dim {
                along += (x[d] - y[d]) * (values[a * dim + d] - values[b * dim + d]);
                length += (x[d] - y[d]) * (x[d] - y[d]);
            }
            if length > 0.0 {
                largest = largest.max((along / length).abs());
            }
        }
    }
    largest
}
