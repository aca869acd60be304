//! Damaged files: meshes of every form that is read, tables of values, checkpoints and folders of results. Whatever is in
//! them, the answer is a result or a reason.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
    time::Instant,
};

use wfl_compiler::InterpreterBackend;
use wfl_discrete::point_values::PointValues;
use wfl_mesh::mesh::{Topology, cell_volumes, read::mesh_of};
use wfl_report::{Pages, RunFolder};
use wfl_run::{Progress, Quiet, RunOptions, StepResult, run};

use super::Random;
use crate::mutants::{Mutant, ready};

/// Meshes of Gmsh: forms 2.2 and 4.1, as text and binary.
const MESHES: [&[u8]; 10] = [
    include_bytes!("../../../runtime/mesh/src/mesh/read/data/disc_22b.msh"),
    include_bytes!("../../../runtime/mesh/src/mesh/read/data/disc_41a.msh"),
    include_bytes!("../../../runtime/mesh/src/mesh/read/data/hex_22a.msh"),
    include_bytes!("../../../runtime/mesh/src/mesh/read/data/hex_41b.msh"),
    include_bytes!("../../../runtime/mesh/src/mesh/read/data/line_22b.msh"),
    include_bytes!("../../../runtime/mesh/src/mesh/read/data/line_41a.msh"),
    include_bytes!("../../../runtime/mesh/src/mesh/read/data/mixed_22a.msh"),
    include_bytes!("../../../runtime/mesh/src/mesh/read/data/mixed_41b.msh"),
    include_bytes!("../../../runtime/mesh/src/mesh/read/data/tet_22b.msh"),
    include_bytes!("../../../runtime/mesh/src/mesh/read/data/tet_41a.msh"),
];

/// Values at the corners of a square.
const TABLE: &str =
    "# a table\nx, y, k, u_1, u_2\n0, 0, 1, 0, 0\n1, 0, 2, 0.5, 0\n0, 1, 3, 0, -1e-3\n1, 1, 4, nan, 2\n";

/// Heat that flows out: each step reads the one before.
const HEAT: [&str; 8] = [
    "mesh box [0,0] to [1,1] cells [2,2] quad",
    "unknown u : scalar",
    "term rate on all : (u - Previous_u)*Test_u + 0.1*(1 + u^2)*Grad_u.Grad_Test_u",
    "start u = 1 + x",
    "fix u = 0 on boundary",
    "steps t = 0 to 1 by 0.2",
    "measure heat = integral(u) on all",
    "output csv \"line\" : u along [0,0.5] to [1,0.5]",
];

/// What a file is, for the counts.
pub const KINDS: [&str; 4] = ["meshes", "tables", "checkpoints", "result folders"];

/// A folder as names and contents.
type Contents = Vec<(String, Vec<u8>)>;

/// The files that are damaged.
pub struct Files {
    /// A folder that a stopped run left.
    stopped: Contents,
    /// A folder that a whole run left.
    whole: Contents,
    /// The unknowns at the end of the whole run.
    end: Vec<u64>,
}

/// Stops a run as a signal does, in the middle of its steps.
struct Stopped;

impl Progress for Stopped {
    fn step(&mut self, number: usize, _count: Option<usize>, _time: f64) {
        assert!(number < 3, "the run is stopped here");
    }
}

fn heat() -> Mutant {
    let mut statements: Vec<String> = HEAT.map(str::to_owned).to_vec();
    statements.push("output vtk \"heat\" : u".to_owned());
    Mutant { seed: "heat".to_owned(), folder: PathBuf::new(), statements, changes: Vec::new() }
}

fn solve_in(folder: &Path, resume: bool, progress: &mut dyn Progress) -> Result<Vec<StepResult>, String> {
    let scene = ready(&heat(), &InterpreterBackend, &[]).scene.ok_or("the scene is refused")?;
    let options = RunOptions {
        out: Some(folder.to_path_buf()),
        resume,
        name: "heat".to_owned(),
        ..RunOptions::without_files(1, Instant::now())
    };
    run(&scene, &options, progress).map(|o| o.steps).map_err(|e| e.to_string())
}

fn contents(folder: &Path) -> Contents {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut list: Contents =
        entries.filter_map(|e| Some((e.file_name().into_string().ok()?, std::fs::read(e.path()).ok()?))).collect();
    list.sort();
    list
}

fn put(folder: &Path, files: &Contents) -> Result<(), String> {
    let _ = std::fs::remove_dir_all(folder);
    std::fs::create_dir_all(folder).map_err(|e| e.to_string())?;
    files.iter().try_for_each(|(name, bytes)| std::fs::write(folder.join(name), bytes)).map_err(|e| e.to_string())
}

fn bits(steps: &[StepResult]) -> Vec<u64> {
    steps.last().map(|s| s.state.iter().map(|x| x.to_bits()).collect()).unwrap_or_default()
}

impl Files {
    /// Makes the files; `folder` is for what runs write.
    ///
    /// # Errors
    /// The scene cannot be run, or it cannot be stopped.
    pub fn new(folder: &Path) -> Result<Self, String> {
        let _ = std::fs::remove_dir_all(folder);
        let ended = catch_unwind(AssertUnwindSafe(|| solve_in(folder, false, &mut Stopped)));
        if let Ok(result) = ended {
            return Err(format!("the run did not stop: {:?}", result.map(|s| s.len())));
        }
        let stopped = contents(folder);
        let _ = std::fs::remove_dir_all(folder);
        let end = bits(&solve_in(folder, false, &mut Quiet)?);
        let made = Self { stopped, whole: contents(folder), end };
        put(folder, &made.stopped)?;
        let resumed = solve_in(folder, true, &mut Quiet)?;
        if bits(&resumed) != made.end {
            return Err("a resumed run ends elsewhere".to_owned());
        }
        Ok(made)
    }

