//! Bending that elements of degree 1 do not have: shear locking.
//!
//! A cell of degree 1 that is bent is sheared as well, because its sides stay straight: of a slender body with few cells
//! across, most of the energy goes into that shear, and it moves too little (Hughes, The Finite Element Method, section 4.4).
//!
//! - On quadrilaterals and hexahedra the energy of the state is compared, cell by cell, with the least one that the modes
//!   1 - x^2 of the reference cell leave (the incompatible modes of Wilson, in the form of Taylor, Beresford and Wilson 1976,
//!   which have no part in a constant strain). The nodes stay where they are, so what is left between the two is what the
//!   element alone adds.
//! - A triangle or a tetrahedron has no strain that varies. There the strain is compared with its mean at the vertices
//!   (Zienkiewicz and Zhu 1987), and only where the body is slender with at most two vertices inside across its thickness:
//!   elsewhere the same number says how fine the mesh is, and not that bending is missing.
//!
//! Under given loads displacements are too small by the part of the energy that is found, under given displacements forces
//! are too large by it. Bodies of small strains are taken at the state as it is, others turned back by the rotation of each
//! cell. Rules of one point are no elements that lock. Looks at a part of the cells of a large mesh.

use nalgebra::{DMatrix, DVector, Matrix3};
use wfl_compiler::types::FieldKind;
use wfl_discrete::{
    assemble::{AssembledTerm, FieldValues},
    field::FieldSpace,
    space::Space,
    system::System,
};
use wfl_mesh::{
    element::Family,
    mesh::{CellId, CellKind, Topology, boundary_of},
};

use crate::definite::{stiff_terms, stiffness};
use crate::objectivity::{Strains, strains_of};

/// The part of the energy above which it is told: elastic displacements are wrong by the same part, and a fifth is more
/// than a coarse mesh of a solid body leaves (a body that varies by one half-wave over four cells: a twentieth).
const TOLD: f64 = 0.2;
/// Cells that are looked at: of a mean over cells spread evenly; more take time and change nothing that is told.
const CELLS: usize = 400;
/// Extent of a body in units of its thickness (twice its volume by its surface) from which it is slender: of beams as
/// short as that, shear takes a part of the deflection, and bending is no longer what decides.
const SLENDER: f64 = 5.0;
/// Cells from the boundary to the middle of a body with few of them across: of one or two cells across each has a side
/// on the boundary.
const FEW: usize = 1;
/// A mode with less than this part of the largest stiffness has none: rounding leaves some roundoffs of a rigid motion.
const SINGULAR: f64 = 1e-12;
/// Points of Gauss's rule of two points by direction, in units of half an edge: the roots of the Legendre polynomial of degree
/// 2.
const GAUSS: f64 = 0.577_350_269_189_625_8;

/// A strain below this part of the turns and of the motion over the extent is rounding: its factor beside the roundoff of
/// 2e-16 grows with the cells across a body, of which there are thousands at most.
const UNSTRAINED: f64 = 1e-12;

/// A body in bending on elements of degree 1 that lock.
#[derive(Clone, Debug, PartialEq)]
pub struct LockedBending {
    /// The displacement.
    pub field: String,
    /// Its terms.
    pub terms: Vec<String>,
    /// The part of the energy of deformation that its elements add.
    pub share: f64,
}

/// The displacements of degree 1 whose elements lock in bending at the state `u`; `topology` is that of the mesh of the system.
#[must_use]
pub fn locked_bending(system: &System, topology: &Topology, u: &[f64]) -> Vec<LockedBending> {
    let dim = system.mesh.dim();
    let low = |k: &usize| {
        let f = &system.fields[*k];
        let continuous = matches!(&f.space, FieldSpace::Nodal(s) if s.family() == Family::Continuous);
        f.kind == FieldKind::Unknown
            && f.n_components == dim
            && f.degree() == 1
            && continuous
            && system.range(*k).is_some()
    };
    let bent = |k: &usize| dim > 1 && low(k) && !system.is_rounding_of_positions(u, *k);
    let all = 0..system.fields.len();
    system.mesh.check_whole(|| all.filter(bent).filter_map(|k| locked(system, topology, k, u)).collect())
}

