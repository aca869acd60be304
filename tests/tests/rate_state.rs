//! Rate-and-state friction written the direct way: the regularised law in the slip rate and the state themselves, from any
//! start. The answers are found by bisection here.

use wfl_tests::{Solved, attempt, examples, reference};

/// The parameters of a law, units MPa, m, s.
#[derive(Clone, Copy)]
struct Law {
    sigma: f64,
    a: f64,
    b: f64,
    dc: f64,
    f0: f64,
    v0: f64,
    eta: f64,
}

const LAW: Law = Law { sigma: 50.0, a: 0.015, b: 0.01, dc: 0.008, f0: 0.6, v0: 1e-6, eta: 4.6 };

impl Law {
    /// Friction and radiation damping. The logarithm of the argument of `asinh`, so that nothing overflows.
    fn traction(&self, v: f64, theta: f64) -> f64 {
        let log = (0.5 * v / self.v0).ln() + (self.f0 + self.b * (self.v0 * theta / self.dc).ln()) / self.a;
        let asinh = if log > 30.0 { log + 2f64.ln() } else { log.exp().asinh() };
        self.sigma * self.a * asinh + self.eta * v
    }

    /// As text of a scene, in a rate and a state.
    fn text(&self, rate: &str) -> String {
        let Law { sigma, a, b, dc, f0, v0, eta } = self;
        format!(
            "param sigma = {sigma}\nparam a = {a}\nparam b = {b}\nparam Dc = {dc}\nparam f0 = {f0}\nparam V0 = {v0:e}\n\
             param eta = {eta}\n\
             def friction = sigma*a*asinh({rate}/(2*V0)*exp((f0 + b*log(V0*theta/Dc))/a))\n"
        )
    }
}

/// Where a function that grows from below zero to above is zero, by bisection of the logarithm.
fn root(f: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (-690.0f64, 690.0f64);
    assert!(f(low.exp()) < 0.0 && f(high.exp()) > 0.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if f(middle.exp()) < 0.0 { low = middle } else { high = middle }
    }
    low.exp()
}

fn run(text: String) -> Solved {
    let made = attempt(&examples(), text, &[], &[]);
    made.solved.unwrap_or_else(|| panic!("{}", made.messages))
}

/// The last step is solved, and its residual told relative to what cancels. How many iterations it took.
fn assert_solved(solved: &Solved, what: &str) -> usize {
    let step = solved.outcome.steps.last().expect("a step");
    let last = step.history.iterations.last().expect("it was measured");
    assert!(step.history.converged(), "{what}: residual {:e}", last.residual);
    let told = (last.residual, last.floor);
    assert!(last.residual <= 1e-10 || last.residual <= last.floor.min(1e-6), "{what}: residual, floor {told:?}");
    assert_eq!(step.attempts.len(), 1, "{what}");
    step.history.n_iterations()
}

fn last(solved: &Solved, name: &str) -> f64 {
    solved.measure(solved.outcome.steps.len() - 1, name)
}

const HEAD: &str = "mesh box [0] to [1] cells [1] segment with idle_cells=allowed\n";

/// One step of a point with a rate V and a state theta that balances a traction, text of a scene; `more` are statements.
fn point(law: &Law, start: &str, [theta0, h]: [f64; 2], traction: &str, more: &str) -> Solved {
    run(format!(
        "{HEAD}unknown V : scalar global\nunknown theta : scalar global\n{}{more}\
         term balance on global : (friction + eta*V - {traction})*Test_V\n\
         term memory on global : (Dot_theta - 1 + V*theta/Dc)*Test_theta\n\
         start V = {start}\nstart theta = {theta0}\nsteps t = 0 to {h} by {h}\n\
         measure rate = max(V) on global\nmeasure age = max(theta) on global\n",
        law.text("V")
    ))
}

fn assert_rate(solved: &Solved, start: &str, exact: f64) {
    assert_solved(solved, start);
    let rate = last(solved, "rate");
    assert!((rate / exact - 1.0).abs() < 1e-8, "start {start}: {rate:e}, exact {exact:e}");
}

/// Rates from zero to beyond any earthquake.
const STARTS: [&str; 10] = ["0", "1e-300", "1e-20", "1e-15", "1e-12", "1e-9", "1e-6", "1e-3", "1", "1e3"];

/// One step of backward Euler under a given traction: V and theta are unknowns, no logarithm is.
#[test]
fn the_rate_under_a_given_traction_is_found_from_any_start() {
    let theta0 = 8e6;
    for (tau, h) in [(20.0, 1e5), (30.0, 1e5), (30.0, 10.0), (35.0, 1e-2), (45.0, 1e5)] {
        let law = LAW;
        let theta = |v: f64| (theta0 + h) / (1.0 + h * v / law.dc);
        let exact = root(|v| law.traction(v, theta(v)) - tau);
        for start in STARTS {
            let what = format!("traction {tau}, step {h}, start {start}");
            let solved = point(&law, start, [theta0, h], &tau.to_string(), "");
            let count = assert_solved(&solved, &what);
            let (rate, age) = (last(&solved, "rate"), last(&solved, "age"));
            assert!((rate / exact - 1.0).abs() < 1e-8, "{what}: {rate:e}, exact {exact:e}");
            assert!((age / theta(exact) - 1.0).abs() < 1e-8, "{what}: {age:e}");
            assert!(count <= 100, "{what}: {count} iterations");
        }
    }
}

