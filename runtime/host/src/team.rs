//! Ranks that solve one problem together.
//!
//! A [`Team`] adds and compares numbers of all ranks; each operation is made by all of them, in one order, but for messages
//! between some ([`Team::exchange`]). Who owns what is decided elsewhere. Promises: what an operation of all gives is the
//! same on every rank, and the same in every run on so many; a sum in which one rank alone has a number other than zero has
//! the bits of that number. Does not know processes: [`Alone`] is one rank, [`in_threads`] makes ranks of threads, a
//! library of messages makes others.

use std::{
    collections::VecDeque,
    fmt::Debug,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
};

/// The ranks of a run, as one of them sees them.
pub trait Team: Debug + Send + Sync {
    /// Number of this rank, from 0.
    fn rank(&self) -> usize;

    /// Number of ranks.
    fn size(&self) -> usize;

    /// Adds the numbers of all ranks, place by place: the same bits on all, which decide from them.
    fn sum(&self, values: &mut [f64]);

    /// Adds words of all ranks, place by place, modulo 2^64.
    fn sum_words(&self, words: &mut [u64]);

    /// The largest word of all ranks, place by place.
    fn max_words(&self, words: &mut [u64]);

    /// Sends words to some ranks, and returns what those of `from` send here: each rank with the number of its words.
    /// Called by the ranks that send or receive something.
    fn exchange(&self, sends: &[(usize, Vec<u64>)], from: &[(usize, usize)]) -> Vec<Vec<u64>>;

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

    /// The lowest and the highest number of all ranks; infinities the other way round where no rank has one.
    fn range(&self, lowest: f64, highest: f64) -> [f64; 2] {
        let mut words = [lowest, -highest].map(|x| !ordered(x));
        self.max_words(&mut words);
        let [low, high] = words.map(|word| from_ordered(!word));
        [low, -high]
    }

    /// The sum of a number over all ranks.
    fn total(&self, own: f64) -> f64 {
        let mut sum = [own];
        self.sum(&mut sum);
        sum[0]
    }

    /// The sum of a count over all ranks.
    fn count(&self, own: usize) -> usize {
        let mut sum = [own as u64];
        self.sum_words(&mut sum);
        usize::try_from(sum[0]).expect("a count of things in memory")
    }

    /// The largest of a size over all ranks, as [`Self::max`].
    fn largest(&self, own: f64) -> f64 {
        let mut size = [own];
        self.max(&mut size);
        size[0]
    }

    /// Whether something holds on one rank at least.
    fn any(&self, holds: bool) -> bool {
        !self.all(!holds)
    }

    /// Whether something holds on all ranks.
    fn all(&self, holds: bool) -> bool {
        let mut missing = [u64::from(!holds)];
        self.sum_words(&mut missing);
        missing[0] == 0
    }

    /// The first rank on which something holds.
    fn first(&self, holds: bool) -> Option<usize> {
        let n = self.size() as u64;
        let mut before_end = [if holds { n - self.rank() as u64 } else { 0 }];
        self.max_words(&mut before_end);
        (before_end[0] > 0).then(|| usize::try_from(n - before_end[0]).expect("a rank"))
    }

    /// The bytes that one rank has, on every rank.
    fn of_rank(&self, rank: usize, bytes: &[u8]) -> Vec<u8> {
        let own = if self.rank() == rank { bytes } else { &[] };
        self.gather(own).swap_remove(rank)
    }

    /// The numbers that one rank has, on every rank.
    fn numbers_of(&self, rank: usize, own: &[f64]) -> Vec<f64> {
        let bytes: Vec<u8> = own.iter().flat_map(|x| x.to_le_bytes()).collect();
        let words = self.of_rank(rank, &bytes);
        words.as_chunks().0.iter().map(|word| f64::from_le_bytes(*word)).collect()
    }

    /// The numbers of all ranks, those of the first one first, on every rank.
    fn all_numbers(&self, own: &[f64]) -> Vec<f64> {
        let bytes: Vec<u8> = own.iter().flat_map(|x| x.to_le_bytes()).collect();
        let all = self.gather(&bytes).concat();
        all.as_chunks().0.iter().map(|word| f64::from_le_bytes(*word)).collect()
    }

