//! Pressures that alternate from point to point.
//!
//! Where a law holds at more points of a face than the displacements can follow, each point has a pressure of its own: high
//! in the middle of every face and low at its ends, or the other way round. Averages over faces, and forces, are right.
//! Found without a scale: from the pressure of a point that of its neighbours is taken away, as a linear function of the
//! position; of a smooth pressure a second difference is left, of the order of the square of the size of the faces. Done
//! twice a fourth difference is left, which the zigzag passes and a smooth pressure, or a single jump, does not. Judged in
//! the inside of the zone of contact, where all faces around press, by the area on which the zigzag is large.
//!
//! Promises: exact for pressures that are linear in the position, in units of the pressure alone; the graph of neighbours
//! is made once a term, and only where something presses.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use wfl_discrete::assemble::Domain;
use wfl_host::team::Team;
use wfl_mesh::mesh::{FacetRef, Mesh};

/// The zigzag in parts of the pressure around from which a face counts. Irregular coarse meshes of tetrahedra of degree 1
/// were seen to have 0.14 at their nodes; where a rule with too many points has 0.2, pressures are wrong by a fifth.
const ZIGZAG: f64 = 0.2;
/// A fourth difference of a zigzag is this many times its amplitude, at the least (equal distances: four times).
const FOURTH: f64 = 2.0;
/// The part of the area inside the zone whose faces must have so much: edges of punches and of the zone have less.
const AREA: f64 = 1.0 / 3.0;
/// Faces, and points on them, below which a zone has no inside.
const FEWEST: [usize; 2] = [2, 4];
/// Neighbours of a point on a surface; on a line there are two.
const ON_SURFACE: usize = 8;
/// Factors whose sizes have a larger sum extrapolate; those of a mean have the sum 1.
const INSIDE: f64 = 1.5;
/// Points nearer than this part of the size of their face are one.
const ONE: f64 = 1e-6;

/// A zigzag of the pressure of a term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alternation {
    /// Amplitude in parts of the mean pressure, both over the inside of the zone of contact.
    pub amplitude: f64,
    /// The part of that area on which it is large.
    pub area: f64,
}

/// A point of a law, or several at one place.
#[derive(Clone, Debug, Default)]
struct Node {
    position: Vector3<f64>,
    /// Points of the domain.
    points: Vec<usize>,
    faces: Vec<usize>,
    /// The neighbours, and the factors of their pressures in the linear function at this place.
    neighbours: Vec<(usize, f64)>,
}

/// The points of a term with their neighbours on the surface.
#[derive(Clone, Debug, Default)]
pub(super) struct PointGraph {
    nodes: Vec<Node>,
    /// By face: the faces that share a vertex with it.
    around: Vec<Vec<usize>>,
}

/// The faces of a term and its points, in the order of the domain.
#[derive(Default)]
struct Surface {
    vertices: Vec<Vec<usize>>,
    sizes: Vec<f64>,
    points: Vec<(usize, Vector3<f64>)>,
}

impl Surface {
    fn new(mesh: &Mesh, domain: &Domain) -> Self {
        let mut surface = Self::default();
        // through a mapping the points of a face stand in several groups
        let mut faces: BTreeMap<usize, usize> = BTreeMap::new();
        for group in &domain.groups {
            for (k, entity) in group.entities.iter().enumerate() {
                let face = *faces.entry(*entity).or_insert_with(|| surface.add_face(mesh, group.here.facets[k]));
                let at = |q: usize| Vector3::from(group.position(mesh, k, q));
                surface.points.extend((0..group.n_points()).map(|q| (face, at(q))));
            }
        }
        surface
    }

    fn add_face(&mut self, mesh: &Mesh, facet: FacetRef) -> usize {
        let corners = mesh.facet_vertices(facet);
        let corners = &corners.vertices[..corners.kind.n_vertices()];
        let at = |k: usize| Vector3::from(mesh.node(corners[k]));
        self.sizes.push((1..corners.len()).map(|k| (at(k) - at(0)).norm()).fold(0.0, f64::max));
        self.vertices.push(corners.iter().map(|v| v.index()).collect());
        self.vertices.len() - 1
    }

