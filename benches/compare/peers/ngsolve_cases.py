"""The nine cases in NGSolve, one thread, expressions compiled to its bytecode (`Compile()`)."""

import ngsolve as ng
import numpy as np
from ngsolve.meshes import MakeStructured2DMesh, MakeStructured3DMesh

import common

ng.SetNumThreads(1)


def hexes(cells):
    return MakeStructured3DMesh(hexes=True, nx=cells[0], ny=cells[1], nz=cells[2])


def tets(cells):
    return MakeStructured3DMesh(hexes=False, nx=cells[0], ny=cells[1], nz=cells[2])


def state(space):
    u = ng.GridFunction(space)
    vector = u.vec.FV().NumPy()
    vector[:] = 1e-3 * ((np.arange(vector.size) * 7919 % 1000) / 1000 - 0.5)
    return u


def stress(v):
    g = ng.Grad(v)
    return common.LAMBDA * ng.Trace(g) * ng.Id(3) + common.MU * (g + g.trans)


def elasticity(mesh, degree, quadrature):
    space = ng.VectorH1(mesh, order=degree)
    u, v = space.TnT()
    form = ng.BilinearForm(space, symmetric=False)
    form += ng.InnerProduct(stress(u), ng.Grad(v)).Compile() * ng.dx(intrules=rules(mesh, quadrature))
    form.Assemble()
    return mesh.ne, lambda: form.Assemble(reallocate=False)


def rules(mesh, degree):
    kinds = [ng.TET, ng.HEX, ng.TRIG]
    return {kind: ng.IntegrationRule(kind, degree) for kind in kinds}


def linearised(form, u, n):
    form.AssembleLinearization(u.vec)
    return n, lambda: form.AssembleLinearization(u.vec, reallocate=False)


def neo_hookean(mesh, degree, quadrature):
    space = ng.VectorH1(mesh, order=degree)
    u, v = space.TnT()
    f = ng.Id(3) + ng.Grad(u)
    inverse = ng.Inv(f).trans
    p = common.NEO_MU * (f - inverse) + common.NEO_LAMBDA * ng.log(ng.Det(f)) * inverse
    form = ng.BilinearForm(space, symmetric=False)
    form += ng.InnerProduct(p, ng.Grad(v)).Compile() * ng.dx(intrules=rules(mesh, quadrature))
    return linearised(form, state(space), mesh.ne)


def interface(mesh):
    """All inner facets, a field that jumps: as many degrees of freedom a facet as two fields that meet."""
    space = ng.VectorL2(mesh, order=1, dgjumps=True)
    u, v = space.TnT()
    n = ng.specialcf.normal(3)
    pn = common.GAMMA * ng.InnerProduct(u - u.Other(), n) - ng.InnerProduct(stress(u) * n, n)
    law = ng.IfPos(pn, pn, 0) * ng.InnerProduct(v - v.Other(), n)
    form = ng.BilinearForm(space, symmetric=False)
    form += law.Compile() * ng.dx(skeleton=True)
    inner = sum(1 for facet in mesh.facets if len(facet.elements) == 2)
    return linearised(form, state(space), inner)


def poisson():
    mesh = MakeStructured2DMesh(quads=False, nx=common.TRIANGLES[0], ny=common.TRIANGLES[1])
    space = ng.H1(mesh, order=1)
    u, v = space.TnT()
    form = ng.BilinearForm(space, symmetric=False)
    form += (ng.grad(u) * ng.grad(v)).Compile() * ng.dx
    form.Assemble()
    return mesh.ne, lambda: form.Assemble(reallocate=False)


common.run(
    [
        ("P1 tet elasticity", lambda: elasticity(tets(common.TETS), 1, 1)),
        ("Q1 hex elasticity", lambda: elasticity(hexes(common.HEXES), 1, 3)),
        ("P2 tet elasticity", lambda: elasticity(tets(common.FEW_TETS), 2, 2)),
        ("P1 tet neo-Hookean", lambda: neo_hookean(tets(common.TETS), 1, 1)),
        ("P2 tet neo-Hookean", lambda: neo_hookean(tets(common.FEW_TETS), 2, 2)),
        ("Q1 hex neo-Hookean", lambda: neo_hookean(hexes(common.HEXES), 1, 3)),
        ("interface, tets", lambda: interface(tets((2, 32, 32)))),
        ("interface, hexes", lambda: interface(hexes(common.FAULT))),
        ("P1 triangle Poisson", poisson),
    ]
)
