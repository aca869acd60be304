//! What a scene states takes part, or is told: for each message one scene where it appears and one near it where not.

use std::process::Output;

use crate::common::Folder;

/// A body that is held at its left, in which every statement has something to do.
const BASE: &str = "\
mesh box [0,0] to [1,1] cells [2,2] quad
param E = 100
param k = 0
region west = faces where x == 0
region east = faces where x == 1
region floor = faces where y == 0
region tip = nodes where x == 1 and y == 0
unknown u : vector
def sigma(v) = E*Sym(Grad_v)
term elastic on all : sigma(u):Grad_Test_u
measure largest = max(Norm(u)) on all
";

impl Folder {
    fn run(&self, scene: &str, more: &[&str]) -> (Output, String) {
        self.write("s.wfl", scene);
        let output = self.wfl(&[&["run", "s.wfl"], more].concat());
        let text = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        (output, text)
    }

    /// The value of a measure that a run printed.
    fn measure(&self, scene: &str, name: &str) -> f64 {
        let (output, text) = self.run(scene, &[]);
        assert!(output.status.success(), "{text}");
        let line = text.lines().find_map(|l| l.trim().strip_prefix(&format!("{name} = "))).expect("the measure");
        line.parse().expect("a number")
    }
}

/// Lines that are added, the code they give (none: no message at all), words of the message.
const CASES: &[(&str, &str, &[&str])] = &[
    // two prescribed values
    ("fix u = [0,0] on west\nfix u(1) = 0.1 on west", "E432", &["`u(1)`", "0.1 at [0.0, 0.0]", "0 there"]),
    ("fix u = [0,0] on west\nfix u(1) = 0 on west\nfix u(2) = 1 on east", "", &[]),
    ("fix u = [0,0] on west\nfix u(2) = 0.1 on floor", "W413", &["`u(2)` at 1 node", "0.1 at [0.0, 0.0]"]),
    ("fix u = [0.3,0] on west\nfix u(1) = 0.1+0.2+x on floor", "", &[]),
    ("fix u = [0,0] on west\nfix u(2) = t*y on west\nsteps t = 0 to 1 by 0.5", "E432", &["`u(2)`", "t = 0.5"]),
    ("fix u = [0,0] on west\nfix u(2) = t*x on floor\nsteps t = 0 to 1 by 0.5", "", &[]),
    // loads on what is fixed
    ("fix u = [0,0] on west\nload u(1) = 5 on west", "W412", &["`u(1)`", "whole of `west`", "fixed here"]),
    ("fix u = [0,0] on west\nfix u(2) = 0 on floor\nload u = [1,-1] on floor", "W412", &["`u(2)`", "`floor`"]),
    ("fix u = [0,0] on west\nload u = [1,-1] on floor", "", &[]),
    ("fix u = [0,0] on west\nfix u(2) = 0 on floor\nload u = [1,0] on floor", "", &[]),
    ("fix u = [0,0] on west\nfix u = [0,0] on tip\nload u = [0,1] on tip", "W412", &["`u(2)`", "`tip`"]),
    // an unknown whose terms are gone
    (
        "fix u = [0,0] on west\nunknown v : scalar\nterm heat on all : k*Grad_v.Grad_Test_v\nfix v = 7 on all\nmeasure m = max(v) on all\nexpect abs(m - 7) < 1e-12",
        "",
        &[],
    ),
    (
        "fix u = [0,0] on west\nunknown v : scalar\nterm heat on all : k*Grad_v.Grad_Test_v\nfix v = 7 on west\nmeasure m = max(v) on all",
        "W414",
        &["no term determines `v`", "6 of its 9 values", "zero with these parameters"],
    ),
    (
        "fix u = [0,0] on west\nunknown v : scalar\nterm heat on all : k*Grad_v.Grad_Test_v\nmeasure m = max(v) on all",
        "W414",
        &["all its values"],
    ),
    ("fix u = [0,0] on west\nunknown v : scalar\nterm heat on all : k*Grad_v.Grad_Test_v", "", &[]),
    // outputs
    ("fix u = [0,0] on west\noutput vtk \"a\" : u\noutput vtk \"a\" : sigma(u) as s", "E433", &["the first one"]),
    ("fix u = [0,0] on west\noutput vtk \"a\" : u\noutput vtk \"A\" : u", "E433", &["some systems"]),
    ("fix u = [0,0] on west\noutput vtk \"a\" : u\noutput csv \"a\" : u along [0,0] to [1,1]", "", &[]),
    ("fix u = [0,0] on west\noutput vtk \"a\" : u, 2*u as u", "E433", &["called `u`"]),
    ("fix u = [0,0] on west\noutput vtk \"a\" : u(1) as part", "E433", &["`part` is the number of the body"]),
    ("fix u = [0,0] on west\noutput csv \"a\" : u(1) as part along [0,0] to [1,0]", "", &[]),
    ("fix u = [0,0] on west\noutput csv \"Measures\" : u along [0,0] to [1,0]", "E433", &["the table of the measures"]),
    // files of one output that another result of the run has, too
    (
        "fix u = [0,0] on west\noutput csv \"measures\" : u at [0,0]",
        "E433",
        &["the series of", "table of the measures"],
    ),
    ("fix u = [t,0] on west\nsteps t = 0 to 1 by 0.5\noutput csv \"measures\" : u along [0,0] to [1,0]", "", &[]),
    (
        "fix u = [t,0] on west\nsteps t = 0 to 1 by 0.5\noutput csv \"a\" : u along [0,0] to [1,0]\noutput csv \"a_0099\" : u at [0,0]",
        "E433",
        &["`a_0099.csv`", "the tables of the steps", "the first one"],
    ),
    (
        "fix u = [0,0] on west\noutput csv \"a\" : u along [0,0] to [1,0]\noutput csv \"a_0001\" : u at [0,0]\noutput vtk \"a\" : u",
        "",
        &[],
    ),
    // a measure at a point
    ("fix u = [0,0] on west\nmeasure m = value(u(1)) at [0.5,0.25]", "", &[]),
    ("fix u = [0,0] on west\nmeasure m = value(sigma(u)(1,1)*Normal(1)) at [1,0.3]", "", &[]),
    ("fix u = [0,0] on west\nmeasure m = value(u(1)) at [1.5,0.25]", "E435", &["the mesh spans [0.0, 0.0]"]),
    ("fix u = [0,0] on west\nmeasure m = value(u(1)) at [0.5,0.25,0]", "E108", &["2 coordinates"]),
    ("fix u = [0,0] on west\nmeasure m = value(u) at [0.5,0.25]", "E108", &["a measure is a scalar"]),
    ("fix u = [0,0] on west\nmeasure m = value(u(1)) on all", "E113", &["`value` is not taken there"]),
    ("fix u = [0,0] on west\nmeasure m = mean(u(1)) at nodes of all", "E113", &["`mean` is not taken there"]),
    ("fix u = [0,0] on west\nmeasure m = max(u(1)) at [0,0]", "E113", &["`max` is not taken there"]),
    ("fix u = [0,0] on west\noutput vtk \"a\" : u with points=5", "E414", &["points"]),
    (
        "fix u = [0,0] on west\noutput csv \"a\" : u along [2,0] to [3,0]",
        "E435",
        &["the mesh spans [0.0, 0.0] to [1.0, 1.0]"],
    ),
    (
        "fix u = [0,0] on west\noutput csv \"a\" : u along [0,0] to [2,0] with points=5",
        "W415",
        &["2 of 5 points", "[1.5, 0.0]"],
    ),
    ("fix u = [0,0] on west\noutput csv \"a\" : u along [0,0] to [1,1] with points=5", "", &[]),
    ("fix u = [0,0] on west\noutput vtk \"a\" every 0 : u", "E414", &["whole number from 1"]),
    // steps
    (
        "fix u = [0,0] on west\nload u = [t,0] on east\nsteps t = 0 to 1 by 0.3",
        "W410",
        &["the last one is 0.1 long", "5 of 5 steps"],
    ),
    ("fix u = [0,0] on west\nload u = [t,0] on east\nsteps t = 0 to 1 by 1/3", "", &["4 of 4 steps"]),
    (
        "fix u = [0,0] on west\nload u = [t,0] on east\nsteps t = 0 to 1 by 1e-7",
        "E430",
        &["10000001 steps", "most=10000001"],
    ),
    ("fix u = [0,0] on west\nload u = [t,0] on east\nsteps t = 0 to 1 by 0.1 with most=10", "E430", &["11 steps"]),
    ("fix u = [0,0] on west\nload u = [1,0] on east\nsteps t = 0 to 1 by 0.5", "W411", &["3 steps", "reads `t`"]),
    // first guesses, rules, terms, tears
    ("fix u = [x,0] on all\nstart u = [1,1]", "W411", &["`start u`", "by this statement"]),
    ("fix u = [0,0] on west\nstart u = [1,1]", "", &[]),
    ("fix u = [0,0] on west\nstart u = [1,1]\nstart u = [2,1]", "E434", &["two initial guesses"]),
    ("fix u = [0,0] on west\nquadrature on east degree 9", "W411", &["nothing is integrated", "`all`"]),
    ("fix u = [0,0] on west\nload u = [1,0] on east\nquadrature on east degree 9", "", &[]),
    ("fix u = [0,0] on west\nquadrature on all degree 4\nquadrature on all degree 6", "E434", &["`all`"]),
    ("fix u = [0,0] on west\nterm none on all : 0*u.Test_u", "W411", &["zero for all"]),
    ("fix u = [0,0] on east\nload u = [0.1*x,0] on west", "W411", &["a load that is zero", "in all steps"]),
    (
        "fix u = [0,0] on west\nload u = [if t > 3 then y else 0,0] on east\nsteps t = 0 to 1 by 0.5",
        "W411",
        &["a load that is zero"],
    ),
    ("fix u = [0,0] on west\nterm off on all : k*u.Test_u", "", &[]),
    (
        "fix u = [0,0] on west\nregion up = cells where y > 0.5 and x > 0.5\nregion down = cells where y < 0.5\nregion slit = interface from up to down\nsplit u across slit",
        "",
        &[],
    ),
    ("fix u = [0,0] on west\nsolver newton with of=H1", "W411", &["`of`"]),
    // nodes between fixed ones
    (
        "fix u = [0,0] on west\nregion side = nodes where x == 1\nunknown w : scalar Q2\nterm ew on all : Grad_w.Grad_Test_w\nfix w = 0 on side",
        "W416",
        &["leaves 2 nodes free"],
    ),
    ("fix u = [0,0] on west\nunknown w : scalar Q2\nterm ew on all : Grad_w.Grad_Test_w\nfix w = 0 on tip", "", &[]),
    // forces at nodes
    ("fix u = [0,0] on west\nload u.Normal = 1 on tip", "E204", &["region of nodes"]),
    ("fix u = [0,0] on west\nterm t on tip : u.Test_u", "E405", &["load u = [0,-1]"]),
    (
        "fix u = [0,0] on west\nregion half = cells where x < 0.5\nunknown w : vector on half\nterm ew on half : sigma(w):Grad_Test_w\nfix w = [0,0] on west\nload w = [1,0] on tip",
        "E431",
        &["no node at 1 of its 1 nodes", "[1.0, 0.0]"],
    ),
];

