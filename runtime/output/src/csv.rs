//! Tables as comma-separated values (RFC 4180 with `\n`), UTF-8, one header line.
//!
//! Promises: every number reads back bit for bit as the same `f64`, written with the fewest digits
//! that allow it; non-finite numbers are `NaN`, `inf` and `-inf`; text is quoted only where the
//! format needs it; the bytes depend on the input only.
//! Does not align columns or write units: they belong into the column names.

use std::io::{self, Write};
use std::path::PathBuf;

use super::{OutputDir, OutputError};

/// The table of the measures of a run, a row a step.
pub const MEASURES_FILE: &str = "measures.csv";

/// Writes a table of numbers into the file `name` (with its `.csv`) and returns its path.
/// Every row has one number for each column. It is on the disc after [`OutputDir::sync`].
///
/// # Errors
/// [`OutputError::RowLength`], [`OutputError::BadName`], [`OutputError::Write`]; after any of
/// them the file has its former content.
pub fn write_csv<C: AsRef<str>, R: AsRef<[f64]>>(
    dir: &OutputDir,
    name: &str,
    columns: &[C],
    rows: &[R],
) -> Result<PathBuf, OutputError> {
    let expected = columns.len();
    let mut lengths = rows.iter().map(|row| row.as_ref().len()).enumerate();
    if let Some((row, found)) = lengths.find(|&(_, found)| found != expected) {
        return Err(OutputError::RowLength { file: dir.path().join(name), row, expected, found });
    }
    dir.write_unsynced(name, |out| {
        write_line(out, columns, |out, column| write_text(out, column.as_ref()))?;
        for row in rows {
            write_line(out, row.as_ref(), |out, number| write!(out, "{number:?}"))?;
        }
        Ok(())
    })
}

fn write_line<T>(
    out: &mut dyn Write,
    entries: &[T],
    write_entry: impl Fn(&mut dyn Write, &T) -> io::Result<()>,
) -> io::Result<()> {
    for (idx, entry) in entries.iter().enumerate() {
        if idx > 0 {
            out.write_all(b",")?;
        }
        write_entry(out, entry)?;
    }
    out.write_all(b"\n")
}

/// Text, quoted if a reader would take it apart, trim it or take it for an empty entry.
fn write_text(out: &mut dyn Write, text: &str) -> io::Result<()> {
    let needs_quotes = text.is_empty()
        || text.contains(['"', ',', '\n', '\r'])
        || text.starts_with(char::is_whitespace)
        || text.ends_with(char::is_whitespace);
    if needs_quotes { write!(out, "\"{}\"", text.replace('"', "\"\"")) } else { out.write_all(text.as_bytes()) }
}

#[cfg(test)]
mod tests {
    use super::super::scratch::Scratch;
    use super::*;

    #[test]
    fn numbers_read_back_bit_for_bit() {
        let scratch = Scratch::new();
        let dir = OutputDir::create(scratch.path()).unwrap();
        // Bits spread over all exponents, and the numbers that writers get wrong.
        let mut numbers: Vec<f64> = (0..4000_u64)
            .map(|i| f64::from_bits(i.wrapping_mul(0x9E37_79B9_7F4A_7C15)))
            .filter(|number| number.is_finite())
            .collect();
        numbers.extend([0.0, -0.0, 0.1, 5e-324, f64::MAX, f64::MIN_POSITIVE, 9_007_199_254_740_993.0]);
        let rows: Vec<[f64; 1]> = numbers.iter().map(|&number| [number]).collect();
        write_csv(&dir, "n.csv", &["n"], &rows).unwrap();
        let text = scratch.read("n.csv");
        let read: Vec<u64> = text.lines().skip(1).map(|line| line.parse::<f64>().unwrap().to_bits()).collect();
        let written: Vec<u64> = numbers.iter().map(|number| number.to_bits()).collect();
        assert_eq!(read, written);
        assert!(text.lines().all(|line| line.len() <= 24), "shortest form");
    }

    #[test]
    fn the_table_is_plain_text() {
        let scratch = Scratch::new();
        let dir = OutputDir::create(scratch.path()).unwrap();
        let columns = ["x", "u(1)", "sigma, n", " p", "the \"gap\"", ""];
        let rows = [
            vec![0.5, 1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0],
            vec![1e21, 1e-7, 0.1 + 0.2, 3.0, 0.0, 2.0],
        ];
        write_csv(&dir, "t.csv", &columns, &rows).unwrap();
        assert_eq!(
            scratch.read("t.csv"),
            "x,u(1),\"sigma, n\",\" p\",\"the \"\"gap\"\"\",\"\"\n\
             0.5,1.0,NaN,inf,-inf,-0.0\n\
             1e21,1e-7,0.30000000000000004,3.0,0.0,2.0\n"
        );
    }

    #[test]
    fn a_ragged_row_writes_nothing() {
        let scratch = Scratch::new();
        let dir = OutputDir::create(scratch.path()).unwrap();
        let rows = [vec![1.0, 2.0], vec![3.0]];
        match write_csv(&dir, "t.csv", &["a", "b"], &rows) {
            Err(OutputError::RowLength { row, expected, found, .. }) => {
                assert_eq!((row, expected, found), (1, 2, 1));
            }
            other => panic!("{other:?}"),
        }
        drop(dir);
        assert_eq!(scratch.names(), ["manifest.json"]);
    }
}
