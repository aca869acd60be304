//! A scene on ranks of which each has a part of the mesh alone.
//!
//! The first rank prepares the scene with the whole mesh, tells every message, and sends to each rank what follows from
//! the whole mesh: cells, regions, the nodes of fields, which unknowns are solved for ([`ScenePart`]). Each rank then
//! prepares the scene with its part. Promises: unknowns, equations and quadrature rules are those of the whole scene.
//! Does not solve; what runs on parts agrees by the team of the mesh.

use std::collections::{BTreeMap, BTreeSet};

use wfl::{ResolvedScript, ast::ExprKind};
use wfl_compiler::types::FieldKind;
use wfl_discrete::{
    assemble::AssembledTerm,
    field::FieldSpace,
    frames::Frame,
    rates::Rates,
    space::{SpacePart, Support},
    system::{FIXED, Tie},
};
use wfl_mesh::{
    element::Family,
    mesh::{
        CellId, CellKind, FaceEdge, FacetRef, FileNumbers, InterfaceFacet, MeshPart, NodeId, Part, PlacesInPart,
        RawMesh, RegionSet,
    },
};
use wfl_output::{
    Hash,
    bytes::{Reader, Unreadable, Writer},
};

use super::{InputFile, NamedRegion, Regions, Scene, auto::is_auto, constraints::facets_of_nodes};
use crate::Given;

/// What a rank prepares its part of a scene with.
#[derive(Debug, Default)]
pub struct ScenePart {
    pub(super) mesh: MeshPart,
    pub(super) regions: Vec<PartOfRegion>,
    /// By field; `None` for one that is not on nodes.
    pub(super) spaces: Vec<Option<SpacePart>>,
    pub(super) unknowns: PartOfUnknowns,
    /// Values of params that are `auto`.
    params: Vec<(String, f64)>,
    /// The files that were read for the mesh.
    pub(super) inputs: Vec<InputFile>,
}

/// A region in a part of the mesh.
#[derive(Debug)]
pub(super) struct PartOfRegion {
    name: String,
    set: RegionSet,
    edges: Option<Vec<FaceEdge>>,
    here_name: Option<String>,
    inside: bool,
}

/// Which unknowns of a part are solved for.
#[derive(Clone, Debug, Default)]
pub(super) struct PartOfUnknowns {
    /// By dof of the part its free number among those of the whole scene, or [`FIXED`].
    pub(super) free: Vec<u32>,
    pub(super) frames: Vec<Frame>,
    /// Those that follow others, by dof of the part.
    pub(super) ties: Vec<Tie>,
}

