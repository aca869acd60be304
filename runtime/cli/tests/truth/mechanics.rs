//! Mechanics that a check can see: laws that do not know a rotation, statements that stand twice, distances with the wrong
//! sign, states beyond their laws, growth without end, elements that lock, pressures that alternate.

use super::{Ran, run};

/// A beam of four squares, held at the left, with a law for F = Id + Grad_u, H = Grad_u.
fn beam(law: &str, dim: usize) -> String {
    let (mesh, zero, down) = match dim {
        2 => ("[0,0] to [4,1] cells [4,1] quad", "[0,0]", "[0,-1e-4]"),
        _ => ("[0,0,0] to [4,1,1] cells [4,1,1] hex", "[0,0,0]", "[0,0,-1e-4]"),
    };
    format!(
        "wfl 1\nmesh box {mesh}\nregion west = faces where x == 0\nregion east = faces where x == 4\nunknown u : vector Q2\n\
         def H = Grad_u\ndef I = Id({dim})\ndef F = I + H\nterm body on all : ({law}):Grad_Test_u\nfix u = {zero} on west\nload u = {down} on east\n"
    )
}

fn of_law(name: &str, law: &str, dim: usize) -> Ran {
    run(&format!("mechanics-{name}-{dim}"), &beam(law, dim), &[])
}

#[test]
fn a_law_that_a_rotation_changes_is_told() {
    // a rotation of the body gives a stress, or the stress is not symmetric: no law of a body
    let wrong = [
        ("sym", "Trace(H)*I + 2*H"),
        ("partly", "Trace(H)*I + H + 0.5*H'"),
        ("neo", "F - Inv(F) + log(Det(F))*Inv(F)'"),
        ("neo2", "F - Inv(F)' + log(Det(F))*Inv(F)"),
        ("left", "F*(F*F' - I)"),
        ("second", "F'*F - I"),
        ("order", "(F'*F - I)*F"),
    ];
    for (name, law) in wrong {
        for dim in [2, 3] {
            let ran = of_law(name, law, dim);
            assert!(ran.tells("W514"), "{name} {dim}: {}", ran.text);
        }
    }
}

#[test]
fn a_law_that_knows_rotations_is_not() {
    let right = [
        ("hooke", "Trace(H)*I + 2*Sym(H)"),
        ("hooke2", "Trace(H)*I + H + H'"),
        ("neo", "F - Inv(F)' + log(Det(F))*Inv(F)'"),
        ("kirchhoff", "F*(F'*F - I)"),
        // the geometric stiffness of an initial stress, and components that do not know of each other
        ("initial", "Trace(H)*I + 2*Sym(H) - 0.02*H"),
        ("laplace", "2*H"),
    ];
    for (name, law) in right {
        for dim in [2, 3] {
            let ran = of_law(&format!("right-{name}"), law, dim);
            assert!(!ran.tells("W514") && !ran.tells("W515"), "{name} {dim}: {}", ran.text);
        }
    }
}

/// A beam bent in four steps, with further statements; H, I and F are at hand.
fn bent(law: &str, more: &str, load: f64) -> String {
    format!(
        "wfl 1\nmesh box [0,0] to [4,1] cells [4,1] quad\nregion west = faces where x == 0\nregion east = faces where x == 4\n\
         region low = faces where y == 0\nunknown u : vector Q2\ndef H = Grad_u\ndef I = Id(2)\ndef F = I + H\n{more}\
         term body on all : ({law}):Grad_Test_u\nfix u = [0,0] on west\nload u = [0,-{load}*t] on east\nsteps t = 0.25 to 1 by 0.25\n\
         measure bends = mean(u(2) + 0*H(1,1) + 0*I(1,1) + 0*F(1,1)) on east\nmeasure side = mean(u(1)) on low\n"
    )
}

