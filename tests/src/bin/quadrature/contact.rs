//! Rules of contact on gaps with known pressures, over the parameter: what is wrong of the pressure and of the force.
//!
//! The errors are those of the pressure as a measure reads it at the points of the rule (relative, root of the mean square)
//! and of its integral.

use std::{fmt::Write as _, path::Path};

use wfl_tests::{Solved, solve};

/// Young's modulus and Poisson's ratio of all blocks.
const YOUNG: f64 = 10.0;
const POISSON: f64 = 0.3;
/// Parameters in units of Young's modulus over the size of the faces.
const GAMMAS: [f64; 8] = [0.1, 1.0, 2.0, 10.0, 20.0, 1e2, 1e3, 1e4];

/// What the block is pressed on.
#[derive(Clone, Copy, PartialEq)]
enum Gap {
    /// A rigid parabola: a zone of contact that ends inside faces. The pressure is that of Hertz for the force found.
    Hertz,
    /// Waves that are closed everywhere: a cosine upon a mean.
    Wave,
    /// A plane: a constant.
    Plane,
}

struct Case {
    gap: Gap,
    /// Shape of the cells, and whether they fill space.
    shape: &'static str,
    degree: usize,
    /// Cells a side.
    cells: usize,
}

const fn case(gap: Gap, shape: &'static str, degree: usize, cells: usize) -> Case {
    Case { gap, shape, degree, cells }
}

const CASES: &[Case] = &[
    case(Gap::Hertz, "quad", 1, 20),
    case(Gap::Hertz, "quad", 2, 10),
    case(Gap::Hertz, "tri", 1, 20),
    case(Gap::Hertz, "tri", 2, 10),
    case(Gap::Wave, "quad", 1, 16),
    case(Gap::Wave, "quad", 2, 8),
    case(Gap::Wave, "tri", 1, 16),
    case(Gap::Wave, "tri", 2, 8),
    case(Gap::Plane, "quad", 1, 8),
    case(Gap::Plane, "quad", 2, 4),
    case(Gap::Plane, "tri", 1, 8),
    case(Gap::Plane, "tri", 2, 4),
    case(Gap::Hertz, "hex", 1, 8),
    case(Gap::Hertz, "hex", 2, 5),
    case(Gap::Hertz, "tet", 1, 8),
    case(Gap::Hertz, "tet", 2, 5),
    case(Gap::Wave, "hex", 1, 8),
    case(Gap::Wave, "hex", 2, 4),
    case(Gap::Wave, "tet", 1, 8),
    case(Gap::Wave, "tet", 2, 4),
    case(Gap::Plane, "hex", 1, 6),
    case(Gap::Plane, "hex", 2, 3),
    case(Gap::Plane, "tet", 1, 6),
    case(Gap::Plane, "tet", 2, 3),
];

/// Relative errors of pressure and force.
struct Errors {
    pressure: f64,
    force: f64,
}

impl Case {
    fn dim(&self) -> usize {
        if matches!(self.shape, "tet" | "hex") { 3 } else { 2 }
    }

    fn element(&self) -> String {
        format!("{}{}", if matches!(self.shape, "tri" | "tet") { "P" } else { "Q" }, self.degree)
    }

