//! X9, X10, X30: the two blocks of B1 in other units of length, far from the origin, and of long or flat cells.

use super::{
    Benchmark, Case, Tolerance,
    common::{converged, or_failed},
    two_block::{AUGMENTED, NITSCHE, PENALTY, SIZE, SLIP, STICK, State, YOUNG, merged, scene},
};
use crate::{Solved, attempt, examples};

const ORIGIN: &str = "closed form of B1";

/// The benchmarks of this file.
pub(super) const BENCHMARKS: &[Benchmark] = &[
    Benchmark {
        id: "X9",
        title: "lengths from 1e-9 to 1e7, gamma divided by them, the same tractions",
        origin: "the same blocks in other units",
        slow: false,
        open: None,
        run: units_of_length,
    },
    Benchmark { id: "X10", title: "blocks at x = 1e7", origin: ORIGIN, slow: false, open: None, run: far_away },
    Benchmark {
        id: "X30",
        title: "cells of aspect ratio 1e4, long or flat across the interface",
        origin: ORIGIN,
        slow: false,
        open: None,
        run: long_and_flat,
    },
];

const METHODS: [(&str, f64, &str); 4] = [
    (NITSCHE, 0.0, "Nitsche 0"),
    (NITSCHE, -1.0, "Nitsche -1"),
    (AUGMENTED, 0.0, "augmented Lagrangian"),
    (PENALTY, 0.0, "penalty"),
];

/// Twice the modulus over the size of the cells normal to the interface.
const GAMMA: f64 = 2.0 * YOUNG / SIZE;

/// The state with what penalty adds to it.
fn state(law: &str, state: State) -> State {
    State { compliance: if law == PENALTY { 1.0 / GAMMA } else { 0.0 }, ..state }
}

/// The blocks with all lengths times `l` and moved along x by `shift`.
fn moved(law: &str, theta: f64, state: &State, l: f64, shift: f64) -> Result<Solved, String> {
    let [west, east] = [shift - l, shift + 2.0 * l];
    let from = format!("(x-({west:?}))");
    let mut text = scene(law);
    for (was, is) in [
        ("[-1,0,0] to [2,1,1]", format!("[{west:?},0,0] to [{east:?},{l:?},{l:?}]")),
        ("x < 0", format!("x < {shift:?}")),
        ("x > 0", format!("x > {shift:?}")),
        ("x == -1", format!("x == {west:?}")),
        ("x == 2", format!("x == {east:?}")),
        ("y == 1", format!("y == {l:?}")),
        ("z == 1", format!("z == {l:?}")),
        ("(x+1)", from),
    ] {
        if !text.contains(was) {
            return Err(format!("the scene has no `{was}`"));
        }
        text = text.replace(was, &is);
    }
    let mut params = state.params(law, GAMMA, theta);
    for (name, value) in &mut params {
        match *name {
            "dn" | "dy" | "dz" | "jn" | "gap" => *value *= l,
            "gamma" => *value /= l,
            _ => {}
        }
    }
    let tried = attempt(&examples(), text, &[], &params);
    tried.solved.ok_or(tried.messages).and_then(converged)
}

/// Largest difference of displacements, divided by their lengths, in parts of the largest prescribed one.
fn difference(state: &State, base: &Solved, other: &Solved, l: f64) -> f64 {
    let scale = state.dn.abs().max(state.dt[0].hypot(state.dt[1]));
    let mut worst = 0.0f64;
    for (k, field) in base.scene.system.fields.iter().enumerate().filter(|(_, f)| f.name.starts_with('u')) {
        let Some(range) = base.scene.system.range(k) else { continue };
        let name = &field.name;
        let Some(j) = other.scene.system.fields.iter().position(|f| f.name == *name) else { return f64::NAN };
        let Some(theirs) = other.scene.system.range(j).filter(|r| r.len() == range.len()) else { return f64::NAN };
        let (a, b) = (&base.outcome.steps[0].state, &other.outcome.steps[0].state);
        for (a, b) in a[range].iter().zip(&b[theirs]) {
            let gap = (a - b / l).abs() / scale;
            // NaN is kept: max would drop it
            worst = if gap > worst || gap.is_nan() { gap } else { worst };
        }
    }
    worst
}

/// Stick and slip of every method, compared with the blocks as they are.
fn compared(what: &str, l: f64, shift: f64, tolerance: f64) -> Case {
    let mut found = Vec::new();
    for (law, theta, name) in METHODS {
        for (given, word) in [(STICK, "stick"), (SLIP, "slip")] {
            let what = format!("{name}, {word}");
            let state = state(law, given);
            let base = moved(law, theta, &state, 1.0, 0.0);
            let made = base.and_then(|base| {
                let error = state.displacement_error(&base);
                let gap = difference(&state, &base, &moved(law, theta, &state, l, shift)?, l);
                Ok(Case::new(&what)
                    .compare("error of the blocks as they are", error, 1e-11, Tolerance::AtMost)
                    .compare("largest change of u/L", gap, tolerance, Tolerance::AtMost))
            });
            found.push(or_failed(&what, made));
        }
    }
    merged(what, found)
}

fn units_of_length() -> Vec<Case> {
    [1e-9, 1e-3, 1e3, 1e7].map(|l| compared(&format!("lengths times {l:e}"), l, 0.0, 1e-12)).to_vec()
}

fn far_away() -> Vec<Case> {
    vec![compared("x from 1e7 - 1 to 1e7 + 2", 1.0, 1e7, 1e-7)]
}

fn long_and_flat() -> Vec<Case> {
    [(1e-4, "cells 0.5 long and 5e-5 wide"), (1e4, "cells 0.5 thick and 5e3 wide")]
        .map(|(wide, what)| {
            let edits = [
                ("[2,1,1]", format!("[2,{wide:?},{wide:?}]")),
                ("y == 1", format!("y == {wide:?}")),
                ("z == 1", format!("z == {wide:?}")),
            ];
            let mut found = Vec::new();
            for (law, theta, name) in METHODS {
                for (given, word) in [(STICK, "stick"), (SLIP, "slip")] {
                    let state = state(law, given);
                    let solved = state.solve(law, GAMMA, theta, &edits);
                    found.push(state.compare(&format!("{name}, {word}"), solved, 1e-6));
                }
            }
            merged(what, found)
        })
        .to_vec()
}
