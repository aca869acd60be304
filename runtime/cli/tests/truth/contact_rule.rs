//! The rule of contact terms: pressures that are right for every parameter, and the words of the checks of rules and of
//! Nitsche's parameter.

use super::{Ran, run};

/// A block (E = 10, nu = 0.3) under a rigid surface, `up` the last coordinate: shape, element, method and gap.
struct Block {
    shape: &'static str,
    element: &'static str,
    cells: usize,
    /// In units of E/h.
    gamma: f64,
    /// None: penalty.
    theta: Option<i32>,
    rule: &'static str,
}

const BODY: &str = "param E = 10\nparam nu = 0.3\ndef lambda = E*nu/((1+nu)*(1-2*nu))\ndef mu = E/(2*(1+nu))\n";

impl Block {
    fn dim(&self) -> usize {
        if matches!(self.shape, "hex" | "tet") { 3 } else { 2 }
    }

    fn text(&self, block: &str, h: f64, gap: &str) -> String {
        let up = self.dim();
        let contact = match self.theta {
            None => format!("def press = gamma*pos_part(u({up}) - gap)\nterm contact on top : press*Test_u({up})\n"),
            Some(theta) => format!(
                "param theta = {theta}\ndef s(v) = (sigma(v)*Normal).Normal\n\
                 def press = pos_part(gamma*(u({up}) - gap) - s(u))\nterm linear on top : -theta/gamma*s(u)*s(Test_u)\n\
                 term contact on top : 1/gamma*press*(gamma*Test_u({up}) - theta*s(Test_u))\n"
            ),
        };
        format!(
            "wfl 1\n{block}unknown u : vector {}\n{BODY}def sigma(v) = lambda*Div_v*Id({up}) + 2*mu*Sym(Grad_v)\n\
             def gap = {gap}\nparam gamma = {:e}\n{contact}\
             term elastic on all : sigma(u):Grad_Test_u\n{}\n",
            self.element,
            self.gamma * 10.0 / h,
            self.rule
        )
    }

    /// Half of a block under a rigid cylinder of radius 0.5, or another gap.
    fn half(&self, gap: &str) -> String {
        let n = self.cells;
        #[expect(clippy::cast_precision_loss, reason = "few cells")]
        let h = 0.1 / n as f64;
        let block = format!(
            "mesh box [0,-1] to [1,0] cells [{n},{n}] {} map [0.1*x+0.9*x^3, 0.1*y+0.9*y^3]\n\
             region top = faces where y == 0\nregion base = faces where y == -1\nregion middle = faces where x == 0\n",
            self.shape
        );
        let measures = "fix u = [0,0] on base\nfix u(1) = 0 on middle\nmeasure force = integral(press) on top\n\
                        measure peak = max(press) on top\n";
        self.text(&block, h, gap) + measures
    }

