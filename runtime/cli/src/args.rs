//! The command line.

use std::path::PathBuf;

use clap::{Args as ClapArgs, Parser, Subcommand};

/// Write, check and solve contact formulations from text files.
#[derive(Debug, Parser)]
#[command(name = "wfl", version, about, arg_required_else_help = true)]
pub(crate) struct Args {
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Solve a scene and write its results to out/<scene>/
    Run(RunArgs),
}

/// A scene with parameter values.
#[derive(Debug, ClapArgs)]
pub(crate) struct SceneArgs {
    /// The scene, a .wfl file
    pub(crate) scene: PathBuf,
    /// Parameters to replace: gamma=1e6 theta=-1
    #[arg(value_name = "NAME=VALUE")]
    pub(crate) overrides: Vec<String>,
}

/// How a scene is run.
#[derive(Debug, ClapArgs)]
pub(crate) struct RunArgs {
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    /// Directory of the results [default: out/<scene>]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Threads of assembly and solver [default: all]
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<usize>,
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