/// A scene without an equation is told so, whatever its terms are.
#[test]
fn a_scene_in_which_everything_is_prescribed_is_told() {
    let folder = Folder::new("prescribed");
    let (output, text) = folder.run(&format!("{BASE}fix u = [x,0] on all\n"), &[]);
    assert_eq!(output.status.code(), Some(0), "{text}");
    assert!(text.contains("W411") && text.contains("no equation is left"), "{text}");
    let (_, text) = folder.run(&format!("{BASE}fix u = [x,0] on west\n"), &[]);
    assert!(!text.contains("W411"), "{text}");
}

#[test]
fn what_is_stated_takes_part_or_is_told() {
    let folder = Folder::new("cases");
    for (lines, code, words) in CASES {
        let (output, text) = folder.run(&format!("{BASE}{lines}\n"), &[]);
        let error = code.starts_with('E');
        assert_eq!(output.status.code(), Some(i32::from(error)), "{lines}\n{text}");
        // the body has names that not every case needs
        let told = text.matches("warning[").count() + text.matches("error[").count() - text.matches("[W702]").count();
        assert_eq!(told, usize::from(!code.is_empty()), "{lines}\n{text}");
        assert!(text.contains(code), "{code}: {lines}\n{text}");
        for word in *words {
            assert!(text.contains(word), "{word}: {lines}\n{text}");
        }
    }
}

