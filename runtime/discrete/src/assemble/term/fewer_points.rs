//! A term whose entries are means over each cell, on no more points than products of its functions need.
//!
//! Rules are made for laws that change from point to point. Where the map of a cell is affine and the entries of the law are the same
//! at all its points, a rule for products of two functions gives the same integrals.

use std::sync::Arc;

use super::AssembledTerm;
use crate::assemble::{Basis, binding::GroupBinding};
use crate::domain::Group;
use crate::field::{Field, FieldSpace};
use wfl_mesh::{mesh::Mesh, quadrature};

impl AssembledTerm {
    /// The term on fewer points; `None` where it has no more than it needs. `fields` are those of the scene.
    pub(crate) fn on_fewer_points(&self, mesh: &Mesh, fields: &[Field]) -> Option<Self> {
        let (domain, binding) = (&self.assembled.domain, &self.assembled.binding);
        let mut is_other = false;
        let (mut groups, mut bound) = (Vec::new(), Vec::new());
        for (g, group) in domain.groups.iter().enumerate() {
            let own = &binding.groups[g];
            let (group, bases) = match self.group_on_fewer_points(mesh, fields, g) {
                Some(found) => {
                    is_other = true;
                    found
                }
                None => (group.clone(), own.bases.clone()),
            };
            bound.push(GroupBinding::new(mesh, &group, bases));
            groups.push(group);
        }
        let domain = crate::domain::Domain { groups, ..(**domain).clone() };
        is_other.then(|| self.with_functions(Arc::new(domain), bound, self.dofs.to_vec()))
    }

    /// A group with fewer points, and its bases there.
    fn group_on_fewer_points(&self, mesh: &Mesh, fields: &[Field], g: usize) -> Option<(Group, Vec<Basis>)> {
        let (group, bound) = (&self.assembled.domain.groups[g], &self.assembled.binding.groups[g]);
        let (kind, rule) = (group.here.kind, self.rule_of_products(mesh, fields, g)?);
        let on_points = |basis: &Basis| {
            let FieldSpace::Nodal(space) = &fields[basis.field.index()].space else { return None };
            let element = space.element(kind)?;
            Some(Basis { table: element.tabulate(&rule.points, basis.order), ..basis.clone() }.with_support())
        };
        let bases = bound.bases.iter().map(on_points).collect::<Option<Vec<_>>>()?;
        let mut made = group.clone();
        made.here.geometry = mesh.geometry_element(kind).tabulate(&rule.points, 2);
        made.here.points.clone_from(&rule.points);
        made.parameters = rule.points;
        made.weights = rule.weights;
        Some((made, bases))
    }

    /// Points of a group for means of the entries.
    pub(super) fn n_points_of_means(&self, mesh: &Mesh, fields: &[Field], g: usize) -> usize {
        let own = self.assembled.domain.groups[g].n_points();
        self.rule_of_products(mesh, fields, g).map_or(own, |rule| rule.n_points())
    }

    /// A rule for products of two functions of a group, if it has fewer points than that of the term and maps are affine.
    fn rule_of_products(&self, mesh: &Mesh, fields: &[Field], g: usize) -> Option<quadrature::Rule> {
        let group = &self.assembled.domain.groups[g];
        if group.here.cells.iter().any(|cell| mesh.map_order(*cell) > 0) {
            return None;
        }
        let rule = quadrature::rule(group.here.kind, self.degree_of_products(fields, g)).ok()?;
        (rule.n_points() < group.n_points()).then_some(rule)
    }

    /// The degree of products of a test and a trial function: in all on simplices, in each variable on other cells.
    fn degree_of_products(&self, fields: &[Field], g: usize) -> usize {
        let binding = &self.assembled.binding;
        let is_simplex = self.assembled.domain.groups[g].here.kind.straight_is_affine();
        let of = |slot: &crate::assemble::SlotPlace| {
            let degree = fields[binding.groups[g].bases[slot.basis].field.index()].degree();
            if is_simplex { degree.saturating_sub(slot.op.order()) } else { degree }
        };
        let products =
            self.entries.list.iter().map(|(test, trial, _)| of(&binding.tests[*test]) + of(&binding.trials[*trial]));
        products.max().unwrap_or(0)
    }
}
