//! Where the error of a quantity comes from: dual-weighted residuals by cell.
//!
//! Two solutions on one mesh, of elements of degree p and p + 1: the residual of the first in the space of the second,
//! times what the adjoint solution there has beyond degree p (Becker and Rannacher, Acta Numerica 10, 2001; for forms that
//! a compiler knows: Rognes and Logg, SIAM J. Sci. Comput. 35, 2013). The products are kept by basis function of the richer
//! space, which is a partition of the error without strong residuals and jumps (in the spirit of Richter and Wick, J.
//! Comput. Appl. Math. 279, 2015), and each goes to the cells of its node in equal parts. The sum is the difference of the
//! quantity between both solutions; the parts say which cells to refine, and in which direction.
//!
//! The tangent of the adjoint problem is that at the richer solution: at kinks, of the branch that it is on. Does not
//! estimate anything by itself and marks no cells.

use std::sync::Arc;

use wfl::ast::{Argument, Expr, ExprKind, MulOp, Reduction};
use wfl_compiler::backend::KernelBackend;
use wfl_discrete::{
    field::{Field, FieldSpace},
    space::{Space, Support},
    system::{Branches, FIXED, Form, System},
};
use wfl_mesh::{
    element::{DofEntity, Element},
    mesh::{CellKind, Subdivision},
};
use wfl_problem::{Over, StateAt};
use wfl_sparse::solve::{CheckedLdlt, CheckedLlt, CheckedLu, LinearSolver, SolverOptions};

use super::data::{around, to_cells};
use crate::compare::{MEASURE, Solved, beside, items, kinds, name};

/// Parts of an error by cell of the mesh and by direction of its reference cell; all parts are positive and in the unit of
/// the goal.
pub struct Indicator {
    /// `parts[cell][direction]`; a simplex has no directions of its own, the sum counts.
    pub parts: Vec<[f64; 3]>,
    /// Their sum in the unit of a measure: what its error could be if nothing cancelled. `None` where the parts are those
    /// of another quantity, which only say where the error comes from.
    pub size: Option<f64>,
}

/// Two solutions on one mesh.
#[derive(Clone, Copy)]
pub struct Pair<'a> {
    /// Degree p.
    pub coarse: &'a Solved,
    /// Degree p + 1.
    pub rich: &'a Solved,
}

