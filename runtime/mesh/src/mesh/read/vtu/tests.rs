use super::*;
use crate::mesh::{GroupEntities, Mesh, cell_volumes};

/// A wedge and a hexahedron of side 1 under it, with a number at each cell and the face between them as a cell of its own.
const POINTS: &str = "0 0 0  1 0 0  1 1 0  0 1 0  0 0 1  1 0 1  1 1 1  0 1 1  0 0 2  1 0 2";

fn file(head: &str, arrays: &str, tail: &str) -> Vec<u8> {
    format!("<?xml version=\"1.0\"?>\n<!-- a > b -->\n<VTKFile type=\"UnstructuredGrid\" {head}>\n<UnstructuredGrid>\n\
             <Piece NumberOfPoints=\"10\" NumberOfCells=\"3\">\n{arrays}</Piece>\n</UnstructuredGrid>\n{tail}</VTKFile>\n")
    .into_bytes()
}

fn ascii(points: &str, wedge: &str) -> Vec<u8> {
    let array = |kind: &str, name: &str, text: &str| {
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" format=\"ascii\"><InformationKey name=\"x\">9</InformationKey>\n{text}\n</DataArray>\n"
        )
    };
    let cells = array("Int64", "connectivity", &format!("0 1 2 3 4 5 6 7 {wedge} 4 5 6 7"))
        + &array("Int64", "offsets", "8 14 18")
        + &array("UInt8", "types", "12 13 9");
    let arrays = format!(
        "<PointData>{}</PointData>\n<CellData>{}</CellData>\n<Points>{}</Points>\n<Cells>{cells}</Cells>\n",
        array("Int32", "ignored", "0 1 2 3 4 5 6 7 8 9"),
        array("Int32", "material", "2 -1 5") + &array("Float64", "stress", "1 2 3"),
        array("Float64", "Points", points).replace("<DataArray", "<DataArray NumberOfComponents=\"3\""),
    );
    file("", &arrays, "")
}

fn volume(bytes: &[u8]) -> f64 {
    let mesh = Mesh::from_raw(parse(bytes).unwrap()).unwrap();
    cell_volumes(&mesh, &mesh.cells().collect::<Vec<_>>()).iter().sum()
}

#[test]
fn wedges_are_read_whichever_triangle_is_the_first() {
    // the roof has its ridge over the edge of y = 0: triangles 4 7 8 and 5 6 9
    for wedge in ["4 7 8 5 6 9", "4 8 7 5 9 6"] {
        assert!((volume(&ascii(POINTS, wedge)) - 1.5).abs() < 1e-14);
    }
}

#[test]
fn whole_numbers_of_cells_are_groups_of_cells_and_faces() {
    let raw = parse(&ascii(POINTS, "4 7 8 5 6 9")).unwrap();
    let names: Vec<(&str, usize)> = raw.groups.iter().map(|g| (g.name.as_str(), g.dim)).collect();
    assert_eq!(names, [("material_minus_1", 3), ("material_2", 3), ("material_5", 2)]);
    assert!(matches!(&raw.groups[2].entities, GroupEntities::Facets(list) if list.len() == 1));
}

/// Letters of base64.
fn letters(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for three in bytes.chunks(3) {
        let word = three.iter().chain([&0; 2]).take(3).fold(0u32, |w, b| w << 8 | u32::from(*b));
        for k in 0..4 {
            let letter = char::from(LETTERS[(word >> (18 - 6 * k)) as usize & 63]);
            text.push(if k <= three.len() { letter } else { '=' });
        }
    }
    text
}

/// What the first tag says of a layout.
fn head(compressed: bool, big: bool) -> String {
    let order = if big { "BigEndian" } else { "LittleEndian" };
    let compressor = if compressed { " compressor=\"vtkZLibDataCompressor\"" } else { "" };
    format!("header_type=\"UInt64\" byte_order=\"{order}\"{compressor}")
}

