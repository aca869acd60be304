//! Steps that the run chooses follow the solution, and not what a tolerance or rounding leave of it.

use super::run;

/// A block that sticks to a floor until its shear reaches the bound, and slides then; its slip is known in closed form. The slip
/// begins from zero, beside which whatever Newton's method leaves is large.
#[test]
fn slip_that_begins_from_zero_takes_few_steps() {
    for error in ["1e-3", "1e-4", "1e-6"] {
        let scene = format!(
            "mesh box [0,0] to [1,1] cells [1,1] quad\nparam E = 1000\nparam gamma = 1e6\nparam fric = 0.3\n\
             region floor = faces where y == 0\nregion top = faces where y == 1\nunknown u : vector\n\
             term block on all : E*Grad_u:Grad_Test_u\ndef tang(w) = w - (w.Normal)*Normal\n\
             def press = gamma*pos_part(u.Normal)\ndef q = Ball_projection(gamma*(tang(u) - Previous_slid), fric*press)\n\
             state slid : vector on floor := tang(u) - q/gamma\nterm contact on floor : (press*Normal + q).Test_u\n\
             steps t = 0 to 1 by auto with first=1e-3, error={error}\nfix u = [0.008*t,-5e-3] on top\n\
             measure slip = mean(slid(1)) on floor\nmeasure pressed = integral(press) on floor\n"
        );
        let ran = run(&format!("auto-slip-{error}"), &scene, &[]);
        assert!(ran.code == 0 && !ran.tells("W606"), "{}", ran.text);
        // the spring of the block and that of the penalty in a row
        let expected = 0.008 - 0.3 * ran.last("pressed") * (1.0 / 1000.0 + 1e-6);
        assert!((ran.last("slip") / expected - 1.0).abs() < 1e-5, "{} {expected}", ran.last("slip"));
        assert!(ran.steps() < 300, "{error}: {} steps", ran.steps());
    }
}

/// The same block with a floor that wears by the work of friction, under a given load.
#[test]
fn wear_that_begins_from_zero_takes_few_steps() {
    for error in ["1e-3", "1e-5"] {
        let scene = format!(
            "mesh box [0,0] to [1,1] cells [1,1] quad\nparam E = 1000\nparam gamma = 2e4\nparam N = 5\n\
             region floor = faces where y == 0\nregion top = faces where y == 1\nunknown u : vector\n\
             term block on all : E*Grad_u:Grad_Test_u\ndef tang(w) = w - (w.Normal)*Normal\n\
             def press = gamma*pos_part(u.Normal - Previous_depth)\n\
             def q = Ball_projection(gamma*(tang(u) - Previous_slid), 0.3*press)\n\
             state slid : vector on floor := tang(u) - q/gamma\n\
             state depth : scalar on floor := Previous_depth + 1e-2*press*Norm(tang(u) - q/gamma - Previous_slid)\n\
             term contact on floor : (press*Normal + q).Test_u\nsteps t = 0 to 1 by auto with first=1e-3, error={error}\n\
             fix u(1) = 2e-2*t on top\nload u = [0,-N] on top\nmeasure worn = mean(depth) on floor\n\
             measure way = mean(slid(1)) on floor\n"
        );
        let ran = run(&format!("auto-wear-{error}"), &scene, &[]);
        // the spring of the block and of the penalty in a row, stretched by the friction of 1.5
        let way = 2e-2 - 1.5 * (1.0 / 1000.0 + 1.0 / 2e4);
        assert!(ran.code == 0 && (ran.last("way") / way - 1.0).abs() < 1e-6, "{} {way}", ran.last("way"));
        assert!((ran.last("worn") / (1e-2 * 5.0 * way) - 1.0).abs() < 1e-6, "{}", ran.last("worn"));
        assert!(ran.steps() < 300, "{error}: {} steps", ran.steps());
    }
}

