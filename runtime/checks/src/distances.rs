//! Contact against the geometry of the mesh: gaps with the wrong sign, and bodies that never meet.
//!
//! Without displacement the argument of a contact projection says how far the sides are apart ([`contact_points`], for
//! every method). Where a mapping leads from face to face, the mesh says the same: (Y - X) . n from a point X to its image Y
//! along the normal n of the near side. Conventions of the scene do not enter, because the sign of the written distance is
//! that in which a displacement closes it.

use wfl_contact::{Contact, ContactTerm, PointState, contact_points};
use wfl_discrete::system::System;

/// Written and true distances that add up to less than this part of the true ones are opposite: with the right sign they add
/// up to twice as much, and faces that are approximated by planes are within some hundredths.
const OPPOSITE: f64 = 0.05;
/// The same part of what they vary by about their means: an interference or an offset may be added to both.
const VARIES: f64 = 0.1;
/// Distances below this part of the extent of the mesh are rounding: files of meshes have ten digits or more, and no gap that
/// is meant is so narrow.
const ROUNDING: f64 = 1e-9;
/// Points that are nearer than this part of the mean distance touch: beside the mean distance such a gap is none.
const TOUCHES: f64 = 1e-3;

/// A contact law whose distance is the opposite of that of the mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct ReversedGap {
    /// The position of its term.
    pub term: usize,
    /// What the law takes for the distance at a point (length), positive where the sides are apart.
    pub written: f64,
    /// What it is there.
    pub distance: f64,
    /// Where.
    pub position: [f64; 3],
}

/// The contact laws through mappings onto faces whose distance has the wrong sign, at the step of the system.
#[must_use]
pub fn reversed_gaps(system: &System, contact: &Contact) -> Vec<ReversedGap> {
    let all = contact.terms().iter().filter(|t| !t.on_cells());
    // of a part of the mesh a rank has some of the points only
    system.mesh.check_whole(|| all.filter_map(|t| reversed_gap(system, contact, t)).collect())
}

fn reversed_gap(system: &System, contact: &Contact, term: &ContactTerm) -> Option<ReversedGap> {
    let domain = &term.law().1.domain;
    if domain.groups.iter().any(|g| g.there_normal.is_none()) {
        return None;
    }
    let zero = vec![0.0; system.numbering.n_dofs];
    let points = contact_points(system, contact, &zero, &[term.term])?;
    let mut images = Vec::with_capacity(points.positions.len());
    for group in &domain.groups {
        let there = group.there.as_ref()?;
        for entity in 0..group.entities.len() {
            images.extend((0..group.n_points()).map(|q| there.position(&system.mesh, entity, q)));
        }
    }
    let mut all: Vec<(f64, f64, f64, [f64; 3])> = Vec::new();
    for (k, y) in images.iter().enumerate() {
        let (x, n) = (points.positions[k], points.normals[k]);
        let distance: f64 = (0..3).map(|d| (y[d] - x[d]) * n[d]).sum();
        if points.gaps[k].is_finite() {
            all.push((points.weights[k], points.gaps[k], distance, x));
        }
    }
    let weight: f64 = all.iter().map(|a| a.0).sum();
    let mean = |of: &dyn Fn(f64, f64) -> f64| all.iter().map(|(w, e, g, _)| w * of(*e, *g)).sum::<f64>() / weight;
    let (written, true_mean) = (mean(&|e, _| e), mean(&|_, g| g));
    let size = mean(&|_, g| g.abs());
    let apart = mean(&|e, g| (e + g).abs());
    let spread = mean(&|_, g| (g - true_mean).abs());
    let spread_apart = mean(&|e, g| (e - written + g - true_mean).abs());
    let rounding = ROUNDING * extent(system);
    let opposite = size > rounding && apart <= OPPOSITE * size;
    let varies = spread > rounding && spread_apart <= VARIES * spread;
    let worst = all.iter().max_by(|a, b| a.2.abs().total_cmp(&b.2.abs()))?;
    (opposite || varies).then_some(ReversedGap {
        term: term.term,
        written: worst.1,
        distance: worst.2,
        position: worst.3,
    })
}

fn extent(system: &System) -> f64 {
    let (low, high) = system.mesh.bounds();
    (0..3).fold(0.0, |m: f64, d| m.max(high[d] - low[d]))
}

/// A contact law whose sides are apart without displacement.
#[derive(Clone, Debug, PartialEq)]
pub struct DistantContact {
    /// The position of its term.
    pub term: usize,
    /// Its name.
    pub name: String,
    /// The smallest distance of its sides without displacement (length).
    pub from: f64,
    /// The smallest one since.
    pub nearest: f64,
}

/// The contact laws whose sides are apart without displacement: at every point, or at most of them where the sides are
/// curved and touch at one. Sides that lie on each other may open because that is what the scene is about.
#[must_use]
pub fn distant_contacts(system: &System, contact: &Contact) -> Vec<DistantContact> {
    system.mesh.check_whole(|| distant(system, contact))
}

fn distant(system: &System, contact: &Contact) -> Vec<DistantContact> {
    let zero = vec![0.0; system.numbering.n_dofs];
    let mut found = Vec::new();
    for term in contact.terms().iter().filter(|t| !t.on_cells()) {
        let Some(points) = contact_points(system, contact, &zero, &[term.term]) else { continue };
        let gaps = &points.gaps;
        if gaps.is_empty() || gaps.iter().any(|g| g.is_nan() || *g < 0.0) {
            continue;
        }
        #[expect(clippy::cast_precision_loss, reason = "a mean")]
        let mean = gaps.iter().sum::<f64>() / gaps.len() as f64;
        let touching = gaps.iter().filter(|g| **g <= TOUCHES * mean).count();
        if mean > ROUNDING * extent(system) && 2 * touching < gaps.len() {
            let from = smallest(gaps);
            let name = system.terms[term.term].law.name.clone();
            found.push(DistantContact { term: term.term, name, from, nearest: f64::INFINITY });
        }
    }
    found
}

/// Whether a distant contact has closed somewhere at `u`; else how near its sides are.
#[must_use]
pub fn has_closed(system: &System, contact: &Contact, u: &[f64], distant: &mut DistantContact) -> bool {
    let Some(points) = contact_points(system, contact, u, &[distant.term]) else { return true };
    distant.nearest = distant.nearest.min(smallest(&points.gaps));
    points.states.iter().any(|s| *s != PointState::Open)
}

fn smallest(gaps: &[f64]) -> f64 {
    gaps.iter().fold(f64::INFINITY, |m, g| m.min(*g))
}
