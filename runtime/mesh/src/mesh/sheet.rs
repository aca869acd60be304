//! Sheets: the connected parts of a surface with two sides, their orientation and their fronts.
//!
//! Promises: a sheet is connected through ridges (edges of faces in three dimensions, vertices in two) that exactly two
//! of its faces share, and `here` lies on one side of all of it. Where three or more faces share a ridge, the surface is
//! divided into sheets. Sheets are in the order of their first faces; nothing depends on the order of the input. Does
//! not know names or the language, and never splits anything.

use std::collections::BTreeSet;

use super::{
    Mesh,
    index::{CellId, FacetId, FacetRef, InterfaceFacet, NodeId},
    quality::{facet_measures, facet_vectors, turns_left},
    region::sorted,
    topology::Topology,
};
use crate::vector::{difference, dot, norm};

/// A vector below this part of what it is the sum of is the rounding of that sum: coordinates of mesh files often have
/// no more digits.
const ROUNDED: f64 = 1e-6;

/// A connected, oriented part of a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// Its faces, sorted; the normal of each points out of the cell of `here`.
    pub facets: Vec<InterfaceFacet>,
    /// Area (length in two dimensions).
    pub area: f64,
    /// Integral of the unit normal over the area: of length 1 where the sheet is plane, 0 where it is closed.
    pub mean_normal: [f64; 3],
}

/// Why a surface has no two sides.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SheetError {
    /// Faces of the outer boundary.
    #[error("{facets} of {total} faces have a cell on one side only, the first at {}", coordinates(at))]
    OneSided {
        /// Number of such faces.
        facets: usize,
        /// Number of all faces.
        total: usize,
        /// Centroid of the first of them.
        at: [f64; 3],
    },
    /// A way round the surface leads from one of its sides to the other.
    #[error(
        "no side of this surface is the same all over: at {} both sides meet, as on a Moebius strip",
        coordinates(at)
    )]
    OneSide {
        /// Middle of a ridge where the sides meet.
        at: [f64; 3],
    },
    /// The direction that should choose a side lies along the sheet.
    #[error("this direction chooses no side of the sheet at {}: it lies along the sheet on average", coordinates(at))]
    Along {
        /// Centroid of the first face of the sheet.
        at: [f64; 3],
    },
}

/// `(1, 0.5, 0)`, with six digits.
fn coordinates(at: &[f64; 3]) -> String {
    let short = |x: &f64| format!("{x:.5e}").parse::<f64>().unwrap_or(*x).to_string();
    format!("({})", at.iter().map(short).collect::<Vec<_>>().join(", "))
}

/// Both sides of `facets`, each once however often it is given: `here` is the cell of lower number.
///
/// # Errors
/// [`SheetError::OneSided`] where a face lies on the outer boundary.
pub fn both_sides(mesh: &Mesh, topology: &Topology, facets: &[FacetRef]) -> Result<Vec<InterfaceFacet>, SheetError> {
    let ids = sorted(facets.iter().map(|f| topology.facet_id(*f)).collect());
    let one_sided: Vec<FacetId> = ids.iter().copied().filter(|id| topology.facet(*id).there.is_none()).collect();
    if let Some(first) = one_sided.first() {
        let at = mesh.facet_centroid(topology.facet(*first).here);
        return Err(SheetError::OneSided { facets: one_sided.len(), total: ids.len(), at });
    }
    let pair = |id: &FacetId| {
        let facet = topology.facet(*id);
        Some(InterfaceFacet { here: facet.here, there: facet.there? })
    };
    Ok(sorted(ids.iter().filter_map(pair).collect()))
}

/// The sheets of a surface, each turned to one side.
///
/// Without `towards` the side depends on the shape alone: the largest component of the mean normal is positive (the
/// first of equal ones); of a closed sheet, whose mean normal is zero, normals point out of the enclosed volume. With
/// `towards`, values of a direction by position, the integral of its scalar product with the normal is positive.
///
/// # Errors
/// [`SheetError::OneSide`] for a sheet that cannot be oriented, [`SheetError::Along`] for a `towards` that chooses no
/// side.
pub fn oriented_sheets(
    mesh: &Mesh,
    surface: &[InterfaceFacet],
    towards: Option<&dyn Fn([f64; 3]) -> [f64; 3]>,
) -> Result<Vec<Sheet>, SheetError> {
    let ridges = Ridges::new(mesh, surface);
    let mut sheets = Vec::new();
    for part in &ridges.parts {
        if let Some(at) = ridges.conflict(mesh, part) {
            return Err(SheetError::OneSide { at });
        }
        let turned = |face: &usize| match ridges.turned[*face] {
            true => InterfaceFacet { here: surface[*face].there, there: surface[*face].here },
            false => surface[*face],
        };
        let mut sheet = Sheet::new(mesh, part.iter().map(turned).collect());
        if !sheet.faces(mesh, towards)? {
            sheet.turn();
        }
        sheets.push(sheet);
    }
    Ok(sheets)
}

