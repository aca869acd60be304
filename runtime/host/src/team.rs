//! Ranks that solve one problem together.
//!
//! A [`Team`] adds and compares numbers of all ranks; each operation is made by all of them, in one order. Who owns what
//! is decided elsewhere. Promises: what an operation gives is the same on every rank; a sum in which one rank alone has
//! a number other than zero has the bits of that number. Does not know processes: [`Alone`] is one rank, [`in_threads`]
//! makes ranks of threads, a library of messages makes others.

use std::{
    fmt::Debug,
    sync::{Arc, Barrier, Mutex, PoisonError},
};

/// The ranks of a run, as one of them sees them.
pub trait Team: Debug + Send + Sync {
    /// Number of this rank, from 0.
    fn rank(&self) -> usize;

    /// Number of ranks.
    fn size(&self) -> usize;

    /// Adds the numbers of all ranks, place by place.
    fn sum(&self, values: &mut [f64]);

    /// Adds words of all ranks, place by place, modulo 2^64.
    fn sum_words(&self, words: &mut [u64]);

    /// The largest word of all ranks, place by place.
    fn max_words(&self, words: &mut [u64]);

    /// True where there is no other rank.
    fn is_alone(&self) -> bool {
        self.size() == 1
    }

    /// The largest of sizes, which are not negative, place by place; not a number where one rank has none.
    fn max(&self, sizes: &mut [f64]) {
        if !self.is_alone() {
            // sizes are ordered as their bits are, and what is no number stands above infinity
            let mut words: Vec<u64> = sizes.iter().map(|size| size.abs().to_bits()).collect();
            self.max_words(&mut words);
            sizes.iter_mut().zip(words).for_each(|(size, word)| *size = f64::from_bits(word));
        }
    }

    /// Whether something holds on one rank at least.
    fn any(&self, holds: bool) -> bool {
        !self.all(!holds)
    }

    /// The bytes that the first rank has, on every rank.
    fn of_first(&self, bytes: &[u8]) -> Vec<u8> {
        let is_first = self.rank() == 0;
        let mut length = [if is_first { bytes.len() as u64 } else { 0 }];
        self.sum_words(&mut length);
        let length = usize::try_from(length[0]).expect("a length in memory");
        let mut words = vec![0; length.div_ceil(8)];
        if is_first {
            for (word, part) in words.iter_mut().zip(bytes.chunks(8)) {
                let mut all = [0; 8];
                all[..part.len()].copy_from_slice(part);
                *word = u64::from_le_bytes(all);
            }
        }
        self.sum_words(&mut words);
        words.into_iter().flat_map(u64::to_le_bytes).take(length).collect()
    }

    /// Whether something holds on all ranks.
    fn all(&self, holds: bool) -> bool {
        let mut missing = [u64::from(!holds)];
        self.sum_words(&mut missing);
        missing[0] == 0
    }
}

/// One rank without others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Alone;

impl Team for Alone {
    fn rank(&self) -> usize {
        0
    }

    fn size(&self) -> usize {
        1
    }

    fn sum(&self, _values: &mut [f64]) {}

    fn sum_words(&self, _words: &mut [u64]) {}

    fn max_words(&self, _words: &mut [u64]) {}
}

/// What threads exchange: the words of each rank in one operation.
#[derive(Debug)]
struct Table {
    barrier: Barrier,
    ranks: Vec<Mutex<Vec<u64>>>,
}

/// One rank among threads of this process.
#[derive(Clone, Debug)]
struct Thread {
    rank: usize,
    table: Arc<Table>,
}

/// Ranks that are threads of this process: each is to be used by a thread of its own.
#[must_use]
pub fn in_threads(size: usize) -> Vec<Arc<dyn Team>> {
    let ranks = (0..size).map(|_| Mutex::default()).collect();
    let table = Arc::new(Table { barrier: Barrier::new(size), ranks });
    (0..size).map(|rank| Arc::new(Thread { rank, table: Arc::clone(&table) }) as Arc<dyn Team>).collect()
}

impl Thread {
    /// Folds the words of all ranks, in their order.
    fn fold(&self, own: impl Iterator<Item = u64>, mut add: impl FnMut(usize, u64)) {
        *self.table.ranks[self.rank].lock().unwrap_or_else(PoisonError::into_inner) = own.collect();
        self.table.barrier.wait();
        for rank in &self.table.ranks {
            let words = rank.lock().unwrap_or_else(PoisonError::into_inner);
            words.iter().enumerate().for_each(|(place, word)| add(place, *word));
        }
        // nobody writes the next numbers before all have read these
        self.table.barrier.wait();
    }
}

impl Team for Thread {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.table.ranks.len()
    }

    fn sum(&self, values: &mut [f64]) {
        let own: Vec<u64> = values.iter().map(|value| value.to_bits()).collect();
        values.fill(0.0);
        self.fold(own.into_iter(), |place, word| values[place] += f64::from_bits(word));
    }

    fn sum_words(&self, words: &mut [u64]) {
        let own = words.to_vec();
        words.fill(0);
        self.fold(own.into_iter(), |place, word| words[place] = words[place].wrapping_add(word));
    }

    fn max_words(&self, words: &mut [u64]) {
        let own = words.to_vec();
        words.fill(0);
        self.fold(own.into_iter(), |place, word| words[place] = words[place].max(word));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_ranks_get_the_same_sums_and_largest_numbers() {
        let found: Vec<_> = std::thread::scope(|scope| {
            let ranks = in_threads(3).into_iter().map(|team| {
                scope.spawn(move || {
                    let own = [1.0, 10.0, 100.0][team.rank()];
                    let (mut sums, mut sizes) = (vec![own, -0.5], vec![own, f64::NAN]);
                    team.sum(&mut sums);
                    team.max(&mut sizes);
                    let is_one = team.rank() == 1;
                    let holds = [team.all(true), team.all(!is_one), team.any(is_one), team.any(false)];
                    (sums, sizes, holds, team.of_first(&[if is_one { 8 } else { 7 }; 11]))
                })
            });
            let ranks: Vec<_> = ranks.collect();
            ranks.into_iter().map(|rank| rank.join().expect("a rank ends")).collect()
        });
        for (sums, sizes, holds, bytes) in found {
            assert_eq!((sums, sizes[0], holds), (vec![111.0, -1.5], 100.0, [true, false, true, false]));
            assert_eq!(bytes, [7; 11]);
            assert!(sizes[1].is_nan());
        }
    }
}
