//! Regions, units, time and outputs: a statement means what it says, or the run says what it means.

use super::{common::Folder, run};

/// A plate under a heat flow through a part of its bottom, held at the top: the measure `flow` is the size of that part.
fn heated(mesh: &str, part: &str) -> String {
    format!(
        "wfl 1\n{mesh}\nregion part = {part}\nregion top = faces where y == 1\nunknown T : scalar\n\
         term conduction on all : Grad_T.Grad_Test_T\nload T = 1 on part\nfix T = 0 on top\n\
         measure flow = integral(1) on part\n"
    )
}

#[test]
fn a_condition_that_cuts_faces_is_told_with_the_part_that_is_left_out() {
    let plate = "mesh box [0,0] to [2,1] cells [8,2] quad";
    // lines of the mesh at 0, 0.25, ..., 2: what is selected, and what the condition holds on
    let cut = [("x < 1", 0.75, "25 %"), ("x <= 0.9", 0.75, "17 %"), ("x < 0.5 or x > 1.6", 0.5, "44 %")];
    for (k, (condition, size, share)) in cut.into_iter().enumerate() {
        let ran = run(&format!("cut-{k}"), &heated(plate, &format!("faces where y == 0 and ({condition})")), &[]);
        assert!(ran.code == 0 && ran.tells("W419") && ran.text.contains(share), "{condition}: {}", ran.text);
        assert!((ran.last("flow") - size).abs() < 1e-12, "{condition}");
    }
    let met = ["x <= 1", "x < 1.001", "x > 0.249", "x >= 0.25 and x <= 1.75", "not (x > 1)"];
    for (k, condition) in met.into_iter().enumerate() {
        run(&format!("met-{k}"), &heated(plate, &format!("faces where y == 0 and ({condition})")), &[]).assert_silent();
    }
}

#[test]
fn faces_of_solids_and_triangles_are_cut_in_the_same_way() {
    let solid = "mesh box [0,0,0] to [1,1,1] cells [4,2,4] hex";
    let ran = run("cut-hex", &heated(solid, "faces where y == 0 and x <= 0.6 and z <= 0.5"), &[]);
    // 0.5 by 0.5 is selected, 0.6 by 0.5 is meant: a sixth is missing
    assert!(ran.tells("W419") && ran.text.contains("17 %") && ran.last("flow") == 0.25, "{}", ran.text);
    let tets = "mesh box [0,0,0] to [1,1,1] cells [4,2,4] tet";
    let ran = run("cut-tet", &heated(tets, "faces where y == 0 and x + z <= 1.1"), &[]);
    assert!(ran.tells("W419"), "{}", ran.text);
    run("met-tet", &heated(tets, "faces where y == 0 and x <= 0.5 and z <= 0.5"), &[]).assert_silent();
}

#[test]
fn a_band_around_a_curved_boundary_is_no_cut() {
    // a quarter of a ring: slivers of the straight sides lie in the bands around both arcs
    let ring = "wfl 1\nparam a = 1\nparam b = 2\nmesh box [a,0] to [b,pi/2] cells [6,8] quad map [x*cos(y), x*sin(y)]\n\
        region bore = faces where x^2 + y^2 < (1.02*a)^2\nregion rim = faces where x^2 + y^2 > (0.99*b)^2\n\
        unknown T : scalar\nterm conduction on all : Grad_T.Grad_Test_T\nload T = 1 on bore\nfix T = 0 on rim\n\
        measure arc = integral(1) on bore\n";
    run("band", ring, &[]).assert_silent();
}

#[test]
fn cells_whose_centre_decides_otherwise_than_their_volume_are_told() {
    let scene = |condition: &str| {
        format!(
            "wfl 1\nmesh box [0,0] to [1,1] cells [4,4] quad\nregion soft = cells where {condition}\nregion west = faces where x == 0\n\
             unknown u : scalar\nterm k on all : Grad_u.Grad_Test_u\nload u = 1 on soft\nfix u = 0 on west\n\
             measure size = integral(1) on soft\n"
        )
    };
    // lines at 0, 0.25, ...: the column with its centre at 0.625 is in or out
    for (k, (condition, size, told)) in
        [("x < 0.65", 0.75, "15 % more"), ("x < 0.6", 0.5, "17 % less")].into_iter().enumerate()
    {
        let ran = run(&format!("cells-{k}"), &scene(condition), &[]);
        assert!(ran.tells("W419") && ran.text.contains(told), "{condition}: {}", ran.text);
        assert!((ran.last("size") - size).abs() < 1e-12, "{condition}");
    }
    for (k, condition) in ["x < 0.5", "x <= 0.75 and y < 0.5", "x + 0*y > 0.25"].into_iter().enumerate() {
        run(&format!("cells-met-{k}"), &scene(condition), &[]).assert_silent();
    }
}

