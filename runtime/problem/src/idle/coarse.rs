//! Multipliers of lower degree than what they act on: at a node where the jump is prescribed the jumps beside it, between
//! the nodes of the multiplier, may still determine it. Linear multipliers of quadratic displacements do so wherever two
//! faces meet: dropped at the ends of a surface they would leave jumps free beside it.
//!
//! A row is determined if it does not follow from those of other multipliers. The rows that share a displacement with it
//! show that on most surfaces, those around these in the corners of triangles; what is left is decided together over all
//! rows that are connected with it, if these are few (a narrow surface, one face wide).
//!
//! Promises: what is called determined is so in the whole system; the work grows with the nodes in question, not with the
//! surface, but where all rows are looked at.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::DMatrix;
use wfl_compiler::types::FieldKind;
use wfl_discrete::{
    field::FieldSpace,
    system::{FIXED, System},
};
use wfl_sparse::csr::Csr;

use super::{
    Candidate,
    directions::Node,
    vectors::{axis, null_space},
};

/// A row depends on others if the square of what it has beyond them is below this part of its own: with a hundredth of its
/// size a multiplier would be a hundred times as large as the tractions that it balances.
const DEPENDENT: f64 = 1e-4;
/// A coupling below this part of the largest one between two fields is what rounding leaves of summands that cancel.
const CANCELLED: f64 = 1e-12;
/// Rings of rows around one that are looked at first.
const RINGS: usize = 2;
/// Rows that are compared all with each other: the work grows with their cube, a tenth of a second for so many.
const MOST_ROWS: usize = 600;

/// A row: by displacement its coupling.
type Row = BTreeMap<usize, f64>;
/// A sum of rows: multipliers and their factors.
type Sum = Vec<(usize, f64)>;

/// What multipliers act on in one tangent, in their equations or by their forces: free displacements, along the axes of
/// frames, in units of the largest coupling with their field.
struct Reading {
    rows: BTreeMap<usize, Row>,
    /// By displacement the multipliers that have it.
    readers: BTreeMap<usize, Vec<usize>>,
}

impl Reading {
    /// The rows of all multipliers in a matrix, whose rows and columns stand for these dofs.
    fn new(system: &System, matrix: &Csr, dofs: &[usize]) -> Self {
        let of_kind = |dof: usize, kind: FieldKind| system.fields[system.field_of(dof)].kind == kind;
        let mut found: Vec<(usize, usize, f64)> = Vec::new();
        for (place, row) in dofs.iter().enumerate().filter(|(_, row)| of_kind(**row, FieldKind::Multiplier)) {
            let (columns, values) = matrix.row(place);
            for (column, value) in columns.iter().zip(values) {
                let dof = dofs[*column as usize];
                if !of_kind(dof, FieldKind::Unknown) {
                    continue;
                }
                match system.numbering.frames.of(dof) {
                    Some(frame) => found.extend(
                        frame
                            .axes
                            .iter()
                            .zip(frame.first..)
                            .map(|(axis, d)| (*row, d, axis[dof - frame.first] * value)),
                    ),
                    None => found.push((*row, dof, *value)),
                }
            }
        }
        found.retain(|(_, dof, _)| system.numbering.free[*dof] != FIXED);
        let fields = |row: usize, dof: usize| (system.field_of(row), system.field_of(dof));
        let mut largest: BTreeMap<(usize, usize), f64> = BTreeMap::new();
        for (row, dof, value) in &found {
            let of = largest.entry(fields(*row, *dof)).or_default();
            *of = of.max(value.abs());
        }
        let mut this = Self { rows: BTreeMap::new(), readers: BTreeMap::new() };
        for (row, dof, value) in found {
            let size = largest[&fields(row, dof)];
            if value.abs() > CANCELLED * size {
                *this.rows.entry(row).or_default().entry(dof).or_insert(0.0) += value / size;
            }
        }
        for (row, entries) in &this.rows {
            entries.keys().for_each(|dof| this.readers.entry(*dof).or_default().push(*row));
        }
        this
    }

    /// The value of a sum of rows, over the displacements that no row but these reads.
    fn value(&self, sum: &Sum, within: &BTreeSet<usize>) -> Row {
        let mut value = Row::new();
        for (dof, entry, factor) in sum
            .iter()
            .flat_map(|(row, factor)| self.rows.get(row).into_iter().flatten().map(move |(d, x)| (d, x, factor)))
        {
            *value.entry(*dof).or_insert(0.0) += factor * entry;
        }
        value.retain(|dof, _| self.readers[dof].iter().all(|row| within.contains(row)));
        value
    }

