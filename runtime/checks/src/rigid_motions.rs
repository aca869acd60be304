//! Rigid motions that the tangent does not resist: what a singular system lacks, in words of mechanics.
//!
//! A motion r of a body is loose if K r vanishes but for rounding, and r at what is fixed: each equation beside what
//! cancels in it, (|K| |r|)_i, so that a soft body or a weak spring that holds a stiff one is seen. The motions of a field
//! are three translations and three rotations (two and one in the plane), or a combination of them: small singular values
//! of what these motions meet, taken from its triangular factor, because squares would hide the small ones beside the
//! large. Bodies that hold each other may move together, as the upper blocks of a stack that slides: where none is loose
//! alone, those that move are read off the null space of the motions of all of them. Promises: looks at the tangent only.
//! Does not find mechanisms that are no rigid motions.

use std::fmt;

use nalgebra::DMatrix;
use wfl_compiler::types::FieldKind;

use super::Examined;
use wfl_discrete::field::FieldSpace;
use wfl_discrete::finite;
use wfl_discrete::system::FIXED;
use wfl_sparse::csr::residual_and_size;
use wfl_sparse::solve::triangular;

/// A motion is loose if what it meets is below this part of what cancels in it: some thousand roundoffs, for positions that
/// are rounded, too.
const LOOSE: f64 = 1e-12;

/// A body takes part in a loose motion if more than this part of its square is that of the body: null vectors are exact to
/// 1e-12 in their size, squares of rounding are smaller still.
const TAKES_PART: f64 = 1e-9;

/// Multiplications that the motions of all bodies may take, each its own: about ten seconds of one core.
const MOST_WORK: f64 = 1e10;

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
    /// Of one rotation in the plane the point that stays where it is: " about [0, 1]".
    pub about: String,
    /// The bodies that move.
    pub(super) bodies: Vec<Body>,
}

impl fmt::Display for LooseMotions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<String> = self.fields.iter().map(|name| format!("`{name}`")).collect();
        let count = |n: usize, what: &str| (n > 0).then(|| format!("{n} {what}{}", if n == 1 { "" } else { "s" }));
        let turns = count(self.rotations, "rotation").map(|text| text + &self.about);
        let kinds: Vec<String> = [count(self.translations, "translation"), turns].into_iter().flatten().collect();
        let (total, mut names) = (self.translations + self.rotations, names.join(" and "));
        if !self.place.is_empty() {
            names = format!("the body of {names} {}", self.place);
        }
        let motions = if total == 1 { "rigid body motion" } else { "rigid body motions" };
        write!(f, "nothing prevents {total} {motions} of {names} ({})", kinds.join(", "))
    }
}

/// A body: a field, and which of its nodes are its own where the field has other bodies, too.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Body {
    field: usize,
    nodes: Option<Vec<bool>>,
}

/// The bodies that take part in loose motions, in groups that move independently of each other. A row of `null` for each
/// dimension of the space of loose motions, `each` columns for each body.
fn groups(null: &DMatrix<f64>, each: usize) -> Vec<Vec<usize>> {
    let n = null.ncols() / each;
    let projection = null.transpose() * null;
    let couples = |a: usize, b: usize| projection.view((a * each, b * each), (each, each)).norm_squared() > TAKES_PART;
    let mut left: Vec<usize> = (0..n).filter(|b| couples(*b, *b)).collect();
    let mut found = Vec::new();
    while let Some(first) = left.first().copied() {
        let mut group = vec![first];
        left.remove(0);
        let mut at = 0;
        while at < group.len() {
            let with = |b: &usize| couples(group[at], *b);
            let (near, far): (Vec<usize>, Vec<usize>) = left.iter().partition(|b| with(b));
            group.extend(near);
            left = far;
            at += 1;
        }
        group.sort_unstable();
        found.push(group);
    }
    found
}

