//! One half of a symmetric tangent.
//!
//! Of a symmetric law, what an entity adds for two nodes (j, i) is what it adds for (i, j), transposed, to the last
//! bit. In a newly filled matrix each pair of nodes is added once, in the rows of the node that stands first; after the
//! last batch that adds there the sums are copied to the other place, while both are in the nearest cache: two thirds
//! of the additions or less. A batch whose rows have several owners adds all pairs, entity after entity as the others
//! do, so that every number is the same sum for any number of threads. Holds where all components of all nodes are
//! coupled, two or three of them, and the rows of a node follow one another; does not know other tangents, whose pairs
//! are all added.

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};
use wfl_compiler::ir::LANES;

use super::{MOST, Scatter};
use crate::assemble::{
    rows::Own,
    shares::{Duty, Shares},
    simd::Lanes,
};
use wfl_sparse::index::NONE;

/// A pair of nodes of one entity.
#[derive(Clone, Copy, Debug)]
struct Upper {
    /// First value in the row of the first component, or [`NONE`].
    place: u32,
    /// From row to row.
    stride: u16,
    /// Among the pairs of the group.
    pair: u16,
}

/// The pairs of one group.
#[derive(Debug)]
pub(in crate::assemble) struct Half {
    /// An entity has so many.
    n: usize,
    /// `[entity][k]`
    uppers: Vec<Upper>,
    /// Where the numbers of each pair stand in the local tangent, `[pair][row component][column component]`.
    sources: Vec<u32>,
}

/// Values that are copied, transposed.
#[derive(Clone, Copy, Debug)]
struct Mirrored {
    from: u32,
    to: u32,
    from_stride: u16,
    to_stride: u16,
}

/// What one thread copies.
#[derive(Debug, Default)]
struct Copies {
    /// Ordered by batch.
    blocks: Vec<Mirrored>,
    /// By batch of the thread: how many blocks are copied after it and all batches before.
    until: Vec<u32>,
}

/// The halves of a symmetric tangent; none of others.
#[derive(Debug, Default)]
pub(in crate::assemble) struct Halves {
    /// At each node.
    components: usize,
    groups: Vec<Half>,
    /// By thread.
    copies: Vec<Copies>,
}

impl Halves {
    /// The halves of located groups whose batches are shared out, in a matrix of `n_values`.
    pub(in crate::assemble) fn new(scatters: &[Scatter], shares: &Shares, n_values: usize) -> Self {
        let components = scatters.first().and_then(|s| s.segments.first()).map_or(0, |s| s.n);
        if !(2..=MOST).contains(&components) {
            return Self::default();
        }
        let groups: Option<Vec<Half>> = scatters.iter().map(|s| s.half(components)).collect();
        let Some(groups) = groups else { return Self::default() };
        let mut out = Self { components, groups, copies: Vec::new() };
        // the last batch that adds there
        let mut last = vec![NONE; n_values];
        out.copies = shares.duties.iter().map(|duties| out.copies(scatters, duties, &mut last)).collect();
        out
    }

    fn copies(&self, scatters: &[Scatter], duties: &[Duty], last: &mut [u32]) -> Copies {
        let batches = || (0u32..).zip(duties).filter(|(_, duty)| duty.all_rows);
        for (k, duty) in batches() {
            self.mirrored(scatters, duty, |m| last[m.from as usize] = k);
        }
        let mut out = Copies { blocks: Vec::new(), until: vec![0; duties.len()] };
        let count = |blocks: &[Mirrored]| u32::try_from(blocks.len()).expect("fewer than 2^32 entries");
        let mut next = 0;
        for (k, duty) in batches() {
            out.until[next..k as usize].fill(count(&out.blocks));
            self.mirrored(scatters, duty, |m| {
                if last[m.from as usize] == k {
                    last[m.from as usize] = NONE;
                    out.blocks.push(m);
                }
            });
            next = k as usize;
        }
        out.until[next..].fill(count(&out.blocks));
        out
    }

