//! The syntax tree of a scene: statements and expressions, each with its place.
//!
//! Sums and products are flat lists, so a long sum is no deep tree; nesting is limited ([`crate::NESTING_LIMIT`];
//! after macro expansion [`crate::EXPANDED_NESTING_LIMIT`]), so every walk over a tree may recurse.

mod mesh;

pub use mesh::{MeshFile, MeshSource, Placing};

use crate::{lost::Lost, source::Span};

mod derivatives;
mod expression;

pub use derivatives::{AtSteps, Differentiated, Gradients};
pub use expression::{
    Argument, CmpOp, Cond, CondKind, Expansion, ExpansionId, Expansions, Expr, ExprKind, Ident, MulOp,
};

/// `with a = 1, b = "x", c`
#[derive(Clone, Debug, PartialEq)]
pub struct OptionItem {
    /// The key.
    pub name: Ident,
    /// The value, if one is written.
    pub value: Option<OptionValue>,
    /// `on r, s` behind the value: where the reductions in it are taken.
    pub places: Vec<Ident>,
}

/// The value of an option.
#[derive(Clone, Debug, PartialEq)]
pub enum OptionValue {
    /// `"text"`
    Text(String, Span),
    /// An expression; a bare word is a `Name`.
    Expr(Expr),
}

/// What becomes of components of a multiplier that no jump determines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Crosspoints {
    /// They are zero.
    Drop,
    /// They have the value of the nearest node.
    Follow,
    /// They stay unknowns.
    Keep,
}

/// Shapes a box is cut into.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BoxShape {
    /// 1-D
    Segment,
    /// 2-D triangles
    Tri,
    /// 2-D quadrilaterals
    Quad,
    /// 3-D tetrahedra
    Tet,
    /// 3-D hexahedra
    Hex,
}

/// How a box is divided.
#[derive(Clone, Debug, PartialEq)]
pub enum BoxDivision {
    /// `cells [8,8,8]`
    Cells(Expr),
    /// `size h`: the number of cells is the nearest whole number to length over size
    Size(Expr),
}

/// `+ - &` on regions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RegionOp {
    /// union
    Union,
    /// difference
    Minus,
    /// intersection
    Intersect,
}

/// What a region is.
#[derive(Clone, Debug, PartialEq)]
pub enum RegionExpr {
    /// A region by name.
    Name(Ident),
    /// `interface from a to b`
    Interface {
        /// The side `here`: `Normal` points out of it.
        from: Ident,
        /// The side `there`.
        to: Ident,
        /// The whole phrase.
        span: Span,
    },
    /// `interface along s towards v`
    Along {
        /// Faces inside a body.
        surface: Ident,
        /// Where `Normal` points; without it the shape of the surface says.
        towards: Option<Expr>,
        /// The whole phrase.
        span: Span,
    },
    /// `faces of s where c`
    Picked {
        /// Cells, faces or nodes.
        entity: EntityKind,
        /// Only those of this region.
        of: Option<Ident>,
        /// Only those whose centroid (cells) or nodes (faces, nodes) meet the condition.
        condition: Option<Cond>,
        /// The whole phrase.
        span: Span,
    },
    /// `a + b - c & d`, left to right.
    Combine(Box<RegionExpr>, Vec<(RegionOp, RegionExpr)>),
}

/// What a region is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EntityKind {
    /// cells
    Cells,
    /// faces
    Faces,
    /// nodes
    Nodes,
    /// where faces end: nodes of edges with one face
    Rim,
    /// where faces meet: nodes of edges with three faces or more
    Crossings,
    /// between neighbouring faces: edges with two faces
    Interior,
}

/// The rank of a field.
#[derive(Clone, Debug, PartialEq)]
pub enum Rank {
    /// `scalar`
    Scalar,
    /// `vector` (as long as space has dimensions) or `vector(n)`
    Vector(Option<Expr>),
    /// `matrix(m,n)`, or `matrix` for square of the space dimension
    Matrix(Option<(Expr, Expr)>),
}

