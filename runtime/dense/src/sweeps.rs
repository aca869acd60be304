//! Dense triangular solves with one vector, over the panels of the fronts.
//!
//! A panel is (k + r) x k by columns: a k x k triangle above an r x k rectangle. Its numbers may be of single precision;
//! vectors and sums are of double precision. Sums run in one fixed order, several columns or lanes at a time so that the
//! compiler vectorises them; each solve is compiled for every width of vectors, and the widest one that the processor has
//! is taken. Operations and their order are the same in all.
//!
//! Those that stand for numbers of either precision are called through [`Real`](crate::Real). Does not factor and does not check pivots.

mod stored;

use pulp::{Arch, Simd, WithSimd};
use stored::LANES;
pub use stored::Stored;

/// Diagonal of a triangular matrix.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Diagonal {
    /// Stored on the diagonal.
    Stored,
    /// All ones, not stored.
    Unit,
}

/// Makes a tuple of operands an operation that is compiled for every width of vectors. A closure would not do: its body
/// is compiled for the narrowest vectors alone.
macro_rules! widest {
    ($operation:ident, $simd:ident, |$($operand:ident),*| $body:expr) => {
        impl<T: Stored> WithSimd for $operation<'_, T> {
            type Output = ();

            #[inline(always)]
            fn with_simd<S: Simd>(self, $simd: S) {
                let Self($($operand),*) = self;
                $body;
            }
        }
    };
}

/// `y = y - A x`, A by columns with the length of `y`, four columns at a time.
#[inline(never)]
pub fn subtract_product(a: &[f64], x: &[f64], y: &mut [f64]) {
    struct Operation<'a, T>(&'a [T], &'a [f64], &'a mut [f64]);
    widest!(Operation, simd, |a, x, y| subtract_product_in(simd, a, x, y));
    Arch::new().dispatch(Operation(a, x, y));
}

/// `y = y - A x`: of each column of A, which are `stride` numbers apart, those from `first` on, as many as y has.
#[inline(never)]
pub fn subtract_columns(a: &[f64], stride: usize, x: &[f64], first: usize, y: &mut [f64]) {
    struct Operation<'a, T>(&'a [T], usize, &'a [f64], usize, &'a mut [f64]);
    widest!(Operation, simd, |a, stride, x, first, y| {
        let n = y.len();
        let column = |k: usize| &a[k * stride + first..][..n];
        let (fours, rest) = x.as_chunks::<4>();
        for (k, factors) in fours.iter().enumerate() {
            subtract_four(simd, [0, 1, 2, 3].map(|j| column(4 * k + j)), *factors, y);
        }
        for (k, factor) in rest.iter().enumerate() {
            subtract(simd, column(4 * fours.len() + k), *factor, y);
        }
    });
    Arch::new().dispatch(Operation(a, stride, x, first, y));
}

/// The largest `|a|`; a NaN counts as nothing.
#[inline(never)]
pub fn largest_beside(a: &[f64]) -> f64 {
    struct Operation<'a, T>(&'a [T], &'a mut [f64; LANES]);
    widest!(Operation, _simd, |a, largest| {
        let (whole, rest) = a.as_chunks::<LANES>();
        for values in whole {
            let values = T::widened(values);
            for lane in 0..LANES {
                let size = values[lane].abs();
                largest[lane] = if size > largest[lane] { size } else { largest[lane] };
            }
        }
        for value in rest {
            largest[0] = largest[0].max(value.wide().abs());
        }
    });
    let mut largest = [0.0; LANES];
    Arch::new().dispatch(Operation(a, &mut largest));
    largest.into_iter().fold(0.0, f64::max)
}

/// Sum of products, in eight partial sums.
#[inline(never)]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    struct Operation<'a, T>(&'a [T], &'a [f64], &'a mut f64);
    widest!(Operation, simd, |a, b, sum| *sum = dot_in(simd, a, b));
    let mut sum = 0.0;
    Arch::new().dispatch(Operation(a, b, &mut sum));
    sum
}

