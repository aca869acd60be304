//! The discrete problem of a scene: dofs, fixed values, assembled terms.
//!
//! Dofs of all unknown fields stand in one vector, field after field, node after node, component fastest. Terms are
//! kept by class: constant ones are summed once per step, linear ones are a matrix assembled once (once per step if
//! the step variable enters), only the others are assembled at each state. Fixed dofs keep their rows in residuals
//! (their entries are reactions) and are left out of the systems that are solved.
//!
//! Promises: a residual or a tangent depends on its arguments, the step ([`System::begin_step`]) and the known fields
//! alone. Knows no contact, no solver and no iteration.

mod applied;
mod bodies;
mod cancelled;
mod constants;
mod equations;
mod finite_strain;
mod flight;
mod form;
mod held;
mod images;
mod inspect;
mod known;
mod levels;
mod linear;
mod massless;
mod node_layout;
mod numbering;
mod on_faces;
mod operator;
mod past;
mod places;
mod positions;
mod rate_forms;
mod residual;
mod shared;
mod sizes;
mod soften;
mod tangent;

use std::sync::{Arc, OnceLock};

use constants::Steady;
pub use finite_strain::FiniteStrain;
pub use form::{ActiveSet, Branches, Form, LinearTerms, StateValues, TermBranches};
use held::WithoutMatrix;
pub use known::{Known, Past};
use linear::LinearMatrix;
pub use linear::Redistribution;
pub use numbering::{FIXED, Numbering, Tie};
use on_faces::OnFaces;
use past::PastMatrices;
pub use past::{PastForm, is_affine_in_the_past, is_of_rates, readings, stays};
use places::Places;
use places::SceneAxes;
use positions::Placed;
pub use rate_forms::InRates;
use rate_forms::RateForms;
pub use residual::Residual;
use shared::Counts;
use sizes::meeting_fields;
pub use tangent::{StandIn, Tangent};
use thiserror::Error;
use wfl_compiler::Class;

use crate::assemble::{AssembledTerm, TermError};
use crate::field::Field;
use crate::finite::BadGiven;
use crate::frames::{Frame, Frames};
use crate::pruning::Pruning;
use crate::share::Share;
use crate::window::Window;
use wfl_host::memory::{TooMuchMemory, claim_numbers};
use wfl_mesh::mesh::Mesh;
use wfl_sparse::csr::{Csr, CsrError, Pattern, PatternBuilder};

/// Raises terms of a class to terms of which nothing is known.
fn forget(terms: &mut [AssembledTerm], class: Class) {
    for term in terms.iter_mut().filter(|t| t.law.class == class) {
        Arc::make_mut(&mut term.law).class = Class::Nonlinear;
    }
}

/// A term whose branches are data: what takes the place of a term with projections while its active set is frozen.
#[derive(Clone)]
pub struct FrozenTerm {
    /// Position of the term that it replaces.
    pub term: usize,
    /// The term that reads its branches; its branches and their regularisation are two fields behind those of the scene.
    pub form: AssembledTerm,
}

