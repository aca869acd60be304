//! Laws so steep that a number beside the solution changes their forces by as much as they are: a step that is accepted
//! because all is rounding has the right forces, or is told.

use super::run;

/// A block on a floor with rate-and-state friction, driven from rest. It slides all along: an independent integration (implicit
/// Euler of the same two equations) has the coefficient of friction 0.594 at the end.
#[test]
fn a_law_that_is_steep_at_rest_is_left_behind() {
    for step in [0.01, 0.05] {
        let scene = format!(
            "mesh box [0,0] to [1,1] cells [1,1] quad\nregion floor = faces where y == 0\nregion top = faces where y == 1\n\
             unknown u : vector\nterm block on all : 1000*Sym(Grad_u):Grad_Test_u\ndef press = 1e6*pos_part(u.Normal)\n\
             def V = (u(1) - Previous_u(1))/timestep\ndef q = V*timestep/0.1\n\
             def mu = 0.01*asinh(V/2*exp((0.6 + 0.008*log(Previous_theta/0.1))/0.01))\n\
             state theta : scalar on floor := Previous_theta*exp(-q) + timestep*(if abs(q) < 1e-6 then 1 - q/2 else -expm1(-q)/q)\n\
             start theta = 0.1\nterm contact on floor : press*(Test_u.Normal) + mu*press*Test_u(1)\nsteps t = 0 to 0.5 by {step}\n\
             fix u = [t,-0.01] on top\nmeasure pressed = integral(press) on floor\nmeasure friction = integral(mu*press) on floor\n\
             measure held = reaction(u(1)) on top\n"
        );
        let ran = run(&format!("steep-{step}"), &scene, &[]);
        assert_eq!(ran.code, 0, "{}", ran.text);
        let (pressed, friction) = (ran.last("pressed"), ran.last("friction"));
        assert!((friction + ran.last("held")).abs() < 1e-9 * friction, "{}", ran.text);
        assert!((friction / pressed - 0.594).abs() < 0.007, "{step}: {}", friction / pressed);
    }
}

/// The same block with other laws and drives, in one and in sixteen cells, its contact closing in the step in which it is driven
/// first. From above the strength a correction overshoots the rate by hundreds of times, to a slip that turns round within 1e-87:
/// where it turns, and not by halves of a step, is where the next one begins. A slow drive leaves it stuck, sheared by 500 V0 t.
#[test]
fn a_law_that_is_steep_at_rest_is_met_from_above() {
    for (v0, a, press, cells) in [
        (1e-3, 0.003, 1e-2, 1),
        (1e-6, 0.003, 1e-4, 1),
        (1e-3, 0.003, 1e-2, 4),
        (1e-6, 0.01, 1e-2, 4),
        (1e-6, 0.003, 1e-2, 4),
    ] {
        let scene = format!(
            "param V0 = {v0:e}\nparam a = {a}\nmesh box [0,0] to [1,1] cells [{cells},{cells}] quad\n\
             region floor = faces where y == 0\nregion top = faces where y == 1\n\
             unknown u : vector\nterm block on all : 1000*Sym(Grad_u):Grad_Test_u\ndef press = 1e6*pos_part(u.Normal)\n\
             def V = (u(1) - Previous_u(1))/timestep\ndef q = V*timestep/0.1\n\
             def mu = a*asinh(V/(2*V0)*exp((0.6 + 0.008*log(Previous_theta*V0/0.1))/a))\n\
             state theta : scalar on floor := Previous_theta*exp(-q) + timestep*(if abs(q) < 1e-6 then 1 - q/2 else -expm1(-q)/q)\n\
             start theta = 0.1/V0\nterm contact on floor : press*(Test_u.Normal) + mu*press*Test_u(1)\n\
             steps t = 0 to 0.5 by 0.05\nfix u = [V0*t,-{press}] on top\nmeasure friction = integral(mu*press) on floor\n\
             measure slip = mean(abs(u(1))) on floor\nmeasure held = reaction(u(1)) on top\n"
        );
        let ran = run(&format!("steep-above-{v0}-{a}-{press}-{cells}"), &scene, &[]);
        assert_eq!(ran.code, 0, "{v0} {a} {press} {cells}: {}", ran.text);
        let (friction, held) = (ran.last("friction"), ran.last("held"));
        assert!((friction + held).abs() < 1e-6 * friction, "{}", ran.text);
        assert!(ran.last("slip") < 1e-3 * v0, "{}", ran.text);
        // one cell is sheared alike all over, but for what the penalty gives way
        assert!(cells > 1 || (friction / (250.0 * v0) - 1.0).abs() < 1e-3, "{}", ran.text);
    }
}

