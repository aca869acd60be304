//! Faces of a deformed body as polynomials of their own parameters.
//!
//! The position on a face is that of its cell in the reference placement plus the displacement; on the face both are
//! polynomials of its parameters of some degree, and so is their sum. It is told by positions at the points of a lattice, in the
//! reference placement once and for each state anew, so that a search reads a few of them in place of tables of a cell. Beside
//! each stands the derivative along the outward normal of the reference cell, which tells outside from inside; of pyramids, where
//! it is no polynomial, that of the centre of the face. Does not know rays.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::space::Space;
use wfl_mesh::{
    element::{Element, Family, MAX_DEGREE},
    mesh::{CellKind, FacetRef, Mesh},
};

/// At a point of the lattice: the position, and its derivative along the outward normal of the reference cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct FaceNode {
    position: Vector3<f64>,
    across: Vector3<f64>,
}

/// A face at some of its parameters.
#[derive(Clone, Copy, Debug)]
pub(super) struct FacePoint {
    /// The position.
    pub(super) y: Vector3<f64>,
    /// Its derivatives in the parameters.
    pub(super) tangents: [Vector3<f64>; 2],
    /// Its second derivatives: 11, 12, 22; zero unless asked for.
    pub(super) bend: [Vector3<f64>; 3],
    across: Vector3<f64>,
}

/// What a number at a point of the lattice is made of: nodes of the cell and their factors.
type Sum = Vec<(u16, f64)>;

/// What faces of one kind have in common: the local facet of a kind of cells, under the elements of geometry and displacement.
#[derive(Clone, Debug)]
struct Shape {
    kind: CellKind,
    degree: usize,
    /// Of triangles of degree 2 and more, whose lattice is that of an element.
    element: Option<Element>,
    lattice: Vec<[f64; 3]>,
    /// By point of the lattice: position and derivative across, from the geometry and from the displacement.
    geometry: Vec<[Sum; 2]>,
    displacement: Vec<[Sum; 2]>,
}

/// The faces that images may lie on.
#[derive(Clone, Debug)]
pub(super) struct Faces {
    shapes: Vec<Shape>,
    /// By face: its shape, its first node among those of all faces, its cell in the space of the displacement.
    list: Vec<(usize, usize, usize)>,
    facets: Vec<FacetRef>,
    reference: Vec<FaceNode>,
}

/// The value of each function of a line of `degree` with its first two derivatives.
#[inline(always)]
fn line(degree: usize, t: f64) -> [[f64; 3]; MAX_DEGREE + 1] {
    let mut all = [[0.0; 3]; MAX_DEGREE + 1];
    if degree == 1 {
        (all[0], all[1]) = ([1.0 - t, -1.0, 0.0], [t, 1.0, 0.0]);
        return all;
    }
    #[expect(clippy::cast_precision_loss, reason = "degrees are small")]
    let number = |k: usize| k as f64;
    for (m, jet) in all.iter_mut().enumerate().take(degree + 1) {
        *jet = [1.0, 0.0, 0.0];
        for j in (0..=degree).filter(|j| *j != m) {
            let below = number(m) - number(j);
            let (value, slope) = ((number(degree) * t - number(j)) / below, number(degree) / below);
            *jet = [jet[0] * value, jet[1] * value + jet[0] * slope, jet[2] * value + 2.0 * jet[1] * slope];
        }
    }
    all
}

impl Shape {
    fn new(mesh: &Mesh, facet: FacetRef, element: &Element) -> Option<Self> {
        let (cell, local) = (mesh.kind(facet.cell), usize::from(facet.local));
        let kind = mesh.facet_kind(facet);
        let geometry = mesh.geometry_element(cell);
        let degree = geometry.degree().max(element.degree()).max(1);
        let of_triangle = (kind == CellKind::Triangle && degree > 1)
            .then(|| Element::lagrange(kind, degree, Family::Continuous))
            .transpose()
            .ok()?;
        let lattice = of_triangle.as_ref().map_or_else(|| lattice(kind, degree), |e| e.points().to_vec());
        let outward = cell.facet_normal(local);
        let place = |p: [f64; 3]| cell.facet_point(local, cell.facet_map(local).apply(p));
        let centre = place(kind.reference_centre());
        let sums = |element: &Element| -> Vec<[Sum; 2]> {
            let of = |p: &[f64; 3]| {
                let x = place(*p);
                let values = element.tabulate(&[x], 0).values;
                let slopes = element.tabulate(&[if cell == CellKind::Pyramid { centre } else { x }], 1);
                let slope = |g: &[f64]| g.iter().zip(outward).map(|(a, b)| a * b).sum::<f64>();
                let across = slopes.gradients.chunks_exact(slopes.dim).map(slope).collect::<Vec<f64>>();
                [sum(&values), sum(&across)]
            };
            lattice.iter().map(of).collect()
        };
        let (geometry, displacement) = (sums(geometry), sums(element));
        Some(Self { kind, degree, element: of_triangle, lattice, geometry, displacement })
    }

