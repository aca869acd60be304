//! P1 to P15: cases of public verification manuals and of bug reports of other programs. Scenes in `tests/public`, each
//! rebuilt from the data of its source; a message on any of them is a failure, since all of them are right.

use std::{f64::consts::PI, path::Path};

use super::{
    Benchmark, Case, Tolerance,
    common::{converged, or_failed},
};
use crate::{Attempt, Solved, attempt, doubts};

/// The benchmarks of this file.
pub(super) const BENCHMARKS: &[Benchmark] = &[
    case(
        "P1",
        "Code_Aster SSNV128: plate pressed and pushed on a rigid plane, friction 1",
        "Code_Aster V6.04.128, displacements along the plane at five points (GRECO), within its 5 %",
        true,
        plate_on_plane,
    ),
    case(
        "P2",
        "Code_Aster SSNV503: skate 2 mm above an inclined plane, at 0.99 and 1.01 of the friction limit",
        "Code_Aster V6.04.503; rigid motion against its springs in closed form",
        false,
        skate,
    ),
    case(
        "P3",
        "Code_Aster SSNV104: two elastic spheres, axisymmetric",
        "Hertz, -2798.3 for an approach of 4 mm (Code_Aster V6.04.104, within its 14 %); smaller approaches come closer",
        true,
        spheres,
    ),
    case("P4", "NAFEMS CGS-4: a block pushed up a ramp", "F/G = (0.1 + 0.3)/(1 - 0.03) = 0.412371", false, ramp),
    case(
        "P5",
        "press fit of two rings, and pushed out of it, axisymmetric",
        "Lame: exact where the ends are held; push-out force = friction times normal force (question on CalculiX)",
        true,
        rings,
    ),
    case(
        "P6",
        "Kratos: joint with friction, cohesion and tension cut-off",
        "unit tests of InterfaceCoulombWithTensionCutOff: six tractions",
        false,
        joint,
    ),
    case(
        "P7",
        "PorePy: a joint that opens by its slip (dilation)",
        "closed form of two blocks without lateral strain",
        false,
        dilation,
    ),
    case("P8", "MOOSE: Archard wear", "backward Euler of p' = -(k v E/H) p, step by step", false, wear),
    case("P9", "MOOSE: conductance of a closed gap", "resistances in series", false, conductance),
    case(
        "P10",
        "GEOS: stress on a displaced fault under depletion",
        "Jansen, Singhal and Vossepoel (2019): logarithms of a vertical fault in a full space",
        true,
        displaced_fault,
    ),
    case(
        "P11",
        "a wavy surface on a half space",
        "Westergaard (1939): closed part and highest pressure over the mean pressure",
        true,
        westergaard,
    ),
    case("P12", "a rigid wedge on a half space", "Sneddon (1948): P = E* a tan(alpha)", false, wedge),
    case(
        "P13",
        "a rigid strip on a perfectly plastic block",
        "Prandtl (1920): pressure (2 + pi) k, from above with the first order of the mesh",
        true,
        prandtl,
    ),
    case(
        "P14",
        "friction of two coefficients, dragged at 30 degrees",
        "p/sqrt((cos/m1)^2 + (sin/m2)^2) along the slip (questions on MuJoCo, Jolt and PhysX)",
        false,
        anisotropic,
    ),
    case("P15", "a membrane over a half sphere", "MFEM example 36: A log(r) outside r = 0.348982574", false, obstacle),
];

const fn case(
    id: &'static str,
    title: &'static str,
    origin: &'static str,
    slow: bool,
    run: fn() -> Vec<Case>,
) -> Benchmark {
    Benchmark { id, title, origin, slow, open: None, run }
}

/// A scene of `tests/public`, solved without any message.
fn solved(name: &str, params: &[(&str, f64)]) -> Result<Solved, String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("public");
    let text = std::fs::read_to_string(folder.join(name)).map_err(|e| format!("{name}: {e}"))?;
    let Attempt { solved, messages } = attempt(&folder, text, &[], params);
    let solved = solved.ok_or_else(|| messages.clone())?;
    match (messages.trim(), doubts(&solved.outcome).first()) {
        ("", None) => converged(solved),
        ("", Some(w)) => Err(format!("{name}: {} {}", w.0, w.1)),
        (told, _) => Err(format!("{name}: {told}")),
    }
}

fn plate_on_plane() -> Vec<Case> {
    let made = || {
        let s = solved("plate_on_plane.wfl", &[])?;
        let points = [("A", 2.86e-5), ("B", 2.72e-5), ("C", 2.28e-5), ("D", 1.98e-5), ("E_", 1.5e-5)];
        let all = Case::new("Nitsche, 32 cells of degree 2 a side");
        Ok(points.iter().fold(all, |c, (point, ux)| {
            c.compare(format!("ux at {}", &point[..1]), s.measure(0, point), *ux, Tolerance::Relative(0.05))
        }))
    };
    vec![or_failed("plate", made())]
}

