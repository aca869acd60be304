//! Where integrals are taken: the entities of a region in groups that share their reference points.
//!
//! A [`Domain`] is a region with a quadrature rule. Entities of one cell kind (and, on facets, one local facet and
//! one orientation towards the neighbour) have the same reference points, so basis tables are made once a group;
//! entities of a group are processed [`LANES`] at a time. Weights are those of the reference entity.

use std::collections::{BTreeMap, BTreeSet};

use wfl_compiler::{ir::LANES, types::EntityGeometry};

use crate::space::{Space, Support};
use wfl_mesh::{
    element::Table,
    mesh::{CellId, CellKind, FacetRef, Image, Mesh, MeshError, RegionSet, neighbour_points},
    quadrature::{Rule, facet_points},
};

/// The shapes of the entities of a region, each once, sorted: what the degree of their quadrature rule depends on.
#[must_use]
pub fn entity_geometries(mesh: &Mesh, region: &RegionSet) -> Vec<EntityGeometry> {
    let of_cell = |cell: CellId| EntityGeometry {
        tensor: !mesh.kind(cell).is_simplex(),
        dim: mesh.dim(),
        order: mesh.map_order(cell),
    };
    let of_facet = |facet: FacetRef| EntityGeometry {
        dim: mesh.dim() - 1,
        order: mesh.facet_map_order(facet),
        ..of_cell(facet.cell)
    };
    let shapes: BTreeSet<EntityGeometry> = match region {
        RegionSet::Cells(cells) => cells.iter().map(|c| of_cell(*c)).collect(),
        RegionSet::Facets(facets) => facets.iter().map(|f| of_facet(*f)).collect(),
        RegionSet::Interface(pairs) => pairs.iter().map(|p| of_facet(p.here)).collect(),
        RegionSet::Nodes(_) => BTreeSet::new(),
    };
    shapes.into_iter().collect()
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
    /// Basis of the geometry at its own nodes, with first derivatives: for the size of the cells.
    pub corners: Table,
}

/// Entities with the same reference points.
#[derive(Clone, Debug)]
pub struct Group {
    /// Positions of the entities in the region.
    pub entities: Vec<usize>,
    /// Weights of the rule on the reference entity.
    pub weights: Vec<f64>,
    /// Points of the rule in the parameters of the facet; the reference points on cells.
    pub parameters: Vec<[f64; 3]>,
    /// Derivatives of the reference point in the facet parameters; `None` on cells.
    pub tangents: Option<[[f64; 3]; 2]>,
    /// Outward normal of the reference facet.
    pub reference_normal: [f64; 3],
    /// Nothing is integrated: one point of weight 1, for terms on `global` and loads at nodes.
    pub is_global: bool,
    /// The owning side.
    pub here: GroupSide,
    /// The neighbour, on interfaces; the cell of the images of a mapping.
    pub there: Option<GroupSide>,
    /// Outward normal of the reference facet of the images of a mapping; `None` for a neighbour, whose normal is
    /// opposite, and for images without facets.
    pub there_normal: Option<[f64; 3]>,
}

impl Group {
    /// Number of batches of [`LANES`] entities.
    #[must_use]
    pub fn n_batches(&self) -> usize {
        self.entities.len().div_ceil(LANES)
    }

