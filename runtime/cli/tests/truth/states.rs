//! Numbers that are made of a law beside its forces: what is open, slips and sticks, what friction has taken. They are those of
//! the law, in whatever words and in whatever order it is written.

use super::run;

/// A block that is pressed onto a floor at 8 points, by a law of the overlap `u.Normal - gap`.
fn pressed(law: &str, gap: f64) -> String {
    format!(
        "mesh box [0,0] to [1,1] cells [4,4] quad\nregion floor = faces where y == 0\nregion top = faces where y == 1\n\
         unknown u : vector\nterm b on all : 1000*Sym(Grad_u):Grad_Test_u\ndef over = u.Normal - {gap}\n\
         term c on floor : ({law})*(Test_u.Normal)\nfix u = [0,-0.005] on top\nmeasure held = reaction(u(2)) on top\n"
    )
}

#[test]
fn what_presses_is_in_contact_in_any_words() {
    for (k, law) in [
        "1e5*pos_part(over)",
        "max(0, 1e5*over)",
        "max(1e5*over, 0)",
        "-min(0, -1e5*over)",
        "(if over > 0 then 1e5*over else 0)",
        "(if over < 0 then 0 else 1e5*over)",
    ]
    .into_iter()
    .enumerate()
    {
        let ran = run(&format!("presses-{k}"), &pressed(law, 2e-3), &[]);
        assert!((ran.last("held") + 2.9703).abs() < 1e-3 || (ran.last("held") - 2.9703).abs() < 1e-3, "{}", ran.text);
        assert_eq!(ran.contact(), [0, 0, 8], "{law}: {}", ran.text);
        let ran = run(&format!("presses-not-{k}"), &pressed(law, 1.0), &[]);
        assert_eq!(ran.contact(), [8, 0, 0], "{law}: {}", ran.text);
    }
}

/// A block that is drawn over a rough floor; `terms` are its laws.
fn drawn(terms: &str) -> String {
    format!(
        "mesh box [1,0] to [2,1] cells [3,3] quad\nregion floor = faces where y == 0\nregion top = faces where y == 1\n\
         unknown u : vector\nterm b on all : 1000*Sym(Grad_u):Grad_Test_u\ndef tang(w) = w - (w.Normal)*Normal\n\
         def press = 1e5*pos_part(u.Normal)\nparam gamma = 1e4\n{terms}\nsteps t = 0 to 4 by 0.1\n\
         fix u = [8e-3*sin(pi*t/2*1.1),-5e-3] on top\nmeasure held = reaction(u(1)) on top\n"
    )
}

#[test]
fn a_pressure_and_a_friction_in_two_terms_slip_in_either_order() {
    let law = "def q = Ball_projection(gamma*(tang(u) - Previous_slid), 0.3*press)\n\
               state slid : vector on floor := tang(u) - q/gamma\n";
    let (normal, along) = ("term n on floor : press*Normal.Test_u\n", "term f on floor : q.Test_u\n");
    let one = run("in-one-term", &drawn(&format!("{law}term c on floor : (press*Normal + q).Test_u\n")), &[]);
    for (name, terms) in [("normal-first", [normal, along]), ("friction-first", [along, normal])] {
        let ran = run(name, &drawn(&format!("{law}{}", terms.concat())), &[]);
        assert_eq!(ran.contact(), one.contact(), "{name}: {}", ran.text);
        assert!((ran.last("held") - one.last("held")).abs() < 1e-9);
    }
}

