//! The limit of memory, and files that have no end: refused with what they are and what they need, before anything is
//! taken.

use std::process::Command;

use crate::common::Folder;

impl Folder {
    /// Standard error of a command that must end with exit code 1.
    fn refused(&self, args: &[&str]) -> String {
        let output = self.wfl(args);
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{args:?}: {told}");
        told
    }
}

/// A scene that reads `{}` by each statement that reads a file.
const READERS: [(&str, &str); 4] = [
    ("use", "use \"FILE.wfl\"\n"),
    ("mesh", "mesh file \"FILE\"\n"),
    ("data", "mesh box [0,0] to [1,1] cells [2,2] quad\ndata d : scalar = \"FILE\"\n"),
    ("start", "mesh box [0,0] to [1,1] cells [2,2] quad\nstart from \"FILE\"\n"),
];

fn scene(head: &str, file: &str) -> String {
    let mesh = if head.starts_with("use") { "mesh box [0,0] to [1,1] cells [2,2] quad\n" } else { "" };
    let head = head.replace("FILE", file);
    format!("wfl 1\n{mesh}{head}unknown u : scalar\nterm on all : Grad_u.Grad_Test_u\nfix u = x on boundary\n")
}

/// A pipe that nobody writes to, a device without an end, a directory: each by its name, at once, whoever reads it.
#[cfg(unix)]
#[test]
fn only_regular_files_are_read() {
    let folder = Folder::new("kinds");
    for ending in ["", ".wfl"] {
        let pipe = folder.0.join(format!("pipe{ending}"));
        let made = Command::new("mkfifo").arg(pipe).status().expect("mkfifo");
        assert!(made.success());
        std::fs::create_dir(folder.0.join(format!("folder{ending}"))).expect("a folder");
    }
    let cases = [("pipe", "a named pipe"), ("/dev/zero", "a device"), ("folder", "a directory")];
    let allowed = ["--allow-read", "/dev"];
    for (file, kind) in cases {
        // what `use` reads ends in .wfl, and no device does
        for (name, head) in READERS.into_iter().filter(|r| r.0 != "use" || kind != "a device") {
            folder.write("scene.wfl", scene(head, file));
            for command in ["run", "check"] {
                let told = folder.refused(&[&[command, "scene.wfl"], &allowed[..]].concat());
                assert!(told.contains(&format!("it is {kind}, a file is needed")), "{command} {name} {file}: {told}");
            }
        }
        let told = folder.refused(&["check", file]);
        assert!(told.contains(&format!("it is {kind}, a file is needed")), "scene {file}: {told}");
    }
}

/// The size of a file counts before it is read; a sparse file of 40 GB takes no place on the disc.
#[test]
fn a_file_larger_than_the_memory_is_refused_before_it_is_read() {
    let folder = Folder::new("large");
    for name in ["large", "large.wfl"] {
        let large = std::fs::File::create(folder.0.join(name)).expect("a file");
        large.set_len(40_000_000_000).expect("a sparse file");
    }
    for (name, head) in READERS {
        folder.write("scene.wfl", scene(head, "large"));
        let told = folder.refused(&["run", "scene.wfl", "--memory", "1GB"]);
        for part in ["of this size needs about", "the limit is 1.0 GB"] {
            assert!(told.contains(part), "{name}: `{part}` is missing in {told}");
        }
        assert_eq!(told.contains("error[E606]"), name != "use", "{name}: {told}");
    }
}