impl Scene {
    /// Why every rank must have the whole mesh; `None` where each can have a part of it.
    #[must_use]
    pub fn needs_whole_mesh(&self) -> Option<&'static str> {
        let system = &self.system;
        let of_bodies = |term: &AssembledTerm| term.on_cells() && self.acts_on_all(term);
        let rates = system.rates();
        let begins = |rates: &Rates| rates.are_read_at_start(self.steps.are_listed());
        let of_file = |(_, given): &(usize, Given)| !matches!(given, Given::Formula(..));
        let reasons = [
            (!self.env.mappings.is_empty(), "a mapping leads to any place of it"),
            (system.terms.iter().any(of_bodies), "the equation of a `global` unknown is an integral over bodies"),
            (self.explicit.is_some() || rates.is_some_and(begins), "the first rates follow from all equations"),
            (!self.prints.is_empty(), "terms print"),
            (self.data.iter().chain(&self.starts).any(of_file), "values at nodes come from a file"),
        ];
        reasons.into_iter().find(|(holds, _)| *holds).map(|(_, why)| why)
    }

    /// What a rank prepares its part with, as bytes. `part` says who owns the nodes of the mesh.
    #[must_use]
    pub fn part_of(&self, part: &Part, rank: usize) -> Vec<u8> {
        let mesh = &self.system.mesh;
        let coupled: Vec<(CellId, CellId)> = self.coupled_cells();
        let cells = self.with_leaders(part.cells_of(mesh, rank, &coupled, &self.cells_of_all()));
        let (mesh, places) = part.cut(mesh, &cells);
        let regions = self.regions.iter().map(|(name, region)| PartOfRegion {
            name: name.clone(),
            set: cut(&region.set, &places),
            edges: region.edges.as_ref().map(|edges| cut_edges(edges, &places)),
            here_name: region.here_name.clone(),
            inside: region.inside,
        });
        let space = |space: &FieldSpace| match space {
            FieldSpace::Nodal(space) => Some(space.cut(&places)),
            FieldSpace::Global | FieldSpace::Points(_) => None,
        };
        let spaces: Vec<Option<SpacePart>> = self.system.fields.iter().map(|f| space(&f.space)).collect();
        let unknowns = self.unknowns_of(&spaces);
        let params = self.params.iter().filter_map(|(name, value)| Some((name.clone(), *value.values.first()?)));
        let inputs = self.inputs.clone();
        ScenePart { mesh, regions: regions.collect(), spaces, unknowns, params: params.collect(), inputs }.to_bytes()
    }

    /// Whether a term acts on an unknown that is one for the whole scene.
    fn acts_on_all(&self, term: &AssembledTerm) -> bool {
        let system = &self.system;
        let is_global = |k: usize| matches!(system.fields[k].space, FieldSpace::Global) && system.range(k).is_some();
        term.law
            .tests
            .iter()
            .any(|slot| system.fields.get(slot.field.index()).is_some() && is_global(slot.field.index()))
    }

    /// The cells of all terms in the equations of unknowns that are one for the whole scene: the first rank has these.
    fn cells_of_all(&self) -> Vec<CellId> {
        let terms = self.system.terms.iter().filter(|term| self.acts_on_all(term));
        let groups = terms.flat_map(|term| &term.integrator.domain.groups);
        groups
            .flat_map(|group| group.here.cells.iter().chain(group.there.iter().flat_map(|there| &there.cells)))
            .copied()
            .collect()
    }

    /// Cells of which one enters the equations of the other across an interface, or along it from face to face.
    fn coupled_cells(&self) -> Vec<(CellId, CellId)> {
        let pairs = self.regions.values().filter_map(|region| match &region.set {
            RegionSet::Interface(pairs) => Some(pairs),
            _ => None,
        });
        let faces = pairs.flatten().map(|pair| (pair.here.cell, pair.there.cell));
        let edges = self.regions.values().flat_map(|region| region.edges.iter().flatten());
        let edges = edges.filter_map(|edge| Some((edge.face.cell, edge.across?.0.cell)));
        // the equations of a node that follows another one are added to those of that one
        let followed = self.followed();
        let ties = followed.iter().flat_map(|(follower, leader)| {
            self.cells_beside(*follower)
                .flat_map(|a| self.cells_beside(*leader).map(move |b| (a, b)))
                .collect::<Vec<_>>()
        });
        faces.chain(edges).chain(ties).collect()
    }

    /// The cells on both sides of a face.
    fn cells_beside(&self, face: FacetRef) -> impl Iterator<Item = CellId> + Clone {
        std::iter::once(face.cell).chain(self.topology.opposite(face).map(|other| other.cell))
    }

    /// The faces around nodes of multipliers that follow others, each with a face of the node that it follows.
    fn followed(&self) -> BTreeSet<(FacetRef, FacetRef)> {
        let numbering = &self.system.numbering;
        let mut faces: BTreeMap<usize, BTreeMap<u32, Vec<FacetRef>>> = BTreeMap::new();
        let mut found = BTreeSet::new();
        for tie in numbering.ties() {
            let [(field, follower, _), (_, leader, _)] =
                [tie.follower, tie.leader].map(|dof| numbering.describe(&self.system.fields, dof));
            let FieldSpace::Nodal(space) = &self.system.fields[field].space else { continue };
            let around = faces.entry(field).or_insert_with(|| facets_of_nodes(space));
            let [follower, leader] = [follower, leader].map(|node| around.get(&(node as u32)));
            let (Some(follower), Some(leader)) = (follower, leader.and_then(|faces| faces.first())) else { continue };
            found.extend(follower.iter().map(|face| (*face, *leader)));
        }
        found
    }

    /// Some cells, and those that they need beside them: whoever has a node that follows another one has that one.
    fn with_leaders(&self, cells: Vec<CellId>) -> Vec<CellId> {
        let followed = self.followed();
        if followed.is_empty() {
            return cells;
        }
        let mut all: BTreeSet<CellId> = cells.into_iter().collect();
        loop {
            let before = all.len();
            for (follower, leader) in &followed {
                if all.contains(&follower.cell) {
                    all.extend(self.cells_beside(*leader));
                }
            }
            if all.len() == before {
                return all.into_iter().collect();
            }
        }
    }

    fn unknowns_of(&self, spaces: &[Option<SpacePart>]) -> PartOfUnknowns {
        let numbering = &self.system.numbering;
        let mut made = PartOfUnknowns::default();
        let mut own_of: BTreeMap<usize, usize> = BTreeMap::new();
        for (k, field) in self.system.fields.iter().enumerate() {
            let Some(start) = numbering.starts[k] else { continue };
            // one that is not on nodes is one for the whole scene
            let mut nodes = spaces[k].as_ref().map_or_else(|| vec![0], |space| space.nodes.clone());
            nodes.sort_unstable();
            nodes.dedup();
            for node in nodes {
                let (first, own) = (start + node as usize * field.n_components, made.free.len());
                if let Some(frame) = numbering.frames.of(first) {
                    made.frames.push(Frame { first: own, axes: frame.axes.clone() });
                }
                made.free.extend_from_slice(&numbering.free[first..][..field.n_components]);
                if numbering.has_ties() && field.kind == FieldKind::Multiplier {
                    own_of.extend((0..field.n_components).map(|k| (first + k, own + k)));
                }
            }
        }
        let own = |tie: &Tie| Some(Tie { follower: *own_of.get(&tie.follower)?, leader: *own_of.get(&tie.leader)? });
        made.ties = numbering.ties().iter().filter_map(own).collect();
        made
    }

    /// Takes over from the scene with the whole mesh what was found there alone.
    pub fn take_over(&mut self, whole: FromWhole) {
        let FromWhole { idle, unused_fields, times, refined } = whole;
        (self.idle, self.unused_fields, self.refined) = (idle, unused_fields, refined);
        self.times.compile += times.compile;
        self.times.mesh += times.mesh;
    }

    /// What the scene of a part takes over.
    #[must_use]
    pub fn from_whole(self) -> FromWhole {
        let Self { idle, unused_fields, times, refined, .. } = self;
        FromWhole { idle, unused_fields, times, refined }
    }
}