/// `y = y - Aᵀ x`, A by columns with the length of `x`.
#[inline(never)]
pub fn subtract_transposed_product(a: &[f64], x: &[f64], y: &mut [f64]) {
    struct Operation<'a, T>(&'a [T], &'a [f64], &'a mut [f64]);
    widest!(Operation, simd, |a, x, y| {
        for (column, out) in a.chunks_exact(x.len()).zip(y) {
            *out -= dot_in(simd, column, x);
        }
    });
    if !x.is_empty() {
        Arch::new().dispatch(Operation(a, x, y));
    }
}

/// `y = A x`, A by rows with the length of `x`.
pub(crate) fn product_by_rows<T: Stored>(a: &[T], x: &[f64], y: &mut [f64]) {
    struct Operation<'a, T>(&'a [T], &'a [f64], &'a mut [f64]);
    widest!(Operation, simd, |a, x, y| {
        let n = x.len();
        let (fours, rest) = y.as_chunks_mut::<4>();
        let (of_fours, of_rest) = a.split_at(4 * n * fours.len());
        for (rows, out) in of_fours.chunks_exact(4 * n).zip(fours) {
            *out = dot_four(simd, [0, 1, 2, 3].map(|r| &rows[r * n..(r + 1) * n]), x);
        }
        for (row, out) in of_rest.chunks_exact(n).zip(rest) {
            *out = dot_in(simd, row, x);
        }
    });
    if x.is_empty() {
        y.fill(0.0);
    } else {
        Arch::new().dispatch(Operation(a, x, y));
    }
}

/// `largest = max(largest, |a|)`, one by one; a NaN in `a` counts as nothing.
pub(crate) fn enlarge<T: Stored>(a: &[T], largest: &mut [f64]) {
    struct Operation<'a, T>(&'a [T], &'a mut [f64]);
    widest!(Operation, _simd, |a, largest| {
        for (largest, value) in largest.iter_mut().zip(a) {
            let size = value.wide().abs();
            *largest = if size > *largest { size } else { *largest };
        }
    });
    Arch::new().dispatch(Operation(a, largest));
}

/// The largest `|a scale|`.
pub(crate) fn largest_of_products<T: Stored>(a: &[T], scale: &[f64]) -> f64 {
    struct Operation<'a, T>(&'a [T], &'a [f64], &'a mut [f64; LANES]);
    widest!(Operation, _simd, |a, scale, largest| {
        let ((a, a_rest), (scale, scale_rest)) = (a.as_chunks::<LANES>(), scale.as_chunks::<LANES>());
        for (values, scales) in a.iter().zip(scale) {
            let values = T::widened(values);
            for lane in 0..LANES {
                let size = (values[lane] * scales[lane]).abs();
                largest[lane] = if size > largest[lane] { size } else { largest[lane] };
            }
        }
        for (value, scale) in a_rest.iter().zip(scale_rest) {
            largest[0] = largest[0].max((value.wide() * scale).abs());
        }
    });
    let mut largest = [0.0; LANES];
    Arch::new().dispatch(Operation(a, scale, &mut largest));
    largest.into_iter().fold(0.0, f64::max)
}

/// `a = a scale factor`; all factors are powers of two.
pub(crate) fn scale_by<T: Stored>(a: &mut [T], scale: &[f64], factor: f64) {
    struct Operation<'a, T>(&'a mut [T], &'a [f64], f64);
    widest!(Operation, _simd, |a, scale, factor| {
        for (value, scale) in a.iter_mut().zip(scale) {
            *value = T::nearest(value.wide() * scale * factor);
        }
    });
    Arch::new().dispatch(Operation(a, scale, factor));
}

