//! Groups of strongly coupled nodes, which are the nodes of the next coarser level.
//!
//! P. Vanek, J. Mandel, M. Brezina, Algebraic multigrid by smoothed aggregation for second and fourth order elliptic
//! problems, Computing 56 (1996), section 3. Nodes i and j are strongly coupled where `|A_ij| > theta sqrt(m_i m_j)`, in
//! Frobenius norms of blocks; m_i is the largest norm of a coupling of node i, not that of its diagonal block, which grows
//! with the number of neighbours. Where cells are long and thin a node then joins those that it truly depends on.
//!
//! Promises: the same groups for any number of threads. Does not make matrices.

use rayon::prelude::*;

use super::blocks::{ROWS_PER_TASK, RowBuffer, Rows};
use crate::index::NONE;

/// Groups of nodes.
#[derive(Debug, Clone)]
pub(super) struct Aggregates {
    /// By node its group, or [`NONE`]: a node without strong couplings is left to the smoother.
    pub(super) of: Vec<u32>,
    /// Number of groups.
    pub(super) count: usize,
}

/// Strong couplings: by node its neighbours with the square of the relative size of the coupling.
struct Strong {
    starts: Vec<usize>,
    list: Vec<(u32, f32)>,
}

impl Strong {
    fn new(matrix: &dyn Rows, threshold: f64) -> Self {
        let n = matrix.n_nodes();
        let norm_2 = |block: &[f64]| block.iter().map(|value| value * value).sum::<f64>();
        let area = matrix.size() * matrix.size();
        let mut own = vec![0.0f64; n];
        own.par_chunks_mut(ROWS_PER_TASK).enumerate().for_each_init(RowBuffer::default, |buffer, (chunk, own)| {
            for (offset, own) in own.iter_mut().enumerate() {
                let node = chunk * ROWS_PER_TASK + offset;
                let (columns, blocks) = matrix.row(node, buffer);
                let others = columns.iter().zip(blocks.chunks_exact(area)).filter(|(c, _)| **c as usize != node);
                *own = others.map(|(_, block)| norm_2(block)).fold(0.0, f64::max).sqrt();
            }
        });
        let of_chunk = |buffer: &mut RowBuffer, chunk: usize| {
            let (mut counts, mut list) = (Vec::new(), Vec::new());
            for node in chunk * ROWS_PER_TASK..((chunk + 1) * ROWS_PER_TASK).min(n) {
                let begin = list.len();
                let (columns, blocks) = matrix.row(node, buffer);
                for (column, block) in columns.iter().zip(blocks.chunks_exact(area)) {
                    let strength = norm_2(block) / (own[node] * own[*column as usize]);
                    if *column as usize != node && strength > threshold * threshold {
                        list.push((*column, strength as f32));
                    }
                }
                counts.push(list.len() - begin);
            }
            (counts, list)
        };
        let chunks: Vec<_> =
            (0..n.div_ceil(ROWS_PER_TASK)).into_par_iter().map_init(RowBuffer::default, of_chunk).collect();
        let (mut starts, mut list) = (vec![0], Vec::new());
        for (counts, part) in chunks {
            for count in counts {
                starts.push(starts[starts.len() - 1] + count);
            }
            list.extend(part);
        }
        Self { starts, list }
    }

    /// Couplings of groups: the strongest of those of their nodes.
    fn of_groups(&self, groups: &Aggregates) -> Self {
        let mut pairs: Vec<(u32, u32, f32)> = Vec::new();
        for (node, group) in groups.of.iter().enumerate().filter(|(_, group)| **group != NONE) {
            let others = self.of(node).iter().map(|(other, strength)| (groups.of[*other as usize], *strength));
            pairs.extend(others.filter(|(g, _)| *g != NONE && g != group).map(|(g, strength)| (*group, g, strength)));
        }
        pairs.sort_unstable_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(b.2.total_cmp(&a.2)));
        pairs.dedup_by_key(|pair| (pair.0, pair.1));
        let mut starts = vec![0; groups.count + 1];
        pairs.iter().for_each(|pair| starts[pair.0 as usize + 1] += 1);
        (0..groups.count).for_each(|group| starts[group + 1] += starts[group]);
        Self { starts, list: pairs.iter().map(|pair| (pair.1, pair.2)).collect() }
    }

    fn of(&self, node: usize) -> &[(u32, f32)] {
        &self.list[self.starts[node]..self.starts[node + 1]]
    }
}

/// Groups the nodes of a matrix in no more than `most` groups, where groups of groups can do that: a node that is coupled
/// along a line alone has few neighbours.
pub(super) fn aggregates(matrix: &dyn Rows, threshold: f64, most: usize) -> Aggregates {
    let mut strong = Strong::new(matrix, threshold);
    let mut groups = grouped(&strong);
    // what the nodes of the present graph, which are groups themselves after the first round, belong to
    let mut layer = groups.clone();
    while groups.count > most {
        strong = strong.of_groups(&layer);
        let mut larger = grouped(&strong);
        let before = layer.count;
        // a group without strong couplings to others stays what it is
        for group in larger.of.iter_mut().filter(|group| **group == NONE) {
            *group = larger.count as u32;
            larger.count += 1;
        }
        if larger.count == before {
            break;
        }
        groups.of.iter_mut().filter(|group| **group != NONE).for_each(|group| *group = larger.of[*group as usize]);
        groups.count = larger.count;
        layer = larger;
    }
    groups
}

/// Groups the nodes of a graph.
fn grouped(strong: &Strong) -> Aggregates {
    let n = strong.starts.len() - 1;
    let (mut of, mut count) = (vec![NONE; n], 0u32);
    // whole neighbourhoods that touch no group
    for node in 0..n {
        let near = strong.of(node);
        if of[node] == NONE && !near.is_empty() && near.iter().all(|(other, _)| of[*other as usize] == NONE) {
            of[node] = count;
            near.iter().for_each(|(other, _)| of[*other as usize] = count);
            count += 1;
        }
    }
    // what is left joins the group of the neighbour that it is coupled to most
    let first = of.clone();
    for node in (0..n).filter(|node| first[*node] == NONE) {
        let near = strong.of(node).iter().filter(|(other, _)| first[*other as usize] != NONE);
        let nearest = near.fold(None, |best: Option<(u32, f32)>, here| match best {
            Some(best) if best.1 >= here.1 => Some(best),
            _ => Some(*here),
        });
        if let Some((other, _)) = nearest {
            of[node] = first[other as usize];
        }
    }
    // nodes between such that could not join: groups of what is left of their neighbourhoods
    for node in 0..n {
        let near = strong.of(node);
        if of[node] != NONE || near.is_empty() {
            continue;
        }
        of[node] = count;
        for (other, _) in near {
            if of[*other as usize] == NONE {
                of[*other as usize] = count;
            }
        }
        count += 1;
    }
    Aggregates { of, count: count as usize }
}
