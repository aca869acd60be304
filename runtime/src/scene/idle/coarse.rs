//! Multipliers of lower degree than what they act on: at a node where the jump is prescribed the jumps beside it, between
//! the nodes of the multiplier, may still determine it. Linear multipliers of quadratic displacements do so wherever two
//! faces meet: dropped at the ends of a surface they would leave jumps free beside it.
//!
//! Promises: a direction is determined here only if it is in the whole system; what lies further away than the faces
//! beside those of a node can add to that, and is not looked at.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::DMatrix;
use wfl_compiler::types::FieldKind;

use super::{
    Candidate, entry,
    vectors::{dot, null_space},
};
use crate::{
    contact::has_multiplier,
    csr::Csr,
    field::FieldSpace,
    system::{FIXED, System},
};

/// A row depends on others if the square of what it has beyond them is below this part of its own: sums of squares have
/// rounding of 1e-16, and the root of that is what a row that depends on others has left.
const DEPENDENT: f64 = 1e-8;

/// Rows of multipliers beyond which a patch does not grow: some hundred are the whole of a narrow surface, where a row may
/// be determined from far away, and are compared with each other in milliseconds.
const MOST_ROWS: usize = 300;

/// The faces around a node and some rings of faces around those: the rows of all multipliers there, and the displacements
/// that no other row reads.
struct Patch {
    rows: Vec<usize>,
    columns: Vec<usize>,
}

/// What terms with multipliers couple, by entity.
pub(super) struct Entities {
    dofs: Vec<BTreeSet<usize>>,
    /// The entities that have a dof.
    having: BTreeMap<usize, Vec<usize>>,
    /// The dofs of multipliers.
    multipliers: Vec<std::ops::Range<usize>>,
}

impl Entities {
    pub(super) fn new(system: &System) -> Self {
        let of_kind = |k: &usize| system.fields[*k].kind == FieldKind::Multiplier;
        let multipliers = (0..system.fields.len()).filter(of_kind).filter_map(|k| system.range(k)).collect();
        let mut this = Self { dofs: Vec::new(), having: BTreeMap::new(), multipliers };
        for term in system.terms.iter().filter(|t| has_multiplier(system, t)) {
            term.for_each_entity(|tests, trials| {
                let dofs: BTreeSet<usize> = tests.iter().chain(trials).map(|d| *d as usize).collect();
                for dof in &dofs {
                    this.having.entry(*dof).or_default().push(this.dofs.len());
                }
                this.dofs.push(dofs);
            });
        }
        this
    }

    /// The entities with some of these dofs.
    fn around(&self, dofs: impl Iterator<Item = usize>) -> BTreeSet<usize> {
        dofs.filter_map(|d| self.having.get(&d)).flatten().copied().collect()
    }

    /// All dofs of entities.
    fn dofs_of(&self, entities: &BTreeSet<usize>) -> BTreeSet<usize> {
        entities.iter().flat_map(|e| self.dofs[*e].iter().copied()).collect()
    }

    fn is_multiplier(&self, dof: usize) -> bool {
        self.multipliers.iter().any(|range| range.contains(&dof))
    }

    /// The rows of all multipliers.
    pub(super) fn rows(&self) -> impl Iterator<Item = usize> {
        self.multipliers.iter().flat_map(Clone::clone)
    }

    /// The rows among some dofs, and the displacements that they alone read.
    fn patch(&self, system: &System, dofs: &BTreeSet<usize>) -> Patch {
        let (rows, others): (BTreeSet<usize>, BTreeSet<usize>) = dofs.iter().partition(|d| self.is_multiplier(**d));
        let is_whole = |d: &usize| {
            let read = self.dofs_of(&self.around(std::iter::once(*d)));
            read.into_iter().all(|r| !self.is_multiplier(r) || rows.contains(&r))
        };
        let is_free = |d: &usize| system.numbering.free[*d] != FIXED;
        let columns = others.into_iter().filter(is_free).filter(is_whole).collect();
        Patch { rows: rows.into_iter().collect(), columns }
    }

    /// Whether displacements determine a direction of the multiplier at a candidate.
    pub(super) fn determine(
        &self,
        system: &System,
        on: &Tangents<'_>,
        candidate: &Candidate,
        direction: &[f64],
    ) -> bool {
        let n = direction.len();
        let own = candidate.first..candidate.first + n;
        let along = |v: &[f64]| -> Row { own.clone().zip(v.iter().copied()).collect() };
        // the other directions of the node are rows, too
        let beside: Vec<Row> = null_space(n, &[direction.to_vec()]).iter().map(|v| along(v)).collect();
        let of = |row: usize| (!own.contains(&row)).then(|| vec![(row, 1.0)]);
        self.are_independent(system, on, &Rows { own: along(direction), beside, of: &of })
    }

    /// Whether the row of a leader is determined with those that follow it, by leader.
    pub(super) fn can_lead(
        &self,
        system: &System,
        on: &Tangents<'_>,
        leader: usize,
        followers: &BTreeMap<usize, Vec<usize>>,
    ) -> bool {
        let with_followers = |row: usize| -> Row {
            let following = followers.get(&row).into_iter().flatten();
            std::iter::once(&row).chain(following).map(|dof| (*dof, 1.0)).collect()
        };
        let of = |row: usize| (row != leader).then(|| with_followers(row));
        self.are_independent(system, on, &Rows { own: with_followers(leader), beside: Vec::new(), of: &of })
    }

    /// Whether a row does not follow from others, in the smallest patch around it that shows it.
    fn are_independent(&self, system: &System, on: &Tangents<'_>, rows: &Rows<'_>) -> bool {
        let mut within = self.dofs_of(&self.around(rows.own.iter().map(|(dof, _)| *dof)));
        loop {
            let grown = self.dofs_of(&self.around(within.iter().copied()));
            let patch = self.patch(system, &grown);
            if patch.determines(system, on, rows) {
                return true;
            }
            if grown.len() == within.len() || patch.rows.len() > MOST_ROWS {
                return false;
            }
            within = grown;
        }
    }
}

