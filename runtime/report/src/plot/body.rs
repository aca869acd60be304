//! Bodies: deformed and coloured, or cut.

use wfl_charts::{Chart, Colour, Edge, Face, Ramp, Scale, Series, short};

use super::{
    Beside, PlotError, ProfileLine, Request, Slice, Step, Warp, dimension,
    field::{Numbers, Wanted, displacement, first_choice, joined, numbers},
    known_cells, scene,
    section::{line, other_axes, plane},
    skin::{MeshLines, skin},
};
use crate::{
    folder::{ReportError, RunFolder},
    grid::{Whole, read_whole},
    picture::{Picture, at_step, over_steps},
};

/// Cells whose edges are drawn; edges of more would hide the colours.
const EDGED: usize = 3000;
/// Part of the largest value up to which values of the other sign count as rounding.
const SIGN: f64 = 0.02;
/// Part of the extent that the largest displacement takes with a factor that is found, and beyond which it stays as it is.
const SHOWN: f64 = 0.1;
const LARGE: f64 = 0.05;
/// Areas below this part of the square of what is around them count as zero.
const ROUNDING: f64 = 1e-9;
/// Room for the picture without title and ramp, in units.
const ROOM: [f64; 2] = [440.0, 330.0];
const AXES: [&str; 3] = ["x", "y", "z"];

/// The bodies at a step.
struct Shot {
    step: usize,
    whole: Whole,
    cells: Vec<usize>,
    found: Numbers,
    moved: Option<Vec<[f64; 3]>>,
}

/// What the pictures of all steps share.
struct Shared {
    range: [f64; 2],
    ramp: Ramp,
    factor: f64,
    /// Corners around the bodies of all steps, if there are several.
    room: Option<[[f64; 2]; 2]>,
}

/// Pictures of the bodies, one a step; along a line one of all steps.
pub(super) fn pictures(
    run: &RunFolder,
    steps: &[Step],
    wanted: &Wanted,
    request: &Request,
) -> Result<Vec<Picture>, PlotError> {
    if dimension(run) == 1 {
        let ends = line_of(run, steps, request)?.map_or([[0.0; 3]; 2], |line| line.ends);
        return bar(run, steps, wanted).map(|p| vec![beside(p, ends, &request.beside)]);
    }
    if let Some(ends) = profile_ends(run, steps, request)? {
        let drawn = if run.minus.is_some() { both } else { profile };
        return drawn(run, steps, wanted, ends).map(|p| vec![beside(p, ends, &request.beside)]);
    }
    let mut shared = shared(run, steps, wanted, request)?;
    if steps.len() > 1 {
        shared.room = Some(around(run, steps, wanted, &shared, request)?);
    }
    let mut pictures = Vec::new();
    for step in steps {
        let shot = shot(run, step, wanted)?;
        pictures.push(picture(run, &shot, &shared, request)?);
    }
    Ok(pictures)
}

/// The bodies with the numbers of the run, less those of the other one if there is one.
fn shot(run: &RunFolder, step: &Step, wanted: &Wanted) -> Result<Shot, PlotError> {
    let mut shot = own_shot(run, step, wanted)?;
    if let Some(other) = &run.minus {
        take_off(run, other, step, &mut shot, wanted)?;
    }
    Ok(shot)
}

fn own_shot(run: &RunFolder, step: &Step, wanted: &Wanted) -> Result<Shot, PlotError> {
    let (step, file) = step;
    let (whole, names) = read_whole(file, dimension(run))?;
    let missing = || PlotError::NoField { asked: wanted.name.clone(), known: names };
    let found = numbers(&whole, dimension(run), wanted)?.ok_or_else(missing)?;
    let cells = known_cells(&whole, &found);
    let moved = displacement(run, &whole);
    Ok(Shot { step: *step, whole, cells, found, moved })
}

