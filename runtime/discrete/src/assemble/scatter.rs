//! From local tangents of a batch to the values of a sparse matrix.
//!
//! The place of every entry is found once per pattern. As a rule the rows of the components at a node have the same
//! columns, and the components of a node stand side by side: then a row start per local row and a 16-bit offset per
//! pair of nodes tell all places, a tenth of one place per entry, so that adding reads little besides the matrix.
//! Entities where that does not hold (next to fixed dofs) keep a list of places.
//!
//! A batch is added a few rows at a time: their entries are put side by side, then each entity adds its numbers.
//! Threads add to rows of their own ([`crate::assemble::rows`]). Of symmetric laws one half is added where that is
//! enough ([`halves`]).

mod halves;

use std::{collections::BTreeMap, ops::Range};

use pulp::{Arch, Simd, WithSimd};
use wfl_compiler::ir::LANES;

pub(super) use halves::Halves;

use crate::assemble::{
    binding::GroupBinding,
    rows::Own,
    simd::{Lanes, ZERO},
};
use wfl_sparse::{csr::Pattern, index::NONE};

/// Components of one trial node that one test dof couples with, [`MOST`] at most.
#[derive(Clone, Copy, Debug)]
struct Segment {
    /// Test node and first trial dof.
    pair: usize,
    n: usize,
}

/// Components in a segment; what has more is cut into several.
const MOST: usize = 3;

/// Segments of a row of equal length whose pairs follow one another.
#[derive(Clone, Debug)]
struct Run {
    row: usize,
    /// First pair.
    pair: usize,
    /// Components of each segment.
    n: usize,
    segments: usize,
}

/// Runs that follow one another, of the same shape.
#[derive(Clone, Debug)]
struct Block {
    runs: Range<usize>,
    /// Components of each segment.
    n: usize,
    /// Segments of each run.
    segments: usize,
    /// Among the sources.
    entries: Range<usize>,
}

/// Entries of a block, at most, where it has more than one run: so many vectors stay in the nearest cache.
const BLOCK: usize = 128;

/// Where the dofs of one entity stand in a pattern, by local dof, or [`NONE`].
#[derive(Clone, Copy)]
struct Places<'a> {
    rows: &'a [u32],
    columns: &'a [u32],
}

/// A test dof.
#[derive(Clone, Debug)]
struct Row {
    /// Local dof.
    dof: usize,
    segments: Range<usize>,
    /// Its entries among the sources.
    entries: Range<usize>,
}

/// Where the local tangents of one group go.
#[derive(Clone, Debug, Default)]
pub(super) struct Scatter {
    rows: Vec<Row>,
    segments: Vec<Segment>,
    runs: Vec<Run>,
    blocks: Vec<Block>,
    /// First local trial dof of each pair.
    pairs: Vec<usize>,
    /// Where the entries of the segments stand in the local tangent.
    sources: Vec<u32>,
    /// `[entity][row]`: start of the row, or [`NONE`]
    row_starts: Vec<u32>,
    /// `[entity][pair]`: place within the row
    offsets: Vec<u16>,
    /// By entity: its list among `places`, or [`NONE`].
    lists: Vec<u32>,
    /// `[list][source]`: place in the matrix, or [`NONE`]
    places: Vec<u32>,
    /// Entities of which the pattern lacks some places.
    lacking: Vec<usize>,
    /// Entities are points, and several of them may have the same places.
    of_points: bool,
    /// By entity whether its dofs are those of the one before; empty unless entities are points.
    repeats: Vec<bool>,
}

impl Scatter {
    /// The entries of a group, without places yet. `sources` says where (test, trial) stands in the local tangent,
    /// `zero` is a place there that holds zero.
    pub(super) fn new(binding: &GroupBinding, sources: &[u32], zero: usize) -> Self {
        let n = binding.n_dofs();
        let zero = u32::try_from(zero).expect("small local matrices");
        let mut out = Self { of_points: binding.is_of_points(), ..Self::default() };
        let mut known: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        for (node, dof) in nodes_and_dofs(binding) {
            let row = &sources[dof * n..][..n];
            let start = out.segments.len();
            let first_entry = out.sources.len();
            let mut first = 0;
            for basis in &binding.bases {
                for _ in 0..basis.n_nodes {
                    let here = &row[first..first + basis.n_components];
                    let present = |c: &u32| *c != NONE;
                    if let (Some(low), Some(high)) = (here.iter().position(present), here.iter().rposition(present)) {
                        for low in (low..=high).step_by(MOST) {
                            let end = (low + MOST).min(high + 1);
                            let pair = *known.entry((node, first + low)).or_insert_with(|| {
                                out.pairs.push(first + low);
                                out.pairs.len() - 1
                            });
                            out.sources.extend(here[low..end].iter().map(|s| if *s == NONE { zero } else { *s }));
                            out.segments.push(Segment { pair, n: end - low });
                        }
                    }
                    first += basis.n_components;
                }
            }
            if out.segments.len() > start {
                out.add_row(dof, start..out.segments.len(), first_entry);
            }
        }
        out
    }