fn skate() -> Vec<Case> {
    let (rise, along) = ((PI / 6.0).sin(), (PI / 6.0).cos());
    // pressed: 2 mm along the normal; beyond the limit the springs of 4 N/mm take the rest of the push
    let made = |share: f64| {
        let s = solved("skate.wfl", &[("share", share)])?;
        let slid = (share - 1.0f64).max(0.0) * 3600.0 / 4.0;
        let (x, y) = (2.0 * rise + slid * along, -2.0 * along + slid * rise);
        let force = 3600.0 * share.min(1.0);
        Ok(Case::new(format!("pushed by {share} of the limit"))
            .compare("moved along x", s.measure(0, "moved_x"), x, Tolerance::Relative(0.025))
            .compare("moved along y", s.measure(0, "moved_y"), y, Tolerance::Relative(0.025))
            .compare("normal force", s.measure(0, "N"), 12e3, Tolerance::Relative(1e-4))
            .compare("friction", s.measure(0, "T").abs(), force, Tolerance::Absolute(0.02 * 3600.0)))
    };
    [0.0, 0.99, 1.01].map(|share| or_failed("skate", made(share))).to_vec()
}

fn spheres() -> Vec<Case> {
    let (e, nu, r) = (2e4, 0.3, 50.0f64);
    let made = |half: f64, n: f64, share: f64| {
        let s = solved("spheres.wfl", &[("d", half), ("n", n)])?;
        let (modulus, curvature, approach) = (e / (2.0 * (1.0 - nu * nu)), r / 2.0, 2.0 * half);
        let radius = (curvature * approach).sqrt();
        let force = 4.0 / 3.0 * modulus * curvature.sqrt() * approach.powf(1.5);
        let p0 = 2.0 * modulus * radius / (PI * curvature);
        Ok(Case::new(format!("approach {approach}"))
            .compare("highest pressure", s.measure(0, "p0"), p0, Tolerance::Relative(share))
            .compare("force", s.measure(0, "F"), force, Tolerance::Relative(share)))
    };
    vec![
        or_failed("spheres", made(2.0, 32.0, 0.14)),
        or_failed("spheres", made(0.5, 32.0, 0.04)),
        or_failed("spheres", made(0.125, 48.0, 0.02)),
    ]
}

fn ramp() -> Vec<Case> {
    let made = || {
        let s = solved("ramp.wfl", &[])?;
        Ok(Case::new("matching faces").compare("F/G", s.measure(0, "ratio"), 0.4 / 0.97, Tolerance::Relative(1e-9)))
    };
    vec![or_failed("ramp", made())]
}

fn rings() -> Vec<Case> {
    let (e, nu, a, b, c, interference, length) = (210e3, 0.3, 20.0f64, 30.0f64, 45.0f64, 0.01, 20.0);
    let held = || {
        let s = solved("press_fit.wfl", &[])?;
        let of = |rim: f64| (1.0 + nu) / e * b * ((1.0 - 2.0 * nu) * b * b + rim * rim) / (rim * rim - b * b).abs();
        let p = interference / (of(a) + of(c));
        Ok(Case::new("ends held").compare("pressure", s.measure(0, "p"), p, Tolerance::Relative(1e-6)))
    };
    let pushed = || {
        let s = solved("push_out.wfl", &[])?;
        let of = |rim: f64, sign: f64| b / e * ((rim * rim + b * b) / (rim * rim - b * b).abs() + sign * nu);
        let normal = interference / (of(a, -1.0) + of(c, 1.0)) * 2.0 * PI * b * length;
        let (n, f) = (s.measure(0, "N"), s.measure(0, "F"));
        Ok(Case::new("ends free, pushed out")
            .compare("normal force (the ends are not in Lame's solution)", n, normal, Tolerance::Relative(5e-3))
            .compare("push-out force over normal force", f / n, 0.1, Tolerance::Relative(1e-9)))
    };
    vec![or_failed("press fit", held()), or_failed("push-out", pushed())]
}

fn joint() -> Vec<Case> {
    let made = |zone: &str, trial: [f64; 2], expected: [f64; 2]| {
        let s = solved("joint.wfl", &[("sn", trial[0]), ("st", trial[1])])?;
        Ok(Case::new(zone)
            .compare("normal traction", s.measure(0, "normal"), expected[0], Tolerance::Absolute(1e-6))
            .compare("shear traction", s.measure(0, "shear"), expected[1], Tolerance::Absolute(1e-6)))
    };
    vec![
        or_failed("elastic", made("elastic, compression", [-6.0, 8.0], [-6.0, 8.0])),
        or_failed("elastic", made("elastic, tension", [5.0, -2.0], [5.0, -2.0])),
        or_failed("apex", made("apex of the cut-off", [15.0, 2.0], [10.0, 0.0])),
        or_failed("cut-off", made("cut-off", [10.0, 4.0], [8.0, 2.0])),
        or_failed(
            "corner",
            made("corner of cut-off and cone", [10.0, 14.0], [4.241_040_391_001_66, 5.758_959_608_998_34]),
        ),
        or_failed("cone", made("cone without dilation", [-5.0, 18.0], [-5.0, 11.059_402_624_645_148])),
    ]
}