/// A sum of rows of multipliers: by dof its factor.
type Row = Vec<(usize, f64)>;

/// What is asked of a patch.
struct Rows<'a> {
    /// Whether this row follows from the others.
    own: Row,
    /// Others at its node.
    beside: Vec<Row>,
    /// The row that a dof of a patch stands for, if it is another one.
    of: &'a dyn Fn(usize) -> Option<Row>,
}

/// True of a multiplier with a lower degree than a displacement at its node, inside a surface.
pub(super) fn is_coarse(system: &System, candidate: &Candidate) -> bool {
    let degree = |field: usize| match &system.fields[field].space {
        FieldSpace::Nodal(space) => Some(space.degree()),
        _ => None,
    };
    let on = candidate.place.iter().map(|dof| system.numbering.describe(&system.fields, *dof).0);
    !candidate.joined && on.filter_map(degree).max() > degree(candidate.field)
}

/// Tangents of sticking contact.
pub(super) struct Tangents<'a> {
    pub(super) matrices: &'a [Csr],
    /// Their rows by dof.
    pub(super) numbers: &'a [u32],
    /// What they couple, where a multiplier is coarse.
    pub(super) entities: Option<&'a Entities>,
    /// Multipliers that are known to be idle.
    pub(super) idle: BTreeSet<usize>,
}

impl Patch {
    /// Whether the displacements here determine a row: it does not follow from the others that are not idle, in the
    /// equations and in the forces of every tangent that has it.
    fn determines(&self, system: &System, on: &Tangents<'_>, rows: &Rows<'_>) -> bool {
        let mut found = false;
        for matrix in on.matrices {
            let equations =
                |row: usize, column: usize| along_axes(system, column, |dof| entry(matrix, on.numbers, row, dof));
            let forces =
                |row: usize, column: usize| along_axes(system, column, |dof| entry(matrix, on.numbers, dof, row));
            for coupling in [&equations as &dyn Fn(usize, usize) -> f64, &forces] {
                match self.is_independent(coupling, &on.idle, rows) {
                    Some(true) => found = true,
                    Some(false) => return false,
                    None => {}
                }
            }
        }
        found
    }

    /// The same of one matrix; `None` if nothing couples the row there.
    fn is_independent(
        &self,
        coupling: &dyn Fn(usize, usize) -> f64,
        idle: &BTreeSet<usize>,
        rows: &Rows<'_>,
    ) -> Option<bool> {
        let values = |row: &Row| -> Vec<f64> {
            let at = |c: &usize| row.iter().map(|(dof, factor)| factor * coupling(*dof, *c)).sum();
            self.columns.iter().map(at).collect()
        };
        let others = self.rows.iter().filter(|row| !idle.contains(*row)).filter_map(|row| (rows.of)(*row));
        let mut all: Vec<Vec<f64>> = others.chain(rows.beside.iter().cloned()).map(|row| values(&row)).collect();
        all.push(values(&rows.own));
        // units of the columns differ
        for c in 0..self.columns.len() {
            let largest = all.iter().fold(0.0f64, |m, row| m.max(row[c].abs()));
            if largest > 0.0 {
                all.iter_mut().for_each(|row| row[c] /= largest);
            }
        }
        has_part_of_its_own(&all)
    }
}

/// The value of a displacement along the axis that its dof stands for, of values by component.
fn along_axes(system: &System, dof: usize, value: impl Fn(usize) -> f64) -> f64 {
    match system.numbering.frames.of(dof) {
        Some(frame) => frame.axes[dof - frame.first].iter().zip(frame.first..).map(|(part, d)| part * value(d)).sum(),
        None => value(dof),
    }
}

/// Whether the last of some rows has a part that is orthogonal to all others; `None` if it is zero. By elimination in the
/// products of the rows, past those that depend on earlier ones.
fn has_part_of_its_own(rows: &[Vec<f64>]) -> Option<bool> {
    let n = rows.len();
    let mut products = DMatrix::from_fn(n, n, |i, j| dot(&rows[i], &rows[j]));
    let sizes: Vec<f64> = products.diagonal().iter().copied().collect();
    if sizes[n - 1] <= 0.0 {
        return None;
    }
    for k in 0..n - 1 {
        let pivot = products[(k, k)];
        if pivot <= DEPENDENT * sizes[k] {
            continue;
        }
        for i in k + 1..n {
            let factor = products[(i, k)] / pivot;
            for j in k + 1..n {
                products[(i, j)] -= factor * products[(k, j)];
            }
        }
    }
    Some(products[(n - 1, n - 1)] > DEPENDENT * sizes[n - 1])
}

#[cfg(test)]
mod tests {
    use super::has_part_of_its_own;

    #[test]
    fn a_row_depends_on_others_or_does_not() {
        let third = vec![1.0, 1.0, 2.0];
        assert_eq!(has_part_of_its_own(&[vec![1.0, 0.0, 1.0], vec![0.0, 1.0, 1.0], third.clone()]), Some(false));
        assert_eq!(has_part_of_its_own(&[vec![1.0, 0.0, 1.0], vec![0.0, 1.0, 0.9], third.clone()]), Some(true));
        // the first two are one row
        assert_eq!(has_part_of_its_own(&[vec![1.0, 0.0, 1.0], vec![2.0, 0.0, 2.0], third]), Some(true));
        assert_eq!(has_part_of_its_own(&[vec![1.0, 0.0], vec![0.0, 0.0]]), None);
    }
}