#[test]
fn moments_that_do_not_balance_at_a_state_are_told() {
    // at rest, where the scene is looked at, these laws know rotations
    let grows = "state d : scalar on all := min(1, Previous_d + timestep)\n";
    let wrong = [
        ("late", "Trace(H)*I + 2*Sym(H) + (if t > 0.5 then 1 else 0)*(H - H')", ""),
        ("state", "Trace(H)*I + 2*Sym(H) + d*(H - H')", grows),
        ("second", "F*(F'*F - I) + (if t > 0.5 then 0.3 else 0)*(F'*F - I)", ""),
        ("pressure", "F*(F'*F - I) + d*Trace(H)*I", grows),
    ];
    for (name, law, more) in wrong {
        let ran = run(&format!("moments-{name}"), &bent(law, more, 1e-2), &[]);
        assert!(ran.code == 0 && ran.codes() == ["W606"], "{name}: {}", ran.text);
        assert!(ran.text.contains("equilibrium of moments of u"), "{name}: {}", ran.text);
    }
    // what the law at rest says is said once
    let ran = run("moments-once", &bent("Trace(H)*I + 2*H", "", 1e-2), &[]);
    assert_eq!(ran.codes(), ["W514"], "{}", ran.text);
}

#[test]
fn moments_of_right_bodies_are_not() {
    let right = [
        ("hooke", "Trace(H)*I + 2*Sym(H)", "", 1e-2),
        ("tiny", "1e-6*(Trace(H)*I + 2*Sym(H))", "", 1e-12),
        ("neo", "F - Inv(F)' + log(Det(F))*Inv(F)'", "", 1e-2),
        ("kirchhoff", "F*(F'*F - I)", "", 5e-2),
        ("cubic", "[3*H(1,1) + H(2,2), 0.7*(H(1,2) + H(2,1)); 0.7*(H(1,2) + H(2,1)), 3*H(2,2) + H(1,1)]", "", 1e-2),
        // of a ring about the line y = -1: its hoops hold it
        (
            "axis",
            "(1 + y)*(Trace(H)*I + 2*Sym(H)) + u(2)*I",
            "term hoop on all : (3*u(2)/(1 + y) + Trace(H))*Test_u(2)\n",
            1e-2,
        ),
        ("ground", "Trace(H)*I + 2*Sym(H)", "term ground on low : 0.1*u.Test_u\n", 1e-2),
        ("weight", "F*(F'*F - I)", "term weight on all : 0.01*(u.Test_u + Test_u(2))\n", 1e-2),
        ("terms", "Trace(H)*I + H", "term other on all : H':Grad_Test_u\n", 1e-2),
        ("laplace", "2*H", "", 1e-2),
    ];
    for (name, law, more, load) in right {
        let ran = run(&format!("moments-right-{name}"), &bent(law, more, load), &[]);
        assert!(ran.code == 0 && ran.codes().is_empty(), "{name}: {}", ran.text);
        assert_eq!(ran.text.contains("moments not tested"), name == "laplace", "{name}: {}", ran.text);
    }
    // a micropolar body has couples
    let couple = "unknown w : scalar Q2\nfix w = 0 on west\ndef apart = H(2,1) - H(1,2) - 2*w\n\
                  term couple on all : 0.1*Grad_w.Grad_Test_w - apart*Test_w\n";
    let law = "Trace(H)*I + 2*Sym(H) + 0.5*apart*[0,-1;1,0]";
    let ran = run("moments-micropolar", &bent(law, couple, 1e-2), &[]);
    assert!(ran.codes().is_empty() && ran.text.contains("moments not tested: another unknown"), "{}", ran.text);
}

#[test]
fn a_body_that_contact_presses_on_is_no_laplacian() {
    let text = |stress: &str| {
        format!(
            "wfl 1\nmesh box [0,0] to [1,1] cells [4,4] quad\nregion floor = faces where y == 0\nregion top = faces where y == 1\n\
             unknown u : vector\nterm body on all : 200*{stress}:Grad_Test_u\n\
             term contact on floor : pos_part(1e6*(u.Normal))*(Test_u.Normal)\nfix u = [0, -0.01] on top\n"
        )
    };
    assert!(run("moments-pressed", &text("Grad_u"), &[]).tells("W514"));
    run("moments-pressed-right", &text("Sym(Grad_u)"), &[]).assert_silent();
}

