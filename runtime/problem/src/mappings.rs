//! Mappings: for each integration point another point of the mesh, where `Interpolate` evaluates fields.
//!
//! The images are computed once, on the initial mesh (small sliding), so the tangents of mapped values are exact. A
//! point without an image is not integrated; W406 reports their number, and a term without any image is an error. Images
//! of a mapping that moves with displacements are found in each state (`discrete/src/domain/moving.rs`), and its points may
//! come and go.

use std::{collections::BTreeSet, sync::Arc};

use wfl::{
    Code, Diagnostic, ResolvedScript, Span,
    ast::{Expansions, Expr, Ident, MappingKind},
};
use wfl_compiler::{
    backend::KernelBackend,
    compile_value,
    types::{BasisSlot, FieldId, ImageBy, InputSlot, MappingSig, Moves, Side},
    without_fields,
};
use wfl_discrete::{
    assemble::{Cut, Domain, Follows, ImageSearch, MovingPoints},
    field::{Field, FieldSpace},
    finite::{BadGiven, NotFinite},
    space::Support,
    value::Value,
};
use wfl_mesh::{
    mesh::{CellFinder, CellId, FacetFinder, FacetRef, Mesh, RegionSet, SupportSet},
    quadrature::QuadratureError,
};

use crate::{Parts, constants::number, mesh::position_place};

/// Message about a mapping that depends on the unknowns or the step.
const FIXED_IMAGES: &str =
    "a mapping depends on x, y, z only: images are found once, on the mesh as it is (small sliding)";

/// How images are found.
enum Search {
    /// At a position, by a formula that stands here.
    Position(Box<Value>, Span),
    /// On facets: the nearest point, or where the normal hits them.
    Facets { raytrace: bool, from: BTreeSet<FacetRef>, finder: FacetFinder, reach: f64 },
    /// On facets that follow the bodies, from points that do.
    Moving { from: BTreeSet<FacetRef>, onto: Vec<FacetRef>, moves: Moves, reach: f64 },
}

/// Where the scene declares a mapping whose images follow the bodies.
#[must_use]
pub fn place_of_moving(script: &ResolvedScript) -> Option<Span> {
    let moves = |kind: &MappingKind| matches!(kind, MappingKind::Search { moving, .. } if !moving.is_empty());
    script.mappings.iter().find(|m| moves(&m.kind)).map(|m| m.name.span)
}

/// The mappings of a scene.
#[derive(Default)]
pub(super) struct Mappings {
    list: Vec<(Ident, Search)>,
    expansions: Expansions,
    /// What the compiler knows of them.
    pub(super) sigs: Vec<MappingSig>,
}

/// What mappings are made from.
pub(super) struct MappingMaker<'a> {
    pub(super) parts: Parts<'a>,
    pub(super) backend: &'a dyn KernelBackend,
    pub(super) diagnostics: &'a mut Vec<Diagnostic>,
}