/// Takes the numbers of another run off those of a step: at the same step, or at the last one of both.
fn take_off(
    run: &RunFolder,
    other: &RunFolder,
    step: &Step,
    shot: &mut Shot,
    wanted: &Wanted,
) -> Result<(), PlotError> {
    let Shot { whole, found, cells, .. } = shot;
    let theirs = counterpart(run, other, step)?;
    let (there, names) = read_whole(&theirs.1, dimension(other))?;
    let missing = || PlotError::NoField { asked: wanted.name.clone(), known: names };
    let numbers = numbers(&there, dimension(other), wanted)?.ok_or_else(missing)?;
    let extent = (0..3).map(|d| span(whole.points.iter().map(|p| p[d]))).fold(0.0f64, |m, [a, b]| m.max(b - a));
    let near = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).all(|d| (a[d] - b[d]).abs() <= ROUNDING * extent);
    let same = whole.points.len() == there.points.len() && whole.cells.len() == there.cells.len();
    if !same || !whole.points.iter().zip(&there.points).all(near) {
        return Err(PlotError::OtherMesh { a: run.folder_name(), b: other.folder_name() });
    }
    found.numbers.iter_mut().zip(numbers.numbers).for_each(|(a, b)| *a -= b);
    *cells = known_cells(whole, found);
    found.label = format!("{}: {} − {}", found.label, run.folder_name(), other.folder_name());
    found.file = format!("{}_difference", found.file);
    Ok(())
}

/// The step of another run that belongs to one of this run.
fn counterpart(run: &RunFolder, other: &RunFolder, step: &Step) -> Result<Step, PlotError> {
    let grid = run.grids.iter().find(|g| g.steps.contains(step));
    let theirs = grid.and_then(|grid| other.grids.iter().find(|g| g.name == grid.name)).or(other.grids.first());
    let (Some(grid), Some(theirs)) = (grid, theirs) else { return Err(PlotError::NoFields) };
    let same = theirs.steps.iter().find(|s| s.0 == step.0);
    let last = theirs.steps.last().filter(|_| grid.steps.last() == Some(step));
    let none = || PlotError::NoStep { asked: step.0, known: theirs.steps.iter().map(|s| s.0).collect() };
    last.or(same).cloned().ok_or_else(none)
}

/// Range, colours and factor, from all the steps that are drawn.
fn shared(run: &RunFolder, steps: &[Step], wanted: &Wanted, request: &Request) -> Result<Shared, PlotError> {
    let (mut low, mut high, mut far, mut extent) = (f64::INFINITY, f64::NEG_INFINITY, 0.0f64, 0.0f64);
    for step in steps {
        let shot = shot(run, step, wanted)?;
        let nodes = || shot.cells.iter().flat_map(|k| &shot.whole.cells[*k].nodes).copied();
        for node in nodes() {
            let value = shot.found.numbers[node];
            (low, high) = (low.min(value), high.max(value));
            if let Some(moved) = shot.moved.as_ref().map(|m| m[node]).filter(|m| m.iter().all(|x| x.is_finite())) {
                far = far.max(moved[0].hypot(moved[1]).hypot(moved[2]));
            }
        }
        for axis in 0..3 {
            let [a, b] = span(nodes().map(|n| shot.whole.points[n][axis]));
            extent = extent.max(b - a);
        }
    }
    if low > high {
        return Err(PlotError::Unfit(format!("`{}` has no finite value on a cell", wanted.name)));
    }
    let factor = match request.warp {
        Warp::Factor(factor) => factor,
        // an initial gap is not multiplied: with another factor bodies that close it overlap in the picture
        Warp::Auto if run.is_mapped() => 1.0,
        Warp::Auto => automatic(far, extent),
    };
    let signed = low < 0.0 && high > 0.0 && low.abs().min(high) > SIGN * low.abs().max(high);
    let (range, ramp) = match request.range {
        Some([a, b]) => ([a, b], if a < 0.0 && b == -a { Ramp::Diverging } else { Ramp::Viridis }),
        None if signed => {
            let most = low.abs().max(high);
            ([-most, most], Ramp::Diverging)
        }
        None => ([low, high], Ramp::Viridis),
    };
    Ok(Shared { range, ramp, factor, room: None })
}

/// The factor at which the largest displacement is seen: see [`Warp::Auto`].
fn automatic(far: f64, extent: f64) -> f64 {
    if far == 0.0 || !(far / extent).is_finite() {
        return 0.0;
    }
    if far >= LARGE * extent {
        return 1.0;
    }
    let wanted = SHOWN * extent / far;
    let power = 10f64.powf(wanted.log10().floor());
    let round = [5.0, 2.0, 1.0].into_iter().find(|m| m * power <= wanted * (1.0 + 1e-9)).unwrap_or(1.0);
    round * power
}

