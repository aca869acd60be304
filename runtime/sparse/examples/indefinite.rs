//! Factors of Biot and Stokes systems (Taylor-Hood elements Q2/Q1 on a box): processor time, memory, residual of LDLT and LU.
//!
//! `cargo run --release -p wfl-sparse --example indefinite` measures all systems, each method in a process of its own and
//! the methods in turn, twice; words pick some of them (`biot3`, `lu`). `... -- --one biot3 12 ldlt` measures one, and
//! `... -- --write biot3 12 FILE` writes its matrix in the format of Matrix Market, for other programs.

use std::{
    io::{BufWriter, Write},
    process::{Command, ExitCode},
    time::Instant,
};

use wfl_sparse::csr::Csr;
use wfl_sparse::solve::{CheckedLdlt, CheckedLu, LinearSolver, SolverOptions};

/// Systems and cells along an edge: about 30,000 and 74,000 unknowns in two dimensions and in three.
const SYSTEMS: [(&str, usize); 8] = [
    ("biot2", 57),
    ("biot2", 90),
    ("stokes2", 57),
    ("stokes2", 90),
    ("biot3", 10),
    ("biot3", 14),
    ("stokes3", 10),
    ("stokes3", 14),
];

/// Small dense matrix by rows.
type Matrix = Vec<Vec<f64>>;

/// Integrals along one axis of products of functions of degree 2 (rows) with those of degree 2 or 1 (columns).
struct Line {
    mass: Matrix,
    stiffness: Matrix,
    /// Derivative of the rows.
    slope: Matrix,
    mixed_mass: Matrix,
    mixed_slope: Matrix,
    /// Of degree 1 with itself.
    low_mass: Matrix,
    low_stiffness: Matrix,
}

impl Line {
    fn new(cells: usize) -> Self {
        let (n, low, h) = (2 * cells + 1, cells + 1, 1.0 / cells as f64);
        let zeros = |rows: usize, columns: usize| vec![vec![0.0; columns]; rows];
        let mut line = Self {
            mass: zeros(n, n),
            stiffness: zeros(n, n),
            slope: zeros(n, n),
            mixed_mass: zeros(n, low),
            mixed_slope: zeros(n, low),
            low_mass: zeros(low, low),
            low_stiffness: zeros(low, low),
        };
        let root = 0.6f64.sqrt() / 2.0;
        for (x, weight) in [(0.5 - root, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + root, 5.0 / 18.0)] {
            let w = weight * h;
            let f = [(1.0 - x) * (1.0 - 2.0 * x), 4.0 * x * (1.0 - x), x * (2.0 * x - 1.0)];
            let d = [(4.0 * x - 3.0) / h, (4.0 - 8.0 * x) / h, (4.0 * x - 1.0) / h];
            let (g, e) = ([1.0 - x, x], [-1.0 / h, 1.0 / h]);
            for cell in 0..cells {
                for i in 0..3 {
                    for j in 0..3 {
                        let (a, b) = (2 * cell + i, 2 * cell + j);
                        line.mass[a][b] += w * f[i] * f[j];
                        line.stiffness[a][b] += w * d[i] * d[j];
                        line.slope[a][b] += w * d[i] * f[j];
                    }
                    for j in 0..2 {
                        line.mixed_mass[2 * cell + i][cell + j] += w * f[i] * g[j];
                        line.mixed_slope[2 * cell + i][cell + j] += w * d[i] * g[j];
                    }
                }
                for i in 0..2 {
                    for j in 0..2 {
                        line.low_mass[cell + i][cell + j] += w * g[i] * g[j];
                        line.low_stiffness[cell + i][cell + j] += w * e[i] * e[j];
                    }
                }
            }
        }
        line
    }
}

/// Neighbours of a node along a line: columns of a row that are not zero in the mass matrix.
fn near(row: &[f64]) -> impl Iterator<Item = usize> + '_ {
    (0..row.len()).filter(|&j| row[j] != 0.0)
}

/// A system with its points.
struct System {
    matrix: Csr,
    points: Vec<[f64; 3]>,
    /// 0 for displacements and velocities, 1 for pressures.
    groups: Vec<u32>,
}

