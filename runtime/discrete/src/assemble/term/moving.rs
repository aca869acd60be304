//! A term whose images follow the bodies: for each state a term of its own with the images found there.
//!
//! Law, code, points and their order stay; images, tables and places are those of the state. Promises: the same images for
//! the residual and the tangent of a state, whatever was assembled before. A matrix pattern may hold every image, for which
//! each face is coupled with all faces that images may lie on, or those of a state and the faces around them: then the
//! tangent says at which states it does not.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, Mutex, PoisonError},
};

use super::{AssembledTerm, TermError, local_dofs, work::Located};
use crate::assemble::{contract::TangentPlan, evaluate::FieldValues, scatter::Scatter};
use wfl_compiler::types::Side;
use wfl_mesh::mesh::Mesh;
use wfl_sparse::{csr::Pattern, index::NONE};

/// What a term whose images move keeps.
pub(super) struct Moving {
    /// First dofs of the fields.
    starts: Vec<Option<usize>>,
    /// The term at the last state; its places in the matrix once a tangent was asked for.
    last: Mutex<Option<Arc<AssembledTerm>>>,
}

/// A copy finds its own images.
impl Clone for Moving {
    fn clone(&self) -> Self {
        Self::new(&self.starts)
    }
}

impl Moving {
    pub(super) fn new(starts: &[Option<usize>]) -> Self {
        Self { starts: starts.to_vec(), last: Mutex::default() }
    }

    pub(super) fn forget(&mut self) {
        self.last = Mutex::default();
    }
}

impl AssembledTerm {
    /// The term with the images of a state, to be evaluated without derivatives; `None` where images stay.
    pub(super) fn moved(&self, mesh: &Mesh, values: FieldValues<'_>) -> Option<Arc<Self>> {
        let moving = self.moving.as_ref()?;
        let integrator = self.integrator.at(mesh, values.current);
        let last = || moving.last.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = last().as_ref().filter(|k| Arc::ptr_eq(&k.integrator.binding, &integrator.binding)) {
            return Some(Arc::clone(known));
        }
        let groups = integrator.binding.groups.iter().zip(&integrator.domain.groups);
        let dofs = groups.map(|(binding, group)| local_dofs(binding, group.entities.len(), &moving.starts)).collect();
        let made = Arc::new(Self {
            dofs: Arc::new(dofs),
            plans: Arc::default(),
            integrator,
            scatters: Arc::default(),
            kept: Default::default(),
            moving: None,
            ..self.clone()
        });
        *last() = Some(Arc::clone(&made));
        Some(made)
    }

