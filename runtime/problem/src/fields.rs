//! Fields from their declarations: shapes, spaces on their regions, and what the compiler knows of them.

use wfl::{
    Code, Diagnostic, FieldKind as Declared, ResolvedScript,
    ast::{Expr, Ident, Place, Rank},
};
use wfl_compiler::{
    Env,
    types::{FieldKind, FieldSig, PlaceKind, PlaceSig, Shape},
};
use wfl_discrete::{
    assemble::{Domain, entity_geometries},
    field::{Field, FieldSpace},
    point_space::PointSpace,
    space::{Space, SpacePart, Support},
};
use wfl_mesh::{
    element::{ElementError, Family},
    mesh::{FaceEdge, FacetRef, Mesh, Polynomials, RegionSet, Topology},
    quadrature::vertex,
};

use crate::{
    constants::number,
    regions::{NamedRegion, Regions},
};

/// An element that no text of a scene can name: `degree 2` is continuous of this degree on whatever cells there are. What
/// changes the degree of fields without a written element writes it.
pub const ON_ANY_CELLS: &str = "degree ";

/// Fields and their signatures, by position.
pub(super) struct Fields {
    pub(super) fields: Vec<Field>,
    pub(super) sigs: Vec<FieldSig>,
}

/// Makes the fields of a scene.
pub(super) struct FieldMaker<'a> {
    pub(super) script: &'a ResolvedScript,
    pub(super) env: &'a Env<'a>,
    pub(super) mesh: &'a Mesh,
    pub(super) topology: &'a Topology,
    pub(super) regions: &'a Regions,
    pub(super) diagnostics: &'a mut Vec<Diagnostic>,
}

impl FieldMaker<'_> {
    /// All fields; `parts` has their spaces by field where this rank has a part of the mesh alone. `None` after a message.
    pub(super) fn make(mut self, parts: Option<Vec<Option<SpacePart>>>) -> Option<Fields> {
        let (mut fields, mut sigs) = (Vec::new(), Vec::new());
        let mut complete = true;
        let mut parts = parts.unwrap_or_default().into_iter();
        for declared in &self.script.fields {
            match self.field(declared, parts.next().flatten()) {
                Some((field, sig)) => {
                    fields.push(field);
                    sigs.push(sig);
                }
                None => complete = false,
            }
        }
        complete.then_some(Fields { fields, sigs })
    }

    fn field(&mut self, declared: &wfl::Field, part: Option<SpacePart>) -> Option<(Field, FieldSig)> {
        let name = declared.name.name.clone();
        let kind = kind(&declared.kind);
        let shape = shape(&declared.space.rank, self.env, self.diagnostics)?;
        let global = matches!(declared.space.place, Place::Global(_));
        if global || kind == FieldKind::State {
            let space = match global {
                true => FieldSpace::Global,
                false => FieldSpace::Points(state_points(declared, self.mesh, self.regions, self.diagnostics)?),
            };
            let field = Field { name: name.clone(), kind, n_components: shape.len(), space };
            return Some((field, FieldSig { name, shape, degree: 0, kind, global, on_faces: false }));
        }
        let space = match part {
            Some(part) => self.told(Space::of_part(self.mesh, self.topology, part), declared)?,
            None => self.space(declared, &name)?,
        };
        let degree = space.degree();
        let on_faces = !matches!(space.support(), Support::Cells(_));
        let field =
            Field { name: name.clone(), kind, n_components: shape.len(), space: FieldSpace::Nodal(space.into()) };
        Some((field, FieldSig { name, shape, degree, kind, global: false, on_faces }))
    }

    /// The nodes of a field on the whole mesh.
    fn space(&mut self, declared: &wfl::Field, name: &str) -> Option<Space> {
        let (degree, family) = match &declared.space.element {
            None => (1, Family::Continuous),
            Some(word) => element(word, self.mesh, self.diagnostics)?,
        };
        let (mesh, topology) = (self.mesh, self.topology);
        let made = match support(&declared.space.place, &declared.name, self.regions, self.diagnostics)? {
            RegionSet::Cells(cells) => Space::on_cells(mesh, topology, &cells, degree, family),
            RegionSet::Facets(facets) => Space::on_facets(mesh, topology, &facets, degree, family),
            RegionSet::Interface(pairs) => {
                let facets: Vec<FacetRef> = pairs.iter().map(|p| p.here).collect();
                Space::on_facets(mesh, topology, &facets, degree, family)
            }
            RegionSet::Edges(edges) if !has_neighbours(&edges, mesh) => {
                if degree != 1 || family != Family::Continuous {
                    let text = "where faces end or cross a field is linear along the edges and has one value a node";
                    let d = Diagnostic::new(Code::E406, text).at(declared.space.span, "");
                    self.diagnostics.push(d.help("no element, or P1 (Q1 on quadrilaterals and hexahedra)"));
                    return None;
                }
                Space::on_edges(mesh, topology, &edges)
            }
            RegionSet::Edges(_) | RegionSet::Nodes(_) => {
                let text = "a field is defined on cells or faces, or where faces end or cross: not on nodes or between two faces";
                let d = Diagnostic::new(Code::E405, text);
                let help = "a field of faces has one value where they end or cross: on the surface itself, with `fix` or `load` on \
                            the region of nodes";
                self.diagnostics.push(d.at(declared.space.span, "").help(help));
                return None;
            }
        };
        let mut space = self.told(made, declared)?;
        // all tears at once: where one ends on another, three nodes are needed
        let facets = torn(self.script, name, topology, self.regions, self.diagnostics);
        if let Some(d) = untearable(self.script, name, &space).filter(|_| !facets.is_empty()) {
            self.diagnostics.push(d);
            return None;
        }
        if !facets.is_empty() {
            space.split(topology, &facets);
        }
        Some(space)
    }

    /// A space, or the message why there is none.
    fn told(&mut self, made: Result<Space, ElementError>, declared: &wfl::Field) -> Option<Space> {
        made.map_err(|e| self.diagnostics.push(Diagnostic::new(Code::E406, e.to_string()).at(declared.space.span, "")))
            .ok()
    }
}