/// A fault with rate-and-state friction, its slip an unknown that a stiff spring ties to the rock, which begins 10 away from the
/// origin: what cancels in the tie is no uncertainty of the steps, whatever its stiffness. Against the same at the origin.
#[test]
fn a_stiff_tie_far_from_the_origin_excuses_no_error_of_steps() {
    let rate = |stiffer: &str, origin: &str| {
        let scene = format!(
            "param k = 15.625\nparam far = {origin}\nmesh box [0] to [1000] cells [4] segment\nregion fault = faces where x == 0\n\
             region rim = faces where x == 1000\nunknown u : scalar\nunknown s : scalar on fault\nunknown w : scalar on fault\n\
             unknown psi : scalar on fault\nstart u = far\nstart s = far\nstart w = log(1e-3)\nstart psi = -0.5 - log(1e-3)\n\
             def friction = 0.5*asinh(0.5*exp(w + (0.6 + 0.015*psi)/0.01))\n\
             def steady = 0.5*asinh(0.5e-3*exp((0.6 - 0.015*log(1e-3))/0.01)) + 4.6244e-9\n\
             term rock on all : 1000*k*Grad_u.Grad_Test_u\nterm tie on fault : {stiffer}*k*(u - s)*(Test_u - Test_s)\n\
             term balance on fault : (friction + 4.6244e-6*exp(w) - steady)*Test_s\n\
             term slips on fault : (Dot_s - 1e-6*exp(w))*Test_w\n\
             term ages on fault : (Dot_psi - (exp(-psi) - exp(w))*1.25e-4)*Test_psi\nfix u = 1e-9*t + far on rim\n\
             steps t = 0 to 1e8 by auto with first=1e3, error=1e-5\nmeasure rate = max(w) on fault\n"
        );
        let ran = run(&format!("auto-tie-{stiffer}-{origin}"), &scene, &[]);
        assert_eq!(ran.code, 0, "{}", ran.text);
        ran.last("rate")
    };
    let right = rate("1e4", "0");
    for (stiffer, origin) in [("1e6", "10"), ("1e7", "10"), ("1e8", "100")] {
        let found = rate(stiffer, origin);
        assert!((found - right).abs() < 5e-3, "{stiffer} {origin}: {found} for {right}");
    }
}

/// Scenes in `T - c` and `u - c` alone, with the measures that a constant must not change: linear and nonlinear conduction, a cooling that is the
/// same everywhere, creep that is written with its last strain, a plate that a temperature bends, a bounce.
const SHIFTED: [(&str, &str); 6] = [
    (
        "linear",
        "mesh box [0] to [1] cells [10] segment\nregion left = faces where x == 0\nunknown T : scalar P2\n\
         term storage on all : Dot_T*Test_T\nterm conduction on all : Grad_T.Grad_Test_T\nstart T = c\nfix T = c + 1 on left\n\
         steps t = 0 to 0.5 by auto with first=1e-4\nmeasure m = value(T - c) at [0.5]\n",
    ),
    (
        "nonlinear",
        "mesh box [0] to [1] cells [10] segment\nregion left = faces where x == 0\nregion right = faces where x == 1\n\
         unknown T : scalar P2\nterm storage on all : Dot_T*Test_T\n\
         term conduction on all : (0.1 + (T - c)^2)*Grad_T.Grad_Test_T\nterm loss on right : 0.3*(T - c)^4*Test_T\n\
         start T = c + 0.5*x\nfix T = c + 1 + 0.2*sin(10*t) on left\nsteps t = 0 to 2 by auto with first=1e-4\n\
         measure m = value(T - c) at [0.5]\n",
    ),
    (
        "uniform",
        "mesh box [0] to [1] cells [1] segment\nunknown T : scalar\nterm balance on all : (Dot_T + (T - c))*Test_T\n\
         start T = c + 1\nsteps t = 0 to 2 by auto with first=1e-4\nmeasure m = value(T - c) at [0.5]\n",
    ),
    (
        "creep",
        "mesh box [0] to [1] cells [2]\nregion a = faces where x == 0\nregion b = faces where x == 1\nunknown u : scalar\n\
         def sig = 1e5*(Grad_u(1) - Previous_ec)\n\
         state ec : scalar on all := Previous_ec + timestep*1e-12*abs(sig)^3*sig\nterm el on all : sig*Grad_Test_u(1)\n\
         start u = c\nfix u = c on a\nload u = 100 on b\nsteps t = 0 to 100 by auto with error=1e-4\n\
         measure m = max(u - c) at nodes of all\n",
    ),
    (
        "plate",
        "mesh box [0,0] to [1,1] cells [4,4] quad\nregion left = faces where x == 0\nunknown T : scalar\nunknown u : vector\n\
         term storage on all : Dot_T*Test_T\nterm conduction on all : Grad_T.Grad_Test_T\n\
         term el on all : (2*Sym(Grad_u) - (T - c)*Id(2)):Grad_Test_u\nstart T = c\nstart u = [c, 2*c]\nfix T = c + 1 on left\n\
         fix u = [c, 2*c] on left\nsteps t = 0 to 0.5 by auto with first=1e-4\nmeasure m = value(u(1) - c) at [1, 0.5]\n",
    ),
    (
        "bounce",
        "mesh box [0] to [1] cells [8] segment\nregion wall = faces where x == 0\nunknown u : scalar\nstart u = c + 0.1\n\
         start Dot_u = -1\nterm inertia on all : Dot2_u*Test_u\nterm stress on all : 100*Grad_u.Grad_Test_u\n\
         term contact on wall : -1e4*neg_part(u - c)*Test_u\nscheme newmark\nsteps t = 0 to 0.5 by auto with error=1e-4\n\
         measure m = mean(Dot_u) on all\n",
    ),
];

