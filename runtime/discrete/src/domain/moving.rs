//! The points of a place whose images move with two bodies.
//!
//! The points stay where they are and keep their order, that of the place without the mapping: each is an entity of its own.
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
    own::{ImageMotion, OwnPoints, facet_normals},
    pieces::{Pieces, at_centres, of_pieces},
    rays::{Current, Hit, ImageSearch, Ray, Targets},
    segments::CutPoint,
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
    pub space: Arc<Space>,
}

/// A point with what its ray is made of.
#[derive(Clone, Debug)]
pub(super) struct Point {
    cell: CellId,
    /// False where it stands for a face that lies opposite of nothing: no image is looked for.
    has_image: bool,
    /// The displacement here.
    pub(super) table: Arc<Table>,
    pub(super) nodes: Vec<u32>,
    /// Position and outward unit normal in the reference placement, and the inverse of the derivatives of the map.
    x: Vector3<f64>,
    normal: Vector3<f64>,
    inverse: Matrix3<f64>,
    /// Half the thickness of the body behind it: a ray that goes further back would find the other side of the body.
    back: f64,
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
    of_pieces: Option<Arc<Points>>,
}

/// Points before their images are known.
#[derive(Clone, Debug, Default)]
pub(super) struct Points {
    /// As groups of points.
    groups: Vec<Group>,
    /// By point in the order of the groups.
    pub(super) list: Vec<Point>,
}

