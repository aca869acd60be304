//! Derivatives of integrals with respect to the unknowns, and integrals by cell: what error estimates are made of.
//!
//! The derivative of an integrand is that of the compiler, as for an energy. Compiled on demand: a run without an estimate
//! has no cost. Does not know what is estimated.

use std::{cell::Cell, sync::Arc};

use wfl::{
    Diagnostic, ResolvedScript,
    ast::{Expr, ExprKind},
};
use wfl_compiler::{
    LoadPart, TermSource,
    backend::KernelBackend,
    compile_term, compile_value,
    types::{FieldId, PlaceSig},
};
use wfl_discrete::{
    assemble::{AssembledTerm, Binding, Domain, Integrator, LawSlots},
    field::FieldSpace,
    system::System,
    value::Value,
};
use wfl_mesh::mesh::RegionSet;

use super::{
    Measure, Scene, StateAt,
    fields::place_sig,
    outputs::{OutputMaker, facet_support},
    terms::{RuleChoice, Rules, domain},
};

/// Where an expression is integrated.
struct Home {
    sig: PlaceSig,
    set: RegionSet,
}

/// What is integrated, where and at which state, and what compiles it.
#[derive(Clone, Copy)]
struct Asked<'a> {
    script: &'a ResolvedScript,
    backend: &'a dyn KernelBackend,
    integrand: &'a Expr,
    over: Over<'a>,
    at: StateAt<'a>,
}

