//! The unknowns node by node, for solvers that go from fine to coarse.
//!
//! Promises: plain numbers that follow from fields and numbering alone. Does not assemble and does not solve.

use wfl_compiler::types::FieldKind;
use wfl_mesh::element::{Element, Family};
use wfl_sparse::index::NONE;
use wfl_sparse::solve::{Interpolation, NearNullSpace, NodeLayout};

use super::{FIXED, System};
use crate::field::FieldSpace;
use crate::space::Space;

impl System {
    /// What multigrid must know of the rows of [`Self::bulk`].
    ///
    /// # Errors
    /// Why there is no multigrid for these unknowns: a subject and a reason in words.
    pub fn node_layout(&self) -> Result<NodeLayout, String> {
        let multiplier = self
            .fields
            .iter()
            .zip(&self.numbering.starts)
            .find(|(field, start)| field.kind == FieldKind::Multiplier && start.is_some());
        if let Some((field, _)) = multiplier {
            return Err(format!("`{}` is a multiplier: the matrix is not positive definite", field.name));
        }
        let nodes = self.nodes()?;
        let interpolation = nodes.interpolation(self, &self.solved_fields())?;
        Ok(NodeLayout { interpolation, ..nodes.layout(self.mesh.dim()) })
    }

    fn solved_fields(&self) -> Vec<usize> {
        (0..self.fields.len()).filter(|k| self.numbering.starts[*k].is_some()).collect()
    }

    /// The same of a matrix that need not be positive definite: nodes of multipliers come behind the others as their
    /// fields do, with as many components; no elements of degree 1 below those of degree 2. Beside it the rows of the
    /// multipliers, increasing. One that follows another has no row of its own.
    ///
    /// # Errors
    /// Why there is no such layout.
    pub fn node_layout_with_multipliers(&self) -> Result<(NodeLayout, Vec<u32>), String> {
        let nodes = self.nodes()?;
        let is_multiplier = |dof: u32| self.fields[self.field_of(dof as usize)].kind == FieldKind::Multiplier;
        let rows = (0..).zip(&self.numbering.free_dofs).filter(|(_, dof)| is_multiplier(**dof)).map(|(row, _)| row);
        Ok((nodes.layout(self.mesh.dim()), rows.collect()))
    }

    /// The same of a motion beside a pressure: rows of other fields than those with a component for each direction have no place.
    ///
    /// # Errors
    /// Why there is no such layout.
    pub fn node_layout_of_motion(&self) -> Result<NodeLayout, String> {
        let solved = (0..self.fields.len()).filter(|k| self.range(*k).is_some());
        let (motion, others): (Vec<usize>, Vec<usize>) = solved.partition(|k| self.fields[*k].n_components > 1);
        if motion.is_empty() || others.is_empty() {
            return Err("there is no motion with a scalar field beside it".to_owned());
        }
        if let Some(other) = others.iter().find(|k| self.fields[**k].kind != FieldKind::Unknown) {
            return Err(format!("`{}` is a multiplier", self.fields[*other].name));
        }
        if let Some(other) = others.iter().find(|k| matches!(self.fields[**k].space, FieldSpace::Global)) {
            return Err(format!("`{}` is one value for the whole scene", self.fields[*other].name));
        }
        let mut nodes = Nodes { components: self.components_of_nodes_in(&motion)?, ..Nodes::default() };
        for k in 0..self.fields.len() {
            let (Some(start), Some(range)) = (self.numbering.starts[k], self.range(k)) else { continue };
            match &self.fields[k].space {
                FieldSpace::Nodal(space) if motion.contains(&k) => nodes.add(self, start, nodes.components, space),
                _ => nodes.places.extend(range.filter(|dof| self.numbering.free[*dof] != FIXED).map(|_| NONE)),
            }
        }
        let interpolation = nodes.interpolation(self, &motion)?;
        Ok(NodeLayout { interpolation, ..nodes.layout(self.mesh.dim()) })
    }

    fn nodes(&self) -> Result<Nodes, String> {
        let mut nodes = Nodes { components: self.components_of_nodes()?, ..Nodes::default() };
        for (field, start) in self.fields.iter().zip(&self.numbering.starts) {
            if let (Some(start), FieldSpace::Nodal(space)) = (*start, &field.space) {
                nodes.add(self, start, field.n_components, space);
            }
        }
        Ok(nodes)
    }

    /// Components of a node, alike in all unknown fields; those of multipliers may be fewer.
    fn components_of_nodes(&self) -> Result<usize, String> {
        self.components_of_nodes_in(&self.solved_fields())
    }

