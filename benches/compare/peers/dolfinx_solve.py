"""Whole problems in DOLFINx with PETSc: `dolfinx_solve.py CASE N SOLVER` prints one JSON line.

Meshes, elements, rules and loads are those of scenes/CASE.wfl. SOLVER is `mumps` or `gamg` (conjugate gradients with
rigid-body near-null space, to a relative residual of 1e-10). Newton stops at a relative residual of 1e-10.
"""

import json
import resource
import sys
import time

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem, mesh
from dolfinx.fem import petsc
from mpi4py import MPI
from petsc4py import PETSc


def cube(n):
    return mesh.create_box(MPI.COMM_WORLD, [np.zeros(3), np.ones(3)], [n] * 3, mesh.CellType.tetrahedron)


def fixed(space, where, value):
    facets = mesh.locate_entities_boundary(space.mesh, space.mesh.topology.dim - 1, where)
    dofs = fem.locate_dofs_topological(space, space.mesh.topology.dim - 1, facets)
    return fem.dirichletbc(value, dofs) if isinstance(value, fem.Function) else fem.dirichletbc(value, dofs, space)


def direct(matrix, symmetric):
    solver = PETSc.KSP().create(matrix.comm)
    solver.setType("preonly")
    solver.getPC().setType("cholesky" if symmetric else "lu")
    solver.getPC().setFactorSolverType("mumps")
    solver.setOperators(matrix)
    return solver


def rigid_motions(space):
    """Translations and rotations, orthonormal."""
    x, size = space.tabulate_dof_coordinates(), space.dofmap.index_map.size_local
    basis = np.zeros((6, 3 * size))
    for k in range(3):
        basis[k, k::3] = 1
    for k, (a, b) in enumerate([(0, 1), (1, 2), (2, 0)]):
        basis[3 + k, a::3], basis[3 + k, b::3] = -x[:size, b], x[:size, a]
    q = np.linalg.qr(basis.T)[0].T
    return PETSc.NullSpace().create(vectors=[PETSc.Vec().createWithArray(np.ascontiguousarray(v)) for v in q])


def multigrid(matrix, space):
    matrix.setBlockSize(3)
    matrix.setNearNullSpace(rigid_motions(space))
    options = PETSc.Options()
    for name, value in {"mg_levels_ksp_type": "chebyshev", "mg_levels_pc_type": "jacobi"}.items():
        options[name] = value
    solver = PETSc.KSP().create(matrix.comm)
    solver.setType("cg")
    solver.getPC().setType("gamg")
    solver.setTolerances(rtol=1e-10, max_it=500)
    solver.setFromOptions()
    solver.setOperators(matrix)
    return solver


def nonlinear(n, solver):
    domain = cube(n)
    space = fem.functionspace(domain, ("Lagrange", 2, (3,)))
    u, v, du = fem.Function(space), ufl.TestFunction(space), ufl.TrialFunction(space)
    mu, lam = 10 / 2.6, 3 / (1.3 * 0.4)
    f = ufl.Identity(3) + ufl.grad(u)
    energy = mu / 2 * (ufl.inner(f, f) - 3 - 2 * ufl.ln(ufl.det(f))) + lam / 2 * ufl.ln(ufl.det(f)) ** 2
    dx = ufl.dx(metadata={"quadrature_degree": 4})
    residual = fem.form(ufl.derivative(energy * dx, u, v))
    tangent = fem.form(ufl.derivative(ufl.derivative(energy * dx, u, v), u, du))
    given = fem.Function(space)
    bcs = [
        fixed(space, lambda x: np.isclose(x[2], 0), np.zeros(3)),
        fixed(space, lambda x: np.isclose(x[2], 1), given),
    ]
    matrix, vector = petsc.create_matrix(tangent), petsc.create_vector(space)
    ksp, solves = direct(matrix, True), 0
    for step in range(1, 5):
        given.x.array[2::3] = -0.05 * step
        first = None
        for _ in range(20):
            vector.set(0)
            petsc.assemble_vector(vector, residual)
            petsc.apply_lifting(vector, [tangent], bcs=[bcs], x0=[u.x.petsc_vec], alpha=-1.0)
            petsc.set_bc(vector, bcs, x0=u.x.petsc_vec, alpha=-1.0)
            norm = vector.norm()
            first = first or norm
            if norm <= 1e-10 * first:
                break
            matrix.zeroEntries()
            petsc.assemble_matrix(matrix, tangent, bcs=bcs)
            matrix.assemble()
            ksp.setOperators(matrix)
            correction = vector.duplicate()
            ksp.solve(vector, correction)
            solves += 1
            u.x.petsc_vec.axpy(-1.0, correction)
    return space, solves, fem.assemble_scalar(fem.form(energy * dx))