/// The points of a place whose images move.
#[derive(Debug)]
pub struct MovingPoints {
    over: super::Over,
    n_entities: usize,
    /// Where faces are cut, one at the centre of each.
    pub(super) points: Points,
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
        let mut points = Points::default();
        for group in &base.groups {
            let centres = search.pieces.map(|_| at_centres(mesh, group));
            let group = centres.as_ref().unwrap_or(group);
            let places = (0..group.entities.len()).flat_map(|k| (0..group.n_points()).map(move |q| (k, q)));
            let places: Vec<(usize, usize)> = places.collect();
            let made: Option<Vec<Point>> = listed(mesh, group, &places, &here.space).into_iter().collect();
            points.list.extend(made?);
            points.groups.push(group.of_points(places.into_iter()));
        }
        let targets = Targets::new(mesh, onto, Arc::clone(&there.space), search)?;
        limit_by_thickness(mesh, &targets, &mut points.list);
        let facets = points.groups.iter().flat_map(|group| group.here.facets.iter().copied()).collect();
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
        self.points.list.len()
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
        let (current, spare) = (self.targets.current(mesh, there), self.spare_displacement(mesh, there));
        let of_pieces = self.pieces.as_ref().map(|pieces| Arc::new(self.cut(mesh, pieces, [here, there], &current)));
        let points = of_pieces.as_deref().unwrap_or(&self.points);
        let found = |point: &Point| self.found(mesh, point, [here, there], &current, spare);
        let found: Vec<(Image, ImageMotion)> = points.list.par_iter().map(found).collect();
        let mut rest = found.as_slice();
        let group = |group: &Group| {
            let (own, others) = rest.split_at(group.entities.len());
            rest = others;
            self.group_with(mesh, group, own)
        };
        let domain = Arc::new(Domain {
            over: self.over,
            dim: mesh.dim(),
            groups: points.groups.iter().map(group).collect(),
            n_entities: self.n_entities,
            moving: Some(Arc::clone(self)),
        });
        let found = Found { domain, of_pieces };
        let known = Some(Known { here: here.to_vec(), there: there.to_vec(), found: found.clone() });
        *self.known.lock().unwrap_or_else(PoisonError::into_inner) = known;
        found
    }

    /// The points of the pieces of all faces: a group of them for each group of faces.
    fn cut(&self, mesh: &Mesh, pieces: &Pieces, [here, there]: [&[f64]; 2], current: &Current) -> Points {
        let state = pieces.at(mesh, [here, there]);
        let mut points = Points::default();
        let mut first = 0;
        for faces in &self.points.groups {
            let centres = &self.points.list[first..][..faces.entities.len()];
            let of_face =
                |(k, centre): (usize, &Point)| state.points(&self.targets, &current.boxes, first + k, centre.back);
            let cut: Vec<Vec<CutPoint>> = centres.par_iter().enumerate().map(of_face).collect();
            first += centres.len();
            let (group, places) = of_pieces(mesh, faces, &cut);
            let made = listed(mesh, &group, &places, &self.here.space);
            let own = |((k, q), point): ((usize, usize), Option<Point>)| {
                let (back, has_image) = (centres[k].back, !cut[k].is_empty());
                Some(((k, q), Point { back, has_image, ..point? }))
            };
            let (places, list): (Vec<(usize, usize)>, Vec<Point>) =
                places.into_iter().zip(made).filter_map(own).unzip();
            points.groups.push(group.of_points(places.into_iter()));
            points.list.extend(list);
        }
        points
    }

    /// By point whether it is so far inside the other body that it has no image.
    #[must_use]
    pub fn are_inside(self: &Arc<Self>, mesh: &Mesh, current: &[&[f64]]) -> Vec<bool> {
        let Found { domain, of_pieces } = self.found_at(mesh, current);
        let points = of_pieces.as_deref().unwrap_or(&self.points);
        let (here, there) = (of(current, &self.here), of(current, &self.there));
        let lost: Vec<bool> = domain.entities().map(|(group, k)| group.has_lost_its_image(k)).collect();
        if !lost.contains(&true) {
            return lost;
        }
        let targets = self.targets.current(mesh, there);
        let is_inside = |(point, is_lost): (&Point, &bool)| {
            let holds = |ray: &Ray| self.targets.hold(mesh.dim(), &targets, ray);
            *is_lost && point.ray(mesh.dim(), here).as_ref().is_some_and(holds)
        };
        points.list.par_iter().zip(&lost).map(is_inside).collect()
    }

    /// The image of a point, or what stands in for it.
    fn found(
        &self,
        mesh: &Mesh,
        point: &Point,
        [here, there]: [&[f64]; 2],
        current: &Current,
        spare: Vector3<f64>,
    ) -> (Image, ImageMotion) {
        let ray = point.ray(mesh.dim(), here);
        let hit = ray.as_ref().filter(|_| point.has_image).and_then(|ray| self.targets.image(mesh, current, ray));
        let normal = ray.as_ref().map_or_else(Vector3::zeros, |ray| ray.n).into();
        match hit {
            Some(Hit { image, shift, slope, gap, rank: _ }) => {
                (image, ImageMotion { shift, slope, normal, gap, stand_in: None })
            }
            None => (self.spare, ImageMotion { normal, ..self.nowhere(mesh, ray.as_ref(), there, spare) }),
        }
    }

    /// A group of points with their images.
    fn group_with(&self, mesh: &Mesh, points: &Group, found: &[(Image, ImageMotion)]) -> Group {
        let images: Vec<Image> = found.iter().map(|(image, _)| *image).collect();
        let motions: Vec<ImageMotion> = found.iter().map(|(_, motion)| *motion).collect();
        let weight = |(weight, motion): (&f64, &ImageMotion)| if motion.stand_in.is_none() { *weight } else { 0.0 };
        let own = points.own.as_ref().map_or(&[][..], |own| &own.weights);
        let weights = own.iter().zip(&motions).map(weight).collect();
        let there_normals = facet_normals(mesh, &images);
        let corners = images.first().and_then(|image| self.corners.get(&mesh.kind(image.cell))).cloned();
        Group {
            there: (!images.is_empty()).then(|| GroupSide::of_images(mesh, &images, corners.unwrap_or_default())),
            there_normal: there_normals.first().copied(),
            own: Some(OwnPoints { weights, there_normals, motions }),
            ..points.clone()
        }
    }

    /// The displacement of what stands in for an image.
    fn spare_displacement(&self, mesh: &Mesh, there: &[f64]) -> Vector3<f64> {
        let space = &self.there.space;
        space.position_of_cell(self.spare.cell).map_or_else(Vector3::zeros, |position| {
            let table = space.element_at(position).tabulate(&[self.spare.reference], 0);
            displacement(mesh.dim(), &table, space.entity_nodes(position), there)
        })
    }

    /// The image far ahead of a point that has none: its position less the displacement that a law adds to it.
    fn nowhere(&self, mesh: &Mesh, ray: Option<&Ray>, there: &[f64], spare: Vector3<f64>) -> ImageMotion {
        let way = |ray: &Ray| match self.by() {
            ImageBy::Ray => ray.n,
            // also ahead of it along the normal of the face that stands in, unless that is its own
            ImageBy::Closest => {
                let body = self.targets.body(mesh, there, &self.spare);
                let outward = body.and_then(|body| body.outward.try_normalize(0.0));
                outward.filter(|outward| outward.dot(&ray.n) < ONE_WAY).map_or(ray.n, |outward| ray.n - outward)
            }
        };
        let place = ray.map_or_else(Vector3::zeros, |ray| ray.x + way(ray) * self.ahead) - spare;
        let stand_in = Some(place.into());
        ImageMotion { shift: [0.0; 6], slope: [0.0; 9], normal: [0.0; 3], gap: self.ahead, stand_in }
    }
}

