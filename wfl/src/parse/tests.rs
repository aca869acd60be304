use super::*;
use crate::{
    ast::{Item, ItemKind, OptionValue, Place, Rank},
    keywords::{KEYWORDS, STATEMENTS, is_keyword},
    source::SourceMap,
    testing::{GWFL, SCENES, codes, show, tree},
};

fn items(text: &str) -> (Vec<Item>, String) {
    let mut sources = SourceMap::new();
    let id = sources.add("scene.wfl", text);
    let parsed = parse(&sources, id);
    (parsed.value.map(|s| s.items).unwrap_or_default(), codes(&parsed.diagnostics))
}

/// Code, message, marked text and help of the only error of a text.
fn error(text: &str) -> [String; 4] {
    let mut sources = SourceMap::new();
    let id = sources.add("scene.wfl", text);
    let d = parse(&sources, id).diagnostics;
    assert_eq!(d.len(), 1, "{text}: {d:?}");
    let d = &d[0];
    let marked = sources.snippet(d.labels[0].span).to_owned();
    [d.code.to_string(), d.message.clone(), marked, d.helps.first().cloned().unwrap_or_default()]
}

#[test]
fn the_five_scenes_parse() {
    let counts = [38, 34, 37, 30, 5];
    for ((name, text), count) in SCENES.iter().zip(counts) {
        let (items, codes) = items(text);
        assert_eq!((codes.as_str(), items.len()), ("", count), "{name}");
    }
}

#[test]
fn gwfl_strings_parse() {
    for line in GWFL.lines() {
        let mut sources = SourceMap::new();
        let id = sources.add("gwfl", line);
        let parsed = parse_gwfl(&sources, id);
        assert!(parsed.value.is_some() && parsed.diagnostics.is_empty(), "{line}: {:?}", parsed.diagnostics);
    }
}

#[test]
fn precedence_is_that_of_the_language_page() {
    for (text, expected) in [
        ("-u.v", "((-u) . v)"),
        ("-x^2", "(-(x^2))"),
        ("1/gamma*a.b", "(1 / gamma * a . b)"),
        ("u-v.Normal", "(u - (v . Normal))"),
        ("A*B:C", "(A * B : C)"),
        ("a^b^c", "(a^(b^c))"),
        ("a^-b^c", "(a^(-(b^c)))"),
        ("a'^2", "((a')^2)"),
        ("a^b'", "(a^(b'))"),
        ("-a'", "(-(a'))"),
        ("--a", "a"),
        ("-+-a - -b", "(a - (-b))"),
        ("a - (b - c)", "(a - (b - c))"),
        ("a./b.*c", "(a ./ b .* c)"),
        ("a@b.c", "(a @ b . c)"),
        ("u(1)(2)'", "(u(1)(2)')"),
        ("f(a,:)*2", "(f(a,:) * 2)"),
        ("[a,b;c,d]", "[a,b;c,d]"),
        ("[[1,2],[3,4]]'", "([[1,2],[3,4]]')"),
        ("if a < b then c else d + e", "(if {a<b} then c else (d + e))"),
        ("if a then b else c", "E122"),
        ("if a<b and c<d or not e<f then 1 else 2", "(if {{{a<b} and {c<d}} or {not {e<f}}} then 1 else 2)"),
        ("if (a<b or c<d) and (x) > 0 then 1 else 2", "(if {{{a<b} or {c<d}} and {x>0}} then 1 else 2)"),
        ("if 0 <= x < 1 then 1 else 2", "(if {0<=x<1} then 1 else 2)"),
        ("if not not a == b then 1 else 2", "(if {a==b} then 1 else 2)"),
        ("(if a>0 then a else 0)*b", "((if {a>0} then a else 0) * b)"),
        ("a < b", "E122"),
        ("1 + (a < b)", "E122"),
    ] {
        assert_eq!(tree(text), expected, "{text}");
    }
}

