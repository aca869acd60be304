//! A chart: what is in it, and how it is drawn.

mod draw;
mod frame;

use crate::{
    bars::Bar,
    colour::Colour,
    map::{Map, MapCell, Meaning},
    scale::Scale,
    series::{Drawn, Series},
};

/// A chart with one pair of axes. Made by [`Chart::new`], filled by the methods below, drawn by [`Chart::svg`].
#[derive(Clone, Debug)]
pub struct Chart {
    title: String,
    x: (String, Scale),
    y: (String, Scale),
    series: Vec<(Series, Drawn)>,
    bars: Vec<Bar>,
    map: Option<Map>,
    /// Name and range of the quantity that tones of series stand for.
    tones: Option<(String, [f64; 2])>,
    size: [f64; 2],
    equal: bool,
}

impl Chart {
    /// An empty chart, 440 by 300 units: readable on the screen of a phone.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        Chart {
            title: title.into(),
            x: (String::new(), Scale::Linear),
            y: (String::new(), Scale::Linear),
            series: Vec::new(),
            bars: Vec::new(),
            map: None,
            tones: None,
            size: [440.0, 300.0],
            equal: false,
        }
    }

    /// Name, with its unit, and scale of the horizontal axis.
    #[must_use]
    pub fn x(mut self, label: impl Into<String>, scale: Scale) -> Self {
        self.x = (label.into(), scale);
        self
    }

    /// Name, with its unit, and scale of the vertical axis.
    #[must_use]
    pub fn y(mut self, label: impl Into<String>, scale: Scale) -> Self {
        self.y = (label.into(), scale);
        self
    }

    /// Width and height in units of which text is 13 high.
    #[must_use]
    pub fn size(mut self, width: f64, height: f64) -> Self {
        self.size = [width, height];
        self
    }

    /// Adds a line without markers.
    #[must_use]
    pub fn line(mut self, series: Series) -> Self {
        self.series.push((series, Drawn::Line));
        self
    }

    /// Adds markers without a line.
    #[must_use]
    pub fn points(mut self, series: Series) -> Self {
        self.series.push((series, Drawn::Points));
        self
    }

    /// Adds a line with markers.
    #[must_use]
    pub fn line_points(mut self, series: Series) -> Self {
        self.series.push((series, Drawn::Both));
        self
    }

    /// Says what the tones of [`Colour::Tone`] stand for: a ramp from `low` to `high` takes the place of the legend.
    #[must_use]
    pub fn tones(mut self, label: impl Into<String>, low: f64, high: f64) -> Self {
        self.tones = Some((label.into(), [low, high]));
        self
    }

    /// Horizontal bars, the first on top. The y axis then has their names; other kinds of data are not drawn.
    #[must_use]
    pub fn bars(mut self, bars: impl IntoIterator<Item = Bar>) -> Self {
        self.bars = bars.into_iter().collect();
        self
    }

    /// A map of a quantity, with a ramp of colours. `label` has its unit.
    #[must_use]
    pub fn map(mut self, label: impl Into<String>, cells: impl IntoIterator<Item = MapCell>) -> Self {
        let meaning = Meaning::Quantity(label.into());
        self.map = Some(Map { meaning, cells: cells.into_iter().collect(), range: None, edges: false });
        self
    }

    /// The range of the ramp of a map, in place of that of its own numbers: so that maps can be compared.
    #[must_use]
    pub fn map_range(mut self, low: f64, high: f64) -> Self {
        if let Some(map) = &mut self.map {
            map.range = Some([low, high]);
        }
        self
    }

    /// The cells of a map have thin edges: a mesh is what is to be seen.
    #[must_use]
    pub fn map_edges(mut self) -> Self {
        if let Some(map) = &mut self.map {
            map.edges = true;
        }
        self
    }

    /// A map of states: the number of a cell counts in `states`, each with a name and a colour; `None` is the pale
    /// colour of nothing going on.
    #[must_use]
    pub fn states<S: Into<String>>(
        mut self,
        states: impl IntoIterator<Item = (S, Option<Colour>)>,
        cells: impl IntoIterator<Item = MapCell>,
    ) -> Self {
        let class = |colour: Option<Colour>| colour.map_or_else(|| "o".to_owned(), Colour::class);
        let states = states.into_iter().map(|(name, colour)| (name.into(), class(colour))).collect();
        self.map = Some(Map {
            meaning: Meaning::States(states),
            cells: cells.into_iter().collect(),
            range: None,
            edges: false,
        });
        self
    }

    /// One unit is as long on the x axis as on the y axis: for shapes in space.
    #[must_use]
    pub fn equal(mut self) -> Self {
        self.equal = true;
        self
    }

    /// Another title.
    #[must_use]
    pub fn titled(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }

    /// The title.
    #[must_use]
    pub fn title(&self) -> &str {
        &self.title
    }

    /// An SVG file: its colours follow the ground that the reader prefers, light in programs that do not know of it.
    #[must_use]
    pub fn svg(&self) -> String {
        self.draw(true)
    }

    /// The SVG without its style, for a page that has it already.
    pub(crate) fn embedded(&self) -> String {
        self.draw(false)
    }
}

#[cfg(test)]
mod tests;