    fn add_row(&mut self, dof: usize, segments: Range<usize>, first_entry: usize) {
        let (row, first_run) = (self.rows.len(), self.runs.len());
        for Segment { pair, n } in &self.segments[segments.clone()] {
            let fits = |run: &&mut Run| run.n == *n && run.pair + run.segments == *pair;
            match self.runs[first_run..].last_mut().filter(fits) {
                Some(run) => run.segments += 1,
                None => self.runs.push(Run { row, pair: *pair, n: *n, segments: 1 }),
            }
        }
        let mut at = first_entry;
        for (k, run) in self.runs.iter().enumerate().skip(first_run) {
            let (n, segments) = (run.n, run.segments);
            let end = at + n * segments;
            let fits = |b: &&mut Block| (b.n, b.segments) == (n, segments) && end - b.entries.start <= BLOCK;
            match self.blocks.last_mut().filter(fits) {
                Some(block) => (block.runs.end, block.entries.end) = (k + 1, end),
                None => self.blocks.push(Block { runs: k..k + 1, n, segments, entries: at..end }),
            }
            at = end;
        }
        self.rows.push(Row { dof, segments, entries: first_entry..at });
    }

    /// Finds all places in a pattern. `dofs[entity * n_dofs + k]` are global, `free` maps them to rows and columns of the
    /// pattern; rows that `owns` refuses are those of another rank. Of some entities the pattern may lack places. `known` are
    /// places of a group like this one in the same pattern, by the same rows, with its dofs.
    pub(super) fn locate(
        &mut self,
        n_dofs: usize,
        dofs: &[u32],
        on: (&Pattern, &[u32]),
        owns: impl Fn(u32) -> bool,
        known: Option<(&Self, &[u32])>,
    ) {
        let (pattern, free) = on;
        self.lacking.clear();
        let entities = dofs.len() / n_dofs.max(1);
        self.row_starts.clear();
        self.offsets.clear();
        self.lists.clear();
        self.places.clear();
        self.row_starts.reserve_exact(entities * self.rows.len());
        self.offsets.reserve_exact(entities * self.pairs.len());
        self.lists.reserve_exact(entities);
        self.repeats.clear();
        if self.of_points {
            let all = || dofs.chunks_exact(n_dofs.max(1));
            self.repeats.extend(std::iter::once(false).chain(all().zip(all().skip(1)).map(|(a, b)| a == b)));
        }
        let (mut places, mut rows) = (vec![NONE; n_dofs], vec![NONE; n_dofs]);
        let mut offsets: Vec<Option<u16>> = Vec::new();
        for (entity, dofs) in dofs.chunks_exact(n_dofs.max(1)).enumerate() {
            let is_same = |(_, all): &(&Self, &[u32])| all.get(entity * n_dofs..(entity + 1) * n_dofs) == Some(dofs);
            let is_whole = |(known, _): &(&Self, &[u32])| known.lacking.binary_search(&entity).is_err();
            if let Some((known, _)) = known.filter(is_same).filter(is_whole) {
                self.copy_places(known, entity);
                continue;
            }
            for ((place, row), dof) in places.iter_mut().zip(&mut rows).zip(dofs) {
                *place = if *dof == NONE { NONE } else { free[*dof as usize] };
                *row = if *dof != NONE && owns(*dof) { *place } else { NONE };
            }
            for row in &self.rows {
                let start = |r: u32| u32::try_from(pattern.row_starts()[r as usize]).expect("fewer than 2^32 entries");
                self.row_starts.push(if rows[row.dof] == NONE { NONE } else { start(rows[row.dof]) });
            }
            let at = Places { rows: &rows, columns: &places };
            if self.find_offsets(at, pattern, &mut offsets).is_some() {
                self.lists.push(NONE);
            } else {
                self.lists.push(u32::try_from(self.places.len() / self.sources.len().max(1)).expect("few entities"));
                if !self.list(at, pattern) {
                    self.lacking.push(entity);
                }
            }
            self.offsets.extend(offsets.iter().map(|o| o.unwrap_or(0)));
        }
    }

