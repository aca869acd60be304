//! Element types by their names: shape, order of the nodes, faces.

use crate::mesh::read::error::ReadError;

/// A shape of first or second order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    Segment(usize),
    Triangle(usize),
    Quadrilateral(usize),
    Tetrahedron(usize),
    Hexahedron(usize),
    Wedge(usize),
    Pyramid,
}

/// Nodes of hexahedra and wedges of second order in Gmsh's order: corners, then edges in its own order.
const HEXAHEDRON: [usize; 20] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 16, 9, 17, 10, 18, 19, 12, 15, 13, 14];
const WEDGE: [usize; 15] = [0, 1, 2, 3, 4, 5, 6, 8, 12, 7, 13, 14, 9, 11, 10];

impl Shape {
    pub(super) fn n_nodes(self) -> usize {
        match self {
            Self::Segment(order) => [2, 3][order - 1],
            Self::Triangle(order) => [3, 6][order - 1],
            Self::Quadrilateral(order) => [4, 8][order - 1],
            Self::Tetrahedron(order) => [4, 10][order - 1],
            Self::Hexahedron(order) => [8, 20][order - 1],
            Self::Wedge(order) => [6, 15][order - 1],
            Self::Pyramid => 5,
        }
    }

    /// Gmsh's number of the type.
    pub(super) fn code(self) -> i64 {
        match self {
            Self::Segment(order) => [1, 8][order - 1],
            Self::Triangle(order) => [2, 9][order - 1],
            Self::Quadrilateral(order) => [3, 16][order - 1],
            Self::Tetrahedron(order) => [4, 11][order - 1],
            Self::Hexahedron(order) => [5, 17][order - 1],
            Self::Wedge(order) => [6, 18][order - 1],
            Self::Pyramid => 7,
        }
    }

    /// The nodes in Gmsh's order: it differs in the middles of the edges of solids.
    pub(super) fn in_order(self, nodes: &[u64]) -> Vec<u64> {
        let picked = |order: &[usize]| order.iter().map(|k| nodes[*k]).collect();
        match self {
            Self::Tetrahedron(2) => picked(&[0, 1, 2, 3, 4, 5, 6, 7, 9, 8]),
            Self::Hexahedron(2) => picked(&HEXAHEDRON),
            Self::Wedge(2) => picked(&WEDGE),
            _ => nodes.to_vec(),
        }
    }

    /// Corners of a flat element, which is a face of a solid.
    pub(super) fn side(self) -> Option<&'static [usize]> {
        match self {
            Self::Triangle(_) => Some(&[0, 1, 2]),
            Self::Quadrilateral(_) => Some(&[0, 1, 2, 3]),
            _ => None,
        }
    }

    /// Corners of its faces S1, S2, ...
    pub(super) fn faces(self) -> &'static [&'static [usize]] {
        match self {
            Self::Segment(_) => &[],
            Self::Triangle(_) => &[&[0, 1], &[1, 2], &[2, 0]],
            Self::Quadrilateral(_) => &[&[0, 1], &[1, 2], &[2, 3], &[3, 0]],
            Self::Tetrahedron(_) => &[&[0, 1, 2], &[0, 3, 1], &[1, 3, 2], &[2, 3, 0]],
            Self::Hexahedron(_) => {
                &[&[0, 1, 2, 3], &[4, 7, 6, 5], &[0, 4, 5, 1], &[1, 5, 6, 2], &[2, 6, 7, 3], &[3, 7, 4, 0]]
            }
            Self::Wedge(_) => &[&[0, 1, 2], &[3, 5, 4], &[0, 3, 4, 1], &[1, 4, 5, 2], &[2, 5, 3, 0]],
            Self::Pyramid => &[&[0, 1, 2, 3], &[0, 4, 1], &[1, 4, 2], &[2, 4, 3], &[3, 4, 0]],
        }
    }
}

/// Beginnings of names of solids, of plane elements, shells and membranes, of lines; the number of nodes stands behind.
const SOLID: [&str; 4] = ["DC3D", "AC3D", "C3D", "F3D"];
const FLAT: [&str; 18] = [
    "CPEG", "CPS", "CPE", "CAX", "DCAX", "ACAX", "DC2D", "AC2D", "STRI", "SFM3D", "M3D", "R3D", "DS", "SC", "S", "F2D",
    "CGAX", "MGAX",
];
const LINE: [&str; 9] = ["T2D", "T3D", "B2", "B3", "R2D", "RAX", "DC1D", "SAX", "MAX"];

