//! The words of a text by what they are, for colours.

use std::collections::BTreeMap;

use lsp_types::{SemanticToken, SemanticTokenModifier, SemanticTokenType, SemanticTokens};
use wfl::{CONSTANTS, REGIONS, is_function, is_keyword, split_prefixes};

use crate::{
    symbols::{Key, Kind, words},
    view::View,
};

const KEYWORD: u32 = 0;
const FUNCTION: u32 = 1;
const VARIABLE: u32 = 2;
const PARAMETER: u32 = 3;
const PROPERTY: u32 = 4;
const TYPE: u32 = 5;
const NAMESPACE: u32 = 6;
const MODIFIER: u32 = 7;

const DECLARATION: u32 = 1;
const BUILT_IN: u32 = 2;
const READONLY: u32 = 4;

/// The kinds of words, in the order of their numbers.
pub(crate) fn types() -> Vec<SemanticTokenType> {
    vec![
        SemanticTokenType::KEYWORD,
        SemanticTokenType::FUNCTION,
        SemanticTokenType::VARIABLE,
        SemanticTokenType::PARAMETER,
        SemanticTokenType::PROPERTY,
        SemanticTokenType::TYPE,
        SemanticTokenType::NAMESPACE,
        SemanticTokenType::MODIFIER,
    ]
}

/// What is said of words beside, by bit.
pub(crate) fn modifiers() -> Vec<SemanticTokenModifier> {
    vec![SemanticTokenModifier::DECLARATION, SemanticTokenModifier::DEFAULT_LIBRARY, SemanticTokenModifier::READONLY]
}

/// Words of statements that are no keywords elsewhere.
const WORDS_OF_STATEMENTS: &[&str] = &[
    "box", "file", "size", "map", "hex", "tet", "quad", "tri", "segment", "scalar", "vector", "matrix", "project",
    "raytrace", "point", "across", "towards", "times", "every", "when", "vertex", "segments", "mean", "max", "min",
    "integral", "value", "reaction", "at", "newton", "linear", "vtk", "csv", "wfl",
];

/// A word with its kind.
struct Token {
    start: usize,
    length: usize,
    kind: u32,
    modifiers: u32,
}

pub(crate) fn tokens(view: &View<'_>) -> SemanticTokens {
    let mut data = Vec::new();
    let mut last = lsp_types::Position::default();
    for token in found(view) {
        let at = view.lines.position(view.text, token.start);
        let line = at.line - last.line;
        let start = if line == 0 { at.character - last.character } else { at.character };
        // words are ASCII, so bytes are units
        let length = u32::try_from(token.length).unwrap_or(u32::MAX);
        data.push(SemanticToken {
            delta_line: line,
            delta_start: start,
            length,
            token_type: token.kind,
            token_modifiers_bitset: token.modifiers,
        });
        last = at;
    }
    SemanticTokens { result_id: None, data }
}

fn found(view: &View<'_>) -> Vec<Token> {
    let names = view.analysis.names();
    let here: BTreeMap<usize, (Kind, bool)> = names
        .of(view.id)
        .iter()
        .filter_map(|o| Some((o.span.start as usize, (names.kind(&o.key)?, o.declares.is_some()))))
        .collect();
    let regions: BTreeMap<usize, ()> = names
        .of(view.id)
        .iter()
        .filter(|o| matches!(&o.key, Key::Region(_)))
        .map(|o| (o.span.start as usize, ()))
        .collect();
    let mut list = Vec::new();
    for (start, word) in words(view.text) {
        let (prefixes, root) = split_prefixes(word);
        let root_start = start + prefixes.len();
        if let Some((kind, declares)) = here.get(&root_start) {
            if !prefixes.is_empty() {
                list.push(Token { start, length: prefixes.len(), kind: MODIFIER, modifiers: BUILT_IN });
            }
            let (kind, modifiers) = of_kind(*kind);
            let modifiers = modifiers | if *declares { DECLARATION } else { 0 };
            list.push(Token { start: root_start, length: root.len(), kind, modifiers });
            continue;
        }
        let region = regions.contains_key(&start) && REGIONS.contains(&word);
        let built_in = match word {
            _ if region => Some((TYPE, BUILT_IN)),
            _ if is_keyword(word) => Some((KEYWORD, 0)),
            _ if WORDS_OF_STATEMENTS.contains(&word) && !view.text[start + word.len()..].starts_with('(') => {
                Some((KEYWORD, 0))
            }
            _ if is_function(word) => Some((FUNCTION, BUILT_IN)),
            _ if CONSTANTS.contains(&word) || ["x", "y", "z", "t"].contains(&word) => {
                Some((VARIABLE, BUILT_IN | READONLY))
            }
            _ => None,
        };
        list.extend(built_in.map(|(kind, modifiers)| Token { start, length: word.len(), kind, modifiers }));
    }
    list
}

fn of_kind(kind: Kind) -> (u32, u32) {
    match kind {
        Kind::Param | Kind::Steps => (VARIABLE, READONLY),
        Kind::Unknown | Kind::Multiplier | Kind::Data | Kind::State => (VARIABLE, 0),
        Kind::Def => (FUNCTION, 0),
        Kind::Formal => (PARAMETER, 0),
        Kind::Measure => (PROPERTY, 0),
        Kind::Region => (TYPE, 0),
        Kind::Mapping | Kind::Term => (NAMESPACE, 0),
    }
}
