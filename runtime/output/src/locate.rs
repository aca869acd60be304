//! Expressions at given points: points are found in cells, on faces or on edges of faces, values taken there.
//!
//! Points of one cell or face form one group, so a cloud of points costs about one group a cell. A point on a face
//! between two bodies belongs to each of them: the first cell of the list that holds it is taken; of ranks that have parts
//! of the mesh, one has it. Promises nothing about points outside: they are left out, and the caller sees which ones were
//! found.

use std::{collections::BTreeMap, sync::Arc};

use wfl_discrete::assemble::{Domain, Group, GroupSide, Over};
use wfl_mesh::{
    mesh::{CellFinder, CellId, FaceEdge, FacetFinder, FacetRef, InterfaceFacet, Mesh, MeshError, RegionSet},
    quadrature::Rule,
};

/// Points found in a region.
pub struct Located {
    /// The region's entities that hold points, each with its points as rule of weight 1.
    pub domain: Arc<Domain>,
    /// `points[group][q]`: which of the requested points is point `q` of a group.
    pub points: Vec<Vec<usize>>,
    /// By requested point whether it was found, on whichever rank.
    pub found: Vec<bool>,
}

/// An entity that holds a point: what all ranks call it, its place in the list, the parameters of the point.
type Holder = (u64, usize, [f64; 3]);

/// Of the holders that the ranks have found for each point the first one, on one rank; and which points have one.
fn of_one_rank(mesh: &Mesh, mut found: Vec<Option<Holder>>) -> (Vec<Option<Holder>>, Vec<bool>) {
    let team = mesh.holders();
    if team.is_alone() {
        let is_found = found.iter().map(Option::is_some).collect();
        return (found, is_found);
    }
    let own: Vec<u64> = found.iter().map(|holder| holder.map_or(0, |(name, ..)| u64::MAX - name)).collect();
    let mut first = own.clone();
    team.max_words(&mut first);
    let is_first = |k: usize| own[k] > 0 && own[k] == first[k];
    let before_end = (team.size() - team.rank()) as u64;
    let mut rank: Vec<u64> = (0..own.len()).map(|k| if is_first(k) { before_end } else { 0 }).collect();
    team.max_words(&mut rank);
    for (k, holder) in found.iter_mut().enumerate() {
        if !(is_first(k) && rank[k] == before_end) {
            *holder = None;
        }
    }
    (found, first.iter().map(|word| *word > 0).collect())
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
            RegionSet::Edges(edges) => Self::on_edges(mesh, edges, points),
            RegionSet::Nodes(_) => Self::on_faces(mesh, Vec::new(), points),
        }
    }

    /// Finds points in cells; the first of the list that holds a point gets it.
    #[must_use]
    pub fn in_cells(mesh: &Mesh, cells: &[CellId], points: &[[f64; 3]]) -> Self {
        let finder = CellFinder::new(mesh, cells);
        let holder = |x: &[f64; 3]| {
            let image = finder.find(mesh, *x)?;
            Some((u64::from(mesh.cell_number(image.cell)), image.cell.index(), image.reference))
        };
        let (held, found) = of_one_rank(mesh, points.iter().map(holder).collect());
        let (mut groups, mut numbers) = (Vec::new(), Vec::new());
        for (cell, held) in by_entity(&held) {
            groups.push(cell_group(mesh, CellId::new(cell), held.iter().map(|h| h.1).collect()));
            numbers.push(held.iter().map(|h| h.0).collect());
        }
        Self { domain: domain(mesh, Over::Cells, groups), points: numbers, found }
    }

    fn on_faces(mesh: &Mesh, faces: Vec<(FacetRef, RegionSet)>, points: &[[f64; 3]]) -> Result<Self, MeshError> {
        let finder = FacetFinder::new(mesh, &faces.iter().map(|f| f.0).collect::<Vec<_>>());
        let holder = |x: &[f64; 3]| {
            let (n, parameters) = finder.holding(mesh, *x)?;
            let facet = faces[n].0;
            Some((u64::from(mesh.cell_number(facet.cell)) << 8 | u64::from(facet.local), n, parameters))
        };
        let (held, found) = of_one_rank(mesh, points.iter().map(holder).collect());
        let is_own = !mesh.holders().is_alone();
        let (mut groups, mut numbers) = (Vec::new(), Vec::new());
        for (n, held) in by_entity(&held) {
            let points: Vec<[f64; 3]> = held.iter().map(|h| h.1).collect();
            let rule = |kind| Rule { kind, degree: 0, weights: vec![1.0; points.len()], points: points.clone() };
            let made = Domain::new(mesh, &faces[n].1, &rule)?.groups;
            groups.extend(made.into_iter().map(|group| Group { is_own, ..group }));
            numbers.push(held.iter().map(|h| h.0).collect());
        }
        Ok(Self { domain: domain(mesh, Over::Facets, groups), points: numbers, found })
    }

    fn on_edges(mesh: &Mesh, edges: &[FaceEdge], points: &[[f64; 3]]) -> Result<Self, MeshError> {
        // a face that holds a point may have several of the edges
        let finders: Vec<FacetFinder> = edges.iter().map(|edge| FacetFinder::new(mesh, &[edge.face])).collect();
        let holder = |x: &[f64; 3]| {
            edges.iter().zip(&finders).enumerate().find_map(|(n, (edge, finder))| {
                let parameter = on_edge(mesh, *edge, finder.holding(mesh, *x)?.1)?;
                let FaceEdge { face, local, .. } = *edge;
                let name = u64::from(mesh.cell_number(face.cell)) << 16 | u64::from(face.local) << 8 | u64::from(local);
                Some((name, n, parameter))
            })
        };
        let (held, found) = of_one_rank(mesh, points.iter().map(holder).collect());
        let (mut groups, mut numbers) = (Vec::new(), Vec::new());
        for (n, held) in by_entity(&held) {
            let points: Vec<[f64; 3]> = held.iter().map(|h| h.1).collect();
            let rule = |kind| Rule { kind, degree: 0, weights: vec![1.0; points.len()], points: points.clone() };
            let made = Domain::new(mesh, &RegionSet::Edges(vec![edges[n]]), &rule)?.groups;
            groups.extend(made.into_iter().map(|group| Group { is_own: !mesh.is_whole(), ..group }));
            numbers.push(held.iter().map(|h| h.0).collect());
        }
        Ok(Self { domain: domain(mesh, Over::Edges, groups), points: numbers, found })
    }
}

