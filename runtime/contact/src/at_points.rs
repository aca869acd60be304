//! The law of a term at its integration points: what it reads there and what it gives.
//!
//! Promises: points in the order of groups, entities and points of the rule; numbers of the law as it is written. A point
//! can be asked again with other numbers: without tractions, or with another past. Does not judge.

use nalgebra::{DMatrix, DVector, RowDVector};
use wfl_compiler::{
    Projection, ProjectionKind, interpret_lanes,
    ir::LANES,
    types::{BasisSlot, InputSlot, Side},
};
use wfl_discrete::{
    assemble::{Bound, FieldValues, Workspace},
    system::{System, TermBranches},
};

use super::{
    ContactTerm,
    regularisation::AS_WRITTEN,
    slopes::{is_displacement, is_traction},
};

/// Singular values below this part of the largest slope are zero: slopes are differences or products of a few numbers,
/// known to some hundred roundoffs.
const NO_SLOPE: f64 = 1e-9;

/// What a displacement may miss of the part of an argument that it is to give: slopes are known to half of the digits.
const MISSED: f64 = 1e-7;

/// A point at one state.
pub(super) struct Point {
    /// What the law of the projections reads.
    pub(super) inputs: Vec<f64>,
    /// What it gives.
    pub(super) outputs: Vec<f64>,
}

/// The displacements that an argument of n entries depends on, and the smallest change of them that gives a change of it.
pub(super) struct Motions {
    /// The inputs of the law that are displacements of either side.
    pub(super) inputs: Vec<usize>,
    /// The slope of the argument in them: a row by entry, a column by input.
    pub(super) slope: DMatrix<f64>,
    /// Its Moore-Penrose inverse.
    pub(super) inverse: DMatrix<f64>,
}

impl ContactTerm {
    /// What the law reads and gives at every point.
    pub(super) fn points_at(&self, system: &System, values: FieldValues<'_>) -> Vec<Point> {
        let data = self.as_written_near(system, values, AS_WRITTEN);
        self.points_on(system, values, &data, self.law.uniforms())
    }

    /// The same on given branches, with given numbers of the step.
    pub(super) fn points_on(
        &self,
        system: &System,
        values: FieldValues<'_>,
        data: &TermBranches,
        uniforms: &[f64],
    ) -> Vec<Point> {
        let mut current: Vec<&[f64]> = values.current.to_vec();
        data.stand_in(self.field, &mut current);
        let values = FieldValues { current: &current, ..values };
        let law = &self.law.law;
        let (n_in, n_out) = (law.inputs.len(), law.kernel.kernel().outputs.len());
        let sampled = self.sampled.at(&system.mesh, values.current);
        let bound = Bound { mesh: &system.mesh, domain: &sampled.domain, binding: &sampled.binding };
        let (mut workspace, mut scratch, mut all) = (Workspace::default(), Vec::new(), Vec::new());
        for (g, group) in sampled.domain.groups.iter().enumerate() {
            for batch in 0..group.n_batches() {
                workspace.prepare(bound, g, batch, values);
                let inputs = workspace.inputs.as_chunks::<LANES>().0;
                let mut outputs = vec![[0.0; LANES]; group.n_points() * n_out];
                for q in 0..group.n_points() {
                    let out = &mut outputs[q * n_out..][..n_out];
                    interpret_lanes(&law.kernel, uniforms, &inputs[q * n_in..], &mut scratch, out);
                }
                for lane in 0..LANES.min(group.entities.len() - batch * LANES) {
                    let own = |all: &[[f64; LANES]]| all.iter().map(|values| values[lane]).collect();
                    all.extend((0..group.n_points()).map(|q| Point {
                        inputs: own(&inputs[q * n_in..][..n_in]),
                        outputs: own(&outputs[q * n_out..][..n_out]),
                    }));
                }
            }
        }
        all
    }