/// Solves `T x = b` with the lower triangle of a panel and subtracts the rectangle times x from `below`.
pub(crate) fn lower_solve<T: Stored>(panel: &[T], diagonal: Diagonal, x: &mut [f64], below: &mut [f64]) {
    struct Operation<'a, T>(&'a [T], Diagonal, &'a mut [f64], &'a mut [f64]);
    widest!(Operation, simd, |panel, diagonal, x, below| lower_solve_in(simd, panel, diagonal, x, below));
    Arch::new().dispatch(Operation(panel, diagonal, x, below));
}

/// Solves `Tᵀ x = b - Rᵀ below` with the lower triangle T and the rectangle R of a panel.
pub(crate) fn lower_transposed_solve<T: Stored>(panel: &[T], diagonal: Diagonal, x: &mut [f64], below: &[f64]) {
    struct Operation<'a, T>(&'a [T], Diagonal, &'a mut [f64], &'a [f64]);
    widest!(Operation, simd, |panel, diagonal, x, below| lower_transposed_solve_in(simd, panel, diagonal, x, below));
    Arch::new().dispatch(Operation(panel, diagonal, x, below));
}

/// Solves `U x = b` with the upper triangle of the top of a panel with m rows.
pub(crate) fn upper_solve<T: Stored>(panel: &[T], m: usize, x: &mut [f64]) {
    struct Operation<'a, T>(&'a [T], usize, &'a mut [f64]);
    widest!(Operation, simd, |panel, m, x| upper_solve_in(simd, panel, m, x));
    Arch::new().dispatch(Operation(panel, m, x));
}

/// Solves `Uᵀ x = b` with the upper triangle of the top of a panel with m rows.
pub(crate) fn upper_transposed_solve<T: Stored>(panel: &[T], m: usize, x: &mut [f64]) {
    struct Operation<'a, T>(&'a [T], usize, &'a mut [f64]);
    widest!(Operation, simd, |panel, m, x| {
        let k = x.len();
        let mut first = 0;
        while first + 4 <= k {
            let c: [&[T]; 4] = [0, 1, 2, 3].map(|j| &panel[(first + j) * m..][..k]);
            let above = dot_four(simd, c, &x[..first]);
            for j in 0..4 {
                let mut sum = x[first + j] - above[j];
                for i in 0..j {
                    sum -= c[j][first + i].wide() * x[first + i];
                }
                x[first + j] = sum / c[j][first + j].wide();
            }
            first += 4;
        }
        for j in first..k {
            let column = &panel[j * m..j * m + k];
            x[j] = (x[j] - dot_in(simd, &column[..j], &x[..j])) / column[j].wide();
        }
    });
    Arch::new().dispatch(Operation(panel, m, x));
}

/// `x = D⁻¹ x`: D on the diagonal of a panel of m rows, and beside it.
#[inline(never)]
pub fn divide_by_pivots(panel: &[f64], beside: &[f64], m: usize, x: &mut [f64]) {
    let mut at = 0;
    while at < x.len() {
        let (a, b) = (panel[at * m + at], beside[at]);
        if b == 0.0 {
            x[at] /= a;
            at += 1;
            continue;
        }
        let c = panel[(at + 1) * m + at + 1];
        let (p, q) = (a / b, c / b);
        let scale = 1.0 / (b * (p * q - 1.0));
        (x[at], x[at + 1]) = ((q * x[at] - x[at + 1]) * scale, (p * x[at + 1] - x[at]) * scale);
        at += 2;
    }
}

/// Rows that [`Real::combine`](crate::Real::combine) makes at once, and the vectors of each that stay in registers.
pub const TOGETHER: usize = 3;
const HELD: usize = 3;

/// `targets[r] = Σ factors[k][r] vectors[k]`; targets without room are left out.
pub(crate) fn combine<T: Stored>(factors: &[[T; TOGETHER]], vectors: &[&[T]], targets: [&mut [T]; TOGETHER]) {
    Arch::new().dispatch(Combine { factors, vectors, targets });
}

