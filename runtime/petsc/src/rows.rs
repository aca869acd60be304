//! Which rank has which rows, and the rows of a rank as PETSc takes them.
//!
//! Rows come by whole nodes: a component that is not solved for is a row of the unit matrix, so that blocks of nodes have
//! one size. The system says which rank has a row; PETSc's number of a row is that of its rank, then of its node.
//! Promises: a function of its arguments alone, the same on every rank but for what is its own.

use wfl_sparse::{
    csr::{Csr, Pattern},
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

/// Marks entries that come from nowhere: zero, and the diagonal of what is not solved for.
const ZERO: u32 = u32::MAX;
const UNIT: u32 = u32::MAX - 1;

/// The rows of this rank in compressed form, columns increasing in each, and where their values come from.
#[derive(Clone, Debug)]
pub(crate) struct Structure {
    pub(crate) starts: Vec<i32>,
    pub(crate) columns: Vec<i32>,
    sources: Vec<u32>,
}

impl Structure {
    /// Of a pattern; entries in rows and columns of `hidden` are left out, and get a diagonal of their own.
    pub(crate) fn new(pattern: &Pattern, numbers: &Numbers, hidden: &[u32]) -> Result<Self, SolveError> {
        let mut is_hidden = vec![false; pattern.n_rows()];
        hidden.iter().for_each(|row| is_hidden[*row as usize] = true);
        let (mut starts, mut columns, mut sources) = (vec![0], Vec::new(), Vec::new());
        let mut entries: Vec<(i32, u32)> = Vec::new();
        for (own, row) in (numbers.part.first()..).zip(&numbers.own_rows) {
            entries.clear();
            let mut diagonal = (own, UNIT);
            if *row != NONE && !is_hidden[*row as usize] {
                let row = *row as usize;
                let first = pattern.row_starts()[row];
                for (k, column) in pattern.row(row).iter().enumerate().filter(|(_, c)| !is_hidden[**c as usize]) {
                    let source = u32::try_from(first + k).ok().filter(|source| *source < UNIT);
                    let source = source.ok_or(SolveError::TooLarge { what: "the matrix" })?;
                    entries.push((numbers.of_row[*column as usize], source));
                }
                diagonal = (own, ZERO);
            }
            if !entries.iter().any(|(column, _)| *column == own) {
                entries.push(diagonal);
            }
            entries.sort_unstable();
            columns.extend(entries.iter().map(|e| e.0));
            sources.extend(entries.iter().map(|e| e.1));
            starts.push(number(columns.len())?);
        }
        Ok(Self { starts, columns, sources })
    }

    pub(crate) fn n_rows(&self) -> usize {
        self.starts.len() - 1
    }

    /// The values of a matrix on the pattern of this structure; `unit` on diagonals of what is not solved for.
    pub(crate) fn values(&self, matrix: &Csr, unit: f64) -> Vec<f64> {
        let of = |source: &u32| match *source {
            ZERO => 0.0,
            UNIT => unit,
            k => matrix.values()[k as usize],
        };
        self.sources.iter().map(of).collect()
    }
}

/// The middle one of the positive entries of a diagonal: what rows that are not solved for are made as large as.
pub(crate) fn middle_of_diagonal(matrix: &Csr, owners: Option<&RowOwners>) -> f64 {
    let mut sizes: Vec<f64> = (0..matrix.n_rows()).map(|row| matrix.get(row, row)).collect();
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
    fn hidden_rows_are_rows_of_the_unit_matrix() {
        let matrix = Csr::from_triplets(3, 3, &[(0, 0, 2.0), (0, 2, 1.0), (1, 1, 4.0), (2, 0, 1.0)]).expect("a matrix");
        let numbers = Numbers::new(&[0, 1, 2], 3, 1, None).expect("numbers");
        let whole = Structure::new(matrix.pattern(), &numbers, &[]).expect("a structure");
        assert_eq!(whole.columns, [0, 2, 1, 0, 2]);
        assert_eq!(whole.values(&matrix, 9.0), [2.0, 1.0, 4.0, 1.0, 0.0]);
        let seen = Structure::new(matrix.pattern(), &numbers, &[2]).expect("a structure");
        assert_eq!((seen.columns.clone(), seen.values(&matrix, 9.0)), (vec![0, 1, 2], vec![2.0, 4.0, 9.0]));
    }
}
