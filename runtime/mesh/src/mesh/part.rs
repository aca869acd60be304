//! Which rank owns which node of a mesh, where several solve on it together.
//!
//! Nodes are shared out by recursive bisection of their coordinates; nodes at one place (the two sides of bodies that
//! touch) have one owner. A cell or facet is counted by the owner of the first of its vertices: by one rank. A rank may
//! have a part of the mesh alone ([`MeshPart`]): the cells around its nodes, and those that these are coupled to. Promises:
//! owners are a function of the mesh and the number of ranks alone; cells and nodes of a part are in the order of the whole
//! mesh. Does not know fields.

use std::sync::Arc;

use wfl_host::team::{Alone, Team};

use super::{
    Mesh,
    index::{CellId, FacetRef, NodeId},
    raw::{FileNumbers, RawMesh},
};
use crate::cell::CellKind;

/// Marks what is not in a part.
const ABSENT: u32 = u32::MAX;

/// Who owns the nodes of a mesh.
#[derive(Clone, Debug)]
pub struct Part {
    team: Arc<dyn Team>,
    own: u16,
    /// By node: the rank that owns it.
    owner: Vec<u16>,
    /// By node: the number of its place. Of the vertices of an entity that with the smallest one is the first.
    place: Vec<u32>,
    /// Where this rank has a part of the mesh alone.
    of_whole: Option<OfWhole>,
}

/// What a rank that has a part of a mesh alone knows of the whole one.
#[derive(Clone, Debug)]
struct OfWhole {
    /// By cell its number in the whole mesh.
    cells: Vec<u32>,
    bounds: [[f64; 3]; 2],
    n_nodes: usize,
    n_cells: Vec<u32>,
}

impl Part {
    /// Of a mesh that every rank has as a whole.
    ///
    /// # Panics
    /// With more than 65,535 ranks.
    #[must_use]
    pub fn of_whole(team: Arc<dyn Team>, mesh: &Mesh) -> Self {
        let owner = bisect(mesh.nodes(), team.size());
        let place = places(mesh.nodes());
        let own = u16::try_from(team.rank()).expect("fewer than 2^16 ranks");
        Self { team, own, owner, place, of_whole: None }
    }

    /// The ranks.
    #[must_use]
    pub fn team(&self) -> &Arc<dyn Team> {
        &self.team
    }

    /// The rank that owns what belongs to an entity with these vertices.
    #[must_use]
    #[inline]
    pub fn owner(&self, vertices: &[NodeId]) -> u16 {
        let first = vertices.iter().min_by_key(|node| self.place[node.index()]);
        first.map_or(0, |node| self.owner[node.index()])
    }
}

/// A part of a mesh as it is sent to the rank that works on it: its cells with their nodes, both in the order of the whole
/// mesh, and who owns the nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshPart {
    /// Cells and nodes of the part.
    pub raw: RawMesh,
    /// By cell its number in the whole mesh.
    pub cells: Vec<u32>,
    /// By node the rank that owns it.
    pub owner: Vec<u16>,
    /// By node the number of its place in the whole mesh.
    pub place: Vec<u32>,
    /// Lowest and highest coordinates of the whole mesh.
    pub bounds: [[f64; 3]; 2],
    /// Number of nodes of the whole mesh.
    pub n_nodes: usize,
    /// By kind of cells, in the order of [`CellKind::ALL`], how many the whole mesh has.
    pub n_cells: Vec<u32>,
}

/// Where the entities of a whole mesh stand in a part of it.
#[derive(Clone, Debug)]
pub struct PlacesInPart {
    cells: Vec<u32>,
    nodes: Vec<u32>,
}

impl PlacesInPart {
    /// A cell of the whole mesh in the part.
    #[must_use]
    #[inline]
    pub fn cell(&self, cell: CellId) -> Option<CellId> {
        let place = self.cells[cell.index()];
        (place != ABSENT).then(|| CellId::new(place as usize))
    }

