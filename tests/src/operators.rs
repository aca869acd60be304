//! Throughput of linear terms that are applied without a matrix, of their matrix, and the limits of the machine.
//!
//! One thread. Seconds are the best of several products: what other programs take away does not count.

use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};

use wfl::{NoFiles, SourceMap, resolve};
use wfl_discrete::{assemble::products_per_second, window::Window};
use wfl_jit::JitBackend;
use wfl_problem::prepare;
use wfl_sparse::solve::Operator;

/// A body of one material.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    /// As in the table.
    pub name: &'static str,
    cells: &'static str,
    map: &'static str,
    element: &'static str,
}

const BENT: &str = " map [x + 0.1*x*sin(y*z), y + 0.1*x*z, z - 0.1*x*y]";

/// The bodies of the table: an elastic block in double and in single precision, on straight cells and on bent ones.
pub const BODIES: [Body; 9] = [
    Body { name: "tetrahedra P1", cells: "[24,24,24] tet", map: "", element: "P1" },
    Body { name: "tetrahedra P2", cells: "[16,16,16] tet", map: "", element: "P2" },
    Body { name: "tetrahedra P3", cells: "[10,10,10] tet", map: "", element: "P3" },
    Body { name: "tetrahedra P4", cells: "[7,7,7] tet", map: "", element: "P4" },
    Body { name: "hexahedra Q1", cells: "[32,32,32] hex", map: "", element: "Q1" },
    Body { name: "hexahedra Q2", cells: "[16,16,16] hex", map: "", element: "Q2" },
    Body { name: "hexahedra Q3", cells: "[10,10,10] hex", map: "", element: "Q3" },
    Body { name: "hexahedra Q4", cells: "[8,8,8] hex", map: "", element: "Q4" },
    Body { name: "bent hexahedra Q2", cells: "[16,16,16] hex", map: BENT, element: "Q2" },
];

/// What one thread gives at most.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Bytes read and written in a second by `a = b + s c` on arrays that no cache holds.
    pub bandwidth: f64,
    /// Products with sums in a second.
    pub single: f64,
    /// The same in double precision.
    pub double: f64,
}

/// What was measured of a body.
#[derive(Clone, Copy, Debug, Default)]
pub struct Found {
    /// Free dofs.
    pub unknowns: usize,
    /// Seconds of a product with the matrix.
    pub stored: f64,
    /// Seconds of a product without it; of degree 1 there is none.
    pub applied: f64,
    /// The same in single precision.
    pub single: f64,
    /// Products with sums of a product without a matrix.
    pub operations: f64,
    /// Bytes of the matrix in double precision.
    pub matrix_bytes: f64,
    /// Bytes of what the operator holds in both precisions.
    pub applied_bytes: f64,
}

/// Best time of several passes within about half a second.
fn best(mut pass: impl FnMut()) -> f64 {
    pass();
    let (start, mut best) = (Instant::now(), f64::INFINITY);
    while start.elapsed() < Duration::from_millis(500) {
        let begin = Instant::now();
        pass();
        best = best.min(begin.elapsed().as_secs_f64());
    }
    best
}

/// Measures the machine.
#[must_use]
#[expect(clippy::cast_precision_loss, reason = "a count")]
pub fn limits() -> Limits {
    // 96 MB each: larger than the caches of a core
    let n = 12_000_000;
    let (mut a, b, c) = (vec![0.0f64; n], vec![1.0f64; n], vec![2.0f64; n]);
    let seconds = best(|| {
        let factor = black_box(3.0);
        a.iter_mut().zip(&b).zip(&c).for_each(|((a, b), c)| *a = b + factor * c);
        black_box(&mut a);
    });
    let [single, double] = products_per_second();
    Limits { bandwidth: 24.0 * n as f64 / seconds, single, double }
}

/// Measures a body on one thread.
///
/// # Errors
/// What stands against the scene, in words.
pub fn measure(body: &Body) -> Result<Found, String> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|error| error.to_string())?;
    pool.install(|| measured(body))
}

#[expect(clippy::cast_precision_loss, reason = "counts")]
fn measured(body: &Body) -> Result<Found, String> {
    let Body { cells, map, element, .. } = body;
    let text = format!(
        "wfl 1\nmesh box [0,0,0] to [1,1,1] cells {cells}{map}\nregion left = faces where x < 1e-9\n\
         unknown u : vector {element}\nterm elastic on all : (3e4*Div_u*Id(3) + 8e4*Sym(Grad_u)):Grad_Test_u\n\
         fix u = [0,0,0] on left\nload u = [0,0,-1] on all\n"
    );
    let mut sources = SourceMap::new();
    let main = sources.add("body.wfl", text);
    let script = resolve(&mut sources, main, &mut NoFiles, &[]).value.ok_or("no script")?;
    let backend = JitBackend::new().map_err(|error| error.to_string())?;
    let made = prepare(&script, Path::new("."), &backend);
    let mut scene = made.scene.ok_or_else(|| format!("{:?}", made.diagnostics))?;
    let system = &mut scene.system;
    system.leave_matrix().map_err(|error| error.to_string())?;
    system.begin_step(Window::new(1.0, 1.0)).map_err(|error| error.to_string())?;
    let matrix = system.matrix().map_err(|error| error.to_string())?;
    let n = matrix.n_rows();
    let x: Vec<f64> = (1..=n).map(|i| (i as f64 * 0.618_033_988_749_894_9).fract() - 0.5).collect();
    let mut y = vec![0.0; n];
    let stored = best(|| matrix.multiply(black_box(&x), &mut y, 1));
    let mut found = Found {
        unknowns: n,
        stored,
        matrix_bytes: 12.0 * matrix.values().len() as f64 + 8.0 * n as f64,
        ..Found::default()
    };
    let Some(operator) = system.operator() else {
        return Ok(Found { applied: f64::INFINITY, single: f64::INFINITY, ..found });
    };
    let operator: &dyn Operator = &*operator;
    found.applied = best(|| operator.apply(black_box(&x), &mut y));
    let layout = system.node_layout()?;
    let single = vec![0.5f32; layout.points.len() * layout.components];
    let mut product = single.clone();
    let finest = operator.levels().ok_or("no levels")?.finest;
    found.single = best(|| finest.apply(black_box(&single), &mut product));
    (found.operations, found.applied_bytes) =
        (system.counts_of_product().operations, (operator.bytes() + finest.bytes()) as f64);
    Ok(found)
}
