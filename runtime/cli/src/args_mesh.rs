//! Arguments of `wfl mesh`.

use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};
use wfl_report::{MeshColours, View};

use crate::args_plot::view;

pub(crate) const MESH_HELP: &str = "\
Reads Gmsh 2.2 and 4.1 (.msh), input files of Abaqus and CalculiX (.inp) and grids of VTK (.vtu), as `mesh file` of a scene
does. Angles are between edges in the plane and between faces in space; aspect is the longest over the shortest edge of a
cell; the jacobian ratio is 1 for a cell without distortion and 0 for one that is folded. Contact pairs and ties of an .inp
file are told as the lines to write. Exit codes: 0 the mesh can be used, 1 it cannot.

Examples:
  wfl mesh part.msh
  wfl mesh part.inp --json | jq '.regions[].region'
  wfl mesh part.vtu --png part.png --colours angle";

/// What is told of a mesh file.
#[derive(Debug, ClapArgs)]
pub(crate) struct MeshArgs {
    /// The mesh file
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// Print JSON: the same tables, each a list of objects
    #[arg(long)]
    pub(crate) json: bool,
    /// Draw the mesh as a PNG file
    #[arg(long, value_name = "FILE")]
    pub(crate) png: Option<PathBuf>,
    /// Draw the mesh as an SVG file
    #[arg(long, value_name = "FILE")]
    pub(crate) svg: Option<PathBuf>,
    /// Draw the mesh as a PDF file
    #[arg(long, value_name = "FILE")]
    pub(crate) pdf: Option<PathBuf>,
    /// What the colours of a picture say [default: regions if there are several, or the smallest angle]
    #[arg(long, value_name = "WHAT", value_enum)]
    pub(crate) colours: Option<Colours>,
    /// From where solid bodies are seen: azimuth from x towards y, elevation above the plane of x and y, in degrees
    #[arg(long, value_name = "AZ,EL", default_value = "-60,25", value_parser = view, allow_hyphen_values = true)]
    pub(crate) view: View,
}

/// What colours say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Colours {
    Regions,
    Size,
    Angle,
}

impl Colours {
    pub(crate) fn of_picture(self) -> MeshColours {
        match self {
            Colours::Regions => MeshColours::Regions,
            Colours::Size => MeshColours::Size,
            Colours::Angle => MeshColours::Angle,
        }
    }
}
