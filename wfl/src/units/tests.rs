//! The scene of the language page with one thing wrong at a time, and small scenes for each rule. What is expected
//! follows from the dimensions by hand.

use super::*;
use crate::{NoFiles, render, resolve, testing::Random};

const HERTZ: &str = include_str!("../../testdata/hertz.wfl");

/// Code, primary mark, its text and the text of the second mark of each message, then the helps.
fn found(text: &str) -> Vec<String> {
    let mut sources = SourceMap::new();
    let main = sources.add("scene.wfl", text);
    let checked = resolve(&mut sources, main, &mut NoFiles, &[]);
    let line = |d: &Diagnostic| {
        let label = |i: usize| {
            let l: &crate::Label = d.labels.get(i)?;
            Some(format!("{}: {}", sources.snippet(l.span), l.text))
        };
        let mut parts = vec![d.code.to_string()];
        parts.extend((0..2).filter_map(label).chain(d.helps.iter().cloned()));
        parts.join(" | ")
    };
    checked.diagnostics.iter().filter(|d| d.code != "W702").map(line).collect()
}

fn rendered(text: &str) -> String {
    let mut sources = SourceMap::new();
    let main = sources.add("hertz.wfl", text);
    let checked = resolve(&mut sources, main, &mut NoFiles, &[]);
    checked.diagnostics.iter().map(|d| render(d, &sources)).collect()
}

/// The Hertz scene with some text replaced; every replaced text must be there.
fn hertz(changes: &[(&str, &str)]) -> String {
    changes.iter().fold(HERTZ.to_owned(), |text, (old, new)| {
        assert!(text.contains(old), "{old}");
        text.replacen(old, new, 1)
    })
}

/// A plane scene with units and room for more lines.
fn scene(lines: &str) -> String {
    format!(
        "mesh box [0,0] to [4,4] cells [4,4] quad\nregion west = faces where x == 0\n\
         param E = 2e5 [MPa]\nparam s = 1 [MPa]\nparam l = 1 [mm]\nparam f = 1 [N/mm]\nparam k = 2\n\
         param tau = 3 [s]\nunknown u : vector [mm]\nunknown p : scalar [MPa]\n\
         def eps = Sym(Grad_u)\nterm base on all : E*eps:Grad_Test_u + p*Test_p/E\n{lines}\n"
    )
}

#[test]
fn the_example_has_matching_units() {
    assert_eq!(found(HERTZ), Vec::<String>::new());
    assert_eq!(found(include_str!("../../../examples/hertz/hertz.wfl")), Vec::<String>::new());
}

#[test]
fn the_message_shows_both_operands_and_the_declaration() {
    let expected = "\
error[E501]: units do not match in `-`
  --> hertz.wfl:22:41
   |
 6 | param gamma = 4e6   [MPa]      \"E/h\"
   |                     ----- declared here
...
22 | def Pn       = gamma*(u.Normal - gap) - sn(u)
   |                ----------------------   ^^^^^ MPa
   |                |
   |                MPa*mm
   |
   = help: gamma has the unit MPa/mm (a stiffness per area)
";
    assert_eq!(rendered(&hertz(&[("[MPa/mm]", "[MPa]")])), expected);
}

#[test]
fn wrong_declarations_are_found_and_explained() {
    let cases = [
        (
            "4e6   [MPa/mm]",
            "4e6",
            "E501 | sn(u): MPa | gamma*(u.Normal - gap): mm | gamma has the unit MPa/mm (a stiffness per area)",
        ),
        ("200e3 [MPa]", "200 [GPa]", "E501 | sn(u): GPa | gamma*(u.Normal - gap): MPa | E has the unit MPa (a stress)"),
        ("50    [mm]", "50 [m]", "E501 | d: mm | x^2/(2*R): mm^2/m | R has the unit mm (a length)"),
        ("50    [mm]", "50", "E501 | d: mm | x^2/(2*R): mm^2 | R has the unit mm (a length)"),
        ("global [mm]", "global [m]", "E501 | d: m | x^2/(2*R): mm | d has the unit mm (a length)"),
        ("u : vector [mm]", "u : vector", "E501 | gap: mm | u.Normal: pure number | u has the unit mm (a length)"),
        ("nu    = 0.3 ", "nu = 0.3 [mm]", "E501 | nu: mm | 1: pure number | nu is a pure number"),
    ];
    for (old, new, message) in cases {
        let all = found(&hertz(&[(old, new)]));
        assert!(all.iter().any(|m| m == message), "{new}: {all:#?}");
    }
    // the force per length is in the sum of terms and in what is expected
    let all = found(&hertz(&[("[N/mm]", "[N]")]));
    let codes: Vec<&str> = all.iter().map(|m| &m[..4]).collect();
    assert_eq!(codes, ["W505", "E501", "E501"], "{all:#?}");
    assert!(all.iter().all(|m| m.ends_with("P has the unit MPa*mm (a force per length)")), "{all:#?}");
}

