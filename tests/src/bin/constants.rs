//! The numbers that iterations, contact, checks and the search for an accuracy decide by: prints `docs/constants.md`.
//!
//! `cargo run -p wfl-tests --bin constants > docs/constants.md` makes the page.

use std::path::Path;

fn main() {
    print!("{}", wfl_tests::constants::page(&Path::new(env!("CARGO_MANIFEST_DIR")).join("..")));
}
