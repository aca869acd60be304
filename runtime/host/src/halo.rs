//! Numbers of which each rank has its own and copies of some of the others: the halo.
//!
//! A place is one of the numbers that a rank holds; one rank owns it. Promises: after [`Halo::update`] every copy has the
//! bits of its owner; nothing else is changed. Does not know what the numbers are, and does not decide who owns what.

use std::ops::Range;

use crate::team::Team;

/// Which places go to which ranks, and which come from them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Halo {
    /// By rank that has copies: the places of this rank that they are of.
    sends: Vec<(usize, Vec<u32>)>,
    /// By rank that owns places which this one has copies of: these places, in the order in which they are sent.
    receives: Vec<(usize, Vec<u32>)>,
}

/// The places of each rank, with the rank: none without places, ranks increasing.
fn by_rank(owner: &[u16], wanted: impl Fn(usize) -> bool) -> Vec<(usize, Vec<u32>)> {
    let mut lists: Vec<(usize, Vec<u32>)> = Vec::new();
    for (place, rank) in (0u32..).zip(owner).filter(|(_, rank)| wanted(usize::from(**rank))) {
        let rank = usize::from(*rank);
        let at = lists.partition_point(|(known, _)| *known < rank);
        match lists.get_mut(at).filter(|(known, _)| *known == rank) {
            Some((_, places)) => places.push(place),
            None => lists.insert(at, (rank, vec![place])),
        }
    }
    lists
}

impl Halo {
    /// For places that every rank holds, numbered alike on all: each is a copy wherever it is not owned.
    #[must_use]
    pub fn of_all(team: &dyn Team, owner: &[u16]) -> Self {
        let (own, lists) = (team.rank(), by_rank(owner, |_| true));
        let of_own = lists.iter().find(|(rank, _)| *rank == own).map(|(_, places)| places.clone());
        let others = (0..team.size()).filter(|rank| *rank != own);
        let sends = of_own.map_or_else(Vec::new, |places| others.map(|rank| (rank, places.clone())).collect());
        Self { sends, receives: lists.into_iter().filter(|(rank, _)| *rank != own).collect() }
    }

    /// For places that ranks number differently. `copies` are those of this rank that another one owns and has copies kept
    /// up to date of, each with that rank and `n` words by which the owner finds its place; `find` does that. Made by all
    /// ranks together.
    ///
    /// # Panics
    /// Where an owner does not find a place.
    #[must_use]
    pub fn found(
        team: &dyn Team,
        n: usize,
        copies: impl IntoIterator<Item = (u32, usize, Vec<u64>)>,
        find: impl Fn(&[u64]) -> Option<u32>,
    ) -> Self {
        let mut asked: Vec<(usize, Vec<u32>, Vec<u64>)> = Vec::new();
        for (place, rank, words) in copies {
            assert_eq!(words.len(), n, "words of a place");
            let at = asked.partition_point(|(known, ..)| *known < rank);
            if asked.get(at).is_none_or(|(known, ..)| *known != rank) {
                asked.insert(at, (rank, Vec::new(), Vec::new()));
            }
            asked[at].1.push(place);
            asked[at].2.extend(words);
        }
        // by rank that asks and rank that is asked, how many words
        let (own, size) = (team.rank(), team.size());
        let mut lengths = vec![0; size * size];
        asked.iter().for_each(|(rank, _, words)| lengths[own * size + rank] = words.len() as u64);
        team.sum_words(&mut lengths);
        let length = |from: usize| usize::try_from(lengths[from * size + own]).expect("a length in memory");
        let from: Vec<(usize, usize)> = (0..size).map(|rank| (rank, length(rank))).filter(|(_, n)| *n > 0).collect();
        let questions: Vec<(usize, Vec<u64>)> = asked.iter().map(|(rank, _, words)| (*rank, words.clone())).collect();
        let told = team.exchange(&questions, &from);
        let place = |words: &[u64]| find(words).expect("the owner of a place has it");
        let sends = from.iter().zip(told).map(|((rank, _), words)| (*rank, words.chunks_exact(n).map(place).collect()));
        Self { sends: sends.collect(), receives: asked.into_iter().map(|(rank, places, _)| (rank, places)).collect() }
    }

    /// The same of some of the places under other numbers; those without a number are left out. Owner and copies must
    /// agree on which these are.
    #[must_use]
    pub fn renumbered(&self, number: impl Fn(u32) -> Option<u32>) -> Self {
        let of = |lists: &[(usize, Vec<u32>)]| {
            let kept = lists.iter().map(|(rank, places)| (*rank, places.iter().filter_map(|p| number(*p)).collect()));
            kept.filter(|(_, places): &(usize, Vec<u32>)| !places.is_empty()).collect()
        };
        Self { sends: of(&self.sends), receives: of(&self.receives) }
    }

    /// The same of entries, `n` one behind the other at each place.
    #[must_use]
    pub fn of_entries(&self, n: usize) -> Self {
        let entries = |place: &u32| -> Range<u32> {
            let first = *place * u32::try_from(n).expect("a few entries");
            first..first + u32::try_from(n).expect("a few entries")
        };
        let of = |lists: &[(usize, Vec<u32>)]| {
            lists.iter().map(|(rank, places)| (*rank, places.iter().flat_map(entries).collect())).collect()
        };
        Self { sends: of(&self.sends), receives: of(&self.receives) }
    }

