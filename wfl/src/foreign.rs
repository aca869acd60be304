//! Words of other programs and of textbooks, and what they are called here. Consulted only for words that a scene does
//! not declare, so that any of them can be a name of a scene.

/// What a word of another program is here, ready to stand as a help; `None` for words of no program.
#[must_use]
pub fn foreign(word: &str) -> Option<&'static str> {
    EXPRESSION_WORDS.iter().find(|(words, ..)| words.contains(&word)).map(|(_, here, _)| *here)
}

/// What stands for a word of another program with nothing else changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Meant {
    /// More than the word changes.
    Unknown,
    /// A function that takes the same arguments.
    Function(&'static str),
    /// An expression.
    Value(&'static str),
}

/// What stands for a word of [`foreign`], where that is sure.
pub(crate) fn meant(word: &str) -> Meant {
    EXPRESSION_WORDS.iter().find(|(words, ..)| words.contains(&word)).map_or(Meant::Unknown, |(.., meant)| *meant)
}

/// Like [`foreign`] for the words that only other programs have: no letter or name that a model may have given to a number.
#[must_use]
pub fn ufl(word: &str) -> Option<&'static str> {
    let own =
        ["n", "N", "h", "H", "I", "T", "v", "e", "E1", "eps", "epsilon", "sigma", "stress", "strain", "tau_n", "dt"];
    let own =
        own.contains(&word) || ["time", "length", "step", "normal", "du", "dn", "test", "pos", "neg"].contains(&word);
    foreign(word).filter(|_| !own)
}

/// What does the work of a statement of another program.
#[derive(Clone, Copy)]
pub(crate) struct Statement {
    /// Ready to stand as a help.
    pub(crate) text: &'static str,
    /// The first word here, if there is one for it.
    pub(crate) word: Option<&'static str>,
}

/// What does the work of a statement of another program.
pub(crate) fn foreign_statement(word: &str) -> Option<Statement> {
    let row = STATEMENT_WORDS.iter().find(|(words, ..)| words.contains(&word));
    row.map(|(_, text, word)| Statement { text, word: *word })
}

/// Words that are taken for one cause, with what to write, and what stands for the word itself.
type Words = (&'static [&'static str], &'static str, Meant);

/// The same for words at the start of a line, with the word that starts such a statement here.
type FirstWords = (&'static [&'static str], &'static str, Option<&'static str>);

