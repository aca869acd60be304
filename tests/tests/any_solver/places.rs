//! Where fields live and are held: bodies of revolution, faults with fluid, periodic ends, normals of curved sides.

use super::{
    Draw,
    meshes::Body,
    scenes::{coefficient, degree, rule, stress, vector, zero},
};

/// The half section of a body of revolution; in space the same terms with a weight.
pub(super) fn revolved(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body);
    let law = draw.of(&[
        "",
        "term wall on right : 2e3*r*pos_part(u(1) - 0.002)*Test_u(1)\n",
        "def turn = 0.3*u(1)\nterm spring on all : 5*r*(turn + turn^3)*Test_u(1)\n",
    ]);
    coefficient(draw, "k", body)
        + &rule(draw, 2 * p)
        + &format!(
            "unknown u : vector {}{p}\ndef r = x + 3\ndef hoop(v) = v(1)/r\ndef volume(v) = Div_v + hoop(v)\n\
             def sigma(v) = k*(60*volume(v)*Id({}) + 160*Sym(Grad_v))\ndef around(v) = k*(60*volume(v) + 160*hoop(v))\n\
             term section on all : r*(sigma(u):Grad_Test_u + around(u)*hoop(Test_u))\n{law}fix u(2) = 0 on left\n{}\
             load u = -r*(1 + 0.3*t)*2*Normal on side\nload u = {} on all\nmeasure u_sum = integral(u(1)) on all\n\
             measure u_size = max(Norm(u)) on all\nmeasure r_left = reaction(u(2)) on left\n",
            body.family,
            body.dim,
            if body.dim == 2 { "" } else { "fix u(3) = 0 on left\n" },
            vector(body, ["r", "-0.5*r", "0.2*r"])
        )
}

/// Fluid along a fault and into the rock on both sides of it, with laws that are not linear in some.
pub(super) fn fault(draw: &mut Draw, body: &Body) -> String {
    let (f, p) = (body.family, degree(draw, body).min(2));
    let (own, between) = match draw.below(3) {
        0 => (
            format!("D{f}0"),
            "region inner = interior of fault\n\
             term flow on inner : 6/(element_size + beyond(element_size))*(q - beyond(q))*(Test_q - beyond(Test_q))\n",
        ),
        _ => (format!("{f}{}", 1 + draw.below(p)), "term flow on fault : along_fault(q, 3*(1 + y^2))\n"),
    };
    let leak = draw.of(&["5", "5*(1 + q^2)", "0.5"]);
    let extent = if body.rows > 1 && draw.chance(0.5) { " where py < 1.05" } else { "" };
    let rim = draw.of(&["", "term drain on ends : 2*(q - 0.1)*Test_q\n", "term drain on ends : 2*(q + q^3)*Test_q\n"]);
    let storage = draw.of(&["", "term pores on fault : 0.3*Dot_q*Test_q\nterm store on all : 0.1*Dot_p*Test_p\n"]);
    coefficient(draw, "k", body)
        + &format!(
            "use \"poro\"\nregion near = cells where px < 1\nregion far = all - near\n\
             region seam = interface from near to far\nregion fault = faces of seam{extent}\nregion ends = rim of fault\n\
             unknown p : scalar {f}{p}\nunknown q : scalar {own} on fault\nsplit p across fault\n\
             def beyond(v) = Interpolate(v, neighbor_element)\nterm rock on all : darcy(p, k)\n{between}\
             term leaks on fault : leakoff(q, p, {leak})\n{rim}{storage}fix p = 0.1*py on left\nfix p = 0.3 on right\n\
             load q = (1 + 0.3*t)*(1 + py) on fault\nbalance water of p, q\nmeasure p_sum = integral(p) on all\n\
             measure q_sum = integral(q) on fault\nmeasure r_left = reaction(p) on left\n"
        )
}

