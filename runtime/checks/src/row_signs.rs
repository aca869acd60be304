//! The sign with which each equation of a scene is written.
//!
//! An equation times -1 has the same solutions, but the determinant of the tangent changes its sign with each row of it, and so
//! do eigenvalues. What a scene says of its equations at the start of a run, where its bodies are at rest and stable, tells the
//! sign: an unknown with a stiffness of its own resists what moves it, so that its diagonal is positive in a row of the right sign.
//! A row without one (a multiplier, a pressure of a body that cannot be compressed) has the right sign where its coupling with
//! what has a stiffness is skew, as in `[A B; -B' C]`: the determinant of that is positive where A is positive definite on all
//! that B' leaves, and C is not negative.
//!
//! Promises: the same answer for equations times -1; groups of rows of which nothing is known are told as such.

use wfl_compiler::types::FieldKind;
use wfl_discrete::{
    field::FieldSpace,
    system::{Branches, System},
};
use wfl_mesh::element::Family;
use wfl_sparse::csr::Csr;

/// A diagonal that is rounding, in parts of what its couplings would give it were the stiffness beside them eliminated: summands
/// that cancel leave 1e-16 of themselves, and may be a million times what is beside them.
const NOTHING: f64 = 1e-9;
/// The part of the size of all entries that their sum must be for its sign to count: between one (all of one sign) and none.
const DECIDED: f64 = 0.5;

/// The free rows of a system by field and component: those that are written with one sign.
pub(crate) struct Groups {
    /// By row its group.
    pub(crate) of_row: Vec<u32>,
    /// By group its field.
    pub(crate) field: Vec<usize>,
    /// By group its rows.
    pub(crate) count: Vec<usize>,
}

/// By group whether its equations are written with the other sign; `None` where that is not known.
pub(crate) type Signs = Vec<Option<bool>>;

/// What the start of a run says of the signs of its equations, found when it is first asked for.
#[derive(Clone, Debug, Default)]
pub struct RowSigns {
    found: Option<Signs>,
}

impl RowSigns {
    /// The signs at the start of the run: `start` makes the equations of the first step and the first values. None is known
    /// where those cannot be evaluated.
    pub(crate) fn at(&mut self, groups: &Groups, start: &dyn Fn() -> Option<(System, Vec<f64>)>) -> &Signs {
        self.found.get_or_insert_with(|| {
            let none = vec![None; groups.count.len()];
            let matrix = start().and_then(|(system, u)| {
                let mut tangent = system.new_tangent();
                system.tangent(&u, Branches::AsWritten, &mut tangent).ok()?;
                system.whole_matrix(&tangent).ok().filter(|matrix| matrix.n_rows() == groups.of_row.len())
            });
            matrix.map_or_else(|| none.clone(), |matrix| signs(&matrix, groups, &none))
        })
    }
}

impl Groups {
    pub(crate) fn of(system: &System) -> Self {
        let firsts: Vec<usize> = system
            .fields
            .iter()
            .scan(0, |next, field| Some(std::mem::replace(next, *next + field.n_components)))
            .collect();
        let field =
            system.fields.iter().enumerate().flat_map(|(k, f)| std::iter::repeat_n(k, f.n_components)).collect();
        let group = |dof: &u32| {
            let (field, _, component) = system.numbering.describe(&system.fields, *dof as usize);
            u32::try_from(firsts[field] + component).expect("few fields")
        };
        let of_row: Vec<u32> = system.numbering.free_dofs.iter().map(group).collect();
        let mut this = Self { of_row, field, count: Vec::new() };
        this.count = vec![0; this.field.len()];
        this.of_row.iter().for_each(|group| this.count[*group as usize] += 1);
        this
    }

    /// Whether the determinant of equations with these signs is negative where that of equations of the right signs is
    /// positive; `None` where a sign is not known.
    pub(crate) fn parity(&self, signs: &[Option<bool>]) -> Option<bool> {
        let rows = self.count.iter().zip(signs).filter(|(count, _)| **count > 0);
        let turned = rows.map(|(count, sign)| sign.map(|turned| if turned { *count } else { 0 }));
        turned.sum::<Option<usize>>().map(|turned| turned % 2 == 1)
    }

