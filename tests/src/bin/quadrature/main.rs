//! What quadrature rules leave of the solution, against what they cost: the tables of `docs/quadrature.md`.
//!
//! `cargo run --release -p wfl-tests --bin quadrature` solves neo-Hookean bodies, one of them in contact, with every
//! degree, and linear ones pressed on gaps with known pressures with every parameter, and prints the page. The reference of a
//! rule is the solution on the same mesh under a rule of degree 15, that of the mesh is the solution with twice as many cells
//! a side.

mod contact;

use std::{io::Write as _, path::Path};

use wfl_problem::{RuleChoice, TermSummary};
use wfl_tests::{Solved, solve};

/// Far above every degree that is tried on bulk; where kinks cut facets, no rule is exact.
const REFERENCE: usize = 15;

struct Case {
    what: &'static str,
    /// Shape of the cells, with the dimension of the space.
    shape: (&'static str, usize),
    element: &'static str,
    /// Cells a side.
    cells: usize,
    /// Where the rule is varied.
    place: &'static str,
    degrees: &'static [usize],
}

const fn bulk(shape: (&'static str, usize), element: &'static str, cells: usize, degrees: &'static [usize]) -> Case {
    Case { what: "bulk", shape, element, cells, place: "all", degrees }
}

const fn contact(shape: (&'static str, usize), element: &'static str, cells: usize, degrees: &'static [usize]) -> Case {
    Case { what: "contact facet", shape, element, cells, place: "floor", degrees }
}

const CASES: &[Case] = &[
    bulk(("tri", 2), "P1", 8, &[0, 1]),
    bulk(("tri", 2), "P2", 8, &[2, 3, 4, 5, 6]),
    bulk(("tri", 2), "P3", 6, &[4, 5, 6, 8]),
    bulk(("quad", 2), "Q1", 8, &[3, 5, 7, 9]),
    bulk(("quad", 2), "Q2", 8, &[5, 7, 9]),
    bulk(("tet", 3), "P2", 3, &[2, 3, 4, 6]),
    bulk(("hex", 3), "Q1", 4, &[3, 5, 7, 9]),
    bulk(("hex", 3), "Q2", 2, &[5, 7, 9]),
    contact(("quad", 2), "Q1", 8, &[1, 3, 5, 7, 9, 11]),
    contact(("quad", 2), "Q2", 8, &[3, 5, 7, 9, 11]),
    contact(("tri", 2), "P2", 8, &[3, 5, 7, 9, 11]),
    contact(("hex", 3), "Q1", 3, &[1, 3, 5, 7, 11]),
];

fn main() -> std::process::ExitCode {
    match write(&mut std::io::stdout().lock()) {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(e) => {
            let _ = writeln!(std::io::stderr(), "error: {e}");
            std::process::ExitCode::FAILURE
        }
    }
}

impl Case {
    /// A block that is clamped at one end and moved at the other, or pressed askew on a floor with friction.
    fn scene(&self, cells: usize, degree: Option<usize>) -> String {
        let (shape, dim) = self.shape;
        let (one, counts) = (vec!["1"; dim].join(","), vec![cells.to_string(); dim].join(","));
        let (zero, up) = (one.replace('1', "0"), ["x", "y", "z"][dim - 1]);
        let moved = if dim == 3 { "[0.15,0.05,-0.15]" } else { "[0.15,-0.15]" };
        let rule = degree.map_or_else(String::new, |d| format!("quadrature on {} degree {d}\n", self.place));
        let held = if self.place == "all" {
            format!("fix u = [{zero}] on floor\nfix u = {moved} on lid\n")
        } else {
            format!(
                "param gamma = 2e4\ndef tang(w) = w - (w.Normal)*Normal\n\
                 def Pn = gamma*(u.Normal) - (P*Normal).Normal\ndef Pt = gamma*tang(u) - tang(P*Normal)\n\
                 def force = pos_part(Pn)*Normal + Ball_projection(Pt, 0.2*pos_part(Pn))\n\
                 term contact on floor : force.Test_u\nfix u = {moved} on lid\nquadrature on all degree {REFERENCE}\n"
            )
        };
        format!(
            "mesh box [{zero}] to [{one}] cells [{counts}] {shape}\nregion floor = faces where {up} == 0\n\
             region lid = faces where {up} == 1\nunknown u : vector {}\ndef F = Id({dim}) + Grad_u\n\
             def P = 80*(F - Inv(F)') + 120*log(Det(F))*Inv(F)'\nterm elastic on all : P:Grad_Test_u\n{held}{rule}\
             measure pull = integral((P*Normal).Normal) on lid\n",
            self.element
        )
    }

    fn solved(&self, cells: usize, degree: Option<usize>) -> Result<Solved, String> {
        let solved = solve(Path::new("."), self.scene(cells, degree), &[], &[])?;
        if solved.outcome.converged() { Ok(solved) } else { Err("a step did not converge".to_owned()) }
    }

    fn term<'a>(&self, solved: &'a Solved) -> Option<&'a TermSummary> {
        solved.scene.terms.iter().find(|t| t.place == self.place)
    }

    /// The rows of this case: what each rule, and the mesh, leaves of displacement and reaction.
    fn rows(&self) -> Result<String, String> {
        let n = self.cells;
        let best = self.solved(n, Some(REFERENCE))?;
        let finer = self.solved(2 * n, Some(REFERENCE))?;
        let of_mesh = [self.displacement(&best, &finer), reaction(&best, &finer)];
        let own = self.solved(n, None)?;
        let chosen = self.term(&own).map(|t| t.rule);
        let mut rows = String::new();
        for degree in self.degrees {
            let head = format!("| {} | {} {} | {degree}", self.what, self.shape.0, self.element);
            let solved = match self.solved(n, Some(*degree)) {
                Ok(solved) => solved,
                Err(why) => {
                    rows += &format!("{head} | - | - | - | - | - | {} |\n", why.lines().next().unwrap_or_default());
                    continue;
                }
            };
            let points = self.term(&solved).map_or(0, |t| t.n_points);
            let of_rule = [self.displacement(&solved, &best), reaction(&solved, &best)];
            // rules of several degrees are the same one
            let own_points = self.term(&own).map_or(0, |t| t.n_points);
            let mark = match chosen {
                Some(RuleChoice::Degree(d)) if points == own_points && self.place == "all" => {
                    format!("chosen (degree {d})")
                }
                _ => String::new(),
            };
            rows += &format!(
                "{head} | {points} | {:.0e} | {:.0e} | {:.0e} | {:.0e} | {mark} |\n",
                of_rule[0], of_mesh[0], of_rule[1], of_mesh[1]
            );
        }
        Ok(rows)
    }

    /// Difference of displacements at the vertices of the coarser mesh, relative, root of the mean square.
    fn displacement(&self, coarse: &Solved, fine: &Solved) -> f64 {
        let (n, dim) = (self.cells, self.shape.1);
        let (mut gap, mut size) = (0.0, 0.0);
        for k in 0..(n + 1).pow(u32::try_from(dim).unwrap_or(3)) {
            #[expect(clippy::cast_precision_loss, reason = "few cells")]
            let at = |d: u32| (k / (n + 1).pow(d) % (n + 1)) as f64 / n as f64;
            let x = [at(0), at(1), if dim == 3 { at(2) } else { 0.0 }];
            for (a, b) in coarse.at(0, "u", x).iter().zip(fine.at(0, "u", x)) {
                gap += (a - b).powi(2);
                size += b * b;
            }
        }
        (gap / size).sqrt()
    }
}

/// Relative difference of the forces on the moved face.
fn reaction(a: &Solved, b: &Solved) -> f64 {
    let [a, b] = [a, b].map(|s| s.measure(0, "pull"));
    (a - b).abs() / b.abs()
}

fn write(out: &mut impl std::io::Write) -> std::io::Result<()> {
    let mut rows = String::new();
    for case in CASES {
        match case.rows() {
            Ok(made) => {
                write!(std::io::stderr(), "{made}")?;
                rows += &made;
            }
            Err(why) => return Err(std::io::Error::other(format!("{} {}: {why}", case.what, case.element))),
        }
    }
    let head = "| where | cells | degree | points | displacement: rule | mesh | reaction: rule | mesh | |\n\
                |---|---|---|---|---|---|---|---|---|\n";
    let contact = contact::rows(&mut |row| {
        let _ = write!(std::io::stderr(), "{row}");
    })
    .map_err(std::io::Error::other)?;
    write!(out, "{INTRODUCTION}\n{head}{rows}\n{CONTACT}\n{}{contact}", contact::HEAD)
}

const INTRODUCTION: &str = "\
# Quadrature rules

Made by `cargo run --release -p wfl-tests --bin quadrature`.

Integrands that are polynomials in the reference cell are integrated exactly; `compiler/src/degree.rs` has the
derivation, also for cells and faces that are not affine. Others (a hyperelastic law, a projection) become exact under
no rule. The question is how much a rule leaves of the solution beside what the mesh leaves.

A neo-Hookean unit block (mu = 80, lambda = 120) is clamped at the floor and its lid moved by 0.15 sideways and 0.15
down; in the cases of contact it stands on the floor with Nitsche's method (theta = 0) and friction 0.2, and the rule of
the floor alone is varied. `rule`: relative difference to the same mesh under a rule of degree 15. `mesh`: relative
difference to a mesh with twice as many cells a side under that rule. Displacements are compared at the vertices. In
contact the rule of the reference has an error of its own, because kinks cut the facets: below 1e-4 the rows are no order.
Faces with contact have another rule, one point a node, for the reasons below.
";

const CONTACT: &str = "\
## Contact: one point a node

The law of contact holds at each point of the rule of its faces. Displacements that follow a curved gap at the nodes follow
it at no more points than there are nodes: with more of them, and a stiff penalty or a large Nitsche parameter, the pressure
of each face gathers at some of its points, and pressures alternate. Forces stay right where all faces are closed and in the
plane; under a sphere on few faces they are wrong by 3 to 12 %. With one point a node (`nodes` in the table of `wfl check`)
no parameter is too large:

| faces of | rule | exact for degree |
|---|---|---|
| degree 1 | the vertices | 1 |
| degree 2: lines, quadrilaterals | Simpson's rule (the nodes) | 3 |
| degree 2: triangles | the midpoints of the edges, whose basis functions alone have an integral | 2 |
| degree 3: lines, quadrilaterals | Gauss-Lobatto with 4 points a direction | 5 |
| degree 3: triangles | Gauss, 6 points | 4 |
| a face that meets the axis of a body of revolution | points inside and at the other end: on the axis the integrand is zero | |

This is the default of faces with kinks that depend on the unknowns, on cells of first order, but for laws on hexahedra that
read the traction of the body (Nitsche's method): the nodes of a quadrilateral see little of it, the smallest safe gamma would
be about four times as large, and below it results are wrong or not there (rows of theta = 0 below). On quadrilateral faces of
degree 1 and 2 each point has the integral of its basis function times the area vector (normal times measure), so that a
constant stress passes exactly also where faces are no parallelograms or not plane (`tests/tests/patch.rs`). Loads on the
same faces keep a rule of their own degree, and so do terms without kinks whose fields have a higher degree than those of the
contact. `quadrature on ... degree n` sets another rule. Nitsche's method needs a larger
gamma with one point a node than under a Gauss rule: W503 and `gamma = auto` have the smallest safe value for the rule.

Faces of cells of second order keep a Gauss rule of the degree of the term and 2 more, and so do terms through a mapping: the
fields of the other side have kinks inside a face, whose integral needs points. Of two flat blocks whose meshes do not match
the default shows less than 1 % of a constant pressure at E/h, and one point a node several per cent.

The upper end of gamma with one point a node is 1e4 E/h, the largest one measured: from 100 E/h on the errors of the table
hardly change. Under a Gauss rule it is E/h on curved gaps where a zone of contact ends (`Hertz`); where all faces are closed
(`waves`) it is 2 E/h for elements of degree 1 and 10 E/h for degree 2. W520 tells of pressures that alternate.

Errors of the pressure at the points (relative, root of the mean square) and of the force, in per cent, over gamma in E/h
of the faces. `Hertz`: a rigid cylinder or sphere, against a mesh with half as many faces more a side: the force, and Hertz'
pressure for that force. From the centre to the edge of the zone there are 7 faces for elements of degree 1 in the plane, 4
in space, and about half as many for degree 2: in space the error of the mesh is the largest part. `waves`: a cosine that is
closed everywhere, on 16 faces of half a wave (in space 8, no parallelograms; half as many for degree 2). `plane`: a constant
pressure, on such faces. Below gamma = E/h the error of `penalty` is that of its flexibility. Nitsche's method with theta = 0
and 1 is below its bound (W503) on the left. Rules: one point a node, and the Gauss rule of the degree of the
term and 2 more; that of the default is bold. `-`: no convergence.
";
