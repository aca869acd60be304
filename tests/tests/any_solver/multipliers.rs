//! Lagrange multipliers on interfaces with contact and friction, unknowns that are one number, and integral constraints.

use super::{
    Draw,
    meshes::Body,
    scenes::{coefficient, degree, rule, stress, vector, zero},
};

/// Two bodies `u` and `v` that meet at px = 1, their terms, and what holds and moves them. `closing` is how far the far one is
/// moved towards the other, with a tilt that opens a part of some interfaces.
pub(super) fn two_sides(draw: &mut Draw, body: &Body, degrees: [usize; 2]) -> String {
    let (f, [p, q]) = (body.family, degrees);
    let moved = draw.of(&["-0.03 + 0.02*py", "-0.02 + 0.05*py", "0.01*py - 0.02*t"]);
    let aside = draw.of(&["0.01", "0.03*(1 + py)", "0.02*t"]);
    let rollers = if draw.chance(0.3) { "fix u.Normal = 0 on ends_of_u\n" } else { "" };
    format!(
        "use \"contact\"\n{}{}region near = cells where px < 1\nregion far = all - near\n\
         region glue = interface from near to far\nregion ends_of_u = side & faces of near\n\
         unknown u : vector {f}{p} on near\nunknown v : vector {f}{q} on far\n\
         term of_u on near : sigma(u):Grad_Test_u\nterm of_v on far : 2*sigma(v):Grad_Test_v\n\
         fix u = {} on left\nfix v = (1 + 0.3*t)*{} on right\n{rollers}load v = {} on far\n\
         measure u_sum = integral(u(1)) on near\nmeasure u_v = max(Norm(v)) on far\n\
         measure r_left = reaction(u(1)) on left\nmeasure r_right = reaction(v(2)) on right\n",
        coefficient(draw, "k", body),
        stress(body, "k"),
        zero(body),
        vector(body, [moved, aside, "0.005"]),
        vector(body, ["0.3", "-1", "0.2"]),
    )
}

/// What becomes of multipliers at the ends of an interface.
fn ends(draw: &mut Draw) -> &'static str {
    // with `keep` equations may be there twice
    draw.of(&["", "", " with crosspoints=follow"])
}

/// Contact and ties whose tractions are unknowns.
pub(super) fn augmented(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body).min(2);
    let q = if draw.chance(0.7) { p } else { degree(draw, body).min(2) };
    let (f, ends) = (body.family, ends(draw));
    let gamma = draw.of(&["300", "1e3", "1e4"]);
    // nodes of a rule of degree 2 have no weight at the corners of triangles
    let is_nodal = p == 1 && draw.chance(0.6);
    let nodal = if is_nodal { "quadrature on glue vertex\n" } else { "" };
    let law = match draw.below(5) {
        0 => format!("term law on glue : augmented(u, v, l, {gamma}, 0.3)\n"),
        1 => format!(
            "state slid : vector on glue := augmented_slip(u, v, l, slid, {gamma}, 0.3)\n\
             term law on glue : augmented_sliding(u, v, l, slid, {gamma}, 0.3)\n"
        ),
        2 => format!("term law on glue : augmented(u, v, l, {gamma}, 0)\n"),
        3 => format!("term law on glue : augmented_with_gap(u, v, l, 0.004*py, {gamma}, 0.2)\n"),
        _ => format!(
            "def Pn = {gamma}*(jump(u,v).Normal) - l.Normal\n\
             def force = pos_part(Pn)*Normal + Ball_projection({gamma}*tang(jump(u,v)) - tang(l), 0.7)\n\
             term law on glue : force.jump(Test_u,Test_v) - 1/{gamma}*(l + force).Test_l\n"
        ),
    };
    two_sides(draw, body, [p, q])
        + &format!(
            "multiplier l : vector {f}{p} on glue{ends}\n{nodal}{law}measure l_sum = integral(l.Normal) on glue\n"
        )
}

/// Ties by multipliers of several degrees.
pub(super) fn tied(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body).min(3);
    let (f, ends) = (body.family, ends(draw));
    let own = if p > 1 && draw.chance(0.5) { p - 1 } else { p };
    let law = match draw.below(3) {
        0 if p > 1 => format!(
            "multiplier l : scalar D{f}{} on glue{ends}\nterm tie on glue : l*(jump(Test_u,Test_v).Normal) \
             + (jump(u,v).Normal)*Test_l + 90*tang(jump(u,v)).tang(jump(Test_u,Test_v))\n\
             measure l_sum = integral(l) on glue\n",
            p - 2
        ),
        1 => format!(
            "multiplier l : scalar {f}{own} on glue{ends}\nterm tie on glue : l*(jump(Test_u,Test_v).Normal) \
             + (jump(u,v).Normal - 0.002*py)*Test_l + 90*tang(jump(u,v)).tang(jump(Test_u,Test_v))\n\
             measure l_sum = integral(l) on glue\n"
        ),
        _ => format!(
            "multiplier l : vector {f}{own} on glue{ends}\nterm tie on glue : l.jump(Test_u,Test_v) + jump(u,v).Test_l\n\
             measure l_sum = integral(l.Normal) on glue\n"
        ),
    };
    rule(draw, 2 * p) + &two_sides(draw, body, [p, p]) + &law
}