fn locked(system: &System, topology: &Topology, field: usize, u: &[f64]) -> Option<LockedBending> {
    let strains = strains_of(system, field)?;
    let FieldSpace::Nodal(space) = &system.fields[field].space else { return None };
    let terms = stiff_terms(system, field);
    let zero = vec![0.0; system.numbering.n_dofs];
    let values = system.values(&zero);
    let body =
        Body { system, topology, space, field, terms, values: values.view(), u: &u[system.range(field)?], strains };
    let cells: Vec<CellId> = body.cells();
    let simplices = cells.iter().all(|c| system.mesh.kind(*c).straight_is_affine());
    let [added, whole] = if simplices { body.of_simplices(&cells)? } else { body.of_boxes(&cells) };
    let names = body.terms.iter().map(|t| t.law.name.clone()).collect();
    let share = added / whole;
    (whole > 0.0 && !body.is_unstrained(&cells) && share > TOLD).then(|| LockedBending {
        field: system.fields[field].name.clone(),
        terms: names,
        share,
    })
}

/// Differences of positions and displacements between the first vertex of a cell and the others.
fn pairs(vertices: &[([f64; 3], [f64; 3])]) -> Vec<([f64; 3], [f64; 3])> {
    let minus = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let Some((first, rest)) = vertices.split_first() else { return Vec::new() };
    rest.iter().map(|v| (minus(v.0, first.0), minus(v.1, first.1))).collect()
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

struct Body<'a> {
    system: &'a System,
    topology: &'a Topology,
    space: &'a Space,
    field: usize,
    terms: Vec<&'a AssembledTerm>,
    values: FieldValues<'a>,
    /// The displacement, node by node.
    u: &'a [f64],
    strains: Strains,
}

