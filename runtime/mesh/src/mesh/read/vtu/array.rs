//! The numbers of an array: text, base64, or bytes behind the tags, as they are or compressed by zlib.

use miniz_oxide::inflate::decompress_to_vec_zlib_with_limit;

use super::{
    ReadError, wrong,
    xml::{Tag, Tags},
};

/// An array.
#[derive(Debug)]
pub(super) struct Data {
    pub(super) values: Vec<f64>,
    /// Its tag.
    pub(super) at: usize,
}

impl Data {
    /// The numbers as counts.
    pub(super) fn whole(&self) -> Result<Vec<usize>, ReadError> {
        self.values.iter().map(|x| self.count(*x)).collect()
    }

    fn count(&self, x: f64) -> Result<usize, ReadError> {
        if (0.0..9e15).contains(&x) && x.fract() == 0.0 {
            return Ok(x as usize);
        }
        Err(wrong(self.at, format!("found {x} where a count or the number of a node is needed")))
    }

    /// The numbers from `start` to `end`, the nodes of a cell.
    pub(super) fn part(&self, start: usize, end: usize, cell: usize) -> Result<Vec<u64>, ReadError> {
        let cut = || wrong(self.at, format!("cell {cell} has its nodes at {start} to {end} of {}", self.values.len()));
        let part = self.values.get(start..end).ok_or_else(cut)?;
        part.iter().map(|x| self.count(*x).map(|k| k as u64)).collect()
    }
}

/// How the arrays of a file are written.
pub(super) struct Layout<'a> {
    bytes: &'a [u8],
    big_endian: bool,
    /// Bytes of a size in front of an array.
    header: usize,
    compressed: bool,
    /// Where the appended data begins, and whether it is base64.
    appended: Option<(usize, bool)>,
}

impl<'a> Layout<'a> {
    pub(super) fn of(bytes: &'a [u8]) -> Result<Self, ReadError> {
        let mut layout = Layout { bytes, big_endian: false, header: 4, compressed: false, appended: None };
        let mut tags = Tags::new(bytes);
        while let Some(tag) = tags.next()? {
            match tag.name.as_str() {
                "VTKFile" if !tag.closes => layout.file(&tag)?,
                "AppendedData" if !tag.closes => {
                    let start = bytes[tags.at..].iter().position(|b| *b == b'_');
                    let start = start.ok_or_else(|| wrong(tag.at, "appended data begins with `_`"))?;
                    layout.appended = Some((tags.at + start + 1, tag.value("encoding") == Some("base64")));
                    break;
                }
                _ => {}
            }
        }
        Ok(layout)
    }

    fn file(&mut self, tag: &Tag) -> Result<(), ReadError> {
        let kind = tag.value("type").unwrap_or_default();
        if kind != "UnstructuredGrid" {
            let help =
                "write it as an unstructured grid, `.vtu` (ParaView: Append Datasets or Merge Blocks, then Save Data)";
            return Err(wrong(tag.at, format!("the file is a `{kind}`; {help}")));
        }
        self.big_endian = tag.value("byte_order") == Some("BigEndian");
        self.header = if tag.value("header_type") == Some("UInt64") { 8 } else { 4 };
        match tag.value("compressor") {
            None | Some("") => {}
            Some("vtkZLibDataCompressor") => self.compressed = true,
            Some(other) => {
                let help = "write the file with zlib or without compression";
                return Err(wrong(tag.at, format!("the compressor {other} is not read; {help}")));
            }
        }
        Ok(())
    }

    /// The array of a tag that was just read.
    pub(super) fn read(&self, tag: &Tag, tags: &mut Tags<'_>) -> Result<Data, ReadError> {
        let at = tag.at;
        let name = tag.value("Name").unwrap_or("array").to_owned();
        let cut = || wrong(at, format!("the data of `{name}` ends early or is damaged"));
        let kind = tag.value("type").unwrap_or_default().to_owned();
        let bytes = match tag.value("format").unwrap_or("ascii") {
            "ascii" => {
                let text = tags.text(&tag.name)?;
                let numbers = text.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
                let number = |word: &[u8]| std::str::from_utf8(word).ok().and_then(|w| w.parse::<f64>().ok());
                let values: Option<Vec<f64>> = numbers.map(number).collect();
                return Ok(Data { values: values.ok_or_else(cut)?, at });
            }
            "binary" => {
                let text = tags.text(&tag.name)?;
                self.array(&mut Source::Letters { text: &text, at: 0, kept: Vec::new() })
            }
            "appended" => {
                let (start, letters) = self.appended.ok_or_else(cut)?;
                let offset = tag.number("offset").ok_or_else(cut)?;
                let rest = start.checked_add(offset).and_then(|from| self.bytes.get(from..)).ok_or_else(cut)?;
                self.array(&mut if letters {
                    Source::Letters { text: rest, at: 0, kept: Vec::new() }
                } else {
                    Source::Bytes(rest)
                })
            }
            other => return Err(wrong(at, format!("the format `{other}` of `{name}` is not known"))),
        };
        let values = self.numbers(&kind, &bytes.ok_or_else(cut)?);
        Ok(Data { values: values.ok_or_else(|| wrong(at, format!("numbers of type `{kind}` are not read")))?, at })
    }

