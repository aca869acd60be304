//! Elastic joints between blocks: what gives way there is strain, no overlap and no slip of sticking points. Scenes are made
//! by [`Joint`], whose closed form they are compared with; a wrong sign in them is told.

use super::{Ran, run};

/// What the law of a joint is, beside its stiffness along and across.
#[derive(Clone, Copy, Debug)]
enum Law {
    /// Elastic alone.
    Bond,
    /// The shear has a bound: cohesion.
    Cohesive(f64),
    /// Cohesion and the tangent of the friction angle.
    Mohr(f64, f64),
    /// The same, and the tangent of the dilation angle: what slides opens the joint.
    Dilatant(f64, f64, f64),
}

/// Two or three blocks of length 1 without lateral strain under a stretch, joined by joints across x; along the first axis a
/// block has the stiffness E, in shear E/2.
#[derive(Clone, Copy, Debug)]
struct Joint {
    law: Law,
    /// "quad", "tri", "hex" or "tet".
    cells: &'static str,
    joints: usize,
    young: f64,
    /// Stiffness along the normal and across.
    kn: f64,
    ks: f64,
    /// What the far end is moved by, out of the blocks and along the joint.
    moved: [f64; 2],
    /// The blocks lie along y.
    upright: bool,
    /// What the law is multiplied with.
    sign: &'static str,
}

const BOTH: Joint = Joint {
    law: Law::Mohr(10.0, 0.7),
    cells: "quad",
    joints: 1,
    young: 1e10,
    kn: 1e4,
    ks: 1e4,
    moved: [-6e-4, 8e-4],
    upright: false,
    sign: "",
};

impl Joint {
    fn text(&self) -> String {
        let n = self.joints + 1;
        let names = &["a", "b", "c"][..n];
        let (axis, other) = if self.upright { ("y", 1) } else { ("x", 0) };
        let is_solid = matches!(self.cells, "hex" | "tet");
        let vector = |along: f64, across: f64| {
            let mut v = [across; 2];
            v[other] = along;
            let rest = if is_solid { ", 0" } else { "" };
            format!("[{}, {}{rest}]", v[0], v[1])
        };
        let (mut high, mut cells) = (vec!["1".to_owned(); 2], vec!["2".to_owned(); 2]);
        (high[other], cells[other]) = (n.to_string(), (2 * n).to_string());
        if is_solid {
            high.push("1".to_owned());
            cells.push("2".to_owned());
        }
        let low = vec!["0"; high.len()].join(",");
        let mut text = format!(
            "wfl 1\nmesh box [{low}] to [{}] cells [{}] {}\nregion held = faces where {axis} == 0\nregion moved = faces where {axis} == {n}\n",
            high.join(","),
            cells.join(","),
            self.cells
        );
        text += "def tang(w) = w - (w.Normal)*Normal\ndef opens(a,b) = Interpolate(b, neighbor_element) - a\n";
        for (k, name) in names.iter().enumerate() {
            text += &format!(
                "region {name} = cells where {axis} > {k} and {axis} < {}\nunknown u{name} : vector on {name}\n",
                k + 1
            );
            text += &format!("term e{name} on {name} : {}*Sym(Grad_u{name}):Grad_Test_u{name}\n", self.young);
        }
        for (k, pair) in names.windows(2).enumerate() {
            let (a, b) = (pair[0], pair[1]);
            text += &format!("region j{k} = interface from {a} to {b}\ndef w{k} = opens(u{a},u{b})\n");
            text += &self.traction(k);
            text += &format!(
                "term joint{k} on j{k} : -({}(T{k})).(Test_u{a} - Interpolate(Test_u{b}, neighbor_element))\n",
                self.sign
            );
        }
        let [along, across] = self.moved;
        text += &format!(
            "fix ua = {} on held\nfix u{} = {} on moved\n",
            vector(0.0, 0.0),
            names[n - 1],
            vector(along, across)
        );
        text + &format!(
            "measure normal = mean(T0({})) on j0\nmeasure shear = mean(T0({})) on j0\n",
            other + 1,
            2 - other
        )
    }

