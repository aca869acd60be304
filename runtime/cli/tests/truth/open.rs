//! Contact that is open or only touches, bodies of revolution, and the same thing written in other words: right, and silent.

use super::run;
use crate::common::Folder;

/// A block above a base under a force along the face, with friction in a law of the change since the last step. Nothing
/// touches, or it touches without a force: its acceleration is that of a free body, along any direction.
#[test]
fn rates_at_the_start_are_those_of_what_does_not_touch() {
    let scene = |angle: f64, gap: f64, pull: &str| {
        format!(
            "wfl 1\nparam g = 400\nparam friction = 0.35\nparam c = cos({angle})\nparam s = sin({angle})\n\
             mesh box [0,-1] to [2,1] cells [2,2] quad map [x*c - y*s, x*s + y*c]\n\
             region low = cells where -x*s + y*c < 0\nregion up = all - low\nregion f = interface from low to up\n\
             region foot = faces where -x*s + y*c == -1\nunknown a : vector on low\nunknown b : vector on up\n\
             multiplier l : vector on f\nquadrature on f vertex\ndef other(w) = Interpolate(w, neighbor_element)\n\
             def jump = a - other(b)\ndef change = jump - Previous_a + other(Previous_b)\n\
             def p = pos_part(l.Normal + g*(jump.Normal - {gap}))\ndef q = l + g*change\n\
             term low on low : 100*Sym(Grad_a):Grad_Test_a + 0.5*Dot2_a.Test_a\n\
             term up on up : 100*Sym(Grad_b):Grad_Test_b + 0.5*Dot2_b.Test_b\n\
             term force on f : l.(Test_a - other(Test_b))\n\
             term law on f : -1/g*(l - p*Normal - Ball_projection(q - (q.Normal)*Normal, friction*p)).Test_l\n\
             fix a = [0,0] on foot\nload b = {pull} on up\nscheme newmark\nsteps t = 0 to 0.1 by 0.05\n\
             measure forward = mean(Dot2_b.[c,s]) on up\nmeasure away = mean(Dot2_b.[-s,c]) on up\n\
             measure moved = mean(Norm(b)) on up\n"
        )
    };
    for angle in [0.0, 0.6, 1.3] {
        // 2 on a density of 1/2; that contact never closes is told
        for (gap, pull, along, away) in [(0.1, "2*[c,s]", 4.0, 0.0), (0.0, "2*[-s,c]", 0.0, 4.0)] {
            let ran = run(&format!("open-start-{angle}-{gap}"), &scene(angle, gap, pull), &[]);
            assert!(ran.code == 0 && ran.codes().iter().all(|code| *code == "W646"), "{angle} {gap}: {}", ran.text);
            for step in 0..3 {
                let off = (ran.measure(step, "forward") - along).abs() + (ran.measure(step, "away") - away).abs();
                assert!(off < 1e-9, "{angle} {gap} at step {step}: {off:e}");
            }
            assert!((ran.last("moved") - 0.02).abs() < 1e-9, "{}", ran.text);
        }
    }
    // pressed on the base the law holds it from the start
    let ran = run("open-start-pressed", &scene(0.0, 0.0, "[2,-10]"), &[]);
    assert!(ran.code == 0 && ran.last("forward") < 3.0, "{}", ran.text);
}

/// Rates of first order that a wall without a force does not hold.
#[test]
fn first_rates_leave_a_wall_that_only_touches() {
    let ran = run(
        "touching-wall",
        "wfl 1\nmesh box [0] to [1] cells [4]\nregion wall = faces where x == 0\nunknown u : scalar\n\
         multiplier l : scalar on wall\nterm viscous on all : Dot_u*Test_u + Grad_u.Grad_Test_u\nload u = 2 on all\n\
         term force on wall : -l*Test_u\nterm law on wall : -1/40*(l - pos_part(l - 40*u))*Test_l\nscheme newmark\n\
         steps t = 0 to 0.4 by 0.1\nmeasure rate = min(Dot_u) on all\nmeasure moved = max(u) on wall\n",
        &[],
    );
    assert!(ran.code == 0 && ran.codes().is_empty(), "{}", ran.text);
    for step in 0..5 {
        assert!((ran.measure(step, "rate") - 2.0).abs() < 1e-9, "{step}: {}", ran.text);
    }
    assert!((ran.last("moved") - 0.8).abs() < 1e-9, "{}", ran.text);
}

