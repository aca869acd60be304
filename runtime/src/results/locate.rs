//! Expressions at given points: points are found in cells or on faces, values taken there.
//!
//! Points of one cell or face form one group, so a cloud of points costs about one group a cell. A point on a face
//! between two bodies belongs to each of them: the first cell of the list that holds it is taken. Promises nothing
//! about points outside: they are left out, and the caller sees which ones were found.

use std::{collections::BTreeMap, sync::Arc};

use crate::{
    assemble::{Domain, Group, GroupSide},
    mesh::{CellFinder, CellId, FacetFinder, FacetRef, InterfaceFacet, Mesh, MeshError, RegionSet},
    quadrature::Rule,
};

/// Points found in a region.
pub struct Located {
    /// The region's entities that hold points, each with its points as rule of weight 1.
    pub domain: Arc<Domain>,
    /// `points[group][q]`: which of the requested points is point `q` of a group.
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
        let finder = CellFinder::new(mesh, cells);
        let mut found: BTreeMap<CellId, Vec<(usize, [f64; 3])>> = BTreeMap::new();
        for (k, x) in points.iter().enumerate() {
            if let Some(image) = finder.find(mesh, *x) {
                found.entry(image.cell).or_default().push((k, image.reference));
            }
        }
        let (mut groups, mut numbers) = (Vec::new(), Vec::new());
        for (cell, held) in found {
            groups.push(cell_group(mesh, cell, held.iter().map(|h| h.1).collect()));
            numbers.push(held.iter().map(|h| h.0).collect());
        }
        Self { domain: domain(mesh, groups), points: numbers }
    }

    fn on_faces(mesh: &Mesh, faces: Vec<(FacetRef, RegionSet)>, points: &[[f64; 3]]) -> Result<Self, MeshError> {
        let finder = FacetFinder::new(mesh, &faces.iter().map(|f| f.0).collect::<Vec<_>>());
        let mut found: BTreeMap<usize, Vec<(usize, [f64; 3])>> = BTreeMap::new();
        for (k, x) in points.iter().enumerate() {
            if let Some((n, parameters)) = finder.holding(mesh, *x) {
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
