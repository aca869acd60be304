//! A term whose images follow the bodies: for each state a term of its own with the images found there.
//!
//! Law, code, points and their order stay; images, tables and places are those of the state. Promises: the same images for
//! the residual and the tangent of a state, whatever was assembled before. A matrix pattern may hold every image, for which
//! each face is coupled with all faces that images may lie on, or those of a state and the faces around them: then the
//! tangent says at which states it does not.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, Mutex, OnceLock, PoisonError},
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
    /// The last one whose tangent was made: plans and most places are those of the next one.
    placed: Mutex<Option<Arc<AssembledTerm>>>,
}

/// Places of a term in a pattern.
pub(super) struct PlacesIn {
    /// By group.
    pub(super) scatters: Vec<Scatter>,
    /// The pattern has all that the term couples.
    pub(super) is_complete: bool,
}

/// A copy finds its own images.
impl Clone for Moving {
    fn clone(&self) -> Self {
        Self::new(&self.starts)
    }
}

impl Moving {
    pub(super) fn new(starts: &[Option<usize>]) -> Self {
        Self { starts: starts.to_vec(), last: Mutex::default(), placed: Mutex::default() }
    }

    pub(super) fn forget(&mut self) {
        self.last = Mutex::default();
    }

    /// Forgets what belongs to a pattern.
    pub(super) fn forget_places(&mut self) {
        self.placed = Mutex::default();
    }