/// The space of a field: rank, element, place, unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Space {
    /// Scalar, vector or matrix.
    pub rank: Rank,
    /// `P2`, `DQ1`, …: family and degree as written; `None` is degree 1, continuous.
    pub element: Option<Ident>,
    /// Where the field lives.
    pub place: Place,
    /// The unit, if written.
    pub unit: Option<Unit>,
    /// The whole phrase.
    pub span: Span,
}

/// Where a field lives.
#[derive(Clone, Debug, PartialEq)]
pub enum Place {
    /// `all`
    Everywhere,
    /// `global`: one value
    Global(Span),
    /// `on r, s`
    On(Vec<Ident>),
}

/// `[MPa/mm]`: names with integer powers.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// Unit names with their powers; `1` has no entry.
    pub factors: Vec<(String, i32)>,
    /// Where each name is written; nothing for a unit in the file of a table.
    pub places: Vec<Span>,
    /// The brackets and what is in them.
    pub span: Span,
}

impl std::fmt::Display for Unit {
    /// `MPa/mm^2`, without the brackets; `1` for a pure number.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.factors.iter().all(|(_, power)| *power < 0) {
            f.write_str("1")?;
        }
        for (k, (name, power)) in self.factors.iter().enumerate() {
            let sign = if *power < 0 {
                "/"
            } else if k > 0 {
                "*"
            } else {
                ""
            };
            write!(f, "{sign}{name}")?;
            if power.unsigned_abs() != 1 {
                write!(f, "^{}", power.unsigned_abs())?;
            }
        }
        Ok(())
    }
}

/// `in a..b` or `in {a, b}`
#[derive(Clone, Debug, PartialEq)]
pub enum Domain {
    /// Allowed range, both ends included.
    Range(Expr, Expr),
    /// Allowed values.
    Set(Vec<Expr>),
}

/// What is fixed or loaded: a field, a component, or the normal component.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// The field.
    pub field: Ident,
    /// Which part.
    pub part: TargetPart,
    /// The whole phrase.
    pub span: Span,
}

/// The part of a field that a `fix` or `load` names.
#[derive(Clone, Debug, PartialEq)]
pub enum TargetPart {
    /// `u`
    Whole,
    /// `u(1)`
    Component(Expr),
    /// `u.Normal`
    Normal,
}

/// A statement with the place of its whole text.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// What it says.
    pub kind: ItemKind,
    /// Where it stands.
    pub span: Span,
}

/// A macro: `def f(a,b) = e`, or `Def f(a,b) := e;` inside a term.
#[derive(Clone, Debug, PartialEq)]
pub struct MacroDef {
    /// Its name.
    pub name: Ident,
    /// Its parameters.
    pub formals: Vec<Ident>,
    /// Its body.
    pub body: Expr,
    /// Name and parameters, for messages.
    pub head: Span,
}

/// How the points of integration are chosen.
#[derive(Clone, Debug, PartialEq)]
pub enum QuadratureRule {
    /// `degree n`: Gauss points exact to that degree.
    Degree(Expr),
    /// `vertex`: the nodal rule.
    Vertex,
}

/// What a measure does with its expression over its region.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Reduction {
    /// integral divided by the size of the region
    Mean,
    /// largest value at the integration points, or at nodes
    Max,
    /// smallest value at the integration points, or at nodes
    Min,
    /// integral
    Integral,
    /// value at one point
    Value,
    /// what prescribed values carry
    Reaction,
    /// what the equations of a `balance` add up to
    Balance(BalancePart),
}

/// One number of a `balance`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BalancePart {
    /// What loads and prescribed values bring.
    In,
    /// What they take.
    Out,
    /// What the term takes up whose name the measure ends with.
    Term,
    /// What came in, did not go out and was not taken up.
    Lost,
}

