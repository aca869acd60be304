//! A field by its name, and a number of it at each point: a component, a magnitude, an invariant.
//!
//! Names: that of an array; or that of several which differ by what follows (`u` for `uL` and `uR`, `stress` for
//! `stress_left` and `stress_right`), each on bodies of its own. Tensors are symmetric where an invariant is taken of them.

use super::error::PlotError;
use crate::{
    folder::RunFolder,
    grid::{Values, Whole},
};

/// What was asked for: `stress:vonmises`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Wanted {
    pub(crate) name: String,
    pub(crate) part: Option<String>,
}

impl Wanted {
    pub(crate) fn read(text: &str) -> Self {
        let (name, part) = text.split_once(':').map_or((text, None), |(name, part)| (name, Some(part.to_owned())));
        Wanted { name: name.to_owned(), part }
    }
}

/// A number at each point, NaN where the field is not.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Numbers {
    /// What it is, without unit.
    pub(crate) label: String,
    /// The array whose unit it has.
    pub(crate) source: String,
    /// For a file name.
    pub(crate) file: String,
    /// What the reader must know, empty if nothing.
    pub(crate) note: &'static str,
    pub(crate) numbers: Vec<f64>,
}

/// From the entries at a point to a number.
type Part = Box<dyn Fn(&[f64]) -> f64>;

/// Components and parts of a vector and of a tensor, as they are asked for.
const VECTOR: [&str; 4] = ["magnitude", "x", "y", "z"];
const TENSOR: [&str; 15] =
    ["vonmises", "xx", "yy", "zz", "xy", "yz", "xz", "yx", "zy", "zx", "trace", "mean", "max", "min", "norm"];

/// The arrays of a name on the bodies, joined: width and entries, NaN where there is none.
pub(crate) fn joined(whole: &Whole, name: &str) -> Option<(Values, String)> {
    let exact = |v: &&Values| v.name == name;
    if let Some(found) = whole.point_data.iter().find(exact) {
        return Some((found.clone(), found.name.clone()));
    }
    let rest_fits = |v: &&Values| match v.name.strip_prefix(name) {
        Some(rest) => rest.starts_with('_') || (rest.len() == 1 && rest.chars().all(char::is_alphanumeric)),
        None => false,
    };
    let mut found = whole.point_data.iter().filter(rest_fits);
    let first = found.next().filter(|_| !name.is_empty())?;
    let mut all = Values { name: name.to_owned(), ..first.clone() };
    for next in found.filter(|v| v.width == first.width) {
        for (old, new) in all.numbers.chunks_exact_mut(first.width).zip(next.numbers.chunks_exact(first.width)) {
            if old.iter().any(|x| x.is_nan()) {
                old.copy_from_slice(new);
            }
        }
    }
    Some((all, first.name.clone()))
}

/// The displacement of the bodies: vector unknowns whose names begin with `u`, or an array `displacement`; with a unit
/// other than that of the coordinates they are something else. `None` if there is none.
pub(crate) fn displacement(run: &RunFolder, whole: &Whole) -> Option<Vec<[f64; 3]>> {
    let units = &run.report.about.units;
    let known = |name: &str| units.get(name).filter(|u| *u != "not known");
    let is_length = |name: &str| match (known(name), known("X")) {
        (Some(own), Some(length)) => own == length,
        _ => true,
    };
    let is_one = |v: &&Values| {
        let unknown = run.report.fields.get(&v.name).is_some() && v.name.starts_with('u');
        v.width == 3 && (unknown || v.name == "displacement") && is_length(&v.name)
    };
    let found: Vec<&Values> = whole.point_data.iter().filter(is_one).collect();
    if found.is_empty() {
        return None;
    }
    let at = |point: usize| {
        let entries = found.iter().map(|v| &v.numbers[3 * point..][..3]);
        entries.filter(|e| e.iter().all(|x| x.is_finite())).map(|e| [e[0], e[1], e[2]]).next()
    };
    Some((0..whole.points.len()).map(|point| at(point).unwrap_or([f64::NAN; 3])).collect())
}