impl Pair<'_> {
    /// The parts of the error of a quantity of the coarser solution: `L2`, `H1`, an output or a measure, by name.
    ///
    /// # Errors
    /// Why there are none, in words.
    pub fn indicator(&self, quantity: &str, backend: &dyn KernelBackend, threads: usize) -> Result<Indicator, String> {
        let rich = &self.rich.outcome.equations.system;
        let last = self.rich.outcome.steps.last().ok_or("there is no step")?;
        let embedded = self.embedded(&last.state)?;
        let at = |unknowns| StateAt { system: rich, window: last.window, unknowns };
        let goal = self.goal(quantity, backend, [&embedded, &last.state], &at).unwrap_or_default();
        // the residual of a step whose states have been renewed is not at hand; the size of a zone has no derivative, what
        // is read through a mapping none that is compiled here
        if !self.rich.scene.states.is_empty() || goal.iter().all(|g| *g == 0.0) {
            let apart: Vec<f64> = last.state.iter().zip(&embedded).map(|(a, b)| a - b).collect();
            return self.difference(backend, at(&apart));
        }
        let adjoint = adjoint(rich, &last.state, goal, threads)?;
        let products = self.products(&embedded, &adjoint)?;
        let mut parts = by_cell(rich, &products, &adjoint);
        let own = self.of_rule(quantity, &embedded, backend);
        for (all, more) in parts.iter_mut().zip(self.of_data(own.as_deref(), &embedded, &adjoint)?) {
            (0..3).for_each(|d| all[d] += more[d]);
        }
        let size = parts.iter().flatten().sum::<f64>() * self.scale(quantity);
        Ok(Indicator { parts, size: Some(size) })
    }

    /// What the parts of a goal are multiplied with so that they are those of the quantity: the goal of an extreme value
    /// is the integral of a power of it over its size.
    fn scale(&self, quantity: &str) -> f64 {
        let wanted = quantity.strip_prefix(MEASURE).unwrap_or(quantity);
        let of = |run: &Solved| {
            run.outcome.steps.last().and_then(|s| s.measures.iter().find(|m| m.0 == wanted).map(|m| m.1))
        };
        let extreme = self.rich.script.measures.iter().find(|m| m.name.name == wanted);
        match extreme.filter(|m| matches!(m.reduction, Reduction::Max | Reduction::Min)) {
            Some(_) => of(self.coarse).map_or(1.0, f64::abs),
            None => 1.0,
        }
    }

    /// The same for the residual in the coarser space itself, which is zero but for rules: those of the richer run see
    /// more of loads and coefficients. In equal parts to all directions of a cell. What the finer rule makes of an integral
    /// itself, `own`, belongs to it: a force of contact is an integral of what stands in the equations, and both changes cancel.
    fn of_data(&self, own: Option<&[f64]>, embedded: &[f64], adjoint: &[f64]) -> Result<Vec<[f64; 3]>, String> {
        let [coarse, fine] = [&self.coarse.outcome.equations.system, &self.rich.outcome.equations.system];
        let mut parts = vec![[0.0; 3]; coarse.mesh.n_cells()];
        if fine.numbering.has_ties() {
            return Ok(parts);
        }
        let mut residual = fine.residual(embedded, &Form::AS_WRITTEN).map_err(|e| e.to_string())?.values;
        residual.iter_mut().zip(&fine.numbering.free).filter(|(_, free)| **free == FIXED).for_each(|(r, _)| *r = 0.0);
        fine.numbering.frames.turn_back(&mut residual);
        let (forces, weights) = (gathered(coarse, fine, &residual)?, transfer(fine, coarse, adjoint)?);
        let signed = forces.iter().zip(&weights).map(|(r, w)| -r * w);
        let mut products: Vec<f64> = signed.clone().map(f64::abs).collect();
        if let Some(own) = own {
            // of an integral that both rules give exactly, its parts by node may differ all the same
            let mut together: Vec<f64> = signed.collect();
            add_at_nodes(coarse, own, &mut together);
            if together.iter().sum::<f64>() < products.iter().sum::<f64>() {
                products = together;
            }
        }
        let mut cells = vec![0.0; parts.len()];
        to_cells(coarse, &products, &mut cells);
        let dim = coarse.mesh.dim();
        for (part, whole) in parts.iter_mut().zip(cells) {
            part.iter_mut().take(dim).for_each(|p| *p = whole / dim as f64);
        }
        Ok(parts)
    }

    /// By dof of the coarser space what the rule of the richer run changes in an integral at the coarser solution; `None` for
    /// other quantities.
    fn of_rule(&self, quantity: &str, embedded: &[f64], backend: &dyn KernelBackend) -> Option<Vec<f64>> {
        let wanted = quantity.strip_prefix(MEASURE).unwrap_or(quantity);
        let of = |run: &Solved, unknowns: &[f64]| {
            let (system, window) = (&run.outcome.equations.system, run.outcome.steps.last()?.window);
            let mut measures = run.script.measures.iter();
            let measure = measures.find(|m| m.name.name == wanted && m.reduction == Reduction::Integral)?;
            run.scene.at_nodes(&run.script, backend, measure, StateAt { system, window, unknowns })
        };
        let [fine, coarse] = [of(self.rich, embedded)?, of(self.coarse, &self.coarse.outcome.steps.last()?.state)?];
        let systems = [&self.coarse.outcome.equations.system, &self.rich.outcome.equations.system];
        let fine = gathered(systems[0], systems[1], &fine).ok()?;
        Some(fine.iter().zip(&coarse).map(|(a, b)| a - b).collect())
    }

    /// By dof of the richer space: minus the residual of the coarser solution times what the adjoint solution has beyond the
    /// coarser space. In sum the difference of the goal between both solutions, but for what is prescribed.
    fn products(&self, embedded: &[f64], adjoint: &[f64]) -> Result<Vec<f64>, String> {
        let rich = &self.rich.outcome.equations.system;
        let residual = rich.residual(embedded, &Form::AS_WRITTEN).map_err(|e| e.to_string())?.values;
        let mut weights = self.beyond(adjoint)?;
        rich.numbering.turn(&mut weights);
        let by_dof = residual.iter().zip(&weights).zip(&rich.numbering.free);
        Ok(by_dof.map(|((r, w), free)| if *free == FIXED { 0.0 } else { -r * w }).collect())
    }

    /// Parts of the difference of gradients: where the solution itself is not resolved.
    ///
    /// # Errors
    /// Why there are none, in words.
    pub fn of_gradients(&self, backend: &dyn KernelBackend) -> Result<Indicator, String> {
        let last = self.rich.outcome.steps.last().ok_or("there is no step")?;
        let embedded = self.embedded(&last.state)?;
        let apart: Vec<f64> = last.state.iter().zip(&embedded).map(|(a, b)| a - b).collect();
        self.difference(
            backend,
            StateAt { system: &self.rich.outcome.equations.system, window: last.window, unknowns: &apart },
        )
    }

    /// The squares of the gradients of a difference.
    fn difference(&self, backend: &dyn KernelBackend, apart: StateAt<'_>) -> Result<Indicator, String> {
        let run = self.rich;
        let mut parts = vec![[0.0; 3]; run.scene.system.mesh.n_cells()];
        for (gradient, weight) in weighted(run, backend, "Grad_")? {
            let square = call(run, "Norm_sqr", vec![gradient]);
            let found = run.scene.integrals_by_cell(&run.script, backend, &square, apart)?;
            parts.iter_mut().zip(found).for_each(|(p, x)| *p = p.map(|p| p + weight * x));
        }
        Ok(Indicator { parts, size: None })
    }

    /// The coarser solution in the richer space, with the values that are prescribed there.
    fn embedded(&self, rich: &[f64]) -> Result<Vec<f64>, String> {
        let coarse = self.coarse.outcome.steps.last().ok_or("there is no step")?;
        let [from, to] = [&self.coarse.outcome.equations.system, &self.rich.outcome.equations.system];
        let inside = transfer(from, to, &coarse.state)?;
        let mut apart: Vec<f64> = inside.iter().zip(rich).map(|(a, b)| a - b).collect();
        to.numbering.frames.turn(&mut apart);
        let (mut free, mut out) = (Vec::new(), vec![0.0; rich.len()]);
        to.numbering.gather(&apart, &mut free);
        to.numbering.advance(rich, &free, 1.0, &mut out);
        Ok(out)
    }

    /// What a vector of the richer space has beyond its interpolation in the coarser one.
    fn beyond(&self, rich: &[f64]) -> Result<Vec<f64>, String> {
        let [coarse, fine] = [&self.coarse.outcome.equations.system, &self.rich.outcome.equations.system];
        let inside = transfer(coarse, fine, &transfer(fine, coarse, rich)?)?;
        Ok(rich.iter().zip(&inside).map(|(a, b)| a - b).collect())
    }

    /// By dof of the richer space: the derivative of the quantity, for a norm that of half its square of the difference.
    fn goal<'s>(
        &self,
        quantity: &str,
        backend: &dyn KernelBackend,
        [from, to]: [&'s [f64]; 2],
        at: &dyn Fn(&'s [f64]) -> StateAt<'s>,
    ) -> Result<Vec<f64>, String> {
        let run = self.rich;
        let integrals = |integrand: &Expr, over: Over<'_>, state: &'s [f64]| {
            run.scene.derivative(&run.script, backend, integrand, over, at(state))
        };
        let norms: Vec<(Expr, f64)> = match quantity {
            "L2" => weighted(run, backend, "")?,
            "H1" => weighted(run, backend, "Grad_")?,
            output => items(run).filter(|i| i.name == output).map(|i| (i.expr.clone(), 1.0)).collect(),
        };
        if norms.is_empty() {
            let wanted = quantity.strip_prefix(MEASURE).unwrap_or(quantity);
            let measure = run.script.measures.iter().find(|m| m.name.name == wanted);
            let measure = measure.ok_or_else(|| format!("no quantity `{quantity}`"))?;
            if measure.reduction == Reduction::Value {
                return run.scene.derivative(&run.script, backend, &measure.expr, Over::Point(wanted), at(to));
            }
            if matches!(measure.reduction, Reduction::Reaction | Reduction::Balance(_)) {
                return Err(format!(
                    "`{wanted}` is made of equations, its error has no estimate; that of an integral has one"
                ));
            }
            if measure.reduction == Reduction::Mean {
                // by the size of its region
                let one = number(run, 1.0);
                let size = run.scene.integral(&run.script, backend, &one, (Over::Regions(&measure.places), at(to)))?;
                let mut goal = integrals(&measure.expr, Over::Regions(&measure.places), to)?;
                goal.iter_mut().for_each(|g| *g /= size);
                return Ok(goal);
            }
            if matches!(measure.reduction, Reduction::Max | Reduction::Min) {
                // the largest value is approached by a mean of a high power of it
                let found = self.coarse.outcome.steps.last().and_then(|s| s.measures.iter().find(|m| m.0 == wanted));
                let size = found.map_or(1.0, |m| m.1.abs()).max(f64::MIN_POSITIVE);
                let power = call(run, "pow", vec![over_number(run, &measure.expr, size), number(run, HIGH_POWER)]);
                let mut goal = integrals(&power, Over::Regions(&measure.places), to)?;
                // by the size of the integral and the power it is that of the extreme value over its size
                let all = run.scene.integral(&run.script, backend, &power, (Over::Regions(&measure.places), at(to)))?;
                goal.iter_mut().for_each(|g| *g /= HIGH_POWER * all.abs().max(f64::MIN_POSITIVE));
                return Ok(goal);
            }
            return integrals(&measure.expr, Over::Measure(measure), to);
        }
        let mut goal = vec![0.0; to.len()];
        for (quantity, weight) in norms {
            let square = call(run, "Norm_sqr", vec![quantity]);
            let [there, here] =
                [integrals(&square, Over::Everywhere, to)?, integrals(&square, Over::Everywhere, from)?];
            goal.iter_mut().zip(there.iter().zip(&here)).for_each(|(g, (a, b))| *g += weight * (a - b));
        }
        Ok(goal)
    }
}

