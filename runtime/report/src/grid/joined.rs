//! Grids that ranks wrote in parts, joined: cells of one body or interface stand together, and nodes on the borders
//! between the ranks are one again, so that nothing is seen of the borders.
//!
//! Two nodes of different files are one if they have the same place and the same values, bit for bit: the sides of a
//! crack stay apart. Arrays that differ on most of the border (means over the cells of one rank) do not count, unless
//! there are no others. Nodes of one file are never joined.

use std::{collections::BTreeMap, path::Path};

use super::{Part, Raw, Reader, Values};
use crate::folder::{ReportError, bytes, damaged, parts};

/// Reads a grid: what stands in the file, or what stands in the files of its list, joined.
pub(super) fn read(file: &Path) -> Result<Vec<Raw>, ReportError> {
    if file.extension().is_none_or(|e| e != "pvtu") {
        return read_one(file);
    }
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut all = Vec::new();
    for name in parts(file)? {
        all.extend(read_one(&folder.join(name))?);
    }
    join(&all).map(|grid| vec![grid]).ok_or_else(|| damaged(file, "its parts have not the same arrays"))
}

fn read_one(file: &Path) -> Result<Vec<Raw>, ReportError> {
    let all = bytes(file)?;
    let reader = Reader::new(file, &all)?;
    reader.pieces.iter().map(|tags| reader.raw(tags)).collect()
}

/// The cells of one body or interface in one file.
struct Share<'g> {
    grid: &'g Raw,
    part: Part,
}

/// All of it; `None` if the grids have not the same arrays.
fn join(all: &[Raw]) -> Option<Raw> {
    let first = all.first()?;
    let same = |a: &[Values], b: &[Values]| {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.name == b.name && a.width == b.width)
    };
    let fits = |g: &Raw| same(&g.point_data, &first.point_data) && same(&g.cell_data, &first.cell_data);
    if !all.iter().all(fits) {
        return None;
    }
    // numbers of bodies are not negative, so their bits have their order
    let mut shares: BTreeMap<u64, Vec<Share<'_>>> = BTreeMap::new();
    for grid in all {
        for part in grid.parts() {
            shares.entry(grid.part[part.cells.start].to_bits()).or_default().push(Share { grid, part });
        }
    }
    let empty = |data: &[Values]| data.iter().map(Values::empty).collect();
    let mut joined = Raw { point_data: empty(&first.point_data), cell_data: empty(&first.cell_data), ..Raw::default() };
    for (number, shares) in shares {
        add(&mut joined, f64::from_bits(number), &shares);
    }
    Some(joined)
}

/// Adds a body or interface.
fn add(joined: &mut Raw, number: f64, shares: &[Share<'_>]) {
    let same = Border::new(shares).same();
    let mut place: Vec<Vec<usize>> = Vec::with_capacity(shares.len());
    for (k, share) in shares.iter().enumerate() {
        let mut own = Vec::with_capacity(share.part.points.len());
        for node in share.part.points.clone() {
            // the node that it is the same as stands in an earlier file
            let known = same.get(&(k, node)).map(|(k, node)| place[*k][node - shares[*k].part.points.start]);
            own.push(known.unwrap_or(joined.points.len()));
            if known.is_none() {
                joined.points.push(share.grid.points[node]);
                for (all, own) in joined.point_data.iter_mut().zip(&share.grid.point_data) {
                    all.numbers.extend(own.of(&(node..node + 1)));
                }
            }
        }
        place.push(own);
        let places = |nodes: &Vec<usize>| {
            nodes.iter().map(|node| place[k][node - share.part.points.start]).collect::<Vec<usize>>()
        };
        let cells = share.part.cells.clone();
        joined.cells.extend(share.grid.cells[cells.clone()].iter().map(places));
        joined.types.extend(&share.grid.types[cells.clone()]);
        joined.part.extend(cells.clone().map(|_| number));
        for (all, own) in joined.cell_data.iter_mut().zip(&share.grid.cell_data) {
            all.numbers.extend(own.of(&cells));
        }
    }
}

/// A node: the position of its file in the list, and its number there.
type Node = (usize, usize);

/// The places where nodes of several files are.
struct Border<'s> {
    shares: &'s [Share<'s>],
    places: Vec<Vec<Node>>,
}

