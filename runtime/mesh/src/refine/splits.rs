//! The nodes that a round of refinement makes: in the middle of edges and faces.
//!
//! Promises: one node for each edge however many cells ask; edges whose ends are at the same places are halved together,
//! each with a node of its own. Numbers follow the order of the requests. Does not know cells.

use wfl_host::memory::{TooMuchMemory, grow};

use super::twins::Twins;

const NONE: u32 = u32::MAX;

/// The middle of an edge, or of a face (by two opposite corners).
struct Entry {
    /// The nodes that stand for the ends, lower one first.
    places: [u32; 2],
    /// The ends, in the order of `places`.
    ends: [u32; 2],
    middle: u32,
    next: u32,
}

/// Middles by their ends.
pub(super) struct Splits<'a> {
    twins: &'a Twins,
    n_old: u32,
    /// For each new node the node that stands for all at its place.
    places: Vec<u32>,
    /// Positions of the new nodes: the mean of the ends.
    positions: Vec<[f64; 3]>,
    /// First entry by lower place.
    first: Vec<u32>,
    entries: Vec<Entry>,
}

/// What halving an edge has changed.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Halved {
    /// Nothing: it was halved.
    Before,
    /// It has a node now; an edge at the same place had one.
    AsTwin,
    /// It has a node now.
    Now,
}

impl<'a> Splits<'a> {
    /// Nothing is halved yet.
    pub(super) fn new(n_nodes: usize, twins: &'a Twins) -> Result<Self, TooMuchMemory> {
        let mut first = Vec::new();
        grow(&mut first, n_nodes, "the refined mesh")?;
        first.resize(n_nodes, NONE);
        let (places, positions, entries) = (Vec::new(), Vec::new(), Vec::new());
        Ok(Self { twins, n_old: n_nodes as u32, places, positions, first, entries })
    }

    /// Number of nodes before the round.
    pub(super) fn n_old(&self) -> u32 {
        self.n_old
    }

    /// Positions of the new nodes.
    pub(super) fn positions(&self) -> &[[f64; 3]] {
        &self.positions
    }

    /// The node that stands for all at the place of `node`.
    pub(super) fn place(&self, node: u32) -> u32 {
        if node < self.n_old { self.twins.of(node) } else { self.places[(node - self.n_old) as usize] }
    }

    /// The ends in the order of their places, and the places.
    fn ordered(&self, ends: [u32; 2]) -> ([u32; 2], [u32; 2]) {
        let [a, b] = ends.map(|node| self.place(node));
        if a <= b { (ends, [a, b]) } else { ([ends[1], ends[0]], [b, a]) }
    }

    fn entries_at(&self, places: [u32; 2]) -> impl Iterator<Item = &Entry> {
        let mut at = self.first[places[0] as usize];
        let all = std::iter::from_fn(move || {
            let entry = self.entries.get(at as usize)?;
            at = entry.next;
            Some(entry)
        });
        all.filter(move |entry| entry.places == places)
    }

    /// True if an edge with ends at these places is halved.
    pub(super) fn is_halved(&self, ends: [u32; 2]) -> bool {
        let (_, places) = self.ordered(ends);
        self.entries_at(places).next().is_some()
    }

    /// The node in the middle of an edge.
    pub(super) fn middle(&self, ends: [u32; 2]) -> Option<u32> {
        let (ends, places) = self.ordered(ends);
        self.entries_at(places).find(|entry| entry.ends == ends).map(|entry| entry.middle)
    }

    /// The node in the middle of an edge or face, made at `position` where there is none.
    pub(super) fn halve(&mut self, ends: [u32; 2], position: [f64; 3]) -> Result<(u32, Halved), TooMuchMemory> {
        let (ends, places) = self.ordered(ends);
        let mut twin = None;
        for entry in self.entries_at(places) {
            if entry.ends == ends {
                return Ok((entry.middle, Halved::Before));
            }
            twin.get_or_insert(entry.middle);
        }
        let middle = self.lone(position)?;
        if let Some(twin) = twin {
            self.places[(middle - self.n_old) as usize] = self.place(twin);
        }
        grow(&mut self.entries, 1, "the refined mesh")?;
        let next = self.first[places[0] as usize];
        self.first[places[0] as usize] = self.entries.len() as u32;
        self.entries.push(Entry { places, ends, middle, next });
        Ok((middle, if twin.is_some() { Halved::AsTwin } else { Halved::Now }))
    }

    /// A node of one cell alone.
    pub(super) fn lone(&mut self, position: [f64; 3]) -> Result<u32, TooMuchMemory> {
        let node = self.n_old + self.positions.len() as u32;
        for list in [&mut self.places, &mut self.first] {
            grow(list, 1, "the refined mesh")?;
        }
        grow(&mut self.positions, 1, "the refined mesh")?;
        self.places.push(node);
        self.first.push(NONE);
        self.positions.push(position);
        Ok(node)
    }
}