/// Words inside expressions: UFL (FEniCS, Firedrake), NGSolve, FreeFEM, numerical Python, textbooks.
const EXPRESSION_WORDS: &[Words] = &[
    (
        &["inner", "InnerProduct", "ddot", "double_dot"],
        "the scalar product of vectors is `a.b`, of matrices `A:B`",
        Meant::Unknown,
    ),
    (
        &["dot"],
        "`a.b` contracts one index: the scalar product of vectors, a matrix times a vector (also `A*b`)",
        Meant::Unknown,
    ),
    (&["outer", "OuterProduct", "tensor_product", "dyad"], "the tensor product is `a@b`", Meant::Unknown),
    (&["cross", "Cross"], "the vector product is `Cross_product(a, b)`", Meant::Function("Cross_product")),
    (&["elem_mult", "multiply"], "entry by entry: `a.*b`, and `a./b`", Meant::Unknown),
    (
        &["grad", "gradient", "Gradient", "nabla_grad", "nabla", "dxu"],
        "the gradient of a field is `Grad_u`, of its test function `Grad_Test_u`, of an expression `Grad(...)`",
        Meant::Unknown,
    ),
    (
        &["div", "divergence", "nabla_div", "Divergence"],
        "the divergence of a field is `Div_u`, of its test function `Div_Test_u`, of an expression `Div(...)`",
        Meant::Unknown,
    ),
    (
        &["laplace", "laplacian", "Laplacian", "Laplace", "laplace_u", "lap"],
        "the weak form of the Laplacian is `Grad_u.Grad_Test_u`; second derivatives are `Hess_u`",
        Meant::Unknown,
    ),
    (
        &["curl", "rot", "Curl"],
        "in 3-D the curl has the entries of `2*Skew(Grad_u)`: Grad_u(3,2) - Grad_u(2,3), ...",
        Meant::Unknown,
    ),
    (
        &["Dx", "diff", "Deriv", "dn", "dy", "dz"],
        "a derivative along x is `Grad_u(1)` of a scalar field, `Grad_u(i,1)` of the component i of a vector",
        Meant::Unknown,
    ),
    (&["hess", "hessian", "Hessian"], "second derivatives of a field are `Hess_u`", Meant::Unknown),
    (
        &["dx", "ds", "dS", "dP", "dA", "dV", "dΓ", "dO", "dGamma", "dOmega"],
        "nothing stands for the measure: the term is integrated over its region, term name on REGION : ...",
        Meant::Unknown,
    ),
    (
        &["int1d", "int2d", "int3d", "intalledges", "integral", "integrate", "Integrate", "intrule", "int", "Int"],
        "a term is integrated over its region: term name on REGION : ...; a number to print: \
         measure m = integral(...) on REGION",
        Meant::Unknown,
    ),
    (
        &["v", "vh", "TestFunction", "TestFunctions", "test", "testfunction"],
        "the test function of an unknown `u` is written `Test_u`; nothing declares it",
        Meant::Unknown,
    ),
    (
        &["TrialFunction", "TrialFunctions", "trial", "du", "Trial_u"],
        "a term is written with the unknown `u` itself; the tangent follows by differentiation",
        Meant::Unknown,
    ),
    (
        &["FunctionSpace", "VectorFunctionSpace", "Function", "FiniteElement", "H1", "VectorH1", "fespace", "L2"],
        "a field and its element are declared in one line: unknown u : vector P2 on REGION",
        Meant::Unknown,
    ),
    (
        &["Constant", "CoefficientFunction", "CF", "Parameter", "Expression", "UserExpression"],
        "a number is `param name = value`, an expression of x, y, z `def name = ...`",
        Meant::Unknown,
    ),
    (&["SpatialCoordinate", "coordinates"], "the position is `X`, its coordinates `x`, `y`, `z`", Meant::Unknown),
    (
        &["FacetNormal", "n", "N", "normal", "nx", "ny", "nz", "normals", "specialcf"],
        "the outward normal on faces is `Normal`, with the components `Normal(1)`, `Normal(2)`, `Normal(3)`",
        Meant::Unknown,
    ),
    (
        &["CellDiameter", "Circumradius", "FacetArea", "CellVolume", "MinCellEdgeLength", "hTriangle", "lenEdge", "h"],
        "the size of a cell is `element_size`",
        Meant::Unknown,
    ),
    (
        &["Identity", "I", "eye", "Id2", "Id3", "Identity2"],
        "the identity matrix is `Id(n)` with its size: `Id(2)` in the plane, `Id(3)` in space, `Id(meshdim)` in both",
        Meant::Unknown,
    ),
    (&["tr", "trace"], "the trace of a matrix is `Trace(A)`", Meant::Function("Trace")),
    (&["det"], "the determinant is `Det(A)`", Meant::Function("Det")),
    (&["inv", "inverse"], "the inverse of a matrix is `Inv(A)`", Meant::Function("Inv")),
    (&["transpose", "Transpose", "T"], "the transposed matrix is `A'`", Meant::Unknown),
    (&["sym", "Symmetric"], "the symmetric part is `Sym(A)`", Meant::Function("Sym")),
    (&["skew", "Antisymmetric"], "the skew part is `Skew(A)`", Meant::Function("Skew")),
    (&["dev", "deviator", "deviatoric", "Dev"], "the deviator is `Deviator(A)`", Meant::Function("Deviator")),
    (&["norm", "length", "mag", "magnitude"], "the norm of a vector or matrix is `Norm(v)`", Meant::Function("Norm")),
    (
        &["epsilon", "strain", "sym_grad", "symgrad"],
        "the small strain is `Sym(Grad_u)`: def strain(v) = Sym(Grad_v), or use \"elasticity\"",
        Meant::Unknown,
    ),
    (
        &["eps"],
        "the small strain is `Sym(Grad_u)`: def eps(v) = Sym(Grad_v); as a tolerance it is not needed: x == 0 holds \
         within 1e-9 of the mesh size",
        Meant::Unknown,
    ),
    (
        &["near", "DOLFIN_EPS", "isclose"],
        "`==` on coordinates holds within 1e-9 of the mesh size: faces where x == 0",
        Meant::Unknown,
    ),
    (
        &["sigma", "stress"],
        "a stress is declared by the scene: def sigma(v) = lambda*Div_v*Id(3) + 2*mu*Sym(Grad_v), or use \"elasticity\"",
        Meant::Unknown,
    ),
    (
        &["jump"],
        "the jump over an interface is `u - Interpolate(u, neighbor_element)`, of two fields \
         `uL - Interpolate(uR, neighbor_element)`: def jump(a, b) = a - Interpolate(b, neighbor_element), or \
         use \"contact\"",
        Meant::Unknown,
    ),
    (
        &["avg", "average"],
        "the mean of both sides is `(u + Interpolate(u, neighbor_element))/2`, on an interface",
        Meant::Unknown,
    ),
    (
        &["Other", "neighbor", "neighbour", "other"],
        "the other side of a face is `Interpolate(u, neighbor_element)`",
        Meant::Unknown,
    ),
    (
        &["conditional", "IfPos", "where", "ifelse", "iif", "cond", "If"],
        "a choice is written (if condition then a else b)",
        Meant::Unknown,
    ),
    (
        &["gt", "ge", "lt", "le", "eq", "ne", "And", "Or", "Not"],
        "conditions are written `<`, `<=`, `==`, `and`, `or`",
        Meant::Unknown,
    ),
    (
        &["True", "False", "true", "false"],
        "conditions are comparisons, such as x > 0; a choice is 1 or 0",
        Meant::Unknown,
    ),
    (
        &["as_vector", "as_matrix", "as_tensor", "array", "vec", "Vector"],
        "a vector is `[a, b]`, a matrix `[a, b; c, d]`",
        Meant::Unknown,
    ),
    (&["max_value", "maximum", "fmax"], "the larger of two numbers is `max(a, b)`", Meant::Function("max")),
    (&["min_value", "minimum", "fmin"], "the smaller of two numbers is `min(a, b)`", Meant::Function("min")),
    (
        &["ppos", "macaulay", "ramp", "positive_part", "relu", "pos"],
        "the positive part is `pos_part(t)`",
        Meant::Function("pos_part"),
    ),
    (&["negative_part", "neg"], "the negative part is `neg_part(t)`", Meant::Function("neg_part")),
    (&["step", "heaviside", "H"], "the unit step is `Heaviside(t)`", Meant::Function("Heaviside")),
    (&["sgn", "signum"], "the sign is `sign(t)`", Meant::Function("sign")),
    (&["ln", "Log", "LN"], "the natural logarithm is `log(t)`", Meant::Function("log")),
    (&["Exp"], "the exponential is `exp(t)`", Meant::Function("exp")),
    (&["e", "E1", "euler"], "the number e is `exp(1)`", Meant::Unknown),
    (&["Sqrt"], "the square root is `sqrt(t)`", Meant::Function("sqrt")),
    (&["square", "sq", "Sqr"], "the square is `sqr(t)` or `t^2`", Meant::Unknown),
    (
        &["arcsin", "arccos", "arctan", "arctan2"],
        "the arc functions are `asin`, `acos`, `atan`, `atan2`",
        Meant::Unknown,
    ),
    (&["Pi", "PI", "π"], "the number is `pi`", Meant::Value("pi")),
    (&["fabs", "Abs", "ABS"], "the absolute value is `abs(t)`", Meant::Function("abs")),
    (
        &["inf", "Inf", "infinity", "Infinity", "nan", "NaN", "oo"],
        "numbers of a scene are finite; leave out what is to have no limit",
        Meant::Unknown,
    ),
    (
        &["ufl", "np", "numpy", "math", "fem", "dolfin", "dolfinx", "fd", "ngs", "sp", "sympy", "jnp"],
        "functions stand without a module in front: sqrt(t), not math.sqrt(t)",
        Meant::Unknown,
    ),
    (
        &["dt", "Dt", "delta_t", "tau_n", "time_step"],
        "the increment of the step variable is `timestep`",
        Meant::Value("timestep"),
    ),
    (&["time"], "time is the variable of `steps`: steps t = 0 to 1 by 0.1", Meant::Unknown),
    (&["ddt", "dudt", "u_t", "udot", "u_dot"], "the rate of a field is `Dot_u`", Meant::Unknown),
    (
        &["u_old", "u_n", "u_prev", "u_previous", "uold", "u_last", "old"],
        "a field at the end of the last step is `Previous_u`",
        Meant::Unknown,
    ),
    (
        &["derivative", "Derivative"],
        "a tangent is never written: it follows; of an expression: `Diff(e, u)`",
        Meant::Unknown,
    ),
    (
        &["DirichletBC", "dirichlet", "Dirichlet", "on_boundary"],
        "prescribed values are a statement: fix u = [0,0] on REGION",
        Meant::Unknown,
    ),
];

