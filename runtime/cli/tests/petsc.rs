//! `--backend petsc`: the same Newton iterations and measures as with the solvers of this program, few iterations of
//! multigrid, and what is refused.

mod common;

use std::{
    path::{Path, PathBuf},
    process::{Command, Output},
};

#[cfg(feature = "petsc")]
use common::Folder;

fn wfl(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_wfl")).args(arguments).output().expect("the command starts")
}

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples")
}

#[cfg(not(feature = "petsc"))]
#[test]
fn a_program_without_petsc_refuses_it_in_one_line_before_it_reads_the_scene() {
    for command in ["run", "check"] {
        let out = wfl(&[command, "no_such_scene.wfl", "--backend", "petsc"]);
        let told = String::from_utf8_lossy(&out.stderr).into_owned();
        assert_eq!(out.status.code(), Some(1), "{told}");
        let expected = "error: this program was built without PETSc\n  = help: cargo build --release --features petsc";
        assert!(told.starts_with(expected), "{told}");
    }
    let scene = examples().join("elasticity/block.wfl");
    assert!(wfl(&["check", &scene.display().to_string(), "--backend", "own"]).status.success());
}

#[cfg(feature = "petsc")]
mod linked {
    use std::{
        process::{Child, Stdio},
        sync::atomic::{AtomicUsize, Ordering},
    };

    use serde_json::Value;

    use super::*;

    /// Measures of two runs agree to this part of the largest value that each measure has in the run.
    const WITHIN: f64 = 1e-10;
    /// A measure below this part of the largest one of the scene is zero but for rounding of what cancels in it, and is
    /// compared with that one.
    const ZERO: f64 = 1e-9;

    /// A scene with what is replaced in its text, beside copies of the files that it uses.
    fn scene(folder: &Folder, from: &str, name: &str, edits: &[(&str, &str)]) -> PathBuf {
        for entry in std::fs::read_dir(examples().join(from)).expect("the examples") {
            let path = entry.expect("readable").path();
            let to = folder.0.join(path.file_name().expect("a file"));
            match std::fs::read_to_string(&path) {
                Ok(text) => {
                    let edited = edits.iter().fold(text, |text, (old, new)| text.replace(old, new));
                    std::fs::write(to, edited).expect("writable");
                }
                Err(_) => std::fs::copy(&path, to).map(drop).expect("a copy"),
            }
        }
        folder.0.join(name)
    }

    /// The report of a run.
    fn report(scene: &Path, backend: &str, settings: &[&str]) -> Value {
        let out = scene.with_extension(backend.replace(':', "_"));
        let (file, folder) = (scene.display().to_string(), out.display().to_string());
        let fixed = ["run", &file, "--quiet", "--threads", "1", "--out", &folder, "--backend", backend];
        let done = wfl(&[&fixed[..], settings].concat());
        let told = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(matches!(done.status.code(), Some(0 | 3)), "{file} {settings:?}: {told}");
        let text = std::fs::read_to_string(out.join("report.json")).expect("a report");
        serde_json::from_str(&text).expect("JSON")
    }

    /// By measure its values over the steps.
    fn measures(report: &Value) -> Vec<(String, Vec<f64>)> {
        let steps = report["steps"].as_array().expect("steps");
        let names = steps.last().expect("a step")["measures"].as_object().expect("measures");
        let of = |name: &String| {
            let values = steps.iter().map(|step| step["measures"][name].as_f64().unwrap_or(f64::NAN));
            (name.clone(), values.collect())
        };
        names.keys().map(of).collect()
    }

    fn iterations(report: &Value) -> Vec<u64> {
        let steps = report["steps"].as_array().expect("steps");
        steps.iter().map(|step| step["iterations"].as_u64().expect("a count")).collect()
    }

    fn solver(report: &Value) -> String {
        report["solver"].as_str().unwrap_or_default().to_owned()
    }

    /// Both runs of a scene agree; what the solver of the second says of itself.
    fn agree(scene: &Path, backend: &str, settings: &[&str]) -> String {
        let other = report(scene, backend, settings);
        same(&report(scene, "own", settings), &other, &format!("{} {settings:?} {backend}", scene.display()));
        solver(&other)
    }

