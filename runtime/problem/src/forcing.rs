//! What drives a scene over the step variable, looked at before the run, so that steps which the run chooses do not pass
//! over it: formulas of the step variable and of positions in terms, loads, prescribed values and data.
//!
//! Each formula is sampled at a few points of its region: on an equal grid, around the zeros of the sums and comparisons in
//! it (`t - 5` of a pulse around 5), at the rows of its tables, and halved between values that differ by a tenth of its
//! range. What still jumps between neighbouring numbers is a jump; where the slope of a formula of the step variable alone
//! jumps is a kink (`abs(t - 2)`). Steps end at both. A scene with a memory (states, values of the previous step) depends on
//! how far its loads have gone, so there steps end where a formula turns, too.
//! Promises: the same on all ranks; a scene without such formulas pays nothing; work is bounded ([`MOST`]).
//! Does not see what depends on unknowns, and no pulse that is narrower than the grid and has no zero of a sum in it.

use wfl::{
    ResolvedScript, Span,
    ast::{Argument, Cond, CondKind, Expr, ExprKind, Ident, Place},
    children, cond_children, each_name, split_prefixes,
};
use wfl_compiler::{InterpreterBackend, compile_value, types::UniformSlot};
use wfl_discrete::{value::Value, window::Window};
use wfl_mesh::mesh::{Mesh, RegionSet};

use super::{Builder, Steps, mesh::position_place};

/// Parts of the range of the step variable that each formula is looked at in.
const GRID: usize = 1024;
/// Members of a region at which formulas of positions are looked at.
const PLACES: usize = 24;
/// Values of the step variable at which a formula is looked at, at most.
const MOST: usize = 20_000;
/// Neighbouring samples differ by at most this part of the range of a formula.
const FINE: f64 = 0.1;
/// A step may leave out what differs from a straight line by this part of the range.
const MISSED: f64 = 0.2;
/// Ranges that a formula goes through, from which on it oscillates ...
const OFTEN: f64 = 100.0;
/// ... unless it rests for this part of the range of the step variable.
const QUIET: f64 = 0.02;
/// A range below this part of the largest value is rounding.
const ROUNDING: f64 = 1e-11;
/// Values of the step variable are one if they are closer than this part of its range.
const SAME: f64 = 1e-11;
/// Two numbers of a formula that differ by less, in parts of their ranges, go the same way.
const ALIKE: f64 = 1e-6;
/// Parts of the range at which zeros of sums are sought.
const SEARCH: usize = 64;
/// How far beside a zero a slope is looked at, in parts of the range of the step variable.
const BESIDE: f64 = 1e-6;
/// A kink changes the slope by at least this part of the range of a formula over that of the step variable; what is less
/// changes values by less than its own error over a step of the run.
const KINK: f64 = 1e-3;
/// Parts of the range by which a formula goes on behind a value where it turns: less is rounding or no load to speak of.
const TURNED: f64 = 1e-3;
/// Zeros that are looked around, at most.
const ZEROS: usize = 400;

/// How the formulas of a scene change: samples of numbers that begin at 0 and have a range of 1.
#[derive(Clone, Debug, Default)]
pub struct Forcing {
    /// Each number with its own values of the step variable.
    courses: Vec<Course>,
    /// Values of the step variable behind which some number is another one (the last number before the jump), or goes on with
    /// another slope.
    jumps: Vec<f64>,
    /// Values of the step variable at which some number turns, where that matters.
    turns: Vec<f64>,
    same: f64,
}

#[derive(Clone, Debug)]
struct Course {
    times: Vec<f64>,
    values: Vec<f64>,
}

impl Forcing {
    /// Adds the jumps to other values of the step variable where steps end; one that is as good as a jump is left out.
    pub(super) fn add_to(&self, corners: &mut Vec<f64>) {
        corners.retain(|c| self.jumps.iter().all(|jump| (jump - c).abs() > self.same));
        corners.extend(&self.jumps);
        corners.sort_by(f64::total_cmp);
    }