/// Measures of a scene that are divided by their closed forms.
fn ratios(scene: &str, measures: &[&str], tolerance: f64) -> Vec<Case> {
    let made = || {
        let s = solved(scene, &[])?;
        let all = Case::new("over the closed form");
        Ok(measures.iter().fold(all, |c, m| c.compare(*m, s.measure(0, m), 1.0, Tolerance::Relative(tolerance))))
    };
    vec![or_failed(scene, made())]
}

fn dilation() -> Vec<Case> {
    ratios("dilation.wfl", &["slipped", "opened", "pressure"], 1e-9)
}

fn conductance() -> Vec<Case> {
    ratios("conductance.wfl", &["pressure", "heat"], 1e-9)
}

fn wear() -> Vec<Case> {
    let made = || {
        let s = solved("wear.wfl", &[])?;
        let decay = 1.0f64 + 0.05 * 1e-3 * 1000.0 / 2.0;
        let all = Case::new("20 steps");
        // the first value is the state at the start
        Ok((1..s.outcome.steps.len()).fold(all, |c, k| {
            let p = 10.0 / decay.powi(i32::try_from(k).unwrap_or(0));
            c.compare(format!("pressure of step {k}"), s.measure(k, "pressure"), p, Tolerance::Relative(1e-9))
        }))
    };
    vec![or_failed("wear", made())]
}

fn displaced_fault() -> Vec<Case> {
    let made = || {
        let s = solved("displaced_fault.wfl", &[])?;
        let stress = |y: f64| -> f64 { -((y * y - 4.0) / (y * y - 1.0)).abs().ln() };
        let all = Case::new("8 cells between the corners");
        Ok([("t0", 0.0), ("t05", 0.5), ("t15", 1.5), ("t25", 2.5)].iter().fold(all, |c, (name, y)| {
            c.compare(format!("shear stress at y = {y}"), s.measure(0, name), stress(*y), Tolerance::Relative(0.01))
        }))
    };
    vec![or_failed("displaced fault", made())]
}

fn westergaard() -> Vec<Case> {
    let made = |share: f64| {
        let s = solved("westergaard.wfl", &[("load_share", share)])?;
        let closed = 2.0 / PI * share.sqrt().asin();
        Ok(Case::new(format!("mean pressure {share} of the one that closes all"))
            // a point of the rule more or less
            .compare("closed part", s.measure(0, "closed"), closed, Tolerance::Absolute(1.0 / 64.0))
            .compare("highest pressure", s.measure(0, "highest"), 2.0 * share.sqrt(), Tolerance::Relative(0.01)))
    };
    [0.1, 0.5, 0.9].map(|share| or_failed("wavy surface", made(share))).to_vec()
}

fn wedge() -> Vec<Case> {
    let made = || {
        let s = solved("wedge.wfl", &[])?;
        let half_width = (12.0 * s.measure(0, "m2") / s.measure(0, "P")).sqrt();
        let force = half_width * 0.02 / (1.0 - 0.09);
        Ok(Case::new("half width from the second moment of the pressure").compare(
            "force",
            s.measure(0, "P"),
            force,
            Tolerance::Relative(0.01),
        ))
    };
    vec![or_failed("wedge", made())]
}

fn prandtl() -> Vec<Case> {
    let made = || {
        let pressure = |n: f64| {
            let s = solved("prandtl.wfl", &[("n", n)])?;
            Ok::<f64, String>(s.measure(s.outcome.steps.len() - 1, "ratio"))
        };
        let (coarse, fine) = (pressure(4.0)?, pressure(8.0)?);
        Ok(Case::new("4 and 8 cells on half of the strip")
            .compare(
                "first order: excess of 4 over that of 8",
                (coarse - 1.0) / (fine - 1.0),
                2.0,
                Tolerance::Relative(0.1),
            )
            .compare("extrapolated pressure over (2 + pi) k", 2.0 * fine - coarse, 1.0, Tolerance::Relative(0.02)))
    };
    vec![or_failed("strip", made())]
}

fn anisotropic() -> Vec<Case> {
    let made = || {
        let s = solved("anisotropic.wfl", &[])?;
        let (cos, sin) = ((PI / 6.0).cos(), (PI / 6.0).sin());
        let size = 10.0 / ((cos / 0.1).powi(2) + (sin / 0.4).powi(2)).sqrt();
        Ok(Case::new("block of 8 cells")
            .compare("along x", s.measure(0, "Tx"), size * cos, Tolerance::Relative(1e-6))
            .compare("along y", s.measure(0, "Ty"), size * sin, Tolerance::Relative(1e-6)))
    };
    vec![or_failed("two coefficients", made())]
}

fn obstacle() -> Vec<Case> {
    let made = || {
        let error = |n: f64| Ok::<f64, String>(solved("obstacle.wfl", &[("n", n)])?.measure(0, "error"));
        let (coarse, fine) = (error(16.0)?, error(64.0)?);
        Ok(Case::new("largest error at the nodes, 16 and 64 cells a side")
            .compare("64 cells", fine, 1e-3, Tolerance::AtMost)
            .compare("second order: less than a tenth of that of 16", fine, 0.1 * coarse, Tolerance::AtMost))
    };
    vec![or_failed("membrane", made())]
}
