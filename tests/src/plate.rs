//! A plate of two cells as a Gmsh file, for what users do to mesh files.

use std::path::PathBuf;

use crate::{Attempt, attempt};

/// Text and what stands in its place.
pub type Edits<'a> = &'a [(&'a str, &'a str)];

/// Two unit squares beside each other, lengths in m; the boundary lines and the squares are named groups.
pub const PLATE: &str = "\
$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
6
1 1 \"bottom\"
1 2 \"west\"
1 3 \"east\"
1 4 \"seam\"
2 5 \"left\"
2 6 \"right\"
$EndPhysicalNames
$Nodes
6
1 0 0 0
2 1 0 0
3 2 0 0
4 0 1 0
5 1 1 0
6 2 1 0
$EndNodes
$Elements
7
1 1 2 1 1 1 2
2 1 2 1 1 2 3
3 1 2 2 2 4 1
4 1 2 3 3 3 6
5 1 2 4 4 2 5
10 3 2 5 1 1 2 5 4
11 3 2 6 2 2 3 6 5
$EndElements
";

/// The plate as one elastic body, held in the west and pulled in the east.
pub const SCENE: &str = "wfl 1
mesh file \"plate.msh\"
unknown u : vector
term elastic on all : Div_u*Div_Test_u + 2*(Sym(Grad_u):Sym(Grad_Test_u))
fix u = [0,0] on west
load u = [1,0] on east
";

/// A folder of its own for each test, with the plate as the edits make it.
fn folder(name: &str, edits: Edits<'_>) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("wfl-mesh-errors-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    let text = edits.iter().fold(PLATE.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{name}: the plate has no {from:?}");
        text.replacen(from, to, 1)
    });
    std::fs::write(folder.join("plate.msh"), text).expect("a temporary file");
    folder
}

/// Tries to solve the scene with replacements in its mesh file and its text; each must be found.
///
/// # Panics
/// If a text to replace is not there, or the temporary folder cannot be written.
#[must_use]
pub fn tried(name: &str, mesh: Edits<'_>, scene: Edits<'_>) -> Attempt {
    let folder = folder(name, mesh);
    let text = scene.iter().fold(SCENE.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{name}: the scene has no {from:?}");
        text.replacen(from, to, 1)
    });
    let found = attempt(&folder, text, &[], &[]);
    let _ = std::fs::remove_dir_all(folder);
    found
}
