//! Pairs of the codes 1 to 5 that the lines of a page cannot show.

use super::Pair;

/// A flow between two ends.
pub(crate) const FLOW: &str = "mesh box [0,0] to [1,1] cells [2,2] quad\nregion west = faces where x == 0\n\
    region east = faces where x == 1\nunknown p : scalar\nterm flow on all : Grad_p.Grad_Test_p\n\
    fix p = 0 on west\nload p = 1 on east\nmeasure top = max(p) on all\n";

const MESH: &str = "mesh box [0,0] to [1,1] cells [2,2] quad\n";
const TERM: &str = "term flow on all : Grad_p.Grad_Test_p\n";

/// What makes the matrix of a flow unsymmetric.
const WIND: &str = "term wind on all : [1,0].Grad_p*Test_p\n";
const ITERATION: &str = "solver linear with cg, amg\n";

/// Two squares side by side, from Gmsh: `left` and `right`, the lines `west`, `east` and `seam`.
pub(crate) const PLATE: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n5\n1 1 \"west\"\n1 2 \"east\"\n1 3 \"seam\"\n\
    2 4 \"left\"\n2 5 \"right\"\n$EndPhysicalNames\n$Nodes\n6\n1 0 0 0\n2 1 0 0\n3 2 0 0\n4 0 1 0\n5 1 1 0\n6 2 1 0\n\
    $EndNodes\n$Elements\n5\n1 1 2 1 1 4 1\n2 1 2 2 2 3 6\n3 1 2 3 3 2 5\n4 3 2 4 4 1 2 5 4\n5 3 2 5 5 2 3 6 5\n\
    $EndElements\n";

/// The same with two nodes for one place: the squares hang together at one node only.
fn torn() -> String {
    PLATE.replace("$Nodes\n6", "$Nodes\n7").replace("6 2 1 0", "6 2 1 0\n7 1 1 0").replace("2 3 6 5\n", "2 3 6 7\n")
}

/// The square on the right is divided, that on the left is not.
fn divided() -> String {
    let nodes = PLATE.replace("$Nodes\n6", "$Nodes\n8").replace("6 2 1 0", "6 2 1 0\n7 1 0.5 0\n8 2 0.5 0");
    let cells = nodes.replace("$Elements\n5", "$Elements\n6").replace("2 3 6 5\n", "2 3 8 7\n6 3 2 5 5 7 8 6 5\n");
    cells.replace("2 2 2 3 6\n", "2 2 2 3 8\n")
}

/// The flow through that plate.
pub(crate) const ON_PLATE: &str = "mesh file \"plate.msh\"\nunknown p : scalar\nterm flow on all : Grad_p.Grad_Test_p\n\
    fix p = 0 on west\nload p = 1 on east\nmeasure top = max(p) on all\n";

/// Two blocks with Nitsche's method between them.
const NITSCHE: &str = "mesh box [0,0] to [2,1] cells [2,1] quad\nparam gamma = 1e4\nregion left = cells where x < 1\n\
    region right = cells where x > 1\nregion fault = interface from left to right\nregion west = faces where x == 0\n\
    region east = faces where x == 2\nunknown uL : vector on left\nunknown uR : vector on right\n\
    def sigma(v) = 1000*Sym(Grad_v)\ndef trac(v) = sigma(v)*Normal\ndef jump(a,b) = a - Interpolate(b, neighbor_element)\n\
    term a on left : sigma(uL):Grad_Test_uL\nterm b on right : sigma(uR):Grad_Test_uR\n\
    def P(a,b,v) = gamma*(jump(a,b).Normal) - trac(v).Normal\n\
    term stress on fault : -1/gamma*(trac(uL).Normal)*(trac(Test_uL).Normal)\n\
    term contact on fault : 1/gamma*pos_part(P(uL,uR,uL))*P(Test_uL,Test_uR,Test_uL)\n\
    term hold on fault : 1000*(jump(uL,uR) - (jump(uL,uR).Normal)*Normal).jump(Test_uL,Test_uR)\n\
    fix uL = [0,0] on west\nfix uR = [-1e-3,0] on east\n";

/// Two blocks and a multiplier between them, all held at the bottom.
const MULTIPLIER: &str = "mesh box [0,0] to [2,2] cells [2,2] quad\nregion left = cells where x < 1\n\
    region right = cells where x > 1\nregion fault = interface from left to right\nregion bottom = faces where y == 0\n\
    unknown uL : vector on left\nunknown uR : vector on right\nmultiplier l : vector on fault\n\
    def jump(a,b) = a - Interpolate(b, neighbor_element)\nterm a on left : Grad_uL:Grad_Test_uL\n\
    term b on right : Grad_uR:Grad_Test_uR\nterm tie on fault : l.jump(Test_uL,Test_uR) + jump(uL,uR).Test_l\n\
    fix uL, uR = [0,0] on bottom\nload uL = [0,1] on left\n";

/// One multiplier on a surface that branches, and one for each of its surfaces.
fn tee() -> Pair {
    Pair::new("W424", TEE)
        .near("multiplier m : scalar on s", "multiplier m : scalar on low\nmultiplier n : scalar on up")
        .near("term tie on s : m*", "term top on up : n*J(Test_u) + Test_n*J(u)\nterm tie on low : m*")
}

