//! Where integrals are taken: the entities of a region in groups that share their reference points.
//!
//! A [`Domain`] is a region with a quadrature rule. Entities of one cell kind (and, on facets, one local facet and
//! one orientation towards the neighbour) have the same reference points, so basis tables are made once a group;
//! entities of a group are processed [`LANES`] at a time. Weights are those of the reference entity.

mod boxes;
mod closest;
mod edges;
mod faces;
mod moving;
mod own;
mod pieces;
mod points;
mod rays;
mod segments;
mod shifts;

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

pub use edges::Edge;
pub use moving::{Follows, MovingPoints};
pub(crate) use own::table_of_each;
pub use own::{ImageMotion, OwnPoints};
pub use pieces::{Cut, NAME, PointName, nearest_points};
pub use rays::ImageSearch;
pub use shifts::ShiftCheck;
use wfl_compiler::{ir::LANES, types::EntityGeometry};

use crate::areas::{NodeAreas, cross};
use wfl_host::team::Team;
use wfl_mesh::{
    element::Table,
    mesh::{
        CellId, CellKind, FaceEdge, FacetMap, FacetRef, Image, Mesh, MeshError, Polynomials, RegionSet,
        neighbour_points,
    },
    quadrature::{Rule, facet_points},
};

/// The shapes of the entities of a region, each once, sorted: what the degree of their quadrature rule depends on. Of all
/// ranks, which look together, where each has a part of the mesh alone.
#[must_use]
pub fn entity_geometries(mesh: &Mesh, region: &RegionSet) -> Vec<EntityGeometry> {
    let of_cell = |cell: CellId| EntityGeometry {
        tensor: mesh.kind(cell).polynomials() != Polynomials::Total,
        dim: mesh.dim(),
        order: mesh.map_order(cell),
    };
    let of_facet = |facet: FacetRef| EntityGeometry {
        dim: mesh.dim() - 1,
        order: mesh.facet_map_order(facet),
        ..of_cell(facet.cell)
    };
    let of_edge = |edge: FaceEdge| EntityGeometry { dim: mesh.dim().saturating_sub(2), ..of_facet(edge.face) };
    let shapes: BTreeSet<EntityGeometry> = match region {
        RegionSet::Cells(cells) => cells.iter().map(|c| of_cell(*c)).collect(),
        RegionSet::Facets(facets) => facets.iter().map(|f| of_facet(*f)).collect(),
        RegionSet::Interface(pairs) => pairs.iter().map(|p| of_facet(p.here)).collect(),
        RegionSet::Edges(edges) => edges.iter().map(|e| of_edge(*e)).collect(),
        RegionSet::Nodes(_) => BTreeSet::new(),
    };
    shapes_of_all(shapes, mesh.holders())
}

/// The shapes that some rank has.
fn shapes_of_all(own: BTreeSet<EntityGeometry>, team: &dyn Team) -> Vec<EntityGeometry> {
    if team.is_alone() {
        return own.into_iter().collect();
    }
    // cells of dimension 3 at most, maps of order 2 at most
    let all = (0..2 * 4 * 4).map(|k| EntityGeometry { tensor: k / 16 == 1, dim: k / 4 % 4, order: k % 4 });
    let all: Vec<EntityGeometry> = all.collect();
    let mut is_there: Vec<u64> = all.iter().map(|shape| u64::from(own.contains(shape))).collect();
    team.max_words(&mut is_there);
    let mut shapes: Vec<EntityGeometry> =
        all.into_iter().zip(is_there).filter(|(_, is)| *is > 0).map(|s| s.0).collect();
    shapes.sort_unstable();
    shapes
}

/// One side of a group: cells with the same reference points.
#[derive(Clone, Debug)]
pub struct GroupSide {
    /// Kind of the cells.
    pub kind: CellKind,
    /// The cell of each entity.
    pub cells: Vec<CellId>,
    /// The facet of each entity; empty on cells.
    pub facets: Vec<FacetRef>,
    /// Reference points of the cell.
    pub points: Vec<[f64; 3]>,
    /// Basis of the geometry at the points, with first and second derivatives.
    pub geometry: Table,
    /// Basis of the geometry at its own nodes, with first derivatives: for the size of the cells; of edges at the nodes of
    /// their faces, for the size of these.
    pub corners: Table,
    /// By entity the row of the points and tables that is its own, where entities are points; else empty.
    pub rows: Arc<[u32]>,
}

