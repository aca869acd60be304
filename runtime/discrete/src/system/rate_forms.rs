//! What terms multiply the rates of unknowns by, values held: mass and damping, as matrices and as their products.
//!
//! The derivatives are point laws of their own ([`compile_rates`]), on the points of their terms. Nothing is told from a stiffness by
//! numbers, so a mass is exact however stiff the body is. Each is compiled where it is asked for first, and interpreted: a mass has
//! few instructions, and most of its time is in its integrals. Promises: scenes that never ask compile and keep nothing.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use wfl_compiler::{
    InterpreterBackend, RateLaw, TermLaw,
    backend::KernelBackend,
    compile_rates,
    types::{FieldKind, InputSlot, RateForm, RateOrder},
};
use wfl_sparse::csr::{Csr, PatternBuilder};

use super::{Branches, StateValues, System, SystemError, pattern};
use crate::{
    assemble::{AssembledTerm, Binding, Integrator, LawSlots, tangent_kernel},
    field::{Field, FieldSpace},
    point_space::PointSpace,
    rates::Rates,
};

/// Which derivative in rates, where.
#[derive(Clone, Copy)]
pub struct InRates<'a> {
    /// In first rates or in second ones.
    pub order: RateOrder,
    /// Of which terms, by position; those that do not read them have none.
    pub terms: &'a [usize],
    /// At which unknowns, with the rates and the laws of the system.
    pub at: &'a [f64],
    /// On which branches of projections.
    pub branches: Branches<'a>,
}

/// A term as it is written, or its frozen form, by its position.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Source {
    Term(usize),
    Frozen(usize),
}

/// The derivative of a term in its rates, on its points. Rates of their own are fields behind those that the term knows.
#[derive(Clone)]
pub(super) struct Derivative {
    term: AssembledTerm,
    n_fields: usize,
}

/// Those that were made; nothing where a derivative is zero.
pub(super) type RateForms = BTreeMap<(Source, RateOrder), Option<Derivative>>;

/// A field that is known.
fn known(n_components: usize, space: FieldSpace) -> Field {
    Field { name: String::new(), kind: FieldKind::Data, n_components, space }
}

impl System {
    /// The products of a derivative in rates with rates by dof, by dof in the axes of the scene: the rows of this rank.
    ///
    /// # Errors
    /// [`SystemError`] with its place.
    pub fn times_rates(&mut self, what: InRates<'_>, rates: &[f64]) -> Result<Vec<f64>, SystemError> {
        let sources = self.make_rate_forms(what)?;
        let mut out = vec![0.0; rates.len()];
        for form in sources.iter().filter_map(|source| self.rate_forms.get(&(*source, what.order))?.as_ref()) {
            self.add_own(&form.term, self.beside_rates(form, what, rates).view(), &mut out)?;
        }
        Ok(out)
    }

    /// A derivative in rates, by dof in the axes of the scene: the rows of this rank. For second rates it is the mass matrix of the
    /// terms.
    ///
    /// # Errors
    /// [`SystemError`] with its place.
    pub fn matrix_of_rates(&mut self, what: InRates<'_>) -> Result<Csr, SystemError> {
        let n = self.numbering.n_dofs;
        let every_dof: Vec<u32> = (0..u32::try_from(n).expect("fewer than 2^32 dofs")).collect();
        let sources = self.make_rate_forms(what)?;
        let found = |source: &Source| self.rate_forms.get(&(*source, what.order)).cloned().flatten();
        // images that are followed have places at a state
        let follows = self.follows_images();
        let all = sources.iter().filter_map(found);
        let (moving, mut still): (Vec<_>, Vec<_>) = all.partition(|form| follows && form.term.integrator.moves());
        let (frames, share) = (&self.numbering.frames, self.share.as_deref());
        let mut made = pattern(still.iter().map(|form| &form.term), n, frames, |d| d, share)?;
        let no_rates = vec![0.0; n];
        if !moving.is_empty() {
            let mut near = PatternBuilder::new(n, n);
            for form in &moving {
                let values = self.beside_rates(form, what, &no_rates);
                form.term
                    .for_each_near(&self.mesh, values.view(), &mut |rows, columns| near.add_coupling(rows, columns));
            }
            made = Csr::zeros(Arc::new(made.pattern().union(&near.build()?)?));
        }
        let places = made.pattern().clone();
        for form in &mut still {
            form.term.locate_own(&places, &every_dof, self.share.as_ref());
            let values = self.beside_rates(form, what, &no_rates);
            form.term.add_tangent(&self.mesh, values.view(), made.values_mut())?;
        }
        for form in &moving {
            let (values, on) = (self.beside_rates(form, what, &no_rates), (&places, every_dof.as_slice()));
            let has_places = form.term.add_tangent_of_images(&self.mesh, values.view(), on, made.values_mut())?;
            assert!(has_places, "the pattern was made for these images");
        }
        Ok(made)
    }