/// Words that start a line elsewhere.
const STATEMENT_WORDS: &[FirstWords] = &[
    (&["from", "import", "include", "load_library", "require", "using"], "another file: use \"file.wfl\"", Some("use")),
    (
        &[
            "bc",
            "bcs",
            "boundary",
            "dirichlet",
            "Dirichlet",
            "constraint",
            "constrain",
            "prescribe",
            "DirichletBC",
            "bind",
        ],
        "prescribed values: fix u = [0,0] on REGION",
        Some("fix"),
    ),
    (
        &["neumann", "Neumann", "traction", "force", "pressure", "body_force", "source", "rhs"],
        "forces: load u = [0,-1] on REGION",
        Some("load"),
    ),
    (
        &[
            "robin", "contact", "a", "L", "F", "weak", "form", "equation", "residual", "problem", "solve", "bilinear",
            "linear",
        ],
        "an equation is a term: term name on REGION : expression with Test_u; there is no statement to solve it, `wfl run` \
         does",
        None,
    ),
    (
        &[
            "parameter",
            "parameters",
            "const",
            "constant",
            "let",
            "var",
            "set",
            "real",
            "float",
            "double",
            "int",
            "Constant",
        ],
        "a number: param name = value",
        Some("param"),
    ),
    (
        &["function", "func", "macro", "define", "lambda", "expression", "Def"],
        "an expression with a name: def f(a, b) = ...",
        Some("def"),
    ),
    (
        &["field", "variable", "trial", "fespace", "space", "element", "dof", "dofs", "unknowns"],
        "a field that is solved for: unknown u : vector P2 on REGION",
        Some("unknown"),
    ),
    (&["test", "testfunction"], "test functions are not declared: `Test_u` is that of the unknown `u`", None),
    (
        &["geometry", "domain", "grid", "box", "rectangle"],
        "the mesh: mesh box [0,0] to [1,1] cells [8,8] quad",
        Some("mesh"),
    ),
    (
        &["group", "surface", "subdomain", "face", "cell", "node", "interface"],
        "parts of the mesh: region name = faces where x == 0",
        Some("region"),
    ),
    (&["time", "timestepping", "loop", "for", "while", "step"], "steps: steps t = 0 to 1 by 0.1", Some("steps")),
    (&["initial", "init", "ic", "guess"], "first values: start u = [0,0]", Some("start")),
    (
        &["print", "write", "save", "export", "plot", "vtk", "csv"],
        "files: output vtk \"name\" : u; numbers: measure m = max(u(1)) on all",
        Some("output"),
    ),
    (&["assert", "check", "require_that"], "what must hold at the end: expect m < 1", Some("expect")),
    (
        &["integrate", "probe", "mean", "max", "min", "integral"],
        "a number to print: measure m = integral(u(1)) on all",
        Some("measure"),
    ),
    (
        &["newton", "solve_options", "tolerance", "tol"],
        "settings of the solver: solver newton with tol=1e-10",
        Some("solver"),
    ),
    (&["end", "endif", "begin", "return"], "nothing ends a statement but the next line that starts in column 1", None),
];

