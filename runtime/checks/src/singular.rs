//! Why a tangent is singular, in words: the field that is not determined, the term that should determine it, the
//! remedy.
//!
//! An equation or an unknown that is zero is a matter of terms; motions of whole bodies are held by supports or by contact,
//! and contact that holds nothing is open, slides, is zero or pulls; then the null space tells. A null vector that has
//! energy under a finer rule is one of quadrature; one in a field that no term couples with itself is one of a saddle
//! point; one that strains its body at the points is held, by less than rounding of the matrix leaves. No null vector at
//! all is rounding, too. Promises: one cause, the first in that order.

mod contact;
mod finer;
pub(crate) use finer::{with_points, with_rule, with_rule_and_states};

use nalgebra::DMatrix;
use wfl_compiler::{Class, types::FieldKind};

use super::{Examined, LooseMotions};
use wfl_discrete::field::FieldSpace;
use wfl_newton::Singular;
use wfl_sparse::csr::Csr;
use wfl_sparse::solve::{LargestEntries, NullSpace, NullVector, SolveError, largest_entries, null_space};

/// Rows of a scaled matrix apart by this factor leave nothing of the smaller ones to double precision: sixteen digits
/// less three that a solution needs.
const FAR_APART: f64 = 1e13;
/// A vector lies in a field if all but this part of its square does: a thousandth of its size in others is what a null vector
/// has that was found to three digits.
const OUTSIDE: f64 = 1e-6;

/// What leaves one field undetermined.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Mode {
    Constant,
    /// No term couples the field with itself.
    Uncoupled,
    Other,
}

