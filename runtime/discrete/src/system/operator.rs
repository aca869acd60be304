//! The matrix of the linear terms as an operator: terms on cells are applied, those on faces are a small matrix.
//!
//! Promises: the same linear map as the bulk, to rounding, in the rows of fixed dofs, too. Holds what its products need and a
//! copy of the system that can assemble the bulk after all.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use wfl_compiler::Class;
use wfl_sparse::csr::{Csr, Restriction};
use wfl_sparse::index::NONE;
use wfl_sparse::solve::{CoarserLevel, NodeLayout, Operator, scale_of};

use super::{System, SystemError, pattern};
use crate::assemble::{AppliedTerm, AssembledTerm, Counts, MOST_COMPONENTS, NodeBlocks};
use crate::field::FieldSpace;

/// The operator of the linear terms of a system.
pub(super) struct LinearOperator {
    /// What the matrix is assembled from where it is asked for; it has none.
    system: Box<System>,
    terms: Vec<AppliedTerm>,
    /// Terms that are not applied, by dof in the axes of the scene; `None` where there are none.
    rest: Option<Csr>,
    /// By place of the layout its dof, or [`NONE`].
    dofs: Vec<u32>,
    scale: f64,
    /// By node of the layout.
    blocks: Vec<f64>,
    /// By dof, of the terms that are applied, in the axes of the scene.
    sums: Vec<f64>,
    /// By free dof, of all terms.
    row_sums: Vec<f64>,
    coarser: CoarserLevel,
    double: Mutex<[Vec<f64>; 2]>,
    single: Mutex<[Vec<f32>; 2]>,
}

impl fmt::Debug for LinearOperator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LinearOperator").field("terms", &self.terms.len()).finish_non_exhaustive()
    }
}

impl System {
    /// Why the linear terms cannot be applied without their matrix, in words; `None` if they can.
    #[must_use]
    pub fn obstacle_to_operator(&self) -> Option<String> {
        if !self.is_linear() {
            return Some("the scene is not linear".to_owned());
        }
        if self.share.is_some() {
            return Some("several ranks share the rows".to_owned());
        }
        if self.known.rates.is_some() || self.redistribution.is_some() {
            return Some("rates need matrices of their own".to_owned());
        }
        if self.numbering.has_ties() {
            return Some("dofs follow others".to_owned());
        }
        if let Some(term) = self.linear_terms().find(|term| !term.law.symmetric) {
            return Some(format!("the term `{}` is not symmetric", term.law.name));
        }
        let degree = |k: &usize| self.fields[*k].degree();
        let solved = (0..self.fields.len()).filter(|k| self.range(*k).is_some());
        if solved.clone().map(|k| degree(&k)).max().unwrap_or(0) < 2 {
            return Some("all elements are of degree 1".to_owned());
        }
        let is_nodal = |k: &usize| matches!(self.fields[*k].space, FieldSpace::Nodal(_));
        if let Some(k) = solved.clone().find(|k| !is_nodal(k) || self.fields[*k].n_components > MOST_COMPONENTS) {
            return Some(format!("`{}` has no nodes of three components at most", self.fields[k].name));
        }
        if !self.linear_terms().any(AssembledTerm::can_be_applied) {
            return Some("no linear term is one on cells".to_owned());
        }
        let (fields, starts) = (&self.fields, &self.numbering.starts);
        let on_faces = self.linear_terms().filter(|term| !term.can_be_applied());
        on_faces.filter_map(|term| term.obstacle_to_coarser(fields, starts)).next()
    }

    /// What a product with the linear terms on cells takes.
    #[must_use]
    pub fn counts_of_product(&self) -> Counts {
        let applied = self.linear_terms().filter(|term| term.can_be_applied());
        applied.map(AssembledTerm::counts_of_product).fold(Counts::default(), |sum, own| Counts {
            operations: sum.operations + own.operations,
            gathered: sum.gathered + own.gathered,
            entries: sum.entries + own.entries,
        })
    }

    /// From the next step on the linear terms have no matrix but an operator, if [`Self::obstacle_to_operator`] is none.
    pub fn leave_matrix(&mut self) {
        self.without_matrix = self.obstacle_to_operator().is_none();
        if self.without_matrix {
            (self.linear, self.bulk) = (None, Arc::new(super::nothing(self.numbering.n_free())));
        }
    }

    /// The matrix of the linear terms over the free dofs, assembled now where an operator stands in its place.
    ///
    /// # Errors
    /// [`SystemError`] with its place.
    pub fn matrix(&self) -> Result<Arc<Csr>, SystemError> {
        if self.operator().is_none() {
            return Ok(self.shared_bulk());
        }
        let mut own = self.with_nothing_assembled();
        own.assemble_linear(&vec![0.0; self.numbering.n_dofs])?;
        Ok(own.shared_bulk())
    }