/// Which entities have the same reference points: kind and local facet of both sides, and how they are turned against each
/// other, [`TURNS`] numbers for each rule. Groups of a domain are sorted by it.
type Key = (CellKind, usize, CellKind, usize, usize);
/// More than there are ways to turn a facet against another.
const TURNS: usize = 16;

/// Entities with the same reference points.
#[derive(Clone, Debug)]
pub struct Group {
    /// What they have in common, as numbers; groups without a common kind of entity have none.
    pub key: [u8; 5],
    /// Positions of the entities in the region.
    pub entities: Vec<usize>,
    /// No other rank has it: points that ranks with parts of the mesh have looked for together.
    pub is_own: bool,
    /// What each entity has of its own, where entities are single points.
    pub own: Option<OwnPoints>,
    /// Weights of the rule on the reference entity.
    pub weights: Vec<f64>,
    /// Points of the rule in the parameters of the facet; the reference points on cells.
    pub parameters: Vec<[f64; 3]>,
    /// Derivatives of the reference point in the facet parameters; `None` on cells.
    pub tangents: Option<[[f64; 3]; 2]>,
    /// Where the edges lie in their faces, of a group of edges.
    pub edge: Option<Edge>,
    /// The same in the faces across, of edges between two faces.
    pub edge_there: Option<Edge>,
    /// The area vectors of the points of a nodal rule on quadrilateral faces; elsewhere they are those of the map there.
    pub areas: Option<NodeAreas>,
    /// Outward normal of the reference facet.
    pub reference_normal: [f64; 3],
    /// Nothing is integrated: one point of weight 1, for terms on `global` and loads at nodes.
    pub is_global: bool,
    /// The owning side.
    pub here: GroupSide,
    /// The neighbour, on interfaces and edges between faces; the cell of the images of a mapping.
    pub there: Option<GroupSide>,
    /// Outward normal of the reference facet of the images of a mapping, of the face across an edge; `None` for a neighbour,
    /// whose normal is opposite, and for images without facets. Where entities are points, that of the first one.
    pub there_normal: Option<[f64; 3]>,
}

impl Group {
    /// Number of batches of [`LANES`] entities.
    #[must_use]
    pub fn n_batches(&self) -> usize {
        self.entities.len().div_ceil(LANES)
    }

    /// How the image of an entity shifts, where it is a point whose image follows the bodies.
    #[must_use]
    pub fn motion(&self, k: usize) -> Option<&ImageMotion> {
        self.own.as_ref().and_then(|own| own.motions.get(k))
    }

    /// True where an entity is a point whose image follows the bodies, and there is none.
    #[must_use]
    pub fn has_lost_its_image(&self, k: usize) -> bool {
        self.motion(k).is_some_and(|motion| motion.stand_in.is_some())
    }

    /// Points of each entity.
    #[must_use]
    pub fn n_points(&self) -> usize {
        if self.own.is_some() { 1 } else { self.weights.len() }
    }

    /// Position of point `q` of entity `k` in the reference placement (length).
    #[must_use]
    pub fn position(&self, mesh: &Mesh, k: usize, q: usize) -> [f64; 3] {
        self.here.position(mesh, k, q)
    }

    /// Whether this rank counts an entity of the group: sums over all ranks have each once.
    #[must_use]
    pub fn is_counted(&self, mesh: &Mesh, k: usize) -> bool {
        if self.is_global {
            return mesh.team().rank() == 0;
        }
        if self.is_own {
            return true;
        }
        match self.here.facets.get(k) {
            Some(facet) => mesh.counts_facet(*facet),
            None => mesh.counts_cell(self.here.cells[k]),
        }
    }

    /// What all ranks call an entity of the group: no other entity of the domain has this number. Where each has the whole
    /// mesh, that is its place in the domain.
    #[must_use]
    pub fn name(&self, mesh: &Mesh, k: usize) -> usize {
        if mesh.is_whole() {
            return self.entities[k];
        }
        let local = self.here.facets.get(k).map_or(u8::MAX, |facet| facet.local);
        // a cell has six facets at most, and these four edges
        let edge = self.edge.map_or(0, |edge| (edge.local + 1) << 4);
        (mesh.cell_number(self.here.cells[k]) as usize) << 8 | usize::from(local | edge)
    }

