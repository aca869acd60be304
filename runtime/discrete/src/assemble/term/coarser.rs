//! A term with elements of degree 1 in place of those of its fields, on the same cells with the same rule.
//!
//! Its nodes are those of the finer elements at the vertices, its dofs theirs. Functions of degree 1 are sums of those of any
//! higher degree in the reference cell, so the tangent is exactly what interpolation makes of the finer one, on bent cells, too.

use std::sync::{Arc, Mutex};

use super::{AssembledTerm, contract::TangentPlan, local_dofs};
use crate::assemble::{Basis, Integrator, binding::GroupBinding};
use crate::domain::{Domain, Group};
use crate::field::{Field, FieldSpace};
use crate::space::Support;
use wfl_compiler::types::Side;
use wfl_mesh::{
    element::{Element, Family},
    mesh::Mesh,
};

impl AssembledTerm {
    /// Why there is no such term, in words; `None` if there is one.
    pub(crate) fn obstacle_to_coarser(&self, fields: &[Field], starts: &[Option<usize>]) -> Option<String> {
        if self.moving.is_some() {
            return Some(format!("images of the term `{}` follow the bodies", self.law.name));
        }
        let groups = self.assembled.domain.groups.iter().zip(&self.assembled.binding.groups);
        let mut bases = groups.flat_map(|(group, bound)| bound.bases.iter().map(move |basis| (group, basis)));
        bases.find_map(|(group, basis)| {
            let k = basis.field.index();
            starts[k].and_then(|_| of_degree_one(&fields[k], group, basis).err())
        })
    }

    /// The term with elements of degree 1. `starts` are the first dofs of the fields.
    ///
    /// # Errors
    /// Why a field has none, in words.
    pub(crate) fn coarser(&self, mesh: &Mesh, fields: &[Field], starts: &[Option<usize>]) -> Result<Self, String> {
        let (domain, binding) = (&self.assembled.domain, &self.assembled.binding);
        let mut groups = Vec::with_capacity(binding.groups.len());
        for (group, bound) in domain.groups.iter().zip(&binding.groups) {
            let mut bases = Vec::with_capacity(bound.bases.len());
            let mut offset = 0;
            for basis in &bound.bases {
                let mut made = match starts[basis.field.index()] {
                    Some(_) => of_degree_one(&fields[basis.field.index()], group, basis)?,
                    None => basis.clone(),
                };
                made.offset = offset;
                offset += made.n_dofs();
                bases.push(made);
            }
            groups.push(GroupBinding::new(mesh, group, bases));
        }
        let all = groups.iter().zip(&domain.groups);
        let dofs = all.map(|(bound, group)| local_dofs(bound, group.entities.len(), starts)).collect();
        Ok(self.with_functions(Arc::clone(domain), groups, dofs))
    }

    /// The same law on another domain, or with other functions and dofs there.
    pub(super) fn with_functions(&self, domain: Arc<Domain>, groups: Vec<GroupBinding>, dofs: Vec<Vec<u32>>) -> Self {
        let binding = Arc::new(self.assembled.binding.with_groups(groups));
        let plans = (0..binding.groups.len()).map(|g| Arc::new(TangentPlan::new(&binding, g, &self.entries))).collect();
        let assembled = Integrator { domain, binding };
        Self {
            integrator: assembled.clone(),
            assembled,
            dofs: Arc::new(dofs),
            plans: Arc::new(plans),
            scatters: Arc::default(),
            located: Arc::default(),
            kept: Default::default(),
            workspaces: Mutex::default(),
            ..self.clone()
        }
    }
}

/// A basis of degree 1 on the vertices of the cells of another one.
fn of_degree_one(field: &Field, group: &Group, basis: &Basis) -> Result<Basis, String> {
    let FieldSpace::Nodal(space) = &field.space else {
        return Err(format!("`{}` has no nodes", field.name));
    };
    if space.degree() == 1 {
        return Ok(basis.clone());
    }
    if !matches!(space.support(), Support::Cells(_)) || group.own.is_some() || !basis.counts.is_empty() {
        return Err(format!("`{}` lives on faces", field.name));
    }
    let side = if basis.side == Side::There { group.there.as_ref() } else { None }.unwrap_or(&group.here);
    let fine = space.element(side.kind).ok_or_else(|| format!("`{}` has no element", field.name))?;
    let first = Element::lagrange(side.kind, 1, Family::Continuous).map_err(|error| error.to_string())?;
    let at = |point: &[f64; 3]| fine.points().iter().position(|own| own == point);
    let vertices: Option<Vec<usize>> = first.points().iter().map(at).collect();
    let vertices = vertices.ok_or_else(|| format!("`{}` has elements without nodes at their vertices", field.name))?;
    let of_cell = |nodes: &[u32]| vertices.iter().map(|k| nodes[*k]).collect::<Vec<u32>>();
    let nodes = basis.nodes.chunks_exact(basis.n_nodes.max(1)).flat_map(of_cell).collect();
    Ok(Basis {
        n_nodes: vertices.len(),
        table: first.tabulate(&side.points, basis.order),
        nodes,
        support: Vec::new(),
        ..basis.clone()
    }
    .with_support())
}