#[test]
fn wrong_formulas_are_found() {
    let cases = [
        ("x^2/(2*R)", "x/(2*R)", "E501 | d: mm | x/(2*R): pure number"),
        ("x^2/(2*R)", "x^3/(2*R)", "E501 | d: mm | x^3/(2*R): mm^2"),
        ("x^2/(2*R)", "max(x, E)", "E501 | E: MPa | x: mm"),
        ("(1+nu)*(1-2*nu)", "(1+E)*(1-2*nu)", "E501 | E: MPa | 1: pure number"),
        ("- sn(u)", "- sn(u)/R", "E501 | sn(u)/R: MPa/mm | gamma*(u.Normal - gap): MPa"),
        ("- sn(u)", "- u.Normal", "E501 | u.Normal: mm | gamma*(u.Normal - gap): MPa"),
        ("2*P/(pi*a_ref)", "2*P/pi", "E501 | 1: pure number | p/p_ref: 1/mm"),
        ("pos_part(Pn)*", "pos_part(Pn - P)*", "E501 | P: N/mm | Pn: MPa"),
        ("-P/2*Test_d", "-P*R*Test_d", "W505 | -P*R*Test_d: N | pos_part(Pn)*(Test_u.Normal + Test_d): MPa*mm"),
        ("Heaviside(Pn)", "exp(Pn)", "E501 | Pn: MPa"),
        ("integral(Heaviside(Pn))", "mean(Heaviside(Pn))", "E501 | 1: pure number | a/a_ref: 1/mm"),
        ("pos_part(Pn))", "if Pn > 1 then Pn else 0)", "E501 | 1: pure number | Pn: MPa"),
        ("pos_part(Pn))", "if Pn > 0 then Pn else d)", "E501 | d: mm | Pn: MPa"),
        ("fix u    = [0,0]", "fix u = [0,P]", "E501 | [0,P]: N/mm | [mm]: mm"),
        ("d = 0.01 ", "d = 0.01*E ", "E501 | 0.01*E: MPa | [mm]: mm"),
    ];
    for (old, new, message) in cases {
        let all = found(&hertz(&[(old, new)]));
        assert!(all.iter().any(|m| m == message), "{new}: {all:#?}");
    }
}

#[test]
fn one_mistake_gives_one_message() {
    for (old, new) in [("x^2/(2*R)", "x^3/(2*R)"), ("- sn(u)", "- sn(u)/R"), ("(1+nu)*(1-2*nu)", "(1+E)*(1-2*nu)")] {
        assert_eq!(found(&hertz(&[(old, new)])).len(), 1, "{new}");
    }
}

#[test]
fn unknown_units_are_reported_with_the_nearest_name() {
    assert_eq!(found(&hertz(&[("[MPa/mm]", "[MPa/mmm]")])), ["E502 | [MPa/mmm]: did you mean `mm`?"]);
    assert_eq!(found(&hertz(&[("[MPa]", "[mpa]")])), ["E502 | [mpa]: did you mean `MPa`?"]);
}