    /// The requested side.
    #[must_use]
    pub fn side(&self, side: wfl_compiler::types::Side) -> &GroupSide {
        match side {
            wfl_compiler::types::Side::Here => &self.here,
            wfl_compiler::types::Side::There => self.there.as_ref().expect("interface terms have two sides"),
        }
    }

    /// Outward unit normal at point `q` of entity `k` of a group on facets.
    #[must_use]
    pub fn unit_normal(&self, mesh: &Mesh, k: usize, q: usize) -> [f64; 3] {
        if let (Some(areas), Some(tangents)) = (&self.areas, self.tangents) {
            let mut area = nalgebra::Vector3::zeros();
            for (g, share) in areas.of_point(q).iter().enumerate() {
                let jacobian = mesh.jacobian_at(self.here.cells[k], &areas.geometry, g);
                let image = |t: [f64; 3]| jacobian.map(|row| row.iter().zip(t).map(|(a, b)| a * b).sum());
                area += nalgebra::Vector3::from(cross(tangents.map(image))) * *share;
            }
            return area.normalize().into();
        }
        self.normal_of_map(mesh, k, q)
    }

    /// That of the geometric map at the point itself.
    fn normal_of_map(&self, mesh: &Mesh, k: usize, q: usize) -> [f64; 3] {
        let jacobian = mesh.jacobian_at(self.here.cells[k], &self.here.geometry, self.here.row(k, q));
        let dim = mesh.dim();
        let m =
            nalgebra::Matrix3::from_fn(
                |r, c| {
                    if r < dim && c < dim { jacobian[r][c] } else { f64::from(u8::from(r == c)) }
                },
            );
        let reference = nalgebra::Vector3::from(self.reference_normal);
        m.try_inverse().map_or(reference, |inverse| inverse.transpose() * reference).normalize().into()
    }
}

/// What integrals of a domain are taken over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Over {
    /// Cells.
    Cells,
    /// Facets, with one side or two.
    Facets,
    /// Edges of facets.
    Edges,
    /// Single points, of weight 1.
    Points,
}

/// A region with a quadrature rule.
#[derive(Clone, Debug)]
pub struct Domain {
    /// What it consists of, also where a rank has no entity of it.
    pub over: Over,
    /// Space dimension.
    pub dim: usize,
    /// The groups.
    pub groups: Vec<Group>,
    /// Total number of entities.
    pub n_entities: usize,
    /// What finds the images of its points, where they follow the bodies: the groups are those at one state.
    pub moving: Option<Arc<MovingPoints>>,
}

/// Where the entities of a group stand among those of all ranks.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Places {
    /// Entities in the groups before, of all ranks.
    pub before: usize,
    /// Entities of the group on all ranks.
    pub n: usize,
    /// By entity of this rank: its position in the group; `None` where another rank counts it.
    pub of: Vec<Option<usize>>,
}

impl Domain {
    /// The group, the entity of it and the point of the rule that the `point`th point of this domain is, in the order of
    /// groups, entities and points.
    #[must_use]
    pub fn place(&self, mut point: usize) -> Option<(usize, usize, usize)> {
        for (g, group) in self.groups.iter().enumerate() {
            let n = group.entities.len() * group.n_points();
            if point < n {
                return Some((g, point / group.n_points(), point % group.n_points()));
            }
            point -= n;
        }
        None
    }

    /// Where the `point`th point of this domain is (length), zero if there is none.
    #[must_use]
    pub fn position(&self, mesh: &Mesh, point: usize) -> [f64; 3] {
        self.place(point).map_or([0.0; 3], |(g, k, q)| self.groups[g].position(mesh, k, q))
    }

    /// The domain of a region under a rule per entity kind (facet kinds on facets).
    ///
    /// # Errors
    /// [`MeshError`] when the two sides of an interface do not match.
    pub fn new(mesh: &Mesh, region: &RegionSet, rule: &dyn Fn(CellKind) -> Rule) -> Result<Self, MeshError> {
        Self::by_facet(mesh, region, rule, &|_| None)
    }

