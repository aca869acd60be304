//! `wfl show`: what the compiler makes of a scene.

use std::{fmt::Write as _, process::ExitCode};

use wfl::{SourceMap, Span, ast::Expansions, nearest};
use wfl_compiler::{
    Kink, KinkKind, TermLaw,
    backend::KernelBackend,
    display::{expression_text, graph_text},
    ir::{Origin, VerifiedKernel},
    types::{FieldSig, InputSlot, RateFactor, RateOrder, Side, UniformSlot},
};
use wfl_problem::Scene;
use wfl_tasks::{Loaded, tangents::basis_text};

use crate::{
    args::{ShowArgs, View},
    ast_text, check,
    load::{load, out, print_all, say},
    prepared::{EXIT_ERROR, backend, prepare_scene, sign_of_life},
    table::Table,
};

pub(crate) fn show(args: &ShowArgs) -> ExitCode {
    let Some(mut loaded) = load(&args.scene, &args.overrides, "show") else { return ExitCode::from(EXIT_ERROR) };
    if args.view == View::Ast {
        if loaded.messages.iter().any(wfl::Diagnostic::is_error) {
            print_all(&loaded.messages, &loaded.sources);
            return ExitCode::from(EXIT_ERROR);
        }
        out(&ast_text::text(&loaded.sources));
        return ExitCode::SUCCESS;
    }
    let preparing = sign_of_life();
    let Some(backend) = backend(false) else { return ExitCode::from(EXIT_ERROR) };
    let Some(scene) = prepare_scene(&mut loaded, &*backend, &[]) else { return ExitCode::from(EXIT_ERROR) };
    drop(preparing);
    let Some(chosen) = chosen(&scene, args.term.as_deref()) else { return ExitCode::from(EXIT_ERROR) };
    out(&match args.view {
        View::Terms => {
            let mut table = check::terms(&scene);
            let names: Vec<&str> = chosen.iter().map(|l| l.name.as_str()).collect();
            table.rows.retain(|r| r[0].as_str().is_some_and(|n| names.contains(&n)));
            table.text()
        }
        View::Kinks => kinks(&loaded, &chosen),
        view => chosen.iter().map(|law| one(view, law, &scene.sigs, &*backend)).collect(),
    });
    ExitCode::SUCCESS
}

/// The laws with this name, all if there is none; a message when there is no such term.
fn chosen<'s>(scene: &'s Scene, name: Option<&str>) -> Option<Vec<&'s TermLaw>> {
    let all = || scene.system.terms.iter().map(|t| &*t.law);
    let Some(name) = name else { return Some(all().collect()) };
    // a term on several regions has the region in its name
    let several = format!("{name} on ");
    let found: Vec<&TermLaw> = all().filter(|l| l.name == name || l.name.starts_with(&several)).collect();
    if found.is_empty() {
        let near = nearest(name, all().map(|l| l.name.as_str()));
        let near = near.map_or_else(String::new, |n| format!("; did you mean `{n}`?"));
        let list: Vec<&str> = all().map(|l| l.name.as_str()).collect();
        say(&format!("error: no term is called `{name}`{near}\n  = note: the terms are {}\n", list.join(", ")));
        return None;
    }
    Some(found)
}

fn one(view: View, law: &TermLaw, sigs: &[FieldSig], backend: &dyn KernelBackend) -> String {
    let mut text = format!("term {}: {}\n", law.name, law.class.word());
    let listing = &law.listing;
    match view {
        View::Graph => text += &graph_text(&listing.graph, sigs),
        View::Tangent => {
            let roots =
                [("energy", listing.energy), ("residual", listing.residual), ("tangent", Some(listing.tangent))];
            for (name, root) in roots.into_iter().filter_map(|(n, r)| Some((n, r?))) {
                let _ = write!(text, " {name}\n{}", expression_text(&listing.graph, root, sigs));
            }
        }
        View::Ir => {
            text += &slots(law, sigs);
            for kernel in kernels(law) {
                text += &kernel.kernel().text();
            }
        }
        _ => {
            for kernel in kernels(law) {
                text += &backend.listing(kernel).unwrap_or_else(|| format!("; no listing on {}\n", backend.name()));
            }
        }
    }
    text.push('\n');
    text
}

fn kernels(law: &TermLaw) -> impl Iterator<Item = &VerifiedKernel> {
    [Some(&law.prologue.kernel), law.energy.as_ref(), Some(&law.residual), Some(&law.tangent)].into_iter().flatten()
}

