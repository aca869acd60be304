//! What the keywords of an input file say of parts, instances and sets.

use super::{
    element::{Shape, bodiless, shape},
    text::Section,
};
use crate::mesh::read::error::{Place, ReadError};

/// A member of a set.
pub(super) enum Member {
    Number(u64),
    /// From, to, by.
    Range([u64; 3]),
    /// Another set.
    Set(String),
}

/// A set of nodes or elements.
pub(super) struct Set {
    pub(super) name: String,
    pub(super) members: Vec<Member>,
    /// The instance whose numbers they are, in the assembly.
    pub(super) instance: Option<String>,
    pub(super) line: usize,
}

/// What a surface takes of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Chosen {
    /// All faces that no other element has.
    Outer,
    /// A face, counted from 1.
    Face(usize),
    /// The element itself, of a shell: one side of it.
    Itself,
}

/// Faces of elements, or nodes.
pub(super) struct Surface {
    pub(super) name: String,
    pub(super) of_nodes: bool,
    pub(super) items: Vec<(Member, Chosen)>,
    pub(super) line: usize,
}

/// An element as it is read.
pub(super) struct Element {
    pub(super) number: u64,
    pub(super) shape: Shape,
    pub(super) nodes: Vec<u64>,
}

/// What a deck says of one mesh: a part, the assembly, or all of it.
#[derive(Default)]
pub(super) struct Part {
    pub(super) name: String,
    pub(super) nodes: Vec<(u64, [f64; 3])>,
    pub(super) elements: Vec<Element>,
    pub(super) node_sets: Vec<Set>,
    pub(super) element_sets: Vec<Set>,
    pub(super) surfaces: Vec<Surface>,
}

/// A part at its place.
pub(super) struct Instance {
    pub(super) name: String,
    pub(super) part: String,
    pub(super) shift: [f64; 3],
    /// Two points of an axis, and an angle in degrees; after the shift.
    pub(super) turn: Option<[f64; 7]>,
    pub(super) line: usize,
}

/// All of a file.
#[derive(Default)]
pub(super) struct Deck {
    pub(super) parts: Vec<Part>,
    pub(super) instances: Vec<Instance>,
    /// What stands outside of parts: all of a flat deck; sets and surfaces of an assembly.
    pub(super) outside: Part,
}

/// Numbers of nodes and elements are below this: a hundred thousand times what the programs take, and instances can be
/// counted on without an overflow.
const NUMBERS: u64 = 100_000_000_000_000;

/// The number of a node or an element.
fn entity_number(line: usize, word: &str, what: &str) -> Result<u64, ReadError> {
    let found = number::<u64>(line, word, what)?;
    if found < NUMBERS { Ok(found) } else { Err(ReadError::deck(line, format!("found `{word}`, needed {what}"))) }
}

fn number<T: std::str::FromStr>(line: usize, word: &str, what: &str) -> Result<T, ReadError> {
    // numbers may be written as 1.5D0
    let plain = word.replace(['d', 'D'], "e");
    plain.parse().map_err(|_| ReadError::deck(line, format!("found `{word}`, needed {what}")))
}

impl Deck {
    pub(super) fn new(sections: &[Section]) -> Result<Self, ReadError> {
        let mut deck = Self::default();
        let mut part: Option<Part> = None;
        for section in sections {
            match section.keyword.as_str() {
                "PART" => part = Some(Part { name: section.needs("NAME")?, ..Part::default() }),
                "END PART" => deck.parts.extend(part.take()),
                "INSTANCE" => deck.instances.push(instance(section)?),
                "STEP" => break,
                _ => {
                    let own = part.as_mut().unwrap_or(&mut deck.outside);
                    own.add(section)?;
                }
            }
        }
        deck.parts.extend(part);
        Ok(deck)
    }
}

fn instance(section: &Section) -> Result<Instance, ReadError> {
    let (name, part) = (section.needs("NAME")?, section.needs("PART")?);
    let numbers = |k: usize| -> Result<Vec<f64>, ReadError> {
        let Some((line, words)) = section.data.get(k) else { return Ok(Vec::new()) };
        words.iter().map(|word| number(*line, word, "a number of the place of an instance")).collect()
    };
    // the first line moves, the second one turns
    let shift = match numbers(0)?.as_slice() {
        [] => [0.0; 3],
        [x, y] => [*x, *y, 0.0],
        [x, y, z] => [*x, *y, *z],
        _ => return Err(ReadError::deck(section.line, "a place of an instance has two or three numbers")),
    };
    let axis = numbers(1)?;
    let two_points = |_| ReadError::deck(section.line, "a rotation has two points and an angle");
    let turn = if axis.is_empty() { None } else { Some(axis.try_into().map_err(two_points)?) };
    Ok(Instance { name, part, shift, turn, line: section.line })
}

impl Part {
    fn add(&mut self, section: &Section) -> Result<(), ReadError> {
        match section.keyword.as_str() {
            "NODE" => self.nodes(section),
            "ELEMENT" => self.elements(section),
            "NSET" => {
                self.node_sets.push(set(section, section.needs("NSET")?)?);
                Ok(())
            }
            "ELSET" => {
                self.element_sets.push(set(section, section.needs("ELSET")?)?);
                Ok(())
            }
            "SURFACE" => self.surface(section),
            word @ ("NGEN" | "NFILL" | "NCOPY" | "NMAP" | "ELGEN" | "ELCOPY" | "SYSTEM") => {
                let what =
                    format!("*{word} is not followed: write all nodes and elements with their numbers and positions");
                Err(ReadError::deck(section.line, what))
            }
            _ => Ok(()),
        }
    }

