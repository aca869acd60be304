//! Laws that jump in an unknown: each piece may be affine, the law is not, and Newton's method has to look at it.

use super::run;

/// u from a law of v = 2t and of itself, on one cell.
fn relay(name: &str, law: &str, steps: &str) -> super::Ran {
    let scene = format!(
        "mesh box [0] to [1] cells [1] segment\nunknown u : scalar\nunknown v : scalar\n\
         term clock on all : (v - 2*t)*Test_v\nterm relay on all : (u - ({law}))*Test_u\nsteps t = {steps}\n\
         measure m = mean(u) on all\n"
    );
    run(&format!("jumps-{name}"), &scene, &[])
}

#[test]
fn a_law_that_jumps_in_an_unknown_is_seen() {
    let laws = [
        ("if", "if v > 1 then 3 else 1", [1.0, 3.0]),
        ("heaviside", "Heaviside(v - 1)", [0.0, 1.0]),
        ("sign", "sign(v - 1)", [-1.0, 1.0]),
        // a coupling of one side alone, which is zero up to the jump
        ("unsymmetric", "if v > 1 then v else 0", [0.0, 2.0]),
        ("itself", "4*t - 0.5*Heaviside(u - 1)", [0.4, 3.5]),
    ];
    for (name, law, [before, behind]) in laws {
        for (steps, right) in
            [("0.05 to 0.1 by 0.05", before), ("0.1 to 1 by 0.9", behind), ("0.1 to 1 by 0.3", behind)]
        {
            let ran = relay(name, law, steps);
            assert_eq!(ran.code, 0, "{name}, {steps}: {}", ran.text);
            assert!(
                (ran.last("m") - right).abs() < 1e-12,
                "{name}, {steps}: {} for {right}\n{}",
                ran.last("m"),
                ran.text
            );
        }
    }
}

/// u' + u = 1 from where v = t has passed 1: u(2) = 1 - 1/e but for the error of the steps, the same as of a jump over t.
#[test]
fn a_jump_in_an_unknown_is_that_over_time() {
    let of = |name: &str, argument: &str, steps: &str| {
        let scene = format!(
            "mesh box [0] to [1] cells [1] segment\nunknown u : scalar\nunknown v : scalar\n\
             term clock on all : (Dot_v - 1)*Test_v\n\
             term flow on all : (Dot_u + u - (if {argument} > 1.001 then 1 else 0))*Test_u\nsteps t = 0 to 2 {steps}\n\
             measure m = mean(u) on all\n"
        );
        let ran = run(&format!("jumps-flow-{name}"), &scene, &[]);
        assert_eq!(ran.code, 0, "{}", ran.text);
        ran.last("m")
    };
    let [in_time, in_unknown] = ["t", "v"].map(|a| of(a, a, "by 0.01"));
    assert!((in_unknown - in_time).abs() < 1e-12, "{in_unknown} for {in_time}");
    let by_auto = of("auto", "v", "by auto with error=1e-4");
    assert!((by_auto - (1.0 - (-0.999f64).exp())).abs() < 1e-3, "{by_auto}");
}
