//! Pairs of points that have moved apart: interfaces and mappings join the points of two bodies once, on the initial mesh.
//!
//! What presses at a point acts on the same two points wherever the bodies go, so that forces stay where they were when
//! one side slides along the other. That is right as long as the slip is short against the faces of the other side. A
//! point in contact that has slid by more than the length of the face that it was put on, measured along the slip, presses
//! on the wrong face. Obstacles that are formulas follow what moves and are not looked at, nor are points that are open.
//!
//! Promises: a scene whose displacements are below half the smallest of these faces costs their largest one. Does not
//! judge how much the result changes by it.

use std::collections::BTreeSet;

use wfl_compiler::{
    ProjectionKind,
    types::{InputSlot, Side},
};
use wfl_discrete::{assemble::FieldValues, domain::Group, system::System};
use wfl_mesh::mesh::Mesh;

use super::{Contact, ContactTerm, at_points::Point, slopes::is_displacement};

/// A contact term whose sides have slid by more than a face.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SlidPast {
    /// Its name.
    pub term: String,
    /// The largest slip in lengths of the face that the point was put on.
    pub faces: f64,
    /// That slip (length).
    pub slip: f64,
    /// Where the point was at the beginning.
    pub position: [f64; 3],
    /// The part of the area in contact that has slid by more than a face.
    pub share: f64,
}

/// What the points of a term have slid by.
#[derive(Default)]
struct Slid {
    pressed: f64,
    past: f64,
    worst: Option<SlidPast>,
}

/// The contact terms on two bodies that have slid by more than a face at `u`.
#[must_use]
pub fn slid_past_faces(system: &System, contact: &Contact, u: &[f64]) -> Vec<SlidPast> {
    let values = system.values_with(u, contact.active_set());
    contact.terms().iter().filter_map(|term| term.slid_past_faces(system, values.view())).collect()
}

/// The inputs of a law that are the displacement of one side, component by component.
type Displacements = Vec<Vec<usize>>;

impl ContactTerm {
    fn slid_past_faces(&self, system: &System, values: FieldValues<'_>) -> Option<SlidPast> {
        if self.on_cells() || self.moves() {
            return None;
        }
        // every rank has the law, so that all of them stay or go
        let (here, there) = (self.displacements(system, Side::Here), self.displacements(system, Side::There));
        if here.is_empty() || there.is_empty() {
            return None;
        }
        let fields = self.moved_fields(system);
        let own = fields.iter().flat_map(|(field, _)| values.current[*field]);
        let moved = system.team().largest(own.fold(0.0f64, |m, x| m.max(x.abs())));
        // the slip is at most the difference of two displacements, each of so many components
        #[expect(clippy::cast_precision_loss, reason = "at most three")]
        let most = 2.0 * (system.mesh.dim() as f64).sqrt() * moved;
        if most <= *self.shortest_face.get_or_init(|| self.shortest_face_of_all(system)) {
            return None;
        }
        let mut slid = Slid::default();
        let points = self.points_at(system, values);
        let mut weights = Vec::with_capacity(points.len());
        self.law.for_each_point(&system.mesh, &self.sampled, values, |_, _, _, weight, _| weights.push(weight));
        let entities = self.sampled.domain.groups.iter().flat_map(|g| (0..g.entities.len()).map(move |k| (g, k)));
        let places = entities.flat_map(|(group, k)| (0..group.n_points()).map(move |q| (group, k, q)));
        for (at, (((group, k, q), point), weight)) in places.zip(&points).zip(weights).enumerate() {
            if !self.counts(at) || !self.presses(point) {
                continue;
            }
            let normal = group.unit_normal(&system.mesh, k, q);
            let slip = across(relative(point, &here, &there), normal);
            let position = || group.position(&system.mesh, k, q);
            slid.add(weight, slip, extent(&system.mesh, group, k, slip), position);
        }
        slid.found(&system.terms[self.term].law.name, system)
    }

