//! Exponential and principal logarithm of 1 by 1 to 3 by 3 matrices, with their Frechet derivatives.
//!
//! - `exp(A) = exp(A/2^s)^(2^s)` with a Taylor series at norm at most 1; its derivative is the derivative of that
//!   program in each entry (powers: `d(A^k) = dA A^(k-1) + A d(A^(k-1))`, squarings: `d(X^2) = dX X + X dX`).
//! - `log(A) = 2^k log(A^(1/2^k))`: square roots by the product form of the Denman-Beavers iteration (Cheng, Higham,
//!   Kenney, Laub 2001), then `log(I + X) = 2 atanh(Z)`, `Z = X (2 I + X)^-1`. `X = A^(1/2^k) - I` is
//!   `(A - I) prod (A^(1/2^i) + I)^-1`, which keeps the digits that subtraction from the root would lose. Derivative:
//!   `S dS + dS S = dA` for each root.
//!
//! Entries stand column by column. Generic over [`Real`]: series lengths follow its rounding error.
//! Promises: NaN in all results when an entry is not finite or, for the logarithm, when an eigenvalue is zero or a
//! negative real number; no allocation; no panic for n from 1 to 3.
//! It does not use symmetry: a symmetric argument gives a result that is symmetric up to rounding.

use crate::{
    compare::Compare,
    math::{MathFn1, MatrixFn},
    real::Real,
};

/// Most results of a matrix function: the Frechet derivative of a 3 by 3 matrix.
pub(crate) const MAX_RESULTS: usize = 81;

/// Column by column; only the first `n * n` entries count.
type Matrix<T> = [T; 9];
/// A linear map between matrices: entry `k` of `map[l]` is the derivative of entry k in entry l.
type Map<T> = [Matrix<T>; 9];

impl MatrixFn {
    /// Evaluates the function of an n by n matrix.
    ///
    /// Shapes: `entries` holds `n * n` numbers, `results` `self.n_results(n)`, both column by column.
    ///
    /// # Panics
    /// If `n` is not 1, 2 or 3 or a slice is shorter than that.
    pub fn eval<T: Real>(self, n: usize, entries: &[T], results: &mut [T]) {
        assert!((1..=3).contains(&n), "matrix functions exist for 1 to 3 rows");
        let size = n * n;
        let mut a = [T::from_f64(0.0); 9];
        a[..size].copy_from_slice(&entries[..size]);
        let results = &mut results[..self.n_results(n)];
        if !entries[..size].iter().all(|x| x.is_finite()) {
            results.fill(T::from_f64(f64::NAN));
            return;
        }
        let found = match n {
            1 => Space::<1>.eval(self, &a, results),
            2 => Space::<2>.eval(self, &a, results),
            _ => Space::<3>.eval(self, &a, results),
        };
        if found.is_none() {
            results.fill(T::from_f64(f64::NAN));
        }
    }
}

fn copy_map<T: Real>(map: &Map<T>, size: usize, results: &mut [T]) {
    for (column, out) in map.iter().zip(results.chunks_exact_mut(size)) {
        out.copy_from_slice(&column[..size]);
    }
}

/// The algebra of N by N matrices. N is known to the compiler, which makes it three times faster than a variable.
#[derive(Clone, Copy)]
struct Space<const N: usize>;

/// How often the root is taken or the matrix halved at most: beyond, an f64 would be out of range.
const MAX_HALVINGS: usize = 1100;
/// Square roots are taken until the matrix is this close to the identity.
const NEAR_IDENTITY: f64 = 0.25;
/// Steps of one square root: balanced, it needs about 8.
const MAX_ROOT_STEPS: usize = 60;

impl<const N: usize> Space<N> {
    /// `None` where the function does not exist.
    fn eval<T: Real>(self, f: MatrixFn, a: &Matrix<T>, results: &mut [T]) -> Option<()> {
        match f {
            MatrixFn::Expm => results.copy_from_slice(&self.expm(a)[..N * N]),
            MatrixFn::ExpmDerivative => copy_map(&self.expm_derivative(a), N * N, results),
            MatrixFn::Logm => results.copy_from_slice(&self.logm(a)?[..N * N]),
            MatrixFn::LogmDerivative => copy_map(&self.logm_derivative(a)?, N * N, results),
        }
        Some(())
    }