/// What varies is as exact beside 293, 1e4 and 1e6 as beside nothing, in as many steps: errors were relative to the largest value, and 4 % and
/// more of what varies. Where the rounding of the values is more than the demanded error, that is told.
#[test]
fn a_constant_that_is_added_changes_no_step() {
    for (name, scene) in SHIFTED {
        let ran = |c: &str| run(&format!("auto-shift-{name}-{c}"), &format!("param c = {c}\n{scene}"), &[]);
        let right = ran("0");
        right.assert_silent();
        for (c, rounding) in [("293", 1e-7), ("1e4", 1e-7), ("1e6", 1e-6)] {
            let found = ran(c);
            found.assert_silent();
            let differs = (found.last("m") / right.last("m") - 1.0).abs();
            // where contact begins and ends is decided by rounding there, in steps of the demanded error each
            let (most, steps) = if name == "bounce" { (1e-3, 0.1) } else { (rounding, 0.0) };
            assert!(differs < most, "{name} {c}: {} for {}", found.last("m"), right.last("m"));
            #[expect(clippy::cast_precision_loss, reason = "some hundred steps")]
            let more = (found.steps() as f64 / right.steps() as f64 - 1.0).abs();
            assert!(more <= steps, "{name} {c}: {} steps for {}", found.steps(), right.steps());
        }
        let hidden = ran("1e12");
        assert!(hidden.tells("W618"), "{name}: {}", hidden.text);
    }
}

/// A body at rest is nothing but rounding in its motion, and a field that stays as it is in the whole run nothing but rounding: neither is told.
#[test]
fn what_does_not_change_is_no_error_and_not_told() {
    let rest = "mesh box [0] to [1] cells [10]\nregion foot = faces where x == 0\nunknown u : scalar\n\
                term inertia on all : Dot2_u*Test_u\nterm stress on all : 1e4*Grad_u.Grad_Test_u\n\
                term floor on foot : -1e6*pos_part(-u)*Test_u\nterm weight on all : 10*Test_u\n\
                start u = -10/1e6 - 10*(x - x^2/2)/1e4\nscheme generalised_alpha rho_inf=0.8\nsteps t = 0 to 2 by auto\n";
    let still = "mesh box [0,0] to [1,1] cells [4,4] tri\nregion left = faces where x == 0\nregion right = faces where x == 1\n\
                 unknown T : scalar P2\nunknown v : scalar P2\nterm storage on all : Dot_T*Test_T\n\
                 term conduction on all : (1 + (T/293)^2)*Grad_T.Grad_Test_T\nterm exchange on right : 3*(T - 293)*Test_T\n\
                 term stored on all : Dot_v*Test_v\nterm flow on all : (1 + v^2)*Grad_v.Grad_Test_v - 100*t*(1 - x)*Test_v\n\
                 start T = 293\nfix T = 293 on left\nfix v = 0 on left\nsteps t = 0 to 2 by auto with first=1e-3\n";
    for (name, scene) in [("rest", rest), ("still", still)] {
        let ran = run(&format!("auto-{name}"), scene, &[]);
        ran.assert_silent();
        assert!(ran.steps() < 120, "{name}: {} steps", ran.steps());
    }
}

