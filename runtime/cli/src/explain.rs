//! `wfl explain`: the page of a message, of a function of the language, of a macro of the library, or of a word of
//! regions that needs more than a line.

use std::{fmt::Write as _, process::ExitCode};

use wfl::{LIBRARY, codes, nearest};
use wfl_compiler::{function_table, functions};

use crate::{
    args::ExplainArgs,
    load::{out, say},
    prepared::EXIT_ERROR,
};

pub(crate) fn explain(args: &ExplainArgs) -> ExitCode {
    if args.functions {
        out(&function_table());
        return ExitCode::SUCCESS;
    }
    let Some(code) = args.code.as_deref().filter(|_| !args.list) else {
        let mut text = String::new();
        for page in codes() {
            let _ = writeln!(text, "{}  {}", page.code, page.title);
        }
        out(&text);
        return ExitCode::SUCCESS;
    };
    if let Some(op) = functions().find(|op| op.name == code) {
        out(&format!("{}\n\n{}\n", op.usage, wrapped(op.doc, 96)));
        return ExitCode::SUCCESS;
    }
    if let Some(page) = library_macro(code) {
        out(&page);
        return ExitCode::SUCCESS;
    }
    if let Some((_, usage, text)) = PHRASES.iter().find(|(word, ..)| *word == code) {
        out(&format!("{usage}\n\n{}\n", wrapped(text, 96)));
        return ExitCode::SUCCESS;
    }
    let Some(page) = wfl::explain(code) else {
        let macros = library_macros().map(|m| m.name);
        let near = nearest(
            code,
            codes()
                .map(|p| p.code)
                .chain(functions().map(|op| op.name))
                .chain(macros)
                .chain(PHRASES.iter().map(|p| p.0)),
        );
        let near = near.map_or_else(String::new, |n| format!("; the nearest is {n}"));
        say(&format!(
            "error: no message has the code `{code}`, and no function or macro of the library that name{near}\n  \
             = help: wfl explain --list shows all codes, --functions all functions\n"
        ));
        return ExitCode::from(EXIT_ERROR);
    };
    let indented = |text: &str| text.lines().map(|l| format!("    {l}\n")).collect::<String>();
    out(&format!(
        "{}: {}\n\n{}\n\nWrong:\n{}\nRight:\n{}",
        page.code,
        page.title,
        wrapped(page.explanation, 96),
        indented(page.wrong),
        indented(page.fixed)
    ));
    ExitCode::SUCCESS
}

/// Words of regions and splits: how they are written, and what they mean.
const PHRASES: &[(&str, &str, &str)] = &[
    (
        "interface",
        "region f = interface from a to b\nregion f = interface along s\nregion f = interface along s towards [0,0,1]",
        "Faces with two sides. Integrals are taken from the side `here`, whose outward normal is Normal: plain names are \
         values there, Interpolate(u, neighbor_element) is the value on the side `there`. `from a to b` are the faces \
         between two regions of cells, `here` in a. `along s` are faces inside a body, say a surface of a mesh file (a \
         line in two dimensions), plane or curved: `here` lies on one side all over each connected sheet. `towards v` \
         chooses the side on which the integral of Normal.v is positive; v may depend on the position. Without it, the \
         largest component of the mean normal is positive (the first of equal ones), and normals of a closed sheet \
         point outwards. Where three or more faces meet at an edge the surface is divided into sheets. A surface with \
         one side, as a Moebius strip has, is E436. `wfl check` shows the sheets. A field is continuous across an \
         interface inside its region until it is split: split u across f.",
    ),
    (
        "refine",
        "refine where sqrt(x^2 + y^2) < 0.1 times 3\nrefine on r times 2\nrefine on r where z > 0 times 2 along x, y",
        "The size of the cells is halved `times` times, where the condition holds at the centre or a vertex of a cell, in \
         the cells of the regions, or at their faces and nodes. The mesh is refined before regions, interfaces, splits \
         and the map of the mesh are made on it. Triangles and tetrahedra are bisected; quadrilaterals and hexahedra are \
         divided in whole layers, through the opposite edges to the boundary, on a box in the directions behind `along` \
         only. `wfl check` shows the cells before and after.",
    ),
    (
        "split",
        "split u across f",
        "The field u may jump across the faces f, which lie inside the region of u. Each node of f gets one value for \
         each group of cells around it that hangs together without crossing f: two along a crack, also where it meets \
         the outer boundary; one at the front, where it ends inside the body; three where a T joins. All splits of a \
         field are made together. u - Interpolate(u, neighbor_element) is the jump on an interface; `wfl explain \
         interface` says how to declare one.",
    ),
];

/// A macro of the library.
struct LibraryMacro {
    name: &'static str,
    /// The file that defines it.
    file: &'static str,
    /// The paragraph of that file with its definition.
    paragraph: &'static str,
}

fn library_macros() -> impl Iterator<Item = LibraryMacro> {
    LIBRARY.iter().flat_map(|(file, text)| {
        text.split("\n\n").flat_map(move |paragraph| {
            let heads = paragraph.lines().filter_map(|line| line.strip_prefix("def "));
            heads.filter_map(move |head| Some(LibraryMacro { name: head.split('(').next()?, file, paragraph }))
        })
    })
}

/// What the library says about a macro, and its definition with the lines that continue it.
fn library_macro(name: &str) -> Option<String> {
    let found = library_macros().find(|m| m.name == name)?;
    let file = found.file.trim_end_matches(".wfl");
    let mut text = format!("`{name}` is a macro of the library: use \"{file}\"\n\n");
    let mut wanted = false;
    for line in found.paragraph.lines() {
        let comment = line.starts_with('#');
        wanted = comment || if line.starts_with(' ') { wanted } else { line.starts_with(&format!("def {name}(")) };
        if wanted {
            let _ = writeln!(text, "{}", line.strip_prefix("# ").unwrap_or(line));
        }
    }
    Some(text)
}

/// Lines of at most `width` characters where the words allow it.
fn wrapped(text: &str, width: usize) -> String {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines.join("\n")
}
