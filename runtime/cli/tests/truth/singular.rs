//! Bodies that are held are solved, those that are not are told why; every run ends.

use super::{Ran, run};

/// A strip of length `length` and height 1, turned by `turned` degrees, held by `held`, with a force of 1e-6 across its end.
/// `tip` is the deflection over that of a beam in plane strain, 4 P L^3 (1 - nu^2)/E.
fn strip(length: f64, mesh: &str, element: &str, nu: f64, turned: f64, held: &str) -> String {
    format!(
        "param L = {length}\nparam E = 1000\nparam nu = {nu}\nparam a = {turned}*pi/180\n\
         mesh box [0,0] to [L,1] cells {mesh} map [x*cos(a) - y*sin(a), x*sin(a) + y*cos(a)]\n\
         def s = x*cos(a) + y*sin(a)\nregion root = faces where abs(s) < 1e-9*L\nregion end = faces where abs(s-L) < 1e-9*L\n\
         region pin = nodes where abs(x) < 1e-9 and abs(y) < 1e-9\nunknown u : vector {element}\n\
         term body on all : (E*nu/((1+nu)*(1-2*nu))*Div_u*Id(2) + E/(1+nu)*Sym(Grad_u)):Grad_Test_u\n{held}\n\
         load u = 1e-6*[-sin(a),cos(a)] on end\n\
         measure tip = mean(u.[-sin(a),cos(a)]/(4e-6*L^3*(1-nu^2)/E)) on end\n"
    )
}

fn assert_held(name: &str, scene: &str, part: f64) {
    let ran = run(name, scene, &[]);
    assert!(ran.code == 0 && !ran.tells("W605"), "{name}: {}", ran.text);
    assert!((ran.last("tip") - 1.0).abs() < part, "{name}: {}", ran.last("tip"));
}

fn assert_loose(name: &str, scene: &str, words: &[&str]) -> Ran {
    let ran = run(name, scene, &[]);
    assert!(ran.code == 1 && ran.tells("E602"), "{name}: {}", ran.text);
    words.iter().for_each(|word| assert!(ran.text.contains(word), "{name} lacks {word}: {}", ran.text));
    ran
}

/// Euler's and Bernoulli's beam; a slenderness of 1000 is a condition number of 1e14 and more.
#[test]
fn slender_bodies_are_solved() {
    let root = "fix u = [0,0] on root";
    for (k, (length, mesh, element, nu, turned)) in [
        (10.0, "[40,2] quad", "Q2", 0.3, 0.0),
        (100.0, "[100,2] quad", "Q2", 0.49999, 0.0),
        (1000.0, "[200,2] quad", "Q2", 0.3, 17.0),
        (1000.0, "[200,2] tri", "P2", 0.3, 30.0),
    ]
    .into_iter()
    .enumerate()
    {
        assert_held(&format!("slender-{k}"), &strip(length, mesh, element, nu, turned, root), 0.015);
    }
}

/// Free motions of the same strips, whatever their length and direction.
#[test]
fn slender_bodies_that_nothing_holds_are_told() {
    for (k, length) in [1.0, 1000.0, 10_000.0].into_iter().enumerate() {
        for turned in [0.0, 17.0] {
            let of = |held: &str| strip(length, "[40,2] quad", "Q2", 0.3, turned, held);
            let name = |what: &str| format!("loose-{what}-{k}-{turned}");
            let all = "3 rigid body motions of `u` (2 translations, 1 rotation)";
            assert_loose(&name("all"), &of(""), &[all]);
            let turn = "1 rigid body motion of `u` (1 rotation about [0, 0])";
            assert_loose(&name("pin"), &of("fix u = [0,0] on pin"), &[turn]);
        }
    }
}

/// A body so long and thin that its stiffness is lost in the rounding of the matrix is held all the same.
#[test]
fn a_stiffness_that_rounding_hides_is_told_as_such() {
    let scene = strip(1e5, "[100,2] quad", "Q2", 0.3, 0.0, "fix u = [0,0] on root");
    let ran = assert_loose("hidden", &scene, &["rounding of its entries hides what holds `u`"]);
    assert!(!ran.text.contains("nothing prevents"), "{}", ran.text);
}

/// Two bodies in a row, the second one K times as stiff as the first: u(1) = 0.5/E*(1 + 1/K) at the end, since nu = 0.
#[test]
fn bodies_of_very_different_stiffness_are_solved() {
    for k in ["1e6", "1e10", "1e12"] {
        let scene = format!(
            "param K = {k}\nparam E = 1000\nmesh box [0,0] to [1,1] cells [8,8] tri\nregion west = faces where x == 0\n\
             region east = faces where x == 1\nunknown u : vector\ndef c = if x > 0.5 then K else 1\n\
             term body on all : c*E*Sym(Grad_u):Grad_Test_u\nfix u = [0,0] on west\nload u = [1,0] on east\n\
             measure tip = mean(u(1)/(0.5/E*(1 + 1/K))) on east\n"
        );
        assert_held(&format!("contrast-{k}"), &scene, 1e-6);
    }
}

