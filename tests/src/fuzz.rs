//! Inputs that nobody would write, and what must hold for each: no panic, no endless run, no overflow of the stack.
//!
//! One generator serves three users: the property tests, the program `fuzz` that runs millions of inputs, and the
//! targets of cargo-fuzz. Texts are mutated examples, soups of words of the language, nesting bombs and raw bytes.

pub mod files;

use std::collections::BTreeMap;

use wfl::{Diagnostic, Expander, NoFiles, SourceMap, format, parse_gwfl, render, resolve};
use wfl_compiler::{
    Constant, Env, TermSource, compile_term,
    types::{EntityGeometry, FieldKind, FieldSig, PlaceKind, PlaceSig, Shape},
};

/// A small source of pseudo-random numbers (splitmix64); the same seed gives the same inputs on every machine.
#[derive(Clone, Copy, Debug)]
pub struct Random(pub u64);

impl Random {
    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number from 0 to `n - 1`.
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() >> 11) as usize % n.max(1)
    }

    fn pick<'t, T: ?Sized>(&mut self, list: &[&'t T]) -> &'t T {
        list[self.below(list.len())]
    }
}

/// Every example scene and the library, the seeds of mutation.
pub const SEEDS: &[&str] = &[
    include_str!("../../examples/fault/fault.wfl"),
    include_str!("../../examples/fault/nitsche.wfl"),
    include_str!("../../examples/fault/penalty.wfl"),
    include_str!("../../examples/fault/augmented_lagrangian.wfl"),
    include_str!("../../examples/hertz/hertz.wfl"),
    include_str!("../../examples/hyperelastic/contact.wfl"),
    include_str!("../../examples/interface/cohesive.wfl"),
    include_str!("../../examples/plaplace/plaplace.wfl"),
    include_str!("../../examples/poisson/poisson.wfl"),
    include_str!("../../examples/signorini/signorini.wfl"),
    include_str!("../../examples/stokes/stokes.wfl"),
    include_str!("../../examples/friction/tresca.wfl"),
    include_str!("../../wfl/std/contact.wfl"),
];

const WORDS: &[&str] = &[
    "mesh",
    "box",
    "to",
    "cells",
    "hex",
    "quad",
    "map",
    "region",
    "interface",
    "from",
    "faces",
    "nodes",
    "of",
    "where",
    "param",
    "in",
    "unknown",
    "vector",
    "scalar",
    "matrix",
    "global",
    "P2",
    "Q1",
    "on",
    "multiplier",
    "data",
    "state",
    ":=",
    "def",
    "term",
    "energy",
    "Def",
    "fix",
    "load",
    "start",
    "steps",
    "t",
    "by",
    "with",
    "scheme",
    "solver",
    "newton",
    "refine",
    "times",
    "quadrature",
    "degree",
    "vertex",
    "measure",
    "mean",
    "max",
    "integral",
    "expect",
    "output",
    "vtk",
    "csv",
    "along",
    "towards",
    "as",
    "use",
    "wfl",
    "if",
    "then",
    "else",
    "and",
    "or",
    "not",
    "u",
    "v",
    "p",
    "Test_u",
    "Grad_u",
    "Grad_Test_u",
    "Div_u",
    "Hess_u",
    "Previous_u",
    "Interpolate",
    "neighbor_element",
    "Normal",
    "X",
    "x",
    "y",
    "z",
    "pi",
    "sigma",
    "(",
    ")",
    "[",
    "]",
    "{",
    "}",
    "+",
    "-",
    "*",
    "/",
    ".",
    ":",
    "@",
    ".*",
    "./",
    "^",
    "'",
    ",",
    ";",
    "=",
    "==",
    "<=",
    "!=",
    "<",
    "..",
    "**",
    "&&",
    "\"",
    "#",
    "1",
    "2",
    "0.5",
    "1e5",
    "1e308",
    "1e-320",
    "0",
    "99999999999",
    "\n",
    "\n ",
    " ",
    "  ",
    "\t",
    "\r\n",
    "\u{2212}",
    "\u{0}",
    "é",
    "[mm]",
    "MPa",
];

/// A text for the parser.
#[must_use]
pub fn text(random: &mut Random) -> String {
    match random.below(50) {
        0..=27 => mutated(random),
        28..=45 => {
            let n = 1 + random.below(30);
            let mut out = String::new();
            for _ in 0..n {
                out.push_str(random.pick(WORDS));
                out.push_str(random.pick(&["", " ", " ", "\n"]));
            }
            out
        }
        46 => bomb(random),
        _ => {
            let n = random.below(80);
            let bytes: Vec<u8> = (0..n).map(|_| random.below(256) as u8).collect();
            String::from_utf8_lossy(&bytes).into_owned()
        }
    }
}

