//! Deformations that a quadrature rule of a scene does not see: the rank of the tangent of one cell.
//!
//! With too few points some deformations of a cell (hourglasses) have no strain at any of them, and so no stiffness. The
//! tangent of all terms on a cell then has more zero singular values than under a finer rule, where the rigid motions (or
//! constants) of the form are left. One cell of each kind is looked at, at the state without displacement.

use nalgebra::DMatrix;
use wfl_compiler::{Class, types::FieldKind};
use wfl_discrete::{
    assemble::{AssembledTerm, FieldValues},
    system::System,
};
use wfl_mesh::mesh::{CellId, CellKind, RegionSet};

use crate::singular::with_rule_and_states;

/// A singular value below this part of the largest is zero: rounding is 1e-15, the softest mode of a cell of aspect
/// ratio 100 about 1e-4.
const ZERO: f64 = 1e-9;

/// A rule under which cells have deformations without stiffness.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hourglass {
    /// The kind of the cells.
    pub kind: CellKind,
    /// The terms with that rule, by name.
    pub terms: Vec<String>,
    /// Points of the rule.
    pub n_points: usize,
    /// Motions without stiffness that a finer rule resists.
    pub modes: usize,
    /// The least degree with none of them.
    pub degree: usize,
}

/// The kinds of cells on which the terms at these positions leave deformations without stiffness because of their rule.
#[must_use]
pub fn hourglasses(system: &System, given: &[usize]) -> Vec<Hourglass> {
    let kinds = CellKind::ALL.into_iter().filter(|kind| kind.dim() == system.mesh.dim());
    kinds.filter_map(|kind| on_kind(system, given, kind)).collect()
}

fn on_kind(system: &System, given: &[usize], kind: CellKind) -> Option<Hourglass> {
    let stiff = |t: &AssembledTerm| t.on_cells() && t.law.class > Class::Constant;
    let ruled = |k: usize| given.contains(&k) && stiff(&system.terms[k]);
    let first = |t: &AssembledTerm| {
        t.integrator
            .domain
            .groups
            .iter()
            .find(|g| g.here.kind == kind)
            .and_then(|g| Some((*g.here.cells.first()?, g.n_points())))
    };
    let (cell, n_points) = (0..system.terms.len()).filter(|k| ruled(*k)).find_map(|k| first(&system.terms[k]))?;
    let zero = vec![0.0; system.numbering.n_dofs];
    let values = system.values(&zero);
    // under its own rule, or with another one for those that are given
    let rank = |degree: Option<usize>| -> Option<usize> {
        let mut sum = Sum::default();
        for (k, term) in system.terms.iter().enumerate().filter(|(_, t)| stiff(t)) {
            match degree.filter(|_| ruled(k)) {
                Some(degree) if acts(term, cell) => {
                    let finer = with_rule_and_states(system, term, &RegionSet::Cells(vec![cell]), degree)?;
                    let (mut current, mut previous) = (values.view().current.to_vec(), values.view().previous.to_vec());
                    for (state, values) in &finer.states {
                        current[*state] = values;
                        previous.get_mut(*state).into_iter().for_each(|slot| *slot = values);
                    }
                    let values = FieldValues { current: &current, previous: &previous, ..values.view() };
                    sum.add(system, &finer.term, values, cell);
                }
                _ => sum.add(system, term, values.view(), cell),
            }
        }
        sum.rank()
    };
    let unknown = system.fields.iter().filter(|f| f.kind == FieldKind::Unknown);
    let most = 2 * unknown.map(|f| f.degree()).max()? + 2;
    let (own, full) = (rank(None)?, rank(Some(most))?);
    if own >= full {
        return None;
    }
    let degree = (0..most).find(|degree| rank(Some(*degree)).is_some_and(|r| r >= full)).unwrap_or(most);
    let named = |k: &usize| ruled(*k) && acts(&system.terms[*k], cell);
    let terms = (0..system.terms.len()).filter(named).map(|k| system.terms[k].law.name.clone()).collect();
    Some(Hourglass { kind, terms, n_points, modes: full - own, degree })
}

fn acts(term: &AssembledTerm, cell: CellId) -> bool {
    term.integrator.domain.groups.iter().any(|g| g.here.cells.contains(&cell))
}

/// The tangent of a cell, over the dofs of all its terms.
#[derive(Default)]
struct Sum {
    dofs: Vec<u32>,
    entries: Vec<(usize, usize, f64)>,
}

impl Sum {
    fn add(&mut self, system: &System, term: &AssembledTerm, values: FieldValues<'_>, cell: CellId) {
        let wanted = |side: &wfl_discrete::assemble::GroupSide, e: usize| side.cells[e] == cell;
        let Some((dofs, matrix)) = term.local_tangent(&system.mesh, values, wanted) else { return };
        let mut place = |dof: &u32| {
            self.dofs.iter().position(|d| d == dof).unwrap_or_else(|| {
                self.dofs.push(*dof);
                self.dofs.len() - 1
            })
        };
        let places: Vec<usize> = dofs.iter().map(&mut place).collect();
        let pairs = places.iter().flat_map(|i| places.iter().map(move |j| (*i, *j)));
        self.entries.extend(pairs.zip(matrix).map(|((i, j), x)| (i, j, x)));
    }

    /// Singular values above [`ZERO`] of the matrix with unit diagonal, so that fields in other units count alike;
    /// `None` if it is not finite.
    fn rank(&self) -> Option<usize> {
        let n = self.dofs.len();
        let mut matrix = DMatrix::<f64>::zeros(n, n);
        for (i, j, x) in &self.entries {
            matrix[(*i, *j)] += x;
        }
        if matrix.iter().any(|x| !x.is_finite()) {
            return None;
        }
        let sizes: Vec<f64> = (0..n).map(|k| matrix[(k, k)].abs().sqrt()).collect();
        let scale = |k: usize| if sizes[k] > 0.0 { 1.0 / sizes[k] } else { 1.0 };
        let scaled = DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] * scale(i) * scale(j));
        let values = scaled.singular_values();
        let largest = values.iter().fold(0.0f64, |m, x| m.max(*x));
        Some(values.iter().filter(|x| **x > ZERO * largest).count())
    }
}
