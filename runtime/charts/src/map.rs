//! Maps: polygons coloured by a number or by a state, and surfaces in space.

use crate::colour::Ramp;

/// A polygon of a map.
#[derive(Clone, Debug)]
pub struct MapCell {
    pub(crate) outline: Vec<[f64; 2]>,
    pub(crate) value: f64,
    pub(crate) note: String,
}

impl MapCell {
    /// A polygon with these corners (x, y), in the units of the axes, and its number. NaN is drawn grey and counted.
    #[must_use]
    pub fn new(outline: impl IntoIterator<Item = [f64; 2]>, value: f64) -> Self {
        MapCell { outline: outline.into_iter().collect(), value, note: String::new() }
    }

    /// The rectangle between two corners.
    #[must_use]
    pub fn rectangle(low: [f64; 2], high: [f64; 2], value: f64) -> Self {
        Self::new([low, [high[0], low[1]], high, [low[0], high[1]]], value)
    }

    /// What is shown when the polygon is pointed at. Without it, its number.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }
}

/// What the numbers of a map mean.
#[derive(Clone, Debug)]
pub(crate) enum Meaning {
    /// A quantity with its name and unit, shown by the ramp.
    Quantity(String),
    /// 0, 1, 2, ...: states with their names and classes.
    States(Vec<(String, String)>),
}

/// A map.
#[derive(Clone, Debug)]
pub(crate) struct Map {
    pub(crate) meaning: Meaning,
    pub(crate) cells: Vec<MapCell>,
    /// The range of the ramp, so that several maps can share it; that of the numbers if `None`.
    pub(crate) range: Option<[f64; 2]>,
    /// Cells have a thin rim, so that a mesh is seen.
    pub(crate) edges: bool,
    /// Faces in space, behind which others vanish.
    pub(crate) faces: Vec<Face>,
    /// The colours of its numbers.
    pub(crate) ramp: Ramp,
}

/// An edge of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edge {
    /// Not drawn.
    None,
    /// An edge of the mesh: thin.
    Mesh,
    /// An edge of the body: strong.
    Rim,
}

/// A convex face of a surface in space, as it is seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Face {
    pub(crate) corners: Vec<[f64; 3]>,
    pub(crate) values: Vec<f64>,
    pub(crate) edges: Vec<Edge>,
}

impl Face {
    /// A face with these corners around it: to the right and up, in the units of the axes, and towards the reader; with
    /// a number at each corner, and the kind of the edge from each corner to the next. A face with a number or a place
    /// that is not finite is not drawn, but counted.
    ///
    /// # Panics
    /// When the lists differ in length.
    #[must_use]
    pub fn new(corners: Vec<[f64; 3]>, values: Vec<f64>, edges: Vec<Edge>) -> Self {
        assert!(corners.len() == values.len() && corners.len() == edges.len(), "a number and an edge for each corner");
        Face { corners, values, edges }
    }

    /// Its corners: to the right, up, towards the reader.
    #[must_use]
    pub fn corners(&self) -> &[[f64; 3]] {
        &self.corners
    }
}