    /// The same with what its tangent is made by: one plan for all points whose functions are the same.
    pub(super) fn moved_with_plans(&self, mesh: &Mesh, values: FieldValues<'_>) -> Option<Arc<Self>> {
        let moved = self.moved(mesh, values)?;
        if moved.plans.len() == moved.dofs.len() {
            return Some(moved);
        }
        let binding = &moved.integrator.binding;
        let mut known = BTreeMap::new();
        let plan = |g: usize| {
            let new = || Arc::new(TangentPlan::new(binding, g, &self.entries));
            Arc::clone(known.entry(binding.groups[g].functions()).or_insert_with(new))
        };
        let plans = (0..binding.groups.len()).map(plan).collect();
        let planned = Arc::new(Self { plans: Arc::new(plans), ..(*moved).clone() });
        if let Some(moving) = &self.moving {
            *moving.last.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(&planned));
        }
        Some(planned)
    }

    /// The same with its places in the matrix.
    pub(super) fn moved_in_matrix(&self, mesh: &Mesh, values: FieldValues<'_>) -> Option<Arc<Self>> {
        let moved = self.moved_with_plans(mesh, values)?;
        if moved.located.is_none() || !moved.scatters.is_empty() {
            return Some(moved);
        }
        let mut placed = (*moved).clone();
        let _ = placed.place();
        let placed = Arc::new(placed);
        if let Some(moving) = &self.moving {
            *moving.last.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(&placed));
        }
        Some(placed)
    }

    /// Adds the tangent to the values of a matrix with this pattern; `free` maps dofs to its rows. False, and nothing is
    /// added, if the pattern lacks an image.
    ///
    /// # Errors
    /// [`TermError::NonFinite`] with the place.
    pub fn add_tangent_of_images(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        on: (&Arc<Pattern>, &[u32]),
        matrix: &mut [f64],
    ) -> Result<bool, TermError> {
        let (Some(moving), Some(moved)) = (&self.moving, self.moved_with_plans(mesh, values)) else {
            return Ok(true);
        };
        if self.entries.list.is_empty() {
            return Ok(true);
        }
        let is_on = |term: &Arc<Self>| term.located.as_ref().is_some_and(|l| Arc::ptr_eq(&l.pattern, on.0));
        let placed = if is_on(&moved) && !moved.scatters.is_empty() {
            moved
        } else {
            let mut placed = (*moved).clone();
            placed.forget_places();
            placed.located = Some(Arc::new(Located { pattern: Arc::clone(on.0), rows: on.1.to_vec(), share: None }));
            if !placed.place() {
                return Ok(false);
            }
            let placed = Arc::new(placed);
            *moving.last.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(&placed));
            placed
        };
        placed.tangent_into(mesh, values, matrix, false)?;
        Ok(true)
    }

    /// Finds the places of all groups in the located pattern. False if it lacks an image; what stands in for one that is not
    /// found needs no place.
    #[must_use]
    pub(super) fn place(&mut self) -> bool {
        let Some(located) = self.located.clone() else { return true };
        let mut is_complete = true;
        let owns = |dof: u32| located.share.as_ref().is_none_or(|share| share.owns(dof as usize));
        let mut place = |g: usize| {
            let (binding, plan) = (&self.integrator.binding.groups[g], &self.plans[g]);
            let mut scatter = Scatter::new(binding, &plan.sources, plan.n_local);
            let has_all = scatter.locate(binding.n_dofs(), &self.dofs[g], &located.pattern, &located.rows, owns);
            is_complete &= has_all || self.integrator.domain.groups[g].has_lost_its_image();
            scatter
        };
        let scatters = (0..self.dofs.len()).map(&mut place).collect();
        self.scatters = Arc::new(scatters);
        is_complete
    }

    /// The sorted dofs behind each face that images may lie on.
    pub(super) fn dofs_behind_targets(&self) -> Vec<Vec<u32>> {
        let Some(moving) = &self.moving else { return Vec::new() };
        let components = |field: usize| {
            let bases = self.integrator.binding.groups.iter().flat_map(|g| &g.bases);
            bases.into_iter().find(|b| b.field.index() == field).map_or(1, |b| b.n_components)
        };
        let dofs = |behind: Vec<(usize, Vec<u32>)>| {
            let mut found: Vec<u32> = Vec::new();
            for (field, nodes) in behind {
                let (Some(start), n) = (moving.starts[field], components(field)) else { continue };
                let of = |node: u32| (0..n).map(move |c| start + node as usize * n + c);
                let own = nodes.into_iter().flat_map(of);
                found.extend(own.map(|dof| u32::try_from(dof).expect("fewer than 2^32 dofs")));
            }
            found.sort_unstable();
            found.dedup();
            found
        };
        self.integrator.behind_targets().into_iter().map(dofs).collect()
    }

    /// Calls `f` with dofs that the tangent may couple at a state, and at those whose images lie on faces that share a vertex
    /// with the faces of the present ones: rows, columns.
    pub fn for_each_near(&self, mesh: &Mesh, values: FieldValues<'_>, f: &mut impl FnMut(&[u32], &[u32])) {
        let Some(moved) = self.moved(mesh, values) else { return };
        let Some(points) = &moved.integrator.domain.moving else { return };
        let (behind, around) = (self.dofs_behind_targets(), points.around(mesh));
        let number: BTreeMap<_, usize> = points.targets().enumerate().map(|(k, facet)| (facet, k)).collect();
        let mut known: BTreeSet<(usize, usize)> = BTreeSet::new();
        for (g, group) in moved.integrator.domain.groups.iter().enumerate() {
            let facet = group.there.as_ref().and_then(|side| side.facets.first());
            let Some(image) = facet.filter(|_| !group.has_lost_its_image()).and_then(|facet| number.get(facet)) else {
                continue;
            };
            let own = moved.own_dofs(g);
            for k in around[*image].iter().filter(|k| known.insert((group.entities[0], **k))) {
                let both = [own.as_slice(), &behind[*k]].concat();
                f(&both, &both);
            }
        }
    }

    /// The dofs on the side of the points that a group has.
    fn own_dofs(&self, group: usize) -> Vec<u32> {
        let bases = self.integrator.binding.groups[group].bases.iter().filter(|b| b.side == Side::Here);
        let locals = bases.flat_map(|b| b.offset..b.offset + b.n_dofs());
        locals.map(|k| self.dofs[group][k]).filter(|dof| *dof != NONE).collect()
    }

    /// Calls `f` with dofs that the tangent may couple at some state: rows, columns.
    pub(super) fn for_each_possible(&self, f: &mut impl FnMut(&[u32], &[u32])) {
        let behind = self.dofs_behind_targets();
        let mut all: Vec<u32> = behind.concat();
        all.sort_unstable();
        all.dedup();
        behind.iter().for_each(|dofs| f(dofs, dofs));
        let mut last: Option<(usize, Vec<u32>)> = None;
        for (g, group) in self.integrator.domain.groups.iter().enumerate() {
            let own = self.own_dofs(g);
            if last.as_ref().is_some_and(|(entity, known)| *entity == group.entities[0] && *known == own) {
                continue;
            }
            let columns = [own.as_slice(), &all].concat();
            f(&own, &columns);
            f(&all, &own);
            last = Some((group.entities[0], own));
        }
    }
}
