//! How parameters move the mesh: from the formulas of its corners, its place and its map, differentiated, to the velocities of
//! its nodes, of the nodes of all fields, and of the sizes of its cells.
//!
//! Cells, faces and regions stay what they are. Nothing is differenced; only whether a region stays the same is looked at on
//! meshes that are displaced a little.

mod limits;
mod placing;

use std::collections::BTreeMap;

use wfl::{
    Diagnostic, ResolvedScript,
    ast::{BoxDivision, Expr, MeshSource},
};
use wfl_compiler::{Constant, types::InputSlot};
use wfl_discrete::{
    field::FieldSpace,
    space::{Space, Support},
    window::Window,
};
use wfl_mesh::{
    element::Table,
    mesh::{CellKind, Mesh, summary},
};
use wfl_problem::{Regions, corners_of, displaced_regions};

use super::{
    Differentiated, extended::Extended, formulas::Formula, near::NearKink, parameters::from_declared,
    refused::not_made, velocities::Velocities,
};

/// Velocities by node of the mesh.
type ByNode = Vec<[f64; 3]>;

/// Finds the velocities where parameters move the mesh; refuses what does not follow them.
pub(super) fn find(extended: &mut Extended<'_>, of: Differentiated<'_>) -> Result<(), Box<Diagnostic>> {
    if !extended.has_motion() {
        return Ok(());
    }
    let script = of.script;
    let by_entry = of_nodes(extended, script)?;
    limits::check(extended, script, &by_entry)?;
    let mesh = &extended.scene.system.mesh;
    let of_sizes: Vec<OfSizes> = match reads_sizes(extended) {
        true => by_entry.iter().map(|v| sizes(mesh, v)).collect(),
        false => Vec::new(),
    };
    let kinked = of_sizes.iter().map(|s| s.kinked).max().unwrap_or(0);
    let sizes = of_sizes.into_iter().map(|s| s.moved).collect();
    let Some(space) = extended.velocity_space() else { return Ok(()) };
    let mut of_space = vec![vec![0.0; space.n_nodes() * mesh.dim()]; by_entry.len()];
    each_node(mesh, space, |node, moved| {
        for (values, v) in of_space.iter_mut().zip(moved(&by_entry)) {
            values[node * mesh.dim()..][..mesh.dim()].copy_from_slice(&v[..mesh.dim()]);
        }
    });
    let mut velocities = Velocities::new(of_space, sizes, kinked);
    for field in extended.scene.system.fields.iter() {
        let FieldSpace::Nodal(space) = &field.space else {
            let n = by_entry.len();
            if matches!(field.space, FieldSpace::Global) && !velocities.knows([0.0; 3]) {
                velocities.tell([0.0; 3], vec![[0.0; 3]; n]);
            }
            continue;
        };
        each_node(mesh, space, |node, moved| {
            velocities.tell(space.node_coordinates()[node], moved(&by_entry));
        });
    }
    extended.velocities = Some(velocities);
    Ok(())
}

/// Refuses what does not follow a mesh that parameters move, as far as that is known without a run.
pub(super) fn ahead(extended: &Extended<'_>, script: &ResolvedScript) -> Result<(), Box<Diagnostic>> {
    if !extended.has_motion() {
        return Ok(());
    }
    limits::check(extended, script, &of_nodes(extended, script)?)
}

/// By entry of the parameters that change the velocity of each node of the mesh.
fn of_nodes(extended: &Extended<'_>, script: &ResolvedScript) -> Result<Vec<ByNode>, Box<Diagnostic>> {
    let (scene, n) = (extended.scene, extended.n_live());
    let Some(statement) = &script.mesh else { return Ok(vec![Vec::new(); n]) };
    let (mesh, dim) = (&scene.system.mesh, scene.system.mesh.dim());
    let before: &[[f64; 3]] = scene.unmapped.as_deref().unwrap_or(mesh.nodes());
    if before.len() != mesh.n_nodes() {
        return Err(not_made("the nodes before the map of the mesh are not those behind it"));
    }
    let mut velocities = match &statement.source {
        MeshSource::Box { from, to, .. } => of_box(extended, script, (from, to), before)?,
        MeshSource::Files(files) => placing::of_files(extended, script, files, before)?,
    };
    let Some(map) = &statement.map else { return Ok(velocities) };
    let map = Formula::new(extended, "the map of the mesh", map)?;
    let slopes = map.slopes_in_space(extended, (before, Window::default()))?;
    for (entry, velocities) in velocities.iter_mut().enumerate() {
        let own = moved_by(extended, &map, before, entry)?;
        for (node, v) in velocities.iter_mut().enumerate() {
            *v = std::array::from_fn(|i| {
                let through: f64 = slopes
                    .iter()
                    .enumerate()
                    .map(|(d, slope)| slope.as_ref().map_or(0.0, |s| component(s, dim, node, i)) * v[d])
                    .sum();
                through + component(&own, dim, node, i)
            });
        }
    }
    Ok(velocities)
}