#[test]
fn forces_at_nodes_meet_closed_forms() {
    let folder = Folder::new("forces");
    // a bar in one dimension: u = F x/E up to the force, constant behind it
    let bar = "mesh box [0] to [2] cells [4] segment\nparam E = 8\nparam F = 3\nunknown u : scalar P2\nregion left = faces where x == 0\n\
               region end = nodes where x == 2\nregion mid = nodes where x == 1\nterm k on all : E*Grad_u.Grad_Test_u\nfix u = 0 on left\n\
               load u = F on PLACE\nmeasure m = max(u) on all\nmeasure e = integral(E*Grad_u.Grad_u) on all\n";
    for (place, force, displacement) in [("end", 3.0, 0.75), ("mid", 3.0, 0.375), ("end, mid", 3.0, 1.125)] {
        let scene = bar.replace("PLACE", place);
        let energy = folder.measure(&scene, "e");
        // the work of the forces is the energy of the bar
        let work = match place {
            "end" => force * displacement,
            "mid" => force * displacement,
            _ => force * 1.125 + force * 0.75,
        };
        assert!((energy - work).abs() < 1e-9, "{place}: {energy}");
    }
    // the coefficient is read at the node and at the step
    let varying = bar.replace("load u = F on PLACE", "load u = 2*t*x on mid\nsteps t = 0 to 3 by 1");
    let energy = folder.measure(&varying, "e");
    assert!((energy - 6.0 * 6.0 / 8.0).abs() < 1e-9, "{energy}");
}

