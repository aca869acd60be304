//! What `wfl check` says of the form of contact: the same in every unit, of every place of an obstacle, and nothing where it
//! cannot judge. Mistakes beside each right form are told.

use super::run;
use crate::common::Folder;

/// What is said of the contact of a scene, and the codes of messages about it.
fn said(name: &str, scene: &str, words: &[&str]) -> String {
    let folder = Folder::new(&format!("contact-form-{name}"));
    folder.write("scene.wfl", scene);
    let ran = folder.wfl(&[&["check", "scene.wfl"], words].concat());
    let text = [&ran.stdout, &ran.stderr].map(|b| String::from_utf8_lossy(b).into_owned()).concat();
    assert!(!text.contains("error["), "{text}");
    let is_said = |line: &&str| line.starts_with("contact ") || line.contains("warning[W5");
    text.lines().filter(is_said).collect::<Vec<&str>>().join("\n")
}

/// A penalty between the sides of a fracture with a fluid, whose aperture is a positive part, too. It is one in pascals as in
/// megapascals, and the fluid takes no part of what it carries.
#[test]
fn a_penalty_beside_a_fluid_is_one_in_all_units() {
    let scene = "wfl 1\nuse \"contact\"\nuse \"poro\"\nuse \"elasticity\"\nparam E = 1e10\nparam gamma = 1e13\n\
         param w0 = 1e-5\nparam mu = 1e-3\nmesh box [0,-1] to [1,1] cells [2,2] quad\nregion below = cells where y < 0\n\
         region above = cells where y > 0\nregion fracture = interface from below to above\n\
         region floor = faces where y == -1\nregion ceiling = faces where y == 1\nregion well = nodes of fracture where x == 0\n\
         unknown a : vector on below\nunknown b : vector on above\nunknown pf : scalar on fracture\n\
         term elastic_a on below : work(a, Test_a, E, 0.25)\nterm elastic_b on above : work(b, Test_b, E, 0.25)\n\
         term vol on fracture : filling(aperture(w0,a,b),pf)\n\
         term flow on fracture : along_fault(pf, cubic(aperture(w0,a,b), mu))\nterm fluid on fracture : fluid_pressure(pf, a, b)\n\
         term contact on fracture : gamma*pos_part(jump(a,b).Normal)*(Normal.jump(Test_a,Test_b))\n\
         fix a = [0,0] on floor\nfix b = [0,-1e-5] on ceiling\nsteps t = 0 to 2 by 1\nload pf = 1e-6 on well\n";
    for (k, words) in [["E=1e10", "gamma=1e13"], ["E=1e4", "gamma=1e7"], ["E=1e16", "gamma=1e19"]].iter().enumerate() {
        let right = said(&format!("fluid-{k}"), scene, words);
        assert!(right.contains("penalty: an overlap of pressure/gamma") && !right.contains("[W5"), "{right}");
        let wrong = scene.replace("(Normal.jump(Test_a,Test_b))", "(Normal.Test_a)");
        let wrong = said(&format!("fluid-wrong-{k}"), &wrong, words);
        assert!(wrong.contains("[W507]"), "{wrong}");
    }
}

/// A rigid disc that is a level set, over a block: `p*n.Test_u` with its own normal, wherever its centre is.
fn disc(place: &str, force: &str) -> String {
    format!(
        "wfl 1\nparam gamma = 1e4\nmesh box [0,0] to [2,1] cells [8,4] quad\nregion bottom = faces where y == 0\n\
         region top = faces where y == 1\nunknown u : vector\nterm e on all : 120*Sym(Grad_u):Grad_Test_u\n{place}\n\
         def n = Normalized(-w)\ndef p = gamma*pos_part(R - Norm(w))\nterm con on top : {force}\nfix u = [0,0] on bottom\n"
    )
}

