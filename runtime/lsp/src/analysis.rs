//! What is known of a scene from its text: messages, names, shapes. Made anew at every change of one of its texts.

use std::{
    cell::OnceCell,
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use wfl::{Code, Diagnostic, ResolvedScript, SourceId, SourceMap, Span};
use wfl_compiler::{About, about};
use wfl_problem::{Sketch, messages_without_mesh, without_auto};
use wfl_tasks::scene_file::{OpenTexts, plain_path, read_open_scene};

use crate::{
    contexts::{On, contexts, each_place},
    places::LIBRARY,
    symbols::{Key, Kind, Occurrence, occurrences},
};

/// A scene as its text shows it.
pub(crate) struct Analysis {
    pub(crate) sources: SourceMap,
    /// The resolved scene, with a number for every `auto`.
    pub(crate) script: ResolvedScript,
    /// What the text alone tells.
    pub(crate) messages: Vec<Diagnostic>,
    /// The dimension of space, where it is known.
    pub(crate) dim: Option<usize>,
    names: OnceCell<Names>,
}

/// The names of a scene and of all files it uses.
#[derive(Default)]
pub(crate) struct Names {
    /// By text.
    files: Vec<Vec<Occurrence>>,
    declared: BTreeMap<Key, Vec<Occurrence>>,
}

impl Names {
    /// The names of one text, in its order.
    pub(crate) fn of(&self, id: SourceId) -> &[Occurrence] {
        self.files.get(id.index()).map_or(&[], Vec::as_slice)
    }

    /// The name at a place of a text: the cursor is in it or behind it.
    pub(crate) fn at(&self, id: SourceId, offset: usize) -> Option<&Occurrence> {
        let inside = |o: &&Occurrence| o.span.start as usize <= offset && offset <= o.span.end as usize;
        self.of(id).iter().find(inside)
    }

    /// Where a name is declared: the text of the scene comes before the library, whose macros give way.
    pub(crate) fn declaration(&self, key: &Key) -> Option<&Occurrence> {
        self.declarations(key).first()
    }

    /// All declarations of a name; terms may share one.
    pub(crate) fn declarations(&self, key: &Key) -> &[Occurrence] {
        self.declared.get(key).map_or(&[], Vec::as_slice)
    }

    /// What a name was declared as.
    pub(crate) fn kind(&self, key: &Key) -> Option<Kind> {
        self.declaration(key).and_then(|d| d.declares)
    }

    /// Every place of a name.
    pub(crate) fn places<'n>(&'n self, key: &'n Key) -> impl Iterator<Item = &'n Occurrence> {
        self.files.iter().flatten().filter(move |o| o.key == *key)
    }

    /// All declarations.
    pub(crate) fn all(&self) -> impl Iterator<Item = &Occurrence> {
        self.declared.values().filter_map(|d| d.first())
    }
}

/// An expression with what it is.
pub(crate) struct Known {
    /// Where it stands in the text.
    pub(crate) span: Span,
    pub(crate) about: About,
}

impl Analysis {
    /// Reads a scene. `dim` is the dimension of its mesh, if that was made before.
    pub(crate) fn new(root: &Path, open: &OpenTexts, dim: Option<usize>) -> Result<Self, String> {
        let loaded = read_open_scene(root, open)?;
        let mut messages = loaded.messages;
        // the first stage of a scene with errors leaves the rest to the second, which needs no mesh
        messages.extend(messages_without_mesh(&loaded.script, dim));
        if messages.iter().any(Diagnostic::is_error) {
            // what a broken statement would have used is no leftover
            messages.retain(|d| d.code != Code::W702);
        }
        let script = without_auto(&loaded.script);
        let dim = Sketch::new(&script, dim).map(|s| s.env().dim);
        Ok(Self { sources: loaded.sources, script, messages, dim, names: OnceCell::new() })
    }

    /// The text that is a file.
    pub(crate) fn source(&self, path: &Path) -> Option<SourceId> {
        self.sources.iter().find(|s| plain_path(Path::new(&s.1.name)) == path).map(|s| s.0)
    }

    /// The files of the scene that are not of the library.
    pub(crate) fn own_files(&self) -> Vec<(SourceId, PathBuf)> {
        let own = self.sources.iter().filter(|s| !s.1.name.starts_with(LIBRARY));
        own.map(|(id, source)| (id, plain_path(Path::new(&source.name)))).collect()
    }

    pub(crate) fn is_library(&self, id: SourceId) -> bool {
        self.sources.get(id).name.starts_with(LIBRARY)
    }

    pub(crate) fn names(&self) -> &Names {
        self.names.get_or_init(|| {
            let mut names = Names::default();
            for (id, _) in self.sources.iter() {
                let found = occurrences(&self.sources, id);
                for o in found.iter().filter(|o| o.declares.is_some()) {
                    names.declared.entry(o.key.clone()).or_default().push(o.clone());
                }
                names.files.push(found);
            }
            for list in names.declared.values_mut() {
                list.sort_by_key(|o| (self.is_library(o.span.source), o.span.source.index(), o.span.start));
            }
            names
        })
    }

    pub(crate) fn sketch(&self) -> Option<Sketch<'_>> {
        Sketch::new(&self.script, self.dim)
    }

    /// The smallest expression around a place of a text, and what it is.
    pub(crate) fn expression_at(&self, id: SourceId, offset: usize) -> Option<Known> {
        let sketch = self.sketch()?;
        let mut found: Option<(Span, &wfl::ast::Expr, On<'_>)> = None;
        for context in contexts(&self.script) {
            each_place(&self.script, context.expr, &mut |span, e, _| {
                let inside = span.source == id && span.start as usize <= offset && offset < span.end as usize;
                let smaller = found.is_none_or(|f| span.end - span.start < f.0.end - f.0.start);
                if inside && smaller {
                    found = Some((span, e, context.place));
                }
            });
        }
        let (span, e, place) = found?;
        let about = about(&sketch.env(), &place.sig(&sketch)?, e)?;
        Some(Known { span, about })
    }

    /// What the macros declared in a text are where they are used first, by the end of their heads.
    pub(crate) fn macros_of(&self, id: SourceId) -> Vec<(Span, About)> {
        let Some(sketch) = self.sketch() else { return Vec::new() };
        let env = sketch.env();
        let mut found: BTreeMap<(u32, u32), Option<About>> = BTreeMap::new();
        for context in contexts(&self.script) {
            each_place(&self.script, context.expr, &mut |_, e, used| {
                let Some(head) = used.and_then(|u| self.script.expansions.list.get(u.index())).map(|x| x.definition)
                else {
                    return;
                };
                if head.source == id && !found.get(&(head.start, head.end)).is_some_and(Option::is_some) {
                    let sig = context.place.sig(&sketch);
                    found.insert((head.start, head.end), sig.and_then(|sig| about(&env, &sig, e)));
                }
            });
        }
        let span = |at: (u32, u32)| Span { source: id, start: at.0, end: at.1 };
        found.into_iter().filter_map(|(at, about)| Some((span(at), about?))).collect()
    }
}
