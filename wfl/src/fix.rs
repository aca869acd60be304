//! Changes of the text that take a message away: data beside the message, set by the stage that makes it.
//!
//! A stage offers a fix where nothing is left to choose; a cure that would need a guess stays a sentence. Stages that see
//! no text name a statement by the primary place of the message. `edits.rs` makes changes of a text of them.

use crate::source::Span;

/// A change that takes a message away, as the stage that makes the message knows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fix {
    /// Other text at a place.
    Replace {
        /// What is replaced; empty where something is put in.
        span: Span,
        /// What stands there then; may quote places of the scene.
        text: String,
        /// What it does, where the two texts do not say it.
        title: Option<&'static str>,
    },
    /// Another first word for the statement around the primary place.
    FirstWord {
        /// The one that it has; a statement with another one is left alone.
        from: &'static str,
        /// The one that it gets.
        to: &'static str,
    },
    /// A statement that is missing: it goes before the one around the primary place, or to the end of a scene where no
    /// text is to blame.
    AddStatement(String),
    /// The statement around the primary place is not needed.
    DeleteStatement,
}
