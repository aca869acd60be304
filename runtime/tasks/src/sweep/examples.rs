//! The study of the examples, run from the root of the repository, as one page with figures.
//!
//! The sweeps are those of [`PARTS`]; their tables stay in `out/study`, so that a study that was stopped goes on. The
//! page has what the tables say: the cheapest setting for a demanded error, the Pareto fronts, failed runs.

use std::{
    num::NonZeroUsize,
    path::{Path, PathBuf},
};

use wfl_adapt::knobs::number;

use super::{
    Job,
    front::{front, method, points, quantities, source, title, words},
    page,
    table::{self, Row},
    verdict::{self, Met},
};

/// One sweep of the study.
struct Part {
    /// The name of its folder and figures.
    name: &'static str,
    title: &'static str,
    /// What is asked and how it is answered.
    text: &'static str,
    /// What the tables say, in words.
    findings: &'static [&'static str],
    /// Scenes and knobs.
    words: &'static [&'static str],
    reference: &'static str,
    reference_knobs: &'static [&'static str],
    /// The quantities with a figure.
    figures: &'static [&'static str],
    /// The scenes with a figure of the error of the gradients over the unknowns.
    over_unknowns: &'static [&'static str],
}

const FAULT: &[&str] =
    &["examples/fault/nitsche.wfl", "examples/fault/penalty.wfl", "examples/fault/augmented_lagrangian.wfl"];