/// A block of tetrahedra under a prescribed stretch: nonlinear, so that each step begins with a prediction, which needs
/// a factor as well.
const STRETCHED: &str = "wfl 1
mesh box [0,0,0] to [1,1,1] cells [10,10,10] tet
region west = faces where x == 0
region east = faces where x == 1
unknown u : vector
def F = Id(3) + Grad_u
energy stored on all : 1/2*(Trace(F'*F) - 3 - 2*log(Det(F))) + 3/4*sqr(log(Det(F)))
fix u = [0,0,0] on west
fix u = [-0.3,0,0] on east
";

/// A refusal inside Newton is told as what it is, whatever is refused: never as a logarithm of a negative number, and
/// it never shortens a step.
#[test]
fn a_refusal_within_a_step_is_told_as_a_lack_of_memory() {
    let folder = Folder::new("newton");
    folder.write("scene.wfl", STRETCHED);
    let mut refusals = 0;
    for limit in ["32MB", "40MB", "48MB"] {
        let output = folder.wfl(&["run", "scene.wfl", "--memory", limit, "--threads", "1"]);
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        if output.status.success() {
            continue;
        }
        refusals += 1;
        assert_eq!(output.status.code(), Some(1), "{limit}: {told}");
        assert!(told.contains("error[E606]") && told.contains("the limit is"), "{limit}: {told}");
        assert!(!told.contains("error[E601]") && !told.contains("halved"), "{limit}: {told}");
        assert_eq!(told.matches("error").count(), 1, "{limit}: {told}");
    }
    assert!(refusals > 0);
}

/// The matrix of tangents is made where the first one is asked for: where it does not fit, no other start or method is tried.
#[test]
fn a_matrix_of_tangents_that_does_not_fit_is_told() {
    let folder = Folder::new("tangents");
    folder.write(
        "scene.wfl",
        "wfl 1\nmesh box [0,0,0] to [1,1,1] cells [14,14,14] tet\nregion low = faces where z == 0\n\
         region top = faces where z == 1\nunknown u : vector P2\ndef F = Id(3) + Grad_u\n\
         term body on all : (F - Inv(F)' + 2*log(Det(F))*Inv(F)'):Grad_Test_u\nfix u = [0,0,0] on low\n\
         fix u = [0,0,-0.05] on top\nsolver linear with direct\n",
    );
    for limit in ["80MB", "120MB"] {
        let told = folder.refused(&["run", "scene.wfl", "--memory", limit, "--threads", "1"]);
        assert!(told.contains("E606") && told.contains("matrix") && !told.contains("E601"), "{limit}: {told}");
    }
}

/// Of tangents that are applied one is held at a time, and nothing of a matrix that is never made: 133 MB, where two of them and the
/// places of entries took 247.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_scene_without_a_matrix_has_no_room_for_one() {
    let folder = Folder::new("applied");
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../../benches/compare/scenes/cube.wfl");
    let output = folder.wfl(&["run", scene, "--memory", "180MB", "--threads", "1"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(told.contains("4 of 4 steps converged"), "{told}");
}

/// A limit on addresses, set from outside, ends with the same message, not with an abort.
#[cfg(target_os = "linux")]
#[test]
fn a_limit_on_addresses_is_told() {
    let folder = Folder::new("addresses");
    folder.write("scene.wfl", STRETCHED.replace("[10,10,10]", "[20,20,20]"));
    for kilobytes in [90_000, 120_000, 200_000] {
        let script = format!("ulimit -v {kilobytes}; exec '{}' run scene.wfl --threads 1", env!("CARGO_BIN_EXE_wfl"));
        let output = Command::new("sh").args(["-c", &script]).current_dir(&folder.0).output().expect("a shell");
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{kilobytes}: {told}");
        for part in ["error[E606]", "addresses, set by `ulimit -v`"] {
            assert!(told.contains(part), "{kilobytes}: `{part}` is missing in {told}");
        }
    }
}

/// What the process may be above its limit: memory that grows within a millisecond.
#[cfg(target_os = "linux")]
const ABOVE: u64 = 12_000_000;

/// What the program takes by itself: no limit is below it.
#[cfg(target_os = "linux")]
const PROGRAM: u64 = 32_000_000;

/// How a command ended: exit code, most bytes in memory, standard error.
#[cfg(target_os = "linux")]
fn watched(folder: &Folder, args: &[&str]) -> (Option<i32>, u64, String) {
    let mut command = folder.command(args);
    let mut child = command.stderr(std::process::Stdio::piped()).spawn().expect("the command starts");
    let (mut peak, status) = (0, format!("/proc/{}/status", child.id()));
    let code = loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|l| l.strip_prefix("VmHWM:")?.split_whitespace().next()?.parse::<u64>().ok());
        peak = peak.max(line.unwrap_or(0) * 1024);
        if let Some(status) = child.try_wait().expect("a child") {
            break status.code();
        }
        std::thread::sleep(std::time::Duration::from_millis(1));
    };
    (code, peak, std::io::read_to_string(child.stderr.take().expect("piped")).expect("text"))
}

/// What no estimate foresees is seen while it is taken: the memory of the process stays at its limit.
#[cfg(target_os = "linux")]
#[test]
fn the_limit_holds_for_what_is_not_asked_for() {
    let folder = Folder::new("watched");
    let limit = 60_000_000;
    for (name, cells, degree) in [("first", "[40,40,40] tet", ""), ("second", "[16,16,16] tet", " P2")] {
        let text = STRETCHED.replace("[10,10,10] tet", cells).replace(": vector", &format!(": vector{degree}"));
        folder.write("scene.wfl", text);
        let (code, peak, told) = watched(&folder, &["run", "scene.wfl", "--memory", "60MB", "--threads", "1"]);
        assert_eq!(code, Some(1), "{name}: {told}");
        assert!(told.contains("error[E606]"), "{name}: {told}");
        assert!(peak <= limit + ABOVE, "{name}: {peak} bytes: {told}");
    }
}

/// Examples of all kinds at sizes where the matrices count, with what is set for them.
#[cfg(target_os = "linux")]
const KINDS: [(&str, &[&str]); 20] = [
    ("elasticity/block", &["cells=[8,8,8]"]),
    ("elasticity/block", &["cells=[14,14,14]"]),
    ("elasticity/cook", &["refine=6"]),
    ("heat/heat", &["h=2e-5"]),
    ("poisson/poisson", &["refine=5"]),
    ("dg/poisson", &["cells=[60,60]"]),
    ("stokes/stokes", &["cells=[96,48]"]),
    ("plaplace/plaplace", &["cells=[150,150]"]),
    ("plasticity/perzyna", &["cells=[10,10,10]"]),
    ("creep/maxwell", &["cells=[100,100]"]),
    ("hyperelastic/contact", &["cells=[14,14,14]", "fric=0.3"]),
    ("hyperelastic/shear", &["n=60"]),
    ("fault/nitsche", &["cells=[8,16,16]"]),
    ("fault/augmented_lagrangian", &["cells=[8,16,16]"]),
    ("fault/penalty", &["cells=[8,16,16]"]),
    ("signorini/signorini", &["refine=6"]),
    ("hertz/sphere", &["n=8"]),
    ("crack/compression", &["refine=2"]),
    ("surfaces/penny", &[]),
    ("friction/tresca", &["refine=5"]),
];

/// Whatever is solved, the process stays within its limit: it gets by with less, or says what is too large.
#[cfg(target_os = "linux")]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
#[test]
fn the_limit_is_kept_by_scenes_of_all_kinds() {
    let folder = Folder::new("limits");
    let examples = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    let (mut refused, mut foreseen) = (0, 0);
    for (name, settings) in KINDS {
        let scene = examples.join(format!("{name}.wfl"));
        let scene = scene.to_str().expect("a path in UTF-8");
        let free: Vec<&str> = ["run", scene, "-q", "--threads", "2"].iter().chain(settings).copied().collect();
        let (code, needed, told) = watched(&folder, &free);
        // an expectation may be one for the size of the example
        assert!(matches!(code, Some(0 | 3)) && needed > 40_000_000, "{name}: {needed} bytes: {told}");
        for percent in [90, 60] {
            let limit = (needed * percent / 100).max(PROGRAM);
            let given = format!("{limit}B");
            let (code, peak, told) = watched(&folder, &[&free[..], &["--memory", &given]].concat());
            assert!(peak <= limit + ABOVE, "{name}, {percent} % of {needed} bytes: {peak} bytes: {told}");
            if code == Some(1) {
                refused += 1;
                foreseen += usize::from(!told.contains("more than was foreseen"));
                assert!(told.contains("error[E606]"), "{name}, {percent} %: {told}");
            }
        }
    }
    // the watch is there for the rest: lists and assembly of plane scenes, which have small factors
    assert!(refused > 10 && 3 * foreseen > refused, "{foreseen} of {refused} refusals were foreseen");
}

#[test]
fn a_limit_below_the_program_itself_is_refused() {
    let folder = Folder::new("program");
    folder.write("scene.wfl", STRETCHED);
    let told = folder.refused(&["run", "scene.wfl", "--memory", "5MB"]);
    assert!(told.contains("the program alone takes about 32 MB"), "{told}");
}
