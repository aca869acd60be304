//! W4: the scene. W5: formulations. W6: the run. W7: leftovers.

use super::{Code, CodePage};

pages! {
    page(
        W404,
        "multiplier components without a jump",
        "A multiplier component is dropped where it would make the system singular: prescribed values leave no jump \
         for it, or at the edge of two surfaces another multiplier constrains the same jump. Components that can jump \
         are kept. Where the sides can still slide and friction needs the normal traction, the traction of the nearest \
         node where it is determined is used. An augmented Lagrangian acts as a penalty of stiffness gamma at dropped \
         nodes. The multiplier is zero where it is dropped: displacements are right, its integrals lack what these nodes \
         would carry. `with crosspoints=follow` it has the value of the nearest node there instead, and nothing is told; \
         `with crosspoints=keep` keeps all components. At the tips of a crack, where both sides are one node, the \
         traction of the nearest node that has a jump is used, without a message: `wfl check` counts these nodes, and W680 \
         tells of tips without such a node.",
        "multiplier l : vector on fault\nfix uL, uR = [0,0,0] on boundary\n\
         term glue on fault : l.jump(Test_uL,Test_uR) + jump(uL,uR).Test_l",
        "multiplier l : vector on fault with crosspoints=keep\nfix uL, uR = [0,0,0] on boundary\n\
         term glue on fault : l.jump(Test_uL,Test_uR) + jump(uL,uR).Test_l",
    ),
    page(
        W405,
        "cells that are not joined",
        "Two different nodes of cells of one body have the same coordinates, or faces lie on each other with one unknown on \
         both sides and nothing joins them: no interface, no mapping, no term or prescribed value there. The body is torn. \
         Mesh generators leave such places where volumes were not fused. Nodes are not merged automatically. Two bodies that \
         are meant to touch have an unknown each, or a mapping between their faces.",
        "mesh file \"torn.msh\"",
        "mesh file \"fused.msh\"",
    ),
    page(
        W406,
        "points without an image",
        "Some points of a term have no image under its mapping. The term is not integrated there.",
        "mapping m = point [x + 0.5, y, z]\nmeasure r = max(Norm(Interpolate(u, m))) on all",
        "mapping m = point [x + 0.5, y, z]\nmeasure r = max(Norm(Interpolate(u, m))) on left",
    ),
    page(
        W407,
        "a renamed group of the mesh file",
        "The name of the group is built in, used by a group of another dimension, or declared by the scene. The \
         message gives its name in the scene; another name in the mesh generator avoids the conflict.",
        "mesh file \"blocks.msh\"\nregion left = cells where x < 0",
        "mesh file \"blocks.msh\"\nregion near = cells where x < 0",
    ),
    page(
        W410,
        "a last step that is shorter than the others",
        "The last value of `steps` is met exactly. If the increment does not divide the interval, the last step is \
         shorter. Another increment makes all steps equal.",
        "steps t = 0 to 1 by 0.3",
        "steps t = 0 to 1 by 0.25",
    ),
    page(
        W411,
        "a statement without effect",
        "The statement does not change any result: a quadrature rule where nothing is integrated, a term that is zero, \
         a load whose formula is zero on its whole region in all steps, an initial guess where every value is prescribed, steps whose variable is not used. Often the name or the \
         region is a wrong one.",
        "quadrature on west degree 9",
        "quadrature on all degree 9",
    ),
    page(
        W412,
        "a load on prescribed displacements",
        "The load, or the term on faces, acts on displacements that are prescribed on its whole region: the support takes \
         it, and no unknown changes. A load on a partly free region gives no warning.",
        "load u(1) = 1 on west",
        "region east = faces where x == 1\nload u(1) = 1 on east",
    ),
    page(
        W413,
        "different prescribed values at common nodes",
        "The regions of two `fix` statements overlap, and their values differ at the common nodes. There the later \
         statement holds. Equal values give no warning.",
        "region floor = faces where z == 0\nfix u = [0,0,0] on west\nfix u(3) = 0.1 on floor",
        "region lid = faces where x == 1\nfix u = [0,0,0] on west\nfix u(3) = 0.1 on lid",
    ),
    page(
        W414,
        "an unknown that no term determines",
        "No term contains the unknown, often because a parameter that multiplies all of them is 0. Prescribed values \
         hold; all other values keep what `start` says, or 0, also in measures and outputs.",
        "unknown v : scalar\nparam k = 0\nterm heat on all : k*Grad_v.Grad_Test_v\nfix v = 7 on west\nmeasure top = max(v) on all",
        "unknown v : scalar\nparam k = 1\nterm heat on all : k*Grad_v.Grad_Test_v\nfix v = 7 on west\nmeasure top = max(v) on all",
    ),
    page(
        W415,
        "points of a line outside the bodies",
        "A line of `output csv` leaves the mesh, or passes through no body where one of its quantities is defined. The \
         file has `nan` there.",
        "output csv \"line\" : u along [0,0,0] to [1.5,0,0]",
        "output csv \"line\" : u along [0,0,0] to [1,0,0]",
    ),
    page(
        W416,
        "free nodes between fixed ones",
        "A region of nodes consists of mesh nodes. A field of degree 2 or more has further nodes on edges and faces. A \
         `fix` on the region leaves those free, and the body deforms there. A region of faces includes them.",
        "unknown u : vector Q2\nregion side = nodes where x == 1\nfix u(1) = 0 on side",
        "unknown u : vector Q2\nregion side = faces where x == 1\nfix u(1) = 0 on side",
    ),
    page(
        W417,
        "a jump of a field that has one value",
        "The term, measure or output has the difference of the values on both sides of faces, and the field has the same \
         unknowns on both sides of all of them: the difference is zero for every state, a pressure on the crack does \
         nothing, and contact never opens. Usually `split` is missing. A field with a discontinuous element and two \
         fields that meet at the faces jump without it; gradients jump across every face.",
        "term spring on fault : gamma*jump(u,u).jump(Test_u,Test_u)",
        "split u across fault\nterm spring on fault : gamma*jump(u,u).jump(Test_u,Test_u)",
    ),
    page(
        W418,
        "a refinement that changes nothing",
        "No cell of the mesh has its centre or a vertex where the condition of `refine` holds, or none lies at its \
         regions. The condition is that of the mesh after its `map`; a region smaller than a cell is met where it has a \
         vertex. `wfl check` shows the cells before and after each `refine`.",
        "refine where x > 2 times 3",
        "refine where x > 0.9 times 3",
    ),
    page(
        W419,
        "a condition that cuts what it selects",
        "A face belongs to a region where its corners and its centre meet the condition, a cell where its centre does. A \
         condition that ends inside faces or cells selects other ones than it says: the message has the part of the area \
         or volume that is wrong. With < a face whose corner lies on the limit is left out: write <=. Otherwise end the \
         condition on lines of the mesh, or move lines of the mesh there. A coefficient needs no region: `if x < 0.9 then \
         a else b` holds at each integration point.",
        "region part = faces where x == 1 and y < 0.6\nload u = [0,1,0] on part",
        "region part = faces where x == 1 and y <= 0.5\nload u = [0,1,0] on part",
    ),
    page(
        W420,
        "regions of a list that overlap",
        "`on a, b` means the union of both regions: what belongs to several regions of a list counts once, in terms, \
         loads, integrals and means. Two statements, one for each region, add what they say where these overlap.",
        "region east = faces where x == 1\nregion part = faces where x == 1 and y <= 0.5\nload u = [0,1,0] on east, part",
        "region east = faces where x == 1\nregion part = faces where x == 0 and y <= 0.5\nload u = [0,1,0] on east, part",
    ),
    page(
        W421,
        "a step variable that is coarser than its steps",
        "Numbers have 16 digits: far from zero the values of the step variable are rounded to a visible part of a step. \
         Increments are those that the scene says, so rates are right; formulas of the variable, such as a load, are taken \
         at the rounded value. Of a field with second rates values that a formula prescribes are differenced twice: their \
         accelerations, and the reactions that follow from them, miss the rounding over the square of an increment, which \
         is told from a thousandth of the largest acceleration on. Count the variable from the beginning of the run.",
        "steps t = 1e12 to 1e12+1 by 0.005",
        "steps t = 0 to 1 by 0.005",
    ),
    page(
        W422,
        "units that fit in other coordinates only",
        "The terms of an equation have one unit only if coordinates are in a length, or time is in a unit, that the scene \
         names nowhere. Numbers \
         are never converted: GPa beside MPa, or m beside mm, is as wrong as another quantity. Either a unit is wrong, or \
         the mesh has that unit: a param with a unit in the mesh or in the condition of a region says so.",
        "param E = 210 [GPa]\nparam q = 100 [MPa]\nunknown u : vector [mm]\nregion east = faces where x == 1\n\
         term base on all : E*Sym(Grad_u):Grad_Test_u\nload u = [0,q,0] on east",
        "param E = 210000 [MPa]\nparam q = 100 [MPa]\nunknown u : vector [mm]\nregion east = faces where x == 1\n\
         term base on all : E*Sym(Grad_u):Grad_Test_u\nload u = [0,q,0] on east",
    ),
    page(
        W423,
        "cells that run clockwise",
        "The nodes of plane cells stand in a file in clockwise order, along a curve loop or surface of the mesh generator \
         that runs the other way. They were put in the other order; places, groups and results do not depend on it. A \
         cell that is folded over its neighbour is an error (E410).",
        "mesh file \"clockwise.msh\"",
        "mesh file \"plate.msh\"",
    ),
    page(
        W424,
        "one multiplier for several jumps",
        "One value holds one combination of what it stands for. Where a surface branches, or other surfaces cut the bodies \
         on it, a node of a multiplier lies between more than two bodies, which come apart there. Multipliers for each \
         surface between two bodies hold all jumps; where one follows \
         from others it is dropped (W404). At a corner of its surface a multiplier along the normal has one value for \
         several normals: a body in a corner moves there. A multiplier for each smooth part holds all.",
        "region s = interface along tee\nmultiplier m : scalar on s",
        "region s = interface from a to b\nmultiplier m : scalar on s",
    ),
    page(
        W425,
        "what happens between two steps",
        "A formula of the step variable in a term, a load, a prescribed value or a field is taken at the listed steps. What it \
         does between two of them and has undone at the second one is not seen: a pulse that is shorter than a step, a load that \
         oscillates with fewer than three steps in a period. In a scene with rates, states or values of the previous step the \
         state depends on it. List steps that resolve it, or let the run choose them (`by auto`).",
        "term inertia on all : Dot_u.Test_u\nload u = [if abs(t - 0.55) < 0.01 then 1 else 0, 0, 0] on all\n\
         steps t = 0 to 1 by 0.1",
        "term inertia on all : Dot_u.Test_u\nload u = [if abs(t - 0.55) < 0.01 then 1 else 0, 0, 0] on all\n\
         steps t = 0 to 1 by 0.01",
    ),
    page(
        W501,
        "a discontinuous term without a derivative",
        "Heaviside and sign have derivative 0. A term that depends on an unknown only through them looks constant to \
         Newton's method. A product with the argument, such as pos_part, has a derivative.",
        "term t on fault : Heaviside(Pn)*(Test_uL.Normal)",
        "term t on fault : pos_part(Pn)*(Test_uL.Normal)",
    ),
    page(
        W502,
        "a radius that may be negative",
        "Ball_projection with a negative radius gives 0. If the radius changes its sign with the contact pressure, \
         write its positive part.",
        "term t on fault : Ball_projection(uL, fric*Pn).Test_uL",
        "term t on fault : Ball_projection(uL, fric*pos_part(Pn)).Test_uL",
    ),
    page(
        W503,
        "a Nitsche parameter below its coercivity bound",
        "Below (1+theta)^2/4 times the trace constant of the elements the problem is not coercive, and Newton's method \
         may fail. The message has the smallest safe value on this mesh.",
        "param gamma = 1e3",
        "param gamma = 1e6",
    ),
    page(
        W504,
        "a Nitsche parameter out of proportion",
        "The parameter is far below or far above E/h of the cells at the interface: digits of the pressure or of the \
         jump are lost to rounding. The message has the usual value on this mesh.",
        "param gamma = 1e-6",
        "param gamma = 1e6",
    ),
    page(
        W505,
        "terms of different units in one equation",
        "The sum of all terms with one test function is zero, so all integrated terms have the same unit. A term on \
         faces has a unit with one length less than a term on cells.",
        "param k = 1 [N/mm^4]\nparam p = 2 [N/mm]\nunknown u : vector [mm]\nterm base on all : k*u.Test_u\n\
         term push on west : p*(Normal.Test_u)",
        "param k = 1 [N/mm^4]\nparam p = 2 [N/mm^2]\nunknown u : vector [mm]\nterm base on all : k*u.Test_u\n\
         term push on west : p*(Normal.Test_u)",
    ),
    page(
        W506,
        "a quadrature rule with fewer points than a face has nodes",
        "The degree in `quadrature` gives fewer points on a face than the unknowns have nodes. Displacements that \
         vanish at these points cause no force of the term: contact does not resist them, and the tangent may be \
         singular. Through a mapping, a nodal rule knows the nodes of its own side alone, and on segments a rule of a lower \
         degree than the unknowns shares a force wrongly among their nodes: not even a constant stress passes. Without the \
         statement the degree follows from the terms.",
        "unknown uL : vector Q2 on left\nquadrature on fault degree 1\n\
         term tie on fault : gamma*jump(uL,uR).jump(Test_uL,Test_uR)",
        "unknown uL : vector Q2 on left\nquadrature on fault degree 4\n\
         term tie on fault : gamma*jump(uL,uR).jump(Test_uL,Test_uR)",
    ),
    page(
        W507,
        "contact terms that do not balance the traction of the bodies",
        "The contact terms were tested at a point of the faces with bodies of constant stress: no gap, pressed and \
         sheared within the friction bound. A consistent method, whose projections contain stresses or multipliers, \
         reproduces the traction of the bodies on each side for every parameter. These terms reproduce another part of \
         it. Possible causes: a traction or a jump with the wrong sign, the traction of the other side, a test \
         function on one side only, or one half of a form that has two. The discrete solution converges slowly, or to \
         the solution of another problem.",
        "def Pn = gamma*(jump(uL,uR).Normal) + trac(uL).Normal",
        "def Pn = gamma*(jump(uL,uR).Normal) - trac(uL).Normal",
    ),
    page(
        W508,
        "theta terms of Nitsche's method that do not cancel",
        "In closed contact the terms tested with the stress of the test function cancel: the linear term, -theta/gamma \
         times the traction, and the contribution of the projections. Here one is missing or has a wrong sign or \
         factor. The exact solution does not satisfy such a form.",
        "def Ptheta = gamma*jump(Test_uL,Test_uR) + theta*trac(Test_uL)",
        "def Ptheta = gamma*jump(Test_uL,Test_uR) - theta*trac(Test_uL)",
    ),
    page(
        W509,
        "a multiplier whose law contradicts equilibrium",
        "In closed contact the multiplier that balances the stress of the bodies does not satisfy its own equation, \
         and no other value satisfies both. The multiplier has a wrong sign in the projections, in the force or in its \
         equation.",
        "term law on fault : -1/gamma*(lambda - force).Test_lambda",
        "term law on fault : -1/gamma*(lambda + force).Test_lambda",
    ),
    page(
        W510,
        "contact forces with the wrong sign",
        "The contact terms were tested at a point of the faces with bodies of constant stress, open and sliding. The \
         terms transmit a force across an open gap that grows with the gap, or friction drives the slip. A jump or a \
         projection has the wrong sign.",
        "def Pn = -gamma*(jump(uL,uR).Normal) - trac(uL).Normal",
        "def Pn = gamma*(jump(uL,uR).Normal) - trac(uL).Normal",
    ),
    page(
        W511,
        "a quadrature rule that leaves hourglass modes",
        "The degree in `quadrature` gives so few points in a cell that some deformations have no strain at any of them, \
         and so no stiffness. The tangent of one cell has fewer nonzero singular values than under a finer rule. If \
         nothing else holds these deformations the system is singular; if it is regular, they may still be large and \
         alternate from cell to cell. The message has the least degree without them. Without the statement the degree \
         follows from the terms.",
        "unknown u : vector Q2\nterm body on all : Sym(Grad_u):Grad_Test_u\nquadrature on all degree 3",
        "unknown u : vector Q2\nterm body on all : Sym(Grad_u):Grad_Test_u\nquadrature on all degree 4",
    ),
    page(
        W512,
        "a load that its quadrature rule does not resolve",
        "A rule of a higher degree changes the nodal forces of the load by more than a tenth: the load has a peak \
         between the points, jumps inside cells, or a pole at an edge. Displacements are wrong by about the same part. \
         The message has the step and the node where the change is the largest. Smaller cells, region borders along \
         the jump, or a higher degree in `quadrature` resolve what has an integral; 1/x at an edge has none.",
        "region top = faces where y == 1\nload u = [0,-1/x] on top",
        "region top = faces where y == 1\nload u = [0,-1/(1 + x)] on top",
    ),
    page(
        W513,
        "a nearly incompressible body on elements of degree 1",
        "The body resists changes of volume like one with a Poisson number above 0.495, and its elements have degree 1. \
         Such elements lock: hardly a deformation of them keeps the volume of every cell, so displacements are too small \
         and pressures alternate from cell to cell. The stiffness is computed from the sum of the terms at points of \
         the cells, whatever the parameters are called. Elements of degree 2 hardly lock; a pressure as an unknown of \
         its own, of a lower degree than the displacement, does not at all.",
        "term body on all : 1e4*Div_u*Div_Test_u + Sym(Grad_u):Grad_Test_u\nunknown u : vector",
        "term body on all : 1e4*Div_u*Div_Test_u + Sym(Grad_u):Grad_Test_u\nunknown u : vector Q2",
    ),
    page(
        W514,
        "a law that a rotation of the body changes",
        "A rotation strains no body: it gives no stress, turns the stress that is there, and a stress that is symmetric \
         keeps moments in balance. The law of the displacement, the sum of its terms on cells, was tried at points with \
         gradients that are rotations, and is none of a body's: often `Sym` was forgotten (2*mu*Grad_u for \
         2*mu*Sym(Grad_u)), or a transpose (F*F' for F'*F, Inv(F) for Inv(F)'). Such a body is far too stiff where it \
         turns, as in bending. Not judged: laws whose components do not know of each other (a vector Laplacian, the \
         viscous term of an incompressible flow) unless the field is a length or contact presses on it, micropolar \
         bodies, the geometric stiffness of an initial stress, Navier's form where the whole boundary is prescribed. \
         What a law does at the state of a step is part of W606, the equilibrium of moments.",
        "term base on all : Div_u*Div_Test_u + 2*Grad_u:Grad_Test_u\nunknown u : vector",
        "term base on all : Div_u*Div_Test_u + 2*Sym(Grad_u):Grad_Test_u\nunknown u : vector",
    ),
    page(
        W515,
        "a shear that is counted twice or half",
        "The stiffness of the body is that of an isotropic material, but for a factor of exactly 2, 4, 1/2 or 1/4 on its \
         shear. An engineering shear strain, g(1,2) + g(2,1), is twice the component of the strain tensor: one was taken \
         for the other, in the stress or in what the stress works on. Cubic materials with another factor give no \
         warning.",
        "def e(g) = [g(1,1), g(1,2)+g(2,1), g(1,3)+g(3,1); g(1,2)+g(2,1), g(2,2), g(2,3)+g(3,2); \
         g(1,3)+g(3,1), g(2,3)+g(3,2), g(3,3)]\n\
         term base on all : (Div_u*Id(3) + 2*e(Grad_u)):Grad_Test_u\nunknown u : vector",
        "def e(g) = 0.5*(g + g')\nterm base on all : (Div_u*Id(3) + 2*e(Grad_u)):Grad_Test_u\nunknown u : vector",
    ),
    page(
        W516,
        "the same statement twice",
        "Two terms, or two loads, have the same law on the same entities, whatever their names and those of their regions \
         are: it acts twice, and stiffness or load are doubled. Two equal `fix` statements hold once and give no warning.",
        "load u = [1,0,0] on west\nload u = [1,0,0] on west\nregion east = faces where x == 1\nfix u = [0,0,0] on east",
        "load u = [1,0,0] on west\nregion east = faces where x == 1\nfix u = [0,0,0] on east",
    ),
    page(
        W517,
        "a contact distance with the wrong sign",
        "The contact term reads the other side through a mapping onto its faces, so the mesh knows how far the sides are \
         apart along the normal. The distance that the law takes, seen in its argument without displacement, is the opposite \
         of it: bodies that are apart are pressed together. From a point X to its image the distance is \
         (Interpolate(X, m) - X).Normal. An offset or an interference may be added to it.",
        "def gap = (X - Interpolate(X, m)).Normal",
        "def gap = (Interpolate(X, m) - X).Normal",
    ),
    page(
        W518,
        "a traction that is declared as an unknown",
        "A vector that lives on faces alone, and that the law of contact takes beside a displacement, is a force: a Lagrange \
         multiplier. The equations are the same whatever it is called, but an unknown is taken for a displacement where \
         slip, overlap and equilibrium are looked at, and where contact is scaled. `multiplier` also drops the components \
         that nothing determines.",
        "unknown l : vector on fault\nterm contact on fault : augmented(uL, uR, l, gamma, friction)",
        "multiplier l : vector on fault\nterm contact on fault : augmented(uL, uR, l, gamma, friction)",
    ),
    page(
        W519,
        "a known field that jumps between its nodes",
        "The formula of a known field has cases by position, and the field is continuous: its values are taken at nodes and are \
         smooth between them, so that a jump becomes a ramp over a cell (a conductance of 2.23 for 1.82 on 8 cells). One value \
         for each cell (`DP0`) is exact where cells end at the jump; a `def` is evaluated at the points of integration; a region \
         with a term of its own needs neither. The message has the mean distance from the formula.",
        "data k : scalar = if x < 0.5 then 1 else 10",
        "data k : scalar DP0 = if x < 0.5 then 1 else 10",
    ),
    page(
        W520,
        "pressures that alternate from point to point",
        "Inside the zone of contact the pressure of a term jumps up and down between neighbouring points by more than a fifth \
         of its mean, on more than a third of the area; a smooth pressure, the edge of a punch and the edge of the zone do \
         not. Usually the rule of the term has more points than the faces have nodes and gamma is large: the law then holds \
         at more points than the displacements can follow, and the pressure of a face gathers at some of them. The \
         displacements and the means over faces are right, forces but for some per cent on few faces; the largest \
         pressure is not. Without `quadrature` faces with contact have one point a node, where this does not happen for \
         any gamma. Through a mapping, on cells of second order, and in Nitsche's method on hexahedra they have Gauss \
         points, and the upper end of gamma on curved gaps is E/h where a zone of contact ends; where all faces are \
         closed, 2 E/h for elements of degree 1 and 10 E/h for degree 2 (docs/quadrature.md). A gap that itself changes from face to face has such a pressure on any mesh with faces of that size.",
        "quadrature on top degree 5\nterm contact on top : 1e6*pos_part(u(2) - x^2)*Test_u(2)",
        "term contact on top : 1e6*pos_part(u(2) - x^2)*Test_u(2)",
    ),
    page(
        W602,
        "a cycle of active sets",
        "Newton's method met the same active set again at the same load: some points alternate between stick and slip, \
         or between open and closed. A line search or smaller load steps break the cycle.",
        "solver newton with search=none",
        "solver newton with search=auto",
    ),
    page(
        W605,
        "a result with few correct digits",
        "Rounding alone changes the unknowns by more than a thousandth of their size: the tangent is ill-conditioned. \
         Usually a penalty or Nitsche parameter is far above E/h, or a material is nearly incompressible. Also told where \
         forces do not balance and rounding hides it: a law is so steep that the number beside a displacement changes its \
         force by as much as it is. The report has the estimated correct digits of each load step.",
        "param gamma = 1e20",
        "param gamma = 1e6",
    ),
    page(
        W606,
        "a mechanical condition that does not hold",
        "A converged state violates a condition that every solution satisfies; the message has the worst load step, \
         the value and its limit. Loads and reactions balance, and the forces on both sides of an interface are equal \
         (limit 1e-6 of the forces); otherwise a term is wrong. Of the moments in a body the same is asked: the stress \
         of its terms on cells is symmetric (P F' of a law of finite strains; 1e-6 of the stress, 0.05 with a geometric \
         stiffness). Bodies in contact do not overlap, and sticking points have not slipped (0.2 of the largest \
         displacement); a larger penalty, Nitsche's method or a multiplier improves this. Of an elastic joint, which \
         resists being drawn apart with a force that grows, both are strains, and not tested. Contact forces are \
         compressive, and friction opposes the slip (on all but 0.25 of the contact area); otherwise a sign is wrong. Tractions lie in the friction cone (limit 0.5; between the points where the \
         law holds they leave it by an amount that falls with the cell size). The law of a multiplier holds at every \
         point, and the result does not depend on its parameter, if the quadrature points are the nodes (`quadrature \
         ... vertex`, elements of degree 1) and all faces of a node have one normal. On a curved interface that slides \
         this is impossible: smaller faces reduce the error, and a run with another parameter shows its size. Nothing \
         is checked where nothing has moved, because only rounding is left.",
        "param gamma = 1e3",
        "param gamma = 1e6",
    ),
    page(
        W607,
        "a singular tangent at the initial state",
        "The tangent at zero is singular or not finite, as for a p-Laplacian. The load step started from a linear \
         field of small slope instead. If there are several solutions, `start` selects one.",
        "term law on all : Norm_sqr(Grad_u)*(Grad_u:Grad_Test_u)\nload u = [0,0,-1] on all",
        "term law on all : Norm_sqr(Grad_u)*(Grad_u:Grad_Test_u)\nload u = [0,0,-1] on all\nstart u = [0, 0, -0.001*x]",
    ),
    page(
        W609,
        "the solution may not be unique",
        "A load step may have several solutions: friction with a large coefficient or a wedged body, and Nitsche's \
         method with gamma far below E/h. There are three indications. Piecewise-linear path following reached the \
         state on a path on which the load also decreased. A tangent during the iteration had a determinant of the \
         opposite sign to that of the tied bodies: some loads then have several solutions, though perhaps not this \
         one. Or the tangent at the solution itself has such a determinant, which proves that other states satisfy the \
         same equations. The load steps decide which solution is found. Smaller load steps follow the loading history \
         more closely; another method or a larger parameter shows what depends on the choice.",
        "param fric = 5\nsteps t = 0 to 10 by 1",
        "param fric = 5\nsteps t = 0 to 10 by 0.1",
    ),
    page(
        W610,
        "a result that is not finite",
        "A quantity of a result file, or a printed one, is infinite or undefined at a point. The file has nan or inf \
         there; the message has the first place.",
        "output vtk \"out\" : 1/u(1) as a",
        "output vtk \"out\" : u(1) as a",
    ),
    page(
        W611,
        "a body that is not positive definite",
        "The terms of a field on cells have a negative stiffness in some direction: E below 0, a Poisson number \
         outside -1 to 0.5, a diffusivity below 0, or a term with the wrong sign. The stiffness is computed from the \
         sum of the terms at points of the cells, whatever the parameters are called. Such a body releases energy when \
         it is deformed, and the solution is no equilibrium of it. A field that shares terms on cells with another \
         unknown (a pressure) may be indefinite and is not judged.",
        "param E = -1000",
        "param E = 1000",
    ),
    page(
        W612,
        "a projection radius that is negative at every point",
        "The radius of a projection on a ball is a negative number. The projection then gives 0 for every argument: \
         friction or plasticity is lost. A radius of 0 means no friction; a negative one is a wrong sign.",
        "def t = Ball_projection(u, -0.4)",
        "def t = Ball_projection(u, 0.4)",
    ),
    page(
        W615,
        "friction that does not dissipate energy",
        "Friction dissipates energy. In the load step named, the friction forces as a whole returned energy instead. \
         The usual cause is a law for the total slip: it is valid for increasing loads, and when the loads decrease it \
         drives the slip back. A law whose slip is kept in a state has a memory. The report has the dissipated energy of \
         each step (friction_work): the force times what slides in the law, obstacles that move included; what sticks does \
         not count.",
        "def Pt = gamma*tang(jump(uL,uR)) - tang(trac(uL))",
        "def Pt = gamma*(tang(jump(uL,uR)) - Previous_slid) - tang(trac(uL))\n\
         state slid : vector on fault := Previous_slid + (Pt - Ball_projection(Pt, fric*pos_part(Pn)))/gamma",
    ),
    page(
        W616,
        "cells turned inside out",
        "A load step ended with cells in which the determinant of the deformation gradient, Id + Grad_u, is not positive \
         at a point of the rule: no body can be in such a state, although the equations hold. Laws with a finite stress \
         at negative volumes allow it: Saint-Venant-Kirchhoff, and volumetric energies such as (J - 1)^2. The message has \
         the first such step, the number of cells, the smallest determinant and its place. Laws of finite strain are \
         recognised by what they do, however they are written: a rotation of the deformed body turns its stress. Laws \
         whose stress is not finite there, with log(J), keep cells from turning and cost nothing. Points between those \
         of the rule are not looked at, and bodies along a line are not judged.",
        "def F = Id(2) + Grad_u\ndef E = 0.5*(F'*F - Id(2))\nterm body on all : (F*(10*Trace(E)*Id(2) + 20*E)):Grad_Test_u",
        "def F = Id(2) + Grad_u\nterm body on all : (10*(F - Inv(F)') + 10*log(Det(F))*Inv(F)'):Grad_Test_u",
    ),
    page(
        W617,
        "a zone of contact that covers no face",
        "At the end of the run the sides of a contact term press on each other at points of some faces, but on no face at \
         all of its points. The size of such a zone, and the pressures in it, are those of the quadrature rule and not \
         of the bodies; the total force may still be right. Smaller faces resolve the zone.",
        "mesh box [0,-5] to [5,0] cells [6,6] quad",
        "mesh box [0,-5] to [5,0] cells [60,60] quad",
    ),
    page(
        W618,
        "steps with a larger error than demanded",
        "`steps ... by auto` found no increment with the demanded error: one was as small as `least`, and the step was taken \
         with the error that it has. That is right where a value jumps at once: no increment resolves a jump. Elsewhere \
         choose a smaller `least`, or a larger `error`. `report.json` lists the attempts of each step. The first steps have no \
         estimate, because it needs a past: a run of one or two steps says that it has none, and needs a smaller `first`. Errors are \
         relative to what the run changes of a field. Where its values, or what cancels in its equations, are so much larger that \
         rounding is more than the demanded part of that, no step can have the demanded error: solve for the difference from \
         the start. Where nearly all of the change is the flight with which a body starts, the demanded part of it may be \
         much of what happens beside: start at rest what flies together. The same is told of a field without inertia that drifts, all of it \
         alike and at the rate of the first step, where a step was seen to miss much of what happens beside: solve for the difference \
         from the drift.",
        "steps t = 0 to 1 by auto with first=0.1, least=0.1, error=1e-9",
        "steps t = 0 to 1 by auto with error=1e-3",
    ),
    page(
        W619,
        "a limit that is no positive number",
        "`limit` of `steps ... by auto` is evaluated behind each state. Where it is zero, negative or not a number (0/0, the \
         logarithm of a negative number) it limits nothing: the increment follows from the error alone. That may be \
         what is meant at the start, where nothing moves yet; else write a limit that is positive for every state. An \
         infinite limit, as a length over a slip rate of zero, says that the increment is free, and is no warning.",
        "steps t = 0 to 1 by auto with limit=0.1/log(max(u)) on all",
        "steps t = 0 to 1 by auto with limit=0.1/max(abs(u)) on all",
    ),
    page(
        W620,
        "energy that is lost",
        "`scheme ... energy` sums the work of every term, of loads and of prescribed motions over the steps, by the \
         trapezoidal rule, and compares it with the kinetic energy. What is left is lost, or gained where it is negative: the \
         damping of the scheme, steps that are too long for what happens in them, or an unstable contact term. The message has \
         the part of the largest energy of the run, and the limit that the scene gives (`energy=1e-3`). Smaller steps \
         show which it is: the error of the steps falls with their length, a sign or a law that is wrong does not. The balance of a \
         step closes for every law, also for a contact that begins and ends within a few steps and throws the body back \
         faster than it came: a contact without friction that has taken up, or given, energy between two times without \
         force is told, too, and one with friction that has given some. That is seen of contact that is a term of its own: one that \
         shares its term with a weight or a stress is never without force.",
        "steps t = 0 to 1 by 0.5\nterm inertia on all : Dot2_u.Test_u\nstart Dot_u = [x,0,0]\n\
         scheme backward_euler energy",
        "steps t = 0 to 1 by 0.5\nterm inertia on all : Dot2_u.Test_u\nstart Dot_u = [x,0,0]\n\
         scheme newmark energy",
    ),
    page(
        W621,
        "explicit steps that became too long",
        "The stability limit of explicit steps is computed where time starts. A contact that closes later, or a body that \
         stiffens, lowers it: a penalty g on a face adds about 2 g/(rho h) to the square of the highest frequency of elements \
         of length h. It is computed again during the run where a scene is not linear: when the branches of contact first change, and \
         later for a tenth of the time of the steps. The results behind that are wrong, also where contact keeps them \
         finite. Steps of more than 0.95 of a limit that has fallen are told, too: each side of a kink is stable then, but \
         contact that opens and closes gains energy, and the balance of energy does not show it. Where contact lowers the limit by a \
         fifth, steps of more than 0.8 of the lower one are told for that, from the start on. Take a smaller `fraction`, \
         or steps below the limit that the message has.",
        "mesh box [0] to [1] cells [4] segment\nregion wall = faces where x == 0\nunknown u : scalar\n\
         start u = 0.1\nstart Dot_u = -1\nterm inertia on all : Dot2_u*Test_u\n\
         term stress on all : Grad_u.Grad_Test_u\nterm contact on wall : -1000*neg_part(u)*Test_u\n\
         scheme explicit\nsteps t = 0 to 2 by auto",
        "mesh box [0] to [1] cells [4] segment\nregion wall = faces where x == 0\nunknown u : scalar\n\
         start u = 0.1\nstart Dot_u = -1\nterm inertia on all : Dot2_u*Test_u\n\
         term stress on all : Grad_u.Grad_Test_u\nterm contact on wall : -1000*neg_part(u)*Test_u\n\
         scheme explicit fraction=0.05\nsteps t = 0 to 2 by auto",
    ),
    page(
        W630,
        "friction that forgets where points stick",
        "A point that sticks has moved on in step after step. The law has the change of the slip since the last step, with \
         `Previous_u`: a point is held by an elastic slip, and the next step begins without it, so that the point creeps by as \
         much in every step, under constant loads, too, and the slip grows with the number of steps. A `state` that keeps \
         what has slid holds a point for any number of steps: slid + (Pt - Ball_projection(Pt, r))/gamma (`use \"contact\"` \
         has it as `nitsche_sliding` and `nitsche_slip`, and for the other methods; `docs/formulations.md`). Told where what \
         points have lost is on average a twentieth of how far the sides have moved by then, a hundredth of the most that they \
         move in the run, and a thousandth of how far the bodies are deformed. Laws on rates may creep and are not looked at, nor are explicit steps.",
        "def Pt = gamma*(tang(jump(uL,uR)) - tang(jump(Previous_uL,Previous_uR))) - tang(trac(uL))",
        "def Pt = gamma*(tang(jump(uL,uR)) - Previous_slid) - tang(trac(uL))\n\
         state slid : vector on fault := Previous_slid + (Pt - Ball_projection(Pt, fric*pos_part(Pn)))/gamma",
    ),
    page(
        W631,
        "sides that have slid by more than a face",
        "The points of two bodies are paired once, on the initial mesh, by `neighbor_element` and by mappings (small sliding). A \
         point that presses has slid by more than the face of the other side that it was paired with, measured along the slip: \
         its force acts on a face where it is no longer, also where the bodies have left each other. The message has the first step, \
         the place, the largest slip of the run and the part of the area in contact. Obstacles that are formulas of x + u \
         follow what moves and are not looked at; nor are points that are open.",
        "fix u1 = [3*t, -0.005, 0] on top",
        "fix u1 = [0.1*t, -0.005, 0] on top",
    ),
    page(
        W632,
        "points under pressure that lost their image",
        "The images of a mapping that moves are found in each state within the distance of `within`: along the current normal of \
         the points (`raytrace`), or as closest points (`project`). Points that pressed at the end of a step have no image at the \
         end of the next: the body was pushed over the edge of the other one, or is further inside it than `within`. Their force \
         is gone from one step to the next, and no method converges on such a jump; the message has the first step and the number \
         of points. `project` keeps images on edges. Also told where no point had an image in any step: the normal of the other \
         faces does not oppose that of the points, or the bodies never come near each other.",
        "mapping m = raytrace from arc onto top moving with u within 0.01",
        "mapping m = raytrace from arc onto top moving with u within 0.3",
    ),
    page(
        W640,
        "an equilibrium that is not stable",
        "The step ended in a state in which all forces balance, but the energy is no minimum there: the tangent has negative \
         eigenvalues, so many as the message says, and a body leaves such a state at the slightest push. Newton's method finds \
         it because a straight column under three times its buckling load is in equilibrium, too. A load of buckling, of \
         snap-through or of wrinkling lies before the step that is named; the first one is told. `perturb=1e-6`, an option of \
         `solver newton` or a word of `wfl run`, pushes such a state along its lowest direction by that part of the extent of \
         the mesh and goes downhill to a stable one. Counted are the signs of pivots; what multipliers and pressures count for \
         in a stable state is taken off. Where the tangent is not symmetric (friction) the sign of its determinant is looked \
         at: what it is in a stable state follows from the signs with which the equations are written, as the start of the run \
         shows them, where bodies are taken to be at rest and stable. Linear scenes and scenes with rates are not judged.",
        "load u = [0, -3] on top",
        "load u = [0, -3] on top\nsolver newton with perturb=1e-6",
    ),
    page(
        W641,
        "a step with many times the iterations of the others",
        "One step took more than ten times the Newton iterations that the other steps of the run took (the median). Newton's \
         method may have wandered, and ended in another state than that which the steps before lead to: bodies of finite strain \
         and contact with friction have several. Compare the measures with those of a run with smaller steps; an energy or a \
         force that jumps there is wrong. A first step in which contact closes may also be hard and right.",
        "steps t = 0 to 1 by 1",
        "steps t = 0 to 1 by 0.1",
    ),
    page(
        W645,
        "a strain beyond a law of small strains",
        "A body whose law depends on Sym(Grad_u) alone was stretched by more than 0.3, or has moved by more than the extent of \
         the mesh: such a law says nothing there. The load is beyond what the body bears (a limit load), or a unit or a power \
         of ten is wrong; bodies that deform so much need a law of finite strain. The message has the first step and the place. \
         Judged are displacements whose unit is a length, and bodies whose law has a memory: it reads a state, or what one was.",
        "load u = [1e5,0] on east",
        "load u = [1,0] on east",
    ),
    page(
        W646,
        "a contact that never closes",
        "Without displacement the sides of the contact are apart, and in no step of the run did they meet: the statement had \
         no effect. A distance or a load has the wrong sign, or the contact is not needed. Sides that lie on each other from the \
         start and open give no warning.",
        "def gap = x^2/(2*R) + d",
        "def gap = x^2/(2*R) - d",
    ),
    page(
        W647,
        "an unknown that grows without end",
        "In the second half of the run an unknown grew by more than three decades (six where terms are not linear) beyond loads \
         and prescribed values, and by like factors in both quarters of it. A stable body does not: the sign of a rate, of one of \
         two couplings or of a term that should dissipate is wrong.",
        "term heat on all : -Dot_T*Test_T + Grad_T.Grad_Test_T",
        "term heat on all : Dot_T*Test_T + Grad_T.Grad_Test_T",
    ),
    page(
        W648,
        "bending on elements of degree 1",
        "A cell of degree 1 that is bent is sheared as well: of slender bodies with few cells across, the energy goes into that \
         shear, and they move too little (shear locking). The message has the part of the energy of the last state that the \
         elements add, a fifth or more; displacements under given loads are too small by about that part. On quadrilaterals and \
         hexahedra it is measured with incompatible modes, on triangles and tetrahedra of slender bodies by the jumps of strain. \
         Elements of degree 2 bend.",
        "unknown u : vector Q1",
        "unknown u : vector Q2",
    ),
    page(
        W649,
        "a pressure that alternates from node to node",
        "The pressure holds the volume of a body, and its values alternate between neighbouring nodes. A step shorter than \
         h^2/(6 c), with the size h of the cells and the coefficient of consolidation c, leaves a jump of the pressure within \
         one cell, and it overshoots (Vermeer and Verruijt 1981); with displacements of the same degree as the pressure \
         nothing bounds it where the mobility or the step vanishes. Longer steps or smaller cells at the jump, and a \
         displacement of one degree more. Short steps without a jump give no warning.",
        "steps t = 0 to 3e-5 by 1e-5",
        "steps t = 0 to 3 by 1",
    ),
    page(
        W650,
        "a balance that does not close",
        "`balance` adds the equations of unknowns. What came in, did not go out and was not taken up is lost: the equations \
         were not solved to 1e-8 of what moves, between the nodes too, in a scene with rates during the whole run. A tolerance \
         of Newton's method that is too large, a step that did not converge, or a mapping some of whose points have no image \
         can be the cause.",
        "solver newton with tol=1e-3",
        "solver newton with tol=1e-10",
    ),
    page(
        W651,
        "a change over a part of a step",
        "A step that did not converge was solved in smaller increments. Measures that read `Previous_` or `timestep` see the \
         last of these: a slip, a work or a wear of the step is that of its last increment. The message has both numbers. \
         A rate, `Dot_u`, is a value at the end of the step and no amount of it. \
         A state that adds up what is wanted in each increment has the whole, as the energies of the run have; steps that \
         converge at once have no parts.",
        "measure worn = integral(u - Previous_u) on all",
        "state sum : scalar on all := Previous_sum + u - Previous_u\nmeasure worn = integral(sum) on all",
    ),
    page(
        W652,
        "a rate that changes its sign, or a measure that goes up and down, in every step",
        "The trapezoidal rule (`newmark`), and in part the alpha methods, follow the rate at the end of a step from the change over it \
         and the rate at its start. What decays within a step, as after a load or a support that comes suddenly, keeps its \
         size with the other sign: pressures and temperatures oscillate around the solution, and a flow is that of the \
         oscillation, while each instant is in balance. `bdf2` and `backward_euler` forget it in a few steps; so do smaller \
         steps at the beginning, as `by auto` makes them. Also told of a measure that goes up and down with every step: of a stiff body with \
         inertia that is moved the displacements are right, and reactions and accelerations oscillate around the right ones.",
        "scheme newmark\nsteps t = 0 to 1 by 0.01",
        "scheme bdf2\nsteps t = 0 to 1 by 0.01",
    ),
    page(
        W660,
        "a derivative at a kink",
        "At the end of a step points are between two branches within 1e-9 of what they compare: between stick and slip, open \
         and closed, or two points share the largest value of a measure. There a result has one derivative for changes to one \
         side and another one to the other; that of the adjoint is the side of the branch that the law takes (contact, stick). \
         `wfl verify --gradient` shows both sides by differences of runs. Where both sides of a kink stay one number whatever moves, as the jump \
         does at the tip of a crack, there is none. Where parameters move the mesh, so has a region whose \
         condition takes other cells or faces on the displaced mesh (`x == 2` for the end of a box `to [L,1]`), and the size of \
         cells that are as long as wide.",
        "load u = [at_onset, 0] on east",
        "load u = [beyond_onset, 0] on east",
    ),
    page(
        W670,
        "points inside the other body without a force",
        "The image of a point on a mapping that moves is looked for along its normal to both sides, or as the closest point, not \
         further than `within`. These points have none, and the face of the other body that is nearest behind them is one that they have gone \
         through: they are inside it, further from its surface than `within`, and nothing pushes them out. The bodies were \
         moved into each other by more than `within` in one step, or they overlap from the start. The message has the first \
         step and the number of points. Newton's method shortens its steps so that points do not get there on the way where \
         that helps.",
        "mapping m = raytrace from arc onto top moving with u within 0.01",
        "mapping m = raytrace from arc onto top moving with u within 0.3",
    ),
    page(
        W680,
        "a multiplier at the tips of a crack without a node between them",
        "Where a crack ends inside a body both sides are one node: there is no jump, and the equation of a continuous \
         multiplier is empty there. It takes the value of the nearest node of the multiplier that has a jump, so that a uniform \
         traction stays uniform up to the tip. Here no node of these faces has one, as on a crack of a single face: the \
         multiplier is zero there, and what displacements of degree two can still jump between the tips is held by nothing. More \
         faces along the crack have nodes between its tips; one value a face (`DP0`) has no node at a tip.",
        "unknown u : vector P2\nsplit u across one_face\nmultiplier l : scalar P1 on one_face",
        "unknown u : vector P2\nsplit u across one_face\nmultiplier l : scalar DP0 on one_face",
    ),
    page(
        W702,
        "declared but not needed",
        "No statement uses this param, macro, region or field. An unused unknown is not allocated. Remove it, or look \
         for a misspelt name.",
        "param rho = 2700",
        "param rho = 2700\nterm weight on all : rho*9.81*Test_u(3)",
    ),
    page(
        W703,
        "groups of several mesh files with one name",
        "Several files of `mesh file` have groups of one name and one dimension. In the scene they are one region with the \
         members of all files: the same file at two places, or parts that were named alike. Where they are to be told apart, \
         give the groups names of their own in the files.",
        "mesh file \"disc.msh\", \"disc.msh\" moved by [0, 2]",
        "mesh file \"disc.msh\", \"plate.msh\" moved by [0, 2]",
    ),
    page(
        W704,
        "a macro of the scene takes the place of one of the library",
        "A macro of a scene with the name of one of the library stands in its place everywhere, in macros of the library, too: so a scene \
         says what `trac` is and still uses `nitsche`. Here a macro that the scene uses is made with the one that was replaced. A `strain` of \
         one's own, twice that of the library, doubles the part of `stress` with mu. Where that is not meant, give it another name.",
        "use \"elasticity\"\ndef strain(v) = 2*Sym(Grad_v)\nterm bulk on all : stress(u, 2, 1):Grad_Test_u",
        "use \"elasticity\"\nterm bulk on all : stress(u, 2, 1):Grad_Test_u",
    ),
}
