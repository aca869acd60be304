//! The command line.

use std::{num::NonZeroUsize, path::PathBuf};

use clap::{Args as ClapArgs, Parser, Subcommand, ValueEnum};
use wfl_runtime::{
    Pruning,
    accuracy::{LARGEST, SMALLEST, is_accuracy},
    solve::Precision,
};

/// Write, check and solve contact formulations from text files.
#[derive(Debug, Parser)]
#[command(name = "wfl", version, about, arg_required_else_help = true, after_help = EXIT_CODES)]
pub(crate) struct Args {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Most memory that may be taken, such as 4GB [default: that of the machine]
    #[arg(long, global = true, value_name = "SIZE", value_parser = memory)]
    pub(crate) memory: Option<u64>,
    /// A folder that scenes may read from, too; else a scene reads its own folder and below (E217)
    #[arg(long, global = true, value_name = "DIR")]
    pub(crate) allow_read: Vec<PathBuf>,
}

const EXIT_CODES: &str = "\
Exit codes:
  0  done
  1  an error: the command line, the scene, a file, a singular system; `fmt --check`: a file is not formatted;
     `verify`: a tangent is wrong
  2  `run`: a step did not converge
  3  `run`: an expectation of the scene does not hold
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
    /// A page about a run that has ended: maps, profiles, convergence, time
    #[command(after_help = REPORT_HELP)]
    Report(ReportArgs),
    /// Everything but solving: mesh, fields, terms, and the solver that follows
    #[command(after_help = CHECK_HELP)]
    Check(CheckArgs),
    /// Each parameter times and divided by 1e3 and 1e6 in turn: what is solved, what is refused, and why
    #[command(after_help = EXTREMES_HELP)]
    Extremes(ExtremesArgs),
    /// What the compiler makes of a scene
    #[command(after_help = SHOW_HELP)]
    Show(ShowArgs),
    /// Compare each term's tangent with high-precision differences of its residual, and try contact with bodies of constant
    /// stress
    #[command(after_help = VERIFY_HELP)]
    Verify(VerifyArgs),
    /// What the code of a message means, with an example; what a function does
    #[command(after_help = "Example:\n  wfl explain E103\n  wfl explain --list")]
    Explain(ExplainArgs),
    /// Write files in their canonical form: comments and meaning are kept
    #[command(
        after_help = "Examples:\n  wfl fmt scene.wfl\n  wfl fmt --check examples/fault/*.wfl    # exit code 1 if a file would change"
    )]
    Fmt(FmtArgs),
    /// Run scenes over lists of settings: errors and costs in one table
    #[command(after_help = SWEEP_HELP)]
    Sweep(SweepArgs),
    /// Turn an assembly string of a GetFEM script into statements of a scene
    #[command(after_help = IMPORT_HELP)]
    Import(ImportArgs),
}

const RUN_HELP: &str = "\
Results: .pvd with one .vtu a step, CSV files as the scene says, report.json.
Exit codes: 0 done, 1 error, 2 a step did not converge, 3 an `expect` of the scene does not hold, 4 the accuracy
wanted was not reached.

Examples:
  wfl run examples/fault/nitsche.wfl
  wfl run examples/fault/nitsche.wfl --accuracy 1e-2
  wfl run examples/crack/compression.wfl --accuracy 1e-3 --of slip
  wfl run examples/fault/nitsche.wfl theta=-1 gamma=1e6 --out results -v";

const EXTREMES_HELP: &str = "\
Nothing is written but the table. Values outside the range that the scene declares for a parameter are told and not
tried. A row says what became of a value: solved, solved with a warning or not as an `expect` of the scene wants it (with
what its measures are), refused with which message, not converged, or out of time.
Exit codes: 0 every value was solved, 1 error, or a run claims a solution that is none, 2 a value was refused, did not
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
States are random: of every size, and close to each kink on both of its sides. Differences are taken in 31 digits, so
that an error above 1e-7 of a block is an error of the tangent; the exit code is then 1. Machine code and interpreter
are compared bit by bit at the same states. Terms of contact are tried with bodies of constant stress (docs/language.md):
what they leave of the balance of forces, and the exit code 1 where they do not carry that stress.

Example:
  wfl verify examples/fault/nitsche.wfl --samples 200";

const SWEEP_HELP: &str = "\
A knob is a parameter of the scenes, or one of
  h=0.5,0.25         size of the cells of a `mesh box`
  refine=1/2,1,2     factor on the number of cells in each direction
  cells=8,[8,16]     the number of cells in each direction
  degree=1,2         degree of the unknowns on cells
  quadrature=vertex,2,4   rule of the terms with kinks
  tol=1e-4,1e-8  max_iter=20  search=none  threads=1,2
  precision=f64,f32+f64   of the factors of contact forces and bulk
  solver=auto,condensed,full   auto: facing dofs share a force; condensed: contact onto its dofs; full: the whole tangent
  no_prune=nothing,constant,linear,condense,forces,symmetric,quadrature   what is left out of a run, put back
Lists: a,b,c; a..b:log5 and a..b:lin5 have five values with both ends. Several scenes are several methods.
Results in DIR: sweep.csv, a row a setting, also those that failed; sweep.html and an SVG file a plot, made from it
alone. Rows that are there already are not run again.

Examples:
  wfl sweep examples/fault/nitsche.wfl examples/fault/penalty.wfl refine=0.5,1 gamma=1e4..1e6:log3 --out trade
  wfl sweep examples/signorini/signorini.wfl n=8,16,32 degree=1,2 --reference exact";

