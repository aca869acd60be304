//! The discrete problem of a scene: dofs, fixed values, assembled terms.
//!
//! Dofs of all unknown fields stand in one vector, field after field, node after node, component fastest. Terms are
//! kept by class: constant ones are summed once per step, linear ones are a matrix assembled once (once per step if
//! the step variable enters), only the others are assembled at each state. Fixed dofs keep their rows in residuals
//! (their entries are reactions) and are left out of the systems that are solved.

mod coupling;
mod definite;
mod held;
mod inspect;
mod law;
mod linear;
mod memory;
mod numbering;
mod rigid;
mod singular;

use std::sync::Arc;

pub(crate) use coupling::Friction;
pub use definite::NegativeBody;
pub(crate) use law::LawDefect;
pub use memory::Memory;
pub(crate) use numbering::Tie;
pub use numbering::{FIXED, Numbering};
pub use rigid::LooseMotions;
pub use singular::Singular;

use thiserror::Error;
use wfl_compiler::{
    Class,
    types::{FieldKind, Side},
};

use crate::{
    assemble::{AssembledTerm, FieldValues, TermError},
    csr::{Csr, CsrError, Pattern, PatternBuilder, Restriction},
    field::Field,
    finite::{BadGiven, largest},
    frames::Frames,
    memory::{TooMuchMemory, claim_numbers},
    mesh::Mesh,
    newton::{Passed, TermPieces, Watched},
    pruning::Pruning,
};

/// Values that do not follow from the unknowns: known fields, and the past where a scene uses it.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// Values of data, states and fields without terms, by field; empty for fields that are solved for.
    pub data: Vec<Vec<f64>>,
    /// The end of the previous step; `None` unless something reads it.
    pub previous: Option<Past>,
}

/// The end of the previous step.
#[derive(Clone, Debug, Default)]
pub struct Past {
    /// All unknowns.
    pub unknowns: Vec<f64>,
    /// As [`Known::data`], then.
    pub data: Vec<Vec<f64>>,
}

impl Known {
    /// What is known now, and the unknowns `u`, become the end of the previous step.
    pub fn keep(&mut self, u: &[f64]) {
        if let Some(past) = &mut self.previous {
            past.unknowns.copy_from_slice(u);
            past.data.clone_from(&self.data);
        }
    }
}

/// Raises terms of a class to terms of which nothing is known.
fn forget(terms: &mut [AssembledTerm], class: Class) {
    for term in terms.iter_mut().filter(|t| t.law.class == class) {
        term.law.class = Class::Nonlinear;
    }
}

/// What evaluation borrows of a system.
struct Parts<'a> {
    mesh: &'a Mesh,
    fields: &'a [Field],
    terms: &'a mut [AssembledTerm],
    pieces: &'a mut [TermPieces],
    /// The matrix of the linear terms over the free dofs, and the place of each dof there or [`FIXED`].
    bulk: &'a Csr,
    free: &'a [u32],
}

/// The matrix of the changing terms in the axes of the scene, over the free dofs, those that follow others, and all dofs
/// of turned nodes.
struct Unturned {
    matrix: Csr,
    /// By dof its row, or [`FIXED`].
    rows: Vec<u32>,
    map: Restriction,
}

impl Unturned {
    fn new<'t>(terms: impl Iterator<Item = &'t AssembledTerm>, numbering: &Numbering) -> Result<Self, CsrError> {
        let equations = numbering.equations();
        let (mut rows, mut targets) = (vec![FIXED; numbering.n_dofs], Vec::new());
        for (dof, row) in rows.iter_mut().enumerate() {
            if equations[dof] != FIXED || numbering.frames.of(dof).is_some() {
                *row = u32::try_from(targets.len()).expect("fewer than 2^32 dofs");
                targets.push(equations[dof]);
            }
        }
        let matrix = pattern(terms, targets.len(), &numbering.frames, |d| rows[d as usize])?;
        let map = Restriction::new(matrix.pattern(), &targets, numbering.n_free())?;
        Ok(Self { matrix, rows, map })
    }
}

