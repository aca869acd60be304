//! Expressions of a scene at points, to compare runs: at the integration points of the scene's own mesh, or at points
//! of another run.
//!
//! An expression is evaluated on every body where it is defined, else on the faces of the terms with kinks (contact),
//! else on all faces with terms. It is compiled on demand, so a run that is not compared has no cost. Does not judge.

use std::{cell::Cell, collections::BTreeMap, sync::Arc};

use serde::{Deserialize, Serialize};
use wfl::{Code, Diagnostic, ResolvedScript, ast::Expr};
use wfl_compiler::{Class, Constant, Env, backend::KernelBackend, types::FieldSig};
use wfl_discrete::{assemble::Domain, system::System, value::Value, window::Window};
use wfl_mesh::{
    mesh::{CellKind, RegionSet},
    quadrature::{rule, vertex},
};
use wfl_output::Located;

use super::{
    Parts, Scene, SceneBox,
    outputs::{OutputMaker, Target},
    terms::Rules,
};

/// One expression at points of one home.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Samples {
    /// The name given to the expression.
    pub name: String,
    /// `body 1`, `body 2`, … or the name of a region of faces.
    pub home: String,
    /// The kind of unknowns that it belongs to, by the first field of that kind; empty for other quantities.
    #[serde(default)]
    pub kind: String,
    /// All is what rounding leaves of zero.
    #[serde(default)]
    pub vanishes: bool,
    /// By component a constant beside which a norm is taken; empty where that is zero.
    #[serde(default)]
    pub constant: Vec<f64>,
    /// Entries of the value.
    pub components: usize,
    /// Positions, in the unit of the mesh.
    pub positions: Vec<[f64; 3]>,
    /// Length, area or volume that each point stands for.
    pub weights: Vec<f64>,
    /// `values[point * components + component]`; not a number at a point that was not found.
    pub values: Vec<f64>,
}

/// Where expressions are sampled.
#[derive(Clone, Copy, Debug)]
pub enum SampleAt<'a> {
    /// At Gauss points of the scene's own mesh, exact to this degree.
    Own(usize),
    /// At the points of other samples of the same name and home.
    Points(&'a [Samples]),
}

/// A state in which expressions are sampled.
#[derive(Clone, Copy)]
pub struct StateAt<'a> {
    /// The discrete problem with what it knows beside the unknowns: the past, rates, known fields.
    pub system: &'a System,
    /// The step that it ends.
    pub window: Window,
    /// Values of all dofs.
    pub unknowns: &'a [f64],
}

/// One expression in one home.
struct Wanted<'s, 'a> {
    name: &'s str,
    home: &'s str,
    at: SampleAt<'a>,
}

impl Scene {
    /// How the box of its mesh is divided; `None` for a mesh from a file.
    #[must_use]
    pub fn box_of(&self, script: &ResolvedScript) -> Option<SceneBox> {
        super::mesh::box_of(script, &self.env.params)
    }

    /// Expressions at a state. Messages tell of those that have no home.
    pub fn samples(
        &self,
        script: &ResolvedScript,
        backend: &dyn KernelBackend,
        expressions: &[(String, Expr)],
        at: SampleAt<'_>,
        state: StateAt<'_>,
    ) -> (Vec<Samples>, Vec<Diagnostic>) {
        let mut diagnostics = Vec::new();
        let env = self.open_env();
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
        let mut out: Vec<Samples> = Vec::new();
        let mut problems = Vec::new();
        let mut places = Places::default();
        for (name, expression) in expressions {
            for (target, law) in maker.homes(&bodies, &faces, expression) {
                let made = Value::new(law, backend).map_err(|e| e.to_string()).and_then(|value| {
                    let value = value.at_step(state.system.with_present_rates(state.window));
                    let wanted = Wanted { name, home: &home(target, &bodies), at };
                    self.sample(wanted, target, &value, &mut places, state)
                });
                match made {
                    Ok(samples) => out.extend(samples),
                    Err(text) => problems.push(Diagnostic::new(Code::E416, text).at(expression.span, "")),
                }
            }
        }
        diagnostics.extend(problems);
        (out, diagnostics)
    }