    fn around(&self) -> Vec<Vec<usize>> {
        let mut at_vertex: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (face, vertices) in self.vertices.iter().enumerate() {
            vertices.iter().for_each(|v| at_vertex.entry(*v).or_default().push(face));
        }
        let of = |(face, vertices): (usize, &Vec<usize>)| {
            let all: BTreeSet<usize> = vertices.iter().flat_map(|v| at_vertex[v].iter().copied()).collect();
            all.into_iter().filter(|other| *other != face).collect()
        };
        self.vertices.iter().enumerate().map(of).collect()
    }
}

impl PointGraph {
    pub(super) fn new(mesh: &Mesh, domain: &Domain) -> Self {
        let surface = Surface::new(mesh, domain);
        let mut graph = Self { nodes: Vec::new(), around: surface.around() };
        let mut on_face: Vec<Vec<usize>> = vec![Vec::new(); surface.vertices.len()];
        for (point, (face, position)) in surface.points.iter().enumerate() {
            let beside = std::iter::once(face).chain(&graph.around[*face]);
            let near = |n: &usize| (graph.nodes[*n].position - position).norm() <= ONE * surface.sizes[*face];
            let known = beside.flat_map(|f| &on_face[*f]).copied().find(near);
            let node = known.unwrap_or(graph.nodes.len());
            if known.is_none() {
                graph.nodes.push(Node { position: *position, ..Node::default() });
            }
            graph.nodes[node].points.push(point);
            if !graph.nodes[node].faces.contains(face) {
                graph.nodes[node].faces.push(*face);
                on_face[*face].push(node);
            }
        }
        let found: Vec<_> = (0..graph.nodes.len()).map(|node| graph.neighbours(node, &on_face, domain.dim)).collect();
        graph.nodes.iter_mut().zip(found).for_each(|(node, neighbours)| node.neighbours = neighbours);
        graph
    }

    /// The nearest nodes around one, with the factors of the linear function through (or least-squares fit to) their values
    /// at its place; none at the border of the surface, where that would be extrapolation.
    fn neighbours(&self, node: usize, on_face: &[Vec<usize>], dim: usize) -> Vec<(usize, f64)> {
        let own = &self.nodes[node];
        let faces = own.faces.iter().flat_map(|f| std::iter::once(f).chain(&self.around[*f]));
        let all: BTreeSet<usize> = faces.flat_map(|f| on_face[*f].iter().copied()).collect();
        let from = |other: usize| self.nodes[other].position - own.position;
        let mut all: Vec<(usize, Vector3<f64>)> =
            all.into_iter().filter(|other| *other != node).map(|other| (other, from(other))).collect();
        all.sort_by(|a, b| a.1.norm_squared().total_cmp(&b.1.norm_squared()).then(a.0.cmp(&b.0)));
        if dim > 2 {
            all.truncate(ON_SURFACE);
            return fitted(&all);
        }
        let Some((first, to)) = all.first() else { return Vec::new() };
        let Some((second, back)) = all.iter().find(|(_, d)| d.dot(to) < 0.0) else { return Vec::new() };
        let (a, b) = (to.norm(), back.norm());
        vec![(*first, b / (a + b)), (*second, a / (a + b))]
    }

    /// By face whether it lies inside the zone of contact: it and all around it press, single ones that do not left out.
    fn inner(&self, pressures: &[f64]) -> Vec<bool> {
        let mut zone = vec![false; self.around.len()];
        for (node, _) in self.nodes.iter().zip(pressures).filter(|(_, p)| **p > 0.0) {
            node.faces.iter().for_each(|f| zone[*f] = true);
        }
        let with = |zone: &[bool], face: usize, wanted: bool| {
            zone[face] == wanted || self.around[face].iter().any(|other| zone[*other] == wanted)
        };
        let each = |zone: Vec<bool>, wanted: bool| -> Vec<bool> {
            (0..zone.len()).map(|face| if with(&zone, face, wanted) { wanted } else { !wanted }).collect()
        };
        each(each(each(zone, true), false), false)
    }

    /// What is left of values at the nodes after the linear function of the neighbours; `None` where there is none.
    fn differences(&self, values: &[Option<f64>]) -> Vec<Option<f64>> {
        let of = |(node, value): (&Node, &Option<f64>)| {
            let mut left = (*value).filter(|_| !node.neighbours.is_empty())?;
            for (other, factor) in &node.neighbours {
                left -= factor * values[*other]?;
            }
            Some(left)
        };
        self.nodes.iter().zip(values).map(of).collect()
    }
}