#[test]
fn navier_s_form_is_right_where_the_whole_boundary_is_held() {
    let text = |fixed: &str| {
        format!(
            "wfl 1\nmesh box [0,0] to [1,1] cells [4,4] quad\nregion west = faces where x == 0\nunknown u : vector Q2\n\
             term body on all : Grad_u:Grad_Test_u + 2*Div_u*Div_Test_u\nload u = [1e-3,2e-3] on all\nfix u = [0,0] on {fixed}\n"
        )
    };
    assert!(run("mechanics-navier-free", &text("west"), &[]).tells("W514"));
    assert!(!run("mechanics-navier-held", &text("boundary"), &[]).tells("W514"));
}

#[test]
fn a_mixed_form_of_elasticity_is_a_body_and_a_flow_is_none() {
    let text = |stress: &str, volume: &str| {
        format!(
            "wfl 1\nmesh box [0,0] to [1,1] cells [4,4] quad\nregion west = faces where x == 0\nregion top = faces where y == 1\n\
             unknown v : vector Q2\nunknown p : scalar\nterm body on all : {stress}:Grad_Test_v - p*Div_Test_v - {volume}*Test_p\n\
             fix v = [0,0] on west\nload v = [0,-0.01] on top\n"
        )
    };
    assert!(run("mechanics-mixed", &text("2*Grad_v", "(Div_v + 0.01*p)"), &[]).tells("W514"));
    run("mechanics-mixed-right", &text("2*Sym(Grad_v)", "(Div_v + 0.01*p)"), &[]).assert_silent();
    run("mechanics-flow", &text("2*Grad_v", "Div_v"), &[]).assert_silent();
}

#[test]
fn an_engineering_shear_strain_for_a_component_of_the_tensor_is_told() {
    let law = |shear: f64| {
        format!("[3*H(1,1) + H(2,2), {shear}*(H(1,2) + H(2,1)); {shear}*(H(1,2) + H(2,1)), 3*H(2,2) + H(1,1)]")
    };
    // C11 = 3 and C12 = 1: isotropic with a shear modulus of 1
    for (name, shear, told) in
        [("double", 2.0, true), ("half", 0.5, true), ("right", 1.0, false), ("cubic", 0.7, false)]
    {
        assert_eq!(of_law(&format!("shear-{name}"), &law(shear), 2).tells("W515"), told, "{name}");
    }
}

#[test]
fn a_statement_that_stands_twice_is_told() {
    let body = beam("Trace(H)*I + 2*Sym(H)", 2);
    let again = |more: &str| run("mechanics-twice", &format!("{body}{more}\n"), &[]);
    assert!(again("load u = [0,-1e-4] on east").tells("W516"));
    let whole = "region whole = cells where x > -1\nterm more on whole : (2*Sym(Grad_u) + Div_u*Id(2)):Grad_Test_u";
    assert!(again(whole).tells("W516"));
    assert!(!again("load u = [0,-2e-4] on east").tells("W516"));
}

#[test]
fn a_distance_with_the_wrong_sign_is_told_where_a_mapping_knows_it() {
    // two half discs of 35 mm that touch at a point: the faces beside it are apart
    let text = |gap: &str, shift: &str| {
        format!(
            "wfl 1\nuse \"elasticity\"\nmesh file \"discs.msh\"\nunknown a : vector on upper\nunknown b : vector on lower\n\
             mapping m = project from upper_face onto lower_face within 3\ndef gap = {gap}.Normal + {shift}\n\
             term x on upper : sigma(a, 70e3, 0.3):Grad_Test_a\nterm y on lower : sigma(b, 210e3, 0.3):Grad_Test_b\n\
             term contact on upper_face : \
             5e6*pos_part((a - Interpolate(b, m)).Normal - gap)*((Test_a - Interpolate(Test_b, m)).Normal)\n\
             fix b = [0,0] on base\nfix a = [0,-0.03] on lid\n"
        )
    };
    for shift in ["0", "0.01"] {
        let wrong = run("mechanics-gap", &text("(X - Interpolate(X, m))", shift), &[]);
        assert!(wrong.tells("W517"), "{}", wrong.text);
        let right = run("mechanics-gap-right", &text("(Interpolate(X, m) - X)", shift), &[]);
        assert!(!right.tells("W517") && !right.tells("W646"), "{}", right.text);
    }
}

