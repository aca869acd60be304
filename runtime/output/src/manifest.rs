//! `manifest.json`: which files of a results folder belong to the program.
//!
//! Promises: it names every file that the program wrote into the folder, with the sizes and hashes that it may have,
//! and the identity of the run; a damaged line is detected; the manifest of a killed process can be read. It has one
//! line for each file, so a file is added by appending, and the closing brackets follow when the writer ends. A line is
//! written before its file gets its name: a file without a line does not belong to the program.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{Hash, Identity, check_name};

/// The name of the manifest in a results folder.
pub const MANIFEST_FILE: &str = "manifest.json";
/// Grows when the layout changes.
const FORMAT: u32 = 1;
/// How the file begins: distinguishes it from others of this name.
const BEGINNING: &str = "{\"wfl_manifest\":";
/// What stands before the hash of a line.
const CHECK: &str = ",\"check\":\"";
/// The last line of a manifest whose writer has ended.
const END: &str = "]}";

/// What a folder holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Results of one run.
    Run,
    /// Table, page and references of sweeps.
    Sweep,
    /// Charts of a page about a run.
    Charts,
}

impl Kind {
    /// In words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Kind::Run => "the results of a run",
            Kind::Sweep => "the table of a sweep",
            Kind::Charts => "the charts of a report",
        }
    }
}

/// How far the writer of a folder got.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// It writes, or was killed.
    Running,
    /// It ended before everything was done.
    Stopped,
    /// Everything was done.
    Finished,
}

/// What a file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Content {
    /// Size in bytes; `None` where the hash is not that of all of them.
    pub(super) size: Option<u64>,
    /// Hash of its bytes, or of that part of its content that a run decides.
    pub(super) hash: Hash,
}

/// What is known of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Owned {
    /// What it may hold, the latest last: a process that is killed while it replaces a file leaves the one or the
    /// other. Empty for a file that checks itself.
    pub(super) contents: Vec<Content>,
    /// An earlier run wrote it; this one has not replaced it yet.
    pub(super) former: bool,
}

/// Contents kept of a file.
const KEPT: usize = 2;

impl Owned {
    pub(super) fn add(&mut self, content: Option<Content>) {
        if std::mem::take(&mut self.former) {
            self.contents.clear();
        }
        let Some(content) = content else { return self.contents.clear() };
        self.contents.retain(|c| *c != content);
        self.contents.push(content);
        let extra = self.contents.len().saturating_sub(KEPT);
        self.contents.drain(..extra);
    }

    /// The writer has ended: the file has its last content.
    pub(super) fn settle(&mut self) {
        let extra = self.contents.len().saturating_sub(1);
        self.contents.drain(..extra);
    }
}

/// The files of a folder and what they belong to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Manifest {
    pub(super) kind: Kind,
    pub(super) state: State,
    pub(super) identity: Identity,
    pub(super) files: BTreeMap<String, Owned>,
}

/// Why a manifest cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Unusable {
    /// It is something else of that name.
    Foreign,
    /// It was written by another version.
    Format(u32),
    /// This line, counted from 1, is not what was written.
    Line(usize),
    /// Lines are missing at its end.
    Cut,
}

#[derive(Serialize, Deserialize)]
struct Head {
    wfl_manifest: u32,
    kind: Kind,
    state: State,
    identity: Identity,
}

#[derive(Serialize, Deserialize)]
struct FileLine {
    name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    size: Option<u64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    hash: Option<Hash>,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    former: bool,
}

impl Manifest {
    pub(super) fn new(kind: Kind, identity: Identity) -> Self {
        Self { kind, state: State::Running, identity, files: BTreeMap::new() }
    }

    /// The whole file, files in the order of their names.
    ///
    /// # Errors
    /// An identity that is no JSON; there is none.
    pub(super) fn text(&self) -> Result<String, serde_json::Error> {
        let head = Head { wfl_manifest: FORMAT, kind: self.kind, state: self.state, identity: self.identity.clone() };
        let mut text = checked(&serde_json::to_string(&head)?, ",\"files\":[");
        text.push('\n');
        let mut before = "";
        for (name, owned) in &self.files {
            let contents = owned.contents.iter().map(|c| Some(*c));
            for content in contents.chain(owned.contents.is_empty().then_some(None)) {
                text += before;
                text += &line(name, content, owned.former)?;
                before = ",";
            }
        }
        if self.state != State::Running {
            text += END;
            text.push('\n');
        }
        Ok(text)
    }

    /// Reads the file.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, Unusable> {
        if !bytes.starts_with(BEGINNING.as_bytes()) {
            return Err(Unusable::Foreign);
        }
        let lines: Vec<&[u8]> = bytes.split_inclusive(|b| *b == b'\n').collect();
        let head = lines.first().and_then(|l| l.strip_suffix(b",\"files\":[\n"));
        let head = head.and_then(unchecked).ok_or_else(|| other_format(bytes).unwrap_or(Unusable::Line(1)))?;
        let head: Head = serde_json::from_slice(&head).map_err(|_| Unusable::Line(1))?;
        let mut found = Self { state: head.state, ..Self::new(head.kind, head.identity) };
        let (mut ended, n) = (false, lines.len());
        for (k, one) in lines.into_iter().enumerate().skip(1) {
            let whole = !ended && k + 1 == n && one == b"]}\n";
            let torn = k + 1 == n && found.state == State::Running;
            match file_line(one) {
                _ if whole => ended = true,
                Some(file) if !ended => found.add(file),
                // a process that is killed, or a disc that is full, leaves a part of the last line
                _ if torn && !one.ends_with(b"\n") => break,
                _ => return Err(Unusable::Line(k + 1)),
            }
        }
        if ended == (found.state == State::Running) { Err(Unusable::Cut) } else { Ok(found) }
    }

    fn add(&mut self, file: FileLine) {
        let content = file.hash.map(|hash| Content { size: file.size, hash });
        let owned = self.files.entry(file.name).or_default();
        if file.former {
            owned.contents.extend(content);
            owned.former = true;
        } else {
            owned.add(content);
        }
    }
}

