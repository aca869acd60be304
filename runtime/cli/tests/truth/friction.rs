//! Friction keeps its stick point; slip beyond what small sliding allows is told; the energy that friction takes is that of
//! what slides in its law.
//!
//! The scenes are blocks of 1 by 1 (by 1), E = 1000, nu = 0.3, friction 0.3, pressed by 1.62 on their top until t = 1 and
//! pushed by 0.4 on one side from t = 1 to 2, below the bound of 0.486; loads stay afterwards. Nothing may move then: statics.
//! The side load turns the block, so that pressure and shear vary along the face.

use super::{Ran, run};

/// What the argument of the ball has of the slip.
#[derive(Clone, Copy, PartialEq)]
enum Form {
    /// A state by return mapping.
    State,
    /// The change since the last step.
    Increment,
    /// The same, hidden in a state.
    HiddenIncrement,
}

/// A member of the class.
#[derive(Clone, Copy)]
struct Member {
    form: Form,
    /// `nitsche`, `penalty` or `augmented`.
    method: &'static str,
    theta: i32,
    /// A rigid floor in place of the lower block.
    obstacle: bool,
    cells: &'static str,
    element: &'static str,
    gamma: f64,
    /// Unit of stress: all moduli and loads are multiplied by it.
    unit: f64,
    dynamic: bool,
    steps: &'static str,
    push: &'static str,
}

const HELD: &str = "max(min(t-1,1),0)";

const MEMBER: Member = Member {
    form: Form::State,
    method: "nitsche",
    theta: 0,
    obstacle: false,
    cells: "quad",
    element: "",
    gamma: 2e4,
    unit: 1.0,
    dynamic: false,
    steps: "t = 0 to 12 by 0.1",
    push: HELD,
};

impl Member {
    fn scene(&self) -> String {
        let solid = self.cells == "hex" || self.cells == "tet";
        let (up, of) = if solid { ("z", 3) } else { ("y", 2) };
        let vector = |a: &str, b: &str| if solid { format!("[{a},0,{b}]") } else { format!("[{a},{b}]") };
        let across = if solid { "2,2" } else { "4" };
        let zeros = if solid { "0,0" } else { "0" };
        let ones = if solid { "1,1" } else { "1" };
        let layers = if solid { 2 } else { 4 };
        let (low, n) = if self.obstacle { ("0", layers) } else { ("-1", 2 * layers) };
        let mut lines = vec![
            format!("mesh box [{zeros},{low}] to [{ones},1] cells [{across},{n}] {}", self.cells),
            format!("param gamma = {}", self.gamma * self.unit),
            format!("region up = cells where {up} > 0\nregion top = faces where {up} == 1"),
            "region side = faces of up where x == 0".to_owned(),
            format!("unknown a : vector {} on up", self.element),
            format!("def sig(w) = {}*(0.576923*Div_w*Id({of}) + 0.769231*Sym(Grad_w))", 1e3 * self.unit),
            "def tang(w) = w - (w.Normal)*Normal".to_owned(),
            "term upper on up : sig(a):Grad_Test_a".to_owned(),
        ];
        if self.obstacle {
            lines.push(format!("region face = faces where {up} == 0"));
            lines.push("def slip = a\ndef before = Previous_a\ndef test = Test_a".to_owned());
        } else {
            lines.push(format!("region down = cells where {up} < 0\nregion base = faces where {up} == -1"));
            lines.push("region face = interface from up to down".to_owned());
            lines.push(format!("unknown b : vector {} on down\nterm lower on down : sig(b):Grad_Test_b", self.element));
            lines.push("def jump(v,w) = v - Interpolate(w, neighbor_element)\ndef slip = jump(a,b)".to_owned());
            lines.push("def before = jump(Previous_a,Previous_b)\ndef test = jump(Test_a,Test_b)".to_owned());
            lines.push(format!("fix b = {} on base", vector("0", "0")));
        }
        self.add_law(&mut lines);
        if self.dynamic {
            lines.push("term inertia on up : 1e-3*Dot2_a.Test_a + 0.3*Dot_a.Test_a".to_owned());
            lines.push("term inertia_b on down : 1e-3*Dot2_b.Test_b + 0.3*Dot_b.Test_b".to_owned());
        }
        lines.push(format!("load a = {} on top", vector("0", &format!("{}*min(t,1)", -1.62 * self.unit))));
        lines.push(format!("load a = {} on side", vector(&format!("{}*{}", 0.4 * self.unit, self.push), "0")));
        lines.push(format!("steps {}", self.steps));
        lines.push("measure slid = mean(slip(1)) on face\nmeasure turned = max(Norm(a)) on top".to_owned());
        lines.join("\n") + "\n"
    }

