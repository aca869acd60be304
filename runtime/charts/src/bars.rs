//! Bars: one length a name, from left to right.

/// A bar with its name.
#[derive(Clone, Debug)]
pub struct Bar {
    pub(crate) label: String,
    pub(crate) value: f64,
    pub(crate) note: String,
}

impl Bar {
    /// A bar of this length, in the unit of the x axis; one that is not finite or negative is written and not drawn.
    #[must_use]
    pub fn new(label: impl Into<String>, value: f64) -> Self {
        Bar { label: label.into(), value, note: String::new() }
    }

    /// What is shown when the bar is pointed at.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }
}
