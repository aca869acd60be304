//! How Newton converges over the whole range of gamma: the table of `docs/newton.md`.
//!
//! `cargo run --release -p wfl-tests --bin globalisation` solves all load steps of the fault benchmark and of inclined
//! faults under an oblique load with every method and gamma and prints the page. A run that fails stays in the table.

use std::io::Write as _;

use wfl_tests::{examples, solve};

const GAMMAS: [f64; 8] = [1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8];
/// Coercivity bound of theta = 1 on these cells of normal size 0.25 or 0.5, with a margin.
const BOUND: f64 = 2e5;

struct Fault {
    name: &'static str,
    what: &'static str,
    edits: &'static [(&'static str, &'static str)],
    /// gamma that is E/h, h the size of a cell normal to the fault.
    unit: f64,
}

const LEFT: &str = "cells where x < 0";
const RIGHT: &str = "cells where x > 0";
const MESH: &str =
    "mesh box [-1, 0, 0] to [1, 4, 4] cells [8, 8, 8] hex map [sign(x)*near(abs(x)), 4*near(y/4), 4*near(z/4)]";
const LOAD: &str = "[0,0,-t] on top";

const FAULTS: &[Fault] = &[
    Fault { name: "fault", what: "examples/fault, 8x8x8 cells", edits: &[], unit: 1e5 },
    Fault {
        name: "inclined 10",
        what: "the same, fault inclined by 10 degrees, load [-0.5,0.7,-1] t on top",
        edits: &[
            (MESH, "mesh box [-1, 0, 0] to [1, 4, 4] cells [8, 8, 8] hex map [x + (z-2)*0.17633*(1-abs(x)), y, z]"),
            (LEFT, "cells where x < (z-2)*0.17633"),
            (RIGHT, "cells where x > (z-2)*0.17633"),
            (LOAD, "[-0.5*t,0.7*t,-t] on top"),
        ],
        unit: 1e5,
    },
    Fault {
        name: "inclined 30",
        what: "blocks three times as wide, 12x6x8 cells, fault inclined by 30 degrees, the oblique load",
        edits: &[
            (MESH, "mesh box [-3, 0, 0] to [3, 4, 4] cells [12, 6, 8] hex map [x + (z-2)*0.57735*(1-abs(x)/3), y, z]"),
            (LEFT, "cells where x < (z-2)*0.57735"),
            (RIGHT, "cells where x > (z-2)*0.57735"),
            ("x == -1", "x == -3"),
            ("x == 1", "x == 3"),
            (LOAD, "[-0.5*t,0.7*t,-t] on top"),
        ],
        unit: 5e4,
    },
];

const METHODS: [(&str, &str, Option<f64>); 5] = [
    ("penalty", "penalty", None),
    ("Nitsche -1", "nitsche", Some(-1.0)),
    ("Nitsche 0", "nitsche", Some(0.0)),
    ("Nitsche 1", "nitsche", Some(1.0)),
    ("augmented Lagrangian", "augmented_lagrangian", None),
];

fn main() -> std::process::ExitCode {
    let mut out = std::io::stdout().lock();
    match write(&mut out) {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(e) => {
            let _ = writeln!(std::io::stderr(), "error: {e}");
            std::process::ExitCode::FAILURE
        }
    }
}

fn write(out: &mut impl std::io::Write) -> std::io::Result<()> {
    writeln!(out, "{}", HEAD.trim_end())?;
    for fault in FAULTS {
        writeln!(out, "\n## {}: {}\n", fault.name, fault.what)?;
        writeln!(out, "| method | gamma | gamma h/E | first step | mean of later steps | largest | failed steps |")?;
        writeln!(out, "|---|---|---|---|---|---|---|")?;
        for (name, file, theta) in METHODS {
            for gamma in GAMMAS.into_iter().filter(|g| theta != Some(1.0) || *g > BOUND) {
                writeln!(
                    out,
                    "| {name} | {gamma:e} | {:e} | {} |",
                    gamma / fault.unit,
                    row(fault, file, theta, gamma)
                )?;
                out.flush()?;
            }
        }
    }
    Ok(())
}

fn row(fault: &Fault, file: &str, theta: Option<f64>, gamma: f64) -> String {
    let folder = examples().join("fault");
    let text = match std::fs::read_to_string(folder.join(format!("{file}.wfl"))) {
        Ok(text) => text,
        Err(e) => return format!("{e}"),
    };
    // only the steps matter here
    let text: String = text.lines().filter(|l| !l.starts_with("output")).map(|l| format!("{l}\n")).collect();
    let edits: Vec<(&str, String)> = fault.edits.iter().map(|(a, b)| (*a, (*b).to_owned())).collect();
    let mut params = vec![("gamma", gamma)];
    params.extend(theta.map(|t| ("theta", t)));
    match solve(&folder, text, &edits, &params) {
        Ok(solved) => {
            let counts: Vec<usize> = solved.outcome.steps.iter().map(|s| s.history.n_iterations()).collect();
            let failed = solved.outcome.steps.iter().filter(|s| !s.history.converged()).count();
            let later = &counts[1.min(counts.len())..];
            #[expect(clippy::cast_precision_loss, reason = "a mean of counts")]
            let mean = later.iter().sum::<usize>() as f64 / later.len().max(1) as f64;
            let largest = counts.iter().max().copied().unwrap_or(0);
            let first = counts.first().copied().unwrap_or(0);
            format!("{first} | {mean:.1} | {largest} | {failed}")
        }
        Err(e) => format!("- | - | - | {}", e.lines().next().unwrap_or("error")),
    }
}