    /// Two runs have the same Newton iterations and measures.
    fn same(own: &Value, other: &Value, name: &str) {
        assert_eq!(iterations(own), iterations(other), "Newton iterations of {name}");
        let (own, found) = (measures(own), measures(other));
        assert_eq!(own.len(), found.len(), "{name}");
        let size = |values: &[f64]| values.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let of_all = own.iter().map(|(_, values)| size(values)).fold(0.0, f64::max);
        for ((measure, a), (_, b)) in own.iter().zip(&found) {
            let largest = if size(a) > ZERO * of_all { size(a) } else { of_all };
            let apart: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
            let apart = size(&apart);
            assert!(apart <= WITHIN * largest, "{name}: {measure} differs by {apart:e} of {largest:e}");
        }
    }

    /// Both methods of PETSc agree with the solvers of this program.
    fn both_agree(from: &str, name: &str, edits: &[(&str, &str)], settings: &[&str]) -> [String; 2] {
        static NUMBER: AtomicUsize = AtomicUsize::new(0);
        let folder = Folder::new(&format!("petsc-{}", NUMBER.fetch_add(1, Ordering::Relaxed)));
        let scene = scene(&folder, from, name, edits);
        ["petsc:direct", "petsc:iterative"].map(|backend| agree(&scene, backend, settings))
    }

    /// The first number before `word`.
    fn count(text: &str, word: &str) -> usize {
        let before = text.split(word).next().expect("a text before");
        let number = before.split_whitespace().next_back().expect("a number");
        number.parse().unwrap_or_else(|_| panic!("no number before `{word}` in: {text}"))
    }

    const SMALL_FAULT: &[(&str, &str)] =
        &[("cells [8, 8, 8] hex", "cells [4, 4, 4] hex"), ("to 9.5 by 0.5", "to 9 by 3")];

    #[test]
    fn the_fault_with_three_methods_at_three_stiffnesses() {
        for method in ["nitsche.wfl", "penalty.wfl", "augmented_lagrangian.wfl"] {
            // E/h is 25000 on cells of 1
            for gamma in ["gamma=2.5e4", "gamma=2.5e5", "gamma=2.5e6"] {
                let [direct, iterative] = both_agree("fault", method, SMALL_FAULT, &[gamma]);
                assert!(direct.contains("MUMPS"), "{direct}");
                assert!(iterative.contains("GMRES") && !iterative.contains("in place"), "{iterative}");
            }
        }
    }

    #[test]
    fn an_inclined_fault_of_tetrahedra() {
        let steps = [("to 9.5 by 0.5", "to 9 by 3")];
        for name in ["fault_30deg.wfl", "fault_30deg_augmented_lagrangian.wfl"] {
            both_agree("fault_gmsh", name, &steps, &[]);
        }
    }

    #[test]
    fn a_split_crack_hertz_a_mapping_and_other_plane_scenes() {
        for (from, name, settings) in [
            ("crack", "compression.wfl", &["cells=[30,45]"][..]),
            ("hertz", "hertz.wfl", &["cells=[40,40]"][..]),
            ("mapping", "pressed.wfl", &[][..]),
            ("heat", "heat.wfl", &[][..]),
        ] {
            let folder = Folder::new(&format!("petsc-plane-{}", name.trim_end_matches(".wfl")));
            let text = agree(&scene(&folder, from, name, &[]), "petsc", settings);
            assert!(text.contains("MUMPS"), "{text}");
        }
    }

    #[test]
    fn local_frames_and_finite_strain_with_contact() {
        // the stress itself in place of what it differs by from the exact one, which is rounding
        let stress = ("max(Norm(stress(u) - p*(Normal@Normal))) on east", "max(Norm(stress(u))) on east");
        both_agree("elasticity", "rollers.wfl", &[stress], &[]);
        both_agree("hyperelastic", "contact.wfl", &[], &[]);
        both_agree("hyperelastic", "contact.wfl", &[], &["fric=0.3"]);
    }

