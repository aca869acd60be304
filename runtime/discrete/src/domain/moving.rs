//! The points of a place whose images move with two bodies.
//!
//! The points stay where they are and keep their order, that of the place without the mapping: each is a group of its own.
//! What moves is found from the displacements alone, for each state anew: the ray from the current position of a point along
//! its current normal and its hit on the current faces, or their closest point, and how it shifts. A point without an image
//! has the weight zero; its law reads an image far ahead along the normal, so that it is open. Where faces are cut by those
//! that images lie on, their points are those of the pieces (`segments.rs`), others in each state; a face that lies opposite
//! of nothing has one of weight zero.
//!
//! Promises: the same images for the same displacements, whatever was asked before. Does not know laws.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
};

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::{
    Domain, Group, GroupSide,
    boxes::Boxes,
    pieces::{Pieces, at_centre, with_points},
    rays::{Hit, ImageSearch, Ray, Targets},
};
use crate::space::Space;
use wfl_compiler::types::ImageBy;
use wfl_mesh::{
    element::Table,
    mesh::{CellId, CellKind, FacetRef, Image, Mesh},
};

/// Two unit vectors with a larger product are along one way.
const ONE_WAY: f64 = 0.99;

/// A displacement that images follow: its field, and where that has its nodes.
#[derive(Clone, Debug)]
pub struct Follows {
    /// Number of the field.
    pub field: usize,
    /// Its nodes.
    pub space: Space,
}

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

/// A point with what its ray is made of.
#[derive(Clone, Debug)]
pub(super) struct Point {
    /// As a group of one entity and one point, without an image.
    pub(super) group: Group,
    /// The displacement here.
    pub(super) table: Table,
    pub(super) nodes: Vec<u32>,
    /// Position and outward unit normal in the reference placement, and the inverse of the derivatives of the map.
    x: Vector3<f64>,
    normal: Vector3<f64>,
    inverse: Matrix3<f64>,
    /// Half the thickness of the body behind it: a ray that goes further back would find the other side of the body.
    pub(super) back: f64,
}

/// Images by point, and the displacements that they belong to.
#[derive(Debug)]
struct Known {
    here: Vec<f64>,
    there: Vec<f64>,
    found: Found,
}

/// The points at a state.
#[derive(Clone, Debug)]
struct Found {
    domain: Arc<Domain>,
    /// Those of pieces of faces.
    of_pieces: Option<Arc<Vec<Point>>>,
}

/// The points of a place whose images move.
#[derive(Debug)]
pub struct MovingPoints {
    over: super::Over,
    n_entities: usize,
    /// Where faces are cut, one at the centre of each.
    pub(super) points: Vec<Point>,
    pieces: Option<Pieces>,
    pub(super) here: Follows,
    pub(super) there: Follows,
    pub(super) targets: Targets,
    /// What stands in for an image that is not found: a point of the first face.
    pub(super) spare: Image,
    /// How far ahead it is put.
    ahead: f64,
    /// By kind of the cells behind the faces: the basis of the geometry at its own nodes.
    corners: BTreeMap<CellKind, Table>,
    known: Mutex<Option<Known>>,
}

/// The numbers of a field; none where it has none.
fn of<'a>(current: &[&'a [f64]], follows: &Follows) -> &'a [f64] {
    current.get(follows.field).copied().unwrap_or_default()
}

