//! Who depends on whom, one owner for every outside crate, and where unsafe code may stand.

use super::{code, read, root, sources};

/// Crates with their folder and all that they may depend on, development aside. A new arrow is a design change: it is
/// added here, and the commit says why.
pub(super) const ARROWS: &[(&str, &str, &[&str])] = &[
    ("wfl-charts", "runtime/charts", &["gif", "noto-sans-mono-bitmap", "png"]),
    ("wfl", "wfl", &["annotate-snippets", "pest", "pest_derive"]),
    ("wfl-compiler", "compiler", &["wfl", "libm", "thiserror"]),
    (
        "wfl-jit",
        "compiler/jit",
        &[
            "wfl-compiler",
            "cranelift-codegen",
            "cranelift-frontend",
            "cranelift-jit",
            "cranelift-module",
            "cranelift-native",
        ],
    ),
    ("wfl-host", "runtime/host", &["thiserror"]),
    ("wfl-mesh", "runtime/mesh", &["wfl", "wfl-host", "miniz_oxide", "nalgebra", "thiserror"]),
    ("wfl-dense", "runtime/dense", &["faer", "pulp"]),
    ("wfl-sparse", "runtime/sparse", &["wfl-dense", "wfl-host", "nalgebra", "rayon", "thiserror"]),
    (
        "wfl-discrete",
        "runtime/discrete",
        &[
            "wfl",
            "wfl-compiler",
            "wfl-host",
            "wfl-mesh",
            "wfl-sparse",
            "nalgebra",
            "pulp",
            "rayon",
            "thiserror",
            "zerocopy",
        ],
    ),
    (
        "wfl-contact",
        "runtime/contact",
        &["wfl-compiler", "wfl-discrete", "wfl-host", "wfl-mesh", "wfl-sparse", "nalgebra"],
    ),
    ("wfl-linear", "runtime/linear", &["wfl-compiler", "wfl-discrete", "wfl-host", "wfl-sparse"]),
    (
        "wfl-newton",
        "runtime/newton",
        &["wfl-compiler", "wfl-contact", "wfl-discrete", "wfl-host", "wfl-linear", "wfl-sparse", "thiserror"],
    ),
    // both only with its feature
    ("wfl-petsc", "runtime/petsc", &["wfl-host", "wfl-sparse", "cc"]),
    (
        "wfl-checks",
        "runtime/checks",
        // wfl-host: what is found on several ranks is brought together
        &[
            "wfl-compiler",
            "wfl-contact",
            "wfl-discrete",
            "wfl-host",
            "wfl-linear",
            "wfl-mesh",
            "wfl-newton",
            "wfl-sparse",
            "nalgebra",
            "rayon",
        ],
    ),
    (
        "wfl-output",
        "runtime/output",
        &["wfl-compiler", "wfl-discrete", "wfl-host", "wfl-mesh", "serde", "serde_json", "thiserror"],
    ),
    (
        "wfl-problem",
        "runtime/problem",
        &[
            "wfl",
            "wfl-checks",
            "wfl-compiler",
            "wfl-contact",
            "wfl-discrete",
            "wfl-host",
            "wfl-linear",
            "wfl-mesh",
            "wfl-newton",
            "wfl-output",
            "wfl-sparse",
            "nalgebra",
            "serde",
            "thiserror",
        ],
    ),
    (
        "wfl-run",
        "runtime/run",
        &[
            "wfl",
            "wfl-checks",
            "wfl-compiler",
            "wfl-contact",
            "wfl-discrete",
            "wfl-host",
            "wfl-linear",
            "wfl-mesh",
            "wfl-newton",
            "wfl-output",
            "wfl-problem",
            "wfl-sparse",
            "rayon",
            "serde_json",
            "thiserror",
        ],
    ),
    (
        "wfl-gradient",
        "runtime/gradient",
        &[
            "wfl",
            "wfl-compiler",
            "wfl-discrete",
            "wfl-mesh",
            "wfl-newton",
            "wfl-problem",
            "wfl-run",
            "wfl-sparse",
            "nalgebra",
        ],
    ),
    (
        "wfl-adapt",
        "runtime/adapt",
        &[
            "wfl",
            "wfl-checks",
            "wfl-compiler",
            "wfl-contact",
            "wfl-discrete",
            "wfl-mesh",
            "wfl-newton",
            "wfl-output",
            "wfl-problem",
            "wfl-run",
            "wfl-sparse",
            "thiserror",
        ],
    ),
    ("wfl-report", "runtime/report", &["wfl-charts", "wfl-host", "wfl-mesh", "wfl-output", "serde_json", "thiserror"]),
    (
        "wfl-tasks",
        "runtime/tasks",
        &[
            "wfl",
            "wfl-adapt",
            "wfl-charts",
            "wfl-checks",
            "wfl-compiler",
            "wfl-contact",
            "wfl-discrete",
            "wfl-gradient",
            "wfl-host",
            "wfl-mesh",
            "wfl-newton",
            "wfl-output",
            "wfl-problem",
            "wfl-run",
            "wfl-sparse",
            "serde",
            "serde_json",
            "thiserror",
        ],
    ),
    // an editor asks for what the tasks and the problem know; nothing below knows of editors
    (
        "wfl-lsp",
        "runtime/lsp",
        &[
            "wfl",
            "wfl-compiler",
            "wfl-host",
            "wfl-mesh",
            "wfl-problem",
            "wfl-tasks",
            "crossbeam-channel",
            "lsp-server",
            "lsp-types",
            "serde",
            "serde_json",
        ],
    ),
    (
        "wfl-cli",
        "runtime/cli",
        &[
            "wfl",
            "wfl-adapt",
            "wfl-checks",
            "wfl-compiler",
            "wfl-discrete",
            "wfl-gradient",
            "wfl-host",
            "wfl-jit",
            "wfl-linear",
            "wfl-lsp",
            "wfl-mesh",
            "wfl-newton",
            "wfl-output",
            "wfl-petsc",
            "wfl-problem",
            "wfl-report",
            "wfl-run",
            "wfl-sparse",
            "wfl-tasks",
            "clap",
            "clap_complete",
            "clap_mangen",
            "indicatif",
            "serde_json",
            "signal-hook",
        ],
    ),
    (
        "wfl-tests",
        "tests",
        &[
            "wfl",
            "wfl-checks",
            "wfl-compiler",
            "wfl-contact",
            "wfl-discrete",
            "wfl-gradient",
            "wfl-host",
            "wfl-jit",
            "wfl-mesh",
            "wfl-newton",
            "wfl-output",
            "wfl-problem",
            "wfl-report",
            "wfl-run",
            "wfl-sparse",
            "rayon",
            "serde",
            "serde_json",
        ],
    ),
    (
        "wfl-suites",
        "tests/tests",
        &[
            "wfl",
            "wfl-checks",
            "wfl-compiler",
            "wfl-contact",
            "wfl-discrete",
            "wfl-gradient",
            "wfl-host",
            "wfl-jit",
            "wfl-mesh",
            "wfl-newton",
            "wfl-output",
            "wfl-problem",
            "wfl-report",
            "wfl-run",
            "wfl-sparse",
            "wfl-tests",
            "rayon",
            "serde",
            "serde_json",
        ],
    ),
];

