//! Words of other programs and of textbooks, and what they are called here. Consulted only for words that a scene does
//! not declare, so that any of them can be a name of a scene.

/// What a word of another program is here, ready to stand as a help; `None` for words of no program.
#[must_use]
pub fn foreign(word: &str) -> Option<&'static str> {
    EXPRESSION_WORDS.iter().find(|(words, _)| words.contains(&word)).map(|(_, here)| *here)
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

/// What does the work of a statement of another program, ready to stand as a help.
pub(crate) fn foreign_statement(word: &str) -> Option<&'static str> {
    STATEMENT_WORDS.iter().find(|(words, _)| words.contains(&word)).map(|(_, here)| *here)
}

/// Words that are taken for one cause, with what to write.
type Words = (&'static [&'static str], &'static str);

/// Words inside expressions: UFL (FEniCS, Firedrake), NGSolve, FreeFEM, numerical Python, textbooks.
const EXPRESSION_WORDS: &[Words] = &[
    (&["inner", "InnerProduct", "ddot", "double_dot"], "the scalar product of vectors is `a.b`, of matrices `A:B`"),
    (&["dot"], "`a.b` contracts one index: the scalar product of vectors, a matrix times a vector (also `A*b`)"),
    (&["outer", "OuterProduct", "tensor_product", "dyad"], "the tensor product is `a@b`"),
    (&["cross", "Cross"], "the vector product is `Cross_product(a, b)`"),
    (&["elem_mult", "multiply"], "entry by entry: `a.*b`, and `a./b`"),
    (
        &["grad", "gradient", "Gradient", "nabla_grad", "nabla", "dxu"],
        "the gradient of a field is `Grad_u`, of its test function `Grad_Test_u`, of an expression `Grad(...)`",
    ),
    (
        &["div", "divergence", "nabla_div", "Divergence"],
        "the divergence of a field is `Div_u`, of its test function `Div_Test_u`, of an expression `Div(...)`",
    ),
    (
        &["laplace", "laplacian", "Laplacian", "Laplace", "laplace_u", "lap"],
        "the weak form of the Laplacian is `Grad_u.Grad_Test_u`; second derivatives are `Hess_u`",
    ),
    (&["curl", "rot", "Curl"], "in 3-D the curl has the entries of `2*Skew(Grad_u)`: Grad_u(3,2) - Grad_u(2,3), ..."),
    (
        &["Dx", "diff", "Deriv", "dn", "dy", "dz"],
        "a derivative along x is `Grad_u(1)` of a scalar field, `Grad_u(i,1)` of the component i of a vector",
    ),
    (&["hess", "hessian", "Hessian"], "second derivatives of a field are `Hess_u`"),
    (
        &["dx", "ds", "dS", "dP", "dA", "dV", "dΓ", "dO", "dGamma", "dOmega"],
        "nothing stands for the measure: the term is integrated over its region, term name on REGION : ...",
    ),
    (
        &["int1d", "int2d", "int3d", "intalledges", "integral", "integrate", "Integrate", "intrule", "int", "Int"],
        "a term is integrated over its region: term name on REGION : ...; a number to print: \
         measure m = integral(...) on REGION",
    ),
    (
        &["v", "vh", "TestFunction", "TestFunctions", "test", "testfunction"],
        "the test function of an unknown `u` is written `Test_u`; nothing declares it",
    ),
    (
        &["TrialFunction", "TrialFunctions", "trial", "du", "Trial_u"],
        "a term is written with the unknown `u` itself; the tangent follows by differentiation",
    ),
    (
        &["FunctionSpace", "VectorFunctionSpace", "Function", "FiniteElement", "H1", "VectorH1", "fespace", "L2"],
        "a field and its element are declared in one line: unknown u : vector P2 on REGION",
    ),
    (
        &["Constant", "CoefficientFunction", "CF", "Parameter", "Expression", "UserExpression"],
        "a number is `param name = value`, an expression of x, y, z `def name = ...`",
    ),
    (&["SpatialCoordinate", "coordinates"], "the position is `X`, its coordinates `x`, `y`, `z`"),
    (
        &["FacetNormal", "n", "N", "normal", "nx", "ny", "nz", "normals", "specialcf"],
        "the outward normal on faces is `Normal`, with the components `Normal(1)`, `Normal(2)`, `Normal(3)`",
    ),
    (
        &["CellDiameter", "Circumradius", "FacetArea", "CellVolume", "MinCellEdgeLength", "hTriangle", "lenEdge", "h"],
        "the size of a cell is `element_size`",
    ),
    (
        &["Identity", "I", "eye", "Id2", "Id3", "Identity2"],
        "the identity matrix is `Id(n)` with its size: `Id(2)` in the plane, `Id(3)` in space, `Id(meshdim)` in both",
    ),
    (&["tr", "trace"], "the trace of a matrix is `Trace(A)`"),
    (&["det"], "the determinant is `Det(A)`"),
    (&["inv", "inverse"], "the inverse of a matrix is `Inv(A)`"),
    (&["transpose", "Transpose", "T"], "the transposed matrix is `A'`"),
    (&["sym", "Symmetric"], "the symmetric part is `Sym(A)`"),
    (&["skew", "Antisymmetric"], "the skew part is `Skew(A)`"),
    (&["dev", "deviator", "deviatoric", "Dev"], "the deviator is `Deviator(A)`"),
    (&["norm", "length", "mag", "magnitude"], "the norm of a vector or matrix is `Norm(v)`"),
    (
        &["epsilon", "strain", "sym_grad", "symgrad"],
        "the small strain is `Sym(Grad_u)`: def strain(v) = Sym(Grad_v), or use \"elasticity\"",
    ),
    (
        &["eps"],
        "the small strain is `Sym(Grad_u)`: def eps(v) = Sym(Grad_v); as a tolerance it is not needed: x == 0 holds \
         within 1e-9 of the mesh size",
    ),
    (&["near", "DOLFIN_EPS", "isclose"], "`==` on coordinates holds within 1e-9 of the mesh size: faces where x == 0"),
    (
        &["sigma", "stress"],
        "a stress is declared by the scene: def sigma(v) = lambda*Div_v*Id(3) + 2*mu*Sym(Grad_v), or use \"elasticity\"",
    ),
    (
        &["jump"],
        "the jump over an interface is `u - Interpolate(u, neighbor_element)`, of two fields \
         `uL - Interpolate(uR, neighbor_element)`: def jump(a, b) = a - Interpolate(b, neighbor_element), or \
         use \"contact\"",
    ),
    (&["avg", "average"], "the mean of both sides is `(u + Interpolate(u, neighbor_element))/2`, on an interface"),
    (&["Other", "neighbor", "neighbour", "other"], "the other side of a face is `Interpolate(u, neighbor_element)`"),
    (
        &["conditional", "IfPos", "where", "ifelse", "iif", "cond", "If"],
        "a choice is written (if condition then a else b)",
    ),
    (&["gt", "ge", "lt", "le", "eq", "ne", "And", "Or", "Not"], "conditions are written `<`, `<=`, `==`, `and`, `or`"),
    (&["True", "False", "true", "false"], "conditions are comparisons, such as x > 0; a choice is 1 or 0"),
    (
        &["as_vector", "as_matrix", "as_tensor", "array", "vec", "Vector"],
        "a vector is `[a, b]`, a matrix `[a, b; c, d]`",
    ),
    (&["max_value", "maximum", "fmax"], "the larger of two numbers is `max(a, b)`"),
    (&["min_value", "minimum", "fmin"], "the smaller of two numbers is `min(a, b)`"),
    (&["ppos", "macaulay", "ramp", "positive_part", "relu", "pos"], "the positive part is `pos_part(t)`"),
    (&["negative_part", "neg"], "the negative part is `neg_part(t)`"),
    (&["step", "heaviside", "H"], "the unit step is `Heaviside(t)`"),
    (&["sgn", "signum"], "the sign is `sign(t)`"),
    (&["ln", "Log", "LN"], "the natural logarithm is `log(t)`"),
    (&["Exp"], "the exponential is `exp(t)`"),
    (&["e", "E1", "euler"], "the number e is `exp(1)`"),
    (&["Sqrt"], "the square root is `sqrt(t)`"),
    (&["square", "sq", "Sqr"], "the square is `sqr(t)` or `t^2`"),
    (&["arcsin", "arccos", "arctan", "arctan2"], "the arc functions are `asin`, `acos`, `atan`, `atan2`"),
    (&["Pi", "PI", "π"], "the number is `pi`"),
    (&["fabs", "Abs", "ABS"], "the absolute value is `abs(t)`"),
    (
        &["inf", "Inf", "infinity", "Infinity", "nan", "NaN", "oo"],
        "numbers of a scene are finite; leave out what is to have no limit",
    ),
    (
        &["ufl", "np", "numpy", "math", "fem", "dolfin", "dolfinx", "fd", "ngs", "sp", "sympy", "jnp"],
        "functions stand without a module in front: sqrt(t), not math.sqrt(t)",
    ),
    (&["dt", "Dt", "delta_t", "tau_n", "time_step"], "the increment of the step variable is `timestep`"),
    (&["time"], "time is the variable of `steps`: steps t = 0 to 1 by 0.1"),
    (&["ddt", "dudt", "u_t", "udot", "u_dot"], "the rate of a field is `Dot_u`"),
    (
        &["u_old", "u_n", "u_prev", "u_previous", "uold", "u_last", "old"],
        "a field at the end of the last step is `Previous_u`",
    ),
    (&["derivative", "Derivative"], "a tangent is never written: it follows; of an expression: `Diff(e, u)`"),
    (
        &["DirichletBC", "dirichlet", "Dirichlet", "on_boundary"],
        "prescribed values are a statement: fix u = [0,0] on REGION",
    ),
];

