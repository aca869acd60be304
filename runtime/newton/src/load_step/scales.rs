//! What the residuals of a load step are relative to, and what rounding leaves of them. Decides nothing.

use wfl_compiler::types::FieldKind;
use wfl_discrete::finite::largest as largest_of;
use wfl_discrete::system::{FIXED, Residual};

use super::{FLOOR_FACTOR, HIDDEN, LoadStep, Measured};
use crate::{
    Evaluated,
    began::Began,
    measures::{BodyMeasures, Equation, Forces},
};

/// Forces of bodies that are strained by no more than this, in units of roundoff, are taken for rounding until what they are
/// made of is known: sums over a hundred entries in three directions err by some hundred units, and a strain of 2e-13 is far
/// below any that is meant.
const UNSTRAINED: f64 = 1e3;

/// A residual that is this part of all forces is all of them: what is missing is rounding of sums.
const ALL: f64 = 0.999;

/// A law is straight within rounding where its residual changes by no less than this part of what its slope foretells: what other
/// unknowns that move with it take away is less.
const STRAIGHT: f64 = 0.1;

/// What relative residuals are relative to.
pub(super) struct Scales<'n> {
    /// By body.
    pub(super) scales: Vec<f64>,
    /// By body whether it has loads that are more than rounding.
    pub(super) loaded: Vec<bool>,
    /// Bodies have no force but rounding.
    pub(super) no_force: bool,
    /// What was left when the step began.
    pub(super) began: &'n Began,
    /// By body what acts on it beside what keeps it flying, where that is known.
    pub(super) acting: Vec<f64>,
}

impl Scales<'_> {
    /// What a body has been out of balance by in the step, where `here` is what a state leaves.
    fn began(&self, body: usize, here: f64) -> f64 {
        self.acting.get(body).map_or_else(|| self.began.forces(body, here), |acting| acting.max(here))
    }
}

