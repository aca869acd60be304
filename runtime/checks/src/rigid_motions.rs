//! Rigid motions that the tangent does not resist: what a singular system lacks, in words of mechanics.
//!
//! A motion r of a body is loose if K r vanishes but for rounding, and r at what is fixed. The motions of a field are
//! three translations and three rotations (two and one in the plane), or a combination of them: small singular values
//! of what these motions meet, taken from its triangular factor, because squares would hide the small ones beside the
//! large. Promises: looks at the tangent only. Does not find mechanisms that are no rigid motions.

use std::fmt;

use wfl_compiler::types::FieldKind;

use super::Examined;
use wfl_discrete::field::FieldSpace;
use wfl_discrete::system::FIXED;
use wfl_sparse::csr::residual_and_size;
use wfl_sparse::solve::triangular;

/// A motion is loose if what it meets is below this part of what cancels in it.
const LOOSE: f64 = 1e-9;

/// The rigid motions in which some fields move without resistance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LooseMotions {
    /// The names of the fields that move.
    pub fields: Vec<String>,
    /// Where the body is, if a field has several: "around [0.5, 1]".
    pub place: String,
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
        let (total, mut names) = (self.translations + self.rotations, names.join(" and "));
        if !self.place.is_empty() {
            names = format!("the body of {names} {}", self.place);
        }
        let motions = if total == 1 { "rigid body motion" } else { "rigid body motions" };
        write!(f, "nothing prevents {total} {motions} of {names} ({})", kinds.join(", "))
    }
}