    /// Calls `f` for each pair of different nodes of a batch.
    fn mirrored(&self, scatters: &[Scatter], duty: &Duty, mut f: impl FnMut(Mirrored)) {
        let (half, scatter, k) = (&self.groups[duty.group], &scatters[duty.group], self.components);
        let nodes = scatter.rows.len() / k;
        for entity in duty.batch * LANES..((duty.batch + 1) * LANES).min(scatter.lists.len()) {
            for upper in half.of(entity).iter().filter(|u| u.place != NONE) {
                let (row, column) = (usize::from(upper.pair) / nodes, usize::from(upper.pair) % nodes);
                if row != column {
                    let starts = &scatter.row_starts[entity * nodes * k..][column * k..];
                    let offset = scatter.offsets[entity * nodes * nodes + column * nodes + row];
                    let to_stride = u16::try_from(starts[1] - starts[0]).expect("as found for the pair itself");
                    let to = starts[0] + u32::from(offset);
                    f(Mirrored { from: upper.place, to, from_stride: upper.stride, to_stride });
                }
            }
        }
    }

    /// The half of the group of a batch.
    pub(in crate::assemble) fn of(&self, duty: &Duty) -> Option<&Half> {
        self.groups.get(duty.group)
    }

    /// Copies what is complete after batch `duty` of thread `me`.
    pub(in crate::assemble) fn copy(&self, me: usize, duty: usize, own: &mut Own<'_, '_>) {
        let Some(copies) = self.copies.get(me) else { return };
        let first = if duty == 0 { 0 } else { copies.until[duty - 1] };
        let blocks = &copies.blocks[first as usize..copies.until[duty] as usize];
        match self.components {
            2 => blocks.iter().for_each(|m| m.copy::<2>(own)),
            _ => blocks.iter().for_each(|m| m.copy::<MOST>(own)),
        }
    }
}

impl Mirrored {
    #[inline(always)]
    fn copy<const K: usize>(self, own: &mut Own<'_, '_>) {
        let mut block = [[0.0; K]; K];
        let stride = usize::from(self.from_stride);
        let Some(from) = own.from(self.from as usize) else { return };
        let from = &from[..(K - 1) * stride + K];
        // loops of known length: the block stays in registers
        for a in 0..K {
            let row = &from[a * stride..][..K];
            for b in 0..K {
                block[b][a] = row[b];
            }
        }
        let stride = usize::from(self.to_stride);
        let Some(to) = own.from(self.to as usize) else { return };
        let to = &mut to[..(K - 1) * stride + K];
        for (a, values) in block.iter().enumerate() {
            to[a * stride..][..K].copy_from_slice(values);
        }
    }
}

impl Half {
    /// The pairs of an entity.
    #[inline(always)]
    fn of(&self, entity: usize) -> &[Upper] {
        &self.uppers[entity * self.n..][..self.n]
    }

    #[inline(always)]
    fn add<const K: usize>(&self, entities: Range<usize>, local: &[Lanes], own: &mut Own<'_, '_>) {
        let sources = self.sources.as_chunks::<K>().0.as_chunks::<K>().0;
        for (entity, lane) in entities.zip(0..LANES) {
            for upper in self.of(entity) {
                let Some(cells) = own.from(upper.place as usize) else { continue };
                let stride = usize::from(upper.stride);
                let cells = &mut cells[..(K - 1) * stride + K];
                for (a, sources) in sources[usize::from(upper.pair)].iter().enumerate() {
                    for (cell, source) in cells[a * stride..][..K].iter_mut().zip(sources) {
                        *cell += local[*source as usize][lane];
                    }
                }
            }
        }
    }
}

/// The additions of a batch, in the instructions of the processor.
struct Adding<'a, 'b, 'c> {
    half: &'a Half,
    entities: Range<usize>,
    local: &'a [Lanes],
    components: usize,
    own: &'a mut Own<'b, 'c>,
}

impl WithSimd for Adding<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        match self.components {
            2 => self.half.add::<2>(self.entities, self.local, self.own),
            _ => self.half.add::<MOST>(self.entities, self.local, self.own),
        }
    }
}

impl Scatter {
    /// Adds the local tangents of a batch, one half of them if all its rows are in `own`.
    pub(in crate::assemble) fn add_half(
        &self,
        arch: Arch,
        entities: Range<usize>,
        local: &[Lanes],
        (half, all_rows): (&Half, bool),
        own: &mut Own<'_, '_>,
    ) {
        let components = self.segments[0].n;
        if all_rows {
            arch.dispatch(Adding { half, entities: entities.clone(), local, components, own });
        } else {
            self.add_owned(entities.clone(), local, own);
        }
        self.add_all_listed(entities, local, own);
    }