impl MovingPoints {
    /// The points of `base`, which is on faces; `onto` are the faces that images may lie on. `None` where a displacement does
    /// not live behind one of the faces, or where there are none.
    #[must_use]
    pub fn new(
        mesh: &Mesh,
        base: &Domain,
        onto: &[FacetRef],
        bodies: [Follows; 2],
        search: ImageSearch,
    ) -> Option<Self> {
        let [here, there] = bodies;
        let first = onto.first()?;
        let kind = mesh.kind(first.cell);
        let centre = mesh.facet_kind(*first).reference_centre();
        let reference = kind.facet_map(usize::from(first.local)).apply(centre);
        let spare = Image { cell: first.cell, reference, facet: Some(*first) };
        let mut points = Vec::new();
        for group in &base.groups {
            for k in 0..group.entities.len() {
                if search.pieces.is_some() {
                    points.push(point(mesh, &at_centre(mesh, group, k), [0, 0], &here.space)?);
                    continue;
                }
                for q in 0..group.n_points() {
                    points.push(point(mesh, group, [k, q], &here.space)?);
                }
            }
        }
        let targets = Targets::new(mesh, onto, there.space.clone(), search)?;
        limit_by_thickness(mesh, &targets, &mut points);
        let facets = points.iter().filter_map(|point| point.group.here.facets.first().copied()).collect();
        let pieces = match search.pieces {
            Some(degree) => Some(Pieces::new(mesh, facets, &here.space, &targets, degree).ok()?),
            None => None,
        };
        let (low, high) = mesh.bounds();
        let extent = (0..3).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
        let ahead = if search.reach.is_finite() { search.reach } else { extent };
        let corners = targets.facets().map(|facet| {
            let element = mesh.geometry_element(mesh.kind(facet.cell));
            (mesh.kind(facet.cell), element)
        });
        let corners = corners.collect::<BTreeMap<_, _>>().into_iter();
        let corners = corners.map(|(kind, element)| (kind, element.tabulate(element.points(), 1))).collect();
        let (over, n_entities) = (base.over, base.n_entities);
        let known = Mutex::default();
        Some(Self { over, n_entities, points, pieces, here, there, targets, spare, ahead, corners, known })
    }

