//! The refinement of a scene's mesh, before anything is made on it: `refine` statements, then the rounds of a caller.
//!
//! Refined is the mesh that was generated or read; its nodes are moved by the map of the mesh afterwards, so new nodes of
//! a curved boundary lie on it. Regions, interfaces and splits are derived from the refined mesh as from any other.
//! Promises: conditions and regions of a statement are those of the moved mesh of each round; the moved mesh is usable,
//! or a message says why not.

use wfl::{
    Code, Diagnostic, Refinement, ResolvedScript, Span,
    ast::{Expr, MeshSource},
    each_name,
};
use wfl_mesh::{
    mesh::{CellId, FacetRef, Mesh, MeshError, MeshWarnings, RegionSet, Subdivision, Topology, summary},
    refine::{Axes, Descent, Mark, Refiner},
};

use super::{
    conditions::{ConditionMaker, holds, not_a_number},
    constants::{bare_env, number},
    mesh::{MeshMaker, NodeMap, mesh_error},
    regions::{RegionMaker, Regions},
};

/// How the mesh of a scene was refined.
#[derive(Clone, Debug)]
pub struct Refined {
    /// Cells of the mesh as it was generated or read.
    pub cells_before: usize,
    /// The `refine` statements in their order, each with the cells of the mesh behind it.
    pub statements: Vec<(Span, usize)>,
    /// For each round of [`prepare_refined`](crate::prepare_refined) the way from the cells after it to those before it.
    pub rounds: Vec<Descent>,
    /// Diameter of the smallest cell.
    pub smallest: f64,
}

/// The mesh of a scene as it is made.
pub(super) struct Made {
    pub(super) mesh: Mesh,
    pub(super) refined: Option<Refined>,
    /// Where the nodes were before the map of the mesh; nothing without one that parameters change.
    pub(super) unmapped: Option<Vec<[f64; 3]>>,
}

/// Where the nodes are before the map of the mesh, where that may have to be known again: for derivatives in a parameter that
/// moves them.
fn unmapped(script: &ResolvedScript, mesh: &Mesh) -> Option<Vec<[f64; 3]>> {
    let statement = script.mesh.as_ref()?;
    let mut formulas: Vec<&Expr> = vec![statement.map.as_ref()?];
    formulas.extend(statement.source.placing());
    if let MeshSource::Box { from, to, .. } = &statement.source {
        formulas.extend([from, to]);
    }
    let mut follows = false;
    let mut look = |word: &str| follows |= script.params.iter().any(|p| p.name.name == word);
    formulas.into_iter().for_each(|e| each_name(e, &mut look));
    follows.then(|| mesh.nodes().to_vec())
}

