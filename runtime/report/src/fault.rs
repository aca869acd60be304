//! What happens on interfaces: states and quantities as maps, and along lines.

use wfl_charts::{Chart, MapCell, Scale, Section, short};

use crate::{
    folder::{ReportError, RunFolder, Series},
    grid::{Piece, read_pieces},
    picture::{Picture, STATES, at_step, over_steps},
    surface::{Quantity, Surface},
};

/// Steps of a map of line over time; of longer runs every so many.
const HISTORY: usize = 120;

/// Height of a strip in parts of its length.
const STRIP: f64 = 0.08;

/// An interface at a step.
pub(crate) struct Shot {
    pub(crate) step: usize,
    pub(crate) piece: Piece,
    surface: Surface,
    pub(crate) quantities: Vec<Quantity>,
}

/// An interface at all the steps that are looked at.
pub(crate) struct Interface {
    /// Words that tell it from others, empty if it is alone.
    name: String,
    pub(crate) shots: Vec<Shot>,
}

/// Sections with the maps and profiles of every interface, and what a scene has to write for them if it has none.
pub(crate) fn sections(run: &RunFolder, chosen: &[usize]) -> Result<Vec<(Section, Vec<Picture>)>, ReportError> {
    let mut sections = Vec::new();
    for interface in interfaces(run, chosen)? {
        let pictures = if run.report.mesh.dim == 2 { on_line(run, &interface) } else { on_plane(run, &interface) };
        let profiles = profiles(run, &interface, chosen);
        let mut section = Section::new(format!("On the interface{}", interface.name));
        if let Some(shot) = interface.shots.first() {
            section = section.text(in_words(shot));
        }
        for picture in &pictures {
            section = section.small(&picture.chart);
        }
        for picture in &profiles {
            section = section.chart(&picture.chart);
        }
        sections.push((section, pictures.into_iter().chain(profiles).collect()));
    }
    if sections.is_empty() && run.report.steps.iter().any(|s| s.contact.is_some()) {
        let text = "The run wrote no fields on an interface, so there are no maps of it. A statement such as\noutput \
                    vtk \"name\" : force as traction, tang(jump(uL,uR)) as slip\nwrites the fields on it, with the \
                    contact state, at each step.";
        sections.push((Section::new("On the interface").text(text), Vec::new()));
    }
    Ok(sections)
}

/// All interfaces of all files.
fn interfaces(run: &RunFolder, chosen: &[usize]) -> Result<Vec<Interface>, ReportError> {
    let mut found = Vec::new();
    for series in &run.grids {
        found.extend(unnamed(run, series, chosen)?);
    }
    Ok(named(found))
}

/// All interfaces of the files of one name.
pub(crate) fn interfaces_of(run: &RunFolder, series: &Series, chosen: &[usize]) -> Result<Vec<Interface>, ReportError> {
    Ok(named(unnamed(run, series, chosen)?))
}

/// In two dimensions every step is read, since maps show them all.
fn unnamed(run: &RunFolder, series: &Series, chosen: &[usize]) -> Result<Vec<Interface>, ReportError> {
    let dim = usize::try_from(run.report.mesh.dim).unwrap_or(0);
    let every = series.steps.len().div_ceil(HISTORY).max(1);
    let wanted = |k: usize, step: &usize| chosen.contains(step) || (dim == 2 && k.is_multiple_of(every));
    let mut lines: Vec<Vec<Shot>> = Vec::new();
    for (_, (step, file)) in series.steps.iter().enumerate().filter(|(k, (s, _))| wanted(*k, s)) {
        let pieces = read_pieces(file, dim.saturating_sub(1))?;
        lines.resize_with(lines.len().max(pieces.len()), Vec::new);
        for (line, piece) in lines.iter_mut().zip(pieces) {
            let Some(surface) = Surface::of(&piece) else { continue };
            let quantities = surface.quantities(&piece);
            line.push(Shot { step: *step, piece, surface, quantities });
        }
    }
    let has_content =
        |shots: &Vec<Shot>| shots.iter().any(|s| !s.quantities.is_empty() || !s.piece.cell_data.is_empty());
    let found = lines.into_iter().filter(has_content);
    Ok(found.map(|shots| Interface { name: series.name.clone(), shots }).collect())
}

/// Numbers where there are several.
fn named(mut found: Vec<Interface>) -> Vec<Interface> {
    let several = found.len() > 1;
    for (k, interface) in found.iter_mut().enumerate() {
        interface.name = if several { format!(" {} ({})", k + 1, interface.name) } else { String::new() };
    }
    found
}