    /// The same with another rule on some facets: which one of up to 16 it is, and the rule.
    ///
    /// # Errors
    /// [`MeshError`] when the two sides of an interface do not match.
    pub fn by_facet(
        mesh: &Mesh,
        region: &RegionSet,
        rule: &dyn Fn(CellKind) -> Rule,
        own: &dyn Fn(FacetRef) -> Option<(usize, Rule)>,
    ) -> Result<Self, MeshError> {
        let rule_of = |facet| own(facet).map_or_else(|| (0, rule(mesh.facet_kind(facet))), |(k, rule)| (k + 1, rule));
        let (over, groups) = match region {
            RegionSet::Cells(cells) => (Over::Cells, cell_groups(mesh, cells, rule)),
            RegionSet::Facets(facets) => {
                let sides: Vec<(FacetRef, Option<FacetRef>)> = facets.iter().map(|f| (*f, None)).collect();
                (Over::Facets, facet_groups(mesh, &sides, &rule_of)?)
            }
            RegionSet::Interface(pairs) => {
                let sides: Vec<(FacetRef, Option<FacetRef>)> = pairs.iter().map(|p| (p.here, Some(p.there))).collect();
                (Over::Facets, facet_groups(mesh, &sides, &rule_of)?)
            }
            RegionSet::Edges(edges) => (Over::Edges, edges::groups(mesh, edges, rule)),
            RegionSet::Nodes(_) => (Over::Points, Vec::new()),
        };
        Ok(Self { over, dim: mesh.dim(), n_entities: region.len(), groups, moving: None })
    }

    /// By point, in the order of groups, entities and points, whether this rank counts it.
    #[must_use]
    pub fn counted_points(&self, mesh: &Mesh) -> Vec<bool> {
        let entities = self.groups.iter().flat_map(|g| (0..g.entities.len()).map(move |k| (g, k)));
        entities.flat_map(|(g, k)| std::iter::repeat_n(g.is_counted(mesh, k), g.n_points())).collect()
    }

    /// The number of entities on all ranks.
    #[must_use]
    pub fn n_of_all(&self, mesh: &Mesh) -> usize {
        if mesh.holders().is_alone() {
            return self.n_entities;
        }
        let own = self.groups.iter().map(|g| (0..g.entities.len()).filter(|k| g.is_counted(mesh, *k)).count()).sum();
        mesh.holders().count(own)
    }

    /// By group where its entities stand among those of all ranks, made by all of them together: on facets in the order in
    /// which one rank alone has them, on cells those of one rank behind those of the other.
    #[must_use]
    pub fn places(&self, mesh: &Mesh) -> Vec<Places> {
        let counted = |g: &Group| -> Vec<bool> { (0..g.entities.len()).map(|k| g.is_counted(mesh, k)).collect() };
        if mesh.holders().is_alone() {
            let mut before = 0;
            let place = |g: &Group| {
                let of = (0..).zip(counted(g)).map(|(k, counts)| counts.then_some(k)).collect();
                before += g.entities.len();
                Places { before: before - g.entities.len(), n: g.entities.len(), of }
            };
            return self.groups.iter().map(place).collect();
        }
        // what is gathered is small: facets, or a number for each group of cells
        let on_facets = matches!(self.over, Over::Facets | Over::Edges);
        let mut words: Vec<u64> = Vec::new();
        let key = |g: &Group| g.key.iter().fold(0, |word, byte| word << 8 | u64::from(*byte));
        for group in &self.groups {
            let cells = group.here.cells.iter().zip(counted(group)).filter(|(_, counts)| *counts);
            if on_facets {
                words.extend(cells.flat_map(|(cell, _)| [key(group), u64::from(mesh.cell_number(*cell))]));
            } else {
                words.extend([key(group), cells.count() as u64]);
            }
        }
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let size = |n: u64| usize::try_from(n).expect("a count of entities");
        let of_rank = |bytes: Vec<u8>| -> Vec<[u64; 2]> {
            let words: Vec<u64> = bytes.as_chunks().0.iter().map(|word| u64::from_le_bytes(*word)).collect();
            words.as_chunks().0.to_vec()
        };
        let ranks: Vec<Vec<[u64; 2]>> = mesh.team().gather(&bytes).into_iter().map(of_rank).collect();
        let mut all: Vec<[u64; 2]> = if on_facets { ranks.concat() } else { Vec::new() };
        all.sort_unstable();
        let counts = |ranks: &[Vec<[u64; 2]>], wanted: &dyn Fn(u64) -> bool| -> usize {
            let of = |pair: &&[u64; 2]| wanted(pair[0]);
            let each = |[_, n]: &[u64; 2]| if on_facets { 1 } else { size(*n) };
            ranks.iter().flatten().filter(of).map(each).sum()
        };
        let place = |group: &Group| {
            let own = key(group);
            let before = counts(&ranks, &|other| other < own);
            let on_ranks_before = counts(&ranks[..mesh.team().rank()], &|other| other == own);
            let first = all.partition_point(|pair| pair[0] < own);
            let mut next = on_ranks_before;
            let position = |(cell, counts): (&CellId, bool)| {
                counts.then(|| {
                    next += 1;
                    let found = all.binary_search(&[own, u64::from(mesh.cell_number(*cell))]);
                    if on_facets { found.expect("it was gathered") - first } else { next - 1 }
                })
            };
            let of = group.here.cells.iter().zip(counted(group)).map(position).collect();
            Places { before, n: counts(&ranks, &|other| other == own), of }
        };
        self.groups.iter().map(place).collect()
    }
}

