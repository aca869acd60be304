//! No circle among the files of a crate: the paths that one file takes from another, read as text.
//!
//! An arrow runs from a file to the file that defines what a path names, through re-exports and the `use` of other modules. Naming alone is no arrow:
//! `mod`, `pub use`, and what a part takes from the modules that it lies in (their words are its own). Calls of methods
//! have no path and are not seen. Tests inside a file do not count.

use std::collections::{BTreeMap, BTreeSet};

use super::{arrows::ARROWS, sources};

/// A module by its path in the crate; the crate itself is empty.
type Module = Vec<String>;

/// Arrows of a crate: for each module those that it takes something from, with the names.
type Arrows = BTreeMap<Module, BTreeMap<Module, BTreeSet<String>>>;

/// Crates whose circles are still to be opened, and how many they have. The list only shrinks.
const LEFT: &[(&str, usize)] = &[];

/// A path of a `use` statement, or one that stands in code, with the name it is known by.
struct Use {
    path: Module,
    name: String,
    public: bool,
}

/// The text of a file without comments, texts and tests.
fn bare(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(text);
    let mut out = String::new();
    for line in text.lines() {
        let (mut quoted, mut escaped, mut before) = (false, false, ' ');
        for c in line.chars() {
            if !quoted && c == '/' && before == '/' {
                out.pop();
                break;
            }
            match c {
                _ if escaped => escaped = false,
                '\\' if quoted => escaped = true,
                '"' if before != '\'' => quoted = !quoted,
                c if !quoted => out.push(c),
                _ => {}
            }
            before = c;
        }
        out.push('\n');
    }
    out
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Words, `::` and brackets of a `use` statement.
fn tokens(text: &str) -> Vec<&str> {
    let mut found = Vec::new();
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let n = match c {
            c if is_word(c) => rest.find(|c| !is_word(c)).unwrap_or(rest.len()),
            ':' if rest.starts_with("::") => 2,
            c => c.len_utf8(),
        };
        if !c.is_whitespace() {
            found.push(&rest[..n]);
        }
        rest = &rest[n..];
    }
    found
}

/// The paths of a tree of a `use` statement.
fn leaves(tokens: &[&str], at: &mut usize, prefix: &[String], public: bool, out: &mut Vec<Use>) {
    let mut path = prefix.to_vec();
    let mut name = None;
    while let Some(token) = tokens.get(*at) {
        match *token {
            "{" => {
                *at += 1;
                while tokens.get(*at).is_some_and(|t| *t != "}") {
                    leaves(tokens, at, &path, public, out);
                    *at += usize::from(tokens.get(*at) == Some(&","));
                }
                *at += 1;
                return;
            }
            "," | "}" => break,
            "::" => *at += 1,
            "as" => {
                name = tokens.get(*at + 1).map(|t| (*t).to_owned());
                *at += 2;
            }
            word => {
                path.push(word.to_owned());
                *at += 1;
            }
        }
    }
    if path.last().is_some_and(|p| p == "self") && path.len() > 1 {
        path.pop();
    }
    if let Some(last) = path.last().cloned() {
        out.push(Use { path, name: name.unwrap_or(last), public });
    }
}

/// The `use` statements of a bare text, and the text without them.
fn uses(text: &str) -> (Vec<Use>, String) {
    let (mut found, mut rest) = (Vec::new(), String::new());
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        let trimmed = line.trim_start();
        let public = trimmed.starts_with("pub");
        let statement = match trimmed.split_once("use ") {
            Some((before, after)) if before.is_empty() || (public && !before.trim_end().contains(' ')) => after,
            _ => {
                rest.push_str(line);
                rest.push('\n');
                continue;
            }
        };
        let mut whole = statement.to_owned();
        while !whole.contains(';') {
            let Some(more) = lines.next() else { break };
            whole.push_str(more);
        }
        let whole = whole.split(';').next().unwrap_or_default().to_owned();
        leaves(&tokens(&whole), &mut 0, &[], public, &mut found);
    }
    (found, rest)
}

/// Every `a::b::c` of a text.
fn paths(text: &str) -> Vec<Module> {
    let tokens = tokens(text);
    let mut found = Vec::new();
    let mut k = 0;
    while k < tokens.len() {
        let mut path = Vec::new();
        while tokens[k].starts_with(is_word) {
            path.push(tokens[k].to_owned());
            let more = tokens.get(k + 1) == Some(&"::") && tokens.get(k + 2).is_some_and(|t| t.starts_with(is_word));
            if !more {
                break;
            }
            k += 2;
        }
        if path.len() > 1 {
            found.push(path);
        }
        k += 1;
    }
    found
}

