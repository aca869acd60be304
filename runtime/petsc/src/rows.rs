//! Which rank has which rows, and the rows of a rank as PETSc takes them.
//!
//! Rows come by whole nodes: a component that is not solved for is a row of the unit matrix, so that blocks of nodes have
//! one size. The system says which rank has a row; PETSc's number of a row is that of its rank, then of its node. A rank
//! knows the numbers of its own rows and of those in their columns.

use wfl_host::team::{Alone, Team};
use wfl_sparse::{
    csr::Csr,
    index::NONE,
    solve::{RowOwners, SolveError},
};

/// Rows by rank.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Part {
    /// PETSc's number of the first row of this rank.
    first: i32,
    /// Rows of this rank.
    n: i32,
}

impl Part {
    pub(crate) fn n_own(&self) -> usize {
        at(self.n)
    }

    /// PETSc's numbers of the rows of this rank.
    fn range(&self) -> std::ops::Range<i32> {
        self.first..self.first + self.n
    }
}

/// An index of C.
fn at(n: i32) -> usize {
    usize::try_from(n).expect("indices are not negative")
}

fn number(n: usize) -> Result<i32, SolveError> {
    i32::try_from(n).map_err(|_| SolveError::TooLarge { what: "the matrix of a rank, or its unknowns" })
}

/// What has no number: a row that neither this rank has nor one that it meets in its own.
const NOBODY: u64 = u64::MAX;

/// Where rows of a matrix stand in PETSc's numbers.
#[derive(Clone, Debug)]
pub(crate) struct Numbers {
    pub(crate) part: Part,
    /// By row of the matrix; -1 for one that stands in no column of the rows of this rank.
    of_row: Vec<i32>,
    /// By own row of PETSc: row of the matrix, or [`NONE`] for one of the unit matrix.
    pub(crate) own_rows: Vec<u32>,
    /// By own row of PETSc: node times components plus component.
    pub(crate) own_places: Vec<u32>,
}

impl Numbers {
    /// For rows at `places` (node times `components` plus component, increasing), on one of the ranks that own them; `None`
    /// for one rank that has all. A node has the rank of its rows. Made by all ranks together.
    pub(crate) fn new(places: &[u32], components: usize, owners: Option<&RowOwners>) -> Result<Self, SolveError> {
        let is_own = |row: usize| owners.is_none_or(|owners| owners.owns(row));
        let node = |row: usize| places[row] as usize / components;
        let mut own_places: Vec<u32> = Vec::new();
        for row in (0..places.len()).filter(|row| is_own(*row)) {
            if own_places.last().is_none_or(|last| *last as usize / components != node(row)) {
                own_places.extend((0..components).map(|c| (node(row) * components + c) as u32));
            }
        }
        // of all ranks before
        let mut counts = vec![own_places.len() as u64; 1];
        let mut own = 0;
        if let Some(owners) = owners {
            own = owners.team.rank();
            counts = vec![0; owners.team.size()];
            counts[own] = own_places.len() as u64;
            owners.team.sum_words(&mut counts);
        }
        let sum = |counts: &[u64]| usize::try_from(counts.iter().sum::<u64>()).unwrap_or(usize::MAX);
        number(sum(&counts))?;
        let part = Part { first: number(sum(&counts[..own]))?, n: number(own_places.len())? };
        let (mut words, mut own_rows) = (vec![NOBODY; places.len()], vec![NONE; own_places.len()]);
        let mut first = 0;
        for row in (0..places.len()).filter(|row| is_own(*row)) {
            while own_places[first] as usize / components != node(row) {
                first += components;
            }
            let petsc = first + places[row] as usize % components;
            (words[row], own_rows[petsc]) = ((at(part.first) + petsc) as u64, row as u32);
        }
        if let Some(owners) = owners {
            owners.halo.update_words(&*owners.team, &mut words);
        }
        let of_row = words.into_iter().map(|word| i32::try_from(word).unwrap_or(-1)).collect();
        Ok(Self { part, of_row, own_rows, own_places })
    }

    /// The numbers of those rows of a list that this rank has, in the order of PETSc.
    pub(crate) fn own_of(&self, rows: &[u32]) -> Vec<i32> {
        let of = rows.iter().map(|row| self.of_row[*row as usize]);
        let mut own: Vec<i32> = of.filter(|k| self.part.range().contains(k)).collect();
        own.sort_unstable();
        own
    }
}