/// The assembled problem.
pub struct System {
    /// The mesh.
    pub mesh: Mesh,
    /// The fields.
    pub fields: Vec<Field>,
    /// The dofs.
    pub numbering: Numbering,
    /// Every term, loads included.
    pub terms: Vec<AssembledTerm>,
    /// Data and the past.
    pub known: Known,
    pieces: Vec<TermPieces>,
    /// By piece: its guides at the integration points, a field of values behind those of the scene.
    guides: Vec<Vec<f64>>,
    /// By piece: what its projections were after the last step; empty at the start of a step.
    watched: Vec<Watched>,
    /// The last two converged states, from which the pieces of the next are expected.
    passed: Vec<Passed>,
    /// The step variable.
    time: f64,
    increment: f64,
    /// The held pieces belong to a converged state; else they are chosen anew at the start of a step.
    settled: bool,
    linear: Option<Csr>,
    /// The linear terms are evaluated at their points, not by their matrix ([`Self::set_pointwise`]).
    pointwise: bool,
    bulk: Csr,
    changing: Csr,
    /// Where the changing terms are summed before they are turned; `None` without frames.
    unturned: Option<Unturned>,
    constant: Vec<f64>,
    /// By dof: a constant residual on top of that of the scene, of which only the rest is to be balanced; or empty.
    shift: Vec<f64>,
    /// The last residual without the terms that have pieces.
    smooth: Vec<f64>,
    /// By dof: sum over the columns of |K_linear| |u| in the last residual, the size of what cancels there.
    magnitude: Vec<f64>,
    /// By field: largest contribution of one class of terms to one entry of the last residual.
    force: Vec<f64>,
    /// By field: the first field of those whose forces meet on interfaces.
    meets: Vec<usize>,
    /// What is done although the scene does not need it.
    kept: Vec<Pruning>,
}

impl System {
    /// A system over these terms; assembles nothing yet.
    ///
    /// # Errors
    /// [`CsrError`] when the pattern does not fit the index types.
    pub fn new(
        mesh: Mesh,
        fields: Vec<Field>,
        numbering: Numbering,
        terms: Vec<AssembledTerm>,
        known: Known,
    ) -> Result<Self, CsrError> {
        let n_free = numbering.n_free();
        let constant = vec![0.0; numbering.n_dofs];
        let meets = meeting_fields(&fields, &terms);
        let mut this = Self {
            mesh,
            fields,
            numbering,
            terms,
            known,
            pieces: Vec::new(),
            guides: Vec::new(),
            watched: Vec::new(),
            passed: Vec::new(),
            time: 0.0,
            increment: 0.0,
            settled: false,
            linear: None,
            pointwise: false,
            bulk: nothing(n_free),
            changing: nothing(n_free),
            unturned: None,
            constant,
            shift: Vec::new(),
            smooth: Vec::new(),
            magnitude: Vec::new(),
            force: Vec::new(),
            meets,
            kept: Vec::new(),
        };
        this.locate()?;
        Ok(this)
    }

    /// Finds where the changing terms stand in their matrix.
    fn locate(&mut self) -> Result<(), CsrError> {
        let numbering = &self.numbering;
        let nonlinear = self.terms.iter().filter(|t| t.law.class >= Class::Nonlinear);
        let all = nonlinear.chain(self.pieces.iter().map(|p| &p.held));
        if numbering.frames.is_empty() && !numbering.has_ties() {
            self.unturned = None;
            self.changing = pattern(all, numbering.n_free(), &numbering.frames, |d| numbering.free[d as usize])?;
            let held = self.pieces.iter_mut().map(|p| &mut p.held);
            for term in self.terms.iter_mut().filter(|t| t.law.class >= Class::Nonlinear).chain(held) {
                term.locate(self.changing.pattern(), &numbering.free);
            }
            return Ok(());
        }
        let unturned = Unturned::new(all, numbering)?;
        self.changing = Csr::zeros(unturned.map.pattern().clone());
        let held = self.pieces.iter_mut().map(|p| &mut p.held);
        for term in self.terms.iter_mut().filter(|t| t.law.class >= Class::Nonlinear).chain(held) {
            term.locate(unturned.matrix.pattern(), &unturned.rows);
        }
        self.unturned = Some(unturned);
        Ok(())
    }

