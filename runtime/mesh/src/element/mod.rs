//! Lagrange elements on the reference cells: local dofs, where they sit, and their basis tables.
//!
//! Promises: `P_0` to `P_4` on point, segment, triangle and tetrahedron, `Q_0` to `Q_4` on
//! quadrilateral and hexahedron, products of `P_k` on wedges, `P_k` and `Q_k` on the faces of pyramids up to degree 2, every
//! one nodal at [`Element::points`].
//! Local order. Simplices: vertices, then the dofs of each edge from its first to its second local
//! vertex, then those of each facet of a tetrahedron (degree 3 and more), then the interior. Tensor cells and pyramids:
//! lexicographic, x fastest. Wedges: the nodes of a triangle at each z in turn. [`Element::entities`] says for each dof
//! which entity carries it.
//! Does not know meshes, global numbers or physical coordinates.

mod entity;
mod pyramid_lagrange;
mod simplex_lagrange;
mod table;
mod tensor_lagrange;
mod wedge_lagrange;

use crate::cell::{Basis, CellKind};
pub use table::{DofEntity, Table};

use table::Lattice;

/// Highest degree on any cell; [`CellKind::highest_degree`] has that of each.
pub const MAX_DEGREE: usize = 4;

/// Whether neighbouring cells share the dofs on their common entities.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Family {
    /// Dofs on vertices, edges and facets are shared by all cells around.
    Continuous,
    /// Every dof belongs to the interior of its cell.
    Discontinuous,
}

/// Why there is no such element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ElementError {
    /// The degree is above the highest one of this cell.
    #[error("no Lagrange element of degree {degree} on a {kind}, the highest is {highest}")]
    DegreeTooHigh {
        /// Requested cell.
        kind: CellKind,
        /// Requested degree.
        degree: usize,
        /// Highest degree there is.
        highest: usize,
    },
}

/// A Lagrange element on a reference cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Element {
    lattice: Lattice,
    family: Family,
    points: Vec<[f64; 3]>,
    entities: Vec<DofEntity>,
    closures: Vec<Vec<usize>>,
}

impl Element {
    /// The Lagrange element of `degree` on `kind`; degree 0 is one constant in every family.
    ///
    /// # Errors
    /// [`ElementError::DegreeTooHigh`].
    pub fn lagrange(kind: CellKind, degree: usize, family: Family) -> Result<Self, ElementError> {
        let highest = kind.highest_degree();
        if degree > highest {
            return Err(ElementError::DegreeTooHigh { kind, degree, highest });
        }
        let mut element = Self::without_closures(kind, degree, family);
        element.closures = (0..kind.facets().len()).map(|local| closure(&element, local)).collect();
        Ok(element)
    }

    fn without_closures(kind: CellKind, degree: usize, family: Family) -> Self {
        let basis = kind.basis();
        let (places, mut entities) = match (degree, basis) {
            (0, _) => (vec![[0; 4]], vec![DofEntity::Interior(0)]),
            (_, Basis::Simplex) => simplex_lagrange::dofs(kind, degree),
            (_, Basis::Tensor) => tensor_lagrange::dofs(kind, degree),
            (_, Basis::Wedge) => wedge_lagrange::dofs(kind, degree),
            (_, Basis::Pyramid) => pyramid_lagrange::dofs(kind, degree),
        };
        let points = if degree == 0 {
            vec![kind.reference_centre()]
        } else {
            // barycentric places begin with the coordinate that the others leave
            let first = usize::from(matches!(basis, Basis::Simplex | Basis::Wedge));
            places.iter().map(|place| point_of(kind, degree, &place[first..])).collect()
        };
        if family == Family::Discontinuous {
            entities = (0..places.len()).map(DofEntity::Interior).collect();
        }
        let coefficients =
            if basis == Basis::Pyramid { pyramid_lagrange::coefficients(degree, &points) } else { Vec::new() };
        Element {
            lattice: Lattice { kind, degree, places, coefficients },
            family,
            points,
            entities,
            closures: Vec::new(),
        }
    }

    /// Every supported (cell, degree).
    #[must_use]
    pub fn registry() -> Vec<(CellKind, usize)> {
        CellKind::ALL
            .into_iter()
            .flat_map(|kind| (0..=kind.highest_degree()).map(move |degree| (kind, degree)))
            .collect()
    }

