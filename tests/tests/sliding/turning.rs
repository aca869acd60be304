//! Bodies that slide over each other while both turn: what one who turns with them sees is what it is without the turn.

use wfl_tests::{examples, solve};

/// The force of friction on a cube that is dragged over another one along e2, seen from axes that turn about the normal or a tangent
/// of the faces.
fn force(law: [&str; 3], axis: usize, turn: f64, by: f64) -> [f64; 3] {
    let [mapping, elastic, friction] = law;
    let turned = match axis {
        1 => "[1,0,0; 0,cos(om),-sin(om); 0,sin(om),cos(om)]",
        _ => "[cos(om),0,sin(om); 0,1,0; -sin(om),0,cos(om)]",
    };
    let text = format!(
        "use \"sliding\"\nmesh box [-1,0,0] to [1,1,1] cells [2,2,2] hex\nregion lo = cells where x < 0\nregion up = cells where x > 0\n\
         region sa = faces of lo where x == 0\nregion sb = faces of up where x == 0\n\
         region oa = faces of lo where x == -1\nregion ob = faces of up where x == 1\n\
         unknown a : vector on lo\nunknown b : vector on up\n\
         def P(g) = 400*((Id(3)+g) - Inv(Id(3)+g)') + 600*log(Det(Id(3)+g))*Inv(Id(3)+g)'\n\
         mapping m = {mapping} from sb onto sa moving with b, a within 0.3\n\
         state elastic : vector on sb := {elastic}(b, a, m, elastic, 5e3, 0.3)\n\
         term ea on lo : P(Grad_a):Grad_Test_a\nterm eb on up : P(Grad_b):Grad_Test_b\n\
         term c on sb : {friction}_friction(b, a, m, elastic, 5e3, 0.3)\n\
         def om = {turn}*t\ndef W = {turned}\n\
         fix a = W*X - X on oa\nfix b = W*(X + [-0.01*min(t, 1), 0.05*t, 0]) - X on ob\n\
         steps t = 0 to 2 by {by}\n\
         measure f1 = integral({friction}_force(b, a, m, elastic, 5e3, 0.3).(W*[1,0,0])) on sb\n\
         measure f2 = integral({friction}_force(b, a, m, elastic, 5e3, 0.3).(W*[0,1,0])) on sb\n\
         measure f3 = integral({friction}_force(b, a, m, elastic, 5e3, 0.3).(W*[0,0,1])) on sb\n"
    );
    let solved = solve(&examples(), text, &[], &[]).unwrap_or_else(|messages| panic!("{messages}"));
    let last = solved.outcome.steps.len() - 1;
    ["f1", "f2", "f3"].map(|name| solved.measure(last, name))
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn friction_turns_with_the_bodies() {
    for law in [["raytrace", "sliding_elastic", "sliding"], ["project", "closest_elastic", "closest"]] {
        let still = force(law, 1, 0.0, 0.5);
        assert!(still[1].abs() > 0.25 * still[0].abs() && still[2].abs() < 1e-6 * still[0].abs(), "{still:?}");
        for (axis, turn) in [(1, 0.4), (2, 0.4), (1, -1.1)] {
            let seen = force(law, axis, turn, 0.5);
            let apart = (0..3).fold(0.0f64, |m, k| m.max((seen[k] - still[k]).abs()));
            assert!(apart < 1e-6 * still[0].abs(), "{law:?} {axis} {turn}: {seen:?} {still:?}");
        }
    }
}