/// The factors of values at some places, by their distances from here, in the linear function that fits them best (weights
/// of the inverse squares of the distances), here. None where it would extrapolate.
fn fitted(places: &[(usize, Vector3<f64>)]) -> Vec<(usize, f64)> {
    if places.len() < 3 {
        return Vec::new();
    }
    let spread: Matrix3<f64> = places.iter().map(|(_, d)| d * d.transpose()).sum();
    let eigen = SymmetricEigen::new(spread);
    let mut axes = [0, 1, 2];
    axes.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let along = |d: &Vector3<f64>, k: usize| eigen.eigenvectors.column(axes[k]).dot(d);
    let row = |d: &Vector3<f64>| Vector3::new(1.0, along(d, 0), along(d, 1));
    let weight = |d: &Vector3<f64>| 1.0 / d.norm_squared();
    let normal: Matrix3<f64> = places.iter().map(|(_, d)| weight(d) * row(d) * row(d).transpose()).sum();
    let Some(inverse) = normal.try_inverse() else { return Vec::new() };
    let constant = inverse.row(0).transpose();
    let factors: Vec<(usize, f64)> =
        places.iter().map(|(node, d)| (*node, weight(d) * constant.dot(&row(d)))).collect();
    let size: f64 = factors.iter().map(|(_, factor)| factor.abs()).sum();
    if size <= INSIDE { factors } else { Vec::new() }
}

/// What is summed over the inside of a zone of contact.
#[derive(Default)]
struct Inside {
    faces: usize,
    points: usize,
    area: f64,
    /// Over faces, whose nodes belong to several.
    of_faces: f64,
    zigzag: f64,
    force: f64,
    square: f64,
}

impl PointGraph {
    /// The zigzag of pressures at the points, each with its weight, of those that this rank counts; `None` where there is
    /// none. Made by all ranks together.
    pub(super) fn alternation(
        &self,
        at_points: &[(f64, f64)],
        counts: impl Fn(usize) -> bool,
        team: &dyn Team,
    ) -> Option<Alternation> {
        let inside = self.inside(at_points, counts).of_all(team);
        if inside.faces < FEWEST[0] || inside.points < FEWEST[1] || inside.force <= 0.0 {
            return None;
        }
        let (mean, area) = (inside.force / inside.area, inside.zigzag / inside.of_faces);
        let amplitude = (inside.square / inside.area).sqrt() / FOURTH / mean;
        (area > AREA && amplitude > ZIGZAG).then_some(Alternation { amplitude, area })
    }

    fn inside(&self, at_points: &[(f64, f64)], counts: impl Fn(usize) -> bool) -> Inside {
        #[expect(clippy::cast_precision_loss, reason = "few points at one place")]
        let mean = |node: &Node| node.points.iter().map(|p| at_points[*p].0).sum::<f64>() / node.points.len() as f64;
        let pressures: Vec<f64> = self.nodes.iter().map(mean).collect();
        let inner = self.inner(&pressures);
        let values: Vec<Option<f64>> = pressures.iter().copied().map(Some).collect();
        let fourth = self.differences(&self.differences(&values));
        let mut found = Inside::default();
        // by face: its area, and over it the zigzag and the pressure around
        let mut faces: BTreeMap<usize, [f64; 3]> = BTreeMap::new();
        for (k, node) in self.nodes.iter().enumerate() {
            let own = node.points.iter().filter(|p| counts(**p));
            let area: f64 = own.map(|p| at_points[*p].1).sum();
            let Some(left) = fourth[k].filter(|_| area > 0.0 && node.faces.iter().any(|f| inner[*f])) else { continue };
            let around: f64 = node.neighbours.iter().map(|(other, factor)| factor * pressures[*other]).sum();
            for face in node.faces.iter().filter(|f| inner[**f]) {
                let [sum, zigzag, level] = faces.entry(*face).or_default();
                *sum += area;
                *zigzag += area * left.abs() / FOURTH;
                *level += area * 0.5 * (pressures[k] + around);
            }
            found.points += 1;
            found.area += area;
            found.force += area * pressures[k];
            found.square += area * left * left;
        }
        found.faces = faces.len();
        for [area, zigzag, level] in faces.into_values() {
            found.of_faces += area;
            found.zigzag += if zigzag > ZIGZAG * level { area } else { 0.0 };
        }
        found
    }
}

