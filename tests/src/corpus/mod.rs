//! Conformance corpora: small cases with numbers of another program, assembled here and compared.
//!
//! A corpus file (`gwfl-corpus/1`) gives meshes, quadrature points, nodal values, expressions of the weak-form
//! language of GetFEM and the scalar, residual and tangent that GetFEM assembled. Every case runs through the whole
//! chain: text, macros, typed graph, derivatives, point kernels of the backend handed over, the assembler of
//! the runtime. Numbers are compared as `|ours - theirs| <= rtol * (largest entry of theirs)`; a case marked `reject` must
//! end in an error message.
//!
//! At a kink the two programs may choose differently on purpose (`max`, `min`, a ball of radius 0). A case marked
//! `kink` is therefore compared twice: written with GetFEM's choice at ties (`ties.rs`) it must give GetFEM's numbers,
//! and compiled as the language says it must give the same scalar and residual; where only its tangent differs the line
//! says so ([`Verdict::TieDiffers`]). Nothing is skipped.

mod case;
mod compare;
mod format;
mod setup;
mod ties;

use std::fmt;

use wfl_compiler::backend::KernelBackend;

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

/// Runs all cases of a corpus file on a backend.
///
/// # Errors
/// When the text is no corpus, says why; a case that cannot be run is a failure of that case.
pub fn run_corpus(text: &str, backend: &dyn KernelBackend) -> Result<CorpusReport, String> {
    let corpus: format::Corpus = serde_json::from_str(text).map_err(|e| format!("not a corpus file: {e}"))?;
    if corpus.format != format::FORMAT {
        return Err(format!("a corpus of format `{}`; `{}` can be read", corpus.format, format::FORMAT));
    }
    let report = |case: &format::Case| CaseReport {
        id: case.id.clone(),
        family: case.family.clone(),
        verdict: case::run(&corpus, case, backend).unwrap_or_else(|why| Verdict::Fails { why }),
    };
    Ok(CorpusReport { cases: corpus.cases.iter().map(report).collect(), backend: backend.name() })
}
