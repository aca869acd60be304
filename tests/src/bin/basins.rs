//! Does Newton stay in the basin of the equilibrium that the loads lead to? Random indentations, compressions and shears of
//! hyperelastic bodies with contact, each in several schedules of steps.
//!
//! `cargo run --release -p wfl-tests --bin basins -- 300` solves so many scenes and prints how many runs end with another
//! energy than continuation in forty steps finds (undamped and searched, that with less energy), how many do not converge, and how many scenes have no
//! such reference; with a second number it begins at that scene. The count of wrong runs that are told nothing of is the exit
//! code.

use std::io::Write as _;

use wfl_tests::{Attempt, Sequence, attempt, doubts, examples};

/// Schedules of one load, from 0 or a small part to 1.
const SCHEDULES: [&str; 6] =
    ["1 to 1 by 1", "0 to 1 by 1", "0 to 1 by 0.5", "0 to 1 by 0.25", "0.1 to 1 by 0.9", "0 to 1 by 0.1"];
/// The steps of the reference.
const FINE: &str = "0.025 to 1 by 0.025";
/// What an energy may differ by: the same equations have the same solution. With friction on the increment of a step it
/// depends on the steps.
const SAME: f64 = 1e-4;
const SAME_WITH_FRICTION: f64 = 0.3;

/// A number between two ends, and between them in orders of magnitude.
fn between(random: &mut Sequence, low: f64, high: f64) -> f64 {
    low + (high - low) * 0.5 * (random.number() + 1.0)
}

fn order(random: &mut Sequence, low: f64, high: f64) -> f64 {
    10f64.powf(between(random, low, high))
}