    /// Groups that couplings join, as lists.
    fn components(&self, matrix: &Csr) -> Vec<Vec<usize>> {
        let n = self.count.len();
        let mut name: Vec<usize> = (0..n).collect();
        for row in 0..matrix.n_rows() {
            let (columns, values) = matrix.row(row);
            for (column, _) in columns.iter().zip(values).filter(|(_, value)| **value != 0.0) {
                let [a, b] = [row, *column as usize].map(|place| name[self.of_row[place] as usize]);
                if a != b {
                    name.iter_mut().filter(|name| **name == b).for_each(|name| *name = a);
                }
            }
        }
        let used = |group: &usize| self.count[*group] > 0;
        let of = |wanted| (0..n).filter(used).filter(|group| name[*group] == wanted).collect::<Vec<_>>();
        (0..n).map(of).filter(|groups| !groups.is_empty()).collect()
    }

    /// By row the sign that makes the stiffness of bodies positive in equations that are symmetric: of groups that are coupled
    /// all or none are turned. A displacement tells for the pressures beside it; forces alone have a negative diagonal.
    pub(crate) fn turned(&self, system: &System, matrix: &Csr, signs: &[Option<bool>]) -> Vec<f64> {
        let is_force = |group: &usize| system.fields[self.field[*group]].kind == FieldKind::Multiplier;
        let mut by_group = vec![1.0; self.count.len()];
        for groups in self.components(matrix) {
            let rank = |group: &usize| {
                let field = &system.fields[self.field[*group]];
                let is_whole = matches!(&field.space, FieldSpace::Nodal(space) if space.family() == Family::Continuous);
                (!is_force(group), field.n_components, is_whole, self.count[*group], std::cmp::Reverse(*group))
            };
            let Some(first) = groups.iter().copied().filter(|g| signs[*g].is_some()).max_by_key(rank) else { continue };
            if signs[first] != Some(is_force(&first)) {
                groups.iter().for_each(|group| by_group[*group] = -1.0);
            }
        }
        self.of_row.iter().map(|group| by_group[*group as usize]).collect()
    }
}

/// The signs of the groups of a matrix: those that are known, and what the matrix says of the others.
pub(crate) fn signs(matrix: &Csr, groups: &Groups, known: &[Option<bool>]) -> Signs {
    let votes = Votes::of(matrix, groups);
    let mut signs = votes.own_signs(groups, known);
    for _ in 0..groups.count.len() {
        let next: Signs = (0..signs.len()).map(|group| signs[group].or_else(|| votes.beside(group, &signs))).collect();
        signs = next;
    }
    signs
}

/// A sum and the sum of magnitudes.
#[derive(Clone, Copy, Default)]
struct Vote {
    sum: f64,
    size: f64,
}

impl Vote {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.size += value.abs();
    }
}

/// What a matrix says of the signs of its rows.
struct Votes {
    /// By group the diagonal.
    own: Vec<Vote>,
    /// By pair of groups products of entries across the diagonal.
    pairs: Vec<Vote>,
    /// By pair of groups what the second, eliminated, would add to the diagonal of the first.
    eliminated: Vec<f64>,
}

impl Votes {
    fn of(matrix: &Csr, groups: &Groups) -> Self {
        let n = groups.count.len();
        let mut this =
            Self { own: vec![Vote::default(); n], pairs: vec![Vote::default(); n * n], eliminated: vec![0.0; n * n] };
        let diagonal: Vec<f64> = (0..matrix.n_rows()).map(|row| matrix.get(row, row)).collect();
        for row in 0..matrix.n_rows() {
            let here = groups.of_row[row] as usize;
            this.own[here].add(diagonal[row]);
            let (columns, values) = matrix.row(row);
            for (column, value) in columns.iter().zip(values) {
                let column = *column as usize;
                let there = groups.of_row[column] as usize;
                if there == here || *value == 0.0 {
                    continue;
                }
                let product = value * matrix.get(column, row);
                this.pairs[here * n + there].add(product);
                if diagonal[column] != 0.0 {
                    this.eliminated[here * n + there] += (product / diagonal[column]).abs();
                }
            }
        }
        this
    }

