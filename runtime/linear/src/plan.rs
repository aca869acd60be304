//! What solves the linear systems of a scene, in one type: what `wfl check` foresees and what a run has made are told by the
//! same words. Chooses nothing and solves nothing.

use std::fmt;

use wfl_host::memory::shown;

/// What is known of a part of the plan: before the run what is foreseen, in a run what was made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Extent<F, M> {
    /// Before anything was assembled.
    Foreseen(F),
    /// In a run.
    Made(M),
}

/// How a whole matrix is factored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FactorKind {
    /// By Cholesky's method.
    Definite,
    /// Symmetric, with pivots of both signs.
    Indefinite,
    /// Symmetric once the equations of each field are multiplied by a number, with pivots of both signs.
    Multiplied,
    /// Unsymmetric as it stands; the numbers of a matrix will tell whether it is symmetric once equations are multiplied.
    Undecided,
    /// Unsymmetric.
    General,
}

/// How the matrix of an iteration is held, where elements of degree 2 and more could do without it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Held {
    /// It is not stored: terms are applied cell by cell.
    Applied,
    /// It is stored; why.
    Stored(String),
}

/// The solver of the linear systems of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LinearPlan {
    /// One matrix, factored once.
    Once(FactorKind),
    /// One symmetric matrix, by conjugate gradients with multigrid: bytes of the levels and of the factor in their place, or the number of
    /// unknowns on each level.
    Iterative(Extent<(u64, Option<u64>), Vec<usize>>),
    /// Symmetric tangents, in the same way.
    Tangents(Extent<(u64, Option<u64>), Vec<usize>>),
    /// The same, and how its matrix is held.
    WithOperator(Box<LinearPlan>, Held),
    /// The bulk is factored once, what changes is condensed: dofs of the nonlinear terms, or unknowns at points that are
    /// eliminated before and how the rest is.
    Condensed(Extent<usize, (usize, String)>),
    /// GMRES with multigrid of the bodies and a direct solution on the dofs of contact: how many these are, bytes of what it
    /// needs and of the factor in its place.
    Filtered {
        /// Dofs of contact.
        on_contact: usize,
        /// What it needs.
        bytes: u64,
        /// What a factor of the bodies would need.
        in_place: u64,
    },
    /// Whole tangents by GMRES with multigrid of the bodies and a direct solution on so many dofs of contact: bytes of the levels and
    /// of the factor in their place, or the number of unknowns on each level.
    WithContact(usize, Extent<(u64, Option<u64>), Vec<usize>>),
    /// A motion and a pressure by GMRES with multigrid of the motion: as [`Self::Iterative`].
    Saddle(Systems, Extent<(u64, Option<u64>), Vec<usize>>),
    /// The whole tangent.
    Whole(FactorKind),
    /// A linked library, which describes itself.
    Library(String),
}

/// What is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Systems {
    /// The one matrix of a linear scene.
    One,
    /// The tangents of Newton's method.
    Tangents,
}

/// What the method without a factor is called.
pub(super) const ITERATION: &str = "conjugate gradients with multigrid";
/// The same where matrices are not positive definite.
pub(super) const GMRES: &str = "GMRES with multigrid";

impl fmt::Display for FactorKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Definite => "symmetric (LLT)",
            Self::Indefinite => "symmetric, not positive definite (LDLT)",
            Self::Multiplied => "symmetric in scaled equations (LDLT)",
            Self::Undecided => "unsymmetric (LDLT if scaled equations are symmetric, else LU)",
            Self::General => "unsymmetric (LU)",
        })
    }
}

