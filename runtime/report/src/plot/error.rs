//! Why there is no picture.

use crate::folder::ReportError;

/// Why there is no picture, and what to do about it.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// A result file cannot be read.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// The scene writes no fields.
    #[error("the run wrote no fields: its scene has no `output vtk`")]
    NoFields,
    /// No such field.
    #[error("the run wrote no field `{asked}`")]
    NoField {
        /// What was asked for.
        asked: String,
        /// What there is.
        known: Vec<String>,
    },
    /// No such measure.
    #[error("the run has no measure `{asked}`")]
    NoMeasure {
        /// What was asked for.
        asked: String,
        /// What there is.
        known: Vec<String>,
    },
    /// Two runs whose numbers cannot be subtracted point by point.
    #[error("`{a}` and `{b}` have no mesh in common")]
    OtherMesh {
        /// The first folder.
        a: String,
        /// The second one.
        b: String,
    },
    /// The field has no such part.
    #[error("`{field}` has no part `{part}`")]
    NoPart {
        /// The field.
        field: String,
        /// What was asked for.
        part: String,
        /// What there is.
        known: Vec<String>,
    },
    /// No such step.
    #[error("there are no fields of step {asked}")]
    NoStep {
        /// What was asked for.
        asked: usize,
        /// The steps that have files.
        known: Vec<usize>,
    },
    /// The plane or the line does not meet the body.
    #[error("{what} lies outside the body")]
    Outside {
        /// The plane or line.
        what: String,
        /// Where the body is.
        body: String,
    },
    /// What was asked for is not made for such a field.
    #[error("{0}")]
    Unfit(String),
}

impl PlotError {
    /// What to do about it; empty if the message says it all.
    #[must_use]
    pub fn help(&self) -> String {
        let list = |known: &[String]| known.join(", ");
        match self {
            PlotError::Report(_) | PlotError::Unfit(_) => String::new(),
            PlotError::NoFields => "add a statement such as `output vtk \"name\" : u, sigma(u) as stress`".to_owned(),
            PlotError::NoField { known, .. } | PlotError::NoPart { known, .. } => format!("there is {}", list(known)),
            PlotError::NoMeasure { known, .. } => format!("there is {}", list(known)),
            PlotError::OtherMesh { .. } => "--line draws both along a line".to_owned(),
            PlotError::NoStep { known, .. } => match (known.first(), known.last()) {
                (Some(first), Some(last)) if first < last => format!("there are steps {first} to {last}"),
                (Some(only), _) => format!("there is step {only} alone"),
                _ => String::new(),
            },
            PlotError::Outside { body, .. } => format!("the body is in {body}"),
        }
    }
}
