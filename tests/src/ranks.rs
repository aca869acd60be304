//! Scenes on ranks that are threads of this process, each with the whole mesh or with a part of it, and a solver for them.
//!
//! The solver brings the equations of all ranks together and factors them on each: for tests of what is around it.

use std::{path::Path, sync::Arc, time::Instant};

use wfl::ResolvedScript;
use wfl_host::team::{Alone, Team, in_threads};
use wfl_jit::JitBackend;
use wfl_mesh::mesh::Part;
use wfl_problem::{Scene, ScenePart, prepare, prepare_part};
use wfl_run::{Outcome, Quiet, RunError, RunOptions, run};
use wfl_sparse::{
    csr::Csr,
    solve::{CheckedLu, Engine, Equations, Library, LinearSolver, Linked, SolveError, SolverOptions, Symmetry, Traits},
};

use super::{examples, script_and_messages};

/// Who has the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Holding {
    /// Every rank has all of it.
    Whole,
    /// Each has a part.
    Parts,
}

/// A scene that ranks prepare.
pub struct Shared {
    script: ResolvedScript,
    folder: std::path::PathBuf,
}

impl Shared {
    /// An example; `edits` are replaced in its files.
    ///
    /// # Panics
    /// If it is none.
    #[must_use]
    pub fn example(path: &str, edits: &[(&str, String)]) -> Self {
        let file = examples().join(path);
        let text = std::fs::read_to_string(&file).expect("an example");
        Self::text(file.parent().expect("a folder"), text, edits)
    }

    /// A scene from its text.
    ///
    /// # Panics
    /// If it has errors.
    #[must_use]
    pub fn text(folder: &Path, text: String, edits: &[(&str, String)]) -> Self {
        let (script, _, messages) = script_and_messages(folder, text, edits, &[]);
        Self { script: script.unwrap_or_else(|| panic!("{messages}")), folder: folder.to_path_buf() }
    }

    /// The scene of one rank alone.
    ///
    /// # Panics
    /// If it has errors.
    #[must_use]
    pub fn whole(&self) -> Scene {
        let backend = JitBackend::new().expect("machine code on this processor");
        let made = prepare(&self.script, &self.folder, &backend);
        made.scene.unwrap_or_else(|| panic!("{:?}", made.diagnostics))
    }

    /// What each of some ranks makes of its scene.
    ///
    /// # Panics
    /// If a rank does.
    pub fn on_ranks<T: Send>(&self, ranks: usize, holding: Holding, work: impl Fn(Scene) -> T + Sync) -> Vec<T> {
        let (whole, work) = (self.whole(), &work);
        let part = Part::of_whole(in_threads(ranks).swap_remove(0), &whole.system.mesh);
        let bytes = |rank: usize| (holding == Holding::Parts).then(|| whole.part_of(&part, rank));
        let bytes: Vec<Option<Vec<u8>>> = (0..ranks).map(bytes).collect();
        std::thread::scope(|scope| {
            let each = in_threads(ranks).into_iter().zip(bytes).map(|(team, bytes)| {
                scope.spawn(move || {
                    let scene = match bytes {
                        Some(bytes) => self.of_part(&bytes, team),
                        None => {
                            let mut scene = self.whole();
                            scene.share_rows(team);
                            scene
                        }
                    };
                    work(scene)
                })
            });
            let each: Vec<_> = each.collect();
            each.into_iter().map(|rank| rank.join().expect("a rank ends")).collect()
        })
    }

    fn of_part(&self, bytes: &[u8], team: Arc<dyn Team>) -> Scene {
        let backend = JitBackend::new().expect("machine code on this processor");
        let part = ScenePart::from_bytes(bytes).expect("a part as it was written");
        let made = prepare_part(&self.script, &self.folder, &backend, &[], part, team);
        made.scene.unwrap_or_else(|| panic!("{:?}", made.diagnostics))
    }
}

/// Solves a scene of a rank with [`Gathered`].
///
/// # Panics
/// If the run ends with an error.
#[must_use]
pub fn solved(scene: Scene) -> Outcome {
    run_with_gathered(scene).unwrap_or_else(|error| panic!("{error}"))
}

