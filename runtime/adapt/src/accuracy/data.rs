//! Data between the points of a rule: whether the terms of a scene see the formulas of the position in them.
//!
//! Loads and coefficients are formulas of the position, and a rule sees them at its points alone: a pulse, or a wave
//! shorter than a cell, may be missed by every run of a search, whose estimates then agree with each other and not with
//! the problem. Each such term is integrated with many more points, twice, on parts of the cells that do not lie on each
//! other: how far the nodal forces of the scene's own rule are from these says which terms need more points in the runs
//! that errors are estimated with, how far they are from each other what is not resolved even so. Integrals that are exact
//! under every rule cost nothing. Does not solve and does not change the rules of the scene.

use wfl_checks::under_rule;
use wfl_compiler::{
    Class,
    types::{InputSlot, UniformSlot},
};
use wfl_discrete::{
    assemble::AssembledTerm,
    field::FieldSpace,
    space::{Space, Support},
    system::{FIXED, System, SystemError},
    window::Window,
};
use wfl_mesh::{
    mesh::{Mesh, curved_in_space, curves},
    quadrature::{composite, vertex},
};
use wfl_problem::{Equations, RuleChoice, Sampling, Scene, bodies_of, parts};

/// What many points say of the data of a scene.
#[derive(Clone, Debug, Default)]
pub struct Probed {
    /// Terms that need more points, and how many.
    pub sampling: Sampling,
    /// The same with parts that lie elsewhere.
    pub other: Sampling,
    /// How far the two are from each other: the sum of the sizes of the differences of nodal forces over that of the
    /// forces, the largest of all terms.
    pub apart: f64,
    /// By how much the rules of the scene miss coefficients: cells in which they change cannot have the solution that
    /// follows from that, however many points see them. The sum of the sizes of the differences over that of the forces.
    pub coefficients: f64,
    /// The same by cell of the mesh, for the marks: dimensionless.
    pub parts: Vec<f64>,
}

/// The largest part by which the area of a circle is larger than that of its polygon with the angles of the boundary of a
/// mesh, where that seems to be curved; 0 elsewhere, and for meshes of second order.
#[must_use]
pub fn curvature(mesh: &Mesh) -> f64 {
    if mesh.order() > 1 || mesh.dim() < 2 {
        return 0.0;
    }
    let bodies = bodies_of(mesh);
    curves(mesh, &bodies).largest.max(curved_in_space(mesh, &bodies))
}

/// Looks at the data of a scene at a state with many points. What a term changes by less than `small` of its nodal forces
/// is left as it is.
///
/// # Errors
/// [`SystemError`] where a known field has no finite value.
pub fn probe(scene: &Scene, equations: &Equations, u: &[f64], small: f64) -> Result<Probed, SystemError> {
    let mut out = Probed { parts: vec![0.0; scene.system.mesh.n_cells()], ..Probed::default() };
    let wanted: Vec<usize> = (0..scene.system.terms.len()).filter(|k| has_data(&scene.system.terms[*k])).collect();
    if wanted.is_empty() {
        return Ok(out);
    }
    let now = equations.system.step();
    let mut own = scene.equations();
    own.system.set_known(equations.system.known());
    let mut solving = scene.solving(&mut own);
    for time in times(scene, &wanted).unwrap_or_else(|| vec![now.stage]) {
        let window = Window::new(time, now.increment);
        solving.set_data(window)?;
        solving.system.set_laws(window);
        for k in &wanted {
            let rule = scene.terms[*k].rule;
            if let Some(found) = one(solving.system, *k, rule, u) {
                found.add(solving.system, *k, small, &mut out);
            }
        }
    }
    Ok(out)
}

/// Whether a rule may miss what a term says of the position.
fn has_data(term: &AssembledTerm) -> bool {
    let law = &term.law;
    let reads = law.inputs.iter().any(|slot| matches!(slot, InputSlot::X(_)));
    reads && law.class < Class::Kinked && !law.tests.is_empty() && !law.degree.is_exact()
}

/// The values of the step variable at which the data are looked at: the last one, and where terms depend on it one in the
/// middle and the first one; `None` for a scene without a list of steps.
fn times(scene: &Scene, wanted: &[usize]) -> Option<Vec<f64>> {
    let values = &scene.steps.values;
    let last = values.len().checked_sub(1)?;
    let moves = |k: &usize| scene.system.terms[*k].law.prologue.slots.contains(&UniformSlot::Time);
    let mut list = vec![values[last]];
    if last > 0 && wanted.iter().any(moves) {
        list.extend([values[last / 2], values[0]]);
    }
    Some(list)
}

/// Nodal forces of a term under three rules.
struct Forces {
    own: Vec<f64>,
    /// With so many parts, and with the next number of them.
    parts: usize,
    many: Vec<f64>,
    more: Vec<f64>,
    /// By how much the own rule misses what multiplies the unknowns; `None` for loads.
    missed: Option<Vec<f64>>,
    /// Those without displacement, of a term that also has the unknowns.
    load: Option<Vec<f64>>,
}

