//! From local tangents of a batch to the values of a sparse matrix.
//!
//! The place of every entry is found once per pattern. As a rule the rows of the components at a node have the same
//! columns, and the components of a node stand side by side: then a row start per local row and a 16-bit offset per
//! pair of nodes tell all places, a tenth of one place per entry, so that adding reads little besides the matrix.
//! Entities where that does not hold (next to fixed dofs) keep a list of places.
//!
//! Threads add to the same matrix, each to rows of its own ([`crate::assemble::shares`]): values are seen as atomic
//! numbers, read and written without order, which costs nothing and keeps a mistake from being undefined.

use std::{
    collections::BTreeMap,
    ops::Range,
    sync::atomic::{AtomicU64, Ordering},
};

use wfl_compiler::ir::LANES;
use zerocopy::{FromBytes, IntoBytes};

use crate::{
    assemble::{binding::GroupBinding, contract::ABSENT, geometry::Lanes},
    csr::Pattern,
};

/// No place in the matrix: row or column is fixed.
pub(super) const NOWHERE: u32 = u32::MAX;

/// Numbers that several threads add to, each number from one thread.
pub(super) fn shared(values: &mut [f64]) -> &[AtomicU64] {
    <[AtomicU64]>::mut_from_bytes(values.as_mut_bytes()).expect("on 64-bit machines both have the same alignment")
}

/// `cell += value`; no other thread may write this cell meanwhile.
#[inline(always)]
pub(super) fn add(cell: &AtomicU64, value: f64) {
    let sum = f64::from_bits(cell.load(Ordering::Relaxed)) + value;
    cell.store(sum.to_bits(), Ordering::Relaxed);
}

/// Components of one trial node that one test dof couples with.
#[derive(Clone, Copy, Debug)]
struct Segment {
    /// Test node and first trial dof.
    pair: usize,
    n: usize,
}

/// Segments of a row of equal length whose pairs follow one another.
#[derive(Clone, Debug)]
struct Run {
    row: usize,
    /// Local dof of the row.
    dof: usize,
    pairs: Range<usize>,
    /// Components of each segment.
    n: usize,
    /// Among the sources.
    entries: Range<usize>,
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
    /// First local trial dof of each pair.
    pairs: Vec<usize>,
    /// Where the entries of the segments stand in the local tangent, counted in numbers of one lane each.
    sources: Vec<u32>,
    /// `[entity][row]`: start of the row, or [`NOWHERE`]
    row_starts: Vec<u32>,
    /// `[entity][pair]`: place within the row
    offsets: Vec<u16>,
    /// By entity: its list among `places`, or [`NOWHERE`].
    lists: Vec<u32>,
    /// `[list][source]`: place in the matrix, or [`NOWHERE`]
    places: Vec<u32>,
}

