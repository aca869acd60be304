//! Finds PETSc and MPI with pkg-config and compiles the C side; does nothing without the feature `petsc`.

#[cfg(not(feature = "petsc"))]
fn main() {
    println!("cargo:rerun-if-changed=build.rs");
}

#[cfg(feature = "petsc")]
fn main() {
    found::compile();
}

#[cfg(feature = "petsc")]
mod found {
    use std::process::Command;

    /// What to do where something is missing.
    const REMEDY: &str = "the feature `petsc` needs PETSc, MPI and pkg-config. Debian: sh .ci/install-petsc; elsewhere \
        set PKG_CONFIG_PATH to the folder of PETSc.pc, and WFL_PETSC_PC and WFL_MPI_PC where the packages have other \
        names than PETSc and ompi-c (docs/scale.md)";

    /// The words of one answer of pkg-config.
    fn asked(what: &str, package: &str) -> Vec<String> {
        let answer = Command::new("pkg-config").args([what, package]).output();
        match answer {
            Ok(out) if out.status.success() => {
                String::from_utf8_lossy(&out.stdout).split_whitespace().map(str::to_owned).collect()
            }
            Ok(out) => stop(&format!("{package} was not found ({})", first_line(&out.stderr))),
            Err(error) => stop(&format!("pkg-config cannot be run ({error})")),
        }
    }

    fn first_line(text: &[u8]) -> String {
        String::from_utf8_lossy(text).lines().next().unwrap_or_default().to_owned()
    }

    /// One line, without the trace of a panic.
    fn stop(why: &str) -> ! {
        println!("cargo:warning={why}: {REMEDY}");
        std::process::exit(1);
    }

    pub(super) fn compile() {
        for file in ["shim.c", "sweeps.c", "sweeps.h", "sweeps_loops.h"] {
            println!("cargo:rerun-if-changed=src/{file}");
        }
        for name in ["PKG_CONFIG_PATH", "WFL_PETSC_PC", "WFL_MPI_PC"] {
            println!("cargo:rerun-if-env-changed={name}");
        }
        let named = |variable: &str, usual: &str| std::env::var(variable).unwrap_or_else(|_| usual.to_owned());
        // the MPI must be the one that PETSc was built with
        let packages = [named("WFL_PETSC_PC", "PETSc"), named("WFL_MPI_PC", "ompi-c")];
        let mut shim = cc::Build::new();
        shim.files(["src/shim.c", "src/sweeps.c"]).warnings_into_errors(true);
        for package in &packages {
            for flag in asked("--cflags", package) {
                if let Some(folder) = flag.strip_prefix("-I") {
                    shim.include(folder);
                }
            }
        }
        shim.compile("wfl_petsc_shim");
        for package in &packages {
            for flag in asked("--libs", package) {
                if let Some(folder) = flag.strip_prefix("-L") {
                    println!("cargo:rustc-link-search=native={folder}");
                } else if let Some(library) = flag.strip_prefix("-l") {
                    println!("cargo:rustc-link-lib=dylib={library}");
                }
            }
        }
    }
}
