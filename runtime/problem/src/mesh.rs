//! The mesh of a scene: a generated box or a file, and the map of its nodes.

use std::collections::BTreeMap;

use wfl::{
    Code, Diagnostic, FieldKind, MeshStmt, ResolvedScript, Span,
    ast::{self, BoxDivision, Expr, MeshSource},
};
use wfl_compiler::{
    Constant, Env,
    backend::KernelBackend,
    compile_value,
    types::{PlaceKind, PlaceSig},
};
use wfl_discrete::{
    finite::{BadGiven, NotFinite},
    value::Value,
};
use wfl_host::memory::TooMuchMemory;
use wfl_mesh::mesh::{
    BoxShape, CellId, FacetRef, Group, GroupEntities, MapError, Mesh, MeshError, MeshWarnings, Topology, along_curves,
    cells_for_size, faces_of, generate_box, map_nodes, map_refined, outer_boundary, second_order,
};

use crate::{
    Bodies,
    constants::{bare_env, numbers},
};

/// The dimension a scene's mesh will have; 3 where neither its text nor a file says.
pub(super) fn dimension(script: &ResolvedScript, read: Option<&[Mesh]>) -> usize {
    if let Some(mesh) = read.and_then(<[Mesh]>::first) {
        return mesh.dim();
    }
    match script.mesh.as_ref().map(|m| &m.source) {
        Some(MeshSource::Box { from, .. }) => match &from.kind {
            ast::ExprKind::Tensor(rows) => rows.iter().map(Vec::len).sum::<usize>().clamp(1, 3),
            _ => 1,
        },
        _ => 3,
    }
}

/// Makes the mesh of a scene; problems go to `diagnostics`.
pub(super) struct MeshMaker<'a> {
    pub(super) script: &'a ResolvedScript,
    pub(super) params: &'a BTreeMap<String, Constant>,
    pub(super) backend: &'a dyn KernelBackend,
    pub(super) bodies: Bodies,
    pub(super) diagnostics: &'a mut Vec<Diagnostic>,
}

