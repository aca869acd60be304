//! WFL, the language: text to a resolved script. No meshes, no numerics, no code generation.
#![forbid(unsafe_code)]

pub mod ast;
mod codes;
mod diag;
mod fmt;
mod idx;
mod macros;
mod parse;
mod render;
mod resolve;
mod script;
mod source;
#[cfg(test)]
mod testing;
mod walk;
mod words;

pub use codes::{CodePage, codes, explain};
pub use diag::{Checked, Diagnostic, Label, Severity, nearest};
pub use fmt::format;
pub use macros::{EXPANDED_NESTING_LIMIT, EXPANSION_LIMIT, Expander};
pub use parse::{KEYWORDS, NESTING_LIMIT, STATEMENTS, TEXT_LIMIT, is_keyword, parse, parse_expr, parse_gwfl};
pub use render::{at_expr, render};
pub use resolve::{FORMATS, LIBRARY, Loader, NoFiles, OPTIONS, Override, SOLVERS, resolve};
pub use script::{
    Condition, DataValue, Expect, Field, FieldKind, MacroInfo, Mapping, Measure, MeshStmt, Output, OutputQuantity,
    Param, Quadrature, Region, ResolvedScript, Solver, Split, Start, StartKind, Steps, Term,
};
pub use source::{Source, SourceId, SourceMap, Span};
pub use words::{CONSTANTS, FUNCTIONS, PREFIXES, REGIONS, UNSUPPORTED, is_function, reserved, split_prefixes};
