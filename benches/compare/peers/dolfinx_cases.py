"""The nine cases in DOLFINx: kernels by its C compiler (-Ofast -march=native), matrix in its own CSR format."""

import basix.ufl
import dolfinx
import numpy as np
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

import common

OPTIONS = {"cffi_extra_compile_args": ["-Ofast", "-march=native"], "cffi_libraries": ["m"]}


def assembler(form):
    compiled = fem.form(form, jit_options=OPTIONS)
    matrix = fem.create_matrix(compiled)

    def assemble():
        matrix.set_value(0.0)
        fem.assemble_matrix(matrix, compiled)

    return assemble


def box(cells, kind, low=(0, 0, 0), high=(1, 1, 1)):
    return mesh.create_box(MPI.COMM_WORLD, [np.array(low, float), np.array(high, float)], list(cells), kind)


def stress(v):
    return common.LAMBDA * ufl.div(v) * ufl.Identity(3) + 2 * common.MU * ufl.sym(ufl.grad(v))


def elasticity(cells, kind, degree, quadrature):
    domain = box(cells, kind)
    space = fem.functionspace(domain, ("Lagrange", degree, (3,)))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    dx = ufl.dx(metadata={"quadrature_degree": quadrature})
    return entities(domain), assembler(ufl.inner(stress(u), ufl.grad(v)) * dx)


def neo_hookean(cells, kind, degree, quadrature):
    domain = box(cells, kind)
    space = fem.functionspace(domain, ("Lagrange", degree, (3,)))
    u, v, du = fem.Function(space), ufl.TestFunction(space), ufl.TrialFunction(space)
    u.x.array[:] = 1e-3 * ((np.arange(u.x.array.size) * 7919 % 1000) / 1000 - 0.5)
    f = ufl.Identity(3) + ufl.grad(u)
    inverse = ufl.inv(f).T
    p = common.NEO_MU * (f - inverse) + common.NEO_LAMBDA * ufl.ln(ufl.det(f)) * inverse
    dx = ufl.dx(metadata={"quadrature_degree": quadrature})
    return entities(domain), assembler(ufl.derivative(ufl.inner(p, ufl.grad(v)) * dx, u, du))


def interface(kind, quadrature):
    """All inner facets of a box, a field that jumps: as many degrees of freedom a facet as two fields that meet."""
    domain = box(common.FAULT, kind, (-1, 0, 0), (1, 4, 4))
    space = fem.functionspace(domain, ("Discontinuous Lagrange", 1, (3,)))
    u, v, du = fem.Function(space), ufl.TestFunction(space), ufl.TrialFunction(space)
    u.x.array[:] = 1e-3 * ((np.arange(u.x.array.size) * 7919 % 1000) / 1000 - 0.5)
    n = ufl.FacetNormal(domain)("+")
    traction = ufl.dot(n, stress(u)("+") * n)
    pn = common.GAMMA * ufl.dot(u("+") - u("-"), n) - traction
    positive = ufl.conditional(ufl.gt(pn, 0), pn, 0)
    ds = ufl.dS(metadata={"quadrature_degree": quadrature})
    form = ufl.derivative(positive * ufl.dot(v("+") - v("-"), n) * ds, u, du)
    domain.topology.create_connectivity(2, 3)
    links = domain.topology.connectivity(2, 3)
    inner = int(np.count_nonzero(np.diff(links.offsets) == 2))
    return inner, assembler(form)


def poisson():
    domain = mesh.create_unit_square(MPI.COMM_WORLD, *common.TRIANGLES)
    space = fem.functionspace(domain, ("Lagrange", 1))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    return entities(domain), assembler(ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx)


def entities(domain):
    return domain.topology.index_map(domain.topology.dim).size_local


TET, HEX = mesh.CellType.tetrahedron, mesh.CellType.hexahedron
common.run(
    [
        ("P1 tet elasticity", lambda: elasticity(common.TETS, TET, 1, 1)),
        ("Q1 hex elasticity", lambda: elasticity(common.HEXES, HEX, 1, 3)),
        ("P2 tet elasticity", lambda: elasticity(common.FEW_TETS, TET, 2, 2)),
        ("P1 tet neo-Hookean", lambda: neo_hookean(common.TETS, TET, 1, 1)),
        ("P2 tet neo-Hookean", lambda: neo_hookean(common.FEW_TETS, TET, 2, 2)),
        ("Q1 hex neo-Hookean", lambda: neo_hookean(common.HEXES, HEX, 1, 3)),
        ("interface, tets", lambda: interface(TET, 2)),
        ("interface, hexes", lambda: interface(HEX, 3)),
        ("P1 triangle Poisson", poisson),
    ]
)
