//! Whether the law of a body knows a rotation: a rotation leaves no force, and its stress is symmetric.
//!
//! A body that only turns is not strained, so its law gives no stress; and by equilibrium of moments the stress of every
//! body is symmetric. Both hold at each point for the sum of the terms of a displacement on cells, and both are tried there
//! (Truesdell and Noll, The Non-Linear Field Theories of Mechanics, sections 17 and 19):
//!
//! - a law that is linear has K W = 0 and W K = 0 for every antisymmetric gradient W;
//! - one of small strains has P(H + W) = P(H) and P = P';
//! - one of finite strains has P(R F) = R P(F) and P F' = F P'.
//!
//! What is none of a body's is left alone: a law of components that do not know of each other (a vector Laplacian, the
//! viscous term of an incompressible flow) is told apart; the geometric stiffness W S of a body with the initial stress S
//! is allowed; where another unknown enters the antisymmetric part of the stress (micropolar bodies) nothing is tested, and
//! neither is a null Lagrangian (Navier's form of linear elasticity) where every boundary value is prescribed. Terms on
//! faces, reactions and inertia are no laws of a body.

use nalgebra::DMatrix;
use wfl_compiler::{
    Class,
    types::{FieldKind, FieldOp, InputSlot},
};
use wfl_discrete::{
    assemble::{AskedGradients, AssembledTerm, FieldValues, Gradient},
    field::FieldSpace,
    gradients::{identity, norm, product, rotation, sum, transposed},
    space::Support,
    system::{FIXED, System},
};
use wfl_mesh::mesh::{CellId, Topology, boundary_of};

use crate::definite::{sampled_cells, stiff_terms, stiffness};
use crate::worst::Finding;

/// What rounding may leave, in parts of what cancels: eigenvalues and differences of stresses lose some digits of
/// sixteen.
const ROUNDING: f64 = 1e-8;
/// A stiffness against rotation, or a change of a stress by one, below this part of that against shear may be meant: the
/// geometric stiffness of an initial stress (a body yields long before a twentieth of its shear modulus), damping.
const MEANT: f64 = 0.05;
/// Cells that are looked at, of those that are sampled: a law is one formula, its coefficients vary.
const CELLS: usize = 4;
/// The compliance of an unknown pressure times the shear modulus from which the medium counts as compressible: penalties on
/// pressures of incompressible flows are far below.
const COMPRESSIBLE: f64 = 1e-3;

/// What a law does that no body does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turning {
    /// A rotation gives a stress.
    Resists,
    /// The stress is not symmetric: its moments are not in balance.
    Moments,
    /// A finite rotation does not turn the stress with the body.
    Finite,
}

/// A body whose law is not objective.
#[derive(Clone, Debug, PartialEq)]
pub struct TurningBody {
    /// The displacement.
    pub field: String,
    /// Its terms there.
    pub terms: Vec<String>,
    /// What is wrong.
    pub what: Turning,
    /// How much: in parts of the stiffness against shear, or of the stress.
    pub share: f64,
    /// Where.
    pub position: [f64; 3],
    /// It may be meant unless the field is a displacement: components that do not know of each other, or the viscous term
    /// of an incompressible flow.
    pub may_be_no_body: bool,
}

/// The displacements whose laws are not objective, at the state without displacement and near it.
#[must_use]
pub fn turning_bodies(system: &System) -> Vec<TurningBody> {
    let dim = system.mesh.dim();
    let zero = vec![0.0; system.numbering.n_dofs];
    let values = system.values(&zero);
    let vector = |k: &usize| {
        let f = &system.fields[*k];
        let nodal = matches!(f.space, FieldSpace::Nodal(_));
        f.kind == FieldKind::Unknown && f.n_components == dim && nodal && system.range(*k).is_some()
    };
    let all = (0..system.fields.len()).filter(|k| dim > 1 && vector(k));
    all.filter_map(|field| Body { system, field, values: values.view() }.turning()).collect()
}

/// Which strains the law of a body is one of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Strains {
    /// Its stress depends on the symmetric part of the gradient.
    Small,
    /// Its stress turns with the body.
    Finite,
}

