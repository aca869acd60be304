//! The mathematical functions that kernels can call, by name.
//!
//! Their values are in `real/float.rs` (f64 and f32), `dd.rs` (double-double) and `real/dual.rs` (with derivatives), those
//! of matrix functions in `matrix_fn.rs`, those of `asinh(t exp(u))` in `asinh_exp.rs`.

macro_rules! declare {
    ($($kind:ident $variant:ident $name:literal $doc:literal [$($sample:literal),*] $form:ident($($value:tt)*);)*) => {
        /// Functions of one number; `wfl/src/scalar_functions.rs` has a row for each.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum MathFn1 {
            $(#[doc = $doc] $variant),*
        }

        impl MathFn1 {
            /// Every function, in order of the rows.
            pub const ALL: [MathFn1; [$($name),*].len()] = [$(MathFn1::$variant),*];

            /// The name in the language and in listings.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(MathFn1::$variant => $name),*
                }
            }

            /// Expressions that the tests differentiate; none for functions that the language does not have.
            #[must_use]
            pub fn samples(self) -> &'static [&'static str] {
                match self {
                    $(MathFn1::$variant => &[$($sample),*]),*
                }
            }
        }
    };
}

wfl::scalar_functions!(declare);

/// Functions of two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum MathFn2 {
    /// `pow(t, u)`: t to the u, C99 rules
    Pow,
    /// `atan2(t, u)`: the angle of the point (u, t)
    Atan2,
    /// `asinh(t exp(u))`, where the product may leave the range of numbers
    AsinhExp,
    /// Its derivative in t
    AsinhExpSlope,
}

impl MathFn2 {
    /// Every function, in order of declaration.
    pub const ALL: [MathFn2; 4] = [MathFn2::Pow, MathFn2::Atan2, MathFn2::AsinhExp, MathFn2::AsinhExpSlope];

    /// The name in the language and in listings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            MathFn2::Pow => "pow",
            MathFn2::Atan2 => "atan2",
            MathFn2::AsinhExp => "asinh_exp",
            MathFn2::AsinhExpSlope => "asinh_exp_slope",
        }
    }
}

/// Functions of a square matrix (1 by 1 to 3 by 3), entries column by column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum MatrixFn {
    /// Matrix exponential: `n*n` results.
    Expm,
    /// Its Frechet derivative as a matrix: result `k + n*n*l` is the derivative of entry k in entry l: `n^4` results.
    ExpmDerivative,
    /// Principal matrix logarithm: `n*n` results.
    Logm,
    /// Its Frechet derivative, as for `ExpmDerivative`.
    LogmDerivative,
}

impl MatrixFn {
    /// Every function, in order of declaration.
    pub const ALL: [MatrixFn; 4] = [MatrixFn::Expm, MatrixFn::ExpmDerivative, MatrixFn::Logm, MatrixFn::LogmDerivative];

    /// The name in listings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            MatrixFn::Expm => "expm",
            MatrixFn::ExpmDerivative => "expm_derivative",
            MatrixFn::Logm => "logm",
            MatrixFn::LogmDerivative => "logm_derivative",
        }
    }

    /// Number of results for an n by n matrix.
    #[must_use]
    pub fn n_results(self, n: usize) -> usize {
        match self {
            MatrixFn::Expm | MatrixFn::Logm => n * n,
            MatrixFn::ExpmDerivative | MatrixFn::LogmDerivative => n * n * n * n,
        }
    }
}
