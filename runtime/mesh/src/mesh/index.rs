//! Names of the entities of a mesh: cells, nodes, edges, facets and facets with a side.
//!
//! Promises one type an entity, so that no number is taken for another. Does not know what an entity looks like.

wfl::define_index! {
    /// A cell of the mesh.
    CellId,
    /// A node of the mesh: a point of its geometry.
    NodeId,
    /// A facet of the mesh, numbered once for both its cells.
    FacetId,
    /// An edge of the mesh, numbered once for all its cells.
    EdgeId,
}

/// A facet seen from one of its cells. The side is part of the identity: the normal of
/// `FacetRef` points out of `cell`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FacetRef {
    /// The cell it is seen from.
    pub cell: CellId,
    /// Local facet of that cell.
    pub local: u8,
}

impl FacetRef {
    /// Local facet `local` of `cell`.
    #[must_use]
    pub fn new(cell: CellId, local: usize) -> Self {
        let local = u8::try_from(local).expect("a cell has at most six facets");
        FacetRef { cell, local }
    }
}

/// A facet of an interface with both its sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct InterfaceFacet {
    /// Side of the first region; the normal points out of its cell.
    pub here: FacetRef,
    /// Side of the second region.
    pub there: FacetRef,
}