struct Combine<'a, T> {
    factors: &'a [[T; TOGETHER]],
    vectors: &'a [&'a [T]],
    targets: [&'a mut [T]; TOGETHER],
}

impl<T: Stored> WithSimd for Combine<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let n = self.targets[0].len();
        let n_vectors = T::vectors::<S>(self.targets[0]).0.len();
        let zero = T::splat(simd, T::default());
        let mut first = 0;
        while first < n_vectors {
            let held = HELD.min(n_vectors - first);
            let mut sums = [[zero; HELD]; TOGETHER];
            if held == HELD {
                for (factors, vectors) in self.factors.iter().zip(self.vectors) {
                    let vectors = &T::vectors::<S>(vectors).0[first..first + HELD];
                    for r in 0..TOGETHER {
                        let factor = T::splat(simd, factors[r]);
                        for v in 0..HELD {
                            sums[r][v] = T::fused(simd, sums[r][v], factor, vectors[v]);
                        }
                    }
                }
            } else {
                for (factors, vectors) in self.factors.iter().zip(self.vectors) {
                    let vectors = &T::vectors::<S>(vectors).0[first..first + held];
                    for r in 0..TOGETHER {
                        let factor = T::splat(simd, factors[r]);
                        for v in 0..held {
                            sums[r][v] = T::fused(simd, sums[r][v], factor, vectors[v]);
                        }
                    }
                }
            }
            for (target, sums) in self.targets.iter_mut().zip(&sums).filter(|(target, _)| !target.is_empty()) {
                T::vectors_mut::<S>(target).0[first..first + held].copy_from_slice(&sums[..held]);
            }
            first += held;
        }
        let rest = T::vectors::<S>(self.targets[0]).1.len();
        for column in n - rest..n {
            for (r, target) in self.targets.iter_mut().enumerate().filter(|(_, target)| !target.is_empty()) {
                let products = self.factors.iter().zip(self.vectors);
                let sum: f64 = products.map(|(factors, vectors)| factors[r].wide() * vectors[column].wide()).sum();
                target[column] = T::nearest(sum);
            }
        }
    }
}

/// `y = y - factor * column`.
#[inline(always)]
fn subtract<S: Simd, T: Stored>(simd: S, column: &[T], factor: f64, y: &mut [f64]) {
    let (whole, rest) = y.as_chunks_mut::<LANES>();
    let (column, column_rest) = column.as_chunks::<LANES>();
    let factors = simd.splat_f64s(factor);
    for (out, values) in whole.iter_mut().zip(column) {
        let values = T::widened(values);
        for (out, values) in S::as_mut_simd_f64s(out).0.iter_mut().zip(S::as_simd_f64s(&values).0) {
            *out = simd.sub_f64s(*out, simd.mul_f64s(factors, *values));
        }
    }
    for (out, value) in rest.iter_mut().zip(column_rest) {
        *out -= factor * value.wide();
    }
}

#[inline(always)]
fn subtract_four<S: Simd, T: Stored>(simd: S, c: [&[T]; 4], f: [f64; 4], y: &mut [f64]) {
    let n = y.len();
    let (whole, rest) = y.as_chunks_mut::<LANES>();
    let [c0, c1, c2, c3] = c.map(|column| column[..n].as_chunks::<LANES>());
    let factors = f.map(|factor| simd.splat_f64s(factor));
    let columns = c0.0.iter().zip(c1.0).zip(c2.0).zip(c3.0);
    for (out, (((a0, a1), a2), a3)) in whole.iter_mut().zip(columns) {
        let a = [a0, a1, a2, a3].map(|values| T::widened(values));
        let out = S::as_mut_simd_f64s(out).0;
        for (part, out) in out.iter_mut().enumerate() {
            let product = |k: usize| simd.mul_f64s(S::as_simd_f64s(&a[k]).0[part], factors[k]);
            let sum = simd.add_f64s(simd.add_f64s(product(0), product(1)), simd.add_f64s(product(2), product(3)));
            *out = simd.sub_f64s(*out, sum);
        }
    }
    let columns = c0.1.iter().zip(c1.1).zip(c2.1).zip(c3.1);
    for (out, (((a0, a1), a2), a3)) in rest.iter_mut().zip(columns) {
        *out -= (a0.wide() * f[0] + a1.wide() * f[1]) + (a2.wide() * f[2] + a3.wide() * f[3]);
    }
}