    /// What the equations multiply the highest rates of unknowns by, over the free dofs: the rows of this rank. Of fields with second
    /// rates that is the mass, of others what stands before their first rates.
    ///
    /// # Errors
    /// [`SystemError`] with its place.
    pub fn mass_over_free(&mut self, u: &[f64], branches: Branches<'_>) -> Result<Csr, SystemError> {
        let first: BTreeSet<usize> = self.fields_with(RateForm::First).collect();
        let reads_first = |slot: &InputSlot| matches!(slot, InputSlot::History(RateOrder::First, b) if first.contains(&b.field.index()));
        let terms = (0..self.terms.len()).filter(|k| self.terms[*k].law.inputs.iter().any(reads_first));
        let terms: Vec<usize> = terms.collect();
        let what = InRates { order: RateOrder::First, terms: &terms, at: u, branches };
        let mut made = self.matrix_of_rates(what)?;
        let mut is_highest = vec![false; u.len()];
        first.into_iter().filter_map(|k| self.range(k)).for_each(|range| is_highest[range].fill(true));
        let columns = made.pattern().clone();
        for (value, _) in made.values_mut().iter_mut().zip(columns.columns()).filter(|(_, c)| !is_highest[**c as usize])
        {
            *value = 0.0;
        }
        let second = match self.redistributed_mass()? {
            Some(mass) => mass,
            None => {
                let terms: Vec<usize> = (0..self.terms.len()).collect();
                self.matrix_of_rates(InRates { order: RateOrder::Second, terms: &terms, at: u, branches })?
            }
        };
        Ok(self.over_free(&made.plus(&second)?)?)
    }