/// The energy that friction takes for the same law with three memories: what has slid, the elastic slip, the traction of the step
/// before. What is elastic is not taken again in every step. Where the bound stays a state that adds up what the end of each
/// step takes has the same.
#[test]
fn friction_takes_the_same_whatever_a_law_remembers() {
    let of_bound = |name: &str, bound: &str, [ball, memory, slides]: [&str; 3]| {
        let terms = format!(
            "def q = Ball_projection({ball}, {bound})\n{memory}\n\
             state w : scalar on floor := Previous_w + q.({slides})\nterm c on floor : (press*Normal + q).Test_u\n\
             measure taken = integral(w) on floor\n"
        );
        let ran = run(name, &drawn(&terms), &[]);
        assert_eq!(ran.code, 0, "{}", ran.text);
        [ran.friction_work(), ran.last("taken")]
    };
    let of = |name: &str, ball: &str, memory: &str, slides: &str| {
        let law = [ball, memory, slides];
        let [work, taken] = of_bound(name, "1.5", law);
        assert!(taken > 0.0 && (work / taken - 1.0).abs() < 1e-6, "{name}: {work} for {taken}");
        of_bound(name, "0.3*press", law)[0]
    };
    let slid = of(
        "keeps-slip",
        "gamma*(tang(u) - Previous_slid)",
        "state slid : vector on floor := tang(u) - q/gamma",
        "tang(u) - q/gamma - Previous_slid",
    );
    let elastic = of(
        "keeps-elastic",
        "gamma*(Previous_el + tang(u) - tang(Previous_u))",
        "state el : vector on floor := q/gamma",
        "Previous_el + tang(u) - tang(Previous_u) - q/gamma",
    );
    let traction = of(
        "keeps-traction",
        "Previous_s + gamma*(tang(u) - tang(Previous_u))",
        "state s : vector on floor := q",
        "Previous_s/gamma + tang(u) - tang(Previous_u) - q/gamma",
    );
    assert!((elastic / slid - 1.0).abs() < 1e-6 && (traction / slid - 1.0).abs() < 1e-6, "{slid} {elastic} {traction}");
}

/// A belt under a block, whose way is written out or is a number that is solved for: friction takes the same of both.
#[test]
fn friction_takes_all_where_the_way_of_the_obstacle_is_an_unknown() {
    let scene = |way: &str, more: &str| {
        format!(
            "mesh box [0,0] to [1,1] cells [3,3] quad\nregion floor = faces where y == 0\nregion top = faces where y == 1\n\
             unknown u : vector\nterm b on all : 1000*Sym(Grad_u):Grad_Test_u\ndef tang(w) = w - (w.Normal)*Normal\n\
             def press = 1e5*pos_part(u.Normal)\n{more}def slip = tang(u) - [{way},0]\n\
             def q = Ball_projection(1e4*(slip - Previous_slid), 0.3*press)\n\
             state slid : vector on floor := slip - q/1e4\nterm c on floor : (press*Normal + q).Test_u\n\
             steps t = 0 to 4 by 0.1\nfix u = [0,-5e-3] on top\n"
        )
    };
    let written = run("belt", &scene("0.003*t", ""), &[]).friction_work();
    let solved = "unknown s : scalar global\nterm g on global : (s - 0.003*t)*Test_s\n";
    let found = run("belt-solved", &scene("s", solved), &[]).friction_work();
    assert!(written > 0.0 && (found / written - 1.0).abs() < 1e-6, "{found} for {written}");
}

/// A friction bound that divides the argument and multiplies the projection: the ball has the radius 1, its slip is along the
/// face all the same.
#[test]
fn friction_takes_the_same_where_its_argument_is_divided_by_the_bound() {
    let of = |name: &str, q: &str| {
        let terms = format!(
            "def trial = gamma*(tang(u) - Previous_slid)\ndef q = {q}\n\
             state slid : vector on floor := tang(u) - q/gamma\nterm c on floor : (press*Normal + q).Test_u\n"
        );
        let ran = run(name, &drawn(&terms), &[]);
        assert!(ran.code == 0 && !ran.tells("W615") && !ran.tells("W606"), "{}", ran.text);
        ran.friction_work()
    };
    let usual = of("usual-ball", "Ball_projection(trial, 0.3*press)");
    let scaled = of("unit-ball", "0.3*press*Ball_projection(trial/(0.3*press + 1e-12), 1)");
    assert!((scaled / usual - 1.0).abs() < 1e-3, "{scaled} for {usual}");
}

