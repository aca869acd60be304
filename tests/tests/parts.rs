//! Ranks that have parts of the mesh: unknowns, equations and results are those of the whole scene.

use std::collections::BTreeMap;

use wfl_output::Piece;
use wfl_problem::Scene;
use wfl_run::Outcome;
use wfl_tests::{
    doubts, examples,
    ranks::{Holding, Shared, run_with_gathered, solved, solved_keeping},
    scene_files, side_by_side,
};

/// What measures may differ by, relative to their largest value; below the second part of the largest of all they are zero.
const WITHIN: f64 = 1e-10;
const ZERO: f64 = 1e-9;
/// An error this small is rounding of a solution of order 1.
const ROUNDING: f64 = 1e-13;

/// Newton iterations by step, and the measures.
fn found(outcome: &Outcome) -> (Vec<usize>, Vec<(String, Vec<f64>)>) {
    let counts = outcome.steps.iter().map(|s| s.history.iterations.len()).collect();
    let names = outcome.steps.first().map_or_else(Vec::new, |s| s.measures.clone());
    let of = |k: usize| outcome.steps.iter().map(|s| s.measures[k].1).collect();
    (counts, names.into_iter().enumerate().map(|(k, (name, _))| (name, of(k))).collect())
}

fn agree(path: &str, edits: &[(&str, String)], ranks: usize, holding: Holding) {
    agree_in(&Shared::example(path, edits), path, ranks, holding);
}

fn agree_in(shared: &Shared, path: &str, ranks: usize, holding: Holding) {
    let (counts, measures) = found(&solved(shared.whole()));
    for (rank, outcome) in shared.on_ranks(ranks, holding, solved).iter().enumerate() {
        let (own_counts, own) = found(outcome);
        let name = format!("{path}, rank {rank} of {ranks}, {holding:?}");
        assert!(outcome.converged(), "{name}");
        assert_eq!(own_counts, counts, "{name}: Newton iterations");
        assert!(!measures.is_empty(), "{name}: measures");
        let size = |values: &[f64]| values.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let of_all = measures.iter().fold(0.0f64, |m, (_, values)| m.max(size(values)));
        for ((what, expected), (_, found)) in measures.iter().zip(&own) {
            // what is rounding of others is relative to them
            let largest = if size(expected) > ZERO * of_all { size(expected) } else { of_all };
            let apart = expected.iter().zip(found).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
            assert!(apart <= (WITHIN * largest).max(ROUNDING), "{name}: {what} {found:?}, expected {expected:?}");
        }
    }
}

fn smaller() -> Vec<(&'static str, String)> {
    vec![("cells [8, 8, 8]", "cells [4, 4, 4]".to_owned())]
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn the_fault_with_three_methods() {
    for method in ["nitsche", "penalty", "augmented_lagrangian"] {
        for ranks in [2, 3, 4] {
            agree(&format!("fault/{method}.wfl"), &smaller(), ranks, Holding::Parts);
        }
    }
}

/// Every example whose ranks can have parts, and some of those whose ranks need the whole mesh.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn examples_have_the_results_of_one_rank() {
    /// Scenes that need the whole mesh and are solved soon.
    const WHOLE: [&str; 5] = [
        "dynamics/bar.wfl",
        "dynamics/vibration.wfl",
        "heat/layers.wfl",
        "mapping/periodic.wfl",
        "mapping/pressed.wfl",
    ];
    /// Thousands of steps.
    const LONG: [&str; 2] = ["creep/history.wfl", "friction/bp1.wfl"];
    side_by_side(&scene_files(), |file| {
        let path = file.strip_prefix(examples()).expect("an example").display().to_string();
        if LONG.contains(&path.as_str()) {
            return;
        }
        let needs_whole = Shared::example(&path, &[]).whole().needs_whole_mesh().is_some();
        let holding = if needs_whole { Holding::Whole } else { Holding::Parts };
        if !needs_whole || WHOLE.contains(&path.as_str()) {
            agree(&path, &smaller(), 3, holding);
        }
    });
}