impl Examined<'_> {
    /// Why the last tangent is singular; `u` is the state it belongs to, `met` what the solver says. `None` where nothing can
    /// be said.
    pub(crate) fn why_singular(&self, u: &[f64], met: &SolveError) -> Option<Singular> {
        if !self.system.mesh.holders().is_alone() {
            // rigid motions are met in the rows of each rank, a null space is one of all rows
            let motions = self.loose_motions();
            return (!motions.is_empty()).then(|| self.loose_bodies(&motions, u));
        }
        let tangent = self.system.whole(self.system.whole_matrix(self.tangent).ok()?).ok()?;
        if let Some(found) = self.empty_equations(&largest_entries(&tangent)) {
            return Some(found);
        }
        let motions = self.loose_motions();
        if !motions.is_empty() {
            return Some(self.loose_bodies(&motions, u));
        }
        if let Some(found) = self.far_stiffer_contact(u) {
            return Some(found);
        }
        let positions: Vec<[f64; 3]> = self
            .system
            .numbering
            .free_dofs
            .iter()
            .map(|d| {
                let (field, node, _) = self.system.numbering.describe(&self.system.fields, *d as usize);
                self.system.fields[field].node_position(node)
            })
            .collect();
        let space = null_space(&tangent, Some(&positions), rayon::current_num_threads()).unwrap_or_default();
        let space = match met {
            // what is soft beyond rounding is lost in the square of the matrix
            SolveError::Singular { mode, .. } if space.vectors.is_empty() => only(mode),
            _ => space,
        };
        if space.vectors.is_empty() {
            return self.far_apart(&largest_entries(&tangent).rows);
        }
        let pure = (0..self.system.fields.len()).find_map(|f| Some((f, self.pure(&space, f)?)));
        match pure {
            Some((field, vector)) => Some(self.one_field(field, &vector, &tangent, u)),
            None => Some(self.several_fields(&space)),
        }
    }

    /// The free numbers of a field.
    fn free_of(&self, field: usize) -> Vec<usize> {
        let Some(range) = self.system.range(field) else { return Vec::new() };
        let all = self.system.numbering.free_dofs.iter().enumerate();
        all.filter(|(_, d)| range.contains(&(**d as usize))).map(|(free, _)| free).collect()
    }

    /// The names of the terms that test a field: those on cells where there are any.
    fn testing(&self, field: usize) -> Vec<String> {
        let tests = |t: &&wfl_discrete::assemble::AssembledTerm| {
            t.law.class > Class::Constant && t.law.tests.iter().any(|s| s.field.index() == field)
        };
        let on_cells = self.system.terms.iter().filter(tests).any(|t| t.on_cells());
        let own = self.system.terms.iter().filter(tests).filter(|t| t.on_cells() == on_cells);
        own.map(|t| format!("`{}`", t.law.name)).collect()
    }

    /// What to do where equations of a field are empty: all may be of terms that read through a mapping.
    fn help_for_empty(&self, field: usize) -> String {
        let tests = |t: &&wfl_discrete::assemble::AssembledTerm| {
            t.law.class > Class::Constant && t.law.tests.iter().any(|s| s.field.index() == field)
        };
        if self.system.terms.iter().filter(tests).all(|t| t.law.listing.graph.mapping.is_some()) {
            let name = &self.system.fields[field].name;
            return format!(
                "the law is not there where its mapping has no image: what does not read through the mapping is a term \
                 of its own, `term rest on ... : -1/gamma*{name}.Test_{name}`"
            );
        }
        "a coefficient is zero there, or a law is inactive: give it a value, or start from a state in which it acts"
            .to_owned()
    }

    /// Fields with equations, or unknowns, that are zero.
    fn empty_equations(&self, sizes: &LargestEntries) -> Option<Singular> {
        for (field, f) in self.system.fields.iter().enumerate() {
            let free = self.free_of(field);
            let empty = |sizes: &[f64]| free.iter().filter(|d| sizes[**d] == 0.0).count();
            let (rows, columns) = (empty(&sizes.rows), empty(&sizes.columns));
            if rows == 0 && columns == 0 {
                continue;
            }
            let name = &f.name;
            let terms = self.testing(field);
            let of = |n: usize| if n == free.len() { "all".to_owned() } else { format!("{n} of {}", free.len()) };
            let is_global = matches!(f.space, FieldSpace::Global);
            let (what, help) = if rows > 0 && terms.is_empty() {
                let word = if f.kind == FieldKind::Multiplier {
                    "a multiplier needs a law"
                } else {
                    "an unknown needs an equation"
                };
                (
                    format!("no term has `Test_{name}`: {word}"),
                    format!("add a term with `Test_{name}` that says what `{name}` is"),
                )
            } else if rows > 0 && is_global {
                let help = format!(
                    "start from a state in which they act, e.g. `start {name} = 0.01`, or add a term with `Test_{name}`"
                );
                (
                    format!(
                        "the equation of `{name}` is empty: {} do not change with any unknown here",
                        terms.join(", ")
                    ),
                    help,
                )
            } else if rows > 0 {
                let help = self.help_for_empty(field);
                (
                    format!(
                        "{} no equation for `{name}` at {} of its unknowns",
                        verb(&terms, "gives", "give"),
                        of(rows)
                    ),
                    help,
                )
            } else {
                let help = format!("add a term in which `{name}` acts on another unknown");
                (format!("no equation contains `{name}` at {} of its unknowns", of(columns)), help)
            };
            let note =
                format!("zero rows of the tangent: {rows}, zero columns: {columns}, of {} for `{name}`", free.len());
            return Some(Singular { what, notes: vec![note], help, name: name.clone() });
        }
        None
    }

    /// Rounding, where the numbers of the tangent are far apart.
    fn far_apart(&self, rows: &[f64]) -> Option<Singular> {
        let (mut high, mut low) = ((0, 0.0f64), (0, f64::INFINITY));
        for (free, size) in rows.iter().enumerate() {
            let field = self.system.field_of(self.system.numbering.free_dofs[free] as usize);
            if *size > high.1 {
                high = (field, *size);
            }
            if *size < low.1 {
                low = (field, *size);
            }
        }
        if high.1 < FAR_APART * low.1 {
            return None;
        }
        let name = self.system.fields[high.0].name.clone();
        let what = format!(
            "the tangent is numerically singular: its equations differ by a factor of {:.0e}, and rounding removes the smaller ones",
            high.1 / low.1
        );
        let note = format!(
            "the largest are those of `{name}` ({:.0e}; {}), the smallest those of `{}` ({:.0e})",
            high.1,
            self.testing(high.0).join(", "),
            self.system.fields[low.0].name,
            low.1
        );
        let help =
            "write the law such that its derivatives keep one magnitude: divide it by the largest one, or solve \
                    it for the argument of its exponential or power; or use smaller load steps"
                .to_owned();
        Some(Singular { what, notes: vec![note], help, name })
    }

    /// A null vector, by free number, that lies in one field.
    fn pure(&self, space: &NullSpace, field: usize) -> Option<Vec<f64>> {
        let free = self.free_of(field);
        let n = space.scaled.len();
        let mut part = DMatrix::<f64>::zeros(n, n);
        for i in 0..n {
            for j in 0..n {
                part[(i, j)] = free.iter().map(|d| space.scaled[i][*d] * space.scaled[j][*d]).sum();
            }
        }
        let eigen = part.symmetric_eigen();
        let best = (0..n).max_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]))?;
        (eigen.eigenvalues[best] > 1.0 - OUTSIDE).then(|| {
            let weights = eigen.eigenvectors.column(best);
            (0..space.vectors[0].len()).map(|d| (0..n).map(|k| weights[k] * space.vectors[k][d]).sum()).collect()
        })
    }

    /// What leaves one field undetermined, where no equation is empty and no body is loose.
    fn one_field(&self, field: usize, vector: &[f64], tangent: &Csr, u: &[f64]) -> Singular {
        let (name, components) = (self.system.fields[field].name.clone(), self.system.fields[field].n_components);
        let free = self.free_of(field);
        let largest = free.iter().fold(0.0f64, |m, d| m.max(vector[*d].abs()));
        let mean = free.iter().map(|d| vector[*d]).sum::<f64>() / (free.len().max(1)) as f64;
        let is_constant = components == 1 && free.iter().all(|d| (vector[*d] - mean).abs() <= 1e-6 * largest);
        let alone = free.iter().all(|d| {
            let (columns, values) = tangent.row(*d);
            let own = columns.iter().zip(values).filter(|(c, _)| free.binary_search(&(**c as usize)).is_ok());
            own.into_iter().all(|(_, v)| *v == 0.0)
        });
        let mode = match (is_constant, alone) {
            (true, _) => Mode::Constant,
            (false, true) => Mode::Uncoupled,
            (false, false) => Mode::Other,
        };
        if let Some(found) = self.of_a_kind(field, vector, mode) {
            return found;
        }
        if self.resists_at_points(field, vector) == Some(true) {
            return self.beyond_rounding(field, vector);
        }
        self.unseen(field, vector, u).unwrap_or_else(|| {
            let terms = self.testing(field).join(", ");
            Singular {
                what: format!("`{name}` has a zero-energy mode that is no rigid body motion"),
                notes: vec![format!(
                    "{} no part of it; it is largest at {}",
                    verb(&self.testing(field), "resists", "resist"),
                    self.places(vector)
                )],
                help: format!("{terms} has no stiffness against some strain: add one, or prescribe that motion"),
                name,
            }
        })
    }

    /// A direction that is held, by a stiffness that the rounding of the matrix hides.
    fn beyond_rounding(&self, field: usize, vector: &[f64]) -> Singular {
        let name = self.system.fields[field].name.clone();
        Singular {
            what: format!("the tangent is numerically singular: rounding of its entries hides what holds `{name}`"),
            notes: vec![format!(
                "`{name}` is held, but in one direction (largest at {}) by less than a part in 1e16 of the stiffness of its \
                 terms, {}: the body is very long and thin, or has parts of very different stiffness",
                self.places(vector),
                self.testing(field).join(", ")
            )],
            help: "shorter or thicker bodies, or stiffnesses that are less far apart: what moves as a rigid body beside the \
                   others may be a million times as stiff as they are, and not more"
                .to_owned(),
            name,
        }
    }

    /// Forces that cancel, a field that is constant, one that no term couples with itself.
    fn of_a_kind(&self, field: usize, vector: &[f64], mode: Mode) -> Option<Singular> {
        let name = self.system.fields[field].name.clone();
        if self.system.fields[field].kind == FieldKind::Multiplier {
            return Some(self.of_multiplier(field, vector));
        }
        if mode == Mode::Constant {
            return Some(Singular {
                what: format!("`{name}` is determined up to a constant only"),
                notes: vec![format!(
                    "{} the same residual for `{name}` and `{name}` + 1",
                    verb(&self.testing(field), "gives", "give")
                )],
                help: format!(
                    "prescribe `{name}` at one node (`region pin = nodes where ...`, `fix {name} = 0 on pin`), or its mean"
                ),
                name,
            });
        }
        if mode == Mode::Uncoupled {
            return Some(Singular {
                what: format!("`{name}` has a spurious mode that alternates from node to node"),
                notes: vec![
                    "no term couples it with itself: a saddle point problem, whose elements must satisfy the inf-sup condition".to_owned(),
                ],
                help: format!(
                    "use a higher degree for the field that `{name}` acts on (Q2 with Q1), or add a stabilisation term"
                ),
                name,
            });
        }
        None
    }

    /// Forces of a multiplier that cancel: there are more of them than displacements for them to act on.
    fn of_multiplier(&self, field: usize, vector: &[f64]) -> Singular {
        let (name, place) = (self.system.fields[field].name.clone(), self.places(vector));
        let what = format!("the multiplier `{name}` is not unique: some of its forces cancel");
        let mut partners: Vec<usize> = {
            let with_it = self.system.terms.iter().filter(|t| t.coupled_fields().any(|f| f.index() == field));
            with_it
                .flat_map(|t| t.coupled_fields().map(|f| f.index()))
                .filter(|k| self.system.fields[*k].kind == FieldKind::Unknown)
                .collect()
        };
        partners.sort_unstable();
        partners.dedup();
        let second = "remove a second constraint of that jump: a `fix`, another multiplier, or `crosspoints=keep`";
        if self.system.fields[field].degree() > 0 {
            return Singular {
                what,
                notes: vec![format!("its laws constrain a jump that is constrained already, at {place}")],
                help: format!("{second}; or use an element of lower degree for the multiplier"),
                name,
            };
        }
        // the lowest degree there is: it is the other field that has too few
        let degree = partners.iter().map(|k| self.system.fields[*k].degree()).max().unwrap_or(1);
        let names: Vec<String> = partners.iter().map(|k| format!("`{}`", self.system.fields[*k].name)).collect();
        let names = names.join(", ");
        Singular {
            what,
            notes: vec![format!(
                "`{name}` is constant on each face, and {names} of degree {degree} {} fewer displacements there than there \
                 are faces: a force that alternates from face to face acts on none of them; it is largest at {place}",
                if partners.len() == 1 { "has" } else { "have" }
            )],
            help: format!("a higher degree for {names}: P{} or Q{} beside it; or {second}", degree + 1, degree + 1),
            name,
        }
    }

    /// Where a vector is largest: "[0.5, 1]".
    fn places(&self, vector: &[f64]) -> String {
        let largest = (0..vector.len()).max_by(|a, b| vector[*a].abs().total_cmp(&vector[*b].abs()));
        let Some(dof) = largest.and_then(|free| self.system.numbering.free_dofs.get(free)) else {
            return String::new();
        };
        let (field, node, _) = self.system.numbering.describe(&self.system.fields, *dof as usize);
        let x = self.system.fields[field].node_position(node);
        let x: Vec<String> =
            x.iter().take(self.system.mesh.dim()).map(|c| format!("{}", (c * 1e6).round() / 1e6)).collect();
        format!("[{}]", x.join(", "))
    }

    /// Equations of several fields that depend on each other.
    fn several_fields(&self, space: &NullSpace) -> Singular {
        let share = |field: usize| -> f64 {
            self.free_of(field).iter().map(|d| space.scaled.iter().map(|v| v[*d] * v[*d]).sum::<f64>()).sum()
        };
        let fields: Vec<usize> = (0..self.system.fields.len()).filter(|f| share(*f) > 1e-8).collect();
        let names: Vec<String> = fields.iter().map(|f| format!("`{}`", self.system.fields[*f].name)).collect();
        let terms: Vec<String> = {
            let couples =
                |t: &&wfl_discrete::assemble::AssembledTerm| t.coupled_fields().any(|f| fields.contains(&f.index()));
            self.system.terms.iter().filter(couples).map(|t| format!("`{}`", t.law.name)).collect()
        };
        Singular {
            what: format!("{} can change together without changing any equation", names.join(" and ")),
            notes: vec![format!("the terms they are in: {}", terms.join(", "))],
            help: "their equations are linearly dependent: prescribe one of them, or add the missing equation"
                .to_owned(),
            name: fields.first().map(|f| self.system.fields[*f].name.clone()).unwrap_or_default(),
        }
    }
}

/// The null space of one vector; empty without one.
fn only(mode: &NullVector) -> NullSpace {
    let vector = mode.values().to_vec();
    let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 {
        NullSpace { scaled: vec![vector.iter().map(|x| x / length).collect()], vectors: vec![vector] }
    } else {
        NullSpace::default()
    }
}

/// "`a`, `b` give"
fn verb(names: &[String], one: &str, several: &str) -> String {
    format!("{} {}", names.join(", "), if names.len() == 1 { one } else { several })
}

/// The fields that move.
fn listed(motions: &[LooseMotions]) -> Vec<String> {
    motions.iter().flat_map(|m| m.fields.clone()).collect()
}