    #[test]
    fn a_body_that_contact_alone_holds() {
        // the right block has no other support: the levels are made of the tangent with contact
        let edits =
            [SMALL_FAULT[0], SMALL_FAULT[1], ("fix  uL, uR = [0,0,0]  on bottom", "fix  uL = [0,0,0] on bottom")];
        let held = ("load uR     = [0,0,-t] on top", "load uR     = [0,0,-0.1*t] on top");
        let [_, iterative] = both_agree("fault", "nitsche.wfl", &[&edits[..], &[held]].concat(), &[]);
        assert!(iterative.contains("GMRES"), "{iterative}");
    }

    #[test]
    fn multigrid_takes_few_iterations_and_hardly_more_on_finer_meshes() {
        let folder = Folder::new("petsc-cube");
        let cube = |n: usize| {
            let file = folder.0.join(format!("cube{n}.wfl"));
            let text = format!(
                "wfl 1\nmesh box [0,0,0] to [1,1,1] cells [{n},{n},{n}] hex\nregion left = faces where x == 0\n\
                 region right = faces where x == 1\nunknown u : vector\n\
                 term elastic on all : (576*Div_u*Id(3) + 769*Sym(Grad_u)):Grad_Test_u\nfix u = [0,0,0] on left\n\
                 load u = [1,0.5,0.2] on right\nmeasure far = max(Norm(u)) on all\n"
            );
            std::fs::write(&file, text).expect("writable");
            let text = agree(&file, "petsc:iterative", &[]);
            assert!(text.contains("conjugate gradients") && !text.contains("in place"), "{text}");
            count(&text, " iterations in")
        };
        // one solution to 1e-12 and one to 1e-3: 25 iterations for 8 digits are 47 for 15
        let (coarse, fine) = (cube(8), cube(16));
        assert!(fine <= 47 && 10 * fine <= 14 * coarse, "{coarse} and {fine}");
    }

    #[test]
    fn boomeramg_makes_levels_where_iterations_do_not_end() {
        let folder = Folder::new("petsc-boomeramg");
        let scene = scene(&folder, "fault", "nitsche.wfl", SMALL_FAULT);
        let out = folder.0.join("without_levels");
        let [file, to] = [&scene, &out].map(|path| path.display().to_string());
        let mut command = Command::new(env!("CARGO_BIN_EXE_wfl"));
        command.args(["run", &file, "--out", &to, "--threads", "1", "--backend", "petsc:iterative", "cells=[8,8,8]"]);
        // what a user puts in place of GAMG is taken, and here does nothing
        let done = command
            .env("PETSC_OPTIONS", "-wfl_cycle_pc_type none -wfl_gmres_ksp_gmres_restart 10")
            .output()
            .expect("the command starts");
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let text = std::fs::read_to_string(out.join("report.json")).expect("a report");
        let found: Value = serde_json::from_str(&text).expect("JSON");
        assert!(solver(&found).contains("by BoomerAMG in place of GAMG"), "{}", solver(&found));
        same(&report(&scene, "own", &["cells=[8,8,8]"]), &found, "levels of BoomerAMG");
    }

    #[test]
    fn iterations_of_contact_hardly_depend_on_gamma() {
        let folder = Folder::new("petsc-gamma");
        // on 4x4x4 cells a contact that gives way has so few unknowns that a solution takes fewer iterations
        let scene = scene(&folder, "fault", "nitsche.wfl", &SMALL_FAULT[1..]);
        let of = |gamma: &str| {
            let text = solver(&report(&scene, "petsc:iterative", &[gamma]));
            count(&text, " iterations in") as f64 / count(&text, " solutions") as f64
        };
        let found = ["gamma=5e4", "gamma=5e5", "gamma=5e6"].map(of);
        let (low, high) = found.iter().fold((f64::INFINITY, 0.0f64), |(l, h), x| (l.min(*x), h.max(*x)));
        assert!(high <= 60.0 && high <= 1.2 * low, "iterations a solution: {found:?}");
    }

    /// The command on several ranks, more than there are cores if need be.
    fn on_ranks(n: usize, arguments: &[&str]) -> Output {
        ranks(n, arguments).output().expect("mpirun starts")
    }

