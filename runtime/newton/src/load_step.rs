//! One load step: the problem, the solver, and what its iterations share; the measures of a state.

use std::time::Instant;

use super::{Evaluated, Method, NewtonError, NewtonOptions, StepHistory, Stop, Watch};
use crate::Iteration;
use crate::LinearSolver;
use wfl_compiler::types::FieldKind;
use wfl_contact::Contact;
use wfl_discrete::finite::largest as largest_of;
use wfl_discrete::system::{Branches, FIXED, Form, LinearTerms, Residual, System, Tangent};
use wfl_sparse::solve::SolveReport;

/// The rounding floor in units of roundoff times |K||u|.
const FLOOR_FACTOR: f64 = 4.0;

/// What one load step is solved with.
pub struct LoadStep<'a> {
    /// The equations.
    pub system: &'a System,
    /// The laws of contact and the state they are in.
    pub contact: &'a mut Contact,
    /// The linear solver.
    pub solver: &'a mut LinearSolver,
    /// The tangent that was assembled last.
    pub tangent: &'a mut Tangent,
    /// By dof: a constant residual on top of that of the scene, of which only the rest is to be balanced; or empty.
    pub offset: &'a [f64],
    /// How linear terms are evaluated; refinement sets it to points.
    pub linear: LinearTerms,
    /// When an iteration stops.
    pub options: NewtonOptions,
    /// What is told of each iteration.
    pub watch: &'a mut dyn Watch,
    /// What was spent on the step so far, attempts that failed included.
    pub spent: Spent,
}

/// What a step costs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spent {
    /// Newton iterations: those that are listed, the start aside.
    pub iterations: usize,
    /// Linear systems that were solved: corrections, predictors, merits and paths.
    pub linear_solves: usize,
    /// Seconds of factorisations.
    pub factor: f64,
    /// Seconds of solutions with a factor.
    pub solve: f64,
}

/// A residual with its measures.
pub(super) struct Measured {
    /// Of the scene as written, or with the frozen active set.
    pub(super) residual: Vec<f64>,
    /// That of the scene as written, with its sizes.
    pub(super) written: Residual,
    /// Largest over the fields of residual over scale, always of the scene as written.
    pub(super) relative: f64,
    /// What rounding leaves of it.
    pub(super) floor: f64,
    /// The residual of every kind of field is as small as rounding or the tolerance allows in fields of that kind.
    pub(super) settled: bool,
    /// Weighted 2-norm of `residual` over the free dofs, for the search.
    pub(super) norm: f64,
    /// What rounding leaves of that norm.
    pub(super) rounding: f64,
}

impl Measured {
    /// Why an iteration stops here, if it does.
    pub(super) fn stop(&self, options: NewtonOptions) -> Option<Stop> {
        if self.relative <= options.tolerance {
            return Some(Stop::Tolerance);
        }
        self.settled.then_some(Stop::Floor)
    }
}

/// How far a state is measured: the weights of the fields in the norm, and whether branches are frozen.
#[derive(Clone)]
pub(super) struct Norm {
    /// By field: what brings its equations to the units of forces.
    pub(super) weights: Vec<f64>,
    /// The residual is that with the frozen active set.
    pub(super) frozen: bool,
}

