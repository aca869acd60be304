//! An equation times -1 is the same equation, and a mesh with one cell more the same body: what is said of the stability of a
//! state depends on neither, though the determinant of the tangent changes its sign with each row that does.

use super::run;

/// What is said of the stability of the state at the end of a scene: nothing where it is stable.
fn told(name: &str, scene: &str) -> String {
    let ran = run(name, scene, &[]);
    assert!(ran.code == 0 && !ran.tells("E603"), "{name}: {}", ran.text);
    let message = ran.text.lines().find(|line| line.contains("[W640]"));
    message.unwrap_or_default().to_owned()
}

/// What is said of a scene with each set of signs of its equations (`A`, `B`, `C`) and each number of cells (`N`).
fn told_of_all(name: &str, scene: &str, cells: [usize; 2]) -> Vec<(String, String)> {
    let mut all = Vec::new();
    for n in cells {
        for signs in 0..8 {
            let sign = |bit: usize| if signs & (1 << bit) == 0 { "1" } else { "(-1)" };
            if signs > 3 && !scene.contains("C*") {
                continue;
            }
            let scene = scene
                .replace("A*", &format!("{}*", sign(0)))
                .replace("B*", &format!("{}*", sign(1)))
                .replace("C*", &format!("{}*", sign(2)))
                .replace("CELLS", &n.to_string());
            all.push((
                format!("{name}, {n} cells, signs {signs:03b}"),
                told(&format!("signs-{name}-{n}-{signs}"), &scene),
            ));
        }
    }
    all
}

fn assert_stable(name: &str, scene: &str, cells: [usize; 2]) {
    for (which, told) in told_of_all(name, scene, cells) {
        assert_eq!(told, "", "{which}");
    }
}

/// A column of a nearly incompressible body, 1 wide and 10 high, clamped below, with a pressure as unknown. Euler's load of a
/// cantilever is pi^2 E I/(4 L^2) = 0.0082, the second one nine times as much.
fn column(law: &str, kind: &str, load: f64) -> String {
    format!(
        "mesh box [0,0] to [1,10] cells [2,CELLS] quad\nregion bot = faces where y == 0\nregion top = faces where y == 10\n\
         unknown u : vector Q2\n{kind} h : scalar Q1\ndef F = Id(2) + Grad_u\ndef J = Det(F)\n\
         term s on all : A*((F + (h - 1)*Inv(F)'):Grad_Test_u)\nterm c on all : B*({law} - h/100)*Test_h\n\
         fix u = [0,0] on bot\nload u(2) = -A*{load:?}*t on top\nsteps t = 0.25 to 1 by 0.25\n"
    )
}

/// Of the row `log(J)` the tangent is symmetric, up to signs; of the row `J - 1` it is not.
#[test]
fn a_column_beyond_eulers_load_is_told_however_its_pressures_are_counted_and_signed() {
    for (name, law, kind, bulk) in [
        ("log", "log(J)", "unknown", "h/100"),
        ("det", "(J - 1)", "unknown", "h/100"),
        ("multiplier", "(J - 1)", "multiplier", "h/100"),
        ("incompressible", "(J - 1)", "unknown", "h/1e13"),
    ] {
        let [below, above] = [0.0065, 0.03].map(|load| column(law, kind, load).replace("h/100", bulk));
        assert_stable(&format!("{name}-below"), &below, [10, 11]);
        for (which, told) in told_of_all(&format!("{name}-above"), &above, [10, 11]) {
            // 0.0075 is below the critical load, 0.015 above
            assert!(told.contains("at t = 0.5 the equilibrium"), "{which}: {told}");
            let directions = if law == "log(J)" { "in 1 direction" } else { "an odd number of directions" };
            assert!(told.contains(directions), "{which}: {told}");
        }
    }
}

/// `perturb` does nothing beside pressures, and is not recommended there.
#[test]
fn what_does_nothing_beside_pressures_is_not_recommended() {
    let scene = column("log(J)", "unknown", 0.03).replace("CELLS", "10").replace("A*", "").replace("B*", "");
    for words in [&[] as &[&str], &["perturb=1e-3"]] {
        let ran = run("signs-perturb", &scene, words);
        assert!(ran.tells("W640") && ran.text.contains("to the side of 1e-4"), "{}", ran.text);
        assert!(!ran.tells("W605"), "what was tried leaves no doubt: {}", ran.text);
        assert!(
            !ran.text.contains("`perturb=1e-6` follows") && ran.text.contains("changes nothing here"),
            "{}",
            ran.text
        );
    }
}

