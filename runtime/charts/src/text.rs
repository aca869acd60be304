//! Text inside SVG and HTML: escaping, widths, numbers for people.

use std::fmt::Write;

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
}

impl Svg {
    /// Anything, already escaped.
    pub(crate) fn raw(&mut self, text: &str) {
        self.text.push_str(text);
        self.text.push('\n');
    }

    /// A straight line.
    pub(crate) fn line(&mut self, class: &str, from: [f64; 2], to: [f64; 2]) {
        let ([x1, y1], [x2, y2]) = (from, to);
        self.raw(&format!(r#"<line class="{class}" x1="{x1:.1}" y1="{y1:.1}" x2="{x2:.1}" y2="{y2:.1}"/>"#));
    }

    /// A label; `class` gives its colour and where it is anchored.
    pub(crate) fn label(&mut self, class: &str, at: [f64; 2], text: &str) {
        self.raw(&format!(r#"<text class="{class}" x="{:.1}" y="{:.1}">{}</text>"#, at[0], at[1], escape(text)));
    }

    /// A label that reads from below to above.
    pub(crate) fn upright(&mut self, class: &str, at: [f64; 2], text: &str) {
        let [x, y] = at;
        let turn = format!("rotate(-90 {x:.1} {y:.1})");
        self.raw(&format!(r#"<text class="{class}" x="{x:.1}" y="{y:.1}" transform="{turn}">{}</text>"#, escape(text)));
    }

    /// A rectangle, with a note that shows when pointed at.
    pub(crate) fn rect(&mut self, paint: &str, at: [f64; 2], size: [f64; 2], note: &str) {
        let title = title(note);
        let ([x, y], [w, h]) = (at, size);
        self.raw(&format!(r#"<rect {paint} x="{x:.1}" y="{y:.1}" width="{w:.1}" height="{h:.1}">{title}</rect>"#));
    }

    /// A polygon, with a note that shows when pointed at.
    pub(crate) fn polygon(&mut self, paint: &str, corners: &[[f64; 2]], note: &str) {
        self.raw(&format!(r#"<polygon {paint} points="{}">{}</polygon>"#, points(corners), title(note)));
    }

    /// A line through points.
    pub(crate) fn polyline(&mut self, paint: &str, corners: &[[f64; 2]]) {
        self.raw(&format!(r#"<polyline {paint} points="{}"/>"#, points(corners)));
    }

    /// An invisible disc that can be pointed at.
    pub(crate) fn target(&mut self, at: [f64; 2], note: &str) {
        self.raw(&format!(r#"<circle class="h" cx="{:.1}" cy="{:.1}" r="6">{}</circle>"#, at[0], at[1], title(note)));
    }
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
    fn powers_are_raised() {
        assert_eq!(power_of_ten(-12), "10⁻¹²");
        assert_eq!(power_of_ten(308), "10³⁰⁸");
    }
}
