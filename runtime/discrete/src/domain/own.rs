//! Points that are entities of their own: each has its reference point, and so its row of every table.
//!
//! Images of the points of a rule lie anywhere in their cells, so entities with images share no tables. A group of points has
//! one entity for each point, in the order of entities and points, and tables with a row for each: [`LANES`] points of any
//! entities make a batch. Does not know where images come from.
//!
//! [`LANES`]: wfl_compiler::ir::LANES

use std::{collections::BTreeMap, sync::Arc};

use rayon::prelude::*;

use super::{Domain, Group, GroupSide};
use wfl_mesh::{
    element::{Element, Table},
    mesh::{Image, Mesh},
};

/// How the image of a point shifts, as laws read it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageMotion {
    /// Entries of the symmetric matrix of the shift: row i and column j >= i at `j (j + 1)/2 + i`.
    pub shift: [f64; 6],
    /// Derivative of the outward normal along the face: row i, column j at `i + dim j`.
    pub slope: [f64; 9],
    /// The current unit normal of the point, along which its image was looked for.
    pub normal: [f64; 3],
    /// How far along it the image is, negative where the bodies overlap; of a closest point how far outside of the face.
    pub gap: f64,
    /// What stands in for the position of the image where there is none.
    pub stand_in: Option<[f64; 3]>,
}

/// What the entities of a group of points have of their own, each list by entity.
#[derive(Clone, Debug, Default)]
pub struct OwnPoints {
    /// Weights of the rule on the reference entity; zero without an image.
    pub weights: Vec<f64>,
    /// Outward normals of the reference facets of images; empty for images without facets.
    pub there_normals: Vec<[f64; 3]>,
    /// How images shift, where they follow the bodies; else empty.
    pub motions: Vec<ImageMotion>,
}

/// Points tabulated by one thread at a time.
const CHUNK: usize = 128;

/// A table with a row for each of `n` points, of the element that is its own; of elements with fewer functions than others
/// the last ones are zero.
pub(crate) fn table_of_each<'a>(
    n: usize,
    element: impl Fn(usize) -> &'a Element + Sync,
    point: impl Fn(usize) -> [f64; 3] + Sync,
    order: usize,
) -> Table {
    if n == 0 {
        return Table::default();
    }
    let width = (0..n).map(|k| element(k).n_dofs()).max().unwrap_or(0);
    let is_same = |a: &Element, b: &Element| std::ptr::eq(a, b) || (a.kind() == b.kind() && a.n_dofs() == b.n_dofs());
    let first = element(0);
    let are_alike = (1..n).all(|k| is_same(first, element(k)));
    let rows = |chunk: usize| {
        let own = chunk * CHUNK..n.min((chunk + 1) * CHUNK);
        if are_alike {
            let points: Vec<[f64; 3]> = own.map(&point).collect();
            return first.tabulate(&points, order);
        }
        let mut made = Table { dim: first.kind().dim(), n_dofs: width, ..Table::default() };
        for k in own {
            let row = element(k).tabulate(&[point(k)], order);
            made.n_points += 1;
            let missing = width - row.n_dofs;
            made.values.extend(row.values.into_iter().chain(std::iter::repeat_n(0.0, missing)));
            let of = |all: Vec<f64>, each: usize| {
                let n = if all.is_empty() { 0 } else { missing * each };
                all.into_iter().chain(std::iter::repeat_n(0.0, n))
            };
            made.gradients.extend(of(row.gradients, made.dim));
            made.hessians.extend(of(row.hessians, made.dim * made.dim));
        }
        made
    };
    let chunks: Vec<Table> = (0..n.div_ceil(CHUNK)).into_par_iter().map(rows).collect();
    let mut chunks = chunks.into_iter();
    let mut all = chunks.next().unwrap_or_default();
    let total = |of: usize| of / all.n_points.max(1) * n;
    let sizes = [total(all.values.len()), total(all.gradients.len()), total(all.hessians.len())];
    for (list, size) in [&mut all.values, &mut all.gradients, &mut all.hessians].into_iter().zip(sizes) {
        list.reserve_exact(size - list.len());
    }
    for chunk in chunks {
        all.n_points += chunk.n_points;
        all.values.extend(chunk.values);
        all.gradients.extend(chunk.gradients);
        all.hessians.extend(chunk.hessians);
    }
    all
}

impl GroupSide {
    /// The side of the images of points, one each, without second derivatives. Sizes of cells are those of the kind of the first one.
    pub(super) fn of_images(mesh: &Mesh, images: &[Image], corners: Table) -> Self {
        let kind = mesh.kind(images[0].cell);
        let element = |k: usize| mesh.geometry_element(mesh.kind(images[k].cell));
        Self {
            kind,
            cells: images.iter().map(|image| image.cell).collect(),
            facets: images.iter().filter_map(|image| image.facet).collect(),
            points: images.iter().map(|image| image.reference).collect(),
            geometry: table_of_each(images.len(), element, |k| images[k].reference, 1),
            corners,
            rows: (0..u32::try_from(images.len()).expect("fewer than 2^32 points")).collect(),
        }
    }
}

