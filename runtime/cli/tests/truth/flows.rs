//! Flows of incompressible fluids, which are no bodies: what is asked of the stress of a body is not asked of them.

use super::run;

/// A driven cavity.
fn cavity(dim: usize, momentum: &str, more: &str) -> String {
    let (mesh, lid, still) = if dim == 2 {
        ("mesh box [0,0] to [1,1] cells [3,3] tri", "[16*x^2*(1-x)^2,0]", "[0,0]")
    } else {
        ("mesh box [0,0,0] to [1,1,1] cells [2,2,2] tet", "[16*x^2*(1-x)^2*y*(1-y),0,0]", "[0,0,0]")
    };
    let top = if dim == 2 { "y" } else { "z" };
    let corner = if dim == 2 { "x == 0 and y == 0" } else { "x == 0 and y == 0 and z == 0" };
    format!(
        "param nu = 0.1\n{mesh}\nunknown u : vector P2\nunknown p : scalar P1\nregion corner = nodes where {corner}\n\
         region lid = faces where {top} == 1\nregion walls = boundary - lid\nterm momentum on all : {momentum}\n\
         term mass on all : -Div_u*Test_p\n{more}fix u = {lid} on lid\nfix u = {still} on walls\nfix p = 0 on corner\n\
         measure low = min(u(1)) on all\n"
    )
}

#[test]
fn the_viscous_term_of_a_flow_with_convection_is_no_law_of_a_body() {
    for (k, momentum) in [
        "nu*Grad_u:Grad_Test_u + (Grad_u*u).Test_u - p*Div_Test_u",
        "nu*Grad_u:Grad_Test_u + 1/2*(Grad_u*u).Test_u - 1/2*(Grad_Test_u*u).u - p*Div_Test_u",
        "nu*Grad_u:Grad_Test_u + (Grad_u*u).Test_u + 10*Div_u*Div_Test_u - p*Div_Test_u",
        "nu*(1 + Norm_sqr(Grad_u))*(Grad_u:Grad_Test_u) + (Grad_u*u).Test_u - p*Div_Test_u",
        "2*nu*Sym(Grad_u):Grad_Test_u + (Grad_u*u).Test_u - p*Div_Test_u",
        "nu*Grad_u:Grad_Test_u + (Grad_u*u - 0.1*u).Test_u + 0.3*Norm(u)*u.Test_u - p*Div_Test_u",
    ]
    .into_iter()
    .enumerate()
    {
        for dim in [2, 3] {
            let ran = run(&format!("cavity-{k}-{dim}"), &cavity(dim, momentum, ""), &[]);
            assert!(ran.code == 0 && !ran.tells("W514"), "{momentum}: {}", ran.text);
        }
    }
    let unsteady = "nu*Grad_u:Grad_Test_u + (Dot_u + Grad_u*u).Test_u - p*Div_Test_u";
    for scheme in ["backward_euler", "bdf2"] {
        let more = format!("scheme {scheme}\nsteps t = 0 to 0.2 by 0.1\n");
        let ran = run(&format!("cavity-{scheme}"), &cavity(2, unsteady, &more), &[]);
        assert!(ran.code == 0 && !ran.tells("W514"), "{}", ran.text);
    }
}

/// A body beside a pressure whose law does not know rotations is told, whatever makes its terms none of straight lines.
#[test]
fn a_wrong_law_of_a_body_beside_a_pressure_is_told() {
    let block = |law: &str| {
        format!(
            "mesh box [0,0] to [1,1] cells [2,2] tri\nregion west = faces where x == 0\nregion east = faces where x == 1\n\
             unknown u : vector P2 [mm]\nunknown p : scalar P1 [MPa]\nparam mu = 1 [MPa]\nparam soft = 1e-3 [MPa/mm^4]\ndef F = Id(2) + Grad_u\n\
             term body on all : {law}\nterm volume on all : (Det(F) - 1)*Test_p\nfix u = [0,0] on west\n\
             load u = [0,1e-3] on east\nmeasure m = mean(u(2)) on east\n"
        )
    };
    for (k, law) in [
        "(mu*F*F' - mu*Id(2) + p*Inv(F)'):Grad_Test_u",
        "(mu*(F - Inv(F)) + p*Inv(F)'):Grad_Test_u",
        "(mu*Grad_u + p*Id(2)):Grad_Test_u + soft*Norm_sqr(u)*(u.Test_u)",
    ]
    .into_iter()
    .enumerate()
    {
        let ran = run(&format!("wrong-mixed-{k}"), &block(law), &[]);
        assert!(ran.tells("W514"), "{law}: {}", ran.text);
    }
    let ran = run("right-mixed", &block("(mu*(F - Inv(F)') + p*Det(F)*Inv(F)'):Grad_Test_u"), &[]);
    assert!(ran.code == 0 && !ran.tells("W514"), "{}", ran.text);
}
