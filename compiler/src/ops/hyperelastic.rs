//! Hyperelastic laws: potential and second Piola-Kirchhoff stress of a displacement gradient, and their kinematics.
//!
//! A law is its potential W(i1, i2, i3) in the invariants of C = F'F, as GetFEM has it (strain_energy in
//! src/getfem_nonlinear_elasticity.cc of GetFEM; user manual, "Finite strain elasticity"). The stress is 2 dW/dC,
//! derived symbolically: 2 (W_1 Id + W_2 (i1 Id - C) + W_3 cof C). GetFEM registers the stress under two names,
//! `_PK2` and the older `_sigma`: both are the second Piola-Kirchhoff stress; `Cauchy_stress_from_PK2` turns it.
//! `Plane_Strain_` puts a 2 by 2 gradient into three dimensions with no strain across.
//! Saint-Venant-Kirchhoff is written in the strain E, not in invariants: near rest its energy would lose every digit.

use wfl::{Code, Diagnostic};

use crate::{
    build::{Builder, Call},
    derive::cofactor,
    graph::{ExprId, Function1, Graph, times},
    math::{MathFn1, MathFn2},
    ops::{formula::Formula, tensor::product},
    types::Shape,
};

/// What a call asks of a law.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Wanted {
    Potential,
    Stress,
}

/// How a law is written.
#[derive(Clone, Copy)]
pub(super) enum Law {
    /// lambda/2 tr(E)^2 + mu E:E, any dimension.
    SaintVenantKirchhoff,
    /// W of [i1, i2, i3] and the parameters.
    Invariants {
        potential: fn(&mut Graph, [ExprId; 3], &[ExprId]) -> ExprId,
        /// Defined in three dimensions only (GetFEM refuses others).
        three_d: bool,
    },
}

pub(super) const BLATZ_KO: Law = Law::Invariants { potential: blatz_ko, three_d: true };
pub(super) const CIARLET_GEYMONAT: Law = Law::Invariants { potential: ciarlet_geymonat, three_d: false };
pub(super) const MOONEY: Law =
    Law::Invariants { potential: |g, i, p| mooney(g, i, p[0], Some(p[1]), None), three_d: true };
pub(super) const COMPRESSIBLE_MOONEY: Law =
    Law::Invariants { potential: |g, i, p| mooney(g, i, p[0], Some(p[1]), Some(p[2])), three_d: true };
pub(super) const NEO: Law = Law::Invariants { potential: |g, i, p| mooney(g, i, p[0], None, None), three_d: true };
pub(super) const COMPRESSIBLE_NEO: Law =
    Law::Invariants { potential: |g, i, p| mooney(g, i, p[0], None, Some(p[1])), three_d: true };
pub(super) const BONET: Law = Law::Invariants { potential: bonet, three_d: true };
pub(super) const CIARLET: Law = Law::Invariants { potential: ciarlet, three_d: true };

pub(super) fn cauchy_green(
    b: &mut Builder<'_>,
    c: &Call<'_>,
    f: fn(&mut Graph, ExprId, ExprId) -> ExprId,
) -> Option<ExprId> {
    let m = b.square_argument(c, 0)?;
    let t = b.graph.transpose(m);
    Some(f(&mut b.graph, m, t))
}

/// `Green_Lagrangian(F)`, from F and its transpose.
pub(super) fn green_lagrangian(g: &mut Graph, f: ExprId, t: ExprId) -> ExprId {
    let square = product(g, t, f);
    let id = g.identity(g.shape(square).size(0));
    let strain = g.sub(square, id);
    times(g, 0.5, strain)
}

pub(super) fn cauchy_stress(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let stress = b.small_matrix(c);
    let grad = b.square_argument(c, 1);
    let (stress, grad) = (stress?, grad?);
    let (found, needed) = (b.graph.shape(grad), b.graph.shape(stress));
    if found != needed {
        let text = b.argument_text(c, 1)?;
        return b.bad_argument(c, 1, text, &format!("a {needed} like the stress"), found);
    }
    let g = &mut b.graph;
    let f = deformation(g, grad);
    let det = g.det(f);
    let first = product(g, f, stress);
    let t = g.transpose(f);
    let both = product(g, first, t);
    Some(g.divide(both, det))
}

/// Id + Grad_u
fn deformation(g: &mut Graph, grad: ExprId) -> ExprId {
    let id = g.identity(g.shape(grad).size(0));
    g.add(id, grad)
}

/// Which strains a law sees.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Strain {
    /// Those of the space of the scene.
    Full,
    /// In-plane ones, of a body that does not stretch across the plane.
    Plane,
}

