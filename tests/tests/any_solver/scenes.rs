//! Scenes at random on a mesh: a law, coefficients, terms on faces, constraints, loads and rules of integration.

use super::{Draw, meshes::Body, mixed, multipliers, places, sliding, times};

/// What scenes are about, in turn; what fields beside each other, terms on faces and laws that are not linear do is in many of them.
const LAWS: [&str; 36] = [
    "heat",
    "elastic",
    "augmented",
    "sliding",
    "rubber",
    "waves",
    "incompressible",
    "fault",
    "biot",
    "contact",
    "plate",
    "rate and state",
    "elastic",
    "revolved",
    "flow",
    "periodic",
    "stamped",
    "tied",
    "two bodies",
    "means",
    "split",
    "carried",
    "kinked",
    "nitsche",
    "past",
    "normals",
    "rates",
    "convection",
    "jumps",
    "creep",
    "on faces",
    "clamps",
    "two heats",
    "sliding",
    "glued",
    "changing heat",
];

/// What the scene of a seed is about.
pub(super) fn law(seed: u64) -> &'static str {
    #[expect(clippy::cast_possible_truncation, reason = "a remainder")]
    let k = (seed % LAWS.len() as u64) as usize;
    LAWS[k]
}

/// A scene without its word on the linear solver.
pub(super) fn scene(draw: &mut Draw, body: &Body, law: &str) -> String {
    if law == "sliding" {
        return sliding::sliding(draw, body);
    }
    let mut text = format!(
        "wfl 1\n{}region left = faces where px == 0\nregion right = faces where px == 2\nregion side = boundary - left - right\n",
        body.text
    );
    let law = if body.is_long { "contact" } else { law };
    text += &match law {
        "heat" => heat(draw, body),
        "elastic" => elastic(draw, body),
        "two heats" => two_heats(draw, body),
        "two bodies" => two_bodies(draw, body),
        "glued" | "contact" => glued(draw, body, law == "contact"),
        "split" => split(draw, body),
        "rubber" => rubber(draw, body),
        "kinked" => kinked(draw, body),
        "past" => past(draw, body),
        "rates" => rates(draw, body),
        "jumps" => jumps(draw, body),
        "on faces" => on_faces(draw, body),
        "augmented" => multipliers::augmented(draw, body),
        "tied" => multipliers::tied(draw, body),
        "nitsche" => multipliers::nitsche(draw, body),
        "plate" => multipliers::plate(draw, body),
        "means" => multipliers::means(draw, body),
        "stamped" => sliding::stamped(draw, body),
        "waves" => times::waves(draw, body),
        "biot" => times::biot(draw, body),
        "rate and state" => times::rate_and_state(draw, body),
        "changing heat" => times::heat(draw, body),
        "creep" => times::creep(draw, body),
        "incompressible" => mixed::incompressible(draw, body),
        "carried" => mixed::carried(draw, body),
        "convection" => mixed::convection(draw, body),
        "revolved" => places::revolved(draw, body),
        "fault" => places::fault(draw, body),
        "periodic" => places::periodic(draw, body),
        "normals" => places::normals(draw, body),
        "clamps" => places::clamps(draw, body),
        _ => flow(draw, body),
    };
    text += steps(draw, body, law, &text);
    if text.contains("scheme hht") || text.contains("scheme generalised") {
        // equations hold within the steps, not at their ends
        let lines = text.lines().filter(|line| !line.contains("reaction(") && !line.starts_with("balance"));
        text = lines.map(|line| format!("{line}\n")).collect();
    }
    if text.contains("steps") {
        return text;
    }
    // a law at rest would be solved to nothing
    [" ", ",", "]", ")"]
        .iter()
        .fold(text.replace("(1 + 0.3*t)", "1"), |text, end| text.replace(&format!("*t{end}"), &format!("*1{end}")))
}

/// Steps: of some scenes none where nothing depends on those before.
fn steps(draw: &mut Draw, body: &Body, law: &str, text: &str) -> &'static str {
    let has_past = ["Dot_", "Dot2_", "Previous_", "state ", "timestep", "storage(", "biot("];
    match has_past.iter().any(|word| text.contains(word)) {
        true if matches!(law, "past" | "rates") && body.dim == 2 && draw.chance(0.12) => "steps t = 0 to 2 by 0.02\n",
        true if law == "rate and state" => "steps t = 0 to 0.6 by 0.2\n",
        true if law == "waves" => draw.of(&["steps t = 0 to 0.4 by 0.1\n", "steps t = 0 to 0.1 by 0.02\n"]),
        true => "steps t = 0 to 2 by 1\n",
        false => draw.of(&["", "steps t = 0 to 2 by 1\n", "steps t = 1 to 2 by 0.5\n"]),
    }
}

