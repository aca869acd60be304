//! One line of the verification suite: numbers, what they should be, and by how much they may differ.

/// What may be between a number and what is expected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// |got - expected| <= t |expected|.
    Relative(f64),
    /// |got - expected| <= t, in the unit of the number.
    Absolute(f64),
    /// got <= expected: `expected` is a limit.
    AtMost,
    /// got >= expected: `expected` is a limit.
    AtLeast,
    /// The same bits.
    Bitwise,
}

/// A computed number and the one it is compared with.
#[derive(Clone, Debug, PartialEq)]
pub struct Number {
    /// What it is: "n = 32, H1 error".
    pub label: String,
    /// What it should be, in the unit of the scene.
    pub expected: f64,
    /// What WFL gives.
    pub got: f64,
    /// How they are compared.
    pub tolerance: Tolerance,
}

impl Number {
    /// How far the number is from passing: 1 is the tolerance, above 1 fails. NaN counts as infinity.
    #[must_use]
    pub fn severity(&self) -> f64 {
        let gap = (self.got - self.expected).abs();
        let ratio = match self.tolerance {
            Tolerance::Relative(_) | Tolerance::Absolute(_) if gap == 0.0 => 0.0,
            Tolerance::Relative(t) => gap / (t * self.expected.abs()),
            Tolerance::Absolute(t) => gap / t,
            Tolerance::AtMost if self.got <= self.expected => share(self.got, self.expected),
            Tolerance::AtLeast if self.got >= self.expected => share(self.expected, self.got),
            Tolerance::Bitwise if self.got.to_bits() == self.expected.to_bits() => 0.0,
            Tolerance::AtMost | Tolerance::AtLeast | Tolerance::Bitwise => f64::INFINITY,
        };
        if ratio.is_nan() { f64::INFINITY } else { ratio }
    }
}

/// `small/large` of two numbers in that order; 0 where that has no meaning.
fn share(small: f64, large: f64) -> f64 {
    let ratio = small / large;
    if (0.0..=1.0).contains(&ratio) { ratio } else { 0.0 }
}

/// Numbers or an outcome that belong together: one line of the page.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// What is solved: "Q2, Nitsche theta = 0".
    pub what: String,
    /// The numbers; the page shows the one nearest to failing.
    pub numbers: Vec<Number>,
    /// Why there are no numbers: an error of WFL, a step that did not converge.
    pub failure: Option<String>,
}

impl Case {
    /// A case without numbers yet.
    #[must_use]
    pub fn new(what: impl Into<String>) -> Self {
        Self { what: what.into(), numbers: Vec::new(), failure: None }
    }

    /// A case that failed before there were numbers.
    #[must_use]
    pub fn failed(what: impl Into<String>, why: impl Into<String>) -> Self {
        Self { failure: Some(why.into()), ..Self::new(what) }
    }

    /// Adds a comparison.
    #[must_use]
    pub fn compare(mut self, label: impl Into<String>, got: f64, expected: f64, tolerance: Tolerance) -> Self {
        self.numbers.push(Number { label: label.into(), expected, got, tolerance });
        self
    }

    /// Adds an outcome in words that must be true, such as an error that names its cause.
    #[must_use]
    pub fn require(mut self, holds: bool, otherwise: impl Into<String>) -> Self {
        if !holds && self.failure.is_none() {
            self.failure = Some(otherwise.into());
        }
        self.numbers.push(Number {
            label: "outcome".to_owned(),
            expected: 1.0,
            got: f64::from(u8::from(holds)),
            tolerance: Tolerance::Bitwise,
        });
        self
    }

    /// True if there is something to compare and all of it holds.
    #[must_use]
    pub fn passes(&self) -> bool {
        self.failure.is_none() && !self.numbers.is_empty() && self.numbers.iter().all(|n| n.severity() <= 1.0)
    }

    /// The number nearest to failing, or furthest beyond.
    #[must_use]
    pub fn worst(&self) -> Option<&Number> {
        self.numbers.iter().max_by(|a, b| a.severity().total_cmp(&b.severity()))
    }

    /// The case in a line, for a failing test.
    #[must_use]
    pub fn describe(&self) -> String {
        let bad: Vec<String> = self
            .numbers
            .iter()
            .filter(|n| n.severity() > 1.0)
            .map(|n| format!("{}: {:e}, expected {:e} ({:?})", n.label, n.got, n.expected, n.tolerance))
            .collect();
        let why = self.failure.as_deref().unwrap_or_default();
        format!("{}: {why} {}", self.what, bad.join("; "))
    }
}