/// Which strains the law of a vector field knows; `None` where it is that of no body. Asked by all ranks together: each looks
/// at the first cell that it counts, and one without any says nothing.
pub(crate) fn strains_of(system: &System, field: usize) -> Option<Strains> {
    let zero = vec![0.0; system.numbering.n_dofs];
    let values = system.values(&zero);
    let body = Body { system, field, values: values.view() };
    let terms = stiff_terms(system, field);
    // the ranks are asked for the cells of every term, whichever has the first one here
    let cells: Vec<CellId> = terms.iter().flat_map(|t| sampled_cells(system, t)).collect();
    let at = |cell: CellId| {
        let at = stiffness(system, field, &terms, cell, values.view())?;
        body.strains(&terms, cell, &at.matrix).map(|(strains, _)| strains)
    };
    // by kind: of no body, of small strains, of finite ones
    let mut kinds = [0.0; 3];
    if let Some(cell) = cells.first() {
        kinds[match at(*cell) {
            None => 0,
            Some(Strains::Small) => 1,
            Some(Strains::Finite) => 2,
        }] = 1.0;
    }
    system.team().sum(&mut kinds);
    match kinds.map(|count| count > 0.0) {
        [false, true, false] => Some(Strains::Small),
        [false, false, true] => Some(Strains::Finite),
        _ => None,
    }
}

/// What a law of a vector field is known to be.
#[derive(Clone, Copy, Debug)]
pub(crate) enum KnownLaw {
    /// One of a body.
    Body {
        /// Which strains it knows.
        strains: Strains,
        /// The largest stiffness that was seen (force by gradient and area).
        modulus: f64,
    },
    /// One that a rotation changes.
    Turning {
        /// As in [`TurningBody`].
        share: f64,
        /// What it may be.
        limit: f64,
        /// Where.
        position: [f64; 3],
    },
    /// Neither is known, and why.
    None(&'static str),
}

/// The law of a vector field at the present step, without displacement; `None` where nothing resists its gradient. Asked by
/// all ranks together.
pub(crate) fn known_law(system: &System, field: usize) -> Option<KnownLaw> {
    let zero = vec![0.0; system.numbering.n_dofs];
    let values = system.values(&zero);
    let (body, team) = (Body { system, field, values: values.view() }, system.team());
    let terms = stiff_terms(system, field);
    // by kind: micropolar, of no body, of small strains, of small ones with a geometric stiffness, of finite ones
    let (mut kinds, mut modulus) = ([0.0; 5], 0.0f64);
    for cell in terms.iter().flat_map(|t| every(sampled_cells(system, t))).collect::<Vec<_>>() {
        let Some(at) = stiffness(system, field, &terms, cell, values.view()) else { continue };
        modulus = modulus.max(at.matrix.amax());
        let kind = match body.strains(&terms, cell, &at.matrix) {
            _ if !body.is_classical(cell) => 0,
            None => 1,
            Some((Strains::Small, true)) => 2,
            Some((Strains::Small, false)) => 3,
            Some((Strains::Finite, _)) => 4,
        };
        kinds[kind] += 1.0;
    }
    team.sum(&mut kinds);
    let modulus = team.largest(modulus);
    let turning = body.turning();
    let found = kinds.map(|count| count > 0.0);
    let may_turn = turning.as_ref().is_some_and(|body| body.may_be_no_body);
    Some(match (found, turning) {
        ([false, false, false, false, false], _) => return None,
        ([true, ..], _) => KnownLaw::None("another unknown enters the antisymmetric part of the stress"),
        _ if may_turn => KnownLaw::None("its components do not know of each other: it may be no body"),
        (_, Some(TurningBody { share, position, .. })) => KnownLaw::Turning { share, limit: MEANT, position },
        ([_, true, ..], _) => KnownLaw::None("the law is neither one of small nor one of finite strains"),
        ([_, _, _, true, _], _) => {
            KnownLaw::None("a small part of the stiffness resists rotations, as that of a stress")
        }
        ([_, _, true, _, true], _) => KnownLaw::None("there are laws of small and of finite strains"),
        ([_, _, true, ..], _) => KnownLaw::Body { strains: Strains::Small, modulus },
        _ => KnownLaw::Body { strains: Strains::Finite, modulus },
    })
}

/// A displacement with its terms.
struct Body<'a> {
    system: &'a System,
    field: usize,
    values: FieldValues<'a>,
}

