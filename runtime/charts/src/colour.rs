//! Colours: eight that colour-blind people can tell apart, and one ramp for numbers.
//!
//! Series: the palette of Okabe and Ito (Color universal design, 2008), its darkest members lightened on dark ground.
//! Numbers: viridis of matplotlib (van der Walt and Smith, CC0), linear between 11 of its 256 entries.

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

/// The colour of a number from 0 to 1 as `#rrggbb`; what lies outside has the colour of the nearer end, NaN is grey.
#[must_use]
pub fn viridis(at: f64) -> String {
    if at.is_nan() {
        return "#808080".to_owned();
    }
    let x = at.clamp(0.0, 1.0) * 10.0;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and 9")]
    let k = (x.floor() as usize).min(9);
    #[expect(clippy::cast_precision_loss, reason = "at most 9")]
    let share = x - k as f64;
    let mix = |c: usize| {
        let (a, b) = (f64::from(VIRIDIS[k][c]), f64::from(VIRIDIS[k + 1][c]));
        (a + share * (b - a)).round()
    };
    format!("#{:02x}{:02x}{:02x}", byte(mix(0)), byte(mix(1)), byte(mix(2)))
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and 255")]
fn byte(x: f64) -> u8 {
    x as u8
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
    let mut light = ground("#1d2125", "#5a6470", "#d9dee3", "#ffffff", "#e4e7ea");
    let mut dark = ground("#e6e9ec", "#a3adb8", "#39414a", "#15191d", "#39414a");
    for k in 0..PALETTE {
        light.push_str(&series(&format!("c{k}"), LIGHT[k]));
        dark.push_str(&series(&format!("c{k}"), DARK[k]));
    }
    light.push_str(&series("ci", "#1d2125"));
    dark.push_str(&series("ci", "#e6e9ec"));
    for k in 0..TONES {
        #[expect(clippy::cast_precision_loss, reason = "at most 15")]
        let at = k as f64 / 15.0;
        light.push_str(&series(&format!("v{k}"), &viridis(0.87 * at)));
        dark.push_str(&series(&format!("v{k}"), &viridis(0.22 + 0.78 * at)));
    }
    format!("{COMMON}{light}@media (prefers-color-scheme:dark){{{dark}}}")
}

const COMMON: &str = ".wfl{font:13px system-ui,-apple-system,'Segoe UI',Roboto,'DejaVu Sans',sans-serif}\
.wfl .t{font-weight:600;font-size:14px}.wfl .m{text-anchor:middle}.wfl .e{text-anchor:end}\
.wfl .l{fill:none;stroke-width:1.8;stroke-linejoin:round}.wfl .d{stroke-dasharray:6 4}\
.wfl .h{fill:transparent;stroke:none}.wfl .h:hover{fill:#8888;stroke:none}\
.wfl .g{stroke-width:1}.wfl .g2{stroke-width:.5}.wfl .a{stroke-width:1.2}.wfl .s{font-size:12px}\
.wfl .z:hover{stroke:#d55e00;stroke-width:1.5}";

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