    /// A node.
    #[must_use]
    #[inline]
    pub fn node(&self, node: NodeId) -> Option<NodeId> {
        let place = self.nodes[node.index()];
        (place != ABSENT).then(|| NodeId::new(place as usize))
    }

    /// A facet, seen from its cell.
    #[must_use]
    pub fn facet(&self, facet: FacetRef) -> Option<FacetRef> {
        Some(FacetRef { cell: self.cell(facet.cell)?, local: facet.local })
    }
}

impl Part {
    /// The cells of the whole mesh that a rank needs, increasing: those around its nodes, those that these are coupled to
    /// by a pair of cells, and on the first rank some more.
    #[must_use]
    pub fn cells_of(&self, mesh: &Mesh, rank: usize, coupled: &[(CellId, CellId)], of_first: &[CellId]) -> Vec<CellId> {
        let of_first = if rank == 0 { of_first } else { &[] };
        let rank = u16::try_from(rank).expect("fewer than 2^16 ranks");
        let is_around = |cell: CellId| mesh.cell_vertices(cell).iter().any(|node| self.owner[node.index()] == rank);
        let around: Vec<bool> = mesh.cells().map(is_around).collect();
        let mut needed = around.clone();
        for (a, b) in coupled {
            needed[a.index()] |= around[b.index()];
            needed[b.index()] |= around[a.index()];
        }
        of_first.iter().for_each(|cell| needed[cell.index()] = true);
        mesh.cells().filter(|cell| needed[cell.index()]).collect()
    }

    /// The part of the whole mesh that these cells are, in increasing order, and where its entities stand in it.
    #[must_use]
    pub fn cut(&self, mesh: &Mesh, cells: &[CellId]) -> (MeshPart, PlacesInPart) {
        let mut is_used = vec![false; mesh.n_nodes()];
        cells.iter().flat_map(|cell| mesh.cell_nodes(*cell)).for_each(|node| is_used[node.index()] = true);
        let mut places = PlacesInPart { cells: vec![ABSENT; mesh.n_cells()], nodes: vec![ABSENT; mesh.n_nodes()] };
        let (low, high) = mesh.bounds();
        let counts = mesh.counts_by_kind();
        let mut part =
            MeshPart { bounds: [low, high], n_nodes: mesh.n_nodes(), n_cells: counts, ..MeshPart::default() };
        let numbers = mesh.numbers();
        let mut own_numbers = FileNumbers::default();
        for node in (0..mesh.n_nodes()).filter(|node| is_used[*node]) {
            places.nodes[node] = part.owner.len() as u32;
            part.raw.nodes.push(mesh.nodes()[node]);
            part.owner.push(self.owner[node]);
            part.place.push(self.place[node]);
            own_numbers.nodes.extend(numbers.nodes.get(node));
        }
        for cell in cells {
            places.cells[cell.index()] = part.cells.len() as u32;
            part.cells.push(cell.index() as u32);
            part.raw.kinds.push(mesh.kind(*cell));
            part.raw.connectivity.extend(mesh.cell_nodes(*cell).iter().map(|node| places.nodes[node.index()]));
            own_numbers.cells.extend(numbers.cells.get(cell.index()));
        }
        (part.raw.dim, part.raw.order, part.raw.numbers) = (mesh.dim(), mesh.order(), own_numbers);
        (part, places)
    }
}

impl Mesh {
    /// The mesh of a rank that has a part alone; it was checked as a whole.
    #[must_use]
    pub fn of_part(team: Arc<dyn Team>, part: MeshPart) -> Self {
        let MeshPart { raw, cells, owner, place, bounds, n_nodes, n_cells } = part;
        let mut mesh = Self::checked_before(raw);
        let own = u16::try_from(team.rank()).expect("fewer than 2^16 ranks");
        mesh.part = Some(Arc::new(Part {
            team,
            own,
            owner,
            place,
            of_whole: Some(OfWhole { cells, bounds, n_nodes, n_cells }),
        }));
        mesh
    }

