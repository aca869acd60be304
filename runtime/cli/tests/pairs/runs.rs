//! Pairs of the codes 6 to 8 that the lines of a page cannot show.

use super::{Pair, scenes::FLOW};

/// A column pressed on a floor with a penalty.
const PRESSED: &str = "mesh box [0,0] to [1,1] cells [2,2] quad\nparam gamma = 1e3\nregion floor = faces where y == 0\n\
    region side = faces where x == 0\nregion top = faces where y == 1\nunknown u : vector\n\
    term bulk on all : 1000*Sym(Grad_u):Grad_Test_u\n\
    term contact on floor : gamma*pos_part(u.Normal)*(Test_u.Normal)\nfix u(1) = 0 on side\nload u = [0,-1] on top\n";

/// One unknown between two kinks: Newton's steps from 1 lead to -1 and back.
const BETWEEN_KINKS: &str = "mesh box [0,0] to [1,1] cells [1,1] quad\nunknown d : scalar global\nstart d = 1\n\
    term law on global : (1.5*d - pos_part(d - 0.5) + pos_part(-d - 0.5) - 0.1*t)*Test_d\n\
    steps t = 0 to 1 by 1 with halve=0\nsolver newton with search=none, max_iter=12\nmeasure m = max(d) on global\n";

/// A p-Laplacian, whose tangent is zero at rest.
const P_LAPLACE: &str = "mesh box [0] to [1] cells [4] segment\nunknown p : scalar\nstart p = 0\n\
    term law on all : Norm_sqr(Grad_p)*(Grad_p.Grad_Test_p) - Test_p\nfix p = 0 on boundary\nmeasure m = max(p) on all\n";

/// A fault that opens at one end and slips at the other; large friction leaves several states.
const WEDGED: &str = "mesh box [-3,0] to [3,4] cells [12,10] quad map [x + (y-2)*0.57735*(1-abs(x)/3), y]\n\
    param gamma = 1e8\nparam fric = 8\nregion left = cells where x < (y-2)*0.57735\n\
    region right = cells where x > (y-2)*0.57735\nregion fault = interface from left to right\n\
    region bottom = faces where y == 0\nregion west = faces where x == -3\nregion east = faces where x == 3\n\
    region top = faces of right where y == 4\nunknown uL : vector on left\nunknown uR : vector on right\n\
    def sigma(v) = 10000*Div_v*Id(2) + 20000*Sym(Grad_v)\ndef jump(a,b) = a - Interpolate(b, neighbor_element)\n\
    def tang(v) = v - (v.Normal)*Normal\ndef Pn = gamma*(jump(uL,uR).Normal)\ndef Pt = gamma*tang(jump(uL,uR))\n\
    term a on left : sigma(uL):Grad_Test_uL\nterm b on right : sigma(uR):Grad_Test_uR\n\
    term contact on fault : (pos_part(Pn)*Normal + Ball_projection(Pt, fric*pos_part(Pn))).jump(Test_uL,Test_uR)\n\
    quadrature on fault vertex\nfix uL, uR = [0,0] on bottom\nfix uL(1) = 0 on west\nload uR = [-3,0] on east\n\
    load uR = [0.7*t,-t] on top\nsteps t = 0 to 4 by 1\n";

/// A number that a spring and friction hold: at the bound of the friction, for P = 2.
const AT_BOUND: &str = "mesh box [0] to [1] cells [1] segment\nparam P = 2\nparam r = 1\nunknown d : scalar global\n\
    term law on global : (d + Ball_projection(d, r) - P)*Test_d\nmeasure moved = max(d) on global\n\
    measure share = mean(if d > 0 then 1 else 0) on global\n";

/// Values at the nodes of [`FLOW`].
const NODES: &str = "x,y,k\n0,0,1\n0.5,0,1\n1,0,1\n0,0.5,1\n0.5,0.5,1\n1,0.5,1\n0,1,1\n0.5,1,1\n1,1,1\n";

