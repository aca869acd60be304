//! A parameter at every place where the language takes one: its derivative is that of the runs, or it is refused, or a note
//! tells that nothing follows it. A zero that nobody tells would be taken for a result.

use std::path::Path;

use wfl_gradient::{Request, ahead, gradients};
use wfl_tests::{ran, refused, solve, solved};

/// A body with a rate, a state, data, loads and prescribed values; what cases put in the place of its parts has `p` in it.
const SCENE: &str = "wfl 1
param p = 1.25
mesh box [0,0] to [2,1] cells [4,2] quad
region left = faces where x == 0
region right = faces where x == 2
region top = faces where y == 1
unknown u : scalar
state s : scalar := s + timestep*(Grad_u(1) - s)/2
data k : scalar = 1 + x/4
term bulk on all : k*(1 + u^2/10)*Grad_u.Grad_Test_u - 0.1*s*Grad_Test_u(1)
term drag on all : 0.3*Dot_u*Test_u
load u = 0.2*t on top
start u = 0.1*x
fix u = 0 on left
fix u = 0.5*t + 0.2 on right
steps t = 0 to 1 by 0.5
measure m = mean(u^2) on all
";

/// What becomes of a case.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ends {
    /// The derivative is that of the runs, and none of them is zero.
    Followed,
    /// E470, before a run if that is known then.
    Refused,
    /// A note, and a derivative that the runs have, too, if the branches of their points stay.
    Noted,
}
use Ends::{Followed, Noted, Refused};

