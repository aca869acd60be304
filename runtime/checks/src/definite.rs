//! Whether bodies resist to be deformed: the tangents of the terms on cells, gradients of a field against gradients of its
//! own, at points.
//!
//! At a point the terms of one field give a symmetric matrix over the entries of its gradient; that of a body has no negative
//! eigenvalue. Values of the field itself are left out (a mass or a reaction may have any sign), and so are terms on faces. A
//! field that shares terms on cells with another unknown (a pressure, a stress) may be negative as a whole: then the equations
//! are those of a saddle point. Cells are sampled. Sees no mistake that a null Lagrangian hides.

use std::cell::LazyCell;

use nalgebra::{DMatrix, SymmetricEigen};
use wfl_compiler::{
    Class,
    types::{BasisSlot, FieldKind, FieldOp},
};

use crate::worst::Finding;
use wfl_discrete::assemble::{AssembledTerm, FieldValues, PointTangent};
use wfl_discrete::system::System;
use wfl_mesh::mesh::CellId;

/// Cells of each term that are looked at, spread evenly over it: a law is one formula, its coefficients vary in space.
const CELLS: usize = 16;
/// An eigenvalue below minus this part of the largest is negative: what is smaller may be rounding of parameters.
const NEGATIVE: f64 = 1e-9;

/// A stress gives a turn at most three times its largest entry as a negative stiffness: a symmetric matrix of three
/// rows has no eigenvalue beyond three times its largest entry.
const STRESSED: f64 = 3.0;

/// A field whose terms on cells are not positive definite.
#[derive(Clone, Debug, PartialEq)]
pub struct NegativeBody {
    /// The field.
    pub field: String,
    /// The terms that act there, by name.
    pub terms: Vec<String>,
    /// The smallest eigenvalue (force by gradient and volume).
    pub smallest: f64,
    /// The largest one.
    pub largest: f64,
    /// Where.
    pub position: [f64; 3],
}

/// The fields whose terms on cells are not positive definite at the state without displacement, each with the most
/// negative point that was looked at; its laws at a step.
#[must_use]
pub fn negative_bodies(system: &System) -> Vec<NegativeBody> {
    let zero = vec![0.0; system.numbering.n_dofs];
    let bodies = Bodies { system };
    let values = system.values(&zero);
    let unknown = |k: &usize| system.fields[*k].kind == FieldKind::Unknown && system.range(*k).is_some();
    let all = (0..system.fields.len()).filter(unknown);
    all.filter_map(|k| bodies.negative_body(k, values.view())).collect()
}

/// The terms on cells of a system.
struct Bodies<'a> {
    system: &'a System,
}

impl Bodies<'_> {
    fn negative_body(&self, field: usize, values: FieldValues<'_>) -> Option<NegativeBody> {
        let terms = stiff_terms(self.system, field);
        if terms.iter().any(|t| !t.law.symmetric) {
            return None;
        }
        let mixed = |(t, s): (BasisSlot, BasisSlot)| (t.field.index() == field) != (s.field.index() == field);
        let saddle = self.system.terms.iter().filter(acts_on_cells).any(|t| pairs(t).any(mixed));
        let initial_stress = LazyCell::new(|| self.initial_stress(field, &terms, values));
        let mut worst: Option<NegativeBody> = None;
        for cell in terms.iter().flat_map(|t| sampled_cells(self.system, t)).collect::<Vec<_>>() {
            let Some(found) = self.at_cell(field, &terms, cell, values, &|| *initial_stress) else { continue };
            let negative = is_negative(found.smallest, found.largest);
            let whole = found.largest <= NEGATIVE * found.smallest.abs();
            let excused = saddle && whole;
            if negative && !excused && worst.as_ref().is_none_or(|w| found.smallest < w.smallest) {
                worst = Some(found);
            }
        }
        let own = worst.map(|NegativeBody { terms, smallest, largest, position: [x, y, z], .. }| Finding {
            size: -smallest,
            numbers: vec![smallest, largest, x, y, z],
            names: terms,
        });
        let Finding { numbers, names, .. } = Finding::worst(own, self.system.team())?;
        let [smallest, largest, x, y, z] = numbers.try_into().ok()?;
        let field = self.system.fields[field].name.clone();
        Some(NegativeBody { field, terms: names, smallest, largest, position: [x, y, z] })
    }

    /// The largest stress of the bodies where nothing has moved; zero where the field is no displacement.
    fn initial_stress(&self, field: usize, terms: &[&AssembledTerm], values: FieldValues<'_>) -> f64 {
        let mut largest = 0.0f64;
        if self.system.fields[field].n_components == self.system.mesh.dim() {
            for term in terms {
                let own = |slot: &BasisSlot| slot.field.index() == field && slot.op == FieldOp::Grad;
                term.for_each_flux(&self.system.mesh, values, |flux, _| {
                    let stress = term.law.tests.iter().zip(flux).filter(|(slot, _)| own(slot));
                    largest = stress.fold(largest, |m, (_, x)| m.max(x.abs()));
                });
            }
        }
        largest
    }

    /// The extreme eigenvalues at the first point of a cell.
    fn at_cell(
        &self,
        field: usize,
        terms: &[&AssembledTerm],
        cell: CellId,
        values: FieldValues<'_>,
        initial_stress: &dyn Fn() -> f64,
    ) -> Option<NegativeBody> {
        let PointStiffness { matrix, terms: names, position } = stiffness(self.system, field, terms, cell, values)?;
        let symmetric = 0.5 * (&matrix + matrix.transpose());
        let mut eigenvalues = SymmetricEigen::new(symmetric.clone()).eigenvalues;
        // a body of finite strain under pressure gains energy by a turn, as much as its stress: what counts is the strain
        if is_negative(eigenvalues.min(), eigenvalues.max()) && -eigenvalues.min() <= STRESSED * initial_stress() {
            eigenvalues = SymmetricEigen::new(of_strains(&symmetric, self.system.mesh.dim())).eigenvalues;
        }
        Some(NegativeBody {
            field: self.system.fields[field].name.clone(),
            terms: names,
            smallest: eigenvalues.min(),
            largest: eigenvalues.max(),
            position,
        })
    }
}

