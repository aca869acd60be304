//! What the command says about interfaces along surfaces inside a body.

mod common;

use common::Folder;

/// A box with a vertical cut `slit` that opens at its top and ends inside.
const BOX: &str = "\
mesh box [0,0] to [4,4] cells [4,4] quad
region west = cells where x < 2
region slit = faces of west where x == 2 and y >= 1
unknown u : vector
term elastic on all : Sym(Grad_u):Grad_Test_u
region floor = faces where y == 0
fix u = [0,0] on floor
def jump(v) = v - Interpolate(v, neighbor_element)
";

fn said(folder: &Folder, words: &str, more: &str) -> String {
    folder.write("s.wfl", format!("{BOX}{more}\n"));
    let output = folder.wfl(&words.split(' ').collect::<Vec<_>>());
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

#[test]
fn check_shows_where_the_normal_of_each_sheet_points() {
    let folder = Folder::new("sheets");
    let text = said(
        &folder,
        "check s.wfl --json",
        "region crack = interface along slit towards [-1,0]\nsplit u across crack\n\
         term open on crack : Normal.jump(Test_u)",
    );
    let all: serde_json::Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
    let row = &all["interfaces"][0];
    assert_eq!((row["name"].as_str(), row["sheet"].as_u64(), row["faces"].as_u64()), (Some("crack"), Some(1), Some(3)));
    assert_eq!(row["mean_normal"], serde_json::json!([-1.0, 0.0]));
    assert_eq!((&row["from"], &row["to"]), (&serde_json::json!([2.0, 1.0]), &serde_json::json!([2.0, 4.0])));
    assert_eq!(row["front_nodes"].as_u64(), Some(1), "the lower end is the front; the upper one is open");
    assert!(all["interfaces"][1].is_null(), "one sheet");
}

#[test]
fn help_for_faces_inside_a_body_names_the_interface_along_them() {
    let folder = Folder::new("one-sided");
    let text = said(&folder, "check s.wfl", "split u across slit\nterm open on slit : Normal.jump(Test_u)");
    assert!(text.contains("E203") && text.contains("region two_sided = interface along slit"), "{text}");
    assert!(text.contains("3 faces inside the mesh, seen from one side"), "{text}");
    let text = said(&folder, "check s.wfl", "term open on floor : Normal.jump(Test_u)");
    assert!(text.contains("E203") && text.contains("interface from left to right"), "{text}");
    let text = said(&folder, "check s.wfl", "region crack = interface from west to west & slit");
    assert!(text.contains("E405") && text.contains("interface along s"), "{text}");
    let text = said(&folder, "check s.wfl", "region sides = slit + floor\nregion crack = interface along sides");
    assert!(text.contains("E405") && text.contains("4 of 7 faces") && text.contains("(0.5, 0, 0)"), "{text}");
    assert!(text.contains("sides - boundary"), "{text}");
    let text = said(&folder, "check s.wfl", "region crack = interface along west");
    assert!(text.contains("E405") && text.contains("a region of cells"), "{text}");
    let text = said(&folder, "check s.wfl", "region crack = interface along slit towards [1,0,0]");
    assert!(text.contains("E108") && text.contains("2 components"), "{text}");
    let text = said(&folder, "check s.wfl", "region crack = interface along slit towards [1/(x-2),0]");
    assert!(text.contains("E610") && text.contains("`towards`"), "{text}");
    let text = said(&folder, "check s.wfl", "region crack = interface along slit toward [1,0]");
    assert!(text.contains("towards"), "{text}");
}

#[test]
fn interfaces_and_splits_are_explained() {
    let folder = Folder::new("explained");
    for (word, part) in [("interface", "interface along s towards [0,0,1]"), ("split", "one at the front")] {
        let output = folder.wfl(&["explain", word]);
        let text = String::from_utf8_lossy(&output.stdout).replace('\n', " ");
        assert!(output.status.success() && text.contains(part), "{word}: {text}");
    }
}