/// A degree that suits the mesh: the highest ones on few cells alone.
pub(super) fn degree(draw: &mut Draw, body: &Body) -> usize {
    let most = if body.dim == 2 {
        4
    } else if body.is_rich {
        2
    } else {
        3
    };
    let own = 1 + draw.below(most);
    // cells of degree 1 keep their matrix, which is the lesser part of what is compared
    if own == 1 && draw.chance(0.6) { 2 } else { own }
}

/// A positive coefficient: a number, an expression of the position, or data at nodes.
pub(super) fn coefficient(draw: &mut Draw, name: &str, body: &Body) -> String {
    let of = if body.dim == 2 { "1 + 0.5*x*y + y^2" } else { "1 + 0.5*x*y + z^2" };
    match draw.below(5) {
        0 => format!("def {name} = 2.5\n"),
        4 => format!("def {name} = (1 + 0.3*t)*({of})\n"),
        1 => format!("def {name} = {of}\n"),
        2 => format!("def {name} = exp(sin(3*px)) + 3*pos_part(sign(px - 1))\n"),
        _ => format!("data {name} : scalar {}{} = {of}\n", body.family, 1 + draw.below(2)),
    }
}

/// A rule by hand for some scenes; `least` is a degree that leaves no mode without stiffness.
pub(super) fn rule(draw: &mut Draw, least: usize) -> String {
    match draw.below(5) {
        0 => format!("quadrature on all degree {least}\n"),
        1 => format!("quadrature on all degree {}\n", least + 2 + draw.below(3)),
        _ => String::new(),
    }
}

pub(super) fn vector(body: &Body, of: [&str; 3]) -> String {
    format!("[{}]", of[..body.dim].join(", "))
}

pub(super) fn zero(body: &Body) -> String {
    vector(body, ["0", "0", "0"])
}

fn heat(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body);
    let mut text = coefficient(draw, "k", body) + &coefficient(draw, "c", body) + &rule(draw, 2 * p);
    text += &format!("unknown u : scalar {}{p}\n", body.family);
    text += match (draw.below(3), body.dim) {
        (0, 2) => "term flow on all : k*([2,0.5;0.5,1]*Grad_u).Grad_Test_u\n",
        (0, _) => "term flow on all : k*([2,0.5,0;0.5,1,0.2;0,0.2,3]*Grad_u).Grad_Test_u\n",
        _ => "term flow on all : k*Grad_u.Grad_Test_u\n",
    };
    if draw.chance(0.5) {
        text += "term mass on all : 3*c*u*Test_u\n";
    }
    if draw.chance(0.4) {
        text += "term film on right : 2*c*u*Test_u\n";
    }
    if draw.chance(0.3) {
        text += "term cubic on all : (u + 0.3*u^3)*Test_u\n";
    }
    if body.has_equal_ends && draw.chance(0.7) {
        let back = if body.dim == 2 { "[x - 2, y]" } else { "[x - 2, y, z]" };
        text += &format!(
            "mapping back = point {back}\nterm bed on all : u*Test_u\n\
             term tie on right : 50*(u - Interpolate(u, back))*(Test_u - Interpolate(Test_u, back))\n"
        );
    }
    text += draw.of(&["fix u = 0.2*py on left\n", "fix u = 1 + px*py on left, right\n"]);
    text += draw.of(&["load u = (1 + 0.3*t)*(1 + y) on all\n", "load u = (1 + 0.3*t) on side\n"]);
    text + "measure u_sum = integral(u) on all\nmeasure u_size = integral(k*Grad_u.Grad_u) on all\n\
        measure r_left = reaction(u) on left\n"
}

/// Supports, loads and measures of a displacement `u`.
pub(super) fn held(draw: &mut Draw, body: &Body) -> String {
    let mut text = match draw.below(4) {
        0 => format!("fix u = {} on left\nfix u.Normal = 0 on side\n", zero(body)),
        1 => format!("fix u = {} on left\nfix u(2) = 0.03*(1 + 0.3*t) on right\n", zero(body)),
        2 => "fix u.Normal = 0.01 on left, right\nterm held on side : 40*u.Test_u\n".to_owned(),
        _ => format!("fix u = {} on left\n", vector(body, ["0.02*py", "0.01", "0"])),
    };
    text += &format!("load u = (1 + 0.3*t)*{} on all\n", vector(body, ["1", "-0.6*(1 + x)", "0.4"]));
    if draw.chance(0.5) {
        text += &format!("load u = {} on right\n", vector(body, ["2*y", "1", "-1"]));
    }
    if draw.chance(0.4) {
        text += "term springs on right : 50*(1 + y)*u.Test_u\n";
    }
    text + "measure u_sum = integral(u(2)) on all\nmeasure u_size = max(Norm(u)) on all\n\
        measure r_left = reaction(u(1)) on left\nmeasure r_other = reaction(u(2)) on left\n"
}

