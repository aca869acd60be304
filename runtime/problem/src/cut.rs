//! Conditions that cut what they select: how much of the mesh where a condition holds lies in faces and cells that are not
//! taken, and the other way round.
//!
//! A face is taken where its corners and its centre fulfil the condition, a cell where its centre does. Promises: nothing
//! is said of a condition that ends on lines of the mesh, whatever its rounding; of a cut that changes size and content of
//! a region by less than what a mesh shows; of a band around a surface that also holds parts of faces at an angle to it.
//! Shares are sums over points of a grid in each entity. Does not know names.

use std::collections::BTreeMap;

use wfl::{
    Code, Diagnostic, FieldKind, ResolvedScript, Span,
    ast::{Ident, Place, Reduction, RegionExpr},
};
use wfl_mesh::{
    element::Table,
    mesh::{CellId, CellKind, FaceEdge, FacetRef, Mesh, NodeId, RegionSet, cell_volumes, edge_lengths, facet_measures},
};

/// A smaller part of a face is the width of a tolerance, as in `x > 0.99*b`, or `abs(x - c) < 1.1*h` for the faces at a node.
const SLIVER: f64 = 0.125;
/// The larger part of a face is this much of it: only its border is outside.
const WHOLE: f64 = 0.999;
/// Cosine of the largest angle between neighbouring faces of one surface: 30 degrees.
const SMOOTH: f64 = 0.866;

/// What the region of a condition is for: how much of it may be wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Counted {
    /// Where something is looked at: a largest value, a state, an output.
    #[default]
    No,
    /// A mean is taken over it, which changes by a part of what the size changes.
    Mean,
    /// Its size counts: something acts on it, lives on it, or is integrated over it.
    Fully,
}

impl Counted {
    /// The smallest part of the size that is told: regions whose size is wrong by less are what a mesh of ordinary fineness
    /// shows of a condition.
    fn size(self) -> f64 {
        match self {
            Counted::No => f64::INFINITY,
            Counted::Mean => 0.05,
            Counted::Fully => 0.01,
        }
    }

    /// ... and of what lies on the wrong side of the condition, where cells too many and too few have one size.
    fn content(self) -> f64 {
        if self == Counted::Fully { 0.1 } else { f64::INFINITY }
    }
}

/// What the regions of a scene are for, by name; those that another one is made of are for what that one is.
pub(super) fn counted(script: &ResolvedScript) -> BTreeMap<&str, Counted> {
    let mut found: BTreeMap<&str, Counted> = BTreeMap::new();
    let mut add = |places: &[Ident], counted: Counted| {
        for place in places {
            if let Some(region) = script.regions.iter().find(|r| r.name.name == place.name) {
                let known = found.entry(region.name.name.as_str()).or_default();
                *known = counted.max(*known);
            }
        }
    };
    script.terms.iter().for_each(|t| add(&t.places, Counted::Fully));
    script.fixes.iter().chain(&script.loads).for_each(|c| add(&c.places, Counted::Fully));
    script.splits.iter().for_each(|s| add(&s.places, Counted::Fully));
    for field in script.fields.iter().filter(|f| !matches!(f.kind, FieldKind::State { .. })) {
        if let Place::On(list) = &field.space.place {
            add(list, Counted::Fully);
        }
    }
    for measure in script.reductions() {
        let counted = match measure.reduction {
            Reduction::Integral => Counted::Fully,
            Reduction::Mean => Counted::Mean,
            Reduction::Max | Reduction::Min | Reduction::Value | Reduction::Reaction | Reduction::Balance(_) => {
                Counted::No
            }
        };
        add(&measure.places, counted);
    }
    // a region stands behind those it is made of
    for region in script.regions.iter().rev() {
        let own = found.get(region.name.name.as_str()).copied().unwrap_or_default();
        for name in parts(&region.region) {
            if let Some(part) = script.regions.iter().find(|r| r.name.name == name.name) {
                let known = found.entry(part.name.name.as_str()).or_default();
                *known = own.max(*known);
            }
        }
    }
    found
}