/// Where a measure takes its expression.
#[derive(Clone, Debug, PartialEq)]
pub enum MeasureAt {
    /// `on r`: at the points of the quadrature rule of the region.
    Rule,
    /// `at nodes of r`: at the nodes of its cells or faces.
    Nodes,
    /// `at [0, 1]`: at one point; the measure has no regions.
    Point(Expr),
}

/// One quantity of an `output`.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputItem {
    /// What is written.
    pub expr: Expr,
    /// Its name; the text of the expression when absent.
    pub name: Option<Ident>,
}

/// The kinds of statements.
#[derive(Clone, Debug, PartialEq)]
pub enum ItemKind {
    /// `wfl 1`
    Version(f64),
    /// `use "laws.wfl"`
    Use {
        /// The path as written.
        path: String,
    },
    /// `mesh …`
    Mesh {
        /// Box or file.
        source: MeshSource,
        /// `map [..]`: where each node goes, an expression of x, y, z.
        map: Option<Expr>,
        /// `with …`
        options: Vec<OptionItem>,
    },
    /// `refine on r where c times n along x, y`
    Refine(Refine),
    /// `region r = …`
    Region {
        /// Its name.
        name: Ident,
        /// What it is.
        region: RegionExpr,
    },
    /// `mapping m = …`
    Mapping {
        /// Its name.
        name: Ident,
        /// How a point is mapped.
        kind: MappingKind,
        /// `with …`
        options: Vec<OptionItem>,
    },
    /// `param p = …`
    Param {
        /// Its name.
        name: Ident,
        /// Its value.
        value: Expr,
        /// Its unit.
        unit: Option<Unit>,
        /// Allowed values.
        domain: Option<Domain>,
        /// What it is, in words.
        text: Option<String>,
    },
    /// `unknown u : …`
    Unknown {
        /// Its name.
        name: Ident,
        /// Its space.
        space: Space,
    },
    /// `multiplier l : … on f with crosspoints=keep`
    Multiplier {
        /// Its name.
        name: Ident,
        /// Its space.
        space: Space,
        /// `with …`
        options: Vec<OptionItem>,
    },
    /// `data k : … = e` or `= "file"`
    Data {
        /// Its name.
        name: Ident,
        /// Its space.
        space: Space,
        /// Its value; absent when the program that embeds WFL gives it.
        value: Option<OptionValue>,
    },
    /// `state s : … := e`
    State {
        /// Its name.
        name: Ident,
        /// Its space.
        space: Space,
        /// The value it gets at the end of a step.
        update: Expr,
    },
    /// `split u, v across f`: fields and interior faces; the fields get two copies of their unknowns there.
    Split(Vec<Ident>, Vec<Ident>),
    /// `def f(a) = e`
    Def(MacroDef),
    /// `term name on r : Def a:=b; e` or `energy …`
    Term {
        /// True for `energy`.
        energy: bool,
        /// Its name, if it has one.
        name: Option<Ident>,
        /// Its regions.
        places: Vec<Ident>,
        /// Local macros.
        defs: Vec<MacroDef>,
        /// What is integrated.
        expr: Expr,
    },
    /// `fix u, v(1) = e on r, s`
    Fix {
        /// What is fixed.
        targets: Vec<Target>,
        /// To what.
        value: Expr,
        /// Where.
        places: Vec<Ident>,
    },
    /// `load u = e on r`
    Load {
        /// What is loaded.
        targets: Vec<Target>,
        /// With what.
        value: Expr,
        /// Where.
        places: Vec<Ident>,
    },
    /// `start u = e`
    Start {
        /// The field.
        field: Ident,
        /// Its first value.
        value: Expr,
    },
    /// `start from "file"`
    StartFrom {
        /// The path as written.
        path: String,
        /// Its place.
        path_span: Span,
    },
    /// `steps t = a to b by c [unit] with …`
    Steps {
        /// The name of the load parameter or time.
        variable: Ident,
        /// First value.
        from: Expr,
        /// Last value.
        to: Expr,
        /// Step; the word `auto` for steps that the run chooses.
        by: Expr,
        /// The unit of the variable.
        unit: Option<Unit>,
        /// `with …`
        options: Vec<OptionItem>,
    },
    /// `scheme newmark beta=1/4 …`
    Scheme {
        /// Which.
        name: Ident,
        /// What stands behind it.
        options: Vec<OptionItem>,
    },
    /// `solver newton with …`
    Solver {
        /// Which.
        name: Ident,
        /// `with …`
        options: Vec<OptionItem>,
    },
    /// `quadrature on r degree n` or `vertex`
    Quadrature {
        /// Where.
        places: Vec<Ident>,
        /// `segments of m`: the mapping whose images cut the faces.
        segments: Option<Ident>,
        /// Which.
        rule: QuadratureRule,
    },
    /// `measure m = mean(e) on r`
    Measure {
        /// Its name.
        name: Ident,
        /// mean, max, min, integral, value or reaction
        reduction: Reduction,
        /// Of what.
        expr: Expr,
        /// Where.
        places: Vec<Ident>,
        /// At which points.
        at: MeasureAt,
    },
    /// `measure k = F/d`, or `measure k = integral(a)/integral(b) on r`: name, number, where reductions are taken
    Computed(Ident, Expr, Vec<Ident>),
    /// `balance b of p, q`
    Balance {
        /// Its name.
        name: Ident,
        /// The unknowns whose equations are added.
        fields: Vec<Ident>,
    },
    /// `event e = c on r`
    Event {
        /// Its name.
        name: Ident,
        /// What holds while it lasts.
        condition: Cond,
        /// Where the reductions in the condition are taken.
        places: Vec<Ident>,
    },
    /// `gradient m with E, field k`
    Gradient(Gradients),
    /// `expect c`
    Expect(Cond),
    /// `output vtk "name" every k when e : a, b as n along P to Q with …`
    Output {
        /// `vtk` or `csv`.
        format: Ident,
        /// The file's name without its end.
        file: String,
        /// `every k`: of how many steps one is written.
        every: Option<Expr>,
        /// `when e`: the event during which it is written.
        when: Option<Ident>,
        /// What is written.
        items: Vec<OutputItem>,
        /// Ends of the line it is sampled on.
        along: Option<(Expr, Expr)>,
        /// `at P, Q`: points of which a series over the steps is written.
        at: Vec<Expr>,
        /// `with …`
        options: Vec<OptionItem>,
    },
}

