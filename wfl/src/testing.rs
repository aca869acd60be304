//! What the tests of this crate share: the scenes of the language page, trees as text, a small random source.

use crate::{
    ast::{Argument, CmpOp, Cond, CondKind, Expr, ExprKind, MulOp},
    diag::Diagnostic,
    parse::parse_expr,
    source::SourceMap,
};

/// The five scenes of the language page.
pub(crate) const SCENES: &[(&str, &str)] = &[
    ("nitsche", include_str!("../testdata/nitsche.wfl")),
    ("penalty", include_str!("../testdata/penalty.wfl")),
    ("augmented", include_str!("../testdata/augmented.wfl")),
    ("hertz", include_str!("../testdata/hertz.wfl")),
    ("poisson", include_str!("../testdata/poisson.wfl")),
];

/// GWFL strings that GetFEM 5.4.2 reads.
pub(crate) const GWFL: &str = include_str!("../testdata/gwfl.txt");

/// Fully parenthesised text of an expression; brackets of its own make every grouping visible.
pub(crate) fn show(e: &Expr) -> String {
    match &e.kind {
        ExprKind::Number(x) => format!("{x}"),
        ExprKind::Name(n) => n.clone(),
        ExprKind::Sum(parts) => {
            let parts: Vec<String> =
                parts.iter().enumerate().map(|(i, (s, p))| format!("{}{}", sign(i, *s), show(p))).collect();
            format!("({})", parts.concat())
        }
        ExprKind::Product(a, rest) => {
            let rest: Vec<String> = rest.iter().map(|(o, _, b)| format!(" {} {}", mul(*o), show(b))).collect();
            format!("({}{})", show(a), rest.concat())
        }
        ExprKind::Negate(a) => format!("(-{})", show(a)),
        ExprKind::Power(a, b) => format!("({}^{})", show(a), show(b)),
        ExprKind::Transpose(a) => format!("({}')", show(a)),
        ExprKind::Call(f, args) => {
            let args: Vec<String> = args
                .iter()
                .map(|a| match a {
                    Argument::Slice(_) => ":".to_owned(),
                    Argument::Text(text, _) => format!("\"{text}\""),
                    Argument::Expr(e) => show(e),
                })
                .collect();
            format!("{}({})", show(f), args.join(","))
        }
        ExprKind::Tensor(rows) => {
            let rows: Vec<String> = rows.iter().map(|r| r.iter().map(show).collect::<Vec<_>>().join(",")).collect();
            format!("[{}]", rows.join(";"))
        }
        ExprKind::If(c, a, b) => format!("(if {} then {} else {})", show_cond(c), show(a), show(b)),
    }
}

pub(crate) fn show_cond(c: &Cond) -> String {
    let join = |parts: &[Cond], word: &str| parts.iter().map(show_cond).collect::<Vec<_>>().join(word);
    match &c.kind {
        CondKind::Compare(a, rest) => {
            let rest: Vec<String> = rest.iter().map(|(o, b)| format!("{}{}", cmp(*o), show(b))).collect();
            format!("{{{}{}}}", show(a), rest.concat())
        }
        CondKind::And(parts) => format!("{{{}}}", join(parts, " and ")),
        CondKind::Or(parts) => format!("{{{}}}", join(parts, " or ")),
        CondKind::Not(a) => format!("{{not {}}}", show_cond(a)),
    }
}

fn sign(i: usize, minus: bool) -> &'static str {
    match (i, minus) {
        (0, _) => "",
        (_, true) => " - ",
        (_, false) => " + ",
    }
}

fn mul(op: MulOp) -> &'static str {
    match op {
        MulOp::Times => "*",
        MulOp::Divide => "/",
        MulOp::Dot => ".",
        MulOp::DoubleDot => ":",
        MulOp::ByComponent => ".*",
        MulOp::DivideByComponent => "./",
        MulOp::Outer => "@",
    }
}

fn cmp(op: CmpOp) -> &'static str {
    match op {
        CmpOp::Less => "<",
        CmpOp::LessEqual => "<=",
        CmpOp::Greater => ">",
        CmpOp::GreaterEqual => ">=",
        CmpOp::Equal => "==",
        CmpOp::NotEqual => "!=",
    }
}

