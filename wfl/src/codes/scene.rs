//! E4: the scene. E5: units and bounds. E6: the run. E7: parameters and leftovers. E8: not supported. Warnings.

use super::{CodePage, page};

pub(super) const PAGES: &[CodePage] = &[
    page(
        "E401",
        "a condition that meets nothing",
        "The region of a `fix` or `load` has no node, or no part, of the field. Often the field lives on the other \
         side.",
        "region east = faces where x == 1\nfix uL = [0,0,0] on east",
        "region east = faces where x == 1\nfix uR = [0,0,0] on east",
    ),
    page(
        "E402",
        "an empty region",
        "No cell, face or node meets the condition. Comparisons of coordinates by `==` allow for rounding, not for \
         another position.",
        "region east = faces where x == 1.01",
        "region east = faces where x == 1",
    ),
    page(
        "E403",
        "an unknown that nothing holds at the start",
        "A row of the first tangent is zero: the unknown enters only through contact that is open at the start. Start \
         from a touching state, or add a term that holds it.",
        "unknown d : scalar global\nterm contact on west : pos_part(u.Normal - d - 1)*(Test_u.Normal - Test_d)",
        "unknown d : scalar global\nstart d = -1.01\nterm contact on west : pos_part(u.Normal - d - 1)*(Test_u.Normal - Test_d)",
    ),
    page(
        "E405",
        "a region of the wrong kind",
        "Terms are integrated over cells or faces, fields live on cells or faces, and an interface lies between two \
         regions of cells. A region of nodes can only be fixed and loaded.",
        "region corner = nodes where x == 0 and y == 0\nterm t on corner : u.Test_u",
        "region side = faces where x == 0\nterm t on side : u.Test_u",
    ),
    page(
        "E406",
        "an element that does not exist here",
        "P elements belong to segments, triangles and tetrahedra, Q elements to segments, quadrilaterals and \
         hexahedra; D in front makes them discontinuous, and the digit is the degree.",
        "unknown p : scalar Q7",
        "unknown p : scalar Q2",
    ),
    page(
        "E407",
        "a value that cannot be prescribed",
        "Prescribed and nodal values are formulas of x, y, z and the variable of `steps`, without unknowns.",
        "fix u(1) = u(2) on west",
        "fix u(1) = y*z on west",
    ),
    page(
        "E408",
        "a box that cannot be built",
        "Both corners have the same number of coordinates, the shape of the cells fits the dimension, and there is \
         one whole number of cells for each direction, or one for all.",
        "mesh box [0,0,0] to [1,1,1] cells [4,4] hex",
        "mesh box [0,0,0] to [1,1,1] cells [4,4,4] hex",
    ),
    page(
        "E409",
        "a mesh that cannot be used",
        "Every cell needs a positive volume and every face a place in at most two cells. A `map` may turn cells inside \
         out.",
        "mesh box [0,0,0] to [1,1,1] cells [4,4,4] hex map [x, y, 0*z]",
        "mesh box [0,0,0] to [1,1,1] cells [4,4,4] hex map [x, y, 2*z]",
    ),
    page(
        "E410",
        "a mesh file that cannot be used",
        "The file is missing, has an unknown form, or holds cells or groups that make no sense together. The message \
         says which and where.",
        "mesh file \"plate.txt\"",
        "mesh file \"plate.msh\"",
    ),
    page(
        "E411",
        "a rule of integration that does not exist",
        "The degree of a quadrature rule is a whole number up to a fixed limit.",
        "quadrature on fault degree 2.5",
        "quadrature on fault degree 3",
    ),
    page(
        "E412",
        "a system that cannot be set up",
        "The unknowns, or the pairs of unknowns that meet in a term, are more than the numbers that count them. Too little \
         memory (E606) is told before, where there is less than that needs. A coarser mesh, or a lower degree, has fewer.",
        "mesh box [0,0,0] to [1,1,1] cells [1500,1500,1500] hex",
        "mesh box [0,0,0] to [1,1,1] cells [15,15,15] hex",
    ),
    page(
        "E413",
        "steps that never arrive",
        "The step has the wrong sign, is zero, or would need too many steps to get from the first to the last value. A \
         scene with rates starts at the first value and needs a second one.",
        "steps t = 0 to 1 by -0.1",
        "steps t = 0 to 1 by 0.1",
    ),
    page(
        "E414",
        "an option value that is not understood",
        "The option exists, but not with this value. The message lists the values.",
        "solver newton with search=maybe",
        "solver newton with search=auto",
    ),
    page(
        "E415",
        "data without a value",
        "A `data` field needs a formula or a file, unless the program that embeds the scene gives its values.",
        "data k : scalar",
        "data k : scalar = 1 + x",
    ),
    page(
        "E416",
        "an output that cannot be written",
        "`output vtk` writes fields on the mesh, `output csv` samples along a line and needs `along A to B`. \
         Quantities have up to two indices.",
        "output csv \"line\" : u",
        "output csv \"line\" : u along [0,0,0] to [1,1,1]",
    ),
    page(
        "E417",
        "a value that cannot be found for `auto`",
        "`auto` stands for the parameter of Nitsche's method, or a factor of it: the value follows from the stiffness of \
         the elements at the interface. A penalty has no such value: it is what accuracy asks for.",
        "param gamma = auto",
        "param gamma = 1e5",
    ),
    page(
        "E418",
        "values in a file that do not fit",
        "The file has a line of names and then a line of numbers for each node, with commas between: x, y, z, then u for a \
         scalar, u_1, u_2, ... for a vector. Each node needs a line at its place, within 1e-9 of the mesh size.",
        "data k : scalar = \"values_of_another_mesh.csv\"",
        "data k : scalar = 1 + x",
    ),
    page(
        "E419",
        "a mapping that leads nowhere",
        "No point of the place has an image. `within` is the longest distance from a point to its image; a ray meets \
         faces that look against it; a `point` must lie in a cell where the fields live that are read there.",
        "region east = faces where x == 1\nmapping m = project from west onto east within 0.5\n\
         measure far = max(Norm(Interpolate(u, m))) on west",
        "region east = faces where x == 1\nmapping m = project from west onto east within 1.5\n\
         measure far = max(Norm(Interpolate(u, m))) on west",
    ),
    page(
        "E421",
        "a scene without a mesh",
        "A scene needs one `mesh` statement: a box, or a file with cells and named groups.",
        "unknown p : scalar",
        "mesh box [0,0,0] to [1,1,1] cells [4,4,4] hex\nunknown p : scalar",
    ),
    page(
        "E422",
        "a scene without a term",
        "The sum of all terms is zero for every test function: without a term there is no equation.",
        "unknown p : scalar",
        "unknown p : scalar\nterm flow on all : Grad_p.Grad_Test_p - Test_p",
    ),
    page(
        "E423",
        "a scene without an unknown",
        "A scene needs a field to solve for. Data and states are known; multipliers act on unknowns.",
        "data p : scalar = 1",
        "unknown p : scalar",
    ),
    page(
        "E424",
        "a second statement of a kind that stands once",
        "A scene has one mesh, one `steps` and one `solver`. The message shows the first one; merge both into one statement.",
        "solver newton\nsolver newton with tol=1e-8",
        "solver newton with tol=1e-8",
    ),
    page(
        "E425",
        "cells that are in no term",
        "The mesh has cells where no equation holds: a hole in the model. Often the conditions of two regions leave a \
         slot between them, or a group of the mesh file has no term. A mesh that holds more than the scene needs says so.",
        "region left = cells where x < 0.5\nregion right = cells where x > 0.7\n\
         term base on left, right : sigma(u):Grad_Test_u",
        "region left = cells where x < 0.5\nregion right = cells where x > 0.5\n\
         term base on left, right : sigma(u):Grad_Test_u",
    ),
    page(
        "E430",
        "more steps than were asked for",
        "More than 100,000 steps are asked about before they begin: memory and report keep about 2 kB of each, and every \
         output has a file for each unless it says `every`. Where they are meant, `with most=` allows them.",
        "steps t = 0 to 1 by 1e-7",
        "steps t = 0 to 1 by 1e-3",
    ),
    page(
        "E431",
        "a load at nodes that cannot act",
        "A load on a region of nodes is a force at each of its nodes. Each must be a node of the field, once: not a node \
         of another body, not one that `split` gives two sides.",
        "region tips = nodes where x == 0 or x == 1\nload uL = [0,0,-1] on tips",
        "region tips = nodes of left where x == 0\nload uL = [0,0,-1] on tips",
    ),
    page(
        "E432",
        "a prescribed value that is lost to another",
        "Two `fix` statements give one displacement different values at every node of the earlier one: nothing of it is \
         left. Equal values are silent. Values that grow from one to another are one formula of the variable of `steps`.",
        "fix u = [0,0,0] on west\nfix u(1) = 0.1 on west",
        "fix u = [0.1,0,0] on west",
    ),
    page(
        "E433",
        "two outputs of one name",
        "Files of one name replace each other, and so do quantities of one name in a file. Names that differ in \
         the case of letters only are one name on some systems.",
        "output vtk \"plate\" : u\noutput vtk \"Plate\" : Grad_u as strain",
        "output vtk \"plate\" : u\noutput vtk \"strains\" : Grad_u as strain",
    ),
    page(
        "E434",
        "one thing stated twice",
        "Of two rules of integration on one region, or two first values of one field, one would be lost.",
        "quadrature on all degree 4\nquadrature on all degree 6",
        "quadrature on all degree 6",
    ),
    page(
        "E435",
        "a line that meets no body",
        "No point of the line of an `output csv` lies in a body where one of its quantities lives: every row would be \
         `nan`.",
        "output csv \"line\" : u along [2,0,0] to [3,0,0]",
        "output csv \"line\" : u along [0,0,0] to [1,0,0]",
    ),
    page(
        "E440",
        "a tolerance that is none",
        "`tol` is the part of the forces that may be out of balance when an iteration stops. Above 0.1 every state would be \
         a solution, the first guess too, and every number that follows would be wrong.",
        "solver newton with tol=0.5",
        "solver newton with tol=1e-10",
    ),
    page(
        "E441",
        "an expression that is too deep",
        "More than 10,000 operations stand one on the result of the other: a product of vectors and matrices with that many \
         factors, or sums in sums. Derivatives of it could not be formed in the room there is. Sums, conditions and \
         products of scalars may be as long as the text. The limit is the same for every command.",
        "def a = x.*x.*x  # ... 10,001 times",
        "def a = x^3",
    ),
    page(
        "E501",
        "units that do not match",
        "Both sides of a sum must have one unit. Units are checked as soon as a param, field or datum carries one; a \
         penalty stiffness per area is a stress over a length.",
        "param a = 1 [mm]\nparam b = 1 [MPa]\nmeasure c = max(a + b) on all",
        "param a = 1 [mm]\nparam b = 1 [mm]\nmeasure c = max(a + b) on all",
    ),
    page(
        "E502",
        "a unit that is not known",
        "Units are SI units with their prefixes (N, Pa, J, W, g, m, s, K, A, mol) and a few others: bar, psi, t, L, in, \
         ft, min, h, day, year, rad, deg, degC. A product is written with `*`, `/` and whole powers.",
        "param E = 2e5 [MPaa]",
        "param E = 2e5 [MPa]",
    ),
    page(
        "E601",
        "not a number in the run",
        "A formula gave infinity or an undefined value at a point: a logarithm or root of a negative number, a \
         division by zero. Nothing is dropped; the run stops with the place and the values.",
        "def mu = log(Norm(u))",
        "def mu = log(1 + Norm(u))",
    ),
    page(
        "E602",
        "a step that cannot be solved",
        "The linear system of a step is singular: some change of the unknowns changes no equation. The message names the \
         field, says what the change is and which term should resist it. A body moves as a whole: nothing fixes it, or its \
         contact is open, slides with all its friction, has none, is zero or has a wrong sign. An equation is empty: no term \
         tests the unknown, a multiplier has no law, a coefficient is zero. A field is known up to a constant. A pressure \
         alternates from node to node: its elements do not fit those of the velocity. A motion is not seen by a quadrature \
         rule of too low degree. Equations depend on each other. Or the numbers are so far apart that rounding leaves nothing \
         of the smaller ones: a parameter is far too large, or a law too steep.",
        "fix u(1) = 0 on west",
        "fix u = [0,0,0] on west",
    ),
    page(
        "E603",
        "a step that did not converge",
        "Newton reached its last iteration above the tolerance. The step is marked in the report, its fields are not \
         written, and the run ends unless `on_fail=go_on` asks otherwise. It is tried in smaller parts first, until the attempts \
         that came to nothing have taken ten times `max_iter` iterations. Smaller steps or another gamma often help; a \
         body that slides away has no equilibrium at all.",
        "solver newton with max_iter=3",
        "solver newton with max_iter=50",
    ),
    page(
        "E604",
        "an expectation that does not hold",
        "The condition of an `expect` statement is false, or not a number, at the end of the run.",
        "measure m = mean(u(1)) on all\nexpect m > 1e30",
        "measure m = mean(u(1)) on all\nexpect m < 1e30",
    ),
    page(
        "E605",
        "an accuracy that cannot be had",
        "No setting of the scene with an estimated error as small as the accuracy wanted was found, or it would take \
         longer than the budget. A solution with a singularity (a crack tip, an edge of contact) converges slowly in its \
         gradients, whatever the degree. The message says what can be had; `--of` takes another quantity, `--budget` \
         allows more time.",
        "solver newton with accuracy=1e-6, of=H1",
        "solver newton with accuracy=1e-2",
    ),
    page(
        "E606",
        "more memory than there is",
        "A mesh, a matrix, its factor or a file would not fit into the memory of the machine, of a control group, of the \
         address space (`ulimit -v`), or into what `--memory` allows. Large needs are estimated before anything is \
         allocated; the message says what needs how much. What is taken beyond the estimates is seen within a \
         millisecond and ends the run: files have their former content or the whole new one. Fewer cells, or a lower \
         degree, need less.",
        "mesh box [0,0,0] to [1,1,1] cells [1500,1500,1500]",
        "mesh box [0,0,0] to [1,1,1] cells [16,16,16]",
    ),
    page(
        "E609",
        "machine code could not be made",
        "The program could not compile a formula for this machine. This is a fault of the program, not of the scene; \
         please report it with the scene.",
        "def a = gamma",
        "def b = gamma",
    ),
    page(
        "E610",
        "a given value that is not finite",
        "A prescribed value, a first guess, a data field, a mapping or the map of the mesh came out infinite or undefined at \
         a node or point: a division by zero, a logarithm of a negative number, a number above 1.8e308. The message marks \
         the operation and says where it happened. Nothing is solved with such a value.",
        "fix u(1) = 1/x on west",
        "fix u(1) = 1/(1 + x) on west",
    ),
    page(
        "E611",
        "a measure that is not finite",
        "A measure came out infinite or undefined: its expression divides by zero at a point, or its region has no size. \
         The results are written, but the run has not succeeded: exit code 1.",
        "measure m = mean(1/u(1)) on west",
        "measure m = mean(u(1)) on west",
    ),
    page(
        "E612",
        "a state that is not finite",
        "An unknown, or a sum of the forces that follow from it, is larger than any number (1.8e308), or the update of a \
         state gave infinity or no number. Such a state is never a solution, is not written and not measured. Values \
         that are prescribed, loaded or started from are far too large for the other numbers of the scene.",
        "fix u(1) = 1e308 on west",
        "fix u(1) = 1e-3 on west",
    ),
    page(
        "E701",
        "a param outside its bounds",
        "A value, often from the command line, is not in the range or set that the declaration allows.",
        "wfl run fault.wfl theta=2",
        "wfl run fault.wfl theta=1",
    ),
    page(
        "E702",
        "a param or option that is not finite",
        "A value that is computed before the run came out infinite or undefined, for example because it is larger than any number.",
        "param a = 1e200*1e200",
        "param a = 1e200",
    ),
    page(
        "E703",
        "a value for something that is no param",
        "On the command line NAME=VALUE replaces the value of a param that the scene declares. The note lists them.",
        "wfl run fault.wfl gama=1e4",
        "wfl run fault.wfl gamma=1e4",
    ),
    page(
        "E710",
        "an output with a name that is no file name",
        "Results are files of the results folder, named after their output. A name is one that every system has: no path, \
         no dot at its beginning, none of < > : \" | ? *, no dot or blank at its end, none of the names that Windows keeps \
         for devices (CON, NUL, COM1, ...), at most 255 bytes with number and ending.",
        "output vtk \"nul\" : u",
        "output vtk \"fields\" : u",
    ),
    page(
        "E711",
        "a results folder that another process writes to",
        "A run, a sweep or a report locks its folder as long as it writes. The system frees the lock when the process ends, \
         also when it is killed. Wait until it has ended, or write elsewhere.",
        "wfl run fault.wfl --out out/fault    # while another one runs there",
        "wfl run fault.wfl --out out/second",
    ),
    page(
        "E712",
        "a file that is not ours is in the way",
        "Only files that the manifest of a results folder names are replaced or removed. A file that this program did not \
         write there, a folder, or a link under the name of a result is left alone, and the run does not begin. Move it \
         away, or write elsewhere.",
        "wfl run fault.wfl --out .    # where a line.csv is that the run would replace",
        "wfl run fault.wfl --out out/fault",
    ),
    page(
        "E713",
        "a folder that holds something else",
        "The folder has the results of a run and a sweep is to be written there, or the other way round. One folder holds \
         one of them.",
        "wfl sweep fault.wfl gamma=1e4,1e6 --out out/fault    # the results of wfl run",
        "wfl sweep fault.wfl gamma=1e4,1e6 --out out/sweep",
    ),
    page(
        "E714",
        "results of another run",
        "A run goes on from its own results only. What it is follows from everything it reads: its texts, mesh and data \
         files, the values of its parameters, knobs, precision, and the version of the program. The message names what \
         differs. Without --resume the run starts from the beginning and replaces what is there.",
        "wfl run fault.wfl gamma=1e6 --resume    # what was stopped had gamma=1e4",
        "wfl run fault.wfl gamma=1e4 --resume",
    ),
    page(
        "E715",
        "results that are damaged or gone",
        "A file of a results folder is not what was written there, or is not there: the manifest of the folder has the size \
         and the hash of each. Numbers of such a file are not gone on from, and not shown.",
        "wfl run fault.wfl --resume    # after fault_0003.vtu was edited",
        "wfl run fault.wfl",
    ),
    page(
        "E716",
        "a result in the place of a file that the scene reads",
        "An output has the name of a mesh, data or start file of the scene, in the same folder: it would be replaced by the \
         result. Give the output another name, or write elsewhere.",
        "wfl run layers.wfl --out .    # reads layers.csv and writes it",
        "wfl run layers.wfl --out out/layers",
    ),
    page(
        "E717",
        "results cannot be written",
        "The system did not take a file or a folder: the disc is full, or the folder cannot be written to. What was written \
         before is whole. A run goes on where it stopped with --resume, a sweep when it is started again.",
        "wfl run fault.wfl --out /full/disc",
        "wfl run fault.wfl --out /other/disc --resume",
    ),
    page(
        "E801",
        "GWFL that this program does not have",
        "Cut elements, elementary transformations, two-domain integrals and complex fields are not available. A crack \
         that follows faces is an interface between two regions of cells.",
        "term jump on fault : (Xfem_plus(u) - Xfem_minus(u)).Test_u",
        "term jump on fault : (uL - Interpolate(uR, neighbor_element)).Test_uL",
    ),
    page(
        "E802",
        "something that is not available yet",
        "The language has it, this program does not do it yet. The message says what to write instead.",
        "mapping m = point [1 - x, y, z]\noutput vtk \"r\" : Interpolate(u, m)",
        "mapping m = point [1 - x, y, z]\nmeasure r = max(Norm(Interpolate(u, m))) on all",
    ),
    page(
        "W404",
        "multipliers without a jump to act on",
        "Where what is prescribed leaves the two sides no way to part, a multiplier has no jump to act on, and where two \
         surfaces meet another multiplier may hold the same jump already: kept, such components make the system singular, \
         so they are dropped. Only components that cannot jump are. Where the sides can still slide and friction reads the \
         normal traction, that follows the nearest node at which it is determined: dropped, the friction there would be \
         lost. An augmented law goes on at dropped nodes as a penalty of stiffness gamma. `with crosspoints=keep` keeps \
         them. At the end of a crack, where both sides are one node, nothing is said: `wfl check` counts such nodes.",
        "multiplier l : vector on fault\nfix uL, uR = [0,0,0] on boundary\n\
         term glue on fault : l.jump(Test_uL,Test_uR) + jump(uL,uR).Test_l",
        "multiplier l : vector on fault with crosspoints=keep\nfix uL, uR = [0,0,0] on boundary\n\
         term glue on fault : l.jump(Test_uL,Test_uR) + jump(uL,uR).Test_l",
    ),
    page(
        "W405",
        "nodes of one body at the same place",
        "Two nodes that cells of one body use stand at the same place but are not the same node: the body is torn \
         there. Mesh generators leave such pairs where volumes were not fused. They are not joined silently.",
        "mesh file \"torn.msh\"",
        "mesh file \"fused.msh\"",
    ),
    page(
        "W406",
        "points without an image",
        "Some points of a term have no image under its mapping. They take no part in the term: nothing acts there.",
        "mapping m = point [x + 0.5, y, z]\nmeasure r = max(Norm(Interpolate(u, m))) on all",
        "mapping m = point [x + 0.5, y, z]\nmeasure r = max(Norm(Interpolate(u, m))) on left",
    ),
    page(
        "W407",
        "a group of the mesh file that is called otherwise",
        "The name of a group is built in, taken by another group of another dimension, or declared by the scene. The \
         message says what the group is called in the scene; another name in the mesh generator avoids it.",
        "mesh file \"blocks.msh\"\nregion left = cells where x < 0",
        "mesh file \"blocks.msh\"\nregion near = cells where x < 0",
    ),
    page(
        "W410",
        "a last step that is shorter than the others",
        "The last value of `steps` is met exactly. Where whole steps do not meet it, the last step is what is left. An \
         increment that divides the distance makes all steps equal.",
        "steps t = 0 to 1 by 0.3",
        "steps t = 0 to 1 by 0.25",
    ),
    page(
        "W411",
        "a statement that changes nothing",
        "What is written has no effect on the numbers: a rule of integration where nothing is integrated, a term that is \
         zero, a first guess where every value is prescribed, steps whose variable nothing reads. Often a region or a \
         name is another one than meant.",
        "quadrature on west degree 9",
        "quadrature on all degree 9",
    ),
    page(
        "W412",
        "a load on what is fixed",
        "The load acts on displacements that are prescribed on the whole of its region: the support takes it, and no \
         unknown changes. A load on a face of which a part is free is silent.",
        "load u(1) = 1 on west",
        "region east = faces where x == 1\nload u(1) = 1 on east",
    ),
    page(
        "W413",
        "two prescribed values at common nodes",
        "Regions of two `fix` statements overlap, and their values differ at the nodes they share: there the later statement \
         holds. Regions without common nodes, or equal values there, are silent.",
        "region floor = faces where z == 0\nfix u = [0,0,0] on west\nfix u(3) = 0.1 on floor",
        "region lid = faces where x == 1\nfix u = [0,0,0] on west\nfix u(3) = 0.1 on lid",
    ),
    page(
        "W414",
        "an unknown that no term determines",
        "No term with the unknown is left, often because a parameter is 0 and all its terms have that factor. What is \
         prescribed holds; every other value stays what `start` says, or 0, and measures and outputs show that.",
        "unknown v : scalar\nparam k = 0\nterm heat on all : k*Grad_v.Grad_Test_v\nfix v = 7 on west\nmeasure top = max(v) on all",
        "unknown v : scalar\nparam k = 1\nterm heat on all : k*Grad_v.Grad_Test_v\nfix v = 7 on west\nmeasure top = max(v) on all",
    ),
    page(
        "W415",
        "points of a line without a value",
        "A line of `output csv` leaves the mesh, or runs through no body where one of its quantities lives. The file has \
         `nan` there.",
        "output csv \"line\" : u along [0,0,0] to [1.5,0,0]",
        "output csv \"line\" : u along [0,0,0] to [1,0,0]",
    ),
    page(
        "W416",
        "free nodes between fixed ones",
        "A region of nodes has nodes of the mesh. A field of degree 2 or more has others between them, on edges and faces: a \
         `fix` on the region leaves those free, and the body bends there. A region of faces has all of them.",
        "unknown u : vector Q2\nregion side = nodes where x == 1\nfix u(1) = 0 on side",
        "unknown u : vector Q2\nregion side = faces where x == 1\nfix u(1) = 0 on side",
    ),
    page(
        "W501",
        "a step that Newton does not see",
        "Heaviside and sign have derivative 0, so a term that depends on an unknown through them alone looks constant \
         to Newton. A product with the argument itself, such as pos_part, has a derivative.",
        "term t on fault : Heaviside(Pn)*(Test_uL.Normal)",
        "term t on fault : pos_part(Pn)*(Test_uL.Normal)",
    ),
    page(
        "W502",
        "a radius that may be negative",
        "Ball_projection with a negative radius gives 0. If the radius changes sign with the contact pressure, write \
         its positive part, so that the reader sees it.",
        "term t on fault : Ball_projection(uL, fric*Pn).Test_uL",
        "term t on fault : Ball_projection(uL, fric*pos_part(Pn)).Test_uL",
    ),
    page(
        "W503",
        "a Nitsche parameter below its safe bound",
        "Below (1+theta)^2/4 times the trace constant of the elements the problem is not coercive and Newton may \
         fail. The message names the smallest safe value on this mesh.",
        "param gamma = 1e3",
        "param gamma = 1e6",
    ),
    page(
        "W504",
        "a Nitsche parameter out of proportion",
        "The parameter is far below or far above the stiffness of the cells at the interface over their size: digits of \
         the pressure or of the jump are lost to rounding. The message names the usual value on this mesh.",
        "param gamma = 1e-6",
        "param gamma = 1e6",
    ),
    page(
        "W505",
        "terms of different units in one equation",
        "The sum of all terms with one test function is zero, so after integration over their regions they have one \
         unit. A term on faces lacks one length against a term on cells.",
        "param k = 1 [N/mm^4]\nparam p = 2 [N/mm]\nunknown u : vector [mm]\nterm base on all : k*u.Test_u\n\
         term push on west : p*(Normal.Test_u)",
        "param k = 1 [N/mm^4]\nparam p = 2 [N/mm^2]\nunknown u : vector [mm]\nterm base on all : k*u.Test_u\n\
         term push on west : p*(Normal.Test_u)",
    ),
    page(
        "W506",
        "a rule with fewer points than a face has nodes",
        "`quadrature` asks for a degree whose points are fewer than the nodes of the unknowns on a face. Motions that \
         vanish at these points feel no force of the term: contact lets them through, a tangent may be singular. \
         Without the statement the degree follows from the terms.",
        "unknown uL : vector Q2 on left\nquadrature on fault degree 1\n\
         term tie on fault : gamma*jump(uL,uR).jump(Test_uL,Test_uR)",
        "unknown uL : vector Q2 on left\nquadrature on fault degree 4\n\
         term tie on fault : gamma*jump(uL,uR).jump(Test_uL,Test_uR)",
    ),
    page(
        "W507",
        "contact terms that do not carry the stress of the bodies",
        "Bodies of constant stress were put together at a point of the faces, with no gap, pressed and sheared within the \
         friction bound, and the terms there were asked for their forces. A method whose projections read stresses or \
         multipliers gives back the traction of the bodies on each side, whatever its parameter is. These terms give \
         another part of it: a traction or a jump with the wrong sign, the traction of another side, a test function on \
         one side only, or one half of a form that has two. The result converges to another problem's, or slowly.",
        "def Pn = gamma*(jump(uL,uR).Normal) + trac(uL).Normal",
        "def Pn = gamma*(jump(uL,uR).Normal) - trac(uL).Normal",
    ),
    page(
        "W508",
        "stresses of the test function that do not cancel",
        "Where contact is closed, the terms of Nitsche's method that are tested with the stress of the test function cancel: \
         the linear one, -theta/gamma times the traction, and what the projections give. Here they do not: one is \
         missing, has another sign or another factor. The exact solution does not satisfy such a form.",
        "def Ptheta = gamma*jump(Test_uL,Test_uR) + theta*trac(Test_uL)",
        "def Ptheta = gamma*jump(Test_uL,Test_uR) - theta*trac(Test_uL)",
    ),
    page(
        "W509",
        "a multiplier whose law contradicts the balance of forces",
        "With closed contact the multiplier that balances the stress of the bodies does not satisfy its own law, and none \
         does both: a sign of the multiplier in the projections, in the force or in its law is turned round.",
        "term law on fault : -1/gamma*(lambda - force).Test_lambda",
        "term law on fault : -1/gamma*(lambda + force).Test_lambda",
    ),
    page(
        "W510",
        "forces of contact the wrong way round",
        "Bodies of constant stress were put together at a point of the faces, apart from each other, and sliding. The terms \
         push or pull across an open gap, the more the wider it is, or friction drives the sliding that it should resist: \
         a jump or a projection has the wrong sign.",
        "def Pn = -gamma*(jump(uL,uR).Normal) - trac(uL).Normal",
        "def Pn = gamma*(jump(uL,uR).Normal) - trac(uL).Normal",
    ),
    page(
        "W602",
        "a contact set that goes in a circle",
        "Newton met a contact state it has seen before at the same load: some points switch between stick and slip, \
         or open and closed, in turn. Line search or smaller steps break the circle.",
        "solver newton with search=none",
        "solver newton with search=auto",
    ),
    page(
        "W605",
        "a result with few digits",
        "Rounding alone changes the unknowns by more than a thousandth of their size: the tangent is too badly \
         conditioned for the precision of the machine. Most often a penalty or Nitsche parameter is far above E/h, or \
         a material is nearly incompressible. The number of digits of each step is in the report.",
        "param gamma = 1e20",
        "param gamma = 1e6",
    ),
    page(
        "W606",
        "a condition of mechanics that does not hold",
        "A converged state does not satisfy what any solution must, at the step that is worst; the number is told with what \
         it may be. Loads and reactions are in balance, and forces on the two sides of an interface are equal (1e-6 of \
         the forces): else a term is wrong. Bodies in contact do not overlap, and points that stick have not slid (0.2 of \
         the largest displacement): a larger penalty, Nitsche's method or a multiplier holds them. Forces of contact push \
         where the sides press, and friction resists (on all but 0.05 of the area in contact): else a sign is wrong. \
         Tractions lie in the friction cone (all but 0.5 of them; between the points at which a law holds they leave it \
         by what a finer mesh makes small). The law of a multiplier holds at every point, and the result does not depend \
         on its parameter, where the points are the nodes (`quadrature ... vertex`, elements of degree 1) and the faces of a \
         node have one normal; on a bent interface that slides it cannot: finer faces help, and a run with another \
         parameter shows how much depends on it. Where nothing has moved nothing is judged: what is left is rounding.",
        "param gamma = 1e3",
        "param gamma = 1e6",
    ),
    page(
        "W607",
        "a start at which the equations are singular",
        "The tangent has no inverse, or is not finite, where all unknowns are zero, as that of a p-Laplacian is. The step \
         began from a linear field of small slope instead. If there are several solutions, `start` decides which is \
         found.",
        "term law on all : Norm_sqr(Grad_u)*(Grad_u:Grad_Test_u)\nload u = [0,0,-1] on all",
        "term law on all : Norm_sqr(Grad_u)*(Grad_u:Grad_Test_u)\nload u = [0,0,-1] on all\nstart u = [0, 0, -0.001*x]",
    ),
    page(
        "W608",
        "an accuracy without the error of the mesh",
        "The mesh comes from a file, so that it cannot be refined and its error cannot be told. Tolerance and penalty are \
         set for the accuracy wanted; the exit code says that it was not shown.",
        "mesh file \"body.msh\"\nsolver newton with accuracy=1e-2",
        "mesh box [0,0,0] to [1,1,1] cells [2,2,2] hex\nsolver newton with accuracy=1e-2",
    ),
    page(
        "W609",
        "a state that may be one of several",
        "Loads have several states, as friction may have them where its coefficient is large or a body can be wedged, and \
         Nitsche's method far below E/h. Three things tell. Newton's method came to the state on a path along which the \
         load went down as well as up, from one change of contact to the next. A tangent on the way had a determinant of \
         another sign than that of the bodies tied together: some loads have several states then, though perhaps not this \
         one. Or the tangent at the state itself has, which proves that other states satisfy the same equations. Which one is found depends on the steps. Smaller steps follow the history of the load more closely; \
         another method or a larger parameter shows what depends on it.",
        "param fric = 5\nsteps t = 0 to 10 by 1",
        "param fric = 5\nsteps t = 0 to 10 by 0.1",
    ),
    page(
        "W610",
        "a result that is not finite",
        "A quantity of a result file, or one that is printed, is infinite or undefined at a point. The file keeps it as nan \
         or inf; the message says where it was met first.",
        "output vtk \"out\" : 1/u(1) as a",
        "output vtk \"out\" : u(1) as a",
    ),
    page(
        "W611",
        "a body that is not positive definite",
        "The terms of a field on cells resist its gradients with a stiffness that is negative along some direction: E below 0, \
         a Poisson number outside -1 to 0.5, a diffusivity below 0, or a term with the wrong sign. It is computed from the \
         terms, summed at points of the cells, whatever the parameters are called. Such a body gives energy when it is \
         deformed, and what is solved has no meaning as its equilibrium. Fields that share terms on cells with another \
         unknown (a pressure) may be negative as a whole.",
        "param E = -1000",
        "param E = 1000",
    ),
    page(
        "W612",
        "a radius that is negative at every point",
        "The radius of a projection on a ball is a number below 0. The projection then gives 0 whatever its argument is: friction \
         or plasticity is lost. A radius of 0 is a choice (no friction), a negative one a mistake of sign.",
        "def t = Ball_projection(u, -0.4)",
        "def t = Ball_projection(u, 0.4)",
    ),
    page(
        "W615",
        "friction that gives energy back",
        "Friction takes energy from the motion. In the step that is named its forces as a whole did work on the slip \
         instead. The usual cause is a law on the total slip: it holds under loads that grow, and when they go down it \
         drives the slip back. Written with the slip of the step, by `Previous_u`, it remembers the way. The report has \
         the energy of each step (friction_work).",
        "def Pt = gamma*tang(jump(uL,uR)) - tang(trac(uL))",
        "def Pt = gamma*tang(jump(uL,uR) - jump(Previous_uL,Previous_uR)) - tang(trac(uL))",
    ),
    page(
        "W702",
        "declared but not needed",
        "No statement uses this param, macro, region or field. An unused unknown is not allocated. Remove it, or look \
         for a misspelt use.",
        "param rho = 2700",
        "param rho = 2700\nterm weight on all : rho*9.81*Test_u(3)",
    ),
];