fn one(system: &System, k: usize, rule: RuleChoice, u: &[f64]) -> Option<Forces> {
    let term = &system.terms[k];
    let degree = match rule {
        RuleChoice::Degree(degree) | RuleChoice::Segments { degree, .. } => degree,
        // masses and springs at nodes are a part of the method
        RuleChoice::Vertex | RuleChoice::Nodes { .. } if term.law.class > Class::Constant => return None,
        RuleChoice::Vertex | RuleChoice::Nodes { .. } => term.law.degree.rule(),
    };
    let domain = &term.integrator.domain;
    let points = domain.groups.iter().map(|g| g.n_points()).max()?;
    let dim = if term.on_cells() { domain.dim } else { domain.dim - 1 };
    let n = parts(dim, domain.n_entities, points);
    // where there is no finite value the run itself says so with the place
    let forces = |term: &AssembledTerm, u: &[f64]| {
        let mut out = vec![0.0; system.numbering.n_dofs];
        system.residual_of(term, u, &mut out).ok().map(|()| out)
    };
    let with = |n: usize| {
        let rule = |kind| composite(kind, degree, n).unwrap_or_else(|_| vertex(kind));
        under_rule(system, term, &rule)
    };
    let (many, more) = (with(n)?, with(n + 1)?);
    let (mut missed, mut load) = (None, None);
    if term.law.class > Class::Constant {
        // a term may have loads in it: what multiplies the unknowns is the rest
        let zero = vec![0.0; u.len()];
        let (own, seen) = (forces(term, u)?, forces(&many, u)?);
        let (own_load, seen_load) = (forces(term, &zero)?, forces(&many, &zero)?);
        let of = |d: usize| (own[d] - own_load[d] - seen[d] + seen_load[d]).abs();
        missed = Some((0..u.len()).map(of).collect());
        load = Some(own_load);
    }
    Some(Forces { own: forces(term, u)?, parts: n, many: forces(&many, u)?, more: forces(&more, u)?, missed, load })
}

impl Forces {
    fn add(&self, system: &System, k: usize, small: f64, out: &mut Probed) {
        let (mut moved, mut apart, mut size) = (0.0, 0.0, 0.0);
        let free: Vec<usize> = (0..self.own.len()).filter(|d| system.numbering.free[*d] != FIXED).collect();
        for d in &free {
            let (a, b) = (self.many[*d], self.more[*d]);
            moved += (self.own[*d] - a).abs().max((self.own[*d] - b).abs());
            apart += (a - b).abs();
            // at a solution what is in a term cancels: its load is measured apart from the rest
            let load = self.load.as_ref().map_or(0.0, |load| load[*d]);
            size += (a - load).abs().max((b - load).abs()).max((self.own[*d] - load).abs()) + load.abs();
        }
        if size <= 0.0 || moved <= small * size {
            return;
        }
        if self.parts > out.sampling.terms.iter().find(|t| t.0 == k).map_or(0, |t| t.1) {
            out.sampling.terms.push((k, self.parts));
            out.other.terms.push((k, self.parts + 1));
        }
        out.apart = out.apart.max(apart / size);
        if let Some(missed) = &self.missed {
            let share: f64 = free.iter().map(|d| missed[*d]).sum::<f64>() / size;
            if share > small {
                out.coefficients = out.coefficients.max(share);
                let each: Vec<f64> = missed.iter().map(|x| x / size).collect();
                to_cells(system, &each, &mut out.parts);
            }
        }
        if apart > small * size {
            let each: Vec<f64> = (0..self.own.len()).map(|d| (self.many[d] - self.more[d]).abs() / size).collect();
            to_cells(system, &each, &mut out.parts);
        }
    }
}

/// Adds numbers at dofs in equal parts to the cells around their nodes.
pub(super) fn to_cells(system: &System, each: &[f64], parts: &mut [f64]) {
    for (k, field) in system.fields.iter().enumerate() {
        let (Some(range), FieldSpace::Nodal(space)) = (system.range(k), &field.space) else { continue };
        let (n, values) = (field.n_components, &each[range]);
        let around = around(space);
        for position in 0..space.n_positions() {
            let cell = match space.support() {
                Support::Cells(cells) => cells[position],
                Support::Facets(facets) => facets[position].cell,
                Support::Edges(edges) => edges[position].face.cell,
            };
            for node in space.entity_nodes(position) {
                let node = *node as usize;
                let whole: f64 = values[node * n..][..n].iter().sum();
                parts[cell.index()] += whole / f64::from(around[node]);
            }
        }
    }
}

/// By node of a space how many of its cells or faces have it.
pub(super) fn around(space: &Space) -> Vec<u32> {
    let mut around = vec![0u32; space.n_nodes()];
    for position in 0..space.n_positions() {
        space.entity_nodes(position).iter().for_each(|node| around[*node as usize] += 1);
    }
    around
}
