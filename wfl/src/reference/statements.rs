//! Statements, one row a form: the table of `docs/language.md`, of `wfl explain STATEMENT` and of editors.

use super::StatementRow;

pub(super) const ROWS: &[StatementRow] = &[
    StatementRow { word: "wfl", usage: "`wfl 1`", meaning: "version of the language, first line", default: "optional" },
    StatementRow {
        word: "mesh",
        usage: "`mesh box A to B cells N shape` or `size h`",
        meaning: "a box; shapes `hex tet`, `quad tri`, `segment`",
        default: "required",
    },
    StatementRow {
        word: "mesh",
        usage: "`mesh file \"m.msh\", ...`",
        meaning: "Gmsh 2.2 or 4.1, ASCII or binary, also with wedges, pyramids and cells of several kinds; `.inp` of \
                  Abaqus and CalculiX; `.vtu` (`docs/gmsh.md`); its physical groups are regions. Of several files the \
                  meshes stand together without common nodes; groups of one name and dimension are joined (W703)",
        default: "",
    },
    StatementRow {
        word: "mesh",
        usage: "`\"m.msh\" scaled by s turned by a about [..] moved by [..]`",
        meaning: "behind a file: where its mesh is placed, in the order written. Angles in degrees, about an axis through \
                  the origin, in the plane about the origin",
        default: "as in the file",
    },
    StatementRow {
        word: "mesh",
        usage: "`... map expr`",
        meaning: "after either: moves every node to the value of the expression",
        default: "",
    },
    StatementRow {
        word: "mesh",
        usage: "`... with idle_cells=allowed`",
        meaning: "cells without a term are allowed",
        default: "an error (E425)",
    },
    StatementRow {
        word: "refine",
        usage: "`refine [on r, s] [where condition] [times n] [along x, y]`",
        meaning: "the mesh is refined where the condition holds at the centre or a vertex of a cell (after the \
                  `map`), in cells of the regions `r, s` or at their faces and nodes; each of the `n` rounds halves \
                  the size of these cells. Several `refine` follow one another; W418 if one changes nothing. See \
                  below",
        default: "the mesh as it is",
    },
    StatementRow {
        word: "region",
        usage: "`region r = cells/faces/nodes [of s] [where condition]`",
        meaning: "entities selected by position: a cell where its centre meets the condition, a face where its centre \
                  and all its corners do, a node where it does itself; a condition that cuts cells or faces is told with \
                  the part that is cut (W419). `==` on coordinates holds within 1e-9 of the mesh size; `faces of s` are \
                  those of the boundary of the cells `s`, or a part of the faces or of the interface `s`",
        default: "`all`, `boundary`, `interior`, `global` exist",
    },
    StatementRow {
        word: "region",
        usage: "`region r = rim/crossings of s [where condition]`",
        meaning: "where the faces or the interface `s` end (edges with one face; points in the plane) and where they meet (edges \
                  with three faces or more); `nodes of s` are all nodes of its faces. Their nodes can be fixed. The rim also has \
                  edges: terms, loads per length and measures are taken along them (at points in the plane, where a load is a \
                  number), and `Conormal` is the unit vector along the faces that points out of them. Along crossings terms and \
                  measures are taken once for each face that meets there, and a load is one at the nodes. Fields may live on both: \
                  `unknown pc : scalar on joints` has one value a node. An edge is taken where \
                  the condition holds at its ends and its middle",
        default: "",
    },
    StatementRow {
        word: "region",
        usage: "`region r = interior of s [where condition]`",
        meaning: "where two faces of the faces or the interface `s` meet (edges in space, points in the plane), seen from one of \
                  them: `Interpolate(q, neighbor_element)` is the value of the other face, `Conormal` points out of the own \
                  one, `Interpolate(Conormal, neighbor_element)` out of the other one, and `element_size` is the size of a face. \
                  Terms and measures are taken there, loads are not",
        default: "",
    },
    StatementRow {
        word: "region",
        usage: "`region f = interface from a to b`",
        meaning: "the faces between two regions of cells; `Normal` points from `a` to `b`; plain names are values on \
                  the side of `a`",
        default: "",
    },
    StatementRow {
        word: "region",
        usage: "`region f = interface along s towards v`",
        meaning: "both sides of the faces `s` inside a body, say a surface of the mesh file, plane or curved; \
                  `Normal` points to one side all over each connected sheet, on average towards `v`, which may depend \
                  on the position; without `towards` the largest component of the mean normal is positive, and \
                  normals of a closed sheet point outwards; where three or more faces meet at an edge the surface is \
                  divided into sheets; `wfl check` shows them",
        default: "",
    },
    StatementRow {
        word: "region",
        usage: "`region r = p + q - s & t`",
        meaning: "union, difference, intersection, evaluated from left to right",
        default: "",
    },
    StatementRow {
        word: "param",
        usage: "`param p = value [unit] in a..b \"text\"`",
        meaning: "a number, vector or matrix; `in {1, 2}` lists allowed values; `p=...` on the command line replaces \
                  the value; `auto` stands for a safe Nitsche parameter, or a factor of it",
        default: "",
    },
    StatementRow {
        word: "unknown",
        usage: "`unknown u : scalar/vector/matrix(m,n) [element] [on r]`",
        meaning: "a field to be solved for; elements `P1` to `P4`, `Q1` to `Q4`, `DP0 DP1 DQ1 ...` (discontinuous); with wedges, \
                  pyramids or cells of several kinds `P1` and `Q1` are the same; `global` \
                  for a single number",
        default: "degree 1, on all",
    },
    StatementRow {
        word: "multiplier",
        usage: "`multiplier l : ... on f`",
        meaning: "a Lagrange multiplier. Components without a jump, or constrained by another multiplier, are \
                  dropped; one that friction depends on takes the value of the nearest node (W404), as all do at \
                  the tips of a crack, where both sides are one node. Those of a lower degree than the displacements \
                  stay where the jumps between their nodes determine them, and follow the nearest node elsewhere. \
                  `with crosspoints=follow` all of these follow the nearest node, so that tractions are right up to the ends; \
                  `with crosspoints=keep` keeps all as unknowns",
        default: "",
    },
    StatementRow {
        word: "data",
        usage: "`data k : scalar = expr` or `= \"file.csv\"`",
        meaning: "a known field, given by a formula or by nodal values",
        default: "",
    },
    StatementRow {
        word: "state",
        usage: "`state s : ... on r := expr`",
        meaning: "an internal variable at integration points, updated by `expr` when a step has converged; no \
                  element, no gradient",
        default: "",
    },
    StatementRow {
        word: "mapping",
        usage: "`mapping m = project from r onto s [within d]`",
        meaning: "maps each point of the faces `r` to the closest point of the faces `s`",
        default: "",
    },
    StatementRow {
        word: "mapping",
        usage: "`mapping m = raytrace from r onto s [within d]`",
        meaning: "maps along the normal of `r` to faces `s` with an opposing normal",
        default: "",
    },
    StatementRow {
        word: "mapping",
        usage: "`mapping m = raytrace from r onto s moving with u[, u2] [within d]`",
        meaning: "the same in each state of the bodies: from `X + u` along the current normal of `r` to the current faces \
                  `s`, the nearest within `d` of either sign; `u` and `u2` are the displacements behind `r` and behind `s` \
                  (`docs/sliding.md`)",
        default: "one displacement for both sides",
    },
    StatementRow {
        word: "mapping",
        usage: "`mapping m = project from r onto s moving with u[, u2] [within d]`",
        meaning: "the closest point of the current faces `s`, on a face, an edge or a corner, of those whose normal opposes that \
                  of the point (`docs/sliding.md`)",
        default: "one displacement for both sides",
    },
    StatementRow {
        word: "mapping",
        usage: "`mapping m = point expr`",
        meaning: "maps to the point with these coordinates",
        default: "",
    },
    StatementRow {
        word: "split",
        usage: "`split u across f`",
        meaning: "`u` may jump across the inner faces `f`; at the front, where `f` ends inside the body, it stays \
                  joined; where sheets meet it has one value for each sector of cells, and it is split up to the \
                  outer boundary",
        default: "one value: `u - Interpolate(u, neighbor_element)` is zero (W417)",
    },
    StatementRow {
        word: "def",
        usage: "`def f(a, b) = expr`",
        meaning: "a macro; a parameter may follow a prefix: `Grad_a`, `Test_a`. `Def f(a) := expr;` before the \
                  expression of a term is local to it",
        default: "",
    },
    StatementRow {
        word: "term",
        usage: "`term [name] on r : expr`",
        meaning: "a residual, linear in the test functions; the sum of all terms is zero",
        default: "at least one",
    },
    StatementRow {
        word: "energy",
        usage: "`energy [name] on r : expr`",
        meaning: "a potential; residual and tangent are derived",
        default: "",
    },
    StatementRow {
        word: "fix",
        usage: "`fix u = expr on r`, `fix u(1) = ...`, `fix u.Normal = ...`",
        meaning: "prescribed values; a normal component on faces of any orientation",
        default: "",
    },
    StatementRow {
        word: "load",
        usage: "`load u = expr on r`",
        meaning: "force per volume on cells, traction on faces, a force at each node of a region of nodes; it may follow the solution, as the term `-(expr).Test_u` does: a pressure of the current area is `-p*Det(F)*Inv(F)'*Normal` with `def F = Id(2) + Grad_u`",
        default: "",
    },
    StatementRow {
        word: "start",
        usage: "`start u = expr`",
        meaning: "the initial guess; the initial value of a state, or of a field in a scene with rates",
        default: "zero",
    },
    StatementRow {
        word: "start",
        usage: "`start from \"file.csv\"`",
        meaning: "initial values of all fields with columns in the file",
        default: "",
    },
    StatementRow {
        word: "steps",
        usage: "`steps t = a to b by c`",
        meaning: "load or time steps; `b` is met exactly, if necessary by a shorter last step (W410)",
        default: "one solve",
    },
    StatementRow {
        word: "steps",
        usage: "`... with halve=5, on_fail=go_on, most=1e6`",
        meaning: "how often the increment of a failed step is halved; whether the run continues after a failed step; \
                  allows more than 100,000 steps",
        default: "5, `stop`, 100,000",
    },
    StatementRow {
        word: "steps",
        usage: "`steps t = a to b by auto`",
        meaning: "the run chooses the steps by the error that each of them makes in time, see below; `b` is met exactly",
        default: "",
    },
    StatementRow {
        word: "steps",
        usage: "`... with first=1e-3, error=1e-5, least=1e-6, most=10, count=1e6, limit=0.2*Dc/max(V) on fault`",
        meaning: "the first increment; the largest error of a step, relative to the largest change of each field since the start, 1e-12 to \
                  0.1; the smallest and the largest increment; allows a `most` that needs more than 100,000 steps; what the increment is at most behind each state: arithmetic of \
                  parameters, measures, the step variable and `max(e)`, `min(e)`, `mean(e)`, `integral(e)` on a region",
        default: "with b - a = 1: 1e-6, 1e-4, 1e-12, 1, 100,000, none",
    },
    StatementRow {
        word: "steps",
        usage: "`steps t = a to b by c [s]`",
        meaning: "the unit of the step variable, behind the step or behind `auto`",
        default: "the one that fits the terms",
    },
    StatementRow {
        word: "start",
        usage: "`start Dot_u = formula`",
        meaning: "initial rate of a field with `Dot2_u` in a term; initial accelerations follow from the equations",
        default: "zero",
    },
    StatementRow {
        word: "scheme",
        usage: "`scheme newmark beta=1/4 gamma=1/2`, `scheme hht alpha=-0.1`, `scheme generalised_alpha rho_inf=0.8`, \
                `scheme bdf3`, `scheme bdf2`, `scheme backward_euler`, `scheme explicit fraction=0.9`",
        meaning: "how `Dot_u` and `Dot2_u` are made of the values at the steps (`docs/dynamics.md`)",
        default: "for steps by `auto` `bdf3`, or `bdf2` where a term has `Dot2_`; of others `newmark` with 1/4 and 1/2 where \
                  a term has `Dot2_`, else `backward_euler`",
    },
    StatementRow {
        word: "scheme",
        usage: "`scheme newmark massless=wall`",
        meaning: "the nodes of the region give their mass to nodes beside them, so that the pressure of contact does not \
                  oscillate; total mass, centre of mass and moments of inertia stay (`docs/dynamics.md`)",
        default: "every node keeps its mass",
    },
    StatementRow {
        word: "scheme",
        usage: "`scheme newmark energy`, `scheme explicit energy=0.01`",
        meaning: "the balance of energy in each step as measures `energy_kinetic`, `energy_NAME` of each term, \
                  `energy_loads`, `energy_prescribed`, `energy_lost`; more than this part lost is warned of (W620)",
        default: "none; `energy` alone: 1e-3",
    },
    StatementRow {
        word: "solver",
        usage: "`solver newton with tol=1e-10, max_iter=150, search=auto`",
        meaning: "relative residual (at most 0.1); iterations of one attempt; `search=none` for undamped Newton \
                  steps. Path following may pass 450 changes of the active set and contact that gets stiffer 60 iterations in addition; a step ends when its \
                  failed attempts have taken 10 times `max_iter` iterations",
        default: "these",
    },
    StatementRow {
        word: "solver",
        usage: "`solver newton with perturb=1e-6`",
        meaning: "a step that ends in an equilibrium which is not stable (W640) is pushed along the lowest direction, by so much of the \
                  extent of the mesh (at most 0.1), and goes downhill from there: the branch that buckles. Also on the command \
                  line of `wfl run`; needs a symmetric tangent of displacements alone",
        default: "the state stays",
    },
    StatementRow {
        word: "solver",
        usage: "`solver linear with cg, amg`, `with gmres, amg` or `with direct`",
        meaning: "how large systems are solved: symmetric matrices by conjugate gradients with multigrid, contact on \
                  symmetric bodies, and a motion with a pressure, by GMRES with multigrid, or factors \
                  (`docs/solvers.md`); an iteration that the scene does not allow is E442",
        default: "by size",
    },
    StatementRow {
        word: "solver",
        usage: "`solver newton with accuracy=1e-3, of=slip`",
        meaning: "the demanded error, see below",
        default: "`of=L2`",
    },
    StatementRow {
        word: "quadrature",
        usage: "`quadrature on r degree n` or `vertex`",
        meaning: "Gauss rule of that degree, or the nodal rule",
        default: "from the degrees of the terms and of the geometry: exact for polynomials, `2p + 1` (`3p` on \
                  simplices) for other laws; faces with contact have one point a node, but through a mapping, on cells of \
                  second order, and where a law on hexahedra reads the traction (`docs/quadrature.md`); a measure of the geometry alone \
                  (`integral(1)`) on curved faces has at least degree 5, whatever terms stand there; `wfl check` tells the rule and why",
    },
    StatementRow {
        word: "quadrature",
        usage: "`quadrature on r segments of m degree n`",
        meaning: "faces of `r` are cut where they lie opposite of edges of the faces that the mapping `m` leads to, anew in each state \
                  where it moves; each piece has a Gauss rule of degree `n` (of a segment or of triangles). For laws that read \
                  through `m`, whose other side has kinks at these edges: a constant pressure passes exactly. Other laws on \
                  `r` have the plain rule of degree `n`. No `state` and no `vertex` rule there (E411)",
        default: "",
    },
    StatementRow {
        word: "measure",
        usage: "`measure m = mean/max/min/integral(expr) on r`",
        meaning: "a number to print and report at each step, a column of `measures.csv`; one that is not finite ends with \
                  exit code 1 (E611)",
        default: "",
    },
    StatementRow {
        word: "measure",
        usage: "`measure m = max/min(expr) at nodes of r`",
        meaning: "of the values at the nodes of the cells or faces of `r` in place of its integration points; of a quantity \
                  that jumps, the values of each cell",
        default: "",
    },
    StatementRow {
        word: "measure",
        usage: "`measure m = value(expr) at [x, y]`",
        meaning: "at one point, in the first body that has `expr` and the point; with `Normal`, on the first region of faces",
        default: "",
    },
    StatementRow {
        word: "measure",
        usage: "`measure m = reaction(u(1)) on r`",
        meaning: "what the values carry that `fix` prescribes at the nodes of `r`: minus the sum of their equations, the force \
                  that the body exerts on its support, the flow of a scalar out of the body. A node at a corner has what all \
                  `fix` there prescribe, and counts whole in each region: reactions on sides that meet add up to more than that on \
                  both together. The argument is linear in one \
                  unknown: `p`, `u(1)`, `u.[0,1]`, the moment `x*u(2) - y*u(1)` about the reference placement (E460 says how \
                  current arms are written)",
        default: "",
    },
    StatementRow {
        word: "measure",
        usage: "`measure k = F/d`, `measure m = integral(p*x)/integral(p) on r`",
        meaning: "a number that others make: arithmetic of measures, parameters, the step variable, and `max(e)`, `min(e)`, \
                  `mean(e)`, `integral(e)`, `reaction(e)` on the region behind `on`. Reported behind the other measures; \
                  `expect`, events and the limit of an increment may read it, and so may numbers of this kind below it",
        default: "",
    },
    StatementRow {
        word: "balance",
        usage: "`balance water of p, pf`",
        meaning: "what the equations of scalar unknowns add up to, as measures: `water_in` and `water_out` of loads and \
                  prescribed values, `water_NAME` of what each term takes up, `water_lost` of what is left, in the unit of the \
                  equations; more than 1e-8 lost is warned of (W650)",
        default: "",
    },
    StatementRow {
        word: "event",
        usage: "`event e = max(V) on fault > 1e-3`",
        meaning: "what begins and ends during the steps: a comparison of numbers made of measures, parameters, the step \
                  variable and reductions on a region. Its times are told and stand in `report.json`; `expect` knows \
                  `e_count`, `e_first`, `e_last` (beginnings) and `e_interval` (between the last two)",
        default: "",
    },
    StatementRow {
        word: "gradient",
        usage: "`gradient Fn, sum(misfit), slip at t = 4 with E, field k`",
        meaning: "derivatives of measures at the last step, of their `sum` or `mean` over the steps, or at the step that ends at \
                  a value, in parameters and in data fields by node: a table, `gradient.csv` and the report. `expect` knows \
                  those of measures at the last step in parameters as `Fn_by_E`",
        default: "none",
    },
    StatementRow {
        word: "expect",
        usage: "`expect condition`",
        meaning: "a condition on measures, params and the step variable, at the last step; exit code 3 if it is false",
        default: "",
    },
    StatementRow {
        word: "output",
        usage: "`output vtk \"name\" : u, expr as name`",
        meaning: "files for ParaView, one a step",
        default: "none",
    },
    StatementRow {
        word: "output",
        usage: "`output ... \"name\" every n : ...`",
        meaning: "a file for every `n`-th step from the first one on, and for the last step; `wfl check` shows number \
                  and size of the files",
        default: "every step; about a hundred of those that the run chooses",
    },
    StatementRow {
        word: "output",
        usage: "`output ... \"name\" every yr : ...`",
        meaning: "a file for the first step in each length `yr` of the step variable: `yr` is a parameter with a unit, or \
                  any parameter where the run chooses the steps, which then end at these values; of a series over the steps \
                  (`at`) the rows of these steps",
        default: "",
    },
    StatementRow {
        word: "output",
        usage: "`output ... \"name\" when e : ...`",
        meaning: "files only while the event `e` lasts, and for the first and the last step; also behind `every`",
        default: "",
    },
    StatementRow {
        word: "output",
        usage: "`output csv \"name\" : a, b at P, Q`",
        meaning: "a series: one file with a row for each step and point, of values in bodies or on faces with terms",
        default: "",
    },
    StatementRow {
        word: "output",
        usage: "`output csv \"name\" : ... along P to Q with points=n`",
        meaning: "values along a line",
        default: "",
    },
    StatementRow {
        word: "use",
        usage: "`use \"file.wfl\"`, `use \"contact\"`, `use \"elasticity\"`, `use \"polar\"`, `use \"poro\"`, `use \"sliding\"`",
        meaning: "includes another file (the ending may be omitted) or macros of the standard library",
        default: "",
    },
];