    /// The entities of which the pattern lacks some places, in their order.
    pub(super) fn lacking(&self) -> &[usize] {
        &self.lacking
    }

    /// Takes over the places of an entity that is complete there.
    fn copy_places(&mut self, known: &Self, entity: usize) {
        let (rows, pairs, n) = (self.rows.len(), self.pairs.len(), self.sources.len());
        self.row_starts.extend_from_slice(&known.row_starts[entity * rows..][..rows]);
        self.offsets.extend_from_slice(&known.offsets[entity * pairs..][..pairs]);
        let list = known.lists[entity];
        if list == NONE {
            return self.lists.push(NONE);
        }
        self.lists.push(u32::try_from(self.places.len() / n.max(1)).expect("few entities"));
        self.places.extend_from_slice(&known.places[list as usize * n..][..n]);
    }

    /// The same entries without places.
    pub(super) fn without_places(&self) -> Self {
        Self {
            rows: self.rows.clone(),
            segments: self.segments.clone(),
            runs: self.runs.clone(),
            blocks: self.blocks.clone(),
            pairs: self.pairs.clone(),
            sources: self.sources.clone(),
            of_points: self.of_points,
            ..Self::default()
        }
    }

    /// One offset a pair for an entity; `None` if there is none that fits all its rows.
    fn find_offsets(&self, at: Places<'_>, pattern: &Pattern, offsets: &mut Vec<Option<u16>>) -> Option<()> {
        offsets.clear();
        offsets.resize(self.pairs.len(), None);
        for row in self.rows.iter().filter(|r| at.rows[r.dof] != NONE) {
            let columns = pattern.row(at.rows[row.dof] as usize);
            for segment in &self.segments[row.segments.clone()] {
                let first = self.pairs[segment.pair];
                let wanted = &at.columns[first..first + segment.n];
                let slot = &mut offsets[segment.pair];
                let offset = match *slot {
                    Some(offset) => offset,
                    None => u16::try_from(columns.binary_search(&wanted[0]).ok()?).ok()?,
                };
                *slot = Some(offset);
                if columns.get(usize::from(offset)..usize::from(offset) + wanted.len()) != Some(wanted) {
                    return None;
                }
            }
        }
        Some(())
    }

    /// Lists the places of an entity; false if the pattern lacks one of them.
    fn list(&mut self, at: Places<'_>, pattern: &Pattern) -> bool {
        let mut is_complete = true;
        for row in &self.rows {
            for segment in &self.segments[row.segments.clone()] {
                let first = self.pairs[segment.pair];
                for column in &at.columns[first..first + segment.n] {
                    let is_none = at.rows[row.dof] == NONE || *column == NONE;
                    let find = || pattern.position(at.rows[row.dof] as usize, *column as usize);
                    let place = if is_none { None } else { find() };
                    is_complete &= is_none || place.is_some();
                    self.places.push(place.map_or(NONE, |p| u32::try_from(p).expect("fewer than 2^32 entries")));
                }
            }
        }
        is_complete
    }

    /// Adds the local tangents of a batch, the rows that are in `own`. `numbers` is memory for a block.
    pub(super) fn add_batch(
        &self,
        arch: Arch,
        entities: Range<usize>,
        local: &[Lanes],
        numbers: &mut Vec<Lanes>,
        own: &mut Own<'_, '_>,
    ) {
        let largest = self.blocks.iter().map(|b| b.entries.len()).max().unwrap_or(0);
        if numbers.len() < largest {
            numbers.resize(largest, ZERO);
        }
        arch.dispatch(Adding { scatter: self, entities: entities.clone(), local, numbers, own });
        self.add_all_listed(entities, local, own);
    }

    /// Adds the entities of a batch whose places are listed.
    fn add_all_listed(&self, entities: Range<usize>, local: &[Lanes], own: &mut Own<'_, '_>) {
        let is_first = |lane: &usize| *lane == 0 || !self.is_repeated(entities.start + lane);
        for lane in (0..entities.len()).filter(is_first) {
            let entity = entities.start + lane;
            if self.lists[entity] != NONE {
                let end = (lane + 1..entities.len()).find(is_first).unwrap_or(entities.len());
                self.add_listed(entity, local, lane..end, own);
            }
        }
    }

