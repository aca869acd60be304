//! Projections and the operators of contact.

use wfl::{Code, Diagnostic};

use crate::{
    build::{Builder, Call},
    compare::Compare,
    graph::{ExprId, Graph},
    ops::{scalar::pos_part, tensor::deviator},
    types::Shape,
};

/// `Von_Mises_projection(tau, s)`.
pub(super) fn von_mises(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let m = b.square_argument(c, 0)?;
    let r = b.scalar_argument(c, 1)?;
    let g = &mut b.graph;
    let dev = deviator(g, m);
    let mean = g.sub(m, dev);
    let projected = g.ball(dev, r);
    Some(g.add(mean, projected))
}

/// `Transformed_unit_vector(Grad_u, n)`.
pub(super) fn transformed_unit_vector(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let grad = b.small_matrix(c)?;
    let (text, n) = b.plain_argument(c, 1)?;
    let shape = b.graph.shape(n);
    if shape != Shape::vector(b.graph.shape(grad).size(0)) {
        return b.bad_argument(c, 1, text, "a vector as long as the matrix", shape);
    }
    Some(carried_normal(&mut b.graph, grad, n))
}

/// The direction of `(I + grad)^-T n`: a normal of the reference placement in the current one.
pub(crate) fn carried_normal(g: &mut Graph, grad: ExprId, n: ExprId) -> ExprId {
    let id = g.identity(g.shape(n).size(0));
    let f = g.add(id, grad);
    let inverse = g.inverse(f);
    let carried = g.contract(n, inverse, &[(0, 0)]);
    g.unit(carried)
}

pub(super) fn coulomb(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let (text, lambda) = b.plain_argument(c, 0)?;
    let shape = b.graph.shape(lambda);
    if shape.rank() != 1 {
        return b.bad_argument(c, 0, text, "a vector", shape);
    }
    let mut vectors = [lambda; 2];
    for (slot, k) in vectors.iter_mut().zip([1, 2]) {
        let (text, v) = b.plain_argument(c, k)?;
        if b.graph.shape(v) != shape {
            return b.bad_argument(c, k, text, &format!("a {shape}"), b.graph.shape(v));
        }
        *slot = v;
    }
    let [n, slip] = vectors;
    let gap = b.scalar_argument(c, 3)?;
    let (text, f) = b.plain_argument(c, 4)?;
    let coefficients = b.graph.shape(f).len();
    if b.graph.shape(f).rank() > 1 || coefficients > 3 {
        let d =
            Diagnostic::new(Code::E108, "the friction coefficients are 1 to 3 numbers: [f1], [f1; f2] or [f1; f2; f3]");
        return b.report(d, text, b.graph.shape(f).to_string());
    }
    let r = b.scalar_argument(c, 5)?;
    let g = &mut b.graph;
    let f: Vec<ExprId> = (0..coefficients).map(|k| g.entry(f, k)).collect();
    let normal = g.inner(lambda, n);
    let pushed = g.scale(r, gap);
    let trial = g.add(normal, pushed);
    let minus = g.neg(trial);
    let pressure = pos_part(g, minus);
    Some(coulomb_force(g, lambda, n, slip, pressure, &f, r))
}

fn coulomb_force(
    g: &mut Graph,
    lambda: ExprId,
    n: ExprId,
    slip: ExprId,
    pressure: ExprId,
    f: &[ExprId],
    r: ExprId,
) -> ExprId {
    let moved = g.scale(r, slip);
    let q = g.sub(lambda, moved);
    let along = g.inner(q, n);
    let part = g.scale(along, n);
    let tangential = g.sub(q, part);
    let mut radius = g.scale(f[0], pressure);
    if let Some(f3) = f.get(2) {
        radius = g.add(radius, *f3);
    }
    if let Some(f2) = f.get(1) {
        let below = g.compare(Compare::LessEqual, radius, *f2);
        radius = g.select(below, radius, *f2);
    }
    let friction = g.ball(tangential, radius);
    let push = g.scale(pressure, n);
    g.sub(friction, push)
}