    /// Values of the step variable that are closer than this are one.
    #[must_use]
    pub fn same(&self) -> f64 {
        self.same
    }

    /// How far a step that begins at `from` may reach, at most to `to`, without leaving out what drives the scene.
    #[must_use]
    pub fn reach(&self, from: f64, to: f64) -> f64 {
        let turn = self.turns.get(self.turns.partition_point(|t| *t <= from + self.same));
        let to = turn.map_or(to, |turn| to.min(*turn));
        self.courses.iter().map(|course| course.reach(from, to)).fold(to, f64::min)
    }
}

impl Course {
    /// Whether it goes up and down all the time: no step passes over that unseen, and the error of a step says how much of
    /// it the solution follows.
    fn oscillates(&self, span: f64) -> bool {
        let variation: f64 = self.values.windows(2).map(|v| (v[1] - v[0]).abs()).sum();
        if variation < OFTEN {
            return false;
        }
        let (mut longest, mut begin) = (0.0f64, 0);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (k, v) in self.values.iter().enumerate() {
            (low, high) = (low.min(*v), high.max(*v));
            if high - low > 2.0 * FINE {
                (begin, low, high) = (k, *v, *v);
            }
            longest = longest.max(self.times[k] - self.times[begin]);
        }
        longest < QUIET * span
    }

    /// Where it has turned, as samples: from rising to falling, or the other way.
    fn turns(&self) -> Vec<f64> {
        let mut found = Vec::new();
        // the sample that went farthest, and whether up
        let (mut best, mut rises) = (0, None);
        for (k, value) in self.values.iter().enumerate() {
            let ahead = value - self.values[best];
            match rises {
                None if ahead.abs() > TURNED => (best, rises) = (k, Some(ahead > 0.0)),
                Some(up) if (ahead > 0.0) == up => best = k,
                Some(up) if ahead.abs() > TURNED => {
                    found.push(self.times[best]);
                    (best, rises) = (k, Some(!up));
                }
                _ => {}
            }
        }
        found
    }

    /// The value between two samples.
    fn at(&self, time: f64) -> f64 {
        let next = self.times.partition_point(|t| *t <= time).clamp(1, self.times.len() - 1);
        let (t, v) = (&self.times[next - 1..=next], &self.values[next - 1..=next]);
        v[0] + (time - t[0]) / (t[1] - t[0]) * (v[1] - v[0])
    }

    /// The farthest sample, or `to`, such that the straight line from here to there passes all samples between.
    fn reach(&self, from: f64, to: f64) -> f64 {
        let begin = self.times.partition_point(|t| *t <= from);
        let here = self.at(from);
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        let mut last = None;
        let behind = self.times[begin..].iter().zip(&self.values[begin..]).take_while(|(t, _)| **t < to);
        for (t, value) in behind.map(|(t, v)| (*t, *v)).chain([(to, self.at(to))]) {
            let slope = (value - here) / (t - from);
            if slope < low || slope > high {
                // the first sample behind a step is always met
                return last.unwrap_or(t);
            }
            low = low.max((value - MISSED - here) / (t - from));
            high = high.min((value + MISSED - here) / (t - from));
            last = Some(t);
        }
        to
    }
}