#[test]
fn a_point_behind_digits_belongs_to_the_number() {
    for (text, expected) in [
        ("2.*p", "(2 * p)"),
        ("2./3", "(2 / 3)"),
        ("1.E+2*p", "(100 * p)"),
        (".5", "0.5"),
        ("1e-3", "0.001"),
        ("p.q", "(p . q)"),
        ("p .5", "(p . 5)"),
        ("Grad_u(1,1).2", "(Grad_u(1,1) . 2)"),
        ("1./p./q", "(1 / p ./ q)"),
        ("0e5", "0"),
    ] {
        assert_eq!(tree(text), expected, "{text}");
    }
}

#[test]
fn words_without_parentheses_take_the_next_value() {
    for (text, expected) in [
        ("Sym Grad_u", "Sym(Grad_u)"),
        ("2*Sym Grad_u:Grad_Test_u", "(2 * Sym(Grad_u) : Grad_Test_u)"),
        ("Sym Grad_u'", "Sym((Grad_u'))"),
        ("-Sym Grad_u(1,1)", "(-Sym(Grad_u(1,1)))"),
        ("Trace Sym Grad_u^2", "(Trace(Sym(Grad_u))^2)"),
        ("Sym(Grad_u)*2", "(Sym(Grad_u) * 2)"),
        ("Sym (Grad_u)(1,2)", "Sym(Grad_u)(1,2)"),
        ("Print [1,2]", "Print([1,2])"),
        ("Symmetric", "Symmetric"),
        ("Sym + 1", "(Sym + 1)"),
    ] {
        assert_eq!(tree(text), expected, "{text}");
    }
}

#[test]
fn statements_carry_what_they_say() {
    let text = "wfl 1\nmesh box [0,0] to [1,1] size h tri map [x + 0.1*y, y]\nmesh file \"a b.msh\" map [x, y, z]\n\
        quadrature on a, b vertex\nquadrature on a degree 4\nmultiplier l : vector P2 on f [MPa*mm^-2/s] with crosspoints=keep\n\
        unknown d : scalar global [mm]\nunknown m : matrix(2,3) DQ0\nmeasure m = min(max(a,b)) on global\n\
        split u, v across f\nfix u, v(1), w.Normal = 0 on a, b\nparam p = [1,2] [m] in {1, -2} \"text # here\" # comment\n\
        term on global : Def a(b) := b; a(1)*Test_d\nstart from \"old\"\nregion r = (a + b) - faces of c where x < 1 & y > 2\n";
    // `&` belongs to regions, so it cannot stand in a condition
    let (found, codes) = items(text);
    assert_eq!(codes, "E117");
    assert_eq!(found.len(), 14);
    let ItemKind::Multiplier { space, options, .. } = &found[5].kind else { panic!("{:?}", found[5]) };
    let unit = space.unit.as_ref().unwrap();
    assert_eq!(unit.factors, [("MPa".to_owned(), 1), ("mm".to_owned(), -2), ("s".to_owned(), -1)]);
    // a blank is `*`
    let (blanks, codes) = items("param a = 1 [N  mm^2/s]\nparam b = 1 [kg/m/s^2]\n");
    let of = |item: &Item| match &item.kind {
        ItemKind::Param { unit: Some(unit), .. } => unit.factors.iter().map(|(n, p)| format!("{n}{p} ")).collect(),
        _ => String::new(),
    };
    assert_eq!((codes.as_str(), of(&blanks[0]), of(&blanks[1])), ("", "N1 mm2 s-1 ".into(), "kg1 m-1 s-2 ".into()));
    assert_eq!(space.element.as_ref().unwrap().name, "P2");
    assert!(matches!(&options[0].value, Some(OptionValue::Expr(e)) if show(e) == "keep"));
    let ItemKind::Unknown { space, .. } = &found[6].kind else { panic!("{:?}", found[6]) };
    assert!(matches!((&space.rank, &space.place), (Rank::Scalar, Place::Global(_))));
    let ItemKind::Param { text, domain, .. } = &found[11].kind else { panic!("{:?}", found[11]) };
    assert_eq!(text.as_deref(), Some("text # here"));
    assert!(matches!(domain, Some(crate::ast::Domain::Set(v)) if v.len() == 2));
}

