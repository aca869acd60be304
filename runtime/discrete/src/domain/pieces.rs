//! Points on pieces of faces, and what they are called.
//!
//! Of faces that stay the pieces are made once, a group for each face. Of faces that follow the bodies they are made in each
//! state, as one group of points for all faces that are alike, and so a point has a name that tells where it is: what was known
//! of the points of one state is taken to those of another by the nearest one. Promises: points in the order of faces and
//! pieces. Does not know images.

use std::{ops::Range, sync::Arc};

use super::{
    Domain, Group, GroupSide,
    boxes::{Bounds, BoxTree, Boxes},
    own::table_of_each,
    rays::Targets,
    segments::{CutFaces, CutPoint, Opposite, Part, around, rule_of_pieces},
};
use crate::space::Space;
use wfl_mesh::{
    mesh::{FacetRef, Mesh},
    quadrature::{QuadratureError, Rule, facet_points},
};

/// How faces are cut that stay where they are.
#[derive(Clone, Copy, Debug)]
pub struct Cut<'a> {
    /// By what.
    pub onto: &'a [FacetRef],
    /// How far that may be.
    pub reach: f64,
    /// It looks the other way.
    pub is_facing: bool,
    /// What the rule of a piece is exact for.
    pub degree: usize,
}

impl Domain {
    /// The faces of `base` cut where they lie opposite of edges of other faces: a group for each face with its own points.
    /// Faces and parts of faces that lie opposite of none have no points.
    ///
    /// # Errors
    /// [`QuadratureError`] where there is no rule of the degree.
    pub fn segments(mesh: &Mesh, base: &Domain, cut: Cut<'_>) -> Result<Self, QuadratureError> {
        let rule = rule_of_pieces(mesh.dim(), cut.degree)?;
        let plain = |facets: &[FacetRef]| {
            CutFaces::new(mesh, facets.to_vec(), None, vec![[0.0; 4]; facets.len()]).parts(mesh, &[])
        };
        let parts = plain(cut.onto);
        let bounds: Vec<Bounds> = parts.iter().map(|parts| around(parts)).collect();
        let tree = BoxTree::new(&bounds);
        let boxes = tree.fit(bounds);
        let Cut { reach, is_facing, .. } = cut;
        let opposite = Opposite { parts: &parts, tree: &tree, boxes: &boxes, reach, is_facing, rule: &rule };
        let mut groups = Vec::new();
        for group in &base.groups {
            for (k, own) in plain(&group.here.facets).iter().enumerate() {
                let points = opposite.cut(own, reach);
                if !points.is_empty() {
                    groups.push(with_points(mesh, group, k..k + 1, &points));
                }
            }
        }
        Ok(Self { groups, moving: None, ..base.clone() })
    }
}

/// Entities of a group of faces with other points.
fn with_points(mesh: &Mesh, group: &Group, entities: Range<usize>, points: &[CutPoint]) -> Group {
    let kind = group.here.kind;
    let own = Rule {
        kind: mesh.facet_kind(group.here.facets[entities.start]),
        degree: 0,
        points: points.iter().map(|p| p.parameter).collect(),
        weights: points.iter().map(|p| p.weight).collect(),
    };
    let at = facet_points(kind, usize::from(group.here.facets[entities.start].local), &own);
    let element = mesh.geometry_element(kind);
    let here = GroupSide {
        kind,
        cells: group.here.cells[entities.clone()].to_vec(),
        facets: group.here.facets[entities.clone()].to_vec(),
        geometry: table_of_each(at.len(), |_| element, |k| at[k], 2),
        points: at,
        corners: group.here.corners.clone(),
        rows: Arc::default(),
    };
    Group {
        entities: group.entities[entities].to_vec(),
        own: None,
        weights: own.weights,
        parameters: own.points,
        areas: None,
        here,
        there: None,
        there_normal: None,
        ..*group
    }
}

/// A group of faces with one point of weight zero, at the centre of each.
pub(super) fn at_centres(mesh: &Mesh, group: &Group) -> Group {
    with_points(mesh, group, 0..group.entities.len(), &[centre_of(mesh, group)])
}

/// The point of weight zero at the centre of the faces of a group.
fn centre_of(mesh: &Mesh, group: &Group) -> CutPoint {
    CutPoint { parameter: mesh.facet_kind(group.here.facets[0]).reference_centre(), weight: 0.0 }
}

