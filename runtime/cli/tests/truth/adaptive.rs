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
