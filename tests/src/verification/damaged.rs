//! X28, X29, X31 to X34, X38 to X40, X43: mesh files as users damage them. The messages themselves stand in
//! `mesh_errors`.

use super::{Benchmark, Case, Tolerance, common::or_failed};
use crate::{
    Attempt,
    plate::{Edits, tried},
};

const fn row(id: &'static str, title: &'static str, origin: &'static str, run: fn() -> Vec<Case>) -> Benchmark {
    Benchmark { id, title, origin, slow: false, open: None, run }
}

const OUTCOME: &str = "one error with element or node, no result";

/// The benchmarks of this file.
pub(super) const BENCHMARKS: &[Benchmark] = &[
    row("X28", "inverted or folded elements", OUTCOME, inverted),
    row("X29", "elements of zero volume, faces of zero area", OUTCOME, flat),
    row("X31", "duplicate nodes in one body", "a warning with their number; the torn body moves more", torn),
    row("X32", "a node of no element", "the same bits without it", unused),
    row("X33", "coordinates that are not numbers", OUTCOME, no_numbers),
    row("X34", "an element of a node that is missing", OUTCOME, missing),
    row("X38", "an empty region in a term", OUTCOME, empty),
    row("X39", "names misspelt", "an error with the place and the nearest name", misspelt),
    row("X40", "elements in no body or in two", "an error with their number", uncovered),
    row("X43", "faces of two sides that do not match", "an error with the distance", apart),
];

/// One error, with these words.
fn refused(what: &str, mesh: Edits<'_>, scene: Edits<'_>, words: &[&str]) -> Case {
    let Attempt { solved, messages } = tried(what, mesh, scene);
    let case = Case::new(what)
        .require(solved.is_none(), "claims a solution")
        .require(messages.matches("error[").count() == 1, "not one error");
    words.iter().fold(case, |case, w| case.require(messages.contains(w), format!("does not say `{w}`")))
}

fn inverted() -> Vec<Case> {
    vec![
        refused(
            "inside out",
            // laid over its neighbour; a cell that merely runs clockwise is turned
            &[("3 2 0 0", "3 0.2 0 0"), ("6 2 1 0", "6 0.2 1 0")],
            &[],
            &["element 11 of `right` is inside out", "determinant is -8e-1"],
        ),
        refused("folded", &[("5 1 1 0", "5 1.9 0.1 0")], &[], &["element 11 of `right` is folded", "(1.9, 0.1, 0)"]),
    ]
}

fn flat() -> Vec<Case> {
    let flat = [("3 2 0 0", "3 1 0.25 0"), ("6 2 1 0", "6 1 0.75 0")];
    vec![
        refused("no volume", &flat, &[], &["element 11 of `right` has no volume"]),
        refused(
            "a side of no length",
            &[("6 2 1 0", "6 2 0 0")],
            &[],
            &["element 11 of `right`", "determinant is 0e0"],
        ),
    ]
}

/// Displacement of the pulled side, and the messages.
fn lift(what: &str, mesh: Edits<'_>) -> Result<(f64, String), String> {
    let found = tried(what, mesh, &[("load", "fix u(2) = 0 on bottom\nload")]);
    match found.solved.filter(|s| s.outcome.converged()) {
        Some(solved) => Ok((solved.at(0, "u", [2.0, 0.0, 0.0])[0], found.messages)),
        None => Err(found.messages),
    }
}

fn torn() -> Vec<Case> {
    let mesh = [("$Nodes\n6", "$Nodes\n7"), ("6 2 1 0", "6 2 1 0\n7 1 1 0"), ("2 3 6 5", "2 3 6 7")];
    let made = lift("whole", &[]).and_then(|(whole, _)| {
        let (torn, messages) = lift("torn", &mesh)?;
        Ok(Case::new("a corner twice")
            .require(messages.contains("1 pairs of nodes of one body"), "no warning with the number")
            .compare("displacement over that of the whole plate", torn / whole, 1.01, Tolerance::AtLeast))
    });
    vec![or_failed("a corner twice", made)]
}

fn unused() -> Vec<Case> {
    let mesh = [("$Nodes\n6", "$Nodes\n7"), ("6 2 1 0", "6 2 1 0\n99 7 7 0")];
    let made = lift("used", &[]).and_then(|(without, _)| {
        let (with, _) = lift("unused", &mesh)?;
        Ok(Case::new("node 99").compare("displacement", with, without, Tolerance::Bitwise))
    });
    vec![or_failed("node 99", made)]
}

fn no_numbers() -> Vec<Case> {
    ["nan", "inf", "1e999"]
        .map(|n| refused(n, &[("3 2 0 0", &format!("3 {n} 0 0"))], &[], &["a coordinate of node 3"]))
        .to_vec()
}

fn missing() -> Vec<Case> {
    let words = ["element 11 uses node 12, which is not in the file"];
    vec![refused("node 12", &[("11 3 2 6 2 2 3 6 5", "11 3 2 6 2 2 3 12 5")], &[], &words)]
}

fn empty() -> Vec<Case> {
    let edits = [("load", "region end = faces where x == 2.01\nload"), ("on east", "on end")];
    vec![refused(
        "faces where nothing is",
        &[],
        &edits,
        &["region `end` is empty", "the nearest faces have x = 2", "scene.wfl:"],
    )]
}

fn misspelt() -> Vec<Case> {
    let more = |line: &'static str| [("load", line)];
    vec![
        refused(
            "a region",
            &[],
            &[("on west", "on wets")],
            &["unknown region `wets`", "did you mean `west`?", "scene.wfl:"],
        ),
        refused(
            "a region of a measure",
            &[],
            &more("measure m = mean(u(1)) on bottum\nload"),
            &["did you mean `bottom`?"],
        ),
        refused("an unknown", &[], &more("measure m = mean(w(1)) on bottom\nload"), &["unknown name `w`"]),
        refused("a function", &[], &more("measure m = mean(Nrm(u)) on bottom\nload"), &["did you mean `Norm`?"]),
    ]
}

fn uncovered() -> Vec<Case> {
    let hole = [("vector\n", "vector on left\n"), ("on all", "on left"), ("on east", "on seam")];
    let both = [("unknown u", "region fault = interface from all to right\nunknown u")];
    vec![
        refused("in no body", &[], &hole, &["1 cell of the mesh is in no term", "element 11 of group `right`"]),
        refused("on both sides", &[], &both, &["the two sides of the interface share 1 cells"]),
    ]
}

fn apart() -> Vec<Case> {
    let nodes = "6 2 1 0\n7 1 0 0\n8 1 1.125 0";
    let mesh =
        [("$Nodes\n6", "$Nodes\n8"), ("6 2 1 0", nodes), ("2 3 6 5", "7 3 6 8"), ("2 1 2 1 1 2 3", "2 1 2 1 1 7 3")];
    let fault = [("unknown u", "region fault = interface from left to right\nunknown u")];
    vec![refused("a corner 0.125 off", &mesh, &fault, &["facets lie against each other without matching", "1.25e-1"])]
}