/// The names in a region.
fn parts(region: &RegionExpr) -> Vec<&Ident> {
    match region {
        RegionExpr::Name(name) | RegionExpr::Picked { of: Some(name), .. } => vec![name],
        RegionExpr::Picked { of: None, .. } => Vec::new(),
        RegionExpr::Interface { from, to, .. } => vec![from, to],
        RegionExpr::Along { surface, .. } => vec![surface],
        RegionExpr::Combine(first, rest) => {
            parts(first).into_iter().chain(rest.iter().flat_map(|(_, r)| parts(r))).collect()
        }
    }
}

/// Points in each direction of an entity, by its dimension: shares are right to a few hundredths of an entity ...
const GRID: [usize; 4] = [1, 400, 30, 14];
/// ... unless more than so many points are needed for all of them, whose errors then cancel.
const POINTS: usize = 200_000;
/// Points on an edge.
const EDGE_POINTS: u32 = 64;
/// Points in each direction at least.
const FEW: usize = 3;

/// Where a condition holds, and what was taken.
struct Cut {
    /// Faces or cells that are cut.
    n: usize,
    /// The size of what is taken, of what of it lies outside the condition, and of what is inside and not taken.
    taken: f64,
    outside: f64,
    missed: f64,
    /// Faces of which only the border is outside.
    borders: bool,
    /// Bounds of the faces that are taken, and of those that are left out.
    bounds: [Bounds; 2],
}

/// Lowest and highest coordinates.
#[derive(Clone, Copy)]
struct Bounds([f64; 3], [f64; 3]);

impl Bounds {
    const NONE: Self = Self([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);

    fn add(&mut self, x: [f64; 3]) {
        for ((low, high), x) in self.0.iter_mut().zip(&mut self.1).zip(x) {
            (*low, *high) = (low.min(x), high.max(x));
        }
    }
}

/// W419 for a condition that cuts faces or cells among the candidates, of which some were taken.
pub(super) fn told(
    mesh: &Mesh,
    candidates: &RegionSet,
    taken: &RegionSet,
    holds: &mut dyn FnMut([f64; 3]) -> bool,
    place: (Span, Counted),
) -> Option<Diagnostic> {
    let (span, counted) = place;
    if counted == Counted::No {
        return None;
    }
    let mut looker =
        Looker { mesh, holds, counted, most: POINTS, nodes: vec![None; mesh.n_nodes()], tables: BTreeMap::new() };
    let (cut, one, rule) = match (candidates, taken) {
        (RegionSet::Cells(all), RegionSet::Cells(taken)) if !taken.is_empty() => {
            (looker.cells(all, taken)?, "cell", "a cell is taken where its centre fulfils it")
        }
        (RegionSet::Facets(all), RegionSet::Facets(taken)) if !taken.is_empty() && mesh.dim() > 1 => {
            (looker.faces(all, taken)?, "face", "a face is taken where its corners and its centre fulfil it")
        }
        (RegionSet::Edges(all), RegionSet::Edges(taken)) if !taken.is_empty() && mesh.dim() > 2 => {
            (looker.edges(all, taken)?, "edge", "an edge is taken where its ends and its middle fulfil it")
        }
        _ => return None,
    };
    Some(message(mesh, &cut, one, rule, span))
}

fn message(mesh: &Mesh, cut: &Cut, one: &str, rule: &str, span: Span) -> Diagnostic {
    let there = cut.taken - cut.outside + cut.missed;
    let many = if cut.n == 1 { format!("1 {one}") } else { format!("{} {one}s", cut.n) };
    let size = percent((cut.taken - there).abs() / there);
    let text = if one != "cell" {
        let what = if one == "face" { "area" } else { "length" };
        format!("this condition cuts {many}: {size} of the {what} where it holds is left out")
    } else if (cut.taken - there).abs() >= Counted::Fully.size() * there {
        let word = if cut.taken > there { "more" } else { "less" };
        format!("this condition cuts {many}: the cells taken have {size} {word} than where it holds")
    } else {
        let part = percent((cut.outside + cut.missed) / there);
        format!("this condition cuts {many}: {part} of where it holds is on its other side")
    };
    let d = Diagnostic::new(Code::W419, text).at(span, rule);
    let [taken, held] = &cut.bounds;
    let differs = |d: usize| (taken.0[d] - held.0[d]).abs().max((taken.1[d] - held.1[d]).abs());
    let axis = (0..mesh.dim()).max_by(|a, b| differs(*a).total_cmp(&differs(*b))).unwrap_or(0);
    let name = ["x", "y", "z"][axis];
    let d = if one != "cell" {
        d.note(format!("what is taken spans {name} = {} to {}", short(taken.0[axis]), short(taken.1[axis])))
    } else {
        d
    };
    match (one, cut.borders) {
        ("face", true) => d.help(
            "only corners are outside: write <= or >= in place of < or >; all faces but some are boundary - some",
        ),
        _ => d.help(
            "end the condition on lines of the mesh, or put lines where it ends; a coefficient may jump inside \
                     a cell: if x < 0.9 then a else b",
        ),
    }
}

/// Four digits of a number.
fn short(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}

/// A part in two digits, as sums over points have them.
fn percent(x: f64) -> String {
    let rounded: f64 = format!("{:.1e}", 100.0 * x).parse().unwrap_or(x);
    format!("{rounded} %")
}

struct Looker<'a> {
    mesh: &'a Mesh,
    holds: &'a mut dyn FnMut([f64; 3]) -> bool,
    counted: Counted,
    /// Points for each entity.
    most: usize,
    /// By node whether the condition holds there, once it was asked.
    nodes: Vec<Option<bool>>,
    /// Points and weights by kind.
    tables: BTreeMap<CellKind, (Table, Vec<f64>)>,
}