    /// The bytes of each rank, on every rank.
    fn gather(&self, bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut lengths = vec![0; self.size()];
        lengths[self.rank()] = bytes.len() as u64;
        self.sum_words(&mut lengths);
        let lengths: Vec<usize> =
            lengths.into_iter().map(|n| usize::try_from(n).expect("a length in memory")).collect();
        let words = |n: &usize| n.div_ceil(8);
        let mut all = vec![0; lengths.iter().map(words).sum()];
        let first: usize = lengths[..self.rank()].iter().map(words).sum();
        all[first..].iter_mut().zip(packed(bytes)).for_each(|(slot, word)| *slot = word);
        self.sum_words(&mut all);
        let mut rest = all.as_slice();
        let mut next = |n: &usize| {
            let (own, others) = rest.split_at(words(n));
            rest = others;
            unpacked(own, *n)
        };
        lengths.iter().map(&mut next).collect()
    }

    /// The bytes of all ranks on the first one; the others get nothing.
    fn at_first(&self, bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut all = Vec::new();
        self.each_at_first(bytes, &mut |_, bytes| all.push(bytes));
        all
    }

    /// Gives the first rank the bytes of each, one rank after the other.
    fn each_at_first(&self, bytes: &[u8], take: &mut dyn FnMut(usize, Vec<u8>)) {
        let mut lengths = vec![0; self.size()];
        lengths[self.rank()] = bytes.len() as u64;
        self.sum_words(&mut lengths);
        let length = |n: u64| usize::try_from(n).expect("a length in memory");
        if self.rank() > 0 {
            if !bytes.is_empty() {
                self.exchange(&[(0, packed(bytes).collect())], &[]);
            }
            return;
        }
        for (rank, n) in lengths.into_iter().map(length).enumerate() {
            take(
                rank,
                match (rank, n) {
                    (0, _) => bytes.to_vec(),
                    (_, 0) => Vec::new(),
                    _ => unpacked(&self.exchange(&[], &[(rank, n.div_ceil(8))])[0], n),
                },
            );
        }
    }

    /// What the first rank makes for this one. It makes the bytes for one rank after the other, and keeps none of them.
    fn hand_out(&self, make: &mut dyn FnMut(usize) -> Vec<u8>) -> Vec<u8> {
        let is_first = self.rank() == 0;
        let own = if is_first { make(0) } else { Vec::new() };
        for rank in 1..self.size() {
            let bytes = if is_first { make(rank) } else { Vec::new() };
            let mut length = [bytes.len() as u64];
            self.sum_words(&mut length);
            let length = usize::try_from(length[0]).expect("a length in memory");
            if is_first {
                self.exchange(&[(rank, packed(&bytes).collect())], &[]);
            } else if self.rank() == rank {
                let received = self.exchange(&[], &[(0, length.div_ceil(8))]);
                // nothing is left to do but to take part in what the others still get
                for _ in rank + 1..self.size() {
                    self.sum_words(&mut [0]);
                }
                return unpacked(&received[0], length);
            }
        }
        own
    }
}

/// A word that is larger for a larger number; numbers that are none stand at the ends.
fn ordered(x: f64) -> u64 {
    let bits = x.to_bits();
    if bits >> 63 == 0 { bits | 1 << 63 } else { !bits }
}

fn from_ordered(word: u64) -> f64 {
    f64::from_bits(if word >> 63 == 1 { word & !(1 << 63) } else { !word })
}

/// Bytes as words, the last one filled with zeros.
fn packed(bytes: &[u8]) -> impl Iterator<Item = u64> + '_ {
    bytes.chunks(8).map(|part| {
        let mut word = [0; 8];
        word[..part.len()].copy_from_slice(part);
        u64::from_le_bytes(word)
    })
}

fn unpacked(words: &[u64], length: usize) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).take(length).collect()
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

    fn exchange(&self, _sends: &[(usize, Vec<u64>)], _from: &[(usize, usize)]) -> Vec<Vec<u64>> {
        Vec::new()
    }
}