/// The assembled problem at one step. A copy shares mesh, fields and code, and what was found of matrices.
#[derive(Clone)]
pub struct System {
    /// The mesh.
    pub mesh: Arc<Mesh>,
    /// The fields.
    pub fields: Arc<Vec<Field>>,
    /// The dofs.
    pub numbering: Arc<Numbering>,
    /// Every term, loads included.
    pub terms: Vec<AssembledTerm>,
    /// Data and the past.
    known: Known,
    frozen: Vec<FrozenTerm>,
    /// The step that the laws stand at.
    window: Window,
    linear: Option<Arc<LinearMatrix>>,
    /// By linear term: the uniforms that the matrix was assembled with.
    linear_uniforms: Vec<Vec<f64>>,
    /// The scalar of the mass beside the terms that the matrix was assembled with.
    linear_mass: f64,
    bulk: Arc<Csr>,
    /// Where the changing terms stand in their matrix, once that is asked for; copies find it together.
    places: Arc<OnceLock<Places>>,
    constant: Vec<f64>,
    /// By dof, what rounding of `constant` is relative to.
    constant_sizes: Vec<f64>,
    /// By body: it acts on free dofs.
    loaded: Vec<bool>,
    /// The state at which `constant` is what affine terms give; empty for zero.
    base: Vec<f64>,
    /// What of it stays from step to step: of terms that read the step variable, and of the others.
    steady: Option<[Steady; 2]>,
    /// The derivatives of terms whose constants are made by matrices, and these once they are assembled.
    past_forms: Vec<PastForm>,
    past_matrices: Option<Arc<PastMatrices>>,
    /// The derivatives of terms in rates, as far as they have been asked for.
    rate_forms: RateForms,
    /// By field: the first field of those whose forces meet on interfaces.
    meets: Vec<usize>,
    bodies: bodies::Found,
    /// Of the mesh along the axis where it is the largest.
    extent: f64,
    placed: Placed,
    /// What is done although the scene does not need it.
    kept: Vec<Pruning>,
    /// The rows of this rank where several assemble: matrices have no others.
    share: Option<Arc<Share>>,
    counts: Counts,
    /// What takes the mass from some nodes.
    redistribution: Option<Arc<Redistribution>>,
    /// Dofs without inertia of bodies that have some elsewhere, rising.
    static_beside_inertia: Arc<Vec<usize>>,
    /// The terms of finite strain, once they have been asked for.
    finite_strain: OnceLock<Vec<FiniteStrain>>,
    /// Terms have an operator in place of their matrix.
    without_matrix: Option<Arc<WithoutMatrix>>,
    /// Tangents have the part of the terms on faces beside them.
    on_faces: Option<Arc<OnFaces>>,
}

impl System {
    /// A system over these terms; assembles nothing yet.
    #[must_use]
    pub fn new(
        mesh: Mesh,
        fields: Vec<Field>,
        numbering: Numbering,
        mut terms: Vec<AssembledTerm>,
        known: Known,
    ) -> Self {
        for k in 1..terms.len() {
            let (before, own) = terms.split_at_mut(k);
            own[0].share_dofs(before);
        }
        let n_free = numbering.n_free();
        let constant = vec![0.0; numbering.n_dofs];
        let meets = meeting_fields(&fields, &terms);
        let (low, high) = mesh.bounds();
        let placed = Placed::new(&fields, &terms, [low, high]);
        let extent = (0..3).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
        let mut this = Self {
            mesh: Arc::new(mesh),
            fields: Arc::new(fields),
            numbering: Arc::new(numbering),
            terms,
            known,
            frozen: Vec::new(),
            window: Window::default(),
            linear: None,
            linear_uniforms: Vec::new(),
            linear_mass: 0.0,
            bulk: Arc::new(nothing(n_free)),
            places: Arc::default(),
            constant_sizes: constant.clone(),
            constant,
            loaded: Vec::new(),
            base: Vec::new(),
            steady: None,
            past_forms: Vec::new(),
            past_matrices: None,
            rate_forms: RateForms::default(),
            meets,
            bodies: bodies::Found::new(),
            extent,
            placed,
            kept: Vec::new(),
            share: None,
            counts: Counts::default(),
            redistribution: None,
            static_beside_inertia: Arc::default(),
            finite_strain: OnceLock::new(),
            without_matrix: None,
            on_faces: None,
        };
        // on a part of a mesh there is nobody who has all rows
        this.share_again();
        this.forget_places();
        this
    }

    /// Gives terms their frozen forms; their branches are fields numbered behind those of the scene.
    pub fn add_frozen(&mut self, frozen: Vec<FrozenTerm>) {
        self.frozen = frozen;
        self.rate_forms.clear();
        self.forget_places();
    }

    /// The terms that have a frozen form.
    #[must_use]
    pub fn frozen(&self) -> &[FrozenTerm] {
        &self.frozen
    }

    /// Does something although the scene does not need it, to measure what leaving it out saves; before [`Self::add_frozen`].
    pub fn keep(&mut self, pruning: Pruning) {
        self.kept.push(pruning);
        match pruning {
            Pruning::Constant if !self.is_linear() => forget(&mut self.terms, Class::Constant),
            Pruning::Linear => forget(&mut self.terms, Class::Linear),
            _ => {}
        }
    }