    /// These rows and those that share a displacement with one of them.
    fn ring(&self, rows: &BTreeSet<usize>) -> BTreeSet<usize> {
        let read = rows.iter().filter_map(|row| self.rows.get(row)).flat_map(BTreeMap::keys);
        let beside = read.flat_map(|dof| &self.readers[dof]).copied();
        beside.chain(rows.iter().copied()).collect()
    }

    /// All rows that are connected with some; `None` if they are too many.
    fn connected(&self, mut rows: BTreeSet<usize>) -> Option<BTreeSet<usize>> {
        loop {
            let more = self.ring(&rows);
            if more.len() > MOST_ROWS {
                return None;
            }
            if more.len() == rows.len() {
                return Some(rows);
            }
            rows = more;
        }
    }

    /// Whether a sum of rows has a part that others do not have, of those within some rows; `None` if it is nothing.
    fn has_part_of_its_own(&self, asked: &Asked<'_>, within: &BTreeSet<usize>) -> Option<bool> {
        let others = within.iter().filter_map(|row| (asked.of)(*row)).chain(asked.beside.iter().cloned());
        let mut all: Vec<Row> = others.map(|sum| self.value(&sum, within)).collect();
        all.push(self.value(&asked.own, within));
        Products::new(&all).in_order(all.len()).pop().flatten()
    }

    /// The same in the rings around it, and in all that is connected with it.
    fn determines(&self, asked: &Asked<'_>) -> Option<bool> {
        let mut within: BTreeSet<usize> = asked.own.iter().map(|(row, _)| *row).collect();
        let mut found = None;
        for _ in 0..RINGS {
            within = self.ring(&within);
            found = self.has_part_of_its_own(asked, &within);
            if found != Some(false) {
                return found;
            }
        }
        let all = if asked.far { self.connected(within) } else { None };
        all.map_or(found, |all| self.has_part_of_its_own(asked, &all))
    }
}

/// What is asked of the rows.
struct Asked<'a> {
    /// Whether this one follows from the others.
    own: Sum,
    /// Others at its node.
    beside: Vec<Sum>,
    /// What the row of a multiplier stands for, if that is another one.
    of: &'a dyn Fn(usize) -> Option<Sum>,
    /// Whether rows beyond the rings count.
    far: bool,
}

/// The products of some rows with each other, which elimination leaves of what rows before do not have.
struct Products {
    left: DMatrix<f64>,
    /// The squares of the rows.
    sizes: Vec<f64>,
}

impl Products {
    fn new(rows: &[Row]) -> Self {
        let mut columns: BTreeMap<usize, usize> = BTreeMap::new();
        for dof in rows.iter().flat_map(BTreeMap::keys) {
            let next = columns.len();
            columns.entry(*dof).or_insert(next);
        }
        let mut values = DMatrix::zeros(rows.len(), columns.len());
        for (k, row) in rows.iter().enumerate() {
            row.iter().for_each(|(dof, value)| values[(k, columns[dof])] = *value);
        }
        let left = &values * values.transpose();
        let sizes = left.diagonal().iter().copied().collect();
        Self { left, sizes }
    }

    /// The part of its own of a row, as a square of its size; `None` if the row is nothing.
    fn own(&self, row: usize) -> Option<f64> {
        (self.sizes[row] > 0.0).then(|| self.left[(row, row)] / self.sizes[row])
    }

    /// Takes what a row has out of those from one on.
    fn eliminate(&mut self, row: usize, from: usize) {
        let column = self.left.column(row).clone_owned();
        let n = self.sizes.len();
        for j in (from..n).filter(|j| column[*j] != 0.0) {
            let factor = column[j] / column[row];
            for i in from..n {
                self.left[(i, j)] -= factor * column[i];
            }
        }
    }

    /// Whether one row after the other, up to one, has a part that those before do not have; `None` of what is nothing. Rows
    /// that depend on earlier ones are passed over.
    fn in_order(&mut self, end: usize) -> Vec<Option<bool>> {
        let mut found = Vec::with_capacity(end);
        for row in 0..end {
            let is_own = self.own(row).map(|own| own > DEPENDENT);
            if is_own == Some(true) {
                self.eliminate(row, row + 1);
            }
            found.push(is_own);
        }
        found
    }