/// A line about a file, without the comma before it.
pub(super) fn line(name: &str, content: Option<Content>, former: bool) -> Result<String, serde_json::Error> {
    let name = name.to_owned();
    let file = FileLine { name, size: content.and_then(|c| c.size), hash: content.map(|c| c.hash), former };
    Ok(checked(&serde_json::to_string(&file)?, "}\n"))
}

fn file_line(line: &[u8]) -> Option<FileLine> {
    let line = line.strip_prefix(b",").unwrap_or(line);
    let file: FileLine = serde_json::from_slice(&unchecked(line.strip_suffix(b"}\n")?)?).ok()?;
    // whoever can write a line can make its hash: no name leads out of the folder
    check_name(&file.name).is_ok().then_some(file)
}

/// An object with its hash as last member and `end` in place of its closing brace.
fn checked(object: &str, end: &str) -> String {
    let open = object.strip_suffix('}').unwrap_or(object);
    format!("{open}{CHECK}{}\"{end}", Hash::of(open.as_bytes()))
}

/// The object of which [`checked`] made a line, without what stands behind its hash; `None` if it was changed.
fn unchecked(line: &[u8]) -> Option<Vec<u8>> {
    /// Digits of a hash.
    const DIGITS: usize = 32;
    let at = line.len().checked_sub(CHECK.len() + DIGITS + 1)?;
    let (open, end) = line.split_at(at);
    let whole = format!("{CHECK}{}\"", Hash::of(open)).as_bytes() == end;
    whole.then(|| [open, b"}"].concat())
}

/// The layout of a file that another version wrote.
fn other_format(bytes: &[u8]) -> Option<Unusable> {
    let rest = std::str::from_utf8(bytes.get(BEGINNING.len()..)?.split(|b| *b == b',').next()?).ok()?;
    let format = rest.parse().ok()?;
    (format != FORMAT).then_some(Unusable::Format(format))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(state: State) -> Manifest {
        let mut one = Manifest::new(Kind::Run, Identity { version: "0.1".into(), ..Identity::default() });
        one.state = state;
        let content = |text: &str| Content { size: Some(text.len() as u64), hash: Hash::of(text.as_bytes()) };
        for (name, texts) in [("a.csv", &["x"][..]), ("σ, ü.csv", &["y", "yy"]), ("checkpoint", &[])] {
            let owned = one.files.entry(name.to_owned()).or_default();
            texts.iter().for_each(|t| owned.add(Some(content(t))));
        }
        one.files.entry("old.csv".to_owned()).or_default().former = true;
        one
    }

    #[test]
    fn what_is_written_is_read_back_and_whole_files_are_json() {
        for state in [State::Running, State::Stopped, State::Finished] {
            let one = sample(state);
            let text = one.text().unwrap();
            assert_eq!(Manifest::read(text.as_bytes()).as_ref(), Ok(&one));
            assert_eq!(serde_json::from_str::<serde_json::Value>(&text).is_ok(), state != State::Running);
        }
    }

    #[test]
    fn a_line_that_is_appended_counts_and_a_torn_one_does_not() {
        let mut one = sample(State::Running);
        let text = one.text().unwrap();
        let content = Content { size: Some(3), hash: Hash::of(b"abc") };
        let more = format!(",{}", line("new.csv", Some(content), false).unwrap());
        for cut in 0..more.len() - 1 {
            let torn = [text.as_bytes(), &more.as_bytes()[..cut]].concat();
            assert_eq!(Manifest::read(&torn).as_ref(), Ok(&one), "{cut}");
        }
        one.files.entry("new.csv".to_owned()).or_default().add(Some(content));
        assert_eq!(Manifest::read((text + &more).as_bytes()), Ok(one));
    }

    #[test]
    fn every_change_of_a_byte_and_every_cut_is_noticed() {
        for state in [State::Running, State::Finished] {
            let one = sample(state);
            let bytes = one.text().unwrap().into_bytes();
            for at in 0..bytes.len() {
                let mut changed = bytes.clone();
                changed[at] ^= 1;
                // only the end of a manifest whose writer was killed may be missing
                let last = state == State::Running && at >= bytes.len() - 1;
                assert!(last || Manifest::read(&changed).is_err(), "byte {at}");
                let cut = Manifest::read(&bytes[..at]);
                assert!(cut.is_err() || state == State::Running, "cut at {at}");
            }
            assert!(Manifest::read(&[&bytes[..], b"\n"].concat()).is_err());
        }
        for name in ["../up", "/etc/passwd", ".wfl-lock", "a/b"] {
            let mut one = sample(State::Finished);
            one.files.entry(name.to_owned()).or_default();
            assert!(Manifest::read(one.text().unwrap().as_bytes()).is_err(), "{name}");
        }
        assert_eq!(Manifest::read(b"{\"name\":\"a web page\"}"), Err(Unusable::Foreign));
        assert_eq!(Manifest::read(b"{\"wfl_manifest\":2,\"kind\":1}\n"), Err(Unusable::Format(2)));
    }
}
