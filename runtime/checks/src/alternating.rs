//! Pressures that alternate from node to node in bodies whose volume they hold: pore pressures at steps that are too short,
//! and elements of equal degree.
//!
//! A pressure p on nodes acts on a displacement u through p Div_Test_u, and its own equation has Div_u or the rate of it. With
//! s its storage, k its mobility, M = C11 the stiffness of the body and a, b the factors of the two couplings, all as they
//! stand in the equations of a step, a jump of p is spread over a cell of size h within the step if h^2 (s - a b/M) <= 6 k:
//! that is the least step h^2/(6 c) of Vermeer and Verruijt (1981). Below it the pressure overshoots beside a drained face, and
//! with elements of equal degree, which bound no pressure as the mobility vanishes (Brezzi and Fortin 1991), it alternates in the
//! whole body. A short step without a jump does no harm: told is a pressure that is seen to alternate, a largest node beside a
//! smallest one beside another largest one, which no field that the mesh resolves has.

use wfl_compiler::types::{FieldKind, FieldOp};
use wfl_discrete::{field::FieldSpace, space::Space, system::System};
use wfl_mesh::{element::Family, mesh::CellId};

use crate::definite::sampled_cells;

/// Differences below this part of the range of the pressure are none: what is told is an amplitude that one sees in a
/// plot.
const SEEN: f64 = 0.03;
/// Of neighbours that are as large, within this part of the range, none is larger: what tolerances leave of equal
/// values is far below.
const LEVEL: f64 = 1e-3;
/// The square of the size of a cell, in units of diffusivity and increment, from which a step is too short: the bound of Vermeer
/// and Verruijt (1981), see above.
const BOUND: f64 = 6.0;
/// Part of what a pressure stands beside, its own values or the stress of its body, below which its differences are rounding: a
/// solution keeps ten digits at least.
const ROUNDING: f64 = 1e-9;

/// A pressure and the displacement that it acts on, by number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PorePressure {
    pressure: usize,
    displacement: usize,
    /// The last increment that was long enough for every cell that is looked at; linear terms need no second look.
    long_enough: Option<f64>,
}

/// A pressure that alternates from node to node.
#[derive(Clone, Debug, PartialEq)]
pub struct Alternating {
    /// The pressure.
    pub field: String,
    /// The displacement that it acts on.
    pub displacement: String,
    /// The largest difference between neighbours, in parts of the range of the field.
    pub share: f64,
    /// Where.
    pub position: [f64; 3],
    /// The least step there over the step that was taken; infinite without a mobility.
    pub too_short: f64,
    /// Both have the same degree.
    pub is_equal_order: bool,
}

/// The pressures of a scene on elements of degree 1 that are coupled with the volume of a body.
#[must_use]
pub fn pore_pressures(system: &System) -> Vec<PorePressure> {
    // neighbours across the parts of a mesh are not known to one rank
    system.mesh.check_whole(|| coupled_pressures(system))
}

fn coupled_pressures(system: &System) -> Vec<PorePressure> {
    let dim = system.mesh.dim();
    let nodal = |k: usize| match &system.fields[k].space {
        FieldSpace::Nodal(space) => space.family() == Family::Continuous && system.range(k).is_some(),
        _ => false,
    };
    if dim < 2 {
        return Vec::new();
    }
    let mut found = Vec::new();
    for (k, p) in system.fields.iter().enumerate() {
        if p.kind != FieldKind::Unknown || p.n_components != 1 || p.degree() != 1 || !nodal(k) {
            continue;
        }
        let body = (0..system.fields.len()).find(|u| {
            system.fields[*u].n_components == dim
                && system.fields[*u].kind == FieldKind::Unknown
                && couples(system, k, *u)
        });
        found.extend(body.map(|displacement| PorePressure { pressure: k, displacement, long_enough: None }));
    }
    found
}

/// True if terms on cells couple the values of a pressure and the gradient of a displacement both ways.
fn couples(system: &System, pressure: usize, displacement: usize) -> bool {
    let has = |tests: (usize, FieldOp), trials: (usize, FieldOp)| {
        system.terms.iter().filter(|t| t.on_cells()).any(|t| {
            t.law.entries.iter().any(|(test, trial)| {
                let (test, trial) = (t.law.tests[usize::from(*test)], t.law.trials[usize::from(*trial)]);
                (test.field.index(), test.op) == tests && (trial.field.index(), trial.op) == trials
            })
        })
    };
    let (p, u) = ((pressure, FieldOp::Value), (displacement, FieldOp::Grad));
    has(u, p) && has(p, u)
}