/// Sizes of parts by dof, with further ones at nodes, whatever component those have: at a node that has some the sum of both.
fn add_at_nodes(system: &System, more: &[f64], parts: &mut [f64]) {
    for (k, field) in system.fields.iter().enumerate() {
        let Some(range) = system.range(k) else { continue };
        let n = field.n_components;
        for (own, more) in parts[range.clone()].chunks_exact_mut(n).zip(more[range].chunks_exact(n)) {
            let further: f64 = more.iter().sum();
            if further == 0.0 {
                own.iter_mut().for_each(|part| *part = part.abs());
            } else {
                let whole = further + own.iter().sum::<f64>();
                own.fill(0.0);
                own[0] = whole.abs();
            }
        }
    }
}

/// The unknowns on cells, or what a prefix makes of them, and what brings their squares to one unit: one over those of all
/// unknowns of their kind, where there are several.
fn weighted(run: &Solved, backend: &dyn KernelBackend, prefix: &str) -> Result<Vec<(Expr, f64)>, String> {
    let (kinds, mut out) = (kinds(run)?, Vec::new());
    let last = run.outcome.steps.last().ok_or("there is no step")?;
    let at = StateAt { system: &run.outcome.equations.system, window: last.window, unknowns: &last.state };
    for kind in &kinds {
        let of: Vec<Expr> = kind.fields.iter().map(|field| name(run, &format!("{prefix}{field}"))).collect();
        let mut size = if kinds.len() > 1 { 0.0 } else { 1.0 };
        for value in of.iter().filter(|_| kinds.len() > 1) {
            let value = if prefix.is_empty() { beside(run, value, &kind.constant) } else { value.clone() };
            let square = call(run, "Norm_sqr", vec![value]);
            size += run.scene.integrals_by_cell(&run.script, backend, &square, at)?.iter().sum::<f64>();
        }
        let weight = if size > 0.0 && !kind.vanishes { 1.0 / size } else { 0.0 };
        out.extend(of.into_iter().map(|value| (value, weight)));
    }
    Ok(out)
}