/// Words that start a line elsewhere.
const STATEMENT_WORDS: &[Words] = &[
    (&["from", "import", "include", "load_library", "require", "using"], "another file: use \"file.wfl\""),
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
    ),
    (
        &["neumann", "Neumann", "traction", "force", "pressure", "body_force", "source", "rhs"],
        "forces: load u = [0,-1] on REGION",
    ),
    (
        &[
            "robin", "contact", "a", "L", "F", "weak", "form", "equation", "residual", "problem", "solve", "bilinear",
            "linear",
        ],
        "an equation is a term: term name on REGION : expression with Test_u; there is no statement to solve it, `wfl run` \
         does",
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
    ),
    (
        &["function", "func", "macro", "define", "lambda", "expression", "Def"],
        "an expression with a name: def f(a, b) = ...",
    ),
    (
        &["field", "variable", "trial", "fespace", "space", "element", "dof", "dofs", "unknowns"],
        "a field that is solved for: unknown u : vector P2 on REGION",
    ),
    (&["test", "testfunction"], "test functions are not declared: `Test_u` is that of the unknown `u`"),
    (&["geometry", "domain", "grid", "box", "rectangle"], "the mesh: mesh box [0,0] to [1,1] cells [8,8] quad"),
    (
        &["group", "surface", "subdomain", "face", "cell", "node", "interface"],
        "parts of the mesh: region name = faces where x == 0",
    ),
    (&["time", "timestepping", "loop", "for", "while", "step"], "steps: steps t = 0 to 1 by 0.1"),
    (&["initial", "init", "ic", "guess"], "first values: start u = [0,0]"),
    (
        &["print", "write", "save", "export", "plot", "vtk", "csv"],
        "files: output vtk \"name\" : u; numbers: measure m = max(u(1)) on all",
    ),
    (&["assert", "check", "require_that"], "what must hold at the end: expect m < 1"),
    (&["integrate", "probe", "mean", "max", "min", "integral"], "a number to print: measure m = integral(u(1)) on all"),
    (&["newton", "solve_options", "tolerance", "tol"], "settings of the solver: solver newton with tol=1e-10"),
    (&["end", "endif", "begin", "return"], "nothing ends a statement but the next line that starts in column 1"),
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
    ("quadrature", "quadrature on region degree 4, or quadrature on region vertex"),
    ("measure", "measure name = max(expression) on region; or min, mean, integral; value(expression) at [0,1]"),
    ("output", "output vtk \"name\" : u, expression as name"),
    ("balance", "balance name of p, q"),
    ("event", "event name = max(expression) on region > 1"),
    ("expect", "expect measure < 1"),
];