    /// The displacements that the arguments of the law depend on, with their sides.
    fn moved_fields(&self, system: &System) -> BTreeSet<(usize, bool)> {
        let dim = system.mesh.dim();
        let slopes = self.slopes.list().iter().map(|s| s.slot);
        let vectors = slopes.filter(|slot| {
            is_displacement(&system.fields, slot) && system.fields[slot.field.index()].n_components == dim
        });
        vectors.map(|slot| (slot.field.index(), slot.side == Side::There)).collect()
    }

    /// By field of one side the inputs that are its components; empty where some component is not read.
    fn displacements(&self, system: &System, side: Side) -> Displacements {
        let slots = &self.law.law.inputs;
        let component = |field: usize, entry: usize| {
            slots.iter().position(|slot| match slot {
                InputSlot::Field(b) => {
                    let is_it = b.field.index() == field && b.side == side && usize::from(b.entry) == entry;
                    is_it && is_displacement(&system.fields, b)
                }
                _ => false,
            })
        };
        let all = |field: usize| (0..system.mesh.dim()).map(|entry| component(field, entry)).collect();
        let fields = self.moved_fields(system).into_iter().filter(|(_, there)| *there == (side == Side::There));
        fields.map(|(field, _)| all(field)).collect::<Option<Displacements>>().unwrap_or_default()
    }

    /// True if the sides press on each other at a point: where no law has a pressure, if friction acts.
    pub(super) fn presses(&self, point: &Point) -> bool {
        let argument = |at: usize| point.outputs[at];
        let mut half_lines =
            self.projections.iter().filter(|p| p.kind == ProjectionKind::HalfLine && p.n == 1).peekable();
        if half_lines.peek().is_some() {
            return half_lines.any(|p| argument(p.output) > 0.0);
        }
        self.projections.iter().any(|p| p.kind == ProjectionKind::Ball && p.acts && argument(p.output + p.n) > 0.0)
    }

    /// The shortest extent of a face of the other side along an edge, of all ranks.
    fn shortest_face_of_all(&self, system: &System) -> f64 {
        let mesh = &system.mesh;
        let groups = self.sampled.domain.groups.iter().flat_map(|g| (0..g.entities.len()).map(move |k| (g, k)));
        let own =
            groups.filter_map(|(group, k)| shortest_edge(&corners(mesh, group, k)?)).fold(f64::INFINITY, f64::min);
        system.team().range(own, own)[0]
    }
}

impl Slid {
    fn add(&mut self, weight: f64, slip: [f64; 3], face: Option<f64>, position: impl Fn() -> [f64; 3]) {
        self.pressed += weight;
        let (slip, Some(face)) = (length(slip), face.filter(|face| *face > 0.0)) else { return };
        let faces = slip / face;
        if faces <= 1.0 {
            return;
        }
        self.past += weight;
        if self.worst.as_ref().is_none_or(|worst| faces > worst.faces) {
            self.worst = Some(SlidPast { faces, slip, position: position(), ..SlidPast::default() });
        }
    }

    /// What is told, from the points of all ranks.
    fn found(self, term: &str, system: &System) -> Option<SlidPast> {
        let team = system.team();
        let mut sums = [self.pressed, self.past];
        team.sum(&mut sums);
        let largest = team.largest(self.worst.as_ref().map_or(0.0, |worst| worst.faces));
        let rank = team.first(self.worst.as_ref().is_some_and(|worst| worst.faces == largest))?;
        let own = self.worst.map_or_else(Vec::new, |w| [&[w.faces, w.slip], &w.position[..]].concat());
        let [faces, slip, x, y, z] = team.numbers_of(rank, &own)[..] else { return None };
        Some(SlidPast { term: term.to_owned(), faces, slip, position: [x, y, z], share: sums[1] / sums[0] })
    }
}

/// The displacement of the near side against the far one.
fn relative(point: &Point, here: &Displacements, there: &Displacements) -> [f64; 3] {
    let mut moved = [0.0; 3];
    for (side, sign) in [(here, 1.0), (there, -1.0)] {
        for field in side {
            moved.iter_mut().zip(field).for_each(|(m, input)| *m += sign * point.inputs[*input]);
        }
    }
    moved
}

