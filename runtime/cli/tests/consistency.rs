//! Formulations of contact under `wfl check`: each mistake has its warning, each right form beside it has none.

use std::process::{Command, Output};

/// A ring above the floor y = -1, its whole skin a region of contact.
const RING: usize = 0;

/// Two blocks in the plane or in space, or the [`RING`]; each case adds its terms.
fn base(dim: usize) -> String {
    if dim == RING {
        return "param turn = 0
param gamma = 5000
mesh box [0.5,0] to [1,2*pi] cells [2,24] quad map [x*cos(y + turn), x*sin(y + turn)]
region rim = faces where x^2 + y^2 > 0.9
unknown u : vector
def sigma(v) = 40*Div_v*Id(2) + 80*Sym(Grad_v)
term elastic on all : sigma(u):Grad_Test_u
"
        .to_owned();
    }
    let (mesh, n) = match dim {
        2 => ("mesh box [-1,0] to [1,1] cells [4,2] quad map [x + 0.1*y, y + 0.2*x]", 2),
        _ => ("mesh box [-1,0,0] to [1,1,1] cells [2,2,1] hex map [x + 0.1*y, y + 0.2*x, z]", 3),
    };
    format!(
        "{mesh}
region left = cells where x < 0.1*y
region right = all - left
region fault = interface from left to right
param theta = 1 in {{-1, 0, 1}}
param gamma = 400
param fric = 0.4
param E = 100
unknown uL : vector on left
unknown uR : vector on right
def s(G) = 0.4*E*Trace(G)*Id({n}) + 0.8*E*Sym(G)
def sigma(v) = s(Grad_v)
def trac(v) = sigma(v)*Normal
def other = s(Interpolate(Grad_uR, neighbor_element))*Normal
def jump(a,b) = a - Interpolate(b, neighbor_element)
def tang(w) = w - (w.Normal)*Normal
def contact(p, s, r) = pos_part(p)*Normal + Ball_projection(s, r)
term elasticL on left : sigma(uL):Grad_Test_uL
term elasticR on right : sigma(uR):Grad_Test_uR
"
    )
}

const NITSCHE: &str = "\
def Pn = gamma*(jump(uL,uR).Normal) - trac(uL).Normal
def Pt = gamma*tang(jump(uL,uR)) - tang(trac(uL))
def Ptheta = gamma*jump(Test_uL,Test_uR) - theta*trac(Test_uL)
term stress on fault : -theta/gamma*trac(uL).trac(Test_uL)
term touch on fault : 1/gamma*contact(Pn, Pt, fric*pos_part(Pn)).Ptheta
";

const UNBIASED: &str = "\
def PL = gamma*jump(uL,uR) - trac(uL)
def PR = gamma*jump(uL,uR) - other
def force(P) = contact(P.Normal, tang(P), fric*pos_part(P.Normal))
term stressL on fault : -theta/(2*gamma)*trac(uL).trac(Test_uL)
term touchL on fault : 1/(2*gamma)*force(PL).(gamma*jump(Test_uL,Test_uR) - theta*trac(Test_uL))
term stressR on fault : -theta/(2*gamma)*other.(s(Interpolate(Grad_Test_uR, neighbor_element))*Normal)
term touchR on fault : 1/(2*gamma)*force(PR).(gamma*jump(Test_uL,Test_uR) - theta*(s(Interpolate(Grad_Test_uR, neighbor_element))*Normal))
";

const MEAN: &str = "\
def mean = 0.5*trac(uL) + 0.5*other
def P = gamma*jump(uL,uR) - mean
def testmean = 0.5*trac(Test_uL) + 0.5*(s(Interpolate(Grad_Test_uR, neighbor_element))*Normal)
term stress on fault : -theta/gamma*mean.testmean
term touch on fault : 1/gamma*contact(P.Normal, tang(P), fric*pos_part(P.Normal)).(gamma*jump(Test_uL,Test_uR) - theta*testmean)
";