fn pick(random: &mut Sequence, all: &[&'static str]) -> &'static str {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in a short list")]
    let at = between(random, 0.0, all.len() as f64) as usize;
    all[at.min(all.len() - 1)]
}

/// A scene without its steps.
struct Scene {
    text: String,
    about: String,
    friction: bool,
}

/// The energy of a volume, and the stress, of a law.
fn law(name: &str, dim: usize) -> (String, String) {
    let trace = if dim == 2 { "(Trace(C) + 1)" } else { "Trace(C)" };
    let shear = format!("mu/2*(Trace(C) - {dim} - 2*log(J))");
    match name {
        "logarithmic" => {
            (format!("{shear} + lambda/2*sqr(log(J))"), "mu*(F - Inv(F)') + lambda*log(J)*Inv(F)'".to_owned())
        }
        "simo" => (
            format!("{shear} + lambda/4*(sqr(J) - 1 - 2*log(J))"),
            "mu*(F - Inv(F)') + lambda/2*(sqr(J) - 1)*Inv(F)'".to_owned(),
        ),
        "quadratic" => {
            (format!("{shear} + lambda/2*sqr(J - 1)"), "mu*(F - Inv(F)') + lambda*(J - 1)*J*Inv(F)'".to_owned())
        }
        "isochoric" => (
            format!("mu/2*({trace}*exp(-2/3*log(J)) - 3) + (lambda/2 + mu/3)*sqr(J - 1)"),
            format!("mu*exp(-2/3*log(J))*(F - {trace}/3*Inv(F)') + (lambda + 2*mu/3)*(J - 1)*J*Inv(F)'"),
        ),
        _ => (
            format!("lambda/8*sqr(Trace(C - Id({dim}))) + mu/4*Norm_sqr(C - Id({dim}))"),
            format!("F*(lambda/2*Trace(C - Id({dim}))*Id({dim}) + mu*(C - Id({dim})))"),
        ),
    }
}

/// A vector of the space from its first and its last entry.
fn vector(dim: usize, first: &str, last: &str) -> String {
    if dim == 2 { format!("[{first}, {last}]") } else { format!("[{first}, 0, {last}]") }
}

/// What a scene is made of.
struct Choice {
    random: Sequence,
    dim: usize,
    law: &'static str,
    mesh: (&'static str, &'static str),
    kind: &'static str,
    method: &'static str,
    n: usize,
    friction: bool,
}

fn choose(number: u64) -> Choice {
    let mut random = Sequence(0x9e37_79b9_7f4a_7c15 ^ (number + 1).wrapping_mul(0xbf58_476d_1ce4_e5b9));
    for _ in 0..4 {
        let _ = random.number();
    }
    let r = &mut random;
    let dim = if between(r, 0.0, 1.0) < 0.75 { 2 } else { 3 };
    let law = pick(r, &["logarithmic", "simo", "quadratic", "isochoric", "saint-venant"]);
    let mesh = match (dim, pick(r, &["a", "b", "c", "d"])) {
        (2, "a") => ("quad", "Q1"),
        (2, "b") => ("quad", "Q2"),
        (2, "c") => ("tri", "P1"),
        (2, _) => ("tri", "P2"),
        (_, "a" | "b") => ("hex", "Q1"),
        (_, "c") => ("tet", "P1"),
        _ => ("tet", "P2"),
    };
    let kind = pick(r, &["circle", "circle", "plane", "incline", "shear", "lid"]);
    let method = pick(r, &["penalty", "energy", "nitsche"]);
    let n = pick(r, if dim == 2 { &["8", "10", "14"] } else { &["3", "4"] }).parse::<usize>().expect("a number");
    let n = if mesh.1.ends_with('2') { n.div_ceil(2) } else { n };
    let friction = method != "energy" && pick(r, &["no", "no", "yes"]) == "yes";
    Choice { random, dim, law, mesh, kind, method, n, friction }
}

fn scene(number: u64) -> Scene {
    let mut choice = choose(number);
    let (r, dim, n) = (&mut choice.random, choice.dim, choice.n);
    let (mu, size) = (order(r, -3.0, 3.0), order(r, -2.0, 2.0));
    let lambda = mu * order(r, -0.3, 1.2);
    let most = if choice.law == "saint-venant" { 0.06 } else { 0.15 };
    let depth = size * if choice.kind == "circle" { between(r, 0.01, 0.08) } else { between(r, 0.03, most) };
    #[expect(clippy::cast_precision_loss, reason = "a small number")]
    let gamma = order(r, 0.5, 3.0) * (mu + lambda) * n as f64 / size;
    let radius = size * between(r, 0.4, 2.0);
    let (stored, stress) = law(choice.law, dim);
    let (cell, element) = choice.mesh;
    let box_ = match dim {
        2 => format!("mesh box [0,-L] to [1.5*L,0] cells [{},{n}] {cell}\n", n + n / 2),
        _ => format!("mesh box [0,0,-L] to [L,L,0] cells [{n},{n},{n}] {cell}\n"),
    };
    let up = if dim == 2 { "y" } else { "z" };
    let mut text = format!(
        "param mu = {mu:e}\nparam lambda = {lambda:e}\nparam L = {size:e}\nparam R = {radius:e}\nparam depth = {depth:e}\n\
         param gamma = {gamma:e}\nparam fric = 0.3\n{box_}unknown u : vector {element}\ndef F = Id({dim}) + Grad_u\n\
         def J = Det(F)\ndef C = F'*F\ndef W = {stored}\ndef P = {stress}\nregion base = faces where {up} == -L\n\
         region top = faces where {up} == 0\nenergy stored on all : W\nmeasure stored = integral(W) on all\n"
    );
    text += &obstacle(choice.kind, dim, &mut choice.random);
    text += &held_and_pressed(&choice);
    let friction = if choice.friction { " friction" } else { "" };
    let about = format!("{dim}-D {element} {} {} {}{friction}", choice.law, choice.kind, choice.method);
    Scene { text, about, friction: choice.friction }
}

/// What is prescribed, and the contact term.
fn held_and_pressed(choice: &Choice) -> String {
    let Choice { dim, kind, method, friction, .. } = *choice;
    let is_lid = kind == "lid";
    let (contact, held) = if is_lid { ("base", "top") } else { ("top", "base") };
    let motion = match (is_lid, friction) {
        (true, true) => vector(dim, "0.3*depth*t", "-depth*t"),
        (true, false) => vector(dim, "0", "-depth*t"),
        (false, _) => vector(dim, "0", "0"),
    };
    let mut text = format!("fix u = {motion} on {held}\n");
    if is_lid && !friction {
        text += "region axis = faces where x == 0\nfix u(1) = 0 on axis\n";
    }
    let traction = if method == "nitsche" { " - (P*Normal).N" } else { "" };
    let slip = if friction { " + Ball_projection(gamma*tang(u - Previous_u), fric*pos_part(Pn))" } else { "" };
    text += &match method {
        "energy" => format!("energy contact on {contact} : gamma/2*sqr(pos_part(-gap))\n"),
        _ => format!(
            "def tang(w) = w - (w.N)*N\ndef Pn = -gamma*gap{traction}\n\
             term contact on {contact} : (pos_part(Pn)*N{slip}).Test_u\n"
        ),
    };
    text
}

/// What is pressed into the top, or the floor: its `gap` and the direction `N` of its pressure against the body.
fn obstacle(kind: &str, dim: usize, r: &mut Sequence) -> String {
    let place = if dim == 2 { "(y + u(2))" } else { "(z + u(3))" };
    match kind {
        "circle" | "shear" => {
            let along = if kind == "shear" { " + depth*max(t - 0.5, 0)" } else { "" };
            let centre = format!("{:.3}*L{along}", between(r, 0.0, 0.7));
            let centre =
                if dim == 2 { format!("[{centre}, R - depth*t]") } else { format!("[{centre}, 0.5*L, R - depth*t]") };
            format!("def d = X + u - {centre}\ndef gap = Norm(d) - R\ndef N = -Normalized(d)\n")
        }
        "plane" => format!("def gap = -depth*t - {place}\ndef N = {}\n", vector(dim, "0", "1")),
        "incline" => {
            let slope = between(r, 0.05, 0.3);
            let length = (1.0 + slope * slope).sqrt();
            let normal = vector(dim, &format!("{:e}", -slope / length), &format!("{:e}", 1.0 / length));
            format!("def gap = ({slope:e}*(x + u(1)) - depth*t - {place})/{length:e}\ndef N = {normal}\n")
        }
        _ => format!("def gap = {place} + L\ndef N = {}\n", vector(dim, "0", "-1")),
    }
}

/// The energy at the end of a run, `None` where it has none; and what was said.
fn energy(scene: &Scene, steps: &str, more: &str) -> (Option<f64>, usize, String) {
    let text = format!("{}steps t = {steps}\n{more}", scene.text);
    let Attempt { solved, messages } = attempt(&examples(), text, &[], &[]);
    let Some(solved) = solved else { return (None, 0, messages) };
    let (steps, warnings) = (&solved.outcome.steps, doubts(&solved.outcome));
    let iterations = steps.iter().map(wfl_run::StepResult::iterations).sum();
    let codes: Vec<&str> = warnings.iter().map(|(code, _)| *code).collect();
    let last = steps.last().filter(|_| solved.outcome.converged());
    let stored = last.and_then(|s| s.measures.iter().find(|(name, _)| name == "stored"));
    (stored.map(|(_, value)| *value).filter(|value| value.is_finite()), iterations, codes.join(" "))
}

fn main() -> std::process::ExitCode {
    let mut words = std::env::args().skip(1).filter_map(|word| word.parse::<u64>().ok());
    let (count, first) = (words.next().unwrap_or(300), words.next().unwrap_or(0));
    let mut out = std::io::stdout().lock();
    let (mut runs, mut wrong, mut silent, mut failed, mut without, mut iterations) = (0, 0, 0, 0, 0, 0);
    for number in first..first + count {
        let scene = scene(number);
        // of two continuations the one with less energy: undamped Newton leaves basins, too
        let fine = ["solver newton with search=none, tol=1e-8\n", "solver newton with tol=1e-8\n"];
        let found = fine.iter().filter_map(|more| energy(&scene, FINE, more).0);
        let Some(reference) = found.reduce(f64::min) else {
            without += 1;
            continue;
        };
        let same = if scene.friction { SAME_WITH_FRICTION } else { SAME };
        for steps in SCHEDULES {
            let (found, spent, told) = energy(&scene, steps, "");
            (runs, iterations) = (runs + 1, iterations + spent);
            let what = match found {
                Some(stored) if (stored - reference).abs() <= same * reference.abs() => continue,
                Some(stored) => {
                    wrong += 1;
                    silent += u8::from(!["W616", "W640", "W641"].iter().any(|code| told.contains(code)));
                    format!("energy {stored:.6e} for {reference:.6e}")
                }
                None => {
                    failed += 1;
                    "does not converge".to_owned()
                }
            };
            let short: String = told.chars().take(80).collect();
            let _ = writeln!(
                out,
                "{number}: {}, {steps}: {what}, {spent} iterations, {}",
                scene.about,
                short.replace('\n', " ")
            );
        }
    }
    let _ = writeln!(
        out,
        "{count} scenes, {without} without a reference; {runs} runs, {iterations} iterations: {wrong} with another energy \
         ({silent} of them not told), {failed} that do not converge"
    );
    std::process::ExitCode::from(silent)
}
