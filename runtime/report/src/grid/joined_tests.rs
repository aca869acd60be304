//! Tests of grids in parts: they are written by the runtime, whole and in parts, and read back.

use std::{
    path::{Path, PathBuf},
    sync::atomic::{AtomicU32, Ordering},
};

use wfl_charts::Edge;
use wfl_output::{Array, Identity, Kind, OutputDir, OutputError, Piece, Plan, Series, VtkCell};

use super::super::{Whole, read_pieces, read_whole};
use super::*;
use crate::plot::{MeshLines, skin};

/// A folder that lives as long as the value.
struct Scratch(PathBuf);

impl Scratch {
    fn new() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        Scratch(std::env::temp_dir().join(format!("wfl-joined-test-{}-{count}", std::process::id())))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // a folder left behind in the system's temporary folder harms no test
        drop(std::fs::remove_dir_all(&self.0));
    }
}

/// Writes pieces whole and shared out by `rank`, which gives the rank of a cell of a piece.
fn write(scratch: &Scratch, whole: &[Piece], n_ranks: usize, rank: impl Fn(usize, usize) -> usize) -> [PathBuf; 2] {
    let dir = OutputDir::open(&scratch.0).unwrap();
    dir.begin(Kind::Run, &Identity::default(), &Plan::default()).unwrap();
    let file = Series::new(&dir, "whole").write_step(0, 0.5, whole).unwrap();
    let of = |r: usize| whole.iter().enumerate().map(|(p, piece)| share(piece, |cell| rank(p, cell) == r)).collect();
    let parts = (0..n_ranks).map(|r| Ok::<Vec<Piece>, OutputError>(of(r)));
    let files = Series::new(&dir, "shared").write_parts(0, 0.5, parts).unwrap();
    [file, files.last().unwrap().clone()]
}

/// The cells of a piece that a rank has, on the nodes that they need.
fn share(piece: &Piece, own: impl Fn(usize) -> bool) -> Piece {
    let cells: Vec<usize> = (0..piece.cells.len()).filter(|k| own(*k)).collect();
    let all: Vec<(VtkCell, &[u32])> = piece.cells.iter().collect();
    let mut nodes: Vec<u32> = cells.iter().flat_map(|k| all[*k].1).copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    let local = |n: &u32| u32::try_from(nodes.binary_search(n).unwrap()).unwrap();
    let nodes: Vec<usize> = nodes.iter().map(|n| *n as usize).collect();
    let cut = |data: &[Array], which: &[usize]| {
        let of =
            |a: &Array| which.iter().flat_map(|k| &a.values[k * a.components..][..a.components]).copied().collect();
        data.iter().map(|a| Array { values: of(a), ..a.clone() }).collect()
    };
    Piece {
        points: nodes.iter().map(|n| piece.points[*n]).collect(),
        cells: cells.iter().map(|k| (all[*k].0, all[*k].1.iter().map(local).collect())).collect(),
        point_data: cut(&piece.point_data, &nodes),
        cell_data: cut(&piece.cell_data, &cells),
    }
}

/// `[nx, ny, nz]` cubes from a corner on, with a displacement of this name.
fn box_of(n: [usize; 3], corner: f64, name: &str) -> Piece {
    let at = |i: usize, j: usize, k: usize| u32::try_from(i + (n[0] + 1) * (j + (n[1] + 1) * k)).unwrap();
    let (mut points, mut cells) = (Vec::new(), Vec::new());
    let steps = |d: usize, more: usize| 0..n[d] + more;
    for (k, j, i) in steps(2, 1).flat_map(|k| steps(1, 1).flat_map(move |j| steps(0, 1).map(move |i| (k, j, i)))) {
        points.push([corner + i as f64 / 3.0, j as f64 / 7.0, k as f64]);
    }
    for (k, j, i) in steps(2, 0).flat_map(|k| steps(1, 0).flat_map(move |j| steps(0, 0).map(move |i| (k, j, i)))) {
        let layer = |k: usize| [at(i, j, k), at(i + 1, j, k), at(i + 1, j + 1, k), at(i, j + 1, k)];
        cells.push((VtkCell::Hexahedron, [layer(k), layer(k + 1)].concat()));
    }
    let u = points.iter().flat_map(|p| [p[0] * p[1], p[1].sin(), p[2] / 3.0]).collect();
    Piece {
        point_data: vec![Array { name: name.to_owned(), components: 3, values: u }],
        cell_data: vec![Array::scalar("kind", (0..cells.len()).map(|k| k as f64).collect())],
        cells: cells.into_iter().collect(),
        points,
    }
}