pub(super) fn law_of_gradient(
    b: &mut Builder<'_>,
    c: &Call<'_>,
    law: Law,
    count: usize,
    wanted: Wanted,
    strain: Strain,
) -> Option<ExprId> {
    let grad = b.small_matrix(c);
    let parameters = parameters(b, c, count);
    let (grad, parameters) = (grad?, parameters?);
    let shape = b.graph.shape(grad);
    let size = match law {
        _ if strain == Strain::Plane => 2,
        Law::Invariants { three_d: true, .. } => 3,
        _ => shape.size(0),
    };
    if shape.size(0) != size {
        let text = b.argument_text(c, 0)?;
        let d = Diagnostic::new(Code::E108, format!("`{}` needs a matrix({size},{size}), found a {shape}", c.name));
        let d = match (strain, shape.size(0)) {
            (Strain::Full, 2) => d.help(format!("in two dimensions: Plane_Strain_{}", c.name)),
            (Strain::Plane, 3) => {
                d.help(format!("in three dimensions: {}", c.name.trim_start_matches("Plane_Strain_")))
            }
            _ => d,
        };
        return b.report(d, text, shape.to_string());
    }
    match law {
        Law::SaintVenantKirchhoff => Some(saint_venant_kirchhoff(&mut b.graph, grad, &parameters, wanted)),
        Law::Invariants { potential, .. } => {
            Some(invariant_law(&mut b.graph, grad, &parameters, potential, wanted, strain))
        }
    }
}

/// The parameters of a law as scalars.
fn parameters(b: &mut Builder<'_>, c: &Call<'_>, count: usize) -> Option<Vec<ExprId>> {
    let (text, p) = b.plain_argument(c, 1)?;
    let shape = b.graph.shape(p);
    if shape.rank() > 1 || shape.len() != count {
        let plural = if count == 1 { "" } else { "s" };
        return b.bad_argument(c, 1, text, &format!("a vector of {count} number{plural}"), shape);
    }
    Some((0..count).map(|k| b.graph.entry(p, k)).collect())
}

/// E = (Grad_u + Grad_u' + Grad_u' Grad_u)/2, which keeps its digits near rest.
fn strain(g: &mut Graph, grad: ExprId) -> ExprId {
    let t = g.transpose(grad);
    let linear = g.add(grad, t);
    let square = product(g, t, grad);
    let sum = g.add(linear, square);
    times(g, 0.5, sum)
}

fn saint_venant_kirchhoff(g: &mut Graph, grad: ExprId, p: &[ExprId], wanted: Wanted) -> ExprId {
    let e = strain(g, grad);
    let trace = g.trace(e, 0, 1);
    if wanted == Wanted::Potential {
        let square = g.scale(trace, trace);
        let half = times(g, 0.5, square);
        let volume = g.scale(p[0], half);
        let norm = g.inner(e, e);
        let shape = g.scale(p[1], norm);
        return g.add(volume, shape);
    }
    let id = g.identity(g.shape(e).size(0));
    let pressure = g.scale(p[0], trace);
    let sphere = g.scale(pressure, id);
    let double = times(g, 2.0, e);
    let shear = g.scale(p[1], double);
    g.add(sphere, shear)
}

fn invariant_law(
    g: &mut Graph,
    grad: ExprId,
    parameters: &[ExprId],
    potential: fn(&mut Graph, [ExprId; 3], &[ExprId]) -> ExprId,
    wanted: Wanted,
    strain: Strain,
) -> ExprId {
    let grad = if strain == Strain::Plane { in_space(g, grad) } else { grad };
    let f = deformation(g, grad);
    let t = g.transpose(f);
    let c = product(g, t, f);
    let i1 = g.trace(c, 0, 1);
    let square = g.scale(i1, i1);
    let norm = g.inner(c, c);
    let difference = g.sub(square, norm);
    let i2 = times(g, 0.5, difference);
    let det = g.det(f);
    let i3 = g.scale(det, det);
    let mut values = vec![i1, i2, i3];
    values.extend_from_slice(parameters);

    let mut formula = Formula::new(g, &vec![Shape::SCALAR; values.len()]);
    let symbols = formula.arguments.clone();
    let w = potential(&mut formula.graph, [symbols[0], symbols[1], symbols[2]], &symbols[3..]);
    if wanted == Wanted::Potential {
        return formula.copy(w, g, &values);
    }
    let slopes: Vec<ExprId> = (0..3)
        .map(|k| {
            let slope = formula.slope(w, k).expect("potentials are written in functions that have derivatives");
            formula.copy(slope, g, &values)
        })
        .collect();
    let stress = stress(g, c, i1, &slopes);
    if strain == Strain::Plane { in_plane(g, stress) } else { stress }
}

/// 2 (W_1 Id + W_2 (i1 Id - C) + W_3 cof C)
fn stress(g: &mut Graph, c: ExprId, i1: ExprId, slopes: &[ExprId]) -> ExprId {
    let id = g.identity(g.shape(c).size(0));
    let sphere = g.scale(i1, id);
    let rest = g.sub(sphere, c);
    let cofactors = cofactor(g, c);
    let mut total = g.scale(slopes[0], id);
    for (slope, matrix) in [(slopes[1], rest), (slopes[2], cofactors)] {
        let part = g.scale(slope, matrix);
        total = g.add(total, part);
    }
    times(g, 2.0, total)
}

/// A 2 by 2 gradient in three dimensions.
fn in_space(g: &mut Graph, grad: ExprId) -> ExprId {
    let zero = g.number(0.0);
    let [a, b, c, d] = [0, 1, 2, 3].map(|k| g.entry(grad, k));
    g.stack(Shape::matrix(3, 3), &[a, b, zero, c, d, zero, zero, zero, zero])
}