/// Components of a symmetry on the wrong faces leave a rotation, and contact has nothing to do with it.
#[test]
fn a_symmetry_on_the_wrong_component_is_told() {
    let scene = "mesh box [1,0] to [3,pi/2] cells [4,6] quad map [x*cos(y), x*sin(y)]\n\
        region inner = cells where x^2+y^2 < 4\nregion outer = cells where x^2+y^2 > 4\n\
        region fit = interface from inner to outer\nregion flat = faces where y == 0\nregion steep = faces where abs(x) < 1e-9\n\
        unknown a : vector on inner\nunknown b : vector on outer\ndef jump(v,w) = v - Interpolate(w, neighbor_element)\n\
        def sigma(v) = 400*Div_v*Id(2) + 800*Sym(Grad_v)\nterm ea on inner : sigma(a):Grad_Test_a\n\
        term eb on outer : sigma(b):Grad_Test_b\n\
        term contact on fit : 1e4*pos_part(jump(a,b).Normal + 0.01)*(jump(Test_a,Test_b).Normal)\n\
        fix a(1) = 0 on flat\nfix b(1) = 0 on flat\nfix a(2) = 0 on steep\nfix b(2) = 0 on steep\n";
    let ran = assert_loose(
        "symmetry",
        scene,
        &["rotation about [0, 0]", "plane of symmetry", "`a(1)`, and not `a(2)`, where y = 0"],
    );
    assert!(!ran.text.contains("wrong sign"), "{}", ran.text);
}

/// A pressure in the gap beyond the weight: at t = 0.5 it is 0.5 of it, at t = 2 twice.
#[test]
fn a_body_that_a_pressure_lifts_is_told() {
    let scene = "mesh box [0,0] to [1,1] cells [2,2] quad\nregion floor = faces where y == 0\nunknown u : vector\n\
        term body on all : 1000*Sym(Grad_u):Grad_Test_u\ndef Pn = 1e4*(u.Normal) - t\n\
        def tang(w) = w - (w.Normal)*Normal\n\
        def force = (t + pos_part(Pn))*Normal + Ball_projection(1e4*tang(u), 0.5*pos_part(Pn))\n\
        term contact on floor : force.Test_u\nload u = [0,-1] on all\nsteps t = 0 to 2 by 0.5\n";
    let ran = assert_loose("lifted", scene, &["lifts the body off"]);
    assert!(!ran.text.contains("friction does not balance"), "{}", ran.text);
}

/// Forces of the wrong sign are named before anything is solved.
#[test]
fn forces_of_the_wrong_sign_are_told_at_once() {
    let punch = "mesh box [0,0] to [1,1] cells [4,4] quad\nregion base = faces where y == 0\nregion top = faces where y == 1\n\
        unknown u : vector\nunknown d : scalar global\nstart d = 0.01\nterm body on all : 1000*Sym(Grad_u):Grad_Test_u\n\
        term contact on top : 1e4*pos_part(u(2) + d - x^2/10)*(Test_u(2) + Test_d)\nterm weight on global : 2*Test_d\n\
        fix u = [0,0] on base\nmeasure depth = mean(d) on global\n";
    let ran = run("punch", punch, &[]);
    assert!(ran.code == 1 && ran.tells("E613") && !ran.tells("E403"), "{}", ran.text);
    let ran = run("punch-right", &punch.replace("2*Test_d\n", "-2*Test_d\n"), &[]);
    assert!(ran.code == 0 && !ran.tells("E613"), "{}", ran.text);
    let bond = "mesh box [0,-1] to [4,1] cells [8,4] quad\nregion low = cells where y < 0\nregion up = cells where y > 0\n\
        region mid = interface from low to up\nregion right = faces where x == 4\nregion left = faces where x == 0\n\
        unknown a : vector on low\nunknown b : vector on up\ndef w = Interpolate(b, neighbor_element) - a\n\
        state k : scalar on mid := max(Previous_k, pos_part(w.Normal))\nstart k = 1e-3\n\
        def top = max(Previous_k, pos_part(w.Normal))\ndef damage = min(0.1*(top - 1e-3)/(top*0.099), 1)\n\
        def tn = 1e4*(1-damage)*pos_part(w.Normal) - 1e4*neg_part(w.Normal)\n\
        term ea on low : 1000*Sym(Grad_a):Grad_Test_a\nterm eb on up : 1000*Sym(Grad_b):Grad_Test_b\n\
        term bond on mid : tn*(Normal.(Test_a - Interpolate(Test_b, neighbor_element)))\nfix a = [0,0] on right\n\
        fix b = [0,0] on right\nfix a(2) = -1e-4*t on left\nfix b(2) = 1e-4*t on left\nsteps t = 0 to 1 by 0.5\n";
    let ran = run("bond", bond, &[]);
    assert!(ran.code == 1 && ran.tells("E614") && !ran.tells("W602"), "{}", ran.text);
    let right = bond.replace(
        "(Test_a - Interpolate(Test_b, neighbor_element))",
        "(Interpolate(Test_b, neighbor_element) - Test_a)",
    );
    let ran = run("bond-right", &right, &[]);
    assert!(ran.code == 0 && !ran.tells("E614"), "{}", ran.text);
}

