//! A run that is killed and goes on: at any moment, with the same bytes at the end; and checkpoints that are refused.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    time::{Duration, Instant},
};

use crate::common::Folder;

/// The mesh of the fault as the example has it.
const MESH: &str = "cells [8, 8, 8] hex";

/// The fault by Nitsche's method with friction: a factored bulk, a condensed part, branches that pass from step to
/// step.
fn fault(folder: &Folder) -> PathBuf {
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/fault");
    for entry in std::fs::read_dir(&from).expect("the examples") {
        let path = entry.expect("readable").path();
        std::fs::copy(&path, folder.0.join(path.file_name().expect("a file"))).expect("a copy");
    }
    edit(&folder.0.join("fault.wfl"), MESH, "cells [4,4,4] hex");
    folder.0.join("nitsche.wfl")
}

/// Replaces a text that must be there.
fn edit(file: &Path, from: &str, to: &str) {
    let text = std::fs::read_to_string(file).expect("readable");
    assert!(text.contains(from), "{from}");
    std::fs::write(file, text.replace(from, to)).expect("writable");
}

fn command(scene: &Path, out: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_wfl"));
    command.arg("run").arg(scene).args(["--quiet", "--threads", "2", "--out"]).arg(out).args(more);
    command.stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

fn run(scene: &Path, out: &Path, more: &[&str]) -> Output {
    command(scene, out, more).output().expect("the command starts")
}

/// Every file by name; of the report what does not depend on the clock and the memory of the process.
fn results(out: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(out).expect("a folder of results") {
        let path = entry.expect("readable").path();
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        let mut bytes = std::fs::read(&path).expect("readable");
        if name == "report.json" {
            let mut report: serde_json::Value = serde_json::from_slice(&bytes).expect("JSON");
            let report_of = report.as_object_mut().expect("an object");
            assert!(report_of.remove("timings").is_some() && report_of.remove("peak_memory_bytes").is_some());
            bytes = report.to_string().into_bytes();
        }
        found.insert(name, bytes);
    }
    found
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_run_killed_at_any_moment_goes_on_to_the_same_bytes() {
    let folder = Folder::new("killed");
    let scene = fault(&folder);
    goes_on_to_the_same_bytes(&folder, &scene, 20);
}

/// Steps that the run chooses depend on what it remembers of earlier solutions and of their errors.
#[test]
fn a_run_with_steps_of_its_own_choice_goes_on_to_the_same_bytes() {
    let folder = Folder::new("killed_auto");
    let scene = folder.0.join("heated.wfl");
    let text = r#"wfl 1
mesh box [0,0] to [1,1] cells [10,10] quad
region rim = faces where x == 0
unknown u : scalar
state s : scalar on all := Previous_s + timestep*u
term on all : Dot_u*Test_u + (1 + u*u)*Grad_u.Grad_Test_u - (if t > 0.5 then 10 else sin(9*t))*Test_u + Previous_s*Test_u
fix u = 0 on rim
steps t = 0 to 1 by auto with error=1e-3, limit=0.05/(0.5 + max(u)) on all
measure m = mean(u) on all
output vtk "u" : u
"#;
    std::fs::write(&scene, text).expect("writable");
    goes_on_to_the_same_bytes(&folder, &scene, 50);
}

/// Those of a body that bounces depend on its energies, too, and those of one that wears on how far it is behind.
#[test]
fn a_run_whose_steps_are_judged_by_energy_and_lag_goes_on_to_the_same_bytes() {
    let energy = r#"wfl 1
mesh box [0] to [10] cells [20] segment
region wall = faces where x == 0
unknown u : scalar
start Dot_u = -10
start u = 1
term inertia on all : Dot2_u*Test_u
term stress on all : 900*Grad_u.Grad_Test_u
term contact on wall : -1e4*pos_part(-u)*Test_u
scheme SCHEME
steps t = 0 to 1 by auto with error=1e-3, first=1e-3
measure m = mean(u) on all
output vtk "u" every 2 : u
"#;
    let lag = r#"wfl 1
mesh box [0] to [1] cells [40] segment
region floor = faces where x == 0
region top = faces where x == 1
unknown u : scalar
def press = 1e6*pos_part(-u - Previous_depth)
state depth : scalar on floor := Previous_depth + 1e-2*press*timestep
term body on all : 1e3*Grad_u.Grad_Test_u
term contact on floor : -press*Test_u
load u = -5*(1 + t) on top
steps t = 0 to 10 by auto with error=1e-3
measure m = mean(u) on all
output vtk "u" every 2 : u
"#;
    let of = |scheme: &str| energy.replace("SCHEME", scheme);
    for (name, text) in [("bar", of("bdf2")), ("alpha", of("generalised_alpha")), ("pin", lag.to_owned())] {
        let folder = Folder::new(&format!("killed-auto-{name}"));
        let scene = folder.0.join("judged.wfl");
        std::fs::write(&scene, text).expect("writable");
        goes_on_to_the_same_bytes(&folder, &scene, 20);
    }
}

/// Levels of multigrid are made of the tangents of a step, and kept in it.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_killed_run_by_conjugate_gradients_on_tangents_goes_on_to_the_same_bytes() {
    let folder = Folder::new("killed-tangents");
    let scene = folder.0.join("bent.wfl");
    let text = r#"wfl 1
mesh box [0,0,0] to [1,1,1] cells [9,9,9] hex
region low = faces where z == 0
unknown u : vector Q1
steps t = 0.02 to 0.2 by 0.02
def F = Id(3) + Grad_u
term elastic on all : (4*(F - Inv(F)') + 6*log(Det(F))*Inv(F)'):Grad_Test_u
fix u = [0,0,0] on low
load u = [t,0,3*t] on all
solver linear with cg, amg
measure far = max(Norm(u)) on all
output vtk "u" : u
"#;
    std::fs::write(&scene, text).expect("writable");
    goes_on_to_the_same_bytes(&folder, &scene, 10);
}

/// So are those of bodies with contact that is not symmetric.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_killed_run_by_gmres_on_tangents_goes_on_to_the_same_bytes() {
    let folder = Folder::new("killed-contact");
    let scene = folder.0.join("pulled.wfl");
    let text = r#"wfl 1
mesh box [0,0,0] to [1,1,1] cells [8,8,8] hex
region floor = faces where z == 0
region lid = faces where z == 1
unknown u : vector
steps t = 1 to 10 by 1
def F = Id(3) + Grad_u
def P = 80*(F - Inv(F)') + 120*log(Det(F))*Inv(F)'
def tang(w) = w - (w.Normal)*Normal
def Pn = 1e4*(u.Normal) - (P*Normal).Normal
def Pt = 1e4*tang(u) - tang(P*Normal)
term elastic on all : P:Grad_Test_u
term contact on floor : (pos_part(Pn)*Normal + Ball_projection(Pt, 0.3*pos_part(Pn))).Test_u
fix u = [0.004*t, 0, -0.01*t] on lid
solver linear with gmres, amg
measure drag = integral((P*[0,0,1])(1)) on lid
output vtk "u" : u
"#;
    std::fs::write(&scene, text).expect("writable");
    goes_on_to_the_same_bytes(&folder, &scene, 10);
}

/// Velocities and accelerations pass from step to step.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_killed_run_with_inertia_and_contact_goes_on_to_the_same_bytes() {
    let folder = Folder::new("killed-rod");
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/dynamics/rod.wfl");
    let scene = folder.0.join("rod.wfl");
    std::fs::copy(&from, &scene).expect("a copy");
    edit(&scene, "param n     = 60", "param n     = 150");
    goes_on_to_the_same_bytes(&folder, &scene, 5);
}

/// Images follow from the displacements; what points slid elastically, rates and the balance of energy pass from step to step, and
/// so does what the choice of steps remembers.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_killed_run_of_bodies_that_slide_goes_on_to_the_same_bytes() {
    let text = r#"wfl 1
use "sliding"
mesh box [0,0] to [4,2] cells [8,4] quad with idle_cells=allowed
region lower = cells where y < 1
region upper = cells where y > 1 and x < 2
region sole  = faces of upper where y == 1
region floor = faces of lower where y == 1
region base  = faces of lower where y == 0
unknown a : vector Q1 on upper
unknown b : vector Q1 on lower
def P(g) = (Id(2) + g)*(0.5*((Id(2) + g)'*(Id(2) + g) - Id(2)))*200
term inertia_a on upper : Dot2_a.Test_a
term inertia_b on lower : Dot2_b.Test_b
term upper on upper : P(Grad_a):Grad_Test_a
term lower on lower : P(Grad_b):Grad_Test_b
fix b = [0, 0] on base
load a = [0, -0.5] on upper
mapping m = KIND from sole onto floor moving with a, b within 0.5
state elastic : vector on sole := MACRO_elastic(a, b, m, elastic, 100, 0.1)
term contact on sole : MACRO_friction(a, b, m, elastic, 100, 0.1)
start Dot_a = [1, -0.2]
scheme newmark energy=0.05
steps t = STEPS
measure slid = mean(a(1)) on sole
output vtk "u" : a, Dot_a as velocity
"#;
    for (kind, steps) in [("raytrace", "0 to 0.6 by 0.02"), ("project", "0 to 1 by auto with error=3e-5")] {
        let folder = Folder::new(&format!("killed-{kind}"));
        let scene = folder.0.join("slides.wfl");
        let name = if kind == "project" { "closest" } else { "sliding" };
        let text = text.replace("KIND", kind).replace("MACRO", name).replace("STEPS", steps);
        std::fs::write(&scene, text).expect("writable");
        goes_on_to_the_same_bytes(&folder, &scene, 20);
    }
}

/// Velocities, states and the balance of energy pass from one explicit step to the next.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_killed_run_of_explicit_steps_goes_on_to_the_same_bytes() {
    let folder = Folder::new("killed-explicit");
    let scene = folder.0.join("slid.wfl");
    let text = r#"wfl 1
mesh box [0] to [1] cells [400] segment
region fault = faces where x == 0
region far   = faces where x == 1
unknown u : scalar
state s : scalar on fault := s + abs(u - Previous_u)
term inertia on all : Dot2_u*Test_u
term stress on all : Grad_u.Grad_Test_u
term friction on fault : (0.6 - 0.3*min(s/0.1, 1))*Test_u
term absorbing on far : Dot_u*Test_u
load u = -0.7 on fault
scheme explicit energy=1
steps t = 0 to 2 by auto
measure slid = mean(s) on fault
output vtk "u" every 40 : u, Dot_u as velocity
"#;
    std::fs::write(&scene, text).expect("writable");
    goes_on_to_the_same_bytes(&folder, &scene, 10);
}

/// Growth without end is told of the whole run, whichever process saw its beginning.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_killed_run_tells_what_was_seen_before() {
    let folder = Folder::new("killed-warned");
    let scene = folder.0.join("grows.wfl");
    let text = "wfl 1\nmesh box [0,0] to [2,1] cells [8,4] quad\nregion left = faces where x == 0\nunknown u : vector\n\
                term inertia on all : Dot2_u.Test_u\nterm stress on all : 100*Sym(Grad_u):Grad_Test_u\n\
                term fed on all : -8*Dot_u.Test_u\nload u = [1,0.5] on all\nfix u = [0,0] on left\nsteps t = 0 to 5 by 0.002\n\
                measure far = max(Norm(u)) on all\n";
    std::fs::write(&scene, text).expect("writable");
    goes_on_to_the_same_bytes(&folder, &scene, 1);
    let report = std::fs::read_to_string(folder.0.join("whole/report.json")).expect("readable");
    assert!(report.contains("W647"), "{report}");
}

