"""The nine cases in GetFEM (python interface, GWFL expressions), and its fault benchmark.

`python getfem_cases.py` prints the assembly cases, `python getfem_cases.py fault` times the slipping fault of
examples/fault with Nitsche's method, theta = 0, gamma = 1e5, 8x8x8 cells, 20 steps, plain Newton.
"""

import json
import sys
import time

import getfem as gf
import numpy as np

import common


def box(cells, is_hex, low=(0.0, 0.0, 0.0), high=(1.0, 1.0, 1.0)):
    axes = [np.linspace(a, b, n + 1) for a, b, n in zip(low, high, cells)]
    return gf.Mesh("cartesian" if is_hex else "regular simplices", *axes)


RULES = {
    ("tet", 1): "IM_TETRAHEDRON(1)",
    ("tet", 2): "IM_TETRAHEDRON(2)",
    ("hex", 3): "IM_GAUSS_PARALLELEPIPED(3,3)",
}


def field(mesh, degree, dim):
    space = gf.MeshFem(mesh, dim)
    space.set_classical_fem(degree)
    return space


def assembler(text, rule, space, *more):
    state = 1e-3 * ((np.arange(space.nbdof()) * 7919 % 1000) / 1000 - 0.5)

    def assemble():
        gf.asm_generic(rule, 2, text, -1, "u", True, space, state, *more)

    return assemble


def on_cells(cells, is_hex, degree, quadrature, text):
    mesh = box(cells, is_hex)
    rule = gf.MeshIm(mesh, gf.Integ(RULES["hex" if is_hex else "tet", quadrature]))
    return mesh.nbcvs(), assembler(text, rule, field(mesh, degree, 3))


ELASTIC = f"({common.LAMBDA}*Div_u*Id(3) + 2*{common.MU}*Sym(Grad_u)):Grad_Test_u"
F = "(Id(3)+Grad_u)"
NEO = (
    f"({common.NEO_MU}*({F} - Inv({F})') + {common.NEO_LAMBDA}*log(Det({F}))*Inv({F})'):Grad_Test_u"
)


def interface(is_hex):
    """All inner facets of a box, a field that jumps: as many degrees of freedom a facet as two fields that meet."""
    mesh = box(common.FAULT, is_hex, (-1, 0, 0), (1, 4, 4))
    mesh.set_region(1, mesh.inner_faces())
    rule = gf.MeshIm(mesh, gf.Integ(RULES[("hex", 3) if is_hex else ("tet", 2)]))
    space = gf.MeshFem(mesh, 3)
    space.set_fem(gf.Fem("FEM_QK_DISCONTINUOUS(3,1)" if is_hex else "FEM_PK_DISCONTINUOUS(3,1)"))
    state = 1e-3 * ((np.arange(space.nbdof()) * 7919 % 1000) / 1000 - 0.5)
    sigma = f"({common.LAMBDA}*Div_u*Id(3) + 2*{common.MU}*Sym(Grad_u))"
    jump = "(u - Interpolate(u,neighbor_element))"
    test = "(Test_u - Interpolate(Test_u,neighbor_element))"
    text = f"pos_part({common.GAMMA}*{jump}.Normal - ({sigma}*Normal).Normal)*({test}.Normal)"

    def assemble():
        gf.asm_generic(rule, 2, text, 1, "u", True, space, state)

    return mesh.inner_faces().shape[1], assemble


def poisson():
    mesh = gf.Mesh("triangles grid", *(np.linspace(0, 1, n + 1) for n in common.TRIANGLES))
    rule = gf.MeshIm(mesh, gf.Integ("IM_TRIANGLE(1)"))
    return mesh.nbcvs(), assembler("Grad_u.Grad_Test_u", rule, field(mesh, 1, 1))


