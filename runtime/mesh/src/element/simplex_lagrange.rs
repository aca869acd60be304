//! Lagrange elements `P_k` on point, segment, triangle and tetrahedron.
//!
//! With barycentric coordinates `l_0 = 1 - sum x`, `l_i = x_i` and the dof at `l = a / k`,
//! `phi_a = prod_i N_{a_i}(l_i)`, `N_m(l) = prod_{j < m} (k l - j) / (j + 1)` (Silvester).
//! Derivatives in x follow from `d/dx_d = d/dl_{d+1} - d/dl_0`.

use super::table::{DofEntity, Jet, Lattice, Table, product};
use crate::cell::CellKind;

/// Barycentric places (units of `1 / degree`) and entities of the dofs, `degree` from 1 to 4.
pub(super) fn dofs(kind: CellKind, degree: usize) -> (Vec<[u8; 4]>, Vec<DofEntity>) {
    let k = u8::try_from(degree).expect("degrees are at most 4");
    let mut places = Vec::new();
    let mut entities = Vec::new();
    let place = |parts: &[(usize, u8)]| {
        let mut place = [0; 4];
        for (vertex, part) in parts {
            place[*vertex] = *part;
        }
        place
    };
    for vertex in 0..kind.n_vertices() {
        places.push(place(&[(vertex, k)]));
        entities.push(DofEntity::Vertex(vertex));
    }
    for (edge, [first, second]) in kind.edges().iter().enumerate() {
        for index in 0..k - 1 {
            places.push(place(&[(*first, k - 1 - index), (*second, index + 1)]));
            let index = usize::from(index);
            entities.push(if kind == CellKind::Segment {
                DofEntity::Interior(index)
            } else {
                DofEntity::Edge { edge, index }
            });
        }
    }
    let inside: Vec<[u8; 2]> = inside_triangle(k).collect();
    match kind {
        CellKind::Triangle => {
            for (index, [s, r]) in inside.into_iter().enumerate() {
                places.push([k - s - r, s, r, 0]);
                entities.push(DofEntity::Interior(index));
            }
        }
        CellKind::Tetrahedron => {
            for (facet, local) in kind.facets().iter().enumerate() {
                let v = local.vertices;
                for (index, [s, r]) in inside.iter().enumerate() {
                    places.push(place(&[(v[0], k - s - r), (v[1], *s), (v[2], *r)]));
                    entities.push(DofEntity::Facet { facet, index });
                }
            }
            let layers = (1..k).flat_map(|t| inside_triangle(k - t).map(move |[s, r]| [k - t - s - r, s, r, t]));
            for (index, place) in layers.enumerate() {
                places.push(place);
                entities.push(DofEntity::Interior(index));
            }
        }
        _ => {}
    }
    (places, entities)
}

/// The places inside a triangle along its own parameters, the first one fastest, in units of `1 / k`.
fn inside_triangle(k: u8) -> impl Iterator<Item = [u8; 2]> {
    (1..k).flat_map(move |r| (1..k.saturating_sub(r)).map(move |s| [s, r]))
}

/// `N_m` at `l` with two derivatives.
pub(super) fn factor(m: u8, degree: f64, l: f64) -> Jet {
    let mut jet = [1.0, 0.0, 0.0];
    for j in 0..m {
        let j = f64::from(j);
        let (value, slope) = ((degree * l - j) / (j + 1.0), degree / (j + 1.0));
        jet = [jet[0] * value, jet[1] * value + jet[0] * slope, jet[2] * value + 2.0 * jet[1] * slope];
    }
    jet
}

/// Appends the entries of one point to `table`.
pub(super) fn tabulate(lattice: &Lattice, x: &[f64; 3], derivatives: usize, table: &mut Table) {
    let (dim, degree) = (lattice.kind.dim(), lattice.degree as f64);
    let mut l = [0.0; 4];
    l[0] = 1.0 - x[..dim].iter().sum::<f64>();
    l[1..=dim].copy_from_slice(&x[..dim]);
    for place in &lattice.places {
        let jets: [Jet; 4] = std::array::from_fn(|i| factor(place[i], degree, l[i]));
        let jets = &jets[..=dim];
        table.values.push(product(jets, None, None));
        if derivatives > 0 {
            let along_0 = product(jets, Some(0), None);
            for d in 1..=dim {
                table.gradients.push(product(jets, Some(d), None) - along_0);
            }
        }
        if derivatives > 1 {
            let second = |d, e| product(jets, Some(d), Some(e));
            for d in 1..=dim {
                for e in 1..=dim {
                    let value = second(d, e) - second(d, 0) - second(0, e) + second(0, 0);
                    table.hessians.push(value);
                }
            }
        }
    }
}
