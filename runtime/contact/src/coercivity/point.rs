//! Nitsche's form at one point of a facet: what gradients take of it, and how it is weighted.

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use wfl_compiler::{
    ProjectionKind, Real,
    types::{BasisSlot, FieldId, FieldOp, Side},
};

use super::{Entry, Probe, SAME};
use crate::slopes::is_displacement;
use wfl_discrete::field::Field;

/// Singular values of arguments below this part of the largest are rounding: products of a few numbers, known to some
/// hundred roundoffs.
const DEPENDENT: f64 = 1e-9;

/// The tangent of some terms at a point, by values and gradients of test and trial functions.
#[derive(Clone)]
struct Blocks {
    /// Forces by displacements.
    stiffness: DMatrix<f64>,
    /// Forces by gradients.
    force: DMatrix<f64>,
    /// What is tested with gradients, by displacements.
    facing: DMatrix<f64>,
    /// The same by gradients.
    own: DMatrix<f64>,
}

impl Blocks {
    fn new(entries: &[Entry], values: &[BasisSlot], gradients: &[BasisSlot]) -> Self {
        let (n, m) = (values.len(), gradients.len());
        let mut this = Self {
            stiffness: DMatrix::zeros(n, n),
            force: DMatrix::zeros(n, m),
            facing: DMatrix::zeros(m, n),
            own: DMatrix::zeros(m, m),
        };
        let value = |s: &BasisSlot| values.iter().position(|v| v == s);
        let gradient = |s: &BasisSlot| gradients.iter().position(|g| g == s);
        for ((a, b), x) in entries {
            let x = x.to_f64();
            match (value(a), value(b), gradient(a), gradient(b)) {
                (Some(i), Some(j), ..) => this.stiffness[(i, j)] += x,
                (Some(i), _, _, Some(j)) => this.force[(i, j)] += x,
                (_, Some(j), Some(i), _) => this.facing[(i, j)] += x,
                (_, _, Some(i), Some(j)) => this.own[(i, j)] += x,
                _ => {}
            }
        }
        this
    }
}

/// The laws of a term, and of the linear terms beside it, at a point.
#[derive(Clone)]
pub(super) struct PointLaw {
    linear: Blocks,
    /// Where it is closed and sticks.
    closed: Blocks,
    values: Vec<BasisSlot>,
    /// Arguments by displacements, and by gradients: the whole traction, along the normal from half lines, across it from
    /// balls.
    gaps: DMatrix<f64>,
    pub(super) stresses: DMatrix<f64>,
    /// The row of the half line, and the first row and number of rows of each projection.
    normal: Option<usize>,
    rows: Vec<(usize, usize)>,
    /// There is a gap that could close.
    closes: bool,
}

impl PointLaw {
    /// From the tangents of the linear terms and of the contact term, and the derivatives of the arguments.
    pub(super) fn new(probe: &Probe<'_>, entries: &[Vec<Entry>; 2], slopes: &[f64]) -> Self {
        let gradients = probe.gradient_slots();
        let mut values: Vec<BasisSlot> = Vec::new();
        for ((a, b), _) in entries.iter().flatten() {
            values.extend([a, b].into_iter().filter(|s| s.op == FieldOp::Value));
        }
        values.sort_unstable();
        values.dedup();
        let projections = &probe.term.projections;
        let mut rows = Vec::new();
        for p in projections {
            rows.push((rows.last().map_or(0, |(first, n)| first + n), p.n));
        }
        let n = rows.last().map_or(0, |(first, n)| first + n);
        let (mut gaps, mut stresses) = (DMatrix::zeros(n, values.len()), DMatrix::zeros(n, gradients.len()));
        for (slope, x) in probe.term.slopes.list().iter().zip(slopes) {
            let row = rows[slope.projection].0 + slope.entry;
            if let Some(column) = gradients.iter().position(|g| *g == slope.slot) {
                stresses[(row, column)] = *x;
            }
            if let Some(column) = values.iter().position(|v| *v == slope.slot) {
                gaps[(row, column)] = *x;
            }
        }
        let half = projections.iter().position(|p| p.kind == ProjectionKind::HalfLine && p.n == 1);
        let [linear, closed] = entries.each_ref().map(|list| Blocks::new(list, &values, &gradients));
        let normal = half.map(|half| rows[half].0);
        let closes = normal.is_none_or(|row| gaps.row(row).norm() > 0.0);
        Self { linear, closed, values, gaps, stresses, normal, rows, closes }
    }

    /// The law at a point where contact cannot close.
    pub(super) fn open(self) -> Self {
        Self { closes: false, ..self }
    }