impl MappingMaker<'_> {
    /// All mappings, without those that have a message.
    pub(super) fn make(mut self) -> Mappings {
        let mut made = Mappings { expansions: self.parts.script.expansions.clone(), ..Mappings::default() };
        for mapping in &self.parts.script.mappings {
            let search = match &mapping.kind {
                MappingKind::Point(e) => self.position(e),
                MappingKind::Search { raytrace, from, onto, moving, within } => {
                    let ends = [from, onto];
                    let by = if *raytrace { ImageBy::Ray } else { ImageBy::Closest };
                    match moving.as_slice() {
                        [] => self.search(*raytrace, ends, within.as_ref()),
                        [one] => self.moving(by, ends, [one, one], within.as_ref()),
                        [here, there, ..] => self.moving(by, ends, [here, there], within.as_ref()),
                    }
                }
            };
            let Some(search) = search else { continue };
            let name = mapping.name.name.clone();
            made.sigs.push(match &search {
                Search::Position(..) => MappingSig {
                    description: format!("`{name}` leads to points inside cells"),
                    there: self.parts.fields.iter().map(|f| is_global(f) || cells_of(f).is_some()).collect(),
                    has_normal: false,
                    moves: None,
                    name,
                },
                Search::Facets { finder, .. } => self.onto_facets(name, finder.facets(), None),
                Search::Moving { onto, moves, .. } => self.onto_facets(name, onto, Some(*moves)),
            });
            made.list.push((mapping.name.clone(), search));
        }
        made
    }

    /// What the compiler knows of a mapping onto facets.
    fn onto_facets(&self, name: String, facets: &[FacetRef], moves: Option<Moves>) -> MappingSig {
        let inside = |f: &Field| facets.iter().all(|facet| f.lives_in_cell(facet.cell));
        let lives = |f: &Field| is_global(f) || (cells_of(f).is_some() && inside(f));
        MappingSig {
            description: format!("`{name}` leads to {} faces", facets.len()),
            there: self.parts.fields.iter().map(lives).collect(),
            has_normal: true,
            moves,
            name,
        }
    }

    fn position(&mut self, e: &Expr) -> Option<Search> {
        let place = position_place(self.parts.fields.len());
        let law = compile_value(self.parts.env, &place, "a mapping", e);
        self.diagnostics.extend(law.diagnostics.into_iter().map(|d| without_fields(d, Code::E407, FIXED_IMAGES)));
        let law = law.value?;
        let dim = self.parts.mesh.dim();
        if law.shape.len() != dim {
            let d =
                Diagnostic::new(Code::E108, format!("a mapping gives {dim} coordinates here, found a {}", law.shape));
            self.diagnostics.push(wfl::at_expr(d, e, self.parts.env.expansions, law.shape.to_string()));
            return None;
        }
        match Value::new(law, self.backend) {
            Ok(v) if v.reads_positions_only() => Some(Search::Position(Box::new(v), e.span)),
            Ok(_) => {
                self.diagnostics.push(Diagnostic::new(Code::E407, FIXED_IMAGES).at(e.span, ""));
                None
            }
            Err(error) => {
                self.diagnostics.push(Diagnostic::new(Code::E609, error.to_string()).at(e.span, ""));
                None
            }
        }
    }

    fn search(&mut self, raytrace: bool, [from, onto]: [&Ident; 2], within: Option<&Expr>) -> Option<Search> {
        let (from, onto) = (self.facets(from)?, self.facets(onto)?);
        let reach = self.reach(within)?;
        let from = from.into_iter().collect();
        Some(Search::Facets { raytrace, from, finder: FacetFinder::new(self.parts.mesh, &onto), reach })
    }

    /// The longest distance to an image.
    fn reach(&mut self, within: Option<&Expr>) -> Option<f64> {
        let Some(e) = within else { return Some(f64::INFINITY) };
        let d = number(self.parts.env, "a distance", e, self.diagnostics)?;
        if d < 0.0 || d.is_nan() {
            let m = Diagnostic::new(Code::E419, format!("nothing is within a distance of {d}"));
            self.diagnostics.push(m.at(e.span, ""));
            return None;
        }
        Some(d)
    }

    /// A mapping whose images follow the bodies.
    fn moving(
        &mut self,
        by: ImageBy,
        [from, onto]: [&Ident; 2],
        [here, there]: [&Ident; 2],
        within: Option<&Expr>,
    ) -> Option<Search> {
        let (facets, targets) = (self.facets(from)?, self.facets(onto)?);
        let reach = self.reach(within)?;
        if let Some(e) = within.filter(|_| reach == 0.0) {
            let d = Diagnostic::new(Code::E419, "no image that moves is within a distance of 0");
            self.diagnostics.push(d.at(e.span, "longer than gaps and overlaps of contact"));
            return None;
        }
        if self.parts.mesh.dim() < 2 {
            let d = Diagnostic::new(Code::E802, "a mapping that moves on a line is not available yet");
            self.diagnostics.push(d.help("the end of a bar meets a formula of x + u").at(from.span, ""));
            return None;
        }
        let sources: BTreeSet<FacetRef> = facets.iter().copied().collect();
        if within.is_none() && targets.iter().any(|facet| sources.contains(facet)) {
            let d = Diagnostic::new(Code::E419, "a surface that is mapped onto itself needs `within`");
            let d = d.help("a distance longer than gaps and overlaps of contact: `moving with u within 0.1`");
            self.diagnostics.push(d.at(onto.span, "far faces of the same body would be images, too"));
            return None;
        }
        let here = self.displacement(here, &facets, from)?;
        let there = self.displacement(there, &targets, onto)?;
        Some(Search::Moving { from: sources, onto: targets, moves: Moves { by, here, there }, reach })
    }

    /// The field of a displacement that lives in the cells behind some faces.
    fn displacement(&mut self, name: &Ident, facets: &[FacetRef], region: &Ident) -> Option<FieldId> {
        let at = self.parts.fields.iter().position(|f| f.name == name.name)?;
        let (field, dim) = (&self.parts.fields[at], self.parts.mesh.dim());
        if field.n_components != dim || cells_of(field).is_none() {
            let d = Diagnostic::new(
                Code::E108,
                format!("a mapping moves with a displacement: a vector of {dim} components on cells"),
            );
            self.diagnostics.push(d.at(name.span, format!("`{}` is none", name.name)));
            return None;
        }
        if facets.iter().any(|facet| !field.lives_in_cell(facet.cell)) {
            let d = Diagnostic::new(
                Code::E202,
                format!("`{}` does not live behind all faces of `{}`", name.name, region.name),
            );
            let d = d.help(
                "moving with u1, u2 names the displacement behind the points first, then that behind their images",
            );
            self.diagnostics.push(d.at(name.span, "").at(region.span, "faces of these cells"));
            return None;
        }
        Some(FieldId::new(at))
    }

    fn facets(&mut self, name: &Ident) -> Option<Vec<FacetRef>> {
        match &self.parts.regions.get(&name.name)?.set {
            RegionSet::Facets(f) => Some(f.clone()),
            RegionSet::Interface(i) => Some(i.iter().map(|p| p.here).collect()),
            other => {
                let d = Diagnostic::new(Code::E405, format!("`{}` is a region of {}", name.name, other.kind()));
                self.diagnostics.push(d.at(name.span, "points are mapped from faces onto faces"));
                None
            }
        }
    }
}

