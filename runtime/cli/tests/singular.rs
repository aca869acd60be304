//! A tangent without an inverse, by its cause: for each the smallest scene with the words that name the cause, and a
//! scene near it that is solved.

use crate::common::{Folder, ROUGH_FLOOR};

/// Exit code and everything that is said.
fn run(name: &str, text: &str) -> (i32, String) {
    let folder = Folder::new(name);
    folder.write("scene.wfl", text);
    let output = folder.wfl(&["run", "scene.wfl", "--threads", "1"]);
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    (output.status.code().unwrap_or(-1), said)
}

/// The scene ends with E602 and these words; changed, it is solved without one.
fn cause(name: &str, text: &str, words: &[&str], cure: (&str, &str)) {
    let (code, said) = run(name, text);
    assert_eq!(code, 1, "{name}: {said}");
    assert!(said.contains("error[E602]"), "{name}: {said}");
    for word in words {
        assert!(said.contains(word), "{name} lacks {word:?}:\n{said}");
    }
    let rigid = words.iter().any(|w| w.contains("rigid"));
    assert!(
        rigid || !said.contains("rigid body motion (") && !said.contains("rigid body motions ("),
        "{name}:\n{said}"
    );
    assert!(text.contains(cure.0), "{name}: {}", cure.0);
    let (code, said) = run(&format!("{name}-cured"), &text.replace(cure.0, cure.1));
    assert!(code == 0 && !said.contains("E602"), "{name}, cured: {said}");
}

const SQUARE: &str = "mesh box [0,0] to [1,1] cells [4,4] quad
region west = faces where x == 0
region east = faces where x == 1
def sigma(v) = Div_v*Id(2) + 2*Sym(Grad_v)
";

/// Two blocks that meet at x = 1; the left one is held.
fn blocks(law: &str, rest: &str) -> String {
    format!(
        "param gamma = 10\nparam fric = 0.4\nparam E = 1\nmesh box [0,0] to [2,1] cells [8,4] quad\n\
         region left = cells where x < 1\nregion right = cells where x > 1\nregion fault = interface from left to right\n\
         region west = faces where x == 0\nregion east = faces where x == 2\nunknown uL : vector on left\n\
         unknown uR : vector on right\ndef sigma(v) = Div_v*Id(2) + 2*Sym(Grad_v)\n\
         def jump(a,b) = a - Interpolate(b, neighbor_element)\ndef tang(w) = w - (w.Normal)*Normal\n\
         term e1 on left : sigma(uL):Grad_Test_uL\nterm e2 on right : sigma(uR):Grad_Test_uR\n\
         fix uL = [0,0] on west\n{law}\n{rest}\n"
    )
}

const CONTACT: &str = "def Pn = gamma*(jump(uL,uR).Normal)
def Pt = gamma*tang(jump(uL,uR))
def force = pos_part(Pn)*Normal + Ball_projection(Pt, fric*pos_part(Pn))
term contact on fault : force.jump(Test_uL,Test_uR)";

#[test]
fn numbers_of_the_whole_scene_are_explained_by_their_equations() {
    let text = format!(
        "{SQUARE}unknown u : vector\nunknown d : scalar global\nterm elastic on all : sigma(u):Grad_Test_u\n\
         term push on east : -d*Test_u(1)\nfix u = [0,0] on west\n"
    );
    let equation = ("-d*Test_u(1)", "-d*Test_u(1) + (u(1) - 0.1)*Test_d");
    cause("no-equation", &text, &["no term has `Test_d`", "unknown d"], equation);
    let two = format!(
        "{SQUARE}unknown u : vector\nunknown a : scalar global\nunknown b : scalar global\n\
         term elastic on all : sigma(u):Grad_Test_u\n\
         term spring on east : (u(1) - a - b)*(Test_u(1) - Test_a - Test_b)\nfix u = [0.1,0] on west\n"
    );
    let told = ["`a` and `b` can change together", "linearly dependent"];
    cause(
        "two-numbers",
        &two,
        &told,
        ("fix u = [0.1,0] on west", "fix u = [0.1,0] on west\nterm hold on global : a*Test_a"),
    );
}

#[test]
fn a_multiplier_without_a_law_is_told() {
    let text = blocks(
        "multiplier l : vector on fault\nterm hold on fault : l.jump(Test_uL,Test_uR)",
        "fix uR = [0.1,0] on east",
    );
    let law = ("l.jump(Test_uL,Test_uR)", "l.jump(Test_uL,Test_uR) + jump(uL,uR).Test_l");
    cause("no-law", &text, &["no term has `Test_l`: a multiplier needs a law", "multiplier l"], law);
}

#[test]
fn modes_that_a_rule_does_not_see_are_proved_with_a_finer_one() {
    let text = format!(
        "{SQUARE}region pin = nodes where x == 0 and y == 0\nregion pin2 = nodes where x == 1 and y == 0\n\
         unknown u : vector\nterm elastic on all : sigma(u):Grad_Test_u\nquadrature on all degree 1\n\
         fix u = [0,0] on pin\nfix u(2) = 0 on pin2\nload u = [0.1,0] on east\nload u = [-0.1,0] on west\n"
    );
    let told = ["hourglass mode", "1 point of each cell", "degree 2", "`quadrature`"];
    cause("hourglass", &text, &told, ("quadrature on all degree 1\n", ""));
}