    fn traction(&self, k: usize) -> String {
        let (kn, ks) = (self.kn, self.ks);
        let (s, t) = (format!("{kn}*(w{k}.Normal)"), format!("{ks}*tang(w{k})"));
        match self.law {
            Law::Bond => format!("def T{k} = {s}*Normal + {t}\n"),
            Law::Cohesive(c) => format!("def T{k} = {s}*Normal + Ball_projection({t}, {c})\n"),
            Law::Mohr(c, f) => format!("def T{k} = {s}*Normal + Ball_projection({t}, pos_part({c} - {f}*{s}))\n"),
            Law::Dilatant(c, f, d) => format!(
                "def l{k} = pos_part(Norm({t}) - ({c} - {f}*{s}))/({ks} + {})\ndef p{k} = {s} - {}*l{k}\n\
                 def T{k} = p{k}*Normal + Ball_projection({t}, pos_part({c} - {f}*p{k}))\n",
                kn * f * d,
                kn * d
            ),
        }
    }

    /// Tractions along the normal and across: springs in series, and in shear at most the bound.
    fn expected(&self) -> [f64; 2] {
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let (blocks, joints) = ((self.joints + 1) as f64, self.joints as f64);
        // a block between two joints turns: the couple of the shear against springs at three points of its faces, with the
        // weights 1/4, 1/2, 1/4, whose second moment is 1/8
        let turns = if self.joints == 2 { 4.0 / self.kn } else { 0.0 };
        let n = self.moved[0] / (blocks / self.young + joints / self.kn);
        let t = self.moved[1].abs() / (2.0 * blocks / self.young + joints / self.ks + turns);
        let signed = |t: f64| t * self.moved[1].signum();
        match self.law {
            Law::Bond => [n, signed(t)],
            Law::Cohesive(c) => [n, signed(t.min(c))],
            Law::Mohr(c, f) => [n, signed(t.min((c - f * n).max(0.0)))],
            Law::Dilatant(c, f, d) => {
                // of the slip l a joint: n(l) = n - d l/(1/kn + blocks/joints/E), t(l) likewise, on the cone
                let [an, at] = [(self.kn, self.young), (self.ks, 0.5 * self.young)]
                    .map(|(k, e)| 1.0 / (1.0 / k + blocks / joints / e));
                let l = ((t - c + f * n) / (at + f * d * an)).max(0.0);
                [n - d * an * l, signed(t - at * l)]
            }
        }
    }

    fn solved(&self, name: &str) -> Ran {
        run(&format!("joint-{name}"), &self.text(), &[])
    }
}

fn scenes() -> Vec<(&'static str, Joint)> {
    let cohesive = Joint { law: Law::Cohesive(10.0), ..BOTH };
    let dilatant = Joint { law: Law::Dilatant(5.0, 0.7, 0.2), moved: [-1e-4, 2e-3], ..BOTH };
    let stiff = Joint { young: 1e14, ..BOTH };
    vec![
        ("bond", Joint { law: Law::Bond, ..BOTH }),
        ("cohesive", cohesive),
        ("cohesive-slides", Joint { moved: [0.0, 3e-3], ..cohesive }),
        ("pressed", Joint { moved: [-1e-3, 0.0], ..BOTH }),
        ("pulled", Joint { moved: [5e-4, 0.0], ..BOTH }),
        ("sheared", Joint { moved: [0.0, 5e-4], ..BOTH }),
        ("both", BOTH),
        ("pulled-and-sheared", Joint { moved: [5e-4, -2e-4], ..stiff }),
        ("slides", Joint { moved: [-5e-4, 1.8e-3], ..stiff }),
        // beyond the apex of the cone no shear is left
        ("apex", Joint { moved: [1.6e-3, 2e-4], ..stiff }),
        ("soft-joint", Joint { kn: 1e2, ks: 3e1, ..BOTH }),
        ("stiff-joint", Joint { young: 1e13, kn: 1e8, ks: 1e7, moved: [-6e-8, 8e-7], ..BOTH }),
        ("soft-blocks", Joint { young: 1e3, moved: [-1e-3, 0.0], ..BOTH }),
        ("soft-shear", Joint { kn: 1e7, ks: 1e3, moved: [-6e-7, 2e-3], ..BOTH }),
        ("two", Joint { joints: 2, young: 1e8, ..BOTH }),
        ("dilatant-sticks", Joint { moved: [-6e-4, 5e-4], ..dilatant }),
        ("dilatant", dilatant),
        ("tri", Joint { cells: "tri", ..cohesive }),
        ("hex", Joint { cells: "hex", ..BOTH }),
        ("tet", Joint { cells: "tet", ..BOTH }),
        ("upright", Joint { upright: true, ..BOTH }),
        ("upright-two", Joint { upright: true, joints: 2, ..cohesive }),
    ]
}