    /// Under a cosine that is closed everywhere; the pressure of a half space, which two wave lengths of depth are.
    fn waves(&self) -> String {
        let (n, dim) = (self.cells, self.dim());
        #[expect(clippy::cast_precision_loss, reason = "few cells")]
        let h = 0.5 / n as f64;
        let pi = std::f64::consts::PI;
        let (number, shape, block) = if dim == 2 {
            let block =
                format!("mesh box [0,-2] to [0.5,0] cells [{n},{}] {} map [x, 0.2*y^3+0.2*y]\n", 2 * n, self.shape);
            (
                2.0 * pi,
                "cos(2*pi*x)",
                block + "region base = faces where y == -2\nfix u = [0,0] on base\nregion top = faces where y == 0\n",
            )
        } else {
            let block = format!(
                "mesh box [0,0,-2] to [0.5,0.5,0] cells [{n},{n},{}] {} map [x, y, 0.2*z^3+0.2*z]\n\
                 region flanks = faces where y == 0 or y == 0.5\nfix u(2) = 0 on flanks\n",
                2 * n,
                self.shape
            );
            let ends = "region base = faces where z == -2\nfix u = [0,0,0] on base\nregion top = faces where z == 0\n";
            (2.0 * pi * 2f64.sqrt(), "cos(2*pi*x)*cos(2*pi*y)", block + ends)
        };
        let block = block + "region across = faces where x == 0 or x == 0.5\nfix u(1) = 0 on across\n";
        let (depth, plane, confined) = (0.01, 10.0 / 0.91, 10.0 * 0.7 / (1.3 * 0.4));
        let wave = plane * number * depth / 2.0;
        let mean = 1.5 * wave;
        let gap = format!("-{:e} - {depth}*{shape}", 2.0 * mean / confined);
        let fields: Vec<&str> = block.lines().collect();
        // conditions stand behind the unknown
        let (conditions, rest): (Vec<&str>, Vec<&str>) = fields.into_iter().partition(|l| l.starts_with("fix"));
        self.text(&(rest.join("\n") + "\n"), h, &gap)
            + &conditions.join("\n")
            + &format!(
                "\ndef exact = {mean:e} + {wave:e}*{shape}\nmeasure wrong = integral((press - exact)^2) on top\n\
                 measure size = integral(exact^2) on top\n"
            )
    }
}

/// Hertz' peak pressure of a cylinder of radius 0.5 for half of its force a unit length: sqrt(F E*/(pi R)).
fn hertz(half_force: f64) -> f64 {
    (2.0 * half_force * 10.0 / 0.91 / (std::f64::consts::PI * 0.5)).sqrt()
}

const CYLINDER: &str = "-0.02 + x^2/(2*0.5)";

fn plane(element: &'static str, cells: usize, gamma: f64, theta: Option<i32>, rule: &'static str) -> Block {
    Block { shape: "quad", element, cells, gamma, theta, rule }
}

#[test]
fn the_pressure_under_a_cylinder_is_that_of_hertz_for_every_parameter() {
    for (name, block) in [
        ("hertz-20", plane("Q1", 24, 20.0, None, "")),
        ("hertz-1e4", plane("Q1", 24, 1e4, None, "")),
        ("hertz-nitsche", plane("Q1", 24, 10.0, Some(0), "")),
        ("hertz-q2", plane("Q2", 12, 250.0, None, "")),
        ("hertz-tri", Block { shape: "tri", ..plane("P2", 12, 1e3, Some(-1), "") }),
    ] {
        let ran = run(name, &block.half(CYLINDER), &[]);
        ran.assert_silent();
        let ratio = ran.last("peak") / hertz(ran.last("force"));
        assert!((ratio - 1.0).abs() < 0.03, "{name}: {ratio}");
    }
}

#[test]
fn pressures_of_a_rule_with_too_many_points_alternate_and_are_told() {
    for (name, block) in [
        ("zigzag-q1", plane("Q1", 24, 20.0, None, "quadrature on top degree 5")),
        ("zigzag-nitsche", plane("Q1", 24, 1e2, Some(1), "quadrature on top degree 3")),
        ("zigzag-q2", plane("Q2", 16, 1e3, None, "quadrature on top degree 6")),
    ] {
        let ran = run(name, &block.half(CYLINDER), &[]);
        assert!(ran.code == 0 && ran.tells("W520"), "{name}: {}", ran.text);
    }
}

#[test]
fn the_edge_of_a_punch_is_no_zigzag() {
    // a flat punch and one with a step, whose pressures have a pole and a jump
    for (name, gap) in [("punch", "if x < 0.05 then -0.01 else 1"), ("step", "if x < 0.05 then -0.02 else -0.019")] {
        let ran = run(name, &plane("Q1", 24, 1e2, None, "").half(gap), &[]);
        assert!(!ran.tells("W520"), "{name}: {}", ran.text);
    }
}