impl Inside {
    fn of_all(self, team: &dyn Team) -> Self {
        let mut sums = [self.area, self.of_faces, self.zigzag, self.force, self.square];
        team.sum(&mut sums);
        let [area, of_faces, zigzag, force, square] = sums;
        Self { faces: team.count(self.faces), points: team.count(self.points), area, of_faces, zigzag, force, square }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_function_is_met_and_the_border_has_no_neighbours() {
        let places = |offsets: &[[f64; 2]]| -> Vec<(usize, Vector3<f64>)> {
            offsets.iter().enumerate().map(|(k, [x, y])| (k, Vector3::new(*x, *y, 0.5 * x))).collect()
        };
        let ring = [[1.0, 0.0], [0.8, 1.1], [-0.1, 1.0], [-1.0, 0.9], [-1.2, 0.0], [0.1, -1.0], [1.0, -1.0]];
        let factors = fitted(&places(&ring));
        let value = |[x, y]: [f64; 2]| 3.0 + 2.0 * x - 5.0 * y;
        let found: f64 = factors.iter().map(|(k, factor)| factor * value(ring[*k])).sum();
        assert!((found - 3.0).abs() < 1e-12, "{found}");
        assert!(fitted(&places(&[[1.0, 0.0], [2.0, 0.1], [1.0, 1.0], [2.0, 1.0]])).is_empty());
    }

    /// Points in a row, two on each face, with neighbours on both sides.
    fn row(faces: usize) -> PointGraph {
        let n = 2 * faces;
        let neighbours = |k: usize| if k == 0 || k == n - 1 { Vec::new() } else { vec![(k - 1, 0.5), (k + 1, 0.5)] };
        #[expect(clippy::cast_precision_loss, reason = "few points")]
        let node = |k: usize| Node {
            position: Vector3::new(k as f64, 0.0, 0.0),
            points: vec![k],
            faces: vec![k / 2],
            neighbours: neighbours(k),
        };
        let around = (0..faces).map(|f| [f.wrapping_sub(1), f + 1].into_iter().filter(|f| *f < faces).collect());
        PointGraph { nodes: (0..n).map(node).collect(), around: around.collect() }
    }

    fn alternation(pressure: impl Fn(f64) -> f64) -> Option<Alternation> {
        let at_points: Vec<(f64, f64)> = (0..20).map(|k| (pressure(k as f64), 0.5)).collect();
        row(10).alternation(&at_points, |_| true, &wfl_host::team::Alone)
    }

    fn zigzag(x: f64) -> f64 {
        if x % 2.0 == 0.0 { 1.0 } else { -1.0 }
    }

    #[test]
    fn a_zigzag_is_found_with_its_amplitude_in_any_unit() {
        for unit in [1e-9, 1.0, 1e9] {
            let found = alternation(|x| unit * (2.0 + zigzag(x))).expect("it alternates");
            // a fourth difference of equal distances is twice the amplitude for each of the two differences, over two
            assert!((found.amplitude - 1.0).abs() < 0.05 && found.area > 0.99, "{unit}: {found:?}");
        }
    }

    #[test]
    fn a_smooth_pressure_does_not_alternate() {
        assert_eq!(alternation(|x| 3.0 + 0.5 * x), None);
        assert_eq!(alternation(|x| (1.0 - (x / 10.0 - 1.0).powi(2)).max(0.0).sqrt()), None);
        assert_eq!(alternation(|_| 0.0), None, "nothing presses");
    }

    #[test]
    fn a_small_zigzag_on_a_large_pressure_is_none() {
        assert_eq!(alternation(|x| 20.0 + zigzag(x)), None);
    }

    #[test]
    fn two_faces_have_no_inside() {
        let at_points = [(3.0, 0.5), (1.0, 0.5), (3.0, 0.5), (1.0, 0.5)];
        assert_eq!(row(2).alternation(&at_points, |_| true, &wfl_host::team::Alone), None);
    }
}