#[test]
fn a_contact_that_never_closes_is_told_and_one_that_opens_is_not() {
    let over = |sign: &str| {
        format!(
            "wfl 1\nmesh box [0,0] to [1,1] cells [10,10] quad\nregion base = faces where y == 0\nregion top = faces where y == 1\n\
             unknown u : vector\nterm body on all : (577*Div_u*Id(2) + 769*Sym(Grad_u)):Grad_Test_u\nfix u = [0,0] on base\n\
             def gap = x^2/4 {sign} 0.01\nterm contact on top : 1e5*pos_part(u.Normal - gap)*(Test_u.Normal)\n"
        )
    };
    assert!(run("mechanics-far", &over("+"), &[]).marked("W646").starts_with("term contact on top"));
    assert!(!run("mechanics-near", &over("-"), &[]).tells("W646"));
    let pulled = "wfl 1\nmesh box [0,0] to [2,1] cells [8,4] quad\nregion l = cells where x < 1\nregion r = cells where x > 1\n\
        region f = interface from l to r\nregion w = faces where x == 0\nregion e = faces where x == 2\nunknown a : vector on l\n\
        unknown b : vector on r\ndef j(a,b) = a - Interpolate(b, neighbor_element)\nterm x on l : 1000*Sym(Grad_a):Grad_Test_a\n\
        term y on r : 1000*Sym(Grad_b):Grad_Test_b\n\
        term c on f : 1e5*pos_part(j(a,b).Normal)*(j(Test_a,Test_b).Normal)\nfix a = [0,0] on w\nfix b = [0.1,0] on e\n";
    assert!(!run("mechanics-opens", pulled, &[]).tells("W646"));
}

#[test]
fn a_contact_on_faces_that_are_held_is_told() {
    // it acts along the normal: held along the face alone it takes part
    let held = |fix: &str| {
        let text = format!(
            "wfl 1\nmesh box [0,0] to [1,1] cells [4,4] quad\nregion base = faces where y == 0\nregion top = faces where y == 1\n\
             unknown u : vector\nterm body on all : (577*Div_u*Id(2) + 769*Sym(Grad_u)):Grad_Test_u\nfix u = [0,0] on base\n\
             term contact on top : 1e5*pos_part(u.Normal + 0.01)*(Test_u.Normal)\n{fix} on top\n"
        );
        run("mechanics-held", &text, &[])
    };
    let told = held("fix u = [0.01,-0.02]");
    assert!(told.code == 0 && told.marked("W412").starts_with("term contact on top"), "{}", told.text);
    held("fix u(1) = 0.01").assert_silent();
}