#[test]
fn equal_units_may_be_written_in_any_way() {
    // by definition N/mm^2 is MPa, N/mm is kN/m and kg/s^2*1000
    let changes = [("200e3 [MPa]", "200e3 [N/mm^2]"), ("[N/mm]", "[kN/m]"), ("[MPa/mm]", "[kN/mm^2/m]")];
    assert_eq!(found(&hertz(&changes)), Vec::<String>::new());
}

#[test]
fn a_factor_between_units_is_named() {
    let text = rendered(&hertz(&[("200e3 [MPa]", "2e11 [Pa]")]));
    assert!(text.contains("the same quantity, but MPa is 1e6 Pa: numbers are not converted"), "{text}");
}

#[test]
fn a_scene_without_units_is_not_checked() {
    let bare = "mesh box [0,0] to [1,1] cells [4,4] quad\nunknown u : scalar\n\
                term on all : Grad_u.Grad_Test_u - (x + u + 3)*Test_u";
    assert_eq!(found(bare), Vec::<String>::new());
    let mut sources = SourceMap::new();
    let main = sources.add("scene.wfl", bare);
    let script = resolve(&mut sources, main, &mut NoFiles, &[]).value.unwrap();
    assert!(unit_report(&script, &sources).is_empty());
}

#[test]
fn every_rule_of_the_table() {
    // each expression with its unit, given by hand; coordinates are in mm
    let right = [
        ("E + Norm(E*eps) + Trace(E*eps) + pos_part(s) + abs(s)", "s"),
        ("sqrt(E*s)", "s"),
        ("sqr(u(1)) + Norm_sqr(u) + l^2 + pow(l, 2) + sqr_pos_part(l)", "l*l"),
        ("(E^3)^(1/3) + pow(s*s, 0.5) + E^k/s", "s"),
        ("exp(s/E) + log(E/s) + sin(l/u(1)) + atan2(E, s)", "k"),
        ("Heaviside(s) + sign(l) + Norm(Normalized(u)) + Normalized_reg(u, l)(1)", "k"),
        ("Det(Id(2)*l)", "l*l"),
        ("Norm(Inv(eps*E))", "1/s"),
        ("Norm(Grad_p)*l + Norm(Hess_p)*sqr(l) + Norm(Grad(p))*l + Norm(Div(E*eps))*l", "s"),
        ("Dot_p*tau + s*t/tau", "s"),
        ("max(s, E) + min(p, s) + Norm(Ball_projection(eps*E, s)) + reg_pos_part(p, s)", "s"),
        ("if u(1) < l then s else p", "s"),
        ("Norm(Diff(E*sqr(Trace(eps)), u, u))", "s"),
        ("Interpolate(p, neighbor_element) + Print(p) + element_size*f/l/l", "s"),
        ("Norm(Saint_Venant_Kirchhoff_sigma(Grad_u, [E, s]))", "s"),
        ("Norm(Contract(eps*E, 1, u, 1))", "s*l"),
        ("Derivative_sqr(l) + Derivative_sqrt(l)*sqrt(l)*l", "l"),
        ("Previous_p + (X(1) - x)*s/l + (u@u)(1,1)*s/l/l + E'", "s"),
    ];
    for (expr, same) in right {
        let measure = |end: &str| format!("steps t = 0 to 1 by 1\nmeasure q = max({expr} - {end}) on all");
        assert_eq!(found(&scene(&measure(same))), Vec::<String>::new(), "{expr}");
        let all = found(&scene(&measure(&format!("({same})*tau"))));
        assert_eq!(all.len(), 1, "{expr}: {all:#?}");
        assert!(all[0].starts_with("E501"), "{all:#?}");
    }
}

#[test]
fn what_needs_a_pure_number_refuses_others() {
    for expr in ["exp(l)", "log(s)", "cos(u(1))", "l^l", "2^s", "Norm(Expm(E*eps))", "l^x", "l^(s/E)"] {
        let all = found(&scene(&format!("measure q = max({expr}) on all")));
        assert!(!all.is_empty() && all.iter().all(|m| m.starts_with("E501")), "{expr}: {all:#?}");
    }
}

