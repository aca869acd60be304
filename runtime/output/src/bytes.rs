//! Numbers and texts as bytes: little-endian words of 64 bits, lists behind their length.
//!
//! Reading checks every length against what is left, so that no content can ask for more memory than the file has.

/// Gathers bytes.
#[derive(Default)]
pub struct Writer {
    /// What was gathered.
    pub bytes: Vec<u8>,
}

impl Writer {
    /// A number of 64 bits.
    pub fn word(&mut self, x: u64) {
        self.bytes.extend_from_slice(&x.to_le_bytes());
    }

    /// A number of items, in 64 bits on every machine.
    pub fn count(&mut self, n: usize) {
        self.word(n as u64);
    }

    /// Yes or no, as the number 1 or 0.
    pub fn flag(&mut self, yes: bool) {
        self.word(u64::from(yes));
    }

    /// A text behind its length in bytes.
    pub fn text(&mut self, t: &str) {
        self.count(t.len());
        self.bytes.extend_from_slice(t.as_bytes());
    }

    /// Numbers of 32 bits, one behind the other.
    pub fn smalls(&mut self, list: &[u32]) {
        self.count(list.len());
        list.iter().for_each(|x| self.bytes.extend_from_slice(&x.to_le_bytes()));
    }

    /// Items behind their number, each as `item` writes it.
    pub fn list<T>(&mut self, list: &[T], mut item: impl FnMut(&mut Self, &T)) {
        self.count(list.len());
        list.iter().for_each(|one| item(self, one));
    }

    /// Bytes behind their length.
    pub fn all(&mut self, bytes: &[u8]) {
        self.count(bytes.len());
        self.bytes.extend_from_slice(bytes);
    }

    /// Numbers behind their count, bit by bit: also those that are not finite.
    pub fn numbers(&mut self, list: &[f64]) {
        self.count(list.len());
        list.iter().for_each(|x| self.word(x.to_bits()));
    }
}

/// The bytes are not what was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unreadable;

/// Reads what [`Writer`] wrote.
pub struct Reader<'b> {
    rest: &'b [u8],
}

impl<'b> Reader<'b> {
    /// Of bytes of a [`Writer`], from the first one on.
    #[must_use]
    pub fn new(bytes: &'b [u8]) -> Self {
        Self { rest: bytes }
    }