/// A rigid circle that moves sideways over a half space with friction: at a point of the face that is tested its normal is not that of the
/// face, and its friction is that of a motion. The same with a pressure that pulls is told.
#[test]
fn a_round_indenter_that_moves_sideways_has_a_penalty() {
    let scene = |sign: &str| {
        format!(
            "mesh box [-1,-1] to [1,0] cells [16,8] quad\nregion top = faces where y == 0\nregion base = faces where y == -1\n\
             unknown u : vector\nterm stress on all : 1e3*(Sym(Grad_u) + 0.5*Div_u*Id(2)):Grad_Test_u\nfix u = [0,0] on base\n\
             def d = X + u - [0.2*t, 1.98]\ndef up = -Normalized(d)\nparam gamma = 2e4\n\
             def p = pos_part(gamma*(2 - Norm(d)))\ndef face(w) = w - (w.up)*up\n\
             def q = Ball_projection(gamma*(face(u - [0.2*t,0]) - Previous_held), 0.3*p)\n\
             state held : vector on top := face(u - [0.2*t,0]) - q/gamma\n\
             term contact on top : ({sign}p*up + q).Test_u\nsteps t = 0 to 1 by 0.1\n"
        )
    };
    let right = run("sideways", &scene(""), &[]);
    assert!(right.code == 0 && !right.tells("W507"), "{}", right.text);
    let wrong = run("sideways-pulls", &scene("-"), &[]);
    assert!(wrong.tells("W507") || wrong.tells("W510"), "{}", wrong.text);
}

/// A block that begins on the floor with a velocity has hardly moved at the end of its first step, in which it presses most: the
/// overlap of a stiff penalty is small beside the way that it goes later. That of a soft one is not.
#[test]
fn an_impact_that_begins_at_the_wall_overlaps_little() {
    let scene = |gamma: f64| {
        format!(
            "mesh box [0,0] to [1,1] cells [4,4] quad\nregion floor = faces where y == 0\nunknown u : vector\n\
             start Dot_u = [0.3,-1]\nterm inertia on all : Dot2_u.Test_u\n\
             term stress on all : 1e3*Sym(Grad_u):Grad_Test_u\nparam gamma = {gamma}\ndef p = pos_part(gamma*(u.Normal))\n\
             term contact on floor : (p*Normal).Test_u\nsteps t = 0 to 0.1 by 0.005\n"
        )
    };
    run("lands", &scene(1e4), &[]).assert_silent();
    let soft = run("lands-softly", &scene(100.0), &[]);
    assert!(soft.tells("W606") && soft.text.contains("penetration at `contact`"), "{}", soft.text);
}

/// A stiff block with a mass of 3 that is moved as a whole by sin(t): its support carries 3 sin(t). The trapezoidal rule has a force beside it
/// that goes up and down with every step, of 6 % of the largest one, and 55 % off in the first step: silent.
#[test]
fn a_reaction_that_alternates_is_told() {
    let ran = |scheme: &str, by: &str| {
        let scene = format!(
            "mesh box [0,0] to [1,1] cells [2,2] quad\nunknown u : vector\nterm i on all : 3*Dot2_u.Test_u\n\
             term s on all : 1e4*Sym(Grad_u):Sym(Grad_Test_u)\nstart Dot_u = [0,1]\nfix u = [0,sin(t)] on boundary\n\
             scheme {scheme}\nsteps t = 0 to 2 by {by}\nmeasure R = reaction(u(2)) on boundary\n"
        );
        run(&format!("alternates-{scheme}-{by}"), &scene, &[])
    };
    let trapezoidal = ran("newmark", "0.1");
    assert!(trapezoidal.code == 0 && trapezoidal.tells("W652"), "{}", trapezoidal.text);
    // across the motion there is no force, and its rounding alternates as well
    for (cells, by) in [("[2,2]", "0.2"), ("[4,4]", "0.2")] {
        let scene = format!(
            "mesh box [0,0] to [1,1] cells {cells} quad\nunknown u : vector\nterm i on all : 3*Dot2_u.Test_u\n\
             term s on all : 1e4*Sym(Grad_u):Sym(Grad_Test_u)\nstart Dot_u = [0,1]\nfix u = [0,sin(t)] on boundary\n\
             scheme newmark\nsteps t = 0 to 6 by {by}\nmeasure R = reaction(u(1)) on boundary\n"
        );
        let across = run(&format!("alternates-across-{}", &cells[1..2]), &scene, &[]);
        across.assert_silent();
        assert!(across.last("R").abs() < 1e-12, "{}", across.last("R"));
    }
    for (scheme, by) in [("newmark", "0.01"), ("bdf2", "0.1"), ("bdf2", "0.01")] {
        let ran = ran(scheme, by);
        ran.assert_silent();
        assert!((ran.last("R") / (3.0 * 2f64.sin()) - 1.0).abs() < 0.01, "{scheme} {by}: {}", ran.last("R"));
    }
}
