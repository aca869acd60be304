//! Where quantities may be sampled: bodies, faces, edges of faces.

use wfl::ast::Place;
use wfl_discrete::{field::FieldSpace, space::Support};
use wfl_mesh::mesh::{CellId, RegionSet, SupportSet};

use super::{OutputMaker, Target};
use crate::{fields::place_sig, regions::NamedRegion};

impl OutputMaker<'_> {
    fn target(&self, name: &str, set: RegionSet, support: SupportSet) -> Target {
        let region = NamedRegion { set, edges: None, span: None, here_name: None, inside: false };
        Target { sig: place_sig(name, &region, self.parts.mesh, self.parts.fields), support }
    }

    /// Whether two supports are the same on all ranks.
    pub(super) fn are_one(&self, a: &SupportSet, b: &SupportSet) -> bool {
        self.parts.mesh.team().all(a == b)
    }

    /// The distinct cell sets on which fields live.
    pub(crate) fn bodies(&self) -> Vec<Target> {
        let mut sets: Vec<Vec<CellId>> = Vec::new();
        for field in self.parts.fields {
            let mut cells = match &field.space {
                FieldSpace::Nodal(space) => match space.support() {
                    Support::Cells(cells) => cells.clone(),
                    Support::Facets(_) | Support::Edges(_) => continue,
                },
                FieldSpace::Points(space) => space.cells(),
                FieldSpace::Global => continue,
            };
            cells.sort_unstable();
            // of ranks with parts of the mesh all have the same list of bodies
            let team = self.parts.mesh.team();
            if team.any(!cells.is_empty()) && !sets.iter().any(|set| team.all(*set == cells)) {
                sets.push(cells);
            }
        }
        if sets.is_empty() {
            // single numbers alone: they have their values wherever somebody asks
            sets.push(self.parts.mesh.cells().collect());
        }
        let target =
            |cells: Vec<CellId>| self.target("this body", RegionSet::Cells(cells.clone()), SupportSet::Cells(cells));
        sets.into_iter().map(target).collect()
    }

    /// The interfaces and facet regions that have terms, and behind them the edges on which fields live.
    pub(crate) fn faces(&self) -> Vec<Target> {
        let mut out: Vec<Target> = Vec::new();
        for term in &self.parts.script.terms {
            for place in &term.places {
                let Some(region) = self.parts.regions.get(&place.name) else { continue };
                let Some(support) = facet_support(&region.set) else { continue };
                if !out.iter().any(|t| self.are_one(&t.support, &support)) {
                    out.push(self.target(&place.name, region.set.clone(), support));
                }
            }
        }
        self.add_edges(&mut out);
        out
    }

    /// The distinct sets of edges on which fields live.
    fn add_edges(&self, out: &mut Vec<Target>) {
        for (field, declared) in self.parts.fields.iter().zip(&self.parts.script.fields) {
            let (FieldSpace::Nodal(space), Place::On(places)) = (&field.space, &declared.space.place) else { continue };
            let Support::Edges(edges) = space.support() else { continue };
            let support = SupportSet::Edges(edges.clone());
            if !out.iter().any(|t| self.are_one(&t.support, &support)) {
                let name = places.first().map_or("these edges", |place| place.name.as_str());
                out.push(self.target(name, RegionSet::Edges(edges.clone()), support));
            }
        }
    }

    /// The faces on which a line may lie: those with terms, then other regions of faces.
    pub(crate) fn faces_of_lines(&self) -> Vec<Target> {
        let mut out = self.faces();
        for (name, region) in self.parts.regions {
            let Some(support) = facet_support(&region.set) else { continue };
            if !out.iter().any(|t| self.are_one(&t.support, &support)) {
                out.push(self.target(name, region.set.clone(), support));
            }
        }
        out.sort_by_key(Target::is_of_edges);
        out
    }
}

/// The facets of a region, if it is one of facets.
pub(crate) fn facet_support(set: &RegionSet) -> Option<SupportSet> {
    match set {
        RegionSet::Facets(f) => Some(SupportSet::Facets(f.clone())),
        RegionSet::Interface(i) => Some(SupportSet::Interface(i.clone())),
        _ => None,
    }
}