    /// What the law gives for other inputs at a point.
    pub(super) fn outputs_of(&self, inputs: &[f64], uniforms: &[f64]) -> Vec<f64> {
        let law = &self.law.law;
        let mut out = vec![[0.0; 1]; law.kernel.kernel().outputs.len()];
        interpret_lanes(&law.kernel, uniforms, inputs.as_chunks::<1>().0, &mut Vec::new(), &mut out);
        out.as_flattened().to_vec()
    }

    /// The same inputs without gradients and multipliers: of an argument the gap or the slip is left, times its slope.
    pub(super) fn without_tractions(&self, system: &System, inputs: &[f64]) -> Vec<f64> {
        let slots = inputs.iter().zip(&self.law.law.inputs);
        slots.map(|(x, slot)| if is_traction(&system.fields, slot) { 0.0 } else { *x }).collect()
    }

    /// The displacements behind the argument of a projection at a point that reads `inputs`; `None` where it depends on
    /// none.
    pub(super) fn motions_at(&self, system: &System, projection: usize, n: usize, inputs: &[f64]) -> Option<Motions> {
        let slots = &self.law.law.inputs;
        let moves = |slot: &InputSlot| matches!(slot, InputSlot::Field(b) if is_displacement(&system.fields, b));
        let at: Vec<usize> = (0..slots.len()).filter(|s| moves(&slots[*s])).collect();
        let values = self.slopes.at_point(inputs);
        let slope = self.slope_in(projection, n, &at, &values);
        let scale = if slope.is_empty() { 0.0 } else { slope.amax() };
        if scale == 0.0 || !slope.iter().all(|x| x.is_finite()) {
            return None;
        }
        let inverse = slope.clone().pseudo_inverse(NO_SLOPE * scale).ok()?;
        Some(Motions { inputs: at, slope, inverse })
    }

    /// The slope of the argument of a projection in some inputs of the law, from the values of all slopes at a point: a row by
    /// entry, a column by input.
    fn slope_in(&self, projection: usize, n: usize, inputs: &[usize], values: &[f64]) -> DMatrix<f64> {
        let slots = &self.law.law.inputs;
        let mut slope = DMatrix::zeros(n, inputs.len());
        for (value, s) in self.slopes.of_projection(projection) {
            if let Some(column) = inputs.iter().position(|k| slots[*k] == InputSlot::Field(s.slot)) {
                slope[(s.entry, column)] = values[value];
            }
        }
        slope
    }

    /// The smallest displacement that gives a part of the argument of a ball, leaves the gaps of the half lines that act, and
    /// moves nothing but what `counts`; by input of `motions`. Where there is none, gaps move, too, and then all.
    pub(super) fn way(&self, motions: &Motions, point: &Point, part: &[f64], counts: &[bool]) -> DVector<f64> {
        let part = DVector::from_column_slice(part);
        let mut own = motions.slope.clone();
        (0..counts.len()).filter(|k| !counts[*k]).for_each(|k| own.column_mut(k).fill(0.0));
        let values = self.slopes.at_point(&point.inputs);
        let is_gap = |p: &Projection| p.kind == ProjectionKind::HalfLine && p.n == 1 && p.acts;
        let gaps = self.projections.iter().enumerate().filter(|(_, p)| is_gap(p));
        let mut rows: Vec<RowDVector<f64>> = own.row_iter().map(|row| row.clone_owned()).collect();
        let scale = own.amax();
        for (k, _) in gaps {
            let row = self.slope_in(k, 1, &motions.inputs, &values).row(0).clone_owned();
            // all rows in one size: what is small beside the others counts as none
            rows.extend(
                Some(row.amax()).filter(|size| *size > 0.0 && size.is_finite()).map(|size| row * (scale / size)),
            );
        }
        let with_gaps = DMatrix::from_rows(&rows);
        for slopes in [with_gaps, own] {
            let mut wanted = DVector::zeros(slopes.nrows());
            wanted.rows_mut(0, part.len()).copy_from(&part);
            let mut way = smallest(slopes, wanted, NO_SLOPE * scale);
            (0..counts.len()).filter(|k| !counts[*k]).for_each(|k| way[k] = 0.0);
            if (&motions.slope * &way - &part).norm() <= MISSED * part.norm() {
                return way;
            }
        }
        &motions.inverse * part
    }

