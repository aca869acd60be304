//! X rows: extreme values and bad input. Each must give the right number, or say what is wrong; never a wrong number.
//!
//! Messages are those of the library; the command adds the names of what is not held and the place of an expression
//! (its own tests look at those).

use wfl_newton::Stop;

use super::{
    Benchmark, Case, Tolerance,
    common::{converged, or_failed},
    two_block::{AUGMENTED, NITSCHE, PENALTY, SIZE, SLIP, STICK, State, YOUNG, merged},
};
use crate::{Attempt, Solved, attempt, doubts, examples};

const ORIGIN: &str = "closed form of B1";
const OUTCOME: &str = "an error that says why, no result";

const fn row(id: &'static str, title: &'static str, origin: &'static str, run: fn() -> Vec<Case>) -> Benchmark {
    Benchmark { id, title, origin, slow: false, open: None, run }
}

/// The benchmarks of this file.
pub(super) const BENCHMARKS: &[Benchmark] = &[
    row("X1", "gamma = 1e-8 E/h", ORIGIN, tiny_gamma),
    row("X2", "gamma from 1e-4 to 1e4 E/h", ORIGIN, usual_gamma),
    row("X3", "gamma = 1e6 and 1e8 E/h: stops at the rounding floor", ORIGIN, large_gamma),
    row("X4", "gamma = 1e10 and 1e12 E/h", ORIGIN, huge_gamma),
    row("X5", "gamma 0, negative, not a number, infinite", OUTCOME, bad_gamma),
    row("X11", "nu = 0.4999999", ORIGIN, nearly_incompressible),
    row("X12", "nu = 0.5 with E and nu", OUTCOME, incompressible),
    row("X13", "nu <= -1, nu > 0.5, E <= 0", OUTCOME, bad_moduli),
    row("X14", "friction 0: no tangential traction, the same as a form without friction", ORIGIN, frictionless),
    row("X15", "friction 1e-12 is within 1e-10 of none", ORIGIN, nearly_frictionless),
    row("X16", "friction 1 and 10", ORIGIN, strong_friction),
    row("X17", "friction 1e6, used as glue", ORIGIN, glue),
    row("X18", "friction negative or not a number", OUTCOME, bad_friction),
    row("X19", "all loads zero", "u = 0", no_load),
    row("X20", "load exactly at the friction limit", ORIGIN, at_the_limit),
    row("X21", "load a billionth below and above the friction limit", ORIGIN, beside_the_limit),
    row("X22", "contact open, pulled by a displacement", "closed form: no traction", all_open),
    row("X23", "contact open, pulled by a traction", OUTCOME, pulled_off),
    row("X24", "a body held by contact and friction alone", "equilibrium", super::equilibrium::held),
    row("X25", "the same beyond the friction limit", "no equilibrium", super::equilibrium::sliding),
    row("X26", "the same without friction", OUTCOME, loose_block),
    row("X27", "nothing fixed, balanced loads", OUTCOME, nothing_fixed),
    row("X35", "not a number from an expression", OUTCOME, not_a_number),
    row("X41", "gap of 1e6 and 1e300", "closed form: no traction", wide_gap),
    row("X44", "a quadrature rule of negative or absurd degree", OUTCOME, bad_rule),
    row(
        "X46",
        "multipliers on nodes that are fixed on both sides",
        "the same without these multipliers",
        idle_multipliers,
    ),
    row("X47", "an exactly singular matrix", OUTCOME, singular),
    row("X48", "start from u = 0 at gamma = 1 to 1e3 E/h", "at most 12 iterations", bad_start),
    row("X51", "tolerance 0 and 1e-30", "stops at the rounding floor", no_tolerance),
    row(
        "X56",
        "p-Laplacian from a zero gradient: displaced start, with a warning",
        "closed form of a bar",
        zero_gradient,
    ),
    row("X59", "a mesh that needs more memory than any machine has", OUTCOME, too_large),
    row("X60", "a macro that uses itself, 1e5 nested parentheses", OUTCOME, nesting),
    row("X61", "CRLF, byte order mark, tabs, a minus sign that is not ASCII", OUTCOME, characters),
    row("X62", "loads of 1e-310", "finite numbers", subnormal_loads),
];