impl MeshMaker<'_> {
    /// The mesh as it was generated or read, and the map of its nodes; `None` after a message.
    pub(super) fn unmoved(&mut self, read: Option<Vec<Mesh>>) -> Option<(Mesh, Option<NodeMap>)> {
        let statement = self.script.mesh.as_ref()?;
        let mesh = match &statement.source {
            MeshSource::Box { from, to, division, shape } => {
                let env = bare_env(self.script, dimension(self.script, None), self.params);
                generated(&env, statement, from, to, division, *shape, self.diagnostics)?
            }
            MeshSource::Files(files) => self.placed(files, read?)?,
        };
        let map = match &statement.map {
            None => None,
            Some(map) => Some(self.map(mesh.dim(), map)?),
        };
        match &statement.source {
            MeshSource::Box { .. } if map.is_some() => Some((self.bent(mesh, map.as_ref()), map)),
            MeshSource::Files(_) if self.bodies == Bodies::Arcs => Some((with_arcs(mesh), map)),
            _ => Some((mesh, map)),
        }
    }

    /// A box of cells of second order where its map bends them and unknowns are of degree 2 or higher: with straight edges
    /// their errors would be those of the polygon, of order 2. A map that second order does not stand keeps the first.
    fn bent(&mut self, mesh: Mesh, map: Option<&NodeMap>) -> Mesh {
        let by_fields = || self.script.fields.iter().any(|f| matches!(f.kind, FieldKind::Unknown) && degree(f) > 1);
        let wanted = match self.bodies {
            Bodies::AsFields | Bodies::Arcs => by_fields(),
            Bodies::First => false,
            Bodies::Second => true,
        };
        if !wanted {
            return mesh;
        }
        let Ok(curved) = second_order(mesh.clone()) else { return mesh };
        // what is told of the map is told when the mesh itself is moved
        let told = self.diagnostics.len();
        let moved = self.moved(curved.clone(), map, None);
        self.diagnostics.truncate(told);
        // straight boundaries are those of cells of first order, whatever the map does inside
        let outer = |mesh: &Mesh| Topology::new(mesh).map(|t| outer_boundary(&t)).unwrap_or_default();
        let is_bent = moved.is_some_and(|m| outer(&m).into_iter().any(|facet| m.is_bent(facet)));
        if is_bent { curved } else { mesh }
    }

    /// The map of the nodes of a mesh of dimension `dim`.
    fn map(&mut self, dim: usize, map: &Expr) -> Option<NodeMap> {
        let env = bare_env(self.script, dim, self.params);
        let law = compile_value(&env, &position_place(0), "the map of the mesh", map);
        self.diagnostics.extend(law.diagnostics);
        let law = law.value?;
        if law.shape.len() != dim {
            let d = Diagnostic::new(
                Code::E108,
                format!("the map of a mesh gives {dim} coordinates, found a {}", law.shape),
            );
            self.diagnostics.push(wfl::at_expr(d, map, env.expansions, ""));
            return None;
        }
        match Value::new(law, self.backend) {
            Ok(value) if value.reads_positions_only() => Some(NodeMap { value, span: map.span }),
            Ok(_) => {
                let d = Diagnostic::new(Code::E405, "the map of a mesh is one of positions only");
                self.diagnostics.push(wfl::at_expr(d, map, env.expansions, ""));
                None
            }
            Err(e) => {
                self.diagnostics.push(Diagnostic::new(Code::E609, e.to_string()).at(map.span, ""));
                None
            }
        }
    }

    /// The mesh with its nodes where the map takes them; one that was refined has the `warnings` of the moved mesh before.
    pub(super) fn moved(&mut self, mesh: Mesh, map: Option<&NodeMap>, warnings: Option<&MeshWarnings>) -> Option<Mesh> {
        let Some(NodeMap { value, span }) = map else { return Some(mesh) };
        let place = |x| -> Result<[f64; 3], NotFinite> {
            let y = value.at_positions(&[x])?;
            Ok([0, 1, 2].map(|d| y.get(d).copied().unwrap_or(0.0)))
        };
        let moved = match warnings {
            None => map_nodes(mesh, place),
            Some(warnings) => map_refined(mesh, warnings, place),
        };
        match moved {
            Ok(mesh) => Some(mesh),
            Err(MapError::Mesh(e)) => {
                self.diagnostics.push(mesh_error(&e, *span));
                None
            }
            Err(MapError::Map(at)) => {
                let bad = BadGiven { what: "the map of the mesh".to_owned(), span: *span, at: Box::new(at) };
                self.diagnostics.push(bad.diagnostic(&self.script.expansions, None));
                None
            }
        }
    }
}

/// The degree that the declaration of a field says.
fn degree(field: &wfl::Field) -> usize {
    let word = field.space.element.as_ref().map_or("1", |e| e.name.as_str());
    let digits = word.trim_start_matches(|c: char| !c.is_ascii_digit());
    digits.parse().unwrap_or(1)
}

/// A mesh from a file whose polygons are arcs where they seem to be those of curves; as it is where that makes no mesh.
fn with_arcs(mesh: Mesh) -> Mesh {
    let bodies = bodies_of(&mesh);
    along_curves(mesh.clone(), &bodies).unwrap_or(mesh)
}

/// The faces of the whole mesh and of each of its groups of cells.
#[must_use]
pub fn bodies_of(mesh: &Mesh) -> Vec<Vec<FacetRef>> {
    let Ok(topology) = Topology::new(mesh) else { return Vec::new() };
    let group = |g: &Group| match &g.entities {
        GroupEntities::Cells(cells) => Some(cells.clone()),
        _ => None,
    };
    let all: Vec<CellId> = mesh.cells().collect();
    let sets = mesh.groups().iter().filter_map(group).chain([all]);
    sets.map(|cells| faces_of(mesh, &topology, &cells)).collect()
}

/// Where the nodes of a mesh go.
pub(super) struct NodeMap {
    value: Value,
    span: Span,
}