    /// Places of this rank that are copies.
    pub fn copies(&self) -> impl Iterator<Item = u32> + '_ {
        self.receives.iter().flat_map(|(_, places)| places.iter().copied())
    }

    /// True where nothing is sent and nothing comes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.sends.is_empty() && self.receives.is_empty()
    }

    /// Gives every copy the number of its owner.
    pub fn update(&self, team: &dyn Team, values: &mut [f64]) {
        self.send(team, |place| values[place as usize].to_bits()).for_each(|(place, word)| {
            values[place as usize] = f64::from_bits(word);
        });
    }

    /// Gives every copy the word of its owner.
    pub fn update_words(&self, team: &dyn Team, words: &mut [u64]) {
        self.send(team, |place| words[place as usize]).for_each(|(place, word)| words[place as usize] = word);
    }

    /// What the owners of copies say of them.
    fn send(&self, team: &dyn Team, of: impl Fn(u32) -> u64) -> impl Iterator<Item = (u32, u64)> + '_ {
        let sends: Vec<(usize, Vec<u64>)> =
            self.sends.iter().map(|(rank, places)| (*rank, places.iter().map(|p| of(*p)).collect())).collect();
        let from: Vec<(usize, usize)> = self.receives.iter().map(|(rank, places)| (*rank, places.len())).collect();
        let told = if self.is_empty() { Vec::new() } else { team.exchange(&sends, &from) };
        self.receives.iter().zip(told).flat_map(|((_, places), words)| places.iter().copied().zip(words))
    }

    /// Gives every owner the largest size among its own and the copies of it; copies stay as they are.
    pub fn largest_at_owners(&self, team: &dyn Team, sizes: &mut [f64]) {
        let back = Self { sends: self.receives.clone(), receives: self.sends.clone() };
        let told: Vec<(u32, u64)> = back.send(team, |place| sizes[place as usize].to_bits()).collect();
        for (place, word) in told {
            let (size, other) = (&mut sizes[place as usize], f64::from_bits(word));
            // what is no number on one rank is none
            *size = if size.is_nan() || other.is_nan() { f64::NAN } else { size.max(other) };
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::team::in_threads;

    fn each<T: Send>(size: usize, work: impl Fn(Arc<dyn Team>) -> T + Sync) -> Vec<T> {
        std::thread::scope(|scope| {
            let ranks: Vec<_> = in_threads(size).into_iter().map(|team| scope.spawn(|| work(team))).collect();
            ranks.into_iter().map(|rank| rank.join().expect("a rank ends")).collect()
        })
    }

    #[test]
    fn numbers_that_all_hold_come_from_their_owners() {
        let owner = [0, 2, 2, 0, 1];
        let found = each(3, |team| {
            let halo = Halo::of_all(&*team, &owner);
            let mut values: Vec<f64> = (0..5).map(|k| (10 * team.rank() + k) as f64).collect();
            halo.update(&*team, &mut values);
            values
        });
        assert!(found.iter().all(|values| *values == [0.0, 21.0, 22.0, 3.0, 14.0]), "{found:?}");
    }

    /// Four places in a circle: rank r owns place 4 r to 4 r + 3 of all and has copies of the two beside them.
    #[test]
    fn copies_are_found_by_what_the_owner_calls_them() {
        let found = each(3, |team| {
            let own = team.rank();
            let (before, behind) = ((own + 2) % 3, (own + 1) % 3);
            // own places are 1 to 4, the copies 0 and 5
            let copies = [(0, before, vec![(4 * before + 3) as u64]), (5, behind, vec![(4 * behind) as u64])];
            let find = |words: &[u64]| u32::try_from(words[0] as usize + 1 - 4 * own).ok();
            let halo = Halo::found(&*team, 1, copies, find);
            let mut words: Vec<u64> = vec![99; 6];
            (0..4).for_each(|k| words[k + 1] = (4 * own + k) as u64);
            halo.update_words(&*team, &mut words);
            let mut sizes: Vec<f64> = (0..6).map(|k| (own + k) as f64).collect();
            halo.largest_at_owners(&*team, &mut sizes);
            // one place without a number, the others the other way round
            let fewer = halo.renumbered(|place| if place == 4 || place == 0 { None } else { Some(5 - place) });
            let twice = halo.of_entries(2);
            (words, sizes, fewer.copies().collect::<Vec<_>>(), twice.copies().collect::<Vec<_>>())
        });
        assert_eq!(found[0].0, [11, 0, 1, 2, 3, 4]);
        assert_eq!(found[2].0, [7, 8, 9, 10, 11, 0]);
        // place 1 of rank 0 is copied by rank 2 at its place 5: 7; place 4 by rank 1 at its place 0: 1
        assert_eq!(found[0].1, [0.0, 7.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!((found[1].2.as_slice(), found[1].3.as_slice()), (&[0][..], &[0, 1, 10, 11][..]));
    }
}