#[test]
fn a_load_beyond_the_limit_load_is_told_with_step_and_place() {
    // a strip in plane strain under tension, perfectly plastic: the limit load is 2/sqrt(3) of the yield stress, 277 MPa
    let text = |load: f64| {
        format!(
            "wfl 1\nuse \"elasticity\"\nparam E = 210e3 [MPa]\nparam q = {load} [MPa]\nparam sy = 240 [MPa]\nmesh box [0,0] to [2,1] cells [4,2] quad\n\
             region w = faces where x == 0\nregion e = faces where x == 2\nregion s = faces where y == 0\nunknown u : vector Q2 [mm]\n\
             def mu = lame_mu(E,0.3)\ndef lam = lame_lambda(E,0.3)\n\
             def eps(g) = [g(1,1), (g(1,2)+g(2,1))/2, 0; (g(1,2)+g(2,1))/2, g(2,2), 0; 0,0,0]\n\
             state ep : matrix(3,3) on all := Previous_ep + (trial - sg)/(2*mu)\ndef ee = eps(Grad_u) - Previous_ep\n\
             def trial = lam*Trace(ee)*Id(3) + 2*mu*ee\ndef sg = Von_Mises_projection(trial, sqrt(2/3)*sy)\n\
             term balance on all : (sg + 1e-4*E*eps(Grad_u)):eps(Grad_Test_u)\nload u = [q*t,0] on e\nfix u(1) = 0 on w\n\
             fix u(2) = 0 on s\nsteps t = 0 to 1 by 0.25\n"
        )
    };
    let beyond = run("mechanics-limit", &text(400.0), &[]);
    assert!(beyond.marked("W645").starts_with("unknown u") && beyond.text.contains("at t = "), "{}", beyond.text);
    let below = run("mechanics-below", &text(200.0), &[]);
    assert!(!below.tells("W645"), "{}", below.text);
}

/// A tube without units, elastic and perfectly plastic, whose law reads what its plastic strain was: a return mapping. Its limit
/// load is 2/sqrt(3) log(2) of the yield stress, and beyond it the law of small strains says nothing.
#[test]
fn a_tube_beyond_its_limit_load_is_told_in_any_words_of_its_law() {
    let text = |strain: &str, around: &str, load: f64| {
        format!(
            "wfl 1\nmesh box [1,0] to [2,0.1] cells [20,1] quad\nregion inner = faces where x == 1\nregion outer = faces where x == 2\n\
             region plates = boundary - inner - outer\nunknown u : vector Q2\n\
             def eps(v) = {strain}\ndef lam = 1000*0.3/(1.3*0.4)\ndef mu = 1000/2.6\n\
             def tr = lam*Trace(eps(u))*Id(3) + 2*mu*(eps(u) - Previous_ep)\ndef dg = pos_part(Norm(Deviator(tr)) - sqrt(2/3))/(2*mu)\n\
             def N = Normalized(Deviator(tr))\nstate ep : matrix(3,3) on all := Previous_ep + dg*N\n\
             term s on all : {around}*((tr - 2*mu*dg*N):eps(Test_u))\nfix u(2) = 0 on plates\nload u = -{around}*{load}*t*Normal on inner\n\
             steps t = 0.05 to 1 by 0.05\n"
        )
    };
    let written =
        "[[Grad_v(1,1),(Grad_v(1,2)+Grad_v(2,1))/2,0],[(Grad_v(1,2)+Grad_v(2,1))/2,Grad_v(2,2),0],[0,0,v(1)/x]]";
    let beyond = run("mechanics-tube", &text(written, "x", 0.81), &[]);
    assert!(beyond.marked("W645").starts_with("unknown u"), "{}", beyond.text);
    assert!(!run("mechanics-tube-below", &text(written, "x", 0.7), &[]).tells("W645"));
}

#[test]
fn growth_that_nothing_drives_is_told() {
    let heated = |rate: &str, source: &str| {
        format!(
            "wfl 1\nmesh box [0,0] to [1,1] cells [4,4] quad\nregion west = faces where x == 0\nunknown T : scalar\n\
             term heat on all : {rate}Dot_T*Test_T + Grad_T.Grad_Test_T\nload T = {source} on all\nfix T = 0 on west\n\
             steps t = 0 to 2 by 0.05\n"
        )
    };
    assert!(run("mechanics-grows", &heated("-", "1"), &[]).marked("W647").starts_with("unknown T"));
    for source in ["1", "t^4", "exp(10*t)", "if t > 1.5 then 1 else 0"] {
        assert!(!run("mechanics-heated", &heated("", source), &[]).tells("W647"), "{source}");
    }
}