/// A component of values by node; zero where there is none.
fn component(values: &[f64], dim: usize, node: usize, i: usize) -> f64 {
    if i < dim { values.get(node * dim + i).copied().unwrap_or(0.0) } else { 0.0 }
}

/// What an entry of the parameters moves a formula by, at positions.
fn moved_by(
    extended: &Extended<'_>,
    formula: &Formula,
    positions: &[[f64; 3]],
    entry: usize,
) -> Result<Vec<f64>, Box<Diagnostic>> {
    let unit: Vec<f64> = (0..extended.n_live()).map(|k| f64::from(u8::from(k == entry))).collect();
    formula.moved_in_place(extended, (positions, Window::default()), &unit)
}

/// Each node keeps its part of the way from one corner of the box to the other.
fn of_box(
    extended: &Extended<'_>,
    script: &ResolvedScript,
    of: (&Expr, &Expr),
    nodes: &[[f64; 3]],
) -> Result<Vec<ByNode>, Box<Diagnostic>> {
    let params: BTreeMap<String, Constant> = extended.scene.params.iter().cloned().collect();
    let Some([low, high]) = corners_of(script, &params) else { return Err(not_made("the box has no corners")) };
    let dim = extended.scene.system.mesh.dim();
    let formulas = [Formula::new(extended, "a corner", of.0)?, Formula::new(extended, "a corner", of.1)?];
    let of_entry = |entry: usize| {
        let [from, to] = [&formulas[0], &formulas[1]].map(|f| moved_by(extended, f, &[[0.0; 3]], entry));
        let (from, to) = (from?, to?);
        let of_node = |x: &[f64; 3]| {
            std::array::from_fn(|d| {
                let part = if d < dim { (x[d] - low[d]) / (high[d] - low[d]) } else { 0.0 };
                (1.0 - part) * component(&from, dim, 0, d) + part * component(&to, dim, 0, d)
            })
        };
        Ok(nodes.iter().map(of_node).collect())
    };
    (0..extended.n_live()).map(of_entry).collect()
}

/// Calls `f` with each node of a space, once, and with what makes its velocities of those of the nodes of the mesh.
fn each_node(mesh: &Mesh, space: &Space, mut f: impl FnMut(usize, &dyn Fn(&[ByNode]) -> ByNode)) {
    let mut tables: BTreeMap<(CellKind, Option<u8>), Table> = BTreeMap::new();
    let mut is_known = vec![false; space.n_nodes()];
    for position in 0..space.n_positions() {
        let (cell, local) = match space.support() {
            Support::Cells(cells) => (cells[position], None),
            Support::Facets(facets) => (facets[position].cell, Some(facets[position].local)),
            // refused with the others in `limits.rs`
            Support::Edges(_) => return,
        };
        let kind = mesh.kind(cell);
        let table = tables.entry((kind, local)).or_insert_with(|| {
            let points = space.element_at(position).points().iter();
            let in_cell = |p: &[f64; 3]| local.map_or(*p, |local| kind.facet_map(usize::from(local)).apply(*p));
            mesh.geometry_element(kind).tabulate(&points.map(in_cell).collect::<Vec<_>>(), 0)
        });
        for (q, node) in space.entity_nodes(position).iter().enumerate() {
            let node = *node as usize;
            if std::mem::replace(&mut is_known[node], true) {
                continue;
            }
            let functions = &table.values[q * table.n_dofs..][..table.n_dofs];
            let corners = mesh.cell_nodes(cell);
            f(node, &|by_entry| {
                let of = |v: &ByNode| {
                    let mut sum = [0.0; 3];
                    for (n, function) in corners.iter().zip(functions) {
                        (0..3).for_each(|d| sum[d] += function * v[n.index()][d]);
                    }
                    sum
                };
                by_entry.iter().map(of).collect()
            });
        }
    }
}

