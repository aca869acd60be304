//! Bodies of finite strain that touch: two that slide far, with images that follow them, and one on a rigid obstacle.

use super::{
    Draw,
    meshes::{self, Body},
    scenes::{coefficient, degree, vector, zero},
};

/// The first Piola-Kirchhoff stress of a hyperelastic law of a displacement with the gradient `g`, as the macro `P(g)`.
fn law(draw: &mut Draw, dim: usize) -> String {
    let plane = if dim == 2 { "Plane_Strain_" } else { "" };
    let second =
        |name: &str, parameters: &str| format!("def P(g) = (Id({dim}) + g)*{plane}{name}_PK2(g, {parameters})\n");
    match draw.below(6) {
        0 => second("Saint_Venant_Kirchhoff", "[0.4; 0.4]"),
        1 => second("Compressible_Neo_Hookean_Bonet", "[0.5; 0.4]"),
        2 => second("Compressible_Mooney_Rivlin", "[0.15; 0.05; 0.5]"),
        3 => second("Ciarlet_Geymonat", "[0.5; 0.4; 0.1]"),
        _ => format!(
            "def P(g) = 0.4*((Id({dim}) + g) - Inv(Id({dim}) + g)') + 0.5*log(Det(Id({dim}) + g))*Inv(Id({dim}) + g)'\n"
        ),
    }
}

/// Two blocks, one upon the other: halves of one box, or two of a file, whose faces do not match.
pub(super) fn blocks(draw: &mut Draw) -> Body {
    let in_space = draw.chance(0.25);
    let dim = if in_space { 3 } else { 2 };
    let up = if in_space { "z" } else { "y" };
    if draw.chance(0.5) {
        let made = meshes::of_file(draw, dim);
        let by = if in_space { "[0.3,0.2,1]" } else { "[0.3,1]" };
        let text = format!(
            "mesh file \"body.msh\", \"body.msh\" scaled by 0.6 moved by {by} with idle_cells=allowed\n\
             region lower = cells where {up} < 1\nregion upper = cells where {up} > 1\n\
             region sole = faces of upper where {up} == 1\nregion floor = faces of lower where {up} == 1\n\
             region lid = faces of upper where {up} == 1.6\nregion base = faces of lower where {up} == 0\n"
        );
        return Body::of(made, dim, text);
    }
    let kind = if in_space { draw.of(&["hex", "tet"]) } else { draw.of(&["quad", "tri"]) };
    let map = draw.of(&["", " map [x + 0.02*sin(4*y), y + 0.02*sin(5*x)*(2 - y)*y]"]);
    let (mesh, end) = if in_space {
        (format!("box [0,0,0] to [3,1,2] cells [4,1,4] {kind}"), "1.6")
    } else {
        (format!("box [0,0] to [4,2] cells [6,4] {kind}{map}"), "2.1")
    };
    let text = format!(
        "mesh {mesh} with idle_cells=allowed\nregion lower = cells where {up} < 1\n\
         region upper = cells where {up} > 1 and x < {end}\nregion sole = interface from upper to lower\n\
         region floor = faces of lower where {up} > 0.9\nregion lid = faces of upper where {up} > 1.9\n\
         region base = faces of lower where {up} < 0.1\n"
    );
    let family = if matches!(kind, "hex" | "quad") { 'Q' } else { 'P' };
    Body::of(meshes::Made { mesh: String::new(), file: None, family, rows: 2 }, dim, text)
}

/// The law of contact between both: a penalty along the normal of either, or Nitsche's method; with friction in most.
fn contact(draw: &mut Draw, is_bent: bool) -> String {
    // over an edge of faces the normal of a closest point jumps
    let word = if is_bent { "raytrace" } else { draw.of(&["raytrace", "raytrace", "project"]) };
    let macros = if word == "raytrace" { "sliding" } else { "closest" };
    let gamma = draw.of(&["5", "40", "300"]);
    let fric = draw.of(&["0", "0.2", "0.5"]);
    let law = match (fric, draw.chance(0.25)) {
        ("0", _) => format!("term contact on sole : {macros}_contact(a, b, m, {gamma})\n"),
        (_, true) if word == "raytrace" => format!(
            "def gap = sliding_gap(a, b, m)\ndef n = current_normal(a)\ndef force_a = P(Grad_a)*Normal\n\
             def Pn = -{gamma}*gap - force_a.n\n\
             def held = Ball_projection(along_face({gamma}*sliding_slip(a, b, m) - force_a, n), {fric}*pos_part(Pn))\n\
             term contact on sole : (pos_part(Pn)*n + held).sliding_jump(a, b, m)\n"
        ),
        _ => format!(
            "state elastic : vector on sole := {macros}_elastic(a, b, m, elastic, {gamma}, {fric})\n\
             term contact on sole : {macros}_friction(a, b, m, elastic, {gamma}, {fric})\n"
        ),
    };
    format!("mapping m = {word} from sole onto floor moving with a, b within 0.3\n{law}")
}

