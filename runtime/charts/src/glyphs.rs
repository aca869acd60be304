//! Letters for pictures of pixels: Noto Sans Mono (SIL Open Font License) as ready rasters.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, RasterizedChar, get_raster};

/// A letter at its place.
pub(crate) struct Glyph {
    raster: RasterizedChar,
    /// Pixels from the start of the text.
    pub(crate) x: usize,
    /// Pixels that it is raised.
    pub(crate) up: usize,
}

/// The letters of a text and its width in pixels. Raised digits are small ones, what the font lacks is a `?`.
pub(crate) fn glyphs(text: &str, bold: bool) -> (Vec<Glyph>, usize) {
    let weight = if bold { FontWeight::Bold } else { FontWeight::Regular };
    let (mut x, mut found) = (0, Vec::new());
    for c in text.chars() {
        let raised = raised(c);
        let (size, up) = if raised.is_some() { (RasterHeight::Size16, 9) } else { (RasterHeight::Size24, 0) };
        for plain in raised.map_or_else(|| plain(c), String::from).chars() {
            let raster = get_raster(plain, weight, size).or_else(|| get_raster('?', weight, size));
            let Some(raster) = raster else { continue };
            let width = raster.width();
            found.push(Glyph { raster, x, up });
            x += width;
        }
    }
    (found, x)
}

impl Glyph {
    /// Pixels that it covers: to the right of the start of the text, down from the line it stands on, and how much.
    pub(crate) fn pixels(&self) -> impl Iterator<Item = (i64, i64, u8)> {
        let height = self.raster.height();
        // the line letters stand on is at about four fifths of a raster
        let base = (4 * height).div_ceil(5) + self.up;
        self.raster.raster().iter().enumerate().flat_map(move |(row, line)| {
            line.iter().enumerate().filter(|(_, cover)| **cover > 0).map(move |(column, cover)| {
                #[expect(clippy::cast_possible_wrap, reason = "a picture has fewer pixels than that")]
                let place = ((self.x + column) as i64, row as i64 - base as i64);
                (place.0, place.1, *cover)
            })
        })
    }
}

/// The digit or sign that is raised here.
fn raised(c: char) -> Option<char> {
    Some(match c {
        '⁻' => '-',
        '⁰' => '0',
        '¹' => '1',
        '²' => '2',
        '³' => '3',
        '⁴' => '4',
        '⁵' => '5',
        '⁶' => '6',
        '⁷' => '7',
        '⁸' => '8',
        '⁹' => '9',
        _ => return None,
    })
}

/// What stands for a sign that the font lacks.
fn plain(c: char) -> String {
    match c {
        '−' | '–' => "-".to_owned(),
        '∞' => "inf".to_owned(),
        '…' => "...".to_owned(),
        other => other.to_string(),
    }
}
