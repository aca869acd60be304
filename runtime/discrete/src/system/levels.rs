//! What multigrid of an operator begins with: the finest level in single precision, its diagonal blocks, and the level of elements
//! of degree 1 on the same cells.

use std::sync::{Arc, Mutex, PoisonError};

use wfl_sparse::csr::{Csr, Restriction};
use wfl_sparse::index::NONE;
use wfl_sparse::solve::{CoarserLevel, FinestLevel, NodeLayout, OperatorLevels, scale_of};

use super::applied::TermsOperator;
use super::{Numbering, System, SystemError, pattern};
use crate::assemble::{AppliedTerm, AssembledTerm, MOST_COMPONENTS};

/// Terms applied in single precision.
struct SingleLevel {
    numbering: Arc<Numbering>,
    /// Times the scale.
    terms: Vec<AppliedTerm<f32>>,
    /// Terms that are not applied, by dof in the axes of the scene, times the scale.
    rest: Option<Csr>,
    /// By place of the layout its dof, or [`NONE`].
    dofs: Vec<u32>,
    memory: Mutex<[Vec<f32>; 2]>,
}

impl FinestLevel for SingleLevel {
    fn apply(&self, x: &[f32], y: &mut [f32]) {
        let mut memory = self.memory.lock().unwrap_or_else(PoisonError::into_inner);
        let [u, out] = &mut *memory;
        let numbering = &self.numbering;
        for vector in [&mut *u, &mut *out] {
            vector.clear();
            vector.resize(numbering.n_dofs, 0.0);
        }
        for (dof, x) in self.dofs.iter().zip(x).filter(|(dof, _)| **dof != NONE) {
            u[*dof as usize] = *x;
        }
        numbering.frames.turn_back_single(u);
        self.terms.iter().for_each(|term| term.add(u, out));
        if let Some(rest) = &self.rest {
            for (row, out) in out.iter_mut().enumerate() {
                let (columns, values) = rest.row(row);
                let product = |(column, value): (&u32, &f64)| value * f64::from(u[*column as usize]);
                *out += columns.iter().zip(values).map(product).sum::<f64>() as f32;
            }
        }
        numbering.frames.turn_single(out);
        for ((dof, x), y) in self.dofs.iter().zip(x).zip(y) {
            *y = if *dof == NONE { *x } else { out[*dof as usize] };
        }
    }

    fn bytes(&self) -> usize {
        self.terms.iter().map(|term| term.bytes() + term.skeleton().bytes()).sum()
    }
}

impl TermsOperator {
    /// Makes them.
    ///
    /// # Errors
    /// [`SystemError`].
    pub(super) fn make_levels(&self) -> Result<OperatorLevels, SystemError> {
        let system = &self.system;
        let Some(held) = &system.without_matrix else {
            return Err(SystemError::Layout("there is a matrix".to_owned()));
        };
        let (layout, n) = (&held.layout, system.numbering.n_dofs);
        let mut by_dof = vec![0.0; MOST_COMPONENTS * n];
        for part in &self.parts {
            by_dof.iter_mut().zip(&part.blocks).for_each(|(block, own)| *block += own);
        }
        let scale = scale_of(by_dof.iter().fold(0.0f64, |largest, entry| largest.max(entry.abs())));
        let mut dofs = vec![NONE; layout.points.len() * layout.components];
        for (place, dof) in layout.places.iter().zip(&system.numbering.free_dofs) {
            dofs[*place as usize] = *dof;
        }
        let blocks = node_blocks(&by_dof, &dofs, layout, scale);
        let zero = vec![0.0; n];
        let values = system.values(&zero);
        let applied = || self.parts.iter().flat_map(|part| &part.terms);
        let of_level = |(k, term): &(usize, Arc<AppliedTerm<f64>>)| system.on_levels(held, *k, term);
        let single = |at: &(usize, Arc<AppliedTerm<f64>>)| {
            let (own, starts) = (of_level(at), &system.numbering.starts);
            let skeleton = held.terms[at.0].single.get_or_init(|| Arc::new(own.skeleton(&system.mesh, starts, n)));
            own.applied(&system.mesh, values.view(), skeleton, scale)
        };
        let terms = applied().map(single).collect::<Result<Vec<_>, _>>()?;
        let mut rest: Option<Csr> = None;
        for own in self.parts.iter().filter_map(|part| part.rest.as_ref()) {
            rest = Some(match rest {
                Some(sum) => sum.plus(own)?,
                None => own.clone(),
            });
        }
        let coarser = system.coarser_level(layout, applied().map(of_level), rest.as_ref())?;
        if let Some(rest) = &mut rest {
            rest.values_mut().iter_mut().for_each(|value| *value *= scale);
        }
        let numbering = Arc::clone(&system.numbering);
        let finest = Arc::new(SingleLevel { numbering, terms, rest, dofs, memory: Mutex::default() });
        Ok(OperatorLevels { finest, scale, blocks, coarser })
    }
}

