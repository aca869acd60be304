//! Numbers that are not finite: every statement that takes a formula, with a value at one point that is not a number,
//! infinite, near the end of the range of numbers, or below its normal part.

use std::{
    path::PathBuf,
    process::{Command, Output},
};

/// A value by what it is called, as a formula of the position where x and y are above 0.9.
const VALUES: [(&str, &str); 6] = [
    ("not a number", "log(-x)"),
    ("infinite", "1e308*(10*x)"),
    ("infinite", "-1e308*(10*x)"),
    ("large", "1e308*x"),
    // its square is infinite
    ("large", "1e200*x"),
    ("small", "1e-320*x"),
];

/// A kind of statement: its name, a scene with VALUE in it, and the code where the value is not finite.
const KINDS: [(&str, &str, &str); 14] = [
    ("fix", "fix u = VALUE on east\n", "E610"),
    ("start", "start u = VALUE\nfix u = 1 on east\n", "E610"),
    ("data", "data k : scalar on all = VALUE\nload u = k on east\n", "E610"),
    ("load", "load u = VALUE on north\n", "E601"),
    ("term", "term t on all : VALUE*Test_u\n", "E601"),
    ("coefficient", "term t on all : VALUE*u*Test_u\nfix u = 1 on east\n", "E601"),
    ("map", "map [x + VALUE, y]", "E610"),
    ("mapping", "mapping m = point [x + VALUE, y]\nmeasure q = mean(Interpolate(u, m)) on all\n", "E610"),
    ("state", "state s : scalar on all := VALUE\nterm t on all : s*Test_u\nsteps t = 0 to 1 by 1\n", "E612"),
    ("measure", "fix u = 1 on east\nmeasure q = mean(VALUE) on all\n", "E611"),
    ("largest", "fix u = 1 on east\nmeasure q = max(VALUE) on all\n", "E611"),
    ("output vtk", "fix u = 1 on east\noutput vtk \"o\" : VALUE as q\n", "W610"),
    ("output csv", "fix u = 1 on east\noutput csv \"o\" : VALUE as q along [0,1] to [1,1]\n", "W610"),
    ("region", "region r = faces where VALUE >= 0 and x > 0.5\nfix u = 1 on r\n", "E601"),
];

fn scene(kind: &str, text: &str, value: &str) -> String {
    let at_a_corner = format!("(if x > 0.9 and y > 0.9 then {value} else 0)");
    let text = text.replace("VALUE", &at_a_corner);
    let (map, text) =
        if kind == "map" { (format!(" {text}"), "fix u = 1 on east\n".to_owned()) } else { (String::new(), text) };
    format!(
        "mesh box [0,0] to [1,1] cells [4,4]{map}\nregion west = faces where x == 0\nregion east = faces where x == 1\n\
         region north = faces where y == 1\nunknown u : scalar on all\nterm k on all : Grad_u.Grad_Test_u\nfix u = 0 on west\n\
         measure mean_u = mean(u) on all\n{text}"
    )
}

fn run(name: &str, text: &str) -> Output {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name.replace(' ', "_"));
    let _ = std::fs::remove_dir_all(&dir);
    std::fs::create_dir_all(&dir).expect("a folder");
    std::fs::write(dir.join("scene.wfl"), text).expect("a scene");
    let mut command = Command::new(env!("CARGO_BIN_EXE_wfl"));
    command.current_dir(&dir).args(["run", "scene.wfl", "--out", "out", "--threads", "1", "--interpret"]);
    command.output().expect("the command runs")
}

/// What a run says of its measures, by name.
fn measures(output: &Output) -> Vec<f64> {
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let lines = text.lines().filter_map(|l| l.strip_prefix("  ")?.split_once(" = "));
    lines.filter_map(|(_, value)| value.parse().ok()).collect()
}