/// A body that is fed by its own velocity, however the scene is turned, tied or stepped.
#[test]
fn growth_is_told_in_frames_with_followers_of_globals_and_in_explicit_steps() {
    let fed = |more: &str| {
        format!(
            "wfl 1\nparam a = 0\nparam c = cos(a)\nparam s = sin(a)\nmesh box [0,0] to [1,0.5] cells [4,2] quad map [c*x - s*y,s*x + c*y]\n\
             region left = faces where abs(c*x + s*y) < 1e-9\nregion bottom = faces where abs(-s*x + c*y) < 1e-9\n\
             unknown u : vector\nterm inertia on all : Dot2_u.Test_u\nterm stress on all : 100*Sym(Grad_u):Grad_Test_u\n\
             term fed on all : -20*Dot_u.Test_u\nload u = [c,s] on all\nfix u = [0,0] on left\nsteps t = 0 to 2 by 0.01\n{more}\n"
        )
    };
    let held = "fix u.Normal = 0 on bottom";
    let tied =
        "multiplier l : scalar on bottom with crosspoints=follow\nterm tie on bottom : l*Test_u(2) + u(2)*Test_l";
    for (name, more, words) in [
        ("held", held, &["a=0"][..]),
        ("turned", held, &["a=0.7"]),
        ("tied", tied, &["a=0"]),
        ("explicit", "scheme explicit", &["a=0"]),
    ] {
        let text = if name == "explicit" { fed(more).replace("by 0.01", "by 0.002") } else { fed(more) };
        let ran = run(&format!("mechanics-fed-{name}"), &text, words);
        assert!(ran.code == 0 && ran.tells("W647"), "{name}: {}", ran.text);
    }
    let global = "wfl 1\nunknown q : scalar global\nterm q on global : (Dot2_q + q - 3*Dot_q - 1)*Test_q\n\
                  mesh box [0] to [1] cells [1] segment\nsteps t = 0 to 40 by 0.05\n";
    assert!(run("mechanics-fed-global", global, &[]).tells("W647"));
}

/// A statement of a whole vector and a later one of the normal component: the later one holds, and along the face the first one
/// does, whatever the angle.
#[test]
fn a_later_normal_component_leaves_the_others() {
    for (k, angle) in [0.0, 0.7, 1.9, std::f64::consts::FRAC_PI_2].into_iter().enumerate() {
        let scene = format!(
            "wfl 1\nparam a = {angle:?}\nparam c = cos(a)\nparam s = sin(a)\nmesh box [0,0] to [1,0.5] cells [2,1] quad map [c*x - s*y,s*x + c*y]\n\
             region left = faces where abs(c*x + s*y) < 1e-9\nregion right = faces where abs(c*x + s*y - 1) < 1e-9\n\
             region bottom = faces where abs(-s*x + c*y) < 1e-9\nunknown u : vector\n\
             term stress on all : 100*Sym(Grad_u):Grad_Test_u\nfix u = [2*c - s,2*s + c]*1e-3 on left\n\
             fix u.Normal = 0 on bottom\nmeasure q1 = value(u.[c,s]) at [0,0]\nmeasure q2 = value(u.[-s,c]) at [0,0]\n\
             measure far = mean(u.[c,s]) on right\n"
        );
        let ran = run(&format!("mechanics-corner-{k}"), &scene, &[]);
        assert!(ran.code == 0 && ran.tells("W413"), "{}", ran.text);
        let (along, across, far) = (ran.last("q1"), ran.last("q2"), ran.last("far"));
        assert!((along - 2e-3).abs() < 1e-12 && across.abs() < 1e-12, "{angle}: {along} {across}");
        // of the same scene with `u(2)` in place of the normal component
        let axis = scene.replace(&format!("a = {angle:?}"), "a = 0").replace("u.Normal = 0", "u(2) = 0");
        let expected = run(&format!("mechanics-corner-{k}-axis"), &axis, &[]).last("far");
        assert!((far / expected - 1.0).abs() < 1e-9, "{angle}: {far} {expected}");
    }
}