    fn identity<T: Real>(self) -> Matrix<T> {
        let mut out = [T::from_f64(0.0); 9];
        for i in 0..N {
            out[i * (N + 1)] = T::from_f64(1.0);
        }
        out
    }

    /// The map that leaves every matrix as it is: column l is the unit matrix of entry l.
    fn identity_map<T: Real>(self) -> Map<T> {
        let mut out = [[T::from_f64(0.0); 9]; 9];
        for (l, column) in out.iter_mut().enumerate().take(N * N) {
            column[l] = T::from_f64(1.0);
        }
        out
    }

    fn mul<T: Real>(self, a: &Matrix<T>, b: &Matrix<T>) -> Matrix<T> {
        let mut out = [T::from_f64(0.0); 9];
        for j in 0..N {
            for i in 0..N {
                let mut sum = a[i].mul(b[N * j]);
                for k in 1..N {
                    sum = sum.add(a[i + N * k].mul(b[k + N * j]));
                }
                out[i + N * j] = sum;
            }
        }
        out
    }

    fn add<T: Real>(self, a: &Matrix<T>, b: &Matrix<T>) -> Matrix<T> {
        let mut out = *a;
        out[..N * N].iter_mut().zip(b).for_each(|(x, y)| *x = x.add(*y));
        out
    }

    fn scale<T: Real>(self, a: &Matrix<T>, c: f64) -> Matrix<T> {
        self.times(a, T::from_f64(c))
    }

    fn times<T: Real>(self, a: &Matrix<T>, c: T) -> Matrix<T> {
        let mut out = *a;
        out[..N * N].iter_mut().for_each(|x| *x = x.mul(c));
        out
    }

    /// `a + c I`
    fn shift<T: Real>(self, a: &Matrix<T>, c: f64) -> Matrix<T> {
        let mut out = *a;
        for i in 0..N {
            let k = i * (N + 1);
            out[k] = out[k].add(T::from_f64(c));
        }
        out
    }

    /// `da b + a db`
    fn product_rule<T: Real>(self, a: &Matrix<T>, da: &Matrix<T>, b: &Matrix<T>, db: &Matrix<T>) -> Matrix<T> {
        self.add(&self.mul(da, b), &self.mul(a, db))
    }

    /// Largest column sum of absolute values, as an f64.
    fn norm<T: Real>(self, a: &Matrix<T>) -> f64 {
        let column = |j: usize| (0..N).map(|i| a[i + N * j].to_f64().abs()).sum::<f64>();
        (0..N).map(column).fold(0.0, |m, x| if x > m || x.is_nan() { x } else { m })
    }

    /// Inverse by elimination with row exchange; `None` when a pivot vanishes.
    fn inverse<T: Real>(self, a: &Matrix<T>) -> Option<Matrix<T>> {
        let mut system = [T::from_f64(0.0); 9];
        system.copy_from_slice(a);
        let mut columns: [Matrix<T>; 9] = [[T::from_f64(0.0); 9]; 9];
        for (j, column) in columns.iter_mut().enumerate().take(N) {
            column[j] = T::from_f64(1.0);
        }
        solve(&mut system, N, &mut columns[..N])?;
        let mut out = *a;
        for j in 0..N {
            out[N * j..N * (j + 1)].copy_from_slice(&columns[j][..N]);
        }
        Some(out)
    }

    /// How often A must be halved to have a norm of at most 1.
    fn halvings<T: Real>(self, a: &Matrix<T>) -> usize {
        let mut norm = self.norm(a);
        let mut count = 0;
        while norm > 1.0 && count < MAX_HALVINGS {
            norm *= 0.5;
            count += 1;
        }
        count
    }

