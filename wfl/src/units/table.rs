//! Names of units: SI units with their prefixes, and the few others that mechanics uses.
//!
//! A scale is the size of the unit in SI. `degC` is a difference of temperatures: no zero is moved anywhere.

use crate::diag::nearest;

/// Base units: kg, m, s, K, A, mol, cd.
pub(super) const DIMENSIONS: usize = 7;

struct Row {
    name: &'static str,
    scale: f64,
    powers: [i8; DIMENSIONS],
    prefixes: bool,
}

/// A unit that takes no prefix.
const fn unit(name: &'static str, scale: f64, powers: [i8; DIMENSIONS]) -> Row {
    Row { name, scale, powers, prefixes: false }
}

/// A unit that takes the prefixes of the SI.
const fn prefixed(name: &'static str, scale: f64, powers: [i8; DIMENSIONS]) -> Row {
    Row { name, scale, powers, prefixes: true }
}

/// Units that are made of others stand first: a product is shown in this order, `MPa*mm`.
const TABLE: &[Row] = &[
    prefixed("N", 1.0, [1, 1, -2, 0, 0, 0, 0]),
    prefixed("Pa", 1.0, [1, -1, -2, 0, 0, 0, 0]),
    prefixed("bar", 1e5, [1, -1, -2, 0, 0, 0, 0]),
    unit("psi", 6_894.757_293_168_361, [1, -1, -2, 0, 0, 0, 0]),
    unit("ksi", 6_894_757.293_168_361, [1, -1, -2, 0, 0, 0, 0]),
    unit("lbf", 4.448_221_615_260_5, [1, 1, -2, 0, 0, 0, 0]),
    prefixed("J", 1.0, [1, 2, -2, 0, 0, 0, 0]),
    prefixed("W", 1.0, [1, 2, -3, 0, 0, 0, 0]),
    prefixed("C", 1.0, [0, 0, 1, 0, 1, 0, 0]),
    prefixed("V", 1.0, [1, 2, -3, 0, -1, 0, 0]),
    prefixed("F", 1.0, [-1, -2, 4, 0, 2, 0, 0]),
    prefixed("ohm", 1.0, [1, 2, -3, 0, -2, 0, 0]),
    prefixed("T", 1.0, [1, 0, -2, 0, -1, 0, 0]),
    prefixed("g", 1e-3, [1, 0, 0, 0, 0, 0, 0]),
    unit("t", 1e3, [1, 0, 0, 0, 0, 0, 0]),
    prefixed("L", 1e-3, [0, 3, 0, 0, 0, 0, 0]),
    prefixed("darcy", 9.869_233e-13, [0, 2, 0, 0, 0, 0, 0]),
    prefixed("m", 1.0, [0, 1, 0, 0, 0, 0, 0]),
    unit("in", 0.0254, [0, 1, 0, 0, 0, 0, 0]),
    unit("ft", 0.3048, [0, 1, 0, 0, 0, 0, 0]),
    prefixed("rad", 1.0, [0; DIMENSIONS]),
    unit("deg", std::f64::consts::PI / 180.0, [0; DIMENSIONS]),
    prefixed("K", 1.0, [0, 0, 0, 1, 0, 0, 0]),
    unit("degC", 1.0, [0, 0, 0, 1, 0, 0, 0]),
    prefixed("A", 1.0, [0, 0, 0, 0, 1, 0, 0]),
    prefixed("mol", 1.0, [0, 0, 0, 0, 0, 1, 0]),
    prefixed("cd", 1.0, [0, 0, 0, 0, 0, 0, 1]),
    prefixed("Hz", 1.0, [0, 0, -1, 0, 0, 0, 0]),
    prefixed("s", 1.0, [0, 0, 1, 0, 0, 0, 0]),
    unit("min", 60.0, [0, 0, 1, 0, 0, 0, 0]),
    unit("h", 3600.0, [0, 0, 1, 0, 0, 0, 0]),
    unit("day", 86_400.0, [0, 0, 1, 0, 0, 0, 0]),
    unit("year", 31_557_600.0, [0, 0, 1, 0, 0, 0, 0]),
];

/// Prefixes with the decimal logarithm of their value; the first is none.
const PREFIXES: &[(&str, i32)] = &[
    ("", 0),
    ("M", 6),
    ("k", 3),
    ("m", -3),
    ("G", 9),
    ("c", -2),
    ("u", -6),
    ("n", -9),
    ("h", 2),
    ("da", 1),
    ("d", -1),
    ("T", 12),
    ("p", -12),
    ("f", -15),
];

/// A row of the table with a prefix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct NamedUnit {
    row: u8,
    prefix: u8,
}

impl NamedUnit {
    /// Every unit there is, the plain ones first.
    pub(super) fn all() -> impl Iterator<Item = NamedUnit> {
        (0..PREFIXES.len() as u8).flat_map(|prefix| {
            let rows = (0..TABLE.len() as u8).filter(move |row| prefix == 0 || TABLE[*row as usize].prefixes);
            rows.map(move |row| NamedUnit { row, prefix })
        })
    }

    /// The unit of a name. A name of the table comes before a prefix and a name: `min` is no milli-inch.
    pub(super) fn find(name: &str) -> Option<NamedUnit> {
        NamedUnit::all().find(|u| {
            let (prefix, row) = (PREFIXES[u.prefix as usize].0, TABLE[u.row as usize].name);
            name.strip_prefix(prefix) == Some(row)
        })
    }