const PARTS: &[Part] = &[
    Part {
        name: "fault",
        title: "The slipping fault (three-dimensional, Coulomb friction, 20 load steps)",
        text: "Reference: quadratic elements on as many cells, graded towards the edges, with another contact method. \
               Errors are those of the last load step.",
        findings: &[
            "Most of the error is discretisation error. A Newton tolerance of 1e-2 gives the same error as 1e-10, \
             within 1 % for the gradients and 12 % for the slip, with half of the iterations.",
            "With gamma = 0.02 E/h on the finest mesh, the error of the slip is 180 % with penalty and 24 % with \
             Nitsche. From 2 E/h on, Nitsche's method is within 5 % of its best error; penalty needs 20 E/h. The \
             augmented Lagrangian does not depend on gamma. On one mesh the three methods cost about the same.",
            "All methods are stable in this range of gamma: no run fails. On the finest mesh the error of the forces \
             is at most 0.3 % with Nitsche (ten times smaller than that of the slip), 2.5 % with penalty and 5 % with \
             the augmented Lagrangian, which has no multiplier at the bottom nodes that are fixed from both sides.",
        ],
        words: &["refine=0.25,0.5,0.75,1", "gamma=1e3..1e6:log7", "tol=1e-2,1e-5,1e-10"],
        reference: "auto",
        reference_knobs: &["degree=2", "refine=1", "tol=1e-10", "crowd=1", "gamma=5e6"],
        figures: &["H1", "slip", "traction"],
        over_unknowns: &[],
    },
    Part {
        name: "quadratic",
        title: "The slipping fault, linear against quadratic elements",
        text: "The same fault with Nitsche's method. Reference: quadratic elements on a finer mesh, graded towards the \
               edges.",
        findings: &[
            "Quadratic elements are faster for errors below 0.7 % of the displacement or 2.5 % of the slip: 4 cells \
             along the edge of the fault give 0.3 % and 1 %, which 10 linear cells do not reach. For larger errors \
             both are on the Pareto front.",
            "The singularity at the edges of the fault limits the order of convergence: 1.6 for the displacement with \
             linear elements and 1.7 with quadratic ones, 0.8 and 0.9 for the gradients.",
            "A graded mesh compensates for the singularity. The error of the displacement is 0.007 % for the reference \
             (16 quadratic cells along an edge with crowd=1), 0.04 % for 8 graded cells and 0.1 % for 8 cells of equal \
             size (wfl sweep examples/fault/nitsche.wfl crowd=0,1 degree=2 tol=1e-7 gamma=5e6 with this reference).",
        ],
        words: &["examples/fault/nitsche.wfl", "refine=0.25,0.5,0.75,1,1.25", "degree=1,2", "tol=1e-3", "gamma=2e5"],
        reference: "auto",
        reference_knobs: &["degree=2", "refine=2", "tol=1e-7", "crowd=1", "gamma=5e6"],
        figures: &["L2", "H1", "slip"],
        over_unknowns: &[],
    },
    Part {
        name: "signorini",
        title: "Manufactured contact (two-dimensional, exact solution known)",
        text: "Linear and quadratic elements. Reference: the exact solution.",
        findings: &[
            "Quadratic elements are faster at every accuracy, and their advantage grows as the error falls: an error \
             of 1 % in the gradients needs 8 quadratic cells a side, and 64 linear cells do not reach it.",
            "The orders of convergence are those of theory: 1 and 2 for the gradients, 2 for the displacement of \
             linear elements, 3 for the pressure of quadratic elements until the end of the contact zone inside a cell \
             dominates.",
            "A Newton tolerance of 1e-3 does not affect the error of the gradients down to 0.1 %. It does affect the \
             pressure, whose error then stays above 1 % on every mesh.",
        ],
        words: &["examples/signorini/signorini.wfl", "n=4,8,16,32,64", "degree=1,2", "tol=1e-3,1e-10"],
        reference: "exact",
        reference_knobs: &[],
        figures: &["H1", "L2", "pressure"],
        over_unknowns: &[],
    },
    Part {
        name: "crack",
        title: "A closed crack with friction (two-dimensional, singular at its tips)",
        text: "The singularity limits what a finer mesh or a higher degree can achieve.",
        findings: &[
            "The mesh is graded towards the tips, which compensates for the singularity: for errors of the slip below \
             1 % quadratic elements are faster. With linear elements gamma = 1e6 and 1e8 give the same errors. With \
             quadratic elements on the finest mesh gamma = 1e6 is below the safe value (W503), and the errors are half \
             as large again.",
        ],
        words: &["examples/crack/compression.wfl", "refine=3/5,2/3,4/5,1,4/3", "degree=1,2", "gamma=1e6,1e8"],
        reference: "auto",
        reference_knobs: &["degree=2", "refine=16/5"],
        figures: &["H1", "slip"],
        over_unknowns: &[],
    },
    Part {
        name: "singular",
        title: "Singular solutions on uniform and on locally refined meshes (two-dimensional, exact solutions known)",
        text: "An L-shaped domain (r^(2/3)) and the tip of a crack (r^(1/2)). The runs of the table have uniform meshes; \
               the line `refined locally` has those that `wfl run --accuracy` finds.",
        findings: &[
            "On uniform meshes the singularity decides: the error of the gradients falls as n^(-1/3) at the corner and \
             n^(-1/4) at the tip with the number n of unknowns, for both degrees. Refined locally, it falls as n^(-1) with \
             quadratic elements, as for a smooth solution.",
        ],
        words: &[
            "runtime/cli/tests/known/corner.wfl",
            "runtime/cli/tests/known/tip.wfl",
            "refine=1/2,1,2,4,8,16",
            "degree=1,2",
        ],
        reference: "exact",
        reference_knobs: &[],
        figures: &["H1"],
        over_unknowns: &["corner", "tip"],
    },
    Part {
        name: "hyperelastic",
        title: "A neo-Hookean block pressed on a floor with friction (three-dimensional, finite strain)",
        text: "All terms are nonlinear: the whole tangent is assembled and factored in each iteration.",
        findings: &[
            "Friction at the edge of the floor limits the order of gradients and tractions. A finer mesh reduces the \
             error, a tighter tolerance does not. The reference itself has a large error in the tractions.",
        ],
        words: &[
            "examples/hyperelastic/contact.wfl",
            "refine=1/3,2/3,1,4/3",
            "fric=0.3",
            "tol=1e-2,1e-5,1e-10",
            "gamma=2e3,2e4",
        ],
        reference: "auto",
        reference_knobs: &["degree=2", "refine=2", "fric=0.3"],
        figures: &["H1", "traction"],
        over_unknowns: &[],
    },
    Part {
        name: "pruning",
        title: "Optimisations that a scene allows",
        text: "The same scenes with one optimisation after the other turned off (`wfl run --no-prune NAME`).",
        findings: &[
            "A contact scene takes 3 to 5 times as long if its linear part is factored in each iteration, and about \
             the same if it is assembled in each iteration. The effect of the other optimisations is within the noise \
             of these small scenes. Results change by no more than the Newton tolerance allows.",
            "Element matrices of equal cells are not reused. Assembly takes 10 to 25 % of the time of a linear scene \
             (block with 12 168 unknowns: 0.11 of 0.55 s; poisson with 16 129: 0.05 of 0.33 s), and a contact scene \
             assembles its linear part only once. A copy would be correct only where shape, material and data of two \
             cells are equal to the last bit, and testing that costs part of the gain.",
        ],
        words: &["no_prune=nothing,constant,linear,condense,symmetric,quadrature"],
        reference: "none",
        reference_knobs: &[],
        figures: &[],
        over_unknowns: &[],
    },
];