    /// A after `count` halvings.
    fn halved<T: Real>(self, a: &Matrix<T>, count: usize) -> Matrix<T> {
        // In two factors, each a normal number.
        let half = -(f64::from(u16::try_from(count).unwrap_or(u16::MAX)));
        let first = libm::trunc(half / 2.0);
        self.scale(&self.scale(a, libm::exp2(first)), libm::exp2(half - first))
    }

    /// Terms of the exponential series at norm 1: until 1/k! is below the rounding error.
    fn exponential_terms<T: Real>() -> usize {
        let (mut term, mut k) = (1.0, 0_u32);
        while term > 0.1 * T::UNIT_ROUNDOFF {
            k += 1;
            term /= f64::from(k);
        }
        k as usize
    }

    fn expm<T: Real>(self, a: &Matrix<T>) -> Matrix<T> {
        if N == 1 {
            let mut out = *a;
            out[0] = a[0].call1(MathFn1::Exp);
            return out;
        }
        let halvings = self.halvings(a);
        let b = self.halved(a, halvings);
        // Horner: I + B (I + B/2 (I + B/3 (...))).
        let mut x = self.identity();
        for k in (1..=Self::exponential_terms::<T>()).rev() {
            x = self.shift(&self.times(&self.mul(&b, &x), reciprocal(k)), 1.0);
        }
        for _ in 0..halvings {
            x = self.mul(&x, &x);
        }
        x
    }

    fn expm_derivative<T: Real>(self, a: &Matrix<T>) -> Map<T> {
        let mut map = self.identity_map();
        if N == 1 {
            map[0][0] = a[0].call1(MathFn1::Exp);
            return map;
        }
        let halvings = self.halvings(a);
        let b = self.halved(a, halvings);
        let directions: Map<T> = map.map(|e| self.halved(&e, halvings));
        let mut x = self.identity();
        map = [[T::from_f64(0.0); 9]; 9];
        for k in (1..=Self::exponential_terms::<T>()).rev() {
            let over_k = |m: &Matrix<T>| self.times(m, reciprocal(k));
            for (dx, db) in map.iter_mut().zip(&directions).take(N * N) {
                *dx = over_k(&self.product_rule(&b, db, &x, dx));
            }
            x = self.shift(&over_k(&self.mul(&b, &x)), 1.0);
        }
        for _ in 0..halvings {
            for dx in map.iter_mut().take(N * N) {
                *dx = self.product_rule(&x, dx, &x, dx);
            }
            x = self.mul(&x, &x);
        }
        map
    }

    fn logm<T: Real>(self, a: &Matrix<T>) -> Option<Matrix<T>> {
        if N == 1 {
            let mut out = *a;
            out[0] = a[0].call1(MathFn1::Log);
            return is_positive(a[0]).then_some(out);
        }
        let reduced = self.take_roots(a, |_| Some(()))?;
        let z = self.mul(&reduced.x, &self.inverse(&self.shift(&reduced.x, 2.0))?);
        Some(self.scale(&self.arctanh(&z, &mut []), 2.0 * reduced.power))
    }

    fn logm_derivative<T: Real>(self, a: &Matrix<T>) -> Option<Map<T>> {
        let mut map = self.identity_map();
        if N == 1 {
            map[0][0] = T::from_f64(1.0).div(a[0]);
            return is_positive(a[0]).then_some(map);
        }
        let reduced = self.take_roots(a, |root| self.root_derivative(root, &mut map))?;
        let inverse = self.inverse(&self.shift(&reduced.x, 2.0))?;
        let z = self.mul(&reduced.x, &inverse);
        // Z (2 I + X) = X, so dZ (2 I + X) = (I - Z) dX.
        let rest = self.shift(&self.scale(&z, -1.0), 1.0);
        for d in map.iter_mut().take(N * N) {
            *d = self.mul(&self.mul(&rest, d), &inverse);
        }
        self.arctanh(&z, &mut map[..N * N]);
        Some(map.map(|d| self.scale(&d, 2.0 * reduced.power)))
    }