    /// Which of the rows from one on are kept, so that each has a part that neither those before nor the others have:
    /// `None` of what is nothing. In an order of their own, what has the largest part first: rows of a narrow surface that
    /// follow one another determine each other less and less from one end to the other.
    fn kept(mut self, first: usize) -> Vec<Option<bool>> {
        self.in_order(first);
        let mut found: Vec<Option<bool>> = (first..self.sizes.len()).map(|row| self.own(row).map(|_| false)).collect();
        let before = self.left.clone();
        let mut kept: Vec<usize> = Vec::new();
        loop {
            let others = (first..self.sizes.len()).filter(|row| !kept.contains(row));
            // the first of those that differ by rounding
            let largest = others
                .filter_map(|row| Some((row, self.own(row)?)))
                .fold((0, DEPENDENT), |best, next| if next.1 > best.1 * (1.0 + 1e-9) { next } else { best });
            if largest.1 <= DEPENDENT {
                break;
            }
            self.eliminate(largest.0, first);
            kept.push(largest.0);
        }
        // 1 / diagonal of the inverse is what a row has beyond all others
        let products = DMatrix::from_fn(kept.len(), kept.len(), |i, j| before[(kept[i], kept[j])]);
        let Some(mut inverse) = products.cholesky().map(|factor| factor.inverse()) else { return found };
        let mut stay: Vec<usize> = (0..kept.len()).collect();
        let own = |inverse: &DMatrix<f64>, k: usize| 1.0 / (inverse[(k, k)] * self.sizes[kept[k]]);
        while let Some(least) = stay.iter().copied().min_by(|a, b| own(&inverse, *a).total_cmp(&own(&inverse, *b))) {
            if own(&inverse, least) > DEPENDENT {
                break;
            }
            stay.retain(|k| *k != least);
            let column = inverse.column(least).clone_owned();
            inverse -= &column * column.transpose() / column[least];
        }
        stay.into_iter().for_each(|k| found[kept[k] - first] = Some(true));
        found
    }
}

/// The readings of all tangents of sticking contact.
pub(super) struct Readings {
    all: Vec<Reading>,
    /// Rows that nothing determines.
    idle: BTreeSet<usize>,
}

impl Readings {
    /// Of matrices with these numbers by dof.
    pub(super) fn new(system: &System, matrices: &[Csr], numbers: &[u32]) -> Self {
        let mut dofs: Vec<(u32, usize)> = numbers.iter().copied().zip(0..).filter(|(k, _)| *k != FIXED).collect();
        dofs.sort_unstable();
        let dofs: Vec<usize> = dofs.into_iter().map(|(_, dof)| dof).collect();
        let of = |matrix: &Csr| [matrix.clone(), matrix.transpose()].map(|m| Reading::new(system, &m, &dofs));
        Self { all: matrices.iter().flat_map(of).collect(), idle: BTreeSet::new() }
    }

    /// Leaves to the nodes of coarse multipliers the idle directions that no displacement around determines.
    pub(super) fn look_at(&mut self, nodes: &mut [Node]) {
        let mut open: Vec<(usize, Vec<f64>)> = Vec::new();
        for (k, node) in nodes.iter_mut().enumerate().filter(|(_, node)| node.coarse) {
            let own = node.first..node.first + node.n;
            let of = |row: usize| (!own.contains(&row)).then(|| vec![(row, 1.0)]);
            for direction in std::mem::take(&mut node.idle) {
                let beside = null_space(node.n, std::slice::from_ref(&direction));
                let beside = beside.iter().map(|v| along(node, v)).collect();
                if !self.determine(&Asked { own: along(node, &direction), beside, of: &of, far: false }) {
                    open.push((k, direction));
                }
            }
        }
        let mut determined = vec![false; open.len()];
        let mut dependent = vec![false; open.len()];
        for reading in &self.all {
            decide(reading, nodes, &open, [&mut determined, &mut dependent]);
        }
        for ((k, direction), (is_determined, is_dependent)) in
            open.into_iter().zip(determined.into_iter().zip(dependent))
        {
            if is_determined && !is_dependent {
                continue;
            }
            let node = &mut nodes[k];
            self.idle.extend(axis(&direction).map(|c| node.first + c));
            node.idle.push(direction);
        }
    }

    /// Whether the row of a leader is determined with those that follow it, by leader.
    pub(super) fn can_lead(&self, leader: usize, followers: &BTreeMap<usize, Vec<usize>>) -> bool {
        let with_followers = |row: usize| -> Sum {
            let following = followers.get(&row).into_iter().flatten();
            std::iter::once(&row).chain(following).map(|dof| (*dof, 1.0)).collect()
        };
        let of = |row: usize| (row != leader && !self.idle.contains(&row)).then(|| with_followers(row));
        self.determine(&Asked { own: with_followers(leader), beside: Vec::new(), of: &of, far: true })
    }

    /// Whether a row is determined in the equations and in the forces of every tangent that has it.
    fn determine(&self, asked: &Asked<'_>) -> bool {
        let mut found = self.all.iter().filter_map(|reading| reading.determines(asked)).peekable();
        found.peek().is_some() && found.all(|is_own| is_own)
    }
}

