//! Faces cut where they lie opposite of edges of others: patch tests between meshes that do not match, forces of a constant
//! pressure on the nodes of both sides, areas of overlaps, invariance, and what is refused.

mod blocks;
mod forces;
mod moving;
mod patches;

use wfl_tests::{MeshFolder, Solved, attempt};

use blocks::Blocks;

/// A folder for a mesh; tests run side by side.
fn folder(name: &str, blocks: &Blocks) -> MeshFolder {
    MeshFolder::new(&format!("segments-{name}"), &blocks.mesh())
}

/// A scene that is solved, whatever it warns of.
fn solved(name: &str, blocks: &Blocks, text: &str) -> Solved {
    let folder = folder(name, blocks);
    let made = attempt(folder.path(), text.to_owned(), &[], &[]);
    let found = made.solved.unwrap_or_else(|| panic!("{}\n{text}", made.messages));
    assert!(found.outcome.converged(), "{}\n{text}", made.messages);
    found
}

/// The messages of a scene.
fn messages(name: &str, blocks: &Blocks, text: &str) -> String {
    let folder = folder(name, blocks);
    let made = attempt(folder.path(), text.to_owned(), &[], &[]);
    made.messages
}
