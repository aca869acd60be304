//! Cells turned inside out (W616), contact zones below a face (W617), loads that their rules do not resolve (W512) and
//! nearly incompressible bodies of degree 1 (W513), against states and numbers made by hand.

use wfl_checks::locked_bodies;
use wfl_tests::{Solved, doubts, examples, solve};

fn solved(text: &str) -> Solved {
    solve(&examples(), text.to_owned(), &[], &[]).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// A cube with the uniform gradient `a` (rows) prescribed on its boundary, where the iteration starts: it solves the
/// equations of every homogeneous body.
fn uniform(a: [[f64; 3]; 3], law: &str) -> Solved {
    let rows: Vec<String> = a.iter().map(|r| format!("({:?})*x + ({:?})*y + ({:?})*z", r[0], r[1], r[2])).collect();
    let made = solved(&format!(
        "wfl 1\nmesh box [0,0,0] to [1,1,1] cells [2,2,2] hex\nunknown u : vector\ndef end = [{}]\n\
         def F = Id(3) + Grad_u\ndef E = 0.5*(F'*F - Id(3))\nterm body on all : {law}\nfix u = end on boundary\n\
         start u = end\n",
        rows.join(", ")
    ));
    assert!(made.outcome.converged());
    let free = made.at(0, "u", [0.5; 3]);
    let exact = a.map(|row| 0.5 * row.iter().sum::<f64>());
    assert!(free.iter().zip(exact).all(|(v, e)| (v - e).abs() < 1e-12), "{law}: {free:?}, not {exact:?}");
    made
}

/// A displacement gradient with det(Id + a) = 1.2 (-0.7) 0.9 - 0.3 0.2 0.9 = -0.81.
const TURNED: [[f64; 3]; 3] = [[0.2, 0.3, 0.0], [0.2, -1.7, 0.0], [0.0, 0.1, -0.1]];
/// One with det(Id + a) = 1.2 0.7 0.9 - 0.3 0.2 0.9 = 0.702.
const WHOLE: [[f64; 3]; 3] = [[0.2, 0.3, 0.0], [0.2, -0.3, 0.0], [0.0, 0.1, -0.1]];
/// Half a turn about the third axis: nothing is deformed.
const HALF_TURN: [[f64; 3]; 3] = [[-2.0, 0.0, 0.0], [0.0, -2.0, 0.0], [0.0, 0.0, 0.0]];

/// Laws of finite strain with a stress at negative volumes, as they may be written.
const LAWS: [&str; 6] = [
    "(F*(10*Trace(E)*Id(3) + 20*E)):Grad_Test_u",
    "((Id(3) + Grad_u)*(10*Trace(Grad_u + 0.5*Grad_u'*Grad_u)*Id(3) + 10*(Grad_u + Grad_u' + Grad_u'*Grad_u))):Grad_Test_u",
    "((Id(3) + Grad_u)*Saint_Venant_Kirchhoff_PK2(Grad_u, [10; 10])):Grad_Test_u",
    "(8*F + (10*(Det(F) - 1) - 8)*Det(F)*Inv(F)'):Grad_Test_u",
    "((Id(3) + Grad_u)*Compressible_Neo_Hookean_Bonet_PK2(Grad_u, [10; 10])):Grad_Test_u",
    "(F*(10*Trace(E)*Id(3) + 20*E + [1,0,0; 0,0,0; 0,0,0])):Grad_Test_u",
];

#[test]
fn cells_that_turned_are_found_with_their_determinant_however_the_law_is_written() {
    for law in LAWS {
        let told = uniform(TURNED, law).outcome.steps[0].turned.clone();
        let [cells] = told.as_slice() else { panic!("{law}: {told:?}") };
        assert_eq!((cells.term.as_str(), cells.field.as_str()), ("body", "u"), "{law}");
        assert_eq!((cells.volumes.n_cells, cells.volumes.of), (8, 8), "{law}");
        assert!((cells.volumes.smallest + 0.81).abs() < 1e-12, "{law}: {cells:?}");
        for whole in [WHOLE, HALF_TURN] {
            assert_eq!(uniform(whole, law).outcome.steps[0].turned, [], "{law}");
        }
    }
}

#[test]
fn gradients_of_what_is_no_displacement_of_finite_strain_turn_nothing() {
    for law in [
        // small strains; a fluid whose viscosity falls with the rate; a nonlinear spring against all gradients
        "(10*Div_u*Id(3) + 20*Sym(Grad_u)):Grad_Test_u",
        "((1 + Norm_sqr(Sym(Grad_u)))*Sym(Grad_u)):Grad_Test_u",
        "((1 + Norm_sqr(Grad_u))*Grad_u):Grad_Test_u",
    ] {
        assert_eq!(uniform(TURNED, law).outcome.steps[0].turned, [], "{law}");
    }
}

#[test]
fn the_smallest_determinant_is_that_of_a_measure_and_the_first_step_is_told() {
    // its boundary is prescribed, with det F = 1 - 1.6 t: no state between is whole
    let made = solved(
        "wfl 1\nmesh box [0,0,0] to [1,1,1] cells [2,2,2] hex\nunknown u : vector\ndef F = Id(3) + Grad_u\n\
         def E = 0.5*(F'*F - Id(3))\nterm body on all : (F*(10*Trace(E)*Id(3) + 20*E)):Grad_Test_u\n\
         fix u = [0,0,-1.6*t*z] on boundary\nsteps t = 0 to 1 by 0.25\nmeasure J = min(Det(F)) on all\n",
    );
    assert!(made.outcome.converged());
    let mut first = None;
    for (k, step) in made.outcome.steps.iter().enumerate() {
        let least = made.measure(k, "J");
        let told = step.turned.iter().map(|c| c.volumes.smallest).next();
        match told {
            Some(found) => assert!((found - least).abs() < 1e-12 * least.abs(), "{found}, {least}"),
            None => assert!(least > 0.0, "step {k}: {least}"),
        }
        first = first.or(told.map(|_| step.window.end));
    }
    let time = first.expect("cells turn");
    let texts: Vec<_> = doubts(&made.outcome).into_iter().filter(|(code, _)| *code == "W616").collect();
    assert_eq!(texts.len(), 1, "{texts:?}");
    assert!(texts[0].1.starts_with(&format!("at t = {time} ")), "{texts:?}");
}

#[test]
fn a_zone_of_contact_that_covers_no_face_is_counted_and_a_larger_one_is_not_told() {
    // a parabola of radius 50 pressed into six faces of 5/6: it touches up to x = sqrt(100 d)
    let zone = |depth: f64| {
        let made = solved(&format!(
            "wfl 1\nmesh box [0,-5] to [5,0] cells [6,6] quad\nunknown u : vector\nregion top = faces where y == 0\n\
             region base = faces where y == -5\nregion middle = faces where x == 0\n\
             def sigma(v) = 1.15e5*Div_v*Id(2) + 1.54e5*Sym(Grad_v)\n\
             def Pn = 4e6*(u.Normal - x^2/100 + {depth}) - (sigma(u)*Normal).Normal\n\
             term body on all : sigma(u):Grad_Test_u\nterm contact on top : pos_part(Pn)*Test_u.Normal\n\
             fix u = [0,0] on base\nfix u(1) = 0 on middle\n"
        ));
        let told: Vec<_> = doubts(&made.outcome).iter().map(|w| w.0).collect();
        (made.outcome.steps[0].narrow.clone(), told)
    };
    let (narrow, told) = zone(2e-4);
    let faces: Vec<_> = narrow.iter().map(|n| (n.term.as_str(), n.faces.some, n.faces.whole, n.faces.of)).collect();
    assert_eq!((faces, told), (vec![("contact", 1, 0, 6)], vec!["W617"]));
    assert_eq!(zone(0.05), (Vec::new(), Vec::new()), "sqrt(5) covers two faces");
}

#[test]
fn a_load_that_is_missed_is_measured_and_one_that_is_resolved_is_not_told() {
    let load = |value: &str| {
        let made = solved(&format!(
            "wfl 1\nmesh box [0] to [1] cells [8] segment\nunknown p : scalar\nregion west = faces where x == 0\n\
             term flow on all : Grad_p.Grad_Test_p\nfix p = 0 on west\nload p = {value} on all\n"
        ));
        made.scene.coarse_loads().expect("finite data")
    };
    for resolved in ["1 + x^3", "exp(x)", "1/(1 + x)", "sin(5*x)", "if x < 0.5 then 1 else 0"] {
        assert_eq!(load(resolved), [], "{resolved}");
    }
    // a peak of width 0.01 between the points, a pole, and a jump in the only cell that is loaded
    for missed in ["exp(-((x - 0.55)/0.01)^2)", "1/(1 - x)", "if x < 0.03 then 1 else 0"] {
        let told = load(missed);
        assert_eq!(told.len(), 1, "{missed}");
        assert!(told[0].share > 0.1, "{missed}: {told:?}");
    }
}

#[test]
fn nearly_incompressible_bodies_are_told_by_lames_parameters_on_degree_one_alone() {
    let body = |element: &str, nu: f64| {
        let made = solved(&format!(
            "wfl 1\nmesh box [0,0] to [1,1] cells [2,2] quad\nregion west = faces where x == 0\nparam nu = {nu}\n\
             unknown u : vector {element}\ndef sigma(v) = nu/((1+nu)*(1-2*nu))*Div_v*Id(2) + 1/(1+nu)*Sym(Grad_v)\n\
             term body on all : sigma(u):Grad_Test_u\nfix u = [0,0] on west\nload u = [1,0] on all\n"
        ));
        locked_bodies(&made.scene.at_first_step().expect("finite data").system)
    };
    let told = body("Q1", 0.4999);
    assert_eq!(told.len(), 1);
    // lambda / mu = 2 nu / (1 - 2 nu)
    assert!((told[0].ratio / (0.9998 / 0.0002) - 1.0).abs() < 1e-9, "{told:?}");
    assert_eq!(body("Q1", 0.49), []);
    assert_eq!(body("Q2", 0.4999), []);
}
