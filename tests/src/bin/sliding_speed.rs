//! Faces per second of a term whose images move, on one thread and in its processor time: search, residual, tangent; and of
//! the same with images that stay.
//!
//! `cargo run --release -p wfl-tests --bin sliding_speed`

use std::{
    io::Write as _,
    path::Path,
    time::{Duration, Instant},
};

use wfl_discrete::system::{Branches, System};
use wfl_jit::JitBackend;
use wfl_tests::prepared;

const PLANE: &str = "mesh box [0,0] to [40,2] cells [3000,2] quad with idle_cells=allowed";
const SPACE: &str = "mesh box [0,0,0] to [4,4,2] cells [52,52,2] hex with idle_cells=allowed";

const SMALL: &str = "mesh box [0,0,0] to [4,4,2] cells [24,24,2] hex with idle_cells=allowed";

fn scene(mesh: &str, up: &str, dim: usize, moves: bool) -> String {
    let moving = if moves { " moving with a, b" } else { "" };
    let law = if moves {
        "
def Pn = -40*sliding_gap(a, b, m) - t.current_normal(a)
def force = pos_part(Pn)*current_normal(a) + Ball_projection(along_face(40*sliding_slip(a, b, m) - t, current_normal(a)), 0.3*pos_part(Pn))
term contact on sole : force.sliding_jump(a, b, m)"
    } else {
        "
def gap = (Interpolate(X, m) + Interpolate(b, m) - X - a).Normal
def slip = a - Previous_a - Interpolate(b, m) + Interpolate(Previous_b, m)
def Pn = -40*gap - t.Normal
def force = pos_part(Pn)*Normal + Ball_projection(along_face(40*slip - t, Normal), 0.3*pos_part(Pn))
term contact on sole : force.(Test_a - Interpolate(Test_b, m))"
    };
    format!(
        "wfl 1
use \"sliding\"
{mesh}
region lower = cells where {up} < 1
region upper = cells where {up} > 1
region sole  = interface from upper to lower
region floor = interface from lower to upper
unknown a : vector Q1 on upper
unknown b : vector Q1 on lower
def P(g) = 0.4*((Id({dim}) + g) - Inv(Id({dim}) + g)') + 0.5*log(Det(Id({dim}) + g))*Inv(Id({dim}) + g)'
def t = P(Grad_a)*Normal
term lower on lower : Grad_b:Grad_Test_b
term upper on upper : Grad_a:Grad_Test_a
mapping m = raytrace from sole onto floor{moving} within 0.3{law}
quadrature on sole degree 3
steps s = 0 to 1 by 1
"
    )
}

/// Time that this thread has spent on a processor, where the system tells.
fn processor_time(since: Instant) -> Duration {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let own = text.split_whitespace().next().and_then(|n| n.parse().ok()).map(Duration::from_nanos);
    own.unwrap_or_else(|| since.elapsed())
}

/// Seconds that a pass takes, the best of three rounds of passes on states that differ.
fn seconds(mut pass: impl FnMut(usize)) -> f64 {
    let since = Instant::now();
    let round = |k: usize, pass: &mut dyn FnMut(usize)| {
        let begin = processor_time(since);
        (0..2).for_each(|n| pass(2 * k + n));
        (processor_time(since).saturating_sub(begin)).as_secs_f64() / 2.0
    };
    (0..3).map(|k| round(k, &mut pass)).fold(f64::INFINITY, f64::min)
}

/// A sum that tells whether numbers are those of another build.
fn weighted(numbers: &[f64]) -> f64 {
    numbers.iter().enumerate().map(|(k, x)| x * (1.0 + (0.37 * k as f64).sin())).sum()
}

fn main() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    for (name, text) in [
        ("plane", scene(PLANE, "y", 2, true)),
        ("space", scene(SPACE, "z", 3, true)),
        ("space, images that stay", scene(SMALL, "z", 3, false)),
    ] {
        let backend = JitBackend::new().expect("machine code");
        let scene = prepared(Path::new("."), text, &[], &[], &backend).unwrap_or_else(|e| panic!("{e}"));
        let equations = scene.at_first_step().expect("equations");
        let system: &System = &equations.system;
        let term = system.terms.iter().find(|t| t.law.name == "contact").expect("the term");
        let points = term.integrator.domain.moving.clone();
        let upper = system.range(0).expect("an unknown");
        let (n, dim) = (system.numbering.n_dofs, system.mesh.dim());
        // pressed by a part of a cell, and moved along by another one each time
        let state = |k: usize| -> Vec<f64> {
            let motion = |d: usize| match (d - upper.start) % dim {
                0 => 1e-4 * (1 + k) as f64,
                c if c == dim - 1 => -1e-3,
                _ => 2e-5,
            };
            (0..n).map(|d| if upper.contains(&d) { motion(d) } else { 0.0 }).collect()
        };
        let states: Vec<Vec<f64>> = (0..6).map(state).collect();
        let faces = term.integrator.domain.n_entities as f64 / 1000.0;
        pool.install(|| {
            let search = seconds(|k| {
                let _ = points.as_ref().map(|points| points.at(&system.mesh, &system.slices(&states[k])));
            });
            let mut forces = vec![0.0; n];
            let residual = seconds(|k| {
                let values = system.values(&states[k]);
                term.add_residual(&system.mesh, values.view(), &mut forces).expect("finite forces");
            });
            let mut tangent = system.new_tangent();
            system.tangent(&states[0], Branches::AsWritten, &mut tangent).expect("a tangent");
            let whole = seconds(|k| system.tangent(&states[k], Branches::AsWritten, &mut tangent).expect("a tangent"));
            let mut out = std::io::stderr().lock();
            let _ = writeln!(
                out,
                "{name}: {faces:.2} thousand faces; thousand faces a second: search {:.1}, residual {:.1}, tangent {:.1}; \
                 entries of the matrix {}; sums {:.15e} {:.15e}",
                faces / search,
                faces / residual,
                faces / whole,
                tangent.changing.pattern().n_entries(),
                weighted(&forces),
                weighted(tangent.changing.values()),
            );
        });
    }
}