#[test]
fn terms_of_a_mixed_problem_are_compared_by_test_function() {
    assert_eq!(found(&scene("term mixed on all : p*Div_Test_u + Div_u*Test_p")), Vec::<String>::new());
    let all = found(&scene("term mixed on all : p*Div_Test_u + u(1)*Test_p"));
    assert_eq!(all, ["W505 | p*Div_Test_u + u(1)*Test_p: mm^3 | E*eps:Grad_Test_u + p*Test_p/E: mm^2"]);
    // a body force belongs to cells, a traction to faces
    assert_eq!(found(&scene("term body on all : -s/l*Test_u(1)\nterm push on west : -s*Test_u(1)")), [""; 0]);
    let all = found(&scene("load u = [s, 0] on all"));
    assert_eq!(all, ["W505 | [s, 0]: N | E*eps:Grad_Test_u + p*Test_p/E: MPa*mm"]);
    assert_eq!(found(&scene("load u = [s, 0] on west\nload u = [3, 0] on west")), [""; 0]);
}

#[test]
fn reactions_have_the_unit_of_their_equations() {
    let with = |lines: &str| found(&scene(&format!("fix u = [0,0] on west\n{lines}")));
    for (measured, right, wrong) in [
        ("measure r = reaction(u(1)) on west\n", "r < s*l", "r < s"),
        ("measure r = reaction(x*u(2)) on west\n", "r < s*l^2", "r < s*l"),
        ("measure r = reaction(u(1)) on west\nmeasure g = r/l\n", "g < s", "g < s*l"),
        ("measure g = reaction(u(1))/l on west\n", "g < s", "g < s*l"),
    ] {
        assert_eq!(with(&format!("{measured}expect {right}")), [""; 0], "{right}");
        let all = with(&format!("{measured}expect {wrong}"));
        assert!(all.len() == 1 && all[0].starts_with("E501"), "{wrong}: {all:#?}");
    }
    // where the terms do not fit, that is told, and nothing of what they add up to
    let all = with("load u = [s, 0] on all\nmeasure r = reaction(u(1)) on west\nexpect r < s");
    assert!(all.len() == 1 && all[0].starts_with("W505"), "{all:#?}");
}

#[test]
fn balances_have_the_unit_of_their_equations() {
    let with = |lines: &str| {
        found(&scene(&format!(
            "unknown q : scalar [MPa]\nterm flow on all : l*Grad_q.Grad_Test_q\nbalance heat of q\n{lines}"
        )))
    };
    assert_eq!(with("expect abs(heat_lost) < 1e-9*heat_in\nexpect heat_flow < s*l"), [""; 0]);
    for wrong in ["expect heat_lost < s", "expect heat_in < 3*l", "measure g = heat_out/l\nexpect g < l"] {
        let all = with(wrong);
        assert!(all.len() == 1 && all[0].starts_with("E501"), "{wrong}: {all:#?}");
    }
}

#[test]
fn an_energy_is_differentiated_by_its_unknowns() {
    assert_eq!(found(&scene("energy more on all : s/2*eps:eps")), [""; 0]);
    let all = found(&scene("energy more on all : s*l/2*eps:eps"));
    assert!(all.len() == 1 && all[0].starts_with("W505"), "{all:#?}");
}

#[test]
fn coordinates_have_the_unit_the_scene_gives_them_or_none() {
    let report = |text: &str| {
        let mut sources = SourceMap::new();
        let main = sources.add("scene.wfl", text);
        let checked = resolve(&mut sources, main, &mut NoFiles, &[]);
        let script = checked.value.unwrap();
        let report = unit_report(&script, &sources);
        report.iter().map(|u| format!("{} {}", u.name, u.unit)).collect::<Vec<_>>().join(", ")
    };
    assert_eq!(report(HERTZ), "X mm, u mm, d mm, a mm, p MPa, stress MPa");
    let heat = "mesh box [0,0] to [1,1] cells [4,4] quad\nunknown T : scalar [K]\n\
                param k = 3 [W/m/K]\nterm on all : k*Grad_T.Grad_Test_T\nmeasure flux = integral(k*Norm(Grad_T)) on all\n";
    assert_eq!(report(heat), "X not known, T K, flux not known");
    // conduction and a source: W/m/K*K/L^2 and W/m^3 agree for metres only
    let source = format!("{heat}param q = 1 [W/m^3]\nterm on all : -q*Test_T\n");
    assert_eq!(report(&source), "X m, T K, flux W");
    assert_eq!(found(&source), [""; 0]);
}

