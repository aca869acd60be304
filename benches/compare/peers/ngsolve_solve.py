"""Whole problems in NGSolve: `ngsolve_solve.py CASE N SOLVER` prints one JSON line.

Elements, rules and loads are those of scenes/CASE.wfl. SOLVER is `cholesky` (its sparse Cholesky factor), `lu` (UMFPACK) or
`bddc` (conjugate gradients to a relative residual of 1e-10). Newton stops at a relative residual of 1e-10.
"""

import json
import resource
import sys
import time

import ngsolve as ng
from ngsolve.krylovspace import CGSolver
from ngsolve.meshes import MakeStructured2DMesh, MakeStructured3DMesh

ng.SetNumThreads(1)
INVERSES = {"cholesky": "sparsecholesky", "lu": "umfpack"}


def cube(n):
    return MakeStructured3DMesh(hexes=False, nx=n, ny=n, nz=n)


def inverse(form, space, solver, preconditioner):
    if solver == "bddc":
        return CGSolver(form.mat, preconditioner.mat, tol=1e-10, maxiter=500)
    return form.mat.Inverse(space.FreeDofs(), inverse=INVERSES[solver])


def nonlinear(n, solver):
    mesh = cube(n)
    space = ng.VectorH1(mesh, order=2, dirichlet="bottom|top")
    u, v = space.TnT()
    mu, lam = 10 / 2.6, 3 / (1.3 * 0.4)
    f = ng.Id(3) + ng.Grad(u)
    rules = {ng.TET: ng.IntegrationRule(ng.TET, 4)}
    energy = mu / 2 * (ng.InnerProduct(f, f) - 3 - 2 * ng.log(ng.Det(f))) + lam / 2 * ng.log(ng.Det(f)) ** 2
    form = ng.BilinearForm(space, symmetric=True)
    form += ng.Variation(energy.Compile() * ng.dx(intrules=rules))
    moved, given = ng.GridFunction(space), ng.GridFunction(space)
    residual, correction = moved.vec.CreateVector(), moved.vec.CreateVector()
    free, held = ng.Projector(space.FreeDofs(), True), ng.Projector(~space.FreeDofs(), True)
    left, jump = moved.vec.CreateVector(), moved.vec.CreateVector()
    solves = 0
    for step in range(1, 5):
        given.Set(ng.CF((0, 0, -0.05 * step)), definedon=mesh.Boundaries("top"))
        jump.data = given.vec - moved.vec
        jump.data = held * jump
        first = None
        for _ in range(20):
            form.Apply(moved.vec, residual)
            form.AssembleLinearization(moved.vec)
            if first is None:
                # prescribed values move in the first correction, K du = -r - K jump, as in the other programs
                residual.data += form.mat * jump
                moved.vec.data += jump
            left.data = free * residual
            first = first or left.Norm()
            if left.Norm() <= 1e-10 * first:
                break
            correction.data = form.mat.Inverse(space.FreeDofs(), inverse=INVERSES[solver]) * residual
            solves += 1
            moved.vec.data -= correction
    f = ng.Id(3) + ng.Grad(moved)
    energy = mu / 2 * (ng.InnerProduct(f, f) - 3 - 2 * ng.log(ng.Det(f))) + lam / 2 * ng.log(ng.Det(f)) ** 2
    return space, solves, ng.Integrate(energy * ng.dx(intrules=rules), mesh)


def block(n, solver, degree):
    mesh = cube(n)
    space = ng.VectorH1(mesh, order=degree, dirichlet="left")
    u, v = space.TnT()
    young, nu = 70e3, 0.3
    lam, mu = young * nu / ((1 + nu) * (1 - 2 * nu)), young / (2 * (1 + nu))
    strain = lambda w: 0.5 * (ng.Grad(w) + ng.Grad(w).trans)  # noqa: E731
    stress = lam * ng.Trace(strain(u)) * ng.Id(3) + 2 * mu * strain(u)
    form = ng.BilinearForm(space, symmetric=True)
    form += ng.InnerProduct(stress, strain(v)) * ng.dx
    preconditioner = ng.Preconditioner(form, "bddc") if solver == "bddc" else None
    load = ng.LinearForm(-v[2] * ng.dx)
    form.Assemble()
    load.Assemble()
    moved = ng.GridFunction(space)
    solve = inverse(form, space, solver, preconditioner)
    moved.vec.data = solve * load.vec
    return space, getattr(solve, "iterations", 1), ng.Integrate(moved[2], mesh)


def stokes(n, solver):
    mesh = MakeStructured2DMesh(quads=False, nx=2 * n, ny=n, mapping=lambda x, y: (2 * x, y))
    velocity = ng.VectorH1(mesh, order=2, dirichlet="left|top|bottom")
    space = velocity * ng.H1(mesh, order=1)
    (u, p), (v, q) = space.TnT()
    form = ng.BilinearForm(space, symmetric=True)
    form += (2 * ng.InnerProduct(ng.Grad(u), ng.Grad(v)) - p * ng.div(v) - ng.div(u) * q) * ng.dx
    form.Assemble()
    found = ng.GridFunction(space)
    # a projection, where the others have the profile at their nodes
    found.components[0].Set(ng.CF((ng.sin(ng.pi * ng.y), 0)), definedon=mesh.Boundaries("left|top|bottom"))
    residual = found.vec.CreateVector()
    residual.data = -form.mat * found.vec
    found.vec.data += form.mat.Inverse(space.FreeDofs(), inverse=INVERSES[solver]) * residual
    return space, 1, ng.Integrate(found.components[0][0] ** 2, mesh)


def heat(n, solver):
    mesh = MakeStructured2DMesh(quads=False, nx=n, ny=n)
    space = ng.H1(mesh, order=1, dirichlet=".*")
    u, v = space.TnT()
    dt = 1e-4
    mass, form = ng.BilinearForm(u * v / dt * ng.dx), ng.BilinearForm((u * v / dt + ng.grad(u) * ng.grad(v)) * ng.dx)
    mass.Assemble()
    form.Assemble()
    old = ng.GridFunction(space)
    old.vec[:] = 1.0
    solve, right = form.mat.Inverse(space.FreeDofs(), inverse=INVERSES[solver]), old.vec.CreateVector()
    for _ in range(1000):
        right.data = mass.mat * old.vec
        old.vec.data = solve * right
    return space, 1000, ng.Integrate(old, mesh)


CASES = {
    "cube": nonlinear,
    "block P1": lambda n, solver: block(n, solver, 1),
    "block P2": lambda n, solver: block(n, solver, 2),
    "stokes": stokes,
    "heat": heat,
}


def main(case, n, solver):
    begin, used = time.perf_counter(), time.process_time()
    space, solves, value = CASES[case](int(n), solver)
    row = {
        "unknowns": space.ndof,
        "solves": solves,
        "value": float(value),
        "wall": time.perf_counter() - begin,
        "seconds": time.process_time() - used,
        "peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
    }
    print(json.dumps(row), flush=True)


main(*sys.argv[1:])
