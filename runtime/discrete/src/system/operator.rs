//! Whether terms are applied without a matrix, what that takes, and the matrix where it is asked for after all.
//!
//! Promises: a reason in words wherever they cannot be. Does not choose.

use std::sync::Arc;

use wfl_compiler::Class;
use wfl_sparse::csr::{Csr, CsrError};
use wfl_sparse::solve::Operator;

use super::applied::{At, TermsOperator};
use super::held::{OfTerm, WithoutMatrix};
use super::{Branches, LinearMatrix, System, SystemError, Tangent, nothing, pattern};
use crate::assemble::{AppliedTerm, AssembledTerm, Counts, FieldValues, MOST_COMPONENTS, TermError};
use crate::field::FieldSpace;
use crate::frames::Frames;

impl System {
    /// Why terms cannot be applied without their matrix, in words; `None` if they can.
    #[must_use]
    pub fn obstacle_to_operator(&self) -> Option<String> {
        if self.share.is_some() {
            return Some("several ranks share the rows".to_owned());
        }
        if self.known.rates.is_some() || self.redistribution.is_some() {
            return Some("rates need matrices of their own".to_owned());
        }
        if self.numbering.has_ties() {
            return Some("dofs follow others".to_owned());
        }
        if let Some(term) = self.matrix_terms().find(|term| !term.law.symmetric) {
            return Some(format!("the term `{}` is not symmetric", term.law.name));
        }
        let degree = |k: &usize| self.fields[*k].degree();
        let solved = (0..self.fields.len()).filter(|k| self.range(*k).is_some());
        if solved.clone().map(|k| degree(&k)).max().unwrap_or(0) < 2 {
            return Some("all elements are of degree 1".to_owned());
        }
        let is_nodal = |k: &usize| matches!(self.fields[*k].space, FieldSpace::Nodal(_));
        if let Some(k) = solved.clone().find(|k| !is_nodal(k) || self.fields[*k].n_components > MOST_COMPONENTS) {
            return Some(format!("`{}` has no nodes of three components at most", self.fields[k].name));
        }
        if !self.matrix_terms().any(AssembledTerm::can_be_applied) {
            return Some("no term that is not constant is one on cells".to_owned());
        }
        let (fields, starts) = (&self.fields, &self.numbering.starts);
        let all = self.matrix_terms().filter_map(|term| term.obstacle_to_coarser(fields, starts));
        all.chain(self.obstacle_of_changing_terms()).next()
    }

    /// The same of terms that are not linear alone.
    fn obstacle_of_changing_terms(&self) -> Option<String> {
        let changes = |term: &&AssembledTerm| term.law.class >= Class::Nonlinear;
        if let Some(term) = self.terms.iter().filter(changes).find(|term| term.on_cells() && !term.can_be_applied()) {
            return Some(format!("the term `{}` takes more of fields on cells than values and slopes", term.law.name));
        }
        if let Some(frozen) = self.frozen.iter().find(|frozen| frozen.form.on_cells()) {
            return Some(format!("the branches of the term `{}` are kept", self.terms[frozen.term].law.name));
        }
        let has_linear = self.linear_terms().next().is_some();
        (has_linear && !self.frozen.is_empty())
            .then(|| "contact is scaled by the matrix of the linear terms".to_owned())
    }

    /// Terms that have a tangent, as they are written.
    fn matrix_terms(&self) -> impl Iterator<Item = &AssembledTerm> {
        self.terms.iter().filter(|term| term.law.class >= Class::Linear)
    }

    /// What a product with the terms on cells takes.
    #[must_use]
    pub fn counts_of_product(&self) -> Counts {
        let applied = self.matrix_terms().filter(|term| term.can_be_applied());
        applied.map(|term| term.counts_of_product(&self.mesh, &self.fields)).fold(Counts::default(), Counts::plus)
    }

    /// From the next step on terms have no matrix but an operator, if [`Self::obstacle_to_operator`] is none.
    ///
    /// # Errors
    /// [`SystemError`] where a pattern does not fit.
    pub fn leave_matrix(&mut self) -> Result<(), SystemError> {
        if self.obstacle_to_operator().is_some() {
            return Ok(());
        }
        let layout = self.node_layout().map_err(SystemError::Layout)?;
        (self.linear, self.bulk) = (None, Arc::new(nothing(self.numbering.n_free())));
        let rest = if self.is_linear() { None } else { self.leave_tangents()? };
        let terms = self.terms.iter().map(|_| OfTerm::default()).collect();
        self.without_matrix = Some(Arc::new(WithoutMatrix { layout, rest, terms }));
        Ok(())
    }