    /// `atanh(Z) = Z + Z^3/3 + Z^5/5 + ...` for small Z; turns each direction `dZ` into the derivative.
    fn arctanh<T: Real>(self, z: &Matrix<T>, directions: &mut [Matrix<T>]) -> Matrix<T> {
        let square = self.mul(z, z);
        let (rate, mut term, mut n_terms) = (self.norm(&square), 1.0, 1);
        while term > 0.1 * T::UNIT_ROUNDOFF && n_terms < 200 {
            term *= rate;
            n_terms += 1;
        }
        let coefficient = |k: usize| reciprocal(2 * k + 1);
        let plus = |m: &Matrix<T>, c: T| {
            let mut out = *m;
            for i in 0..N {
                out[i * (N + 1)] = m[i * (N + 1)].add(c);
            }
            out
        };
        // Horner in W = Z^2 for the sum, whose product with Z is the result.
        let zero = [T::from_f64(0.0); 9];
        let mut sum = plus(&zero, coefficient(n_terms));
        let mut slopes: Map<T> = [zero; 9];
        for k in (0..n_terms).rev() {
            for (slope, dz) in slopes.iter_mut().zip(directions.iter()) {
                let d_square = self.product_rule(z, dz, z, dz);
                *slope = self.product_rule(&square, &d_square, &sum, slope);
            }
            sum = plus(&self.mul(&square, &sum), coefficient(k));
        }
        for (slope, dz) in slopes.iter().zip(directions) {
            *dz = self.product_rule(z, dz, &sum, slope);
        }
        self.mul(z, &sum)
    }

    /// Takes square roots until the matrix is near the identity; `each` sees every root, the last one last.
    fn take_roots<T: Real>(self, a: &Matrix<T>, mut each: impl FnMut(&Matrix<T>) -> Option<()>) -> Option<Roots<T>> {
        if self.has_negative_eigenvalue(a) {
            return None;
        }
        let mut root = *a;
        let mut out = Roots { x: self.shift(a, -1.0), power: 1.0 };
        for _ in 0..MAX_HALVINGS {
            let distance = self.norm(&out.x);
            if distance <= NEAR_IDENTITY {
                return Some(out);
            }
            if !distance.is_finite() {
                return None;
            }
            root = self.square_root(&root)?;
            each(&root)?;
            // A - I = (A^(1/2) - I)(A^(1/2) + I)
            out.x = self.mul(&out.x, &self.inverse(&self.shift(&root, 1.0))?);
            out.power *= 2.0;
        }
        None
    }

    /// Principal square root: M = A, Y = A; Y <- m Y (I + M^-1/m^2) / 2, M <- (I + (m^2 M + M^-1/m^2)/2) / 2.
    /// M tends to I, Y to the root; the factor m balances M and its inverse as long as they are far from I.
    fn square_root<T: Real>(self, a: &Matrix<T>) -> Option<Matrix<T>> {
        let (mut m, mut y) = (*a, *a);
        for _ in 0..MAX_ROOT_STEPS {
            let distance = self.norm(&self.shift(&m, -1.0));
            let inverse = self.inverse(&m)?;
            let balance = self.norm(&inverse) / self.norm(&m);
            // A power of 4: it and its root and inverse are exact in every precision.
            let square = libm::exp2(2.0 * libm::rint(0.25 * libm::log2(balance)));
            let square = if distance > 0.5 { square } else { 1.0 };
            if !square.is_finite() || square == 0.0 {
                return None;
            }
            let down = self.scale(&inverse, 1.0 / square);
            y = self.mul(&self.scale(&y, 0.5 * square.sqrt()), &self.shift(&down, 1.0));
            m = self.scale(&self.shift(&self.scale(&self.add(&self.scale(&m, square), &down), 0.5), 1.0), 0.5);
            // Quadratic: this step has squared the distance.
            if distance * distance < T::UNIT_ROUNDOFF {
                return Some(y);
            }
        }
        None
    }

