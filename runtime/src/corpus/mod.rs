//! Conformance corpora: small cases with numbers of another program, assembled here and compared.
//!
//! A corpus file (`gwfl-corpus/1`) gives meshes, quadrature points, nodal values, expressions of the weak-form
//! language of GetFEM and the scalar, residual and tangent that GetFEM assembled. Every case runs through the whole
//! chain: text, macros, typed graph, derivatives, point kernels of the backend handed over, the assembler of this
//! crate. Numbers are compared as `|ours - theirs| <= rtol * (largest entry of theirs)`; a case marked `reject` must
//! end in an error message.
//!
//! At a kink the two programs may choose differently on purpose (`neg_part`, `max`, a ball of radius 0). A case
//! marked `kink` is therefore compared twice: compiled with GetFEM's choice at ties it must give GetFEM's numbers, and
//! compiled as the language says it must give the same scalar and residual; where only its tangent differs the line
//! says so ([`Verdict::TieDiffers`]). Nothing is skipped.

mod case;
mod compare;
mod format;
mod setup;

use std::fmt;

use thiserror::Error;
use wfl_compiler::backend::KernelBackend;

/// Why a corpus could not be run at all.
#[derive(Debug, Error)]
pub enum CorpusError {
    /// Not the JSON that was expected.
    #[error("not a corpus file: {0}")]
    Text(#[from] serde_json::Error),
    /// Another format.
    #[error("a corpus of format `{found}`; `{}` can be read", format::FORMAT)]
    Format {
        /// What the file says.
        found: String,
    },
}

/// How a case ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// All numbers agree; the largest difference as a part of the tolerance.
    Agrees {
        /// 1 is just within the tolerance.
        worst: f64,
    },
    /// A case that must be refused was, with this message.
    Refused {
        /// Code and sentence of the first error.
        message: String,
    },
    /// With GetFEM's choice at ties all numbers agree; the language chooses another tangent there.
    TieDiffers {
        /// Largest difference with GetFEM's choice, as a part of the tolerance.
        worst: f64,
    },
    /// Numbers differ, or the case did not get that far.
    Fails {
        /// Why.
        why: String,
    },
}

/// One case.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseReport {
    /// Its name in the file.
    pub id: String,
    /// Its family in the file.
    pub family: String,
    /// How it ended.
    pub verdict: Verdict,
}

/// All cases of a corpus, in the order of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct CorpusReport {
    /// One entry a case.
    pub cases: Vec<CaseReport>,
    /// Name of the backend.
    pub backend: &'static str,
}

impl Verdict {
    /// False for failures only.
    #[must_use]
    pub fn passes(&self) -> bool {
        !matches!(self, Verdict::Fails { .. })
    }
}

impl CorpusReport {
    /// Number of cases that pass.
    #[must_use]
    pub fn passed(&self) -> usize {
        self.cases.iter().filter(|c| c.verdict.passes()).count()
    }

    /// The closing count.
    #[must_use]
    pub fn summary(&self) -> String {
        format!("{} of {} cases pass ({})", self.passed(), self.cases.len(), self.backend)
    }

    /// The cases that do not.
    pub fn failures(&self) -> impl Iterator<Item = &CaseReport> {
        self.cases.iter().filter(|c| !c.verdict.passes())
    }
}

impl fmt::Display for CaseReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mark = if self.verdict.passes() { "pass" } else { "FAIL" };
        write!(f, "{mark}  {:<36}  ", self.id)?;
        match &self.verdict {
            Verdict::Agrees { worst } => write!(f, "{worst:.1e} of the tolerance"),
            Verdict::Refused { message } => write!(f, "refused: {message}"),
            Verdict::TieDiffers { worst } => {
                write!(f, "{worst:.1e} of the tolerance with GetFEM's choice at ties; the tangent at ties is our own")
            }
            Verdict::Fails { why } => write!(f, "{why}"),
        }
    }
}

impl fmt::Display for CorpusReport {
    /// A line a case and a closing count.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for case in &self.cases {
            writeln!(f, "{case}")?;
        }
        writeln!(f, "{}", self.summary())
    }
}

/// Runs all cases of a corpus file on a backend.
///
/// # Errors
/// [`CorpusError`] when the text is no corpus; a case that cannot be run is a failure of that case.
pub fn run_corpus(text: &str, backend: &dyn KernelBackend) -> Result<CorpusReport, CorpusError> {
    let corpus: format::Corpus = serde_json::from_str(text)?;
    if corpus.format != format::FORMAT {
        return Err(CorpusError::Format { found: corpus.format });
    }
    let report = |case: &format::Case| CaseReport {
        id: case.id.clone(),
        family: case.family.clone(),
        verdict: case::run(&corpus, case, backend).unwrap_or_else(|why| Verdict::Fails { why }),
    };
    Ok(CorpusReport { cases: corpus.cases.iter().map(report).collect(), backend: backend.name() })
}
