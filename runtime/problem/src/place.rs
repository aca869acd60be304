//! Where a scene is made: the mesh, its facets and its regions, of the whole scene or as a rank was sent them.

use std::{collections::BTreeMap, sync::Arc};

use wfl::{Diagnostic, Lost, ResolvedScript};
use wfl_compiler::{Constant, backend::KernelBackend};
use wfl_discrete::space::SpacePart;
use wfl_host::team::Team;
use wfl_mesh::mesh::{Mesh, Topology, map_nodes};

use super::{
    InputFile, Refined, Regions, Scene, With, constants, mesh, mesh_files,
    part::{PartOfUnknowns, ScenePart},
    refined::Made,
    regions,
};

/// What is found while a scene is made, also where it cannot be.
pub(super) struct Findings {
    pub(super) diagnostics: Vec<Diagnostic>,
    /// Names that were to be declared and are not known: what uses them is not to blame.
    pub(super) lost: Lost,
    /// The dimension of the space, once it is known.
    pub(super) dim: Option<usize>,
}

/// Where a scene is made: its mesh, with what is found on it before anything is compiled.
pub(super) struct Place {
    pub(super) mesh: Mesh,
    pub(super) refined: Option<Refined>,
    /// Where the nodes were before the map of the mesh; nothing without one that parameters change.
    pub(super) unmapped: Option<Vec<[f64; 3]>>,
    pub(super) topology: Topology,
    pub(super) regions: Regions,
    pub(super) inputs: Vec<InputFile>,
    pub(super) params: BTreeMap<String, Constant>,
}

/// A part of a scene on the team of its ranks.
pub(super) type OnTeam = (ScenePart, Arc<dyn Team>);

/// What the first rank says of fields and unknowns.
pub(super) struct Told {
    pub(super) spaces: Vec<Option<SpacePart>>,
    pub(super) unknowns: PartOfUnknowns,
}

/// The whole mesh of a script.
pub(super) fn whole(script: &ResolvedScript, with: With<'_>, found: &mut Findings) -> Option<Place> {
    let With { folder, backend, rounds, sampling, .. } = with;
    let mut inputs = Vec::new();
    let read = mesh_files::read(script, folder, &mut inputs, &mut found.diagnostics);
    let params = constants::parameters(script, mesh::dimension(script, read.as_deref()), &mut found.diagnostics);
    for param in script.params.iter().filter(|p| !params.contains_key(&p.name.name)) {
        found.lost.add(&param.name.name);
    }
    let made = mesh::MeshMaker {
        script,
        params: &params,
        backend,
        bodies: sampling.bodies,
        diagnostics: &mut found.diagnostics,
    };
    let Made { mesh, refined, unmapped } = made.make(read, rounds)?;
    found.dim = Some(mesh.dim());
    let topology = topology(script, &mesh, found)?;
    let smallest = refined.as_ref().map_or(f64::INFINITY, |r| r.smallest);
    let regions = regions_of(script, &mesh, &topology, &params, backend, smallest, found);
    Some(Place { mesh, refined, unmapped, topology, regions, inputs, params })
}

/// The part of a mesh that a rank was sent.
pub(super) fn part_of_mesh(script: &ResolvedScript, part: OnTeam, found: &mut Findings) -> Option<(Place, Told)> {
    let (part, team) = part;
    let ScenePart { mesh, regions, spaces, unknowns, inputs, .. } = part;
    let mesh = Mesh::of_part(team, mesh);
    let params = constants::parameters(script, mesh.dim(), &mut found.diagnostics);
    found.dim = Some(mesh.dim());
    let topology = topology(script, &mesh, found)?;
    let regions = ScenePart::regions(regions, script);
    let place = Place { mesh, refined: None, unmapped: None, topology, regions, inputs, params };
    Some((place, Told { spaces, unknowns }))
}

fn topology(script: &ResolvedScript, mesh: &Mesh, found: &mut Findings) -> Option<Topology> {
    match Topology::new(mesh) {
        Ok(topology) => Some(topology),
        Err(e) => {
            found.diagnostics.push(mesh::mesh_error(&e, script.mesh.as_ref()?.span));
            None
        }
    }
}

/// The regions; names of regions that cannot be made are lost.
fn regions_of(
    script: &ResolvedScript,
    mesh: &Mesh,
    topology: &Topology,
    params: &BTreeMap<String, Constant>,
    backend: &dyn KernelBackend,
    smallest: f64,
    found: &mut Findings,
) -> Regions {
    let (diagnostics, regions) = (&mut found.diagnostics, Regions::new());
    let maker = regions::RegionMaker {
        script,
        mesh,
        topology,
        params,
        backend,
        smallest,
        diagnostics,
        regions,
        counted: Default::default(),
    };
    let regions = maker.make();
    let named = script.regions.iter().map(|r| &r.name).chain(&script.groups);
    for name in named.filter(|n| !regions.contains_key(&n.name)) {
        found.lost.add(&name.name);
    }
    regions
}

/// The regions of a scene on its mesh with the nodes elsewhere and other values of parameters; those that are empty there are
/// missing. `None` where that is no mesh.
#[must_use]
pub fn displaced_regions(
    script: &ResolvedScript,
    scene: &Scene,
    backend: &dyn KernelBackend,
    params: &BTreeMap<String, Constant>,
    nodes: &[[f64; 3]],
) -> Option<Regions> {
    let mut next = nodes.iter();
    let place = |_| -> Result<[f64; 3], ()> { next.next().copied().ok_or(()) };
    let mesh = map_nodes(Mesh::clone(&scene.system.mesh), place).ok()?;
    let topology = Topology::new(&mesh).ok()?;
    let smallest = scene.refined.as_ref().map_or(f64::INFINITY, |r| r.smallest);
    let mut found = Findings { diagnostics: Vec::new(), lost: Lost::default(), dim: Some(mesh.dim()) };
    Some(regions_of(script, &mesh, &topology, params, backend, smallest, &mut found))
}
