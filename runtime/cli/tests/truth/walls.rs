//! Several rigid walls that one skin may meet: each is a law of contact of its own.

use super::{Ran, run};

/// No word but of a zone that is as small as the faces, and of cells that do not bend.
fn right(ran: &Ran) -> bool {
    ran.codes().iter().all(|code| ["W617", "W648"].contains(code))
}

/// A disc in a groove of two planes with these normals, each a term on the whole skin.
fn groove(half: f64, laws: &str) -> String {
    format!(
        "use \"elasticity\"\nparam h = {half}\nparam gamma = 1e9\nparam gap = 0.001\n\
         mesh box [-1,-1] to [1,1] cells [12,12] quad map [x*sqrt(1-y^2/2), y*sqrt(1-x^2/2)]\nregion skin = faces of all\n\
         unknown u : vector\nterm el on all : work(u,Test_u,1e7,0.3)\ndef n1 = [cos(h),sin(h)]\ndef n2 = [-cos(h),sin(h)]\n\
         def P1 = gamma*pos_part(-(X+u).n1 - 1 - gap)\ndef P2 = gamma*pos_part(-(X+u).n2 - 1 - gap)\n{laws}\
         start u = [0,-0.015]\nload u = [0,-1e4] on all\nregion cc = nodes where abs(x) < 1e-9 and y > 0.99\nfix u(1) = 0 on cc\n\
         measure N1 = integral(P1) on skin\nmeasure N2 = integral(P2) on skin\nmeasure W = 1e4*integral(1) on all\n"
    )
}

#[test]
fn a_body_in_a_groove_of_two_walls_has_two_laws_that_are_right() {
    let two = "term c1 on skin : -P1*(Test_u.n1)\nterm c2 on skin : -P2*(Test_u.n2)\n";
    let one = "term c on skin : -P1*(Test_u.n1) - P2*(Test_u.n2)\n";
    for half in [0.35, 0.8, 1.2] {
        for (k, laws) in [two, one].into_iter().enumerate() {
            let ran = run(&format!("groove-{half}-{k}"), &groove(half, laws), &[]);
            assert!(ran.code == 0 && right(&ran), "{half}: {}", ran.text);
            let [first, second, weight] = ["N1", "N2", "W"].map(|name| ran.last(name));
            let each = weight / (2.0 * f64::sin(half));
            assert!((first / each - 1.0).abs() < 1e-3 && (second / each - 1.0).abs() < 1e-3, "{half}: {first} {each}");
        }
    }
    for (k, laws) in [
        "term c1 on skin : P1*(Test_u.n1)\nterm c2 on skin : P2*(Test_u.n2)\n",
        "term c on skin : P1*(Test_u.n1) + P2*(Test_u.n2)\n",
    ]
    .into_iter()
    .enumerate()
    {
        let ran = run(&format!("groove-wrong-{k}"), &groove(0.8, laws), &[]);
        assert!(!ran.codes().is_empty(), "{}", ran.text);
    }
}

/// A disc between a floor, two side walls and a lid that do not touch it in the same places.
#[test]
fn a_body_in_a_container_has_laws_that_are_right() {
    let scene = |contact: &str| {
        format!(
            "use \"elasticity\"\nparam gamma = 1e5\nmesh box [-1,-1] to [1,1] cells [8,8] quad map [x*sqrt(1-y^2/2), y*sqrt(1-x^2/2)]\n\
             region skin = boundary\nregion top = faces where y > 0.7\nunknown u : vector\n\
             def Pf = gamma*pos_part(-(y + u(2)) - 1)\ndef Pl = gamma*pos_part(-(x + u(1)) - 1)\n\
             def Pr = gamma*pos_part((x + u(1)) - 1)\nterm el on all : work(u, Test_u, 1000, 0.3)\n{contact}\
             fix u = [0,-0.1] on top\nmeasure Nf = integral(Pf) on skin\nmeasure Nl = integral(Pl) on skin\n\
             measure Nr = integral(Pr) on skin\nmeasure R = reaction(u(2)) on top\n"
        )
    };
    for (k, contact) in [
        "term c on skin : -Pf*Test_u(2) - Pl*Test_u(1) + Pr*Test_u(1)\n",
        "term c on skin : Pr*Test_u(1) - Pl*Test_u(1) - Pf*Test_u(2)\n",
        "term f on skin : -Pf*Test_u(2)\nterm l on skin : -Pl*Test_u(1)\nterm r on skin : Pr*Test_u(1)\n",
    ]
    .into_iter()
    .enumerate()
    {
        let ran = run(&format!("container-{k}"), &scene(contact), &[]);
        assert!(ran.code == 0 && right(&ran), "{contact}: {}", ran.text);
        let [floor, left, right, held] = ["Nf", "Nl", "Nr", "R"].map(|name| ran.last(name));
        assert!((floor - held).abs() < 1e-6 * floor && (left / right - 1.0).abs() < 1e-6, "{}", ran.text);
    }
    // of one wall alone the sides are mixed up
    let wrong = "term c on skin : -Pf*Test_u(1) - Pl*Test_u(2)\n";
    assert!(!run("container-wrong", &scene(wrong), &[]).codes().is_empty());
}
