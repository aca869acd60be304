//! Unique facets and edges of a mesh, and the cells that share them.
//!
//! Promises: numbers follow first appearance in cell order; `here` of a facet is its cell of lower number. Entities are
//! sorted into buckets by their lowest vertex, without hashing. Edges are built on request. Does not know geometry:
//! entities are equal when their vertices are.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::OnceLock,
};

use super::{
    CellKind, Mesh,
    error::MeshError,
    index::{CellId, EdgeId, FacetId, FacetRef, NodeId},
    sides::refuse_one_sided,
};

/// A facet of the mesh with the one or two cells at it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Facet {
    /// The cell of lower number.
    pub here: FacetRef,
    /// The other cell; `None` on the outer boundary.
    pub there: Option<FacetRef>,
}

/// Facets of a mesh, and its edges on request.
#[derive(Debug)]
pub struct Topology {
    facets: Vec<Facet>,
    /// Position of the first facet of each cell in `cell_facets`.
    starts: Vec<u32>,
    cell_facets: Vec<FacetId>,
    /// Facets by their lowest vertex.
    bucket_starts: Vec<u32>,
    buckets: Vec<FacetId>,
    edges: OnceLock<EdgeTable>,
}

/// Vertices of a facet in ascending order, padded with `u32::MAX`.
type Key = [u32; 4];

struct Entry {
    /// Key without its lowest vertex, which is the bucket.
    rest: [u32; 3],
    /// Position in `cell_facets`.
    slot: u32,
}

fn key(mesh: &Mesh, facet: FacetRef) -> Key {
    let vertices = mesh.facet_vertices(facet);
    sorted(vertices.vertices())
}

fn sorted(vertices: &[NodeId]) -> Key {
    let mut key = [u32::MAX; 4];
    for (part, vertex) in key.iter_mut().zip(vertices) {
        *part = vertex.index() as u32;
    }
    key.sort_unstable();
    key
}

impl Topology {
    /// Finds the facets of `mesh`.
    ///
    /// # Errors
    /// [`MeshError::NonManifold`], [`MeshError::DuplicateCell`], [`MeshError::HalfFace`], [`MeshError::FoldedOver`] and
    /// [`MeshError::MiddleNodes`].
    pub fn new(mesh: &Mesh) -> Result<Topology, MeshError> {
        let mut starts = Vec::with_capacity(mesh.n_cells() + 1);
        let mut slots = Vec::new();
        for cell in mesh.cells() {
            starts.push(slots.len() as u32);
            let n = mesh.kind(cell).facets().len();
            slots.extend((0..n).map(|local| FacetRef::new(cell, local)));
        }
        starts.push(slots.len() as u32);
        let (entry_starts, entries) = bucket(mesh, &slots);
        let partners = pair(mesh, &entry_starts, entries, &slots)?;
        let mut topology = Topology::number(mesh, &slots, starts, &partners);
        topology.fill_buckets(mesh);
        topology.refuse_duplicate_cells(mesh)?;
        topology.refuse_half_faces(mesh)?;
        refuse_one_sided(mesh, topology.facets.iter().filter_map(|facet| Some((facet.here, facet.there?))))?;
        Ok(topology)
    }

    fn number(mesh: &Mesh, slots: &[FacetRef], starts: Vec<u32>, partners: &[u32]) -> Self {
        let mut facets = Vec::with_capacity(slots.len() / 2 + mesh.n_cells() / 4);
        let mut cell_facets = vec![FacetId::new(0); slots.len()];
        for (slot, here) in slots.iter().enumerate() {
            let partner = partners[slot];
            if partner != u32::MAX && (partner as usize) < slot {
                continue;
            }
            let id = FacetId::new(facets.len());
            cell_facets[slot] = id;
            let there = (partner != u32::MAX).then(|| {
                cell_facets[partner as usize] = id;
                slots[partner as usize]
            });
            facets.push(Facet { here: *here, there });
        }
        Topology { facets, starts, cell_facets, bucket_starts: Vec::new(), buckets: Vec::new(), edges: OnceLock::new() }
    }

    fn fill_buckets(&mut self, mesh: &Mesh) {
        let lowest = |facet: &Facet| key(mesh, facet.here)[0] as usize;
        let mut starts = vec![0u32; mesh.n_nodes() + 1];
        for facet in &self.facets {
            starts[lowest(facet) + 1] += 1;
        }
        accumulate(&mut starts);
        let mut next = starts.clone();
        let mut buckets = vec![FacetId::new(0); self.facets.len()];
        for (id, facet) in self.facets.iter().enumerate() {
            let place = &mut next[lowest(facet)];
            buckets[*place as usize] = FacetId::new(id);
            *place += 1;
        }
        self.bucket_starts = starts;
        self.buckets = buckets;
    }