/// A square in plane strain, pressed; with nu = -0.3 its first term alone is negative, its body is not.
const STRAINED: &str = "mesh box [0,0] to [1,1] cells [2,2] quad\nparam E = 1000\nparam nu = 0.3\n\
    region west = faces where x == 0\nregion east = faces where x == 1\nunknown u : vector\n\
    term volume on all : E*nu/((1+nu)*(1-2*nu))*Div_u*Div_Test_u\nterm shape on all : E/(1+nu)*Sym(Grad_u):Grad_Test_u\n\
    fix u = [0,0] on west\nload u = [1,0] on east\n";

/// A square on which a bounded friction acts.
const FRICTION: &str = "mesh box [0,0] to [1,1] cells [2,2] quad\nparam s = 0.4\nregion west = faces where x == 0\n\
    region east = faces where x == 1\nunknown u : vector\nterm bulk on all : Sym(Grad_u):Grad_Test_u\n\
    term drag on east : Ball_projection(u, 0 - s).Test_u\nfix u = [0,0] on west\nload u = [1,0] on east\n";

/// A column under `times` its buckling load.
const COLUMN: &str = "param times = 3\nmesh box [0,0] to [0.1,1] cells [1,10] quad\nregion low = faces where y == 0\n\
    region top = faces where y == 1\nunknown u : vector Q2\ndef F = Id(2) + Grad_u\n\
    term body on all : (F*(500*(F'*F - Id(2)))):Grad_Test_u\nfix u = [0,0] on low\n\
    load u = [0, -times*pi^2*1000*0.1^2/48] on top\nmeasure side = mean(u(1)) on top\n";

/// A column of Saint-Venant-Kirchhoff's law pressed to beyond nothing; the uniform state, which is where it starts, solves
/// the equations.
const CRUSHED: &str = "mesh box [0,0] to [1,1] cells [2,2] quad\nunknown u : vector\ndef end = [0, -1.7*y]\n\
    region ends = faces where y == 0 or y == 1\nregion sides = boundary - ends\ndef F = Id(2) + Grad_u\n\
    def E = 0.5*(F'*F - Id(2))\nterm body on all : (F*(10*Trace(E)*Id(2) + 20*E)):Grad_Test_u\n\
    fix u = end on ends\nfix u(1) = 0 on sides\nstart u = end\n";

/// A cylinder pressed on a block by little, at the edge of the first face.
const TOUCHING: &str = "mesh box [0,-5] to [5,0] cells [6,6] quad\nparam gamma = 4e6\nunknown u : vector\n\
    region top = faces where y == 0\nregion base = faces where y == -5\nregion middle = faces where x == 0\n\
    def sigma(v) = 1.15e5*Div_v*Id(2) + 1.54e5*Sym(Grad_v)\n\
    def Pn = gamma*(u.Normal - x^2/100 + 2e-4) - (sigma(u)*Normal).Normal\n\
    term body on all : sigma(u):Grad_Test_u\nterm contact on top : pos_part(Pn)*Test_u.Normal\n\
    fix u = [0,0] on base\nfix u(1) = 0 on middle\n";

/// A block pressed on a rigid parabola by a stiff penalty.
const ROUNDED: &str = "mesh box [0,-1] to [1,0] cells [16,8] quad\nunknown u : vector\nregion top = faces where y == 0\n\
    region base = faces where y == -1\nregion middle = faces where x == 0\nquadrature on top degree 5\n\
    term body on all : 10*Sym(Grad_u):Grad_Test_u\nterm contact on top : 2e4*pos_part(u(2) + 0.5 - x^2)*Test_u(2)\n\
    fix u = [0,0] on base\nfix u(1) = 0 on middle\n";