/// Times each run of the pruning part is made.
const REPEAT_OF_RATIOS: NonZeroUsize = NonZeroUsize::new(5).expect("not zero");
/// Scenes of the pruning part: contact, linear, nonlinear throughout.
const PRUNED: &[&str] = &[
    "examples/fault/nitsche.wfl",
    "examples/fault/penalty.wfl",
    "examples/elasticity/block.wfl",
    "examples/hyperelastic/contact.wfl",
];

/// Runs what is missing of the study and writes its page and figures into `docs`.
///
/// # Errors
/// In words.
pub fn study(job: &Job<'_>, docs: &Path) -> Result<(), String> {
    let mut text = String::from(HEAD);
    let mut tables = Vec::new();
    for part in PARTS {
        let folder = PathBuf::from("out/study").join(part.name);
        job.listener.progress(&format!("study: {}", part.title));
        let scenes = match part.name {
            "fault" => FAULT,
            "pruning" => PRUNED,
            _ => &[],
        };
        let own = Job {
            jobs: None,
            // ratios of times that are near to each other
            repeat: if part.name == "pruning" { job.repeat.max(REPEAT_OF_RATIOS) } else { job.repeat },
            words: scenes.iter().chain(part.words).map(|w| (*w).to_owned()).collect(),
            reference: part.reference.to_owned(),
            reference_knob: part.reference_knobs.iter().map(|w| (*w).to_owned()).collect(),
            out: folder.clone(),
            ..job.clone()
        };
        super::sweep(&own)?;
        let rows = table::read(&folder).map_err(|e| e.to_string())?;
        text += &section(part, &own, &rows);
        tables.push((part, rows));
    }
    let met = verdict::runs(job)?;
    for (part, rows) in &tables {
        figures(docs, part, rows, &met)?;
    }
    text += &verdict::section(&met);
    write_file(&docs.join("trade.md"), &text)
}

/// The figures of a part, each with the runs on meshes that were refined locally.
fn figures(docs: &Path, part: &Part, rows: &[Row], met: &[Met]) -> Result<(), String> {
    let own: Vec<&Met> = met.iter().filter(|m| m.parts.contains(&part.name)).collect();
    for (name, chart) in page::charts(rows) {
        let Some(figure) = part.figures.iter().find(|f| name == page::plot_name(f)) else { continue };
        let found = own.iter().filter(|m| m.quantity == *figure).map(|m| m.found).collect::<Vec<_>>();
        let file = docs.join(format!("{}_{name}.svg", part.name));
        write_file(&file, &page::with_refined(chart, &found).svg())?;
    }
    for scene in part.over_unknowns {
        let ways: Vec<&[[f64; 2]]> = own.iter().filter(|m| m.scene == *scene).map(|m| m.way.as_slice()).collect();
        let longest = ways.into_iter().max_by_key(|w| w.len()).unwrap_or_default();
        let file = docs.join(format!("{}_{scene}_unknowns.svg", part.name));
        write_file(&file, &page::over_unknowns(scene, rows, longest).svg())?;
    }
    Ok(())
}

/// Writes a page of the documentation under another name first: a reader never sees half of it.
fn write_file(path: &Path, text: &str) -> Result<(), String> {
    let part = path.with_extension("part");
    let written = std::fs::write(&part, text).and_then(|()| std::fs::rename(&part, path));
    written.map_err(|e| format!("cannot write {}: {e}", path.display()))
}

const HEAD: &str = "# Accuracy against computing time

In short:

- **The mesh decides.** Most of the error is discretisation error. A Newton tolerance of 1e-2 or 1e-3 is enough for
  displacements, slip and gradients; pressures need a tighter one.
- **gamma.** Nitsche's method is within 5 % of its best error from gamma = 2 E/h on, penalty from 20 E/h on. With the
  default rule of contact, one point a node, pressures and forces are as good for any larger gamma: its upper end is
  1e4 E/h, the largest one measured, on flat and on curved gaps. Under a Gauss rule (`quadrature ... degree n`, through a
  mapping, on cells of second order, and of Nitsche's method on hexahedra) the upper end on curved gaps is E/h where a zone
  of contact ends; where all faces are closed, 2 E/h for elements of degree 1 and 10 E/h for degree 2. Above it pressures alternate from point to point
  (W520). The next table has errors. With one point a node the smallest safe gamma of Nitsche's method is larger (W503,
  `gamma = auto`), on hexahedra about four times: there Nitsche's method keeps the Gauss rule; `quadrature on ... vertex`
  and 10 E/h give right pressures. The augmented Lagrangian does not depend on gamma. On one mesh the three methods cost
  about the same.
