//! Expressions at given points: points are found in cells or on faces, values taken there.
//!
//! Points of one cell or face form one group, so a cloud of points costs about one group a cell. A point on a face
//! between two bodies belongs to each of them: the first cell of the list that holds it is taken. Promises nothing
//! about points outside: they are left out, and the caller sees which ones were found.

use std::{collections::BTreeMap, sync::Arc};

use crate::{
    assemble::{Domain, Group, GroupSide},
    mesh::{CellId, FacetRef, InterfaceFacet, Mesh, MeshError, RegionSet},
    quadrature::Rule,
};

/// How far outside the reference cell a point may lie and still count as inside.
const INSIDE: f64 = 1e-9;
/// The same for a point on a face: it was computed in another mesh.
const ON_FACE: f64 = 1e-6;
/// Iterations of the inverse map.
const INVERSE_ITERATIONS: usize = 25;

/// Points found in a region.
pub struct Located {
    /// The region's entities that hold points, each with its points as rule of weight 1.
    pub domain: Arc<Domain>,
    /// `points[group][q]`: which of the points asked for is point `q` of a group.
    pub points: Vec<Vec<usize>>,
}

impl Located {
    /// Finds points in a region; a region of nodes holds none.
    ///
    /// # Errors
    /// [`MeshError`] when the two sides of an interface do not match.
    pub fn new(mesh: &Mesh, region: &RegionSet, points: &[[f64; 3]]) -> Result<Self, MeshError> {
        match region {
            RegionSet::Cells(cells) => Ok(Self::in_cells(mesh, cells, points)),
            RegionSet::Facets(facets) => {
                let one = |f: &FacetRef| (*f, RegionSet::Facets(vec![*f]));
                Self::on_faces(mesh, facets.iter().map(one).collect(), points)
            }
            RegionSet::Interface(pairs) => {
                let one = |p: &InterfaceFacet| (p.here, RegionSet::Interface(vec![*p]));
                Self::on_faces(mesh, pairs.iter().map(one).collect(), points)
            }
            RegionSet::Nodes(_) => Self::on_faces(mesh, Vec::new(), points),
        }
    }

    /// Finds points in cells; the first of the list that holds a point gets it.
    #[must_use]
    pub fn in_cells(mesh: &Mesh, cells: &[CellId], points: &[[f64; 3]]) -> Self {
        let boxes: Vec<Extent> = cells.iter().map(|c| Extent::of(mesh, *c)).collect();
        let mut found: BTreeMap<usize, Vec<(usize, [f64; 3])>> = BTreeMap::new();
        for (k, x) in points.iter().enumerate() {
            let holds = |n: usize| boxes[n].may_hold(*x).then(|| inside(mesh, cells[n], *x)).flatten();
            if let Some((n, reference)) = (0..cells.len()).find_map(|n| holds(n).map(|r| (n, r))) {
                found.entry(n).or_default().push((k, reference));
            }
        }
        let (mut groups, mut numbers) = (Vec::new(), Vec::new());
        for (n, held) in found {
            groups.push(cell_group(mesh, cells[n], held.iter().map(|h| h.1).collect()));
            numbers.push(held.iter().map(|h| h.0).collect());
        }
        Self { domain: domain(mesh, groups), points: numbers }
    }

    fn on_faces(mesh: &Mesh, faces: Vec<(FacetRef, RegionSet)>, points: &[[f64; 3]]) -> Result<Self, MeshError> {
        let boxes: Vec<Extent> = faces.iter().map(|f| Extent::of(mesh, f.0.cell)).collect();
        let mut found: BTreeMap<usize, Vec<(usize, [f64; 3])>> = BTreeMap::new();
        for (k, x) in points.iter().enumerate() {
            let holds = |n: usize| boxes[n].may_hold(*x).then(|| on_face(mesh, faces[n].0, *x)).flatten();
            if let Some((n, parameters)) = (0..faces.len()).find_map(|n| holds(n).map(|r| (n, r))) {
                found.entry(n).or_default().push((k, parameters));
            }
        }
        let (mut groups, mut numbers) = (Vec::new(), Vec::new());
        for (n, held) in found {
            let points: Vec<[f64; 3]> = held.iter().map(|h| h.1).collect();
            let rule = |kind| Rule { kind, degree: 0, weights: vec![1.0; points.len()], points: points.clone() };
            groups.extend(Domain::new(mesh, &faces[n].1, &rule)?.groups);
            numbers.push(held.iter().map(|h| h.0).collect());
        }
        Ok(Self { domain: domain(mesh, groups), points: numbers })
    }
}

fn domain(mesh: &Mesh, groups: Vec<Group>) -> Arc<Domain> {
    Arc::new(Domain { dim: mesh.dim(), n_entities: groups.len(), groups })
}