impl LoadStep<'_> {
    /// Residuals by body beside their scales and what rounding leaves: of what cancels by dof, and of the summands of single
    /// equations.
    pub(super) fn body_measures(
        &self,
        u: &[f64],
        written: &Residual,
        sizes: [&[f64]; 2],
        of: &Scales<'_>,
    ) -> BodyMeasures {
        let (system, [sizes, summands]) = (self.system, sizes);
        let began = of.began.residual(&written.values);
        // behind the bodies their nodes without mass
        let mut all = BodyMeasures::new(system.n_bodies() + 1);
        let faces_alone = self.contact.is_empty() && !system.has_nonlinear_bodies();
        let mut unknowns = system.largest_by_body(u);
        system.team().max(&mut unknowns);
        let cancelled = system.largest_by_body(sizes);
        let largest = system.largest_of_free_by_body(&written.values);
        let kept = system.largest_by_body(&written.linear_sizes);
        for body in (0..system.n_bodies()).filter(|body| system.range(system.field_of_body(*body)).is_some()) {
            let rounding = FLOOR_FACTOR * roundoff(unknowns[body]);
            if system.has_single_equations(system.field_of_body(body)) {
                let is_free = |d: &usize| system.numbering.free[*d] != FIXED;
                let equation = |d: usize| Equation {
                    residual: written.values[d].abs(),
                    scale: summands[d],
                    began: began.get(d).map_or(f64::INFINITY, |began| began.abs()),
                    rounding: rounding * sizes[d],
                };
                let equations: Vec<Equation> = system.dofs_of_body(body).filter(is_free).map(equation).collect();
                all.add_equations(body, &equations, self.options.tolerance);
            } else {
                // loads are known exactly: a state so far away that they are rounding beside it balances none of them
                let kept = match (of.loaded[body], faces_alone) {
                    (true, _) => 0.0,
                    (false, true) => rounding * kept[body],
                    (false, false) => f64::INFINITY,
                };
                let (residual, alike) = (largest[body], system.body_alike(body));
                let began = of.began(alike, residual);
                let rounding = [rounding * cancelled[body], kept];
                let forces = Forces { residual, scale: of.scales[body], began, rounding };
                all.add_forces(alike, forces, self.options.tolerance);
            }
        }
        self.add_nodes_without_mass(&mut all, written, sizes, of);
        all.of_all(system.team());
        all
    }

    /// What a step begins with at its first state.
    pub(crate) fn began(&self, here: &Measured) -> Began {
        // the start of a step is far behind what flies, and walls may fly with it
        let counts = self.measures_what_happens() && !self.flies();
        let left = if counts { here.left.clone() } else { Vec::new() };
        Began::with(self.has_single_equations().then(|| here.written.values.clone()), left)
    }

    /// Whether forces are relative to what a step does, too. Steps that the run chooses by an error are no more exact than that is of the whole
    /// values, and may be so short that what they do is less than rounding of a tie between branches.
    pub(crate) fn measures_what_happens(&self) -> bool {
        !self.solves_once
    }

    /// Whether bodies have inertia whose forces at the start of a step are those of their motion; linear ones begin at the end of their flight.
    fn flies(&self) -> bool {
        self.measures_what_happens() && !self.system.is_linear() && self.system.has_flight()
    }

    pub(super) fn is_multiplier(&self, body: usize) -> bool {
        let system = self.system;
        body < system.n_bodies() && system.fields[system.field_of_body(body)].kind == FieldKind::Multiplier
    }

    /// The measures by what terms give; `scales` learn what acts beside flight, and which multipliers are nothing, where that decides.
    pub(super) fn first_measures(
        &self,
        u: &[f64],
        written: &Residual,
        sizes: [&[f64]; 2],
        scales: &mut Scales<'_>,
    ) -> BodyMeasures {
        let mut all = self.body_measures(u, written, sizes, scales);
        if all.relative() <= self.options.tolerance && self.find_acting(u, written, scales) {
            all = self.body_measures(u, written, sizes, scales);
        }
        if all.is_open_by(|body| self.is_multiplier(body), self.options.tolerance) && self.are_nothing(u, scales) {
            all = self.body_measures(u, written, sizes, scales);
        }
        all
    }

    /// What acts on bodies beside what keeps them flying, by body: where a state is otherwise within the tolerance, what is measured there.
    fn find_acting(&self, u: &[f64], written: &Residual, of: &mut Scales<'_>) -> bool {
        let beside = if self.flies() { self.system.beside_flight(u, &written.values) } else { None };
        of.acting = beside.map(|beside| self.out_of_balance(&beside)).unwrap_or_default();
        !of.acting.is_empty()
    }

    /// By body the largest of the forces that are out of balance in a residual by dof, and behind them those of nodes without mass: as
    /// [`BodyMeasures::left`].
    fn out_of_balance(&self, residual: &[f64]) -> Vec<f64> {
        let system = self.system;
        let largest = system.largest_of_free_by_body(residual);
        let mut left = vec![0.0f64; system.n_bodies() + 1];
        for (body, largest) in largest.into_iter().enumerate() {
            let alike = &mut left[system.body_alike(body)];
            *alike = alike.max(largest);
        }
        let without_mass = system.static_beside_inertia().iter().filter(|d| system.numbering.free[**d] != FIXED);
        left[system.n_bodies()] = largest_of(without_mass.map(|d| residual[*d].abs()));
        system.team().max(&mut left);
        left
    }

    /// Adds the equations of nodes without inertia of bodies that have some. Beside that all other forces are
    /// nothing in short steps: measured with the rest of their body they would hold for any state. Their own measure is what cancels in them.
    fn add_nodes_without_mass(&self, all: &mut BodyMeasures, written: &Residual, sizes: &[f64], of: &Scales<'_>) {
        let system = self.system;
        if system.static_beside_inertia().is_empty() {
            return;
        }
        let (mut residual, mut scale) = (0.0f64, 0.0f64);
        let is_free = |d: &usize| system.numbering.free[*d] != FIXED;
        for d in system.static_beside_inertia().iter().copied().filter(is_free) {
            (residual, scale) = (residual.max(written.values[d].abs()), scale.max(sizes[d]));
        }
        let rounding = [FLOOR_FACTOR * f64::EPSILON * scale, f64::INFINITY];
        let began = of.began(system.n_bodies(), residual);
        all.add_forces(system.n_bodies(), Forces { residual, scale, began, rounding }, self.options.tolerance);
    }

    /// Finds multipliers that are nothing but rounding beside the forces, and conditions that are as small as rounding of all
    /// unknowns allows: that is what their equations are relative to then, within the tolerance where rounding is all that is left.
    fn are_nothing(&self, u: &[f64], scales: &mut Scales<'_>) -> bool {
        let system = self.system;
        let mut values = system.largest_by_body(u);
        system.team().max(&mut values);
        let rounding = FLOOR_FACTOR * f64::EPSILON;
        let nothing = system.multipliers_beside(&scales.scales, self.tangent).into_iter();
        let nothing = nothing.zip(&values).map(|([value, size], is)| if *is <= rounding * value { size } else { 0.0 });
        let mut found = false;
        let sizes = nothing.zip(system.conditions_beside(u, self.tangent));
        for (scale, (nothing, condition)) in scales.scales.iter_mut().zip(sizes) {
            let least = rounding / self.options.tolerance * nothing.max(condition);
            found |= least > *scale;
            *scale = scale.max(least);
        }
        found
    }

    /// Whether what is left may be what cancels inside the laws of bodies: of a gradient beside 1, as in `F - Inv(F)'`, the
    /// rounding is that of 1, and forces of a small strain are known no better than the stiffness over the extent. To find how
    /// much that is takes another evaluation of all laws.
    pub(super) fn may_cancel(&self, written: &Residual) -> bool {
        let system = self.system;
        if !system.has_nonlinear_bodies() {
            return false;
        }
        let is_free = |d: usize| system.numbering.free[d] != FIXED;
        let free: Vec<f64> =
            written.values.iter().enumerate().map(|(d, x)| if is_free(d) { *x } else { 0.0 }).collect();
        let (left, stiffness) = (system.largest_of_alike(&free), system.stiffness(self.tangent));
        let is_force = |body: &usize| {
            let field = system.field_of_body(*body);
            system.range(field).is_some() && !system.has_single_equations(field)
        };
        let bound = |k: usize| FLOOR_FACTOR * f64::EPSILON * stiffness[k] * system.extent();
        (0..system.n_bodies()).filter(is_force).all(|k| left[k] <= bound(k))
    }

    /// The part that the residual is of the forces in it, those that cancel inside a term included: what rounding hides where it is
    /// larger than the residual. The largest over the bodies, and over the single equations that turn within rounding.
    pub(crate) fn hidden(&self, u: &[f64], here: &Measured) -> Evaluated<f64> {
        let (system, written) = (self.system, &here.written);
        let is_free = |d: usize| system.numbering.free[d] != FIXED;
        let free: Vec<f64> =
            written.values.iter().enumerate().map(|(d, x)| if is_free(d) { *x } else { 0.0 }).collect();
        let (left, forces) = (system.largest_of_alike(&free), system.largest_of_alike(&system.summed(u)?));
        let is_force = |body: &usize| {
            let field = system.field_of_body(*body);
            system.range(field).is_some() && !system.has_single_equations(field)
        };
        // a body of one law at rest has nothing but rounding in it, of which no part hides another
        let cancels = system.largest_of_alike(&system.sizes(u, written, self.tangent));
        let loaded = system.loaded();
        let is_at_rest = |body: usize| {
            let of_law = system.is_of_one_term(system.field_of_body(body)) && self.contact.is_empty();
            of_law && !loaded[body] && forces[body] <= FLOOR_FACTOR * f64::EPSILON * cancels[body]
        };
        let open = |body: &usize| left[*body] > 0.0 && !is_at_rest(*body);
        let parts = (0..system.n_bodies()).filter(is_force).filter(open);
        let of_forces = parts.map(|body| left[body] / forces[body].max(left[body])).fold(0.0, f64::max);
        Ok(system.team().largest(self.hidden_by_turns(u, here)?).max(of_forces))
    }

    /// The part that the residual of a single equation is of its summands, the largest over those whose law turns within rounding of
    /// its own unknown: the slope that rounding is measured by is not that of the law one number further on. A rate in a short
    /// step is rounding as well, but of a law that is straight there, and rounding without a meaning for the state.
    fn hidden_by_turns(&self, u: &[f64], here: &Measured) -> Evaluated<f64> {
        let (system, written) = (self.system, &here.written);
        let is_single = |body: &usize| system.has_single_equations(system.field_of_body(*body));
        let solved = system.unknown_bodies().filter(is_single).flat_map(|body| system.dofs_of_body(body));
        let free = |d: usize| system.numbering.free[d];
        let open = solved.filter(|d| free(*d) != FIXED && written.values[*d].abs() > HIDDEN * here.summands[*d]);
        let slope = |d: usize| {
            let row = free(d) as usize;
            system.bulk().get(row, row) + self.tangent.changing.get(row, row)
        };
        // by dof, the change of the residual that the slope foretells
        let (mut moved, mut foretold) = (u.to_vec(), Vec::new());
        for d in open {
            let step = (u[d].abs().next_up() - u[d].abs()).copysign(-written.values[d] * slope(d));
            moved[d] = u[d] + step;
            foretold.push((d, slope(d) * (moved[d] - u[d])));
        }
        if system.team().all(foretold.is_empty()) {
            return Ok(0.0);
        }
        let there = system.residual(&moved, &self.form())?;
        let turns = |(d, by): &&(usize, f64)| (there.values[*d] - written.values[*d]).abs() < STRAIGHT * by.abs();
        let parts = foretold.iter().filter(turns).map(|(d, _)| {
            let left = written.values[*d].abs();
            left / here.summands[*d].max(left)
        });
        Ok(parts.fold(0.0, f64::max))
    }

    /// Where one term is all that the equations of a body consist of, and nothing holds it, what the term gives at nodes is the
    /// residual itself: that is relative to what cancels inside the term then. Whether that is so of some.
    fn add_what_cancels(&self, scales: &mut [f64], written: &Residual, cancels: &[f64]) -> bool {
        let system = self.system;
        let alone = |k: &usize| {
            let field = system.field_of_body(*k);
            system.is_of_one_term(field) && !system.has_single_equations(field)
        };
        let of_one: Vec<usize> = system.unknown_bodies().filter(alone).collect();
        if of_one.is_empty() {
            return false;
        }
        let mut found = false;
        let mut left = system.largest_of_free_by_body(&written.values);
        system.team().max(&mut left);
        for k in of_one {
            if left[k] >= ALL * scales[k] {
                scales[k] = largest_of([scales[k], cancels[k]]);
                found = true;
            }
        }
        found
    }

    /// By body what relative residuals are relative to ([`System::scales`]; of `sizes` and those of positions), and whether
    /// some bodies have no force but rounding: then that is relative to what cancels. Where the largest force is so small that rounding hides the
    /// tolerance, it is what is left of larger ones, and these are asked for one by one.
    pub(super) fn scales<'n>(
        &self,
        u: &[f64],
        written: &Residual,
        sizes: [&[f64]; 2],
        began: &'n Began,
    ) -> Evaluated<Scales<'n>> {
        let system = self.system;
        let [sizes, positions] = sizes;
        let mut scales = system.scales(written, sizes);
        let has_forces = |body: &usize| !system.has_single_equations(system.field_of_body(*body));
        let of_forces: Vec<usize> = system.unknown_bodies().filter(has_forces).collect();
        let (cancels, moved) = (system.largest_of_alike(sizes), system.largest_of_alike(u));
        let of_one_term = self.add_what_cancels(&mut scales, written, &cancels);
        let placed = if positions.is_empty() { vec![0.0; scales.len()] } else { system.largest_of_alike(positions) };
        let extent = system.extent();
        // a stiffness over the extent: of a gradient beside 1 the rounding is that of 1
        let strained = |k: usize| {
            let bends = moved[k] > 0.0 && !system.is_linear();
            if bends { UNSTRAINED * f64::EPSILON * cancels[k] / moved[k] * extent } else { 0.0 }
        };
        let rounding = |k: usize| FLOOR_FACTOR * f64::EPSILON * (cancels[k] + placed[k]);
        let is_hidden = |k: &usize| rounding(*k) > self.options.tolerance * scales[*k] || strained(*k) > scales[*k];
        let mut loaded = system.loaded();
        if !of_forces.iter().any(is_hidden) {
            return Ok(Scales { scales, loaded, no_force: of_one_term, began, acting: Vec::new() });
        }
        let parts = system.largest_of_alike(&system.contributions(u)?);
        // what may be rounding is no more than this: forces between two fields of one unit cancel however small what they carry is
        let hidden: Vec<f64> =
            (0..scales.len()).map(|k| rounding(k).max(strained(k)) / self.options.tolerance).collect();
        let cancels = system.largest_of_alike(&system.cancelled(u, written));
        let before = system.past().map(|past| system.largest_of_alike(&past.unknowns));
        let mut no_force = of_one_term;
        for k in of_forces {
            scales[k] = largest_of([scales[k], parts[k].min(hidden[k])]);
            let rounding = FLOOR_FACTOR * f64::EPSILON * (cancels[k] + placed[k]);
            // loads are known exactly, however small they are, but for those that were rounding already beside the state at
            // the end of the last step: what stores much heat feels no load of 1e-300
            let part = before.as_ref().map_or(0.0, |b| if moved[k] > 0.0 { (b[k] / moved[k]).min(1.0) } else { 0.0 });
            loaded[k] &= scales[k] > rounding * part;
            // what holds a single node of a field takes the rounding of all others
            #[expect(clippy::cast_precision_loss, reason = "fewer than 2^32 dofs")]
            let of_all = (system.dofs_of_body(k).count() as f64).sqrt() * rounding;
            if !loaded[k] && scales[k] <= of_all {
                (scales[k], no_force) = (cancels[k] + placed[k], true);
            }
        }
        Ok(Scales { scales, loaded, no_force, began, acting: Vec::new() })
    }
}

/// Unit of rounding of some unknowns, relative to the largest: numbers below 1e-308 have fewer digits.
pub(super) fn roundoff(largest: f64) -> f64 {
    if largest > 0.0 { f64::EPSILON.max(f64::from_bits(1) / largest) } else { f64::EPSILON }
}
