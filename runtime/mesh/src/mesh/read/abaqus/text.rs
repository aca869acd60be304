//! The text of an input file: keywords with parameters and data lines, in it and in the files that it includes.
//!
//! A file that `*INCLUDE, INPUT=name` names stands where the keyword stands, also between the data of another keyword;
//! data behind `INPUT=` of `*NODE`, `*ELEMENT`, sets and surfaces are read in the same way. Names are looked for beside
//! the deck, as the programs do that run there. What steps include is loads and output, and is not read.

use wfl_host::memory::claim;

use crate::mesh::{
    error::MeshError,
    read::{
        Beside,
        error::{Place, ReadError},
    },
};

/// A keyword with the lines below it.
pub(super) struct Section {
    /// Counted through all files of the deck; [`Text::placed`] gives the file and its own line.
    pub(super) line: usize,
    /// In capitals, without the star.
    pub(super) keyword: String,
    /// Parameters in capitals, with values as written.
    parameters: Vec<(String, String)>,
    /// Data lines with their numbers.
    pub(super) data: Vec<(usize, Vec<String>)>,
}

impl Section {
    pub(super) fn value(&self, name: &str) -> Option<&str> {
        self.parameters.iter().find(|p| p.0 == name).map(|p| p.1.as_str())
    }

    pub(super) fn needs(&self, name: &str) -> Result<String, ReadError> {
        let missing = || ReadError::deck(self.line, format!("*{} has no {name}=", self.keyword));
        self.value(name).filter(|v| !v.is_empty()).map(str::to_owned).ok_or_else(missing)
    }
}

/// All keywords of a deck.
#[derive(Default)]
pub(super) struct Text {
    pub(super) sections: Vec<Section>,
    /// Included files, each with the number of lines that come before it.
    files: Vec<(usize, String)>,
}

impl Text {
    /// The error with the line of the file that it is in.
    pub(super) fn placed(files: &[(usize, String)], mut error: ReadError) -> ReadError {
        let place = match &mut error {
            ReadError::Deck { place, .. } | ReadError::NonFinite { place, .. } | ReadError::Include { place, .. } => {
                place
            }
            _ => return error,
        };
        let Place::Line(line) = *place else { return error };
        match files.iter().rev().find(|(before, _)| *before < line) {
            Some((before, name)) => {
                *place = Place::Line(line - before);
                ReadError::Within { file: name.clone(), error: Box::new(error) }
            }
            None => error,
        }
    }

    /// The included files, each with the number of lines that come before it.
    pub(super) fn files(&self) -> &[(usize, String)] {
        &self.files
    }
}

/// The keywords of a deck and of the files that it includes.
///
/// # Errors
/// [`ReadError`] about an included file, with its place.
pub(super) fn read(bytes: &[u8], beside: &mut Beside<'_>) -> Result<Text, ReadError> {
    let mut reader =
        Reader { text: Text::default(), lines: 0, bytes: 0, open: Vec::new(), head: false, step: false, beside };
    let done = reader.file(bytes);
    let text = reader.text;
    done.map_err(|error| Text::placed(&text.files, error))?;
    Ok(text)
}

/// Files within files, and files of one deck: more of them are a mistake.
const DEEP: usize = 16;
const MANY: usize = 1000;

/// Bytes of memory for a byte of text: as for the deck itself ([`wfl_host::input::InputKind::Mesh`]).
const BYTES: u64 = 4;

struct Reader<'r, 'b> {
    text: Text,
    /// Of all files that were begun.
    lines: usize,
    /// Of all included files.
    bytes: u64,
    /// The included files that are being read.
    open: Vec<String>,
    /// The parameters of the last keyword may go on in the next line.
    head: bool,
    /// A step has begun.
    step: bool,
    beside: &'r mut Beside<'b>,
}

