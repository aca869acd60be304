//! Numbers of a factor as they are stored, in one of two precisions.

use pulp::Simd;

/// Lanes of a dot product.
pub(super) const LANES: usize = 8;

/// A number of a factor as it is stored.
pub trait Stored: Copy + Default + Send + Sync + 'static {
    /// Unit roundoff.
    const ROUNDOFF: f64;
    /// A machine vector of them.
    type Vector<S: Simd>: Copy;

    /// In double precision.
    fn wide(self) -> f64;

    /// As many as the longest vector holds, in double precision.
    fn widened(values: &[Self; LANES]) -> [f64; LANES];

    /// The nearest one.
    fn nearest(value: f64) -> Self;

    /// As many whole vectors as there are, and the rest.
    fn vectors<S: Simd>(values: &[Self]) -> (&[Self::Vector<S>], &[Self]);

    /// As [`Stored::vectors`].
    fn vectors_mut<S: Simd>(values: &mut [Self]) -> (&mut [Self::Vector<S>], &mut [Self]);

    /// The same number in all lanes.
    fn splat<S: Simd>(simd: S, value: Self) -> Self::Vector<S>;

    /// `sum + a b`, rounded once where the processor can.
    fn fused<S: Simd>(simd: S, sum: Self::Vector<S>, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;
}

macro_rules! stored {
    ($number:ty, $vector:ident, $as_simd:ident, $as_mut_simd:ident, $splat:ident, $fused:ident) => {
        impl Stored for $number {
            const ROUNDOFF: f64 = <$number>::EPSILON as f64 / 2.0;
            type Vector<S: Simd> = S::$vector;

            #[inline(always)]
            fn wide(self) -> f64 {
                f64::from(self)
            }

            #[inline(always)]
            fn widened(values: &[Self; LANES]) -> [f64; LANES] {
                values.map(f64::from)
            }

            #[inline(always)]
            fn nearest(value: f64) -> Self {
                value as Self
            }

            #[inline(always)]
            fn vectors<S: Simd>(values: &[Self]) -> (&[Self::Vector<S>], &[Self]) {
                S::$as_simd(values)
            }

            #[inline(always)]
            fn vectors_mut<S: Simd>(values: &mut [Self]) -> (&mut [Self::Vector<S>], &mut [Self]) {
                S::$as_mut_simd(values)
            }

            #[inline(always)]
            fn splat<S: Simd>(simd: S, value: Self) -> Self::Vector<S> {
                simd.$splat(value)
            }

            #[inline(always)]
            fn fused<S: Simd>(
                simd: S,
                sum: Self::Vector<S>,
                a: Self::Vector<S>,
                b: Self::Vector<S>,
            ) -> Self::Vector<S> {
                simd.$fused(a, b, sum)
            }
        }
    };
}

stored!(f64, f64s, as_simd_f64s, as_mut_simd_f64s, splat_f64s, mul_add_e_f64s);
stored!(f32, f32s, as_simd_f32s, as_mut_simd_f32s, splat_f32s, mul_add_e_f32s);