fn in_words(shot: &Shot) -> String {
    let direction = |d: [f64; 3]| format!("({})", d.map(short).join(", "));
    let across = direction(shot.surface.normal);
    let lines = |k: usize| format!("{} along {}", shot.surface.names[k], direction(shot.surface.along[k]));
    let along = (0..shot.surface.along.len()).map(lines).collect::<Vec<_>>().join(", ");
    if shot.surface.flat {
        format!(
            "Plane view: {along}; \"across\" is the component of a vector along {across}, \"along\" the remaining part."
        )
    } else {
        format!("Curved interface, seen along its mean normal {across}: {along}.")
    }
}

/// The corners of a facet in the plane.
fn outline(shot: &Shot, cell: &[usize]) -> Vec<[f64; 2]> {
    cell.iter().map(|n| shot.surface.at(shot.piece.points[*n])).collect()
}

fn mean(cell: &[usize], numbers: &[f64]) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "few corners")]
    let n = cell.len() as f64;
    cell.iter().map(|k| numbers[*k]).sum::<f64>() / n
}

fn states(shot: &Shot) -> Option<&[f64]> {
    let found = shot.piece.cell_data.iter().find(|v| v.name == "contact_state");
    found.filter(|v| v.numbers.len() == shot.piece.cells.len()).map(|v| v.numbers.as_slice())
}

/// Maps of a plane, a row a quantity, a column a step; maps of one quantity share their colours.
pub(crate) fn on_plane(run: &RunFolder, interface: &Interface) -> Vec<Picture> {
    let mut pictures = Vec::new();
    for shot in &interface.shots {
        let Some(states) = states(shot) else { continue };
        let cells = shot.piece.cells.iter().zip(states).map(|(c, s)| MapCell::new(outline(shot, c), *s));
        let chart = plane(run, shot, "contact").states(STATES, cells);
        pictures.push(Picture::new(&format!("contact{}_{}", interface.name, shot.step), chart));
    }
    let Some(last) = interface.shots.last() else { return pictures };
    for quantity in &last.quantities {
        let same = |s: &Shot| s.quantities.iter().find(|q| q.label == quantity.label).map(|q| q.numbers.clone());
        let all: Vec<(&Shot, Vec<f64>)> = interface.shots.iter().filter_map(|s| Some((s, same(s)?))).collect();
        let means =
            |(shot, numbers): &(&Shot, Vec<f64>)| shot.piece.cells.iter().map(|c| mean(c, numbers)).collect::<Vec<_>>();
        let range = range(all.iter().flat_map(means));
        for (shot, numbers) in &all {
            let name = run.with_unit(&quantity.label, &quantity.source);
            let cell = |c: &Vec<usize>| MapCell::new(outline(shot, c), mean(c, numbers));
            let chart = plane(run, shot, &quantity.label).map(name, shot.piece.cells.iter().map(cell));
            let chart = if let Some([low, high]) = range { chart.map_range(low, high) } else { chart };
            pictures.push(Picture::new(&format!("{}{}_{}", quantity.label, interface.name, shot.step), chart));
        }
    }
    pictures
}