const HEAD: &str = "# Newton over the whole range of gamma

Made by `cargo run --release -p wfl-tests --bin globalisation > docs/newton.md`; iterations to the default tolerance
1e-10, 20 load steps each, E = 25000, friction 0.4. theta = 1 starts at its coercivity bound.

How a step is solved (`runtime/src/newton/`):

1. **Held pieces** (`pieces.rs`). Each projection t = P(x) of the scene (`pos_part`, `Ball_projection`) is read as
   t = P(t + c (x - t)), true for every c > 0, with t kept at each integration point and eliminated there. c is chosen
   so that c dx/du is the stiffness of the bodies: the branch is then chosen from a traction that does not depend on
   gamma, and a point that slips is tried as sticking before it slips the other way. The start is tied (ties of
   all kinks are contact and stick); where contact is stiff the points of a face choose together three times, because
   one that sticks takes the load of those beside it, and the first two steps are whole. Later steps start
   from the pieces that follow if arguments and values go on as they did between the last two steps.
2. **A search along each of these steps** (`pieces/watched.rs`). With linear bodies every state on the way is in
   equilibrium, and x, t and the friction bound are linear in it, so only the defect of t = P(t + c (x - t)) is looked
   at, squared and summed as an energy: the step is halved until the defect falls. A trial costs no assembly. Without it
   and without soft contact the pieces circle where a stiff fault opens (`tests/tests/robust.rs` has such scenes).
3. **Soft contact** where contact is stiff against the bodies and ten iterations brought no progress (25 in later
   steps): for a few iterations a layer of 0.3 times their stiffness lies between the sides, until few pieces change in a step;
   those pieces are then the start as written.
4. **The path through the pieces** (`path.rs`) where bodies are linear and steps come to nothing, or a state is met
   again: from the residual R of where the step stands, and then of its start, the state follows A(u) = (1 - s) R from
   one change of branch to the next. At a kink behind which the tangent has a determinant of the other sign it turns
   round; a search for a smaller defect ends there. A path that turned round says that loads on it have several states
   (W609).
5. **Friction that grows** from nothing to what is written, with held pieces.
6. **Backtracking on the residual norm**, multiplier equations weighted to force units.
7. **The natural monotonicity test** (Deuflhard): backtracking on the norm of the simplified Newton correction.
8. **Friction that shrinks** from a multiple to what is written.

The stiffness of the bodies is the mean of their diagonal at the contact, unless that is a hundred times what they give
way with to forces at random (`pieces/compliance.rs`: nearly incompressible bodies, a body far softer than the other).
Contact without a multiplier whose arguments are a hundred times softer than the bodies, while its linear part is ten
times as stiff as they are (theta = -1 with gamma far below E/h), binds the stresses of the bodies to its traction: a
face has more points that may slip than its stresses have directions, and pieces chosen point by point circle. Such a
scene starts with **overstress** (`overstress.rs`): traction may exceed its bound by a part of what it exceeds it by
without a bound, t = p + w (x - p) with p the projection (Duvaut and Lions), from tied points, with w from nearly 1 to 0,
the faster the fewer points change pieces. Later steps take five whole steps and a path of 20 kinks before they do so.
A method that makes no progress hands over to the next.

Bodies that are not linear begin a step with the tangent of the step before, by which they follow what is prescribed
(`predict.rs`). A correction is followed to where the energy is the least along it (`energy.rs`): of |grad u|^(p-2) grad u
it may be thousands of times too long or p - 1 times too short, and the residual norm grows before the energy does. With
multipliers the energy is that with the multipliers the correction leads to; pieces are searched only where a step has
left less than a tenth of the held equations open. Where the residual is the rounding of the matrix of the bodies, these
are evaluated at their points and the state is refined (`refine.rs`).

What was tried and lost: layers of a tenth, three times and ten times the stiffness of the bodies, which took more
iterations; at most three to five halvings, which need fewer iterations on faults and fail for nearly incompressible
bodies; the smallest of all trials in place of the first that falls; eight whole steps everywhere, closing points that
stick at first, handing over after two short steps, a stiffer choice of pieces for theta = -1 far below E/h; a soft
layer from the first iteration (31 iterations in place of 8 on the fault inclined by 10 degrees), and pieces foretold
from three states in place of two (15 in place of 10 where gamma is 1e3 E/h). For theta = -1 far below E/h: sixteen whole
steps at first, which circle, and gamma brought down in steps of ten, which takes more iterations in all. A soft layer at
the first short step from rest, which makes some first steps shorter and others several times as long; a search that
compares with the largest of the last three defects does the same. Without the
search, stiff friction on power-law bodies fails.
What still fails: Nitsche with theta = 0 or 1 far below its coercivity bound (W503), and some nearly incompressible bodies
(nu = 0.4999) on a fault inclined by 45 degrees. What takes long: the first step of a power law with p = 10 from rest (20
to 30 iterations), first steps of contact a thousand times stiffer than the bodies at several points a face, friction
coefficients of several units on faults that open, and theta = -1 where gamma is 1e-4 E/h, whose stresses at the points
of a face hold each other; there are several states then.";