impl Scatter {
    /// The entries of a group, nowhere yet. `sources` tells where (test, trial) stands in the local tangent, `zero` is
    /// a place there that holds zero.
    pub(super) fn new(binding: &GroupBinding, sources: &[u32], zero: usize) -> Self {
        let n = binding.n_dofs();
        let zero = u32::try_from(zero).expect("small local matrices");
        let lanes = u32::try_from(LANES).expect("a small number");
        let mut out = Self::default();
        let mut known: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        for (node, dof) in nodes_and_dofs(binding) {
            let row = &sources[dof * n..][..n];
            let start = out.segments.len();
            let first_entry = out.sources.len();
            let mut first = 0;
            for basis in &binding.bases {
                for _ in 0..basis.n_nodes {
                    let here = &row[first..first + basis.n_components];
                    let present = |c: &u32| *c != ABSENT;
                    if let (Some(low), Some(high)) = (here.iter().position(present), here.iter().rposition(present)) {
                        let pair = *known.entry((node, first + low)).or_insert_with(|| {
                            out.pairs.push(first + low);
                            out.pairs.len() - 1
                        });
                        let list = here[low..=high].iter().map(|s| lanes * if *s == ABSENT { zero } else { *s });
                        out.sources.extend(list);
                        out.segments.push(Segment { pair, n: high - low + 1 });
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
        let (row, mut at) = (self.rows.len(), first_entry);
        for Segment { pair, n } in &self.segments[segments.clone()] {
            let fits = |run: &&mut Run| run.row == row && run.n == *n && run.pairs.end == *pair;
            match self.runs.last_mut().filter(fits) {
                Some(run) => (run.pairs.end, run.entries.end) = (pair + 1, at + n),
                None => self.runs.push(Run { row, dof, pairs: *pair..pair + 1, n: *n, entries: at..at + n }),
            }
            at += n;
        }
        self.rows.push(Row { dof, segments, entries: first_entry..at });
    }

    /// Finds all places in a pattern. `dofs[entity * n_dofs + k]` are global, `free` maps them to rows of the pattern.
    pub(super) fn locate(&mut self, n_dofs: usize, dofs: &[u32], pattern: &Pattern, free: &[u32]) {
        let entities = dofs.len() / n_dofs.max(1);
        self.row_starts.clear();
        self.offsets.clear();
        self.lists.clear();
        self.places.clear();
        self.row_starts.reserve_exact(entities * self.rows.len());
        self.offsets.reserve_exact(entities * self.pairs.len());
        self.lists.reserve_exact(entities);
        let mut places = vec![NOWHERE; n_dofs];
        let mut offsets: Vec<Option<u16>> = Vec::new();
        for dofs in dofs.chunks_exact(n_dofs.max(1)) {
            for (place, dof) in places.iter_mut().zip(dofs) {
                *place = if *dof == NOWHERE { NOWHERE } else { free[*dof as usize] };
            }
            for row in &self.rows {
                let start = |r: u32| u32::try_from(pattern.row_starts()[r as usize]).expect("fewer than 2^32 entries");
                self.row_starts.push(if places[row.dof] == NOWHERE { NOWHERE } else { start(places[row.dof]) });
            }
            if self.find_offsets(&places, pattern, &mut offsets).is_some() {
                self.lists.push(NOWHERE);
            } else {
                self.lists.push(u32::try_from(self.places.len() / self.sources.len().max(1)).expect("few entities"));
                self.list(&places, pattern);
            }
            self.offsets.extend(offsets.iter().map(|o| o.unwrap_or(0)));
        }
    }

    /// One offset a pair for an entity; `None` if there is none that fits all its rows.
    fn find_offsets(&self, places: &[u32], pattern: &Pattern, offsets: &mut Vec<Option<u16>>) -> Option<()> {
        offsets.clear();
        offsets.resize(self.pairs.len(), None);
        for row in self.rows.iter().filter(|r| places[r.dof] != NOWHERE) {
            let columns = pattern.row(places[row.dof] as usize);
            for segment in &self.segments[row.segments.clone()] {
                let first = self.pairs[segment.pair];
                let wanted = &places[first..first + segment.n];
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

    fn list(&mut self, places: &[u32], pattern: &Pattern) {
        for row in &self.rows {
            for segment in &self.segments[row.segments.clone()] {
                let first = self.pairs[segment.pair];
                for column in &places[first..first + segment.n] {
                    let place = if places[row.dof] == NOWHERE || *column == NOWHERE {
                        None
                    } else {
                        pattern.position(places[row.dof] as usize, *column as usize)
                    };
                    self.places.push(place.map_or(NOWHERE, |p| u32::try_from(p).expect("fewer than 2^32 entries")));
                }
            }
        }
    }

    /// Adds the local tangent of one entity, the rows for whose local dof `owns` holds.
    #[inline(always)]
    pub(super) fn add_entity(
        &self,
        entity: usize,
        lane: usize,
        local: &[Lanes],
        matrix: &[AtomicU64],
        owns: impl Fn(usize) -> bool,
    ) {
        let numbers = &local.as_flattened()[lane..];
        let list = self.lists[entity];
        if list != NOWHERE {
            self.add_listed(list as usize, numbers, matrix, owns);
            return;
        }
        let starts = &self.row_starts[entity * self.rows.len()..][..self.rows.len()];
        let offsets = &self.offsets[entity * self.pairs.len()..][..self.pairs.len()];
        for run in &self.runs {
            let start = starts[run.row];
            if start == NOWHERE || !owns(run.dof) {
                continue;
            }
            let cells = &matrix[start as usize..];
            let (offsets, sources) = (&offsets[run.pairs.clone()], &self.sources[run.entries.clone()]);
            match run.n {
                1 => add_run::<1>(cells, offsets, sources, numbers),
                2 => add_run::<2>(cells, offsets, sources, numbers),
                3 => add_run::<3>(cells, offsets, sources, numbers),
                n => {
                    for (offset, sources) in offsets.iter().zip(sources.chunks_exact(n)) {
                        let cells = cells[usize::from(*offset)..].iter();
                        cells.zip(sources).for_each(|(cell, source)| add(cell, numbers[*source as usize]));
                    }
                }
            }
        }
    }

    fn add_listed(&self, list: usize, numbers: &[f64], matrix: &[AtomicU64], owns: impl Fn(usize) -> bool) {
        let places = &self.places[list * self.sources.len()..][..self.sources.len()];
        for row in self.rows.iter().filter(|r| owns(r.dof)) {
            for (place, source) in places[row.entries.clone()].iter().zip(&self.sources[row.entries.clone()]) {
                if *place != NOWHERE {
                    add(&matrix[*place as usize], numbers[*source as usize]);
                }
            }
        }
    }
}

/// Adds segments of `N` components, each at its offset.
#[inline(always)]
fn add_run<const N: usize>(cells: &[AtomicU64], offsets: &[u16], sources: &[u32], numbers: &[f64]) {
    for (offset, sources) in offsets.iter().zip(sources.as_chunks::<N>().0) {
        let at = usize::from(*offset);
        for (cell, source) in cells[at..at + N].iter().zip(sources) {
            add(cell, numbers[*source as usize]);
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
