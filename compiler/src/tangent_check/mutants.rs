//! Every derivative rule with the wrong sign is noticed; `docs/mutations.md` lists by which expression.

use std::collections::{BTreeMap, BTreeSet};
use std::{fmt::Write as _, path::Path};

use super::tests::{check, law};
use crate::{
    derive::mutants::with_wrong,
    math::{MathFn1, MathFn2},
};

/// Expressions, and whether they are energies (then their rules are used twice). Those of the smooth functions of one
/// number come from their rows.
const SAMPLES: &[(&str, bool)] = &[
    ("u(1)+sqr(u(2))", false),
    ("u(1)-sqr(u(2))", false),
    ("-u(1)*u(2)", false),
    ("(g*u).Normal+u(1)^2", false),
    ("(u/(9+u(2))).Normal", false),
    ("(u.*u).Normal", false),
    ("(u./(9*Normal+[20,20])).Normal", false),
    ("Trace(Grad_u)+u(1)", false),
    ("(Grad_u'*u).Normal", false),
    ("Reshape(Grad_u,4).[1;2;3;4]", false),
    ("[u(2),u(1)].Normal", false),
    ("sqrt(9+u(1))", false),
    ("Derivative_sinc(u(1))", false),
    ("Derivative_sinc(u(1))", true),
    ("pow(9+u(1),u(2))", false),
    ("atan2(u(1),9+u(2))", false),
    ("asinh(u(1)*exp(u(2)))", false),
    ("asinh(u(1)*exp(u(2)))", true),
    ("pos_part(u(1))", false),
    ("Norm(u)", false),
    ("Normalized(u).Normal", false),
    ("Ball_projection(u,0.3+sqr(u(2))).Normal", false),
    ("Ball_projection(u,1).[1,2]", true),
    ("Det(Id(2)+Grad_u)", false),
    ("Inv(9*Id(2)+Grad_u):Grad_u", false),
    ("Expm(Grad_u/9):Grad_u", false),
    ("Logm(Id(2)+Grad_u/9):Grad_u", false),
    ("Print(u(1))", false),
];

const HEAD: &str = "# Wrong derivative rules

In short: the tangent check (`wfl verify`) detects every derivative rule of the compiler when its sign is wrong, although not in
every expression that uses the rule. The largest relative deviation of the tangent is at least 0.1 with a wrong rule and
below 1e-10 with the correct ones.

The test gives one rule after the other the wrong sign and compiles the expressions that use it. All operators of the
language are composed of these rules. `deviation` is the largest difference between the tangent and difference quotients of
the residual, divided by the largest entry; the expression shown is the one with the largest deviation. This page is
written by `WFL_WRITE=1 cargo test -p wfl-compiler wrong_rule`; without the variable the test compares.

| rule | used by | detected in | expression | deviation |
|---|---|---|---|---|
";

/// A sample of a row in the fields of these tests: the scalar `p` is a component, the vector `w` is given.
fn with_components(sample: &str) -> String {
    let mut text = String::new();
    let mut before = ' ';
    for (at, c) in sample.char_indices() {
        let after = sample[at + c.len_utf8()..].chars().next().unwrap_or(' ');
        let alone = !before.is_alphanumeric() && before != '_' && !after.is_alphanumeric() && after != '_';
        match c {
            'p' if alone => text.push_str("u(1)"),
            'w' if alone => text.push_str("[1,2]"),
            _ => text.push(c),
        }
        before = c;
    }
    text
}

/// Deviation of a sample with a rule wrong, and the rules it uses.
fn deviation(sample: (&str, bool), rule: Option<&str>) -> (f64, BTreeSet<String>) {
    let (text, energy) = sample;
    let whole = if energy { text.to_owned() } else { format!("({text})*Test_u(1)") };
    let (made, used) = with_wrong(rule, || law(&whole, energy));
    (check(&made, 8).error(), used)
}

#[test]
fn every_wrong_rule_is_noticed() {
    let mut users: BTreeMap<String, Vec<(&str, bool)>> = BTreeMap::new();
    let rows: Vec<String> = MathFn1::ALL.iter().flat_map(|f| f.samples()).map(|s| with_components(s)).collect();
    for sample in SAMPLES.iter().copied().chain(rows.iter().map(|s| (s.as_str(), false))) {
        let (right, used) = deviation(sample, None);
        assert!(right <= 1e-10, "{sample:?}: {right}");
        used.into_iter().for_each(|rule| users.entry(rule).or_default().push(sample));
    }
    let functions = MathFn1::ALL.iter().map(|f| f.name()).chain(MathFn2::ALL.iter().map(|f| f.name()));
    let unused: Vec<&str> = functions.filter(|f| !users.contains_key(*f)).collect();
    assert!(unused.is_empty(), "no sample uses {unused:?}");
    assert!(users.len() >= 46, "{} rules: {:?}", users.len(), users.keys());
    let mut page = HEAD.to_owned();
    for (rule, samples) in &users {
        let found: Vec<(f64, &str)> = samples.iter().map(|s| (deviation(*s, Some(rule)).0, s.0)).collect();
        let caught = found.iter().filter(|f| f.0 > 1e-3).count();
        let best = found.iter().max_by(|a, b| a.0.total_cmp(&b.0)).expect("a rule has users");
        assert!(caught > 0, "{rule} with the wrong sign is not noticed by {samples:?}");
        writeln!(page, "| {rule} | {} | {caught} | `{}` | {:.1e} |", found.len(), best.1, best.0).expect("text");
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/mutations.md");
    if std::env::var_os("WFL_WRITE").is_some() {
        std::fs::write(&path, &page).expect("the page can be written");
    }
    assert_eq!(std::fs::read_to_string(&path).expect("the page is in the repository"), page);
}