impl Looker<'_> {
    fn at_node(&mut self, node: NodeId) -> bool {
        if let Some(known) = self.nodes[node.index()] {
            return known;
        }
        let found = (self.holds)(self.mesh.node(node));
        self.nodes[node.index()] = Some(found);
        found
    }

    /// The part of an entity in which the condition holds.
    fn share(&mut self, kind: CellKind, point: &dyn Fn(&Table, usize) -> [f64; 3]) -> f64 {
        let Self { mesh, holds, tables, most, .. } = self;
        let (table, weights) = tables.entry(kind).or_insert_with(|| {
            let dim = u32::try_from(kind.dim()).unwrap_or(0);
            let n = (FEW..=GRID[kind.dim()].max(FEW)).rev().find(|n| n.pow(dim) <= *most).unwrap_or(FEW);
            let (points, weights) = grid(kind, n);
            (mesh.geometry_element(kind).tabulate(&points, 0), weights)
        });
        let mut inside = 0.0;
        for (k, weight) in weights.iter().enumerate() {
            if holds(point(table, k)) {
                inside += weight;
            }
        }
        inside / weights.iter().sum::<f64>()
    }

    fn cells(&mut self, all: &[CellId], taken: &[CellId]) -> Option<Cut> {
        let mesh = self.mesh;
        let mut cut = Cut::new();
        let mut mixed: Vec<(CellId, bool)> = Vec::new();
        for cell in all {
            let is_taken = taken.binary_search(cell).is_ok();
            if mesh.cell_vertices(*cell).iter().any(|node| self.at_node(*node) != is_taken) {
                mixed.push((*cell, is_taken));
            }
        }
        self.most = POINTS / mixed.len().max(1);
        let mut cut_cells: Vec<(CellId, f64, bool)> = Vec::new();
        for (cell, is_taken) in mixed {
            let point = |table: &Table, k: usize| mesh.point_at(cell, table, k);
            let share = self.share(mesh.kind(cell), &point);
            if share > 0.0 && !is_taken || share < 1.0 && is_taken {
                cut_cells.push((cell, share, is_taken));
            }
        }
        if cut_cells.is_empty() {
            return None;
        }
        cut.taken = cell_volumes(mesh, taken).iter().sum();
        cut.n = cut_cells.len();
        let volumes = cell_volumes(mesh, &cut_cells.iter().map(|c| c.0).collect::<Vec<_>>());
        for ((_, share, is_taken), volume) in cut_cells.into_iter().zip(volumes) {
            if is_taken { cut.outside += (1.0 - share) * volume } else { cut.missed += share * volume }
        }
        let there = cut.taken - cut.outside + cut.missed;
        let (size, content) = ((cut.missed - cut.outside).abs(), cut.outside + cut.missed);
        let counts = size >= self.counted.size() * there || content >= self.counted.content() * there;
        (counts && there > 0.0).then_some(cut)
    }

    fn edges(&mut self, all: &[FaceEdge], taken: &[FaceEdge]) -> Option<Cut> {
        let mesh = self.mesh;
        let ends = |edge: FaceEdge| [0, 1].map(|k| mesh.node(mesh.edge_ends(edge)[k]));
        let mut cut = Cut::new();
        let mut left_out: Vec<(FaceEdge, f64)> = Vec::new();
        // what meets an edge that is taken at an angle is not wanted, as of faces
        for edge in all.iter().filter(|e| taken.binary_search(e).is_err()) {
            let goes_on = |other: &FaceEdge| {
                let shared = mesh.edge_ends(*other).iter().any(|node| mesh.edge_ends(*edge).contains(node));
                shared && are_along(ends(*edge), ends(*other))
            };
            if !taken.iter().any(goes_on) {
                continue;
            }
            let inside = (0..EDGE_POINTS).filter(|k| {
                let [a, b] = ends(*edge);
                let s = (f64::from(*k) + 0.5) / f64::from(EDGE_POINTS);
                (self.holds)([0, 1, 2].map(|d| a[d] + s * (b[d] - a[d])))
            });
            let share = inside.count() as f64 / f64::from(EDGE_POINTS);
            if share >= SLIVER {
                left_out.push((*edge, share));
            }
        }
        cut.n = left_out.len();
        cut.taken = edge_lengths(mesh, taken).iter().sum();
        cut.borders = left_out.iter().all(|(_, share)| *share >= WHOLE);
        let lengths = edge_lengths(mesh, &left_out.iter().map(|e| e.0).collect::<Vec<_>>());
        cut.missed = left_out.iter().zip(lengths).map(|((_, share), length)| share * length).sum();
        taken.iter().flat_map(|edge| ends(*edge)).for_each(|x| cut.bounds[0].add(x));
        left_out.iter().flat_map(|(edge, _)| ends(*edge)).for_each(|x| cut.bounds[1].add(x));
        (cut.n > 0 && cut.missed >= self.counted.size() * (cut.taken + cut.missed)).then_some(cut)
    }

    fn faces(&mut self, all: &[FacetRef], taken: &[FacetRef]) -> Option<Cut> {
        let mesh = self.mesh;
        let mut cut = Cut::new();
        let mut mixed: Vec<FacetRef> = Vec::new();
        for facet in all.iter().filter(|f| taken.binary_search(f).is_err()) {
            if mesh.facet_vertices(*facet).vertices().iter().any(|node| self.at_node(*node)) {
                mixed.push(*facet);
            }
        }
        self.most = POINTS / mixed.len().max(1);
        let mut left_out: Vec<(FacetRef, f64)> = Vec::new();
        for facet in mixed {
            let point = |table: &Table, k: usize| mesh.facet_point_at(facet, table, k);
            let share = self.share(mesh.facet_kind(facet), &point);
            if share >= SLIVER {
                left_out.push((facet, share));
            }
        }
        let left_out = of_one_surface(mesh, taken, left_out);
        if left_out.is_empty() {
            return None;
        }
        cut.n = left_out.len();
        cut.taken = facet_measures(mesh, taken).iter().sum();
        cut.borders = left_out.iter().all(|(_, share)| *share >= WHOLE);
        let measures = facet_measures(mesh, &left_out.iter().map(|f| f.0).collect::<Vec<_>>());
        cut.missed = left_out.iter().zip(measures).map(|((_, share), measure)| share * measure).sum();
        let nodes = taken.iter().flat_map(|f| mesh.facet_vertices(*f).vertices().to_vec());
        nodes.for_each(|node| cut.bounds[0].add(mesh.node(node)));
        for (facet, _) in &left_out {
            mesh.facet_vertices(*facet).vertices().iter().for_each(|node| cut.bounds[1].add(mesh.node(*node)));
        }
        (cut.missed >= self.counted.size() * (cut.taken + cut.missed)).then_some(cut)
    }
}