/// Outside crates by the name that paths begin with, and where alone they may be named.
const OWNERS: &[(&str, &[&str])] = &[
    ("annotate_snippets", &["wfl/src/render.rs"]),
    ("pest", &["wfl/src/parse.rs", "wfl/src/parse/"]),
    ("pest_derive", &["wfl/src/parse.rs", "wfl/src/parse/"]),
    ("cranelift_codegen", &["compiler/jit/"]),
    ("cranelift_frontend", &["compiler/jit/"]),
    ("cranelift_jit", &["compiler/jit/"]),
    ("cranelift_module", &["compiler/jit/"]),
    ("cranelift_native", &["compiler/jit/"]),
    // the rows of the second are expanded in the first
    ("libm", &["compiler/src/", "wfl/src/scalar_functions.rs"]),
    ("signal_hook", &["runtime/cli/src/interrupt.rs"]),
    ("faer", &["runtime/dense/"]),
    ("pulp", &["runtime/discrete/src/assemble/", "runtime/dense/src/sweeps"]),
    ("zerocopy", &["runtime/discrete/src/assemble/"]),
    ("miniz_oxide", &["runtime/mesh/src/mesh/read/vtu/"]),
    ("criterion", &["runtime/run/benches/"]),
    ("pyo3", &["runtime/python/"]),
    ("numpy", &["runtime/python/"]),
    ("clap", &["runtime/cli/"]),
    ("clap_complete", &["runtime/cli/src/shell.rs"]),
    ("clap_mangen", &["runtime/cli/src/shell.rs"]),
    ("indicatif", &["runtime/cli/"]),
    ("crossbeam_channel", &["runtime/lsp/"]),
    ("lsp_server", &["runtime/lsp/"]),
    ("lsp_types", &["runtime/lsp/"]),
    ("wfl_petsc", &["runtime/cli/src/solvers.rs"]),
];