fn is_global(field: &Field) -> bool {
    matches!(field.space, FieldSpace::Global)
}

/// The cells on which a field lives.
fn cells_of(field: &Field) -> Option<&[CellId]> {
    match &field.space {
        FieldSpace::Nodal(space) => match space.support() {
            Support::Cells(cells) => Some(cells),
            Support::Facets(_) | Support::Edges(_) => None,
        },
        _ => None,
    }
}

/// The fields that a law reads or tests at the images, sorted.
pub(super) fn fields_there<'s>(inputs: &[InputSlot], others: impl IntoIterator<Item = &'s BasisSlot>) -> Vec<usize> {
    let read = inputs.iter().filter_map(|s| match s {
        InputSlot::Field(b) | InputSlot::Previous(b) | InputSlot::History(_, b) => Some(*b),
        _ => None,
    });
    let all = read.chain(others.into_iter().copied()).filter(|b| b.side == Side::There);
    let mut fields: Vec<usize> = all.map(|b| b.field.index()).collect();
    fields.sort_unstable();
    fields.dedup();
    fields
}

/// The mapping that a law reads through, and the fields that it reads at the images.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Through {
    pub(super) mapping: usize,
    pub(super) there: Vec<usize>,
    /// Faces are cut by those that the mapping leads to: the degree of the rule on each piece.
    pub(super) pieces: Option<usize>,
}