/// A few statements of an example with words or letters changed.
fn mutated(random: &mut Random) -> String {
    let seed = random.pick(SEEDS);
    let lines: Vec<&str> = seed.lines().collect();
    let first = random.below(lines.len());
    let count = 1 + random.below(5);
    let mut out = lines[first..lines.len().min(first + count)].join("\n");
    for _ in 0..1 + random.below(4) {
        let mut at = random.below(out.len() + 1);
        while !out.is_char_boundary(at) {
            at -= 1;
        }
        let end = (at + random.below(8)).min(out.len());
        match random.below(4) {
            0 => out.insert_str(at, random.pick(WORDS)),
            1 if out.is_char_boundary(end) => out.replace_range(at..end, ""),
            2 if out.is_char_boundary(end) => out.replace_range(at..end, random.pick(WORDS)),
            _ => {
                let line = random.pick(&lines).to_owned();
                out.insert_str(at, &line);
            }
        }
    }
    out
}

/// Something repeated many times: brackets, operators, macros of macros.
fn bomb(random: &mut Random) -> String {
    let n = 1 + random.below(3000);
    let (open, close) =
        [("(", ")"), ("[", "]"), ("-", ""), ("sin(", ")"), ("if x<1 then ", " else 2"), ("x^", ""), ("not (", ")")]
            [random.below(7)];
    match random.below(5) {
        0 => format!("def a = {}x{}", open.repeat(n), close.repeat(n)),
        1 => format!("def a = {}x", open.repeat(n)),
        2 => format!("term on all : {}u", random.pick(&["u+", "u*", "u.", "u:", "u@", "Test_u "]).repeat(n)),
        3 => {
            let mut out = String::from("def f0(a) = a + a\n");
            // the largest ones expand to a million parts: they are rare
            let levels = if random.below(50) == 0 { 25 } else { 10 };
            for k in 1..1 + random.below(levels) {
                out.push_str(&format!("def f{k}(a) = f{}(a){}f{}(a)\n", k - 1, random.pick(&["+", "*", "."]), k - 1));
            }
            out.push_str("term on all : f20(u)\n");
            out
        }
        _ => format!("region a = {}all{}", "(".repeat(n), ")".repeat(random.below(n + 1))),
    }
}

/// An expression for the compiler: mostly well formed, of any shapes.
#[must_use]
pub fn expression(random: &mut Random) -> String {
    // most are small, a few are large
    let depth = 1 + random.below(4) + 2 * usize::from(random.below(50) == 0);
    let mut out = String::new();
    grow(random, depth, &mut out);
    if random.below(3) > 0 {
        let test = ["*Test_p", ".Test_u", ":Grad_Test_u", "*Test_d", ".Interpolate(Test_u, neighbor_element)"];
        out = format!("({out}){}", random.pick(&test));
    }
    if random.below(8) == 0 && !out.is_empty() {
        let at = random.below(out.len());
        if out.is_char_boundary(at) {
            out.insert_str(at, random.pick(WORDS));
        }
    }
    out
}

const LEAVES: &[&str] = &[
    "u",
    "p",
    "d",
    "k",
    "v9",
    "m3",
    "X",
    "Normal",
    "1",
    "2.5",
    "0",
    "1e300",
    "1e-300",
    "Grad_u",
    "Grad_p",
    "Hess_u",
    "Hess_p",
    "Div_u",
    "Test_u",
    "Test_p",
    "Grad_Test_u",
    "Test2_u",
    "Previous_u",
    "Dot_p",
    "Id(3)",
    "Id(meshdim)",
    "[1,2,3]",
    "[[1,2],[3,4]]",
    "[u(1), p, 3]",
    "element_size",
    "element_K",
    "element_B",
    "pi",
    "t",
    "timestep",
    "x",
    "z",
    "Interpolate(u, neighbor_element)",
    "Interpolate(Grad_u, neighbor_element)",
    "Interpolate(Normal, neighbor_element)",
    "u(1)",
    "Grad_u(1,:)",
    "Grad_u(:,2)",
    "Grad_u'",
    "gamma",
    "nothing",
    "qdim(u)",
    "Reshape(Grad_u,9)",
    "Id(60000)",
    "Reshape(v9,3,3)",
    "v9@v9",
    "Grad_u@Grad_u",
];