pub(super) fn stress(body: &Body, k: &str) -> String {
    format!("def sigma(v) = {k}*(60*Div_v*Id({0}) + 160*Sym(Grad_v))\n", body.dim)
}

fn elastic(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body);
    let mut text = coefficient(draw, "k", body) + &rule(draw, 2 * p) + &stress(body, "k");
    text += &format!("unknown u : vector {}{p}\n", body.family);
    text += match draw.below(3) {
        0 => {
            "region near = cells where px < 1\nregion far = all - near\nterm here on near : sigma(u):Grad_Test_u\n\
              term there on far : 3*sigma(u):Grad_Test_u\n"
        }
        1 => "term body on all : sigma(u):Grad_Test_u + 100*k*Grad_u(1,1)*Grad_Test_u(1,1)\n",
        _ => "term body on all : sigma(u):Grad_Test_u\n",
    };
    if draw.chance(0.4) {
        text += "term bed on all : 7*(1 + py^2)*u.Test_u\n";
    }
    text + &held(draw, body)
}

fn two_heats(draw: &mut Draw, body: &Body) -> String {
    let (p, q) = (degree(draw, body), degree(draw, body));
    let f = body.family;
    let on = draw.of(&["all", "far"]);
    coefficient(draw, "k", body)
        + &format!(
            "region far = cells where px > 1\nunknown a : scalar {f}{p}\nunknown b : scalar {f}{q} on {on}\n\
             term of_a on all : k*Grad_a.Grad_Test_a + a*Test_a\nterm of_b on {on} : 2*Grad_b.Grad_Test_b\n\
             term both on {on} : 3*(a - b)*(Test_a - Test_b) + 0.3*k*Grad_a.Grad_Test_b + 0.3*k*Grad_b.Grad_Test_a\n\
             fix a = 0.1 on left\nfix b = py on right\nload b = (1 + 0.3*t)*(1 + x) on {on}\n\
             measure u_a = integral(a) on all\nmeasure u_b = integral(b*b) on {on}\n\
             measure r_a = reaction(a) on left\nmeasure r_b = reaction(b) on right\n"
        )
}

fn two_bodies(draw: &mut Draw, body: &Body) -> String {
    let (p, q) = (degree(draw, body), degree(draw, body));
    let f = body.family;
    coefficient(draw, "k", body)
        + &stress(body, "k")
        + &format!(
            "unknown u : vector {f}{p}\nunknown v : vector {f}{q}\n\
             term of_u on all : sigma(u):Grad_Test_u\nterm of_v on all : 2*sigma(v):Grad_Test_v\n\
             term both on all : 90*(u - v).(Test_u - Test_v)\nfix v = {} on right\n{}",
            zero(body),
            held(draw, body)
        )
}

fn glued(draw: &mut Draw, body: &Body, has_contact: bool) -> String {
    let (p, q) = if body.is_long { (4, 4) } else { (degree(draw, body), degree(draw, body)) };
    let f = body.family;
    let law = match (has_contact, draw.below(2)) {
        (false, _) => "term tie on glue : 1e3*jump(u,v).jump(Test_u,Test_v)\n",
        (_, 0) => "term tie on glue : 1e3*pos_part(jump(u,v).Normal)*(jump(Test_u,Test_v).Normal)\n",
        _ => {
            "term tie on glue : (1e3*pos_part(jump(u,v).Normal)*Normal + Ball_projection(200*tang(jump(u,v)), \
              0.3*1e3*pos_part(jump(u,v).Normal))).jump(Test_u,Test_v)\n"
        }
    };
    coefficient(draw, "k", body)
        + &stress(body, "k")
        + &format!(
            "region near = cells where px < 1\nregion far = all - near\nregion glue = interface from near to far\n\
             unknown u : vector {f}{p} on near\nunknown v : vector {f}{q} on far\n\
             def jump(a,b) = a - Interpolate(b, neighbor_element)\ndef tang(w) = w - (w.Normal)*Normal\n\
             term of_u on near : sigma(u):Grad_Test_u\nterm of_v on far : 2*sigma(v):Grad_Test_v\n\
             {law}fix u = {} on left\nfix v = (1 + 0.3*t)*{} on right\n\
             load v = {} on far\nmeasure u_sum = integral(u(1)) on near\nmeasure u_v = max(Norm(v)) on far\n\
             measure r_left = reaction(u(1)) on left\nmeasure r_right = reaction(v(2)) on right\n",
            vector(body, ["0", "0", "0"]),
            vector(body, ["-0.03 + 0.02*py", "0.01", "0"]),
            vector(body, ["0.3", "-1", "0.2"]),
        )
}