#[test]
fn a_rule_on_segments_names_its_mapping() {
    let (found, codes) = items("quadrature on a, b segments of m degree 2*n\nquadrature on a segments degree 2\n");
    assert_eq!((found.len(), codes.as_str()), (1, "E113"));
    let ItemKind::Quadrature { places, segments, rule } = &found[0].kind else { panic!("{:?}", found[0]) };
    assert_eq!(places.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(), ["a", "b"]);
    assert_eq!(segments.as_ref().map(|m| m.name.as_str()), Some("m"));
    assert!(matches!(rule, crate::ast::QuadratureRule::Degree(e) if show(e) == "(2 * n)"));
}

#[test]
fn a_refinement_has_places_a_condition_rounds_and_directions_in_this_order() {
    let text = "refine where x^2 < 1 times 2*n along x, y\nrefine on a, b times 3\nrefine on a where y > 0\nrefine times 2\n\
        refine where x < 1 along x times 2\n";
    let (found, codes) = items(text);
    assert_eq!((found.len(), codes.as_str()), (3, "E113 E117"));
    let ItemKind::Refine(first) = &found[0].kind else { panic!("{:?}", found[0]) };
    assert!(first.places.is_empty() && first.condition.is_some());
    assert_eq!(first.times.as_ref().map(show).as_deref(), Some("(2 * n)"));
    assert_eq!(first.along.iter().map(|a| a.name.as_str()).collect::<Vec<_>>(), ["x", "y"]);
    let ItemKind::Refine(second) = &found[1].kind else { panic!("{:?}", found[1]) };
    assert_eq!((second.places.len(), second.condition.is_none(), second.along.len()), (2, true, 0));
    assert!(matches!(&found[2].kind, ItemKind::Refine(r) if r.times.is_none() && r.places.len() == 1));
}

#[test]
fn spans_hold_exactly_the_text_of_their_node() {
    fn check(sources: &SourceMap, e: &crate::ast::Expr) {
        assert_eq!(tree(sources.snippet(e.span)), show(e));
        crate::walk::children(e, &mut |c| check(sources, c));
    }
    for (_, text) in SCENES {
        let mut sources = SourceMap::new();
        let id = sources.add("scene.wfl", *text);
        for item in parse(&sources, id).value.unwrap().items {
            let written = sources.snippet(item.span);
            assert!(written == written.trim() && !written.is_empty());
            match &item.kind {
                ItemKind::Def(d) => check(&sources, &d.body),
                ItemKind::Term { expr, .. } | ItemKind::Measure { expr, .. } => check(&sources, expr),
                ItemKind::Fix { value, .. } | ItemKind::Param { value, .. } => check(&sources, value),
                ItemKind::Output { items, .. } => items.iter().for_each(|i| check(&sources, &i.expr)),
                _ => {}
            }
        }
    }
}