#[inline(always)]
fn subtract_product_in<S: Simd, T: Stored>(simd: S, a: &[T], x: &[f64], y: &mut [f64]) {
    let n = y.len();
    if n == 0 {
        return;
    }
    let mut columns = a.chunks_exact(4 * n);
    let mut factors = x.chunks_exact(4);
    for (four, f) in (&mut columns).zip(&mut factors) {
        let (c0, rest) = four.split_at(n);
        let (c1, rest) = rest.split_at(n);
        let (c2, c3) = rest.split_at(n);
        subtract_four(simd, [c0, c1, c2, c3], [f[0], f[1], f[2], f[3]], y);
    }
    for (column, &factor) in columns.remainder().chunks_exact(n).zip(factors.remainder()) {
        subtract(simd, column, factor, y);
    }
}

#[inline(always)]
fn dot_in<S: Simd, T: Stored>(simd: S, a: &[T], b: &[f64]) -> f64 {
    let mut sums = [simd.splat_f64s(0.0); LANES];
    let ((first, first_rest), (second, second_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    for (x, y) in first.iter().zip(second) {
        add_product(simd, &mut sums, &T::widened(x), y);
    }
    folded(&lanes(simd, sums), first_rest, second_rest)
}

/// `sums = sums + x y`, lane by lane; the first vectors are used, as many as make the lanes.
#[inline(always)]
fn add_product<S: Simd>(simd: S, sums: &mut [S::f64s; LANES], x: &[f64; LANES], y: &[f64; LANES]) {
    let operands = S::as_simd_f64s(x).0.iter().zip(S::as_simd_f64s(y).0);
    for (sum, (x, y)) in sums.iter_mut().zip(operands) {
        *sum = simd.add_f64s(*sum, simd.mul_f64s(*x, *y));
    }
}

/// Vectors as lanes.
#[inline(always)]
fn lanes<S: Simd>(_: S, vectors: [S::f64s; LANES]) -> [f64; LANES] {
    let mut lanes = [0.0; LANES];
    S::as_mut_simd_f64s(&mut lanes).0.iter_mut().zip(vectors).for_each(|(lanes, vector)| *lanes = vector);
    lanes
}

/// Sum of all lanes and of the products that are left.
#[inline(always)]
fn folded<T: Stored>(s: &[f64; LANES], a: &[T], b: &[f64]) -> f64 {
    let tail: f64 = a.iter().zip(b).map(|(x, y)| x.wide() * y).sum();
    ((s[0] + s[4]) + (s[1] + s[5])) + ((s[2] + s[6]) + (s[3] + s[7])) + tail
}

#[inline(always)]
fn lower_solve_in<S: Simd, T: Stored>(simd: S, panel: &[T], diagonal: Diagonal, x: &mut [f64], below: &mut [f64]) {
    let (k, r) = (x.len(), below.len());
    let m = k + r;
    // Four columns at a time: their small triangle first, then the rows below all of them in one pass.
    let mut first = 0;
    while first + 4 <= k {
        let columns = &panel[first * m..(first + 4) * m];
        for j in 0..4 {
            if diagonal == Diagonal::Stored {
                x[first + j] /= columns[j * m + first + j].wide();
            }
            for i in j + 1..4 {
                x[first + i] -= columns[j * m + first + i].wide() * x[first + j];
            }
        }
        let f = [x[first], x[first + 1], x[first + 2], x[first + 3]];
        let c: [&[T]; 4] = [0, 1, 2, 3].map(|j| &columns[j * m + first + 4..(j + 1) * m]);
        let n_inside = k - first - 4;
        subtract_four(simd, c.map(|column| &column[..n_inside]), f, &mut x[first + 4..]);
        subtract_four(simd, c.map(|column| &column[n_inside..]), f, below);
        first += 4;
    }
    for j in first..k {
        let column = &panel[j * m..(j + 1) * m];
        if diagonal == Diagonal::Stored {
            x[j] /= column[j].wide();
        }
        let factor = x[j];
        subtract(simd, &column[j + 1..k], factor, &mut x[j + 1..]);
        subtract(simd, &column[k..], factor, below);
    }
}

/// [`dot_in`] with four columns at once.
#[inline(always)]
fn dot_four<S: Simd, T: Stored>(simd: S, c: [&[T]; 4], b: &[f64]) -> [f64; 4] {
    let n = b.len();
    let mut sums = [[simd.splat_f64s(0.0); LANES]; 4];
    let (whole, rest) = b.as_chunks::<LANES>();
    let [c0, c1, c2, c3] = c.map(|column| column[..n].as_chunks::<LANES>());
    let columns = c0.0.iter().zip(c1.0).zip(c2.0).zip(c3.0);
    for (y, (((a0, a1), a2), a3)) in whole.iter().zip(columns) {
        for (sums, a) in sums.iter_mut().zip([a0, a1, a2, a3]) {
            add_product(simd, sums, &T::widened(a), y);
        }
    }
    let sums = sums.map(|sums| lanes(simd, sums));
    [
        folded(&sums[0], c0.1, rest),
        folded(&sums[1], c1.1, rest),
        folded(&sums[2], c2.1, rest),
        folded(&sums[3], c3.1, rest),
    ]
}

#[inline(always)]
fn lower_transposed_solve_in<S: Simd, T: Stored>(
    simd: S,
    panel: &[T],
    diagonal: Diagonal,
    x: &mut [f64],
    below: &[f64],
) {
    let k = x.len();
    let m = k + below.len();
    // What the rows below give first, column after column as they lie in memory: they are most of a panel, and fetched
    // ahead that way.
    let (whole, rest) = x.as_chunks_mut::<4>();
    let n_whole = 4 * whole.len();
    for (four, columns) in whole.iter_mut().zip(panel.chunks_exact((4 * m).max(1))) {
        let c = [0, 1, 2, 3].map(|j| &columns[j * m + k..(j + 1) * m]);
        four.iter_mut().zip(dot_four(simd, c, below)).for_each(|(x, sum)| *x -= sum);
    }
    for (x, column) in rest.iter_mut().zip(panel[n_whole * m..].chunks_exact(m.max(1))) {
        *x -= dot_in(simd, &column[k..], below);
    }
    // Four columns at a time, as in the solve with the lower triangle.
    let mut end = k;
    while end >= 4 {
        let first = end - 4;
        let c: [&[T]; 4] = [0, 1, 2, 3].map(|j| &panel[(first + j) * m..][..k]);
        let inside = dot_four(simd, c.map(|column| &column[end..]), &x[end..]);
        for j in (0..4).rev() {
            let mut sum = x[first + j] - inside[j];
            for i in j + 1..4 {
                sum -= c[j][first + i].wide() * x[first + i];
            }
            x[first + j] = if diagonal == Diagonal::Stored { sum / c[j][first + j].wide() } else { sum };
        }
        end = first;
    }
    for j in (0..end).rev() {
        let column = &panel[j * m..][..k];
        let sum = x[j] - dot_in(simd, &column[j + 1..], &x[j + 1..]);
        x[j] = if diagonal == Diagonal::Stored { sum / column[j].wide() } else { sum };
    }
}

#[inline(always)]
fn upper_solve_in<S: Simd, T: Stored>(simd: S, panel: &[T], m: usize, x: &mut [f64]) {
    let mut end = x.len();
    // Four columns at a time, as above.
    while end >= 4 {
        let first = end - 4;
        let c: [&[T]; 4] = [0, 1, 2, 3].map(|j| &panel[(first + j) * m..][..end]);
        for j in (0..4).rev() {
            x[first + j] /= c[j][first + j].wide();
            for i in 0..j {
                x[first + i] -= c[j][first + i].wide() * x[first + j];
            }
        }
        let (above, four) = x[..end].split_at_mut(first);
        subtract_four(simd, c, [four[0], four[1], four[2], four[3]], above);
        end = first;
    }
    for j in (0..end).rev() {
        let column = &panel[j * m..j * m + end];
        x[j] /= column[j].wide();
        let factor = x[j];
        subtract(simd, &column[..j], factor, &mut x[..j]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Deterministic numbers in (-1, 1).
    fn numbers(n: usize, seed: u64) -> Vec<f64> {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((state >> 11) as f64 / (1u64 << 53) as f64) * 2.0 - 1.0
        };
        (0..n).map(|_| next()).collect()
    }

    fn close(a: &[f64], b: &[f64]) {
        for (x, y) in a.iter().zip(b) {
            assert!((x - y).abs() <= 1e-10 * (1.0 + y.abs()), "{a:?} {b:?}");
        }
    }

    #[test]
    fn sweeps_solve_their_triangles() {
        for k in 1..14 {
            for r in [0, 1, 5, 17] {
                let m = k + r;
                let mut panel = numbers(m * k, (k * 31 + r) as u64);
                for j in 0..k {
                    panel[j * m + j] += 4.0;
                }
                let at = |i: usize, j: usize| panel[j * m + i];
                let wanted = numbers(k, 7);
                let below = numbers(r, 9);
                for diagonal in [Diagonal::Stored, Diagonal::Unit] {
                    let d = |j: usize| if diagonal == Diagonal::Stored { at(j, j) } else { 1.0 };
                    let lower = |i: usize, j: usize| match i.cmp(&j) {
                        std::cmp::Ordering::Less => 0.0,
                        std::cmp::Ordering::Equal => d(j),
                        std::cmp::Ordering::Greater => at(i, j),
                    };
                    let mut x: Vec<f64> = (0..k).map(|i| (0..k).map(|j| lower(i, j) * wanted[j]).sum()).collect();
                    let mut y = below.clone();
                    lower_solve(&panel, diagonal, &mut x, &mut y);
                    close(&x, &wanted);
                    let reduced: Vec<f64> =
                        (0..r).map(|i| below[i] - (0..k).map(|j| at(k + i, j) * wanted[j]).sum::<f64>()).collect();
                    close(&y, &reduced);
                    let mut x: Vec<f64> = (0..k)
                        .map(|j| {
                            (0..k).map(|i| lower(i, j) * wanted[i]).sum::<f64>()
                                + (0..r).map(|i| at(k + i, j) * below[i]).sum::<f64>()
                        })
                        .collect();
                    lower_transposed_solve(&panel, diagonal, &mut x, &below);
                    close(&x, &wanted);
                }
                let mut x: Vec<f64> = (0..k).map(|i| (i..k).map(|j| at(i, j) * wanted[j]).sum()).collect();
                upper_solve(&panel, m, &mut x);
                close(&x, &wanted);
                let mut x: Vec<f64> = (0..k).map(|j| (0..=j).map(|i| at(i, j) * wanted[i]).sum()).collect();
                upper_transposed_solve(&panel, m, &mut x);
                close(&x, &wanted);
                let mut y = below.clone();
                let rectangle = numbers(r * k, 3);
                subtract_product(&rectangle, &wanted, &mut y);
                let direct: Vec<f64> =
                    (0..r).map(|i| below[i] - (0..k).map(|j| rectangle[j * r + i] * wanted[j]).sum::<f64>()).collect();
                close(&y, &direct);
            }
        }
    }
}
