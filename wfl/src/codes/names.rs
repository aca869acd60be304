//! E2: names and places. E3: test functions.

use super::{Code, CodePage};

pages! {
    page(
        E201,
        "an unknown name",
        "Nothing of this name is declared: no field, param, macro, region, mapping or function. Capital and small \
         letters differ. The nearest name is offered if there is one.",
        "measure Pt = max(gama*(uL.Normal)) on fault",
        "measure Pt = max(gamma*(uL.Normal)) on fault",
    ),
    page(
        E202,
        "a field that is not defined here",
        "A term on an interface is integrated over the faces of its first side, and only fields of that side have a \
         value there; the other side is reached by Interpolate(u, neighbor_element). A field on some cells has no \
         value on others, and a term on `global` contains single numbers only.",
        "term contact on fault : pos_part(Pn)*(uR.Normal)",
        "term contact on fault : pos_part(Pn)*(Interpolate(Test_uR, neighbor_element).Normal)",
    ),
    page(
        E203,
        "no neighbour here",
        "neighbor_element is the element across an inner face of the mesh. A face of the outer boundary has none. The \
         faces of an interface region have two sides: `interface from a to b` between two regions of cells, `interface \
         along s` where the surface s lies inside one body.",
        "term glue on west : Interpolate(u, neighbor_element).Test_u",
        "term glue on fault : (uL - Interpolate(uR, neighbor_element)).Test_uL",
    ),
    page(
        E204,
        "a normal outside faces",
        "Normal is the outward unit normal of a face; inside a cell there is none. Put the term on a region of faces.",
        "term t on all : (sigma(u)*Normal).Test_u",
        "term t on west : (sigma(u)*Normal).Test_u",
    ),
    page(
        E205,
        "a coordinate that does not exist",
        "A mesh in the plane has x and y, a mesh on a line has only x.",
        "mesh box [0,0] to [1,1] cells [4,4] quad\nunknown p : scalar\nterm t on all : z*Test_p\nfix u = [0,0] on west",
        "mesh box [0,0] to [1,1] cells [4,4] quad\nunknown p : scalar\nterm t on all : y*Test_p\nfix u = [0,0] on west",
    ),
    page(
        E206,
        "time without steps",
        "t, timestep, Previous_u and Dot_u are defined only in a scene with `steps`.",
        "load u = [0,0,-t] on west",
        "load u = [0,0,-t] on west\nsteps t = 0 to 1 by 0.1",
    ),
    page(
        E207,
        "a word of the language as a name",
        "The words of statements (load, mesh, on, to, ...) cannot be names of params, fields or macros.",
        "param load = 3",
        "param force = 3",
    ),
    page(
        E208,
        "a gradient that does not exist",
        "A single number for the whole scene, and values stored at integration points, have no gradient. A field that lives \
         on faces has the gradient along its faces, and no second derivatives: an unknown q of its own with the term \
         (q - Grad_p).Test_q has them as Grad_q.",
        "unknown d : scalar global\nterm t on all : Grad_d.Grad_d*Test_u(1)",
        "unknown d : scalar global\nterm t on all : d*d*Test_u(1)",
    ),
    page(
        E209,
        "declared twice",
        "A name stands for one thing. Params, fields, macros, measures and mappings share one set of names; regions \
         have their own. Inside one term `Def` may hide a macro of the scene, but no field and no param.",
        "param k = 1\nparam k = 2",
        "param k = 1\nparam k2 = 2",
    ),
    page(
        E210,
        "a built-in name",
        "Functions, constants such as pi and Normal, coordinates, and names that start with Grad_, Test_ and the like \
         have a fixed meaning and cannot be declared.",
        "param Normal = 1",
        "param stiffness = 1",
    ),
    page(
        E211,
        "an unknown option",
        "Behind `with`, and as the word of `output` and `solver`, a statement knows a fixed set of words. The note \
         lists them.",
        "solver newton with tolerance=1e-8",
        "solver newton with tol=1e-8",
    ),
    page(
        E212,
        "the wrong kind of name",
        "Only unknowns and multipliers can be fixed, loaded or started from a guess; only terms and measures can \
         stand on `global`.",
        "fix gamma = 0 on west",
        "fix u = [0,0,0] on west",
    ),
    page(
        E213,
        "a file that cannot be read",
        "`use` names a file by its path from the file it stands in, or a file of the library. The message says why \
         the file could not be read.",
        "use \"contcat.wfl\"",
        "param c = 1",
    ),
    page(
        E214,
        "files that include each other",
        "Two files include each other by `use`, directly or through others. Move what both need into a third file.",
        "use \"scene.wfl\"",
        "param c = 1",
    ),
    page(
        E215,
        "one term with two mappings",
        "All `Interpolate` of a term refer to one other place: the neighbour, or the image under one mapping. The \
         terms of a scene are added, so each mapping can have its own.",
        "mapping m = point [1 - x, y, z]\nmapping n = point [x, 1 - y, z]\n\
         term tie on left : (Interpolate(u, m) - Interpolate(u, n)).Test_u",
        "mapping m = point [1 - x, y, z]\nmapping n = point [x, 1 - y, z]\n\
         term one on left : Interpolate(u, m).Test_u\nterm two on left : -Interpolate(u, n).Test_u",
    ),
    page(
        E216,
        "a word of another program",
        "UFL, NGSolve, FreeFEM and textbooks have words that this language writes otherwise: inner(a, b) is `a.b` or \
         `A:B`, grad(u) is `Grad_u`, a test function is `Test_u`, and nothing stands for the measure dx, since a term \
         stands on its region. The message says what each word is called here. A scene may declare any of them as a name \
         of its own.",
        "term t on all : inner(grad(u), Grad_Test_u)*dx",
        "term t on all : Grad_u:Grad_Test_u",
    ),
    page(
        E217,
        "a file outside the folder of the scene",
        "A scene reads files in its own folder and below: by `use`, `mesh file`, `data` and `start from`; links are \
         resolved first. A scene from another author can therefore not read the rest of the computer. Another folder \
         is allowed on the command line: wfl run scene.wfl --allow-read ../meshes.",
        "use \"../laws/friction.wfl\"",
        "param c = 1",
    ),
    page(
        E218,
        "a region twice in one list",
        "A term, a load or a measure on a list of regions is summed over the list, so a region that stands there twice \
         would count twice.",
        "load u = [0,0,-1] on left, left",
        "load u = [0,0,-1] on left",
    ),
    page(
        E301,
        "a term that is not linear in the test functions",
        "Each summand of a term contains one test function, once. In a residual the other factor is the unknown.",
        "term stress on fault : sigma(Test_uL):Grad_Test_uL",
        "term stress on fault : sigma(uL):Grad_Test_uL",
    ),
    page(
        E302,
        "a part of a term without a test function",
        "Every summand of a term needs a test function. A potential to be minimised has none and is written with \
         `energy`.",
        "term contact on fault : pos_part(Pn)*(Test_uL.Normal) + pos_part(Pn)",
        "term contact on fault : pos_part(Pn)*(Test_uL.Normal)",
    ),
    page(
        E303,
        "a test function inside a nonlinear function",
        "A term must be linear in the test functions, so they cannot stand inside pos_part, Norm and other functions \
         nor below a division.",
        "term contact on fault : pos_part(gamma*(Test_uL.Normal))",
        "term contact on fault : pos_part(Pn)*(Test_uL.Normal)",
    ),
    page(
        E304,
        "a test function of something that has none",
        "Only unknowns and multipliers have test functions; params, data and states are known.",
        "term contact on fault : Pn*Test_fric",
        "term contact on fault : Pn*(Test_uL.Normal)",
    ),
}