    /// Penalty, and the variants of Nitsche's method: in space, and on a plane, one of them.
    fn methods(&self) -> &'static [Option<i32>] {
        let few = self.dim() == 3 || self.gap == Gap::Plane;
        if few { &[None, Some(0)] } else { &[None, Some(-1), Some(0), Some(1)] }
    }

    /// One point a node, and the rule of the degree of the term and 2 more.
    fn rules(&self) -> [&'static str; 2] {
        ["", if self.degree == 1 { "degree 4" } else { "degree 6" }]
    }

    fn method(&self, theta: Option<i32>) -> String {
        let up = self.dim();
        match theta {
            None => format!("def press = gamma*pos_part(u({up}) - gap)\nterm contact on top : press*Test_u({up})\n"),
            Some(theta) => format!(
                "def press = pos_part(gamma*(u({up}) - gap) - s(u))\n\
                 term linear on top : -({theta})/gamma*s(u)*s(Test_u)\n\
                 term contact on top : 1/gamma*press*(gamma*Test_u({up}) - ({theta})*s(Test_u))\n"
            ),
        }
    }

    /// Mesh, boundary conditions, and the size of the faces.
    fn block(&self, cells: usize) -> (String, f64) {
        let (n, shape, dim) = (cells, self.shape, self.dim());
        #[expect(clippy::cast_precision_loss, reason = "few cells")]
        let size = |first: f64| first / n as f64;
        let (mesh, h) = match (self.gap, dim) {
            (Gap::Hertz, 2) => (
                format!(
                    "mesh box [0,-1] to [1,1] cells [{n},{}] {shape} map [0.1*x+0.9*x^3, 1-0.1*(1-y)-0.9*(1-y)^2/2]\n",
                    2 * n
                ),
                size(0.1),
            ),
            (Gap::Hertz, _) => (
                format!(
                    "mesh box [0,0,-1] to [1,1,0] cells [{n},{n},{n}] {shape} map \
                     [0.1*x+0.9*x^3, 0.1*y+0.9*y^3, 0.1*z+0.9*z^3]\n"
                ),
                size(0.1),
            ),
            (_, 2) => (
                format!("mesh box [0,-2] to [0.5,0] cells [{n},{}] {shape} map [x, 0.2*y^3+0.2*y]\n", 2 * n),
                size(0.5),
            ),
            _ => (
                format!(
                    "mesh box [0,0,-2] to [0.5,0.5,0] cells [{n},{n},{}] {shape} map \
                     [x + 0.06*sin(2*pi*x)*sin(2*pi*y), y + 0.06*sin(2*pi*y)*cos(2*pi*x), 0.2*z^3+0.2*z]\n",
                    2 * n
                ),
                size(0.5),
            ),
        };
        let far = if self.gap == Gap::Hertz { "x == 0" } else { "x == 0 or x == 0.5" };
        let (up, top) = (["y", "z"][dim - 2], if self.gap == Gap::Hertz && dim == 2 { 1 } else { 0 });
        let bottom = if self.gap == Gap::Hertz { -1 } else { -2 };
        let zero = if dim == 3 { "[0,0,0]" } else { "[0,0]" };
        let mut text = format!(
            "{mesh}region top = faces where {up} == {top}\nregion bottom = faces where {up} == {bottom}\n\
             region across = faces where {far}\nunknown u : vector {}\nfix u = {zero} on bottom\nfix u(1) = 0 on across\n",
            self.element()
        );
        if dim == 3 {
            text += &format!("region beside = faces where {}\nfix u(2) = 0 on beside\n", far.replace('x', "y"));
        }
        (text, h)
    }

    /// The gap, and the pressure that belongs to it; for Hertz' that of a force.
    fn gap(&self, force: f64) -> (String, String) {
        let (dim, plane) = (self.dim(), YOUNG / (1.0 - POISSON * POISSON));
        let pi = std::f64::consts::PI;
        if self.gap == Gap::Hertz {
            let radius = 0.5;
            let r2 = if dim == 3 { "x^2 + y^2" } else { "x^2" };
            // half of the cylinder, a quarter of the sphere
            let (peak, half) = if dim == 2 {
                let line = 2.0 * force;
                ((line * plane / (pi * radius)).sqrt(), (4.0 * line * radius / (pi * plane)).sqrt())
            } else {
                let all = 4.0 * force;
                let peak = (6.0 * all * plane * plane / (pi.powi(3) * radius * radius)).cbrt();
                (peak, (0.75 * all * radius / plane).cbrt())
            };
            let exact = format!("{peak:e}*sqrt(max(1 - ({r2})/{half:e}^2, 0))");
            let depth = if dim == 3 { 0.05 } else { 0.02 };
            return (format!("-{depth} + ({r2})/(2*{radius})"), exact);
        }
        let confined = YOUNG * (1.0 - POISSON) / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON));
        #[expect(clippy::cast_precision_loss, reason = "2 or 3")]
        let number = 2.0 * pi * ((dim - 1) as f64).sqrt();
        let depth = 0.01;
        let wave = plane * number * depth / 2.0;
        let (mean, shape) = (1.5 * wave, if dim == 3 { "cos(2*pi*x)*cos(2*pi*y)" } else { "cos(2*pi*x)" });
        let flat = 2.0 * mean / confined;
        if self.gap == Gap::Plane {
            return (format!("-{flat:e}"), format!("{mean:e}"));
        }
        (format!("-{flat:e} - {depth}*{shape}"), format!("{mean:e} + {wave:e}*{shape}"))
    }

    fn solved(&self, cells: usize, theta: Option<i32>, gamma: f64, rule: &str, force: f64) -> Result<Solved, String> {
        let ((block, h), (gap, exact)) = (self.block(cells), self.gap(force));
        let rule = if rule.is_empty() { String::new() } else { format!("quadrature on top {rule}\n") };
        let text = format!(
            "{block}def lambda = {YOUNG}*{POISSON}/((1+{POISSON})*(1-2*{POISSON}))\ndef mu = {YOUNG}/(2*(1+{POISSON}))\n\
             def sigma(v) = lambda*Div_v*Id({dim}) + 2*mu*Sym(Grad_v)\ndef s(v) = (sigma(v)*Normal).Normal\n\
             def gap = {gap}\ndef exact = {exact}\nparam gamma = {:e}\n{}term elastic on all : sigma(u):Grad_Test_u\n{rule}\
             measure force = integral(press) on top\nmeasure known = integral(exact) on top\n\
             measure wrong = integral((press - exact)^2) on top\nmeasure size = integral(exact^2) on top\n",
            gamma * YOUNG / h,
            self.method(theta),
            dim = self.dim()
        );
        let solved = solve(Path::new("."), text, &[], &[])?;
        if solved.outcome.converged() { Ok(solved) } else { Err("a step did not converge".to_owned()) }
    }

    /// The force of a finer mesh, or the exact one.
    fn reference(&self) -> Result<f64, String> {
        if self.gap == Gap::Hertz {
            let fine = 3 * self.cells / 2;
            return Ok(self.solved(fine, None, 1e3, "", 1.0)?.measure(0, "force"));
        }
        Ok(self.solved(self.cells, None, 1.0, "degree 9", 0.0)?.measure(0, "known"))
    }

    /// Hertz' pressure is that of the force of reference.
    fn errors(&self, theta: Option<i32>, gamma: f64, rule: &str, reference: f64) -> Option<Errors> {
        let found = self.solved(self.cells, theta, gamma, rule, reference).ok()?;
        let pressure = (found.measure(0, "wrong") / found.measure(0, "size")).sqrt();
        Some(Errors { pressure, force: (found.measure(0, "force") / reference - 1.0).abs() })
    }
}

