//! Vectors to which several threads add, each thread to its own entries ([`crate::assemble::shares`]).
//!
//! The entries are atomic numbers with relaxed order, which costs nothing and keeps an error from being undefined
//! behaviour.

use std::sync::atomic::{AtomicU64, Ordering};

use zerocopy::{FromBytes, IntoBytes};

/// Numbers that several threads add to, each number from one thread.
pub(super) fn shared(values: &mut [f64]) -> &[AtomicU64] {
    <[AtomicU64]>::mut_from_bytes(values.as_mut_bytes()).expect("on 64-bit machines both have the same alignment")
}

/// Words that several threads write, each word from one thread.
pub(super) fn shared_words(values: &mut [u64]) -> &[AtomicU64] {
    <[AtomicU64]>::mut_from_bytes(values.as_mut_bytes()).expect("on 64-bit machines both have the same alignment")
}

/// `cell += value`; no other thread may write this cell meanwhile.
#[inline(always)]
pub(super) fn add(cell: &AtomicU64, value: f64) {
    let sum = f64::from_bits(cell.load(Ordering::Relaxed)) + value;
    cell.store(sum.to_bits(), Ordering::Relaxed);
}