/// A cantilever with its end load; `share` of the sag of a slender beam.
fn cantilever(cells: &str, element: &str, load: &str) -> Ran {
    let text = format!(
        "wfl 1\nmesh box [0,0] to [10,1] cells {cells}\nregion w = faces where x == 0\nregion e = faces where x == 10\n\
         unknown u : vector {element}\nterm body on all : (577*Div_u*Id(2) + 769*Sym(Grad_u)):Grad_Test_u\nfix u = [0,0] on w\n\
         load u = {load} on e\nmeasure share = mean(u(2)/(1e-6*4*1e3*0.91/1000)) on e\n"
    );
    run("mechanics-cantilever", &text, &[])
}

#[test]
fn elements_that_do_not_bend_are_told_by_the_part_that_is_missing() {
    // E = 1000, nu = 0.3, plane strain: P l^3/(3 E' I) of a slender beam, which elements of degree 2 reach to 2 %
    for (cells, element, told) in [
        ("[10,1] quad", "Q1", true),
        ("[5,2] quad", "Q1", true),
        ("[10,1] tri", "P1", true),
        ("[20,2] tri", "P1", true),
        ("[40,4] quad", "Q1", false),
        ("[80,8] tri", "P1", false),
        ("[10,1] quad", "Q2", false),
        ("[10,1] tri", "P2", false),
    ] {
        let ran = cantilever(cells, element, "[0,1e-6]");
        assert_eq!(ran.tells("W648"), told, "{cells} {element}: {}", ran.text);
        let share = ran.last("share");
        assert_eq!(share < 0.8, told, "{cells} {element}: {share} of the sag");
    }
    // in tension no element is too stiff
    for cells in ["[10,1] quad", "[20,2] tri"] {
        assert!(!cantilever(cells, "P1", "[1e-6,0]").tells("W648"), "{cells}");
    }
}

#[test]
fn a_plate_and_a_ring_of_single_cells_lock() {
    let plate = "wfl 1\nmesh box [0,0,0] to [10,10,0.1] cells [10,10,1] hex\nregion w = faces where x == 0\n\
        region e = faces where x == 10\nunknown u : vector\nterm body on all : (577*Div_u*Id(3) + 769*Sym(Grad_u)):Grad_Test_u\n\
        fix u = [0,0,0] on w\nload u = [0,0,1e-6] on e\n";
    assert!(run("mechanics-plate", plate, &[]).marked("W648").starts_with("unknown u"));
    let ring = "wfl 1\nmesh box [10,0] to [10.2,pi/2] cells [1,16] quad map [x*cos(y), x*sin(y)]\nregion a = faces where y == 0\n\
        region b = faces where x == 0\nunknown u : vector\nterm body on all : (577*Div_u*Id(2) + 769*Sym(Grad_u)):Grad_Test_u\n\
        fix u = [0,0] on a\nload u = [1e-6,0] on b\n";
    assert!(run("mechanics-ring", ring, &[]).tells("W648"));
}

#[test]
fn a_pressure_that_alternates_is_told_with_the_least_step() {
    // Terzaghi's column: M = 1 (C11 of the law), k = 1, so c = 1 and h^2/(6 c) = 1/600; at once the pressure is the load, 1
    let column = |degree: &str, step: f64| {
        let text = format!(
            "wfl 1\nmesh box [0,0] to [0.1,1] cells [1,10] quad\nregion top = faces where y == 1\nregion base = faces where y == 0\n\
             region sides = faces where x == 0 or x == 0.1\nunknown u : vector {degree}\nunknown p : scalar Q1\n\
             term body on all : Sym(Grad_u):Grad_Test_u - p*Div_Test_u\nterm fluid on all : Div_Dot_u*Test_p + Grad_p.Grad_Test_p\n\
             load u = [0,-1] on top\nfix u(1) = 0 on sides\nfix u(2) = 0 on base\nfix p = 0 on top\n\
             steps t = 0 to {} by {step}\nmeasure most = max(p) at nodes of all\n",
            3.0 * step
        );
        run("mechanics-column", &text, &[])
    };
    for degree in ["Q1", "Q2"] {
        let short = column(degree, 1e-5);
        assert!(short.tells("W649") && short.measure(1, "most") > 1.1, "{degree}: {}", short.text);
        let long = column(degree, 0.02);
        assert!(!long.tells("W649"), "{degree}: {}", long.text);
        assert!(long.measure(1, "most") < 1.05);
    }
}

