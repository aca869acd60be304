//! Which rank has the row of each dof, and the copies of the others.
//!
//! A dof has the owner of the mesh entity that it belongs to: every component of a node has one rank. A dof that follows
//! another one goes with it. The owner of a row computes all of it, entities next to its own included, so every row has
//! the bits that one rank alone gives it.
//!
//! Vectors are of two kinds. Those of states (unknowns, corrections, rates) have a number at every dof, that of its owner:
//! [`Share::update`] sees to that. Those of equations (residuals, sizes, forces) have the rows of this rank and are zero
//! elsewhere, so that a sum over all dofs is one over the rows of this rank.
//!
//! Promises: a function of the scene and the number of ranks alone. Does not assemble.

use std::{collections::BTreeMap, sync::Arc};

use wfl_host::{halo::Halo, team::Team};
use wfl_mesh::{
    element::{DofEntity, Element},
    mesh::{Mesh, Part},
};

use crate::{
    field::{Field, FieldSpace},
    space::{Space, Support},
    system::Numbering,
};

/// See the module documentation.
#[derive(Clone, Debug)]
pub struct Share {
    team: Arc<dyn Team>,
    /// Number of this rank.
    own: u16,
    /// By dof.
    owner: Vec<u16>,
    halo: Halo,
}

impl Share {
    /// Shares out the dofs of the fields that are solved for, on a mesh whose nodes are shared out. Made by all ranks
    /// together.
    ///
    /// # Panics
    /// With more than 65,535 ranks.
    #[must_use]
    pub fn new(mesh: &Mesh, part: &Part, fields: &[Field], numbering: &Numbering) -> Self {
        let team = Arc::clone(part.team());
        let mut owner = vec![0; numbering.n_dofs];
        for (field, start) in fields.iter().zip(&numbering.starts) {
            let Some(start) = *start else { continue };
            let dofs = owner[start..][..field.n_dofs()].chunks_mut(field.n_components.max(1));
            dofs.zip(owners_of_nodes(field, mesh, part)).for_each(|(dofs, rank)| dofs.fill(rank));
        }
        numbering.ties().iter().for_each(|tie| owner[tie.follower] = owner[tie.leader]);
        let own = u16::try_from(team.rank()).expect("fewer than 2^16 ranks");
        let halo = if mesh.holders().is_alone() {
            Halo::of_all(&*team, &owner)
        } else {
            halo_of_parts(&*team, own, &owner, &NumbersOfWhole::new(fields, numbering))
        };
        Self { team, own, owner, halo }
    }

    /// The ranks.
    #[must_use]
    pub fn team(&self) -> &Arc<dyn Team> {
        &self.team
    }

    /// The rank that has the row of a dof.
    #[inline]
    #[must_use]
    pub fn owner(&self, dof: usize) -> usize {
        usize::from(self.owner[dof])
    }

    /// Whether this rank has the row of a dof.
    #[inline]
    #[must_use]
    pub fn owns(&self, dof: usize) -> bool {
        self.owner[dof] == self.own
    }

    /// Which dofs are copies, and of whom.
    #[must_use]
    pub fn halo(&self) -> &Halo {
        &self.halo
    }

    /// Gives copies the numbers of their owners: makes a vector of states of one that is right where this rank has the rows.
    pub fn update(&self, values: &mut [f64]) {
        assert_eq!(values.len(), self.owner.len(), "a number for each dof");
        self.halo.update(&*self.team, values);
    }
}

/// What all ranks call the dofs of the fields that are solved for.
pub(crate) struct NumbersOfWhole<'a> {
    fields: &'a [Field],
    numbering: &'a Numbering,
    /// By field that is solved for its first dof among those of all ranks.
    starts: Vec<Option<usize>>,
}