    /// A copy that assembles its matrix and has none yet.
    fn with_nothing_assembled(&self) -> Self {
        Self { linear: None, without_matrix: false, ..self.clone() }
    }

    /// Makes the operator of the linear terms at the present step.
    ///
    /// # Errors
    /// [`SystemError`] with its place.
    pub(super) fn make_operator(&self) -> Result<LinearOperator, SystemError> {
        let mut system = Box::new(self.with_nothing_assembled());
        let is_linear = |k: &usize| self.terms[*k].law.class == Class::Linear;
        let (applied, others): (Vec<usize>, Vec<usize>) =
            (0..self.terms.len()).filter(is_linear).partition(|k| self.terms[*k].can_be_applied());
        let rest = if others.is_empty() { None } else { Some(system.tangent_of(&others)?) };
        let layout = self.node_layout().map_err(SystemError::Layout)?;
        let zero = vec![0.0; self.numbering.n_dofs];
        let values = self.values(&zero);
        let mut sums = zero.clone();
        let mut by_dof = vec![0.0; MOST_COMPONENTS * zero.len()];
        for k in &applied {
            let to = NodeBlocks { blocks: &mut by_dof, sums: &mut sums };
            self.terms[*k].add_node_blocks(&self.mesh, values.view(), to)?;
        }
        if let Some(rest) = &rest {
            self.add_blocks_of(rest, &mut by_dof);
        }
        let largest = by_dof.iter().fold(0.0f64, |largest, entry| largest.max(entry.abs()));
        let scale = scale_of(largest);
        let mut dofs = vec![NONE; layout.points.len() * layout.components];
        for (place, dof) in layout.places.iter().zip(&self.numbering.free_dofs) {
            dofs[*place as usize] = *dof;
        }
        let blocks = node_blocks(&by_dof, &dofs, &layout, scale);
        drop(by_dof);
        let of_term = |k: &usize| {
            let of = (self.numbering.starts.as_slice(), self.numbering.n_dofs);
            self.terms[*k].applied(&self.mesh, values.view(), of, scale)
        };
        let terms = applied.iter().map(of_term).collect();
        let coarser = self.coarser_level(&layout)?;
        let mut all = sums.clone();
        if let Some(rest) = &rest {
            add_sizes(rest, &vec![1.0; all.len()], &mut all);
        }
        self.numbering.turn_sizes(&mut all);
        let mut row_sums = Vec::new();
        self.numbering.gather(&all, &mut row_sums);
        let (double, single) = Default::default();
        Ok(LinearOperator { system, terms, rest, dofs, scale, blocks, sums, row_sums, coarser, double, single })
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

    /// Elements of degree 1 on the same cells.
    fn coarser_level(&self, layout: &NodeLayout) -> Result<CoarserLevel, SystemError> {
        let (fields, numbering) = (&self.fields, &self.numbering);
        let made = self.linear_terms().map(|term| term.coarser(&self.mesh, fields, &numbering.starts));
        let mut terms = made.collect::<Result<Vec<_>, String>>().map_err(SystemError::Layout)?;
        let n = numbering.n_dofs;
        let mut matrix = pattern(terms.iter(), n, &numbering.frames, |d| d, None)?;
        let every_dof: Vec<u32> = (0..u32::try_from(n).expect("fewer than 2^32 dofs")).collect();
        let zero = vec![0.0; n];
        for term in &mut terms {
            term.locate(matrix.pattern(), &every_dof);
            term.add_tangent(&self.mesh, self.values(&zero).view(), matrix.values_mut())?;
            term.forget();
        }
        numbering.frames.turn_matrix(&mut matrix, |d| d);
        let (numbers, n_nodes) = coarser_numbers(layout);
        let (mut targets, mut places) = (vec![NONE; n], Vec::new());
        let size = layout.components;
        for (place, dof) in layout.places.iter().zip(&numbering.free_dofs) {
            let number = numbers[*place as usize / size];
            if number != NONE {
                targets[*dof as usize] = u32::try_from(places.len()).expect("fewer than 2^32 dofs");
                places.push(number * size as u32 + place % size as u32);
            }
        }
        let map = Restriction::new(matrix.pattern(), &targets, places.len())?;
        Ok(CoarserLevel { matrix: map.apply(&matrix), places, n_nodes })
    }
}

/// By node of a layout its number on the level of degree 1, or [`NONE`]; and how many there are.
fn coarser_numbers(layout: &NodeLayout) -> (Vec<u32>, usize) {
    let mut numbers = vec![NONE; layout.points.len()];
    let mut count = 0;
    if let Some(given) = &layout.interpolation {
        for (node, number) in numbers.iter_mut().enumerate() {
            if matches!(&given.weights[given.starts[node]..given.starts[node + 1]], [(own, _)] if *own as usize == node)
            {
                *number = count;
                count += 1;
            }
        }
    }
    (numbers, count as usize)
}

/// The diagonal blocks of the nodes of a layout, in their frames, from entries by dof in the axes of the scene. `dofs` are those
/// of its places.
fn node_blocks(by_dof: &[f64], dofs: &[u32], layout: &NodeLayout, scale: f64) -> Vec<f64> {
    let size = layout.components;
    let mut blocks = vec![0.0; layout.points.len() * size * size];
    let mut frames = layout.frames.iter().peekable();
    for (node, block) in blocks.chunks_exact_mut(size * size).enumerate() {
        let own = &dofs[node * size..][..size];
        let axes = frames.next_if(|frame| frame.0 as usize == node).map(|frame| &frame.1);
        // the dofs of a node follow one another, also those that are fixed
        let Some((c, dof)) = own.iter().enumerate().find(|(_, dof)| **dof != NONE) else { continue };
        let first = *dof as usize - c;
        let entry = |c: usize, d: usize| by_dof[(first + c) * MOST_COMPONENTS + d];
        for c in 0..size {
            for d in 0..size {
                block[c * size + d] = match (own[c] == NONE || own[d] == NONE, axes) {
                    (true, _) => f64::from(u8::from(c == d)) / scale,
                    (false, None) => entry(c, d),
                    (false, Some(axes)) => {
                        let along = |i: usize| (0..size).map(|j| entry(i, j) * axes[d][j]).sum::<f64>();
                        (0..size).map(|i| axes[c][i] * along(i)).sum()
                    }
                };
            }
        }
    }
    blocks
}

/// `out = out + |A| |x|`.
fn add_sizes(matrix: &Csr, x: &[f64], out: &mut [f64]) {
    for (row, out) in out.iter_mut().enumerate() {
        let (columns, values) = matrix.row(row);
        *out += columns.iter().zip(values).map(|(column, value)| (value * x[*column as usize]).abs()).sum::<f64>();
    }
}

impl LinearOperator {
    /// `p = A d` by dof in the axes of the scene.
    pub(super) fn multiply(&self, d: &[f64], p: &mut [f64]) {
        p.fill(0.0);
        self.terms.iter().for_each(|term| term.add(d, p));
        if let Some(rest) = &self.rest {
            for (row, p) in p.iter_mut().enumerate() {
                let (columns, values) = rest.row(row);
                *p += columns.iter().zip(values).map(|(column, value)| value * d[*column as usize]).sum::<f64>();
            }
        }
    }

