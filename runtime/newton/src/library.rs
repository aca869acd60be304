//! What a linked library of solvers is told of a system.
//!
//! Contact touches few unknowns with nonlinear terms on faces, and multipliers; a library may solve them apart. The rest
//! of the matrix stays where no nonlinear term integrates over cells, and is regular by itself where the linear terms
//! hold every body: a floating one is held by its contact alone. Does not solve.

use std::sync::Arc;

use wfl_compiler::{Class, types::FieldKind};
use wfl_discrete::{
    assemble::AssembledTerm,
    pruning::Pruning,
    system::{FIXED, System},
};
use wfl_sparse::{
    csr::{Csr, CsrError},
    index::NONE,
    solve::{Equations, NodeLayout, Traits},
};

/// Energy of a rigid motion, relative to that of its components each by itself, below which nothing holds a body. A body
/// that is held on one face of a mesh of 500 cells along an edge has 1e-5 of it, rounding leaves 1e-15.
const HELD: f64 = 1e-10;

/// What the choice of a method depends on.
pub(super) fn traits(system: &System) -> Traits {
    traits_with(system, on_contact(system).len())
}

fn traits_with(system: &System, on_contact: usize) -> Traits {
    Traits {
        unknowns: system.numbering.n_free(),
        dimension: system.mesh.dim(),
        is_linear: system.is_linear(),
        is_symmetric: system.is_symmetric() && system.uses(Pruning::Symmetric),
        on_contact,
        obstacle: system.node_layout_with_multipliers().err(),
    }
}

/// The equations after the linear terms of a step have been assembled.
///
/// # Errors
/// [`CsrError`] when the pattern does not fit the index types.
pub(super) fn equations(system: &System) -> Result<Equations, CsrError> {
    let on_contact = on_contact(system);
    let traits = traits_with(system, on_contact.len());
    let (layout, multipliers) = system.node_layout_with_multipliers().map_or((None, Vec::new()), |(l, m)| (Some(l), m));
    let pattern = if system.is_linear() {
        Arc::clone(system.bulk().pattern())
    } else {
        Arc::new(system.bulk().pattern().union(system.changing_pattern())?)
    };
    let stays = nonlinear(system).all(is_on_faces);
    let is_held = |layout: &NodeLayout| holds(system.bulk(), layout, &multipliers);
    let steady = (stays && layout.as_ref().is_some_and(is_held)).then(|| system.shared_bulk());
    Ok(Equations { traits, pattern, layout, steady, multipliers, on_contact })
}

fn nonlinear(system: &System) -> impl Iterator<Item = &AssembledTerm> {
    let written = system.terms.iter().filter(|term| term.law.class >= Class::Nonlinear);
    written.chain(system.frozen().iter().map(|frozen| &frozen.form))
}

fn is_on_faces(term: &AssembledTerm) -> bool {
    term.integrator.domain.groups.iter().all(|group| !group.here.facets.is_empty())
}

/// Free dofs that nonlinear terms on faces touch, those of multipliers, and those that these are coupled to.
fn on_contact(system: &System) -> Vec<u32> {
    let numbering = &system.numbering;
    let mut touched = vec![false; numbering.n_dofs];
    for term in nonlinear(system).filter(|term| is_on_faces(term)) {
        term.for_each_entity(|tests, trials| tests.iter().chain(trials).for_each(|dof| touched[*dof as usize] = true));
    }
    let is_multiplier = |dof: &u32| system.fields[system.field_of(*dof as usize)].kind == FieldKind::Multiplier;
    for term in system.terms.iter().filter(|term| term.law.class >= Class::Linear && is_on_faces(term)) {
        term.for_each_entity(|tests, trials| {
            if tests.iter().chain(trials).any(is_multiplier) {
                tests.iter().chain(trials).for_each(|dof| touched[*dof as usize] = true);
            }
        });
    }
    // a frame mixes the components of its node
    for dof in 0..touched.len() {
        if let (true, Some(frame)) = (touched[dof], numbering.frames.of(dof)) {
            touched[frame.first..][..frame.axes.len()].fill(true);
        }
    }
    let free = touched.iter().zip(&numbering.free).filter(|(touched, free)| **touched && **free != FIXED);
    free.map(|(_, free)| *free).collect()
}