/// Where an integrand is taken.
#[derive(Clone, Copy, Debug)]
pub enum Over<'a> {
    /// On every body where it is defined, else on the faces of the terms with kinks, else on all faces with terms.
    Everywhere,
    /// On regions of the scene.
    Regions(&'a [wfl::ast::Ident]),
    /// On the regions of a measure, at its points where these are one set: what it depends on is what the run has computed.
    Measure(&'a wfl::Measure),
    /// At the point of a measure, by its name: the value there.
    Point(&'a str),
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
        let mut out = self.summed(TermSource::Energy(integrand), Asked { script, backend, integrand, over, at })?;
        if let Over::Point(_) = over {
            let size = self.integral(script, backend, &one(integrand), (over, at))?;
            out.iter_mut().for_each(|x| *x /= size);
        }
        Ok(out)
    }

    /// An integral as forces at nodes, whose sum it is: of each basis function of some unknown its product with the integrand,
    /// by dof. `None` where no unknown has a basis there.
    #[must_use]
    pub fn at_nodes(
        &self,
        script: &ResolvedScript,
        backend: &dyn KernelBackend,
        measure: &wfl::Measure,
        at: StateAt<'_>,
    ) -> Option<Vec<f64>> {
        let fields = self.system.fields.iter().enumerate();
        let mut nodal =
            fields.filter(|(k, f)| matches!(f.space, FieldSpace::Nodal(_)) && self.system.range(*k).is_some());
        nodal.find_map(|(k, f)| {
            let part = if f.n_components == 1 { LoadPart::Whole } else { LoadPart::Component(0) };
            let source = TermSource::Load { value: &measure.expr, field: FieldId::new(k), part };
            let asked = Asked { script, backend, integrand: &measure.expr, over: Over::Measure(measure), at };
            let loads = self.summed(source, asked).ok()?;
            Some(loads.into_iter().map(|x| -x).collect())
        })
    }

    /// By dof what a form made of an expression adds to the equations.
    fn summed(&self, source: TermSource<'_>, asked: Asked<'_>) -> Result<Vec<f64>, String> {
        let Asked { script, backend, integrand, over, at } = asked;
        let env = self.open_env();
        let mut out = vec![0.0; self.system.numbering.n_dofs];
        for home in self.homes(script, backend, integrand, over)? {
            let compiled = compile_term(&env, &home.sig, "the goal", source);
            let Some(law) = compiled.value else { return Err(first(&compiled.diagnostics)) };
            let system = &self.system;
            if law.tests.iter().any(|t| system.numbering.starts[t.field.index()].is_none()) {
                return Err("it depends on a field that is in no term".to_owned());
            }
            let domain = match over {
                Over::Point(_) => self.at_point(over)?,
                Over::Measure(measure) => match self.domain_of(&measure.name.name) {
                    Some(domain) => domain,
                    None => self.points(&home, law.degree.rule(), integrand)?,
                },
                _ => self.points(&home, law.degree.rule(), integrand)?,
            };
            let slots = LawSlots { inputs: &law.inputs, tests: &law.tests, trials: &law.trials };
            let binding = Binding::new(&system.mesh, &domain, &system.fields, slots).map_err(|e| e.to_string())?;
            let kernel = backend.compile(&[&law.residual]).map_err(|e| e.to_string())?.swap_remove(0);
            let (integrator, place) = (Integrator { domain, binding: Arc::new(binding) }, facet_support(&home.set));
            let mut term = AssembledTerm::new(law, integrator, place, kernel, None, &system.numbering.starts);
            term.set_step(at.system.with_present_rates(at.window));
            let values = at.system.values(at.unknowns);
            term.add_residual(&system.mesh, values.view(), &mut out).map_err(|e| e.to_string())?;
        }
        Ok(out)
    }

    /// The integral of a scalar expression at a state.
    ///
    /// # Errors
    /// The first message about an expression that has no value at the state.
    pub fn integral(
        &self,
        script: &ResolvedScript,
        backend: &dyn KernelBackend,
        integrand: &Expr,
        place: (Over<'_>, StateAt<'_>),
    ) -> Result<f64, String> {
        let mut sum = 0.0;
        self.each_point(script, backend, integrand, place, |_, weight, value| sum += weight * value)?;
        Ok(sum)
    }

    /// The points of the measure of this name.
    fn at_point(&self, over: Over<'_>) -> Result<Arc<Domain>, String> {
        let Over::Point(name) = over else { return Err("it is not taken at a point".to_owned()) };
        self.domain_of(name).ok_or_else(|| format!("no value `{name}` at a point"))
    }

    /// The points of the measure of this name, where they are one set.
    fn domain_of(&self, name: &str) -> Option<Arc<Domain>> {
        self.measures.iter().find(|m| m.name == name).and_then(Measure::domain)
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
        let mut out = vec![0.0; self.system.mesh.n_cells()];
        let place = (Over::Everywhere, at);
        self.each_point(script, backend, integrand, place, |cell, weight, value| out[cell] += weight * value)?;
        Ok(out)
    }

    /// Calls `f` with cell, weight and value at each point of an integral.
    fn each_point(
        &self,
        script: &ResolvedScript,
        backend: &dyn KernelBackend,
        integrand: &Expr,
        place: (Over<'_>, StateAt<'_>),
        mut f: impl FnMut(usize, f64, f64),
    ) -> Result<(), String> {
        let (over, at) = place;
        let (system, env) = (&self.system, self.open_env());
        for home in self.homes(script, backend, integrand, over)? {
            let compiled = compile_value(&env, &home.sig, "an estimate", integrand);
            let Some(law) = compiled.value else { return Err(first(&compiled.diagnostics)) };
            let domain = match over {
                Over::Point(_) => self.at_point(over)?,
                _ => self.points(&home, law.degree.rule(), integrand)?,
            };
            let value = Value::new(law, backend).map_err(|e| e.to_string())?;
            let value = value.at_step(at.system.with_present_rates(at.window));
            let sampled = value.bind(&system.mesh, domain.clone(), &system.fields).map_err(|e| e.to_string())?;
            let values = at.system.values(at.unknowns);
            value.for_each_point(&system.mesh, &sampled, values.view(), |g, entity, _, weight, v| {
                f(domain.groups[g].here.cells[entity].index(), weight, v[0]);
            });
        }
        Ok(())
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
        let names = match over {
            Over::Regions(names) => Some(names),
            Over::Measure(measure) => Some(measure.places.as_slice()),
            Over::Everywhere | Over::Point(_) => None,
        };
        if let Some(names) = names {
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
            mappings: None,
            rules: &Rules::new(),
            backend,
            steps: None,
            diagnostics: &mut diagnostics,
            law_seconds: Cell::new(0.0),
        };
        let bodies = maker.bodies();
        let faces = self.compared_faces(&maker);
        let found = maker.homes(&bodies, &faces, integrand);
        let mut homes: Vec<Home> =
            found.into_iter().map(|(t, _)| Home { sig: t.sig.clone(), set: t.support.region() }).collect();
        if let Over::Point(_) = over {
            let domain = self.at_point(over)?;
            let cell = domain.groups.iter().find_map(|g| g.here.cells.first().copied());
            let has = |set: &RegionSet| match (set, cell) {
                (RegionSet::Cells(cells), Some(cell)) => cells.contains(&cell),
                _ => false,
            };
            homes.retain(|home| has(&home.set));
            homes.truncate(1);
        }
        if homes.is_empty() { Err(first(&diagnostics)) } else { Ok(homes) }
    }
}

/// The first message.
fn first(diagnostics: &[Diagnostic]) -> String {
    diagnostics.first().map_or_else(|| "it is defined nowhere".to_owned(), |d| d.message.clone())
}

/// The number one where an expression stands.
fn one(like: &Expr) -> Expr {
    Expr { kind: ExprKind::Number(1.0), span: like.span, expansion: like.expansion }
}
