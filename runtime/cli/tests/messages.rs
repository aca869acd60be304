//! The messages of the language page, as a user of `wfl run` sees them: for each a small scene and the whole text.

use std::{
    path::PathBuf,
    process::{Command, Output},
};

/// A scene of two blocks and the fault between them; each case adds its lines.
const BASE: &str = "\
mesh box [0,0,0] to [1,1,1] cells [4,4,4] hex
param gamma = 1e5
param theta = 1 in {-1,0,1}
param fric = 0.4
region left = cells where x < 0.5
region right = cells where x > 0.5
region fault = interface from left to right
region west = faces where x == 0
region east = faces where x == 1
unknown uL : vector on left
unknown uR : vector on right
def sigma(v) = Div_v*Id(3) + 2*Sym(Grad_v)
def trac(v) = sigma(v)*Normal
def jump(a,b) = a - Interpolate(b, neighbor_element)
def tang(w) = w - (w.Normal)*Normal
term elastic on left : sigma(uL):Grad_Test_uL
term elastic on right : sigma(uR):Grad_Test_uR
fix uL = [0,0,0] on west
fix uR = [0,0,0] on east
";

/// Lines added to the scene, words added to the command line, and the message.
const CASES: &[(&str, &[&str], &str)] = &[
    (
        "def un_jump = uL - Interpolate(uR, neighbor_element).Normal\nterm contact on fault : un_jump*(Test_uL.Normal)",
        &[],
        r#"
error[E101]: cannot subtract a scalar from a vector
  --> scene.wfl:21:25
   |
20 | def un_jump = uL - Interpolate(uR, neighbor_element).Normal
   |               --   ---------------------------------------- scalar
   |               |
   |               vector(3)
21 | term contact on fault : un_jump*(Test_uL.Normal)
   |                         ^^^^^^^ in this use of `un_jump`
   |
   = note: `.` binds tighter than `-`, so only the second part meets Normal
   = help: (uL - Interpolate(uR, neighbor_element)).Normal
"#,
    ),
    (
        "term mass on left : uL*Test_uL",
        &[],
        r#"
error[E102]: `*` does not multiply two vectors
  --> scene.wfl:20:24
   |
20 | term mass on left : uL*Test_uL
   |                     -- ^^^^^^^ vector(3) on both sides
   |
   = help: `uL.Test_uL` for the scalar product, `uL@Test_uL` for the tensor product, `uL.*Test_uL` for component by component
"#,
    ),
    (
        "term mass on left : sigma(uL).Grad_Test_uL",
        &[],
        r#"
error[E103]: this term is not a scalar, it is a matrix(3,3)
  --> scene.wfl:20:21
   |
20 | term mass on left : sigma(uL).Grad_Test_uL
   |                     ^^^^^^^^^^^^^^^^^^^^^^ `.` contracts one index of each: matrix(3,3) . matrix(3,3) is matrix(3,3)
   |
   = help: `:` contracts both indices: sigma(uL):Grad_Test_uL
"#,
    ),
    (
        "fix uL(0) = 0 on west",
        &[],
        r#"
error[E104]: index 0 is out of range
  --> scene.wfl:20:8
   |
20 | fix uL(0) = 0 on west
   |        ^ vector(3) has the components 1, 2, 3
   |
   = note: indices start at 1, as in GWFL
"#,
    ),
    (
        "term more on right : sigma(uR, fric):Grad_Test_uR",
        &[],
        r#"
error[E105]: `sigma` takes 1 argument, 2 given
  --> scene.wfl:20:22
   |
12 | def sigma(v) = Div_v*Id(3) + 2*Sym(Grad_v)
   |     -------- defined here
...
20 | term more on right : sigma(uR, fric):Grad_Test_uR
   |                      ^^^^^^^^^^^^^^^
"#,
    ),
    (
        "measure s = mean(Norm(sigma(2*uL))) on left",
        &[],
        r#"
error[E106]: `Div_v` needs a field name, but `v` is an expression here
  --> scene.wfl:20:29
   |
12 | def sigma(v) = Div_v*Id(3) + 2*Sym(Grad_v)
   |                ----- `v` is pasted behind Div_ here
...
20 | measure s = mean(Norm(sigma(2*uL))) on left
   |                             ^^^^ this stands for `v`
   |
   = help: 2*sigma(uL)
"#,
    ),
    (
        "def gap = x**2/(2*gamma) - fric",
        &[],
        r#"
error[E107]: `**` is not an operator
  --> scene.wfl:20:12
   |
20 | def gap = x**2/(2*gamma) - fric
   |            ^^
   |
   = help: x^2, or sqr(x)
"#,
    ),
    (
        "term contact on fault : gama*jump(uL,uR).Test_uL",
        &[],
        r#"
error[E201]: unknown name `gama`
  --> scene.wfl:20:25
   |
20 | term contact on fault : gama*jump(uL,uR).Test_uL
   |                         ^^^^ did you mean `gamma`, param on line 2?
"#,
    ),
    (
        "term contact on fault : gamma*(uR.Normal)*(Test_uL.Normal)",
        &[],
        r#"
error[E202]: `uR` does not live on this side of `fault`
  --> scene.wfl:20:32
   |
20 | term contact on fault : gamma*(uR.Normal)*(Test_uL.Normal)
   |                                ^^ uR lives on `right`; `fault` is integrated from `left`
   |
   = help: Interpolate(uR, neighbor_element) is the trace from the other side
"#,
    ),
    (
        "term glue on west : Interpolate(uL, neighbor_element).Test_uL",
        &[],
        r#"
error[E203]: `neighbor_element` has no neighbour here
  --> scene.wfl:20:21
   |
20 | term glue on west : Interpolate(uL, neighbor_element).Test_uL
   |              ----   ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^ needs a region of inner faces
   |              |
   |              `west` is 16 faces with one side
   |
   = help: an interface region has two sides: region fault = interface from left to right
"#,
    ),
    (
        "term more on left : (sigma(uL)*Normal).Test_uL",
        &[],
        r#"
error[E204]: `Normal` exists on faces only
  --> scene.wfl:20:32
   |
20 | term more on left : (sigma(uL)*Normal).Test_uL
   |              ----              ^^^^^^
   |              |
   |              `left` is a region of 32 cells
"#,
    ),
    (
        "term stress on fault : -theta/gamma*trac(Test_uL).trac(Test_uL)",
        &[],
        r#"
error[E301]: a term must be linear in the test functions
  --> scene.wfl:20:37
   |
20 | term stress on fault : -theta/gamma*trac(Test_uL).trac(Test_uL)
   |                                     ^^^^^^^^^^^^^ ------------- second test function in the same product
   |
   = help: one of the two is the unknown: trac(uL).trac(Test_uL)
"#,
    ),
    (
        "term contact on fault : pos_part(gamma)*(Test_uL.Normal) + pos_part(gamma)",
        &[],
        r#"
error[E302]: part of this term has no test function
  --> scene.wfl:20:60
   |
20 | term contact on fault : pos_part(gamma)*(Test_uL.Normal) + pos_part(gamma)
   |                                                            ^^^^^^^^^^^^^^^ no Test_ in this summand
   |
   = help: if it is a potential to be minimised, write `energy` in place of `term`
"#,
    ),
    (
        "term contact on fault : pos_part(gamma*jump(Test_uL,Test_uR).Normal)",
        &[],
        r#"
error[E303]: test function inside a nonlinear function
  --> scene.wfl:20:45
   |
20 | term contact on fault : pos_part(gamma*jump(Test_uL,Test_uR).Normal)
   |                                             ^^^^^^^ `pos_part` makes this term nonlinear in Test_uL
"#,
    ),
    (
        "term contact on fault : gamma*Test_fric",
        &[],
        r#"
error[E304]: `fric` is a param, it has no test function
  --> scene.wfl:20:31
   |
20 | term contact on fault : gamma*Test_fric
   |                               ^^^^^^^^^ only unknowns and multipliers have one
"#,
    ),
    (
        "fix uL = [0,0,0] on east",
        &[],
        r#"
error[E401]: `fix uL` meets no node of `uL`
  --> scene.wfl:20:21
   |
20 | fix uL = [0,0,0] on east
   |                     ^^^^ the 16 faces of `east` belong to `right`; uL lives on `left`
"#,
    ),
    (
        "region far = faces where x == 1.01\nfix uR = [0,0,0] on far",
        &[],
        r#"
error[E402]: region `far` is empty
  --> scene.wfl:20:26
   |
20 | region far = faces where x == 1.01
   |                          ^^^^^^^^^ no face; the nearest faces have x = 1
"#,
    ),
    (
        "region part = faces of fault where y > 9",
        &[],
        r#"
error[E402]: region `part` is empty
  --> scene.wfl:20:36
   |
20 | region part = faces of fault where y > 9
   |                                    ^^^^^ no face of `fault`; the mesh spans x = 0..1, y = 0..1, z = 0..1
"#,
    ),
    (
        "region bottom = faces where z == 0\nmultiplier lambda : vector on fault\nfix uL, uR = [0,0,0] on bottom\nterm contact on fault : lambda.jump(Test_uL,Test_uR) + jump(uL,uR).Test_lambda",
        &[],
        r#"
warning[W404]: 5 nodes of `lambda` have no jump and are dropped
  --> scene.wfl:21:12
   |
21 | multiplier lambda : vector on fault
   |            ^^^^^^ the displacements of both sides are prescribed
   |
   = note: they would make the system singular in stick, and are zero; `with crosspoints=follow` they have the value of the nearest node, `with crosspoints=keep` they stay
"#,
    ),
    (
        "def Pn = -gamma*(jump(uL,uR).Normal)\ndef Pt = tang(uL)\nterm contact on fault : Ball_projection(Pt, fric*Pn).Test_uL",
        &[],
        r#"
warning[W502]: the radius may be negative
  --> scene.wfl:22:45
   |
22 | term contact on fault : Ball_projection(Pt, fric*Pn).Test_uL
   |                                             ^^^^^^^ it changes sign with the unknowns; a negative radius gives 0
   |
   = help: pos_part(fric*Pn)
"#,
    ),
    (
        "param rho = 2700",
        &[],
        r#"
warning[W702]: declared but not needed by this scene
  --> scene.wfl:20:7
   |
20 | param rho = 2700
   |       ^^^ no term, load or output uses it
"#,
    ),
    (
        "term jump on fault : Xfem_plus(uL).Test_uL",
        &[],
        r#"
error[E801]: `Xfem_plus` is GWFL this program does not have
  --> scene.wfl:20:22
   |
20 | term jump on fault : Xfem_plus(uL).Test_uL
   |                      ^^^^^^^^^
   |
   = help: a crack that follows faces: region crack = interface along s, and: split u across crack
"#,
    ),
    (
        "term friction on fault : log(Norm(jump(uL,uR)))*(Test_uL.Normal)",
        &[],
        r#"
error[E601]: an infinite number in the residual of `friction`
  --> scene.wfl:20:26
   |
20 | term friction on fault : log(Norm(jump(uL,uR)))*(Test_uL.Normal)
   |                          ^^^^^^^^^^^^^^^^^^^^^^ log(0) is -inf at position [0.5, 0.052831, 0.052831], entity 0 of the region, point 0, step t = 0
   |
   = help: a logarithm needs a positive argument; log(1 + v) is finite at 0
"#,
    ),
    (
        "param k = 1 in {-1,0,1}",
        &["k=2"],
        r#"
error[E701]: `k` must be one of -1, 0, 1
 --> (command line):1:19
  |
1 | wfl run scene.wfl k=2
  |                   ^^^ declared: param k = 1 in {-1,0,1}, line 20
"#,
    ),
];

