//! Words that mean something inside expressions: functions, constants, prefixes. No scene may declare them.

use std::{collections::BTreeSet, sync::LazyLock};

use crate::{operators::operator_rows, scalar_functions::scalar_function_names};

/// Built-in functions and operators written as a call, sorted, but for the smooth functions of one number.
static OTHER_FUNCTIONS: LazyLock<BTreeSet<&str>> = LazyLock::new(|| operator_rows().flatten().copied().collect());

/// Every built-in function and operator written as a call.
pub fn functions() -> impl Iterator<Item = &'static str> {
    OTHER_FUNCTIONS.iter().copied().chain(scalar_function_names())
}

/// GWFL words that are known and refused by the compiler (E801), so that they cannot be declared either.
pub const UNSUPPORTED: &[&str] = &[
    "Elementary_transformation",
    "Interpolate_derivative",
    "Secondary_Domain",
    "Secondary_domain",
    "Xfem_minus",
    "Xfem_plus",
];

/// Words with a value of their own in every scene. `x`, `y`, `z`, `t` come on top where they have a meaning.
pub const CONSTANTS: &[&str] = &[
    "Conormal",
    "Normal",
    "X",
    "element_B",
    "element_K",
    "element_size",
    "meshdim",
    "neighbor_element",
    "neighbour_elt",
    "pi",
    "timestep",
];

/// Regions that exist without being declared; `global` stands for "no place" in terms and measures.
pub const REGIONS: &[&str] = &["all", "boundary", "interior", "global"];

/// What may stand before the name of a field, with the longer words first where one starts the other.
pub const PREFIXES: &[&str] =
    &["Test2_", "Test_", "Grad_", "Hess_", "Div_", "Previous2_", "Previous3_", "Previous_", "Dot2_", "Dot_"];

/// Splits `Grad_Test_u` into its prefixes `Grad_Test_` and the rest `u`. The rest is never empty.
#[must_use]
pub fn split_prefixes(word: &str) -> (&str, &str) {
    let mut at = 0;
    while let Some(p) = PREFIXES.iter().find(|p| word[at..].starts_with(**p) && word.len() > at + p.len()) {
        at += p.len();
    }
    word.split_at(at)
}

/// True if `word` is one or more prefixes and nothing else.
pub(crate) fn only_prefixes(word: &str) -> bool {
    let mut rest = word;
    while let Some(p) = PREFIXES.iter().find(|p| rest.starts_with(**p)) {
        rest = &rest[p.len()..];
    }
    rest.is_empty() && !word.is_empty()
}

/// True for functions, also `Derivative_f` of them.
#[must_use]
pub fn is_function(word: &str) -> bool {
    OTHER_FUNCTIONS.contains(word)
        || scalar_function_names().any(|name| name == word)
        || UNSUPPORTED.contains(&word)
        || word.starts_with("Derivative_")
}

/// Why a word cannot be declared as a value, ready to stand behind "`word` is"; `None` if it can.
#[must_use]
pub fn reserved(word: &str) -> Option<String> {
    if is_function(word) {
        return Some("a built-in function".to_owned());
    }
    if CONSTANTS.contains(&word) {
        return Some("built in".to_owned());
    }
    let (prefix, _) = split_prefixes(word);
    if !prefix.is_empty() {
        return Some(format!("read as `{prefix}` of a field"));
    }
    only_prefixes(word).then(|| "a prefix of field names".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_function_is_there_twice() {
        let mut all: Vec<&str> = operator_rows().flatten().copied().chain(scalar_function_names()).collect();
        all.sort_unstable();
        assert!(all.windows(2).all(|w| w[0] < w[1]));
    }

    #[test]
    fn prefixes_come_off_and_leave_a_name() {
        assert_eq!(split_prefixes("Grad_Test_u"), ("Grad_Test_", "u"));
        assert_eq!(split_prefixes("Previous_Dot2_u"), ("Previous_Dot2_", "u"));
        assert_eq!(split_prefixes("Gradu"), ("", "Gradu"));
        assert_eq!(split_prefixes("Test_"), ("", "Test_"));
        assert!(only_prefixes("Grad_Test_") && !only_prefixes("Grad_Test_u") && !only_prefixes(""));
    }

    #[test]
    fn built_in_words_are_reserved() {
        for word in ["sin", "Normal", "Test_u", "Derivative_sin", "Grad_", "Xfem_plus", "pi"] {
            assert!(reserved(word).is_some(), "{word}");
        }
        for word in ["u", "sigma", "gamma", "t", "x", "Gradient", "lambda"] {
            assert!(reserved(word).is_none(), "{word}");
        }
    }
}
