//! Loads that are a billionth or a billion times as large: where a scene is homogeneous, what it says is the same.
//!
//! Every check is relative to something of the scene; one that has a number of its own, or the rounding of another number, is
//! found here. Promises: the same codes, before the run and after it, and the same results times the factor.

use wfl_tests::{attempt, doubts, examples};

/// A scene of the examples, what scales it, a coarser mesh and fewer steps.
struct Scaled {
    path: &'static str,
    /// A line, and the same with `FACTOR`.
    load: (&'static str, &'static str),
    coarser: &'static [(&'static str, &'static str)],
    /// A measure that is proportional to the factor.
    measure: &'static str,
    factors: &'static [f64],
}

const BOTH: &[f64] = &[1e-9, 1e9];
/// Of bodies whose strains have a bound (W645).
const SMALL: &[f64] = &[1e-3, 1e-9];

const SCENES: &[Scaled] = &[
    Scaled {
        path: "poro/terzaghi.wfl",
        load: ("load u = [0,-q] on top", "load u = [0,-q*FACTOR] on top"),
        coarser: &[("param n = 40", "param n = 10"), ("by T/400", "by T/10")],
        measure: "carried",
        factors: SMALL,
    },
    Scaled {
        path: "poro/mandel.wfl",
        load: ("term force on global : -F*Test_d", "term force on global : -F*FACTOR*Test_d"),
        coarser: &[("param n = 20", "param n = 4"), ("by 0.0005*a*a/c", "by 0.01*a*a/c")],
        measure: "carried",
        factors: SMALL,
    },
    Scaled {
        path: "poro/fracture.wfl",
        load: ("load pf = Q on well", "load pf = Q*FACTOR on well"),
        coarser: &[("param n = 48", "param n = 8")],
        measure: "outflow",
        factors: BOTH,
    },
    Scaled {
        path: "poro/crossing.wfl",
        load: ("fix pf = 1 on inlet", "fix pf = FACTOR on inlet"),
        coarser: &[("param n = 12", "param n = 4")],
        measure: "out_rock",
        factors: BOTH,
    },
    // the aperture at rest is a number of its own: small openings are linear beside it
    Scaled {
        path: "poro/crack.wfl",
        load: ("param Q = 1e-6", "param Q = 1e-12*FACTOR"),
        coarser: &[("param m = 12", "param m = 6"), ("t = 0 to 20 by 1", "t = 0 to 4 by 1")],
        measure: "volume",
        factors: &[1e-3, 1e-6, 1e-9],
    },
];

/// The codes of all messages, and the last value of a measure.
fn told(scene: &Scaled, factor: f64) -> (Vec<String>, f64) {
    let file = examples().join(scene.path);
    let mut text = std::fs::read_to_string(&file).expect("an example");
    let load = (scene.load.0, scene.load.1.replace("FACTOR", &format!("({factor:e})")));
    for (from, to) in scene.coarser.iter().map(|(from, to)| (*from, (*to).to_owned())).chain([load]) {
        assert!(text.contains(from), "{}: {from}", scene.path);
        text = text.replace(from, &to);
    }
    let tried = attempt(file.parent().expect("a folder"), text, &[], &[]);
    let solved = tried.solved.unwrap_or_else(|| panic!("{}: {}", scene.path, tried.messages));
    assert!(solved.outcome.converged(), "{} {factor:e}", scene.path);
    let before = tried.messages.lines().filter(|line| line.starts_with("warning["));
    let mut codes: Vec<String> = before.map(|line| line[8..12].to_owned()).collect();
    codes.extend(doubts(&solved.outcome).iter().map(|(code, _)| (*code).to_owned()));
    codes.sort_unstable();
    codes.dedup();
    (codes, solved.measure(solved.outcome.steps.len() - 1, scene.measure))
}

#[test]
fn what_is_told_does_not_follow_the_size_of_the_loads() {
    for scene in SCENES {
        let (codes, value) = told(scene, 1.0);
        assert!(!codes.iter().any(|code| code == "W650"), "{}: {codes:?}", scene.path);
        for factor in scene.factors {
            let (own, scaled) = told(scene, *factor);
            assert_eq!(own, codes, "{} with loads times {factor:e}", scene.path);
            let apart = (scaled / (factor * value) - 1.0).abs();
            assert!(apart < 1e-8, "{} {factor:e}: {} is {apart:e} off", scene.path, scene.measure);
        }
    }
}