    /// The fields that have rates of a form.
    fn fields_with(&self, form: RateForm) -> impl Iterator<Item = usize> + '_ {
        self.rates().into_iter().flat_map(Rates::fields).filter(move |of| of.form == form).map(|of| of.field)
    }

    /// The forces of inertia at accelerations by dof, in the axes of the scene: the rows of this rank. Of unknowns `u` a mass may
    /// depend on.
    ///
    /// # Errors
    /// [`SystemError`] with its place.
    pub fn mass_times(&mut self, u: &[f64], accelerations: &[f64]) -> Result<Vec<f64>, SystemError> {
        let terms: Vec<usize> = (0..self.terms.len()).collect();
        let what = InRates { order: RateOrder::Second, terms: &terms, at: u, branches: Branches::AsWritten };
        let mut out = self.times_rates(what, accelerations)?;
        self.add_redistributed(accelerations, &mut out);
        Ok(out)
    }

    /// Makes the derivatives that are wanted and not there yet, and brings them to the present step. Gives the terms that read
    /// these rates.
    fn make_rate_forms(&mut self, what: InRates<'_>) -> Result<Vec<Source>, SystemError> {
        let wanted = what.terms.iter().filter(|k| self.terms[**k].law.reads_rates(what.order));
        let source = |k: &usize| {
            let frozen = || self.frozen.iter().position(|f| f.term == *k);
            match what.branches {
                Branches::Frozen(_) => frozen().map_or(Source::Term(*k), Source::Frozen),
                Branches::AsWritten => Source::Term(*k),
            }
        };
        let sources: Vec<Source> = wanted.map(source).collect();
        for source in &sources {
            let key = (*source, what.order);
            if !self.rate_forms.contains_key(&key) {
                let made = self.rate_form(*source, what.order)?;
                self.rate_forms.insert(key, made);
            }
        }
        let window = self.window;
        self.rate_forms.values_mut().flatten().for_each(|form| form.term.set_step(window));
        Ok(sources)
    }

    /// The derivative of a term in rates, on its points.
    fn rate_form(&self, source: Source, order: RateOrder) -> Result<Option<Derivative>, SystemError> {
        let (term, behind) = match source {
            Source::Term(k) => (&self.terms[k], Vec::new()),
            Source::Frozen(k) => (&self.frozen[k].form, self.branch_fields(k)),
        };
        let Some(RateLaw { law, n_fields }) = compile_rates(&term.law, order) else { return Ok(None) };
        let nothing = known(1, FieldSpace::Global);
        let mut fields: Vec<&Field> = self.fields.iter().chain(&behind).collect();
        fields.resize(n_fields, &nothing);
        fields.extend_from_within(..);
        self.on_points_of(term, law, &fields).map(|term| Some(Derivative { term, n_fields }))
    }

    /// What stands behind the fields of the scene up to the branches of a frozen term and their regularisation.
    fn branch_fields(&self, frozen: usize) -> Vec<Field> {
        let Integrator { domain, binding } = &self.frozen[frozen].form.integrator;
        let first = self.fields.len() + 2 * frozen;
        let bases = || binding.groups.iter().flat_map(|group| &group.bases);
        let n = |field: usize| bases().find(|b| b.field.index() == field).map_or(1, |b| b.n_components);
        let mut fields = vec![known(1, FieldSpace::Global); 2 * frozen];
        fields.push(known(n(first), FieldSpace::Points(PointSpace::new(&self.mesh, domain))));
        fields.push(known(n(first + 1), FieldSpace::Global));
        fields
    }

    /// A law on the points of a term, interpreted.
    fn on_points_of(
        &self,
        term: &AssembledTerm,
        law: TermLaw,
        fields: &[&Field],
    ) -> Result<AssembledTerm, SystemError> {
        let refused = |error: &dyn std::fmt::Display| SystemError::Layout(error.to_string());
        let domain = Arc::clone(&term.integrator.domain);
        let slots = LawSlots { inputs: &law.inputs, tests: &law.tests, trials: &law.trials };
        let binding = Binding::new(&self.mesh, &domain, fields, slots).map_err(|e| refused(&e))?;
        let tangent = tangent_kernel(&law);
        let kernels: Vec<_> = std::iter::once(&law.residual).chain(&tangent).collect();
        let mut kernels = InterpreterBackend.compile(&kernels).map_err(|e| refused(&e))?.into_iter();
        let (residual, tangent) = (kernels.next().expect("a kernel for each"), kernels.next());
        let integrator = Integrator { domain, binding: Arc::new(binding) };
        let mut starts = self.numbering.starts.clone();
        starts.resize(fields.len(), None);
        Ok(AssembledTerm::new(law, integrator, None, residual, tangent, &starts))
    }

    /// The values of all fields that a derivative reads, and behind them rates by dof.
    fn beside_rates<'a>(&'a self, form: &Derivative, what: InRates<'a>, rates: &'a [f64]) -> StateValues<'a> {
        let mut values = match what.branches {
            Branches::AsWritten => self.values(what.at),
            Branches::Frozen(active) => self.values_with(what.at, active),
        };
        values.current.resize(form.n_fields, &[]);
        values.current.extend(self.slices(rates));
        values.current.resize(2 * form.n_fields, &[]);
        values
    }
}