    /// The same, not waited for.
    fn started_on_ranks(n: usize, arguments: &[&str]) -> Child {
        let command = &mut ranks(n, arguments);
        command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("mpirun starts")
    }

    fn ranks(n: usize, arguments: &[&str]) -> Command {
        let mut command = Command::new("mpirun");
        command.args(["--oversubscribe", "-n", &n.to_string(), env!("CARGO_BIN_EXE_wfl")]).args(arguments);
        for name in ["OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"] {
            command.env(name, "1");
        }
        command
    }

    /// A run on several ranks has the iterations and measures of one with our own solvers, and one rank tells.
    fn ranks_agree(scene: &Path, backend: &str, n: usize) {
        ranks_with_agree(scene, backend, n, &[]);
    }

    /// The same with more words of the command.
    fn ranks_with_agree(scene: &Path, backend: &str, n: usize, more: &[&str]) {
        let out = scene.with_extension(format!("ranks{n}"));
        let (file, folder) = (scene.display().to_string(), out.display().to_string());
        let done = on_ranks(n, &[&["run", &file, "--out", &folder, "--backend", backend], more].concat());
        let (told, summary) = (String::from_utf8_lossy(&done.stderr), String::from_utf8_lossy(&done.stdout));
        assert!(matches!(done.status.code(), Some(0 | 3)), "{n} ranks: {told}");
        assert_eq!(summary.matches("unknowns, ").count(), 1, "{n} ranks: {summary}");
        let text = std::fs::read_to_string(out.join("report.json")).expect("a report");
        let shared: Value = serde_json::from_str(&text).expect("JSON");
        same(&report(scene, "own", &[]), &shared, &format!("{file} on {n} ranks with {backend}"));
    }

    #[test]
    fn several_ranks_have_the_measures_of_one() {
        let folder = Folder::new("petsc-ranks");
        let fault = scene(&folder, "fault", "nitsche.wfl", SMALL_FAULT);
        (1..=4).for_each(|n| ranks_agree(&fault, "petsc:iterative", n));
        ranks_agree(&fault, "petsc:direct", 2);
        ranks_with_agree(&fault, "petsc:iterative", 2, &["--whole-mesh"]);
        ranks_agree(&fault.with_file_name("augmented_lagrangian.wfl"), "petsc:iterative", 3);
        let stress = ("max(Norm(stress(u) - p*(Normal@Normal))) on east", "max(Norm(stress(u))) on east");
        let others = [
            ("hyperelastic", "contact.wfl", &[][..], "petsc:iterative", 2),
            ("hertz", "hertz.wfl", &[], "petsc", 3),
            ("crack", "pressure.wfl", &[], "petsc", 4),
            ("heat", "heat.wfl", &[], "petsc", 2),
            ("fault_gmsh", "fault_30deg.wfl", &[], "petsc:iterative", 3),
            ("elasticity", "rollers.wfl", &[stress], "petsc:iterative", 4),
            ("plasticity", "perzyna.wfl", &[], "petsc", 3),
            ("mapping", "pressed.wfl", &[], "petsc", 2),
        ];
        for (from, name, edits, backend, ranks) in others {
            let folder = Folder::new(&format!("petsc-ranks-{name}"));
            ranks_agree(&scene(&folder, from, name, edits), backend, ranks);
        }
    }

    #[test]
    fn an_error_on_all_ranks_is_told_once_and_ends_them() {
        let begin = std::time::Instant::now();
        let told = on_ranks(2, &["run", "no_such_scene.wfl", "--backend", "petsc"]);
        let text = String::from_utf8_lossy(&told.stderr).into_owned();
        assert!(!told.status.success() && text.matches("error: ").count() == 1, "{text}");
        assert!(begin.elapsed().as_secs() < 5, "{:?}", begin.elapsed());
        let scene = examples().join("elasticity/block.wfl").display().to_string();
        let told = on_ranks(2, &["run", &scene, "--backend", "petsc", "--savings"]);
        let text = String::from_utf8_lossy(&told.stderr).into_owned();
        assert_eq!(text.matches("--savings does not go with several ranks").count(), 1, "{text}");
    }

