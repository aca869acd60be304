//! The numbers of the unknowns: by dof, and by free dof where some are prescribed.

use crate::field::Field;
use crate::finite::largest;
use crate::frames::{Frame, Frames};

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
    /// Nodes whose equations are written in frames of their own.
    pub frames: Frames,
    /// Where this rank has a part of the mesh alone: by dof its free number among those of all ranks, or [`FIXED`].
    pub free_of_whole: Option<Vec<u32>>,
    /// Dofs that follow others.
    ties: Vec<Tie>,
}

/// Roundings in a sum of three products, and in what was turned before.
const ROUNDED: f64 = 16.0;

/// A dof, of the scene or of the frame of its node, that has the value of another one: its equation is added to that of
/// the leader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tie {
    /// The dof that is not solved for.
    pub follower: usize,
    /// A free dof.
    pub leader: usize,
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
        let mut numbering = Self { starts, n_dofs: n, free: vec![0; n], free_dofs: Vec::new(), ..Self::default() };
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

    /// Writes the equations of some nodes in frames; [`Self::fix`] then takes out their first axes.
    pub fn set_frames(&mut self, frames: Vec<Frame>) {
        self.frames = Frames::new(frames, self.n_dofs);
    }

    /// Lets dofs follow others: each follower is taken out of the system, and keeps the distance to its leader that it
    /// has in the start.
    pub fn tie(&mut self, ties: Vec<Tie>) {
        self.fix(ties.iter().map(|t| t.follower));
        self.ties = ties;
    }

    /// The dofs that follow others.
    #[must_use]
    pub fn ties(&self) -> &[Tie] {
        &self.ties
    }

    /// True if some dofs follow others.
    #[must_use]
    pub fn has_ties(&self) -> bool {
        !self.ties.is_empty()
    }

    /// By dof: the free number of the equation that its own is added to, or [`FIXED`].
    #[must_use]
    pub fn equations(&self) -> Vec<u32> {
        let mut all = self.free.clone();
        for tie in &self.ties {
            all[tie.follower] = self.free[tie.leader];
        }
        all
    }

    /// Writes a residual in the axes of the scene as it is solved: turned, the equations of followers added to those of
    /// their leaders.
    pub fn turn(&self, residual: &mut [f64]) {
        self.frames.turn(residual);
        for tie in &self.ties {
            residual[tie.leader] += std::mem::take(&mut residual[tie.follower]);
        }
    }

    /// The same with bounds of the sizes of residuals.
    pub fn turn_sizes(&self, sizes: &mut [f64]) {
        self.frames.turn_sizes(sizes);
        for tie in &self.ties {
            sizes[tie.leader] += sizes[tie.follower];
        }
    }

    /// The largest value of `u` that is prescribed: along the axes of frames, and of no follower, whose value is that of another dof.
    #[must_use]
    pub fn largest_prescribed(&self, u: &[f64]) -> f64 {
        // most scenes have no followers, and this is asked in every step
        let mut follows = vec![false; if self.ties.is_empty() { 0 } else { self.free.len() }];
        self.ties.iter().for_each(|tie| follows[tie.follower] = true);
        let turned = self.frames.list().iter().flat_map(|frame| &u[frame.first..][..frame.axes.len()]);
        // a component along an axis is a sum of products, and what was added in a step may be larger than what is left of it
        let rounding = ROUNDED * f64::EPSILON * largest(turned.copied());
        let value = |dof: usize| {
            let along = self.frames.along(dof, u);
            if self.frames.of(dof).is_some() && along.abs() <= rounding { 0.0 } else { along }
        };
        let is_given = |dof: &usize| self.free[*dof] == FIXED && !follows.get(*dof).copied().unwrap_or(false);
        largest((0..self.free.len()).filter(is_given).map(value))
    }

    /// `u = start + step * correction`, the correction by free number.
    pub fn advance(&self, start: &[f64], correction: &[f64], step: f64, u: &mut [f64]) {
        u.copy_from_slice(start);
        for (dof, x) in self.free_dofs.iter().zip(correction) {
            self.frames.add(*dof as usize, step * x, u);
        }
        for tie in &self.ties {
            self.frames.add(tie.follower, step * correction[self.free[tie.leader] as usize], u);
        }
    }

    /// Gives followers the values of their leaders.
    pub fn follow(&self, u: &mut [f64]) {
        for tie in &self.ties {
            let missing = self.frames.along(tie.leader, u) - self.frames.along(tie.follower, u);
            self.frames.add(tie.follower, missing, u);
        }
    }

    /// Moves what is prescribed of `u` to `start + part * (u - start)`; the rest of `u` stays.
    pub fn part_of_prescribed(&self, start: &[f64], part: f64, u: &mut [f64]) {
        let mut missing: Vec<f64> = u.iter().zip(start).map(|(x, s)| (part - 1.0) * (x - s)).collect();
        self.frames.turn(&mut missing);
        for (x, _) in missing.iter_mut().zip(&self.free).filter(|(_, free)| **free != FIXED) {
            *x = 0.0;
        }
        self.frames.turn_back(&mut missing);
        u.iter_mut().zip(missing).for_each(|(x, m)| *x += m);
    }

    /// Multiplies the free part of `u`; what is prescribed stays.
    pub fn part_of_free(&self, part: f64, u: &mut [f64]) {
        let mut free = u.to_vec();
        self.frames.turn(&mut free);
        for (x, place) in free.iter_mut().zip(&self.free) {
            *x = if *place == FIXED { 0.0 } else { (part - 1.0) * *x };
        }
        for tie in &self.ties {
            free[tie.follower] = (part - 1.0) * self.frames.along(tie.follower, u);
        }
        self.frames.turn_back(&mut free);
        u.iter_mut().zip(free).for_each(|(x, change)| *x += change);
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