const ALL: [(&str, f64, &str); 3] =
    [(NITSCHE, 0.0, "Nitsche 0"), (NITSCHE, -1.0, "Nitsche -1"), (AUGMENTED, 0.0, "augmented Lagrangian")];

fn gamma(gamma0: f64) -> f64 {
    gamma0 * YOUNG / SIZE
}

/// Stick and slip by the methods that are exact, within a tolerance.
fn blocks(gamma0: f64, tolerance: f64) -> Case {
    let mut found = Vec::new();
    for (law, theta, name) in ALL {
        for (state, what) in [(STICK, "stick"), (SLIP, "slip")] {
            let solved = state.solve(law, gamma(gamma0), theta, &[]);
            found.push(state.compare(&format!("{name}, {what}"), solved, tolerance));
        }
    }
    merged(&format!("gamma = {gamma0:e} E/h"), found)
}

/// Compares, and asks that the run says it stopped at what rounding leaves, unless nothing was left at all.
fn down_to_the_floor(state: &State, name: &str, solved: Result<Solved, String>, tolerance: f64) -> Case {
    let history = solved.as_ref().ok().map(|s| &s.outcome.steps[0].history);
    let last = history.and_then(|h| h.iterations.last().map(|i| (h.stop, i.residual, i.floor)));
    let told = last.is_some_and(|(stop, left, floor)| left == 0.0 || stop == Some(Stop::Floor) && left <= floor);
    let ended = format!("stop, residual and floor are {last:?}");
    state.compare(name, solved, tolerance).require(told, ended)
}

/// True if something is claimed to be a solution.
fn claims(attempt: &Attempt) -> bool {
    attempt.solved.as_ref().is_some_and(|s| s.outcome.converged())
}

/// A case that must be refused with one message that has these words; a step marked as not converged has none.
fn refused(what: &str, attempt: &Attempt, words: &[&str]) -> Case {
    let message = attempt.messages.to_lowercase();
    let case = Case::new(what)
        .require(!claims(attempt), "claims a solution")
        .require(attempt.messages.matches("error[").count() <= 1, "more than one message");
    words.iter().fold(case, |case, w| {
        let first = attempt.messages.lines().next().unwrap_or("no message").to_owned();
        case.require(message.contains(&w.to_lowercase()), format!("does not say `{w}`: {first}"))
    })
}

/// A scene of the fault with changes.
fn fault(file: &str, edits: &[(&str, String)], params: &[(&str, f64)]) -> Attempt {
    let folder = examples().join("fault");
    match std::fs::read_to_string(folder.join(file)) {
        Ok(text) => attempt(&folder, text, edits, params),
        Err(error) => Attempt { solved: None, messages: error.to_string() },
    }
}

fn tiny_gamma() -> Vec<Case> {
    let mut cases = Vec::new();
    for theta in [0.0, -1.0] {
        let solved = STICK.solve(NITSCHE, gamma(1e-8), theta, &[]);
        cases.push(STICK.compare(&format!("Nitsche theta = {theta}"), solved, 1e-7));
    }
    let tried = STICK.attempt(NITSCHE, gamma(1e-8), 1.0, &[]);
    let right = tried.solved.as_ref().is_some_and(|s| !s.outcome.converged() || STICK.displacement_error(s) <= 1e-6);
    let honest = tried.solved.is_none() || right;
    cases.push(Case::new("Nitsche theta = 1: right or not converged").require(honest, "claims a wrong solution"));
    cases
}

fn usual_gamma() -> Vec<Case> {
    [1e-4, 1e-2, 1.0, 1e2, 1e4].map(|g| blocks(g, 1e-10)).to_vec()
}

fn large_gamma() -> Vec<Case> {
    let stiff = |theta: f64| {
        let name = format!("gamma = 1e8 E/h, Nitsche {theta}: says that it stopped at the floor");
        down_to_the_floor(&STICK, &name, STICK.solve(NITSCHE, gamma(1e8), theta, &[]), 1e-7)
    };
    vec![blocks(1e6, 1e-9), blocks(1e8, 1e-7), stiff(0.0), stiff(-1.0)]
}

fn huge_gamma() -> Vec<Case> {
    vec![blocks(1e10, 1e-5), blocks(1e12, 1e-3)]
}

