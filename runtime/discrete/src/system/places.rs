//! Where the changing terms stand in their matrix.
//!
//! Found where it is first asked for: a system whose terms are applied never has it. Promises: copies of a system share what one of them
//! has found, until one is changed.

use std::sync::{Arc, OnceLock};

use wfl_compiler::Class;
use wfl_sparse::csr::{Csr, CsrError, Pattern, Restriction};

use super::{FIXED, Numbering, System, nothing, pattern};
use crate::assemble::AssembledTerm;
use crate::share::Share;

/// Where the changing terms are summed before they are rotated into local frames: their matrix in the axes of the scene
/// over the free dofs, those that follow others, and all dofs of nodes with frames.
pub(super) struct SceneAxes {
    pattern: Arc<Pattern>,
    /// By dof its row, or [`FIXED`].
    pub(super) rows: Vec<u32>,
    map: Restriction,
}

impl SceneAxes {
    pub(super) fn new<'t>(
        terms: impl Iterator<Item = &'t AssembledTerm>,
        numbering: &Numbering,
        share: Option<&Share>,
    ) -> Result<Self, CsrError> {
        let equations = numbering.equations();
        let (mut rows, mut targets) = (vec![FIXED; numbering.n_dofs], Vec::new());
        for (dof, row) in rows.iter_mut().enumerate() {
            if equations[dof] != FIXED || numbering.frames.of(dof).is_some() {
                *row = u32::try_from(targets.len()).expect("fewer than 2^32 dofs");
                targets.push(equations[dof]);
            }
        }
        let matrix = pattern(terms, targets.len(), &numbering.frames, |d| rows[d as usize], share)?;
        let map = Restriction::new(matrix.pattern(), &targets, numbering.n_free())?;
        Ok(Self { pattern: matrix.pattern().clone(), rows, map })
    }

    pub(super) fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    /// What a matrix in the axes of the scene, turned into local frames, gives over the free dofs.
    pub(super) fn apply_into(&self, turned: &Csr, values: &mut [f64]) {
        self.map.apply_into(turned, values);
    }

    /// The pattern over the free dofs.
    pub(super) fn free_pattern(&self) -> &Arc<Pattern> {
        self.map.pattern()
    }
}

/// Where the changing terms stand in their matrix.
pub(super) struct Places {
    /// The pattern over the free dofs.
    pub(super) changing: Arc<Pattern>,
    /// Where they are summed before they are rotated; `None` without local frames and dofs that follow others.
    pub(super) axes: Option<SceneAxes>,
    /// Why there is no such matrix; the pattern is empty then.
    error: Option<CsrError>,
}

impl Places {
    /// Of a system of so many free dofs without changing terms.
    pub(super) fn none(n_free: usize) -> Self {
        Self { changing: Arc::clone(nothing(n_free).pattern()), axes: None, error: None }
    }

    /// The pattern that terms are summed on, and by dof its row.
    pub(super) fn rows<'a>(&'a self, numbering: &'a Numbering) -> (&'a Arc<Pattern>, &'a [u32]) {
        match &self.axes {
            Some(axes) => (axes.pattern(), &axes.rows),
            None => (&self.changing, &numbering.free),
        }
    }
}

impl System {
    /// Where the changing terms stand; nowhere after an error, which [`Self::located`] tells.
    pub(super) fn places(&self) -> &Places {
        self.places.get_or_init(|| {
            let failed = |error| Places { error: Some(error), ..Places::none(self.numbering.n_free()) };
            self.locate().unwrap_or_else(failed)
        })
    }

    /// The same.
    ///
    /// # Errors
    /// [`CsrError`] when the pattern fits neither the index types nor the memory.
    pub(super) fn located(&self) -> Result<&Places, CsrError> {
        let places = self.places();
        places.error.clone().map_or(Ok(places), Err)
    }

    /// Finds them.
    fn locate(&self) -> Result<Places, CsrError> {
        let (numbering, share) = (&self.numbering, self.share.as_deref());
        let all = self.terms_with_places();
        let places = if numbering.frames.is_empty() && !numbering.has_ties() {
            let place = |d: u32| numbering.free[d as usize];
            let free = pattern(all, numbering.n_free(), &numbering.frames, place, share)?;
            Places { changing: free.pattern().clone(), axes: None, error: None }
        } else {
            let axes = SceneAxes::new(all, numbering, share)?;
            Places { changing: axes.free_pattern().clone(), axes: Some(axes), error: None }
        };
        let (pattern, rows) = places.rows(numbering);
        for term in self.located_forms() {
            term.locate_together(pattern, rows, self.share.as_ref());
        }
        Ok(places)
    }

    /// What stands in tangents: the changing terms, and their frozen forms.
    fn located_forms(&self) -> impl Iterator<Item = &AssembledTerm> {
        let changes = |t: &&AssembledTerm| t.law.class >= Class::Nonlinear;
        self.terms.iter().filter(changes).chain(self.frozen.iter().map(|f| &f.form))
    }

    /// Those of them with places that stay: images that are followed have theirs in each tangent.
    pub(super) fn terms_with_places(&self) -> impl Iterator<Item = &AssembledTerm> {
        let follows = self.follows_images();
        self.located_forms().filter(move |t| !(follows && t.integrator.moves()))
    }

    /// Forgets where they stood: terms or dofs are others.
    pub(super) fn forget_places(&mut self) {
        self.places = Arc::default();
        for term in self.terms.iter_mut().chain(self.frozen.iter_mut().map(|f| &mut f.form)) {
            term.forget();
        }
        self.count();
    }

    /// Leaves the changing terms without a matrix.
    pub(super) fn leave_places(&mut self) {
        self.places = Arc::new(OnceLock::from(Places::none(self.numbering.n_free())));
    }
}
