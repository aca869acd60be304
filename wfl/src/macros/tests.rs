use super::*;
use crate::{
    ast::ItemKind,
    parse::{parse, parse_gwfl},
    render::render,
    testing::{GWFL, SCENES, codes, show, tree},
    walk::children,
};

/// The expanded terms of a text, with the messages and uses.
fn expanded(text: &str) -> (Vec<String>, Vec<Diagnostic>, SourceMap, Expansions) {
    let mut sources = SourceMap::new();
    let id = sources.add("scene.wfl", text);
    let parsed = parse(&sources, id);
    assert!(parsed.diagnostics.is_empty(), "{:?}", parsed.diagnostics);
    let items = parsed.value.unwrap().items;
    let defs = items.iter().filter_map(|i| if let ItemKind::Def(d) = &i.kind { Some(d) } else { None });
    let mut expander = Expander::new(&sources, defs);
    let mut found = Vec::new();
    for item in &items {
        if let ItemKind::Term { defs, expr, .. } = &item.kind {
            found.extend(expander.expr_with(expr, defs).map(|e| show(&e)));
        }
    }
    let (diagnostics, expansions) = (expander.diagnostics, expander.expansions);
    (found, diagnostics, sources, expansions)
}

fn one(defs: &str, term: &str) -> String {
    let (found, diagnostics, ..) = expanded(&format!("{defs}\nterm on all : {term}\n"));
    if diagnostics.is_empty() { found.concat() } else { codes(&diagnostics) }
}

#[test]
fn bodies_are_trees_and_not_text() {
    let defs = "def gap = a - b\ndef twice(v) = 2*v";
    assert_eq!(one(defs, "3*gap"), tree("3*(a-b)"));
    assert_eq!(one(defs, "twice(c + d)^2"), tree("(2*(c+d))^2"));
    assert_eq!(one(defs, "gap(1)'"), tree("(a-b)(1)'"));
}

#[test]
fn parameters_follow_prefixes_and_stand_in_interpolate() {
    let defs = "def sigma(v) = l*Div_v*Id(3) + 2*m*Sym(Grad_v)\ndef jump(a,b) = a - Interpolate(b, neighbor_element)\n\
        def w(a, b) = sigma(a):Grad_b\ndef test(v) = Test_v + Previous_Dot_v";
    assert_eq!(one(defs, "sigma(u)"), tree("l*Div_u*Id(3) + 2*m*Sym(Grad_u)"));
    assert_eq!(one(defs, "w(u, Test_u)"), tree("(l*Div_u*Id(3) + 2*m*Sym(Grad_u)):Grad_Test_u"));
    assert_eq!(one(defs, "jump(Test_a, Test_b)"), tree("Test_a - Interpolate(Test_b, neighbor_element)"));
    assert_eq!(one(defs, "jump(2*c, d)"), tree("2*c - Interpolate(d, neighbor_element)"));
    assert_eq!(one(defs, "test(u)"), tree("Test_u + Previous_Dot_u"));
    assert_eq!(one(defs, "jump(c, 2*d)"), "E106");
}

#[test]
fn parameters_shadow_and_arguments_are_not_captured() {
    // b in the argument is the b of the caller, not the parameter b of f
    assert_eq!(one("def f(a, b) = a + b", "f(b, 1)"), tree("b + 1"));
    assert_eq!(one("def g = 7\ndef f(g) = 2*g", "f(h)"), tree("2*h"));
    assert_eq!(one("def g(v) = v*v\ndef f(v) = g(v + 1)", "f(v)"), tree("(v+1)*(v+1)"));
    assert_eq!(one("def g = 7", "Def g := 8; g"), "8");
    // a macro of the scene does not see the macros of a term
    assert_eq!(one("def g = 7\ndef f = g", "Def g := 8; f + g"), tree("7 + 8"));
    assert_eq!(one("", "Def s(v) := v^2; Def r(v) := 1 + s(v); r(x)"), tree("1 + x^2"));
}

#[test]
fn conditions_and_every_other_form_are_expanded() {
    let defs = "def a = p - q";
    let term = "if not a < 1 or a == 2 then [a, 1; 2, a]' else -a^a*f(a,:)./a";
    let same = "if not (p-q) < 1 or (p-q) == 2 then [p-q, 1; 2, p-q]' else -(p-q)^(p-q)*f(p-q,:)./(p-q)";
    assert_eq!(one(defs, term), tree(same));
}

#[test]
fn wrong_numbers_of_arguments_name_both_places() {
    let (_, d, sources, _) = expanded("def sigma(v) = Sym(Grad_v)\nterm on all : sigma(uR, nu):Grad_Test_uR\n");
    let expected = "\
error[E105]: `sigma` takes 1 argument, 2 given
 --> scene.wfl:2:15
  |
1 | def sigma(v) = Sym(Grad_v)
  |     -------- defined here
2 | term on all : sigma(uR, nu):Grad_Test_uR
  |               ^^^^^^^^^^^^^
";
    assert_eq!(render(&d[0], &sources), expected);
    assert_eq!(one("def f(a) = a", "f"), "E105");
    assert_eq!(one("def f(a) = a", "f(:)"), "E105");
}