/// A square cut in three by a surface that branches, tied by one multiplier.
const TEE: &str = "mesh box [0,0] to [2,2] cells [4,4] quad\nregion a = cells where y > 1\n\
    region b = cells where x < 1 and y < 1\nregion c = cells where x > 1 and y < 1\nregion under = b + c\n\
    region up = interface from under to a\nregion low = interface from b to c\nregion tee = low + up\n\
    region s = interface along tee\nregion west = faces where x == 0\nunknown u : scalar\nsplit u across s\n\
    multiplier m : scalar on s\ndef J(v) = v - Interpolate(v, neighbor_element)\n\
    term body on all : Grad_u.Grad_Test_u\nterm tie on s : m*J(Test_u) + Test_m*J(u)\nfix u = y on west\n\
    load u = 1 on all\n";

/// Two blocks pressed together, their pressure a multiplier with the wrong sign in its law.
const TOUCHING: &str = "mesh box [0,0] to [2,1] cells [2,1] quad\nparam gamma = 1e4\nregion left = cells where x < 1\n\
    region right = cells where x > 1\nregion fault = interface from left to right\nregion west = faces where x == 0\n\
    region east = faces where x == 2\nunknown uL : vector on left\nunknown uR : vector on right\n\
    multiplier l : scalar on fault\ndef gap = (uL - Interpolate(uR, neighbor_element)).Normal\n\
    term a on left : 1000*Sym(Grad_uL):Grad_Test_uL\nterm b on right : 1000*Sym(Grad_uR):Grad_Test_uR\n\
    term push on fault : -l*((Test_uL - Interpolate(Test_uR, neighbor_element)).Normal)\n\
    term law on fault : -1/gamma*(l - pos_part(gamma*gap - l))*Test_l\n\
    fix uL = [0,0] on west\nfix uR = [-1e-3,0] on east\n";

/// A column on a floor that pushes where the column is above it.
const TURNED: &str = "mesh box [0,0] to [1,1] cells [2,2] quad\nparam gamma = 1e5\nregion floor = faces where y == 0\n\
    region top = faces where y == 1\nunknown u : vector\nterm bulk on all : 1000*Sym(Grad_u):Grad_Test_u\n\
    term contact on floor : gamma*pos_part(-u.Normal)*(Test_u.Normal)\nfix u = [0,-1e-3] on top\n";

const ROWS: &str = "rows.csv";

/// A flow under a load from a table.
fn history(file: &str) -> String {
    FLOW.replace("load p = 1", &format!("steps t = 0 to 1 by 0.5\nload p = table(\"{file}\", t)"))
}

fn nested(depth: usize) -> String {
    format!("{}1{}", "(".repeat(depth), ")".repeat(depth))
}

/// Macros that each use the one before twice.
fn doubled(levels: usize) -> String {
    let macros: String = (1..levels).map(|k| format!("def f{k} = f{} + f{0}\n", k - 1)).collect();
    format!("{FLOW}def f0 = x + y\n{macros}measure last = max(f{}) on all\n", levels - 1)
}

/// A product of so many vectors, component by component: each operation on the result of the last.
fn chained(n: usize) -> String {
    format!("({}).[1,0]", (0..n).map(|i| format!("[x,{i}]")).collect::<Vec<_>>().join(".*"))
}

/// Waves by explicit steps.
fn explicit(mesh: &str, space: &str, by: &str) -> String {
    format!(
        "mesh box {mesh}\nunknown u : {space}\nterm inertia on all : Dot2_u*Test_u\nterm stress on all : Grad_u.Grad_Test_u\n\
         start u = x\nscheme explicit\nsteps t = 0 to 1 by {by}\nmeasure m = max(u) on all\n"
    )
}

/// That plate with its cells the other way round.
pub(crate) fn clockwise() -> Pair {
    Pair::new("W423", ON_PLATE)
        .file("plate.msh", PLATE.replace("1 2 5 4\n", "1 4 5 2\n").replace("2 3 6 5\n", "2 5 6 3\n"))
        .file("good.msh", PLATE)
        .near("plate.msh", "good.msh")
}

/// That plate and another one above it.
fn two_plates(motion: &str) -> Pair {
    let files = format!("\"plate.msh\", \"other.msh\" moved by {motion}");
    let scene = ON_PLATE.replace("\"plate.msh\"", &files).replace("on west", "on west, west2");
    let other = ["west", "east", "seam", "left", "right"]
        .iter()
        .fold(PLATE.to_owned(), |text, name| text.replace(&format!("\"{name}\""), &format!("\"{name}2\"")));
    Pair::new("E718", scene).file("plate.msh", PLATE).file("other.msh", other)
}

/// That plate at two places.
fn twice() -> Pair {
    Pair::new("W703", ON_PLATE.replace("\"plate.msh\"", "\"plate.msh\", \"plate.msh\" moved by [0,2]"))
        .file("plate.msh", PLATE)
        .near("\"plate.msh\", ", "")
}

