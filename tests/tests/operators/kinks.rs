//! The written rule of each kinked function: one test a row of the table, exactly at the tie.

use wfl_compiler::{InterpreterBackend, backend::KernelBackend, types::FieldOp};
use wfl_jit::JitBackend;

use super::point::{As, Outcome, State, compile, scalar};

/// Both backends.
fn everywhere(test: impl Fn(&dyn KernelBackend)) {
    test(&InterpreterBackend);
    test(&JitBackend::new().expect("machine code"));
}

fn p(x: f64) -> State {
    State::default().value("p", &[x])
}

/// Value and derivative in p.
#[track_caller]
fn expect(text: &str, state: &State, value: f64, slope: f64) {
    everywhere(|backend| {
        let found = scalar(text, "p", state, backend);
        assert_eq!(found, (value, slope), "{text} ({})", backend.name());
    });
}

#[test]
fn pos_part() {
    for zero in [0.0, -0.0] {
        expect("pos_part(p)", &p(zero), 0.0, 1.0);
    }
    expect("pos_part(p)", &p(5e-324), 5e-324, 1.0);
    expect("pos_part(p)", &p(-5e-324), 0.0, 0.0);
}

#[test]
fn neg_part_is_the_mirror_of_pos_part() {
    for zero in [0.0, -0.0] {
        expect("neg_part(p)", &p(zero), 0.0, -1.0);
    }
    expect("neg_part(p)", &p(-2.0), 2.0, -1.0);
    expect("neg_part(p)", &p(2.0), 0.0, 0.0);
    expect("neg_part(p) - pos_part(-p)", &p(0.0), 0.0, 0.0);
}

#[test]
fn abs_sign_heaviside() {
    expect("abs(p)", &p(0.0), 0.0, 1.0);
    expect("abs(p)", &p(-3.0), 3.0, -1.0);
    expect("sign(p)", &p(0.0), 1.0, 0.0);
    expect("sign(p)", &p(-0.0), 1.0, 0.0);
    expect("sign(p)", &p(-1.0), -1.0, 0.0);
    expect("Heaviside(p)", &p(0.0), 1.0, 0.0);
    expect("Heaviside(p)", &p(-1.0), 0.0, 0.0);
}

#[test]
fn max_and_min_take_the_first_of_a_tie() {
    let tie = State::default().value("p", &[0.7]).value("q", &[0.7]);
    expect("max(p, q)", &tie, 0.7, 1.0);
    expect("max(q, p)", &tie, 0.7, 0.0);
    expect("min(p, q)", &tie, 0.7, 1.0);
    expect("min(q, p)", &tie, 0.7, 0.0);
    expect("max(p, 0)", &p(0.0), 0.0, 1.0);
    expect("max(0, p)", &p(0.0), 0.0, 0.0);
}

#[test]
fn norm_and_normalized_at_zero() {
    everywhere(|backend| {
        let law = compile("Norm(u)*Test_p + Normalized(u).Test_u", 2, As::Term).expect("compiles");
        let at = Outcome::at(&law, &State::default(), backend);
        assert_eq!(at.flux("p", 0), 0.0);
        for k in 0..2 {
            assert_eq!(at.slope("p", 0, "u", k), 0.0);
            assert_eq!(at.flux("u", k), 0.0);
            assert_eq!((at.slope("u", k, "u", 0), at.slope("u", k, "u", 1)), (0.0, 0.0));
        }
    });
}

/// `Ball_projection(u, q).Test_u` at a state: projection, derivative in u (by rows), derivative in q.
fn ball(u: [f64; 2], q: f64, backend: &dyn KernelBackend) -> ([f64; 2], [[f64; 2]; 2], [f64; 2]) {
    let law = compile("Ball_projection(u, q).Test_u", 2, As::Term).expect("compiles");
    let at = Outcome::at(&law, &State::default().value("u", &u).value("q", &[q]), backend);
    let each = [0u16, 1];
    (
        each.map(|i| at.flux("u", i)),
        each.map(|i| each.map(|j| at.slope("u", i, "u", j))),
        each.map(|i| at.slope("u", i, "q", 0)),
    )
}

const IDENTITY: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]];
const ZERO: [[f64; 2]; 2] = [[0.0; 2]; 2];

#[test]
fn ball_projection_sticks_at_the_tie() {
    everywhere(|b| {
        assert_eq!(ball([3.0, 4.0], 5.0, b), ([3.0, 4.0], IDENTITY, [0.0, 0.0]), "norm = r");
        assert_eq!(ball([0.0, 0.0], 0.0, b), ([0.0, 0.0], IDENTITY, [0.0, 0.0]), "unloaded start");
        assert_eq!(ball([0.0, -0.0], -0.0, b), ([0.0, -0.0], IDENTITY, [0.0, 0.0]), "signed zeros");
    });
}

#[test]
fn ball_projection_slips_outside() {
    everywhere(|b| {
        let (value, du, dr) = ball([3.0, 4.0], 2.5, b);
        let n = [0.6, 0.8];
        for i in 0..2 {
            assert!((value[i] - 2.5 * n[i]).abs() < 1e-15);
            assert!((dr[i] - n[i]).abs() < 1e-15);
            for j in 0..2 {
                let turned = f64::from(u8::from(i == j)) - n[i] * n[j];
                assert!((du[i][j] - 0.5 * turned).abs() < 1e-15);
            }
        }
        let (value, du, dr) = ball([3.0, 4.0], 0.0, b);
        assert_eq!((value, du), ([0.0, 0.0], ZERO), "radius 0, loaded: slip without resistance");
        assert!((dr[0] - 0.6).abs() < 1e-15 && (dr[1] - 0.8).abs() < 1e-15);
    });
}