/// Whether a law reads the sizes of cells.
fn reads_sizes(extended: &Extended<'_>) -> bool {
    let scene = extended.scene;
    let reads = |inputs: &[InputSlot]| inputs.iter().any(|slot| matches!(slot, InputSlot::ElementSize(_)));
    let of_measures = extended.measures.iter().filter_map(|(m, _)| m.at_points()).flat_map(|(_, parts)| parts);
    let of_states = scene.states.iter().filter_map(|s| s.at_points());
    scene.system.terms.iter().any(|term| reads(&term.law.inputs))
        || of_states.map(|(value, _)| value).chain(of_measures.map(|part| &part.0)).any(|v| reads(&v.law.inputs))
}

/// What the sizes of cells move by.
struct OfSizes {
    moved: Vec<f64>,
    /// Cells that have several smallest extents, which move differently.
    kinked: usize,
}

/// Singular values that are the same within this part of them are one; so are what they move by.
const SAME: f64 = 1e-9;

/// What the size of each cell moves by: with u and v the singular vectors of the smallest singular value of the gradient K of
/// the map, the root of the dimension times u.dK v, at the node where that value is largest. Where several are the same, as in
/// a square, it is that of one of them.
fn sizes(mesh: &Mesh, velocity: &[[f64; 3]]) -> OfSizes {
    let (dim, mut kinked) = (mesh.dim(), 0);
    let mut tables: BTreeMap<CellKind, Table> = BTreeMap::new();
    #[expect(clippy::cast_precision_loss, reason = "the dimension is 1 to 3")]
    let root = (dim as f64).sqrt();
    let of_cell = |cell| {
        let kind = mesh.kind(cell);
        let element = mesh.geometry_element(kind);
        let table = tables.entry(kind).or_insert_with(|| element.tabulate(element.points(), 1));
        let (mut largest, mut moved, mut has_kink) = (0.0, 0.0, false);
        for q in 0..table.n_points {
            let gradient_of = |values: &dyn Fn(usize) -> [f64; 3]| {
                nalgebra::Matrix3::from_fn(|i, j| {
                    if i >= dim || j >= dim {
                        return 0.0;
                    }
                    let slope = |k: usize| table.gradients[(q * table.n_dofs + k) * dim + j];
                    (0..table.n_dofs).map(|k| slope(k) * values(k)[i]).sum()
                })
            };
            let nodes = mesh.cell_nodes(cell);
            let k = gradient_of(&|n| mesh.node(nodes[n]));
            let dk = gradient_of(&|n| velocity[nodes[n].index()]);
            let Some((value, slope, is_one)) = smallest(&k, &dk, dim) else { continue };
            if value > largest * (1.0 + SAME) {
                (largest, moved, has_kink) = (value, slope, !is_one);
            } else if value > largest * (1.0 - SAME) {
                has_kink |= !is_one || (slope - moved).abs() > SAME * dk.norm();
            }
        }
        kinked += usize::from(has_kink);
        root * moved
    };
    let moved = mesh.cells().map(of_cell).collect();
    OfSizes { moved, kinked }
}

/// The smallest singular value of the leading block of a matrix, what it moves by with the matrix, and whether all that are as
/// small do so: then the symmetric part of u_i.dK v_j is a multiple of the identity over them.
fn smallest(k: &nalgebra::Matrix3<f64>, dk: &nalgebra::Matrix3<f64>, dim: usize) -> Option<(f64, f64, bool)> {
    let svd = nalgebra::DMatrix::from_fn(dim, dim, |i, j| k[(i, j)]).svd(true, true);
    let (u, v) = (svd.u?, svd.v_t?);
    let (at, value) = svd.singular_values.argmin();
    let slope = |a: usize, b: usize| -> f64 {
        let entries = (0..dim).flat_map(|i| (0..dim).map(move |j| (i, j)));
        entries.map(|(i, j)| u[(i, a)] * dk[(i, j)] * v[(b, j)]).sum()
    };
    let as_small: Vec<usize> = (0..dim).filter(|i| svd.singular_values[*i] <= value * (1.0 + SAME)).collect();
    let own = slope(at, at);
    let is_one = as_small.iter().all(|a| {
        as_small.iter().all(|b| {
            let expected = if a == b { own } else { 0.0 };
            (0.5 * (slope(*a, *b) + slope(*b, *a)) - expected).abs() <= SAME * dk.norm()
        })
    });
    Some((value, own, is_one))
}