- **Degree.** For a smooth solution quadratic elements are faster at every accuracy. With the singularities of a fault or a
  crack they are faster for small errors only: below 0.7 % of the displacement of the fault, below 1 % of the slip of the
  crack.
- **Singular edges** limit the order of convergence. Meshes graded towards them, or refined where the error comes from,
  compensate for that: at a corner or the tip of a crack no uniform mesh of the tables has an error of 1 % of the gradients.
- **`wfl run --accuracy`** picks such settings by itself. Its own last run is cheaper than the best uniform one where errors
  are small, and the search before it costs several times as much; the last section compares the whole command with the
  cheapest run of the tables. `marks=REPORT` takes the mesh without the search.

Penalty on waves that are closed everywhere: errors of the pressure (relative, root of the mean square) and of the force in
per cent, over gamma in E/h, with one point a node and under a Gauss rule. [quadrature.md](quadrature.md) has those of all
methods, cells and gaps, and the command that prints them.

| cells | rule | 0.1 | 1 | 2 | 10 | 20 | 100 | 1e3 | 1e4 |
|---|---|---|---|---|---|---|---|---|---|
| quad Q1 | **nodes** | 27 / 17 | 4.6 / 2.1 | 2.5 / 1.0 | 0.6 / 0.2 | 0.3 / 0.1 | 0.2 / 0.02 | 0.1 / 0.00 | 0.1 / 0.00 |
| quad Q1 | degree 4 | 27 / 17 | 4.5 / 2.1 | 2.5 / 1.0 | 5.7 / 0.2 | 11 / 0.1 | 46 / 0.02 | 109 / 0.01 | 118 / 0.01 |
| quad Q2 | **nodes** | 40 / 30 | 8.4 / 4.0 | 4.6 / 2.1 | 1.0 / 0.4 | 0.5 / 0.2 | 0.3 / 0.04 | 0.3 / 0.00 | 0.3 / 0.00 |
| quad Q2 | degree 6 | 40 / 30 | 8.4 / 4.0 | 4.6 / 2.1 | 1.2 / 0.4 | 1.4 / 0.2 | 6.7 / 0.04 | 59 / 0.00 | 103 / 0.00 |
| hex Q1 | **nodes** | 37 / 30 | 8.9 / 4.1 | 5.4 / 2.1 | 2.2 / 0.5 | 1.8 / 0.3 | 1.6 / 0.08 | 1.5 / 0.05 | 1.5 / 0.04 |
| hex Q1 | degree 4 | 37 / 30 | 8.0 / 4.0 | 4.6 / 2.1 | 11 / 0.4 | 22 / 0.2 | 87 / 0.03 | 187 / 0.04 | 219 / 0.06 |
| hex Q2 | **nodes** | 51 / 46 | 14 / 7.8 | 8.4 / 4.0 | 2.2 / 0.8 | 1.5 / 0.4 | 1.1 / 0.08 | 1.1 / 0.01 | 1.1 / 0.00 |
| hex Q2 | degree 6 | 51 / 46 | 14 / 7.8 | 8.3 / 4.0 | 3.1 / 0.8 | 4.9 / 0.4 | 25 / 0.08 | 122 / 0.00 | 183 / 0.02 |

This page is made by `wfl sweep --study docs` from the tables of the runs, failed runs included. Errors are relative. Each
point of a figure is a run; lower and further left is better. The line is the Pareto front: no run is both faster and more
accurate than a run on it. Times are of one run each unless stated otherwise, on a machine that was busy with other
work: a factor below 2 between two times is not significant.
";

fn section(part: &Part, job: &Job<'_>, rows: &[Row]) -> String {
    let failed = rows.iter().filter(|r| !r.is_solved()).count();
    let seconds: f64 = rows.iter().filter_map(|r| Some(r.value("time")? * r.value("repeats")?)).sum();
    let first = |column: &str| rows.first().map_or("", |r| r.text(column)).to_owned();
    let mut text = format!("\n## {}\n\n{} {}\n\n", part.title, part.text, settings(rows));
    text += &format!(
        "{} runs in {seconds:.0} s, {failed} failed; {}, commit {}.\n\n",
        rows.len(),
        first("machine"),
        first("commit")
    );
    for finding in part.findings {
        text += &format!("- {finding}\n");
    }
    text += &format!("\n```\nwfl sweep {}{}\n```\n\n", job.words.join(" "), reference_words(job));
    for figure in part.figures {
        text += &format!("![{figure}]({}_{}.svg)\n", part.name, page::plot_name(figure));
    }
    for scene in part.over_unknowns {
        text += &format!("![{scene}, over unknowns]({}_{scene}_unknowns.svg)\n", part.name);
    }
    if part.name == "pruning" {
        return text + &pruning(rows);
    }
    text += &own_errors(rows);
    text += "\n";
    text += &page::markdown(rows);
    for figure in part.figures {
        text += &front_of(rows, figure);
    }
    text + &failures(rows)
}

