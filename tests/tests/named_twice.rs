//! A region has more than one name, more than one side and may be cut in parts: what is measured, stored and held there is the
//! same.

use wfl_tests::solved;

fn assert_near(what: &str, is: f64, should: f64, within: f64) {
    assert!((is - should).abs() <= within * should.abs(), "{what}: {is}, {should}");
}

/// A block pressed on a curved obstacle by a penalty on `on`.
fn pressed(on: &str, more: &str) -> String {
    format!(
        "mesh box [0,0] to [1,1] cells [5,4] quad\nregion floor = faces where y == 0\nregion ground = faces where y <= 0\n\
         region west = faces of floor where x < 0.5\nregion east = floor - west\nregion both = west + east\n\
         region lid = faces where y == 1\nunknown u : vector Q1\n\
         def pressure = 2e4*pos_part(u.Normal - 0.03*(x - 0.35)^2)\n\
         term body on all : 900*Sym(Grad_u):Grad_Test_u\nterm contact on {on} : pressure*(Test_u.Normal)\n\
         fix u = [0,-0.006] on lid\nmeasure pull = reaction(u(2)) on lid\n{more}"
    )
}

#[test]
fn a_measured_force_is_the_one_that_acts_under_every_name() {
    let measures = "measure a = integral(pressure) on floor\nmeasure b = integral(pressure) on ground\n\
                    measure w = integral(pressure) on west\nmeasure e = integral(pressure) on east\n\
                    measure c = integral(pressure) on west, east\nmeasure d = integral(pressure) on both\n\
                    measure around = integral(pressure) on boundary\nmeasure most = max(pressure) on floor\n\
                    measure beside = max(pressure) on ground\n";
    for on in ["floor", "ground", "west, east", "both"] {
        let found = solved(pressed(on, measures));
        let of = |name: &str| found.measure(0, name);
        for name in ["a", "b", "c", "d"] {
            assert_near(&format!("{on}: {name}"), of(name), of("pull"), 1e-10);
        }
        assert_near(on, of("w") + of("e"), of("pull"), 1e-10);
        assert_near(on, of("beside"), of("most"), 1e-10);
        // the expression is taken beyond the contact, too, where the lid is pulled away from its curve
        assert!(of("around").is_finite());
    }
    // a load on a part has a rule of its own: the pressure is still that of the term
    let load = "term wind on west : 1e-3*Test_u(1)\n";
    let found = solved(pressed("floor", &format!("{load}{measures}")));
    assert_near("beside a load", found.measure(0, "w") + found.measure(0, "e"), found.measure(0, "pull"), 1e-10);
}

#[test]
fn a_state_on_the_same_faces_has_the_points_of_the_term() {
    let states = "steps t = 0 to 1 by 0.5\nstate here : scalar on floor := pressure\nstate there : scalar on ground := pressure\n\
                  state part : scalar on west := pressure\nmeasure a = integral(here) on floor\n\
                  measure b = integral(there) on ground\nmeasure c = integral(there) on floor\nmeasure d = integral(part) on west\n\
                  measure e = integral(pressure) on west\n";
    let found = solved(pressed("floor", states));
    for name in ["a", "b", "c"] {
        assert_near(name, found.measure(1, name), found.measure(1, "pull"), 1e-10);
    }
    assert_near("a part", found.measure(1, "d"), found.measure(1, "e"), 1e-12);
}