impl Body<'_> {
    /// Whether the body has moved as a whole but for rounding: its differences of displacement are to second order those of
    /// one rotation.
    fn is_unstrained(&self, cells: &[CellId]) -> bool {
        let (mut stretched, mut moved) = (0.0f64, 0.0f64);
        for (x, u) in Self::some(cells).filter_map(|c| self.vertices(c)).flat_map(|v| pairs(&v)) {
            stretched = stretched.max(dot(x, u).abs() / dot(x, x));
            moved = moved.max(dot(u, u).sqrt() / dot(x, x).sqrt());
        }
        let largest = self.u.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        stretched <= UNSTRAINED * moved.max(largest / self.system.extent())
    }

    /// The cells on which the body has a stiffness.
    fn cells(&self) -> Vec<CellId> {
        let groups = self.terms.iter().flat_map(|t| &t.integrator.domain.groups);
        let mut all: Vec<CellId> = groups.flat_map(|g| g.here.cells.iter().copied()).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// A few of them.
    fn some(cells: &[CellId]) -> impl Iterator<Item = CellId> + '_ {
        cells.iter().copied().step_by(cells.len().div_ceil(CELLS).max(1))
    }

    fn stiffness(&self, cell: CellId) -> Option<DMatrix<f64>> {
        Some(stiffness(self.system, self.field, &self.terms, cell, self.values)?.matrix)
    }

    /// Positions and displacements of the vertices of a cell.
    fn vertices(&self, cell: CellId) -> Option<Vec<([f64; 3], [f64; 3])>> {
        let (position, dim) = (self.space.position_of_cell(cell)?, self.system.mesh.dim());
        let nodes = self.space.entity_nodes(position);
        let order = self.space.element_at(position).vertex_dofs()?;
        let of = |node: usize| {
            let moved = std::array::from_fn(|d| if d < dim { self.u[node * dim + d] } else { 0.0 });
            (self.space.node_coordinates()[node], moved)
        };
        Some(order.into_iter().map(|k| of(nodes[k] as usize)).collect())
    }

    /// Energy that the elements add, and all of it, on quadrilaterals and hexahedra.
    fn of_boxes(&self, cells: &[CellId]) -> [f64; 2] {
        let one_point = |cell: &CellId| {
            let groups = self.terms.iter().flat_map(|t| &t.integrator.domain.groups);
            groups.filter(|g| g.n_points() == 1).any(|g| g.here.cells.binary_search(cell).is_ok())
        };
        let mut sums = [0.0; 2];
        for cell in Self::some(cells) {
            let kind = self.system.mesh.kind(cell);
            if !matches!(kind, CellKind::Quadrilateral | CellKind::Hexahedron) || one_point(&cell) {
                continue;
            }
            let Some((stiffness, mut vertices)) = self.stiffness(cell).zip(self.vertices(cell)) else { continue };
            if self.strains == Strains::Finite {
                turn_back(kind, &mut vertices);
            }
            if let Some([added, whole]) = energies(kind, &vertices, &stiffness) {
                sums[0] += added;
                sums[1] += whole;
            }
        }
        sums
    }

    /// The same on triangles and tetrahedra of a slender body with few cells across; `None` for another body.
    fn of_simplices(&self, cells: &[CellId]) -> Option<[f64; 2]> {
        let mesh = &self.system.mesh;
        if !self.is_slender(cells)? {
            return None;
        }
        let dim = mesh.dim();
        let mut at_nodes = vec![([[0.0; 3]; 3], 0.0); self.space.n_nodes()];
        let strain = |cell: CellId| -> Option<([[f64; 3]; 3], f64)> {
            let h = gradient_of_simplex(dim, &self.vertices(cell)?)?;
            Some((self.strain(&h.0), h.1))
        };
        for cell in cells {
            let Some((e, volume)) = strain(*cell) else { continue };
            for node in self.space.entity_nodes(self.space.position_of_cell(*cell)?) {
                let (sum, weight) = &mut at_nodes[*node as usize];
                sum.iter_mut().flatten().zip(e.iter().flatten()).for_each(|(s, x)| *s += volume * x);
                *weight += volume;
            }
        }
        let mut sums = [0.0; 2];
        for cell in Self::some(cells) {
            let Some(((e, volume), stiffness)) = strain(cell).zip(self.stiffness(cell)) else { continue };
            let nodes = self.space.entity_nodes(self.space.position_of_cell(cell)?);
            let apart: Vec<DVector<f64>> = nodes
                .iter()
                .map(|n| {
                    let (sum, weight) = &at_nodes[*n as usize];
                    DVector::from_fn(dim * dim, |p, _| sum[p % dim][p / dim] / weight - e[p % dim][p / dim])
                })
                .collect();
            let energy = |v: &DVector<f64>| (v.transpose() * &stiffness * v)[(0, 0)];
            let total = apart.iter().fold(DVector::zeros(dim * dim), |sum, v| sum + v);
            #[expect(clippy::cast_precision_loss, reason = "2 or 3")]
            let factor = volume / ((dim + 1) * (dim + 2)) as f64;
            // the integral of the square of a linear function by its values at the vertices
            sums[0] += factor * (apart.iter().map(energy).sum::<f64>() + energy(&total));
            sums[1] += volume * energy(&DVector::from_fn(dim * dim, |p, _| e[p % dim][p / dim]));
        }
        Some(sums)
    }

    /// The strain that the law knows: linear, or that of Green.
    fn strain(&self, h: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
        let quadratic = |i: usize, j: usize| match self.strains {
            Strains::Small => 0.0,
            Strains::Finite => (0..3).map(|k| h[k][i] * h[k][j]).sum(),
        };
        std::array::from_fn(|i| std::array::from_fn(|j| 0.5 * (h[i][j] + h[j][i] + quadratic(i, j))))
    }

    /// Whether a body is slender and has few cells across; `None` without a boundary.
    fn is_slender(&self, cells: &[CellId]) -> Option<bool> {
        let (mesh, topology) = (&self.system.mesh, self.topology);
        let boundary = boundary_of(mesh, topology, cells);
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for x in self.space.node_coordinates() {
            (0..3).for_each(|d| (low[d], high[d]) = (low[d].min(x[d]), high[d].max(x[d])));
        }
        let extent = (0..mesh.dim()).fold(0.0f64, |m, d| m.hypot(high[d] - low[d]));
        let volume: f64 = wfl_mesh::mesh::cell_volumes(mesh, cells).iter().sum();
        let surface: f64 = wfl_mesh::mesh::facet_measures(mesh, &boundary).iter().sum();
        if surface <= 0.0 || extent * surface < SLENDER * 2.0 * volume {
            return Some(false);
        }
        let mut depth = vec![usize::MAX; self.space.n_nodes()];
        for node in self.space.nodes_on_facets(mesh, topology, &boundary) {
            depth[node as usize] = 0;
        }
        // layer after layer, one more than what counts as few
        for layer in 0..=FEW {
            for cell in cells {
                let nodes = self.space.entity_nodes(self.space.position_of_cell(*cell)?);
                if nodes.iter().any(|n| depth[*n as usize] == layer) {
                    for n in nodes {
                        depth[*n as usize] = depth[*n as usize].min(layer + 1);
                    }
                }
            }
        }
        let inside =
            cells.iter().flat_map(|c| self.space.position_of_cell(*c)).flat_map(|p| self.space.entity_nodes(p));
        Some(inside.into_iter().all(|n| depth[*n as usize] <= FEW))
    }
}