impl LoadStep<'_> {
    /// The equations as they are written.
    pub(super) fn form(&self) -> Form<'_> {
        Form { branches: Branches::AsWritten, linear: self.linear, offset: self.offset }
    }

    /// Assembles the tangent at `u`.
    pub(super) fn assemble_tangent(&mut self, u: &[f64], frozen: bool) -> Evaluated<()> {
        let branches = if frozen { Branches::Frozen(self.contact.active_set()) } else { Branches::AsWritten };
        self.system.tangent(u, branches, self.tangent)
    }

    /// The residual at `u` and its measures.
    pub(super) fn measure(&self, u: &[f64], norm: &Norm) -> Evaluated<Measured> {
        let system = self.system;
        let written = system.residual(u, &self.form())?;
        let sizes = system.sizes(u, &written, self.tangent);
        let scales = system.scales(&written, &sizes);
        // against a scale without bound every residual is small
        system.check_finite("sum of the sizes of forces", &sizes, u)?;
        // by field of one unit and size
        let (mut relative, mut floor) = (vec![0.0f64; system.fields.len()], vec![0.0f64; system.fields.len()]);
        for field in 0..system.fields.len() {
            let Some(range) = system.range(field) else { continue };
            let roundoff = roundoff(&u[range.clone()]);
            let free = |d: &usize| system.numbering.free[*d] != FIXED;
            let cancelled = largest_of(range.clone().map(|d| sizes[d]));
            let largest = largest_of(range.filter(free).map(|d| written.values[d]));
            if largest > 0.0 {
                let kind = system.alike(field);
                relative[kind] = relative[kind].max(largest / scales[field]);
                floor[kind] = floor[kind].max(FLOOR_FACTOR * roundoff * cancelled / scales[field]);
            }
        }
        let largest = |sizes: &[f64]| sizes.iter().fold(0.0f64, |m, x| m.max(*x));
        let least_of_all = largest(&floor);
        // each kind of unknown for itself: rounding of one says nothing of another. The equation of a multiplier has what
        // rounding leaves of the displacements in it, which its own numbers do not tell. Not finite, a floor says that
        // nothing is known, not that nothing is left to do
        let settled = (0..system.fields.len()).all(|k| {
            let of_unknowns = system.fields[k].kind == FieldKind::Multiplier;
            let least = if of_unknowns { least_of_all } else { floor[k] };
            relative[k] <= self.options.tolerance || least.is_finite() && relative[k] <= least
        });
        let (relative, floor) = (largest(&relative), least_of_all);
        let rounding = FLOOR_FACTOR * f64::EPSILON * self.weighted_norm(&sizes, &norm.weights);
        let residual = if norm.frozen {
            system.frozen_residual(&written, u, self.contact.active_set())?
        } else {
            written.values.clone()
        };
        let norm = self.weighted_norm(&residual, &norm.weights);
        Ok(Measured { residual, written, relative, floor, settled, norm, rounding })
    }

    /// The 2-norm over the free dofs, each times the weight of its field. Where squares leave the range of numbers the
    /// entries are divided by a power of two near the largest before.
    pub(super) fn weighted_norm(&self, residual: &[f64], weights: &[f64]) -> f64 {
        let entries = || {
            let fields = weights.iter().enumerate().filter_map(|(k, w)| Some((self.system.range(k)?, *w)));
            let all = fields.flat_map(|(range, weight)| range.map(move |d| (d, weight)));
            all.filter(|(d, _)| self.system.numbering.free[*d] != FIXED).map(|(d, w)| w * residual[d])
        };
        let norm = |unit: f64| entries().fold(0.0, |total, x| total + (x / unit).powi(2)).sqrt();
        let plain = norm(1.0);
        if plain.is_finite() && plain >= f64::MIN_POSITIVE.sqrt() {
            return plain;
        }
        let largest = largest_of(entries());
        if largest == 0.0 || !largest.is_finite() {
            return largest;
        }
        let unit = largest.log2().floor().clamp(-1000.0, 1000.0).exp2();
        unit * norm(unit)
    }

    /// Factors that bring the equations of multipliers to the units of forces: the ratio of the largest entries of the
    /// displacement rows to those of the multiplier rows in the columns of the other unknowns.
    pub(super) fn weights(&self) -> Vec<f64> {
        let system = self.system;
        let mut weights = vec![1.0; system.fields.len()];
        if system.fields.iter().all(|f| f.kind != FieldKind::Multiplier) {
            return weights;
        }
        let field_of = |free: usize| {
            let dof = system.numbering.free_dofs[free] as usize;
            (0..system.fields.len()).find(|f| system.range(*f).is_some_and(|r| r.contains(&dof)))
        };
        let kind = |f: usize| system.fields[f].kind;
        let mut stiffness = 0.0f64;
        let mut coupling = vec![0.0f64; system.fields.len()];
        let fields: Vec<Option<usize>> = (0..system.numbering.n_free()).map(field_of).collect();
        for (row, field) in fields.iter().enumerate() {
            let Some(f) = *field else { continue };
            let (columns, values) = self.tangent.changing.row(row);
            for (column, value) in columns.iter().zip(values) {
                if fields[*column as usize].is_some_and(|c| kind(c) != FieldKind::Multiplier) {
                    if kind(f) == FieldKind::Multiplier {
                        coupling[f] = coupling[f].max(value.abs());
                    } else {
                        stiffness = stiffness.max(value.abs());
                    }
                }
            }
        }
        // each rank has seen its rows
        let mut largest = [stiffness];
        system.team().max(&mut largest);
        system.team().max(&mut coupling);
        let [stiffness] = largest;
        for (f, weight) in weights.iter_mut().enumerate() {
            if kind(f) == FieldKind::Multiplier && coupling[f] > 0.0 && stiffness > 0.0 {
                *weight = stiffness / coupling[f];
            }
        }
        weights
    }

    /// Factors the tangent and solves for the correction of a residual by dof, of which the part `unseen` may be left.
    pub(super) fn correct(
        &mut self,
        residual: &[f64],
        unseen: f64,
        direction: &mut Vec<f64>,
        history: &mut StepHistory,
    ) -> Result<(), NewtonError> {
        self.factor()?;
        let mut rhs = Vec::new();
        self.system.numbering.gather(residual, &mut rhs);
        rhs.iter_mut().for_each(|r| *r = -*r);
        history.solves.push(self.solve(&rhs, direction, unseen)?);
        Ok(())
    }

    /// Hands the tangent to the linear solver.
    pub(super) fn factor(&mut self) -> Result<(), NewtonError> {
        let begin = Instant::now();
        let result = self.solver.update(self.system, self.tangent, self.contact.is_as_written());
        self.spent.factor += begin.elapsed().as_secs_f64();
        Ok(result?)
    }

    /// Solves with the factor at hand, over the free dofs.
    pub(super) fn solve(&mut self, rhs: &[f64], x: &mut Vec<f64>, unseen: f64) -> Result<SolveReport, NewtonError> {
        let begin = Instant::now();
        let forcing = self.solver.forcing(self.system, unseen);
        let result = self.solver.solve(rhs, x, forcing);
        self.spent.solve += begin.elapsed().as_secs_f64();
        self.spent.linear_solves += 1;
        Ok(result?)
    }

    /// `u = start + alpha * direction`, the direction by free number.
    pub(super) fn go(&self, start: &[f64], direction: &[f64], alpha: f64, u: &mut [f64]) {
        self.system.numbering.advance(start, direction, alpha, u);
    }

    /// Lists an iteration and tells it.
    pub(super) fn record(&mut self, history: &mut StepHistory, here: &Measured, done: Done) {
        let (contact, fingerprint) = branches(self.system, &here.written);
        let number = history.iterations.last().map_or(0, |last| last.number) + done.corrections;
        let iteration = Iteration {
            number,
            residual: here.relative,
            floor: here.floor,
            step: done.step,
            method: done.method,
            merit: here.norm,
            changed: done.changed,
            contact,
            fingerprint,
        };
        self.spent.iterations += done.corrections;
        self.watch.iteration(&iteration);
        history.iterations.push(iteration);
    }
}

