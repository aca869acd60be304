//! Which method of PETSc equations get.

use wfl_sparse::solve::Traits;

/// Unknowns in three dimensions above which an iteration takes less time than a factor: a single solution for trilinear
/// hexahedra (docs/scale.md). Below, and in the plane, a factor is made.
const ITERATE_ABOVE: usize = 50_000;
/// Unknowns of contact above which a direct solution on them in every cycle takes longer than the cycle.
const MOST_ON_CONTACT: usize = 100_000;

/// What decides between a factor and an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The size and the structure of the equations.
    Auto,
    /// A factor always.
    Direct,
    /// An iteration wherever the equations can be told node by node.
    Iterative,
}

/// How a matrix is solved with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Method {
    /// A factor of MUMPS.
    Direct,
    /// Conjugate gradients or GMRES with smoothed aggregation, and a filter where there is contact.
    Multigrid,
}

/// The method for these equations, and why where it is not what was asked for.
pub(crate) fn method(choice: Choice, traits: &Traits) -> (Method, Option<String>) {
    let iterates = match choice {
        Choice::Direct => return (Method::Direct, None),
        Choice::Iterative => true,
        Choice::Auto => traits.dimension == 3 && traits.unknowns > ITERATE_ABOVE,
    };
    if !iterates {
        return (Method::Direct, None);
    }
    if let Some(obstacle) = &traits.obstacle {
        return (Method::Direct, Some(obstacle.clone()));
    }
    let most = MOST_ON_CONTACT.min(traits.unknowns * 6 / 10);
    if traits.on_contact > most {
        let found = traits.on_contact;
        return (Method::Direct, Some(format!("{found} of {} unknowns are on contact", traits.unknowns)));
    }
    (Method::Multigrid, None)
}

/// A method in words.
pub(crate) fn in_words(choice: Choice, traits: &Traits) -> String {
    let prefix = if traits.is_linear { "one linear system" } else { "Newton" };
    let text = match method(choice, traits) {
        (Method::Direct, why) => {
            let factor = if traits.is_symmetric { "symmetric (LDLT)" } else { "unsymmetric (LU)" };
            let why = why.map_or(String::new(), |why| format!("; no iteration: {why}"));
            format!("{prefix}; MUMPS, {factor}{why}")
        }
        (Method::Multigrid, _) if traits.on_contact > 0 => {
            let n = traits.on_contact;
            format!("{prefix}; GMRES with multigrid (GAMG), then a direct solution on the {n} dofs of contact")
        }
        (Method::Multigrid, _) if traits.is_symmetric => {
            format!("{prefix}; conjugate gradients with multigrid (GAMG)")
        }
        (Method::Multigrid, _) => format!("{prefix}; GMRES with multigrid (GAMG)"),
    };
    format!("PETSc: {text}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_and_plane_scenes_are_factored() {
        let of = |dimension, unknowns| method(Choice::Auto, &Traits { unknowns, dimension, ..Traits::default() }).0;
        assert_eq!(
            (of(2, 1_000_000), of(3, 10_000), of(3, 100_000)),
            (Method::Direct, Method::Direct, Method::Multigrid)
        );
    }

    #[test]
    fn what_stands_against_an_iteration_is_said() {
        let obstacle = Some("some unknowns follow others".to_owned());
        let traits = Traits { unknowns: 100, dimension: 3, is_linear: true, obstacle, ..Traits::default() };
        let text = in_words(Choice::Iterative, &traits);
        assert_eq!(
            text,
            "PETSc: one linear system; MUMPS, unsymmetric (LU); no iteration: some unknowns follow others"
        );
    }
}