/// Turns the displacements of a cell back by its rotation (polar decomposition of its mean gradient).
fn turn_back(kind: CellKind, vertices: &mut [([f64; 3], [f64; 3])]) {
    let Some(h) = Shapes::at(kind, vertices, [0.0; 3]).map(|s| s.gradient(vertices)) else { return };
    let f = Matrix3::from_fn(|i, j| h[i][j] + if i == j { 1.0 } else { 0.0 });
    let svd = f.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return };
    let back = (u * v_t).transpose();
    for (x, moved) in vertices.iter_mut() {
        let at = nalgebra::Vector3::from_fn(|d, _| x[d] + moved[d]);
        let at = back * at;
        (0..3).for_each(|d| moved[d] = at[d] - x[d]);
    }
}

/// The functions of a quadrilateral or hexahedron at a point of [-1,1]^dim.
struct Shapes {
    /// Derivatives of the functions of the vertices.
    vertices: Vec<[f64; 3]>,
    /// The inverse of the gradient of the map, transposed, and its determinant.
    inverse: Matrix3<f64>,
    determinant: f64,
}

impl Shapes {
    /// `None` where the cell has no volume.
    fn at(kind: CellKind, vertices: &[([f64; 3], [f64; 3])], at: [f64; 3]) -> Option<Self> {
        let dim = kind.dim();
        let corners: Vec<[f64; 3]> = kind.vertices().iter().map(|v| v.map(|x| 2.0 * x - 1.0)).collect();
        let reference = |corner: &[f64; 3], direction: usize| {
            let factor = |d: usize| if d == direction { 0.5 * corner[d] } else { 0.5 * (1.0 + corner[d] * at[d]) };
            (0..dim).map(factor).product::<f64>()
        };
        let mut jacobian = Matrix3::identity();
        for i in 0..dim {
            for j in 0..dim {
                jacobian[(i, j)] = corners.iter().zip(vertices).map(|(c, (x, _))| x[i] * reference(c, j)).sum();
            }
        }
        let (determinant, inverse) = (jacobian.determinant(), jacobian.try_inverse()?.transpose());
        let physical = |c: &[f64; 3]| {
            let r = nalgebra::Vector3::from_fn(|d, _| if d < dim { reference(c, d) } else { 0.0 });
            let g = inverse * r;
            [g[0], g[1], g[2]]
        };
        Some(Self { vertices: corners.iter().map(physical).collect(), inverse, determinant: determinant.abs() })
    }

    fn gradient(&self, vertices: &[([f64; 3], [f64; 3])]) -> [[f64; 3]; 3] {
        let entry = |i: usize, j: usize| vertices.iter().zip(&self.vertices).map(|((_, u), g)| u[i] * g[j]).sum();
        std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
    }
}