/// What an iteration did.
#[derive(Clone, Copy)]
pub(super) struct Done {
    pub(super) method: Method,
    /// Part of the correction that was taken.
    pub(super) step: f64,
    /// Points whose branch in the active set is another one now.
    pub(super) changed: usize,
    /// Corrections that it took: none to a start, one to an iteration; a predictor may take more.
    pub(super) corrections: usize,
}

/// Unit of rounding of some unknowns, relative to the largest: numbers below 1e-308 have fewer digits.
fn roundoff(values: &[f64]) -> f64 {
    let largest = largest_of(values.iter().copied());
    if largest > 0.0 { f64::EPSILON.max(f64::from_bits(1) / largest) } else { f64::EPSILON }
}

/// Contact counts of the terms with kinks (the first of each region) and the fingerprint of all branches.
fn branches(system: &System, here: &Residual) -> (Option<[usize; 3]>, u64) {
    let mut total: Option<[usize; 3]> = None;
    let mut fingerprint = 0;
    let mut seen: Vec<*const wfl_discrete::assemble::Domain> = Vec::new();
    for (term, branches) in system.terms.iter().zip(&here.branches) {
        fingerprint ^= branches.fingerprint.rotate_left(u32::try_from(seen.len() % 64).expect("below 64"));
        let domain = std::sync::Arc::as_ptr(&term.integrator.domain);
        if let Some(counts) = term.contact_counts(branches)
            && !seen.contains(&domain)
        {
            seen.push(domain);
            let sum = total.get_or_insert([0; 3]);
            for (s, c) in sum.iter_mut().zip(counts) {
                *s += c;
            }
        }
    }
    (total, fingerprint)
}