#[test]
fn elastic_joints_are_right_and_silent() {
    let mut wrong = Vec::new();
    for (name, joint) in scenes() {
        let ran = joint.solved(name);
        if ran.code != 0 || !ran.codes().is_empty() {
            wrong.push(format!("{name}: exit {}: {}", ran.code, ran.text));
            continue;
        }
        let ([n, t], [right_n, right_t]) = ([ran.last("normal"), ran.last("shear")], joint.expected());
        let size = right_n.abs().max(right_t.abs());
        // the blocks under shear bend, too: their sides are free
        let of_blocks = if joint.moved[1] == 0.0 { 0.0 } else { 20.0 * joint.ks / joint.young };
        let off = (n - right_n).abs().max((t - right_t).abs()) / size;
        if off > 1e-9 + of_blocks {
            wrong.push(format!("{name}: {n}, {t} for {right_n}, {right_t}"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// True if a check has spoken, and not the grammar.
fn is_told(ran: &Ran) -> bool {
    ran.codes().iter().any(|code| !code.starts_with("E2"))
}

#[test]
fn a_wrong_sign_in_a_joint_is_told() {
    for (name, joint) in scenes() {
        let ran = Joint { sign: "-", ..joint }.solved(&format!("wrong-{name}"));
        assert!(is_told(&ran), "{name}: {}", ran.text);
    }
    // of the normal alone, and of friction alone
    let right = BOTH.text();
    let wrong = [
        ("normal", right.replace("def T0 = 10000*(w0.Normal)*Normal", "def T0 = -10000*(w0.Normal)*Normal")),
        ("friction", right.replace("+ Ball_projection(", "- Ball_projection(")),
    ];
    for (part, text) in wrong {
        assert!(text != right, "{part}");
        let ran = run(&format!("joint-wrong-{part}"), &text, &[]);
        assert!(is_told(&ran), "{part}: {}", ran.text);
    }
}

#[test]
fn a_penalty_as_soft_as_the_bodies_is_none_of_a_joint() {
    let law = "def T0 = (0 - pos_part(-200*(w0.Normal)))*Normal + Ball_projection(200*tang(w0), 0.7*pos_part(-200*(w0.Normal)))\n";
    let joint = Joint { young: 1e3, kn: 200.0, ks: 200.0, ..BOTH };
    let own = joint.traction(0);
    let text = joint.text().replace(&own, law);
    assert!(text.contains(law), "{text}");
    let ran = run("joint-penalty", &text, &[]);
    assert!(ran.tells("W606") && ran.text.contains("overlap"), "{}", ran.text);
}

/// Two blocks under `law`, the traction along the normal of the joint that presses where it is positive, pulled apart.
fn joined(law: &str) -> String {
    format!(
        "wfl 1\nmesh box [0,0] to [1,2] cells [1,2] quad\nregion under = cells where y < 1\nregion over = cells where y > 1\n\
         region joint = interface from under to over\nregion floor = faces where y == 0\nregion lid = faces where y == 2\n\
         unknown u : vector\nsplit u across joint\ndef closed = (u - Interpolate(u, neighbor_element)).Normal\n\
         def open = pos_part(-closed)\n{law}\n\
         term bulk on all : 1e3*Sym(Grad_u):Grad_Test_u\n\
         term joint on joint : press*(Normal.(Test_u - Interpolate(Test_u, neighbor_element)))\n\
         fix u = [0,0] on floor\nfix u(2) = 0.006*t on lid\nfix u(1) = 0 on lid, joint\nsteps t = 0 to 1 by 0.25\n\
         measure pull = reaction(u(2)) on lid\nmeasure width = max(open) on joint\n"
    )
}

/// A law that is meant to pull resists being closed; one whose sign is wrong does not.
#[test]
fn adhesion_and_damage_are_no_contact_that_pulls() {
    for law in [
        "def press = 1e5*pos_part(closed) - 2*pos_part(1 - open/1e-2)",
        "def worst = max(Previous_far, open)\nstate far : scalar on joint := worst\n\
         def press = 1e5*pos_part(closed) - 700*pos_part(1 - worst/2e-2)*open",
    ] {
        let ran = run("alarms-joined", &joined(law), &[]);
        assert!(ran.code == 0 && !ran.tells("W606"), "{law}: {}", ran.text);
    }
    for law in
        ["def press = -1e5*pos_part(closed) - 2*pos_part(1 - open/1e-2)", "def press = -1e3*pos_part(closed + 1e-2)"]
    {
        let ran = run("alarms-joined-wrong", &joined(law), &[]);
        assert!(ran.tells("W606") || ran.code != 0, "{law}: {}", ran.text);
    }
}

/// A joint that opens as it is sheared, whose elastic slip opens it while it still sticks: the pressure works along that motion, and
/// friction drives nothing. Told was whether the pressure times the dilation is more than the shear, which depends on the steps.
#[test]
fn a_joint_that_opens_while_it_sticks_is_not_driven() {
    let scene = |steps: usize, sign: &str| {
        format!(
            "use \"contact\"\nparam E = 25000\nparam gamma = 1e3*E\nparam dil = 0.1\nparam fric = 0.4\n\
             mesh box [-1,0] to [2,1] cells [6,2] quad\nregion left = cells where x < 0\nregion right = cells where x > 0\n\
             region fault = interface from left to right\nregion west = faces where x == -1\nregion east = faces where x == 2\n\
             region sides_left = faces of left where y == 0 or y == 1\n\
             region sides_right = faces of right where y == 0 or y == 1\nunknown uL : vector Q1 on left\n\
             unknown uR : vector Q1 on right\nunknown tau : scalar global\ndef sigma(v) = E*Sym(Grad_v)\n\
             def trac(v) = sigma(v)*Normal\nterm elastic on left : sigma(uL):Grad_Test_uL\n\
             term elastic2 on right : sigma(uR):Grad_Test_uR\nsteps t = 1/{steps} to 1 by 1/{steps}\nfix uL = [0, 0] on west\n\
             fix uR = [-3*10/E, 3e-3*t] on east\nload uL = (tau*(if y > 0.5 then 1 else -1))*[1,0] on sides_left\n\
             load uR = (tau*(if y > 0.5 then 1 else -1))*[1,0] on sides_right\n\
             term ttau on fault : (tau + held(2))*Test_tau\n\
             def Pt = gamma*(tang(jump(uL,uR)) - Previous_slid) - tang(trac(uL))\n\
             def held = Ball_projection(Pt, fric*pos_part(Pn))\n\
             def Pn = gamma*(jump(uL,uR).Normal + dil*Norm(tang(jump(uL,uR)))) - trac(uL).Normal\n\
             state slid : vector on fault := Previous_slid + (Pt - held)/gamma\n\
             term con on fault : (pos_part(Pn)*Normal + {sign}held).jump(Test_uL,Test_uR)\n\
             measure s = mean(-(jump(uL,uR))(2)) on fault\n"
        )
    };
    for steps in [8, 16, 32] {
        let ran = run(&format!("sticking-dilatant-{steps}"), &scene(steps, ""), &[]);
        assert!(ran.code == 0 && !ran.tells("W606"), "{steps}: {}", ran.text);
        // (mu d/3 - F p0)/(mu/3 + F E dil/3) with the shear modulus mu = E/2
        assert!((ran.last("s") - 1.888_889e-3).abs() < 1e-8, "{steps}: {}", ran.last("s"));
    }
}
