//! What was drawn: the shapes of a chart for a picture of pixels.

use crate::{
    colour::{from_hex, of_class},
    surface::Surface,
};

/// A shape. Places are in the units of the chart, y down; `paint` is the attributes of its SVG element.
#[derive(Clone, Debug)]
pub(crate) enum Mark {
    /// A line through points.
    Line { paint: String, points: Vec<[f64; 2]> },
    /// An area.
    Polygon { paint: String, corners: Vec<[f64; 2]> },
    /// A disc.
    Disc { paint: String, at: [f64; 2], r: f64 },
    /// Words; the class says where they are anchored.
    Text { class: String, at: [f64; 2], text: String, reads: Reads },
    /// Faces that hide each other.
    Surface(Surface),
}

/// Which way words are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reads {
    /// From left to right.
    Across,
    /// From below to above.
    Up,
}

/// Colours and width of a shape on light ground.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Paint {
    /// Of the area.
    pub(crate) fill: Option<[u8; 3]>,
    /// Of the line.
    pub(crate) stroke: Option<[u8; 3]>,
    /// Of the line, in units of the chart.
    pub(crate) width: f64,
    /// The line is dashed.
    pub(crate) dashed: bool,
}

impl Paint {
    /// What the attributes `class`, `fill`, `stroke` and `stroke-width` say, with the widths of the style sheet.
    pub(crate) fn of(attributes: &str) -> Paint {
        let attributes = format!(" {attributes}");
        // one key ends like another: the blank in front tells them apart
        let value = |key: &str| {
            let (_, rest) = attributes.split_once(&format!(" {key}=\""))?;
            Some(rest.split_once('"')?.0)
        };
        let mut paint = Paint { width: 1.0, ..Paint::default() };
        for class in value("class").unwrap_or_default().split(' ') {
            let colour = of_class(class);
            paint.fill = colour.or(paint.fill);
            paint.stroke = colour.or(paint.stroke);
            match class {
                "l" => paint.width = 1.8,
                "a" => paint.width = 1.2,
                "g2" => paint.width = 0.5,
                "d" => paint.dashed = true,
                _ => {}
            }
        }
        if let Some(colour) = value("fill").and_then(from_hex) {
            paint.fill = Some(colour);
        }
        if let Some(colour) = value("stroke").and_then(from_hex) {
            paint.stroke = Some(colour);
        }
        if let Some(width) = value("stroke-width").and_then(|w| w.parse().ok()) {
            paint.width = width;
        }
        paint
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_give_the_colours_of_the_style_sheet() {
        let line = Paint::of(r#"class="l c1 d""#);
        assert_eq!((line.stroke, line.width, line.dashed), (Some([0xd5, 0x5e, 0]), 1.8, true));
        let cell = Paint::of(r##"class="z" fill="#010203" stroke="#ffffff" stroke-width=".25""##);
        assert_eq!((cell.fill, cell.stroke, cell.width), (Some([1, 2, 3]), Some([255; 3]), 0.25));
        assert_eq!(Paint::of(r##"fill="#0a0b0c""##).fill, Some([10, 11, 12]));
        let style = crate::colour::style();
        for class in ["c0", "c6", "v0", "v15", "ci"] {
            let [r, g, b] = of_class(class).unwrap();
            let rule = format!(".wfl .{class}{{stroke:#{r:02x}{g:02x}{b:02x};");
            assert!(style.contains(&rule), "{rule}");
        }
    }
}