/// Runs a scene in a folder of its own.
fn run(folder: &str, text: &str, command: &str, words: &[&str]) -> Output {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("messages-{folder}"));
    std::fs::create_dir_all(&folder).expect("a folder for the test");
    std::fs::write(folder.join("scene.wfl"), text).expect("the scene is written");
    let mut run = Command::new(env!("CARGO_BIN_EXE_wfl"));
    run.current_dir(&folder).args([command, "scene.wfl"]).args(words).env("NO_COLOR", "1");
    run.output().expect("wfl runs")
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// `E201` of `error[E201]: ...`
fn code(message: &str) -> &str {
    message.split(['[', ']']).nth(1).unwrap_or("")
}

/// Each message word for word, and no other error beside it.
#[test]
fn each_message_is_told_in_its_own_words() {
    let mut wrong = Vec::new();
    for (lines, words, expected) in CASES {
        let expected = expected.trim();
        let code = code(expected);
        let output = run(code, &format!("{BASE}{lines}\n"), "run", words);
        let told = errors(&output);
        if !told.contains(expected) {
            wrong.push(format!("{code} expected:\n{expected}\nfound:\n{told}"));
        }
        let errors = told.matches("error[").count();
        if errors != usize::from(code.starts_with('E')) || output.status.success() != code.starts_with('W') {
            wrong.push(format!("{code}: {errors} errors\n{told}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

/// A message with units needs a scene with units.
#[test]
fn units_name_the_declaration_that_is_wrong() {
    let scene = "\
mesh box [0,0] to [1,1] cells [4,4] quad
param gamma = 200e3 [MPa]
param E = 200e3 [MPa]
param p = 1 [MPa]
unknown u : vector [mm]
region top = faces where y == 1
region bottom = faces where y == 0
def sn(v) = E*(Grad_v*Normal).Normal
def Pn = gamma*(u.Normal) - sn(u)
term elastic on all : E*Grad_u:Grad_Test_u
term contact on top : pos_part(Pn)*(Test_u.Normal)
load u = [p,0] on top
fix u = [0,0] on bottom
";
    let expected = r"
error[E501]: units do not match in `-`
 --> scene.wfl:9:29
  |
2 | param gamma = 200e3 [MPa]
  |                     ----- declared here
...
9 | def Pn = gamma*(u.Normal) - sn(u)
  |          ----------------   ^^^^^ MPa
  |          |
  |          MPa*mm
  |
  = help: gamma has the unit MPa/mm (a stiffness per area)
";
    let told = errors(&run("units", scene, "check", &[]));
    assert_eq!(told.trim(), expected.trim());
    let right = scene.replace("gamma = 200e3 [MPa]", "gamma = 200e3 [MPa/mm]");
    let output = run("units", &right, "check", &["--all"]);
    let tables = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{}", errors(&output));
    let units = tables.split("\n\n").find(|t| t.starts_with("units")).unwrap_or("");
    assert!(units.lines().any(|l| l.split_whitespace().eq(["u", "mm"])), "{tables}");
}

/// Every kind of mistake at once: each is told in one run, once, in the order of the text, with nothing that only
/// follows from another one.
#[test]
fn all_problems_are_told_in_one_run() {
    let scene = "\
mesh box [0,0,0] to [1,1,1] cells [4,4,4] hex
region left = cells where x < 0.5
region right = cells where x > 0.5
region fault = interface from left to right
region west = faces where x == 0
region east = faces where x == 1.01
unknown uL : vector on left
unknown uR : vektor on right
param gamma = 1e5
param broken = 1 +
param theta = 2 in {-1,0,1}
def jump = uL - Interpolate(uR, neighbor_element)
def sigma(v) = Div_v*Id(3) + 2*Sym(Grad_v)
term elastic on left : sigma(uL).Grad_Test_uL
term more on right : sigma(uR):Grad_Test_uR
term contact on fault : gama*(jump.Normal)*(Test_uL.Normal) + broken*theta*pos_part(Test_uL)
term e on east : uL.Test_uL*nonsense
fix uL = [0,0] on west
fix uR = [0,0,0] on east
load uL = t*[0,0,-1] on wset
expect m < 3
measure s = mean(sigma(2*uL)) on left
output vtk \"a\" : uuL
";
    let told = errors(&run("all", scene, "check", &[]));
    let codes: Vec<(&str, &str)> = told
        .split("\n\n")
        .filter(|m| m.starts_with("error") || m.starts_with("warning"))
        .map(|m| (code(m), m.lines().nth(1).and_then(|l| l.split(':').nth(1)).unwrap_or("")))
        .collect();
    let expected = [
        ("E402", "6"),
        ("E113", "8"),
        ("E113", "10"),
        ("E701", "11"),
        ("E103", "14"),
        ("E201", "16"),
        ("E303", "16"),
        ("E201", "17"),
        ("E108", "18"),
        ("E201", "20"),
        ("E201", "21"),
        ("E106", "22"),
        ("E201", "23"),
    ];
    assert_eq!(codes, expected, "{told}");
}

/// A mesh that cannot be built hides no mistake of a term.
#[test]
fn terms_are_checked_without_a_mesh() {
    let scene = "\
mesh box [0,0] to [1,1] cells [4,4,4] quad
unknown u : vector
unknown v : vector
term a on all : Grad_u.Grad_Test_u
term b on boundary : (v*Normal)*Test_v
";
    let told = errors(&run("meshless", scene, "check", &[]));
    let codes: Vec<&str> = told.lines().filter(|l| l.starts_with("error")).map(code).collect();
    assert_eq!(codes, ["E408", "E103", "E102"], "{told}");
}

/// A number that stands too late is not called unknown, and one whose equation loses its slope on the way has not begun without one.
#[test]
fn what_is_there_later_or_was_there_before_is_not_called_missing() {
    let later = "param a = 2*b\nparam b = 3\nmesh box [0] to [1] cells [1] segment\nunknown u : scalar\n\
                 term t on all : a*Grad_u.Grad_Test_u\nfix u = 0 on boundary\n";
    let told = errors(&run("later", later, "check", &[]));
    assert!(told.contains("param on line 2: params stand before what uses them") && !told.contains("mean"), "{told}");
    let lost = "mesh box [0] to [1] cells [1] segment\nunknown d : scalar global\nsteps t = 0 to 4 by 1\n\
                term law on global : (exp(d) - 5 + sqr(t))*Test_d\n";
    let told = errors(&run("lost", lost, "run", &[]));
    assert!(told.contains("step t = 3") && !told.contains("E403"), "{told}");
}

/// What only a run can tell: an unknown that nothing holds, and an iteration that goes in a circle. The residual
/// `1 + |d|` has no root; Newton steps from 1.3 to -1 to 1 and so on.
#[test]
fn what_goes_wrong_in_a_run_is_told_at_its_place() {
    let free = format!("{BASE}unknown d : scalar global\nterm contact on east : pos_part(uR.Normal - d - 1)*Test_d\nsolver newton with search=none\n")
        .replace(
            "fix uR = [0,0,0] on east",
            "fix uR(1) = 0 on east\nfix uR(2), uR(3) = 0 on east\nload uR = [1,0,0] on right",
        );
    let expected = "
error[E403]: `d` has no stiffness at the start: its row of the first tangent is zero
  --> scene.wfl:22:9
   |
22 | unknown d : scalar global
   |         ^ every term with it is inactive
   |
   = help: start from a state in contact, e.g. `start d = 0.01`
";
    let told = errors(&run("E403", &free, "run", &[]));
    assert!(told.contains(expected.trim()), "{told}");

    let circle = "\
mesh box [0,0] to [1,1] cells [2,2] quad
unknown d : scalar global
term law on global : (abs(d) + 1)*Test_d
start d = 1.3
solver newton with search=none, max_iter=12
";
    let expected = "
warning[W602]: the active set cycles
 --> scene.wfl:3:23
  |
3 | term law on global : (abs(d) + 1)*Test_d
  |                       ^^^^^^ 1 point switches open/closed alternately since iteration 0
  |
  = note: step t = 0; the residual alternates 1.0000, 1.0000
  = help: solver newton with search=auto, or smaller load steps: steps ... by a smaller value
";
    let output = run("W602", circle, "run", &[]);
    let told = errors(&output);
    assert!(told.contains(expected.trim()), "{told}");
    assert!(told.contains("error[E603]: step t = 0 did not converge in 74 iterations (8 attempts)"), "{told}");
    assert_eq!(output.status.code(), Some(2));
}
