//! The command line.

use std::{num::NonZeroUsize, path::PathBuf};

use clap::{Args as ClapArgs, Parser, Subcommand, ValueEnum};
use wfl_discrete::pruning::Pruning;
use wfl_problem::demand::{LARGEST, SMALLEST, is_accuracy};
use wfl_sparse::solve::Precision;

use crate::{
    args_gradient::GradientArgs,
    args_mesh::{MESH_HELP, MeshArgs},
    args_plot::{PLOT_HELP, PlotArgs},
    solvers::Solvers,
};

/// Write, check and solve contact formulations from text files.
#[derive(Debug, Parser)]
#[command(name = "wfl", version, arg_required_else_help = true, after_help = EXIT_CODES)]
pub(crate) struct Args {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Memory limit, such as 4GB [default: the memory of the machine]
    #[arg(long, global = true, value_name = "SIZE", value_parser = memory)]
    pub(crate) memory: Option<u64>,
    /// A further folder that scenes may read; by default a scene reads its own folder and below (E217)
    #[arg(long, global = true, value_name = "DIR")]
    pub(crate) allow_read: Vec<PathBuf>,
}

const EXIT_CODES: &str = "\
Exit codes:
  0  done
  1  an error: the command line, the scene, a file, a singular system; `fmt --check`: a file is not formatted;
     `verify`: a tangent or a derivative is wrong
  2  `run`: a step did not converge; `sweep`: a run has no solution
  3  `run`, `sweep`: an expectation of the scene does not hold
  4  `run`: the accuracy wanted was not reached

Start with:
  wfl check examples/fault/nitsche.wfl
  wfl run examples/fault/nitsche.wfl";

/// What to do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Solve a scene and write its results to out/<scene>/
    #[command(after_help = RUN_HELP)]
    Run(RunArgs),
    /// Write a page about a finished run: maps, profiles, convergence, time
    #[command(after_help = REPORT_HELP)]
    Report(ReportArgs),
    /// Draw a field of a run: the deformed bodies, a cut, a profile, the state of contact, as PNG or SVG
    #[command(after_help = PLOT_HELP)]
    Plot(Box<PlotArgs>),
    /// Tell what a mesh file holds: cells, regions and their sizes, quality, contact pairs of a deck; draw it
    #[command(after_help = MESH_HELP)]
    Mesh(MeshArgs),
    /// Check a scene without solving it: mesh, fields, terms, linear solver
    #[command(after_help = CHECK_HELP)]
    Check(CheckArgs),
    /// Multiply and divide each parameter by 1e3 and 1e6 in turn: which values are solved, which are refused, and why
    #[command(after_help = EXTREMES_HELP)]
    Extremes(ExtremesArgs),
    /// Show a stage of the compiler
    #[command(after_help = SHOW_HELP)]
    Show(ShowArgs),
    /// Compare each tangent with high-precision differences of its residual, and test contact terms with bodies of
    /// constant stress
    #[command(after_help = VERIFY_HELP)]
    Verify(VerifyArgs),
    /// Explain a message with an example, a statement, a function, or a macro of the library
    #[command(after_help = "Example:\n  wfl explain E103\n  wfl explain --list")]
    Explain(ExplainArgs),
    /// Write files in canonical form; comments and meaning do not change
    #[command(
        after_help = "Examples:\n  wfl fmt scene.wfl\n  wfl fmt --check examples/fault/*.wfl    # exit code 1 if a file would change"
    )]
    Fmt(FmtArgs),
    /// Run scenes for lists of settings: errors and costs in one table
    #[command(after_help = SWEEP_HELP)]
    Sweep(SweepArgs),
    /// Turn an assembly string of a GetFEM script into statements of a scene
    #[command(after_help = IMPORT_HELP)]
    Import(ImportArgs),
    /// Write a commented scene to start from
    #[command(after_help = NEW_HELP)]
    New(NewArgs),
    /// Serve an editor by the language server protocol on standard input and output (a build with the feature `lsp`)
    Lsp(LspArgs),
    /// Write completions for a shell to standard output (a build with the feature `lsp`)
    #[command(after_help = "Example:\n  wfl completions bash > ~/.local/share/bash-completion/completions/wfl")]
    Completions(CompletionsArgs),
    /// Write a man page to standard output (a build with the feature `lsp`)
    #[command(after_help = "Examples:\n  wfl man > wfl.1\n  wfl man run > wfl-run.1")]
    Man(ManArgs),
}