fn bad_gamma() -> Vec<Case> {
    let numbers = [0.0, -1e5].map(|g| {
        refused(&format!("fault, gamma = {g}"), &fault("nitsche.wfl", &[], &[("gamma", g)]), &["`gamma` must be"])
    });
    let told = [
        ("1e999", ["`1e999` is too large", "param gamma = 1e999"]),
        ("0/0", ["division by zero", "param gamma = 0/0"]),
        ("sqrt(-1)", ["`gamma` is not a finite number", "param gamma = sqrt(-1)"]),
    ];
    let written = told.map(|(text, words)| {
        let edit = [("param gamma = 1e5", format!("param gamma = {text}"))];
        refused(&format!("fault, gamma = {text}"), &fault("nitsche.wfl", &edit, &[]), &words)
    });
    numbers.into_iter().chain(written).collect()
}

fn nearly_incompressible() -> Vec<Case> {
    [(NITSCHE, "Nitsche theta = 0"), (PENALTY, "penalty"), (AUGMENTED, "augmented Lagrangian")]
        .map(|(law, name)| {
            let gamma = gamma(2.0);
            let compliance = if law == PENALTY { 1.0 / gamma } else { 0.0 };
            let state = State { nu: 0.499_999_9, compliance, ..STICK };
            let made = state.solve(law, gamma, 0.0, &[]).and_then(converged).map(|solved| {
                let error = state.displacement_error(&solved);
                Case::new(name).compare("error of the displacement", error, 1e-7, Tolerance::AtMost)
            });
            or_failed(name, made)
        })
        .to_vec()
}

fn incompressible() -> Vec<Case> {
    let blocks = super::two_block::scene(NITSCHE).replace("param nu = 0.25", "param nu = 0.5");
    vec![
        refused("blocks", &attempt(&examples(), blocks, &[], &[]), &["division by zero", "(1+nu)*(1-2*nu)"]),
        refused("fault", &fault("nitsche.wfl", &[], &[("nu", 0.5)]), &["`nu` must be between"]),
    ]
}

fn bad_moduli() -> Vec<Case> {
    [("nu", -1.0), ("nu", -2.0), ("nu", 0.6), ("E", 0.0), ("E", -25e3)]
        .map(|(name, x)| {
            let words = format!("`{name}` must be between");
            refused(&format!("fault, {name} = {x}"), &fault("nitsche.wfl", &[], &[(name, x)]), &[&words])
        })
        .to_vec()
}

fn frictionless() -> Vec<Case> {
    let state = State { friction: 0.0, ..SLIP };
    ALL.map(|(law, theta, name)| {
        let with = state.solve(law, gamma(2.0), theta, &[]).and_then(converged);
        let edit =
            [(" + Ball_projection(Pt, fric*pos_part(Pn))", String::new()), ("param fric = 0.4\n", String::new())];
        let without = without_friction(&state, law, theta, &edit).and_then(converged);
        let made = with.and_then(|with| {
            let without = without?;
            let shear = with.measure(0, "tau_y").abs() + with.measure(0, "tau_z").abs();
            let (a, b) = (&with.outcome.steps[0].state, &without.outcome.steps[0].state);
            let gap = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / 1e-3;
            Ok(Case::new(name)
                .compare("tangential traction", shear, 0.0, Tolerance::Bitwise)
                .compare("error of the displacement", state.displacement_error(&with), 1e-11, Tolerance::AtMost)
                .compare("largest difference to the form without friction", gap, 1e-12, Tolerance::AtMost))
        });
        or_failed(name, made)
    })
    .to_vec()
}

/// The blocks by a form that has no friction at all.
fn without_friction(state: &State, law: &str, theta: f64, edits: &[(&str, String)]) -> Result<Solved, String> {
    let text = super::two_block::scene(law);
    let text = edits.iter().fold(text, |t, (from, to)| t.replace(from, to));
    let params: Vec<(&str, f64)> =
        state.params(law, gamma(2.0), theta).into_iter().filter(|(name, _)| *name != "fric").collect();
    let tried = attempt(&examples(), text, &[], &params);
    tried.solved.ok_or(tried.messages)
}

fn nearly_frictionless() -> Vec<Case> {
    let (none, some) = (State { friction: 0.0, ..SLIP }, State { friction: 1e-12, ..SLIP });
    ALL.map(|(law, theta, name)| {
        let solved = some.solve(law, gamma(2.0), theta, &[]).and_then(converged);
        let error = solved.map(|s| none.displacement_error(&s));
        let made = error.map(|e| Case::new(name).compare("difference to friction 0", e, 1e-10, Tolerance::AtMost));
        or_failed(name, made)
    })
    .to_vec()
}

