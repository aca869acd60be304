//! Charts for people to read: lines, points, bars, maps and surfaces as SVG or PNG, pages as one HTML file.
//!
//! Promises: numbers in, text out; the same input gives the same bytes; a page loads nothing from anywhere; what cannot
//! be drawn (not finite, or not positive on a logarithmic axis) is counted in the chart and never moved; colours can be
//! told apart by people who are colour-blind, in light and dark; series differ by marker as well as by colour.
//! Does not know scenes, runs or files, computes nothing from the data.
//!
//! ```
//! use wfl_charts::{Chart, Page, Scale, Section, Series};
//! let error = Series::new("degree 1", [[0.5, 1e-2], [0.25, 2.5e-3]]);
//! let chart = Chart::new("Convergence").x("h [m]", Scale::Log).y("error [-]", Scale::Log).line(error);
//! let page = Page::new("Study").section(Section::new("Mesh").text("Order 2, as it should be.").chart(&chart));
//! assert!(page.html().contains("<svg"));
//! ```
#![forbid(unsafe_code)]

mod bars;
mod chart;
mod colour;
mod film;
mod glyphs;
mod map;
mod marks;
mod page;
mod pdf;
mod raster;
mod scale;
mod series;
mod surface;
mod text;

pub use bars::Bar;
pub use chart::Chart;
pub use colour::{Colour, Ramp, viridis};
pub use film::film;
pub use map::{Edge, Face, MapCell};
pub use page::{Page, Section, Table};
pub use raster::PngError;
pub use scale::Scale;
pub use series::Series;
pub use text::short;