/// One block dragged over another and back, with friction on the total slip.
const DRAGGED: &str = "mesh box [-1,0] to [1,1] cells [4,2] quad\nparam gamma = 1e4\nregion left = cells where x < 0\n\
    region right = cells where x > 0\nregion fault = interface from left to right\nregion west = faces where x == -1\n\
    region east = faces where x == 1\nunknown uL : vector on left\nunknown uR : vector on right\n\
    def sigma(v) = 1000*Sym(Grad_v)\ndef jump(a,b) = a - Interpolate(b, neighbor_element)\n\
    def tang(v) = v - (v.Normal)*Normal\ndef Pn = gamma*(jump(uL,uR).Normal) - (sigma(uL)*Normal).Normal\n\
    def slid = jump(uL,uR)\ndef Pt = gamma*tang(slid) - tang(sigma(uL)*Normal)\n\
    term a on left : sigma(uL):Grad_Test_uL\nterm b on right : sigma(uR):Grad_Test_uR\n\
    term contact on fault : (pos_part(Pn)*Normal + Ball_projection(Pt, 0.2*pos_part(Pn))).jump(Test_uL,Test_uR)\n\
    fix uL = [0,0] on west\nfix uR = [-0.01, 0.05*sin(pi*t)] on east\nsteps t = 0 to 1 by 0.125\n";

/// A flat punch that a force drives into a block.
const DRIVEN_PUNCH: &str = "mesh box [0,0] to [1,1] cells [2,2] quad\nparam P = 1\nregion base = faces where y == 0\n\
    region top = faces where y == 1\nunknown u : vector\nunknown d : scalar global\nstart d = 0.001\n\
    term bulk on all : 1000*Sym(Grad_u):Grad_Test_u\n\
    term contact on top : 1e4*pos_part(u.Normal + d)*(Test_u.Normal + Test_d)\n\
    term weight on global : P*Test_d\nfix u = [0,0] on base\nmeasure depth = mean(d) on global\n";

/// Two blocks glued together.
const GLUED: &str = "mesh box [-1,0] to [1,1] cells [4,2] quad\nregion left = cells where x < 0\n\
    region right = cells where x > 0\nregion fault = interface from left to right\nregion west = faces where x == -1\n\
    region east = faces where x == 1\nunknown uL : vector on left\nunknown uR : vector on right\n\
    def sigma(v) = 1000*Sym(Grad_v)\ndef jump(a,b) = a - Interpolate(b, neighbor_element)\n\
    term a on left : sigma(uL):Grad_Test_uL\nterm b on right : sigma(uR):Grad_Test_uR\n\
    term cohesion on fault : 100*jump(uL,uR).(-jump(Test_uL,Test_uR))\n\
    fix uL = [0,0] on west\nfix uR = [0.01,0] on east\n";

/// Two blocks with contact by a multiplier.
const TRACTION: &str = "use \"contact\"\nmesh box [-1,0] to [1,1] cells [4,2] quad\nregion left = cells where x < 0\n\
    region right = cells where x > 0\nregion fault = interface from left to right\nregion west = faces where x == -1\n\
    region east = faces where x == 1\nunknown uL : vector on left\nunknown uR : vector on right\n\
    unknown l : vector on fault\ndef sigma(v) = 1000*Sym(Grad_v)\n\
    term a on left : sigma(uL):Grad_Test_uL\nterm b on right : sigma(uR):Grad_Test_uR\n\
    term contact on fault : augmented(uL, uR, l, 1000, 0.3)\nfix uL = [0,0] on west\nfix uR = [-0.01,0] on east\n";

