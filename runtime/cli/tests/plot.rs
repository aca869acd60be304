//! `wfl plot` as a user meets it: colours, places and factors of pictures against closed forms, and what is refused.

use std::process::Output;

use crate::common::Folder;

/// A bar of 2 x 1 mm without lateral strain, stretched by t per length: u = (t x, 0), stress xx = 100 t.
const STRETCHED: &str = "wfl 1
param E = 100 [MPa]
mesh box [0,0] to [2,1] cells [4,2] quad
region west  = faces where x == 0
region east  = faces where x == 2
region south = faces where y == 0
unknown u : vector [mm]
term bulk on all : E*Sym(Grad_u):Grad_Test_u
fix u(1) = 0 on west
fix u(2) = 0 on south
load u = [E*0.001*t,0] on east
steps t = 1 to 2 by 1
output vtk \"bar\" : u, E*Sym(Grad_u) as stress
";

/// The same in three dimensions: a box of 2 x 1 x 1 mm.
const SOLID: &str = "wfl 1
param E = 100 [MPa]
mesh box [0,0,0] to [2,1,1] cells [2,2,2] hex
region west   = faces where x == 0
region east   = faces where x == 2
region south  = faces where y == 0
region bottom = faces where z == 0
unknown u : vector [mm]
term bulk on all : E*Sym(Grad_u):Grad_Test_u
fix u(1) = 0 on west
fix u(2) = 0 on south
fix u(3) = 0 on bottom
load u = [E*0.001,0,0] on east
output vtk \"box\" : u, E*Sym(Grad_u) as stress
";

/// Two bars pressed together and sheared beyond friction: slip on the whole interface, traction across of t.
const PRESSED: &str = "wfl 1
param gamma = 10
param fric  = 0.5
mesh box [0,0] to [2,1] cells [4,3] quad
region left  = cells where x < 1
region right = cells where x > 1
region fault = interface from left to right
region west  = faces where x == 0
region east  = faces where x == 2
unknown uL : vector on left
unknown uR : vector on right
def jump(a,b) = a - Interpolate(b, neighbor_element)
def tang(w)   = w - (w.Normal)*Normal
def Pn    = gamma*(jump(uL,uR).Normal)
def Pt    = gamma*tang(jump(uL,uR))
def force = pos_part(Pn)*Normal + Ball_projection(Pt, fric*pos_part(Pn))
term bulk_left  on left  : Sym(Grad_uL):Grad_Test_uL
term bulk_right on right : Sym(Grad_uR):Grad_Test_uR
term contact on fault : force.jump(Test_uL,Test_uR)
fix uL = [0,0] on west
load uR = [-t,0] on east
steps t = 1 to 5 by 1
output vtk \"fields\" : uL, uR, force as traction
";

impl Folder {
    fn run_scene(&self, text: &str) {
        self.write("s.wfl", text);
        let done = self.wfl(&["run", "s.wfl", "--out", "o"]);
        assert!(done.status.success(), "{}", stderr(&done));
    }

    fn plot(&self, more: &[&str]) -> Output {
        self.wfl(&[&["plot", "o"], more].concat())
    }

    /// The text of the SVG of a picture.
    fn svg(&self, more: &[&str]) -> String {
        let done = self.plot(&[more, &["--svg", "p.svg"]].concat());
        assert!(done.status.success(), "{}", stderr(&done));
        std::fs::read_to_string(self.0.join("p.svg")).expect("a picture")
    }

