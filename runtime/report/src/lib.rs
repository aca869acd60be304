//! A page about a run and pictures of its results, made of the files that the run left.
//!
//! [`RunFolder::read`] finds the files, [`Pages::new`] makes sections and charts of them, [`plots`] draws one field. Promises: only files that the
//! report of the run names are shown, so nothing of an earlier run in the same folder is; a run that failed is shown
//! with its failure; what is not there is said, with the statement that would write it.
//! [`mesh_picture`] draws a mesh that was read. Does not run or judge anything: every number is one of the files, or its size or direction.
#![forbid(unsafe_code)]

mod accuracy;
mod events;
mod fault;
mod folder;
mod grid;
mod mesh_picture;
mod pages;
mod picture;
mod plot;
mod profile;
mod solver;
mod surface;
mod table;
mod watch;

pub use folder::{ReportError, RunFolder};
pub use mesh_picture::{MeshColours, mesh_picture};
pub use pages::Pages;
pub use picture::Picture;
pub use plot::{
    Beside, Over, PlotError, ProfileLine, Request, Slice, StepChoice, View, Warp, over, plots, profile_line, sized,
};
pub use watch::{Watched, WatchedStep};
pub use wfl_charts::film;