/// Elements of both kinds, a crack, faces without a mesh of their own, states, local frames, finite strain with contact.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn small_scenes_of_each_kind() {
    for path in [
        "creep/maxwell_auto.wfl",
        "dg/poisson.wfl",
        "elasticity/rollers.wfl",
        "friction/weakening.wfl",
        "hertz/hertz.wfl",
        "hyperelastic/contact.wfl",
        "interface/cohesive.wfl",
        "plasticity/perzyna.wfl",
        "signorini/signorini.wfl",
        "stokes/stokes.wfl",
        "surfaces/tjunction.wfl",
    ] {
        agree(path, &[], 3, Holding::Parts);
    }
    agree("friction/bp1.wfl", &[("param years = 200", "param years = 2".to_owned())], 3, Holding::Parts);
    agree("mapping/pressed.wfl", &[], 3, Holding::Whole);
}

/// By cell of a grid, told by its corners and its body: its values.
type Cells = BTreeMap<(usize, Vec<[u64; 3]>), Vec<f64>>;

fn cells(pieces: &[Piece], n_pieces: usize) -> Cells {
    let mut found = Cells::new();
    for (k, piece) in pieces.iter().enumerate() {
        for (cell, (_, nodes)) in piece.cells.iter().enumerate() {
            let place = |node: &u32| piece.points[*node as usize].map(|x| (x + 0.0).to_bits());
            let mut order: Vec<&u32> = nodes.iter().collect();
            order.sort_by_key(|node| place(node));
            let at_points = piece.point_data.iter().flat_map(|array| {
                let n = array.components;
                order.iter().flat_map(move |node| array.values[**node as usize * n..][..n].iter().copied())
            });
            let of_cell = piece
                .cell_data
                .iter()
                .flat_map(|array| array.values[cell * array.components..][..array.components].iter().copied());
            let values = at_points.chain(of_cell).collect();
            let before = found.insert((k % n_pieces, order.iter().map(|node| place(node)).collect()), values);
            assert!(before.is_none(), "a cell that two ranks write");
        }
    }
    found
}

/// The grids of all ranks together are the grid of one rank: each cell once, with its values.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn the_parts_of_a_grid_are_the_grid() {
    for path in ["fault/nitsche.wfl", "surfaces/tjunction.wfl", "plasticity/perzyna.wfl", "signorini/signorini.wfl"] {
        grids_agree(&Shared::example(path, &smaller()), path, 3);
    }
}

fn grids_agree(shared: &Shared, path: &str, ranks: usize) {
    let last = |scene: &Scene| scene.steps.values.len().saturating_sub(1);
    let whole = shared.whole();
    let n = last(&whole);
    let whole = solved_keeping(whole, vec![n]);
    let parts = shared.on_ranks(ranks, Holding::Parts, |scene| solved_keeping(scene, vec![n]));
    let grids = &whole.kept[0].grids;
    assert!(parts[1].kept[0].grids.iter().all(|(_, pieces)| pieces.is_empty()));
    for ((name, expected), (_, found)) in grids.iter().zip(&parts[0].kept[0].grids) {
        let of_one = cells(expected, expected.len());
        let of_all = cells(found, expected.len());
        assert_eq!(of_one.len(), of_all.len(), "{path}, {name}: cells");
        let largest = of_one.values().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
        for (cell, values) in &of_one {
            let found = &of_all[cell];
            let apart = values.iter().zip(found).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
            assert!(values.len() == found.len() && apart <= 1e-9 * largest, "{path}, {name}: {values:?} {found:?}");
        }
    }
    for (expected, found) in whole.kept[0].tables.iter().zip(&parts[0].kept[0].tables) {
        let pairs = expected.rows.iter().flatten().zip(found.rows.iter().flatten());
        let largest = expected.rows.iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
        let same = |a: f64, b: f64| (a - b).abs() <= 1e-9 * largest || a.is_nan() && b.is_nan();
        assert!(pairs.clone().count() > 0 && pairs.clone().all(|(a, b)| same(*a, *b)), "{path}: {}", expected.file);
    }
}

