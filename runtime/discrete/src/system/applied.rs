//! Terms as an operator: those on cells are applied, the others are a small matrix.
//!
//! Promises: the same linear map as the matrix, to rounding, in the rows of fixed dofs, too. Holds what its products need and a
//! copy of the system that can assemble the matrix after all.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use wfl_compiler::Class;
use wfl_sparse::csr::Csr;
use wfl_sparse::solve::{Operator, OperatorLevels};

use super::held::WithoutMatrix;
use super::{ActiveSet, Branches, System, SystemError};
use crate::assemble::{AppliedTerm, MOST_COMPONENTS, NodeBlocks, Skeleton, TermError};

/// Some terms at a state, by dof in the axes of the scene.
pub(super) struct Part {
    /// Terms that are applied, with their numbers.
    pub(super) terms: Vec<(usize, Arc<AppliedTerm<f64>>)>,
    /// Terms that are not applied; `None` where there are none.
    pub(super) rest: Option<Csr>,
    /// The sums of the magnitudes of the rows, of the terms that are applied.
    pub(super) sums: Vec<f64>,
    /// By dof its entries with the components of its node, of all terms, [`MOST_COMPONENTS`] places each.
    pub(super) blocks: Vec<f64>,
}

/// Where an operator stands.
#[derive(Clone)]
pub(super) struct At {
    /// The state; empty where terms are linear.
    u: Vec<f64>,
    /// Kept branches; `None` for those that follow from the state.
    branches: Option<ActiveSet>,
}

impl At {
    /// A state with its branches.
    pub(super) fn new(u: &[f64], branches: Branches<'_>) -> Self {
        let branches = match branches {
            Branches::AsWritten => None,
            Branches::Frozen(active) => Some(active.clone()),
        };
        Self { u: u.to_vec(), branches }
    }

    /// Any state, of linear terms.
    pub(super) fn any() -> Self {
        Self { u: Vec::new(), branches: None }
    }
}

/// The operator of the terms of a system at a state.
pub(super) struct TermsOperator {
    /// What the matrix is assembled from where it is asked for, and the levels are made of.
    pub(super) system: Box<System>,
    at: At,
    pub(super) parts: Vec<Arc<Part>>,
    /// By free dof.
    diagonal: Vec<f64>,
    row_sums: Vec<f64>,
    memory: Mutex<[Vec<f64>; 2]>,
}

impl fmt::Debug for TermsOperator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TermsOperator").field("parts", &self.parts.len()).finish_non_exhaustive()
    }
}

/// The tangent of a system that has no matrix.
#[derive(Clone, Debug, Default)]
pub(super) struct AppliedTangent {
    /// By dof in the axes of the scene the sums of the magnitudes of the changing terms that are applied: what sizes of a residual
    /// need of the last tangent.
    pub(super) sums: Vec<f64>,
    /// The changing terms that are not applied.
    pub(super) rest: Option<Csr>,
    /// `None` before the first tangent, and where it could not be evaluated.
    pub(super) operator: Option<Arc<TermsOperator>>,
}

impl AppliedTangent {
    /// The tangent of zero.
    pub(super) fn new(n_dofs: usize, rest: Option<&Csr>) -> Self {
        Self { sums: vec![0.0; n_dofs], rest: rest.cloned(), operator: None }
    }

    /// Makes it zero.
    pub(super) fn clear(&mut self) {
        self.operator = None;
        self.sums.fill(0.0);
        self.rest.iter_mut().for_each(|rest| rest.values_mut().fill(0.0));
    }

    /// Takes what sizes need.
    pub(super) fn take(&mut self, part: &Part) {
        self.sums.copy_from_slice(&part.sums);
        if let (Some(own), Some(rest)) = (&mut self.rest, &part.rest) {
            own.values_mut().copy_from_slice(rest.values());
        }
    }