    /// The face at some parameters, from its nodes, with derivatives up to this order, 1 or 2.
    #[inline(always)]
    fn at(&self, nodes: &[FaceNode], p: [f64; 3], order: usize) -> FacePoint {
        let zero = Vector3::zeros();
        let mut at = FacePoint { y: zero, tangents: [zero; 2], bend: [zero; 3], across: zero };
        let mut add = |node: &FaceNode, f: [f64; 6]| {
            at.y += node.position * f[0];
            at.across += node.across * f[0];
            at.tangents[0] += node.position * f[1];
            at.tangents[1] += node.position * f[2];
            if order > 1 {
                (0..3).for_each(|k| at.bend[k] += node.position * f[3 + k]);
            }
        };
        match (self.kind, &self.element) {
            (CellKind::Segment, _) => {
                let a = line(self.degree, p[0]);
                nodes.iter().zip(&a).for_each(|(node, a)| add(node, [a[0], a[1], 0.0, a[2], 0.0, 0.0]));
            }
            (CellKind::Triangle, None) => {
                let f = [[1.0 - p[0] - p[1], -1.0, -1.0], [p[0], 1.0, 0.0], [p[1], 0.0, 1.0]];
                nodes.iter().zip(f).for_each(|(node, f)| add(node, [f[0], f[1], f[2], 0.0, 0.0, 0.0]));
            }
            (_, Some(element)) => {
                let t = element.tabulate(&[p], order);
                for (k, node) in nodes.iter().enumerate() {
                    let h = |e: usize| t.hessians.get(4 * k + e).copied().unwrap_or(0.0);
                    add(node, [t.values[k], t.gradients[2 * k], t.gradients[2 * k + 1], h(0), h(1), h(3)]);
                }
            }
            _ => {
                let (a, b) = (line(self.degree, p[0]), line(self.degree, p[1]));
                let n = self.degree + 1;
                for (nodes, b) in nodes.chunks_exact(n).zip(&b) {
                    for (node, a) in nodes.iter().zip(&a) {
                        add(node, [a[0] * b[0], a[1] * b[0], a[0] * b[1], a[2] * b[0], a[1] * b[1], a[0] * b[2]]);
                    }
                }
            }
        }
        at
    }
}

/// The factors that are not zero to rounding.
fn sum(values: &[f64]) -> Sum {
    let all = (0u16..).zip(values.iter().copied());
    all.filter(|(_, value)| value.abs() > 1e-14).collect()
}

/// The points of a segment, a quadrilateral or a triangle of degree 1, the first parameter fastest.
fn lattice(kind: CellKind, degree: usize) -> Vec<[f64; 3]> {
    if kind == CellKind::Triangle {
        return vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    }
    #[expect(clippy::cast_precision_loss, reason = "degrees are small")]
    let part = |k: usize| k as f64 / degree as f64;
    let last = if kind == CellKind::Segment { 0 } else { degree };
    (0..=last).flat_map(|j| (0..=degree).map(move |i| [part(i), part(j), 0.0])).collect()
}

impl FacePoint {
    /// Out of the face, of length 1; `None` where the face or its cell has no size.
    #[inline(always)]
    pub(super) fn outward(&self, dim: usize) -> Option<Vector3<f64>> {
        let normal = self.normal(dim);
        let side = normal.dot(&self.across);
        let is_sided = side != 0.0 && side.is_finite();
        if is_sided { (normal * side.signum()).try_normalize(0.0) } else { None }
    }

    /// Across the face, of any length, to one of its sides.
    #[inline(always)]
    fn normal(&self, dim: usize) -> Vector3<f64> {
        let [a, b] = self.tangents;
        if dim == 2 { quarter(a) } else { a.cross(&b) }
    }

    /// The derivatives of the outward unit normal in the parameters; `None` where there is none.
    pub(super) fn normal_derivatives(&self, dim: usize) -> Option<[Vector3<f64>; 2]> {
        let ([a, b], [x11, x12, x22]) = (self.tangents, self.bend);
        let turned = if dim == 2 {
            [quarter(x11), Vector3::zeros()]
        } else {
            [x11.cross(&b) + a.cross(&x12), x12.cross(&b) + a.cross(&x22)]
        };
        let normal = self.normal(dim);
        let size = normal.norm();
        if size == 0.0 {
            return None;
        }
        let unit = normal / size;
        let sign = unit.dot(&self.across).signum();
        Some(turned.map(|t| (t - unit * unit.dot(&t)) * (sign / size)))
    }
}