def block(n, solver, degree):
    domain = cube(n)
    space = fem.functionspace(domain, ("Lagrange", degree, (3,)))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    young, nu = 70e3, 0.3
    lam, mu = young * nu / ((1 + nu) * (1 - 2 * nu)), young / (2 * (1 + nu))
    stress = lam * ufl.div(u) * ufl.Identity(3) + 2 * mu * ufl.sym(ufl.grad(u))
    a = fem.form(ufl.inner(stress, ufl.grad(v)) * ufl.dx)
    rhs = fem.form(ufl.inner(fem.Constant(domain, (0.0, 0.0, -1.0)), v) * ufl.dx)
    bcs = [fixed(space, lambda x: np.isclose(x[0], 0), np.zeros(3))]
    matrix = petsc.assemble_matrix(a, bcs=bcs)
    matrix.assemble()
    vector = petsc.assemble_vector(rhs)
    petsc.set_bc(vector, bcs)
    ksp = multigrid(matrix, space) if solver == "gamg" else direct(matrix, True)
    found = fem.Function(space)
    ksp.solve(vector, found.x.petsc_vec)
    return space, ksp.getIterationNumber(), fem.assemble_scalar(fem.form(found[2] * ufl.dx))


def stokes(n, solver):
    domain = mesh.create_rectangle(MPI.COMM_WORLD, [np.zeros(2), np.array([2.0, 1.0])], [2 * n, n])
    cell = domain.basix_cell()
    mixed = basix.ufl.mixed_element(
        [basix.ufl.element("Lagrange", cell, 2, shape=(2,)), basix.ufl.element("Lagrange", cell, 1)]
    )
    space = fem.functionspace(domain, mixed)
    (u, p), (v, q) = ufl.TrialFunctions(space), ufl.TestFunctions(space)
    form = 2 * ufl.inner(ufl.grad(u), ufl.grad(v)) - p * ufl.div(v) - ufl.div(u) * q
    velocity = space.sub(0).collapse()[0]
    given = fem.Function(velocity)
    given.interpolate(lambda x: np.vstack([np.sin(np.pi * x[1]), 0 * x[1]]))
    facets = mesh.locate_entities_boundary(
        domain, 1, lambda x: np.isclose(x[0], 0) | np.isclose(x[1], 0) | np.isclose(x[1], 1)
    )
    dofs = fem.locate_dofs_topological((space.sub(0), velocity), 1, facets)
    bcs = [fem.dirichletbc(given, dofs, space.sub(0))]
    a = fem.form(form * ufl.dx)
    zero = fem.form(ufl.inner(fem.Constant(domain, (0.0, 0.0)), v) * ufl.dx)
    matrix = petsc.assemble_matrix(a, bcs=bcs)
    matrix.assemble()
    vector = petsc.assemble_vector(zero)
    petsc.apply_lifting(vector, [a], bcs=[bcs])
    petsc.set_bc(vector, bcs)
    found = fem.Function(space)
    direct(matrix, False).solve(vector, found.x.petsc_vec)
    return space, 1, fem.assemble_scalar(fem.form(found[0] ** 2 * ufl.dx))


def heat(n, solver):
    domain = mesh.create_unit_square(MPI.COMM_WORLD, n, n)
    space = fem.functionspace(domain, ("Lagrange", 1))
    u, v, dt = ufl.TrialFunction(space), ufl.TestFunction(space), 1e-4
    old = fem.Function(space)
    old.x.array[:] = 1.0
    everywhere = lambda x: np.isclose(x[0] * (1 - x[0]) * x[1] * (1 - x[1]), 0)  # noqa: E731
    bcs = [fixed(space, everywhere, PETSc.ScalarType(0))]
    a = fem.form((u * v / dt + ufl.inner(ufl.grad(u), ufl.grad(v))) * ufl.dx)
    rhs = fem.form(old * v / dt * ufl.dx)
    matrix = petsc.assemble_matrix(a, bcs=bcs)
    matrix.assemble()
    ksp, vector = direct(matrix, True), petsc.create_vector(space)
    for _ in range(1000):
        vector.set(0)
        petsc.assemble_vector(vector, rhs)
        petsc.set_bc(vector, bcs)
        ksp.solve(vector, old.x.petsc_vec)
    return space, 1000, fem.assemble_scalar(fem.form(old * ufl.dx))


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
        "unknowns": space.dofmap.index_map.size_global * space.dofmap.index_map_bs,
        "solves": solves,
        "value": float(value),
        "wall": time.perf_counter() - begin,
        "seconds": time.process_time() - used,
        "peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
    }
    print(json.dumps(row), flush=True)


main(*sys.argv[1:])
