//! Who computes what when several threads assemble.
//!
//! Every dof has one owner, the thread that adds everything to its row. A thread computes the batches that touch its
//! rows, in the order of the domain; a batch whose rows have several owners is computed by each of them. So every sum is
//! taken in the order of the domain whatever the number of threads, and no thread waits for another.

use crate::assemble::{binding::Binding, domain::Domain, scatter::NOWHERE};
use wfl_compiler::ir::LANES;

/// A batch as one thread sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Duty {
    pub(super) group: usize,
    pub(super) batch: usize,
    /// All its rows belong to this thread.
    pub(super) all_rows: bool,
    /// This thread counts its points; one thread does.
    pub(super) counts: bool,
}

/// The batches of each thread.
#[derive(Debug)]
pub(super) struct Shares {
    /// By dof; only those in rows mean something.
    pub(super) owner: Vec<u16>,
    pub(super) duties: Vec<Vec<Duty>>,
}

/// Fewest batches worth a thread of their own.
const SMALLEST_SHARE: usize = 4;

impl Shares {
    /// How many threads of `threads` are worth while.
    pub(super) fn count(domain: &Domain, threads: usize) -> usize {
        let batches: usize = domain.groups.iter().map(super::domain::Group::n_batches).sum();
        threads.min(batches / SMALLEST_SHARE).clamp(1, usize::from(u16::MAX))
    }

    /// Shares for `n` threads. `dofs[group][entity * n_dofs + k]`
    pub(super) fn new(domain: &Domain, binding: &Binding, dofs: &[Vec<u32>], n: usize) -> Self {
        let cost = |g: usize| domain.groups[g].n_points() * binding.groups[g].n_dofs().pow(2);
        let total: usize = domain.groups.iter().enumerate().map(|(g, group)| group.n_batches() * cost(g)).sum();
        let rows: Vec<Vec<usize>> = (0..domain.groups.len()).map(|g| row_dofs(binding, g)).collect();
        let batches = || (0..domain.groups.len()).flat_map(|g| (0..domain.groups[g].n_batches()).map(move |b| (g, b)));
        let mut home = Vec::new();
        let mut spent = 0;
        for (g, _) in batches() {
            home.push(u16::try_from((spent * n / total.max(1)).min(n - 1)).expect("fewer than 2^16 threads"));
            spent += cost(g);
        }
        let touched = |g: usize, batch: usize| {
            let (n_dofs, rows) = (binding.groups[g].n_dofs(), &rows[g]);
            let entities = batch * LANES..((batch + 1) * LANES).min(domain.groups[g].entities.len());
            entities.flat_map(move |e| rows.iter().map(move |k| dofs[g][e * n_dofs + k])).filter(|d| *d != NOWHERE)
        };
        let size = dofs.iter().flatten().filter(|d| **d != NOWHERE).max().map_or(0, |d| *d as usize + 1);
        let mut owner = vec![u16::MAX; size];
        for ((g, batch), home) in batches().zip(&home) {
            touched(g, batch).for_each(|d| owner[d as usize] = owner[d as usize].min(*home));
        }
        let mut duties = vec![Vec::new(); n];
        let mut owners = Vec::new();
        for ((group, batch), home) in batches().zip(&home) {
            owners.clear();
            owners.push(*home);
            owners.extend(touched(group, batch).map(|d| owner[d as usize]));
            owners.sort_unstable();
            owners.dedup();
            for o in &owners {
                let duty = Duty { group, batch, all_rows: owners.len() == 1, counts: o == home };
                duties[usize::from(*o)].push(duty);
            }
        }
        Self { owner, duties }
    }
}

/// Local dofs that carry a test slot.
fn row_dofs(binding: &Binding, g: usize) -> Vec<usize> {
    let mut out = Vec::new();
    for (b, basis) in binding.groups[g].bases.iter().enumerate() {
        for c in 0..basis.n_components {
            if binding.tests.iter().any(|t| t.basis == b && t.component == c) {
                out.extend((0..basis.n_nodes).map(|i| basis.dof(i, c)));
            }
        }
    }
    out
}
