//! Steps that the run chooses see how far the unknowns are behind the states that terms read as the step before has left them.

use super::run;

/// Norton creep under a constant stress, its strain written with the last one: increments doubled for ever, and the last step alone was 43
/// % of the way.
#[test]
fn creep_with_its_last_strain_is_as_exact_as_demanded() {
    for (error, wrong) in [("1e-3", 0.03), ("1e-4", 0.015), ("1e-6", 1.5e-3)] {
        let scene = format!(
            "mesh box [0] to [1] cells [2]\nregion a = faces where x == 0\nregion b = faces where x == 1\nunknown u : scalar\n\
             def sig = 1e5*(Grad_u(1) - Previous_ec)\n\
             state ec : scalar on all := Previous_ec + timestep*1e-12*abs(sig)^3*sig\n\
             term el on all : sig*Grad_Test_u(1)\nfix u = 0 on a\nload u = 100 on b\n\
             steps t = 0 to 100 by auto with error={error}\nmeasure d = max(u) at nodes of all\n"
        );
        let ran = run(&format!("lag-creep-{error}"), &scene, &[]);
        ran.assert_silent();
        assert!((ran.last("d") / 0.011 - 1.0).abs() < wrong, "{error}: {}", ran.last("d"));
        assert!(ran.steps() < 5000, "{error}: {} steps", ran.steps());
    }
}

/// A pin that wears under a constant load: it sinks by what is worn, and is compressed by far less.
#[test]
fn a_pin_sinks_by_what_is_worn() {
    for stiff in ["1e4", "1e6", "1e9"] {
        let scene = format!(
            "mesh box [0] to [1] cells [1]\nregion floor = faces where x == 0\nregion top = faces where x == 1\n\
             unknown u : scalar\ndef press = {stiff}*pos_part(-u - Previous_depth)\n\
             state depth : scalar on floor := Previous_depth + 1e-2*press*timestep\nterm b on all : 1e3*Grad_u.Grad_Test_u\n\
             term c on floor : -press*Test_u\nload u = -5 on top\nsteps t = 0 to 10 by auto\nmeasure sunk = mean(-u) on top\n"
        );
        let ran = run(&format!("lag-wear-{stiff}"), &scene, &[]);
        assert_eq!(ran.code, 0, "{}", ran.text);
        let right = 0.5 + 5.0 / 1e3 + 5.0 / stiff.parse::<f64>().expect("a number");
        assert!((ran.last("sunk") / right - 1.0).abs() < 0.02, "{stiff}: {} for {right}", ran.last("sunk"));
        assert!(ran.steps() < 2000, "{stiff}: {} steps", ran.steps());
    }
}

/// A return mapping gives the same stress behind its own update: a bar beyond yield takes no more steps than its load needs, and
/// is exact.
#[test]
fn a_return_mapping_lags_by_nothing() {
    let scene = "param E = 1e5\nparam H = 1e4\nparam sy = 100\nmesh box [0] to [1] cells [2]\n\
                 region a = faces where x == 0\nregion b = faces where x == 1\nunknown u : scalar\n\
                 def trial = E*(Grad_u(1) - Previous_ep)\n\
                 def more = pos_part(trial - sy - H*Previous_al)/(E + H)\n\
                 state ep : scalar on all := Previous_ep + more\nstate al : scalar on all := Previous_al + more\n\
                 term el on all : (trial - E*more)*Grad_Test_u(1)\nfix u = 0 on a\nfix u = 1e-2*t on b\n\
                 steps t = 0 to 1 by auto with error=1e-6\nmeasure strain = max(ep) on all\n";
    let ran = run("lag-plastic", scene, &[]);
    ran.assert_silent();
    // E (e - ep) = sy + H ep
    assert!((ran.last("strain") / ((1e5 * 1e-2 - 100.0) / 1.1e5) - 1.0).abs() < 1e-9, "{}", ran.last("strain"));
    assert!(ran.steps() < 100, "{} steps", ran.steps());
}

/// Creep of a hundred thousandth of the elastic strain: what a step changes of the forces is less than the first look at them sees. It
/// ended 9 % off.
#[test]
fn creep_far_below_the_elastic_strain_is_as_exact() {
    for (rate, wrong) in [("1e-3", 0.015), ("1e-5", 0.015), ("1e-6", 0.02)] {
        let scene = format!(
            "param S = 1e4\nmesh box [0] to [1] cells [2]\nregion a = faces where x == 0\nregion b = faces where x == 1\n\
             unknown u : scalar\ndef sig = 1e5*(Grad_u(1) - Previous_ec)\n\
             state ec : scalar on all := Previous_ec + timestep*{rate}*sig/1e5\nterm el on all : sig*Grad_Test_u(1)\n\
             fix u = 0 on a\nload u = S on b\nsteps t = 0 to 1 by auto with error=1e-4\n\
             measure creep = max(u - S/1e5) at nodes of b\n"
        );
        let ran = run(&format!("lag-below-{rate}"), &scene, &[]);
        let right = rate.parse::<f64>().expect("a number") * 0.1;
        assert!(ran.code == 0 && (ran.last("creep") / right - 1.0).abs() < wrong, "{rate}: {}", ran.last("creep"));
        assert!(ran.steps() < 300, "{rate}: {} steps", ran.steps());
    }
}

/// Creep that is small beside the elastic strain, which is there at once: it ended 48 % wrong, since 1 % of the elastic strain is as much.
#[test]
fn creep_beside_a_large_elastic_strain_is_as_exact() {
    for (load, end) in [("1", 1.0), ("100", 1.0), ("1e4", 1.0), ("1e4", 100.0), ("1e6", 100.0)] {
        let scene = format!(
            "param S = {load}\nmesh box [0] to [1] cells [2]\nregion a = faces where x == 0\nregion b = faces where x == 1\n\
             unknown u : scalar\ndef sig = 1e5*(Grad_u(1) - Previous_ec)\n\
             state ec : scalar on all := Previous_ec + timestep*1e-4*sig/S\nterm el on all : sig*Grad_Test_u(1)\n\
             fix u = 0 on a\nload u = S on b\nsteps t = 0 to {end} by auto with error=1e-4\n\
             measure creep = max(u - S/1e5) at nodes of b\n"
        );
        let ran = run(&format!("lag-beside-{load}-{end}"), &scene, &[]);
        ran.assert_silent();
        assert!((ran.last("creep") / (1e-4 * end) - 1.0).abs() < 0.015, "{load} {end}: {}", ran.last("creep"));
        assert!(ran.steps() < 300, "{load} {end}: {} steps", ran.steps());
    }
}
