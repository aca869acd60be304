//! The matrix of the terms that are not linear, at a state.

use std::sync::Arc;

use wfl_compiler::Class;

use super::applied::AppliedTangent;
use super::on_faces::PartOnFaces;
use super::places::Places;
use super::{ActiveSet, Branches, FIXED, System, pattern};
use crate::assemble::{AssembledTerm, FieldValues, TermError};
use crate::frames::Frames;
use crate::window::Window;
use wfl_sparse::csr::{Csr, CsrError, Pattern};
use wfl_sparse::solve::Operator;

/// The tangent of the changing terms over the free dofs, the rows of this rank; that of the linear terms is
/// [`System::bulk`].
#[derive(Clone, Debug)]
pub struct Tangent {
    /// The matrix.
    pub changing: Csr,
    /// In the axes of the scene, where local frames make that another one.
    scene_axes: Option<Csr>,
    /// Where its pattern follows images.
    pub(super) images: Option<OfImages>,
    /// In place of the matrix, which has no entries then.
    pub(super) applied: Option<AppliedTangent>,
    /// The part of terms on faces, which the matrix has, too; after [`System::keep_faces_apart`].
    on_faces: Option<PartOnFaces>,
}

/// A term in the place of one of a system.
#[derive(Clone, Copy)]
pub struct StandIn<'a> {
    /// The position of that one.
    pub term: usize,
    /// The other one.
    pub form: &'a AssembledTerm,
    /// What it reads.
    pub values: FieldValues<'a>,
}

/// What a tangent keeps whose pattern follows images.
#[derive(Clone, Debug)]
pub(super) struct OfImages {
    /// The terms whose images stay.
    pub(super) fixed: Csr,
    /// Their places in the whole.
    pub(super) places: Vec<usize>,
    /// The step that the pattern was made in, whatever its rates are.
    pub(super) step: Option<Window>,
}

impl OfImages {
    fn new(pattern: &Arc<Pattern>) -> Self {
        Self { fixed: Csr::zeros(pattern.clone()), places: (0..pattern.n_entries()).collect(), step: None }
    }

    /// The values of the whole: in the order of the fixed part those that stand there, and then row, column and value of each other one.
    fn memory(&self, whole: &Csr) -> Vec<f64> {
        let mut out: Vec<f64> = self.places.iter().map(|place| whole.values()[*place]).collect();
        for row in 0..whole.n_rows() {
            let (columns, values) = whole.row(row);
            let fixed = self.fixed.pattern().row(row);
            for (column, value) in columns.iter().zip(values).filter(|(column, _)| fixed.binary_search(column).is_err())
            {
                #[expect(clippy::cast_precision_loss, reason = "fewer than 2^32 rows")]
                out.extend([row as f64, f64::from(*column), *value]);
            }
        }
        out
    }

    /// The whole that [`Self::memory`] is of, and where the fixed part stands in it; `None` if it is that of another system.
    fn recalled(&self, memory: &[f64]) -> Option<(Csr, Vec<usize>)> {
        let (values, added) = memory.split_at_checked(self.places.len())?;
        let (triplets, rest) = added.as_chunks::<3>();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "rows and columns are whole numbers"
        )]
        let triplets: Vec<(u32, u32, f64)> =
            triplets.iter().map(|[i, j, value]| (*i as u32, *j as u32, *value)).collect();
        let pattern = self.fixed.pattern();
        let added = Csr::from_triplets(pattern.n_rows(), pattern.n_cols(), &triplets).ok()?;
        let mut whole = Csr::zeros(Arc::new(pattern.union(added.pattern()).ok()?));
        let places = [pattern, added.pattern()].map(|part| part.positions_in(whole.pattern()));
        let [Some(places), Some(places_of_added)] = places else { return None };
        let slots = whole.values_mut();
        places.iter().zip(values).for_each(|(place, value)| slots[*place] = *value);
        places_of_added.iter().zip(added.values()).for_each(|(place, value)| slots[*place] = *value);
        rest.is_empty().then_some((whole, places))
    }
}

impl Tangent {
    /// In place of the matrix of all terms, where these are applied; `None` before there is one, too.
    #[must_use]
    pub fn operator(&self) -> Option<Arc<dyn Operator>> {
        let operator = self.applied.as_ref()?.operator.as_ref()?;
        Some(Arc::clone(operator) as Arc<dyn Operator>)
    }

    /// The part of terms on faces, of the last state that [`System::tangent`] was made at; after [`System::keep_faces_apart`].
    #[must_use]
    pub fn on_faces(&self) -> Option<&Arc<Csr>> {
        self.on_faces.as_ref().map(|part| &part.matrix)
    }