    /// What to write for a unit that is spelled out or named otherwise.
    fn spelled(word: &str) -> Option<&'static str> {
        const WORDS: &[(&[&str], &str)] = &[
            (&["sec", "secs", "second", "seconds"], "s"),
            (&["minute", "minutes", "mins"], "min"),
            (&["hr", "hrs", "hour", "hours"], "h"),
            (&["d", "days"], "day"),
            (&["yr", "yrs", "a", "years", "annum"], "year"),
            (&["msec", "millisecond", "milliseconds"], "ms"),
            (&["meter", "meters", "metre", "metres"], "m"),
            (&["millimeter", "millimetre", "millimeters", "millimetres"], "mm"),
            (&["inch", "inches"], "in"),
            (&["foot", "feet"], "ft"),
            (&["gram", "grams", "gramme"], "g"),
            (&["kilogram", "kilograms", "kilo"], "kg"),
            (&["ton", "tons", "tonne", "tonnes"], "t"),
            (&["newton", "newtons", "Newton"], "N"),
            (&["pascal", "pascals", "Pascal"], "Pa"),
            (&["kelvin", "Kelvin"], "K"),
            (&["celsius", "Celsius"], "degC"),
            (&["degree", "degrees"], "deg"),
            (&["radian", "radians"], "rad"),
            (&["hertz", "Hertz"], "Hz"),
            (&["joule", "joules"], "J"),
            (&["watt", "watts"], "W"),
        ];
        WORDS.iter().find(|(words, _)| words.contains(&word)).map(|(_, unit)| *unit)
    }

    /// The name to offer for a word that is none.
    pub(super) fn nearest(word: &str) -> Option<String> {
        if let Some(unit) = Self::spelled(word) {
            return Some(unit.to_owned());
        }
        let stem = word.trim_end_matches(|c: char| c.is_ascii_digit());
        if stem.len() < word.len() && NamedUnit::find(stem).is_some() {
            return Some(format!("{stem}^{}", &word[stem.len()..]));
        }
        let names: Vec<String> = NamedUnit::all().map(NamedUnit::name).collect();
        // same letters in other cases first: `mpa` is `MPa`
        let same = names.iter().find(|n| n.eq_ignore_ascii_case(word) && n.starts_with('M'));
        let same = same.or_else(|| names.iter().find(|n| n.eq_ignore_ascii_case(word)));
        // then names with the same first letter: `mmm` is no `Mm`
        let (like, other): (Vec<&str>, Vec<&str>) =
            names.iter().map(String::as_str).partition(|n| n.chars().next() == word.chars().next());
        same.cloned().or_else(|| nearest(word, like.into_iter().chain(other)).map(str::to_owned))
    }

    pub(super) fn name(self) -> String {
        format!("{}{}", PREFIXES[self.prefix as usize].0, TABLE[self.row as usize].name)
    }

    pub(super) fn log_scale(self) -> f64 {
        TABLE[self.row as usize].scale.log10() + f64::from(PREFIXES[self.prefix as usize].1)
    }

    pub(super) fn powers(self) -> impl Iterator<Item = i64> {
        TABLE[self.row as usize].powers.into_iter().map(i64::from)
    }

    /// True for a length, with power one: what coordinates may have.
    pub(super) fn is_length(self) -> bool {
        TABLE[self.row as usize].powers == [0, 1, 0, 0, 0, 0, 0]
    }

    /// True for a time, with power one.
    pub(super) fn is_time(self) -> bool {
        TABLE[self.row as usize].powers == [0, 0, 1, 0, 0, 0, 0]
    }

    /// True if lengths are part of it.
    pub(super) fn has_length(self) -> bool {
        TABLE[self.row as usize].powers[1] != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_found_with_and_without_prefix() {
        let scale = |name: &str| NamedUnit::find(name).map(|u| 10_f64.powf(u.log_scale()));
        // powers of ten and definitions of the units, from the SI brochure
        let known =
            [("kg", 1.0), ("mm", 1e-3), ("GPa", 1e9), ("daN", 10.0), ("min", 60.0), ("h", 3600.0), ("hPa", 100.0)];
        for (name, value) in known {
            assert!((scale(name).unwrap() / value - 1.0).abs() < 1e-12, "{name}");
        }
        for unknown in ["mmm", "MPaa", "kin", "x", "kkg", "Mmin"] {
            assert!(scale(unknown).is_none(), "{unknown}");
        }
    }

    #[test]
    fn every_name_means_one_unit() {
        for unit in NamedUnit::all() {
            assert_eq!(NamedUnit::find(&unit.name()).map(NamedUnit::name), Some(unit.name()));
        }
    }

    #[test]
    fn the_nearest_name_is_offered() {
        let near = |w: &str| NamedUnit::nearest(w);
        assert_eq!(near("mpa").as_deref(), Some("MPa"));
        assert_eq!(near("MPaa").as_deref(), Some("MPa"));
        assert_eq!(near("mmm").as_deref(), Some("mm"));
        assert_eq!(near("parsec"), None);
        assert_eq!(near("sec").as_deref(), Some("s"));
        assert_eq!(near("hours").as_deref(), Some("h"));
    }
}