/// What was found with the whole mesh alone.
pub struct FromWhole {
    idle: Vec<(String, String)>,
    unused_fields: Vec<String>,
    times: super::PrepareTimes,
    refined: Option<super::Refined>,
}

/// The members of a region that a part has.
fn cut(set: &RegionSet, places: &PlacesInPart) -> RegionSet {
    match set {
        RegionSet::Cells(cells) => RegionSet::Cells(cells.iter().filter_map(|cell| places.cell(*cell)).collect()),
        RegionSet::Facets(facets) => RegionSet::Facets(facets.iter().filter_map(|f| places.facet(*f)).collect()),
        RegionSet::Interface(pairs) => {
            let pair = |p: &InterfaceFacet| {
                Some(InterfaceFacet { here: places.facet(p.here)?, there: places.facet(p.there)? })
            };
            RegionSet::Interface(pairs.iter().filter_map(pair).collect())
        }
        RegionSet::Edges(edges) => RegionSet::Edges(cut_edges(edges, places)),
        RegionSet::Nodes(nodes) => RegionSet::Nodes(nodes.iter().filter_map(|node| places.node(*node)).collect()),
    }
}

fn cut_edges(edges: &[FaceEdge], places: &PlacesInPart) -> Vec<FaceEdge> {
    let cut = |edge: &FaceEdge| {
        let across = match edge.across {
            Some((face, local)) => Some((places.facet(face)?, local)),
            None => None,
        };
        Some(FaceEdge { face: places.facet(edge.face)?, across, ..*edge })
    };
    edges.iter().filter_map(cut).collect()
}

impl ScenePart {
    /// The regions by name.
    pub(super) fn regions(regions: Vec<PartOfRegion>, script: &ResolvedScript) -> Regions {
        let span = |name: &str| script.regions.iter().find(|r| r.name.name == name).map(|r| r.span);
        let named = |PartOfRegion { name, set, edges, here_name, inside }| {
            let span = span(&name);
            (name, NamedRegion { set, edges, span, here_name, inside })
        };
        regions.into_iter().map(named).collect()
    }

    /// The script with the values of params that the first rank has found.
    #[must_use]
    pub fn with_params(&self, script: &ResolvedScript) -> ResolvedScript {
        let mut given = script.clone();
        for param in given.params.iter_mut().filter(|param| is_auto(param)) {
            if let Some((_, value)) = self.params.iter().find(|(name, _)| *name == param.name.name) {
                param.value.kind = ExprKind::Number(*value);
                param.domain = None;
            }
        }
        given
    }