    fn refuse_duplicate_cells(&self, mesh: &Mesh) -> Result<(), MeshError> {
        for cell in mesh.cells() {
            let neighbour = |facet: &FacetId| self.across(*facet, cell).map(|f| f.cell);
            let mut around = self.cell_facets(cell).iter().map(neighbour);
            if let Some(Some(first)) = around.next()
                && around.all(|other| other == Some(first))
            {
                let name = |cell| mesh.numbers().cell(cell);
                let (first, second) = (name(cell.min(first)), name(cell.max(first)));
                return Err(MeshError::DuplicateCell { first, second });
            }
        }
        Ok(())
    }

    /// Triangles of the boundary that lie on a quadrilateral of it: cells of two kinds that were meant to be neighbours.
    fn refuse_half_faces(&self, mesh: &Mesh) -> Result<(), MeshError> {
        let kinds: BTreeSet<CellKind> = mesh.kinds().iter().copied().collect();
        let has = |facet: CellKind| kinds.iter().any(|kind| kind.facets().iter().any(|f| f.kind == facet));
        if !has(CellKind::Triangle) || !has(CellKind::Quadrilateral) {
            return Ok(());
        }
        let outer = |kind: CellKind| {
            let all = self.facets.iter().filter(|f| f.there.is_none()).map(|f| f.here);
            all.filter(move |f| mesh.facet_kind(*f) == kind)
        };
        let mut halves: BTreeMap<[u32; 3], CellId> = BTreeMap::new();
        for facet in outer(CellKind::Quadrilateral) {
            let [a, b, c, d] = key(mesh, facet);
            for half in [[a, b, c], [a, b, d], [a, c, d], [b, c, d]] {
                halves.insert(half, facet.cell);
            }
        }
        for facet in outer(CellKind::Triangle) {
            let [a, b, c, _] = key(mesh, facet);
            if let Some(other) = halves.get(&[a, b, c]) {
                let [triangle, quadrilateral] = [facet.cell, *other].map(|cell| mesh.numbers().cell(cell));
                return Err(MeshError::HalfFace { triangle, quadrilateral });
            }
        }
        Ok(())
    }

    /// All facets, by number.
    #[must_use]
    pub fn facets(&self) -> &[Facet] {
        &self.facets
    }

    /// One facet.
    #[must_use]
    pub fn facet(&self, facet: FacetId) -> Facet {
        self.facets[facet.index()]
    }

    /// Number of facets.
    #[must_use]
    pub fn n_facets(&self) -> usize {
        self.facets.len()
    }

    /// Facets of a cell, in local order.
    #[must_use]
    pub fn cell_facets(&self, cell: CellId) -> &[FacetId] {
        let range = self.starts[cell.index()] as usize..self.starts[cell.index() + 1] as usize;
        &self.cell_facets[range]
    }

    /// Number of the facet that `facet` is a side of.
    #[must_use]
    pub fn facet_id(&self, facet: FacetRef) -> FacetId {
        self.cell_facets(facet.cell)[facet.local as usize]
    }

    /// The same facet seen from the other cell.
    #[must_use]
    pub fn opposite(&self, facet: FacetRef) -> Option<FacetRef> {
        self.across(self.facet_id(facet), facet.cell)
    }

    fn across(&self, facet: FacetId, cell: CellId) -> Option<FacetRef> {
        let facet = self.facet(facet);
        if facet.here.cell == cell { facet.there } else { Some(facet.here) }
    }

    /// The facet with these vertices, in any order.
    #[must_use]
    pub fn find_facet(&self, mesh: &Mesh, vertices: &[NodeId]) -> Option<FacetId> {
        let wanted = sorted(vertices);
        let lowest = wanted[0] as usize;
        let end = *self.bucket_starts.get(lowest + 1)? as usize;
        let bucket = &self.buckets[self.bucket_starts[lowest] as usize..end];
        let same = |id: &FacetId| key(mesh, self.facet(*id).here) == wanted;
        bucket.iter().copied().find(same)
    }

    /// The edges of the mesh; built at the first call. `mesh` is the one the topology was made of.
    pub fn edges(&self, mesh: &Mesh) -> &EdgeTable {
        self.edges.get_or_init(|| EdgeTable::new(mesh))
    }
}

fn accumulate(counts: &mut [u32]) {
    let mut sum = 0;
    for count in counts {
        sum += *count;
        *count = sum;
    }
}