/// Kills runs of a scene that writes more than so many files.
fn goes_on_to_the_same_bytes(folder: &Folder, scene: &Path, n_files: usize) {
    let whole = folder.0.join("whole");
    let begin = Instant::now();
    assert!(run(scene, &whole, &[]).status.success());
    let all = begin.elapsed();
    let expected = results(&whole);
    assert!(expected.len() > n_files && !expected.contains_key("checkpoint.wflc"));
    // delays spread over the run by the golden ratio: every trial meets other moments
    let out = folder.0.join("killed");
    let (mut part, mut kills) = (0.0f64, 0);
    for trial in 0..4 {
        let _ = std::fs::remove_dir_all(&out);
        let mut more: &[&str] = &[];
        loop {
            let mut child = command(scene, &out, more).spawn().expect("the command starts");
            part = (part + 0.618_033_988_75).fract();
            std::thread::sleep(Duration::from_secs_f64((0.05 + 0.6 * part) * all.as_secs_f64()));
            if child.try_wait().expect("our own child").is_some_and(|status| status.success()) {
                break;
            }
            child.kill().expect("our own child");
            child.wait().expect("our own child");
            kills += 1;
            more = &["--resume"];
            if kills > 60 {
                // a machine so busy that nothing is reached: finish
                assert!(run(scene, &out, more).status.success());
                break;
            }
        }
        let found = results(&out);
        let names = |r: &BTreeMap<String, Vec<u8>>| r.keys().cloned().collect::<Vec<_>>();
        assert_eq!(names(&found), names(&expected), "trial {trial}");
        for (name, bytes) in &expected {
            assert!(found[name] == *bytes, "trial {trial}: {name} differs after {kills} kills");
        }
    }
    assert!(kills > 0, "nothing was killed");
}

