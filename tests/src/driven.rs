//! Scenes whose derivatives are known: two blocks that are driven along each other, and a path of friction with a memory.

use std::{fs::write, path::Path};

/// Two blocks of plane strain under compression `p`, of which one is moved along their interface by `drive`. States are
/// homogeneous: with M the modulus of compression without strain across, mu of shear and the length 3, the slip is
/// `d - 3 F p/mu` while the friction `F p` acts.
pub const DRIVEN_BLOCKS: &str = "wfl 1
param E = 25000
param nu = 0.25
param p = 10
param fric = 0.4
param d = 3e-3
mesh box [-1,0] to [2,1] cells [6,2] quad
region left = cells where x < 0
region right = cells where x > 0
region joint = interface from left to right
region west = faces where x == -1
region east = faces where x == 2
region edges_left = faces of left where y == 0 or y == 1
region edges_right = faces of right where y == 0 or y == 1
unknown uL : vector on left
unknown uR : vector on right
def lame = E*nu/((1+nu)*(1-2*nu))
def mu = E/(2*(1+nu))
def modulus = lame + 2*mu
def sigma(v) = lame*Div_v*Id(2) + 2*mu*Sym(Grad_v)
def traction(v) = sigma(v)*Normal
def apart = uL - Interpolate(uR, neighbor_element)
def test_apart = Test_uL - Interpolate(Test_uR, neighbor_element)
def tangential(w) = w - (w.Normal)*Normal
term bulk_left on left : sigma(uL):Grad_Test_uL
term bulk_right on right : sigma(uR):Grad_Test_uR
fix uL = [0, 0] on west
fix uR = [-3*p/modulus - overlap, drive] on east
fix uL(1) = -(p/modulus)*(x+1) on edges_left
fix uR(1) = -(p/modulus)*(x+1) - overlap on edges_right
load uL(2) = -(lame/modulus)*p*Normal(2) on edges_left
load uR(2) = -(lame/modulus)*p*Normal(2) on edges_right
measure shear = mean(traction(uL)(2)) on joint
measure slip = mean(-apart(2)) on joint
";

/// Writes `drive.csv` and `seen.csv`, what drives the path of friction of an independent program and what is seen there, as
/// `path` of `tests/reference/physics_gradients.json` has them.
///
/// # Panics
/// Without these lists, or where a file cannot be written.
pub fn write_path(folder: &Path, path: &serde_json::Value) {
    for (file, list) in [("drive.csv", "D"), ("seen.csv", "data")] {
        let numbers = path[list].as_array().expect("a list");
        let row = |(k, x): (usize, &serde_json::Value)| format!("{},{x}\n", k + 1);
        let rows: String = numbers.iter().enumerate().map(row).collect();
        write(folder.join(file), format!("t,value\n{rows}")).expect("a table");
    }
}
