//! B15: what must not change a result: units, sizes, position, orientation, handedness, numbering.
//!
//! Two blocks pressed and sheared with friction, in open, sliding and sticking parts; no direction of it is special.
//! A variation moves the scene by a matrix and a factor; its displacements must be those of the scene, moved.

use std::fmt::Write;

use super::{
    Benchmark, Case, Tolerance,
    common::{converged, or_failed},
};
use crate::{Solved, examples, solve};

/// The benchmarks of this file.
pub(super) const BENCHMARKS: &[Benchmark] = &[
    Benchmark {
        id: "B15",
        title: "invariances: units, sizes, rotation, order of the axes, mirror, numbering of nodes and cells",
        origin: "the same scene; powers of two must give the same bits (with multipliers 1e-11)",
        slow: false,
        open: None,
        run: invariances,
    },
    Benchmark {
        id: "X7",
        title: "stresses, loads and gamma times 2^40 and 2^-60",
        origin: "the same bits",
        slow: false,
        open: None,
        run: || stresses(&[2f64.powi(40), 2f64.powi(-60)], Tolerance::Bitwise, &METHODS[..2]),
    },
    Benchmark {
        id: "X8",
        title: "E from 1e-9 to 1e15 with loads and gamma scaled alike",
        origin: "the same scene",
        slow: false,
        open: None,
        run: || stresses(&[4e-14, 4e-8, 4e-3, 4e4, 4e10], Tolerance::Absolute(1e-12), &METHODS),
    },
];

type Matrix = [[f64; 3]; 3];
const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// `A` turns the scene, `px, py, pz` are the coordinates before turning, `L` and `S` scale lengths and stresses.
const SCENE: &str = "wfl 1
param E = 25000
param nu = 0.25
param fric = 0.4
param gamma = 2e5
param L = 1
param S = 1
def A = [a11,a12,a13; a21,a22,a23; a31,a32,a33]
def px = (a11*x + a21*y + a31*z)/L
def py = (a12*x + a22*y + a32*z)/L
def pz = (a13*x + a23*y + a33*z)/L
MESH
region left   = cells where px < 0
region right  = cells where px > 0
region fault  = interface from left to right
region bottom = faces where pz == 0
region west   = faces where px == -1
region east   = faces where px == 1
region top    = faces of right where pz == 2
unknown uL : vector on left
unknown uR : vector on right
def lambda_   = S*E*nu/((1+nu)*(1-2*nu))
def mu        = S*E/(2*(1+nu))
def sigma(v)  = lambda_*Div_v*Id(3) + 2*mu*Sym(Grad_v)
def trac(v)   = sigma(v)*Normal
def jump(a,b) = a - Interpolate(b, neighbor_element)
def tang(w)   = w - (w.Normal)*Normal
def force     = pos_part(Pn)*Normal + Ball_projection(Pt, fric*pos_part(Pn))
term elastic on left  : sigma(uL):Grad_Test_uL
term elastic on right : sigma(uR):Grad_Test_uR
fix  uL, uR = [0,0,0] on bottom
fix  uL = [0,0,0] on west
load uR = S*(A*[-3 + 0.35*pz*t, 0, 0]) on east
load uR = S*(A*[0, 0.5, -t/3]) on top
steps t = 0 to 6 by 3
solver newton with tol=1e-13
measure open_ = mean(if Pn < 0 then 1 else 0) on fault
measure slip  = mean(if Pn >= 0 and Norm(Pt) > fric*Pn then 1 else 0) on fault
";

const BOX: &str = "mesh box [-1,0,0] to [1,2,2] cells [4,4,4] hex map L*(A*X)";

const METHODS: [(&str, &str); 3] = [
    (
        "Nitsche theta = -1",
        "def g  = S*gamma/L
def Pn = g*(jump(uL,uR).Normal) - trac(uL).Normal
def Pt = g*tang(jump(uL,uR)) - tang(trac(uL))
term stress  on fault : 1/g*trac(uL).trac(Test_uL)
term contact on fault : 1/g*force.(g*jump(Test_uL,Test_uR) + trac(Test_uL))
",
    ),
    (
        "penalty",
        "def g  = S*gamma/L
def Pn = g*(jump(uL,uR).Normal)
def Pt = g*tang(jump(uL,uR))
term contact on fault : force.jump(Test_uL,Test_uR)
",
    ),
    (
        "augmented Lagrangian",
        "multiplier m : vector on fault
quadrature on fault vertex
def g  = S*gamma/L
def Pn = g*(jump(uL,uR).Normal) - m.Normal
def Pt = g*tang(jump(uL,uR)) - tang(m)
term contact on fault : force.jump(Test_uL,Test_uR)
term law     on fault : -1/g*(m + force).Test_m
",
    ),
];

