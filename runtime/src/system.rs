//! The discrete problem of a scene: dofs, fixed values, assembled terms.
//!
//! Dofs of all unknown fields stand in one vector, field after field, node after node, component fastest. Terms are
//! kept by class: constant ones are summed once per step, linear ones are a matrix assembled once (once per step if
//! the step variable enters), only the others are assembled at each state. Fixed dofs keep their rows in residuals
//! (their entries are reactions) and are left out of the systems that are solved.

use std::sync::Arc;

use thiserror::Error;
use wfl_compiler::{Class, types::FieldKind};

use crate::{
    assemble::{AssembledTerm, FieldValues, TermError},
    csr::{Csr, CsrError, Pattern, PatternBuilder, SubmatrixMap},
    field::Field,
    mesh::Mesh,
};

/// Marks a dof that is not solved for.
pub const FIXED: u32 = u32::MAX;

/// Numbering of the unknowns.
#[derive(Clone, Debug, Default)]
pub struct Numbering {
    /// Where each field starts; `None` for known fields.
    pub starts: Vec<Option<usize>>,
    /// Number of dofs, fixed ones included.
    pub n_dofs: usize,
    /// Free number of each dof, or [`FIXED`].
    pub free: Vec<u32>,
    /// Dof of each free number.
    pub free_dofs: Vec<u32>,
}

impl Numbering {
    /// Numbers the unknown fields; everything free.
    #[must_use]
    pub fn new(fields: &[Field], is_unknown: impl Fn(&Field) -> bool) -> Self {
        let mut n = 0;
        let starts = fields
            .iter()
            .map(|f| {
                is_unknown(f).then(|| {
                    let start = n;
                    n += f.n_dofs();
                    start
                })
            })
            .collect();
        let mut numbering = Self { starts, n_dofs: n, free: vec![0; n], free_dofs: Vec::new() };
        numbering.renumber();
        numbering
    }

    /// Takes these dofs out of the system.
    pub fn fix(&mut self, dofs: impl IntoIterator<Item = usize>) {
        for d in dofs {
            self.free[d] = FIXED;
        }
        self.renumber();
    }

    fn renumber(&mut self) {
        self.free_dofs.clear();
        for (d, slot) in self.free.iter_mut().enumerate() {
            if *slot != FIXED {
                *slot = u32::try_from(self.free_dofs.len()).expect("fewer than 2^32 dofs");
                self.free_dofs.push(u32::try_from(d).expect("fewer than 2^32 dofs"));
            }
        }
    }

    /// Number of free dofs.
    #[must_use]
    pub fn n_free(&self) -> usize {
        self.free_dofs.len()
    }

    /// Field, node and component of a dof.
    #[must_use]
    pub fn describe(&self, fields: &[Field], dof: usize) -> (usize, usize, usize) {
        let field = (0..fields.len())
            .rfind(|f| self.starts[*f].is_some_and(|s| s <= dof && fields[*f].n_dofs() > 0))
            .expect("every dof belongs to a field");
        let local = dof - self.starts[field].expect("found above");
        (field, local / fields[field].n_components, local % fields[field].n_components)
    }

    /// The free entries of a vector over all dofs.
    pub fn gather(&self, all: &[f64], out: &mut Vec<f64>) {
        out.clear();
        out.extend(self.free_dofs.iter().map(|d| all[*d as usize]));
    }
}

