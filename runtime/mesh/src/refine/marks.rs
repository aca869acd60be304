//! Which cells are to be refined, and along which of their axes.

use crate::mesh::CellId;

/// Axes of a reference cell along which it is halved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Axes(u8);

impl Axes {
    /// Every axis.
    pub const ALL: Axes = Axes(0b111);

    /// These axes, counted from 0; others than 0, 1 and 2 are left out.
    #[must_use]
    pub fn of(axes: &[usize]) -> Axes {
        Axes(axes.iter().filter(|d| **d < 3).fold(0, |bits, d| bits | 1 << d))
    }

    /// As a number that [`Axes::from_bits`] takes back: bit k stands for axis k.
    #[must_use]
    pub fn bits(self) -> u8 {
        self.0
    }

    /// The axes of such a number; further bits are left out.
    #[must_use]
    pub fn from_bits(bits: u8) -> Axes {
        Axes(bits & 0b111)
    }

    /// True if `axis` is among them.
    #[must_use]
    pub fn contains(self, axis: usize) -> bool {
        axis < 3 && self.0 >> axis & 1 == 1
    }

    /// True if there is none.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// A cell to be refined: its size is halved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Mark {
    /// The cell, by its number in the mesh of the round.
    pub cell: CellId,
    /// Axes of its reference cell that are halved. Simplices have no axes: any of them stands for all.
    pub axes: Axes,
}

impl Mark {
    /// A cell that is halved along all its axes.
    #[must_use]
    pub fn all(cell: CellId) -> Mark {
        Mark { cell, axes: Axes::ALL }
    }
}