fn with_friction(friction: f64) -> Case {
    let state = State { friction, ..STICK };
    let found = ALL.map(|(law, theta, name)| state.compare(name, state.solve(law, gamma(2.0), theta, &[]), 1e-11));
    merged(&format!("F = {friction}"), found.to_vec())
}

fn strong_friction() -> Vec<Case> {
    vec![with_friction(1.0), with_friction(10.0)]
}

fn glue() -> Vec<Case> {
    vec![with_friction(1e6)]
}

fn bad_friction() -> Vec<Case> {
    let negative =
        refused("fault, F = -0.1", &fault("nitsche.wfl", &[], &[("fric", -0.1)]), &["`fric` must be between"]);
    let written = ["0/0", "1e999"].map(|text| {
        let edit = [("param fric  = 0.4", format!("param fric  = {text}"))];
        refused(&format!("fault, F = {text}"), &fault("nitsche.wfl", &edit, &[]), &[&format!("param fric  = {text}")])
    });
    let part = [("Ball_projection(Pt, fric*", "Ball_projection(Pt, sqrt(z-0.5)*".to_owned())];
    let somewhere =
        refused("fault, F = sqrt(z - 0.5)", &fault("nitsche.wfl", &part, &[]), &["not a finite number", "`contact"]);
    std::iter::once(negative).chain(written).chain([somewhere]).collect()
}

fn no_load() -> Vec<Case> {
    let edits = [("[-3,0,0]", "[0,0,0]".to_owned()), ("[0,0,-t]", "[0,0,0]".to_owned())];
    ["nitsche.wfl", "penalty.wfl", "augmented_lagrangian.wfl"]
        .map(|file| {
            let tried = fault(file, &edits, &[]);
            let made = tried.solved.ok_or(tried.messages).and_then(converged).map(|s| {
                let largest = s.outcome.steps.iter().flat_map(|s| &s.state).fold(0.0f64, |m, x| m.max(x.abs()));
                let most = s.outcome.steps.iter().map(|s| s.history.n_iterations()).max().unwrap_or(usize::MAX);
                Case::new(file).compare("largest unknown", largest, 0.0, Tolerance::AtMost).compare(
                    "iterations",
                    most as f64,
                    1.0,
                    Tolerance::AtMost,
                )
            });
            or_failed(file, made)
        })
        .to_vec()
}

/// Shear up to a part of the limit of stick: dt = F p L/mu = 1.2e-3 along one direction.
fn sheared(part: f64) -> State {
    State { dt: [0.0, 1.2e-3 * part], ..STICK }
}

fn at_the_limit() -> Vec<Case> {
    let state = sheared(1.0);
    ALL.map(|(law, theta, name)| {
        let made = state.solve(law, gamma(2.0), theta, &[]).and_then(converged).map(|s| {
            Case::new(name)
                .compare("shear stress", s.measure(0, "tau_z").abs(), 4.0, Tolerance::Relative(1e-11))
                .compare("slip over shear", slip(&s) / 1.2e-3, 1e-12, Tolerance::AtMost)
                .compare("iterations", s.outcome.steps[0].history.n_iterations() as f64, 6.0, Tolerance::AtMost)
        });
        or_failed(name, made)
    })
    .to_vec()
}

/// Tangential jump at the middle of the interface.
fn slip(solved: &Solved) -> f64 {
    let (l, r) = (solved.at(0, "uL", [0.0, 0.5, 0.5]), solved.at(0, "uR", [0.0, 0.5, 0.5]));
    (l[1] - r[1]).hypot(l[2] - r[2])
}

fn beside_the_limit() -> Vec<Case> {
    let mut cases = Vec::new();
    for (law, theta, name) in ALL {
        for (part, expected) in [(1.0 + 1e-9, 1.2e-12), (1.0 - 1e-9, 0.0)] {
            let what = format!("{name}, {} the limit", if expected > 0.0 { "above" } else { "below" });
            let made = sheared(part).solve(law, gamma(2.0), theta, &[]).and_then(converged);
            // without slip: what rounding leaves, as at the limit
            let tolerance = Tolerance::Absolute(1.2e-15);
            cases.push(or_failed(&what, made.map(|s| Case::new(&what).compare("slip", slip(&s), expected, tolerance))));
        }
    }
    cases
}

