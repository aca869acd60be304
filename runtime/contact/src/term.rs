//! One term of contact: its projections, the law that reads them, and how they are scaled to the bodies.

use std::sync::OnceLock;

use wfl_compiler::{BranchSizes, Projection, ProjectionKind, SlopesLaw, types::FieldKind};

use super::{
    Complementarity,
    alternation::PointGraph,
    background,
    sharing::{PointName, SharedPoints},
    slopes::ArgumentSlopes,
};
use wfl_discrete::assemble::{AssembledTerm, FieldValues, Over};
use wfl_discrete::domain::NAME;
use wfl_discrete::field::Field;
use wfl_discrete::system::{System, TermBranches};
use wfl_discrete::value::{Sampled, Value};
use wfl_discrete::window::Window;
use wfl_mesh::mesh::Mesh;

/// Below this `c`, a factor on what the argument of a projection has beyond its value, contact is stiff against the bodies: a
/// tenth of the overlap that bodies would leave is all that contact leaves then.
pub(super) const STIFF: f64 = 0.1;

/// The projections of one term.
#[derive(Clone)]
pub struct ContactTerm {
    /// Position of the term in the system.
    pub term: usize,
    /// Position of its frozen form among those of the system.
    pub frozen: usize,
    /// The number of the field of its branches, behind those of the scene; that of its regularisation is the next.
    pub field: usize,
    pub(super) projections: Vec<Projection>,
    /// Numbers of its branches at an integration point, with its name where faces are cut, and of its regularisation.
    pub(super) sizes: BranchSizes,
    /// Arguments, radii and values of the projections.
    pub(super) law: Value,
    /// The derivatives of the arguments.
    pub(super) slopes: ArgumentSlopes,
    pub(super) sampled: Sampled,
    /// It acts on a multiplier, or reads one.
    pub(super) has_multiplier: bool,
    /// It may have a force where all its projections are open.
    pub(super) acts_when_open: bool,
    pub(super) scaling: Scaling,
    /// The step that it was brought to.
    pub(super) window: Window,
    /// The shortest edge of a face of the other side, as soon as somebody has asked.
    pub(super) shortest_face: OnceLock<f64>,
    /// Where several ranks have the points.
    pub(super) shared: Option<SharedPoints>,
    /// Its points with their neighbours, as soon as somebody has asked for them.
    pub(super) graph: OnceLock<PointGraph>,
}

/// How the projections of a term are scaled to the stiffness of the bodies.
#[derive(Clone, Debug, Default)]
pub(super) struct Scaling {
    /// By projection: `c` of `t = P(t + c (x - t))`.
    pub(super) ratios: Vec<f64>,
    /// By projection: the slope of its argument in the displacement (stress by length).
    pub(super) slopes: Vec<f64>,
    /// The stiffness of the bodies, force by displacement and area; 0 until it is known.
    pub(super) stiffness: f64,
    /// Contact is so stiff against the bodies that making it compliant for a while helps.
    pub(super) is_stiff: bool,
    /// Contact is so soft as written, and its linear part so stiff, that it binds the stresses of the bodies.
    pub(super) is_over_constrained: bool,
}

/// What a contact term is made of.
pub struct ContactParts {
    /// Position of the term in the system.
    pub term: usize,
    /// Position of its frozen form among those of the system.
    pub frozen: usize,
    /// The number of the field of its branches.
    pub field: usize,
    /// Its projections, inner ones first.
    pub projections: Vec<Projection>,
    /// Arguments, radii and values of the projections.
    pub law: Value,
    /// The derivatives of the arguments; `None` if no argument changes with the unknowns.
    pub slopes: Option<SlopesLaw>,
    /// Where the law is read.
    pub sampled: Sampled,
}

impl ContactTerm {
    /// The projections of a term; `form` is its frozen form.
    #[must_use]
    pub fn new(parts: ContactParts, form: &AssembledTerm, fields: &[Field]) -> Self {
        let ContactParts { term, frozen, field, projections, law, slopes, sampled } = parts;
        let is_multiplier = |f: usize| fields[f].kind == FieldKind::Multiplier;
        let scaling = Scaling {
            ratios: vec![1.0; projections.len()],
            slopes: vec![0.0; projections.len()],
            ..Scaling::default()
        };
        let slopes = ArgumentSlopes::new(slopes);
        let mut sizes = projections.last().map_or_else(BranchSizes::default, |p| p.branch.end());
        if sampled.domain.moving.as_ref().is_some_and(|points| points.are_of_pieces()) {
            sizes.point += NAME;
        }
        let has_multiplier = form.coupled_fields().any(|f| is_multiplier(f.index()));
        Self {
            term,
            frozen,
            field,
            sizes,
            projections,
            law,
            slopes,
            sampled,
            has_multiplier,
            acts_when_open: background::acts_when_open(&form.law, field),
            scaling,
            window: Window::default(),
            shortest_face: OnceLock::new(),
            shared: None,
            graph: OnceLock::new(),
        }
    }