#[test]
fn usual_slips_have_messages_of_their_own() {
    for (text, expected) in [
        ("def gap = x**2/(2*R) - d", ["E107", "`**` is not an operator", "**", "x^2, or sqr(x)"]),
        ("expect a < b && c < d", ["E107", "`&&` is not an operator", "&&", "a < b and c < d"]),
        ("expect !(a < b)", ["E107", "`!` is not an operator", "!", "not a == b, or a != b"]),
        ("expect a =< b", ["E107", "`=<` is not an operator", "=<", "<="]),
        ("def a = 2 // two", ["E107", "`//` is not an operator", "//", "a comment starts with `#`"]),
        (
            "def a = b % two",
            ["E118", "the character `%` is not part of the language", "%", "a comment starts with `#`"],
        ),
        ("def a = (b", ["E114", "`(` is never closed", "(", ""]),
        ("def a = b)", ["E114", "`)` closes nothing", ")", ""]),
        ("def a = [b)", ["E114", "`[` is closed by `)`", ")", ""]),
        ("regoin a = cells", ["E115", "`regoin` is not a statement", "regoin", ""]),
        ("E = 4", ["E115", "`E` is not a statement", "E", "a number: param E = ...; an expression: def E = ..."]),
        (
            "on left : 2",
            ["E115", "`on` does not start a statement", "on", "a continuation line is indented: put a space before it"],
        ),
        (
            "+ 2",
            ["E115", "a statement starts with a word", "+ 2", "a continuation line is indented: put a space before it"],
        ),
        ("  param a = 1", ["E115", "a statement starts in column 1", "param a = 1", ""]),
        ("region a = cells where x = 0", ["E116", "`=` gives a value, `==` compares", "=", "write `==`"]),
        ("expect a = b", ["E116", "`=` gives a value, `==` compares", "=", "write `==`"]),
        ("param a == 2", ["E116", "`==` compares, `=` gives a value", "==", "write `=`"]),
        (
            "def a := 2",
            ["E116", "`:=` stands in `Def` inside a term and in `state`; here it is `=`", ":=", "write `=`"],
        ),
        (
            "term on a : Def b = 2; b",
            ["E116", "`Def` inside a term and `state` are written with `:=`", "=", "write `:=`"],
        ),
        (
            "param a = 1\n  param b = 2",
            ["E117", "`param` starts a new statement inside another one", "param", "a statement starts in column 1"],
        ),
        (
            "use \"a.wfl\" \"b.wfl\"",
            ["E117", "`\"b.wfl\"` stands after the end of the statement", "\"b.wfl\"", "the form is: use \"file.wfl\""],
        ),
        (
            "param a = 2x",
            ["E113", "an operator is missing between `2` and `x`", "x", "a product is written with `*`: 2*x"],
        ),
        (
            "def a = b c",
            ["E113", "an operator is missing between `b` and `c`", "c", "a product is written with `*`: b*c"],
        ),
        ("def a = 1.2.3", ["E120", "`1.2.3` is not a number", "1.2.3", "a number has one decimal point"]),
        ("param a = 1e999", ["E120", "the number `1e999` is too large", "1e999", ""]),
        ("param a = 1e-999", ["E120", "the number `1e-999` is too small", "1e-999", ""]),
        ("use \"a.wfl", ["E121", "this text has no closing quote", "\"a.wfl", ""]),
        (
            "param load = 1",
            [
                "E207",
                "`load` is a word of the language and cannot be a name",
                "load",
                "choose another name, such as `load_`",
            ],
        ),
        (
            "def f(in) = 1",
            ["E207", "`in` is a word of the language and cannot be a name", "in", "choose another name, such as `in_`"],
        ),
        (
            "def a = 2*load",
            [
                "E207",
                "`load` is a word of the language and cannot be a name",
                "load",
                "choose another name, such as `load_`",
            ],
        ),
        (
            "fix u = on bottom",
            [
                "E113",
                "expected an expression, found the word `on`",
                "on",
                "the form is: fix u = value on region, or fix u(1) = value on region",
            ],
        ),
        (
            "fix u = 0",
            [
                "E113",
                "the statement ends too early: expected `on` or an operator",
                "0",
                "the form is: fix u = value on region, or fix u(1) = value on region",
            ],
        ),
        (
            "mesh box [0] to [1] cells 3 hxe",
            [
                "E113",
                "expected `map`, `with`, `hex`, `tet`, `quad`, `tri`, `segment`, an operator or the end of the statement, found `hxe`",
                "hxe",
                "",
            ],
        ),
        ("unknown u : vectr", ["E113", "expected `scalar`, `vector` or `matrix`, found `vectr`", "vectr", ""]),
        ("unknown u : matrix(3)", ["E113", "`matrix` takes two sizes, rows and columns", "(3)", ""]),
        (
            "def a = 2*if b < c then 1 else 2",
            ["E113", "`if` inside a larger expression needs parentheses", "if", "(if condition then a else b)"],
        ),
        ("expect a", ["E122", "a number stands where a condition is needed", "a", "compare it: a < b, a == b"]),
        (
            "unknown u : scalar [J/kg K]",
            [
                "E113",
                "a blank behind `/` can be read in two ways",
                "K",
                "[J/kg/K] divides by both, [J/kg*K] by the one behind `/`",
            ],
        ),
        ("unknown u : scalar [m^300]", ["E120", "the power `300` of a unit is too large", "300", ""]),
    ] {
        assert_eq!(error(text), expected.map(str::to_owned), "{text}");
    }
}

