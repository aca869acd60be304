//! `use "file"`: the statements of other files in place of the statement. Reads nothing itself; a [`Loader`] does.

use std::collections::BTreeSet;

use crate::{
    ast::{Item, ItemKind, MacroDef},
    codes::Code,
    diag::Diagnostic,
    lost::Lost,
    parse::parse,
    source::{SourceId, SourceMap, Span},
    walk::each_name,
};

/// Reads the files that a scene names.
pub trait Loader {
    /// Name to be shown and text of the file that the text `from` calls `path`. The same file must always get the
    /// same name, since a file is included once.
    ///
    /// # Errors
    /// Why there is no such text.
    fn load(&mut self, path: &str, from: SourceId) -> Result<(String, String), Unloaded>;

    /// Text of the table that an expression of the scene calls `path`, seen from the scene as meshes and data are.
    ///
    /// # Errors
    /// Why there is no such text.
    fn table(&mut self, path: &str) -> Result<String, Unloaded> {
        let _ = path;
        Err("no files can be read here".to_owned().into())
    }
}

/// Why a file gives no text.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Unloaded {
    /// In words that can stand behind "cannot read: ".
    pub why: String,
    /// There is no such file, so one of another name may be meant.
    pub missing: bool,
    /// The scene may not read it (E217).
    pub outside: bool,
    /// What to do.
    pub help: Option<String>,
}

impl From<String> for Unloaded {
    /// There is no such file.
    fn from(why: String) -> Self {
        Self { why, missing: true, ..Self::default() }
    }
}

/// A loader for scenes without files of their own: only the library can be used.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoFiles;

impl Loader for NoFiles {
    fn load(&mut self, _path: &str, _from: SourceId) -> Result<(String, String), Unloaded> {
        Err("no files can be read here".to_owned().into())
    }
}

/// The library: used when no file of that name lies beside the scene.
pub const LIBRARY: &[(&str, &str)] = &[
    ("contact.wfl", include_str!("../../std/contact.wfl")),
    ("elasticity.wfl", include_str!("../../std/elasticity.wfl")),
    ("polar.wfl", include_str!("../../std/polar.wfl")),
    ("poro.wfl", include_str!("../../std/poro.wfl")),
    ("sliding.wfl", include_str!("../../std/sliding.wfl")),
];

/// The ending of the texts of scenes.
const ENDING: &str = ".wfl";

/// Included files may name files in turn, this deep.
const INCLUDE_DEPTH: usize = 50;

/// Whose a text is.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Origin {
    Scene,
    Library,
}

/// Macros of the library in whose place those of the scene stand.
pub(super) struct Replaced {
    macros: Vec<MacroDef>,
    /// The sources that are of the library.
    library: BTreeSet<usize>,
}

impl Replaced {
    /// W704 for macros of the scene that others of the library are made with which it uses: a `strain` of its own changes `work`, too.
    /// None where the two say the same.
    pub(super) fn in_use<'d>(
        &self,
        sources: &SourceMap,
        defs: impl Iterator<Item = (&'d MacroDef, bool)> + Clone,
    ) -> Vec<Diagnostic> {
        let plain = |d: &MacroDef| {
            let text = sources.snippet(d.body.span);
            let names = d.formals.iter().map(|f| f.name.as_str()).collect::<Vec<_>>().join(",");
            format!("{names}={}", text.split_whitespace().collect::<String>())
        };
        let of_library = |d: &MacroDef| self.library.contains(&d.head.source.index());
        let mut found = Vec::new();
        for before in &self.macros {
            let name = &before.name.name;
            let reads = |d: &MacroDef| {
                let mut reads = false;
                each_name(&d.body, &mut |word| reads |= word == name && !d.formals.iter().any(|f| f.name == word));
                reads
            };
            let users = defs.clone().filter(|(d, used)| *used && of_library(d) && reads(d));
            let users: Vec<String> = users.map(|(d, _)| format!("`{}`", d.name.name)).collect();
            // one of other parameters is not what these call
            let alike = |d: &&MacroDef| d.formals.len() == before.formals.len();
            let own = defs.clone().map(|(d, _)| d).find(|d| d.name.name == *name && !of_library(d)).filter(alike);
            let Some(own) = own.filter(|own| !users.is_empty() && plain(own) != plain(before)) else { continue };
            let users = users.join(", ");
            let d = Diagnostic::new(Code::W704, format!("`{name}` takes the place of that of the library"))
                .at(
                    own.head,
                    format!(
                        "{users} of the library, which the scene uses, {} it, too",
                        if users.contains(' ') { "read" } else { "reads" }
                    ),
                )
                .at(before.head, "that of the library");
            found.push(d.help(format!("another name, if {users} should stay as they are")));
        }
        found
    }
}