    /// The force of the term in parts of that of its projections: a factor of all of it, such as the circumference in a body
    /// of revolution, or 1/2 in a form that has a term for each side.
    pub(super) fn weight(&self) -> f64 {
        let mut sides: BTreeMap<(FieldId, Side), f64> = BTreeMap::new();
        for (row, slot) in self.values.iter().enumerate() {
            let total = sides.entry((slot.field, slot.side)).or_default();
            *total = total.hypot(self.closed.force.row(row).norm());
        }
        let (force, stress) = (sides.into_values().fold(0.0, f64::max), self.stresses.norm());
        let weight = if stress > 0.0 { force / stress } else { 1.0 };
        if (weight - 1.0).abs() <= SAME { 1.0 } else { weight }
    }

    /// True if the force does not act along the gradient of the gap, as on a curved obstacle that is a formula of the
    /// displacement.
    fn is_tilted(&self) -> bool {
        let stiffness = &self.closed.stiffness;
        (stiffness - stiffness.transpose()).norm() > SAME * stiffness.norm()
    }

    /// The directions in which the arguments act, by columns.
    fn directions(&self) -> Option<DMatrix<f64>> {
        let (n, m) = (self.values.len(), self.stresses.ncols());
        let join = |a: &DMatrix<f64>, b: &DMatrix<f64>| {
            DMatrix::from_fn(a.nrows(), n + m, |i, j| if j < n { a[(i, j)] } else { b[(i, j - n)] })
        };
        let arguments = join(&self.gaps, &self.stresses);
        let size = arguments.amax();
        let inverse = arguments.pseudo_inverse(DEPENDENT * size).ok()?;
        Some(join(&self.closed.stiffness, &self.closed.force) * inverse)
    }

    /// The slope of the first half line in the displacement of one side, along the force that it gives.
    pub(super) fn slope(&self, probe: &Probe<'_>) -> Option<f64> {
        let normal = self.normal.filter(|_| self.closes)?;
        let directions = if self.is_tilted() { Some(self.directions()?) } else { None };
        let mut sides: BTreeMap<(FieldId, Side), [f64; 3]> = BTreeMap::new();
        for (column, slot) in self.values.iter().enumerate() {
            if is_displacement(&probe.system.fields, slot) {
                let [along, length, size] = sides.entry((slot.field, slot.side)).or_default();
                let x = self.gaps[(normal, column)];
                let direction = directions.as_ref().map_or(x, |d| d[(column, normal)]);
                *along += x * direction;
                *length = length.hypot(direction);
                *size = size.hypot(x);
            }
        }
        let of = |[along, length, size]: [f64; 3]| if directions.is_none() { size } else { along / length };
        sides.into_values().map(of).filter(|slope| *slope > 0.0).max_by(f64::total_cmp)
    }

    /// The displacements of the own side with the derivatives of the argument of the half line.
    pub(super) fn motion(&self, fields: &[Field]) -> Option<Vec<(BasisSlot, f64)>> {
        let normal = self.normal?;
        let own = self.values.iter().enumerate().filter(|(_, s)| s.side == Side::Here && is_displacement(fields, s));
        Some(own.map(|(column, slot)| (*slot, self.gaps[(normal, column)])).collect())
    }

    /// What gradients take of the form at most: N of the module. `None` where it is not finite.
    pub(super) fn lost(&self, closed: bool) -> Option<DMatrix<f64>> {
        let own = |blocks: &Blocks| 0.5 * (&blocks.own + blocks.own.transpose());
        let Some(stiffness) = closed.then(|| self.stiffness()).flatten() else { return Some(-own(&self.linear)) };
        let mut all = stiffness + &self.linear.stiffness;
        all = 0.5 * (&all + all.transpose());
        let mixed = &self.linear.force + &self.closed.force + (&self.linear.facing + &self.closed.facing).transpose();
        let own = own(&self.linear) + own(&self.closed);
        if all.nrows() == 0 {
            return Some(-own);
        }
        if [&all, &mixed, &own].into_iter().flatten().any(|x| !x.is_finite()) {
            return None;
        }
        let size = all.amax();
        let inverse = if size > 0.0 { all.pseudo_inverse(SAME * size).ok()? } else { all };
        Some(0.25 * mixed.transpose() * inverse * &mixed - own)
    }

    /// Forces by displacements where contact is closed; `None` where there is no gap that could close. Where the force does
    /// not act along the gradient of the gap, the part that does: the rest does no work on what it acts on.
    fn stiffness(&self) -> Option<DMatrix<f64>> {
        if !self.closes {
            return None;
        }
        if !self.is_tilted() {
            return Some(self.closed.stiffness.clone());
        }
        let directions = self.directions()?;
        let mut sum = DMatrix::zeros(self.values.len(), self.values.len());
        for (first, n) in &self.rows {
            let (acts, gaps) = (directions.columns(*first, *n).into_owned(), self.gaps.rows(*first, *n).into_owned());
            let size = acts.amax();
            if size == 0.0 {
                continue;
            }
            let inverse = acts.clone().pseudo_inverse(DEPENDENT * size).ok()?;
            if self.normal == Some(*first) && (&gaps * &acts)[(0, 0)] <= 0.0 {
                return None;
            }
            sum += &acts * gaps * &acts * inverse;
        }
        Some(sum)
    }
}
