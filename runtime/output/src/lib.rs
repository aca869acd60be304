//! Results on disk: grids for viewers (VTK), tables (CSV) and the report of a run (JSON).
//!
//! Promises: plain types in, files out; a file appears under its name whole or not at all; the
//! same input gives the same bytes; a folder never shows steps of two runs as one result: its manifest says which files
//! belong to what; nothing else is replaced or removed.
//! `piece`, `line` and `locate` alone know meshes and fields: they make these types of expressions on bodies and
//! interfaces, along lines and at points. Does not know scenes or solvers, does not choose what is written or when, and reads
//! nothing back except the manifest, and of a step in parts which files it has.
#![forbid(unsafe_code)]

mod atomic;
pub mod bytes;
mod csv;
mod files;
mod grid;
mod hash;
mod identity;
mod line;
mod locate;
mod lock;
mod manifest;
mod names;
mod ordered;
mod parts;
mod piece;
mod real;
pub mod record;
mod report;
#[cfg(test)]
mod scratch;
mod sent;
mod series;
mod vtk_cell;
mod vtu;

pub use atomic::OutputDir;
pub use csv::{MEASURES_FILE, write_csv};
pub use grid::{Array, Cells, Piece, VtuError};
pub use hash::{Hash, Hasher};
pub use identity::Identity;
pub use line::LineSample;
pub use locate::Located;
pub use lock::abandon;
pub use manifest::{Kind, MANIFEST_FILE, State};
pub use names::{Names, Plan, check_name, part_name, part_of, step_name};
pub use ordered::OrderedMap;
pub use parts::sources;
pub use piece::{Item, PieceError, SampledPiece, array, split_as, vtk_cell};
pub use real::Real;
pub use report::{
    About, AttemptReport, Check, ContactCounts, EventReport, GradientReport, LeftOutReport, MeshReport, ParameterValue,
    REPORT_FILE, Report, SceneText, StepReport, Stop, Timings, peak_memory_bytes, write_report,
};
pub use series::Series;
pub use vtk_cell::{VtkCell, vtk_order};
pub use vtu::{PART, write_vtu};

use std::io;
use std::path::PathBuf;

/// Why a result could not be written. Every variant names the file or folder.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The output folder, or a part of its path, exists and is not a folder.
    #[error("`{}` cannot be an output folder: `{}` is not a folder", path.display(), obstacle.display())]
    NotADirectory {
        /// The requested folder.
        path: PathBuf,
        /// The part of the path that is in the way.
        obstacle: PathBuf,
    },
    /// The output folder does not exist and cannot be made.
    #[error("cannot make the output folder `{}`: {source}", path.display())]
    CannotCreate {
        /// The requested folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The output folder exists, but no file can be made in it.
    #[error("the output folder `{}` is not writable: {source}", path.display())]
    NotWritable {
        /// The requested folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Another process is writing into the folder.
    #[error("`{}` is being written to by {by}", path.display())]
    InUse {
        /// The requested folder.
        path: PathBuf,
        /// "process 1234".
        by: String,
    },
    /// The folder holds something else.
    #[error("`{}` holds {holds}", path.display())]
    OtherKind {
        /// The requested folder.
        path: PathBuf,
        /// What it holds, in words.
        holds: &'static str,
    },
    /// Something that this program did not write has the name of a result.
    #[error("`{}` {what}: it would be replaced", file.display())]
    Foreign {
        /// What is in the way.
        file: PathBuf,
        /// What is wrong with it.
        what: &'static str,
    },
    /// A result has the name of a file that the scene reads.
    #[error("a result would replace `{}`, which the scene reads", file.display())]
    Input {
        /// What is read.
        file: PathBuf,
    },
    /// The manifest of a folder cannot be used.
    #[error("`{}` {what}", file.display())]
    Manifest {
        /// The manifest.
        file: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// A result is not what was written.
    #[error("`{}` is damaged: {what}", file.display())]
    Damaged {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// A name that is not one plain, visible file name.
    #[error("`{}` is not a file name: {reason}", name.escape_default())]
    BadName {
        /// The name given.
        name: String,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// Writing, syncing or renaming failed; the file keeps its former content, if it had one.
    #[error("cannot write `{}`: {source}", file.display())]
    Write {
        /// The file under its final name.
        file: PathBuf,
        /// What the system said; `StorageFull` when the disc is full.
        source: io::Error,
    },
    /// A file of an earlier run could not be found or removed.
    #[error("cannot remove `{}` of an earlier run: {source}", file.display())]
    Remove {
        /// The file, or the folder if it could not be listed.
        file: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A grid that contradicts itself; nothing was written.
    #[error("cannot write `{}`: {source}", file.display())]
    Vtu {
        /// The file under its final name.
        file: PathBuf,
        /// The contradiction.
        source: VtuError,
    },
    /// The time of a step is NaN or infinite; nothing was written.
    #[error("cannot write `{}`: the time of the step is {time}", file.display())]
    Time {
        /// The file under its final name.
        file: PathBuf,
        /// The time given.
        time: f64,
    },
    /// A row of a table has not one entry for each column; nothing was written.
    #[error(
        "cannot write `{}`: row {row} has {found} entries, the table has {expected} columns",
        file.display()
    )]
    RowLength {
        /// The file under its final name.
        file: PathBuf,
        /// Row, counted from 0 below the header.
        row: usize,
        /// Number of columns.
        expected: usize,
        /// Number of entries of the row.
        found: usize,
    },
}