fn range(numbers: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let finite = numbers.filter(|x| x.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    (low <= high).then_some([low, high])
}

fn plane(run: &RunFolder, shot: &Shot, what: &str) -> Chart {
    let names = &shot.surface.names;
    let second = names.get(1).map_or("", String::as_str);
    Chart::new(format!("{what}, {}", at_step(run, shot.step)))
        .x(run.with_unit(&names[0], "X"), Scale::Linear)
        .y(run.with_unit(second, "X"), Scale::Linear)
        .size(330.0, 290.0)
        .equal()
}

/// Maps of a line over the steps; nothing in a run of few steps, where profiles say it all.
pub(crate) fn on_line(run: &RunFolder, interface: &Interface) -> Vec<Picture> {
    let mut pictures = Vec::new();
    let Some(last) = interface.shots.last().filter(|_| interface.shots.len() > 3) else { return pictures };
    let times: Vec<f64> = interface.shots.iter().map(|s| run.time(s.step)).collect();
    let history = |numbers: &dyn Fn(&Shot) -> Option<Vec<f64>>| {
        let mut cells = Vec::new();
        for (k, shot) in interface.shots.iter().enumerate() {
            let Some(values) = numbers(shot) else { continue };
            let (low, high) = (between(&times, k, k.checked_sub(1)), between(&times, k, Some(k + 1)));
            for (cell, value) in shot.piece.cells.iter().zip(values) {
                let s = outline(shot, cell);
                let note = format!("{} = {}\n", run.variable(), short(times[k]));
                let place = format!("{} = {} to {}\n", shot.surface.names[0], short(s[0][0]), short(s[1][0]));
                cells.push((MapCell::rectangle([s[0][0], low], [s[1][0], high], value), note + &place, value));
            }
        }
        cells
    };
    let frame = |what: &str| {
        Chart::new(format!("{what} over {}", run.variable()))
            .x(run.with_unit(&last.surface.names[0], "X"), Scale::Linear)
            .y(run.with_unit(run.variable(), run.variable()), Scale::Linear)
            .size(330.0, 290.0)
    };
    let of_states = history(&|shot| states(shot).map(<[f64]>::to_vec));
    if !of_states.is_empty() {
        let named = |v: f64| STATES.iter().zip([0.0, 1.0, 2.0]).find(|(_, k)| *k == v).map_or("", |(s, _)| s.0);
        let cells = of_states.into_iter().map(|(cell, note, v)| cell.note(note + named(v)));
        let chart = frame("contact").states(STATES, cells);
        pictures.push(Picture::new(&format!("contact{}", interface.name), chart));
    }
    for quantity in &last.quantities {
        let cells = history(&|shot| {
            let q = shot.quantities.iter().find(|q| q.label == quantity.label)?;
            Some(shot.piece.cells.iter().map(|c| mean(c, &q.numbers)).collect())
        });
        let name = run.with_unit(&quantity.label, &quantity.source);
        let cells = cells.into_iter().map(|(cell, note, v)| cell.note(format!("{note}{name} = {}", short(v))));
        let chart = frame(&quantity.label).map(name.clone(), cells);
        pictures.push(Picture::new(&format!("{}{}", quantity.label, interface.name), chart));
    }
    pictures
}

/// The states along a line at its last step, as a strip: for runs of few steps.
pub(crate) fn strip(run: &RunFolder, interface: &Interface) -> Option<Picture> {
    let shot = interface.shots.last()?;
    let places: Vec<Vec<[f64; 2]>> = shot.piece.cells.iter().map(|c| outline(shot, c)).collect();
    let (low, high) =
        places.iter().flatten().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(p[0]), b.max(p[0])));
    let height = STRIP * (high - low);
    let cells = places.iter().zip(states(shot)?).map(|(s, state)| {
        let name = STATES.iter().zip([0.0, 1.0, 2.0]).find(|(_, k)| k == state).map_or("", |(s, _)| s.0);
        let note = format!("{} = {} to {}\n{name}", shot.surface.names[0], short(s[0][0]), short(s[1][0]));
        MapCell::rectangle([s[0][0], 0.0], [s[1][0], height], *state).note(note)
    });
    let chart = Chart::new(format!("contact, {}", at_step(run, shot.step)))
        .x(run.with_unit(&shot.surface.names[0], "X"), Scale::Linear)
        .states(STATES, cells)
        .flat()
        .equal();
    Some(Picture::new(&format!("contact{}", interface.name), chart))
}

/// The time half way to a neighbour; as far beyond the first and last as the other neighbour is.
fn between(times: &[f64], k: usize, neighbour: Option<usize>) -> f64 {
    let here = times[k];
    if let Some(other) = neighbour.and_then(|n| times.get(n)) {
        return 0.5 * (here + other);
    }
    let inner = if k == 0 { times.get(1) } else { times.get(k - 1) };
    inner.map_or(here, |other| here + 0.5 * (here - other))
}

/// Quantities along the middle lines of the interface, a tone a step.
pub(crate) fn profiles(run: &RunFolder, interface: &Interface, chosen: &[usize]) -> Vec<Picture> {
    let mut pictures = Vec::new();
    let Some(last) = interface.shots.last() else { return pictures };
    let shots: Vec<&Shot> = interface.shots.iter().filter(|s| chosen.contains(&s.step)).collect();
    for quantity in &last.quantities {
        for axis in 0..last.surface.along.len() {
            let other = last.surface.middle(&last.piece, 1 - axis);
            let names = &last.surface.names;
            let place = match names.get(1 - axis) {
                Some(name) if names.len() > 1 => format!(", {name} = {}", short(other)),
                _ => String::new(),
            };
            let chart = Chart::new(format!("{}{place}", quantity.label))
                .x(run.with_unit(&names[axis], "X"), Scale::Linear)
                .y(run.with_unit(&quantity.label, &quantity.source), Scale::Linear);
            let lines = shots.iter().filter_map(|s| {
                let q = s.quantities.iter().find(|q| q.label == quantity.label)?;
                Some((s.step, s.surface.cut(&s.piece, axis, other, &q.numbers)))
            });
            let chart = over_steps(run, chart, lines.collect());
            let file = format!("{}_over_{}{}", quantity.label, names[axis], interface.name);
            pictures.push(Picture::new(&file, chart));
        }
    }
    pictures
}