/// A face of squares, with values of its own.
fn face(n: usize) -> Piece {
    let at = |i: usize, j: usize| u32::try_from(i + (n + 1) * j).unwrap();
    let squares = (0..n * n).map(|c| (c % n, c / n));
    let cells = squares.map(|(i, j)| (VtkCell::Quad, vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]));
    let points: Vec<[f64; 3]> =
        (0..(n + 1) * (n + 1)).map(|k| [1.0, (k % (n + 1)) as f64, (k / (n + 1)) as f64]).collect();
    Piece {
        point_data: vec![Array::scalar("slip", points.iter().map(|p| p[1] + 10.0 * p[2]).collect())],
        cell_data: vec![Array::scalar("contact_state", (0..n * n).map(|k| (k % 3) as f64).collect())],
        cells: cells.collect(),
        points,
    }
}

/// Numbers as bits: NaN is equal to NaN.
fn bits(numbers: &[f64]) -> Vec<u64> {
    numbers.iter().map(|x| x.to_bits()).collect()
}

/// Each cell by the places and values of its nodes, in order.
fn as_set(whole: &Whole) -> Vec<(u8, Vec<Vec<u64>>)> {
    let node = |n: &usize| {
        let values = whole.point_data.iter().flat_map(|v| bits(v.of(&(*n..n + 1))));
        bits(&whole.points[*n]).into_iter().chain(values).collect()
    };
    let mut cells: Vec<_> = whole.cells.iter().map(|c| (c.kind, c.nodes.iter().map(node).collect())).collect();
    cells.sort();
    cells
}

/// The faces that are seen, by the places of their nodes, with their edges.
fn seen(whole: &Whole) -> Vec<(Vec<Vec<u64>>, Vec<Edge>)> {
    let cells: Vec<usize> = (0..whole.cells.len()).collect();
    let faces = skin(whole, &cells, MeshLines::Drawn).into_iter();
    let place = |nodes: &[usize]| nodes.iter().map(|n| bits(&whole.points[*n])).collect::<Vec<_>>();
    let mut faces: Vec<_> = faces.map(|f| (place(&f.nodes), f.edges)).collect();
    faces.sort_by(|a, b| a.0.cmp(&b.0));
    faces
}

fn read(file: &Path) -> Whole {
    read_whole(file, 3).unwrap().0
}

#[test]
fn a_grid_in_parts_is_the_whole_one() {
    let bodies = [box_of([4, 3, 2], 0.0, "uL"), box_of([2, 2, 2], 4.0 / 3.0, "uR"), face(4)];
    // one rank has nothing at all, others nothing of a body or of the face
    let rank = |piece: usize, cell: usize| match piece {
        0 => [0, 1, 3][cell % 3],
        1 => 3 - cell % 2 * 2,
        _ => 3 * (cell % 4 / 2),
    };
    let scratch = Scratch::new();
    let [whole, shared] = write(&scratch, &bodies, 4, rank);
    let (one, names) = read_whole(&whole, 3).unwrap();
    let (other, other_names) = read_whole(&shared, 3).unwrap();
    assert_eq!(names, other_names);
    assert_eq!((one.points.len(), one.cells.len()), (other.points.len(), other.cells.len()));
    assert_eq!(as_set(&one), as_set(&other));
    assert_eq!(seen(&one), seen(&other));
    // the bodies share no nodes, though they touch
    assert_eq!(one.points.len(), 5 * 4 * 3 + 27);
    let [one, other] = [&whole, &shared].map(|file| read_pieces(file, 2).unwrap());
    assert_eq!((one.len(), other.len()), (1, 1));
    let (one, other) = (&one[0], &other[0]);
    let cells = |p: &super::super::Piece| {
        let node = |n: &usize| bits(&[&p.points[*n][..], p.point_data[0].of(&(*n..n + 1))].concat());
        let of = |(k, c): (usize, &Vec<usize>)| (c.iter().map(node).collect(), p.cell_data[0].numbers[k].to_bits());
        let mut all: Vec<(Vec<_>, u64)> = p.cells.iter().enumerate().map(of).collect();
        all.sort();
        all
    };
    let names =
        |p: &super::super::Piece| p.point_data.iter().chain(&p.cell_data).map(|v| v.name.clone()).collect::<Vec<_>>();
    assert_eq!((names(one), names(one)), (names(other), vec!["slip".to_owned(), "contact_state".to_owned()]));
    assert_eq!((cells(one), one.points.len()), (cells(other), other.points.len()));
}