/// One crate as text.
#[derive(Default)]
struct Files {
    code: BTreeMap<Module, String>,
    uses: BTreeMap<Module, Vec<Use>>,
    /// What a name stands for in a module.
    names: BTreeMap<Module, BTreeMap<String, Module>>,
}

impl Files {
    fn new(files: impl Iterator<Item = (Module, String)>) -> Self {
        let mut all = Self::default();
        for (module, text) in files {
            let (uses, code) = uses(&bare(&text));
            all.uses.insert(module.clone(), uses);
            all.code.insert(module, code);
        }
        let names = |module: &Module| {
            let own = all.uses[module].iter().filter_map(|u| Some((u.name.clone(), all.absolute(module, &u.path)?)));
            (module.clone(), own.collect())
        };
        all.names = all.code.keys().map(names).collect();
        all
    }

    /// A path seen from the crate; `None` for one that leads out of it.
    fn absolute(&self, module: &Module, path: &[String]) -> Option<Module> {
        let mut base = module.clone();
        let mut rest = path;
        match path.first()?.as_str() {
            "crate" => return Some(path[1..].to_vec()),
            "super" | "self" => {
                while let Some((first, more)) = rest.split_first().filter(|s| ["super", "self"].contains(&s.0.as_str()))
                {
                    if first == "super" {
                        base.pop();
                    }
                    rest = more;
                }
            }
            first => {
                let child = [module.as_slice(), &path[..1]].concat();
                if !self.code.contains_key(&child) {
                    let known = self.names.get(module)?.get(first)?;
                    return Some([known.as_slice(), &path[1..]].concat());
                }
            }
        }
        base.extend_from_slice(rest);
        Some(base)
    }

    /// The module that defines what an absolute path names, and the name; `None` for a module itself.
    fn definer(&self, path: &[String], depth: usize) -> Option<(Module, String)> {
        let mut n = 0;
        while n < path.len() && self.code.contains_key(&path[..=n]) {
            n += 1;
        }
        let (module, rest) = path.split_at(n);
        let name = rest.first()?;
        // what a module takes for itself names things for its parts, too
        for reexport in self.uses.get(module)?.iter().filter(|_| depth > 0) {
            let Some(absolute) = self.absolute(&module.to_vec(), &reexport.path) else { continue };
            if reexport.name == *name {
                return self.definer(&[absolute.as_slice(), &rest[1..]].concat(), depth - 1);
            }
            if reexport.name == "*" {
                let from = &absolute[..absolute.len() - 1];
                if self.code.get(from).is_some_and(|code| defines(code, name)) {
                    return Some((from.to_vec(), name.clone()));
                }
            }
        }
        Some((module.to_vec(), name.clone()))
    }

    fn arrows(&self) -> Arrows {
        let mut arrows = Arrows::new();
        for (module, code) in &self.code {
            let taken = self.uses[module].iter().filter(|u| !u.public).map(|u| u.path.clone());
            for path in taken.chain(paths(code)) {
                let definer = self.absolute(module, &path).and_then(|p| self.definer(&p, 6));
                let Some((from, name)) = definer else { continue };
                // what a part takes from the modules it lies in is no arrow
                if !module.starts_with(&from) {
                    arrows.entry(module.clone()).or_default().entry(from).or_default().insert(name);
                }
            }
        }
        arrows
    }
}

fn defines(code: &str, name: &str) -> bool {
    let kinds = ["fn", "struct", "enum", "trait", "type", "const", "static"];
    let tokens = tokens(code);
    tokens.windows(2).any(|w| kinds.contains(&w[0]) && w[1] == name)
}

