//! What several suites of the command share.
#![allow(dead_code, reason = "each suite takes a part of it")]

mod folder;
#[path = "../../../../tests/src/side_by_side.rs"]
#[allow(unreachable_pub, reason = "the file belongs to a library, too")]
mod side_by_side;

use std::path::Path;

#[allow(unused_imports, reason = "some suites need no folder")]
pub(crate) use folder::Folder;
#[allow(unused_imports, reason = "some suites have one case at a time")]
pub(crate) use side_by_side::side_by_side;

/// A block on a rough floor, pressed on it and pulled along it by more than friction holds; `gamma` is a parameter.
pub(crate) const ROUGH_FLOOR: &str = "\
mesh box [0,0] to [2,1] cells [8,4] quad
region ground = faces where y == 0
region top = faces where y == 1
unknown u : vector
multiplier m : vector on ground
quadrature on ground vertex
term elastic on all : 1000*Div_u*Div_Test_u + 1500*Sym(Grad_u):Grad_Test_u
def pull = gamma*u - m
def force = pos_part(pull.Normal)*Normal + Ball_projection(pull - (pull.Normal)*Normal, 0.3*pos_part(pull.Normal))
term contact on ground : force.Test_u
term law on ground : -1/gamma*(m + force).Test_m
load u = [8,-10] on top
";

/// Rows of the table of a sweep as column and cell.
pub(crate) fn rows(out: &Path) -> Vec<Vec<(String, String)>> {
    let table = std::fs::read_to_string(out.join("sweep.csv")).expect("a table");
    let (mut lines, mut quoted) = (vec![vec![String::new()]], false);
    for c in table.chars() {
        let line = lines.last_mut().expect("a line");
        match c {
            '"' => quoted = !quoted,
            ',' if !quoted => line.push(String::new()),
            '\n' if !quoted => lines.push(vec![String::new()]),
            c => line.last_mut().expect("a cell").push(c),
        }
    }
    lines.pop();
    let head = lines.remove(0);
    lines.into_iter().map(|l| head.iter().cloned().zip(l).collect()).collect()
}

/// Norms of the exact solution of the manufactured contact, by the midpoint rule on its formula.
pub(crate) fn exact_norms() -> (f64, f64) {
    let (c, nu) = (2f64.sqrt() / 3.0, 0.3);
    let m = nu / ((1.0 + nu) * (1.0 - 2.0 * nu)) + 1.0 / (1.0 + nu);
    let n = 1000;
    let (mut l2, mut h1) = (0.0, 0.0);
    for i in 0..n {
        for j in 0..n {
            let (x, y) = ((f64::from(i) + 0.5) / f64::from(n), (f64::from(j) + 0.5) / f64::from(n));
            let (s, r) = ((x - c).max(0.0), (c - x).max(0.0));
            let u = [-4.0 * y * s.powi(3), s.powi(4) - y * r.powi(4) / m];
            let g = [-12.0 * y * s * s, -4.0 * s.powi(3), 4.0 * s.powi(3) + 4.0 * y * r.powi(3) / m, -r.powi(4) / m];
            l2 += u.iter().map(|v| v * v).sum::<f64>();
            h1 += g.iter().map(|v| v * v).sum::<f64>();
        }
    }
    ((l2 / f64::from(n * n)).sqrt(), (h1 / f64::from(n * n)).sqrt())
}
