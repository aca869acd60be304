//! Unknowns in units far apart: a pressure in pascals beside a displacement in metres, a viscosity of the mantle. The numbers of a
//! scene do not follow the units that it is written in, however its terms are parted.
//!
//! Whether a tangent is symmetric decides what is stored of it and how it is factored; the largest entry, which is that of the
//! stiff unknown, says nothing of a coupling of one.

use wfl_gradient::Gradients;
use wfl_tests::{Solved, differentiated, examples, solved};

fn assert_near(what: &str, is: f64, should: f64, within: f64) {
    assert!((is - should).abs() <= within * should.abs(), "{what}: {is}, {should}");
}

fn iterations(found: &Solved) -> usize {
    found.outcome.steps.iter().map(|step| step.history.n_iterations()).sum()
}

/// A bar of stiffness `m` whose strain feeds a scalar by `back`, and is fed by it by 1, in one term.
fn fed_bar(m: f64, back: f64) -> String {
    format!(
        "param m = {m:e}\nmesh box [0] to [1] cells [3] segment\nregion west = faces where x == 0\nregion east = faces where x == 1\n\
         unknown u : scalar\nunknown p : scalar\n\
         term coupled on all : m*Grad_u(1)*Grad_Test_u(1) + p*Grad_Test_u(1) + {back}*Grad_u(1)*Test_p\n\
         term spread on all : Grad_p(1)*Grad_Test_p(1)/m\nfix u = 0 on west\nfix p = 0 on west\nload u = m on east\n\
         load p = 2e-3 on east\nmeasure end = value(u) at [1]\nmeasure fed = value(p/m) at [1]\n"
    )
}

#[test]
fn a_coupling_keeps_its_sign_beside_any_stiffness() {
    for back in [1.0, 0.5, -1.0] {
        let one = solved(fed_bar(1.0, back));
        for m in [1e-15, 1e-6, 1e6, 3e11, 1e12, 1e15, 1e18, 1e21] {
            let found = solved(fed_bar(m, back));
            for name in ["end", "fed"] {
                let what = format!("{back} {m:e} {name}");
                assert_near(&what, found.measure(0, name), one.measure(0, name), 1e-9);
            }
        }
    }
}

/// A fluid that swells in a channel: what comes out is what it swells by, at every viscosity.
#[test]
fn a_swelling_fluid_flows_out_at_the_viscosity_of_the_mantle() {
    for viscosity in [1e-3, 1.0, 1e9, 3e12, 1e15, 1e18, 1e21] {
        for together in [true, false] {
            let parts = if together { " - p*Div_Test_v" } else { "\nterm pressure on all : -p*Div_Test_v" };
            let found = solved(format!(
                "mesh box [0,0] to [3,1] cells [6,4] quad\nregion still = faces where y*(1 - y) == 0 or x == 0\n\
                 region mouth = faces where x == 3\nunknown v : vector Q2\nunknown p : scalar Q1\n\
                 term flow on all : 2*{viscosity:e}*Sym(Grad_v):Sym(Grad_Test_v) + (Div_v - 2e-3)*Test_p{parts}\n\
                 fix v = [0,0] on still\nmeasure out = integral(v(1)) on mouth\n"
            ));
            assert_near(&format!("{viscosity:e} {together}"), found.measure(0, "out"), 6e-3, 1e-8);
        }
    }
}

/// A column of rock in pascals and in megapascals, its law and its coupling in one term.
const ROCK: &str = "use \"elasticity\"\nuse \"poro\"\nparam s = 1\nparam young = 40e9*s\nmesh box [0,0] to [0.1,0.3] cells [2,8] quad\n\
    region floor = faces where y == 0\nregion lid = faces where y == 0.3\nregion walls = faces where x*(0.1 - x) == 0\n\
    unknown u : vector Q2\nunknown p : scalar Q1\nterm rock on all : work(u, Test_u, young, 0.2) + biot(u, p, 0.7)\n\
    term fluid on all : darcy(p, 1e-12/s) + storage(p, 3e-11/s)\nfix u(2) = 0 on floor\nfix u(1) = 0 on walls\nfix p = 0 on lid\n\
    load u = [0,-2e6*s] on lid\nsteps t = 0 to 1 by 0.25\nmeasure pressed = value(p/s) at [0.05,0]\n\
    measure sunk = value(u(2)) at [0.05,0.3]\n";

/// The same blocks pressed and sheared with a multiplier, in units of stress of `s` pascals.
const BLOCKS: &str = "use \"elasticity\"\nuse \"contact\"\nparam s = 1\nparam young = 1.6e11*s\nmesh box [0,0] to [2,2] cells [3,4] tri\n\
    region under = cells where y < 1\nregion over = cells where y > 1\nregion joint = interface from under to over\n\
    region floor = faces where y == 0\nregion lid = faces where y == 2\nunknown u : vector P1\nsplit u across joint\n\
    multiplier lam : vector on joint\nquadrature on joint vertex\nterm bulk on all : work(u, Test_u, young, 0.28)\n\
    state slid : vector on joint := augmented_slip(u, u, lam, slid, young, 0.35)\n\
    term law on joint : augmented_sliding(u, u, lam, slid, young, 0.35)\nfix u = [0,0] on floor\n\
    fix u = [1.5e-3*sin(3*t), -1e-3 - 8e-4*t*x] on lid\nsteps t = 0 to 1 by 0.2\nmeasure pull = reaction(u(1)) on lid\n\
    measure most = max(Norm(lam)) on joint\nmeasure slip = mean(slid(1)) on joint\n";