/// The same, with the error of the run.
///
/// # Errors
/// That of the run.
pub fn run_with_gathered(scene: Scene) -> Result<Outcome, RunError> {
    let options = RunOptions { library: Some(Linked(&Gathered)), ..RunOptions::without_files(1, Instant::now()) };
    run(&scene, &options, &mut Quiet)
}

/// Solves a scene of a rank, and keeps what its outputs hold at some steps.
///
/// # Panics
/// If the run ends with an error.
#[must_use]
pub fn solved_keeping(scene: Scene, keep_outputs: Vec<usize>) -> Outcome {
    let usual = RunOptions::without_files(1, Instant::now());
    let options = RunOptions { library: Some(Linked(&Gathered)), keep_outputs, ..usual };
    run(&scene, &options, &mut Quiet).unwrap_or_else(|error| panic!("{error}"))
}

/// A library that factors the equations of all ranks on each of them.
pub struct Gathered;

struct Factor {
    equations: Arc<Equations>,
    lu: Option<CheckedLu>,
}

impl Library for Gathered {
    fn name(&self) -> &'static str {
        "gathered"
    }

    fn plan(&self, _traits: &Traits) -> String {
        "a factor of all rows on each rank".to_owned()
    }

    fn engine(&self, equations: &Arc<Equations>, _: Symmetry) -> Result<Box<dyn Engine + Send>, SolveError> {
        Ok(Box::new(Factor { equations: Arc::clone(equations), lu: None }))
    }
}

impl Factor {
    fn team(&self) -> &dyn Team {
        self.equations.owners.as_ref().map_or(&Alone, |owners| &*owners.team)
    }

    fn owns(&self, row: usize) -> bool {
        self.equations.owners.as_ref().is_none_or(|owners| owners.owns(row))
    }

    fn number(&self, row: usize) -> u32 {
        let number = self.equations.owners.as_ref().map_or(row as u64, |owners| owners.number(row));
        u32::try_from(number).expect("few unknowns")
    }
}

impl Engine for Factor {
    fn take(&mut self, changing: &Csr) -> Result<(), SolveError> {
        let mut words: Vec<u8> = Vec::new();
        for part in [&*self.equations.constant, changing] {
            for row in (0..part.n_rows()).filter(|row| self.owns(*row)) {
                let (columns, values) = part.row(row);
                for (column, value) in columns.iter().zip(values) {
                    words.extend(self.number(row).to_le_bytes());
                    words.extend(self.number(*column as usize).to_le_bytes());
                    words.extend(value.to_le_bytes());
                }
            }
        }
        let all = self.team().gather(&words).concat();
        let of = |bytes: &[u8]| {
            let word = |k: usize| u32::from_le_bytes(bytes[k..k + 4].try_into().expect("four bytes"));
            (word(0), word(4), f64::from_le_bytes(bytes[8..].try_into().expect("eight bytes")))
        };
        let entries: Vec<(u32, u32, f64)> = all.chunks_exact(16).map(of).collect();
        let n = self.equations.traits.unknowns;
        let matrix = Csr::from_triplets(n, n, &entries).expect("fits");
        let mut lu = CheckedLu::new(matrix.pattern(), None, SolverOptions::default())?;
        lu.factor(&matrix)?;
        self.lu = Some(lu);
        Ok(())
    }

    fn solve(&mut self, _changing: &Csr, rhs: &[f64], x: &mut [f64], _tolerance: f64) -> Result<usize, SolveError> {
        let n = self.equations.traits.unknowns;
        let (mut all, mut found) = (vec![0.0; n], vec![0.0; n]);
        for row in (0..rhs.len()).filter(|row| self.owns(*row)) {
            all[self.number(row) as usize] = rhs[row];
        }
        self.team().sum(&mut all);
        self.lu.as_mut().expect("a matrix before").solve(&all, &mut found)?;
        for (row, x) in x.iter_mut().enumerate() {
            *x = found[self.number(row) as usize];
        }
        Ok(0)
    }

    fn restart(&mut self) {}

    fn describe(&self) -> String {
        "a factor of all rows on each rank".to_owned()
    }
}