/// Pairs by code.
pub(crate) fn pairs() -> Vec<Pair> {
    let measured = |value: &str| format!("{FLOW}measure value = max({value}) on all\n");
    vec![
        Pair::new("E119", measured(&nested(250))).near(&measured(&nested(250)), &measured(&nested(150))),
        Pair::new("E124", doubled(25)).near(&doubled(25), &doubled(5)),
        Pair::new("E125", format!("{FLOW}# {}\n", "x".repeat(5 << 20)))
            .near(&"x".repeat(5 << 20), &"x".repeat(1 << 20)),
        Pair::new("E213", format!("use \"missing.wfl\"\n{FLOW}"))
            .file("there.wfl", "# nothing\n")
            .near("missing", "there"),
        Pair::new("E214", format!("use \"scene.wfl\"\n{FLOW}")).file("there.wfl", "# nothing\n").near("scene", "there"),
        Pair::new("E403", format!("{FLOW}unknown d : scalar global\nterm stop on east : pos_part(p - d - 9)*Test_d\n"))
            .near("- 9)", "+ 9)"),
        Pair::new("E410", ON_PLATE)
            .file("plate.msh", "$MeshFormat\n9 0 8\n")
            .file("good.msh", PLATE)
            .near("plate", "good"),
        Pair::new("E421", FLOW.replace(MESH, "# none\n")).near("# none\n", MESH),
        Pair::new("E422", FLOW.replace(TERM, "# none\n")).near("# none\n", TERM),
        Pair::new("E423", format!("{MESH}data p : scalar = 1\nmeasure top = max(p) on all\n"))
            .near("data p : scalar = 1\n", "unknown p : scalar\nterm base on all : (p - 1)*Test_p\n"),
        Pair::new(
            "E425",
            format!("{FLOW}region half = cells where x < 0.5\n").replace(TERM, &TERM.replace("all", "half")),
        )
        .near("x < 0.5", "x < 1.5"),
        Pair::new("E442", format!("{FLOW}{WIND}{ITERATION}")).near(WIND, ""),
        Pair::new("E441", measured(&chained(11_000))).near(&measured(&chained(11_000)), &measured(&chained(500))),
        Pair::new("E446", history(ROWS))
            .file("rows.csv", "t,q\n0,0\n2,1\n1,3\n")
            .file("right.csv", "t,q\n0,0\n1,3\n")
            .near(ROWS, "right.csv"),
        Pair::new("E447", history("rows.csv")).file("rows.csv", "t,q\n0,0\n0.5,3\n").near(", t)", ", min(t, 0.5))"),
        Pair::new("E455", explicit("[0,0] to [1,1] cells [2,2] tri", "scalar P2", "auto")).near("P2", "P1"),
        Pair::new("E456", explicit("[0] to [1] cells [10] segment", "scalar", "0.11")).near("0.11", "0.09"),
        Pair::new(
            "E457",
            explicit("[0] to [1] cells [4] segment", "scalar", "0.01")
                .replace("start u = x", "fix u = t on boundary")
                .replace("Dot2_u", "Dot_u"),
        )
        .near("Dot_u", "Dot2_u"),
    ]
    .into_iter()
    .chain(of_meshes())
    .chain(of_laws())
    .collect()
}

/// Pairs of regions and meshes.
fn of_meshes() -> Vec<Pair> {
    vec![
        tee(),
        Pair::new("W404", MULTIPLIER).near("fix uL, uR =", "fix uL ="),
        two_plates("[0, 2, 1]").near("[0, 2, 1]", "[0, 2]"),
        twice(),
        Pair::new("W405", ON_PLATE).file("plate.msh", torn()).file("whole.msh", PLATE).near("plate.msh", "whole.msh"),
        Pair::new("E409", ON_PLATE)
            .file("plate.msh", divided())
            .file("whole.msh", PLATE)
            .near("plate.msh", "whole.msh"),
        Pair::new("W407", format!("{ON_PLATE}region seam = faces where x == 2\nmeasure m = mean(p) on seam\n"))
            .file("plate.msh", PLATE)
            .near("region seam = ", "region middle = "),
    ]
}

/// Pairs of laws of contact.
fn of_laws() -> Vec<Pair> {
    vec![
        Pair::new("W503", NITSCHE.replace("1e4", "10")).near("gamma = 10", "gamma = 1e5"),
        Pair::new("W504", NITSCHE.replace("1e4", "1e12")).near("gamma = 1e12", "gamma = 1e5"),
        Pair::new("W507", NITSCHE.replace("- trac(v).Normal", "+ trac(v).Normal"))
            .near("+ trac(v).Normal", "- trac(v).Normal"),
        Pair::new("W508", NITSCHE.replace("fault : -1/gamma", "fault : 1/gamma"))
            .near("fault : 1/gamma*(trac", "fault : -1/gamma*(trac"),
        Pair::new("W509", TOUCHING).near("l - pos_part", "l + pos_part"),
        Pair::new("W510", TURNED).near("pos_part(-u", "pos_part(u"),
    ]
}