/// What a statement looks like, for a message about one that cannot be read.
pub(crate) fn form(statement: &str) -> Option<&'static str> {
    FORMS.iter().find(|(word, _)| *word == statement).map(|(_, form)| *form)
}

const FORMS: &[(&str, &str)] = &[
    ("wfl", "wfl 1"),
    ("use", "use \"file.wfl\""),
    ("mesh", "mesh box [0,0] to [1,1] cells [8,8] quad, or mesh file \"part.msh\""),
    ("refine", "refine where sqrt(x^2 + y^2) < 0.1 times 3, or refine on region times 2"),
    ("region", "region name = faces where x == 0, or interface from a to b, or p + q"),
    ("mapping", "mapping name = project from faces onto other_faces"),
    ("param", "param name = value [unit] in low..high \"text\""),
    ("unknown", "unknown name : vector P2 on region [unit]"),
    ("multiplier", "multiplier name : vector P1 on faces"),
    ("data", "data name : scalar = expression, or = \"file.csv\""),
    ("state", "state name : scalar on region := expression"),
    ("split", "split u across faces"),
    ("def", "def name(a, b) = expression"),
    ("term", "term name on region : expression"),
    ("energy", "energy name on region : expression"),
    ("fix", "fix u = value on region, or fix u(1) = value on region"),
    ("load", "load u = value on region"),
    ("start", "start u = expression, or start from \"file.csv\""),
    ("steps", "steps t = 0 to 1 by 0.1"),
    ("scheme", "scheme newmark beta=1/4 gamma=1/2"),
    ("solver", "solver newton with tol=1e-10, max_iter=50"),
    ("quadrature", "quadrature on region degree 4; or vertex, or segments of mapping degree 4"),
    ("measure", "measure name = max(expression) on region; or min, mean, integral; value(expression) at [0,1]"),
    ("output", "output vtk \"name\" : u, expression as name"),
    ("balance", "balance name of p, q"),
    ("event", "event name = max(expression) on region > 1"),
    ("gradient", "gradient measure with parameter, field data"),
    ("expect", "expect measure < 1"),
];

