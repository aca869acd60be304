//! Numbers of single and of double precision in lines of the cache, one entity a lane.
//!
//! A line is one vector of the widest processors, 16 or 8 numbers, and several shorter ones elsewhere.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use pulp::Simd;
use zerocopy::{FromBytes, IntoBytes};

use crate::assemble::{shared, simd::Lanes};

/// Numbers of single precision in a line of the cache.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub(crate) struct Singles(pub(super) [f32; 16]);

impl Default for Singles {
    fn default() -> Self {
        Self([0.0; 16])
    }
}

/// Numbers of a precision.
pub(crate) trait Number: Copy + Default + Send + Sync + PartialOrd + 'static {
    /// So many of them in a line.
    const LANES: usize;
    /// A line.
    type Line: Copy + Default + Send + Sync + std::fmt::Debug;
    /// A vector of the processor.
    type Vector<S: Simd>: Copy;
    /// A number that one thread adds to.
    type Shared: Sync;

    /// The nearest one.
    fn of(value: f64) -> Self;
    /// Its magnitude.
    fn size(self) -> Self;
    /// In one lane.
    fn lane(line: &Self::Line, lane: usize) -> Self;
    /// In one lane.
    fn lane_mut(line: &mut Self::Line, lane: usize) -> &mut Self;
    /// Vectors of a line.
    fn parts<S: Simd>() -> usize;
    /// Part `p` of a line.
    fn load<S: Simd>(line: &Self::Line, p: usize) -> Self::Vector<S>;
    /// Writes part `p` of a line.
    fn store<S: Simd>(line: &mut Self::Line, p: usize, value: Self::Vector<S>);
    /// The same number in all lanes.
    fn splat<S: Simd>(simd: S, value: Self) -> Self::Vector<S>;
    /// The product.
    fn times<S: Simd>(simd: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;
    /// `sum + a * b`.
    fn fused<S: Simd>(simd: S, sum: Self::Vector<S>, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;
    /// A vector that threads add to, each to its own entries.
    fn shared(values: &mut [Self]) -> &[Self::Shared];
    /// `cell += value`; no other thread may write this cell meanwhile.
    fn add(cell: &Self::Shared, value: Self);
}

impl Number for f64 {
    const LANES: usize = 8;
    type Line = Lanes;
    type Vector<S: Simd> = S::f64s;
    type Shared = AtomicU64;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn size(self) -> Self {
        self.abs()
    }

    #[inline(always)]
    fn lane(line: &Lanes, lane: usize) -> Self {
        line.0[lane]
    }

    #[inline(always)]
    fn lane_mut(line: &mut Lanes, lane: usize) -> &mut Self {
        &mut line.0[lane]
    }

    #[inline(always)]
    fn parts<S: Simd>() -> usize {
        Self::LANES / S::F64_LANES
    }

    #[inline(always)]
    fn load<S: Simd>(line: &Lanes, p: usize) -> S::f64s {
        S::as_simd_f64s(&line.0).0[p]
    }

    #[inline(always)]
    fn store<S: Simd>(line: &mut Lanes, p: usize, value: S::f64s) {
        S::as_mut_simd_f64s(&mut line.0).0[p] = value;
    }

    #[inline(always)]
    fn splat<S: Simd>(simd: S, value: Self) -> S::f64s {
        simd.splat_f64s(value)
    }

    #[inline(always)]
    fn times<S: Simd>(simd: S, a: S::f64s, b: S::f64s) -> S::f64s {
        simd.mul_f64s(a, b)
    }

    #[inline(always)]
    fn fused<S: Simd>(simd: S, sum: S::f64s, a: S::f64s, b: S::f64s) -> S::f64s {
        simd.mul_add_e_f64s(a, b, sum)
    }

    fn shared(values: &mut [Self]) -> &[AtomicU64] {
        shared::shared(values)
    }

    #[inline(always)]
    fn add(cell: &AtomicU64, value: Self) {
        shared::add(cell, value);
    }
}

impl Number for f32 {
    const LANES: usize = 16;
    type Line = Singles;
    type Vector<S: Simd> = S::f32s;
    type Shared = AtomicU32;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }

    #[inline(always)]
    fn size(self) -> Self {
        self.abs()
    }

    #[inline(always)]
    fn lane(line: &Singles, lane: usize) -> Self {
        line.0[lane]
    }

    #[inline(always)]
    fn lane_mut(line: &mut Singles, lane: usize) -> &mut Self {
        &mut line.0[lane]
    }

    #[inline(always)]
    fn parts<S: Simd>() -> usize {
        Self::LANES / S::F32_LANES
    }

    #[inline(always)]
    fn load<S: Simd>(line: &Singles, p: usize) -> S::f32s {
        S::as_simd_f32s(&line.0).0[p]
    }

    #[inline(always)]
    fn store<S: Simd>(line: &mut Singles, p: usize, value: S::f32s) {
        S::as_mut_simd_f32s(&mut line.0).0[p] = value;
    }

    #[inline(always)]
    fn splat<S: Simd>(simd: S, value: Self) -> S::f32s {
        simd.splat_f32s(value)
    }

    #[inline(always)]
    fn times<S: Simd>(simd: S, a: S::f32s, b: S::f32s) -> S::f32s {
        simd.mul_f32s(a, b)
    }

    #[inline(always)]
    fn fused<S: Simd>(simd: S, sum: S::f32s, a: S::f32s, b: S::f32s) -> S::f32s {
        simd.mul_add_e_f32s(a, b, sum)
    }

    fn shared(values: &mut [Self]) -> &[AtomicU32] {
        <[AtomicU32]>::mut_from_bytes(values.as_mut_bytes()).expect("both have the same alignment")
    }

    #[inline(always)]
    fn add(cell: &AtomicU32, value: Self) {
        let sum = f32::from_bits(cell.load(Ordering::Relaxed)) + value;
        cell.store(sum.to_bits(), Ordering::Relaxed);
    }
}