/// The right block moves off by 1e-3 and by a shear; the left one stays as it is.
fn open_blocks(what: &str, edits: &[(&str, String)], dn: f64, gap: f64) -> Case {
    let state = State { dn, gap, dt: [1e-4, 2e-4], ..STICK };
    let found = [
        (NITSCHE, 0.0, "Nitsche 0"),
        (NITSCHE, -1.0, "Nitsche -1"),
        (PENALTY, 0.0, "penalty"),
        (AUGMENTED, 0.0, "augmented Lagrangian"),
    ]
    .map(|(law, theta, name)| {
        let text = super::two_block::scene(law)
            + "measure open_ = mean(if Pn < 0 then 1 else 0) on fault\nmeasure stress = max(Norm(sigma(uL))) on left\n";
        let text = edits.iter().fold(text, |t, (from, to)| t.replace(from, to));
        let mut params = state.params(law, gamma(2.0), theta);
        // the homogeneous state of the lateral faces: none on the left, moved by -dn on the right
        for (key, value) in [("p", 0.0), ("jn", dn), ("ty", 0.0), ("tz", 0.0)] {
            params.iter_mut().filter(|p| p.0 == key).for_each(|p| p.1 = value);
        }
        let tried = attempt(&examples(), text, &[], &params);
        let made = tried.solved.ok_or(tried.messages).and_then(converged).map(|s| {
            let traction = ["pressure", "tau_y", "tau_z"].map(|m| s.measure(0, m).abs()).iter().sum::<f64>();
            Case::new(name)
                .compare("traction", traction, 0.0, Tolerance::AtMost)
                .compare("open part", s.measure(0, "open_"), 1.0, Tolerance::Absolute(1e-14))
                .compare("stress on the left over E", s.measure(0, "stress") / YOUNG, 1e-12, Tolerance::AtMost)
                .compare("right block", s.at(0, "uR", [0.0, 0.5, 0.5])[0], -dn, Tolerance::Relative(1e-11))
        });
        or_failed(name, made)
    });
    merged(what, found.to_vec())
}

fn all_open() -> Vec<Case> {
    vec![open_blocks("pulled by 1e-3", &[], -1e-3, 0.0)]
}

fn wide_gap() -> Vec<Case> {
    vec![open_blocks("gap 1e6", &[], 1e-3, 1e6), open_blocks("gap 1e300", &[], 1e-3, 1e300)]
}

const LOOSE: (&str, &str) = ("fix  uL, uR = [0,0,0]  on bottom", "fix  uL = [0,0,0]  on bottom");

fn pulled_off() -> Vec<Case> {
    let edits = [
        (LOOSE.0, LOOSE.1.to_owned()),
        ("[-3,0,0]", "[3,0,0]".to_owned()),
        ("0 to 9.5 by 0.5", "0 to 0 by 1".to_owned()),
    ];
    ["nitsche.wfl", "penalty.wfl", "augmented_lagrangian.wfl"]
        .map(|file| refused(file, &fault(file, &edits, &[]), &["singular"]))
        .to_vec()
}

fn loose_block() -> Vec<Case> {
    let edits = [(LOOSE.0, LOOSE.1.to_owned()), ("0 to 9.5 by 0.5", "2 to 2 by 1".to_owned())];
    ["nitsche.wfl", "penalty.wfl", "augmented_lagrangian.wfl"]
        .map(|file| {
            refused(
                file,
                &fault(file, &edits, &[("fric", 0.0)]),
                &["step 0 (t = 2)", "nothing prevents 3 rigid body motions of `uR`"],
            )
        })
        .to_vec()
}

/// A small elastic block; `SIDE` is what happens to it.
const BLOCK: &str = "wfl 1
mesh box [0,0,0] to [1,1,1] cells [2,2,2] hex
region west = faces where x == 0
region east = faces where x == 1
unknown u : vector
def sigma(v) = Div_v*Id(3) + 2*Sym(Grad_v)
term elastic on all : sigma(u):Grad_Test_u
SIDE
";

fn block(side: &str) -> Attempt {
    attempt(&examples(), BLOCK.replace("SIDE", side), &[], &[])
}

