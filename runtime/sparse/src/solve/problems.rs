//! Generated systems for the tests of this folder: elasticity on a box of hexahedra with trilinear shape functions.

use crate::csr::{Csr, PatternBuilder};
use crate::index::NONE;
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

/// The nodes of a box, layer by layer along the first axis.
struct Nodes {
    /// Numbers of cells along the second and the third axis.
    cells: [usize; 2],
    /// First dofs, [`NONE`] where a node is fixed.
    number: Vec<u32>,
    coordinates: Vec<[f64; 3]>,
    h: f64,
}

impl Nodes {
    fn new(options: &BoxOptions) -> Self {
        let [nx, ny, nz] = options.cells;
        let layers = nx + 1 + usize::from(options.cut.is_some());
        let plane_of = |layer: usize| match options.cut {
            Some(cut) if layer > cut => layer - 1,
            _ => layer,
        };
        let fixed = |layer: usize| (options.fix_low && layer == 0) || (options.fix_high && layer == layers - 1);
        let (mut number, mut coordinates) = (Vec::new(), Vec::new());
        let h = 1.0 / ny as f64;
        for layer in 0..layers {
            for j in 0..=ny {
                for k in 0..=nz {
                    if fixed(layer) {
                        number.push(NONE);
                        continue;
                    }
                    number.push(coordinates.len() as u32);
                    coordinates.extend([[plane_of(layer) as f64 * h, j as f64 * h, k as f64 * h]; 3]);
                }
            }
        }
        Self { cells: [ny, nz], number, coordinates, h }
    }

    fn first_dof(&self, layer: usize, j: usize, k: usize) -> u32 {
        let [ny, nz] = self.cells;
        self.number[(layer * (ny + 1) + j) * (nz + 1) + k]
    }

    /// Equal components at equal points of the two sides of a cut.
    fn pairs(&self, cut: usize) -> Vec<(u32, u32)> {
        let [ny, nz] = self.cells;
        let places = (0..=ny).flat_map(|j| (0..=nz).map(move |k| (j, k)));
        let of_node = |(j, k)| [0, 1, 2].map(|c| (self.first_dof(cut, j, k) + c, self.first_dof(cut + 1, j, k) + c));
        places.flat_map(of_node).collect()
    }

    /// First dofs around the faces of a cut, as [`ElasticBox::faces`].
    fn faces(&self, cut: usize) -> Vec<[u32; 16]> {
        let [ny, nz] = self.cells;
        let layers = [cut, cut + 1, cut - 1, cut + 2];
        let node = |j: usize, k: usize, at: usize| self.first_dof(layers[at / 4], j + (at & 1), k + ((at >> 1) & 1));
        let places = (0..ny).flat_map(|j| (0..nz).map(move |k| (j, k)));
        places.map(|(j, k)| std::array::from_fn(|at| node(j, k, at))).collect()
    }
}

/// The sum of the element matrices over cells given by the first dofs of their nodes.
fn assembled(elements: &[[u32; 8]], n: usize, h: f64) -> Csr {
    let mut builder = PatternBuilder::new(n, n);
    let dofs = |nodes: &[u32; 8]| -> Vec<(usize, u32)> {
        (0..24).filter(|&l| nodes[l / 3] != NONE).map(|l| (l, nodes[l / 3] + (l % 3) as u32)).collect()
    };
    for nodes in elements {
        builder.add_element(&dofs(nodes).iter().map(|&(_, dof)| dof).collect::<Vec<_>>());
    }
    let mut matrix = Csr::zeros(Arc::new(builder.build().unwrap()));
    let local = stiffness(h);
    for nodes in elements {
        let list = dofs(nodes);
        for &(a, row) in &list {
            for &(b, column) in &list {
                assert!(matrix.add_to(row as usize, column as usize, local[a][b]));
            }
        }
    }
    matrix
}

impl ElasticBox {
    pub(super) fn new(options: &BoxOptions) -> Self {
        let [nx, ny, nz] = options.cells;
        let nodes = Nodes::new(options);
        // the side there of the cut stands one layer later
        let layer_of = |cell: usize, upper: usize| {
            let shift = usize::from(options.cut.is_some_and(|cut| cell >= cut));
            cell + upper + shift
        };
        let mut elements = Vec::new();
        for i in 0..nx {
            for j in 0..ny {
                for k in 0..nz {
                    let corner = |c: usize| nodes.first_dof(layer_of(i, c & 1), j + ((c >> 1) & 1), k + (c >> 2));
                    elements.push(std::array::from_fn(corner));
                }
            }
        }
        let matrix = assembled(&elements, nodes.coordinates.len(), nodes.h);
        let pairs = options.cut.map_or(Vec::new(), |cut| nodes.pairs(cut));
        let mut interface: Vec<u32> = pairs.iter().flat_map(|&(here, there)| [here, there]).collect();
        interface.sort_unstable();
        let faces = options.cut.map_or(Vec::new(), |cut| nodes.faces(cut));
        Self { matrix, coordinates: nodes.coordinates, interface, pairs, faces, h: nodes.h }
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