/// Nitsche's method, with friction that does or does not remember.
pub(super) fn nitsche(draw: &mut Draw, body: &Body) -> String {
    let (p, q) = (degree(draw, body).min(3), degree(draw, body).min(3));
    let gamma = draw.of(&["2e4", "1e5"]);
    let theta = draw.of(&["-1", "0", "1"]);
    let law = draw.of(&[
        "term law on glue : nitsche(u, v, G, T, 0.3)\n",
        "term law on glue : nitsche_with_gap(u, v, 0.004*py, G, T, 0)\n",
        "state slid : vector on glue := nitsche_slip(u, v, slid, G, 0.3)\n\
         term law on glue : nitsche_sliding(u, v, slid, G, T, 0.3)\n",
        "state slid : vector on glue := penalty_slip(u, v, slid, G, 0.3)\nterm law on glue : penalty_sliding(u, v, slid, G, 0.3)\n",
    ]);
    two_sides(draw, body, [p, q]) + &law.replace("G,", &format!("{gamma},")).replace("T,", &format!("{theta},"))
}

/// A plate that moves as a whole, under a force or on a spring.
pub(super) fn plate(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body).min(3);
    let f = body.family;
    let spring = draw.of(&["0*d", "300*d", "300*d + 4e4*d^3", "500*pos_part(d - 0.01)"]);
    let plate = match draw.below(3) {
        0 => format!(
            "multiplier l : scalar {f}{p} on right\nterm contact on right : l*(Test_u(1) - Test_d) + (u(1) - d)*Test_l\n\
             measure l_sum = integral(l) on right\n"
        ),
        1 => "term contact on right : 1e3*(u(1) - d)*(Test_u(1) - Test_d)\n".to_owned(),
        _ => "term contact on right : 1e3*pos_part(u(1) - d - 0.01*py)*(Test_u(1) - Test_d)\n\
              term held on global : 20*d*Test_d\n"
            .to_owned(),
    };
    let law = match draw.below(3) {
        0 => format!(
            "def F = Id({0}) + Grad_u\nterm body on all : k*(80*(F - Inv(F)') + 60*log(Det(F))*Inv(F)'):Grad_Test_u\n",
            body.dim
        ),
        _ => "term body on all : sigma(u):Grad_Test_u\n".to_owned(),
    };
    coefficient(draw, "k", body)
        + &rule(draw, 2 * p)
        + &stress(body, "k")
        + &format!(
            "unknown u : vector {f}{p}\nunknown d : scalar global\n{law}{plate}\
             term weight on global : ({spring} + 5*(1 + 0.3*t))*Test_d\nfix u = {} on left\nload u = {} on all\n\
             measure u_sum = integral(u(1)) on all\nmeasure d_now = max(d) on global\nmeasure r_left = reaction(u(1)) on left\n",
            zero(body),
            vector(body, ["1", "-2", "0.4"])
        )
}

/// What is held by integrals alone: a mean value, no translation and no rotation, a volume.
pub(super) fn means(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body).min(3);
    let f = body.family;
    match draw.below(3) {
        0 => {
            coefficient(draw, "k", body)
                + &rule(draw, 2 * p)
                + &format!(
                    "unknown u : scalar {f}{p}\nunknown m : scalar global\nterm flow on all : k*Grad_u.Grad_Test_u\n\
                     term mean on all : m*Test_u + (u - 0.2)*Test_m\nload u = (1 + 0.3*t)*(1 + x*y) on all\n\
                     load u = 2*y on right\nmeasure u_sum = integral(u*u) on all\nmeasure m_now = max(m) on global\n"
                )
        }
        1 if body.dim == 2 => {
            coefficient(draw, "k", body)
                + &stress(body, "k")
                + &format!(
                    "unknown u : vector {f}{p}\nunknown a : scalar global\nunknown b : scalar global\nunknown c : scalar global\n\
                     def turn(w) = x*w(2) - y*w(1)\nterm body on all : sigma(u):Grad_Test_u\n\
                     term ahead on all : a*Test_u(1) + u(1)*Test_a\nterm across on all : b*Test_u(2) + (u(2) - 0.01*t)*Test_b\n\
                     term around on all : c*turn(Test_u) + turn(u)*Test_c\nload u = (1 + 0.3*t)*[1 + y, -x] on all\n\
                     load u = [2*y, 1] on right\nmeasure u_sum = integral(u.u) on all\nmeasure m_a = max(a) on global\n\
                     measure m_c = max(c) on global\n"
                )
        }
        _ => {
            coefficient(draw, "k", body)
                + &format!(
                    "unknown u : vector {f}{p}\nunknown m : scalar global\ndef F = Id({0}) + Grad_u\ndef C = Det(F)*Inv(F)'\n\
                     term body on all : k*(80*(F - Inv(F)') + 60*log(Det(F))*Inv(F)'):Grad_Test_u\n\
                     term volume on all : -m*C:Grad_Test_u - (Det(F) - 1 - 0.02*(1 + 0.3*t))*Test_m\nfix u = {1} on left\n\
                     load u = {2} on all\nmeasure u_sum = integral(u(2)) on all\nmeasure m_now = max(m) on global\n\
                     measure r_left = reaction(u(1)) on left\n",
                    body.dim,
                    zero(body),
                    vector(body, ["1", "-2", "0.4"])
                )
        }
    }
}
