//! What multipliers and unknowns do to each other at some dofs, whatever the state of contact is.
//!
//! A contact law couples other dofs where it sticks than where it slips: in stick each component of a multiplier holds its
//! own component of the jump, in slip the bound of friction follows the normal one. Promises: tangents of the terms with
//! multipliers alone, with all points closed and on one branch of friction; rows and columns by the numbers given. Leaves
//! the terms without a place in the matrix of the system: [`System::leave_out`] finds it again.

use wfl_compiler::{Class, types::FieldKind};

use super::{FIXED, System, Tie, nothing, pattern};
use crate::{
    assemble::{AssembledTerm, FieldValues, TermError},
    csr::{Csr, CsrError},
    frames::{Frame, Frames},
};

/// The branch of friction at all points; contact is closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Friction {
    /// No point slides.
    Sticks,
    /// Every point slides, in a direction that its law allows.
    Slips,
}

/// What sets the numbers of a state apart that is like no other: the golden section.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

impl System {
    /// True for a term in which a multiplier has a part.
    pub(crate) fn has_multiplier(&self, term: &AssembledTerm) -> bool {
        let mut fields = term.coupled_fields().map(|f| f.index());
        fields.any(|f| self.fields.get(f).is_some_and(|f| f.kind == FieldKind::Multiplier))
    }

    /// The tangents of the terms with multipliers over the dofs that have a number, on one branch of friction; where a
    /// law has kinks that are no projections, one tangent for each of three states. `at` is the step variable, `size` that of the unknowns.
    ///
    /// # Errors
    /// [`CsrError`] when the pattern does not fit the index types.
    pub(crate) fn couplings(
        &mut self,
        numbers: &[u32],
        friction: Friction,
        at: f64,
        size: f64,
    ) -> Result<Vec<Csr>, CsrError> {
        let n = numbers.iter().filter(|k| **k != FIXED).count();
        let chosen: Vec<usize> = (0..self.terms.len())
            .filter(|k| self.terms[*k].law.class > Class::Constant && self.has_multiplier(&self.terms[*k]))
            .collect();
        self.terms.iter_mut().for_each(|t| t.set_step(at, 1.0));
        self.pieces.iter_mut().for_each(|p| p.set_step(at, 1.0));
        let any = self.state_like_no_other(size);
        self.hold_closed(&any, friction);
        let forms =
            chosen.iter().map(|k| self.pieces.iter().find(|p| p.term == *k).map_or(&self.terms[*k], |p| &p.held));
        let empty = pattern(forms, n, &Frames::default(), |d| numbers[d as usize])?;
        let others: Vec<f64> = any.iter().map(|x| -x).collect();
        let kinked = |k: &usize| self.terms[*k].law.class > Class::Linear && self.pieces.iter().all(|p| p.term != *k);
        let states = if chosen.iter().any(kinked) {
            vec![vec![0.0; any.len()], any, others]
        } else {
            vec![vec![0.0; any.len()]]
        };
        let mut found = Vec::new();
        for state in &states {
            let mut matrix = empty.clone();
            // a state may lie outside the domain of a function: the others tell then
            if self.add_tangents(&chosen, state, numbers, &mut matrix).is_ok() {
                found.push(matrix);
            }
        }
        Ok(found)
    }

    /// Numbers by dof of which no two are in a simple ratio.
    fn state_like_no_other(&self, size: f64) -> Vec<f64> {
        #[expect(clippy::cast_precision_loss, reason = "a number of a dof")]
        let number = |d: usize| size * (((d + 1) as f64 * GOLDEN).fract() - 0.5);
        (0..self.numbering.n_dofs).map(number).collect()
    }

    fn hold_closed(&mut self, u: &[f64], friction: Friction) {
        let mut current = self.slices(u);
        current.extend(self.guides.iter().map(Vec::as_slice));
        let previous = self.previous_slices();
        let values = FieldValues { current: &current, previous: &previous };
        let mut found = Vec::with_capacity(self.pieces.len());
        for piece in &self.pieces {
            let mut guides = piece.no_guides();
            piece.tie_all(&mut guides);
            if friction == Friction::Slips {
                let mut current = current.clone();
                current[piece.field] = &guides;
                let watched = piece.watched(&self.mesh, FieldValues { current: &current, ..values });
                piece.slide_all(&watched, &mut guides);
            }
            found.push(guides);
        }
        self.guides = found;
    }

    fn add_tangents(
        &mut self,
        chosen: &[usize],
        state: &[f64],
        numbers: &[u32],
        matrix: &mut Csr,
    ) -> Result<(), TermError> {
        let shape = matrix.pattern().clone();
        self.with_values(state, |parts, values| {
            for k in chosen {
                let piece = parts.pieces.iter_mut().find(|p| p.term == *k);
                let term = piece.map_or(&mut parts.terms[*k], |p| &mut p.held);
                term.locate(&shape, numbers);
                let added = term.add_tangent(parts.mesh, values, matrix.values_mut());
                term.forget();
                added?;
            }
            Ok(())
        })
    }

    /// Takes dofs out of the system and lets others follow their leaders; `frames` are those of all turned nodes.
    ///
    /// # Errors
    /// [`CsrError`] when the pattern does not fit the index types.
    pub(crate) fn leave_out(
        &mut self,
        dofs: impl IntoIterator<Item = usize>,
        ties: Vec<Tie>,
        frames: Vec<Frame>,
    ) -> Result<(), CsrError> {
        self.numbering.set_frames(frames);
        self.numbering.fix(dofs);
        self.numbering.tie(ties);
        self.guides = self.pieces.iter().map(crate::newton::TermPieces::no_guides).collect();
        self.linear = None;
        self.bulk = nothing(self.numbering.n_free());
        self.locate()
    }
}
