//! A picture of a mesh, without a run: its cells, coloured by their regions, sizes or angles.

use wfl_charts::{Chart, Face, Ramp, Scale, short};
use wfl_mesh::mesh::{CellKind, GroupEntities, Mesh, cell_shapes, element_sizes};
use wfl_output::{VtkCell, vtk_order};

use crate::{
    grid::{Whole, WholeCell},
    picture::Picture,
    plot::{MeshLines, View, skin},
};

/// What the colours of a mesh say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshColours {
    /// The groups of cells.
    Regions,
    /// The largest distance between two corners.
    Size,
    /// The smallest angle, in degrees.
    Angle,
}

/// Cells whose edges are drawn.
const EDGED: usize = 40_000;
/// Room for the picture without title and ramp, in units.
const ROOM: [f64; 2] = [440.0, 330.0];
/// Names of groups in the second line.
const NAMED: usize = 5;

/// Draws a mesh of dimension 2 or 3; `None` of a line.
#[must_use]
pub fn mesh_picture(mesh: &Mesh, name: &str, colours: MeshColours, view: View) -> Option<Picture> {
    if mesh.dim() < 2 {
        return None;
    }
    let Coloured { numbers, label, second } = coloured(mesh, colours);
    let (whole, cells) = whole(mesh);
    let lines = if cells.len() <= EDGED { MeshLines::Drawn } else { MeshLines::Hidden };
    let mut faces = Vec::new();
    for face in skin(&whole, &cells, lines) {
        let place = |n: &usize| if mesh.dim() == 3 { view.at(whole.points[*n]) } else { whole.points[*n] };
        let corners: Vec<[f64; 3]> = face.nodes.iter().map(place).collect();
        let tones = vec![numbers[face.cell]; corners.len()];
        if mesh.dim() == 2 || is_front(&corners) {
            faces.push(Face::new(corners, tones, face.edges));
        }
    }
    let (low, high) = bounds(&faces);
    let size = |axis: usize| high[axis] - low[axis];
    let scale = (ROOM[0] / size(0)).min(ROOM[1] / size(1));
    let width = ((scale * size(0)).clamp(120.0, ROOM[0]) + 150.0).max(360.0);
    let height = (scale * size(1)).clamp(60.0, ROOM[1]) + 112.0;
    let range = numbers.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(*x), b.max(*x)]);
    let chart = Chart::new(name).size(width, height).equal().subtitle(second);
    let chart = chart.surface(label, Ramp::Viridis, faces).map_range(range[0], range[1]).room(low, high);
    let chart = match mesh.dim() {
        2 => chart.x("x", Scale::Linear).y("y", Scale::Linear),
        _ => chart.triad(view.axes()),
    };
    Some(Picture::new(name, chart))
}

/// Numbers of cells, what they are, and a line about them.
struct Coloured {
    numbers: Vec<f64>,
    label: String,
    second: String,
}

fn coloured(mesh: &Mesh, colours: MeshColours) -> Coloured {
    let cells: Vec<_> = mesh.cells().collect();
    let count = format!("{} cells, {} nodes", mesh.n_cells(), mesh.n_nodes());
    match colours {
        MeshColours::Size => Coloured { numbers: element_sizes(mesh, &cells), label: "size".to_owned(), second: count },
        MeshColours::Angle => {
            let numbers: Vec<f64> = cell_shapes(mesh).iter().map(|s| s.angles[0]).collect();
            let least = numbers.iter().copied().fold(f64::INFINITY, f64::min);
            let second = format!("{count}, smallest angle {}°", short(least));
            Coloured { numbers, label: "smallest angle [°]".to_owned(), second }
        }
        MeshColours::Regions => {
            let groups: Vec<_> = mesh
                .groups()
                .iter()
                .filter_map(|g| match &g.entities {
                    GroupEntities::Cells(cells) => Some((&g.name, cells)),
                    _ => None,
                })
                .collect();
            let mut numbers = vec![0.0; mesh.n_cells()];
            let mut names = Vec::new();
            for (k, (name, cells)) in groups.iter().enumerate() {
                #[expect(clippy::cast_precision_loss, reason = "a few groups")]
                cells.iter().for_each(|c| numbers[c.index()] = (k + 1) as f64);
                names.push(format!("{} {name}", k + 1));
            }
            let more = names.len().saturating_sub(NAMED);
            names.truncate(NAMED);
            let mut second = if names.is_empty() { count } else { names.join(", ") };
            if more > 0 {
                second += &format!(" and {more} more");
            }
            Coloured { numbers, label: "region".to_owned(), second }
        }
    }
}

/// The mesh as a grid of VTK.
fn whole(mesh: &Mesh) -> (Whole, Vec<usize>) {
    let cells = mesh.cells().map(|cell| {
        let kind = vtk(mesh.kind(cell), mesh.order());
        let nodes = mesh.cell_nodes(cell);
        WholeCell { kind: kind.type_number(), nodes: vtk_order(kind).iter().map(|k| nodes[*k].index()).collect() }
    });
    let whole = Whole { points: mesh.nodes().to_vec(), cells: cells.collect(), ..Whole::default() };
    let all = (0..whole.cells.len()).collect();
    (whole, all)
}

fn vtk(kind: CellKind, order: usize) -> VtkCell {
    let pair = match kind {
        CellKind::Point => [VtkCell::Vertex; 2],
        CellKind::Segment => [VtkCell::Line, VtkCell::QuadraticLine],
        CellKind::Triangle => [VtkCell::Triangle, VtkCell::QuadraticTriangle],
        CellKind::Quadrilateral => [VtkCell::Quad, VtkCell::BiquadraticQuad],
        CellKind::Tetrahedron => [VtkCell::Tetra, VtkCell::QuadraticTetra],
        CellKind::Hexahedron => [VtkCell::Hexahedron, VtkCell::TriquadraticHexahedron],
        CellKind::Wedge => [VtkCell::Wedge, VtkCell::QuadraticWedge],
        CellKind::Pyramid => [VtkCell::Pyramid, VtkCell::QuadraticPyramid],
    };
    pair[order.min(2) - 1]
}

/// The face is seen from outside.
fn is_front(corners: &[[f64; 3]]) -> bool {
    let next = |k: usize| corners[(k + 1) % corners.len()];
    corners.iter().enumerate().map(|(k, a)| a[0] * next(k)[1] - next(k)[0] * a[1]).sum::<f64>() > 0.0
}

fn bounds(faces: &[Face]) -> ([f64; 2], [f64; 2]) {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for corner in faces.iter().flat_map(Face::corners) {
        for d in 0..2 {
            low[d] = low[d].min(corner[d]);
            high[d] = high[d].max(corner[d]);
        }
    }
    (low, high)
}
