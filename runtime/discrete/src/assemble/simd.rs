//! Numbers of a batch as machine vectors.
//!
//! A [`Lanes`] is one vector where the processor has vectors of eight numbers, and [`parts`] shorter ones elsewhere;
//! code that works on part after part gives every lane the same operations on every processor. Which instructions the
//! processor has is found out at run time by `pulp`.

use std::ops::{Deref, DerefMut};

use pulp::Simd;
use wfl_compiler::ir::LANES;

/// One number per entity of a batch, in a line of the cache of its own: a vector that lies across two lines takes twice
/// as long to read, and longer to write.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Lanes(pub [f64; LANES]);

impl Deref for Lanes {
    type Target = [f64; LANES];

    #[inline(always)]
    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl DerefMut for Lanes {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}

impl Default for Lanes {
    fn default() -> Self {
        ZERO
    }
}

/// Zero in every lane.
pub(super) const ZERO: Lanes = Lanes([0.0; LANES]);

/// Vectors that hold the lanes of one number.
#[inline(always)]
pub(super) const fn parts<S: Simd>() -> usize {
    LANES / S::F64_LANES
}

/// Part `p` of a number.
#[inline(always)]
pub(super) fn load<S: Simd>(lanes: &Lanes, p: usize) -> S::f64s {
    S::as_simd_f64s(&**lanes).0[p]
}

/// Writes part `p` of a number.
#[inline(always)]
pub(super) fn store<S: Simd>(lanes: &mut Lanes, p: usize, value: S::f64s) {
    S::as_mut_simd_f64s(&mut **lanes).0[p] = value;
}

/// `sum + a * b`, rounded twice: what feeds geometry and point laws must be the same bits on every processor, and
/// products that cancel must leave zero.
#[inline(always)]
pub(super) fn plus_product<S: Simd>(simd: S, sum: S::f64s, a: S::f64s, b: S::f64s) -> S::f64s {
    simd.add_f64s(sum, simd.mul_f64s(a, b))
}

/// `sum + a * b`, rounded once where the processor can.
#[inline(always)]
pub(super) fn fused<S: Simd>(simd: S, sum: S::f64s, a: S::f64s, b: S::f64s) -> S::f64s {
    if S::IS_SCALAR { plus_product(simd, sum, a, b) } else { simd.mul_add_e_f64s(a, b, sum) }
}