impl Examined<'_> {
    /// Rigid motions that meet no resistance in the tangent: of single bodies, else of single displacement fields, else
    /// of all of them together.
    pub(super) fn loose_motions(&self) -> Vec<LooseMotions> {
        let fields: Vec<usize> = (0..self.system.fields.len()).filter(|k| self.is_displacement(*k)).collect();
        let alone: Vec<LooseMotions> = fields.iter().flat_map(|f| self.loose_bodies_of(*f)).collect();
        if alone.is_empty() && fields.len() > 1 { self.loose(&fields).into_iter().collect() } else { alone }
    }

    /// True for a field of displacements of a body.
    pub(super) fn is_displacement(&self, field: usize) -> bool {
        let (f, dim) = (&self.system.fields[field], self.system.mesh.dim());
        dim > 1
            && f.kind == FieldKind::Unknown
            && !f.is_at_points()
            && f.n_components == dim
            && self.system.range(field).is_some()
    }

    /// The loose bodies of one field, or the field as a whole.
    fn loose_bodies_of(&self, field: usize) -> Vec<LooseMotions> {
        let bodies = self.bodies(field);
        let count = bodies.iter().max().map_or(0, |b| b + 1);
        let mut found = Vec::new();
        for body in (0..count).filter(|_| count > 1) {
            let own: Vec<bool> = bodies.iter().map(|b| *b == body).collect();
            let place = self.centre(field, &own);
            found.extend(self.loose_part(&[field], Some(&own)).map(|m| LooseMotions { place, ..m }));
        }
        if found.is_empty() { self.loose(&[field]).into_iter().collect() } else { found }
    }

    /// By node of a field: the body it belongs to, parts of the field that hang together through cells.
    fn bodies(&self, field: usize) -> Vec<usize> {
        let f = &self.system.fields[field];
        // what hangs together through cells of other ranks is not known here
        let (FieldSpace::Nodal(space), true) = (&f.space, self.system.mesh.is_whole()) else {
            return vec![0; f.n_nodes()];
        };
        let mut above: Vec<usize> = (0..f.n_nodes()).collect();
        let root = |above: &[usize], mut at: usize| {
            while above[at] != at {
                at = above[at];
            }
            at
        };
        for position in 0..space.n_positions() {
            let nodes = space.entity_nodes(position);
            for pair in nodes.windows(2) {
                let (a, b) = (root(&above, pair[0] as usize), root(&above, pair[1] as usize));
                let low = a.min(b);
                (above[a], above[b]) = (low, low);
                // paths stay short
                (above[pair[0] as usize], above[pair[1] as usize]) = (low, low);
            }
        }
        let mut numbers = vec![usize::MAX; f.n_nodes()];
        let mut next = 0;
        let mut found = Vec::with_capacity(f.n_nodes());
        for node in 0..f.n_nodes() {
            let top = root(&above, node);
            if numbers[top] == usize::MAX {
                numbers[top] = next;
                next += 1;
            }
            found.push(numbers[top]);
        }
        found
    }

    fn centre(&self, field: usize, own: &[bool]) -> String {
        let f = &self.system.fields[field];
        let nodes: Vec<usize> = (0..own.len()).filter(|n| own[*n]).collect();
        #[expect(clippy::cast_precision_loss, reason = "a mean")]
        let mean = |d: usize| nodes.iter().map(|n| f.node_position(*n)[d]).sum::<f64>() / nodes.len().max(1) as f64;
        let x: Vec<String> =
            (0..self.system.mesh.dim()).map(|d| format!("{}", (mean(d) * 1e3).round() / 1e3)).collect();
        format!("around [{}]", x.join(", "))
    }

    pub(super) fn loose(&self, fields: &[usize]) -> Option<LooseMotions> {
        self.loose_part(fields, None)
    }

    /// The loose motions of some fields together; of one field those of some of its nodes alone.
    fn loose_part(&self, fields: &[usize], own: Option<&[bool]>) -> Option<LooseMotions> {
        let dim = self.system.mesh.dim();
        let mut motions: Vec<Vec<f64>> = (0..dim * (dim + 1) / 2).map(|k| self.rigid(fields, k)).collect();
        if let (Some(own), Some(range)) = (own, self.system.range(fields[0])) {
            for motion in &mut motions {
                let nodes = motion[range.clone()].chunks_exact_mut(dim);
                nodes.zip(own).filter(|(_, own)| !**own).for_each(|(node, _)| node.fill(0.0));
            }
        }
        let all = self.n_loose(&motions);
        let translations = self.n_loose(&motions[..dim]);
        let names = fields.iter().map(|f| self.system.fields[*f].name.clone()).collect();
        let rotations = all.saturating_sub(translations);
        (all > 0).then(|| LooseMotions { fields: names, place: String::new(), translations, rotations })
    }

    /// Motion number `k` of some fields by dof, of length 1 at most: translations, then rotations about the centre of
    /// the mesh.
    pub(super) fn rigid(&self, fields: &[usize], k: usize) -> Vec<f64> {
        let dim = self.system.mesh.dim();
        let (low, high) = self.system.mesh.bounds();
        let size = (0..dim).map(|d| high[d] - low[d]).fold(0.0f64, f64::max);
        let planes = [(0, 1), (1, 2), (2, 0)];
        let mut all = vec![0.0; self.system.numbering.n_dofs];
        for field in fields {
            let (f, start) = (&self.system.fields[*field], self.system.range(*field).map_or(0, |r| r.start));
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
        self.system.numbering.frames.turn(&mut all);
        all
    }

    /// The dimension of the space of these motions in which nothing resists.
    fn n_loose(&self, motions: &[Vec<f64>]) -> usize {
        let (n, team) = (self.system.numbering.n_free(), self.system.team());
        let (zero, mut met, mut size) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let (mut products, mut scale) = (Vec::new(), 0.0f64);
        let mut free = Vec::new();
        for motion in motions {
            self.system.numbering.gather(motion, &mut free);
            residual_and_size(&[self.system.bulk(), &self.tangent.changing], &zero, &free, &mut met, &mut size, 1);
            scale = size.iter().fold(scale, |m, s| m.max(*s));
            products.push(met.clone());
        }
        let scale = team.largest(scale);
        if scale.is_nan() || scale <= 0.0 {
            return 0;
        }
        let is_fixed = |d: &usize| self.system.numbering.free[*d] == FIXED && self.system.owns(*d);
        let fixed: Vec<usize> = (0..self.system.numbering.n_dofs).filter(is_fixed).collect();
        for (met, motion) in products.iter_mut().zip(motions) {
            met.iter_mut().for_each(|x| *x /= scale);
            met.extend(fixed.iter().map(|d| motion[*d]));
        }
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let limit = LOOSE * (self.system.n_unknowns() as f64).sqrt();
        // the factor of the rows of all ranks is that of the factors of each
        let own = triangular(products);
        let k = own.ncols();
        let all = team.all_numbers(own.transpose().as_slice());
        let columns = (0..k).map(|column| all.iter().skip(column).step_by(k).copied().collect()).collect();
        triangular(columns).singular_values().iter().filter(|x| **x <= limit).count()
    }
}