/// The rows of this rank of the sum of two matrices, as PETSc takes them: columns increasing, and a diagonal in each.
pub(crate) struct Rows<'a> {
    numbers: &'a Numbers,
    parts: [&'a Csr; 2],
    /// Rows that are left out, with their columns, and get a diagonal of their own; by row, or empty.
    is_hidden: Vec<bool>,
    /// What stands on the diagonal of what is not solved for.
    unit: f64,
    entries: Vec<(i32, f64)>,
    columns: Vec<i32>,
    values: Vec<f64>,
}

impl<'a> Rows<'a> {
    pub(crate) fn new(numbers: &'a Numbers, parts: [&'a Csr; 2], hidden: &[u32], unit: f64) -> Self {
        let mut is_hidden = vec![false; if hidden.is_empty() { 0 } else { parts[0].n_rows() }];
        hidden.iter().for_each(|row| is_hidden[*row as usize] = true);
        let (entries, columns, values) = Default::default();
        Self { numbers, parts, is_hidden, unit, entries, columns, values }
    }

    /// Number of rows of this rank.
    pub(crate) fn len(&self) -> usize {
        self.numbers.own_rows.len()
    }

    /// By row of this rank the number of entries in columns of this rank, and in those of others.
    pub(crate) fn room(&mut self) -> [Vec<i32>; 2] {
        let own = self.numbers.part.range();
        let (mut here, mut there) = (Vec::new(), Vec::new());
        for k in 0..self.len() {
            let (_, columns, _) = self.row(k);
            let n = columns.iter().filter(|column| own.contains(column)).count();
            here.push(n as i32);
            there.push((columns.len() - n) as i32);
        }
        [here, there]
    }

    /// Whether the second part may have entries in a row of this rank, or it is one that is not solved for.
    pub(crate) fn changes(&self, k: usize) -> bool {
        let row = self.numbers.own_rows[k];
        row == NONE || !self.parts[1].pattern().row(row as usize).is_empty()
    }

    /// A row of this rank: its number, columns and values.
    pub(crate) fn row(&mut self, k: usize) -> (i32, &[i32], &[f64]) {
        let number = self.numbers.part.first + k as i32;
        let row = self.numbers.own_rows[k];
        let is_hidden = |row: u32| self.is_hidden.get(row as usize).copied().unwrap_or(false);
        self.entries.clear();
        let mut diagonal = self.unit;
        if row != NONE && !is_hidden(row) {
            let [first, second] = self.parts.map(|part| part.row(row as usize));
            let entries = &mut self.entries;
            sum(first, second, |column, value| {
                if !is_hidden(column) {
                    entries.push((self.numbers.of_row[column as usize], value));
                }
            });
            diagonal = 0.0;
        }
        if !self.entries.iter().any(|(column, _)| *column == number) {
            self.entries.push((number, diagonal));
        }
        self.entries.sort_unstable_by_key(|(column, _)| *column);
        self.columns.clear();
        self.values.clear();
        self.columns.extend(self.entries.iter().map(|e| e.0));
        self.values.extend(self.entries.iter().map(|e| e.1));
        (number, &self.columns, &self.values)
    }
}

/// The entries of the sum of two rows, in the order of their columns.
fn sum(first: (&[u32], &[f64]), second: (&[u32], &[f64]), mut take: impl FnMut(u32, f64)) {
    let mut others = second.0.iter().copied().zip(second.1.iter().copied()).peekable();
    for (column, value) in first.0.iter().copied().zip(first.1.iter().copied()) {
        while let Some((column, value)) = others.next_if(|(other, _)| *other < column) {
            take(column, value);
        }
        let other = others.next_if(|(other, _)| *other == column).map_or(0.0, |(_, value)| value);
        take(column, value + other);
    }
    others.for_each(|(column, value)| take(column, value));
}

