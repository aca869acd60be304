//! What changes with time: waves and impact, flow in pores, laws of friction of rate and state, heat.

use super::{
    Draw,
    meshes::Body,
    scenes::{coefficient, degree, held, stress, vector},
};

/// A scheme for second rates, or the one that is chosen where nothing is said.
fn scheme(draw: &mut Draw, has_history: bool) -> &'static str {
    let all = [
        "",
        "scheme newmark beta=0.3 gamma=0.6\n",
        "scheme bdf2\n",
        "scheme bdf3\n",
        "scheme backward_euler\n",
        "scheme hht alpha=-0.1\n",
        "scheme generalised_alpha rho_inf=0.7\n",
    ];
    // the alpha methods have their equations within the step
    all[draw.below(if has_history { 5 } else { 7 })]
}

/// Waves, with contact on one side in some.
pub(super) fn waves(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body).min(2);
    let hit = draw.of(&[
        "",
        "term wall on right : 2e3*pos_part(u.Normal - 0.002)*(Test_u.Normal)\n",
        "term wall on right : 3*abs(Dot_u(1))*Dot_u(1)*Test_u(1)\n",
        "term absorber on right : 5*Dot_u.Test_u\n",
        "term drag on all : 2*tanh(Dot_u(2)/0.01)*Test_u(2)\n",
        "def F = Id(D) + Grad_u\nterm rubber on all : (20*(F - Inv(F)') + 30*log(Det(F))*Inv(F)'):Grad_Test_u\n",
    ]);
    let mass = draw.of(&["2", "2*c", "c*(1 + u.u)"]);
    coefficient(draw, "k", body)
        + &coefficient(draw, "c", body)
        + &stress(body, "k")
        + &format!(
            "unknown u : vector {}{p}\nterm body on all : sigma(u):Grad_Test_u\nterm inertia on all : {mass}*Dot2_u.Test_u\n{}\
             start Dot_u = {}\n{}{}",
            body.family,
            hit.replace("Id(D)", &format!("Id({})", body.dim)),
            vector(body, ["0.1", "0.02*x", "0"]),
            scheme(draw, false),
            held(draw, body)
        )
}

/// A body with pores, linear or not.
pub(super) fn biot(draw: &mut Draw, body: &Body) -> String {
    let f = body.family;
    let mobility = draw.of(&["0.05", "0.05*k", "0.05*(1 + 5*Div_u)^2", "0.05*exp(0.05*p)"]);
    let storage = draw.of(&["storage(p, 0.02)", "0.02*Dot_p*Test_p", "storage(p, 0.02*(1 + 0.1*p^2))"]);
    let inertia = draw.of(&["", "", "term inertia on all : 0.3*Dot2_u.Test_u\n"]);
    // of equal degrees pressures alternate in short steps
    let p = if inertia.is_empty() && draw.chance(0.3) { 1 } else { 2 };
    coefficient(draw, "k", body)
        + &stress(body, "k")
        + &format!(
            "use \"poro\"\nunknown u : vector {f}{p}\nunknown p : scalar {f}1\nterm momentum on all : sigma(u):Grad_Test_u\n\
             term coupling on all : biot(u, p, 0.9)\nterm flow on all : {storage} + darcy(p, {mobility})\n{inertia}\
             fix p = 0.1*t on right\nload p = 0.2*(1 + x) on all\nbalance water of p\nmeasure p_sum = integral(p) on all\n\
             measure q_out = reaction(p) on right\n{}{}",
            scheme(draw, true),
            held(draw, body)
        )
}