/// Faces with the points of the pieces of all of them, and which of the points belong to each: face and number of the point.
/// A face without pieces has its centre.
pub(super) fn of_pieces(mesh: &Mesh, faces: &Group, cut: &[Vec<CutPoint>]) -> (Group, Vec<(usize, usize)>) {
    let centre = [centre_of(mesh, faces)];
    let of_face = |own: &Vec<CutPoint>| if own.is_empty() { centre.to_vec() } else { own.clone() };
    let all: Vec<Vec<CutPoint>> = cut.iter().map(of_face).collect();
    let faces_of = all.iter().enumerate().flat_map(|(k, own)| std::iter::repeat_n(k, own.len()));
    let places = faces_of.zip(0..).collect();
    (with_points(mesh, faces, 0..faces.entities.len(), &all.concat()), places)
}

/// Faces that move, cut by others that do.
#[derive(Clone, Debug)]
pub(super) struct Pieces {
    here: CutFaces,
    there: CutFaces,
    rule: Rule,
}

/// Both sides at a state.
pub(super) struct PiecesAt<'a> {
    here: Vec<Vec<Part>>,
    there: Vec<Vec<Part>>,
    rule: &'a Rule,
}

impl Pieces {
    /// Faces whose displacement has this space, cut by those that images lie on.
    ///
    /// # Errors
    /// [`QuadratureError`] where there is no rule of the degree.
    pub(super) fn new(
        mesh: &Mesh,
        facets: Vec<FacetRef>,
        space: &Arc<Space>,
        targets: &Targets,
        degree: usize,
    ) -> Result<Self, QuadratureError> {
        let margins = vec![[0.0; 4]; facets.len()];
        let here = CutFaces::new(mesh, facets, Some(Arc::clone(space)), margins);
        Ok(Self { here, there: targets.cutting(mesh), rule: rule_of_pieces(mesh.dim(), degree)? })
    }

    /// Both sides at their displacements.
    pub(super) fn at(&self, mesh: &Mesh, [here, there]: [&[f64]; 2]) -> PiecesAt<'_> {
        PiecesAt { here: self.here.parts(mesh, here), there: self.there.parts(mesh, there), rule: &self.rule }
    }
}

impl PiecesAt<'_> {
    /// The points of the pieces of a face; `boxes` are those of the faces that images lie on.
    pub(super) fn points(&self, targets: &Targets, boxes: &Boxes, face: usize, back: f64) -> Vec<CutPoint> {
        let (tree, reach) = (&targets.tree, targets.reach);
        let opposite = Opposite { parts: &self.there, tree, boxes, reach, is_facing: true, rule: self.rule };
        opposite.cut(&self.here[face], reach.min(back))
    }
}

/// What tells a point of a face from others: the position of the face in its region, and the parameters there.
pub type PointName = [f64; NAME];

/// Numbers of a name.
pub const NAME: usize = 3;

impl Domain {
    /// The names of all points, in the order of groups, entities and points.
    #[must_use]
    pub fn point_names(&self) -> Vec<PointName> {
        let of = |group: &Group| -> Vec<PointName> {
            #[expect(clippy::cast_precision_loss, reason = "fewer than 2^53 faces")]
            let name = |k: usize, [a, b, _]: [f64; 3]| [group.entities[k] as f64, a, b];
            let places = (0..group.entities.len()).flat_map(|k| (0..group.n_points()).map(move |q| (k, q)));
            places.map(|(k, q)| name(k, group.parameters[group.here.row(k, q)])).collect()
        };
        self.groups.iter().flat_map(of).collect()
    }
}

/// By point of `to` the nearest one of `from` on the same face; the first point where there is none.
#[must_use]
pub fn nearest_points(from: &[PointName], to: &[PointName]) -> Vec<u32> {
    let number = |k: usize| u32::try_from(k).expect("fewer than 2^32 points");
    if from == to {
        return (0..to.len()).map(number).collect();
    }
    let mut order: Vec<usize> = (0..from.len()).collect();
    order.sort_by(|a, b| from[*a][0].total_cmp(&from[*b][0]));
    let of = |name: &PointName| {
        let first = order.partition_point(|k| from[*k][0] < name[0]);
        let own = order[first..].iter().take_while(|k| from[**k][0] == name[0]);
        let distance = |k: &usize| (from[*k][1] - name[1]).hypot(from[*k][2] - name[2]);
        own.min_by(|a, b| distance(a).total_cmp(&distance(b))).copied().map_or(0, number)
    };
    to.iter().map(of).collect()
}
