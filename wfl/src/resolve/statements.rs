//! Statements, one by one: each is added to the script when all its parts are right.

use super::{
    Allowed, FORMATS, Resolver, SCHEMES, SOLVERS, is_solved_for, names, names::Kind, parts::TransposeOption as _,
};
use crate::{
    ast::{Ident, Item, ItemKind, MeasureAt, OptionItem, QuadratureRule},
    script::{
        Balance, Expect, FieldKind, Mapping, Measure, MeshStmt, Output, Param, Quadrature, Refinement, Region, Scheme,
        Solver, Split, Start, StartKind, Steps, Term, is_auto,
    },
    source::Span,
};

impl<'d> Resolver<'d> {
    pub(super) fn item(&mut self, item: &'d Item) -> Option<()> {
        // a word of the language keeps its meaning; the declaration is told where names are collected
        if names::declared(item).is_some_and(|(_, name)| !self.names.values.contains_key(&name.name)) {
            return None;
        }
        use ItemKind as K;
        let kind = &item.kind;
        match kind {
            K::Version(_) | K::Use { .. } | K::Def(_) => Some(()),
            K::Mesh { .. } | K::Refine(_) | K::Region { .. } | K::Mapping { .. } | K::Param { .. } => {
                self.declaration(kind, item.span)
            }
            K::Unknown { .. } | K::Multiplier { .. } | K::Data { .. } | K::State { .. } | K::Split(..) => {
                self.declaration(kind, item.span)
            }
            K::Term { .. } | K::Fix { .. } | K::Load { .. } | K::Start { .. } | K::StartFrom { .. } => {
                self.equation(kind, item.span)
            }
            K::Steps { .. } | K::Scheme { .. } | K::Solver { .. } | K::Quadrature { .. } => {
                self.request(kind, item.span)
            }
            K::Measure { .. } | K::Computed(..) | K::Balance { .. } | K::Event { .. } => self.request(kind, item.span),
            K::Gradient(_) | K::Expect(_) | K::Output { .. } => self.request(kind, item.span),
        }
    }

    /// What there is: mesh, regions, params, fields.
    fn declaration(&mut self, kind: &'d ItemKind, span: Span) -> Option<()> {
        match kind {
            ItemKind::Mesh { source, map, options } => {
                self.once(self.script.mesh.as_ref().map(|m| m.span), "mesh", span)?;
                let source = self.mesh_source(source);
                let map = self.optional(map.as_ref());
                let options = self.options("mesh", options);
                self.script.mesh = Some(MeshStmt { source: source?, map: map?, options: options?, span });
            }
            ItemKind::Refine(what) => {
                let what = self.refine(what)?;
                self.script.refinements.push(Refinement { what, span });
            }
            ItemKind::Region { name, region } => {
                let region = self.region(region)?;
                self.script.regions.push(Region { name: name.clone(), region, span });
            }
            ItemKind::Mapping { name, kind, options } => {
                let kind = self.mapping(kind);
                let options = self.options("mapping", options);
                self.script.mappings.push(Mapping { name: name.clone(), kind: kind?, options: options?, span });
            }
            ItemKind::Param { name, value, unit, domain, text } => {
                let value = self.expr(value);
                let domain = domain.as_ref().map(|d| self.domain(d));
                let (name, unit, text) = (name.clone(), unit.clone(), text.clone());
                let domain = domain.transpose_option()?;
                self.script.params.push(Param { name, value: value?, unit, domain, text, overridden: None, span });
            }
            ItemKind::Unknown { name, space } => self.field(name, space, Some(FieldKind::Unknown), span)?,
            ItemKind::Multiplier { name, space, options } => {
                let kind = self.multiplier(options);
                self.field(name, space, kind, span)?;
            }
            ItemKind::Data { name, space, value } => {
                let kind = self.data(value.as_ref());
                self.field(name, space, kind, span)?;
            }
            ItemKind::State { name, space, update } => {
                let was_named = self.words.contains(&name.name);
                let kind = self.expr(update).map(|update| FieldKind::State { update });
                // what a state makes of itself serves nobody else
                if !was_named {
                    self.words.remove(&name.name);
                }
                self.field(name, space, kind, span)?;
            }
            ItemKind::Split(fields, places) => {
                let needed = "only unknowns can be split";
                let known = self.all_fields(fields, needed, |k| k == Kind::Unknown);
                let (fields, places) = (fields.clone(), self.places(places, Allowed::Regions));
                known.and(places.map(|places| self.script.splits.push(Split { fields, places, span })))?;
            }
            _ => {}
        }
        Some(())
    }

