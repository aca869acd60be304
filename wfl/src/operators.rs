//! The operators of the language that are written as a call: one row each, and everything about an operator follows
//! from its row. Smooth functions of one number have a table of their own, `scalar_functions.rs`.
//!
//! [`operators!`](crate::operators) hands the rows to a macro of the caller. This crate takes from them the words of the
//! language and their unit rules; the compiler takes the number of arguments, the usage, the documentation, the samples
//! of the tests and the formula. Formulas are looked up where the rows are expanded: they are not compiled here. One of
//! more than a few lines is a function in a file of `compiler/src/ops`, named in the row.
//!
//! A row is `KIND "name" CALL "documentation, with the rule at a kink" UNITS, [SAMPLES] FORMULA;`
//!
//! - KIND `one`: f(t), entry by entry, `|g, a| NODE`. `two`: f(t, u), entry by entry, `|g, a, b| NODE`. Both have no CALL.
//! - KIND `call`: anything else, `|b, c| Option<NODE>` with the builder and the call; CALL is
//!   `(fewest arguments, most arguments, "usage")`.
//! - KIND `law`: a hyperelastic law, which is six words (`_potential`, `_PK2`, `_sigma`, each with `Plane_Strain_`
//!   before it too); CALL is `(number of parameters, "their names", "their values in samples")`.
//! - UNITS is a `Rule` of `units/functions.rs`.
//! - SAMPLES are expressions that the tests evaluate and differentiate, of scalar fields `p`, `q`, vector fields `u`,
//!   `w` and square matrices `A`, `B` near the identity; or `untested "why there are none"`.