/// What a rank has of the mesh falls with the number of ranks.
#[test]
fn no_rank_has_the_whole_mesh() {
    let shared = Shared::example("fault/nitsche.wfl", &[]);
    let cells = |scene: Scene| scene.system.mesh.n_cells();
    let (all, of) = (cells(shared.whole()), shared.on_ranks(4, Holding::Parts, cells));
    assert!(of.iter().all(|n| *n < 3 * all / 4), "{of:?} of {all}");
}

/// What a number that is not finite is told as: on one rank alone, and on each of three.
fn told(text: &str) -> (String, Vec<String>) {
    let shared = Shared::text(&examples(), text.to_owned(), &[]);
    let error = |scene: Scene| match run_with_gathered(scene) {
        Err(error) => error.to_string(),
        Ok(outcome) => format!("{:?}", outcome.steps[0].bad_measures),
    };
    (error(shared.whole()), shared.on_ranks(3, Holding::Parts, error))
}

#[test]
fn a_number_that_one_rank_has_alone_is_the_same_error_on_all() {
    let body = "wfl 1\nmesh box [0,0] to [1,1] cells [6,6] quad\nregion left = faces where x == 0\n\
                region corner = cells where x + y >= 1.8\nunknown u : vector\nparam big = 0.9\n\
                term body on all : (Div_u*Id(2) + 2*Sym(Grad_u)):Grad_Test_u\n";
    for (statements, word) in [
        ("fix u = [0, log(big - y)] on left\n", "the prescribed value of `u`"),
        ("fix u = [0, 0] on left\nload u = [log(big - x - y + 0.9), 0] on corner\n", "load"),
        ("fix u = [0, y] on left\nmeasure m = max(log(big - y)) on left\n", "name: \"m\""),
    ] {
        let (alone, ranks) = told(&format!("{body}{statements}"));
        assert!(alone.contains(word), "{alone}");
        for found in ranks {
            assert_eq!(found, alone);
        }
    }
}

