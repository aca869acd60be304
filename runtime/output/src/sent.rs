//! Parts of a grid: the cells that one of several ranks writes, and how they get to the rank that writes files.

use super::{Array, Piece, VtkCell, grid::Cells};
use crate::bytes::{Reader, Unreadable, Writer};

/// Marks a node that no cell has.
const UNUSED: u32 = u32::MAX;

impl Piece {
    /// The piece with some of its cells, and the nodes that these have.
    ///
    /// # Panics
    /// Where there is no flag for a cell.
    #[must_use]
    pub fn kept(&self, is_kept: &[bool]) -> Self {
        assert_eq!(is_kept.len(), self.cells.len(), "a flag for each cell");
        let mut is_used = vec![false; self.points.len()];
        let kept = || self.cells.iter().zip(is_kept).filter(|(_, kept)| **kept).map(|(cell, _)| cell);
        kept().flat_map(|(_, nodes)| nodes).for_each(|node| is_used[*node as usize] = true);
        let mut number = vec![UNUSED; self.points.len()];
        let used: Vec<usize> = (0..self.points.len()).filter(|node| is_used[*node]).collect();
        (0u32..).zip(&used).for_each(|(new, node)| number[*node] = new);
        let mut cells = Cells::default();
        for (kind, nodes) in kept() {
            cells.push(kind, &nodes.iter().map(|node| number[*node as usize]).collect::<Vec<_>>());
        }
        let entries: Vec<usize> = (0..is_kept.len()).filter(|cell| is_kept[*cell]).collect();
        Self {
            points: used.iter().map(|node| self.points[*node]).collect(),
            cells,
            point_data: self.point_data.iter().map(|array| some(array, &used)).collect(),
            cell_data: self.cell_data.iter().map(|array| some(array, &entries)).collect(),
        }
    }

    /// Writes the piece as bytes for another rank, which [`Self::read_from`] reads.
    pub fn write_to(&self, w: &mut Writer) {
        w.numbers(self.points.as_flattened());
        w.list(&self.cells.kinds, |w, kind| w.count(usize::from(kind.type_number())));
        w.smalls(&self.cells.nodes);
        for arrays in [&self.point_data, &self.cell_data] {
            w.list(arrays, |w, array| {
                w.text(&array.name);
                w.count(array.components);
                w.numbers(&array.values);
            });
        }
    }

    /// The piece that another rank wrote.
    ///
    /// # Errors
    /// [`Unreadable`] for bytes that no piece was written to.
    pub fn read_from(r: &mut Reader<'_>) -> Result<Self, Unreadable> {
        let points = r.numbers()?.as_chunks().0.to_vec();
        let kinds: Vec<u32> = r.list(Reader::small)?;
        let (nodes, mut cells) = (r.smalls()?, Cells::default());
        let mut rest = nodes.as_slice();
        for number in kinds {
            let of_number = |kind: &&VtkCell| u32::from(kind.type_number()) == number;
            let kind = *VtkCell::ALL.iter().find(of_number).ok_or(Unreadable)?;
            let (own, others) = rest.split_at_checked(kind.n_nodes()).ok_or(Unreadable)?;
            cells.push(kind, own);
            rest = others;
        }
        let mut arrays = || r.list(|r| Ok(Array { name: r.text()?, components: r.count()?, values: r.numbers()? }));
        Ok(Self { points, cells, point_data: arrays()?, cell_data: arrays()? })
    }
}

/// The entries of an array at some places.
fn some(array: &Array, places: &[usize]) -> Array {
    let n = array.components;
    let values = places.iter().flat_map(|place| &array.values[place * n..][..n]).copied().collect();
    Array { name: array.name.clone(), components: n, values }
}