impl Mappings {
    /// Where a mapping leads from `x`: the nearest point of faces; `None` where there is none.
    pub(super) fn image(&self, mapping: usize, mesh: &Mesh, x: [f64; 3]) -> Option<[f64; 3]> {
        match &self.list.get(mapping)?.1 {
            Search::Position(value, _) => {
                let y = value.at_positions(&[x]).ok()?;
                Some([0, 1, 2].map(|d| y.get(d).copied().unwrap_or(0.0)))
            }
            // another one in each state
            Search::Moving { .. } => None,
            Search::Facets { finder, reach, .. } => {
                let image = finder.nearest(mesh, x, *reach)?;
                let table = mesh.geometry_element(mesh.kind(image.cell)).tabulate(&[image.reference], 0);
                Some(mesh.point_at(image.cell, &table, 0))
            }
        }
    }

    /// Whether all faces of a support are among those that a mapping onto faces begins on; one by a formula begins anywhere.
    pub(super) fn begins_on(&self, mapping: usize, support: &SupportSet) -> bool {
        let from = match self.list.get(mapping).map(|m| &m.1) {
            Some(Search::Facets { from, .. } | Search::Moving { from, .. }) => from,
            _ => return true,
        };
        match support {
            SupportSet::Cells(_) | SupportSet::Edges(_) => false,
            SupportSet::Facets(facets) => facets.iter().all(|f| from.contains(f)),
            SupportSet::Interface(pairs) => pairs.iter().all(|p| from.contains(&p.here)),
        }
    }

