//! Tests of the grid writer: files are read back by a small reader that shares no code with it.

use std::fs;

use super::super::{Cells, scratch::Scratch};
use super::*;

/// One `DataArray` as a reader sees it.
#[derive(Debug)]
struct Read {
    section: String,
    name: String,
    components: usize,
    bytes: Vec<u8>,
}

impl Read {
    fn floats(&self) -> Vec<f64> {
        let words = self.bytes.chunks_exact(8);
        words.map(|w| f64::from_le_bytes(w.try_into().unwrap())).collect()
    }

    fn integers(&self) -> Vec<i64> {
        let words = self.bytes.chunks_exact(8);
        words.map(|w| i64::from_le_bytes(w.try_into().unwrap())).collect()
    }
}

fn attribute<'t>(line: &'t str, key: &str) -> &'t str {
    let start = line.find(&format!(" {key}=\"")).unwrap() + key.len() + 3;
    line[start..].split('"').next().unwrap()
}

/// All arrays of a file; checks that blocks follow each other without gap up to the end.
fn read(file: &[u8]) -> Vec<Read> {
    let mark = b"<AppendedData encoding=\"raw\">\n_";
    let at = file.windows(mark.len()).position(|w| w == mark).unwrap();
    let header = str::from_utf8(&file[..at]).unwrap();
    let data = &file[at + mark.len()..];
    let mut end = 0;
    let mut section = String::new();
    let mut arrays = Vec::new();
    for line in header.lines() {
        if line.starts_with("<DataArray ") {
            let offset: usize = attribute(line, "offset").parse().unwrap();
            assert_eq!(offset, end, "{line}");
            let length = data[offset..offset + 8].try_into().unwrap();
            end = offset + 8 + usize::try_from(u64::from_le_bytes(length)).unwrap();
            arrays.push(Read {
                section: section.clone(),
                name: attribute(line, "Name").to_owned(),
                components: attribute(line, "NumberOfComponents").parse().unwrap(),
                bytes: data[offset + 8..end].to_vec(),
            });
        } else {
            section = line.to_owned();
        }
    }
    assert_eq!(&data[end..], b"\n</AppendedData>\n</VTKFile>\n");
    arrays
}

fn write(pieces: &[Piece], time: Option<f64>) -> Result<Vec<Read>, OutputError> {
    let scratch = Scratch::new();
    let dir = OutputDir::create(scratch.path()).unwrap();
    let file = write_vtu(&dir, "grid.vtu", time, pieces);
    file.map(|file| read(&fs::read(file).unwrap()))
}

fn fault(pieces: &[Piece]) -> VtuError {
    match write(pieces, None) {
        Err(OutputError::Vtu { file, source }) => {
            assert!(file.ends_with("grid.vtu"));
            source
        }
        other => panic!("{other:?}"),
    }
}

fn array(name: &str, components: usize, values: &[f64]) -> Array {
    Array { name: name.into(), components, values: values.to_vec() }
}

/// A unit square of one quadrilateral and one triangle beside it.
fn square() -> Piece {
    let mut cells = Cells::default();
    cells.push_local(VtkCell::Quad, &[0, 1, 2, 3]);
    cells.push(VtkCell::Triangle, &[1, 4, 3]);
    Piece {
        points: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [2.0, 0.5, 0.0]],
        cells,
        point_data: vec![array("u", 2, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 0.1])],
        cell_data: vec![array("p", 1, &[-0.0, 5e-324])],
    }
}

/// Two nodes and the line between them.
fn line() -> Piece {
    Piece {
        points: vec![[0.0; 3], [1.0, 0.0, 0.0]],
        cells: [(VtkCell::Line, vec![0, 1])].into_iter().collect(),
        point_data: vec![array("lambda", 1, &[0.25, -0.5])],
        cell_data: Vec::new(),
    }
}

