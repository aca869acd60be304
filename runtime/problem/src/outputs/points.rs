//! Points of quantities that are not known everywhere on a piece: those of states, those that have an image.

use std::sync::Arc;

use wfl::{Diagnostic, Span};
use wfl_compiler::ValueLaw;
use wfl_discrete::assemble::Domain;
use wfl_mesh::mesh::SupportSet;

use super::{OutputMaker, Target};
use crate::{
    mappings::{Through, fields_there, refused},
    rule_choice::states_read,
    states::points_of_entities,
    terms::{RuleChoice, domain},
};

/// A message says why there is none.
pub(super) struct Told;

impl OutputMaker<'_> {
    /// Whether a law reads through no mapping, or through one that has images of the points of a piece.
    pub(super) fn begins_on(&self, law: &ValueLaw, target: &Target) -> bool {
        let (Some(mapping), Some(mappings)) = (law.mapping, self.mappings) else { return true };
        let here = mappings.begins_on(mapping, &target.support);
        // of ranks with parts of the mesh one may have no face
        self.parts.mesh.team().all(here)
    }

    /// The points at which a quantity is known, if it is not known everywhere: those of a state, or those of the terms
    /// through a mapping.
    pub(super) fn own_points(
        &mut self,
        law: &ValueLaw,
        target: &Target,
        span: Span,
    ) -> Result<Option<Arc<Domain>>, Told> {
        if let Some(mapping) = law.mapping {
            return self.points_through(mapping, law, target, span).map(Some);
        }
        match states_read(self.parts.fields, &law.inputs).next() {
            Some(state) => self.points_of(state, &target.support, span).ok_or(Told).map(Some),
            None => Ok(points_of_entities(self.parts, law, &target.support)),
        }
    }

    /// The integration points of the terms on the faces of a piece that have an image.
    fn points_through(
        &mut self,
        mapping: usize,
        law: &ValueLaw,
        target: &Target,
        span: Span,
    ) -> Result<Arc<Domain>, Told> {
        let Some(mappings) = self.mappings else {
            self.diagnostics.extend(refused(law.mapping, "a value here", span));
            return Err(Told);
        };
        let set = target.support.region();
        let choice = self.rules.get(&target.sig.name).copied().unwrap_or(RuleChoice::Degree(1));
        let choice = choice.through(Some(mapping));
        let base =
            domain(self.parts.mesh, self.parts.fields, Some(&set), choice, span, self.diagnostics).ok_or(Told)?;
        let through = Through { mapping, there: fields_there(&law.inputs, []), pieces: choice.pieces() };
        // that some points have no image is told of the terms
        let mut told = Vec::new();
        let found = mappings.domain(&through, self.parts.mesh, self.parts.fields, &base, span, &mut told);
        self.diagnostics.extend(told.into_iter().filter(Diagnostic::is_error));
        found.ok_or(Told)
    }

    /// The integration points of a state on a piece.
    fn points_of(&mut self, state: usize, support: &SupportSet, span: Span) -> Option<Arc<Domain>> {
        let places = match &self.parts.script.fields[state].space.place {
            wfl::ast::Place::On(list) => list.iter().map(|p| p.name.as_str()).collect(),
            _ => vec!["all"],
        };
        let choice = places.iter().find_map(|p| self.rules.get(*p)).copied().unwrap_or(RuleChoice::Degree(1));
        domain(self.parts.mesh, self.parts.fields, Some(&support.region()), choice, span, self.diagnostics)
    }
}
