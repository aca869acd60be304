//! Rigid motions that the tangent does not resist: what a singular system lacks, in words of mechanics.
//!
//! A motion r of a body is loose if K r vanishes but for rounding, and r at what is fixed. The motions of a field are three translations and three rotations
//! (two and one in the plane), or a combination of them: small singular values of what these motions meet, taken from its
//! triangular factor, because squares would hide the small ones beside the large. Promises: looks at the last tangent only. Does not find mechanisms that are no rigid motions.

use std::fmt;

use nalgebra::DMatrix;
use wfl_compiler::types::FieldKind;

use super::{FIXED, System};
use crate::csr::residual_and_size;

/// A motion is loose if what it meets is below this part of what cancels in it.
const LOOSE: f64 = 1e-9;

/// The rigid motions in which some fields move without resistance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LooseMotions {
    /// The names of the fields that move.
    pub fields: Vec<String>,
    /// Translations among the motions.
    pub translations: usize,
    /// Motions that turn.
    pub rotations: usize,
}

impl fmt::Display for LooseMotions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<String> = self.fields.iter().map(|name| format!("`{name}`")).collect();
        let count = |n: usize, what: &str| (n > 0).then(|| format!("{n} {what}{}", if n == 1 { "" } else { "s" }));
        let kinds: Vec<String> = [count(self.translations, "translation"), count(self.rotations, "rotation")]
            .into_iter()
            .flatten()
            .collect();
        let (total, names) = (self.translations + self.rotations, names.join(" and "));
        let motions = if total == 1 { "rigid motion" } else { "rigid motions" };
        write!(f, "nothing holds {names} in {total} {motions} ({})", kinds.join(", "))
    }
}

impl System {
    /// Rigid motions that meet no resistance in the last tangent: of single displacement fields, else of all of them
    /// together.
    #[must_use]
    pub fn loose_motions(&self) -> Vec<LooseMotions> {
        let dim = self.mesh.dim();
        let moves = |k: &usize| {
            let f = &self.fields[*k];
            f.kind == FieldKind::Unknown && !f.is_at_points() && f.n_components == dim && self.range(*k).is_some()
        };
        let fields: Vec<usize> = (0..self.fields.len()).filter(moves).filter(|_| dim > 1).collect();
        let alone: Vec<LooseMotions> = fields.iter().filter_map(|f| self.loose(&[*f])).collect();
        if alone.is_empty() && fields.len() > 1 { self.loose(&fields).into_iter().collect() } else { alone }
    }

    fn loose(&self, fields: &[usize]) -> Option<LooseMotions> {
        let dim = self.mesh.dim();
        let motions: Vec<Vec<f64>> = (0..dim * (dim + 1) / 2).map(|k| self.rigid(fields, k)).collect();
        let all = self.n_loose(&motions);
        let translations = self.n_loose(&motions[..dim]);
        let names = fields.iter().map(|f| self.fields[*f].name.clone()).collect();
        (all > 0).then(|| LooseMotions { fields: names, translations, rotations: all.saturating_sub(translations) })
    }

    /// Motion number `k` of some fields by dof, of length 1 at most: translations, then rotations about the centre of the
    /// mesh.
    fn rigid(&self, fields: &[usize], k: usize) -> Vec<f64> {
        let dim = self.mesh.dim();
        let (low, high) = self.mesh.bounds();
        let size = (0..dim).map(|d| high[d] - low[d]).fold(0.0f64, f64::max);
        let planes = [(0, 1), (1, 2), (2, 0)];
        let mut all = vec![0.0; self.numbering.n_dofs];
        for field in fields {
            let (f, start) = (&self.fields[*field], self.range(*field).map_or(0, |r| r.start));
            for node in 0..f.n_nodes() {
                let at = &mut all[start + node * dim..][..dim];
                if k < dim {
                    at[k] = 1.0;
                } else {
                    let x = f.node_position(node);
                    let (a, b) = planes[k - dim];
                    let from_centre = |d: usize| (x[d] - 0.5 * (low[d] + high[d])) / size;
                    (at[a], at[b]) = (-from_centre(b), from_centre(a));
                }
            }
        }
        self.numbering.frames.turn(&mut all);
        all
    }

    /// The dimension of the space of these motions in which nothing resists.
    fn n_loose(&self, motions: &[Vec<f64>]) -> usize {
        let n = self.numbering.n_free();
        let (zero, mut met, mut size) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let (mut products, mut scale) = (Vec::new(), 0.0f64);
        let mut free = Vec::new();
        for motion in motions {
            self.numbering.gather(motion, &mut free);
            residual_and_size(&[self.bulk(), self.changing()], &zero, &free, &mut met, &mut size, 1);
            scale = size.iter().fold(scale, |m, s| m.max(*s));
            products.push(met.clone());
        }
        if scale.is_nan() || scale <= 0.0 {
            return 0;
        }
        let fixed: Vec<usize> = (0..self.numbering.n_dofs).filter(|d| self.numbering.free[*d] == FIXED).collect();
        for (met, motion) in products.iter_mut().zip(motions) {
            met.iter_mut().for_each(|x| *x /= scale);
            met.extend(fixed.iter().map(|d| motion[*d]));
        }
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let limit = LOOSE * (n as f64).sqrt();
        triangular(products).singular_values().iter().filter(|x| **x <= limit).count()
    }
}

/// The triangular factor of a matrix given by its columns (Gram and Schmidt, one column after the other).
fn triangular(mut columns: Vec<Vec<f64>>) -> DMatrix<f64> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let n = columns.len();
    let mut factor = DMatrix::zeros(n, n);
    for i in 0..n {
        let (done, rest) = columns.split_at_mut(i);
        let column = &mut rest[0];
        for (j, unit) in done.iter().enumerate() {
            let part = dot(unit, column);
            factor[(j, i)] = part;
            column.iter_mut().zip(unit).for_each(|(x, u)| *x -= part * u);
        }
        let length = dot(column, column).sqrt();
        factor[(i, i)] = length;
        if length > 0.0 {
            column.iter_mut().for_each(|x| *x /= length);
        }
    }
    factor
}
