//! What machine code calls: C entries to the functions of `wfl_compiler`, so that machine code and interpreter run the
//! same mathematics.

use cranelift_codegen::{
    ir::{self, AbiParam, types},
    isa::TargetIsa,
};
use wfl_compiler::{
    MathFn1, MathFn2, MatrixFn,
    lookup::{Curve, Reading, read},
};

/// A function outside the kernel that machine code calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Shim {
    One(MathFn1),
    Two(MathFn2),
    Matrix(MatrixFn),
    Table(Reading),
}

impl Shim {
    pub(crate) fn all() -> impl Iterator<Item = Shim> {
        let one = MathFn1::ALL.into_iter().map(Shim::One);
        let matrix = MatrixFn::ALL.into_iter().map(Shim::Matrix);
        let table = Reading::ALL.into_iter().map(Shim::Table);
        one.chain(MathFn2::ALL.into_iter().map(Shim::Two)).chain(matrix).chain(table)
    }

    /// The name in listings.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Shim::One(f) => f.name(),
            Shim::Two(f) => f.name(),
            Shim::Matrix(f) => f.name(),
            Shim::Table(reading) => reading.name(),
        }
    }

    /// The link name: a prefix keeps it apart from the C library.
    pub(crate) fn symbol(self) -> String {
        format!("wfl_{}", self.name())
    }

    /// Numbers to a number, behind the address of the curve for a table; a matrix function takes rows, lanes, entries and results, see [`run_matrix`].
    pub(crate) fn signature(self, isa: &dyn TargetIsa) -> ir::Signature {
        let mut signature = ir::Signature::new(isa.default_call_conv());
        let number = AbiParam::new(types::F64);
        let pointer = AbiParam::new(isa.pointer_type());
        match self {
            Shim::One(_) => signature.params.push(number),
            Shim::Two(_) => signature.params.extend([number; 2]),
            Shim::Matrix(_) => signature.params.extend([pointer; 4]),
            Shim::Table(_) => signature.params.extend([pointer, number]),
        }
        if !matches!(self, Shim::Matrix(_)) {
            signature.returns.push(number);
        }
        signature
    }

    pub(crate) fn address(self) -> *const u8 {
        match self {
            Shim::One(f) => address1(f),
            Shim::Two(f) => address2(f),
            Shim::Matrix(f) => address_matrix(f),
            Shim::Table(reading) => address_table(reading),
        }
    }
}

/// A `match` over all variants of an enum; each arm defines the C function of its variant and gives its address.
macro_rules! shims {
    ($value:expr, $kind:ident: $($variant:ident)*, |$function:ident| $item:item) => {
        match $value {
            $($kind::$variant => {
                const $function: $kind = $kind::$variant;
                $item
                shim as *const u8
            })*
        }
    };
}

macro_rules! address_of_rows {
    ($($kind:ident $variant:ident $name:literal $doc:literal [$($sample:literal),*] $form:ident($($value:tt)*);)*) => {
        fn address1(f: MathFn1) -> *const u8 {
            shims!(f, MathFn1: $($variant)*, |FUNCTION| extern "C" fn shim(t: f64) -> f64 { FUNCTION.eval(t) })
        }
    };
}

wfl_compiler::scalar_functions!(address_of_rows);

#[rustfmt::skip]
fn address2(f: MathFn2) -> *const u8 {
    shims!(f, MathFn2: Pow Atan2 AsinhExp AsinhExpSlope, |FUNCTION| extern "C" fn shim(t: f64, u: f64) -> f64 { FUNCTION.eval(t, u) })
}

fn address_matrix(f: MatrixFn) -> *const u8 {
    shims!(f, MatrixFn: Expm ExpmDerivative Logm LogmDerivative, |FUNCTION| unsafe extern "C" fn shim(
        n: usize,
        lanes: usize,
        entries: *const f64,
        results: *mut f64,
    ) {
        // SAFETY: machine code passes stack slots that `emit.rs` has made as large as `run_matrix` asks for.
        unsafe { run_matrix(FUNCTION, n, lanes, entries, results) }
    })
}

#[rustfmt::skip]
fn address_table(f: Reading) -> *const u8 {
    shims!(f, Reading: Value Slope, |READING| unsafe extern "C" fn shim(curve: *const Curve, x: f64) -> f64 {
        // SAFETY: the address is that of a curve in an instruction of the kernel; `MachineKernel` keeps all of them alive.
        read(unsafe { &*curve }, READING, x)
    })
}

/// A matrix function for each of `lanes` points: number k of lane l stands at `k * lanes + l`.
///
/// # Safety
/// `entries` is valid for reading `n * n * lanes` numbers, `results` for writing `function.n_results(n) * lanes`.
unsafe fn run_matrix(function: MatrixFn, n: usize, lanes: usize, entries: *const f64, results: *mut f64) {
    let (n_entries, n_results) = (n * n, function.n_results(n));
    let (mut matrix, mut values) = ([0.0; 9], [0.0; 81]);
    for lane in 0..lanes {
        for (k, x) in matrix[..n_entries].iter_mut().enumerate() {
            // SAFETY: k * lanes + lane < n * n * lanes, which the caller has made readable.
            *x = unsafe { entries.add(k * lanes + lane).read() };
        }
        function.eval(n, &matrix[..n_entries], &mut values[..n_results]);
        for (k, x) in values[..n_results].iter().enumerate() {
            // SAFETY: k * lanes + lane < n_results * lanes, which the caller has made writable.
            unsafe { results.add(k * lanes + lane).write(*x) };
        }
    }
}
