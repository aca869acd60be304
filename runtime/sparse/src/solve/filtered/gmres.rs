//! Flexible GMRES (Saad 1993) for vectors that are too long for one thread and for many of double precision.
//!
//! The basis is of single precision (Aliaga, Anzt, Grützmacher, Quintana-Ortí and Tomás, Compressed basis GMRES, 2023):
//! it only says how to combine the preconditioned directions, whose products with the matrix are of double precision. A
//! cycle therefore ends where it has reduced the residual by [`OF_A_CYCLE`], and the next one begins with the true residual.
//!
//! Promises: the same bits for any number of threads; the number of iterations whether or not they converged. Does not
//! check the solution.

use rayon::prelude::*;

/// Numbers in one task of a vector operation.
const CHUNK: usize = 8192;
/// Most directions of a cycle: 12 bytes for each unknown and direction.
const RESTART: usize = 50;
/// What a cycle may leave of its residual: some digits above the rounding of the basis.
const OF_A_CYCLE: f64 = 1e-5;
/// Where orthogonalisation takes away all but this part of a vector, what is left is made orthogonal once more (Daniel,
/// Gragg, Kaufman and Stewart 1976).
const ONCE_MORE: f64 = 0.7;

/// The matrix and the preconditioner.
pub(super) trait Operators {
    /// `y = A x`.
    fn multiply(&mut self, x: &[f64], y: &mut [f64]);

    /// `z` near `A⁻¹ r`; it need not be a linear operator.
    fn precondition(&mut self, r: &[f64], z: &mut [f64]);
}

/// What an iteration did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Outcome {
    pub(super) iterations: usize,
    pub(super) converged: bool,
}

/// Work space.
#[derive(Debug, Clone, Default)]
pub(super) struct FlexibleGmres {
    basis: Vec<Vec<f32>>,
    directions: Vec<Vec<f64>>,
    /// Upper Hessenberg matrix after rotation, column after column.
    hessenberg: Vec<Vec<f64>>,
    rotations: Vec<(f64, f64)>,
    reduced: Vec<f64>,
    residual: Vec<f64>,
    product: Vec<f64>,
}

impl FlexibleGmres {
    /// Solves `A x = b` from zero until the 2-norm of the residual is `target`, in at most so many iterations.
    pub(super) fn solve(
        &mut self,
        operators: &mut dyn Operators,
        b: &[f64],
        x: &mut [f64],
        target: f64,
        most: usize,
    ) -> Outcome {
        x.fill(0.0);
        self.residual.clear();
        self.residual.extend_from_slice(b);
        self.product.resize(b.len(), 0.0);
        let (mut iterations, mut before) = (0, f64::INFINITY);
        loop {
            let size = norm_2(&self.residual).sqrt();
            if size <= target {
                return Outcome { iterations, converged: true };
            }
            // a cycle that gains nothing is the last
            if iterations >= most || !size.is_finite() || size > 0.5 * before {
                return Outcome { iterations, converged: false };
            }
            before = size;
            let (done, reached) = self.cycle(operators, size, target, most - iterations);
            iterations += done;
            self.add_correction(done, x);
            if reached <= target {
                return Outcome { iterations, converged: true };
            }
            operators.multiply(x, &mut self.product);
            let parts = (self.residual.par_chunks_mut(CHUNK), b.par_chunks(CHUNK), self.product.par_chunks(CHUNK));
            parts.into_par_iter().for_each(|(r, b, product)| {
                r.iter_mut().zip(b).zip(product).for_each(|((r, b), product)| *r = b - product);
            });
        }
    }

    /// One cycle from the residual of this size: directions found, and what the recursion says of the residual.
    fn cycle(&mut self, operators: &mut dyn Operators, size: f64, target: f64, allowed: usize) -> (usize, f64) {
        let n = self.residual.len();
        let target = target.max(OF_A_CYCLE * size);
        self.rotations.clear();
        self.hessenberg.clear();
        self.reduced.clear();
        self.reduced.push(size);
        self.room(0, n);
        normalise(&self.residual, size, &mut self.basis[0]);
        for step in 0..RESTART.min(allowed) {
            self.room(step + 1, n);
            // the basis vector in double precision
            widen(&self.basis[step], &mut self.residual);
            operators.precondition(&self.residual, &mut self.directions[step]);
            operators.multiply(&self.directions[step], &mut self.product);
            let (column, length) = orthogonalise(&self.basis[..=step], &mut self.product);
            if length > 0.0 && length.is_finite() {
                normalise(&self.product, length, &mut self.basis[step + 1]);
            }
            self.rotate(column, length);
            let reached = self.reduced[step + 1].abs();
            if self.hessenberg[step][step] == 0.0 {
                // a direction in the null space reduces nothing, whatever the recursion says
                return (step + 1, size);
            }
            if reached <= target || length == 0.0 || !length.is_finite() {
                return (step + 1, reached);
            }
        }
        let done = self.hessenberg.len();
        (done, self.reduced[done].abs())
    }