/// One change that must not change the result.
struct Variation {
    what: &'static str,
    turn: Matrix,
    /// Factors of lengths and stresses.
    length: f64,
    stress: f64,
    mesh: String,
    tolerance: Tolerance,
}

fn variation(what: &'static str, turn: Matrix, length: f64, stress: f64) -> Variation {
    let exact = length.log2().fract() == 0.0 && stress.log2().fract() == 0.0 && turn == IDENTITY;
    let tolerance = if exact { Tolerance::Bitwise } else { Tolerance::Absolute(1e-11) };
    Variation { what, turn, length, stress, mesh: BOX.to_owned(), tolerance }
}

fn variations() -> Vec<Variation> {
    let (s, c) = 30f64.to_radians().sin_cos();
    let mut list = vec![
        variation("stresses times 2^40", IDENTITY, 1.0, 2f64.powi(40)),
        variation("stresses times 2^-60", IDENTITY, 1.0, 2f64.powi(-60)),
        variation("stresses times 1e6", IDENTITY, 1.0, 1e6),
        variation("lengths times 2^20", IDENTITY, 2f64.powi(20), 1.0),
        variation("lengths times 2^-30", IDENTITY, 2f64.powi(-30), 1.0),
        variation("lengths times 1e-9", IDENTITY, 1e-9, 1.0),
        variation("lengths times 1e7", IDENTITY, 1e7, 1.0),
        variation("turned by 30 degrees about z", [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], 1.0, 1.0),
        variation("turned by 30 degrees about x", [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]], 1.0, 1.0),
        variation("axes x, y, z become y, z, x", [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], 1.0, 1.0),
        variation("axes x, y, z become z, x, y", [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], 1.0, 1.0),
    ];
    // a mirror turns cells inside out, so the mesh is the mirrored box and not the box mirrored
    list.push(Variation {
        mesh: "mesh box [-1,0,0] to [1,2,2] cells [4,4,4] hex".to_owned(),
        ..variation("mirrored in x", [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], 1.0, 1.0)
    });
    list.push(Variation {
        mesh: "mesh box [-1,-2,0] to [1,0,2] cells [4,4,4] hex".to_owned(),
        ..variation("mirrored in y", [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]], 1.0, 1.0)
    });
    list
}

fn text(mesh: &str, turn: &Matrix, law: &str) -> String {
    let mut text = SCENE.replace("MESH", mesh);
    for (i, row) in turn.iter().enumerate() {
        for (j, entry) in row.iter().enumerate() {
            text = text.replace(&format!("a{}{}", i + 1, j + 1), &format!("({entry:?})"));
        }
    }
    text + law
}

fn invariances() -> Vec<Case> {
    METHODS
        .iter()
        .flat_map(|(method, law)| {
            let base = match converged_scene(text(BOX, &IDENTITY, law), &[]) {
                Ok(base) => base,
                Err(why) => return vec![Case::failed(*method, why)],
            };
            let mut cases = vec![states(method, &base)];
            for mut v in variations() {
                if *method == "augmented Lagrangian" && v.tolerance == Tolerance::Bitwise {
                    // multipliers scale otherwise than displacements, and so does the choice of pivots
                    v.tolerance = Tolerance::Absolute(1e-11);
                }
                let what = format!("{method}: {}", v.what);
                let params = [("L", v.length), ("S", v.stress)];
                let made = converged_scene(text(&v.mesh, &v.turn, law), &params)
                    .map(|moved| compare(&what, &base, &moved, &v));
                cases.push(or_failed(&what, made));
            }
            let what = format!("{method}: nodes and cells renumbered");
            cases.push(or_failed(&what, renumbered(&what, law, &base)));
            cases
        })
        .collect()
}

/// Stresses times each factor.
fn stresses(factors: &[f64], tolerance: Tolerance, methods: &[(&str, &str)]) -> Vec<Case> {
    let mut cases = Vec::new();
    for (method, law) in methods {
        let base = converged_scene(text(BOX, &IDENTITY, law), &[]);
        for factor in factors {
            let what = format!("{method}: stresses times {factor:e}");
            let made = base.as_ref().map_err(Clone::clone).and_then(|base| {
                let moved = converged_scene(text(BOX, &IDENTITY, law), &[("S", *factor)])?;
                let v = Variation { tolerance, ..variation("", IDENTITY, 1.0, *factor) };
                Ok(compare(&what, base, &moved, &v))
            });
            cases.push(or_failed(&what, made));
        }
    }
    cases
}

fn converged_scene(text: String, params: &[(&str, f64)]) -> Result<Solved, String> {
    converged(solve(&examples(), text, &[], params)?)
}