/// The power whose mean stands for the largest value. Even, so that signs do not count.
const HIGH_POWER: f64 = 8.0;

fn number(run: &Solved, value: f64) -> Expr {
    Expr { kind: ExprKind::Number(value), span: run.scene_span(), expansion: None }
}

fn over_number(run: &Solved, e: &Expr, size: f64) -> Expr {
    let span = run.scene_span();
    let kind = ExprKind::Product(Box::new(e.clone()), vec![(MulOp::Divide, span, number(run, size))]);
    Expr { kind, span: e.span, expansion: e.expansion }
}

fn call(run: &Solved, function: &str, arguments: Vec<Expr>) -> Expr {
    let at = arguments.first().map_or((run.scene_span(), None), |e| (e.span, e.expansion));
    let arguments = arguments.into_iter().map(Argument::Expr).collect();
    let kind = ExprKind::Call(
        Box::new(Expr { kind: ExprKind::Name(function.to_owned()), span: at.0, expansion: at.1 }),
        arguments,
    );
    Expr { kind, span: at.0, expansion: at.1 }
}

/// The solution of the adjoint problem by dof, zero where values are prescribed.
fn adjoint(system: &System, u: &[f64], mut goal: Vec<f64>, threads: usize) -> Result<Vec<f64>, String> {
    let numbering = &system.numbering;
    numbering.turn(&mut goal);
    let mut rhs = Vec::new();
    numbering.gather(&goal, &mut rhs);
    let mut tangent = system.new_tangent();
    system.tangent(u, Branches::AsWritten, &mut tangent).map_err(|e| e.to_string())?;
    let matrix = system.whole_matrix(&tangent).map_err(|e| e.to_string())?;
    let position = |d: &u32| {
        let (field, node, _) = numbering.describe(&system.fields, *d as usize);
        system.fields[field].node_position(node)
    };
    let positions: Vec<[f64; 3]> = numbering.free_dofs.iter().map(position).collect();
    let options = SolverOptions { threads, ..SolverOptions::default() };
    let mut x = vec![0.0; rhs.len()];
    let solved = system.is_symmetric() && {
        let mut solver = CheckedLlt::new(matrix.pattern(), Some(&positions), options).map_err(|e| e.to_string())?;
        solver.factor(&matrix).and_then(|()| solver.solve(&rhs, &mut x)).is_ok()
    };
    if !solved {
        let transposed = if system.is_symmetric() { matrix } else { matrix.transpose() };
        let pattern = Arc::clone(transposed.pattern());
        let mut solver: Box<dyn LinearSolver> = if system.is_symmetric() {
            Box::new(CheckedLdlt::new(&pattern, Some(&positions), None, options).map_err(|e| e.to_string())?)
        } else {
            Box::new(CheckedLu::new(&pattern, Some(&positions), options).map_err(|e| e.to_string())?)
        };
        solver.factor(&transposed).and_then(|()| solver.solve(&rhs, &mut x)).map_err(|e| e.to_string())?;
    }
    let mut out = vec![0.0; u.len()];
    numbering.advance(&vec![0.0; u.len()], &x, 1.0, &mut out);
    Ok(out)
}

