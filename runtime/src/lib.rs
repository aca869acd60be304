//! Meshes, spaces, assembly, solvers and output for WFL scenes.
//!
//! The door: [`prepare`] makes a problem of a resolved script with a kernel backend of the caller,
//! [`run`] solves it. The whole runtime also works on the reference interpreter.
#![forbid(unsafe_code)]

pub use wfl_checks::{self as checks, consistency};
pub use wfl_contact as contact;
pub use wfl_discrete::{
    assemble, damping, domain, field, finite, frames, longest_step, lumped, point_space, point_values, pruning, rates,
    redistribution, share, space, system,
};
pub use wfl_gradient as gradient;
pub use wfl_host::{input, memory, reading, team};
pub use wfl_mesh::{element, mesh, quadrature, refine};
pub use wfl_newton as newton;
pub use wfl_output as output;
pub use wfl_sparse::{csr, solve};

pub use checks::{
    Accuracy, CoarseLoad, CubicBody, DrivenSides, Hourglass, LockedBody, LooseMotions, NegativeBody, Others,
    PhysicsCheck, ReversedGap, Turning, TurningBody, UnbalancedLoad,
};
pub use newton::{LinearSolver, Singular};
pub use pruning::{Pruning, Saving};
pub use solve::SolverMemory;
pub use system::{
    ActiveSet, Branches, FIXED, Form, FrozenTerm, Known, LinearTerms, Numbering, Past, Residual, StateValues, System,
    SystemError, Tangent,
};
pub use wfl_adapt::{SavingError, compare, knobs, savings};
pub use wfl_discrete::{
    value::{Sampled, Value, uniforms_at},
    window::Window,
};
pub use wfl_problem::{
    Auto, Between, Bodies, Cadence, CallerValues, CsvOutput, DEFAULT_STEP_ERROR, Energy, Equations, EventRule, Every,
    Explicit, Forcing, FromWhole, GiveError, Given, InputFile, LeftOut, Measure, Measured, NO_SAMPLING, NamedRegion,
    ON_ANY_CELLS, OpenRim, Over, PrepareTimes, Prepared, Prescribed, Printed, Refined, Regions, RimOfField, RuleChoice,
    SampleAt, Samples, Sampling, Scene, SceneBox, ScenePart, Sketch, Solving, Source, StateAt, StateUpdate, StepPlace,
    Steps, TermSummary, VtkOutput, messages_without_mesh, parts, place_of_moving, prepare, prepare_keeping,
    prepare_part, prepare_refined, prepare_sampled, region_name, without_auto,
};
pub use wfl_run::{
    Attempt, AttemptEnd, CHECKPOINT_FILE, CheckpointError, Episode, FRUITLESS, Holders, KeptStep, KeptTable, Memory,
    Outcome, Passed, PassedStep, Path, Progress, Quiet, RunError, RunOptions, RunState, Session, Standing, StepResult,
    Trajectory, finished, may_begin, run, save,
};

/// From the state to result files: which expression is sampled where, and the fields of a scene on the bodies.
pub mod results {
    pub use wfl_output::{Item, LineSample, Located, SampledPiece, vtk_cell};
    pub use wfl_run::{field_cells, field_grid, field_grids};
}

/// A demanded accuracy.
pub mod accuracy {
    pub use wfl_adapt::accuracy::*;
    pub use wfl_output::record::*;
    pub use wfl_problem::demand::*;
}
