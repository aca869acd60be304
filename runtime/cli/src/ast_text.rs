//! Statements as they were read: each with its place, its expressions as indented trees.

use std::fmt::Write as _;

use wfl::{
    SourceMap, Span,
    ast::{Argument, Cond, CondKind, Expr, ExprKind, Item, ItemKind, MulOp, OptionValue},
    parse,
};

/// The trees of all texts of a scene, included files behind the scene itself.
pub(crate) fn text(sources: &SourceMap) -> String {
    let mut out = String::new();
    for (id, source) in sources.iter().filter(|(_, s)| !s.name.starts_with('(')) {
        let _ = writeln!(out, "{}", source.name);
        for item in parse(sources, id).value.map(|s| s.items).unwrap_or_default() {
            statement(sources, &item, &mut out);
        }
        out.push('\n');
    }
    out
}

fn one_line(sources: &SourceMap, span: Span) -> String {
    let text = sources.snippet(span).lines().map(|l| l.split('#').next().unwrap_or(l));
    text.flat_map(str::split_whitespace).collect::<Vec<_>>().join(" ")
}

fn statement(sources: &SourceMap, item: &Item, out: &mut String) {
    let (line, _) = sources.line_column(item.span);
    let _ = writeln!(out, "  line {line}: {}", one_line(sources, item.span));
    let mut part = |name: &str, e: &Expr| {
        let _ = writeln!(out, "    {name}");
        tree(e, 3, "", out);
    };
    match &item.kind {
        ItemKind::Param { value, .. } | ItemKind::Start { value, .. } => part("value", value),
        ItemKind::Fix { value, .. } | ItemKind::Load { value, .. } => part("value", value),
        ItemKind::Data { value: Some(OptionValue::Expr(value)), .. } => part("value", value),
        ItemKind::State { update, .. } => part("update", update),
        ItemKind::Mesh { map: Some(map), .. } => part("map", map),
        ItemKind::Def(d) => part("body", &d.body),
        ItemKind::Measure { expr, .. } | ItemKind::Computed(_, expr, _) => part("of", expr),
        ItemKind::Term { defs, expr, .. } => {
            for d in defs {
                part(&format!("Def {}", d.name.name), &d.body);
            }
            part("integrand", expr);
        }
        ItemKind::Steps { from, to, by, .. } => {
            for (name, e) in [("from", from), ("to", to), ("by", by)] {
                part(name, e);
            }
        }
        ItemKind::Output { items, .. } => {
            for i in items {
                part(i.name.as_ref().map_or("quantity", |n| n.name.as_str()), &i.expr);
            }
        }
        ItemKind::Expect(c) | ItemKind::Event { condition: c, .. } => condition(c, 2, out),
        _ => {}
    }
}

/// One node a line, operands below it; `mark` is the operator that stands before the node.
fn tree(e: &Expr, depth: usize, mark: &str, out: &mut String) {
    let indent = "  ".repeat(depth);
    let mut head = |text: &str| {
        let _ = writeln!(out, "{indent}{mark}{text}");
    };
    match &e.kind {
        ExprKind::Number(x) => head(&format!("{x:?}")),
        ExprKind::Name(n) => head(n),
        ExprKind::Sum(parts) => {
            head("sum");
            parts.iter().for_each(|(minus, p)| tree(p, depth + 1, if *minus { "- " } else { "+ " }, out));
        }
        ExprKind::Product(first, rest) => {
            head("product");
            tree(first, depth + 1, "", out);
            rest.iter().for_each(|(op, _, p)| tree(p, depth + 1, operator(*op), out));
        }
        ExprKind::Negate(a) => {
            head("negative");
            tree(a, depth + 1, "", out);
        }
        ExprKind::Transpose(a) => {
            head("transpose");
            tree(a, depth + 1, "", out);
        }
        ExprKind::Power(a, b) => {
            head("power");
            tree(a, depth + 1, "", out);
            tree(b, depth + 1, "^ ", out);
        }
        ExprKind::Call(f, args) => {
            head("call");
            tree(f, depth + 1, "of ", out);
            for a in args {
                match a {
                    Argument::Expr(a) => tree(a, depth + 1, "", out),
                    Argument::Slice(_) => {
                        let _ = writeln!(out, "{indent}  :");
                    }
                    Argument::Text(text, _) => {
                        let _ = writeln!(out, "{indent}  \"{text}\"");
                    }
                }
            }
        }
        ExprKind::Tensor(rows) => {
            head("tensor");
            for (k, row) in rows.iter().enumerate() {
                let _ = writeln!(out, "{indent}  row {}", k + 1);
                row.iter().for_each(|p| tree(p, depth + 2, "", out));
            }
        }
        ExprKind::If(c, a, b) => {
            head("if");
            condition(c, depth + 1, out);
            tree(a, depth + 1, "then ", out);
            tree(b, depth + 1, "else ", out);
        }
    }
}

fn operator(op: MulOp) -> &'static str {
    match op {
        MulOp::Times => "* ",
        MulOp::Divide => "/ ",
        MulOp::Dot => ". ",
        MulOp::DoubleDot => ": ",
        MulOp::ByComponent => ".* ",
        MulOp::DivideByComponent => "./ ",
        MulOp::Outer => "@ ",
    }
}

fn condition(c: &Cond, depth: usize, out: &mut String) {
    let indent = "  ".repeat(depth);
    let (word, parts): (&str, &[Cond]) = match &c.kind {
        CondKind::Compare(first, rest) => {
            let _ = writeln!(out, "{indent}compare");
            tree(first, depth + 1, "", out);
            rest.iter().for_each(|(op, e)| tree(e, depth + 1, comparison(*op), out));
            return;
        }
        CondKind::And(list) => ("and", list),
        CondKind::Or(list) => ("or", list),
        CondKind::Not(one) => ("not", std::slice::from_ref(&**one)),
    };
    let _ = writeln!(out, "{indent}{word}");
    parts.iter().for_each(|p| condition(p, depth + 1, out));
}

fn comparison(op: wfl::ast::CmpOp) -> &'static str {
    use wfl::ast::CmpOp;
    match op {
        CmpOp::Less => "< ",
        CmpOp::LessEqual => "<= ",
        CmpOp::Greater => "> ",
        CmpOp::GreaterEqual => ">= ",
        CmpOp::Equal => "== ",
        CmpOp::NotEqual => "!= ",
    }
}