    /// By dof in the axes of the scene the sums of all magnitudes.
    pub(super) fn row_sums(&self) -> Vec<f64> {
        let mut sums = self.sums.clone();
        if let Some(rest) = &self.rest {
            add_sizes(rest, &vec![1.0; sums.len()], &mut sums);
        }
        sums
    }

    /// What sizes need, as numbers.
    pub(super) fn memory(&self) -> Vec<f64> {
        let rest = self.rest.iter().flat_map(|rest| rest.values());
        self.sums.iter().chain(rest).copied().collect()
    }

    /// Takes over numbers of [`Self::memory`]; false, and nothing is changed, if they are those of another system.
    pub(super) fn recall(&mut self, memory: &[f64]) -> bool {
        let n = self.sums.len();
        if memory.len() != n + self.rest.as_ref().map_or(0, |rest| rest.values().len()) {
            return false;
        }
        self.operator = None;
        self.sums.copy_from_slice(&memory[..n]);
        self.rest.iter_mut().for_each(|rest| rest.values_mut().copy_from_slice(&memory[n..]));
        true
    }
}

/// `out = out + |A| |x|`.
pub(super) fn add_sizes(matrix: &Csr, x: &[f64], out: &mut [f64]) {
    for (row, out) in out.iter_mut().enumerate() {
        let (columns, values) = matrix.row(row);
        *out += columns.iter().zip(values).map(|(column, value)| (value * x[*column as usize]).abs()).sum::<f64>();
    }
}

impl Part {
    /// `p = p + A d`.
    fn add(&self, d: &[f64], p: &mut [f64]) {
        self.terms.iter().for_each(|(_, term)| term.add(d, p));
        if let Some(rest) = &self.rest {
            for (row, p) in p.iter_mut().enumerate() {
                let (columns, values) = rest.row(row);
                *p += columns.iter().zip(values).map(|(column, value)| value * d[*column as usize]).sum::<f64>();
            }
        }
    }

    /// `s = s + |A| |d|`, about from above.
    fn add_sizes(&self, d: &[f64], s: &mut [f64]) {
        let skeletons = self.terms.iter().map(|(_, term)| &**term.skeleton());
        add_sizes_of((skeletons, &self.sums), self.rest.as_ref(), d, s);
    }
}

/// Adds `|A| |d|`, about from above: sums of rows times the largest unknown nearby, and what a matrix gives.
pub(super) fn add_sizes_of<'s>(
    applied: (impl Iterator<Item = &'s Skeleton<f64>>, &[f64]),
    rest: Option<&Csr>,
    d: &[f64],
    s: &mut [f64],
) {
    let (skeletons, sums) = applied;
    let mut nearby = vec![0.0; s.len()];
    skeletons.for_each(|skeleton| skeleton.largest_nearby(d, &mut nearby));
    s.iter_mut().zip(sums).zip(&nearby).for_each(|((s, sum), nearby)| *s += sum * nearby);
    if let Some(rest) = rest {
        add_sizes(rest, d, s);
    }
}

impl System {
    /// The linear terms at the present step.
    ///
    /// # Errors
    /// [`SystemError`] with its place.
    pub(super) fn linear_part(&self, held: &WithoutMatrix) -> Result<Part, SystemError> {
        let is_linear = |k: &usize| self.terms[*k].law.class == Class::Linear;
        let (applied, others): (Vec<usize>, Vec<usize>) =
            (0..self.terms.len()).filter(is_linear).partition(|k| self.terms[*k].can_be_applied());
        let rest = if others.is_empty() { None } else { Some(self.clone().tangent_of(&others)?) };
        Ok(self.part(held, &applied, &vec![0.0; self.numbering.n_dofs], rest)?)
    }

