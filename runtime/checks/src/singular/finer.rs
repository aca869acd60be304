//! Motions that a quadrature rule does not see: the terms on cells again under finer rules.

use std::{collections::BTreeSet, sync::Arc};

use wfl_compiler::{Class, InterpreterBackend, backend::KernelBackend, types::InputSlot};

use crate::Examined;
use wfl_discrete::assemble::{AssembledTerm, Binding, Domain, Integrator, LawSlots, tangent_kernel};
use wfl_discrete::field::{Field, FieldSpace};
use wfl_discrete::point_space::PointSpace;
use wfl_discrete::system::System;
use wfl_mesh::mesh::{CellKind, RegionSet};
use wfl_mesh::quadrature::{Rule, rule, vertex};
use wfl_newton::Singular;

/// Energy above this part of what the same numbers without cancelling give is some: a null vector is found to eight digits,
/// which leaves less, and a soft mode of a true body more.
const SOME: f64 = 1e-6;
/// Energy at the points of a rule above this part of that is some, too: of a motion that strains nothing it is of the order
/// of a roundoff squared, 5e-32, since strains are rounded and energies are their squares.
const RESOLVED: f64 = 1e-26;
/// Size of the motion whose forces are differenced, in parts of the extent of the mesh: of a body that is not linear a
/// difference misses a part of this size, and rounding leaves twelve digits of it.
const STEP: f64 = 1e-4;

impl Examined<'_> {
    /// A null vector, by free number, that has energy under a finer rule than that of the terms.
    pub(super) fn unseen(&self, field: usize, vector: &[f64], u: &[f64]) -> Option<Singular> {
        let f = &self.system.fields[field];
        let on_it = |t: &&AssembledTerm| {
            t.on_cells() && t.law.class > Class::Constant && t.law.tests.iter().any(|s| s.field.index() == field)
        };
        let terms: Vec<&AssembledTerm> = self.system.terms.iter().filter(on_it).collect();
        let points = terms.iter().flat_map(|t| &t.integrator.domain.groups).map(|g| g.n_points()).max()?;
        for degree in 1..=2 * f.degree() + 2 {
            let finer: Option<Vec<AssembledTerm>> = terms.iter().map(|t| self.with_degree(t, degree)).collect();
            let finer = finer?;
            // a rule with fewer points may see this vector, and not see others
            if finer.iter().flat_map(|t| &t.integrator.domain.groups).any(|g| g.n_points() <= points) {
                continue;
            }
            if !self.has_energy(&finer, vector, u)? {
                continue;
            }
            let names: Vec<String> = terms.iter().map(|t| format!("`{}`", t.law.name)).collect();
            let (names, name) = (names.join(", "), &f.name);
            let dots = if points == 1 { "1 point".to_owned() } else { format!("{points} points") };
            return Some(Singular {
                what: format!("`{name}` has an hourglass mode: the quadrature rule is of too low degree"),
                notes: vec![format!(
                    "{names}: its strain is zero at the {dots} of each cell, but not at those of a rule of degree {degree}"
                )],
                help: format!("leave the `quadrature` statement of that region out, or raise it to degree {degree}"),
                name: name.clone(),
            });
        }
        None
    }

    /// Whether a null vector of one field, by free number, strains its cells: their terms are evaluated at their points, where
    /// the strain of a soft direction is resolved that is lost in the sums of a matrix. `None` where they are not linear.
    pub(super) fn resists_at_points(&self, field: usize, vector: &[f64]) -> Option<bool> {
        let on_it = |t: &&AssembledTerm| {
            t.on_cells() && t.law.class > Class::Constant && t.law.tests.iter().any(|s| s.field.index() == field)
        };
        let terms: Vec<&AssembledTerm> = self.system.terms.iter().filter(on_it).collect();
        if terms.is_empty() || terms.iter().any(|t| t.law.class != Class::Linear) {
            return None;
        }
        let (zero, n) = (vec![0.0; self.system.numbering.n_dofs], self.system.numbering.n_dofs);
        let mut moved = zero.clone();
        self.system.numbering.advance(&zero, vector, 1.0, &mut moved);
        let (mut here, mut there, mut diagonal) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let values = self.system.values(&zero);
        for term in terms {
            self.system.residual_of(term, &zero, &mut here).ok()?;
            self.system.residual_of(term, &moved, &mut there).ok()?;
            self.system.add_diagonal(term, values.view(), &mut diagonal);
        }
        let total = |entry: &dyn Fn(usize) -> f64| self.system.team().total((0..n).map(entry).sum());
        let energy = total(&|d| moved[d] * (there[d] - here[d]));
        Some(energy > RESOLVED * total(&|d| moved[d] * moved[d] * diagonal[d].abs()))
    }

    /// A term on cells under a rule of some degree, interpreted.
    fn with_degree(&self, term: &AssembledTerm, degree: usize) -> Option<AssembledTerm> {
        let cells = term.integrator.domain.groups.iter().flat_map(|g| g.here.cells.iter().copied()).collect();
        with_rule(self.system, term, &RegionSet::Cells(cells), degree)
    }

    /// True if a motion from `u` meets forces.
    fn has_energy(&self, terms: &[AssembledTerm], vector: &[f64], u: &[f64]) -> Option<bool> {
        let (low, high) = self.system.mesh.bounds();
        let extent = (0..3).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
        let largest = vector.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let step = STEP * extent / largest;
        let mut moved = u.to_vec();
        self.system.numbering.advance(u, vector, step, &mut moved);
        let (mut here, mut there) = (vec![0.0; u.len()], vec![0.0; u.len()]);
        let mut diagonal = vec![0.0; u.len()];
        for (state, out) in [(u, &mut here), (moved.as_slice(), &mut there)] {
            for term in terms {
                self.system.residual_of(term, state, out).ok()?;
            }
        }
        let values = self.system.values(u);
        let known = self.system.terms.iter().filter(|t| t.on_cells() && t.law.class > Class::Constant);
        known.for_each(|t| self.system.add_diagonal(t, values.view(), &mut diagonal));
        // in the rows of this rank: those of others are zero
        let (mut energy, mut scale) = (0.0, 0.0);
        for d in 0..u.len() {
            let motion = moved[d] - u[d];
            energy += motion * (there[d] - here[d]);
            scale += motion * motion * diagonal[d].abs();
        }
        let (energy, scale) = (self.system.team().total(energy), self.system.team().total(scale));
        Some(energy.abs() > SOME * scale)
    }
}

