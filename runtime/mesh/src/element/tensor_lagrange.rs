//! Lagrange elements `Q_k` on quadrilateral and hexahedron.
//!
//! The dof at `x = a / k` has `phi_a = prod_d L_{a_d}(x_d)` with the Lagrange polynomials
//! `L_m(t) = prod_{j != m} (k t - j) / (m - j)` of `k + 1` equal steps. Local order lexicographic,
//! x fastest.

use super::{
    MAX_DEGREE,
    table::{DofEntity, Jet, Lattice, Table},
};
use crate::cell::CellKind;

/// Places (units of `1 / degree`) and entities of the dofs, `degree` from 1 to 4.
pub(super) fn dofs(kind: CellKind, degree: usize) -> (Vec<[u8; 4]>, Vec<DofEntity>) {
    let (dim, n) = (kind.dim(), degree + 1);
    let k = u8::try_from(degree).expect("degrees are at most 4");
    let mut places = Vec::new();
    let mut entities = Vec::new();
    for position in 0..n.pow(dim as u32) {
        let mut place = [0; 4];
        let mut rest = position;
        for part in place.iter_mut().take(dim) {
            *part = u8::try_from(rest % n).expect("at most 4");
            rest /= n;
        }
        places.push(place);
        entities.push(entity(kind, k, &place));
    }
    (places, entities)
}

/// The entity whose vertices are those that agree with `place` wherever it touches the border, and the place inside it:
/// lexicographic in the directions along it, which are those of its own parameters.
fn entity(kind: CellKind, k: u8, place: &[u8; 4]) -> DofEntity {
    let dim = kind.dim();
    let fits = |vertex: &usize| {
        let vertex = kind.vertices()[*vertex];
        (0..dim).all(|d| match place[d] {
            0 => vertex[d] < 0.5,
            part if part == k => vertex[d] > 0.5,
            _ => true,
        })
    };
    let around: Vec<usize> = (0..kind.n_vertices()).filter(fits).collect();
    if around.len() == 1 {
        return DofEntity::Vertex(around[0]);
    }
    let inside = place[..dim].iter().rev().filter(|part| **part > 0 && **part < k);
    let index = inside.fold(0, |index, part| index * usize::from(k - 1) + usize::from(part - 1));
    if let Some(edge) = kind.edges().iter().position(|e| e[..] == around[..]) {
        return DofEntity::Edge { edge, index };
    }
    match kind.facets().iter().position(|f| f.vertices == around) {
        Some(facet) => DofEntity::Facet { facet, index },
        None => DofEntity::Interior(index),
    }
}

/// `L_m` at `t` with two derivatives.
pub(super) fn factor(m: u8, degree: usize, t: f64) -> Jet {
    let (m, k) = (f64::from(m), degree as f64);
    let mut jet = [1.0, 0.0, 0.0];
    for j in 0..=degree {
        let j = j as f64;
        if j == m {
            continue;
        }
        let (value, slope) = ((k * t - j) / (m - j), k / (m - j));
        jet = [jet[0] * value, jet[1] * value + jet[0] * slope, jet[2] * value + 2.0 * jet[1] * slope];
    }
    jet
}

/// Appends the entries of one point to `table`.
pub(super) fn tabulate(lattice: &Lattice, x: &[f64; 3], derivatives: usize, table: &mut Table) {
    match lattice.kind.dim() {
        2 => tabulate_in::<2>(lattice, x, derivatives, table),
        _ => tabulate_in::<3>(lattice, x, derivatives, table),
    }
}

#[inline(always)]
fn tabulate_in<const D: usize>(lattice: &Lattice, x: &[f64; 3], derivatives: usize, table: &mut Table) {
    // the factors of each direction, once
    let mut lines = [[[0.0; 3]; MAX_DEGREE + 1]; D];
    for (line, t) in lines.iter_mut().zip(x) {
        for (m, jet) in (0u8..).zip(line.iter_mut()).take(lattice.degree + 1) {
            *jet = factor(m, lattice.degree, *t);
        }
    }
    for place in &lattice.places {
        let jets: [Jet; D] = std::array::from_fn(|d| lines[d][usize::from(place[d])]);
        let product = |orders: [usize; D]| {
            let first = jets[0][orders[0]];
            jets.iter().zip(orders).skip(1).fold(first, |product, (jet, order)| product * jet[order])
        };
        let order =
            |d: usize, e: Option<usize>| std::array::from_fn(|i| usize::from(i == d) + usize::from(e == Some(i)));
        table.values.push(product([0; D]));
        if derivatives > 0 {
            table.gradients.extend((0..D).map(|d| product(order(d, None))));
        }
        if derivatives > 1 {
            let pairs = (0..D).flat_map(|d| (0..D).map(move |e| (d, e)));
            table.hessians.extend(pairs.map(|(d, e)| product(order(d, Some(e)))));
        }
    }
}