    /// The smallest displacement of the near side that gives a part `x0` of the argument of a projection; of the far
    /// side where the argument knows that alone.
    pub(super) fn motion(&self, system: &System, projection: usize, x0: &[f64], slopes: &[f64]) -> Option<[f64; 3]> {
        let of_side = |side: Side| {
            let own = self.slopes.of_projection(projection).filter(|(_, s)| s.slot.side == side);
            own.filter(|(_, s)| is_displacement(&system.fields, &s.slot)).collect::<Vec<_>>()
        };
        let (here, there) = (of_side(Side::Here), of_side(Side::There));
        let (own, sign) = if here.is_empty() { (there, -1.0) } else { (here, 1.0) };
        let field = own.first()?.1.slot.field;
        let mut matrix = DMatrix::zeros(x0.len(), 3);
        for (at, slope) in own.iter().filter(|(_, s)| s.slot.field == field) {
            matrix[(slope.entry, usize::from(slope.slot.entry))] = slopes[*at];
        }
        let scale = matrix.amax();
        if scale == 0.0 || !scale.is_finite() {
            return None;
        }
        let inverse = matrix.pseudo_inverse(NO_SLOPE * scale).ok()?;
        let moved = inverse * DMatrix::from_column_slice(x0.len(), 1, x0);
        Some([sign * moved[0], sign * moved[1], sign * moved[2]])
    }

    /// The input of the present value of a displacement whose past the slot reads.
    pub(super) fn present_of(&self, past: &BasisSlot) -> Option<usize> {
        self.law.law.inputs.iter().position(|slot| *slot == InputSlot::Field(*past))
    }
}
/// The smallest x with `A x = b`, row by row with the largest that is left first (Gram and Schmidt's method); what is left of
/// a row below `nothing` follows from the others.
fn smallest(mut a: DMatrix<f64>, mut b: DVector<f64>, nothing: f64) -> DVector<f64> {
    let mut x = DVector::zeros(a.ncols());
    for _ in 0..a.nrows() {
        let sizes = a.row_iter().map(|row| row.norm()).enumerate();
        let Some((own, size)) = sizes.max_by(|p, q| p.1.total_cmp(&q.1)).filter(|(_, size)| *size > nothing) else {
            break;
        };
        let (direction, part) = (a.row(own) / size, b[own] / size);
        x += direction.transpose() * part;
        for other in 0..a.nrows() {
            let along = a.row(other).dot(&direction);
            a.row_mut(other).iter_mut().zip(direction.iter()).for_each(|(entry, d)| *entry -= along * d);
            b[other] -= along * part;
        }
        a.row_mut(own).fill(0.0);
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_solution_is_that_of_the_pseudo_inverse() {
        // the tangential part of a jump: three rows of rank two
        let normal = [0.6, 0.0, 0.8];
        let entry = |i: usize, j: usize| {
            let (same, side) = (f64::from(u8::from(i == j % 3)), if j < 3 { 1.0 } else { -1.0 });
            side * (same - normal[i] * normal[j % 3])
        };
        let a = DMatrix::from_fn(3, 6, entry);
        let b = &a * DVector::from_column_slice(&[1.0, 2.0, 3.0, -0.5, 0.25, 4.0]);
        let found = smallest(a.clone(), b.clone(), 1e-12);
        let expected = a.clone().pseudo_inverse(1e-12).unwrap() * &b;
        assert!((&found - expected).norm() < 1e-14, "{found}");
        assert!((a * found - b).norm() < 1e-14);
    }
}