    fn size(&self, source: &mut Source<'_>) -> Option<usize> {
        let mut bytes = source.take(self.header)?;
        if self.big_endian {
            bytes.reverse();
        }
        let size = bytes.iter().rev().fold(0u64, |size, byte| size << 8 | u64::from(*byte));
        usize::try_from(size).ok()
    }

    /// The bytes of an array: its size, then the bytes; or sizes of compressed blocks, then the blocks.
    fn array(&self, source: &mut Source<'_>) -> Option<Vec<u8>> {
        if !self.compressed {
            let size = self.size(source)?;
            return source.take(size);
        }
        let blocks = self.size(source)?;
        let (block, last) = (self.size(source)?, self.size(source)?);
        // the sizes of the blocks have to be in the file
        if blocks > self.bytes.len() {
            return None;
        }
        let sizes: Option<Vec<usize>> = (0..blocks).map(|_| self.size(source)).collect();
        source.aligned();
        let mut bytes = Vec::new();
        for (k, size) in sizes?.into_iter().enumerate() {
            let whole = if k + 1 == blocks && last > 0 { last } else { block };
            // zlib makes at most about a thousand bytes of one
            let packed = source.take(size)?;
            if whole > 1100 * packed.len() + 64 {
                return None;
            }
            let unpacked = decompress_to_vec_zlib_with_limit(&packed, whole).ok()?;
            if unpacked.len() != whole {
                return None;
            }
            bytes.extend(unpacked);
        }
        Some(bytes)
    }

    /// The words of `N` bytes, the lowest first, as numbers.
    fn each<const N: usize>(&self, bytes: &[u8], number: impl Fn([u8; N]) -> f64) -> Vec<f64> {
        let chunks = bytes.chunks_exact(N).map(|c| {
            let mut word = [0; N];
            word.copy_from_slice(c);
            if self.big_endian {
                word.reverse();
            }
            number(word)
        });
        chunks.collect()
    }

    fn numbers(&self, kind: &str, bytes: &[u8]) -> Option<Vec<f64>> {
        Some(match kind {
            "Int8" => self.each::<1>(bytes, |w| f64::from(i8::from_le_bytes(w))),
            "UInt8" => self.each::<1>(bytes, |w| f64::from(w[0])),
            "Int16" => self.each::<2>(bytes, |w| f64::from(i16::from_le_bytes(w))),
            "UInt16" => self.each::<2>(bytes, |w| f64::from(u16::from_le_bytes(w))),
            "Int32" => self.each::<4>(bytes, |w| f64::from(i32::from_le_bytes(w))),
            "UInt32" => self.each::<4>(bytes, |w| f64::from(u32::from_le_bytes(w))),
            "Int64" => self.each::<8>(bytes, |w| i64::from_le_bytes(w) as f64),
            "UInt64" => self.each::<8>(bytes, |w| u64::from_le_bytes(w) as f64),
            "Float32" => self.each::<4>(bytes, |w| f64::from(f32::from_le_bytes(w))),
            "Float64" => self.each::<8>(bytes, f64::from_le_bytes),
            _ => return None,
        })
    }
}

/// Bytes, or letters of base64 for them.
enum Source<'a> {
    Bytes(&'a [u8]),
    Letters {
        text: &'a [u8],
        at: usize,
        /// Bytes of the last four letters that nobody has taken.
        kept: Vec<u8>,
    },
}

impl Source<'_> {
    fn take(&mut self, n: usize) -> Option<Vec<u8>> {
        match self {
            Source::Bytes(bytes) => {
                let (taken, rest) = bytes.split_at_checked(n)?;
                *bytes = rest;
                Some(taken.to_vec())
            }
            Source::Letters { text, at, kept } => {
                if n > text.len() {
                    return None;
                }
                while kept.len() < n {
                    kept.extend(four(text, at)?);
                }
                let rest = kept.split_off(n);
                Some(std::mem::replace(kept, rest))
            }
        }
    }

    /// Letters go on with a group of their own: what is left of the last one is the filling behind a header.
    fn aligned(&mut self) {
        if let Source::Letters { kept, .. } = self {
            kept.clear();
        }
    }
}

/// The bytes of the next four letters; fewer than three where `=` fills them up.
fn four(text: &[u8], at: &mut usize) -> Option<Vec<u8>> {
    let (mut bits, mut letters, mut filled) = (0u32, 0, 0);
    while letters < 4 {
        let letter = *text.get(*at)?;
        *at += 1;
        let value = match letter {
            b'A'..=b'Z' => letter - b'A',
            b'a'..=b'z' => letter - b'a' + 26,
            b'0'..=b'9' => letter - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            b'=' => {
                filled += 1;
                0
            }
            blank if blank.is_ascii_whitespace() => continue,
            _ => return None,
        };
        bits = bits << 6 | u32::from(value);
        letters += 1;
    }
    let bytes = bits.to_be_bytes();
    Some(bytes[1..4usize.checked_sub(filled.min(3))?].to_vec())
}
