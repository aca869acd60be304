//! Generated systems for the tests of this folder: elasticity on a box of hexahedra with trilinear shape functions.

use crate::csr::{Csr, PatternBuilder};
use std::sync::Arc;

/// A box of hexahedra with three displacements a node, optionally cut into two by an interface at a plane of nodes.
pub(super) struct ElasticBox {
    /// Stiffness matrix, symmetric.
    pub(super) matrix: Csr,
    /// One point a dof.
    pub(super) coordinates: Vec<[f64; 3]>,
    /// Sorted dofs on both sides of the interface.
    pub(super) interface: Vec<u32>,
    /// First dofs of the nodes of each face of the cut: 4 here, 4 there, 4 behind those here, 4 behind those there.
    pub(super) faces: Vec<[u32; 16]>,
    /// Edge of a cell.
    pub(super) h: f64,
    /// Pairs of dofs (here, there) of the interface, equal components at equal points.
    pub(super) pairs: Vec<(u32, u32)>,
}

/// What to build.
pub(super) struct BoxOptions {
    /// Number of cells along each axis; the box is `cells / cells[1]` long.
    pub(super) cells: [usize; 3],
    /// Cut between cell layers `cut` along the first axis, with two sets of nodes.
    pub(super) cut: Option<usize>,
    /// Fix the nodes at the low end of the first axis.
    pub(super) fix_low: bool,
    /// Fix the nodes at its high end.
    pub(super) fix_high: bool,
}

impl ElasticBox {
    pub(super) fn new(options: &BoxOptions) -> Self {
        let [nx, ny, nz] = options.cells;
        let layers = nx + 1 + usize::from(options.cut.is_some());
        // A node layer is (plane, copy): the copy there of the cut plane comes one later.
        let layer_of = |cell: usize, upper: usize| {
            let shift = usize::from(options.cut.is_some_and(|cut| cell >= cut));
            cell + upper + shift
        };
        let plane_of = |layer: usize| match options.cut {
            Some(cut) if layer > cut => layer - 1,
            _ => layer,
        };
        let fixed = |layer: usize| (options.fix_low && layer == 0) || (options.fix_high && layer == layers - 1);
        let mut number = vec![u32::MAX; layers * (ny + 1) * (nz + 1)];
        let mut coordinates = Vec::new();
        let h = 1.0 / ny as f64;
        let at = |layer: usize, j: usize, k: usize| (layer * (ny + 1) + j) * (nz + 1) + k;
        for layer in 0..layers {
            for j in 0..=ny {
                for k in 0..=nz {
                    if !fixed(layer) {
                        number[at(layer, j, k)] = coordinates.len() as u32;
                        let point = [plane_of(layer) as f64 * h, j as f64 * h, k as f64 * h];
                        coordinates.extend([point; 3]);
                    }
                }
            }
        }
        let n = coordinates.len();
        let mut elements = Vec::new();
        for i in 0..nx {
            for j in 0..ny {
                for k in 0..nz {
                    let mut nodes = [0u32; 8];
                    for (corner, node) in nodes.iter_mut().enumerate() {
                        let (a, b, c) = (corner & 1, (corner >> 1) & 1, corner >> 2);
                        *node = number[at(layer_of(i, a), j + b, k + c)];
                    }
                    elements.push(nodes);
                }
            }
        }
        let mut builder = PatternBuilder::new(n, n);
        let dofs = |nodes: &[u32; 8]| -> Vec<(usize, u32)> {
            (0..24).filter(|&l| nodes[l / 3] != u32::MAX).map(|l| (l, nodes[l / 3] + (l % 3) as u32)).collect()
        };
        for nodes in &elements {
            builder.add_element(&dofs(nodes).iter().map(|&(_, dof)| dof).collect::<Vec<_>>());
        }
        let mut matrix = Csr::zeros(Arc::new(builder.build().unwrap()));
        let local = stiffness(h);
        for nodes in &elements {
            let list = dofs(nodes);
            for &(a, row) in &list {
                for &(b, column) in &list {
                    assert!(matrix.add_to(row as usize, column as usize, local[a][b]));
                }
            }
        }
        let mut pairs = Vec::new();
        if let Some(cut) = options.cut {
            for j in 0..=ny {
                for k in 0..=nz {
                    for c in 0..3 {
                        pairs.push((number[at(cut, j, k)] + c, number[at(cut + 1, j, k)] + c));
                    }
                }
            }
        }
        let mut interface: Vec<u32> = pairs.iter().flat_map(|&(here, there)| [here, there]).collect();
        interface.sort_unstable();
        let mut faces = Vec::new();
        if let Some(cut) = options.cut {
            for (j, k) in (0..ny).flat_map(|j| (0..nz).map(move |k| (j, k))) {
                let mut face = [0; 16];
                for (group, layer) in [cut, cut + 1, cut - 1, cut + 2].into_iter().enumerate() {
                    for corner in 0..4 {
                        face[group * 4 + corner] = number[at(layer, j + (corner & 1), k + (corner >> 1))];
                    }
                }
                faces.push(face);
            }
        }
        Self { matrix, coordinates, interface, pairs, faces, h }
    }