    /// Damages the file of a number and reads it: the place of its kind in [`KINDS`], and whether it was taken.
    ///
    /// # Errors
    /// A wrong answer: a damaged checkpoint that leads to another result.
    pub fn try_one(&self, number: u64, folder: &Path) -> Result<(usize, bool), String> {
        let mut random = Random(number.wrapping_mul(0xd129_8a2e_03f4_5a6b).wrapping_add(11));
        match random.below(20) {
            0..=11 => Ok((0, mesh(&damaged(MESHES[random.below(MESHES.len())], &mut random)))),
            12..=15 => Ok((1, table(&damaged(TABLE.as_bytes(), &mut random)))),
            16..=17 => self.checkpoint(&mut random, folder).map(|taken| (2, taken)),
            _ => self.results(&mut random, folder).map(|taken| (3, taken)),
        }
    }

    fn checkpoint(&self, random: &mut Random, folder: &Path) -> Result<bool, String> {
        let mut files = self.stopped.clone();
        let is_own = |name: &str| !name.ends_with(".csv") && !name.ends_with(".vtu") && !name.ends_with(".pvd");
        let own: Vec<usize> = (0..files.len()).filter(|k| is_own(&files[*k].0)).collect();
        let at = own[random.below(own.len())];
        files[at].1 = damaged(&files[at].1, random);
        put(folder, &files)?;
        match solve_in(folder, true, &mut Quiet) {
            Ok(steps) if bits(&steps) != self.end => {
                Err(format!("a damaged {} was taken: another result", files[at].0))
            }
            other => Ok(other.is_ok()),
        }
    }

    fn results(&self, random: &mut Random, folder: &Path) -> Result<bool, String> {
        let mut files = self.whole.clone();
        let at = random.below(files.len());
        files[at].1 = damaged(&files[at].1, random);
        put(folder, &files)?;
        Ok(RunFolder::read(folder).and_then(|run| Pages::new(&run, &[])).is_ok())
    }
}

fn mesh(bytes: &[u8]) -> bool {
    let Ok(mesh) = mesh_of(bytes) else { return false };
    let cells: Vec<_> = mesh.cells().collect();
    let sound = cell_volumes(&mesh, &cells).iter().all(|v| v.is_finite() && *v > 0.0);
    assert!(sound, "a mesh was taken whose cells have no volume");
    Topology::new(&mesh).is_ok()
}

fn table(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let Ok(values) = PointValues::parse(&text) else { return false };
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
    let found = values.at_nodes("k", &[String::new()], &corners, 1.0);
    assert!(found.as_ref().is_ok_and(|v| v.iter().all(|x| x.is_finite())) || found.is_err(), "no finite numbers");
    found.is_ok()
}

/// Bytes with one to four of them, or of their numbers and lines, changed.
fn damaged(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut out = bytes.to_vec();
    for _ in 0..1 + random.below(4) {
        if out.is_empty() {
            return out;
        }
        let at = random.below(out.len());
        let end = (at + 1 + random.below(16)).min(out.len());
        match random.below(9) {
            0 => out[at] ^= 1 << random.below(8),
            1 => out[at] = random.below(256) as u8,
            2 => out.truncate(at),
            3 => drop(out.drain(at..end)),
            4 => {
                let copy = out[at..end].to_vec();
                out.splice(at..at, copy);
            }
            5 => {
                let size = [4, 8][random.below(2)];
                let extremes = [0u64, 1, u64::MAX, 0x7fff_ffff, 0x7ff0_0000_0000_0000, 0x7fff_ffff_ffff_ffff];
                let number = extremes[random.below(extremes.len())].to_le_bytes();
                let end = (at + size).min(out.len());
                out[at..end].copy_from_slice(&number[..end - at]);
            }
            6 | 7 => number(&mut out, at, random),
            _ => line(&mut out, at, random),
        }
    }
    out
}

/// The number at or behind a place gives way to another one.
fn number(bytes: &mut Vec<u8>, at: usize, random: &mut Random) {
    let is_digit = |b: &u8| b.is_ascii_digit() || matches!(b, b'.' | b'e' | b'-' | b'+');
    let Some(start) = bytes[at..].iter().position(u8::is_ascii_digit).map(|k| at + k) else { return };
    let end = bytes[start..].iter().position(|b| !is_digit(b)).map_or(bytes.len(), |k| start + k);
    let new: [&[u8]; 12] = [
        b"0",
        b"-1",
        b"1e308",
        b"nan",
        b"inf",
        b"99999999999999999999",
        b"2147483648",
        b"1e-320",
        b"3",
        b"4.5",
        b"",
        b"-0",
    ];
    bytes.splice(start..end, new[random.below(new.len())].iter().copied());
}

/// The line at a place is dropped, doubled or moved to the end.
fn line(bytes: &mut Vec<u8>, at: usize, random: &mut Random) {
    let start = bytes[..at].iter().rposition(|b| *b == b'\n').map_or(0, |k| k + 1);
    let end = bytes[at..].iter().position(|b| *b == b'\n').map_or(bytes.len(), |k| at + k + 1);
    let own = bytes[start..end].to_vec();
    match random.below(3) {
        0 => drop(bytes.drain(start..end)),
        1 => drop(bytes.splice(start..start, own)),
        _ => {
            bytes.drain(start..end);
            bytes.extend(own);
        }
    }
}