fn quarter(v: Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v[1], -v[0], 0.0)
}

impl Faces {
    /// `None` where the displacement does not live behind one of the facets.
    pub(super) fn new(mesh: &Mesh, facets: &[FacetRef], space: &Space) -> Option<Self> {
        let mut known: BTreeMap<(usize, u8), usize> = BTreeMap::new();
        let mut made = Self { shapes: Vec::new(), list: Vec::new(), facets: facets.to_vec(), reference: Vec::new() };
        let mut first = 0;
        for facet in facets {
            let position = space.position_of_cell(facet.cell)?;
            let key = (mesh.kind(facet.cell).index(), facet.local);
            let shape = match known.get(&key) {
                Some(shape) => *shape,
                None => {
                    made.shapes.push(Shape::new(mesh, *facet, space.element_at(position))?);
                    known.insert(key, made.shapes.len() - 1);
                    made.shapes.len() - 1
                }
            };
            made.list.push((shape, first, position));
            first += made.shapes[shape].geometry.len();
        }
        made.reference = made.nodes(mesh, space, &[]);
        Some(made)
    }

    /// The nodes of all faces under a displacement.
    pub(super) fn nodes(&self, mesh: &Mesh, space: &Space, u: &[f64]) -> Vec<FaceNode> {
        let dim = mesh.dim();
        let is_moved = !u.is_empty();
        let mut all = Vec::with_capacity(self.list.last().map_or(0, |(_, first, _)| first + (MAX_DEGREE + 1).pow(2)));
        for (facet, (shape, _, position)) in self.facets.iter().zip(&self.list) {
            let shape = &self.shapes[*shape];
            let (corners, nodes) = (mesh.cell_nodes(facet.cell), space.entity_nodes(*position));
            for (geometry, displacement) in shape.geometry.iter().zip(&shape.displacement) {
                let part = |k: usize| {
                    let mut sum = Vector3::zeros();
                    for (node, factor) in &geometry[k] {
                        sum += Vector3::from(mesh.node(corners[usize::from(*node)])) * *factor;
                    }
                    for (node, factor) in displacement[k].iter().filter(|_| is_moved) {
                        let first = nodes[usize::from(*node)] as usize * dim;
                        let own = u.get(first..first + dim).unwrap_or_default();
                        own.iter().enumerate().for_each(|(i, value)| sum[i] += value * factor);
                    }
                    sum
                };
                all.push(FaceNode { position: part(0), across: part(1) });
            }
        }
        all
    }

    /// The nodes of one face among those of all.
    #[inline(always)]
    fn own<'a>(&self, nodes: &'a [FaceNode], face: usize) -> &'a [FaceNode] {
        let (shape, first, _) = self.list[face];
        &nodes[first..][..self.shapes[shape].geometry.len()]
    }

    /// A face at some of its parameters, under the displacement of these nodes, with derivatives up to this order, 1
    /// or 2.
    #[inline(always)]
    pub(super) fn at(&self, nodes: &[FaceNode], face: usize, p: [f64; 3], order: usize) -> FacePoint {
        self.shapes[self.list[face].0].at(self.own(nodes, face), p, order)
    }

    /// A face in the reference placement, with second derivatives.
    pub(super) fn at_rest(&self, face: usize, p: [f64; 3]) -> FacePoint {
        self.at(&self.reference, face, p, 2)
    }

    /// The kind of a face.
    #[inline(always)]
    pub(super) fn kind(&self, face: usize) -> CellKind {
        self.shapes[self.list[face].0].kind
    }

    /// The parameters of the nodes of a face.
    pub(super) fn lattice(&self, face: usize) -> &[[f64; 3]] {
        &self.shapes[self.list[face].0].lattice
    }

    /// True where a face lies between its nodes: it is of degree 1.
    pub(super) fn is_between_nodes(&self, face: usize) -> bool {
        self.shapes[self.list[face].0].degree == 1
    }

    /// The positions of the nodes of a face.
    pub(super) fn positions<'a>(
        &self,
        nodes: &'a [FaceNode],
        face: usize,
    ) -> impl Iterator<Item = &'a Vector3<f64>> + use<'a> {
        self.own(nodes, face).iter().map(|node| &node.position)
    }
}
