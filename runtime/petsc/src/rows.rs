//! Which rank has which rows, and the rows of a rank as PETSc takes them.
//!
//! Rows come by whole nodes: a component that is not solved for is a row of the unit matrix, so that blocks of nodes have
//! one size. The system says which rank has a row; PETSc's number of a row is that of its rank, then of its node.
//! Promises: a function of its arguments alone, the same on every rank but for what is its own.

use wfl_sparse::{
    csr::Csr,
    index::NONE,
    solve::{RowOwners, SolveError},
};

/// Rows by rank.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Part {
    /// Rows of each rank, and the first of each.
    pub(crate) counts: Vec<i32>,
    pub(crate) starts: Vec<i32>,
    own: usize,
}

impl Part {
    pub(crate) fn n_own(&self) -> usize {
        at(self.counts[self.own])
    }

    pub(crate) fn n_all(&self) -> usize {
        self.counts.iter().map(|count| at(*count)).sum()
    }

    fn first(&self) -> i32 {
        self.starts[self.own]
    }

    /// PETSc's numbers of the rows of this rank.
    fn range(&self) -> std::ops::Range<i32> {
        self.first()..self.first() + self.counts[self.own]
    }
}

/// An index of C.
fn at(n: i32) -> usize {
    usize::try_from(n).expect("indices are not negative")
}

fn number(n: usize) -> Result<i32, SolveError> {
    i32::try_from(n).map_err(|_| SolveError::TooLarge { what: "the matrix of a rank, or its unknowns" })
}

/// Where rows of a matrix stand in PETSc's numbers.
#[derive(Clone, Debug)]
pub(crate) struct Numbers {
    pub(crate) part: Part,
    /// By row of the matrix.
    pub(crate) of_row: Vec<i32>,
    /// By own row of PETSc: row of the matrix, or [`NONE`] for one of the unit matrix.
    pub(crate) own_rows: Vec<u32>,
    /// By own row of PETSc: node times components plus component.
    pub(crate) own_places: Vec<u32>,
}

impl Numbers {
    /// For rows at `places` (node times `components` plus component, each once) of so many nodes, on one of the ranks that
    /// own them; `None` for one rank that has all. A node has the rank of its rows.
    pub(crate) fn new(
        places: &[u32],
        n_nodes: usize,
        components: usize,
        owners: Option<&RowOwners>,
    ) -> Result<Self, SolveError> {
        number(n_nodes * components)?;
        let (own, all) = owners.map_or((0, 1), |owners| (owners.team.rank(), owners.team.size()));
        let mut owner = vec![0; n_nodes];
        for (place, rank) in places.iter().zip(owners.iter().flat_map(|owners| &owners.of_row)) {
            owner[*place as usize / components] = usize::from(*rank);
        }
        let mut counts = vec![0; all];
        owner.iter().for_each(|rank| counts[*rank] += components);
        let starts: Vec<usize> = (0..all).map(|rank| counts[..rank].iter().sum()).collect();
        // the first row of each node
        let mut next = starts.clone();
        let mut first = vec![0; n_nodes];
        let mut own_places = Vec::with_capacity(counts[own]);
        for (node, rank) in owner.iter().enumerate() {
            first[node] = next[*rank];
            next[*rank] += components;
            if *rank == own {
                own_places.extend((0..components).map(|c| (node * components + c) as u32));
            }
        }
        let mut of_row = Vec::with_capacity(places.len());
        let mut own_rows = vec![NONE; counts[own]];
        for (row, place) in (0..).zip(places) {
            let (node, component) = (*place as usize / components, *place as usize % components);
            let petsc = first[node] + component;
            of_row.push(number(petsc)?);
            if owner[node] == own {
                own_rows[petsc - starts[own]] = row;
            }
        }
        let numbers = |list: Vec<usize>| list.into_iter().map(number).collect::<Result<Vec<i32>, _>>();
        let part = Part { counts: numbers(counts)?, starts: numbers(starts)?, own };
        Ok(Self { part, of_row, own_rows, own_places })
    }

    /// The numbers of those rows of a list that this rank has, in the order of PETSc.
    pub(crate) fn own_of(&self, rows: &[u32]) -> Vec<i32> {
        let (first, n) = (self.part.first(), self.part.n_own());
        let of = rows.iter().map(|row| self.of_row[*row as usize]);
        let mut own: Vec<i32> = of.filter(|k| *k >= first && at(*k - first) < n).collect();
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
        let number = self.numbers.part.first() + k as i32;
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

/// The middle one of the positive entries of the diagonal of a sum: what rows that are not solved for are made as large as.
pub(crate) fn middle_of_diagonal(parts: [&Csr; 2], owners: Option<&RowOwners>) -> f64 {
    let of_row = |row| parts.iter().map(|part| part.get(row, row)).sum();
    let mut sizes: Vec<f64> = (0..parts[0].n_rows()).map(of_row).collect();
    if let Some(owners) = owners {
        owners.team.sum(&mut sizes);
    }
    sizes.retain(|x| *x > 0.0 && x.is_finite());
    sizes.sort_unstable_by(f64::total_cmp);
    sizes.get(sizes.len() / 2).copied().unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use wfl_host::team::in_threads;

    use super::*;

    #[test]
    fn every_row_has_one_rank_and_stands_beside_the_others_of_its_node() {
        let places: Vec<u32> = (0..36).filter(|place| place % 5 != 0).collect();
        for all in 1..=4 {
            let owner = |place: &u32| u16::try_from(*place as usize / 3 % all).expect("few ranks");
            let of_row: Vec<u16> = places.iter().map(owner).collect();
            let of = |team| RowOwners { team, of_row: of_row.clone() };
            let made = in_threads(all).into_iter().map(|team| Numbers::new(&places, 12, 3, Some(&of(team))));
            let numbers: Vec<Numbers> = made.map(|numbers| numbers.expect("numbers")).collect();
            let mut seen: Vec<u32> = numbers.iter().flat_map(|n| n.own_rows.clone()).filter(|r| *r != NONE).collect();
            seen.sort_unstable();
            assert!(seen.into_iter().eq(0..places.len() as u32), "{all} ranks");
            assert!(numbers.iter().all(|n| n.of_row == numbers[0].of_row && n.part.n_all() == 36));
        }
    }

    #[test]
    fn rows_are_those_of_the_sum_and_hidden_ones_are_of_the_unit_matrix() {
        let of = |entries: &[_]| Csr::from_triplets(3, 3, entries).expect("a matrix");
        let constant = of(&[(0, 0, 2.0), (0, 2, 1.0), (1, 1, 4.0)]);
        let changing = of(&[(0, 1, 3.0), (0, 2, 5.0), (2, 0, 1.0)]);
        let numbers = Numbers::new(&[0, 1, 2], 3, 1, None).expect("numbers");
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