/// What a word made of a field's name and of something else probably is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FieldSlip {
    /// Ready to stand beside the mark.
    pub(crate) text: String,
    /// The word that is meant, where that is sure.
    pub(crate) word: Option<String>,
    /// The component of the field that is meant.
    pub(crate) component: Option<String>,
}

/// What a word made of a field's name and of something else probably means: `Test_Grad_u`, `grad_u`, `u_x`, `u_old`.
#[must_use]
pub(crate) fn field_slip<'f>(word: &str, fields: impl IntoIterator<Item = &'f str>) -> Option<FieldSlip> {
    let fields: Vec<&str> = fields.into_iter().collect();
    let longest =
        |matches: &dyn Fn(&str) -> bool| fields.iter().copied().filter(|f| matches(f)).max_by_key(|f| f.len());
    if let Some(field) = longest(&|f| word.len() > f.len() && word.ends_with(f))
        && let Some(prefix) = prefixes_of(&word[..word.len() - field.len()])
    {
        let word = format!("{prefix}{field}");
        return Some(FieldSlip { text: format!("did you mean `{word}`?"), word: Some(word), component: None });
    }
    let field = longest(&|f| word.len() > f.len() && word.starts_with(f))?;
    let end = word[field.len()..].trim_start_matches('_');
    let is = |what: &str, prefix: &str| {
        let word = format!("{prefix}{field}");
        Some(FieldSlip { text: format!("{what} is `{word}`"), word: Some(word), component: None })
    };
    match end {
        "x" | "y" | "z" => {
            let k = 1 + "xyz".find(end)?;
            let text = format!(
                "the component along {end} is `{field}({k})`, the derivative along {end} `Grad_{field}({k})`, of \
                 component i `Grad_{field}(i,{k})`"
            );
            Some(FieldSlip { text, word: None, component: None })
        }
        "1" | "2" | "3" => {
            let component = format!("{field}({end})");
            let text = format!("the component is `{component}`");
            Some(FieldSlip { text, word: None, component: Some(component) })
        }
        "t" | "dot" => is("the rate", "Dot_"),
        "old" | "n" | "prev" | "previous" | "last" | "0" => is("the value at the end of the last step", "Previous_"),
        "test" | "Test" => is("the test function", "Test_"),
        _ => None,
    }
}