/// A tube that is widened, with pressures whose row is not the transpose of their column; a sphere whose inner volume is
/// prescribed, with pressures and a number whose couplings are symmetric and skew.
#[test]
fn tubes_and_spheres_with_pressures_are_stable() {
    let tube = "mesh box [1] to [1.2] cells [CELLS] segment\nregion inner = faces where x == 1\nunknown u : scalar P2\n\
                unknown h : scalar P1\ndef lt = 1 + u/x\ndef lr = 1 + Grad_u(1)\n\
                term s on all : A*x*((lr + (h - 1)*lt)*Grad_Test_u(1) + (lt + (h - 1)*lr)*Test_u/x)\n\
                term c on all : B*x*(log(lr*lt) - h/1000)*Test_h\nload u = A*0.05*t*(x + u) on inner\n\
                steps t = 0 to 1 by 0.25\n";
    assert_stable("tube", tube, [10, 11]);
    assert_stable("tube-cells", &tube.replace("scalar P1", "scalar DP0"), [10, 11]);
    let sphere = "mesh box [1] to [1.2] cells [CELLS] segment\nregion inner = faces where x == 1\nunknown u : scalar P2\n\
                  unknown h : scalar P1\nunknown p : scalar global\ndef lt = 1 + u/x\ndef lr = 1 + Grad_u(1)\n\
                  term s on all : A*x^2*((lr + (h - 1)*lt^2)*Grad_Test_u(1) + 2*(lt + (h - 1)*lr*lt)*Test_u/x)\n\
                  term c on all : B*x^2*(lr*lt^2 - 1 - h/1e5)*Test_h\nterm infl on inner : -A*p*(x + u)^2*Test_u\n\
                  term vol on inner : C*((x + u)^3/3 - (1 + t)/3)*Test_p\nsteps t = 0 to 3 by 1\n";
    assert_stable("sphere", sphere, [10, 11]);
}

/// Plane stress at finite strain with the thickness as unknown, and a bar with damage below its peak.
#[test]
fn thickness_and_damage_have_rows_of_either_sign() {
    let sheet = "mesh box [0,0] to [2,1] cells [CELLS,1] quad\nregion l = faces where x == 0\nregion b = faces where y == 0\n\
                 region r = faces where x == 2\nunknown u : vector Q2\nunknown k : scalar DP0\nstart k = 1\n\
                 def F = [[1+Grad_u(1,1),Grad_u(2,1),0],[Grad_u(1,2),1+Grad_u(2,2),0],[0,0,k]]\n\
                 def P = 38*(F - Inv(F)') + 57*log(Det(F))*Inv(F)'\n\
                 term e on all : A*(P(1,1)*Grad_Test_u(1,1) + P(1,2)*Grad_Test_u(1,2) + P(2,1)*Grad_Test_u(2,1) \
                 + P(2,2)*Grad_Test_u(2,2))\nterm z on all : B*P(3,3)*Test_k\nfix u(1) = 0 on l\nfix u(2) = 0 on b\n\
                 fix u(1) = 2*t on r\nsteps t = 0 to 1 by 0.25\n";
    assert_stable("sheet", sheet, [1, 2]);
    let bar = "mesh box [0] to [1] cells [CELLS] segment\nregion l = faces where x == 0\nregion r = faces where x == 1\n\
               unknown u : scalar\nunknown d : scalar\nterm e on all : A*(1 - d)^2*100*Grad_u(1)*Grad_Test_u(1)\n\
               term f on all : B*(10*d*Test_d + 0.1*Grad_d.Grad_Test_d - (1 - d)*100*Grad_u(1)^2*Test_d)\n\
               fix u = 0 on l\nfix u = 0.05*t on r\nsteps t = 0 to 1 by 0.5\n";
    assert_stable("bar", bar, [10, 11]);
}

/// A bar of finite strain that is heated, and conducts better where it is stretched.
#[test]
fn a_temperature_has_a_row_of_either_sign() {
    let bar = "mesh box [0] to [1] cells [CELLS] segment\nregion l = faces where x == 0\nregion r = faces where x == 1\n\
               unknown u : scalar\nunknown T : scalar\ndef s = 1 + Grad_u(1)\n\
               term e on all : A*(s - 1/s - 0.1*T)*Grad_Test_u(1)\nterm c on all : B*s*Grad_T.Grad_Test_T\n\
               fix u = 0 on l\nfix T = 0 on l\nfix T = t on r\nsteps t = 0 to 1 by 0.25\n";
    assert_stable("heated", bar, [10, 11]);
}
