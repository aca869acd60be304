//! Colours: eight that colour-blind people can tell apart, and one ramp for numbers.
//!
//! Series: the palette of Okabe and Ito (Color universal design, 2008), its darkest members lightened on dark ground.
//! Numbers: viridis of matplotlib (van der Walt and Smith, CC0), linear between 11 of its 256 entries; for numbers of both
//! signs the diverging map of Moreland (Diverging color maps for scientific visualization, 2009), linear between 17.

/// The colour of a series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Colour {
    /// A member of the palette; counted on from 0 after the last.
    Palette(usize),
    /// A place on the ramp from 0 to 1, for families such as the steps of a run.
    Tone(f64),
    /// The colour of text, for what everything else is compared with.
    Ink,
}

/// Members of the palette.
pub(crate) const PALETTE: usize = 7;
/// Tones of series: a class each, since light and dark ground need different parts of the ramp.
const TONES: usize = 16;

/// The part of the ramp that can be seen on light ground.
const LIGHT_TONES: f64 = 0.87;
/// Text, text of less weight, lines of the grid, and what nothing happens at, on light ground.
const INK: &str = "#1d2125";
const PALE: &str = "#5a6470";
const GRID: &str = "#d9dee3";
const OPEN: &str = "#e4e7ea";

const LIGHT: [&str; PALETTE] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6d1f"];
const DARK: [&str; PALETTE] = ["#3ea0e0", "#f0803c", "#1fc79a", "#dd94bd", "#f0b030", "#9ad6f7", "#cbb26a"];

/// Viridis at 0, 0.1, ..., 1.
const VIRIDIS: [[u8; 3]; 11] = [
    [0x44, 0x01, 0x54],
    [0x48, 0x25, 0x76],
    [0x41, 0x44, 0x87],
    [0x35, 0x5f, 0x8d],
    [0x2a, 0x78, 0x8e],
    [0x21, 0x91, 0x8c],
    [0x22, 0xa8, 0x84],
    [0x44, 0xbf, 0x70],
    [0x7a, 0xd1, 0x51],
    [0xbd, 0xdf, 0x26],
    [0xfd, 0xe7, 0x25],
];

/// The diverging map at 0, 1/16, ..., 1.
const DIVERGING: [[u8; 3]; 17] = [
    [59, 76, 192],
    [77, 104, 215],
    [98, 130, 234],
    [119, 154, 247],
    [141, 176, 254],
    [163, 194, 255],
    [184, 208, 249],
    [204, 217, 238],
    [221, 221, 221],
    [236, 211, 197],
    [245, 196, 173],
    [247, 177, 148],
    [244, 154, 123],
    [236, 127, 99],
    [222, 96, 77],
    [203, 62, 56],
    [180, 4, 38],
];

/// Colours of numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Ramp {
    /// From dark to bright: numbers of one sign.
    #[default]
    Viridis,
    /// From blue over grey to red: numbers of both signs, with 0 in the middle of the range.
    Diverging,
}

impl Ramp {
    /// Red, green and blue of a number from 0 to 1; what lies outside has the colour of the nearer end, NaN is grey.
    #[must_use]
    pub fn rgb(self, at: f64) -> [u8; 3] {
        let table: &[[u8; 3]] = match self {
            Ramp::Viridis => &VIRIDIS,
            Ramp::Diverging => &DIVERGING,
        };
        if at.is_nan() {
            return [0x80; 3];
        }
        let last = table.len() - 1;
        #[expect(clippy::cast_precision_loss, reason = "a few entries")]
        let x = at.clamp(0.0, 1.0) * last as f64;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an entry")]
        let k = (x.floor() as usize).min(last - 1);
        #[expect(clippy::cast_precision_loss, reason = "a few entries")]
        let share = x - k as f64;
        [0, 1, 2].map(|c| {
            let (a, b) = (f64::from(table[k][c]), f64::from(table[k + 1][c]));
            byte((a + share * (b - a)).round())
        })
    }

    /// [`Ramp::rgb`] as `#rrggbb`.
    #[must_use]
    pub fn hex(self, at: f64) -> String {
        let [r, g, b] = self.rgb(at);
        format!("#{r:02x}{g:02x}{b:02x}")
    }
}