impl System {
    /// By free dof the diagonal of a matrix, from its entries by dof between components of a node.
    pub(super) fn diagonal_of_blocks(&self, by_dof: &[f64]) -> Vec<f64> {
        let of = |dof: &u32| {
            let (field, _, c) = self.numbering.describe(&self.fields, *dof as usize);
            let (first, n) = (*dof as usize - c, self.fields[field].n_components.min(MOST_COMPONENTS));
            match self.numbering.frames.of(first) {
                None => by_dof[*dof as usize * MOST_COMPONENTS + c],
                Some(frame) => {
                    let axis = &frame.axes[c];
                    let along =
                        |i: usize| (0..n).map(|j| by_dof[(first + i) * MOST_COMPONENTS + j] * axis[j]).sum::<f64>();
                    (0..n).map(|i| axis[i] * along(i)).sum()
                }
            }
        };
        self.numbering.free_dofs.iter().map(of).collect()
    }

    /// The matrix of terms with elements of degree 1 on the same cells, and of what interpolation makes of `rest`.
    fn coarser_level(
        &self,
        layout: &NodeLayout,
        terms: impl Iterator<Item = AssembledTerm>,
        rest: Option<&Csr>,
    ) -> Result<CoarserLevel, SystemError> {
        let (fields, numbering, n) = (&self.fields, &self.numbering, self.numbering.n_dofs);
        let made = terms.map(|term| term.coarser(&self.mesh, fields, &numbering.starts));
        let mut terms = made.collect::<Result<Vec<_>, String>>().map_err(SystemError::Layout)?;
        let mut matrix = pattern(terms.iter(), n, &numbering.frames, |d| d, None)?;
        let every_dof: Vec<u32> = (0..u32::try_from(n).expect("fewer than 2^32 dofs")).collect();
        let zero = vec![0.0; n];
        for term in &mut terms {
            term.locate(matrix.pattern(), &every_dof);
            term.add_tangent(&self.mesh, self.values(&zero).view(), matrix.values_mut())?;
            term.forget();
        }
        let mut dofs = vec![NONE; layout.points.len() * layout.components];
        for (place, dof) in layout.places.iter().zip(&numbering.free_dofs) {
            dofs[*place as usize] = *dof;
        }
        if let Some(rest) = rest {
            matrix = matrix.plus(&interpolated(rest, layout, &dofs)?)?;
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

/// The first dof of each node of a layout, from the dofs of its places: those of a node follow one another, also where some are
/// fixed.
fn first_dofs(layout: &NodeLayout, dofs: &[u32]) -> Vec<u32> {
    let of = |own: &[u32]| {
        let solved = (0u32..).zip(own).find(|(_, dof)| **dof != NONE);
        solved.map_or(NONE, |(c, dof)| dof - c)
    };
    dofs.chunks_exact(layout.components).map(of).collect()
}

/// A matrix by dof between functions of degree 1, by dof of the nodes at the vertices.
fn interpolated(matrix: &Csr, layout: &NodeLayout, dofs: &[u32]) -> Result<Csr, SystemError> {
    let n = matrix.n_rows();
    let first = &first_dofs(layout, dofs);
    let mut node_of = vec![NONE; n];
    for (node, dof) in (0u32..).zip(first).filter(|(_, dof)| **dof != NONE) {
        for c in 0..layout.components {
            node_of[*dof as usize + c] = node;
        }
    }
    let node_of = &node_of;
    let parents = |dof: usize| {
        let node = node_of[dof];
        let list = match &layout.interpolation {
            Some(given) if node != NONE => &given.weights[given.starts[node as usize]..given.starts[node as usize + 1]],
            _ => &[],
        };
        let component = if node == NONE { 0 } else { dof as u32 - first[node as usize] };
        list.iter().map(move |(parent, weight)| (first[*parent as usize] + component, *weight))
    };
    let mut entries = Vec::new();
    let (is_turned, components) = (!layout.frames.is_empty(), layout.components as u32);
    for row in 0..n {
        let (columns, values) = matrix.row(row);
        for (column, value) in columns.iter().zip(values) {
            for (i, of_row) in parents(row) {
                entries.extend(parents(*column as usize).map(|(j, of_column)| (i, j, of_row * value * of_column)));
                if is_turned {
                    // turning a node mixes its rows and its columns
                    let all = |dof: u32| (0..components).map(move |c| first[node_of[dof as usize] as usize] + c);
                    let nodes = parents(*column as usize).map(|(j, _)| j);
                    entries.extend(nodes.flat_map(|j| all(i).flat_map(move |k| all(j).map(move |l| (k, l, 0.0)))));
                }
            }
        }
    }
    Ok(Csr::from_triplets(n, n, &entries)?)
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