fn generated(
    env: &Env<'_>,
    statement: &MeshStmt,
    from: &Expr,
    to: &Expr,
    division: &BoxDivision,
    shape: Option<(ast::BoxShape, Span)>,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<Mesh> {
    let low = numbers(env, "a corner of the box", from, diagnostics)?;
    let high = numbers(env, "a corner of the box", to, diagnostics)?;
    let dim = low.len();
    if dim != high.len() || dim > 3 {
        let d = Diagnostic::new(
            Code::E408,
            format!("the corners of a box have 1 to 3 coordinates each, found {dim} and {}", high.len()),
        );
        diagnostics
            .push(d.at(to.span, format!("{} coordinates", high.len())).at(from.span, format!("{dim} coordinates")));
        return None;
    }
    let corner = |v: &[f64]| [0, 1, 2].map(|d| v.get(d).copied().unwrap_or(0.0));
    let (low, high) = (corner(&low), corner(&high));
    let kind = match shape {
        Some((shape, _)) => box_shape(shape),
        None => [BoxShape::Segment, BoxShape::Quadrilateral, BoxShape::Hexahedron][dim - 1],
    };
    if kind.kind().dim() != dim {
        let span = shape.map_or(statement.span, |(_, s)| s);
        let d = Diagnostic::new(Code::E408, format!("a box of dimension {dim} is not made of {}s", kind.kind()));
        diagnostics.push(d.at(span, "segment in 1-D, tri or quad in 2-D, tet or hex in 3-D"));
        return None;
    }
    let cells = divided(env, low, high, dim, division, diagnostics)?;
    match generate_box(low, high, cells, dim, kind) {
        Ok(mesh) => Some(mesh),
        Err(error) => {
            diagnostics.push(mesh_error(&error, statement.span));
            None
        }
    }
}

/// Cells of a box along each axis.
fn divided(
    env: &Env<'_>,
    low: [f64; 3],
    high: [f64; 3],
    dim: usize,
    division: &BoxDivision,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<[usize; 3]> {
    match division {
        BoxDivision::Cells(e) => {
            let n = numbers(env, "a number of cells", e, diagnostics)?;
            whole_cells(env, &n, dim, e, diagnostics)
        }
        BoxDivision::Size(e) => {
            let h = numbers(env, "the cell size", e, diagnostics)?;
            match cells_for_size(low, high, h[0], dim) {
                Ok(n) => Some(n),
                Err(error) => {
                    diagnostics.push(Diagnostic::new(Code::E408, error.to_string()).at(e.span, ""));
                    None
                }
            }
        }
    }
}

/// The corners of the box of a scene that was prepared; `None` for a mesh from a file.
#[must_use]
pub fn corners_of(script: &ResolvedScript, params: &BTreeMap<String, Constant>) -> Option<[[f64; 3]; 2]> {
    let MeshSource::Box { from, to, .. } = &script.mesh.as_ref()?.source else { return None };
    let env = bare_env(script, dimension(script, None), params);
    // a scene that was prepared has no messages left
    let mut unused = Vec::new();
    let mut corner = |e: &Expr| numbers(&env, "a corner of the box", e, &mut unused);
    let [low, high] = [corner(from)?, corner(to)?];
    Some([low, high].map(|v| [0, 1, 2].map(|d| v.get(d).copied().unwrap_or(0.0))))
}

/// The division of a `mesh box`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneBox {
    /// Cells along each axis.
    pub counts: Vec<usize>,
    /// The scene gives the size of the cells, not their number.
    pub by_size: bool,
}

/// The division of the box of a scene that was prepared; `None` for a mesh from a file.
pub(super) fn box_of(script: &ResolvedScript, params: &BTreeMap<String, Constant>) -> Option<SceneBox> {
    let MeshSource::Box { from, to, division, .. } = &script.mesh.as_ref()?.source else { return None };
    let env = bare_env(script, dimension(script, None), params);
    // a scene that was prepared has no messages left
    let mut unused = Vec::new();
    let low = numbers(&env, "a corner of the box", from, &mut unused)?;
    let high = numbers(&env, "a corner of the box", to, &mut unused)?;
    let corner = |v: &[f64]| [0, 1, 2].map(|d| v.get(d).copied().unwrap_or(0.0));
    let cells = divided(&env, corner(&low), corner(&high), low.len(), division, &mut unused)?;
    Some(SceneBox { counts: cells[..low.len().min(3)].to_vec(), by_size: matches!(division, BoxDivision::Size(_)) })
}

/// Cells in one direction of a box: a million already is more than a plane of them could have in memory.
const MOST_CELLS: f64 = 1e6;

fn whole_cells(
    env: &Env<'_>,
    n: &[f64],
    dim: usize,
    e: &Expr,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<[usize; 3]> {
    let mut cells = [1; 3];
    let expanded: Vec<f64> = if n.len() == 1 { vec![n[0]; dim] } else { n.to_vec() };
    for (slot, x) in cells.iter_mut().zip(&expanded) {
        if x.fract() != 0.0 || *x < 1.0 || *x > MOST_CELLS {
            let text = if x.fract() == 0.0 && *x > MOST_CELLS {
                format!("{x} cells in one direction are too many: {MOST_CELLS} are allowed")
            } else {
                format!("a number of cells is a whole number from 1, found {x}")
            };
            diagnostics.push(wfl::at_expr(Diagnostic::new(Code::E408, text), e, env.expansions, ""));
            return None;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
        {
            *slot = *x as usize;
        }
    }
    if expanded.len() != dim {
        let d = Diagnostic::new(
            Code::E408,
            format!("this box has {dim} directions, found {} numbers of cells", expanded.len()),
        );
        diagnostics.push(d.at(e.span, ""));
        return None;
    }
    Some(cells)
}

fn box_shape(shape: ast::BoxShape) -> BoxShape {
    match shape {
        ast::BoxShape::Segment => BoxShape::Segment,
        ast::BoxShape::Tri => BoxShape::Triangle,
        ast::BoxShape::Quad => BoxShape::Quadrilateral,
        ast::BoxShape::Tet => BoxShape::Tetrahedron,
        ast::BoxShape::Hex => BoxShape::Hexahedron,
    }
}

/// The message with a vector of the size that is needed, where a single number is given.
pub(super) fn with_zeros(d: Diagnostic, value: &ast::Expr, found: usize, needed: usize) -> Diagnostic {
    if found != 1 || !(2..=3).contains(&needed) {
        return d;
    }
    let zeros = format!("[{}]", vec!["0"; needed].join(","));
    let d = d.help(format!("a vector is written with all its components: {zeros}"));
    if matches!(value.kind, ast::ExprKind::Number(0.0)) { d.replace(value.span, zeros) } else { d }
}

/// Message about a prescribed or nodal value that needs more than [`position_place`] has.
pub(super) const POSITIONS_ONLY: &str = "this value depends on x, y, z and the step variable only";

/// A place where only positions are known.
pub(super) fn position_place(n_fields: usize) -> PlaceSig {
    PlaceSig {
        name: "here".to_owned(),
        kind: PlaceKind::Cells,
        here: vec![false; n_fields],
        there: vec![false; n_fields],
        entities: Vec::new(),
        description: "a set of positions".to_owned(),
        here_name: None,
        inside: false,
    }
}

/// A problem of the mesh at a place of the scene.
pub(super) fn mesh_error(error: &MeshError, span: Span) -> Diagnostic {
    match error {
        MeshError::TooMuchMemory(need) => too_much_memory(need, span),
        // what a file says of places: no map of a box and no refinement makes such cells
        MeshError::FoldedOver { .. } | MeshError::MiddleNodes { .. } => {
            Diagnostic::new(Code::E410, error.to_string()).at(span, "")
        }
        _ => Diagnostic::new(Code::E409, error.to_string()).at(span, ""),
    }
}

/// A need of the scene that does not fit into the memory.
pub(super) fn too_much_memory(need: &TooMuchMemory, span: Span) -> Diagnostic {
    Diagnostic::new(Code::E606, need.to_string()).at(span, "").help("fewer cells, or more memory: --memory 16GB")
}