/// The values of one space at the nodes of another one on the same cells and faces.
fn transfer(from: &System, to: &System, values: &[f64]) -> Result<Vec<f64>, String> {
    let mut out = vec![0.0; to.numbering.n_dofs];
    for (source, target) in from.fields.iter().zip(&*to.fields) {
        let place = |system: &System, field: &Field| system.fields.iter().position(|f| f.name == field.name);
        let (Some(a), Some(b)) = (place(from, source), place(to, target)) else { continue };
        let (Some(read), Some(write)) = (from.range(a), to.range(b)) else { continue };
        let n = source.n_components;
        match (&source.space, &target.space) {
            (FieldSpace::Nodal(coarse), FieldSpace::Nodal(fine)) => {
                interpolate(coarse, fine, n, &values[read], &mut out[write])?;
            }
            (FieldSpace::Global, FieldSpace::Global) => out[write].copy_from_slice(&values[read]),
            _ => return Err(format!("`{}` is of another kind on the same mesh", source.name)),
        }
    }
    Ok(out)
}

fn interpolate(from: &Space, to: &Space, n: usize, values: &[f64], out: &mut [f64]) -> Result<(), String> {
    let shared = around(to);
    out.fill(0.0);
    each_weight(from, to, |node, source, weight| {
        // all cells of a node have the same value there
        let weight = weight / f64::from(shared[node as usize]);
        (0..n).for_each(|c| out[node as usize * n + c] += weight * values[source as usize * n + c]);
    })
}

