//! A chart: what is in it, and how it is drawn.

mod draw;
mod frame;
mod zoom;

use crate::{
    bars::Bar,
    colour::{Colour, Ramp},
    map::{Face, Map, MapCell, Meaning},
    raster::PngError,
    scale::Scale,
    series::{Drawn, Series},
};

/// A shaded part of the horizontal axis.
#[derive(Clone, Debug)]
struct Band {
    from: f64,
    to: f64,
    note: String,
}

/// A chart with one pair of axes. Made by [`Chart::new`], filled by the methods below, drawn by [`Chart::svg`].
#[derive(Clone, Debug)]
pub struct Chart {
    title: String,
    x: (String, Scale),
    y: (String, Scale),
    series: Vec<(Series, Drawn)>,
    bars: Vec<Bar>,
    bands: Vec<Band>,
    map: Option<Map>,
    /// Name and range of the quantity that tones of series stand for.
    tones: Option<(String, [f64; 2])>,
    size: [f64; 2],
    equal: bool,
    subtitle: Option<String>,
    /// The vertical axis says nothing and is left out.
    flat: bool,
    /// Directions of the axes of space in the view, to the right and up, in place of a pair of axes.
    triad: Option<[[f64; 2]; 3]>,
    /// Corners of a rectangle that the axes hold, whatever is drawn.
    room: Option<[[f64; 2]; 2]>,
    /// Its file says how wide it is on paper.
    paper: bool,
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
            bands: Vec::new(),
            map: None,
            tones: None,
            size: [440.0, 300.0],
            equal: false,
            subtitle: None,
            flat: false,
            triad: None,
            room: None,
            paper: false,
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

    /// A shaded part of the horizontal axis behind the data, as high as the chart: a time in which something lasted.
    #[must_use]
    pub fn band(mut self, from: f64, to: f64, note: impl Into<String>) -> Self {
        self.bands.push(Band { from, to, note: note.into() });
        self
    }

    /// A map of a quantity, with a ramp of colours. `label` has its unit.
    #[must_use]
    pub fn map(mut self, label: impl Into<String>, cells: impl IntoIterator<Item = MapCell>) -> Self {
        let meaning = Meaning::Quantity(label.into());
        self.map = Some(Map {
            meaning,
            cells: cells.into_iter().collect(),
            range: None,
            edges: false,
            faces: Vec::new(),
            ramp: Ramp::Viridis,
        });
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

    /// A surface in space, coloured by a quantity. `label` has its unit. What lies behind other faces is hidden.
    #[must_use]
    pub fn surface(mut self, label: impl Into<String>, ramp: Ramp, faces: impl IntoIterator<Item = Face>) -> Self {
        let meaning = Meaning::Quantity(label.into());
        let faces = faces.into_iter().collect();
        self.map = Some(Map { meaning, cells: Vec::new(), range: None, edges: false, faces, ramp });
        self
    }

    /// Shows the directions of the axes of space (to the right, up; of length 1 if they lie across the view) in place of
    /// numbered axes.
    #[must_use]
    pub fn triad(mut self, axes: [[f64; 2]; 3]) -> Self {
        self.triad = Some(axes);
        self
    }

    /// The axes hold the rectangle between two corners, whatever is drawn: charts that follow each other have the same ones.
    #[must_use]
    pub fn room(mut self, low: [f64; 2], high: [f64; 2]) -> Self {
        self.room = Some([low, high]);
        self
    }

    /// Leaves out the vertical axis: heights mean nothing.
    #[must_use]
    pub fn flat(mut self) -> Self {
        self.flat = true;
        self
    }

    /// A second line under the title.
    #[must_use]
    pub fn subtitle(mut self, text: impl Into<String>) -> Self {
        self.subtitle = Some(text.into());
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
            faces: Vec::new(),
            ramp: Ramp::Viridis,
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
        self.draw(draw::Sheet::File)
    }

    /// A PNG file on light ground, two pixels a unit.
    ///
    /// # Errors
    /// When the picture would have no pixels, or more than memory has room for.
    pub fn png(&self) -> Result<Vec<u8>, PngError> {
        let (marks, size) = self.marks();
        crate::raster::png(&marks, size)
    }

    /// A PDF file of one page for LaTeX, on light ground: letters are 8 points high, shapes are paths.
    ///
    /// # Errors
    /// When a surface of many faces, which is an image in the file, would have more pixels than memory has room for.
    pub fn pdf(&self) -> Result<Vec<u8>, PngError> {
        let (marks, size) = self.marks();
        crate::pdf::pdf(&marks, size, &self.title)
    }

    /// The SVG without its style, for a page that has it already.
    pub(crate) fn embedded(&self) -> String {
        self.draw(draw::Sheet::Page)
    }
}

#[cfg(test)]
mod tests;