impl<'a> NumbersOfWhole<'a> {
    pub(crate) fn new(fields: &'a [Field], numbering: &'a Numbering) -> Self {
        let mut next = 0;
        let mut start = |field: &Field| {
            let first = next;
            next += field.n_nodes_of_whole() * field.n_components;
            first
        };
        let solved = fields.iter().zip(&numbering.starts);
        let starts = solved.map(|(field, is_solved)| is_solved.map(|_| start(field))).collect();
        Self { fields, numbering, starts }
    }

    /// The number of a dof.
    pub(crate) fn of(&self, dof: usize) -> usize {
        let (field, node, component) = self.numbering.describe(self.fields, dof);
        let f = &self.fields[field];
        self.starts[field].unwrap_or(0) + f.node_number(node) * f.n_components + component
    }

    /// The dof with a number, where this rank has it.
    pub(crate) fn dof(&self, number: usize) -> Option<usize> {
        let is_behind = |start: &Option<usize>| start.is_some_and(|start| start <= number);
        let field = self.starts.iter().rposition(is_behind)?;
        let (f, behind) = (&self.fields[field], number - self.starts[field]?);
        let node = f.numbered_node(behind / f.n_components)?;
        Some(self.numbering.starts[field]? + node * f.n_components + behind % f.n_components)
    }
}

/// The halo of ranks that have parts of the mesh: each asks the owners of its copies for them.
fn halo_of_parts(team: &dyn Team, own: u16, owner: &[u16], numbers: &NumbersOfWhole<'_>) -> Halo {
    let copies = owner.iter().enumerate().filter(|(_, rank)| **rank != own);
    let question = |(dof, rank): (usize, &u16)| (dof as u32, usize::from(*rank), vec![numbers.of(dof) as u64]);
    let find = |words: &[u64]| numbers.dof(usize::try_from(words[0]).ok()?).map(|dof| dof as u32);
    Halo::found(team, 1, copies.map(question), find)
}

/// By node of a field the rank that owns it.
fn owners_of_nodes(field: &Field, mesh: &Mesh, part: &Part) -> Vec<u16> {
    match &field.space {
        FieldSpace::Nodal(space) => owners_of_space(space, mesh, part),
        // one value for the whole scene
        FieldSpace::Global => vec![0],
        FieldSpace::Points(_) => vec![0; field.n_nodes()],
    }
}

/// By node of a space the rank that owns it.
#[must_use]
pub fn owners_of_space(space: &Space, mesh: &Mesh, part: &Part) -> Vec<u16> {
    let mut owners = vec![0; space.n_nodes()];
    let mut known: BTreeMap<usize, Vec<Vec<usize>>> = BTreeMap::new();
    let mut around = Vec::new();
    for position in 0..space.n_positions() {
        let element = space.element_at(position);
        let corners = known.entry(element.kind().index()).or_insert_with(|| corners(element));
        let (of_facet, of_edge);
        let vertices = match space.support() {
            Support::Cells(cells) => mesh.cell_vertices(cells[position]),
            Support::Facets(facets) => {
                of_facet = mesh.facet_vertices(facets[position]);
                of_facet.vertices()
            }
            Support::Edges(edges) => {
                of_edge = mesh.edge_ends(edges[position]);
                &of_edge
            }
        };
        for (node, corners) in space.entity_nodes(position).iter().zip(corners) {
            around.clear();
            around.extend(corners.iter().map(|k| vertices[*k]));
            owners[*node as usize] = part.owner(&around);
        }
    }
    owners
}

/// By node of an element the local vertices of the entity that it belongs to.
fn corners(element: &Element) -> Vec<Vec<usize>> {
    let kind = element.kind();
    let of = |entity: &DofEntity| match *entity {
        DofEntity::Vertex(vertex) => vec![vertex],
        DofEntity::Edge { edge, .. } => kind.edges()[edge].to_vec(),
        DofEntity::Facet { facet, .. } => kind.facets()[facet].vertices.to_vec(),
        DofEntity::Interior(_) => (0..kind.n_vertices()).collect(),
    };
    element.entities().iter().map(of).collect()
}
