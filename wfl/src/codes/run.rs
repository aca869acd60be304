//! E6: the run. E7: parameters, files and folders of results. E8: not supported.

use super::{Code, CodePage};

pages! {
    page(
        E601,
        "an undefined value in the run",
        "A formula gave infinity or an undefined value at a point: a logarithm or root of a negative number, a \
         division by zero. The run stops; the message has the place and the values.",
        "def mu = log(Norm(u))",
        "def mu = log(1 + Norm(u))",
    ),
    page(
        E602,
        "a singular load step",
        "The linear system of a load step is singular: a change of the unknowns leaves all equations unchanged. The \
         message names the field, describes the change and says which term should resist it. Common causes: a rigid \
         body motion that nothing prevents, since no node is fixed or the contact is open, slides at its friction \
         bound, has no friction, is zero or has a wrong sign; an empty equation, since no term tests the unknown, a \
         multiplier has no law or a coefficient is zero; a field that is determined up to a constant; a pressure mode \
         that alternates from node to node, since the elements of pressure and velocity are not stable together; an \
         hourglass mode of a quadrature rule of too low degree; linearly dependent equations; or parameters of so \
         different size that rounding removes the smaller terms, such as a far too large parameter.",
        "fix u(1) = 0 on west",
        "fix u = [0,0,0] on west",
    ),
    page(
        E603,
        "a load step that did not converge",
        "Newton's method reached its last iteration above the tolerance. Smaller increments were tried first, until \
         the failed attempts had taken ten times `max_iter` iterations. The step is marked in the report, its fields \
         are not written, and the run ends unless `on_fail=go_on` is set. Smaller load steps or another gamma often \
         help; a body that slides away has no equilibrium at all.",
        "solver newton with max_iter=3",
        "solver newton with max_iter=50",
    ),
    page(
        E604,
        "an expectation that does not hold",
        "The condition of an `expect` statement is false, or not a number, at the end of the run.",
        "measure m = mean(u(1)) on all\nexpect m > 1e30",
        "measure m = mean(u(1)) on all\nexpect m < 1e30",
    ),
    page(
        E605,
        "an accuracy that was not reached",
        "The estimated error was not as small as demanded when the time of `--budget` or the memory was used up, or the \
         estimates did not fall. Or a part of the error that refinement does not reduce is larger: the boundary of a \
         mesh file that is a polygon where the body is curved, the length of the steps, data that change within less \
         than the distance of the points where they are looked at, or the true error where the scene has its exact \
         solution. The run with the smallest estimate is kept as the result, and the message says which part it is; \
         `--of` selects another quantity, `--budget` allows more time.",
        "solver newton with accuracy=1e-6, of=H1",
        "solver newton with accuracy=1e-2",
    ),
    page(
        E606,
        "not enough memory",
        "A mesh, a matrix, its factor or a file does not fit into the memory of the machine, of its control group, of \
         the address space (`ulimit -v`) or of `--memory`. Large allocations are estimated beforehand; the message \
         says what needs how much. Use beyond the estimates is detected within a millisecond and ends the run; every \
         file then has its former or its new content, never a part. Fewer cells, or a lower degree, need less.",
        "mesh box [0,0,0] to [1,1,1] cells [1500,1500,1500]",
        "mesh box [0,0,0] to [1,1,1] cells [16,16,16]",
    ),
    page(
        E609,
        "machine code could not be made",
        "The program could not compile a formula for this machine. This is a fault of the program, not of the scene; \
         please report it with the scene.",
        "def a = gamma",
        "def b = gamma",
    ),
    page(
        E610,
        "a given value that is not finite",
        "A prescribed value, an initial guess, a data field, a mapping or the map of the mesh is infinite or undefined \
         at a node or point: a division by zero, a logarithm of a negative number, a number above 1.8e308. The message \
         marks the operation and the place. Nothing is solved with such a value.",
        "fix u(1) = 1/x on west",
        "fix u(1) = 1/(1 + x) on west",
    ),
    page(
        E611,
        "a measure that is not finite",
        "A measure is infinite or undefined: its expression divides by zero at a point, or its region has no size. The \
         results are written, but the run has not succeeded: exit code 1.",
        "measure m = mean(1/u(1)) on west",
        "measure m = mean(u(1)) on west",
    ),
    page(
        E612,
        "a state that is not finite",
        "An unknown, or a nodal force that follows from it, exceeds the largest number (1.8e308), or the update of a \
         state is infinite or undefined. Such a state is never a solution; it is neither written nor measured. \
         Prescribed values, loads or initial values are far too large for the other numbers of the scene.",
        "fix u(1) = 1e308 on west",
        "fix u(1) = 1e-3 on west",
    ),
    page(
        E613,
        "a load that nothing balances",
        "The equation of a number of the whole scene (the depth of a punch that a force drives) has a constant load, and \
         what the other terms give to it has the same sign whatever the number is: contact can only push. The sum is \
         never zero. One of the two has the wrong sign. This is found before anything is solved, from the values of the \
         terms at some values of the number.",
        "term contact on top : pos_part(Pn)*(Test_u.Normal + Test_d)\nterm weight on global : P*Test_d",
        "term contact on top : pos_part(Pn)*(Test_u.Normal + Test_d)\nterm weight on global : -P*Test_d",
    ),
    page(
        E614,
        "an interface that drives its sides",
        "One body is moved a little as a whole, in each direction and both ways: the forces of a law between two bodies \
         resist such a motion or do not meet it. Those of this term do work with every motion that they meet, opening \
         and closing, so the interface releases energy instead of storing it, and nothing is in equilibrium. The test \
         functions have the two sides in the other order than the jump of the unknowns.",
        "term cohesion on fault : k*jump(uL,uR).jump(Test_uR,Test_uL)",
        "term cohesion on fault : k*jump(uL,uR).jump(Test_uL,Test_uR)",
    ),
    page(
        E701,
        "a param outside its bounds",
        "A value, often from the command line, is not in the range or set that the declaration allows.",
        "wfl run fault.wfl theta=2",
        "wfl run fault.wfl theta=1",
    ),
    page(
        E702,
        "a param or option that is not finite",
        "A value that is computed before the run is infinite or undefined, for example because it exceeds the largest \
         number.",
        "param a = 1e200*1e200",
        "param a = 1e200",
    ),
    page(
        E703,
        "a value for a name that is no param",
        "On the command line NAME=VALUE replaces the value of a param that the scene declares. The note lists them.",
        "wfl run fault.wfl gama=1e4",
        "wfl run fault.wfl gamma=1e4",
    ),
    page(
        E710,
        "an output with a name that is no file name",
        "Results are files of the results folder, named after their output. A name is one that every system has: no path, \
         no dot at its beginning, none of < > : \" | ? *, no dot or blank at its end, none of the names that Windows keeps \
         for devices (CON, NUL, COM1, ...), at most 255 bytes with number and ending.",
        "output vtk \"nul\" : u",
        "output vtk \"fields\" : u",
    ),
    page(
        E711,
        "a results folder that another process writes to",
        "A run, a sweep or a report locks its folder while it writes. The system releases the lock when the process \
         ends, also when it is killed. Wait until it has ended, or write elsewhere.",
        "wfl run fault.wfl --out out/fault    # while another one runs there",
        "wfl run fault.wfl --out out/second",
    ),
    page(
        E712,
        "a foreign file in the results folder",
        "Only files that the manifest of a results folder names are replaced or removed. If another file, a folder or \
         a link has the name of a result, the run does not begin. Move it away, or write elsewhere.",
        "wfl run fault.wfl --out .    # where a line.csv is that the run would replace",
        "wfl run fault.wfl --out out/fault",
    ),
    page(
        E713,
        "a folder with results of another kind",
        "The folder has the results of a run and a sweep is to be written there, or the other way round. A folder \
         holds one of them.",
        "wfl sweep fault.wfl gamma=1e4,1e6 --out out/fault    # the results of wfl run",
        "wfl sweep fault.wfl gamma=1e4,1e6 --out out/sweep",
    ),
    page(
        E714,
        "results of another run",
        "`--resume` continues the same run only. A run is identified by everything it reads: texts, mesh and data \
         files, values of parameters, knobs, precision, and the version of the program. The message names what \
         differs. Without `--resume` the run starts from the beginning and replaces the results.",
        "wfl run fault.wfl gamma=1e6 --resume    # what was stopped had gamma=1e4",
        "wfl run fault.wfl gamma=1e4 --resume",
    ),
    page(
        E715,
        "damaged or missing results",
        "A file of a results folder differs from what was written, or is missing: the manifest of the folder has the \
         size and the hash of each file. Such a file is neither continued nor shown.",
        "wfl run fault.wfl --resume    # after fault_0003.vtu was edited",
        "wfl run fault.wfl",
    ),
    page(
        E716,
        "a result with the name of an input file",
        "An output has the name of a mesh, data or start file of the scene in the same folder, which it would replace. \
         Give the output another name, or write elsewhere.",
        "wfl run layers.wfl --out .    # reads layers.csv and writes it",
        "wfl run layers.wfl --out out/layers",
    ),
    page(
        E717,
        "results cannot be written",
        "The system refused to write a file or a folder: the disc is full, or the folder is write-protected. Files \
         written before are complete. `--resume` continues a run; a sweep continues when it is started again.",
        "wfl run fault.wfl --out /full/disc",
        "wfl run fault.wfl --out /other/disc --resume",
    ),
    page(
        E718,
        "a placement of a mesh file that does not fit",
        "A motion has as many components as the mesh has dimensions, a factor is above 0, a turn in space has an axis: \
         `turned by 30 about [0,0,1]`. In the plane a turn is about the origin, without an axis.",
        "mesh file \"disc.msh\" moved by [0, 0, 2]",
        "mesh file \"disc.msh\" moved by [0, 2]",
    ),
    page(
        E801,
        "GWFL that this program does not have",
        "Cut elements, elementary transformations, two-domain integrals and complex fields are not available. A crack \
         that follows faces is an interface between two regions of cells.",
        "term jump on fault : (Xfem_plus(u) - Xfem_minus(u)).Test_u",
        "term jump on fault : (uL - Interpolate(uR, neighbor_element)).Test_uL",
    ),
    page(
        E802,
        "something that is not available yet",
        "The language has this feature, but the program does not support it yet. The message says what to write \
         instead.",
        "mapping m = point [1 - x, y, z]\noutput csv \"r\" : Interpolate(u, m) along [0,0,0] to [1,1,1]",
        "mapping m = point [1 - x, y, z]\nmeasure r = max(Norm(Interpolate(u, m))) on all",
    ),
}
