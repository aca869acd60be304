//! Rules with many points, for terms and a measure whose formulas of the position a rule of a few points may miss.
//!
//! A rule sees a formula at its points alone: what happens between them (a pulse, a wave shorter than a cell, a jump) is
//! missed without a trace. Estimates of an error therefore take the same integrals with the rule on many even parts of each
//! entity. Promises: unknowns, equations and what the scene itself is run with are not touched.

/// What is taken with more points than the scene says.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sampling {
    /// Terms by position, each with the parts of an entity along each direction that have the rule of the term.
    pub terms: Vec<(usize, usize)>,
    /// A measure by name.
    pub measure: Option<String>,
    /// How the mesh follows curved bodies.
    pub bodies: Bodies,
}

/// How a mesh follows curved bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bodies {
    /// A box that a map bends has cells of second order where unknowns are of degree 2 or higher; files as they are.
    #[default]
    AsFields,
    /// Cells of first order.
    First,
    /// Cells of second order where a map bends them.
    Second,
    /// The polygons of curves in the file of a mesh in the plane are replaced by arcs.
    Arcs,
}

/// Nothing has more points than the scene says.
pub static NO_SAMPLING: Sampling = Sampling { terms: Vec::new(), measure: None, bodies: Bodies::AsFields };

/// Points along each direction of a body by its dimension (0 to 3): what is looked for is resolved if it is wider than
/// two of them, about 1/2000 of a line, 1/90 of a square and 1/20 of a cube. The numbers of points are about the same.
const ALONG: [f64; 4] = [1.0, 4096.0, 181.0, 40.0];
/// Most parts of an entity along a direction.
const MOST_PARTS: f64 = 1024.0;

/// Parts along each direction of an entity of dimension `dim` such that all `entities` with `points` points each together
/// have about so many points as are looked at.
#[must_use]
pub fn parts(dim: usize, entities: usize, points: usize) -> usize {
    let dim = dim.clamp(1, 3);
    let own = (entities.max(1) as f64 * points.max(1) as f64).powf(1.0 / dim as f64);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small and positive")]
    let parts = (ALONG[dim] / own).ceil().clamp(2.0, MOST_PARTS) as usize;
    parts
}

impl Sampling {
    /// The parts of a term.
    pub(super) fn of_term(&self, term: usize) -> usize {
        self.terms.iter().find(|t| t.0 == term).map_or(1, |t| t.1)
    }

    /// Whether a measure is taken with more points.
    pub(super) fn is_of(&self, measure: &str) -> bool {
        self.measure.as_deref() == Some(measure)
    }
}