const RUN_HELP: &str = "\
Results: .pvd with one .vtu a step, CSV files as the scene says, report.json.
Exit codes: 0 done, 1 error, 2 a step did not converge, 3 an `expect` of the scene does not hold, 4 the accuracy
wanted was not reached.

Examples:
  wfl run examples/fault/nitsche.wfl
  wfl run examples/fault/nitsche.wfl --accuracy 1e-2
  wfl run examples/crack/compression.wfl --accuracy 1e-3 --of slip
  wfl run examples/fault/nitsche.wfl theta=-1 gamma=1e6 --out results -v
  wfl run examples/fault/nitsche.wfl --gradient \"Fn, max_slip\" --with E, fric";

const EXTREMES_HELP: &str = "\
Nothing is written but the table. Values outside the declared range of a parameter are reported and
not run. Each row has the outcome of one value: solved, solved with a warning or against an `expect` of the scene (with
its measures), refused with a message, not converged, or out of time.
Exit codes: 0 every value was solved, 1 error, or a run with a wrong solution, 2 a value was refused, did not
converge or was out of time.

Examples:
  wfl extremes examples/fault/nitsche.wfl --out extremes.csv
  wfl extremes examples/crack/compression.wfl --limit 30";

const REPORT_HELP: &str = "\
The page is OUT/report.html, one file that needs nothing else: open it in any browser, also on a phone.
Maps and profiles show the fields that `output vtk` and `output csv` of the scene wrote.

Examples:
  wfl report out/nitsche
  wfl report out/nitsche --at 2,5,9.5 --plots";

const CHECK_HELP: &str = "\
Examples:
  wfl check examples/fault/nitsche.wfl
  wfl check examples/fault/nitsche.wfl theta=1 --json | jq '.terms[].class'";

const SHOW_HELP: &str = "\
Examples:
  wfl show examples/fault/nitsche.wfl tangent --term contact
  wfl show examples/fault/nitsche.wfl kinks";

const VERIFY_HELP: &str = "\
The test states are random, of every magnitude, and close to each kink on both sides. Differences are computed with 31
digits, so a deviation above 1e-7 of a block is an error of the tangent; the exit code is then 1. Machine code and
interpreter are compared bit by bit at the same states. Contact terms are tested with bodies of constant stress
(docs/language.md): the table has their residuals, and the exit code is 1 if they do not balance that stress.

With --gradient derivatives of results are compared with differences of whole runs, four for each parameter; the exit code
is 1 where one agrees with neither side.

Examples:
  wfl verify examples/fault/nitsche.wfl --samples 200
  wfl verify examples/friction/weakening.wfl --gradient tip --with mu";

const SWEEP_HELP: &str = "\
A knob is a parameter of the scenes, or one of
  h=0.5,0.25         size of the cells of a `mesh box`
  refine=1/2,1,2     factor on the number of cells in each direction
  cells=8,[8,16]     the number of cells in each direction
  degree=1,2         degree of the unknowns on cells
  perturb=1e-6       equilibria that are not stable are left for the branch that buckles
  marks=REPORT.json  refinement of the mesh, from the report of a run with --accuracy
  substeps=1,2       parts of each step; where the run chooses the steps, their error is divided by the square
  quadrature=vertex,2,4   quadrature rule of the terms with kinks
  tol=1e-4,1e-8  max_iter=20  search=none  threads=1,2
  precision=f64,f32+f64   of the factors of contact matrix and bulk
  solver=auto,condensed,full   auto: one contact force a pair of dofs; condensed: Schur complement on the contact dofs;
                               full: the whole tangent
  no_prune=nothing,constant,linear,condense,forces,symmetric,quadrature,past   optimisations that are turned off
Lists: a,b,c; a..b:log5 and a..b:lin5 have five values with both ends. Several scenes are several methods.
Of h and cells one is taken, in place of parameters that divide the mesh. The table has the status of each run.
Exit codes: 0 every run was solved, 1 error, 2 a run failed, did not converge or has a number that is not finite, 3 an
`expect` of the scene does not hold for a run.
Results in DIR: sweep.csv with a row for each setting, failed ones included; sweep.html and an SVG file for each plot,
made from this table. Rows that are already in the table are not run again.

Examples:
  wfl sweep examples/fault/nitsche.wfl examples/fault/penalty.wfl refine=0.5,1 gamma=1e4..1e6:log3 --out trade
  wfl sweep examples/signorini/signorini.wfl n=8,16,32 degree=1,2 --reference exact";

