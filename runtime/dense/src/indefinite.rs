//! A dense symmetric factor with pivots of one and two, by faer.

use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::lblt::{factor, solve};
use faer::perm::PermRef;
use faer::{Conj, Mat, MatMut, MatRef, Par};

/// `P A Pᵀ = L B Lᵀ` of a symmetric matrix, of which the lower half is read: B has blocks of one and two on its diagonal
/// (J. R. Bunch, L. Kaufman, Math. Comput. 31 (1977) 163-179).
pub struct Indefinite {
    factor: Mat<f64>,
    diagonal: Diag<f64>,
    beside: Diag<f64>,
    order: [Vec<usize>; 2],
    memory: MemBuffer,
}

impl Indefinite {
    /// Factors a matrix; `columns` right-hand sides will be solved for. `None` where the machine refuses memory.
    #[must_use]
    pub fn new(matrix: MatRef<'_, f64>, columns: usize) -> Option<Self> {
        let k = matrix.nrows();
        let mut factor = matrix.to_owned();
        let mut beside = Diag::<f64>::zeros(k);
        let (mut forward, mut backward) = (vec![0usize; k], vec![0usize; k]);
        let scratch = factor::cholesky_in_place_scratch::<usize, f64>(k, Par::Seq, Default::default())
            .or(solve::solve_in_place_scratch::<usize, f64>(k, columns, Par::Seq));
        let mut memory = MemBuffer::try_new(scratch).ok()?;
        factor::cholesky_in_place(
            factor.as_mut(),
            beside.as_mut(),
            &mut forward,
            &mut backward,
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        );
        let mut diagonal = Diag::<f64>::zeros(k);
        diagonal.copy_from(factor.diagonal());
        Some(Self { factor, diagonal, beside, order: [forward, backward], memory })
    }

    /// By column the diagonal of B and the entry beside it, zero but at the first column of a block of two.
    #[must_use]
    pub fn pivots(&self) -> Vec<[f64; 2]> {
        (0..self.order[0].len()).map(|i| [self.diagonal[i], self.beside[i]]).collect()
    }

    /// Solves in place, at most as many columns as were foreseen.
    pub fn solve(&mut self, x: MatMut<'_, f64>) {
        let [forward, backward] = &self.order;
        solve::solve_in_place_with_conj(
            self.factor.as_ref(),
            self.diagonal.as_ref(),
            self.beside.as_ref(),
            Conj::No,
            PermRef::new_checked(forward, backward, forward.len()),
            x,
            Par::Seq,
            MemStack::new(&mut self.memory),
        );
    }
}