#[test]
fn an_interface_carries_the_same_seen_from_either_side() {
    for (space, cells, kind) in [("", "[6,6]", "quad"), ("", "[6,6]", "tri"), (",0", "[4,4,2]", "hex")] {
        let top = if space.is_empty() { "[1,1]" } else { "[1,1,1]" };
        let zero = if space.is_empty() { "[0,0]" } else { "[0,0,0]" };
        let push = if space.is_empty() { "[0,-0.006]" } else { "[0,-0.006,0]" };
        let found = solved(format!(
            "mesh box {zero} to {top} cells {cells} {kind}\nregion under = cells where y < 0.5\nregion over = cells where y > 0.5\n\
             region up = interface from under to over\nregion down = interface from over to under\n\
             region west = faces of up where x <= 0.5\nregion east = faces of up where x >= 0.5\n\
             region floor = faces where y == 0\nregion lid = faces where y == 1\nunknown u : vector on under\n\
             unknown v : vector on over\ndef gap = 0.03*(x - 0.35)^2\n\
             def pressure = 2e4*pos_part((u - Interpolate(v, neighbor_element)).Normal - gap)\n\
             def seen = 2e4*pos_part((v - Interpolate(u, neighbor_element)).Normal - gap)\n\
             term below on under : 900*Sym(Grad_u):Grad_Test_u\nterm above on over : 900*Sym(Grad_v):Grad_Test_v\n\
             term contact on up : pressure*((Test_u - Interpolate(Test_v, neighbor_element)).Normal)\n\
             fix u = {zero} on floor\nfix v = {push} on lid\nmeasure pull = reaction(v(2)) on lid\n\
             measure a = integral(pressure) on up\nmeasure b = integral(seen) on down\n\
             measure w = integral(pressure) on west\nmeasure e = integral(pressure) on east\n"
        ));
        let of = |name: &str| found.measure(0, name);
        assert_near(kind, of("a"), of("pull"), 1e-10);
        assert_near(kind, of("b"), of("pull"), 1e-10);
        assert_near(kind, of("w") + of("e"), of("pull"), 1e-10);
    }
}

#[test]
fn a_state_is_measured_on_a_part_of_its_region_that_has_terms_of_its_own() {
    let found = solved(
        "mesh box [0] to [2] cells [6]\nregion right = cells where x > 1\nunknown u : scalar P2\n\
         state kept : scalar on all := 1 + x\nterm bar on all : Grad_u(1)*Grad_Test_u(1) + (1 + Previous_kept)*u*Test_u\n\
         term spring on right : x^4*u*Test_u\nload u = 1 on all\nsteps t = 0 to 1 by 1\nmeasure half = mean(kept) on right\n\
         measure whole = mean(kept) on all\n",
    );
    assert_near("half", found.measure(1, "half"), 2.5, 1e-12);
    assert_near("whole", found.measure(1, "whole"), 2.0, 1e-12);
}

/// A quarter ring that turns about its centre on a guide without friction: exact, whatever the guide is made of.
#[test]
fn a_smooth_guide_in_pieces_has_one_normal_at_its_seams() {
    for (element, shape) in [("Q1", "quad"), ("Q2", "quad"), ("P1", "tri"), ("P2", "tri")] {
        for held in [
            "fix u.Normal = 0 on guide\n",
            "fix u.Normal = 0 on first, second\n",
            "fix u.Normal = 0 on second, first\n",
            "fix u.Normal = 0 on first\nfix u.Normal = 0 on second\n",
            "fix u.Normal = 0 on guide\nfix u.Normal = 0 on first\n",
        ] {
            let found = solved(format!(
                "use \"elasticity\"\nmesh box [1,0] to [2,1] cells [3,8] {shape} map [x*cos(pi/2*y), x*sin(pi/2*y)]\n\
                 def r = sqrt(x*x + y*y)\nregion guide = faces where r < 1.02\nregion first = faces of guide where y < x\n\
                 region second = guide - first\nregion rest = boundary - guide\nunknown u : vector {element}\n\
                 term body on all : work(u, Test_u, 1000, 0.3)\n{held}fix u = 1e-3*[-y,x] on rest\n\
                 measure off = max(Norm(u - 1e-3*[-y,x])) at nodes of all\n"
            ));
            let off = found.measure(0, "off");
            assert!(off < 1e-13, "{element} {shape} {held}: {off:e}");
        }
    }
}