/// The tree of an expression, fully parenthesised, or the codes of its errors.
pub(crate) fn tree(text: &str) -> String {
    let mut sources = SourceMap::new();
    let id = sources.add("expression", text);
    let parsed = parse_expr(&sources, id);
    match parsed.value {
        Some(e) if parsed.diagnostics.is_empty() => show(&e),
        _ => codes(&parsed.diagnostics),
    }
}

pub(crate) fn codes(diagnostics: &[Diagnostic]) -> String {
    diagnostics.iter().map(|d| d.code.as_str()).collect::<Vec<_>>().join(" ")
}

/// xorshift64*: the same sequence everywhere, so a failing input can be found again.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        ((self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 33) as usize) % n.max(1)
    }
}

/// The entries of an expression in three dimensions, with a value of its own for every word, and with arbitrary
/// functions in place of the kinked ones: two expressions of equal value for such values are equal.
pub(crate) fn value(e: &Expr) -> Vec<f64> {
    match &e.kind {
        ExprKind::Number(x) => vec![*x],
        ExprKind::Name(word) => word_value(word, ""),
        ExprKind::Negate(a) => value(a).iter().map(|x| -x).collect(),
        ExprKind::Sum(parts) => {
            let mut sum = vec![0.0; value(&parts[0].1).len()];
            for (minus, part) in parts {
                let part = value(part);
                assert_eq!(part.len(), sum.len(), "shapes in {}", show(e));
                sum.iter_mut().zip(part).for_each(|(s, p)| *s += if *minus { -p } else { p });
            }
            sum
        }
        ExprKind::Product(first, rest) => rest.iter().fold(value(first), |a, (op, _, b)| product(a, *op, value(b))),
        ExprKind::Call(callee, arguments) => {
            let arguments: Vec<&Expr> =
                arguments.iter().filter_map(|a| if let Argument::Expr(e) = a { Some(e) } else { None }).collect();
            call(&show(callee), &arguments)
        }
        _ => panic!("no value for {}", show(e)),
    }
}

/// Numbers made of the letters of a word; scalars are the parameters of the scenes.
fn word_value(word: &str, there: &str) -> Vec<f64> {
    if let Some(field) = word.strip_prefix("Div_") {
        let g = word_value(&format!("Grad_{field}"), there);
        return vec![g[0] + g[4] + g[8]];
    }
    let scalar = ["E", "nu", "fric", "theta", "gamma"].contains(&word);
    let n = if scalar {
        1
    } else if word.starts_with("Grad_") {
        9
    } else {
        3
    };
    let seed = word.bytes().chain(there.bytes()).fold(7_u64, |h, b| h.wrapping_mul(0x100_0000_01b3) ^ u64::from(b));
    let mut random = Random(seed);
    (0..n).map(|_| 0.1 + random.below(1000) as f64 / 5000.0).collect()
}

fn product(a: Vec<f64>, op: MulOp, b: Vec<f64>) -> Vec<f64> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    match (op, a.len(), b.len()) {
        (MulOp::Times, 1, _) => b.iter().map(|x| a[0] * x).collect(),
        (MulOp::Times, _, 1) => a.iter().map(|x| b[0] * x).collect(),
        (MulOp::Divide, _, 1) => a.iter().map(|x| x / b[0]).collect(),
        (MulOp::Times, 9, 3) => a.chunks(3).map(|row| dot(row, &b)).collect(),
        (MulOp::Dot, 3, 3) | (MulOp::DoubleDot, 9, 9) => vec![dot(&a, &b)],
        shapes => panic!("no product {shapes:?}"),
    }
}

fn call(name: &str, arguments: &[&Expr]) -> Vec<f64> {
    if name == "Interpolate" {
        return word_value(&show(arguments[0]), "there");
    }
    let a = value(arguments[0]);
    match name {
        "Id" => (0..9).map(|i| f64::from(u8::from(i % 4 == 0))).collect(),
        "Sym" => (0..9).map(|i| 0.5 * (a[i] + a[i % 3 * 3 + i / 3])).collect(),
        "pos_part" => vec![a[0] + 0.3 * a[0] * a[0]],
        "Ball_projection" => {
            let r = value(arguments[1])[0];
            a.iter().map(|x| x * (1.0 + 0.2 * r) + 0.1 * r * x * x).collect()
        }
        _ => panic!("no function {name}"),
    }
}