    /// Turns directions of A into directions of its root S: `S dS + dS S = dA`.
    fn root_derivative<T: Real>(self, root: &Matrix<T>, map: &mut Map<T>) -> Option<()> {
        let size = N * N;
        let mut system = [T::from_f64(0.0); 81];
        for j in 0..N {
            for i in 0..N {
                for k in 0..N {
                    // Row (i, j): sum_k S_ik dS_kj + dS_ik S_kj.
                    let row = i + N * j;
                    let (first, second) = (row + size * (k + N * j), row + size * (i + N * k));
                    system[first] = system[first].add(root[i + N * k]);
                    system[second] = system[second].add(root[k + N * j]);
                }
            }
        }
        solve(&mut system, size, &mut map[..size])
    }

    /// Whether an eigenvalue is zero or a negative real number, from the coefficients of
    /// `det(A + t I) = t^n + c2 t^(n-1) + ...`: it has a root t >= 0.
    fn has_negative_eigenvalue<T: Real>(self, a: &Matrix<T>) -> bool {
        // A positive factor changes no sign and keeps the determinant in range.
        let mut b = [0.0; 9];
        let norm = self.norm(a);
        for (x, y) in b.iter_mut().zip(a) {
            *x = y.to_f64() / norm;
        }
        let minor = |i: usize, j: usize| {
            let at = |r: usize, c: usize| b[r + N * c];
            at(i, i) * at(j, j) - at(i, j) * at(j, i)
        };
        if N == 2 {
            let (half_trace, det) = (0.5 * (b[0] + b[3]), minor(0, 1));
            return det.is_nan() || det <= 0.0 || (half_trace < 0.0 && half_trace * half_trace >= det);
        }
        let trace = b[0] + b[4] + b[8];
        let minors = minor(0, 1) + minor(0, 2) + minor(1, 2);
        let det = b[0] * (b[4] * b[8] - b[7] * b[5]) - b[3] * (b[1] * b[8] - b[7] * b[2])
            + b[6] * (b[1] * b[5] - b[4] * b[2]);
        if det.is_nan() || det <= 0.0 {
            return true;
        }
        // Smallest value of t^3 + trace t^2 + minors t + det on t > 0.
        let discriminant = trace * trace - 3.0 * minors;
        if discriminant < 0.0 {
            return false;
        }
        let t = (discriminant.sqrt() - trace) / 3.0;
        t > 0.0 && ((t + trace) * t + minors) * t + det <= 0.0
    }
}

fn reciprocal<T: Real>(k: usize) -> T {
    T::from_f64(1.0).div(T::from_f64(k as f64))
}

fn is_positive<T: Real>(x: T) -> bool {
    T::from_f64(0.0).compare(Compare::Less, x)
}

/// What is left of a matrix after its square roots.
struct Roots<T> {
    /// `A^(1/power) - I`
    x: Matrix<T>,
    /// 2 to the number of roots.
    power: f64,
}

/// Solves `system * x = column` for every one of `columns` in place; `system` is `n` by `n`, column by column.
/// Elimination with row exchange; `None` when a pivot is zero or not finite.
fn solve<T: Real>(system: &mut [T], n: usize, columns: &mut [Matrix<T>]) -> Option<()> {
    for k in 0..n {
        let size = |row: usize| system[row + n * k].to_f64().abs();
        let pivot = (k + 1..n).fold(k, |best, row| if size(row) > size(best) { row } else { best });
        if size(pivot) == 0.0 || !size(pivot).is_finite() {
            return None;
        }
        for column in k..n {
            system.swap(k + n * column, pivot + n * column);
        }
        for column in columns.iter_mut() {
            column.swap(k, pivot);
        }
        for row in k + 1..n {
            let factor = system[row + n * k].div(system[k + n * k]);
            for column in k + 1..n {
                system[row + n * column] = system[row + n * column].sub(factor.mul(system[k + n * column]));
            }
            for column in columns.iter_mut() {
                column[row] = column[row].sub(factor.mul(column[k]));
            }
        }
    }
    for column in columns.iter_mut() {
        for k in (0..n).rev() {
            let mut x = column[k];
            for j in k + 1..n {
                x = x.sub(system[k + n * j].mul(column[j]));
            }
            column[k] = x.div(system[k + n * k]);
        }
    }
    Some(())
}

#[cfg(test)]
mod tests;