/// A block that friction holds on a floor below its bound, under constant loads.
const HELD: &str = "mesh box [0,0] to [1,1] cells [4,4] quad\nparam gamma = 2e4\nregion floor = faces where y == 0\n\
    region top = faces where y == 1\nregion side = faces where x == 0\nunknown u : vector\ndef sig(v) = 1000*Sym(Grad_v)\n\
    def tang(w) = w - (w.Normal)*Normal\ndef Pn = gamma*(u.Normal) - (sig(u)*Normal).Normal\n\
    def Pt = gamma*tang(u - Previous_u) - tang(sig(u)*Normal)\ndef q = Ball_projection(Pt, 0.3*pos_part(Pn))\n\
    term body on all : sig(u):Grad_Test_u\nterm contact on floor : (pos_part(Pn)*Normal + q).Test_u\n\
    load u = [0,-1.6*min(t,1)] on top\nload u = [0.4*max(min(t-1,1),0),0] on side\nsteps t = 0 to 8 by 0.1\n";

/// A block pushed along another one by more than a face of it.
const PUSHED: &str = "mesh box [0,-1] to [1,1] cells [4,8] quad\nparam push = 0.6\nregion low = cells where y < 0\n\
    region up = cells where y > 0\nregion face = interface from up to low\nregion base = faces where y == -1\n\
    region top = faces where y == 1\nunknown u : vector on up\nunknown v : vector on low\ndef sig(w) = 1000*Sym(Grad_w)\n\
    def over = (u - Interpolate(v, neighbor_element)).Normal\nterm a on up : sig(u):Grad_Test_u\n\
    term b on low : sig(v):Grad_Test_v\n\
    term contact on face : 1e5*pos_part(over)*((Test_u - Interpolate(Test_v, neighbor_element)).Normal)\n\
    fix u = [push*t, -0.001] on top\nfix v = [0,0] on base\nsteps t = 0 to 1 by 0.5\n";

/// A block that is pushed along another one, and over its edge.
const OVER_THE_EDGE: &str = "mesh box [0,0] to [4,2] cells [4,2] quad with idle_cells=allowed\nparam push = 1.5\n\
    region low = cells where y < 1\nregion up = cells where y > 1 and x > 2\nregion sole = faces of up where y == 1\n\
    region floor = faces of low where y == 1\nregion base = faces where y == 0\nregion top = faces of up where y == 2\n\
    unknown u : vector on up\nunknown v : vector on low\n\
    def P(g) = 0.4*((Id(2) + g) - Inv(Id(2) + g)') + 0.5*log(Det(Id(2) + g))*Inv(Id(2) + g)'\n\
    term a on up : P(Grad_u):Grad_Test_u\nterm b on low : P(Grad_v):Grad_Test_v\n\
    mapping m = raytrace from sole onto floor moving with u, v within 0.3\n\
    def n = Transformed_unit_vector(Grad_u, Normal)\ndef gap = (Interpolate(X, m) + Interpolate(v, m) - X - u).n\n\
    term contact on sole : 20*pos_part(-gap)*(n.(Test_u - Interpolate(Test_v, m)))\n\
    fix u = [push*max(0, t - 1), -0.02*min(t, 1)] on top\nfix v = [0,0] on base\nsteps t = 0 to 2 by 0.5\n";

/// A square whose shear stress is that of twice the shear: C11 - C12 = 4.
const SHEARED: &str = "mesh box [0,0] to [1,1] cells [2,2] quad\nregion west = faces where x == 0\n\
    region east = faces where x == 1\nunknown u : vector\ndef s(g) = 4*(g(1,2) + g(2,1))\n\
    term body on all : [5*Grad_u(1,1) + Grad_u(2,2), s(Grad_u); s(Grad_u), 5*Grad_u(2,2) + Grad_u(1,1)]:Grad_Test_u\n\
    fix u = [0,0] on west\nload u = [1,0] on east\n";

