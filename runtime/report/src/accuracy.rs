//! A demanded accuracy: errors over the meshes of the search, the mesh that was found and where the error came from.

use wfl_charts::{Chart, Colour, MapCell, Scale, Section, Series, short};
use wfl_output::record::{AccuracyRecord, REFINED, SHARE};

use crate::{
    folder::{ReportError, RunFolder},
    grid::{Piece, read_pieces},
    picture::Picture,
};

/// Cells of the largest mesh that is drawn: more of them are smaller than a point of the screen.
const DRAWN: usize = 20_000;
/// Shares of the error below this part of the largest one have one colour.
const LEAST_SHARE: f64 = 1e-4;

/// The section, where an accuracy was demanded.
pub(crate) fn section(run: &RunFolder) -> Result<Option<(Section, Vec<Picture>)>, ReportError> {
    let Some(record) = &run.report.accuracy else { return Ok(None) };
    let mut pictures = vec![Picture::new("accuracy", convergence(record))];
    // a map shows plane meshes only; others are not even read
    if let Some(file) = run.mesh.as_ref().filter(|_| run.report.mesh.dim == 2) {
        let pieces = read_pieces(file, 2)?;
        pictures.extend(pieces.first().filter(|p| p.cells.len() <= DRAWN).and_then(mesh));
    }
    let mut section = Section::new("Demanded accuracy").facts(facts(record));
    for why in &record.why {
        section = section.text(why.as_str());
    }
    for picture in &pictures {
        section = section.chart(&picture.chart);
    }
    Ok(Some((section, pictures)))
}

fn facts(record: &AccuracyRecord) -> Vec<(String, String)> {
    let e = |x: f64| {
        if x == 0.0 {
            "0".to_owned()
        } else if x.is_finite() {
            format!("{x:.1e}")
        } else {
            "not known".to_owned()
        }
    };
    let mut facts = vec![
        (format!("demanded error of {}", record.quantity), e(record.asked)),
        ("estimated error".to_owned(), e(record.estimate.0)),
        (
            "its parts".to_owned(),
            format!("mesh {}, tolerance {}, method {}", e(record.mesh.0), e(record.tolerance.0), e(record.method.0)),
        ),
    ];
    if let Some(truth) = record.truth {
        let times = record.over_truth().map_or_else(String::new, |x| format!(" (the estimate is {x:.2} times that)"));
        facts.push(("true error".to_owned(), e(truth.0) + &times));
    }
    let setting: Vec<String> = record.picked.iter().map(|(name, value)| format!("{name}={value}")).collect();
    facts.push(("setting".to_owned(), setting.join(" ")));
    facts.push(("mesh".to_owned(), format!("{} cells after {} rounds of refinement", record.cells, record.rounds)));
    facts
}

/// Estimated errors over unknowns, with what was demanded.
#[expect(clippy::cast_precision_loss, reason = "numbers of unknowns")]
fn convergence(record: &AccuracyRecord) -> Chart {
    let known: Vec<_> =
        record.trial_runs.iter().filter(|t| t.error.0 > 0.0 && t.error.0.is_finite() && t.dofs > 0).collect();
    let at = |error: f64| known.iter().map(move |t| [t.dofs as f64, error]).collect::<Vec<_>>();
    let notes = known.iter().map(|t| {
        format!("{} unknowns, {} cells, {} rounds\nestimated error {:.2e}", t.dofs, t.cells, t.rounds, t.error.0)
    });
    let mut chart = Chart::new(format!("Error of {} over the meshes", record.quantity))
        .x("unknowns", Scale::Log)
        .y("relative error [-]", Scale::Log)
        .line_points(
            Series::new("estimated", known.iter().map(|t| [t.dofs as f64, t.error.0])).notes(notes.collect::<Vec<_>>()),
        )
        .line(Series::new("demanded", at(record.asked)).colour(Colour::Ink));
    let truth = record.truth.filter(|t| t.0 > 0.0 && t.0.is_finite());
    if let (Some(truth), Some(last)) = (truth, record.trial_runs.last()) {
        chart = chart.points(Series::new("true", [[last.dofs as f64, truth.0]]));
    }
    chart
}

/// The mesh, with the share of the error of each cell as its colour.
fn mesh(piece: &Piece) -> Option<Picture> {
    let array = |name: &str| piece.cell_data.iter().find(|v| v.name == name).map(|v| v.numbers.as_slice());
    let refined = array(REFINED)?;
    let shares = array(SHARE);
    let largest = shares.into_iter().flatten().fold(0.0f64, |a, b| a.max(*b));
    let cell = |(k, corners): (usize, &Vec<usize>)| {
        let outline = corners.iter().map(|n| [piece.points[*n][0], piece.points[*n][1]]);
        let share = shares.map_or(f64::NAN, |s| s[k]);
        let value = if largest > 0.0 { (share / largest).max(LEAST_SHARE).log10() } else { refined[k] };
        let told =
            if largest > 0.0 { format!("share of the error: {} %\n", short(100.0 * share)) } else { String::new() };
        MapCell::new(outline, value).note(format!("{told}rounds of refinement: {}", short(refined[k])))
    };
    let cells = piece.cells.iter().enumerate().map(cell);
    let label = if largest > 0.0 {
        "log10 of a cell's share of the error over the largest [-]"
    } else {
        "rounds of refinement"
    };
    Some(Picture::new(
        "accuracy_mesh",
        Chart::new("Mesh and where its error came from")
            .size(560.0, 460.0)
            .x("x", Scale::Linear)
            .y("y", Scale::Linear)
            .equal()
            .map(label, cells)
            .map_edges(),
    ))
}