    /// Sets the step.
    pub(super) fn begin_step(&mut self, window: Window) {
        self.window = window;
        self.law = self.law.at_step(window);
        self.slopes.set_step(window);
    }

    /// The form of the term whose branches are frozen.
    #[must_use]
    pub fn form<'a>(&self, system: &'a System) -> &'a AssembledTerm {
        &system.frozen()[self.frozen].form
    }

    /// The numbers that the choice of branches depends on, beside the branches.
    pub(super) fn memory(&self, complementarity: &Complementarity) -> Vec<f64> {
        let s = &self.scaling;
        let flags = [s.is_stiff, s.is_over_constrained].map(|f| f64::from(u8::from(f)));
        let numbers = [s.stiffness, complementarity.growth, complementarity.regularisation.friction];
        s.ratios.iter().chain(&s.slopes).copied().chain(numbers).chain(flags).collect()
    }

    /// Takes back numbers given by [`Self::memory`].
    pub(super) fn recall(&mut self, memory: &[f64], complementarity: &mut Complementarity) {
        let s = &mut self.scaling;
        if let [fitted @ .., stiffness, growth, friction, stiff, over_constrained] = memory
            && fitted.len() == 2 * s.ratios.len()
        {
            let (ratios, slopes) = fitted.split_at(s.ratios.len());
            s.ratios.copy_from_slice(ratios);
            s.slopes.copy_from_slice(slopes);
            s.stiffness = *stiffness;
            (complementarity.growth, complementarity.regularisation.friction) = (*growth, *friction);
            (s.is_stiff, s.is_over_constrained) = (*stiff > 0.5, *over_constrained > 0.5);
        }
    }

    /// True if some projection is on a ball.
    #[must_use]
    pub fn has_friction(&self) -> bool {
        self.projections.iter().any(|p| p.kind == ProjectionKind::Ball)
    }

    /// True if a ball acts on faces: friction.
    pub(super) fn has_sliding(&self) -> bool {
        !self.on_cells() && self.projections.iter().any(|p| p.kind == ProjectionKind::Ball && p.acts)
    }

    /// True if the images of its points follow the bodies.
    #[must_use]
    pub fn moves(&self) -> bool {
        self.sampled.moves()
    }

    /// True if the term is integrated over cells: its projections are no contact.
    #[must_use]
    pub fn on_cells(&self) -> bool {
        self.sampled.domain.over == Over::Cells
    }

    /// True if the sides are so stiff against each other that making contact compliant for a while helps.
    pub(super) fn is_stiff(&self) -> bool {
        self.scaling.is_stiff
    }

    /// True if contact is so soft as written, and its linear part so stiff, that it binds the stresses of the bodies to
    /// its traction: Nitsche with theta = -1 far below E/h.
    pub(super) fn is_over_constrained(&self) -> bool {
        self.scaling.is_over_constrained
    }

    /// The stiffness of the bodies over the largest slope of an argument in the displacement.
    pub(super) fn stiffness_ratio(&self) -> f64 {
        self.scaling.stiffness_ratio()
    }

    /// True if the sides are so stiff against each other, without a multiplier, that one point that sticks holds its
    /// entity.
    pub(super) fn locks_entities(&self) -> bool {
        !self.has_multiplier && self.scaling.ratios.iter().any(|c| *c < STIFF)
    }

    /// The law of the projections, where it is read, and the projections.
    #[must_use]
    pub fn law(&self) -> (&Value, &Sampled, &[Projection]) {
        (&self.law, &self.sampled, &self.projections)
    }

    /// Its branches before any is chosen, open, at so many points.
    #[must_use]
    pub fn open_at(&self, n_points: usize) -> TermBranches {
        TermBranches { points: vec![0.0; n_points * self.sizes.point], regularisation: vec![0.0; self.sizes.term] }
    }

    /// Numbers that the law gives at a point.
    pub(super) fn n_outputs(&self) -> usize {
        self.law.law.kernel.kernel().outputs.len()
    }

    pub(super) fn n_points(&self) -> usize {
        self.sampled.domain.groups.iter().map(|g| g.entities.len() * g.n_points()).sum()
    }

    /// Whether this rank counts a point.
    #[inline]
    pub(super) fn counts(&self, point: usize) -> bool {
        self.shared.as_ref().is_none_or(|shared| shared.counts(point))
    }

    /// What all ranks call a point.
    pub(super) fn name(&self, point: usize) -> PointName {
        self.shared.as_ref().map_or([0, point as u64], |shared| shared.name(point))
    }

    /// Mean measure of an entity.
    pub(super) fn entity_area(&self, mesh: &Mesh, values: FieldValues<'_>) -> f64 {
        let (mut total, mut point) = (0.0, 0);
        self.law.for_each_point(mesh, &self.sampled, values, |_, _, _, weight, _| {
            total += if self.counts(point) { weight } else { 0.0 };
            point += 1;
        });
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let entities = self.sampled.domain.n_of_all(mesh).max(1) as f64;
        mesh.team().total(total) / entities
    }
}