/// The box around the nodes of a cell.
struct Extent {
    low: [f64; 3],
    high: [f64; 3],
}

impl Extent {
    /// A tenth larger than the cell: a curved one bulges out of the box of its nodes.
    fn of(mesh: &Mesh, cell: CellId) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for node in mesh.cell_nodes(cell) {
            let p = mesh.node(*node);
            for d in 0..mesh.dim() {
                low[d] = low[d].min(p[d]);
                high[d] = high[d].max(p[d]);
            }
        }
        let size = (0..mesh.dim()).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
        Self { low: low.map(|x| x - 0.1 * size), high: high.map(|x| x + 0.1 * size) }
    }

    fn may_hold(&self, x: [f64; 3]) -> bool {
        // directions the mesh does not have are without bounds
        (0..3).all(|d| !(x[d] < self.low[d] || x[d] > self.high[d]) || self.low[d] == f64::INFINITY)
    }
}

/// The reference coordinates of a point of a cell; `None` when it is outside.
fn inside(mesh: &Mesh, cell: CellId, x: [f64; 3]) -> Option<[f64; 3]> {
    let (dim, kind) = (mesh.dim(), mesh.kind(cell));
    let r = inverse_map(mesh, cell, x)?;
    let inside = if kind.is_simplex() {
        r[..dim].iter().all(|c| *c >= -INSIDE) && r[..dim].iter().sum::<f64>() <= 1.0 + INSIDE
    } else {
        r[..dim].iter().all(|c| (-INSIDE..=1.0 + INSIDE).contains(c))
    };
    inside.then_some(r)
}

/// The parameters of a point of a facet; `None` when it is not on it.
fn on_face(mesh: &Mesh, facet: FacetRef, x: [f64; 3]) -> Option<[f64; 3]> {
    let r = inverse_map(mesh, facet.cell, x)?;
    let kind = mesh.facet_kind(facet);
    let map = mesh.kind(facet.cell).facet_map(usize::from(facet.local));
    // the tangents of a reference facet are independent: least squares by the normal equations
    let t = map.tangents;
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let d: [f64; 3] = std::array::from_fn(|i| r[i] - map.origin[i]);
    let mut s = [0.0; 3];
    match kind.dim() {
        0 => {}
        1 => s[0] = dot(t[0], d) / dot(t[0], t[0]),
        _ => {
            let (a, b, c) = (dot(t[0], t[0]), dot(t[0], t[1]), dot(t[1], t[1]));
            let (f, g) = (dot(t[0], d), dot(t[1], d));
            s[0] = (f * c - g * b) / (a * c - b * b);
            s[1] = (g * a - f * b) / (a * c - b * b);
        }
    }
    let back = map.apply(s);
    let near = (0..mesh.dim()).all(|i| (back[i] - r[i]).abs() <= ON_FACE);
    let n = kind.dim();
    let within = s[..n].iter().all(|c| (-ON_FACE..=1.0 + ON_FACE).contains(c))
        && (!kind.is_simplex() || s[..n].iter().sum::<f64>() <= 1.0 + ON_FACE);
    (near && within).then_some(s)
}

/// Newton on the geometric map; `None` where it has no inverse.
fn inverse_map(mesh: &Mesh, cell: CellId, x: [f64; 3]) -> Option<[f64; 3]> {
    let (dim, kind) = (mesh.dim(), mesh.kind(cell));
    let element = mesh.geometry_element(kind);
    let mut r = kind.reference_centre();
    for _ in 0..INVERSE_ITERATIONS {
        let table = element.tabulate(&[r], 1);
        let at = mesh.point_at(cell, &table, 0);
        let jacobian = mesh.jacobian_at(cell, &table, 0);
        let m =
            nalgebra::Matrix3::from_fn(
                |i, j| if i < dim && j < dim { jacobian[i][j] } else { f64::from(u8::from(i == j)) },
            );
        let gap = nalgebra::Vector3::from_fn(|i, _| if i < dim { x[i] - at[i] } else { 0.0 });
        let step = m.lu().solve(&gap)?;
        for d in 0..dim {
            r[d] += step[d];
        }
        if step.norm() < 1e-14 {
            break;
        }
    }
    Some(r)
}

/// Points of one cell as a group.
fn cell_group(mesh: &Mesh, cell: CellId, points: Vec<[f64; 3]>) -> Group {
    let here = GroupSide { cells: vec![cell], ..GroupSide::new(mesh, mesh.kind(cell), points.clone()) };
    Group {
        entities: vec![0],
        weights: vec![1.0; points.len()],
        parameters: points,
        tangents: None,
        reference_normal: [0.0; 3],
        is_global: false,
        here,
        there: None,
        there_normal: None,
    }
}