/// What was sent to a rank, with the sender, and the word that something came.
type Mail = (Mutex<VecDeque<(usize, Vec<u64>)>>, Condvar);

/// What the threads of a team have in common.
#[derive(Debug)]
struct Table {
    size: usize,
    round: Mutex<Round>,
    /// Something has changed in the round.
    turned: Condvar,
    /// By receiver.
    mail: Vec<Mail>,
}

/// The operation that the threads are in.
#[derive(Debug, Default)]
struct Round {
    number: usize,
    /// By thread that has come: the operation and its words.
    given: Vec<Option<(&'static str, Vec<u64>)>>,
    /// How many have read what was given.
    read: usize,
    /// A thread has panicked: nobody waits for it.
    is_broken: bool,
}

/// One rank among threads of this process.
#[derive(Debug)]
struct Thread {
    rank: usize,
    table: Arc<Table>,
}

/// Ranks that are threads of this process: each is to be used by a thread of its own.
#[must_use]
pub fn in_threads(size: usize) -> Vec<Arc<dyn Team>> {
    let mail = (0..size).map(|_| Default::default()).collect();
    let round = Mutex::new(Round { given: vec![None; size], ..Round::default() });
    let table = Arc::new(Table { size, round, turned: Condvar::new(), mail });
    (0..size).map(|rank| Arc::new(Thread { rank, table: Arc::clone(&table) }) as Arc<dyn Team>).collect()
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Table {
    /// Waits until something holds of the round.
    fn wait(&self, until: impl Fn(&Round) -> bool) -> MutexGuard<'_, Round> {
        let mut round = locked(&self.round);
        while !until(&round) {
            assert!(!round.is_broken, "another rank has ended");
            round = self.turned.wait(round).unwrap_or_else(PoisonError::into_inner);
        }
        round
    }
}

impl Thread {
    /// Folds the words of all ranks, in their order.
    ///
    /// # Panics
    /// Where another rank is in another operation, or has so many words more or less; where one has panicked.
    fn fold(&self, operation: &'static str, own: Vec<u64>, mut add: impl FnMut(usize, u64)) {
        let (table, length) = (&*self.table, own.len());
        let mut round = table.wait(|round| round.given[self.rank].is_none());
        let number = round.number;
        round.given[self.rank] = Some((operation, own));
        drop(round);
        table.turned.notify_all();
        let all_given = |round: &Round| round.given.iter().all(Option::is_some);
        let mut round = table.wait(|round| round.number == number && all_given(round));
        for (other, words) in round.given.iter().flatten() {
            let same = (*other, words.len()) == (operation, length);
            assert!(
                same,
                "rank {} is in `{operation}` of {length}, another in `{other}` of {}",
                self.rank,
                words.len()
            );
            words.iter().enumerate().for_each(|(place, word)| add(place, *word));
        }
        round.read += 1;
        if round.read == table.size {
            (round.number, round.read) = (number + 1, 0);
            round.given.fill(None);
        }
        drop(round);
        table.turned.notify_all();
        // nobody gives the next words before all have read these
        drop(table.wait(|round| round.number > number));
    }
}

impl Drop for Thread {
    fn drop(&mut self) {
        if std::thread::panicking() {
            locked(&self.table.round).is_broken = true;
            self.table.turned.notify_all();
            for (letters, came) in &self.table.mail {
                // whoever looks into the mail sees the round as it is now, or is woken up
                drop(locked(letters));
                came.notify_all();
            }
        }
    }
}

impl Team for Thread {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.table.size
    }

    fn sum(&self, values: &mut [f64]) {
        let own: Vec<u64> = values.iter().map(|value| value.to_bits()).collect();
        values.fill(0.0);
        self.fold("sum", own, |place, word| values[place] += f64::from_bits(word));
    }

    fn sum_words(&self, words: &mut [u64]) {
        let own = words.to_vec();
        words.fill(0);
        self.fold("sum_words", own, |place, word| words[place] = words[place].wrapping_add(word));
    }

    fn max_words(&self, words: &mut [u64]) {
        let own = words.to_vec();
        words.fill(0);
        self.fold("max_words", own, |place, word| words[place] = words[place].max(word));
    }