#[test]
fn a_mixed_grid_reads_back_bit_for_bit() {
    let arrays = write(&[square()], Some(1.0 / 3.0)).unwrap();
    let names: Vec<(&str, &str)> = arrays.iter().map(|a| (a.section.as_str(), a.name.as_str())).collect();
    assert_eq!(
        names,
        [
            ("<FieldData>", "TimeValue"),
            ("<Points>", "Points"),
            ("<Cells>", "connectivity"),
            ("<Cells>", "offsets"),
            ("<Cells>", "types"),
            ("<PointData>", "u"),
            ("<CellData>", PART),
            ("<CellData>", "p"),
        ]
    );
    assert_eq!(arrays[0].floats(), [1.0 / 3.0]);
    assert_eq!(arrays[1].floats(), square().points.as_flattened());
    assert_eq!(arrays[2].integers(), [0, 1, 3, 2, 1, 4, 3]);
    assert_eq!(arrays[3].integers(), [4, 7]);
    assert_eq!(arrays[4].bytes, [9, 5]);
    assert_eq!(arrays[5].components, 3);
    let u = [1.0, 2.0, 0.0, 3.0, 4.0, 0.0, 5.0, 6.0, 0.0, 7.0, 8.0, 0.0, 9.0, 0.1, 0.0];
    assert_eq!(arrays[5].floats(), u);
    assert_eq!(arrays[6].floats(), [0.0, 0.0]);
    let bits: Vec<u64> = arrays[7].floats().iter().map(|x| x.to_bits()).collect();
    assert_eq!(bits, [1 << 63, 1]);
}

#[test]
fn blocks_longer_than_the_buffer_are_whole() {
    let n = 3 * CHUNK;
    let values: Vec<f64> = (0..2 * n).map(|i| i as f64).collect();
    let piece = Piece {
        points: vec![[0.5; 3]; n],
        point_data: vec![array("u", 2, &values), array("p", 1, &values[..n])],
        ..Piece::default()
    };
    let arrays = write(&[piece], None).unwrap();
    let u = arrays.iter().find(|a| a.name == "u").unwrap().floats();
    assert_eq!(u.len(), 3 * n);
    assert!(u.chunks(3).enumerate().all(|(i, row)| { row == [2.0 * i as f64, 2.0 * i as f64 + 1.0, 0.0] }));
    let p = arrays.iter().find(|a| a.name == "p").unwrap().floats();
    assert_eq!(p, values[..n]);
}

#[test]
fn pieces_stand_one_after_the_other_in_one_piece_of_the_file() {
    let arrays = write(&[square(), line(), square()], None).unwrap();
    let one = |name: &str| arrays.iter().filter(|a| a.name == name).collect::<Vec<_>>();
    for name in ["Points", "connectivity", "offsets", "types", "u", "lambda", PART, "p"] {
        assert_eq!(one(name).len(), 1, "{name}");
    }
    let points = [square().points, line().points, square().points].concat();
    assert_eq!(one("Points")[0].floats(), points.as_flattened());
    // five nodes before the line, two more before the second square
    assert_eq!(one("connectivity")[0].integers(), [0, 1, 3, 2, 1, 4, 3, 5, 6, 7, 8, 10, 9, 8, 11, 10]);
    assert_eq!(one("offsets")[0].integers(), [4, 7, 9, 13, 16]);
    assert_eq!(one("types")[0].bytes, [9, 5, 3, 9, 5]);
    assert_eq!(one(PART)[0].floats(), [0.0, 0.0, 1.0, 2.0, 2.0]);
    // what a part lacks is not a number there
    let [u, lambda, p] = ["u", "lambda", "p"].map(|name| one(name)[0].floats());
    assert_eq!((u.len(), lambda.len(), p.len()), (3 * 12, 12, 5));
    assert!(u[15..21].iter().all(|x| x.is_nan()) && u[..15] == u[21..]);
    assert!(lambda[..5].iter().chain(&lambda[7..]).all(|x| x.is_nan()) && lambda[5..7] == [0.25, -0.5]);
    assert!(p[2].is_nan() && p[..2] == p[3..]);
}

#[test]
fn the_number_of_the_part_has_its_name_alone() {
    let mut piece = line();
    piece.cell_data = vec![array(PART, 1, &[1.0])];
    assert_eq!(fault(&[line(), piece]), VtuError::DuplicateArray { piece: 1, name: PART.to_owned() });
}