    #[test]
    fn a_number_that_one_rank_has_alone_is_told_once_and_ends_all() {
        let folder = Folder::new("petsc-not-finite");
        let file = folder.0.join("scene.wfl");
        let text = "wfl 1\nmesh box [0,0,0] to [1,1,1] cells [4,4,4] hex\nregion left = faces where x == 0\n\
            unknown u : vector\nparam big = 0.9\n\
            term elastic on all : (Div_u*Id(3) + 2*Sym(Grad_u)):Grad_Test_u\nfix u = [0, 0, log(big - z)] on left\n";
        std::fs::write(&file, text).expect("writable");
        let out = folder.0.join("out").display().to_string();
        let begin = std::time::Instant::now();
        let told = on_ranks(3, &["run", &file.display().to_string(), "--backend", "petsc", "--out", &out]);
        let text = String::from_utf8_lossy(&told.stderr).into_owned();
        assert!(told.status.code() == Some(1) && text.matches("E610").count() == 1, "{text}");
        assert!(begin.elapsed().as_secs() < 5, "{:?}", begin.elapsed());
    }

    #[test]
    fn check_says_what_would_be_used() {
        let scene = examples().join("fault/nitsche.wfl").display().to_string();
        let told =
            |backend: &str| String::from_utf8_lossy(&wfl(&["check", &scene, "--backend", backend]).stdout).into_owned();
        assert!(told("petsc").contains("PETSc: Newton; MUMPS"), "{}", told("petsc"));
        assert!(told("petsc:iterative").contains("PETSc: Newton; GMRES with multigrid (GAMG), then a direct solution"));
        assert!(!told("own").contains("PETSc") && !told("own").contains("several ranks"));
        assert!(told("petsc").contains("a part on each rank"), "{}", told("petsc"));
        let scene = examples().join("mapping/pressed.wfl").display().to_string();
        let told = String::from_utf8_lossy(&wfl(&["check", &scene, "--backend", "petsc"]).stdout).into_owned();
        assert!(told.contains("whole on each rank") && told.contains("a mapping leads to any place"), "{told}");
    }

    #[test]
    fn a_body_that_nothing_holds_is_told_as_with_a_factor_of_our_own() {
        let folder = Folder::new("petsc-loose");
        let file = folder.0.join("loose.wfl");
        let text = "wfl 1\nmesh box [0,0,0] to [1,1,1] cells [3,3,3] hex\nregion right = faces where x == 1\n\
            unknown u : vector\nterm elastic on all : (576*Div_u*Id(3) + 769*Sym(Grad_u)):Grad_Test_u\n\
            load u = [1,0,0] on right\n";
        std::fs::write(&file, text).expect("writable");
        for backend in ["own", "petsc:direct", "petsc:iterative"] {
            let results = folder.0.join("out").display().to_string();
            let out = wfl(&["run", &file.display().to_string(), "--backend", backend, "--quiet", "--out", &results]);
            let told = String::from_utf8_lossy(&out.stderr).into_owned();
            assert!(out.status.code() == Some(1) && told.contains("E602"), "{backend}: {told}");
        }
    }

