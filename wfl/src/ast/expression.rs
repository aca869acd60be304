//! Expressions and conditions, and the uses of macros that they come from.

use crate::source::Span;

crate::define_index! {
    /// One use of a macro: an entry of [`Expansions`].
    ExpansionId,
}

/// A word with its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Ident {
    /// The word.
    pub name: String,
    /// Its place.
    pub span: Span,
}

/// One use of a macro, kept so that a message inside a macro can show the use.
#[derive(Clone, Debug, PartialEq)]
pub struct Expansion {
    /// The name of the macro.
    pub name: String,
    /// The call, `sigma(uL)`.
    pub call: Span,
    /// The head of the definition, `sigma(v)`.
    pub definition: Span,
    /// The use inside which this use stands, if it is in another macro's body.
    pub parent: Option<ExpansionId>,
}

/// All macro uses of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Expansions {
    /// By [`ExpansionId`].
    pub list: Vec<Expansion>,
}

/// Two-operand operators of one precedence level, left to right: `* / . : .* ./ @`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MulOp {
    /// `*`
    Times,
    /// `/`
    Divide,
    /// `.` contracts one index
    Dot,
    /// `:` contracts two indices
    DoubleDot,
    /// `.*` by component
    ByComponent,
    /// `./` by component
    DivideByComponent,
    /// `@` tensor product
    Outer,
}

/// An expression with its place. After macro expansion `span` lies in the text where the characters stand
/// (inside the macro's body for expanded nodes) and `expansion` names the use that brought it here.
#[derive(Clone, Debug, PartialEq)]
pub struct Expr {
    /// What it is.
    pub kind: ExprKind,
    /// Where its characters are.
    pub span: Span,
    /// The macro use that put it here; `None` for text written in place (macro arguments included).
    pub expansion: Option<ExpansionId>,
}

/// The kinds of expressions.
#[derive(Clone, Debug, PartialEq)]
pub enum ExprKind {
    /// `3`, `1e5`
    Number(f64),
    /// `u`, `Grad_Test_u`, `pi`: any word, not yet looked up
    Name(String),
    /// `a + b - c`: flat; `true` marks a subtracted part. At least two parts.
    Sum(Vec<(bool, Expr)>),
    /// `a * b . c`: first factor and then operator (with its place) and factor, left to right. At least one pair.
    Product(Box<Expr>, Vec<(MulOp, Span, Expr)>),
    /// `-a` (an even number of signs is folded away)
    Negate(Box<Expr>),
    /// `a ^ b`
    Power(Box<Expr>, Box<Expr>),
    /// `a'`
    Transpose(Box<Expr>),
    /// `f(a, b)`, `u(1)`, `Grad_u(1,:)`: call or component access, decided when names are known
    Call(Box<Expr>, Vec<Argument>),
    /// `[a, b; c, d]`: rows of parts, as written. One row `[a,b]` and one column `[a;b]` are both vectors.
    Tensor(Vec<Vec<Expr>>),
    /// `if c then a else b`
    If(Box<Cond>, Box<Expr>, Box<Expr>),
}

/// An argument of a call.
#[derive(Clone, Debug, PartialEq)]
pub enum Argument {
    /// An expression.
    Expr(Expr),
    /// `:`, a whole index.
    Slice(Span),
    /// `"history.csv"`, without the quotes; its place has them.
    Text(String, Span),
}

/// Comparison operators.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CmpOp {
    /// `<`
    Less,
    /// `<=`
    LessEqual,
    /// `>`
    Greater,
    /// `>=`
    GreaterEqual,
    /// `==`
    Equal,
    /// `!=`
    NotEqual,
}

/// A condition with its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Cond {
    /// What it is.
    pub kind: CondKind,
    /// Where it is.
    pub span: Span,
}

/// The kinds of conditions.
#[derive(Clone, Debug, PartialEq)]
pub enum CondKind {
    /// `a < b <= c`: a chain; true if every neighbouring pair compares true. At least one pair.
    Compare(Box<Expr>, Vec<(CmpOp, Expr)>),
    /// All of them. At least two.
    And(Vec<Cond>),
    /// Any of them. At least two.
    Or(Vec<Cond>),
    /// Not.
    Not(Box<Cond>),
}