const IMPORT_HELP: &str = "\
Declarations that are not in the string (unknowns, parameters) are guessed and marked: check each of them.
Transformations, multipliers and UFL names cannot be guessed and are refused. The result compiles.

Examples:
  wfl import \"(2*mu*Sym(Grad_u) + lambda*Trace(Grad_u)*Id(3)):Grad_Test_u\"
  wfl import \"pos_part(g*u.Normal)*Test_u.Normal\" --on wall";

const NEW_HELP: &str = "\
A file that is there already is never overwritten. Without a kind: all kinds, a line each.

Examples:
  wfl new signorini
  wfl new fault my_fault.wfl";

/// A scene with parameter values.
#[derive(Debug, ClapArgs)]
pub(crate) struct SceneArgs {
    /// The scene, a .wfl file
    pub(crate) scene: PathBuf,
    /// Parameters to replace: gamma=1e6 theta=-1; for wfl run, check and verify also knobs of a sweep: refine=2
    /// cells=[4,8] h=0.1 degree=2 tol=1e-6, or perturb=1e-6: unstable equilibria are left for the branch that buckles
    #[arg(value_name = "NAME=VALUE")]
    pub(crate) overrides: Vec<String>,
}

fn pruning(name: &str) -> Result<Pruning, String> {
    let known = || Pruning::ALL.map(Pruning::name).join(", ");
    Pruning::named(name).ok_or_else(|| format!("no optimisation has that name; known: {}", known()))
}

fn precision(name: &str) -> Result<Precision, String> {
    let known = || Precision::NAMES.map(|(name, _)| name).join(", ");
    Precision::named(name).ok_or_else(|| format!("a precision is one of {}", known()))
}

fn accuracy(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|e| is_accuracy(*e))
        .ok_or_else(|| format!("an accuracy is a relative error from {SMALLEST:e} to {LARGEST}, such as 1e-3"))
}

fn memory(text: &str) -> Result<u64, String> {
    use wfl_host::memory::{PROGRAM, parse, shown};
    let size = parse(text).ok_or_else(|| "a size with its unit, such as 500MB, 4GB or 4GiB".to_owned())?;
    if size < PROGRAM {
        return Err(format!("the program alone takes about {}", shown(PROGRAM)));
    }
    Ok(size)
}

fn seconds(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|s: &f64| *s > 0.0 && s.is_finite()).ok_or_else(|| "seconds above 0".to_owned())
}