fn split(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body);
    let law = draw.of(&[
        "term slit on crack : 300*jump(u).jump(Test_u)\n",
        "term slit on crack : 1e3*pos_part(jump(u).Normal)*(jump(Test_u).Normal) + jump(u).jump(Test_u)\n",
    ]);
    let extent = if body.rows > 1 && draw.chance(0.5) { " where py < 1.05" } else { "" };
    let end = draw.of(&["0.02", "-0.02"]);
    coefficient(draw, "k", body)
        + &stress(body, "k")
        + &format!(
            "region near = cells where px < 1\nregion far = all - near\nregion seam = interface from near to far\n\
             region crack = faces of seam{extent}\nunknown u : vector {}{p}\nsplit u across crack\n\
             def jump(a) = a - Interpolate(a, neighbor_element)\nterm body on all : sigma(u):Grad_Test_u\n{law}\
             fix u = (1 + 0.3*t)*{} on right\n{}",
            body.family,
            vector(body, [end, "0.01*py", "0"]),
            held(draw, body).replace("fix u(2) = 0.03*(1 + 0.3*t) on right\n", "").replace("on left, right", "on left")
        )
}

fn rubber(draw: &mut Draw, body: &Body) -> String {
    let (p, d) = (degree(draw, body), body.dim);
    let mut text = coefficient(draw, "k", body) + &rule(draw, 2 * p);
    text += &format!(
        "unknown u : vector {}{p}\ndef F = Id({d}) + Grad_u\ndef P = k*(80*(F - Inv(F)') + 60*log(Det(F))*Inv(F)')\n",
        body.family
    );
    text += &match draw.below(4) {
        0 => format!("energy body on all : k*(40*(Norm_sqr(F) - {d} - 2*log(Det(F))) + 30*log(Det(F))^2)\n"),
        1 => "region near = cells where px < 1\nregion far = all - near\nterm here on near : P:Grad_Test_u\n\
              term there on far : (60*Div_u*Id(D) + 200*Sym(Grad_u)):Grad_Test_u\n"
            .replace('D', &d.to_string())
            .replace(&format!("{d}iv_u"), "Div_u"),
        2 => "term body on all : P:Grad_Test_u\nterm bed on all : (5 + 30*u.u)*u.Test_u\n".to_owned(),
        _ => "term body on all : P:Grad_Test_u\n".to_owned(),
    };
    match draw.below(4) {
        0 => text += "load u = -2*Det(F)*Inv(F)'*Normal on right\n",
        1 => text += "term wall on right : 300*u(1)^3*Test_u(1)\n",
        2 => text += "term stop on side : 500*pos_part(u(2) - 0.001)*Test_u(2)\n",
        _ => {}
    }
    text + &held(draw, body)
}

/// Laws with kinks in the body.
fn kinked(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body);
    let mut text = coefficient(draw, "k", body) + &rule(draw, 2 * p) + &stress(body, "k");
    text += &format!("unknown u : vector {}{p}\n", body.family);
    text += draw.of(&[
        "term body on all : sigma(u):Grad_Test_u + 100*pos_part(Div_u)*Div_Test_u\n",
        "term body on all : sigma(u):Grad_Test_u + 50*k*abs(Grad_u(1,1))*Grad_u(1,1)*Grad_Test_u(1,1)\n",
        "term body on all : sigma(u):Grad_Test_u\nterm bed on all : 100*pos_part(-u(2))*(-Test_u(2))\n",
        "term body on all : 60*Div_u*Div_Test_u + 160*(1 + 5*Norm(Sym(Grad_u)))*Sym(Grad_u):Sym(Grad_Test_u)\n",
    ]);
    text + &held(draw, body)
}