    /// Cell of the element.
    #[must_use]
    #[inline]
    pub fn kind(&self) -> CellKind {
        self.lattice.kind
    }

    /// Polynomial degree: total on simplices and triangular faces, in each variable on tensor cells and quadrilateral faces.
    #[must_use]
    #[inline]
    pub fn degree(&self) -> usize {
        self.lattice.degree
    }

    /// Continuous or discontinuous.
    #[must_use]
    #[inline]
    pub fn family(&self) -> Family {
        self.family
    }

    /// Number of local dofs.
    #[must_use]
    #[inline]
    pub fn n_dofs(&self) -> usize {
        self.points.len()
    }

    /// Reference point of each dof: the dof is the value there.
    #[must_use]
    #[inline]
    pub fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// Entity that carries each dof.
    #[must_use]
    #[inline]
    pub fn entities(&self) -> &[DofEntity] {
        &self.entities
    }

    /// Local dofs whose point lies on the closed facet `local_facet`, listed in the local order of
    /// the element of the same degree on the facet's kind and in the facet's own parameters. Also
    /// filled for discontinuous elements; empty for degree 0.
    #[must_use]
    #[inline]
    pub fn facet_closure(&self, local_facet: usize) -> &[usize] {
        &self.closures[local_facet]
    }

    /// Local dof at each local vertex of the cell; `None` for degree 0.
    #[must_use]
    pub fn vertex_dofs(&self) -> Option<Vec<usize>> {
        let find = |vertex| self.points.iter().position(|point| point == vertex);
        self.kind().vertices().iter().map(find).collect()
    }

    /// Basis functions at reference points, with derivatives up to order `derivatives` (0 to 2).
    ///
    /// # Panics
    /// If `derivatives` is above 2.
    #[must_use]
    pub fn tabulate(&self, points: &[[f64; 3]], derivatives: usize) -> Table {
        assert!(derivatives <= 2, "tables have at most second derivatives");
        let (dim, n_dofs) = (self.kind().dim(), self.n_dofs());
        let entries = points.len() * n_dofs;
        let mut table = Table {
            n_points: points.len(),
            n_dofs,
            dim,
            values: Vec::with_capacity(entries),
            gradients: Vec::with_capacity(if derivatives > 0 { entries * dim } else { 0 }),
            hessians: Vec::with_capacity(if derivatives > 1 { entries * dim * dim } else { 0 }),
        };
        for point in points {
            match self.kind().basis() {
                Basis::Simplex => simplex_lagrange::tabulate(&self.lattice, point, derivatives, &mut table),
                Basis::Tensor => tensor_lagrange::tabulate(&self.lattice, point, derivatives, &mut table),
                Basis::Wedge => wedge_lagrange::tabulate(&self.lattice, point, derivatives, &mut table),
                Basis::Pyramid => pyramid_lagrange::tabulate(&self.lattice, point, derivatives, &mut table),
            }
        }
        table
    }
}

/// The reference point at a place in units of `1 / degree`.
fn point_of(kind: CellKind, degree: usize, place: &[u8]) -> [f64; 3] {
    let mut point = [0.0; 3];
    for (x, part) in point.iter_mut().zip(place).take(kind.dim()) {
        *x = f64::from(*part) / degree as f64;
    }
    point
}

/// Dofs on a facet, found by their points; see [`Element::facet_closure`] for the order.
fn closure(element: &Element, local: usize) -> Vec<usize> {
    if element.degree() == 0 {
        return Vec::new();
    }
    let facet = element.kind().facets()[local];
    let map = element.kind().facet_map(local);
    let on_facet = Element::without_closures(facet.kind, element.degree(), Family::Continuous);
    let close = |p: &[f64; 3], q: &[f64; 3]| (0..3).all(|i| (p[i] - q[i]).abs() < 1e-9);
    on_facet
        .points
        .iter()
        .map(|parameters| {
            let point = map.apply(*parameters);
            element
                .points
                .iter()
                .position(|p| close(p, &point))
                .expect("the lattice of a facet is part of the lattice of the cell")
        })
        .collect()
}

#[cfg(test)]
mod tests;