/// A column of a porous body; `base` holds it or not.
fn column(base: &str, steps: &str) -> String {
    format!(
        "param E = 10\nmesh box [0,0] to [2,10] cells [1,8] quad\nregion base = faces where y == 0\n\
         region top = faces where y == 10\nregion sides = faces where x == 0 or x == 2\nunknown u : vector Q2\n\
         unknown p : scalar Q1\nterm momentum on all : (E*Sym(Grad_u) - p*Id(2)):Grad_Test_u\n\
         term storage on all : Div_Dot_u*Test_p\nterm flow on all : 1e-3*Grad_p.Grad_Test_p\nload u = [0,-1] on top\n\
         fix u(1) = 0 on sides\n{base}\n{steps}\nmeasure low = min(p) on all\nmeasure high = max(p) on all\n"
    )
}

/// Without a drained face the pressure carries the load, p = 1, and nothing moves, at all times.
#[test]
fn an_undrained_column_is_solved() {
    for (name, steps) in
        [("fixed", "steps t = 0 to 1000 by 100"), ("auto", "steps t = 0 to 1000 by auto with first=1e-4")]
    {
        let ran = run(&format!("undrained-{name}"), &column("fix u(2) = 0 on base", steps), &[]);
        assert!(ran.code == 0 && !ran.tells("W605"), "{name}: {}", ran.text);
        for measure in ["low", "high"] {
            assert!((ran.last(measure) - 1.0).abs() < 1e-9, "{name}: {}", ran.last(measure));
        }
    }
}

/// A column that nothing holds upright: at once, with fixed steps and with steps by auto.
#[test]
fn steps_by_auto_end_where_nothing_holds_a_body() {
    for (name, steps) in
        [("fixed", "steps t = 0 to 1000 by 20"), ("auto", "steps t = 0 to 1000 by auto with first=1e-4")]
    {
        let scene = column("fix p = 0 on top", steps);
        assert_loose(&format!("column-{name}"), &scene, &["1 rigid body motion of `u` (1 translation)"]);
    }
}

/// Periodic by a multiplier, with both sides of a corner prescribed; periodic in both directions.
#[test]
fn multipliers_across_a_mapping_lose_what_is_redundant() {
    let corner = "mesh box [0,0] to [1,1] cells [6,6] quad\nregion top = faces where y == 1\nregion west = faces where x == 0\n\
        region floor = faces where y == 0\nmapping over = point [x + 1, y]\nunknown u : vector Q2\nmultiplier m : vector Q2 on west\n\
        def apart(v) = v - Interpolate(v, over)\nterm body on all : 1000*Sym(Grad_u):Grad_Test_u\n\
        term tie on west : m.apart(Test_u) + Test_m.apart(u)\nfix u = [0,-0.01] on top\nload u = [0,10] on floor\n\
        measure low = mean(u(2)) on floor\n";
    let ran = run("periodic-corner", corner, &[]);
    // a column with nu = 0: -0.01 + 10/1000
    assert!(ran.code == 0 && ran.tells("W404"), "{}", ran.text);
    assert!(ran.last("low").abs() < 1e-9, "{}", ran.last("low"));
    let both = "mesh box [0,0] to [1,1] cells [4,4] quad\nregion south = faces where y == 0\nregion west = faces where x == 0\n\
        region pin = nodes where x == 0.5 and y == 0.5\nmapping over = point [x + 1, y]\nmapping up = point [x, y + 1]\n\
        unknown u : vector\nmultiplier m : vector on west\nmultiplier l : vector on south\n\
        term body on all : 1000*Sym(Grad_u):Grad_Test_u\n\
        term tie on west : m.(Test_u - Interpolate(Test_u, over)) + Test_m.(u - Interpolate(u, over) + [0.01,0])\n\
        term tie2 on south : l.(Test_u - Interpolate(Test_u, up)) + Test_l.(u - Interpolate(u, up))\n\
        fix u = [0,0] on pin\nmeasure stretch = mean(Grad_u(1,1)) on all\n";
    let ran = run("periodic-both", both, &[]);
    assert!(ran.code == 0 && (ran.last("stretch") - 0.01).abs() < 1e-9, "{}", ran.text);
}