    fn add_law(&self, lines: &mut Vec<String>) {
        let traction = match self.method {
            "nitsche" => "sig(a)*Normal",
            "penalty" => "0*a",
            _ => {
                lines.push("multiplier lambda : vector on face\nquadrature on face vertex".to_owned());
                "lambda"
            }
        };
        let slip = if self.form == Form::Increment { "slip - before" } else { "slip - Previous_kept" };
        lines.push(format!("def tr = {traction}\ndef Pn = gamma*(slip.Normal) - tr.Normal"));
        lines.push(format!("def Pt = gamma*tang({slip}) - tang(tr)"));
        lines.push("def q = Ball_projection(Pt, 0.3*pos_part(Pn))\ndef force = pos_part(Pn)*Normal + q".to_owned());
        match self.form {
            Form::State => lines.push("state kept : vector on face := Previous_kept + (Pt - q)/gamma".to_owned()),
            Form::HiddenIncrement => lines.push("state kept : vector on face := tang(slip)".to_owned()),
            Form::Increment => {}
        }
        let of_test = format!("{}*(sig(Test_a)*Normal)", self.theta);
        lines.push(match (self.method, self.theta) {
            ("nitsche", 1 | -1) => {
                format!("term contact on face : 1/gamma*force.(gamma*test - {of_test}) - 1/gamma*tr.({of_test})")
            }
            _ => "term contact on face : force.test".to_owned(),
        });
        if self.method == "augmented" {
            lines.push("term law on face : -1/gamma*(lambda + force).Test_lambda".to_owned());
        }
    }

    fn run(&self, name: &str) -> Ran {
        run(name, &self.scene(), &[])
    }
}

/// The methods with each of their variants.
fn methods(of: Member) -> Vec<Member> {
    let nitsche = [0, -1, 1].map(|theta| Member { theta, gamma: if theta == 1 { 4e4 } else { 2e4 }, ..of });
    let others = ["penalty", "augmented"].map(|method| Member { method, ..of });
    nitsche.into_iter().chain(others).collect()
}

/// Nothing has moved from one step to the last one, but for rounding; all was solved and nothing is told of friction.
fn assert_holds(ran: &Ran, from: usize, what: &str) {
    assert_eq!(ran.code, 0, "{what}: {}", ran.text);
    for code in ["W606", "W615", "W630", "W631"] {
        assert!(!ran.tells(code), "{what}: {}", ran.text);
    }
    let (before, after, size) = (ran.measure(from, "slid"), ran.last("slid"), ran.last("turned"));
    assert!((after - before).abs() <= 1e-11 * size, "{what}: slip {before:e} became {after:e}");
}