impl fmt::Display for LinearPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Once(factor) => write!(f, "one linear system, {factor}, factored once"),
            Self::Iterative(extent) => write_iteration(f, "one linear system, symmetric: ", extent),
            Self::Tangents(extent) => write_iteration(f, "Newton; whole tangent, symmetric: ", extent),
            Self::WithOperator(plan, Held::Applied) => {
                write!(f, "{plan}; terms are applied cell by cell, without a matrix")
            }
            Self::WithOperator(plan, Held::Stored(why)) => write!(f, "{plan}; the matrix is stored: {why}"),
            Self::Condensed(Extent::Foreseen(touched)) => write!(
                f,
                "Newton; linear part factored once (LLT), Schur complement on the {touched} dofs of the nonlinear terms"
            ),
            Self::Condensed(Extent::Made((0, elimination))) => {
                write!(f, "Newton; linear part factored once, {elimination}")
            }
            Self::Condensed(Extent::Made((n, elimination))) => {
                write!(f, "Newton; linear part factored once, {n} unknowns at points eliminated first, {elimination}")
            }
            Self::Filtered { on_contact, bytes, in_place } => write!(
                f,
                "Newton; GMRES with multigrid, then a direct solution on the {on_contact} dofs of contact, about {}; a \
                 factor of the bodies would take about {}",
                shown(*bytes),
                shown(*in_place)
            ),
            Self::WithContact(n, extent) => {
                write!(
                    f,
                    "Newton; whole tangent: GMRES with multigrid, then a direct solution on the {n} dofs of contact"
                )?;
                write_extent(f, extent)
            }
            Self::Saddle(systems, extent) => {
                let systems = match systems {
                    Systems::One => "one linear system",
                    Systems::Tangents => "Newton; whole tangent",
                };
                write!(f, "{systems}, of a motion with a field beside it: GMRES with multigrid of the motion")?;
                write_extent(f, extent)
            }
            Self::Whole(factor) => {
                write!(f, "Newton; whole tangent, {factor}, factored where an older factor does not serve")
            }
            Self::Library(text) => f.write_str(text),
        }
    }
}

/// The iteration with its levels, which are not known before the first matrix.
fn write_iteration(
    f: &mut fmt::Formatter<'_>,
    what: &str,
    extent: &Extent<(u64, Option<u64>), Vec<usize>>,
) -> fmt::Result {
    write!(f, "{what}{ITERATION}")?;
    write_extent(f, extent)
}

/// What levels take, or are.
fn write_extent(f: &mut fmt::Formatter<'_>, extent: &Extent<(u64, Option<u64>), Vec<usize>>) -> fmt::Result {
    match extent {
        Extent::Foreseen((levels, in_place)) => {
            write!(f, ", levels of about {}", shown(*levels))?;
            in_place.map_or(Ok(()), |bytes| write!(f, "; a factor would take about {}", shown(bytes)))
        }
        Extent::Made(levels) if levels.is_empty() => Ok(()),
        Extent::Made(levels) => {
            let sizes: Vec<String> = levels.iter().map(ToString::to_string).collect();
            write!(f, " (unknowns by level: {})", sizes.join(", "))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_is_told_by_its_symmetry() {
        assert!(LinearPlan::Once(FactorKind::Definite).to_string().contains("symmetric (LLT), factored once"));
        assert!(LinearPlan::Whole(FactorKind::General).to_string().contains("unsymmetric (LU)"));
        assert!(
            LinearPlan::Once(FactorKind::Indefinite).to_string().contains("not positive definite (LDLT), factored")
        );
    }

    #[test]
    fn how_a_matrix_is_held_is_told_where_there_is_a_choice() {
        let plan = || Box::new(LinearPlan::Iterative(Extent::Made(vec![3, 1])));
        let applied = LinearPlan::WithOperator(plan(), Held::Applied).to_string();
        assert!(applied.starts_with(&plan().to_string()) && applied.ends_with("without a matrix"));
        let stored = LinearPlan::WithOperator(plan(), Held::Stored("ranks".to_owned())).to_string();
        assert!(stored.ends_with("the matrix is stored: ranks"));
    }

    #[test]
    fn unknowns_at_points_are_told_where_there_are_some() {
        let made = |n: usize| LinearPlan::Condensed(Extent::Made((n, "a dense matrix".to_owned()))).to_string();
        assert_eq!(made(0), "Newton; linear part factored once, a dense matrix");
        assert!(made(12).contains("12 unknowns at points eliminated first, a dense matrix"));
    }
}
