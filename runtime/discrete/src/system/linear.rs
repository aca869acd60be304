//! The matrix of the linear terms, and a mass that is taken from some nodes and given to others.

use std::sync::Arc;

use wfl_compiler::{Class, TermLaw};
use wfl_sparse::csr::{
    Csr, CsrError, Outside, Pattern, PatternBuilder, Restriction, product_and_size, product_and_sizes,
};

use super::applied::{At, TermsOperator};
use super::{System, SystemError, past::stays, pattern};
use crate::{assemble::AssembledTerm, rates::Rates};

/// The matrix of the linear terms by dof, in the axes of the scene.
#[derive(Clone, Debug)]
pub(super) enum LinearMatrix {
    /// All of it: it is assembled again, or the bulk has other entries (local frames, dofs that follow others).
    Whole(Csr),
    /// What the bulk does not have: rows and columns of fixed dofs.
    BesideBulk(Outside),
    /// None: what its products are.
    Applied(Arc<TermsOperator>),
}

/// What takes the mass from some dofs and gives it to others.
#[derive(Clone, Debug)]
pub struct Redistribution {
    /// The whole mass that is left, by dof in the axes of the scene.
    mass: Csr,
    /// What is added to that of the terms, where these see the second rates.
    difference: Csr,
    /// By dof, whether it has no mass any more.
    relieved: Vec<bool>,
}

impl Redistribution {
    /// Of the mass that is left and what it has more than that of the terms, by dof in the axes of the scene, and by dof whether
    /// it has no mass any more.
    #[must_use]
    pub fn new(mass: Csr, difference: Csr, relieved: Vec<bool>) -> Self {
        Self { mass, difference, relieved }
    }

    /// Whether a dof has no mass any more.
    #[must_use]
    pub fn is_relieved(&self, dof: usize) -> bool {
        self.relieved[dof]
    }
}

impl System {
    pub(super) fn linear_terms(&self) -> impl Iterator<Item = &AssembledTerm> {
        self.terms.iter().filter(|t| t.law.class == Class::Linear)
    }

    /// Whether all equations are linear, and their matrix stays while the increment of the step variable does.
    #[must_use]
    pub fn bulk_stays(&self) -> bool {
        self.is_linear() && self.linear_terms_stay()
    }

    /// Whether the matrix of the linear terms stays while the increment of the step variable does.
    #[must_use]
    pub fn linear_terms_stay(&self) -> bool {
        let stays = |law: &TermLaw| !law.tangent_reads_known && (!law.tangent_has_uniforms || stays(&law.prologue));
        self.linear_terms().all(|t| stays(&t.law))
    }

    /// Whether the matrix of the linear terms is not that of the present step.
    pub(super) fn linear_is_stale(&self) -> bool {
        let changed = |(term, uniforms): (&AssembledTerm, &Vec<f64>)| {
            let law = &term.law;
            law.tangent_reads_known || law.tangent_has_uniforms && term.uniforms() != uniforms
        };
        let apart = self.known.rates.as_ref().map_or(0.0, Rates::factor_apart);
        self.linear.is_none()
            || self.linear_mass != apart
            || self.linear_terms().zip(&self.linear_uniforms).any(changed)
    }

    /// Makes the matrix of the linear terms, or the operator in its place.
    pub(super) fn renew_linear(&mut self, zero: &[f64]) -> Result<(), SystemError> {
        let Some(held) = self.without_matrix.clone() else { return self.assemble_linear(zero) };
        // what was made before goes first
        self.linear = None;
        let part = Arc::new(self.linear_part(&held)?);
        let operator = TermsOperator::new(self, vec![part], At::any());
        self.linear = Some(Arc::new(LinearMatrix::Applied(Arc::new(operator))));
        Ok(())
    }