/// Laws of friction of rate and state at the nodes of a face, beside a motion at the rate at which they begin.
pub(super) fn rate_and_state(draw: &mut Draw, body: &Body) -> String {
    let f = body.family;
    let state = draw.of(&["Dot_psi - (exp(-psi) - exp(w))", "Dot_psi + exp(w)*(psi + w)"]);
    let is_vector = body.dim == 2 && draw.chance(0.4);
    let pressure = draw.of(&["5", "5 + 0.5*py", "5*(1 + 0.1*t)"]);
    let (kind, law, along) =
        if is_vector { ("vector", "sigma(u):Grad_Test_u", "(2)") } else { ("scalar", "30*k*Grad_u.Grad_Test_u", "") };
    let inertia = match (draw.chance(0.3), is_vector) {
        (false, _) => "",
        (_, true) => "term inertia on all : 0.05*Dot2_u.Test_u\n",
        _ => "term inertia on all : 0.05*Dot2_u*Test_u\n",
    };
    let drive = if inertia.is_empty() { "0.3*t" } else { "0.01*t^2" };
    let drive = if is_vector { format!("[0, {drive}]") } else { drive.to_owned() };
    let b = draw.of(&["0.12", "0.08"]);
    coefficient(draw, "k", body)
        + &stress(body, "k")
        + &format!(
            "unknown u : {kind} {f}1\nunknown w : scalar {f}1 on right\nunknown psi : scalar {f}1 on right\n\
             quadrature on right vertex\ndef law(r, s) = ({pressure})*0.1*asinh(0.5*exp(r + (0.6 + {b}*s)/0.1)) + 0.2*exp(r)\n\
             term body on all : {law}\nterm shear on right : (law(w, psi) - law(-3, 3))*Test_u{along}\n\
             term rate on right : (Dot_u{along} + exp(-3) - exp(w))*Test_w\nterm memory on right : ({state})*Test_psi\n\
             fix u = {drive} on left\n{inertia}start w = -3\nstart psi = 3 + 0.1*py\n\
             measure u_slip = integral(u{along}) on right\nmeasure w_mean = mean(w) on right\n\
             measure s_mean = mean(psi) on right\nmeasure r_left = reaction(u{along}) on left\n"
        )
}

/// Heat with a capacity that changes, radiation, and a source; with friction of a coefficient that falls in some.
pub(super) fn heat(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body);
    let flux = draw.of(&["k", "k*(1 + 0.2*T)", "k*(1 + 0.3*pos_part(T - 0.5))"]);
    let capacity = draw.of(&["1", "c", "(1 + 0.5*T^2)"]);
    let ends = draw.of(&[
        "",
        "term radiates on right : 0.2*((1 + T)^4 - 1)*Test_T\n",
        "term melts on right : 3*pos_part(T - 0.1)*Test_T\n",
        "unknown tank : scalar global\nterm stores on global : 2*Dot_tank*Test_tank\n\
         term passes on right : 3*(T - tank)*(Test_T - Test_tank)\nmeasure t_tank = max(tank) on global\n",
    ]);
    coefficient(draw, "k", body)
        + &coefficient(draw, "c", body)
        + &format!(
            "unknown T : scalar {}{p}\nterm storage on all : {capacity}*Dot_T*Test_T\nterm flow on all : {flux}*Grad_T.Grad_Test_T\n\
             {ends}start T = 0.2*py\nfix T = 0.2*py + 0.3*t on left\nload T = (1 + 0.3*t)*(1 + x) on all\n{}\
             measure t_sum = integral(T) on all\nmeasure q_left = reaction(T) on left\n",
            body.family,
            scheme(draw, false)
        )
}

/// Creep whose strain is a state, contact with friction and a state, or damage: what a step leaves to the next.
pub(super) fn creep(draw: &mut Draw, body: &Body) -> String {
    let p = degree(draw, body).min(3);
    let d = body.dim;
    let law = match draw.below(3) {
        0 => format!(
            "def dev(e) = e - Trace(e)/{d}*Id({d})\ndef s = k*160*dev(Sym(Grad_u) - Previous_ec)\n\
             state ec : matrix({d},{d}) on all := Previous_ec + 0.003*timestep*Norm_sqr(s)*s/100\n\
             term body on all : (k*100*Div_u*Id({d}) + s):Grad_Test_u\n"
        ),
        1 => format!(
            "def trial = k*160*(Sym(Grad_u) - Previous_ep)\ndef s = Von_Mises_projection(trial, 0.7)\n\
             state ep : matrix({d},{d}) on all := Previous_ep + (trial - s)/(160*k)\n\
             term body on all : (k*60*Div_u*Id({d}) + s + 20*Sym(Grad_u)):Grad_Test_u\n"
        ),
        _ => format!(
            "def worst = max(Previous_kappa, Norm(Sym(Grad_u)))\nstate kappa : scalar on all := worst\n\
             term body on all : k/(1 + 3*worst)*(60*Div_u*Id({d}) + 160*Sym(Grad_u)):Grad_Test_u\n"
        ),
    };
    coefficient(draw, "k", body) + &format!("unknown u : vector {}{p}\n{law}{}", body.family, held(draw, body))
}