/// Forces at the nodes of one space as those at the nodes of a coarser one on the same cells and faces: the transpose of
/// [`transfer`] from there.
fn gathered(coarse: &System, fine: &System, forces: &[f64]) -> Result<Vec<f64>, String> {
    let mut out = vec![0.0; coarse.numbering.n_dofs];
    for (source, target) in fine.fields.iter().zip(&*coarse.fields) {
        let place = |system: &System, field: &Field| system.fields.iter().position(|f| f.name == field.name);
        let (Some(a), Some(b)) = (place(fine, source), place(coarse, target)) else { continue };
        let (Some(read), Some(write)) = (fine.range(a), coarse.range(b)) else { continue };
        let n = source.n_components;
        match (&source.space, &target.space) {
            (FieldSpace::Nodal(from), FieldSpace::Nodal(to)) => {
                let (shared, values) = (around(from), &forces[read]);
                each_weight(to, from, |node, other, weight| {
                    for c in 0..n {
                        let part = values[node as usize * n + c] / f64::from(shared[node as usize]);
                        out[write.start + other as usize * n + c] += weight * part;
                    }
                })?;
            }
            (FieldSpace::Global, FieldSpace::Global) => out[write].copy_from_slice(&forces[read]),
            _ => return Err(format!("`{}` is of another kind on the same mesh", source.name)),
        }
    }
    Ok(out)
}

/// By node of a space on each of its cells or faces: the basis functions of another space on the same ones, by node and
/// value there.
fn each_weight(from: &Space, to: &Space, mut f: impl FnMut(u32, u32, f64)) -> Result<(), String> {
    if from.support() != to.support() {
        return Err("the meshes of two degrees differ".to_owned());
    }
    let tables: Vec<_> =
        CellKind::ALL.iter().map(|kind| Some(from.element(*kind)?.tabulate(to.element(*kind)?.points(), 0))).collect();
    for position in 0..to.n_positions() {
        let Some(table) = &tables[to.element_at(position).kind().index()] else { continue };
        let sources = from.entity_nodes(position);
        for (point, node) in to.entity_nodes(position).iter().enumerate() {
            for (k, source) in sources.iter().enumerate() {
                f(*node, *source, table.values[point * table.n_dofs + k]);
            }
        }
    }
    Ok(())
}