/// The prefixes that a text in front of a field's name is made of, in the order in which they are written.
fn prefixes_of(text: &str) -> Option<String> {
    const WORDS: &[(&str, &str)] = &[
        ("previous", "Previous_"),
        ("grad", "Grad_"),
        ("hess", "Hess_"),
        ("test2", "Test2_"),
        ("test", "Test_"),
        ("prev", "Previous_"),
        ("old", "Previous_"),
        ("dot", "Dot_"),
        ("div", "Div_"),
    ];
    let lower = text.to_ascii_lowercase();
    let mut rest = lower.as_str();
    let mut found = Vec::new();
    while !rest.is_empty() {
        if let Some(behind) = rest.strip_prefix('_') {
            rest = behind;
            continue;
        }
        let (word, prefix) = WORDS.iter().find(|(word, _)| rest.starts_with(word))?;
        found.push(*prefix);
        rest = &rest[word.len()..];
    }
    // derivatives stand first, then what the field is taken as
    let order = |prefix: &&str| !["Grad_", "Hess_", "Div_"].contains(prefix);
    found.sort_by_key(order);
    found.dedup();
    (!found.is_empty() && found.len() <= 2).then(|| found.concat())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{is_function, keywords::is_keyword};

    #[test]
    fn no_word_of_the_language_is_called_foreign() {
        for word in EXPRESSION_WORDS.iter().flat_map(|(words, ..)| *words) {
            assert!(!is_function(word) && !crate::CONSTANTS.contains(word), "{word}");
        }
        for word in STATEMENT_WORDS.iter().flat_map(|(words, ..)| *words) {
            assert!(!crate::STATEMENTS.contains(word), "{word}");
        }
        assert!(crate::STATEMENTS.iter().all(|s| form(s).is_some()));
        assert!(is_keyword("from") && foreign_statement("from").is_some());
    }

    #[test]
    fn a_word_is_in_one_row() {
        let expressions: Vec<&str> = EXPRESSION_WORDS.iter().flat_map(|row| row.0).copied().collect();
        let statements: Vec<&str> = STATEMENT_WORDS.iter().flat_map(|row| row.0).copied().collect();
        for mut all in [expressions, statements] {
            all.sort_unstable();
            assert!(all.windows(2).all(|w| w[0] != w[1]), "{:?}", all.windows(2).find(|w| w[0] == w[1]));
        }
    }

    #[test]
    fn misplaced_prefixes_and_endings_name_the_right_word() {
        for (word, meant) in [
            ("Test_Grad_u", "Grad_Test_u"),
            ("grad_u", "Grad_u"),
            ("grad_test_u", "Grad_Test_u"),
            ("GradTest_u", "Grad_Test_u"),
            ("Testu", "Test_u"),
            ("Previous_Grad_u", "Grad_Previous_u"),
            ("u_x", "Grad_u(1)"),
            ("u2", "u(2)"),
            ("u_old", "Previous_u"),
            ("u_t", "Dot_u"),
        ] {
            let found = field_slip(word, ["u", "w"]);
            assert!(found.is_some_and(|f| f.text.contains(&format!("`{meant}`"))), "{word}");
        }
        for word in ["gu", "stress_u", "usual", "u_max", "Test_v"] {
            assert_eq!(field_slip(word, ["u", "w"]), None, "{word}");
        }
    }
}