fn span(numbers: impl Iterator<Item = f64>) -> [f64; 2] {
    numbers.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)])
}

impl Shot {
    /// A component of the place of a node in the picture.
    fn place(&self, node: usize, axis: usize, factor: f64) -> f64 {
        let moved = self.moved.as_ref().map_or(0.0, |m| m[node][axis]);
        self.whole.points[node][axis] + if factor == 0.0 || moved.is_nan() { 0.0 } else { factor * moved }
    }
}

fn picture(run: &RunFolder, shot: &Shot, shared: &Shared, request: &Request) -> Result<Picture, PlotError> {
    let (faces, axes) = faces(run, shot, shared.factor, request)?;
    let label = run.with_unit(&shot.found.label, &shot.found.source);
    // of several pictures each has the number of its step
    let name = match shared.room {
        Some(_) => format!("{}_{:04}", shot.found.file, shot.step),
        None => shot.found.file.clone(),
    };
    let room = shared.room.unwrap_or_else(|| corners(&faces));
    let size = |axis: usize| room[1][axis] - room[0][axis];
    let scale = (ROOM[0] / size(0)).min(ROOM[1] / size(1));
    let width = (scale * size(0)).clamp(120.0, ROOM[0]) + 150.0;
    let height = (scale * size(1)).clamp(60.0, ROOM[1]) + 112.0;
    let chart = Chart::new(format!("{}: {}", scene(run), shot.found.label))
        .size(width.max(360.0), height)
        .equal()
        .surface(label, shared.ramp, faces)
        .map_range(shared.range[0], shared.range[1])
        .room(room[0], room[1]);
    let second = subtitle(run, shot, shared, request);
    let chart = if second.is_empty() { chart } else { chart.subtitle(second) };
    let chart = match axes {
        Some([a, b]) => {
            chart.x(run.with_unit(AXES[a], "X"), Scale::Linear).y(run.with_unit(AXES[b], "X"), Scale::Linear)
        }
        None => chart.triad(request.view.axes()),
    };
    Ok(Picture::new(&name, chart))
}

/// What is seen of the bodies, and the axes of space that it has if it is plane.
fn faces(
    run: &RunFolder,
    shot: &Shot,
    factor: f64,
    request: &Request,
) -> Result<(Vec<Face>, Option<[usize; 2]>), PlotError> {
    let lines = if request.no_mesh || shot.cells.len() > EDGED { MeshLines::Hidden } else { MeshLines::Drawn };
    Ok(match request.slice {
        Some(Slice::Plane { axis, value }) => (cut(shot, axis, value, factor, lines)?, Some(other_axes(axis))),
        _ if dimension(run) == 3 => (solid(shot, factor, lines, request), None),
        _ => (flat(shot, factor, lines), Some([0, 1])),
    })
}

/// The corners of the rectangle around faces.
fn corners(faces: &[Face]) -> [[f64; 2]; 2] {
    let [x, y] = [0, 1].map(|axis| span(faces.iter().flat_map(Face::corners).map(|c| c[axis])));
    [[x[0], y[0]], [x[1], y[1]]]
}

/// The same of the pictures of several steps.
fn around(
    run: &RunFolder,
    steps: &[Step],
    wanted: &Wanted,
    shared: &Shared,
    request: &Request,
) -> Result<[[f64; 2]; 2], PlotError> {
    let mut all = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    for step in steps {
        let [low, high] = corners(&faces(run, &shot(run, step, wanted)?, shared.factor, request)?.0);
        for axis in 0..2 {
            all[0][axis] = all[0][axis].min(low[axis]);
            all[1][axis] = all[1][axis].max(high[axis]);
        }
    }
    Ok(all)
}