/// Two blocks, of which the upper one is pressed down and pushed over the lower one.
pub(super) fn sliding(draw: &mut Draw, body: &Body) -> String {
    let (dim, f) = (body.dim, body.family);
    let p = if dim == 3 { 1 } else { 1 + draw.below(2) };
    let contact = contact(draw, body.text.contains(" map "));
    let is_cut = !contact.contains("state") && draw.chance(0.3);
    let rule = if is_cut { format!("segments of m degree {}", 2 * p) } else { format!("degree {}", 2 * p + 1) };
    let inertia = draw.of(&["", "", "term inertia on upper : 0.5*Dot2_a.Test_a\n"]);
    // stresses of Nitsche's method open and close where rates begin, and such a start is refused
    let inertia = if contact.contains("Pn") { "" } else { inertia };
    let aside = if dim == 3 {
        "[S*max(0, s - 1), 0.02*max(0, s - 1), -0.02*min(s, 1)]"
    } else {
        "[S*max(0, s - 1), -0.02*min(s, 1)]"
    };
    let aside = aside.replace('S', draw.of(&["0.05", "0.2", "0.4"]));
    let harder = draw.of(&["1", "0.3", "4"]);
    format!(
        "wfl 1\nuse \"sliding\"\n{}unknown a : vector {f}{p} on upper\nunknown b : vector {f}{p} on lower\n{}\
         term upper on upper : P(Grad_a):Grad_Test_a\nterm lower on lower : {harder}*P(Grad_b):Grad_Test_b\n{inertia}\
         {contact}quadrature on sole {rule}\nsteps s = 0 to 2 by 1\nfix a = {aside} on lid\nfix b = {} on base\n\
         measure u_a = integral(a(1)) on upper\nmeasure u_b = integral(b(1)) on lower\n\
         measure r_down = reaction(a({dim})) on lid\nmeasure r_aside = reaction(b(1)) on base\n",
        body.text,
        law(draw, dim),
        zero(body)
    )
}

/// A body of finite strain that is pressed on a rigid obstacle, flat or round, with or without friction.
pub(super) fn stamped(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body).min(3);
    let gamma = draw.of(&["3", "40"]);
    let gap = draw.of(&["0.01", "0.01 + 0.1*(py - 0.4)^2", "0.03*py"]);
    let contact = match draw.below(4) {
        0 => format!("term stop on right : {gamma}*pos_part(u.Normal - gap)*(Test_u.Normal)\n"),
        1 => format!(
            "def Pn = {gamma}*(u.Normal - gap)\n\
             term stop on right : (pos_part(Pn)*Normal + Ball_projection({gamma}*(u - (u.Normal)*Normal), 0.3*pos_part(Pn))).Test_u\n"
        ),
        2 => format!(
            "multiplier l : scalar {}{} on right\nquadrature on right degree {}\n\
             term stop on right : pos_part({gamma}*(u.Normal - gap) - l)*(Test_u.Normal) \
             - 1/{gamma}*(l + pos_part({gamma}*(u.Normal - gap) - l))*Test_l\n",
            body.family,
            1,
            2 * p
        ),
        _ => format!(
            "def Pn = {gamma}*(u.Normal - gap) - (P(Grad_u)*Normal).Normal\ndef aside(w) = w - (w.Normal)*Normal\n\
             term stop on right : (pos_part(Pn)*Normal + Ball_projection(aside({gamma}*u - P(Grad_u)*Normal), 0.3*pos_part(Pn))).Test_u\n"
        ),
    };
    coefficient(draw, "k", body)
        + &law(draw, body.dim)
        + &format!(
            "unknown u : vector {}{p}\ndef gap = {gap}\nterm body on all : k*P(Grad_u):Grad_Test_u\n{contact}\
             fix u = {} on left\nload u = (1 + 0.3*t)*{} on all\nmeasure u_sum = integral(u(2)) on all\n\
             measure u_most = max(Norm(u)) on all\nmeasure r_left = reaction(u(1)) on left\n",
            body.family,
            zero(body),
            vector(body, ["0.02", "-0.01", "0.004"])
        )
}
