//! The numbers that iterations, contact, checks and the search for an accuracy decide by: writes `docs/constants.md`.
//!
//! `cargo run -p wfl-tests --bin constants` makes the page from the comments.

use std::path::Path;

fn main() -> std::io::Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    std::fs::write(root.join("docs/constants.md"), wfl_tests::constants::page(&root))
}
