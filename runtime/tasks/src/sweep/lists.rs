//! Lists of values of a knob, and every combination of them.
//!
//! `a,b,c` is a list, `a..b:log5` has five values at equal ratios, `a..b:lin5` five at equal distances. A comma inside
//! brackets belongs to the value. Values are kept as texts, as they were requested.

use thiserror::Error;
use wfl_adapt::knobs::number;

/// A knob with the values to try.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Knob {
    pub(super) name: String,
    pub(super) values: Vec<String>,
}

/// A list that cannot be read.
#[derive(Debug, Error, PartialEq, Eq)]
pub(super) enum ListError {
    #[error("`{0}` is not KNOB=VALUES\n  = help: h=0.5,0.25 or gamma=1e4..1e6:log3")]
    NoList(String),
    #[error("knob `{0}` has no values\n  = help: write them behind `=`, with commas between")]
    Empty(String),
    #[error("`{0}` is no range\n  = help: FROM..TO:log5 or FROM..TO:lin5 gives five values with both ends")]
    Range(String),
    #[error("`{0}`: a range at equal ratios needs two ends of the same sign, none of them 0\n  = help: use :lin")]
    LogEnds(String),
    #[error("knob `{0}` is given twice")]
    Twice(String),
}

/// Most values of one range.
const MOST: usize = 10_000;

/// Reads `NAME=VALUES`.
pub(super) fn knob(word: &str) -> Result<Knob, ListError> {
    let (name, list) = word.split_once('=').ok_or_else(|| ListError::NoList(word.to_owned()))?;
    let mut values = Vec::new();
    for part in split(list) {
        match part.split_once("..") {
            Some((from, rest)) => values.extend(range(part, from, rest)?),
            None if part.is_empty() => return Err(ListError::Empty(name.to_owned())),
            None => values.push(part.to_owned()),
        }
    }
    let mut unique: Vec<String> = Vec::new();
    for value in values {
        if !unique.contains(&value) {
            unique.push(value);
        }
    }
    Ok(Knob { name: name.trim().to_owned(), values: unique })
}

/// Reads all knobs of a command line.
pub(super) fn knobs(words: &[String]) -> Result<Vec<Knob>, ListError> {
    let mut out: Vec<Knob> = Vec::new();
    for word in words {
        let read = knob(word)?;
        if out.iter().any(|k| k.name == read.name) {
            return Err(ListError::Twice(read.name));
        }
        out.push(read);
    }
    Ok(out)
}

/// Parts between commas that stand in no bracket.
fn split(list: &str) -> Vec<&str> {
    let (mut parts, mut depth, mut start) = (Vec::new(), 0usize, 0);
    for (at, c) in list.char_indices() {
        match c {
            '[' | '(' => depth += 1,
            ']' | ')' => depth = depth.saturating_sub(1),
            ',' if depth == 0 => {
                parts.push(list[start..at].trim());
                start = at + 1;
            }
            _ => {}
        }
    }
    parts.push(list[start..].trim());
    parts
}

fn range(whole: &str, from: &str, rest: &str) -> Result<Vec<String>, ListError> {
    let wrong = || ListError::Range(whole.to_owned());
    let (to, how) = rest.split_once(':').ok_or_else(wrong)?;
    let (log, count) = match (how.strip_prefix("log"), how.strip_prefix("lin")) {
        (Some(n), _) => (true, n),
        (_, Some(n)) => (false, n),
        _ => return Err(wrong()),
    };
    let n: usize = count.parse().map_err(|_| wrong())?;
    let (a, b) = (number(from).ok_or_else(wrong)?, number(to).ok_or_else(wrong)?);
    if !(2..=MOST).contains(&n) {
        return Err(wrong());
    }
    if log && a * b <= 0.0 {
        return Err(ListError::LogEnds(whole.to_owned()));
    }
    #[expect(clippy::cast_precision_loss, reason = "few values")]
    let part = |k: usize| k as f64 / (n - 1) as f64;
    let at = |k: usize| match k {
        0 => a,
        k if k == n - 1 => b,
        k if log => a * (b / a).powf(part(k)),
        k => a + (b - a) * part(k),
    };
    Ok((0..n).map(|k| text(at(k))).collect())
}

/// Twelve digits: a tenth stays 0.1 however it was computed.
fn text(x: f64) -> String {
    let rounded: f64 = format!("{x:.11e}").parse().unwrap_or(x);
    if rounded != 0.0 && !(1e-4..1e6).contains(&rounded.abs()) { format!("{rounded:e}") } else { format!("{rounded}") }
}

/// Every combination, the last knob changing fastest: `(name, value)` in the order of the knobs.
pub(super) fn combinations(knobs: &[Knob]) -> Vec<Vec<(String, String)>> {
    let mut out = vec![Vec::new()];
    for knob in knobs {
        let longer = |head: &Vec<(String, String)>| {
            knob.values
                .iter()
                .map(|v| {
                    let mut one = head.clone();
                    one.push((knob.name.clone(), v.clone()));
                    one
                })
                .collect::<Vec<_>>()
        };
        out = out.iter().flat_map(longer).collect();
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_and_ranges_give_the_values_written() {
        let values = |w: &str| knob(w).expect("a list").values;
        assert_eq!(values("h=0.5,0.25"), ["0.5", "0.25"]);
        assert_eq!(values("gamma=1e4..1e6:log3"), ["10000", "100000", "1e6"]);
        assert_eq!(values("tol=1e-2..1e-8:log4"), ["0.01", "0.0001", "1e-6", "1e-8"]);
        assert_eq!(values("nu=0..0.3:lin4"), ["0", "0.1", "0.2", "0.3"]);
        assert_eq!(values("a=[1,2],[3,4]"), ["[1,2]", "[3,4]"]);
        assert_eq!(values("a=1,1,2"), ["1", "2"]);
        assert_eq!(number("1/4"), Some(0.25));
    }

    #[test]
    fn what_is_no_list_is_refused() {
        assert_eq!(knob("gamma"), Err(ListError::NoList("gamma".to_owned())));
        assert_eq!(knob("gamma="), Err(ListError::Empty("gamma".to_owned())));
        assert!(matches!(knob("gamma=1..2"), Err(ListError::Range(_))));
        assert!(matches!(knob("gamma=1..2:log1"), Err(ListError::Range(_))));
        assert!(matches!(knob("gamma=-1..2:log3"), Err(ListError::LogEnds(_))));
        assert!(matches!(knobs(&["a=1".to_owned(), "a=2".to_owned()]), Err(ListError::Twice(_))));
    }

    #[test]
    fn every_combination_occurs_once() {
        let list = combinations(&[knob("a=1,2").expect("a list"), knob("b=x,y,z").expect("a list")]);
        assert_eq!(list.len(), 6);
        assert_eq!(list[1], [("a".to_owned(), "1".to_owned()), ("b".to_owned(), "y".to_owned())]);
    }
}