/// Two blocks that are apart, in contact through a mapping.
const APART: &str = "mesh box [0,0] to [3,1] cells [3,2] quad with idle_cells=allowed\nregion left = cells where x < 1\n\
    region right = cells where x > 2\nregion near = faces of left where x == 1\nregion far = faces of right where x == 2\n\
    region west = faces where x == 0\nregion east = faces where x == 3\nunknown a : vector on left\n\
    unknown b : vector on right\nmapping m = project from near onto far\nterm s on left : 1000*Sym(Grad_a):Grad_Test_a\n\
    term t on right : 1000*Sym(Grad_b):Grad_Test_b\ndef gap = (X - Interpolate(X, m)).Normal\n\
    term contact on near : 1e4*pos_part((a - Interpolate(b, m)).Normal - gap)*((Test_a - Interpolate(Test_b, m)).Normal)\n\
    fix a = [0,0] on west\nfix b = [-1.1,0] on east\n";

/// A square with units under a load.
const PULLED: &str = "mesh box [0,0] to [1,1] cells [2,2] quad\nparam E = 1000 [MPa]\nparam q = 1e3 [MPa]\n\
    region west = faces where x == 0\nregion east = faces where x == 1\nunknown u : vector [mm]\n\
    term body on all : E*Sym(Grad_u):Grad_Test_u\nfix u = [0,0] on west\nload u = [q,0] on east\n";

/// A rigid circle over a block.
const OVER: &str = "mesh box [0,0] to [1,1] cells [10,10] quad\nregion base = faces where y == 0\nregion top = faces where y == 1\n\
    unknown u : vector\nparam d = 0.01\nterm body on all : (577*Div_u*Id(2) + 769*Sym(Grad_u)):Grad_Test_u\n\
    fix u = [0,0] on base\ndef gap = x^2/4 + d\nterm contact on top : 1e5*pos_part(u.Normal - gap)*(Test_u.Normal)\n";

/// A plate that is heated, with a rate of the wrong sign.
const HEATED: &str = "mesh box [0,0] to [1,1] cells [4,4] quad\nregion west = faces where x == 0\nunknown T : scalar\n\
    term heat on all : -Dot_T*Test_T + Grad_T.Grad_Test_T\nload T = 1 on all\nfix T = 0 on west\nsteps t = 0 to 2 by 0.05\n";

/// A crack of one face inside a body that is pressed together all around.
const SHORT_CRACK: &str = "mesh box [-1.5,-1] to [1.5,1] cells [12,12] quad\nregion below = cells where y < 0\n\
    region above = cells where y > 0\n\
    region crack = interface from below to above & faces of below where y == 0 and x > -0.01 and x < 0.26\n\
    unknown u : vector Q2\nsplit u across crack\nmultiplier l : scalar Q1 on crack\n\
    def jump(a) = a - Interpolate(a, neighbor_element)\nterm elastic on all : 1000*Sym(Grad_u):Grad_Test_u\n\
    term couple on crack : l*(jump(Test_u).Normal) + (jump(u).Normal)*Test_l\nfix u = [-1e-3*x,-1e-3*y] on boundary\n\
    measure m = max(l) on crack\n";

/// A slender beam of one cell across.
const BEAM: &str = "mesh box [0,0] to [10,0.1] cells [10,1] quad\nregion west = faces where x == 0\n\
    region east = faces where x == 10\nunknown u : vector\nterm body on all : (577*Div_u*Id(2) + 769*Sym(Grad_u)):Grad_Test_u\n\
    fix u = [0,0] on west\nload u = [0,1e-6] on east\n";

/// A column of a porous body, loaded at once and drained at its top.
const SOAKED: &str = "mesh box [0,0] to [0.1,1] cells [1,10] quad\nregion top = faces where y == 1\n\
    region base = faces where y == 0\nregion sides = faces where x == 0 or x == 0.1\nunknown u : vector Q2\nunknown p : scalar\n\
    term body on all : Sym(Grad_u):Grad_Test_u - p*Div_Test_u\nterm fluid on all : Div_Dot_u*Test_p + Grad_p.Grad_Test_p\n\
    load u = [0,-1] on top\nfix u(1) = 0 on sides\nfix u(2) = 0 on base\nfix p = 0 on top\nsteps t = 0 to 3e-5 by 1e-5\n";