/// What a word made of a field's name and of something else probably means: `Test_Grad_u`, `grad_u`, `u_x`, `u_old`.
#[must_use]
pub(crate) fn field_slip<'f>(word: &str, fields: impl IntoIterator<Item = &'f str>) -> Option<String> {
    let fields: Vec<&str> = fields.into_iter().collect();
    let longest =
        |matches: &dyn Fn(&str) -> bool| fields.iter().copied().filter(|f| matches(f)).max_by_key(|f| f.len());
    if let Some(field) = longest(&|f| word.len() > f.len() && word.ends_with(f))
        && let Some(prefix) = prefixes_of(&word[..word.len() - field.len()])
    {
        return Some(format!("did you mean `{prefix}{field}`?"));
    }
    let field = longest(&|f| word.len() > f.len() && word.starts_with(f))?;
    let end = word[field.len()..].trim_start_matches('_');
    match end {
        "x" | "y" | "z" => {
            let k = 1 + "xyz".find(end)?;
            Some(format!(
                "the component along {end} is `{field}({k})`, the derivative along {end} `Grad_{field}({k})`, of \
                 component i `Grad_{field}(i,{k})`"
            ))
        }
        "1" | "2" | "3" => Some(format!("the component is `{field}({end})`")),
        "t" | "dot" => Some(format!("the rate is `Dot_{field}`")),
        "old" | "n" | "prev" | "previous" | "last" | "0" => {
            Some(format!("the value at the end of the last step is `Previous_{field}`"))
        }
        "test" | "Test" => Some(format!("the test function is `Test_{field}`")),
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
        for word in EXPRESSION_WORDS.iter().flat_map(|(words, _)| *words) {
            assert!(!is_function(word) && !crate::CONSTANTS.contains(word), "{word}");
        }
        for word in STATEMENT_WORDS.iter().flat_map(|(words, _)| *words) {
            assert!(!crate::STATEMENTS.contains(word), "{word}");
        }
        assert!(crate::STATEMENTS.iter().all(|s| form(s).is_some()));
        assert!(is_keyword("from") && foreign_statement("from").is_some());
    }

    #[test]
    fn a_word_is_in_one_row() {
        for table in [EXPRESSION_WORDS, STATEMENT_WORDS] {
            let mut all: Vec<&str> = table.iter().flat_map(|(words, _)| *words).copied().collect();
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
            assert!(found.as_deref().is_some_and(|f| f.contains(&format!("`{meant}`"))), "{word}: {found:?}");
        }
        for word in ["gu", "stress_u", "usual", "u_max", "Test_v"] {
            assert_eq!(field_slip(word, ["u", "w"]), None, "{word}");
        }
    }
}