/// How a scene is run.
#[derive(Debug, ClapArgs)]
pub(crate) struct RunArgs {
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    /// Directory of the results [default: out/<scene>]
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Continue an interrupted run; the interrupted step and the last 0.1 s (on a slow disc twenty times the duration
    /// of a checkpoint) may be repeated
    #[arg(long)]
    pub(crate) resume: bool,
    #[command(flatten)]
    pub(crate) gradient: GradientArgs,
    /// The limit of the whole command, in bytes.
    #[arg(skip)]
    pub(crate) memory: Option<u64>,
    /// Demanded relative error, such as 1e-3: refines the mesh and selects degree, tolerance and penalty
    #[arg(long, value_name = "ERROR", value_parser = accuracy, conflicts_with = "resume")]
    pub(crate) accuracy: Option<f64>,
    /// Quantity of the accuracy: L2 or H1 of the unknowns, an output on contact faces, a measure [default: L2]
    #[arg(long, value_name = "QUANTITY")]
    pub(crate) of: Option<String>,
    /// Time limit of the search for the demanded accuracy, in seconds; the best run by then is the result [default: 600]
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub(crate) budget: Option<f64>,
    /// Begin the search for the demanded accuracy with the coarsest mesh that has the regions of the scene, not with its own
    #[arg(long)]
    pub(crate) coarsest: bool,
    /// Treat a Nitsche parameter below its coercivity bound (W503) as an error
    #[arg(long)]
    pub(crate) strict: bool,
    /// Threads of assembly and solver, 1 or more [default: all]
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<NonZeroUsize>,
    /// Precision of the factors of contact matrix and bulk: f64, f32+f64 (factors in single, residuals in double
    /// precision) or auto
    #[arg(long, value_name = "NAME", value_parser = precision, default_value = "auto")]
    pub(crate) precision: Precision,
    /// Linear solvers: those of this program, or those of PETSc: as the scene suits, a factor (MUMPS), or multigrid
    /// (docs/scale.md)
    #[arg(long, value_name = "NAME", value_enum, default_value = "own")]
    pub(crate) backend: Solvers,
    /// With PETSc on several ranks: the same bits in every run on as many of them; factors are made whole on each rank, and
    /// levels of multigrid take three to five times as long
    #[arg(long)]
    pub(crate) repeatable: bool,
    /// With PETSc on several ranks: each holds the whole mesh, also where it could hold a part of it (docs/scale.md)
    #[arg(long)]
    pub(crate) whole_mesh: bool,
    /// Most Newton iterations of an attempt, in place of the value of the scene; path following may pass 450 changes of
    /// the active set in addition, and contact that gets stiffer 60 iterations
    #[arg(long, value_name = "N")]
    pub(crate) max_iter: Option<NonZeroUsize>,
    /// Turn an optimisation off, to measure its effect; wfl check lists the names
    #[arg(long, value_name = "NAME", value_parser = pruning)]
    pub(crate) no_prune: Vec<Pruning>,
    /// Measure the effect of each optimisation first, with two more solves for each; for the report
    #[arg(long, conflicts_with_all = ["no_prune", "accuracy"])]
    pub(crate) savings: bool,
    /// Write a page about the run that loads itself again: measures, contact, residuals, time left [default: watch.html]
    #[arg(long, value_name = "FILE", num_args = 0..=1, require_equals = true, default_missing_value = "watch.html", conflicts_with = "accuracy")]
    pub(crate) watch: Option<PathBuf>,
    /// Print errors and warnings only, and no advice on the text (W7)
    #[arg(short, long, conflicts_with = "verbose")]
    pub(crate) quiet: bool,
    /// Print every iteration
    #[arg(short, long)]
    pub(crate) verbose: bool,
    /// Run the point laws in the reference interpreter instead of machine code
    #[arg(long)]
    pub(crate) interpret: bool,
}

/// What is swept.
#[derive(Clone, Debug, ClapArgs)]
pub(crate) struct SweepArgs {
    /// Scenes, .wfl files, and knobs with their values: gamma=1e4,1e6 h=0.5,0.25
    #[arg(value_name = "SCENE|KNOB=LIST")]
    pub(crate) words: Vec<String>,
    /// Reference of the errors: `auto` (finer runs, of another scene if there are several), `exact` (`def exact` in
    /// the scene), `none`, or a reference_1.json of another sweep
    #[arg(long, value_name = "auto|exact|none|FILE", default_value = "auto")]
    pub(crate) reference: String,
    /// A knob of the reference run, in place of the choice of `auto`: refine=2
    #[arg(long, value_name = "KNOB=VALUE")]
    pub(crate) reference_knob: Vec<String>,
    /// Number of runs of each setting; the table has median, smallest and largest time
    #[arg(long, value_name = "N", default_value = "1")]
    pub(crate) repeat: NonZeroUsize,
    /// Number of concurrent runs, each on one thread; the table then has errors, iterations and unknowns, but no times
    #[arg(long, value_name = "N", conflicts_with_all = ["repeat", "study", "plot"])]
    pub(crate) jobs: Option<NonZeroUsize>,
    /// Run nothing: write sweep.html and the plots again from the tables in the given folders
    #[arg(long)]
    pub(crate) plot: bool,
    /// Run the study of the examples, from the root of the repository, and write DIR/trade.md with its figures
    #[arg(long, value_name = "DIR", conflicts_with_all = ["words", "plot"])]
    pub(crate) study: Option<PathBuf>,
    /// Folder of table, page and plots
    #[arg(short, long, value_name = "DIR", default_value = "out/sweep")]
    pub(crate) out: PathBuf,
    /// Threads of assembly and solver, 1 or more [default: all]
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<NonZeroUsize>,
    /// Print errors only
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

/// How a scene is driven to its extremes.
#[derive(Debug, ClapArgs)]
pub(crate) struct ExtremesArgs {
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    /// Write the table to this file as comma-separated values
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Time limit of each value in seconds [default: three times the time of the scene as written, at least 10]
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub(crate) limit: Option<f64>,
}

/// What a page shows.
#[derive(Debug, ClapArgs)]
pub(crate) struct ReportArgs {
    /// The folder that `wfl run` wrote
    #[arg(value_name = "OUT")]
    pub(crate) folder: PathBuf,
    /// Steps of maps and profiles, by the value of the step variable [default: first, middle, last]
    #[arg(long, value_name = "T,T", value_delimiter = ',', allow_negative_numbers = true)]
    pub(crate) at: Vec<f64>,
    /// Also write each chart as an SVG file to OUT/plots
    #[arg(long)]
    pub(crate) plots: bool,
}

/// How a scene is checked.
#[derive(Debug, ClapArgs)]
pub(crate) struct CheckArgs {
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    /// Print all tables: sizes of regions with their statements, rules and classes of terms, parameters, Newton's schedule
    #[arg(long)]
    pub(crate) all: bool,
    /// Print JSON: the same tables, each a list of objects
    #[arg(long)]
    pub(crate) json: bool,
    /// Linear solvers that the table `system` is about
    #[arg(long, value_name = "NAME", value_enum, default_value = "own")]
    pub(crate) backend: Solvers,
}

/// What is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum View {
    /// The statements as they were read, expressions as trees
    Ast,
    /// The typed tensor graph of each term
    Graph,
    /// Energy, residual and tangent of each term as formulas
    Tangent,
    /// The instructions of the point laws
    Ir,
    /// The input of the code generator
    Clif,
    /// The terms, one a line
    Terms,
    /// The kinks of each term, with the generalised derivative used there
    Kinks,
}

/// What to show of a scene.
#[derive(Debug, ClapArgs)]
pub(crate) struct ShowArgs {
    /// The scene, a .wfl file
    pub(crate) scene: PathBuf,
    /// What to show
    pub(crate) view: View,
    /// Parameters to replace: gamma=1e6 theta=-1
    #[arg(value_name = "NAME=VALUE")]
    pub(crate) overrides: Vec<String>,
    /// Only this term
    #[arg(long, value_name = "NAME")]
    pub(crate) term: Option<String>,
}

/// How tangents are verified.
#[derive(Debug, ClapArgs)]
pub(crate) struct VerifyArgs {
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    #[command(flatten)]
    pub(crate) gradient: GradientArgs,
    /// Random states a term; those beside kinks come on top
    #[arg(long, value_name = "N", default_value = "100")]
    pub(crate) samples: NonZeroUsize,
    /// Start of the random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
}

/// Which code is explained.
#[derive(Debug, ClapArgs)]
#[command(arg_required_else_help = true)]
pub(crate) struct ExplainArgs {
    /// The code of a message, such as E103, a statement, such as steps, the name of a function, such as
    /// Ball_projection, or a macro of the library, such as nitsche
    #[arg(required_unless_present_any = ["list", "functions"])]
    pub(crate) code: Option<String>,
    /// All codes, a line each
    #[arg(long)]
    pub(crate) list: bool,
    /// All functions as a table in Markdown
    #[arg(long)]
    pub(crate) functions: bool,
}

/// Which files are formatted.
#[derive(Debug, ClapArgs)]
pub(crate) struct FmtArgs {
    /// Files to write in canonical form
    #[arg(required = true)]
    pub(crate) files: Vec<PathBuf>,
    /// Change nothing; name the files that would change
    #[arg(long)]
    pub(crate) check: bool,
}

/// What is imported.
#[derive(Debug, ClapArgs)]
pub(crate) struct ImportArgs {
    /// The assembly string; it may begin with a minus
    #[arg(allow_hyphen_values = true)]
    pub(crate) text: String,
    /// The region the term stands on [default: all; boundary with Normal, interior with neighbor_element]
    #[arg(long, value_name = "REGION")]
    pub(crate) on: Option<String>,
}

/// What scene is written.
#[derive(Debug, ClapArgs)]
pub(crate) struct NewArgs {
    /// What it is about: poisson, heat, signorini, hertz, fault, crack, ... [default: list them]
    pub(crate) kind: Option<String>,
    /// The file that is written [default: KIND.wfl]
    pub(crate) file: Option<PathBuf>,
}

/// How an editor is served.
#[derive(Debug, ClapArgs)]
pub(crate) struct LspArgs {
    /// Standard input and output
    #[arg(long)]
    pub(crate) stdio: bool,
}

/// Whose page is written.
#[derive(Debug, ClapArgs)]
pub(crate) struct ManArgs {
    /// A command of the program, such as run [default: the program itself, with the list of commands]
    pub(crate) command: Option<String>,
}

/// Shells with completions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ShellName {
    Bash,
    Elvish,
    Fish,
    Powershell,
    Zsh,
}

/// For which shell.
#[derive(Debug, ClapArgs)]
pub(crate) struct CompletionsArgs {
    /// The shell
    pub(crate) shell: ShellName,
}