#[test]
fn a_pasted_expression_is_refused_with_a_remedy() {
    let (_, d, sources, _) = expanded("def sigma(v) = 2*Sym(Grad_v)\nterm on all : Norm(sigma(2*uL))\n");
    let expected = "\
error[E106]: `Grad_v` needs a field name, but `v` is an expression here
 --> scene.wfl:2:26
  |
1 | def sigma(v) = 2*Sym(Grad_v)
  |                      ------ `v` is pasted behind Grad_ here
2 | term on all : Norm(sigma(2*uL))
  |                          ^^^^ this stands for `v`
  |
  = help: 2*sigma(uL)
";
    assert_eq!(render(&d[0], &sources), expected);
}

#[test]
fn macros_that_use_themselves_are_named_once() {
    for defs in ["def a = 1 + a", "def a = b\ndef b = c(1)\ndef c(x) = x*a", "def a(v) = a(v)"] {
        let (_, d, ..) = expanded(&format!("{defs}\nterm on all : 2*b*c(1)\nterm on all : 3\n"));
        assert_eq!(codes(&d), "E123", "{defs}");
    }
    // used in a term or not
    assert_eq!(one("def a = a", "1"), "E123");
    // a parameter of that name is no use of the macro
    assert_eq!(one("def a(a) = a + 1", "a(2)"), tree("2+1"));
    assert_eq!(one("", "Def a := b; Def b := a; a"), "E123");
}

/// On a stack as the first thread of a program has it: frames of a build without optimisation are large.
#[test]
fn expansion_is_bounded() {
    let thread = std::thread::Builder::new().stack_size(8 << 20).spawn(expands).unwrap();
    thread.join().unwrap();
}

fn expands() {
    let doubling: String = (1..60).map(|i| format!("def a{i} = a{} + a{}\n", i - 1, i - 1)).collect();
    assert_eq!(one(&format!("def a0 = x + x\n{doubling}"), "a59"), "E124");
    let arguments: String = (1..60).map(|i| format!("def f{i}(v) = f{}(v + v)\n", i - 1)).collect();
    assert_eq!(one(&format!("def f0(v) = v\n{arguments}"), "f59(x)"), "E124");
    let chain: String = (1..100_000).map(|i| format!("def a{i} = a{}\n", i - 1)).collect();
    assert_eq!(one(&format!("def a0 = x\n{chain}"), "a99999"), "E119");
    assert_eq!(one(&format!("def a0 = x\n{chain}"), "a200"), "x");
    let towers: String =
        (1..50).map(|i| format!("def b{i} = {}b{}{}\n", "-f(".repeat(40), i - 1, ")".repeat(40))).collect();
    assert_eq!(one(&format!("def b0 = x\n{towers}"), "b49"), "E119");
}

#[test]
fn one_error_does_not_hide_the_next() {
    assert_eq!(one("def f(a) = a\ndef g(v) = Grad_v", "f(1,2) + [g(1); f]"), "E105 E106 E105");
}

#[test]
fn nodes_know_the_use_that_brought_them() {
    let text = "def inner(v) = Grad_v\ndef outer(v) = 2*inner(v)\nterm on all : outer(u) + w\n";
    let mut sources = SourceMap::new();
    let id = sources.add("scene.wfl", text);
    let items = parse(&sources, id).value.unwrap().items;
    let defs = items.iter().filter_map(|i| if let ItemKind::Def(d) = &i.kind { Some(d) } else { None });
    let mut x = Expander::new(&sources, defs);
    let ItemKind::Term { expr, .. } = &items[2].kind else { panic!() };
    let e = x.expr(expr).unwrap();
    let mut seen = Vec::new();
    fn visit<'e>(e: &'e Expr, seen: &mut Vec<&'e Expr>) {
        seen.push(e);
        children(e, &mut |c| visit(c, seen));
    }
    visit(&e, &mut seen);
    let pasted = seen.iter().find(|e| matches!(&e.kind, ExprKind::Name(n) if n == "Grad_u")).unwrap();
    let use_of_inner = &x.expansions.list[pasted.expansion.unwrap().index()];
    assert_eq!((use_of_inner.name.as_str(), sources.snippet(use_of_inner.call)), ("inner", "inner(v)"));
    assert_eq!(sources.snippet(use_of_inner.definition), "inner(v)");
    let use_of_outer = &x.expansions.list[use_of_inner.parent.unwrap().index()];
    assert_eq!((sources.snippet(use_of_outer.call), use_of_outer.parent), ("outer(u)", None));
    let written = seen.iter().find(|e| matches!(&e.kind, ExprKind::Name(n) if n == "w")).unwrap();
    assert_eq!(written.expansion, None);
    // the use is marked first, the definition second
    let d = at_expr(Diagnostic::new(crate::Code::E201, "m"), pasted, &x.expansions, "here");
    assert_eq!(sources.snippet(d.labels[0].span), "outer(u)");
    assert_eq!(
        (sources.snippet(d.labels[1].span), d.labels[1].text.as_str()),
        ("Grad_v", "inside the definition of `inner`")
    );
}

#[test]
fn scenes_and_gwfl_strings_expand() {
    for (name, text) in SCENES {
        let (found, d, ..) = expanded(text);
        assert!(d.is_empty() && !found.is_empty(), "{name}: {d:?}");
        for e in found {
            assert!(!e.contains("jump") && !e.contains("Pn") && !e.contains("sigma"), "{name}: {e}");
        }
    }
    for line in GWFL.lines().filter(|l| !l.contains("f(p)")) {
        let mut sources = SourceMap::new();
        let id = sources.add("gwfl", line);
        let (defs, e) = parse_gwfl(&sources, id).value.unwrap();
        let mut x = Expander::new(&sources, []);
        assert!(x.expr_with(&e, &defs).is_some() && x.diagnostics.is_empty(), "{line}");
    }
}