/// A point of a rule and where its image is in the reference cell.
type ImagePoint = (usize, [f64; 3]);

impl Domain {
    /// A domain whose points have images: each group is one entity with the points whose images share a cell and a
    /// facet. Points without an image are left out; their number is returned. `find` is given the position of a
    /// point and, on facets, its outward unit normal.
    #[must_use]
    pub fn mapped(
        mesh: &Mesh,
        base: &Domain,
        mut find: impl FnMut([f64; 3], Option<[f64; 3]>) -> Option<Image>,
    ) -> (Self, usize) {
        let (mut groups, mut lost) = (Vec::new(), 0);
        for group in &base.groups {
            for k in 0..group.entities.len() {
                // points by image cell and facet, in the order of the first ones
                let mut parts: Vec<(Image, Vec<ImagePoint>)> = Vec::new();
                for q in 0..group.n_points() {
                    let x = group.position(mesh, k, q);
                    let normal = group.tangents.map(|_| group.unit_normal(mesh, k, q));
                    let Some(image) = find(x, normal) else {
                        lost += 1;
                        continue;
                    };
                    match parts.iter_mut().find(|(i, _)| i.cell == image.cell && i.facet == image.facet) {
                        Some((_, points)) => points.push((q, image.reference)),
                        None => parts.push((image, vec![(q, image.reference)])),
                    }
                }
                groups.extend(parts.into_iter().map(|(image, points)| part(mesh, group, k, image, &points)));
            }
        }
        (Self { over: base.over, dim: base.dim, groups, n_entities: base.n_entities, moving: None }, lost)
    }
}

/// Some points of one entity of a group, with their images in one cell.
fn part(mesh: &Mesh, group: &Group, k: usize, image: Image, points: &[ImagePoint]) -> Group {
    let pick = |all: &[[f64; 3]]| -> Vec<[f64; 3]> { points.iter().map(|(q, _)| all[*q]).collect() };
    let mut here = GroupSide::new(mesh, group.here.kind, pick(&group.here.points));
    here.cells.push(group.here.cells[k]);
    here.facets.extend(group.here.facets.get(k));
    let kind = mesh.kind(image.cell);
    let mut there = GroupSide::new(mesh, kind, points.iter().map(|(_, r)| *r).collect());
    there.cells.push(image.cell);
    there.facets.extend(image.facet);
    Group {
        key: group.key,
        is_own: group.is_own,
        entities: vec![group.entities[k]],
        own: None,
        weights: points.iter().map(|(q, _)| group.weights[*q]).collect(),
        parameters: pick(&group.parameters),
        tangents: group.tangents,
        edge: group.edge,
        edge_there: None,
        areas: None,
        reference_normal: group.reference_normal,
        is_global: group.is_global,
        here,
        there: Some(there),
        there_normal: image.facet.map(|f| kind.facet_normal(usize::from(f.local))),
    }
}

impl GroupSide {
    /// Cells of `kind` at these reference points; no cell yet.
    #[must_use]
    pub fn new(mesh: &Mesh, kind: CellKind, points: Vec<[f64; 3]>) -> Self {
        let element = mesh.geometry_element(kind);
        let geometry = element.tabulate(&points, 2);
        let corners = element.tabulate(element.points(), 1);
        Self { kind, cells: Vec::new(), facets: Vec::new(), points, geometry, corners, rows: Arc::default() }
    }