    /// Applies the old rotations to a new column, whose last entry is `below`, and a new one that clears that.
    fn rotate(&mut self, mut column: Vec<f64>, below: f64) {
        for (i, &(c, s)) in self.rotations.iter().enumerate() {
            let (a, b) = (column[i], column[i + 1]);
            (column[i], column[i + 1]) = (c * a + s * b, c * b - s * a);
        }
        let last = self.rotations.len();
        let length = column[last].hypot(below);
        let (c, s) = if length > 0.0 { (column[last] / length, below / length) } else { (1.0, 0.0) };
        column[last] = length;
        let before = self.reduced[last];
        self.reduced[last] = c * before;
        self.reduced.push(-s * before);
        self.rotations.push((c, s));
        self.hessenberg.push(column);
    }

    /// `x` plus the combination of the directions that leaves the smallest residual.
    fn add_correction(&self, directions: usize, x: &mut [f64]) {
        let mut factors = self.reduced[..directions].to_vec();
        for i in (0..directions).rev() {
            let diagonal = self.hessenberg[i][i];
            factors[i] = if diagonal == 0.0 { 0.0 } else { factors[i] / diagonal };
            for j in 0..i {
                factors[j] -= self.hessenberg[i][j] * factors[i];
            }
        }
        x.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, x)| {
            for (factor, direction) in factors.iter().zip(&self.directions) {
                let own = &direction[chunk * CHUNK..][..x.len()];
                x.iter_mut().zip(own).for_each(|(x, d)| *x += factor * d);
            }
        });
    }

    /// Makes room for basis vector `place` and the direction before it.
    fn room(&mut self, place: usize, n: usize) {
        while self.basis.len() <= place {
            self.basis.push(Vec::new());
        }
        self.basis[place].resize(n, 0.0);
        while self.directions.len() < place {
            self.directions.push(Vec::new());
        }
        if place > 0 {
            self.directions[place - 1].resize(n, 0.0);
        }
    }
}

/// `out = x / size`, rounded.
fn normalise(x: &[f64], size: f64, out: &mut [f32]) {
    let factor = 1.0 / size;
    out.par_chunks_mut(CHUNK).zip(x.par_chunks(CHUNK)).for_each(|(out, x)| {
        out.iter_mut().zip(x).for_each(|(out, x)| *out = (x * factor) as f32);
    });
}

fn widen(x: &[f32], out: &mut [f64]) {
    out.par_chunks_mut(CHUNK).zip(x.par_chunks(CHUNK)).for_each(|(out, x)| {
        out.iter_mut().zip(x).for_each(|(out, x)| *out = f64::from(*x));
    });
}

/// Makes `w` orthogonal to a basis (classical Gram and Schmidt): the products, with an entry to spare, and the norm that is left.
fn orthogonalise(basis: &[Vec<f32>], w: &mut [f64]) -> (Vec<f64>, f64) {
    let mut column = products(basis, w);
    let before = column.iter().map(|part| part * part).sum::<f64>();
    let mut left = subtract(basis, &column, w);
    if left < ONCE_MORE * ONCE_MORE * (left + before) {
        let more = products(basis, w);
        left = subtract(basis, &more, w);
        column.iter_mut().zip(&more).for_each(|(sum, more)| *sum += more);
    }
    column.push(0.0);
    (column, left.sqrt())
}