    fn to_bytes(&self) -> Vec<u8> {
        let mut w = Writer::default();
        let MeshPart { raw, cells, owner, place, bounds, n_nodes, n_cells } = &self.mesh;
        w.count(raw.dim);
        w.count(raw.order);
        w.numbers(raw.nodes.as_flattened());
        w.smalls(&raw.kinds.iter().map(|kind| kind.index() as u32).collect::<Vec<_>>());
        w.smalls(&raw.connectivity);
        w.list(&raw.numbers.cells, |w, n| w.word(*n));
        w.list(&raw.numbers.nodes, |w, n| w.word(*n));
        w.smalls(cells);
        w.smalls(&owner.iter().map(|rank| u32::from(*rank)).collect::<Vec<_>>());
        w.smalls(place);
        w.numbers(bounds.as_flattened());
        w.count(*n_nodes);
        w.smalls(n_cells);
        w.list(&self.regions, |w, region| {
            w.text(&region.name);
            set(w, &region.set);
            w.flag(region.edges.is_some());
            set(w, &RegionSet::Edges(region.edges.clone().unwrap_or_default()));
            w.flag(region.here_name.is_some());
            w.text(region.here_name.as_deref().unwrap_or_default());
            w.flag(region.inside);
        });
        w.list(&self.spaces, |w, space| {
            w.flag(space.is_some());
            space.iter().for_each(|space| of_space(w, space));
        });
        w.smalls(&self.unknowns.free);
        w.list(&self.unknowns.frames, |w, frame| {
            w.count(frame.first);
            w.list(&frame.axes, |w, axis| w.numbers(axis));
        });
        w.list(&self.unknowns.ties, |w, tie| {
            w.count(tie.follower);
            w.count(tie.leader);
        });
        w.list(&self.params, |w, (name, value)| {
            w.text(name);
            w.numbers(&[*value]);
        });
        w.list(&self.inputs, |w, input| {
            w.text(&input.name);
            w.text(&input.path.to_string_lossy());
            w.text(&input.hash.to_string());
        });
        w.bytes
    }

    /// What [`Scene::part_of`] wrote; `None` where it is something else.
    #[must_use]
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let mut r = Reader::new(bytes);
        let made = Self::read(&mut r).ok()?;
        r.end().ok().map(|()| made)
    }

    fn read(r: &mut Reader<'_>) -> Result<Self, Unreadable> {
        let mesh = read_mesh(r)?;
        let regions = r.list(|r| {
            let (name, set) = (r.text()?, read_set(r)?);
            let (has_edges, RegionSet::Edges(edges)) = (r.flag()?, read_set(r)?) else { return Err(Unreadable) };
            let edges = has_edges.then_some(edges);
            let (has_name, here) = (r.flag()?, r.text()?);
            Ok(PartOfRegion { name, set, edges, here_name: has_name.then_some(here), inside: r.flag()? })
        })?;
        let spaces = r.list(|r| if r.flag()? { read_space(r).map(Some) } else { Ok(None) })?;
        let free = r.smalls()?;
        let frames = r.list(|r| Ok(Frame { first: r.count()?, axes: r.list(Reader::numbers)? }))?;
        let ties = r.list(|r| Ok(Tie { follower: r.count()?, leader: r.count()? }))?;
        let params = r.list(|r| Ok((r.text()?, *r.numbers()?.first().ok_or(Unreadable)?)))?;
        let inputs = r.list(|r| {
            let (name, path) = (r.text()?, r.text()?.into());
            Ok(InputFile { name, path, hash: Hash::read(&r.text()?).ok_or(Unreadable)? })
        })?;
        Ok(Self { mesh, regions, spaces, unknowns: PartOfUnknowns { free, frames, ties }, params, inputs })
    }
}

impl PartOfUnknowns {
    /// The dofs that are not solved for.
    pub(super) fn fixed(&self) -> impl Iterator<Item = usize> + '_ {
        self.free.iter().enumerate().filter(|(_, free)| **free == FIXED).map(|(dof, _)| dof)
    }
}

fn read_mesh(r: &mut Reader<'_>) -> Result<MeshPart, Unreadable> {
    let (dim, order) = (r.count()?, r.count()?);
    let nodes = r.numbers()?.as_chunks().0.to_vec();
    let kind = |k: u32| CellKind::ALL.get(k as usize).copied().ok_or(Unreadable);
    let kinds = r.smalls()?.into_iter().map(kind).collect::<Result<_, _>>()?;
    let connectivity = r.smalls()?;
    let numbers = FileNumbers { cells: r.list(Reader::word)?, nodes: r.list(Reader::word)? };
    let cells = r.smalls()?;
    let rank = |rank: u32| u16::try_from(rank).map_err(|_| Unreadable);
    let owner = r.smalls()?.into_iter().map(rank).collect::<Result<_, _>>()?;
    let place = r.smalls()?;
    let bounds = r.numbers()?.as_chunks().0.try_into().map_err(|_| Unreadable)?;
    let (n_nodes, n_cells) = (r.count()?, r.smalls()?);
    let raw = RawMesh { dim, order, nodes, kinds, connectivity, groups: Vec::new(), numbers };
    Ok(MeshPart { raw, cells, owner, place, bounds, n_nodes, n_cells })
}

