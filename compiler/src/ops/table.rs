//! The table of operators: the rows of `wfl/src/operators.rs` and `wfl/src/scalar_functions.rs` as the compiler sees them.
//!
//! The formulas of the rows are looked up here: what they name is imported here.

use super::{
    def::{Entrywise, OpDef},
    field::{diff, divergence, hessian, interpolate, interpolate_filter, number_of_components, rate, sizes},
    hyperelastic::{
        BLATZ_KO, BONET, CIARLET, CIARLET_GEYMONAT, COMPRESSIBLE_MOONEY, COMPRESSIBLE_NEO, Law, MOONEY, NEO, Strain,
        Wanted, cauchy_green, cauchy_stress, green_lagrangian, law_of_gradient,
    },
    lookup::lookup,
    project::{coulomb, transformed_unit_vector, von_mises},
    scalar::{by_sign, pos_part, power, regularised_pos_part, square, step, two_arguments},
    tensor::{
        contract, cross, deviator, identity, matrix_function, move_last, product, regularised, reshape, scaled_by_det,
        second_invariant, skew, swap_indices, symmetric,
    },
};
use crate::{
    compare::Compare,
    graph::{ExprId, Function1, Graph, apply, pow_components},
    math::{MathFn1, MathFn2, MatrixFn},
};

/// The samples of a row.
macro_rules! samples {
    (untested $why:literal) => {
        &[]
    };
    ($($sample:expr),*) => {
        &[$($sample),*]
    };
}

/// Why a row has no samples.
macro_rules! untested {
    (untested $why:literal) => {
        $why
    };
    ($($sample:expr),*) => {
        ""
    };
}

/// A function of one number.
macro_rules! one {
    ($name:literal, (), $doc:expr, [$($sample:tt)*], $formula:expr) => {
        &[OpDef {
            name: $name,
            least: 1,
            most: 1,
            usage: concat!($name, "(t)"),
            doc: $doc,
            samples: samples!($($sample)*),
            untested: untested!($($sample)*),
            build: |b, c| {
                let (_, a) = b.plain_argument(c, 0)?;
                let formula: fn(&mut Graph, ExprId) -> ExprId = $formula;
                Some(formula(&mut b.graph, a))
            },
            entrywise: Some(Entrywise::One($formula)),
        }]
    };
}

/// A function of two numbers.
macro_rules! two {
    ($name:literal, (), $doc:expr, [$($sample:tt)*], $formula:expr) => {
        &[OpDef {
            name: $name,
            least: 2,
            most: 2,
            usage: concat!($name, "(t, u)"),
            doc: $doc,
            samples: samples!($($sample)*),
            untested: untested!($($sample)*),
            build: |b, c| {
                let (x, y) = two_arguments(b, c)?;
                let formula: fn(&mut Graph, ExprId, ExprId) -> ExprId = $formula;
                Some(formula(&mut b.graph, x, y))
            },
            entrywise: Some(Entrywise::Two($formula)),
        }]
    };
}

/// Anything else that is written as a call.
macro_rules! call {
    ($name:literal, ($least:literal, $most:literal, $usage:literal), $doc:expr, [$($sample:tt)*], $formula:expr) => {
        &[OpDef {
            name: $name,
            least: $least,
            most: $most,
            usage: $usage,
            doc: $doc,
            samples: samples!($($sample)*),
            untested: untested!($($sample)*),
            build: $formula,
            entrywise: None,
        }]
    };
}

/// A hyperelastic law: potential and stress, in space and in plane strain. The stress has two names.
macro_rules! law {
    ($name:literal, ($count:literal, $parameters:literal, $values:literal), $doc:expr, [], $law:expr) => {
        &[
            law!(@word "", $name, "_potential", "energy density of ", $count, $parameters, $values, $doc,
                $law, Potential, Full),
            law!(@word "", $name, "_PK2", "second Piola-Kirchhoff stress of ", $count, $parameters, $values, $doc,
                $law, Stress, Full),
            law!(@word "", $name, "_sigma", "second Piola-Kirchhoff stress of ", $count, $parameters, $values, $doc,
                $law, Stress, Full),
            law!(@word "Plane_Strain_", $name, "_potential", "energy density in plane strain of ",
                $count, $parameters, $values, $doc, $law, Potential, Plane),
            law!(@word "Plane_Strain_", $name, "_PK2", "in-plane second Piola-Kirchhoff stress in plane strain of ",
                $count, $parameters, $values, $doc, $law, Stress, Plane),
            law!(@word "Plane_Strain_", $name, "_sigma", "in-plane second Piola-Kirchhoff stress in plane strain of ",
                $count, $parameters, $values, $doc, $law, Stress, Plane),
        ]
    };
    (@word $before:literal, $name:literal, $after:literal, $what:literal, $count:literal, $parameters:literal,
        $values:literal, $doc:literal, $law:expr, $wanted:ident, $strain:ident) => {
        OpDef {
            name: concat!($before, $name, $after),
            least: 2,
            most: 2,
            usage: concat!($before, $name, $after, "(Grad_u, ", $parameters, ")"),
            doc: concat!($what, $doc),
            samples: &[concat!($before, $name, $after, "(0.1*Grad_u, ", $values, ")")],
            untested: "",
            build: |b, c| law_of_gradient(b, c, $law, $count, Wanted::$wanted, Strain::$strain),
            entrywise: None,
        }
    };
}

/// The rows of `wfl/src/operators.rs`, each the words that it makes.
macro_rules! operators {
    ($($kind:ident $name:literal $(($($call:tt)*))? $doc:literal $rule:ident $(($($of:tt)*))?, [$($sample:tt)*]
        $formula:expr;)*) => {
        &[$($kind!($name, ($($($call)*)?), $doc, [$($sample)*], $formula)),*]
    };
}

/// The rows of `wfl/src/scalar_functions.rs`: those of the language are functions of one number.
macro_rules! smooth_functions {
    ($($kind:ident $variant:ident $name:literal $doc:literal [$($sample:literal),*] $form:ident($($value:tt)*);)*) => {
        &[$(smooth_functions!(@row $kind $variant $name $doc [$($sample),*])),*]
    };
    (@row word $variant:ident $name:literal $doc:literal [$($sample:literal),*]) => {
        one!($name, (), $doc, [$($sample),*], |g, a| apply(g, MathFn1::$variant, a))
    };
    (@row inner $variant:ident $name:literal $doc:literal []) => {
        &[]
    };
}

const SMOOTH: &[&[OpDef]] = wfl::scalar_functions!(smooth_functions);
const OTHERS: &[&[OpDef]] = wfl::operators!(operators);

/// All functions, row by row.
pub fn all() -> impl Iterator<Item = &'static OpDef> {
    [SMOOTH, OTHERS].into_iter().flatten().copied().flatten()
}

/// The function of that name.
pub(crate) fn find(name: &str) -> Option<&'static OpDef> {
    all().find(|op| op.name == name)
}

/// All names.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    all().map(|op| op.name)
}