/// All facets of all cells, bucketed by lowest vertex.
fn bucket(mesh: &Mesh, slots: &[FacetRef]) -> (Vec<u32>, Vec<Entry>) {
    let keys: Vec<Key> = slots.iter().map(|slot| key(mesh, *slot)).collect();
    let mut starts = vec![0u32; mesh.n_nodes() + 1];
    for key in &keys {
        starts[key[0] as usize + 1] += 1;
    }
    accumulate(&mut starts);
    let mut next = starts.clone();
    let empty = || Entry { rest: [0; 3], slot: 0 };
    let mut entries: Vec<Entry> = std::iter::repeat_with(empty).take(keys.len()).collect();
    for (slot, key) in keys.iter().enumerate() {
        let place = &mut next[key[0] as usize];
        entries[*place as usize] = Entry { rest: [key[1], key[2], key[3]], slot: slot as u32 };
        *place += 1;
    }
    (starts, entries)
}

/// For each slot the slot of the same facet in the other cell, `u32::MAX` on the boundary.
fn pair(mesh: &Mesh, starts: &[u32], mut entries: Vec<Entry>, slots: &[FacetRef]) -> Result<Vec<u32>, MeshError> {
    let mut partners = vec![u32::MAX; slots.len()];
    let mut crowd = None;
    for bounds in starts.windows(2) {
        let bucket = &mut entries[bounds[0] as usize..bounds[1] as usize];
        bucket.sort_unstable_by_key(|entry| (entry.rest, entry.slot));
        for same in bucket.chunk_by(|a, b| a.rest == b.rest) {
            match same {
                [_] => {}
                [here, there] => {
                    partners[here.slot as usize] = there.slot;
                    partners[there.slot as usize] = here.slot;
                }
                _ => {
                    let cells = same.iter().map(|e| mesh.numbers().cell(slots[e.slot as usize].cell)).collect();
                    crowd.get_or_insert(cells);
                }
            }
        }
    }
    match crowd {
        None => Ok(partners),
        Some(cells) => Err(MeshError::NonManifold { cells }),
    }
}

/// Unique edges and the edges of each cell.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeTable {
    edges: Vec<[NodeId; 2]>,
    starts: Vec<u32>,
    cell_edges: Vec<EdgeId>,
}

impl EdgeTable {
    /// Finds the edges of `mesh`, numbered by first appearance in cell order.
    #[must_use]
    pub fn new(mesh: &Mesh) -> EdgeTable {
        let mut starts = Vec::with_capacity(mesh.n_cells() + 1);
        let mut ends: Vec<[u32; 2]> = Vec::new();
        for cell in mesh.cells() {
            starts.push(ends.len() as u32);
            let vertices = mesh.cell_vertices(cell);
            ends.extend(mesh.kind(cell).edges().iter().map(|[first, second]| {
                let pair = [vertices[*first].index() as u32, vertices[*second].index() as u32];
                [pair[0].min(pair[1]), pair[0].max(pair[1])]
            }));
        }
        starts.push(ends.len() as u32);
        let first_slot = first_slots(&ends, mesh.n_nodes());
        let mut edges = Vec::new();
        let mut cell_edges: Vec<EdgeId> = Vec::with_capacity(ends.len());
        for (slot, pair) in ends.iter().enumerate() {
            let first = first_slot[slot] as usize;
            if first == slot {
                cell_edges.push(EdgeId::new(edges.len()));
                edges.push(pair.map(|node| NodeId::new(node as usize)));
            } else {
                cell_edges.push(cell_edges[first]);
            }
        }
        EdgeTable { edges, starts, cell_edges }
    }

    /// Vertices of each edge, lower number first.
    #[must_use]
    pub fn edges(&self) -> &[[NodeId; 2]] {
        &self.edges
    }

    /// Edges of a cell, in the order of [`CellKind::edges`](super::CellKind::edges).
    #[must_use]
    pub fn cell_edges(&self, cell: CellId) -> &[EdgeId] {
        let range = self.starts[cell.index()] as usize..self.starts[cell.index() + 1] as usize;
        &self.cell_edges[range]
    }
}

/// For each slot the lowest slot with the same pair of ends.
fn first_slots(ends: &[[u32; 2]], n_nodes: usize) -> Vec<u32> {
    let mut bucket_starts = vec![0u32; n_nodes + 1];
    for pair in ends {
        bucket_starts[pair[0] as usize + 1] += 1;
    }
    accumulate(&mut bucket_starts);
    let mut next = bucket_starts.clone();
    let mut entries = vec![(0u32, 0u32); ends.len()];
    for (slot, pair) in ends.iter().enumerate() {
        let place = &mut next[pair[0] as usize];
        entries[*place as usize] = (pair[1], slot as u32);
        *place += 1;
    }
    let mut first_slot = vec![0u32; ends.len()];
    for bounds in bucket_starts.windows(2) {
        let bucket = &mut entries[bounds[0] as usize..bounds[1] as usize];
        bucket.sort_unstable();
        for same in bucket.chunk_by(|a, b| a.0 == b.0) {
            for (_, slot) in same {
                first_slot[*slot as usize] = same[0].1;
            }
        }
    }
    first_slot
}