/// How far beside an edge, in the parameters of its face, a point is still on it.
const ON_EDGE: f64 = 1e-6;

/// The parameter of a point of a face, by its parameters there, on an edge of it; `None` when it is not on it.
fn on_edge(mesh: &Mesh, edge: FaceEdge, of_face: [f64; 3]) -> Option<[f64; 3]> {
    let map = mesh.facet_kind(edge.face).facet_map(usize::from(edge.local));
    let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| a[i] * b[i]).sum::<f64>();
    let from_start: [f64; 3] = std::array::from_fn(|i| of_face[i] - map.origin[i]);
    let length = dot(map.tangents[0], map.tangents[0]);
    let t = if length > 0.0 { dot(map.tangents[0], from_start) / length } else { 0.0 };
    let beside = |i: usize| (from_start[i] - t * map.tangents[0][i]).abs();
    let near = (0..3).all(|i| beside(i) <= ON_EDGE) && (-ON_EDGE..=1.0 + ON_EDGE).contains(&t);
    near.then_some([t, 0.0, 0.0])
}

/// By place of an entity in its list the points that it holds, with their parameters.
fn by_entity(holders: &[Option<Holder>]) -> BTreeMap<usize, Vec<(usize, [f64; 3])>> {
    let mut found: BTreeMap<usize, Vec<(usize, [f64; 3])>> = BTreeMap::new();
    for (k, holder) in holders.iter().enumerate() {
        if let Some((_, place, parameters)) = holder {
            found.entry(*place).or_default().push((k, *parameters));
        }
    }
    found
}

fn domain(mesh: &Mesh, over: Over, groups: Vec<Group>) -> Arc<Domain> {
    Arc::new(Domain { over, dim: mesh.dim(), n_entities: groups.len(), groups, moving: None })
}

/// Points of one cell as a group.
fn cell_group(mesh: &Mesh, cell: CellId, points: Vec<[f64; 3]>) -> Group {
    let here = GroupSide { cells: vec![cell], ..GroupSide::new(mesh, mesh.kind(cell), points.clone()) };
    Group {
        key: [0; 5],
        // of the ranks that have the cell one was chosen for the point
        is_own: !mesh.holders().is_alone(),
        entities: vec![0],
        own: None,
        weights: vec![1.0; points.len()],
        parameters: points,
        tangents: None,
        edge: None,
        edge_there: None,
        areas: None,
        reference_normal: [0.0; 3],
        is_global: false,
        here,
        there: None,
        there_normal: None,
    }
}
