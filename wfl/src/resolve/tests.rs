use std::collections::BTreeMap;

use super::*;
use crate::{
    parse::parse_expr,
    render::render,
    script::FieldKind,
    testing::{Random, SCENES, codes, show, show_cond, tree, value},
};

/// Files by name.
struct Files(BTreeMap<&'static str, String>);

impl Loader for Files {
    fn load(&mut self, path: &str, _from: SourceId) -> Result<(String, String), Unloaded> {
        self.0.get(path).map(|t| (path.to_owned(), t.clone())).ok_or_else(|| "no such file".to_owned().into())
    }
}

fn run(text: &str, files: &[(&'static str, &str)], overrides: &[&str]) -> (Checked<ResolvedScript>, SourceMap) {
    let mut sources = SourceMap::new();
    let main = sources.add("scene.wfl", text);
    let given = overrides.iter().map(|o| {
        let (name, value) = o.split_once('=').unwrap();
        let line = sources.add("(command line)", *o);
        let id = sources.add("(command line)", value);
        let value = parse_expr(&sources, id).value.unwrap();
        Override { name: name.to_owned(), value, span: Span { source: line, start: 0, end: o.len() as u32 } }
    });
    let given: Vec<Override> = given.collect();
    let mut loader = Files(files.iter().map(|(n, t)| (*n, (*t).to_owned())).collect());
    (resolve(&mut sources, main, &mut loader, &given), sources)
}

/// Codes with the first marked text of each message.
fn found(text: &str, files: &[(&'static str, &str)]) -> Vec<(&'static str, String)> {
    let (checked, sources) = run(text, files, &[]);
    let mark = |d: &Diagnostic| d.labels.first().map_or(String::new(), |l| sources.snippet(l.span).to_owned());
    checked.diagnostics.iter().map(|d| (d.code.as_str(), mark(d))).collect()
}

/// A scene that is right, with room for one more line.
fn scene(line: &str) -> String {
    format!(
        "mesh box [0,0] to [1,1] cells [4,4] quad\nregion west = faces where x == 0\nunknown u : vector\n\
         param k = 2\nterm on all : k*Grad_u:Grad_Test_u\nfix u = [0,0] on west\n{line}\n"
    )
}

#[test]
fn the_five_scenes_resolve_without_a_word() {
    for (name, text) in SCENES {
        let (checked, _) = run(text, &[], &[]);
        assert!(checked.diagnostics.is_empty(), "{name}: {:?}", checked.diagnostics);
        let script = checked.value.unwrap();
        assert!(script.mesh.is_some() && !script.terms.is_empty() && script.macros.iter().all(|m| m.used), "{name}");
    }
    let (checked, _) = run(SCENES[2].1, &[], &[]);
    let script = checked.value.unwrap();
    assert_eq!((script.params.len(), script.regions.len(), script.fields.len(), script.terms.len()), (5, 7, 3, 4));
    assert_eq!((script.fixes.len(), script.loads.len(), script.outputs.len(), script.measures.len()), (2, 2, 2, 2));
    assert_eq!(script.fields[2].kind, FieldKind::Multiplier { crosspoints: crate::ast::Crosspoints::Drop });
    assert_eq!(script.outputs[1].items[2].name, "sigma(uL)");
    let (checked, sources) = run(SCENES[3].1, &[], &[]);
    let script = checked.value.unwrap();
    assert!(script.expects[0].text.starts_with("abs(a/a_ref - 1) < 0.05"));
    assert!(show_cond(&script.expects[0].condition).contains("sqrt"));
    assert_eq!(
        (script.terms[2].places[0].name.as_str(), sources.snippet(script.starts[0].span)),
        ("global", "start   d = 0.01")
    );
}

#[test]
fn a_correct_scene_says_nothing_and_each_slip_says_its_own() {
    assert_eq!(found(&scene(""), &[]), []);
    for (line, expected) in [
        ("param k = 3", &[("E209", "k")][..]),
        ("def u = 3", &[("E209", "u")]),
        ("region west = cells", &[("E209", "west")]),
        ("param sin = 3", &[("E210", "sin")]),
        ("param Normal = 3", &[("E210", "Normal")]),
        ("def Test_w = 3", &[("E210", "Test_w")]),
        ("def x = 3", &[("E210", "x")]),
        ("def f(a, a) = 3", &[("E209", "a")]),
        ("def f(Grad_a) = 3", &[("E210", "Grad_a")]),
        ("region all = cells", &[("E210", "all")]),
        ("fix u = 0 on wset", &[("E201", "wset")]),
        ("fix w = 0 on west", &[("E201", "w")]),
        ("fix k = 0 on west", &[("E212", "k")]),
        ("load u = 0 on global", &[("E212", "global")]),
        ("unknown v : vector on there", &[("E201", "there")]),
        ("mesh file \"a\"", &[("E424", "mesh file \"a\"")]),
        ("steps t = 0 to 1 by 1\nsteps t = 0 to 1 by 1", &[("E424", "steps t = 0 to 1 by 1")]),
        ("solver newton with tolerance=1", &[("E211", "tolerance")]),
        ("solver newtn", &[("E211", "newtn")]),
        ("solver newton with tol=1, tol=2", &[("E209", "tol")]),
        ("output vtu \"a\" : u", &[("E211", "vtu")]),
        ("mesh file \"a\" with b", &[("E424", "mesh file \"a\" with b")]),
        ("multiplier l : scalar on west with crosspoints=lose", &[("E211", "crosspoints")]),
        ("region a = b + west\nregion b = a - west", &[("E123", "a")]),
        ("term on all : Def u := 2; Test_u", &[("E209", "u")]),
        ("term on all : Def k := 2; k*Test_u", &[("E209", "k")]),
        ("term on all : Def sin(x) := 2; sin(1)*Test_u", &[("E210", "sin")]),
        ("use \"nothing.wfl\"", &[("E213", "use \"nothing.wfl\"")]),
        ("wfl 1", &[("E126", "wfl 1")]),
        ("param h = 2", &[("W702", "h")]),
        ("def f(v) = k*v", &[("W702", "f")]),
        ("region e = faces", &[("W702", "e")]),
        ("unknown v : scalar", &[("W702", "v")]),
        ("data d : scalar = 2", &[("W702", "d")]),
        ("state q : scalar on west := Previous_q + 1", &[("W702", "q")]),
        ("state q : scalar on west := Previous_q + 1\nmeasure m = mean(q) on west", &[]),
        ("state q : scalar on west := Previous_r\nstate r : scalar on west := Previous_q", &[]),
        ("refine on west where x < 1 times 2 along x", &[]),
        ("refine on there times k", &[("E201", "there")]),
        ("split u across west", &[]),
        ("split k across west", &[("E212", "k")]),
        ("quadrature on west vertex\nmeasure m = mean(u(1)) on west\nstart u = [0,0]\nstart from \"old\"", &[]),
    ] {
        let expected: Vec<_> = expected.iter().map(|(c, m)| (*c, (*m).to_owned())).collect();
        assert_eq!(found(&scene(line), &[]), expected, "{line}");
    }
}

#[test]
fn what_every_scene_needs_is_missed() {
    assert_eq!(found("", &[]).iter().map(|f| f.0).collect::<Vec<_>>(), ["E423", "E421", "E422"]);
    // but not while a statement cannot be read
    assert_eq!(found("mesh bxo\n", &[]), [("E113", "bxo".to_owned())]);
    assert_eq!(found("wfl 2\n", &[])[0].0, "E126");
}

#[test]
fn names_that_are_near_are_offered_with_their_line() {
    let (checked, sources) = run(&scene("fix u = 0 on wset"), &[], &[]);
    let text = render(&checked.diagnostics[0], &sources);
    assert!(text.contains("^^^^ did you mean `west`, region on line 2?"), "{text}");
    let (checked, sources) = run(&scene("region c = cels"), &[], &[]);
    assert!(render(&checked.diagnostics[0], &sources).contains("did you mean `cells`?"));
}

#[test]
fn regions_of_a_mesh_file_are_not_known_here() {
    let text = scene("load u = 0 on group_of_the_file")
        .replace("mesh box [0,0] to [1,1] cells [4,4] quad", "mesh file \"a.msh\"");
    assert_eq!(found(&text, &[]), []);
}

#[test]
fn regions_stand_behind_what_they_are_made_of() {
    let (checked, _) =
        run(&scene("region a = b + c\nregion b = faces of c\nregion c = west\nload u = 0 on a"), &[], &[]);
    let script = checked.value.unwrap();
    let names: Vec<&str> = script.regions.iter().map(|r| r.name.name.as_str()).collect();
    assert_eq!(names, ["west", "c", "b", "a"]);
}

#[test]
fn t_is_free_without_steps_and_z_in_the_plane() {
    assert_eq!(found(&scene("param t = 1\ndef z = 2\nload u = t*z on west"), &[]), []);
    assert_eq!(found(&scene("steps t = 0 to 1 by 1\nparam t = 1"), &[]), [("E209", "t".to_owned())]);
}

#[test]
fn files_are_included_once_and_not_in_circles() {
    let files = [("a.wfl", "use \"b.wfl\"\ndef f = 2*g\n"), ("b.wfl", "def g = 3\n")];
    let text = scene("use \"a.wfl\"\nuse \"b.wfl\"\nload u = f*g on west");
    let (checked, _) = run(&text, &files, &[]);
    assert_eq!(codes(&checked.diagnostics), "");
    assert_eq!(show(&checked.value.unwrap().loads[0].value), tree("(2*3)*3"));
    let circle = [("a.wfl", "use \"b.wfl\"\n"), ("b.wfl", "use \"a.wfl\"\n")];
    assert_eq!(found(&scene("use \"a.wfl\""), &circle), [("E214", "use \"a.wfl\"".to_owned())]);
    let own = [("scene.wfl", "use \"scene.wfl\"\n")];
    assert_eq!(found(&scene("use \"scene.wfl\""), &own), [("E214", "use \"scene.wfl\"".to_owned())]);
    // unused macros of a file are no matter; errors in it are
    assert_eq!(found(&scene("use \"a.wfl\""), &[("a.wfl", "def f = 1\nparam p = 2\n")]), []);
    assert_eq!(found(&scene("use \"a.wfl\""), &[("a.wfl", "def f = 1**2\n")]), [("E107", "**".to_owned())]);
}

/// A macro that is replaced is told where others of the library that the scene uses are made with it, and where it says another thing.
#[test]
fn a_macro_that_others_of_the_library_are_made_with_is_told() {
    let told = |def: &str, term: &str| {
        let text = format!(
            "param E = 1\nparam nu = 0.3\nuse \"elasticity\"\n{def}\nmesh box [0,0] to [1,1] cells [1,1] quad\n\
             unknown u : vector\nterm bulk on all : {term}"
        );
        let mut sources = SourceMap::default();
        let main = sources.add("scene.wfl", text);
        let found = resolve(&mut sources, main, &mut NoFiles, &[]).diagnostics;
        let told = |d: &&Diagnostic| d.code == Code::W704;
        found.iter().find(told).map(|d| format!("{} {:?}", d.message, d.labels))
    };
    let work = "work(u, Test_u, E, nu)";
    let said = told("def strain(v) = 2*Sym(Grad_v)", work).expect("a warning");
    assert!(said.contains("`strain` takes the place") && said.contains("`stress` of the library"), "{said}");
    assert_eq!(told("def strain(v) = Sym( Grad_v )", work), None, "the same");
    assert_eq!(told("def strain(v) = 2*Sym(Grad_v)", "strain(u):Grad_Test_u"), None, "no macro of the library is used");
    assert_eq!(told("def shears(v) = 2*Sym(Grad_v)", work), None);
}

/// The laws of the library have, for any values of the fields, the value of the terms that the scenes write out.
#[test]
fn the_library_says_what_the_scenes_write_out() {
    let terms = |text: &str| {
        let (checked, _) = run(text, &[], &[]);
        assert_eq!(codes(&checked.diagnostics), "", "{:?}", checked.diagnostics);
        checked.value.unwrap().terms
    };
    let own = ["def jump", "def tang", "def trac", "def Pn", "def Pt ", "def Ptheta", "def force", "term "];
    let laws = ["nitsche(uL,uR,gamma,theta,fric)", "penalty(uL,uR,gamma,fric)", "augmented(uL,uR,lambda,gamma,fric)"];
    for ((_, text), law) in SCENES[..3].iter().zip(laws) {
        let kept = text.lines().filter(|l| !own.iter().any(|o| l.starts_with(o)) && !l.contains("jump"));
        let kept: String = kept.map(|l| format!("{l}\n")).collect();
        let expected: f64 = terms(text)[2..].iter().map(|t| value(&t.expr)[0]).sum();
        let got = value(&terms(&format!("use \"contact.wfl\"\n{kept}term on fault : {law}\n"))[0].expr)[0];
        assert!((got - expected).abs() < 1e-12 * expected.abs().max(1.0), "{law}: {got} {expected}");
    }
}

#[test]
fn the_library_of_elasticity_expands() {
    let line = "use \"elasticity.wfl\"\nmeasure s = max(von_mises(sigma(u, k, 0.3))) on all\nmeasure w = integral(elastic_energy(u, k, 0.3)) on all\n\
        measure t = mean(traction(u, k, 0.3).Normal) on west\nmeasure p = mean(plane_stress(u, k, 0.3)(1,1)) on all\nmeasure m = mean(column_modulus(k,0.3)/bulk_modulus(k,0.3)) on all";
    let (checked, _) = run(&scene(line), &[], &[]);
    assert_eq!(codes(&checked.diagnostics), "", "{:?}", checked.diagnostics);
    let script = checked.value.unwrap();
    let lambda = "k*0.3/((1+0.3)*(1-2*0.3))";
    let sigma = format!("({lambda})*Div_u*Id(meshdim) + 2*(k/(2*(1+0.3)))*Sym(Grad_u)");
    assert_eq!(show(&script.measures[0].expr), tree(&format!("sqrt(1.5)*Norm(Deviator({sigma}))")));
    // a scene may say what sigma is and still use the rest
    let own = scene("use \"elasticity.wfl\"\nuse \"contact.wfl\"\ndef sigma(v) = 7*Grad_v\nload u = trac(u) on west");
    let (checked, _) = run(&own, &[], &[]);
    assert_eq!(codes(&checked.diagnostics), "");
    assert_eq!(show(&checked.value.unwrap().loads[0].value), tree("(7*Grad_u)*Normal"));
}

#[test]
fn overrides_replace_values_and_unknown_ones_are_named() {
    let (checked, sources) = run(&scene("param e = 1 in {1, 2}\nload u = e on west"), &[], &["k=1e4", "e=k+1"]);
    let script = checked.value.unwrap();
    assert_eq!(codes(&checked.diagnostics), "");
    assert_eq!((show(&script.params[0].value), show(&script.params[1].value)), ("10000".to_owned(), tree("k+1")));
    assert_eq!(sources.snippet(script.params[1].overridden.unwrap()), "e=k+1");
    let text = render(&script.params[1].outside_domain(&sources), &sources);
    assert!(text.contains("error[E701]: `e` must be one of 1, 2\n --> (command line):1:1"), "{text}");
    assert!(text.contains("^^^^^ declared: param e = 1 in {1, 2}, scene.wfl:7"), "{text}");
    let (checked, sources) = run(&scene(""), &[], &["kk=3"]);
    let text = render(&checked.diagnostics[0], &sources);
    assert!(text.contains("E703") && text.contains("did you mean `k`, param on line 4 of scene.wfl?"), "{text}");
    let (checked, _) = run(&scene(""), &[], &["k=3", "k=4"]);
    assert_eq!(codes(&checked.diagnostics), "E209");
}

#[test]
fn several_slips_are_all_found_in_one_run() {
    let codes =
        found(&scene("fix w = 0 on wset\noutput vtu \"a\" : f(1,2)\ndef f(a) = a\nsolver newton with a, b"), &[]);
    let codes: Vec<_> = codes.iter().map(|c| c.0).collect();
    assert_eq!(codes, ["E201", "E201", "E211", "E105", "E211", "E211"]);
}

/// Scenes with lines dropped, doubled, swapped and words exchanged: no panic, and every message can be shown.
#[test]
fn no_scene_panics() {
    let mut random = Random(42);
    let words: Vec<&str> =
        SCENES.iter().flat_map(|(_, t)| t.split(|c: char| !c.is_ascii_alphanumeric() && c != '_')).collect();
    for round in 0..1500 {
        let (_, text) = SCENES[random.below(SCENES.len())];
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        for _ in 0..1 + random.below(3) {
            let (i, j) = (random.below(lines.len()), random.below(lines.len()));
            match random.below(4) {
                0 => drop(lines.remove(i)),
                1 => lines.insert(i, lines[j].clone()),
                2 => lines.swap(i, j),
                _ => {
                    let (old, new) = (words[random.below(words.len())], words[random.below(words.len())]);
                    lines[i] = lines[i].replacen(old, new, 1);
                }
            }
        }
        let (checked, sources) = run(&lines.join("\n"), &[], &[]);
        if round % 10 == 0 {
            checked.diagnostics.iter().for_each(|d| assert!(render(d, &sources).contains(d.code.as_str())));
        }
    }
}