/// How far regions are looked at on displaced meshes, in parts of the smallest cell: far more than `==` on coordinates allows.
const DISPLACED: f64 = 1e-3;

/// What there is to know of a mesh that moves.
#[derive(Default)]
pub(super) struct Told {
    /// Regions and sizes of cells that have a kink in the parameters.
    pub(super) near: Vec<NearKink>,
    /// In words.
    pub(super) notes: Vec<String>,
}

/// Regions that take other cells or faces on a mesh that is displaced a little, sizes of cells between two, and a number of
/// cells that a size gives.
pub(super) fn told(
    extended: &Extended<'_>,
    of: Differentiated<'_>,
    parameters: &[String],
) -> Result<Told, Box<Diagnostic>> {
    let (Some(velocities), mut told) = (&extended.velocities, Told::default()) else { return Ok(Told::default()) };
    if velocities.nodes.iter().flatten().all(|v| *v == 0.0) {
        return Ok(told);
    }
    let (scene, script) = (of.scene, of.script);
    if let Some(MeshSource::Box { division: BoxDivision::Size(_), .. }) = script.mesh.as_ref().map(|m| &m.source) {
        told.notes.push("the number of cells that `size` gives is kept: what changes it is not followed".to_owned());
    }
    if velocities.kinked > 0 {
        told.near.push(NearKink::of_sizes(velocities.kinked, scene.system.mesh.n_cells()));
    }
    let by_entry = of_nodes(extended, script)?;
    let mut changed: Vec<bool> = vec![false; script.regions.len()];
    let asked = parameters.iter().filter_map(|name| extended.live.iter().position(|l| l.name == *name));
    for entry in asked.flat_map(|k| extended.entries_of(k)) {
        let mut live = vec![0.0; extended.n_live()];
        live[entry] = 1.0;
        from_declared(script, extended, &mut live)?;
        each_displaced(extended, of, (&by_entry, &live), |regions| {
            for (region, changed) in script.regions.iter().zip(&mut changed) {
                let name = region.name.name.as_str();
                *changed |= scene.regions.get(name).map(|r| &r.set) != regions.get(name).map(|r| &r.set);
            }
        });
    }
    let regions = script.regions.iter().zip(&changed).filter(|(_, changed)| **changed);
    told.near.extend(regions.map(|(region, _)| NearKink::of_region(&region.name.name, region.span)));
    Ok(told)
}

/// Calls `f` with the regions of meshes that are displaced a little to both sides of a direction of the parameters.
fn each_displaced(
    extended: &Extended<'_>,
    of: Differentiated<'_>,
    along: (&[ByNode], &[f64]),
    mut f: impl FnMut(&Regions),
) {
    let (by_entry, live) = along;
    let mesh = &of.scene.system.mesh;
    let mut moved = vec![[0.0; 3]; mesh.n_nodes()];
    for (v, by) in by_entry.iter().zip(live).filter(|(_, by)| **by != 0.0) {
        moved.iter_mut().zip(v).for_each(|(m, v)| (0..3).for_each(|d| m[d] += by * v[d]));
    }
    let largest = moved.as_flattened().iter().fold(0.0f64, |m, x| m.max(x.abs()));
    if largest == 0.0 {
        return;
    }
    let far = DISPLACED * summary(mesh).min_size / largest;
    for step in [far, -far] {
        let place = |(x, v): (&[f64; 3], &[f64; 3])| std::array::from_fn(|d| x[d] + step * v[d]);
        let nodes: ByNode = mesh.nodes().iter().zip(&moved).map(place).collect();
        let params = displaced_params(extended, live, step);
        if let Some(regions) = displaced_regions(of.script, of.scene, of.backend, &params, &nodes) {
            f(&regions);
        }
    }
}

/// The parameters a step further along a direction.
fn displaced_params(extended: &Extended<'_>, live: &[f64], step: f64) -> BTreeMap<String, Constant> {
    let mut params: BTreeMap<String, Constant> = extended.scene.params.iter().cloned().collect();
    for (k, of) in extended.live.iter().enumerate() {
        if let Some(param) = params.get_mut(&of.name) {
            let moved = &live[extended.entries_of(k)];
            param.values.iter_mut().zip(moved).for_each(|(value, by)| *value += step * by);
        }
    }
    params
}