/// The scene with more lines.
fn flow(lines: &str) -> String {
    format!("{FLOW}{lines}\n")
}

/// Pairs by code.
pub(crate) fn pairs() -> Vec<Pair> {
    errors().into_iter().chain(warnings()).collect()
}

fn errors() -> Vec<Pair> {
    vec![
        Pair::new("E470", AT_BOUND)
            .command("run scene.wfl --gradient share --with P")
            .near("if d > 0 then 1 else 0", "pos_part(d)"),
        Pair::new("E601", flow("term law on all : log(p - 5)*Test_p")).near("log(p - 5)", "log(p + 5)"),
        Pair::new("E602", FLOW.replace("fix p = 0", "load p = 0")).near("load p = 0", "fix p = 0"),
        Pair::new("E603", flow("term law on all : p^3*Test_p\nsolver newton with max_iter=1"))
            .near("iter=1", "iter=20"),
        Pair::new("E604", flow("expect top < 0")).near("top < 0", "top > 0"),
        Pair::new("E605", flow("term base on all : 100*p*Test_p"))
            .command("run scene.wfl --accuracy 1e-8 --of H1 --budget 0.01")
            .near("1e-8 --of H1 --budget 0.01", "1e-1 --of H1"),
        Pair::new("E610", FLOW.replace("fix p = 0", "fix p = log(x - 1)")).near("log(x - 1)", "log(x + 1)"),
        Pair::new("E611", flow("measure m = mean(1/x) on west")).near("1/x", "1/(1 + x)"),
        Pair::new("E612", FLOW.replace("fix p = 0", "fix p = 1.5e308")).near("1.5e308", "1.5e3"),
        Pair::new("E613", DRIVEN_PUNCH).near("term weight on global : P", "term weight on global : -P"),
        Pair::new("E614", GLUED).near("(-jump(Test_uL,Test_uR))", "(jump(Test_uL,Test_uR))"),
        Pair::new("E701", flow("param k = 1 in 0..2\nload p = k on all"))
            .command("run scene.wfl k=3")
            .near("k=3", "k=2"),
        Pair::new("E703", flow("param k = 1 in 0..2\nload p = k on all"))
            .command("run scene.wfl kk=2")
            .near("kk=2", "k=2"),
        Pair::new("E712", FLOW)
            .file("o/report.json", "mine")
            .command("run scene.wfl --out o")
            .near("--out o", "--out p"),
        Pair::new("E713", flow("param k = 1\nload p = k on all"))
            .before("run scene.wfl --out o")
            .command("sweep scene.wfl k=1 --reference none --out o")
            .near("--out o", "--out p"),
        Pair::new("E714", flow("param k = 1\nload p = k on all"))
            .before("run scene.wfl --out o")
            .command("run scene.wfl k=2 --out o --resume")
            .near("k=2", "k=1"),
        Pair::new("E715", FLOW)
            .file("o/manifest.json", "{\"wfl_manifest\":0,\"kind\":\"run\"}\n")
            .command("run scene.wfl --out o")
            .near("--out o", "--out p"),
        Pair::new(
            "E716",
            flow("data k : scalar = \"k.csv\"\nload p = k on all\noutput csv \"k\" : p along [0,0.5] to [1,0.5]"),
        )
        .file("k.csv", NODES)
        .command("run scene.wfl --out .")
        .near("--out .", "--out p"),
        Pair::new("E717", FLOW).command("run scene.wfl --out scene.wfl/o").near("scene.wfl/o", "o"),
    ]
}

/// Friction that sticks within less than numbers at 10 are apart.
const NARROW: &str = "mesh box [0] to [1] cells [1] segment with idle_cells=allowed\nunknown u : scalar global\nstart u = 10\n\
                      term law on global : (0.3*tanh(Dot_u/1e-16) + Dot_u - 0.15)*Test_u\nsteps t = 0 to 2 by 1\n";

