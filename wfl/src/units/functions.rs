//! What each built-in function does to units, by its row.

use super::unit::Ratio;
use crate::{operators::operator_rows, scalar_functions::scalar_function_names};

/// How the unit of a call follows from those of its arguments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Rule {
    /// The unit of the first argument.
    Keep,
    /// A pure number whatever the first argument is; the others are not looked at.
    Pure,
    /// The first argument must be a pure number, and so is the result.
    NeedsPure,
    /// The unit of the first argument to a power.
    Power(Ratio),
    /// All arguments have one unit, and the result has it.
    Same,
    /// All arguments have one unit, the result is a pure number.
    SameToPure,
    /// The product of all arguments; indices are pure numbers and change nothing.
    Multiply,
    /// A gradient, which must be pure, and a vector of material parameters: the result is a stress like the first of
    /// them.
    Law,
    /// A stress and a gradient, which must be pure.
    StressAndGradient,
    /// To the power of the space dimension.
    Det,
    /// `pow(a, b)`
    Pow,
    /// Over a power of the unit of coordinates.
    Gradient(i64),
    /// Over the unit of the step variable.
    Rate,
    /// `Diff(e, u, d)`
    Diff,
    /// `Interpolate_filter(m, e, i)`
    Filter,
    /// A column of a file over its first one, with the units that the file names.
    Table,
    /// `Coulomb_friction_coupled_projection(lambda, n, v, g, f, r)`
    Coulomb,
}

macro_rules! rules {
    ($($kind:ident $name:literal $(($($call:tt)*))? $doc:literal $rule:ident $(($($of:tt)*))?, [$($sample:tt)*]
        $formula:expr;)*) => {
        /// The rule of each row of `operators.rs`.
        const RULES: &[Rule] = &[$(Rule::$rule $(($($of)*))?),*];
    };
}

crate::operators!(rules);

/// The rule of a function of this language; `None` for other words.
pub(super) fn rule(name: &str) -> Option<Rule> {
    if scalar_function_names().any(|scalar| scalar == name) {
        return Some(Rule::NeedsPure);
    }
    operator_rows().zip(RULES).find(|(words, _)| words.contains(&name)).map(|(_, rule)| *rule)
}

/// The argument and the function of `Derivative_2_pow`; `Derivative_sin` is by the first argument.
pub(super) fn derivative(name: &str) -> Option<(usize, &str)> {
    let rest = name.strip_prefix("Derivative_")?;
    let numbered = rest.strip_prefix("1_").map(|f| (0, f)).or_else(|| rest.strip_prefix("2_").map(|f| (1, f)));
    Some(numbered.unwrap_or((0, rest)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_function_has_a_rule() {
        for name in crate::functions() {
            assert!(rule(name).is_some(), "{name}");
        }
        assert_eq!(rule("sigma"), None);
        assert_eq!(derivative("Derivative_2_pow"), Some((1, "pow")));
        assert_eq!(derivative("Derivative_sin"), Some((0, "sin")));
    }
}