    /// The faces that images may lie on.
    pub fn targets(&self) -> impl Iterator<Item = FacetRef> + '_ {
        self.targets.facets()
    }

    /// The displacements that images follow: of the points, and of the faces that they lie on.
    #[must_use]
    pub fn follows(&self) -> [&Follows; 2] {
        [&self.here, &self.there]
    }

    /// How images are found.
    #[must_use]
    pub fn by(&self) -> ImageBy {
        self.targets.by()
    }

    /// How many points there are; where faces are cut how many faces.
    #[must_use]
    pub fn n_points(&self) -> usize {
        self.points.len()
    }

    /// True where faces are cut, so that their points are others in each state.
    #[must_use]
    pub fn are_of_pieces(&self) -> bool {
        self.pieces.is_some()
    }

    /// By face that images may lie on, in their order: those that share a vertex with it, itself included.
    #[must_use]
    pub fn around(&self, mesh: &Mesh) -> Vec<Vec<usize>> {
        let vertices = |facet: FacetRef| {
            let local = mesh.kind(facet.cell).facets()[usize::from(facet.local)];
            let nodes = mesh.cell_vertices(facet.cell);
            local.vertices.iter().map(|k| nodes[*k].index()).collect::<Vec<usize>>()
        };
        let mut faces_at: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (k, facet) in self.targets().enumerate() {
            vertices(facet).into_iter().for_each(|node| faces_at.entry(node).or_default().push(k));
        }
        let around = |facet: FacetRef| {
            let mut found: Vec<usize> = vertices(facet).iter().flat_map(|node| &faces_at[node]).copied().collect();
            found.sort_unstable();
            found.dedup();
            found
        };
        self.targets().map(around).collect()
    }

    /// The points with their images at these values of all fields.
    #[must_use]
    pub fn at(self: &Arc<Self>, mesh: &Mesh, current: &[&[f64]]) -> Arc<Domain> {
        self.found_at(mesh, current).domain
    }

    /// The same, with the points of pieces of faces.
    fn found_at(self: &Arc<Self>, mesh: &Mesh, current: &[&[f64]]) -> Found {
        let (here, there) = (of(current, &self.here), of(current, &self.there));
        let is_of = |known: &&Known| known.here == here && known.there == there;
        if let Some(known) = self.known.lock().unwrap_or_else(PoisonError::into_inner).as_ref().filter(is_of) {
            return known.found.clone();
        }
        // not under the lock: who waits for other threads may be given work that asks for images, too
        let boxes = self.targets.boxes(mesh, there);
        let of_pieces = self.pieces.as_ref().map(|pieces| Arc::new(self.cut(mesh, pieces, [here, there], &boxes)));
        let points = of_pieces.as_deref().unwrap_or(&self.points);
        let group = |point: &Point| self.found(mesh, point, [here, there], &boxes);
        let groups: Vec<Group> = points.par_iter().map(group).collect();
        let domain = Arc::new(Domain {
            over: self.over,
            dim: mesh.dim(),
            groups,
            n_entities: self.n_entities,
            moving: Some(Arc::clone(self)),
        });
        let found = Found { domain, of_pieces };
        let known = Some(Known { here: here.to_vec(), there: there.to_vec(), found: found.clone() });
        *self.known.lock().unwrap_or_else(PoisonError::into_inner) = known;
        found
    }

    /// The points of the pieces of all faces.
    fn cut(&self, mesh: &Mesh, pieces: &Pieces, [here, there]: [&[f64]; 2], boxes: &Boxes) -> Vec<Point> {
        let at = |centre: &Point, group: &Group, q: usize| -> Option<Point> {
            Some(Point { back: centre.back, ..point(mesh, group, [0, q], &self.here.space)? })
        };
        let state = pieces.at(mesh, [here, there]);
        let of_face = |(k, centre): (usize, &Point)| -> Vec<Point> {
            let cut = state.points(&self.targets, boxes, k, centre.back);
            if cut.is_empty() {
                return vec![centre.clone()];
            }
            let group = with_points(mesh, &centre.group, 0, &cut);
            (0..cut.len()).filter_map(|q| at(centre, &group, q)).collect()
        };
        self.points.par_iter().enumerate().flat_map_iter(of_face).collect()
    }

    /// By point whether it is so far inside the other body that it has no image.
    #[must_use]
    pub fn are_inside(self: &Arc<Self>, mesh: &Mesh, current: &[&[f64]]) -> Vec<bool> {
        let Found { domain, of_pieces } = self.found_at(mesh, current);
        let points = of_pieces.as_deref().unwrap_or(&self.points);
        let (here, there) = (of(current, &self.here), of(current, &self.there));
        if !domain.groups.iter().any(Group::has_lost_its_image) {
            return vec![false; points.len()];
        }
        let boxes = self.targets.boxes(mesh, there);
        let is_inside = |(point, group): (&Point, &Group)| {
            let holds = |ray: &Ray| self.targets.hold(mesh, there, &boxes, ray);
            group.has_lost_its_image() && point.ray(mesh.dim(), here).as_ref().is_some_and(holds)
        };
        points.par_iter().zip(&domain.groups).map(is_inside).collect()
    }

    /// A point with its image.
    fn found(&self, mesh: &Mesh, point: &Point, [here, there]: [&[f64]; 2], boxes: &Boxes) -> Group {
        let ray = point.ray(mesh.dim(), here);
        // a face that lies opposite of nothing has no image to be integrated
        let counts = point.group.weights[0] != 0.0;
        let hit = ray.as_ref().filter(|_| counts).and_then(|ray| self.targets.image(mesh, there, boxes, ray));
        let normal = ray.as_ref().map_or_else(Vector3::zeros, |ray| ray.n).into();
        let (image, motion, weight) = match hit {
            Some(Hit { image, shift, slope, gap, rank: _ }) => {
                (image, ImageMotion { shift, slope, normal, gap, stand_in: None }, point.group.weights[0])
            }
            None => (self.spare, ImageMotion { normal, ..self.nowhere(mesh, ray.as_ref(), there) }, 0.0),
        };
        let kind = mesh.kind(image.cell);
        let side = GroupSide {
            kind,
            cells: vec![image.cell],
            facets: image.facet.into_iter().collect(),
            geometry: mesh.geometry_element(kind).tabulate(&[image.reference], 2),
            points: vec![image.reference],
            corners: self.corners.get(&kind).cloned().unwrap_or_default(),
        };
        Group {
            weights: vec![weight],
            there: Some(side),
            there_normal: image.facet.map(|facet| kind.facet_normal(usize::from(facet.local))),
            motion: Some(motion),
            ..point.group.clone()
        }
    }

    /// The image far ahead of a point that has none: its position less the displacement that a law adds to it.
    fn nowhere(&self, mesh: &Mesh, ray: Option<&Ray>, there: &[f64]) -> ImageMotion {
        let way = |ray: &Ray| match self.by() {
            ImageBy::Ray => ray.n,
            // also ahead of it along the normal of the face that stands in, unless that is its own
            ImageBy::Closest => {
                let body = self.targets.body(mesh, there, &self.spare);
                let outward = body.and_then(|body| body.outward.try_normalize(0.0));
                outward.filter(|outward| outward.dot(&ray.n) < ONE_WAY).map_or(ray.n, |outward| ray.n - outward)
            }
        };
        let mut place = ray.map_or_else(Vector3::zeros, |ray| ray.x + way(ray) * self.ahead);
        let space = &self.there.space;
        if let Some(position) = space.position_of_cell(self.spare.cell) {
            let table = space.element_at(position).tabulate(&[self.spare.reference], 0);
            let own = displacement(self.points[0].group.here.geometry.dim, &table, space.entity_nodes(position), there);
            place -= own;
        }
        let stand_in = Some(place.into());
        ImageMotion { shift: [0.0; 6], slope: [0.0; 9], normal: [0.0; 3], gap: self.ahead, stand_in }
    }
}

