//! Letters of the fonts that every reader of PDF has, with their widths (Adobe's font metrics of Helvetica and Symbol).

/// Size and height of raised digits, in parts of the size of the text.
pub(super) const SMALL: f64 = 0.7;
pub(super) const RISE: f64 = 0.35;

/// Widths of the letters 32 to 126 of Helvetica, in thousandths of the size; digits and signs of numbers are as wide in its
/// bold face.
const WIDTHS: [u16; 95] = [
    278, 278, 355, 556, 556, 889, 667, 191, 333, 333, 389, 584, 278, 333, 278, 278, 556, 556, 556, 556, 556, 556, 556,
    556, 556, 556, 278, 278, 584, 584, 584, 556, 1015, 667, 667, 722, 722, 667, 611, 778, 722, 278, 500, 667, 556, 833,
    722, 778, 667, 778, 722, 667, 611, 722, 667, 944, 667, 667, 611, 278, 278, 278, 469, 556, 333, 556, 556, 500, 556,
    556, 278, 556, 556, 222, 222, 500, 222, 833, 556, 556, 556, 556, 333, 500, 278, 556, 500, 722, 500, 500, 500, 334,
    260, 334, 584,
];

/// Characters of Symbol with their codes and widths.
const SYMBOLS: &[(char, u8, u16)] = &[
    ('−', b'-', 549),
    ('∞', 0xa5, 713),
    ('≤', 0xa3, 549),
    ('≥', 0xb3, 549),
    ('≈', 0xbb, 549),
    ('∂', 0xb6, 494),
    ('√', 0xd6, 549),
    ('∇', 0xd1, 713),
    ('→', 0xae, 987),
    ('α', b'a', 631),
    ('β', b'b', 549),
    ('γ', b'g', 411),
    ('δ', b'd', 494),
    ('ε', b'e', 439),
    ('ζ', b'z', 494),
    ('η', b'h', 603),
    ('θ', b'q', 521),
    ('κ', b'k', 549),
    ('λ', b'l', 549),
    ('μ', b'm', 576),
    ('ν', b'n', 521),
    ('ξ', b'x', 493),
    ('π', b'p', 549),
    ('ρ', b'r', 549),
    ('σ', b's', 603),
    ('τ', b't', 439),
    ('φ', b'f', 521),
    ('χ', b'c', 549),
    ('ψ', b'y', 686),
    ('ω', b'w', 686),
    ('Γ', b'G', 603),
    ('Δ', b'D', 612),
    ('Θ', b'Q', 741),
    ('Λ', b'L', 686),
    ('Π', b'P', 768),
    ('Σ', b'S', 592),
    ('Φ', b'F', 763),
    ('Ψ', b'Y', 795),
    ('Ω', b'W', 768),
];

/// Characters outside of Latin 1 that the coding of Windows has, with their codes and widths.
const WINDOWS: &[(char, u8, u16)] =
    &[('…', 0x85, 1000), ('–', 0x96, 556), ('—', 0x97, 1000), ('’', 0x92, 222), ('‘', 0x91, 222)];

/// A font of the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Font {
    Plain,
    Bold,
    Symbol,
}

impl Font {
    pub(super) fn name(self) -> &'static str {
        match self {
            Font::Plain => "F1",
            Font::Bold => "F2",
            Font::Symbol => "F3",
        }
    }
}

/// A letter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Letter {
    pub(super) font: Font,
    code: u8,
    /// In thousandths of the size of its font.
    width: u16,
    /// An exponent.
    pub(super) raised: bool,
}

impl Letter {
    /// One font and size serves both.
    pub(super) fn alike(&self, other: &Letter) -> bool {
        (self.font, self.raised) == (other.font, other.raised)
    }

    /// As it stands between parentheses.
    pub(super) fn escaped(&self) -> String {
        match self.code {
            b'(' | b')' | b'\\' => format!("\\{}", char::from(self.code)),
            32..=126 => char::from(self.code).to_string(),
            code => format!("\\{code:03o}"),
        }
    }
}

/// The letters of a text; what no font has becomes a question mark.
pub(super) fn letters(text: &str, bold: bool) -> Vec<Letter> {
    let latin = if bold { Font::Bold } else { Font::Plain };
    text.chars()
        .map(|c| {
            let raised = "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().position(|d| d == c);
            let plain = |code: u8, width: u16| Letter { font: latin, code, width, raised: raised.is_some() };
            let listed = |list: &[(char, u8, u16)]| list.iter().find(|row| row.0 == c).map(|row| (row.1, row.2));
            if let Some(digit) = raised {
                let code = b"0123456789"[digit];
                return plain(code, width(code));
            }
            if c == '⁻' {
                return Letter { font: Font::Symbol, code: b'-', width: 549, raised: true };
            }
            if let Some((code, width)) = listed(SYMBOLS) {
                return Letter { font: Font::Symbol, code, width, raised: false };
            }
            if let Some((code, width)) = listed(WINDOWS) {
                return plain(code, width);
            }
            match u8::try_from(u32::from(c)) {
                Ok(code) if (32..=126).contains(&code) || code >= 160 => plain(code, width(code)),
                _ => plain(b'?', 556),
            }
        })
        .collect()
}

/// Width of a letter of Helvetica. Those of Latin 1 are about as wide as a digit, but for a few signs.
fn width(code: u8) -> u16 {
    match code {
        32..=126 => WIDTHS[usize::from(code) - 32],
        0xb0 => 400,
        0xb7 => 278,
        0xd7 | 0xb1 => 584,
        0xdf => 611,
        0xc0..=0xdd => 700,
        _ => 556,
    }
}

/// How long letters are, for a size of 1.
pub(super) fn length(letters: &[Letter]) -> f64 {
    let one = |l: &Letter| f64::from(l.width) / 1000.0 * if l.raised { SMALL } else { 1.0 };
    letters.iter().map(one).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_of_numbers_and_greek_letters_are_in_symbol() {
        let list = letters("−1.5·10⁻³ σ é (%", false);
        let text: String = list.iter().map(Letter::escaped).collect();
        assert_eq!(text, "-1.5\\26710-3 s \\351 \\(%");
        assert_eq!(
            (list[0].font, list[7].font, list[7].raised, list[8].raised),
            (Font::Symbol, Font::Symbol, true, true)
        );
        // the widths of Adobe's table: 0.549 + 0.556 + 0.278
        assert!((length(&letters("−1.", false)) - 1.383).abs() < 1e-12);
        assert_eq!(letters("漢", true)[0].escaped(), "?");
    }
}