/// The row of a multiplier along a direction of its node.
fn along(node: &Node, direction: &[f64]) -> Sum {
    (node.first..).zip(direction.iter().copied()).filter(|(_, x)| *x != 0.0).collect()
}

/// Decides in one reading over the directions that are open, over all rows that are connected with each: those that are kept
/// beside the others, and those that are not, which later readings leave out.
fn decide(reading: &Reading, nodes: &[Node], open: &[(usize, Vec<f64>)], [determined, dependent]: [&mut Vec<bool>; 2]) {
    let row = |k: usize| along(&nodes[open[k].0], &open[k].1);
    let mut left: BTreeSet<usize> = (0..open.len()).filter(|k| !dependent[*k]).collect();
    while let Some(k) = left.pop_first() {
        let Some(within) = reading.connected(row(k).iter().map(|(dof, _)| *dof).collect()) else { continue };
        let is_here = |k: &usize| row(*k).iter().any(|(dof, _)| within.contains(dof));
        let here: Vec<usize> = std::iter::once(k).chain(left.iter().copied().filter(is_here)).collect();
        here.iter().for_each(|k| _ = left.remove(k));
        let open_nodes: BTreeSet<usize> = open.iter().map(|(node, _)| *node).collect();
        let own: BTreeSet<usize> =
            open_nodes.iter().flat_map(|node| nodes[*node].first..nodes[*node].first + nodes[*node].n).collect();
        // other rows first, then what open nodes hold beside, then what is asked
        let mut sums: Vec<Sum> = within.difference(&own).map(|dof| vec![(*dof, 1.0)]).collect();
        for node in &open_nodes {
            let asked: Vec<Vec<f64>> = open.iter().filter(|(k, _)| k == node).map(|(_, v)| v.clone()).collect();
            sums.extend(null_space(nodes[*node].n, &asked).iter().map(|v| along(&nodes[*node], v)));
        }
        sums.extend(here.iter().map(|k| row(*k)));
        let values: Vec<Row> = sums.iter().map(|sum| reading.value(sum, &within)).collect();
        let found = Products::new(&values).kept(values.len() - here.len());
        for (k, found) in here.iter().zip(found) {
            match found {
                Some(true) => determined[*k] = true,
                Some(false) => dependent[*k] = true,
                None => {}
            }
        }
    }
}

/// True of a multiplier with a lower degree than a displacement at its node, inside a surface.
pub(super) fn is_coarse(system: &System, candidate: &Candidate) -> bool {
    let degree = |field: usize| match &system.fields[field].space {
        FieldSpace::Nodal(space) => Some(space.degree()),
        _ => None,
    };
    let on = candidate.place.iter().map(|dof| system.numbering.describe(&system.fields, *dof).0);
    !candidate.joined && on.filter_map(degree).max() > degree(candidate.field)
}

#[cfg(test)]
mod tests {
    use super::{Products, Row};

    #[test]
    fn rows_depend_on_earlier_ones_or_do_not() {
        let rows = |list: &[&[f64]]| -> Vec<Row> {
            let row = |values: &&[f64]| values.iter().copied().enumerate().filter(|(_, x)| *x != 0.0).collect();
            list.iter().map(row).collect()
        };
        let third: &[f64] = &[1.0, 1.0, 2.0];
        let found = |list: &[&[f64]]| Products::new(&rows(list)).in_order(list.len());
        let own = Some(true);
        assert_eq!(found(&[&[1.0, 0.0, 1.0], &[0.0, 1.0, 1.0], third]), [own, own, Some(false)]);
        assert_eq!(found(&[&[1.0, 0.0, 1.0], &[0.0, 1.0, 0.9], third]), [own, own, own]);
        // the first two are one row
        assert_eq!(found(&[&[1.0, 0.0, 1.0], &[2.0, 0.0, 2.0], third]), [own, Some(false), own]);
        assert_eq!(found(&[&[1.0, 0.0], &[0.0, 0.0]]), [own, None]);
    }

    #[test]
    fn rows_that_determine_each_other_less_and_less_are_not_all_kept() {
        // each has three halves of the next: the last of n is determined by (2/3)^n of itself
        let n = 40;
        let row = |k: usize| Row::from([(k, 1.0), (k + 1, 1.5)]);
        let rows: Vec<Row> = (0..n).map(row).chain([Row::from([(n, 1.0)])]).collect();
        let found = Products::new(&rows).kept(0);
        let stay = found.iter().filter(|own| **own == Some(true)).count();
        assert!((n - 3..=n).contains(&stay), "{found:?}");
    }
}
