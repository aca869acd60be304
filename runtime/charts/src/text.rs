//! Text inside SVG and HTML: escaping, widths, numbers for people.

use std::fmt::Write;

use crate::{
    marks::{Mark, Reads},
    raster,
    surface::Surface,
};

/// Faces of a surface that an SVG draws one by one; more are pixels inside it, which take less room.
pub(crate) const FACES: usize = 2500;

/// Text that may stand between tags and in quoted attributes. Characters that XML forbids become U+FFFD.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\n' | '\t' => out.push(c),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// About how wide a text is, in units of its size: 0.56 a character, what sans-serif faces need on average.
#[expect(clippy::cast_precision_loss, reason = "labels are short")]
pub(crate) fn width(text: &str) -> f64 {
    0.56 * text.chars().count() as f64
}

/// The first characters of a text, with an ellipsis if there are more than `limit`.
pub(crate) fn clipped(text: &str, limit: usize) -> String {
    if text.chars().count() <= limit {
        return text.to_owned();
    }
    text.chars().take(limit.saturating_sub(1)).chain(['…']).collect()
}

/// A number with four significant digits, below 1e5 with all digits of its whole part, as `1.234e-5` outside 0.001 to
/// 1e5: to be read, not computed with.
#[must_use]
pub fn short(value: f64) -> String {
    if value.is_nan() {
        return "not a number".to_owned();
    }
    if value.is_infinite() {
        return if value > 0.0 { "∞" } else { "−∞" }.to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let scientific = format!("{value:.3e}");
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    if (-3..5).contains(&exponent) {
        let decimals = usize::try_from(3 - exponent).unwrap_or(0);
        return minus(trimmed(&format!("{value:.decimals$}")));
    }
    minus(&format!("{}e{exponent}", trimmed(mantissa)))
}

/// Without zeros behind the last decimal that says something.
fn trimmed(number: &str) -> &str {
    if number.contains('.') { number.trim_end_matches('0').trim_end_matches('.') } else { number }
}

/// The typographic minus in front; an exponent keeps the plain one, so that it can be copied.
pub(crate) fn minus(number: &str) -> String {
    number.strip_prefix('-').map_or_else(|| number.to_owned(), |rest| format!("−{rest}"))
}

/// A power of ten with its exponent raised.
pub(crate) fn power_of_ten(exponent: i32) -> String {
    let mut out = "10".to_owned();
    for c in exponent.to_string().chars() {
        out.push(match c {
            '-' => '⁻',
            '0' => '⁰',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            '4' => '⁴',
            '5' => '⁵',
            '6' => '⁶',
            '7' => '⁷',
            '8' => '⁸',
            _ => '⁹',
        });
    }
    out
}

/// An SVG that is being written. Lengths are in its own units, rounded to a tenth.
#[derive(Debug, Default)]
pub(crate) struct Svg {
    pub(crate) text: String,
    /// What was drawn, in order, for a picture of pixels; `None` if nobody asks for it.
    pub(crate) marks: Option<Vec<Mark>>,
}

impl Svg {
    fn mark(&mut self, mark: impl FnOnce() -> Mark) {
        if let Some(marks) = &mut self.marks {
            marks.push(mark());
        }
    }

    /// Anything, already escaped; it has no part in a picture of pixels.
    pub(crate) fn raw(&mut self, text: &str) {
        self.text.push_str(text);
        self.text.push('\n');
    }

    /// A straight line.
    pub(crate) fn line(&mut self, class: &str, from: [f64; 2], to: [f64; 2]) {
        self.mark(|| Mark::Line { paint: format!("class=\"{class}\""), points: vec![from, to] });
        let ([x1, y1], [x2, y2]) = (from, to);
        self.raw(&format!(r#"<line class="{class}" x1="{x1:.1}" y1="{y1:.1}" x2="{x2:.1}" y2="{y2:.1}"/>"#));
    }

    /// A label; `class` gives its colour and where it is anchored.
    pub(crate) fn label(&mut self, class: &str, at: [f64; 2], text: &str) {
        self.mark(|| Mark::Text { class: class.to_owned(), at, text: text.to_owned(), reads: Reads::Across });
        self.raw(&format!(r#"<text class="{class}" x="{:.1}" y="{:.1}">{}</text>"#, at[0], at[1], escape(text)));
    }

    /// A label that reads from below to above.
    pub(crate) fn upright(&mut self, class: &str, at: [f64; 2], text: &str) {
        self.mark(|| Mark::Text { class: class.to_owned(), at, text: text.to_owned(), reads: Reads::Up });
        let [x, y] = at;
        let turn = format!("rotate(-90 {x:.1} {y:.1})");
        self.raw(&format!(r#"<text class="{class}" x="{x:.1}" y="{y:.1}" transform="{turn}">{}</text>"#, escape(text)));
    }

    /// A rectangle, with a note that shows when pointed at.
    pub(crate) fn rect(&mut self, paint: &str, at: [f64; 2], size: [f64; 2], note: &str) {
        let title = title(note);
        let ([x, y], [w, h]) = (at, size);
        let corners = || vec![at, [x + w, y], [x + w, y + h], [x, y + h]];
        self.mark(|| Mark::Polygon { paint: paint.to_owned(), corners: corners() });
        self.raw(&format!(r#"<rect {paint} x="{x:.1}" y="{y:.1}" width="{w:.1}" height="{h:.1}">{title}</rect>"#));
    }

    /// A polygon, with a note that shows when pointed at.
    pub(crate) fn polygon(&mut self, paint: &str, corners: &[[f64; 2]], note: &str) {
        self.mark(|| Mark::Polygon { paint: paint.to_owned(), corners: corners.to_vec() });
        self.raw(&format!(r#"<polygon {paint} points="{}">{}</polygon>"#, points(corners), title(note)));
    }

    /// A line through points.
    pub(crate) fn polyline(&mut self, paint: &str, corners: &[[f64; 2]]) {
        self.mark(|| Mark::Line { paint: paint.to_owned(), points: corners.to_vec() });
        self.raw(&format!(r#"<polyline {paint} points="{}"/>"#, points(corners)));
    }

    /// A disc, with a note that shows when pointed at.
    pub(crate) fn disc(&mut self, paint: &str, at: [f64; 2], r: f64, note: &str) {
        self.mark(|| Mark::Disc { paint: paint.to_owned(), at, r });
        self.raw(&format!(
            r#"<circle {paint} cx="{:.1}" cy="{:.1}" r="{r:.1}">{}</circle>"#,
            at[0],
            at[1],
            title(note)
        ));
    }

    /// Faces in space, already at their places in the picture.
    pub(crate) fn surface(&mut self, surface: Surface) {
        match (surface.faces.len() > FACES).then(|| raster::image(&surface)) {
            Some(Ok(image)) => {
                let ([x, y], [w, h]) = (image.at, image.size);
                let data = base64(&image.file);
                self.raw(&format!(
                    r#"<image x="{x}" y="{y}" width="{w}" height="{h}" href="data:image/png;base64,{data}"/>"#
                ));
            }
            _ => surface.write(&mut self.text),
        }
        self.mark(|| Mark::Surface(surface));
    }

    /// An invisible disc that can be pointed at.
    pub(crate) fn target(&mut self, at: [f64; 2], note: &str) {
        self.raw(&format!(r#"<circle class="h" cx="{:.1}" cy="{:.1}" r="6">{}</circle>"#, at[0], at[1], title(note)));
    }
}

/// Bytes as text (RFC 4648).
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let byte = |k: usize| u32::from(chunk.get(k).copied().unwrap_or(0));
        let word = byte(0) << 16 | byte(1) << 8 | byte(2);
        for k in 0..4 {
            let digit = DIGITS[(word >> (18 - 6 * k) & 63) as usize];
            out.push(if k > chunk.len() { '=' } else { char::from(digit) });
        }
    }
    out
}

fn title(note: &str) -> String {
    if note.is_empty() { String::new() } else { format!("<title>{}</title>", escape(note)) }
}

fn points(corners: &[[f64; 2]]) -> String {
    let mut out = String::new();
    for [x, y] in corners {
        // writing to a string cannot fail
        let _ = write!(out, "{x:.1},{y:.1} ");
    }
    out.truncate(out.trim_end().len());
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_keep_their_size() {
        let cases = [
            (0.0, "0"),
            (1.0, "1"),
            (-12.5, "−12.5"),
            (98_765.4, "98765"),
            (123_456.0, "1.235e5"),
            (1e-3, "0.001"),
            (9.9996e-4, "0.001"),
            (1.25e-9, "1.25e-9"),
            (-5e-324, "−4.941e-324"),
            (f64::INFINITY, "∞"),
            (f64::NAN, "not a number"),
        ];
        for (value, expected) in cases {
            assert_eq!(short(value), expected, "{value:e}");
        }
    }

    #[test]
    fn markup_in_names_stays_text() {
        assert_eq!(escape("<b a=\"1\">&'\u{1}"), "&lt;b a=&quot;1&quot;&gt;&amp;&#39;\u{fffd}");
    }

    #[test]
    fn bytes_become_text_as_the_standard_says() {
        // the examples of RFC 4648
        for (plain, text) in [("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy"), ("", "")] {
            assert_eq!(base64(plain.as_bytes()), text);
        }
    }

    #[test]
    fn powers_are_raised() {
        assert_eq!(power_of_ten(-12), "10⁻¹²");
        assert_eq!(power_of_ten(308), "10³⁰⁸");
    }
}