/// What rotations change in a law, in parts of its stress.
struct Tried {
    /// The size of the gradient, in parts of the largest one that is tried.
    scale: f64,
    /// As a law of small strains: by what a rotation changes the stress, and its antisymmetric part.
    small: (f64, f64),
    /// The same as a law of finite strains.
    finite: (f64, f64),
    /// By what it is not one law for each component.
    split: f64,
    /// The same of what the gradient adds to the stress at rest.
    change: f64,
}

/// What was found at a cell.
struct Found {
    what: Turning,
    share: f64,
    position: [f64; 3],
    is_split: bool,
    terms: Vec<String>,
}

impl Body<'_> {
    /// Which strains the law knows at a cell with this stiffness at rest, and whether rotations leave nothing of its stress.
    fn strains(&self, terms: &[&AssembledTerm], cell: CellId, stiffness: &DMatrix<f64>) -> Option<(Strains, bool)> {
        let dim = self.system.mesh.dim();
        if terms.iter().all(|t| t.law.class <= Class::Linear) {
            let [shear, turns] = [shears(dim), rotations(dim)].map(|all| largest_response(stiffness, &all));
            let is_body = shear > ROUNDING * stiffness.amax() && turns <= MEANT * shear;
            return is_body.then_some((Strains::Small, turns <= ROUNDING * stiffness.amax()));
        }
        let tried = self.tried(cell, 0.0)?;
        let known = [(tried.small, Strains::Small), (tried.finite, Strains::Finite)];
        let holds = |(turns, skew): (f64, f64)| turns.max(skew) <= ROUNDING;
        known.into_iter().find(|(of, _)| holds(*of)).map(|(_, strains)| (strains, true))
    }

    fn turning(&self) -> Option<TurningBody> {
        let terms = stiff_terms(self.system, self.field);
        let cells: Vec<CellId> = terms.iter().flat_map(|t| every(sampled_cells(self.system, t))).collect();
        let mut worst: Option<Found> = None;
        for cell in cells {
            let Some(found) = self.at_cell(&terms, cell) else { continue };
            if worst.as_ref().is_none_or(|w| found.share > w.share) {
                worst = Some(found);
            }
        }
        let own = worst.map(|Found { what, share, position, is_split, terms }| Finding {
            size: share,
            numbers: [&[number(what), f64::from(u8::from(is_split))], position.as_slice()].concat(),
            names: terms,
        });
        let Finding { size, numbers, names } = Finding::worst(own, self.system.team())?;
        let [what, is_split, x, y, z] = numbers.try_into().ok()?;
        Some(TurningBody {
            field: self.system.fields[self.field].name.clone(),
            terms: names,
            what: turning(what),
            share: size,
            position: [x, y, z],
            may_be_no_body: is_split > 0.5,
        })
    }

    fn at_cell(&self, terms: &[&AssembledTerm], cell: CellId) -> Option<Found> {
        if !self.is_classical(cell) {
            return None;
        }
        let at = stiffness(self.system, self.field, terms, cell, self.values)?;
        let linear = terms.iter().all(|t| t.law.class <= Class::Linear) || self.is_straight(cell);
        let found = if linear { self.linear(&at.matrix, cell) } else { self.nonlinear(cell, &at.matrix) };
        let (what, share, is_split) = found?;
        Some(Found { what, share, position: at.position, is_split, terms: at.terms })
    }

    /// Of a law that is linear in the gradient.
    fn linear(&self, stiffness: &DMatrix<f64>, cell: CellId) -> Option<(Turning, f64, bool)> {
        let dim = self.system.mesh.dim();
        let size = stiffness.amax();
        let shear = largest_response(stiffness, &shears(dim));
        // without a resistance to shear it is no solid: a curl, a penalty on a divergence
        if size == 0.0 || shear <= ROUNDING * size {
            return None;
        }
        let of = |k: &DMatrix<f64>| largest_response(k, &rotations(dim));
        let (resists, moments) = (of(stiffness), of(&stiffness.transpose()));
        let share = resists.max(moments) / shear;
        if share <= MEANT || share * shear <= ROUNDING * size {
            return None;
        }
        let geometric = geometric_stress(stiffness, dim);
        let stress = self.stress_at_rest(cell);
        let initial = geometric.as_ref().zip(stress).is_some_and(|(s, p)| is_near(s, &p));
        let null = is_multiple_of_rotations(stiffness, dim) && self.is_held_all_around();
        if initial || null {
            return None;
        }
        let what = if resists > ROUNDING * size { Turning::Resists } else { Turning::Moments };
        Some((what, share, self.may_be_no_body(stiffness, cell)))
    }

    /// Whether the stress is a straight line of the gradient, though terms are none of the field: the convection of a flow.
    fn is_straight(&self, cell: CellId) -> bool {
        let (h, zero) = (deformation(self.system.mesh.dim(), 1.0), [[0.0; 3]; 3]);
        let asked = [zero, h, sum(&zero, &h, -1.0), sum(&h, &h, 1.0)];
        let others = self.others(cell);
        others.is_some_and(|others| {
            others.into_iter().all(|others| {
                let Some(fluxes) = self.fluxes(cell, &asked, others) else { return false };
                let [rest, ahead, behind, far] = [0, 1, 2, 3].map(|k| &fluxes[k]);
                let bend = |a: &Gradient, b: &Gradient, middle: &Gradient| norm(&sum(&sum(a, b, 1.0), middle, -2.0));
                let size = ROUNDING * norm(ahead).max(norm(rest));
                bend(ahead, behind, rest) <= size && bend(far, rest, ahead) <= size
            })
        })
    }

    /// Values of other unknowns that are tried: pressures and the like take the size of the stress, too, so that what they
    /// multiply is seen.
    fn others(&self, cell: CellId) -> Option<[f64; 3]> {
        let still = self.fluxes(cell, &[deformation(self.system.mesh.dim(), 1.0)], 0.0)?;
        Some([0.0, 0.1, norm(&still[0])])
    }

    /// Of a law that is not.
    fn nonlinear(&self, cell: CellId, stiffness: &DMatrix<f64>) -> Option<(Turning, f64, bool)> {
        let found = self.others(cell)?.into_iter().filter_map(|others| self.nonlinear_with(cell, others));
        let (what, share, is_split) = found.max_by(|a, b| a.1.total_cmp(&b.1))?;
        // a viscosity that follows the rate, beside the pressure of an incompressible flow
        let is_flow = is_split && self.incompressible(cell, stiffness[(0, 0)]) == Some(true);
        Some((what, share, is_flow))
    }

    /// What is wrong, by how much, and whether the stress without that at rest is one law for each component.
    fn nonlinear_with(&self, cell: CellId, others: f64) -> Option<(Turning, f64, bool)> {
        let Tried { scale, small, finite, split, change } = self.tried(cell, others)?;
        let of = |pair: (f64, f64)| pair.0.max(pair.1);
        let share = of(small).min(of(finite));
        let told = share > MEANT * scale && split > ROUNDING;
        let what = if of(finite) <= of(small) && finite.0 <= ROUNDING { Turning::Moments } else { Turning::Finite };
        told.then_some((what, share, change <= ROUNDING))
    }

    /// The law tried with rotations; `None` where it has no finite stress.
    fn tried(&self, cell: CellId, others: f64) -> Option<Tried> {
        let dim = self.system.mesh.dim();
        [1.0, 0.01].into_iter().find_map(|scale| {
            let h = deformation(dim, scale);
            let f = sum(&h, &identity(dim), 1.0);
            let (w, r) = (spin(dim, scale), rotation(dim));
            let turned = sum(&product(&r, &f), &identity(dim), -1.0);
            let asked = [h, sum(&h, &w, 1.0), turned, product(&r, &h), [[0.0; 3]; 3]];
            let fluxes = self.fluxes(cell, &asked, others)?;
            let [stress, spun, of_turned, of_mixed, rest] = fluxes.as_slice() else { return None };
            let size = norm(stress);
            let all = fluxes.iter().flatten().flatten().all(|x| x.is_finite());
            let kirchhoff = product(stress, &transposed(&f));
            let skew = |p: &Gradient| norm(&sum(p, &transposed(p), -1.0)) / size;
            let with = product(&r, stress);
            let without = |p: &Gradient| sum(p, rest, -1.0);
            let change = sum(&without(of_mixed), &product(&r, &without(stress)), -1.0);
            (all && size > 0.0).then(|| Tried {
                scale,
                small: (norm(&sum(spun, stress, -1.0)) / size, skew(stress)),
                finite: (norm(&sum(of_turned, &with, -1.0)) / size, skew(&kirchhoff)),
                split: norm(&sum(of_mixed, &with, -1.0)) / size,
                change: norm(&change) / size,
            })
        })
    }

    /// The sum of the fluxes of all terms on a cell against the gradient of the test function, at gradients of the field;
    /// other unknowns have this value.
    fn fluxes(&self, cell: CellId, gradients: &[Gradient], others: f64) -> Option<Vec<Gradient>> {
        let mut all = vec![[[0.0; 3]; 3]; gradients.len()];
        let mut some = false;
        for term in self.system.terms.iter().filter(|t| t.on_cells() && tests(t, self.field)) {
            let kind = |k: usize| self.system.fields.get(k).map(|f| f.kind);
            let is_other = |k: usize| k != self.field && kind(k) == Some(FieldKind::Unknown);
            let asked = AskedGradients { field: self.field, gradients, is_other: &is_other, other: others };
            let Some(fluxes) = term.flux_with(&self.system.mesh, self.values, cell, &asked) else { continue };
            some = true;
            all.iter_mut().zip(&fluxes).for_each(|(sum_of, flux)| *sum_of = sum(sum_of, flux, 1.0));
        }
        some.then_some(all)
    }

    /// The stress without displacement: that of loads against gradients.
    fn stress_at_rest(&self, cell: CellId) -> Option<Gradient> {
        Some(self.fluxes(cell, &[[[0.0; 3]; 3]], 0.0)?[0])
    }

    /// True unless another unknown enters the antisymmetric part of the stress.
    fn is_classical(&self, cell: CellId) -> bool {
        let dim = self.system.mesh.dim();
        let mut by_trial: Vec<((usize, FieldOp, u16), Gradient)> = Vec::new();
        for term in self.system.terms.iter().filter(|t| t.on_cells() && tests(t, self.field)) {
            let Some(at) = term.point_tangent(&self.system.mesh, self.values, cell) else { continue };
            for (test, trial, value) in at.entries {
                let own = test.field.index() == self.field && test.op == FieldOp::Grad;
                if own && trial.field.index() != self.field {
                    let key = (trial.field.index(), trial.op, trial.entry);
                    let place = by_trial.iter().position(|(k, _)| *k == key).unwrap_or_else(|| {
                        by_trial.push((key, [[0.0; 3]; 3]));
                        by_trial.len() - 1
                    });
                    by_trial[place].1[usize::from(test.entry) % dim][usize::from(test.entry) / dim] += value;
                }
            }
        }
        by_trial.iter().all(|(_, m)| norm(&sum(m, &transposed(m), -1.0)) <= ROUNDING * norm(m))
    }

    /// True for components that do not know of each other; beside a pressure only if that makes a flow incompressible: its
    /// equation has no compliance and no rate of the field. A penalty on the divergence may be added then.
    fn may_be_no_body(&self, stiffness: &DMatrix<f64>, cell: CellId) -> bool {
        let dim = self.system.mesh.dim();
        let divergence = if dim > 1 { stiffness[(0, dim + 1)] } else { 0.0 };
        let n = dim * dim;
        let is_diagonal = |k: usize| k.is_multiple_of(dim + 1);
        let rest = DMatrix::from_fn(n, n, |p, q| {
            stiffness[(p, q)] - if is_diagonal(p) && is_diagonal(q) { divergence } else { 0.0 }
        });
        match self.incompressible(cell, rest[(0, 0)]) {
            Some(incompressible) => incompressible && is_split(&rest, dim),
            None => is_split(stiffness, dim),
        }
    }

    /// Whether another unknown that acts as a pressure leaves no volume to change; `None` without one.
    fn incompressible(&self, cell: CellId, modulus: f64) -> Option<bool> {
        let (mut couples, mut compliance, mut rates) = (None, 0.0f64, false);
        for term in self.system.terms.iter().filter(|t| t.on_cells()) {
            let Some(at) = term.point_tangent(&self.system.mesh, self.values, cell) else { continue };
            for (test, trial, value) in at.entries {
                let (test, trial) = ((test.field.index(), test.op), (trial.field.index(), trial.op));
                if test == (self.field, FieldOp::Grad) && trial.0 != self.field && trial.1 == FieldOp::Value {
                    couples = Some(trial.0);
                }
                if test == trial && test.1 == FieldOp::Value && test.0 != self.field {
                    compliance = compliance.max(value.abs());
                }
            }
            let tests_other = term.law.tests.iter().any(|t| t.field.index() != self.field);
            rates |= tests_other && term.law.inputs.iter().any(|slot| self.is_past(slot));
        }
        couples.map(|_| compliance * modulus < COMPRESSIBLE && !rates)
    }

    fn is_past(&self, slot: &InputSlot) -> bool {
        match slot {
            InputSlot::Previous(b) | InputSlot::History(_, b) => b.field.index() == self.field,
            _ => false,
        }
    }

    /// True if the values of the field are prescribed on the whole boundary of its cells.
    fn is_held_all_around(&self) -> bool {
        let (system, field) = (self.system, &self.system.fields[self.field]);
        let FieldSpace::Nodal(space) = &field.space else { return false };
        let (Support::Cells(cells), Some(range)) = (space.support(), system.range(self.field)) else { return false };
        let Ok(topology) = Topology::new(&system.mesh) else { return false };
        let boundary = boundary_of(&system.mesh, &topology, cells);
        let nodes = space.nodes_on_facets(&system.mesh, &topology, &boundary);
        let fixed = |d: usize| system.numbering.free[d] == FIXED;
        let n = field.n_components;
        !nodes.is_empty() && nodes.iter().all(|node| (0..n).all(|c| fixed(range.start + *node as usize * n + c)))
    }
}