#[test]
fn a_file_gives_cells_a_size_without_a_dimension() {
    let text = "mesh file \"m.msh\"\nregion west = faces where x == 0\nunknown u : vector [mm]\nparam E = 1 [MPa]\n\
                term on all : E*Sym(Grad_u):Grad_Test_u\n";
    let push = |unit: &str| found(&format!("{text}param s = 1 {unit}\nterm push on west : s*(Normal.Test_u)"));
    assert_eq!(push("[MPa]"), [""; 0]);
    let all = push("[N]");
    assert!(all.len() == 1 && all[0].starts_with("W505"), "{all:#?}");
}

#[test]
fn params_take_the_unit_of_their_formula() {
    assert_eq!(found(&scene("param G = E/(2*(1 + 0.3))\nmeasure q = max(G + s) on all")), [""; 0]);
    assert_eq!(found(&scene("param a = 2*l [mm]\nparam b = 3*4 [mm]\nmeasure q = max(a + b) on all")), [""; 0]);
    let all = found(&scene("param a = 2*l [MPa]\nmeasure q = max(a + s) on all"));
    assert!(all.iter().any(|m| m.starts_with("E501 | 2*l: mm | [MPa]: MPa")), "{all:#?}");
}

#[test]
fn plain_numbers_take_the_unit_that_is_needed() {
    let lines = "steps t = 0 to 1 by 0.1\nfix u = [0.1*t + 0.2*x, 3*l + 0.5] on west\nstart p = 3 + x*y\n\
                 data c : scalar [W/m] = 3*x + 1\nload u = [-t, exp(x)] on west\nmeasure q = max(c) on all";
    assert_eq!(found(&scene(lines)), [""; 0]);
}

#[test]
fn a_function_of_the_step_variable_does_as_a_plain_number() {
    for value in [
        "sin(2*pi*t/T)",
        "sin(2*pi*t)",
        "(1 - exp(-t/T))",
        "tanh(t/T)",
        "Heaviside(t - T)",
        "sign(x - l)",
        "cos(pi*x/l)",
    ] {
        let lines = format!("param T = 2 [s]\nsteps t = 0 to 1 by 0.1 [s]\nfix u = [0.1*{value}, 0] on west");
        assert_eq!(found(&scene(&lines)), [""; 0], "{value}");
    }
    // what has a unit of its own keeps it
    let lines = "param T = 2 [s]\nsteps t = 0 to 1 by 0.1 [s]\nfix u = [E*sin(2*pi*t/T), 0] on west";
    assert!(!found(&scene(lines)).is_empty());
}

#[test]
fn a_macro_with_arguments_shows_its_use() {
    let mut sources = SourceMap::new();
    let text = scene("def add(a, b) = 2*a + b\nmeasure q = max(add(E, l)) on all");
    let main = sources.add("scene.wfl", text);
    let checked = resolve(&mut sources, main, &mut NoFiles, &[]);
    let d = checked.diagnostics.iter().find(|d| d.code == "E501").unwrap();
    let shown: Vec<_> = d.labels.iter().map(|l| (sources.snippet(l.span), l.text.as_str())).collect();
    assert_eq!(shown[..3], [("l", "mm"), ("2*a", "MPa"), ("add(E, l)", "from here")]);
}

/// A random expression of the names of `scene`, at most `depth` deep.
fn random_expr(random: &mut Random, depth: usize) -> String {
    const WORDS: [&str; 12] = ["E", "s", "l", "f", "k", "tau", "p", "u(1)", "x", "2", "0", "Div_u"];
    if depth == 0 {
        return WORDS[random.below(WORDS.len())].to_owned();
    }
    let (a, b) = (random_expr(random, depth - 1), random_expr(random, depth - 1));
    match random.below(11) {
        0 => format!("({a} + {b})"),
        1 => format!("({a} - {b})"),
        2 | 3 => format!("({a})*({b})"),
        4 | 5 => format!("({a})/({b})"),
        6 => format!("max({a}, {b})"),
        7 => format!("sqrt({a})"),
        8 => format!("({a})^2"),
        9 => format!("({a})^({b})"),
        _ => format!("(if {a} < {b} then {b} else {a})"),
    }
}