/// The names under the dependency tables of a manifest, development aside.
fn dependencies(manifest: &str) -> Vec<String> {
    let mut inside = false;
    let mut names = Vec::new();
    for line in manifest.lines().map(str::trim) {
        if let Some(table) = line.strip_prefix('[') {
            let table = table.trim_end_matches(']');
            inside = table.ends_with("dependencies") && table != "dev-dependencies";
            assert!(!table.contains("dependencies."), "one line a dependency: [{table}]");
        } else if inside && !line.is_empty() && !line.starts_with('#') {
            let end = line.find(|c: char| !c.is_ascii_alphanumeric() && c != '-' && c != '_').unwrap_or(line.len());
            names.push(line[..end].to_owned());
        }
    }
    names
}

/// Whether a line names a crate: `name::` or `use name` not as the end of another word or path.
fn names_crate(line: &str, name: &str) -> bool {
    line.match_indices(name).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        let free = before.is_none_or(|c| !c.is_alphanumeric() && c != '_' && c != '"' && c != '.');
        let path = line[..at].ends_with("::") && !line[..at].ends_with(" ::");
        let after = &line[at + name.len()..];
        free && !path && (after.starts_with("::") || (line.contains("use ") && after.starts_with([';', ' ', ','])))
    })
}

#[test]
fn crates_depend_only_on_what_is_allowed() {
    let workspace = read("Cargo.toml");
    for (name, folder, allowed) in ARROWS {
        let manifest = read(&format!("{folder}/Cargo.toml"));
        assert!(manifest.contains(&format!("name = \"{name}\"")), "{folder} is not {name}");
        assert!(workspace.contains(&format!("\"{folder}\"")), "{folder} is not a member");
        assert!(manifest.contains("[lints]\nworkspace = true"), "{name} does not take the lints of the workspace");
        let found = dependencies(&manifest);
        assert_eq!(found.is_empty(), allowed.is_empty(), "{folder}: dependencies read: {found:?}");
        for dependency in found {
            assert!(allowed.contains(&dependency.as_str()), "{name} may not depend on {dependency}");
        }
    }
    let members = workspace.lines().find(|l| l.starts_with("members")).expect("members");
    assert_eq!(members.matches('"').count(), 2 * ARROWS.len(), "a member without a row here: {members}");
}

#[test]
fn every_version_is_written_once() {
    for (_, folder, _) in ARROWS {
        let manifest = read(&format!("{folder}/Cargo.toml"));
        let mut table = "";
        for line in manifest.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#')) {
            if line.starts_with('[') {
                table = line;
            } else if table.ends_with("dependencies]") {
                // that a dependency is optional is said beside its version
                assert!(
                    line.contains(".workspace = true") || line.ends_with(".optional = true"),
                    "{folder}: `{line}` belongs into the workspace's table"
                );
            }
        }
    }
}