/// Keeps the rays of points from going through the body behind them, where that has faces among the targets.
fn limit_by_thickness(mesh: &Mesh, targets: &Targets, points: &mut [Point]) {
    let bodies = mesh.bodies();
    let body = |cell: CellId| bodies[mesh.cell_nodes(cell)[0].index()];
    let at_rest = targets.current(mesh, &[]);
    points.par_iter_mut().for_each(|point| {
        if let Some(ray) = point.ray(mesh.dim(), &[]) {
            let is_own = |facet: FacetRef| body(facet.cell) == body(ray.cell);
            point.back = 0.5 * targets.thickness(mesh.dim(), &at_rest, &ray, is_own);
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

/// Points of a group on faces, given by entity and number in the rule; `None` where the displacement does not live behind a
/// face, or the map of its cell has no inverse at the point.
fn listed(mesh: &Mesh, group: &Group, places: &[(usize, usize)], space: &Space) -> Vec<Option<Point>> {
    let position = group.here.cells.first().and_then(|cell| space.position_of_cell(*cell));
    let Some(element) = position.map(|position| space.element_at(position)) else { return vec![None; places.len()] };
    let tabulate = |x: &[f64; 3]| Arc::new(element.tabulate(&[*x], 1));
    let tables: Vec<Arc<Table>> = group.here.points.par_iter().map(tabulate).collect();
    places.par_iter().map(|(k, q)| point(mesh, group, [*k, *q], space, &tables[*q])).collect()
}

/// Point `q` of entity `k` of a group on faces.
fn point(mesh: &Mesh, group: &Group, [k, q]: [usize; 2], space: &Space, table: &Arc<Table>) -> Option<Point> {
    let (dim, cell) = (mesh.dim(), group.here.cells[k]);
    let position = space.position_of_cell(cell)?;
    let rows = mesh.jacobian_at(cell, &group.here.geometry, q);
    let padded = |i: usize, j: usize| if i < dim && j < dim { rows[i][j] } else { f64::from(u8::from(i == j)) };
    Some(Point {
        cell,
        has_image: true,
        table: Arc::clone(table),
        nodes: space.entity_nodes(position).to_vec(),
        x: group.position(mesh, k, q).into(),
        // not that of the areas of nodal rules: the ray is along the normal of the face itself
        normal: group.normal_of_map(mesh, k, q).into(),
        inverse: Matrix3::from_fn(padded).try_inverse()?,
        back: f64::INFINITY,
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
        Some(Ray::new(x, n.try_normalize(0.0)?, self.cell, self.back))
    }
}
