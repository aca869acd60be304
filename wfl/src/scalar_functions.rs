//! The smooth functions of one number: one row each, and everything about a function follows from its row.
//!
//! [`scalar_functions!`](crate::scalar_functions) hands the rows to a macro of the caller. This crate takes from them
//! the words of the language and their unit rule (argument and result are pure numbers); the compiler takes the
//! documentation, the samples of the tests, the values in every number type and the derivatives. What a row names
//! beside its strings is looked up where the rows are expanded, in the compiler.
//!
//! A row is `kind Variant "name" "documentation" [samples] value;`. The kind is `word` for a function of the language,
//! `inner` for one that only derivatives use. The value is one of
//!
//! - `formula(|t| VALUE, |g, a, y| DERIVATIVE)`: VALUE is written in the operations of `Real` and serves every number
//!   type, double-double and dual numbers included. It may branch on `t`: a branch inside a formula is no kink, so it
//!   must be smooth there.
//! - `native(F64, EXTENDED, |t, y| SLOPE, |g, a, y| DERIVATIVE)`: functions of f64 and of `Dd`, and the slope at `t`,
//!   where the value is `y`, for dual numbers.
//!
//! DERIVATIVE makes the node of the derivative in the graph `g`, entry by entry; `a` is the argument, `y` the value.