const PENALTY: &str = "\
def Pn = gamma*(jump(uL,uR).Normal)
def Pt = gamma*tang(jump(uL,uR))
term touch on fault : contact(Pn, Pt, fric*pos_part(Pn)).jump(Test_uL,Test_uR)
";

const AUGMENTED: &str = "\
multiplier lambda : vector on fault
def Pn = gamma*(jump(uL,uR).Normal) - lambda.Normal
def Pt = gamma*tang(jump(uL,uR)) - tang(lambda)
def force = contact(Pn, Pt, fric*pos_part(Pn))
term touch on fault : force.jump(Test_uL,Test_uR)
term law on fault : -1/gamma*(lambda + force).Test_lambda
";

fn wfl(name: &str, command: &str, dim: usize, form: &str, words: &[&str]) -> Output {
    let folder = std::env::temp_dir().join(format!("wfl_consistency_{}_{name}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let path = folder.join("scene.wfl");
    std::fs::write(&path, base(dim) + form).expect("a scene");
    let out =
        Command::new(env!("CARGO_BIN_EXE_wfl")).arg(command).arg(&path).args(words).output().expect("the command");
    std::fs::remove_dir_all(&folder).expect("the folder");
    out
}

/// A form, what is replaced in it by what, the code that is told or none, and words of the output.
type Case<'a> = (&'a str, &'a str, &'a str, Option<&'a str>, &'a str);

fn judge(name: &str, dim: usize, words: &[&str], cases: &[Case<'_>]) {
    let codes = ["W507", "W508", "W509", "W510"];
    for (k, (form, from, to, code, text)) in cases.iter().enumerate() {
        assert!(from.is_empty() || form.contains(from), "{from}");
        let form = if from.is_empty() { (*form).to_owned() } else { form.replace(from, to) };
        let out = wfl(&format!("{name}_{k}"), "check", dim, &form, words);
        let all = format!("{}{}", String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr));
        assert_eq!(out.status.code(), Some(0), "{from} -> {to}\n{all}");
        for known in codes {
            let told = all.contains(&format!("warning[{known}]"));
            assert_eq!(told, *code == Some(known), "{name}: {known} for {from} -> {to} {words:?}\n{all}");
        }
        assert!(all.contains(text), "{name}: {text:?} for {from} -> {to}\n{all}");
    }
}

const MISTAKES: &[Case<'_>] = &[
    (NITSCHE, "term stress on fault : -theta/gamma*trac(uL).trac(Test_uL)\n", "", Some("W508"), "term touch on fault"),
    (NITSCHE, ": -theta/gamma", ": theta/gamma", Some("W508"), "remains where contact is closed"),
    (NITSCHE, "- theta*trac(Test_uL)\n", "+ theta*trac(Test_uL)\n", Some("W508"), "NOT consistent (W508)"),
    (
        NITSCHE,
        "- trac(uL).Normal",
        "+ trac(uL).Normal",
        Some("W507"),
        "closed contact balances 0 on one side and 0 on the other",
    ),
    (NITSCHE, "- tang(trac(uL))", "+ tang(trac(uL))", Some("W507"), "sticking contact balances -1.000"),
    (NITSCHE, "= gamma*(jump", "= -gamma*(jump", Some("W510"), "repel each other across an open gap"),
    (NITSCHE, "= gamma*tang", "= -gamma*tang", Some("W510"), "friction drives the slip"),
    (NITSCHE, "(Pn, Pt, fric", "(Pn, -Pt, fric", Some("W507"), "sticking contact balances -1.000"),
    (NITSCHE, "fric*pos_part(Pn)", "fric*pos_part(-Pn)", Some("W510"), "friction acts across an open gap"),
    (
        NITSCHE,
        "gamma*jump(Test_uL,Test_uR)",
        "gamma*Test_uL",
        Some("W507"),
        "balances 1.000 on one side and 0 on the other",
    ),
];

#[test]
fn mistakes_in_nitsches_method_are_seen() {
    for theta in ["theta=1", "theta=-1"] {
        judge("plane", 2, &[theta], MISTAKES);
        judge("space", 3, &[theta], MISTAKES);
    }
}

#[test]
fn right_forms_are_silent_and_named() {
    let skew = "consistent; skew-symmetric variant (theta = -1)";
    let cases: &[Case<'_>] = &[
        (NITSCHE, "", "", None, skew),
        (UNBIASED, "", "", None, skew),
        (MEAN, "", "", None, skew),
        (PENALTY, "", "", None, "penalty: an overlap of pressure/gamma, an error of order 1/gamma"),
        (AUGMENTED, "", "", None, "consistent; the traction is a multiplier"),
    ];
    judge("right", 2, &["theta=-1"], cases);
    judge("right_space", 3, &["theta=-1"], cases);
    judge("symmetric", 2, &["theta=1"], &[(UNBIASED, "", "", None, "symmetric variant (theta = 1)")]);
    // far from E/h the verdict is the same
    judge(
        "soft",
        2,
        &["gamma=1e-6"],
        &[(NITSCHE, "", "", None, "consistent; symmetric"), (PENALTY, "", "", None, "penalty")],
    );
    judge(
        "stiff",
        2,
        &["gamma=1e12"],
        &[(NITSCHE, "", "", None, "consistent; symmetric"), (PENALTY, "", "", None, "penalty")],
    );
}

/// Faces that look away from a floor never meet it: what the law would do there says nothing of it.
#[test]
fn a_skin_all_around_a_body_is_judged_where_it_looks_at_the_floor() {
    let nitsche = "def traction = sigma(u)*Normal\ndef p = pos_part(traction(2) - gamma*(1 + y + u(2)))\n\
                   term touch on rim : -p*Test_u(2)\n";
    let penalty = "term touch on rim : -gamma*pos_part(-(1 + y + u(2)))*Test_u(2)\n";
    for turn in ["0", "0.1", "0.54", "1.57", "3.5"] {
        let words = [format!("turn={turn}")];
        let words = words.each_ref().map(String::as_str);
        judge(
            &format!("ring_{turn}"),
            RING,
            &words,
            &[
                (nitsche, "", "", None, "consistent; incomplete variant"),
                (nitsche, "traction(2) -", "-traction(2) -", Some("W507"), "closed contact balances"),
                (penalty, "", "", None, ""),
            ],
        );
    }
}

#[test]
fn mistakes_in_other_forms_are_seen() {
    let right = "term touchR on fault : 1/(2*gamma)*force(PR)";
    let one_side = &UNBIASED[..UNBIASED.find("term stressR").expect("a line")];
    let cases: &[Case<'_>] = &[
        (one_side, "", "", Some("W507"), "closed contact balances 0.500"),
        (
            UNBIASED,
            right,
            "term touchR on fault : -1/(2*gamma)*force(PR)",
            Some("W507"),
            "closed contact balances 0 on",
        ),
        (UNBIASED, "term stressR on fault : -theta", "term stressR on fault : theta", Some("W508"), ""),
        (MEAN, "def mean = 0.5*trac(uL) + 0.5*other", "def mean = 0.5*trac(uL)", Some("W507"), ""),
        (PENALTY, "= gamma*(jump", "= -gamma*(jump", Some("W510"), "forces grow with an open gap"),
        (PENALTY, "= gamma*tang", "= -gamma*tang", Some("W510"), "friction drives the slip"),
        (PENALTY, "jump(Test_uL,Test_uR)", "Test_uL", Some("W507"), "1.000 on one side and 0 on the other"),
        (PENALTY, ": contact(", ": -contact(", Some("W510"), "attract each other more as they are pressed"),
        (AUGMENTED, "(lambda + force)", "(lambda - force)", Some("W509"), "no multiplier satisfies"),
        (AUGMENTED, "- lambda.Normal", "+ lambda.Normal", Some("W509"), "no multiplier satisfies"),
        (AUGMENTED, "- tang(lambda)", "+ tang(lambda)", Some("W509"), "no multiplier satisfies"),
    ];
    judge("other", 2, &[], cases);
}

/// Laws that are not of contact, or that cannot be judged, are left alone; `wfl verify` says why.
#[test]
fn what_cannot_be_judged_is_left_alone() {
    let load = format!("{NITSCHE}term fluid on fault : 3*(Normal.jump(Test_uL,Test_uR))\n");
    let cohesion = "def open = -(jump(uL,uR).Normal)\n\
        term touch on fault : (gamma*pos_part(-open) - 5*pos_part(open)*exp(-10*open))*(Normal.jump(Test_uL,Test_uR))\n";
    let tresca = NITSCHE.replace("fric*pos_part(Pn)", "3");
    let spring = "term touch on fault : gamma*jump(uL,uR).jump(Test_uL,Test_uR)\n";
    for (k, (form, why)) in [
        (load.as_str(), Some("not judged: a load acts on these faces")),
        (cohesion, Some("not judged: forces act across an open gap")),
        (tresca.as_str(), Some("consistent; symmetric variant")),
        (spring, None),
    ]
    .into_iter()
    .enumerate()
    {
        judge(&format!("left_{k}"), 2, &[], &[(form, "", "", None, "")]);
        let out = wfl(&format!("why_{k}"), "verify", 2, form, &["--samples", "2"]);
        let text = String::from_utf8_lossy(&out.stdout).into_owned();
        assert!(out.status.success(), "{text}");
        assert_eq!(text.contains("\ncontact\n"), why.is_some(), "{text}");
        assert!(text.contains(why.unwrap_or("")), "{why:?}\n{text}");
    }
}

/// A mistake is an error of `wfl verify`, and a warning of `wfl run`.
#[test]
fn verify_fails_and_run_warns() {
    let wrong = NITSCHE.replace("- trac(uL).Normal", "+ trac(uL).Normal");
    let verified = wfl("fails", "verify", 2, &wrong, &["--samples", "2"]);
    assert_eq!(verified.status.code(), Some(1));
    let text = String::from_utf8_lossy(&verified.stderr).into_owned();
    assert!(text.contains("error: W507: the contact terms do not balance the traction of the bodies"), "{text}");
    let held = "fix uL, uR = [0,0] on boundary\n";
    let ran = wfl(
        "warns",
        "run",
        2,
        &(wrong + held),
        &[
            "--out",
            &std::env::temp_dir().join(format!("wfl_consistency_run_{}", std::process::id())).display().to_string(),
        ],
    );
    assert!(String::from_utf8_lossy(&ran.stderr).contains("warning[W507]"));
}

/// theta, and the smallest safe gamma that W503 names for a form far below it.
fn bound(name: &str, form: &str, theta: &str) -> (String, f64) {
    let folder = std::env::temp_dir().join(format!("wfl_consistency_{}_{name}_out", std::process::id()));
    let place = folder.display().to_string();
    let held = format!("{form}fix uL, uR = [0,0] on boundary\n");
    let out = wfl(name, "run", 2, &held, &["gamma=1e-3", theta, "--out", &place]);
    let _ = std::fs::remove_dir_all(folder);
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    let behind = |what: &str| {
        let rest = text.split(what).nth(1).unwrap_or_else(|| panic!("{what}\n{text}"));
        rest.split_whitespace().next().unwrap_or_default().to_owned()
    };
    (behind("warning[W503]: theta = "), behind("smallest safe value here: ").parse().expect("a number"))
}

/// A form with half of each term on each side has half the bound on each, and its theta is the one that is written.
#[test]
fn the_bound_of_a_form_with_weights_is_its_own() {
    for (theta, number) in [("theta=1", "1"), ("theta=0", "0")] {
        let whole = bound(&format!("whole{number}"), NITSCHE, theta);
        assert_eq!(whole.0, number);
        for (name, form) in [("unbiased", UNBIASED), ("mean", MEAN)] {
            let half = bound(&format!("{name}{number}"), form, theta);
            assert_eq!(half.0, number, "{name}");
            // the stresses of both cells together are the largest in other motions than each alone
            let least = if name == "mean" { 0.25 } else { 0.499 };
            let part = half.1 / whole.1;
            assert!((least..0.501).contains(&part), "{name} {theta}: {} against {}", half.1, whole.1);
        }
    }
}