    /// Forgets the operator; what sizes of a residual need stays.
    pub fn forget_operator(&mut self) {
        self.applied.iter_mut().for_each(|applied| applied.operator = None);
    }

    /// Whether it has no matrix.
    #[must_use]
    pub fn is_applied(&self) -> bool {
        self.applied.is_some()
    }

    /// The values of the changing terms, and where these follow images those that images have added with their rows and columns; where
    /// they are applied what sizes of a residual need of them. What [`Self::recall`] takes.
    #[must_use]
    pub fn memory(&self) -> Vec<f64> {
        if let Some(applied) = &self.applied {
            return applied.memory();
        }
        match &self.images {
            Some(images) => images.memory(&self.changing),
            None => self.changing.values().to_vec(),
        }
    }

    /// Takes over values of [`Self::memory`], or zero for none; false, and nothing is changed, if they are those of another system.
    #[must_use]
    pub fn recall(&mut self, memory: &[f64]) -> bool {
        if memory.is_empty() {
            self.clear();
            return true;
        }
        if let Some(applied) = &mut self.applied {
            return applied.recall(memory);
        }
        let Some(images) = &mut self.images else {
            let fits = memory.len() == self.changing.values().len();
            if fits {
                self.changing.values_mut().copy_from_slice(memory);
            }
            return fits;
        };
        let Some((matrix, places)) = images.recalled(memory) else { return false };
        // a pattern that has not changed stays the same one
        if **matrix.pattern() == **self.changing.pattern() {
            self.changing.values_mut().copy_from_slice(matrix.values());
        } else {
            (images.places, self.changing) = (places, matrix);
        }
        images.step = None;
        self.on_faces.iter_mut().for_each(|part| part.step = None);
        true
    }
}

impl Tangent {
    /// Makes it zero.
    fn clear(&mut self) {
        self.changing.values_mut().fill(0.0);
        self.applied.iter_mut().for_each(AppliedTangent::clear);
        self.images.iter_mut().for_each(|images| images.step = None);
        self.on_faces = None;
    }
}

impl System {
    /// A tangent of zeros with the pattern of this system; where images are followed it gets theirs with its values.
    #[must_use]
    pub fn new_tangent(&self) -> Tangent {
        let Places { changing, axes, .. } = self.places();
        Tangent {
            changing: Csr::zeros(changing.clone()),
            scene_axes: axes.as_ref().map(|axes| Csr::zeros(axes.pattern().clone())),
            images: self.follows_images().then(|| OfImages::new(changing)),
            applied: self
                .without_matrix
                .as_deref()
                .filter(|_| !self.is_linear())
                .map(|held| AppliedTangent::new(self.numbering.n_dofs, held.rest.as_ref())),
            on_faces: None,
        }
    }

    /// The pattern of the changing terms over the free dofs, without those whose images are followed.
    #[must_use]
    pub fn changing_pattern(&self) -> &Arc<Pattern> {
        &self.places().changing
    }

    /// Assembles the tangent of the changing terms at `u` into `out`, a tangent of this system.
    ///
    /// # Errors
    /// [`TermError`] with its place; `out` is zero then.
    pub fn tangent(&self, u: &[f64], branches: Branches<'_>, out: &mut Tangent) -> Result<(), TermError> {
        if out.applied.is_some() {
            return self.apply_tangent(u, branches, out);
        }
        self.located().map_err(TermError::Matrix)?;
        let mut result = match &out.images {
            Some(_) => self.tangent_of_images(u, branches, out),
            None => {
                let matrix = out.scene_axes.as_mut().unwrap_or(&mut out.changing);
                self.add_tangents(u, branches, &[], matrix)
            }
        };
        if result.is_ok() {
            let made = self.tangent_on_faces(u, branches, out.on_faces.take());
            result = made.map(|made| out.on_faces = made);
        }
        self.turned(out, result)
    }

