//! WFL, the language: text to a resolved script. No meshes, no numerics, no code generation.
//!
//! A scene goes through [`resolve()`]: its text and its included files are parsed ([`parse()`]), macros are expanded
//! ([`Expander`]), the names of statements are checked. Every stage returns [`Checked`]: a value if there is one, and
//! all messages, which [`render()`] turns into text.
//!
//! ```
//! let mut sources = wfl::SourceMap::new();
//! let text = "mesh box [0,0] to [1,1] cells [8,8] quad\nunknown u : scalar\nterm on all : Grad_u.Grad_Test_u - x**2*Test_u\n";
//! let main = sources.add("poisson.wfl", text);
//! let checked = wfl::resolve(&mut sources, main, &mut wfl::NoFiles, &[]);
//! let message = wfl::render(&checked.diagnostics[0], &sources);
//! assert!(message.starts_with("error[E107]: `**` is not an operator\n --> poisson.wfl:3:37"));
//! ```
#![forbid(unsafe_code)]

pub mod ast;
mod causes;
mod codes;
mod diag;
mod edits;
mod fix;
mod fmt;
mod foreign;
mod idx;
mod keywords;
mod lost;
mod macros;
mod operators;
mod parse;
mod quote;
mod reference;
mod render;
mod resolve;
mod scalar_functions;
mod script;
mod source;
mod tables;
mod templates;
#[cfg(test)]
mod testing;
mod units;
mod walk;
mod words;

pub use causes::one_per_cause;
pub use codes::{Code, CodePage, Severity, codes, explain};
pub use diag::{Checked, Diagnostic, Label, nearest};
pub use edits::{Edit, edits};
pub use fix::Fix;
pub use fmt::format;
pub use foreign::{foreign, ufl};
pub use keywords::{KEYWORDS, STATEMENTS, is_keyword};
pub use lost::Lost;
pub use macros::{EXPANDED_NESTING_LIMIT, EXPANSION_LIMIT, Expander};
pub use parse::{NESTING_LIMIT, TEXT_LIMIT, parse, parse_expr, parse_gwfl, statement_ranges};
pub use quote::{line_of, quote, quote_without_tests, unquoted};
pub use reference::{Phrase, StatementRow, phrases, statement_page, statement_rows, statement_table, word_meaning};
pub use render::{at_expr, render, render_coloured, visible};
pub use resolve::{FORMATS, LIBRARY, Loader, NoFiles, OPTIONS, Override, SCHEMES, SOLVERS, Unloaded, resolve};
pub use script::{
    Balance, Computed, Condition, DataValue, Derivative, Event, Expect, Field, FieldKind, Gradient, MacroInfo, Mapping,
    Measure, MeshStmt, Output, OutputQuantity, Param, Quadrature, Refinement, Region, ResolvedScript, Scheme, Solver,
    Split, Start, StartKind, Steps, Term, is_auto,
};
pub use source::{Source, SourceId, SourceMap, Span};
pub use tables::{Curve, Head, NoTable, Table};
pub use templates::{TEMPLATES, Template};
pub use units::{UnitOf, check_units, is_length, unit_report};
pub use walk::{children, cond_children, each_name, each_word};
pub use words::{CONSTANTS, PREFIXES, REGIONS, UNSUPPORTED, functions, is_function, reserved, split_prefixes};
