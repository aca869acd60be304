//! Maps: polygons coloured by a number or by a state.

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
}