    fn nodes(&mut self, section: &Section) -> Result<(), ReadError> {
        if section.value("SYSTEM").is_some_and(|v| !v.eq_ignore_ascii_case("R")) {
            let what = "*NODE with SYSTEM= is not read: write positions in x, y, z";
            return Err(ReadError::deck(section.line, what));
        }
        let first = self.nodes.len();
        for (line, words) in &section.data {
            let [node, rest @ ..] = words.as_slice() else { continue };
            let node = entity_number(*line, node, "the number of a node")?;
            let mut x = [0.0f64; 3];
            for (slot, word) in x.iter_mut().zip(rest.iter().filter(|w| !w.is_empty())) {
                *slot = number(*line, word, "a coordinate")?;
                if !slot.is_finite() {
                    return Err(ReadError::NonFinite { node, value: *slot, place: Place::Line(*line) });
                }
            }
            self.nodes.push((node, x));
        }
        if let Some(name) = section.value("NSET") {
            let members = self.nodes[first..].iter().map(|n| Member::Number(n.0)).collect();
            self.node_sets.push(Set { name: name.to_owned(), members, instance: None, line: section.line });
        }
        Ok(())
    }

    fn elements(&mut self, section: &Section) -> Result<(), ReadError> {
        let kind = section.needs("TYPE")?;
        let first = self.elements.len();
        // springs, masses and the like are no cells; their set may be named all the same
        let data = if bodiless(&kind) { &[] } else { section.data.as_slice() };
        let mut open: Option<Element> = None;
        for (line, words) in data {
            let mut words = words.iter().filter(|w| !w.is_empty());
            let mut element = match open.take() {
                Some(element) => element,
                None => {
                    let Some(word) = words.next() else { continue };
                    let number = entity_number(*line, word, "the number of an element")?;
                    Element { number, shape: shape(&kind, number, *line)?, nodes: Vec::new() }
                }
            };
            for word in words {
                element.nodes.push(entity_number(*line, word, "the number of a node")?);
            }
            match element.nodes.len().cmp(&element.shape.n_nodes()) {
                std::cmp::Ordering::Less => open = Some(element),
                std::cmp::Ordering::Equal => self.elements.push(element),
                std::cmp::Ordering::Greater => {
                    let (n, found) = (element.shape.n_nodes(), element.nodes.len());
                    return Err(ReadError::deck(
                        *line,
                        format!("element {} has {found} nodes, {kind} has {n}", element.number),
                    ));
                }
            }
        }
        if let Some(element) = open {
            let (n, found) = (element.shape.n_nodes(), element.nodes.len());
            return Err(ReadError::deck(
                section.line,
                format!("element {} has {found} nodes, {kind} has {n}", element.number),
            ));
        }
        if let Some(name) = section.value("ELSET") {
            let members = self.elements[first..].iter().map(|e| Member::Number(e.number)).collect();
            self.element_sets.push(Set { name: name.to_owned(), members, instance: None, line: section.line });
        }
        Ok(())
    }

    fn surface(&mut self, section: &Section) -> Result<(), ReadError> {
        let kind = section.value("TYPE").unwrap_or("ELEMENT").to_uppercase();
        let (name, line) = (section.needs("NAME")?, section.line);
        // analytical surfaces have no elements
        if kind != "ELEMENT" && kind != "NODE" {
            return Ok(());
        }
        let mut items = Vec::new();
        for (line, words) in &section.data {
            let Some(first) = words.first().filter(|w| !w.is_empty()) else { continue };
            let face = words.get(1).filter(|w| kind == "ELEMENT" && !w.is_empty());
            let chosen = face.map_or(Ok(Chosen::Outer), |word| chosen(*line, word))?;
            items.push((member(first), chosen));
        }
        self.surfaces.push(Surface { name, of_nodes: kind == "NODE", items, line });
        Ok(())
    }
}

/// `S3`, of a face of an element; `E3` of an edge of a shell, which is such a face of a cell of the plane; `SPOS` and
/// `SNEG`, the sides of a shell.
fn chosen(line: usize, word: &str) -> Result<Chosen, ReadError> {
    if ["SPOS", "SNEG"].iter().any(|side| word.eq_ignore_ascii_case(side)) {
        return Ok(Chosen::Itself);
    }
    let digits = word.strip_prefix(['S', 's', 'E', 'e']).and_then(|d| d.parse().ok()).filter(|n| (1..=6).contains(n));
    let told = || ReadError::deck(line, format!("found `{word}`, needed a face of an element: S1 to S6, SPOS or SNEG"));
    digits.map(Chosen::Face).ok_or_else(told)
}

/// A number, or the name of a set.
fn member(word: &str) -> Member {
    match word.parse().ok().filter(|number| *number < NUMBERS) {
        Some(number) => Member::Number(number),
        None => Member::Set(word.to_owned()),
    }
}

fn set(section: &Section, name: String) -> Result<Set, ReadError> {
    let mut members = Vec::new();
    let generate = section.value("GENERATE").is_some();
    for (line, words) in &section.data {
        if !generate {
            members.extend(words.iter().filter(|w| !w.is_empty()).map(|w| member(w)));
            continue;
        }
        let mut numbers = [0, 0, 1];
        for (slot, word) in numbers.iter_mut().zip(words) {
            *slot = entity_number(*line, word, "the number of a member")?;
        }
        let [from, to, by] = numbers;
        if words.len() < 2 || by == 0 || to < from {
            return Err(ReadError::deck(
                *line,
                "a generated set has its first and last number, and the distance between them",
            ));
        }
        members.push(Member::Range([from, to, by]));
    }
    let instance = section.value("INSTANCE").map(str::to_owned);
    Ok(Set { name, members, instance, line: section.line })
}