    pub(super) fn n(&self) -> usize {
        self.coordinates.len()
    }
}

/// What acts between the two sides of the cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Contact {
    /// `gamma [u][v]` at the nodes of each face.
    Penalty,
    /// `gamma [u][v] - sigma_n(u) [v]`, unsymmetric, which also touches the cell layers beside the cut.
    Nitsche,
}

impl ElasticBox {
    /// The sum over the faces of the cut; `active(face, component)` tells where there is contact or stick. The pattern
    /// is that of all faces.
    pub(super) fn contact(&self, kind: Contact, gamma: f64, active: impl Fn(usize, usize) -> bool) -> Csr {
        let mut builder = PatternBuilder::new(self.n(), self.n());
        let faces: Vec<_> = (0..self.faces.len()).map(|face| self.face_vectors(face)).collect();
        for (dofs, ..) in faces.iter().flatten() {
            builder.add_element(if kind == Contact::Penalty { &dofs[..8] } else { dofs });
        }
        let mut matrix = Csr::zeros(Arc::new(builder.build().unwrap()));
        for (face, component) in (0..faces.len()).flat_map(|face| [0, 1, 2].map(|c| (face, c))) {
            if !active(face, component) {
                continue;
            }
            let (dofs, jumps, tractions) = &faces[face][component];
            for (jump, traction) in jumps.iter().zip(tractions) {
                for (a, &row) in dofs.iter().enumerate().filter(|&(a, _)| jump[a] != 0.0) {
                    for (b, &column) in dofs.iter().enumerate() {
                        let stress = if kind == Contact::Nitsche { traction[b] } else { 0.0 };
                        let value = jump[a] * (gamma * jump[b] - stress) * self.h * self.h / 4.0;
                        if value != 0.0 {
                            assert!(matrix.add_to(row as usize, column as usize, value));
                        }
                    }
                }
            }
        }
        matrix
    }

    /// For each component: 16 dofs (4 here, 4 there, 4 behind here, 4 behind there), and at each of the 4 points of the
    /// face the vectors of the jump and of the mean slope times the modulus.
    #[allow(clippy::type_complexity, reason = "local to this test problem")]
    fn face_vectors(&self, face: usize) -> [(Vec<u32>, [[f64; 16]; 4], [[f64; 16]; 4]); 3] {
        [0, 1, 2].map(|component| {
            let dofs: Vec<u32> = self.faces[face].iter().map(|node| node + component).collect();
            let (mut jumps, mut tractions) = ([[0.0; 16]; 4], [[0.0; 16]; 4]);
            let modulus = if component == 0 { 1.2 } else { 0.4 } / self.h;
            for point in 0..4 {
                (jumps[point][point], jumps[point][4 + point]) = (1.0, -1.0);
                for (place, sign) in [(0, 1.0), (8, -1.0), (12, 1.0), (4, -1.0)] {
                    tractions[point][place + point] = 0.5 * sign * modulus;
                }
            }
            (dofs, jumps, tractions)
        })
    }
}

/// Stiffness of one cube of edge h, E = 1, Poisson 0.25, 2 x 2 x 2 Gauss points.
fn stiffness(h: f64) -> [[f64; 24]; 24] {
    let (lambda, mu) = (0.4, 0.4);
    let g = 0.5 / 3f64.sqrt();
    let mut local = [[0.0; 24]; 24];
    for point in 0..8 {
        let x = [0, 1, 2].map(|axis| if point >> axis & 1 == 1 { 0.5 + g } else { 0.5 - g });
        let gradient: Vec<[f64; 3]> = (0..8)
            .map(|corner: usize| {
                let value = |axis: usize| if corner >> axis & 1 == 1 { x[axis] } else { 1.0 - x[axis] };
                let slope = |axis: usize| if corner >> axis & 1 == 1 { 1.0 / h } else { -1.0 / h };
                [slope(0) * value(1) * value(2), value(0) * slope(1) * value(2), value(0) * value(1) * slope(2)]
            })
            .collect();
        let weight = h * h * h / 8.0;
        for (a, row) in local.iter_mut().enumerate() {
            for (b, entry) in row.iter_mut().enumerate() {
                let (p, q, i, j) = (gradient[a / 3], gradient[b / 3], a % 3, b % 3);
                let dot: f64 = (0..3).map(|d| p[d] * q[d]).sum();
                *entry += weight * (lambda * p[i] * q[j] + mu * p[j] * q[i] + if i == j { mu * dot } else { 0.0 });
            }
        }
    }
    local
}