#[test]
fn what_is_in_two_regions_of_a_list_counts_once() {
    let bar = |loads: &str, of: &str| {
        format!(
            "wfl 1\nmesh box [0] to [1] cells [4] segment\nregion west = faces where x == 0\nregion a = cells where x < 0.5\n\
             region b = cells where x < 0.75\nregion both = a + b\nunknown u : scalar\nterm k on all : Grad_u.Grad_Test_u\n\
             fix u = 0 on west\n{loads}measure tip = value(u) at [1]\nmeasure size = integral(1) on {of}\n"
        )
    };
    // a load of 1 on 0 < x < l moves the tip by l^2/2
    for (name, list) in [("list-ab", "a, b"), ("list-ba", "b, a")] {
        let ran = run(name, &bar(&format!("load u = 1 on {list}\n"), list), &[]);
        assert!(ran.code == 0 && ran.tells("W420"), "{}", ran.text);
        assert!((ran.last("tip") - 0.28125).abs() < 1e-13 && (ran.last("size") - 0.75).abs() < 1e-14, "{}", ran.text);
    }
    let ran = run("list-union", &bar("load u = 1 on both\n", "both"), &[]);
    ran.assert_silent();
    assert!((ran.last("tip") - 0.28125).abs() < 1e-13);
    let ran = run("list-two", &bar("load u = 1 on a\nload u = 1 on b\n", "both"), &[]);
    ran.assert_silent();
    assert!((ran.last("tip") - (0.125 + 0.28125)).abs() < 1e-13, "{}", ran.text);
}

#[test]
fn a_prefix_is_part_of_a_unit_between_terms_loads_and_the_mesh() {
    let bar = |e: &str, q: &str| {
        format!(
            "wfl 1\nparam E = {e}\nparam q = {q}\nparam L = 100 [mm]\nmesh box [0] to [L] cells [4] segment\n\
             region west = faces where x == 0\nregion east = faces where x == L\nunknown u : scalar [mm]\n\
             term k on all : E*Grad_u.Grad_Test_u\nfix u = 0 on west\nload u = q on east\nmeasure tip = mean(u) on east\n"
        )
    };
    let right = run("units-right", &bar("210e3 [MPa]", "100 [MPa]"), &[]);
    right.assert_silent();
    assert!((right.last("tip") - 100.0 * 100.0 / 210e3).abs() < 1e-12);
    for (name, e, q) in [("units-E", "210 [GPa]", "100 [MPa]"), ("units-q", "210e3 [MPa]", "1e5 [kPa]")] {
        let ran = run(name, &bar(e, q), &[]);
        assert!(ran.tells("W505") && ran.text.contains("1000"), "{}", ran.text);
    }
}

#[test]
fn a_shift_of_time_changes_no_increment() {
    let clock = |from: &str, to: &str, by: &str| {
        format!(
            "wfl 1\nmesh box [0] to [1] cells [1] segment\nunknown u : scalar\nterm rate on all : (Dot_u - 1)*Test_u\n\
             steps t = {from} to {to} by {by}\nmeasure moved = mean(u) on all\n"
        )
    };
    // du/dt = 1: u is the time that has passed; a second of 2024, and one that began 30,000 years ago
    for (k, (from, to, by)) in [
        ("0", "1", "0.01"),
        ("1.7e9", "1.7e9+1", "0.01"),
        ("-1.7e9", "1-1.7e9", "0.01"),
        ("1e12", "1e12+1", "0.0625"),
        ("1.7e9", "1.7e9+0.3", "0.1"),
    ]
    .into_iter()
    .enumerate()
    {
        let ran = run(&format!("shift-{k}"), &clock(from, to, by), &[]);
        let passed = if k == 4 { 0.3 } else { 1.0 };
        assert!(
            ran.code == 0 && (ran.last("moved") - passed).abs() < 1e-13,
            "{from}: {} {}",
            ran.last("moved"),
            ran.text
        );
        assert_eq!(ran.codes(), Vec::<&str>::new(), "{from}: {}", ran.text);
    }
    let coarse = run("shift-coarse", &clock("1e12", "1e12+1", "1e-3"), &[]);
    assert!(coarse.tells("W421") && (coarse.last("moved") - 1.0).abs() < 1e-11, "{}", coarse.text);
    assert!(run("shift-none", &clock("1e12", "1e12+1", "1e-4"), &[]).tells("E413"));
}