impl Examined<'_> {
    /// Rigid motions that meet no resistance in the tangent: of single bodies, else of single displacement fields, else
    /// of bodies that move together.
    pub(super) fn loose_motions(&self) -> Vec<LooseMotions> {
        let fields: Vec<usize> = (0..self.system.fields.len()).filter(|k| self.is_displacement(*k)).collect();
        let alone: Vec<LooseMotions> = fields.iter().flat_map(|f| self.loose_bodies_of(*f)).collect();
        if alone.is_empty() { self.loose_together(&fields) } else { alone }
    }

    /// The loose motions of bodies of which none is loose alone, by groups that move together. Of more bodies than can be
    /// looked at one by one, those of all together.
    fn loose_together(&self, fields: &[usize]) -> Vec<LooseMotions> {
        let mut bodies = Vec::new();
        for field in fields {
            let of = self.bodies(*field);
            let count = of.iter().max().map_or(0, |b| b + 1);
            bodies.extend((0..count).map(|body| {
                let nodes = (count > 1).then(|| of.iter().map(|b| *b == body).collect());
                Body { field: *field, nodes }
            }));
        }
        let motions: Vec<Vec<f64>> = bodies.iter().flat_map(|body| self.motions(std::slice::from_ref(body))).collect();
        #[expect(clippy::cast_precision_loss, reason = "an estimate")]
        let work = (motions.len() * motions.len() * self.system.numbering.n_free()) as f64;
        // all ranks go one way: each has its own rows
        if bodies.len() < 2 || self.system.team().any(work > MOST_WORK) {
            return if fields.len() > 1 { self.loose(fields).into_iter().collect() } else { Vec::new() };
        }
        let null = self.null_space_of(&motions);
        let each = motions.len() / bodies.len();
        groups(&null, each).iter().map(|group| self.told_of(group, &bodies, &motions, &null)).collect()
    }

    /// What is told of bodies that move together, by their numbers.
    fn told_of(&self, group: &[usize], bodies: &[Body], motions: &[Vec<f64>], null: &DMatrix<f64>) -> LooseMotions {
        let (dim, each) = (self.system.mesh.dim(), motions.len() / bodies.len());
        let mut fields: Vec<usize> = group.iter().map(|b| bodies[*b].field).collect();
        fields.dedup();
        let translations: Vec<Vec<f64>> =
            group.iter().flat_map(|b| motions[b * each..][..dim].iter().cloned()).collect();
        let translations = self.null_space_of(&translations).nrows();
        // the null space is the sum of those of the groups: the trace of the projection onto one is its dimension
        let columns = group.iter().flat_map(|b| b * each..(b + 1) * each);
        let all: f64 = columns.map(|c| null.column(c).norm_squared()).sum();
        let rotations = (all.round() as usize).saturating_sub(translations);
        let names = fields.iter().map(|f| self.system.fields[*f].name.clone()).collect();
        let place = match group {
            [one] => bodies[*one].nodes.as_ref().map_or_else(String::new, |own| self.centre(bodies[*one].field, own)),
            _ => String::new(),
        };
        let about = if dim == 2 && null.nrows() == 1 && rotations == 1 {
            self.common_pole(group, null.row(0).transpose().as_slice())
        } else {
            String::new()
        };
        let bodies = group.iter().map(|b| bodies[*b].clone()).collect();
        LooseMotions { fields: names, place, translations, rotations, about, bodies }
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
            let body = Body { field, nodes: Some(own) };
            found.extend(self.loose_bodies_together(vec![body]).map(|m| LooseMotions { place, ..m }));
        }
        if found.is_empty() { self.loose(&[field]).into_iter().collect() } else { found }
    }

    /// By node of a field: the body it belongs to, parts of the field that hang together through cells.
    fn bodies(&self, field: usize) -> Vec<usize> {
        let f = &self.system.fields[field];
        // what hangs together through cells of other ranks is not known here
        let (FieldSpace::Nodal(space), true) = (&f.space, self.system.mesh.holders().is_alone()) else {
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

    /// Where nothing moves in one motion of the plane, given by three parts for each body, if all bodies of a group turn
    /// about the same point.
    fn common_pole(&self, group: &[usize], parts: &[f64]) -> String {
        let of = |body: usize| &parts[3 * body..][..3];
        let first = of(group[0]);
        let is_same = |body: &usize| of(*body).iter().zip(first).all(|(a, b)| (a - b).abs() < TAKES_PART.sqrt());
        if group.iter().all(is_same) { self.pole(first) } else { String::new() }
    }

    /// The loose motions of some fields together.
    fn loose(&self, fields: &[usize]) -> Option<LooseMotions> {
        self.loose_bodies_together(fields.iter().map(|field| Body { field: *field, nodes: None }).collect())
    }

    /// The loose motions of some bodies that move as one.
    fn loose_bodies_together(&self, bodies: Vec<Body>) -> Option<LooseMotions> {
        let dim = self.system.mesh.dim();
        let motions = self.motions(&bodies);
        let null = self.null_space_of(&motions);
        let all = null.nrows();
        let translations = self.null_space_of(&motions[..dim]).nrows();
        let fields = bodies.iter().map(|body| self.system.fields[body.field].name.clone()).collect();
        let rotations = all.saturating_sub(translations);
        let turns = dim == 2 && all == 1 && rotations == 1;
        let about = if turns { self.pole(null.row(0).transpose().as_slice()) } else { String::new() };
        (all > 0).then(|| LooseMotions { fields, place: String::new(), translations, rotations, about, bodies })
    }

    /// The rigid motions of some bodies as one, by dof, in the frames of nodes.
    pub(super) fn motions(&self, bodies: &[Body]) -> Vec<Vec<f64>> {
        let dim = self.system.mesh.dim();
        (0..dim * (dim + 1) / 2).map(|k| self.rigid(bodies, k)).collect()
    }

    /// The dofs of some bodies, `dim` for each node.
    pub(super) fn dofs_of<'a>(&'a self, bodies: &'a [Body]) -> impl Iterator<Item = std::ops::Range<usize>> + 'a {
        let dim = self.system.mesh.dim();
        bodies.iter().flat_map(move |body| {
            let start = self.system.range(body.field).map_or(0, |range| range.start);
            let is_own = move |node: &usize| body.nodes.as_ref().is_none_or(|own| own[*node]);
            let nodes = (0..self.system.fields[body.field].n_nodes()).filter(is_own);
            nodes.map(move |node| start + node * dim..start + (node + 1) * dim)
        })
    }

    /// Where nothing moves in a motion of the plane with these parts of the two translations and the rotation.
    fn pole(&self, parts: &[f64]) -> String {
        let (low, high) = self.system.mesh.bounds();
        let size = (0..2).map(|d| high[d] - low[d]).fold(0.0f64, f64::max);
        let centre = |d: usize| 0.5 * (low[d] + high[d]);
        let at = [centre(0) - size * parts[1] / parts[2], centre(1) + size * parts[0] / parts[2]];
        // rounding of the parts
        let short = |x: f64| (x / size * 1e6).round() * 1e-6 * size;
        let shown: Vec<String> = at.into_iter().map(|x| finite::short(short(x) + 0.0)).collect();
        format!(" about [{}]", shown.join(", "))
    }

    /// Motion number `k` of some bodies by dof, of length 1 at most: translations, then rotations about the centre of
    /// the mesh.
    fn rigid(&self, bodies: &[Body], k: usize) -> Vec<f64> {
        let dim = self.system.mesh.dim();
        let (low, high) = self.system.mesh.bounds();
        let size = (0..dim).map(|d| high[d] - low[d]).fold(0.0f64, f64::max);
        let planes = [(0, 1), (1, 2), (2, 0)];
        let mut all = vec![0.0; self.system.numbering.n_dofs];
        for body in bodies {
            let (f, start) = (&self.system.fields[body.field], self.system.range(body.field).map_or(0, |r| r.start));
            for dofs in self.dofs_of(std::slice::from_ref(body)) {
                let node = (dofs.start - start) / dim;
                let at = &mut all[dofs];
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

    /// The space of these motions in which nothing resists: a row for each of its dimensions, a column for each motion.
    fn null_space_of(&self, motions: &[Vec<f64>]) -> DMatrix<f64> {
        let (n, team) = (self.system.numbering.n_free(), self.system.team());
        let (zero, mut met, mut size) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let (mut products, mut scale) = (Vec::new(), vec![0.0f64; n]);
        let mut free = Vec::new();
        let Ok(whole) = self.system.whole_matrix(self.tangent) else { return DMatrix::zeros(0, motions.len()) };
        for motion in motions {
            self.system.numbering.gather(motion, &mut free);
            residual_and_size(&[&whole], &zero, &free, &mut met, &mut size, 1);
            scale.iter_mut().zip(&size).for_each(|(scale, s)| *scale = scale.max(*s));
            products.push(met.clone());
        }
        let largest = team.largest(scale.iter().fold(0.0, |m: f64, s| if s.is_nan() || *s > m { *s } else { m }));
        if largest.is_nan() || largest <= 0.0 {
            return DMatrix::zeros(0, motions.len());
        }
        let is_fixed = |d: &usize| self.system.numbering.free[*d] == FIXED && self.system.owns(*d);
        let fixed: Vec<usize> = (0..self.system.numbering.n_dofs).filter(is_fixed).collect();
        for (met, motion) in products.iter_mut().zip(motions) {
            met.iter_mut().zip(&scale).filter(|(_, scale)| **scale > 0.0).for_each(|(x, scale)| *x /= scale);
            met.extend(fixed.iter().map(|d| motion[*d]));
        }
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let limit = LOOSE * (self.system.n_unknowns() as f64).sqrt();
        // the factor of the rows of all ranks is that of the factors of each
        let own = triangular(products);
        let k = own.ncols();
        let all = team.all_numbers(own.transpose().as_slice());
        let columns = (0..k).map(|column| all.iter().skip(column).step_by(k).copied().collect()).collect();
        let found = triangular(columns).svd(false, true);
        let small: Vec<usize> = (0..k).filter(|j| found.singular_values[*j] <= limit).collect();
        found.v_t.map_or_else(|| DMatrix::zeros(0, k), |parts| parts.select_rows(&small))
    }

    /// Faces of the box around some bodies along which a displacement is prescribed, while that normal to them is free: what
    /// is written where a symmetry was meant. In words, "`u(1)` where y = 0".
    pub(super) fn held_along(&self, fields: &[usize]) -> Vec<String> {
        let dim = self.system.mesh.dim();
        let mut found = Vec::new();
        for field in fields {
            let (f, Some(range)) = (&self.system.fields[*field], self.system.range(*field)) else { continue };
            let is_fixed = |node: usize, c: usize| self.system.numbering.free[range.start + node * dim + c] == FIXED;
            let positions: Vec<[f64; 3]> = (0..f.n_nodes()).map(|node| f.node_position(node)).collect();
            for (axis, name) in (0..dim).zip(["x", "y", "z"]) {
                let low = positions.iter().fold(f64::INFINITY, |m, x| m.min(x[axis]));
                let high = positions.iter().fold(f64::NEG_INFINITY, |m, x| m.max(x[axis]));
                for (plane, c) in [low, high].into_iter().flat_map(|at| (0..dim).map(move |c| (at, c))) {
                    let on_it: Vec<usize> = (0..positions.len())
                        .filter(|node| (positions[*node][axis] - plane).abs() <= 1e-9 * (high - low))
                        .collect();
                    // the corner of two faces belongs to both
                    let along = on_it.iter().filter(|node| is_fixed(**node, c) && !is_fixed(**node, axis)).count();
                    if c != axis && 2 * along > on_it.len() && on_it.len() > 1 {
                        let normal = format!("`{}({})`", f.name, axis + 1);
                        let at = if plane.abs() <= 1e-9 * (high - low) { 0.0 } else { plane };
                        let at = finite::short(at);
                        found.push(format!("`{}({})`, and not {normal}, where {name} = {at}", f.name, c + 1));
                    }
                }
            }
        }
        found
    }
}
