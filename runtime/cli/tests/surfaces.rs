//! What the command says about interfaces along surfaces inside a body.

use crate::common::Folder;

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

/// A pressure in the slit, whose field is not split.
const PRESSED: &str = "region crack = interface along slit\nterm open on crack : -2*(Normal.jump(Test_u))";

#[test]
fn a_forgotten_split_is_told_with_field_region_place_and_remedy() {
    let folder = Folder::new("forgotten");
    let text = said(&folder, "run s.wfl", &format!("{PRESSED}\nmeasure gap = max(-jump(u).Normal) on crack"));
    assert!(text.contains("warning[W417]: the jump of `u` over `crack` is zero"), "{text}");
    assert!(
        text.contains("in this use of `jump`") && text.contains("one value on both sides of all 3 faces"),
        "{text}"
    );
    assert!(text.contains("here, too") && text.matches("W417").count() == 1, "term and measure in one message: {text}");
    assert!(text.contains("help: split u across crack"), "{text}");
    let text = said(&folder, "run s.wfl", &format!("{PRESSED}\nsplit u across crack"));
    assert!(!text.contains("W417"), "{text}");
}

#[test]
fn differences_of_the_values_on_both_sides_are_found_however_they_are_written() {
    let folder = Folder::new("written");
    let there = |v: &str| format!("Interpolate({v}, neighbor_element)");
    let (u, test) = (there("u"), there("Test_u"));
    for term in [
        format!("term open on crack : Normal.Test_u - Normal.{test}"),
        format!("term open on crack : 3*(0.5*{test}(1) - Test_u(1)/2)"),
        format!("term open on crack : pos_part(1 - u(2) + Norm(Normal) + {u}(2))*Test_u(2)"),
        format!("energy open on crack : 0.5*Norm_sqr(2*u - 2*{u})"),
        format!("measure gap = max(abs((x*u - x*{u})(1))) on crack"),
        format!("term mean on crack : (u + {u}).Test_u\noutput vtk \"gap\" : {u} - u as gap"),
        format!("def E(v) = Sym(Grad_v)\nterm n on crack : -(E(u)*Normal).(Test_u - {test})"),
    ] {
        let text = said(&folder, "check s.wfl", &format!("region crack = interface along slit\n{term}"));
        assert!(text.contains("W417") && text.contains("over `crack` is zero"), "{term}: {text}");
    }
}

#[test]
fn jumps_of_gradients_and_of_fields_with_two_values_give_no_warning() {
    let folder = Folder::new("two-valued");
    let mean = "(0.5*(u + Interpolate(u, neighbor_element)))";
    let slopes = "(Grad_Test_u - Interpolate(Grad_Test_u, neighbor_element))";
    for lines in [
        format!("term smooth on interior : element_size*(Grad_u - Interpolate(Grad_u, neighbor_element)):{slopes}"),
        format!("term mean on crack : ({mean}).Test_u\nmeasure m = max({mean}.Normal) on crack"),
        "unknown v : scalar DQ1\nterm v on all : v*Test_v\nterm e on interior : jump(v)*jump(Test_v)".to_owned(),
        "unknown v : scalar DQ0\nterm v on all : v*Test_v\nterm e on interior : jump(v)*jump(Test_v)".to_owned(),
        "region right = all - west\nunknown a : scalar on west\nunknown b : scalar on right\n\
         region seam = interface from west to right\nterm a on west : a*Test_a\nterm b on right : b*Test_b\n\
         term s on seam : (a - Interpolate(b, neighbor_element))*Test_a"
            .to_owned(),
        // one part of the faces is split
        "region part = faces of west where x == 2 and y >= 2\nsplit u across part\n\
         term open on crack : Normal.jump(Test_u)"
            .to_owned(),
        "param k = 0\nterm off on crack : k*(Normal.jump(Test_u))".to_owned(),
        "data h : scalar DP0 = x\nterm w on crack : (h - Interpolate(h, neighbor_element))*Test_u(1)".to_owned(),
        "mapping m = point [4 - x, y]\nmeasure d = max(abs(u(1) - Interpolate(u, m)(1))) on crack".to_owned(),
    ] {
        let text = said(&folder, "check s.wfl", &format!("region crack = interface along slit\n{lines}"));
        assert!(!text.contains("W417") && !text.contains("error"), "{lines}: {text}");
    }
}
