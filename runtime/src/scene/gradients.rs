//! Derivatives of integrals with respect to the unknowns, and integrals by cell: what error estimates are made of.
//!
//! The derivative of an integrand is that of the compiler, as for an energy. Compiled on demand: a run without an estimate
//! has no cost. Does not know what is estimated.

use std::{cell::Cell, sync::Arc};

use wfl::{Diagnostic, ResolvedScript, ast::Expr};
use wfl_compiler::{TermSource, backend::KernelBackend, compile_term, compile_value, types::PlaceSig};

use super::{
    Scene, StateAt,
    fields::place_sig,
    outputs::{OutputMaker, facet_support},
    terms::{RuleChoice, Rules, domain},
};
use crate::{
    assemble::{AssembledTerm, Binding, Domain, FieldValues, Integrator, LawSlots},
    mesh::RegionSet,
    system::System,
    value::Value,
};

/// Where an expression is integrated.
struct Home {
    sig: PlaceSig,
    set: RegionSet,
}

/// Where an integrand is taken.
#[derive(Clone, Copy, Debug)]
pub enum Over<'a> {
    /// On every body where it is defined, else on the faces of the terms with kinks, else on all faces with terms.
    Everywhere,
    /// On regions of the scene.
    Regions(&'a [wfl::ast::Ident]),
}

impl Scene {
    /// By dof (fixed ones included, in the axes of the scene): the derivative of the integral of a scalar expression at a
    /// state, in the unit of the integral over that of the unknown.
    ///
    /// # Errors
    /// The first message about an expression that cannot be differentiated, or has no value at the state.
    pub fn derivative(
        &self,
        script: &ResolvedScript,
        backend: &dyn KernelBackend,
        integrand: &Expr,
        over: Over<'_>,
        at: StateAt<'_>,
    ) -> Result<Vec<f64>, String> {
        let env = self.open_env();
        let mut out = vec![0.0; self.system.numbering.n_dofs];
        for home in self.homes(script, backend, integrand, over)? {
            let compiled = compile_term(&env, &home.sig, "the goal", TermSource::Energy(integrand));
            let Some(law) = compiled.value else { return Err(first(&compiled.diagnostics)) };
            let system = &self.system;
            if law.tests.iter().any(|t| system.numbering.starts[t.field.index()].is_none()) {
                return Err("it depends on a field that is in no term".to_owned());
            }
            let domain = self.points(&home, law.degree.rule(), integrand)?;
            let slots = LawSlots { inputs: &law.inputs, tests: &law.tests, trials: &law.trials };
            let binding = Binding::new(&system.mesh, &domain, &system.fields, slots).map_err(|e| e.to_string())?;
            let kernel = backend.compile(&[&law.residual]).map_err(|e| e.to_string())?.swap_remove(0);
            let (integrator, place) = (Integrator { domain, binding }, facet_support(&home.set));
            let mut term = AssembledTerm::new(law, integrator, place, kernel, None, &system.numbering.starts);
            term.set_step(system.known.step(at.time, at.increment));
            let values = system.values(at.unknowns);
            term.add_residual(&system.mesh, values.view(), &mut out).map_err(|e| e.to_string())?;
        }
        Ok(out)
    }

    /// By cell of the mesh: the integral of a scalar expression at a state; on faces it counts for the cell of their side.
    ///
    /// # Errors
    /// The first message about an expression that has no value at the state.
    pub fn integrals_by_cell(
        &self,
        script: &ResolvedScript,
        backend: &dyn KernelBackend,
        integrand: &Expr,
        at: StateAt<'_>,
    ) -> Result<Vec<f64>, String> {
        let system = &self.system;
        let mut out = vec![0.0; system.mesh.n_cells()];
        let env = self.open_env();
        for home in self.homes(script, backend, integrand, Over::Everywhere)? {
            let compiled = compile_value(&env, &home.sig, "an estimate", integrand);
            let Some(law) = compiled.value else { return Err(first(&compiled.diagnostics)) };
            let domain = self.points(&home, law.degree.rule(), integrand)?;
            let mut value = Value::new(law, backend).map_err(|e| e.to_string())?;
            value.set_step(system.known.step(at.time, at.increment));
            let sampled = value.bind(&system.mesh, domain.clone(), &system.fields).map_err(|e| e.to_string())?;
            let (current, previous) = (system.slices(at.unknowns), system.previous_slices());
            let values = FieldValues { current: &current, previous: &previous, rates: system.known.rates.as_ref() };
            value.for_each_point(&system.mesh, &sampled, values, |g, entity, _, weight, v| {
                out[domain.groups[g].here.cells[entity].index()] += weight * v[0];
            });
        }
        Ok(out)
    }

    /// The points of a rule of a degree.
    fn points(&self, home: &Home, degree: usize, integrand: &Expr) -> Result<Arc<Domain>, String> {
        let (System { mesh, fields, .. }, mut told) = (&self.system, Vec::new());
        let made = domain(mesh, fields, Some(&home.set), RuleChoice::Degree(degree), integrand.span, &mut told);
        made.ok_or_else(|| first(&told))
    }

    fn homes(
        &self,
        script: &ResolvedScript,
        backend: &dyn KernelBackend,
        integrand: &Expr,
        over: Over<'_>,
    ) -> Result<Vec<Home>, String> {
        let system = &self.system;
        if let Over::Regions(names) = over {
            let home = |name: &wfl::ast::Ident| {
                let region = self.regions.get(&name.name).ok_or_else(|| format!("no region `{}`", name.name))?;
                let sig = place_sig(&name.name, region, &system.mesh, &system.fields);
                Ok(Home { sig, set: region.set.clone() })
            };
            return names.iter().map(home).collect();
        }
        let env = self.open_env();
        let mut diagnostics = Vec::new();
        let mut maker = OutputMaker {
            parts: self.parts(script, &env),
            rules: &Rules::new(),
            backend,
            steps: None,
            diagnostics: &mut diagnostics,
            law_seconds: Cell::new(0.0),
        };
        let bodies = maker.bodies();
        let faces = self.compared_faces(&maker);
        let found = maker.homes(&bodies, &faces, integrand);
        let homes: Vec<Home> =
            found.into_iter().map(|(t, _)| Home { sig: t.sig.clone(), set: t.support.region() }).collect();
        if homes.is_empty() { Err(first(&diagnostics)) } else { Ok(homes) }
    }
}

/// The first message.
fn first(diagnostics: &[Diagnostic]) -> String {
    diagnostics.first().map_or_else(|| "it is defined nowhere".to_owned(), |d| d.message.clone())
}