/// The columns of rates in the output of a run are the velocities of the one that goes on from it.
#[test]
fn a_scene_that_starts_from_a_file_has_its_velocities() {
    let scene = |begin: &str, steps: &str| {
        format!(
            "wfl 1\nmesh box [0] to [1] cells [4]\nregion left = faces where x == 0\nunknown u : scalar\n\
             term bar on all : Grad_u.Grad_Test_u + 0.5*Dot2_u*Test_u\nfix u = 0 on left\n{begin}\n{steps}\n\
             measure end = value(u) at [1]\noutput csv \"state\" : u, Dot_u along [0] to [1] with points=5\n"
        )
    };
    let end = |folder: &Folder, name: &str, text: &str| -> f64 {
        folder.write(&format!("{name}.wfl"), text);
        let ran = folder.wfl(&["run", &format!("{name}.wfl"), "--out", name, "--threads", "1"]);
        assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
        let report = std::fs::read_to_string(folder.0.join(name).join("report.json")).expect("a report");
        let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
        let steps = report["steps"].as_array().expect("steps");
        steps.last().and_then(|step| step["measures"]["end"].as_f64()).expect("the measure")
    };
    let folder = Folder::new("truth-velocities");
    let whole = end(&folder, "whole", &scene("start Dot_u = x", "steps t = 0 to 1 by 0.05"));
    end(&folder, "first", &scene("start Dot_u = x", "steps t = 0 to 0.5 by 0.05"));
    let files = std::fs::read_dir(folder.0.join("first")).expect("results");
    let names = files.filter_map(|f| f.ok()?.file_name().into_string().ok());
    let last = names.filter(|n| n.starts_with("state_")).max().expect("a state");
    let begin = format!("start from \"first/{last}\"");
    let parts = end(&folder, "second", &scene(&begin, "steps t = 0.5 to 1 by 0.05"));
    assert!((whole - parts).abs() < 1e-9, "{whole} {parts}");
}

/// What a file cannot say of a field is refused: two values at one place, and a column that is the way along the line.
#[test]
fn a_start_that_a_file_does_not_have_is_refused() {
    let bar = |field: &str, law: &str, begin: &str| {
        format!(
            "mesh box [0] to [2] cells [8] segment\nregion l = cells where x < 1\nregion r = cells where x > 1\n\
             region f = interface from l to r\nregion ends = faces where x == 0 or x == 2\n{field}\n{law}\n{begin}\n\
             term rate on all : Dot_s*Test_s + Grad_s.Grad_Test_s\nfix s = x/2 on ends\nsteps t = 0 to 0.2 by 0.1\n"
        )
    };
    let split = bar(
        "unknown s : scalar\nsplit s across f",
        "def J = s - Interpolate(s,neighbor_element)\n\
                     term k on f : 0.1*J*(Test_s - Interpolate(Test_s,neighbor_element))",
        "",
    );
    let folder = Folder::new("truth-start-refused");
    let go = |name: &str, text: &str| {
        folder.write(&format!("{name}.wfl"), text);
        let ran = folder.wfl(&["run", &format!("{name}.wfl"), "--out", name, "--threads", "1"]);
        [&ran.stdout, &ran.stderr].map(|b| String::from_utf8_lossy(b).into_owned()).concat()
    };
    folder.write("line.csv", "x,s\n0,0\n0.25,0\n0.5,0\n0.75,0\n1,0.5\n1.25,1\n1.5,1\n1.75,1\n2,1\n");
    let told = go("split", &split.replace("term rate", "start from \"line.csv\"\nterm rate"));
    assert!(told.contains("E418") && told.contains("several values at [1"), "{told}");
    let whole = bar("unknown s : scalar", "", "");
    assert!(!go("whole", &whole.replace("term rate", "start from \"line.csv\"\nterm rate")).contains("E418"));
    folder.write(
        "way.csv",
        "s,x,u\n0,0,1\n0.25,0.25,1\n0.5,0.5,1\n0.75,0.75,1\n1,1,1\n1.25,1.25,1\n1.5,1.5,1\n1.75,1.75,1\n2,2,1\n",
    );
    let told = go("way", &whole.replace("term rate", "start from \"way.csv\"\nterm rate"));
    assert!(told.contains("E418") && told.contains("distance along the line"), "{told}");
    let told = go("column", &format!("{whole}output csv \"line\" : s as s along [0] to [2] with points=9\n"));
    assert!(told.contains("E433"), "{told}");
}