impl Builder<'_> {
    /// What drives the scene, where the run chooses its steps; made by all ranks together.
    pub(super) fn forcing(&self, steps: &Steps, corners: &[f64]) -> Forcing {
        let mut forcing = Forcing::default();
        let Some(variable) = self.env.step_variable.filter(|_| steps.auto.is_some()) else { return forcing };
        let mut formulas = Vec::new();
        each_driving(self.script, &mut |e, places| self.collect(e, variable, places, &mut formulas));
        for formula in formulas {
            formula.look(steps, corners, &mut forcing);
        }
        if self.has_memory() {
            forcing.turns = forcing.courses.iter().flat_map(Course::turns).collect();
        }
        let least = SAME * (steps.last() - steps.first());
        forcing.same = least;
        for list in [&mut forcing.jumps, &mut forcing.turns] {
            list.sort_by(f64::total_cmp);
            list.retain(|t| *t > steps.first() + least && *t < steps.last() - least);
            list.dedup_by(|a, b| *a - *b <= least);
        }
        forcing
    }

    /// Whether the state depends on the way to it: by states, or by values of the previous step.
    pub(super) fn has_memory(&self) -> bool {
        let mut reads_past = false;
        for term in &self.script.terms {
            each_name(&term.expr, &mut |word| reads_past |= split_prefixes(word).0.contains("Previous_"));
        }
        reads_past || self.has_states()
    }

    /// Adds the largest parts of an expression that depend on the step variable and positions alone.
    pub(super) fn collect(&self, e: &Expr, variable: &str, places: &[&str], found: &mut Vec<Formula>) {
        if !mentions(e, variable) {
            return;
        }
        if let Some(value) = self.of_positions(e) {
            let points = if value.law.inputs.is_empty() { vec![[0.0; 3]] } else { self.points(places) };
            let mut sums = Vec::new();
            each_sum(e, variable, &mut |sum| sums.extend(self.of_positions(&sum)));
            let mut rows = Vec::new();
            self.rows(e, &mut rows);
            found.push(Formula { written: e.clone(), value, points, sums, rows });
            return;
        }
        if let ExprKind::If(condition, a, b) = &e.kind {
            // where the branch changes, whatever the branches are
            let number = |x: f64| Box::new(Expr { kind: ExprKind::Number(x), span: e.span, expansion: e.expansion });
            let kind = ExprKind::If(condition.clone(), number(1.0), number(0.0));
            let branch = Expr { kind, span: e.span, expansion: e.expansion };
            match self.of_positions(&branch) {
                Some(_) => self.collect(&branch, variable, places, found),
                None => cond_children(condition, &mut |part| self.collect(part, variable, places, found)),
            }
            [a, b].into_iter().for_each(|part| self.collect(part, variable, places, found));
            return;
        }
        children(e, &mut |part| self.collect(part, variable, places, found));
    }

    /// The value of an expression of positions and the step variable; `None` for others.
    pub(super) fn of_positions(&self, e: &Expr) -> Option<Value> {
        let law = compile_value(self.env, &position_place(self.env.fields.len()), "a formula", e).value?;
        let of_time = law.prologue.slots.iter().all(|s| *s == UniformSlot::Time);
        let value = Value::new(law, &InterpreterBackend).ok().filter(|_| of_time)?;
        value.reads_positions_only().then_some(value)
    }

    /// Tables in an expression, with the values of their arguments at their rows.
    fn rows(&self, e: &Expr, found: &mut Vec<(Value, Vec<f64>)>) {
        if let ExprKind::Call(callee, arguments) = &e.kind
            && let (ExprKind::Name(word), [Argument::Text(file, _), Argument::Expr(argument), rest @ ..]) =
                (&callee.kind, arguments.as_slice())
            && word == "table"
        {
            let column = if let [Argument::Text(column, _)] = rest { Some(column.as_str()) } else { None };
            let table = self.script.tables.iter().find(|t| t.name == *file);
            if let Some(Ok(curve)) = table.map(|t| t.curve(column)) {
                found.extend(self.of_positions(argument).map(|value| (value, curve.corners().to_vec())));
            }
        }
        children(e, &mut |part| self.rows(part, found));
    }

    /// A few points of the cells, faces or nodes of regions; the same on all ranks.
    pub(super) fn points(&self, places: &[&str]) -> Vec<[f64; 3]> {
        let mut own: Vec<f64> = Vec::new();
        for set in places.iter().filter_map(|name| self.regions.get(*name)).map(|region| &region.set) {
            let every = set.len().div_ceil(PLACES).max(1);
            for k in (0..set.len()).step_by(every) {
                own.extend(points_of(&self.mesh, set, k).into_iter().flatten());
            }
        }
        let all = self.mesh.holders().all_numbers(&own);
        let all: Vec<[f64; 3]> = all.chunks_exact(3).map(|x| [x[0], x[1], x[2]]).collect();
        let every = all.len().div_ceil(2 * PLACES).max(1);
        let chosen: Vec<[f64; 3]> = all.into_iter().step_by(every).collect();
        if chosen.is_empty() { vec![[0.0; 3]] } else { chosen }
    }
}

