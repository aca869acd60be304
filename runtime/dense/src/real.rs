//! Products, factors and solves of dense matrices of double or single precision, by faer.
//!
//! The functions of the trait are written out for both kinds of numbers by a macro, and are never made part of their callers: faer's code
//! stands in this crate alone.

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::{LltError, LltRegularization, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::lu::partial_pivoting::factor::{lu_in_place, lu_in_place_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_unit_lower_triangular_in_place, solve_unit_upper_triangular_in_place,
    solve_upper_triangular_in_place,
};
use faer::{Accum, MatMut, MatRef, Par};

use crate::NoMemory;
use crate::sweeps::{self, Diagonal, Stored, TOGETHER};

/// Work space of dense factors.
pub struct Work(MemBuffer);

impl Work {
    /// None.
    #[must_use]
    pub fn empty() -> Self {
        Self(MemBuffer::new(StackReq::EMPTY))
    }

    /// For [`Real::cholesky`] of matrices up to n x n.
    ///
    /// # Errors
    /// The machine refuses memory.
    pub fn of_cholesky<T: Real>(n: usize, par: Par) -> Result<Self, NoMemory> {
        Self::new(T::cholesky_scratch(n, par))
    }

    /// For [`Real::lu`] of matrices up to n x n.
    ///
    /// # Errors
    /// The machine refuses memory.
    pub fn of_lu<T: Real>(n: usize, par: Par) -> Result<Self, NoMemory> {
        Self::new(T::lu_scratch(n, par))
    }

    /// For either.
    ///
    /// # Errors
    /// The machine refuses memory.
    pub fn of_either<T: Real>(n: usize, par: Par) -> Result<Self, NoMemory> {
        Self::new(T::lu_scratch(n, par).or(T::cholesky_scratch(n, par)))
    }

    fn new(scratch: StackReq) -> Result<Self, NoMemory> {
        MemBuffer::try_new(scratch).map(Self).map_err(|_| NoMemory)
    }
}

/// Numbers of dense matrices. Right-hand sides and sums of sweeps are of double precision for both kinds.
pub trait Real: Stored + std::ops::SubAssign {
    /// `C = f A B` or `C = C + f A B`.
    fn product(c: MatMut<'_, Self>, accum: Accum, a: MatRef<'_, Self>, b: MatRef<'_, Self>, f: Self, par: Par);

    /// `X = L⁻¹ X` with the lower triangle of a matrix.
    fn solve_lower(l: MatRef<'_, Self>, x: MatMut<'_, Self>, par: Par);

    /// `X = U⁻¹ X` with the upper triangle of a matrix.
    fn solve_upper(u: MatRef<'_, Self>, x: MatMut<'_, Self>, par: Par);

    /// The same with ones on the diagonal.
    fn solve_unit_upper(u: MatRef<'_, Self>, x: MatMut<'_, Self>, par: Par);

    /// L of `A = L Lᵀ` in place of the lower half of A.
    ///
    /// # Errors
    /// The column whose pivot is not positive.
    fn cholesky(a: MatMut<'_, Self>, par: Par, work: &mut Work) -> Result<(), usize>;

    /// L, with ones on its diagonal, and U of `P A = L U` in place of A: row i of them is row `pivots[i]` of A.
    fn lu(a: MatMut<'_, Self>, pivots: &mut [u32], inverse: &mut [u32], par: Par, work: &mut Work);

    #[doc(hidden)]
    fn cholesky_scratch(n: usize, par: Par) -> StackReq;

    #[doc(hidden)]
    fn lu_scratch(n: usize, par: Par) -> StackReq;

    /// `y = A x`, A by rows with the length of `x`.
    fn product_by_rows(a: &[Self], x: &[f64], y: &mut [f64]);

    /// `largest = max(largest, |a|)`, one by one; a NaN in `a` counts as nothing.
    fn enlarge(a: &[Self], largest: &mut [f64]);

    /// The largest `|a scale|`.
    fn largest_of_products(a: &[Self], scale: &[f64]) -> f64;

    /// `a = a scale factor`; all factors are powers of two.
    fn scale_by(a: &mut [Self], scale: &[f64], factor: f64);

    /// Solves `T x = b` with the lower triangle of a panel and subtracts the rectangle times x from `below`.
    fn lower_solve(panel: &[Self], diagonal: Diagonal, x: &mut [f64], below: &mut [f64]);

    /// Solves `Tᵀ x = b - Rᵀ below` with the lower triangle T and the rectangle R of a panel.
    fn lower_transposed_solve(panel: &[Self], diagonal: Diagonal, x: &mut [f64], below: &[f64]);

    /// Solves `U x = b` with the upper triangle of the top of a panel with m rows.
    fn upper_solve(panel: &[Self], m: usize, x: &mut [f64]);

    /// Solves `Uᵀ x = b` with the upper triangle of the top of a panel with m rows.
    fn upper_transposed_solve(panel: &[Self], m: usize, x: &mut [f64]);

    /// `targets[r] = Σ factors[k][r] vectors[k]`; targets without room are left out.
    fn combine(factors: &[[Self; TOGETHER]], vectors: &[&[Self]], targets: [&mut [Self]; TOGETHER]);
}

macro_rules! real {
    ($number:ty) => {
        impl Real for $number {
            #[inline(never)]
            fn product(c: MatMut<'_, Self>, accum: Accum, a: MatRef<'_, Self>, b: MatRef<'_, Self>, f: Self, par: Par) {
                matmul(c, accum, a, b, f, par);
            }

            #[inline(never)]
            fn solve_lower(l: MatRef<'_, Self>, x: MatMut<'_, Self>, par: Par) {
                solve_lower_triangular_in_place(l, x, par);
            }

            #[inline(never)]
            fn solve_upper(u: MatRef<'_, Self>, x: MatMut<'_, Self>, par: Par) {
                solve_upper_triangular_in_place(u, x, par);
            }

            #[inline(never)]
            fn solve_unit_upper(u: MatRef<'_, Self>, x: MatMut<'_, Self>, par: Par) {
                solve_unit_upper_triangular_in_place(u, x, par);
            }

            #[inline(never)]
            fn cholesky(a: MatMut<'_, Self>, par: Par, work: &mut Work) -> Result<(), usize> {
                let stack = MemStack::new(&mut work.0);
                let made = cholesky_in_place(a, LltRegularization::default(), par, stack, Default::default());
                made.map(|_| ()).map_err(|LltError::NonPositivePivot { index }| index)
            }

            #[inline(never)]
            fn lu(a: MatMut<'_, Self>, pivots: &mut [u32], inverse: &mut [u32], par: Par, work: &mut Work) {
                lu_in_place(a, pivots, inverse, par, MemStack::new(&mut work.0), Default::default());
            }

            #[inline(never)]
            fn cholesky_scratch(n: usize, par: Par) -> StackReq {
                cholesky_in_place_scratch::<Self>(n, par, Default::default())
            }

            #[inline(never)]
            fn lu_scratch(n: usize, par: Par) -> StackReq {
                lu_in_place_scratch::<u32, Self>(n, n, par, Default::default())
            }

            #[inline(never)]
            fn product_by_rows(a: &[Self], x: &[f64], y: &mut [f64]) {
                sweeps::product_by_rows(a, x, y);
            }

            #[inline(never)]
            fn enlarge(a: &[Self], largest: &mut [f64]) {
                sweeps::enlarge(a, largest);
            }

            #[inline(never)]
            fn largest_of_products(a: &[Self], scale: &[f64]) -> f64 {
                sweeps::largest_of_products(a, scale)
            }

            #[inline(never)]
            fn scale_by(a: &mut [Self], scale: &[f64], factor: f64) {
                sweeps::scale_by(a, scale, factor);
            }

            #[inline(never)]
            fn lower_solve(panel: &[Self], diagonal: Diagonal, x: &mut [f64], below: &mut [f64]) {
                sweeps::lower_solve(panel, diagonal, x, below);
            }

            #[inline(never)]
            fn lower_transposed_solve(panel: &[Self], diagonal: Diagonal, x: &mut [f64], below: &[f64]) {
                sweeps::lower_transposed_solve(panel, diagonal, x, below);
            }

            #[inline(never)]
            fn upper_solve(panel: &[Self], m: usize, x: &mut [f64]) {
                sweeps::upper_solve(panel, m, x);
            }

            #[inline(never)]
            fn upper_transposed_solve(panel: &[Self], m: usize, x: &mut [f64]) {
                sweeps::upper_transposed_solve(panel, m, x);
            }

            #[inline(never)]
            fn combine(factors: &[[Self; TOGETHER]], vectors: &[&[Self]], targets: [&mut [Self]; TOGETHER]) {
                sweeps::combine(factors, vectors, targets);
            }
        }
    };
}

real!(f64);
real!(f32);

/// `X = L⁻¹ X` with the lower triangle of a matrix whose diagonal is taken as ones.
#[inline(never)]
pub fn solve_unit_lower(l: MatRef<'_, f64>, x: MatMut<'_, f64>, par: Par) {
    solve_unit_lower_triangular_in_place(l, x, par);
}

/// `C = C - A B` or `C = -A B`, the lower triangle alone.
#[inline(never)]
pub fn lower_product(c: MatMut<'_, f64>, accum: Accum, a: MatRef<'_, f64>, b: MatRef<'_, f64>, par: Par) {
    use BlockStructure::{Rectangular, TriangularLower};
    triangular::matmul(c, TriangularLower, accum, a, Rectangular, b, Rectangular, -1.0, par);
}
