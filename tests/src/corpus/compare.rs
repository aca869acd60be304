//! Assembled numbers beside those of a case.

use wfl_sparse::csr::Csr;

use super::{Verdict, format::Case, setup::Setup};

/// What was assembled.
pub(super) struct Numbers {
    /// Of a potential.
    pub(super) scalar: Option<f64>,
    pub(super) residual: Vec<f64>,
    pub(super) tangent: Csr,
    /// Where the unknowns of each field start.
    pub(super) starts: Vec<Option<usize>>,
}

/// The largest difference of one list, where it is, and the scale of the list.
#[derive(Clone, Debug)]
struct Difference {
    what: &'static str,
    /// As a part of the tolerance; infinite when something is not a number.
    part: f64,
    place: String,
    ours: f64,
    theirs: f64,
}

/// All lists of a case compared.
pub(super) struct Comparison {
    lists: Vec<Difference>,
}

impl Comparison {
    fn list(&self, what: &str) -> bool {
        self.lists.iter().filter(|d| d.what == what).all(|d| d.part <= 1.0)
    }

    pub(super) fn tangent_agrees(&self) -> bool {
        self.list(TANGENT)
    }

    pub(super) fn values_agree(&self) -> bool {
        self.list(SCALAR) && self.list(RESIDUAL)
    }

    pub(super) fn agrees(&self) -> bool {
        self.tangent_agrees() && self.values_agree()
    }

    pub(super) fn worst(&self) -> f64 {
        self.lists.iter().fold(0.0, |m, d| m.max(d.part))
    }

    pub(super) fn verdict(&self) -> Verdict {
        match self.lists.iter().find(|d| d.part > 1.0) {
            None => Verdict::Agrees { worst: self.worst() },
            Some(d) => Verdict::Fails {
                why: format!(
                    "{} {}: {:e}, GetFEM {:e} ({:.1e} times the tolerance)",
                    d.what, d.place, d.ours, d.theirs, d.part
                ),
            },
        }
    }
}

/// Sums that cancel leave rounding errors of this part of what was summed (weights times numbers of order one): two
/// programs that add in different orders cannot agree better.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

const SCALAR: &str = "scalar";
const RESIDUAL: &str = "residual";
const TANGENT: &str = "tangent";

/// Compares; `Err` when the case and the assembled numbers do not fit together at all.
pub(super) fn compare(setup: &Setup, case: &Case, numbers: &Numbers) -> Result<Comparison, String> {
    let rtol = case.rtol.ok_or("no tolerance")?;
    let dofs = case.dofs.iter().map(|dof| position(setup, numbers, dof)).collect::<Result<Vec<usize>, String>>()?;
    if dofs.len() != numbers.residual.len() {
        return Err(format!("{} dofs, GetFEM has {}", numbers.residual.len(), dofs.len()));
    }
    let name = |k: usize| {
        format!("of {}{:?} component {}", case.dofs[k].0, case.dofs[k].1.as_deref().unwrap_or(&[]), case.dofs[k].2 + 1)
    };
    let mut lists = Vec::new();
    let triplets = case.tangent.as_deref().ok_or("no tangent")?;
    let mut theirs = vec![0.0; dofs.len() * dofs.len()];
    for (row, column, value) in triplets {
        *theirs.get_mut(row * dofs.len() + column).ok_or("a tangent entry outside the list of dofs")? += value;
    }
    let size = largest(&theirs);
    // where the other program has nothing but zeros, the size of a residual is that of tangent times state
    let state = setup.values.iter().flatten().fold(0.0f64, |m, v| m.max(v.abs()));
    let fallback = size * if state > 0.0 { state } else { 1.0 };
    let noise = ROUNDING * setup.measure() * (1.0 + state);
    if let Some(scalar) = case.scalar {
        let ours = numbers.scalar.ok_or("no potential, but a scalar to compare with")?;
        lists.push(difference(SCALAR, &[scalar], |_| ours, |_| String::new(), [rtol, fallback, noise]));
    }
    if let Some(residual) = &case.residual {
        if residual.len() != dofs.len() {
            return Err("the residual is not as long as the list of dofs".to_owned());
        }
        lists.push(difference(RESIDUAL, residual, |k| numbers.residual[dofs[k]], name, [rtol, fallback, noise]));
    }
    let ours = |k: usize| numbers.tangent.get(dofs[k / dofs.len()], dofs[k % dofs.len()]);
    let pair = |k: usize| format!("{} by {}", name(k / dofs.len()), name(k % dofs.len()).trim_start_matches("of "));
    lists.push(difference(TANGENT, &theirs, ours, pair, [rtol, size, noise]));
    Ok(Comparison { lists })
}

fn position(setup: &Setup, numbers: &Numbers, dof: &(String, Option<Vec<f64>>, usize)) -> Result<usize, String> {
    let (name, at, component) = dof;
    let field = setup.fields.iter().position(|f| f.name == *name).ok_or_else(|| format!("no field `{name}`"))?;
    let start = numbers.starts[field].ok_or_else(|| format!("`{name}` is no unknown"))?;
    let n = setup.fields[field].n_components;
    let node = setup.node_at(field, at.as_deref()).ok_or_else(|| format!("no node of `{name}` at {at:?}"))?;
    // the components of a global unknown are listed as one node
    if *component < n { Ok(start + node * n + component) } else { Err(format!("`{name}` has {n} components")) }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0f64, |m, v| m.max(v.abs()))
}

fn difference(
    what: &'static str,
    theirs: &[f64],
    ours: impl Fn(usize) -> f64,
    place: impl Fn(usize) -> String,
    [rtol, fallback, noise]: [f64; 3],
) -> Difference {
    let size = largest(theirs);
    let allowed = (rtol * if size > 0.0 { size } else { fallback }).max(noise);
    let part = |k: usize| {
        let d = (ours(k) - theirs[k]).abs();
        if d == 0.0 {
            0.0
        } else if d.is_nan() {
            f64::INFINITY
        } else {
            d / allowed
        }
    };
    let worst = (0..theirs.len()).max_by(|a, b| part(*a).total_cmp(&part(*b)));
    match worst {
        Some(k) => Difference { what, part: part(k), place: place(k), ours: ours(k), theirs: theirs[k] },
        None => Difference { what, part: 0.0, place: String::new(), ours: 0.0, theirs: 0.0 },
    }
}