    fn take(&mut self, n: usize) -> Result<&'b [u8], Unreadable> {
        let (head, tail) = self.rest.split_at_checked(n).ok_or(Unreadable)?;
        self.rest = tail;
        Ok(head)
    }

    /// A number of 64 bits.
    ///
    /// # Errors
    /// [`Unreadable`] where fewer bytes are left.
    pub fn word(&mut self) -> Result<u64, Unreadable> {
        self.take(8)?.try_into().map(u64::from_le_bytes).map_err(|_| Unreadable)
    }

    /// A number of items.
    ///
    /// # Errors
    /// [`Unreadable`] where fewer bytes are left, or more items than this machine can count.
    pub fn count(&mut self) -> Result<usize, Unreadable> {
        usize::try_from(self.word()?).map_err(|_| Unreadable)
    }

    /// A number of 32 bits that was written as one of 64.
    ///
    /// # Errors
    /// [`Unreadable`] where fewer bytes are left, or the number is larger.
    pub fn small(&mut self) -> Result<u32, Unreadable> {
        u32::try_from(self.word()?).map_err(|_| Unreadable)
    }

    /// Yes or no.
    ///
    /// # Errors
    /// [`Unreadable`] where fewer bytes are left, or the number is neither 0 nor 1.
    pub fn flag(&mut self) -> Result<bool, Unreadable> {
        match self.word()? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(Unreadable),
        }
    }

    /// A text.
    ///
    /// # Errors
    /// [`Unreadable`] where fewer bytes are left, or they are no text.
    pub fn text(&mut self) -> Result<String, Unreadable> {
        let n = self.count()?;
        String::from_utf8(self.take(n)?.to_vec()).map_err(|_| Unreadable)
    }

    /// Numbers with the bits that they had.
    ///
    /// # Errors
    /// [`Unreadable`] where fewer bytes are left.
    pub fn numbers(&mut self) -> Result<Vec<f64>, Unreadable> {
        let n = self.count()?.checked_mul(8).ok_or(Unreadable)?;
        let number = |b: &[u8]| b.try_into().map(u64::from_le_bytes).map(f64::from_bits).map_err(|_| Unreadable);
        self.take(n)?.chunks_exact(8).map(number).collect()
    }

    /// Bytes that were written behind their length.
    ///
    /// # Errors
    /// [`Unreadable`] where fewer bytes are left.
    pub fn all(&mut self) -> Result<&'b [u8], Unreadable> {
        let n = self.count()?;
        self.take(n)
    }

    /// Numbers of 32 bits.
    ///
    /// # Errors
    /// [`Unreadable`] where fewer bytes are left.
    pub fn smalls(&mut self) -> Result<Vec<u32>, Unreadable> {
        let n = self.count()?.checked_mul(4).ok_or(Unreadable)?;
        let number = |b: &[u8]| b.try_into().map(u32::from_le_bytes).map_err(|_| Unreadable);
        self.take(n)?.chunks_exact(4).map(number).collect()
    }

    /// Items, each as `item` reads it.
    ///
    /// # Errors
    /// [`Unreadable`] where fewer bytes are left, or `item` says so.
    pub fn list<T>(&mut self, mut item: impl FnMut(&mut Self) -> Result<T, Unreadable>) -> Result<Vec<T>, Unreadable> {
        // not collected by count: a wrong one ends at the first item that is missing
        let mut out = Vec::new();
        for _ in 0..self.count()? {
            out.push(item(self)?);
        }
        Ok(out)
    }

    /// Whether all bytes were read.
    ///
    /// # Errors
    /// [`Unreadable`] where some are left.
    pub fn end(&self) -> Result<(), Unreadable> {
        if self.rest.is_empty() { Ok(()) } else { Err(Unreadable) }
    }
}

/// FNV-1a of 64 bits (Fowler, Noll and Vo): detects changed files, is no protection against intent.
#[must_use]
pub fn hash(bytes: &[u8]) -> u64 {
    hash_on(HASH_OF_NOTHING, bytes)
}

/// The hash of nothing.
pub const HASH_OF_NOTHING: u64 = 0xcbf2_9ce4_8422_2325;

/// The hash of a text and `bytes` behind it from the one of the text.
#[must_use]
pub fn hash_on(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0000_0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_is_read_and_nothing_else() {
        let mut w = Writer::default();
        w.numbers(&[f64::NAN, -0.0, 5e-324]);
        w.text("σ");
        w.smalls(&[7, u32::MAX]);
        w.flag(true);
        for cut in 0..w.bytes.len() {
            let mut r = Reader::new(&w.bytes[..cut]);
            assert!(r.numbers().and(r.text()).and(r.smalls()).and(r.flag()).is_err(), "{cut} bytes");
        }
        let mut r = Reader::new(&w.bytes);
        let bits: Vec<u64> = r.numbers().unwrap().iter().map(|x| x.to_bits()).collect();
        assert_eq!(bits, [f64::NAN.to_bits(), (-0.0f64).to_bits(), 1]);
        assert_eq!((r.text().unwrap().as_str(), r.smalls(), r.flag()), ("σ", Ok(vec![7, u32::MAX]), Ok(true)));
        assert_eq!(r.end(), Ok(()));
        assert_eq!(Reader::new(&u64::MAX.to_le_bytes()).numbers(), Err(Unreadable));
    }

    #[test]
    fn the_hash_is_the_published_one() {
        // test vectors of the authors, isthe.com/chongo/tech/comp/fnv
        assert_eq!(hash(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(hash(b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(hash(b"foobar"), 0x8594_4171_f739_67e8);
        assert_eq!(hash_on(hash(b"foo"), b"bar"), hash(b"foobar"));
    }
}