/// What stands behind the numbers of inputs and outputs.
fn slots(law: &TermLaw, sigs: &[FieldSig]) -> String {
    let mut text = String::new();
    for (k, slot) in law.prologue.slots.iter().enumerate() {
        let word = match slot {
            UniformSlot::Time => "t",
            UniformSlot::TimeStep => "timestep",
            UniformSlot::Rate(RateFactor::Rate) => "factor of Dot_",
            UniformSlot::Rate(RateFactor::Velocity) => "factor of Dot_ beside Dot2_",
            UniformSlot::Rate(RateFactor::Acceleration) => "factor of Dot2_",
        };
        let _ = writeln!(text, "  uniform {k} of the step kernel: {word}");
    }
    for (k, slot) in law.inputs.iter().enumerate() {
        let _ = writeln!(text, "  input {k}: {}", input_text(*slot, sigs));
    }
    for (k, test) in law.tests.iter().enumerate() {
        let _ = writeln!(text, "  flux {k}: times Test of {}", basis_text(*test, sigs));
    }
    for (k, (t, s)) in law.entries.iter().enumerate() {
        let (test, trial) = (law.tests[usize::from(*t)], law.trials[usize::from(*s)]);
        let _ = writeln!(text, "  entry {k}: {} x {}", basis_text(test, sigs), basis_text(trial, sigs));
    }
    text
}

fn input_text(slot: InputSlot, sigs: &[FieldSig]) -> String {
    let side = |s: Side| if s == Side::Here { "" } else { " there" };
    match slot {
        InputSlot::Field(b) => basis_text(b, sigs),
        InputSlot::Previous(b) => format!("previous {}", basis_text(b, sigs)),
        InputSlot::History(RateOrder::First, b) => format!("past of the rate of {}", basis_text(b, sigs)),
        InputSlot::History(RateOrder::Second, b) => format!("past of the second rate of {}", basis_text(b, sigs)),
        InputSlot::X(k) => format!("X({})", k + 1),
        InputSlot::ImageX(k) => format!("X({}) there", k + 1),
        InputSlot::ImageShift(k) => format!("shift of the image, entry {}", k + 1),
        InputSlot::ImageSlope(k) => format!("slope of the normal there, entry {}", k + 1),
        InputSlot::Normal(s, k) => format!("Normal({}){}", k + 1, side(s)),
        InputSlot::Conormal(s, k) => format!("Conormal({}){}", k + 1, side(s)),
        InputSlot::ElementSize(s) => format!("element_size{}", side(s)),
        InputSlot::ElementK(s, k) => format!("element_K entry {}{}", k + 1, side(s)),
        InputSlot::ElementB(s, k) => format!("element_B entry {}{}", k + 1, side(s)),
    }
}

/// Each kink with its place, the branches and the rule at the tie.
fn kinks(loaded: &Loaded, laws: &[&TermLaw]) -> String {
    let mut table = Table::new("kinks", &["term", "kink", "place", "text", "branch codes", "at the tie"]);
    for law in laws {
        for (k, kink) in law.kinks.iter().enumerate() {
            let (codes, tie) = match kink.kind {
                KinkKind::Select => ("0 condition false, 1 true", "as the condition says: `<=` and `>=` take branch 1"),
                KinkKind::Ball => ("0 open, 1 slip, 2 stick", "stick: the derivative of the inside"),
            };
            let (place, text) = place(kink, &loaded.sources, &loaded.script.expansions);
            table.push(vec![
                law.name.clone().into(),
                (k + 1).into(),
                place.into(),
                text.into(),
                codes.into(),
                tie.into(),
            ]);
        }
    }
    if table.rows.is_empty() { "no term has a kink that moves with the unknowns\n".to_owned() } else { table.text() }
}

/// File, line and column, and the text there; inside a macro also the use in the scene.
fn place(kink: &Kink, sources: &SourceMap, expansions: &Expansions) -> (String, String) {
    let Some(Origin { span, mut expansion }) = kink.origin else {
        return ("made by the compiler".to_owned(), String::new());
    };
    let mut text = short(sources, span);
    let mut outer = span;
    while let Some(use_) = expansion.and_then(|id| expansions.list.get(id.index())) {
        outer = use_.call;
        expansion = use_.parent;
    }
    if outer != span {
        text = format!("{text} in {}", short(sources, outer));
    }
    (position(sources, outer), text)
}

fn position(sources: &SourceMap, span: Span) -> String {
    let (line, column) = sources.line_column(span);
    format!("{}:{line}:{column}", sources.get(span.source).name)
}

fn short(sources: &SourceMap, span: Span) -> String {
    sources.snippet(span).split_whitespace().collect::<Vec<_>>().join(" ")
}