    /// Points of the rule.
    #[must_use]
    pub fn n_points(&self) -> usize {
        self.weights.len()
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
        let jacobian = mesh.jacobian_at(self.here.cells[k], &self.here.geometry, q);
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

/// A region with a quadrature rule.
#[derive(Clone, Debug)]
pub struct Domain {
    /// Space dimension.
    pub dim: usize,
    /// The groups.
    pub groups: Vec<Group>,
    /// Total number of entities.
    pub n_entities: usize,
}

type Key = (CellKind, usize, CellKind, usize, usize);

impl Domain {
    /// The domain of a region under a rule per entity kind (facet kinds on facets).
    ///
    /// # Errors
    /// [`MeshError`] when the two sides of an interface do not match.
    pub fn new(mesh: &Mesh, region: &RegionSet, rule: &dyn Fn(CellKind) -> Rule) -> Result<Self, MeshError> {
        let groups = match region {
            RegionSet::Cells(cells) => cell_groups(mesh, cells, rule),
            RegionSet::Facets(facets) => {
                let sides: Vec<(FacetRef, Option<FacetRef>)> = facets.iter().map(|f| (*f, None)).collect();
                facet_groups(mesh, &sides, rule)?
            }
            RegionSet::Interface(pairs) => {
                let sides: Vec<(FacetRef, Option<FacetRef>)> = pairs.iter().map(|p| (p.here, Some(p.there))).collect();
                facet_groups(mesh, &sides, rule)?
            }
            RegionSet::Nodes(_) => Vec::new(),
        };
        Ok(Self { dim: mesh.dim(), n_entities: region.len(), groups })
    }
}

impl Domain {
    /// One point of weight 1 that belongs to no entity, for terms on `global`.
    #[must_use]
    pub fn global(mesh: &Mesh) -> Self {
        let cell = CellId::new(0);
        let kind = mesh.kind(cell);
        let mut here = GroupSide::new(mesh, kind, vec![kind.reference_centre()]);
        here.cells.push(cell);
        let group = Group { entities: vec![0], ..one_point(here) };
        Self { dim: mesh.dim(), n_entities: 1, groups: vec![group] }
    }
}

impl Domain {
    /// A point of weight 1 at each of these nodes of a space on cells, in the first cell that holds it.
    #[must_use]
    pub fn at_nodes(mesh: &Mesh, space: &Space, nodes: &[u32]) -> Self {
        let Support::Cells(cells) = space.support() else {
            return Self { dim: mesh.dim(), groups: Vec::new(), n_entities: 0 };
        };
        let mut wanted: BTreeMap<u32, usize> = nodes.iter().enumerate().map(|(k, node)| (*node, k)).collect();
        let mut groups: BTreeMap<(CellKind, usize), Group> = BTreeMap::new();
        for (position, cell) in cells.iter().enumerate() {
            let kind = mesh.kind(*cell);
            for (local, node) in space.entity_nodes(position).iter().enumerate() {
                let Some(entity) = wanted.remove(node) else { continue };
                let group = groups.entry((kind, local)).or_insert_with(|| {
                    let point = space.element_at(position).points()[local];
                    one_point(GroupSide::new(mesh, kind, vec![point]))
                });
                group.entities.push(entity);
                group.here.cells.push(*cell);
            }
            if wanted.is_empty() {
                break;
            }
        }
        Self { dim: mesh.dim(), groups: groups.into_values().collect(), n_entities: nodes.len() }
    }
}

/// A group without entities whose only point has weight 1, independent of the cell.
fn one_point(here: GroupSide) -> Group {
    Group {
        entities: Vec::new(),
        weights: vec![1.0],
        parameters: vec![[0.0; 3]],
        tangents: None,
        reference_normal: [0.0; 3],
        is_global: true,
        here,
        there: None,
        there_normal: None,
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
                    let x = mesh.point_at(group.here.cells[k], &group.here.geometry, q);
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
        (Self { dim: base.dim, groups, n_entities: base.n_entities }, lost)
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
        entities: vec![group.entities[k]],
        weights: points.iter().map(|(q, _)| group.weights[*q]).collect(),
        parameters: pick(&group.parameters),
        tangents: group.tangents,
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
        Self { kind, cells: Vec::new(), facets: Vec::new(), points, geometry, corners }
    }

    /// True if the derivatives of the map are the same everywhere in a cell: simplices with straight edges.
    #[must_use]
    pub fn is_affine(&self) -> bool {
        self.kind.is_simplex() && self.geometry.n_dofs == self.kind.dim() + 1
    }
}

fn cell_groups(mesh: &Mesh, cells: &[CellId], rule: &dyn Fn(CellKind) -> Rule) -> Vec<Group> {
    let mut groups: BTreeMap<CellKind, Group> = BTreeMap::new();
    for (k, cell) in cells.iter().enumerate() {
        let kind = mesh.kind(*cell);
        let group = groups.entry(kind).or_insert_with(|| {
            let rule = rule(kind);
            Group {
                entities: Vec::new(),
                weights: rule.weights.clone(),
                parameters: rule.points.clone(),
                tangents: None,
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
    rule: &dyn Fn(CellKind) -> Rule,
) -> Result<Vec<Group>, MeshError> {
    let mut groups: BTreeMap<Key, Group> = BTreeMap::new();
    for (k, (here, there)) in sides.iter().enumerate() {
        let kind = mesh.kind(here.cell);
        let local = usize::from(here.local);
        let rule = rule(mesh.facet_kind(*here));
        let (key, opposite) = match there {
            None => ((kind, local, CellKind::Point, 0, 0), None),
            Some(there) => {
                let (orientation, points) = neighbour_points(mesh, *here, *there, &rule)?;
                let key = (kind, local, mesh.kind(there.cell), usize::from(there.local), usize::from(orientation));
                (key, Some((*there, points)))
            }
        };
        let group = groups.entry(key).or_insert_with(|| Group {
            entities: Vec::new(),
            weights: rule.weights.clone(),
            parameters: rule.points.clone(),
            tangents: Some(kind.facet_map(local).tangents),
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