/// A pressure about an absolute one of 5e7, with a mobility that grows with what it is above that: the same field as about zero.
#[test]
fn a_pressure_that_alternates_about_an_absolute_one_is_told() {
    for p0 in ["0", "5e7"] {
        let text = format!(
            "wfl 1\nparam p0 = {p0}\nmesh box [0,0] to [1,10] cells [1,20] quad\nregion bot = faces where y == 0\n\
             region top = faces where y == 10\nregion sides = faces where x == 0 or x == 1\nunknown u : vector Q2\n\
             unknown p : scalar Q1\nstart p = p0\nterm m on all : 8e9*Sym(Grad_u):Grad_Test_u - 0.8*p*Div_Test_u\n\
             term c on all : (0.8*Div_Dot_u + 1e-11*Dot_p)*Test_p + 1e-17*(1 + 1e-7*(p - p0))*Grad_p.Grad_Test_p\n\
             load u = [0,-0.8*p0] on top\nfix u(1) = 0 on sides\nfix u(2) = 0 on bot\nload p = 1e-9 on bot\nfix p = p0 on top\n\
             steps t = 0 to 1e6 by 1e5\nmeasure dp = max(p - p0) on bot\n"
        );
        let found = run(&format!("mechanics-absolute-{p0}"), &text, &[]);
        assert!(found.code == 0 && found.tells("W649"), "{p0}: {}", found.text);
    }
}

/// A body that is sheared and keeps its volume has no pressure; what rounding leaves of one alternates as it likes.
#[test]
fn a_pressure_that_is_rounding_is_not_told() {
    let text = "wfl 1\nmesh box [0,0] to [1,1] cells [6,6] quad map [x + 0.03*sin(3*y), y + 0.02*sin(4*x)]\n\
        region top = faces where y - 0.02*sin(4*x) > 0.99\nunknown u : vector Q2\nunknown p : scalar Q1\n\
        term body on all : Sym(Grad_u):Grad_Test_u - p*Div_Test_u\n\
        term fluid on all : Div_Dot_u*Test_p + 1e-9*Grad_p.Grad_Test_p\n\
        fix u = [0.3*y - 0.1*x, 0.2*x + 0.1*y] on boundary\nfix p = 0 on top\nsteps t = 0 to 1e-3 by 5e-4\n\
        measure most = max(abs(p)) at nodes of all\n";
    let found = run("mechanics-sheared", text, &[]);
    assert!(!found.tells("W649") && found.measure(1, "most") < 1e-13, "{}", found.text);
}

#[test]
fn right_scenes_with_what_is_looked_at_are_silent() {
    // a beam of units that bends on elements of degree 2
    let text = "wfl 1\nuse \"elasticity\"\nparam E = 210e3 [MPa]\nmesh box [0,0] to [100,10] cells [20,2] quad\n\
        region w = faces where x == 0\nregion e = faces where x == 100\nunknown u : vector Q2 [mm]\n\
        term body on all : sigma(u, E, 0.3):Grad_Test_u\nfix u = [0,0] on w\nload u = [0,-10] on e\nmeasure sag = mean(-u(2)) on e\n";
    let ran = run("mechanics-silent", text, &[]);
    ran.assert_silent();
    // 4 P l^3 (1 - nu^2)/(E h^3) of a slender beam
    assert!((ran.last("sag") / 1.733 - 1.0).abs() < 0.02);
}