    /// Assembles the matrix of the linear terms, and its part over the free dofs.
    pub(super) fn assemble_linear(&mut self, zero: &[f64]) -> Result<(), SystemError> {
        let mut linear = match self.linear.take().map(Arc::try_unwrap) {
            Some(Ok(LinearMatrix::Whole(mut before))) => {
                before.values_mut().fill(0.0);
                before
            }
            _ => Csr::zeros(self.linear_pattern()?),
        };
        let wanted: Vec<usize> = (0..self.terms.len()).filter(|k| self.terms[*k].law.class == Class::Linear).collect();
        self.add_terms(&wanted, zero, &mut linear)?;
        self.add_redistributed_mass(&mut linear);
        let (frames, equations) = (&self.numbering.frames, self.numbering.equations());
        self.bulk = Arc::new(self.over_free(&linear)?);
        let as_it_is = frames.is_empty() && self.numbering.ties().is_empty();
        self.linear = Some(Arc::new(if as_it_is && !self.bulk_follows_steps() && self.redistribution.is_none() {
            LinearMatrix::BesideBulk(Outside::new(&linear, &equations)?)
        } else {
            LinearMatrix::Whole(linear)
        }));
        Ok(())
    }

    /// A matrix by dof in the axes of the scene, whose pattern has nodes with local frames whole, over the free dofs.
    pub(crate) fn over_free(&self, matrix: &Csr) -> Result<Csr, CsrError> {
        let numbering = &self.numbering;
        let map = Restriction::new(matrix.pattern(), &numbering.equations(), numbering.n_free())?;
        if numbering.frames.is_empty() {
            return Ok(map.apply(matrix));
        }
        let mut turned = matrix.clone();
        numbering.frames.turn_matrix(&mut turned, |d| d);
        Ok(map.apply(&turned))
    }

    /// Products and sizes of the matrix of the linear terms: `p = K d`, `s = |K| |d|`, and `t = |K| |x|` where `x` is given.
    /// False before it was assembled.
    pub(super) fn multiply_linear(&self, d: &[f64], x: Option<&[f64]>, outs: [&mut [f64]; 3]) -> bool {
        let threads = rayon::current_num_threads();
        let [p, s, t] = outs;
        match (self.linear.as_deref(), x) {
            (None, _) => return false,
            (Some(LinearMatrix::Applied(a)), x) => {
                a.multiply(d, p);
                a.sizes_by_dof(d, s);
                if let Some(x) = x {
                    a.sizes_by_dof(x, t);
                }
            }
            (Some(LinearMatrix::Whole(a)), None) => product_and_size(a, d, [p, s], threads),
            (Some(LinearMatrix::Whole(a)), Some(x)) => product_and_sizes(a, d, x, [p, s, t], threads),
            (Some(LinearMatrix::BesideBulk(a)), None) => product_and_size(&a.around(&self.bulk), d, [p, s], threads),
            (Some(LinearMatrix::BesideBulk(a)), Some(x)) => {
                product_and_sizes(&a.around(&self.bulk), d, x, [p, s, t], threads);
            }
        }
        true
    }

    /// Adds the tangents of linear terms to a matrix by dof.
    fn add_terms(&mut self, wanted: &[usize], zero: &[f64], matrix: &mut Csr) -> Result<(), SystemError> {
        let every_dof: Vec<u32> = (0..u32::try_from(zero.len()).expect("fewer than 2^32 dofs")).collect();
        for k in wanted {
            self.terms[*k].locate_own(matrix.pattern(), &every_dof, self.share.as_ref());
            let added = self.terms[*k].add_tangent(&self.mesh, self.values(zero).view(), matrix.values_mut());
            self.terms[*k].forget();
            added?;
        }
        Ok(())
    }

    /// The tangent of some linear terms with the present laws, by dof in the axes of the scene.
    ///
    /// # Errors
    /// [`SystemError`] with its place.
    pub fn tangent_of(&mut self, wanted: &[usize]) -> Result<Csr, SystemError> {
        let n = self.numbering.n_dofs;
        let terms = wanted.iter().map(|k| &self.terms[*k]);
        let mut made = pattern(terms, n, &self.numbering.frames, |d| d, self.share.as_deref())?;
        self.add_terms(wanted, &vec![0.0; n], &mut made)?;
        Ok(made)
    }

    /// The pattern of the linear terms and of what is added to their mass, by dof: the rows of this rank.
    fn linear_pattern(&self) -> Result<Arc<Pattern>, CsrError> {
        let (n, frames) = (self.numbering.n_dofs, &self.numbering.frames);
        let own = pattern(self.linear_terms(), n, frames, |d| d, self.share.as_deref())?;
        match &self.redistribution {
            Some(redistribution) => {
                Ok(Arc::new(own.pattern().union(&self.pattern_with_nodes(&redistribution.difference)?)?))
            }
            None => Ok(own.pattern().clone()),
        }
    }