/// Exponents beyond the range of numbers: exp(f0/a) is 1e521 with a = 5e-4.
#[test]
fn a_law_whose_exponential_overflows_is_solved() {
    let law = Law { a: 5e-4, b: 4e-4, ..LAW };
    let (tau, theta0, h) = (30.2, 8e6, 1.0);
    let theta = |v: f64| (theta0 + h) / (1.0 + h * v / law.dc);
    let exact = root(|v| law.traction(v, theta(v)) - tau);
    for start in ["1e-9", "1e-6", "1e-12"] {
        let solved = point(&law, start, [theta0, h], &tau.to_string(), "");
        assert_rate(&solved, start, exact);
    }
}

/// A slider pulled by a spring: slip, rate and state are unknowns.
#[test]
fn a_slider_on_a_spring_moves_from_rest() {
    let (law, k, load, h, theta0) = (Law { b: 0.02, ..LAW }, 100.0, 0.31, 1e3, 1e6);
    let theta = |v: f64| (theta0 + h) / (1.0 + h * v / law.dc);
    let exact = root(|v| law.traction(v, theta(v)) - k * (load - h * v));
    for start in STARTS {
        let spring = "unknown u : scalar global
term rate on global : (Dot_u - V)*Test_u
";
        let solved = point(&law, start, [theta0, h], &format!("{k}*({load} - u)"), spring);
        assert_rate(&solved, start, exact);
    }
}

/// Two blocks in antiplane shear, the rate of the jump of displacement in the law: at rest the slope of the law leaves no
/// digit of the stiffness of the blocks.
#[test]
fn a_law_in_the_rate_of_the_jump_on_a_fault_starts_at_rest() {
    let (law, mu, width, theta) = (LAW, 3e4, 1e3, 8e6);
    for (load, h) in [(2.2, 1e7), (2.2, 1e3), (1.9, 1e6), (1.6, 1e7), (1.0, 1e7)] {
        let exact = root(|v| law.traction(v, theta) - law.eta * v - mu * (load - h * v) / (2.0 * width));
        let solved = run(format!(
            "mesh box [-{width},0] to [{width},{width}] cells [4,2] quad\n\
             region left = cells where x < 0\nregion right = cells where x > 0\n\
             region fault = interface from left to right\n\
             region west = faces where x == -{width}\nregion east = faces where x == {width}\n\
             unknown l : scalar on left\nunknown r : scalar on right\n\
             param theta = {theta}\n{}\
             def V = Interpolate(Dot_r, neighbor_element) - Dot_l\n\
             term elastic_l on left : {mu}*Grad_l.Grad_Test_l\nterm elastic_r on right : {mu}*Grad_r.Grad_Test_r\n\
             term law on fault : friction*(Interpolate(Test_r, neighbor_element) - Test_l)\n\
             fix l = 0 on west\nfix r = {load}*t/{h} on east\nsteps t = 0 to {h} by {h}\n\
             measure slip = mean(Interpolate(r, neighbor_element) - l) on fault\n",
            law.text("V").replace("param eta = 4.6\n", "")
        ));
        let what = format!("load {load}, step {h}");
        assert_solved(&solved, &what);
        let slip = last(&solved, "slip");
        // the slip is a difference of displacements, known to roundoff of these
        let tolerance = 1e-8 * exact * h + 1e-14 * load;
        assert!((slip - exact * h).abs() < tolerance, "{what}: {slip:e}, exact {:e}", exact * h);
    }
}

/// The logarithm of the rate as unknown: one term has the whole balance, which was "residual 1.0, floor" once.
#[test]
fn a_law_in_the_logarithm_of_the_rate_tells_its_residual() {
    let (law, tau) = (LAW, 30.0);
    let theta = law.dc / law.v0;
    let exact = root(|v| law.traction(v, theta) - tau);
    let solved = run(format!(
        "{HEAD}unknown w : scalar global\nparam theta = {theta}\n{}\
         term balance on global : (friction + eta*V0*exp(w) - {tau})*Test_w\n\
         start w = -10\nsteps t = 1 to 1 by 1\nmeasure found = max(w) on global\n",
        law.text("V0*exp(w)")
    ));
    assert_solved(&solved, "log rate");
    let rate = law.v0 * last(&solved, "found").exp();
    assert!((rate / exact - 1.0).abs() < 1e-9, "{rate:e}, exact {exact:e}");
}

/// The numbers that the scene of the earthquake cycles expects are those of the reference.
#[test]
fn the_cycles_are_compared_with_the_published_numbers() {
    let scene = std::fs::read_to_string(examples().join("friction/bp1.wfl")).expect("an example");
    let published = &reference("seas_bp1.json")["bp1_qd"];
    let number = |of: &str, name: &str| published[of][name].as_f64().expect("a number");
    for expected in [
        format!("given_stress = {} [MPa]", number("description", "tau0_MPa")),
        format!("/log(10) - {}) < 1e-5", number("description", "log10_theta0_surface")),
        format!("abs(quake_first/({}*yr) - 1) < 0.05", number("series", "first_event_yr")),
    ] {
        assert!(scene.contains(&expected), "{expected}");
    }
}