/// Scenes that no example is.
const UNSEEN: [(&str, &str); 10] = [
    (
        "P2 on triangles, a region of nodes, point loads, a line on faces",
        "wfl 1
mesh box [0,0] to [2,1] cells [4,2] tri
region left = faces where x == 0
region top = faces where y == 1
region tip = nodes where x == 2 and y == 1
unknown u : vector P2
def sigma(v) = Div_v*Id(2) + 2*Sym(Grad_v)
term elastic on all : sigma(u):Grad_Test_u
fix u = [0,0] on left
load u = [0.1,-1] on tip
load u = [0, x*y] on top
measure tip_u = value(u(2)) at [2,1]
measure mean_top = mean(u(2)) on top
measure highest = max(Norm(u)) at nodes of top
measure work = integral(sigma(u):Grad_u) on all
output vtk \"r\" : u, sigma(u) as stress
output csv \"line\" : u, sigma(u)*Normal as traction along [0,1] to [2,1] with points=7
output csv \"across\" : u, sigma(u) as s along [0,0.5] to [2,0.5] with points=9
",
    ),
    (
        "Q2 hexahedra with data and a map",
        "wfl 1
mesh box [0,0,0] to [1,1,1] cells [3,2,2] hex map [x + 0.1*y*z, y, z + 0.1*x*x]
unknown u : vector Q2
data k : scalar = 1 + x*y
term elastic on all : k*(Div_u*Id(3) + 2*Sym(Grad_u)):Grad_Test_u
fix u = [0,0,0] on boundary
load u = [1, x, y*z] on all
measure m = integral(u.u) on all
measure g = max(Norm(Grad_u)) on all
output vtk \"r\" : u, k
",
    ),
    (
        "discontinuous elements over all inner faces",
        "wfl 1
mesh box [0,0] to [1,1] cells [5,4] tri
unknown u : scalar DP2
def jump(v) = v - Interpolate(v, neighbor_element)
def flux(v) = 0.5*(Grad_v + Interpolate(Grad_v, neighbor_element)).Normal
term body on all : Grad_u.Grad_Test_u
term edges on interior : 100*jump(u)*jump(Test_u) - flux(u)*jump(Test_u)
term nitsche on boundary : 100*u*Test_u
load u = x on all
measure m = integral(u) on all
measure j = integral(sqr(jump(u))) on interior
",
    ),
    (
        "contact of two blocks with a P2 multiplier",
        "wfl 1
mesh box [0,0] to [2,2] cells [6,6] quad
region lower = cells where y <= 1
region upper = cells where y >= 1
region top = faces where y == 2
region bottom = faces where y == 0
region fault = interface from lower to upper
unknown a : vector on lower
unknown b : vector on upper
multiplier l : scalar Q1 on fault
def s(v) = 3*Div_v*Id(2) + 2*Sym(Grad_v)
def jump(a,b) = a - Interpolate(b, neighbor_element)
term la on lower : s(a):Grad_Test_a
term lb on upper : s(b):Grad_Test_b
term c on fault : -neg_part(l + 10*jump(a,b).Normal)*jump(Test_a,Test_b).Normal
term e on fault : -0.1*(l + neg_part(l + 10*jump(a,b).Normal))*Test_l
fix a = [0,0] on bottom
fix b = [0, -0.1*t*(1 + 0.3*x)] on top
steps t = 0.5 to 1.5 by 0.5
measure f = integral(l) on fault
measure p = max(Norm(a)) on lower
output vtk \"r\" : a, b, l
output csv \"c\" : l, a, b along [0,1] to [2,1] with points=11
",
    ),
    (
        "a crack that holds, with a multiplier that follows at its rim, and a line where faces cross",
        "wfl 1
mesh box [-1,-1,-1] to [1,1,1] cells [4,4,4] tet
region low = cells where z <= 0
region high = cells where z >= 0
region crack = interface from low to high & faces of low where z == 0 and x*x <= 0.26 and y*y <= 0.26
region ends = faces where z*z == 1
region left = cells where x < 0
region sheet = faces of left where x == 0
region floor = faces of low where z == 0
region star = sheet + floor
region joints = crossings of star
unknown u : vector
split u across crack
multiplier l : vector on crack
unknown p : scalar on joints
def jump(v) = v - Interpolate(v, neighbor_element)
term elastic on all : (Div_u*Id(3) + 2*Sym(Grad_u)):Grad_Test_u
term hold on crack : l.jump(Test_u) + jump(u).Test_l
term line on joints : Grad_p.Grad_Test_p + (p - sin(y))*Test_p
fix u = [0.1*z, 0, -0.1*z*(1 + 0.3*x)] on ends
measure f = integral(l.Normal) on crack
measure m = max(Norm(l)) at nodes of crack
measure q = value(p) at [0,0.3,0]
output vtk \"r\" : u, l, p
output csv \"c\" : l as l, p along [0,-1,0] to [0,1,0] with points=9
",
    ),
    (
        "a crack that ends inside, pressure, P2",
        "wfl 1
mesh box [-1,-1] to [1,1] cells [8,8] tri
region low = cells where y <= 0
region high = cells where y >= 0
region crack = interface from low to high & faces of low where y == 0 and x*x <= 0.26
region ends = faces where y*y == 1
unknown u : vector P2
split u across crack
def jump(v) = v - Interpolate(v, neighbor_element)
term elastic on all : (Div_u*Id(2) + 2*Sym(Grad_u)):Grad_Test_u
term pressure on crack : 0.1*Normal.jump(Test_u)
fix u = [0,0] on ends
measure open = integral(jump(u).Normal) on crack
measure most = max(jump(u).Normal) on crack
output vtk \"r\" : u
output csv \"c\" : u along [-1,0] to [1,0] with points=21
",
    ),
    (
        "states in the body, several steps",
        "wfl 1
mesh box [0,0] to [1,1] cells [4,4] quad
region left = faces where x == 0
region right = faces where x == 1
unknown u : scalar
state d : scalar := d + 0.1*Norm(Grad_u)
term body on all : (1 + d)*Grad_u.Grad_Test_u
fix u = 0 on left
fix u = t on right
steps t = 1 to 4 by 1
measure m = integral(d) on all
measure q = integral(Grad_u.Normal) on right
output vtk \"r\" : u, d
",
    ),
    (
        "normal displacements on a round wall, nonlinear body",
        "wfl 1
mesh box [0,0] to [1,1] cells [5,5] quad map [(1 + x)*cos(y), (1 + x)*sin(y)]
region inner = faces where x*x + y*y <= 1.05
region outer = faces where x*x + y*y >= 3.9
unknown u : vector
def F = Id(2) + Grad_u
energy body on all : 0.5*(Trace(F'*F) - 2 - 2*log(Det(F))) + 0.5*sqr(log(Det(F)))
fix u.Normal = 0 on inner
fix u = [0.05*t*x, 0.1*t*y] on outer
steps t = 1 to 2 by 1
measure m = integral(u.u) on all
measure j = min(Det(F)) on all
",
    ),
    (
        "one dimension",
        "wfl 1
mesh box [0] to [1] cells [9]
region left = faces where x == 0
unknown u : scalar P2
term body on all : Grad_u.Grad_Test_u
fix u = 0 on left
load u = 1 on all
measure m = integral(u) on all
measure v = value(u) at [0.77]
",
    ),
    (
        "fewer cells than ranks",
        "wfl 1
mesh box [0,0] to [1,1] cells [2,1] quad
region left = faces where x == 0
region right = faces where x == 1
unknown u : scalar
term body on all : Grad_u.Grad_Test_u
fix u = 0 on left
load u = 1 on right
measure m = integral(u) on all
measure r = max(u) at nodes of right
output vtk \"r\" : u
",
    ),
];

/// They have the results of one rank on up to seven, of which some have next to nothing.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn unseen_scenes() {
    for (what, text) in UNSEEN {
        let shared = Shared::text(&examples(), text.to_owned(), &[]);
        assert_eq!(shared.whole().needs_whole_mesh(), None, "{what}");
        for ranks in [2, 4, 7] {
            agree_in(&shared, what, ranks, Holding::Parts);
        }
        grids_agree(&shared, what, 5);
    }
}

/// One displacement has two laws, of which some ranks have no cell, and some have none of a second one at all: they are asked
/// for its strains alike, and tell what one rank alone tells, with its numbers.
#[test]
fn strains_beyond_a_law_are_told_by_ranks_with_few_of_its_cells() {
    let text = "wfl 1
mesh box [0,0] to [4,1] cells [12,2] quad
param E = 1000 [MPa]
region near = cells where x < 2
region far = cells where x > 3
region rest = all - near
region left = faces where x == 0
region right = faces where x == 4
unknown u : vector [m]
unknown v : vector on far [m]
def s(w, k) = k*E*(Div_w*Id(2) + 2*Sym(Grad_w))
term here on near : s(u, 1):Grad_Test_u
term there on rest : s(u, 2):Grad_Test_u
term beyond on far : s(v, 1):Grad_Test_v
fix u = [0, 0] on left
fix u = [9, 0] on right
fix v = [0, 0] on right
load v = [-2*E, 0] on far
measure m = integral(u(1)) on all
";
    let shared = Shared::text(&examples(), text.to_owned(), &[]);
    let told = |outcome: &Outcome| doubts(outcome).into_iter().filter(|d| d.0 == "W645").collect::<Vec<_>>();
    let alone = told(&solved(shared.whole()));
    assert_eq!(alone.len(), 2, "{alone:?}");
    for (ranks, holding) in [(2, Holding::Parts), (3, Holding::Parts), (5, Holding::Parts), (3, Holding::Whole)] {
        for found in shared.on_ranks(ranks, holding, solved) {
            assert_eq!(told(&found), alone, "{ranks} ranks, {holding:?}");
        }
    }
}
