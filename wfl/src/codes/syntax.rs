//! E1: shapes, operators and the form of statements.

use super::{Code, CodePage};

pages! {
    page(
        E101,
        "a sum of different shapes",
        "All summands must have the same shape: a scalar cannot be added to a vector. Often `.` binds more tightly \
         than `-`: a - b.n is a - (b.n). Only a literal 0 fits every shape.",
        "measure un = mean(uL - Interpolate(uR, neighbor_element).Normal) on fault",
        "measure un = mean((uL - Interpolate(uR, neighbor_element)).Normal) on fault",
    ),
    page(
        E102,
        "a product that does not exist for these shapes",
        "`*` multiplies by a scalar, a matrix by a vector or a matrix, and a tensor of order 4 by a matrix. Vectors \
         have three products of their own: u.v is a scalar, u@v a matrix, u.*v works component by component.",
        "term mass on all : u*Test_u",
        "term mass on all : u.Test_u",
    ),
    page(
        E103,
        "a term that is not a scalar",
        "What is integrated must be one number at each point. `.` contracts one index of each side, `:` two, so two \
         matrices need `:`.",
        "term elastic on all : sigma(u).Grad_Test_u",
        "term elastic on all : sigma(u):Grad_Test_u",
    ),
    page(
        E104,
        "an index out of range",
        "Indices start at 1 and are whole numbers known before the run. A vector in three dimensions has the \
         components 1, 2, 3; a gradient has the component first and the direction second.",
        "fix u(0) = 0 on west",
        "fix u(1) = 0 on west",
    ),
    page(
        E105,
        "a wrong number of arguments",
        "A macro or a function was used with more or fewer arguments than it has. A macro without parameters is used \
         without parentheses.",
        "term elastic on all : sigma(u):Grad_Test_u + sin(1,2)*Test_u(1)",
        "term elastic on all : sigma(u):Grad_Test_u + sin(1)*Test_u(1)",
    ),
    page(
        E106,
        "a name is needed",
        "Grad_v, Test_v, Div_v and Interpolate(v, m) make a new name from v. Where v is the parameter of a macro, the \
         argument must be the name of a field (or of its test function), not an expression. A linear macro can be \
         multiplied outside: 2*sigma(u).",
        "term elastic on all : sigma(2*u):Grad_Test_u",
        "term elastic on all : 2*sigma(u):Grad_Test_u",
    ),
    page(
        E107,
        "an operator of another language",
        "The power is written `^`, conditions are joined by `and`, `or`, `not`, comments start with `#`. The message \
         names what to type.",
        "def area = gamma**2",
        "def area = gamma^2",
    ),
    page(
        E108,
        "a shape that does not fit here",
        "A function, a list, a comparison or a statement needs another shape: Trace needs a square matrix, a \
         comparison needs scalars, a prescribed value needs the shape of its field.",
        "fix u = 0*[1,2] on west",
        "fix u = [0,0,0] on west",
    ),
    page(
        E109,
        "a division that is not possible",
        "`/` divides by a scalar, and not by zero; a branch of `if` that the parameters never take may do so. Division component by component is written `./`.",
        "term t on all : (u/u).Test_u",
        "term t on all : (u./(u + 1*[1,1,1])).Test_u",
    ),
    page(
        E110,
        "a tensor that is too large",
        "Tensors have at most six indices, test functions not counted, and 10000 entries; determinants and inverses are \
         written out for matrices of up to 6 rows. Contract indices earlier, or write the needed components.",
        "measure t = max(Norm(Grad_u@Grad_u@Grad_u@Grad_u)) on all",
        "measure t = max(Grad_u:Grad_u) on all",
    ),
    page(
        E111,
        "a derivative that is not available",
        "Third derivatives of fields and a few derivatives through transformations do not exist here. Write the \
         derivative out, or introduce a field for the inner gradient.",
        "term t on all : Grad(Hess_u):Grad(Hess_Test_u)",
        "term t on all : Grad(Div_u).Grad(Div_Test_u)",
    ),
    page(
        E112,
        "a number that must be known before the run",
        "Sizes, numbers of cells, steps and options are computed once, before any field exists: they may use \
         numbers, params and functions of them, not fields, x or t.",
        "steps t = 0 to u(1) by 1",
        "steps t = 0 to gamma by gamma/10",
    ),
    page(
        E113,
        "unexpected text",
        "The statement cannot be read past this place. The message lists what may stand there. A product is always \
         written with a sign: 2*x, not 2x.",
        "def twice = 2gamma",
        "def twice = 2*gamma",
    ),
    page(
        E114,
        "brackets that do not match",
        "Every ( [ { is closed by its own partner in the same statement. The mark is at the bracket without a partner.",
        "def a = (gamma + 1",
        "def a = (gamma + 1)",
    ),
    page(
        E115,
        "a line that starts no statement",
        "A line that starts in column 1 starts a statement, with one of the statement words. A line that continues \
         the one above is indented, by one space or more.",
        "regoin south = faces where y == 0",
        "region south = faces where y == 0",
    ),
    page(
        E116,
        "`=`, `==` or `:=` in place of another of them",
        "`=` gives a value, `==` compares, and `:=` stands in local macros (Def f := ...;) and in `state`. A term has \
         neither: it is a residual, and all terms together are zero.",
        "region south = faces where y = 0",
        "region south = faces where y == 0",
    ),
    page(
        E117,
        "text after the end of a statement",
        "The statement was complete before this place. If the text is a statement of its own, it must start in \
         column 1.",
        "fix u = [0,0,0] on west fault",
        "fix u = [0,0,0] on west, fault",
    ),
    page(
        E118,
        "a character that is not part of the language",
        "Outside comments and texts in quotes a scene is made of ASCII letters, digits and signs. Word processors \
         put long minus signs and curved quotes in place of the plain ones; the message names the replacement.",
        "param shift = \u{2212}1",
        "param shift = -1",
    ),
    page(
        E119,
        "nesting that is too deep",
        "Expressions nest at most 200 deep as written and 256 deep after macros are expanded. Give parts of the \
         expression a name with `def`, or shorten a chain of macros.",
        "def a = f(f(f(f(gamma))))",
        "def b = f(f(gamma))\ndef a = f(f(b))",
    ),
    page(
        E120,
        "a number that cannot be read",
        "A number has one decimal point and a size between 5e-324 and 1.8e308. A point straight behind digits belongs \
         to the number, so 2.*p is 2 times p; write 2 .* p for the product by components.",
        "param a = 1.2.3",
        "param a = 1.23",
    ),
    page(
        E121,
        "a text without its closing quote",
        "A text in quotes ends on the line it starts on, and cannot hold a quote.",
        "param a = 1 \"length of the fault",
        "param a = 1 \"length of the fault\"",
    ),
    page(
        E122,
        "a number in place of a condition, or the other way round",
        "`where`, `expect` and `if` need a comparison such as a < b; everything else needs a number. A condition \
         becomes a number by `if condition then 1 else 0`.",
        "def closed = (Pn > 0)",
        "def closed = if Pn > 0 then 1 else 0",
    ),
    page(
        E123,
        "a circular definition",
        "A macro or a region uses itself, directly or through others, so it has no value. The note shows the circle.",
        "def a = 2*b\ndef b = a + 1",
        "def a = 2*b\ndef b = gamma + 1",
    ),
    page(
        E124,
        "macros with too large an expansion",
        "All macro uses of a scene together may expand to a million parts. A macro that uses another one twice doubles \
         it, and so does the next: twenty such levels make a million.",
        "def a1 = a0 + a0*a0",
        "def a1 = a0 + sqr(a0)",
    ),
    page(
        E125,
        "a text that is too long",
        "A scene may have 4 MiB. Tables of numbers belong in files of their own.",
        "data table : scalar = 1 + 2 + 3",
        "data table : scalar = 6",
    ),
    page(
        E126,
        "a version of the language that is not known",
        "The first line of a file may name the version of the language it is written in; this program reads version \
         1. The line stands before every other statement.",
        "wfl 2",
        "wfl 1",
    ),
    page(
        E128,
        "a semicolon behind a statement",
        "A statement ends where the next line starts in column 1; nothing stands behind it. `;` separates the rows of a \
         matrix and stands behind a local macro (Def f := ...;).",
        "param a = 1;",
        "param a = 1",
    ),
    page(
        E129,
        "a text in single quotes, or a side of a face as in UFL",
        "`'` transposes what stands before it. A text stands in double quotes. The sides of an interface have no signs: \
         plain names are those of the first side, Interpolate(u, neighbor_element) is the other.",
        "output vtk 'fields' : u",
        "output vtk \"fields\" : u",
    ),
}