/// Step, cut, factor, and what else is to be known.
fn subtitle(run: &RunFolder, shot: &Shot, shared: &Shared, request: &Request) -> String {
    let mut parts = Vec::new();
    if run.report.steps.len() > 1 {
        parts.push(at_step(run, shot.step));
    }
    if let Some(Slice::Plane { axis, value }) = request.slice {
        parts.push(format!("{} = {}", AXES[axis], short(value)));
    }
    parts.push(match (&shot.moved, shared.factor) {
        (None, _) => String::new(),
        (_, 0.0) => "not deformed".to_owned(),
        (_, 1.0) => "true displacements".to_owned(),
        (_, factor) => format!("displacements × {}", short(factor)),
    });
    parts.push(shot.found.note.to_owned());
    parts.retain(|p| !p.is_empty());
    parts.join(", ")
}

fn flat(shot: &Shot, factor: f64, lines: MeshLines) -> Vec<Face> {
    let face = |nodes: &[usize], edges: Vec<Edge>| {
        let corners = nodes.iter().map(|n| [shot.place(*n, 0, factor), shot.place(*n, 1, factor), 0.0]).collect();
        Face::new(corners, nodes.iter().map(|n| shot.found.numbers[*n]).collect(), edges)
    };
    skin(&shot.whole, &shot.cells, lines).into_iter().map(|f| face(&f.nodes, f.edges)).collect()
}

/// The faces that look at the reader: the body itself is in front of the others.
fn solid(shot: &Shot, factor: f64, lines: MeshLines, request: &Request) -> Vec<Face> {
    let corner = |n: &usize| request.view.at([0, 1, 2].map(|d| shot.place(*n, d, factor)));
    let faces = skin(&shot.whole, &shot.cells, lines).into_iter();
    let values = |nodes: &[usize]| nodes.iter().map(|n| shot.found.numbers[*n]).collect();
    let faces = faces.map(|f| Face::new(f.nodes.iter().map(corner).collect(), values(&f.nodes), f.edges));
    faces.filter(|f| turns_left(f.corners())).collect()
}

/// It is seen from its front. A face that is seen from its edge is not: its area is rounding.
fn turns_left(corners: &[[f64; 3]]) -> bool {
    let next = |k: usize| corners[(k + 1) % corners.len()];
    let twice: f64 = corners.iter().enumerate().map(|(k, a)| a[0] * next(k)[1] - next(k)[0] * a[1]).sum();
    let around: f64 =
        corners.iter().enumerate().map(|(k, a)| (0..3).map(|d| (next(k)[d] - a[d]).abs()).sum::<f64>()).sum();
    twice > ROUNDING * around * around
}

fn cut(shot: &Shot, axis: usize, value: f64, factor: f64, lines: MeshLines) -> Result<Vec<Face>, PlotError> {
    let cuts = plane(&shot.whole, &shot.cells, axis, value, lines);
    if cuts.is_empty() {
        return Err(outside(shot, format!("the plane {} = {}", AXES[axis], short(value)), &[axis]));
    }
    let [u, v] = other_axes(axis);
    let face = |cut: super::section::Cut| {
        let corner = |p: &super::section::Between| [u, v].map(|d| p.of(|n| shot.place(n, d, factor)));
        let corners = cut.points.iter().map(corner).map(|[x, y]| [x, y, 0.0]).collect();
        Face::new(corners, cut.points.iter().map(|p| p.of(|n| shot.found.numbers[n])).collect(), cut.edges)
    };
    Ok(cuts.into_iter().map(face).collect())
}

fn outside(shot: &Shot, what: String, axes: &[usize]) -> PlotError {
    let nodes = || shot.cells.iter().flat_map(|k| &shot.whole.cells[*k].nodes);
    let range = |axis: &usize| {
        let [a, b] = span(nodes().map(|n| shot.whole.points[*n][*axis]));
        format!("{} = {} to {}", AXES[*axis], short(a), short(b))
    };
    PlotError::Outside { what, body: axes.iter().map(range).collect::<Vec<_>>().join(", ") }
}

/// The ends of the line that is asked for: a line by its points, or a plane through a plane body.
fn profile_ends(run: &RunFolder, steps: &[Step], request: &Request) -> Result<Option<[[f64; 3]; 2]>, ReportError> {
    match request.slice {
        Some(Slice::Line(ends)) => Ok(Some(ends)),
        Some(Slice::Plane { axis, value }) if dimension(run) == 2 && axis < 2 => {
            let Some((_, file)) = steps.last() else { return Ok(None) };
            let (whole, _) = read_whole(file, 2)?;
            let [low, high] = span(whole.points.iter().map(|p| p[1 - axis]));
            let end = |other: f64| if axis == 0 { [value, other, 0.0] } else { [other, value, 0.0] };
            Ok(Some([end(low), end(high)]))
        }
        _ => Ok(None),
    }
}