/// A motion and a pressure.
fn flow(draw: &mut Draw, body: &Body) -> String {
    let f = body.family;
    let p = if body.dim == 2 { 2 + draw.below(2) } else { 2 };
    let inertia = draw.of(&["", "term inertia on all : 0.2*(Grad_u*u).Test_u\n"]);
    let sum = draw.of(&["", "term gives on all : -0.02*p*Test_p\n"]);
    coefficient(draw, "k", body)
        + &format!(
            "unknown u : vector {f}{p}\nunknown p : scalar {f}{}\n\
             term viscous on all : 2*k*Sym(Grad_u):Sym(Grad_Test_u)\nterm volume on all : -p*Div_Test_u - Div_u*Test_p\n\
             {sum}{inertia}{}",
            p - 1,
            held(draw, body)
                .replace("fix u.Normal = 0 on side\n", "")
                .replace("fix u.Normal = 0.01 on left, right\n", "fix u.Normal = 0.01 on left\n")
        )
}

/// Creep and wear: what the last step leaves.
fn past(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body);
    let law = draw.of(&[
        "term creep on all : 30*k*Sym(Grad_u - Grad_Previous_u):Sym(Grad_Test_u)\n",
        "state e : matrix(D,D) on all := 0.5*(Previous_e + Sym(Grad_u))\nterm creep on all : -40*Previous_e:Grad_Test_u\n",
        "term creep on all : 30*(1 + Norm_sqr(Grad_Previous_u))*Sym(Grad_u):Sym(Grad_Test_u)\n",
    ]);
    coefficient(draw, "k", body)
        + &stress(body, "k")
        + &format!("unknown u : vector {}{p}\nterm body on all : sigma(u):Grad_Test_u\n", body.family)
        + &law.replace("(D,D)", &format!("({0},{0})", body.dim))
        + &held(draw, body)
}

/// Mass and damping.
fn rates(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body);
    let law = draw.of(&[
        "term inertia on all : 2*c*Dot2_u.Test_u\n",
        "term damping on all : c*Dot_u.Test_u + 3*Sym(Grad_Dot_u):Sym(Grad_Test_u)\n",
        "term inertia on all : 2*Dot2_u.Test_u\nterm damping on right : 5*Dot_u.Test_u\n",
    ]);
    coefficient(draw, "k", body)
        + &coefficient(draw, "c", body)
        + &stress(body, "k")
        + &format!("unknown u : vector {}{p}\nterm body on all : sigma(u):Grad_Test_u\n{law}", body.family)
        + &held(draw, body)
}

/// An unknown that jumps from cell to cell, held together by an interior penalty.
fn jumps(draw: &mut Draw, body: &Body) -> String {
    let p = 1 + draw.below(2);
    coefficient(draw, "k", body)
        + &format!(
            "unknown u : scalar D{}{p}\ndef jump(a) = a - Interpolate(a, neighbor_element)\n\
             def mean(a) = 0.5*(Grad_a + Interpolate(Grad_a, neighbor_element))\n\
             term flow on all : k*Grad_u.Grad_Test_u\n\
             term over on interior : 400*jump(u)*jump(Test_u) - k*(mean(u).Normal)*jump(Test_u) \
             - k*(mean(Test_u).Normal)*jump(u)\nterm film on left, right : 30*(u - py)*Test_u\n\
             load u = (1 + 0.3*t)*(1 + y) on all\nmeasure u_sum = integral(u) on all\nmeasure u_far = integral(u*u) on right\n",
            body.family
        )
}

/// A field of a face beside one of the body.
fn on_faces(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body);
    coefficient(draw, "k", body)
        + &format!(
            "unknown u : scalar {0}{p}\nunknown q : scalar {0}{1} on right\nterm flow on all : k*Grad_u.Grad_Test_u\n\
             term sheet on right : 5*Grad_q.Grad_Test_q + 10*(q - u)*(Test_q - Test_u)\nfix u = py on left\n\
             load u = (1 + 0.3*t)*(1 + y) on all\nload q = 1 + y on right\nmeasure u_sum = integral(u) on all\n\
             measure u_face = integral(q*q) on right\nmeasure r_left = reaction(u) on left\n",
            body.family,
            1 + draw.below(2)
        )
}

/// Whether all terms are polynomials, which every rule that is not given by hand integrates exactly where cells are affine.
pub(super) fn is_polynomial(scene: &str) -> bool {
    let others =
        ["exp(", "sign(", "log(", "abs(", "Norm(Sym", "pos_part", "Ball_projection", "sqrt", "quadrature", "cos(0.4)"];
    let terms = scene.lines().filter(|line| !line.starts_with("measure") && !line.starts_with("mesh"));
    !terms.into_iter().any(|line| others.iter().any(|other| line.contains(other)))
}
