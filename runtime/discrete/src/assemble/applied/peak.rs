//! What the arithmetic of this processor gives at most, measured: products with sums of numbers that stay in registers.

use std::hint::black_box;
use std::time::Instant;

use pulp::{Arch, Simd, WithSimd};

use crate::assemble::applied::number::Number;

/// Sums that do not wait for each other: latency times units of today's processors is 8 to 10.
const SUMS: usize = 12;
/// Passes over them; some 0.1 ms, of which the best of [`ROUNDS`] counts.
const PASSES: usize = 20_000;
const ROUNDS: usize = 50;

/// Products with sums in a second on one thread: of numbers of single and of double precision.
#[must_use]
pub fn products_per_second() -> [f64; 2] {
    [of::<f32>(), of::<f64>()]
}

#[expect(clippy::cast_precision_loss, reason = "a count")]
fn of<T: Number>() -> f64 {
    let arch = Arch::new();
    let mut best = f64::INFINITY;
    for _ in 0..ROUNDS {
        let start = Instant::now();
        black_box(arch.dispatch(Passes::<T> { factor: black_box(T::of(0.5)), line: T::Line::default() }));
        best = best.min(start.elapsed().as_secs_f64());
    }
    (SUMS * PASSES * T::LANES) as f64 / best
}

struct Passes<T: Number> {
    factor: T,
    line: T::Line,
}

impl<T: Number> WithSimd for Passes<T> {
    type Output = T::Line;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) -> T::Line {
        let factor = T::splat(simd, self.factor);
        for p in 0..T::parts::<S>() {
            let mut sums = [factor; SUMS];
            for _ in 0..PASSES {
                sums.iter_mut().for_each(|sum| *sum = T::fused(simd, *sum, *sum, factor));
            }
            for sum in sums {
                let total = T::fused(simd, T::load::<S>(&self.line, p), sum, factor);
                T::store::<S>(&mut self.line, p, total);
            }
        }
        self.line
    }
}
