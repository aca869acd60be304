//! `load u = F on r` where `r` is a region of nodes: a force at each of its nodes.
//!
//! Each node is a point of weight 1 in one of the cells that contain it, or on one of the faces of a field that lives on
//! faces, so the value is evaluated at the node and the force acts on the dofs of that node only. A node that `u` does not
//! have, or has several times (at a split), is an error.

use std::sync::Arc;

use wfl::{
    Code, Diagnostic,
    ast::{Ident, TargetPart},
};
use wfl_compiler::{
    LoadPart, TermSource,
    types::{FieldId, FieldKind, PlaceSig},
};
use wfl_discrete::{
    assemble::Domain,
    field::{Field, FieldSpace},
    space::Support,
};
use wfl_mesh::{
    element::Family,
    mesh::{NodeId, RegionSet},
};

use super::edges;
use super::terms::{Loaded, Origin, PlacedLaw, TermMaker, component};
use crate::fields::global_place;

impl TermMaker<'_> {
    /// The forces of one `load` at the nodes of a region.
    pub(super) fn point_load(
        &mut self,
        numbered: (Origin, &wfl::Condition),
        name: &str,
        target: &wfl::ast::Target,
        place: &Ident,
        nodes: &[NodeId],
        out: &mut Vec<PlacedLaw>,
    ) {
        let (origin, load) = numbered;
        let Some(position) = self.parts.fields.iter().position(|f| f.name == target.field.name) else { return };
        let field = &self.parts.fields[position];
        let part = match &target.part {
            TargetPart::Whole => LoadPart::Whole,
            TargetPart::Component(e) => match component(self.parts.env, e, field, self.diagnostics) {
                Some(c) => LoadPart::Component(c),
                None => return,
            },
            TargetPart::Normal => {
                let d = Diagnostic::new(Code::E204, "`Normal` exists on faces only");
                self.diagnostics.push(d.at(target.span, format!("`{}` is a region of nodes", place.name)));
                return;
            }
        };
        if self.parts.mesh.dim() == 3 && edges::are_in(self.parts.script, &place.name) {
            let d = Diagnostic::new(Code::E431, format!("`load {}` cannot act along `{}`", field.name, place.name));
            let text = "in space a load on edges is one per length, which a rim takes alone";
            let help = "rim of SURFACE where ...; at single nodes: nodes of SURFACE where ...";
            self.diagnostics.push(d.at(place.span, text).help(help));
            return;
        }
        let domain = match self.at_nodes(field, nodes) {
            Ok(domain) => Arc::new(domain),
            Err((what, help)) => {
                let d = Diagnostic::new(Code::E431, format!("`load {}` cannot act on `{}`", field.name, place.name));
                self.diagnostics.push(d.at(place.span, what).help(help));
                return;
            }
        };
        let source = TermSource::Load { value: &load.value, field: FieldId::new(position), part };
        let description = format!("a region of {} nodes", nodes.len());
        let sig = PlaceSig { name: place.name.clone(), description, ..global_place(self.parts.fields.len()) };
        let before = out.len();
        self.push(&sig, name, source, (Some(RegionSet::Nodes(nodes.to_vec())), origin, load.span), out);
        for law in &mut out[before..] {
            law.at_nodes = Some(domain.clone());
            law.load = Some(Loaded { field: position, span: load.span, normal: false });
        }
    }

    /// The points of a load on nodes, or what is wrong and what to do.
    fn at_nodes(&self, field: &Field, nodes: &[NodeId]) -> Result<Domain, (String, &'static str)> {
        let faces = "a traction on faces: load u = force/area on a region of faces";
        let FieldSpace::Nodal(space) = &field.space else {
            return Err((format!("`{}` has no nodes of the mesh", field.name), "fields of cells have them"));
        };
        if field.kind == FieldKind::Multiplier {
            return Err((
                format!("`{}` is a multiplier: its equation is a condition", field.name),
                "unknowns take loads",
            ));
        }
        if space.family() == Family::Discontinuous {
            return Err((
                format!("`{}` is discontinuous: each cell at a node has a value of its own", field.name),
                faces,
            ));
        }
        let (mut own, mut missing, mut torn) = (Vec::with_capacity(nodes.len()), Vec::new(), Vec::new());
        for (node, found) in nodes.iter().zip(space.by_mesh_node(self.parts.mesh, nodes)) {
            match found.as_slice() {
                [] => missing.push(*node),
                [one] => own.push(*one),
                _ => torn.push(*node),
            }
        }
        let place = |list: &[NodeId]| format!("{:?}", &self.parts.mesh.node(list[0])[..self.parts.mesh.dim()]);
        // what a part of the mesh lacks is on other ranks
        let (missing, torn) = self.parts.mesh.check_whole(|| (missing, torn));
        if !missing.is_empty() {
            let what = format!(
                "`{}` has no node at {} of its {} nodes, the first at {}",
                field.name,
                missing.len(),
                nodes.len(),
                place(&missing)
            );
            let help = match space.support() {
                Support::Cells(_) => "nodes of a body alone: region tip = nodes of left where x == 0",
                Support::Facets(_) | Support::Edges(_) => {
                    "nodes of its faces alone: region tip = nodes where x == 0 and y == 0"
                }
            };
            return Err((what, help));
        }
        if !torn.is_empty() {
            let what =
                format!("`split` gives `{}` two nodes at {}: the load does not say which", field.name, place(&torn));
            return Err((what, faces));
        }
        Ok(Domain::at_nodes(self.parts.mesh, space, &own))
    }
}