/// The part of a vector in the plane of a face.
fn across(w: [f64; 3], normal: [f64; 3]) -> [f64; 3] {
    let along: f64 = w.iter().zip(&normal).map(|(w, n)| w * n).sum();
    std::array::from_fn(|d| w[d] - along * normal[d])
}

/// The corners of the face that an entity was joined with: of the cell where a mapping leads inside one.
fn corners(mesh: &Mesh, group: &Group, entity: usize) -> Option<Vec<[f64; 3]>> {
    let there = group.there.as_ref()?;
    let nodes = match there.facets.get(entity) {
        Some(facet) => mesh.facet_vertices(*facet).vertices().to_vec(),
        None => mesh.cell_vertices(*there.cells.get(entity)?).to_vec(),
    };
    Some(nodes.into_iter().map(|node| mesh.node(node)).collect())
}

/// The length of the face that an entity was joined with, along a slip; `None` without a slip or a face.
fn extent(mesh: &Mesh, group: &Group, entity: usize, slip: [f64; 3]) -> Option<f64> {
    let size = length(slip);
    if size == 0.0 {
        return None;
    }
    let along = |x: &[f64; 3]| x.iter().zip(&slip).map(|(x, s)| x * s / size).sum::<f64>();
    let corners = corners(mesh, group, entity)?;
    let (low, high) =
        corners.iter().map(along).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    Some(high - low)
}

/// The shortest distance of two corners.
fn shortest_edge(corners: &[[f64; 3]]) -> Option<f64> {
    let pairs = corners.iter().enumerate().flat_map(|(k, a)| corners[..k].iter().map(move |b| (a, b)));
    pairs.map(|(a, b)| length(std::array::from_fn(|d| a[d] - b[d]))).reduce(f64::min)
}

fn length(v: [f64; 3]) -> f64 {
    v.iter().fold(0.0f64, |m, x| m.hypot(*x))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slid(points: &[(f64, f64, Option<f64>)]) -> Slid {
        let mut slid = Slid::default();
        let each = points.iter().enumerate();
        #[expect(clippy::cast_precision_loss, reason = "few points")]
        each.for_each(|(k, (weight, slip, face))| slid.add(*weight, [*slip, 0.0, 0.0], *face, || [k as f64, 0.0, 0.0]));
        slid
    }

    #[test]
    fn the_worst_point_is_the_one_that_slid_by_the_most_faces() {
        let found = slid(&[(1.0, 3.0, Some(2.0)), (1.0, 1.0, Some(0.25)), (2.0, 4.0, Some(5.0))]);
        let worst = found.worst.expect("two points are past their face");
        assert_eq!((worst.faces, worst.slip, worst.position[0]), (4.0, 1.0, 1.0));
        assert_eq!((found.pressed, found.past), (4.0, 2.0));
    }

    #[test]
    fn a_slip_of_one_face_is_not_past_it_and_neither_is_one_without_a_face() {
        let found = slid(&[(1.0, 2.0, Some(2.0)), (1.0, 9.0, None), (1.0, 9.0, Some(0.0))]);
        assert!(found.worst.is_none() && found.past == 0.0 && found.pressed == 3.0);
    }

    #[test]
    fn a_slip_is_the_part_of_a_motion_in_the_face() {
        assert_eq!(across([3.0, -2.0, 1.0], [0.0, 0.0, 1.0]), [3.0, -2.0, 0.0]);
        assert_eq!(across([0.0, 0.0, 5.0], [0.0, 0.0, -1.0]), [0.0; 3]);
    }

    #[test]
    fn the_near_side_moves_against_the_far_one() {
        let point = Point { inputs: vec![1.0, 10.0, 0.25, 4.0], outputs: Vec::new() };
        assert_eq!(relative(&point, &vec![vec![0, 1]], &vec![vec![2, 3]]), [0.75, 6.0, 0.0]);
    }

    #[test]
    fn the_shortest_edge_is_that_of_any_two_corners() {
        let corners = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 0.5, 0.0]];
        assert_eq!(shortest_edge(&corners), Some(0.5));
        assert_eq!(shortest_edge(&corners[..1]), None);
    }
}
