//! What the command says and does about `refine`.

use crate::common::Folder;

/// A linear solution, which every mesh holds.
fn scene(mesh: &str, refine: &str) -> String {
    format!(
        "{mesh}\n{refine}\nunknown u : scalar\nterm on all : Grad_u.Grad_Test_u\nfix u = 2*x on boundary\n\
         measure size = integral(1) on all\nmeasure e = max(abs(u - 2*x)) on all\nexpect abs(size - 1) < 1e-12 and e < 1e-12\n"
    )
}

fn said(folder: &Folder, words: &str, scene: &str) -> String {
    folder.write("s.wfl", scene);
    let output = folder.wfl(&words.split(' ').collect::<Vec<_>>());
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

#[test]
fn check_shows_the_cells_before_and_after_each_statement() {
    let folder = Folder::new("refinements");
    let text = scene(
        "mesh box [0,0] to [1,1] cells 4 quad",
        "refine where x <= 0.25 times 2 along x\nrefine on strip along y\nregion strip = faces where y == 1",
    );
    let text = said(&folder, "check s.wfl --json", &text);
    let all: serde_json::Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
    let row = |k: usize| {
        let row = &all["refinements"][k];
        (row["statement"].as_str(), row["cells_before"].as_u64(), row["cells_after"].as_u64())
    };
    // the columns beside x = 0.25 count, too: it is a vertex of theirs
    assert_eq!(row(0), (Some("refine where x <= 0.25 times 2 along x"), Some(16), Some(36)));
    assert_eq!(row(1), (Some("refine on strip along y"), Some(36), Some(45)));
    assert_eq!(all["mesh"][0]["cells"].as_u64(), Some(45));
}

#[test]
fn refined_scenes_run_and_those_that_are_not_say_nothing_of_it() {
    let folder = Folder::new("refined");
    for mesh in ["segment", "tri", "quad", "tet", "hex"] {
        let (low, high) = match mesh {
            "segment" => ("[0]", "[1]"),
            "tri" | "quad" => ("[0,0]", "[1,1]"),
            _ => ("[0,0,0]", "[1,1,1]"),
        };
        let mesh = format!("mesh box {low} to {high} cells 2 {mesh}");
        let text = said(&folder, "run s.wfl", &scene(&mesh, "refine where x < 0.3 times 2"));
        assert!(!text.contains("error") && !text.contains("warning"), "{mesh}: {text}");
        let text = said(&folder, "check s.wfl", &scene(&mesh, "refine where x < 0.3 times 0"));
        assert!(!text.contains("error") && !text.contains("warning"), "{mesh}: {text}");
        assert!(!said(&folder, "check s.wfl", &scene(&mesh, "")).contains("refine"));
    }
}

#[test]
fn forty_rounds_into_a_corner_leave_its_sides_what_they_are() {
    let folder = Folder::new("corner");
    let more = "region left = faces where x == 0\nregion low = faces where y == 0\n\
                measure a = integral(1) on left\nmeasure b = integral(1) on low\n\
                expect abs(a - 1) < 1e-14 and abs(b - 1) < 1e-14";
    let text =
        scene("mesh box [0,0] to [1,1] cells 2 tri", &format!("refine where x == 0 and y == 0 times 40\n{more}"));
    let text = said(&folder, "run s.wfl", &text);
    assert!(!text.contains("error") && !text.contains("does not hold"), "{text}");
}

#[test]
fn what_cannot_be_refined_is_said_at_its_place() {
    let folder = Folder::new("unrefined");
    let tri = "mesh box [0,0] to [1,1] cells 2 tri";
    for (mesh, refine, code, part) in [
        (tri, "refine where x < 1 times 1.5", "E443", "a whole number of times, found 1.5"),
        (tri, "refine where x < 1 times -1", "E443", "a whole number of times, found -1"),
        (tri, "refine where x < 1 along x", "E443", "triangles are bisected"),
        (
            "mesh box [0,0] to [1,1] cells 2 quad",
            "refine where x < 1 along z",
            "E443",
            "`z` is no direction of this box: x, y",
        ),
        (tri, "refine where x > 3 times 2", "W418", "no cell has its centre or a vertex there"),
        (tri, "refine where sqrt(x - 2) > 2", "E601", "not a number"),
        (tri, "refine where u > 2", "E201", "unknown name `u`"),
        (tri, "refine", "E113", "expected `on` or `where`"),
        (tri, "refine on nowhere", "E201", "unknown region `nowhere`"),
    ] {
        let text = said(&folder, "check s.wfl", &scene(mesh, refine));
        assert!(text.contains(code) && text.contains(part), "{refine}: {text}");
    }
}

#[test]
fn a_refinement_that_does_not_fit_is_refused_before_its_memory_is_taken() {
    let folder = Folder::new("memory");
    let text = scene("mesh box [0,0] to [1,1] cells 2 tri", "refine on all times 20");
    let text = said(&folder, "check s.wfl --memory 200MB", &text);
    assert!(text.contains("E606") && text.contains("the refined mesh needs about"), "{text}");
    assert!(text.contains("refine on all times 20"), "{text}");
}

#[test]
fn the_same_scene_gives_the_same_files_with_any_number_of_threads() {
    let folder = Folder::new("threads");
    let text =
        scene("mesh box [0,0,0] to [1,1,1] cells 2 tet", "refine where x + y < 0.6 times 2") + "output vtk \"u\" : u\n";
    let results = ["1", "2"].map(|n| {
        let text = said(&folder, &format!("run s.wfl --threads {n} --out t{n}"), &text);
        assert!(!text.contains("error"), "{text}");
        let mut files: Vec<_> = std::fs::read_dir(folder.0.join(format!("t{n}"))).expect("results").flatten().collect();
        files.sort_by_key(|f| f.path());
        let vtu = files.iter().map(|f| f.path()).filter(|p| p.extension().is_some_and(|e| e == "vtu"));
        vtu.map(|p| std::fs::read(p).expect("a file")).collect::<Vec<_>>()
    });
    assert!(!results[0].is_empty() && results[0] == results[1]);
}