    /// The pattern of a matrix by dof, with nodes that have local frames whole: the rows of this rank.
    fn pattern_with_nodes(&self, matrix: &Csr) -> Result<Pattern, CsrError> {
        let (n, frames) = (self.numbering.n_dofs, &self.numbering.frames);
        let mut builder = PatternBuilder::new(n, n);
        let (mut rows, mut columns) = (Vec::new(), Vec::new());
        for (row, number) in (0..n).zip(0u32..).filter(|(row, _)| !matrix.row(*row).0.is_empty()) {
            // turning a node mixes its rows and its columns
            frames.complete([number].iter(), &mut rows);
            frames.complete(matrix.row(row).0.iter(), &mut columns);
            rows.retain(|row| self.owns(*row as usize));
            builder.add_coupling(&rows, &columns);
        }
        builder.build()
    }

    /// The mass that is left where some nodes gave theirs away, by dof in the axes of the scene, with nodes that have local frames
    /// whole: the rows of this rank.
    pub(super) fn redistributed_mass(&self) -> Result<Option<Csr>, CsrError> {
        let Some(redistribution) = &self.redistribution else { return Ok(None) };
        let mut made = Csr::zeros(Arc::new(self.pattern_with_nodes(&redistribution.mass)?));
        self.add_own_rows(&redistribution.mass, 1.0, &mut made);
        Ok(Some(made))
    }

    /// Takes the mass from some nodes, from now on.
    pub fn redistribute(&mut self, redistribution: Redistribution) {
        if let Some(rates) = &mut self.known.rates {
            rates.stand_apart();
        }
        self.redistribution = Some(Arc::new(redistribution));
        self.find_nodes_without_mass();
        (self.linear, self.steady, self.without_matrix) = (None, None, None);
    }

    /// What takes the mass from some nodes.
    #[must_use]
    pub fn redistribution(&self) -> Option<&Redistribution> {
        self.redistribution.as_deref()
    }

    /// Adds the rows of this rank of the mass that stands beside the terms.
    fn add_redistributed_mass(&self, linear: &mut Csr) {
        let (Some(redistribution), Some(rates)) = (&self.redistribution, &self.known.rates) else { return };
        // one of them is zero
        let parts =
            [(&redistribution.mass, rates.factor_apart()), (&redistribution.difference, rates.factors().acceleration)];
        for (matrix, factor) in parts.into_iter().filter(|(_, factor)| *factor != 0.0) {
            self.add_own_rows(matrix, factor, linear);
        }
    }

    /// Adds the rows of this rank of a matrix by dof, times a factor.
    fn add_own_rows(&self, matrix: &Csr, factor: f64, to: &mut Csr) {
        for row in (0..matrix.n_rows()).filter(|row| self.owns(*row)) {
            let (columns, values) = matrix.row(row);
            for (column, value) in columns.iter().zip(values) {
                let has_place = to.add_to(row, *column as usize, factor * value);
                debug_assert!(has_place, "the pattern has the entries of the mass");
            }
        }
    }

    /// Adds the forces that terms which see second rates lack of those of the mass that is left, at accelerations by dof in the axes
    /// of the scene: the rows of this rank.
    pub fn add_redistributed(&self, accelerations: &[f64], out: &mut [f64]) {
        if let Some(redistribution) = &self.redistribution {
            self.add_inertia(&redistribution.difference, accelerations, out);
        }
    }

    fn add_inertia(&self, mass: &Csr, accelerations: &[f64], out: &mut [f64]) {
        for (row, out) in out.iter_mut().enumerate().filter(|(row, _)| self.owns(*row)) {
            let (columns, values) = mass.row(row);
            *out += columns.iter().zip(values).map(|(c, v)| v * accelerations[*c as usize]).sum::<f64>();
        }
    }

    /// Adds the inertia that the terms lack at the accelerations that the unknowns `u` have in the present step.
    pub(super) fn add_redistributed_at(&self, u: &[f64], out: &mut [f64]) {
        let (Some(redistribution), Some(rates), Some(past)) =
            (&self.redistribution, &self.known.rates, &self.known.previous)
        else {
            return;
        };
        let mass = if rates.are_apart() { &redistribution.mass } else { &redistribution.difference };
        self.add_inertia(mass, &rates.second(u, &past.unknowns), out);
    }
}