    /// The same of some fields.
    fn components_of_nodes_in(&self, solved: &[usize]) -> Result<usize, String> {
        let is_multiplier = |k: &usize| self.fields[*k].kind == FieldKind::Multiplier;
        let unknown: Vec<usize> = solved.iter().copied().filter(|k| !is_multiplier(k)).collect();
        let name = |k: usize| &self.fields[k].name;
        for k in &unknown {
            let field = &self.fields[*k];
            if !matches!(&field.space, FieldSpace::Nodal(space) if space.degree() > 0) {
                return Err(format!("`{}` has no nodes that neighbouring cells share", field.name));
            }
            if field.n_components > 3 {
                return Err(format!("`{}` has more than three components", field.name));
            }
        }
        let Some(first) = unknown.first() else { return Err("no field is solved for".to_owned()) };
        let components = self.fields[*first].n_components;
        if let Some(other) = unknown.iter().find(|k| self.fields[**k].n_components != components) {
            return Err(format!("`{}` and `{}` differ in their number of components", name(*first), name(*other)));
        }
        let fits = |k: &usize| {
            let field = &self.fields[*k];
            matches!(field.space, FieldSpace::Nodal(_)) && field.n_components <= components
        };
        if let Some(other) = solved.iter().find(|k| is_multiplier(k) && !fits(k)) {
            return Err(format!(
                "the multiplier `{}` has no nodes with the components of `{}`",
                name(*other),
                name(*first)
            ));
        }
        Ok(components)
    }
}

/// The nodes with something to solve for, field after field.
#[derive(Default)]
struct Nodes {
    components: usize,
    places: Vec<u32>,
    points: Vec<[f64; 3]>,
    frames: Vec<(u32, Vec<Vec<f64>>)>,
    /// By field that has nodes: the number of each of its nodes, or [`NONE`].
    numbers: Vec<Vec<u32>>,
}

impl Nodes {
    /// Numbers the nodes of a field with so many components whose dofs begin at `start`.
    fn add(&mut self, system: &System, start: usize, components: usize, space: &Space) {
        let free = &system.numbering.free;
        let mut numbers = vec![NONE; space.n_nodes()];
        for (node, number) in numbers.iter_mut().enumerate() {
            let first = start + node * components;
            let own = self.points.len();
            let solved = (0..components).filter(|c| free[first + c] != FIXED);
            // free numbers increase with dofs, so rows come in the order of places
            self.places.extend(solved.map(|c| u32::try_from(own * self.components + c).expect("fewer than 2^32 dofs")));
            if (0..components).all(|c| free[first + c] == FIXED) {
                continue;
            }
            *number = u32::try_from(own).expect("fewer than 2^32 nodes");
            self.points.push(space.node_coordinates()[node]);
            if let Some(frame) = system.numbering.frames.of(first) {
                self.frames.push((*number, frame.axes.clone()));
            }
        }
        self.numbers.push(numbers);
    }

    /// Without elements of degree 1 below.
    fn layout(&self, dimension: usize) -> NodeLayout {
        let is_of_bodies = self.components == dimension && self.components > 1;
        NodeLayout {
            components: self.components,
            places: self.places.clone(),
            points: self.points.clone(),
            modes: if is_of_bodies { NearNullSpace::RigidBody } else { NearNullSpace::Constants },
            frames: self.frames.clone(),
            interpolation: None,
        }
    }

    /// Values at all nodes from those at the vertices of cells; `None` where all nodes are vertices.
    fn interpolation(&self, system: &System, solved: &[usize]) -> Result<Option<Interpolation>, String> {
        let spaces = solved.iter().filter_map(|k| match &system.fields[*k].space {
            FieldSpace::Nodal(space) => Some(&**space),
            _ => None,
        });
        let spaces: Vec<&Space> = spaces.collect();
        if spaces.iter().all(|space| space.degree() == 1) {
            return Ok(None);
        }
        let mut lists: Vec<Vec<(u32, f64)>> = vec![Vec::new(); self.points.len()];
        for (space, numbers) in spaces.iter().zip(&self.numbers) {
            add_lists(space, numbers, &mut lists)?;
        }
        let (mut starts, mut weights) = (vec![0], Vec::new());
        for list in lists {
            weights.extend(list);
            starts.push(weights.len());
        }
        Ok(Some(Interpolation { starts, weights }))
    }
}

/// The value of each node from the vertices of a cell that has it; vertices that are not solved for are left out.
fn add_lists(space: &Space, numbers: &[u32], lists: &mut [Vec<(u32, f64)>]) -> Result<(), String> {
    let mut known: Vec<Option<(Vec<usize>, Vec<f64>)>> = Vec::new();
    for position in 0..space.n_positions() {
        let element = space.element_at(position);
        let kind = element.kind();
        if known.len() <= kind.index() {
            known.resize(kind.index() + 1, None);
        }
        if known[kind.index()].is_none() {
            let first = Element::lagrange(kind, 1, Family::Continuous).map_err(|error| error.to_string())?;
            // by vertex of the element of degree 1 in its own order, the node of the given one at the same point
            let at = |point: &[f64; 3]| element.points().iter().position(|own| own == point);
            let vertices: Option<Vec<usize>> = first.points().iter().map(at).collect();
            let vertices = vertices.ok_or("elements without nodes at their vertices")?;
            known[kind.index()] = Some((vertices, first.tabulate(element.points(), 0).values));
        }
        let Some((vertices, values)) = &known[kind.index()] else { continue };
        let nodes = space.entity_nodes(position);
        for (node, weights) in nodes.iter().zip(values.chunks_exact(vertices.len())) {
            let number = numbers[*node as usize];
            if number == NONE || !lists[number as usize].is_empty() {
                continue;
            }
            let parents =
                vertices.iter().zip(weights).map(|(vertex, weight)| (numbers[nodes[*vertex] as usize], *weight));
            lists[number as usize].extend(parents.filter(|(parent, weight)| *parent != NONE && *weight != 0.0));
        }
    }
    Ok(())
}