#[test]
fn ball_projection_is_open_below_radius_zero() {
    everywhere(|b| {
        for u in [[0.0, 0.0], [3.0, 4.0]] {
            assert_eq!(ball(u, -1e-300, b), ([0.0, 0.0], ZERO, [0.0, 0.0]));
        }
    });
}

/// In one dimension a slipping point cannot turn: the derivative is exactly 0.
#[test]
fn ball_projection_in_one_dimension() {
    everywhere(|backend| {
        let law = compile("Ball_projection(u, q).Test_u", 1, As::Term).expect("compiles");
        let at = Outcome::at(&law, &State::default().value("u", &[-0.7]).value("q", &[0.3]), backend);
        assert_eq!((at.flux("u", 0), at.slope("u", 0, "u", 0), at.slope("u", 0, "q", 0)), (-0.3, 0.0, -1.0));
    });
}

#[test]
fn coulomb_projection_is_its_composition_also_at_rest() {
    let composed = "Def trial:=u.Normal+1.5*p; Def m:=u-1.5*w; \
        (Ball_projection(m-(m.Normal)*Normal, 0.4*pos_part(-trial))-pos_part(-trial)*Normal).Test_u";
    let operator = "Coulomb_friction_coupled_projection(u, Normal, w, p, [0.4], 1.5).Test_u";
    everywhere(|backend| {
        let laws = [composed, operator].map(|t| compile(t, 3, As::Term).expect("compiles"));
        let rest = State::default();
        let stick = rest.clone().value("u", &[-2.0, 0.1, 0.2]);
        let slip = rest.clone().value("u", &[-2.0, 3.1, 0.2]).value("w", &[0.3, -0.2, 0.4]);
        let open = rest.clone().value("u", &[2.0, 3.1, 0.2]);
        for state in [rest, stick, slip, open] {
            let [a, b] = [&laws[0], &laws[1]].map(|law| Outcome::at(law, &state, backend));
            for i in 0..3 {
                assert_eq!(a.flux("u", i), b.flux("u", i));
                for j in 0..3 {
                    assert_eq!(a.slope("u", i, "u", j), b.slope("u", i, "u", j), "{state:?}");
                    assert_eq!(a.slope("u", i, "w", j), b.slope("u", i, "w", j));
                }
                assert_eq!(a.slope("u", i, "p", 0), b.slope("u", i, "p", 0));
            }
        }
        // at rest: in contact (the normal part follows u) and stick (the tangential part follows u - r w)
        let at = Outcome::at(&laws[1], &State::default(), backend);
        assert_eq!([0, 1, 2].map(|i| at.slope("u", i, "u", i)), [1.0; 3]);
        assert_eq!([0, 1, 2].map(|i| at.slope("u", i, "w", i)), [0.0, -1.5, -1.5]);
    });
}

#[test]
fn von_mises_projection_is_elastic_at_the_tie() {
    everywhere(|backend| {
        let law = compile("Von_Mises_projection(Grad_u, q)(1,2)*Test_p", 2, As::Term).expect("compiles");
        // the deviator has norm 5 exactly
        let at = |q: f64| {
            let state = State::default().grad("u", &[7.0, 4.0, 3.0, 7.0]).value("q", &[q]);
            let o = Outcome::at(&law, &state, backend);
            (o.flux("p", 0), o.slope_in("p", 0, "u", FieldOp::Grad, 2), o.slope("p", 0, "q", 0))
        };
        assert_eq!(at(5.0), (3.0, 1.0, 0.0));
        let (value, slope, radius) = at(2.5);
        assert!(
            (value - 1.5).abs() < 1e-15 && (slope - 0.5 * (1.0 - 0.36)).abs() < 1e-15 && (radius - 0.6).abs() < 1e-15
        );
        assert_eq!(at(-1.0), (0.0, 0.0, 0.0));
    });
}

#[test]
fn a_condition_takes_its_branch() {
    expect("if p >= 0 then 2*p else 5*p", &p(0.0), 0.0, 2.0);
    expect("if p > 0 then 2*p else 5*p", &p(0.0), 0.0, 5.0);
    expect("if p >= 0 then 2*p else 5*p", &p(-0.0), 0.0, 2.0);
}

#[test]
fn reg_pos_part_has_no_jump() {
    let both = |a: f64, e: f64| State::default().value("p", &[a]).value("q", &[e]);
    everywhere(|backend| {
        let slopes = |a: f64, e: f64| {
            let (value, first) = scalar("reg_pos_part(p, q)", "p", &both(a, e), backend);
            (value, first, scalar("reg_pos_part(p, q)", "q", &both(a, e), backend).1)
        };
        assert_eq!(slopes(0.5, 0.5), (0.25, 1.0, -0.5), "a = e");
        assert_eq!(slopes(0.25, 0.5), (0.0625, 0.5, -0.125), "inside");
        assert_eq!(slopes(0.0, 0.5), (0.0, 0.0, 0.0), "a = 0");
        assert_eq!(slopes(-1.0, 0.5), (0.0, 0.0, 0.0), "below");
        assert_eq!(slopes(2.0, 0.5), (1.75, 1.0, -0.5), "beyond");
    });
}

/// Potentials with a kink in their derivative: the second derivative follows the same branch.
#[test]
fn second_derivatives_at_ties() {
    everywhere(|backend| {
        for (text, value) in [
            ("half_sqr_pos_part(p)", 1.0),
            ("sqr_pos_part(p)", 2.0),
            ("half_sqr_neg_part(p)", 1.0),
            ("sqr_neg_part(p)", 2.0),
        ] {
            let law = compile(text, 2, As::Energy).expect("compiles");
            let at = Outcome::at(&law, &p(0.0), backend);
            assert_eq!((at.flux("p", 0), at.slope("p", 0, "p", 0)), (0.0, value), "{text}");
        }
    });
}