/// What is shown if nothing is asked for: the displacement, or the first array of the bodies.
pub(crate) fn first_choice(run: &RunFolder, whole: &Whole) -> Option<Wanted> {
    let unknown = whole.point_data.iter().find(|v| run.report.fields.get(&v.name).is_some());
    let first = unknown.or_else(|| whole.point_data.first())?;
    let vector = first.width == 3 && first.name.starts_with('u');
    // one body of several is not the whole picture
    let name = if vector && joined(whole, "u").is_some() { "u" } else { &first.name };
    Some(Wanted { name: name.to_owned(), part: None })
}

/// The number that is asked for, at each point of the bodies; `None` if no body has such an array.
pub(crate) fn numbers(whole: &Whole, dim: usize, wanted: &Wanted) -> Result<Option<Numbers>, PlotError> {
    let Some((array, source)) = joined(whole, &wanted.name) else { return Ok(None) };
    let name = &wanted.name;
    let no_part = |part: &str, known: &[&str]| PlotError::NoPart {
        field: name.clone(),
        part: part.to_owned(),
        known: known.iter().map(|k| format!("{name}:{k}")).collect(),
    };
    let means = whole.of_cells.contains(&source);
    let note = if means { "means of the cells around each node" } else { "" };
    let (part, label, note, of): (&str, String, &'static str, Part) = match array.width {
        1 => match &wanted.part {
            None => ("", name.clone(), note, Box::new(|v| v[0])),
            Some(part) => return Err(PlotError::Unfit(format!("`{name}` is a number and has no part `{part}`"))),
        },
        3 => {
            let part = wanted.part.as_deref().unwrap_or("magnitude");
            match VECTOR.iter().position(|k| *k == part) {
                Some(0) => (part, format!("|{name}|"), note, Box::new(|v| v[0].hypot(v[1]).hypot(v[2]))),
                Some(k) => (part, format!("{name} {part}"), note, Box::new(move |v| v[k - 1])),
                None => return Err(no_part(part, &VECTOR)),
            }
        }
        9 => {
            let part = wanted.part.as_deref().unwrap_or("vonmises");
            let Some((words, of)) = tensor_part(part) else { return Err(no_part(part, &TENSOR)) };
            let plane = dim == 2 && array.numbers.chunks_exact(9).all(|t| t[8] == 0.0 || t[8].is_nan());
            let uses_zz = matches!(part, "vonmises" | "mean" | "max" | "min");
            let note = match (plane && uses_zz, means) {
                (true, false) => "its zz component taken as 0",
                (true, true) => "means of cells, its zz component taken as 0",
                (false, _) => note,
            };
            (part, format!("{name} {words}"), note, of)
        }
        other => {
            return Err(PlotError::Unfit(format!(
                "`{name}` has {other} numbers a point: neither a vector nor a tensor"
            )));
        }
    };
    let file = if part.is_empty() { name.clone() } else { format!("{name}_{part}") };
    let numbers = array.numbers.chunks_exact(array.width).map(of).collect();
    Ok(Some(Numbers { label, source, file, note, numbers }))
}

/// Words and formula of a part of a tensor with rows of three.
fn tensor_part(part: &str) -> Option<(String, Part)> {
    let index = |c: char| "xyz".find(c);
    let letters: Vec<Option<usize>> = part.chars().map(index).collect();
    if let [Some(i), Some(j)] = letters[..] {
        return Some((part.to_owned(), Box::new(move |t| t[3 * i + j])));
    }
    let (words, of): (&str, Part) = match part {
        "vonmises" => ("von Mises", Box::new(von_mises)),
        "trace" => ("trace", Box::new(|t| t[0] + t[4] + t[8])),
        "mean" => ("mean", Box::new(|t| (t[0] + t[4] + t[8]) / 3.0)),
        "max" => ("largest principal value", Box::new(|t| principal(t)[0])),
        "min" => ("smallest principal value", Box::new(|t| principal(t)[2])),
        "norm" => ("norm", Box::new(|t| t.iter().map(|x| x * x).sum::<f64>().sqrt())),
        _ => return None,
    };
    Some((words.to_owned(), of))
}

