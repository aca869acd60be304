//! W516: a term or a load that stands twice in a scene.
//!
//! Compared are the compiled laws and the entities they are integrated over, so that names of macros, regions and terms, and
//! the order of summands, do not matter: laws that read the same numbers and give the same fluxes for some of them are one.
//! Places of one statement are not compared with each other.

use wfl::{Code, Diagnostic, Span};
use wfl_compiler::{Class, TermLaw, interpret, ir::VerifiedKernel, types::InputSlot};

use super::{Builder, terms::PlacedLaw};

/// How often fluxes are compared, and what rounding may leave between them.
const TRIED: usize = 4;
const ROUNDING: f64 = 1e-12;

impl Builder<'_> {
    /// W516 for each law that an earlier statement has already on the same entities.
    pub(super) fn twice(&mut self, laws: &[PlacedLaw]) {
        let mut told: Vec<(Span, Span)> = Vec::new();
        for (k, law) in laws.iter().enumerate() {
            let Some(first) = laws[..k].iter().find(|l| l.span != law.span && are_same(l, law)) else { continue };
            if told.contains(&(first.span, law.span)) {
                continue;
            }
            told.push((first.span, law.span));
            let what = if law.load.is_some() { "load" } else { "term" };
            let d = Diagnostic::new(Code::W516, format!("the same {what} twice on `{}`", law.place));
            let text = if law.load.is_some() { "this load acts in addition" } else { "this term is added once more" };
            let d = d.at(law.span, text).at(first.span, "the first one");
            self.diagnostics.push(d.help("remove one of them; if both are meant, write one with the factor 2"));
        }
    }
}

fn are_same(a: &PlacedLaw, b: &PlacedLaw) -> bool {
    let nodes = a.at_nodes.is_some() == b.at_nodes.is_some() && (a.at_nodes.is_none() || a.place == b.place);
    let kinds = a.load.is_some() == b.load.is_some() && nodes && a.set == b.set && a.set.is_some();
    let mapping = a.law.listing.graph.mapping == b.law.listing.graph.mapping;
    kinds && mapping && !a.law.tests.is_empty() && (have_one_code(&a.law, &b.law) || give_the_same(&a.law, &b.law))
}

fn have_one_code(a: &TermLaw, b: &TermLaw) -> bool {
    let slots = a.class == b.class && a.tests == b.tests && a.trials == b.trials && a.inputs == b.inputs;
    let step = a.prologue.slots == b.prologue.slots && are_alike(&a.prologue.kernel, &b.prologue.kernel);
    // of a constant term the tangent has no entries, of others it has both
    let tangent = a.class == Class::Constant || are_alike(&a.tangent, &b.tangent);
    slots && step && are_alike(&a.residual, &b.residual) && tangent
}

fn are_alike(a: &VerifiedKernel, b: &VerifiedKernel) -> bool {
    let (a, b) = (a.kernel(), b.kernel());
    a.outputs == b.outputs && a.insts == b.insts
}

/// True for laws without numbers of the step whose fluxes are the same for numbers of no pattern.
fn give_the_same(a: &TermLaw, b: &TermLaw) -> bool {
    let same_slots = |x: &TermLaw, y: &TermLaw| {
        x.inputs.iter().all(|s| y.inputs.contains(s)) && x.tests.iter().all(|t| y.tests.contains(t))
    };
    let steady = [a, b].iter().all(|l| l.residual.kernel().n_uniforms == 0);
    if !steady || a.class != b.class || !same_slots(a, b) || !same_slots(b, a) {
        return false;
    }
    (0..TRIED).all(|round| {
        let fluxes = |law: &TermLaw| {
            let inputs: Vec<f64> = law.inputs.iter().map(|slot| number(a, slot, round)).collect();
            let mut out = vec![0.0; law.residual.kernel().outputs.len()];
            interpret(&law.residual, &[], &inputs, &mut Vec::new(), &mut out);
            out
        };
        let (of_a, of_b) = (fluxes(a), fluxes(b));
        let size = of_a.iter().take(a.tests.len()).fold(0.0f64, |m, x| m.max(x.abs()));
        a.tests.iter().zip(&of_a).all(|(test, x)| {
            let at = b.tests.iter().position(|t| t == test);
            size > 0.0 && at.is_some_and(|k| (x - of_b[k]).abs() <= ROUNDING * size)
        })
    })
}

/// A number between 0.1 and 1.1 for an input of a law, another one in each round (the golden ratio has no pattern).
fn number(law: &TermLaw, slot: &InputSlot, round: usize) -> f64 {
    let place = law.inputs.iter().position(|s| s == slot).unwrap_or(0);
    #[expect(clippy::cast_precision_loss, reason = "small counts")]
    let at = (1 + place + 37 * round) as f64;
    0.1 + (at * 0.618_033_988_749_895).fract()
}