/// In space: a cylinder in two pieces, cut along it and across.
#[test]
fn a_cylinder_in_pieces_turns_about_its_axis() {
    for held in ["guide", "first, second", "low, high"] {
        let found = solved(format!(
            "use \"elasticity\"\nmesh box [1,0,0] to [2,1,1] cells [2,6,2] hex map [x*cos(pi/2*y), x*sin(pi/2*y), z]\n\
             def r = sqrt(x*x + y*y)\nregion guide = faces where r < 1.1\nregion first = faces of guide where y < x\n\
             region second = guide - first\nregion low = faces of guide where z <= 0.5\nregion high = guide - low\n\
             region rest = boundary - guide\nunknown u : vector Q1\nterm body on all : work(u, Test_u, 1000, 0.3)\n\
             fix u.Normal = 0 on {held}\nfix u = 1e-3*[-y,x,0] on rest\n\
             measure off = max(Norm(u - 1e-3*[-y,x,0])) at nodes of all\n"
        ));
        let off = found.measure(0, "off");
        assert!(off < 1e-14, "{held}: {off:e}");
    }
}

/// At a sharp edge a node has the normals of both faces, in one region or two.
#[test]
fn at_a_sharp_edge_both_normals_are_held() {
    let of = |held: &str| {
        solved(format!(
            "use \"elasticity\"\nmesh box [0,0] to [1,1] cells [3,3] quad map [x + 0.3*y, y]\nregion slanted = faces where x == 0.3*y\n\
             region floor = faces where y == 0\nregion corner = slanted + floor\nregion lid = faces where y == 1\n\
             unknown u : vector Q1\nterm body on all : work(u, Test_u, 1000, 0.3)\n{held}load u = [1,-2] on lid\n\
             measure a = value(u(1)) at [1.3,1]\nmeasure b = value(Norm(u)) at [0,0]\n"
        ))
    };
    let one = of("fix u.Normal = 0 on corner\n");
    let two = of("fix u.Normal = 0 on slanted, floor\n");
    assert_near("corner", two.measure(0, "a"), one.measure(0, "a"), 1e-12);
    assert!(one.measure(0, "b") < 1e-15 && two.measure(0, "b") < 1e-15);
}

/// Nodes of a mesh of second order: those between vertices are held and loaded like others where the field has them.
#[test]
fn nodes_between_vertices_are_nodes() {
    let of = |shape: &str, more: &str| {
        let element = if shape == "quad" { "Q2" } else { "P2" };
        solved(format!(
            "mesh box [0,0] to [1,1] cells [4,4] {shape} map [x + 0.2*y*y, y]\nregion tip = nodes where x > 0.99 + 0.2*y*y and y > 0.8\n\
             region side = nodes where x > 0.99 + 0.2*y*y\nregion floor = faces where y == 0\nunknown u : scalar {element}\n\
             term flow on all : Grad_u.Grad_Test_u\nfix u = 0 on floor\n{more}"
        ))
    };
    for shape in ["quad", "tri"] {
        let middle = "measure v = value(u) at [1.153125, 0.875]\n";
        let found = of(shape, &format!("fix u = 1 on tip\n{middle}"));
        assert!((found.measure(0, "v") - 1.0).abs() < 1e-12, "{shape}: {}", found.measure(0, "v"));
        let loaded = of(shape, "load u = 0.5 on side\nmeasure pull = reaction(u) on floor\n");
        // 5 vertices, 4 nodes between them; the lowest is held and carries what it is given
        assert!(
            (loaded.measure(0, "pull").abs() - 4.0).abs() < 1e-9
                || (loaded.measure(0, "pull").abs() - 4.5).abs() < 1e-9,
            "{shape}: {}",
            loaded.measure(0, "pull")
        );
    }
}

/// A rule that measures alone have is told: the term on the same faces has its own.
#[test]
fn a_rule_that_no_term_has_is_told() {
    let more = "quadrature on floor degree 9\nmeasure a = integral(pressure) on floor\n";
    let told = wfl_tests::attempt(&wfl_tests::examples(), pressed("west, east", more), &[], &[]).messages;
    assert!(told.contains("W411") && told.contains("`east`, `west`"), "{told}");
    let told = wfl_tests::attempt(&wfl_tests::examples(), pressed("floor", more), &[], &[]).messages;
    assert!(!told.contains("W411"), "{told}");
}