fn number(what: Turning) -> f64 {
    match what {
        Turning::Resists => 0.0,
        Turning::Moments => 1.0,
        Turning::Finite => 2.0,
    }
}

fn turning(number: f64) -> Turning {
    match number {
        n if n < 0.5 => Turning::Resists,
        n if n < 1.5 => Turning::Moments,
        _ => Turning::Finite,
    }
}

/// A few of some cells.
fn every(cells: Vec<CellId>) -> impl Iterator<Item = CellId> {
    let stride = cells.len().div_ceil(CELLS).max(1);
    cells.into_iter().step_by(stride)
}

/// True for a term that is tested with the gradient of a field.
fn tests(term: &AssembledTerm, field: usize) -> bool {
    term.law.tests.iter().any(|t| t.field.index() == field && t.op == FieldOp::Grad)
}

/// The largest |K g| over some gradients of length 1.
fn largest_response(stiffness: &DMatrix<f64>, gradients: &[Gradient]) -> f64 {
    gradients.iter().map(|g| apply(stiffness, g)).map(|p| norm(&p)).fold(0.0, f64::max)
}

/// K g, of a stiffness over the entries of the gradient, the first index fastest.
fn apply(stiffness: &DMatrix<f64>, g: &Gradient) -> Gradient {
    let n = stiffness.nrows();
    let dim = if n == 4 { 2 } else { 3 };
    let mut out = [[0.0; 3]; 3];
    for p in 0..n {
        out[p % dim][p / dim] = (0..n).map(|q| stiffness[(p, q)] * g[q % dim][q / dim]).sum();
    }
    out
}

