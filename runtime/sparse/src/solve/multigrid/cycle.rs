//! One cycle over the levels of a matrix as an operator on vectors of its rows.
//!
//! Promises: the same bits for any number of threads; the same operator every time, up to the rounding of single
//! precision. Does not look at residuals.

use super::super::SolveError;
use super::hierarchy::Hierarchy;
use super::nodes::{NodeLayout, NodeRows};
use super::operator::OperatorLevels;
use crate::csr::Csr;
use crate::index::NONE;
use crate::norm::largest;

/// The levels of a matrix.
pub(in crate::solve) struct Cycle {
    hierarchy: Hierarchy,
    /// What the matrix was multiplied by in the levels.
    scale: f64,
    b: Vec<f32>,
    x: Vec<f32>,
}

impl Cycle {
    /// Makes the levels of the sum of some parts, which is symmetric. Rows without a place take no part.
    ///
    /// # Errors
    /// [`SolveError::NotPositiveDefinite`] with an unknown of some level, [`SolveError::TooMuchMemory`].
    pub(in crate::solve) fn new(parts: &[&Csr], layout: &NodeLayout) -> Result<Self, SolveError> {
        let rows = NodeRows::new(parts, layout);
        let hierarchy = Hierarchy::new(&rows, layout)?;
        let zeros = || vec![0.0f32; layout.points.len() * layout.components];
        Ok(Self { hierarchy, scale: rows.scale(), b: zeros(), x: zeros() })
    }

    /// Makes the levels of a symmetric matrix, the sum of the parts of `constant`, for its sum with another part, whose entries are among those of
    /// `changing` and which need not be symmetric; [`Self::take`] is to come first. Groups of unknowns, and how coarser levels
    /// move them, are those of the constant part.
    ///
    /// # Errors
    /// [`SolveError::NotPositiveDefinite`] with an unknown of some level where the constant part is not even semi-definite,
    /// [`SolveError::TooMuchMemory`].
    pub(in crate::solve) fn with_room(
        constant: &[&Csr],
        changing: &Csr,
        layout: &NodeLayout,
    ) -> Result<Self, SolveError> {
        let rows = NodeRows::new(constant, layout);
        let (scale, parts) = (rows.scale(), [changing]);
        let room = NodeRows::scaled(&parts, layout, scale).entries();
        let hierarchy = Hierarchy::with_room(&rows, &room, layout)?;
        let zeros = || vec![0.0f32; layout.points.len() * layout.components];
        Ok(Self { hierarchy, scale, b: zeros(), x: zeros() })
    }

    /// Takes the part that changes.
    ///
    /// # Errors
    /// [`SolveError`] where the coarsest matrix has no factor.
    pub(in crate::solve) fn take(&mut self, changing: &Csr, layout: &NodeLayout) -> Result<(), SolveError> {
        self.hierarchy.take(NodeRows::scaled(&[changing], layout, self.scale).entries())
    }

    /// Makes the levels of an operator.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub(in crate::solve) fn of_operator(levels: OperatorLevels, layout: &NodeLayout) -> Result<Self, SolveError> {
        let scale = levels.scale;
        let hierarchy = Hierarchy::of_operator(levels, layout)?;
        let zeros = || vec![0.0f32; layout.points.len() * layout.components];
        Ok(Self { hierarchy, scale, b: zeros(), x: zeros() })
    }

    /// `z` = one cycle for the residual `r`; `places` are those of the layout.
    pub(in crate::solve) fn apply(&mut self, places: &[u32], r: &[f64], z: &mut [f64]) {
        let size = largest(places.iter().zip(r).filter(|(place, _)| **place != NONE).map(|(_, r)| *r));
        if !(size > 0.0 && size.is_finite()) {
            z.fill(0.0);
            return;
        }
        for (place, r) in places.iter().zip(r).filter(|(place, _)| **place != NONE) {
            self.b[*place as usize] = (r / size) as f32;
        }
        self.hierarchy.cycle(&self.b, &mut self.x);
        let factor = size * self.scale;
        for (place, z) in places.iter().zip(z) {
            *z = if *place == NONE { 0.0 } else { factor * f64::from(self.x[*place as usize]) };
        }
    }

    /// Number of unknowns by level, the finest first.
    pub(in crate::solve) fn sizes(&self) -> &[usize] {
        self.hierarchy.sizes()
    }

    /// Bytes of all levels.
    pub(in crate::solve) fn bytes(&self) -> usize {
        self.hierarchy.bytes()
    }

    /// Where the coarsest level looks singular: its softest motion by row of the matrix.
    pub(super) fn take_softest_motion(&mut self, places: &[u32]) -> Option<Vec<f64>> {
        let motion = self.hierarchy.take_softest_motion()?;
        Some(places.iter().map(|place| if *place == NONE { 0.0 } else { motion[*place as usize] }).collect())
    }

    /// Takes the factor of a coarsest matrix that looks singular as it is.
    ///
    /// # Errors
    /// [`SolveError::NotPositiveDefinite`] where it has none.
    pub(super) fn trust(&mut self) -> Result<(), SolveError> {
        self.hierarchy.trust()
    }
}
