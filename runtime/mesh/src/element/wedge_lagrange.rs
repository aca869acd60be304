//! Lagrange elements on the wedge: `P_k` on the triangle times `P_k` on `[0, 1]`.
//!
//! The dof at barycentric `a / k` of the triangle and `z = m / k` has `phi = prod_i N_{a_i}(l_i) L_m(z)`, with the factors
//! of the simplex and of the line. The restriction to a triangular face is `P_k`, to a quadrilateral one `Q_k`: neighbours
//! that are tetrahedra, pyramids or hexahedra have the same. Local order: the dofs of a triangle at each z in turn.

use super::{
    entity::entities,
    point_of, simplex_lagrange,
    table::{DofEntity, Jet, Lattice, Table, product},
    tensor_lagrange,
};
use crate::cell::CellKind;

/// Places (barycentric ones of the triangle, then that along z) and entities of the dofs, `degree` from 1 to 3.
pub(super) fn dofs(kind: CellKind, degree: usize) -> (Vec<[u8; 4]>, Vec<DofEntity>) {
    let (triangle, _) = simplex_lagrange::dofs(CellKind::Triangle, degree);
    let k = u8::try_from(degree).expect("degrees are at most 3");
    let places: Vec<[u8; 4]> = (0..=k).flat_map(|z| triangle.iter().map(move |p| [p[0], p[1], p[2], z])).collect();
    let points: Vec<[f64; 3]> = places.iter().map(|p| point_of(kind, degree, &p[1..])).collect();
    let entities = entities(kind, degree, &points);
    (places, entities)
}

/// Appends the entries of one point to `table`.
pub(super) fn tabulate(lattice: &Lattice, [x, y, z]: &[f64; 3], derivatives: usize, table: &mut Table) {
    let degree = lattice.degree;
    let l = [1.0 - x - y, *x, *y];
    // derivatives in x and y are differences of those in barycentric coordinates, z is its own
    let along: [&[(usize, f64)]; 3] = [&[(1, 1.0), (0, -1.0)], &[(2, 1.0), (0, -1.0)], &[(3, 1.0)]];
    for place in &lattice.places {
        let jets: [Jet; 4] = std::array::from_fn(|i| match i {
            3 => tensor_lagrange::factor(place[3], degree, *z),
            _ => simplex_lagrange::factor(place[i], degree as f64, l[i]),
        });
        table.values.push(product(&jets, None, None));
        if derivatives > 0 {
            for terms in along {
                table.gradients.push(terms.iter().map(|(i, s)| s * product(&jets, Some(*i), None)).sum());
            }
        }
        if derivatives > 1 {
            for first in along {
                for second in along {
                    let pairs = first.iter().flat_map(|(i, s)| second.iter().map(move |(j, t)| (*i, *j, s * t)));
                    table.hessians.push(pairs.map(|(i, j, s)| s * product(&jets, Some(i), Some(j))).sum());
                }
            }
        }
    }
}