    /// True unless the scene was prepared without this pruning.
    #[must_use]
    pub fn uses(&self, pruning: Pruning) -> bool {
        !self.kept.contains(&pruning)
    }

    /// True if no term needs Newton.
    #[must_use]
    pub fn is_linear(&self) -> bool {
        self.terms.iter().all(|t| t.law.class <= Class::Linear)
    }

    /// True if images of points follow the bodies.
    #[must_use]
    pub fn has_moving_images(&self) -> bool {
        self.terms.iter().any(|t| t.integrator.moves())
    }

    /// True if every tangent is symmetric.
    #[must_use]
    pub fn is_symmetric(&self) -> bool {
        self.terms.iter().chain(self.frozen.iter().map(|f| &f.form)).all(|t| t.law.symmetric)
    }

    /// True if the linear terms are symmetric.
    #[must_use]
    pub fn bulk_is_symmetric(&self) -> bool {
        self.terms.iter().filter(|t| t.law.class == Class::Linear).all(|t| t.law.symmetric)
    }

    /// The matrix of the linear terms over the free dofs; without entries before the first step, and where an operator stands
    /// in its place ([`Self::matrix`] assembles it there).
    #[must_use]
    pub fn bulk(&self) -> &Csr {
        &self.bulk
    }

    /// Whether that matrix depends on the step variable or its increment, or may do so.
    #[must_use]
    pub fn bulk_follows_steps(&self) -> bool {
        self.linear_terms().any(|t| t.law.tangent_reads_known || t.law.tangent_has_uniforms)
    }

    /// The same to keep, without a copy.
    #[must_use]
    pub fn shared_bulk(&self) -> Arc<Csr> {
        Arc::clone(&self.bulk)
    }

    /// True if every term is affine in the unknowns once its branches are frozen: then a full step solves the frozen
    /// problem.
    #[must_use]
    pub fn is_affine_when_frozen(&self) -> bool {
        let affine = |k: usize| self.frozen.iter().any(|f| f.term == k && f.form.law.class <= Class::Linear);
        self.terms.iter().enumerate().all(|(k, t)| t.law.class <= Class::Linear || affine(k))
    }

    /// True if a term on faces is not affine in the unknowns once its branches are frozen: a joint that softens.
    #[must_use]
    pub fn has_curved_faces(&self) -> bool {
        let frozen = |k: usize| self.frozen.iter().find(|f| f.term == k).map(|f| f.form.law.class);
        let class = |k: usize| frozen(k).unwrap_or(self.terms[k].law.class);
        (0..self.terms.len()).any(|k| !self.terms[k].on_cells() && class(k) > Class::Linear)
    }

    /// Brings the laws of all terms to a step; assembles nothing.
    pub fn set_laws(&mut self, window: Window) {
        let window = self.with_present_rates(window);
        self.window = window;
        let frozen = self.frozen.iter_mut().map(|f| &mut f.form);
        self.terms.iter_mut().chain(frozen).for_each(|t| t.set_step(window));
    }

    /// Looks at the equations with other rates. Afterwards these are as they were, and laws stand at `window`.
    pub fn with_other_rates<T>(&mut self, window: Window, look: impl FnOnce(&mut Self) -> T) -> T {
        let rates = self.known.rates.clone();
        let found = look(self);
        self.known.rates = rates;
        self.set_laws(window);
        found
    }

    /// The step that the laws stand at, with the scalars of rates that they were told.
    #[must_use]
    pub fn step(&self) -> Window {
        self.window
    }