/// A block that is pressed on a base and drawn over it, with the law of the multiplier in the term of its force: the energy
/// that friction takes is the bound times the way.
#[test]
fn friction_takes_as_much_in_one_term() {
    let ran = run(
        "friction-in-one-term",
        "wfl 1\nparam g = 400\nparam friction = 0.3\nmesh box [0,-1] to [2,1] cells [4,4] quad\n\
         region low = cells where y < 0\nregion up = all - low\nregion f = interface from low to up\n\
         region foot = faces where y == -1\nregion lid = faces where y == 1\nunknown a : vector on low\n\
         unknown b : vector on up\nmultiplier l : vector on f\nquadrature on f vertex\n\
         def other(w) = Interpolate(w, neighbor_element)\ndef jump = a - other(b)\n\
         def change = jump - Previous_a + other(Previous_b)\ndef p = pos_part(l.Normal + g*(jump.Normal))\n\
         def q = l + g*change\ndef tang(w) = w - (w.Normal)*Normal\n\
         term low on low : 100*Sym(Grad_a):Grad_Test_a\nterm up on up : 100*Sym(Grad_b):Grad_Test_b\n\
         term law on f : l.(Test_a - other(Test_b)) - 1/g*(l - p*Normal - Ball_projection(tang(q), friction*p)).Test_l\n\
         fix a = [0,0] on foot\nfix b = [0.05*max(0, t - 1), -0.01*min(t, 1)] on lid\nsteps t = 1 to 5 by 1\n\
         measure taken = integral(Norm(tang(l))*Norm(tang(change))) on f\n",
        &[],
    );
    ran.assert_silent();
    let taken: f64 = (0..5).map(|step| ran.measure(step, "taken")).sum();
    // three steps slide by 0.05 under 0.3 times the load of 0.5 per length on a length of 2
    assert!(taken > 0.045 && (ran.friction_work() - taken).abs() < 1e-9 * taken, "{} {taken}", ran.friction_work());
}

/// Bodies of revolution in contact by Nitsche's method, cylinders and rings under a uniform pressure: a motion across the axis
/// strains them, and so does the overlap of a test. Forces along the axis that do not cancel are told.
#[test]
fn bodies_of_revolution_have_forces_that_cancel() {
    let scene = |theta: i32, inner: f64| {
        format!(
            "wfl 1\nparam nu = 0.3\nparam p = 10\nparam g = 3e4\nparam theta = {theta}\n\
                     mesh box [{inner},-1] to [{inner}+1,1] cells [3,4] quad\nregion low = cells where y < 0\n\
                     region up = all - low\nregion f = interface from low to up\nregion foot = faces where y == -1\n\
                     region lid = faces where y == 1\nunknown a : vector Q2 on low\n\
                     unknown b : vector Q2 on up\ndef la = 1000*nu/((1 + nu)*(1 - 2*nu))\ndef mu = 1000/(2*(1 + nu))\n\
                     def vol(v) = Div_v + v(1)/x\ndef stress(v) = la*vol(v)*Id(2) + 2*mu*Sym(Grad_v)\n\
                     def hoop(v) = la*vol(v) + 2*mu*v(1)/x\ndef jump(v,w) = v - Interpolate(w, neighbor_element)\n\
                     term low on low : x*(stress(a):Grad_Test_a) + hoop(a)*Test_a(1)\n\
                     term up on up : x*(stress(b):Grad_Test_b) + hoop(b)*Test_b(1)\n\
                     def trac(v) = stress(v)*Normal\ndef P = pos_part(g*(jump(a,b).Normal) - trac(a).Normal)\n\
                     quadrature on f degree 5\n\
                     term linear on f : -theta/g*x*trac(a).trac(Test_a)\n\
                     term contact on f : x/g*P*(Normal.(g*jump(Test_a,Test_b) - theta*trac(Test_a)))\n\
                     fix a(2) = 0 on foot\nload b = -x*p*Normal on lid\n{}measure off = max(abs(P - p)) on f\n",
            if inner == 0.0 { "region axis = faces where x == 0\nfix a(1), b(1) = 0 on axis\n" } else { "" },
        )
    };
    for (theta, inner) in [(-1, 0.5), (0, 0.0), (0, 0.5), (1, 0.5)] {
        let ran = run(&format!("revolution-{theta}-{inner}"), &scene(theta, inner), &[]);
        // W507 still comes for the other variants: their test with a stress around the axis is off by a thousandth
        assert!(ran.code == 0 && ran.codes().iter().all(|code| theta != 0 && *code == "W507"), "{}", ran.text);
        assert!(ran.last("off") < 1e-9, "{theta} {inner}: {}", ran.text);
        let wrong =
            scene(theta, inner).replace("jump(Test_a,Test_b)", "(Test_a - 2*Interpolate(Test_b, neighbor_element))");
        let ran = run(&format!("revolution-wrong-{theta}-{inner}"), &wrong, &[]);
        assert!(ran.tells("W606") && ran.text.contains("action and reaction"), "{theta} {inner}: {}", ran.text);
    }
}