    /// What expressions of a scene that is prepared are compiled with.
    pub(super) fn open_env(&self) -> Env<'_> {
        Env {
            dim: self.env.dim,
            fields: &self.sigs,
            mappings: &[],
            params: &self.env.params,
            expansions: &self.env.expansions,
            step_variable: self.steps.variable.as_deref(),
            rates: &self.env.rates,
            tables: &self.env.tables,
            equal_within: 0.0,
        }
    }

    /// What expressions see with other fields and parameters than those of the scene, its mappings included.
    #[must_use]
    pub fn env_with<'a>(&'a self, fields: &'a [FieldSig], params: &'a BTreeMap<String, Constant>) -> Env<'a> {
        Env { fields, params, mappings: &self.env.mappings, ..self.open_env() }
    }

    /// What its statements are read with.
    pub(super) fn parts<'a>(&'a self, script: &'a ResolvedScript, env: &'a Env<'a>) -> Parts<'a> {
        let Scene { system, topology, regions, .. } = self;
        Parts { script, env, mesh: &system.mesh, topology, regions, fields: &system.fields }
    }

    /// The faces of the terms with kinks, or all faces with terms where there are none.
    pub(super) fn compared_faces(&self, maker: &OutputMaker<'_>) -> Vec<Target> {
        let mut faces = maker.faces();
        faces.retain(|face| !face.is_of_edges());
        let kinked: Vec<&str> =
            self.terms.iter().filter(|t| t.class == Class::Kinked).map(|t| t.place.as_str()).collect();
        if faces.iter().any(|f| kinked.contains(&f.sig.name.as_str())) {
            faces.retain(|f| kinked.contains(&f.sig.name.as_str()));
        }
        faces
    }

    fn sample<'a>(
        &self,
        wanted: Wanted<'_, 'a>,
        target: &Target,
        value: &Value,
        places: &mut Places<'a>,
        state: StateAt<'_>,
    ) -> Result<Option<Samples>, String> {
        let Wanted { name, home, at } = wanted;
        let mesh = &self.system.mesh;
        let region: RegionSet = target.support.region();
        let mut samples = Samples {
            name: name.to_owned(),
            home: home.to_owned(),
            components: value.n_components(),
            ..Samples::default()
        };
        let (domain, points) = match at {
            SampleAt::Own(degree) => {
                let made = |kind: CellKind| rule(kind, degree).unwrap_or_else(|_| vertex(kind));
                let fresh = || Ok((Arc::new(Domain::new(mesh, &region, &made).map_err(|e| e.to_string())?), None));
                places.of(home, &[], fresh)?
            }
            SampleAt::Points(list) => {
                let Some(like) = list.iter().find(|s| s.name == name && s.home == home) else { return Ok(None) };
                samples.positions.clone_from(&like.positions);
                samples.weights.clone_from(&like.weights);
                samples.values = vec![f64::NAN; like.positions.len() * samples.components];
                let fresh = || {
                    let located = Located::new(mesh, &region, &like.positions).map_err(|e| e.to_string())?;
                    Ok((located.domain, Some(Arc::new(located.points))))
                };
                places.of(home, &like.positions, fresh)?
            }
        };
        let sampled = value.bind(mesh, domain.clone(), &self.system.fields).map_err(|e| e.to_string())?;
        let values = state.system.values(state.unknowns);
        let n = samples.components;
        value.for_each_point(mesh, &sampled, values.view(), |g, entity, q, weight, v| match &points {
            Some(points) => samples.values[points[g][q] * n..][..n].copy_from_slice(v),
            None => {
                samples.positions.push(domain.groups[g].position(mesh, entity, q));
                samples.weights.push(weight);
                samples.values.extend_from_slice(v);
            }
        });
        Ok(Some(samples))
    }
}

/// A domain, and which of the requested points its points are.
type Found = (Arc<Domain>, Option<Arc<Vec<Vec<usize>>>>);

/// Points that were found before: most expressions of a home are taken at the same ones.
#[derive(Default)]
struct Places<'a> {
    list: Vec<(String, &'a [[f64; 3]], Found)>,
}

impl<'a> Places<'a> {
    fn of(
        &mut self,
        home: &str,
        positions: &'a [[f64; 3]],
        fresh: impl FnOnce() -> Result<Found, String>,
    ) -> Result<Found, String> {
        if let Some(known) = self.list.iter().find(|k| k.0 == home && k.1 == positions) {
            return Ok(known.2.clone());
        }
        let found = fresh()?;
        self.list.push((home.to_owned(), positions, found.clone()));
        Ok(found)
    }
}

fn home(target: &Target, bodies: &[Target]) -> String {
    match bodies.iter().position(|b| b.support == target.support) {
        Some(k) => format!("body {}", k + 1),
        None => target.sig.name.clone(),
    }
}