/// A place, what is replaced, by what (added at the end if nothing is replaced), and what becomes of it.
type Case = (&'static str, &'static str, &'static str, Ends);

const WITH_FIRST_RATES: &[Case] = &[
    ("a term", "0.3*Dot_u", "0.3*p*Dot_u", Followed),
    ("an energy", "", "energy more on all : p*u^4/40\n", Followed),
    ("a load on faces", "0.2*t on top", "0.2*p*t on top", Followed),
    ("a load that follows the solution", "0.2*t on top", "0.2*t - 0.3*p*u - 0.1*u^2 on top", Followed),
    ("a load on nodes", "", "region tip = nodes where x == 1 and y == 1\nload u = 0.1*p on tip\n", Followed),
    ("data", "1 + x/4", "1 + p*x/4", Followed),
    ("the update of a state", "- s)/2", "- s)/(2*p)", Followed),
    ("the first value of a state", "", "start s = 0.1*p*x*y\n", Followed),
    ("first values", "start u = 0.1*x", "start u = 0.08*p*x", Followed),
    ("a prescribed value", "0.5*t + 0.2", "0.4*p*t + 0.2", Followed),
    ("the increment in a law", "0.3*Dot_u*Test_u", "0.3*(Dot_u + p*timestep*u)*Test_u", Followed),
    ("a measure", "mean(u^2)", "mean(p*u^2)", Followed),
    ("a largest value", "mean(u^2) on all", "max(p*u^2 - x) on all", Followed),
    (
        "a number made of measures",
        "measure m = mean(u^2) on all",
        "measure a = mean(u^2) on all\nmeasure m = p*a + p^2",
        Followed,
    ),
    ("another param", "0.3*Dot_u", "0.3*q*Dot_u", Followed),
    ("a macro", "0.3*Dot_u", "drag(p)*Dot_u", Followed),
    ("the argument of a function", "0.3*Dot_u", "exp(p)/9*Dot_u", Followed),
    ("a global unknown", "0.2*t on top", "0.2*t*p on top", Followed),
    ("a side of a kink", "0.3*Dot_u", "0.3*pos_part(Dot_u + p)", Followed),
    ("the map of the mesh", "cells [4,2] quad", "cells [4,2] quad map [x, y + 0.1*p*y*(1 - y)]", Followed),
    ("the division of the mesh", "cells [4,2]", "cells [4*p - 1,2]", Refused),
    ("a refinement", "region left", "refine where x < 0.3*p\nregion left", Refused),
    ("a region of cells", "", "region part = cells where x < p\nload u = 0.1 on part\n", Refused),
    ("a region of faces", "faces where y == 1", "faces where y == 0.8*p", Refused),
    ("the end of the steps", "0 to 1 by", "0 to 0.8*p by", Refused),
    ("the beginning of the steps", "t = 0 to 1", "t = p - 1.25 to 1", Refused),
    ("the increment", "by 0.5", "by 0.4*p", Refused),
    ("the error of the steps", "by 0.5", "by auto with error=p*1e-3", Refused),
    ("the limit of the increment", "by 0.5", "by auto with limit=p*max(u) on all", Refused),
    ("a rule of integration", "", "quadrature on all degree 4*p\n", Refused),
    ("an option of the solver", "", "solver newton with tol=p*1e-9\n", Refused),
    ("the point of a measure", "mean(u^2) on all", "value(u) at [p,0.5]", Followed),
    ("the weights of a reaction", "mean(u^2) on all", "reaction(p*u) on right", Refused),
    ("a share", "mean(u^2) on all", "mean(if u > p/10 then 1 else 0) on all", Refused),
    ("a count", "mean(u^2) on all", "integral(Heaviside(u - p/10)) on all", Refused),
    (
        "a mapping",
        "",
        "mapping beside = point [x*0.8*p,y]\nterm far on all : 0.1*Interpolate(u, beside)*Test_u\n",
        Refused,
    ),
    ("a condition of positions", "0.3*Dot_u", "0.3*(if x < 1.1*p then 1 else 2)*Dot_u", Noted),
    ("an event", "", "event high = m > p\n", Noted),
    ("an expectation", "", "expect m < 100*p\n", Noted),
    ("nothing", "", "", Noted),
];

const WITH_SECOND_RATES: &[Case] = &[
    ("a mass", "0.3*Dot2_u", "0.3*p*Dot2_u", Followed),
    ("first rates", "start Dot_u = 0.1*x", "start Dot_u = 0.08*p*x", Followed),
    ("a prescribed value with a rate", "0.5*t + 0.2", "0.4*p*t^2 + 0.2", Followed),
    ("an option of the scheme", "", "scheme newmark beta=0.24*p\n", Refused),
    ("another option of the scheme", "", "scheme newmark beta=0.36 gamma=0.48*p\n", Refused),
];

/// A body of vectors with a multiplier, inclined supports and loads by component.
const VECTORS: &str = "wfl 1
param p = 1.25
mesh box [0,0] to [1,1] cells [2,2] quad
region west = faces where x == 0
region east = faces where x == 1
region south = faces where y == 0
region north = faces where y == 1
unknown u : vector
multiplier l : scalar on west
data k : scalar = 1 + x/4
term bulk on all : 2*k*Sym(Grad_u):Grad_Test_u + k*Div_u*Div_Test_u
term hold on west : l*Test_u(1) + (u(1) - 0.02*y)*Test_l
fix u.Normal = 0.01*t on south
load u(1) = 0.3 on east
steps t = 1 to 2 by 1
measure m = mean(u(1)^2) on east
";

const OF_VECTORS: &[Case] = &[
    ("a prescribed normal component", "0.01*t on south", "0.01*p*t*(1 + x) on south", Followed),
    ("a load on a component", "0.3 on east", "0.3*p on east", Followed),
    ("a load along the normal", "", "load u.Normal = 0.1*p on north\n", Followed),
    ("the equation of a multiplier", "0.02*y", "0.02*p*y", Followed),
    ("a vector of data", "0.3 on east", "f(1) on east\ndata f : vector = [0.3*p, y]", Followed),
    ("data of the step before", "0.3 on east", "0.3*Previous_f on east\ndata f : scalar = p*t", Followed),
    ("the largest value at nodes", "mean(u(1)^2) on east", "max(p*u(1) - y/9) at nodes of east", Followed),
    ("a value at a point", "mean(u(1)^2) on east", "value(p*u(1)) at [1,0.3]", Followed),
    ("an integral over a region", "mean(u(1)^2) on east", "integral(p*u.Normal) on east", Followed),
    ("the step of a result", "", "gradient m at t = 1.6*p - 1 with p\n", Refused),
];

/// The scene of a case.
fn text(scene: &str, case: &Case) -> String {
    let (what, from, to, _) = case;
    let text = match *from {
        "" => format!("{scene}{to}"),
        from => {
            assert!(scene.contains(from), "{what}: no {from}");
            scene.replacen(from, to, 1)
        }
    };
    let behind = "param p = 1.25\nparam q = 2*p/2.5\ndef drag(a) = 0.24*a\n";
    text.replacen("param p = 1.25\n", behind, 1)
}

/// The measure at the last step.
fn value(text: &str, p: f64) -> f64 {
    let solved =
        solve(Path::new("."), text.to_owned(), &[], &[("p", p)]).unwrap_or_else(|told| panic!("{told}\n{text}"));
    assert!(solved.outcome.converged(), "{text}");
    let last = solved.outcome.steps.last().expect("a step");
    last.measures.iter().find(|m| m.0 == "m").expect("a measure").1
}

/// What is wrong with a case; nothing if nothing is.
fn wrong(scene: &str, case: &Case) -> Option<String> {
    let (what, _, _, ends) = case;
    let text = text(scene, case);
    let request = Request::read("m", "p").expect("names");
    let found = ran((Path::new("."), text.clone()), &[], &[], |of| {
        let before = ahead(of.scene, of.script, &request).is_err();
        gradients(of, &request).map(|found| (found, before))
    });
    match (found, ends) {
        (Err(told), Refused) if told.contains("E470") => None,
        (Err(told), _) => Some(format!("{what}: {told}")),
        (Ok(_), Refused) => Some(format!("{what}: not refused")),
        (Ok((_, (_, true))), _) => Some(format!("{what}: refused before the run, and not behind it")),
        (Ok((_, (found, false))), ends) => {
            let told = found.notes.iter().any(|note| note.contains("`p`"));
            let derivative = found.number("m", "p").expect("a number");
            let change = 1e-4;
            let difference = (value(&text, 1.25 + change) - value(&text, 1.25 - change)) / (2.0 * change);
            let size = derivative.abs().max(difference.abs());
            if (derivative - difference).abs() > 1e-5 * size + 1e-9 {
                return Some(format!("{what}: {derivative} and not {difference}"));
            }
            match ends {
                Noted if told => None,
                Noted => Some(format!("{what}: nothing is told")),
                _ if difference.abs() > 1e-6 => None,
                _ => Some(format!("{what}: it has no effect, and tests nothing")),
            }
        }
    }
}

#[test]
fn a_parameter_at_any_place_is_followed_or_refused_or_told() {
    let dynamic =
        SCENE.replace("0.3*Dot_u", "0.3*Dot2_u").replace("start u = 0.1*x\n", "start u = 0.1*x\nstart Dot_u = 0.1*x\n");
    let first = WITH_FIRST_RATES.iter().filter_map(|case| wrong(SCENE, case));
    let second = WITH_SECOND_RATES.iter().filter_map(|case| wrong(&dynamic, case));
    let third = OF_VECTORS.iter().filter_map(|case| wrong(VECTORS, case));
    let all: Vec<String> = first.chain(second).chain(third).collect();
    assert!(all.is_empty(), "{}", all.join("\n"));
}

/// What is known without a run is refused without one.
#[test]
fn what_is_refused_is_refused_before_the_run() {
    let late: Vec<&str> = WITH_FIRST_RATES
        .iter()
        .filter(|case| case.3 == Refused)
        .filter(|case| {
            let request = Request::read("m", "p").expect("names");
            // the run itself is not needed, but what it is made of
            let before = ran((Path::new("."), text(SCENE, case)), &[], &[], |of| {
                Ok(ahead(of.scene, of.script, &request).is_err())
            });
            !before.expect("a run").1
        })
        .map(|case| case.0)
        .collect();
    assert!(late.is_empty(), "{late:?}");
}

/// What would count as zero, or as a part of what it says, is refused: scenes that differ from a right one by a few words.
#[test]
fn what_would_count_as_zero_is_refused() {
    let bar = "mesh box [0] to [1] cells [4] segment\nregion west = faces where x == 0\nregion east = faces where x == 1\n\
               unknown u : scalar\nfix u = 0 on west\nload u = 1 on east\nsteps t = 0 to 1 by 0.5\n\
               state h : scalar on all := h + 3*timestep\ndata k : scalar on all = t*x\nmapping back = point x - 1\n";
    let term = "term bar on all : Grad_u.Grad_Test_u";
    let right = format!("{bar}{term}\nmeasure m = max(Interpolate(u, back)) on east\nmeasure r = mean(Dot_h) on all\n");
    assert_eq!(solved(right).measure(1, "r"), 3.0);
    let cases = [
        ("a rate of a state in a term", "E461", format!("{bar}{term} - Dot_h*Test_u\n")),
        ("... of an expression with one", "E461", format!("{bar}{term} - Rate(2*h)*Test_u\n")),
        ("... in the update of another one", "E461", format!("{bar}{term}\nstate g : scalar on all := g + Dot_h\n")),
        ("... in a load", "E461", format!("{bar}{term}\nload u = Dot_h on all\n")),
        (
            "a rate of data within a step",
            "E461",
            format!("{bar}{term} + Dot_u*Test_u - Dot_k*Test_u\nscheme hht\n").replace(" := h + 3*timestep", " := h"),
        ),
        (
            "the past beside a state within the step",
            "E461",
            format!("{bar}{term} + (u - Previous_u)/timestep*Test_u + Dot2_u*Test_u\nscheme hht\n")
                .replace(" := h + 3*timestep", " := h"),
        ),
        (
            "nodes through a mapping",
            "E802",
            format!("{bar}{term}\nmeasure m = max(Interpolate(u, back)) at nodes of east\n"),
        ),
        (
            "the size of cells in their map",
            "E405",
            format!("{bar}{term}\n").replace(" segment\n", " segment map x*(1 + element_size)\n"),
        ),
        ("data through a mapping", "E407", format!("{bar}{term}\n").replace("= t*x", "= Interpolate_filter(back, 3)")),
        (
            "prescribed values through a mapping",
            "E407",
            format!("{bar}{term}\nfix u = Interpolate_filter(back, 3) on east\n"),
        ),
        ("a reaction of a gradient", "E460", format!("{bar}{term}\nmeasure r = reaction(u + Grad(u)(1)) on west\n")),
        ("a reaction that turns", "E460", format!("{bar}{term}\nmeasure r = reaction(t*u) on west\n")),
    ];
    for (what, code, text) in cases {
        let told = refused(&text);
        assert!(told.contains(&format!("error[{code}]")), "{what}: {told}");
    }
}

/// Formulas of a scene with rates need a value where something is solved, not where time starts.
#[test]
fn a_load_without_a_value_at_the_start_is_no_error() {
    let text = "mesh box [0] to [1] cells [2] segment\nregion west = faces where x == 0\nregion east = faces where x == 1\n\
                unknown u : scalar\nterm bar on all : Dot_u*Test_u + Grad_u.Grad_Test_u\nfix u = 0 on west\n\
                load u = 1/sqrt(t) on east\nsteps t = 0 to 1 by 0.5\nmeasure end = value(u) at [1]\n";
    assert!(solved(text).measure(2, "end") > 0.1);
}