fn kind(declared: &Declared) -> FieldKind {
    match declared {
        Declared::Unknown => FieldKind::Unknown,
        Declared::Multiplier { .. } => FieldKind::Multiplier,
        Declared::Data { .. } => FieldKind::Data,
        Declared::State { .. } => FieldKind::State,
    }
}

/// Where a state lives, with one point an entity: its true points follow from the terms that read it.
fn state_points(
    declared: &wfl::Field,
    mesh: &Mesh,
    regions: &Regions,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<PointSpace> {
    if let Some(element) = &declared.space.element {
        let d = Diagnostic::new(Code::E406, format!("a state has no element `{}`", element.name));
        diagnostics.push(d.at(element.span, "it has a value at each integration point, nothing between them"));
        return None;
    }
    let set = support(&declared.space.place, &declared.name, regions, diagnostics)?;
    let is_edges = matches!(set, RegionSet::Edges(_));
    match Domain::new(mesh, &set, &vertex) {
        Ok(domain) if !is_edges && !mesh.lacks(&domain.groups) => Some(PointSpace::new(mesh, &domain)),
        Ok(_) => {
            let d = Diagnostic::new(Code::E405, "a state is defined on cells or faces, not on nodes");
            diagnostics.push(d.at(declared.space.span, ""));
            None
        }
        Err(e) => {
            diagnostics.push(Diagnostic::new(Code::E409, e.to_string()).at(declared.space.span, ""));
            None
        }
    }
}

/// The inner faces along which `split` tears a field.
fn torn(
    script: &ResolvedScript,
    field: &str,
    topology: &Topology,
    regions: &Regions,
    diagnostics: &mut Vec<Diagnostic>,
) -> Vec<FacetRef> {
    let mut out = Vec::new();
    for split in script.splits.iter().filter(|s| s.fields.iter().any(|f| f.name == field)) {
        for place in &split.places {
            let Some(region) = regions.get(&place.name) else { continue };
            let facets: Vec<FacetRef> = match &region.set {
                RegionSet::Interface(pairs) => pairs.iter().map(|p| p.here).collect(),
                RegionSet::Facets(facets) => facets.clone(),
                _ => Vec::new(),
            };
            if facets.is_empty() || facets.iter().any(|f| topology.opposite(*f).is_none()) {
                let d = Diagnostic::new(Code::E405, format!("`{}` cannot be split across `{}`", field, place.name));
                let d = d.help("region crack = interface along s, where s is a surface inside the body");
                diagnostics.push(d.at(place.span, "inner faces of the body are needed, all of them between two cells"));
                continue;
            }
            out.extend(facets);
        }
    }
    out
}

/// Message about a field that cannot be split, at the statement.
fn untearable(script: &ResolvedScript, field: &str, space: &Space) -> Option<Diagnostic> {
    let text = match (space.support(), space.family()) {
        (Support::Facets(_), _) => "it is defined on faces: only fields on cells can be split",
        (_, Family::Discontinuous) => "its element is discontinuous across every face already",
        _ => return None,
    };
    let named = script.splits.iter().flat_map(|s| &s.fields).find(|f| f.name == field)?;
    Some(Diagnostic::new(Code::E405, format!("`{field}` cannot be split")).at(named.span, text))
}

pub(super) fn shape(rank: &Rank, env: &Env<'_>, diagnostics: &mut Vec<Diagnostic>) -> Option<Shape> {
    let mut size = |e: &Expr| -> Option<usize> {
        let x = number(env, "a size", e, diagnostics)?;
        if x.fract() != 0.0 || !(1.0..=100.0).contains(&x) {
            diagnostics.push(
                Diagnostic::new(Code::E108, format!("a size is a whole number from 1 to 100, found {x}"))
                    .at(e.span, ""),
            );
            return None;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
        Some(x as usize)
    };
    Some(match rank {
        Rank::Scalar => Shape::SCALAR,
        Rank::Vector(None) => Shape::vector(env.dim),
        Rank::Vector(Some(n)) => Shape::vector(size(n)?),
        Rank::Matrix(None) => Shape::matrix(env.dim, env.dim),
        Rank::Matrix(Some((m, n))) => Shape::matrix(size(m)?, size(n)?),
    })
}

/// `P2`, `DQ1`: the degree and whether neighbours share nodes; the letter must fit the cells.
fn element(word: &Ident, mesh: &Mesh, diagnostics: &mut Vec<Diagnostic>) -> Option<(usize, Family)> {
    if let Some(degree) = word.name.strip_prefix(ON_ANY_CELLS).and_then(|d| d.parse().ok()) {
        return Some((degree, Family::Continuous));
    }
    let (family, rest) = match word.name.strip_prefix('D') {
        Some(rest) => (Family::Discontinuous, rest),
        None => (Family::Continuous, word.name.as_str()),
    };
    let degree = rest.get(1..).and_then(|d| d.parse::<usize>().ok());
    // a mesh with both kinds of faces takes both letters: P_k on triangles, Q_k on quadrilaterals
    let only = |counted: Polynomials| mesh.kinds().iter().all(|k| k.polynomials() == counted);
    let tensors = only(Polynomials::Each);
    let fits = match rest.chars().next() {
        Some('P') => !tensors,
        Some('Q') => mesh.dim() == 1 || !only(Polynomials::Total),
        _ => false,
    };
    match degree {
        Some(degree) if fits || (degree == 0 && rest.starts_with(['P', 'Q'])) => Some((degree, family)),
        _ => {
            let cells = if tensors {
                "quadrilaterals or hexahedra: Q1, Q2, DQ0, ..."
            } else if only(Polynomials::Total) {
                "simplices: P1, P2, P3, DP0, ..."
            } else {
                "of several kinds: P1 or Q1, P2 or Q2, DP0, ..."
            };
            let d = Diagnostic::new(Code::E406, format!("no element `{}` on this mesh", word.name));
            diagnostics.push(d.at(word.span, format!("the cells are {cells}")));
            None
        }
    }
}

/// The entities of all the regions on which a field lives; `None` after a message.
pub(super) fn support(
    place: &Place,
    name: &Ident,
    regions: &Regions,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<RegionSet> {
    let names: Vec<&Ident> = match place {
        Place::On(list) => list.iter().collect(),
        _ => Vec::new(),
    };
    if names.is_empty() {
        return regions.get("all").map(|r| r.set.clone());
    }
    let mut total: Option<RegionSet> = None;
    for region in names {
        let set = regions.get(&region.name)?.support();
        total = Some(match total {
            None => set,
            Some(t) => match t.union(&set) {
                Ok(u) => u,
                Err(e) => {
                    let d = Diagnostic::new(Code::E405, format!("`{}` cannot live on these regions: {e}", name.name));
                    diagnostics.push(d.at(region.span, ""));
                    return None;
                }
            },
        });
    }
    total
}

/// What the compiler knows of a region; found by all ranks together where each has a part of the mesh alone.
pub(super) fn place_sig(name: &str, region: &NamedRegion, mesh: &Mesh, fields: &[Field]) -> PlaceSig {
    let support = region.support();
    let (kind, description) = match &support {
        RegionSet::Cells(c) => (PlaceKind::Cells, format!("a region of {} cells", c.len())),
        RegionSet::Facets(f) => match region.inside {
            true => (PlaceKind::Facets, format!("{} faces inside the mesh, seen from one side", f.len())),
            false => (PlaceKind::Facets, format!("{} faces with one side", f.len())),
        },
        RegionSet::Interface(i) => (PlaceKind::Interface, format!("an interface of {} faces", i.len())),
        RegionSet::Edges(e) => {
            let kind = if has_neighbours(e, mesh) { PlaceKind::InnerEdges } else { PlaceKind::Edges };
            (kind, edges_in_words(e.len(), mesh.dim(), kind))
        }
        RegionSet::Nodes(n) => (PlaceKind::Global, format!("a region of {} nodes", n.len())),
    };
    let lives = |field: &Field| match &support {
        RegionSet::Cells(c) => (c.iter().all(|c| field.lives_in_cell(*c)), false),
        RegionSet::Facets(f) => (f.iter().all(|f| field.lives_on_facet(*f)), false),
        RegionSet::Interface(i) => {
            (i.iter().all(|p| field.lives_on_facet(p.here)), i.iter().all(|p| field.lives_on_facet(p.there)))
        }
        RegionSet::Edges(e) => {
            let across = |e: &FaceEdge| e.across.is_some_and(|(face, _)| field.lives_on_facet(face));
            (e.iter().all(|e| field.lives_on_edge(*e)), e.iter().all(across))
        }
        RegionSet::Nodes(_) => (false, false),
    };
    let (mut here, mut there): (Vec<bool>, Vec<bool>) = fields.iter().map(lives).unzip();
    here.iter_mut().chain(&mut there).for_each(|lives| *lives = mesh.holders().all(*lives));
    PlaceSig {
        name: name.to_owned(),
        kind,
        here,
        there,
        entities: entity_geometries(mesh, &support),
        description,
        here_name: region.here_name.clone(),
        inside: region.inside,
    }
}

/// True where all edges are seen from one face with the face across, on all ranks.
pub(super) fn has_neighbours(edges: &[FaceEdge], mesh: &Mesh) -> bool {
    let all = edges.iter().all(|edge| edge.across.is_some());
    let (all, any) = (mesh.holders().all(all), mesh.holders().any(!edges.is_empty()));
    all && any
}

/// A rim or what lies between faces, for messages.
fn edges_in_words(n: usize, dim: usize, kind: PlaceKind) -> String {
    let two_sides = kind.has_two_sides();
    let (one, many) = match (dim < 3, two_sides) {
        (true, true) => ("point", "points"),
        (true, false) => ("end", "ends"),
        _ => ("edge", "edges"),
    };
    let what = if two_sides { "between two faces" } else { "of faces" };
    format!("{n} {} {what}", if n == 1 { one } else { many })
}

/// The place of terms on `global`.
pub(super) fn global_place(n_fields: usize) -> PlaceSig {
    PlaceSig {
        name: "global".to_owned(),
        kind: PlaceKind::Global,
        here: vec![false; n_fields],
        there: vec![false; n_fields],
        entities: Vec::new(),
        description: "no place: numbers and global unknowns".to_owned(),
        here_name: None,
        inside: false,
    }
}