    fn refuses_plot(&self, more: &[&str], words: &[&str]) {
        let done = self.plot(more);
        let text = stderr(&done);
        assert_eq!(done.status.code(), Some(1), "{more:?}: {text}");
        for word in words {
            assert!(text.contains(word), "{more:?}: {text}");
        }
    }
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Rows of red, green, blue.
fn pixels(file: &std::path::Path) -> Vec<Vec<[i32; 3]>> {
    let file = std::io::BufReader::new(std::fs::File::open(file).expect("a picture"));
    let mut reader = png::Decoder::new(file).read_info().expect("a PNG file");
    let mut bytes = vec![0; reader.output_buffer_size().expect("a size")];
    let info = reader.next_frame(&mut bytes).expect("pixels");
    let row = |line: &[u8]| line.chunks_exact(3).map(|p| [0, 1, 2].map(|c| i32::from(p[c]))).collect();
    bytes.chunks_exact(3 * info.width as usize).map(row).collect()
}

fn near(a: [i32; 3], b: [i32; 3]) -> bool {
    a.iter().zip(b).all(|(x, y)| (x - y).abs() <= 6)
}

/// viridis at 0, 0.5 and 1, from matplotlib.
const ENDS: [[i32; 3]; 3] = [[0x44, 0x01, 0x54], [0x21, 0x91, 0x8c], [0xfd, 0xe7, 0x25]];

#[test]
fn a_linear_displacement_has_the_colours_of_its_values_at_known_places() {
    let folder = Folder::new("plot_colours");
    folder.run_scene(STRETCHED);
    let done = folder.plot(&["--field", "u:x", "--warp", "0", "--no-mesh", "--png", "p.png"]);
    assert_eq!(String::from_utf8_lossy(&done.stdout).trim(), "p.png", "{}", stderr(&done));
    let rows = pixels(&folder.0.join("p.png"));
    // the middle row of the body: between its first and last colour is a length of 2, so the middle colour is at x = 1
    let coloured = |p: &[i32; 3]| p.iter().max().unwrap() - p.iter().min().unwrap() > 40;
    let width = |row: &Vec<[i32; 3]>| row.iter().filter(|p| coloured(p)).count();
    let widest = rows.iter().map(width).max().unwrap();
    let body: Vec<usize> = (0..rows.len()).filter(|k| width(&rows[*k]) + 3 > widest).collect();
    let row = &rows[body[body.len() / 2]];
    let first = row.iter().position(coloured).unwrap() + 3;
    // what follows behind a gap is the ramp
    let last = (first..row.len()).find(|k| row[*k..*k + 6].iter().all(|p| !coloured(p))).unwrap() - 4;
    for (at, expected) in [(first, ENDS[0]), (usize::midpoint(first, last), ENDS[1]), (last, ENDS[2])] {
        assert!(near(row[at], expected), "{at} of {first}..{last}: {:?}, expected {expected:?}", row[at]);
    }
    // the body is twice as long as it is high
    let high = body.last().unwrap() - body[0];
    assert!((last - first).abs_diff(2 * high) < 16, "{} x {high}", last - first);
    // the ramp at the right has the largest value on top
    let ramp = row.len() - row.iter().rev().position(coloured).unwrap() - 6;
    let column: Vec<[i32; 3]> = rows.iter().map(|r| r[ramp]).filter(coloured).collect();
    // of 32 steps the first and the last: viridis at 1/64 and 63/64
    let steps = [[0x45, 0x06, 0x59], [0xf3, 0xe6, 0x25]];
    assert!(near(column[2], steps[1]) && near(column[column.len() - 3], steps[0]), "{:?}", column.first());
}

#[test]
fn a_factor_is_found_told_and_used() {
    let folder = Folder::new("plot_factor");
    folder.run_scene(STRETCHED);
    // the largest displacement is 0.004 of 2 mm: 50 times that is a tenth
    let svg = folder.svg(&[]);
    for words in ["s: |u|", "t = 2, displacements × 50", ">x</text>", "|u| [mm]"] {
        assert!(svg.contains(words), "no {words}");
    }
    let ticks = |svg: &str, label: &str| svg.contains(&format!(">{label}</text>"));
    assert!(ticks(&svg, "2.0") && !ticks(&svg, "4"), "the body is 2.2 long");
    // 500 times: 2 + 500 * 0.004 = 4
    let svg = folder.svg(&["--warp", "500"]);
    assert!(svg.contains("displacements × 500") && ticks(&svg, "4"), "the body is 4 long");
    let svg = folder.svg(&["--warp", "0", "--step", "0"]);
    assert!(svg.contains("t = 1, not deformed"));
}

#[test]
fn a_plane_through_a_box_is_its_section_and_a_line_has_its_values() {
    let folder = Folder::new("plot_cuts");
    folder.run_scene(SOLID);
    let svg = folder.svg(&["--field", "u:x", "--slice", "z=0.5", "--warp", "0"]);
    assert!(svg.contains("z = 0.5, not deformed") && svg.contains("x [mm]") && svg.contains("y [mm]"));
    // the section of 2 x 1: its rim has a length of 2 (2 + 1) sides of cells, drawn as 8 parts
    let rim = svg.split("<path class=\"fr\" d=\"").nth(1).unwrap().split('"').next().unwrap();
    assert_eq!(rim.matches('M').count(), 8, "{rim}");
    // u = 0.001 x
    let svg = folder.svg(&["--field", "u:x", "--line", "-1,0.3,0.3:5,0.3,0.3"]);
    assert!(svg.contains("x [mm] = 2\nu x [mm] = 0.002") && svg.contains("x [mm] = 0\nu x [mm] = 0"), "{svg}");
    // uniaxial: von Mises is the stress itself, 100 * 0.001
    let svg = folder.svg(&["--field", "stress", "--line", "0,0.5,0.5:2,0.5,0.5"]);
    assert!(svg.contains("stress von Mises [MPa] = 0.1"), "{svg}");
    folder.refuses_plot(&["--slice", "x=5"], &["the plane x = 5 lies outside", "x = 0 to 2"]);
    folder.refuses_plot(&["--line", "0,3,0:2,3,0"], &["lies outside", "y = 0 to 1"]);
}

#[test]
fn a_solid_body_is_seen_from_the_place_that_is_given() {
    let folder = Folder::new("plot_views");
    folder.run_scene(SOLID);
    // three sides of a box are seen from a corner, each of 4 faces; one from the front
    let faces = |more: &[&str]| {
        let svg = folder.svg(&[&["--field", "stress:xx", "--warp", "0"], more].concat());
        svg.matches("<path class=\"fr\"").count()
    };
    assert_eq!((faces(&[]), faces(&["--view", "-90,0"])), (12, 4));
    let svg = folder.svg(&[]);
    assert!(svg.contains(">x</text>") && svg.contains(">y</text>") && svg.contains(">z</text>"));
}

#[test]
fn fields_of_an_interface_are_drawn_along_it() {
    let folder = Folder::new("plot_interface");
    folder.run_scene(PRESSED);
    // the traction is t
    let svg = folder.svg(&["--field", "traction:across"]);
    assert!(svg.contains("traction across") && svg.contains(" = 5"), "{svg}");
    let svg = folder.svg(&["--field", "state"]);
    assert!(svg.contains("contact over t") && svg.contains("<title>t = 5"), "{svg}");
    folder.refuses_plot(&["--field", "traction:xy"], &["no part `xy`", "traction:across"]);
    folder.refuses_plot(&["--field", "state", "--slice", "x=1"], &["lives on an interface"]);
    // few steps: a strip of three facets
    folder.run_scene(&PRESSED.replace("steps t = 1 to 5 by 1", "steps t = 1 to 2 by 1"));
    let svg = folder.svg(&["--field", "state"]);
    assert!(svg.contains("contact, t = 2") && svg.matches("\nstick</title>").count() == 3, "{svg}");
    // both bodies under one name
    let svg = folder.svg(&["--field", "u:x"]);
    assert!(svg.contains("s: u x"), "{svg}");
}

#[test]
fn a_bar_has_its_values_over_the_coordinate() {
    let folder = Folder::new("plot_bar");
    folder.run_scene(
        "wfl 1\nmesh box [0] to [2] cells [4] segment\nregion west = faces where x == 0\nregion east = faces where x == 2\n\
         unknown u : scalar\nterm flow on all : Grad_u.Grad_Test_u\nfix u = 1 on west\nfix u = 5 on east\n\
         output vtk \"bar\" : u\n",
    );
    // u = 1 + 2 x
    let svg = folder.svg(&[]);
    for words in ["x = 0\nu = 1<", "x = 0.5\nu = 2<", "x = 2\nu = 5<"] {
        assert!(svg.contains(words), "no {words} in {svg}");
    }
}

#[test]
fn pictures_of_all_steps_share_their_colours() {
    let folder = Folder::new("plot_steps");
    folder.run_scene(STRETCHED);
    let done = folder.plot(&["--field", "stress:xx", "--step", "all", "--svg", "p.svg"]);
    let files = String::from_utf8_lossy(&done.stdout).into_owned();
    assert_eq!(
        files.lines().collect::<Vec<_>>(),
        ["p_stress_xx_0000.svg", "p_stress_xx_0001.svg"],
        "{}",
        stderr(&done)
    );
    let first = std::fs::read_to_string(folder.0.join("p_stress_xx_0000.svg")).unwrap();
    let second = std::fs::read_to_string(folder.0.join("p_stress_xx_0001.svg")).unwrap();
    // 0.1 and 0.2 MPa, each constant: the ends of one ramp
    assert!(first.contains("fill=\"#440154\" stroke") && second.contains("fill=\"#fde725\" stroke"));
    assert!(first.contains("t = 1, displacements × 50") && second.contains("t = 2, displacements × 50"));
}

#[test]
fn what_cannot_be_drawn_is_refused_with_what_there_is() {
    let folder = Folder::new("plot_refused");
    folder.refuses_plot(&[], &["there is no folder `o`"]);
    folder.run_scene(STRETCHED);
    folder.refuses_plot(&["--field", "nope"], &["no field `nope`", "there is stress, u"]);
    folder.refuses_plot(&["--field", "u:xx"], &["no part `xx`", "u:magnitude, u:x"]);
    folder.refuses_plot(&["--step", "7"], &["no fields of step 7", "steps 0 to 1"]);
    folder.refuses_plot(&["--step", "soon"], &["`last`, `all` or numbers of steps"]);
    folder.refuses_plot(&["--slice", "q=1"], &["`x=`, `y=` or `z=`"]);
    folder.refuses_plot(&["--range", "2,1"], &["the smaller one first"]);
    folder.refuses_plot(&["--png", "p.svg"], &["p.svg is no name of a .png file", "--png p.png"]);
    // a file that is no picture stays
    folder.write("data.png", "my numbers");
    folder.refuses_plot(&["--png", "data.png"], &["is no picture", "another file"]);
    assert_eq!(std::fs::read_to_string(folder.0.join("data.png")).unwrap(), "my numbers");
    // a picture is replaced, and the same call gives the same bytes
    let made = || {
        assert!(folder.plot(&["--png", "p.png"]).status.success());
        std::fs::read(folder.0.join("p.png")).unwrap()
    };
    assert_eq!(made(), made());
    folder.run_scene(&STRETCHED.replace("output vtk \"bar\" : u, E*Sym(Grad_u) as stress", ""));
    folder.refuses_plot(&[], &["wrote no fields", "output vtk"]);
}

/// A bar that is stretched in ten steps by a stiffness that is a parameter.
const LOOP: &str = "wfl 1
param E = 100 [MPa]
mesh box [0,0] to [2,1] cells [4,2] quad
region west  = faces where x == 0
region east  = faces where x == 2
region south = faces where y == 0
unknown u : vector [mm]
term bulk on all : E*Sym(Grad_u):Grad_Test_u
fix u(1) = 0 on west
fix u(2) = 0 on south
fix u(1) = 0.01*t on east
steps t = 1 to 4 by 1
measure F = reaction(u(1)) on west
measure d = max(u(1)) on east
output vtk \"bar\" : u
";

impl Folder {
    /// The scene with a parameter, run into a folder of its own.
    fn run_with(&self, set: &str, out: &str) {
        self.write("loop.wfl", LOOP);
        let done = self.wfl(&["run", "loop.wfl", set, "--out", out]);
        assert!(done.status.success(), "{}", stderr(&done));
    }