    fn exchange(&self, sends: &[(usize, Vec<u64>)], from: &[(usize, usize)]) -> Vec<Vec<u64>> {
        for (to, words) in sends {
            let (letters, came) = &self.table.mail[*to];
            locked(letters).push_back((self.rank, words.clone()));
            came.notify_all();
        }
        let (letters, came) = &self.table.mail[self.rank];
        let receive = |(sender, length): &(usize, usize)| {
            let mut waiting = locked(letters);
            loop {
                if let Some(at) = waiting.iter().position(|(rank, _)| rank == sender) {
                    let (_, words) = waiting.remove(at).expect("found above");
                    assert_eq!(words.len(), *length, "words from rank {sender} to rank {}", self.rank);
                    return words;
                }
                assert!(!locked(&self.table.round).is_broken, "another rank has ended");
                waiting = came.wait(waiting).unwrap_or_else(PoisonError::into_inner);
            }
        };
        from.iter().map(receive).collect()
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
                    assert_eq!((team.first(is_one), team.first(false), team.count(2)), (Some(1), None, 6));
                    assert_eq!(team.range(-own, 0.5 - own), [-100.0, -0.5]);
                    assert_eq!(team.numbers_of(2, &[own, -own]), [100.0, -100.0]);
                    (sums, sizes, holds, team.of_rank(1, &[if is_one { 8 } else { 7 }; 11]))
                })
            });
            let ranks: Vec<_> = ranks.collect();
            ranks.into_iter().map(|rank| rank.join().expect("a rank ends")).collect()
        });
        for (sums, sizes, holds, bytes) in found {
            assert_eq!((sums, sizes[0], holds), (vec![111.0, -1.5], 100.0, [true, false, true, false]));
            assert_eq!(bytes, [8; 11]);
            assert!(sizes[1].is_nan());
        }
    }

    /// What each of some ranks finds.
    fn each<T: Send>(size: usize, work: impl Fn(Arc<dyn Team>) -> T + Sync) -> Vec<T> {
        std::thread::scope(|scope| {
            let ranks: Vec<_> = in_threads(size).into_iter().map(|team| scope.spawn(|| work(team))).collect();
            ranks.into_iter().map(|rank| rank.join().expect("a rank ends")).collect()
        })
    }

    #[test]
    fn ranks_send_to_each_other_and_the_first_hands_out() {
        let found = each(3, |team| {
            let (rank, next, before) = (team.rank(), (team.rank() + 1) % 3, (team.rank() + 2) % 3);
            let told = team.exchange(&[(next, vec![rank as u64; 2])], &[(before, 2)]);
            assert_eq!(told, [[before as u64; 2]]);
            let gathered = team.gather(&vec![rank as u8; 3 * rank]);
            assert_eq!(gathered, [vec![], vec![1; 3], vec![2; 6]]);
            let at_first = team.at_first(&vec![rank as u8; 3 * rank]);
            assert_eq!(at_first, if rank == 0 { gathered } else { Vec::new() });
            team.hand_out(&mut |to| vec![to as u8 + 5; to + 9])
        });
        assert_eq!(found, [vec![5; 9], vec![6; 10], vec![7; 11]]);
    }

    #[test]
    fn ranks_in_different_operations_are_told_and_nobody_waits() {
        let ended = std::thread::scope(|scope| {
            let ranks = in_threads(2).into_iter().map(|team| {
                scope.spawn(move || if team.rank() == 0 { team.sum(&mut [1.0]) } else { team.sum(&mut [1.0, 2.0]) })
            });
            let ranks: Vec<_> = ranks.collect();
            ranks.into_iter().map(|rank| rank.join().is_err()).collect::<Vec<bool>>()
        });
        assert_eq!(ended, [true, true]);
    }

    #[test]
    fn words_have_the_order_of_their_numbers() {
        let numbers = [f64::NEG_INFINITY, -2.0, -1e-300, -0.0, 0.0, 3.0, f64::INFINITY];
        assert!(numbers.windows(2).all(|pair| ordered(pair[0]) < ordered(pair[1])));
        assert!(numbers.iter().all(|x| from_ordered(ordered(*x)).to_bits() == x.to_bits()));
    }
}