/// Values that do not follow from the unknowns: known fields, and the past where a scene uses it.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// Nodal values of data fields by field; empty for unknowns.
    pub data: Vec<Vec<f64>>,
    /// All unknowns at the end of the previous step; `None` unless a term reads the past.
    pub previous: Option<Vec<f64>>,
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
    linear: Option<Csr>,
    bulk: Csr,
    changing: Csr,
    constant: Vec<f64>,
    /// By dof: sum over the columns of |K_linear| |u| in the last residual, the size of what cancels there.
    magnitude: Vec<f64>,
    /// By field: largest contribution of one class of terms to one entry of the last residual.
    force: Vec<f64>,
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
        mut terms: Vec<AssembledTerm>,
        known: Known,
    ) -> Result<Self, CsrError> {
        let n_free = numbering.n_free();
        let changing = pattern(&terms, n_free, |c| c >= Class::Nonlinear, |d| numbering.free[d as usize])?;
        for term in terms.iter_mut().filter(|t| t.law.class >= Class::Nonlinear) {
            term.locate(changing.pattern(), &numbering.free);
        }
        let constant = vec![0.0; numbering.n_dofs];
        Ok(Self {
            mesh,
            fields,
            numbering,
            terms,
            known,
            linear: None,
            bulk: nothing(n_free),
            changing,
            constant,
            magnitude: Vec::new(),
            force: Vec::new(),
        })
    }

    /// True if no term needs Newton.
    #[must_use]
    pub fn is_linear(&self) -> bool {
        self.terms.iter().all(|t| t.law.class <= Class::Linear)
    }

    /// True if every tangent is symmetric.
    #[must_use]
    pub fn is_symmetric(&self) -> bool {
        self.terms.iter().all(|t| t.law.symmetric)
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

    /// Sorted free dofs that the changing matrix touches.
    #[must_use]
    pub fn changing_dofs(&self) -> Vec<u32> {
        let mut dofs: Vec<u32> = Vec::new();
        for row in 0..self.numbering.n_free() {
            if !self.changing.row(row).0.is_empty() {
                dofs.push(u32::try_from(row).expect("fewer than 2^32 dofs"));
            }
        }
        dofs
    }

    /// Goes to a step: constant terms are summed, linear ones assembled where they are new. Returns true if the
    /// matrix of the linear terms has changed.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub fn set_step(&mut self, time: f64, increment: f64) -> Result<bool, SystemError> {
        for term in &mut self.terms {
            term.set_step(time, increment);
        }
        let zero = vec![0.0; self.numbering.n_dofs];
        let (mut constant, mut changed) = (vec![0.0; self.numbering.n_dofs], false);
        let stale = self.linear.is_none()
            || self.terms.iter().any(|t| t.law.class == Class::Linear && t.law.tangent_changes_with_step);
        self.with_values(&zero, |mesh, terms, values| {
            for term in terms.iter_mut().filter(|t| t.law.class <= Class::Linear) {
                term.add_residual(mesh, values, &mut constant)?;
            }
            Ok(())
        })?;
        self.constant = constant;
        if stale {
            let n = self.numbering.n_dofs;
            let mut linear = pattern(&self.terms, n, |c| c == Class::Linear, |d| d)?;
            self.with_values(&zero, |mesh, terms, values| {
                for term in terms.iter().filter(|t| t.law.class == Class::Linear) {
                    term.add_full_tangent(mesh, values, &mut linear)?;
                }
                Ok(())
            })?;
            let free = &self.numbering.free_dofs;
            self.bulk = SubmatrixMap::new(linear.pattern(), free, free)?.extract(&linear);
            self.linear = Some(linear);
            changed = true;
        }
        Ok(changed)
    }

    fn with_values<R>(
        &mut self,
        u: &[f64],
        f: impl FnOnce(&Mesh, &mut [AssembledTerm], FieldValues<'_>) -> Result<R, TermError>,
    ) -> Result<R, TermError> {
        let current = field_slices(&self.fields, &self.numbering, &self.known.data, u);
        let previous = match &self.known.previous {
            Some(p) => field_slices(&self.fields, &self.numbering, &self.known.data, p),
            None => Vec::new(),
        };
        f(&self.mesh, &mut self.terms, FieldValues { current: &current, previous: &previous })
    }

    /// The residual at `u`, by dof, fixed ones included.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub fn residual(&mut self, u: &[f64], out: &mut Vec<f64>) -> Result<(), TermError> {
        out.clear();
        out.extend_from_slice(&self.constant);
        self.magnitude.clear();
        self.magnitude.extend(self.constant.iter().map(|x| x.abs()));
        self.force = self.largest_by_field(&self.constant);
        if let Some(linear) = &self.linear {
            let mut part = vec![0.0; out.len()];
            for (row, slot) in part.iter_mut().enumerate() {
                let mut size = 0.0;
                let (columns, values) = linear.row(row);
                for (column, value) in columns.iter().zip(values) {
                    let product = value * u[*column as usize];
                    *slot += product;
                    size += product.abs();
                }
                self.magnitude[row] += size;
                out[row] += *slot;
            }
            self.grow_force(&part);
        }
        let mut rest = vec![0.0; out.len()];
        self.with_values(u, |mesh, terms, values| {
            for term in terms.iter_mut().filter(|t| t.law.class >= Class::Nonlinear) {
                term.add_residual(mesh, values, &mut rest)?;
            }
            Ok(())
        })?;
        self.grow_force(&rest);
        for (slot, r) in out.iter_mut().zip(&rest) {
            *slot += r;
        }
        Ok(())
    }

    fn grow_force(&mut self, part: &[f64]) {
        let sizes = self.largest_by_field(part);
        for (f, s) in self.force.iter_mut().zip(sizes) {
            *f = f.max(s);
        }
    }

    fn largest_by_field(&self, v: &[f64]) -> Vec<f64> {
        let largest = |k: usize| self.range(k).map_or(0.0, |r| v[r].iter().fold(0.0f64, |m, x| m.max(x.abs())));
        (0..self.fields.len()).map(largest).collect()
    }

    /// The dofs of an unknown field.
    #[must_use]
    pub fn range(&self, field: usize) -> Option<std::ops::Range<usize>> {
        self.numbering.starts[field].map(|start| start..start + self.fields[field].n_dofs())
    }

    /// By field: what relative residuals are relative to. For unknowns the largest nodal force of loads, linear or
    /// nonlinear terms; for multipliers, whose equations balance inside one term, the size of what cancels.
    #[must_use]
    pub fn scales(&self, u: &[f64]) -> Vec<f64> {
        let magnitudes = self.largest_by_field(&self.magnitudes(u));
        (0..self.fields.len())
            .map(|k| match self.fields[k].kind {
                FieldKind::Multiplier => magnitudes[k],
                _ => self.force[k],
            })
            .collect()
    }

    /// By dof: |K| |u| of linear and changing terms, what rounding errors of the residual are relative to.
    #[must_use]
    pub fn magnitudes(&self, u: &[f64]) -> Vec<f64> {
        let mut out = self.magnitude.clone();
        for row in 0..self.numbering.n_free() {
            let (columns, values) = self.changing.row(row);
            let at = |c: u32| u[self.numbering.free_dofs[c as usize] as usize];
            let size: f64 = columns.iter().zip(values).map(|(c, v)| (v * at(*c)).abs()).sum();
            out[self.numbering.free_dofs[row] as usize] += size;
        }
        out
    }

    /// Assembles the tangent of the nonlinear terms at `u`.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub fn tangent(&mut self, u: &[f64]) -> Result<(), TermError> {
        let mut changing = std::mem::replace(&mut self.changing, nothing(0));
        changing.values_mut().fill(0.0);
        let result = self.with_values(u, |mesh, terms, values| {
            for term in terms.iter().filter(|t| t.law.class >= Class::Nonlinear) {
                term.add_tangent(mesh, values, changing.values_mut())?;
            }
            Ok(())
        });
        self.changing = changing;
        result
    }

    /// Values of each field at the end of the previous step; empty unless a term reads the past.
    #[must_use]
    pub fn previous_slices(&self) -> Vec<&[f64]> {
        match &self.known.previous {
            Some(p) => self.slices(p),
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

/// The pattern of the terms of some classes; `place` maps a dof to its row.
fn pattern(
    terms: &[AssembledTerm],
    n: usize,
    class: impl Fn(Class) -> bool,
    place: impl Fn(u32) -> u32,
) -> Result<Csr, CsrError> {
    let mut builder = PatternBuilder::new(n, n);
    let mut rows = Vec::new();
    for term in terms.iter().filter(|t| class(t.law.class)) {
        term.for_each_entity(|dofs| {
            rows.clear();
            rows.extend(dofs.iter().map(|d| place(*d)).filter(|r| *r != FIXED));
            builder.add_element(&rows);
        });
    }
    Ok(Csr::zeros(builder.build_shared()?))
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
    Structure(#[from] CsrError),
}