#[test]
fn the_verdict_does_not_depend_on_the_units_chosen() {
    // the same scene in millimetres and newtons, and in inches and pounds: what fits in one fits in the other
    let mut random = Random(7);
    let (mut right, mut wrong) = (0, 0);
    for i in 0..300 {
        let depth = 1 + i % 3;
        let line = format!("measure q = max({}) on all", random_expr(&mut random, depth));
        let text = scene(&line);
        let other = text.replace("[N/mm]", "[lbf/in]").replace("[MPa]", "[psi]").replace("[mm]", "[in]");
        let marks = |text: &str| -> Vec<String> {
            found(text).iter().map(|m| m.split(':').next().unwrap_or("").to_owned()).collect()
        };
        let (here, there) = (marks(&text), marks(&other));
        assert_eq!(here, there, "{line}");
        if here.is_empty() { right += 1 } else { wrong += 1 }
    }
    assert!(right > 25 && wrong > 25, "{right} right, {wrong} wrong");
}

#[test]
fn params_made_of_each_other_take_no_time() {
    let mut lines = String::from("param a0 = 1\n");
    for i in 1..60 {
        lines += &format!("param a{i} = a{0} + a{0} - a{0}\n", i - 1);
    }
    // the power is 1
    assert_eq!(found(&scene(&format!("{lines}measure q = max(l^a59 + l) on all"))), [""; 0]);
}

#[test]
fn the_unit_of_the_step_variable_is_declared_and_its_values_have_it() {
    let with = |lines: &str| found(&scene(lines));
    let own = "param lapse = 3 [s]\n";
    assert_eq!(with(&format!("{own}steps t = 0 to 2*lapse by 0.1 [s]\nmeasure q = max(t/lapse) on all")), [""; 0]);
    let all = with("steps t = 0 to 2*l by 0.1 [s]\nmeasure q = max(t) on all");
    assert!(all.iter().any(|m| m.starts_with("E501 | 2*l: mm")), "{all:#?}");
    let all = with(&format!("{own}steps t = 0 to lapse by 0.1 [ms]\nmeasure q = max(t) on all"));
    assert!(all.iter().any(|m| m.starts_with("E501 | lapse: s")), "{all:#?}");
    let auto = |limit: &str| {
        let steps = format!("steps t = 0 to lapse by auto [s] with first=1e-3*lapse, limit={limit} on all");
        with(&format!("{own}{steps}\nmeasure q = max(t) on all"))
    };
    assert_eq!(auto("0.1*lapse/max(l/l)"), [""; 0]);
    assert!(auto("0.1/max(l)").iter().any(|m| m.starts_with("E501")), "{:#?}", auto("0.1/max(l)"));
}

/// A plate in mm and MPa, with some text replaced and lines behind it.
fn plate(changes: &[(&str, &str)], lines: &str) -> String {
    let text =
        "param E = 210e3 [MPa]\nparam q = 100 [MPa]\nparam L = 100 [mm]\nmesh box [0,0] to [L,L] cells [2,2] quad\n\
        region left = faces where x == 0\nregion right = faces where x == L\nunknown u : vector [mm]\n\
        term bar on all : E*Sym(Grad_u):Grad_Test_u\nfix u = [0,0] on left\nload u = [q,0] on right\n"
            .to_owned();
    let changed = changes.iter().fold(text, |text, (old, new)| {
        assert!(text.contains(old), "{old}");
        text.replace(old, new)
    });
    changed + lines
}

/// The mesh in plain numbers, so that nothing says what coordinates are.
const PLAIN: [(&str, &str); 3] = [("[L,L]", "[100,100]"), ("== L", "== 100"), ("param L = 100 [mm]\n", "")];