    /// Does something although the scene does not need it, to measure what leaving it out saves; before [`Self::hold`].
    pub(crate) fn keep(&mut self, pruning: Pruning) {
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

    /// True if every tangent is symmetric.
    #[must_use]
    pub fn is_symmetric(&self) -> bool {
        self.terms.iter().chain(self.pieces.iter().map(|p| &p.held)).all(|t| t.law.symmetric)
    }

    /// True if the linear terms are symmetric.
    #[must_use]
    pub fn bulk_is_symmetric(&self) -> bool {
        self.terms.iter().filter(|t| t.law.class == Class::Linear).all(|t| t.law.symmetric)
    }

    /// The matrix of the linear terms over the free dofs.
    #[must_use]
    pub fn bulk(&self) -> &Csr {
        &self.bulk
    }

    /// The matrix of the other terms over the free dofs, at the last state given to [`Self::tangent`].
    #[must_use]
    pub fn changing(&self) -> &Csr {
        &self.changing
    }

    /// Number of free dofs that the changing matrix touches, by row or by column.
    #[must_use]
    pub fn n_changing_dofs(&self) -> usize {
        let mut is_touched = vec![false; self.numbering.n_free()];
        for row in 0..is_touched.len() {
            let (columns, _) = self.changing.row(row);
            is_touched[row] |= !columns.is_empty();
            columns.iter().for_each(|c| is_touched[*c as usize] = true);
        }
        is_touched.iter().filter(|t| **t).count()
    }

    /// Adds a constant residual by dof, in the axes of the scene and the unit of the residual, to that of the scene; an
    /// empty list takes it away.
    pub fn set_shift(&mut self, shift: Vec<f64>) {
        self.shift = shift;
    }

    /// Goes to a step: constant terms are summed, linear ones assembled where they are new. Returns true if the
    /// matrix of the linear terms has changed.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub fn set_step(&mut self, time: f64, increment: f64) -> Result<bool, SystemError> {
        self.time = time;
        self.increment = increment;
        for term in &mut self.terms {
            term.set_step(time, increment);
        }
        for piece in &mut self.pieces {
            piece.set_step(time, increment);
        }
        let zero = vec![0.0; self.numbering.n_dofs];
        let (mut constant, mut changed) = (vec![0.0; self.numbering.n_dofs], false);
        let stale = self.linear.is_none()
            || self.terms.iter().any(|t| t.law.class == Class::Linear && t.law.tangent_changes_with_step);
        self.with_values(&zero, |Parts { mesh, terms, .. }, values| {
            for term in terms.iter_mut().filter(|t| t.law.class <= Class::Linear) {
                term.add_residual(mesh, values, &mut constant)?;
            }
            Ok(())
        })?;
        self.constant = constant;
        if stale {
            let n = self.numbering.n_dofs;
            let frames = &self.numbering.frames;
            let mut linear = pattern(self.terms.iter().filter(|t| t.law.class == Class::Linear), n, frames, |d| d)?;
            let every_dof: Vec<u32> = (0..u32::try_from(n).expect("fewer than 2^32 dofs")).collect();
            self.with_values(&zero, |Parts { mesh, terms, .. }, values| {
                for term in terms.iter_mut().filter(|t| t.law.class == Class::Linear) {
                    term.locate(linear.pattern(), &every_dof);
                    term.add_tangent(mesh, values, linear.values_mut())?;
                    term.forget();
                }
                Ok(())
            })?;
            let frames = &self.numbering.frames;
            let map = Restriction::new(linear.pattern(), &self.numbering.equations(), self.numbering.n_free())?;
            self.bulk = if frames.is_empty() {
                map.apply(&linear)
            } else {
                let mut turned = linear.clone();
                frames.turn_matrix(&mut turned, |d| d);
                map.apply(&turned)
            };
            self.linear = Some(linear);
            changed = true;
        }
        Ok(changed)
    }

    fn with_values<R>(
        &mut self,
        u: &[f64],
        f: impl FnOnce(Parts<'_>, FieldValues<'_>) -> Result<R, TermError>,
    ) -> Result<R, TermError> {
        let mut current = field_slices(&self.fields, &self.numbering, &self.known.data, u);
        current.extend(self.guides.iter().map(Vec::as_slice));
        let previous = match &self.known.previous {
            Some(p) => field_slices(&self.fields, &self.numbering, &p.data, &p.unknowns),
            None => Vec::new(),
        };
        let parts = Parts {
            mesh: &self.mesh,
            fields: &self.fields,
            terms: &mut self.terms,
            pieces: &mut self.pieces,
            bulk: &self.bulk,
            free: &self.numbering.free,
        };
        f(parts, FieldValues { current: &current, previous: &previous })
    }