impl Cut {
    fn new() -> Self {
        Self { n: 0, taken: 0.0, outside: 0.0, missed: 0.0, borders: false, bounds: [Bounds::NONE; 2] }
    }
}

/// Of the faces that are left out those that continue what is taken, without a corner between them: a band around a
/// surface also holds parts of faces that meet it at an angle, and nobody wants these.
fn of_one_surface(mesh: &Mesh, taken: &[FacetRef], mut left_out: Vec<(FacetRef, f64)>) -> Vec<(FacetRef, f64)> {
    let sides = |facet: FacetRef| {
        let corners = mesh.facet_vertices(facet);
        corners.vertices().iter().map(|node| node.index()).collect::<Vec<_>>()
    };
    let mut concerned = vec![false; mesh.n_nodes()];
    left_out.iter().flat_map(|(facet, _)| sides(*facet)).for_each(|node| concerned[node] = true);
    let near = taken.iter().filter(|f| sides(**f).iter().any(|node| concerned[*node]));
    let mut front: Vec<FacetRef> = near.copied().collect();
    let mut found = Vec::new();
    while !front.is_empty() {
        let mut by_node: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (k, facet) in front.iter().enumerate() {
            sides(*facet).into_iter().for_each(|node| by_node.entry(node).or_default().push(k));
        }
        let continues = |facet: FacetRef| {
            let mut met: Vec<usize> = sides(facet).iter().filter_map(|n| by_node.get(n)).flatten().copied().collect();
            met.sort_unstable();
            let shared = |k: usize| met.iter().filter(|m| **m == k).count();
            met.iter().any(|k| shared(*k) + 1 >= mesh.dim() && smooth(mesh, front[*k], facet))
        };
        let (more, rest): (Vec<_>, Vec<_>) = left_out.into_iter().partition(|(facet, _)| continues(*facet));
        front = more.iter().map(|(facet, _)| *facet).collect();
        found.extend(more);
        left_out = rest;
    }
    found
}