/// Modules that can be reached from each other, as sets of more than one.
fn circles(arrows: &Arrows) -> Vec<BTreeSet<Module>> {
    let reached = |from: &Module| {
        let (mut seen, mut next) = (BTreeSet::new(), vec![from.clone()]);
        while let Some(module) = next.pop() {
            for other in arrows.get(&module).into_iter().flat_map(BTreeMap::keys) {
                if seen.insert(other.clone()) {
                    next.push(other.clone());
                }
            }
        }
        seen
    };
    let reach: BTreeMap<&Module, BTreeSet<Module>> = arrows.keys().map(|m| (m, reached(m))).collect();
    let mut found: Vec<BTreeSet<Module>> = Vec::new();
    for (module, there) in reach.iter().filter(|(m, there)| there.contains(**m)) {
        if found.iter().any(|circle| circle.contains(*module)) {
            continue;
        }
        let back = |other: &&Module| reach.get(*other).is_some_and(|r| r.contains(*module));
        found.push(there.iter().filter(back).cloned().collect());
    }
    found
}

/// What ties a circle together, a line an arrow.
fn told(arrows: &Arrows, circle: &BTreeSet<Module>) -> String {
    let mut text = String::new();
    for module in circle {
        for (from, names) in arrows[module].iter().filter(|(from, _)| circle.contains(*from)) {
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            text += &format!("  {} takes {} from {}\n", module.join("::"), names.join(", "), from.join("::"));
        }
    }
    text
}

/// The module of a file below the `src` of a crate; `None` for programs beside the crate.
fn module_of(path: &str) -> Option<Module> {
    let path = path.strip_suffix(".rs")?;
    let mut module: Module = path.split('/').map(str::to_owned).collect();
    match module.last()?.as_str() {
        "mod" => drop(module.pop()),
        "lib" | "main" if module.len() == 1 => module.clear(),
        _ if module[0] == "bin" => return None,
        _ => {}
    }
    Some(module)
}

#[test]
fn no_circle_among_the_files_of_a_crate() {
    let sources = sources();
    let (mut arrows_seen, mut wrong, mut mended) = (0, String::new(), Vec::new());
    for (name, folder, _) in ARROWS {
        let src = format!("{folder}/src/");
        let own = sources.iter().filter_map(|(path, text)| Some((module_of(path.strip_prefix(&src)?)?, text.clone())));
        let arrows = Files::new(own).arrows();
        arrows_seen += arrows.values().map(BTreeMap::len).sum::<usize>();
        let found = circles(&arrows);
        let known = LEFT.iter().find(|k| k.0 == *name).map_or(0, |k| k.1);
        if found.len() > known {
            let list = found.iter().map(|c| format!("{name}: a circle of {} files\n{}", c.len(), told(&arrows, c)));
            wrong.extend(list);
        } else if found.len() < known {
            mended.push((*name, found.len()));
        }
    }
    assert!(wrong.is_empty(), "files that take from each other in a circle\n{wrong}");
    assert!(mended.is_empty(), "mended, shorten the list: {mended:?}");
    assert!(arrows_seen > 300, "only {arrows_seen} arrows seen");
}

fn module(path: &str) -> Module {
    path.split("::").filter(|p| !p.is_empty()).map(str::to_owned).collect()
}

#[test]
fn a_circle_is_seen_through_reexports_and_paths() {
    let files = [
        ("", "mod a;\nmod b;\npub use a::{Thing, parts::*};\n"),
        ("a", "mod parts;\nuse crate::b::{self, Other as Same};\npub struct Thing;\nfn f() { parts::g() }\n"),
        ("a::parts", "use super::Thing;\npub(crate) fn g() {}\n"),
        ("b", "// use crate::c::X;\npub struct Other;\nfn h() -> crate::Thing { \"crate::c::Y\" }\n"),
        ("c", "fn k() { crate::g() }\n#[cfg(test)]\nmod tests {\n    use crate::b::Other;\n}\n"),
    ];
    let arrows = Files::new(files.into_iter().map(|(m, t)| (module(m), t.to_owned()))).arrows();
    let from = |m: &str| arrows.get(&module(m)).map(|to| to.keys().map(|k| k.join("::")).collect::<Vec<_>>());
    assert_eq!(from("a"), Some(vec!["a::parts".to_owned(), "b".to_owned()]));
    assert_eq!(from("b"), Some(vec!["a".to_owned()]));
    assert_eq!(from("c"), Some(vec!["a::parts".to_owned()]));
    assert_eq!(from("a::parts"), None, "what a part takes from its whole is no arrow");
    let circles = circles(&arrows);
    assert_eq!(circles, [BTreeSet::from([module("a"), module("b")])]);
    assert!(told(&arrows, &circles[0]).contains("b takes Thing from a"));
}