/// The colour of a number from 0 to 1 on [`Ramp::Viridis`] as `#rrggbb`.
#[must_use]
pub fn viridis(at: f64) -> String {
    Ramp::Viridis.hex(at)
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and 255")]
fn byte(x: f64) -> u8 {
    x as u8
}

/// Red, green and blue that a class gives on light ground, to strokes and areas; `None` for a class that is no colour.
pub(crate) fn of_class(class: &str) -> Option<[u8; 3]> {
    let number = |prefix: &str| class.strip_prefix(prefix).and_then(|n| n.parse::<usize>().ok());
    let hex = match class {
        "b" => "#ffffff".to_owned(),
        "o" => OPEN.to_owned(),
        "g" | "g2" => GRID.to_owned(),
        "a" | "s" => PALE.to_owned(),
        "ci" => INK.to_owned(),
        _ => match (number("c"), number("v")) {
            (Some(k), _) => LIGHT[k % PALETTE].to_owned(),
            #[expect(clippy::cast_precision_loss, reason = "at most 15")]
            (_, Some(k)) => viridis(LIGHT_TONES * k as f64 / (TONES - 1) as f64),
            _ => return None,
        },
    };
    from_hex(&hex)
}

/// `#rrggbb` as red, green and blue.
pub(crate) fn from_hex(text: &str) -> Option<[u8; 3]> {
    let digits = text.strip_prefix('#').filter(|d| d.len() == 6 && d.is_ascii())?;
    let part = |k: usize| u8::from_str_radix(&digits[2 * k..2 * k + 2], 16).ok();
    Some([part(0)?, part(1)?, part(2)?])
}

impl Colour {
    /// The class that gives it.
    pub(crate) fn class(self) -> String {
        match self {
            Colour::Palette(k) => format!("c{}", k % PALETTE),
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and 15")]
            Colour::Tone(at) => format!("v{}", (at.clamp(0.0, 1.0) * 15.0).round() as usize),
            Colour::Ink => "ci".to_owned(),
        }
    }
}

/// The rules of all classes used in charts. No variables: other programs than browsers read these files too, and those
/// skip the media rule.
pub(crate) fn style() -> String {
    let mut light = ground(INK, PALE, GRID, "#ffffff", OPEN);
    let mut dark = ground("#e6e9ec", "#a3adb8", "#39414a", "#15191d", "#39414a");
    for k in 0..PALETTE {
        light.push_str(&series(&format!("c{k}"), LIGHT[k]));
        dark.push_str(&series(&format!("c{k}"), DARK[k]));
    }
    light.push_str(&series("ci", INK));
    dark.push_str(&series("ci", "#e6e9ec"));
    for k in 0..TONES {
        #[expect(clippy::cast_precision_loss, reason = "at most 15")]
        let at = k as f64 / 15.0;
        light.push_str(&series(&format!("v{k}"), &viridis(LIGHT_TONES * at)));
        dark.push_str(&series(&format!("v{k}"), &viridis(0.22 + 0.78 * at)));
    }
    dark.push_str(".wfl .fr{stroke:#e6e9ec}");
    format!("{COMMON}{light}@media (prefers-color-scheme:dark){{{dark}}}")
}

const COMMON: &str = ".wfl{font:13px system-ui,-apple-system,'Segoe UI',Roboto,'DejaVu Sans',sans-serif}\
.wfl .t{font-weight:600;font-size:14px}.wfl .m{text-anchor:middle}.wfl .e{text-anchor:end}\
.wfl .l{fill:none;stroke-width:1.8;stroke-linejoin:round}.wfl .d{stroke-dasharray:6 4}\
.wfl .h{fill:transparent;stroke:none}.wfl .h:hover{fill:#8888;stroke:none}\
.wfl .g{stroke-width:1}.wfl .g2{stroke-width:.5}.wfl .a{stroke-width:1.2}.wfl .s{font-size:12px}\
.wfl .z:hover{stroke:#d55e00;stroke-width:1.5}\
.wfl .f{stroke-width:.6;stroke-linejoin:round}.wfl .fm{fill:none;stroke:#1d2125;stroke-width:.4;stroke-opacity:.45}\
.wfl .fr{fill:none;stroke:#1d2125;stroke-width:1;stroke-linecap:round}";

fn ground(ink: &str, pale: &str, grid: &str, ground: &str, open: &str) -> String {
    format!(
        ".wfl .b{{fill:{ground}}}.wfl text{{fill:{ink}}}.wfl .s{{fill:{pale}}}.wfl .g,.wfl .g2{{stroke:{grid}}}\
         .wfl .a{{stroke:{pale};fill:none}}.wfl .o{{fill:{open}}}"
    )
}

fn series(class: &str, colour: &str) -> String {
    format!(".wfl .{class}{{stroke:{colour};fill:{colour}}}.wfl .l.{class}{{fill:none}}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ramp_is_that_of_matplotlib() {
        // matplotlib 3.8, matplotlib.colormaps["viridis"](x): entries 0, 64, 128 and 255 of the table
        assert_eq!(viridis(0.0), "#440154");
        assert_eq!(viridis(1.0), "#fde725");
        let near = |at: f64, expected: [i32; 3]| {
            let hex = viridis(at);
            for c in 0..3 {
                let found = i32::from_str_radix(&hex[1 + 2 * c..3 + 2 * c], 16).unwrap();
                assert!((found - expected[c]).abs() <= 3, "{at}: {hex}");
            }
        };
        near(64.0 / 255.0, [0x3b, 0x52, 0x8b]);
        near(128.0 / 255.0, [0x21, 0x91, 0x8c]);
        assert_eq!(viridis(f64::NAN), "#808080");
        assert_eq!(viridis(7.0), viridis(1.0));
    }

    #[test]
    fn classes_are_all_in_the_style() {
        let style = style();
        for colour in [Colour::Palette(9), Colour::Tone(0.0), Colour::Tone(2.0), Colour::Ink] {
            assert!(style.contains(&format!(".wfl .{}{{", colour.class())), "{colour:?}");
        }
    }
}