    /// The residual at `u`, by dof, fixed ones included.
    ///
    /// # Errors
    /// [`TermError`] with its place, also where `u` or a sum over terms is not finite.
    pub fn residual(&mut self, u: &[f64], out: &mut Vec<f64>) -> Result<(), TermError> {
        self.check_finite("value", u, u)?;
        out.clear();
        out.extend_from_slice(&self.constant);
        self.magnitude.clear();
        self.magnitude.extend(self.constant.iter().map(|x| x.abs()));
        for ((slot, size), shift) in out.iter_mut().zip(&mut self.magnitude).zip(&self.shift) {
            *slot += shift;
            *size += shift.abs();
        }
        self.force = self.largest_by_field(&self.constant);
        self.add_linear(u, out)?;
        let mut rest = vec![0.0; out.len()];
        let mut with_pieces = vec![0.0; if self.pieces.is_empty() { 0 } else { out.len() }];
        self.with_values(u, |Parts { mesh, terms, pieces, .. }, values| {
            for (k, term) in terms.iter_mut().enumerate().filter(|(_, t)| t.law.class >= Class::Nonlinear) {
                let has_pieces = pieces.iter().any(|p| p.term == k);
                term.add_residual(mesh, values, if has_pieces { &mut with_pieces } else { &mut rest })?;
            }
            Ok(())
        })?;
        if !self.pieces.is_empty() {
            self.smooth.clear();
            self.smooth.extend(out.iter().zip(&rest).map(|(a, b)| a + b));
            rest.iter_mut().zip(&with_pieces).for_each(|(a, b)| *a += b);
        }
        self.grow_force(&rest);
        for (slot, r) in out.iter_mut().zip(&rest) {
            *slot += r;
        }
        self.numbering.turn(out);
        self.numbering.turn_sizes(&mut self.magnitude);
        self.check_finite("residual", out, u)
    }

    /// The residual with held pieces at `u`, the state of the last [`Self::residual`].
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub fn held_residual(&mut self, u: &[f64], out: &mut Vec<f64>) -> Result<(), TermError> {
        out.clear();
        out.extend_from_slice(&self.smooth);
        self.with_values(u, |Parts { mesh, pieces, .. }, values| {
            for piece in pieces.iter_mut() {
                piece.held.add_residual(mesh, values, out)?;
            }
            Ok(())
        })?;
        self.numbering.turn(out);
        Ok(())
    }

    fn grow_force(&mut self, part: &[f64]) {
        let sizes = self.largest_by_field(part);
        for (f, s) in self.force.iter_mut().zip(sizes) {
            *f = largest([*f, s]);
        }
    }

    fn largest_by_field(&self, v: &[f64]) -> Vec<f64> {
        let by_field = |k: usize| self.range(k).map_or(0.0, |r| largest(v[r].iter().copied()));
        (0..self.fields.len()).map(by_field).collect()
    }

    /// The dofs of an unknown field.
    #[must_use]
    pub fn range(&self, field: usize) -> Option<std::ops::Range<usize>> {
        self.numbering.starts[field].map(|start| start..start + self.fields[field].n_dofs())
    }

    /// By field: what relative residuals are relative to. For unknowns the largest nodal force of loads, linear or
    /// nonlinear terms, of all fields that meet on an interface (a body that nothing touches has no force of its own);
    /// for multipliers, whose equations balance inside one term, the size of what cancels: of [`Self::magnitudes`].
    #[must_use]
    pub fn scales(&self, magnitudes: &[f64]) -> Vec<f64> {
        let magnitudes = self.largest_by_field(magnitudes);
        let mut forces = vec![0.0f64; self.fields.len()];
        for (force, group) in self.force.iter().zip(&self.meets) {
            forces[*group] = largest([forces[*group], *force]);
        }
        (0..self.fields.len())
            .map(|k| match self.fields[k].kind {
                FieldKind::Multiplier => magnitudes[k],
                _ => forces[self.meets[k]],
            })
            .collect()
    }

