//! Projections and the operators of contact.

use wfl::Diagnostic;

use crate::{
    build::{Builder, Call},
    graph::{ExprId, Graph},
    ir::Compare,
    ops::{OpDef, scalar::pos_part, tensor::deviator},
    types::Shape,
};

pub(super) const TABLE: &[OpDef] = &[
    OpDef {
        name: "Ball_projection",
        least: 2,
        most: 2,
        usage: "Ball_projection(v, r)",
        doc: "projection on the ball of radius r; 0 for r < 0; norm = r sticks, also at v = 0, r = 0",
        samples: &[
            "Ball_projection(u, 0.4).w",
            "Ball_projection(u, 40).w",
            "Ball_projection(u, 0.3+0.1*q).w",
            "Ball_projection(Grad_u, 0.5):B",
        ],
        build: |b, c| {
            let (_, v) = b.plain_argument(c, 0)?;
            let r = b.scalar_argument(c, 1)?;
            Some(b.graph.ball(v, r))
        },
        entrywise: None,
    },
    OpDef {
        name: "Von_Mises_projection",
        least: 2,
        most: 2,
        usage: "Von_Mises_projection(tau, s)",
        doc: "the deviator projected on the ball of radius s, the mean kept; the tie is elastic",
        samples: &["Von_Mises_projection(Grad_u, 0.5):B", "Von_Mises_projection(Grad_u, 50):B"],
        build: |b, c| {
            let m = b.square_argument(c, 0, false)?;
            let r = b.scalar_argument(c, 1)?;
            let g = &mut b.graph;
            let dev = deviator(g, m);
            let mean = g.sub(m, dev);
            let projected = g.ball(dev, r);
            Some(g.add(mean, projected))
        },
        entrywise: None,
    },
    OpDef {
        name: "Transformed_unit_vector",
        least: 2,
        most: 2,
        usage: "Transformed_unit_vector(Grad_u, n)",
        doc: "the normal carried by the deformation: (Id + Grad_u)^-T n, normalised",
        samples: &["Transformed_unit_vector(0.1*Grad_u, [3;4]/5).w"],
        build: |b, c| {
            let grad = b.small_matrix(c)?;
            let (text, n) = b.plain_argument(c, 1)?;
            let shape = b.graph.shape(n);
            if shape != Shape::vector(b.graph.shape(grad).size(0)) {
                return b.bad_argument(c, 1, text, "a vector as long as the matrix", shape);
            }
            let g = &mut b.graph;
            let id = g.identity(shape.size(0));
            let f = g.add(id, grad);
            let inverse = g.inverse(f);
            let carried = g.contract(n, inverse, &[(0, 0)]);
            Some(g.unit(carried))
        },
        entrywise: None,
    },
    OpDef {
        name: "Coulomb_friction_coupled_projection",
        least: 6,
        most: 6,
        usage: "Coulomb_friction_coupled_projection(lambda, n, Vs, g, f, r)",
        doc: "-pos_part(-(lambda.n + r g)) n plus the tangential part of lambda - r Vs projected on the ball of radius min(f3 + f1 pos_part(-(lambda.n + r g)), f2); ties are contact and stick",
        samples: &[
            "Coulomb_friction_coupled_projection(u, [0;1], w, p, [0.3], 1.5).[1;2]",
            "Coulomb_friction_coupled_projection(u, [0;1], w, p-3, [0.3;0.8;0.1], 1.5).[1;2]",
        ],
        build: coulomb,
        entrywise: None,
    },
];

fn coulomb(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
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
        let d = Diagnostic::new("E108", "the friction coefficients are 1 to 3 numbers: [f1], [f1; f2] or [f1; f2; f3]");
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