    #[test]
    fn a_run_that_was_killed_goes_on_with_the_same_bits() {
        let folder = Folder::new("petsc-killed");
        let steps = ("to 9.5 by 0.5", "to 9 by 0.1");
        let file = scene(&folder, "fault", "nitsche.wfl", &[SMALL_FAULT[0], steps]).display().to_string();
        let command = |out: &Path, more: &[&str]| {
            let mut command = Command::new(env!("CARGO_BIN_EXE_wfl"));
            command.args(["run", &file, "--quiet", "--backend", "petsc:iterative", "--out"]).arg(out).args(more);
            command
        };
        let (whole, killed) = (folder.0.join("whole"), folder.0.join("killed"));
        assert!(command(&whole, &[]).status().expect("the command starts").success());
        let count = |out: &Path| std::fs::read_dir(out).map_or(0, Iterator::count);
        let mut child = command(&killed, &[]).spawn().expect("the command starts");
        while count(&killed) < 20 && child.try_wait().expect("a child").is_none() {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        child.kill().expect("a child that can be killed");
        child.wait().expect("a child");
        assert!(count(&killed) < count(&whole), "killed too late");
        assert!(command(&killed, &["--resume"]).status().expect("the command starts").success());
        for name in ["nitsche_0090.vtu", "across_0090.csv"] {
            let [a, b] = [&whole, &killed].map(|out| std::fs::read(out.join(name)).expect("a result"));
            assert!(a == b, "{name} differs");
        }
    }

    #[test]
    fn two_ranks_of_which_one_was_killed_go_on_with_the_same_bits() {
        let folder = Folder::new("petsc-killed-rank");
        let steps = ("to 9.5 by 0.5", "to 9 by 0.1");
        let file = scene(&folder, "fault", "nitsche.wfl", &[SMALL_FAULT[0], steps]).display().to_string();
        let (whole, killed) = (folder.0.join("whole"), folder.0.join("killed"));
        for backend in ["petsc:iterative", "petsc:direct"] {
            let [whole, killed] = [&whole, &killed].map(|out| out.with_extension(&backend[6..]).display().to_string());
            let arguments = |out: &str| -> Vec<String> {
                let all = ["run", &file, "--quiet", "--repeatable", "--backend", backend, "--out", out];
                all.iter().map(|a| (*a).to_owned()).collect()
            };
            let done = |out: &str, more: &str| {
                let mut all = arguments(out);
                all.extend((!more.is_empty()).then(|| more.to_owned()));
                on_ranks(2, &all.iter().map(String::as_str).collect::<Vec<_>>())
            };
            assert!(done(&whole, "").status.success());
            let count = |out: &str| std::fs::read_dir(out).map_or(0, Iterator::count);
            let mut running = started_on_ranks(2, &arguments(&killed).iter().map(String::as_str).collect::<Vec<_>>());
            while count(&killed) < 20 && running.try_wait().expect("a child").is_none() {
                std::thread::sleep(std::time::Duration::from_millis(5));
            }
            let ranks = Command::new("pgrep").args(["-f", &format!("wfl run .*{killed}")]).output().expect("pgrep");
            let ranks = String::from_utf8_lossy(&ranks.stdout).into_owned();
            let last = ranks.split_whitespace().next_back().expect("a rank that runs").to_owned();
            assert!(Command::new("kill").args(["-9", &last]).status().expect("kill").success());
            let begin = std::time::Instant::now();
            assert!(!running.wait().expect("a child").success());
            assert!(begin.elapsed().as_secs() < 5, "the others ended after {:?}", begin.elapsed());
            assert!(count(&killed) < count(&whole), "killed too late");
            let mut others = arguments(&killed);
            others.push("--resume".to_owned());
            let told = on_ranks(3, &others.iter().map(String::as_str).collect::<Vec<_>>());
            let text = String::from_utf8_lossy(&told.stderr).into_owned();
            assert!(!told.status.success() && text.contains("E714") && text.contains("`mpirun -n 2`"), "{text}");
            let told = done(&killed, "--resume");
            assert!(told.status.success(), "{}", String::from_utf8_lossy(&told.stderr));
            for name in ["nitsche_0090.pvtu", "nitsche_0090.p0000.vtu", "nitsche_0090.p0001.vtu", "across_0090.csv"] {
                let read = |out: &str| std::fs::read(Path::new(out).join(name)).expect("a result");
                assert!(read(&whole) == read(&killed), "{backend}: {name} differs");
            }
        }
    }

    #[test]
    fn results_of_another_backend_are_not_continued() {
        let folder = Folder::new("petsc-resume");
        let scene = scene(&folder, "fault", "nitsche.wfl", SMALL_FAULT);
        let out = folder.0.join("out").display().to_string();
        let file = scene.display().to_string();
        let run = |more: &[&str]| wfl(&[&["run", &file, "--quiet", "--out", &out], more].concat());
        assert!(run(&[]).status.success());
        let told = String::from_utf8_lossy(&run(&["--resume", "--backend", "petsc"]).stderr).into_owned();
        assert!(told.contains("backend"), "{told}");
    }
}