    /// Begins a step: constant terms are summed, linear ones assembled where they are new. Returns true if the
    /// matrix of the linear terms has changed.
    ///
    /// With rates, affine terms are summed at the state at the start of the step, or for linear bodies at the predictor
    /// (`Rates::predicted`), and their matrix acts on the change from there: a rate multiplies a change by 1/increment^2,
    /// and of two products with the whole state that nearly cancel the rounding would be left.
    ///
    /// # Errors
    /// [`SystemError`] with its place.
    pub fn begin_step(&mut self, window: Window) -> Result<bool, SystemError> {
        self.set_laws(window);
        let zero = vec![0.0; self.numbering.n_dofs];
        let linear = self.is_linear();
        if !linear && self.without_matrix.is_none() {
            self.located()?;
        }
        let (start, held) = match (&self.known.rates, &self.known.previous) {
            (Some(rates), Some(past)) => match rates.predicted(&past.unknowns).filter(|_| linear) {
                Some((base, held)) => (base, Some(held)),
                None => (past.unknowns.clone(), None),
            },
            _ => (Vec::new(), None),
        };
        let own = held.and_then(|held| self.known.rates.replace(held));
        if own.is_some() {
            self.set_laws(window);
        }
        let constants = self.sum_constants(start, &zero);
        if own.is_some() {
            self.known.rates = own;
            self.set_laws(window);
        }
        constants?;
        let stale = self.linear_is_stale();
        if stale {
            self.renew_linear(&zero)?;
            self.linear_uniforms = self.linear_terms().map(|t| t.uniforms().to_vec()).collect();
            self.linear_mass = self.known.rates.as_ref().map_or(0.0, crate::rates::Rates::factor_apart);
        }
        Ok(stale)
    }

    /// Moves the free part of `u` to the predictor, if there the constants of the present step were summed.
    pub fn start_from_predictor(&self, u: &mut [f64]) {
        let rates = self.known.rates.as_ref().zip(self.known.previous.as_ref());
        if !self.is_linear() || rates.is_none_or(|(rates, past)| rates.predicted(&past.unknowns).is_none()) {
            return;
        }
        let mut change: Vec<f64> = self.base.iter().zip(&*u).map(|(base, u)| base - u).collect();
        self.numbering.frames.turn(&mut change);
        for (x, _) in change.iter_mut().zip(&self.numbering.free).filter(|(_, free)| **free == FIXED) {
            *x = 0.0;
        }
        self.numbering.frames.turn_back(&mut change);
        u.iter_mut().zip(change).for_each(|(u, change)| *u += change);
        self.numbering.follow(u);
    }

    /// Takes dofs out of the system and lets others follow their leaders; `frames` are those of all nodes that have one.
    pub fn leave_out(&mut self, dofs: impl IntoIterator<Item = usize>, ties: Vec<Tie>, frames: Vec<Frame>) {
        let numbering = Arc::make_mut(&mut self.numbering);
        numbering.set_frames(frames);
        numbering.fix(dofs);
        numbering.tie(ties);
        self.share_again();
        self.bodies = bodies::Found::new();
        (self.linear, self.steady, self.past_matrices, self.without_matrix) = (None, None, None, None);
        self.bulk = Arc::new(nothing(self.numbering.n_free()));
        self.forget_places();
    }

    /// The values of all fields at `u`.
    #[must_use]
    pub fn values<'a>(&'a self, u: &'a [f64]) -> StateValues<'a> {
        StateValues { current: self.slices(u), previous: self.previous_slices(), rates: self.known.rates.as_ref() }
    }

    /// The values of all fields at `u`, and behind them the branches of an active set.
    #[must_use]
    pub fn values_with<'a>(&'a self, u: &'a [f64], active: &'a ActiveSet) -> StateValues<'a> {
        let mut values = self.values(u);
        values.current.extend(active.terms.iter().flat_map(|t| [t.points.as_slice(), t.regularisation.as_slice()]));
        values
    }

    /// The dofs of an unknown field.
    #[must_use]
    pub fn range(&self, field: usize) -> Option<std::ops::Range<usize>> {
        self.numbering.starts[field].map(|start| start..start + self.fields[field].n_dofs())
    }

    /// Values of each field at the end of the previous step; empty unless something reads them.
    #[must_use]
    pub fn previous_slices(&self) -> Vec<&[f64]> {
        match &self.known.previous {
            Some(p) => field_slices(&self.fields, &self.numbering, &p.data, &p.unknowns),
            None => Vec::new(),
        }
    }

    /// Values of each field at `u`.
    #[must_use]
    pub fn slices<'a>(&'a self, u: &'a [f64]) -> Vec<&'a [f64]> {
        self.slices_of(&self.known.data, u)
    }

    /// The same with values of known fields, by field.
    #[must_use]
    pub fn slices_of<'a>(&self, data: &'a [Vec<f64>], u: &'a [f64]) -> Vec<&'a [f64]> {
        field_slices(&self.fields, &self.numbering, data, u)
    }
}

