//! `use "file"`: the statements of other files in place of the statement. Reads nothing itself; a [`Loader`] does.

use std::collections::BTreeSet;

use crate::{
    ast::{Item, ItemKind},
    diag::Diagnostic,
    lost::Lost,
    parse::parse,
    source::{SourceId, SourceMap, Span},
};

/// Reads the files that a scene names.
pub trait Loader {
    /// Name to be shown and text of the file that the text `from` calls `path`. The same file must always get the
    /// same name, since a file is included once.
    ///
    /// # Errors
    /// Why the file cannot be read, in words that can stand behind "cannot read: ".
    fn load(&mut self, path: &str, from: SourceId) -> Result<(String, String), String>;
}

/// A loader for scenes without files of their own: only the library can be used.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoFiles;

impl Loader for NoFiles {
    fn load(&mut self, _path: &str, _from: SourceId) -> Result<(String, String), String> {
        Err("no files can be read here".to_owned())
    }
}

/// The library: used when no file of that name lies beside the scene.
pub const LIBRARY: &[(&str, &str)] = &[
    ("contact.wfl", include_str!("../../std/contact.wfl")),
    ("elasticity.wfl", include_str!("../../std/elasticity.wfl")),
];

/// Included files may name files in turn, this deep.
const INCLUDE_DEPTH: usize = 50;

/// The statements of a text with those of its included files in place.
pub(super) struct Includes<'a> {
    pub(super) sources: &'a mut SourceMap,
    pub(super) loader: &'a mut dyn Loader,
    items: Vec<Item>,
    diagnostics: Vec<Diagnostic>,
    lost: Lost,
    /// Files being read, outermost first, and whether each is a library file.
    open: Vec<(String, bool)>,
    done: BTreeSet<String>,
    library: BTreeSet<usize>,
}

impl<'a> Includes<'a> {
    pub(super) fn new(sources: &'a mut SourceMap, loader: &'a mut dyn Loader) -> Self {
        Self {
            sources,
            loader,
            items: Vec::new(),
            diagnostics: Vec::new(),
            lost: Lost::default(),
            open: Vec::new(),
            done: BTreeSet::new(),
            library: BTreeSet::new(),
        }
    }

    /// All statements, what was found, and what broken statements would have declared. A macro of the library gives way
    /// to one of the scene of the same name, so that a scene can say what `trac` is and still use `nitsche`.
    pub(super) fn finish(mut self) -> (Vec<Item>, Vec<Diagnostic>, Lost) {
        let of_library = |item: &Item| self.library.contains(&item.span.source.index());
        let own: BTreeSet<String> = self
            .items
            .iter()
            .filter(|i| !of_library(i))
            .filter_map(|i| if let ItemKind::Def(d) = &i.kind { Some(d.name.name.clone()) } else { None })
            .collect();
        self.items.retain(|i| match &i.kind {
            ItemKind::Def(d) => !of_library(i) || !own.contains(&d.name.name),
            _ => true,
        });
        (self.items, self.diagnostics, self.lost)
    }

    /// Reads the text `id` and everything it uses.
    pub(super) fn read(&mut self, id: SourceId, library: bool) {
        self.open.push((self.sources.get(id).name.clone(), library));
        let parsed = parse(self.sources, id);
        self.diagnostics.extend(parsed.diagnostics);
        let mut first = true;
        let script = parsed.value.unwrap_or_default();
        self.lost.extend(script.lost);
        for item in script.items {
            match item.kind {
                ItemKind::Use { ref path } => self.include(path, item.span, id),
                ItemKind::Version(version) => self.version(version, first, item.span),
                _ => self.items.push(item),
            }
            first = false;
        }
        if let Some((name, _)) = self.open.pop() {
            self.done.insert(name);
        }
    }

    fn version(&mut self, version: f64, first: bool, span: Span) {
        if version != 1.0 {
            let d = Diagnostic::new("E126", format!("version {version} of the language is not known"));
            self.diagnostics.push(d.at(span, "this program reads version 1"));
        } else if !first {
            let d = Diagnostic::new("E126", "the version stands before every other statement");
            self.diagnostics.push(d.at(span, "").help("move this line to the top of the file"));
        }
    }

    fn include(&mut self, path: &str, span: Span, from: SourceId) {
        let (name, text, library) = match self.find(path, from) {
            Ok(found) => found,
            Err(why) => {
                let known = LIBRARY.iter().map(|l| l.0).collect::<Vec<_>>().join(", ");
                let d = Diagnostic::new("E213", format!("cannot read \"{path}\": {why}")).at(span, "");
                self.diagnostics.push(d.note(format!("the library has {known}")));
                self.lost.add_everything();
                return;
            }
        };
        if let Some(at) = self.open.iter().position(|(n, _)| *n == name) {
            let mut cycle: Vec<&str> = self.open[at..].iter().map(|(n, _)| n.as_str()).collect();
            cycle.push(&name);
            let d = Diagnostic::new("E214", format!("\"{path}\" is used by itself")).at(span, "");
            self.diagnostics.push(d.note(cycle.join(" -> ")));
            return;
        }
        if self.open.len() >= INCLUDE_DEPTH {
            let d = Diagnostic::new("E214", format!("files use each other more than {INCLUDE_DEPTH} deep"));
            self.diagnostics.push(d.at(span, ""));
            return;
        }
        if !self.done.contains(&name) {
            let id = self.sources.add(name, text);
            if library {
                self.library.insert(id.index());
            }
            self.read(id, library);
        }
    }

    /// Name, text and whether it is of the library. Inside the library the library is asked first.
    fn find(&mut self, path: &str, from: SourceId) -> Result<(String, String, bool), String> {
        let library =
            || LIBRARY.iter().find(|l| l.0 == path).map(|l| (format!("<library>/{path}"), l.1.to_owned(), true));
        let in_library = self.open.last().is_some_and(|o| o.1);
        if in_library && let Some(found) = library() {
            return Ok(found);
        }
        match self.loader.load(path, from) {
            Ok((name, text)) => Ok((name, text, false)),
            Err(why) => library().ok_or(why),
        }
    }
}
