"""Steady flow where two fractures cross in permeable rock, by scikit-fem 12 (P2 on triangles, a body for each quadrant).

Square [-1,1]^2 of rock, k = 1, cut into four quadrants by the fractures y = 0 (conductivity C1, exchange kn1 with each side)
and x = 0 (C2, kn2). The rock has p = 0 on x = 1, and no flow through the rest of its boundary; the fractures have one
pressure pf, continuous where they cross: 1 at the western end, 0 at the eastern, southern and northern ones.

    int k grad p.grad q + sum_i int_Fi Ci pf' qf' + kni (pf - p+)(qf - q+) + kni (pf - p-)(qf - q-) = 0

Meshes are graded towards the lines and the ends; `difference_to_coarser` is to the last but one of four. Writes
crossing_flow.json: the pressure at the crossing, what each leg takes from its end (flux_end), gives to the crossing
(flux_cross), and leaks; what the rock lets out on x = 1."""
import json
import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as sla
from skfem import Basis, BilinearForm, ElementTriP2, FacetBasis, MeshTri
from skfem.helpers import dot, grad

C = {"y": 10.0, "x": 3.0}
KN = {"y": 5.0, "x": 0.5}


@BilinearForm
def lap(u, v, w):
    return dot(grad(u), grad(v))


@BilinearForm
def mass(u, v, w):
    return u * v


def graded(n):
    """n cells of [0,1], cubed towards both ends."""
    s = np.linspace(0, 1, n + 1)
    return np.where(s < 0.5, 4 * s**3, 1 - 4 * (1 - s) ** 3)


def solve(n):
    x = graded(n)
    offset, rows, cols, data = 0, [], [], []
    places, quadrants = [], []
    for sx in (-1, 1):
        for sy in (-1, 1):
            mesh = MeshTri.init_tensor(np.sort(sx * x), np.sort(sy * x))
            basis = Basis(mesh, ElementTriP2())
            quadrants.append((sx, sy, mesh, basis, offset))
            places.append(basis.doflocs)
            offset += basis.N
    line = np.unique(np.concatenate([x, 0.5 * (x[1:] + x[:-1])]))
    legs = {}
    crossing = offset
    offset += 1
    for axis in "xy":
        for sign in (-1, 1):
            # dofs of a leg by their distance to the crossing, which is number 0 of each
            legs[axis, sign] = np.concatenate([[crossing], np.arange(offset, offset + len(line) - 1)])
            offset += len(line) - 1

    parts = {}

    def add(name, matrix, r, c):
        matrix = matrix.tocoo()
        ok = (r[matrix.row] >= 0) & (c[matrix.col] >= 0)
        entry = sp.coo_matrix((matrix.data[ok], (r[matrix.row[ok]], c[matrix.col[ok]])), shape=(offset, offset)).tocsr()
        parts[name] = parts.get(name, 0) + entry

    for sx, sy, mesh, basis, start in quadrants:
        own = start + np.arange(basis.N)
        add("rock", lap.assemble(basis), own, own)
        for axis, other in (("y", sx), ("x", sy)):
            k = 1 if axis == "y" else 0
            along = basis.doflocs[1 - k]
            on = np.abs(basis.doflocs[k]) < 1e-14
            leg = legs[axis, other]
            face = np.full(basis.N, -1)
            face[on] = leg[np.argmin(np.abs(np.abs(along[on])[:, None] - line[None, :]), axis=1)]
            facets = mesh.facets_satisfying(lambda z: np.abs(z[k]) < 1e-14, boundaries_only=True)
            trace = FacetBasis(mesh, ElementTriP2(), facets=facets)
            m, name = KN[axis] * mass.assemble(trace), f"leak_{axis}{other}"
            for r, c, sign in ((face, face, 1), (face, own, -1), (own, face, -1), (own, own, 1)):
                add(name, sign * m, r, c)
            # every leg belongs to two quadrants: half of its conductivity from each; the field on the line varies along it alone
            tangent = BilinearForm(lambda u, v, w, d=1 - k: grad(u)[d] * grad(v)[d])
            add(f"flow_{axis}{other}", 0.5 * C[axis] * tangent.assemble(trace), face, face)
    total = sum(parts.values()).tocsr()
    x_of = np.zeros(offset)
    fixed = {legs["y", -1][-1]: 1.0, legs["y", 1][-1]: 0.0, legs["x", -1][-1]: 0.0, legs["x", 1][-1]: 0.0}
    rock = []
    for sx, sy, mesh, basis, start in quadrants:
        rock += list(start + np.where(basis.doflocs[0] > 1 - 1e-12)[0])
    fixed |= {d: 0.0 for d in rock}
    held = np.array(sorted(fixed))
    x_of[held] = [fixed[d] for d in held]
    free = np.setdiff1d(np.arange(offset), held)
    x_of[free] = sla.spsolve(total[free][:, free].tocsc(), -(total @ x_of)[free])
    found = {"crossing": x_of[crossing], "out_rock": -(total @ x_of)[rock].sum()}
    names = {("y", -1): "west", ("y", 1): "east", ("x", -1): "south", ("x", 1): "north"}
    for leg, name in names.items():
        own = (parts[f"flow_{leg[0]}{leg[1]}"] + parts[f"leak_{leg[0]}{leg[1]}"]) @ x_of
        found[f"end_{name}"] = own[legs[leg][-1]]
        found[f"cross_{name}"] = own[crossing]
        found[f"leak_{name}"] = (parts[f"leak_{leg[0]}{leg[1]}"] @ x_of)[legs[leg]].sum()
        found[f"middle_{name}"] = x_of[legs[leg][np.argmin(np.abs(line - 0.5))]]
    return found


if __name__ == "__main__":
    rows = [solve(n) for n in (8, 16, 32, 64)]
    for row in rows:
        print(row)
    out = {
        name: {"value": float(rows[-1][name]), "difference_to_coarser": float(abs(rows[-1][name] - rows[-2][name]))}
        for name in rows[-1]
    }
    out["C"], out["kn"], out["_how"] = [C["y"], C["x"]], [KN["y"], KN["x"]], __doc__
    json.dump(out, open("crossing_flow.json", "w"), indent=1)