const IMPORT_HELP: &str = "\
Declarations that the string does not hold (unknowns, parameters) are guessed and marked: look at each of them.
What cannot be guessed is refused: transformations, multipliers, words of UFL. What is written compiles.

Examples:
  wfl import \"(2*mu*Sym(Grad_u) + lambda*Trace(Grad_u)*Id(3)):Grad_Test_u\"
  wfl import \"pos_part(g*u.Normal)*Test_u.Normal\" --on wall";

/// A scene with parameter values.
#[derive(Debug, ClapArgs)]
pub(crate) struct SceneArgs {
    /// The scene, a .wfl file
    pub(crate) scene: PathBuf,
    /// Parameters to replace: gamma=1e6 theta=-1; for wfl run also knobs of a sweep: refine=2 cells=[4,8] h=0.1
    /// degree=2 tol=1e-6
    #[arg(value_name = "NAME=VALUE")]
    pub(crate) overrides: Vec<String>,
}

fn pruning(name: &str) -> Result<Pruning, String> {
    let known = || Pruning::ALL.map(Pruning::name).join(", ");
    Pruning::named(name).ok_or_else(|| format!("nothing of that name is left out; known: {}", known()))
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
    use wfl_runtime::memory::{PROGRAM, parse, shown};
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
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Go on where a run that was stopped left off; its last 0.1 s (on a slow disc twenty times what
    /// a checkpoint takes) and the step it was in may be done again
    #[arg(long)]
    pub(crate) resume: bool,
    /// The relative error wanted, such as 1e-3: mesh, degree, tolerance and penalty are picked for it
    #[arg(long, value_name = "ERROR", value_parser = accuracy, conflicts_with = "resume")]
    pub(crate) accuracy: Option<f64>,
    /// What the accuracy is of: L2 or H1 of the unknowns, an output on contact faces, a measure [default: L2]
    #[arg(long, value_name = "QUANTITY")]
    pub(crate) of: Option<String>,
    /// Seconds that one run may take for the accuracy wanted; what would take longer is refused [default: 600]
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub(crate) budget: Option<f64>,
    /// Take a Nitsche parameter below its safe value (W503) for an error
    #[arg(long)]
    pub(crate) strict: bool,
    /// Threads of assembly and solver, 1 or more [default: all]
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<NonZeroUsize>,
    /// Precision of the factors of contact forces and bulk: f64, f32+f64 (factors in single, residuals in double
    /// precision) or auto
    #[arg(long, value_name = "NAME", value_parser = precision, default_value = "auto")]
    pub(crate) precision: Precision,
    /// Most Newton iterations in a step, in place of what the scene says; a path through the pieces of contact may pass
    /// 150 kinks more
    #[arg(long, value_name = "N")]
    pub(crate) max_iter: Option<NonZeroUsize>,
    /// Do what the scene does not need, to measure what leaving it out saves; wfl check lists the names
    #[arg(long, value_name = "NAME", value_parser = pruning)]
    pub(crate) no_prune: Vec<Pruning>,
    /// First measure what each part that the scene does without saves: solves it twice more for each, for the report
    #[arg(long, conflicts_with_all = ["no_prune", "accuracy"])]
    pub(crate) savings: bool,
    /// Say nothing but errors
    #[arg(short, long, conflicts_with = "verbose")]
    pub(crate) quiet: bool,
    /// Show every iteration
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
    /// What errors are taken against: `auto` (a finer run, of another scene if there are several), `exact` (`def exact`
    /// in the scene), `none`, or a reference_1.json that another sweep left
    #[arg(long, value_name = "auto|exact|none|FILE", default_value = "auto")]
    pub(crate) reference: String,
    /// A knob of the finer run, in place of what `auto` takes: refine=2
    #[arg(long, value_name = "KNOB=VALUE")]
    pub(crate) reference_knob: Vec<String>,
    /// Times each setting is run; the table has median, smallest and largest time
    #[arg(long, value_name = "N", default_value = "1")]
    pub(crate) repeat: NonZeroUsize,
    /// Runs made at once, each on one thread: the table then has errors, iterations and unknowns, but no times
    #[arg(long, value_name = "N", conflicts_with_all = ["repeat", "study", "plot"])]
    pub(crate) jobs: Option<NonZeroUsize>,
    /// Run nothing: make sweep.html and the plots anew from the tables in the folders given
    #[arg(long)]
    pub(crate) plot: bool,
    /// Run the study of the examples, from the root of the repository, and write DIR/trade.md with its figures
    #[arg(long, value_name = "DIR", conflicts_with_all = ["words", "plot"])]
    pub(crate) study: Option<PathBuf>,
    /// Folder of table, page and plots
    #[arg(long, value_name = "DIR", default_value = "out/sweep")]
    pub(crate) out: PathBuf,
    /// Threads of assembly and solver, 1 or more [default: all]
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<NonZeroUsize>,
    /// Say nothing but errors
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
    /// Seconds that each value may take [default: three times what the scene takes as written, and not less than 10]
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
    /// Write each chart as an SVG file, too, to OUT/plots
    #[arg(long)]
    pub(crate) plots: bool,
}

/// How a scene is checked.
#[derive(Debug, ClapArgs)]
pub(crate) struct CheckArgs {
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    /// Print JSON: the same tables, each a list of objects
    #[arg(long)]
    pub(crate) json: bool,
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
    /// What the code generator is given
    Clif,
    /// The terms, a line each
    Terms,
    /// The places where a term has no derivative, and the rule used there
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
    /// The code of a message, such as E103, the name of a function, such as Ball_projection, or a macro of the
    /// library, such as nitsche
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