/// The sums at nodes, in equal parts to the cells around them, and there to the directions in which the adjoint solution
/// is not of the lower degree.
fn by_cell(system: &System, products: &[f64], adjoint: &[f64]) -> Vec<[f64; 3]> {
    let mut parts = vec![[0.0; 3]; system.mesh.n_cells()];
    for (k, field) in system.fields.iter().enumerate() {
        let (Some(range), FieldSpace::Nodal(space)) = (system.range(k), &field.space) else { continue };
        let n = field.n_components;
        let (products, adjoint) = (&products[range.clone()], &adjoint[range]);
        let around = around(space);
        for position in 0..space.n_positions() {
            let (element, nodes) = (space.element_at(position), space.entity_nodes(position));
            let (cell, axes) = match space.support() {
                Support::Cells(cells) => (cells[position], [0, 1, 2]),
                Support::Edges(edges) => (edges[position].face.cell, [0, 1, 2]),
                Support::Facets(facets) => {
                    let at = facets[position];
                    (at.cell, axes_of(system.mesh.kind(at.cell), usize::from(at.local)))
                }
            };
            let lines = Lines { element, nodes, n, values: adjoint };
            for (local, node) in nodes.iter().enumerate() {
                let whole: f64 = products[*node as usize * n..][..n].iter().sum();
                let part = whole.abs() / f64::from(around[*node as usize]);
                if part > 0.0 {
                    let shares = lines.shares(local);
                    (0..3).for_each(|d| parts[cell.index()][axes[d]] += part * shares[d]);
                }
            }
        }
    }
    parts
}

/// The directions of a cell that the parameters of a facet run along; those of simplices do not matter.
fn axes_of(kind: CellKind, local: usize) -> [usize; 3] {
    let map = kind.facet_map(local);
    let axis = |t: [f64; 3]| t.iter().position(|x| *x != 0.0).unwrap_or(0);
    [axis(map.tangents[0]), axis(map.tangents[1]), 0]
}

/// The lines of nodes of a tensor cell.
struct Lines<'a> {
    element: &'a Element,
    nodes: &'a [u32],
    /// Components of the field.
    n: usize,
    values: &'a [f64],
}

impl Lines<'_> {
    /// How much of a node's part goes to each direction: in proportion to the highest difference along the line of nodes
    /// through it, which is zero where the values are of a lower degree in that direction.
    fn shares(&self, local: usize) -> [f64; 3] {
        let (kind, degree) = (self.element.kind(), self.element.degree());
        let dim = kind.dim();
        let even = std::array::from_fn(|d| if d < dim { 1.0 / dim as f64 } else { 0.0 });
        let is_vertex = matches!(self.element.entities()[local], DofEntity::Vertex(_));
        if kind.subdivision() != Some(Subdivision::Layers) || is_vertex || degree == 0 {
            return if dim == 0 { [1.0, 0.0, 0.0] } else { even };
        }
        let mut size = [0.0f64; 3];
        let steps = degree + 1;
        for (d, size) in size.iter_mut().enumerate().take(dim) {
            let stride = steps.pow(u32::try_from(d).unwrap_or(0));
            let place = local / stride % steps;
            if place == 0 || place == degree {
                continue;
            }
            let first = local - place * stride;
            for c in 0..self.n {
                let at = |k: usize| self.values[self.nodes[first + k * stride] as usize * self.n + c];
                let (mut sum, mut factor) = (0.0, 1.0);
                for k in 0..steps {
                    sum += factor * at(k);
                    factor *= -((degree - k) as f64) / (k + 1) as f64;
                }
                *size += sum.abs();
            }
        }
        let total: f64 = size.iter().sum();
        if total > 0.0 { size.map(|s| s / total) } else { even }
    }
}

#[cfg(test)]
mod tests;