/// Which cells are refined, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Refine {
    /// `on r, s`: cells of these regions, or at their faces and nodes; every cell where it is empty.
    pub places: Vec<Ident>,
    /// `where c`: cells whose centre or a vertex meets it.
    pub condition: Option<Cond>,
    /// `times n`: rounds, 1 if it is absent.
    pub times: Option<Expr>,
    /// `along x, y`: directions of a box; all where it is empty.
    pub along: Vec<Ident>,
}

/// How a mapping finds its point.
#[derive(Clone, Debug, PartialEq)]
pub enum MappingKind {
    /// `project from r onto s within d`, `raytrace …`
    Search {
        /// True for `raytrace`.
        raytrace: bool,
        /// The region of the points that are mapped.
        from: Ident,
        /// The region they are mapped onto.
        onto: Ident,
        /// `moving with u1, u2`: the displacements of the bodies behind `r` and behind `s`, one name for both; none where
        /// images are found once.
        moving: Vec<Ident>,
        /// Longest distance.
        within: Option<Expr>,
    },
    /// `point e`
    Point(Expr),
}

/// A parsed scene: its statements, in order; included files are already in place of their `use`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Script {
    /// The statements.
    pub items: Vec<Item>,
    /// What statements with errors would have declared.
    pub lost: Lost,
}
