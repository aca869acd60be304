//! The parameter of the contact method of a scene: what scales the displacements in its projections, for any name.
//!
//! Found from the terms as they are compiled (`wfl_compiler::scaling_parameters`), on request. Promises: a parameter
//! that a term on cells names is none, since it says what the bodies are made of. Does not know whether a stiffness
//! stands for contact or for a real one-sided spring: who changes the solution by it must ask for more than this.

use std::collections::BTreeSet;

use wfl::{ResolvedScript, ast::Ident};
use wfl_compiler::{
    Env, ScaledPart, TermSource, compile_frozen, compile_term, scaling_parameters,
    types::{FieldId, PlaceKind, PlaceSig},
};

use super::{Scene, fields::place_sig};

impl Scene {
    /// The scalar parameter that scales the displacements in every projection on faces whose value is a force; `None`
    /// if there is none, or more than one.
    #[must_use]
    pub fn method_parameter(&self, script: &ResolvedScript) -> Option<String> {
        let env = Env {
            dim: self.env.dim,
            fields: &self.sigs,
            mappings: &self.env.mappings,
            params: &self.env.params,
            expansions: &self.env.expansions,
            step_variable: self.steps.variable.as_deref(),
            rates: &self.env.rates,
            tables: &self.env.tables,
            equal_within: 0.0,
        };
        let mut common: Option<BTreeSet<String>> = None;
        let mut of_bodies: BTreeSet<&str> = BTreeSet::new();
        for term in &script.terms {
            for place in term.places.iter().filter_map(|p| self.place_of(p)) {
                if place.kind == PlaceKind::Cells {
                    wfl::each_name(&term.expr, &mut |name| {
                        of_bodies.insert(name);
                    });
                    continue;
                }
                let source =
                    if term.energy { TermSource::Energy(&term.expr) } else { TermSource::Residual(&term.expr) };
                for found in scaling(&env, &place, source) {
                    common = Some(match common {
                        Some(names) => names.intersection(&found).cloned().collect(),
                        None => found,
                    });
                }
            }
        }
        let mut names = common?.into_iter().filter(|name| !of_bodies.contains(name.as_str()));
        names.next().filter(|_| names.next().is_none())
    }

    fn place_of(&self, place: &Ident) -> Option<PlaceSig> {
        let region = self.regions.get(&place.name)?;
        Some(place_sig(&place.name, region, &self.system.mesh, &self.system.fields))
    }
}

/// For each projection of a term whose value is a force: the parameters that scale the displacements in its argument.
fn scaling(env: &Env<'_>, place: &PlaceSig, source: TermSource<'_>) -> Vec<BTreeSet<String>> {
    let Some(law) = compile_term(env, place, "", source).value else { return Vec::new() };
    let branches = FieldId::new(env.fields.len());
    let Some(frozen) = compile_frozen(env, place, "", &law.listing, branches) else { return Vec::new() };
    let all = scaling_parameters(env, place, source, &frozen);
    let acting = frozen.projections.iter().enumerate().filter(|(_, p)| p.acts);
    let of = |k: usize| all.iter().filter(move |s| s.projection == k && s.part == ScaledPart::Displacement);
    acting.map(|(k, _)| of(k).map(|s| s.parameter.clone()).collect()).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use wfl::{NoFiles, ResolvedScript, SourceMap, resolve};
    use wfl_compiler::InterpreterBackend;

    use crate::Scene;

    const BLOCK: &str = "wfl 1
param E = 100
param slope = 300
param h = 0.5
mesh box [0,0] to [1,1] cells [2,2] quad
region floor = faces where y == 0
region top = faces where y == 1
unknown u : vector
def stress(v) = E*Sym(Grad_v)
term elastic on all : stress(u):Grad_Test_u
fix u(1) = 0 on top
load u = [0,-1] on top
";

    fn parameter(terms: &str) -> Option<String> {
        let (script, scene) = prepared(terms);
        scene.method_parameter(&script)
    }

    fn prepared(terms: &str) -> (ResolvedScript, Scene) {
        let mut sources = SourceMap::new();
        let main = sources.add("scene.wfl", format!("{BLOCK}{terms}"));
        let script = resolve(&mut sources, main, &mut NoFiles, &[]);
        let script = script.value.unwrap_or_else(|| panic!("{:?}", script.diagnostics));
        let made = crate::prepare(&script, Path::new("."), &InterpreterBackend);
        let scene = made.scene.unwrap_or_else(|| panic!("{:?}", made.diagnostics));
        (script, scene)
    }

    #[test]
    fn the_parameter_of_a_method_is_found_by_what_it_does() {
        let slope = Some("slope".to_owned());
        let nitsche = "term contact on floor : pos_part(slope*u.Normal - (stress(u)*Normal).Normal)*(Test_u.Normal)";
        assert_eq!(parameter(nitsche), slope);
        assert_eq!(parameter("term contact on floor : pos_part(slope/h*u.Normal)*(Test_u.Normal)"), slope);
        // what bodies are made of is no parameter of a method
        assert_eq!(parameter("term contact on floor : pos_part(slope*E*u.Normal)*(Test_u.Normal)"), slope);
        assert_eq!(parameter("term contact on floor : pos_part(E/h*u.Normal)*(Test_u.Normal)"), None);
        // two factors: neither is the parameter
        assert_eq!(parameter("term contact on floor : pos_part(slope*h*u.Normal)*(Test_u.Normal)"), None);
        assert_eq!(parameter("term spring on floor : slope*u.Test_u"), None);
    }

    #[test]
    fn every_projection_must_have_the_parameter() {
        let half = "pos_part(slope*u.Normal)*(Test_u.Normal)";
        let ball = |factor: &str| format!("Ball_projection({factor}*u, 1).Test_u");
        assert_eq!(parameter(&format!("term contact on floor : {half} + {}", ball("slope"))), Some("slope".to_owned()));
        assert_eq!(parameter(&format!("term contact on floor : {half} + {}", ball("h"))), None);
    }
}
