//! Whether a scene means the same once a name has become another one.
//!
//! The scene is read again with its new texts: every word has to belong to the declaration that it belonged to before,
//! every use of a macro to its definition, and nothing is told that was not told before. Changes no text.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use wfl::{Diagnostic, SourceId, Span};
use wfl_tasks::scene_file::{OpenTexts, plain_path};

use crate::{
    analysis::Analysis,
    symbols::{Key, Kind},
};

/// A name, what it is to become, and its places in the files of all scenes, sorted.
pub(crate) struct Renaming<'a> {
    pub(crate) key: &'a Key,
    pub(crate) new: &'a str,
    pub(crate) places: &'a BTreeMap<PathBuf, Vec<(usize, usize)>>,
}

impl Renaming<'_> {
    /// Why a scene would not mean the same; `open` has the texts as they are now.
    pub(crate) fn changes(&self, before: &Analysis, open: &OpenTexts) -> Option<String> {
        let mut texts = open.clone();
        for (id, path) in before.own_files() {
            texts.insert(path.clone(), self.text(&before.sources.get(id).text, &path));
        }
        let root = before.sources.iter().next().map(|(_, main)| plain_path(Path::new(&main.name)))?;
        let after = match Analysis::new(&root, &texts, before.dim) {
            Ok(after) => after,
            Err(why) => return Some(why),
        };
        let compared = Compared { renaming: self, before, after: &after };
        compared.captured().or_else(|| compared.told())
    }

    fn text(&self, text: &str, path: &Path) -> String {
        let (mut out, mut at) = (String::new(), 0);
        for (start, end) in self.places.get(path).into_iter().flatten() {
            out.push_str(&text[at..*start]);
            out.push_str(self.new);
            at = *end;
        }
        out + &text[at..]
    }
}

/// A scene with the former name and with the new one.
struct Compared<'a> {
    renaming: &'a Renaming<'a>,
    before: &'a Analysis,
    after: &'a Analysis,
}

impl Compared<'_> {
    /// A word that would belong to another declaration, or a use of a macro to another definition.
    fn captured(&self) -> Option<String> {
        let (names, new_names) = (self.before.names(), self.after.names());
        for (id, source) in self.before.sources.iter() {
            let same_file = self.after.sources.iter().any(|(new, other)| new == id && other.name == source.name);
            let (words, new_words) = (names.of(id), new_names.of(id));
            if !same_file || words.len() != new_words.len() {
                return Some(format!("`{}` would have other words", source.name));
            }
            for (word, new) in words.iter().zip(new_words) {
                let expected = self.key(&word.key);
                let declared = names.declaration(&word.key).map(|d| self.place(d.span));
                let now = new_names.declaration(&new.key);
                if new.key != expected || declared != now.map(|d| (d.span.source, d.span.start)) {
                    let what = now.and_then(|d| d.declares).map_or("a word of the language", Kind::word);
                    return Some(self.on_line(word.span, &format!("would be another one: {what}")));
                }
            }
        }
        let uses = self.before.script.expansions.list.iter();
        let mut new_uses = self.after.script.expansions.list.iter();
        for of in uses {
            let now = new_uses.next().map(|of| (of.definition.source, of.definition.start));
            if now != Some(self.place(of.definition)) {
                return Some(self.on_line(of.call, &format!("would use another macro than `{}`", of.name)));
            }
        }
        None
    }

    /// What would be told that is not told now.
    fn told(&self) -> Option<String> {
        let count = |messages: &[Diagnostic], code| messages.iter().filter(|d| d.code == code).count();
        let is_new = |d: &&Diagnostic| count(&self.after.messages, d.code) > count(&self.before.messages, d.code);
        let new = self.after.messages.iter().find(is_new)?;
        Some(format!("{} [{}]", new.message, new.code))
    }

    /// The key of a name in the new texts.
    fn key(&self, key: &Key) -> Key {
        let is_it = key == self.renaming.key;
        let name = |name: &String| if is_it { self.renaming.new.to_owned() } else { name.clone() };
        match key {
            Key::Value(n) => Key::Value(name(n)),
            Key::Region(n) => Key::Region(name(n)),
            Key::Term(n) => Key::Term(name(n)),
            Key::Local(source, start, n) => {
                let id = self.before.sources.iter().map(|s| s.0).find(|id| id.index() == *source);
                let start = id.map_or(*start, |source| self.place(Span { source, start: *start, end: *start }).1);
                Key::Local(*source, start, name(n))
            }
        }
    }

    /// Where a place is in the new texts.
    fn place(&self, span: Span) -> (SourceId, u32) {
        let path = plain_path(Path::new(&self.before.sources.get(span.source).name));
        let places = self.renaming.places.get(&path).map_or(&[][..], Vec::as_slice);
        let before = places.iter().filter(|(start, _)| *start < span.start as usize);
        let (gone, n) = before.fold((0, 0), |(gone, n), (start, end)| (gone + end - start, n + 1));
        let start = span.start as usize + n * self.renaming.new.len() - gone;
        // texts are at most 4 MB
        (span.source, start as u32)
    }

    fn on_line(&self, span: Span, what: &str) -> String {
        let (line, _) = self.before.sources.line_column(span);
        let (file, word) = (&self.before.sources.get(span.source).name, self.before.sources.snippet(span));
        let file = Path::new(file).file_name().map_or_else(|| file.clone(), |n| n.to_string_lossy().into_owned());
        format!("`{word}` on line {line} of {file} {what}")
    }
}