#[test]
fn a_checkpoint_of_something_else_is_refused() {
    let folder = Folder::new("refused");
    let scene = fault(&folder);
    let out = folder.0.join("out");
    // a step that cannot be solved leaves a checkpoint of those before
    let setup = folder.0.join("fault.wfl");
    let broken = "steps t = 0 to 3 by 1\nload uR = [0, 0, sqrt(1.5 - t) - sqrt(1.5 - t)] on top";
    edit(&setup, "steps t = 0 to 9.5 by 0.5", broken);
    let failed = run(&scene, &out, &[]);
    let said = |o: &Output| String::from_utf8_lossy(&o.stderr).into_owned();
    assert_eq!(failed.status.code(), Some(1), "{}", said(&failed));
    let file = out.join("checkpoint.wflc");
    let good = std::fs::read(&file).expect("a checkpoint");
    let refused = |more: &[&str], words: &str| {
        let mut all = vec!["--resume"];
        all.extend_from_slice(more);
        let output = run(&scene, &out, &all);
        assert_eq!(output.status.code(), Some(1), "{words}");
        assert!(said(&output).contains(words), "{words}: {}", said(&output));
    };
    refused(&["gamma=2e5"], "another value of the parameter `gamma`");
    refused(&["nu=0.3"], "another value of the parameter `nu`");
    edit(&setup, broken, &format!("{broken}\n# another text"));
    refused(&[], "another content of `fault.wfl`");
    edit(&setup, "\n# another text", "");
    edit(&setup, "cells [4,4,4] hex", "cells [4,4,5] hex");
    refused(&[], "another content of `fault.wfl`");
    edit(&setup, "cells [4,4,5] hex", "cells [4,4,4] hex");
    for cut in [0, 7, 31, 32, good.len() / 2, good.len() - 1] {
        std::fs::write(&file, &good[..cut]).expect("writable");
        refused(&[], "not a complete checkpoint");
    }
    let mut flipped = good.clone();
    flipped[good.len() / 3] ^= 4;
    std::fs::write(&file, &flipped).expect("writable");
    refused(&[], "checksum");
    std::fs::write(&file, &good).expect("writable");
    let log = out.join("checkpoint_steps.wflc");
    let steps = std::fs::read(&log).expect("what was done");
    std::fs::write(&log, &steps[..steps.len() - 1]).expect("writable");
    refused(&[], "shorter than the checkpoint says");
    std::fs::write(&log, steps.iter().map(|b| b ^ 1).collect::<Vec<u8>>()).expect("writable");
    refused(&[], "not the one of the checkpoint");
    // what a killed run wrote behind the last checkpoint is no damage: the run goes on to the step that cannot be
    // solved
    std::fs::write(&log, [&steps[..], b"torn"].concat()).expect("writable");
    let goes_on = said(&run(&scene, &out, &["--resume"]));
    assert!(goes_on.contains("E601") && !goes_on.contains("checkpoint"), "{goes_on}");
    let again = std::fs::read(&log).expect("readable");
    assert!(again.starts_with(&steps));
    // steps behind the checkpoint, if there were any, are done again and stand where the torn end was
    assert!(!again.ends_with(b"torn") || again.len() == steps.len() + 4);
    let step = std::fs::read_dir(&out).expect("results").filter_map(Result::ok).map(|e| e.path());
    let step = step.into_iter().find(|p| p.extension().is_some_and(|e| e == "vtu")).expect("a step file");
    std::fs::remove_file(&step).expect("our own file");
    refused(&[], "is missing");
}

#[test]
fn without_a_checkpoint_a_run_starts_from_the_beginning_and_says_so() {
    let folder = Folder::new("fresh");
    let scene = folder.0.join("one.wfl");
    let text = "mesh box [0] to [1] cells [2] segment\nunknown u : scalar\nterm on all : Grad_u.Grad_Test_u\nfix u = x on boundary\n";
    std::fs::write(&scene, text).expect("writable");
    let output = Command::new(env!("CARGO_BIN_EXE_wfl"))
        .args(["run", "--resume", "--out"])
        .arg(folder.0.join("out"))
        .arg(&scene)
        .output()
        .expect("the command starts");
    assert!(output.status.success());
    assert!(String::from_utf8_lossy(&output.stderr).contains("from the beginning"));
}
