//! Input files of Abaqus and CalculiX (`.inp`): nodes, elements, sets and surfaces.
//!
//! A deck is flat, or has parts and instances of them at their places. Element sets become groups of cells, node sets
//! groups of nodes, surfaces groups of facets (element types and numbers of faces: G. Dhondt, CalculiX CrunchiX User's
//! Manual, 6.2 and 7). Elements of lower dimension are the facets of their sets, as in files that mesh generators write.
//! Files that a deck includes are read with it. What stands in steps, and keywords that say nothing of the mesh (materials,
//! contact), is left out, as are elements without a shape (springs, masses). What generates nodes is refused.

mod deck;
mod element;
mod pairs;
mod text;

use std::collections::{BTreeMap, BTreeSet};

use deck::{Chosen, Deck, Instance, Member, Part, Set, Surface};
use element::Shape;
pub use pairs::{DeckNotes, DeckPair, deck_notes};
use text::Text;

use super::{
    Beside,
    error::{Place, ReadError},
    gmsh::{Block, Contents, find_type},
};
use crate::mesh::raw::RawMesh;

/// Gmsh's number of a point, and of facets by their corners.
const POINT: i64 = 15;
const FACETS: [i64; 5] = [0, POINT, 1, 2, 3];

/// True for a file whose first line with content is a keyword or a comment of such a deck.
pub(super) fn recognises(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(4096)];
    let line = start.split(|b| *b == b'\n').map(<[u8]>::trim_ascii).find(|line| !line.is_empty());
    line.is_some_and(|line| {
        line.starts_with(b"**") || line.starts_with(b"*") && line.get(1).is_some_and(u8::is_ascii_alphabetic)
    })
}

/// The mesh of a file, and of the files that it includes.
pub(super) fn parse(bytes: &[u8], beside: &mut Beside<'_>) -> Result<RawMesh, ReadError> {
    let text = text::read(bytes, beside)?;
    mesh(&text).map_err(|error| Text::placed(text.files(), error))
}

fn mesh(text: &Text) -> Result<RawMesh, ReadError> {
    let mut deck = Deck::new(&text.sections)?;
    let mut maker = Maker::default();
    let outside = std::mem::take(&mut deck.outside);
    if deck.instances.is_empty() {
        // without an assembly every part stands once, where it is
        let alone = |part: &Part| Instance::of(part);
        deck.instances = deck.parts.iter().map(alone).collect();
    }
    let several = deck.instances.len() > 1;
    for instance in &deck.instances {
        let part = deck.parts.iter().find(|p| p.name.eq_ignore_ascii_case(&instance.part));
        let part =
            part.ok_or_else(|| ReadError::deck(instance.line, format!("there is no part `{}`", instance.part)))?;
        let offset = maker.highest();
        maker.place(part, instance, offset);
        let prefix = if several { format!("{}_", instance.name) } else { String::new() };
        maker.scopes.insert(instance.name.to_uppercase(), Scope { offset, ..Scope::default() });
        maker.sets(part, &instance.name.to_uppercase(), &prefix)?;
    }
    maker.place(&outside, &Instance::of(&outside), [0, 0]);
    maker.scopes.insert(String::new(), Scope::default());
    maker.sets(&outside, "", "")?;
    if maker.elements.is_empty() {
        return Err(ReadError::deck(1, "there is no *ELEMENT with data in the file"));
    }
    maker.into_contents()?.into_raw()
}

/// What names and numbers mean in a part, or outside of parts.
#[derive(Clone, Default)]
struct Scope {
    /// What is added to numbers of nodes and of elements.
    offset: [u64; 2],
    /// Sets of nodes and of elements by their names in capitals.
    sets: [BTreeMap<String, BTreeSet<u64>>; 2],
}

/// An element with the number that it has in the whole mesh.
struct Element {
    number: u64,
    shape: Shape,
    /// In the order of the file.
    nodes: Vec<u64>,
    groups: BTreeSet<i64>,
}

impl Element {
    /// Corners of the faces that a surface takes.
    fn chosen(&self, chosen: Chosen, line: usize) -> Result<Vec<Vec<u64>>, ReadError> {
        let faces = self.shape.faces();
        let missing = |what: &str| ReadError::deck(line, format!("element {} has no {what}", self.number));
        let places = match chosen {
            Chosen::Outer => faces.to_vec(),
            Chosen::Face(face) => vec![*faces.get(face - 1).ok_or_else(|| missing(&format!("face S{face}")))?],
            Chosen::Itself => vec![self.shape.side().ok_or_else(|| missing("sides: it is no shell"))?],
        };
        Ok(places.iter().map(|places| places.iter().map(|k| self.nodes[*k]).collect()).collect())
    }
}

/// An element as Gmsh lists it.
struct Listed {
    code: i64,
    number: u64,
    nodes: Vec<u64>,
}