/// The energy (twice of it) that the modes 1 - x^2 take from a cell, and what it has without them.
fn energies(kind: CellKind, vertices: &[([f64; 3], [f64; 3])], stiffness: &DMatrix<f64>) -> Option<[f64; 2]> {
    let dim = kind.dim();
    let n = dim * dim;
    let centre = Shapes::at(kind, vertices, [0.0; 3])?;
    let (mut whole, mut modes, mut coupling) = (0.0, DMatrix::zeros(n, n), DVector::zeros(n));
    for point in 0..1usize << dim {
        let at = std::array::from_fn(|d| match d {
            d if d >= dim => 0.0,
            d if point >> d & 1 == 1 => GAUSS,
            _ => -GAUSS,
        });
        let shapes = Shapes::at(kind, vertices, at)?;
        let h = shapes.gradient(vertices);
        let strain = DVector::from_fn(n, |p, _| 0.5 * (h[p % dim][p / dim] + h[p / dim][p % dim]));
        let stress = stiffness * &strain;
        let weight = shapes.determinant;
        whole += weight * strain.dot(&stress);
        // mode by mode (component c of 1 - x_k^2): its gradient with the map of the centre
        let scale = centre.determinant / shapes.determinant;
        let mode = DMatrix::from_fn(n, n, |p, m| {
            let (i, j, c, k) = (p % dim, p / dim, m % dim, m / dim);
            if i == c { -2.0 * at[k] * scale * centre.inverse[(j, k)] } else { 0.0 }
        });
        modes += weight * mode.transpose() * stiffness * &mode;
        coupling += weight * mode.transpose() * stress;
    }
    let smallest = SINGULAR * modes.amax();
    let relaxed = modes.svd(true, true).solve(&coupling, smallest).ok()?;
    let added = coupling.dot(&relaxed);
    (whole.is_finite() && added.is_finite()).then_some([added, whole])
}

/// The gradient of a linear displacement on a triangle or tetrahedron, and its volume.
fn gradient_of_simplex(dim: usize, vertices: &[([f64; 3], [f64; 3])]) -> Option<([[f64; 3]; 3], f64)> {
    let (first, others) = vertices.split_first()?;
    let edge = |d: usize, k: usize| others[k].0[d] - first.0[d];
    let moved = |d: usize, k: usize| others[k].1[d] - first.1[d];
    let edges = Matrix3::from_fn(|d, k| if d < dim && k < dim { edge(d, k) } else { f64::from(u8::from(d == k)) });
    let motions = Matrix3::from_fn(|d, k| if d < dim && k < dim { moved(d, k) } else { 0.0 });
    let h = motions * edges.try_inverse()?;
    let volume = edges.determinant().abs() / if dim == 2 { 2.0 } else { 6.0 };
    Some((std::array::from_fn(|i| std::array::from_fn(|j| h[(i, j)])), volume))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Plane stress without Poisson's effect: a unit stiffness against strains.
    fn unit_stiffness() -> DMatrix<f64> {
        DMatrix::from_row_slice(4, 4, &[1.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 0.0, 0.0, 1.0])
    }

    fn cell(length: f64, moved: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<([f64; 3], [f64; 3])> {
        let at = |v: &[f64; 3]| [length * (v[0] - 0.5), v[1] - 0.5, 0.0];
        CellKind::Quadrilateral.vertices().iter().map(|v| (at(v), moved(at(v)))).collect()
    }

    #[test]
    fn a_cell_that_is_bent_is_too_stiff_by_the_square_of_its_length() {
        // u = x y: strain y along x; shear x between the axes, which a bent beam has not: (G/E) l^2 = l^2/2 of the bending
        for length in [0.25, 1.0, 4.0] {
            let found =
                energies(CellKind::Quadrilateral, &cell(length, |x| [x[0] * x[1], 0.0, 0.0]), &unit_stiffness());
            let [added, whole] = found.unwrap();
            assert!((added / whole - 0.5 * length * length / (1.0 + 0.5 * length * length)).abs() < 1e-12, "{length}");
        }
    }

    #[test]
    fn a_cell_of_constant_strain_adds_nothing_and_a_turned_one_has_no_energy() {
        let stretched = cell(3.0, |x| [0.1 * x[0] + 0.2 * x[1], -0.03 * x[1], 0.0]);
        let [added, whole] = energies(CellKind::Quadrilateral, &stretched, &unit_stiffness()).unwrap();
        assert!(added.abs() < 1e-12 * whole);
        let (c, s) = (0.6, 0.8);
        let mut turned = cell(3.0, |x| [(c - 1.0) * x[0] - s * x[1], s * x[0] + (c - 1.0) * x[1], 0.0]);
        turn_back(CellKind::Quadrilateral, &mut turned);
        let [_, whole] = energies(CellKind::Quadrilateral, &turned, &unit_stiffness()).unwrap();
        assert!(whole.abs() < 1e-24);
    }
}
