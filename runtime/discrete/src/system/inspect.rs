//! Looks at a state: forces by term, fields of one unit, numbers that are not finite.

use std::collections::BTreeMap;

use super::{FIXED, Residual, System, Tangent};
use crate::assemble::{AssembledTerm, TermError};
use crate::finite::{BadState, largest as largest_of};
use crate::share::NumbersOfWhole;

/// A displacement below this part of what the forces in its equation would do one by one is zero.
const ZERO: f64 = 1e-12;
/// An entry of a row below this part of the largest one in the same field is what rounding leaves of summands that cancel.
const CANCELLED: f64 = 1e-12;

impl System {
    /// The first of the fields whose values have the unit and size of those of `field`: displacements of bodies that
    /// meet on an interface.
    #[must_use]
    pub fn alike(&self, field: usize) -> usize {
        self.meets[field]
    }

    /// By body of unknown fields: the largest entry of `v` over the largest of `u` among the bodies of its unit and size.
    /// Bodies that are all zero are left out.
    #[must_use]
    pub fn relative_sizes(&self, u: &[f64], v: &[f64]) -> Vec<(usize, f64)> {
        let [of_u, of_v] = [u, v].map(|w| self.largest_of_alike(w));
        self.unknown_bodies().filter(|body| of_u[*body] > 0.0).map(|body| (body, of_v[body] / of_u[body])).collect()
    }

    /// Refuses numbers by dof that are not finite, of the state `u`.
    ///
    /// # Errors
    /// [`TermError::State`] with the first of them; `what` says what they are.
    pub fn check_finite(&self, what: &'static str, numbers: &[f64], u: &[f64]) -> Result<(), TermError> {
        let (team, bad) = (self.team(), numbers.iter().position(|x| !x.is_finite()));
        let Some(rank) = team.first(bad.is_some()) else { return Ok(()) };
        #[expect(clippy::cast_precision_loss, reason = "a number of a field")]
        let told = |dof: usize| {
            let (field, node, _) = self.numbering.describe(&self.fields, dof);
            let [x, y, z] = self.fields[field].node_position(node);
            vec![field as f64, numbers[dof], x, y, z]
        };
        let own = bad.filter(|_| rank == team.rank()).map_or_else(Vec::new, told);
        let found = team.numbers_of(rank, &own);
        let [field, value, x, y, z] = found.as_slice() else { unreachable!("five numbers of one rank") };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number of a field")]
        let field = self.fields[*field as usize].name.clone();
        let largest = team.largest(largest_of(u.iter().copied()));
        Err(TermError::State(Box::new(BadState { what, field, value: *value, position: [*x, *y, *z], largest })))
    }

    /// The unknown field that a dof belongs to.
    #[must_use]
    pub fn field_of(&self, dof: usize) -> usize {
        self.numbering.describe(&self.fields, dof).0
    }

    /// By dof, in the rows of this rank: the residual of what does not depend on the unknowns at this step; loads with the
    /// other sign.
    #[must_use]
    pub fn constant_residual(&self) -> &[f64] {
        &self.constant
    }

    /// Adds the rows of this rank of the residual of one term at `u` to `out`, by dof.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub fn term_residual(&self, term: usize, u: &[f64], out: &mut [f64]) -> Result<(), TermError> {
        self.residual_of(&self.terms[term], u, out)
    }

    /// Whether the values of a body are what rounding leaves of zero: other forces cancel in its equations (the load of an
    /// undrained body and the pressure in its pores), and no displacement is left. They are below `ZERO` of what cancels,
    /// over the stiffness of each equation; of single numbers (a slip beside displacements that cancel in one term, where the
    /// tangent knows nothing of them) that is what is summed. Or they are what rounding leaves of positions.
    #[must_use]
    pub fn is_zero_but_for_rounding(&self, u: &[f64], here: &Residual, tangent: &Tangent, body: usize) -> bool {
        if self.are_rounding_of_positions(u, self.field_of_body(body), self.dofs_of_body(body)) {
            return true;
        }
        let mut sizes = self.sizes(u, here, tangent);
        if self.has_single_equations(self.field_of_body(body)) {
            sizes.iter_mut().zip(self.summands(u, here)).for_each(|(size, summed)| *size = size.max(summed));
        }
        let operator = tangent.operator().or_else(|| self.operator());
        let (mut found, mut natural) = (0.0f64, 0.0f64);
        for d in self.dofs_of_body(body) {
            found = found.max(u[d].abs());
            let free = self.numbering.free[d];
            if free != FIXED {
                let free = free as usize;
                let stiffness = match &operator {
                    Some(operator) => operator.diagonal()[free],
                    None => self.bulk.get(free, free) + tangent.changing.get(free, free),
                };
                let own =
                    if stiffness == 0.0 { self.of_others(&sizes, tangent, free) } else { sizes[d] / stiffness.abs() };
                natural = natural.max(own);
            }
        }
        let mut all = [found, natural];
        self.team().max(&mut all);
        all[0] <= ZERO * all[1]
    }

    /// What an unknown without a stiffness of its own would be if it balanced what cancels in the equations it acts on: a
    /// number that holds a mean value, like a multiplier. Zero where there is no matrix.
    fn of_others(&self, sizes: &[f64], tangent: &Tangent, free: usize) -> f64 {
        let rows = [&*self.bulk, &tangent.changing].into_iter().filter(|matrix| matrix.n_rows() > free);
        let entries = rows.flat_map(|matrix| {
            let (columns, values) = matrix.row(free);
            columns.iter().zip(values)
        });
        let entries: Vec<(usize, f64)> =
            entries.map(|(column, value)| (self.numbering.free_dofs[*column as usize] as usize, value.abs())).collect();
        // entries whose summands cancel are rounding, and would have a value as large as that is small
        let mut largest: BTreeMap<usize, f64> = BTreeMap::new();
        for (dof, value) in &entries {
            let of_field = largest.entry(self.field_of(*dof)).or_default();
            *of_field = of_field.max(*value);
        }
        let counts = |(dof, value): &&(usize, f64)| *value > CANCELLED * largest[&self.field_of(*dof)];
        largest_of(entries.iter().filter(counts).map(|(dof, value)| sizes[*dof] / value))
    }

    /// The same of a term that need not be one of the system.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub fn residual_of(&self, term: &AssembledTerm, u: &[f64], out: &mut [f64]) -> Result<(), TermError> {
        self.add_own(term, self.values(u).view(), out).map(drop)
    }

    /// What all ranks call a dof.
    #[must_use]
    pub fn dof_number(&self, dof: usize) -> u64 {
        if self.mesh.holders().is_alone() {
            dof as u64
        } else {
            NumbersOfWhole::new(&self.fields, &self.numbering).of(dof) as u64
        }
    }
}