    /// What holds: terms, conditions, first values.
    fn equation(&mut self, kind: &'d ItemKind, span: Span) -> Option<()> {
        match kind {
            ItemKind::Term { energy, name, places, defs, expr } => {
                self.names.check_locals(defs, &mut self.diagnostics);
                let places = self.places(places, Allowed::RegionsAndGlobal);
                let expr = self.expander.expr_with(expr, defs)?;
                self.note_words(&expr);
                self.known_words(&[&expr])?;
                let (energy, name) = (*energy, name.clone());
                self.script.terms.push(Term { energy, name, places: places?, expr, span });
            }
            ItemKind::Fix { targets, value, places } => {
                let fix = self.condition(targets, value, places, "fixed", span)?;
                self.script.fixes.push(fix);
            }
            ItemKind::Load { targets, value, places } => {
                let load = self.condition(targets, value, places, "loaded", span)?;
                self.script.loads.push(load);
            }
            ItemKind::Start { field, value } => {
                let rate = field.name.strip_prefix("Dot_").map(|name| Ident { name: name.to_owned(), ..field.clone() });
                let of = rate.as_ref().unwrap_or(field);
                let (needed, state) = match rate {
                    Some(_) => ("only unknowns and multipliers have a first rate", false),
                    None => ("only unknowns, multipliers and states have a first value", true),
                };
                let known = self
                    .all_fields(std::slice::from_ref(of), needed, |k| state && k == Kind::State || is_solved_for(k));
                let value = self.expr(value)?;
                known?;
                let kind = match rate {
                    Some(field) => StartKind::Rate { field, value },
                    None => StartKind::Field { field: field.clone(), value },
                };
                self.script.starts.push(Start { kind, span });
            }
            ItemKind::StartFrom { path, path_span } => {
                let kind = StartKind::File { path: path.clone(), path_span: *path_span };
                self.script.starts.push(Start { kind, span });
            }
            _ => {}
        }
        Some(())
    }

    fn steps(&mut self, kind: &'d ItemKind, span: Span) -> Option<()> {
        let ItemKind::Steps { variable, from, to, by, unit, options } = kind else { return None };
        self.once(self.script.steps.as_ref().map(|s| s.span), "steps", span)?;
        let (from, to) = (self.expr(from), self.expr(to));
        let by = if is_auto(by) { Some(by.clone()) } else { self.expr(by) };
        let options = self.reducing(|this| this.options("steps", options))?;
        let mut watched = Vec::new();
        let options = options.into_iter().map(|o| self.watched(o, &mut watched)).collect();
        let (variable, unit) = (variable.clone(), unit.clone());
        let steps = Steps { variable, from: from?, to: to?, by: by?, unit, watched, options, span };
        self.script.steps = Some(steps);
        Some(())
    }

    fn scheme(&mut self, name: &'d Ident, options: &'d [OptionItem], span: Span) -> Option<()> {
        self.once(self.script.scheme.as_ref().map(|s| s.span), "scheme", span)?;
        let known = self.one_of("scheme", name, SCHEMES);
        let options = self.options("scheme", options)?;
        known?;
        self.script.scheme = Some(Scheme { name: name.clone(), options, span });
        Some(())
    }

    /// What is to be done: steps, solver, rules, results.
    fn request(&mut self, kind: &'d ItemKind, span: Span) -> Option<()> {
        match kind {
            ItemKind::Steps { .. } => self.steps(kind, span)?,
            ItemKind::Scheme { name, options } => self.scheme(name, options, span)?,
            ItemKind::Solver { name, options } => {
                self.once(self.script.solver.as_ref().map(|s| s.span), "solver", span)?;
                let known = self.one_of("solver", name, SOLVERS);
                let options = self.options("solver", options)?;
                known?;
                self.script.solver = Some(Solver { name: name.clone(), options, span });
            }
            ItemKind::Quadrature { places, segments, rule } => {
                let places = self.places(places, Allowed::Regions);
                segments.as_ref().map_or(Some(()), |mapping| self.one_mapping(mapping))?;
                let rule = match rule {
                    QuadratureRule::Vertex => QuadratureRule::Vertex,
                    QuadratureRule::Degree(e) => QuadratureRule::Degree(self.expr(e)?),
                };
                self.script.quadratures.push(Quadrature { places: places?, segments: segments.clone(), rule, span });
            }
            ItemKind::Measure { name, reduction, expr, places, at } => {
                let places = self.places(places, Allowed::RegionsAndGlobal);
                let at = match at {
                    MeasureAt::Point(x) => MeasureAt::Point(self.expr(x)?),
                    other => other.clone(),
                };
                let expr = self.expr(expr)?;
                let (name, reduction) = (name.clone(), *reduction);
                self.script.measures.push(Measure { name, reduction, expr, places: places?, at, span });
            }
            ItemKind::Computed(name, expr, places) => self.computed(name, expr, places, span)?,
            ItemKind::Balance { name, fields } => {
                self.all_fields(fields, "only unknowns have equations to be added up", |k| k == Kind::Unknown)?;
                self.script.balances.push(Balance { name: name.clone(), fields: fields.clone(), span });
            }
            ItemKind::Event { name, condition, places } => self.event(name, condition, places, span)?,
            ItemKind::Gradient(of) => self.gradient(of, span)?,
            ItemKind::Expect(condition) => {
                let text = self.sources.snippet(condition.span).to_owned();
                let condition = self.cond(condition)?;
                self.script.expects.push(Expect { condition, text, span });
            }
            ItemKind::Output { format, file, every, when, items, along, at, options } => {
                let known = self.one_of("output", format, FORMATS);
                let items: Vec<_> = items.iter().map(|i| self.quantity(i)).collect();
                let along = along.as_ref().map(|(a, b)| Some((self.expr(a)?, self.expr(b)?)));
                let every = every.as_ref().map(|e| self.expr(e));
                let at: Option<Vec<_>> = at.iter().map(|x| self.expr(x)).collect();
                let options = self.options("output", options)?;
                let every = every.transpose_option()?;
                let (items, along) = (items.into_iter().collect::<Option<_>>()?, along.transpose_option()?);
                known?;
                let (format, file, when, at) = (format.clone(), file.clone(), when.clone(), at?);
                self.script.outputs.push(Output { format, file, every, when, items, along, at, options, span });
            }
            _ => {}
        }
        Some(())
    }
}
