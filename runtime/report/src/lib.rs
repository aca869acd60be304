//! A page about a run and pictures of its results, made of the files that the run left.
//!
//! [`RunFolder::read`] finds the files, [`Pages::new`] makes sections and charts of them, [`plots`] draws one field. Promises: only files that the
//! report of the run names are shown, so nothing of an earlier run in the same folder is; a run that failed is shown
//! with its failure; what is not there is said, with the statement that would write it.
//! Does not run or judge anything: every number is one of the files, or its size or direction.
#![forbid(unsafe_code)]

mod accuracy;
mod events;
mod fault;
mod folder;
mod grid;
mod pages;
mod picture;
mod plot;
mod profile;
mod solver;
mod surface;
mod table;

pub use folder::{ReportError, RunFolder};
pub use pages::Pages;
pub use picture::Picture;
pub use plot::{Over, PlotError, Request, Slice, StepChoice, View, Warp, over, plots};
pub use wfl_charts::film;