    /// Shares out the nodes of a mesh that every rank has as a whole.
    pub fn share(&mut self, team: Arc<dyn Team>) {
        self.part = Some(Arc::new(Part::of_whole(team, self)));
    }

    /// Who owns its nodes; `None` where one rank has all.
    #[must_use]
    #[inline]
    pub fn part(&self) -> Option<&Part> {
        self.part.as_deref()
    }

    /// The ranks that have it.
    #[must_use]
    pub fn team(&self) -> &dyn Team {
        self.part().map_or(&Alone, |part| &**part.team())
    }

    /// Who owns its nodes, where this rank has a part of it alone.
    #[must_use]
    pub fn part_of_whole(&self) -> Option<&Part> {
        self.part().filter(|part| part.of_whole.is_some())
    }

    /// The ranks that hold it together, a part each: what is true of the mesh, these find. A rank that has all of it holds
    /// it alone, however many others have a copy: those share rows of equations, not the mesh.
    #[must_use]
    pub fn holders(&self) -> &dyn Team {
        self.part_of_whole().map_or(&Alone, |part| &**part.team())
    }

    /// Whether what is not in this list is nowhere in the mesh: with a part of it a rank does not know, others may have some.
    #[must_use]
    pub fn lacks<T>(&self, here: &[T]) -> bool {
        here.is_empty() && self.is_whole()
    }

    /// What a check finds that looks at the whole mesh. On a part of it, where what lies elsewhere is not known, nothing is
    /// looked at: of a scene the first rank has told everything before it sent the parts.
    pub fn check_whole<T: Default>(&self, check: impl FnOnce() -> T) -> T {
        if self.is_whole() { check() } else { T::default() }
    }

    /// Whether this rank has all of it.
    #[must_use]
    #[inline]
    pub fn is_whole(&self) -> bool {
        self.of_whole().is_none()
    }

    fn of_whole(&self) -> Option<&OfWhole> {
        self.part()?.of_whole.as_ref()
    }

    /// Lowest and highest coordinates of the whole mesh, where this rank has a part of it.
    pub(super) fn bounds_of_whole(&self) -> Option<[[f64; 3]; 2]> {
        Some(self.of_whole()?.bounds)
    }

    /// The number of a cell in the whole mesh.
    #[must_use]
    #[inline]
    pub fn cell_number(&self, cell: CellId) -> u32 {
        match self.of_whole() {
            Some(whole) => whole.cells[cell.index()],
            None => u32::try_from(cell.index()).expect("fewer than 2^32 cells"),
        }
    }

    /// Number of nodes of the whole mesh.
    #[must_use]
    pub fn n_nodes_of_whole(&self) -> usize {
        self.of_whole().map_or(self.n_nodes(), |whole| whole.n_nodes)
    }

    /// By kind of cells, in the order of [`CellKind::ALL`], how many the whole mesh has.
    #[must_use]
    pub fn counts_by_kind(&self) -> Vec<u32> {
        if let Some(whole) = self.of_whole() {
            return whole.n_cells.clone();
        }
        let mut counts = vec![0; CellKind::ALL.len()];
        self.kinds().iter().for_each(|kind| counts[kind.index()] += 1);
        counts
    }

    /// The cell that has this number in the whole mesh, where this rank has it.
    #[must_use]
    pub fn numbered_cell(&self, number: u32) -> Option<CellId> {
        match self.of_whole() {
            Some(whole) => whole.cells.binary_search(&number).ok().map(CellId::new),
            None => ((number as usize) < self.n_cells()).then(|| CellId::new(number as usize)),
        }
    }

    /// Whether this rank counts a cell: each is counted by one.
    #[must_use]
    #[inline]
    pub fn counts_cell(&self, cell: CellId) -> bool {
        self.part().is_none_or(|part| part.owner(self.cell_vertices(cell)) == part.own)
    }

