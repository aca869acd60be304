//! One line or cloud of points.

use crate::colour::Colour;

/// Points with a name. Points that are not finite leave a gap in a line and are counted in the chart.
#[derive(Clone, Debug)]
pub struct Series {
    pub(crate) name: String,
    pub(crate) points: Vec<[f64; 2]>,
    pub(crate) notes: Vec<String>,
    pub(crate) colour: Option<Colour>,
    pub(crate) dashed: bool,
}

impl Series {
    /// A series of points (x, y) in the units of the axes, in the order in which a line runs through them. A series
    /// with an empty name is not in the legend.
    #[must_use]
    pub fn new(name: impl Into<String>, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        let points = points.into_iter().collect();
        Series { name: name.into(), points, notes: Vec::new(), colour: None, dashed: false }
    }

    /// What is shown when a point is pointed at, one text a point; lines are split at `\n`. Without it, name and numbers.
    #[must_use]
    pub fn notes(mut self, notes: impl IntoIterator<Item = String>) -> Self {
        self.notes = notes.into_iter().collect();
        self
    }

    /// A colour in place of the next one of the palette.
    #[must_use]
    pub fn colour(mut self, colour: Colour) -> Self {
        self.colour = Some(colour);
        self
    }

    /// A dashed line, for what was not computed: a closed form, a slope.
    #[must_use]
    pub fn dashed(mut self) -> Self {
        self.dashed = true;
        self
    }
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Drawn {
    /// A line without markers.
    Line,
    /// Markers without a line.
    Points,
    /// Both.
    Both,
}