    /// Adds the rows in `own`, entity after entity.
    fn add_owned(&self, entities: Range<usize>, local: &[Lanes], own: &mut Own<'_, '_>) {
        let (n_rows, n_pairs) = (self.rows.len(), self.pairs.len());
        for (lane, entity) in entities.enumerate().filter(|(_, entity)| self.lists[*entity] == NONE) {
            let offsets = &self.offsets[entity * n_pairs..][..n_pairs];
            for (row, start) in self.rows.iter().zip(&self.row_starts[entity * n_rows..][..n_rows]) {
                let Some(cells) = own.from(*start as usize) else { continue };
                let mut sources = &self.sources[row.entries.clone()];
                for segment in &self.segments[row.segments.clone()] {
                    let (now, rest) = sources.split_at(segment.n);
                    let at = usize::from(offsets[segment.pair]);
                    for (cell, source) in cells[at..at + segment.n].iter_mut().zip(now) {
                        *cell += local[*source as usize][lane];
                    }
                    sources = rest;
                }
            }
        }
    }

    /// The half of a symmetric group with `k` components at each node; `None` of any other.
    fn half(&self, k: usize) -> Option<Half> {
        let nodes = self.rows.len().checked_div(k)?;
        u16::try_from(nodes * nodes).ok()?;
        let mut half = Half { n: nodes * (nodes + 1) / 2, uppers: Vec::new(), sources: self.pair_sources(nodes, k)? };
        half.uppers.reserve_exact(half.n * self.lists.len());
        let nowhere = Upper { place: NONE, stride: 0, pair: 0 };
        for (entity, list) in self.lists.iter().enumerate() {
            let starts = &self.row_starts[entity * self.rows.len()..][..self.rows.len()];
            let offsets = &self.offsets[entity * self.pairs.len()..][..self.pairs.len()];
            // rows that are listed, not solved for, or of another rank
            if *list != NONE || starts.contains(&NONE) {
                half.uppers.extend(std::iter::repeat_n(nowhere, half.n));
                continue;
            }
            for (n, starts_here) in starts.chunks_exact(k).enumerate() {
                let stride = starts_here[1].checked_sub(starts_here[0])?;
                let follow = starts_here.windows(2).all(|pair| pair[1].checked_sub(pair[0]) == Some(stride));
                let stride = u16::try_from(stride).ok().filter(|_| follow)?;
                for m in (0..nodes).filter(|m| n == *m || starts_here[0] < starts[m * k]) {
                    let pair = n * nodes + m;
                    let place = starts_here[0] + u32::from(offsets[pair]);
                    half.uppers.push(Upper { place, stride, pair: u16::try_from(pair).ok()? });
                }
            }
            // a node that stands twice in an entity
            if half.uppers.len() != (entity + 1) * half.n {
                return None;
            }
        }
        Some(half)
    }

    /// Where the numbers of each pair of nodes stand; `None` unless all components of all nodes are coupled, and each
    /// number is that of the transposed place.
    fn pair_sources(&self, nodes: usize, k: usize) -> Option<Vec<u32>> {
        if self.rows.len() != nodes * k || self.pairs.len() != nodes * nodes {
            return None;
        }
        for (r, row) in self.rows.iter().enumerate() {
            let segments = &self.segments[row.segments.clone()];
            let is_node = |m: usize, s: &super::Segment| {
                s.n == k && s.pair == r / k * nodes + m && self.pairs[s.pair] == self.rows[m * k].dof
            };
            let all = segments.len() == nodes && segments.iter().enumerate().all(|(m, s)| is_node(m, s));
            if !all || row.dof != self.rows[r / k * k].dof + r % k {
                return None;
            }
        }
        let source = |r: usize, c: usize| self.sources[self.rows[r].entries.start + c];
        let mut sources = Vec::with_capacity(self.sources.len());
        for (n, m) in (0..nodes).flat_map(|n| (0..nodes).map(move |m| (n, m))) {
            for (r, c) in (0..k).flat_map(|a| (0..k).map(move |b| (n * k + a, m * k + b))) {
                if source(r, c) != source(c, r) {
                    return None;
                }
                sources.push(source(r, c));
            }
        }
        Some(sources)
    }
}