/// The same grid with data in these layouts.
fn binary(compressed: bool, appended: Option<bool>, big: bool) -> Vec<u8> {
    let order = |mut bytes: Vec<u8>| {
        if big {
            bytes.reverse();
        }
        bytes
    };
    let size = |n: usize| order((n as u64).to_le_bytes().to_vec());
    let doubles = |text: &str| -> Vec<u8> {
        text.split_whitespace().flat_map(|w| order(w.parse::<f64>().unwrap().to_le_bytes().to_vec())).collect()
    };
    let longs = |text: &str| -> Vec<u8> {
        text.split_whitespace().flat_map(|w| order(w.parse::<i64>().unwrap().to_le_bytes().to_vec())).collect()
    };
    let arrays = [
        ("Points", "Float64", "Points", doubles(POINTS)),
        ("Cells", "Int64", "connectivity", longs("0 1 2 3 4 5 6 7 4 7 8 5 6 9 4 5 6 7")),
        ("Cells", "Int64", "offsets", longs("8 14 18")),
        ("Cells", "UInt8", "types", vec![12, 13, 9]),
    ];
    let (mut text, mut data) = (String::new(), b"_".to_vec());
    for (outer, kind, name, bytes) in arrays {
        // two blocks, the last one shorter
        let half = bytes.len() / 2 + 1;
        let blocks: Vec<Vec<u8>> =
            bytes.chunks(half).map(|b| miniz_oxide::deflate::compress_to_vec_zlib(b, 6)).collect();
        let (header, body) = if compressed {
            let last = bytes.len() - half * (blocks.len() - 1);
            let mut header = [size(blocks.len()), size(half), size(last)].concat();
            header.extend(blocks.iter().flat_map(|b| size(b.len())));
            (header, blocks.concat())
        } else {
            (size(bytes.len()), bytes)
        };
        let written = match (compressed, appended) {
            (_, Some(false)) => [header, body].concat(),
            (true, _) => (letters(&header) + &letters(&body)).into_bytes(),
            (false, _) => letters(&[header, body].concat()).into_bytes(),
        };
        let place = match appended {
            None => format!("format=\"binary\">\n {}\n</DataArray>", String::from_utf8(written).unwrap()),
            Some(_) => {
                let at = data.len() - 1;
                data.extend(written);
                format!("format=\"appended\" offset=\"{at}\"/>")
            }
        };
        text += &format!("<{outer}><DataArray type=\"{kind}\" Name=\"{name}\" {place}</{outer}>\n");
    }
    let mut bytes = file(&head(compressed, big), &text, "");
    if let Some(letters) = appended {
        let encoding = if letters { "base64" } else { "raw" };
        bytes.extend(format!("<AppendedData encoding=\"{encoding}\">\n").bytes());
        bytes.extend(data);
        bytes.extend(b"\n</AppendedData>");
    }
    bytes
}

#[test]
fn every_way_of_writing_gives_the_same_mesh() {
    for compressed in [false, true] {
        for appended in [None, Some(false), Some(true)] {
            for big in [false, true] {
                let bytes = binary(compressed, appended, big);
                assert!((volume(&bytes) - 1.5).abs() < 1e-14, "{compressed} {appended:?} {big}");
            }
        }
    }
}

#[test]
fn what_is_not_read_says_why_and_what_to_do() {
    let good = String::from_utf8(ascii(POINTS, "4 7 8 5 6 9")).unwrap();
    for (from, to, words) in [
        ("12 13 9", "12 42 9", "cell 1 (VTK type 42, 6 nodes) is a polyhedron; write triangles"),
        (
            "type=\"UnstructuredGrid\"",
            "type=\"PolyData\"",
            "the file is a `PolyData`; write it as an unstructured grid",
        ),
        (
            "UnstructuredGrid\" >",
            "UnstructuredGrid\" compressor=\"vtkLZ4DataCompressor\">",
            "vtkLZ4DataCompressor is not",
        ),
        ("</Piece>", "</Piece><Piece NumberOfCells=\"1\">", "several pieces"),
        ("8 14 18", "8 14 19", "cell 2 has its nodes at 14 to 19 of 18"),
        ("Name=\"types\"", "Name=\"kinds\"", "no array `types`"),
        ("0 0 0  1 0 0", "0 0 0  1 0 x", "the data of `Points` ends early or is damaged"),
        ("0 0 0  1 0 0", "0 0 0  1 0 nan", "node 1 is NaN"),
        (
            "NumberOfComponents=\"3\"",
            "NumberOfComponents=\"2\"",
            "NumberOfComponents=\"2\"; a grid of VTK has three coordinates",
        ),
        ("0 0 0  1 0 0", "0 0 0  1 0", "29 numbers, which is not three coordinates a point"),
        ("0 1 2 3 4 5 6 7 4", "0 1 2 3 4 5 6 77 4", "element 0 uses node 77"),
    ] {
        let text = good.replacen(from, to, 1);
        assert_ne!(text, good, "{from}");
        let told = parse(text.as_bytes()).unwrap_err().to_string();
        assert!(told.contains(words), "{told}");
    }
}

/// Any cut and any changed byte gives a mesh or an error, and never a panic or a runaway allocation.
#[test]
fn damaged_files_are_errors() {
    let mut state = 7u64;
    for bytes in [binary(true, Some(false), false), binary(false, Some(true), false), binary(true, None, false)] {
        for cut in (0..bytes.len()).step_by(1 + bytes.len() / 100) {
            let _ = parse(&bytes[..cut]);
        }
        for _ in 0..400 {
            let mut damaged = bytes.clone();
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let at = (state >> 33) as usize % damaged.len();
            damaged[at] = (state >> 20) as u8;
            if let Ok(raw) = parse(&damaged) {
                let _ = Mesh::from_raw(raw);
            }
        }
    }
}