/// Ends of which each is the periodic image of the other, held together by multipliers, springs or contact.
pub(super) fn periodic(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body).min(2);
    let f = body.family;
    let back = if body.dim == 2 { "[x - 2, y]" } else { "[x - 2, y, z]" };
    let tie = match draw.below(3) {
        0 => format!(
            "multiplier l : vector {f}{p} on right\n\
             term tie on right : l.(Test_u - Interpolate(Test_u, back)) + Test_l.(u - Interpolate(u, back) - move)\n\
             measure l_sum = integral(l(1)) on right\n"
        ),
        1 => "def over = u - Interpolate(u, back) - move\n\
              term tie on right : 1e3*(pos_part(over.Normal)*Normal + 0.1*over).(Test_u - Interpolate(Test_u, back))\n"
            .to_owned(),
        _ => "term tie on right : 1e3*(u - Interpolate(u, back) - move).(Test_u - Interpolate(Test_u, back))\n"
            .to_owned(),
    };
    coefficient(draw, "k", body)
        + &rule(draw, 2 * p)
        + &stress(body, "k")
        + &format!(
            "unknown u : vector {f}{p}\nmapping back = point {back}\ndef move = (1 + 0.3*t)*{}\n\
             term body on all : sigma(u):Grad_Test_u\nterm bed on all : 3*u.Test_u\n{tie}load u = {} on all\n\
             measure u_sum = integral(u(2)) on all\nmeasure u_size = max(Norm(u)) on all\n",
            vector(body, ["0.02", "0.01", "0"]),
            vector(body, ["sin(3*x)", "-0.6*y", "0.4"])
        )
}

/// Normal components that are prescribed on curved and turned sides, with contact on others.
pub(super) fn normals(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body);
    let where_ = draw.of(&["side", "left, side", "left, right", "left"]);
    let wall = draw.of(&[
        "term bed on all : 20*u.Test_u\n",
        "term bed on all : 20*u.Test_u\nterm wall on right : 2e3*pos_part(u.Normal - 0.001)*(Test_u.Normal)\n",
        "term bed on all : 20*(1 + 50*u.u)*u.Test_u\n",
        "term bed on all : 20*u.Test_u\nterm rough on right : Ball_projection(300*(u - (u.Normal)*Normal), 0.6).Test_u\n",
    ]);
    coefficient(draw, "k", body)
        + &rule(draw, 2 * p)
        + &stress(body, "k")
        + &format!(
            "unknown u : vector {}{p}\nterm body on all : sigma(u):Grad_Test_u\n{wall}fix u.Normal = 0.01*(1 + 0.3*t)*py on {where_}\n\
             load u = {} on all\nmeasure u_sum = integral(u(2)) on all\nmeasure u_size = max(Norm(u)) on all\n\
             measure r_one = reaction(u(1)) on left\nmeasure r_two = reaction(u(2)) on side\n",
            body.family,
            vector(body, ["1", "-2", "0.4"])
        )
}

/// A body that rolls on its curved ends, where what it slips by is held by a rough wall: `fix` on parts and on all.
pub(super) fn clamps(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body).min(3);
    let cut = draw.of(&["py > 0.4", "px > 0.6", "px < 1.4 and py > 0.4"]);
    coefficient(draw, "k", body)
        + &stress(body, "k")
        + &format!(
            "region part = nodes of side where {cut}\nregion inside = cells where px < 1\nregion rest = all - inside\n\
             unknown u : vector {0}{p}\nunknown v : scalar {0}{p} on inside\nterm body on all : sigma(u):Grad_Test_u\n\
             term warm on inside : Grad_v.Grad_Test_v + 2*v*Test_v - 9*v*Div_Test_u\nfix u = {1} on left\nfix u(1) = 0.01*t on part\n\
             load v = 1 + y on inside\nload u = {2} on rest\nmeasure u_sum = integral(u(2)) on all\nmeasure v_sum = integral(v) on inside\n\
             measure r_left = reaction(u(1)) on left\n",
            body.family,
            zero(body),
            vector(body, ["1", "-2", "0.4"])
        )
}