/// Whether an eigenvalue is negative beyond rounding.
fn is_negative(smallest: f64, largest: f64) -> bool {
    smallest < -NEGATIVE * largest.abs().max(smallest.abs())
}

/// A stiffness over gradients, of symmetric gradients alone: `S K S` with S the symmetric part.
fn of_strains(stiffness: &DMatrix<f64>, dim: usize) -> DMatrix<f64> {
    let n = stiffness.nrows();
    let turned = |k: usize| k / dim + dim * (k % dim);
    let symmetric =
        DMatrix::from_fn(n, n, |i, k| 0.5 * (f64::from(u8::from(i == k)) + f64::from(u8::from(i == turned(k)))));
    &symmetric * stiffness * &symmetric
}

/// The tangent of the terms of a field at a point, gradients against gradients.
pub(crate) struct PointStiffness {
    /// Over the entries of the gradient, the first index fastest (force by gradient and area).
    pub(crate) matrix: DMatrix<f64>,
    /// The terms that act there, by name.
    pub(crate) terms: Vec<String>,
    /// Where.
    pub(crate) position: [f64; 3],
}

/// The stiffness at the first point of a cell; `None` where it is not finite or no term acts.
pub(crate) fn stiffness(
    system: &System,
    field: usize,
    terms: &[&AssembledTerm],
    cell: CellId,
    values: FieldValues<'_>,
) -> Option<PointStiffness> {
    let n = system.fields[field].n_components * system.mesh.dim();
    let mut matrix = DMatrix::<f64>::zeros(n, n);
    let (mut names, mut position) = (Vec::new(), None);
    for term in terms {
        let Some(PointTangent { entries, position: at }) = term.point_tangent(&system.mesh, values, cell) else {
            continue;
        };
        names.push(term.law.name.clone());
        position.get_or_insert(at);
        for (test, trial, value) in entries.into_iter().filter(|(t, s, _)| is_stiffness(field, *t, *s)) {
            matrix[(usize::from(test.entry), usize::from(trial.entry))] += value;
        }
    }
    let position = position.filter(|_| matrix.iter().all(|x| x.is_finite()))?;
    Some(PointStiffness { matrix, terms: names, position })
}

/// The terms on cells that resist gradients of a field.
pub(crate) fn stiff_terms(system: &System, field: usize) -> Vec<&AssembledTerm> {
    let stiff = |t: &&AssembledTerm| pairs(t).any(|(t, s)| is_stiffness(field, t, s));
    system.terms.iter().filter(acts_on_cells).filter(stiff).collect()
}

fn acts_on_cells(term: &&AssembledTerm) -> bool {
    term.on_cells() && term.law.class > Class::Constant
}

/// The pairs of slots that the tangent of a term couples.
fn pairs(term: &AssembledTerm) -> impl Iterator<Item = (BasisSlot, BasisSlot)> + '_ {
    let law = &term.law;
    law.entries.iter().map(|(t, s)| (law.tests[usize::from(*t)], law.trials[usize::from(*s)]))
}

/// True for gradients of the field on both sides.
fn is_stiffness(field: usize, test: BasisSlot, trial: BasisSlot) -> bool {
    [test, trial].iter().all(|slot| slot.field.index() == field && slot.op == FieldOp::Grad)
}

/// Cells of a term, spread evenly over those of all ranks: those of them that this rank counts.
pub(crate) fn sampled_cells(system: &System, term: &AssembledTerm) -> Vec<CellId> {
    let domain = &term.integrator.domain;
    let places = domain.places(&system.mesh);
    let stride = places.iter().map(|p| p.n).sum::<usize>().div_ceil(CELLS).max(1);
    let cells = domain.groups.iter().zip(&places).flat_map(|(g, places)| {
        let cells = g.here.cells.iter().zip(&places.of);
        cells.filter_map(|(cell, place)| Some((*cell, places.before + (*place)?)))
    });
    cells.filter(|(_, place)| place % stride == 0).map(|(cell, _)| cell).collect()
}
