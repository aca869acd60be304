//! A number of 128 bits that identifies contents.
//!
//! Promises: the hash known as MurmurHash3_x64_128 (A. Appleby, public domain) with seed 0, for data in pieces of any
//! length, the same on every machine. No protection against intent: whoever can write a file can also write its hash.

use std::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

/// The hash of some bytes; shown and kept as 32 hexadecimal digits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Hash([u64; 2]);

impl Hash {
    /// The hash of some bytes.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Self {
        let mut hasher = Hasher::default();
        hasher.add(bytes);
        hasher.end()
    }

    /// The one of which [`fmt::Display`] made a text.
    #[must_use]
    pub fn read(text: &str) -> Option<Self> {
        let whole = text.len() == 32 && text.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b));
        let part = |digits: &str| u64::from_str_radix(digits, 16).ok();
        whole.then(|| Some(Hash([part(&text[..16])?, part(&text[16..])?])))?
    }
}

impl fmt::Display for Hash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}{:016x}", self.0[0], self.0[1])
    }
}

impl Serialize for Hash {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Hash {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        Hash::read(&text).ok_or_else(|| D::Error::custom("a hash has 32 hexadecimal digits"))
    }
}

/// Bytes of a block.
const BLOCK: usize = 16;
/// The multipliers of the published algorithm.
const FACTORS: [u64; 2] = [0x87c3_7b91_1142_53d5, 0x4cf5_ad43_2745_937f];

/// Makes the hash of bytes that come in pieces.
#[derive(Clone, Debug, Default)]
pub struct Hasher {
    state: [u64; 2],
    /// The first bytes of a block that is not whole yet.
    begun: [u8; BLOCK],
    length: u64,
}

impl std::io::Write for Hasher {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.add(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Hasher {
    /// Takes the next bytes.
    pub fn add(&mut self, mut bytes: &[u8]) {
        let begun = (self.length % BLOCK as u64) as usize;
        self.length += bytes.len() as u64;
        if begun > 0 {
            let (head, tail) = bytes.split_at(bytes.len().min(BLOCK - begun));
            self.begun[begun..begun + head.len()].copy_from_slice(head);
            if begun + head.len() < BLOCK {
                return;
            }
            self.block(self.begun);
            bytes = tail;
        }
        let (blocks, rest) = bytes.as_chunks::<BLOCK>();
        blocks.iter().for_each(|block| self.block(*block));
        self.begun[..rest.len()].copy_from_slice(rest);
    }

    /// The hash of all bytes so far.
    #[must_use]
    pub fn end(&self) -> Hash {
        let mut last = [0; BLOCK];
        let begun = (self.length % BLOCK as u64) as usize;
        last[..begun].copy_from_slice(&self.begun[..begun]);
        let [k1, k2] = mixed(last);
        let [mut a, mut b] = [self.state[0] ^ k1 ^ self.length, self.state[1] ^ k2 ^ self.length];
        a = a.wrapping_add(b);
        b = b.wrapping_add(a);
        (a, b) = (spread(a), spread(b));
        a = a.wrapping_add(b);
        Hash([a, b.wrapping_add(a)])
    }

    fn block(&mut self, block: [u8; BLOCK]) {
        let ([k1, k2], [a, b]) = (mixed(block), self.state);
        let a = (a ^ k1).rotate_left(27).wrapping_add(b).wrapping_mul(5).wrapping_add(0x52dc_e729);
        let b = (b ^ k2).rotate_left(31).wrapping_add(a).wrapping_mul(5).wrapping_add(0x3849_5ab5);
        self.state = [a, b];
    }
}

/// The two words of a block, each spread over its 64 bits.
fn mixed(block: [u8; BLOCK]) -> [u64; 2] {
    let words = u128::from_le_bytes(block);
    let [c1, c2] = FACTORS;
    let low = (words as u64).wrapping_mul(c1).rotate_left(31).wrapping_mul(c2);
    let high = ((words >> 64) as u64).wrapping_mul(c2).rotate_left(33).wrapping_mul(c1);
    [low, high]
}

fn spread(mut k: u64) -> u64 {
    for factor in [0xff51_afd7_ed55_8ccd, 0xc4ce_b9fe_1a85_ec53] {
        k = (k ^ (k >> 33)).wrapping_mul(factor);
    }
    k ^ (k >> 33)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_the_published_one() {
        let fox = b"The quick brown fox jumps over the lazy dog";
        assert_eq!(Hash::of(fox).to_string(), "e34bbc7bbc071b6c7a433ca9c49a9347");
        assert_eq!(Hash::of(b"hello").to_string(), "cbd8a7b341bd9b025b1e906a48ae1d19");
        assert_eq!(Hash::of(b"").to_string(), "0".repeat(32));
    }

    #[test]
    fn pieces_give_the_hash_of_the_whole_and_every_change_another() {
        let bytes: Vec<u8> = (0..100u8).map(|k| k.wrapping_mul(37)).collect();
        let whole = Hash::of(&bytes);
        for cut in 0..bytes.len() {
            let mut hasher = Hasher::default();
            hasher.add(&bytes[..cut]);
            hasher.add(&bytes[cut..]);
            assert_eq!(hasher.end(), whole, "cut at {cut}");
            assert_ne!(Hash::of(&bytes[..cut]), whole);
            let mut changed = bytes.clone();
            changed[cut] ^= 1;
            assert_ne!(Hash::of(&changed), whole);
        }
        assert_eq!(Hash::read(&whole.to_string()), Some(whole));
        for text in ["", "0", "+00000000000000+0000000000000000", &"g".repeat(32), &"é".repeat(16)] {
            assert_eq!(Hash::read(text), None, "{text}");
        }
    }
}
