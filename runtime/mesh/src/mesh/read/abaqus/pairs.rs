//! Contact pairs and ties of a deck, and what is left out: no part of the mesh, but what whoever brings a deck looks for.

use super::{
    element::bodiless,
    text::{self, Section},
};
use crate::mesh::read::Beside;

/// What a deck says beside its mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DeckNotes {
    /// Contact pairs and ties.
    pub pairs: Vec<DeckPair>,
    /// Elements that are no cells, in capitals: types and how many data lines they have.
    pub left_out: Vec<(String, usize)>,
    /// Names of the files that it includes, in their order.
    pub included: Vec<String>,
}

/// A contact pair or a tie of a deck.
#[derive(Clone, Debug, PartialEq)]
pub struct DeckPair {
    /// The surface whose points are held off (slave, dependent).
    pub here: String,
    /// The surface that they meet (master, independent).
    pub there: String,
    /// The coefficient of friction, if there is one above 0.
    pub friction: Option<f64>,
    /// The two are joined, and not only in contact.
    pub is_tie: bool,
    /// The line of the keyword.
    pub line: usize,
}

/// What the contents of a file of Abaqus or CalculiX say beside the mesh; nothing of another file, and of a deck whose
/// included files cannot be read.
#[must_use]
pub fn deck_notes(bytes: &[u8], beside: &mut Beside<'_>) -> DeckNotes {
    if !super::recognises(bytes) {
        return DeckNotes::default();
    }
    let Ok(text) = text::read(bytes, beside) else { return DeckNotes::default() };
    let mut left_out: Vec<(String, usize)> = Vec::new();
    for section in text.sections.iter().filter(|s| s.keyword == "ELEMENT") {
        let Some(kind) = section.value("TYPE").map(str::to_uppercase).filter(|kind| bodiless(kind)) else { continue };
        match left_out.iter_mut().find(|row| row.0 == kind) {
            Some(row) => row.1 += section.data.len(),
            None => left_out.push((kind, section.data.len())),
        }
    }
    let included = text.files().iter().map(|file| file.1.clone()).collect();
    DeckNotes { pairs: pairs(&text.sections), left_out, included }
}

fn pairs(all: &[Section]) -> Vec<DeckPair> {
    let mut pairs = Vec::new();
    for section in all.iter().filter(|s| matches!(s.keyword.as_str(), "CONTACT PAIR" | "TIE")) {
        let is_tie = section.keyword == "TIE";
        let friction = section.value("INTERACTION").and_then(|name| friction(all, name)).filter(|mu| *mu > 0.0);
        for (_, words) in &section.data {
            if let [here, there, ..] = words.as_slice() {
                let plain = |name: &String| name.replace('.', "_");
                pairs.push(DeckPair {
                    here: plain(here),
                    there: plain(there),
                    friction: friction.filter(|_| !is_tie),
                    is_tie,
                    line: section.line,
                });
            }
        }
    }
    pairs
}

/// The coefficient behind `*FRICTION` of a surface interaction.
fn friction(all: &[Section], name: &str) -> Option<f64> {
    let own = |s: &Section| {
        s.keyword == "SURFACE INTERACTION" && s.value("NAME").is_some_and(|n| n.eq_ignore_ascii_case(name))
    };
    let start = all.iter().position(own)? + 1;
    let inside = all[start..].iter().take_while(|s| s.keyword != "SURFACE INTERACTION" && s.keyword != "STEP");
    let found = inside.filter(|s| s.keyword == "FRICTION").find_map(|s| s.data.first());
    found?.1.first()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::read::nothing_beside;

    #[test]
    fn pairs_have_the_friction_of_their_interaction() {
        let deck = "*HEADING\n*SURFACE INTERACTION, NAME=A\n*SURFACE BEHAVIOR\n1e5\n*FRICTION\n0.3, 1e4\n\
                    *SURFACE INTERACTION, NAME=B\n*CONTACT PAIR, INTERACTION=a, TYPE=SURFACE TO SURFACE\nup, low\n\
                    *CONTACT PAIR, INTERACTION=B\ninst.x, y\n*TIE, NAME=t\np, q\n";
        let pair = |here: &str, there: &str, friction, is_tie, line| DeckPair {
            here: here.to_owned(),
            there: there.to_owned(),
            friction,
            is_tie,
            line,
        };
        let expected = vec![
            pair("up", "low", Some(0.3), false, 8),
            pair("inst_x", "y", None, false, 10),
            pair("p", "q", None, true, 12),
        ];
        let deck = format!("{deck}*ELEMENT, TYPE=SpringA, ELSET=s\n1, 1, 2\n2, 2, 3\n");
        let notes = deck_notes(deck.as_bytes(), &mut nothing_beside);
        assert_eq!((notes.pairs, notes.left_out), (expected, vec![("SPRINGA".to_owned(), 2)]));
        assert_eq!(deck_notes(b"$MeshFormat\n", &mut nothing_beside), DeckNotes::default());
    }
}