#[test]
fn a_state_holds_every_method_where_it_sticks() {
    for obstacle in [false, true] {
        for member in methods(Member { obstacle, ..MEMBER }) {
            let what = format!("{} {} obstacle {obstacle}", member.method, member.theta);
            assert_holds(&member.run("holds"), 20, &what);
        }
    }
    for (cells, element, gamma) in [("tri", "", 2e4), ("quad", "Q2", 1e5), ("hex", "", 2e4)] {
        let member = Member { cells, element, gamma, ..MEMBER };
        assert_holds(&member.run("holds-elements"), 20, &format!("{cells} {element}"));
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_state_holds_for_ten_thousand_steps() {
    for member in methods(Member { steps: "t = 0 to 1002 by 0.1", obstacle: true, ..MEMBER }) {
        assert_holds(&member.run("holds-long"), 20, member.method);
    }
}

/// Slip at the same phase of two cycles, of the last one.
fn closes(member: Member, cycles: usize, tolerance: f64) {
    let steps: &'static str = if cycles > 20 { "t = 0 to 101 by 0.05" } else { "t = 0 to 13 by 0.05" };
    let ran = Member { push: "sin(2*pi*max(t-1,0))", steps, ..member }.run("loop");
    assert!(ran.code == 0 && !ran.tells("W630") && !ran.tells("W615"), "{}", ran.text);
    let (end, turned) = (20 * (cycles + 1), ran.last("turned"));
    for phase in 0..20 {
        let [a, b] = [end - 20 - phase, end - phase].map(|step| ran.measure(step, "slid"));
        assert!((a - b).abs() <= tolerance * turned, "{} {}: {a:e}, {b:e}", member.method, member.theta);
    }
}

#[test]
fn a_loop_of_loads_closes() {
    // with the nodal rule from the first cycle on; the points of Gauss's rule settle in some more
    closes(Member { method: "augmented", ..MEMBER }, 12, 1e-11);
    closes(Member { obstacle: true, ..MEMBER }, 12, 1e-8);
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_loop_of_loads_closes_for_a_hundred_cycles() {
    methods(MEMBER).into_iter().for_each(|member| closes(member, 100, 1e-10));
}

#[test]
fn a_law_on_the_change_of_the_slip_is_told_where_it_creeps() {
    let member = Member { form: Form::Increment, ..MEMBER };
    let shapes =
        [("tri", "", 2e4), ("hex", "", 2e4)].map(|(cells, element, gamma)| Member { cells, element, gamma, ..member });
    let others = [
        Member { unit: 1e6, ..member },
        Member { dynamic: true, ..member },
        Member { form: Form::HiddenIncrement, ..member },
    ];
    let all = methods(member).into_iter().filter(|m| m.method != "augmented").chain(shapes).chain(others);
    for member in all {
        let ran = member.run("creeps");
        let (before, after) = (ran.measure(20, "slid"), ran.last("slid"));
        assert!((after - before).abs() > 0.2 * before.abs(), "{before:e}, {after:e}: no creep to tell");
        let found = ran.tells("W630") && ran.text.contains("Previous_slid + (Pt - Ball_projection(Pt, ...))/gamma");
        assert!(found, "{} {}: {}", member.method, member.cells, ran.text);
    }
    // a multiplier with the nodal rule has no elastic slip: the same law keeps its point
    assert_holds(&Member { method: "augmented", ..member }.run("creeps-not"), 20, "augmented");
}

/// The non-matching blocks, pushed along each other.
fn mapped(push: &str, slip: &str, state: &str) -> String {
    format!(
        "mesh file \"k8078.msh\"\nparam gamma = 1e6\nmapping down = project from upper_base onto lower_top within 0.01\n\
         unknown u : vector P1 on upper\nunknown v : vector P1 on lower\n\
         def sig(w) = 1.2115e4*Div_w*Id(3) + 1.6154e4*Sym(Grad_w)\ndef jump(a,b) = a - Interpolate(b, down)\n\
         def tang(w) = w - (w.Normal)*Normal\ndef tr = sig(u)*Normal\ndef Pn = gamma*(jump(u,v).Normal) - tr.Normal\n\
         def Pt = gamma*tang({slip}) - tang(tr)\ndef q = Ball_projection(Pt, 0.3*pos_part(Pn))\n{state}\n\
         term upper on upper : sig(u):Grad_Test_u\nterm lower on lower : sig(v):Grad_Test_v\n\
         term contact on upper_base : (pos_part(Pn)*Normal + q).jump(Test_u,Test_v)\nfix v = [0,0,0] on ground\n\
         fix u = [{push}, 0, -0.005*min(t,1)] on top\nsteps t = 0 to 4 by 0.25\n\
         measure slid = mean(jump(u,v)(1)) on upper_base\nmeasure turned = max(Norm(u)) on upper_base\n\
         measure N = integral(pos_part(Pn)) on upper_base\n"
    )
}

const MAPPED: &str = "state kept : vector on upper_base := Previous_kept + (Pt - q)/gamma";

#[test]
fn a_state_holds_through_a_mapping() {
    let ran = run("holds-mapped", &mapped("0.002*max(min(t-1,1),0)", "jump(u,v) - Previous_kept", MAPPED), &[]);
    assert_holds(&ran, 8, "mapping");
}

#[test]
fn slip_beyond_a_face_is_told() {
    // the block has left the one below, so that nothing presses; the pairs of points still do
    let far = run("far-mapped", &mapped("max(t-1,0)", "jump(u,v) - Previous_kept", MAPPED), &[]);
    assert!(far.text.contains("slid by more than a face of the other side"), "{}", far.text);
    assert!(far.marked("W631").starts_with("term contact on upper_base"), "{}", far.text);
    assert!(!far.tells("W630"), "{}", far.text);

    let pushed = |push: f64, press: f64, floor: bool| {
        let lower = "region down = cells where y < 0\nregion base = faces where y == -1\nunknown b : vector on down\n\
            region face = interface from up to down\nterm lower on down : sig(b):Grad_Test_b\nfix b = [0,0] on base\n\
            def over = (a - Interpolate(b, neighbor_element)).Normal\n\
            def test = (Test_a - Interpolate(Test_b, neighbor_element)).Normal\n";
        let obstacle = "region face = faces where y == 0\ndef over = a.Normal\ndef test = Test_a.Normal\n";
        let (low, rows, other) = if floor { (0, 4, obstacle) } else { (-1, 8, lower) };
        format!(
            "mesh box [0,{low}] to [1,1] cells [4,{rows}] quad\nregion up = cells where y > 0\nregion top = faces where y == 1\n\
             unknown a : vector on up\ndef sig(w) = 1000*Sym(Grad_w)\n{other}term upper on up : sig(a):Grad_Test_a\n\
             term contact on face : 1e5*pos_part(over)*test\nfix a = [{push}*t, {press}] on top\nsteps t = 0 to 1 by 0.25\n"
        )
    };
    let tells = |name: &str, scene: String| {
        let ran = run(name, &scene, &[]);
        assert!(ran.code == 0, "{}", ran.text);
        ran.tells("W631")
    };
    // faces are 0.25 long
    assert!(tells("far", pushed(0.3, -1e-3, false)));
    assert!(!tells("near", pushed(0.2, -1e-3, false)), "less than a face");
    assert!(!tells("open", pushed(0.3, 1e-3, false)), "nothing presses");
    assert!(!tells("floor", pushed(3.0, -1e-3, true)), "an obstacle that is a formula follows");
}

/// A block held at its top on a floor that moves by 1 to the right, with this argument of friction.
fn belt(argument: &str, state: &str) -> String {
    format!(
        "mesh box [0,0] to [1,1] cells [4,4] quad\nparam gamma = 1e5\nregion floor = faces where y == 0\n\
         region top = faces where y == 1\nunknown u : vector\ndef sig(v) = 1000*Sym(Grad_v)\ndef s = sig(u)*Normal\n\
         def path = max(t-1,0)\ndef Pn = gamma*(u.Normal) - s.Normal\ndef Pt = gamma*({argument}) - s(1)\n\
         def q = Ball_projection(Pt, 0.3*pos_part(Pn))\n{state}\nterm body on all : sig(u):Grad_Test_u\n\
         term contact on floor : pos_part(Pn)*(Test_u.Normal) + q*Test_u(1)\nfix u = [0,-0.01*min(t,1)] on top\n\
         steps t = 0 to 2 by 0.1\nmeasure lag = mean(u(1)) on floor\n"
    )
}

#[test]
fn the_energy_of_friction_has_the_motion_of_the_obstacle() {
    // friction 0.3 times pressure 10 on length 1, over the path of the floor less that of the block
    let state = "state kept : scalar on floor := Previous_kept + (Pt - q)/gamma";
    let increment = "u(1) - Previous_u(1) - (path - max(t-timestep-1,0))";
    let by_tenths = "u(1) - Previous_u(1) - (path - max(t-1.1,0))";
    let forms = [("u(1) - path - Previous_kept", state), (increment, ""), (by_tenths, ""), ("u(1) - path", "")];
    for (argument, state) in forms {
        let ran = run("belt", &belt(argument, state), &[]);
        let right = 3.0 * (1.0 - ran.last("lag"));
        let taken = ran.friction_work();
        assert!((taken / right - 1.0).abs() < 2e-3, "{argument}: {taken}, {right}");
        assert!(!ran.tells("W615"), "{}", ran.text);
    }
}

#[test]
fn the_guess_of_a_first_step_is_no_past_of_friction() {
    // one static step from a guess that has slid: what friction takes is what slides in the law, from zero
    let scene = "mesh box [0,0] to [1,1] cells [3,3] quad\nparam gamma = 2e4\nregion floor = faces where y == 0\n\
        region top = faces where y == 1\nunknown u : vector\ndef sig(v) = 1000*Sym(Grad_v)\ndef s = sig(u)*Normal\n\
        def tang(w) = w - (w.Normal)*Normal\ndef Pn = gamma*(u.Normal) - s.Normal\ndef Pt = gamma*tang(u) - tang(s)\n\
        term body on all : sig(u):Grad_Test_u\n\
        term contact on floor : (pos_part(Pn)*Normal + Ball_projection(Pt, 0.3*pos_part(Pn))).Test_u\n\
        fix u = [0.02,-0.01] on top\n";
    let works = ["", "start u = [0.5,0]\n", "start u = [-0.5,0]\n"].map(|start| {
        let ran = run("guess", &format!("{scene}{start}"), &[]);
        assert!(ran.code == 0 && !ran.tells("W615"), "{start}: {}", ran.text);
        ran.friction_work()
    });
    assert!(works[0] > 0.0 && works.iter().all(|w| (w / works[0] - 1.0).abs() < 1e-6), "{works:?}");
}

/// However a pressure is kept from being negative, as the radius of a projection it is not.
#[test]
fn a_pressure_is_not_negative_in_any_words() {
    for (pressure, may_be) in [
        ("40*pos_part(gap)", false),
        ("max(0, 40*gap)", false),
        ("max(gap, 0)*40", false),
        ("(if gap > 0 then 40*gap else 0)", false),
        ("(if gap < 0 then 0 else 40*gap)", false),
        ("-min(0, -40*gap)", false),
        ("(if gap > 1e-3 then 40*(gap - 1e-3) else 0)", false),
        ("(1 + 0.5*tanh(40*gap))", false),
        ("(1 - tanh(40*gap)^2)", false),
        ("logistic(40*gap)", false),
        ("softplus(40*gap)", false),
        ("log1p(sqr(gap))", false),
        ("(1 + 2/pi*atan(40*gap))", false),
        ("(1 + erf(gap))*pos_part(gap)", false),
        ("(1 + sqr(gap))^(-1/2)", false),
        ("(1 + 0.5*cos(40*gap))", false),
        ("(0.3 - 0.2*min(1, abs(gap)))", false),
        ("(1 + 1.5*tanh(40*gap))", true),
        ("(0.3 - 0.4*min(1, abs(gap)))", true),
        ("log1p(gap)", true),
        ("40*gap", true),
        ("min(0, 40*gap)", true),
        ("(if gap > 0 then -40*gap else 0)", true),
        ("max(-1, 40*gap)", true),
    ] {
        let ran = run(
            "alarms-radius",
            &format!(
                "wfl 1\nmesh box [0,0] to [1,1] cells [4,4] quad\nregion floor = faces where y == 0\n\
                 region top = faces where y == 1\nunknown u : vector\nterm body on all : 1000*Sym(Grad_u):Grad_Test_u\n\
                 def gap = -u(2)\nterm rough on floor : Ball_projection(30*u(1), 0.4*{pressure})*Test_u(1)\n\
                 term hard on floor : -40*pos_part(gap)*Test_u(2)\nfix u = [0.01,-0.01] on top\n"
            ),
            &[],
        );
        assert_eq!(ran.tells("W502"), may_be, "{pressure}: {}", ran.text);
    }
}
