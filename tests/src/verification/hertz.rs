//! B9, B10, B11: Hertz contact of cylinders and spheres, and its shear with friction (Cattaneo and Mindlin).

use std::f64::consts::PI;

use super::{
    Benchmark, Case, Tolerance,
    common::{example, or_failed},
};
use crate::{Solved, reference};

/// The benchmarks of this file.
pub(super) const BENCHMARKS: &[Benchmark] = &[
    Benchmark {
        id: "B9",
        title: "Hertz line contact: half width, highest pressure, force for an approach",
        origin: "closed form; NAFEMS: 6.21 mm, 3585.37 N/mm2; force of the finite box: an independent program (`physics_closed_forms.json`)",
        slow: false,
        open: None,
        run: cylinders,
    },
    Benchmark {
        id: "B10",
        title: "Hertz point contact in 3-D: radius, highest pressure, approach",
        origin: "closed form, data of MOOSE's contact verification (`physics_closed_forms.json`)",
        slow: true,
        open: None,
        run: sphere,
    },
    Benchmark {
        id: "B11",
        title: "Cattaneo-Mindlin: stick zone under a shear force",
        origin: "closed form c/a = sqrt(1 - Q/(F P))",
        slow: false,
        open: None,
        run: sheared,
    },
];

const BLOCKS: &str = "hertz/blocks.wfl";

/// Half width from the second moment of the pressure: P a^2/4 for a half ellipse.
fn half_width(solved: &Solved, step: usize) -> f64 {
    2.0 * (solved.measure(step, "mP") / solved.measure(step, "P")).sqrt()
}

fn cylinders() -> Vec<Case> {
    let data = reference("physics_closed_forms.json");
    let expected =
        |k: usize, key: &str| data["hertz_cylinder"]["cases"][k]["expected"][key].as_f64().unwrap_or(f64::NAN);
    let equal = || {
        let solved = example(BLOCKS, &[], &[])?;
        Ok(Case::new("equal bodies pressed by an approach")
            .compare("force", solved.measure(0, "P"), 2.1273e-4, Tolerance::Absolute(1e-7))
            .compare("half width", half_width(&solved, 0), expected(1, "a"), Tolerance::Relative(5e-3))
            .compare("highest pressure", solved.measure(0, "p0"), expected(1, "p0"), Tolerance::Relative(2e-3)))
    };
    // steel left, aluminium right with the same nu; the box is as large against a as that of the equal bodies
    let edits = [
        ("map [0.08*x + 1.92*x^5, 0.15*y + 1.85*y^7]", "map 88.5*[0.08*x + 1.92*x^5, 0.15*y + 1.85*y^7]".to_owned()),
        ("x == -2", "x == -177".to_owned()),
        ("x == 2", "x == 177".to_owned()),
        ("125*n*E", "125*n*E/88.5".to_owned()),
        ("on right : sigma(uR)", "on right : sigma(uR)/3".to_owned()),
        (
            "fix uR = [-dn, t] on east",
            "fix uR(2) = t on east\nload uR = [-35000/354, 0] on east\nstart uR = [-dn, 0]".to_owned(),
        ),
        ("to 4e-4 by 1e-4", "to 0 by 1".to_owned()),
        ("E/(1-nu^2)/2", "E/(1-nu^2)/4".to_owned()),
        ("expect abs(c/", "# expect abs(c/".to_owned()),
    ];
    let nafems = || {
        let solved = example(BLOCKS, &edits, &[("E", 210e3), ("R", 50.0), ("fric", 0.0), ("dn", 0.5)])?;
        Ok(Case::new("NAFEMS roller: aluminium on steel, pressed by a force of 35 kN/mm")
            .compare("force", solved.measure(0, "P"), 35e3, Tolerance::Relative(1e-9))
            .compare("half width", half_width(&solved, 0), expected(0, "a"), Tolerance::Relative(5e-3))
            .compare("highest pressure", solved.measure(0, "p0"), expected(0, "p0"), Tolerance::Relative(2e-3)))
    };
    vec![or_failed("equal bodies", equal()), or_failed("NAFEMS roller", nafems())]
}

fn sphere() -> Vec<Case> {
    let data = reference("physics_closed_forms.json");
    let case = &data["hertz_sphere"]["cases"][0]["expected"];
    let expected = |key: &str| case[key].as_f64().unwrap_or(f64::NAN);
    let made = |n: f64| {
        let solved = example("hertz/sphere.wfl", &[], &[("n", n)])?;
        // second moment of the pressure of half a sphere: 2/5 P a^2
        let radius = (2.5 * solved.measure(0, "moment") / solved.measure(0, "force")).sqrt();
        Ok(Case::new(format!("two equal spheres, Q2 hexahedra, {n} cells a side"))
            .compare("force on a quarter", solved.measure(0, "force"), 2500.0, Tolerance::Relative(1e-9))
            .compare("radius", radius, expected("a"), Tolerance::Relative(1e-2))
            .compare("highest pressure", solved.measure(0, "p0"), expected("p0"), Tolerance::Relative(1e-2))
            .compare("approach", 2.0 * solved.measure(0, "descent"), expected("approach"), Tolerance::Relative(1e-2)))
    };
    [8.0, 12.0].map(|n| or_failed("spheres", made(n))).to_vec()
}

/// Size of the interface element of the box that holds `y`, from the map of the scene with n = 20.
fn element_at(y: f64) -> f64 {
    let place = |k: u32| {
        let s = f64::from(k) / 40.0;
        0.15 * s + 1.85 * s.powi(7)
    };
    (0..40).find(|k| place(k + 1) >= y).map_or(f64::NAN, |k| place(k + 1) - place(k))
}

fn sheared() -> Vec<Case> {
    let solved = match example(BLOCKS, &[], &[]) {
        Ok(solved) => solved,
        Err(why) => return vec![Case::failed("sheared blocks", why)],
    };
    let (friction, estar, radius) = (0.3, 0.5 / (1.0 - 0.09), 10.0);
    (1..solved.outcome.steps.len())
        .map(|step| {
            let (p, q) = (solved.measure(step, "P"), solved.measure(step, "Q"));
            let a = (4.0 * p * radius / (PI * estar)).sqrt();
            let load = q / (friction * p);
            let c = a * (1.0 - load).sqrt();
            // second moment of the closed form of the shear traction
            let moment = 0.25 * friction * p * a * a * (1.0 - (c / a).powi(4));
            Case::new(format!("Q = {load:.3} F P"))
                .compare("half width of stick", solved.measure(step, "c"), c, Tolerance::Absolute(element_at(c)))
                .compare("second moment of the shear", solved.measure(step, "mQ"), moment, Tolerance::Relative(5e-3))
        })
        .collect()
}