    /// Forgets the matrix of the changing terms but for those that are not applied: their pattern by dof.
    fn leave_tangents(&mut self) -> Result<Option<Csr>, CsrError> {
        let n = self.numbering.n_dofs;
        self.leave_places();
        let every_dof: Vec<u32> = (0..u32::try_from(n).expect("fewer than 2^32 dofs")).collect();
        let is_rest = |term: &AssembledTerm| term.law.class >= Class::Nonlinear && !term.can_be_applied();
        let frozen = self.frozen.iter().map(|frozen| &frozen.form);
        let mut rest = self.terms.iter().filter(|term| is_rest(term)).chain(frozen).peekable();
        let made = if rest.peek().is_none() { None } else { Some(pattern(rest, n, &Frames::default(), |d| d, None)?) };
        for term in self.terms.iter_mut().chain(self.frozen.iter_mut().map(|frozen| &mut frozen.form)) {
            match &made {
                Some(matrix) if term.law.class >= Class::Nonlinear && !term.can_be_applied() => {
                    term.locate(matrix.pattern(), &every_dof);
                }
                _ => term.forget(),
            }
        }
        for frozen in &mut self.frozen {
            if let Some(matrix) = &made {
                frozen.form.locate(matrix.pattern(), &every_dof);
            }
        }
        Ok(made)
    }

    /// Whether tangents are applied, and have no matrix.
    #[must_use]
    pub fn applies_tangents(&self) -> bool {
        self.without_matrix.is_some() && !self.is_linear()
    }

    /// The matrix of the linear terms over the free dofs, assembled now where an operator stands in its place.
    ///
    /// # Errors
    /// [`SystemError`] with its place.
    pub fn matrix(&self) -> Result<Arc<Csr>, SystemError> {
        Ok(if self.without_matrix.is_none() { self.shared_bulk() } else { self.with_matrix()?.shared_bulk() })
    }

    /// The matrix of a tangent and the linear terms over the free dofs, assembled now where an operator stands in its place.
    ///
    /// # Errors
    /// [`SystemError`] with its place.
    pub fn whole_matrix(&self, tangent: &Tangent) -> Result<Csr, SystemError> {
        match tangent.applied.as_ref().and_then(|applied| applied.operator.as_ref()) {
            Some(operator) => operator.assembled(),
            None => Ok(self.matrix()?.plus(&tangent.changing)?),
        }
    }

    /// A copy that assembles matrices, with that of the linear terms.
    ///
    /// # Errors
    /// [`SystemError`] with its place.
    pub fn with_matrix(&self) -> Result<Self, SystemError> {
        let mut own = Self { without_matrix: None, ..self.clone() };
        if self.without_matrix.is_some() {
            own.linear = None;
            own.forget_places();
            own.assemble_linear(&vec![0.0; self.numbering.n_dofs])?;
        }
        Ok(own)
    }

    /// The operator in place of [`Self::bulk`], where there is one.
    #[must_use]
    pub fn operator(&self) -> Option<Arc<dyn Operator>> {
        match self.linear.as_deref() {
            Some(LinearMatrix::Applied(operator)) => Some(Arc::clone(operator) as Arc<dyn Operator>),
            _ => None,
        }
    }

    /// A term at a state, ready to be applied.
    pub(super) fn applied_at(
        &self,
        held: &WithoutMatrix,
        k: usize,
        values: FieldValues<'_>,
    ) -> Result<AppliedTerm<f64>, TermError> {
        self.terms[k].applied(&self.mesh, values, self.skeleton(held, k), 1.0)
    }

    /// A term on the levels of multigrid, with entries that were evaluated.
    pub(super) fn on_levels(&self, held: &WithoutMatrix, k: usize, term: &Arc<AppliedTerm<f64>>) -> AssembledTerm {
        let own = &self.terms[k];
        if !own.has_means_on_levels() {
            return own.with_entries(term);
        }
        let fewer = held.terms[k].on_levels.get_or_init(|| own.on_fewer_points(&self.mesh, &self.fields));
        fewer.as_ref().map_or_else(|| own.clone(), |fewer| fewer.at_step_of(own)).with_means(term)
    }

    /// The tangent at a state without a matrix, into `out`.
    pub(super) fn apply_tangent(&self, u: &[f64], branches: Branches<'_>, out: &mut Tangent) -> Result<(), TermError> {
        let (Some(held), Some(applied)) = (&self.without_matrix, &mut out.applied) else { return Ok(()) };
        applied.clear();
        let part = Arc::new(self.changing_part(held, u, branches)?);
        applied.take(&part);
        let linear = match self.linear.as_deref() {
            Some(LinearMatrix::Applied(operator)) => operator.parts().to_vec(),
            _ => Vec::new(),
        };
        let parts = linear.into_iter().chain([part]).collect();
        applied.operator = Some(Arc::new(TermsOperator::new(self, parts, At::new(u, branches))));
        Ok(())
    }
}