/// The connected parts of an interface whose sides are given. A part with mixed sides (several interfaces in one region)
/// is told as two sheets, one of each orientation.
#[must_use]
pub fn sheets_of(mesh: &Mesh, interface: &[InterfaceFacet]) -> Vec<Sheet> {
    let ridges = Ridges::new(mesh, interface);
    let mut sheets = Vec::new();
    for part in &ridges.parts {
        for side in [false, true] {
            let half = part.iter().filter(|face| ridges.turned[**face] == side).map(|face| interface[*face]);
            let half: Vec<InterfaceFacet> = half.collect();
            if !half.is_empty() {
                sheets.push(Sheet::new(mesh, half));
            }
        }
    }
    sheets
}

/// Vertices of `facets` around which the cells hang together although the faces `cut` are taken away: fields that are
/// split along `cut` keep one value there.
#[must_use]
pub fn front_nodes(
    mesh: &Mesh,
    topology: &Topology,
    facets: &[InterfaceFacet],
    cut: &BTreeSet<FacetId>,
) -> BTreeSet<NodeId> {
    let vertices = facets.iter().flat_map(|f| mesh.facet_vertices(f.here).vertices().to_vec());
    let vertices: Vec<NodeId> = sorted(vertices.collect());
    let mut around: Vec<Vec<CellId>> = vec![Vec::new(); vertices.len()];
    for cell in mesh.cells() {
        for vertex in mesh.cell_vertices(cell) {
            if let Ok(place) = vertices.binary_search(vertex) {
                around[place].push(cell);
            }
        }
    }
    let joined = |cells: &Vec<CellId>| n_sectors(topology, cells, cut) == 1;
    vertices.iter().zip(&around).filter(|(_, cells)| joined(cells)).map(|(vertex, _)| *vertex).collect()
}

/// Number of groups of `cells` that hang together through faces that are not cut.
fn n_sectors(topology: &Topology, cells: &[CellId], cut: &BTreeSet<FacetId>) -> usize {
    let mut open: BTreeSet<CellId> = cells.iter().copied().collect();
    let mut sectors = 0;
    while let Some(first) = open.pop_first() {
        sectors += 1;
        let mut next = vec![first];
        while let Some(cell) = next.pop() {
            for id in topology.cell_facets(cell).iter().filter(|id| !cut.contains(id)) {
                let facet = topology.facet(*id);
                let sides = [Some(facet.here), facet.there];
                for beyond in sides.into_iter().flatten().map(|f| f.cell) {
                    if open.remove(&beyond) {
                        next.push(beyond);
                    }
                }
            }
        }
    }
    sectors
}

impl Sheet {
    fn new(mesh: &Mesh, facets: Vec<InterfaceFacet>) -> Self {
        let facets = sorted(facets);
        let here: Vec<FacetRef> = facets.iter().map(|f| f.here).collect();
        let area = facet_measures(mesh, &here).iter().sum();
        let mut mean_normal = [0.0; 3];
        for vector in facet_vectors(mesh, &here) {
            for (sum, part) in mean_normal.iter_mut().zip(vector) {
                *sum += part / area;
            }
        }
        Self { facets, area, mean_normal }
    }

    /// Swaps the sides.
    fn turn(&mut self) {
        let turned = self.facets.iter().map(|f| InterfaceFacet { here: f.there, there: f.here });
        self.facets = sorted(turned.collect());
        self.mean_normal = self.mean_normal.map(|c| -c);
    }

    /// Scalar product of a direction with the normal over the sheet, and its bound.
    fn flux(&self, mesh: &Mesh, direction: &dyn Fn([f64; 3]) -> [f64; 3]) -> (f64, f64) {
        let here: Vec<FacetRef> = self.facets.iter().map(|f| f.here).collect();
        let (mut flux, mut bound) = (0.0, 0.0);
        for (facet, vector) in here.iter().zip(facet_vectors(mesh, &here)) {
            let direction = direction(mesh.facet_centroid(*facet));
            flux += dot(direction, vector);
            bound += norm(direction) * norm(vector);
        }
        (flux, bound)
    }

    /// True if `here` is the side that is asked for.
    fn faces(&self, mesh: &Mesh, towards: Option<&dyn Fn([f64; 3]) -> [f64; 3]>) -> Result<bool, SheetError> {
        let first = mesh.facet_centroid(self.facets[0].here);
        if let Some(direction) = towards {
            let (flux, bound) = self.flux(mesh, direction);
            // a direction of length zero chooses no side either
            if flux.abs() <= ROUNDED * bound {
                return Err(SheetError::Along { at: first });
            }
            return Ok(flux > 0.0);
        }
        if norm(self.mean_normal) > ROUNDED {
            let largest = self.mean_normal.iter().fold(0.0, |m: f64, c| m.max(c.abs()));
            let first_largest = self.mean_normal.iter().find(|c| c.abs() >= (1.0 - ROUNDED) * largest);
            return Ok(first_largest.is_none_or(|c| *c > 0.0));
        }
        let (flux, bound) = self.flux(mesh, &|x| difference(x, first));
        Ok(flux >= -ROUNDED * bound)
    }
}