    /// By dof: |K| |u| of linear and changing terms, what rounding errors of the residual are relative to.
    #[must_use]
    pub fn magnitudes(&self, u: &[f64]) -> Vec<f64> {
        let mut out = self.magnitude.clone();
        let mut sizes: Vec<f64> = u.iter().map(|x| x.abs()).collect();
        self.numbering.frames.turn_sizes(&mut sizes);
        for row in 0..self.numbering.n_free() {
            let (columns, values) = self.changing.row(row);
            let at = |c: u32| sizes[self.numbering.free_dofs[c as usize] as usize];
            let size: f64 = columns.iter().zip(values).map(|(c, v)| v.abs() * at(*c)).sum();
            out[self.numbering.free_dofs[row] as usize] += size;
        }
        out
    }

    /// Assembles the tangent of the nonlinear terms at `u`; `held` takes the held forms of terms that have one.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub fn tangent(&mut self, u: &[f64], held: bool) -> Result<(), TermError> {
        let mut unturned = self.unturned.take();
        let mut changing = std::mem::replace(&mut self.changing, nothing(0));
        let matrix = unturned.as_mut().map_or(&mut changing, |u| &mut u.matrix);
        let result = self.with_values(u, |Parts { mesh, terms, pieces, .. }, values| {
            let mut is_new = true;
            for (k, term) in terms.iter().enumerate().filter(|(_, t)| t.law.class >= Class::Nonlinear) {
                let piece = pieces.iter().find(|p| held && p.term == k);
                let term = piece.map_or(term, |p| &p.held);
                match std::mem::take(&mut is_new) {
                    true => term.set_tangent(mesh, values, matrix.values_mut())?,
                    false => term.add_tangent(mesh, values, matrix.values_mut())?,
                }
            }
            if is_new {
                matrix.values_mut().fill(0.0);
            }
            Ok(())
        });
        if let Some(turned) = &mut unturned {
            let rows = &turned.rows;
            self.numbering.frames.turn_matrix(&mut turned.matrix, |d| rows[d] as usize);
            turned.map.apply_into(&turned.matrix, changing.values_mut());
        }
        self.unturned = unturned;
        self.changing = changing;
        if result.is_err() {
            // what was added before the error is no tangent, and no measure of rounding either
            self.changing.values_mut().fill(0.0);
        }
        result
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
        field_slices(&self.fields, &self.numbering, &self.known.data, u)
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

/// By field: the first of the fields whose test functions stand on opposite sides of one interface term, with equal
/// shapes: displacements of bodies that push each other, whose forces have one unit and one size.
fn meeting_fields(fields: &[Field], terms: &[AssembledTerm]) -> Vec<usize> {
    let mut group: Vec<usize> = (0..fields.len()).collect();
    for tests in terms.iter().map(|t| &t.law.tests) {
        let side = |side: Side| tests.iter().filter(move |t| t.side == side).map(|t| t.field.index());
        for here in side(Side::Here) {
            for there in side(Side::There) {
                let alike = fields[here].n_components == fields[there].n_components;
                let (low, high) = (group[here].min(group[there]), group[here].max(group[there]));
                let unknowns = [here, there].iter().all(|f| fields[*f].kind == FieldKind::Unknown);
                if alike && unknowns && low < high {
                    group.iter_mut().filter(|g| **g == high).for_each(|g| *g = low);
                }
            }
        }
    }
    group
}

/// The pattern of some terms; `place` maps a dof to its row. Turned nodes come with all their dofs.
fn pattern<'t>(
    terms: impl Iterator<Item = &'t AssembledTerm>,
    n: usize,
    frames: &Frames,
    place: impl Fn(u32) -> u32,
) -> Result<Csr, CsrError> {
    let mut builder = PatternBuilder::new(n, n);
    let (mut rows, mut columns, mut complete) = (Vec::new(), Vec::new(), Vec::new());
    for term in terms {
        term.for_each_entity(|tests, trials| {
            for (list, dofs) in [(&mut rows, tests), (&mut columns, trials)] {
                frames.complete(dofs, &mut complete);
                list.clear();
                list.extend(complete.iter().map(|d| place(*d)).filter(|r| *r != FIXED));
            }
            if frames.is_empty() {
                builder.add_coupling(&rows, &columns);
            } else {
                // turning a node mixes its rows and its columns, so each must hold what the other does
                rows.extend(&columns);
                rows.sort_unstable();
                rows.dedup();
                builder.add_element(&rows);
            }
        });
    }
    let pattern = builder.build_shared()?;
    claim_numbers(pattern.n_entries() as u64, "the matrix")?;
    Ok(Csr::zeros(pattern))
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