/// The pressures among these that alternate at the state `u` because of the step or the elements.
#[must_use]
pub fn alternating(system: &System, u: &[f64], among: &mut [PorePressure]) -> Vec<Alternating> {
    among.iter_mut().filter_map(|pair| judged(system, u, pair)).collect()
}

fn judged(system: &System, u: &[f64], pair: &mut PorePressure) -> Option<Alternating> {
    let (field, range) = (&system.fields[pair.pressure], system.range(pair.pressure)?);
    let FieldSpace::Nodal(space) = &field.space else { return None };
    let values = &u[range];
    let increment = system.step().increment;
    if system.is_linear() && pair.long_enough == Some(increment) {
        return None;
    }
    let cells =
        system.terms.iter().filter(|t| t.on_cells() && t.law.tests.iter().any(|s| s.field.index() == pair.pressure));
    let cells: Vec<CellId> = cells.flat_map(|t| sampled_cells(system, t)).collect();
    // most steps are long enough, and nothing more is looked at
    if cells.into_iter().all(|c| Coefficients::of(system, u, *pair, c).ratio(system, c).is_none_or(|r| r <= BOUND)) {
        pair.long_enough = Some(increment);
        return None;
    }
    let (share, node) = alternation(space, system, values)?;
    let cell = system.mesh.cells().find(|c| {
        let nodes = space.position_of_cell(*c).map(|p| space.entity_nodes(p));
        nodes.is_some_and(|nodes| nodes.contains(&node))
    })?;
    let at = Coefficients::of(system, u, *pair, cell);
    if at.is_rounding(system, u, *pair) {
        return None;
    }
    let ratio = at.ratio(system, cell)?;
    let body = &system.fields[pair.displacement];
    let too_short = ratio / BOUND;
    (too_short > 1.0).then(|| Alternating {
        field: field.name.clone(),
        displacement: body.name.clone(),
        share,
        position: space.node_coordinates()[node as usize],
        too_short,
        is_equal_order: body.degree() == field.degree(),
    })
}

/// The largest difference, in parts of the range, of a node that is smallest among its neighbours to two of them that are
/// largest among theirs and no neighbours of each other; with that node.
fn alternation(space: &Space, system: &System, values: &[f64]) -> Option<(f64, u32)> {
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    let range = high - low;
    // a pressure of one value, and rounding of it
    if range.is_nan() || range <= ROUNDING * high.abs().max(low.abs()) {
        return None;
    }
    let cells: Vec<usize> = system.mesh.cells().filter_map(|c| space.position_of_cell(c)).collect();
    let mut neighbours: Vec<Vec<u32>> = vec![Vec::new(); space.n_nodes()];
    for position in &cells {
        let nodes = space.entity_nodes(*position);
        for a in nodes {
            let own = &mut neighbours[*a as usize];
            nodes.iter().filter(|b| *b != a).for_each(|b| {
                if !own.contains(b) {
                    own.push(*b)
                }
            });
        }
    }
    let level = LEVEL * range;
    let is_top = |sign: f64, n: usize| neighbours[n].iter().all(|m| sign * (values[n] - values[*m as usize]) >= -level);
    let mut best: Option<(f64, u32)> = None;
    for sign in [1.0, -1.0] {
        let tops: Vec<bool> = (0..values.len()).map(|n| !neighbours[n].is_empty() && is_top(sign, n)).collect();
        for (node, around) in neighbours.iter().enumerate() {
            if around.is_empty() || !is_top(-sign, node) {
                continue;
            }
            let depth = |m: &u32| sign * (values[*m as usize] - values[node]);
            let above: Vec<u32> =
                around.iter().copied().filter(|m| tops[*m as usize] && depth(m) > SEEN * range).collect();
            let second = above.iter().enumerate().flat_map(|(k, a)| {
                let apart = above[..k].iter().filter(|b| !neighbours[*a as usize].contains(b));
                apart.map(|b| depth(a).min(depth(b)))
            });
            let size = second.fold(0.0f64, f64::max) / range;
            if size > best.map_or(SEEN, |b| b.0) {
                best = u32::try_from(node).ok().map(|node| (size, node));
            }
        }
    }
    best
}