#[test]
fn an_obstacle_that_curves_is_judged_along_its_own_normal() {
    let friction = "p*n.Test_u + Ball_projection(gamma*(u - (u.n)*n), 0.3*p).Test_u";
    for (k, (radius, gap)) in
        [(2.0, -0.2), (2.0, 0.01), (2.0, 0.5), (20.0, 0.0), (20.0, 3.0), (1e3, 0.5), (0.3, 0.5), (0.3, 3.0)]
            .iter()
            .enumerate()
    {
        for centre in ["1", "1.3", "1.6"] {
            let place = format!("def R = {radius}\ndef w = X + u - [{centre}, 1 + R + {gap}]");
            let name = format!("disc-{k}-{centre}");
            for gamma in ["gamma=1e1", "gamma=1e4", "gamma=1e7"] {
                let right = said(&name, &disc(&place, "p*n.Test_u"), &[gamma]);
                assert!(!right.contains("[W5"), "{place} {gamma}: {right}");
                // a small disc is not met by all faces: of those nothing is said
                assert!(
                    *radius < 1.0 || right.contains("penalty: an overlap of pressure/"),
                    "{place} {gamma}: {right}"
                );
                let right = said(&name, &disc(&place, friction), &[gamma]);
                assert!(!right.contains("[W5"), "{place} {gamma}: {right}");
            }
            let wrong = said(&name, &disc(&place, "-p*n.Test_u"), &[]);
            assert!(*radius < 1.0 || wrong.contains("[W510]"), "{place}: {wrong}");
        }
    }
}

/// Pressures that are powers of an overlap depend on units as a penalty does not, and bounded ones never reach that of the test.
#[test]
fn powers_and_bounded_pressures_are_not_called_mistakes() {
    let block = |press: &str| {
        format!(
            "wfl 1\nmesh box [0,0] to [1,1] cells [1,1] quad\nregion floor = faces where y == 0\nregion top = faces where y == 1\n\
             unknown u : vector\nterm block on all : 1000*(Sym(Grad_u):Grad_Test_u)\n\
             term contact on floor : {press}*(Test_u.Normal)\nfix u = [0,-0.01] on top\n"
        )
    };
    let laws = [
        "1e5*pos_part(u.Normal)^3",
        "1e-5*pos_part(u.Normal)^2",
        "1e12*pos_part(u.Normal)^2.5",
        "min(1e4*pos_part(u.Normal), 1e-3)",
    ];
    for (k, law) in laws.iter().enumerate() {
        let found = said(&format!("power-{k}"), &block(law), &[]);
        assert!(!found.contains("[W5"), "{law}: {found}");
    }
    let wrong = said("power-wrong", &block("-min(1e4*pos_part(u.Normal), 1e-3)"), &[]);
    assert!(wrong.contains("[W5"), "{wrong}");
}

/// A floor whose gap also conducts heat: `[gap]_+` in the equations of the temperature is no law of contact, in whatever order the
/// terms stand and also where both are one term.
#[test]
fn what_conducts_across_a_gap_is_not_taken_for_the_contact() {
    let scene = |terms: &str| {
        format!(
            "wfl 1\nmesh box [0,0] to [1,1] cells [1,1] quad\nregion floor = faces where y == 0\nregion top = faces where y == 1\n\
             unknown u : vector\nunknown T : scalar\ndef gap = 0.0047 - u.Normal\ndef p = 1e5*pos_part(-gap)\n\
             term a on all : 1000*Sym(Grad_u):Grad_Test_u\nterm b on all : Grad_T.Grad_Test_T\n{terms}\n\
             fix u = [0,-0.01*t] on top\nfix T = 1 on top\nsteps t = 0.1 to 1 by 0.1\nmeasure P = integral(p) on floor\n"
        )
    };
    let press = "p*(Test_u.Normal)";
    for (k, heat) in ["T*Test_T/(pos_part(gap) + 1e-3)", "(1 + 10*pos_part(gap))*T*Test_T"].iter().enumerate() {
        let first = format!("term f on floor : {press}\nterm g on floor : {heat}");
        let last = format!("term g on floor : {heat}\nterm f on floor : {press}");
        let (one, other) =
            (format!("term f on floor : {press} + {heat}"), format!("term f on floor : {heat} + {press}"));
        for (l, terms) in [first, last, one, other].iter().enumerate() {
            let found = said(&format!("conducts-{k}-{l}"), &scene(terms), &[]);
            assert!(found.contains("penalty: an overlap of pressure/1") && !found.contains("[W5"), "{terms}: {found}");
            let ran = run(&format!("conducts-{k}-{l}"), &scene(terms), &[]);
            ran.assert_silent();
            assert!(ran.last("P") > 1.0, "{terms}: {}", ran.text);
        }
    }
}