#[test]
fn foreign_characters_are_named_with_their_replacement() {
    for (text, message, help) in [
        (
            "def a = b \u{2212} c",
            "the character `\u{2212}` (U+2212, minus sign) is not part of the language",
            "write `-`",
        ),
        (
            "use \u{201c}a\u{201d}",
            "the character `\u{201c}` (U+201C, typographic quote) is not part of the language",
            "write `\"`",
        ),
        ("def a = γ*b", "the character `γ` (U+03B3) is not part of the language", "write `gamma`"),
        (
            "def a =\u{a0}b",
            "the character U+00A0 (a wide or fixed space) is not part of the language",
            "write an ordinary space",
        ),
        ("def a = x²", "the character `²` (U+00B2) is not part of the language", "write `^2`"),
        (
            "def a = \0",
            "the character U+0000 (a control character) is not allowed",
            "this looks like a binary file, or text in UTF-16; a scene is UTF-8 text",
        ),
        ("def a = b # \u{202e}hidden", "the character U+202E (a control character) is not allowed", "delete it"),
        (
            "def a = b\rdef c = d",
            "the character U+000D (a control character) is not allowed",
            "end lines with a line feed, with or without a carriage return before it",
        ),
    ] {
        let found = error(text);
        assert_eq!([found[0].as_str(), &found[1], &found[3]], ["E118", message, help], "{text:?}");
    }
    let (found, codes) = items("param a = 1 # grüße − “x”\nparam b = 2 \"größe\"\n");
    assert_eq!((found.len(), codes.as_str()), (2, ""));
}

#[test]
fn tabs_carriage_returns_and_a_byte_order_mark_change_nothing() {
    let plain = "param a = 1\nterm t on all :\n  Grad_u.Grad_Test_u\n  - a*Test_u # end\n";
    let odd = format!("\u{feff}{}", plain.replace("  ", "\t").replace('\n', "\r\n"));
    let trees = |text: &str| {
        let (items, codes) = items(text);
        assert_eq!(codes, "", "{text:?}");
        items
            .iter()
            .map(|i| match &i.kind {
                ItemKind::Term { expr, .. } => show(expr),
                ItemKind::Param { value, .. } => show(value),
                _ => String::new(),
            })
            .collect::<Vec<_>>()
    };
    assert_eq!(trees(plain), trees(&odd));
}

#[test]
fn every_statement_reports_its_own_first_error() {
    let text = "param a = \nparam b = 1\nregion r = cells of\nfix u = (0 on r\nterm t on all u\ndef g = h**2\n";
    let (found, codes) = items(text);
    assert_eq!((found.len(), codes.as_str()), (1, "E113 E113 E114 E113 E107"));
}

#[test]
fn keywords_of_the_grammar_and_of_the_table_are_the_same() {
    for word in STATEMENTS.iter().chain(KEYWORDS).filter(|word| is_keyword(word)) {
        assert!(tree(word).starts_with('E'), "{word} reads as a name");
    }
    for word in ["global", "box", "hex", "vertex", "map", "Normal", "wfl", "iff", "on_", "loads", "balance"] {
        assert_eq!(tree(word), word);
    }
}
