//! The rules of the code base that a compiler does not check: who depends on whom (`arrows`), no circle among the files
//! of a crate (`circles`), units and reasons of numbers (`constants`), who changes what (`counts`), how long files and
//! functions are (`lengths`), and pages that must be there (`pages`).

mod arrows;
mod circles;
mod constants;
mod counts;
mod lengths;
mod pages;

use std::path::{Path, PathBuf};

use arrows::ARROWS;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn read(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// Every Rust file of the workspace by its path from the top, in order.
fn sources() -> Vec<(String, String)> {
    let mut found = Vec::new();
    let mut folders: Vec<String> = ARROWS.iter().map(|(_, folder, _)| (*folder).to_owned()).collect();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(root().join(&folder)).expect("sources can be read") {
            let entry = entry.expect("sources can be read");
            let name = entry.file_name().to_string_lossy().into_owned();
            let path = format!("{folder}/{name}");
            if entry.path().is_dir() {
                // the jit and the command have rows of their own
                if name != "target" && !ARROWS.iter().any(|(_, f, _)| *f == path) {
                    folders.push(path);
                }
            } else if name.ends_with(".rs") {
                found.push((path.clone(), read(&path)));
            }
        }
    }
    found.sort();
    assert!(found.len() > 80, "only {} sources found", found.len());
    found
}

/// Code without comments; strings stay.
fn code(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().filter(|(_, l)| !l.trim_start().starts_with("//")).map(|(n, l)| (n + 1, l))
}