/// What was varied, from the rows themselves: scenes, and the values of each knob.
fn settings(rows: &[Row]) -> String {
    let different = |column: &str| {
        let mut list: Vec<&str> = rows.iter().map(|r| r.text(column)).filter(|v| !v.is_empty()).collect();
        list.sort_unstable();
        list.dedup();
        list.len()
    };
    let Some(first) = rows.first() else { return String::new() };
    let of = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
    let mut list = vec![of(different("scene"), "scene")];
    for column in first.columns().filter(|c| c.starts_with("knob ")) {
        let name = column.trim_start_matches("knob ");
        let numbers = || rows.iter().filter_map(|r| number(r.text(column)));
        let (low, high) = numbers().fold((f64::INFINITY, 0.0f64), |(a, b), x| (a.min(x), b.max(x)));
        list.push(match different(column) {
            1 => format!("{name} = {}", first.text(column)),
            n if low.is_finite() => format!("{n} values of {name} from {low} to {high}"),
            n => format!("{n} values of {name}"),
        });
    }
    format!("Runs: {}.", list.join(", "))
}

fn reference_words(job: &Job<'_>) -> String {
    let mut text = format!(" --reference {}", job.reference);
    for knob in &job.reference_knob {
        text += &format!(" --reference-knob {knob}");
    }
    if job.repeat.get() > 1 {
        text += &format!(" --repeat {}", job.repeat);
    }
    text
}

/// What is known of the errors of the references.
fn own_errors(rows: &[Row]) -> String {
    let (fields, _) = quantities(rows);
    let own = |q: &String| {
        let column = format!("reference error {q}");
        let largest = rows.iter().filter_map(|r| r.value(&column)).max_by(f64::total_cmp)?;
        Some(format!("{} {largest:.1e}", title(q)))
    };
    let list: Vec<String> = fields.iter().filter_map(own).collect();
    if list.is_empty() { String::new() } else { format!("\nEstimated errors of the reference: {}.\n", list.join(", ")) }
}

/// The Pareto front of a quantity, with the source of each error.
fn front_of(rows: &[Row], quantity: &str) -> String {
    let all = points(rows, quantity);
    let mut text = format!("\nPareto front, {}:\n\n", title(quantity));
    text += "| setting | time [s] | error | main source |\n|---|---|---|---|\n";
    for p in front(&all) {
        text += &format!("| `{}` | {:.3} | {:.1e} | {} |\n", words(p.row), p.time, p.error, source(p, &all, quantity));
    }
    text
}

/// How many runs of each scene failed, with the settings.
fn failures(rows: &[Row]) -> String {
    let mut text = String::new();
    for row in rows.iter().filter(|r| !r.is_solved()) {
        let why = row.text("message").lines().next().unwrap_or_default();
        text += &format!("| `{}` | {} | {why} |\n", words(row), row.text("status"));
    }
    if text.is_empty() { text } else { format!("\nFailures:\n\n| setting | status | why |\n|---|---|---|\n{text}") }
}

/// Times with and without each pruning, and by how much the measures moved.
fn pruning(rows: &[Row]) -> String {
    let mut text = String::from(
        "| scene | turned off | time [s] | ratio of times | largest change of a measure |\n|---|---|---|---|---|\n",
    );
    for base in rows.iter().filter(|r| r.text("knob no_prune") == "nothing") {
        for row in rows.iter().filter(|r| r.text("scene") == base.text("scene")) {
            let measures = row.columns().filter(|c| c.starts_with("measure ")).collect::<Vec<_>>().into_iter();
            let largest = measures.clone().filter_map(|c| base.value(c)).fold(0.0, |m: f64, x| m.max(x.abs()));
            // a measure that is rounding itself is compared with the others
            let moved = |c: &str| {
                let (a, b) = (row.value(c)?, base.value(c)?);
                Some((a - b).abs() / b.abs().max(1e-6 * largest))
            };
            let most = measures.filter_map(moved).fold(0.0, f64::max);
            let (scene, put) = (method(row.text("scene")), row.text("knob no_prune"));
            let (time, before) = (row.value("time").unwrap_or(f64::NAN), base.value("time").unwrap_or(f64::NAN));
            text += &format!("| {scene} | {put} | {time:.3} | {:.2} | {most:.0e} |\n", time / before);
        }
    }
    text
}