/// Calls `$expand!` with the rows of all smooth functions of one number.
#[macro_export]
macro_rules! scalar_functions {
    ($expand:ident) => {
        $expand! {
            word Exp "exp" "exponential" ["exp(p)"]
                native(libm::exp, Dd::exp, |_t, y| y, |_g, _a, y| y);
            word Expm1 "expm1" "exp(t) - 1, to all digits near 0" ["expm1(p)"]
                native(libm::expm1, Dd::expm1, |t, _y| libm::exp(t), |g, a, _y| apply(g, MathFn1::Exp, a));
            word Log "log" "natural logarithm" ["log(4+p)"]
                native(libm::log, Dd::log, |t, _y| 1.0 / t, |g, a, _y| reciprocal(g, a));
            word Log1p "log1p" "log(1 + t), to all digits near 0" ["log1p(3+p)"]
                native(libm::log1p, Dd::log1p, |t, _y| 1.0 / (1.0 + t), |g, a, _y| {
                    let above = plus(g, 1.0, a);
                    reciprocal(g, above)
                });
            word Log10 "log10" "decimal logarithm" ["log10(4+p)"]
                native(libm::log10, Dd::log10, |t, _y| std::f64::consts::LOG10_E / t, |g, a, _y| {
                    let scaled = times(g, std::f64::consts::LN_10, a);
                    reciprocal(g, scaled)
                });
            word Sin "sin" "sine" ["sin(p)", "sin(u).w"]
                native(libm::sin, Dd::sin, |t, _y| libm::cos(t), |g, a, _y| apply(g, MathFn1::Cos, a));
            word Cos "cos" "cosine" ["cos(p)"]
                native(libm::cos, Dd::cos, |t, _y| -libm::sin(t), |g, a, _y| {
                    let sine = apply(g, MathFn1::Sin, a);
                    g.neg(sine)
                });
            word Tan "tan" "tangent" ["tan(p/3)"]
                native(libm::tan, Dd::tan, |_t, y| 1.0 + y * y, |g, _a, y| {
                    let square = g.mul_components(y, y);
                    plus(g, 1.0, square)
                });
            // (1 - t)(1 + t) keeps the digits that 1 - t^2 loses near 1
            word Asin "asin" "arc sine" ["asin(p/4)"]
                native(libm::asin, Dd::asin, |t, _y| 1.0 / ((1.0 - t) * (1.0 + t)).sqrt(), |g, a, _y| {
                    let product = one_minus_square(g, a);
                    reciprocal_root(g, product)
                });
            word Acos "acos" "arc cosine" ["acos(p/4)"]
                native(libm::acos, Dd::acos, |t, _y| -1.0 / ((1.0 - t) * (1.0 + t)).sqrt(), |g, a, _y| {
                    let product = one_minus_square(g, a);
                    let slope = reciprocal_root(g, product);
                    g.neg(slope)
                });
            word Atan "atan" "arc tangent" ["atan(p)"]
                native(libm::atan, Dd::atan, |t, _y| 1.0 / (1.0 + t * t), |g, a, _y| {
                    let square = g.mul_components(a, a);
                    let bottom = plus(g, 1.0, square);
                    reciprocal(g, bottom)
                });
            word Sinh "sinh" "hyperbolic sine" ["sinh(p)"]
                native(libm::sinh, Dd::sinh, |t, _y| libm::cosh(t), |g, a, _y| apply(g, MathFn1::Cosh, a));
            word Cosh "cosh" "hyperbolic cosine" ["cosh(p)"]
                native(libm::cosh, Dd::cosh, |t, _y| libm::sinh(t), |g, a, _y| apply(g, MathFn1::Sinh, a));
            word Tanh "tanh" "hyperbolic tangent" ["tanh(p)"]
                native(libm::tanh, Dd::tanh, |_t, y| (1.0 - y) * (1.0 + y), |g, _a, y| one_minus_square(g, y));
            word Asinh "asinh" "inverse of sinh" ["asinh(p)"]
                native(libm::asinh, Dd::asinh, |t, _y| 1.0 / libm::hypot(1.0, t), |g, a, _y| {
                    let square = g.mul_components(a, a);
                    let above = plus(g, 1.0, square);
                    reciprocal_root(g, above)
                });
            // sqrt((t - 1)(t + 1)) keeps the digits that t^2 - 1 loses near 1
            word Acosh "acosh" "inverse of cosh" ["acosh(5+p)"]
                native(libm::acosh, Dd::acosh, |t, _y| 1.0 / ((t - 1.0).sqrt() * (t + 1.0).sqrt()), |g, a, _y| {
                    let product = one_minus_square(g, a);
                    let product = g.neg(product);
                    reciprocal_root(g, product)
                });
            word Atanh "atanh" "inverse of tanh" ["atanh(p/4)"]
                native(libm::atanh, Dd::atanh, |t, _y| 1.0 / ((1.0 - t) * (1.0 + t)), |g, a, _y| {
                    let bottom = one_minus_square(g, a);
                    reciprocal(g, bottom)
                });
            word Erf "erf" "error function" ["erf(p)"]
                native(libm::erf, Dd::erf, |t, _y| bell(t), |g, a, _y| bell_node(g, 1.0, a));
            word Erfc "erfc" "1 - erf" ["erfc(p)"]
                native(libm::erfc, Dd::erfc, |t, _y| -bell(t), |g, a, _y| bell_node(g, -1.0, a));
            word Sinc "sinc" "sin(t)/t, 1 at 0" ["sinc(p)", "Derivative_sinc(p)"]
                native(sinc, |x: Dd| x.sinc_derivative(0), |t, _y| sinc_derivative(1, t), |g, a, _y| {
                    apply(g, MathFn1::SincFirst, a)
                });
            inner SincFirst "sinc_first" "first derivative of sinc, 0 at 0" []
                native(sinc_first, |x: Dd| x.sinc_derivative(1), |t, _y| sinc_derivative(2, t), |g, a, _y| {
                    apply(g, MathFn1::SincSecond, a)
                });
            inner SincSecond "sinc_second" "second derivative of sinc, -1/3 at 0" []
                native(sinc_second, |x: Dd| x.sinc_derivative(2), |t, _y| sinc_derivative(3, t), third_of_sinc);
            word Softplus "softplus" "log(1 + exp(t)): a smooth pos_part, accurate for all t" ["softplus(p)"]
                formula(|t| {
                    // max(t, 0) + log(1 + exp(-|t|)): nothing overflows, nothing cancels
                    let zero = T::from_f64(0.0);
                    let part = t.abs().neg().call1(MathFn1::Exp).call1(MathFn1::Log1p);
                    if t.compare(Compare::Less, zero) { part } else { t.add(part) }
                }, |g, a, _y| apply(g, MathFn1::Logistic, a));
            word Logistic "logistic" "1/(1 + exp(-t)): a smooth Heaviside, accurate for all t" ["logistic(p)"]
                formula(|t| {
                    let (zero, one) = (T::from_f64(0.0), T::from_f64(1.0));
                    let small = t.abs().neg().call1(MathFn1::Exp);
                    let top = if t.compare(Compare::Less, zero) { small } else { one };
                    top.div(one.add(small))
                }, |g, a, y| {
                    // logistic(t) logistic(-t) keeps the digits that 1 - logistic(t) loses for large t
                    let minus = g.neg(a);
                    let other = apply(g, MathFn1::Logistic, minus);
                    g.mul_components(y, other)
                });
        }
    };
}

macro_rules! is_word {
    (word) => {
        true
    };
    (inner) => {
        false
    };
}

macro_rules! names {
    ($($kind:ident $variant:ident $name:literal $doc:literal [$($sample:literal),*] $form:ident($($value:tt)*);)*) => {
        /// Names in order of the rows, and whether the language has them.
        const NAMES: &[(&str, bool)] = &[$(($name, is_word!($kind))),*];
    };
}

scalar_functions!(names);

/// The names of the smooth functions of one number that the language has, in order of their rows.
pub(crate) fn scalar_function_names() -> impl Iterator<Item = &'static str> {
    NAMES.iter().filter(|(_, word)| *word).map(|(name, _)| *name)
}