    fn said(&self, words: &[&str]) -> String {
        let done = self.wfl(words);
        assert!(done.status.success(), "{words:?}: {}", stderr(&done));
        String::from_utf8_lossy(&done.stdout).into_owned()
    }

    fn plot_told(&self, words: &[&str]) -> String {
        let done = self.wfl(words);
        assert_eq!(done.status.code(), Some(1), "{words:?}");
        stderr(&done)
    }
}

#[test]
fn measures_over_measures_are_curves_of_several_runs() {
    let folder = Folder::new("plot-over");
    folder.run_with("E=100", "soft");
    folder.run_with("E=200", "stiff");
    folder.write("measured.csv", "d,F\n0.01,-0.5\n0.04,-2");
    let words = ["plot", "soft", "stiff", "--over", "F:d", "--with", "measured.csv", "--svg", "p.svg"];
    folder.said(&words);
    let svg = std::fs::read_to_string(folder.0.join("p.svg")).expect("a picture");
    for word in ["F over d", "soft", "stiff", "measured"] {
        assert!(svg.contains(word), "{word}");
    }
    // a point of each run and one that was measured, as they are pointed at
    let forces = [("soft", -0.5), ("stiff", -1.0)];
    for (name, force) in forces {
        let found = svg.split("<title>").filter(|part| part.starts_with(name)).count();
        assert!(found >= 4, "{name}, {force}: {found}");
    }
    folder.said(&["plot", "soft", "--over", "F:t"]);
    assert!(folder.0.join("F_over_t.png").exists());
    let told = folder.plot_told(&["plot", "soft", "--over", "q:d"]);
    assert!(told.contains("no measure `q`") && told.contains("there is F, d, t"), "{told}");
    folder.write("words.csv", "d,F\n0.01,much\n");
    let told = folder.plot_told(&["plot", "soft", "--over", "F:d", "--with", "words.csv"]);
    assert!(told.contains("`words.csv` is no table: line 2") && !told.contains("run the scene again"), "{told}");
    let told = folder.plot_told(&["plot", "soft", "./soft", "--over", "F:d"]);
    assert!(told.contains("./soft is named twice"), "{told}");
    let told = folder.plot_told(&["plot", "soft", "--over", "F:d", "--with", "none.csv"]);
    assert!(told.contains("none.csv"), "{told}");
}

#[test]
fn of_two_runs_the_difference_is_drawn_or_both_along_a_line() {
    let folder = Folder::new("plot-two");
    folder.run_with("E=100", "a");
    folder.run_with("E=200", "b");
    // displacements are prescribed: the same in both runs but for rounding
    let said = folder.said(&["plot", "a", "b", "--field", "u:x", "--svg", "d.svg"]);
    assert!(said.contains("d.svg"), "{said}");
    let svg = std::fs::read_to_string(folder.0.join("d.svg")).expect("a picture");
    assert!(svg.contains("a − b"), "the title names both");
    folder.said(&["plot", "a", "b", "--field", "u:x", "--line", "0,0.5:2,0.5", "--svg", "l.svg"]);
    let text = LOOP.replace("cells [4,2]", "cells [5,2]");
    folder.write("finer.wfl", text);
    assert!(folder.wfl(&["run", "finer.wfl", "--out", "c"]).status.success());
    let told = folder.plot_told(&["plot", "a", "c", "--field", "u:x"]);
    assert!(told.contains("no mesh in common") && told.contains("--line"), "{told}");
    folder.said(&["plot", "a", "c", "--field", "u:x", "--line", "0,0.5:2,0.5", "--svg", "l.svg"]);
    let told = folder.plot_told(&["plot", "a", "b", "c"]);
    assert!(told.contains("3 folders") && told.contains("--over"), "{told}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_film_has_a_picture_of_each_step() {
    let folder = Folder::new("plot-film");
    folder.run_with("E=100", "a");
    folder.said(&["plot", "a", "--film", "bar.gif", "--rate", "10"]);
    let bytes = std::fs::read(folder.0.join("bar.gif")).expect("a film");
    assert!(bytes.starts_with(b"GIF89a"));
    // a graphic control block a frame, with the delay in hundredths of a second
    let frames = bytes.windows(6).filter(|w| w[..3] == [0x21, 0xf9, 4] && w[4..6] == [10, 0]).count();
    assert_eq!(frames, 4);
    let told = folder.plot_told(&["plot", "a", "--film", "bar.avi"]);
    assert!(told.contains("bar.gif"), "{told}");
    folder.write("one.wfl", LOOP.replace("steps t = 1 to 4 by 1", "steps t = 1 to 1 by 1"));
    assert!(folder.wfl(&["run", "one.wfl", "--out", "one"]).status.success());
    let told = folder.plot_told(&["plot", "one", "--film", "one.gif"]);
    assert!(told.contains("one picture"), "{told}");
}

#[test]
fn a_formula_of_the_scene_stands_beside_a_profile() {
    let folder = Folder::new("plot_formula");
    folder.write("bar.wfl", STRETCHED.replace("output vtk", "def exact(a) = 0.001*t*a\noutput vtk"));
    assert!(folder.wfl(&["run", "bar.wfl"]).status.success());
    let plot = |more: &[&str]| {
        let args = ["plot", "out/bar", "--field", "u:x", "--svg", "a.svg"];
        folder.wfl(&args.iter().chain(more).copied().collect::<Vec<_>>())
    };
    let done = plot(&["--line", "0,0.5:2,0.5", "--with", "exact(x)"]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let svg = std::fs::read_to_string(folder.0.join("a.svg")).unwrap();
    // the dashed line ends where the curve does: both are linear from 0 to 0.002*2
    let last = |class: &str| {
        let line =
            svg.lines().find(|l| l.contains("<polyline") && l.contains(class)).unwrap_or_else(|| panic!("{svg}"));
        let points = line.split("points=\"").nth(1).unwrap().split('"').next().unwrap();
        points.split_whitespace().next_back().unwrap().to_owned()
    };
    assert_eq!(last("l c0"), last(" d\""), "{svg}");
    for (more, words) in [
        (&["--with", "exact(x)"][..], "a formula stands beside a profile"),
        (&["--line", "0,0.5:2,0.5", "--with", "exakt(x)"], "unknown name `exakt`"),
        (&["--line", "0,0.5:2,0.5", "--with", "u(1)"], "may read positions"),
    ] {
        let done = plot(more);
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(done.status.code() == Some(1) && said.contains(words), "{more:?}: {said}");
    }
}

#[test]
fn a_part_of_a_picture_has_the_size_of_a_column() {
    let folder = Folder::new("plot_zoom");
    folder.write("bar.wfl", STRETCHED);
    assert!(folder.wfl(&["run", "bar.wfl"]).status.success());
    let args = ["plot", "out/bar", "--field", "stress:xx", "--warp", "0", "--zoom", "0.5:1,0:0.5", "--width", "85mm"];
    let done = folder.wfl(&args.iter().chain(&["--svg", "a.svg"]).copied().collect::<Vec<_>>());
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let svg = std::fs::read_to_string(folder.0.join("a.svg")).unwrap();
    assert!(svg.contains("width=\"85.00mm\"") && svg.contains(">0.5<") && !svg.contains(">1.5<"), "{svg}");
    for (option, value) in [("--zoom", "1:0,0:1"), ("--width", "85"), ("--width", "2mm")] {
        assert_eq!(folder.wfl(&["plot", "out/bar", option, value]).status.code(), Some(1), "{option} {value}");
    }
    // curves of two of the steps
    let done =
        folder.wfl(&["plot", "out/bar", "--field", "u:x", "--slice", "y=0.5", "--step", "0,1", "--svg", "b.svg"]);
    assert!(done.status.success() && folder.0.join("b.svg").is_file());
    let done = folder.wfl(&["plot", "out/bar", "--step", "0,7", "--svg", "c.svg"]);
    assert!(String::from_utf8_lossy(&done.stderr).contains("there are no fields of step 7"));
}