/// A layer of viscosity `eta` below its strength of 5, whose drive turns back: it slides with its strength, either way.
#[test]
fn a_layer_that_slides_has_its_strength_however_stiff_it_was() {
    for eta in ["1e12", "1e15", "1e16", "1e20"] {
        let scene = format!(
            "param eta = {eta}\nmesh box [0,0] to [1,1] cells [1,1] quad\nregion floor = faces where y == 0\n\
             region top = faces where y == 1\nunknown u : vector\nterm block on all : 1000*Sym(Grad_u):Grad_Test_u\n\
             def q = Ball_projection([eta*(u(1) - Previous_u(1))/timestep,0], 5)\nterm friction on floor : q.Test_u\n\
             steps t = 0 to 1 by 0.05\nfix u = [if t < 0.5 then t else 1 - t, 0] on top\nfix u(2) = 0 on floor\n\
             measure force = integral(q(1)) on floor\nmeasure held = reaction(u(1)) on top\n"
        );
        let ran = run(&format!("layer-{eta}"), &scene, &[]);
        assert_eq!(ran.code, 0, "{eta}: {}", ran.text);
        for step in (1..21).filter(|step| *step != 10) {
            let (force, held) = (ran.measure(step, "force"), ran.measure(step, "held"));
            assert!((force + held).abs() < 1e-6, "{eta}, step {step}: {force} {held}");
        }
        assert!((ran.last("force") + 5.0).abs() < 1e-6, "{eta}: {}", ran.text);
    }
}

/// A penalty beside which the displacement has no digits: whatever is found, it does not go without a word.
#[test]
fn a_penalty_that_leaves_no_digits_is_told() {
    let scene = "mesh box [0,0] to [1,1] cells [2,2] quad\nregion floor = faces where y == 0\nregion top = faces where y == 1\n\
                 unknown u : vector\nterm block on all : 1000*Sym(Grad_u):Grad_Test_u\nparam far = 100\nparam gamma = 1e14\n\
                 term contact on floor : gamma*pos_part(u.Normal - far)*(Test_u.Normal)\n\
                 fix u = [0,-far - 1e-3*t] on top\nsteps t = 0 to 1 by 0.5\nmeasure held = reaction(u(2)) on top\n";
    let ran = run("no-digits", scene, &[]);
    let is_right = ran.code == 0 && (ran.last("held") - 1.0).abs() < 1e-2;
    assert!(is_right || ran.code != 0 || ran.tells("W605") || ran.tells("W606"), "{}", ran.text);
}

/// Heat crosses as contact presses, and nothing else holds the temperature of the block: it is loose in the first iterate
/// alone. In the closed form p = 1 there, h = 2, and 10 units of heat fall by 5 over contact and by 10 a cell length.
#[test]
fn what_is_held_once_contact_presses_is_not_called_loose() {
    let scene = |conducts: &str| {
        format!(
            "mesh box [0,0] to [1,2] cells [2,4] quad\nregion a = cells where y < 1\nregion b = cells where y > 1\n\
             region f = interface from b to a\nregion bottom = faces where y == 0\nregion top = faces where y == 2\n\
             unknown ua : vector on a\nunknown ub : vector on b\nunknown Ta : scalar on a\nunknown Tb : scalar on b\n\
             def jump(v,w) = v - Interpolate(w, neighbor_element)\ndef p = 1e6*pos_part(jump(ub,ua).Normal)\n\
             term ea on a : 1000*Sym(Grad_ua):Grad_Test_ua\nterm eb on b : 1000*Sym(Grad_ub):Grad_Test_ub\n\
             term ha on a : Grad_Ta.Grad_Test_Ta\nterm hb on b : Grad_Tb.Grad_Test_Tb\n\
             term contact on f : p*(Normal.jump(Test_ub,Test_ua))\n\
             term cross on f : {conducts}*jump(Tb,Ta)*jump(Test_Tb,Test_Ta)\nfix ua = [0,0] on bottom\n\
             fix ub = [0,-2.001e-3] on top\nfix Ta = 100 on bottom\nload Tb = -10 on top\nmeasure warm = mean(Tb) on top\n"
        )
    };
    let ran = run("presses-later", &scene("2*p"), &[]);
    assert!(ran.code == 0 && (ran.last("warm") - 75.0).abs() < 1e-6, "{}", ran.text);
    // what never conducts is loose, and told as that
    let ran = run("never-conducts", &scene("0*p"), &[]);
    assert!(ran.code != 0 && ran.tells("E602"), "{}", ran.text);
    let ran = run("conducts-apart", &scene("pos_part(p - 1e3)"), &[]);
    assert!(ran.code != 0 && ran.tells("E602"), "{}", ran.text);
}