/// Whether two edges lie nearly along one line.
fn are_along(one: [[f64; 3]; 2], other: [[f64; 3]; 2]) -> bool {
    let [a, b] = [one, other].map(|[from, to]| [0, 1, 2].map(|d| to[d] - from[d]));
    let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    dot(a, b).abs() >= SMOOTH * (dot(a, a) * dot(b, b)).sqrt()
}

/// Whether two faces lie in nearly one plane.
fn smooth(mesh: &Mesh, a: FacetRef, b: FacetRef) -> bool {
    let [n, m] = [a, b].map(|facet| normal(mesh, facet));
    let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    dot(n, m).abs() >= SMOOTH * (dot(n, n) * dot(m, m)).sqrt()
}

/// A normal of a face, of any length.
fn normal(mesh: &Mesh, facet: FacetRef) -> [f64; 3] {
    let corners = mesh.facet_vertices(facet);
    let x: Vec<[f64; 3]> = corners.vertices().iter().map(|node| mesh.node(*node)).collect();
    let along = |k: usize| [0, 1, 2].map(|d| x[k][d] - x[0][d]);
    let a = along(1);
    if mesh.dim() < 3 {
        return [-a[1], a[0], 0.0];
    }
    let b = along(2);
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Points inside a reference entity and the parts of it that they stand for: the centres of a grid of boxes that is
/// folded onto it.
fn grid(kind: CellKind, n: usize) -> (Vec<[f64; 3]>, Vec<f64>) {
    let (dim, mut points, mut weights) = (kind.dim(), Vec::new(), Vec::new());
    #[expect(clippy::cast_precision_loss, reason = "a few points")]
    let at = |k: usize| (k as f64 + 0.5) / n as f64;
    for k in 0..n.pow(u32::try_from(dim).unwrap_or(0)) {
        let [u, v, w] = [k % n, k / n % n, k / (n * n)].map(at);
        let (point, weight) = kind.folded([u, v, w]);
        points.push(point);
        weights.push(weight);
    }
    (points, weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_points_of_a_grid_stand_for_the_whole_entity() {
        // the centroid of an entity is the mean of its points
        for kind in CellKind::ALL.into_iter().filter(|k| k.dim() > 0) {
            let (points, weights) = grid(kind, GRID[kind.dim()]);
            let total: f64 = weights.iter().sum();
            let centre = kind.reference_centre();
            for d in 0..kind.dim() {
                let mean = points.iter().zip(&weights).map(|(x, w)| w * x[d]).sum::<f64>() / total;
                assert!((mean - centre[d]).abs() < 5e-3, "{kind:?}: {mean} {}", centre[d]);
            }
        }
    }
}