    /// The signs that are known, and what diagonals say of the others. Of two groups that are coupled far more than they are
    /// stiff, such as displacements and the pressures of a body that is all but incompressible, the one with more rows counts: what
    /// can be solved has no more pressures than displacements.
    fn own_signs(&self, groups: &Groups, known: &[Option<bool>]) -> Signs {
        let n = known.len();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by_key(|group| std::cmp::Reverse(groups.count[*group]));
        let (mut signs, mut stiff) = (known.to_vec(), Vec::new());
        for group in order {
            let Vote { sum, size } = self.own[group];
            let eliminated: f64 = stiff.iter().map(|other| self.eliminated[group * n + other]).sum();
            if size > NOTHING * eliminated && sum.abs() > DECIDED * size {
                signs[group] = signs[group].or(Some(sum < 0.0));
                stiff.push(group);
            }
        }
        signs
    }

    /// What couplings with groups of known signs say: they are skew.
    fn beside(&self, group: usize, signs: &[Option<bool>]) -> Option<bool> {
        let pairs = self.pairs[group * signs.len()..].iter().zip(signs);
        let known = pairs.filter_map(|(pair, sign)| Some((*pair, (*sign)?))).filter(|(pair, _)| pair.size > 0.0);
        let mut all = Vote::default();
        for (Vote { sum, size }, turned) in known {
            all.sum += if turned { sum / size } else { -sum / size };
            all.size += 1.0;
        }
        (all.sum.abs() > DECIDED * all.size).then_some(all.sum < 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of two displacements, two pressures and a multiplier, with the signs `s` of the three equations.
    fn tangent(compliance: f64, s: [f64; 3]) -> (Csr, Groups) {
        let entries = [
            (0, 0, 4.0),
            (1, 1, 5.0),
            (0, 1, -1.0),
            (1, 0, -1.0),
            (0, 2, 2.0),
            (2, 0, 1.9),
            (1, 3, 3.0),
            (3, 1, 2.8),
            (2, 2, -compliance),
            (3, 3, -compliance),
            (1, 4, -1.0),
            (4, 1, 1.1),
        ];
        let of_row = vec![0, 0, 1, 1, 2];
        let entries = entries.map(|(i, j, value)| (i, j, s[of_row[i as usize] as usize] * value));
        let groups = Groups { of_row, field: vec![0, 1, 2], count: vec![2, 2, 1] };
        (Csr::from_triplets(5, 5, &entries).unwrap(), groups)
    }

    #[test]
    fn signs_of_rows_follow_the_signs_of_equations() {
        for compliance in [0.0, 1e-12, 0.1] {
            for k in 0..8 {
                let s = [1, 2, 4].map(|bit| if k & bit == 0 { 1.0 } else { -1.0 });
                let (matrix, groups) = tangent(compliance, s);
                // as written above pressures act as forces whose row is that of an energy, the multiplier's is skew
                let right = [s[0] < 0.0, s[1] > 0.0, s[2] < 0.0].map(Some).to_vec();
                assert_eq!(signs(&matrix, &groups, &[None; 3]), right, "{compliance}, {s:?}");
                assert_eq!(groups.parity(&right), Some(s[2] < 0.0));
            }
        }
    }

    #[test]
    fn what_is_known_of_the_start_counts_and_what_has_no_sign_is_not_known() {
        let groups = Groups { of_row: vec![0, 0, 1], field: vec![0, 1], count: vec![2, 1] };
        let matrix = Csr::from_triplets(3, 3, &[(0, 0, -1.0), (1, 1, -2.0), (2, 2, 0.0)]).unwrap();
        assert_eq!(signs(&matrix, &groups, &[None, None]), [Some(true), None]);
        assert_eq!(signs(&matrix, &groups, &[Some(false), None]), [Some(false), None]);
        assert_eq!(groups.parity(&[Some(false), None]), None);
        let mixed = Csr::from_triplets(3, 3, &[(0, 0, -1.0), (1, 1, 2.0), (2, 2, 1.0)]).unwrap();
        assert_eq!(signs(&mixed, &groups, &[None, None]), [None, Some(false)]);
    }
}