    /// Whether this rank counts a facet.
    #[must_use]
    #[inline]
    pub fn counts_facet(&self, facet: FacetRef) -> bool {
        self.part().is_none_or(|part| part.owner(self.facet_vertices(facet).vertices()) == part.own)
    }
}

/// By node the first of those at its place.
fn places(points: &[[f64; 3]]) -> Vec<u32> {
    // adding zero takes the sign off a zero
    let bits = |node: u32| points[node as usize].map(|c| (c + 0.0).to_bits());
    let mut order: Vec<u32> = (0u32..).take(points.len()).collect();
    order.sort_unstable_by_key(|node| (bits(*node), *node));
    let mut place = vec![0; points.len()];
    for same in order.chunk_by(|a, b| bits(*a) == bits(*b)) {
        same.iter().for_each(|node| place[*node as usize] = same[0]);
    }
    place
}

/// By node its rank: halves of the longest axis, in the ratio of the ranks on both sides.
fn bisect(points: &[[f64; 3]], ranks: usize) -> Vec<u16> {
    let rank = |k: usize| u16::try_from(k).expect("fewer than 2^16 ranks");
    let mut owner = vec![0; points.len()];
    let mut parts = vec![((0u32..).take(points.len()).collect::<Vec<u32>>(), 0, ranks)];
    while let Some((mut nodes, first, n)) = parts.pop() {
        if n <= 1 || nodes.is_empty() {
            nodes.iter().for_each(|node| owner[*node as usize] = rank(first));
            continue;
        }
        let length = |d: usize| {
            let along = nodes.iter().map(|node| points[*node as usize][d]);
            along.clone().fold(f64::NEG_INFINITY, f64::max) - along.fold(f64::INFINITY, f64::min)
        };
        let longest = (1..3).fold(0, |best, d| if length(d) > length(best) { d } else { best });
        // the other axes decide among nodes on one plane
        let axes = [longest, (longest + 1) % 3, (longest + 2) % 3];
        let compare = |a: &u32, b: &u32| {
            let by = |d: &usize| points[*a as usize][*d].total_cmp(&points[*b as usize][*d]);
            axes.iter().map(by).find(|order| order.is_ne()).unwrap_or_else(|| a.cmp(b))
        };
        nodes.sort_unstable_by(compare);
        let mut cut = nodes.len() * (n / 2) / n;
        while cut > 0 && cut < nodes.len() && points[nodes[cut] as usize] == points[nodes[cut - 1] as usize] {
            cut += 1;
        }
        let behind = nodes.split_off(cut);
        parts.push((nodes, first, n / 2));
        parts.push((behind, first + n / 2, n - n / 2));
    }
    owner
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_at_one_point_have_one_place() {
        let points = [[1.0, 0.0, 0.0], [0.0, -0.0, 2.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0], [1.0, -0.0, -0.0]];
        assert_eq!(places(&points), [0, 1, 0, 1, 0]);
    }

    #[test]
    fn parts_are_even_and_nodes_at_one_point_have_one_rank() {
        // two bodies of 3x2x1 nodes that touch at x = 2
        let body = |x0: f64| (0..6).map(move |k| [x0 + f64::from(k % 3), f64::from(k / 3), 0.0]);
        let points: Vec<[f64; 3]> = body(0.0).chain(body(2.0)).collect();
        for ranks in 1..=4 {
            let owner = bisect(&points, ranks);
            assert_eq!((owner[2], owner[5]), (owner[6], owner[9]), "{ranks} ranks: the sides of the interface");
            let counts: Vec<usize> =
                (0..ranks).map(|rank| owner.iter().filter(|o| usize::from(**o) == rank).count()).collect();
            assert!(counts.iter().all(|n| n.abs_diff(12 / ranks) <= 2), "{counts:?}");
        }
    }
}