#[test]
fn names_are_escaped() {
    let mut piece = line();
    piece.point_data[0].name = "<σ & \"n\"\t\u{1}'>".into();
    let arrays = write(&[piece], None).unwrap();
    let name = &arrays.iter().find(|a| a.section == "<PointData>").unwrap().name;
    assert_eq!(name, "&lt;σ &amp; &quot;n&quot;&#9;\u{fffd}&apos;&gt;");
}

#[test]
fn small_matrices_stand_in_the_upper_corner() {
    let plane = Array::matrix("s", [2, 2], vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
    assert_eq!(plane.components, 9);
    let expected = [[1.0, 2.0, 0.0, 3.0, 4.0, 0.0, 0.0, 0.0, 0.0], [5.0, 6.0, 0.0, 7.0, 8.0, 0.0, 0.0, 0.0, 0.0]];
    assert_eq!(plane.values, expected.as_flattened());
    let full: Vec<f64> = (0..9).map(f64::from).collect();
    assert_eq!(Array::matrix("s", [3, 3], full.clone()).values, full);
    assert_eq!(Array::matrix("s", [3, 4], vec![0.0; 12]).components, 12);
}

#[test]
fn a_wrong_matrix_length_is_found() {
    let mut piece = line();
    piece.point_data = vec![Array::matrix("s", [2, 2], vec![0.0; 9])];
    assert!(matches!(fault(&[piece]), VtuError::ArrayLength { expected: 8, found: 9, .. }));
}

#[test]
fn contradictions_are_found_before_the_file_is_touched() {
    assert_eq!(fault(&[]), VtuError::NoPiece);

    let mut piece = line();
    piece.cells.push_local(VtkCell::Quad, &[0, 1, 0]);
    assert!(matches!(fault(&[line(), piece]), VtuError::CellNodes { piece: 1, cell: 1, found: 3, .. }));

    let mut piece = line();
    piece.cells.push(VtkCell::Vertex, &[2]);
    assert!(matches!(fault(&[piece]), VtuError::NoSuchNode { cell: 1, node: 2, n_points: 2, .. }));

    let mut piece = line();
    piece.cell_data = vec![array("p", 1, &[1.0, 2.0])];
    assert!(matches!(fault(&[piece]), VtuError::ArrayLength { expected: 1, found: 2, .. }));

    let mut piece = line();
    piece.point_data.push(piece.point_data[0].clone());
    assert!(matches!(fault(&[piece]), VtuError::DuplicateArray { piece: 0, .. }));

    let mut piece = line();
    piece.point_data = vec![array("u", 0, &[])];
    assert!(matches!(fault(&[piece.clone()]), VtuError::ArrayComponents { found: 0, .. }));
    piece.point_data = vec![array("u", 3, &[0.0; 6])];
    assert!(matches!(fault(&[square(), piece]), VtuError::ArrayComponents { piece: 1, expected: 2, found: 3, .. }));
}

#[test]
fn wedges_and_pyramids_read_back_in_the_order_of_vtk() {
    let mut cells = Cells::default();
    let all = |n: u32| (0..n).collect::<Vec<u32>>();
    cells.push_local(VtkCell::Wedge, &all(6));
    cells.push_local(VtkCell::Pyramid, &all(5));
    // the middle of the base stays a point of the file and is no node of the cell
    cells.push_local(VtkCell::QuadraticPyramid, &all(14));
    let points = (0..14).map(|k| [f64::from(k), 0.0, 0.0]).collect();
    let piece = Piece { points, cells, point_data: Vec::new(), cell_data: Vec::new() };
    let arrays = write(&[piece], None).unwrap();
    let find = |name: &str| arrays.iter().find(|a| a.name == name).unwrap();
    assert_eq!(find("types").bytes, [13, 14, 27]);
    assert_eq!(find("offsets").integers(), [6, 11, 24]);
    let nodes = find("connectivity").integers();
    assert_eq!(nodes[..11], [0, 2, 1, 3, 5, 4, 0, 1, 3, 2, 4]);
    assert!(nodes.len() == 24 && !nodes[11..].contains(&4));
}
