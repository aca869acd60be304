//! A motion and a pressure: flow, and bodies that hardly change their volume; fields that are carried along.

use super::{
    Draw,
    meshes::Body,
    scenes::{coefficient, degree, held, rule, vector, zero},
};

/// What holds a motion, without what a pressure would not be determined beside.
fn held_with_pressure(draw: &mut Draw, body: &Body) -> String {
    held(draw, body)
        .replace("fix u.Normal = 0 on side\n", "")
        .replace("fix u.Normal = 0.01 on left, right\n", "fix u.Normal = 0.01 on left\n")
}

/// A nearly incompressible body, of small or of finite strain.
pub(super) fn incompressible(draw: &mut Draw, body: &Body) -> String {
    let (f, d) = (body.family, body.dim);
    let p = if d == 2 { 2 + draw.below(2) } else { 2 };
    let compliance = draw.of(&["1e-3", "1e-5", "0.02*k"]);
    let law = match draw.below(4) {
        0 => format!(
            "def F = Id({d}) + Grad_u\nterm body on all : (80*k*(F - Inv(F)') - p*Det(F)*Inv(F)'):Grad_Test_u\n\
             term volume on all : -(Det(F) - 1 + {compliance}*p)*Test_p\n"
        ),
        1 => format!(
            "def F = Id({d}) + Grad_u\nterm body on all : (80*k*(F - Inv(F)') - p*Det(F)*Inv(F)'):Grad_Test_u\n\
             term volume on all : (log(Det(F)) + {compliance}*p)*Test_p\n"
        ),
        _ => format!(
            "term body on all : 160*k*Sym(Grad_u):Sym(Grad_Test_u) - p*Div_Test_u\n\
             term volume on all : -(Div_u + {compliance}*p)*Test_p\n"
        ),
    };
    let wall = draw.of(&["", "", "term wall on right : 2e3*pos_part(u.Normal - 0.001)*(Test_u.Normal)\n"]);
    coefficient(draw, "k", body)
        + &format!(
            "unknown u : vector {f}{p}\nunknown p : scalar {f}{}\n{law}{wall}measure p_sum = integral(p) on all\n{}",
            p - 1,
            held_with_pressure(draw, body)
        )
}

/// A scalar that is carried along and mixes.
pub(super) fn carried(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body);
    let wind = vector(body, ["3", "1 - 2*x", "0.5"]);
    let source = draw.of(&["0", "0.5*u^3", "2*abs(u)*u", "pos_part(u - 0.3)"]);
    let storage = draw.of(&["", "", "term storage on all : Dot_u*Test_u\n"]);
    let way = draw.of(&["(W.Grad_u)*Test_u", "-u*(W.Grad_Test_u)", "(1 + u)*(W.Grad_u)*Test_u"]);
    coefficient(draw, "k", body)
        + &rule(draw, 2 * p)
        + &format!(
            "unknown u : scalar {}{p}\nterm flow on all : k*Grad_u.Grad_Test_u\nterm wind on all : {}\n\
             term burns on all : {source}*Test_u\n{storage}fix u = 0.5*py on left\nload u = (1 + 0.3*t)*(1 + y) on all\n\
             measure u_sum = integral(u) on all\nmeasure u_size = integral(u*u) on right\nmeasure r_left = reaction(u) on left\n",
            body.family,
            way.replace('W', &wind)
        )
}

/// Flow that carries heat, which makes it thinner and lifts it.
pub(super) fn convection(draw: &mut Draw, body: &Body) -> String {
    let f = body.family;
    let thinner = draw.of(&["1", "1/(1 + 0.5*T^2)", "exp(-0.5*T)"]);
    let inertia =
        draw.of(&["", "term inertia on all : 0.5*(Grad_u*u).Test_u\n", "term starts on all : 0.5*Dot_u.Test_u\n"]);
    coefficient(draw, "k", body)
        + &format!(
            "unknown u : vector {f}2\nunknown p : scalar {f}1\nunknown T : scalar {f}1\n\
             term viscous on all : 2*k*{thinner}*Sym(Grad_u):Sym(Grad_Test_u)\n\
             term volume on all : -p*Div_Test_u - Div_u*Test_p\n{inertia}\
             term heat on all : Grad_T.Grad_Test_T + 0.5*(u.Grad_T)*Test_T\nterm lift on all : -T*Test_u(2)\n\
             fix u = {} on left\nfix T = py on left\nfix T = 0.3 on right\nmeasure u_sum = integral(u.u) on all\n\
             measure p_sum = integral(p) on all\nmeasure t_sum = integral(T) on all\nmeasure q_left = reaction(T) on left\n",
            zero(body)
        )
}