/// The mesh while it is put together.
#[derive(Default)]
struct Maker {
    nodes: Vec<(u64, [f64; 3])>,
    elements: Vec<Element>,
    /// The numbers of nodes and of elements.
    known: [BTreeSet<u64>; 2],
    /// By the name of the instance in capitals; that outside of parts has none.
    scopes: BTreeMap<String, Scope>,
    /// Names of groups; the tag is the place.
    names: Vec<String>,
    /// Facets by their corners, and nodes, with the group they belong to.
    facets: Vec<(u64, Vec<u64>, i64)>,
    points: Vec<(u64, i64)>,
}

impl Maker {
    /// The highest numbers of nodes and elements so far.
    fn highest(&self) -> [u64; 2] {
        [0, 1].map(|kind| self.known[kind].last().copied().unwrap_or(0))
    }

    fn place(&mut self, part: &Part, at: &Instance, offset: [u64; 2]) {
        self.known[0].extend(part.nodes.iter().map(|n| n.0 + offset[0]));
        self.known[1].extend(part.elements.iter().map(|e| e.number + offset[1]));
        self.nodes.extend(part.nodes.iter().map(|(n, x)| (n + offset[0], at.placed(*x))));
        self.elements.extend(part.elements.iter().map(|e| Element {
            number: e.number + offset[1],
            shape: e.shape,
            nodes: e.nodes.iter().map(|n| n + offset[0]).collect(),
            groups: BTreeSet::new(),
        }));
    }

    /// The sets and surfaces of a part, or of what is outside of parts, in the scope of this name.
    fn sets(&mut self, part: &Part, scope: &str, prefix: &str) -> Result<(), ReadError> {
        for (kind, list) in [&part.node_sets, &part.element_sets].into_iter().enumerate() {
            let mut order: Vec<&str> = Vec::new();
            for set in list {
                let members = self.members(set, scope, kind)?;
                let own = self.scopes.entry(scope.to_owned()).or_default();
                own.sets[kind].entry(set.name.to_uppercase()).or_default().extend(members);
                // a set may be given in several pieces
                if !order.iter().any(|name| name.eq_ignore_ascii_case(&set.name)) {
                    order.push(&set.name);
                }
            }
            for name in order {
                let members = self.scopes[scope].sets[kind][&name.to_uppercase()].clone();
                let tag = self.group(format!("{prefix}{name}"));
                if kind == 0 {
                    self.points.extend(members.into_iter().map(|node| (node, tag)));
                } else {
                    self.mark(&members, tag);
                }
            }
        }
        for surface in &part.surfaces {
            self.surface(surface, scope, prefix)?;
        }
        Ok(())
    }

    fn group(&mut self, name: String) -> i64 {
        self.names.push(name);
        i64::try_from(self.names.len()).unwrap_or(i64::MAX)
    }

    fn mark(&mut self, members: &BTreeSet<u64>, tag: i64) {
        for element in self.elements.iter_mut().filter(|e| members.contains(&e.number)) {
            element.groups.insert(tag);
        }
    }

    /// The numbers of a set in the whole mesh.
    fn members(&self, set: &Set, scope: &str, kind: usize) -> Result<BTreeSet<u64>, ReadError> {
        let scope = set.instance.as_ref().map_or_else(|| scope.to_owned(), |name| name.to_uppercase());
        let mut found = BTreeSet::new();
        for member in &set.members {
            found.extend(self.numbers(member, &scope, kind, set.line)?);
        }
        Ok(found)
    }

    fn numbers(&self, member: &Member, scope: &str, kind: usize, line: usize) -> Result<Vec<u64>, ReadError> {
        let own =
            self.scopes.get(scope).ok_or_else(|| ReadError::deck(line, format!("there is no instance `{scope}`")))?;
        let add = own.offset[kind];
        Ok(match member {
            Member::Number(number) => vec![number + add],
            // numbers that no node or element has are none of a set
            Member::Range([from, to, by]) => {
                let there = self.known[kind].range(from + add..=to + add);
                there.copied().filter(|number| (number - from - add) % by == 0).collect()
            }
            Member::Set(name) => {
                let (scope, word) = name.rsplit_once('.').unwrap_or((scope, name));
                let sets = self.scopes.get(&scope.to_uppercase()).map(|s| &s.sets[kind]);
                let found = sets.and_then(|sets| sets.get(&word.to_uppercase()));
                let missing =
                    || ReadError::deck(line, format!("there is no set `{name}` of {}s", ["node", "element"][kind]));
                found.ok_or_else(missing)?.iter().copied().collect()
            }
        })
    }