/// The middle one of the positive entries of the diagonal of a sum, of the rows of all ranks: what rows that are not solved
/// for are made as large as.
pub(crate) fn middle_of_diagonal(parts: [&Csr; 2], owners: Option<&RowOwners>) -> f64 {
    let of_row = |row| parts.iter().map(|part| part.get(row, row)).sum();
    let mut sizes: Vec<f64> = (0..parts[0].n_rows()).map(of_row).collect();
    sizes.retain(|x| *x > 0.0 && x.is_finite());
    sizes.sort_unstable_by(f64::total_cmp);
    let team: &dyn Team = owners.map_or(&Alone, |owners| &*owners.team);
    let middle = team.count(sizes.len()) / 2;
    // the largest number that so many lie below, bit after bit: positive numbers have the order of their bits
    let mut found = 0;
    for bit in (0..63).rev() {
        let tried = found | 1 << bit;
        let below = sizes.partition_point(|x| x.to_bits() < tried);
        if team.count(below) <= middle {
            found = tried;
        }
    }
    let middle = f64::from_bits(found);
    if middle.is_finite() && team.any(!sizes.is_empty()) { middle } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use wfl_host::{halo::Halo, team::in_threads};

    use super::*;

    #[test]
    fn every_row_has_one_rank_and_stands_beside_the_others_of_its_node() {
        let places: Vec<u32> = (0..36).filter(|place| place % 5 != 0).collect();
        for all in 1..=4 {
            let owner = |place: &u32| u16::try_from(*place as usize / 3 % all).expect("few ranks");
            let of_row: Vec<u16> = places.iter().map(owner).collect();
            let of = |team: Arc<dyn Team>| {
                let halo = Halo::of_all(&*team, &of_row);
                RowOwners { team, of_row: of_row.clone(), halo, numbers: None }
            };
            let numbers: Vec<Numbers> = each(all, |team| Numbers::new(&places, 3, Some(&of(team))).expect("numbers"));
            let mut seen: Vec<u32> = numbers.iter().flat_map(|n| n.own_rows.clone()).filter(|r| *r != NONE).collect();
            seen.sort_unstable();
            assert!(seen.into_iter().eq(0..places.len() as u32), "{all} ranks");
            assert!(numbers.iter().all(|n| n.of_row == numbers[0].of_row));
            assert_eq!(numbers.iter().map(|n| n.part.n_own()).sum::<usize>(), 36);
        }
    }

    /// What each of some ranks finds.
    fn each<T: Send>(size: usize, work: impl Fn(Arc<dyn Team>) -> T + Sync) -> Vec<T> {
        std::thread::scope(|scope| {
            let ranks: Vec<_> = in_threads(size).into_iter().map(|team| scope.spawn(|| work(team))).collect();
            ranks.into_iter().map(|rank| rank.join().expect("a rank ends")).collect()
        })
    }

    #[test]
    fn the_middle_of_the_diagonal_is_that_of_all_ranks() {
        let all = [3.0, -1.0, 0.0, 1e-3, 7.0, 2.5, 1e300];
        let of = |rows: &[u32]| {
            let entries: Vec<_> = rows.iter().map(|row| (*row, *row, all[*row as usize])).collect();
            Csr::from_triplets(7, 7, &entries).expect("a matrix")
        };
        let nothing = of(&[]);
        assert_eq!(middle_of_diagonal([&of(&[0, 1, 2, 3, 4, 5, 6]), &nothing], None), 3.0);
        assert_eq!(middle_of_diagonal([&nothing, &nothing], None), 1.0);
        let of_row = [0, 0, 1, 1, 1, 0, 1];
        let found = each(2, |team| {
            let halo = Halo::of_all(&*team, &of_row);
            let own: Vec<u32> = (0..7).filter(|row| usize::from(of_row[*row as usize]) == team.rank()).collect();
            let owners = RowOwners { team, of_row: of_row.to_vec(), halo, numbers: None };
            middle_of_diagonal([&of(&own), &nothing], Some(&owners))
        });
        assert_eq!(found, [3.0, 3.0]);
    }

    #[test]
    fn rows_are_those_of_the_sum_and_hidden_ones_are_of_the_unit_matrix() {
        let of = |entries: &[_]| Csr::from_triplets(3, 3, entries).expect("a matrix");
        let constant = of(&[(0, 0, 2.0), (0, 2, 1.0), (1, 1, 4.0)]);
        let changing = of(&[(0, 1, 3.0), (0, 2, 5.0), (2, 0, 1.0)]);
        let numbers = Numbers::new(&[0, 1, 2], 1, None).expect("numbers");
        let all = |hidden: &[u32]| {
            let mut rows = Rows::new(&numbers, [&constant, &changing], hidden, 9.0);
            let room = rows.room();
            let all: Vec<_> = (0..3).map(|k| (rows.row(k).1.to_vec(), rows.row(k).2.to_vec())).collect();
            assert_eq!(room, [all.iter().map(|row| row.0.len() as i32).collect(), vec![0; 3]]);
            (all, [0, 1, 2].map(|k| rows.changes(k)))
        };
        let (whole, changes) = all(&[]);
        assert_eq!(whole[0], (vec![0, 1, 2], vec![2.0, 3.0, 6.0]));
        assert_eq!(whole[1..], [(vec![1], vec![4.0]), (vec![0, 2], vec![1.0, 0.0])]);
        assert_eq!(changes, [true, false, true]);
        let (seen, _) = all(&[2]);
        assert_eq!(seen[0], (vec![0, 1], vec![2.0, 3.0]));
        assert_eq!(seen[1..], [(vec![1], vec![4.0]), (vec![2], vec![9.0])]);
    }
}