fn nothing_fixed() -> Vec<Case> {
    let plane = "wfl 1\nmesh box [0,0] to [2,1] cells [4,2] quad\nregion bottom = faces where y == 0\nunknown u : vector\n\
                 term elastic on all : (Div_u*Id(2) + 2*Sym(Grad_u)):Grad_Test_u\nSIDE\n";
    let in_plane = |side: &str| attempt(&examples(), plane.replace("SIDE", side), &[], &[]);
    vec![
        refused(
            "a block pulled on both sides",
            &block("load u = [-1,0,0] on west\nload u = [1,0,0] on east"),
            &["nothing prevents 6 rigid body motions of `u` (3 translations, 3 rotations)"],
        ),
        refused(
            "a block on rollers",
            &block("fix u(1) = 0 on west\nload u = [1,0,0] on east"),
            &["nothing prevents 3 rigid body motions of `u` (2 translations, 1 rotation)"],
        ),
        refused(
            "a plate",
            &in_plane(""),
            &["nothing prevents 3 rigid body motions of `u` (2 translations, 1 rotation)"],
        ),
        refused(
            "a plate on rollers",
            &in_plane("fix u(2) = 0 on bottom"),
            &["nothing prevents 1 rigid body motion of `u` (1 translation)"],
        ),
    ]
}

fn not_a_number() -> Vec<Case> {
    ["sqrt(-1-x)", "1/(x-x)", "log(-y)", "exp(1000+x)"]
        .map(|e| {
            let tried = block(&format!("fix u = [0,0,0] on west\nload u = [{e},0,0] on east"));
            refused(e, &tried, &["not a finite number", "east"])
        })
        .to_vec()
}

fn bad_rule() -> Vec<Case> {
    ["degree -1", "degree 1.5", "degree 1000000"]
        .map(|rule| {
            let found = rule.replace("degree", "found");
            let tried = block(&format!("fix u = [0,0,0] on west\nload u = [1,0,0] on east\nquadrature on all {rule}"));
            refused(rule, &tried, &["the degree of a quadrature rule", &found])
        })
        .to_vec()
}

fn idle_multipliers() -> Vec<Case> {
    let tried = fault("augmented_lagrangian.wfl", &[("0 to 9.5 by 0.5", "6 to 6 by 1".to_owned())], &[]);
    let told = tried.messages.clone();
    let made = tried.solved.ok_or(tried.messages).and_then(converged).map(|s| {
        Case::new("fault held at the bottom on both sides")
            .require(told.contains("W404"), "the multipliers left out are not named")
            .require(s.outcome.steps[0].state.iter().all(|x| x.is_finite()), "not a number")
    });
    vec![or_failed("fault", made)]
}

fn singular() -> Vec<Case> {
    vec![refused(
        "a block that may slide along its fixed face",
        &block("fix u(1) = 0 on west\nload u = [0,1,0] on east"),
        &["singular"],
    )]
}

fn bad_start() -> Vec<Case> {
    [1.0, 1e1, 1e2, 1e3]
        .map(|g| {
            let made = ALL.map(|(law, theta, name)| {
                let solved = STICK.solve(law, gamma(g), theta, &[]).and_then(converged);
                or_failed(
                    name,
                    solved.map(|s| {
                        let n = s.outcome.steps[0].history.n_iterations();
                        Case::new(name).compare("iterations", n as f64, 12.0, Tolerance::AtMost)
                    }),
                )
            });
            merged(&format!("gamma = {g} E/h"), made.to_vec())
        })
        .to_vec()
}

fn no_tolerance() -> Vec<Case> {
    ["0", "1e-30"]
        .map(|tol| {
            let edit = [("tol=1e-13", format!("tol={tol}"))];
            let found = ALL.map(|(law, theta, name)| {
                down_to_the_floor(&STICK, name, STICK.solve(law, gamma(2.0), theta, &edit), 1e-11)
            });
            merged(&format!("tol = {tol}"), found.to_vec())
        })
        .to_vec()
}