#[test]
fn a_pressure_that_alternates_or_is_constant_is_told_as_such() {
    let cavity = |v: &str, fixed: &str| {
        format!(
            "mesh box [0,0] to [1,1] cells [6,6] quad\nregion lid = faces where y == 1\n\
             region walls = faces where y == 0 or x == 0 or x == 1\nunknown v : vector {v}\nunknown p : scalar Q1\n\
             term momentum on all : 2*Sym(Grad_v):Grad_Test_v - p*Div_Test_v\nterm mass on all : -Div_v*Test_p\n\
             fix v = [4*x*(1-x),0] on lid\nfix v = [0,0] on walls\nregion corner = nodes where x == 0 and y == 0\n{fixed}"
        )
    };
    let told = ["`p` has a spurious mode that alternates", "saddle point", "higher degree"];
    cause(
        "checkerboard",
        &cavity("Q1", "fix p = 0 on corner\n"),
        &told,
        ("unknown v : vector Q1", "unknown v : vector Q2"),
    );
    let told = ["`p` is determined up to a constant only", "at one node"];
    cause("constant", &cavity("Q2", "# none\n"), &told, ("# none\n", "fix p = 0 on corner\n"));
    let heat = format!("{SQUARE}unknown T : scalar\nterm flow on all : Grad_T.Grad_Test_T\nload T = 1 on all\n");
    let told = ["`T` is determined up to a constant only"];
    cause("heat", &heat, &told, ("load T = 1 on all", "load T = 1 on all\nfix T = 0 on west"));
}

#[test]
fn contact_that_holds_nothing_is_told_by_what_it_does() {
    let pressed = "load uR = [-0.01,-0.002] on east";
    let zero = blocks(CONTACT, pressed).replace("param gamma = 10", "param gamma = 0");
    let told = ["nothing prevents 3 rigid body motions of `uR`", "`contact` gives no force for any motion"];
    cause("gamma-0", &zero, &told, ("param gamma = 0", "param gamma = 10"));
    let flipped = blocks(&CONTACT.replace(": force.jump", ": -force.jump"), pressed);
    let told = ["rigid body motion", "`contact` attracts the sides", "wrong sign"];
    cause("flipped", &flipped, &told, (": -force.jump", ": force.jump"));
    let pulled = blocks(CONTACT, "load uR = [0.01,0] on east");
    let told = ["rigid body motion", "the load pulls it away from `contact`"];
    cause("pulled", &pulled, &told, ("[0.01,0]", "[-0.01,0]"));
    let smooth = blocks(CONTACT, "load uR = [-0.01,0] on east").replace("param fric = 0.4", "param fric = 0");
    let told = ["1 rigid body motion of `uR` (1 translation)", "supports it in the normal direction only"];
    cause("smooth", &smooth, &told, ("param fric = 0\n", "param fric = 0.4\n"));
}

/// Pressed on a rough floor and pushed along it by more than friction holds.
#[test]
fn exhausted_friction_is_told() {
    let told = ["nothing prevents 1 rigid body motion of `u` (1 translation)", "friction", "friction coefficient"];
    cause("exhausted", &format!("param gamma = 1e3\n{ROUGH_FLOOR}"), &told, ("[8,-10]", "[1,-10]"));
}

#[test]
fn a_body_without_stiffness_is_told_as_terms_that_give_nothing() {
    let text = blocks("term glue on fault : 10*jump(uL,uR).jump(Test_uL,Test_uR)", "fix uR = [-0.01,0] on east")
        .replace("unknown uL", "data k : scalar P0 on all = if x < 1 then 0 else 1\nunknown uL")
        .replace("sigma(uL):Grad_Test_uL", "k*sigma(uL):Grad_Test_uL");
    let told = ["`e1`", "gives no equation for `uL`", "coefficient"];
    cause("soft", &text, &told, ("then 0 else 1", "then 2 else 1"));
}

#[test]
fn bodies_of_one_field_are_told_apart() {
    let text = "mesh box [0,0] to [3,1] cells [12,4] quad\nregion a = cells where x < 1\nregion b = cells where x > 1 and x < 2\n\
                region c = cells where x > 2\nregion ab = interface from a to b\nregion bc = interface from b to c\n\
                region west = faces where x == 0\nunknown u : vector\nsplit u across ab, bc\n\
                def sigma(v) = Div_v*Id(2) + 2*Sym(Grad_v)\ndef jump(v) = v - Interpolate(v, neighbor_element)\n\
                term elastic on all : sigma(u):Grad_Test_u\nterm glue on ab : 10*jump(u).jump(Test_u)\n\
                fix u = [0,0] on west\nload u = [0.01,0] on all\n";
    let told = ["nothing prevents 3 rigid body motions of the body of `u` around [2.5, 0.5]"];
    cause("third-body", text, &told, ("term glue on ab", "term more on bc : 10*jump(u).jump(Test_u)\nterm glue on ab"));
}

#[test]
fn a_periodic_body_keeps_its_translations() {
    let text = "mesh box [0,0] to [1,1] cells [4,4] quad\nregion west = faces where x == 0\nunknown u : vector\n\
                multiplier l : vector on west\nmapping m = point [x + 1, y]\ndef sigma(v) = Div_v*Id(2) + 2*Sym(Grad_v)\n\
                region pin = nodes where x == 0.5 and y == 0.5\nterm elastic on all : sigma(u):Grad_Test_u\n\
                term tie on west : l.(Test_u - Interpolate(Test_u, m)) + (u - Interpolate(u, m) - [0.1,0]).Test_l\n# pin\n";
    let told = ["nothing prevents 2 rigid body motions of `u` (2 translations)"];
    cause("periodic", text, &told, ("# pin\n", "fix u = [0,0] on pin\n"));
}