/// Results and their derivatives in the stiffness do not follow the unit of stress, but by its powers.
#[test]
fn derivatives_in_pascals_are_those_in_megapascals() {
    for (text, results) in
        [(ROCK, &[("pressed", 0), ("sunk", 0)][..]), (BLOCKS, &[("pull", 1), ("most", 1), ("slip", 0)][..])]
    {
        let names: Vec<&str> = results.iter().map(|(name, _)| *name).collect();
        let of = |s: f64| {
            let scene = (&*examples(), text.to_owned());
            differentiated(scene, &[], &[("s", s)], &names.join(", "), "young").unwrap_or_else(|e| panic!("{s}: {e}"))
        };
        let (first, one) = of(1e-6);
        let last = first.outcome.steps.len() - 1;
        for s in [1.0, 1e3] {
            let (found, derivatives) = of(s);
            for (name, power) in results {
                let what = format!("{name} {s}");
                let unit = (s / 1e-6).powi(*power);
                assert_near(&what, found.measure(last, name), first.measure(last, name) * unit, 1e-7);
                let number = |of: &Gradients| of.number(name, "young").expect("a number");
                let (is, should) = (number(&derivatives), number(&one));
                assert_near(&format!("derivative of {what}"), is, should * unit * 1e-6 / s, 1e-6);
            }
        }
    }
}

/// A joint with fluid under blocks in pascals: the iterations are those of the same scene with its fluid in a term of its own.
#[test]
fn a_joint_with_fluid_takes_the_iterations_of_its_parts() {
    let scene = |penalty: f64, together: bool| {
        let flow = "fluid_pressure(pf, u, u) + filling(width, pf) + along_fault(pf, 1e-13)";
        let flow = if together { format!(" + {flow}") } else { format!("\nterm flow on joint : {flow}") };
        solved(format!(
            "use \"elasticity\"\nuse \"poro\"\nmesh box [0,0] to [2,2] cells [4,4] quad\nregion under = cells where y < 1\n\
             region over = cells where y > 1\nregion joint = interface from under to over\nregion floor = faces where y == 0\n\
             region lid = faces where y == 2\nregion well = nodes of joint where x == 0\nregion out = rim of joint where x == 2\n\
             unknown u : vector Q1\nunknown pf : scalar Q1 on joint\nsplit u across joint\n\
             def apart(v) = v - Interpolate(v, neighbor_element)\nterm bulk on all : work(u, Test_u, 6e10, 0.25)\n\
             def width = aperture(1e-3, u, u)\n\
             term joint on joint : {penalty:e}*pos_part(apart(u).Normal)*(Normal.apart(Test_u)) \
             + 5e11*(apart(u) - (apart(u).Normal)*Normal).apart(Test_u){flow}\nfix u = [0,0] on floor\nload u = [0,-1e8] on lid\n\
             fix u(1) = 0 on lid\nload pf = 0.01 on well\nfix pf = 5e7 on out\nsteps t = 0 to 2 by 0.4\n\
             measure open = max(-(apart(u).Normal)) on joint\nmeasure fluid = max(pf) on joint\n"
        ))
    };
    for penalty in [1e12, 1e13, 1e14] {
        let (together, parted) = (scene(penalty, true), scene(penalty, false));
        assert!(iterations(&together) <= iterations(&parted) + 2, "{penalty:e}: {}", iterations(&together));
        for name in ["open", "fluid"] {
            let (is, should) = (together.measure(5, name), parted.measure(5, name));
            assert_near(&format!("{name} {penalty:e}"), is, should, 1e-8);
        }
    }
}

/// Places that products and squares of coordinates pick are those of the coordinates themselves, in micrometres and on the globe.
#[test]
fn products_of_coordinates_pick_the_same_places_in_every_unit_of_length() {
    let square = |edge: f64, nodes: &str| {
        solved(format!(
            "param a = {edge:e}\nmesh box [0,0] to [a,a] cells [12,12] quad\nregion held = nodes where {nodes}\nunknown u : scalar\n\
             term heat on all : Grad_u.Grad_Test_u\nfix u = 0 on held\nload u = 1/a^2 on all\n\
             measure middle = value(u) at [a/2,a/2]\n"
        ))
    };
    let ring = |radius: f64, inner: &str, outer: &str| {
        solved(format!(
            "param r = {radius:e}\nmesh box [0.5,0] to [1,1] cells [3,24] quad map [r*x*cos(pi/2*y), r*x*sin(pi/2*y)]\n\
             region inner = nodes where {inner}\nregion outer = nodes where {outer}\nunknown u : scalar\n\
             term heat on all : Grad_u.Grad_Test_u\nfix u = 0 on inner\nfix u = 1 on outer\nmeasure mean = mean(u) on all\n"
        ))
    };
    // double roots, which have no slope: one written out, so that rounding is left of it
    const DOUBLE: &str = "(x^2 - 2*a*x + a^2)*x^2 == 0 or (y - a)^2 == 0 or y^2 == 0";
    let of_square = square(1.0, "x == 0 or x == a or y == 0 or y == a").measure(0, "middle");
    let of_ring = ring(1.0, "Norm(X) == r/2", "Norm(X) == r").measure(0, "mean");
    for unit in [1e-9, 1e-6, 2e-3, 1.0, 1e3, 6.4e6, 1e9] {
        for nodes in
            ["x*(a - x)*y*(a - y) == 0", "(a*x - x^2)*(y^2 - a*y) == 0", "x*(a - x) == 0 or y*(a - y) == 0", DOUBLE]
        {
            assert_near(&format!("{unit:e} {nodes}"), square(unit, nodes).measure(0, "middle"), of_square, 1e-9);
        }
        let found = ring(unit, "x^2 + y^2 == r^2/4", "X.X == r^2");
        assert_near(&format!("ring {unit:e}"), found.measure(0, "mean"), of_ring, 1e-9);
    }
}