/// Whether every part of a matrix that is connected by its entries has energy in each of its near null vectors; rows of
/// multipliers are no part of it.
fn holds(matrix: &Csr, layout: &NodeLayout, multipliers: &[u32]) -> bool {
    if matrix.values().is_empty() {
        return false;
    }
    let (modes, k) = (layout.mode_values(), layout.n_modes());
    let mut is_left_out = vec![false; matrix.n_rows()];
    multipliers.iter().for_each(|row| is_left_out[*row as usize] = true);
    let (part, n_parts) = parts(matrix, layout, &is_left_out);
    let (mut energy, mut size) = (vec![0.0; n_parts * k * k], vec![0.0; n_parts * k * k]);
    let mode = |row: usize| &modes[layout.places[row] as usize * k..][..k];
    let mut product = vec![0.0; k];
    for row in (0..matrix.n_rows()).filter(|row| !is_left_out[*row]) {
        product.fill(0.0);
        let (columns, values) = matrix.row(row);
        for (column, value) in columns.iter().zip(values).filter(|(column, _)| !is_left_out[**column as usize]) {
            product.iter_mut().zip(mode(*column as usize)).for_each(|(p, m)| *p += value * m);
        }
        let (at, own, diagonal) = (part[row] as usize * k * k, mode(row), matrix.get(row, row).abs());
        for i in 0..k {
            for j in 0..k {
                energy[at + i * k + j] += own[i] * product[j];
                size[at + i * k + j] += diagonal * own[i] * own[j];
            }
        }
    }
    let is_held = |at: usize| {
        let shifted = (at..at + k * k).map(|e| energy[e] - HELD * size[e]).collect();
        is_positive_definite(shifted, k)
    };
    (0..n_parts).all(|p| is_held(p * k * k))
}

/// By row its part, and their number: components of a node belong together, and what an entry couples.
fn parts(matrix: &Csr, layout: &NodeLayout, is_left_out: &[bool]) -> (Vec<u32>, usize) {
    let mut rows_of = vec![Vec::new(); layout.points.len()];
    for (row, place) in (0..).zip(&layout.places) {
        rows_of[*place as usize / layout.components].push(row);
    }
    let mut part = vec![NONE; matrix.n_rows()];
    let mut n_parts = 0;
    let mut waiting: Vec<u32> = Vec::new();
    for start in (0..matrix.n_rows()).filter(|row| !is_left_out[*row]) {
        if part[start] != NONE {
            continue;
        }
        part[start] = n_parts;
        waiting.push(u32::try_from(start).expect("fewer than 2^32 rows"));
        while let Some(row) = waiting.pop() {
            let node = layout.places[row as usize] as usize / layout.components;
            for next in matrix.row(row as usize).0.iter().chain(&rows_of[node]) {
                if part[*next as usize] == NONE && !is_left_out[*next as usize] {
                    part[*next as usize] = n_parts;
                    waiting.push(*next);
                }
            }
        }
        n_parts += 1;
    }
    (part, n_parts as usize)
}

/// Whether the symmetric part of a matrix of `k` rows has a Cholesky factor.
fn is_positive_definite(mut a: Vec<f64>, k: usize) -> bool {
    for i in 0..k {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|l| a[i * k + l] * a[j * k + l]).sum();
            let left = 0.5 * (a[i * k + j] + a[j * k + i]) - sum;
            if i != j {
                a[i * k + j] = left / a[j * k + j];
            } else if left > 0.0 {
                a[i * k + i] = left.sqrt();
            } else {
                return false;
            }
        }
    }
    true
}