/// An insulated bar at 20 degrees; what it takes up is the integral of what drives it.
fn insulated(more: &str) -> String {
    format!(
        "wfl 1\nmesh box [0] to [1] cells [8] segment\nregion tip = faces where x == 1\nunknown T : scalar\nstart T = 20\n\
         term storage on all : Dot_T*Test_T\nterm conduction on all : Grad_T.Grad_Test_T\nsteps t = 0 to 10 by auto\n\
         {more}measure mean_T = mean(T) on all\n"
    )
}

#[test]
fn chosen_steps_do_not_pass_over_what_drives_a_scene() {
    let root = std::f64::consts::PI.sqrt();
    let pulses = [
        // 100 for 0.2: both ends, open and closed
        ("load T = (if t > 5 and t < 5.2 then 100 else 0) on tip\n", 20.0),
        ("load T = (if t >= 5 and t <= 5.2 then 100 else 0) on tip\n", 20.0),
        ("load T = 100*(Heaviside(t - 3.3) - Heaviside(t - 3.31)) on tip\n", 1.0),
        // the integral of exp(-((t - c)/w)^2) is w sqrt(pi)
        ("load T = 100*exp(-((t - 5)/0.02)^2) on tip\n", 2.0 * root),
        ("load T = 1e5*exp(-((t/2 - 4)/1e-5)^2) on tip\n", 2.0 * root),
        ("data q : scalar = (if abs(t - 7) < 0.05 then 10 else 0)\nterm source on all : -q*Test_T\n", 1.0),
        ("term source on all : -(if t > 2 and t < 2.1 then 10*x else 0)*Test_T\n", 0.5),
        // passes each point of the bar in 0.02
        ("term source on all : -(if t - x > 5 and t - x < 5.02 then 50 else 0)*Test_T\n", 1.0),
    ];
    for (k, (pulse, taken)) in pulses.into_iter().enumerate() {
        let ran = run(&format!("pulse-{k}"), &insulated(pulse), &[]);
        let missed = (ran.last("mean_T") - 20.0 - taken).abs() / taken;
        assert!(ran.code == 0 && missed < 0.02, "{pulse}: {missed} {}", ran.text);
    }
}

#[test]
fn columns_of_single_numbers_are_written() {
    let folder = Folder::new("truth-globals");
    folder.write(
        "scene.wfl",
        "wfl 1\nmesh box [0] to [1] cells [1] segment with idle_cells=allowed\nunknown d : scalar global\n\
         term law on global : (d - 1 - t)*Test_d\nsteps t = 0 to 1 by 0.5\noutput csv \"s\" : d, 2*d as twice at [0]\n\
         output csv \"line\" : d along [0] to [1] with points=2\n",
    );
    let ran = folder.wfl(&["run", "scene.wfl", "--out", "out"]);
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let rows = |name: &str| {
        let text = std::fs::read_to_string(folder.0.join("out").join(name)).expect("the table");
        text.lines().map(|l| l.split(',').map(str::to_owned).collect::<Vec<_>>()).collect::<Vec<_>>()
    };
    let series = rows("s.csv");
    assert_eq!(series[0], ["t", "x", "d", "twice"]);
    let last: Vec<f64> = series[3].iter().map(|x| x.parse().unwrap()).collect();
    assert_eq!(last, [1.0, 0.0, 2.0, 4.0]);
    assert_eq!(rows("line_0002.csv")[0], ["s", "x", "d"]);
}

#[test]
fn points_of_a_series_outside_the_bodies_are_told() {
    let scene = |point: &str| {
        format!(
            "wfl 1\nmesh box [0,0] to [1,1] cells [2,2] quad\nregion west = faces where x == 0\nunknown u : scalar\n\
             term k on all : Grad_u.Grad_Test_u\nfix u = t on west\nsteps t = 0 to 1 by 1\n\
             output csv \"s\" : u at [0.5,0.5], {point}\n"
        )
    };
    let ran = run("outside", &scene("[2,0.5]"), &[]);
    assert!(ran.code == 0 && ran.tells("W415"), "{}", ran.text);
    run("inside", &scene("[1,0.5]"), &[]).assert_silent();
}