/// The line of a profile: the ends, and the value of the step variable at the last step that is drawn. `None` where no
/// profile is drawn.
pub(super) fn line_of(run: &RunFolder, steps: &[Step], request: &Request) -> Result<Option<ProfileLine>, PlotError> {
    let Some((step, file)) = steps.last() else { return Ok(None) };
    let ends = if dimension(run) == 1 {
        let (whole, _) = read_whole(file, 1)?;
        let [low, high] = span(whole.points.iter().map(|p| p[0]));
        Some([[low, 0.0, 0.0], [high, 0.0, 0.0]])
    } else {
        profile_ends(run, steps, request)?
    };
    Ok(ends.map(|ends| ProfileLine { ends, time: run.time(*step) }))
}

/// A profile with the curves that are to stand beside it.
fn beside(Picture { name, mut chart }: Picture, ends: [[f64; 3]; 2], curves: &[Beside]) -> Picture {
    let line = Line::new(ends, 3);
    for curve in curves {
        let points = curve.points.iter().map(|[s, value]| [line.place(*s), *value]);
        chart = chart.line(Series::new(curve.name.as_str(), points).dashed().colour(Colour::Ink));
    }
    Picture { name, chart }
}

/// The curves of two runs along a line, at the last of the steps.
fn both(run: &RunFolder, steps: &[Step], wanted: &Wanted, ends: [[f64; 3]; 2]) -> Result<Picture, PlotError> {
    let (Some(step), Some(other)) = (steps.last(), &run.minus) else { return Err(PlotError::NoFields) };
    let mut picture: Option<Picture> = None;
    for (of, step) in [(run, step.clone()), (other, counterpart(run, other, step)?)] {
        let line = Line::new(ends, dimension(of));
        let shot = own_shot(of, &step, wanted)?;
        let series = Series::new(of.folder_name(), line.values(&shot, dimension(of))?);
        let begun = picture.take().unwrap_or_else(|| line.picture(of, &shot.found));
        picture = Some(Picture { chart: begun.chart.line_points(series), ..begun });
    }
    picture.ok_or(PlotError::NoFields)
}

/// Values along a line, a curve a step.
fn profile(run: &RunFolder, steps: &[Step], wanted: &Wanted, ends: [[f64; 3]; 2]) -> Result<Picture, PlotError> {
    let line = Line::new(ends, dimension(run));
    let (mut curves, mut last) = (Vec::new(), None);
    for step in steps {
        let shot = own_shot(run, step, wanted)?;
        curves.push((shot.step, line.values(&shot, dimension(run))?));
        last = Some(shot.found);
    }
    let Some(found) = last else { return Err(PlotError::NoFields) };
    let Picture { name, chart } = line.picture(run, &found);
    Ok(Picture { name, chart: over_steps(run, chart, curves) })
}

/// A line through the bodies.
struct Line {
    ends: [[f64; 3]; 2],
    /// The only coordinate that changes along it.
    along: Option<usize>,
    dim: usize,
}

impl Line {
    fn new(ends: [[f64; 3]; 2], dim: usize) -> Self {
        let changes: Vec<usize> = (0..3).filter(|d| ends[0][*d] != ends[1][*d]).collect();
        let along = if let [only] = changes[..] { Some(only) } else { None };
        Line { ends, along, dim }
    }

    /// Places and numbers along it.
    fn values(&self, shot: &Shot, dim: usize) -> Result<Vec<[f64; 2]>, PlotError> {
        let ends = self.ends;
        let found = line(&shot.whole, &shot.cells, dim, ends, &shot.found.numbers);
        if found.is_empty() {
            let point = |p: [f64; 3]| p[..dim].iter().map(|x| short(*x)).collect::<Vec<_>>().join(", ");
            let what = format!("the line from ({}) to ({})", point(ends[0]), point(ends[1]));
            return Err(outside(shot, what, &[0, 1, 2][..dim]));
        }
        Ok(found.into_iter().map(|[s, v]| [self.place(s), v]).collect())
    }

