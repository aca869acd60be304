//! Orders and structures of sparse factors, by faer.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::SymbolicSupernodalParams;
use faer::sparse::linalg::amd;
use faer::sparse::linalg::cholesky::{simplicial, supernodal};

use crate::NoMemory;

/// The fronts of a Cholesky factor: columns with nearly the same rows below them.
pub struct Fronts(supernodal::SymbolicSupernodalCholesky<u32>);

impl Fronts {
    /// Their number.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.n_supernodes()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// First column of a front, and the one behind its last.
    #[must_use]
    pub fn columns(&self, front: usize) -> [u32; 2] {
        [self.0.supernode_begin()[front], self.0.supernode_end()[front]]
    }

    /// Rows below the columns of a front, rising.
    #[must_use]
    pub fn rows(&self, front: usize) -> &[u32] {
        self.0.supernode(front).pattern()
    }
}

/// The fronts of a symmetric matrix of n unknowns in the order of elimination. `starts` and `rows` have its upper half by
/// columns, in any order of rows; `relaxation` says which fronts are merged: up to so many columns with less than this part
/// of zeros.
///
/// # Errors
/// The machine refuses memory.
pub fn fronts(n: usize, starts: &[u32], rows: &[u32], relaxation: &[(usize, f64)]) -> Result<Fronts, NoMemory> {
    let upper = SymbolicSparseColMatRef::new_unsorted_checked(n, n, starts, None, rows);
    let scratch = simplicial::prefactorize_symbolic_cholesky_scratch::<u32>(n, rows.len())
        .or(supernodal::factorize_supernodal_symbolic_cholesky_scratch::<u32>(n));
    let mut memory = MemBuffer::try_new(scratch).map_err(|_| NoMemory)?;
    let stack = MemStack::new(&mut memory);
    let mut parents = vec![0i32; n];
    let mut counts = vec![0u32; n];
    let tree = simplicial::prefactorize_symbolic_cholesky::<u32>(&mut parents, &mut counts, upper, stack);
    let parameters = SymbolicSupernodalParams { relax: Some(relaxation) };
    let made = supernodal::factorize_supernodal_symbolic_cholesky(upper, tree, &counts, stack, parameters);
    made.map(Fronts).map_err(|_| NoMemory)
}

/// New order of the nodes of a symmetric graph in compressed form, by approximate minimum degree.
///
/// # Errors
/// The machine refuses memory.
pub fn minimum_degree(starts: &[u32], neighbours: &[u32]) -> Result<Vec<u32>, NoMemory> {
    let n = starts.len() - 1;
    let graph = SymbolicSparseColMatRef::new_checked(n, n, starts, None, neighbours);
    let mut order = vec![0u32; n];
    let mut inverse = vec![0u32; n];
    let mut memory = MemBuffer::try_new(amd::order_scratch::<u32>(n, neighbours.len())).map_err(|_| NoMemory)?;
    amd::order(&mut order, &mut inverse, graph, amd::Control::default(), MemStack::new(&mut memory))
        .map_err(|_| NoMemory)?;
    Ok(order)
}