impl<'s> Border<'s> {
    fn new(shares: &'s [Share<'s>]) -> Self {
        let mut border = Border { shares, places: Vec::new() };
        if shares.len() < 2 {
            return border;
        }
        let of = |(k, s): (usize, &Share<'_>)| s.part.points.clone().map(move |node| (k, node)).collect::<Vec<Node>>();
        let place = |(k, node): &Node| shares[*k].grid.points[*node].map(f64::to_bits);
        let mut nodes: Vec<Node> = shares.iter().enumerate().flat_map(of).collect();
        nodes.sort_by_key(|node| (place(node), *node));
        let places = nodes.chunk_by(|a, b| place(a) == place(b));
        border.places = places.filter(|p| p.iter().any(|n| n.0 != p[0].0)).map(<[Node]>::to_vec).collect();
        border
    }

    /// The entry of an array at a node.
    fn entry(&self, array: usize, node: Node) -> &[f64] {
        self.shares[node.0].grid.point_data[array].of(&(node.1..node.1 + 1))
    }

    fn bits(&self, array: usize, node: Node) -> impl Iterator<Item = u64> {
        self.entry(array, node).iter().map(|x| x.to_bits())
    }

    /// Whether each file at a place has a node at which an array has an entry of the first file.
    fn agrees(&self, array: usize, place: &[Node]) -> bool {
        let same = |a: Node, b: Node| self.bits(array, a).eq(self.bits(array, b));
        let mut files = place.chunk_by(|a, b| a.0 == b.0);
        let first = files.next().unwrap_or_default();
        files.all(|own| own.iter().any(|b| first.iter().any(|a| same(*a, *b))))
    }

    /// The arrays whose values tell which nodes are the same: those that are here at all and agree at half of the places
    /// or more; all that are here, if none does.
    fn telling(&self) -> Vec<usize> {
        let n_arrays = self.shares.first().map_or(0, |s| s.grid.point_data.len());
        let nodes = || self.places.iter().flatten();
        let here: Vec<usize> =
            (0..n_arrays).filter(|a| nodes().any(|n| self.entry(*a, *n).iter().any(|x| !x.is_nan()))).collect();
        let often = |a: &usize| 2 * self.places.iter().filter(|p| self.agrees(*a, p)).count() >= self.places.len();
        let most: Vec<usize> = here.iter().copied().filter(often).collect();
        if most.is_empty() { here } else { most }
    }

    /// Nodes that are the same as one of an earlier file, with that one. Of several nodes of a file with the same place
    /// and values the first is the same as the first of another file, and so on.
    fn same(&self) -> BTreeMap<Node, Node> {
        let telling = self.telling();
        let mut same = BTreeMap::new();
        for place in &self.places {
            let mut known: BTreeMap<(Vec<u64>, usize), Node> = BTreeMap::new();
            for own in place.chunk_by(|a, b| a.0 == b.0) {
                let mut seen: BTreeMap<Vec<u64>, usize> = BTreeMap::new();
                for node in own {
                    let values: Vec<u64> = telling.iter().flat_map(|a| self.bits(*a, *node)).collect();
                    let count = seen.entry(values.clone()).or_default();
                    match known.get(&(values.clone(), *count)) {
                        Some(first) => drop(same.insert(*node, *first)),
                        None => drop(known.insert((values, *count), *node)),
                    }
                    *count += 1;
                }
            }
        }
        same
    }
}

#[cfg(test)]
#[path = "joined_tests.rs"]
mod tests;