    /// `s`, about `|A| |d|` from above, by dof in the axes of the scene.
    pub(super) fn sizes_by_dof(&self, d: &[f64], s: &mut [f64]) {
        s.fill(0.0);
        self.terms.iter().for_each(|term| term.largest_nearby(d, s));
        s.iter_mut().zip(&self.sums).for_each(|(s, sum)| *s *= sum);
        if let Some(rest) = &self.rest {
            add_sizes(rest, d, s);
        }
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
}

impl Operator for LinearOperator {
    fn n_rows(&self) -> usize {
        self.system.numbering.n_free()
    }

    fn apply(&self, x: &[f64], y: &mut [f64]) {
        let mut memory = self.double.lock().unwrap_or_else(PoisonError::into_inner);
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

    fn apply_single(&self, x: &[f32], y: &mut [f32]) {
        let mut memory = self.single.lock().unwrap_or_else(PoisonError::into_inner);
        let [u, out] = &mut *memory;
        let numbering = &self.system.numbering;
        for vector in [&mut *u, &mut *out] {
            vector.clear();
            vector.resize(numbering.n_dofs, 0.0);
        }
        for (dof, x) in self.dofs.iter().zip(x).filter(|(dof, _)| **dof != NONE) {
            u[*dof as usize] = *x;
        }
        numbering.frames.turn_back_single(u);
        self.terms.iter().for_each(|term| term.add_single(u, out));
        if let Some(rest) = &self.rest {
            for (row, out) in out.iter_mut().enumerate() {
                let (columns, values) = rest.row(row);
                let product = |(column, value): (&u32, &f64)| value * f64::from(u[*column as usize]);
                *out += (self.scale * columns.iter().zip(values).map(product).sum::<f64>()) as f32;
            }
        }
        numbering.frames.turn_single(out);
        for ((dof, x), y) in self.dofs.iter().zip(x).zip(y) {
            *y = if *dof == NONE { *x } else { out[*dof as usize] };
        }
    }

    fn scale(&self) -> f64 {
        self.scale
    }

    fn diagonal_blocks(&self) -> &[f64] {
        &self.blocks
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

    fn coarser(&self) -> &CoarserLevel {
        &self.coarser
    }

    fn matrix(&self) -> Option<Arc<Csr>> {
        let mut own = self.system.clone();
        own.assemble_linear(&vec![0.0; self.system.numbering.n_dofs]).ok()?;
        Some(own.shared_bulk())
    }

    fn bytes(&self) -> usize {
        self.terms.iter().map(AppliedTerm::bytes).sum()
    }
}