#[test]
fn a_value_that_is_not_finite_is_told_wherever_it_enters() {
    for (kind, text, code) in KINDS {
        for (k, (what, value)) in VALUES.iter().enumerate() {
            let output = run(&format!("finite {kind} {k}"), &scene(kind, text, value));
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            let status = output.status.code();
            let case = format!("{kind}, {what} ({value}): exit {status:?}, {said}");
            assert!(status.is_some_and(|c| c < 3) && !said.contains("panicked"), "{case}");
            // the update of a state says NaN or inf
            let told = said.contains(code) && (said.contains(what) || kind == "state");
            match *what {
                // a comparison with infinity decides
                "infinite" if kind == "region" => {}
                // the largest number is too large for a number, or it is one
                "large" if status == Some(0) => assert!(measures(&output).iter().all(|m| m.is_finite()), "{case}"),
                "large" => assert!(["E601", "E602", "E61", "E4"].iter().any(|c| said.contains(c)), "{case}"),
                "small" => {
                    assert_eq!(status, Some(0), "{case}");
                    assert!(measures(&output).iter().all(|m| m.is_finite()), "{case}");
                }
                _ if code == "W610" => assert!(status == Some(0) && told, "{case}"),
                _ if code == "E601" => assert!(status == Some(1) && said.contains(code), "{case}"),
                _ => assert!(status == Some(1) && told, "{case}"),
            }
        }
    }
}

#[test]
fn the_place_in_the_text_and_the_point_are_told() {
    let output = run("finite place", &scene("fix", "fix u = 1/(x - 1) on east\n", ""));
    let said = String::from_utf8_lossy(&output.stderr);
    let wanted = "error[E610]: the prescribed value of `u` on `east` is infinite";
    assert!(said.contains(wanted) && said.contains("fix u = 1/(x - 1) on east"), "{said}");
    assert!(said.contains("division(1, 0) is inf at position [1, 0, 0], step t = 0"), "{said}");
    assert!(said.contains("the denominator is 0 here"), "{said}");
}

/// Two blocks with friction of which one value on one face is infinite: nothing converges, nothing is written.
#[test]
fn a_step_with_an_infinite_prescribed_value_has_no_result() {
    let text = "mesh box [0,0] to [2,1] cells [4,2]\nregion left = cells where x < 1\nregion right = cells where x > 1\n\
                region fault = interface from left to right\nregion west = faces where x == 0\nregion east = faces where x == 2\n\
                unknown uL : vector on left\nunknown uR : vector on right\ndef sigma(v) = Div_v*Id(2) + 2*Sym(Grad_v)\n\
                def jump = uL - Interpolate(uR, neighbor_element)\ndef tests = Test_uL - Interpolate(Test_uR, neighbor_element)\n\
                term elastic on left : sigma(uL):Grad_Test_uL\nterm elastic on right : sigma(uR):Grad_Test_uR\n\
                term contact on fault : 1e3*pos_part(jump.Normal)*(tests.Normal)\nterm glue on fault : (jump.tests)\n\
                fix uL = [0,0] on west\nfix uR = [-t/(y-1),0] on east\nsteps t = 0.5 to 1 by 0.5\n\
                measure Fn = integral(jump.Normal) on fault\noutput vtk \"out\" : uL\n";
    let output = run("finite fault", text);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(1) && said.contains("E610") && said.contains("t = 0.5"), "{said}");
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("finite_fault/out");
    let files = std::fs::read_dir(folder).expect("a folder").flatten();
    let left: Vec<String> = files.map(|f| f.file_name().to_string_lossy().into_owned()).collect();
    assert!(left.iter().all(|name| !name.ends_with(".vtu")), "{left:?}");
}

#[test]
fn params_steps_and_expectations_are_finite() {
    for (k, (lines, code, exit)) in [
        ("param p = log(-1)\n", "E702", 1),
        ("param p = 1e308*10\n", "E702", 1),
        ("steps t = 0 to log(-1) by 1\n", "E702", 1),
        ("fix u = 1 on east\nexpect not (log(-mean_u) > 0)\n", "E604", 3),
        ("fix u = 1 on east\nexpect mean_u > 0.1\n", "", 0),
    ]
    .into_iter()
    .enumerate()
    {
        let output = run(&format!("finite constant {k}"), &scene("", lines, ""));
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(exit) && said.contains(code), "{lines}: {said}");
    }
}

#[test]
fn a_tolerance_at_which_everything_is_a_solution_is_refused() {
    for (tolerance, code) in
        [("1", "E440"), ("0.5", "E440"), ("0.11", "E440"), ("-1e-3", "E440"), ("0.1", ""), ("0", "")]
    {
        let lines = format!("fix u = 1 on east\nsolver newton with tol={tolerance}\n");
        let output = run(&format!("finite tolerance {tolerance}"), &scene("", &lines, ""));
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.success(), code.is_empty(), "{said}");
        assert!(said.contains(code), "{said}");
    }
}