fn warnings() -> Vec<Pair> {
    vec![
        Pair::new("W512", flow("load p = 1/(1 - x) on all")).near("1/(1 - x)", "1/(2 - x)"),
        Pair::new("W513", STRAINED.replace("nu = 0.3", "nu = 0.4999"))
            .near("unknown u : vector", "unknown u : vector Q2"),
        Pair::new("W520", ROUNDED).near("quadrature on top degree 5\n", ""),
        Pair::new("W514", STRAINED.replace("Sym(Grad_u)", "Grad_u")).near("*Grad_u:", "*Sym(Grad_u):"),
        Pair::new("W515", SHEARED).near("4*(", "2*("),
        Pair::new("W518", TRACTION).near("unknown l :", "multiplier l :"),
        Pair::new("W517", APART).near("(X - Interpolate(X, m))", "(Interpolate(X, m) - X)"),
        Pair::new("W519", flow("data k : scalar = if x < 0.5 then 1 else 10\nterm more on all : k*Grad_p.Grad_Test_p"))
            .near("k : scalar =", "k : scalar DP0 ="),
        Pair::new("W602", BETWEEN_KINKS).near("search=none", "search=auto"),
        Pair::new("W605", NARROW).near("1e-16", "1e-6"),
        Pair::new("W606", PRESSED).near("gamma = 1e3", "gamma = 1e7"),
        Pair::new("W607", P_LAPLACE).near("start p = 0", "start p = 0.1*x*(1-x)"),
        Pair::new("W609", WEDGED).near("fric = 8", "fric = 0.4"),
        Pair::new("W610", flow("output csv \"line\" : 1/x as q along [0,0] to [1,0]")).near("1/x", "1/(1 + x)"),
        Pair::new("W611", STRAINED.replace("nu = 0.3", "nu = 1.3")).near("nu = 1.3", "nu = -0.3"),
        Pair::new("W612", FRICTION).near("Ball_projection(u, 0 - s)", "Ball_projection(u, s)"),
        Pair::new("W615", DRAGGED).near(
            "gamma*tang(slid) - tang(sigma(uL)*Normal)",
            "gamma*(tang(slid) - Previous_s) - tang(sigma(uL)*Normal)\nstate s : vector on fault := \
             Previous_s + (Pt - Ball_projection(Pt, 0.2*pos_part(Pn)))/gamma",
        ),
        Pair::new("W616", CRUSHED).near("-1.7*y", "-0.7*y"),
        Pair::new("W617", TOUCHING).near("cells [6,6]", "cells [200,6]"),
        Pair::new(
            "W618",
            "mesh box [0,0] to [1,1] cells [1,1] quad\nunknown u : scalar\nterm on all : (Dot_u + u - t)*Test_u\n\
             steps t = 0 to 1 by auto with first=0.2, least=0.2, error=1e-6\nmeasure m = max(u) on all\n",
        )
        .near("least=0.2", "least=1e-9"),
        Pair::new(
            "W619",
            "mesh box [0,0] to [1,1] cells [1,1] quad\nunknown u : scalar\nterm on all : (Dot_u + u - t)*Test_u\n\
             steps t = 0 to 1 by auto with first=1e-3, error=1e-2, limit=0.5/log(max(u)) on all\n\
             measure m = max(u) on all\n",
        )
        .near("log(max(u))", "(1 + max(u))"),
        Pair::new(
            "W620",
            "mesh box [0] to [1] cells [4] segment\nunknown u : scalar\nterm inertia on all : Dot2_u*Test_u\n\
             term stress on all : Grad_u.Grad_Test_u\nstart Dot_u = x\nscheme backward_euler energy\n\
             steps t = 0 to 2 by 0.1\nmeasure m = max(u) on all\n",
        )
        .near("backward_euler", "newmark"),
        Pair::new("W630", HELD).near(
            "gamma*tang(u - Previous_u) - tang(sig(u)*Normal)\ndef q = Ball_projection(Pt, 0.3*pos_part(Pn))",
            "gamma*(tang(u) - Previous_s) - tang(sig(u)*Normal)\ndef q = Ball_projection(Pt, 0.3*pos_part(Pn))\n\
             state s : vector on floor := Previous_s + (Pt - q)/gamma",
        ),
        Pair::new("W631", PUSHED).near("push = 0.6", "push = 0.2"),
        Pair::new("W632", OVER_THE_EDGE).near("push = 1.5", "push = -0.2"),
        Pair::new(
            "W670",
            OVER_THE_EDGE.replace("push = 1.5", "push = -0.2").replace("20*pos", "0.1*pos").replace("0.3", "0.01"),
        )
        .near("within 0.01", "within 0.3"),
        Pair::new(
            "W621",
            "mesh box [0] to [1] cells [4] segment\nregion wall = faces where x == 0\nunknown u : scalar\n\
             start u = 0.1\nstart Dot_u = -1\nterm inertia on all : Dot2_u*Test_u\n\
             term stress on all : Grad_u.Grad_Test_u\nterm contact on wall : -1000*neg_part(u)*Test_u\n\
             scheme explicit fraction=0.9\nsteps t = 0 to 2 by auto\nmeasure m = max(u) on all\n",
        )
        .near("fraction=0.9", "fraction=0.05"),
        Pair::new(
            "W650",
            "mesh box [0] to [1] cells [8] segment\nregion left = faces where x == 0\nunknown p : scalar\n\
             term flow on all : (1 + p^2)*Grad_p.Grad_Test_p\nload p = 3 on all\nfix p = 0 on left\n\
             solver newton with tol=1e-2\nbalance water of p\n",
        )
        .near("tol=1e-2", "tol=1e-12"),
        Pair::new("W640", COLUMN).near("times = 3", "times = 0.5"),
        Pair::new(
            "W641",
            "mesh box [0] to [1] cells [1] segment\nunknown d : scalar global\nsteps t = 0 to 4 by 1\n\
             param most = 120\nterm law on global : (exp(d) - 1 - most*pos_part(1 - abs(t - 2)))*Test_d\n\
             solver newton with search=none\nmeasure reached = mean(d) on all\n",
        )
        .near("most = 120", "most = 3"),
        Pair::new("W645", PULLED).near("q = 1e3", "q = 1"),
        Pair::new("W646", OVER).near("+ d", "- d"),
        Pair::new("W647", HEATED).near("-Dot_T", "Dot_T"),
        Pair::new("W648", BEAM).near("unknown u : vector", "unknown u : vector Q2"),
        Pair::new("W649", SOAKED).near("3e-5 by 1e-5", "0.15 by 0.05"),
        Pair::new(
            "W651",
            "mesh box [0] to [1] cells [1] segment\nunknown d : scalar global\nsteps t = 0 to 2 by 1\n\
             term law on global : (exp(d) - 1 - 100*t)*Test_d\nsolver newton with max_iter=5\n\
             measure change = mean(d - Previous_d) on all\n",
        )
        .near("max_iter=5", "max_iter=20"),
        Pair::new(
            "W652",
            "mesh box [0] to [1] cells [20] segment\nregion left = faces where x == 0\nunknown T : scalar\n\
             term heat on all : Dot_T*Test_T + 10*Grad_T.Grad_Test_T\nload T = 1 on all\nfix T = 1 on left\n\
             scheme newmark\nsteps t = 0 to 1 by 0.1\n",
        )
        .near("scheme newmark", "scheme bdf2"),
        Pair::new("W660", AT_BOUND).command("run scene.wfl --gradient moved --with P").near("r = 1\n", "r = 0.5\n"),
        Pair::new("W680", SHORT_CRACK).near("x < 0.26", "x < 0.51"),
        Pair::new("W702", flow("param k = 1")).near("param k = 1", "param k = 1\nload p = k on all"),
    ]
}