impl MeshMaker<'_> {
    /// The mesh with its nodes where they are in the end, and how it was refined; `None` after a message.
    pub(super) fn make(mut self, read: Option<Vec<Mesh>>, rounds: &[Vec<Mark>]) -> Option<Made> {
        let (mesh, map) = self.unmoved(read)?;
        let script = self.script;
        if rounds.is_empty() && script.refinements.is_empty() {
            let unmapped = unmapped(script, &mesh);
            return Some(Made { mesh: self.moved(mesh, map.as_ref(), None)?, refined: None, unmapped });
        }
        let mesh_span = script.mesh.as_ref()?.span;
        let (cells_before, shape) = (mesh.n_cells(), self.moved(mesh.clone(), map.as_ref(), None)?);
        let warnings = shape.warnings().clone();
        let mut refiner = self.checked(Refiner::new(mesh, &shape), mesh_span)?;
        drop(shape);
        let (mut statements, mut descents) = (Vec::new(), Vec::with_capacity(rounds.len()));
        for refinement in &script.refinements {
            self.statement(refinement, &mut refiner, map.as_ref(), &warnings)?;
            statements.push((refinement.span, refiner.mesh().n_cells()));
        }
        for marks in rounds {
            self.of_this_mesh(marks, refiner.mesh())?;
            let descent = refiner.refine(marks);
            descents.push(self.checked(descent, mesh_span)?);
        }
        let mesh = refiner.into_mesh();
        let unmapped = unmapped(script, &mesh);
        let mesh = self.moved(mesh, map.as_ref(), Some(&warnings))?;
        let smallest = summary(&mesh).min_size;
        let refined = Some(Refined { cells_before, statements, rounds: descents, smallest });
        Some(Made { mesh, refined, unmapped })
    }

    /// Marks that were read may be of another mesh.
    fn of_this_mesh(&mut self, marks: &[Mark], mesh: &Mesh) -> Option<()> {
        let Some(mark) = marks.iter().find(|m| m.cell.index() >= mesh.n_cells()) else { return Some(()) };
        let (cell, n) = (mark.cell.index(), mesh.n_cells());
        let d = Diagnostic::new(Code::E443, format!("the refinement is of another mesh: it marks cell {cell} of {n}"));
        let d = d.at(self.script.mesh.as_ref()?.span, "on this mesh");
        self.diagnostics.push(d.help("give the knobs of that run, too: its report names them under `picked`"));
        None
    }

    fn checked<T>(&mut self, made: Result<T, MeshError>, span: Span) -> Option<T> {
        made.map_err(|e| self.diagnostics.push(mesh_error(&e, span))).ok()
    }

    /// All rounds of a statement.
    fn statement(
        &mut self,
        refinement: &Refinement,
        refiner: &mut Refiner,
        map: Option<&NodeMap>,
        warnings: &MeshWarnings,
    ) -> Option<()> {
        let times = self.times(refinement, refiner.mesh().dim())?;
        let axes = self.axes(refinement, refiner.mesh())?;
        let mut round = 0;
        while round < times {
            let moved;
            let shape = match map {
                None => refiner.mesh(),
                Some(_) => {
                    moved = self.moved(refiner.mesh().clone(), map, Some(warnings))?;
                    &moved
                }
            };
            let cells = self.marked(refinement, shape)?;
            if cells.is_empty() {
                if round == 0 {
                    let d = Diagnostic::new(Code::W418, "this refinement changes nothing");
                    let at = refinement.what.condition.as_ref().map_or(refinement.span, |c| c.span);
                    self.diagnostics.push(d.at(at, "no cell has its centre or a vertex there"));
                }
                return Some(());
            }
            let marks: Vec<Mark> = cells.into_iter().map(|cell| Mark { cell, axes }).collect();
            let made = refiner.refine(&marks);
            self.checked(made, refinement.span)?;
            round += 1;
        }
        Some(())
    }

    /// The number of rounds.
    fn times(&mut self, refinement: &Refinement, dim: usize) -> Option<u64> {
        let Some(e) = &refinement.what.times else { return Some(1) };
        let env = bare_env(self.script, dim, self.params);
        let n = number(&env, "a number of rounds", e, self.diagnostics)?;
        if n.fract() != 0.0 || !(0.0..=MOST_ROUNDS).contains(&n) {
            let d = Diagnostic::new(Code::E443, format!("a mesh is refined a whole number of times, found {n}"));
            self.diagnostics.push(wfl::at_expr(d, e, env.expansions, ""));
            return None;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
        Some(n as u64)
    }

    /// The directions in which cells are divided.
    fn axes(&mut self, refinement: &Refinement, mesh: &Mesh) -> Option<Axes> {
        let along = &refinement.what.along;
        let Some(first) = along.first() else { return Some(Axes::ALL) };
        let is_box = matches!(self.script.mesh.as_ref()?.source, MeshSource::Box { .. });
        let bisected =
            mesh.kinds().iter().find(|kind| kind.subdivision() == Some(Subdivision::Bisection) && kind.dim() > 1);
        let names = &["x", "y", "z"][..mesh.dim()];
        let why = match (bisected, along.iter().find(|a| !names.contains(&a.name.as_str()))) {
            _ if !is_box => "the cells of a mesh file have no common directions".to_owned(),
            (Some(kind), _) => format!("{kind}s are bisected, in no direction of their own"),
            (None, Some(other)) => {
                format!("`{}` is no direction of this box: {}", other.name, names.join(", "))
            }
            (None, None) => {
                let axes: Vec<usize> = along.iter().filter_map(|a| names.iter().position(|n| *n == a.name)).collect();
                return Some(Axes::of(&axes));
            }
        };
        let d = Diagnostic::new(Code::E443, format!("no refinement along a direction: {why}"));
        self.diagnostics.push(d.at(first.span, "of a box of segments, quadrilaterals or hexahedra only"));
        None
    }

    /// The cells that a statement marks on a mesh; `None` after a message.
    fn marked(&mut self, refinement: &Refinement, mesh: &Mesh) -> Option<Vec<CellId>> {
        let what = &refinement.what;
        let mut cells: Vec<CellId> = match what.places.is_empty() {
            true => mesh.cells().collect(),
            false => self.cells_at(refinement, mesh)?,
        };
        let Some(condition) = &what.condition else { return Some(cells) };
        let Self { script, params, backend, .. } = *self;
        let smallest = summary(mesh).min_size;
        let maker = ConditionMaker { script, mesh, params, backend, smallest };
        let value = maker.make(condition, self.diagnostics)?;
        let (mut bad, mut at_node) = (None, vec![None; mesh.n_nodes()]);
        let mut meets = |x: [f64; 3]| {
            let found = holds(&value, x);
            if found.is_none() {
                bad = Some(x);
            }
            found == Some(true)
        };
        cells.retain(|cell| {
            let vertices = mesh.cell_vertices(*cell);
            vertices.iter().any(|n| *at_node[n.index()].get_or_insert_with(|| meets(mesh.node(*n))))
                || meets(mesh.centroid(*cell))
        });
        match bad {
            None => Some(cells),
            Some(x) => {
                self.diagnostics.push(not_a_number(x, condition.span));
                None
            }
        }
    }

    /// Cells of the regions of a statement, and cells at their faces and nodes.
    fn cells_at(&mut self, refinement: &Refinement, mesh: &Mesh) -> Option<Vec<CellId>> {
        let topology = Topology::new(mesh);
        let topology = self.checked(topology, refinement.span)?;
        let regions = self.regions(mesh, &topology);
        let mut is_in = vec![false; mesh.n_cells()];
        // what cannot be made has its message where the regions of the refined mesh are made
        for set in refinement.what.places.iter().filter_map(|place| regions.get(&place.name)).map(|r| &r.set) {
            let mut add = |cell: CellId| is_in[cell.index()] = true;
            match set {
                RegionSet::Cells(cells) => cells.iter().copied().for_each(add),
                RegionSet::Facets(facets) => {
                    let both = |f: &FacetRef| [Some(*f), topology.opposite(*f)];
                    facets.iter().flat_map(both).flatten().for_each(|f| add(f.cell));
                }
                RegionSet::Interface(pairs) => pairs.iter().for_each(|p| {
                    add(p.here.cell);
                    add(p.there.cell);
                }),
                RegionSet::Edges(edges) => edges.iter().for_each(|edge| add(edge.face.cell)),
                RegionSet::Nodes(nodes) => {
                    let at = |cell: &CellId| mesh.cell_vertices(*cell).iter().any(|n| nodes.binary_search(n).is_ok());
                    mesh.cells().filter(at).for_each(add);
                }
            }
        }
        Some(mesh.cells().filter(|cell| is_in[cell.index()]).collect())
    }

    /// The regions on a mesh that is refined further: their messages come on the last one.
    fn regions(&self, mesh: &Mesh, topology: &Topology) -> Regions {
        let script: &ResolvedScript = self.script;
        let (params, backend, smallest) = (self.params, self.backend, summary(mesh).min_size);
        let (diagnostics, regions) = (&mut Vec::new(), Regions::new());
        RegionMaker {
            script,
            mesh,
            topology,
            params,
            backend,
            smallest,
            diagnostics,
            regions,
            counted: Default::default(),
        }
        .make()
    }
}

/// Rounds after which a cell of any box is smaller than the smallest number there is.
const MOST_ROUNDS: f64 = 2200.0;