    /// The place on the axis of what lies at a part of the line.
    fn place(&self, s: f64) -> f64 {
        let ends = self.ends;
        let length = (0..3).map(|d| ends[1][d] - ends[0][d]).fold(0.0f64, |s, x| s.hypot(x));
        self.along.map_or(s * length, |d| ends[0][d] + s * (ends[1][d] - ends[0][d]))
    }

    /// The chart without its curves.
    fn picture(&self, run: &RunFolder, found: &Numbers) -> Picture {
        let fixed = (0..self.dim).filter(|d| self.along.is_some_and(|a| a != *d));
        let fixed: Vec<String> = fixed.map(|d| format!("{} = {}", AXES[d], short(self.ends[0][d]))).collect();
        let title = [scene(run) + ": " + &found.label, fixed.join(", ")].join(if fixed.is_empty() { "" } else { ", " });
        let axis = self.along.map_or("distance", |d| AXES[d]);
        let chart = Chart::new(title)
            .size(520.0, 340.0)
            .x(run.with_unit(axis, "X"), Scale::Linear)
            .y(run.with_unit(&found.label, &found.source), Scale::Linear);
        Picture::new(&format!("{}_over_{axis}", found.file), chart)
    }
}

/// A bar has no faces: its values over the coordinate, a curve a step.
fn bar(run: &RunFolder, steps: &[Step], wanted: &Wanted) -> Result<Picture, PlotError> {
    let (mut curves, mut last) = (Vec::new(), None);
    for step in steps {
        let shot = shot(run, step, wanted)?;
        let mut parts: Vec<[[f64; 2]; 2]> = Vec::new();
        for k in &shot.cells {
            let corners = shot.whole.cells[*k].corners();
            let mut ends = [0, 1].map(|i| [shot.whole.points[corners[i]][0], shot.found.numbers[corners[i]]]);
            ends.sort_by(|a, b| a[0].total_cmp(&b[0]));
            parts.push(ends);
        }
        parts.sort_by(|a, b| a[0][0].total_cmp(&b[0][0]));
        let mut points: Vec<[f64; 2]> = parts.into_iter().flatten().collect();
        points.dedup();
        curves.push((shot.step, points));
        last = Some(shot.found);
    }
    let Some(found) = last else { return Err(PlotError::NoFields) };
    let chart = Chart::new(format!("{}: {}", scene(run), found.label))
        .size(520.0, 340.0)
        .x(run.with_unit("x", "X"), Scale::Linear)
        .y(run.with_unit(&found.label, &found.source), Scale::Linear);
    Ok(Picture::new(&found.file, over_steps(run, chart, curves)))
}

/// The bodies at the last step for the page of a run: the displacement, and the stress if there is one.
pub(crate) fn overview(run: &RunFolder) -> Result<Vec<Picture>, PlotError> {
    let mut pictures = Vec::new();
    for grid in &run.grids {
        let Some(step) = grid.steps.last() else { continue };
        let (whole, _) = read_whole(&step.1, dimension(run))?;
        let stress = joined(&whole, "stress").filter(|(v, _)| v.width == 9).map(|_| Wanted::read("stress"));
        for wanted in first_choice(run, &whole).into_iter().chain(stress) {
            if matches!(numbers(&whole, dimension(run), &wanted), Ok(Some(_))) {
                pictures.extend(self::pictures(run, std::slice::from_ref(step), &wanted, &Request::default())?);
            }
        }
        if !pictures.is_empty() {
            break;
        }
    }
    Ok(pictures)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_are_round_and_large_displacements_stay() {
        assert_eq!(automatic(1e-3, 2.0), 200.0);
        assert_eq!(automatic(1.1e-3, 2.0), 100.0);
        assert_eq!(automatic(0.3, 2.0), 1.0);
        assert_eq!(automatic(0.05, 2.0), 2.0);
        assert_eq!(automatic(0.0, 2.0), 0.0);
        assert!((automatic(3e-9, 1.0) / 2e7 - 1.0).abs() < 1e-12);
    }
}
