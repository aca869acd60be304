//! Distribution of work when several threads assemble.
//!
//! Every dof has one owner, the thread that adds everything to its row. A thread computes the batches that touch its
//! rows, in the order of the domain; a batch whose rows have several owners is computed by each of them. So every sum
//! has the order of the domain for any number of threads, and no thread waits for another. Where several ranks assemble,
//! the threads of each share out the rows of theirs. Ownership changes only
//! between blocks of dofs, so the rows of a thread form a few ranges of a matrix.

use crate::{
    assemble::binding::Binding,
    domain::{Domain, Group},
    share::Share,
};
use wfl_compiler::ir::LANES;
use wfl_mesh::mesh::Mesh;
use wfl_sparse::index::NONE;

/// A batch as one thread sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Duty {
    pub(super) group: usize,
    pub(super) batch: usize,
    /// All its rows belong to this thread of this rank.
    pub(super) all_rows: bool,
    /// By entity of the batch, a bit each: this thread counts its points; one thread of one rank does.
    pub(super) counts: u8,
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

/// Blocks of dofs a thread.
const BLOCKS: usize = 64;

/// Owner of a dof that no batch touches, or that another rank has.
const NOBODY: u16 = u16::MAX;

impl Shares {
    /// How many threads of `threads` are worth while.
    pub(super) fn count(domain: &Domain, threads: usize) -> usize {
        let batches: usize = domain.groups.iter().map(Group::n_batches).sum();
        threads.min(batches / SMALLEST_SHARE).clamp(1, usize::from(u16::MAX))
    }

    /// Shares for `n` threads of the rank that has `share`; without one all rows.
    pub(super) fn new(
        mesh: &Mesh,
        domain: &Domain,
        binding: &Binding,
        touched: &Touched<'_>,
        share: Option<&Share>,
        n: usize,
    ) -> Self {
        let size = touched.dofs.iter().flatten().filter(|d| **d != NONE).max().map_or(0, |d| *d as usize + 1);
        if let (1, None) = (n, share) {
            return Self::of_one(domain, size);
        }
        let is_own = |d: u32| share.is_none_or(|share| share.owns(d as usize));
        let counted = |g: usize, batch: usize| {
            let group = &domain.groups[g];
            let entities = (batch * LANES..group.entities.len()).take(LANES).enumerate();
            let counts = entities.filter(|(_, k)| share.is_none() || group.is_counted(mesh, *k));
            counts.fold(0, |bits, (lane, _)| bits | 1 << lane)
        };
        let all = (0..domain.groups.len()).flat_map(|g| (0..domain.groups[g].n_batches()).map(move |b| (g, b)));
        let batches: Vec<(usize, usize)> =
            all.filter(|(g, b)| touched.dofs(*g, *b).any(is_own) || counted(*g, *b) != 0).collect();
        let home = homes(domain, binding, &batches, n);
        let mut owner = vec![NOBODY; size];
        for ((g, batch), home) in batches.iter().zip(&home) {
            touched.dofs(*g, *batch).for_each(|d| owner[d as usize] = owner[d as usize].min(*home));
        }
        for block in owner.chunks_mut(size.div_ceil(BLOCKS * n).max(1)) {
            let first = block.iter().copied().find(|o| *o != NOBODY);
            block.fill(first.unwrap_or(NOBODY));
        }
        (0u32..).zip(&mut owner).filter(|(dof, _)| !is_own(*dof)).for_each(|(_, owner)| *owner = NOBODY);
        let mut duties = vec![Vec::new(); n];
        let mut owners = Vec::new();
        for ((group, batch), home) in batches.into_iter().zip(&home) {
            owners.clear();
            owners.push(*home);
            owners.extend(touched.dofs(group, batch).map(|d| owner[d as usize]));
            owners.sort_unstable();
            owners.dedup();
            let counts = counted(group, batch);
            for o in owners.iter().filter(|o| **o != NOBODY) {
                let counts = if o == home { counts } else { 0 };
                let duty = Duty { group, batch, all_rows: owners.len() == 1, counts };
                duties[usize::from(*o)].push(duty);
            }
        }
        Self { owner, duties }
    }
}

impl Shares {
    /// All batches for one thread, with dofs below `size`.
    fn of_one(domain: &Domain, size: usize) -> Self {
        let batches =
            domain.groups.iter().enumerate().flat_map(|(g, group)| (0..group.n_batches()).map(move |b| (g, b)));
        let duty = |(group, batch): (usize, usize)| {
            let lanes = domain.groups[group].entities.len() - batch * LANES;
            let counts = u8::MAX >> LANES.saturating_sub(lanes);
            Duty { group, batch, all_rows: true, counts }
        };
        Self { owner: vec![0; size], duties: vec![batches.map(duty).collect()] }
    }
}

/// By batch: a thread that computes it. Groups lie side by side in space, so each is divided among all threads; those
/// of few batches are dealt out one after another.
fn homes(domain: &Domain, binding: &Binding, batches: &[(usize, usize)], n: usize) -> Vec<u16> {
    let cost = |g: usize| domain.groups[g].n_points() * binding.groups[g].n_dofs().pow(2);
    let mut sizes = vec![0; domain.groups.len()];
    batches.iter().for_each(|(g, _)| sizes[*g] += 1);
    let size = |g: usize| sizes[g];
    let is_small = |g: &usize| size(*g) < SMALLEST_SHARE * n;
    let total: usize = (0..domain.groups.len()).filter(is_small).map(|g| size(g) * cost(g)).sum();
    let (mut spent, mut homes) = (0, Vec::new());
    let mut seen = vec![0; domain.groups.len()];
    for (g, _) in batches {
        let home = if is_small(g) { spent * n / total.max(1) } else { seen[*g] * n / size(*g) };
        homes.push(u16::try_from(home.min(n - 1)).expect("fewer than 2^16 threads"));
        spent += if is_small(g) { cost(*g) } else { 0 };
        seen[*g] += 1;
    }
    homes
}

/// The dofs whose rows each batch adds to.
pub(super) struct Touched<'a> {
    domain: &'a Domain,
    /// `[group][entity * n_dofs + k]`
    dofs: &'a [Vec<u32>],
    n_dofs: Vec<usize>,
    /// By group: local dofs that carry a test slot.
    rows: Vec<Vec<usize>>,
}

impl<'a> Touched<'a> {
    pub(super) fn new(domain: &'a Domain, binding: &Binding, dofs: &'a [Vec<u32>]) -> Self {
        let rows = (0..domain.groups.len()).map(|g| row_dofs(binding, g)).collect();
        Self { domain, dofs, n_dofs: binding.groups.iter().map(super::binding::GroupBinding::n_dofs).collect(), rows }
    }

    /// Those of one batch, some more than once.
    pub(super) fn dofs(&self, g: usize, batch: usize) -> impl Iterator<Item = u32> {
        let entities = batch * LANES..((batch + 1) * LANES).min(self.domain.groups[g].entities.len());
        let (dofs, n, rows) = (&self.dofs[g], self.n_dofs[g], &self.rows[g]);
        entities.flat_map(move |e| rows.iter().map(move |k| dofs[e * n + k])).filter(|d| *d != NONE)
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