/// sqrt(3/2 dev(s) : dev(s)) of the symmetric part.
fn von_mises(t: &[f64]) -> f64 {
    let (xy, yz, xz) = (0.5 * (t[1] + t[3]), 0.5 * (t[5] + t[7]), 0.5 * (t[2] + t[6]));
    let normal = (t[0] - t[4]).powi(2) + (t[4] - t[8]).powi(2) + (t[8] - t[0]).powi(2);
    (0.5 * normal + 3.0 * (xy * xy + yz * yz + xz * xz)).sqrt()
}

/// Principal values of the symmetric part, the largest first (Smith, Eigenvalues of a symmetric 3 x 3 matrix, 1961).
fn principal(t: &[f64]) -> [f64; 3] {
    let (xy, yz, xz) = (0.5 * (t[1] + t[3]), 0.5 * (t[5] + t[7]), 0.5 * (t[2] + t[6]));
    let mean = (t[0] + t[4] + t[8]) / 3.0;
    let (a, b, c) = (t[0] - mean, t[4] - mean, t[8] - mean);
    let p = ((a * a + b * b + c * c + 2.0 * (xy * xy + yz * yz + xz * xz)) / 6.0).sqrt();
    if p.is_nan() || p == 0.0 {
        return [mean; 3];
    }
    let determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz);
    let angle = (determinant / (2.0 * p * p * p)).clamp(-1.0, 1.0).acos() / 3.0;
    let value = |k: f64| mean + 2.0 * p * (angle + k * std::f64::consts::TAU / 3.0).cos();
    [value(0.0), value(2.0), value(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariants_of_known_tensors() {
        let uniaxial = [0.0, 0.0, 0.0, 0.0, -7.0, 0.0, 0.0, 0.0, 0.0];
        assert!((von_mises(&uniaxial) - 7.0).abs() < 1e-12);
        // pure shear of 2: von Mises 2 sqrt(3), principal values 2, 0, -2
        let shear = [0.0, 2.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert!((von_mises(&shear) - 2.0 * 3f64.sqrt()).abs() < 1e-12);
        let found = principal(&shear);
        for (value, expected) in found.iter().zip([2.0, 0.0, -2.0]) {
            assert!((value - expected).abs() < 1e-12, "{found:?}");
        }
        assert_eq!(principal(&[3.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 3.0]), [3.0; 3]);
    }

    fn two_bodies() -> Whole {
        let nan = f64::NAN;
        let left = Values { name: "uL".into(), width: 3, numbers: vec![3.0, 4.0, 0.0, nan, nan, nan] };
        let right = Values { name: "uR".into(), width: 3, numbers: vec![nan, nan, nan, 0.0, -2.0, 0.0] };
        Whole { points: vec![[0.0; 3]; 2], point_data: vec![left, right], ..Whole::default() }
    }

    #[test]
    fn a_field_of_two_bodies_has_one_name() {
        let whole = two_bodies();
        let of = |text: &str| numbers(&whole, 2, &Wanted::read(text)).map(|n| n.map(|n| (n.label, n.numbers)));
        assert_eq!(of("u").unwrap(), Some(("|u|".to_owned(), vec![5.0, 2.0])));
        assert_eq!(of("u:y").unwrap(), Some(("u y".to_owned(), vec![4.0, -2.0])));
        let (label, left) = of("uL:x").unwrap().unwrap();
        assert!(label == "uL x" && left[0] == 3.0 && left[1].is_nan());
        assert_eq!(of("v").unwrap(), None);
        let error = of("u:xx").unwrap_err();
        assert_eq!(error.help(), "there is u:magnitude, u:x, u:y, u:z");
    }
}