fn grow(random: &mut Random, depth: usize, out: &mut String) {
    if depth == 0 || random.below(6) == 0 {
        out.push_str(random.pick(LEAVES));
        return;
    }
    let functions: Vec<&wfl_compiler::OpDef> = wfl_compiler::functions().collect();
    match random.below(9) {
        0..=3 => {
            out.push('(');
            grow(random, depth - 1, out);
            out.push(')');
            out.push_str(random.pick(&["+", "-", "*", ".", ":", "@", ".*", "./", "/", "^", " + ", "*"]));
            out.push('(');
            grow(random, depth - 1, out);
            out.push(')');
        }
        4..=6 => {
            let op = functions[random.below(functions.len())];
            // as many arguments as its use shows, sometimes another number
            let shown = op.usage.matches(',').count() + 1;
            let n = if random.below(10) == 0 { 1 + random.below(5) } else { shown };
            out.push_str(op.name);
            out.push('(');
            for k in 0..n {
                out.push_str(if k == 0 { "" } else { ", " });
                grow(random, depth - 1, out);
            }
            out.push(')');
        }
        7 => {
            out.push_str("(if ");
            grow(random, depth - 1, out);
            out.push_str(random.pick(&["<", ">=", "==", "!="]));
            grow(random, depth - 1, out);
            out.push_str(" then ");
            grow(random, depth - 1, out);
            out.push_str(" else ");
            grow(random, depth - 1, out);
            out.push(')');
        }
        _ => {
            out.push_str(random.pick(&["-", "Diff(", "Grad(", "Derivative_sin(", "[", "Def f(a):=a*a; f("]));
            grow(random, depth - 1, out);
            out.push_str(random.pick(&["", ",u)", ",p)", ")", "]", ", 2]"]));
        }
    }
}

/// Reads, resolves and formats a text, and shows every message.
///
/// # Panics
/// If the formatted text is not a fixed point of the formatter.
pub fn run_text(text: &str) {
    let mut sources = SourceMap::new();
    let id = sources.add("fuzz.wfl", text);
    show(&resolve(&mut sources, id, &mut NoFiles, &[]).diagnostics, &sources);
    if let Some(once) = format(&sources, id).value {
        let again = sources.add("formatted.wfl", once.as_str());
        assert_eq!(format(&sources, again).value.as_ref(), Some(&once), "formatting twice changes {text:?}");
    }
}

/// Compiles an expression on cells, faces or an interface, and shows every message.
pub fn run_expression(text: &str, choice: usize) {
    let mut sources = SourceMap::new();
    let id = sources.add("fuzz", text);
    let parsed = parse_gwfl(&sources, id);
    show(&parsed.diagnostics, &sources);
    let Some((locals, expr)) = parsed.value else { return };
    let mut expander = Expander::new(&sources, []);
    let expanded = expander.expr_with(&expr, &locals);
    show(&expander.diagnostics, &sources);
    let Some(expr) = expanded else { return };
    let dim = 1 + choice % 3;
    let field = |name: &str, shape, kind, global| FieldSig {
        name: name.to_owned(),
        shape,
        degree: 2,
        kind,
        global,
        on_faces: false,
    };
    let fields = [
        field("u", Shape::vector(dim), FieldKind::Unknown, false),
        field("p", Shape::SCALAR, FieldKind::Unknown, false),
        field("d", Shape::SCALAR, FieldKind::Unknown, true),
        field("k", Shape::SCALAR, FieldKind::Data, false),
        field("v9", Shape::vector(9), FieldKind::Multiplier, false),
        field("m3", Shape::matrix(dim, dim), FieldKind::Unknown, false),
    ];
    let gamma = Constant { shape: Shape::SCALAR, values: vec![1e5], declared: None };
    let params = BTreeMap::from([("gamma".to_owned(), gamma)]);
    let env = Env {
        dim,
        fields: &fields,
        mappings: &[],
        params: &params,
        expansions: &expander.expansions,
        step_variable: Some("t"),
        rates: &[],
        tables: &[],
        equal_within: 0.0,
    };
    let kind = [PlaceKind::Cells, PlaceKind::Facets, PlaceKind::Interface, PlaceKind::Global][choice / 3 % 4];
    let place = PlaceSig {
        name: "place".to_owned(),
        kind,
        here: vec![kind != PlaceKind::Global; fields.len()],
        there: vec![kind == PlaceKind::Interface; fields.len()],
        entities: vec![EntityGeometry { tensor: choice.is_multiple_of(2), dim: 1 + choice % 3, order: choice / 2 % 3 }],
        description: "a region of the fuzzer".to_owned(),
        here_name: None,
        inside: false,
    };
    let source = if (choice / 12).is_multiple_of(3) { TermSource::Energy(&expr) } else { TermSource::Residual(&expr) };
    let compiled = compile_term(&env, &place, "fuzz", source);
    show(&compiled.diagnostics, &sources);
    assert!(compiled.value.is_some() || !compiled.diagnostics.is_empty(), "nothing came out, and no message: {text:?}");
}

fn show(diagnostics: &[Diagnostic], sources: &SourceMap) {
    for d in diagnostics {
        assert!(wfl::explain(d.code.as_str()).is_some(), "{} has no page", d.code);
        assert!(render(d, sources).contains(d.code.as_str()), "{d:?}");
    }
}
