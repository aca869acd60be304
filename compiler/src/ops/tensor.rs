//! Tensor functions: linear re-indexing (test functions allowed) and invariants of matrices.

use wfl::{Code, Diagnostic, ast::Expr};

use crate::{
    build::{Builder, Call},
    graph::{ExprId, Graph, times},
    math::MatrixFn,
    types::{MAX_RANK, Shape},
};

/// `Id(n)`.
pub(super) fn identity(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let text = b.argument_text(c, 0)?;
    let n = b.whole_number(text, "the size of `Id`")?;
    if n == 0 || n > 100 {
        let d = Diagnostic::new(Code::E108, "the size of `Id` is 1 to 100");
        return b.report(d, text, n.to_string());
    }
    Some(if n == 1 { b.graph.number(1.0) } else { b.graph.identity(n) })
}

/// `Skew(M)`.
pub(super) fn skew(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let m = b.linear_square_argument(c, 0)?;
    let t = b.graph.transpose(m);
    let s = b.graph.sub(m, t);
    Some(times(&mut b.graph, 0.5, s))
}

/// `Swap_indices(t, i, j)`.
pub(super) fn swap_indices(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let (text, t) = b.argument(c, 0)?;
    let [i, j] = indices(b, c, t, [1, 2], text)?;
    let mut perm: Vec<usize> = (0..b.graph.shape(t).rank()).collect();
    perm.swap(i, j);
    Some(b.graph.permute(t, &perm))
}

/// `Index_move_last(t, i)`.
pub(super) fn move_last(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let (text, t) = b.argument(c, 0)?;
    let [i] = indices(b, c, t, [1], text)?;
    let mut perm: Vec<usize> = (0..b.graph.shape(t).rank()).filter(|k| *k != i).collect();
    perm.push(i);
    Some(b.graph.permute(t, &perm))
}

/// v/sqrt(|v|^2 + eps^2)
pub(super) fn regularised(g: &mut Graph, v: ExprId, eps: ExprId) -> ExprId {
    // the norm of (|v|, eps): safe against overflow like every norm
    let length = g.norm(v);
    let both = g.stack(Shape::vector(2), &[length, eps]);
    let below = g.norm(both);
    g.divide(v, below)
}

/// M - Trace(M)/n Id
pub(super) fn deviator(g: &mut Graph, m: ExprId) -> ExprId {
    let n = g.shape(m).size(0);
    let trace = g.trace(m, 0, 1);
    #[expect(clippy::cast_precision_loss, reason = "matrix sizes are small")]
    let mean = times(g, 1.0 / n as f64, trace);
    let id = g.identity(n);
    let sphere = g.scale(mean, id);
    g.sub(m, sphere)
}

/// (M + M')/2
pub(super) fn symmetric(g: &mut Graph, m: ExprId) -> ExprId {
    let t = g.transpose(m);
    let s = g.add(m, t);
    times(g, 0.5, s)
}

/// Matrix product.
pub(super) fn product(g: &mut Graph, a: ExprId, b: ExprId) -> ExprId {
    g.contract(a, b, &[(1, 0)])
}

pub(super) fn second_invariant(g: &mut Graph, m: ExprId) -> ExprId {
    let trace = g.trace(m, 0, 1);
    let square = g.scale(trace, trace);
    let t = g.transpose(m);
    let mixed = g.inner(m, t);
    let difference = g.sub(square, mixed);
    times(g, 0.5, difference)
}

/// value times Det(m) to the power given
pub(super) fn scaled_by_det(g: &mut Graph, value: ExprId, m: ExprId, power: f64) -> ExprId {
    let det = g.det(m);
    let exponent = g.number(power);
    let factor = g.map2(crate::math::MathFn2::Pow, det, exponent);
    g.scale(factor, value)
}

pub(super) fn matrix_function(b: &mut Builder<'_>, c: &Call<'_>, f: MatrixFn) -> Option<ExprId> {
    let m = b.square_argument(c, 0)?;
    let n = b.graph.shape(m).size(0);
    if n > 3 {
        let text = b.argument_text(c, 0)?;
        return b.bad_argument(c, 0, text, "a matrix of size 3 at most", b.graph.shape(m));
    }
    Some(b.graph.matrix(f, m))
}

pub(super) fn reshape(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let (text, t) = b.argument(c, 0)?;
    let mut sizes = Vec::new();
    for k in 1..c.args.len() {
        let size = b.argument_text(c, k)?;
        sizes.push(b.whole_number(size, "a size")?);
    }
    let found = b.graph.shape(t);
    let Some(shape) = Shape::new(&sizes) else {
        let d = Diagnostic::new(Code::E110, format!("a tensor has {MAX_RANK} indices at most, each of size 1 or more"));
        return b.report(d, c.expr, "");
    };
    if shape.len() != found.len() {
        let d = Diagnostic::new(
            Code::E108,
            format!("`Reshape` keeps the number of entries: {} asked, {} there", shape.len(), found.len()),
        );
        return b.report(d, text, found.to_string());
    }
    Some(b.graph.reshape(t, shape))
}