    /// The row of the points and tables that point `q` of entity `k` has.
    #[must_use]
    pub fn row(&self, k: usize, q: usize) -> usize {
        self.rows.get(k).map_or(q, |row| *row as usize)
    }

    /// Position of point `q` of entity `k` in the reference placement (length).
    #[must_use]
    pub fn position(&self, mesh: &Mesh, k: usize, q: usize) -> [f64; 3] {
        mesh.point_at(self.cells[k], &self.geometry, self.row(k, q))
    }

    /// The map of the local facet that all facets of the side are; that of the first one for a side of cells.
    #[must_use]
    pub fn facet_map(&self) -> FacetMap {
        self.kind.facet_map(self.facets.first().map_or(0, |facet| usize::from(facet.local)))
    }

    /// True if the derivatives of the map are the same everywhere in a cell: simplices with straight edges.
    #[must_use]
    pub fn is_affine(&self) -> bool {
        self.kind.straight_is_affine() && self.geometry.n_dofs == self.kind.n_vertices()
    }
}

fn numbers(key: Key) -> [u8; 5] {
    let (here, facet, there, opposite, orientation) = key;
    let small = |n: usize| u8::try_from(n).expect("kinds, facets and orientations are few");
    [here.index(), facet, there.index(), opposite, orientation].map(small)
}

fn cell_groups(mesh: &Mesh, cells: &[CellId], rule: &dyn Fn(CellKind) -> Rule) -> Vec<Group> {
    let mut groups: BTreeMap<CellKind, Group> = BTreeMap::new();
    for (k, cell) in cells.iter().enumerate() {
        let kind = mesh.kind(*cell);
        let group = groups.entry(kind).or_insert_with(|| {
            let rule = rule(kind);
            Group {
                key: numbers((kind, 0, CellKind::Point, 0, 0)),
                is_own: false,
                entities: Vec::new(),
                own: None,
                weights: rule.weights.clone(),
                parameters: rule.points.clone(),
                tangents: None,
                edge: None,
                edge_there: None,
                areas: None,
                reference_normal: [0.0; 3],
                is_global: false,
                here: GroupSide::new(mesh, kind, rule.points),
                there: None,
                there_normal: None,
            }
        });
        group.entities.push(k);
        group.here.cells.push(*cell);
    }
    groups.into_values().collect()
}

fn facet_groups(
    mesh: &Mesh,
    sides: &[(FacetRef, Option<FacetRef>)],
    rule: &dyn Fn(FacetRef) -> (usize, Rule),
) -> Result<Vec<Group>, MeshError> {
    let mut groups: BTreeMap<Key, Group> = BTreeMap::new();
    for (k, (here, there)) in sides.iter().enumerate() {
        let kind = mesh.kind(here.cell);
        let local = usize::from(here.local);
        let (which, rule) = rule(*here);
        let (key, opposite) = match there {
            None => ((kind, local, CellKind::Point, 0, which * TURNS), None),
            Some(there) => {
                let (orientation, points) = neighbour_points(mesh, *here, *there, &rule)?;
                let turned = usize::from(orientation) + which * TURNS;
                let key = (kind, local, mesh.kind(there.cell), usize::from(there.local), turned);
                (key, Some((*there, points)))
            }
        };
        let group = groups.entry(key).or_insert_with(|| Group {
            key: numbers(key),
            is_own: false,
            entities: Vec::new(),
            own: None,
            weights: rule.weights.clone(),
            parameters: rule.points.clone(),
            tangents: Some(kind.facet_map(local).tangents),
            edge: None,
            edge_there: None,
            areas: NodeAreas::new(mesh, kind, local, &rule),
            reference_normal: kind.facet_normal(local),
            is_global: false,
            here: GroupSide::new(mesh, kind, facet_points(kind, local, &rule)),
            there: opposite.as_ref().map(|(there, points)| GroupSide::new(mesh, mesh.kind(there.cell), points.clone())),
            there_normal: None,
        });
        group.entities.push(k);
        group.here.cells.push(here.cell);
        group.here.facets.push(*here);
        if let (Some(side), Some((there, _))) = (&mut group.there, opposite) {
            side.cells.push(there.cell);
            side.facets.push(there);
        }
    }
    Ok(groups.into_values().collect())
}