fn codes(text: &str) -> Vec<String> {
    found(text).iter().map(|m| m[..4].to_owned()).collect()
}

#[test]
fn a_prefix_is_wrong_between_any_two_parts_of_a_scene() {
    let wrong = [
        plate(&[("210e3 [MPa]", "210 [GPa]")], ""),
        plate(&[("100 [MPa]", "1e5 [kPa]")], ""),
        plate(&[("100 [mm]", "0.1 [m]")], ""),
        plate(&[("vector [mm]", "vector [m]")], ""),
        plate(&[("= [0,0] on", "(1) = d*y/L on")], "param d = 1 [m]\nfix u(2) = 0 on left\n"),
        plate(&[("E*Sym", "k*Sym")], "data k : scalar [GPa] = 210\n"),
        plate(&[("[q,0]", "[p,0]")], "data p : scalar [kPa] = 1e5\n"),
        plate(&[], "region c = nodes where x == L and y == L\nparam F = 1 [kN/mm]\nload u = [F,0] on c\n"),
        plate(&[], "param gamma = 1 [GPa/mm]\nterm c on right : gamma*pos_part(u.Normal)*(Test_u.Normal)\n"),
        plate(&[], "multiplier l : scalar on right [kPa]\nterm t on right : l*(Test_u.Normal) + (u.Normal)*Test_l\n"),
        plate(&[("[q,0]", "[r*t,0]")], "param r = 3 [MPa/year]\nsteps t = 0 to 5 by 1 [s]\n"),
        plate(&[], "param c = 3 [MPa*s/mm]\nterm v on right : c*Dot_u.Test_u\nsteps t = 0 to 5 by 1 [h]\n"),
        plate(&[], "param rho = 7850 [kg/m^3]\nterm m on all : rho*Dot2_u.Test_u\nsteps t = 0 to 1 by 0.1\n"),
        plate(&[], "param w = 0.1 [m]\nmeasure tip = value(u(1)) at [w,0]\n"),
        plate(&[("x == L", "x > w")], "param w = 0.09 [m]\n"),
        plate(&[&PLAIN[..], &[("210e3 [MPa]", "210 [GPa]")]].concat(), ""),
        plate(&[&PLAIN[..], &[("vector [mm]", "vector"), ("210e3 [MPa]", "210 [GPa]")]].concat(), ""),
    ];
    for scene in &wrong {
        assert_eq!(codes(scene).len(), 1, "{scene}{:#?}", found(scene));
    }
}

#[test]
fn scenes_that_fit_and_scenes_with_few_units_are_silent() {
    let right = [
        plate(&[], ""),
        plate(&PLAIN, ""),
        plate(&[("L = 100 [mm]", "L = 100")], ""),
        plate(&[("vector [mm]", "vector"), ("L = 100 [mm]", "L = 100")], ""),
        plate(&[("[q,0]", "[100*t,0]")], "steps t = 0 to 5 by 1 [s]\n"),
        plate(&[("[q,0]", "[r*t,0]")], "param r = 3 [MPa/s]\nsteps t = 0 to 5 by 1 [s]\n"),
        plate(&[("[q,0]", "[q*sin(2*pi*t/T),0]")], "param T = 3 [s]\nsteps t = 0 to 5 by 1 [s]\n"),
        plate(&[("[q,0]", "[q*(1 - y^2/2500),0]")], ""),
        plate(&[("[q,0]", "[q*x,0]")], ""),
        plate(&[("= [0,0] on", "(1) = 0.01*y on")], ""),
        plate(&[("x == L", "x > 99 and y < 50*sin(x/10) + 60")], ""),
        plate(&[], "param rho = 7.85e-9 [t/mm^3]\nterm m on all : rho*Dot2_u.Test_u\nsteps t = 0 to 1 by 0.1\n"),
        plate(
            &[],
            "measure tip = value(u(1)) at [L,50]\nregion c = nodes where x == L and y == 50\n\
            param F = 1 [N/mm]\nload u = [F,0] on c\n",
        ),
    ];
    for scene in &right {
        assert_eq!(found(scene), Vec::<String>::new(), "{scene}");
    }
}