/// A bar that vibrates in uniform flight is as exact as one that stays: it was 140 % off at a hundred times its speed, in a sixth of the steps.
#[test]
fn a_bar_vibrates_in_flight_as_at_rest() {
    for scheme in ["bdf2", "newmark", "generalised_alpha rho_inf=0.8"] {
        let ran = |speed: &str| {
            let scene = format!(
                "param V = {speed}\nmesh box [0] to [1] cells [8] segment\nunknown u : scalar P2\nstart u = 0.1*cos(pi*x)\n\
                 start Dot_u = V\nterm inertia on all : Dot2_u*Test_u\nterm stress on all : Grad_u.Grad_Test_u\nscheme {scheme}\n\
                 steps t = 0 to 4 by auto\nmeasure d = value(u - V*t) at [1]\n"
            );
            run(&format!("auto-flight-{}-{speed}", scheme.replace([' ', '='], "-")), &scene, &[])
        };
        let right = ran("0").last("d");
        for speed in ["1", "100", "1e4", "1e6"] {
            let found = ran(speed);
            found.assert_silent();
            assert!((found.last("d") / right - 1.0).abs() < 1e-3, "{scheme} {speed}: {} for {right}", found.last("d"));
        }
        // there the speed is rounded to 1e-7
        assert!((ran("1e9").last("d") / right - 1.0).abs() < 0.03, "{scheme}");
    }
}

/// Two masses in flight of which one hits the other: beside a flight that is a hundred times as fast the demanded error of it is 10 % of the
/// impact, which is told.
#[test]
fn an_impact_in_fast_flight_is_told() {
    for (speed, told) in [("0", false), ("1", false), ("100", true), ("1e6", true)] {
        let scene = format!(
            "param V = {speed}\nmesh box [0] to [1] cells [1] segment with idle_cells=allowed\nunknown a : scalar global\n\
             unknown b : scalar global\nstart b = 0.1\nstart Dot_a = V + 1\nstart Dot_b = V\ndef p = 1e4*pos_part(a - b)\n\
             term inertia_a on global : Dot2_a*Test_a\nterm inertia_b on global : Dot2_b*Test_b\n\
             term contact on global : p*(Test_a - Test_b)\nsteps t = 0 to 1 by auto\nmeasure v = value(Dot_b - V) at [0]\n"
        );
        let ran = run(&format!("auto-impact-{speed}"), &scene, &[]);
        assert!(ran.code == 0 && ran.tells("W618") == told, "{speed}: {}", ran.text);
        assert!(told || (ran.last("v") - 1.0).abs() < 1e-2, "{speed}: {}", ran.last("v"));
    }
}

/// Heat in a bar that drifts everywhere by V t, with an end that goes up and down beside it: of the demanded error, which is one of the
/// drift, a step may miss more than all that happens beside. What drifts and does nothing else is right.
#[test]
fn what_happens_beside_a_fast_drift_is_told() {
    let ran = |speed: &str, beside: &str| {
        let scene = format!(
            "param V = {speed}\nmesh box [0] to [1] cells [10] segment\nregion left = faces where x == 0\n\
             region right = faces where x == 1\nunknown T : scalar\nterm stored on all : Dot_T*Test_T\n\
             term flow on all : 0.3*Grad_T.Grad_Test_T\nload T = V on all\nfix T = V*t + {beside} on left\nfix T = V*t on right\n\
             steps t = 0 to 1 by auto\nmeasure m = value(T - V*t) at [0.2]\n"
        );
        run(&format!("auto-drift-{speed}-{}", beside.len()), &scene, &[])
    };
    let right = ran("0", "sin(10*t)").last("m");
    for speed in ["0", "1", "1e4", "1e8"] {
        let found = ran(speed, "sin(10*t)");
        assert_eq!(found.code, 0, "{}", found.text);
        assert!(
            found.tells("W618") || (found.last("m") / right - 1.0).abs() < 5e-3,
            "{speed}: {} for {right}",
            found.last("m")
        );
        assert!(!found.tells("W618") || speed.len() > 1, "{speed}: {}", found.text);
        ran(speed, "0*t").assert_silent();
    }
}