impl Reader<'_, '_> {
    fn file(&mut self, bytes: &[u8]) -> Result<(), ReadError> {
        let text = String::from_utf8_lossy(bytes);
        let before = self.lines;
        self.lines += text.lines().count();
        for (k, line) in text.lines().enumerate() {
            let line = line.trim();
            if !line.is_empty() && !line.starts_with("**") {
                self.line(before + k + 1, line)?;
            }
        }
        self.complete()
    }

    fn line(&mut self, number: usize, line: &str) -> Result<(), ReadError> {
        // a keyword goes on behind a comma at its end
        let goes_on = line.ends_with(',');
        if let Some(rest) = line.strip_prefix('*') {
            self.complete()?;
            let all = words(rest);
            let keyword = all.first().map(|w| w.to_uppercase()).unwrap_or_default();
            // blanks within a keyword are one
            let keyword = keyword.split_whitespace().collect::<Vec<_>>().join(" ");
            let parameters = parameters(all.get(1..).unwrap_or_default());
            self.text.sections.push(Section { line: number, keyword, parameters, data: Vec::new() });
            self.head = true;
            return if goes_on { Ok(()) } else { self.complete() };
        }
        let Some(last) = self.text.sections.last_mut() else { return Ok(()) };
        if self.head {
            last.parameters.extend(parameters(&words(line)));
            return if goes_on { Ok(()) } else { self.complete() };
        }
        last.data.push((number, words(line)));
        Ok(())
    }

    /// All parameters of the last keyword are known: reads the file that it names.
    fn complete(&mut self) -> Result<(), ReadError> {
        if !std::mem::take(&mut self.head) {
            return Ok(());
        }
        let Some(last) = self.text.sections.last() else { return Ok(()) };
        let line = last.line;
        self.step |= last.keyword == "STEP";
        let name = match last.keyword.as_str() {
            "INCLUDE" => Some(last.needs("INPUT")?),
            "NODE" | "ELEMENT" | "NSET" | "ELSET" | "SURFACE" => last.value("INPUT").map(str::to_owned),
            _ => None,
        };
        if last.keyword == "INCLUDE" {
            self.text.sections.pop();
        }
        match name.filter(|_| !self.step) {
            Some(name) => self.include(&name.replace('\\', "/"), line),
            None => Ok(()),
        }
    }

    fn include(&mut self, name: &str, line: usize) -> Result<(), ReadError> {
        if self.open.iter().any(|open| open == name) {
            let way = self.open.join("`, which includes `");
            return Err(ReadError::deck(line, format!("`{name}` includes itself: `{way}`, which includes `{name}`")));
        }
        if self.open.len() >= DEEP || self.text.files.len() >= MANY {
            let what = format!("more than {DEEP} files within each other, or {MANY} files, are included");
            return Err(ReadError::deck(line, what));
        }
        let missing =
            |error| ReadError::Include { file: name.to_owned(), error: Box::new(error), place: Place::Line(line) };
        let bytes = (self.beside)(name).map_err(missing)?;
        self.bytes = self.bytes.saturating_add(bytes.len() as u64);
        claim(self.bytes.saturating_mul(BYTES), "a deck with the files that it includes").map_err(MeshError::from)?;
        self.text.files.push((self.lines, name.to_owned()));
        self.open.push(name.to_owned());
        self.file(&bytes)?;
        self.open.pop();
        Ok(())
    }
}

/// Words between commas, without quotes and blanks around them; an empty one behind the last comma is left out.
fn words(line: &str) -> Vec<String> {
    let mut words: Vec<String> = line.split(',').map(|w| w.trim().trim_matches('"').trim().to_owned()).collect();
    if words.last().is_some_and(String::is_empty) {
        words.pop();
    }
    words
}

fn parameters(words: &[String]) -> Vec<(String, String)> {
    let pair = |w: &String| match w.split_once('=') {
        Some((name, value)) => (name.trim().to_uppercase(), value.trim().trim_matches('"').to_owned()),
        None => (w.to_uppercase(), String::new()),
    };
    words.iter().map(pair).collect()
}