/// A slider that sticks: its slip is zero, and what rounding leaves of it has no digits to lose. The position is the play operator
/// of the pull, which needs no program.
#[test]
fn the_slip_of_a_slider_that_sticks_has_no_digits_to_lose() {
    for gamma in ["1e2", "1e4", "1e8"] {
        let scene = format!(
            "mesh box [0] to [1] cells [1] segment with idle_cells=allowed\nparam gamma = {gamma}\nunknown u : scalar global\n\
             unknown s : scalar global\ndef held = Ball_projection([gamma*(u - Previous_s)], 1)(1)\n\
             term mem on global : (s - u + held/gamma)*Test_s\nterm bal on global : (held - (3*sin(t) - u))*Test_u\n\
             steps t = 0 to 10 by 0.05\nmeasure d = max(u) on global\n"
        );
        let ran = run(&format!("play-{gamma}"), &scene, &[]);
        ran.assert_silent();
        // of the play operator: k u = pull -+ F, elastic by F/gamma at most
        assert!((ran.last("d") + 0.632_063_332_7).abs() < 2.5 / gamma.parse::<f64>().unwrap(), "{}", ran.last("d"));
    }
}

/// A force of 40 on a law with a slope of 1e20 where it begins: the first correction is lost beside the position of 1. The closed
/// form is sinh(40)/1e20.
#[test]
fn a_correction_that_is_lost_beside_the_position_is_not_the_end() {
    let scene = "mesh box [0] to [1] cells [1] segment with idle_cells=allowed\nunknown u : scalar global\nstart u = 1\n\
                 term law on global : (asinh(1e20*(u - 1)) - 40)*Test_u\nmeasure d = max(u - 1) on global\n";
    let ran = run("lost", scene, &[]);
    assert_eq!(ran.code, 0, "{}", ran.text);
    assert!((ran.last("d") / (40f64.sinh() / 1e20) - 1.0).abs() < 1e-9, "{}", ran.text);
}

/// Coulomb's friction of 0.3 regularised within 1e-16, narrower than numbers are apart at a position of 10: it slides with what the
/// pull of 0.6 leaves, 8 times 0.3, and while it sticks, which no number solves, that is told.
#[test]
fn friction_narrower_than_numbers_slides_and_is_told_while_it_sticks() {
    for law in ["tanh(v/1e-16)", "v/sqrt(v^2 + 1e-32)", "2/pi*atan(v/1e-16)"] {
        let scene = format!(
            "mesh box [0] to [1] cells [1] segment with idle_cells=allowed\nunknown u : scalar global\nstart u = 10\ndef v = Dot_u\n\
             term law on global : (0.3*{law} + v - (if t > 2.5 then 0.6 else 0.15))*Test_u\nsteps t = 0 to 10 by 1\n\
             measure d = max(u - 10) on global\n"
        );
        let ran = run("narrow", &scene, &[]);
        assert_eq!(ran.code, 0, "{law}: {}", ran.text);
        assert!((ran.last("d") - 2.4).abs() < 1e-9, "{law}: {}", ran.text);
        assert!(ran.tells("W605"), "{law}: {}", ran.text);
    }
}
