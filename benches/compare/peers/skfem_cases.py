"""The cases that scikit-fem writes in a few lines: it makes a new matrix each time."""

import numpy as np
import skfem
from skfem.helpers import ddot, det, dot, eye, grad, inv, sym_grad, trace, transpose

import common


def basis(mesh, element, quadrature):
    return skfem.Basis(mesh, skfem.ElementVector(element), intorder=quadrature)


def tets(cells):
    return skfem.MeshTet.init_tensor(*(np.linspace(0, 1, n + 1) for n in cells))


def hexes(cells):
    return skfem.MeshHex.init_tensor(*(np.linspace(0, 1, n + 1) for n in cells))


def elasticity(mesh, element, quadrature):
    space = basis(mesh, element, quadrature)

    @skfem.BilinearForm
    def form(u, v, _):
        strain = sym_grad(u)
        return ddot(common.LAMBDA * eye(trace(strain), 3) + 2 * common.MU * strain, sym_grad(v))

    return mesh.nelements, lambda: form.assemble(space)


def neo_hookean(mesh, element, quadrature):
    space = basis(mesh, element, quadrature)
    state = 1e-3 * ((np.arange(space.N) * 7919 % 1000) / 1000 - 0.5)

    @skfem.BilinearForm
    def form(u, v, w):
        f = grad(w["state"]) + eye(np.ones_like(w.x[0]), 3)
        inverse, h = inv(f), grad(u)
        # derivative of mu (F - F^-T) + lambda log(det F) F^-T in the direction h
        moved = transpose(np.einsum("ij...,jk...,kl...->il...", inverse, h, inverse))
        spread = np.einsum("ij...,ji...->...", inverse, h)
        p = common.NEO_MU * (h + moved)
        p = p + common.NEO_LAMBDA * (spread * transpose(inverse) - np.log(det(f)) * moved)
        return ddot(p, grad(v))

    return mesh.nelements, lambda: form.assemble(space, state=space.interpolate(state))


def poisson():
    mesh = skfem.MeshTri.init_tensor(*(np.linspace(0, 1, n + 1) for n in common.TRIANGLES))
    space = skfem.Basis(mesh, skfem.ElementTriP1(), intorder=1)

    @skfem.BilinearForm
    def form(u, v, _):
        return dot(grad(u), grad(v))

    return mesh.nelements, lambda: form.assemble(space)


common.run(
    [
        ("P1 tet elasticity", lambda: elasticity(tets(common.TETS), skfem.ElementTetP1(), 1)),
        ("Q1 hex elasticity", lambda: elasticity(hexes(common.HEXES), skfem.ElementHex1(), 3)),
        ("P2 tet elasticity", lambda: elasticity(tets(common.FEW_TETS), skfem.ElementTetP2(), 2)),
        ("P1 tet neo-Hookean", lambda: neo_hookean(tets(common.TETS), skfem.ElementTetP1(), 1)),
        ("P2 tet neo-Hookean", lambda: neo_hookean(tets(common.FEW_TETS), skfem.ElementTetP2(), 2)),
        ("Q1 hex neo-Hookean", lambda: neo_hookean(hexes(common.HEXES), skfem.ElementHex1(), 3)),
        ("P1 triangle Poisson", poisson),
    ]
)
