//! Numbers that something is decided by say what they are, in which unit, and why they are so large; the page about them is
//! as its program writes it.

use wfl_tests::constants::{Constant, constants, page};

use super::{read, root};

fn names(of: impl Fn(&Constant) -> bool) -> Vec<String> {
    let all = constants(&root()).into_iter().flat_map(|(_, list)| list);
    all.filter(|constant| of(constant)).map(|Constant { file, name, .. }| format!("{file}: {name}")).collect()
}

#[test]
fn numbers_that_decide_say_what_they_are() {
    assert!(names(|_| true).len() > 200, "constants are found");
    let silent = names(|constant| constant.what.is_empty());
    assert!(silent.is_empty(), "without a comment:\n{}", silent.join("\n"));
    let bare = names(|constant| constant.unit.is_none());
    assert!(bare.is_empty(), "without a unit in words, `part of ...`:\n{}", bare.join("\n"));
    let unfounded = names(|constant| constant.why.is_none());
    assert!(unfounded.is_empty(), "without a reason behind a colon or in a second sentence:\n{}", unfounded.join("\n"));
}

#[test]
fn the_page_of_constants_is_as_its_program_writes_it() {
    let is_current = read("docs/constants.md") == page(&root());
    assert!(is_current, "cargo run -p wfl-tests --bin constants writes docs/constants.md");
}
