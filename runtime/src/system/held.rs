//! The held pieces of the terms of a system: their start, their steps, their next choice (`newton/pieces.rs`).

use super::{Parts, System};
use crate::{
    assemble::{FieldValues, TermError},
    csr::CsrError,
    mesh::Mesh,
    newton::{Kinks, Passed, TermPieces, Watched, Way, next_kinks, search},
};
use wfl_compiler::{Class, types::FieldKind};

/// Choices at the beginning that the points of an entity make together.
const CHOICES_TOGETHER: usize = 3;

impl System {
    /// Gives terms their held forms; their guides are fields numbered behind those of the scene.
    ///
    /// # Errors
    /// [`CsrError`] when the pattern does not fit the index types.
    pub fn hold(&mut self, pieces: Vec<TermPieces>) -> Result<(), CsrError> {
        self.guides = pieces.iter().map(TermPieces::no_guides).collect();
        self.watched.clear();
        self.pieces = pieces;
        self.locate()
    }

    /// True if some term has projections whose pieces can be held.
    #[must_use]
    pub fn has_pieces(&self) -> bool {
        !self.pieces.is_empty()
    }

    /// Keeps what the projections are at a converged state, for the start of the next step.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub fn pass(&mut self, u: &[f64]) -> Result<(), TermError> {
        if self.pieces.is_empty() {
            return Ok(());
        }
        let watched = self.watch_pieces(u)?;
        let foretold = self.was_foretold();
        self.passed.truncate(1);
        self.passed.insert(0, Passed { time: self.time, foretold, watched });
        Ok(())
    }

    /// True unless the pieces of this state are nearer to those of the last than to what was to be expected.
    fn was_foretold(&self) -> bool {
        let [last, before] = self.passed.as_slice() else { return true };
        let Some(ahead) = last.ahead(before, self.time) else { return true };
        let wrong = |watched: &[Watched]| -> usize {
            let each = self.pieces.iter().zip(watched).zip(&self.guides);
            each.map(|((piece, watched), guides)| piece.differing(&piece.follow(watched, guides), guides)).sum()
        };
        wrong(&ahead) <= wrong(&last.watched)
    }

    /// Chooses the pieces of a step that goes on as the last two did. Where they do not, this costs an iteration.
    fn expect_pieces(&mut self) {
        let [last, before] = self.passed.as_slice() else { return };
        let Some(ahead) = last.ahead(before, self.time).filter(|_| last.foretold) else { return };
        for ((piece, ahead), guides) in self.pieces.iter_mut().zip(&ahead).zip(&mut self.guides) {
            piece.chosen(0);
            *guides = piece.follow(ahead, guides);
        }
    }

    /// Ties all points: closed and sticking.
    pub fn tie_pieces(&mut self) {
        self.watched.clear();
        for (piece, guides) in self.pieces.iter().zip(&mut self.guides) {
            piece.tie_all(guides);
        }
    }

    /// Says whether the held pieces belong to a converged state.
    pub fn settle(&mut self, settled: bool) {
        self.settled = settled;
        if !settled {
            self.passed.clear();
        }
    }

    /// Makes sure that pieces are held at the start of a step from `u`: those of the last converged state, else those
    /// of the terms as written.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub fn start_pieces(&mut self, u: &[f64]) -> Result<(), TermError> {
        self.watched.clear();
        if self.settled {
            self.expect_pieces();
            return Ok(());
        }
        let mut diagonal = vec![0.0; self.numbering.n_dofs];
        self.with_values(u, |parts, values| {
            for term in parts.terms.iter().filter(|t| t.law.class > Class::Constant && t.on_cells()) {
                term.add_diagonal(parts.mesh, values, &mut diagonal);
            }
            for piece in parts.pieces.iter_mut() {
                piece.fit(parts.mesh, parts.fields, values, &diagonal, (parts.bulk, parts.free));
            }
            Ok(())
        })?;
        // each side may move by the largest displacement that is known
        let unknown = |f: &usize| self.fields[*f].kind == FieldKind::Unknown;
        let known = (0..self.fields.len()).filter(unknown).filter_map(|f| self.range(f));
        let moved = 2.0 * known.flatten().fold(0.0f64, |m, d| m.max(u[d].abs()));
        self.choose_pieces(u, |piece, mesh, values, guides| {
            piece.start(mesh, values, guides);
            piece.tie(mesh, values, guides, moved);
        })
    }

    /// Sets the factor on the friction of held pieces; 1 is the law as written.
    pub fn set_friction(&mut self, factor: f64) {
        self.pieces.iter_mut().for_each(|p| p.set_friction(factor));
    }

    /// True if friction, stiffness and bounds of contact are those of the laws as written.
    pub(crate) fn is_as_written(&self) -> bool {
        self.pieces.iter().all(TermPieces::is_as_written)
    }

    /// Lets traction exceed its bound by this part of the stiffness of the bodies, pieces as they are; 0 is the law as
    /// written.
    pub fn set_overstress(&mut self, part: f64) {
        for (piece, guides) in self.pieces.iter_mut().zip(&mut self.guides) {
            if piece.set_overstress(part) {
                piece.write_softness(guides);
            }
        }
    }

    /// True if pieces can be held of a projection on a ball.
    #[must_use]
    pub fn has_friction(&self) -> bool {
        self.pieces.iter().any(TermPieces::has_friction)
    }

    /// The part of a full step to `u` after which the projections are nearer to their laws; exact where the
    /// bodies are linear. The next choice of pieces starts from there. The first step is full, and so is one that is
    /// not to be searched.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub fn search_pieces(&mut self, u: &[f64], searches: bool) -> Result<f64, TermError> {
        let to = self.watch_pieces(u)?;
        if self.watched.is_empty() || !searches {
            self.watched = to;
            return Ok(1.0);
        }
        Ok(search(self.pieces.iter(), &mut self.watched, &to))
    }

    /// Holds the pieces of the terms as they are written at `u`.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub fn hold_as_written(&mut self, u: &[f64]) -> Result<(), TermError> {
        self.watched.clear();
        self.choose_pieces(u, TermPieces::start)
    }

    /// Holds all points closed and sticking: bodies that are tied together.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub(crate) fn hold_tied(&mut self, u: &[f64]) -> Result<(), TermError> {
        self.watched.clear();
        self.choose_pieces(u, |piece, mesh, values, guides| {
            piece.start(mesh, values, guides);
            piece.tie_all(guides);
        })
    }

    /// What is watched at the two ends of a line.
    pub(crate) fn line(&mut self, from: &[f64], to: &[f64]) -> Result<[Vec<Watched>; 2], TermError> {
        Ok([self.watch_pieces(from)?, self.watch_pieces(to)?])
    }

    /// How far a way along a line goes before a kink, at most to `end`, and the kinks there.
    pub(crate) fn next_kinks(&self, line: &[Vec<Watched>; 2], sign: f64, end: f64) -> (f64, Kinks) {
        let ways = line[0].iter().zip(&line[1]).map(|(from, to)| Way { from, to, sign });
        let guides = self.guides.iter().map(Vec::as_slice);
        next_kinks(self.pieces.iter().zip(ways).zip(guides).map(|((p, way), guides)| (p, way, guides)), end)
    }

    /// How fast the first of some kinks is passed along a line, `at` this part of it.
    pub(crate) fn passage(&self, line: &[Vec<Watched>; 2], at: f64, kinks: &Kinks) -> f64 {
        let Some((k, place)) = kinks.first() else { return 0.0 };
        self.pieces[*k].passage(Way { from: &line[0][*k], to: &line[1][*k], sign: 1.0 }, at, *place)
    }

    /// Changes the branches at some kinks, and turns the directions of slip to the arguments at `u`.
    pub(crate) fn go_on(&mut self, u: &[f64], kinks: &Kinks) -> Result<(), TermError> {
        for (k, place) in kinks {
            self.pieces[*k].cross(*place, &mut self.guides[*k]);
        }
        let watched = self.watch_pieces(u)?;
        for ((piece, watched), guides) in self.pieces.iter().zip(&watched).zip(&mut self.guides) {
            piece.turn(watched, guides);
        }
        Ok(())
    }

    /// Makes contact soft or as written; the pieces stay as they are.
    pub fn set_soft(&mut self, soft: bool) {
        self.watched.clear();
        for (piece, guides) in self.pieces.iter_mut().zip(&mut self.guides) {
            piece.set_soft(soft);
            piece.write_softness(guides);
        }
    }

    /// True if the held pieces belong to a converged state.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.settled
    }

    fn watch_pieces(&mut self, u: &[f64]) -> Result<Vec<Watched>, TermError> {
        self.with_values(u, |Parts { mesh, pieces, .. }, values| {
            Ok(pieces.iter().map(|p| p.watched(mesh, values)).collect())
        })
    }

    /// Chooses the pieces that follow from the held ones, for the `time`th time in this step. Returns the part of the
    /// points whose piece is another one now.
    ///
    /// From a start without a past, all points of an entity choose the same at first where contact is stiff: else one
    /// that sticks takes the load of those beside it, and slip gets on by a point an iteration.
    pub fn follow_pieces(&mut self, time: usize) -> f64 {
        self.pieces.iter_mut().for_each(|p| p.chosen(time));
        let together = !self.settled && time <= CHOICES_TOGETHER;
        let (mut changed, mut points) = (0, 0);
        for ((piece, watched), guides) in self.pieces.iter().zip(&self.watched).zip(&mut self.guides) {
            let mean = (together && piece.locks_entities(&self.fields)).then(|| piece.averaged(watched));
            let next = piece.follow(mean.as_ref().unwrap_or(watched), guides);
            changed += piece.differing(guides, &next);
            points += watched.points().count();
            *guides = next;
        }
        #[expect(clippy::cast_precision_loss, reason = "a share of points")]
        return changed as f64 / points.max(1) as f64;
    }

    /// True if every term is affine in the unknowns once pieces are held: then a full step solves the held problem.
    #[must_use]
    pub fn is_affine_when_held(&self) -> bool {
        let affine = |k: usize| self.pieces.iter().any(|p| p.term == k && p.held.law.class <= Class::Linear);
        self.terms.iter().enumerate().all(|(k, t)| t.law.class <= Class::Linear || affine(k))
    }

    /// True if making contact soft for a while helps ([`TermPieces::is_hard`]).
    #[must_use]
    pub fn is_hard(&self) -> bool {
        self.pieces.iter().any(TermPieces::is_hard)
    }

    /// True if contact binds the stresses of the bodies to its traction ([`TermPieces::binds_stresses`]).
    #[must_use]
    pub fn binds_stresses(&self) -> bool {
        self.pieces.iter().any(TermPieces::binds_stresses)
    }

    /// The largest stiffness of the bodies over a slope ([`TermPieces::reach`]).
    #[must_use]
    pub fn reach(&self) -> f64 {
        self.pieces.iter().fold(0.0, |m, p| m.max(p.reach()))
    }

    fn choose_pieces(
        &mut self,
        u: &[f64],
        choose: impl Fn(&TermPieces, &Mesh, FieldValues<'_>, &mut Vec<f64>),
    ) -> Result<(), TermError> {
        let mut chosen = Vec::with_capacity(self.pieces.len());
        self.with_values(u, |parts, values| {
            for piece in parts.pieces.iter() {
                let mut guides = values.current[piece.field].to_vec();
                choose(piece, parts.mesh, values, &mut guides);
                chosen.push(guides);
            }
            Ok(())
        })?;
        self.guides = chosen;
        Ok(())
    }
}