/// Literal indices of `t` (from 1 in the text, from 0 here).
fn indices<const N: usize>(
    b: &mut Builder<'_>,
    c: &Call<'_>,
    t: ExprId,
    which: [usize; N],
    whole: &Expr,
) -> Option<[usize; N]> {
    let shape = b.graph.shape(t);
    let mut out = [0; N];
    for (slot, k) in out.iter_mut().zip(which) {
        let text = b.argument_text(c, k)?;
        let i = b.whole_number(text, "an index")?;
        if i < 1 || i > shape.rank() {
            let d = Diagnostic::new(Code::E104, format!("index {i} is out of range"));
            let d = b.at(d, text, format!("a {shape} has {} indices", shape.rank()));
            return b.report(d, whole, "");
        }
        *slot = i - 1;
    }
    Some(out)
}

pub(super) fn contract(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let (ta, a) = b.argument(c, 0)?;
    let fits = |b: &mut Builder<'_>, x: usize, y: usize| {
        if x == y {
            return Some(());
        }
        let d = Diagnostic::new(Code::E108, format!("`Contract` needs indices of equal size, found {x} and {y}"));
        b.report(d, c.expr, "")
    };
    let sa = b.graph.shape(a);
    match c.args.len() {
        3 => {
            let [i, j] = indices(b, c, a, [1, 2], ta)?;
            if i == j {
                let d = Diagnostic::new(Code::E104, "`Contract` needs two different indices");
                return b.report(d, c.expr, "");
            }
            fits(b, sa.size(i), sa.size(j))?;
            Some(b.graph.trace(a, i.min(j), i.max(j)))
        }
        4 => {
            let (tb, other) = b.argument(c, 2)?;
            let [i] = indices(b, c, a, [1], ta)?;
            let [j] = indices(b, c, other, [3], tb)?;
            two_factors(b, c, a, other)?;
            fits(b, sa.size(i), b.graph.shape(other).size(j))?;
            Some(b.graph.contract(a, other, &[(i, j)]))
        }
        6 => {
            let (tb, other) = b.argument(c, 3)?;
            let [i, j] = indices(b, c, a, [1, 2], ta)?;
            let [k, l] = indices(b, c, other, [4, 5], tb)?;
            two_factors(b, c, a, other)?;
            let sb = b.graph.shape(other);
            fits(b, sa.size(i), sb.size(k))?;
            fits(b, sa.size(j), sb.size(l))?;
            Some(b.graph.contract(a, other, &[(i, k), (j, l)]))
        }
        n => {
            let d = Diagnostic::new(Code::E105, format!("`Contract` takes 3, 4 or 6 arguments, {n} given"));
            b.report(d, c.expr, "Contract(A, i, j), Contract(A, i, B, j) or Contract(A, i, j, B, k, l)")
        }
    }
}

/// Two factors of a product: one test function at most, and room for the indices.
fn two_factors(b: &mut Builder<'_>, c: &Call<'_>, a: ExprId, other: ExprId) -> Option<()> {
    let (x, y) = (b.graph.arity(a), b.graph.arity(other));
    if (x.test && y.test) || (x.trial && y.trial) {
        let d = Diagnostic::new(Code::E301, "a term must be linear in the test functions");
        return b.report(d, c.expr, "two test functions in one product");
    }
    let taken = if c.args.len() == 6 { 4 } else { 2 };
    if b.graph.shape(a).rank() + b.graph.shape(other).rank() - taken > MAX_RANK {
        let d = Diagnostic::new(Code::E110, format!("a tensor has {MAX_RANK} indices at most"));
        return b.report(d, c.expr, "");
    }
    Some(())
}

pub(super) fn cross(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let (tv, v) = b.argument(c, 0)?;
    let (tw, w) = b.argument(c, 1)?;
    for (k, text, value) in [(0, tv, v), (1, tw, w)] {
        let shape = b.graph.shape(value);
        if shape != Shape::vector(3) {
            return b.bad_argument(c, k, text, "a vector of 3 components", shape);
        }
    }
    two_factors(b, c, v, w)?;
    let g = &mut b.graph;
    let mut parts = Vec::with_capacity(3);
    for k in 0..3 {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let [vi, vj, wi, wj] = [(v, i), (v, j), (w, i), (w, j)].map(|(x, k)| g.entry(x, k));
        let first = g.scale(vi, wj);
        let second = g.scale(vj, wi);
        parts.push(g.sub(first, second));
    }
    Some(g.stack(Shape::vector(3), &parts))
}