/// Rotations of length 1 in the planes of the axes.
fn rotations(dim: usize) -> Vec<Gradient> {
    planes(dim).map(|(a, b)| two_entries((a, b, 0.5f64.sqrt()), (b, a, -(0.5f64.sqrt())))).collect()
}

/// Strains of length 1 that keep the volume.
fn shears(dim: usize) -> Vec<Gradient> {
    let (s, mut all) = (0.5f64.sqrt(), Vec::new());
    for (a, b) in planes(dim) {
        all.push(two_entries((a, b, s), (b, a, s)));
        all.push(two_entries((a, a, s), (b, b, -s)));
    }
    all
}

fn planes(dim: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..dim).flat_map(move |b| (0..b).map(move |a| (a, b)))
}

fn two_entries(first: (usize, usize, f64), second: (usize, usize, f64)) -> Gradient {
    let mut g = [[0.0; 3]; 3];
    g[first.0][first.1] = first.2;
    g[second.0][second.1] = second.2;
    g
}

/// The symmetric S with K W = W S for every rotation W, if there is one: the initial stress of a geometric stiffness.
fn geometric_stress(stiffness: &DMatrix<f64>, dim: usize) -> Option<Gradient> {
    let (mut stress, mut seen) = ([[0.0; 3]; 3], [false; 3]);
    for (w, (a, b)) in rotations(dim).iter().zip(planes(dim)) {
        let p = apply(stiffness, w);
        let s = 0.5f64.sqrt();
        // row a of W S is that of S at b, row b the opposite of that at a
        for (row, from, factor) in [(b, a, 1.0 / s), (a, b, -1.0 / s)] {
            if !seen[row] {
                (0..dim).for_each(|j| stress[row][j] = factor * p[from][j]);
                seen[row] = true;
            }
        }
    }
    let left = |w: &Gradient| norm(&sum(&apply(stiffness, w), &product(w, &stress), -1.0));
    let size = norm(&stress);
    let fits = rotations(dim).iter().all(|w| left(w) <= ROUNDING * size);
    (fits && norm(&sum(&stress, &transposed(&stress), -1.0)) <= ROUNDING * size).then_some(stress)
}