def fault():
    """Seconds for all steps; Newton to 1e-9 of the first residual."""
    left, right = "uL", "uR"
    mesh = box((8, 8, 8), True, (-1, 0, 0), (1, 4, 4))
    centres = [np.mean(mesh.pts_from_cvid(int(c))[0], axis=1)[0] for c in mesh.cvid()]
    cells = [int(c) for c in mesh.cvid()]
    mesh.set_region(1, [[c for c, x in zip(cells, centres) if x < 0], [-1] * sum(x < 0 for x in centres)])
    mesh.set_region(2, [[c for c, x in zip(cells, centres) if x > 0], [-1] * sum(x > 0 for x in centres)])
    points = mesh.pts()
    faces = {"west": lambda p: abs(p[0] + 1) < 1e-9, "east": lambda p: abs(p[0] - 1) < 1e-9}
    faces |= {"bottom": lambda p: abs(p[2]) < 1e-9, "top": lambda p: abs(p[2] - 4) < 1e-9}
    for number, (_, inside) in enumerate(faces.items(), start=11):
        ids = [k for k in range(points.shape[1]) if inside(points[:, k])]
        mesh.set_region(number, mesh.faces_from_pid(ids))
    mesh.region_intersect(14, 2)
    inner = mesh.faces_from_pid([k for k in range(points.shape[1]) if abs(points[0, k]) < 1e-9])
    keep = [k for k in range(inner.shape[1]) if int(inner[0, k]) in set(mesh.region(1)[0])]
    mesh.set_region(3, inner[:, keep])

    rule = gf.MeshIm(mesh, gf.Integ("IM_GAUSS_PARALLELEPIPED(3,4)"))
    whole = field(mesh, 1, 3)
    parts = {}
    for name, region in ((left, 1), (right, 2)):
        dofs = whole.basic_dof_on_region(region)
        parts[name] = gf.MeshFem("partial", whole, dofs)
    model = gf.Model("real")
    for name, space in parts.items():
        model.add_fem_variable(name, space)
    model.add_initialized_data("t", [0.0])
    law = "(10000*Div_{0}*Id(3) + 2*10000*Sym(Grad_{0}))"
    for name, region in ((left, 1), (right, 2)):
        model.add_linear_term(rule, f"{law.format(name)}:Grad_Test_{name}", region)
        model.add_Dirichlet_condition_with_simplification(name, 13)
    model.add_linear_term(rule, "1e9*uL(1)*Test_uL(1)", 11)  # one component: by penalty
    model.add_source_term(rule, "-3*Test_uR(1)", 12)
    model.add_source_term(rule, "-t*Test_uR(3)", 14)
    gamma, friction = 1e5, 0.4
    other = "Interpolate(uR,neighbor_element)"
    traction = f"({law.format(left)}*Normal)"
    pn = f"({gamma}*((uL-{other}).Normal) - {traction}.Normal)"
    slip = f"({gamma}*(uL-{other}) - {traction})"
    pt = f"({slip} - ({slip}.Normal)*Normal)"
    force = f"(pos_part{pn}*Normal + Ball_projection({pt}, {friction}*pos_part{pn}))"
    test = "(Test_uL - Interpolate(Test_uR,neighbor_element))"
    model.add_nonlinear_term(rule, f"{force}.{test}", 3)
    start, iterations = time.process_time(), 0
    for step in range(20):
        model.set_variable("t", [0.5 * step])
        done = model.solve("max_res", 1e-7, "max_iter", 40, "lsolver", "mumps")
        iterations += int(done[0])
    print(json.dumps({"case": "fault", "steps": 20, "iterations": iterations, "seconds": time.process_time() - start}))


if sys.argv[1:] == ["fault"]:
    fault()
else:
    common.run(
        [
            ("P1 tet elasticity", lambda: on_cells(common.TETS, False, 1, 1, ELASTIC)),
            ("Q1 hex elasticity", lambda: on_cells(common.HEXES, True, 1, 3, ELASTIC)),
            ("P2 tet elasticity", lambda: on_cells(common.FEW_TETS, False, 2, 2, ELASTIC)),
            ("P1 tet neo-Hookean", lambda: on_cells(common.TETS, False, 1, 1, NEO)),
            ("P2 tet neo-Hookean", lambda: on_cells(common.FEW_TETS, False, 2, 2, NEO)),
            ("Q1 hex neo-Hookean", lambda: on_cells(common.HEXES, True, 1, 3, NEO)),
            ("interface, tets", lambda: interface(False)),
            ("interface, hexes", lambda: interface(True)),
            ("P1 triangle Poisson", poisson),
        ]
    )