/// The centre of a member of a region, and one of its corners.
fn points_of(mesh: &Mesh, set: &RegionSet, k: usize) -> Vec<[f64; 3]> {
    match set {
        RegionSet::Cells(cells) => {
            vec![mesh.centroid(cells[k]), mesh.node(mesh.cell_vertices(cells[k])[0])]
        }
        RegionSet::Facets(faces) => {
            vec![mesh.facet_centroid(faces[k]), mesh.node(mesh.facet_vertices(faces[k]).vertices()[0])]
        }
        RegionSet::Interface(pairs) => {
            let face = pairs[k].here;
            vec![mesh.facet_centroid(face), mesh.node(mesh.facet_vertices(face).vertices()[0])]
        }
        RegionSet::Edges(edges) => vec![mesh.edge_middle(edges[k]), mesh.node(mesh.edge_ends(edges[k])[0])],
        RegionSet::Nodes(nodes) => vec![mesh.node(nodes[k])],
    }
}

/// A formula at its points.
pub(super) struct Formula {
    /// As it is written.
    pub(super) written: Expr,
    pub(super) value: Value,
    pub(super) points: Vec<[f64; 3]>,
    /// Its sums, and the differences of what it compares: what it does begins and ends where these are zero.
    sums: Vec<Value>,
    /// Arguments of tables, and where these have rows.
    rows: Vec<(Value, Vec<f64>)>,
}

/// The numbers of a value at points; not numbers where one of them is none.
pub(super) fn numbers(value: &Value, points: &[[f64; 3]], time: f64) -> Vec<f64> {
    let value = value.at_step(Window::instant(time));
    let points = if value.law.inputs.is_empty() { &points[..1] } else { points };
    let n = points.len() * value.n_components();
    value.at_positions(points).unwrap_or_else(|_| vec![f64::NAN; n])
}

impl Formula {
    /// Samples it, and adds how it changes.
    fn look(mut self, steps: &Steps, corners: &[f64], forcing: &mut Forcing) {
        let (first, last) = (steps.first(), steps.last());
        let span = last - first;
        let zeros = self.zeros(first, last);
        let times = times(&zeros, first, last, corners);
        let samples = self.sampled(&times, span);
        let ranges = ranges(&samples);
        if self.value.law.inputs.is_empty() {
            let inside = zeros.into_iter().filter(|z| *z - BESIDE * span > first && *z + BESIDE * span < last);
            forcing.jumps.extend(inside.filter(|z| self.has_kink(*z, span, &ranges)));
        }
        let is_jump = |p: &[Sample]| p[1].0 - p[0].0 <= SAME * span && differ(&p[0].1, &p[1].1, &ranges);
        forcing.jumps.extend(samples.windows(2).filter(|p| is_jump(p)).map(|p| p[0].0));
        let mut distinct: Vec<Course> = Vec::new();
        for (c, (low, high)) in ranges.into_iter().enumerate().filter(|(_, range)| changes(*range)) {
            let begin = samples[0].1[c];
            let values: Vec<f64> = samples.iter().map(|(_, v)| (v[c] - begin) / (high - low)).collect();
            let alike = |course: &Course| {
                let pairs = || course.values.iter().zip(&values);
                let sign = pairs().map(|(a, b)| a * b).sum::<f64>().signum();
                pairs().all(|(a, b)| (a - sign * b).abs() <= ALIKE)
            };
            if !distinct.iter().any(alike) {
                let course = Course { times: samples.iter().map(|s| s.0).collect(), values };
                if !course.oscillates(span) {
                    distinct.push(course);
                }
            }
        }
        forcing.courses.extend(distinct);
    }