    /// Adds an entity whose places are listed, with the points behind it that have the same ones.
    fn add_listed(&self, entity: usize, local: &[Lanes], lanes: Range<usize>, own: &mut Own<'_, '_>) {
        let places = &self.places[self.lists[entity] as usize * self.sources.len()..][..self.sources.len()];
        let starts = &self.row_starts[entity * self.rows.len()..][..self.rows.len()];
        for (row, start) in self.rows.iter().zip(starts) {
            let Some(cells) = own.from(*start as usize) else { continue };
            let entries = places[row.entries.clone()].iter().zip(&self.sources[row.entries.clone()]);
            for (place, source) in entries.filter(|(place, _)| **place != NONE) {
                // in the order of `join`
                let all = &local[*source as usize][lanes.clone()];
                let sum = all.iter().rev().copied().reduce(|sum, number| number + sum);
                cells[(place - start) as usize] += sum.unwrap_or(0.0);
            }
        }
    }
}

/// The additions of a batch, in the instructions of the processor.
struct Adding<'a, 'b, 'c> {
    scatter: &'a Scatter,
    entities: Range<usize>,
    local: &'a [Lanes],
    numbers: &'a mut [Lanes],
    own: &'a mut Own<'b, 'c>,
}

impl WithSimd for Adding<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { scatter, entities, local, numbers, own } = self;
        for block in &scatter.blocks {
            let numbers = &mut numbers[..block.entries.len()];
            for (number, source) in numbers.iter_mut().zip(&scatter.sources[block.entries.clone()]) {
                *number = local[*source as usize];
            }
            scatter.join(entities.clone(), numbers);
            match block.n {
                1 => scatter.add_block::<1>(entities.clone(), block, numbers, own),
                2 => scatter.add_block::<2>(entities.clone(), block, numbers, own),
                _ => scatter.add_block::<MOST>(entities.clone(), block, numbers, own),
            }
        }
    }
}

impl Scatter {
    /// Whether the dofs of an entity are those of the one before.
    #[inline(always)]
    fn is_repeated(&self, entity: usize) -> bool {
        self.repeats.get(entity).is_some_and(|is| *is)
    }

    /// Adds up what points with the same places have, in the lane of the first of them.
    #[inline(always)]
    fn join(&self, entities: Range<usize>, numbers: &mut [Lanes]) {
        if self.repeats.is_empty() {
            return;
        }
        let is_here = |lane: usize| lane > 0 && lane < entities.len() && self.is_repeated(entities.start + lane);
        let repeats: [bool; LANES] = std::array::from_fn(is_here);
        if !repeats.contains(&true) {
            return;
        }
        for number in numbers {
            let mut sum = number[LANES - 1];
            for lane in (1..LANES).rev() {
                sum = if repeats[lane] { number[lane - 1] + sum } else { number[lane - 1] };
                number[lane - 1] = sum;
            }
        }
    }

    /// Adds a block of runs with segments of `N` components for the entities whose places are not listed.
    #[inline(always)]
    fn add_block<const N: usize>(
        &self,
        entities: Range<usize>,
        block: &Block,
        numbers: &[Lanes],
        own: &mut Own<'_, '_>,
    ) {
        let (n_rows, n_pairs, n) = (self.rows.len(), self.pairs.len(), block.segments);
        let runs = &self.runs[block.runs.clone()];
        let numbers = numbers.as_chunks::<N>().0;
        for (entity, lane) in entities.zip(0..LANES) {
            if self.lists[entity] != NONE || (lane > 0 && self.is_repeated(entity)) {
                continue;
            }
            let starts = &self.row_starts[entity * n_rows..][..n_rows];
            let offsets = &self.offsets[entity * n_pairs..][..n_pairs];
            for (run, numbers) in runs.iter().zip(numbers.chunks_exact(n)) {
                let Some(cells) = own.from(starts[run.row] as usize) else { continue };
                for (offset, numbers) in offsets[run.pair..][..n].iter().zip(numbers) {
                    let at = usize::from(*offset);
                    for (cell, number) in cells[at..at + N].iter_mut().zip(numbers) {
                        *cell += number[lane];
                    }
                }
            }
        }
    }
}

/// Number of the node (counted over all bases) and local dof, dof after dof.
fn nodes_and_dofs(binding: &GroupBinding) -> Vec<(usize, usize)> {
    let mut out = Vec::with_capacity(binding.n_dofs());
    let mut node = 0;
    for basis in &binding.bases {
        for i in 0..basis.n_nodes {
            out.extend((0..basis.n_components).map(|c| (node, basis.dof(i, c))));
            node += 1;
        }
    }
    out
}