    fn surface(&mut self, surface: &Surface, scope: &str, prefix: &str) -> Result<(), ReadError> {
        let tag = self.group(format!("{prefix}{}", surface.name));
        let any_outer = !surface.of_nodes && surface.items.iter().any(|(_, chosen)| *chosen == Chosen::Outer);
        let outer = if any_outer { self.outer() } else { BTreeMap::new() };
        for (member, chosen) in &surface.items {
            let kind = usize::from(!surface.of_nodes);
            let numbers: BTreeSet<u64> = self.numbers(member, scope, kind, surface.line)?.into_iter().collect();
            if surface.of_nodes {
                self.points.extend(numbers.into_iter().map(|node| (node, tag)));
                continue;
            }
            let mut found = Vec::new();
            for element in self.elements.iter().filter(|e| numbers.contains(&e.number)) {
                for corners in element.chosen(*chosen, surface.line)? {
                    if *chosen != Chosen::Outer || outer.get(&key(&corners)) == Some(&1) {
                        found.push((element.number, corners, tag));
                    }
                }
            }
            self.facets.extend(found);
        }
        Ok(())
    }

    /// How many elements have a face.
    fn outer(&self) -> BTreeMap<Vec<u64>, usize> {
        let mut count = BTreeMap::new();
        for element in &self.elements {
            for corners in element.shape.faces() {
                let corners: Vec<u64> = corners.iter().map(|k| element.nodes[*k]).collect();
                *count.entry(key(&corners)).or_insert(0) += 1;
            }
        }
        count
    }

    /// What a file of Gmsh would hold.
    fn into_contents(self) -> Result<Contents, ReadError> {
        let positions: BTreeMap<u64, [f64; 3]> = self.nodes.iter().copied().collect();
        let mut contents = Contents::default();
        contents.name_groups(&self.names);
        for element in &self.elements {
            let nodes = ordered(element, &positions);
            let groups: Vec<i64> = element.groups.iter().copied().collect();
            add(&mut contents, Listed { code: element.shape.code(), number: element.number, nodes }, groups)?;
        }
        for (number, nodes, tag) in self.facets {
            add(&mut contents, Listed { code: FACETS[nodes.len()], number, nodes }, vec![tag])?;
        }
        for (node, tag) in self.points.into_iter().filter(|(node, _)| positions.contains_key(node)) {
            add(&mut contents, Listed { code: POINT, number: node, nodes: vec![node] }, vec![tag])?;
        }
        (contents.node_numbers, contents.nodes) = self.nodes.into_iter().unzip();
        Ok(contents)
    }
}

/// The same for a face whichever way it runs.
fn key(corners: &[u64]) -> Vec<u64> {
    let mut key = corners.to_vec();
    key.sort_unstable();
    key
}

/// Nodes in Gmsh's order. Of a line of second order the middle is the node between the others: programs differ there.
fn ordered(element: &Element, positions: &BTreeMap<u64, [f64; 3]>) -> Vec<u64> {
    let mut nodes = element.shape.in_order(&element.nodes);
    if element.shape == Shape::Segment(2) {
        let at = |k: usize| positions.get(&element.nodes[k]).copied().unwrap_or_default();
        let off = |k: usize| {
            let [a, b] = [(k + 1) % 3, (k + 2) % 3].map(at);
            (0..3).map(|d| (at(k)[d] - 0.5 * (a[d] + b[d])).powi(2)).sum::<f64>()
        };
        let middle = (0..3).min_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap_or(2);
        nodes.swap(middle, 2);
    }
    nodes
}

/// Adds an element to the last block if that is of its kind and groups.
fn add(contents: &mut Contents, element: Listed, groups: Vec<i64>) -> Result<(), ReadError> {
    let Listed { code, number: element, nodes } = element;
    let element_type = find_type(code, element, || Place::Line(0))?;
    match contents.blocks.last_mut().filter(|b| b.element_type == element_type && b.groups == groups) {
        Some(block) => {
            block.elements.push(element);
            block.nodes.extend(nodes);
        }
        None => contents.blocks.push(Block { element_type, groups, elements: vec![element], nodes }),
    }
    Ok(())
}

impl Instance {
    /// A part where it is.
    fn of(part: &Part) -> Self {
        Instance { name: part.name.clone(), part: part.name.clone(), shift: [0.0; 3], turn: None, line: 0 }
    }

    /// A point of the part at its place: shifted, then turned about the axis (Rodrigues' formula).
    fn placed(&self, x: [f64; 3]) -> [f64; 3] {
        let x: [f64; 3] = std::array::from_fn(|d| x[d] + self.shift[d]);
        let Some([a, b, c, u, v, w, degrees]) = self.turn else { return x };
        let (start, end) = ([a, b, c], [u, v, w]);
        let axis: [f64; 3] = std::array::from_fn(|d| end[d] - start[d]);
        let length = axis.iter().map(|k| k * k).sum::<f64>().sqrt();
        let k: [f64; 3] = axis.map(|v| if length > 0.0 { v / length } else { 0.0 });
        let r: [f64; 3] = std::array::from_fn(|d| x[d] - start[d]);
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let along = (0..3).map(|d| k[d] * r[d]).sum::<f64>() * (1.0 - cosine);
        std::array::from_fn(|d| {
            let (i, j) = ((d + 1) % 3, (d + 2) % 3);
            start[d] + cosine * r[d] + sine * (k[i] * r[j] - k[j] * r[i]) + along * k[d]
        })
    }
}

#[cfg(test)]
mod tests;
