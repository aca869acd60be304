//! How Newton converges over the whole range of gamma: the table of `docs/newton.md`.
//!
//! `cargo run --release -p wfl-tests --bin globalisation` solves all load steps of the fault benchmark and of inclined
//! faults under an oblique load with every method and gamma and prints the page. A run that fails stays in the table.

use std::io::Write as _;

use wfl_run::StepResult;
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

struct Method {
    name: &'static str,
    /// The scene of examples/fault.
    file: &'static str,
    theta: Option<f64>,
}

const METHODS: [Method; 5] = [
    Method { name: "penalty", file: "penalty", theta: None },
    Method { name: "Nitsche -1", file: "nitsche", theta: Some(-1.0) },
    Method { name: "Nitsche 0", file: "nitsche", theta: Some(0.0) },
    Method { name: "Nitsche 1", file: "nitsche", theta: Some(1.0) },
    Method { name: "augmented Lagrangian", file: "augmented_lagrangian", theta: None },
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

/// A row of a table: the iterations of each load step, or why there are none.
struct Row {
    method: &'static str,
    counts: Vec<usize>,
    /// Load steps that did not converge.
    failed: usize,
    error: Option<String>,
}

impl Row {
    fn largest(&self) -> usize {
        self.counts.iter().max().copied().unwrap_or(0)
    }

    fn text(&self) -> String {
        if let Some(error) = &self.error {
            return format!("- | - | - | {error}");
        }
        let later = &self.counts[1.min(self.counts.len())..];
        #[expect(clippy::cast_precision_loss, reason = "a mean of counts")]
        let mean = later.iter().sum::<usize>() as f64 / later.len().max(1) as f64;
        let first = self.counts.first().copied().unwrap_or(0);
        format!("{first} | {mean:.1} | {} | {}", self.largest(), self.failed)
    }
}

/// All rows are solved first, because the page begins with what they show; each is told on standard error at once.
fn write(out: &mut impl std::io::Write) -> std::io::Result<()> {
    let mut rows = Vec::new();
    let mut tables = String::new();
    for fault in FAULTS {
        tables += &format!("\n## {}: {}\n\n", fault.name, fault.what);
        tables += "| method | gamma | gamma h/E | first step | mean of later steps | largest | failed steps |\n";
        tables += "|---|---|---|---|---|---|---|\n";
        for method in &METHODS {
            for gamma in GAMMAS.into_iter().filter(|g| method.theta != Some(1.0) || *g > BOUND) {
                let row = solve_all(fault, method, gamma);
                let line = format!("| {} | {gamma:e} | {:e} | {} |", method.name, gamma / fault.unit, row.text());
                writeln!(std::io::stderr(), "{line}")?;
                tables += &format!("{line}\n");
                rows.push(row);
            }
        }
    }
    write!(out, "# Newton's method over the whole range of gamma\n\n{}\n\n{}\n{tables}", summary(&rows), HOW.trim_end())
}

/// What the rows show, in a paragraph.
fn summary(rows: &[Row]) -> String {
    let solved = rows.iter().filter(|r| r.error.is_none() && r.failed == 0).count();
    let steps: usize = rows.iter().map(|r| r.counts.len()).sum();
    let first = rows.iter().filter_map(|r| r.counts.first()).max().copied().unwrap_or(0);
    let largest = |method: &str| rows.iter().filter(|r| r.method == method).map(Row::largest).max().unwrap_or(0);
    let methods: Vec<String> = METHODS.iter().map(|m| format!("{} with {}", largest(m.name), m.name)).collect();
    format!(
        "In short: {solved} of {} combinations of method, gamma and fault converge in all load steps ({steps} in total), with\n\
         gamma h/E from 1e-4 to 2e3. The first load step takes at most {first} iterations. The most iterations of any load \
         step are\n{}.\nAll rows together take {} iterations.",
        rows.len(),
        methods.join(", "),
        rows.iter().flat_map(|r| &r.counts).sum::<usize>()
    )
}

fn solve_all(fault: &Fault, method: &Method, gamma: f64) -> Row {
    let none = |error: String| Row { method: method.name, counts: Vec::new(), failed: 0, error: Some(error) };
    let folder = examples().join("fault");
    let text = match std::fs::read_to_string(folder.join(format!("{}.wfl", method.file))) {
        Ok(text) => text,
        Err(e) => return none(e.to_string()),
    };
    // only the steps matter here
    let text: String = text.lines().filter(|l| !l.starts_with("output")).map(|l| format!("{l}\n")).collect();
    let edits: Vec<(&str, String)> = fault.edits.iter().map(|(a, b)| (*a, (*b).to_owned())).collect();
    let mut params = vec![("gamma", gamma)];
    params.extend(method.theta.map(|t| ("theta", t)));
    match solve(&folder, text, &edits, &params) {
        Ok(solved) => Row {
            method: method.name,
            counts: solved.outcome.steps.iter().map(StepResult::iterations).collect(),
            failed: solved.outcome.steps.iter().filter(|s| !s.history.converged()).count(),
            error: None,
        },
        Err(e) => none(e.lines().next().unwrap_or("error").to_owned()),
    }
}

const HOW: &str = "Made by `cargo run --release -p wfl-tests --bin globalisation > docs/newton.md`. The tables count iterations to the
default tolerance 1e-10 over 20 load steps, with E = 25000 and friction 0.4: every linear solve of a load step, path
following and failed attempts included. Symmetric Nitsche (theta = 1) starts at its
coercivity bound.

## How a load step is solved

The equations of contact are piecewise smooth, and undamped Newton steps may cycle between active sets. A load step
therefore uses the methods below. A method that makes no progress is replaced by the next one, which starts from the
current state. The exact order, with the budget of each method, is the table in `runtime/newton/src/schedule.rs`; the
names in parentheses are those of the table and of histories.

1. **Active-set iteration** (`active set`). Each projection t = P(x) of the scene (`pos_part`, `max(0, x)`, `Ball_projection`) is
   replaced by t = P(t + c (x - t)), which is equivalent for every c > 0. The value t is stored at each integration
   point and eliminated there. The factor c is chosen such that c dx/du is the stiffness of the bodies. The choice of
   the active set then does not depend on gamma. A point that slips sticks before it slips in the opposite direction,
   however far its argument has come: where a load turns back, whole faces would else slip beyond where they came from
   (`tests/tests/reversal.rs`). The first load step starts with all points in contact and sticking. If contact is stiff, the first three
   active sets are chosen face by face, because a sticking point unloads its neighbours, and the first two steps are
   undamped. Later load steps start from an active set that is extrapolated from the last two.
   Inside a function that has no value for other numbers than those of the projection, or grows fast there (`pos_part(g)^1.5`,
   `log(1 + pos_part(g)/d)`, what divides, powers), a projection stays as it is written, as if it were an `if`; a term without
   others is no contact for this method, and Newton's method solves it with the searches below.
2. **Line search on the complementarity defect.** The merit function is the sum of squares of t - P(t + c (x - t)),
   weighted as an energy. With linear bodies every state along the step is in equilibrium, and x, t and the friction
   bound are linear in the step length; a trial therefore needs no assembly. The step is halved until the merit function
   decreases. Without this line search and without method 3 the active sets cycle where a stiff fault opens
   (`tests/tests/robust.rs` has such scenes).
3. **Compliance regularisation** (`compliance`). It begins if contact is stiff compared with the bodies and ten
   iterations made no progress (25 in later load steps). An elastic layer of 0.3 times the stiffness of the bodies is
   put between the sides. It is removed after a few iterations, once few points change their state; the active set found
   this way is the new start.
4. **Piecewise-linear path following** (`path`, `path from start`), with linear bodies. It begins if the steps become
   very short or a state recurs, first from the current state, then from the start of the load step. With the residual R
   there, the state follows A(u) = (1 - s) R from one change of the active set to the next (Lemke 1965, Katzenelson
   1965, Eaves 1976). Where the determinant of the tangent changes its sign, s decreases; a line search ends at such a
   point. If s has decreased on the path, the solution may not be unique (W609).
5. **Friction continuation from zero** (`friction from below`). The friction bound grows from zero to its value, with
   methods 1 and 2.
6. **Backtracking on the residual norm** (`residual`). Multiplier equations are weighted to units of force.
7. **Natural monotonicity test** (`natural test`; Deuflhard). Backtracking on the norm of the simplified Newton
   correction; before method 6 if contact is not stiff.
8. **Friction continuation from above** (`friction from above`). The friction bound falls from a multiple to its value.
9. **Downhill in the energy** (`downhill`), where the equations are those of an energy of displacements: symmetric, without
   multipliers, between sides that meet where they did before the step. A joint that softens, or an obstacle with many
   points in a cell, has states at which Newton's direction leads to a saddle, and searches for a smaller residual go
   round for ever. Each direction is that of A + s D with the smallest s of a list for which that is positive definite
   (D: by row the sum of the magnitudes in A), followed to where the energy is the least. Near a minimum s is zero, and
   the iteration is Newton's. It follows method 1, and method 6 without contact once ten iterations found no smaller
   residual. Joints that soften and rub are not of an energy by their friction alone: there it is the symmetric part of A
   that leads. It needs factors of whole tangents: not on several ranks, with PETSc, or where conjugate gradients solve.
   Bodies that are not linear have an energy, too, where friction beside them has none: after methods 1 and 5 the whole of A is
   shifted by the s that makes its symmetric part definite. The residual then falls along the direction, which is Newton's where s
   is zero; where branches stay Newton's correction is tried first, since friction may ask for a shift at the solution. Method 5
   is left there as soon as most of its steps are short: pressed nearly incompressible, such bodies took hundreds of iterations.
10. **Stiffness from below** (`stiffness from below`), with linear bodies. Contact begins no stiffer than the bodies (by the
   diagonals of their matrices, all points closed) with the active set of the state at hand; method 1 solves that, and
   each time it is solved contact gets four times as stiff, up to what is written. A penalty a million times as stiff as
   the bodies, with more points in a cell than directions for it to give way in, is solved in 40 to 60 iterations that way;
   wrong branches lead to forces as wrong otherwise, and every method above circles. It follows method 9 where there is an energy,
   else the first path of method 4, and has 60 iterations beside those of `max_iter`.

**Stiffness of the bodies.** It is the mean of their matrix diagonal at the contact nodes. If that is a hundred times
the stiffness against random forces there, the latter is used: nearly incompressible bodies, or one body that is far
softer than the other.

**Over-constrained contact.** With theta = -1 and gamma far below E/h, contact ties the stresses of the bodies to its
traction. A face then has more points that may slip than its stresses have degrees of freedom, and active sets chosen
point by point cycle. Such contact is recognised by two ratios: the arguments of the projections are a hundred times
softer than the bodies, and the linear part of the contact terms is ten times as stiff as the bodies. The first load
step then uses a Duvaut-Lions regularisation (`overstress`): t = p + w (x - p), where p is the projection of x. The
weight w goes from nearly 1 to 0, the faster the fewer points change their state. Later load steps try five undamped
steps and a path of 20 changes of the active set first.

**Nonlinear bodies.** A load step starts with a predictor (`predictor`): the linearised response to the Dirichlet
increment, with the tangent of the last load step. Where the equations cannot be evaluated at its end (a cell turns
inside out) a part of it is taken, and the next correction carries the rest. A critical-point line search follows each
correction to the minimum of the energy along it. For |grad u|^(p-2) grad u a correction may be thousands of times too
long or p - 1 times too short, and the residual norm grows before the energy does. With multipliers the energy is
evaluated with the multipliers at the end of the correction. The line search on the complementarity defect is used only
where a step has left less than a tenth of the residual of the active-set equations.

**Volumes.** In bodies of finite strain (laws whose stress turns with a rotation of the body) no iteration may change a volume
to less than a fifth or more than five times of what it is, nor pass through a determinant of zero on its way; predictors and
line searches go no further. Where the prescribed values alone turn cells inside out, a step begins with the prediction.

**Contact of nonlinear bodies.** A step that ends without a correction (no load yet, contact open) leaves no active set: the next
one chooses its own, as a first step does. After a step that ended with a method of the equations as written the active set is
the one of that state. An active set of a start at which all points are closed, taken over, ties a block to an indenter that it
does not touch, and leads to states with crumpled cells.

**Stability.** An equilibrium that is not a minimum of the energy is told (W640), and left where the scene asks for it
(`branch`): [not_converging.md](not_converging.md#an-equilibrium-that-is-not-stable-w640).

**Scales of residuals.** Forces on nodes balance between terms and cells: those of a field are relative to the largest
of them. An equation of a single number, of a scalar that no term differentiates or of a global unknown, is relative to
what cancels in it: the sum of the magnitudes of its summands, `|friction| + |eta*V| + |tau|` in
`(friction + eta*V - tau)*Test_V`. A factor in front of the sum multiplies all of them, so that an equation may be
multiplied by 1e30 and the next by 1e-30 without a change of an iteration; the search sees such equations divided by
their scales. The summands are computed for such fields alone. Where a part of a field is zero, its equations are
measured by 1e-16 of the largest.

Where one term that is not linear is all that the equations of a field consist of, and nothing holds it, what the term gives at
nodes is the residual itself: it is relative to |A| |u| then. Of a field without loads a force no larger than rounding of all its
equations together is none: a node at which a pressure is held takes just that.

**Laws that are steep at rest.** Friction that grows with the logarithm of the slip rate may be 1e30 times as stiff at a
rate of zero as the bodies, of whose stiffness no digit is left in the tangent then. Where the tangent is singular for
that reason, a step is taken with a tangent that is 7e7 times as stiff as the bodies. A matrix counts as singular (E602)
only if it is so with rows and columns each scaled to entries of 1. From a rate above the solution a correction leads
hundreds of times too far, to a slip that turns round within 1e-87: the critical-point line search serves laws on faces as
well, and ends at the last number before the force turns. Where friction couples the pressure into the tangent, so that the
residual times the correction does not fall along it, it follows the simplified Newton correction. A correction that is lost
beside the displacement is made one number long.

**What a single equation is relative to.** The tolerance is one of what cancels in it, and 1e4 times the tolerance one of what
was left of it when the step began: a gap between positions at 1000, or a pressure of 50 MPa on both sides of a skin, cancels whatever moves. A
state whose residual is no more than rounding may leave is corrected once before it is taken.

**What is stored beside what happens.** The same holds of the forces of a body: 1e4 times the tolerance is one of what was out of balance in the
step. Heat at 1e6 that varies by 1, or springs that are held at 1000, have forces that cancel, beside which a step may be less than the tolerance. Of bodies
with second rates it is what acts beside their flight: the forces that are left where nothing is accelerated. A state within the tolerance of the
largest force is taken once a correction no longer halves what is left. A step that is more than 1e-4 of the largest force takes no further iteration.
Steps `by auto` have an error of the whole values, and the tolerance of the largest force alone.

**Rounding.** If the residual is the rounding error of the product of matrix and state, the linear terms are evaluated
at their integration points and the state is improved by iterative refinement (`refinement`).

**Rest.** Where no loads act and the unknowns have vanished to 1.5e-8 of what a step began with, the state with these unknowns at
zero is looked at, and taken if it solves the equations exactly: a load that has ended leaves nothing but rounding, of which
neither branches of contact nor relative residuals say anything. A load that is not zero is known exactly, however small it is.

## Variants that were tested and rejected

- A layer of a tenth, three times or ten times the stiffness of the bodies: more iterations.
- At most three to five halvings of a step: fewer iterations on faults, failure with nearly incompressible bodies.
- The best of all trial steps in place of the first that decreases the merit function, eight undamped steps in every
  scene, points that stick when they close, the next method after two short steps, a larger c for theta = -1 far below
  E/h.
- A layer from the first iteration: 31 iterations in place of 8 on the fault inclined by 10 degrees.
- An active set extrapolated from three load steps in place of two: 15 iterations in place of 10 at gamma = 1e3 E/h.
- For theta = -1 far below E/h, sixteen undamped steps at first cycle; a gamma that falls by factors of ten takes more
  iterations in total.
- A layer at the first short step of the first load step: some first steps are shorter, others several times as long. A
  line search that compares with the largest of the last three defects does the same.
- No line search: stiff friction on power-law bodies fails.

## Known limits

- Nitsche with theta = 0 or 1 far below its coercivity bound fails (W503), and so do some nearly incompressible bodies
  (nu = 0.4999) on a fault inclined by 45 degrees.
- A power law with p = 10 takes 20 to 30 iterations in the first load step from zero.
- Many iterations are also needed by: first load steps of contact a thousand times stiffer than the bodies with several
  points a face; friction coefficients of several units on faults that open; theta = -1 at gamma = 1e-4 E/h, where the
  points of a face are coupled by its stresses and the solution may not be unique.";
