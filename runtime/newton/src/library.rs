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
    csr::CsrError,
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
    let is_held = |layout: &NodeLayout| holds(system, layout, &multipliers);
    let steady = (stays && layout.as_ref().is_some_and(is_held)).then(|| system.shared_bulk());
    Ok(Equations { traits, pattern, layout, steady, multipliers, on_contact, owners: system.owners() })
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

/// Whether every part of the linear terms that is connected by them has energy in each of its near null vectors; rows of
/// multipliers are no part of it.
fn holds(system: &System, layout: &NodeLayout, multipliers: &[u32]) -> bool {
    let matrix = system.bulk();
    if linear(system).next().is_none() {
        return false;
    }
    let (modes, k) = (layout.mode_values(), layout.n_modes());
    let mut is_left_out = vec![false; matrix.n_rows()];
    multipliers.iter().for_each(|row| is_left_out[*row as usize] = true);
    let (part, n_parts) = parts(system, layout, &is_left_out);
    let (mut energy, mut size) = (vec![0.0; n_parts * k * k], vec![0.0; n_parts * k * k]);
    let mode = |row: usize| &modes[layout.places[row] as usize * k..][..k];
    let mut product = vec![0.0; k];
    let has_row = |row: &usize| !is_left_out[*row] && !matrix.pattern().row(*row).is_empty();
    for row in (0..matrix.n_rows()).filter(has_row) {
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
    system.team().sum(&mut energy);
    system.team().sum(&mut size);
    let is_held = |at: usize| {
        let shifted = (at..at + k * k).map(|e| energy[e] - HELD * size[e]).collect();
        is_positive_definite(shifted, k)
    };
    (0..n_parts).all(|p| is_held(p * k * k))
}

fn linear(system: &System) -> impl Iterator<Item = &AssembledTerm> {
    system.terms.iter().filter(|term| term.law.class == Class::Linear)
}

/// By row its part, and their number: components of a node belong together, and what an entity of a linear term couples.
/// Read off the terms, of which every rank has all.
fn parts(system: &System, layout: &NodeLayout, is_left_out: &[bool]) -> (Vec<u32>, usize) {
    let free = &system.numbering.free;
    let n_nodes = u32::try_from(layout.points.len()).expect("fewer than 2^32 nodes");
    let mut leader: Vec<u32> = (0..n_nodes).collect();
    for term in linear(system) {
        term.for_each_entity(|tests, trials| {
            let rows = tests.iter().chain(trials).map(|dof| free[*dof as usize]);
            let mut nodes = rows
                .filter(|row| *row != FIXED && !is_left_out[*row as usize])
                .map(|row| layout.places[row as usize] / u32::try_from(layout.components).expect("few components"));
            let Some(first) = nodes.next() else { return };
            let first = lead(&mut leader, first);
            for node in nodes {
                let other = lead(&mut leader, node);
                leader[other as usize] = first;
            }
        });
    }
    let mut number = vec![NONE; leader.len()];
    let mut part = vec![NONE; layout.places.len()];
    let mut n_parts = 0;
    for row in (0..part.len()).filter(|row| !is_left_out[*row]) {
        let node = layout.places[row] as usize / layout.components;
        let leader = lead(&mut leader, u32::try_from(node).expect("a node")) as usize;
        if number[leader] == NONE {
            number[leader] = n_parts;
            n_parts += 1;
        }
        part[row] = number[leader];
    }
    (part, n_parts as usize)
}

/// The leader of the part of a node; the way to it is made shorter (union and find).
fn lead(leader: &mut [u32], mut node: u32) -> u32 {
    while leader[node as usize] != node {
        leader[node as usize] = leader[leader[node as usize] as usize];
        node = leader[node as usize];
    }
    node
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