    /// Whether the slope of some number jumps at a value of the step variable: its change is the same however close one looks.
    fn has_kink(&self, at: f64, span: f64, ranges: &[(f64, f64)]) -> bool {
        let here = numbers(&self.value, &self.points, at);
        let change = |distance: f64| -> Vec<f64> {
            let [before, behind] = [-distance, distance].map(|d| numbers(&self.value, &self.points, at + d));
            let bend = (0..here.len()).map(|c| (before[c] - here[c]) + (behind[c] - here[c]));
            bend.map(|bend| bend / distance).collect()
        };
        let (far, near) = (change(BESIDE * span), change(0.125 * BESIDE * span));
        (0..here.len()).filter(|c| changes(ranges[*c])).any(|c| {
            let (low, high) = ranges[c];
            // rounding of the numbers over the shorter distance
            let rounding = 16.0 * f64::EPSILON * low.abs().max(high.abs()) / (0.125 * BESIDE * span);
            let least = (KINK * (high - low) / span).max(rounding);
            near[c].abs() > least && near[c].abs() > 0.5 * far[c].abs() && near[c].abs() < 2.0 * far[c].abs()
        })
    }

    /// Its numbers there, and between those that differ by much, until these are as close as numbers are.
    fn sampled(&mut self, times: &[f64], span: f64) -> Vec<Sample> {
        let Self { value, points, .. } = self;
        let at = |t: f64| Some((t, numbers(value, points, t))).filter(|(_, v)| v.iter().all(|x| x.is_finite()));
        let mut samples: Vec<Sample> = times.iter().filter_map(|t| at(*t)).collect();
        loop {
            let ranges = ranges(&samples);
            let mut between = Vec::new();
            for pair in samples.windows(2) {
                let (a, b) = (&pair[0], &pair[1]);
                let middle = a.0 + 0.5 * (b.0 - a.0);
                let is_between = middle > a.0 && middle < b.0 && b.0 - a.0 > f64::EPSILON * span;
                if is_between && differ(&a.1, &b.1, &ranges) {
                    between.extend(at(middle));
                }
            }
            if between.is_empty() || samples.len() + between.len() > MOST {
                return samples;
            }
            samples.extend(between);
            samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
    }

    /// Where its sums are zero and its tables have rows, at any of its points.
    pub(super) fn zeros(&mut self, first: f64, last: f64) -> Vec<f64> {
        let mut found = Vec::new();
        let Self { points, sums, rows, .. } = self;
        for sum in sums {
            let width = numbers(sum, points, first).len();
            for c in 0..width {
                zeros_of(&mut |t| numbers(sum, points, t)[c], (first, last), &mut found);
            }
        }
        for (argument, rows) in rows {
            let width = numbers(argument, points, first).len();
            let ends = [first, last].map(|t| numbers(argument, points, t));
            for c in 0..width {
                let (low, high) = (ends[0][c].min(ends[1][c]), ends[0][c].max(ends[1][c]));
                for row in rows.iter().filter(|row| (low..=high).contains(*row)) {
                    if found.len() < ZEROS {
                        bisected(&mut |t| numbers(argument, points, t)[c] - row, (first, last), &mut found);
                    }
                }
            }
        }
        found.sort_by(f64::total_cmp);
        found.dedup_by(|a, b| *a - *b <= SAME * (last - first));
        found.truncate(ZEROS);
        found
    }
}

/// Where a formula is looked at first: on an equal grid, at corners, and ever closer to zeros.
fn times(zeros: &[f64], first: f64, last: f64, corners: &[f64]) -> Vec<f64> {
    let span = last - first;
    #[expect(clippy::cast_precision_loss, reason = "a few values")]
    let mut times: Vec<f64> = (0..=GRID).map(|k| first + span * (k as f64 / GRID as f64)).collect();
    times.extend(corners);
    for zero in zeros {
        times.push(*zero);
        let mut distance = 0.1 * span;
        while distance > 1e-9 * span {
            times.extend([1.0, 0.5, 0.2].iter().flat_map(|part| [zero - part * distance, zero + part * distance]));
            distance *= 0.1;
        }
    }
    times.retain(|t| (first..=last).contains(t));
    times.sort_by(f64::total_cmp);
    times.dedup();
    times
}

/// A value of the step variable, and the numbers of a formula there.
type Sample = (f64, Vec<f64>);

/// The smallest and the largest of each number.
fn ranges(samples: &[Sample]) -> Vec<(f64, f64)> {
    let n = samples.first().map_or(0, |s| s.1.len());
    let of = |c: usize| samples.iter().map(move |(_, v)| v[c]);
    let range = |c: usize| (of(c).fold(f64::INFINITY, f64::min), of(c).fold(f64::NEG_INFINITY, f64::max));
    (0..n).map(range).collect()
}

/// Whether some number changes by more than a fine part of its range.
fn differ(a: &[f64], b: &[f64], ranges: &[(f64, f64)]) -> bool {
    let mut all = a.iter().zip(b).zip(ranges);
    all.any(|((a, b), range)| changes(*range) && (a - b).abs() > FINE * (range.1 - range.0))
}

/// A range that is not rounding alone.
pub(super) fn changes(range: (f64, f64)) -> bool {
    range.1 - range.0 > ROUNDING * range.0.abs().max(range.1.abs())
}

/// Zeros with a change of sign between points of an equal grid.
fn zeros_of(f: &mut dyn FnMut(f64) -> f64, range: (f64, f64), found: &mut Vec<f64>) {
    #[expect(clippy::cast_precision_loss, reason = "a few values")]
    let at = |k: usize| range.0 + (range.1 - range.0) * (k as f64 / SEARCH as f64);
    let mut before = f(range.0);
    for k in 1..=SEARCH {
        let next = f(at(k));
        if (before <= 0.0) != (next <= 0.0) && found.len() < ZEROS {
            bisected(f, (at(k - 1), at(k)), found);
        }
        before = next;
    }
}

/// The zero between two values of other signs.
fn bisected(f: &mut dyn FnMut(f64) -> f64, range: (f64, f64), found: &mut Vec<f64>) {
    let (mut from, mut to) = range;
    let begin = f(from);
    if (begin <= 0.0) == (f(to) <= 0.0) {
        return;
    }
    loop {
        let middle = from + 0.5 * (to - from);
        let value = f(middle);
        if value == 0.0 || middle <= from || middle >= to {
            return found.push(if value == 0.0 { middle } else { to });
        }
        if (value <= 0.0) == (begin <= 0.0) { from = middle } else { to = middle }
    }
}

fn mentions(e: &Expr, variable: &str) -> bool {
    let mut found = false;
    each_name(e, &mut |word| found |= word == variable);
    found
}

/// Calls `f` for each sum that depends on the step variable, and for what decides about branches: the difference of both
/// sides of each comparison, and of what the smaller or larger is taken; the argument of a function with a kink at zero.
fn each_sum(e: &Expr, variable: &str, f: &mut dyn FnMut(Expr)) {
    if matches!(e.kind, ExprKind::Sum(_)) && mentions(e, variable) {
        f(e.clone());
    }
    if let ExprKind::If(condition, ..) = &e.kind {
        each_difference(condition, variable, f);
    }
    if let ExprKind::Call(callee, arguments) = &e.kind
        && let ExprKind::Name(word) = &callee.kind
    {
        match (word.as_str(), arguments.as_slice()) {
            ("min" | "max", [Argument::Expr(a), Argument::Expr(b)]) => difference(a, b, variable, f),
            ("abs" | "pos_part" | "neg_part" | "sign" | "Heaviside", [Argument::Expr(a)])
                if mentions(a, variable) && !matches!(a.kind, ExprKind::Sum(_)) =>
            {
                f(a.clone());
            }
            _ => {}
        }
    }
    children(e, &mut |part| each_sum(part, variable, f));
}

/// Calls `f` for the difference of two expressions, if it depends on the step variable.
fn difference(left: &Expr, right: &Expr, variable: &str, f: &mut dyn FnMut(Expr)) {
    let (span, expansion): (Span, _) = (left.span, left.expansion);
    let kind = ExprKind::Sum(vec![(false, left.clone()), (true, right.clone())]);
    let difference = Expr { kind, span, expansion };
    if mentions(&difference, variable) {
        f(difference);
    }
}

fn each_difference(condition: &Cond, variable: &str, f: &mut dyn FnMut(Expr)) {
    match &condition.kind {
        CondKind::Compare(first, rest) => {
            let mut left: &Expr = first;
            for (_, right) in rest {
                difference(left, right, variable, f);
                left = right;
            }
        }
        CondKind::And(parts) | CondKind::Or(parts) => parts.iter().for_each(|p| each_difference(p, variable, f)),
        CondKind::Not(part) => each_difference(part, variable, f),
    }
}

/// Calls `f` for each expression that drives a scene, with the names of its regions.
pub(super) fn each_driving<'s>(script: &'s ResolvedScript, f: &mut dyn FnMut(&'s Expr, &[&str])) {
    let names = |places: &'s [Ident]| places.iter().map(|p| p.name.as_str()).collect::<Vec<_>>();
    script.terms.iter().for_each(|t| f(&t.expr, &names(&t.places)));
    script.fixes.iter().chain(&script.loads).for_each(|c| f(&c.value, &names(&c.places)));
    for field in &script.fields {
        let on = match &field.space.place {
            Place::On(list) => names(list),
            _ => vec!["all"],
        };
        match &field.kind {
            wfl::FieldKind::Data { value: wfl::DataValue::Formula(e) } | wfl::FieldKind::State { update: e } => {
                f(e, &on)
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn course(f: impl Fn(f64) -> f64, times: &[f64]) -> Forcing {
        let course = Course { times: times.to_vec(), values: times.iter().map(|t| f(*t)).collect() };
        Forcing { courses: vec![course], ..Forcing::default() }
    }

    #[test]
    fn a_step_ends_where_a_pulse_begins_and_passes_over_what_is_straight() {
        let times: Vec<f64> = (0..=1000).map(|k| 0.01 * f64::from(k)).collect();
        let pulse = course(|t| (-((t - 5.0) / 0.05).powi(2)).exp(), &times);
        let end = pulse.reach(0.0, 10.0);
        assert!((4.8..5.0).contains(&end), "{end}");
        assert_eq!(pulse.reach(6.0, 10.0), 10.0);
        assert_eq!(course(|t| 0.1 * t, &times).reach(0.0, 10.0), 10.0);
        // a sine over half of its period is a fifth of its range away from the chord at less than that
        let wave = course(|t| 0.5 * t.sin(), &times).reach(0.0, 10.0);
        assert!((1.0..3.2).contains(&wave), "{wave}");
    }

    #[test]
    fn what_never_rests_oscillates() {
        let times: Vec<f64> = (0..=10_000).map(|k| 1e-3 * f64::from(k)).collect();
        let of = |f: &dyn Fn(f64) -> f64| course(f, &times).courses[0].oscillates(10.0);
        assert!(of(&|t| 0.5 * (300.0 * t).sin()));
        assert!(!of(&|t| if t > 5.0 { 0.5 * (300.0 * t).sin() } else { 0.0 }), "a train of waves begins");
        assert!(!of(&|t| 0.5 * (3.0 * t).sin()));
    }

    #[test]
    fn a_zero_is_found_to_the_last_digit() {
        let mut found = Vec::new();
        zeros_of(&mut |t| 3.0 * (t - 5.2), (0.0, 10.0), &mut found);
        zeros_of(&mut |t| t * t + 1.0, (0.0, 10.0), &mut found);
        assert!(found.len() == 1 && (found[0] - 5.2).abs() < 1e-15, "{found:?}");
    }
}