/// True if two stresses agree to a hundredth.
fn is_near(a: &Gradient, b: &Gradient) -> bool {
    norm(&sum(a, b, -1.0)) <= 0.01 * norm(a)
}

/// True if K W is one multiple of W for all rotations W: a null Lagrangian takes it away.
fn is_multiple_of_rotations(stiffness: &DMatrix<f64>, dim: usize) -> bool {
    let all = rotations(dim);
    let (a, b) = planes(dim).next().unwrap_or_default();
    let factor = apply(stiffness, &all[0])[a][b] / all[0][a][b];
    all.iter().all(|w| norm(&sum(&apply(stiffness, w), w, -factor)) <= ROUNDING * stiffness.amax())
}

/// True if the components do not know of each other and have one law.
fn is_split(stiffness: &DMatrix<f64>, dim: usize) -> bool {
    let limit = ROUNDING * stiffness.amax();
    let n = dim * dim;
    let same = |p: usize, q: usize| {
        let (i, j, k, l) = (p % dim, p / dim, q % dim, q / dim);
        let expected = if i == k { stiffness[(dim * j, dim * l)] } else { 0.0 };
        (stiffness[(p, q)] - expected).abs() <= limit
    };
    (0..n).all(|p| (0..n).all(|q| same(p, q)))
}

/// A gradient of no symmetry that changes the volume.
fn deformation(dim: usize, scale: f64) -> Gradient {
    let h = [[0.19, 0.15, -0.05], [-0.09, 0.11, 0.08], [0.07, -0.04, 0.13]];
    std::array::from_fn(|i| std::array::from_fn(|j| if i < dim && j < dim { scale * h[i][j] } else { 0.0 }))
}

/// An antisymmetric gradient.
fn spin(dim: usize, scale: f64) -> Gradient {
    let w = [[0.0, 0.3, -0.2], [-0.3, 0.0, 0.25], [0.2, -0.25, 0.0]];
    std::array::from_fn(|i| std::array::from_fn(|j| if i < dim && j < dim { scale * w[i][j] } else { 0.0 }))
}
