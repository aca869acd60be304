//! [x]_+ and the projection on a ball with their derivatives, from the smallest number to the largest, against values
//! of 900-digit arithmetic (physics_derivatives.json).

use serde::Deserialize;
use wfl_compiler::{InterpreterBackend, backend::KernelBackend};
use wfl_jit::JitBackend;

use super::point::{As, Outcome, State, compile, scalar};

#[derive(Deserialize)]
struct Vectors {
    pos_part: Vec<PosPart>,
    ball: Vec<Ball>,
}

#[derive(Deserialize)]
struct PosPart {
    x: f64,
    pos: f64,
    heaviside: f64,
    half_sq: Option<f64>,
}

#[derive(Deserialize)]
struct Ball {
    x: Vec<f64>,
    a: f64,
    kind: String,
    proj: Vec<f64>,
    dx: Vec<Vec<f64>>,
    da: Vec<f64>,
}

fn vectors() -> Vectors {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../reference/physics_derivatives.json");
    let text = std::fs::read_to_string(path).expect("the reference file");
    let vectors: Vectors = serde_json::from_str(&text).expect("its format");
    // the extremes must come through the reader bit by bit
    assert!(
        vectors.pos_part.iter().any(|v| v.x == f64::MAX) && vectors.pos_part.iter().any(|v| v.x == f64::from_bits(1))
    );
    vectors
}

fn everywhere(test: impl Fn(&dyn KernelBackend)) {
    test(&InterpreterBackend);
    test(&JitBackend::new().expect("machine code"));
}

/// The tolerance that the file gives: 8e-16 of the largest entry, or the last bit of subnormal numbers.
fn close(found: &[f64], right: &[f64]) -> bool {
    let size = right.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    found.len() == right.len()
        && found.iter().zip(right).all(|(f, r)| f.is_finite() && (f - r).abs() <= 8e-16 * size + 2e-323)
}

#[test]
fn positive_part() {
    let vectors = vectors();
    assert_eq!(vectors.pos_part.len(), 11);
    everywhere(|backend| {
        for v in &vectors.pos_part {
            let state = State::default().value("p", &[v.x]);
            assert_eq!(scalar("pos_part(p)", "p", &state, backend), (v.pos, v.heaviside), "[{:e}]_+", v.x);
            if let Some(half) = v.half_sq {
                assert_eq!(scalar("half_sqr_pos_part(p)", "p", &state, backend).0, half, "[{:e}]_+^2/2", v.x);
            }
        }
    });
}

#[test]
fn ball_projection() {
    let vectors = vectors();
    assert_eq!(vectors.ball.len(), 120);
    everywhere(|backend| {
        for dim in 1..=3 {
            let law = compile("Ball_projection(u, q).Test_u", dim, As::Term).expect("compiles");
            for v in vectors.ball.iter().filter(|v| v.x.len() == dim) {
                let state = State::default().value("u", &v.x).value("q", &[v.a]);
                let at = Outcome::at(&law, &state, backend);
                let each = || 0..u16::try_from(dim).expect("small");
                let proj: Vec<f64> = each().map(|i| at.flux("u", i)).collect();
                let dx: Vec<f64> =
                    each().flat_map(|i| each().map(move |j| (i, j))).map(|(i, j)| at.slope("u", i, "u", j)).collect();
                let da: Vec<f64> = each().map(|i| at.slope("u", i, "q", 0)).collect();
                let name = format!("x = {:?}, a = {:e}, {} ({})", v.x, v.a, v.kind, backend.name());
                assert!(close(&proj, &v.proj), "{name}: projection {proj:?}, not {:?}", v.proj);
                let right: Vec<f64> = v.dx.iter().flatten().copied().collect();
                // at x = 0, a = 0 the file lists the identity as expected and zero as valid: ours is stick
                assert!(close(&dx, &right), "{name}: derivative in x {dx:?}, not {right:?}");
                match v.kind.as_str() {
                    // radius 0, x not 0: the limit of positive radii, as language and table say
                    "edge_a0" => assert!(
                        da.iter().all(|x| x.is_finite()) && (da.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-15,
                        "{name}: {da:?}"
                    ),
                    _ => assert!(close(&da, &v.da), "{name}: derivative in a {da:?}, not {:?}", v.da),
                }
            }
        }
    });
}