    /// The changing terms at a state.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub(super) fn changing_part(
        &self,
        held: &WithoutMatrix,
        u: &[f64],
        branches: Branches<'_>,
    ) -> Result<Part, TermError> {
        let changes = |k: &usize| self.terms[*k].law.class >= Class::Nonlinear;
        let (applied, others): (Vec<usize>, Vec<usize>) =
            (0..self.terms.len()).filter(changes).partition(|k| self.terms[*k].can_be_applied());
        let mut rest = held.rest.clone();
        if let Some(matrix) = &mut rest {
            let (values, is_frozen) = match branches {
                Branches::AsWritten => (self.values(u), false),
                Branches::Frozen(active) => (self.values_with(u, active), true),
            };
            for k in others {
                let frozen = self.frozen.iter().find(|frozen| is_frozen && frozen.term == k);
                let term = frozen.map_or(&self.terms[k], |frozen| &frozen.form);
                term.add_tangent(&self.mesh, values.view(), matrix.values_mut())?;
            }
        }
        self.part(held, &applied, u, rest)
    }

    /// Adds `|K| |u|` of the changing terms of the last tangent, about from above, by dof in the axes of the scene.
    pub(super) fn add_sizes_of_tangent(&self, tangent: &AppliedTangent, u: &[f64], out: &mut [f64]) {
        let Some(held) = &self.without_matrix else { return };
        let changes = |k: &usize| self.terms[*k].law.class >= Class::Nonlinear && self.terms[*k].can_be_applied();
        let skeletons: Vec<&Skeleton<f64>> =
            (0..self.terms.len()).filter(changes).map(|k| &**self.skeleton(held, k)).collect();
        add_sizes_of((skeletons.into_iter(), &tangent.sums), tangent.rest.as_ref(), u, out);
    }

    /// The cells of a term.
    pub(super) fn skeleton<'h>(&self, held: &'h WithoutMatrix, k: usize) -> &'h Arc<Skeleton<f64>> {
        let (starts, n) = (&self.numbering.starts, self.numbering.n_dofs);
        held.terms[k].double.get_or_init(|| Arc::new(self.terms[k].skeleton(&self.mesh, starts, n)))
    }

    fn part(&self, held: &WithoutMatrix, applied: &[usize], u: &[f64], rest: Option<Csr>) -> Result<Part, TermError> {
        let values = self.values(u);
        let (mut sums, mut blocks) = (vec![0.0; u.len()], vec![0.0; MOST_COMPONENTS * u.len()]);
        let mut terms = Vec::with_capacity(applied.len());
        for k in applied {
            let term = Arc::new(self.applied_at(held, *k, values.view())?);
            let to = NodeBlocks { blocks: &mut blocks, sums: &mut sums };
            self.on_levels(held, *k, &term).add_node_blocks(&self.mesh, values.view(), to)?;
            terms.push((*k, term));
        }
        if let Some(rest) = &rest {
            self.add_blocks_of(rest, &mut blocks);
        }
        Ok(Part { terms, rest, sums, blocks })
    }

    /// Adds the entries of a matrix by dof between components of one node.
    fn add_blocks_of(&self, matrix: &Csr, by_dof: &mut [f64]) {
        for (field, start) in self.fields.iter().zip(&self.numbering.starts) {
            let (Some(start), n) = (*start, field.n_components.min(MOST_COMPONENTS)) else { continue };
            for node in 0..field.n_nodes() {
                let first = start + node * field.n_components;
                for c in 0..n {
                    for d in 0..n {
                        by_dof[(first + c) * MOST_COMPONENTS + d] += matrix.get(first + c, first + d);
                    }
                }
            }
        }
    }
}

impl TermsOperator {
    /// Of parts in the present step of a system.
    pub(super) fn new(system: &System, parts: Vec<Arc<Part>>, at: At) -> Self {
        let (n, numbering) = (system.numbering.n_dofs, &system.numbering);
        let (mut sums, mut blocks) = (vec![0.0; n], vec![0.0; MOST_COMPONENTS * n]);
        for part in &parts {
            sums.iter_mut().zip(&part.sums).for_each(|(sum, own)| *sum += own);
            blocks.iter_mut().zip(&part.blocks).for_each(|(block, own)| *block += own);
            if let Some(rest) = &part.rest {
                add_sizes(rest, &vec![1.0; n], &mut sums);
            }
        }
        numbering.turn_sizes(&mut sums);
        let mut row_sums = Vec::new();
        numbering.gather(&sums, &mut row_sums);
        let diagonal = system.diagonal_of_blocks(&blocks);
        let system = Box::new(System { linear: None, ..system.clone() });
        Self { system, at, parts, diagonal, row_sums, memory: Mutex::default() }
    }