/// The statements of a text with those of its included files in place.
pub(super) struct Includes<'a> {
    pub(super) sources: &'a mut SourceMap,
    pub(super) loader: &'a mut dyn Loader,
    items: Vec<Item>,
    diagnostics: Vec<Diagnostic>,
    lost: Lost,
    /// Files being read, outermost first, and whose each is.
    open: Vec<(String, Origin)>,
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

    /// All statements, what was found, what broken statements would have declared, and which macros were replaced. A macro of the
    /// library gives way to one of the scene of the same name, so that a scene can say what `trac` is and still use `nitsche`.
    pub(super) fn finish(mut self) -> (Vec<Item>, Vec<Diagnostic>, Lost, Replaced) {
        let of_library = |item: &Item| self.library.contains(&item.span.source.index());
        let own: BTreeSet<String> = self
            .items
            .iter()
            .filter(|i| !of_library(i))
            .filter_map(|i| if let ItemKind::Def(d) = &i.kind { Some(d.name.name.clone()) } else { None })
            .collect();
        let gives_way = |i: &Item| match &i.kind {
            ItemKind::Def(d) if of_library(i) && own.contains(&d.name.name) => Some(d.clone()),
            _ => None,
        };
        let replaced = self.items.iter().filter_map(gives_way).collect();
        self.items.retain(|i| gives_way(i).is_none());
        (self.items, self.diagnostics, self.lost, Replaced { macros: replaced, library: self.library })
    }

    /// Reads the text `id` and everything it uses.
    pub(super) fn read(&mut self, id: SourceId, origin: Origin) {
        self.open.push((self.sources.get(id).name.clone(), origin));
        let parsed = parse(self.sources, id);
        self.diagnostics.extend(parsed.diagnostics);
        let script = parsed.value.unwrap_or_default();
        self.lost.extend(script.lost);
        for (place, item) in script.items.into_iter().enumerate() {
            match item.kind {
                ItemKind::Use { ref path } => self.include(path, item.span, id),
                ItemKind::Version(version) => self.version(version, place, item.span),
                _ => self.items.push(item),
            }
        }
        if let Some((name, _)) = self.open.pop() {
            self.done.insert(name);
        }
    }

    /// The version of the language, the statement with this place in its file.
    fn version(&mut self, version: f64, place: usize, span: Span) {
        if version != 1.0 {
            let d = Diagnostic::new(Code::E126, format!("version {version} of the language is not known"));
            self.diagnostics.push(d.at(span, "this program reads version 1"));
        } else if place > 0 {
            let d = Diagnostic::new(Code::E126, "the version stands before every other statement");
            self.diagnostics.push(d.at(span, "").help("move this line to the top of the file"));
        }
    }

    fn include(&mut self, path: &str, span: Span, from: SourceId) {
        let (name, text, origin) = match self.find(path, from) {
            Ok(found) => found,
            Err(not) => {
                let code = if not.outside { Code::E217 } else { Code::E213 };
                let d = Diagnostic::new(code, format!("cannot read \"{path}\": {}", not.why)).at(span, "");
                let d = if not.missing { d.note(self.library_has()) } else { d };
                self.diagnostics.push(match not.help {
                    Some(help) => d.help(help),
                    None => d,
                });
                self.lost.add_everything();
                return;
            }
        };
        if let Some(at) = self.open.iter().position(|(n, _)| *n == name) {
            let mut cycle: Vec<&str> = self.open[at..].iter().map(|(n, _)| n.as_str()).collect();
            cycle.push(&name);
            let d = Diagnostic::new(Code::E214, format!("\"{path}\" is used by itself")).at(span, "");
            self.diagnostics.push(d.note(cycle.join(" -> ")));
            return;
        }
        if self.open.len() >= INCLUDE_DEPTH {
            let d = Diagnostic::new(Code::E214, format!("files use each other more than {INCLUDE_DEPTH} deep"));
            self.diagnostics.push(d.at(span, ""));
            return;
        }
        if !self.done.contains(&name) {
            let id = self.sources.add(name, text);
            if origin == Origin::Library {
                self.library.insert(id.index());
            }
            self.read(id, origin);
        }
    }

    fn library_has(&self) -> String {
        let known: Vec<String> = LIBRARY.iter().map(|l| format!("\"{}\"", l.0.trim_end_matches(ENDING))).collect();
        format!("the library has {}", known.join(", "))
    }

    /// Name, text and origin. The ending may be left out; no file of another ending is read, since
    /// messages show lines of it. Inside the library the library is asked first.
    fn find(&mut self, path: &str, from: SourceId) -> Result<(String, String, Origin), Unloaded> {
        let whole = if path.ends_with(ENDING) { path.to_owned() } else { format!("{path}{ENDING}") };
        let named = |l: &(&str, &str)| (format!("<library>/{whole}"), l.1.to_owned(), Origin::Library);
        let library = || LIBRARY.iter().find(|l| l.0 == whole).map(named);
        let in_library = self.open.last().is_some_and(|o| o.1 == Origin::Library);
        if in_library && let Some(found) = library() {
            return Ok(found);
        }
        match self.loader.load(&whole, from) {
            Ok((name, text)) => Ok((name, text, Origin::Scene)),
            // a file that is there and cannot be read is not replaced by another one
            Err(not) if !not.missing => Err(not),
            Err(not) => library().ok_or_else(|| match path.rsplit_once('.') {
                Some((_, ending)) if path != whole && !ending.contains('/') => Unloaded {
                    help: Some(format!(
                        "files of a scene end in {ENDING}; meshes and data are read by `mesh` and `data`"
                    )),
                    ..not
                },
                _ => not,
            }),
        }
    }
}
