//! Forces of the wrong sign, found on the terms alone before anything is solved.
//!
//! - An interface that drives its sides: one body is moved as a whole against the others, a little and both ways. The
//!   forces of a law that ties, presses or rubs do work against each motion that they meet, or none; where they do work
//!   with every one of them, the law gives back energy instead of storing it: its test function, or the jump in it, has
//!   the other side first.
//! - A load on a single number that nothing balances: whatever value the number takes, the terms in its equation push the
//!   way the load does.
//!
//! Promises: evaluates terms on faces at a handful of states; solves and assembles nothing. A law that can be evaluated at
//! none of them is not judged.

use wfl_compiler::{
    Class,
    types::{BasisSlot, FieldKind, FieldOp, InputSlot},
};
use wfl_discrete::assemble::AssembledTerm;
use wfl_discrete::field::FieldSpace;
use wfl_discrete::system::System;

/// Motion of a body, in parts of the extent of the mesh: small beside the displacements at which laws of interfaces turn.
const MOVED: f64 = 1e-8;
/// Work below this part of the largest one is rounding: of sums over an interface whose summands cancel.
const NONE: f64 = 1e-6;
/// Values of a number that are tried, in parts of the extent of the mesh: powers of ten from here to one, of both signs.
const LEAST_DECADE: i32 = -8;

/// A term on an interface whose forces drive the sides.
#[derive(Clone, Debug, PartialEq)]
pub struct DrivenSides {
    /// The name of the term.
    pub term: String,
    /// The body that was moved.
    pub field: String,
}

/// A load on a number that nothing balances.
#[derive(Clone, Debug, PartialEq)]
pub struct UnbalancedLoad {
    /// The field.
    pub field: String,
    /// The load: what constant terms give to its equation.
    pub load: f64,
    /// The other terms in that equation.
    pub terms: Vec<String>,
    /// The largest that they gave.
    pub largest: f64,
}

/// The largest edge of the box around the mesh.
fn extent(system: &System) -> f64 {
    let (low, high) = system.mesh.bounds();
    (0..3).fold(0.0f64, |m, d| m.max(high[d] - low[d]))
}

/// Interfaces whose forces drive their sides, at the state `u`; each term once.
#[must_use]
pub fn driven_sides(system: &System, u: &[f64]) -> Vec<DrivenSides> {
    let dim = system.mesh.dim();
    // what no cell knows of is no body, a traction that is declared as an unknown on the faces; but one vector for the scene
    // is a rigid one
    let moves_cells = |k: usize| {
        let tests = |t: &AssembledTerm| t.on_cells() && t.law.tests.iter().any(|s| s.field.index() == k);
        matches!(system.fields[k].space, FieldSpace::Global) || system.terms.iter().any(tests)
    };
    let is_body = |k: &usize| {
        let f = &system.fields[*k];
        f.kind == FieldKind::Unknown && f.n_components == dim && dim > 1 && !f.is_at_points() && moves_cells(*k)
    };
    let mut found = Vec::new();
    // a law that reads the traction of a body is judged with the other terms of its region (W507 to W510)
    let reads_gradients = |t: &AssembledTerm| {
        let of_body = |b: &BasisSlot| is_body(&b.field.index()) && b.op != FieldOp::Value;
        t.law.inputs.iter().any(|slot| matches!(slot, InputSlot::Field(b) if of_body(b)))
            || t.law.tests.iter().any(of_body)
    };
    for term in system.terms.iter().filter(|t| !t.on_cells() && t.law.class > Class::Constant && !reads_gradients(t)) {
        let mut bodies: Vec<usize> = term.law.tests.iter().map(|s| s.field.index()).filter(is_body).collect();
        bodies.sort_unstable();
        bodies.dedup();
        if bodies.len() < 2 {
            continue;
        }
        let driven = bodies.iter().find(|k| drives(system, term, **k, u) == Some(true));
        found
            .extend(driven.map(|k| DrivenSides { term: term.law.name.clone(), field: system.fields[*k].name.clone() }));
    }
    found
}

/// Whether the forces of a term do work with every motion of a body, as a whole, that they meet. `None` where there is no
/// such motion, or where the law has no finite value.
fn drives(system: &System, term: &AssembledTerm, field: usize, u: &[f64]) -> Option<bool> {
    let (dim, step) = (system.mesh.dim(), MOVED * extent(system));
    let range = system.range(field)?;
    let forces = |u: &[f64]| {
        let mut out = vec![0.0; u.len()];
        system.residual_of(term, u, &mut out).ok().map(|()| out)
    };
    let start = forces(u)?;
    let mut works = Vec::new();
    for (d, sign) in (0..dim).flat_map(|d| [(d, 1.0), (d, -1.0)]) {
        let mut moved = u.to_vec();
        range.clone().skip(d).step_by(dim).for_each(|dof| moved[dof] += sign * step);
        let end = forces(&moved)?;
        let own = range.clone().skip(d).step_by(dim);
        // what resists a motion is positive in a residual
        works.push(system.team().total(own.map(|dof| sign * (end[dof] - start[dof])).sum()));
    }
    let largest = works.iter().fold(0.0f64, |m, w| m.max(w.abs()));
    let met: Vec<f64> = works.into_iter().filter(|w| w.abs() > NONE * largest).collect();
    (!met.is_empty()).then(|| met.iter().all(|w| *w < 0.0))
}

/// Loads on numbers of the whole scene that nothing balances, at the state `u` but for these numbers.
#[must_use]
pub fn unbalanced_loads(system: &System, u: &[f64]) -> Vec<UnbalancedLoad> {
    let is_number = |k: &usize| {
        let f = &system.fields[*k];
        f.kind == FieldKind::Unknown && f.n_components == 1 && matches!(f.space, FieldSpace::Global)
    };
    (0..system.fields.len()).filter(is_number).filter_map(|k| unbalanced(system, k, u)).collect()
}

fn unbalanced(system: &System, field: usize, u: &[f64]) -> Option<UnbalancedLoad> {
    let dof = system.range(field)?.next()?;
    let tests = |t: &&AssembledTerm| t.law.tests.iter().any(|s| s.field.index() == field);
    let (loads, others): (Vec<&AssembledTerm>, Vec<&AssembledTerm>) =
        system.terms.iter().filter(tests).partition(|t| t.law.class == Class::Constant);
    let total = |terms: &[&AssembledTerm], u: &[f64]| {
        let mut out = vec![0.0; u.len()];
        terms.iter().try_for_each(|t| system.residual_of(t, u, &mut out)).ok()?;
        Some(system.team().total(out[dof]))
    };
    let load = total(&loads, u)?;
    if load == 0.0 || others.is_empty() || others.iter().any(|t| t.law.class < Class::Nonlinear) {
        return None;
    }
    let extent = extent(system);
    let (mut moved, mut largest) = (u.to_vec(), 0.0f64);
    let decades = (LEAST_DECADE..=0).flat_map(|k| [10f64.powi(k), -(10f64.powi(k))]);
    for part in decades.chain([0.0]) {
        moved[dof] = u[dof] + part * extent;
        let given = total(&others, &moved)?;
        if given * load < 0.0 {
            return None;
        }
        largest = if given.abs() > largest.abs() { given } else { largest };
    }
    let terms = others.iter().map(|t| t.law.name.clone()).collect();
    (largest != 0.0).then(|| UnbalancedLoad { field: system.fields[field].name.clone(), load, terms, largest })
}
