//! The functions of `shim.c`, which asserts the sizes that stand here. Called from `objects` alone.

use std::ffi::{c_char, c_int};

/// A matrix of PETSc.
#[repr(C)]
pub(super) struct MatObject {
    _private: [u8; 0],
}

/// The solver of `shim.c`.
#[repr(C)]
pub(super) struct SolverObject {
    _private: [u8; 0],
}

/// Words for a rank (`from`), or room for those of one (`to`); the other is null.
#[repr(C)]
pub(super) struct Message {
    pub(super) rank: c_int,
    pub(super) n: c_int,
    pub(super) to: *mut u64,
    pub(super) from: *const u64,
}

pub(super) type Mat = *mut MatObject;
pub(super) type Solver = *mut SolverObject;

unsafe extern "C" {
    pub(super) fn wfl_last_error() -> *const c_char;
    pub(super) fn wfl_start(is_repeatable: c_int, rank: *mut c_int, size: *mut c_int) -> c_int;
    pub(super) fn wfl_finish();
    pub(super) fn wfl_abort(code: c_int);
    pub(super) fn wfl_sum(values: *mut f64, n: c_int);
    pub(super) fn wfl_sum_words(words: *mut u64, n: c_int);
    pub(super) fn wfl_max_words(words: *mut u64, n: c_int);
    pub(super) fn wfl_trim_memory();
    pub(super) fn wfl_exchange(messages: *const Message, n: c_int);
    pub(super) fn wfl_matrix_new(
        n: c_int,
        block: c_int,
        is_symmetric: c_int,
        own: *const c_int,
        others: *const c_int,
        out: *mut Mat,
    ) -> c_int;
    pub(super) fn wfl_matrix_put(a: Mat, row: c_int, n: c_int, columns: *const c_int, values: *const f64) -> c_int;
    pub(super) fn wfl_matrix_finish(a: Mat) -> c_int;
    pub(super) fn wfl_matrix_set_modes(a: Mat, n: c_int, k: c_int, values: *const f64) -> c_int;
    pub(super) fn wfl_matrix_free(a: *mut Mat);
    pub(super) fn wfl_solver_new(
        kind: *const c_char,
        is_direct: c_int,
        a: Mat,
        n: c_int,
        contact: *const c_int,
        has_contact: c_int,
        out: *mut Solver,
    ) -> c_int;
    pub(super) fn wfl_has_boomeramg() -> c_int;
    pub(super) fn wfl_solver_take(
        s: Solver,
        hierarchy: Mat,
        cycle: *const c_char,
        reason: *mut c_int,
        null_pivots: *mut c_int,
    ) -> c_int;
    pub(super) fn wfl_solver_solve(
        s: Solver,
        n: c_int,
        b: *const f64,
        x: *mut f64,
        tolerance: f64,
        most: c_int,
        iterations: *mut c_int,
        reason: *mut c_int,
    ) -> c_int;
    pub(super) fn wfl_solver_free(s: Solver);
}