    fn keep(&self, term: &Arc<AssembledTerm>) {
        *self.last.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(term));
    }

    fn placed(&self) -> Option<Arc<AssembledTerm>> {
        self.placed.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn keep_placed(&self, term: &Arc<AssembledTerm>) {
        self.keep(term);
        *self.placed.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(term));
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
            assembled: integrator.clone(),
            integrator,
            scatters: Arc::default(),
            kept: Default::default(),
            moving: None,
            ..self.clone()
        });
        moving.keep(&made);
        Some(made)
    }

    /// The same with what its tangent is made by: the plans of the state before where the functions are the same.
    pub(super) fn moved_with_plans(&self, mesh: &Mesh, values: FieldValues<'_>) -> Option<Arc<Self>> {
        let moved = self.moved(mesh, values)?;
        if moved.plans.len() == moved.dofs.len() {
            return Some(moved);
        }
        let moving = self.moving.as_ref()?;
        let (binding, before) = (&moved.integrator.binding, moving.placed());
        let points_change = moved.integrator.domain.moving.as_ref().is_some_and(|points| points.are_of_pieces());
        let known = |g: usize| {
            let (before, own) = (before.as_ref()?, &binding.groups[g]);
            let other = before.integrator.binding.groups.get(g)?;
            // functions that never acted together may do so at other points
            let is_whole = !points_change || !before.plans[g].has_apart;
            (is_whole && own.functions() == other.functions()).then(|| Arc::clone(&before.plans[g]))
        };
        let new = |g: usize| Arc::new(TangentPlan::new(binding, g, &self.entries));
        let plans = (0..binding.groups.len()).map(|g| known(g).unwrap_or_else(|| new(g))).collect();
        let planned = Arc::new(Self { plans: Arc::new(plans), ..(*moved).clone() });
        moving.keep(&planned);
        Some(planned)
    }

    /// The same with its places in the matrix.
    pub(super) fn moved_in_matrix(&self, mesh: &Mesh, values: FieldValues<'_>) -> Option<Arc<Self>> {
        let moved = self.moved_with_plans(mesh, values)?;
        if moved.located.get().is_none() || moved.scatters.get().is_some() {
            return Some(moved);
        }
        let moving = self.moving.as_ref()?;
        let mut placed = (*moved).clone();
        let _ = placed.place(moving.placed().as_deref());
        let placed = Arc::new(placed);
        moving.keep_placed(&placed);
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
        let is_on = |term: &Arc<Self>| term.located.get().is_some_and(|l| Arc::ptr_eq(&l.pattern, on.0));
        let placed = if is_on(&moved) && moved.scatters.get().is_some() {
            moved
        } else {
            let mut placed = (*moved).clone();
            placed.forget_places();
            let before = moving.placed();
            let same = before.as_ref().and_then(|b| b.located.get()).filter(|l| Arc::ptr_eq(&l.pattern, on.0));
            let new = || Arc::new(Located { pattern: Arc::clone(on.0), rows: on.1.to_vec(), share: None });
            placed.located = Arc::new(OnceLock::from(same.cloned().unwrap_or_else(new)));
            if !placed.place(before.as_deref()) {
                return Ok(false);
            }
            let placed = Arc::new(placed);
            moving.keep_placed(&placed);
            placed
        };
        placed.tangent_into(mesh, values, matrix, false)?;
        Ok(true)
    }

    /// Finds the places of all groups in the located pattern, most of them where `before` had them. False if it lacks an
    /// image; what stands in for one that is not found needs no place.
    #[must_use]
    fn place(&mut self, before: Option<&Self>) -> bool {
        let Some(located) = self.located.get() else { return true };
        let PlacesIn { scatters, is_complete } = self.places_in(located, before);
        self.scatters = Arc::new(OnceLock::from(scatters));
        is_complete
    }

    /// The same, without keeping them.
    pub(super) fn places_in(&self, located: &Arc<Located>, before: Option<&Self>) -> PlacesIn {
        let mut is_complete = true;
        let owns = |dof: u32| located.share.as_ref().is_none_or(|share| share.owns(dof as usize));
        let in_it = before.filter(|b| b.located.get().is_some_and(|l| Arc::ptr_eq(l, located)));
        let mut place = |g: usize| {
            let (binding, plan) = (&self.assembled.binding.groups[g], &self.plans[g]);
            let group = &self.assembled.domain.groups[g];
            let like = before.filter(|b| b.plans.get(g).is_some_and(|p| Arc::ptr_eq(p, plan)));
            let like = like.and_then(|b| Some((b, b.scatters.get()?.get(g)?)));
            let new = || Scatter::new(binding, &plan.sources, plan.n_local);
            let mut scatter = like.map_or_else(new, |(_, scatter)| scatter.without_places());
            let known = like.filter(|_| in_it.is_some()).map(|(b, scatter)| (scatter, b.dofs[g].as_slice()));
            let (pattern, rows) = (&*located.pattern, located.rows.as_slice());
            scatter.locate(binding.n_dofs(), &self.dofs[g], (pattern, rows), owns, known);
            is_complete &= scatter.lacking().iter().all(|k| group.has_lost_its_image(*k));
            scatter
        };
        let scatters = (0..self.dofs.len()).map(&mut place).collect();
        PlacesIn { scatters, is_complete }
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
            for entity in (0..group.entities.len()).filter(|k| !group.has_lost_its_image(*k)) {
                let facet = group.there.as_ref().and_then(|side| side.facets.get(entity));
                let Some(image) = facet.and_then(|facet| number.get(facet)) else { continue };
                let own = moved.own_dofs(g, entity);
                for k in around[*image].iter().filter(|k| known.insert((group.entities[entity], **k))) {
                    let both = [own.as_slice(), &behind[*k]].concat();
                    f(&both, &both);
                }
            }
        }
    }

    /// The dofs on the side of the points that an entity has.
    fn own_dofs(&self, group: usize, entity: usize) -> Vec<u32> {
        let binding = &self.integrator.binding.groups[group];
        let bases = binding.bases.iter().filter(|b| b.side == Side::Here);
        let locals = bases.flat_map(|b| b.offset..b.offset + b.n_dofs());
        let dofs = &self.dofs[group][entity * binding.n_dofs()..];
        locals.map(|k| dofs[k]).filter(|dof| *dof != NONE).collect()
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
            for (k, entity) in group.entities.iter().enumerate() {
                let own = self.own_dofs(g, k);
                if last.as_ref().is_some_and(|(before, known)| before == entity && *known == own) {
                    continue;
                }
                let columns = [own.as_slice(), &all].concat();
                f(&own, &columns);
                f(&all, &own);
                last = Some((*entity, own));
            }
        }
    }
}
