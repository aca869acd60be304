//! Distribution of the batches over threads, as in assembly: every node has one owner, who computes all batches that touch its
//! nodes in their order, so that sums have one order for any number of threads.

use crate::assemble::applied::{cells::Cells, number::Number};

/// Fewest batches worth a thread of their own.
const SMALLEST: usize = 4;
/// Owner of a node that no batch touches.
const NOBODY: u16 = u16::MAX;

/// A batch as one thread sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Duty {
    pub(super) group: usize,
    pub(super) batch: usize,
    /// All its nodes belong to this thread.
    pub(super) all_nodes: bool,
}

/// The batches of each thread.
#[derive(Debug)]
pub(super) struct Portions {
    /// By first dof of a node.
    pub(super) owner: Vec<u16>,
    pub(super) duties: Vec<Vec<Duty>>,
}

/// How many threads of `threads` are worth while.
pub(super) fn count<T: Number>(groups: &[Cells<T>], threads: usize) -> usize {
    let batches: usize = groups.iter().map(Cells::n_batches).sum();
    threads.min(batches / SMALLEST).clamp(1, usize::from(NOBODY) - 1)
}

impl Portions {
    /// For `n` threads and so many dofs.
    pub(super) fn new<T: Number>(groups: &[Cells<T>], n: usize, n_dofs: usize) -> Self {
        let batches = || groups.iter().enumerate().flat_map(|(g, cells)| (0..cells.n_batches()).map(move |b| (g, b)));
        if n == 1 {
            let duties = batches().map(|(group, batch)| Duty { group, batch, all_nodes: true }).collect();
            return Self { owner: Vec::new(), duties: vec![duties] };
        }
        let total = batches().count();
        let nodes = |g: usize, b: usize| {
            let cells: &Cells<T> = &groups[g];
            cells.functions.iter().flat_map(move |of| of.dofs_of(b).iter().map(|dof| *dof as usize))
        };
        let mut owner = vec![NOBODY; n_dofs];
        for (k, (g, b)) in batches().enumerate() {
            let home = u16::try_from(k * n / total).expect("fewer than 2^16 threads");
            nodes(g, b).for_each(|dof| owner[dof] = owner[dof].min(home));
        }
        let mut duties = vec![Vec::new(); n];
        let mut owners = Vec::new();
        for (group, batch) in batches() {
            owners.clear();
            owners.extend(nodes(group, batch).map(|dof| owner[dof]));
            owners.sort_unstable();
            owners.dedup();
            for owner in &owners {
                duties[usize::from(*owner)].push(Duty { group, batch, all_nodes: owners.len() == 1 });
            }
        }
        Self { owner, duties }
    }
}
