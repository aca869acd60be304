//! Interfaces: contact states and the fields that live on them.

use super::{PlotError, Request, Step, field::Wanted, scene};
use crate::{
    fault::{self, Interface},
    folder::{RunFolder, Series},
    picture::Picture,
};

/// What contact states are asked for by, and the array they are.
const STATE: &str = "state";
/// Size of maps.
const SIZE: [f64; 2] = [460.0, 380.0];

/// Pictures of a field on the interfaces of a file: maps of a plane, curves along a line; of states over the steps along
/// a line. `None` if no interface has the field.
pub(super) fn pictures(
    run: &RunFolder,
    series: &Series,
    steps: &[Step],
    wanted: &Wanted,
    request: &Request,
) -> Result<Option<Vec<Picture>>, PlotError> {
    let numbers: Vec<usize> = steps.iter().map(|(step, _)| *step).collect();
    let state = wanted.name == STATE || wanted.name == "contact_state";
    let mut pictures = Vec::new();
    for mut interface in fault::interfaces_of(run, series, &numbers)? {
        if !chosen(&mut interface, wanted, state)? {
            continue;
        }
        if run.minus.is_some() {
            let text = format!("`{}` lives on an interface: differences are drawn of fields of bodies", wanted.name);
            return Err(PlotError::Unfit(text));
        }
        if request.slice.is_some() {
            let text =
                format!("`{}` lives on an interface, which is not cut: leave out --slice and --line", wanted.name);
            return Err(PlotError::Unfit(text));
        }
        let plane = run.report.mesh.dim == 3;
        let mut made = match (plane, state) {
            (true, _) => fault::on_plane(run, &interface),
            (false, true) => match fault::on_line(run, &interface) {
                maps if maps.is_empty() => fault::strip(run, &interface).into_iter().collect(),
                maps => maps,
            },
            (false, false) => fault::profiles(run, &interface, &numbers),
        };
        for picture in &mut made {
            let title = format!("{}: {}", scene(run), picture.chart.title());
            picture.chart = picture.chart.clone().titled(title).size(SIZE[0], SIZE[1]);
            if let (Some([low, high]), true) = (request.range, plane && !state) {
                picture.chart = picture.chart.clone().map_range(low, high);
            }
        }
        pictures.append(&mut made);
    }
    // a name with the number of the step is for several
    if !request.step.is_several() && pictures.len() == 1 {
        pictures[0].name = wanted.part.as_ref().map_or(wanted.name.clone(), |part| format!("{}_{part}", wanted.name));
    }
    Ok((!pictures.is_empty()).then_some(pictures))
}

/// Leaves only what is asked for; false if there is none of it.
fn chosen(interface: &mut Interface, wanted: &Wanted, state: bool) -> Result<bool, PlotError> {
    if state {
        interface.shots.iter_mut().for_each(|s| s.quantities.clear());
        return Ok(interface.shots.iter().any(|s| s.piece.cell_data.iter().any(|v| v.name == "contact_state")));
    }
    let Some(last) = interface.shots.last() else { return Ok(false) };
    let labels: Vec<String> =
        last.quantities.iter().filter(|q| q.source == wanted.name).map(|q| q.label.clone()).collect();
    let Some(first) = labels.first() else { return Ok(false) };
    let part = |label: &str| label.trim_matches('|').strip_prefix(&wanted.name).unwrap_or_default().trim().to_owned();
    let label = match &wanted.part {
        // what slides and shears lies along the interface
        None => labels.iter().find(|l| part(l) == "along").unwrap_or(first).clone(),
        Some(asked) => match labels.iter().find(|l| part(l) == *asked) {
            Some(label) => label.clone(),
            None => {
                let known = labels.iter().map(|l| format!("{}:{}", wanted.name, part(l))).collect();
                return Err(PlotError::NoPart { field: wanted.name.clone(), part: asked.clone(), known });
            }
        },
    };
    for shot in &mut interface.shots {
        shot.quantities.retain(|q| q.label == label);
        shot.piece.cell_data.clear();
    }
    Ok(true)
}