    /// The same as the terms are written, with others in the places of some; [`Self::find_place`] has found theirs.
    ///
    /// # Errors
    /// [`TermError`] with its place; `out` is zero then.
    pub fn tangent_with(&self, u: &[f64], others: &[StandIn<'_>], out: &mut Tangent) -> Result<(), TermError> {
        let matrix = out.scene_axes.as_mut().unwrap_or(&mut out.changing);
        let result = self.add_tangents(u, Branches::AsWritten, others, matrix);
        self.turned(out, result)
    }

    /// Finds where a term that is none of this system stands in its tangents; false where it couples what the terms of the
    /// system do not.
    pub fn find_place(&self, term: &mut AssembledTerm) -> bool {
        if self.applies_tangents() {
            return self.with_matrix().is_ok_and(|system| system.find_place(term));
        }
        let (pattern, rows) = self.places().rows(&self.numbering);
        let mut fits = true;
        term.for_each_entity(|tests, trials| {
            let numbers = |dofs: &[u32]| dofs.iter().map(|d| rows[*d as usize]).filter(|k| *k != FIXED).collect();
            let (tests, trials): (Vec<u32>, Vec<u32>) = (numbers(tests), numbers(trials));
            let has = |row: u32, column: u32| pattern.position(row as usize, column as usize).is_some();
            fits &= tests.iter().all(|row| trials.iter().all(|column| has(*row, *column)));
        });
        if fits {
            term.locate(pattern, rows);
        }
        fits
    }

    /// Brings what was assembled into local frames.
    fn turned(&self, out: &mut Tangent, result: Result<(), TermError>) -> Result<(), TermError> {
        if let (Some(turned), Some(axes)) = (&mut out.scene_axes, &self.places().axes) {
            self.numbering.frames.turn_matrix(turned, |d| axes.rows[d] as usize);
            axes.apply_into(turned, out.changing.values_mut());
        }
        if result.is_err() {
            // what was added before the error is no tangent, and no measure of rounding either
            out.changing.values_mut().fill(0.0);
        }
        result
    }

    fn add_tangents(
        &self,
        u: &[f64],
        branches: Branches<'_>,
        others: &[StandIn<'_>],
        matrix: &mut Csr,
    ) -> Result<(), TermError> {
        let values = match branches {
            Branches::AsWritten => self.values(u),
            Branches::Frozen(active) => self.values_with(u, active),
        };
        let is_frozen = matches!(branches, Branches::Frozen(_));
        let mut is_new = true;
        let changes = |k: usize| self.terms[k].law.class >= Class::Nonlinear;
        let stays = |k: &usize| others.iter().all(|other| other.term != *k);
        for k in (0..self.terms.len()).filter(|k| changes(*k) && stays(k)) {
            let term = &self.terms[k];
            let frozen = self.frozen.iter().find(|f| is_frozen && f.term == k);
            let term = frozen.map_or(term, |f| &f.form);
            match std::mem::take(&mut is_new) {
                true => term.set_tangent(&self.mesh, values.view(), matrix.values_mut())?,
                false => term.add_tangent(&self.mesh, values.view(), matrix.values_mut())?,
            }
        }
        if is_new {
            matrix.values_mut().fill(0.0);
        }
        for other in others.iter().filter(|other| changes(other.term)) {
            other.form.add_tangent(&self.mesh, other.values, matrix.values_mut())?;
        }
        Ok(())
    }

    /// The matrix of some terms over the dofs that have a number, without entries; a term with a frozen form counts as
    /// that.
    ///
    /// # Errors
    /// [`CsrError`] when the pattern does not fit the index types.
    pub fn partial_matrix(&self, terms: &[usize], numbers: &[u32]) -> Result<Csr, CsrError> {
        let n = numbers.iter().filter(|k| **k != FIXED).count();
        let form = |k: usize| self.frozen.iter().find(|f| f.term == k).map_or(&self.terms[k], |f| &f.form);
        pattern(terms.iter().map(|k| form(*k)), n, &Frames::default(), |d| numbers[d as usize], None)
    }

    /// Adds the tangents of some terms at `u` to a matrix of [`Self::partial_matrix`], on the branches of an active set
    /// where they have a frozen form. Leaves them without a place in the tangent of the system: [`Self::leave_out`] finds
    /// it again.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub fn add_partial_tangent(
        &mut self,
        terms: &[usize],
        u: &[f64],
        active: &ActiveSet,
        numbers: &[u32],
        matrix: &mut Csr,
    ) -> Result<(), TermError> {
        let shape = matrix.pattern().clone();
        for k in terms {
            self.form_mut(*k).locate(&shape, numbers);
            let values = self.values_with(u, active);
            let form = self.frozen.iter().find(|f| f.term == *k).map_or(&self.terms[*k], |f| &f.form);
            let added = form.add_tangent(&self.mesh, values.view(), matrix.values_mut());
            drop(values);
            self.form_mut(*k).forget();
            added?;
        }
        Ok(())
    }

    fn form_mut(&mut self, term: usize) -> &mut AssembledTerm {
        match self.frozen.iter().position(|f| f.term == term) {
            Some(k) => &mut self.frozen[k].form,
            None => &mut self.terms[term],
        }
    }
}
