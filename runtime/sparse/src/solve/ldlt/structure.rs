//! The structure of a factor in which columns were eliminated above the fronts they belong to.
//!
//! Does not know values.

use super::super::ordering::Ordering;
use super::super::symbolic::{INTERFACE, Symbolic};

/// What has become of the candidates of a front, by their places in the order of the analysis.
#[derive(Clone, Copy)]
pub(super) struct Columns<'a> {
    /// In the order of their elimination.
    pub(super) eliminated: &'a [u32],
    /// Left to the front above, and rows of this one.
    pub(super) waiting: &'a [u32],
}

/// The structure with the columns of each front as they were eliminated there, and its rows behind those that wait. It has
/// no entries of a matrix.
pub(super) fn moved<'a>(symbolic: &Symbolic, columns: impl Fn(usize) -> Columns<'a>) -> Symbolic {
    let n_fronts = symbolic.n_fronts();
    let mut starts = vec![0u32];
    let mut new_place = vec![0u32; symbolic.n_eliminated()];
    let mut forward = Vec::with_capacity(new_place.len());
    for front in 0..n_fronts {
        for &place in columns(front).eliminated {
            new_place[place as usize] = forward.len() as u32;
            forward.push(symbolic.ordering.forward()[place as usize]);
        }
        starts.push(forward.len() as u32);
    }
    let (mut row_starts, mut rows) = (vec![0usize], Vec::new());
    for front in 0..n_fronts {
        let all = columns(front).waiting.iter().chain(symbolic.rows_of(front));
        rows.extend(all.map(|place| new_place[*place as usize]));
        row_starts.push(rows.len());
    }
    let n = forward.len();
    let mut moved = Symbolic {
        ordering: Ordering::from_forward(forward, n),
        lower_starts: Vec::new(),
        lower_rows: Vec::new(),
        lower_sources: Vec::new(),
        columns: starts,
        row_starts,
        rows,
        places: Vec::new(),
        parents: symbolic.parents.clone(),
        child_starts: symbolic.child_starts.clone(),
        children: symbolic.children.clone(),
    };
    moved.places = places(&moved);
    moved
}

/// For each row of each front its place in the parent: columns first, then rows.
fn places(moved: &Symbolic) -> Vec<u32> {
    let mut places = vec![0u32; moved.rows.len()];
    let mut in_parent = vec![0u32; moved.n_eliminated()];
    for parent in 0..moved.n_fronts() {
        let columns = moved.columns[parent]..moved.columns[parent + 1];
        let all = columns.chain(moved.rows_of(parent).iter().copied());
        all.zip(0..).for_each(|(row, place)| in_parent[row as usize] = place);
        for &child in moved.children_of(parent) {
            let range = moved.row_starts[child as usize]..moved.row_starts[child as usize + 1];
            debug_assert!(moved.parents[child as usize] != INTERFACE);
            for at in range {
                places[at] = in_parent[moved.rows[at] as usize];
            }
        }
    }
    places
}