/// What stands in the equations of a step at a cell, by the first entries.
#[derive(Clone, Copy, Debug, Default)]
struct Coefficients {
    storage: f64,
    mobility: f64,
    /// Of the pressure in the equations of the body.
    onto_body: f64,
    /// Of the strain in the equations of the pressure.
    of_body: f64,
    stiffness: f64,
}

impl Coefficients {
    /// At the state `u`: of a law that is not linear a mobility far from it may have any value, at a pressure of zero a negative one.
    fn of(system: &System, u: &[f64], pair: PorePressure, cell: CellId) -> Self {
        let values = system.values(u);
        let mut this = Self::default();
        for term in system.terms.iter().filter(|t| t.on_cells()) {
            let Some(at) = term.point_tangent(&system.mesh, values.view(), cell) else { continue };
            for (test, trial, value) in at.entries {
                let (of_p, of_u) = (|f: usize| f == pair.pressure, |f: usize| f == pair.displacement);
                let (t, s) = (test.field.index(), trial.field.index());
                match (test.op, trial.op) {
                    (FieldOp::Value, FieldOp::Value) if of_p(t) && of_p(s) => this.storage += value,
                    (FieldOp::Grad, FieldOp::Grad) if of_p(t) && of_p(s) && test.entry == 0 && trial.entry == 0 => {
                        this.mobility += value;
                    }
                    (FieldOp::Grad, FieldOp::Value) if of_u(t) && of_p(s) && test.entry == 0 => this.onto_body += value,
                    (FieldOp::Value, FieldOp::Grad) if of_p(t) && of_u(s) && trial.entry == 0 => this.of_body += value,
                    (FieldOp::Grad, FieldOp::Grad) if of_u(t) && of_u(s) && test.entry == 0 && trial.entry == 0 => {
                        this.stiffness += value;
                    }
                    _ => {}
                }
            }
        }
        this
    }

    /// h^2 (s - a b/M)/k; infinite where k vanishes and the rest does not.
    fn ratio(&self, system: &System, cell: CellId) -> Option<f64> {
        if self.stiffness == 0.0 {
            return None;
        }
        let dim = system.mesh.dim();
        let nodes = system.mesh.cell_vertices(cell);
        let mut h = f64::INFINITY;
        for a in nodes {
            for b in nodes.iter().filter(|b| *b != a) {
                let (x, y) = (system.mesh.node(*a), system.mesh.node(*b));
                h = h.min((0..dim).map(|d| (x[d] - y[d]).powi(2)).sum::<f64>().sqrt());
            }
        }
        let held = self.storage - self.onto_body * self.of_body / self.stiffness;
        let ratio = h * h * held / self.mobility;
        // with a mobility of none the sign of zero says nothing
        Some(if self.mobility == 0.0 { f64::INFINITY } else { ratio }).filter(|r| held != 0.0 && !r.is_nan())
    }

    /// True for a pressure that is rounding beside the stress of its body: its stiffness times what its displacements differ
    /// by over the extent of the mesh.
    fn is_rounding(&self, system: &System, u: &[f64], pair: PorePressure) -> bool {
        let spread = |field: usize| {
            let (values, n) = (&u[system.range(field).unwrap_or_default()], system.fields[field].n_components);
            let of = |c: usize| {
                let own = values.iter().skip(c).step_by(n);
                let (low, high) = own.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
                high - low
            };
            (0..n).map(of).fold(0.0, f64::max)
        };
        let (low, high) = system.mesh.bounds();
        let extent = (0..system.mesh.dim()).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
        let stress = self.stiffness * spread(pair.displacement) / extent;
        self.onto_body.abs() * spread(pair.pressure) <= ROUNDING * stress.abs()
    }
}

impl PorePressure {
    /// True if a finding is about it.
    #[must_use]
    pub fn is_of(&self, system: &System, found: &Alternating) -> bool {
        system.fields[self.pressure].name == found.field
    }
}