/// A ridge as one face goes round it.
struct HalfRidge {
    /// Its vertices, ascending; of one vertex the second is `u32::MAX`.
    key: [u32; 2],
    face: usize,
    /// The face, seen from outside its cell `here`, passes the ridge in the direction of its vertices (starts at it).
    forward: bool,
}

/// A way from one face to another through a ridge that is theirs alone.
#[derive(Clone, Copy)]
struct Link {
    beyond: usize,
    /// `here` of both is on one side.
    agree: bool,
    key: [u32; 2],
}

/// The connected parts of a surface. Faces are named by their place in it.
struct Ridges {
    /// By face.
    links: Vec<Vec<Link>>,
    /// The faces of each part, its first one first.
    parts: Vec<Vec<usize>>,
    /// By face: its sides have to be swapped to agree with those of the first face of its part.
    turned: Vec<bool>,
}

impl Ridges {
    fn new(mesh: &Mesh, surface: &[InterfaceFacet]) -> Self {
        let mut halves: Vec<HalfRidge> =
            surface.iter().enumerate().flat_map(|(face, pair)| half_ridges(mesh, face, pair.here)).collect();
        halves.sort_by_key(|h| (h.key, h.face));
        let mut links = vec![Vec::new(); surface.len()];
        for same in halves.chunk_by(|a, b| a.key == b.key) {
            if let [a, b] = same {
                // two neighbours on one side pass their common edge in opposite directions
                let agree = a.forward != b.forward;
                links[a.face].push(Link { beyond: b.face, agree, key: a.key });
                links[b.face].push(Link { beyond: a.face, agree, key: a.key });
            }
        }
        let mut ridges = Self { parts: Vec::new(), turned: vec![false; links.len()], links };
        ridges.flood();
        ridges
    }

    fn flood(&mut self) {
        let mut seen = vec![false; self.links.len()];
        for first in 0..self.links.len() {
            if seen[first] {
                continue;
            }
            seen[first] = true;
            let mut part = vec![first];
            let mut next = 0;
            while let Some(face) = part.get(next).copied() {
                next += 1;
                for link in &self.links[face] {
                    if !seen[link.beyond] {
                        seen[link.beyond] = true;
                        self.turned[link.beyond] = if link.agree { self.turned[face] } else { !self.turned[face] };
                        part.push(link.beyond);
                    }
                }
            }
            self.parts.push(part);
        }
    }

    /// The middle of the first ridge at which the sides of a part do not agree.
    fn conflict(&self, mesh: &Mesh, part: &[usize]) -> Option<[f64; 3]> {
        let mut all = part.iter().flat_map(|face| self.links[*face].iter().map(move |link| (*face, link)));
        let differs = |face: usize, link: &Link| (self.turned[face] == self.turned[link.beyond]) != link.agree;
        let (_, link) = all.find(|(face, link)| differs(*face, link))?;
        let ends = link.key.iter().filter(|v| **v != u32::MAX).map(|v| mesh.node(NodeId::new(*v as usize)));
        let ends: Vec<[f64; 3]> = ends.collect();
        Some(std::array::from_fn(|i| ends.iter().map(|x| x[i]).sum::<f64>() / ends.len() as f64))
    }
}

/// The ridges of a face as it goes round them, seen from outside its cell.
fn half_ridges(mesh: &Mesh, face: usize, here: FacetRef) -> Vec<HalfRidge> {
    let vertices = mesh.facet_vertices(here);
    let mut round: Vec<u32> = vertices.vertices().iter().map(|v| v.index() as u32).collect();
    if round.len() == 4 {
        // a quadrilateral lists its vertices line by line
        round.swap(2, 3);
    }
    if !turns_left(mesh, here) {
        round.reverse();
    }
    match round.as_slice() {
        [start, end] => {
            let half = |vertex: u32, forward| HalfRidge { key: [vertex, u32::MAX], face, forward };
            vec![half(*start, true), half(*end, false)]
        }
        [_] | [] => Vec::new(),
        _ => {
            let ends = round.iter().zip(round.iter().cycle().skip(1));
            let half = |(a, b): (&u32, &u32)| HalfRidge { key: [*a.min(b), *a.max(b)], face, forward: a < b };
            ends.map(half).collect()
        }
    }
}

#[cfg(test)]
mod tests;