/// The scene is worth varying: some of it opens, slides and sticks.
fn states(method: &str, base: &Solved) -> Case {
    let most = |part: &dyn Fn(usize) -> f64| (0..base.outcome.steps.len()).map(part).fold(0.0, f64::max);
    let (open, slip) = (|step| base.measure(step, "open_"), |step| base.measure(step, "slip"));
    Case::new(format!("{method}: parts that are open, slide and stick, each in some step"))
        .compare("open", most(&open), 0.02, Tolerance::AtLeast)
        .compare("slide", most(&slip), 0.02, Tolerance::AtLeast)
        .compare("stick", most(&|step| 1.0 - open(step) - slip(step)), 0.02, Tolerance::AtLeast)
}

fn times(m: &Matrix, x: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * x[0] + row[1] * x[1] + row[2] * x[2])
}

/// Displacements of every step, moved back, against those of the scene; in units of the largest.
fn compare(what: &str, base: &Solved, moved: &Solved, v: &Variation) -> Case {
    let mut case = Case::new(what);
    for (step, (b, m)) in base.outcome.steps.iter().zip(&moved.outcome.steps).enumerate() {
        let (mut largest, mut gap) = (0.0f64, 0.0f64);
        for (k, field) in base.scene.system.fields.iter().enumerate().filter(|(_, f)| f.name.starts_with('u')) {
            let (Some(here), Some(there)) = (base.scene.system.range(k), moved.scene.system.range(k)) else { continue };
            let other = &moved.scene.system.fields[k];
            for n in 0..field.n_nodes() {
                let place = times(&v.turn, field.node_position(n)).map(|x| x * v.length);
                let distance = |n: usize| {
                    let y = other.node_position(n);
                    (0..3).map(|d| ((place[d] - y[d]) / v.length).powi(2)).sum::<f64>()
                };
                let Some(twin) = (0..other.n_nodes()).min_by(|a, b| distance(*a).total_cmp(&distance(*b))) else {
                    continue;
                };
                let at = |s: &[f64], start: usize| [s[start], s[start + 1], s[start + 2]];
                let u = times(&v.turn, at(&b.state, here.start + 3 * n)).map(|x| x * v.length);
                let w = at(&m.state, there.start + 3 * twin);
                for d in 0..3 {
                    largest = largest.max(u[d].abs());
                    gap = gap.max((u[d] - w[d]).abs());
                }
            }
        }
        // the same bits: the largest difference is 0
        case = case.compare(
            format!("t = {}, largest difference", base.outcome.steps[step].window.end),
            gap / largest,
            0.0,
            v.tolerance,
        );
    }
    case
}

/// The mesh of the scene as a Gmsh file with its nodes and cells in another order.
fn renumbered(what: &str, law: &str, base: &Solved) -> Result<Case, String> {
    let mesh = &base.scene.system.mesh;
    let (n, cells) = (mesh.n_nodes(), mesh.n_cells());
    // 7919 is prime and divides neither count: a permutation
    let shuffled = |k: usize, n: usize| (k * 7919 + 13) % n;
    let mut file = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{n}\n");
    let mut place = vec![0; n];
    for new in 0..n {
        let old = shuffled(new, n);
        place[old] = new;
        let x = mesh.nodes()[old];
        // writing to a string cannot fail
        let _ = writeln!(file, "{} {:e} {:e} {:e}", new + 1, x[0], x[1], x[2]);
    }
    let _ = write!(file, "$EndNodes\n$Elements\n{cells}\n");
    let all: Vec<_> = mesh.cells().collect();
    let order: Vec<_> = (0..cells).map(|new| all[shuffled(new, cells)]).collect();
    for new in 0..cells {
        let nodes = mesh.cell_nodes(order[new]);
        // Gmsh goes around the faces of a hexahedron
        let around = [0, 1, 3, 2, 4, 5, 7, 6].map(|c| (place[nodes[c].index()] + 1).to_string());
        let _ = writeln!(file, "{} 5 2 0 1 {}", new + 1, around.join(" "));
    }
    file.push_str("$EndElements\n");
    let folder = std::env::temp_dir().join(format!("wfl-renumbered-{}-{}", std::process::id(), law.len()));
    std::fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
    std::fs::write(folder.join("shuffled.msh"), file).map_err(|e| e.to_string())?;
    let solved = solve(&folder, text("mesh file \"shuffled.msh\"", &IDENTITY, law), &[], &[]).and_then(converged);
    std::fs::remove_dir_all(&folder).map_err(|e| e.to_string())?;
    let v = variation("renumbered", IDENTITY, 1.0, 1.0);
    Ok(compare(what, base, &solved?, &Variation { tolerance: Tolerance::Absolute(1e-11), ..v }))
}