#[test]
fn the_sides_of_a_crack_stay_apart() {
    // two boxes that are joined below and torn above the plane between them: nodes of the same place, other values
    let mut body = box_of([2, 1, 4], 0.0, "u");
    let torn = |p: &[f64; 3]| p[0] == 1.0 / 3.0 && p[2] > 2.0;
    let sides: Vec<usize> = (0..body.points.len()).filter(|n| torn(&body.points[*n])).collect();
    let n = body.points.len();
    let second = |node: u32| {
        let at = sides.iter().position(|s| *s == node as usize);
        at.map_or(node, |k| u32::try_from(n + k).unwrap())
    };
    let cells = body.cells.iter().enumerate();
    let moved = cells
        .map(|(k, (kind, c))| (kind, if k % 2 == 1 { c.iter().map(|n| second(*n)).collect() } else { c.to_vec() }));
    body.cells = moved.collect::<Vec<_>>().into_iter().collect();
    for s in &sides {
        body.points.push(body.points[*s]);
        body.point_data[0].values.extend([9.0; 3]);
    }
    let scratch = Scratch::new();
    // the border runs along the crack, with one side on each rank
    let [whole, shared] = write(&scratch, &[body.clone()], 2, |_, cell| cell % 2);
    let (one, other) = (read(&whole), read(&shared));
    assert_eq!((one.points.len(), as_set(&one), seen(&one)), (other.points.len(), as_set(&other), seen(&other)));
    // across the crack, with both sides on both ranks, and equal values: as long as it is closed
    body.point_data[0].values[3 * n..].fill(0.0);
    sides.iter().for_each(|s| body.point_data[0].values[3 * s..][..3].fill(0.0));
    let scratch = Scratch::new();
    let [whole, shared] = write(&scratch, &[body.clone()], 2, |_, cell| usize::from(cell >= 6));
    let (one, other) = (read(&whole), read(&shared));
    assert_eq!((one.points.len(), as_set(&one), seen(&one)), (other.points.len(), as_set(&other), seen(&other)));
}

#[test]
fn means_over_the_cells_of_a_rank_do_not_tear_a_body() {
    let body = box_of([3, 2, 2], 0.0, "u");
    let scratch = Scratch::new();
    let dir = OutputDir::open(&scratch.0).unwrap();
    dir.begin(Kind::Run, &Identity::default(), &Plan::default()).unwrap();
    let whole = Series::new(&dir, "whole").write_step(0, 0.5, std::slice::from_ref(&body)).unwrap();
    let part = |rank: usize| {
        let mut own = share(&body, |cell| cell % 3 % 2 == rank);
        let stress = vec![rank as f64; own.points.len()];
        own.point_data.push(Array::scalar("stress", stress));
        Ok::<_, OutputError>(vec![own])
    };
    let shared = Series::new(&dir, "shared").write_parts(0, 0.5, (0..2).map(part)).unwrap();
    let (one, other) = (read(&whole), read(shared.last().unwrap()));
    assert_eq!((one.points.len(), seen(&one)), (other.points.len(), seen(&other)));
}

#[test]
fn a_list_that_is_damaged_is_an_error() {
    let scratch = Scratch::new();
    let [_, shared] = write(&scratch, &[box_of([2, 1, 1], 0.0, "u")], 2, |_, cell| cell);
    let text = std::fs::read_to_string(&shared).unwrap();
    for wrong in ["", &text[..text.len() / 2], &text.replace("shared_0000.p0001", "../p0001")] {
        std::fs::write(&shared, wrong).unwrap();
        assert!(matches!(read_whole(&shared, 3), Err(ReportError::Damaged { .. })));
    }
    std::fs::write(&shared, text.replace("shared_0000.p0001", "shared_0000.p0002")).unwrap();
    assert!(matches!(read_whole(&shared, 3), Err(ReportError::Read { .. })));
}
