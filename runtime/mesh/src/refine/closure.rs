//! Which edges are halved: those of the marked cells, and those that keep the mesh conforming.
//!
//! Promises: when [`Closure::close`] has ended, no cell can be left with a node in the middle of an edge. A marked simplex
//! is halved as often as it has dimensions, so that its size is halved; of a marked quadrilateral or hexahedron every edge
//! along the axes of the mark is halved, and with it the edge opposite in each cell: the layer of cells. Ends for every
//! mesh: for triangles, quadrilaterals and hexahedra only edges of the mesh itself are halved, for tetrahedra Arnold,
//! Mukherjee and Pouly prove it. A cell without a way to be divided that would have to be is an error. Does not make cells.

use std::collections::VecDeque;

use wfl_host::memory::{TooMuchMemory, claim};

use super::{
    labels::Label,
    marks::Mark,
    pieces::{Piece, axis_of},
    splits::{Halved, Splits},
};
use crate::{
    cell::{CellKind, Subdivision},
    mesh::{CellId, Mesh, MeshError},
};

/// Cells by the place of a vertex.
struct Around {
    starts: Vec<u32>,
    cells: Vec<u32>,
}

impl Around {
    fn new(mesh: &Mesh, splits: &Splits<'_>) -> Result<Self, TooMuchMemory> {
        let total: u64 = mesh.cells().map(|cell| mesh.kind(cell).n_vertices() as u64).sum();
        claim(4 * (total + 2 * mesh.n_nodes() as u64), "the refined mesh")?;
        let places = |cell| mesh.cell_vertices(cell).iter().map(|node| splits.place(node.index() as u32) as usize);
        let mut starts = vec![0u32; mesh.n_nodes() + 1];
        for place in mesh.cells().flat_map(places) {
            starts[place + 1] += 1;
        }
        for k in 1..starts.len() {
            starts[k] += starts[k - 1];
        }
        let mut next = starts.clone();
        let mut cells = vec![0; total as usize];
        for cell in mesh.cells() {
            for place in places(cell) {
                cells[next[place] as usize] = cell.index() as u32;
                next[place] += 1;
            }
        }
        Ok(Self { starts, cells })
    }

    fn of(&self, place: u32) -> &[u32] {
        &self.cells[self.starts[place as usize] as usize..self.starts[place as usize + 1] as usize]
    }
}

/// The search for the edges that are halved in a round.
pub(super) struct Closure<'a, 's> {
    mesh: &'a Mesh,
    labels: &'a [Label],
    pub(super) splits: Splits<'s>,
    around: Around,
    waiting: VecDeque<u32>,
    is_waiting: Vec<bool>,
    /// Cells with a node in the middle of an edge, in the order they were found.
    touched: Vec<u32>,
    pub(super) is_touched: Vec<bool>,
    /// An edge inside a cell of the mesh was halved that others may have, too.
    deep: bool,
}

impl<'a, 's> Closure<'a, 's> {
    pub(super) fn new(mesh: &'a Mesh, labels: &'a [Label], splits: Splits<'s>) -> Result<Self, TooMuchMemory> {
        let around = Around::new(mesh, &splits)?;
        let none = vec![false; mesh.n_cells()];
        Ok(Self {
            mesh,
            labels,
            splits,
            around,
            waiting: VecDeque::new(),
            is_waiting: none.clone(),
            touched: Vec::new(),
            is_touched: none,
            deep: false,
        })
    }

    /// Halves the edges of the marked cells and all that follow from it.
    pub(super) fn close(&mut self, marks: &[Mark]) -> Result<(), MeshError> {
        for mark in marks.iter().filter(|mark| !mark.axes.is_empty()) {
            let kind = self.mesh.kind(mark.cell);
            let whole = self.whole(mark.cell);
            match self.subdivision(mark.cell)? {
                Subdivision::Bisection => self.bisect(mark.cell, kind, &whole, kind.dim())?,
                Subdivision::Layers => {
                    for edge in kind.edges().iter().filter(|edge| mark.axes.contains(axis_of(**edge))) {
                        self.halve(mark.cell, whole.edge(*edge))?;
                    }
                }
            }
        }
        loop {
            while let Some(cell) = self.waiting.pop_front() {
                self.is_waiting[cell as usize] = false;
                self.visit(CellId::new(cell as usize))?;
            }
            if !std::mem::take(&mut self.deep) {
                return Ok(());
            }
            for cell in self.touched.clone() {
                self.visit(CellId::new(cell as usize))?;
            }
        }
    }

    fn whole(&self, cell: CellId) -> Piece {
        Piece::whole(self.mesh, cell, self.labels[cell.index()])
    }

    /// How a cell is divided, which it must be.
    fn subdivision(&self, cell: CellId) -> Result<Subdivision, MeshError> {
        let kind = self.mesh.kind(cell);
        kind.subdivision().ok_or_else(|| MeshError::NoRefinement { cell: self.mesh.numbers().cell(cell), kind })
    }

    /// Halves what a cell needs because of its neighbours.
    fn visit(&mut self, cell: CellId) -> Result<(), MeshError> {
        let (kind, whole) = (self.mesh.kind(cell), self.whole(cell));
        if self.subdivision(cell)? == Subdivision::Bisection {
            return Ok(self.bisect(cell, kind, &whole, 0)?);
        }
        let axes = super::pieces::axes(&whole, kind, &self.splits);
        for edge in kind.edges().iter().filter(|edge| axes >> axis_of(**edge) & 1 == 1) {
            self.halve(cell, whole.edge(*edge))?;
        }
        Ok(())
    }

    /// Halves a piece of a simplex `times` times and as long as its edges have nodes in the middle.
    fn bisect(&mut self, cell: CellId, kind: CellKind, piece: &Piece, times: usize) -> Result<(), TooMuchMemory> {
        if times == 0 && !piece.is_hanging(kind, &self.splits) {
            return Ok(());
        }
        let middle = self.halve(cell, piece.refinement_edge())?;
        let halves = piece.halves(kind, middle);
        halves.iter().try_for_each(|half| self.bisect(cell, kind, half, times.saturating_sub(1)))
    }

    /// The node in the middle of an edge of a cell; the cells around are told.
    fn halve(&mut self, cell: CellId, ends: [u32; 2]) -> Result<u32, TooMuchMemory> {
        if !self.is_touched[cell.index()] {
            self.is_touched[cell.index()] = true;
            self.touched.push(cell.index() as u32);
        }
        let [x, y] = ends.map(|node| self.position(node));
        let (middle, halved) = self.splits.halve(ends, std::array::from_fn(|i| 0.5 * (x[i] + y[i])))?;
        if halved == Halved::Now {
            self.tell(ends);
        }
        Ok(middle)
    }

    fn position(&self, node: u32) -> [f64; 3] {
        let n_old = self.splits.n_old();
        if node < n_old { self.mesh.nodes()[node as usize] } else { self.splits.positions()[(node - n_old) as usize] }
    }

    /// Lets the cells at an edge wait for a visit.
    fn tell(&mut self, ends: [u32; 2]) {
        if ends.iter().any(|node| *node >= self.splits.n_old()) {
            self.deep = true;
            return;
        }
        let [a, b] = ends.map(|node| self.splits.place(node));
        for cell in self.around.of(a) {
            let vertices = self.mesh.cell_vertices(CellId::new(*cell as usize));
            let has = vertices.iter().any(|node| self.splits.place(node.index() as u32) == b);
            if has && !std::mem::replace(&mut self.is_waiting[*cell as usize], true) {
                self.waiting.push_back(*cell);
            }
        }
    }
}