/// Calls `$expand!` with the rows of all operators.
#[macro_export]
macro_rules! operators {
    ($expand:ident) => {
        $expand! {
            // of numbers, entry by entry
            one "sqr" "t times t"
                Power(Ratio::whole(2)), ["sqr(p)", "sqr(u).w"] |g, a| g.mul_components(a, a);
            one "sqrt" "square root; its derivative is infinite at 0"
                Power(Ratio::HALF), ["sqrt(4+p)"] |g, a| g.map(Function1::Sqrt, a);
            one "Heaviside" "1 for t >= 0, else 0; derivative 0"
                Pure, [untested "its derivative is 0"] |g, a| step(g, a, 1.0, 0.0);
            one "sign" "1 for t >= 0, else -1; derivative 0"
                Pure, [untested "its derivative is 0"] |g, a| step(g, a, 1.0, -1.0);
            one "abs" "absolute value; derivative 1 at 0"
                Keep, ["abs(p)"]
                |g, a| {
                    let minus = g.neg(a);
                    by_sign(g, a, a, minus)
                };
            one "pos_part" "t for t >= 0, else 0; derivative 1 at 0"
                Keep, ["pos_part(p)", "pos_part(u).w"] pos_part;
            one "neg_part" "pos_part(-t), also at 0"
                Keep, ["neg_part(p)"]
                |g, a| {
                    let minus = g.neg(a);
                    pos_part(g, minus)
                };
            one "sqr_pos_part" "pos_part squared"
                Power(Ratio::whole(2)), ["sqr_pos_part(p)"] |g, a| square(g, a, 1.0);
            one "half_sqr_pos_part" "half of pos_part squared: a potential"
                Power(Ratio::whole(2)), ["half_sqr_pos_part(p)"] |g, a| square(g, a, 0.5);
            one "sqr_neg_part" "neg_part squared"
                Power(Ratio::whole(2)), ["sqr_neg_part(p)"]
                |g, a| {
                    let minus = g.neg(a);
                    square(g, minus, 1.0)
                };
            one "half_sqr_neg_part" "half of neg_part squared"
                Power(Ratio::whole(2)), ["half_sqr_neg_part(p)"]
                |g, a| {
                    let minus = g.neg(a);
                    square(g, minus, 0.5)
                };
            two "pow" "t to the u"
                Pow, ["pow(4+p, 1.7)", "pow(4+p, q)"]
                |g, a, b| {
                    if g.shape(a).rank() == 0 { power(g, a, b) } else { pow_components(g, a, b) }
                };
            two "atan2" "angle of the point (u, t)"
                SameToPure, ["atan2(p, 4+q)"] |g, a, b| g.map2(MathFn2::Atan2, a, b);
            two "max" "the larger; of a tie the first"
                Same, ["max(p, q)", "max(u, 0.1).w"]
                |g, a, b| {
                    let mask = g.compare(Compare::LessEqual, b, a);
                    g.select(mask, a, b)
                };
            two "min" "the smaller; of a tie the first"
                Same, ["min(p, q)"]
                |g, a, b| {
                    let mask = g.compare(Compare::LessEqual, a, b);
                    g.select(mask, a, b)
                };
            two "reg_pos_part" "pos_part with a parabola on [0, eps]"
                Same, ["reg_pos_part(p, 0.3)", "reg_pos_part(p, 2+q)"] regularised_pos_part;
            call "table" (2, 3, "table(\"file.csv\", t, \"column\")")
                "the column of a file of rows, over its first column: linear between the rows, an error outside them; the \
                 column may be left out where there is one; derivative the slope of the piece, at a row of the piece that \
                 begins there, at the last row of the last piece"
                Table, [untested "it reads a file: tests/tests/tables.rs has one"] lookup;
            // of tensors
            call "Id" (1, 1, "Id(n)") "identity matrix"
                Pure, [untested "a constant"] identity;
            call "Trace" (1, 1, "Trace(M)") "sum of the diagonal"
                Keep, ["Trace(Grad_u)"]
                |b, c| {
                    let m = b.linear_square_argument(c, 0)?;
                    Some(b.graph.trace(m, 0, 1))
                };
            call "Deviator" (1, 1, "Deviator(M)") "M - Trace(M)/n Id"
                Keep, ["Deviator(Grad_u):B"]
                |b, c| {
                    let m = b.linear_square_argument(c, 0)?;
                    Some(deviator(&mut b.graph, m))
                };
            call "Sym" (1, 1, "Sym(M)") "(M + M')/2"
                Keep, ["Sym(Grad_u):B"]
                |b, c| {
                    let m = b.linear_square_argument(c, 0)?;
                    Some(symmetric(&mut b.graph, m))
                };
            call "Skew" (1, 1, "Skew(M)") "(M - M')/2"
                Keep, ["Skew(Grad_u):B"] skew;
            call "Norm" (1, 1, "Norm(v)") "Euclidean norm; derivative 0 at 0"
                Keep, ["Norm(u)", "Norm(Grad_u)"]
                |b, c| {
                    let (_, v) = b.plain_argument(c, 0)?;
                    Some(b.graph.norm(v))
                };
            call "Norm_sqr" (1, 1, "Norm_sqr(v)") "v:v"
                Power(Ratio::whole(2)), ["Norm_sqr(u)", "Norm_sqr(Grad_u)"]
                |b, c| {
                    let (_, v) = b.plain_argument(c, 0)?;
                    Some(b.graph.inner(v, v))
                };
            call "Normalized" (1, 1, "Normalized(v)") "v/|v|; value and derivative 0 at 0"
                Pure, ["Normalized(u).w"]
                |b, c| {
                    let (_, v) = b.plain_argument(c, 0)?;
                    Some(b.graph.unit(v))
                };
            call "Normalized_reg" (2, 2, "Normalized_reg(v, eps)") "v/sqrt(|v|^2 + eps^2)"
                SameToPure, ["Normalized_reg(u, 0.3).w", "Normalized_reg(u, 2+q).w"]
                |b, c| {
                    let (_, v) = b.plain_argument(c, 0)?;
                    let eps = b.scalar_argument(c, 1)?;
                    Some(regularised(&mut b.graph, v, eps))
                };
            call "Det" (1, 1, "Det(M)") "determinant"
                Det, ["Det(A)"]
                |b, c| {
                    let m = b.small_matrix(c)?;
                    Some(b.graph.det(m))
                };
            call "Inv" (1, 1, "Inv(M)") "inverse matrix"
                Power(Ratio::whole(-1)), ["Inv(A):B"]
                |b, c| {
                    let m = b.small_matrix(c)?;
                    Some(b.graph.inverse(m))
                };
            call "Expm" (1, 1, "Expm(M)") "matrix exponential"
                NeedsPure, ["Expm(A):B"] |b, c| matrix_function(b, c, MatrixFn::Expm);
            call "Logm" (1, 1, "Logm(M)") "principal matrix logarithm"
                NeedsPure, ["Logm(A):B"] |b, c| matrix_function(b, c, MatrixFn::Logm);
            call "Matrix_i2" (1, 1, "Matrix_i2(M)") "second invariant (Trace(M)^2 - Trace(M*M))/2"
                Power(Ratio::whole(2)), ["Matrix_i2(A)"]
                |b, c| {
                    let m = b.square_argument(c, 0)?;
                    Some(second_invariant(&mut b.graph, m))
                };
            call "Matrix_j1" (1, 1, "Matrix_j1(M)") "Trace(M) Det(M)^(-1/3)"
                NeedsPure, ["Matrix_j1(A)"]
                |b, c| {
                    let m = b.small_matrix(c)?;
                    let trace = b.graph.trace(m, 0, 1);
                    Some(scaled_by_det(&mut b.graph, trace, m, -1.0 / 3.0))
                };
            call "Matrix_j2" (1, 1, "Matrix_j2(M)") "Matrix_i2(M) Det(M)^(-2/3)"
                NeedsPure, ["Matrix_j2(A)"]
                |b, c| {
                    let m = b.small_matrix(c)?;
                    let i2 = second_invariant(&mut b.graph, m);
                    Some(scaled_by_det(&mut b.graph, i2, m, -2.0 / 3.0))
                };
            call "Reshape" (2, 11, "Reshape(t, i, j, ...)") "the same numbers, first index fastest, with new sizes"
                Keep, ["Reshape(Grad_u, 4).[1;2;3;4]"] reshape;
            call "Swap_indices" (3, 3, "Swap_indices(t, i, j)") "two indices exchanged"
                Keep, ["Swap_indices(Grad_u,1,2):B"] swap_indices;
            call "Index_move_last" (2, 2, "Index_move_last(t, i)") "index i moved to the end"
                Keep, ["Index_move_last(Grad_u,1):B"] move_last;
            call "Contract" (3, 6, "Contract(A, i, j), Contract(A, i, B, j) or Contract(A, i, j, B, k, l)")
                "sum over pairs of indices"
                Multiply, ["Contract(Grad_u,1,2)", "Contract(Grad_u,1,u,1).w", "Contract(Grad_u,1,2,B,2,1)"] contract;
            call "Cross_product" (2, 2, "Cross_product(v, w)") "vector product in 3-D"
                Multiply, [untested "three dimensions only"] cross;
            // projections and contact
            call "Ball_projection" (2, 2, "Ball_projection(v, r)")
                "projection on the ball of radius r; 0 for r < 0; norm = r sticks, also at v = 0, r = 0"
                Same, [
                    "Ball_projection(u, 0.4).w",
                    "Ball_projection(u, 40).w",
                    "Ball_projection(u, 0.3+0.1*q).w",
                    "Ball_projection(Grad_u, 0.5):B"
                ]
                |b, c| {
                    let (_, v) = b.plain_argument(c, 0)?;
                    let r = b.scalar_argument(c, 1)?;
                    Some(b.graph.ball(v, r))
                };
            call "Von_Mises_projection" (2, 2, "Von_Mises_projection(tau, s)")
                "the deviator projected on the ball of radius s, the mean kept; the tie is elastic"
                Same, ["Von_Mises_projection(Grad_u, 0.5):B", "Von_Mises_projection(Grad_u, 50):B"] von_mises;
            call "Transformed_unit_vector" (2, 2, "Transformed_unit_vector(Grad_u, n)")
                "the normal carried by the deformation: (Id + Grad_u)^-T n, normalised"
                Pure, ["Transformed_unit_vector(0.1*Grad_u, [3;4]/5).w"] transformed_unit_vector;
            call "Coulomb_friction_coupled_projection" (6, 6, "Coulomb_friction_coupled_projection(lambda, n, Vs, g, f, r)")
                "-pos_part(-(lambda.n + r g)) n plus the tangential part of lambda - r Vs projected on the ball of radius min(f3 + f1 pos_part(-(lambda.n + r g)), f2); ties are contact and stick"
                Coulomb, [
                    "Coulomb_friction_coupled_projection(u, [0;1], w, p, [0.3], 1.5).[1;2]",
                    "Coulomb_friction_coupled_projection(u, [0;1], w, p-3, [0.3;0.8;0.1], 1.5).[1;2]"
                ]
                coulomb;
            // finite strain: kinematics and laws
            call "Right_Cauchy_Green" (1, 1, "Right_Cauchy_Green(F)") "F'F"
                NeedsPure, ["Right_Cauchy_Green(A):B"]
                |b, c| cauchy_green(b, c, |g, f, t| product(g, t, f));
            call "Left_Cauchy_Green" (1, 1, "Left_Cauchy_Green(F)") "F F'"
                NeedsPure, ["Left_Cauchy_Green(A):B"]
                |b, c| cauchy_green(b, c, |g, f, t| product(g, f, t));
            call "Green_Lagrangian" (1, 1, "Green_Lagrangian(F)") "(F'F - Id)/2"
                NeedsPure, ["Green_Lagrangian(A):B"] |b, c| cauchy_green(b, c, green_lagrangian);
            call "Cauchy_stress_from_PK2" (2, 2, "Cauchy_stress_from_PK2(S, Grad_u)")
                "F S F'/Det(F) with F = Id + Grad_u"
                StressAndGradient, [
                    "Cauchy_stress_from_PK2(B*p, 0.1*Grad_u):B",
                    "Cauchy_stress_from_PK2(A*A', 0.1*Grad_u):B"
                ]
                cauchy_stress;
            law "Saint_Venant_Kirchhoff" (2, "[lambda; mu]", "[1.3;0.8]")
                "lambda/2 Trace(E)^2 + mu E:E"
                Law, [] Law::SaintVenantKirchhoff;
            law "Generalized_Blatz_Ko" (5, "[a; b; c; d; n]", "[0.9;0.7;1.1;0.4;1.5]")
                "(a i1 + b sqrt(i3) + c i2/i3 + d)^n"
                Law, [] BLATZ_KO;
            law "Ciarlet_Geymonat" (3, "[lambda; mu; a]", "[1.3;0.8;0.3]")
                "a i1 + (mu/2 - a) i2 + (lambda/4 - mu/2 + a) i3 - (lambda/4 + mu/2) log i3, 0 at rest"
                Law, [] CIARLET_GEYMONAT;
            law "Incompressible_Mooney_Rivlin" (2, "[c1; c2]", "[0.7;0.4]")
                "c1 (j1 - 3) + c2 (j2 - 3)"
                Law, [] MOONEY;
            law "Compressible_Mooney_Rivlin" (3, "[c1; c2; d1]", "[0.7;0.4;1.2]")
                "c1 (j1 - 3) + c2 (j2 - 3) + d1 (sqrt(i3) - 1)^2"
                Law, [] COMPRESSIBLE_MOONEY;
            law "Incompressible_Neo_Hookean" (1, "[c1]", "[0.7]")
                "c1 (j1 - 3)"
                Law, [] NEO;
            law "Compressible_Neo_Hookean" (2, "[c1; d1]", "[0.7;1.2]")
                "c1 (j1 - 3) + d1 (sqrt(i3) - 1)^2"
                Law, [] COMPRESSIBLE_NEO;
            law "Compressible_Neo_Hookean_Bonet" (2, "[lambda; mu]", "[1.3;0.8]")
                "mu/2 (i1 - 3 - log i3) + lambda/8 (log i3)^2"
                Law, [] BONET;
            law "Compressible_Neo_Hookean_Ciarlet" (2, "[lambda; mu]", "[1.3;0.8]")
                "mu/2 (i1 - 3 - log i3) + lambda/4 (i3 - 1 - log i3)"
                Law, [] CIARLET;
            // of fields and places
            call "Interpolate" (2, 2, "Interpolate(u, neighbor_element)")
                "a field, its gradient or its test function on the other side"
                Keep, [untested "needs an interface"] interpolate;
            call "Interpolate_filter" (2, 3, "Interpolate_filter(neighbor_element, e, code)")
                "e where the mapping found a point with that code (default: any but 0), 0 elsewhere; a neighbour always has code 1"
                Filter, [untested "needs an interface"] interpolate_filter;
            call "Grad" (1, 1, "Grad(e)") "symbolic gradient of an expression: one more index"
                Gradient(1), ["Grad(p*q).Grad_p", "Grad(sin(p)*u):B"]
                |b, c| {
                    let (text, value) = b.argument(c, 0)?;
                    b.gradient(text, value)
                };
            call "Hess" (1, 1, "Hess(e)") "gradient of the gradient"
                Gradient(2), [untested "the samples have fields of degree 2, and a tangent needs third derivatives"]
                hessian;
            call "Div" (1, 1, "Div(e)") "trace of the gradient"
                Gradient(1), ["Div(p*u)"] divergence;
            call "Diff" (2, 3, "Diff(e, u) or Diff(e, u, direction)")
                "symbolic derivative in a field; without a direction along Test_u"
                Diff, ["Diff(sin(u.w), u, w)", "Diff(p*p*p, p, q)"] diff;
            call "Rate" (1, 1, "Rate(e)")
                "change of e over the step over its increment: exact for what e is, across its kinks too; with `scheme backward_euler`"
                Rate, [untested "needs steps"] rate;
            call "qdim" (1, 1, "qdim(u)") "number of components of a field"
                Pure, [untested "a constant"] number_of_components;
            call "qdims" (1, 1, "qdims(u)") "sizes of a field"
                Pure, [untested "a constant"] sizes;
            call "Print" (1, 1, "Print(e)") "e itself; its values at the points of the term are shown after each step"
                Keep, [untested "its argument itself"]
                |b, c| {
                    let (_, value) = b.argument(c, 0)?;
                    Some(b.graph.print(value))
                };
        }
    };
}

macro_rules! words {
    (law $name:literal) => {
        &[
            concat!($name, "_potential"),
            concat!($name, "_PK2"),
            concat!($name, "_sigma"),
            concat!("Plane_Strain_", $name, "_potential"),
            concat!("Plane_Strain_", $name, "_PK2"),
            concat!("Plane_Strain_", $name, "_sigma"),
        ]
    };
    ($kind:ident $name:literal) => {
        &[$name]
    };
}

macro_rules! rows {
    ($($kind:ident $name:literal $(($($call:tt)*))? $doc:literal $rule:ident $(($($of:tt)*))?, [$($sample:tt)*]
        $formula:expr;)*) => {
        /// The words of each row.
        const ROWS: &[&[&str]] = &[$(words!($kind $name)),*];
    };
}

operators!(rows);

/// The words of each row, in order of the rows.
pub(crate) fn operator_rows() -> impl Iterator<Item = &'static [&'static str]> {
    ROWS.iter().copied()
}