/// Two shells of a sphere, along the radius: the only motion of both is a strain, so that nothing is said of their forces.
#[test]
fn shells_of_a_sphere_are_right_and_silent() {
    for theta in [0, 1] {
        let ran = run(
            &format!("sphere-{theta}"),
            &format!(
                "wfl 1\nparam nu = 0.3\nparam g = 1e5\nparam theta = {theta}\nmesh box [0] to [2] cells [20] segment\n\
                 region core = cells where x < 1\nregion shell = all - core\nregion f = interface from core to shell\n\
                 region centre = faces where x == 0\nregion rim = faces where x == 2\nunknown a : scalar P2 on core\n\
                 unknown b : scalar P2 on shell\ndef la = 1000*nu/((1 + nu)*(1 - 2*nu))\ndef mu = 1000/(2*(1 + nu))\n\
                 def radial(v) = (la + 2*mu)*Grad_v(1) + 2*la*v/x\ndef hoop(v) = la*(Grad_v(1) + 2*v/x) + 2*mu*v/x\n\
                 term core on core : x^2*(radial(a)*Grad_Test_a(1) + 2*hoop(a)*Test_a/x)\n\
                 term shell on shell : x^2*(radial(b)*Grad_Test_b(1) + 2*hoop(b)*Test_b/x)\n\
                 def jump(v, w) = v - Interpolate(w, neighbor_element)\ndef P = pos_part(g*jump(a, b) - radial(a))\n\
                 term linear on f : -theta*x^2/g*radial(a)*radial(Test_a)\n\
                 term contact on f : x^2/g*P*(g*jump(Test_a, Test_b) - theta*radial(Test_a))\nfix a = 0 on centre\n\
                 load b = -10*x^2 on rim\nmeasure p = mean(P) on f\n"
            ),
            &[],
        );
        assert!(ran.code == 0 && ran.codes().iter().all(|code| theta != 0 && *code == "W507"), "{}", ran.text);
        // a full sphere under a uniform pressure has it everywhere
        assert!((ran.last("p") - 10.0).abs() < 1e-9, "{theta}: {}", ran.text);
    }
}

/// A block that hangs above a floor: its multiplier is the rounding of nothing.
#[test]
fn a_multiplier_that_is_rounding_is_not_judged() {
    let ran = run(
        "open-hanging",
        "wfl 1\nmesh box [0,0] to [2,1] cells [4,2] quad\nregion floor = faces where y == 0\nregion lid = faces where y == 1\n\
         unknown b : vector\nmultiplier l : scalar on floor\nterm body on all : 100*Sym(Grad_b):Grad_Test_b\n\
         term force on floor : -l*Test_b(2)\nterm law on floor : -1/400*(l - pos_part(l - 400*(b(2) + 0.1)))*Test_l\n\
         quadrature on floor vertex\nload b = [1+x,-0.3] on all\nfix b = [0.1*t,0] on lid\nsteps t = 0 to 1 by 0.1\n\
         measure largest = max(abs(l)) on floor\n",
        &[],
    );
    assert!(ran.code == 0 && !ran.tells("W606") && ran.last("largest") < 1e-20, "{}", ran.text);
}

/// Components of displacements as unknowns of their own, and two multipliers in the terms of both.
#[test]
fn components_of_their_own_meet_as_vectors_do() {
    let ran = run(
        "components",
        "wfl 1\nmesh box [0,0] to [2,1] cells [4,2] quad\nregion low = cells where y < 0.5\nregion up = all - low\n\
         region f = interface from low to up\nregion foot = faces where y == 0\nregion lid = faces where y == 1\n\
         unknown a1 : scalar on low\nunknown a2 : scalar on low\nunknown b1 : scalar on up\nunknown b2 : scalar on up\n\
         multiplier n : scalar on f\nmultiplier s : scalar on f\nquadrature on f vertex\n\
         def other(w) = Interpolate(w, neighbor_element)\n\
         term low on low : 100*(Grad_a1.Grad_Test_a1 + Grad_a2.Grad_Test_a2)\n\
         term up on up : 100*(Grad_b1.Grad_Test_b1 + Grad_b2.Grad_Test_b2)\n\
         term force on f : n*(Test_a2 - other(Test_b2)) + s*(Test_a1 - other(Test_b1))\n\
         term law on f : -1/300*(n - pos_part(n + 300*(a2 - other(b2))))*Test_n - 1/300*(s - Ball_projection(s + 300*(a1 - other(b1)), 0.3))*Test_s\n\
         fix a1, a2 = 0 on foot\nfix b1 = 0.01 on lid\nfix b2 = -0.01 on lid\nmeasure p = mean(n) on f\nmeasure q = mean(s) on f\n",
        &[],
    );
    ran.assert_silent();
    // a column of stiffness 100 and height 1, and the bound of friction
    assert!((ran.last("p") - 1.0).abs() < 1e-9 && (ran.last("q").abs() - 0.3).abs() < 1e-9, "{}", ran.text);
}