impl System {
    /// A box with `cells` cells an edge, held at x = 0 (and, of a flow, at all sides but x = 1).
    fn new(name: &str, cells: usize) -> Option<Self> {
        let (dim, is_biot) = match name {
            "biot2" => (2, true),
            "biot3" => (3, true),
            "stokes2" => (2, false),
            "stokes3" => (3, false),
            _ => return None,
        };
        let line = Line::new(cells);
        let (n, low) = (2 * cells + 1, cells + 1);
        let place = |k: usize, n: usize| -> [usize; 3] {
            if dim == 2 { [k / n, k % n, 0] } else { [k / (n * n), k / n % n, k % n] }
        };
        let is_held = |at: [usize; 3]| at[0] == 0 || !is_biot && (1..dim).any(|a| at[a] == 0 || at[a] == n - 1);
        let (mut points, mut groups) = (Vec::new(), Vec::new());
        let mut number = vec![u32::MAX; n.pow(dim as u32)];
        for (k, number) in number.iter_mut().enumerate() {
            let at = place(k, n);
            if !is_held(at) {
                *number = points.len() as u32;
                let point = at.map(|i| i as f64 / (n - 1) as f64);
                (0..dim).for_each(|_| points.push(point));
                (0..dim).for_each(|_| groups.push(0));
            }
        }
        let first = points.len() as u32;
        for k in 0..low.pow(dim as u32) {
            points.push(place(k, low).map(|i| i as f64 / cells as f64));
            groups.push(1);
        }
        let size = points.len();
        let mut triplets = Vec::new();
        for (k, &row) in number.iter().enumerate().filter(|(_, row)| **row != u32::MAX) {
            add_node(&line, place(k, n), (dim, is_biot), &number, row, &mut triplets);
            add_coupling(&line, place(k, n), dim, (row, first), &mut triplets);
        }
        if is_biot {
            add_pressures(&line, low, dim, first, &mut triplets);
        }
        let matrix = Csr::from_triplets(size, size, &triplets).ok()?;
        Some(Self { matrix, points, groups })
    }
}

/// Rows of the displacements (velocities) of a node, without pressures.
fn add_node(
    line: &Line,
    at: [usize; 3],
    kind: (usize, bool),
    number: &[u32],
    row: u32,
    triplets: &mut Vec<(u32, u32, f64)>,
) {
    let ((dim, is_biot), n) = (kind, line.mass.len());
    let (lambda, mu) = if is_biot { (400.0, 400.0) } else { (0.0, 1.0) };
    let index = |at: [usize; 3], n: usize| at[..dim].iter().fold(0, |k, i| k * n + i);
    let axes = |of: &dyn Fn(usize) -> f64| (0..dim).map(of).product::<f64>();
    for x in near(&line.mass[at[0]]) {
        for y in near(&line.mass[at[1]]) {
            let thirds: Vec<usize> = if dim == 3 { near(&line.mass[at[2]]).collect() } else { vec![0] };
            for z in thirds {
                let other = [x, y, z];
                let column = number[index(other, n)];
                if column == u32::MAX {
                    continue;
                }
                // integral of the product of the derivatives along a and b
                let integral = |a: usize, b: usize| {
                    axes(&|axis| {
                        let (i, j) = (at[axis], other[axis]);
                        match (axis == a, axis == b) {
                            (true, true) => line.stiffness[i][j],
                            (true, false) => line.slope[i][j],
                            (false, true) => line.slope[j][i],
                            (false, false) => line.mass[i][j],
                        }
                    })
                };
                let laplace: f64 = (0..dim).map(|a| integral(a, a)).sum();
                for a in 0..dim {
                    for b in 0..dim {
                        let shear = if is_biot { mu * integral(b, a) } else { 0.0 };
                        let own = if a == b { mu * laplace } else { 0.0 };
                        let value = lambda * integral(a, b) + shear + own;
                        if a == b || is_biot {
                            triplets.push((row + a as u32, column + b as u32, value));
                        }
                    }
                }
            }
        }
    }
}

/// The coupling of the displacements of a node with pressures, on both sides of the diagonal.
fn add_coupling(line: &Line, at: [usize; 3], dim: usize, rows: (u32, u32), triplets: &mut Vec<(u32, u32, f64)>) {
    let ((row, first), low) = (rows, line.low_mass.len());
    let index = |at: [usize; 3], n: usize| at[..dim].iter().fold(0, |k, i| k * n + i);
    for x in near(&line.mixed_mass[at[0]]) {
        for y in near(&line.mixed_mass[at[1]]) {
            let thirds: Vec<usize> = if dim == 3 { near(&line.mixed_mass[at[2]]).collect() } else { vec![0] };
            for z in thirds {
                let other = [x, y, z];
                let pressure = first + index(other, low) as u32;
                for a in 0..dim {
                    let factor = |axis: usize| {
                        let (i, j) = (at[axis], other[axis]);
                        if axis == a { line.mixed_slope[i][j] } else { line.mixed_mass[i][j] }
                    };
                    let value = -(0..dim).map(factor).product::<f64>();
                    triplets.extend([(row + a as u32, pressure, value), (pressure, row + a as u32, value)]);
                }
            }
        }
    }
}

/// What pressures store and let flow in a time step.
fn add_pressures(line: &Line, low: usize, dim: usize, first: u32, triplets: &mut Vec<(u32, u32, f64)>) {
    let (storage, mobility) = (1e-4, 1e-5);
    for row in 0..low.pow(dim as u32) {
        let at: Vec<usize> = (0..dim).rev().map(|a| row / low.pow(a as u32) % low).collect();
        for near in 0..3usize.pow(dim as u32) {
            // one before, the same, one behind along each axis
            let other: Vec<usize> =
                (0..dim).map(|a| (at[a] + near / 3usize.pow(a as u32) % 3).wrapping_sub(1)).collect();
            if other.iter().any(|i| *i >= low) {
                continue;
            }
            let column = other.iter().fold(0, |k, i| k * low + i);
            let mass = |a: usize| line.low_mass[at[a]][other[a]];
            let product = |of: usize| -> f64 {
                (0..dim).map(|a| if a == of { line.low_stiffness[at[a]][other[a]] } else { mass(a) }).product()
            };
            let value = storage * (0..dim).map(mass).product::<f64>() + mobility * (0..dim).map(product).sum::<f64>();
            triplets.push((first + row as u32, first + column as u32, -value));
        }
    }
}