fn assert_waves(name: &str, block: &Block, limit: f64) {
    let ran = run(name, &block.waves(), &[]);
    let error = (ran.last("wrong") / ran.last("size")).sqrt();
    assert!(ran.code == 0 && !ran.tells("W520") && error < limit, "{name}: {error} {}", ran.text);
}

#[test]
fn waves_that_are_closed_have_their_pressure_on_every_element() {
    for (k, (shape, element, cells)) in
        [("quad", "Q1", 16), ("tri", "P1", 16), ("quad", "Q2", 8), ("tri", "P2", 8)].into_iter().enumerate()
    {
        for (j, (theta, gamma)) in [(None, 1e2), (None, 1e4), (Some(0), 1e3), (Some(1), 20.0)].into_iter().enumerate() {
            let block = Block { shape, element, cells, gamma, theta, rule: "" };
            // stresses of linear elements on three nodes a quarter wave
            let limit = if theta.is_some() && element == "P1" { 0.1 } else { 0.03 };
            assert_waves(&format!("waves-{k}-{j}"), &block, limit);
        }
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn waves_in_space_have_their_pressure() {
    for (shape, element, cells) in [("tet", "P1", 8), ("tet", "P2", 4), ("hex", "Q2", 4)] {
        let block = Block { shape, element, cells, gamma: 1e3, theta: None, rule: "" };
        assert_waves(&format!("waves-{shape}-{element}"), &block, 0.03);
    }
}

#[test]
fn waves_in_space_have_their_pressure_on_hexahedra_for_every_parameter() {
    // below E/h the flexibility of a penalty, and Nitsche's method without a bound
    for (k, (gamma, theta)) in
        [(10.0, None), (1e2, None), (1e4, None), (0.1, Some(-1)), (1.0, Some(-1)), (1e2, Some(0)), (1e4, Some(1))]
            .into_iter()
            .enumerate()
    {
        // laws that read the traction keep Gauss points on quadrilaterals where nothing is said
        let rule = if theta.is_some() { "quadrature on top vertex" } else { "" };
        let block = Block { shape: "hex", element: "Q1", cells: 6, gamma, theta, rule };
        assert_waves(&format!("waves-hex-{k}"), &block, 0.035);
    }
}

/// A rigid sphere (radius 0.5) on a block of revolution, `r` the coordinate across the axis.
fn sphere(element: &str, gamma: f64) -> String {
    format!(
        "wfl 1\nmesh box [0,-1] to [1,0] cells [24,24] quad map [0.1*x+0.9*x^3, 0.1*y+0.9*y^3]\n\
         region top = faces where y == 0\nregion base = faces where y == -1\nregion axis = faces where x == 0\n\
         unknown u : vector {element}\n{BODY}def tr(v) = Div_v + v(1)/x\n\
         def sigma(v) = lambda*tr(v)*Id(2) + 2*mu*Sym(Grad_v)\ndef hoop(v) = lambda*tr(v) + 2*mu*v(1)/x\n\
         def press = {gamma}*pos_part(u(2) + 0.02 - x^2/(2*0.5))\n\
         term elastic on all : 2*pi*x*(sigma(u):Grad_Test_u + hoop(u)*Test_u(1)/x)\n\
         term contact on top : 2*pi*x*press*Test_u(2)\nfix u = [0,0] on base\nfix u(1) = 0 on axis\n\
         measure force = integral(2*pi*x*press) on top\nmeasure peak = max(press) on top\n"
    )
}

#[test]
fn the_pressure_on_the_axis_of_a_sphere_is_that_of_hertz() {
    // 20 E/h and 2000 E/h
    for (name, element, gamma) in [("sphere-1", "Q1", 4.8e4), ("sphere-2", "Q1", 4.8e6), ("sphere-q2", "Q2", 4.8e4)] {
        let ran = run(name, &sphere(element, gamma), &[]);
        ran.assert_silent();
        let plane = 10.0 / 0.91;
        let peak = (6.0 * ran.last("force") * plane * plane / (std::f64::consts::PI.powi(3) * 0.25)).cbrt();
        let ratio = ran.last("peak") / peak;
        assert!((ratio - 1.0).abs() < 0.05, "{name}: {ratio}");
    }
}

/// Two rings or blocks that meet through a mapping.
fn mapped(rule: &str) -> String {
    format!(
        "wfl 1\nmesh file \"patch_2.msh\"\nunknown u : vector Q2\ndef s(v) = 0.6*Div_v*Id(2) + 0.8*Sym(Grad_v)\n\
         term body on upper, lower : s(u):Grad_Test_u\nmapping across = raytrace from face1 onto face2\n\
         def force = pos_part(10*((u - Interpolate(u, across)).Normal) - (s(u)*Normal).Normal)\n\
         term contact on face1 : force*((Test_u - Interpolate(Test_u, across)).Normal)\nquadrature on face1 {rule}\n\
         fix u = [0, -0.01] on top\nfix u = [0, 0] on base\nmeasure p = mean(force) on face1\n"
    )
}

#[test]
fn the_points_of_a_face_are_counted_over_all_faces_that_its_images_lie_on() {
    for rule in ["degree 4", "degree 5", "degree 11", "degree 20"] {
        let ran = run(&format!("mapped-{}", &rule[7..]), &mapped(rule), &[]);
        assert!(ran.code == 0 && !ran.tells("W506"), "{rule}: {}", ran.text);
    }
    let ran = run("mapped-low", &mapped("degree 1"), &[]);
    assert!(ran.tells("W506") && ran.text.contains("1 points a face for the 3 nodes"), "{}", ran.text);
}

/// A ring far from its axis, or a strip in plane strain, shrunk on another one: the parameter that `auto` finds.
fn shrunk(weight: &str, hoop: bool) -> String {
    let trace = if hoop { "Div_v + v(1)/x" } else { "Div_v" };
    let ring = if hoop { " + (lambda*trace(v) + 2*mu*v(1)/x)*Test_v(1)/x" } else { "" };
    format!(
        "wfl 1\nparam gamma = auto\nmesh box [110,0] to [130,20] cells [10,10] quad\nregion inner = cells where x < 120\n\
         region outer = cells where x > 120\nregion fit = interface from inner to outer\n\
         region ends = faces where y == 0\nregion rim = faces where x == 130\nunknown ui : vector Q2 on inner\n\
         unknown uo : vector Q2 on outer\n{BODY}def trace(v) = {trace}\n\
         def sigma(v) = lambda*trace(v)*Id(2) + 2*mu*Sym(Grad_v)\ndef work(v) = {weight}*(sigma(v):Grad_Test_v{ring})\n\
         def jump(a,b) = a - Interpolate(b, neighbor_element)\n\
         def Pn = gamma*(jump(ui,uo).Normal + 0.0025) - (sigma(ui)*Normal).Normal\nterm a on inner : work(ui)\n\
         term b on outer : work(uo)\nterm contact on fit : {weight}*pos_part(Pn)*(jump(Test_ui,Test_uo).Normal)\n\
         fix ui(2), uo(2) = 0 on ends\nfix uo(1) = 0 on rim\nmeasure p = mean(pos_part(Pn)) on fit\n"
    )
}

fn auto(ran: &Ran) -> f64 {
    let words = ran.text.lines().find(|l| l.starts_with("gamma = ")).unwrap_or_else(|| panic!("{}", ran.text));
    words["gamma = ".len()..].split(' ').next().and_then(|w| w.parse().ok()).unwrap_or_else(|| panic!("{words}"))
}

#[test]
fn far_from_the_axis_the_parameter_is_that_of_plane_strain() {
    let plane = auto(&run("shrunk-plane", &shrunk("1", false), &[]));
    for (name, weight, hoop) in [("shrunk-weight", "2*pi*x", false), ("shrunk-ring", "2*pi*x", true)] {
        let found = auto(&run(name, &shrunk(weight, hoop), &[]));
        assert!((found / plane - 1.0).abs() < 0.1, "{name}: {found} for {plane}");
    }
}

#[test]
fn auto_has_a_value_on_graded_meshes_for_every_variant() {
    let scene = |theta: i32| {
        format!(
            "wfl 1\nparam gamma = auto\nparam theta = {theta}\n\
             mesh box [-1,-1] to [1,1] cells [8,14] quad map [0.05*x + 0.95*x^5, 0.11*y + 0.89*y^7]\n\
             region left = cells where x < 0\nregion right = cells where x > 0\n\
             region fault = interface from left to right\nregion west = faces where x == -1\n\
             region east = faces where x == 1\nunknown uL : vector Q2 on left\nunknown uR : vector Q2 on right\n{BODY}\
             def sigma(v) = lambda*Div_v*Id(2) + 2*mu*Sym(Grad_v)\ndef trac(v) = sigma(v)*Normal\n\
             def jump(a,b) = a - Interpolate(b, neighbor_element)\ndef tang(w) = w - (w.Normal)*Normal\n\
             def Pn = gamma*(jump(uL,uR).Normal) - trac(uL).Normal\ndef Pt = gamma*tang(jump(uL,uR)) - tang(trac(uL))\n\
             def force = pos_part(Pn)*Normal + Ball_projection(Pt, 0.3*pos_part(Pn))\n\
             term a on left : sigma(uL):Grad_Test_uL\nterm b on right : sigma(uR):Grad_Test_uR\n\
             term stress on fault : -theta/gamma*trac(uL).trac(Test_uL)\n\
             term contact on fault : 1/gamma*force.(gamma*jump(Test_uL,Test_uR) - theta*trac(Test_uL))\n\
             fix uL = [0,0] on west\nfix uR = [-1e-3,0] on east\nmeasure p = mean(pos_part(Pn)) on fault\n"
        )
    };
    let found = [-1, 0, 1].map(|theta| auto(&run(&format!("graded-{theta}"), &scene(theta), &[])));
    // the trace constant, twice a quarter of it (less), twice it
    assert!((found[0] / found[1] - 1.0).abs() < 1e-6 && (found[2] / found[1] - 2.0).abs() < 1e-6, "{found:?}");
}

#[test]
fn hourglasses_are_found_where_a_term_has_a_state() {
    let scene = |degree: usize| {
        format!(
            "wfl 1\nmesh box [0,0] to [2,1] cells [4,2] quad\nregion west = faces where x == 0\n\
             region east = faces where x == 2\nunknown u : vector Q2\nquadrature on all degree {degree}\n{BODY}\
             state before : matrix(2,2) on all := 0*Previous_before\ndef strain = Sym(Grad_u) - Previous_before\n\
             term body on all : (lambda*Trace(strain)*Id(2) + 2*mu*strain):Sym(Grad_Test_u)\nfix u = [0,0] on west\n\
             load u = [0.1,0] on east\nsteps t = 0 to 1 by 1\nmeasure m = max(u(1)) on east\n"
        )
    };
    let low = run("state-3", &scene(3), &[]);
    assert!(low.tells("W511") && low.text.contains("degree 4 or more"), "{}", low.text);
    let right = run("state-4", &scene(4), &[]);
    assert!(right.code == 0 && !right.tells("W511"), "{}", right.text);
}

/// A neo-Hookean block on a rigid disc that is a formula of the displacement, with the current normal.
fn on_disc(gamma: f64) -> String {
    format!(
        "wfl 1\nmesh box [0,0.12] to [1,0.62] cells [10,5] quad\nregion under = faces where y == 0.12\n\
         region lid = faces where y == 0.62\nunknown u : vector Q2\ndef F = Id(2) + Grad_u\n\
         def P = 0.38*(F - Inv(F)') + 0.58*log(Det(F))*Inv(F)'\ndef n = Transformed_unit_vector(Grad_u, Normal)\n\
         def n0 = Transformed_unit_vector(Grad_Previous_u, Normal)\ndef d = [0.5, -0.9] - X - u\n\
         def disc = sqr(d.n) - d.d + 1\ndef gap = if disc > 0 then d.n - sqrt(if disc > 0 then disc else 1) else 1\n\
         def t = P*Normal\ndef tang(w) = w - (w.n)*n\ndef slip = u - Previous_u + gap*(n - n0)\n\
         def pn = pos_part(-{gamma}*gap - t.n)\n\
         term body on all : P:Grad_Test_u\n\
         term contact on under : (pn*n + Ball_projection(tang({gamma}*slip - t), 0.3*pn)).Test_u\n\
         fix u = [0, -0.06*s] on lid\nsteps s = 0.25 to 1 by 0.25\nmeasure f = integral(pn) on under\n"
    )
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn an_obstacle_that_is_a_formula_has_the_bound_of_a_flat_one() {
    let right = run("disc-100", &on_disc(100.0), &[]);
    assert!(right.code == 0 && !right.tells("W503"), "{}", right.text);
    let soft = run("disc-1", &on_disc(1.0), &[]);
    assert!(soft.tells("W503"), "{}", soft.text);
    let words = soft.text.split("smallest safe value here: ").nth(1).and_then(|t| t.split_whitespace().next());
    let safe: f64 = words.and_then(|w| w.parse().ok()).unwrap_or_else(|| panic!("{}", soft.text));
    // E = 1 over cells of 0.1 for the trace constant of quadratic elements
    assert!((5.0..80.0).contains(&safe), "{safe}");
}

#[test]
fn a_load_on_a_face_with_contact_has_a_rule_of_its_own() {
    // a load x^4 on the contact region of a body that floats free of the obstacle: its force is 1/5
    let scene = "wfl 1\nmesh box [0,0] to [1,1] cells [2,2] quad\nregion top = faces where y == 1\n\
                 region base = faces where y == 0\nunknown u : vector\nterm body on all : 10*Sym(Grad_u):Grad_Test_u\n\
                 term contact on top : 1e3*pos_part(u(2) - 1)*Test_u(2)\nload u = [0, -x^4] on top\n\
                 fix u = [0,0] on base\nmeasure pull = integral((10*Sym(Grad_u)*Normal).Normal) on base\n\
                 measure pushed = integral(-x^4) on top\n";
    let ran = run("load", scene, &[]);
    assert!((ran.last("pushed") + 0.2).abs() < 1e-12, "{}", ran.text);
    assert!(ran.text.contains("loads [0, -0.2"), "{}", ran.text);
}

/// Two blocks under a uniform pressure with unknowns of different degrees, the lower one first: nodes of both sides have their
/// share of the force by the nodal rule of the higher degree.
#[test]
fn nodal_rules_have_the_nodes_of_both_sides() {
    let scene = |cells: &str, [low, up, multiplier]: [&str; 3], read: &str, rule: &str| {
        let (box_, last, zero) = if cells.contains("hex") || cells.contains("tet") {
            ("[0,0,0] to [1,1,2]", "z", "[0,0,0]")
        } else {
            ("[0,0] to [1,2]", "y", "[0,0]")
        };
        let pressed = zero.replace("0]", "-0.02]");
        let mapped = read == "m";
        let on = if mapped { "lower" } else { "f" };
        format!(
            "wfl 1\nmesh box {box_} cells {cells}\nregion below = cells where {last} < 1\n\
             region above = all - below\nregion foot = faces where {last} == 0\nregion lid = faces where {last} == 2\n\
             unknown a : vector {low} on below\nunknown b : vector {up} on above\n{}\
             multiplier l : vector {multiplier} on {on}\ndef jump(v,w) = v - Interpolate(w, {read})\n\
             def q = l + 1e4*jump(a, b)\n\
             term below on below : 1000*Sym(Grad_a):Grad_Test_a\nterm above on above : 1000*Sym(Grad_b):Grad_Test_b\n\
             term contact on {on} : l.jump(Test_a, Test_b)\n\
             term law on {on} : -1e-4*(l - pos_part(q.Normal)*Normal).Test_l\n{rule}\n\
             fix a = {zero} on foot\nfix b = {pressed} on lid\nmeasure low = min(Norm(l)) at nodes of {on}\n\
             measure high = max(Norm(l)) at nodes of {on}\nmeasure off = max(abs(a({last_}) + 0.01*{last})) on below\n",
            if mapped {
                format!(
                    "region lower = faces of below where {last} == 1\nregion upper = faces of above where {last} == 1\n\
                     mapping m = project from lower onto upper\n"
                )
            } else {
                "region f = interface from below to above\n".to_owned()
            },
            last_ = if last == "z" { 3 } else { 2 },
        )
    };
    let vertex = |on: &str| format!("quadrature on {on} vertex");
    for (cells, fields) in
        [("[2,4] quad", ["Q1", "Q2", "Q1"]), ("[2,4] quad", ["Q2", "Q1", "Q1"]), ("[2,2,2] hex", ["Q1", "Q2", "Q1"])]
    {
        let ran =
            run(&format!("nodal-{cells}-{}", fields[0]), &scene(cells, fields, "neighbor_element", &vertex("f")), &[]);
        ran.assert_silent();
        let [low, high, off] = ["low", "high", "off"].map(|name| ran.last(name));
        assert!((low - 10.0).abs() < 1e-9 && (high - 10.0).abs() < 1e-9 && off < 1e-12, "{cells}: {}", ran.text);
    }
    // there is none of degree three
    let refused = run("nodal-cubic", &scene("[2,4] tri", ["P1", "P3", "P1"], "neighbor_element", &vertex("f")), &[]);
    assert!(refused.code == 1 && refused.tells("E411"), "{}", refused.text);
    // a mapping leads to nodes that the rule does not know
    let mapped = |fields: [&str; 3], rule: &str| {
        run(&format!("mapped-{}", rule.len()), &scene("[2,4] quad", fields, "m", rule), &[])
    };
    let told = mapped(["Q1", "Q2", "Q1"], &vertex("lower"));
    assert!(told.tells("W506") && told.text.contains("degree 2"), "{}", told.text);
    let told = mapped(["Q1", "Q2", "Q1"], "quadrature on lower segments of m degree 1");
    assert!(told.tells("W506") && told.text.contains("each segment"), "{}", told.text);
    let right = mapped(["Q1", "Q2", "Q1"], "quadrature on lower segments of m degree 4");
    right.assert_silent();
    assert!((right.last("low") - 10.0).abs() < 1e-9, "{}", right.text);
}

/// Corners of triangles have no point of their own in the rule of degree two: a quadratic multiplier has another one.
#[test]
fn quadratic_multipliers_on_triangles_have_a_rule() {
    let ran = run(
        "quadratic-on-triangles",
        "wfl 1\nmesh box [0,0,0] to [1,1,1] cells [2,2,2] tet\nregion foot = faces where z == 0\nregion lid = faces where z == 1\n\
         unknown u : vector P2\nmultiplier l : scalar P2 on foot\nterm body on all : 1000*Sym(Grad_u):Grad_Test_u\n\
         def P = pos_part(1e4*(u.Normal) - l)\nterm contact on foot : P*(Normal.Test_u)\n\
         term law on foot : -1e-4*(l + P)*Test_l\nfix u = [0,0,-0.01] on lid\nmeasure off = max(abs(l + 10)) on foot\n",
        &[],
    );
    ran.assert_silent();
    assert!(ran.last("off") < 1e-9, "{}", ran.text);
}