/// Two bars that meet within a step, with a conductance of the gap in the term of their contact: that they have met is seen.
#[test]
fn bars_that_meet_and_conduct_are_known_to_have_met() {
    let scene = |heat: &str, way: &str| {
        format!(
            "wfl 1\nmesh box [0] to [2] cells 4 segment\nregion L = cells where x < 1\nregion R = cells where x > 1\n\
             region c = interface from L to R\nregion hot = faces where x == 0\nregion cold = faces where x == 2\n\
             unknown uL : scalar on L\nunknown uR : scalar on R\nunknown TL : scalar on L\nunknown TR : scalar on R\n\
             def gap = 5e-3 - (uL - Interpolate(uR, neighbor_element))\ndef p = 1e6*pos_part(-gap)\n\
             term a on L : 1000*Grad_uL(1)*Grad_Test_uL(1)\nterm b on R : 1000*Grad_uR(1)*Grad_Test_uR(1)\n\
             term d on L : Grad_TL.Grad_Test_TL\nterm e on R : Grad_TR.Grad_Test_TR\n\
             term f on c : p*(Test_uL - Interpolate(Test_uR, neighbor_element)) + \
             {heat}*(TL - Interpolate(TR, neighbor_element))*(Test_TL - Interpolate(Test_TR, neighbor_element))\n\
             fix uL = {way}*t on hot\nfix uR = 0 on cold\nfix TL = 1 on hot\nfix TR = 0 on cold\nsteps t = 0 to 1 by 0.1\n\
             measure P = integral(p) on c\n"
        )
    };
    // P = 0.015/(2/1000 + 1e-6)
    for (k, heat) in ["2e-3/(pos_part(gap) + 1e-3)", "(1 + 10*pos_part(gap))"].iter().enumerate() {
        let met = run(&format!("bars-{k}"), &scene(heat, "0.02"), &[]);
        met.assert_silent();
        assert!((met.last("P") / 7.496_251_8 - 1.0).abs() < 1e-6, "{}", met.text);
        // a weak bond that holds the open gap is no contact, either
        let bond = scene(heat, "0.02").replace("def p = ", "def p = -0.1*pos_part(gap) + ");
        run(&format!("bars-bond-{k}"), &bond, &[]).assert_silent();
        let apart = run(&format!("bars-apart-{k}"), &scene(heat, "0.004"), &[]);
        assert!(apart.tells("W646"), "{}", apart.text);
    }
}

/// A sector of a tube under pressure whose ends are tied as they repeat around the axis: the force on one end is that on the other turned, and
/// their sum is none. That was told as a wrong test function. Lame: A r + B/r with 200 A = 25 B and 200 A - 100 B = -1.
#[test]
fn the_ends_of_a_sector_balance_as_they_are_turned() {
    let text = |test: &str| {
        format!(
            "param a = 0.7\nmesh box [1,0] to [2,a] cells [8,6] quad map [x*cos(y),x*sin(y)]\n\
             region inner = faces where abs(x^2+y^2-1) < 0.03\nregion end = faces where abs(y*cos(a) - x*sin(a)) < 1e-9\n\
             region pin = nodes where abs(x-1) < 1e-9 and abs(y) < 1e-9\nunknown u : vector Q2\n\
             def back(w) = [cos(a)*w(1)+sin(a)*w(2), -sin(a)*w(1)+cos(a)*w(2)]\n\
             mapping m = point [cos(a)*x+sin(a)*y, -sin(a)*x+cos(a)*y]\nmultiplier f : vector Q2 on end\n\
             term b on all : 100*(Sym(Grad_u):Sym(Grad_Test_u)) + 50*Div_u*Div_Test_u\n\
             term tie on end : f.({test}) + Test_f.(back(u) - Interpolate(u, m))\nload u = -1*Normal on inner\n\
             fix u(2) = 0 on pin\nmeasure ur = value(u.[cos(0.3),sin(0.3)]) at [1.5*cos(0.3),1.5*sin(0.3)]\n"
        )
    };
    let ran = run("sector", &text("back(Test_u) - Interpolate(Test_u, m)"), &[]);
    assert!(ran.code == 0 && !ran.tells("W606"), "{}", ran.text);
    assert!((ran.last("ur") / (1.5 / 600.0 + 8.0 / 900.0) - 1.0).abs() < 1e-5, "{}", ran.text);
    let ran = run("sector-wrong", &text("back(Test_u) - 0.5*Interpolate(Test_u, m)"), &[]);
    assert!(ran.code != 0 || ran.tells("W606"), "{}", ran.text);
}