impl Group {
    /// The group whose entities are points of this one, given by entity and number in the rule; no image yet.
    pub(super) fn of_points(&self, points: impl Iterator<Item = (usize, usize)>) -> Self {
        let (mut entities, mut cells, mut facets) = (Vec::new(), Vec::new(), Vec::new());
        let (mut rows, mut weights) = (Vec::new(), Vec::new());
        for (k, q) in points {
            entities.push(self.entities[k]);
            cells.push(self.here.cells[k]);
            facets.extend(self.here.facets.get(k));
            rows.push(u32::try_from(q).expect("a rule has few points"));
            weights.push(self.weights[q]);
        }
        let here = GroupSide {
            cells,
            facets,
            rows: Arc::from(rows),
            kind: self.here.kind,
            points: self.here.points.clone(),
            geometry: self.here.geometry.clone(),
            corners: self.here.corners.clone(),
        };
        Self {
            entities,
            own: Some(OwnPoints { weights, ..OwnPoints::default() }),
            weights: self.weights.clone(),
            parameters: self.parameters.clone(),
            areas: None,
            here,
            there: None,
            there_normal: None,
            edge_there: None,
            ..*self
        }
    }
}

impl Group {
    /// The rows of numbers that all entities share; none where entities are no points.
    pub(crate) fn one_row(&self) -> Arc<[u32]> {
        std::iter::repeat_n(0, if self.own.is_some() { self.entities.len() } else { 0 }).collect()
    }
}

/// Outward normals of the reference facets of images; none where one has no facet.
pub(super) fn facet_normals(mesh: &Mesh, images: &[Image]) -> Vec<[f64; 3]> {
    let normal = |image: &Image| image.facet.map(|facet| mesh.kind(facet.cell).facet_normal(usize::from(facet.local)));
    images.iter().map(normal).collect::<Option<_>>().unwrap_or_default()
}

impl Domain {
    /// The entities, group after group: the group, and the position in it.
    pub fn entities(&self) -> impl Iterator<Item = (&Group, usize)> + '_ {
        self.groups.iter().flat_map(|group| (0..group.entities.len()).map(move |k| (group, k)))
    }
}

/// Parts of entities whose points have images of one kind, as a group of points: each part is a group of one entity. `None`
/// unless there are some, with images.
fn joined(mesh: &Mesh, parts: &[&Group]) -> Option<Group> {
    let first = parts.first()?;
    let (mut entities, mut cells, mut facets) = (Vec::new(), Vec::new(), Vec::new());
    let (mut rows, mut weights, mut images) = (Vec::new(), Vec::new(), Vec::new());
    let (mut points, mut parameters): (Vec<[f64; 3]>, Vec<[f64; 3]>) = (Vec::new(), Vec::new());
    // points of pieces differ from face to face, so there may be many
    let mut known: BTreeMap<[[u64; 3]; 2], usize> = BTreeMap::new();
    for part in parts {
        let there = part.there.as_ref()?;
        for q in 0..part.n_points() {
            let at = (part.here.points[q], part.parameters[q]);
            let bits = [at.0, at.1].map(|x| x.map(f64::to_bits));
            let row = *known.entry(bits).or_insert_with(|| {
                points.push(at.0);
                parameters.push(at.1);
                points.len() - 1
            });
            rows.push(u32::try_from(row).expect("a rule has few points"));
            weights.push(part.weights[q]);
            entities.push(part.entities[0]);
            cells.push(part.here.cells[0]);
            facets.extend(part.here.facets.first());
            images.push(Image {
                cell: there.cells[0],
                reference: there.points[q],
                facet: there.facets.first().copied(),
            });
        }
    }
    let here = GroupSide { cells, facets, rows: Arc::from(rows), ..GroupSide::new(mesh, first.here.kind, points) };
    let corners = first.there.as_ref()?.corners.clone();
    let there_normals = facet_normals(mesh, &images);
    Some(Group {
        key: first.key,
        is_own: first.is_own,
        entities,
        weights: first.weights.clone(),
        parameters,
        tangents: first.tangents,
        edge: None,
        edge_there: None,
        areas: None,
        reference_normal: first.reference_normal,
        is_global: first.is_global,
        here,
        there: Some(GroupSide::of_images(mesh, &images, corners)),
        there_normal: there_normals.first().copied(),
        own: Some(OwnPoints { weights, there_normals, motions: Vec::new() }),
    })
}

impl Domain {
    /// The same points with each of these sets of groups as one group of points, the other groups behind them; `None` where
    /// some group of a set has no images.
    pub(crate) fn with_joined(&self, mesh: &Mesh, sets: &[Vec<usize>]) -> Option<Self> {
        let of = |set: &Vec<usize>| joined(mesh, &set.iter().map(|g| &self.groups[*g]).collect::<Vec<_>>());
        let mut groups: Vec<Group> = sets.iter().map(of).collect::<Option<_>>()?;
        let mut is_joined = vec![false; self.groups.len()];
        sets.iter().flatten().for_each(|g| is_joined[*g] = true);
        let others = self.groups.iter().zip(is_joined).filter(|(_, is)| !is).map(|(group, _)| group.clone());
        groups.extend(others);
        Some(Self { over: self.over, dim: self.dim, groups, n_entities: self.n_entities, moving: None })
    }
}