/// Keeps the rays of points from going through the body behind them, where that has faces among the targets.
fn limit_by_thickness(mesh: &Mesh, targets: &Targets, points: &mut [Point]) {
    let bodies = mesh.bodies();
    let body = |cell: CellId| bodies[mesh.cell_nodes(cell)[0].index()];
    let boxes = targets.boxes(mesh, &[]);
    points.par_iter_mut().for_each(|point| {
        if let Some(ray) = point.ray(mesh.dim(), &[]) {
            let is_own = |facet: FacetRef| body(facet.cell) == body(ray.cell);
            point.back = 0.5 * targets.thickness(mesh, &boxes, &ray, is_own);
        }
    });
}

/// The displacement at the first point of a table.
pub(super) fn displacement(dim: usize, table: &Table, nodes: &[u32], u: &[f64]) -> Vector3<f64> {
    let mut sum = Vector3::zeros();
    for (node, value) in nodes.iter().zip(&table.values) {
        let own = u.get(*node as usize * dim..(*node as usize + 1) * dim).unwrap_or_default();
        own.iter().enumerate().for_each(|(i, u)| sum[i] += u * value);
    }
    sum
}

/// Point `q` of entity `k` of a group on faces.
fn point(mesh: &Mesh, group: &Group, [k, q]: [usize; 2], space: &Space) -> Option<Point> {
    let (dim, cell) = (mesh.dim(), group.here.cells[k]);
    let reference = group.here.points[q];
    let mut here = GroupSide::new(mesh, group.here.kind, vec![reference]);
    here.cells.push(cell);
    here.facets.extend(group.here.facets.get(k));
    let single = Group {
        entities: vec![group.entities[k]],
        weights: vec![group.weights[q]],
        parameters: vec![group.parameters[q]],
        areas: None,
        here,
        there: None,
        there_normal: None,
        ..group.clone()
    };
    let position = space.position_of_cell(cell)?;
    let rows = mesh.jacobian_at(cell, &single.here.geometry, 0);
    let padded = |i: usize, j: usize| if i < dim && j < dim { rows[i][j] } else { f64::from(u8::from(i == j)) };
    Some(Point {
        table: space.element_at(position).tabulate(&[reference], 1),
        nodes: space.entity_nodes(position).to_vec(),
        x: mesh.point_at(cell, &single.here.geometry, 0).into(),
        normal: single.unit_normal(mesh, 0, 0).into(),
        inverse: Matrix3::from_fn(padded).try_inverse()?,
        back: f64::INFINITY,
        group: single,
    })
}

impl Point {
    /// The gradient of a displacement.
    pub(super) fn gradient(&self, dim: usize, u: &[f64]) -> Matrix3<f64> {
        let mut gradient = Matrix3::<f64>::zeros();
        for (k, node) in self.nodes.iter().enumerate() {
            let own = u.get(*node as usize * dim..(*node as usize + 1) * dim).unwrap_or_default();
            for (i, value) in own.iter().enumerate() {
                for j in 0..dim {
                    gradient[(i, j)] += value * self.table.gradients[k * dim + j];
                }
            }
        }
        gradient * self.inverse
    }

    /// The ray from the current position along the current normal; `None` where the cell has no volume.
    pub(super) fn ray(&self, dim: usize, u: &[f64]) -> Option<Ray> {
        let f: Matrix3<f64> = Matrix3::identity() + self.gradient(dim, u);
        let n = f.try_inverse()?.transpose() * self.normal;
        let x = self.x + displacement(dim, &self.table, &self.nodes, u);
        let cell: CellId = self.group.here.cells[0];
        Some(Ray { x, n: n.try_normalize(0.0)?, cell, back: self.back })
    }
}