fn field_slices<'a>(fields: &[Field], numbering: &Numbering, data: &'a [Vec<f64>], u: &'a [f64]) -> Vec<&'a [f64]> {
    fields
        .iter()
        .enumerate()
        .map(|(k, f)| match numbering.starts[k] {
            Some(start) => &u[start..start + f.n_dofs()],
            None => data[k].as_slice(),
        })
        .collect()
}

/// The pattern of some terms, of all rows or those of a rank; `place` maps a dof to its row. Turned nodes come with all
/// their dofs.
fn pattern<'t>(
    terms: impl Iterator<Item = &'t AssembledTerm>,
    n: usize,
    frames: &Frames,
    place: impl Fn(u32) -> u32,
    share: Option<&Share>,
) -> Result<Csr, CsrError> {
    let mut builder = PatternBuilder::new(n, n);
    for_each_coupling(terms, frames, place, share, |rows, columns| builder.add_coupling(rows, columns));
    let pattern = builder.build_shared()?;
    claim_numbers(pattern.n_entries() as u64, "the matrix")?;
    Ok(Csr::zeros(pattern))
}

/// Calls with the rows and columns that each entity of some terms couples, as [`pattern`] takes them.
fn for_each_coupling<'t>(
    terms: impl Iterator<Item = &'t AssembledTerm>,
    frames: &Frames,
    place: impl Fn(u32) -> u32,
    share: Option<&Share>,
    mut f: impl FnMut(&[u32], &[u32]),
) {
    let (mut rows, mut columns, mut complete) = (Vec::new(), Vec::new(), Vec::new());
    let is_own = |dof: &&u32| share.is_none_or(|share| share.owns(**dof as usize));
    for term in terms {
        term.for_each_entity(|tests, trials| {
            if !frames.is_empty() {
                // turning a node mixes its rows and its columns, so each must hold what the other does
                frames.complete(tests.iter().chain(trials), &mut complete);
            }
            let (of_rows, of_columns) = if frames.is_empty() { (tests, trials) } else { (&*complete, &*complete) };
            rows.clear();
            rows.extend(of_rows.iter().filter(is_own).map(|d| place(*d)).filter(|r| *r != FIXED));
            if rows.is_empty() {
                return;
            }
            columns.clear();
            columns.extend(of_columns.iter().map(|d| place(*d)).filter(|r| *r != FIXED));
            f(&rows, &columns);
        });
    }
}

/// The matrix without entries.
fn nothing(n: usize) -> Csr {
    Csr::zeros(Arc::new(Pattern::empty(n, n)))
}

/// Why a step cannot be assembled.
#[derive(Debug, Error)]
pub enum SystemError {
    /// A term gave a number that is not finite.
    #[error(transparent)]
    Term(#[from] TermError),
    /// A pattern does not fit.
    #[error(transparent)]
    Structure(CsrError),
    /// The unknowns have no nodes or no elements of degree 1: why, in words.
    #[error("{0}")]
    Layout(String),
    /// A value that the scene gives is not finite.
    #[error(transparent)]
    Given(#[from] Box<BadGiven>),
    /// What is assembled does not fit into the memory.
    #[error(transparent)]
    TooMuchMemory(#[from] TooMuchMemory),
}

/// A need for memory is one kind of error, whoever had it.
impl From<CsrError> for SystemError {
    fn from(error: CsrError) -> Self {
        match error {
            CsrError::TooMuchMemory(need) => Self::TooMuchMemory(need),
            other => Self::Structure(other),
        }
    }
}