/// Processor time of this process in seconds, and its largest memory in bytes; zero where the system does not tell.
fn used() -> (f64, f64) {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or_default();
    let memory = peak.split_whitespace().next().and_then(|number| number.parse::<f64>().ok()).unwrap_or(0.0) * 1024.0;
    let schedule = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = schedule.split_whitespace().next().and_then(|number| number.parse::<f64>().ok()).unwrap_or(0.0);
    (nanoseconds / 1e9, memory)
}

/// Measures one factor on one thread and prints a line.
fn one(name: &str, cells: usize, method: &str) -> Result<(), String> {
    let System { matrix, points, groups } = System::new(name, cells).ok_or("no such system")?;
    // what the assembly took is forgotten
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    let (options, before) = (SolverOptions::default(), used().1);
    let told = |error: wfl_sparse::solve::SolveError| error.to_string();
    let start = (used().0, Instant::now());
    let mut solver: Box<dyn LinearSolver> = match method {
        "lu" => Box::new(CheckedLu::new(matrix.pattern(), Some(&points), options).map_err(told)?),
        _ => Box::new(CheckedLdlt::new(matrix.pattern(), Some(&points), Some(&groups), options).map_err(told)?),
    };
    solver.factor(&matrix).map_err(told)?;
    let first = used().0;
    solver.factor(&matrix).map_err(told)?;
    let second = used().0;
    let wanted: Vec<f64> = (0..points.len()).map(|dof| 1.0 + (dof % 7) as f64).collect();
    let (mut rhs, mut x) = (vec![0.0; wanted.len()], vec![0.0; wanted.len()]);
    matrix.multiply(&wanted, &mut rhs, 1);
    let report = solver.solve(&rhs, &mut x).map_err(told)?;
    let (end, memory) = used();
    let error = x.iter().zip(&wanted).fold(0.0f64, |most, (x, wanted)| most.max((x - wanted).abs()));
    say(&format!(
        "| {name} | {cells} | {} | {method} | {:.2} | {:.2} | {:.3} | {:.0} | {:.0e} | {} | {error:.0e} | {} |",
        points.len(),
        first - start.0,
        second - first,
        end - second,
        (memory - before) / 1e6,
        report.relative_residual,
        report.refinements,
        if solver.is_symmetric() == Some(true) { "LDLT" } else { "LU" },
    ))
}

fn say(line: &str) -> Result<(), String> {
    writeln!(std::io::stdout().lock(), "{line}").map_err(|error| error.to_string())
}

fn write(name: &str, cells: usize, file: &str) -> Result<(), String> {
    let System { matrix, .. } = System::new(name, cells).ok_or("no such system")?;
    let told = |error: std::io::Error| error.to_string();
    let mut out = BufWriter::new(std::fs::File::create(file).map_err(told)?);
    let n = matrix.n_rows();
    let lower = |row: usize| {
        let (columns, values) = matrix.row(row);
        columns.iter().zip(values).filter(move |(column, _)| **column as usize <= row)
    };
    let count: usize = (0..n).map(|row| lower(row).count()).sum();
    writeln!(out, "%%MatrixMarket matrix coordinate real symmetric\n{n} {n} {count}").map_err(told)?;
    for row in 0..n {
        for (column, value) in lower(row) {
            writeln!(out, "{} {} {value:e}", row + 1, column + 1).map_err(told)?;
        }
    }
    out.flush().map_err(told)
}

fn all(words: &[String]) -> Result<(), String> {
    say(
        "| system | cells | unknowns | asked for | first factor s | next factor s | solution s | memory of the factor MB | residual | refinements | error | used |",
    )?;
    say("|---|---|---|---|---|---|---|---|---|---|---|---|")?;
    let this = std::env::current_exe().map_err(|e| e.to_string())?;
    for (name, cells) in SYSTEMS {
        for method in ["lu", "ldlt", "lu", "ldlt"] {
            let is_wanted =
                |word: &String| name.contains(word.as_str()) || *word == method || *word == cells.to_string();
            if !words.iter().all(is_wanted) {
                continue;
            }
            let status = Command::new(&this).args(["--one", name, &cells.to_string(), method]).status();
            if !status.is_ok_and(|status| status.success()) {
                say(&format!("| {name} | {cells} | | {method} | failed |"))?;
            }
        }
    }
    Ok(())
}

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let told: Vec<&str> = words.iter().map(String::as_str).collect();
    let cells = |word: &str| word.parse().map_err(|_| format!("`{word}` is no number of cells"));
    let done = match told[..] {
        ["--one", name, number, method] => cells(number).and_then(|cells| one(name, cells, method)),
        ["--write", name, number, file] => cells(number).and_then(|cells| write(name, cells, file)),
        _ => all(&words),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "error: {error}");
            ExitCode::FAILURE
        }
    }
}