#[test]
fn a_force_at_a_node_is_the_same_in_a_turned_frame() {
    let folder = Folder::new("turned");
    // a block that slides along its floor and leans on a wall; turned by 30 degrees its supports are no axes
    let scene = |map: &str, force: &str| {
        format!(
            "mesh box [0,0] to [2,1] cells [4,2] quad{map}\nparam c = sqrt(3)/2\nparam s = 0.5\nunknown u : vector Q2\n\
             region floor = faces where FLOOR\nregion wall = faces where WALL\nregion tip = nodes where TIP\n\
             term elastic on all : 100*Sym(Grad_u):Grad_Test_u + 30*Div_u*Div_Test_u\n\
             fix u.Normal = 0 on floor, wall\nload u = {force} on tip\nmeasure m = integral(u.u) on all\n"
        )
    };
    let plain =
        scene("", "[1,-2]").replace("FLOOR", "y == 0").replace("WALL", "x == 0").replace("TIP", "x == 2 and y == 1");
    let turned = scene(" map [c*x - s*y, s*x + c*y]", "[c*1 + s*2, s*1 - c*2]")
        .replace("FLOOR", "abs(c*y - s*x) < 1e-9")
        .replace("WALL", "abs(c*x + s*y) < 1e-9")
        .replace("TIP", "abs(c*y - s*x - 1) < 1e-9 and abs(c*x + s*y - 2) < 1e-9");
    let (a, b) = (folder.measure(&plain, "m"), folder.measure(&turned, "m"));
    assert!(a > 1e-6 && (a - b).abs() < 1e-9 * a, "{a} {b}");
    // and the same force on a support that holds both directions is told
    let held = plain.replace("TIP", "x == 0 and y == 0").replace("x == 2 and y == 1", "x == 0 and y == 0");
    let (_, text) = folder.run(&held, &[]);
    assert!(text.contains("W412"), "{text}");
}

#[test]
fn a_force_at_a_torn_node_is_refused() {
    let folder = Folder::new("torn");
    let scene = "mesh box [0,0] to [4,2] cells [4,2] quad\nunknown u : vector\nregion west = faces where x == 0\n\
                 region up = cells where y > 1\nregion down = cells where y < 1\nregion slit = interface from up to down & faces of up where x >= 2\n\
                 split u across slit\nterm e on all : Sym(Grad_u):Grad_Test_u\nfix u = [0,0] on west\nregion tip = nodes where x == X and y == 1\n\
                 load u = [0,1] on tip\n";
    let (output, text) = folder.run(&scene.replace('X', "4"), &[]);
    assert!(output.status.code() == Some(1) && text.contains("E431") && text.contains("[4.0, 1.0]"), "{text}");
    let (output, text) = folder.run(&scene.replace('X', "2"), &[]);
    assert!(output.status.success() && !text.contains("E431"), "{text}");
}