#[test]
fn a_branch_that_is_never_taken_may_divide_by_zero() {
    let scene = |a: f64| {
        format!(
            "wfl 1\nparam a = {a}\nmesh box [0] to [1] cells [1] segment\nunknown u : scalar\n\
             def q = if a > 0 and 1/a < 1e9 then 1/a else 2\nterm law on all : (u - q)*Test_u\nmeasure m = max(q) on all\n"
        )
    };
    for (a, value) in [(0.0, 2.0), (4.0, 0.25)] {
        let ran = run(&format!("branch-{a}"), &scene(a), &[]);
        ran.assert_silent();
        assert_eq!(ran.last("m"), value);
    }
    let taken = scene(0.0).replace("a > 0 and 1/a < 1e9", "a >= 0");
    assert!(run("branch-taken", &taken, &[]).tells("E109"));
}

#[test]
fn a_state_has_no_value_at_a_point_and_the_statement_is_shown() {
    let scene = |last: &str| {
        format!(
            "wfl 1\nmesh box [0,0] to [1,1] cells [2,2] quad\nregion floor = faces where y == 0\nunknown u : scalar\n\
             state w : scalar on floor := Previous_w + 1\ndef q = u + Previous_w\nterm k on all : Grad_u.Grad_Test_u + u*Test_u\n\
             term law on floor : q*Test_u\nsteps t = 0 to 1 by 1\n{last}\n"
        )
    };
    for (k, last) in ["output csv \"s\" : q at [1,0]", "measure m = value(q) at [1,0]"].into_iter().enumerate() {
        let ran = run(&format!("state-{k}"), &scene(last), &[]);
        assert!(ran.tells("E416") && ran.text.contains(last) && ran.text.contains("help"), "{}", ran.text);
    }
    assert_eq!(run("state-mean", &scene("measure m = mean(q) on floor"), &[]).code, 0);
}

#[test]
fn a_field_with_states_is_drawn() {
    let folder = Folder::new("truth-plot-state");
    folder.write(
        "scene.wfl",
        "wfl 1\nmesh box [0,0] to [1,1] cells [2,2] quad\nregion west = faces where x == 0\nunknown u : vector\n\
         state s : matrix(2,2) on all := Previous_s + Sym(Grad_u)\nterm k on all : (Sym(Grad_u) + Previous_s):Grad_Test_u\n\
         fix u = [0,0] on west\nload u = [0.01,0] on boundary\nsteps t = 0 to 1 by 1\n\
         output vtk \"fields\" : u, Norm(s) as size, s as all_of_it\n",
    );
    assert!(folder.wfl(&["run", "scene.wfl", "--out", "out"]).status.success());
    for field in ["size", "all_of_it:xx", "u"] {
        let ran = folder.wfl(&["plot", "out", "--field", field]);
        assert!(ran.status.success(), "{field}: {}", String::from_utf8_lossy(&ran.stderr));
    }
}

#[test]
fn a_surface_that_runs_clockwise_is_turned_and_told() {
    let scene = "wfl 1\nmesh file \"clockwise.msh\"\nunknown u : scalar\nterm k on all : Grad_u.Grad_Test_u\nload u = 1 on all\n\
        fix u = 0 on boundary\nmeasure area = integral(1) on all\nmeasure most = max(u) on all\n";
    let ran = run("clockwise", scene, &[]);
    assert!(ran.code == 0 && ran.codes() == ["W423"], "{}", ran.text);
    assert!(ran.last("area") > 0.0 && ran.last("most") > 0.0, "{}", ran.text);
}

#[test]
fn one_mistyped_region_gives_one_message() {
    let scene = "wfl 1\nmesh box [0,0] to [1,1] cells [4,4] quad\nregion left = cells where x < 0.5\n\
        region right = cells where x > 0.5\nregion bottom = faces where y == 0\nunknown uL : vector on lft\n\
        unknown uR : vector on right\nterm a on lft : Sym(Grad_uL):Grad_Test_uL\nterm b on right : Sym(Grad_uR):Grad_Test_uR\n\
        fix uL, uR = [0,0] on bottom\nload uL = [1,0] on left\nmeasure m = max(uL(1)) on left\n";
    let ran = run("mistyped", scene, &[]);
    assert!(ran.code == 1 && ran.codes() == ["E201"], "{}", ran.text);
}