/// The in-plane part of a 3 by 3 matrix.
fn in_plane(g: &mut Graph, m: ExprId) -> ExprId {
    let parts = [0, 1, 3, 4].map(|k| g.entry(m, k));
    g.stack(Shape::matrix(2, 2), &parts)
}

// ---- potentials; i = [i1, i2, i3] ------------------------------------------------------------------------------

fn log(g: &mut Graph, a: ExprId) -> ExprId {
    g.map(Function1::Math(MathFn1::Log), a)
}

fn power(g: &mut Graph, a: ExprId, exponent: f64) -> ExprId {
    let exponent = g.number(exponent);
    g.map2(MathFn2::Pow, a, exponent)
}

/// a - number
fn less(g: &mut Graph, a: ExprId, number: f64) -> ExprId {
    let n = g.number(number);
    g.sub(a, n)
}

/// c1 (j1 - 3) + c2 (j2 - 3) + d1 (sqrt(i3) - 1)^2 with j1 = i1 i3^(-1/3), j2 = i2 i3^(-2/3)
fn mooney(g: &mut Graph, i: [ExprId; 3], c1: ExprId, c2: Option<ExprId>, d1: Option<ExprId>) -> ExprId {
    let third = power(g, i[2], -1.0 / 3.0);
    let j1 = g.scale(i[0], third);
    let first = less(g, j1, 3.0);
    let mut w = g.scale(c1, first);
    if let Some(c2) = c2 {
        let thirds = power(g, i[2], -2.0 / 3.0);
        let j2 = g.scale(i[1], thirds);
        let second = less(g, j2, 3.0);
        let part = g.scale(c2, second);
        w = g.add(w, part);
    }
    if let Some(d1) = d1 {
        let root = g.map(Function1::Sqrt, i[2]);
        let volume = less(g, root, 1.0);
        let square = g.scale(volume, volume);
        let part = g.scale(d1, square);
        w = g.add(w, part);
    }
    w
}

/// mu/2 (i1 - 3 - log i3)
fn neo_hookean_shear(g: &mut Graph, i: [ExprId; 3], mu: ExprId) -> ExprId {
    let logarithm = log(g, i[2]);
    let first = less(g, i[0], 3.0);
    let sum = g.sub(first, logarithm);
    let half = times(g, 0.5, mu);
    g.scale(half, sum)
}

/// + lambda/8 (log i3)^2
fn bonet(g: &mut Graph, i: [ExprId; 3], p: &[ExprId]) -> ExprId {
    let shear = neo_hookean_shear(g, i, p[1]);
    let logarithm = log(g, i[2]);
    let square = g.scale(logarithm, logarithm);
    let eighth = times(g, 0.125, p[0]);
    let volume = g.scale(eighth, square);
    g.add(shear, volume)
}

/// + lambda/4 (i3 - 1 - log i3)
fn ciarlet(g: &mut Graph, i: [ExprId; 3], p: &[ExprId]) -> ExprId {
    let shear = neo_hookean_shear(g, i, p[1]);
    let logarithm = log(g, i[2]);
    let first = less(g, i[2], 1.0);
    let sum = g.sub(first, logarithm);
    let quarter = times(g, 0.25, p[0]);
    let volume = g.scale(quarter, sum);
    g.add(shear, volume)
}

/// (a i1 + b sqrt(i3) + c i2/i3 + d)^n
fn blatz_ko(g: &mut Graph, i: [ExprId; 3], p: &[ExprId]) -> ExprId {
    let first = g.scale(p[0], i[0]);
    let root = g.map(Function1::Sqrt, i[2]);
    let second = g.scale(p[1], root);
    let ratio = g.divide(i[1], i[2]);
    let third = g.scale(p[2], ratio);
    let two = g.add(first, second);
    let three = g.add(two, third);
    let z = g.add(three, p[3]);
    g.map2(MathFn2::Pow, z, p[4])
}

/// a i1 + b i2 + c i3 - d/2 log i3 + e with b = mu/2 - a, c = lambda/4 - mu/2 + a, d = lambda/2 + mu,
/// e = -(3 (a + b) + c)
fn ciarlet_geymonat(g: &mut Graph, i: [ExprId; 3], p: &[ExprId]) -> ExprId {
    let (lambda, mu, a) = (p[0], p[1], p[2]);
    let half_mu = times(g, 0.5, mu);
    let b = g.sub(half_mu, a);
    let quarter = times(g, 0.25, lambda);
    let c = g.sub(quarter, b);
    let half_d = g.add(quarter, half_mu);
    // a + b is mu/2
    let rest = times(g, 3.0, half_mu);
    let e = g.add(rest, c);
    let logarithm = log(g, i[2]);
    let mut w = g.scale(a, i[0]);
    for (factor, value) in [(b, i[1]), (c, i[2])] {
        let part = g.scale(factor, value);
        w = g.add(w, part);
    }
    let last = g.scale(half_d, logarithm);
    w = g.sub(w, last);
    g.sub(w, e)
}