/// The products of `w` with each vector of a basis.
fn products(basis: &[Vec<f32>], w: &[f64]) -> Vec<f64> {
    let of_chunk = |(chunk, w): (usize, &[f64])| -> Vec<f64> {
        basis.iter().map(|v| dot(&v[chunk * CHUNK..][..w.len()], w)).collect()
    };
    let parts: Vec<Vec<f64>> = w.par_chunks(CHUNK).enumerate().map(of_chunk).collect();
    let mut sums = vec![0.0; basis.len()];
    parts.iter().for_each(|part| sums.iter_mut().zip(part).for_each(|(sum, part)| *sum += part));
    sums
}

/// `w` less a combination of a basis; the square of its norm then.
fn subtract(basis: &[Vec<f32>], factors: &[f64], w: &mut [f64]) -> f64 {
    let of_chunk = |(chunk, w): (usize, &mut [f64])| -> f64 {
        for (v, factor) in basis.iter().zip(factors) {
            let own = &v[chunk * CHUNK..][..w.len()];
            w.iter_mut().zip(own).for_each(|(w, v)| *w -= factor * f64::from(*v));
        }
        square(w)
    };
    let parts: Vec<f64> = w.par_chunks_mut(CHUNK).enumerate().map(of_chunk).collect();
    parts.iter().sum()
}

/// The square of the 2-norm.
pub(super) fn norm_2(x: &[f64]) -> f64 {
    let parts: Vec<f64> = x.par_chunks(CHUNK).map(square).collect();
    parts.iter().sum()
}

fn square(x: &[f64]) -> f64 {
    let mut sums = [0.0f64; 8];
    let (eights, rest) = x.as_chunks::<8>();
    for x in eights {
        (0..8).for_each(|k| sums[k] += x[k] * x[k]);
    }
    sums.iter().sum::<f64>() + rest.iter().map(|x| x * x).sum::<f64>()
}

fn dot(v: &[f32], w: &[f64]) -> f64 {
    let mut sums = [0.0f64; 8];
    let ((v, of_v), (w, of_w)) = (v.as_chunks::<8>(), w.as_chunks::<8>());
    for (v, w) in v.iter().zip(w) {
        (0..8).for_each(|k| sums[k] += f64::from(v[k]) * w[k]);
    }
    sums.iter().sum::<f64>() + of_v.iter().zip(of_w).map(|(v, w)| f64::from(*v) * w).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The 1-D Laplacian of n unknowns plus an upwind term, with its diagonal as preconditioner.
    struct Upwind(f64);

    impl Operators for Upwind {
        fn multiply(&mut self, x: &[f64], y: &mut [f64]) {
            let at = |i: usize| x.get(i).copied().unwrap_or(0.0);
            for (i, out) in y.iter_mut().enumerate() {
                *out = 2.0 * x[i] - (1.0 + self.0) * at(i.wrapping_sub(1)) - (1.0 - self.0) * at(i + 1);
            }
        }

        fn precondition(&mut self, r: &[f64], z: &mut [f64]) {
            r.iter().zip(z).for_each(|(r, z)| *z = r / 2.0);
        }
    }

    #[test]
    fn more_digits_are_reached_than_the_basis_has() {
        let wanted: Vec<f64> = (0..40).map(|i| f64::from(i % 3) - 0.5).collect();
        let (mut b, mut x) = (vec![0.0; 40], vec![0.0; 40]);
        Upwind(0.7).multiply(&wanted, &mut b);
        let outcome = FlexibleGmres::default().solve(&mut Upwind(0.7), &b, &mut x, 1e-13, 500);
        assert!(outcome.converged, "{outcome:?}");
        let missed = x.iter().zip(&wanted).fold(0.0, |largest: f64, (x, w)| largest.max((x - w).abs()));
        assert!(missed < 1e-11, "{missed:e}, {outcome:?}");
    }

    #[test]
    fn a_matrix_that_is_zero_comes_to_an_end() {
        struct Zero;
        impl Operators for Zero {
            fn multiply(&mut self, _x: &[f64], y: &mut [f64]) {
                y.fill(0.0);
            }
            fn precondition(&mut self, r: &[f64], z: &mut [f64]) {
                z.copy_from_slice(r);
            }
        }
        let mut x = [0.0];
        let outcome = FlexibleGmres::default().solve(&mut Zero, &[1.0], &mut x, 1e-10, 100);
        assert!(!outcome.converged && outcome.iterations <= 2 && x[0].is_finite(), "{outcome:?} {x:?}");
    }
}
