//! Resolved script to verified point kernels: typed tensor graph, symbolic tangent, scalar code.
//!
//! The unit of compilation is a *point law*: what a term gives at one integration point (fluxes and their
//! derivatives). Geometry, basis functions and scattering belong to the runtime.
#![forbid(unsafe_code)]

mod about;
mod asinh_exp;
pub mod backend;
mod branch;
mod build;
mod compare;
mod constant;
mod dd;
mod degree;
mod derive;
pub mod display;
mod dual;
mod effect;
mod emitter;
mod float;
mod frozen;
mod gradient;
mod graph;
mod image;
mod interp;
pub mod ir;
mod jumps;
mod law;
mod linear;
pub mod lookup;
mod lower;
mod math;
mod matrix_fn;
mod ops;
mod positions;
mod print;
mod random;
mod rates;
mod real;
mod scalar;
mod shape;
mod sign;
mod sinc;
mod summands;
mod symmetry;
mod tangent_check;
mod term;
#[cfg(test)]
mod test_law;
pub mod types;
mod verify;

pub use about::{About, about, check_condition, check_term, check_value};
pub use branch::{Branch, BranchLayout, BranchRegularisation, BranchSizes, ProjectionKind, SlipMut};
pub use build::{Builder, Constant, DEPTH_LIMIT, Env, locate};
pub use constant::{constant, without_fields};
pub use dd::Dd;
pub use degree::Degree;
pub use dual::Dual;
pub use effect::each_name_in_effect;
pub use frozen::{
    ArgumentSlope, FrozenLaw, Projection, ScaledPart, Scaling, SlopesLaw, compile_frozen, scaling_parameters,
};
pub use gradient::{
    Companions, KinkMotion, KinkSides, ToSide, compile_growth_along, compile_position_slopes, compile_slopes,
    compile_term_along, compile_term_gradient, compile_term_kink_sides, compile_term_to_side, compile_value_along,
    compile_value_gradient, compile_value_kink_sides, compile_value_to_side, kinks_of_term, kinks_of_value,
};
pub use graph::{ExprId, Graph, Leaf, Node, Role};
pub use interp::{InterpreterBackend, NonFinite, compares_nan, first_non_finite, interpret, interpret_lanes};
pub use law::{Class, Kink, KinkKind, Listing, Prologue, TermLaw, ValueJump, ValueLaw, run_prologue};
pub use linear::{Reading, compile_linear_part, compile_value_weights, is_affine};
pub use math::{MathFn1, MathFn2, MatrixFn};
pub use ops::{OpDef, all as functions, function_table};
pub use print::{PrintLaw, compile_prints};
pub use rates::{RateLaw, compile_rates};
pub use real::Real;
pub use shape::{Extent, Velocity};
pub use symmetry::unit_normals;
pub use tangent_check::{BlockCheck, EntryPlace, SlotGroup, TangentCheck, TangentSampling, check_tangent};
pub use term::{LoadPart, TermSource, compile_condition, compile_term, compile_value};
pub use verify::{SlotKind, ValueType, VerifyError, verify};
pub use wfl::scalar_functions;