/// The rows of all cases; each is given to `tell` when it is there.
///
/// # Errors
/// What is wrong with a reference.
pub(crate) fn rows(tell: &mut dyn FnMut(&str)) -> Result<String, String> {
    let mut all = String::new();
    for case in CASES {
        let gap = match case.gap {
            Gap::Hertz => "Hertz",
            Gap::Wave => "waves",
            Gap::Plane => "plane",
        };
        let reference = case.reference().map_err(|why| format!("{gap} {} {}: {why}", case.shape, case.element()))?;
        for theta in case.methods() {
            for rule in case.rules() {
                let method = theta.map_or("penalty".to_owned(), |t| format!("theta = {t}"));
                // of quadrilaterals laws that read a traction have Gauss points where nothing is said
                let gauss = case.shape == "hex" && theta.is_some();
                let shown = if rule.is_empty() { "nodes" } else { rule };
                let name = if rule.is_empty() == gauss { shown.to_owned() } else { format!("**{shown}**") };
                let rule = if gauss && rule.is_empty() { "vertex" } else { rule };
                let mut row = format!("| {gap} | {} {} | {method} | {name}", case.shape, case.element());
                for gamma in GAMMAS {
                    let cell = case.errors(*theta, gamma, rule, reference);
                    let text =
                        cell.map_or("-".to_owned(), |e| format!("{} / {}", percent(e.pressure), percent(e.force)));
                    let _ = write!(row, " | {text}");
                }
                row += " |\n";
                tell(&row);
                all += &row;
            }
        }
    }
    Ok(all)
}

/// Two digits.
fn percent(x: f64) -> String {
    let x = 100.0 * x;
    if x >= 9.95 {
        format!("{x:.0}")
    } else if x >= 0.095 {
        format!("{x:.1}")
    } else {
        format!("{x:.2}")
    }
}

pub(crate) const HEAD: &str = "\
| gap | cells | method | rule | 0.1 | 1 | 2 | 10 | 20 | 100 | 1e3 | 1e4 |
|---|---|---|---|---|---|---|---|---|---|---|---|
";