/// More multipliers than displacements on a crack: the cure is a higher degree of the displacement.
#[test]
fn a_multiplier_that_is_constant_on_faces_is_told_its_cure() {
    let scene = "param n = 12\nmesh box [-1.5,-1] to [1.5,1] cells [n,n] tri\nregion low = cells where y < 0\n\
        region up = cells where y > 0\nregion crack = interface from low to up & faces of low where y == 0 and abs(x) < 0.5001\n\
        region bottom = faces where y == -1\nregion top = faces where y == 1\nunknown u : vector P1\nsplit u across crack\n\
        multiplier l : scalar DP0 on crack\ndef jump(a) = a - Interpolate(a, neighbor_element)\n\
        term body on all : (400*Div_u*Id(2) + 800*Sym(Grad_u)):Grad_Test_u\n\
        term couple on crack : l*(jump(Test_u).Normal) + (jump(u).Normal)*Test_l\nfix u = [0,0] on bottom\n\
        fix u = [0,-0.001] on top\n";
    let ran = assert_loose("p0", scene, &["a higher degree for `u`: P2"]);
    assert!(!ran.text.contains("lower degree"), "{}", ran.text);
    let ran = run("p0-cured", &scene.replace("vector P1", "vector P2"), &[]);
    assert!(ran.code == 0, "{}", ran.text);
}

/// Steps by auto ask for leave, too, and an error below rounding is none.
#[test]
fn steps_by_auto_are_limited() {
    let scene = |options: &str| {
        format!(
            "mesh box [0] to [1] cells [2] segment\nunknown u : scalar\nterm a on all : Dot_u*Test_u - Test_u\n\
             steps t = 0 to 1 by auto with {options}\n"
        )
    };
    assert!(run("most", &scene("most=1e-9"), &[]).tells("E430"));
    assert!(run("error", &scene("error=1e-17"), &[]).tells("E414"));
    run("right", &scene("most=0.1, error=1e-6"), &[]).assert_silent();
}

/// Three blocks on each other under their weight; the middle one is pushed beyond what friction below it holds, and carries
/// the upper one with it: as fields of their own, and as one field that is torn.
#[test]
fn blocks_that_slide_together_are_told_together() {
    let blocks = "mesh box [0,0] to [1,3] cells [3,9] quad\nregion a = cells where y < 1\nregion b = cells where y > 1 and y < 2\n\
        region c = cells where y > 2\nregion floor = faces where y == 0\nregion ab = interface from a to b\n\
        region bc = interface from b to c\nregion west = faces of b where x == 0\n\
        def body(v, w) = 1e4*(Sym(Grad_v) + Div_v*Id(2)):Grad_w + w(2)\ndef tang(w) = w - (w.Normal)*Normal\n\
        def force(j) = 1e5*pos_part(j.Normal)*Normal + Ball_projection(1e5*tang(j), 0.5e5*pos_part(j.Normal))\n\
        def beyond(v) = Interpolate(v, neighbor_element)\nsteps t = 0 to 1.2 by 0.3\n";
    let fields = "unknown ua : vector on a\nunknown ub : vector on b\nunknown uc : vector on c\nterm a on a : body(ua, Test_ua)\n\
        term b on b : body(ub, Test_ub)\nterm c on c : body(uc, Test_uc)\n\
        term low on ab : force(ua - beyond(ub)).(Test_ua - beyond(Test_ub))\n\
        term high on bc : force(ub - beyond(uc)).(Test_ub - beyond(Test_uc))\n\
        fix ua = [0,0] on floor\nload ub = [t,0] on west\n";
    let torn = "unknown u : vector\nsplit u across ab, bc\nterm body on all : body(u, Test_u)\n\
        term low on ab : force(u - beyond(u)).(Test_u - beyond(Test_u))\n\
        term high on bc : force(u - beyond(u)).(Test_u - beyond(Test_u))\nfix u = [0,0] on floor\nload u = [t,0] on west\n";
    let told =
        ["1 rigid body motion of `ub` and `uc` (1 translation)", "presses it on `low`;", "friction does not balance"];
    assert_loose("stack-fields", &(blocks.to_owned() + fields), &told);
    assert_loose(
        "stack-torn",
        &(blocks.to_owned() + torn),
        &["1 rigid body motion of `u` (1 translation)", "friction"],
    );
}