#[test]
fn the_server_can_be_left_out_of_a_build() {
    let manifest = read("runtime/cli/Cargo.toml");
    for name in ["wfl-lsp", "clap_complete", "clap_mangen"] {
        assert!(manifest.contains(&format!("{name}.optional = true")), "{name} is always built");
    }
    assert!(manifest.lines().any(|l| l == "default = [\"lsp\"]"), "editors are served by the program as it is built");
    assert!(read("Cargo.toml").contains("default-members = [\"runtime/cli\"]"));
}

#[test]
fn an_outside_crate_has_one_owner() {
    // what tries the search below names crates too
    for (path, text) in sources().iter().filter(|s| !s.0.contains("/tidy/")) {
        for (name, owners) in OWNERS {
            if owners.iter().any(|o| path.starts_with(o)) {
                continue;
            }
            let at = code(text).find(|(_, l)| names_crate(l, name));
            assert!(at.is_none(), "{path}:{}: only {owners:?} may name {name}", at.expect("found").0);
        }
    }
}

#[test]
fn naming_a_crate_is_seen() {
    assert!(names_crate("use faer::Mat;", "faer"));
    assert!(names_crate("    let m = faer::Mat::zeros(1, 1);", "faer"));
    assert!(names_crate("use pest_derive::Parser;", "pest_derive"));
    assert!(!names_crate("use pest_derive::Parser;", "pest"));
    assert!(!names_crate("use super::faer::lu;", "faer"));
    assert!(!names_crate("let name = \"faer\";", "faer"));
}

#[test]
fn unsafe_code_stands_only_in_the_jit_in_the_allocator_and_at_the_door_to_petsc() {
    const DOORS: [&str; 4] = [
        "compiler/jit/",
        "runtime/petsc/src/ffi.rs",
        "runtime/petsc/src/objects.rs",
        "runtime/host/src/memory/telling.rs",
    ];
    for door in ["runtime/petsc/src/lib.rs", "runtime/host/src/lib.rs"] {
        assert!(read(door).contains("#![deny(unsafe_code)]"), "{door} has files with it");
    }
    for (name, folder, _) in
        ARROWS.iter().filter(|a| !matches!(a.0, "wfl-jit" | "wfl-petsc" | "wfl-host" | "wfl-suites"))
    {
        let candidates = ["lib.rs", "main.rs"].map(|f| format!("{folder}/src/{f}"));
        let door = candidates.iter().find(|p| root().join(p).is_file()).expect("a crate has a door");
        // what suites share has no code of its own worth the attribute; the check of their text below is enough
        assert!(*name == "wfl-tests" || read(door).contains("#![forbid(unsafe_code)]"), "{door} allows unsafe code");
    }
    let word = concat!("un", "safe");
    let is_checked = |path: &str| !DOORS.iter().any(|door| path.starts_with(door)) && !path.contains("/tidy/");
    for (path, text) in sources().iter().filter(|s| is_checked(&s.0)) {
        let at = code(text).find(|(_, l)| l.contains(&format!("{word} ")));
        assert!(at.is_none(), "{path}:{}: {word} code", at.expect("found").0);
    }
}

/// The versions of a lock file by the name of the crate; several of a crate are told apart by their first numbers.
fn locked(path: &str) -> Vec<(String, String)> {
    let text = read(path);
    let value = |line: &str, key: &str| Some(line.strip_prefix(key)?.trim_matches([' ', '=', '"']).to_owned());
    let lines: Vec<&str> = text.lines().collect();
    let pairs = lines.windows(2).filter_map(|w| Some((value(w[0], "name")?, value(w[1], "version")?)));
    pairs.collect()
}

#[test]
fn the_package_for_python_has_the_crates_of_the_program() {
    // else its numbers could be others
    let (program, package) = (locked("Cargo.lock"), locked("runtime/python/Cargo.lock"));
    assert!(program.len() > 100 && package.len() > 100);
    for (name, version) in &package {
        let known: Vec<&String> = program.iter().filter(|p| p.0 == *name).map(|p| &p.1).collect();
        assert!(known.is_empty() || known.contains(&version), "{name} {version} for Python, {known:?} for the program");
    }
    // the default profile of releases has no debug information, which is what the workspace says
    assert!(!read("runtime/python/Cargo.toml").contains("[profile"), "a profile of its own");
}