/// Beginnings of names of elements without a shape: springs, dashpots, masses, gaps, couplings, connectors.
const BODILESS: [&str; 10] =
    ["SPRING", "DASHPOT", "MASS", "ROTARYI", "HEATCAP", "GAP", "DCOUP", "CONN", "ITT", "JOINTC"];

/// Elements of this type are no cells of a mesh: they act between nodes, or are pipes of a network (`D`).
pub(super) fn bodiless(name: &str) -> bool {
    let name = name.to_uppercase();
    name == "D" || BODILESS.iter().any(|start| name.starts_with(start))
}

/// The shape of a type by its name.
pub(super) fn shape(name: &str, element: u64, line: usize) -> Result<Shape, ReadError> {
    let name = name.to_uppercase();
    let nodes = |starts: &[&str]| {
        let rest = starts.iter().filter_map(|start| name.strip_prefix(start)).min_by_key(|rest| rest.len())?;
        let digits: String = rest.chars().take_while(char::is_ascii_digit).collect();
        digits.parse::<usize>().ok()
    };
    let found = match (nodes(&SOLID), nodes(&FLAT), nodes(&LINE)) {
        (Some(4), ..) => Some(Shape::Tetrahedron(1)),
        (Some(10), ..) => Some(Shape::Tetrahedron(2)),
        (Some(8), ..) => Some(Shape::Hexahedron(1)),
        (Some(20), ..) => Some(Shape::Hexahedron(2)),
        (Some(6), ..) => Some(Shape::Wedge(1)),
        (Some(15), ..) => Some(Shape::Wedge(2)),
        (Some(5), ..) => Some(Shape::Pyramid),
        (None, Some(3), _) => Some(Shape::Triangle(1)),
        // STRI65 has six nodes with five degrees of freedom
        (None, Some(6 | 65), _) => Some(Shape::Triangle(2)),
        (None, Some(4), _) => Some(Shape::Quadrilateral(1)),
        (None, Some(8), _) => Some(Shape::Quadrilateral(2)),
        // beams count their order: B31, B32
        (None, None, Some(n)) if name.starts_with('B') => (n < 3).then_some(Shape::Segment(n)),
        (None, None, Some(2)) => Some(Shape::Segment(1)),
        (None, None, Some(3)) => Some(Shape::Segment(2)),
        _ => None,
    };
    let unread = || format!("element {element} is a {name}, which is no element that is read");
    found.ok_or_else(|| ReadError::deck(line, unread()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_the_shape() {
        assert!(["SPRINGA", "gapuni", "D", "DCOUP3D", "Mass"].iter().all(|name| bodiless(name)));
        assert!(["DC3D8", "DS4", "C3D8", "S4"].iter().all(|name| !bodiless(name)));
        for (name, expected) in [
            ("C3D4", Shape::Tetrahedron(1)),
            ("C3D10MH", Shape::Tetrahedron(2)),
            ("c3d8r", Shape::Hexahedron(1)),
            ("DC3D6", Shape::Wedge(1)),
            ("C3D20R", Shape::Hexahedron(2)),
            ("C3D15", Shape::Wedge(2)),
            ("CPS8R", Shape::Quadrilateral(2)),
            ("S8R", Shape::Quadrilateral(2)),
            ("C3D5", Shape::Pyramid),
            ("CPS3", Shape::Triangle(1)),
            ("CPE6M", Shape::Triangle(2)),
            ("STRI65", Shape::Triangle(2)),
            ("CAX4R", Shape::Quadrilateral(1)),
            ("S4R5", Shape::Quadrilateral(1)),
            ("S3", Shape::Triangle(1)),
            ("M3D4", Shape::Quadrilateral(1)),
            ("T3D2", Shape::Segment(1)),
            ("B31", Shape::Segment(1)),
            ("B32", Shape::Segment(2)),
            ("T2D3", Shape::Segment(2)),
        ] {
            assert_eq!(shape(name, 1, 1).unwrap(), expected, "{name}");
        }
        for name in ["US3", "C3D27", "C3D", "X"] {
            let told = shape(name, 7, 3).unwrap_err().to_string();
            assert!(told.contains("line 3") && told.contains("element 7") && told.contains(name), "{told}");
        }
    }
}
