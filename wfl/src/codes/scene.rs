//! E4: the scene. E5: units.

use super::{Code, CodePage};

pages! {
    page(
        E401,
        "a condition without nodes",
        "The region of a `fix` or `load` contains no node, or no part, of the field. Often the field is defined on the \
         other side of the interface.",
        "region east = faces where x == 1\nfix uL = [0,0,0] on east",
        "region east = faces where x == 1\nfix uR = [0,0,0] on east",
    ),
    page(
        E402,
        "an empty region",
        "No cell, face or node satisfies the condition. `==` compares coordinates up to rounding only.",
        "region east = faces where x == 1.01",
        "region east = faces where x == 1",
    ),
    page(
        E403,
        "an unknown without stiffness at the start",
        "A row of the first tangent is zero: the unknown occurs only in contact terms that are open at the start. \
         Start from a state in contact, or add a term that gives the unknown a stiffness.",
        "unknown d : scalar global\nterm contact on west : pos_part(u.Normal - d - 1)*(Test_u.Normal - Test_d)",
        "unknown d : scalar global\nstart d = -1.01\nterm contact on west : pos_part(u.Normal - d - 1)*(Test_u.Normal - Test_d)",
    ),
    page(
        E405,
        "a region of the wrong kind",
        "Terms are integrated over cells, faces or the rim of faces, fields are defined on cells, faces, rims and crossings, and an interface \
         lies between two regions of cells, or along faces inside the mesh. A region of nodes can only be fixed and loaded.",
        "region corner = nodes where x == 0 and y == 0\nterm t on corner : u.Test_u",
        "region side = faces where x == 0\nterm t on side : u.Test_u",
    ),
    page(
        E406,
        "an element that does not exist here",
        "P elements belong to segments, triangles and tetrahedra, Q elements to segments, quadrilaterals and \
         hexahedra. On wedges, pyramids and meshes of several kinds of cells both letters say the same: P on triangular \
         faces, Q on quadrilateral ones. D in front makes them discontinuous, and the digit is the degree.",
        "unknown p : scalar Q7",
        "unknown p : scalar Q2",
    ),
    page(
        E407,
        "a value that cannot be prescribed",
        "Prescribed and nodal values are formulas of x, y, z and the variable of `steps`, without unknowns.",
        "fix u(1) = u(2) on west",
        "fix u(1) = y*z on west",
    ),
    page(
        E408,
        "a box that cannot be built",
        "Both corners have the same number of coordinates, the shape of the cells fits the dimension, and there is \
         one whole number of cells for each direction, or one for all.",
        "mesh box [0,0,0] to [1,1,1] cells [4,4] hex",
        "mesh box [0,0,0] to [1,1,1] cells [4,4,4] hex",
    ),
    page(
        E409,
        "a mesh that cannot be used",
        "Every cell needs a positive volume, and every face belongs to at most two cells. A `map` may invert cells. Neighbours \
         share whole faces: a node of some cells that hangs on a face of another one is no node of that one, and a field that \
         lives on both sides would jump there.",
        "mesh box [0,0,0] to [1,1,1] cells [4,4,4] hex map [x, y, 0*z]",
        "mesh box [0,0,0] to [1,1,1] cells [4,4,4] hex map [x, y, 2*z]",
    ),
    page(
        E410,
        "a mesh file that cannot be used",
        "The file is missing, has an unknown format, or contains cells or groups that contradict each other. The \
         message names the place.",
        "mesh file \"plate.txt\"",
        "mesh file \"plate.msh\"",
    ),
    page(
        E411,
        "a quadrature rule that does not exist",
        "The degree of a quadrature rule is a whole number up to a fixed limit. Segments (`segments of m`) need a mapping onto \
         faces and a degree; their points change as bodies slide, so that a `state` has no values there.",
        "quadrature on fault degree 2.5",
        "quadrature on fault degree 3",
    ),
    page(
        E412,
        "a system that is too large",
        "The number of unknowns, or of matrix entries, exceeds the range of the integers that count them. A lack of \
         memory (E606) is reported before. A coarser mesh or a lower degree has fewer unknowns.",
        "mesh box [0,0,0] to [1,1,1] cells [1500,1500,1500] hex",
        "mesh box [0,0,0] to [1,1,1] cells [15,15,15] hex",
    ),
    page(
        E413,
        "steps that do not reach the last value",
        "The increment has the wrong sign, is zero, or needs too many steps from the first to the last value. A scene \
         with rates starts at the first value and needs a second one.",
        "steps t = 0 to 1 by -0.1",
        "steps t = 0 to 1 by 0.1",
    ),
    page(
        E414,
        "an option value that is not understood",
        "The option exists, but not with this value. The message lists the values.",
        "solver newton with search=maybe",
        "solver newton with search=auto",
    ),
    page(
        E415,
        "data without a value",
        "A `data` field needs a formula or a file, unless the program that embeds the scene gives its values.",
        "data k : scalar",
        "data k : scalar = 1 + x",
    ),
    page(
        E416,
        "an output that cannot be written",
        "`output vtk` writes fields on the mesh, `output csv` samples along a line, `along A to B`, or at points, `at A`. \
         Quantities have up to two indices. A quantity with a state has values at integration points alone: at a point, also \
         of `measure value(...) at`, it has none. Take its mean or its largest value on a region, or write it with \
         `output vtk`, which has the mean over each cell.",
        "output csv \"line\" : u",
        "output csv \"line\" : u along [0,0,0] to [1,1,1]",
    ),
    page(
        E417,
        "a parameter for which `auto` has no value",
        "`auto` stands for the parameter of Nitsche's method, or for a factor of it. Its value follows from the \
         stiffness of the elements at the interface. A penalty parameter has no such value: it depends on the accuracy \
         that is wanted.",
        "param gamma = auto",
        "param gamma = 1e5",
    ),
    page(
        E418,
        "nodal values in a file that do not match the mesh",
        "The file has a line of names and then a line of numbers for each node, separated by commas: x, y, z, then u \
         for a scalar, u_1, u_2, ... for a vector. Each node needs a line with its coordinates, within 1e-9 of the \
         mesh size.",
        "data k : scalar = \"values_of_another_mesh.csv\"",
        "data k : scalar = 1 + x",
    ),
    page(
        E419,
        "a mapping without an image",
        "No point of the region has an image. `within` is the largest distance from a point to its image; a ray meets \
         faces whose normal opposes it; the image of a `point` mapping must lie in a cell where the fields are defined \
         that are read there.",
        "region east = faces where x == 1\nmapping m = project from west onto east within 0.5\n\
         measure far = max(Norm(Interpolate(u, m))) on west",
        "region east = faces where x == 1\nmapping m = project from west onto east within 1.5\n\
         measure far = max(Norm(Interpolate(u, m))) on west",
    ),
    page(
        E421,
        "a scene without a mesh",
        "A scene needs one `mesh` statement: a box, or a file with cells and named groups.",
        "unknown p : scalar",
        "mesh box [0,0,0] to [1,1,1] cells [4,4,4] hex\nunknown p : scalar",
    ),
    page(
        E422,
        "a scene without a term",
        "The sum of all terms is zero for every test function: without a term there is no equation.",
        "unknown p : scalar",
        "unknown p : scalar\nterm flow on all : Grad_p.Grad_Test_p - Test_p",
    ),
    page(
        E423,
        "a scene without an unknown",
        "A scene needs a field to solve for. Data and states are known; multipliers act on unknowns.",
        "data p : scalar = 1",
        "unknown p : scalar",
    ),
    page(
        E424,
        "a statement that may occur once only",
        "A scene has one mesh, one `steps` and one `solver`. The message shows the first one; merge both into one \
         statement.",
        "solver newton\nsolver newton with tol=1e-8",
        "solver newton with tol=1e-8",
    ),
    page(
        E425,
        "cells without a term",
        "The mesh has cells without an equation: a hole in the model. Often the conditions of two regions leave a gap \
         between them, or a group of the mesh file has no term. If this is intended, write `with idle_cells=allowed` \
         behind the mesh.",
        "region left = cells where x < 0.5\nregion right = cells where x > 0.7\n\
         term base on left, right : sigma(u):Grad_Test_u",
        "region left = cells where x < 0.5\nregion right = cells where x > 0.5\n\
         term base on left, right : sigma(u):Grad_Test_u",
    ),
    page(
        E430,
        "very many load steps",
        "More than 100,000 steps need `with most=` in the statement; of steps by `auto`, whose `most` is the largest \
         increment, `with count=`. Memory and report keep about 1 kB for each step, and every output writes a file for \
         each unless it says `every`.",
        "steps t = 0 to 1 by 1e-7",
        "steps t = 0 to 1 by 1e-3",
    ),
    page(
        E431,
        "nodal forces that cannot be applied",
        "A load on a region of nodes is a force at each node. Each node must belong to the field and be unique: not a \
         node of another body, not a node that `split` duplicates.",
        "region tips = nodes where x == 0 or x == 1\nload uL = [0,0,-1] on tips",
        "region tips = nodes of left where x == 0\nload uL = [0,0,-1] on tips",
    ),
    page(
        E432,
        "a prescribed value that another one replaces",
        "Two `fix` statements prescribe different values of one displacement at every node of the earlier statement, \
         which is then without effect. Equal values give no message. A value that changes with the load is one formula \
         of the variable of `steps`.",
        "fix u = [0,0,0] on west\nfix u(1) = 0.1 on west",
        "fix u = [0.1,0,0] on west",
    ),
    page(
        E433,
        "two results with one name",
        "Files with one name would replace each other, and so would quantities with one name in a file. A run has files \
         of its own: `measures.csv` where there are measures, `gradient.csv` and others where derivatives are asked for, \
         and for each step `NAME_0000.csv` or `NAME_0000.vtu`. On some systems names that differ only in upper and lower \
         case are the same.",
        "output vtk \"plate\" : u\noutput vtk \"Plate\" : Grad_u as strain",
        "output vtk \"plate\" : u\noutput vtk \"strains\" : Grad_u as strain",
    ),
    page(
        E434,
        "a quantity stated twice",
        "Of two quadrature rules on one region, or two initial guesses of one field, one would be lost.",
        "quadrature on all degree 4\nquadrature on all degree 6",
        "quadrature on all degree 6",
    ),
    page(
        E435,
        "a line or a point outside all bodies",
        "No point of the line of an `output csv` lies in a body where one of its quantities is defined: every row \
         would be `nan`. Or the point of a measure lies in no body that has its expression.",
        "output csv \"line\" : u along [2,0,0] to [3,0,0]",
        "output csv \"line\" : u along [0,0,0] to [1,0,0]",
    ),
    page(
        E436,
        "a surface with one side",
        "`interface along s` needs two sides. A way round this surface leads from one of its sides to the other, as on a \
         Moebius strip, so no choice of the normal is continuous. Divide it into surfaces that can be oriented, with an \
         interface along each. Branches are no such case: where three or more faces meet at an edge, the surface is \
         divided there by itself.",
        "region crack = interface along strip",
        "region one = interface along first_half\nregion two = interface along second_half",
    ),
    page(
        E437,
        "a direction that chooses no side",
        "Of `interface along s towards v`, Normal points to the side where its scalar product with v, integrated over \
         each connected sheet of s, is positive. Here this integral is zero: v is zero, or lies along the sheet. The \
         direction may depend on the position; without `towards`, the largest component of the mean normal of a sheet \
         is positive, and normals of a closed sheet point outwards.",
        "region crack = interface along fault towards [0,1,0]",
        "region crack = interface along fault towards [1,0,0]",
    ),
    page(
        E440,
        "a tolerance that is too large",
        "`tol` is the relative residual at which the iteration stops. Above 0.1 every state, including the initial \
         guess, would count as a solution, and all results would be wrong.",
        "solver newton with tol=0.5",
        "solver newton with tol=1e-10",
    ),
    page(
        E441,
        "an expression that is too deep",
        "A chain of more than 10,000 operations, each on the result of the one before: a product of vectors and \
         matrices with that many factors, or nested sums. Its derivatives do not fit into the available memory. Sums, \
         conditions and products of scalars may be as long as the text. The limit is the same for every command.",
        "def a = x.*x.*x  # ... 10,001 times",
        "def a = x^3",
    ),
    page(
        E442,
        "an iteration that the scene does not allow",
        "`cg` solves by conjugate gradients, preconditioned by multigrid (`amg`). They need symmetric positive \
         definite matrices: no multipliers, no terms that are not symmetric, no unknowns that follow others, and the same \
         number of components, at most three, in all fields that are solved for; terms that are not linear touch most \
         unknowns. The message says what stands against it. `gmres, amg` is the iteration for contact: nonlinear terms on faces of bodies that are \
         symmetric, where the tangents are not; and for a motion with a pressure. Without these words a small scene gets a factor, which serves every matrix.",
        "solver linear with cg, amg  # ... in a scene with `term wind on all : (c.Grad_p)*Test_p`",
        "solver linear with direct",
    ),
    page(
        E443,
        "a refinement that cannot be made",
        "`times` is a whole number of rounds, 0 or more. `along x, y` divides the cells of a box in these directions \
         only: segments, quadrilaterals and hexahedra. Triangles and tetrahedra are bisected and have no directions, and \
         the cells of a mesh file have no common ones.",
        "refine where x < 0.5 times 1.5",
        "refine where x < 0.5 times 2 along x",
    ),
    page(
        E445,
        "an event that is no comparison of two numbers",
        "An event lasts while one number is larger than another: `event quake = max(V) on fault > 1e-3`. The numbers are \
         made of parameters, measures, the step variable, and of max(e), min(e), mean(e) or integral(e) on a region.",
        "measure top = max(x) on all\nevent high = top == 1",
        "measure top = max(x) on all\nevent high = top > 1",
    ),
    page(
        E446,
        "a file that is no table",
        "`table(\"history.csv\", t)` reads a line of names, which may be left out and may have units, and then rows of \
         numbers with commas between: `t [s],q [MPa]`, `0,0`, `10,2.5`. Rows are sorted by the first column, and no \
         argument is there twice; a jump is two rows a little apart. What stands behind `#` is a comment. A file with \
         several columns of values needs the name of one: `table(\"history.csv\", t, \"q\")`.",
        "steps t = 0 to 1 by 0.5\nload u = [table(\"history.csv\", t),0,0] on left",
        "steps t = 0 to 1 by 0.5\nload u = [0.1*t,0,0] on left",
    ),
    page(
        E447,
        "a value outside the rows of a table",
        "A table is linear between its rows and says nothing outside them. Add rows, end the steps where the rows end, or \
         hold the last value: `table(\"history.csv\", min(t, 10))`.",
        "steps t = 0 to 2 by 0.5\nload u = [table(\"history.csv\", t),0,0] on left",
        "steps t = 0 to 2 by 0.5\nload u = [table(\"history.csv\", min(t, 1)),0,0] on left",
    ),
    page(
        E451,
        "a second rate that nothing determines",
        "Dot2_u is the second rate of an unknown or multiplier with Dot2_u in a term. Without such a term the equations \
         say nothing of it; known fields have none.",
        "steps t = 0 to 1 by 0.1\nmeasure a = max(Dot2_u(1)) on all",
        "steps t = 0 to 1 by 0.1\nterm inertia on all : Dot2_u.Test_u\nmeasure a = max(Dot2_u(1)) on all",
    ),
    page(
        E452,
        "a setting that a scheme does not take",
        "newmark has beta (more than 0, at most 1) and gamma (1/2 to 1; of second order with 1/2), hht has alpha (-1/3 to \
         0), generalised_alpha has rho_inf (0 to 1), explicit has fraction (above 0, at most 0.95), bdf3, bdf2 and \
         backward_euler have none. All take `energy` where a term has `Dot2_`, and all but explicit `massless=REGION`: two layers of other \
         nodes have to stand behind those of the region, inertia has to be a linear term on cells that stays the same, and with newmark \
         and the alpha methods forces of the velocity that are not symmetric, such as that of Coriolis, may not act there.",
        "steps t = 0 to 1 by 0.1\nterm inertia on all : Dot2_u.Test_u\nscheme hht alpha=0.1",
        "steps t = 0 to 1 by 0.1\nterm inertia on all : Dot2_u.Test_u\nscheme hht alpha=-0.1",
    ),
    page(
        E453,
        "a scheme that cannot renew states",
        "The equations of hht and generalised_alpha stand within the step, the values of a state at its end: what a state \
         becomes would not belong to the displacements. newmark, bdf3, bdf2 and backward_euler have both at the \
         end.",
        "steps t = 0 to 1 by 0.1\nterm inertia on all : Dot2_u.Test_u\nstate s : scalar on all := s + u(1)\n\
         scheme hht alpha=-0.1",
        "steps t = 0 to 1 by 0.1\nterm inertia on all : Dot2_u.Test_u\nstate s : scalar on all := s + u(1)\n\
         scheme newmark",
    ),
    page(
        E454,
        "an initial rate that follows from the equations",
        "A field with Dot2_u in a term starts with a value and a rate. A field with a first rate only starts with a value: \
         its rate at the start follows from the equations.",
        "steps t = 0 to 1 by 0.1\nterm damper on all : Dot_u.Test_u\nstart Dot_u = [1,0,0]",
        "steps t = 0 to 1 by 0.1\nterm damper on all : Dot2_u.Test_u\nstart Dot_u = [1,0,0]",
    ),
    page(
        E455,
        "a mass that cannot be lumped",
        "`scheme explicit` puts the mass on the diagonal: the sums of the rows of the mass matrix. They must be positive, and \
         they must stay the same. Elements of degree 2 on triangles and tetrahedra have rows whose sum is zero or \
         negative, and a term in which `Dot2_u` stands beside something that depends on unknowns or on the step variable \
         has no mass of its own. Inertia that acts on another component, another field or the other side of a face, or through \
         gradients, is no number for each dof: lumped it would be another motion. Elements of degree 1, quadrilaterals and hexahedra have positive sums; write the inertia as a \
         term of its own.",
        "mesh box [0,0] to [1,1] cells [2,2] tri\nunknown u : scalar P2\nterm inertia on all : Dot2_u*Test_u\n\
         term stress on all : Grad_u.Grad_Test_u\nscheme explicit\nsteps t = 0 to 1 by auto",
        "mesh box [0,0] to [1,1] cells [2,2] tri\nunknown u : scalar P1\nterm inertia on all : Dot2_u*Test_u\n\
         term stress on all : Grad_u.Grad_Test_u\nscheme explicit\nsteps t = 0 to 1 by auto",
    ),
    page(
        E456,
        "a step above the stability limit",
        "Central differences are stable for steps up to 2/w with the highest frequency w of the bodies on their lumped mass, \
         less with damping that does not stand on the diagonal. The message has the limit, computed at the start. Steps \
         `by auto` take a part of it, 0.9 where `fraction` does not say. Larger cells, a softer penalty, or an implicit \
         scheme (`scheme newmark`) allow larger steps.",
        "unknown u : scalar\nterm inertia on all : Dot2_u*Test_u\nterm stress on all : Grad_u.Grad_Test_u\n\
         start u = x\nscheme explicit\nsteps t = 0 to 10 by 1",
        "unknown u : scalar\nterm inertia on all : Dot2_u*Test_u\nterm stress on all : Grad_u.Grad_Test_u\n\
         start u = x\nscheme explicit\nsteps t = 0 to 10 by auto",
    ),
    page(
        E457,
        "equations that explicit steps do not solve",
        "`scheme explicit` solves no system: each unknown follows from its own mass. A multiplier, an unknown without `Dot2_` \
         in a term, and one with a first rate alone have none. Contact is then written as a penalty or by Nitsche's method; an \
         implicit scheme (`scheme newmark`) takes all of them.",
        "unknown u : scalar\nunknown p : scalar\nterm inertia on all : Dot2_u*Test_u\n\
         term stress on all : Grad_u.Grad_Test_u + p*Test_u\nterm flow on all : Grad_p.Grad_Test_p\n\
         fix p = 1 on boundary\nstart u = x\nscheme explicit\nsteps t = 0 to 1 by 0.01",
        "unknown u : scalar\nunknown p : scalar\nterm inertia on all : Dot2_u*Test_u\n\
         term stress on all : Grad_u.Grad_Test_u + p*Test_u\nterm flow on all : Grad_p.Grad_Test_p\n\
         fix p = 1 on boundary\nstart u = x\nscheme newmark\nsteps t = 0 to 1 by 0.01",
    ),
    page(
        E460,
        "a reaction that there is not",
        "`reaction(u(1))` is the sum of the forces that prescribed values carry at the nodes of a region: minus what is left \
         of their equations. Some value of the unknown must be prescribed there, and the argument is linear in one unknown: \
         the arms of a moment are those of the reference placement, x*u(2) - y*u(1). With current arms, (x + u(1))*u(2), the \
         unknown is multiplied by itself. \
         The equations hold at the end of a step: not with `scheme explicit`, `hht` and `generalised_alpha`.",
        "measure force = reaction(Norm(u)) on west",
        "measure force = reaction(u(1)) on west",
    ),
    page(
        E461,
        "a change over the step that is not known",
        "`Rate(e)` is the value of e less that at the end of the previous step, over the increment. It is the rate of the \
         scheme with `scheme backward_euler` alone: backward differences of several steps (what `by auto` takes), Newmark's \
         rule and explicit steps have other rates, and a sum of both would conserve nothing. e has no rates, earlier values \
         and increments in it.",
        "unknown p : scalar\nterm storage on all : Rate(p + Previous_p)*Test_p\nterm flow on all : Grad_p.Grad_Test_p\n\
         steps t = 0 to 1 by 0.1",
        "unknown p : scalar\nterm storage on all : Rate(p + p^3)*Test_p\nterm flow on all : Grad_p.Grad_Test_p\n\
         load p = 1 on all\nfix p = 0 on west\nsteps t = 0 to 1 by 0.1",
    ),
    page(
        E462,
        "a balance that adds up nothing",
        "`balance water of p, pf` adds the equations of scalar unknowns. Equations of displacements are forces: what carries \
         them is measured by `reaction(u(1))`.",
        "balance water of u",
        "unknown p : scalar\nterm flow on all : Grad_p.Grad_Test_p\nload p = 1 on all\nfix p = 0 on west\nbalance water of p",
    ),
    page(
        E470,
        "a derivative that does not exist, or not yet",
        "`gradient` and `--gradient` differentiate measures in parameters of terms, loads, states, prescribed and first values, data and \
         measures, and of the corners, the place and the map of the mesh. No derivative follows parameters of its division, of \
         regions that do not move with it, mappings, steps and options, values `auto`, nodes \
         without mass, several ranks, steps that did not converge and a singular tangent at the solution. A share or \
         a count of points jumps: its derivative is zero wherever it has one; the mean of what the condition compares changes \
         smoothly. The message has the place and what to do; differences of whole runs (`wfl sweep`) do for the rest.",
        "measure share = mean(if Norm(u) > 1 then 1 else 0) on all",
        "measure excess = mean(pos_part(Norm(u) - 1)) on all",
    ),
    page(
        E471,
        "a derivative of what is no measure",
        "`gradient` names measures, each at the last step, as `sum(m)` or `mean(m)` over the steps, or `m at t = 4` with the \
         variable of `steps`.",
        "param stiff = 2\nmeasure tip = max(u(1)) on all\nload u = [stiff,0,0] on all\ngradient u with stiff",
        "param stiff = 2\nmeasure tip = max(u(1)) on all\nload u = [stiff,0,0] on all\ngradient tip with stiff",
    ),
    page(
        E472,
        "a derivative in what is no parameter",
        "Behind `with` stand parameters, and data fields as `field k`: the derivative in each of their values at nodes.",
        "data stiff : scalar = 2\nmeasure tip = max(u(1)) on all\nload u = [stiff,0,0] on all\ngradient tip with stiff",
        "data stiff : scalar = 2\nmeasure tip = max(u(1)) on all\nload u = [stiff,0,0] on all\ngradient tip with field stiff",
    ),
    page(
        E490,
        "a rim without edges",
        "Terms, loads and integrals on the rim of a surface are taken along its edges. An edge lies in the region where the \
         condition holds at both of its ends and in its middle; single nodes of a rim can be fixed, and have no length.",
        "unknown p : scalar on fault\nregion corner = rim of fault where y == 0 and z == 0\n\
         term flow on fault : Grad_p.Grad_Test_p\nterm out on corner : p*Test_p",
        "unknown p : scalar on fault\nregion side = rim of fault where y == 0\n\
         term flow on fault : Grad_p.Grad_Test_p\nterm out on side : p*Test_p",
    ),
    page(
        E501,
        "units that do not match",
        "Both sides of a sum must have the same unit. Units are checked as soon as a param, field or datum has one. A \
         penalty parameter is a stress over a length.",
        "param a = 1 [mm]\nparam b = 1 [MPa]\nmeasure c = max(a + b) on all",
        "param a = 1 [mm]\nparam b = 1 [mm]\nmeasure c = max(a + b) on all",
    ),
    page(
        E502,
        "a unit that is not known",
        "Units are SI units with their prefixes (N, Pa, J, W, g, m, s, K, A, mol) and a few others: bar, psi, t, L, in, \
         ft, min, h, day, year, rad, deg, degC. A product is written with a blank or `*`, a quotient with `/`, and \
         powers are whole.",
        "param E = 2e5 [MPaa]",
        "param E = 2e5 [MPa]",
    ),
}