/// A term on a region under a rule of some degree, interpreted, at the step of the system. `None` where there is no such
/// rule, or where the term reads states, which have values at the points of their own rule alone.
pub(crate) fn with_rule(
    system: &System,
    term: &AssembledTerm,
    region: &RegionSet,
    degree: usize,
) -> Option<AssembledTerm> {
    let domain = under_rule(system, region, degree)?;
    interpreted(system, term, &system.fields, domain)
}

/// The same with the points of a rule.
pub(crate) fn with_points(
    system: &System,
    term: &AssembledTerm,
    region: &RegionSet,
    make: &dyn Fn(CellKind) -> Rule,
) -> Option<AssembledTerm> {
    let domain = Domain::new(&system.mesh, region, make).ok().map(Arc::new)?;
    interpreted(system, term, &system.fields, domain)
}

/// A term with states under another rule than theirs.
pub(crate) struct WithStates {
    /// The term.
    pub(crate) term: AssembledTerm,
    /// Its states, with their values at the points of the rule.
    pub(crate) states: Vec<(usize, Vec<f64>)>,
}

/// The same also for a term that reads states: at the points of the rule they have the value of the first point of their
/// own, which is that of all where they are as they start.
pub(crate) fn with_rule_and_states(
    system: &System,
    term: &AssembledTerm,
    region: &RegionSet,
    degree: usize,
) -> Option<WithStates> {
    let domain = under_rule(system, region, degree)?;
    let read = |slot: &InputSlot| match slot {
        InputSlot::Field(b) | InputSlot::Previous(b) | InputSlot::History(_, b) => Some(b.field.index()),
        _ => None,
    };
    let at_points = |k: &usize| system.fields.get(*k).is_some_and(Field::is_at_points);
    let states: BTreeSet<usize> = term.law.inputs.iter().filter_map(read).filter(at_points).collect();
    let mut fields = system.fields.to_vec();
    let mut values = Vec::new();
    for state in states {
        let points = PointSpace::new(&system.mesh, &domain);
        let first = system.data()[state].get(..fields[state].n_components)?;
        values.push((state, first.repeat(points.coordinates().len())));
        fields[state].space = FieldSpace::Points(points);
    }
    Some(WithStates { term: interpreted(system, term, &fields, domain)?, states: values })
}

fn under_rule(system: &System, region: &RegionSet, degree: usize) -> Option<Arc<Domain>> {
    let make = |kind| rule(kind, degree).unwrap_or_else(|_| vertex(kind));
    Domain::new(&system.mesh, region, &make).ok().map(Arc::new)
}

fn interpreted(system: &System, term: &AssembledTerm, fields: &[Field], domain: Arc<Domain>) -> Option<AssembledTerm> {
    let law = term.law.clone();
    let slots = LawSlots { inputs: &law.inputs, tests: &law.tests, trials: &law.trials };
    let binding = Binding::new(&system.mesh, &domain, fields, slots).ok()?;
    let residual = InterpreterBackend.compile(&[&law.residual]).ok()?.pop()?;
    let tangent = match tangent_kernel(&law) {
        Some(kernel) => Some(InterpreterBackend.compile(&[&kernel]).ok()?.pop()?),
        None => None,
    };
    let integrator = Integrator { domain, binding: Arc::new(binding) };
    let mut made = AssembledTerm::new(law, integrator, None, residual, tangent, &system.numbering.starts);
    made.set_step(system.with_present_rates(system.step()));
    Some(made)
}