/// A bar between two walls: on P1 the flux on each segment is 1/2 - x at its middle, and the slope its power 1/(p - 1),
/// by hand. The largest value is that at the integration point of the last segment, its middle.
fn zero_gradient() -> Vec<Case> {
    ["1.5", "3", "4"]
        .map(|p| {
            let text = format!(
                "wfl 1\nparam p = {p}\nmesh box [0] to [1] cells [16] segment\n\
                 unknown u : scalar P1\nterm flow on all : Norm(Grad_u)^(p-2)*(Grad_u.Grad_Test_u)\nload u = 1 on all\n\
                 fix u = 0 on boundary\nmeasure middle = max(u) on all\n"
            );
            let tried = attempt(&examples(), text, &[], &[]);
            let power = 1.0 / (p.parse::<f64>().unwrap_or(f64::NAN) - 1.0);
            let rise = |k: i32| (0.5 - (f64::from(k) + 0.5) / 16.0).powf(power) / 16.0;
            let exact = (0..7).map(rise).sum::<f64>() + 0.5 * rise(7);
            let made = tried.solved.ok_or(tried.messages).and_then(converged);
            let what = format!("p = {p}");
            let case = made.map(|s| {
                let told = doubts(&s.outcome).iter().any(|w| w.0 == "W607");
                let case = Case::new(&what).require(told, "does not say that it started from a displaced state");
                case.compare("in the middle", s.measure(0, "middle"), exact, Tolerance::Relative(1e-8))
            });
            or_failed(&what, case)
        })
        .to_vec()
}

fn too_large() -> Vec<Case> {
    let block = |n: &str| {
        let text = BLOCK.replace("SIDE", "fix u = [0,0,0] on west\nload u = [1,0,0] on east");
        attempt(&examples(), text.replace("[2,2,2]", n), &[], &[])
    };
    // 4e9 nodes can be numbered, but not held; ten times as many cannot be numbered
    vec![
        refused(
            "1600 x 1600 x 1600 cells",
            &block("[1600,1600,1600]"),
            &["E606", "the mesh needs about", "the limit is"],
        ),
        refused("4000 x 4000 x 4000 cells", &block("[4000,4000,4000]"), &["nodes, more than"]),
    ]
}

fn nesting() -> Vec<Case> {
    let deep = format!("{}x{}", "(".repeat(100_000), ")".repeat(100_000));
    vec![
        refused(
            "a macro that uses itself",
            &block("def f(a) = f(a) + 1\nload u = [f(x),0,0] on east"),
            &["`f` is defined by itself"],
        ),
        refused("1e5 parentheses", &block(&format!("load u = [{deep},0,0] on east")), &["nest"]),
    ]
}

fn characters() -> Vec<Case> {
    let side = "fix u = [0,0,0] on west\nload u = [1,0,0] on east";
    let text = BLOCK.replace("SIDE", side);
    let state = |t: String| {
        let tried = attempt(&examples(), t, &[], &[]);
        tried.solved.ok_or(tried.messages).and_then(converged).map(|s| s.outcome.steps[0].state.clone())
    };
    let plain = state(text.clone());
    let mut cases: Vec<Case> = [
        ("CRLF", text.replace('\n', "\r\n")),
        ("byte order mark", format!("\u{feff}{text}")),
        ("tabs", text.replace(" = ", "\t=\t")),
    ]
    .into_iter()
    .map(|(what, t)| {
        let same = plain.is_ok() && state(t) == plain;
        Case::new(what).require(same, "is not read as the plain text is")
    })
    .collect();
    let minus = attempt(&examples(), text.replace("[1,0,0]", "[\u{2212}1,0,0]"), &[], &[]);
    cases.push(refused("a minus sign that is not ASCII", &minus, &["scene.wfl:9:", "U+2212"]));
    cases
}

fn subnormal_loads() -> Vec<Case> {
    let edits = [("[-3,0,0]", "[-3e-310,0,0]".to_owned()), ("[0,0,-t]", "[0,0,-1e-310*t]".to_owned())];
    ["nitsche.wfl", "penalty.wfl", "augmented_lagrangian.wfl"]
        .map(|file| {
            let tried = fault(file, &edits, &[]);
            // a result, or an error that says why there is none
            let states = tried.solved.iter().flat_map(|s| &s.outcome.steps).flat_map(|s| &s.state);
            let finite = states.into_iter().all(|x| x.is_finite());
            // later steps may end at the last digit of the smallest numbers, and say so
            let solved = tried.solved.as_ref().is_some_and(|s| s.outcome.steps[0].history.converged());
            Case::new(file)
                .require(finite, "not a number")
                .require(solved, format!("no result: {}", tried.messages.lines().next().unwrap_or_default()))
        })
        .to_vec()
}
