//! Number of points on each branch of the kinks of a term, and whether a branch has changed.

use wfl_host::team::Team;
use wfl_mesh::mesh::Mesh;

/// How many points are on which branch of the kinks of a term.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BranchCounts {
    /// One list a kink: points (weighted by nothing) by code 0, 1, 2.
    pub kinks: Vec<[usize; 3]>,
    /// A number that changes when any point changes its branch.
    pub fingerprint: u64,
    /// By entity of the region that this rank has: points on each branch of the contact kink, 16 bits each; empty without one.
    pub(super) by_entity: Vec<u64>,
}

impl BranchCounts {
    pub(super) fn clear(&mut self, n_kinks: usize) {
        self.kinks.clear();
        self.kinks.resize(n_kinks, [0; 3]);
        self.fingerprint = 0;
    }

    pub(super) fn add(&mut self, other: &Self) {
        for (sum, counts) in self.kinks.iter_mut().zip(&other.kinks) {
            sum.iter_mut().zip(counts).for_each(|(s, c)| *s += c);
        }
        self.fingerprint = self.fingerprint.wrapping_add(other.fingerprint);
    }

    /// From the points that this rank has counted to those of all ranks; entities of a part of the mesh stay those of this
    /// rank.
    pub(super) fn of_all(&mut self, team: &dyn Team, mesh: &Mesh) {
        let counts = self.kinks.iter().flatten().map(|n| *n as u64);
        let entities = if mesh.holders().is_alone() { self.by_entity.as_slice() } else { &[] };
        let mut words: Vec<u64> = counts.chain([self.fingerprint]).chain(entities.iter().copied()).collect();
        team.sum_words(&mut words);
        let mut words = words.into_iter();
        for (count, word) in self.kinks.iter_mut().flatten().zip(&mut words) {
            *count = usize::try_from(word).expect("a number of points");
        }
        self.fingerprint = words.next().unwrap_or(0);
        self.by_entity.iter_mut().zip(words).for_each(|(state, word)| *state = word);
    }
}

/// A number for one branch at one point; their sum does not depend on the order (finaliser of SplitMix64).
pub(super) fn mixed(entity: usize, point: usize, kink: usize, code: usize) -> u64 {
    let mut z = [entity, point, kink, code + 1]
        .iter()
        .fold(0u64, |z, k| (z.rotate_left(17) ^ *k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