#[test]
fn each_nth_step_and_the_last_are_written() {
    let folder = Folder::new("every");
    let scene = format!(
        "{BASE}fix u = [0,0] on west\nload u = [t,0] on east\nsteps t = 0 to 1 by 0.1\n\
         output vtk \"a\" every 4 : u\noutput csv \"b\" every 5 : u along [0,0] to [1,0]\noutput vtk \"c\" every 100 : u\n"
    );
    let (output, text) = folder.run(&scene, &["--out", "o"]);
    assert!(output.status.success(), "{text}");
    let mut names: Vec<String> = std::fs::read_dir(folder.0.join("o"))
        .expect("a folder")
        .map(|e| e.expect("readable").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    let wanted = [
        "a.pvd",
        "a_0000.vtu",
        "a_0004.vtu",
        "a_0008.vtu",
        "a_0010.vtu",
        "b_0000.csv",
        "b_0005.csv",
        "b_0010.csv",
        "c.pvd",
        "c_0000.vtu",
        "c_0010.vtu",
        "measures.csv",
        "report.json",
    ];
    assert!(wanted.iter().all(|w| names.iter().any(|n| n == w)), "{names:?}");
    assert_eq!(names.iter().filter(|n| n.ends_with(".vtu") || n.ends_with(".csv")).count(), 10, "{names:?}");
    let index = std::fs::read_to_string(folder.0.join("o/a.pvd")).expect("an index");
    assert!(index.contains("timestep=\"0.8\"") && index.contains("a_0010.vtu"), "{index}");
    let told = folder.wfl(&["check", "s.wfl", "--json"]);
    let told: serde_json::Value = serde_json::from_slice(&told.stdout).expect("JSON");
    let files: Vec<u64> =
        told["outputs"].as_array().expect("a table").iter().filter_map(|o| o["files"].as_u64()).collect();
    assert_eq!(files, [4, 3, 2]);
    assert!(told["outputs"][0]["about_MB"].as_f64().is_some_and(|mb| mb > 1e-4 && mb < 0.1), "{told}");
}

/// Steps that the run chooses: series and measures over all steps, files where the step variable or an event says.
#[test]
fn series_and_files_over_time() {
    let folder = Folder::new("over_time");
    let scene = "mesh box [0,0] to [1,1] cells [2,2] quad\nregion west = faces where x == 0\nparam yr = 0.25 [s]\n\
        unknown u : scalar\nunknown v : scalar on west\nterm a on all : (Dot_u + u - t)*Test_u\n\
        term b on west : (v - 2*u)*Test_v\nsteps t = 0 to 1 by auto with error=1e-4, first=1e-4\n\
        measure m = max(u) on all\nevent late = t > 0.6\noutput csv \"s\" : u, v as twice at [0,0.5], [0,1]\n\
        output vtk \"a\" every yr : u\noutput vtk \"b\" when late : u\noutput csv \"c\" : u along [0,0] to [1,0]\n";
    let (output, text) = folder.run(scene, &["--out", "o"]);
    assert!(output.status.success(), "{text}");
    let read = |name: &str| std::fs::read_to_string(folder.0.join("o").join(name)).expect("a file");
    let rows = |name: &str| -> Vec<Vec<f64>> {
        read(name).lines().skip(1).map(|l| l.split(',').map(|x| x.parse().expect("a number")).collect()).collect()
    };
    assert!(read("s.csv").starts_with("t,x,y,u,twice\n") && read("measures.csv").starts_with("t,m\n"));
    let (series, measures) = (rows("s.csv"), rows("measures.csv"));
    assert!(series.len() == 2 * measures.len() && measures.len() > 20, "{} {}", series.len(), measures.len());
    for (k, row) in series.iter().enumerate() {
        assert_eq!(row[..3], [measures[k / 2][0], 0.0, if k % 2 == 0 { 0.5 } else { 1.0 }]);
        assert!((row[3] - measures[k / 2][1]).abs() < 1e-12 && (row[4] - 2.0 * row[3]).abs() < 1e-12, "{row:?}");
    }
    let times = |index: &str| -> Vec<f64> {
        let of = |line: &str| Some(line.split_once("timestep=\"")?.1.split_once('"')?.0.parse().expect("a number"));
        read(index).lines().filter_map(of).collect()
    };
    assert_eq!(times("a.pvd"), [0.0, 0.25, 0.5, 0.75, 1.0]);
    let late = times("b.pvd");
    assert!(late[0] == 0.0 && late.len() > 2 && late[1..].iter().all(|t| *t > 0.6), "{late:?}");
}

/// A series over the steps has rows where a length of the step variable says, as other files have steps, and is one file.
#[test]
fn a_series_has_rows_at_multiples_of_a_length() {
    let folder = Folder::new("every_length");
    let scene = "mesh box [0] to [1] cells [1]\nparam tau = 0.3\nunknown u : scalar\n\
        term f on all : (Dot_u + u - sin(t))*Test_u\nsteps t = 0 to 2 by auto with first=1e-3, error=1e-3\n\
        output csv \"p\" every tau : u at [0.5]\n";
    let (output, text) = folder.run(scene, &["--out", "o"]);
    assert!(output.status.success(), "{text}");
    let table = std::fs::read_to_string(folder.0.join("o/p.csv")).expect("a file");
    let times: Vec<f64> =
        table.lines().skip(1).map(|l| l.split(',').next().and_then(|x| x.parse().ok()).expect("a number")).collect();
    let wanted = [0.0, 0.3, 0.6, 0.9, 1.2, 1.5, 1.8, 2.0];
    assert_eq!(times.len(), wanted.len(), "{times:?}");
    assert!(times.iter().zip(wanted).all(|(t, w)| (t - w).abs() < 1e-12), "{times:?}");
    let told = folder.wfl(&["check", "s.wfl", "--json"]);
    let told: serde_json::Value = serde_json::from_slice(&told.stdout).expect("JSON");
    assert_eq!(told["outputs"][0]["files"], 1, "{told}");
    assert!(told["outputs"][0]["about_MB"].as_f64().is_some_and(|mb| mb > 0.0), "{told}");
}

/// Each equation is solved to its own rounding, whatever the size of the others: coefficients from 1e-30 to 1e30.
#[test]
fn equations_of_any_size_are_solved_beside_each_other() {
    let folder = Folder::new("sizes");
    for (large, small) in [("1", "1"), ("1e30", "1e-30"), ("1e-30", "1e30"), ("1e12", "1"), ("1", "1e-12")] {
        let scene = format!(
            "mesh box [0,0] to [1,1] cells [1,1] quad with idle_cells=allowed\nparam c = {large}\nparam d = {small}\n\
             unknown p : scalar global\nunknown q : scalar global\nunknown r : scalar global\n\
             term a on global : c*(exp(p) - 2)*Test_p\nterm b on global : d*(q^3 - 8*p)*Test_q\n\
             term e on global : (r^2 - c/d*d/c*q)*Test_r\nstart p = 3\nstart q = 3\nstart r = 1\n\
             solver newton with tol=1e-15\n\
             measure mp = max(p) on global\nmeasure mq = max(q) on global\nmeasure mr = max(r) on global\n\
             expect abs(mp - log(2)) < 1e-14\nexpect abs(mq^3/(8*log(2)) - 1) < 1e-14\nexpect abs(mr^2/mq - 1) < 1e-14\n"
        );
        let (output, text) = folder.run(&scene, &[]);
        assert!(output.status.success(), "{large} {small}: {text}");
    }
}

#[test]
fn more_threads_than_help_are_told_and_not_taken() {
    let folder = Folder::new("threads");
    let scene = format!("{BASE}fix u = [0,0] on west\nload u = [1,0] on east\n");
    let (output, text) = folder.run(&scene, &["--threads", "100000"]);
    assert!(output.status.success(), "{text}");
    assert_eq!(text.matches("100000 threads were asked for").count(), 1, "{text}");
    let (_, text) = folder.run(&scene, &["--threads", "1"]);
    assert!(!text.contains("were asked for"), "{text}");
}

/// A body pulled to x/10 in its axis, y in the other: what is measured is known.
fn stretched(more: &str) -> String {
    format!("{BASE}fix u(1) = t*x/10 on boundary\nfix u(2) = 0 on boundary\nsteps t = 1 to 3 by 1\n{more}\n")
}

#[test]
fn values_at_points_and_nodes_are_those_of_the_solution() {
    let folder = Folder::new("points");
    let scene = stretched(
        "measure inside = value(u(1)) at [0.3,0.7]\nmeasure corner = max(u(1)) at nodes of all\n\
         measure least = min(u(1)) at nodes of east\nmeasure points = max(u(1)) on all\n\
         measure pull = value((sigma(u)*Normal).Normal) at [1,0.4]",
    );
    let at_end = |name: &str| folder.measure(&scene, name);
    assert!((at_end("inside") - 0.09).abs() < 1e-9);
    assert!((at_end("corner") - 0.3).abs() < 1e-9 && (at_end("least") - 0.3).abs() < 1e-9);
    // the integration points lie inside of the cells
    assert!(at_end("points") < 0.29);
    assert!((at_end("pull") - 30.0).abs() < 1e-7);
}

#[test]
fn the_measures_of_all_steps_are_in_one_table() {
    let folder = Folder::new("table");
    let (output, text) = folder.run(&stretched("measure a = mean(u(1)) on east"), &["--out", "o"]);
    assert!(output.status.success(), "{text}");
    let table = std::fs::read_to_string(folder.0.join("o/measures.csv")).expect("the measures");
    let report = std::fs::read_to_string(folder.0.join("o/report.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    let mut lines = table.lines();
    assert_eq!(lines.next(), Some("t,largest,a"));
    for (line, step) in lines.by_ref().zip(report["steps"].as_array().expect("steps")) {
        let row: Vec<f64> = line.split(',').map(|x| x.parse().expect("a number")).collect();
        let known =
            [&step["t"], &step["measures"]["largest"], &step["measures"]["a"]].map(|v| v.as_f64().unwrap_or(-1.0));
        assert_eq!(row, known, "bit by bit");
    }
    assert_eq!(table.lines().count(), 4);
    assert!(report["files"].as_array().is_some_and(|f| f.iter().any(|n| n == "measures.csv")));
    // the report shows it as measures, not as a line through the body
    assert!(folder.wfl(&["report", "o"]).status.success());
    let page = std::fs::read_to_string(folder.0.join("o/report.html")).expect("a page");
    assert!(!page.contains("Along the line of measures") && page.contains("4 quadrilaterals"));
    // a run without measures leaves none of an earlier one
    let bare = stretched("").replace("measure largest = max(Norm(u)) on all\n", "");
    let (output, text) = folder.run(&bare, &["--out", "o"]);
    assert!(output.status.success() && !folder.0.join("o/measures.csv").exists(), "{text}");
}

#[test]
fn a_line_on_faces_may_have_their_normal_and_a_quantity_of_two_bodies_has_one_column() {
    let folder = Folder::new("faces");
    let scene = "mesh box [0,0] to [2,1] cells [4,2] quad\nregion l = cells where x < 1\nregion r = cells where x > 1\n\
        region gap = interface from l to r\nregion end = faces where x == 2\nunknown a : vector on l\nunknown b : vector on r\n\
        term on l : Grad_a:Grad_Test_a\nterm on r : Grad_b:Grad_Test_b\n\
        term on gap : 100*(a - Interpolate(b,neighbor_element)).(Test_a - Interpolate(Test_b,neighbor_element))\n\
        fix a = [-0.1,0] on l\nfix b = [0.1,0] on end\n\
        output csv \"axis\" : X(1)^2 as square along [0,0.5] to [2,0.5] with points=5\n\
        output csv \"gap\" : a.Normal as opening along [1,0] to [1,1] with points=3\n\
        output csv \"end\" : Normal as n, (Grad_b*Normal).Normal as pull along [2,0] to [2,1] with points=3\n";
    let (output, text) = folder.run(scene, &["--out", "o"]);
    assert!(output.status.success(), "{text}");
    let rows = |name: &str| -> (String, Vec<Vec<f64>>) {
        let text = std::fs::read_to_string(folder.0.join(format!("o/{name}.csv"))).expect("a table");
        let number = |x: &str| x.parse::<f64>().expect("a number");
        let rows = text.lines().skip(1).map(|l| l.split(',').map(number).collect()).collect();
        (text.lines().next().unwrap_or_default().to_owned(), rows)
    };
    let (head, axis) = rows("axis");
    assert_eq!(head, "s,x,y,square");
    assert_eq!(axis.iter().map(|r| r[3]).collect::<Vec<_>>(), [0.0, 0.25, 1.0, 2.25, 4.0]);
    let (_, gap) = rows("gap");
    assert!(gap.iter().all(|r| (r[3] + 0.1).abs() < 1e-9), "{gap:?}");
    let (head, end) = rows("end");
    assert_eq!(head, "s,x,y,n_1,n_2,pull");
    assert!(end.iter().all(|r| r[3..5] == [1.0, 0.0] && r[5] > 0.0), "{end:?}");
}