fn set(w: &mut Writer, set: &RegionSet) {
    let (kind, members): (usize, Vec<u32>) = match set {
        RegionSet::Cells(cells) => (0, cells.iter().map(|cell| cell.index() as u32).collect()),
        RegionSet::Facets(facets) => (1, facets.iter().flat_map(|f| words(*f)).collect()),
        RegionSet::Interface(pairs) => {
            (2, pairs.iter().flat_map(|p| [words(p.here), words(p.there)]).flatten().collect())
        }
        RegionSet::Edges(edges) => {
            let words = |e: &FaceEdge| {
                let there = e.across.map_or([u32::MAX; 3], |(face, local)| {
                    let [cell, facet] = words(face);
                    [cell, facet, u32::from(local)]
                });
                words(e.face).into_iter().chain([u32::from(e.local)]).chain(there)
            };
            (4, edges.iter().flat_map(words).collect())
        }
        RegionSet::Nodes(nodes) => (3, nodes.iter().map(|node| node.index() as u32).collect()),
    };
    w.count(kind);
    w.smalls(&members);
}

fn words(facet: FacetRef) -> [u32; 2] {
    [facet.cell.index() as u32, u32::from(facet.local)]
}

fn facet([cell, local]: [u32; 2]) -> FacetRef {
    FacetRef::new(CellId::new(cell as usize), local as usize)
}

fn read_set(r: &mut Reader<'_>) -> Result<RegionSet, Unreadable> {
    let (kind, members) = (r.count()?, r.smalls()?);
    Ok(match kind {
        0 => RegionSet::Cells(members.into_iter().map(|cell| CellId::new(cell as usize)).collect()),
        1 => RegionSet::Facets(members.as_chunks().0.iter().map(|words| facet(*words)).collect()),
        2 => {
            let pair = |[a, b, c, d]: &[u32; 4]| InterfaceFacet { here: facet([*a, *b]), there: facet([*c, *d]) };
            RegionSet::Interface(members.as_chunks().0.iter().map(pair).collect())
        }
        4 => {
            let small = |local: u32| u8::try_from(local).map_err(|_| Unreadable);
            let edge = |[cell, face, local, there @ ..]: &[u32; 6]| {
                let across = match *there {
                    [u32::MAX, ..] => None,
                    [cell, face, local] => Some((facet([cell, face]), small(local)?)),
                };
                Ok(FaceEdge { face: facet([*cell, *face]), local: small(*local)?, across })
            };
            RegionSet::Edges(members.as_chunks().0.iter().map(edge).collect::<Result<_, _>>()?)
        }
        3 => RegionSet::Nodes(members.into_iter().map(|node| NodeId::new(node as usize)).collect()),
        _ => return Err(Unreadable),
    })
}

fn of_space(w: &mut Writer, space: &SpacePart) {
    let SpacePart { support, degree, family, nodes, n_nodes, torn } = space;
    set(
        w,
        &match support {
            Support::Cells(cells) => RegionSet::Cells(cells.clone()),
            Support::Facets(facets) => RegionSet::Facets(facets.clone()),
            Support::Edges(edges) => RegionSet::Edges(edges.clone()),
        },
    );
    w.count(*degree);
    w.flag(*family == Family::Continuous);
    w.smalls(nodes);
    w.count(*n_nodes);
    set(w, &RegionSet::Facets(torn.clone()));
}

fn read_space(r: &mut Reader<'_>) -> Result<SpacePart, Unreadable> {
    let support = match read_set(r)? {
        RegionSet::Cells(cells) => Support::Cells(cells),
        RegionSet::Facets(facets) => Support::Facets(facets),
        RegionSet::Edges(edges) => Support::Edges(edges),
        _ => return Err(Unreadable),
    };
    let degree = r.count()?;
    let family = if r.flag()? { Family::Continuous } else { Family::Discontinuous };
    let (nodes, n_nodes) = (r.smalls()?, r.count()?);
    let RegionSet::Facets(torn) = read_set(r)? else { return Err(Unreadable) };
    Ok(SpacePart { support, degree, family, nodes, n_nodes, torn })
}
