//! Where each cell of a refined mesh lies in the mesh before.

use std::collections::BTreeMap;

use crate::{
    cell::CellKind,
    mesh::{CellId, FacetRef},
};

/// The way from the cells of a refined mesh to those it was made of.
///
/// A cell is the image of its parent's reference cell under an affine map (multilinear in form): a field on the parent
/// is the same field on the cell at [`Descent::place`]. Few of these maps differ, so tables can be shared by
/// [`Descent::shape`].
#[derive(Clone, Debug, PartialEq)]
pub struct Descent {
    parents: Vec<CellId>,
    shapes: Vec<Vec<[f64; 3]>>,
    shape_of: Vec<u32>,
}

impl Descent {
    /// Number of cells of the refined mesh.
    #[must_use]
    pub fn n_cells(&self) -> usize {
        self.parents.len()
    }

    /// The cell of the mesh before that `cell` is a part of. Ascending: parts of a cell stand together.
    #[must_use]
    pub fn parent(&self, cell: CellId) -> CellId {
        self.parents[cell.index()]
    }

    /// True if `cell` is the whole of its parent, with the same vertices in the same order.
    #[must_use]
    pub fn is_whole(&self, cell: CellId) -> bool {
        self.shape(cell) < CellKind::ALL.len()
    }

    /// Which of [`Descent::shapes`] the cell is.
    #[must_use]
    pub fn shape(&self, cell: CellId) -> usize {
        self.shape_of[cell.index()] as usize
    }

    /// The parts of a reference cell that occur: the vertices of each, in the order of the kind. The first ones are whole
    /// cells of each of [`CellKind::ALL`].
    #[must_use]
    pub fn shapes(&self) -> &[Vec<[f64; 3]>] {
        &self.shapes
    }

    /// The vertices of `cell` in the reference cell of its parent.
    #[must_use]
    pub fn corners(&self, cell: CellId) -> &[[f64; 3]] {
        &self.shapes[self.shape(cell)]
    }

    /// The point `x` of the reference cell of `cell`, of this kind, in the reference cell of its parent.
    #[must_use]
    pub fn place(&self, cell: CellId, kind: CellKind, x: [f64; 3]) -> [f64; 3] {
        within(kind, self.corners(cell), x)
    }

    /// The facet of the parent on which a facet of a new cell lies; `None` inside the parent.
    #[must_use]
    pub fn parent_facet(&self, facet: FacetRef, kind: CellKind) -> Option<FacetRef> {
        let corners = self.corners(facet.cell);
        let mine = kind.facets()[facet.local as usize].vertices;
        let beside = |local: &usize| {
            let (normal, map) = (kind.facet_normal(*local), kind.facet_map(*local));
            // binary fractions: a vertex on the facet is on it exactly
            mine.iter().all(|v| (0..3).map(|i| side(normal[i]) * (corners[*v][i] - map.origin[i])).sum::<f64>() == 0.0)
        };
        let local = (0..kind.facets().len()).find(beside)?;
        Some(FacetRef::new(self.parent(facet.cell), local))
    }
}

/// The direction of a component of a normal: those of one normal have one size.
fn side(component: f64) -> f64 {
    if component == 0.0 { 0.0 } else { component.signum() }
}

/// The point `x` of a reference cell in a part of it with these corners.
pub(super) fn within(kind: CellKind, corners: &[[f64; 3]], x: [f64; 3]) -> [f64; 3] {
    let hats = kind.hat_values(x);
    std::array::from_fn(|i| corners.iter().zip(hats).map(|(corner, hat)| hat * corner[i]).sum())
}

/// A descent that is being made.
pub(super) struct DescentMaker {
    made: Descent,
    known: BTreeMap<(usize, Vec<[u64; 3]>), u32>,
}

impl DescentMaker {
    pub(super) fn new(n_cells: usize) -> Self {
        let shapes: Vec<Vec<[f64; 3]>> = CellKind::ALL.iter().map(|kind| kind.vertices().to_vec()).collect();
        let known = BTreeMap::new();
        let (parents, shape_of) = (Vec::with_capacity(n_cells), Vec::with_capacity(n_cells));
        Self { made: Descent { parents, shapes, shape_of }, known }
    }

    /// Adds a cell that is left as it is.
    pub(super) fn whole(&mut self, parent: CellId, kind: CellKind) {
        self.made.parents.push(parent);
        self.made.shape_of.push(kind.index() as u32);
    }

    /// Adds a part of a cell; returns its shape.
    pub(super) fn part(&mut self, parent: CellId, kind: CellKind, corners: &[[f64; 3]]) -> usize {
        let key = (kind.index(), corners.iter().map(|corner| corner.map(f64::to_bits)).collect());
        let shapes = &mut self.made.shapes;
        let shape = *self.known.entry(key).or_insert_with(|| {
            shapes.push(corners.to_vec());
            shapes.len() as u32 - 1
        });
        self.made.parents.push(parent);
        self.made.shape_of.push(shape);
        shape as usize
    }

    pub(super) fn finish(self) -> Descent {
        self.made
    }
}