    /// The domain of a law through a mapping: the points of `base` with their images, found where the fields live that the
    /// law reads there; `None` after a message.
    pub(super) fn domain(
        &self,
        through: &Through,
        mesh: &Mesh,
        fields: &[Field],
        base: &Domain,
        span: Span,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Option<Arc<Domain>> {
        let (name, search) = &self.list[through.mapping];
        let (domain, lost) = match search {
            Search::Position(value, formula) => {
                let homes: Vec<&Field> =
                    through.there.iter().filter_map(|k| fields.get(*k)).filter(|f| !is_global(f)).collect();
                match at_positions(mesh, base, value, &homes) {
                    Ok(mapped) => mapped,
                    Err(at) => {
                        let bad = BadGiven { what: format!("the mapping `{}`", name.name), span: *formula, at };
                        diagnostics.push(bad.diagnostic(&self.expansions, None));
                        return None;
                    }
                }
            }
            Search::Moving { from, onto, moves, reach } => {
                if let Some(d) = not_mapped(base, from, name, span) {
                    diagnostics.push(d);
                    return None;
                }
                let search = ImageSearch { by: moves.by, reach: *reach, pieces: through.pieces };
                return moving_points(mesh, fields, base, onto, *moves, search).or_else(|| {
                    diagnostics.push(no_faces(name, span));
                    None
                });
            }
            Search::Facets { raytrace, from, finder, reach } => {
                if let Some(d) = not_mapped(base, from, name, span) {
                    diagnostics.push(d);
                    return None;
                }
                let cut = Cut { onto: finder.facets(), reach: *reach, is_facing: *raytrace, degree: 0 };
                let cut = through.pieces.map(|degree| Domain::segments(mesh, base, Cut { degree, ..cut })).transpose();
                let Ok(cut) = cut.map_err(|e| diagnostics.push(no_rule(&e, span))) else { return None };
                Domain::mapped(mesh, cut.as_ref().unwrap_or(base), |x, normal| match (raytrace, normal) {
                    (true, Some(n)) => finder.hit(mesh, x, n, *reach),
                    _ => finder.nearest(mesh, x, *reach),
                })
            }
        };
        let total = lost + domain.groups.iter().map(|g| g.n_points() * g.entities.len()).sum::<usize>();
        if domain.groups.is_empty() {
            let d = Diagnostic::new(Code::E419, format!("no point has an image under `{}`", name.name));
            let d = d.help("`within` is the longest distance; a `point` must lie in a cell where the fields live");
            diagnostics.push(d.at(span, format!("{total} points here")).at(name.span, "declared here"));
            return None;
        }
        if lost > 0 {
            diagnostics.push(not_all([lost, total], name, span));
        }
        Some(Arc::new(domain))
    }
}

/// The points of a place with the images that a formula gives, found where these fields live, and how many have none.
fn at_positions(
    mesh: &Mesh,
    base: &Domain,
    value: &Value,
    homes: &[&Field],
) -> Result<(Domain, usize), Box<NotFinite>> {
    let cells: Vec<CellId> = mesh.cells().filter(|c| homes.iter().all(|f| f.lives_in_cell(*c))).collect();
    let finder = CellFinder::new(mesh, &cells);
    let mut bad = None;
    let mapped = Domain::mapped(mesh, base, |x, _| match value.at_positions(&[x]) {
        Ok(y) => finder.find(mesh, [0, 1, 2].map(|d| y.get(d).copied().unwrap_or(0.0))),
        Err(at) => {
            bad.get_or_insert(at);
            None
        }
    });
    bad.map_or(Ok(mapped), |at| Err(Box::new(at)))
}

/// The points of a place whose images follow two displacements, with those of the bodies at rest.
fn moving_points(
    mesh: &Mesh,
    fields: &[Field],
    base: &Domain,
    onto: &[FacetRef],
    moves: Moves,
    search: ImageSearch,
) -> Option<Arc<Domain>> {
    let follows = |field: FieldId| match &fields[field.index()].space {
        FieldSpace::Nodal(space) => Some(Follows { field: field.index(), space: Arc::clone(space) }),
        FieldSpace::Global | FieldSpace::Points(_) => None,
    };
    let bodies = [follows(moves.here)?, follows(moves.there)?];
    let points = MovingPoints::new(mesh, base, onto, bodies, search)?;
    Some(Arc::new(points).at(mesh, &[]))
}

/// The message about points that have no image, so many of all.
fn not_all([lost, total]: [usize; 2], name: &Ident, span: Span) -> Diagnostic {
    let d = Diagnostic::new(Code::W406, format!("{lost} of {total} points have no image under `{}`", name.name));
    d.at(span, "the term is not integrated there").at(name.span, "declared here")
}

/// The message about a rule that there is none of.
fn no_rule(error: &QuadratureError, span: Span) -> Diagnostic {
    Diagnostic::new(Code::E411, error.to_string()).at(span, "")
}

/// The message about a mapping that moves without faces to lead to.
fn no_faces(name: &Ident, span: Span) -> Diagnostic {
    let d = Diagnostic::new(Code::E419, format!("no point has an image under `{}`", name.name));
    d.at(span, "").at(name.span, "it leads to no faces, or to cells without a volume")
}

/// The message about a place with points that a mapping from these faces does not map.
fn not_mapped(base: &Domain, from: &BTreeSet<FacetRef>, name: &Ident, span: Span) -> Option<Diagnostic> {
    let outside = base.groups.iter().flat_map(|g| &g.here.facets).any(|f| !from.contains(f));
    if !outside && base.groups.iter().all(|g| !g.here.facets.is_empty()) {
        return None;
    }
    let d = Diagnostic::new(Code::E203, format!("`{}` does not map the points of this place", name.name));
    Some(d.at(span, "only faces behind `from` have images").at(name.span, "declared here"))
}

/// A line, a node or a point of a series cannot follow a mapping: it is no integration point.
pub(super) fn refused(mapping: Option<usize>, what: &str, span: Span) -> Option<Diagnostic> {
    mapping?;
    let d = Diagnostic::new(Code::E802, format!("{what} cannot read through a mapping"));
    Some(d.at(span, "a `measure` on a region can, and `output vtk` on faces"))
}