    /// Its parts.
    pub(super) fn parts(&self) -> &[Arc<Part>] {
        &self.parts
    }

    /// `p = A d` by dof in the axes of the scene.
    pub(super) fn multiply(&self, d: &[f64], p: &mut [f64]) {
        p.fill(0.0);
        self.parts.iter().for_each(|part| part.add(d, p));
    }

    /// `s`, about `|A| |d|` from above, by dof in the axes of the scene.
    pub(super) fn sizes_by_dof(&self, d: &[f64], s: &mut [f64]) {
        s.fill(0.0);
        self.parts.iter().for_each(|part| part.add_sizes(d, s));
    }

    /// A vector by row as one by dof in the axes of the scene.
    fn spread(&self, x: &[f64], u: &mut Vec<f64>) {
        let numbering = &self.system.numbering;
        u.clear();
        u.resize(numbering.n_dofs, 0.0);
        for (dof, x) in numbering.free_dofs.iter().zip(x) {
            u[*dof as usize] = *x;
        }
        numbering.frames.turn_back(u);
    }

    /// The matrix over the free dofs, assembled now.
    ///
    /// # Errors
    /// [`SystemError`] with its place.
    pub(super) fn assembled(&self) -> Result<Csr, SystemError> {
        let own = self.system.with_matrix()?;
        if own.is_linear() {
            return Ok(own.bulk().clone());
        }
        let mut tangent = own.new_tangent();
        let branches = self.at.branches.as_ref().map_or(Branches::AsWritten, Branches::Frozen);
        own.tangent(&self.at.u, branches, &mut tangent)?;
        Ok(own.bulk().plus(&tangent.changing)?)
    }
}

impl Operator for TermsOperator {
    fn n_rows(&self) -> usize {
        self.system.numbering.n_free()
    }

    fn apply(&self, x: &[f64], y: &mut [f64]) {
        let mut memory = self.memory.lock().unwrap_or_else(PoisonError::into_inner);
        let [u, out] = &mut *memory;
        self.spread(x, u);
        out.resize(u.len(), 0.0);
        self.multiply(u, out);
        let numbering = &self.system.numbering;
        numbering.frames.turn(out);
        for (dof, y) in numbering.free_dofs.iter().zip(y) {
            *y = out[*dof as usize];
        }
    }

    fn diagonal(&self) -> &[f64] {
        &self.diagonal
    }

    fn row_sums(&self) -> &[f64] {
        &self.row_sums
    }

    fn sizes(&self, x: &[f64], out: &mut [f64]) {
        let (mut u, mut all) = (Vec::new(), vec![0.0; self.system.numbering.n_dofs]);
        self.spread(x, &mut u);
        self.sizes_by_dof(&u, &mut all);
        self.system.numbering.turn_sizes(&mut all);
        for (dof, out) in self.system.numbering.free_dofs.iter().zip(out) {
            *out = all[*dof as usize];
        }
    }

    fn levels(&self) -> Option<OperatorLevels> {
        self.make_levels().ok()
    }

    fn matrix(&self) -> Option<Arc<Csr>> {
        self.assembled().ok().map(Arc::new)
    }

    fn bytes(&self) -> usize {
        let of_part = |part: &Arc<Part>| -> usize {
            part.terms.iter().map(|(_, term)| term.bytes() + term.skeleton().bytes()).sum()
        };
        self.parts.iter().map(of_part).sum()
    }
}
